/* The parts of a scenario that describe the world, as the configuration tables fill them. */
#ifndef BST_WORLD_WORLD_CONFIG_H
#define BST_WORLD_WORLD_CONFIG_H

#include "boresight/camera.h"
#include "boresight/config.h"
#include "boresight/messages.h"
#include "sim/astro/time.h"
#include "sim/catalogue/stars.h"
#include "sim/onboard/region.h"
#include "sim/world/scene/brightness_config.h"

enum {
    BST_ORBIT_SGP4,
    BST_ORBIT_RELATIVE,
    BST_ORBIT_OEM,
    BST_ORBIT_INJECTED,
    BST_ORBIT_NUMERICAL,
    BST_ORBIT_CONSTELLATION
};

enum { BST_WALKER_DELTA, BST_WALKER_STAR };

enum { BST_STATES_GCRF, BST_STATES_TEME };

enum { BST_STATE_CARTESIAN, BST_STATE_KEPLERIAN, BST_STATE_ELEMENT_SET, BST_STATE_RELATIVE };

typedef struct bst_initial_state_config {
    int32_t source; /* BST_STATE_... */
    double at_s;
    double position_gcrf_m[3], velocity_gcrf_mps[3];
    double semi_major_axis_m, perigee_radius_m; /* NAN: not given; at least one is */
    double eccentricity;
    double inclination_deg, raan_deg, arg_perigee_deg;
    double true_anomaly_deg, mean_anomaly_deg; /* NAN: not given */
} bst_initial_state_config;

/* What Keplerian elements leave open (NAN) of semi-major axis and perigee, true and mean anomaly,
 * from what they give; no anomaly: at the perigee. Of two that agree the radius of perigee and the
 * true anomaly count. BST_ERR_CONFIG, with the keys but without their place, for elements that no
 * orbit has, and when two contradict each other: by more than 1e-6 of the radius, 1e-6 degree. */
bst_status bst_keplerian_resolve(bst_ctx *ctx, bst_initial_state_config *state) BST_MUST_CHECK;

typedef struct bst_force_config {
    char gravity[512]; /* "builtin", "two_body", "j6" or a path as below */
    int64_t degree, order;
    bool sun, moon, solar_pressure, drag;
    double density_scale;
    double tolerance;
} bst_force_config;

typedef struct bst_orbit_spacecraft_config {
    double mass_kg, drag_area_m2, cd, srp_area_m2, cr;
} bst_orbit_spacecraft_config;

typedef struct bst_orbit_config {
    int32_t source;          /* BST_ORBIT_... */
    char elements_file[512]; /* sgp4: path, relative to the scenario's folder */
    int64_t norad;           /* sgp4 */
    char tle_line1[80];      /* sgp4: the element set itself, instead of a file */
    char tle_line2[80];
    char reference[64]; /* relative: name of an object with an orbit of its own, earlier in the list
                         */
    double at_s;        /* relative: time at which offset_rtn_m holds */
    double offset_rtn_m[3];
    double rate_rtn_mps[3];
    char oem_file[512]; /* oem: path as above */
    char oem_object[64];
    char states_file[512]; /* injected: path as above */
    char states_object[64];
    int32_t states_frame;   /* BST_STATES_... */
    char constellation[40]; /* constellation: its name */
    double member[2];       /* plane and slot, from 1 */
    /* numerical */
    bst_initial_state_config state;
    bst_force_config forces;
    bst_orbit_spacecraft_config spacecraft;
} bst_orbit_config;

typedef struct bst_burn_config {
    double time_s;
    double duration_s; /* 0: an impulse */
    double dv_rtn_mps[3];
} bst_burn_config;

typedef struct bst_object_config {
    char name[64];
    bst_orbit_config orbit;
    double area_m2, albedo;
    bst_brightness_config brightness;
    bst_config_list burns; /* bst_burn_config, by time */
    bool external_states;
} bst_object_config;

typedef struct bst_catalogue_config {
    char elements_file[512]; /* path as above */
    double area_m2, albedo;  /* of every object */
    bst_brightness_config brightness;
} bst_catalogue_config;

/* A Walker constellation, each satellite of which becomes an object (constellation.h). */
typedef struct bst_constellation_config {
    char name[40];
    int32_t pattern; /* BST_WALKER_... */
    int64_t satellites, planes, phasing;
    double inclination_deg, semi_major_axis_m, eccentricity;
    double raan_deg, arg_perigee_deg, mean_anomaly_deg; /* of satellite 1-1 */
    double at_s;
    double area_m2, albedo;
    bst_brightness_config brightness;
} bst_constellation_config;

enum { BST_FAINT_NONE, BST_FAINT_STATISTICAL };

struct bst_stars;

typedef struct bst_world_config {
    char star_catalogue[512]; /* "default", "embedded" or a path as above */
    int32_t faint_stars;      /* BST_FAINT_... */
    double faint_limit_v_mag; /* single stars down to this V */
    uint64_t faint_seed;
    char earth_orientation[512]; /* "builtin" or a path as above */
    bool shadow_atmosphere;      /* the air bends, reddens and weakens light at the shadow's edge */
    bst_config_list objects;     /* bst_object_config */
    bst_config_list catalogues;  /* bst_catalogue_config */
    bst_config_list constellations; /* bst_constellation_config */
    /* not in the table: star_catalogue, open already, which outlives the world; NULL: it is opened
     */
    const struct bst_stars *opened_stars;
} bst_world_config;

/* A region of the sky in which a target is to be found, in place of a cue to its place. */
typedef struct bst_region_config {
    int32_t kind;            /* BST_REGION_... */
    double arc_radec_deg[4]; /* of both ends */
    double longitude_deg[2]; /* geostationary: from and to, east */
    double half_width_deg;
} bst_region_config;

