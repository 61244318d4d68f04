/* Parameters of the vignetting kernel. */
#ifndef BST_SCENEGEN_DETECTOR_VIGNETTING_H
#define BST_SCENEGEN_DETECTOR_VIGNETTING_H

#include "boresight/camera.h"
#include "scenegen/kernels/scene_shared.h"

/* Parameters of kernels/vignetting.cl for a camera. */
bst_kernel_vignetting_params bst_vignetting_params(const bst_camera *camera);

#endif
