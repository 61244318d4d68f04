/* The image of a body in many poses of one exposure, drawn by several threads. */
#ifndef BST_SCENEGEN_SMEAR_BODY_POSES_H
#define BST_SCENEGEN_SMEAR_BODY_POSES_H

#include "sim/core/parallel.h"
#include "sim/world/scene/source_body.h"

enum { BST_BODY_POSES_MAX = 1024 };

/* Poses of an exposure. */
typedef struct bst_body_times {
    double u[BST_BODY_POSES_MAX], weight[BST_BODY_POSES_MAX]; /* fractions of the exposure */
    /* points of the Sun's disc that cast the shadows (bst_resolved_light); poses with the same time
     * follow each other */
    double shadow_at[BST_BODY_POSES_MAX][2];
    int count;
    double error; /* of the quadrature: of the light at a border, over that of the body */
    double light; /* where it is: light at least, over that of the body */
} bst_body_times;

/* Error of the poses, in sigma of a pixel.
 *
 * Given:     pose_e   light of a pixel in one pose, electrons in the exposure
 *            light_e  the same in all poses together */
double bst_body_times_sigma(const bst_body_times *times, double pose_e, double light_e,
                            double dark_variance_e2);

/* Requirements of the poses. */
typedef struct bst_body_times_aim {
    double sigmas;                                           /* motion of the image, PSF sigmas */
    double pose_e, light_e, dark_variance_e2, allowed_sigma; /* see bst_body_times_sigma */
    /* glints of the surfaces, with u and per as fractions of the exposure: about them poses follow
     * each other by less than half of the lobe's width */
    const bst_glint *glints;
    int glint_count;
} bst_body_times_aim;

/* Chooses the poses of an image that moves.
 *
 * Returned:  out  its error is larger than allowed if that takes more than BST_BODY_POSES_MAX poses
 *                 or steps below half a sigma */
void bst_body_times_choose(const bst_body_times_aim *aim, bst_body_times *out);

/* Poses are drawn in that many images, each with every so-manieth pose, and these are summed: the
 * same for any number of threads. */
enum { BST_BODY_GROUPS = 4 };

/* Work memory; zero-initialise, free with bst_body_poses_free. */
typedef struct bst_body_poses {
    bst_satellite_pose *pose[BST_BODY_GROUPS - 1]; /* of all groups but the first */
    bst_resolved *image[BST_BODY_GROUPS - 1];
} bst_body_poses;

/* Frees the work memory. */
void bst_body_poses_free(bst_body_poses *poses);

/* Adds pose k to an image. Called on several threads. */
typedef bst_status (*bst_body_pose_fn)(bst_ctx *ctx, void *user, int k, bst_satellite_pose *pose,
                                       bst_resolved *image);

/* What is drawn. */
typedef struct bst_body_drawing {
    const bst_satellite *satellite;
    bst_satellite_pose *pose; /* of the first group */
    bst_resolved *image;      /* of the first group, for which bst_resolved_begin was called */
    double low[2], high[2], cell_px, scale_rad;
    int count;    /* of poses */
    bool blurred; /* see bst_resolved_begin_light */
    bst_body_pose_fn draw;
    void *user;
    bst_parallel *pool; /* NULL: the caller's thread */
} bst_body_drawing;

/* Draws all poses by bst_resolved_add_light in the callback, and sets the light of the image.
 * Errors of the callback, and BST_ERR_MEMORY. */
bst_status bst_body_poses_draw(bst_ctx *ctx, bst_body_poses *poses,
                               const bst_body_drawing *drawing) BST_MUST_CHECK;

#endif
