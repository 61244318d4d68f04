#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <cjson/cJSON.h>

#include "sim/report/report.h"

bst_loop_frame bst_report_loop_frame(const bst_report_frame *f) {
    /* if modes were not recorded, a frame in track counts as mode track */
    int mode = f->mode < 0 && f->in_track ? BST_MODE_TRACK : f->mode;
    return (bst_loop_frame){.exposure_id = f->exposure_id,
                            .time_s = f->mid_s,
                            .error_px = f->error_px,
                            .error_x_px = f->error_x_px,
                            .error_y_px = f->error_y_px,
                            .target_snr = isfinite(f->snr) ? f->snr : 0.0,
                            .visible = f->known && f->visible,
                            .in_track = f->in_track,
                            .acquired = f->acquired,
                            .settled = f->settled,
                            .mode = mode};
}

/* Marks acquired and settled frames and their times, by the rules of sim/eval/loop_summary.c. */
static void mark(bst_report_sensor *s) {
    double acquired_s = NAN;
    bool settled = false;
    for (size_t i = 0; i < s->count; i++) {
        bst_report_frame *f = &s->frames[i];
        if (f->task_begins) {
            acquired_s = NAN;
            settled = false;
        }
        settled = settled || bst_loop_settles(acquired_s <= f->end_s, bst_report_loop_frame(f).mode,
                                              f->error_px);
        if (settled && isnan(s->loop.time_to_settle_s)) {
            s->loop.time_to_settle_s = 2.0 * f->mid_s - f->end_s; /* start of the exposure */
        }
        if (f->in_track && isnan(acquired_s)) {
            acquired_s = isfinite(f->tracked_s) ? f->tracked_s : f->mid_s;
            if (isnan(s->loop.time_to_acquire_s)) {
                s->loop.time_to_acquire_s = acquired_s;
            }
        }
        f->acquired = f->mid_s >= acquired_s;
        f->settled = settled;
        s->loop.final_mode = f->mode;
    }
}

static void take_real(const cJSON *summary, const char *key, double *value) {
    const cJSON *item = cJSON_GetObjectItemCaseSensitive(summary, key);
    if (item) {
        *value = cJSON_IsNumber(item) ? item->valuedouble : NAN;
    }
}

static void take_count(const cJSON *summary, const char *key, int64_t *value) {
    double number = (double)*value;
    take_real(summary, key, &number);
    *value = fabs(number) < 1e15 ? (int64_t)number : 0;
}

static void take_summary(bst_report_sensor *s, const cJSON *summary) {
    bst_loop_figures *f = &s->loop;
    const struct {
        const char *key;
        double *value;
    } reals[] = {{"time_to_confirm_s", &f->time_to_confirm_s},
                 {"time_to_acquire_s", &f->time_to_acquire_s},
                 {"time_to_settle_s", &f->time_to_settle_s},
                 {"custody", &f->custody},
                 {"track_fraction", &f->track_fraction},
                 {"pointing_rms_px", &f->pointing_rms_px},
                 {"pointing_median_px", &f->pointing_median_px},
                 {"pointing_p95_px", &f->pointing_p95_px},
                 {"pointing_p99_px", &f->pointing_p99_px},
                 {"pointing_max_px", &f->pointing_max_px},
                 {"pointing_bias_px", &f->pointing_bias_px},
                 {"real_time_factor", &s->real_time_factor},
                 {"track_rms_px", &s->track_rms_px},
                 {"track_median_px", &s->track_median_px},
                 {"track_p95_px", &s->track_p95_px},
                 {"track_max_px", &s->track_max_px},
                 {"smoothed_rms_px", &s->smoothed_rms_px},
                 {"smoothed_filtered_rms_px", &s->smoothed_filtered_rms_px},
                 {"gospa_px", &s->gospa_px},
                 {"ospa2_px", &s->ospa2_px},
                 {"track_purity", &s->track_purity}};
    const struct {
        const char *key;
        int64_t *value;
    } counts[] = {{"frames", &f->frames},
                  {"visible_frames", &f->visible_frames},
                  {"breaks", &f->breaks},
                  {"wrong_target_frames", &f->wrong_target_frames},
                  {"pointing_frames", &f->pointing_frames},
                  {"bad_pixels", &s->bad_pixels},
                  {"track_frames", &s->track_frames},
                  {"scored_frames", &s->scored_frames},
                  {"id_switches", &s->id_switches},
                  {"ghosts", &s->ghosts}};
    for (size_t k = 0; k < sizeof reals / sizeof *reals; k++) {
        take_real(summary, reals[k].key, reals[k].value);
    }
    for (size_t k = 0; k < sizeof counts / sizeof *counts; k++) {
        take_count(summary, counts[k].key, counts[k].value);
    }
    const cJSON *mode = cJSON_GetObjectItemCaseSensitive(summary, "final_mode");
    for (int m = 0; cJSON_IsString(mode) && m < BST_MODE_COUNT; m++) {
        f->final_mode = strcmp(mode->valuestring, bst_mode_name(m)) == 0 ? m : f->final_mode;
    }
}

/* Checks whether a summary has all pointing figures: those of earlier versions follow other rules
 * and are recomputed here. */
static bool is_complete(const cJSON *summary) {
    return cJSON_GetObjectItemCaseSensitive(summary, "pointing_frames") != NULL;
}

void bst_report_judge(bst_report_sensor *s, const cJSON *summary) {
    bst_loop_tally *tally = calloc(1, sizeof *tally);
    s->loop = (bst_loop_figures){.final_mode = -1,
                                 .time_to_confirm_s = NAN,
                                 .time_to_acquire_s = NAN,
                                 .time_to_settle_s = NAN};
    s->real_time_factor = NAN;
    s->track_frames = s->scored_frames = s->id_switches = s->ghosts = 0;
    s->gospa_px = s->ospa2_px = s->track_purity = NAN;
    s->smoothed_rms_px = s->smoothed_filtered_rms_px = NAN;
    s->track_rms_px = s->track_median_px = s->track_p95_px = s->track_max_px = NAN;
    mark(s);
    for (size_t i = 0; tally && i < s->count; i++) {
        bst_loop_frame frame = bst_report_loop_frame(&s->frames[i]);
        bst_loop_tally_add(tally, &frame);
    }
    if (tally) {
        bst_loop_tally_figures(tally, &s->loop);
    }
    s->loop.frames = s->exposures;
    free(tally);
    if (summary && is_complete(summary)) {
        take_summary(s, summary);
    } else if (summary) {
        take_real(summary, "real_time_factor", &s->real_time_factor);
    }
}
