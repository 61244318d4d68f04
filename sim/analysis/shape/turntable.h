/* boresight turntable: pictures of a satellite's shape, and a file for other viewers. */
#ifndef BST_ANALYSIS_SHAPE_TURNTABLE_H
#define BST_ANALYSIS_SHAPE_TURNTABLE_H

#include "sim/satellite/model.h"

/* Draws a contact sheet: the satellite from eight sides, 45 degrees apart about its z axis, from 20
 * degrees above its x-y plane, with the Sun behind the observer's right shoulder, and its shadows.
 *
 * Given:     satellite  the model; joints follow the Sun, the Earth on +z, and the observer
 *            path       PNG, 8 bits, four by two pictures
 *            size_px    width of one picture, 16 to 2048
 * Errors:    BST_ERR_IO, BST_ERR_MEMORY */
bst_status bst_turntable_draw(bst_ctx *ctx, const bst_satellite *satellite, const char *path,
                              int size_px) BST_MUST_CHECK;

/* Colour of a material: its reflectances at 0.70, 0.55 and 0.40 um, 0 to 1. */
void bst_turntable_colour(const bst_material *material, double rgb[3]);

/* Writes the model as GLB (glTF 2.0, binary): all facets as triangles, by material, joints as in
 * bst_satellite_pose_create; y up, as glTF asks.
 *
 * Errors:    BST_ERR_IO, BST_ERR_MEMORY */
bst_status bst_turntable_write_glb(bst_ctx *ctx, const bst_satellite *satellite,
                                   const char *path) BST_MUST_CHECK;

#endif
