/* The detector stage of the renderer (kernels/detector.cl): its maps and tables, and what happens
 * to it in one exposure. */
#ifndef BST_SCENEGEN_DETECTOR_DETECTOR_H
#define BST_SCENEGEN_DETECTOR_DETECTOR_H

#include <stdbool.h>
#include <stddef.h>

#include "boresight/camera.h"
#include "boresight/rng.h"
#include "scenegen/detector/cosmic_rays.h"
#include "scenegen/upload_ring.h"
#include "sim/device/device.h"

enum { BST_DETECTOR_BUFFERS = 6 };

typedef struct bst_detector bst_detector;

/* Makes the fixed patterns and tables of a camera on the device. `pattern` keys the patterns.
 * BST_ERR_CONFIG for a map or a table of codes that cannot be used, naming the key. */
bst_status bst_detector_create(bst_ctx *ctx, bst_device *device, const bst_camera *camera,
                               bst_rng_key pattern, bst_detector **out) BST_MUST_CHECK;
/* Frees a detector with its buffers on the device; NULL is allowed. */
void bst_detector_free(bst_detector *detector);

/* Key of a sensor's fixed patterns; `name`: "observer/sensor". The same in all runs of a study. */
bst_rng_key bst_detector_pattern_key(const bst_camera *camera, const char *name);

/* Kernel options of the detector, each with a space before it, as snprintf would write them.
 *
 * Shot and read noise of a pixel come from one normal deviate by a Cornish-Fisher expansion where
 * that is as good as the exact law, from a deviate for each elsewhere. The rule keeps the
 * chi-square divergence between the drawn and the exact law (quantised to 1 e-) below 3e-9, so that
 * it takes more than 1e9 draws to tell them apart:
 *   read noise >= 5 e-   all means, expansion to 1/sigma^2
 *   read noise >= 3 e-   all means, to 1/sigma^3
 *   read noise >= 2 e-   all means, to 1/sigma^4
 *   read noise >= 0.75 e-   means from 30 e- on, to 1/sigma^4
 *   below   never: single electrons show */
int bst_detector_options(const bst_detector *detector, char *text, size_t bytes);

/* Whether frames need whole columns (blooming, frame transfer), and so the light of them all. */
bool bst_detector_whole_columns(const bst_detector *detector);

/* Makes the fixed patterns known to the program's kernels that the detector itself starts. */
bst_status bst_detector_set_program(bst_ctx *ctx, bst_detector *detector,
                                    cl_program program) BST_MUST_CHECK;

/* What an exposure brings of its own: radiation hits and the rows' offsets. */
bst_status bst_detector_begin(bst_ctx *ctx, bst_detector *detector, bst_upload_ring *stage,
                              bst_rng_key key, int64_t exposure_id,
                              double exposure_s) BST_MUST_CHECK;
/* Takes the exposure's hits off again; after the frame's kernels were enqueued. */
bst_status bst_detector_end(bst_ctx *ctx, bst_detector *detector) BST_MUST_CHECK;

/* Hits of the latest exposure. */
bst_cosmic_rays_summary bst_detector_hits(const bst_detector *detector);

/* Buffers for the kernels, NULL where the effect is off: gain, dark, overlay, offsets, codes, flags
 * of the frame's pixels. */
void bst_detector_buffers(const bst_detector *detector, cl_mem out[BST_DETECTOR_BUFFERS]);

/* From now on the program and its kernels keep flags: before bst_detector_options. */
bst_status bst_detector_keep_flags(bst_ctx *ctx, bst_detector *detector) BST_MUST_CHECK;
/* BST_FLAG_... of the latest frame's `count` pixels. Waits for it. */
bst_status bst_detector_flags(bst_ctx *ctx, const bst_detector *detector, size_t count,
                              uint8_t *out) BST_MUST_CHECK;

/* Means above this may fill the well: there the charge is drawn by itself, cut, and read. */
double bst_detector_near_full_e(double full_well_e);

#endif
