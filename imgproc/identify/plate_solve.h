/* Attitude of a frame from its pixels alone: the stars are points or share one unknown streak. */
#ifndef BST_IMGPROC_IDENTIFY_PLATE_SOLVE_H
#define BST_IMGPROC_IDENTIFY_PLATE_SOLVE_H

#include "imgproc/identify/lost_in_space.h"
#include "imgproc/streak/common_streak.h"

/* Most stars of a frame that are used: room for the solver's detections. */
enum { BST_PLATE_SOLVE_STARS = 100 };

typedef struct bst_plate_solve_options {
    double scale_tolerance; /* largest relative error of the camera's pixel scale, 0 to 0.1 */
    double v_limit;         /* faintest V that the frame surely shows */
    double least_snr;       /* faintest detections that are used */
    double tangent_per_px;  /* of the camera, at the frame's middle */
    const bst_light *light;
} bst_plate_solve_options;

/* A star of the frame that the catalogue has. */
typedef struct bst_plate_solve_star {
    double x_px, y_px; /* at the middle of its streak */
    double flux;       /* whole light, in the unit of the pixels, for a Gaussian PSF of 1 px */
} bst_plate_solve_star;

typedef struct bst_plate_solve_result {
    bst_lost_in_space_result attitude; /* when the stars are at the middle of their streaks */
    int stars;                         /* found in the frame */
    bst_common_streak_point ends[2];   /* of the streaks, relative to their middle, px */
    double ends_margin; /* log-likelihood of these ends over that of ends more than 8 px away */
    bool points;        /* the stars are points */
    bst_star_path path; /* of the streaks; its light is the time spent along it */
    bst_plate_solve_star matched[BST_PLATE_SOLVE_STARS]; /* whole streaks only */
    int matched_count;
} bst_plate_solve_result;

/* Solves a frame.
 *
 * The paths that the frame suggests, among them that of points, are tried from the one on that its
 * brightest stars fit best. The path is then measured on the identified stars, and the frame
 * is solved again with it.
 *
 * Given:     lost    for BST_PLATE_SOLVE_STARS detections
 *            pixels  [height][width]; NAN: no value
 * Errors:    BST_ERR_MEMORY, those of the catalogue */
bst_status bst_plate_solve(bst_ctx *ctx, bst_lost_in_space *lost,
                           const bst_plate_solve_options *options, const float *pixels, int width,
                           int height, bst_plate_solve_result *out) BST_MUST_CHECK;

#endif
