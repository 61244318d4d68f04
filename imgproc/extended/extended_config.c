#include "imgproc/extended/extended_config.h"

#define C bst_extended_config
const bst_config_desc bst_extended_config_table[] = {
    BST_BOOL(C, enabled, "false",
             "Measure targets larger than the PSF by their silhouette; not with track_windows, "
             "stack or a detector of one's own."),
    BST_REAL(C, handover_fwhm, "", 2, 100, "3",
             "Size, in FWHM of the PSF, from which a target is measured by its silhouette instead "
             "of as a point."),
    BST_REAL(C, return_share, "", 0.3, 1, "0.8",
             "Share of that size below which an extended target is a point again."),
    BST_REAL(C, join_share, "", 0, 2, "0.3",
             "Bright parts belong to one target if the gap between them is at most this share of "
             "the larger one's size."),
    BST_REAL(C, phase_offset_factor, "", 0, 1.5, "0.3",
             "Offset of the lit outline from the centre of mass towards the Sun relative to a "
             "sphere: 1 for a sphere, about 0.5 for a box, 0.15 with long arrays."),
    BST_REAL(C, centre_sigma, "", 0.001, 0.5, "0.05",
             "Standard deviation of the centre of mass from the corrected outline, share of the "
             "size."),
    BST_REAL(C, target_size_m, "m", 0, 1000, "0",
             "Largest extent of the target as known on board, for its range; 0: unknown."),
    BST_REAL(C, target_size_sigma_m, "m", 0, 1000, "0",
             "Its standard deviation, what a foreshortened view changes included."),
    BST_PATH(C, target_model, "\"\"",
             "Model of the target on board, for its centre of mass and range: JSON with the keys "
             "of shape, or a mesh (OBJ, glTF, GLB), relative to the scenario's folder; empty: "
             "none, the outline alone."),
    BST_REAL(C, target_model_sigma, "", 0.0001, 0.1, "0.002",
             "Standard deviation of the model's dimensions, share of the size."),
    BST_CONFIG_END,
};
