/* Prediction of catalogue star positions on the focal plane. */
#ifndef BST_IMGPROC_IDENTIFY_PREDICTED_STARS_H
#define BST_IMGPROC_IDENTIFY_PREDICTED_STARS_H

#include "boresight/camera.h"
#include "imgproc/identify/starid.h"
#include "sim/astro/bodies.h"
#include "sim/catalogue/stars.h"

typedef struct bst_predicted_stars {
    const bst_camera *camera;
    const bst_stars *stars;
    double julian_year; /* of proper motion and variable stars; may change between queries */
    int capacity;
    bst_star *found;                     /* catalogue stars of the query */
    bst_imgproc_expected_star *expected; /* their predicted positions */
    bst_quat q_cam_from_gcrf;            /* of the latest query */
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

/* Query: catalogue stars down to v_limit whose apparent positions lie within margin_px of a window.
 */
typedef struct bst_predicted_stars_query {
    bst_quat q_cam_from_gcrf;
    /* velocity for aberration, the Sun's place for light deflection and parallax */
    const bst_light *light;
    bst_window window;
    double margin_px, v_limit;
} bst_predicted_stars_query;

/* Predicts catalogue star positions. If more than `capacity` stars match, v_limit is raised in
 * brightness by steps of half a magnitude until they fit.
 *
 * Returned:  sky->expected  predicted stars, full-sensor px
 *            *count         number of them */
bst_status bst_predicted_stars_expect(bst_ctx *ctx, bst_predicted_stars *sky,
                                      const bst_predicted_stars_query *query,
                                      int *count) BST_MUST_CHECK;

#endif
