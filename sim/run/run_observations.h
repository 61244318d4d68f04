/* Measured directions of a recorded run from onboard data: detections, stellar attitude, onboard
 * camera model and observer orbit. Without truth. */
#ifndef BST_RUN_RUN_OBSERVATIONS_H
#define BST_RUN_RUN_OBSERVATIONS_H

#include "sim/engine/scenario/scenario.h"
#include "sim/run/run_sensors.h"
#include "sim/world/world.h"
#include "tracker/orbit/orbit_fit.h"

/* Reads the scenario of a recorded run after all of its changes.
 *
 * Errors:    BST_ERR_FORMAT and others: it cannot be read
 * Notes:     a burn that was added is in the scenario with its time. Another orbit holds for
 * earlier times too, which a warning says Ownership: free both results, also after an error; *json
 * outlives *out */
bst_status bst_run_recorded_scenario(bst_ctx *ctx, const bst_run_reader *run,
                                     struct bst_json **json, bst_scenario *out) BST_MUST_CHECK;

/* World of a recorded run, recomputed from its scenario.json with all changes. */
typedef struct bst_run_scene {
    const bst_run_reader *run; /* borrowed; NULL: closed */
    struct bst_json *json;
    bst_scenario scenario;
    bst_world *world;
    bst_world_view *view;
    int64_t tick_rate_hz;
} bst_run_scene;

/* Creates the world of a recorded run. BST_ERR_FORMAT and others: the scenario or one of its files
 * cannot be read. Close it with bst_run_scene_close, also after an error. */
bst_status bst_run_scene_open(bst_ctx *ctx, const bst_run_reader *run,
                              bst_run_scene *out) BST_MUST_CHECK;
/* Frees the world, view and scenario of a scene; the struct itself belongs to the caller. */
void bst_run_scene_close(bst_run_scene *scene);
/* Indices in the scenario of a sensor of the run's tables. BST_ERR_FORMAT: not found. */
bst_status bst_run_scene_find(bst_ctx *ctx, const bst_run_scene *scene,
                              const bst_run_sensor *sensor, int *observer_index,
                              int *sensor_index) BST_MUST_CHECK;

typedef struct bst_run_observation {
    bst_time time; /* mid-exposure */
    bst_od_observation od;
    double v_mag, snr; /* NAN: unknown */
} bst_run_observation;

/* A track that was confirmed or was the target of interest. */
typedef struct bst_run_track {
    const bst_run_sensor *sensor;
    int64_t id;
    bool target;       /* the tracker selected it as target at some time */
    double exposure_s; /* of its first frame; NAN: unknown */
    const bst_run_observation *items;
    int64_t count;   /* at least 1 */
    int64_t skipped; /* frames with a detection but without stellar attitude */
} bst_run_track;

typedef bst_status (*bst_run_track_fn)(void *user, bst_ctx *ctx, const bst_run_track *track);

/* Calls `take` for each track of a sensor, by ascending id; id not 0: only this track. Items are
 * frames with a detection.
 *
 * Notes:     filtered false: direction of the detection by the stellar attitude of the
 *            same frame, aberration removed with the onboard velocity; covariance of centroid and
 *            attitude, independent between frames. Frames without such an attitude are skipped.
 *            filtered true: direction and covariance of the tracker's state; errors are correlated.
 * Errors:    BST_ERR_FORMAT: tracks or detections were not recorded */
bst_status bst_run_observations(bst_ctx *ctx, bst_run_scene *scene, const bst_run_sensor *sensor,
                                int64_t id, bool filtered, bst_run_track_fn take,
                                void *user) BST_MUST_CHECK;

/* Current time as "2022-06-16T22:10:00", for CREATION_DATE. */
void bst_run_creation_date(char text[32]);

#endif
