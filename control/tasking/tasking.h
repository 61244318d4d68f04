/* Sensor tasking: assigns objects to sensors by priority, visibility and keep-out angles.
 *
 * Inputs are the onboard catalogue, the spacecraft's estimated positions, their mounts, and their
 * tracks. A target is due once the revisit time of its list line has passed since its last
 * observation. A free sensor takes, of all due targets that no other sensor has, the one with the
 * largest
 *
 *   priority * min(time since observation / revisit time, 4) / (slew + settling + frame time)
 *
 * that it can see from its arrival until the frames are taken. A line with sigma_m is due by
 * uncertainty: if the standard deviation of the place along the orbit exceeds sigma_m too, and the
 * urgency is the former over the latter. */
#ifndef BST_CONTROL_TASKING_TASKING_H
#define BST_CONTROL_TASKING_TASKING_H

#include "boresight/archive.h"
#include "boresight/config.h"
#include "boresight/module.h"
#include "control/guidance/keep_out.h"
#include "sim/core/arena.h"
#include "sim/onboard/knowledge.h"

/* A line of the target list: a named object, or all objects with apsides within bounds. */
typedef struct bst_tasking_line {
    char object[64];                    /* "": by orbit */
    double perigee_km[2], apogee_km[2]; /* altitudes over the equatorial radius */
    double priority;
    double revisit_s;
    double sigma_m; /* wanted standard deviation of the place along the orbit; 0: any */
    int64_t frames;
} bst_tasking_line;

typedef struct bst_tasking_config {
    bst_config_list targets; /* bst_tasking_line; the first match applies to an object */
    double sun_keep_out_deg, moon_keep_out_deg, earth_limb_keep_out_deg, earth_limb_altitude_km;
    double min_snr, max_rate_arcsec_per_s;
    double slew_rate_deg_per_s, settle_s;
    double find_timeout_s, retry_s, replan_interval_s;
    double sigma_deg, rate_sigma_arcsec_per_s, v_mag_sigma;
    double catalogue_sigma_m, catalogue_drift_m_per_day, catalogue_noise_m_per_day;
    double report_every_s;
} bst_tasking_config;

extern const bst_config_desc bst_tasking_config_table[];

/* Reason why an object cannot be observed; the first in this order. */
typedef enum bst_tasking_why {
    BST_WHY_NOT = 0, /* it can be observed */
    BST_WHY_NO_ORBIT,
    BST_WHY_ITSELF,
    BST_WHY_EARTH, /* occulted by the Earth, or too near its limb */
    BST_WHY_SUN,
    BST_WHY_MOON,
    BST_WHY_SHADOW,
    BST_WHY_FAINT,
    BST_WHY_RATE,  /* apparent rate too high */
    BST_WHY_MOUNT, /* the mount cannot follow it there */
    BST_WHY_COUNT
} bst_tasking_why;

/* Reason in words: "behind the Earth or near its limb" for BST_WHY_EARTH, and so on. */
const char *bst_tasking_reason(int why);

/* State of a sensor in the tasking. */
typedef struct bst_tasking_sensor {
    const bst_knowledge *knowledge;
    bst_knowledge_view *view;
    double exposure_s, period_s;
    /* noise_e: of a pixel; pixels: noise-equivalent area of a point source, px */
    double noise_e, pixels;
    bool nav_known, mount_known;
    bst_nav_telemetry nav;
    bst_mount_status mount;
    bst_keep_out_zone zones[BST_ZONE_KINDS]; /* at the latest navigation message */
    double zone_cosines[BST_ZONE_KINDS];
    int zone_count;
    /* current task */
    bst_task task; /* as published; object -1: the sensor's own cue */
    bool pointed;
    bst_vec3 direction;            /* of the last target, at its assignment */
    double given_s, arrival_s;     /* time of assignment; predicted time of arrival */
    int64_t frames, frames_wanted; /* frames with a detection */
    double last_seen_s, next_plan_s;
    bst_vec3 seen_direction; /* of the target's track at last_seen_s, and its covariance */
    double seen_covariance[2][2];
    int64_t quiet_until; /* lookahead: tick before which the task does not change */
} bst_tasking_sensor;

