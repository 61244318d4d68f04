/* Study kind "pd": a run measures a detection curve over SNR like `boresight pd`. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sim/analysis/pd/pd.h"
#include "sim/cli/plugins.h"
#include "sim/eval/detection_theory.h"
#include "sim/study_kinds/study_kinds.h"
#include "sim/study_kinds/study_plugins.h"

enum {
    SNR_PD50,
    SNR_PD90,
    V_PD50,
    V_PD90,
    LOSS_PD50,
    LOSS_PD90,
    LOSS_SIGMA_PD50,
    LOSS_SIGMA_PD90,
    FALSE_ALARMS,
    FALSE_ALARMS_LOW,
    FALSE_ALARMS_HIGH,
    CHANCE,
    THRESHOLD,
    FWHM,
    NOISE,
    SKY,
    DARK,
    EMPTY_FRAMES,
    LOST,
    METRICS
};

/* The ideal detector knows the position, and makes one test per pixel of the frame. */
#define BELOW_ZERO                                                                               \
    " of known place and shape. Below 0: noise of the trials (loss_db_sigma), or the gain of a " \
    "detector that takes the highest of several places where the ideal one tests one."

static const bst_study_metric metrics[METRICS] = {
    [SNR_PD50] = {"snr_pd50", "", "SNR at which half of the targets are detected.", 0},
    [SNR_PD90] = {"snr_pd90", "", "SNR at which 90 % of the targets are detected.", 0},
    [V_PD50] = {"v_mag_pd50", "mag", "V magnitude of targets of snr_pd50.", 0},
    [V_PD90] = {"v_mag_pd90", "mag", "V magnitude of targets of snr_pd90.", 0},
    [LOSS_PD50] = {"loss_db_pd50", "dB", "snr_pd50 over that of the ideal detector" BELOW_ZERO, 0},
    [LOSS_PD90] = {"loss_db_pd90", "dB", "snr_pd90 over that of the ideal detector" BELOW_ZERO, 0},
    [LOSS_SIGMA_PD50] = {"loss_db_sigma_pd50", "dB", "Standard deviation of loss_db_pd50.", 0},
    [LOSS_SIGMA_PD90] = {"loss_db_sigma_pd90", "dB", "Standard deviation of loss_db_pd90.", 0},
    [FALSE_ALARMS] = {"false_alarms_per_frame", "", "Measured without targets.", 0},
    [FALSE_ALARMS_LOW] = {"false_alarms_low", "", "Its 95 % Poisson interval.", 0},
    [FALSE_ALARMS_HIGH] = {"false_alarms_high", "", "Upper end.", 0},
    [CHANCE] = {"chance", "", "Share of places without a target that have a detection.", 0},
    [THRESHOLD] = {"threshold_snr", "", "Threshold of the detector.", 0},
    [FWHM] = {"fwhm_px", "px", "FWHM of the point spread function.", 0},
    [NOISE] = {"noise_e", "e-", "Noise of a pixel without a target, at the boresight.", 0},
    [SKY] = {"sky_e", "e-", "Sky per pixel and exposure, at the boresight.", 0},
    [DARK] = {"dark_e", "e-", "Dark current per pixel and exposure.", 0},
    [EMPTY_FRAMES] = {"empty_frames", "", "Frames without targets.", 0},
    [LOST] = {"lost", "", "Detections that found no room and are missing.", 0},
};

enum { SNR, V_MAG, TRIALS, DETECTED, PD, PD_LOW, PD_HIGH, IDEAL_PD, ERROR_PX, SERIES };

_Static_assert((int)METRICS <= (int)BST_STUDY_METRICS && (int)SERIES <= (int)BST_SERIES_COLUMNS,
               "results of a run have room for the figures");
static const bst_study_metric series[SERIES] = {
    [SNR] = {"snr", "", "SNR of the targets.", BST_METRIC_KEY},
    [V_MAG] = {"v_mag", "mag", "Their V magnitude.", 0},
    [TRIALS] = {"trials", "", "Targets.", BST_METRIC_TRIALS},
    [DETECTED] = {"detected", "", "Of them: those with a detection on them.", BST_METRIC_HITS},
    [PD] = {"pd", "", "Probability of detection, without chance matches.", 0},
    [PD_LOW] = {"pd_low", "", "Its 95 % interval (Wilson) in one run.", 0},
    [PD_HIGH] = {"pd_high", "", "Upper end.", 0},
    [IDEAL_PD] = {"ideal_pd", "", "That of the ideal detector at the same false alarms.", 0},
    [ERROR_PX] = {"error_rms_px", "px", "RMS error of location per axis.", 0},
};

