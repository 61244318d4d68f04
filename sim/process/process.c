#include "sim/process/process.h"

#include <assert.h>
#include <stdio.h>
#include <unistd.h>

#include "sim/analysis/check/check_run.h"
#include "sim/cli/outputs.h"
#include "sim/process/process_internal.h"

#define Q bst_process_request
const bst_option bst_process_options[] = {
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
    {.name = "overwrite",
     .kind = BST_OPTION_FLAG,
     .offset = offsetof(Q, overwrite),
     .doc = "replace earlier results there"},
    {.name = "scale",
     .kind = BST_OPTION_REAL,
     .offset = offsetof(Q, scale_arcsec),
     .argument = "ARCSEC",
     .doc = "pixel scale, in place of the headers'",
     .minimum = 0.01,
     .maximum = 600},
    {.name = "scale-tolerance",
     .kind = BST_OPTION_REAL,
     .offset = offsetof(Q, scale_tolerance),
     .argument = "SHARE",
     .doc = "largest relative error of the scale (default 0.05)",
     .minimum = 0,
     .maximum = 0.1},
    {.name = "v-limit",
     .kind = BST_OPTION_REAL,
     .offset = offsetof(Q, v_limit),
     .argument = "V",
     .doc = "faintest stars that the frames surely show (default the map's star_limit_v_mag)",
     .minimum = 1,
     .maximum = 20},
    {.name = "least-snr",
     .kind = BST_OPTION_REAL,
     .offset = offsetof(Q, least_snr),
     .argument = "SNR",
     .doc = "faintest detections that are used for the attitude (default 12)",
     .minimum = 5,
     .maximum = 1000},
    {.name = "flip",
     .kind = BST_OPTION_CHOICE,
     .offset = offsetof(Q, flip),
     .argument = "auto|no|yes",
     .doc = "whether the camera's first row is the file's last (default auto: as the stars are)"},
    {.name = "catalogue",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(Q, catalogue),
     .argument = "NAME",
     .doc = "a star catalogue's path, embedded, or default"},
    {.name = "set",
     .kind = BST_OPTION_LIST,
     .offset = offsetof(Q, set),
     .argument = "/PATH=VALUE",
     .doc = "override a value of the scenario that is made; may be given several times"},
    {.name = "prepare",
     .kind = BST_OPTION_FLAG,
     .offset = offsetof(Q, prepare),
     .doc = "only find the attitudes and write the scenario"},
    {.name = "threads",
     .kind = BST_OPTION_INT,
     .offset = offsetof(Q, threads),
     .argument = "N",
     .doc = "threads (default all)",
     .minimum = 1,
     .maximum = 1024},
    {.name = "quiet",
     .kind = BST_OPTION_FLAG,
     .offset = offsetof(Q, quiet),
     .doc = "no progress line"},
    {.name = "help", .kind = BST_OPTION_FLAG, .offset = offsetof(Q, help), .doc = "print this"},
    {.name = NULL},
};
#undef Q

/* Warns if no frame has an attitude: directions then say nothing of the sky. */
static void warn_without_attitude(bst_ctx *ctx, const bst_process *p) {
    for (int i = 0; i < p->count; i++) {
        if (p->frames[i].solved || p->frames[i].has_header_attitude) {
            return;
        }
    }
    bst_log(ctx, BST_LOG_WARNING,
            "no frame has an attitude, from its stars or by the map: all are taken to point at the "
            "celestial north pole; look at pixel scale, --v-limit and --flip");
}

/* Says what the stars gave. */
static void print_solved(const bst_process *p) {
    const bst_process_frame *first = NULL;
    for (int i = 0; i < p->count && !first; i++) {
        first = p->frames[i].solved ? &p->frames[i] : NULL;
    }
    printf("frames     %d of %d x %d px, attitude from the stars in %d\n", p->count, p->width,
           p->height, p->solved);
    if (first) {
        printf("stars      %d of %d of the catalogue matched in the first of them, rms %.2f px\n",
               first->matched, first->predicted, first->rms_px);
        printf("scale      %.5f arcsec/px%s\n", p->scale_arcsec,
               p->options.flip_rows ? ", first row last" : "");
    }
    if (first && !first->points) {
        printf("streaks    %.1f px from end to end%s\n", first->streak_px,
               p->direction_known ? "" : "; which end came first is not known");
    }
    if (!p->placed) {
        printf(
            "observer   not in the headers: assumed beyond the sky's reach, up to 5 arcsec of "
            "aberration\n");
    }
    fflush(stdout);
}

/* Runs the scenario that was written. */
static bst_status run_input(bst_ctx *ctx, const bst_process *p) {
    const bst_process_request *q = p->request;
    char path[4096], out[4096];
    bst_load_options load = BST_LOAD_DEFAULTS;
    load.set = q->set;
    BST_TRY(bst_process_path(ctx, p, "input/scenario.json", path));
    BST_TRY(bst_process_path(ctx, p, "run", out));
    const bst_simulation_options options = {
        .device = q->device, .threads = (int)q->threads, .parallel = true};
    const bst_run_request request = {
        .out = out, .overwrite = q->overwrite, .progress = !q->quiet && isatty(STDERR_FILENO)};
    return bst_check_run_file(ctx, path, load, q->table, &options, &request);
}

/* Refuses a folder that holds a run of before. */
static bst_status check_out(bst_ctx *ctx, const bst_process *p) {
    char path[4096];
    BST_TRY(bst_process_path(ctx, p, "run", path));
    return bst_outputs_refuse_earlier(ctx, path, p->request->overwrite);
}

bst_status bst_process_frames(bst_ctx *ctx, const bst_process_request *request,
                              const char *const *paths, int count) {
    assert(request && request->map && request->out && paths && count > 0);
    bst_process p = {.request = request};
    bst_status status = check_out(ctx, &p);
    if (status == BST_OK) {
        status = bst_process_survey(ctx, &p, paths, count);
    }
    if (status == BST_OK) {
        status = bst_process_solve(ctx, &p);
    }
    if (status == BST_OK) {
        print_solved(&p);
        warn_without_attitude(ctx, &p);
        status = bst_process_write_input(ctx, &p);
    }
    if (status == BST_OK && !request->prepare) {
        status = run_input(ctx, &p);
        if (status == BST_OK) {
            status = bst_process_write_products(ctx, &p);
        }
    }
    bst_process_free(&p);
    return status;
}
