#include "sim/analysis/calibration/calibrate_scenarios.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "boresight/version.h"
#include "sim/analysis/calibration/calibrate.h"
#include "sim/analysis/calibration/obsgen_validation.h"
#include "sim/analysis/calibration/watch.h"

typedef struct collecting {
    bst_calibration_fitter *calibrator;
    double tick_rate_hz;
} collecting;

static bst_status on_frame(void *user, bst_ctx *ctx, const bst_truth *truth,
                           const bst_detections *detections) {
    collecting *c = user;
    double exposure_s = (double)(truth->end_tick - truth->start_tick) / c->tick_rate_hz;
    return bst_calibration_fitter_add(ctx, c->calibrator, truth, detections, exposure_s);
}

/* Reads what the calibration needs of the first sensor: its camera and settings of imgproc. */
static bst_status read_path(bst_ctx *ctx, const bst_scenario *s, bst_calibration_path *out) {
    const bst_observer_config *observer = s->observers.items;
    const bst_sensor_config *sensor = observer->sensors.items;
    if (sensor->observation_source != BST_OBSERVE_IMAGE || sensor->exposure.binning > 1) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "%s: /observers/0/sensors/0: a calibration needs observation_source "
                        "\"image\" and exposure/binning 1",
                        s->file);
    }
    *out = (bst_calibration_path){.camera = &sensor->camera};
    const struct {
        const char *key;
        double *value;
    } settings[] = {{"false_alarms_per_frame", &out->false_alarms_per_frame},
                    {"jitter_px", &out->jitter_px},
                    {"streak_min_px", &out->streak_min_px},
                    {"streak_max_px", &out->streak_max_px}};
    const bst_scenario_module_config *imgproc = bst_scenario_module(s, 0, 0, "imgproc");
    for (size_t i = 0; i < sizeof settings / sizeof *settings; i++) {
        if (!bst_scenario_module_number(imgproc, settings[i].key, settings[i].value)) {
            return bst_fail(ctx, BST_ERR_CONFIG,
                            "%s: the first sensor has no module \"imgproc\" with a key \"%s\": "
                            "give a scenario with the whole image path",
                            s->file, settings[i].key);
        }
    }
    return BST_OK;
}

static bst_status collect(bst_ctx *ctx, const bst_calibration_order *e, const char *file, int64_t n,
                          bst_calibration_fitter *calibrator) {
    bst_json *json;
    bst_scenario scenario;
    BST_TRY(bst_load_scenario(ctx, file, &e->load, &json, &scenario));
    scenario.run += n;
    bst_calibration_path path;
    bst_status status = read_path(ctx, &scenario, &path);
    if (status == BST_OK) {
        status = bst_calibration_fitter_begin(ctx, calibrator, &path);
    }
    if (status == BST_OK) {
        collecting c = {calibrator, (double)scenario.tick_rate_hz};
        const bst_calibration_watcher watcher = {.user = &c, .frame = on_frame};
        status = bst_watch_run(ctx, &scenario, &watcher, e->device, (int)e->threads, NULL);
    }
    bst_scenario_free(&scenario);
    bst_json_free(json);
    return status;
}

static void print_calibration(const bst_obsgen_calibration *c, const bst_calibration_counts *n) {
    printf(
        "seen: %ld frames, %ld stars near the limit, %ld detected, %ld false alarms, %ld "
        "places\n",
        n->frames, n->sources, n->detected, n->false_alarms, n->places);
    printf("threshold %+.3f, noise x %.4f, background share %.2f, crowding %.2f, slope %.2f\n",
           c->threshold_offset, c->noise_factor, c->background_fraction, c->crowding, c->slope);
    printf("gain at 0, 5, 20, 60 px: %.4f %.4f %.4f %.4f (loss %.2f %.2f %.2f %.2f dB)\n",
           c->gain[0], c->gain[1], c->gain[2], c->gain[3], -20.0 * log10(c->gain[0]),
           -20.0 * log10(c->gain[1]), -20.0 * log10(c->gain[2]), -20.0 * log10(c->gain[3]));
    printf("false alarms x %.3f, tail %.2f; phase bias %.4f px; stars identified %.4f\n",
           c->false_alarm_factor, c->false_alarm_steepness, c->phase_bias_px,
           c->star_id_probability);
    for (int i = 0; i < BST_OBSGEN_SNRS; i++) {
        printf("place over bound at SNR %3.0f: %.3f across, %.3f along\n", bst_obsgen_snrs[i],
               c->across_factor[i], c->along_factor[i]);
    }
}

void bst_calibration_describe(int64_t seeds, int count, char *const *files, char *out,
                              size_t bytes) {
    int used = snprintf(out, bytes, "boresight %s, %lld runs of", bst_version(), (long long)seeds);
    for (int i = 0; i < count && used < (int)bytes; i++) {
        const char *name = strrchr(files[i], '/');
        used += snprintf(out + used, bytes - (size_t)used, " %.60s", name ? name + 1 : files[i]);
    }
}

bst_status bst_calibration_make(bst_ctx *ctx, const bst_calibration_order *e, int count,
                                char *const *files) {
    bst_calibration_fitter *calibrator;
    BST_TRY(bst_calibration_fitter_create(ctx, &calibrator));
    bst_status status = BST_OK;
    for (int i = 0; i < count && status == BST_OK; i++) {
        for (int64_t n = 0; n < e->seeds && status == BST_OK; n++) {
            status = collect(ctx, e, files[i], n, calibrator);
        }
    }
    bst_obsgen_calibration calibration;
    bst_calibration_counts counts;
    if (status == BST_OK) {
        status = bst_calibration_fitter_fit(ctx, calibrator, &calibration, &counts);
    }
    if (status == BST_OK) {
        bst_calibration_describe(e->seeds, count, files, calibration.made_from,
                                 sizeof calibration.made_from);
        print_calibration(&calibration, &counts);
        status = bst_obsgen_calibration_write(ctx, e->out, &calibration);
    }
    bst_calibration_fitter_free(calibrator);
    return status;
}

bst_status bst_calibration_check(bst_ctx *ctx, const bst_calibration_order *e, int count,
                                 char *const *files, bool *equivalent) {
    *equivalent = true;
    for (int i = 0; i < count; i++) {
        const bst_obsgen_validation_options options = {.scenario = files[i],
                                                       .calibration = e->calibration,
                                                       .device = e->device,
                                                       .load = &e->load,
                                                       .seeds = (int)e->seeds,
                                                       .threads = (int)e->threads,
                                                       .json = e->json};
        bool same;
        BST_TRY(bst_obsgen_validation_run(ctx, &options, &same));
        *equivalent = *equivalent && same;
    }
    return BST_OK;
}
