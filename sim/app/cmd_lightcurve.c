/* boresight lightcurve: magnitude of an object against time. */
#include "sim/analysis/shape/light_curve.h"
#include "sim/app/app.h"
#include "sim/cli/command_line.h"
#include "sim/cli/load.h"
#include "sim/io/plot.h"

static const char help_text[] =
    "usage: boresight lightcurve SCENARIO.json [options]\n"
    "       boresight lightcurve --satellite FILE --elements FILE --norad N --start UTC "
    "[options]\n\n"
    "Prints the V magnitude of an object against time as CSV, with phase angle, range, the "
    "visible\n"
    "part of the Sun and the fraction that is earthlight: of an object of a scenario as its "
    "observer\n"
    "sees it, or of a satellite's shape on the orbit of an element set. With --site the observer "
    "is\n"
    "on the ground, and extinction is added. Rows without a magnitude: in the shadow, behind the\n"
    "Earth, below the horizon, or no lit side of the object is seen.\n\n"
    "  boresight lightcurve --satellite scenarios/satellites/starlink_v1_5.json --elements "
    "all.tle \\\n"
    "      --norad 44713 --start 2022-06-16T04:00:00Z --site 32.44,-110.79,2790 --plot "
    "curve.png\n\n"
    "options:\n";

/* The option table; it holds pointers into the request and the load options. */
#define OPTION(name_, kind_, target_, argument_, needs_, doc_)                                   \
    {                                                                                            \
        .name = name_, .kind = kind_, .target = target_, .argument = argument_, .needs = needs_, \
        .doc = doc_                                                                              \
    }
#define NUMBER(name_, kind_, target_, argument_, needs_, doc_, min_, max_)                       \
    {                                                                                            \
        .name = name_, .kind = kind_, .target = target_, .argument = argument_, .needs = needs_, \
        .doc = doc_, .minimum = min_, .maximum = max_                                            \
    }
#define FILE_OPTION(name_, target_, path_, needs_, doc_)                               \
    {                                                                                  \
        .name = name_, .kind = BST_OPTION_TEXT, .target = target_, .argument = "FILE", \
        .path = path_, .needs = needs_, .doc = doc_                                    \
    }

/* Refuses options that have no effect on the curve of what is given. */
static bst_status check_use(bst_ctx *ctx, const bst_light_curve_request *r,
                            const bst_load_options *load) {
    const char *const of_scenario[] = {r->object ? "object" : NULL, r->observer ? "observer" : NULL,
                                       load->set.count > 0 ? "set" : NULL};
    for (size_t i = 0; r->satellite && i < sizeof of_scenario / sizeof *of_scenario; i++) {
        if (of_scenario[i]) {
            return bst_fail(ctx, BST_ERR_ARGUMENT,
                            "--%s is for a scenario, and --satellite was given: leave one of them "
                            "out",
                            of_scenario[i]);
        }
    }
    const char *const observers[] = {r->site ? "site" : NULL, r->observer ? "observer" : NULL,
                                     r->observer_norad > 0 ? "observer-norad" : NULL};
    return bst_options_one_of(ctx, observers, sizeof observers / sizeof *observers);
}

int bst_cmd_lightcurve(int argc, char **argv) {
    bool help = false;
    bst_load_options load = {.duration_s = -1.0, .run = -1};
    bst_light_curve_request r = BST_LIGHT_CURVE_DEFAULTS;
    const bst_option table[] = {
        FILE_OPTION("satellite", &r.satellite, BST_PATH_INPUT, NULL,
                    "shape of the satellite, in place of a scenario: JSON, OBJ, glTF or GLB"),
        FILE_OPTION("elements", &r.elements, BST_PATH_INPUT, "satellite",
                    "element sets: TLE, or OMM as JSON or CSV"),
        NUMBER("norad", BST_OPTION_INT, &r.norad, "N", "satellite",
               "catalogue number of the satellite", 1, 1e9),
        NUMBER("observer-norad", BST_OPTION_INT, &r.observer_norad, "N", "satellite",
               "catalogue number of the observer, from the same file", 1, 1e9),
        OPTION("attitude", BST_OPTION_TEXT, &r.attitude, "LAW|JSON", "satellite",
               "of --satellite: nadir (default), nadir_sun, velocity, sun or inertial, or as in "
               "scenarios"),
        {.name = "earthshine",
         .kind = BST_OPTION_FLAG,
         .target = &r.earthshine,
         .needs = "satellite",
         .doc = "--satellite with sunlight that the Earth reflects"},
        OPTION("object", BST_OPTION_TEXT, &r.object, "NAME", NULL,
               "object of the scenario (default the first one)"),
        OPTION("observer", BST_OPTION_TEXT, &r.observer, "NAME", NULL,
               "observer of the scenario (default the first one)"),
        OPTION("site", BST_OPTION_TEXT, &r.site, "LAT,LON,HEIGHT", NULL,
               "observer on the ground: degrees and metres above the ellipsoid"),
        NUMBER("extinction", BST_OPTION_REAL, &r.extinction_mag, "MAG", "site",
               "extinction per air mass at the site (default 0)", 0, 10),
        OPTION("start", BST_OPTION_TEXT, &r.start, "UTC", NULL,
               "first time (default the epoch of the scenario)"),
        NUMBER("duration", BST_OPTION_REAL, &r.duration_s, "S", NULL, "length (default 3600)", 0,
               1e9),
        NUMBER("step", BST_OPTION_REAL, &r.step_s, "S", NULL, "time between rows (default 10)",
               1e-6, 1e9),
        FILE_OPTION("output", &r.output, BST_PATH_OUTPUT, NULL,
                    "write the table there instead of to the standard output"),
        FILE_OPTION("plot", &r.plot, BST_PATH_OUTPUT, NULL,
                    "magnitude and phase angle as PNG or SVG"),
        {.name = "set",
         .kind = BST_OPTION_LIST,
         .target = &load.set,
         .argument = "/PATH=VALUE",
         .doc = "override a value of the scenario; may be given several times"},
        {.name = "help", .kind = BST_OPTION_FLAG, .target = &help, .doc = "print this"},
        {.name = NULL},
    };
    bst_ctx ctx;
    bst_ctx_init(&ctx, bst_cli_log, NULL, BST_LOG_WARNING);
    const bst_command_line line = {"lightcurve", help_text, table, &help};
    int arguments = 0, code = BST_EXIT_OK;
    if (!bst_command_line_read(&ctx, &line, argc, argv, &arguments, &code)) {
        return code;
    }
    if (bst_plot_check_path(&ctx, r.plot) != BST_OK) {
        return bst_options_misuse(&ctx, "lightcurve");
    }
    if (arguments != (r.satellite ? 0 : 1)) {
        bst_fail(&ctx, BST_ERR_ARGUMENT, "give either one scenario file or --satellite");
        return bst_options_misuse(&ctx, "lightcurve");
    }
    if (check_use(&ctx, &r, &load) != BST_OK || bst_load_check(&ctx, &load, table) != BST_OK) {
        return bst_options_misuse(&ctx, "lightcurve");
    }
    if (r.satellite) {
        return bst_command_line_end_as("lightcurve", &ctx, bst_light_curve_make(&ctx, &r, NULL));
    }
    bst_json *json = NULL;
    bst_scenario scenario;
    bst_status status = bst_load_scenario(&ctx, argv[1], &load, &json, &scenario);
    if (status == BST_OK) {
        status = bst_light_curve_make(&ctx, &r, &scenario);
        bst_scenario_free(&scenario);
        bst_json_free(json);
    }
    return bst_command_line_end(&ctx, status);
}
