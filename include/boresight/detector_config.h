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

/* Pixels at the edges of the frame: without light (shielded), or that no pixel of the sensor
 * belongs to (overscan). */
typedef struct bst_detector_edges_config {
    int64_t left, right, bottom, top; /* columns, columns, rows, rows */
} bst_detector_edges_config;

/* Coherent pick-up: a sine in the order in which pixels are read. */
typedef struct bst_detector_pick_up_config {
    double amplitude_e, cycles_per_px, cycles_per_row;
    double phase_deg; /* of pixel (0, 0); NAN: random in each frame */
} bst_detector_pick_up_config;

/* Light of the output amplifier, exp(-distance / scale). */
typedef struct bst_detector_glow_config {
    double peak_e; /* at the amplifier, per frame */
    double scale_px, x_px, y_px;
} bst_detector_glow_config;

enum { BST_TRAP_SPECIES = 3 };
/* Traps that charge packets pass on their way along columns or rows. */
typedef struct bst_detector_traps_config {
    double traps_per_px[BST_TRAP_SPECIES]; /* 0: no such species */
    double release_px[BST_TRAP_SPECIES];   /* time constant, in transfers by a pixel */
    double fill_exponent; /* traps that a packet meets grow with its charge to this power */
    double reference_e;   /* charge of a packet that meets traps_per_px */
} bst_detector_traps_config;

enum { BST_PERSISTENCE_SPECIES = 5 };
/* Traps of a pixel that fill while it holds charge, and release it into later frames. */
typedef struct bst_detector_persistence_config {
    double trapped_share[BST_PERSISTENCE_SPECIES];   /* of the charge, after infinite time */
    double time_constant_s[BST_PERSISTENCE_SPECIES]; /* of filling and of release */
} bst_detector_persistence_config;

/* Line through the reads of a ramp. */
enum { BST_RAMP_SLOPE, BST_RAMP_LAST_MINUS_FIRST };
enum { BST_RAMP_READS = 64 };
/* Non-destructive reads during the exposure, whose line is the frame. */
typedef struct bst_detector_ramp_config {
    int64_t reads;          /* at equal distances, from the start to the end; 0: one at the end */
    int32_t fit;            /* BST_RAMP_... */
    double flicker_noise_e; /* 1/f noise of a pixel from read to read, RMS */
} bst_detector_ramp_config;

/* 1/f noise of single pixels, correlated from frame to frame. */
typedef struct bst_detector_pixel_flicker_config {
    double rms_e;
    double lowest_hz, highest_hz; /* equal power in each octave in between */
} bst_detector_pixel_flicker_config;

/* Side of the frame that is read first. */
typedef struct bst_detector_output_config {
    bool right, top; /* the last column, the last row; otherwise column 0, row 0 */
} bst_detector_output_config;

/* Outputs that read equal parts of the rows at the same time. */
typedef struct bst_detector_crosstalk_config {
    int64_t outputs;
    double coupling; /* share of an output's charge that each other output shows */
    bool mirrored;   /* neighbouring parts are read in opposite directions */
} bst_detector_crosstalk_config;

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
    bst_detector_output_config output;
    double readout_s; /* time of the read-out, in which packets gather dark current */
    double clock_induced_e;
    double offset_noise_e, offset_drift_dn_per_frame, flicker_noise_e;
    double reset_noise_e; /* of each pixel, new in every frame */
    double
        double_sampling_s; /* from the read that is subtracted to the one of the frame; 0: none */
    bst_detector_pixel_flicker_config pixel_flicker_noise;
    bst_detector_edges_config shielded, overscan;
    bst_detector_pick_up_config pick_up;
    bst_detector_glow_config glow;
    bst_detector_traps_config parallel_traps, serial_traps;
    bst_detector_persistence_config persistence;
    bst_detector_ramp_config ramp;
    double em_gain; /* 1 or less: no multiplication register */
    double interpixel_coupling, brighter_fatter_per_e;
    bst_detector_crosstalk_config crosstalk;
    bst_detector_cosmic_ray_config cosmic_rays;
    bst_detector_quantisation_config quantisation;
} bst_detector_config;

extern const bst_config_desc bst_detector_table[];

/* Dark current at `temperature_c` over that at the reference temperature. It doubles with every
 * dark_doubling_k; 1 for a block of zeros. */
double bst_detector_dark_factor(const bst_detector_config *d);

/* True if rendering needs whole columns of the sensor, because charge or light moves along them:
 * blooming, frame transfer, traps, and effects that need the whole sensor. */
bool bst_detector_config_whole_columns(const bst_detector_config *d);
/* True if rendering needs the whole sensor, because charge also moves along rows, pixels change
 * their neighbours, or all pixels have a memory: traps of the serial register, crosstalk, coupling,
 * brighter-fatter effect, persistence. */
bool bst_detector_config_whole_sensor(const bst_detector_config *d);

/* True if a direction has traps. */
bool bst_detector_has_traps(const bst_detector_traps_config *t);
/* True if pixels keep charge of earlier frames. */
bool bst_detector_has_persistence(const bst_detector_config *d);

/* True if pixels have 1/f noise from frame to frame. */
bool bst_detector_has_pixel_flicker(const bst_detector_config *d);

/* Checks for effects that exclude each other.
 *
 * Errors:    BST_ERR_CONFIG, with the key: a rolling shutter beside effects that need whole columns
 *            (bst_detector_config_whole_columns); traps along rows beside several outputs;
 *            persistence that traps more than all charge; a ramp of one read, or beside effects of
 *            a read-out that moves charge; a range of 1/f noise that is empty or too wide */
bst_status bst_detector_config_check(bst_ctx *ctx, const bst_detector_config *d) BST_MUST_CHECK;
/* Checks edges and outputs against the size of the frame.
 *
 * Errors:    BST_ERR_CONFIG, with the key: no pixel is left between shielded and overscan edges, or
 *            the outputs do not share the columns equally */
bst_status bst_detector_config_check_size(bst_ctx *ctx, const bst_detector_config *d,
                                          int64_t width_px, int64_t height_px) BST_MUST_CHECK;

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
