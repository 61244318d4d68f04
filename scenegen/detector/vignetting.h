/* Build options of the vignetting kernel. */
#ifndef BST_SCENEGEN_DETECTOR_VIGNETTING_H
#define BST_SCENEGEN_DETECTOR_VIGNETTING_H

#include <stddef.h>

#include "boresight/camera.h"

/* Writes the build options of kernels/vignetting.cl, nothing for a camera without vignetting.
 * Returns their length, as snprintf does. */
int bst_vignetting_options(const bst_camera *camera, char *text, size_t bytes);

#endif
