#include "sim/process/twin/twin.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sim/cli/load.h"
#include "sim/cli/outputs.h"
#include "sim/process/twin/twin_internal.h"

#define Q bst_twin_request
#define FIELD(member) .offset = offsetof(bst_twin_request, member)
const bst_option bst_twin_options[] = {
    {.name = "map",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(Q, map),
     .argument = "MAP",
     .doc = "keyword map: neossat, boresight, satnet, table, or the path of a JSON file",
     .required = true},
    {.name = "out",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(Q, out),
     .path = BST_PATH_OUTPUT,
     .argument = "FILE",
     .doc = "where the scenario goes; its other files go beside it",
     .required = true},
    {.name = "overwrite",
     .kind = BST_OPTION_FLAG,
     .offset = offsetof(Q, overwrite),
     .doc = "replace earlier results there"},
    {.name = "frame",
     .kind = BST_OPTION_INT,
     .offset = offsetof(Q, frame),
     .argument = "N",
     .doc = "number of the frame, in the order of time (default the first with an attitude)",
     .minimum = 1,
     .maximum = 1e6},
    {.name = "catalogue-only",
     .kind = BST_OPTION_FLAG,
     .offset = offsetof(Q, catalogue_only),
     .doc = "the twin has the catalogue's stars with the catalogue's brightness, and no others"},
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
    BST_DEVICE_OPTIONS_AT(FIELD, device, threads),
    {.name = "quiet",
     .kind = BST_OPTION_FLAG,
     .offset = offsetof(Q, quiet),
     .doc = "no progress line"},
    {.name = "help", .kind = BST_OPTION_FLAG, .offset = offsetof(Q, help), .doc = "print this"},
    {.name = NULL},
};
#undef FIELD
#undef Q

/* Finds the attitudes of the frames, and chooses the one that gets a twin. */
static bst_status solve(bst_ctx *ctx, bst_twin *t, const char *const *paths, int count) {
    const bst_twin_request *q = t->request;
    bst_process *p = &t->process;
    t->process_request = (bst_process_request)BST_PROCESS_REQUEST_DEFAULTS;
    t->process_request.map = q->map;
    t->process_request.out = q->out;
    t->process_request.catalogue = q->catalogue;
    t->process_request.device = q->device;
    t->process_request.scale_arcsec = q->scale_arcsec;
    t->process_request.scale_tolerance = q->scale_tolerance;
    t->process_request.v_limit = q->v_limit;
    t->process_request.least_snr = q->least_snr;
    t->process_request.flip = q->flip;
    p->request = &t->process_request;
    BST_TRY(bst_process_survey(ctx, p, paths, count));
    if (q->frame > p->count) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "--frame %lld: %d frames were given (allowed: 1 "
                        "to %d)",
                        (long long)q->frame, p->count, p->count);
    }
    BST_TRY(bst_process_solve(ctx, p));
    for (int i = 0; i < p->count && !t->frame; i++) {
        bool wanted = q->frame > 0 ? i + 1 == q->frame : p->frames[i].solved;
        t->frame = wanted ? &p->frames[i] : NULL;
    }
    if (!t->frame || !t->frame->solved) {
        const bst_process_frame *f = t->frame ? t->frame : &p->frames[0];
        char where[BST_FRAME_WHERE_TEXT];
        return bst_fail(ctx, BST_ERR_NOT_FOUND,
                        "%s: its stars give no attitude (%d detections of SNR %g); see "
                        "--scale, --v-limit, --least-snr and --catalogue",
                        bst_frame_where(f->path, &f->place, where), f->found, q->least_snr);
    }
    t->light = bst_process_light(t->frame);
    t->julian_year = bst_process_julian_year(t->frame);
    return BST_OK;
}

static void twin_free(bst_twin *t) {
    free(t->data_e);
    free(t->defects);
    free(t->model.stars);
    free(t->model.variance_e2);
    bst_parallel_free(t->pool);
    bst_process_free(&t->process);
}

/* Path without its ending. */
static bst_status set_stem(bst_ctx *ctx, bst_twin *t) {
    const char *out = t->request->out;
    size_t length = strlen(out);
    if (length < 6 || length > 3900 || strcmp(out + length - 5, ".json") != 0) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "--out %.300s: the scenario's name must end in .json (allowed: up to 3900 "
                        "bytes)",
                        out);
    }
    snprintf(t->stem, sizeof t->stem, "%.*s", (int)length - 5, out);
    return BST_OK;
}

/* Checks the files beside the scenario as its own path is checked. */
static bst_status check_outputs(bst_ctx *ctx, const bst_twin *t, const char *const *paths,
                                int count) {
    static const char *const endings[] = {"_path.json",  "_psf.fits",    "_stars.bin",
                                          "_run",        "_report.json", "_report.html",
                                          "_report.png", "_dark.fits"};
    enum { FILES = sizeof endings / sizeof *endings };
    char names[FILES][4096];
    const char *targets[FILES];
    bst_option table[FILES + 1] = {{.name = NULL}};
    bool given[FILES + 1] = {false};
    BST_TRY(bst_outputs_refuse_earlier(ctx, t->request->out, t->request->overwrite));
    for (int i = 0; i < FILES; i++) {
        bst_twin_file(t, endings[i], names[i]);
        BST_TRY(bst_outputs_refuse_earlier(ctx, names[i], t->request->overwrite));
        targets[i] = names[i];
        given[i] = true;
        table[i] = (bst_option){
            .name = "out",
            .kind = BST_OPTION_TEXT,
            .target = &targets[i],
            .path = strcmp(endings[i], "_run") == 0 ? BST_PATH_OUTPUT_FOLDER : BST_PATH_OUTPUT};
    }
    return bst_outputs_check(ctx, table, given, count, (char *const *)(uintptr_t)paths);
}

bst_status bst_twin_make(bst_ctx *ctx, const bst_twin_request *request, const char *const *paths,
                         int count) {
    assert(request && request->map && request->out && paths && count > 0);
    bst_twin t = {.request = request};
    bst_status status = set_stem(ctx, &t);
    if (status == BST_OK) {
        status = check_outputs(ctx, &t, paths, count);
    }
    if (status == BST_OK) {
        status = bst_parallel_create(ctx, (int)request->threads, &t.pool);
    }
    if (status == BST_OK) {
        status = solve(ctx, &t, paths, count);
    }
    if (status == BST_OK) {
        status = bst_twin_fit_frame(ctx, &t);
    }
    bst_twin_camera camera = {.spectrum = NULL};
    if (status == BST_OK) {
        status = bst_twin_write(ctx, &t, &camera);
    }
    if (status == BST_OK) {
        status = bst_twin_report(ctx, &t, &camera);
    }
    bst_band_free(camera.spectrum);
    twin_free(&t);
    return status;
}
