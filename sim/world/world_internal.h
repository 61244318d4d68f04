/* Internal types of the world, shared by the files of sim/world. */
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

/* A burn and its effect on the orbit, computed once. */
typedef struct bst_world_burn {
    double time_s;
    bst_world_state base;      /* catalogued orbit at the burn */
    bst_world_state deviation; /* cumulative deviation from it after this burn */
} bst_world_burn;

/* An orbit ready for evaluation; immutable. */
typedef struct bst_world_orbit {
    int32_t source; /* BST_ORBIT_... */
    /* sgp4 */
    bst_sgp4 *sgp4;
    double epoch_offset_s; /* scenario epoch minus element epoch */
    double bstar;          /* 1 / Earth radii */
    bst_elements elements; /* mean elements of `sgp4` */
    /* relative: the reference orbit */
    const struct bst_world_orbit *reference;
    double at_s;
    bst_vec3 offset_rtn_m, rate_rtn_mps;
    /* oem, injected: borrowed from the world's files */
    const bst_oem *oem;
    const bst_state_table *injected;
    int file_object;
    bool in_teme;        /* injected */
    double from_s, to_s; /* time span of the states, after the epoch */
    /* numerical */
    bst_gravity *gravity;
    bst_force_model forces;
    bst_trajectory *unburnt, *burnt; /* with and without burns; burnt NULL: no burns */

    bst_world_burn *burns;
    int burn_count;
    struct bst_external_states *external; /* owned; NULL: not externally commanded */
    const char *name;                     /* for messages; borrowed */
} bst_world_orbit;

typedef struct world_object {
    bst_world_object_info info;
    bst_world_orbit orbit;
    bool catalogued; /* from a catalogue file, not from the list */
} world_object;

typedef struct world_sensor {
    bst_sensor_config config;
    int cue_object;         /* -1: none */
    bst_vec3 cue_rotation;  /* cue error: rotation vector, GCRF */
    bst_quat body_attitude; /* see bst_world_body_attitude */
} world_sensor;

typedef struct world_observer {
    char name[64];
    int norad;      /* 0: none */
    int own_object; /* object of a constellation that this observer is; -1: none */
    bst_world_orbit orbit;
    world_sensor *sensors;
    int sensor_count;
} world_observer;

/* A file of states shared by several objects. */
typedef struct bst_world_file {
    char *key;
    bst_oem *oem;
    bst_state_table *injected;
} bst_world_file;

struct bst_frame_updates;

/* Frame updates of one sensor. */
typedef struct world_updates {
    int observer, sensor;
    bst_camera camera;
    bst_exposure_config exposure;
    struct bst_frame_updates *file;
} world_updates;

struct bst_world {
    bst_time epoch;
    bst_astro_eop *eop;
    bst_sky_clock_grid *sky_grid; /* shared by all clocks of the world */
    bool shadow_atmosphere;       /* sunlight at the edge of the shadow includes the atmosphere */
    bst_stars *stars;
    bst_faint_sky *faint;     /* NULL: no statistical stars and no light of them */
    double faint_limit_v_mag; /* magnitude limit of single statistical stars; -INFINITY: none */
    world_object *objects;
    int object_count;
    bst_brightness **brightness; /* of listed objects, then of catalogues */
    int brightness_count;
    struct bst_object_shape **shapes; /* of the objects that have one */
    int shape_count;
    int *occulters; /* objects that hide others and take their sunlight */
    int occulter_count;
    bst_name_index *object_names;
    bst_world_file *files;
    int file_count;
    world_updates *updates;
    int updates_count;
    world_observer *observers;
    int observer_count;
    struct bst_ephemeris *ephemeris;
};

/* State of an orbit at `seconds` after the epoch; `with_burns` false: the catalogued orbit. */
bst_status bst_world_orbit_state(bst_ctx *ctx, const bst_world_orbit *orbit, bst_sky_clock *clock,
                                 bst_time epoch, double seconds, bool with_burns,
                                 bst_world_state *out) BST_MUST_CHECK;

