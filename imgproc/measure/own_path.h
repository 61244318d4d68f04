/* Path of a source of its own in a frame in which the camera moved unevenly. */
#ifndef BST_IMGPROC_MEASURE_OWN_PATH_H
#define BST_IMGPROC_MEASURE_OWN_PATH_H

#include "imgproc/measure/deblend.h"

/* Fits the uniform part of source i's path beside the bend and the departure of the camera's
 * motion, which it shares with all sources: minimum of chi-square over end minus start, with place
 * and flux at their best for each. It becomes a streak of its own if its path is as long as
 * bst_source_moments_own_streak asks and lowers chi-square as much.
 *
 * Notes: The covariance of the place has that of the path: by the curvature of chi-square and the
 *        slope of the place along the path.
 *        The source stays as it is if the fit fails. */
void bst_own_path_fit(const bst_imgproc_worker *worker, int i, bst_imgproc_found *found);

#endif
