#include "boresight/ghost_config.h"

const bst_config_desc bst_ghost_config_table[] = {
    BST_REAL(bst_ghost_config, intensity, "", 1e-12, 1, NULL,
             "Light of the ghost over that of the source's image; a factor on the table's "
             "intensity, if map_file has that column."),
    BST_REAL(bst_ghost_config, factor, "", -10, 10, "-1",
             "Place of the ghost: centre + factor (place of the source - centre). -1: opposite."),
    BST_REALS(bst_ghost_config, centre_px, "px", -1e5, 1e5, "[0, 0]",
              "The centre, from where the boresight meets the focal plane."),
    BST_PATH(bst_ghost_config, map_file, "\"\"",
             "Places by a CSV table, instead of factor and centre_px: columns "
             "source_x_px,source_y_px,x_px,y_px and, if wanted, intensity, on a rectangular grid "
             "of places of the source; bilinear between them."),
    BST_REAL(bst_ghost_config, fwhm_px, "px", 0, 300, "0",
             "Full width at half maximum of a Gaussian that the image is blurred with, besides "
             "the PSF."),
    BST_REAL(bst_ghost_config, radius_px, "px", 0, 300, "0",
             "Radius of the disc that an image of the pupil out of focus is, instead of fwhm_px."),
    BST_REAL(bst_ghost_config, inner_radius_px, "px", 0, 300, "0",
             "Radius of its hole, the central obscuration; below radius_px."),
    BST_REAL(bst_ghost_config, outside_px, "px", 0, 1e5, "0",
             "How far outside the sensor (or the table) sources have this ghost, too."),
    BST_CONFIG_END,
};
