/* 1/f noise of single pixels (kernels/pixel_flicker.cl): what is known of each from frame to
 * frame. */
#ifndef BST_SCENEGEN_DETECTOR_PIXEL_NOISE_H
#define BST_SCENEGEN_DETECTOR_PIXEL_NOISE_H

#include "boresight/archive.h"
#include "scenegen/kernels/scene_shared.h"
#include "sim/device/device.h"
#include "sim/optics/pixel_flicker.h"

typedef struct bst_pixel_noise {
    cl_mem state; /* of kernels/pixel_flicker.cl; NULL: no frame yet */
    cl_mem noise; /* of the latest frame */
    size_t bytes; /* of the state */
    bst_pixel_flicker flicker;
} bst_pixel_noise;

/* Makes room for `pixels` pixels without any frame.
 *
 * Given:     pixels  of the sensor, each row a multiple of 64 */
bst_status bst_pixel_noise_prepare(bst_ctx *ctx, bst_pixel_noise *n, bst_device *device,
                                   const bst_detector_config *detector,
                                   size_t pixels) BST_MUST_CHECK;

/* Parameters of the kernel for a frame, and its time as that of the latest one.
 *
 * Given:     frame   parameters of the frame
 *            read_s  end of the exposure */
bst_kernel_flicker_params bst_pixel_noise_begin(bst_pixel_noise *n, const bst_camera *camera,
                                                const bst_kernel_frame_params *frame,
                                                double read_s);

/* Saves or restores the state; waits for the frames in progress.
 *
 * Errors:    BST_ERR_DEVICE, BST_ERR_MEMORY; BST_ERR_FORMAT for a state of another sensor */
bst_status bst_pixel_noise_archive(bst_pixel_noise *n, bst_device *device,
                                   const bst_detector_config *detector, size_t pixels,
                                   bst_archive *archive) BST_MUST_CHECK;

/* Frees the buffers; afterwards there is no frame yet. */
void bst_pixel_noise_clear(bst_pixel_noise *n);

#endif
