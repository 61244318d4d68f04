#include "boresight/detector_config.h"

#include <math.h>

#include "sim/optics/pixel_flicker.h"

static const char *const wells[] = {"clip", "bloom", NULL};
static const char *const fits[] = {"slope", "last_minus_first", NULL};
static const char *const quantisers[] = {"uniform", "square_root", "table", NULL};

static const bst_config_desc cosmic_ray_table[] = {
    BST_REAL(bst_detector_cosmic_ray_config, rate_per_cm2_s, "1/cm2/s", 0, 1e6, "0",
             "Energetic particles through the detector; 0: none."),
    BST_REAL(bst_detector_cosmic_ray_config, pixel_pitch_um, "um", 0.5, 200, "13",
             "Side of a pixel."),
    BST_REAL(bst_detector_cosmic_ray_config, depth_um, "um", 0.1, 2000, "15",
             "Thickness of the layer whose charge is collected."),
    BST_REAL(bst_detector_cosmic_ray_config, e_per_um, "e/um", 0.1, 1e6, "75",
             "Most probable charge per length of path (a minimum-ionising particle in silicon)."),
    BST_REAL(bst_detector_cosmic_ray_config, straggling, "", 0, 1, "0.15",
             "Spread of that charge from track to track: scale of a Moyal distribution, in most "
             "probable values."),
    BST_REAL(bst_detector_cosmic_ray_config, readout_s, "s", 0, 1e4, "0",
             "Time besides the exposure in which hits are collected (transfer and read-out)."),
    BST_FORMER("frame_s", "readout_s"),
    BST_CONFIG_END,
};

static const bst_config_desc quantisation_table[] = {
    BST_ENUM(
        bst_detector_quantisation_config, model, quantisers, "\"uniform\"",
        "uniform: digital numbers; square_root: companded to codes of `bits`; table: codes by a "
        "file."),
    BST_INT(bst_detector_quantisation_config, bits, "", 4, 16, "8",
            "square_root: bits of the codes."),
    BST_PATH(bst_detector_quantisation_config, table, "\"\"",
             "table: text file, on line k the first digital number of code k - 1, increasing, from "
             "0 on."),
    BST_BOOL(
        bst_detector_quantisation_config, expand, "true",
        "Frames hold the middle of each code's digital numbers, as after expansion; false: the "
        "codes."),
    BST_CONFIG_END,
};

static const bst_config_desc edges_table[] = {
    BST_INT(bst_detector_edges_config, left, "px", 0, 65536, "0", "Columns from column 0 on."),
    BST_INT(bst_detector_edges_config, right, "px", 0, 65536, "0", "Columns up to the last one."),
    BST_INT(bst_detector_edges_config, bottom, "px", 0, 65536, "0", "Rows from row 0 on."),
    BST_INT(bst_detector_edges_config, top, "px", 0, 65536, "0", "Rows up to the last one."),
    BST_CONFIG_END,
};

static const bst_config_desc output_table[] = {
    BST_BOOL(bst_detector_output_config, right, "false", "Rows are read from the last column on."),
    BST_BOOL(bst_detector_output_config, top, "false", "The last row is read first."),
    BST_CONFIG_END,
};

static const bst_config_desc pick_up_table[] = {
    BST_REAL(bst_detector_pick_up_config, amplitude_e, "e", 0, 1e6, "0", "Amplitude of the sine."),
    BST_REAL(bst_detector_pick_up_config, cycles_per_px, "1/px", -0.5, 0.5, "0",
             "Frequency along a row; 0.5: alternating columns."),
    BST_REAL(bst_detector_pick_up_config, cycles_per_row, "1/px", -0.5, 0.5, "0",
             "Phase from row to row, in cycles."),
    BST_OPEN_REAL(bst_detector_pick_up_config, phase_deg, "deg", -360, 360,
                  "Phase at pixel (0, 0); null: random in each frame."),
    BST_CONFIG_END,
};

