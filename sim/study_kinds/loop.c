/* Study kind "loop": a run is a simulation with the evaluation of `boresight run`. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <cjson/cJSON.h>

#include "sim/cli/plugins.h"
#include "sim/cli/stop_signals.h"
#include "sim/device/device.h"
#include "sim/run/run_scenario.h"
#include "sim/study_kinds/study_kinds.h"
#include "sim/study_kinds/study_plugins.h"

/* ------------------------------------------------------------------ shared with other kinds */

bst_status bst_study_check_scenario(bst_ctx *ctx, void *user, const bst_study_run *run, bool deep) {
    bst_scenario scenario;
    bst_status status = bst_plugins_scenario_read(ctx, run->scenario, &scenario);
    if (status == BST_OK && user) {
        status = bst_study_plugins_take(ctx, user, &scenario);
    }
    if (status == BST_OK && deep) {
        bst_world *world = NULL;
        status = bst_world_create(ctx, scenario.file, &scenario.world, &scenario.observers,
                                  scenario.base_dir, scenario.epoch, &world);
        if (status == BST_OK) {
            status = bst_world_check_spans(ctx, scenario.file, world, scenario.duration_s);
        }
        bst_world_free(world);
    }
    bst_scenario_free(&scenario);
    return status;
}

bst_status bst_study_warm_open(bst_ctx *ctx, void *user, const bst_study_worker_place *place,
                               void **worker) {
    (void)user;
    bst_study_warm *warm = calloc(1, sizeof *warm);
    if (!warm) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a worker");
    }
    warm->threads = place->threads;
    snprintf(warm->selector, sizeof warm->selector, "%s", place->device);
    *worker = warm;
    return BST_OK;
}

void bst_study_warm_close(void *worker) {
    bst_study_warm *warm = worker;
    bst_device_close(warm->device);
    bst_stars_close(warm->stars);
    free(warm);
}

bool bst_study_stop_requested(void *user) {
    (void)user;
    return bst_stop_requested();
}

/* True if a module of the scenario needs an OpenCL device. */
static bool needs_device(const bst_scenario *scenario) {
    for (int m = 0; m < scenario->module_count; m++) {
        if (!scenario->modules[m].off &&
            (scenario->modules[m].desc->flags & BST_MODULE_NEEDS_DEVICE)) {
            return true;
        }
    }
    return false;
}

bst_status bst_study_warm_device(bst_ctx *ctx, bst_study_warm *warm) {
    if (warm->device) {
        return BST_OK;
    }
    bst_status status = bst_device_open(ctx, warm->selector, 0, &warm->device);
    /* not an error of the run: a worker without device can execute none */
    return status == BST_ERR_NOT_FOUND ? bst_fail_prefix(ctx, BST_ERR_DEVICE, "--device") : status;
}

void bst_study_warm_stars(bst_study_warm *warm, bst_scenario *scenario) {
    bst_ctx quiet = {0};
    const char *name = scenario->world.star_catalogue;
    if (!warm->stars || strcmp(name, warm->catalogue) != 0) {
        bst_stars_close(warm->stars);
        warm->stars = NULL;
        snprintf(warm->catalogue, sizeof warm->catalogue, "%s", name);
        /* the creation of the world reports the error */
        bst_status status = bst_stars_open(&quiet, name, &warm->stars);
        (void)status;
    }
    scenario->world.opened_stars = warm->stars;
}

bst_status bst_study_simulation(bst_ctx *ctx, bst_study_warm *warm, bst_scenario *scenario,
                                bst_simulation **out) {
    *out = NULL;
    bst_study_warm_stars(warm, scenario);
    if (needs_device(scenario)) {
        BST_TRY(bst_study_warm_device(ctx, warm));
    }
    const bst_simulation_options options = {.threads = warm->threads, .opened = warm->device};
    return bst_simulation_create(ctx, scenario, &options, out);
}

bst_status bst_study_print_scenario(bst_ctx *ctx, const bst_scenario *scenario, FILE *stream) {
    cJSON *echo = bst_scenario_echo(scenario);
    char *text = echo ? cJSON_Print(echo) : NULL;
    cJSON_Delete(echo);
    if (!text) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the scenario");
    }
    bool ok = fprintf(stream, "%s\n", text) > 0 && fflush(stream) == 0;
    free(text);
    return ok ? BST_OK : bst_fail(ctx, BST_ERR_IO, "the scenario cannot be written");
}

