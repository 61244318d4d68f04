/* Tables of places of ghosts. Internal to sim/optics. */
#ifndef BST_OPTICS_GHOST_MAP_H
#define BST_OPTICS_GHOST_MAP_H

#include "sim/optics/ghosts.h"

/* Reads a table: CSV with the columns source_x_px, source_y_px, x_px, y_px and, if wanted,
 * intensity (1 without it), in any order of rows; the places of the source form a rectangular grid
 * of 2 x 2 places or more. BST_ERR_NOT_FOUND, BST_ERR_IO, BST_ERR_MEMORY, or BST_ERR_FORMAT with
 * file, line, problem and what is allowed. Free with bst_ghost_map_free, after an error too. */
bst_status bst_ghost_map_load(bst_ctx *ctx, const char *file, const char *base_dir,
                              bst_ghost_map *out) BST_MUST_CHECK;
/* The same from a text; `name`: of the file, for messages. */
bst_status bst_ghost_map_read(bst_ctx *ctx, const char *name, const char *text, size_t bytes,
                              bst_ghost_map *out) BST_MUST_CHECK;
/* Frees the memory of a table and clears the struct, which belongs to the caller. */
void bst_ghost_map_free(bst_ghost_map *map);

/* Place of the ghost of a source at (x_px, y_px): bilinear, of the outermost cells beyond them. */
void bst_ghost_map_place(const bst_ghost_map *map, double x_px, double y_px, double to[2]);
/* Its intensity: bilinear, that of the border beyond it. */
double bst_ghost_map_intensity(const bst_ghost_map *map, double x_px, double y_px);

#endif
