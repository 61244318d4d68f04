/* Long star streaks: their path from the telemetry of the pointing. */
#include <math.h>

#include "imgproc/module_internal.h"
#include "imgproc/streak/star_path.h"

/* Nodes of a path: beyond these, samples of the telemetry are left out evenly. */
enum { NODES = 2048 };
/* Probability of a star for a streak like those of the identified stars. */
static const double STAR_PROBABILITY = 0.9;

/* Sample number n of the ring. */
#define SAMPLE(t, n) (&(t)->items[(n) % (t)->capacity])

/* Attitude at a tick between two samples, at a constant rate. */
static bst_quat between(const bst_pointing_sample *a, const bst_pointing_sample *b, double tick) {
    double share = b->tick > a->tick ? (tick - (double)a->tick) / (double)(b->tick - a->tick) : 0.0;
    return bst_quat_slerp(a->q_cam_from_gcrf, b->q_cam_from_gcrf, share);
}

/* Motion of the image of one star. */
typedef struct star_motion {
    const bst_camera *camera;
    bst_quat gcrf_from_mean; /* mean attitude of the exposure */
    bst_vec3 direction;      /* of the star in the camera at that attitude */
    bst_star_path_node *nodes;
    int count;
} star_motion;

/* Adds the star's place at a time. */
static void add_node(star_motion *s, double tick, bst_quat q_cam_from_gcrf) {
    double x, y;
    bst_quat turn = bst_quat_mul(q_cam_from_gcrf, s->gcrf_from_mean);
    if (s->count < NODES && (s->count == 0 || tick > s->nodes[s->count - 1].time) &&
        bst_camera_project(s->camera, bst_quat_rotate(turn, s->direction), &x, &y)) {
        s->nodes[s->count++] = (bst_star_path_node){tick, x, y};
    }
}

/* Adds the star's places during an exposure. */
static void add_nodes(star_motion *s, const bst_pointing_telemetry *t, double start, double end) {
    int64_t newest = t->written - 1;
    int64_t oldest = t->written > t->capacity ? t->written - t->capacity : 0, first = newest;
    while (first > oldest && (double)SAMPLE(t, first)->tick > start) {
        first--;
    }
    int64_t last = first;
    while (last < newest && (double)SAMPLE(t, last)->tick < end) {
        last++;
    }
    int64_t every = 1 + (last - first) / (NODES - 4);
    for (int64_t n = first; n < last; n++) {
        const bst_pointing_sample *a = SAMPLE(t, n), *b = SAMPLE(t, n + 1);
        if ((double)b->tick <= start) {
            continue;
        }
        if (s->count == 0) {
            add_node(s, start, between(a, b, start));
        }
        if ((double)b->tick >= end) {
            add_node(s, end, between(a, b, end));
        } else if ((n - first) % every == 0) {
            add_node(s, (double)b->tick, b->q_cam_from_gcrf);
        }
    }
}

bst_status bst_imgproc_find_long_streaks(bst_ctx *ctx, const bst_imgproc_state *m,
                                         const bst_imgproc_lane *l, const bst_imgproc_exposure *e,
                                         const bst_pointing_telemetry *telemetry,
                                         bst_detections *out, bool *followed) {
    *followed = false;
    if (!telemetry || telemetry->written < 2 || !e->motion || m->windows.count > 0) {
        return BST_OK;
    }
    bst_star_path_node nodes[NODES];
    const bst_window *w = &e->message->window;
    star_motion s = {.camera = &m->camera,
                     .gcrf_from_mean = bst_quat_conj(e->motion->q_cam_from_gcrf),
                     .direction = bst_camera_unproject(&m->camera, w->x0 + 0.5 * (w->width - 1),
                                                       w->y0 + 0.5 * (w->height - 1)),
                     .nodes = nodes};
    add_nodes(&s, telemetry, (double)e->message->start_tick, (double)e->message->end_tick);
    return s.count < 2 ? BST_OK
                       : bst_imgproc_follow_streaks(ctx, l->ip, nodes, s.count, out,
                                                    (int)m->config->capacity, followed);
}

void bst_imgproc_label_long_streaks(const bst_imgproc_lane *l, bst_detections *out) {
    for (int i = 0; i < out->count; i++) {
        bst_detection *d = &out->items[i];
        if (bst_imgproc_is_followed(l->ip, d) && d->label != BST_LABEL_STAR) {
            d->label = BST_LABEL_STAR;
            d->label_probability = STAR_PROBABILITY;
        }
    }
}
