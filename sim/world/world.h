/* The true world of a run: time, Earth orientation, stars, space objects, observers and sensors. */
#ifndef BST_WORLD_WORLD_H
#define BST_WORLD_WORLD_H

#include "boresight/archive.h"
#include "boresight/camera.h"
#include "boresight/config.h"
#include "sim/astro/bodies.h"
#include "sim/astro/elements.h"
#include "sim/astro/forces.h"
#include "sim/catalogue/stars.h"
#include "sim/world/scene/brightness.h"

typedef struct bst_world bst_world; /* immutable after creation; shareable between threads */

/* A user's view of the world: caches rotations and body positions near the requested times. Its
 * results do not depend on earlier requests. One per module instance; for one thread; constant
 * memory. */
typedef struct bst_world_view bst_world_view;

typedef struct bst_world_object_info {
    char name[64];
    int norad;      /* 0: none */
    double area_m2; /* cross-section of the sphere */
    double albedo;  /* of the sphere */
    const bst_brightness *brightness;
    const struct bst_object_shape *shape; /* NULL: a sphere */
} bst_world_object_info;

/* Geocentric state in GCRF. */
typedef struct bst_world_state {
    bst_vec3 position_m;
    bst_vec3 velocity_mps;
} bst_world_state;

/* Time `seconds` after the scenario's epoch. */
bst_time bst_world_time(const bst_world *world, double seconds);
/* Earth orientation data of the scenario; owned by the world. */
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
/* Number of space objects in the world. */
int bst_world_object_count(const bst_world *world);

/* Description of an object; it belongs to the world.
 *
 * Given:     object  index, 0 to one less than the number of objects */
const bst_world_object_info *bst_world_object(const bst_world *world, int object);
/* Number of the first part of an object with a shape, from 1: parts are numbered over all objects
 * in their order. For an object without shape: that of the next one with a shape. */
int bst_world_first_part(const bst_world *world, int object);
/* Age of the element set of a body at the scenario's epoch, s. Body: object index, or number of
 * objects + observer index. False: its orbit has no element set. */
bool bst_world_element_age(const bst_world *world, int body, double *seconds);
/* Element set of an object's orbit as catalogued, and the time from its epoch to that of the
 * scenario, s. NULL: its orbit has no element set, or burns. */
const bst_elements *bst_world_elements(const bst_world *world, int object, double *epoch_offset_s);
/* Geocentric positions (GCRF, m) of all objects within 4 s of `seconds`, accurate to 1 km, as
 * bst_ephemeris_places has them. */
double bst_world_places(const bst_world *world, double seconds, double *x_m, double *y_m,
                        double *z_m);
/* Motion model of an object without its state: SGP4 with drag term, or force model. */
typedef struct bst_world_motion_law {
    bool sgp4;                     /* motion by an element set */
    double bstar;                  /* of the element set, 1 / Earth radii */
    const bst_force_model *forces; /* of a numerical orbit, owned by the world; NULL: unknown */
} bst_world_motion_law;
/* Motion model of an object; for an orbit relative to another object, the model of that object. */
bst_world_motion_law bst_world_object_motion(const bst_world *world, int object);
/* Index of the object with this name; -1: none. */
int bst_world_find_object(const bst_world *world, const char *name);
/* Sets the state (GCRF) of an externally commanded object from `seconds` after the epoch; two-body
 * motion continues it. It changes the truth only, not onboard knowledge. BST_ERR_NOT_FOUND: no such
 * object accepts states; BST_ERR_ARGUMENT: not later than the previous state. */
bst_status bst_world_steer(bst_ctx *ctx, const bst_world *world, const char *name, double seconds,
                           const bst_world_state *state) BST_MUST_CHECK;
/* Sets the attitude of the shape of an externally commanded object from `seconds` after the epoch;
 * it turns at the given rate (body frame) until the next command. BST_ERR_NOT_FOUND: no such object
 * accepts attitudes; BST_ERR_ARGUMENT: not later than the previous one, or no unit quaternion. */
bst_status bst_world_turn(bst_ctx *ctx, const bst_world *world, const char *name, double seconds,
                          bst_quat q_body_from_gcrf, bst_vec3 rate_body_radps) BST_MUST_CHECK;
/* Archives what a run changes of the world: the states of externally commanded objects. All other
 * members are constant or caches whose values depend on the time alone; so are those of
 * bst_world_view. */
void bst_world_archive(const bst_world *world, bst_archive *archive);
/* Number of observers in the world. */
int bst_world_observer_count(const bst_world *world);
/* Number of sensors of an observer. */
int bst_world_sensor_count(const bst_world *world, int observer);
/* Name of an observer; it belongs to the world. */
const char *bst_world_observer_name(const bst_world *world, int observer);
/* The sensor's true camera. */
const bst_camera *bst_world_camera(const bst_world *world, int observer, int sensor);