/* Covariance of an object's displacement along its orbit, which at t days is A + t D. */
typedef struct bst_tasking_along {
    double aa, ad, dd; /* m^2, m^2/day, m^2/day^2 */
    double until_days; /* process noise is in it until this time */
} bst_tasking_along;

typedef struct bst_tasking_choice {
    int object;
    double value, slew_s;
} bst_tasking_choice;

typedef struct bst_tasking {
    bst_arena arena; /* of all arrays below */
    bst_tasking_config config;
    double tick_rate_hz;
    bst_tasking_sensor *sensors;
    int sensor_count;
    int object_count;
    int16_t *line;            /* [object] of config.targets, -1: none */
    bst_tasking_along *along; /* [object] */
    double *seen_s;           /* [object] time of the latest sighting; below 0: none */
    int *holder;              /* [object] index of the sensor whose task it is, -1: none */
    float *not_before;        /* [sensor][object] s: earliest time of the next attempt */
    double places_s;          /* time of place_m; NAN: none */
    double *place_m[3];       /* [object] */
    double next_report_s;
} bst_tasking;

/* Number of targets that sensors can see, and the reasons for the others. */
typedef struct bst_tasking_report {
    int targets, seen, visible; /* in the list; observed so far; currently visible to some sensor */
    /* of the others: number by reason, of the sensor nearest to visibility */
    int why[BST_WHY_COUNT];
} bst_tasking_report;

/* Initialises the tasking.
 *
 * Given:     members  as in bst_module_env; must outlive the tasking
 * Errors:    BST_ERR_CONFIG for a line that matches no object
 * Ownership: call bst_tasking_free in any case */
bst_status bst_tasking_init(bst_ctx *ctx, bst_tasking *tasking, const bst_tasking_config *config,
                            const bst_fleet_member *members, int member_count,
                            double tick_rate_hz) BST_MUST_CHECK;
/* Frees the memory of the tasking and clears the struct, which belongs to the caller. */
void bst_tasking_free(bst_tasking *tasking);

/* Saves or restores the tasks and observations of all sensors, for bst_module_desc.archive.
 *
 * Errors:    BST_ERR_FORMAT for a task on an object that does not exist, or a damaged mount */
bst_status bst_tasking_archive(bst_tasking *tasking, bst_archive *archive) BST_MUST_CHECK;

/* Updates navigation and mount of a sensor; NULL: no new message. */
void bst_tasking_telemetry(bst_tasking *tasking, int sensor, const bst_nav_telemetry *nav,
                           const bst_mount_status *mount);
/* Updates a sensor's observations from the tracks of a frame. */
void bst_tasking_tracks(bst_tasking *tasking, int sensor, const bst_tracks *tracks);

/* Ends the task of a sensor if it is due, and gives it the next one.
 *
 * Given:     sensor  index of the sensor
 *            tick    now
 * Returned:  *given  true if the task has changed
 * Errors:    those of the onboard knowledge */
bst_status bst_tasking_plan(bst_ctx *ctx, bst_tasking *tasking, int sensor, int64_t tick,
                            bool *given) BST_MUST_CHECK;

/* Lookahead of a sensor: tick before which its task will not change, for any messages until then.
 */
int64_t bst_tasking_quiet_until(const bst_tasking *tasking, int sensor);

/* Visibility of an object from a sensor at a time. */
typedef struct bst_tasking_visibility {
    bst_tasking_why why;   /* BST_WHY_NOT: it can be seen; or the first reason why not */
    bst_world_sight sight; /* as far as it was computed */
    double snr;            /* of a frame, as far as it was computed */
} bst_tasking_visibility;

/* Computes the visibility of an object from a sensor by the onboard knowledge.
 *
 * Given:     seconds  since the epoch
 * Errors:    those of the onboard knowledge */
bst_status bst_tasking_look(bst_ctx *ctx, const bst_tasking *tasking, int sensor, int object,
                            double seconds, bst_tasking_visibility *out) BST_MUST_CHECK;

/* Checks the visibility of all targets of the list from all sensors. */
bst_status bst_tasking_survey(bst_ctx *ctx, bst_tasking *tasking, double seconds,
                              bst_tasking_report *out) BST_MUST_CHECK;

#endif
