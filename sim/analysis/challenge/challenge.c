#include "sim/analysis/challenge/challenge.h"

#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "sim/analysis/check/check_run.h"
#include "sim/core/folder.h"
#include "sim/io/csv.h"
#include "sim/io/draft_file.h"

#define Q bst_challenge_request
#define FIELD(member) .offset = offsetof(bst_challenge_request, member)
const bst_option bst_challenge_options[] = {
    {.name = "out",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(Q, out),
     .path = BST_PATH_OUTPUT_FOLDER,
     .argument = "FOLDER",
     .doc = "new folder: public/ for those who take part, truth/ for who scores them",
     .required = true},
    {.name = "sequences",
     .kind = BST_OPTION_INT,
     .offset = offsetof(Q, sequences),
     .argument = "N",
     .doc = "sequences of five frames (default 8)",
     .minimum = 1,
     .maximum = 10000},
    {.name = "size-px",
     .kind = BST_OPTION_INT,
     .offset = offsetof(Q, size_px),
     .argument = "N",
     .doc = "width and height of a frame (default 640)",
     .minimum = 64,
     .maximum = 4096},
    {.name = "catalogue",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(Q, catalogue),
     .argument = "NAME",
     .doc = "a star catalogue's path, embedded, or default"},
    BST_DEVICE_OPTIONS_AT(FIELD, device, threads),
    {.name = "help", .kind = BST_OPTION_FLAG, .offset = offsetof(Q, help), .doc = "print this"},
    {.name = NULL},
};
#undef Q
#undef FIELD

/* Runs the scenario in truth/. */
static bst_status run_scenario(bst_ctx *ctx, const bst_challenge_request *q) {
    char path[4200], out[4200];
    snprintf(path, sizeof path, "%.4000s/truth/scenario.json", q->out);
    snprintf(out, sizeof out, "%.4000s/truth/run", q->out);
    const bst_simulation_options options = {
        .device = q->device, .threads = (int)q->threads, .parallel = true};
    const bst_run_request request = {.out = out, .progress = isatty(STDERR_FILENO)};
    return bst_check_run_file(ctx, path, (bst_load_options)BST_LOAD_DEFAULTS, q->table, &options,
                              &request);
}

/* Frames as those who take part get them. */
static const char public_sql[] =
    "SELECT exposure_id / 5 + 1 AS sequence, exposure_id % 5 + 1 AS frame, fits_index + 1 AS "
    "hdu, start_utc, exposure_s FROM frames ORDER BY exposure_id";
/* The truth: every frame has a line, without a position if nothing is in it. */
static const char truth_sql[] =
    "SELECT e.exposure_id / 5 + 1 AS sequence, e.exposure_id % 5 + 1 AS frame, t.x_centroid_px AS "
    "x, t.y_centroid_px AS y, t.id AS id, t.snr AS snr FROM exposures e LEFT JOIN truth t ON "
    "t.sensor = e.sensor AND t.exposure_id = e.exposure_id AND t.kind = 'object' AND t.in_field = "
    "1 AND t.occulted = 0 AND t.electrons > 0 ORDER BY e.exposure_id, t.id";

/* Writes the tables, and moves the frames to public/. */
static bst_status publish(bst_ctx *ctx, const bst_challenge_request *q) {
    char run[4200], from[4300], to[4200];
    bst_run_reader *reader;
    snprintf(run, sizeof run, "%.4000s/truth/run", q->out);
    BST_TRY(bst_run_reader_open(ctx, run, &reader));
    snprintf(to, sizeof to, "%.4000s/public/frames.csv", q->out);
    bst_status status = bst_csv_write(ctx, reader, public_sql, to, NULL, NULL, NULL);
    if (status == BST_OK) {
        snprintf(to, sizeof to, "%.4000s/truth/truth.csv", q->out);
        status = bst_csv_write(ctx, reader, truth_sql, to, NULL, NULL, NULL);
    }
    bst_run_reader_close(reader);
    BST_TRY(status);
    snprintf(from, sizeof from, "%s/frames.fits", run);
    snprintf(to, sizeof to, "%.4000s/public/frames.fits", q->out);
    return rename(from, to) == 0 ? BST_OK
                                 : bst_fail(ctx, BST_ERR_IO, "%s: cannot be moved to %s: %s", from,
                                            to, strerror(errno));
}

bst_status bst_challenge_make(bst_ctx *ctx, const bst_challenge_request *q) {
    char folder[4200];
    if (strlen(q->out) > 3900) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "%.80s...: the path is too long", q->out);
    }
    if (access(q->out, F_OK) == 0) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "%s: is there already; give a new folder", q->out);
    }
    snprintf(folder, sizeof folder, "%.4000s/public", q->out);
    BST_TRY(bst_folder_make(ctx, folder));
    snprintf(folder, sizeof folder, "%.4000s/truth", q->out);
    BST_TRY(bst_folder_make(ctx, folder));
    BST_TRY(bst_challenge_write_scenario(ctx, q, folder));
    BST_TRY(run_scenario(ctx, q));
    BST_TRY(publish(ctx, q));
    printf("%s/public: %" PRId64 " sequences of %d frames\n", q->out, q->sequences,
           BST_CHALLENGE_FRAMES);
    printf("%s/truth/truth.csv: for boresight score; keep the folder and the seed secret\n",
           q->out);
    return BST_OK;
}
