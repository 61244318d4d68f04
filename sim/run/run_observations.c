#include "sim/run/run_observations.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "sim/astro/bodies.h"
#include "sim/cli/plugins.h"
#include "sim/onboard/knowledge.h"
#include "sim/run/run_directions.h"
#include "tracker/orbit/orbit_photocentre.h"

void bst_run_creation_date(char text[32]) {
    time_t now = time(NULL);
    struct tm utc = {0};
    gmtime_r(&now, &utc);
    strftime(text, 32, "%Y-%m-%dT%H:%M:%S", &utc);
}

/* Makes the changes of a recorded scenario in its text. */
static bst_status make_changes(bst_ctx *ctx, bst_json *json, const bst_scenario *scenario) {
    const bst_scenario_change *changes = scenario->changes.items;
    for (int i = 0; i < scenario->changes.count; i++) {
        if (bst_json_set(ctx, json, changes[i].set) != BST_OK) {
            return bst_fail_prefix(ctx, BST_ERR_FORMAT, "/changes/%d", i);
        }
        if (strstr(changes[i].set, "orbit") || strstr(changes[i].set, "external_states")) {
            bst_log(ctx, BST_LOG_WARNING,
                    "%s: /changes/%d gives another orbit at %g s; that orbit is used for earlier "
                    "times too",
                    scenario->file, i, changes[i].time_s);
        }
    }
    return BST_OK;
}

bst_status bst_run_recorded_scenario(bst_ctx *ctx, const bst_run_reader *run, bst_json **json,
                                     bst_scenario *out) {
    char path[4096];
    *json = NULL;
    *out = (bst_scenario){.format = 0};
    BST_TRY(bst_run_reader_file(ctx, run, "scenario.json", path, sizeof path));
    BST_TRY(bst_json_load(ctx, path, json));
    BST_TRY(bst_plugins_recorded_read(ctx, *json, out));
    if (out->changes.count > 0) {
        BST_TRY(make_changes(ctx, *json, out));
        bst_scenario_free(out);
        BST_TRY(bst_plugins_recorded_read(ctx, *json, out));
    }
    return BST_OK;
}

bst_status bst_run_scene_open(bst_ctx *ctx, const bst_run_reader *run, bst_run_scene *out) {
    *out = (bst_run_scene){.run = run};
    BST_TRY(bst_run_recorded_scenario(ctx, run, &out->json, &out->scenario));
    /* directions do not need stars */
    bst_world_config config = out->scenario.world;
    config.faint_stars = BST_FAINT_NONE;
    snprintf(config.star_catalogue, sizeof config.star_catalogue, "embedded");
    out->tick_rate_hz = out->scenario.tick_rate_hz;
    BST_TRY(bst_world_create(ctx, out->scenario.file, &config, &out->scenario.observers,
                             out->scenario.base_dir, out->scenario.epoch, &out->world));
    return bst_world_view_create(ctx, out->world, &out->view);
}

void bst_run_scene_close(bst_run_scene *scene) {
    bst_world_view_free(scene->view);
    bst_world_free(scene->world);
    if (scene->json) {
        bst_scenario_free(&scene->scenario);
        bst_json_free(scene->json);
    }
}

bst_status bst_run_scene_find(bst_ctx *ctx, const bst_run_scene *scene,
                              const bst_run_sensor *sensor, int *observer_index,
                              int *sensor_index) {
    const bst_observer_config *observers = scene->scenario.observers.items;
    for (int i = 0; i < scene->scenario.observers.count; i++) {
        const bst_sensor_config *sensors = observers[i].sensors.items;
        for (int k = 0; k < observers[i].sensors.count; k++) {
            if (strcmp(observers[i].name, sensor->observer) == 0 &&
                strcmp(sensors[k].name, sensor->name) == 0) {
                *observer_index = i;
                *sensor_index = k;
                return BST_OK;
            }
        }
    }
    return bst_fail(ctx, BST_ERR_FORMAT, "%s: scenario.json has no sensor %s/%s",
                    scene->run ? bst_run_reader_folder(scene->run) : scene->scenario.file,
                    sensor->observer, sensor->name);
}

#define CORRELATIONS \
    " f.attitude_correlation_xy, f.attitude_correlation_xz, f.attitude_correlation_yz,"
