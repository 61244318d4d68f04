#include "scenegen/smear/body_poses.h"

#include <math.h>

#include "scenegen/smear/gauss_legendre.h"

/* Largest motion of a panel of the quadrature with one to four points, PSF sigmas: the error of
 * integrating an edge's image over it is below 1e-4. */
static const double gauss_reach[BST_SMEAR_GAUSS_MOST] = {0.1, 0.7, 1.7, 3.2};

/* Graded poses, for images that move by GRADED sigmas or more: the midpoint rule in s with
 * u'(s) = STEP (1 - NARROW (exp(-(s / WIDE)^2) + exp(-((n - s) / WIDE)^2))), steps that are NARROW
 * shorter at both ends, where that rule lacks the square of the step over 24 of the derivative. The
 * error, of the light at an edge, of steps h over L sigmas is at most
 * (h exp(-2 pi^2 / h^2) / pi + ENDS (h / 2.4)^2) / L; it is where the edge has passed WIDE steps or
 * more, or with steps below ALIASED, of which the error is that at the ends, AT_END steps.
 * tests/scenegen/test_body_poses.c compares these bounds with integrals. */
static const double GRADED = 10.0, LONGEST = 2.8, SHORTEST = 0.5, STEP_RATIO = 0.98;
static const double WIDE = 2.5, NARROW = 0.87, ENDS = 1.3e-3, ALIASED = 1.9, AT_END = 0.2;

/* Poses that short steps take in addition. */
static double graded_more(void) {
    return NARROW * WIDE * sqrt(BST_PI);
}

static double graded_error(double step, double sigmas) {
    double ends = step / 2.4;
    return (step * exp(-2.0 * BST_PI * BST_PI / (step * step)) / BST_PI + ENDS * ends * ends) /
           sigmas;
}

/* Steps near both ends are shorter than in the middle. */
static void choose_graded(double sigmas, int count, double step, bst_body_times *out) {
    double half = 0.5 * graded_more(), sum = 0.0;
    for (int k = 0; k < count; k++) {
        double from = (k + 0.5) / WIDE, to = (count - k - 0.5) / WIDE;
        double u = (k + 0.5 - half * (erf(from) + erf(count / WIDE) - erf(to))) /
                   (count - 2.0 * half * erf(count / WIDE));
        out->u[k] = u;
        out->weight[k] = 1.0 - NARROW * (exp(-from * from) + exp(-to * to));
        sum += out->weight[k];
    }
    for (int k = 0; k < count; k++) {
        out->weight[k] /= sum;
    }
    out->count = count;
    out->error = graded_error(step, sigmas);
    out->light = fmin((step < ALIASED ? AT_END : WIDE) * step / sigmas, 1.0);
}

/* The number of graded poses for an error. *step: in the middle, sigmas. */
static int graded_count(double sigmas, double allowed, double *step) {
    double longest = LONGEST, count;
    while (longest > SHORTEST && graded_error(longest, sigmas) > allowed) {
        longest *= STEP_RATIO;
    }
    count = fmin(ceil(sigmas / longest + graded_more()), BST_BODY_POSES_MAX);
    *step = sigmas / (count - graded_more());
    return (int)count;
}

void bst_body_times_choose(double sigmas, double allowed, bst_body_times *out) {
    int order = 0, graded = BST_BODY_POSES_MAX;
    double step = 0.0;
    while (order + 1 < BST_SMEAR_GAUSS_MOST && sigmas > gauss_reach[order]) {
        order++;
    }
    int panels = (int)fmin(fmax(ceil(sigmas / gauss_reach[order]), 1.0), BST_BODY_POSES_MAX);
    if (sigmas >= GRADED) {
        graded = graded_count(sigmas, allowed, &step);
    }
    if (graded < panels * (order + 1)) {
        choose_graded(sigmas, graded, step, out);
        return;
    }
    out->error = out->count = 0;
    out->light = 1.0;
    for (int p = 0; p < panels; p++) {
        for (int k = 0; k <= order; k++) {
            out->u[out->count] = (p + bst_smear_gauss_place[order][k]) / panels;
            out->weight[out->count++] = bst_smear_gauss_weight[order][k] / panels;
        }
    }
}

void bst_body_poses_free(bst_body_poses *p) {
    for (int i = 0; i < BST_BODY_GROUPS - 1; i++) {
        bst_satellite_pose_free(p->pose[i]);
        bst_resolved_free(p->image[i]);
    }
    *p = (bst_body_poses){.pose = {NULL}};
}

/* A drawing in progress. */
typedef struct run {
    bst_body_poses *poses;
    const bst_body_drawing *drawing;
    bst_ctx ctx[BST_BODY_GROUPS];
    bst_status status[BST_BODY_GROUPS];
} run;

/* Draws the poses of a group. */
static bst_status draw_group(run *r, int g) {
    const bst_body_drawing *d = r->drawing;
    bst_ctx *ctx = &r->ctx[g];
    bst_satellite_pose *pose = g == 0 ? d->pose : r->poses->pose[g - 1];
    bst_resolved *image = g == 0 ? d->image : r->poses->image[g - 1];
    if (!pose) {
        BST_TRY(bst_satellite_pose_create(ctx, d->satellite, &r->poses->pose[g - 1]));
        pose = r->poses->pose[g - 1];
    }
    if (!image) {
        BST_TRY(bst_resolved_create(ctx, d->satellite, &r->poses->image[g - 1]));
        image = r->poses->image[g - 1];
    }
    if (g > 0) {
        BST_TRY(bst_resolved_begin(ctx, image, d->low, d->high, d->cell_px));
    }
    BST_TRY(bst_resolved_begin_light(ctx, image, d->blurred));
    for (int k = g; k < d->count; k += BST_BODY_GROUPS) {
        BST_TRY(d->draw(ctx, d->user, k, pose, image));
    }
    return BST_OK;
}

/* Callback of the loop over groups. */
static void draw_groups(void *user, int begin, int end) {
    run *r = user;
    for (int g = begin; g < end; g++) {
        r->status[g] = draw_group(r, g);
    }
}

bst_status bst_body_poses_draw(bst_ctx *ctx, bst_body_poses *poses, const bst_body_drawing *d) {
    run r = {.poses = poses, .drawing = d};
    int groups = d->count < BST_BODY_GROUPS ? d->count : BST_BODY_GROUPS;
    bst_parallel_for(d->pool, groups, 1, draw_groups, &r);
    for (int g = 0; g < groups; g++) {
        if (r.status[g] != BST_OK) {
            return bst_fail(ctx, r.status[g], "%s", r.ctx[g].message);
        }
        if (g > 0) {
            bst_resolved_join_light(d->image, poses->image[g - 1]);
        }
    }
    bst_resolved_end_light(d->image, d->scale_rad);
    return BST_OK;
}
