/* A program of its own that uses libboresight: loads a scenario, runs its first frames and prints
 * what was rendered, found and tracked.
 *
 *   cc first_frames.c $(pkg-config --cflags --libs boresight) -o first_frames
 *   ./first_frames SCENARIO.json 5
 */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <boresight/boresight.h>

/* What the observer below keeps from one message to the next. */
typedef struct watch {
    bst_ctx *ctx;
    int64_t tracked; /* frames that the tracker has seen */
} watch;

static bst_status print_frame(watch *w, const bst_frame_message *m) {
    const uint16_t *pixels;
    BST_TRY(bst_frame_map(m->frame, w->ctx, &pixels)); /* row-major, row y = 0 first */
    size_t count = (size_t)m->frame->width * (size_t)m->frame->height;
    double sum = 0.0;
    unsigned peak = 0;
    for (size_t i = 0; i < count; i++) {
        sum += pixels[i];
        peak = pixels[i] > peak ? pixels[i] : peak;
    }
    bst_frame_unmap(m->frame);
    printf("frame %" PRId64 ": %d x %d px, mean %.1f DN, peak %u DN\n", m->exposure_id,
           m->frame->width, m->frame->height, sum / (double)count, peak);
    return BST_OK;
}

/* Sees every message of every sensor. The payload's type follows from the channel:
 * boresight/messages.h. */
static bst_status on_message(void *user, const char *scope, const char *channel,
                             const void *payload, int64_t tick) {
    watch *w = user;
    (void)scope;
    (void)tick;
    if (strcmp(channel, BST_CHANNEL_FRAME) == 0) {
        return print_frame(w, payload);
    }
    if (strcmp(channel, BST_CHANNEL_DETECTIONS) == 0) {
        const bst_detections *d = payload;
        printf("  %d detections, %d of them identified stars\n", d->count, d->stars_identified);
    } else if (strcmp(channel, BST_CHANNEL_TRACKS) == 0) {
        const bst_tracks *t = payload;
        w->tracked++;
        printf("  %d tracks\n", t->count);
        for (int i = 0; i < t->count; i++) {
            double ra, dec;
            bst_vec3_to_radec(t->items[i].direction_gcrf, &ra, &dec);
            printf("  track %" PRId64 ": RA %.4f deg, Dec %.4f deg, SNR %.1f\n", t->items[i].id,
                   ra / BST_DEG_RAD, dec / BST_DEG_RAD, t->items[i].snr);
        }
    }
    return BST_OK;
}

static bst_status run(bst_ctx *ctx, const char *path, int64_t frames) {
    const char *const assignments[] = {"/record/frames=none"};
    const bst_model_options options = {
        .assignments = assignments, .assignment_count = 1, .threads = 1};
    watch w = {.ctx = ctx};
    const bst_sim_observer observer = {.user = &w, .message = on_message};
    bst_model *model = NULL;
    bst_sim *sim = NULL;
    BST_TRY(bst_model_load(ctx, path, &options, &model));
    bst_status status = bst_sim_create(ctx, model, NULL, &sim);
    if (status == BST_OK) {
        bst_sim_observe(sim, &observer);
    }
    /* a tenth of a second at a time, until enough frames went through the whole chain */
    for (int tenths = 1; status == BST_OK && w.tracked < frames; tenths++) {
        status = bst_sim_run_until(ctx, sim, tenths / 10.0);
    }
    bst_sim_free(sim);
    bst_model_free(model);
    return status;
}

int main(int argc, char **argv) {
    if (argc != 3) {
        fprintf(stderr, "usage: %s SCENARIO.json FRAMES\n", argv[0]);
        return 2;
    }
    printf("libboresight %s\n", bst_version());
    bst_ctx ctx;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
    if (run(&ctx, argv[1], strtoll(argv[2], NULL, 10)) != BST_OK) {
        fprintf(stderr, "%s\n", ctx.message);
        return 1;
    }
    return 0;
}
