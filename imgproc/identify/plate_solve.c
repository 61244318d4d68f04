#include "imgproc/identify/plate_solve.h"

#include <assert.h>
#include <math.h>

enum { SHAPES = 5 };
/* Ends nearer to each other than this are one: the stars are points. */
static const double POINT_PX = 4.0;

/* Solves the stars by one end of their streaks, of those that have it in the frame. */
static bst_status solve_end(bst_ctx *ctx, bst_lost_in_space *lost, const bst_plate_solve_options *o,
                            int end, bst_plate_solve_result *out) {
    bst_detection items[BST_PLATE_SOLVE_STARS];
    const bst_common_streak *streak = &out->streak;
    int count = 0;
    for (int i = 0; i < streak->count; i++) {
        bst_detection d = streak->items[i];
        d.x_px += streak->ends[end].x_px;
        d.y_px += streak->ends[end].y_px;
        if (d.x_px >= 0.0 && d.y_px >= 0.0 && d.x_px <= streak->width - 1 &&
            d.y_px <= streak->height - 1) {
            items[count++] = d;
        }
    }
    bst_lost_in_space_options options = BST_LOST_IN_SPACE_USUAL;
    options.scale_tolerance = o->scale_tolerance;
    const bst_lost_in_space_frame frame = {
        items, count, {0, 0, streak->width, streak->height}, o->v_limit, o->light};
    out->end = end;
    return bst_lost_in_space_solve(ctx, lost, &options, &frame, &out->attitude);
}

bst_status bst_plate_solve(bst_ctx *ctx, bst_lost_in_space *lost,
                           const bst_plate_solve_options *options, const float *pixels, int width,
                           int height, bst_plate_solve_result *out) {
    assert(lost && options && pixels && out && options->light);
    *out = (bst_plate_solve_result){.points = false};
    bst_common_streak_options streak = {.candidates = SHAPES,
                                        .max_sources = BST_PLATE_SOLVE_STARS,
                                        .least_snr = options->least_snr};
    for (; streak.shape < SHAPES && !out->attitude.solved; streak.shape++) {
        bst_common_streak_free(&out->streak);
        BST_TRY(bst_common_streak_find(ctx, pixels, width, height, &streak, &out->streak));
        if (streak.shape >= out->streak.shapes) {
            break;
        }
        const bst_common_streak_point *ends = out->streak.ends;
        out->points =
            hypot(ends[1].x_px - ends[0].x_px, ends[1].y_px - ends[0].y_px) < POINT_PX;
        for (int end = 0; end < (out->points ? 1 : 2) && !out->attitude.solved; end++) {
            BST_TRY(solve_end(ctx, lost, options, end, out));
        }
    }
    return BST_OK;
}

void bst_plate_solve_free(bst_plate_solve_result *result) {
    bst_common_streak_free(&result->streak);
}
