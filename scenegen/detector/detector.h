/* Detector stage of the renderer (kernels/detector.cl): maps, tables, and per-exposure effects. */
#ifndef BST_SCENEGEN_DETECTOR_DETECTOR_H
#define BST_SCENEGEN_DETECTOR_DETECTOR_H

#include <stdbool.h>
#include <stddef.h>

#include "boresight/camera.h"
#include "boresight/messages.h"
#include "boresight/rng.h"
#include "scenegen/detector/cosmic_rays.h"
#include "scenegen/kernels/scene_shared.h"
#include "scenegen/upload_ring.h"
#include "sim/core/parallel.h"
#include "sim/device/device.h"

enum { BST_DETECTOR_BUFFERS = 7 };

typedef struct bst_detector bst_detector;

/* Creates the fixed-pattern maps and tables of a camera on the device.
 *
 * Given:     pattern  random key of the fixed patterns
 *            pool     threads for what each exposure draws; lent; NULL: the caller's alone
 *            maps     threads for the maps, until it returns; NULL: the caller's alone
 * Errors:    BST_ERR_CONFIG, naming the key, for an unusable map or code table; BST_ERR_DEVICE,
 *            BST_ERR_MEMORY */
bst_status bst_detector_create(bst_ctx *ctx, bst_device *device, const bst_camera *camera,
                               bst_rng_key pattern, bst_parallel *pool, bst_parallel *maps,
                               bst_detector **out) BST_MUST_CHECK;
/* Frees a detector with its buffers on the device; NULL is allowed. */
void bst_detector_free(bst_detector *detector);

/* Random key of a sensor's fixed patterns, the same in all runs of a study.
 *
 * Given:     name  "observer/sensor" */
bst_rng_key bst_detector_pattern_key(const bst_camera *camera, const char *name);

/* Writes the build options of kernels/pixels.cl to text[bytes], each preceded by a space; 64 bytes
 * suffice.
 *
 * Notes:     Shot and read noise of a pixel come from one normal deviate by a Cornish-Fisher
 *            expansion if that is accurate enough, otherwise from one deviate each. The chi-square
 *            divergence between drawn and exact distribution (quantised to 1 e-) stays below 3e-9:
 *            more than 1e9 draws are needed to distinguish them.
 *   read noise >= 5 e-      all means, expansion to 1/sigma^2
 *   read noise >= 3 e-      all means, to 1/sigma^3
 *   read noise >= 2 e-      all means, to 1/sigma^4
 *   read noise >= 0.75 e-   means from 30 e- on, to 1/sigma^4
 *   below                   never: single electrons are resolved */
void bst_detector_options(const bst_detector *detector, bool shared, char *text, size_t bytes);
/* True if the read noise has a tail (telegraph noise). */
bool bst_detector_has_tail(const bst_camera *camera);

/* Build options of kernels/read_tail.cl and of a multiplication register, each preceded by a
 * space. */
const char *bst_detector_tail_options(const bst_camera *camera);
/* Sets the detector's parameters of the kernels, from `effects` on. */
void bst_detector_params(const bst_detector *detector, bst_kernel_frame_params *params);

/* Part of the sensor whose light a frame of `window` needs: whole columns if charge or light moves
 * along them, all of it if also along rows. */
bst_window bst_detector_light_window(const bst_camera *camera, bst_window window);

/* True if frames pass the staged read-out (readout.h): effects between pixels, multiplication of
 * charge, ramps, 1/f noise of pixels. */
bool bst_detector_is_staged(const bst_detector *detector);

/* Rows of the sensor. */
typedef struct bst_detector_rows {
    int first, count;
} bst_detector_rows;

/* Prepares the per-exposure effects: cosmic rays, level, row offsets, phases of the pick-up.
 *
 * Given:     read  the rows to be read out, within the sensor; others have no offsets */
bst_status bst_detector_begin(bst_ctx *ctx, bst_detector *detector, bst_upload_ring *stage,
                              bst_rng_key key, int64_t exposure_id, double exposure_s,
                              bst_detector_rows read) BST_MUST_CHECK;
/* Places the cosmic rays of an interval of a ramp in place of those of the interval before.
 *
 * Given:     interval    0, 1, ... */
bst_status bst_detector_interval(bst_ctx *ctx, bst_detector *detector, bst_upload_ring *stage,
                                 bst_rng_key key, int64_t exposure_id, int interval,
                                 double interval_s) BST_MUST_CHECK;
/* Removes the exposure's cosmic rays from the overlay. Call it after the frame's kernels are
 * enqueued. */
bst_status bst_detector_end(bst_ctx *ctx, bst_detector *detector) BST_MUST_CHECK;

/* Cosmic-ray summary of the latest exposure. */
bst_cosmic_rays_summary bst_detector_hits(const bst_detector *detector);

/* Kernel buffers, NULL if the effect is off: gain, dark, overlay, offsets,
 * codes, saturation flags of the frame, charge gathered outside the exposure. */
void bst_detector_buffers(const bst_detector *detector, cl_mem out[BST_DETECTOR_BUFFERS]);

/* Enables saturation flags. Call it before bst_detector_params and bst_detector_options. */
bst_status bst_detector_keep_flags(bst_ctx *ctx, bst_detector *detector) BST_MUST_CHECK;
/* Reads the saturation flags BST_FLAG_... of the latest frame's `count` pixels. Waits for the
 * frame. */
bst_status bst_detector_flags(bst_ctx *ctx, const bst_detector *detector, size_t count,
                              uint8_t *out) BST_MUST_CHECK;

/* Mean electrons above which a pixel may reach its full well; its charge is then drawn, clipped and
 * read separately. */
double bst_detector_near_full_e(double full_well_e);

#endif
