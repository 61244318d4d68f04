/* Reference renderer: double precision, slow; the renderer is validated against it.
 *
 * Gaussian PSF: erf-integrated pixels and Gauss-Legendre quadrature in time. Other PSFs: inverse
 * transform of the OTF times the spectrum of the source's positions in time. It includes all wings
 * and all frequencies up to the PSF's cut-off. The period is so large that wrap-around is below the
 * tolerance, or 1e-9 of a source's peak (1e-8 along diffraction spikes). */
#ifndef BST_SCENEGEN_REFERENCE_H
#define BST_SCENEGEN_REFERENCE_H

#include "sim/optics/psf.h"
#include "sim/world/scene/field.h"

/* Adds the expected electrons of the sources (no background) on `window` to image [height][width].
 *
 * The attitude is slerped between LOS samples. A source's direction is bst_scene_source_direction,
 * its illumination bst_camera_illumination. The time integral is refined by halving intervals
 * between LOS samples until the source's image changes by less than `tolerance` of its peak (1e-9
 * for a reference).
 *
 * Errors:    BST_ERR_NUMERIC without convergence; those of bst_psf_create */
bst_status bst_reference_render(bst_ctx *ctx, const bst_camera *camera, bst_window window,
                                const bst_los_track *track, const bst_scene_source *sources,
                                int count, double tolerance, double *image) BST_MUST_CHECK;

/* bst_reference_render with an existing PSF. */
bst_status bst_reference_render_psf(bst_ctx *ctx, const bst_camera *camera, const bst_psf *psf,
                                    bst_window window, const bst_los_track *track,
                                    const bst_scene_source *sources, int count, double tolerance,
                                    double *image) BST_MUST_CHECK;

/* Share of a unit Gaussian's light, centred at x px with standard deviation sigma_px, in pixel n.
 */
double bst_reference_pixel_share(double x, double sigma_px, int n);

#endif
