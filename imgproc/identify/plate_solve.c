#include "imgproc/identify/plate_solve.h"

#include <assert.h>
#include <math.h>

enum { SHAPES = 8, PASSES = 4 };
/* Candidates of a frame of points: most are solved by the first, and pieces of streaks are not. */
enum { POINT_CANDIDATES = 3000 };
/* Ends nearer to each other than this are one: the stars are points. */
static const double POINT_PX = 4.0;
/* Streaks are of one length within this. */
static const double SAME_PX = 1.5;
/* Least log-likelihood of a streak's ends over that of ends elsewhere: one wrong in 3000. */
static const double LEAST_MARGIN = 8.0;

/* A frame that is being solved. */
typedef struct attempt {
    bst_ctx *ctx;
    bst_lost_in_space *lost;
    const bst_plate_solve_options *options;
    bst_streak_finder *finder;
    bst_common_streak streak;
    int width, height;
} attempt;

/* Solves the stars by the middles of their streaks. */
static bst_status solve_middles(attempt *a, int candidates, bst_lost_in_space_result *out) {
    bst_lost_in_space_options options = BST_LOST_IN_SPACE_USUAL;
    options.scale_tolerance = a->options->scale_tolerance;
    options.max_candidates = candidates;
    const bst_lost_in_space_frame frame = {
        a->streak.items,     a->streak.count,   {0, 0, a->width, a->height},
        a->options->v_limit, a->options->light, NULL};
    return bst_lost_in_space_solve(a->ctx, a->lost, &options, &frame, out);
}

static double length_px(const bst_common_streak *s) {
    return hypot(s->ends[1].x_px - s->ends[0].x_px, s->ends[1].y_px - s->ends[0].y_px);
}

/* Measures the path on the identified stars and solves again, until the streak keeps its length.
 * Ends that are not certain then may lie in the light of other stars, with the middle of the
 * exposure in the wrong place: such a frame is not solved. */
static bst_status improve(attempt *a, bst_lost_in_space_result *out) {
    for (int pass = 0; pass < PASSES; pass++) {
        bool chosen[BST_PLATE_SOLVE_STARS];
        bst_lost_in_space_result again;
        double before = length_px(&a->streak);
        for (int i = 0; i < a->streak.count; i++) {
            chosen[i] = bst_lost_in_space_matched(a->lost, i);
        }
        BST_TRY(bst_streak_finder_repeat(a->ctx, a->finder, chosen, &a->streak));
        BST_TRY(solve_middles(a, BST_LOST_IN_SPACE_USUAL.max_candidates, &again));
        *out = again;
        if (!again.solved) {
            return BST_OK;
        }
        if (fabs(length_px(&a->streak) - before) < SAME_PX) {
            out->solved = a->streak.ends_margin > LEAST_MARGIN;
            return BST_OK;
        }
    }
    out->solved = false;
    return BST_OK;
}

/* Whole light of a source of unit amplitude. The convolution is with a Gaussian of 1 px and unit
 * sum of squares, after which a point of light F has the height F / sqrt(4 pi). Along a streak the
 * amplitude is that of a sample, which its neighbours overlap. */
static double light_of_amplitude(const bst_plate_solve_result *r) {
    double light = 0.0;
    if (r->points) {
        return sqrt(4.0 * BST_PI);
    }
    for (int k = -r->path.count; k <= r->path.count; k++) {
        double d = BST_STAR_PATH_STEP_PX * k;
        light += r->path.count * BST_STAR_PATH_STEP_PX * exp(-0.25 * d * d);
    }
    return light;
}

/* Lists the stars that the catalogue has. */
static void list_matched(const attempt *a, bst_plate_solve_result *out) {
    double light = light_of_amplitude(out);
    out->matched_count = 0;
    for (int i = 0; i < a->streak.count && out->attitude.solved; i++) {
        const bst_detection *d = &a->streak.items[i];
        if (bst_lost_in_space_matched(a->lost, i) && !(d->flags & BST_DETECTION_EDGE)) {
            out->matched[out->matched_count++] =
                (bst_plate_solve_star){d->x_px, d->y_px, light * d->flux_e};
        }
    }
}

static bst_status try_shapes(attempt *a, bst_plate_solve_result *out) {
    int shapes = bst_streak_finder_shapes(a->finder);
    int shape = shapes > 0 ? BST_STREAK_FINDER_POINT : 0;
    for (; shape < shapes && shape < SHAPES && !out->attitude.solved; shape++) {
        bool point = shape == BST_STREAK_FINDER_POINT;
        BST_TRY(bst_streak_finder_find(a->ctx, a->finder, shape, &a->streak));
        BST_TRY(solve_middles(a, point ? POINT_CANDIDATES : BST_LOST_IN_SPACE_USUAL.max_candidates,
                              &out->attitude));
        out->points = length_px(&a->streak) < POINT_PX;
        if (out->attitude.solved && !out->points) {
            BST_TRY(improve(a, &out->attitude));
        }
        out->stars = a->streak.count;
        out->ends_margin = a->streak.ends_margin;
        out->ends[0] = a->streak.ends[0];
        out->ends[1] = a->streak.ends[1];
        out->path = *bst_streak_finder_path(a->finder);
        list_matched(a, out);
    }
    return BST_OK;
}

bst_status bst_plate_solve(bst_ctx *ctx, bst_lost_in_space *lost,
                           const bst_plate_solve_options *options, const float *pixels, int width,
                           int height, bst_plate_solve_result *out) {
    assert(lost && options && pixels && out && options->light);
    *out = (bst_plate_solve_result){.points = false};
    attempt a = {.ctx = ctx, .lost = lost, .options = options, .width = width, .height = height};
    const bst_common_streak_options streak = {.max_sources = BST_PLATE_SOLVE_STARS,
                                              .least_snr = options->least_snr,
                                              .tangent_per_px = options->tangent_per_px};
    BST_TRY(bst_streak_finder_create(ctx, pixels, width, height, &streak, &a.finder));
    bst_status status = try_shapes(&a, out);
    bst_streak_finder_free(a.finder);
    return status;
}
