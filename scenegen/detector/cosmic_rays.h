/* Radiation hits: straight tracks of charge through the sensitive layer. */
#ifndef BST_SCENEGEN_DETECTOR_COSMIC_RAYS_H
#define BST_SCENEGEN_DETECTOR_COSMIC_RAYS_H

#include "boresight/detector_config.h"
#include "boresight/rng.h"
#include "boresight/status.h"

/* Charge left in a pixel. */
typedef struct bst_cosmic_rays_pixel {
    int index; /* row * stride + column */
    float electrons;
} bst_cosmic_rays_pixel;

typedef struct bst_cosmic_rays_summary {
    int tracks;       /* that touch the sensor */
    int pixels;       /* with charge */
    double electrons; /* left on the sensor */
} bst_cosmic_rays_summary;

typedef struct bst_cosmic_rays bst_cosmic_rays;

/* width, height: of the sensor, px; stride: of the indices. */
bst_status bst_cosmic_rays_create(bst_ctx *ctx, const bst_detector_cosmic_ray_config *config,
                                  int width, int height, int stride,
                                  bst_cosmic_rays **out) BST_MUST_CHECK;
/* Frees a generator of radiation hits; NULL is allowed. */
void bst_cosmic_rays_free(bst_cosmic_rays *hits);

/* The hits of one exposure, keyed by it; *pixels are borrowed until the next call, each index once,
 * in ascending order.
 *
 * Times are a Poisson process at the rate times the area. The flux is isotropic, so that the cosine
 * mu to the normal has the density 2 mu on a surface. A track enters anywhere, runs straight
 * through the layer (length depth / mu, on the sensor depth sqrt(1/mu^2 - 1)) and leaves the same
 * charge per length in all its pixels: e_per_um (1 + straggling m), m a Moyal deviate -ln z^2
 * (Moyal 1955), cut at 0. BST_ERR_CONFIG for more than a million hits. */
bst_status bst_cosmic_rays_draw(bst_ctx *ctx, bst_cosmic_rays *hits, bst_rng_key key,
                                int64_t exposure_id, double collect_s,
                                const bst_cosmic_rays_pixel **pixels,
                                bst_cosmic_rays_summary *summary) BST_MUST_CHECK;

#endif