/* ------------------------------------------------------------------ the kind */

enum {
    FRAMES,
    VISIBLE_FRAMES,
    ACQUIRED,
    TIME_TO_CONFIRM,
    TIME_TO_ACQUIRE,
    TIME_TO_SETTLE,
    CUSTODY,
    TRACK_FRACTION,
    IN_TRACK_AT_END,
    BREAKS,
    WRONG_TARGET_FRAMES,
    DETECTIONS,
    DETECTED_FRACTION,
    POINTING_RMS,
    POINTING_MEDIAN,
    POINTING_P99,
    POINTING_BIAS,
    TRACK_RMS,
    TRACK_MEDIAN,
    TRACK_P95,
    TRACKS,
    FALSE_TRACKS,
    GOSPA,
    OSPA2,
    TRACK_PURITY,
    ID_SWITCHES,
    GHOSTS,
    OBJECTS_SEEN,
    OBJECTS_TRACKED,
    METRICS, /* of one sensor; the following ones are of all sensors together */
    TASKS = METRICS,
    TASKS_DONE,
    PASSES_SEEN,
    OBJECTS_DETECTED,
    REVISIT,
    LONGEST_GAP,
    OBJECT_CUSTODY,
    OBJECT_CUSTODY_SEEN,
    PLACE_RMS_ARCSEC,
    TRACKS_RMS_ARCSEC,
    CATALOGUE_UPDATED,
    CATALOGUE_IN_CUSTODY,
    CATALOGUE_TRACKS,
    CATALOGUE_AMBIGUOUS,
    CATALOGUE_CROSS_TAGS,
    CATALOGUE_AGE,
    CATALOGUE_SIGMA,
    CATALOGUE_SIGMA_UPDATED,
    CATALOGUE_NEES,
    ALL_METRICS
};
_Static_assert((int)ALL_METRICS <= (int)BST_STUDY_METRICS &&
                   (int)METRICS + 1 <= (int)BST_SERIES_COLUMNS,
               "results of a run have room for the figures");

