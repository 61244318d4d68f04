/* Building a model: adding vertices, convex bodies and facets. Internal to sim/satellite. */
#ifndef BST_SATELLITE_MODEL_BUILD_H
#define BST_SATELLITE_MODEL_BUILD_H

#include "sim/satellite/model.h"

/* Where a part goes and what it is made of. */
typedef struct bst_part_place {
    bst_mat3 rotation; /* joint frame from part frame */
    bst_vec3 position_m;
    int part, joint, material, back_material;
} bst_part_place;

/* Appends a vertex given in the part's frame. *index: its index. BST_ERR_MEMORY. */
bst_status bst_model_add_vertex(bst_ctx *ctx, bst_satellite *s, const bst_part_place *place,
                                bst_vec3 v, int *index) BST_MUST_CHECK;

/* Appends a facet of the last occluder.
 *
 * Given:     corners   [count] vertices, counter-clockwise from outside
 *            material  its material
 *            curved    curved surface, or -1
 * Errors:    BST_ERR_CONFIG for more than BST_SATELLITE_FACETS_MAX facets, BST_ERR_MEMORY
 * Notes:     a facet without area is left out. */
bst_status bst_model_add_facet(bst_ctx *ctx, bst_satellite *s, const bst_part_place *place,
                               const int *corners, int count, int material,
                               int curved) BST_MUST_CHECK;

/* Starts a convex body whose vertices begin with the next one. BST_ERR_MEMORY. */
bst_status bst_model_begin_occluder(bst_ctx *ctx, bst_satellite *s) BST_MUST_CHECK;
/* Ends it: counts its vertices, and collects the edges of its facets from first_facet on.
 * BST_ERR_MEMORY. */
bst_status bst_model_end_occluder(bst_ctx *ctx, bst_satellite *s, int first_facet) BST_MUST_CHECK;

/* Appends a curved surface of the last occluder. *index: its index. BST_ERR_MEMORY. */
bst_status bst_model_add_curved(bst_ctx *ctx, bst_satellite *s, const bst_curved *curved,
                                int *index) BST_MUST_CHECK;

/* Makes the last occluder the hull of a shell. BST_ERR_MEMORY. */
bst_status bst_model_set_shell(bst_ctx *ctx, bst_satellite *s,
                               const bst_shell *shell) BST_MUST_CHECK;

/* Appends a parametric part. Errors of the functions above, and BST_ERR_CONFIG with the key. */
bst_status bst_model_add_part(bst_ctx *ctx, bst_satellite *s,
                              const bst_satellite_part_config *config,
                              const bst_part_place *place) BST_MUST_CHECK;

/* A triangle mesh as read from a file. */
typedef struct bst_mesh {
    bst_vec3 *vertices;
    int (*triangles)[3];
    int *triangle_material; /* index into materials; -1: none */
    bst_material *materials;
    int vertex_count, triangle_count, material_count;
    int vertex_capacity, triangle_capacity, material_capacity;
} bst_mesh;

/* Frees the memory of a mesh; the struct belongs to the caller. */
void bst_mesh_free(bst_mesh *mesh);
/* Appends a vertex. Errors: BST_ERR_FORMAT for a number that is not finite or beyond 1e7,
 * BST_ERR_MEMORY. */
bst_status bst_mesh_add_vertex(bst_ctx *ctx, bst_mesh *mesh, bst_vec3 v) BST_MUST_CHECK;
/* Appends a triangle. Errors: BST_ERR_FORMAT for an index that is no vertex or too many triangles,
 * BST_ERR_MEMORY. */
bst_status bst_mesh_add_triangle(bst_ctx *ctx, bst_mesh *mesh, const int64_t vertices[3],
                                 int material) BST_MUST_CHECK;
/* Appends a material. *index: its index. Errors: BST_ERR_FORMAT for too many, BST_ERR_MEMORY. */
bst_status bst_mesh_add_material(bst_ctx *ctx, bst_mesh *mesh, const bst_material *material,
                                 int *index) BST_MUST_CHECK;

/* Reads a Wavefront OBJ file with its vertices, polygons and groups; materials by name (usemtl) are
 * grey. Errors: BST_ERR_NOT_FOUND, BST_ERR_IO, BST_ERR_FORMAT with file and line, BST_ERR_MEMORY.
 * The caller frees the mesh, also after an error. */
bst_status bst_mesh_load_obj(bst_ctx *ctx, const char *path, bst_mesh *mesh) BST_MUST_CHECK;
/* Reads a glTF 2.0 or GLB file: the meshes of its default scene, with the transforms of its nodes,
 * and its metallic-roughness materials without textures. Errors as above, with the JSON path. */
bst_status bst_mesh_load_gltf(bst_ctx *ctx, const char *path, bst_mesh *mesh) BST_MUST_CHECK;

/* Appends a mesh as a part: closed connected pieces that are convex become one convex body, others
 * a body per triangle; triangles of open pieces have two sides. Errors as bst_model_add_part. */
bst_status bst_model_add_mesh(bst_ctx *ctx, bst_satellite *s, const bst_mesh *mesh, double scale,
                              const bst_part_place *place) BST_MUST_CHECK;

#endif
