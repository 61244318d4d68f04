#include "sim/analysis/pd/pd_request.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Fainter pairs are not detected at all. */
static const double LEAST_PAIR_SNR = 3.0;

#define FIELD(member) .offset = offsetof(bst_pd_request, member)

const bst_option bst_pd_option_table[] = {
    {.name = "snr",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(bst_pd_request, range),
     .argument = "FIRST:LAST:STEP",
     .doc = "SNRs of the targets (default 2:12:0.5); with --pair also a list, such as 20,50,100"},
    {.name = "magnitude",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(bst_pd_request, magnitudes),
     .argument = "FIRST:LAST:STEP",
     .doc = "V magnitudes instead of SNRs"},
    {.name = "trials",
     .kind = BST_OPTION_INT,
     .offset = offsetof(bst_pd_request, options.trials),
     .argument = "N",
     .doc = "targets of each SNR (default 1000); with --pair pairs of each separation (default "
            "300)",
     .minimum = 1,
     .maximum = 1e9},
    {.name = "json",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(bst_pd_request, json),
     .path = BST_PATH_OUTPUT,
     .argument = "FILE",
     .doc = "write the figures there"},
    {.name = "plot",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(bst_pd_request, plot),
     .path = BST_PATH_OUTPUT,
     .argument = "FILE",
     .doc = "draw Pd beside the ideal, and errors over bounds, as a PNG"},
    {.name = "streak",
     .kind = BST_OPTION_REAL,
     .offset = offsetof(bst_pd_request, options.streak_px),
     .argument = "PX",
     .doc = "length of the targets' streaks, each in a direction of its own (default 0: "
            "points)",
     .minimum = 0,
     .maximum = 1000},
    {.name = "stack",
     .kind = BST_OPTION_INT,
     .offset = offsetof(bst_pd_request, options.stack),
     .argument = "N",
     .doc = "search N frames together, in which targets move at rates of their own; SNRs are of "
            "one frame (default 0: each frame by itself)",
     .minimum = 0,
     .maximum = BST_STACK_MAX_FRAMES},
    {.name = "rates",
     .needs = "stack",
     .kind = BST_OPTION_REAL,
     .offset = offsetof(bst_pd_request, options.rates_px),
     .argument = "PX",
     .doc = "greatest rate of the targets of a stack and of the search, px per frame in x and "
            "in y (default 3)",
     .minimum = 0.05,
     .maximum = 16},
    {.name = "known-rate",
     .kind = BST_OPTION_FLAG,
     .offset = offsetof(bst_pd_request, options.known_rate),
     .doc = "the camera turns, each frame in its own direction, and image processing knows it"},
    {.name = "pair",
     .kind = BST_OPTION_FLAG,
     .offset = offsetof(bst_pd_request, pair),
     .doc = "measure at which separation two sources are found as two, over the SNR of both "
            "(default 20,50,100,200), beside the bound; with --streak of points and of streaks of "
            "known motion"},
    {.name = "separation",
     .needs = "pair",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(bst_pd_request, separations),
     .argument = "PX,...",
     .doc = "separations of the pairs (default: about the bound of each SNR)"},
    {.name = "ratio",
     .needs = "pair",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(bst_pd_request, ratios),
     .argument = "R,...",
     .doc = "brightness of one source over that of the other (default 1,4)"},
    {.name = "false-splits",
     .needs = "pair",
     .kind = BST_OPTION_REAL,
     .offset = offsetof(bst_pd_request, options.false_splits),
     .argument = "SHARE",
     .doc = "share of single sources found as two, asked of the detector; 0: no pair test "
            "(default: the scenario's false_splits)",
     .minimum = 0,
     .maximum = 0.1},
    {.name = "false-alarms",
     .kind = BST_OPTION_REAL,
     .offset = offsetof(bst_pd_request, options.false_alarms),
     .argument = "PER_FRAME",
     .doc = "asked of the detector (default: the scenario's)",
     .minimum = 1e-6,
     .maximum = 1e4},
    {.name = "empty-frames",
     .kind = BST_OPTION_INT,
     .offset = offsetof(bst_pd_request, options.empty_frames),
     .argument = "N",
     .doc = "frames without targets (default: for 400 false alarms, 50 to 400)",
     .minimum = 1,
     .maximum = 1e7},
    {.name = "background",
     .kind = BST_OPTION_REAL,
     .offset = offsetof(bst_pd_request, options.background_e),
     .argument = "E",
     .doc = "sky per pixel and exposure, electrons (default: the camera's)",
     .minimum = 0,
     .maximum = 1e6},
    {.name = "jitter",
     .kind = BST_OPTION_REAL,
     .offset = offsetof(bst_pd_request, options.jitter_px),
     .argument = "PX",
     .doc = "RMS per axis by which the image is blurred (default: jitter_px of imgproc)",
     .minimum = 0,
     .maximum = 5},
    {.name = "apart",
     .kind = BST_OPTION_REAL,
     .offset = offsetof(bst_pd_request, options.min_separation_px),
     .argument = "PX",
     .doc =
         "least distance between targets, their own length not counted (default 24); with --pair "
         "2.5 FWHM and the largest separation at least",
     .minimum = 1,
     .maximum = 1000},
    {.name = "cell",
     .kind = BST_OPTION_REAL,
     .offset = offsetof(bst_pd_request, options.cell_px),
     .argument = "PX",
     .doc = "one target in each square of this side (default: 40 more than they are apart, with "
            "--pair 4 more)",
     .minimum = 3,
     .maximum = 32768},
    {.name = "stars",
     .kind = BST_OPTION_FLAG,
     .offset = offsetof(bst_pd_request, options.stars),
     .doc = "keep the scenario's stars and sky, the camera rolled from frame to frame; what "
            "may be a star of SNR 1 or more is no false alarm"},
    {.name = "star-streak",
     .kind = BST_OPTION_REAL,
     .offset = offsetof(bst_pd_request, options.star_streak_px),
     .argument = "PX",
     .doc = "the camera turns with the targets, each frame in a direction of its own, so that "
            "stars streak by this; image processing knows it (default 0)",
     .minimum = 0,
     .maximum = 1000},
    {.name = "module",
     .kind = BST_OPTION_FLAG,
     .offset = offsetof(bst_pd_request, options.by_module),
     .doc = "step the scenario's imgproc module as a run does; always so of one that does not "
            "come with Boresight"},
    {.name = "sensor",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(bst_pd_request, options.sensor),
     .argument = "OBSERVER/SENSOR",
     .doc = "whose camera and detector (default the first)"},
    BST_LOAD_OPTIONS_AT(FIELD, load),
    BST_DEVICE_OPTIONS_AT(FIELD, options.device, threads),
    {.name = "help",
     .kind = BST_OPTION_FLAG,
     .offset = offsetof(bst_pd_request, help),
     .doc = "print this"},
    {.name = NULL},
};

