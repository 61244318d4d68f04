/* What both reference images share. */
#ifndef BST_SCENEGEN_REFERENCE_INTERNAL_H
#define BST_SCENEGEN_REFERENCE_INTERNAL_H

#include "scenegen/reference.h"

/* Where a source is at the share u of the stretch from sample k of the track to the next, and its
 * brightness then over the mean of the exposure. false behind the camera. */
bool bst_reference_place(const bst_camera *camera, const bst_los_track *track,
                         const bst_scene_source *s, int k, double u, double *x, double *y,
                         double *light);

/* The image by any PSF, without vignetting; see bst_reference_render_psf. */
bst_status bst_reference_spectrum(bst_ctx *ctx, const bst_camera *camera, const bst_psf *psf,
                                  bst_window window, const bst_los_track *track,
                                  const bst_scene_source *sources, int count, double tolerance,
                                  double *image) BST_MUST_CHECK;

#endif
