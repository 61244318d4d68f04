/* The renderer: from a line-of-sight track and sources to a frame of digital numbers, on OpenCL.
 *
 * Every source has its own track through the exposure. Its light is a sum of weighted quadrature
 * nodes, as many as its brightness requires. A node is the product of two pixel-integrated Gaussian
 * profiles (kernels/splat.cl) or, for other PSFs, a point on a grid that is convolved with the PSF
 * (fourier_render.h). Background, shot noise, full well, read noise, gain, offset and quantisation
 * follow (detector.h). Noise is keyed by (key, exposure, pixel of the full sensor). The result is
 * bit-identical for any number of threads and work-group size and, with a Gaussian PSF, for any
 * window. */
#ifndef BST_SCENEGEN_RENDERER_H
#define BST_SCENEGEN_RENDERER_H

#include "boresight/archive.h"
#include "boresight/rng.h"
#include "scenegen/smear/smear.h"
#include "sim/device/device.h"
#include "sim/world/scene/field.h"

typedef struct bst_renderer bst_renderer;

typedef struct bst_renderer_options {
    double tolerance_sigma; /* allowed image error in any pixel, in sigma of that pixel (0.05) */
    bool penumbrae;         /* of parts of bodies on their parts (false: the Sun is a point) */
    bst_rng_key pattern;    /* random key of the detector's fixed patterns */
    bst_smear_star_motion motion; /* whose track the stars follow (BST_STAR_MOTION_AUTO) */
    /* Fidelity settings; 0: chosen by the tolerance. Equal parts of the exposure per star; parts of
     * a pixel per axis to whose centres nodes are rounded; stamp radius beyond a node's two nearest
     * pixels, px; odd degree of the profile law (scenegen/stamp/profile_law.h); taps of the Fourier
     * path's spreading kernel (4, 6 or 8). */
    int temporal_oversample, spatial_oversample, stamp_radius_px, psf_degree, fft_taps;
    /* Most nodes of a frame beyond 16 per source, 0: 2^24; BST_SCENE_SLEW times as many if a slew's
     * paths need them (scenegen/scene_plan.h). If the tolerance requires more, sources are rendered
     * with fewer nodes. */
    long long max_nodes;
    /* Frames of all detectors use one program, with a branch at each effect: compiled once, as
     * suits many detectors of few frames each, but up to a third slower. */
    bool shared_program;
    bool saturation_flags; /* keep the latest frame's flags for bst_renderer_flags */
    int pool_frames;       /* most frames alive at a time (4) */
    int planning_threads;  /* 0: one with a CPU device (for images of bodies that turn, all that the
                              device uses), otherwise one per processor */
    /* Tiles, px (width a multiple of 64); tile_width 0: chosen for the device. group: tiles per
     * work-group, a work-item each; 0: a tile, 64 px wide, for each work-group, as suits a GPU. */
    int tile_width, tile_height, group;
} bst_renderer_options;

/* Options with their defaults: error tolerance 0.05 sigma, pool of 4 frames. */
bst_renderer_options bst_renderer_default_options(void);

/* Creates a renderer. Each kind of image builds its kernels when it is first used.
 *
 * Given:     device   must outlive *out
 *            options  NULL: defaults
 * Errors:    BST_ERR_ARGUMENT for an unsupported camera (psf_fwhm_px above 70, no pixels, bits
 *            outside 8..16) */
bst_status bst_renderer_create(bst_ctx *ctx, bst_device *device, const bst_camera *camera,
                               const bst_renderer_options *options,
                               bst_renderer **out) BST_MUST_CHECK;
/* Builds the kernels of frames that are not binned, instead of for the first such frame.
 *
 * Errors:    BST_ERR_DEVICE, with the first lines of the compiler's log */
bst_status bst_renderer_prepare(bst_ctx *ctx, bst_renderer *renderer) BST_MUST_CHECK;
/* Frees a renderer. Frames still referenced stay valid. */
void bst_renderer_free(bst_renderer *renderer);

/* Saves or restores what later frames depend on, or report: the counts of saturated frames, with
 * the frames in progress, and the charge that pixels keep (persistence). Everything else follows
 * from the camera, the options and each request.
 *
 * Errors:    BST_ERR_DEVICE */
bst_status bst_renderer_archive(bst_renderer *renderer, bst_archive *archive) BST_MUST_CHECK;

