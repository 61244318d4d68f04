/* Configuration block `camera.detector`: detector effects. Every effect is off by default. */
#ifndef BORESIGHT_DETECTOR_CONFIG_H
#define BORESIGHT_DETECTOR_CONFIG_H

#include "boresight/config.h"

#pragma GCC visibility push(default)

/* Charge above the full well. */
enum { BST_WELL_CLIP, BST_WELL_BLOOM };
/* Coding of the converter's numbers. */
enum { BST_QUANTISE_UNIFORM, BST_QUANTISE_SQUARE_ROOT, BST_QUANTISE_TABLE };

/* Hits of energetic particles (cosmic rays). */
typedef struct bst_detector_cosmic_ray_config {
    double rate_per_cm2_s;           /* through the detector's surface, from both sides */
    double pixel_pitch_um, depth_um; /* pixel side, and thickness of the sensitive layer */
    double e_per_um;                 /* most probable charge per path */
    double straggling; /* width of the Landau-like spread over the most probable value */
    double readout_s;  /* additional collection time of hits: transfer and read-out */
} bst_detector_cosmic_ray_config;

typedef struct bst_detector_quantisation_config {
    int32_t model;   /* BST_QUANTISE_... */
    int64_t bits;    /* of the codes, square root */
    char table[512]; /* file: first converter number of each code */
    bool expand;     /* the frame has the mean converter number of each code instead of the code */
} bst_detector_quantisation_config;

typedef struct bst_detector_config {
    double temperature_c, reference_temperature_c, dark_doubling_k;
    double prnu_rms;
    char prnu_map[512];
    double dsnu_rms;
    char dark_map[512];
    double hot_fraction, hot_median_e_per_s, hot_spread_dex;
    double dead_fraction;
    int64_t bad_columns;
    uint64_t fixed_pattern_seed;
    double column_offset_rms_e, row_offset_rms_e, row_noise_e;
    double telegraph_noise_fraction, telegraph_noise_rms_e;
    double nonlinearity[3];
    int32_t saturation; /* BST_WELL_... */
    double frame_transfer_s;
    double row_time_s; /* rolling shutter */
    bst_detector_cosmic_ray_config cosmic_rays;
    bst_detector_quantisation_config quantisation;
} bst_detector_config;

extern const bst_config_desc bst_detector_table[];

/* Dark current at `temperature_c` over that at the reference temperature. It doubles with every
 * dark_doubling_k; 1 for a block of zeros. */
double bst_detector_dark_factor(const bst_detector_config *d);

/* True if rendering needs whole columns of the sensor, because of blooming or frame transfer. */
bool bst_detector_config_whole_columns(const bst_detector_config *d);

/* Checks for effects that exclude each other.
 *
 * Errors:    BST_ERR_CONFIG, with the key: a rolling shutter beside frame transfer or blooming */
bst_status bst_detector_config_check(bst_ctx *ctx, const bst_detector_config *d) BST_MUST_CHECK;

/* Rolling shutter: time from the exposure of a window's middle row to that of its first or last
 * row, s.
 *
 * Given:     rows  rows of the window, 1 or more
 * Notes:     row n = 0, 1, ... of the window is exposed (n - (rows - 1) / 2) row_time_s after the
 *            times that the exposure's ticks give. */
double bst_detector_lead_s(const bst_detector_config *d, int rows);

/* bst_detector_lead_s in ticks, rounded up.
 *
 * Given:     rows          rows of the window, 1 or more
 *            tick_rate_hz  ticks per second */
int64_t bst_detector_lead_ticks(const bst_detector_config *d, int rows, double tick_rate_hz);

#pragma GCC visibility pop

#endif
