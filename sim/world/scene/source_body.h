/* The model of an object that is rendered with its shape: attitude and light in an exposure. */
#ifndef BST_WORLD_SCENE_SOURCE_BODY_H
#define BST_WORLD_SCENE_SOURCE_BODY_H

#include "boresight/camera.h"
#include "sim/satellite/resolved_image.h"
#include "sim/world/scene/field.h"
#include "sim/world/scene/object_shape.h"

/* Attitudes that a body keeps for an exposure. */
enum { BST_SOURCE_BODY_TIMES = 65 };

/* A body during an exposure. The light of its materials is in electrons per second at the range of
 * the middle. */
typedef struct bst_scene_source_body {
    const bst_satellite *satellite;
    int first_part; /* number of its first part (bst_world_first_part) */
    int times;      /* attitudes at equidistant times from start to end */
    bst_quat q_body_from_gcrf[BST_SOURCE_BODY_TIMES];
    bst_vec3 object_m[2]; /* geocentric position at start and end */
    bst_vec3 sun_m;       /* geocentric position of the Sun */
    double seconds[2];    /* start and end, after the epoch */
    const double *burn_s; /* [burn_count] starts of the object's burns, for joints; borrowed */
    int burn_count;
    bool limb;                 /* the Earth's limb may hide a part: the next three are set */
    bst_scene_source_path eye; /* geocentric places of the observer during these times */
    bst_vec3 lag_m;            /* object at emission minus object at reception */
    bst_vec3 pole;             /* the Earth's axis, unit */
    bool earthshine;
    double earth_albedo;
    bst_resolved_gain gain[BST_SATELLITE_MATERIALS_MAX];
} bst_scene_source_body;

/* The body at one time. */
typedef struct bst_source_body_state {
    bst_quat q_body_from_gcrf;
    bst_vec3 apparent; /* unit, GCRF: from the observer */
    double range_m;
    bst_satellite_aim aim;
    double sun_radius_rad;
    bool earth;
} bst_source_body_state;

/* State of a source's body.
 *
 * Given:     u           time as a fraction of the source's exposure
 * Returned:  *out        the aim is in the body frame
 *            *earthlight in the body frame, if out->earth; may be NULL */
void bst_source_body_at(const bst_scene_source *source, double u, bst_source_body_state *out,
                        bst_earthlight *earthlight);

/* Places a model as a source's body is at a time that bst_source_body_at gave. */
void bst_source_body_set_pose(const bst_scene_source *source, const bst_source_body_state *state,
                              bst_satellite_pose *pose);

/* Sets the light of the materials for a camera.
 *
 * Given:     brightness  earthshine, its albedo, and temperatures
 *            lighting    of the middle of the exposure; positions, sunlight */
void bst_source_body_set_gain(const bst_camera *camera, const bst_brightness_config *brightness,
                              const bst_scene_lighting *lighting, bst_scene_source_body *body);

#endif