static const bst_config_desc glow_table[] = {
    BST_REAL(bst_detector_glow_config, peak_e, "e", 0, 1e6, "0",
             "Mean charge of a frame at the amplifier."),
    BST_REAL(bst_detector_glow_config, scale_px, "px", 1, 1e5, "100",
             "Distance in which it falls by the factor e."),
    BST_REAL(bst_detector_glow_config, x_px, "px", -1e5, 1e5, "0", "Amplifier's column."),
    BST_REAL(bst_detector_glow_config, y_px, "px", -1e5, 1e5, "0", "Amplifier's row."),
    BST_CONFIG_END,
};

static const bst_config_desc traps_table[] = {
    BST_REALS(bst_detector_traps_config, traps_per_px, "", 0, 1e5, "[0, 0, 0]",
              "Traps of three species in each pixel that a packet of reference_e meets."),
    BST_REALS(bst_detector_traps_config, release_px, "px", 0.01, 1e6, "[1, 1, 1]",
              "Their time constants of release, in transfers by one pixel."),
    BST_REAL(bst_detector_traps_config, fill_exponent, "", 0, 1, "0.5",
             "The traps that a packet meets grow with its charge to this power."),
    BST_REAL(bst_detector_traps_config, reference_e, "e", 1, 1e7, "10000",
             "Charge of a packet that meets traps_per_px."),
    BST_CONFIG_END,
};

static const bst_config_desc persistence_table[] = {
    BST_REALS(bst_detector_persistence_config, trapped_share, "", 0, 1, "[0, 0, 0, 0, 0]",
              "Share of a pixel's charge that traps of five species hold after a long time; "
              "together at most 1."),
    BST_REALS(bst_detector_persistence_config, time_constant_s, "s", 1e-6, 1e9,
              "[1, 10, 100, 1000, 10000]", "Their time constants of filling and of release."),
    BST_CONFIG_END,
};

static const bst_config_desc ramp_table[] = {
    BST_INT(bst_detector_ramp_config, reads, "", 0, BST_RAMP_READS, "0",
            "Non-destructive reads at equal distances, the first at the start of the exposure, the "
            "last at its end; 2 or more. 0: one read at the end. Frames of a ramp are not binned."),
    BST_ENUM(
        bst_detector_ramp_config, fit, fits, "\"slope\"",
        "Frame: signal of the least-squares line through the reads before the first of full_well_e "
        "(slope), "
        "or the last of them minus the first."),
    BST_REAL(bst_detector_ramp_config, flicker_noise_e, "e", 0, 1e5, "0",
             "1/f noise of each pixel from read to read, RMS: equal power in each factor of 4 from "
             "a period of some reads to one of several thousand. Beside it each read has "
             "read_noise_e."),
    BST_CONFIG_END,
};

static const bst_config_desc pixel_flicker_table[] = {
    BST_REAL(bst_detector_pixel_flicker_config, rms_e, "e", 0, 1e5, "0",
             "RMS of a pixel's noise over all times. 0: none."),
    BST_REAL(bst_detector_pixel_flicker_config, lowest_hz, "Hz", 1e-9, 1e9, "0.0001",
             "Frequency below which the power spectrum is flat."),
    BST_REAL(bst_detector_pixel_flicker_config, highest_hz, "Hz", 1e-9, 1e9, "1",
             "Frequency above which it falls as 1/f^2; at most 262144 lowest_hz."),
    BST_CONFIG_END,
};

static const bst_config_desc crosstalk_table[] = {
    BST_INT(bst_detector_crosstalk_config, outputs, "", 1, 64, "1",
            "Outputs that read equal numbers of columns at the same time."),
    BST_REAL(bst_detector_crosstalk_config, coupling, "", -0.1, 0.1, "0",
             "Share of the charge of each other output that an output shows."),
    BST_BOOL(bst_detector_crosstalk_config, mirrored, "true",
             "Every second output reads from its last column on."),
    BST_CONFIG_END,
};