struct bst_frame_updates;
/* Frame updates of a sensor (sim/world/frame_updates.h); NULL: none. */
const struct bst_frame_updates *bst_world_frame_updates(const bst_world *world, int observer,
                                                        int sensor);
struct bst_exposure_config;
/* Exposure settings of a sensor, as in the scenario. */
const struct bst_exposure_config *bst_world_exposure(const bst_world *world, int observer,
                                                     int sensor);

/* Initial attitude of the spacecraft body: +z towards the cue at the epoch (by onboard knowledge,
 * with all errors), +x as close as possible to the sensor's x_axis_gcrf. The camera has these axes
 * at zero gimbal angles. */
bst_quat bst_world_body_attitude(const bst_world *world, int observer, int sensor);

/* Creates a view of a world, with a sky clock of its own; one thread may use it at a time.
 *
 * Given:     world  must outlive the view
 * Returned:  *out  NULL on error
 * Errors:    BST_ERR_MEMORY
 * Ownership: free *out with bst_world_view_free */
bst_status bst_world_view_create(bst_ctx *ctx, const bst_world *world,
                                 bst_world_view **out) BST_MUST_CHECK;
/* Frees a view; the world is not affected; NULL is allowed. */
void bst_world_view_free(bst_world_view *view);

/* Leaves the thermal emission of shapes out of all sights: who asks for magnitudes only needs no
 * visible areas, which take as long as the reflected light. */
void bst_world_view_reflected_only(bst_world_view *view);

/* True state of an object at `seconds` after the epoch. BST_ERR_NUMERIC: its orbit has decayed. */
bst_status bst_world_view_object_state(bst_ctx *ctx, bst_world_view *view, int object,
                                       double seconds, bst_world_state *out) BST_MUST_CHECK;

/* State of an observer.
 *
 * Given:     seconds  since the epoch
 * Errors:    those of bst_world_view_object_state */
bst_status bst_world_view_observer_state(bst_ctx *ctx, bst_world_view *view, int observer,
                                         double seconds, bst_world_state *out) BST_MUST_CHECK;
/* Onboard navigation of a sensor: observer state with orbit error, and Sun and Moon, both at the
 * time of the onboard clock. */
bst_status bst_world_view_nav(bst_ctx *ctx, bst_world_view *view, int observer, int sensor,
                              double seconds, bst_world_state *state,
                              bst_bodies *bodies) BST_MUST_CHECK;
/* Earth rotation matrices at a time after the epoch, interpolated. */
bst_status bst_world_view_earth_frames(bst_ctx *ctx, bst_world_view *view, double seconds,
                                       bst_astro_earth_frames *out) BST_MUST_CHECK;

/* Sun, Moon and Earth at a time.
 *
 * Given:     seconds  since the epoch
 * Errors:    BST_ERR_RANGE outside the Earth orientation data */
bst_status bst_world_view_bodies(bst_ctx *ctx, bst_world_view *view, double seconds,
                                 bst_bodies *out) BST_MUST_CHECK;

/* An object as seen by an observer: light time, phase and shadow at emission, brightness. */
typedef struct bst_world_sight {
    bst_vec3 geometric;     /* unit, GCRF: object at emission minus observer at reception */
    bst_vec3 apparent;      /* with stellar aberration */
    double range_m;         /* from the observer at reception to the object at emission */
    double light_time_s;    /* barycentric length of the light path over c */
    double phase_rad;       /* angle Sun - object - observer */
    double sunlit_fraction; /* visible fraction of the Sun's disc, 0..1 */
    double v_mag;           /* of reflected light; +INFINITY when dark */
    bst_scene_glow glow;    /* reflected and emitted light */
    bool occulted;          /* behind the Earth */
} bst_world_sight;

/* What an observer sees of an object: direction with light time, range, brightness, shadow.
 *
 * Given:     seconds  time of reception since the epoch
 * Errors:    those of the orbits */
bst_status bst_world_view_sight(bst_ctx *ctx, bst_world_view *view, int observer, int object,
                                double seconds, bst_world_sight *out) BST_MUST_CHECK;

/* The same from any place, a site on the Earth too.
 *
 * Given:     place    state of the observer at reception, geocentric GCRF
 *            seconds  time of reception since the epoch
 * Errors:    those of the orbits */
bst_status bst_world_view_sight_from(bst_ctx *ctx, bst_world_view *view,
                                     const bst_world_state *place, int object, double seconds,
                                     bst_world_sight *out) BST_MUST_CHECK;

/* V magnitude of a Lambertian sphere of cross-section area_m2 and albedo at phase angle and range:
 * V_sun - 2.5 log10(2 albedo area ((pi - phi) cos phi + sin phi) / (3 pi^2 range^2)), V_sun =
 * -26.74 at 1 au. +INFINITY where there is no light: a black or empty sphere, a phase of pi, or a
 * value that is not a number. */
double bst_world_lambert_sphere_v_mag(double area_m2, double albedo, double phase_rad,
                                      double range_m, double sun_distance_m);

#endif
