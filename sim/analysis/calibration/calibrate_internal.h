/* Internal state of the calibration fit: collected data and functions of both files. */
#ifndef BST_ANALYSIS_CALIBRATION_CALIBRATE_INTERNAL_H
#define BST_ANALYSIS_CALIBRATION_CALIBRATE_INTERNAL_H

#include "obsgen/generator.h"
#include "sim/analysis/calibration/calibrate.h"
#include "sim/analysis/calibration/pairing.h"

/* position errors up to this multiple of the bound are used */
static const double CALIBRATE_MOST_SIGMAS = 2.5;

/* A detection trial: an isolated source near the threshold. */
typedef struct calibrate_trial {
    float amplitude, threshold, length;
    float variance,
        shot; /* noise of the filter output: without the source, and by its photons at SNR 1 */
    /* of a streak, the point filter: its output relative to the amplitude (0: points), threshold,
     * noise, and correlation of the noise */
    float other, other_threshold, other_variance, other_shot, shared_noise;
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
    double nn, nq, qq, ny, qy;       /* least squares of noise^2 by theory and by residual light */
    double light_square, light_bias; /* of the background by the residual light */
    long identified, identifiable;
    long hits, hits_told;
    long frames, detected;
};

#endif
