/* Temperatures of the facets of an object with a shape, from its heat balance. */
#ifndef BST_WORLD_SCENE_OBJECT_HEAT_H
#define BST_WORLD_SCENE_OBJECT_HEAT_H

#include "sim/satellite/heat_history.h"
#include "sim/world/scene/object_shape.h"

/* Where an object is at a time, geocentric, GCRF. */
typedef struct bst_object_place {
    bst_vec3 position_m, velocity_mps, sun_m;
    double sunlit_fraction;
} bst_object_place;

/* Work memory of a view for the heat balance of one object. */
typedef struct bst_object_heat {
    double *load_wpm2, *kelvin; /* by facet */
    bst_heat_history *history;  /* NULL: steady */
    /* The object's place at a time; false: unknown. */
    bool (*place)(void *user, int object, double seconds, bst_object_place *out);
    void *user;
    int object;
} bst_object_heat;

/* Allocates the memory of a heat balance.
 *
 * Given:     shape      outlives it
 *            transient  with heat capacities
 * Returned:  *out  without place, user and object; NULL on error
 * Errors:    BST_ERR_MEMORY
 * Ownership: free *out with bst_object_heat_free */
bst_status bst_object_heat_create(bst_ctx *ctx, const bst_object_shape *shape, bool transient,
                                  bst_object_heat **out) BST_MUST_CHECK;
/* Frees the memory; NULL is allowed. */
void bst_object_heat_free(bst_object_heat *heat);

/* Replaces the thermal emission of a glow by that of the facets' temperatures.
 *
 * Given:     shape, pose   as bst_object_shape_glow left them
 *            brightness    albedo and infrared of the Earth
 *            lighting      of the same instant
 *            velocity_mps  of the object
 * Returned:  *out     emission, its mean temperature and its parts
 * Notes:     where the loads of earlier times are unknown, the balance is steady. Joints that
 *            follow the observer are turned to the Earth at earlier times. */
void bst_object_heat_glow(bst_object_heat *heat, const bst_object_shape *shape,
                          bst_satellite_pose *pose, const bst_brightness_config *brightness,
                          const bst_scene_lighting *lighting, bst_vec3 velocity_mps,
                          bst_scene_glow *out);

#endif
