/* What bias, dark and flat frames say of a sensor. */
#ifndef BST_ANALYSIS_CHARACTERIZE_SENSOR_FIGURES_H
#define BST_ANALYSIS_CHARACTERIZE_SENSOR_FIGURES_H

#include "sim/analysis/characterize/frame_stack.h"
#include "sim/analysis/characterize/hot_pixels.h"
#include "sim/analysis/characterize/linearity_fit.h"
#include "sim/analysis/characterize/pick_up_line.h"
#include "sim/analysis/characterize/trap_correction.h"

/* Quantities, in the order of the report. */
typedef enum bst_sensor_figure {
    BST_SENSOR_GAIN,
    BST_SENSOR_READ_NOISE,
    BST_SENSOR_OFFSET,
    BST_SENSOR_OFFSET_DRIFT,
    BST_SENSOR_ROW_NOISE,
    BST_SENSOR_COLUMN_OFFSET,
    BST_SENSOR_ROW_OFFSET,
    BST_SENSOR_DARK,
    BST_SENSOR_DARK_MEDIAN,
    BST_SENSOR_DSNU,
    BST_SENSOR_HOT_FRACTION,
    BST_SENSOR_HOT_MEDIAN,
    BST_SENSOR_HOT_SPREAD,
    BST_SENSOR_PRNU,
    BST_SENSOR_DEAD_FRACTION,
    BST_SENSOR_BAD_COLUMNS,
    BST_SENSOR_RAMP,
    BST_SENSOR_READOUT,
    BST_SENSOR_LINE_FREQUENCY,
    BST_SENSOR_LINE_AMPLITUDE,
    BST_SENSOR_LINE_PHASE,
    BST_SENSOR_PARALLEL_TRAIL,
    BST_SENSOR_SERIAL_TRAIL,
    BST_SENSOR_FULL_WELL,
    BST_SENSOR_SATURATION,
    BST_SENSOR_LINEARITY_ERROR,
    BST_SENSOR_NONLINEARITY_1,
    BST_SENSOR_NONLINEARITY_2,
    BST_SENSOR_NONLINEARITY_3,
    BST_SENSOR_HIT_RATE,
    BST_SENSOR_HIT_READOUT,
    BST_SENSOR_HIT_CHARGE,
    BST_SENSOR_HIT_LENGTH,
    BST_SENSOR_HIT_DEPTH,
    BST_SENSOR_HIT_E_PER_UM,
    BST_SENSOR_HIT_STRAGGLING,
    BST_SENSOR_DARK_DOUBLING,
    BST_SENSOR_FIGURES
} bst_sensor_figure;

enum { BST_SENSOR_PERCENTILES = 8 };
/* Percentiles of the dark current that are reported. */
extern const double bst_sensor_percentiles[BST_SENSOR_PERCENTILES];

/* Frames of a sensor; a stack without frames has count 0. */
typedef struct bst_sensor_stacks {
    bst_frame_stack bias, dark, flat;
    bst_frame_stack warm;           /* darks at another temperature */
    double warmer_k;                /* by how much, above that of `dark` */
    bst_frame_stack simulated;      /* frames made with the figures, to compare with the real */
    bst_linearity_series linearity; /* without any: count 0 */
    double pixel_pitch_um;          /* side of a pixel, for areas and lengths of radiation hits */
} bst_sensor_stacks;

/* Results. */
typedef struct bst_sensor_figures {
    bst_sensor_estimate figures[BST_SENSOR_FIGURES];
    const char *method[BST_SENSOR_FIGURES]; /* how it was found, or why it was not; static text */
    bool gain_of_header;
    bool noise_of_pairs; /* read noise by differences of frames, otherwise of neighbours */
    int width, height;
    int shielded_columns; /* columns of the image that gather no dark current */
    double percentiles_e_per_s[BST_SENSOR_PERCENTILES]; /* of the dark current; NAN: no dark */
    int64_t hot_found;
    double hot_limit_e_per_s;
    bst_charge_trail trail;
    bst_trap_model traps;  /* that leave the trails; none if they are not certain */
    double trap_misfit[2]; /* RMS of parallel and serial ones, shares of charge */
    bst_pick_up_line line;
    bst_linearity linearity; /* used 0: no series */
    float *dark_map;         /* [height][width] e-/s; NULL: none */
    float *prnu_map;         /* [height][width] relative to 1; NULL: none */
} bst_sensor_figures;

/* Computes what the frames determine; the rest is NAN with its reason in `method`.
 *
 * Errors:    BST_ERR_ARGUMENT: frames of different kinds have different sizes; BST_ERR_MEMORY
 * Ownership: free with bst_sensor_figures_free, also after an error
 * Reference: Janesick 2007, Photon Transfer, chapters 5, 7 and 11 */
bst_status bst_sensor_figures_compute(bst_ctx *ctx, const bst_sensor_stacks *stacks,
                                      bst_sensor_figures *out) BST_MUST_CHECK;
/* Frees maps and spectrum. */
void bst_sensor_figures_free(bst_sensor_figures *figures);

/* 95 % interval of an estimate from 64 blocks or fewer: +-2.1 standard errors, Student's t with 20
 * degrees of freedom. */
#define BST_SENSOR_T95 2.09
/* The 95 % interval of a figure.
 *
 * Notes:     Figures of radiation hits come from few counts, or from a fit of logarithms: their
 *            interval is that of the logarithm, value * exp(-+2.1 sigma / value). */
void bst_sensor_interval(const bst_sensor_figures *figures, bst_sensor_figure which, double *low,
                         double *high);

/* Level of a pixel without charge: mean of the bias frames, or of the overscan.
 *
 * Returned:  false: neither is there */
bool bst_sensor_has_level(const bst_sensor_stacks *stacks);

/* Figures of bias frames and overscan: gain excepted, in DN until bst_sensor_to_electrons. */
bst_status bst_sensor_measure_noise(bst_ctx *ctx, const bst_sensor_stacks *stacks,
                                    bst_sensor_figures *out) BST_MUST_CHECK;
/* Linearity, full well, and gain of flats of several exposures. */
bst_status bst_sensor_measure_linearity(bst_ctx *ctx, const bst_sensor_stacks *stacks,
                                        bst_sensor_figures *out) BST_MUST_CHECK;
/* Temperature step that doubles the dark current. */
bst_status bst_sensor_measure_warm(bst_ctx *ctx, const bst_sensor_stacks *stacks,
                                   bst_sensor_figures *out) BST_MUST_CHECK;
/* Rate, charge and length of radiation hits. */
void bst_sensor_measure_hits(const bst_sensor_stacks *stacks, bst_sensor_figures *out);
/* Gain, PRNU, dead pixels of flats. */
bst_status bst_sensor_measure_flat(bst_ctx *ctx, const bst_sensor_stacks *stacks,
                                   bst_sensor_figures *out) BST_MUST_CHECK;
/* Dark current, hot pixels, ramp, trails. */
bst_status bst_sensor_measure_dark(bst_ctx *ctx, const bst_sensor_stacks *stacks,
                                   bst_sensor_figures *out) BST_MUST_CHECK;

/* Clipped moments of a map's blocks.
 *
 * Given:     clip  as bst_clipped_moments_of
 *            scratch  [width * height]
 * Returned:  mean, variance  [BST_STACK_BLOCKS]; variance may be NULL */
void bst_sensor_block_moments(const float *map, int width, int height, double clip, float *scratch,
                              double *mean, double *variance);

#endif