/* Lets a renderer go on where another one of the same sensor ends: with the charge that its pixels
 * keep. `before` must render nothing more. */
void bst_renderer_inherit(bst_renderer *renderer, bst_renderer *before);

/* One exposure to render. Pointers are lent for the call. */
typedef struct bst_render_request {
    bst_window window; /* inside the sensor */
    /* its last time is the exposure's duration, unless row_time_s is set */
    const bst_los_track *track;
    /* rolling-shutter row delay, s; not 0: each row is exposed for exposure_s, starting row_time_s
     * after the previous row, the middle row in the middle of the track */
    double row_time_s;
    double exposure_s; /* row exposure with row_time_s */
    const bst_scene_source *sources;
    int count;
    /* expected electrons per sensor pixel: sky and dark current of the exposure */
    double background_e;
    double dark_e; /* dark current part of it (replaced by a dark map, if there is one) */
    /* varying background per sensor pixel, added to background_e; NULL: none. Only if
     * bst_skylight_may_vary. It covers the window, and its whole columns if charge or light moves
     * along them (bst_detector_config_whole_columns) */
    const struct bst_skylight_map *background;
    /* 2 or more: pixels per side summed before read-out; the frame is smaller, and remainders of
     * the window sides are dropped */
    int binning;
    bst_rng_key key;
    int64_t exposure_id;
    double start_s; /* of the exposure, any epoch: pixels with persistence forget by it */
} bst_render_request;

/* Statistics of the latest rendering. */
typedef struct bst_render_stats {
    int sources;     /* rendered sources */
    long long nodes; /* all sources, including padding of blocks */
    /* largest expected image error in any pixel, in its sigma (error_budget.h); NAN with
     * temporal_oversample, spatial_oversample or four fft_taps */
    double predicted_sigma;
    /* predicted_sigma exceeds the tolerance: the Fourier path's grid or the allowed number of nodes
     * is too coarse */
    bool tolerance_missed;
    bool nodes_bounded; /* the tolerance requires more nodes than max_nodes */
    bool single_kernel; /* the stars followed one track */
    int hits;           /* cosmic rays on the sensor */
    double hits_e;      /* their charge */
} bst_render_stats;

/* Renders an exposure; *out is a frame with one reference. It does not wait for the frame, but for
 * the frame BST_STAGE_SETS before it and, if the PSF is not Gaussian, for the light. */
bst_status bst_renderer_render(bst_ctx *ctx, bst_renderer *renderer,
                               const bst_render_request *request, bst_frame **out) BST_MUST_CHECK;

/* Chooses nodes and stamps only, as the calls below do first: for bst_renderer_peak_e and the
 * statistics of an exposure that is not rendered. */
bst_status bst_renderer_plan(bst_ctx *ctx, bst_renderer *renderer,
                             const bst_render_request *request) BST_MUST_CHECK;

/* Renders the same sources and nodes without noise or detector: expected electrons per pixel
 * (background included), [height][width]. Waits. */
bst_status bst_renderer_render_noise_free(bst_ctx *ctx, bst_renderer *renderer,
                                          const bst_render_request *request,
                                          float *image) BST_MUST_CHECK;

/* Number of pixels of the latest frame with a full well or the highest digital number. Waits for
 * the frame. */
bst_status bst_renderer_saturated(bst_ctx *ctx, bst_renderer *renderer,
                                  long long *pixels) BST_MUST_CHECK;
/* Saturation flags of the latest frame's pixels: BST_FLAG_... (kernels/scene_shared.h). Needs
 * saturation_flags; waits for the frame. */
bst_status bst_renderer_flags(bst_ctx *ctx, bst_renderer *renderer, size_t pixels,
                              uint8_t *out) BST_MUST_CHECK;
/* Number of saturated frames so far, without the latest two (BST_STAGE_SETS) unless
 * bst_renderer_saturated has been called. Does not wait. */
long long bst_renderer_saturated_frames(const bst_renderer *renderer);

/* Statistics of the latest rendering. The first call after a request takes 0.1 us per source for
 * the predicted error. */
void bst_renderer_get_stats(bst_renderer *renderer, bst_render_stats *out);

/* Expected electrons of source `index` of the latest request in its brightest pixel, without
 * background. */
double bst_renderer_peak_e(const bst_renderer *renderer, int index);

/* Distance outside the window, px, from which a source can still light it. */
int bst_renderer_margin_px(const bst_renderer *renderer);

#endif