#define QUERY(correlations)                                                                       \
    "SELECT t.track_id, t.tick, t.target_of_interest, t.ra_deg, t.dec_deg, t.v_mag, t.snr,"       \
    " t.cov_d1_d1_rad2, t.cov_d1_d2_rad2, t.cov_d2_d2_rad2, f.attitude_valid,"                    \
    " f.attitude_q_cam_from_gcrf_x, f.attitude_q_cam_from_gcrf_y, f.attitude_q_cam_from_gcrf_z,"  \
    " f.attitude_q_cam_from_gcrf_w, f.attitude_sigma_x_arcsec, f.attitude_sigma_y_arcsec,"        \
    " f.attitude_sigma_z_arcsec," correlations                                                    \
    " f.attitude_shared, t.x_px, t.y_px,"                                                         \
    " d.cov_xx_px2, d.cov_xy_px2, d.cov_yy_px2, g.end_tick - g.start_tick"                        \
    " FROM tracks t JOIN track_frames f ON f.sensor = t.sensor AND f.exposure_id = t.exposure_id" \
    " LEFT JOIN detections d ON d.sensor = t.sensor AND d.exposure_id = t.exposure_id"            \
    " AND d.x_px = t.x_px AND d.y_px = t.y_px"                                                    \
    " LEFT JOIN detection_frames g ON g.sensor = t.sensor AND g.exposure_id = t.exposure_id"      \
    " WHERE t.sensor = ?1 AND t.misses_in_row = 0 AND (?2 = 0 OR t.track_id = ?2)"                \
    " AND t.track_id IN (SELECT track_id FROM tracks WHERE sensor = ?1"                           \
    " AND (status = 'confirmed' OR target_of_interest = 1))"                                      \
    " ORDER BY t.track_id, t.tick"

enum {
    ID,
    TICK,
    TARGET,
    RA,
    DEC,
    V_MAG,
    SNR,
    COV_D,
    VALID = COV_D + 3,
    ATTITUDE,
    SIGMA = ATTITUDE + 4,
    CORRELATION = SIGMA + 3,
    SHARED = CORRELATION + 3,
    X_PX,
    Y_PX,
    COV_PX,
    EXPOSURE = COV_PX + 3
};

typedef struct gathering {
    bst_run_scene *scene;
    const bst_camera *camera;
    int observer, sensor_index;
    bool filtered;
    bst_run_track track;
    bst_run_observation *items;
    int64_t capacity;
    bst_quat attitude; /* of the latest observation */
    double share;      /* common fraction of the attitude variance of consecutive frames, latest */
} gathering;

/* Attitude from stars of a row. */
static bst_attitude_fix attitude_of(const bst_io_rows *rows) {
    return (bst_attitude_fix){
        .valid = true,
        .q_cam_from_gcrf = {bst_io_rows_real(rows, ATTITUDE), bst_io_rows_real(rows, ATTITUDE + 1),
                            bst_io_rows_real(rows, ATTITUDE + 2),
                            bst_io_rows_real(rows, ATTITUDE + 3)},
        .sigma_rad = {bst_io_rows_real(rows, SIGMA) * BST_ARCSEC_RAD,
                      bst_io_rows_real(rows, SIGMA + 1) * BST_ARCSEC_RAD,
                      bst_io_rows_real(rows, SIGMA + 2) * BST_ARCSEC_RAD},
        .correlation = {bst_io_rows_real(rows, CORRELATION),
                        bst_io_rows_real(rows, CORRELATION + 1),
                        bst_io_rows_real(rows, CORRELATION + 2)},
        .shared = bst_io_rows_real(rows, SHARED)};
}

/* Sets the measured direction of a detection. */
static void measure(gathering *g, const bst_io_rows *rows, const bst_light *light,
                    bst_od_observation *out) {
    const bst_attitude_fix attitude = attitude_of(rows);
    const double cov_px2[3] = {bst_io_rows_real(rows, COV_PX), bst_io_rows_real(rows, COV_PX + 1),
                               bst_io_rows_real(rows, COV_PX + 2)};
    bst_run_measure_direction(g->camera, bst_io_rows_real(rows, X_PX), bst_io_rows_real(rows, Y_PX),
                              cov_px2, &attitude, light, out);
    if (g->track.count > 1) {
        out->shared_change =
            bst_run_change_of_stars(g->camera, g->attitude, attitude.q_cam_from_gcrf);
    }
    g->attitude = attitude.q_cam_from_gcrf;
    g->share = attitude.shared;
}

/* Sets the common part of the attitude errors, as estimated by the last frame. */
static void set_shared(gathering *g) {
    for (int64_t i = 0; i < g->track.count && !g->filtered; i++) {
        for (int k = 0; k < 4; k++) {
            g->items[i].od.shared_rad[k / 2][k % 2] *= sqrt(g->share);
        }
    }
}

