/* Headers of the frames: times, exposures, sizes. */
#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "sim/cli/shipped.h"
#include "sim/process/process_internal.h"

enum { MOST_FRAMES = 1000000 };

static bst_status read_map(bst_ctx *ctx, bst_process *p) {
    BST_TRY(bst_cli_find_keyword_map(ctx, p->request->map, p->map_path));
    BST_TRY(bst_keyword_map_load(ctx, p->map_path, &p->map));
    if (p->request->scale_arcsec > 0.0) {
        p->map.pixel_scale_arcsec =
            (bst_keyword_number){.factor = 1.0, .value = p->request->scale_arcsec};
    }
    p->options.map = &p->map;
    p->options.flip_rows = p->request->flip == BST_PROCESS_FLIP_YES;
    return BST_OK;
}

static bst_status fail_frame(bst_ctx *ctx, const bst_process_frame *f, bst_status status) {
    return bst_recorded_frame_fail(ctx, f->path, &f->place, status);
}

/* Reads the header of one frame. */
static bst_status read_frame(bst_ctx *ctx, bst_process *p, int64_t index, bst_process_frame *f) {
    bst_recorded_frame r;
    BST_TRY(bst_recorded_frames_select(ctx, p->recorded, index, &p->options, &r));
    *f = (bst_process_frame){.index = index, .path = r.path, .place = r.place, .values = r.values};
    if (index == 0) {
        p->width = r.width;
        p->height = r.height;
        p->scale_arcsec = r.values.pixel_scale_arcsec;
        p->placed = r.values.has_position;
    }
    if (r.width != p->width || r.height != p->height) {
        return fail_frame(ctx, f,
                          bst_fail(ctx, BST_ERR_ARGUMENT,
                                   "%s %d x %d pixels, the first frame has %d x %d (allowed: "
                                   "frames of one size)",
                                   r.place.hdu > 0 ? "NAXIS1 and NAXIS2 give" : "the picture has",
                                   r.width, r.height, p->width, p->height));
    }
    if (r.values.exposure_s <= 0.0) {
        char name[BST_KEYWORD_TEXT];
        return fail_frame(ctx, f,
                          bst_fail(ctx, BST_ERR_FORMAT,
                                   "%s (exposure_s of the map %s) gives 0 (allowed: above 0)",
                                   bst_keyword_name(bst_recorded_frames_source(p->recorded),
                                                    p->map.exposure_s.keyword, name),
                                   p->map.name));
    }
    BST_TRY(bst_keyword_attitude(ctx, &p->map, bst_recorded_frames_source(p->recorded), &r.place,
                                 bst_recorded_flips(&p->options), &f->has_header_attitude,
                                 &f->q_header));
    bst_keyword_rate_trend(ctx, &p->map, bst_recorded_frames_source(p->recorded), &r.place,
                           r.values.exposure_s, &f->rate_trend, &f->rate_trend_sigma);
    return BST_OK;
}

static int by_start(const void *a, const void *b) {
    const bst_process_frame *f = a, *g = b;
    double d = bst_time_diff(f->values.start, g->values.start);
    return d != 0.0 ? (d > 0.0 ? 1 : -1) : (f->index > g->index) - (f->index < g->index);
}

/* Keyword of a frame's time, for messages. */
static const char *time_keyword(bst_ctx *ctx, const bst_process *p, const bst_process_frame *f,
                                char keyword[BST_KEYWORD_TEXT]) {
    const bst_recorded_options plain = {.map = NULL};
    bst_recorded_frame r;
    return bst_recorded_frames_select(ctx, p->recorded, f->index, &plain, &r) == BST_OK
               ? bst_keyword_name(bst_recorded_frames_source(p->recorded), p->map.time.keyword,
                                  keyword)
               : p->map.time.keyword;
}

