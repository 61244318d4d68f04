/* Power spectral densities as tables, and what a scenario says of jitter by them. */
#ifndef BST_GIMBAL_JITTER_JITTER_TABLE_H
#define BST_GIMBAL_JITTER_JITTER_TABLE_H

#include "boresight/config.h"

/* One point of a one-sided density. */
typedef struct bst_jitter_density_point {
    double frequency_hz, psd;
} bst_jitter_density_point;

/* Straight lines in the logarithms between points (in the values themselves where an end is zero),
 * nothing outside of them. */
typedef struct bst_jitter_density {
    const bst_jitter_density_point *points; /* lent; frequencies rise */
    int count;                              /* 0: nothing */
} bst_jitter_density;

/* One-sided spectral density at a frequency, between the points as the table interpolates; 0
 * outside. */
double bst_jitter_density_at(const bst_jitter_density *density, double frequency_hz);
/* Integral from low_hz to high_hz, closed form. */
double bst_jitter_density_integral(const bst_jitter_density *density, double low_hz,
                                   double high_hz);
/* Highest frequency of the table; 0 when it is empty. */
double bst_jitter_density_top_hz(const bst_jitter_density *density);

/* A harmonic line: amplitude * sin(2 pi (frequency_hz t + phase)). */
typedef struct bst_jitter_line_config {
    double frequency_hz, amplitude;
    int32_t axis; /* 0 x, 1 y, 2 both (phases of their own where random) */
    bool random_phase;
    double phase_deg;
} bst_jitter_line_config;

/* The "jitter_psd" block of a platform. */
typedef struct bst_jitter_psd_config {
    int32_t unit;              /* 0 px, 1 arcsec */
    bst_config_list low, high; /* bst_jitter_density_point; per axis, unit^2/Hz */
    char low_file[512], high_file[512];
    double y_scale;        /* density of y over that of x */
    bst_config_list lines; /* bst_jitter_line_config */
} bst_jitter_psd_config;

extern const bst_config_desc bst_jitter_psd_config_table[];

/* Reads a table from a text file: two numbers a line (frequency in Hz, density), separated by
 * blanks or a comma; empty lines and what follows a # are passed over. *points is the caller's to
 * free. BST_ERR_FORMAT with file and line. */
bst_status bst_jitter_density_load(bst_ctx *ctx, const char *path,
                                   bst_jitter_density_point **points, int *count) BST_MUST_CHECK;
/* BST_ERR_CONFIG, naming `what`, unless there are at least two points, frequencies rise from zero
 * or above, and densities are not negative. */
bst_status bst_jitter_density_check(bst_ctx *ctx, const char *what,
                                    const bst_jitter_density *density) BST_MUST_CHECK;

#endif
