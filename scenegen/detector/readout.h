/* Staged read-out (kernels/readout.cl, charge_transfer.cl, charge_coupling.cl) for effects between
 * pixels, multiplication of charge, and binning: from an image of the sources' light to the frame.
 */
#ifndef BST_SCENEGEN_DETECTOR_READOUT_H
#define BST_SCENEGEN_DETECTOR_READOUT_H

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

/* Image of light for a window of bst_readout_light_window.
 *
 * Returned:  *stride  floats per row */
bst_status bst_readout_image(bst_ctx *ctx, bst_readout *readout, bst_window light, cl_mem *image,
                             int *stride) BST_MUST_CHECK;

/* Enqueues the read-out of a frame from the light image.
 *
 * Given:     params     of the frame: window, exposure, noise
 *            window     on the sensor, before binning
 *            saturated  room for one int per frame row */
bst_status bst_readout_run(bst_ctx *ctx, bst_readout *readout, const bst_detector *detector,
                           const bst_kernel_frame_params *params, bst_window window, int binning,
                           cl_mem frame, cl_mem saturated) BST_MUST_CHECK;

#endif
