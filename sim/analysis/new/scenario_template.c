#include "sim/analysis/new/scenario_template.h"

#include <cjson/cJSON.h>
#include <math.h>
#include <stdlib.h>

#include "boresight/vec.h"
#include "sim/analysis/new/reference_sensor.h"

/* From this rate on the line of sight bends within seconds, and an orbit fits what a steady rate
 * does not. */
#define ORBIT_RATE_ARCSEC_PER_S 100.0

/* Fast jitter of the platform: RMS (radial), and its band, in which its spectrum is flat. */
static const double JITTER_PX = 0.1, JITTER_LOW_HZ = 5.0, JITTER_HIGH_HZ = 200.0;

/* A JSON string. */
static void put_text(FILE *f, const char *before, const char *text, const char *after) {
    cJSON *node = cJSON_CreateString(text);
    char *quoted = node ? cJSON_PrintUnformatted(node) : NULL;
    fprintf(f, "%s%s%s", before, quoted ? quoted : "\"\"", after);
    free(quoted);
    cJSON_Delete(node);
}

static void put_head(FILE *f, const bst_new_request *q, const bst_new_scene *s) {
    char utc[48], text[512];
    bst_time_to_utc(s->epoch, 0, utc, sizeof utc);
    fprintf(f, "{\n    \"boresight\": 1,\n");
    put_text(f, "    \"name\": ", q->name, ",\n");
    snprintf(text, sizeof text,
             "%s follows %s: %.0f km away or more, at up to %.3g arcsec/s among the stars, V %.1f. "
             "The epoch is a time at which it is in sunlight and clear of Earth, Moon and Sun for "
             "all of the run.%s",
             q->observer.name, q->target.name, 1e-3 * s->range_m, s->rate_arcsec_per_s, s->v_mag,
             s->few_stars
                 ? " The field holds too few stars for an attitude: the target is followed "
                   "with the attitude telemetry alone."
                 : "");
    put_text(f, "    \"description\": ", text, ",\n");
    fprintf(f,
            "    \"epoch_utc\": \"%s\",\n    \"duration_s\": %.6g,\n    \"tick_rate_hz\": 6000,\n"
            "    \"seed\": \"0x1\",\n",
            utc, s->duration_s);
}

static void put_orbit(FILE *f, const char *indent, const bst_new_satellite *one) {
    fprintf(f, "%s\"orbit\": {\n%s    \"source\": \"sgp4\",\n%s    ", indent, indent, indent);
    put_text(f, "\"tle_line1\": ", one->line1, ",\n");
    fprintf(f, "%s    ", indent);
    put_text(f, "\"tle_line2\": ", one->line2, "\n");
    fprintf(f, "%s},\n", indent);
}

static void put_camera(FILE *f, const bst_new_request *q, const bst_new_scene *s) {
    fprintf(f,
            "                    \"camera\": {\n"
            "                        \"description\": \"A silicon detector behind a telescope of "
            "this aperture. photon_flux_v0_per_s_m2: of a star of V = 0 over the band, above the "
            "air.\",\n"
            "                        \"width_px\": %d,\n"
            "                        \"height_px\": %d,\n",
            s->side_px, s->side_px);
    if (q->focal_m > 0.0) {
        fprintf(f,
                "                        \"pixel_pitch_um\": %.6g,\n"
                "                        \"focal_length_m\": %.9g,\n",
                BST_NEW_PIXEL_UM, q->focal_m);
    } else {
        fprintf(f, "                        \"pixel_scale_arcsec\": %.9g,\n", s->pixel_arcsec);
    }
    fprintf(f,
            "                        \"aperture_m\": %.9g,\n"
            "                        \"obscuration\": 0,\n"
            "                        \"throughput\": %g,\n"
            "                        \"quantum_efficiency\": %g,\n"
            "                        \"photon_flux_v0_per_s_m2\": %.3g,\n"
            "                        \"psf_fwhm_px\": %g,\n"
            "                        \"background_mag_arcsec2\": %g,\n"
            "                        \"dark_current_e_per_s\": %g,\n"
            "                        \"read_noise_e\": %g,\n"
            "                        \"full_well_e\": %.0f,\n"
            "                        \"gain_e_per_dn\": 1.6,\n"
            "                        \"offset_dn\": 500,\n"
            "                        \"bits\": 16\n"
            "                    },\n",
            q->aperture_m, BST_NEW_THROUGHPUT, BST_NEW_QUANTUM_EFFICIENCY, BST_NEW_FLUX_V0,
            BST_NEW_FWHM_PX, BST_NEW_SKY_MAG_ARCSEC2, BST_NEW_DARK_E_PER_S, BST_NEW_READ_NOISE_E,
            BST_NEW_FULL_WELL_E);
}

static void put_cue(FILE *f, const bst_new_request *q, const bst_new_scene *s) {
    double field_deg = s->side_px * s->pixel_arcsec / 3600.0;
    fprintf(
        f,
        "                    \"exposure\": {\"exposure_s\": %.6g, \"period_s\": %.6g},\n"
        "                    \"cue\": {\n"
        "                        \"description\": \"What the sensor knows of the target "
        "beforehand: its predicted direction, wrong by offset_deg, and how uncertain it is.\",\n",
        s->exposure_s, s->period_s);
    put_text(f, "                        \"object\": ", q->target.name, ",\n");
    fprintf(f,
            "                        \"offset_deg\": %.3g,\n"
            "                        \"sigma_deg\": %.3g,\n"
            "                        \"rate_sigma_arcsec_per_s\": %.3g,\n"
            "                        \"v_mag\": %.1f,\n"
            "                        \"v_mag_sigma\": 1\n"
            "                    },\n",
            0.1 * field_deg, 0.1 * field_deg, fmax(0.5, 0.01 * s->rate_arcsec_per_s),
            isfinite(s->v_mag) ? s->v_mag : 10.0);
}

