/* Tabulated power spectral densities, and the jitter configuration that uses them. */
#ifndef BST_GIMBAL_JITTER_JITTER_TABLE_H
#define BST_GIMBAL_JITTER_JITTER_TABLE_H

#include "boresight/config.h"

/* A point of a one-sided density. */
typedef struct bst_jitter_density_point {
    double frequency_hz, psd;
} bst_jitter_density_point;

/* Tabulated density: linear between points on log-log axes (on linear axes if an end is zero), zero
 * outside. */
typedef struct bst_jitter_density {
    const bst_jitter_density_point *points; /* lent; ascending frequencies */
    int count;                              /* 0: no density */
} bst_jitter_density;

/* One-sided spectral density at a frequency, between the points as the table interpolates; 0
 * outside. */
double bst_jitter_density_at(const bst_jitter_density *density, double frequency_hz);
/* Integral of the density from low_hz to high_hz, closed form. */
double bst_jitter_density_integral(const bst_jitter_density *density, double low_hz,
                                   double high_hz);
/* Highest frequency of the table; 0 when it is empty. */
double bst_jitter_density_top_hz(const bst_jitter_density *density);

/* Configured harmonic line: amplitude * sin(2 pi (frequency_hz t + phase)). */
typedef struct bst_jitter_line_config {
    double frequency_hz, amplitude;
    int32_t axis; /* 0 x, 1 y, 2 both (independent random phases) */
    bool random_phase;
    double phase_deg;
} bst_jitter_line_config;

/* "jitter_psd" block of a platform. */
typedef struct bst_jitter_psd_config {
    int32_t unit;              /* 0 px, 1 arcsec */
    bst_config_list low, high; /* bst_jitter_density_point; per axis, unit^2/Hz */
    char low_file[512], high_file[512];
    double y_scale;        /* ratio of the y density to the x density */
    bst_config_list lines; /* bst_jitter_line_config */
} bst_jitter_psd_config;

extern const bst_config_desc bst_jitter_psd_config_table[];

/* Reads a density table from a text file: two numbers per line (frequency in Hz, density),
 * separated by blanks or a comma. Empty lines and text after # are ignored.
 *
 * Errors:    BST_ERR_FORMAT with file and line
 * Ownership: the caller frees *points */
bst_status bst_jitter_density_load(bst_ctx *ctx, const char *path,
                                   bst_jitter_density_point **points, int *count) BST_MUST_CHECK;
/* Checks a density: at least two points, ascending frequencies >= 0, densities >= 0. Errors:
 * BST_ERR_CONFIG, naming `what`. */
bst_status bst_jitter_density_check(bst_ctx *ctx, const char *what,
                                    const bst_jitter_density *density) BST_MUST_CHECK;

#endif