/* Sets the ticks and checks that exposures follow each other. */
static bst_status set_ticks(bst_ctx *ctx, bst_process *p) {
    for (int i = 0; i < p->count; i++) {
        bst_process_frame *f = &p->frames[i], *before = i > 0 ? f - 1 : NULL;
        double start_s = bst_time_diff(f->values.start, p->frames[0].values.start);
        f->start_tick = (int64_t)floor(start_s * BST_PROCESS_TICK_RATE_HZ + 0.5);
        f->exposure_ticks = (int64_t)floor(f->values.exposure_s * BST_PROCESS_TICK_RATE_HZ + 0.5);
        int64_t ended = before ? before->start_tick + before->exposure_ticks : 0;
        if (before && (f->start_tick < ended || f->start_tick <= before->start_tick)) {
            char where[BST_FRAME_WHERE_TEXT], keyword[BST_KEYWORD_TEXT];
            return fail_frame(
                ctx, f,
                bst_fail(
                    ctx, BST_ERR_ARGUMENT,
                    "%s%s begins %.6g s before the end of the exposure before it, %s (allowed: "
                    "frames of one camera, in the order of time); give the %s in that order, "
                    "or a map with the right time and exposure_s",
                    f->place.line > 0 ? "column " : "", time_keyword(ctx, p, f, keyword),
                    (double)(ended - f->start_tick) / BST_PROCESS_TICK_RATE_HZ,
                    bst_frame_where(before->path, &before->place, where),
                    f->place.line > 0 ? "rows" : "files"));
        }
        if (start_s > 1e9) {
            return fail_frame(ctx, f,
                              bst_fail(ctx, BST_ERR_ARGUMENT,
                                       "%s is %.3g s after the first frame (allowed: 1e9 s)",
                                       p->map.time.keyword, start_s));
        }
    }
    return BST_OK;
}

bst_status bst_process_survey(bst_ctx *ctx, bst_process *p, const char *const *paths, int count) {
    BST_TRY(read_map(ctx, p));
    BST_TRY(bst_recorded_frames_open(ctx, paths, count, &p->map, &p->recorded));
    int64_t frames = bst_recorded_frames_count(p->recorded);
    if (frames > MOST_FRAMES) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "%lld frames were given (allowed: %d)",
                        (long long)frames, MOST_FRAMES);
    }
    p->frames = calloc((size_t)frames, sizeof *p->frames);
    if (!p->frames) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for %lld frames", (long long)frames);
    }
    for (p->count = 0; p->count < frames; p->count++) {
        BST_TRY(read_frame(ctx, p, p->count, &p->frames[p->count]));
    }
    if (bst_recorded_frames_files(p->recorded) == frames) { /* a frame a file: any order */
        qsort(p->frames, (size_t)p->count, sizeof *p->frames, by_start);
    }
    return set_ticks(ctx, p);
}

void bst_process_free(bst_process *p) {
    for (int i = 0; i < p->count; i++) {
        free(p->frames[i].nodes);
    }
    free(p->frames);
    bst_recorded_frames_close(p->recorded);
}

/* Distance from the Earth's centre that is assumed without a position: that of geostationary
 * orbits, on the line of sight, so that the Earth is behind the camera. */
static const double ASSUMED_M = 42164e3;

void bst_process_observer(const bst_process_frame *f, bst_vec3 *position_m,
                          bst_vec3 *velocity_mps) {
    bst_vec3 ahead = bst_quat_rotate(bst_quat_conj(f->solved ? f->q_middle : BST_QUAT_IDENTITY),
                                     (bst_vec3){0, 0, 1});
    *position_m =
        f->values.has_position ? f->values.position_gcrf_m : bst_vec3_scale(ahead, ASSUMED_M);
    *velocity_mps = f->values.has_velocity ? f->values.velocity_gcrf_mps : (bst_vec3){0, 0, 0};
}

bst_status bst_process_path(bst_ctx *ctx, const bst_process *p, const char *name, char path[4096]) {
    int n = snprintf(path, 4096, "%s/%s", p->request->out, name);
    return n > 0 && n < 4096
               ? BST_OK
               : bst_fail(ctx, BST_ERR_ARGUMENT, "%.80s...: the path is too long", p->request->out);
}
