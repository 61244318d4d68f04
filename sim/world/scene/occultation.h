/* Occultation of one space object by another: from an observer, and of its sunlight. */
#ifndef BST_WORLD_SCENE_OCCULTATION_H
#define BST_WORLD_SCENE_OCCULTATION_H

#include "sim/satellite/shape_silhouette.h"
#include "sim/world/scene/object_shape.h"

/* A body at an instant. */
typedef struct bst_occultation_body {
    bst_vec3 position_m, velocity_mps; /* geocentric, GCRF */
    double seconds;                    /* after the epoch */
    double radius_m;                   /* of a sphere that contains it; without shape: its own */
    const bst_object_shape *shape;     /* NULL: a sphere */
    bst_satellite_pose *pose;          /* of the shape: work memory */
} bst_occultation_body;

/* Work memory of one thread. */
typedef struct bst_occultation {
    bst_shape_silhouette body, front;
    bst_polygon_clip clip;
} bst_occultation;

/* Allocates the work memory for shapes of up to `vertices` vertices. BST_ERR_MEMORY. The caller
 * frees *out with bst_occultation_free; NULL on error. */
bst_status bst_occultation_create(bst_ctx *ctx, int vertices, bst_occultation **out) BST_MUST_CHECK;
/* Frees the work memory; NULL is allowed. */
void bst_occultation_free(bst_occultation *occultation);

/* Part of a body's silhouette that another one hides from an observer.
 *
 * Given:     front  the other body, when the light passes it
 *            eye_m  the observer
 *            sun_m  the Sun, for attitudes and joints
 * Returned:  0 to 1; of the area, as if all of it were equally bright
 * Notes:     exact silhouettes of shapes (bst_shape_silhouette_of_pose) */
double bst_occultation_from_eye(bst_occultation *work, const bst_occultation_body *body,
                                const bst_occultation_body *front, bst_vec3 eye_m, bst_vec3 sun_m);

/* Part of the sunlight on a body that another one takes away: mean over its silhouette and over the
 * Sun's disc (48 directions, with limb darkening).
 *
 * Given, Returned: as bst_occultation_from_eye */
double bst_occultation_of_sun(bst_occultation *work, const bst_occultation_body *body,
                              const bst_occultation_body *front, bst_vec3 sun_m);

#endif
