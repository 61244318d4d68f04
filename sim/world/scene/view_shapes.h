/* What a view of the world keeps for objects with a shape and for occultations of objects by
 * others. Internal to sim/world. */
#ifndef BST_WORLD_SCENE_VIEW_SHAPES_H
#define BST_WORLD_SCENE_VIEW_SHAPES_H

#include "sim/world/scene/object_heat.h"
#include "sim/world/scene/occultation.h"
#include "sim/world/world_internal.h"

/* Work memory of one thread. */
typedef struct bst_view_shapes {
    const bst_world *world;
    bst_sky_clock *clock;         /* borrowed */
    bst_satellite_pose **poses;   /* by shape of the world */
    bst_object_heat **heats;      /* likewise; NULL where there is no heat balance */
    bst_occultation *occultation; /* NULL: no object hides others */
} bst_view_shapes;

/* Allocates the work memory; none for a world without shapes and objects that hide others.
 *
 * Given:     world, clock  outlive it
 * Returned:  *out  to be freed with bst_view_shapes_free, also after an error
 * Errors:    BST_ERR_MEMORY */
bst_status bst_view_shapes_create(bst_ctx *ctx, const bst_world *world, bst_sky_clock *clock,
                                  bst_view_shapes *out) BST_MUST_CHECK;
/* Frees the work memory; the struct belongs to the caller. */
void bst_view_shapes_free(bst_view_shapes *shapes);

/* An object at the emission of its light. */
typedef struct bst_view_emission {
    int object;
    bst_vec3 position_m, velocity_mps; /* the velocity matters for shapes only */
    double seconds;
} bst_view_emission;

/* What other objects leave of an object's sunlight, and of its light to an observer: 0 to 1. */
typedef struct bst_view_mutual {
    double sunlight, visible;
} bst_view_mutual;

/* Occultations of an object by those that hide others, when its light passes them.
 *
 * Given:     eye_m  the observer
 *            sun_m  geocentric origin of the sunlight */
bst_view_mutual bst_view_shapes_occultations(const bst_view_shapes *shapes,
                                             const bst_view_emission *at, bst_vec3 eye_m,
                                             bst_vec3 sun_m);

#endif
