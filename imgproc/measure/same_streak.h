/* Streaks of a frame that are fits of the same light. */
#ifndef BST_IMGPROC_MEASURE_SAME_STREAK_H
#define BST_IMGPROC_MEASURE_SAME_STREAK_H

#include "imgproc/measure/locate.h"

/* True if another source than i is a streak of the same light. */
bool bst_same_streak_found(const bst_imgproc_locator *locator, const bst_locate_frame *frame, int i,
                           const bst_imgproc_shape *streak);

#endif
