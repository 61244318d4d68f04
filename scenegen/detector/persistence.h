/* Persistence (kernels/persistence.cl): charge that the traps of each pixel keep from frame to
 * frame. */
#ifndef BST_SCENEGEN_DETECTOR_PERSISTENCE_H
#define BST_SCENEGEN_DETECTOR_PERSISTENCE_H

#include "boresight/archive.h"
#include "boresight/camera.h"
#include "scenegen/kernels/scene_shared.h"
#include "sim/device/device.h"

typedef struct bst_persistence {
    cl_mem trapped; /* of kernels/persistence.cl; NULL: all traps are empty */
    size_t bytes;
    double end_s; /* of the latest exposure */
} bst_persistence;

/* Share that a charge which grows steadily from 0 has filled when it reaches its end.
 *
 * Given:     duration  of the growth, in time constants, 0 or more
 * Returned:  1 - (1 - e^-x) / x for the duration x */
double bst_persistence_fill(double duration);

/* Makes room for the trapped charge of `pixels` pixels, at first none. */
bst_status bst_persistence_prepare(bst_ctx *ctx, bst_persistence *p, bst_device *device,
                                   const bst_detector_config *detector,
                                   size_t pixels) BST_MUST_CHECK;

/* Parameters of the kernel for an exposure, and its end as that of the latest one.
 *
 * Given:     frame    parameters of the frame
 *            start_s  start of the exposure; times before the end of the latest one count as that
 * Notes:     between two exposures the pixels hold no charge: traps only release theirs, which is
 *            cleared away. */
bst_kernel_persistence_params bst_persistence_begin(bst_persistence *p,
                                                    const bst_detector_config *detector,
                                                    const bst_kernel_frame_params *frame,
                                                    double start_s);

/* Saves or restores the trapped charge; waits for the frames in progress.
 *
 * Errors:    BST_ERR_DEVICE, BST_ERR_MEMORY; BST_ERR_FORMAT for a state of another sensor */
bst_status bst_persistence_archive(bst_persistence *p, bst_device *device,
                                   const bst_detector_config *detector, size_t pixels,
                                   bst_archive *archive) BST_MUST_CHECK;

/* Frees the buffer; afterwards all traps are empty. */
void bst_persistence_clear(bst_persistence *p);

#endif
