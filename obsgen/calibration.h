/* What the generator takes from measurement of the image path: factors on what theory gives. */
#ifndef BST_OBSGEN_CALIBRATION_H
#define BST_OBSGEN_CALIBRATION_H

#include "boresight/config.h"

enum { BST_OBSGEN_CALIBRATION_VERSION = 4, BST_OBSGEN_LENGTHS = 4, BST_OBSGEN_SNRS = 6 };

/* Streak lengths (px) and SNRs at which the tables below stand; between them straight, beyond them
 * the ends hold. */
extern const double bst_obsgen_lengths_px[BST_OBSGEN_LENGTHS];
extern const double bst_obsgen_snrs[BST_OBSGEN_SNRS];

typedef struct bst_obsgen_calibration {
    int64_t version;
    char made_from[400];                   /* for people: scenarios and program */
    double threshold_offset;               /* image processing's threshold less theory's */
    double noise_factor;                   /* its noise over theory's */
    double background_fraction;            /* of the light below its clip that its background has */
    double crowding;                       /* share of that light's square that its noise has */
    double gain[BST_OBSGEN_LENGTHS];       /* SNR at the filter over the ideal, by streak length */
    double slope;                          /* of the probit of Pd by SNR; ideal: 1 */
    double false_alarm_factor;             /* rate over what the threshold was set for */
    double false_alarm_steepness;          /* P(SNR > u) = exp(-tail (u^2 - T^2) / 2) */
    double across_factor[BST_OBSGEN_SNRS]; /* RMS of the place over the bound: points, across */
    double along_factor[BST_OBSGEN_SNRS];  /* along a streak */
    double phase_bias_px;                  /* amplitude of the bias by place in the pixel */
    double blend_distance_factor;          /* of the distance at which two sources are told apart */
    double star_id_probability;            /* that a catalogue star is identified, stars found */
    double cosmic_ray_flag_probability;    /* that a radiation hit is told from a source */
} bst_obsgen_calibration;

extern const bst_config_desc bst_obsgen_calibration_table[];

/* What theory says without measurement. */
void bst_obsgen_calibration_theory(bst_obsgen_calibration *out);
/* From a file that `boresight calibrate-obsgen` wrote. Errors name file, key and what is allowed;
 * another version: that the command writes a new one. */
bst_status bst_obsgen_calibration_read(bst_ctx *ctx, const char *path,
                                       bst_obsgen_calibration *out) BST_MUST_CHECK;

/* Writes a calibration as JSON, the whole file or nothing.
 *
 * Errors:    BST_ERR_IO, BST_ERR_MEMORY */
bst_status bst_obsgen_calibration_write(bst_ctx *ctx, const char *path,
                                        const bst_obsgen_calibration *calibration) BST_MUST_CHECK;

/* A table's value between its nodes. */
double bst_obsgen_between(const double *nodes, const double *values, int count, double at);

#endif
