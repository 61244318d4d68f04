/* Build options of the kernels from camera and renderer settings. Effects that are off are not
 * compiled. */
#ifndef BST_SCENEGEN_SCENE_OPTIONS_H
#define BST_SCENEGEN_SCENE_OPTIONS_H

#include "scenegen/detector/detector.h"
#include "scenegen/renderer.h"

/* Writes the build options to text[bytes]; 2048 bytes suffice.
 *
 * Given:     taps        of the longest stamp
 *            law_degree  of the stamps' profile law (0: none)
 *            fourier     light comes from the Fourier path */
void bst_scene_build_options(const bst_camera *camera, const bst_renderer_options *settings,
                             int taps, int law_degree, bool fourier, const bst_detector *detector,
                             char *text, size_t bytes);

/* Writes the options of kernels/nodes.cl, with a leading space. */
void bst_scene_node_options(const bst_camera *camera, int spatial_oversample, char *text,
                            size_t bytes);

#endif
