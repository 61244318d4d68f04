/* Streaks that are no star's, among streaks of stars. */
#ifndef BST_IMGPROC_MEASURE_OTHER_PATH_H
#define BST_IMGPROC_MEASURE_OTHER_PATH_H

#include "imgproc/measure/deblend.h"

/* Sets BST_DETECTION_OTHER_PATH of source i where stars are streaks, and its path differs from
 * theirs by more than its errors: chi-square of the star's path is larger by 25 than that of the
 * source's own, and by what its own leaves unexplained, as two stars in one image do.
 *
 * Given:     found  fitted, with flags and moments
 * Notes:     A star's streak whose moments have another length or direction is fitted with a path
 *            of its own first, and keeps that if it is another one.
 *            Points that are longer than the PSF are no stars.
 *            Blended, saturated and cut sources and those below BST_EXTENT_SNR are not judged. */
void bst_other_path_judge(const bst_imgproc_worker *worker, int i, bst_imgproc_found *found);

#endif
