/* Connected components by OpenCV. */
#ifndef BST_IMGPROC_CV_COMPONENTS_H
#define BST_IMGPROC_CV_COMPONENTS_H

#include <stdint.h>

#include "sim/core/status.h"

#ifdef __cplusplus
#define BST_CV_NOEXCEPT noexcept
extern "C" {
#else
#define BST_CV_NOEXCEPT
#endif

typedef struct bst_cv_components bst_cv_components;

/* Bounding box and number of pixels of one component. */
typedef struct bst_cv_box {
    int x, y, width, height, area;
} bst_cv_box;

/* Work space for masks of up to max_width * max_height pixels. */
bst_status bst_cv_components_create(bst_ctx *ctx, int max_width, int max_height,
                                    bst_cv_components **out) BST_CV_NOEXCEPT BST_MUST_CHECK;
void bst_cv_components_free(bst_cv_components *components) BST_CV_NOEXCEPT;

/* Labels the 8-connected components of the non-zero pixels of mask [height][width] (row-major,
 * contiguous). *count is the number of labels, the background's label 0 included; *labels is
 * [height][width] with *stride elements a row, held in `components` until the next call. */
bst_status bst_cv_components_label(bst_ctx *ctx, bst_cv_components *components, const uint8_t *mask,
                                   int width, int height, const int32_t **labels, int *stride,
                                   int *count) BST_CV_NOEXCEPT BST_MUST_CHECK;

/* The box of a label of the latest call, 0 <= label < count. */
bst_cv_box bst_cv_components_box(const bst_cv_components *components, int label) BST_CV_NOEXCEPT;

#ifdef __cplusplus
}
#endif

#endif
