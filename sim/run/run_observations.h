/* The directions that a run measured, as the onboard side has them: pixels of detections, attitude
 * from stars, the camera and the observer's orbit as they are known on board. No truth. */
#ifndef BST_RUN_RUN_OBSERVATIONS_H
#define BST_RUN_RUN_OBSERVATIONS_H

#include "sim/engine/scenario/scenario.h"
#include "sim/run/run_sensors.h"
#include "sim/world/world.h"
#include "tracker/orbit/orbit_fit.h"

/* A run's world, made again from its own scenario.json: observers as they believe to be. */
typedef struct bst_run_scene {
    const bst_run_reader *run; /* borrowed */
    struct bst_json *json;
    bst_scenario scenario;
    bst_world *world;
    bst_world_view *view;
    int64_t tick_rate_hz;
} bst_run_scene;

/* BST_ERR_FORMAT and others when the scenario, or a file that it names, cannot be read. To be
 * closed with bst_run_scene_close, also after an error. */
bst_status bst_run_scene_open(bst_ctx *ctx, const bst_run_reader *run,
                              bst_run_scene *out) BST_MUST_CHECK;
/* Frees the world, view and scenario of a scene; the struct itself belongs to the caller. */
void bst_run_scene_close(bst_run_scene *scene);
/* Indices of a sensor of the run's tables in the scenario. BST_ERR_FORMAT when it is not there. */
bst_status bst_run_scene_find(bst_ctx *ctx, const bst_run_scene *scene,
                              const bst_run_sensor *sensor, int *observer_index,
                              int *sensor_index) BST_MUST_CHECK;

typedef struct bst_run_observation {
    bst_time time; /* mid exposure */
    bst_od_observation od;
    double v_mag, snr; /* NAN: not known */
} bst_run_observation;

/* A track that was confirmed, or was the target of interest. */
typedef struct bst_run_track {
    const bst_run_sensor *sensor;
    int64_t id;
    bool target;       /* the tracker took it for its target at some time */
    double exposure_s; /* of its first frame; NAN: not known */
    const bst_run_observation *items;
    int64_t count;   /* at least 1 */
    int64_t skipped; /* frames with a detection but no attitude from stars */
} bst_run_track;

typedef bst_status (*bst_run_track_fn)(void *user, bst_ctx *ctx, const bst_run_track *track);

/* Calls `take` for each track of a sensor, by rising id; only track `id` when that is not 0. Items
 * are its frames with a detection. With `filtered` false a direction is the detection's place,
 * turned by the attitude that the stars of the same frame gave, aberration by the believed velocity
 * removed; its covariance is that of centroid and attitude: errors of different frames are
 * independent. Frames without such an attitude are left out. With `filtered` the tracker's own
 * state and its covariance, whose errors are correlated. BST_ERR_FORMAT when the run did not record
 * tracks or detections. */
bst_status bst_run_observations(bst_ctx *ctx, bst_run_scene *scene, const bst_run_sensor *sensor,
                                int64_t id, bool filtered, bst_run_track_fn take,
                                void *user) BST_MUST_CHECK;

/* "2022-06-16T22:10:00" of now, for CREATION_DATE. */
void bst_run_creation_date(char text[32]);

#endif