/* Reads the settings of a study of detection probability. */
static bst_status read_settings(bst_ctx *ctx, const bst_study_run *run, bst_study_pd_config *c) {
    const char *file = run->study->file;
    BST_TRY(bst_config_read(ctx, run->study->json, run->settings, "/pd", bst_study_pd_table, c));
    if (c->snr_first > c->snr_last || (c->snr_last - c->snr_first) / c->snr_step >= BST_PD_POINTS) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "%s: /pd: SNR from %g to %g by %g (allowed: the first not above the last, "
                        "and at most %d of them)",
                        file, c->snr_first, c->snr_last, c->snr_step, BST_PD_POINTS);
    }
    if (c->known_rate && !(c->streak_px > 0.0 && c->star_streak_px == 0.0)) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "%s: /pd/known_rate: needs a streak_px above 0, and no star_streak_px",
                        file);
    }
    if (c->stars && c->background_e >= 0.0) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "%s: /pd/stars: keeps the scenario's sky, background_e sets another: give "
                        "one of them",
                        file);
    }
    return BST_OK;
}

static bst_status check_pd(bst_ctx *ctx, void *user, const bst_study_run *run, bool deep) {
    bst_study_pd_config config;
    bst_scenario scenario;
    bool found = false;
    BST_TRY(read_settings(ctx, run, &config));
    BST_TRY(bst_study_check_scenario(ctx, user, run, deep));
    if (!deep) {
        return BST_OK;
    }
    bst_status status = bst_plugins_scenario_read(ctx, run->scenario, &scenario);
    for (int m = 0; status == BST_OK && m < scenario.module_count; m++) {
        found = found || strcmp(scenario.modules[m].desc->role, "imgproc") == 0;
    }
    if (status == BST_OK && !found) {
        status = bst_fail(ctx, BST_ERR_CONFIG,
                          "%s: no sensor has a module \"imgproc\": there is no detector to measure",
                          scenario.file);
    }
    bst_scenario_free(&scenario);
    return status;
}

static bst_pd_options options_of(const bst_study_pd_config *c, const bst_study_warm *warm) {
    return (bst_pd_options){.low = c->snr_first,
                            .high = c->snr_last,
                            .step = c->snr_step,
                            .trials = c->trials,
                            .empty_frames = c->empty_frames,
                            .streak_px = c->streak_px,
                            .known_rate = c->known_rate,
                            .false_alarms = c->false_alarms_per_frame,
                            .background_e = c->background_e < 0.0 ? -1.0 : c->background_e,
                            .jitter_px = c->jitter_px < 0.0 ? -1.0 : c->jitter_px,
                            .min_separation_px = c->min_separation_px,
                            .stars = c->stars,
                            .rates_px = 3.0,
                            .star_streak_px = c->star_streak_px,
                            .sensor = *c->sensor ? c->sensor : NULL,
                            .threads = warm->threads,
                            .opened = warm->device,
                            .quiet = true};
}

/* V magnitude of a target for an SNR, proportional to its light. */
static double v_mag_at(const bst_pd_scene *s, double snr) {
    return snr > 0.0 ? s->v_mag[0] - 2.5 * log10(snr / s->snr[0]) : NAN;
}

static bst_status fill(bst_ctx *ctx, const bst_pd_scene *s, const bst_pd_result *r,
                       bst_study_result *out) {
    bst_pd_figures f;
    double *m = out->metrics;
    bst_pd_figures_of(s, r, &f);
    m[SNR_PD50] = f.pd50.snr;
    m[SNR_PD90] = f.pd90.snr;
    m[V_PD50] = v_mag_at(s, f.pd50.snr);
    m[V_PD90] = v_mag_at(s, f.pd90.snr);
    m[LOSS_PD50] = f.loss_db_pd50;
    m[LOSS_PD90] = f.loss_db_pd90;
    m[LOSS_SIGMA_PD50] = f.loss_db_sigma_pd50;
    m[LOSS_SIGMA_PD90] = f.loss_db_sigma_pd90;
    m[FALSE_ALARMS] = f.false_alarms_per_frame;
    m[FALSE_ALARMS_LOW] = f.false_alarms_low;
    m[FALSE_ALARMS_HIGH] = f.false_alarms_high;
    m[CHANCE] = f.chance;
    m[THRESHOLD] = r->threshold_snr;
    m[FWHM] = s->fwhm_px;
    m[NOISE] = s->noise_e;
    m[SKY] = s->sky_e;
    m[DARK] = s->dark_e;
    m[EMPTY_FRAMES] = (double)r->empty_frames;
    m[LOST] = (double)r->lost;
    for (int i = 0; i < METRICS; i++) {
        m[i] = isfinite(m[i]) ? m[i] : NAN;
    }
    out->series = calloc((size_t)s->points * SERIES, sizeof *out->series);
    if (!out->series) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a curve");
    }
    out->rows = s->points;
    for (int i = 0; i < s->points; i++) {
        const bst_pd_tally *t = &r->tallies[i];
        double *row = out->series + (size_t)i * SERIES, n = (double)t->matched;
        bst_eval_interval w = bst_eval_wilson_interval(t->matched, t->trials, BST_NORMAL_95);
        row[SNR] = s->snr[i];
        row[V_MAG] = s->v_mag[i];
        row[TRIALS] = (double)t->trials;
        row[DETECTED] = n;
        row[PD] = t->trials > 0 ? bst_pd_without_chance(n / (double)t->trials, f.chance) : NAN;
        row[PD_LOW] = bst_pd_without_chance(w.low, f.chance);
        row[PD_HIGH] = bst_pd_without_chance(w.high, f.chance);
        row[IDEAL_PD] = f.pfa > 0.0 ? bst_eval_ideal_pd(f.pfa, s->snr[i]) : NAN;
        row[ERROR_PX] = n > 0.0 ? sqrt((t->error_square[0] + t->error_square[1]) / (2.0 * n)) : NAN;
    }
    return BST_OK;
}

