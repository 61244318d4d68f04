/* The renderer: from a line-of-sight track and sources to a frame of digital numbers, on OpenCL.
 *
 * Every source has its own track through the exposure. Its light is a sum of weighted nodes, as
 * many as the source's brightness needs. A node is the product of two pixel-integrated Gaussian
 * profiles (kernels/splat.cl) or, for any other PSF, a point on a grid that is convolved with it
 * (fourier_render.h). Then background, shot noise, full well, read noise, gain, offset and
 * quantisation (detector.h). Noise is keyed by (key, exposure, pixel of the full sensor). The same
 * bytes come from any number of threads and work-group size and, with a Gaussian PSF, window. */
#ifndef BST_SCENEGEN_RENDERER_H
#define BST_SCENEGEN_RENDERER_H

#include "boresight/rng.h"
#include "scenegen/smear/smear.h"
#include "sim/device/device.h"
#include "sim/world/scene/field.h"

typedef struct bst_renderer bst_renderer;

typedef struct bst_renderer_options {
    double tolerance_sigma;       /* error of the image in any pixel that is allowed, in sigma
                                     of that pixel (0.05) */
    bst_rng_key pattern;          /* of the detector's fixed patterns */
    bst_smear_star_motion motion; /* whose track the stars follow (BST_STAR_MOTION_AUTO) */
    /* Knobs that the tolerance chooses when they are 0. Equal parts of the exposure per star; parts
     * of a pixel per axis to whose centres nodes are moved; px that stamps reach beyond a node's
     * two nearest pixels; odd degree of the PSF's profile (scenegen/stamp/profile_law.h); taps of
     * the Fourier path's spreading (4, 6 or 8). */
    int temporal_oversample, spatial_oversample, stamp_radius_px, psf_degree, fft_taps;
    /* Nodes that a frame may have beyond 16 for each source, 0: 2^24; BST_SCENE_SLEW times as many
     * where the paths of a slew need them (scenegen/scene_plan.h). Where the tolerance asks for
     * more, sources are drawn coarser. */
    long long max_nodes;
    bool saturation_flags;              /* kept of the latest frame, for bst_renderer_flags */
    int pool_frames;                    /* frames that may be alive at a time (4) */
    int tile_width, tile_height, group; /* pixels per work-item (width a multiple of 64) and
                                           work-items per group; 0: chosen for the device */
} bst_renderer_options;

/* Options with their defaults: error tolerance 0.05 sigma, pool of 4 frames. */
bst_renderer_options bst_renderer_default_options(void);

/* Builds the kernels and allocates. `options` may be NULL. BST_ERR_ARGUMENT for a camera that
 * cannot be drawn (psf_fwhm_px above 70, no pixels, bits outside 8..16). */
bst_status bst_renderer_create(bst_ctx *ctx, bst_device *device, const bst_camera *camera,
                               const bst_renderer_options *options,
                               bst_renderer **out) BST_MUST_CHECK;
/* Frames that are still referenced stay valid. */
void bst_renderer_free(bst_renderer *renderer);

/* One exposure. Pointers are borrowed for the call. */
typedef struct bst_render_request {
    bst_window window;          /* inside the sensor */
    const bst_los_track *track; /* its last time is the exposure's duration, unless: */
    double row_time_s; /* rolling shutter, where not 0: each row is exposed so much later than the
                          row before, for exposure_s, the middle row in the middle of the track */
    double exposure_s; /* with row_time_s */
    const bst_scene_source *sources;
    int count;
    double background_e; /* expected electrons per sensor pixel: sky and dark current */
    double dark_e;       /* of them, dark current (a map of it, if there is one, takes its place) */
    const struct bst_skylight_map *background; /* added to background_e, per sensor pixel; NULL:
                    none. Only where bst_skylight_may_vary. It covers the window, and its whole
                    columns where charge or light runs along them
                    (bst_detector_config_whole_columns) */
    int binning; /* 2 or more: so many pixels per side are added before they are read, and the
                    frame is smaller; window sides that are no multiple lose the rest */
    bst_rng_key key;
    int64_t exposure_id;
} bst_render_request;

/* What the latest rendering took and did. */
typedef struct bst_render_stats {
    int sources;            /* drawn */
    long long nodes;        /* all sources, filled blocks included */
    double predicted_sigma; /* largest error of the image that is expected in any pixel, in its
                               sigma (error_budget.h); NAN with temporal_oversample,
                               spatial_oversample or four fft_taps */
    bool tolerance_missed;  /* that is above the tolerance: the Fourier path's grid, or as many
                               nodes as may be, are too coarse */
    bool nodes_bounded;     /* the tolerance asks for more nodes than max_nodes */
    bool single_kernel;     /* the stars followed one track */
    int hits;               /* radiation hits on the sensor */
    double hits_e;          /* their charge */
} bst_render_stats;

/* Renders; *out gets a frame with one reference. Does not wait for it, but for the frame
 * BST_STAGE_SETS before it and, where the PSF is no Gaussian, for the light. */
bst_status bst_renderer_render(bst_ctx *ctx, bst_renderer *renderer,
                               const bst_render_request *request, bst_frame **out) BST_MUST_CHECK;

/* Only chooses nodes and stamps, as the calls below do first: for bst_renderer_peak_e and the
 * statistics of an exposure that is not rendered. */
bst_status bst_renderer_plan(bst_ctx *ctx, bst_renderer *renderer,
                             const bst_render_request *request) BST_MUST_CHECK;

/* The same sources and nodes without noise or detector: expected electrons per pixel (background
 * included), [height][width]. Waits. */
bst_status bst_renderer_render_noise_free(bst_ctx *ctx, bst_renderer *renderer,
                                          const bst_render_request *request,
                                          float *image) BST_MUST_CHECK;

/* Pixels of the latest frame with a full well or the highest digital number. Waits for it. */
bst_status bst_renderer_saturated(bst_ctx *ctx, bst_renderer *renderer,
                                  long long *pixels) BST_MUST_CHECK;
/* Why which pixel of the latest frame is saturated: BST_FLAG_... (kernels/scene_shared.h), in the
 * frame's own size. With saturation_flags; waits for the frame. */
bst_status bst_renderer_flags(bst_ctx *ctx, bst_renderer *renderer, size_t pixels,
                              uint8_t *out) BST_MUST_CHECK;
/* Frames with such a pixel so far, without the latest two (BST_STAGE_SETS) unless
 * bst_renderer_saturated has been asked. Does not wait. */
long long bst_renderer_saturated_frames(const bst_renderer *renderer);

/* The first call after a request takes 0.1 us per source for the predicted error. */
void bst_renderer_get_stats(const bst_renderer *renderer, bst_render_stats *out);

/* Expected electrons of source `index` (of the latest request) in its brightest pixel, without
 * background. */
double bst_renderer_peak_e(const bst_renderer *renderer, int index);

/* Pixels outside the window from which a source can still light it. */
int bst_renderer_margin_px(const bst_renderer *renderer);

#endif
