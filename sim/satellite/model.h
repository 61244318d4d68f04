/* A satellite's shape: facets, materials, joints, and the convex bodies that cast shadows. */
#ifndef BST_SATELLITE_MODEL_H
#define BST_SATELLITE_MODEL_H

#include "boresight/vec.h"
#include "sim/astro/curve_file.h"
#include "sim/satellite/material_library.h"
#include "sim/satellite/satellite_config.h"

/* Limits of a model: more is an error. */
enum { BST_SATELLITE_FACETS_MAX = 200000, BST_SATELLITE_MATERIALS_MAX = 128 };

/* A plane convex facet, seen from the side of its normal. Coordinates in the frame of its joint. */
typedef struct bst_facet {
    int first, count; /* corners: vertices corner[first ...], counter-clockwise from outside */
    int part, material, joint;
    int occluder; /* convex body that it belongs to and that does not shadow it */
    int curved;   /* curved surface that it approximates; -1: none */
    bool inside;  /* on the concave side of its occluder, which is a shell */
    double area_m2;
    bst_vec3 normal;
} bst_facet;

/* A convex body (also a plate or a triangle) that casts shadows: its vertices and edges. */
typedef struct bst_occluder {
    int first_vertex, vertex_count;
    int first_facet, facet_count;
    int first_edge, edge_count;
    int first_curved, curved_count; /* its curved surfaces */
    bool closed; /* each edge has one facet on each side, or the rim's plane of a shell */
    int shell;   /* index of the shell whose convex hull this is; -1: a solid body */
} bst_occluder;

/* An open convex shell, a dish. A ray that crosses its hull crosses the shell, so that others see a
 * convex body; from inside, a ray leaves freely through the rim only. Frame of the joint. */
typedef struct bst_shell {
    int joint;
    bst_vec3 apex_m, axis; /* paraboloid along a unit axis */
    double radius_m, depth_m;
    int first_rim, rim_count; /* vertices, counter-clockwise about the axis */
} bst_shell;

/* A surface of revolution about its z axis: the part of a sphere or cone that facets stand for. */
typedef struct bst_curved {
    int material, joint;
    bool sphere;
    int occluder;                  /* convex body that it belongs to */
    bst_vec3 x, y, z;              /* unit, frame of the joint */
    bst_vec3 base_m;               /* centre of the low end, or of the sphere, likewise */
    double radius_m, top_radius_m; /* sphere: radius_m; else at both ends */
    double length_m;               /* along z */
    double side;                   /* 1: outside; -1: inside */
} bst_curved;

/* A frame that turns. Vectors in the frame of its parent. */
typedef struct bst_joint {
    char name[64];
    int parent;  /* joint; -1: the body */
    int follows; /* BST_JOINT_... */
    int axes;
    bst_vec3 axis, normal, position_m;
    double offset_rad, rate_radps, limit_rad[2];
    bst_curve table; /* BST_JOINT_TABLE: deg by seconds after the epoch; owned by the model */
    int burn;        /* BST_JOINT_BURN: index of the burn */
    double turn_rad;
} bst_joint;

typedef struct bst_satellite_part {
    char name[64];
    int first_facet, facet_count;
    int joint; /* -1: the body */
} bst_satellite_part;

enum { BST_REFLECTANCE_POINTS = 17 };

/* What a material absorbs: for heat and for the pressure of sunlight. */
typedef struct bst_surface_heat {
    double absorptance;    /* of sunlight */
    double capacity_jpm2k; /* heat capacity of the surface; 0: it follows its load at once */
    /* in V, at equal steps of the cosine of incidence from 0 to 1 */
    double reflectance[BST_REFLECTANCE_POINTS];
} bst_surface_heat;

/* A satellite's model; immutable; several objects and threads may share it. All arrays belong to
 * it. Joint -1 is the body; `edges` and `corner` index `vertices`. */
typedef struct bst_satellite {
    bst_vec3 *vertices;
    int *vertex_joint;
    int *corner;
    int (*edges)[4]; /* vertices a, b; the facet with the edge a-b; that with b-a, or below 0. Of
                        shells: facets of the convex side; -1: the rim's plane */
    bst_facet *facets;
    bst_occluder *occluders;
    bst_curved *curved;
    bst_shell *shells;
    bst_satellite_part *parts;
    bst_material *materials;
    bst_surface_heat *surfaces; /* by material; see bst_satellite_make_surfaces */
    bool has_surfaces;
    bst_joint *joints;
    bst_brdf_table **tables; /* of materials; NULL where a material has none */
    int vertex_count, corner_count, edge_count, facet_count, occluder_count, curved_count;
    int shell_count;
    int part_count, material_count, joint_count;
    int vertex_capacity, corner_capacity, edge_capacity, facet_capacity, occluder_capacity;
    int curved_capacity, shell_capacity;
    double radius_m; /* of a sphere about the body's origin that contains all parts in any pose */
    double lobe_rad; /* narrowest specular lobe (bst_brdf_lobe_rad) */
} bst_satellite;

/* Builds a model from its configuration.
 *
 * Given:     config    materials, joints and parts, or a file of them
 *            base_dir  base of relative paths; a file's own paths start at its folder
 * Returned:  *out  the model; NULL on error
 * Errors:    BST_ERR_CONFIG with the JSON path below the shape, or the file and the part, what was
 *            found and what is allowed; BST_ERR_NOT_FOUND, BST_ERR_IO, BST_ERR_FORMAT of files;
 *            BST_ERR_MEMORY
 * Ownership: free *out with bst_satellite_free */
bst_status bst_satellite_create(bst_ctx *ctx, const bst_satellite_config *config,
                                const char *base_dir, bst_satellite **out) BST_MUST_CHECK;
/* Frees a model; NULL is allowed. */
void bst_satellite_free(bst_satellite *satellite);

/* Computes the reflectances of all materials, and the absorptance of those that give none: what
 * they do not reflect at normal incidence. Needed before heat.h and shape_forces.h, by one thread;
 * 10 ms a material. */
void bst_satellite_make_surfaces(bst_satellite *satellite);

/* Reads a model from a file: JSON, or a mesh. Errors and ownership of bst_satellite_create. */
bst_status bst_satellite_load(bst_ctx *ctx, const char *path, bst_satellite **out) BST_MUST_CHECK;

#endif
