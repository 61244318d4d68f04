/* Calibration of the observation generator: factors on the theory, measured on the image path. */
#ifndef BST_OBSGEN_CALIBRATION_H
#define BST_OBSGEN_CALIBRATION_H

#include "boresight/config.h"

enum { BST_OBSGEN_CALIBRATION_VERSION = 5, BST_OBSGEN_LENGTHS = 4, BST_OBSGEN_SNRS = 6 };

/* Streak lengths (px) and SNRs of the nodes of the tables below. Between nodes they are
 * interpolated linearly; beyond them the end values apply. */
extern const double bst_obsgen_lengths_px[BST_OBSGEN_LENGTHS];
extern const double bst_obsgen_snrs[BST_OBSGEN_SNRS];

typedef struct bst_obsgen_calibration {
    int64_t version;
    char made_from[400];     /* scenarios and program it was measured with, for information */
    double threshold_offset; /* detection threshold of image processing minus theory, SNR */
    double noise_factor;     /* pixel noise of image processing relative to theory */
    /* share of the sources' light below the clip that enters the background */
    double background_fraction;
    double crowding; /* share of the square of that light that enters the noise */
    /* peak of the matched filter near a source of SNR 5 relative to the ideal output, by streak
     * length; see bst_obsgen_peak */
    double gain[BST_OBSGEN_LENGTHS];
    double slope; /* slope of the probit of the detection probability by SNR; ideal: 1 */
    double false_alarm_factor;    /* false-alarm rate relative to the threshold's design rate */
    double false_alarm_steepness; /* P(SNR > u) = exp(-tail (u^2 - T^2) / 2) */
    /* RMS centroid error relative to the Cramer-Rao bound: points, and across streaks */
    double across_factor[BST_OBSGEN_SNRS];
    /* RMS centroid error along a streak relative to the bound */
    double along_factor[BST_OBSGEN_SNRS];
    double phase_bias_px;         /* amplitude of the centroid bias by sub-pixel position */
    double blend_distance_factor; /* factor on the distance at which two sources are resolved */
    /* probability that a catalogue star is identified if stars are found */
    double star_id_probability;
    double
        cosmic_ray_flag_probability; /* probability that a cosmic-ray hit is recognised as such */
} bst_obsgen_calibration;

extern const bst_config_desc bst_obsgen_calibration_table[];

/* Sets the theoretical calibration: all factors without measurement. */
void bst_obsgen_calibration_theory(bst_obsgen_calibration *out);
/* Reads a calibration file written by `boresight calibrate-obsgen`. Errors name the file, the key
 * and the allowed values; for another version, the command that writes a new file. */
bst_status bst_obsgen_calibration_read(bst_ctx *ctx, const char *path,
                                       bst_obsgen_calibration *out) BST_MUST_CHECK;

/* Writes a calibration as JSON, the whole file or nothing.
 *
 * Errors:    BST_ERR_IO, BST_ERR_MEMORY */
bst_status bst_obsgen_calibration_write(bst_ctx *ctx, const char *path,
                                        const bst_obsgen_calibration *calibration) BST_MUST_CHECK;

/* Mean peak of the filter output near a source, SNR.
 *
 * Given:     snr   output at its place without noise
 *            gain  the peak relative to that at SNR 5
 * Notes:     the noise has a gradient of variance Lambda at the source, and the output a curvature
 * of snr Lambda: the peak is g^2 / (2 snr Lambda) higher, in the mean over both axes 1 / snr. A
 * filter that is flat along a streak, or two filters, leave the peak more room. */
double bst_obsgen_peak(double snr, double gain);

/* Linear interpolation in a table; the end values apply beyond its nodes. */
double bst_obsgen_between(const double *nodes, const double *values, int count, double at);

#endif