#define METRIC_LIST                                                                               \
    [FRAMES] = {"frames", "", "Frames.", BST_METRIC_VALUE},                                       \
    [VISIBLE_FRAMES] = {"visible_frames", "",                                                     \
                        "Frames with the target lit and not behind the "                          \
                        "Earth.",                                                                 \
                        BST_METRIC_VALUE},                                                        \
    [ACQUIRED] = {"acquired", "", "The track of interest was the target's at some time.",         \
                  BST_METRIC_FLAG},                                                               \
    [TIME_TO_CONFIRM] = {"time_to_confirm_s", "s",                                                \
                         "From the start to the first confirmed track "                           \
                         "of the target.",                                                        \
                         BST_METRIC_VALUE},                                                       \
    [TIME_TO_ACQUIRE] = {"time_to_acquire_s", "s",                                                \
                         "From the start until the target's track is the track "                  \
                         "of interest.",                                                          \
                         BST_METRIC_VALUE},                                                       \
    [TIME_TO_SETTLE] = {"time_to_settle_s", "s",                                                  \
                        "From the start until the target is held near "                           \
                        "the boresight.",                                                         \
                        BST_METRIC_VALUE},                                                        \
    [CUSTODY] = {"custody", "", "Share of the visible frames in track.", BST_METRIC_VALUE},       \
    [TRACK_FRACTION] = {"track_fraction", "", "The same since the acquisition.",                  \
                        BST_METRIC_VALUE},                                                        \
    [IN_TRACK_AT_END] = {"in_track_at_end", "", "The last frame was in track.", BST_METRIC_FLAG}, \
    [BREAKS] = {"breaks", "", "Times that the track of the visible target was lost.",             \
                BST_METRIC_VALUE},                                                                \
    [WRONG_TARGET_FRAMES] = {"wrong_target_frames", "", "Frames with another object for target.", \
                             BST_METRIC_VALUE},                                                   \
    [DETECTIONS] = {"detections", "", "Detections of any kind.", BST_METRIC_VALUE},               \
    [DETECTED_FRACTION] = {"detected_fraction", "",                                               \
                           "Share of the frames with the visible target "                         \
                           "in the field that have a detection on it.",                           \
                           BST_METRIC_VALUE},                                                     \
    [POINTING_RMS] = {"pointing_rms_px", "px",                                                    \
                      "Angle from the boresight to the visible target in pixels, mode "           \
                      "track, from settling on, RMS.",                                            \
                      BST_METRIC_VALUE},                                                          \
    [POINTING_MEDIAN] = {"pointing_median_px", "px", "The same, median.", BST_METRIC_VALUE},      \
    [POINTING_P99] = {"pointing_p99_px", "px", "The same, 99th percentile.", BST_METRIC_VALUE},   \
    [POINTING_BIAS] = {"pointing_bias_px", "px", "Length of the mean error.", BST_METRIC_VALUE},  \
    [TRACK_RMS] = {"track_rms_px", "px",                                                          \
                   "Direction of the target's track against the truth, "                          \
                   "RMS.",                                                                        \
                   BST_METRIC_VALUE},                                                             \
    [TRACK_MEDIAN] = {"track_median_px", "px", "The same, median.", BST_METRIC_VALUE},            \
    [TRACK_P95] = {"track_p95_px", "px", "The same, 95th percentile.", BST_METRIC_VALUE},         \
    [TRACKS] = {"tracks", "", "Confirmed tracks.", BST_METRIC_VALUE},                             \
    [FALSE_TRACKS] = {"false_tracks", "", "Of them: near no object in most of their frames.",     \
                      BST_METRIC_VALUE},                                                          \
    [GOSPA] = {"gospa_px", "px", "GOSPA of all tracks against all objects in the field, mean.",   \
               BST_METRIC_VALUE},                                                                 \
    [OSPA2] = {"ospa2_px", "px", "OSPA(2) of the same over 10 frames, mean.", BST_METRIC_VALUE},  \
    [TRACK_PURITY] = {"track_purity", "",                                                         \
                      "Share of the frames of tracks with the object that each has most often.",  \
                      BST_METRIC_VALUE},                                                          \
    [ID_SWITCHES] = {"id_switches", "", "Objects' changes to a track of another number.",         \
                     BST_METRIC_VALUE},                                                           \
    [GHOSTS] = {"ghosts", "", "Tracks without an object for more than three frames in a row.",    \
                BST_METRIC_VALUE},                                                                \
    [OBJECTS_SEEN] = {"objects_seen", "", "Objects that were in the field.", BST_METRIC_VALUE},   \
    [OBJECTS_TRACKED] = {"objects_tracked", "", "Of them: those with a confirmed track.",         \
                         BST_METRIC_VALUE}

