#include "sim/analysis/characterize/characterize.h"

#include <math.h>

#include "sim/cli/outputs.h"
#include "sim/cli/shipped.h"
#include "sim/core/folder.h"

#define Q bst_characterize_request
const bst_option bst_characterize_options[] = {
    {.name = "map",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(Q, map),
     .argument = "MAP",
     .doc = "keyword map: neossat, boresight, satnet, table, or the path of a JSON file",
     .required = true},
    {.name = "out",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(Q, out),
     .path = BST_PATH_OUTPUT_FOLDER,
     .argument = "FOLDER",
     .doc = "where the results go",
     .required = true},
    {.name = "bias",
     .kind = BST_OPTION_LIST,
     .offset = offsetof(Q, bias),
     .path = BST_PATH_INPUT,
     .argument = "PATH",
     .doc = "FITS file, side table, folder or list of bias frames; may be given several times"},
    {.name = "dark",
     .kind = BST_OPTION_LIST,
     .offset = offsetof(Q, dark),
     .path = BST_PATH_INPUT,
     .argument = "PATH",
     .doc = "the same of darks of one exposure"},
    {.name = "flat",
     .kind = BST_OPTION_LIST,
     .offset = offsetof(Q, flat),
     .path = BST_PATH_INPUT,
     .argument = "PATH",
     .doc = "the same of flats of one exposure"},
    {.name = "linearity",
     .kind = BST_OPTION_LIST,
     .offset = offsetof(Q, linearity),
     .path = BST_PATH_INPUT,
     .argument = "PATH",
     .doc = "the same of flats of several exposures in one light, to beyond the full well"},
    {.name = "warm",
     .kind = BST_OPTION_LIST,
     .offset = offsetof(Q, warm),
     .path = BST_PATH_INPUT,
     .argument = "PATH",
     .doc = "darks of one exposure at another temperature, with --warmer"},
    {.name = "warmer",
     .kind = BST_OPTION_REAL,
     .offset = offsetof(Q, warmer_k),
     .argument = "K",
     .doc = "temperature of the warm darks above that of the darks",
     .minimum = -300,
     .maximum = 300},
    {.name = "simulated",
     .kind = BST_OPTION_LIST,
     .offset = offsetof(Q, simulated),
     .path = BST_PATH_INPUT,
     .argument = "PATH",
     .doc =
         "frames that boresight calframes made with detector.json, like the darks (without darks "
         "the bias frames, else the flats), to compare with them"},
    {.name = "pitch",
     .needs = "dark",
     .kind = BST_OPTION_REAL,
     .offset = offsetof(Q, pixel_pitch_um),
     .argument = "UM",
     .doc = "side of a pixel in micrometres, for radiation hits (default 13)",
     .minimum = 0.5,
     .maximum = 200},
    {.name = "extends",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(Q, extends),
     .path = BST_PATH_INPUT,
     .argument = "FILE",
     .doc = "scenario whose camera detector.json changes"},
    {.name = "camera",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(Q, camera),
     .argument = "POINTER",
     .doc = "place of the camera in that scenario (default /observers/0/sensors/0/camera)"},
    {.name = "maps",
     .needs = "dark|flat",
     .kind = BST_OPTION_FLAG,
     .offset = offsetof(Q, maps),
     .doc =
         "detector.json takes dark current and response from the maps, not from their statistics"},
    {.name = "overwrite",
     .kind = BST_OPTION_FLAG,
     .offset = offsetof(Q, overwrite),
     .doc = "replace earlier results there"},
    {.name = "help", .kind = BST_OPTION_FLAG, .offset = offsetof(Q, help), .doc = "print this"},
    {.name = NULL},
};
#undef Q

