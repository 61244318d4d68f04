/* Centre of mass and range of an extended target, from its silhouette and the Sun. */
#ifndef BST_IMGPROC_EXTENDED_CENTRE_OF_MASS_H
#define BST_IMGPROC_EXTENDED_CENTRE_OF_MASS_H

#include "boresight/camera.h"
#include "boresight/messages/detections.h"
#include "imgproc/extended/silhouette.h"

/* Frame in which a silhouette was found: full-sensor = origin + binning * frame pixel. */
typedef struct bst_extended_view {
    const bst_camera *camera;
    double origin_x_px, origin_y_px, binning;
    bool sun_known;
    bst_vec3 sun_cam; /* unit, camera axes: to the Sun */
} bst_extended_view;

/* Offset of a sphere's lit outline from its centre over its diameter, towards the Sun, by the phase
 * angle: 2 (1 - cos phase) / (3 pi).
 *
 * Notes:     the lit part is half of a disc and half of an ellipse with the semi-axis R |cos phase|
 *            (added below 90 deg, subtracted above). Their centroids are 4 R / (3 pi) and
 *            4 R cos phase / (3 pi) from the centre, their areas pi R^2 / 2 and
 *            pi R^2 cos phase / 2. */
double bst_outline_phase_offset(double phase_rad);

/* Offset of the centroid of light of a Lambertian sphere from its centre over its diameter, towards
 * the Sun.
 *
 * Reference: Lindegren, Astron. Astrophys. 57, 55 (1977), for Lambert's law */
double bst_light_phase_offset(double phase_rad);

/* Measures an extended target.
 *
 * Given:     config  handover_fwhm, phase_offset_factor, centre_sigma and the target's size are
 *                    used
 *            view    `binning` and camera of the silhouette's frame
 *            size_px what centre_sigma is a share of, if that is more than the silhouette's size
 * Returned:  *out  position, covariance, flux, extents and `extended`; label OBJECT
 * Notes:     the position is the centre of the outline (bst_outline_centre; of one cut by the
 *            frame's edge, the centroid) less its offset towards the Sun
 *            (bst_outline_phase_offset times the extent across the Sun's direction times
 *            phase_offset_factor). Between 0.8 and 1.2 hand-over sizes it goes over from the
 *            centroid of light, less its own offset: that of a point. Without the Sun's direction
 * there is no offset, and the covariance grows. */
void bst_extended_measure(const bst_extended_config *config, const bst_extended_view *view,
                          const bst_silhouette *silhouette, double size_px, bst_detection *out);

/* Moves a point detection by the offset of its centroid of light from the centre of mass.
 *
 * Given:     silhouette  of its source
 * Returned:  *detection  position and covariance; unchanged without the Sun's direction
 * Notes:     the offset is that of bst_extended_measure at the hand-over size. It vanishes at
 *            BST_SILHOUETTE_LEAST of that size, and is full from twice that on. */
void bst_extended_correct_point(const bst_extended_config *config, const bst_extended_view *view,
                                const bst_silhouette *silhouette, bst_detection *detection);

#endif
