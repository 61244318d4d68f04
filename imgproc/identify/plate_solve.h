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
    const bst_light *light;
} bst_plate_solve_options;

typedef struct bst_plate_solve_result {
    bst_lost_in_space_result attitude; /* of the time when the stars are at streak.ends[end] */
    bst_common_streak streak;
    bool points; /* the stars are points */
    int end;
} bst_plate_solve_result;

/* Solves a frame.
 *
 * Of the common streaks that the frame suggests, and of both ends of each, the first that gives an
 * attitude is used.
 *
 * Given:     lost    for BST_PLATE_SOLVE_STARS detections
 *            pixels  [height][width]; NAN: no value
 * Errors:    BST_ERR_MEMORY, those of the catalogue
 * Ownership: free *out with bst_plate_solve_free, also after an error */
bst_status bst_plate_solve(bst_ctx *ctx, bst_lost_in_space *lost,
                           const bst_plate_solve_options *options, const float *pixels, int width,
                           int height, bst_plate_solve_result *out) BST_MUST_CHECK;
/* Frees what bst_plate_solve allocated; the struct belongs to the caller. */
void bst_plate_solve_free(bst_plate_solve_result *result);

#endif
