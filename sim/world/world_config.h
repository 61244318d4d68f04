/* Configuration structs of the world: orbits, objects, cues, cameras and exposures of a
 * scenario. */
#ifndef BST_WORLD_WORLD_CONFIG_H
#define BST_WORLD_WORLD_CONFIG_H

#include "boresight/camera.h"
#include "boresight/config.h"
#include "boresight/messages.h"
#include "sim/astro/time.h"
#include "sim/catalogue/stars.h"
#include "sim/onboard/region.h"
#include "sim/satellite/body_attitude.h"
#include "sim/satellite/satellite_config.h"
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
    double semi_major_axis_m, perigee_radius_m; /* NAN: not given; at least one is required */
    double eccentricity;
    double inclination_deg, raan_deg, arg_perigee_deg;
    double true_anomaly_deg, mean_anomaly_deg; /* NAN: not given */
} bst_initial_state_config;

/* Completes Keplerian elements: semi-major axis and perigee radius, true and mean anomaly. Without
 * anomaly: at perigee. Of two consistent values, perigee radius and true anomaly count.
 * BST_ERR_CONFIG (keys without path): impossible elements, or a contradiction above 1e-6 of the
 * radius or 1e-6 degree. */
bst_status bst_keplerian_resolve(bst_ctx *ctx, bst_initial_state_config *state) BST_MUST_CHECK;

typedef struct bst_force_config {
    char gravity[512]; /* "builtin", "two_body", "j6" or a path as below */
    int64_t degree, order;
    bool sun, moon, solar_pressure, drag;
    bool shape; /* pressure and drag on the object's shape */
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
    char reference[64]; /* relative: name of an earlier object with its own orbit */
    double at_s;        /* relative: time of offset_rtn_m */
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
    double duration_s; /* 0: impulsive */
    double dv_rtn_mps[3];
} bst_burn_config;

typedef struct bst_object_config {
    char name[64];
    bst_orbit_config orbit;
    double area_m2, albedo;
    bst_brightness_config brightness;
    bst_config_list burns; /* bst_burn_config, sorted by time */
    bool external_states;
    bool occults;
    bst_satellite_config shape;
    bst_config_list attitude; /* bst_attitude_config, sorted by time */
} bst_object_config;

typedef struct bst_catalogue_config {
    char elements_file[512]; /* path as above */
    double area_m2, albedo;  /* of every object */
    bst_brightness_config brightness;
} bst_catalogue_config;

/* A Walker constellation; each satellite becomes an object (constellation.h). */
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
    double faint_limit_v_mag; /* magnitude limit of single statistical stars, V */
    uint64_t faint_seed;
    char earth_orientation[512]; /* "builtin" or a path as above */
    bool shadow_atmosphere; /* the atmosphere refracts, reddens and weakens light at the edge of the
                               shadow */
    bst_config_list objects;        /* bst_object_config */
    bst_config_list catalogues;     /* bst_catalogue_config */
    bst_config_list constellations; /* bst_constellation_config */
    /* not in the table: an open star_catalogue that outlives the world; NULL: the world opens it */
    const struct bst_stars *opened_stars;
} bst_world_config;

/* A region of the sky that contains the target, as an alternative to a cue to one direction. */
typedef struct bst_region_config {
    int32_t kind;            /* BST_REGION_... */
    double arc_radec_deg[4]; /* of both ends */
    double longitude_deg[2]; /* geostationary: from, to, east longitude */
    double half_width_deg;
} bst_region_config;

typedef struct bst_cue_config {
    char object[64];               /* "" : no cue */
    double direction_radec_deg[2]; /* used when there is no object */
    double offset_deg;
    int32_t offset_axis;     /* index into {"x", "-x", "y", "-y"} */
    double offset_angle_deg; /* about the offset axis, from image x towards image y */
    bst_region_config region;
    double sigma_deg, rate_sigma_arcsec_per_s;
    double v_mag, v_mag_sigma;
} bst_cue_config;

typedef struct bst_exposure_config {
    double exposure_s, period_s, first_s;
    double dropped_fraction;
    double dropped_burst_frames; /* mean length of a burst of lost frames; 0: independent losses */
    int64_t binning;             /* sensor pixels per side of a binned pixel */
    double window_px[4]; /* x0, y0, width, height of the readout window; width 0: full sensor */
} bst_exposure_config;