const bst_sensor_figure_name bst_sensor_figure_names[BST_SENSOR_FIGURES] = {
    [BST_SENSOR_GAIN] = {"gain_e_per_dn", "e-/DN", "gain_e_per_dn"},
    [BST_SENSOR_READ_NOISE] = {"read_noise_e", "e-", "read_noise_e"},
    [BST_SENSOR_OFFSET] = {"offset_dn", "DN", "offset_dn"},
    [BST_SENSOR_OFFSET_DRIFT] = {"offset_drift_dn_per_frame", "DN",
                                 "detector/offset_drift_dn_per_frame"},
    [BST_SENSOR_ROW_NOISE] = {"row_noise_e", "e-", "detector/row_noise_e"},
    [BST_SENSOR_COLUMN_OFFSET] = {"column_offset_rms_e", "e-", "detector/column_offset_rms_e"},
    [BST_SENSOR_ROW_OFFSET] = {"row_offset_rms_e", "e-", "detector/row_offset_rms_e"},
    [BST_SENSOR_DARK] = {"dark_current_e_per_s", "e-/s", "dark_current_e_per_s"},
    [BST_SENSOR_DARK_MEDIAN] = {"dark_current_median_e_per_s", "e-/s", NULL},
    [BST_SENSOR_DSNU] = {"dsnu_rms", "", "detector/dsnu_rms"},
    [BST_SENSOR_HOT_FRACTION] = {"hot_fraction", "", "detector/hot_fraction"},
    [BST_SENSOR_HOT_MEDIAN] = {"hot_median_e_per_s", "e-/s", "detector/hot_median_e_per_s"},
    [BST_SENSOR_HOT_SPREAD] = {"hot_spread_dex", "dex", "detector/hot_spread_dex"},
    [BST_SENSOR_PRNU] = {"prnu_rms", "", "detector/prnu_rms"},
    [BST_SENSOR_DEAD_FRACTION] = {"dead_fraction", "", "detector/dead_fraction"},
    [BST_SENSOR_BAD_COLUMNS] = {"bad_columns", "", "detector/bad_columns"},
    [BST_SENSOR_RAMP] = {"readout_ramp_dn", "DN", NULL},
    [BST_SENSOR_READOUT] = {"readout_s", "s", "detector/readout_s"},
    [BST_SENSOR_LINE_FREQUENCY] = {"pick_up_cycles_per_px", "1/px",
                                   "detector/pick_up/cycles_per_px"},
    [BST_SENSOR_LINE_AMPLITUDE] = {"pick_up_amplitude_e", "e-", "detector/pick_up/amplitude_e"},
    [BST_SENSOR_LINE_PHASE] = {"pick_up_cycles_per_row", "1/px", "detector/pick_up/cycles_per_row"},
    [BST_SENSOR_PARALLEL_TRAIL] = {"cti_parallel_trail_fraction", "", NULL},
    [BST_SENSOR_SERIAL_TRAIL] = {"cti_serial_trail_fraction", "", NULL},
    [BST_SENSOR_FULL_WELL] = {"full_well_e", "e-", "full_well_e"},
    [BST_SENSOR_SATURATION] = {"saturation_dn", "DN", NULL},
    [BST_SENSOR_LINEARITY_ERROR] = {"linearity_error", "", NULL},
    [BST_SENSOR_NONLINEARITY_1] = {"nonlinearity_1", "", NULL},
    [BST_SENSOR_NONLINEARITY_2] = {"nonlinearity_2", "", NULL},
    [BST_SENSOR_NONLINEARITY_3] = {"nonlinearity_3", "", NULL},
    [BST_SENSOR_HIT_RATE] = {"hit_rate_per_cm2_s", "1/cm2/s",
                             "detector/cosmic_rays/rate_per_cm2_s"},
    [BST_SENSOR_HIT_READOUT] = {"hit_readout_s", "s", "detector/cosmic_rays/readout_s"},
    [BST_SENSOR_HIT_CHARGE] = {"hit_charge_e", "e-", NULL},
    [BST_SENSOR_HIT_LENGTH] = {"hit_length_px", "px", NULL},
    [BST_SENSOR_HIT_DEPTH] = {"hit_depth_um", "um", "detector/cosmic_rays/depth_um"},
    [BST_SENSOR_HIT_E_PER_UM] = {"hit_e_per_um", "e-/um", "detector/cosmic_rays/e_per_um"},
    [BST_SENSOR_HIT_STRAGGLING] = {"hit_straggling", "", "detector/cosmic_rays/straggling"},
    [BST_SENSOR_DARK_DOUBLING] = {"dark_doubling_k", "K", "detector/dark_doubling_k"},
};

static void print_figures(FILE *out, const bst_sensor_stacks *s, const bst_sensor_figures *f) {
    fprintf(out, "frames     %d bias, %d dark, %d flat, %d x %d px\n", s->bias.count, s->dark.count,
            s->flat.count, f->width, f->height);
    fprintf(out, "%-28s %12s   %s\n", "", "value", "95 % interval");
    for (int i = 0; i < BST_SENSOR_FIGURES; i++) {
        const bst_sensor_estimate *e = &f->figures[i];
        const bst_sensor_figure_name *name = &bst_sensor_figure_names[i];
        if (!isfinite(e->value)) {
            fprintf(out, "%-28s %12s   %s\n", name->key, "-", f->method[i]);
        } else if (isfinite(e->sigma)) {
            double low, high;
            bst_sensor_interval(f, (bst_sensor_figure)i, &low, &high);
            if (high - e->value > 1.01 * (e->value - low)) {
                fprintf(out, "%-28s %12.6g   %.3g to %.3g %s\n", name->key, e->value, low, high,
                        name->unit);
            } else {
                fprintf(out, "%-28s %12.6g   +-%.2g %s\n", name->key, e->value, high - e->value,
                        name->unit);
            }
        } else {
            fprintf(out, "%-28s %12.6g   %s (%s)\n", name->key, e->value, name->unit, f->method[i]);
        }
    }
    fflush(out);
}

