/* The build options of the kernels: what of a camera and of the renderer's settings is fixed when
 * they are compiled. Effects that are off are not compiled. */
#ifndef BST_SCENEGEN_SCENE_OPTIONS_H
#define BST_SCENEGEN_SCENE_OPTIONS_H

#include "scenegen/detector/detector.h"
#include "scenegen/renderer.h"

/* Writes them to text[bytes]; 2048 bytes do. taps: of the longest stamp; law_degree: of the
 * stamps' profile law (0: none); law_widest: widening up to
 * which it serves; fourier: light comes from the Fourier path. */
void bst_scene_build_options(const bst_camera *camera, const bst_renderer_options *settings,
                             int taps, int law_degree, double law_widest, bool fourier,
                             const bst_detector *detector, char *text, size_t bytes);

/* Those of them that kernels/nodes.cl takes, with a blank before. */
void bst_scene_node_options(const bst_camera *camera, int spatial_oversample, char *text,
                            size_t bytes);

#endif
