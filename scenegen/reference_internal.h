/* Declarations shared by both reference renderers. */
#ifndef BST_SCENEGEN_REFERENCE_INTERNAL_H
#define BST_SCENEGEN_REFERENCE_INTERNAL_H

#include "scenegen/reference.h"

/* Position of a source at fraction u of the interval from track sample k to the next, and its
 * brightness then relative to the exposure's mean. Returns false if it is behind the camera. */
bool bst_reference_place(const bst_camera *camera, const bst_los_track *track,
                         const bst_scene_source *s, int k, double u, double *x, double *y,
                         double *light);

/* Reference image for any PSF, without vignetting; see bst_reference_render_psf. */
bst_status bst_reference_spectrum(bst_ctx *ctx, const bst_camera *camera, const bst_psf *psf,
                                  bst_window window, const bst_los_track *track,
                                  const bst_scene_source *sources, int count, double tolerance,
                                  double *image) BST_MUST_CHECK;

#endif
