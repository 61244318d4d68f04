/* The reference image: double precision, slow; what the renderer is measured against.
 *
 * A Gaussian PSF: its erf-integrated pixels, Gauss-Legendre quadrature in time. Any other: the
 * transform of the OTF times the spectrum of the source's places in time, all wings and all
 * frequencies up to the PSF's cut-off, on a period wide enough that what wraps around is below 1e-9
 * of a source's peak (1e-8 along diffraction spikes). */
#ifndef BST_SCENEGEN_REFERENCE_H
#define BST_SCENEGEN_REFERENCE_H

#include "sim/optics/psf.h"
#include "sim/world/scene/field.h"

/* Expected electrons of the sources (no background) on `window`, [height][width], added to `image`.
 * Between LOS samples the attitude is slerped; a source's direction is that of
 * bst_scene_source_direction. A source's light has the illumination of the place where it is
 * (bst_camera_illumination). Each source's time integral is refined, by halving stretches between
 * LOS samples, until the source's image changes by less than `tolerance` of its peak (1e-9 for a
 * reference). BST_ERR_NUMERIC when that does not happen; and what bst_psf_create refuses. */
bst_status bst_reference_render(bst_ctx *ctx, const bst_camera *camera, bst_window window,
                                const bst_los_track *track, const bst_scene_source *sources,
                                int count, double tolerance, double *image) BST_MUST_CHECK;

/* The same with a PSF that has been made. */
bst_status bst_reference_render_psf(bst_ctx *ctx, const bst_camera *camera, const bst_psf *psf,
                                    bst_window window, const bst_los_track *track,
                                    const bst_scene_source *sources, int count, double tolerance,
                                    double *image) BST_MUST_CHECK;

/* Share of a unit Gaussian's light, centred at x px with standard deviation sigma_px, on pixel n.
 */
double bst_reference_pixel_share(double x, double sigma_px, int n);

#endif
