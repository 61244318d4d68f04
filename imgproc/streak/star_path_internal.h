/* Evidence of single stars on the ends of their path, shared by its source files. */
#ifndef BST_IMGPROC_STREAK_STAR_PATH_INTERNAL_H
#define BST_IMGPROC_STREAK_STAR_PATH_INTERNAL_H

#include "imgproc/streak/star_path.h"

/* Samples by which ends may differ and be the same. */
enum { BST_STAR_PATH_SAME_END = 4 };

/* Evidence of a star that a place of its path is lit: log-likelihood over that of a dark one; 0 if
 * the place is outside the image. A sample may hold another star's light with a probability of
 * 0.2, whether it is lit or not. */
double bst_star_path_evidence(const bst_star_path *path, const bst_star_path_image *image,
                              const bst_star_path_star *star, const double place[2]);

#endif
