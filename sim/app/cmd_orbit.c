/* boresight orbit: an orbit from the directions that a run measured, or a TDM holds. */
#include <stdio.h>

#include "sim/analysis/orbit/orbit_determination.h"
#include "sim/app/app.h"
#include "sim/cli/options.h"

static const char help_text[] =
    "usage: boresight orbit RUN [options]\n"
    "       boresight orbit FILE.tdm --observer FILE.oem [options]\n"
    "\n"
    "Finds the orbit of a track from its measured directions alone: a first orbit (Gauss's method, "
    "the admissible\n"
    "region, two-point searches; chosen by residuals), then batch least squares over the whole arc "
    "with numerically\n"
    "integrated motion or SGP4, light time and the observer's states as the spacecraft believes "
    "them. True states are\n"
    "not used; of the scenario only the law that moves the object (--forces).\n"
    "\n"
    "  boresight orbit runs/first\n"
    "  boresight orbit runs/first --oem target.oem --omm target.json --predict 86400\n"
    "  boresight orbit runs/first --track 3 --tdm angles.tdm --report orbit.json\n"
    "  boresight orbit angles.tdm --observer eye.oem --sigma 0.5 --oem target.oem\n"
    "\n"
    "Without --track it is the track of interest with the most observations, else the track with "
    "the most.\n"
    "\n"
    "options:\n";

typedef struct orbit_request {
    bst_orbit_determination wanted;
    bool help;
} orbit_request;

static const bst_option OPTIONS[] = {
    {.name = "track",
     .kind = BST_OPTION_INT,
     .offset = offsetof(orbit_request, wanted.choice.track),
     .argument = "ID",
     .doc = "this track (column track_id of the table tracks)",
     .minimum = 1,
     .maximum = 9e15},
    {.name = "sensor",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(orbit_request, wanted.choice.sensor),
     .argument = "NAME",
     .doc = "tracks of this sensor only: name or observer/name"},
    {.name = "observer",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(orbit_request, wanted.choice.angles.observer),
     .path = BST_PATH_INPUT,
     .argument = "FILE",
     .doc = "TDM: the observer's states, as CCSDS OEM"},
    {.name = "observer-name",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(orbit_request, wanted.choice.angles.observer_name),
     .argument = "NAME",
     .doc = "TDM: its object in that file (default the participant's name, or the only one)"},
    {.name = "object",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(orbit_request, wanted.choice.angles.object),
     .argument = "NAME",
     .doc = "TDM: angles of this participant (default the one with the most)"},
    {.name = "sigma",
     .kind = BST_OPTION_REAL,
     .offset = offsetof(orbit_request, wanted.sigma_arcsec),
     .argument = "ARCSEC",
     .doc = "TDM: standard deviation of the angles, per axis (default 1)",
     .minimum = 1e-6,
     .maximum = 36000},
    {.name = "aberration",
     .kind = BST_OPTION_CHOICE,
     .offset = offsetof(orbit_request, wanted.aberration),
     .argument = "removed|contained",
     .doc = "TDM: whether the observer's stellar aberration is still in the angles (default "
            "removed)"},
    {.name = "forces",
     .kind = BST_OPTION_CHOICE,
     .offset = offsetof(orbit_request, wanted.forces),
     .argument = "scenario|full|j2|two_body|sgp4",
     .doc = "what moves the object: the law of its orbit in the scenario, SGP4 or forces "
            "(default; TDM: full); gravity to degree 20, Sun and Moon; oblateness alone; a "
            "point mass; SGP4"},
    {.name = "reject",
     .kind = BST_OPTION_REAL,
     .offset = offsetof(orbit_request, wanted.reject_chi2),
     .argument = "CHI2",
     .doc = "leave out observations beyond this chi-square of 2 degrees of freedom (default "
            "30; 0: none)",
     .minimum = 0,
     .maximum = 1e9},
    {.name = "oem",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(orbit_request, wanted.oem),
     .path = BST_PATH_OUTPUT,
     .argument = "FILE",
     .doc = "the orbit with its covariance, as CCSDS OEM in GCRF"},
    {.name = "predict",
     .needs = "oem",
     .kind = BST_OPTION_REAL,
     .offset = offsetof(orbit_request, wanted.predict_s),
     .argument = "S",
     .doc = "oem: go on for so long after the last observation (default 0)",
     .minimum = 0,
     .maximum = 1e7},
    {.name = "step",
     .needs = "oem",
     .kind = BST_OPTION_REAL,
     .offset = offsetof(orbit_request, wanted.step_s),
     .argument = "S",
     .doc = "oem: time between states (default 60, or a twentieth of a short arc)",
     .minimum = 1e-3,
     .maximum = 86400},
    {.name = "omm",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(orbit_request, wanted.omm),
     .path = BST_PATH_OUTPUT,
     .argument = "FILE",
     .doc = "mean elements for SGP4 fitted to the orbit, as CCSDS OMM in JSON"},
    {.name = "tdm",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(orbit_request, wanted.tdm),
     .path = BST_PATH_OUTPUT,
     .argument = "FILE",
     .doc = "the track's measured directions, as CCSDS TDM"},
    {.name = "json",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(orbit_request, wanted.json),
     .path = BST_PATH_OUTPUT,
     .argument = "FILE",
     .doc = "the same as JSON: obTime, ra, declination ... senvelz"},
    {.name = "report",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(orbit_request, wanted.report),
     .path = BST_PATH_OUTPUT,
     .argument = "FILE",
     .doc = "state, covariance, elements and residuals, as JSON"},
    {.name = "help",
     .kind = BST_OPTION_FLAG,
     .offset = offsetof(orbit_request, help),
     .doc = "print this"},
    {.name = NULL},
};

int bst_cmd_orbit(int argc, char **argv) {
    orbit_request q = {.wanted = {.reject_chi2 = 30.0, .sigma_arcsec = 1.0}};
    bst_option options[sizeof OPTIONS / sizeof *OPTIONS];
    bst_options_bind(OPTIONS, &q, options);
    bst_ctx ctx;
    bst_ctx_init(&ctx, bst_cli_log, NULL, BST_LOG_WARNING);
    int arguments = 0;
    if (bst_options_parse(&ctx, options, argc, argv, &arguments) != BST_OK) {
        return bst_options_misuse(&ctx, "orbit");
    }
    if (q.help) {
        fputs(help_text, stdout);
        bst_options_print(stdout, options);
        return BST_EXIT_OK;
    }
    if (arguments != 1) {
        bst_fail(&ctx, BST_ERR_ARGUMENT,
                 "one folder of a run, or a TDM, is expected, %d were given", arguments);
        return bst_options_misuse(&ctx, "orbit");
    }
    bst_status status = bst_orbit_determine(&ctx, &q.wanted, argv[1]);
    if (status != BST_OK) {
        fprintf(stderr, "boresight orbit: %s\n", ctx.message);
    }
    return status == BST_OK ? BST_EXIT_OK : BST_EXIT_FAILED;
}
