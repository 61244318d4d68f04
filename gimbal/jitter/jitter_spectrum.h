/* Spectrum of a platform's jitter: flat bands, tables and harmonic lines. */
#ifndef BST_GIMBAL_JITTER_JITTER_SPECTRUM_H
#define BST_GIMBAL_JITTER_JITTER_SPECTRUM_H

#include "gimbal/jitter/jitter.h"
#include "gimbal/jitter/jitter_table.h"

enum { BST_JITTER_SPECTRUM_LINES = 64 };

/* Harmonic line about one axis: amplitude_rad * sin(2 pi (frequency_hz t + phase_cycles)). */
typedef struct bst_jitter_line {
    int axis; /* 0 x, 1 y */
    double frequency_hz, amplitude_rad;
    double phase_cycles; /* negative: random */
} bst_jitter_line;

typedef struct bst_jitter_spectrum {
    bst_jitter_spec flat;         /* flat bands */
    bst_jitter_density low, high; /* about x, rad^2/Hz; their points are owned */
    double y_scale;               /* ratio of the tables' density about y to that about x */
    int line_count;
    bst_jitter_line line[BST_JITTER_SPECTRUM_LINES];
} bst_jitter_spectrum;

/* Creates a spectrum from flat bands and a "jitter_psd" block.
 *
 * Given:     pixel_rad  angle of a pixel
 * Errors:    BST_ERR_CONFIG with the key for invalid or duplicate tables; those of
 *            bst_jitter_density_load. On error nothing is owned
 * Ownership: free with bst_jitter_spectrum_free */
bst_status bst_jitter_spectrum_create(bst_ctx *ctx, const bst_jitter_spec *flat,
                                      const bst_jitter_psd_config *config, double pixel_rad,
                                      bst_jitter_spectrum *out) BST_MUST_CHECK;
/* Frees the memory of a spectrum and clears the struct, which belongs to the caller. */
void bst_jitter_spectrum_free(bst_jitter_spectrum *spectrum);

/* True if the spectrum has tables or lines besides the flat bands. */
bool bst_jitter_spectrum_is_more(const bst_jitter_spectrum *spectrum);

/* One-sided jitter density about an axis (0 x, 1 y) at a frequency, rad^2/Hz, without harmonic
 * lines. */
double bst_jitter_spectrum_at(const bst_jitter_spectrum *spectrum, int axis, double frequency_hz);
/* Jitter variance from low_hz to high_hz, including harmonic lines, rad^2. */
double bst_jitter_spectrum_variance(const bst_jitter_spectrum *spectrum, int axis, double low_hz,
                                    double high_hz);

/* Variance of tables and lines, rad^2, mean of the axes, that linear interpolation between samples
 * dt_s apart lacks below BST_JITTER_RESOLVED / dt_s (bst_jitter_unresolved_rad2: for the flat
 * bands). */
double bst_jitter_spectrum_unresolved_rad2(const bst_jitter_spectrum *spectrum, double dt_s);

/* Adds the tables and lines of a spectrum to a jitter, which then owns memory (bst_jitter_free). It
 * keeps no reference to the spectrum. */
bst_status bst_jitter_add(bst_ctx *ctx, bst_jitter *jitter, const bst_jitter_spectrum *spectrum,
                          bst_rng_key key) BST_MUST_CHECK;

#endif
