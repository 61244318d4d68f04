/* Where the onboard catalogue's stars should be on the focal plane. */
#ifndef BST_IMGPROC_IDENTIFY_PREDICTED_STARS_H
#define BST_IMGPROC_IDENTIFY_PREDICTED_STARS_H

#include "boresight/camera.h"
#include "imgproc/identify/starid.h"
#include "sim/astro/bodies.h"
#include "sim/catalogue/stars.h"

typedef struct bst_predicted_stars {
    const bst_camera *camera;
    const bst_stars *stars;
    double julian_year;
    int capacity;
    bst_star *found;                     /* [capacity] */
    bst_imgproc_expected_star *expected; /* [capacity] */
} bst_predicted_stars;

/* Allocates the prediction of catalogue stars in a frame.
 *
 * Given:     camera, stars  must outlive it
 *            julian_year    epoch for proper motion, Julian year
 *            capacity       most stars of a frame
 * Errors:    BST_ERR_MEMORY; then `out` holds nothing to free
 * Ownership: free with bst_predicted_stars_free */
bst_status bst_predicted_stars_create(bst_ctx *ctx, const bst_camera *camera,
                                      const bst_stars *stars, double julian_year, int capacity,
                                      bst_predicted_stars *out) BST_MUST_CHECK;
/* Frees the memory of the predicted stars and clears the struct, which belongs to the caller. */
void bst_predicted_stars_free(bst_predicted_stars *sky);

/* The stars to v_limit whose apparent places fall within margin_px of a window, for a camera at
 * q_cam_from_gcrf that sees light as `light` says. */
typedef struct bst_predicted_stars_query {
    bst_quat q_cam_from_gcrf;
    const bst_light *light;
    bst_window window;
    double margin_px, v_limit;
} bst_predicted_stars_query;

/* Fills sky->expected with the stars that are asked for. Where there are more
 * than fit, the limit is raised by half a magnitude until they do. */
bst_status bst_predicted_stars_expect(bst_ctx *ctx, bst_predicted_stars *sky,
                                      const bst_predicted_stars_query *query,
                                      int *count) BST_MUST_CHECK;

#endif