/* RMS per axis of the jitter about its mean in an exposure, as imgproc takes it: of the power at a
 * frequency f the mean over the exposure T keeps the share (sin(pi f T) / (pi f T))^2. */
static double jitter_in_exposure_px(double exposure_s) {
    enum { STEPS = 2000 };
    double kept = 0.0;
    for (int k = 0; k < STEPS; k++) {
        const double share = (k + 0.5) / STEPS;
        const double phase =
            BST_PI * exposure_s * (JITTER_LOW_HZ + share * (JITTER_HIGH_HZ - JITTER_LOW_HZ));
        kept += phase > 0.0 ? pow(sin(phase) / phase, 2.0) / STEPS : 1.0 / STEPS;
    }
    return JITTER_PX * sqrt(0.5 * (1.0 - kept));
}

static void put_modules(FILE *f, const bst_new_scene *s) {
    double period = s->period_s;
    double image_s = fmin(0.15, 0.3 * period), tracks_s = fmin(0.2, 0.2 * period),
           command_s = fmin(0.05, 0.1 * period);
    bool orbit = s->rate_arcsec_per_s >= ORBIT_RATE_ARCSEC_PER_S;
    fprintf(f,
            "                    \"modules\": {\n"
            "                        \"gimbal\": {\n"
            "                            \"description\": \"A two-axis mount on a platform that "
            "shakes. delay_s, here and below: how long it works and waits.\",\n"
            "                            \"type\": \"second_order\",\n");
    if (orbit) {
        fprintf(f,
                "                            \"rate_limit_degps\": 5,\n"
                "                            \"accel_limit_degps2\": 5,\n");
    }
    fprintf(
        f,
        "                            \"delay_s\": {\"los_command\": %.4g},\n"
        "                            \"platform\": {\n"
        "                                \"drift_arcsec_per_s\": [1, -1, 0],\n"
        "                                \"jitter_low_px_rms\": 0.2,\n"
        "                                \"jitter_low_cutoff_hz\": 0.05,\n"
        "                                \"jitter_high_px_rms\": %.4g,\n"
        "                                \"jitter_high_band_hz\": [%.4g, %.4g]\n"
        "                            }\n"
        "                        },\n"
        "                        \"scenegen\": {\"type\": \"opencl\"},\n"
        "                        \"imgproc\": {\"type\": \"standard\", \"delay_s\": {\"frame\": "
        "%.4g}, \"jitter_px\": %.2g},\n",
        command_s, JITTER_PX, JITTER_LOW_HZ, JITTER_HIGH_HZ, image_s,
        jitter_in_exposure_px(s->exposure_s));
    fprintf(f,
            "                        \"tracker\": {\"type\": \"ekf\", "
            "\"telemetry_sigma_arcsec\": %.3g%s",
            fmin(3.0, s->pixel_arcsec), orbit ? ", \"motion\": \"orbit\"" : "");
    if (period > 1.5) {
        fprintf(f, ", \"initiation_gap_s\": %.6g", 3.5 * period);
    }
    fprintf(f,
            "},\n                        \"control\": {\n"
            "                            \"description\": \"Searches about the cue, acquires and "
            "follows; exposure_s is that of its commands.\",\n"
            "                            \"type\": \"standard\",\n"
            "                            \"delay_s\": {\"tracks\": %.4g},\n",
            tracks_s);
    if (period > 1.5) {
        fprintf(f,
                "                            \"dwell_timeout_s\": %.6g,\n"
                "                            \"acquire_timeout_s\": %.6g,\n"
                "                            \"reacquire_coast_s\": %.6g,\n",
                20.0 * period, 20.0 * period, 20.0 * period);
    }
    fprintf(f,
            "                            \"command_latency_s\": %.4g,\n"
            "                            \"exposure_s\": %.6g\n"
            "                        }\n"
            "                    }\n",
            command_s, s->exposure_s);
}

void bst_new_scenario_write(FILE *f, const bst_new_request *q, const bst_new_scene *s) {
    put_head(f, q, s);
    fprintf(f,
            "    \"world\": {\n        \"star_catalogue\": \"default\",\n"
            "        \"objects\": [\n            {\n"
            "                \"description\": \"A sphere of this cross-section and albedo; "
            "brightness can be a standard magnitude or a light curve, too.\",\n");
    put_text(f, "                \"name\": ", q->target.name, ",\n");
    put_orbit(f, "                ", &q->target);
    fprintf(f,
            "                \"area_m2\": %g,\n                \"albedo\": %g\n            }\n"
            "        ]\n    },\n    \"observers\": [\n        {\n",
            BST_NEW_AREA_M2, BST_NEW_ALBEDO);
    put_text(f, "            \"name\": ", q->observer_label, ",\n");
    put_orbit(f, "            ", &q->observer);
    fprintf(f,
            "            \"sensors\": [\n                {\n"
            "                    \"name\": \"telescope\",\n");
    put_camera(f, q, s);
    put_cue(f, q, s);
    put_modules(f, s);
    fprintf(f,
            "                }\n            ]\n        }\n    ],\n"
            "    \"record\": {\"frames\": \"extensions\"}\n}\n");
}
