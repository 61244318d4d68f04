/* Numbers that pixels keep from frame to frame, in saved states. */
#ifndef BST_SCENEGEN_DETECTOR_SAVED_FLOATS_H
#define BST_SCENEGEN_DETECTOR_SAVED_FLOATS_H

#include "boresight/archive.h"
#include "sim/device/device.h"

/* Saves or restores a buffer of floats; waits for the frames in progress.
 *
 * Given:     bytes        of the buffer
 *            least, most  allowed numbers; `most` itself is not
 *            what         for messages: "trapped charge of the pixels"
 * Errors:    BST_ERR_DEVICE, BST_ERR_MEMORY; BST_ERR_FORMAT for a number that is not allowed */
bst_status bst_saved_floats(bst_archive *archive, bst_device *device, cl_mem buffer, size_t bytes,
                            double least, double most, const char *what) BST_MUST_CHECK;

#endif
