/* Paths of stars on which image processing measures the camera's motion. */
#ifndef BST_ONBOARD_MEASURED_PATH_H
#define BST_ONBOARD_MEASURED_PATH_H

#include <stdbool.h>

/* True if a path of stars is long enough for that and bends little enough to be a correction to
 * uniform motion: 4 sigma of the PSF, 2 where the camera moved unevenly, and half the length.
 *
 * Given:     length_px, bend_px, sigma_px  all in the same pixels */
static inline bool bst_path_is_measured(double length_px, double bend_px, double sigma_px,
                                        bool uneven) {
    return length_px >= (uneven ? 2.0 : 4.0) * sigma_px && bend_px <= 0.5 * length_px;
}

#endif