const bst_config_desc bst_detector_table[] = {
    BST_REAL(bst_detector_config, temperature_c, "degC", -273.15, 200, "20",
             "Temperature of the detector."),
    BST_REAL(bst_detector_config, reference_temperature_c, "degC", -273.15, 200, "20",
             "Temperature at which the dark currents are given."),
    BST_REAL(bst_detector_config, dark_doubling_k, "K", 0.5, 100, "6.5",
             "Warming by which the dark currents double."),
    BST_REAL(bst_detector_config, prnu_rms, "", 0, 1, "0",
             "Response of the pixels to light: RMS about 1, Gaussian."),
    BST_PATH(bst_detector_config, prnu_map, "\"\"",
             "FITS image of the response, instead of prnu_rms; 0: a dead pixel."),
    BST_REAL(bst_detector_config, dsnu_rms, "", 0, 10, "0",
             "Dark current of the pixels: RMS over mean, log-normal."),
    BST_PATH(
        bst_detector_config, dark_map, "\"\"",
        "FITS image of the dark current in e/s, instead of dark_current_e_per_s and dsnu_rms."),
    BST_REAL(bst_detector_config, hot_fraction, "", 0, 1, "0", "Share of pixels that are hot."),
    BST_REAL(bst_detector_config, hot_median_e_per_s, "e/s", 0, 1e8, "1000",
             "Their dark current above the others', median."),
    BST_REAL(bst_detector_config, hot_spread_dex, "dex", 0, 5, "0.5",
             "Its spread: standard deviation of the decimal logarithm."),
    BST_REAL(bst_detector_config, dead_fraction, "", 0, 1, "0",
             "Share of pixels without response to light."),
    BST_INT(bst_detector_config, bad_columns, "", 0, 16384, "0",
            "Columns without response to light, from a random row on away from the read-out."),
    BST_SEED(bst_detector_config, fixed_pattern_seed, "\"0x1\"",
             "Seed of all fixed patterns, which also depend on the names of observer and sensor; "
             "the same in all runs of a study."),
    BST_FORMER("pattern_seed", "fixed_pattern_seed"),
    BST_REAL(bst_detector_config, column_offset_rms_e, "e", 0, 1e5, "0",
             "Fixed offsets of the columns, RMS."),
    BST_REAL(bst_detector_config, row_offset_rms_e, "e", 0, 1e5, "0",
             "Fixed offsets of the rows, RMS."),
    BST_REAL(bst_detector_config, row_noise_e, "e", 0, 1e5, "0",
             "Offsets of the rows that are new in every frame, RMS."),
    BST_REAL(bst_detector_config, telegraph_noise_fraction, "", 0, 1, "0",
             "Share of reads with more noise (random telegraph signals and the like)."),
    BST_FORMER("read_tail_fraction", "telegraph_noise_fraction"),
    BST_REAL(bst_detector_config, telegraph_noise_rms_e, "e", 0, 1e5, "0",
             "Noise of those reads on top of the read noise, RMS."),
    BST_FORMER("read_tail_rms_e", "telegraph_noise_rms_e"),
    BST_REALS(bst_detector_config, nonlinearity, "", -1, 1, "[0, 0, 0]",
              "c of the read charge q (1 + c1 u + c2 u^2 + c3 u^3), u = q / full_well_e."),
    BST_ENUM(bst_detector_config, saturation, wells, "\"clip\"",
             "Charge above the full well is lost (clip) or flows along its column (bloom; not with "
             "row_time_s)."),
    BST_FORMER("full_well", "saturation"),
    BST_REAL(bst_detector_config, frame_transfer_s, "s", 0, 100, "0",
             "Time of the transfer of a whole frame under light; 0: none."),
    BST_REAL(
        bst_detector_config, row_time_s, "s", -1, 1, "0",
        "Rolling shutter: each row of the window is exposed so much later than the row before; "
        "below 0: from the last row on. The exposure's times are those of the window's middle "
        "row. 0: all rows at once. Not with frame_transfer_s, saturation bloom, traps, "
        "interpixel_coupling, brighter_fatter_per_e, crosstalk or persistence."),
    BST_OBJECT(bst_detector_config, output, output_table, "{}",
               "Where frames are read: at column 0, row 0 first, unless given."),
    BST_REAL(
        bst_detector_config, readout_s, "s", 0, 1e4, "0",
        "Time of the read-out of the whole sensor: charge gathers the dark current of the rows "
        "that it passes."),
    BST_REAL(bst_detector_config, clock_induced_e, "e", 0, 1e4, "0",
             "Mean charge that clocking leaves in each pixel of a frame (Poisson)."),
    BST_REAL(bst_detector_config, offset_noise_e, "e", 0, 1e5, "0",
             "Level of the whole frame, new in every frame, RMS."),
    BST_REAL(bst_detector_config, offset_drift_dn_per_frame, "DN", -1e4, 1e4, "0",
             "Growth of offset_dn with each frame, from the run's first one on."),
    BST_REAL(bst_detector_config, flicker_noise_e, "e", 0, 1e5, "0",
             "1/f noise of the level from row to row, RMS: equal power in each factor of 4 from a "
             "period of some rows to one of several thousand."),
    BST_REAL(bst_detector_config, reset_noise_e, "e", 0, 1e5, "0",
             "kTC noise of the reset: new in each pixel of every frame, common to all reads of a "
             "ramp and of double sampling, which therefore do not have it, RMS."),
    BST_REAL(bst_detector_config, double_sampling_s, "s", 0, 1e4, "0",
             "Correlated double sampling: the read so long before the one of the frame is "
             "subtracted. Removes reset noise and slow 1/f noise; read_noise_e is that of each of "
             "the two reads. 0: the frame is one read. Not with a ramp."),
    BST_OBJECT(
        bst_detector_config, pixel_flicker_noise, pixel_flicker_table, "{}",
        "1/f noise of each pixel, correlated from frame to frame. Frames are not binned; not "
        "with a ramp."),
    BST_OBJECT(bst_detector_config, shielded, edges_table, "{}",
               "Edges of the frame that light does not reach; they have dark current."),
    BST_OBJECT(bst_detector_config, overscan, edges_table, "{}",
               "Edges of the frame that are no pixels of the sensor: they have no charge of their "
               "own, but traps release some there; rows also gather dark current during read-out. "
               "width_px and height_px include them."),
    BST_OBJECT(bst_detector_config, pick_up, pick_up_table, "{}",
               "Coherent pattern noise: a sine along the rows."),
    BST_OBJECT(bst_detector_config, glow, glow_table, "{}", "Light of the output amplifier."),
    BST_OBJECT(bst_detector_config, parallel_traps, traps_table, "{}",
               "Charge-transfer inefficiency along columns, towards the row that is read first."),
    BST_OBJECT(bst_detector_config, serial_traps, traps_table, "{}",
               "Charge-transfer inefficiency along rows, towards the output; not with several "
               "outputs of crosstalk."),
    BST_OBJECT(bst_detector_config, persistence, persistence_table, "{}",
               "Charge that pixels keep and release into later frames; not with row_time_s."),
    BST_OBJECT(bst_detector_config, ramp, ramp_table, "{}",
               "Up-the-ramp sampling of infrared arrays: a line is fitted to several reads of each "
               "exposure. Not with effects of moving charge (bloom, traps, frame_transfer_s, "
               "readout_s, clock_induced_e, glow, em_gain), row_time_s, brighter_fatter_per_e or "
               "telegraph noise."),
    BST_REAL(bst_detector_config, em_gain, "", 1, 1e5, "1",
             "Gain of an electron-multiplying register. All charge, read_noise_e and gain_e_per_dn "
             "are those before it; it adds the noise of multiplication."),
    BST_REAL(bst_detector_config, interpixel_coupling, "", 0, 0.2, "0",
             "Share of a pixel's charge that each of its four neighbours shows instead."),
    BST_REAL(bst_detector_config, brighter_fatter_per_e, "1/e", 0, 1e-5, "0",
             "Shift of the border of two pixels per electron of difference between their charges, "
             "px."),
    BST_OBJECT(bst_detector_config, crosstalk, crosstalk_table, "{}",
               "Signal that outputs take over from each other."),
    BST_OBJECT(bst_detector_config, cosmic_rays, cosmic_ray_table, "{}", "Radiation hits."),
    BST_FORMER("hits", "cosmic_rays"),
    BST_OBJECT(bst_detector_config, quantisation, quantisation_table, "{}",
               "From the converter's digital numbers to the frame's."),
    BST_CONFIG_END,
};