typedef struct bst_cue_config {
    char object[64];               /* "" : no cue */
    double direction_radec_deg[2]; /* used when there is no object */
    double offset_deg;
    int32_t offset_axis;     /* index into {"x", "-x", "y", "-y"} */
    double offset_angle_deg; /* from there, from image x towards image y */
    bst_region_config region;
    double sigma_deg, rate_sigma_arcsec_per_s;
    double v_mag, v_mag_sigma;
} bst_cue_config;

typedef struct bst_exposure_config {
    double exposure_s, period_s, first_s;
    double dropped_fraction;
    double dropped_burst_frames; /* mean length of a run of lost frames; 0: each by itself */
    int64_t binning;             /* sensor pixels per side of a pixel that is read */
    double window_px[4];         /* x0, y0, width, height read out; width 0: all of the sensor */
} bst_exposure_config;

/* The part of a sensor of width_px x height_px that is read unless control asks for another.
 * BST_ERR_CONFIG: it does not lie within the sensor. */
bst_status bst_exposure_window(bst_ctx *ctx, const bst_exposure_config *config, int64_t width_px,
                               int64_t height_px, bst_window *out) BST_MUST_CHECK;

/* How the onboard camera differs from the true one. */
typedef struct bst_camera_errors_config {
    double scale_error_ppm;
    double rotation_error_deg;
    bool override_distortion;         /* false: the camera's own coefficients are known */
    bst_camera_distortion distortion; /* with override_distortion: what is known instead */
    double throughput_error;          /* believed over true, minus 1 */
    double psf_fwhm_px;               /* 0: the camera's */
    char psf_file[512];               /* "": none */
    double psf_oversampling;          /* of psf_file; 0: its keyword OVERSAMP */
} bst_camera_errors_config;

typedef struct bst_orbit_error_config {
    double position_rtn_m[3], velocity_rtn_mps[3];
    double along_track_drift_mps; /* growth of the position error from the epoch on */
} bst_orbit_error_config;

typedef struct bst_knowledge_config {
    char star_catalogue[512]; /* "": the world's */
    bst_star_errors_config stars;
    bst_camera_errors_config camera;
    double clock_offset_s; /* onboard time minus true time */
    bst_orbit_error_config orbit;
} bst_knowledge_config;

/* Where a sensor's detections come from: a rendered and processed image, or the generator that
 * stands in for both. */
enum { BST_OBSERVE_IMAGE, BST_OBSERVE_GENERATOR };

typedef struct bst_sensor_config {
    char name[64];
    char frame_updates_file[512]; /* path as above; "": none */
    bst_camera camera;
    double x_axis_gcrf[3];
    bst_exposure_config exposure;
    bst_cue_config cue;
    bst_knowledge_config knowledge;
    int32_t observation_source; /* BST_OBSERVE_... */
} bst_sensor_config;

typedef struct bst_observer_config {
    char name[64];
    bst_orbit_config orbit;
    bst_config_list burns;   /* bst_burn_config, by time */
    bst_config_list sensors; /* bst_sensor_config */
} bst_observer_config;

extern const bst_config_desc bst_initial_state_table[];
extern const bst_config_desc bst_force_table[];
extern const bst_config_desc bst_orbit_spacecraft_table[];
extern const bst_config_desc bst_object_config_table[];
extern const bst_config_desc bst_world_config_table[];
extern const bst_config_desc bst_observer_config_table[];
extern const bst_config_desc bst_sensor_config_table[];

struct bst_world;
struct bst_knowledge;

/* Makes the world. `observers` lists bst_observer_config; `base_dir` is the folder that relative
 * paths start from. `scenario` names the scenario file in messages. The configuration is copied. */
bst_status bst_world_create(bst_ctx *ctx, const char *scenario, const bst_world_config *world,
                            const bst_config_list *observers, const char *base_dir, bst_time epoch,
                            struct bst_world **out) BST_MUST_CHECK;
/* Checks that the files of states that observers and cued objects come from cover a run from the
 * epoch on (given frame by frame: but for 2.5 s at either end). BST_ERR_CONFIG with file, JSON path
 * and both spans. Other objects may come and go: they are not there outside their files.
 * A clock that is wrong shows other times: those are needed, too. */
bst_status bst_world_check_spans(bst_ctx *ctx, const char *scenario, const struct bst_world *world,
                                 double duration_s) BST_MUST_CHECK;
/* Frees a world; NULL is allowed. */
void bst_world_free(struct bst_world *world);

struct bst_psf_samples;

/* Gives a sensor whose camera has the PSF of a file (optics.psf BST_PSF_FILE) that PSF's samples,
 * before anything is made of the sensor. Errors of bst_psf_create_from. */
bst_status bst_world_set_psf(bst_ctx *ctx, struct bst_world *world, int observer, int sensor,
                             const struct bst_psf_samples *samples) BST_MUST_CHECK;

/* Before the first frame, and before the world is shared: lets the work on thousands of orbits be
 * done by `threads` threads (0: one per processor) and does what can be done ahead. Optional;
 * changes no value. */
bst_status bst_world_prepare(bst_ctx *ctx, struct bst_world *world, int threads) BST_MUST_CHECK;

/* The onboard knowledge of one sensor; equal to the truth where the scenario says nothing else. */
bst_status bst_knowledge_create(bst_ctx *ctx, const struct bst_world *world, int observer,
                                int sensor, struct bst_knowledge **out) BST_MUST_CHECK;
/* Frees onboard knowledge; NULL is allowed. */
void bst_knowledge_free(struct bst_knowledge *knowledge);

#endif
