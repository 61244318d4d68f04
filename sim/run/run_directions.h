/* Directions in which detections were measured, from onboard data: centroid, camera model, attitude
 * from stars. Without truth. */
#ifndef BST_RUN_RUN_DIRECTIONS_H
#define BST_RUN_RUN_DIRECTIONS_H

#include "boresight/archive.h"
#include "boresight/camera.h"
#include "boresight/messages.h"
#include "sim/astro/bodies.h"
#include "tracker/orbit/orbit_fit.h"

/* Measured direction of a detection and its covariance, from errors of centroid and attitude.
 *
 * Given:     x_px, y_px, cov_px2  of the detection, full-sensor coordinates; xx, xy, yy
 *            attitude  of its frame, from stars
 *            light     of the observer
 * Returned:  *out  its direction, covariance and shared_rad; the latter as if successive frames
 *                  shared all of the variance about camera x and y: multiply it by the root of the
 *                  fraction that they share */
void bst_run_measure_direction(const bst_camera *camera, double x_px, double y_px,
                               const double cov_px2[3], const bst_attitude_fix *attitude,
                               const bst_light *light, bst_od_observation *out);

/* bst_od_observation.shared_change between two attitudes: stars leave the field as the camera
 * turns. Two fields at distance d along a side s share the fraction 1 - d / s; the exponential used
 * has the same integral. */
double bst_run_change_of_stars(const bst_camera *camera, bst_quat q_cam_from_gcrf,
                               bst_quat next_cam_from_gcrf);

/* Centroids of the newest frames of a sensor, for tracks, which come later. Initialise with
 * zeros. */
enum { BST_RUN_CENTROID_FRAMES = 8 };
typedef struct bst_run_centroid {
    double x_px, y_px, cov_px2[3];
    double exposure_ticks;
} bst_run_centroid;
typedef struct bst_run_centroids {
    struct {
        int64_t exposure_id;
        int count, room;
        bst_run_centroid *items; /* [count] */
    } frames[BST_RUN_CENTROID_FRAMES];
    int next; /* the oldest */
} bst_run_centroids;

/* Takes the detections of a frame in place of those of the oldest. Errors: BST_ERR_MEMORY */
bst_status bst_run_centroids_add(bst_ctx *ctx, bst_run_centroids *centroids,
                                 const bst_detections *detections) BST_MUST_CHECK;
/* The centroid at exactly a place in the frame of an exposure; NULL: not there, or too old. */
const bst_run_centroid *bst_run_centroids_find(const bst_run_centroids *centroids,
                                               int64_t exposure_id, double x_px, double y_px);
/* Saves or restores them. Errors: BST_ERR_MEMORY; BST_ERR_FORMAT: the saved state lacks some */
bst_status bst_run_centroids_archive(bst_run_centroids *centroids,
                                     bst_archive *archive) BST_MUST_CHECK;
/* Frees the centroids of all frames. */
void bst_run_centroids_clear(bst_run_centroids *centroids);

#endif