double bst_detector_dark_factor(const bst_detector_config *d) {
    if (d->temperature_c == d->reference_temperature_c) {
        return 1.0;
    }
    return exp2((d->temperature_c - d->reference_temperature_c) / d->dark_doubling_k);
}

bool bst_detector_config_whole_columns(const bst_detector_config *d) {
    return d->saturation == BST_WELL_BLOOM || d->frame_transfer_s > 0.0 ||
           bst_detector_has_traps(&d->parallel_traps) || bst_detector_config_whole_sensor(d);
}

bool bst_detector_config_whole_sensor(const bst_detector_config *d) {
    return bst_detector_has_traps(&d->serial_traps) || d->interpixel_coupling > 0.0 ||
           d->brighter_fatter_per_e > 0.0 || bst_detector_has_persistence(d) ||
           (d->crosstalk.outputs > 1 && d->crosstalk.coupling != 0.0);
}

bool bst_detector_has_traps(const bst_detector_traps_config *t) {
    for (int i = 0; i < BST_TRAP_SPECIES; i++) {
        if (t->traps_per_px[i] > 0.0) {
            return true;
        }
    }
    return false;
}

bool bst_detector_has_persistence(const bst_detector_config *d) {
    for (int i = 0; i < BST_PERSISTENCE_SPECIES; i++) {
        if (d->persistence.trapped_share[i] > 0.0) {
            return true;
        }
    }
    return false;
}