bst_status bst_pd_range_read(bst_ctx *ctx, const char *name, const char *example, const char *text,
                             double low, double high, bst_pd_options *out) {
    double v[3];
    char *end = (char *)text;
    for (int i = 0; i < 3; i++) {
        const char *from = end;
        v[i] = strtod(from, &end);
        if (end == from || !isfinite(v[i]) || *end != (i < 2 ? ':' : '\0')) {
            return bst_fail(ctx, BST_ERR_ARGUMENT,
                            "--%s \"%s\" is not FIRST:LAST:STEP, for example %s", name, text,
                            example);
        }
        end += i < 2;
    }
    if (!(v[0] >= low && v[1] <= high && v[0] <= v[1] && v[2] > 0.0)) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "--%s \"%s\": %g to %g, the first not above the last, and a step above 0",
                        name, text, low, high);
    }
    if ((v[1] - v[0]) / v[2] >= BST_PD_POINTS) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "--%s \"%s\" has more than %d steps", name, text,
                        BST_PD_POINTS);
    }
    out->low = v[0];
    out->high = v[1];
    out->step = v[2];
    return BST_OK;
}

bst_status bst_pd_list_read(bst_ctx *ctx, const char *text, bst_pd_list *list) {
    double v[BST_PD_POINTS];
    const char *at = text;
    int n = 0;
    assert(list->most <= BST_PD_POINTS);
    for (bool more = true; more; at += more) {
        char *end;
        double value = strtod(at, &end);
        more = *end == ',';
        if (end == at || !isfinite(value) || (!more && *end != '\0')) {
            return bst_fail(ctx, BST_ERR_ARGUMENT,
                            "--%s \"%s\" is not a list of numbers, for example %s", list->name,
                            text, list->example);
        }
        if (!(value >= list->low && value <= list->high) || (n > 0 && value <= v[n - 1])) {
            return bst_fail(ctx, BST_ERR_ARGUMENT,
                            "--%s \"%s\": numbers from %g to %g, each above the one before",
                            list->name, text, list->low, list->high);
        }
        if (n == list->most) {
            return bst_fail(ctx, BST_ERR_ARGUMENT, "--%s \"%s\" has more than %d numbers",
                            list->name, text, list->most);
        }
        v[n++] = value;
        at = end;
    }
    memcpy(list->values, v, (size_t)n * sizeof *v);
    list->count = n;
    return BST_OK;
}

