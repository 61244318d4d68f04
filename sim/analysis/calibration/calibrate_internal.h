/* Inside of the calibration, shared by its two files: what is gathered and what is made of it. */
#ifndef BST_ANALYSIS_CALIBRATION_CALIBRATE_INTERNAL_H
#define BST_ANALYSIS_CALIBRATION_CALIBRATE_INTERNAL_H

#include "obsgen/generator.h"
#include "sim/analysis/calibration/calibrate.h"
#include "sim/analysis/calibration/pairing.h"

/* Errors of places over the bound that count. */
static const double CALIBRATE_MOST_SIGMAS = 2.5;

/* A source that stands alone, near the threshold. */
typedef struct calibrate_trial {
    float amplitude, threshold, length;
    float variance,
        shot; /* of the filter's output: without the source, and by its photons, SNR 1 */
    bool detected;
} calibrate_trial;

typedef struct calibrate_mean {
    double sum;
    long count;
} calibrate_mean;

struct bst_calibration_fitter {
    bst_calibration_path path;
    bst_generator *theory;
    double sigma_px;
    bst_crlb_table bound;
    bst_pairing pairing;
    calibrate_trial *trials;
    long trial_count, trial_room;
    double *alarm_energy; /* (u^2 - T^2) / 2 */
    long alarm_count, alarm_room;
    double alarms_expected;
    calibrate_mean across[BST_OBSGEN_SNRS], along[BST_OBSGEN_SNRS];
    double bias_sum, bias_weight;
    double threshold_offset;
    double nn, nq, qq, ny, qy; /* least squares of noise^2 by theory's and by the light left over */
    double light_square, light_bias; /* of background by the light in it */
    long identified, identifiable;
    long hits, hits_told;
    long frames, detected;
};

#endif