bool bst_detector_has_pixel_flicker(const bst_detector_config *d) {
    return d->pixel_flicker_noise.rms_e > 0.0;
}

/* The frequencies of pixels' 1/f noise. */
static bst_status check_pixel_flicker(bst_ctx *ctx, const bst_detector_config *d) {
    const bst_detector_pixel_flicker_config *f = &d->pixel_flicker_noise;
    if (!bst_detector_has_pixel_flicker(d)) {
        return BST_OK;
    }
    double ratio = f->highest_hz / f->lowest_hz, most = pow(4.0, BST_FLICKER_TERMS - 1);
    if (!(ratio >= 1.0 && ratio <= most)) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "pixel_flicker_noise: highest_hz is %g and lowest_hz %g; allowed are 1 to "
                        "%.0f times lowest_hz",
                        f->highest_hz, f->lowest_hz, most);
    }
    return BST_OK;
}

/* A ramp against what excludes it. */
static bst_status check_ramp(bst_ctx *ctx, const bst_detector_config *d) {
    if (d->ramp.reads == 0) {
        return BST_OK;
    }
    if (d->ramp.reads == 1) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "ramp/reads: 1 read gives no slope; allowed are 0 (no ramp) and 2 to %d",
                        BST_RAMP_READS);
    }
    const struct {
        bool on;
        const char *key;
    } others[] = {{d->row_time_s != 0.0, "row_time_s"},
                  {d->frame_transfer_s > 0.0, "frame_transfer_s"},
                  {d->saturation == BST_WELL_BLOOM, "saturation \"bloom\""},
                  {bst_detector_has_traps(&d->parallel_traps), "parallel_traps"},
                  {bst_detector_has_traps(&d->serial_traps), "serial_traps"},
                  {d->brighter_fatter_per_e > 0.0, "brighter_fatter_per_e"},
                  {d->em_gain > 1.0, "em_gain"},
                  {d->readout_s > 0.0, "readout_s"},
                  {d->clock_induced_e > 0.0, "clock_induced_e"},
                  {d->glow.peak_e > 0.0, "glow"},
                  {d->cosmic_rays.readout_s > 0.0, "cosmic_rays/readout_s"},
                  {d->double_sampling_s > 0.0, "double_sampling_s"},
                  {bst_detector_has_pixel_flicker(d),
                   "pixel_flicker_noise (a ramp has flicker_noise_e of its own)"},
                  {d->telegraph_noise_fraction > 0.0, "telegraph_noise_fraction"}};
    for (size_t i = 0; i < sizeof others / sizeof *others; i++) {
        if (others[i].on) {
            return bst_fail(ctx, BST_ERR_CONFIG,
                            "ramp/reads: %lld non-destructive reads cannot be combined with %s; "
                            "set one of them to its default",
                            (long long)d->ramp.reads, others[i].key);
        }
    }
    return BST_OK;
}

