/* A run that begins from a saved state, ends early, or saves its state. */
#ifndef BST_RUN_RUN_SAVING_H
#define BST_RUN_RUN_SAVING_H

#include "sim/engine/simulation.h"

/* Options of a run. All zero: none of them. */
typedef struct bst_run_saving {
    double until_s;      /* end of the run; 0: the scenario's */
    double save_every_s; /* simulated time between saved states; 0: none is saved */
    const char *restore; /* file of the state to begin from; NULL: the start */
} bst_run_saving;

/* Option entries for the folder of a run: const char *out, bool overwrite_ and force_. */
#define BST_RUN_FOLDER_OPTIONS_AT(PLACE, out_, overwrite_, force_)           \
    {.name = "out",                                                          \
     .kind = BST_OPTION_TEXT,                                                \
     PLACE(out_),                                                            \
     .path = BST_PATH_OUTPUT_FOLDER,                                         \
     .argument = "FOLDER",                                                   \
     .doc = "where the results go (default runs/NAME)"},                     \
        {.name = "overwrite",                                                \
         .kind = BST_OPTION_FLAG,                                            \
         PLACE(overwrite_),                                                  \
         .doc = "replace an earlier run there"},                             \
    {                                                                        \
        .name = "force", .kind = BST_OPTION_FLAG, PLACE(force_),             \
        .doc = "start although the frames will take more space than is free" \
    }

/* Option entries that fill a bst_run_saving; PLACE as in BST_LOAD_OPTIONS_AT. */
#define BST_RUN_SAVING_OPTIONS_AT(PLACE, saving)                                                   \
    {.name = "until",                                                                              \
     .kind = BST_OPTION_REAL,                                                                      \
     PLACE(saving.until_s),                                                                        \
     .argument = "S",                                                                              \
     .doc = "end the run at this simulated time; it is complete",                                  \
     .minimum = 1e-6,                                                                              \
     .maximum = 1e9},                                                                              \
        {.name = "save-every",                                                                     \
         .kind = BST_OPTION_REAL,                                                                  \
         PLACE(saving.save_every_s),                                                               \
         .argument = "S",                                                                          \
         .doc = "save the whole state to OUT.partial/state each time so much is simulated",        \
         .minimum = 1e-6,                                                                          \
         .maximum = 1e9},                                                                          \
    {                                                                                              \
        .name = "restore", .kind = BST_OPTION_TEXT, PLACE(saving.restore), .path = BST_PATH_INPUT, \
        .argument = "FILE",                                                                        \
        .doc = "begin from a saved state; OUT.partial/state resumes that run exactly"              \
    }

/* A saved state from which a run begins. */
typedef struct bst_run_restored bst_run_restored;

/* Checks the options and reads the saved state of saving->restore.
 *
 * Given:     out      output folder of the run
 *            options  of the simulation; get the function that restores the state
 *            replay   the run repeats recorded answers of peers
 * Returned:  *restored  NULL: the run begins at the start, or an error. It must outlive the
 *            simulation
 * Errors:    BST_ERR_ARGUMENT, BST_ERR_IO, BST_ERR_FORMAT, BST_ERR_STATE with the file
 * Ownership: free *restored with bst_run_restored_free */
bst_status bst_run_restored_read(bst_ctx *ctx, const bst_scenario *scenario,
                                 const bst_run_saving *saving, const char *out, bool replay,
                                 bst_simulation_options *options,
                                 bst_run_restored **restored) BST_MUST_CHECK;
/* Begins from a state that bst_run_steering.saved has got. The scenario may have changed.
 *
 * Given:     bytes     [size] outlives *restored
 *            options   as bst_run_restored_read
 * Errors:    BST_ERR_MEMORY
 * Ownership: free *restored with bst_run_restored_free */
bst_status bst_run_restored_take(bst_ctx *ctx, const void *bytes, size_t size,
                                 bst_simulation_options *options,
                                 bst_run_restored **restored) BST_MUST_CHECK;
/* Frees a saved state; NULL is allowed. */
void bst_run_restored_free(bst_run_restored *restored);

#endif
