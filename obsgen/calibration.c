#include "obsgen/calibration.h"

#include <assert.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cjson/cJSON.h>

#include "obsgen/model/place_error.h"
#include "sim/core/invariant.h"
#include "sim/io/manifest.h"

const double bst_obsgen_lengths_px[BST_OBSGEN_LENGTHS] = {0.0, 5.0, 20.0, 60.0};
const double bst_obsgen_snrs[BST_OBSGEN_SNRS] = {5.0, 7.0, 10.0, 20.0, 50.0, 200.0};

#define C bst_obsgen_calibration
const bst_config_desc bst_obsgen_calibration_table[] = {
    {.key = "boresight_obsgen",
     .type = BST_CONFIG_INT,
     .unit = "",
     .minimum = 1,
     .maximum = 1e6,
     .doc = "Version of this format.",
     .offset = offsetof(C, version),
     .size = sizeof(int64_t)},
    BST_STRING(C, made_from, "\"\"", "What it was measured on."),
    BST_REAL(C, threshold_offset, "", -3, 3, NULL,
             "Image processing's threshold less that of theory, SNR."),
    BST_REAL(C, noise_factor, "", 0.1, 10, NULL, "Noise that it measures over that of theory."),
    BST_REAL(C, background_fraction, "", 0, 10, NULL,
             "Share of sources' mean light below its clip that its background contains."),
    BST_FORMER("background_share", "background_fraction"),
    BST_REAL(C, crowding, "", 0, 10, NULL,
             "Share of the mean square of that light that its noise contains."),
    BST_REALS(C, gain, "", 0.1, 2, NULL,
              "SNR at the filter's greatest output over the ideal, at streak lengths of 0, 5, 20 "
              "and 60 px."),
    BST_REAL(C, slope, "", 0.1, 5, NULL, "Slope of the probit of Pd by SNR; ideal: 1."),
    BST_REAL(C, false_alarm_factor, "", 0, 1000, NULL,
             "False alarms over what the threshold was set for."),
    BST_REAL(C, false_alarm_steepness, "", 0.01, 10, NULL,
             "Steepness of the SNR of false alarms above the threshold T: P(> u) = exp(-tail (u^2 "
             "- T^2) / 2)."),
    BST_FORMER("false_alarm_tail", "false_alarm_steepness"),
    BST_REALS(
        C, across_factor, "", 0.1, 20, NULL,
        "RMS error of a point's place, and of a streak's across it, over the bound, at SNR 5, "
        "7, 10, 20, 50 and 200."),
    BST_REALS(C, along_factor, "", 0.1, 20, NULL, "The same along a streak."),
    BST_REAL(C, phase_bias_px, "px", -1, 1, NULL,
             "Amplitude of the bias of a place by where in the pixel it is: bias = amplitude sin(2 "
             "pi place)."),
    BST_REAL(C, blend_distance_factor, "", 0.1, 10, NULL,
             "Distance at which two sources are resolved, over that at which the saddle between "
             "them is deep enough without noise."),
    BST_REAL(C, star_id_probability, "", 0, 1, NULL,
             "Probability that a detected catalogue star is identified where stars are."),
    BST_REAL(C, cosmic_ray_flag_probability, "", 0, 1, NULL,
             "Probability that a radiation hit with one pixel that stands out is recognised."),
    BST_FORMER("hit_told_probability", "cosmic_ray_flag_probability"),
    BST_CONFIG_END};
#undef C

void bst_obsgen_calibration_theory(bst_obsgen_calibration *out) {
    *out = (bst_obsgen_calibration){.version = BST_OBSGEN_CALIBRATION_VERSION,
                                    .made_from = "theory",
                                    .noise_factor = 1.0,
                                    .background_fraction = 1.0,
                                    .crowding = 1.0,
                                    .gain = {1.0, 1.0, 1.0, 1.0},
                                    .slope = 1.0,
                                    .false_alarm_factor = 1.0,
                                    .false_alarm_steepness = 1.0,
                                    .along_factor = {1, 1, 1, 1, 1, 1},
                                    .blend_distance_factor = 1.0,
                                    .star_id_probability = 1.0,
                                    .cosmic_ray_flag_probability = 1.0};
    memcpy(out->across_factor, bst_place_error_core, sizeof out->across_factor);
}

bst_status bst_obsgen_calibration_read(bst_ctx *ctx, const char *path,
                                       bst_obsgen_calibration *out) {
    bst_json *json = NULL;
    BST_TRY(bst_json_load(ctx, path, &json));
    const cJSON *version =
        cJSON_GetObjectItemCaseSensitive(bst_json_root(json), "boresight_obsgen");
    bst_status status = BST_OK;
    if (!version) {
        status = bst_fail(ctx, BST_ERR_FORMAT,
                          "%s: /boresight_obsgen: missing: this is no calibration of the "
                          "observation generator; make one with `boresight calibrate-obsgen`",
                          path);
    } else if (!cJSON_IsNumber(version) ||
               version->valuedouble != (double)BST_OBSGEN_CALIBRATION_VERSION) {
        status = bst_fail(ctx, BST_ERR_FORMAT,
                          "%s: /boresight_obsgen: this program reads version %d; make the "
                          "calibration anew with `boresight calibrate-obsgen`",
                          path, BST_OBSGEN_CALIBRATION_VERSION);
    }
    if (status == BST_OK) {
        status =
            bst_config_read(ctx, json, bst_json_root(json), "", bst_obsgen_calibration_table, out);
    }
    bst_json_free(json);
    return status;
}

bst_status bst_obsgen_calibration_write(bst_ctx *ctx, const char *path,
                                        const bst_obsgen_calibration *calibration) {
    cJSON *root = bst_config_echo(bst_obsgen_calibration_table, calibration);
    char *text = root ? cJSON_Print(root) : NULL;
    bst_status status = text ? bst_io_write_file_atomic(ctx, path, text, strlen(text))
                             : bst_fail(ctx, BST_ERR_MEMORY, "out of memory for %s", path);
    free(text);
    cJSON_Delete(root);
    return status;
}

double bst_obsgen_peak(double snr, double gain) {
    /* SNR at which the gain is given; least one at which the source determines the peak */
    static const double GAIN_SNR = 5.0, LEAST_SNR = 3.0;
    return snr + (gain - 1.0) * GAIN_SNR * GAIN_SNR / fmax(snr, LEAST_SNR);
}

double bst_obsgen_between(const double *nodes, const double *values, int count, double at) {
    assert(nodes && values && count >= 2 && bst_is_ascending(nodes, count));
    if (at <= nodes[0]) {
        return values[0];
    }
    for (int i = 1; i < count; i++) {
        if (at <= nodes[i]) {
            double part = (at - nodes[i - 1]) / (nodes[i] - nodes[i - 1]);
            return values[i - 1] + part * (values[i] - values[i - 1]);
        }
    }
    return values[count - 1];
}
