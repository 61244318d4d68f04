/* Inside of the world, shared by the files of sim/world only. */
#ifndef BST_WORLD_WORLD_INTERNAL_H
#define BST_WORLD_WORLD_INTERNAL_H

#include "sim/astro/oem.h"
#include "sim/astro/sgp4.h"
#include "sim/astro/sky_clock.h"
#include "sim/astro/state_table.h"
#include "sim/astro/trajectory.h"
#include "sim/catalogue/faint_stars.h"
#include "sim/catalogue/star_index.h"
#include "sim/world/name_index.h"
#include "sim/world/world.h"
#include "sim/world/world_config.h"

/* A burn with what it has made of the orbit; worked out once. */
typedef struct bst_world_burn {
    double time_s;
    bst_world_state base;      /* the catalogued orbit at that time */
    bst_world_state deviation; /* from it, right after this burn, of all burns so far */
} bst_world_burn;

/* An orbit ready to be evaluated; immutable. */
typedef struct bst_world_orbit {
    int32_t source; /* BST_ORBIT_... */
    /* sgp4 */
    bst_sgp4 *sgp4;
    double epoch_offset_s; /* scenario epoch minus element epoch */
    double bstar;          /* 1 / Earth radii */
    /* relative */
    const struct bst_world_orbit *reference;
    double at_s;
    bst_vec3 offset_rtn_m, rate_rtn_mps;
    /* oem, injected: borrowed from the world's files */
    const bst_oem *oem;
    const bst_state_table *injected;
    int file_object;
    bool in_teme;        /* injected */
    double from_s, to_s; /* span of the states, after the epoch */
    /* numerical */
    bst_gravity *gravity;
    bst_force_model forces;
    bst_trajectory *unburnt, *burnt; /* burnt NULL: there are no burns */

    bst_world_burn *burns;
    int burn_count;
    struct bst_external_states *external; /* owned; NULL: its states do not come by message */
    const char *name;                     /* for messages; borrowed */
} bst_world_orbit;

typedef struct world_object {
    bst_world_object_info info;
    bst_world_orbit orbit;
    bool catalogued; /* from a catalogue, not from the list */
} world_object;

typedef struct world_sensor {
    bst_sensor_config config;
    int cue_object;         /* -1: none */
    bst_vec3 cue_rotation;  /* the cue's error: rotation vector, GCRF */
    bst_quat body_attitude; /* see bst_world_body_attitude */
} world_sensor;

typedef struct world_observer {
    char name[64];
    int norad;      /* 0: none */
    int own_object; /* that this observer is, of a constellation; -1: none */
    bst_world_orbit orbit;
    world_sensor *sensors;
    int sensor_count;
} world_observer;

/* A file of states that objects share. */
typedef struct bst_world_file {
    char *key;
    bst_oem *oem;
    bst_state_table *injected;
} bst_world_file;

struct bst_frame_updates;

/* The file that drives a sensor frame by frame. */
typedef struct world_updates {
    int observer, sensor;
    bst_camera camera;
    bst_exposure_config exposure;
    struct bst_frame_updates *file;
} world_updates;

struct bst_world {
    bst_time epoch;
    bst_astro_eop *eop;
    bst_sky_clock_grid *sky_grid; /* of all clocks of the world */
    bool shadow_atmosphere;       /* the air at the edge of the Earth's shadow counts for light */
    bst_stars *stars;
    bst_faint_sky *faint;     /* NULL: neither statistical stars nor their light */
    double faint_limit_v_mag; /* single statistical stars down to this; -INFINITY: none */
    world_object *objects;
    int object_count;
    bst_brightness **brightness; /* of the listed objects, then of the catalogues */
    int brightness_count;
    bst_name_index *object_names;
    bst_world_file *files;
    int file_count;
    world_updates *updates;
    int updates_count;
    world_observer *observers;
    int observer_count;
    struct bst_ephemeris *ephemeris;
};

/* State at `seconds` after the scenario's epoch; `with_burns` false gives the orbit as catalogued.
 */
bst_status bst_world_orbit_state(bst_ctx *ctx, const bst_world_orbit *orbit, bst_sky_clock *clock,
                                 bst_time epoch, double seconds, bool with_burns,
                                 bst_world_state *out) BST_MUST_CHECK;

/* The same of an orbit from a file, without burns. */
bst_status bst_world_orbit_file_state(bst_ctx *ctx, const bst_world_orbit *orbit,
                                      bst_sky_clock *clock, bst_time epoch, double seconds,
                                      bst_world_state *out) BST_MUST_CHECK;

/* Fills orbit->burns (by time, freed by the caller's owner) once the orbit itself is made.
 * BST_ERR_NUMERIC when the orbit has no state at a burn. */
