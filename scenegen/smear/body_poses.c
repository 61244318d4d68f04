#include "scenegen/smear/body_poses.h"

#include <math.h>

#include "scenegen/smear/gauss_legendre.h"

/* Largest motion of a panel of the quadrature with one to four points, PSF sigmas: the error of
 * integrating an edge's image over it is below 1e-4. */
static const double gauss_reach[BST_SMEAR_GAUSS_MOST] = {0.1, 0.7, 1.7, 3.2};

/* Poses from which steps are equal, and the longest step, PSF sigmas, with a tolerance of TOLERANCE
 * or more; its square is as the tolerance. Between equal steps h the
 * image of an edge that n poses blur is wrong by exp(-2 pi^2 sigma^2 / h^2) / (pi n). At both ends
 * the midpoint rule lacks h^2 / 24 of the derivative, which the weights of two poses replace in
 * part. */
enum { EQUAL_POSES = 32 };
static const double STEP = 1.8, TOLERANCE = 0.1, STEP_ERROR = 0.033;
static const double end_weights[2] = {1.0 / 24.0, -1.0 / 24.0};

void bst_body_times_choose(double sigmas, double tolerance, bst_body_times *out) {
    int order = 0;
    while (order + 1 < BST_SMEAR_GAUSS_MOST && sigmas > gauss_reach[order]) {
        order++;
    }
    int panels = (int)fmin(fmax(ceil(sigmas / gauss_reach[order]), 1.0), EQUAL_POSES);
    out->error = out->count = 0;
    if (panels * (order + 1) <= EQUAL_POSES) {
        for (int p = 0; p < panels; p++) {
            for (int k = 0; k <= order; k++) {
                out->u[out->count] = (p + bst_smear_gauss_place[order][k]) / panels;
                out->weight[out->count++] = bst_smear_gauss_weight[order][k] / panels;
            }
        }
        return;
    }
    double longest = STEP * sqrt(fmin(tolerance / TOLERANCE, 1.0));
    int n = (int)fmin(fmax(ceil(sigmas / longest), EQUAL_POSES), BST_BODY_POSES_MAX);
    double step = sigmas / n / STEP;
    out->error = STEP_ERROR * step * step / n;
    out->count = n;
    for (int k = 0; k < n; k++) {
        int from_end = k < n - 1 - k ? k : n - 1 - k;
        out->u[k] = (k + 0.5) / n;
        out->weight[k] = (1.0 + (from_end < 2 ? end_weights[from_end] : 0.0)) / n;
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
    BST_TRY(bst_resolved_begin_light(ctx, image));
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