/* Measures the detection probability of one run. */
static bst_status measure(bst_ctx *ctx, const bst_scenario *scenario, const bst_pd_options *options,
                          bst_study_result *out) {
    bst_pd_scene *scene = calloc(1, sizeof *scene);
    bst_pd_result *result = calloc(1, sizeof *result);
    bst_pd_detector *detector = NULL;
    bst_status status = scene && result
                            ? bst_pd_scene_open(ctx, scenario, options, scene)
                            : bst_fail(ctx, BST_ERR_MEMORY, "no memory for the measurement");
    if (status == BST_OK) {
        status = bst_pd_detector_open(ctx, scene, &detector);
        if (status == BST_OK) {
            status = bst_pd_run(ctx, scene, detector, result);
        }
        if (status == BST_OK) {
            status = fill(ctx, scene, result, out);
        }
        bst_pd_detector_close(detector);
        bst_pd_scene_close(scene);
    }
    free(scene);
    free(result);
    return status;
}

static bst_status run_pd(bst_ctx *ctx, void *worker, const bst_study_run *run,
                         bst_study_result *out) {
    bst_study_warm *warm = worker;
    bst_study_pd_config config;
    bst_scenario scenario;
    BST_TRY(read_settings(ctx, run, &config));
    bst_status status = bst_study_read_scenario(ctx, run, &scenario);
    if (status == BST_OK) {
        status = bst_study_warm_device(ctx, warm);
    }
    if (status == BST_OK) {
        bst_study_warm_stars(warm, &scenario);
        bst_pd_options options = options_of(&config, warm);
        status = measure(ctx, &scenario, &options, out);
    }
    bst_scenario_free(&scenario);
    return status;
}

static bst_status emit_pd(bst_ctx *ctx, void *user, const bst_study_run *run, FILE *stream,
                          FILE *command) {
    bst_study_pd_config c;
    bst_scenario scenario;
    (void)user;
    BST_TRY(read_settings(ctx, run, &c));
    bst_status status = bst_plugins_scenario_read(ctx, run->scenario, &scenario);
    if (status == BST_OK) {
        status = bst_study_print_scenario(ctx, &scenario, stream);
    }
    bst_scenario_free(&scenario);
    BST_TRY(status);
    fprintf(command, "by hand: boresight pd SCENARIO.json --snr %.17g:%.17g:%.17g --trials %lld",
            c.snr_first, c.snr_last, c.snr_step, (long long)c.trials);
    const struct {
        const char *name;
        double value, unless;
    } numbers[] = {{"empty-frames", (double)c.empty_frames, 0.0},
                   {"false-alarms", c.false_alarms_per_frame, 0.0},
                   {"background", c.background_e, -1.0},
                   {"jitter", c.jitter_px, -1.0},
                   {"streak", c.streak_px, 0.0},
                   {"star-streak", c.star_streak_px, 0.0},
                   {"apart", c.min_separation_px, 24.0}};
    for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++) {
        if (numbers[i].value < numbers[i].unless || numbers[i].value > numbers[i].unless) {
            fprintf(command, " --%s %.17g", numbers[i].name, numbers[i].value);
        }
    }
    fprintf(command, "%s%s", c.known_rate ? " --known-rate" : "", c.stars ? " --stars" : "");
    fprintf(command, *c.sensor ? " --sensor %s\n" : "\n", c.sensor);
    return BST_OK;
}

const bst_study_kind bst_study_pd_kind = {.name = "pd",
                                          .metrics = metrics,
                                          .metric_count = METRICS,
                                          .series_name = "curve",
                                          .series = series,
                                          .series_count = SERIES,
                                          .check = check_pd,
                                          .open = bst_study_warm_open,
                                          .close = bst_study_warm_close,
                                          .run = run_pd,
                                          .emit = emit_pd,
                                          .stop_requested = bst_study_stop_requested};