/* State of an orbit from a file, without burns. */
bst_status bst_world_orbit_file_state(bst_ctx *ctx, const bst_world_orbit *orbit,
                                      bst_sky_clock *clock, bst_time epoch, double seconds,
                                      bst_world_state *out) BST_MUST_CHECK;

/* Sets the burns of an orbit, sorted by time, after the orbit was created. The caller frees them.
 * BST_ERR_NUMERIC: no state at a burn. */
bst_status bst_world_orbit_set_burns(bst_ctx *ctx, bst_world_orbit *orbit, bst_sky_clock *clock,
                                     bst_time epoch, const bst_burn_config *burns,
                                     int count) BST_MUST_CHECK;

/* Reception of light: observer position and time. */
typedef struct bst_world_reception {
    const bst_world_state *observer;
    bst_sky_clock *clock;
    bst_time epoch;
    const bst_bodies *bodies;
    double seconds; /* after the epoch */
} bst_world_reception;

/* Light-time solution of an object's orbit for an observer at `seconds`. *geometric_m: from the
 * observer at reception to the object at emission, barycentric axes (comparable with star
 * directions); *emission_s: time of emission. */
bst_status bst_world_orbit_line_of_sight(bst_ctx *ctx, const bst_world_orbit *object,
                                         const bst_world_reception *at, bool with_burns,
                                         bst_vec3 *geometric_m, bst_world_state *object_state,
                                         double *emission_s) BST_MUST_CHECK;

/* Observer and time span of an exposure. */
typedef struct bst_world_view_span {
    int observer;
    double start_s, end_s;
} bst_world_view_span;

struct bst_scene_source_path;
struct bst_scene_path_light;
/* Path of an object relative to an observer during a span, the sight at mid-span, and the inputs of
 * its brightness. BST_ERR_NUMERIC if an orbit does not cover the span. */
bst_status bst_world_view_path(bst_ctx *ctx, bst_world_view *view, const bst_world_view_span *span,
                               int object, struct bst_scene_source_path *path,
                               struct bst_scene_path_light *light,
                               bst_world_sight *mid) BST_MUST_CHECK;

/* Indices (ascending) of the objects that may be in a cone of apparent directions during a span,
 * and few others; room for all. */
bst_status bst_world_view_near(bst_ctx *ctx, bst_world_view *view, const bst_world_view_span *span,
                               bst_vec3 axis, double half_angle_rad, int *indices,
                               int *count) BST_MUST_CHECK;

/* Computes a sensor's cue: object index, error rotation, body attitude. `scenario`: file name for
 * messages. */
bst_status bst_world_cue_resolve(bst_ctx *ctx, const char *scenario, bst_world *world, int observer,
                                 int sensor, bst_sky_clock *clock) BST_MUST_CHECK;

/* A sensor, and the time and observer state at which its cue is evaluated. */
typedef struct bst_world_cue_at {
    int observer, sensor;
    bst_sky_clock *clock;
    double seconds;
    const bst_world_state *eye;
} bst_world_cue_at;

/* Direction of the cue (unit, GCRF, geometric) without its error: the object's catalogued orbit
 * from observer state `eye`, with light time. */
bst_status bst_world_cue_nominal_direction(bst_ctx *ctx, const bst_world *world,
                                           const bst_world_cue_at *at,
                                           bst_vec3 *out) BST_MUST_CHECK;

/* Direction of a point of the cue's region (kind other than none) by angles from its centre, as
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

/* Vector from an observer to an object on its nominal orbit, m. */
bst_status bst_world_object_nominal_line(bst_ctx *ctx, const bst_world *world, int object,
                                         bst_sky_clock *clock, double seconds,
                                         const bst_world_state *eye,
                                         bst_vec3 *line_m) BST_MUST_CHECK;

/* Onboard clock reading at `seconds` after the epoch, as time after the epoch. */
double bst_world_nav_seconds(const bst_world *world, int observer, int sensor, double seconds);

/* Adds the navigation error of a sensor to the observer's state at onboard time believed_s. */
void bst_world_nav_estimate(const bst_world *world, int observer, int sensor, double believed_s,
                            bst_world_state *state);

#endif
