#include "scenegen/smear/body_poses.h"

#include <math.h>

#include "scenegen/smear/gauss_legendre.h"

/* Largest motion of a panel of the quadrature with one to four points, PSF sigmas, for which the
 * error of the integral of an edge's image over it is PANEL_ERROR: with n points it is in
 * proportion to the power 2 n of the motion, and over p panels it is PANEL_ERROR / p of the light,
 * beside pixels with a light of PANEL_LIGHT / p at least. tests/scenegen/test_body_poses.c compares
 * these bounds with integrals. */
static const double gauss_reach[BST_SMEAR_GAUSS_MOST] = {0.1, 0.7, 1.7, 3.2};
static const double PANEL_ERROR = 1.2e-4, PANEL_LIGHT = 0.08;

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

/* Sets error and light of graded poses with a step, PSF sigmas. Glints make the density uneven. */
static void graded_error(const bst_body_times_aim *aim, double step, bst_body_times *out) {
    double ends = step / 2.4;
    out->error =
        (step * exp(-2.0 * BST_PI * BST_PI / (step * step)) / BST_PI + ENDS * ends * ends) /
        aim->sigmas * (aim->glint_count > 0 ? 2.0 : 1.0);
    out->light = fmin((step < ALIASED ? AT_END : WIDE) * step / aim->sigmas, 1.0);
}

double bst_body_times_sigma(const bst_body_times *t, double pose_e, double light_e,
                            double dark_variance_e2) {
    return t->error * pose_e / sqrt(t->light * light_e + dark_variance_e2);
}

static bool fits(const bst_body_times_aim *aim, const bst_body_times *t) {
    return bst_body_times_sigma(t, aim->pose_e, aim->light_e, aim->dark_variance_e2) <=
           aim->allowed_sigma;
}

/* About a glint poses follow each other by GLINT_STEP of the width of the lobe, and at a distance
 * from it by GLINT_GROWTH of that: equal steps in s with u - glint = (GLINT_STEP per /
 * GLINT_GROWTH) sinh(GLINT_GROWTH s), of which the midpoint rule errs by exp(-pi^2 / GLINT_GROWTH).
 */
static const double GLINT_STEP = 0.4, GLINT_GROWTH = 0.7;

/* Poses that the glints take in addition before time u. *density: their derivative. */
static double glint_poses(const bst_glint *glints, int count, double u, double *density) {
    double sum = 0.0;
    *density = 0.0;
    for (int i = 0; i < count; i++) {
        double step = GLINT_STEP * glints[i].per, at = GLINT_GROWTH * (u - glints[i].u) / step;
        double start = -GLINT_GROWTH * glints[i].u / step;
        sum += (asinh(at) - asinh(start)) / GLINT_GROWTH;
        *density += 1.0 / (step * sqrt(1.0 + at * at));
    }
    return sum;
}

/* Time of the graded pose s of `count`, which may be a fraction, and its derivative: steps near
 * both ends are shorter than in the middle. */
static double graded_time(double s, double count, double *step) {
    double half = 0.5 * graded_more(), from = s / WIDE, to = (count - s) / WIDE;
    double length = count - 2.0 * half * erf(count / WIDE);
    *step = (1.0 - NARROW * (exp(-from * from) + exp(-to * to))) / length;
    return (s - half * (erf(from) + erf(count / WIDE) - erf(to))) / length;
}

/* Sets poses that are graded and, where surfaces glint, closer: the midpoint rule in the number of
 * graded poses and those for the glints together. */