/* Default readout window of a sensor of width_px x height_px. BST_ERR_CONFIG: it is not within the
 * sensor. */
bst_status bst_exposure_window(bst_ctx *ctx, const bst_exposure_config *config, int64_t width_px,
                               int64_t height_px, bst_window *out) BST_MUST_CHECK;

/* Errors of the onboard camera model. */
typedef struct bst_camera_errors_config {
    double scale_error_ppm;
    double rotation_error_deg;
    bool override_distortion;         /* false: the onboard model has the true coefficients */
    bst_camera_distortion distortion; /* with override_distortion: the onboard coefficients */
    double throughput_error;          /* onboard over true, minus 1 */
    double psf_fwhm_px;               /* 0: the camera's */
    char psf_file[512];               /* "": none */
    double psf_oversampling;          /* of psf_file; 0: its keyword OVERSAMP */
} bst_camera_errors_config;

typedef struct bst_orbit_error_config {
    double position_rtn_m[3], velocity_rtn_mps[3];
    double along_track_drift_mps; /* rate of the position error after the epoch */
} bst_orbit_error_config;

typedef struct bst_knowledge_config {
    char star_catalogue[512]; /* "": the world's */
    bst_star_errors_config stars;
    bst_camera_errors_config camera;
    double clock_offset_s; /* onboard time minus true time */
    bst_orbit_error_config orbit;
} bst_knowledge_config;

/* Source of a sensor's detections: rendered and processed images, or the observation generator. */
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
    /* set by bst_scenario_read, not by the table: the camera's numbers as the scenario gives them,
     * before ensquared_energy and zero_point_mag replace them; NAN: not given */
    double given_psf_fwhm_px, given_throughput, given_flux_v0;
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

/* Creates the world. `observers`: list of bst_observer_config; `base_dir`: base of relative paths;
 * `scenario`: file name for messages. The configuration is copied. */
bst_status bst_world_create(bst_ctx *ctx, const char *scenario, const bst_world_config *world,
                            const bst_config_list *observers, const char *base_dir, bst_time epoch,
                            struct bst_world **out) BST_MUST_CHECK;
/* Checks that state files of observers and cued objects cover a run; states per frame may lack 2.5
 * s at either end. BST_ERR_CONFIG with file, JSON path and both time spans. Other objects exist
 * only within their files. With a clock error the times of the onboard clock must be covered
 * too. */
bst_status bst_world_check_spans(bst_ctx *ctx, const char *scenario, const struct bst_world *world,
                                 double duration_s) BST_MUST_CHECK;
/* Frees a world; NULL is allowed. */
void bst_world_free(struct bst_world *world);

struct bst_psf_samples;

/* Sets the PSF samples of a sensor whose PSF comes from a file (optics.psf BST_PSF_FILE), before
 * other data depend on the sensor. Errors of bst_psf_create_from. */
bst_status bst_world_set_psf(bst_ctx *ctx, struct bst_world *world, int observer, int sensor,
                             const struct bst_psf_samples *samples) BST_MUST_CHECK;
/* Sets the map of stray light of a sensor whose background names a file (stray_map_file), before
 * other data depend on the sensor. pixels: as of bst_stray_map_create, with its errors. */
bst_status bst_world_set_stray_map(bst_ctx *ctx, struct bst_world *world, int observer, int sensor,
                                   int width, int height, float *pixels) BST_MUST_CHECK;

/* Optional, before the first frame: starts `threads` threads (0: one per processor) for large
 * numbers of orbits and precomputes ephemerides. The results do not change. Not while other threads
 * use the world. */
bst_status bst_world_prepare(bst_ctx *ctx, struct bst_world *world, int threads) BST_MUST_CHECK;

/* Creates the onboard knowledge of one sensor: equal to the truth except for errors in the
 * scenario. */
bst_status bst_knowledge_create(bst_ctx *ctx, const struct bst_world *world, int observer,
                                int sensor, struct bst_knowledge **out) BST_MUST_CHECK;
/* Frees onboard knowledge; NULL is allowed. */
void bst_knowledge_free(struct bst_knowledge *knowledge);

#endif
