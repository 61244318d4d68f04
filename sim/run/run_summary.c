#include "sim/run/run_summary.h"

#include <math.h>
#include <stdio.h>

#include <cjson/cJSON.h>

#include "sim/core/json_number.h"

static void add_count(cJSON *node, const char *key, int64_t count) {
    cJSON_AddNumberToObject(node, key, (double)count);
}

/* Figures of a sensor with the keys of docs/reference/summary.md. Scripts rely on the order of the
 * first seven. */
cJSON *bst_run_summary_json(const bst_run_sensor_figures *figures, double real_time_factor) {
    cJSON *node = cJSON_CreateObject();
    const bst_loop_figures *f = &figures->loop;
    const bst_run_metric_figures *m = &figures->metrics;
    add_count(node, "frames", f->frames);
    cJSON_AddStringToObject(node, "final_mode", bst_mode_name(f->final_mode));
    bst_json_add_number(node, "time_to_confirm_s", f->time_to_confirm_s);
    bst_json_add_number(node, "track_fraction", f->track_fraction);
    bst_json_add_number(node, "pointing_rms_px", f->pointing_rms_px);
    bst_json_add_number(node, "pointing_p99_px", f->pointing_p99_px);
    bst_json_add_number(node, "real_time_factor", real_time_factor);
    bst_json_add_number(node, "time_to_acquire_s", f->time_to_acquire_s);
    bst_json_add_number(node, "time_to_settle_s", f->time_to_settle_s);
    add_count(node, "visible_frames", f->visible_frames);
    bst_json_add_number(node, "custody", f->custody);
    add_count(node, "breaks", f->breaks);
    add_count(node, "wrong_target_frames", f->wrong_target_frames);
    add_count(node, "pointing_frames", f->pointing_frames);
    bst_json_add_number(node, "pointing_median_px", f->pointing_median_px);
    bst_json_add_number(node, "pointing_p95_px", f->pointing_p95_px);
    bst_json_add_number(node, "pointing_max_px", f->pointing_max_px);
    bst_json_add_number(node, "pointing_bias_px", f->pointing_bias_px);
    add_count(node, "earth_frames", m->losses.earth_frames);
    add_count(node, "moon_frames", m->losses.moon_frames);
    add_count(node, "sun_frames", m->losses.sun_frames);
    add_count(node, "detections", m->detections);
    bst_json_add_number(node, "detected_fraction", m->detected_fraction);
    add_count(node, "track_frames", m->track_frames);
    bst_json_add_number(node, "track_rms_px", m->track_rms_px);
    bst_json_add_number(node, "track_median_px", m->track_median_px);
    bst_json_add_number(node, "track_p95_px", m->track_p95_px);
    bst_json_add_number(node, "track_max_px", m->track_max_px);
    if (m->smoothed_frames > 0) {
        add_count(node, "smoothed_frames", m->smoothed_frames);
        bst_json_add_number(node, "smoothed_rms_px", m->smoothed_rms_px);
        bst_json_add_number(node, "smoothed_filtered_rms_px", m->smoothed_filtered_rms_px);
    }
    add_count(node, "tracks", m->tracks);
    add_count(node, "false_tracks", m->false_tracks);
    add_count(node, "scored_frames", m->scored_frames);
    bst_json_add_number(node, "gospa_px", m->gospa_px);
    bst_json_add_number(node, "ospa2_px", m->ospa2_px);
    bst_json_add_number(node, "track_purity", m->purity);
    add_count(node, "id_switches", m->id_switches);
    add_count(node, "ghosts", m->ghosts);
    add_count(node, "bad_pixels", m->bad_pixels);
    return node;
}

void bst_run_print_row(const char *name, const char *format, double value, const char *unit) {
    char text[48] = "-";
    if (isfinite(value)) {
        snprintf(text, sizeof text, format, value);
    }
    printf("  %-28s %12s %s\n", name, text, unit);
}

void bst_run_summary_print(const bst_run_sensor_figures *figures) {
    const bst_loop_figures *f = &figures->loop;
    printf("%s\n", figures->scope);
    bst_run_print_row("frames", "%.0f", (double)f->frames, "");
    printf("  %-28s %12s\n", "final mode", bst_mode_name(f->final_mode));
    bst_run_print_row("time to confirm", "%.2f", f->time_to_confirm_s, "s");
    bst_run_print_row("time to acquire", "%.2f", f->time_to_acquire_s, "s");
    bst_run_print_row("time to settle", "%.2f", f->time_to_settle_s, "s");
    bst_run_print_row("custody", "%.2f", 100.0 * f->custody, "% of visible frames in track");
    bst_run_print_row("custody once acquired", "%.2f",
                      isfinite(f->time_to_acquire_s) ? 100.0 * f->track_fraction : NAN,
                      "% of visible frames since then in track");
    bst_run_print_row("pointing RMS", "%.3f", f->pointing_rms_px, "px");
    bst_run_print_row("pointing 99th percentile", "%.3f", f->pointing_p99_px, "px");
    if (figures->metrics.smoothed_frames > 0) {
        bst_run_print_row("track RMS, smoothed", "%.4f", figures->metrics.smoothed_rms_px, "px");
        bst_run_print_row("  filtered, same frames", "%.4f",
                          figures->metrics.smoothed_filtered_rms_px, "px");
    }
    if (figures->metrics.bad_pixels > 0) {
        bst_run_print_row("bad pixels learned", "%.0f", (double)figures->metrics.bad_pixels, "");
    }
}
