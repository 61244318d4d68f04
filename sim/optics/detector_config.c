#include "boresight/detector_config.h"

#include <math.h>

static const char *const wells[] = {"clip", "bloom", NULL};
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
             "Charge above the full well is lost (clip) or flows along its column (bloom)."),
    BST_FORMER("full_well", "saturation"),
    BST_REAL(bst_detector_config, frame_transfer_s, "s", 0, 100, "0",
             "Time of the transfer of a whole frame under light; 0: none."),
    BST_REAL(
        bst_detector_config, row_time_s, "s", -1, 1, "0",
        "Rolling shutter: each row of the window is exposed so much later than the row before; "
        "below 0: from the last row on. The exposure's times are those of the window's middle "
        "row. 0: all rows at once."),
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
    return d->saturation == BST_WELL_BLOOM || d->frame_transfer_s > 0.0;
}

bst_status bst_detector_config_check(bst_ctx *ctx, const bst_detector_config *d) {
    if (d->row_time_s != 0.0 && bst_detector_config_whole_columns(d)) {
        return bst_fail(
            ctx, BST_ERR_CONFIG,
            "row_time_s: a rolling shutter goes neither with frame_transfer_s nor with "
            "the saturation \"bloom\": charge that runs along columns belongs to sensors "
            "that expose all rows at once; set one of them to its default");
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