bst_status bst_detector_config_check(bst_ctx *ctx, const bst_detector_config *d) {
    if (d->row_time_s != 0.0 && bst_detector_config_whole_columns(d)) {
        return bst_fail(
            ctx, BST_ERR_CONFIG,
            "row_time_s: a rolling shutter goes neither with frame_transfer_s nor with "
            "the saturation \"bloom\": charge that runs along columns belongs to sensors "
            "that expose all rows at once; nor with traps, coupling of pixels, "
            "brighter_fatter_per_e, crosstalk or persistence; set one of them to its default");
    }
    BST_TRY(check_ramp(ctx, d));
    BST_TRY(check_pixel_flicker(ctx, d));
    double trapped = 0.0;
    for (int i = 0; i < BST_PERSISTENCE_SPECIES; i++) {
        trapped += d->persistence.trapped_share[i];
    }
    if (trapped > 1.0 + 1e-9) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "persistence/trapped_share: all species together trap %g of the charge, "
                        "but at most 1 is there; give smaller shares",
                        trapped);
    }
    if (bst_detector_has_traps(&d->serial_traps) && d->crosstalk.outputs > 1) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "serial_traps: traps along rows are those of one output, but "
                        "crosstalk/outputs is %lld; set outputs to 1 or traps_per_px to 0",
                        (long long)d->crosstalk.outputs);
    }
    return BST_OK;
}

bst_status bst_detector_config_check_size(bst_ctx *ctx, const bst_detector_config *d,
                                          int64_t width_px, int64_t height_px) {
    const bst_detector_edges_config s = d->shielded, o = d->overscan;
    const bst_detector_edges_config edges[] = {
        s,
        o,
        /* both are counted from the frame's edge on */
        {s.left > o.left ? s.left : o.left, s.right > o.right ? s.right : o.right,
         s.bottom > o.bottom ? s.bottom : o.bottom, s.top > o.top ? s.top : o.top}};
    const char *const names[] = {"shielded", "overscan", "shielded and overscan together"};
    for (int i = 0; i < 3; i++) {
        int64_t columns = edges[i].left + edges[i].right, rows = edges[i].bottom + edges[i].top;
        if (columns >= width_px || rows >= height_px) {
            return bst_fail(ctx, BST_ERR_CONFIG,
                            "%s: %lld columns and %lld rows leave nothing of %lld x %lld pixels; "
                            "width_px and height_px include them",
                            names[i], (long long)columns, (long long)rows, (long long)width_px,
                            (long long)height_px);
        }
    }
    if (d->crosstalk.outputs > 1 && width_px % d->crosstalk.outputs != 0) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "crosstalk/outputs: %lld outputs do not share %lld columns equally; "
                        "allowed are divisors of width_px",
                        (long long)d->crosstalk.outputs, (long long)width_px);
    }
    return BST_OK;
}

double bst_detector_lead_s(const bst_detector_config *d, int rows) {
    return 0.5 * fabs(d->row_time_s) * (rows - 1);
}

int64_t bst_detector_lead_ticks(const bst_detector_config *d, int rows, double tick_rate_hz) {
    /* tolerance: a sum of times may exceed an integer by rounding */
    return (int64_t)ceil(bst_detector_lead_s(d, rows) * tick_rate_hz - 1e-6);
}