static const bst_study_metric metrics[ALL_METRICS] = {
    METRIC_LIST,
    [TASKS] = {"tasks", "", "Tasks given, of all sensors.", BST_METRIC_VALUE},
    [TASKS_DONE] = {"tasks_done", "", "Of them: those done.", BST_METRIC_VALUE},
    [PASSES_SEEN] = {"passes_seen", "", "Passes of objects with a detection, by all sensors.",
                     BST_METRIC_VALUE},
    [OBJECTS_DETECTED] = {"objects_detected", "", "Objects that any sensor detected.",
                          BST_METRIC_VALUE},
    [REVISIT] = {"revisit_mean_s", "s",
                 "From the last detection of a pass to the first of the object's next, mean.",
                 BST_METRIC_VALUE},
    [LONGEST_GAP] = {"longest_gap_mean_s", "s",
                     "Longest time without a detection, mean of the objects that were detected.",
                     BST_METRIC_VALUE},
    [OBJECT_CUSTODY] = {"object_custody", "",
                        "Share of the time in which an object's last detection was no older than "
                        "record.custody_timeout_s, mean of all objects.",
                        BST_METRIC_VALUE},
    [OBJECT_CUSTODY_SEEN] = {"object_custody_seen", "", "The same of those that were detected.",
                             BST_METRIC_VALUE},
    [PLACE_RMS_ARCSEC] = {"place_rms_arcsec", "arcsec",
                          "Detections of all objects, by the attitude from stars, against the "
                          "truth, RMS.",
                          BST_METRIC_VALUE},
    [TRACKS_RMS_ARCSEC] = {"tracks_rms_arcsec", "arcsec",
                           "Confirmed tracks of all objects against the truth, RMS.",
                           BST_METRIC_VALUE},
    [CATALOGUE_UPDATED] = {"catalogue_updated", "",
                           "Objects whose orbit a track updated (with record.custody only, as all "
                           "that follow).",
                           BST_METRIC_VALUE},
    [CATALOGUE_IN_CUSTODY] = {"catalogue_in_custody", "",
                              "Objects with a standard deviation of the position within "
                              "record.custody_within_m at the end.",
                              BST_METRIC_VALUE},
    [CATALOGUE_TRACKS] = {"catalogue_tracks", "", "Tracks that updated an orbit.",
                          BST_METRIC_VALUE},
    [CATALOGUE_AMBIGUOUS] = {"catalogue_ambiguous", "",
                             "Tracks that agree with several objects: not used.", BST_METRIC_VALUE},
    [CATALOGUE_CROSS_TAGS] = {"catalogue_cross_tags", "",
                              "Tracks that updated another object than that of the truth.",
                              BST_METRIC_VALUE},
    [CATALOGUE_AGE] = {"catalogue_age_mean_s", "s",
                       "Time since the last update of updated objects at the end, mean.",
                       BST_METRIC_VALUE},
    [CATALOGUE_SIGMA] = {"catalogue_sigma_median_m", "m",
                         "Standard deviation of the position at the end, median of all objects.",
                         BST_METRIC_VALUE},
    [CATALOGUE_SIGMA_UPDATED] = {"catalogue_sigma_updated_median_m", "m",
                                 "The same of updated objects.", BST_METRIC_VALUE},
    [CATALOGUE_NEES] = {"catalogue_nees", "",
                        "Error of updated orbits squared, by their covariance, mean; 6 degrees of "
                        "freedom.",
                        BST_METRIC_VALUE}};
/* per sensor, if there are several */
static const bst_study_metric series[METRICS + 1] = {
    METRIC_LIST, [METRICS] = {"sensor", "", "Number of the sensor.", BST_METRIC_KEY}};

/* Copies the figures of a sensor to the metrics of the run. */
static void fill(const bst_run_sensor_figures *f, double *out) {
    const bst_loop_figures *l = &f->loop;
    const bst_run_metric_figures *m = &f->metrics;
    out[FRAMES] = (double)l->frames;
    out[VISIBLE_FRAMES] = (double)l->visible_frames;
    out[ACQUIRED] = isnan(l->time_to_acquire_s) ? 0.0 : 1.0;
    out[TIME_TO_CONFIRM] = l->time_to_confirm_s;
    out[TIME_TO_ACQUIRE] = l->time_to_acquire_s;
    out[TIME_TO_SETTLE] = l->time_to_settle_s;
    out[CUSTODY] = l->custody;
    out[TRACK_FRACTION] = l->track_fraction;
    out[IN_TRACK_AT_END] = l->in_track_at_end ? 1.0 : 0.0;
    out[BREAKS] = (double)l->breaks;
    out[WRONG_TARGET_FRAMES] = (double)l->wrong_target_frames;
    out[DETECTIONS] = (double)m->detections;
    out[DETECTED_FRACTION] = m->detected_fraction;
    out[POINTING_RMS] = l->pointing_rms_px;
    out[POINTING_MEDIAN] = l->pointing_median_px;
    out[POINTING_P99] = l->pointing_p99_px;
    out[POINTING_BIAS] = l->pointing_bias_px;
    out[TRACK_RMS] = m->track_rms_px;
    out[TRACK_MEDIAN] = m->track_median_px;
    out[TRACK_P95] = m->track_p95_px;
    out[TRACKS] = (double)m->tracks;
    out[FALSE_TRACKS] = (double)m->false_tracks;
    out[GOSPA] = m->gospa_px;
    out[OSPA2] = m->ospa2_px;
    out[TRACK_PURITY] = m->purity;
    out[ID_SWITCHES] = (double)m->id_switches;
    out[GHOSTS] = (double)m->ghosts;
    out[OBJECTS_SEEN] = (double)m->objects_seen;
    out[OBJECTS_TRACKED] = (double)m->objects_tracked;
}