static void choose_graded(const bst_body_times_aim *aim, int count, double step,
                          bst_body_times *out) {
    const bst_glint *glints = aim->glints;
    int glint_count = aim->glint_count;
    double density, more = glint_poses(glints, glint_count, 1.0, &density), sum = 0.0;
    int all = (int)fmin(count + ceil(more), BST_BODY_POSES_MAX);
    double scale = (count + more) / all;
    for (int k = 0; k < all; k++) {
        double wanted = (k + 0.5) * scale, low = 0.0, high = count, s = wanted, du;
        for (int i = 0; i < 60 && glint_count > 0; i++) {
            s = 0.5 * (low + high);
            double before = glint_poses(glints, glint_count, graded_time(s, count, &du), &density);
            *(s + before < wanted ? &low : &high) = s;
        }
        out->u[k] = graded_time(s, count, &du);
        (void)glint_poses(glints, glint_count, out->u[k], &density);
        out->weight[k] = du / (1.0 + density * du);
        sum += out->weight[k];
    }
    for (int k = 0; k < all; k++) {
        out->weight[k] /= sum;
    }
    out->count = all;
    graded_error(aim, step * fmax(scale, 1.0), out);
}

/* The number of graded poses. *step: in the middle, sigmas. */
static int graded_count(const bst_body_times_aim *aim, double *step) {
    double longest = fmin(LONGEST, aim->sigmas * LONGEST / GRADED);
    double least = fmin(SHORTEST, 0.1 * longest);
    bst_body_times t;
    graded_error(aim, longest, &t);
    while (longest > least && !fits(aim, &t)) {
        longest *= STEP_RATIO;
        graded_error(aim, longest, &t);
    }
    double count = fmin(ceil(aim->sigmas / longest + graded_more()), BST_BODY_POSES_MAX);
    *step = aim->sigmas / (count - graded_more());
    return (int)count;
}

/* Sets error and light of a number of panels with `order` + 1 points. */
static void panel_error(const bst_body_times_aim *aim, int order, double panels,
                        bst_body_times *out) {
    double parts = aim->sigmas / gauss_reach[order] / panels;
    out->error = PANEL_ERROR / panels * pow(parts, 2.0 * order + 2.0);
    out->light = PANEL_LIGHT / panels;
}

static int panel_count(const bst_body_times_aim *aim, int order) {
    double most = floor(BST_BODY_POSES_MAX / (order + 1.0));
    double count = fmax(ceil(aim->sigmas / gauss_reach[order] - 1e-9), 1.0);
    bst_body_times t;
    panel_error(aim, order, count, &t);
    while (count < most && !fits(aim, &t)) {
        count = ceil(1.05 * count);
        panel_error(aim, order, count, &t);
    }
    return (int)fmin(count, most);
}

void bst_body_times_choose(const bst_body_times_aim *aim, bst_body_times *out) {
    int order = 0, panels = panel_count(aim, 0), graded = BST_BODY_POSES_MAX + 1;
    double step = 0.0;
    for (int k = 1; k < BST_SMEAR_GAUSS_MOST; k++) {
        int count = panel_count(aim, k);
        if (count * (k + 1) < panels * (order + 1)) {
            order = k;
            panels = count;
        }
    }
    if (aim->sigmas >= GRADED || aim->glint_count > 0) {
        graded = graded_count(aim, &step);
    }
    if (graded < panels * (order + 1) || aim->glint_count > 0) {
        choose_graded(aim, graded, step, out);
        return;
    }
    panel_error(aim, order, panels, out);
    out->count = 0;
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
        BST_TRY(bst_resolved_begin_box(ctx, image, d->low, d->high, d->cell_px));
        BST_TRY(bst_resolved_begin_light_beside(ctx, image, d->image, d->blurred));
    }
    for (int k = g; k < d->count; k += BST_BODY_GROUPS) {
        BST_TRY(d->draw(ctx, d->user, k, pose, image));
    }
    bst_resolved_settle_light(image);
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
    BST_TRY(bst_resolved_begin_light(ctx, d->image, d->blurred)); /* others borrow from it */
    bst_parallel_for(d->pool, groups, 1, draw_groups, &r);
    for (int g = 0; g < groups; g++) {
        if (r.status[g] != BST_OK) {
            return bst_fail(ctx, r.status[g], "%s", r.ctx[g].message);
        }
        if (g > 0) {
            bst_resolved_join_light(d->image, poses->image[g - 1], d->pool);
        }
    }
    bst_resolved_end_light(d->image, d->scale_rad);
    return BST_OK;
}