/* Reads the SNRs of pairs: a list, or FIRST:LAST:STEP. */
static bst_status read_pair_snrs(bst_ctx *ctx, const char *text, bst_pd_request *r) {
    bst_pd_pair_options *p = &r->pairs;
    if (!strchr(text, ':')) {
        bst_pd_list list = {"snr", "20,50,100", LEAST_PAIR_SNR, 1e4, p->snr, BST_PD_PAIR_SNRS, 0};
        BST_TRY(bst_pd_list_read(ctx, text, &list));
        p->snrs = list.count;
        return BST_OK;
    }
    bst_pd_options range;
    BST_TRY(bst_pd_range_read(ctx, "snr", "20:100:20", text, LEAST_PAIR_SNR, 1e4, &range));
    p->snrs = (int)floor((range.high - range.low) / range.step + 1e-9) + 1;
    if (p->snrs > BST_PD_PAIR_SNRS) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "--snr \"%s\": with --pair at most %d SNRs", text,
                        BST_PD_PAIR_SNRS);
    }
    for (int i = 0; i < p->snrs; i++) {
        p->snr[i] = range.low + i * range.step;
    }
    return BST_OK;
}

/* Reads what --pair measures, and refuses options of other measurements. */
static bst_status settle_pairs(bst_ctx *ctx, bst_pd_request *r) {
    bst_pd_options *o = &r->options;
    bst_pd_pair_options *p = &r->pairs;
    const struct {
        const char *name;
        bool given;
    } other[] = {{"magnitude", r->magnitudes},  {"stack", o->stack > 0},
                 {"stars", o->stars},           {"star-streak", o->star_streak_px > 0.0},
                 {"known-rate", o->known_rate}, {"empty-frames", o->empty_frames > 0}};
    for (size_t i = 0; i < sizeof other / sizeof *other; i++) {
        if (other[i].given) {
            return bst_fail(
                ctx, BST_ERR_ARGUMENT,
                "--pair measures pairs over SNR in single frames without stars, streaks "
                "with known motion: leave out --%s",
                other[i].name);
        }
    }
    o->trials = o->trials > 0 ? o->trials : 300;
    BST_TRY(read_pair_snrs(ctx, r->range ? r->range : "20,50,100,200", r));
    if (r->separations) {
        bst_pd_list list = {
            "separation", "0.8,1,1.3", 0.01, 1000.0, p->separation_px, BST_PD_PAIR_SEPARATIONS, 0};
        BST_TRY(bst_pd_list_read(ctx, r->separations, &list));
        p->separations = list.count;
    }
    bst_pd_list list = {"ratio", "1,4", 1.0, 1000.0, p->ratio, BST_PD_PAIR_RATIOS, 0};
    BST_TRY(bst_pd_list_read(ctx, r->ratios ? r->ratios : "1,4", &list));
    p->ratios = list.count;
    return BST_OK;
}

/* Reads what a measurement over SNR or magnitude takes. */
static bst_status settle_curve(bst_ctx *ctx, bst_pd_request *r) {
    bst_pd_options *o = &r->options;
    if (r->range && r->magnitudes) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "give --snr or --magnitude, not both");
    }
    o->trials = o->trials > 0 ? o->trials : 1000;
    o->by_magnitude = r->magnitudes;
    BST_TRY(r->magnitudes
                ? bst_pd_range_read(ctx, "magnitude", "12:18:0.25", r->magnitudes, -30.0, 40.0, o)
                : bst_pd_range_read(ctx, "snr", "2:12:0.5",
                                    r->range       ? r->range
                                    : o->stack > 0 ? "0.8:2.4:0.1"
                                                   : "2:12:0.5",
                                    0.1, 1e4, o));
    if (o->known_rate && o->star_streak_px > 0.0) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "with --known-rate stars streak as targets do: leave out --star-streak");
    }
    if (o->stack % 4 != 0) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "--stack %lld: a multiple of 4",
                        (long long)o->stack);
    }
    if (o->stack > 0 && (o->streak_px > 0.0 || o->star_streak_px > 0.0)) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "--stack is of points: leave out --streak and --star-streak");
    }
    if (o->stars && o->background_e >= 0.0) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "--stars keeps the scenario's sky, --background sets another: give one");
    }
    return BST_OK;
}

bst_status bst_pd_request_settle(bst_ctx *ctx, bst_pd_request *r, const bst_option *table) {
    if (!r->pair && r->options.known_rate && !(r->options.streak_px > 0.0)) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "--known-rate is of streaks: give their length with --streak PX");
    }
    r->options.threads = (int)r->threads;
    BST_TRY(r->pair ? settle_pairs(ctx, r) : settle_curve(ctx, r));
    return bst_load_check(ctx, &r->load, table);
}
