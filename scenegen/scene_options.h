/* Build options and fixed parameters of the kernels, from camera and renderer settings. Options are
 * what fixes the size of arrays or the length of unrolled loops; everything else is a parameter, so
 * that cameras share compiled programs. */
#ifndef BST_SCENEGEN_SCENE_OPTIONS_H
#define BST_SCENEGEN_SCENE_OPTIONS_H

#include <stdbool.h>
#include <stddef.h>

#include "boresight/camera.h"
#include "scenegen/kernels/scene_shared.h"
#include "scenegen/renderer.h"

/* Writes the build options of the tile kernels (kernels/tile.cl) to text[bytes]; 256 bytes suffice.
 *
 * Given:     taps        of the longest stamp
 *            law_degree  of the stamps' profile law (0: none)
 *            fourier     light comes from the Fourier path */
void bst_scene_tile_options(const bst_renderer_options *settings, int taps, int law_degree,
                            bool fourier, char *text, size_t bytes);

/* Parameters of kernels/nodes.cl for a camera.
 *
 * Given:     spatial_oversample  parts of a pixel per axis to whose centres nodes move; 0: exact */
bst_kernel_node_params bst_scene_node_params(const bst_camera *camera, int spatial_oversample);

#endif
