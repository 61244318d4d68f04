/* Reads a scenario for a command: file, overrides, shortcuts. */
#ifndef BST_CLI_LOAD_H
#define BST_CLI_LOAD_H

#include "sim/cli/options.h"
#include "sim/engine/scenario/scenario.h"

/* Options shared by several commands. */
typedef struct bst_load_options {
    bst_option_list set;
    const char *seed;
    double duration_s;     /* < 0: from the scenario */
    int64_t run;           /* < 0: from the scenario */
    const char *link;      /* address of the link; NULL: from the scenario */
    const char *link_keys; /* key file; NULL: from the scenario */
    const char *external;  /* modules that become "external", comma-separated; NULL: none */
    const char *pacing;    /* mode; NULL: from the scenario */
    const bst_option
        *table; /* option table of the command, for its outputs; set by bst_load_check */
} bst_load_options;

/* Target of the option entries below: a variable, or, in a constant table, a macro that sets
 * .offset. */
#define BST_OPTION_TARGET(variable) .target = &(variable)

/* Option entries for commands that support external modules. */
#define BST_LINK_OPTIONS_AT(PLACE, load)                                                   \
    {.name = "link",                                                                       \
     .kind = BST_OPTION_TEXT,                                                              \
     PLACE(load.link),                                                                     \
     .argument = "ADDRESS",                                                                \
     .doc = "where peers connect that play modules: tcp://127.0.0.1:PORT or ipc://PATH"},  \
        {.name = "link-keys",                                                              \
         .kind = BST_OPTION_TEXT,                                                          \
         PLACE(load.link_keys),                                                            \
         .path = BST_PATH_INPUT,                                                           \
         .argument = "FILE",                                                               \
         .doc = "keys of boresight link-keys that peers must have"},                       \
        {.name = "external",                                                               \
         .kind = BST_OPTION_TEXT,                                                          \
         PLACE(load.external),                                                             \
         .argument = "MODULE,...",                                                         \
         .doc = "modules that peers play: imgproc, tracker, control, gimbal"},             \
    {                                                                                      \
        .name = "pacing", .kind = BST_OPTION_TEXT, PLACE(load.pacing), .argument = "MODE", \
        .doc = "lockstep (default), realtime, or fast"                                     \
    }
#define BST_LINK_OPTIONS(load) BST_LINK_OPTIONS_AT(BST_OPTION_TARGET, load)

/* Option entries that fill a bst_load_options named `load`. */
#define BST_LOAD_OPTIONS_AT(PLACE, load)                                                       \
    {.name = "set",                                                                            \
     .kind = BST_OPTION_LIST,                                                                  \
     PLACE(load.set),                                                                          \
     .argument = "/PATH=VALUE",                                                                \
     .doc = "override a value of the scenario; may be given several times"},                   \
        {.name = "seed",                                                                       \
         .kind = BST_OPTION_TEXT,                                                              \
         PLACE(load.seed),                                                                     \
         .argument = "SEED",                                                                   \
         .doc = "master seed, for example 42 or 0x2A"},                                        \
        {.name = "duration",                                                                   \
         .kind = BST_OPTION_REAL,                                                              \
         PLACE(load.duration_s),                                                               \
         .argument = "S",                                                                      \
         .doc = "simulated time in seconds",                                                   \
         .minimum = 0,                                                                         \
         .maximum = 1e9},                                                                      \
    {                                                                                          \
        .name = "run-number", .kind = BST_OPTION_INT, PLACE(load.run), .argument = "N",        \
        .doc = "number of the run in a study: other random numbers, same scene", .minimum = 0, \
        .maximum = 9e15                                                                        \
    }
#define BST_LOAD_OPTIONS(load) BST_LOAD_OPTIONS_AT(BST_OPTION_TARGET, load)

#define BST_LOAD_DEFAULTS \
    { .duration_s = -1.0, .run = -1 }

/* Option entries that select the OpenCL device: `device_` is a const char *, `threads_` an
 * int64_t. */
#define BST_DEVICE_OPTIONS_AT(PLACE, device_, threads_)                                      \
    {.name = "device",                                                                       \
     .kind = BST_OPTION_TEXT,                                                                \
     PLACE(device_),                                                                         \
     .argument = "NAME",                                                                     \
     .doc = "OpenCL device: part of its name, or PLATFORM:DEVICE by number (default PoCL)"}, \
    {                                                                                        \
        .name = "threads", .kind = BST_OPTION_INT, PLACE(threads_), .argument = "N",         \
        .doc = "threads for the OpenCL device (default all)", .minimum = 1, .maximum = 1024  \
    }
#define BST_DEVICE_OPTIONS(device_, threads_) \
    BST_DEVICE_OPTIONS_AT(BST_OPTION_TARGET, device_, threads_)

/* Checks that overrides have the form /path=value; BST_ERR_ARGUMENT. `table`: options of the
 * command, stored in *options for the output checks of bst_load_scenario. */
bst_status bst_load_check(bst_ctx *ctx, bst_load_options *options,
                          const bst_option *table) BST_MUST_CHECK;

/* Checks that a scenario has the sensor OBSERVER/SENSOR; BST_ERR_NOT_FOUND lists the sensors.
 * `name` may be NULL: BST_OK. */
bst_status bst_load_check_sensor(bst_ctx *ctx, const bst_scenario *scenario,
                                 const char *name) BST_MUST_CHECK;

/* Loads `path` ("-": the standard input, as a file of the current folder), applies the options and
 * reads the scenario. *json must live as long as the scenario; free both. BST_ERR_ARGUMENT also if
 * an output of the command is an input file of the scenario. */
bst_status bst_load_scenario(bst_ctx *ctx, const char *path, const bst_load_options *options,
                             bst_json **json, bst_scenario *out) BST_MUST_CHECK;

#endif