static void fill_all(const bst_run_report *report, double *out) {
    const bst_sightings_figures *f = &report->sightings;
    fill(&report->sensors[0], out);
    for (int i = METRICS; i < ALL_METRICS; i++) {
        out[i] = NAN;
    }
    if (report->has_sightings) {
        out[TASKS] = (double)f->tasks;
        out[TASKS_DONE] = (double)f->tasks_done;
        out[PASSES_SEEN] = (double)f->passes_seen;
        out[OBJECTS_DETECTED] = (double)f->seen;
        out[REVISIT] = f->revisit_mean_s;
        out[LONGEST_GAP] = f->gap_mean_s;
        out[OBJECT_CUSTODY] = f->custody_fraction_all;
        out[OBJECT_CUSTODY_SEEN] = f->custody_fraction;
        out[PLACE_RMS_ARCSEC] = f->place_rms_arcsec;
        out[TRACKS_RMS_ARCSEC] = f->track_rms_arcsec;
    }
    if (report->has_custody) {
        const bst_custody_figures *c = &report->custody;
        out[CATALOGUE_UPDATED] = (double)c->updated;
        out[CATALOGUE_IN_CUSTODY] = (double)c->in_custody;
        out[CATALOGUE_TRACKS] = (double)c->correlated;
        out[CATALOGUE_AMBIGUOUS] = (double)c->ambiguous;
        out[CATALOGUE_CROSS_TAGS] = (double)c->cross_tags;
        out[CATALOGUE_AGE] = c->age_mean_s;
        out[CATALOGUE_SIGMA] = c->sigma_median_m;
        out[CATALOGUE_SIGMA_UPDATED] = c->sigma_updated_median_m;
        out[CATALOGUE_NEES] = c->nees_mean;
    }
}

static bst_status fill_series(bst_ctx *ctx, const bst_run_report *report, bst_study_result *out) {
    enum { COLUMNS = METRICS + 1 };
    out->series = calloc((size_t)report->count * COLUMNS, sizeof *out->series);
    if (!out->series) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the figures of a run");
    }
    out->rows = report->count;
    for (int i = 0; i < report->count; i++) {
        fill(&report->sensors[i], out->series + (size_t)i * COLUMNS);
        out->series[(size_t)i * COLUMNS + METRICS] = i;
    }
    return BST_OK;
}

static bst_status run_loop(bst_ctx *ctx, void *worker, const bst_study_run *run,
                           bst_study_result *out) {
    bst_scenario scenario;
    bst_simulation *sim = NULL;
    bst_run_report report = {.sensors = NULL};
    const bst_run_request request = {
        .out = run->folder, .overwrite = true, .metrics = true, .most_s = run->most_s};
    bst_status status = bst_study_read_scenario(ctx, run, &scenario);
    if (status == BST_OK) {
        status = bst_study_simulation(ctx, worker, &scenario, &sim);
    }
    if (status == BST_OK) {
        status = bst_run_scenario(ctx, &scenario, sim, &request, &report);
    }
    if (status == BST_OK) {
        fill_all(&report, out->metrics);
        out->left_s = report.wall_s * (1.0 / fmax(report.part, 1e-9) - 1.0);
        status = report.count > 1 ? fill_series(ctx, &report, out) : BST_OK;
    }
    free(report.sensors);
    bst_simulation_free(sim);
    bst_scenario_free(&scenario);
    return status;
}

static bst_status emit_loop(bst_ctx *ctx, void *user, const bst_study_run *run, FILE *stream,
                            FILE *command) {
    bst_scenario scenario;
    (void)user;
    bst_status status = bst_plugins_scenario_read(ctx, run->scenario, &scenario);
    if (status == BST_OK) {
        status = bst_study_print_scenario(ctx, &scenario, stream);
        fprintf(command, "by hand: boresight run SCENARIO.json --out FOLDER\n");
    }
    bst_scenario_free(&scenario);
    return status;
}

const bst_study_kind bst_study_loop_kind = {.name = "loop",
                                            .metrics = metrics,
                                            .metric_count = ALL_METRICS,
                                            .series_name = "sensors",
                                            .series = series,
                                            .series_count = METRICS + 1,
                                            .check = bst_study_check_scenario,
                                            .open = bst_study_warm_open,
                                            .close = bst_study_warm_close,
                                            .run = run_loop,
                                            .emit = emit_loop,
                                            .stop_requested = bst_study_stop_requested};
