/* Cosmic rays: straight tracks of charge through the sensitive layer of the detector. */
#ifndef BST_SCENEGEN_DETECTOR_COSMIC_RAYS_H
#define BST_SCENEGEN_DETECTOR_COSMIC_RAYS_H

#include "boresight/detector_config.h"
#include "boresight/rng.h"
#include "boresight/status.h"

/* Charge of cosmic rays in a pixel. */
typedef struct bst_cosmic_rays_pixel {
    int index; /* row * stride + column */
    float electrons;
} bst_cosmic_rays_pixel;

typedef struct bst_cosmic_rays_summary {
    int tracks;       /* tracks that touch the sensor */
    int pixels;       /* pixels with charge */
    double electrons; /* total charge on the sensor */
} bst_cosmic_rays_summary;

typedef struct bst_cosmic_rays bst_cosmic_rays;

/* Creates a generator of cosmic-ray hits.
 *
 * Given:     width, height  of the sensor, px
 *            stride         row stride of the pixel indices
 * Errors:    BST_ERR_MEMORY */
bst_status bst_cosmic_rays_create(bst_ctx *ctx, const bst_detector_cosmic_ray_config *config,
                                  int width, int height, int stride,
                                  bst_cosmic_rays **out) BST_MUST_CHECK;
/* Excludes edges of the frame that are no pixels of the sensor. */
void bst_cosmic_rays_set_overscan(bst_cosmic_rays *hits, const bst_detector_edges_config *edges);
/* Frees a generator of radiation hits; NULL is allowed. */
void bst_cosmic_rays_free(bst_cosmic_rays *hits);

/* Draws the cosmic-ray hits of an exposure.
 *
 * Given:     exposure_id  random key of the exposure
 *            collect_s    time during which charge is collected, s
 * Returned:  *pixels  lent until the next call, ascending index, each once
 * Errors:    BST_ERR_CONFIG for more than a million hits
 * Notes:     Arrivals are a Poisson process at rate times area. The flux is isotropic: the cosine
 *            mu to the normal has the density 2 mu. A track enters anywhere and runs straight
 *            through the layer (length depth / mu, on the sensor depth sqrt(1/mu^2 - 1)). Its
 *            charge per length is e_per_um (1 + straggling m), m a Moyal deviate -ln z^2 (Moyal
 *            1955), limited to 0 or more. */
bst_status bst_cosmic_rays_draw(bst_ctx *ctx, bst_cosmic_rays *hits, bst_rng_key key,
                                int64_t exposure_id, double collect_s,
                                const bst_cosmic_rays_pixel **pixels,
                                bst_cosmic_rays_summary *summary) BST_MUST_CHECK;

#endif