static bst_status read_stack(bst_ctx *ctx, const char *kind, const bst_option_list *list,
                             const bst_keyword_map *map, bst_frame_stack *out) {
    return list->count > 0 ? bst_frame_stack_read(ctx, kind, list->items, list->count, map, out)
                           : BST_OK;
}

/* Reads all frames. */
static bst_status read_stacks(bst_ctx *ctx, const bst_characterize_request *q,
                              bst_sensor_stacks *stacks) {
    char path[4096];
    bst_keyword_map map;
    BST_TRY(bst_cli_find_keyword_map(ctx, q->map, path));
    BST_TRY(bst_keyword_map_load(ctx, path, &map));
    BST_TRY(read_stack(ctx, "bias", &q->bias, &map, &stacks->bias));
    BST_TRY(read_stack(ctx, "dark", &q->dark, &map, &stacks->dark));
    BST_TRY(read_stack(ctx, "flat", &q->flat, &map, &stacks->flat));
    BST_TRY(read_stack(ctx, "warm dark", &q->warm, &map, &stacks->warm));
    stacks->warmer_k = q->warmer_k;
    stacks->pixel_pitch_um = q->pixel_pitch_um;
    if (q->simulated.count > 0) {
        bst_keyword_map ours;
        BST_TRY(bst_cli_find_keyword_map(ctx, "boresight", path));
        BST_TRY(bst_keyword_map_load(ctx, path, &ours));
        BST_TRY(read_stack(ctx, "simulated", &q->simulated, &ours, &stacks->simulated));
    }
    return q->linearity.count > 0
               ? bst_linearity_series_read(ctx, q->linearity.items, q->linearity.count, &map,
                                           &stacks->linearity)
               : BST_OK;
}

/* Compares the last frame of the darks, else of the bias frames or flats, with a simulated one. */
static bst_status compare(bst_ctx *ctx, const bst_sensor_stacks *s,
                          bst_characterize_comparison *out) {
    const bst_frame_stack *sim = &s->simulated;
    const bst_frame_stack *real = s->dark.count > 0   ? &s->dark
                                  : s->bias.count > 0 ? &s->bias
                                                      : &s->flat;
    if (sim->count == 0) {
        return BST_OK;
    }
    out->made = true;
    out->kind = real == &s->dark ? "dark" : real == &s->bias ? "bias" : "flat";
    if (sim->width != real->width || sim->height != real->height) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "the simulated frames have %d x %d pixels, the image of the %s frames %d x "
                        "%d (allowed: one size; simulate without overscan)",
                        sim->width, sim->height, out->kind, real->width, real->height);
    }
    if (fabs(sim->exposure_s - real->exposure_s) > 1e-3 * real->exposure_s + 1e-6) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "the simulated frames have an exposure of %g s, the %s frames %g s "
                        "(allowed: one exposure)",
                        sim->exposure_s, out->kind, real->exposure_s);
    }
    BST_TRY(bst_frame_statistics_of(ctx, real->last, real->width, real->height, &out->real));
    return bst_frame_statistics_of(ctx, sim->last, sim->width, sim->height, &out->simulated);
}

bst_status bst_characterize_run(bst_ctx *ctx, const bst_characterize_request *q, FILE *out) {
    char path[4096];
    bst_sensor_stacks stacks = {0};
    bst_sensor_figures figures = {0};
    bst_characterize_comparison comparison = {.made = false};
    int n = snprintf(path, sizeof path, "%s/report.json", q->out);
    if (n < 0 || (size_t)n >= sizeof path) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "%.80s...: the path is too long", q->out);
    }
    BST_TRY(bst_outputs_refuse_earlier(ctx, path, q->overwrite));
    bst_status status = read_stacks(ctx, q, &stacks);
    if (status == BST_OK) {
        status = bst_sensor_figures_compute(ctx, &stacks, &figures);
    }
    if (status == BST_OK) {
        status = compare(ctx, &stacks, &comparison);
    }
    if (status == BST_OK) {
        print_figures(out, &stacks, &figures);
        status = bst_folder_make(ctx, q->out);
    }
    if (status == BST_OK) {
        status = bst_characterize_write(ctx, q, &stacks, &figures, &comparison);
    }
    bst_sensor_figures_free(&figures);
    bst_frame_stack_free(&stacks.bias);
    bst_frame_stack_free(&stacks.dark);
    bst_frame_stack_free(&stacks.flat);
    bst_frame_stack_free(&stacks.simulated);
    bst_frame_stack_free(&stacks.warm);
    bst_linearity_series_free(&stacks.linearity);
    return status;
}
