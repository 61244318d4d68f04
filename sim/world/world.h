/* The true world of one run: time, Earth orientation, stars, space objects, observers and their
 * sensors. */
#ifndef BST_WORLD_WORLD_H
#define BST_WORLD_WORLD_H

#include "boresight/camera.h"
#include "boresight/config.h"
#include "sim/astro/bodies.h"
#include "sim/astro/forces.h"
#include "sim/catalogue/stars.h"
#include "sim/world/scene/brightness.h"

typedef struct bst_world bst_world; /* immutable once made; shareable between threads */

/* A cheap per-user window on the world: caches rotations and bodies near the times asked for. One
 * per module instance; not shareable between threads; memory does not grow. */
typedef struct bst_world_view bst_world_view;

typedef struct bst_world_object_info {
    char name[64];
    int norad;      /* 0: none */
    double area_m2; /* cross-section of the sphere */
    double albedo;  /* of the sphere */
    const bst_brightness *brightness;
} bst_world_object_info;

/* Geocentric state in GCRF. */
typedef struct bst_world_state {
    bst_vec3 position_m;
    bst_vec3 velocity_mps;
} bst_world_state;

/* The instant `seconds` after the scenario's epoch. */
bst_time bst_world_time(const bst_world *world, double seconds);
/* Earth orientation of the scenario; lent. */
const bst_astro_eop *bst_world_earth_orientation(const bst_world *world);
/* Logs a warning if a run ends after the Earth-orientation table, with the uncertainty of the
 * predicted orientation at its end.
 *
 * Given:     scenario    name of the file, for the message
 *            duration_s  duration of the run, s */
void bst_world_warn_earth_orientation(bst_ctx *ctx, const char *scenario, const bst_world *world,
                                      double duration_s);
/* Star catalogue of a world; it belongs to the world. */
const bst_stars *bst_world_stars(const bst_world *world);
/* Number of objects. */
int bst_world_object_count(const bst_world *world);

/* Description of an object; it belongs to the world.
 *
 * Given:     object  index, 0 to one less than the number of objects */
const bst_world_object_info *bst_world_object(const bst_world *world, int object);
/* Time from the epoch of a body's element set to the scenario's epoch, s; bodies are numbered
 * objects first, then observers. False: its orbit is no element set. */
bool bst_world_element_age(const bst_world *world, int body, double *seconds);
/* Law of motion of an object, without its state: SGP4 with a drag term, or forces. */
typedef struct bst_world_motion_law {
    bool sgp4;                     /* an element set */
    double bstar;                  /* of the set, 1 / Earth radii */
    const bst_force_model *forces; /* of an integrated orbit, lent by the world; NULL: none known */
} bst_world_motion_law;
/* Law of motion of an object; for an orbit relative to another object, the law of that object. */
bst_world_motion_law bst_world_object_motion(const bst_world *world, int object);
/* Index of the object with this name, -1 when there is none. */
int bst_world_find_object(const bst_world *world, const char *name);
/* From `seconds` after the epoch on the object of this name is in this state (GCRF) and moves on by
 * two-body motion, until its next one. Truth only: what is known on board stays. BST_ERR_NOT_FOUND:
 * there is none that is steered; BST_ERR_ARGUMENT: not later than the state before. */
bst_status bst_world_steer(bst_ctx *ctx, const bst_world *world, const char *name, double seconds,
                           const bst_world_state *state) BST_MUST_CHECK;
/* Number of observers. */
int bst_world_observer_count(const bst_world *world);
/* Number of sensors of an observer. */
int bst_world_sensor_count(const bst_world *world, int observer);
/* Name of an observer; it belongs to the world. */
const char *bst_world_observer_name(const bst_world *world, int observer);
/* The sensor's true camera. */
const bst_camera *bst_world_camera(const bst_world *world, int observer, int sensor);

struct bst_frame_updates;
/* The file that drives the sensor frame by frame (sim/world/frame_updates.h); NULL: none. */
const struct bst_frame_updates *bst_world_frame_updates(const bst_world *world, int observer,
                                                        int sensor);
