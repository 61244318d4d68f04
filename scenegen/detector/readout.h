/* Staged read-out (kernels/readout.cl, charge_transfer.cl, charge_coupling.cl) for effects between
 * pixels, multiplication of charge, and binning: from an image of the sources' light to the frame.
 */
#ifndef BST_SCENEGEN_DETECTOR_READOUT_H
#define BST_SCENEGEN_DETECTOR_READOUT_H

#include "boresight/archive.h"
#include "boresight/messages.h"
#include "scenegen/detector/detector.h"
#include "scenegen/kernels/scene_shared.h"

typedef struct bst_readout bst_readout;

/* Creates the read-out of a camera.
 *
 * Given:     device  must outlive *out
 *            camera  copied
 * Returned:  *out  NULL on error
 * Errors:    BST_ERR_MEMORY
 * Ownership: free *out with bst_readout_free */
bst_status bst_readout_create(bst_ctx *ctx, bst_device *device, const bst_camera *camera,
                              bst_readout **out) BST_MUST_CHECK;
/* Builds the kernels that the camera's effects need, instead of for the first frame. */
bst_status bst_readout_prepare(bst_ctx *ctx, bst_readout *readout) BST_MUST_CHECK;
/* Frees a read-out with its kernels and buffers on the device; NULL is allowed. */
void bst_readout_free(bst_readout *readout);

/* bst_detector_light_window from a multiple of 64 columns on. */
bst_window bst_readout_light_window(const bst_readout *readout, bst_window window);

/* Images of light in the buffer of bst_readout_image, behind each other: interval i of a ramp takes
 * number i modulo this. */
int bst_readout_images(const bst_readout *readout);

/* Image of light for a window of bst_readout_light_window.
 *
 * Returned:  *stride  floats per row */
bst_status bst_readout_image(bst_ctx *ctx, bst_readout *readout, bst_window light, cl_mem *image,
                             int *stride) BST_MUST_CHECK;

/* Enqueues an interval of a ramp: its light, of the light image, becomes charge that is read. After
 * the last one bst_readout_run makes the frame.
 *
 * Given:     params    of the interval; all have the same length, sky and dark current
 *            window    on the sensor, before binning
 *            interval  0, 1, ...
 *            start_s   start of the interval */
bst_status bst_readout_interval(bst_ctx *ctx, bst_readout *readout, const bst_detector *detector,
                                const bst_kernel_frame_params *params, bst_window window,
                                int interval, double start_s) BST_MUST_CHECK;

/* Number of parts of a frame that are read independently of each other.
 *
 * Given:     window  on the sensor, before binning */
int bst_readout_parts(const bst_readout *readout, bst_window window, int binning);

/* Enqueues the read-out of a frame from the light image, or from the intervals of a ramp.
 *
 * Given:     params     of the frame: window, exposure, noise
 *            window     on the sensor, before binning
 *            start_s    start of the exposure, for persistence
 *            saturated  room for one int per part (bst_readout_parts) */
bst_status bst_readout_run(bst_ctx *ctx, bst_readout *readout, const bst_detector *detector,
                           const bst_kernel_frame_params *params, bst_window window, int binning,
                           double start_s, cl_mem frame, cl_mem saturated) BST_MUST_CHECK;

/* Saves or restores what pixels keep from frame to frame; nothing without persistence and 1/f noise
 * of pixels.
 *
 * Errors:    BST_ERR_DEVICE, BST_ERR_MEMORY, BST_ERR_FORMAT */
bst_status bst_readout_archive(bst_readout *readout, bst_archive *archive) BST_MUST_CHECK;
/* Takes over what pixels of the same sensor kept with another read-out, which keeps nothing. */
void bst_readout_inherit(bst_readout *readout, bst_readout *before);

#endif