static bst_status add(bst_ctx *ctx, gathering *g, const bst_io_rows *rows) {
    if (!g->filtered && (bst_io_rows_int(rows, VALID) == 0 || bst_io_rows_is_null(rows, COV_PX))) {
        g->track.skipped++;
        return BST_OK;
    }
    if (g->track.count == g->capacity) {
        int64_t capacity = g->capacity ? 2 * g->capacity : 1024;
        bst_run_observation *items = realloc(g->items, (size_t)capacity * sizeof *items);
        if (!items) {
            return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a track's observations");
        }
        g->items = items;
        g->capacity = capacity;
    }
    int64_t tick = bst_io_rows_int(rows, TICK);
    double seconds = (double)tick / (double)g->scene->tick_rate_hz;
    bst_world_state eye;
    bst_bodies bodies;
    BST_TRY(bst_world_view_nav(ctx, g->scene->view, g->observer, g->sensor_index, seconds, &eye,
                               &bodies));
    bst_run_observation *o = &g->items[g->track.count++];
    *o = (bst_run_observation){
        .time = bst_time_at_tick(g->scene->scenario.epoch, tick, g->scene->tick_rate_hz),
        .v_mag = bst_io_rows_is_null(rows, V_MAG) ? NAN : bst_io_rows_real(rows, V_MAG),
        .snr = bst_io_rows_is_null(rows, SNR) ? NAN : bst_io_rows_real(rows, SNR),
        .od.observer = {.time_s = seconds,
                        .position_m = eye.position_m,
                        .velocity_mps = eye.velocity_mps,
                        .earth_bary_mps = bodies.earth_bary_mps}};
    if (g->filtered) {
        o->od.direction = bst_vec3_from_radec(bst_io_rows_real(rows, RA) * BST_DEG_RAD,
                                              bst_io_rows_real(rows, DEC) * BST_DEG_RAD);
        o->od.cov_11 = bst_io_rows_real(rows, COV_D);
        o->od.cov_12 = bst_io_rows_real(rows, COV_D + 1);
        o->od.cov_22 = bst_io_rows_real(rows, COV_D + 2);
    } else {
        bst_light light = bst_light_at(&bodies, eye.position_m, eye.velocity_mps);
        measure(g, rows, &light, &o->od);
    }
    o->od.sun = bst_vec3_unit(bodies.sun_m);
    o->od.photocentre_factor = bst_od_photocentre_factor_seen(o->od.sun, o->od.direction);
    g->track.target = g->track.target || bst_io_rows_int(rows, TARGET) != 0;
    if (g->track.count == 1) {
        g->track.exposure_s =
            bst_io_rows_is_null(rows, EXPOSURE)
                ? NAN
                : bst_io_rows_real(rows, EXPOSURE) / (double)g->scene->tick_rate_hz;
    }
    return BST_OK;
}

/* Passes a finished track of observations to the callback. */
static bst_status hand_over(bst_ctx *ctx, gathering *g, bst_run_track_fn take, void *user) {
    g->track.items = g->items;
    set_shared(g);
    bst_status status = g->track.count > 0 ? take(user, ctx, &g->track) : BST_OK;
    g->track = (bst_run_track){.sensor = g->track.sensor};
    return status;
}

bst_status bst_run_observations(bst_ctx *ctx, bst_run_scene *scene, const bst_run_sensor *sensor,
                                int64_t id, bool filtered, bst_run_track_fn take, void *user) {
    gathering g = {.scene = scene, .filtered = filtered, .track.sensor = sensor};
    bst_knowledge *knowledge = NULL;
    bst_io_rows *rows;
    bool more;
    BST_TRY(bst_run_scene_find(ctx, scene, sensor, &g.observer, &g.sensor_index));
    /* runs recorded before the attitude had correlations */
    const bool correlated = bst_run_reader_int(scene->run,
                                               "SELECT 1 FROM pragma_table_info('track_frames')"
                                               " WHERE name = 'attitude_correlation_xy'",
                                               0, 0) == 1;
    BST_TRY(bst_io_rows_open(ctx, scene->run, correlated ? QUERY(CORRELATIONS) : QUERY(" 0, 0, 0,"),
                             sensor->index, id, &rows));
    bst_status status =
        bst_knowledge_create(ctx, scene->world, g.observer, g.sensor_index, &knowledge);
    g.camera = status == BST_OK ? bst_knowledge_camera(knowledge) : NULL;
    while (status == BST_OK && (status = bst_io_rows_next(ctx, rows, &more)) == BST_OK && more) {
        int64_t now = bst_io_rows_int(rows, ID);
        if (now != g.track.id) {
            status = hand_over(ctx, &g, take, user);
            g.track.id = now;
        }
        status = status == BST_OK ? add(ctx, &g, rows) : status;
    }
    bst_io_rows_close(rows);
    status = status == BST_OK ? hand_over(ctx, &g, take, user) : status;
    free(g.items);
    bst_knowledge_free(knowledge);
    return status;
}