struct bst_exposure_config;
/* The sensor's exposure settings as the scenario has them. */
const struct bst_exposure_config *bst_world_exposure(const bst_world *world, int observer,
                                                     int sensor);

/* Body attitude that the spacecraft starts in and holds: +z towards the cue at the epoch as the
 * onboard side reckons it, with all its errors, +x as near as can be to the sensor's x_axis_gcrf.
 * The camera has these axes when both gimbal angles are zero. */
bst_quat bst_world_body_attitude(const bst_world *world, int observer, int sensor);

/* Creates a view of a world, with a sky clock of its own; one thread may use it at a time.
 *
 * Given:     world  must outlive the view
 * Returned:  *out  NULL on error
 * Errors:    BST_ERR_MEMORY
 * Ownership: free *out with bst_world_view_free */
bst_status bst_world_view_create(bst_ctx *ctx, const bst_world *world,
                                 bst_world_view **out) BST_MUST_CHECK;
/* Frees a view; the world itself stays; NULL is allowed. */
void bst_world_view_free(bst_world_view *view);

/* True state of an object or observer `seconds` after the epoch. BST_ERR_NUMERIC when its orbit has
 * no state then (decayed). */
bst_status bst_world_view_object_state(bst_ctx *ctx, bst_world_view *view, int object,
                                       double seconds, bst_world_state *out) BST_MUST_CHECK;

/* State of an observer.
 *
 * Given:     seconds  since the epoch
 * Errors:    those of bst_world_view_object_state */
bst_status bst_world_view_observer_state(bst_ctx *ctx, bst_world_view *view, int observer,
                                         double seconds, bst_world_state *out) BST_MUST_CHECK;
/* What the onboard side of a sensor believes then: the observer's state with its orbit error, and
 * the bodies, both at the time that its clock shows. */
bst_status bst_world_view_nav(bst_ctx *ctx, bst_world_view *view, int observer, int sensor,
                              double seconds, bst_world_state *state,
                              bst_bodies *bodies) BST_MUST_CHECK;
/* Rotations and bodies then, interpolated. */
bst_status bst_world_view_earth_frames(bst_ctx *ctx, bst_world_view *view, double seconds,
                                       bst_astro_earth_frames *out) BST_MUST_CHECK;

/* Sun, Moon and Earth at a time.
 *
 * Given:     seconds  since the epoch
 * Errors:    BST_ERR_RANGE outside the Earth orientation data */
bst_status bst_world_view_bodies(bst_ctx *ctx, bst_world_view *view, double seconds,
                                 bst_bodies *out) BST_MUST_CHECK;

/* What an observer sees of an object: light time solved, Sun and shadow at the time the light left.
 */
typedef struct bst_world_sight {
    bst_vec3 geometric;     /* unit, GCRF: object at emission minus observer at reception */
    bst_vec3 apparent;      /* the same with stellar aberration */
    double range_m;         /* geocentric: observer at reception to object at emission */
    double light_time_s;    /* barycentric: length of the light's path over c */
    double phase_rad;       /* Sun - object - observer */
    double sunlit_fraction; /* of the Sun's disc, 0..1 */
    double v_mag;           /* of reflected light; +INFINITY when dark */
    bst_scene_glow glow;    /* all its light */
    bool occulted;          /* behind the Earth */
} bst_world_sight;

/* What an observer sees of an object: direction with light time, range, brightness, shadow.
 *
 * Given:     seconds  time of reception since the epoch
 * Errors:    those of the orbits */
bst_status bst_world_view_sight(bst_ctx *ctx, bst_world_view *view, int observer, int object,
                                double seconds, bst_world_sight *out) BST_MUST_CHECK;

/* V magnitude of a Lambertian sphere of cross-section area_m2 and albedo at phase angle and range:
 * V_sun - 2.5 log10(2 albedo area ((pi - phi) cos phi + sin phi) / (3 pi^2 range^2)), V_sun =
 * -26.74 at 1 au. +INFINITY where there is no light: a black or empty sphere, a phase of pi, or a
 * value that is not a number. */
double bst_world_lambert_sphere_v_mag(double area_m2, double albedo, double phase_rad,
                                      double range_m, double sun_distance_m);

#endif