bst_status bst_world_orbit_set_burns(bst_ctx *ctx, bst_world_orbit *orbit, bst_sky_clock *clock,
                                     bst_time epoch, const bst_burn_config *burns,
                                     int count) BST_MUST_CHECK;

/* Where and when light arrives. */
typedef struct bst_world_reception {
    const bst_world_state *observer;
    bst_sky_clock *clock;
    bst_time epoch;
    const bst_bodies *bodies;
    double seconds; /* after the epoch */
} bst_world_reception;

/* Light-time solution: where the object was when the light left that reaches the observer at
 * `seconds`. *geometric_m: from the observer at reception to the object at emission in barycentric
 * axes (its direction is what stars are compared with); *emission_s: the time of emission. */
bst_status bst_world_orbit_line_of_sight(bst_ctx *ctx, const bst_world_orbit *object,
                                         const bst_world_reception *at, bool with_burns,
                                         bst_vec3 *geometric_m, bst_world_state *object_state,
                                         double *emission_s) BST_MUST_CHECK;

/* Who looks, and when: an exposure. */
typedef struct bst_world_view_span {
    int observer;
    double start_s, end_s;
} bst_world_view_span;

struct bst_scene_source_path;
struct bst_scene_path_light;
/* The path of an object as an observer sees it in a span, the sight at the middle, and
 * what its light follows from.
 * BST_ERR_NUMERIC when either has no orbit at some time of it. */
bst_status bst_world_view_path(bst_ctx *ctx, bst_world_view *view, const bst_world_view_span *span,
                               int object, struct bst_scene_source_path *path,
                               struct bst_scene_path_light *light,
                               bst_world_sight *mid) BST_MUST_CHECK;

/* Indices (ascending) of the objects that may be seen in a cone of apparent directions at any time
 * of a span, and few others; room for all. */
bst_status bst_world_view_near(bst_ctx *ctx, bst_world_view *view, const bst_world_view_span *span,
                               bst_vec3 axis, double half_angle_rad, int *indices,
                               int *count) BST_MUST_CHECK;

/* Works out a sensor's cue: object index, error rotation, body attitude. `scenario` names the file
 * in messages. */
bst_status bst_world_cue_resolve(bst_ctx *ctx, const char *scenario, bst_world *world, int observer,
                                 int sensor, bst_sky_clock *clock) BST_MUST_CHECK;

/* A sensor, and the time and the observer's state for which its cue is worked out. */
typedef struct bst_world_cue_at {
    int observer, sensor;
    bst_sky_clock *clock;
    double seconds;
    const bst_world_state *eye;
} bst_world_cue_at;

/* Direction of the cue (unit, GCRF, geometric) without its error: the object's catalogued orbit as
 * seen from an observer in state `eye`, light time in. */
bst_status bst_world_cue_nominal_direction(bst_ctx *ctx, const bst_world *world,
                                           const bst_world_cue_at *at,
                                           bst_vec3 *out) BST_MUST_CHECK;

/* The vector (m, GCRF, geometric) of which that is the direction; 0 where the cue is a direction
 * only. */
/* A place of the cue's region (kind other than none) by its angles from the middle, as
 * bst_knowledge_region_direction_at. */
bst_status bst_world_region_place(bst_ctx *ctx, const bst_world *world, const bst_world_cue_at *at,
                                  double along_rad, double across_rad,
                                  bst_vec3 *out) BST_MUST_CHECK;
/* Half the length of a region's arc, rad; 0 for regions that are not an arc. */
double bst_world_region_half_length_rad(const bst_region_config *region);

/* Vector from an observer to the cued object on its nominal orbit, m; zero without an object.
 *
 * Given:     at       sensor, time since the epoch and the observer's state then
 * Errors:    those of the orbit */
bst_status bst_world_cue_nominal_line(bst_ctx *ctx, const bst_world *world,
                                      const bst_world_cue_at *at, bst_vec3 *line_m) BST_MUST_CHECK;

/* The same of any object. */
bst_status bst_world_object_nominal_line(bst_ctx *ctx, const bst_world *world, int object,
                                         bst_sky_clock *clock, double seconds,
                                         const bst_world_state *eye,
                                         bst_vec3 *line_m) BST_MUST_CHECK;

/* Time after the epoch that the onboard clock shows `seconds` after the epoch. */
double bst_world_nav_seconds(const bst_world *world, int observer, int sensor, double seconds);

/* Adds to an observer's state, that of when the onboard clock shows believed_s, the error with
 * which the onboard side of a sensor knows it. */
void bst_world_nav_estimate(const bst_world *world, int observer, int sensor, double believed_s,
                            bst_world_state *state);

#endif
