/* boresight export: frames, tables, orbits and observations of a run in formats that others read.
 */
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>

#include "sim/app/app.h"
#include "sim/cli/options.h"
#include "sim/cli/stop_signals.h"
#include "sim/core/folder.h"
#include "sim/export/export.h"

/* The folder for what is made: RUN.export beside the run when none is given. */
static bst_status make_folder(bst_ctx *ctx, const char *given, const bst_run_reader *run, char *out,
                              size_t bytes) {
    const char *folder = bst_run_reader_folder(run);
    int n = given ? snprintf(out, bytes, "%s", given) : snprintf(out, bytes, "%s.export", folder);
    if (n < 0 || (size_t)n >= bytes) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "%s: the path is too long", given ? given : folder);
    }
    BST_TRY(bst_folder_make(ctx, out));
    struct stat info, source;
    if (stat(out, &info) == 0 && stat(folder, &source) == 0 && source.st_ino == info.st_ino &&
        source.st_dev == info.st_dev) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "%s: is the run itself, which is not changed; choose another --out", out);
    }
    return BST_OK;
}

/* The folder of --satnet, --coco or --yolo: a relative one lies in that of --out, where there is
 * one. */
static bst_status make_set_folder(bst_ctx *ctx, const char *given, const char *base,
                                  const bst_run_reader *run, char *out, size_t bytes) {
    char path[4096];
    if (!base || given[0] == '/') {
        return make_folder(ctx, given, run, out, bytes);
    }
    BST_TRY(make_folder(ctx, base, run, out, bytes));
    if ((size_t)snprintf(path, sizeof path, "%s/%s", base, given) >= sizeof path) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "%s: the path is too long", given);
    }
    return make_folder(ctx, path, run, out, bytes);
}

static const char help_text[] =
    "usage: boresight export RUN [what] [options]\n"
    "\n"
    "Writes what a run recorded in formats that other programs read: frames as PNG pictures or a "
    "film, tables as\n"
    "CSV, the true orbits as CCSDS OEM or CZML (with the fields of view), the measured angles as "
    "CCSDS TDM, JSON\n"
    "or CSV, frames\n"
    "with annotations as SatNet has them. Interrupted and killed runs are exported as far as they "
    "go. Files appear whole or not at all and replace earlier ones; the "
    "run itself is not\n"
    "changed.\n"
    "\n"
    "  boresight export runs/demo --frames png --annotate --every 10\n"
    "  boresight export runs/demo --frames mp4 --annotate --size 800 --fps 25\n"
    "  boresight export runs/demo --table csv --tables truth,tracks --out csv\n"
    "  boresight export runs/demo --orbits oem --observations tdm\n"
    "  boresight export runs/demo --orbits czml --objects 33278,42741\n"
    "  boresight export runs/demo --satnet training --split 80,10,10\n"
    "\n"
    "what and options:\n";

enum { NOT_ASKED = -1 };

typedef struct export_request {
    bst_export e;
    const char *out, *tables;
    int frames, table, orbits, observations, stretch, angles, bits;
    bool help;
} export_request;

/* Whether the run has frames among those asked for; a run that lost its tables is not asked. */
static bst_status check_frames(bst_ctx *ctx, const bst_export *e, bool asked) {
    char sql[200];
    snprintf(sql, sizeof sql,
             "SELECT count(*) FROM exposures WHERE exposure_id BETWEEN %lld AND %lld"
             " AND (exposure_id - %lld) %% %lld = 0",
             (long long)e->first, (long long)e->last, (long long)e->first, (long long)e->every);
    bool some = !asked || (e->first == 0 && e->every == 1) || !bst_run_reader_has_tables(e->run) ||
                bst_run_reader_int(e->run, sql, 0, 1) != 0;
    return some ? BST_OK
                : bst_fail(ctx, BST_ERR_NOT_FOUND,
                           "%s: none of its frames is among those asked for by --first, --last and "
                           "--every (it has %lld to %lld)",
                           bst_run_reader_folder(e->run),
                           (long long)bst_run_reader_int(
                               e->run, "SELECT min(exposure_id) FROM exposures", 0, 0),
                           (long long)bst_run_reader_int(
                               e->run, "SELECT max(exposure_id) FROM exposures", 0, 0));
}

/* Whether anything goes into the folder of --out. */
static bool into_folder(const export_request *r) {
    return r->frames != NOT_ASKED || r->table != NOT_ASKED || r->orbits != NOT_ASKED ||
           r->observations != NOT_ASKED;
}

/* Whether what is asked for goes together; then r->e as it is to be exported. */
static bst_status settle(bst_ctx *ctx, export_request *r) {
    bst_export *e = &r->e;
    double split[3];
    if (e->split) {
        BST_TRY(bst_export_split(ctx, e->split, split));
    }
    if (e->last < e->first) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "--last %lld is before --first %lld: exchange them",
                        (long long)e->last, (long long)e->first);
    }
    if (e->frame_rate > 0.0 && r->frames != 1) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "--fps has no effect without --frames mp4");
    }
    if (!into_folder(r) && !e->satnet && !e->coco && !e->yolo) {
        return bst_fail(
            ctx, BST_ERR_ARGUMENT,
            "nothing to export: add --frames, --table, --orbits, --observations, --satnet, "
            "--coco or --yolo");
    }
    e->film = r->frames == 1;
    e->frame_rate = e->frame_rate > 0.0 ? e->frame_rate : 10.0;
    e->czml = r->orbits == 1;
    e->observation_format = r->observations;
    e->filtered = r->angles == 1;
    e->each_stretch = r->stretch == 1;
    e->image_bits = r->bits == 1 ? 8 : 16;
    return BST_OK;
}

/* The folders of --satnet, --coco and --yolo, in place of their names. */
static bst_status make_set_folders(bst_ctx *ctx, export_request *r, char sets[3][4096]) {
    const char **const of_sets[] = {&r->e.satnet, &r->e.coco, &r->e.yolo};
    for (int k = 0; k < 3; k++) {
        if (*of_sets[k]) {
            BST_TRY(make_set_folder(ctx, *of_sets[k], r->out, r->e.run, sets[k], sizeof sets[k]));
            *of_sets[k] = sets[k];
            for (size_t n = strlen(sets[k]); n > 1 && sets[k][n - 1] == '/';) {
                sets[k][--n] = '\0';
            }
        }
    }
    return BST_OK;
}

/* Everything that is asked for of an open run. */
static bst_status export_run(bst_ctx *ctx, export_request *r) {
    bst_export *e = &r->e;
    char folder[4096], sets[3][4096];
    e->out = folder;
    const char *problem;
    for (int i = 0; (problem = bst_run_reader_problem(e->run, i)); i++) {
        bst_log(ctx, BST_LOG_WARNING, "%s", problem);
    }
    BST_TRY(check_frames(ctx, e, r->frames != NOT_ASKED || e->satnet || e->coco || e->yolo));
    if (into_folder(r)) {
        BST_TRY(make_folder(ctx, r->out, e->run, folder, sizeof folder));
    }
    BST_TRY(make_set_folders(ctx, r, sets));
    BST_TRY(r->table != NOT_ASKED ? bst_export_tables(ctx, e, r->tables) : BST_OK);
    BST_TRY(r->orbits != NOT_ASKED ? bst_export_orbits(ctx, e) : BST_OK);
    BST_TRY(r->observations != NOT_ASKED ? bst_export_observations(ctx, e) : BST_OK);
    BST_TRY(r->observations == BST_OBSERVATIONS_TDM ? bst_export_observers(ctx, e) : BST_OK);
    BST_TRY(r->frames != NOT_ASKED ? bst_export_frames(ctx, e) : BST_OK);
    BST_TRY(e->satnet ? bst_export_satnet(ctx, e) : BST_OK);
    return e->coco || e->yolo ? bst_export_boxes(ctx, e) : BST_OK;
}

static const bst_option OPTIONS[] = {
    {.name = "frames",
     .kind = BST_OPTION_CHOICE,
     .offset = offsetof(export_request, frames),
     .argument = "png|mp4",
     .doc = "pictures, or a film (needs the program ffmpeg)"},
    {.name = "table",
     .kind = BST_OPTION_CHOICE,
     .offset = offsetof(export_request, table),
     .argument = "csv",
     .doc = "the tables of run.sqlite, a file each"},
    {.name = "orbits",
     .kind = BST_OPTION_CHOICE,
     .offset = offsetof(export_request, orbits),
     .argument = "oem|czml",
     .doc = "true orbits of observers and objects, from the run's scenario.json"},
    {.name = "observations",
     .kind = BST_OPTION_CHOICE,
     .offset = offsetof(export_request, observations),
     .argument = "tdm|json|csv",
     .doc = "directions and magnitudes of confirmed tracks; tdm with the observers' OEM"},
    {.name = "angles",
     .needs = "observations",
     .kind = BST_OPTION_CHOICE,
     .offset = offsetof(export_request, angles),
     .argument = "measured|filtered",
     .doc = "observations: what each frame measured (default), or the tracker's states"},
    {.name = "satnet",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(export_request, e.satnet),
     .path = BST_PATH_OUTPUT_FOLDER,
     .argument = "FOLDER",
     .doc = "a FITS file and a JSON annotation per frame, for training networks: ImageFiles/ and "
            "Annotations/ in FOLDER, which lies in that of --out where that is given"},
    {.name = "coco",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(export_request, e.coco),
     .path = BST_PATH_OUTPUT_FOLDER,
     .argument = "FOLDER",
     .doc = "PNG images with bounding boxes as COCO has them: images/ and annotations.json; "
            "FOLDER as for --satnet"},
    {.name = "yolo",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(export_request, e.yolo),
     .path = BST_PATH_OUTPUT_FOLDER,
     .argument = "FOLDER",
     .doc = "the same as YOLO has them: images/, labels/ and data.yaml"},
    {.name = "bits",
     .needs = "coco|yolo",
     .kind = BST_OPTION_CHOICE,
     .offset = offsetof(export_request, bits),
     .argument = "16|8",
     .doc = "coco, yolo: images of the counts as they are (16, default), or of grey levels, each "
            "frame's own (8)"},
    {.name = "out",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(export_request, out),
     .path = BST_PATH_OUTPUT_FOLDER,
     .argument = "FOLDER",
     .doc = "where it all goes (default RUN.export)"},
    {.name = "sensor",
     .needs = "frames|satnet|coco|yolo|observations",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(export_request, e.sensor),
     .argument = "NAME",
     .doc = "frames and observations of this sensor only: name or observer/name"},
    {.name = "first",
     .needs = "frames|satnet|coco|yolo",
     .kind = BST_OPTION_INT,
     .offset = offsetof(export_request, e.first),
     .argument = "N",
     .doc = "first frame, by the number of its exposure (default 0)",
     .minimum = 0,
     .maximum = 9e15},
    {.name = "last",
     .needs = "frames|satnet|coco|yolo",
     .kind = BST_OPTION_INT,
     .offset = offsetof(export_request, e.last),
     .argument = "N",
     .doc = "last frame (default the run's last)",
     .minimum = 0,
     .maximum = 9e15},
    {.name = "every",
     .needs = "frames|satnet|coco|yolo",
     .kind = BST_OPTION_INT,
     .offset = offsetof(export_request, e.every),
     .argument = "N",
     .doc = "every N-th frame only, from the first on (default 1)",
     .minimum = 1,
     .maximum = 9e15},
    {.name = "annotate",
     .needs = "frames",
     .kind = BST_OPTION_FLAG,
     .offset = offsetof(export_request, e.annotate),
     .doc = "draw true objects, detections, tracks, boresight, time and mode over the frames"},
    {.name = "stretch",
     .needs = "frames",
     .kind = BST_OPTION_CHOICE,
     .offset = offsetof(export_request, stretch),
     .argument = "run|frame",
     .doc = "grey levels: the same for all frames, or each frame's own (default run)"},
    {.name = "size",
     .needs = "frames",
     .kind = BST_OPTION_INT,
     .offset = offsetof(export_request, e.longest_side),
     .argument = "PX",
     .doc = "longest side of the pictures (default as the frames are; never enlarged)",
     .minimum = 16,
     .maximum = 16384},
    {.name = "fps",
     .needs = "frames",
     .kind = BST_OPTION_REAL,
     .offset = offsetof(export_request, e.frame_rate),
     .argument = "HZ",
     .doc = "frames per second of the film (default 10)",
     .minimum = 0.1,
     .maximum = 240},
    {.name = "tables",
     .needs = "table",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(export_request, tables),
     .argument = "A,B",
     .doc = "these tables only (boresight info lists them)"},
    {.name = "step",
     .needs = "orbits|observations",
     .kind = BST_OPTION_REAL,
     .offset = offsetof(export_request, e.step_s),
     .argument = "S",
     .doc = "time between states of an orbit (default 60, or a twentieth of a short run)",
     .minimum = 1e-3,
     .maximum = 86400},
    {.name = "objects",
     .needs = "orbits",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(export_request, e.objects),
     .argument = "A,B|seen|all",
     .doc = "orbits: of these objects, by name or NORAD number, of those that came into a field "
            "and the targets, or of all (default all of up to 100 objects, else seen)"},
    {.name = "split",
     .needs = "satnet",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(export_request, e.split),
     .argument = "A,B,C",
     .doc = "satnet: shares of train.txt, val.txt and test.txt, each frame's part following "
            "from its name, such as 80,10,10"},
    {.name = "box",
     .needs = "satnet|coco|yolo",
     .kind = BST_OPTION_REAL,
     .offset = offsetof(export_request, e.box_px),
     .argument = "PX",
     .doc = "satnet: side of the boxes (default 20); 0: the extent of each track. coco, yolo: the "
            "way of the light, grown by half of it on each side",
     .minimum = 0,
     .maximum = 65536},
    {.name = "star-limit",
     .needs = "satnet|coco|yolo",
     .kind = BST_OPTION_REAL,
     .offset = offsetof(export_request, e.star_limit),
     .argument = "MAG",
     .doc = "satnet, coco, yolo: faintest V of the stars that are labelled (default 10)",
     .minimum = -30,
     .maximum = 40},
    {.name = "help",
     .kind = BST_OPTION_FLAG,
     .offset = offsetof(export_request, help),
     .doc = "print this"},
    {.name = NULL},
};

int bst_cmd_export(int argc, char **argv) {
    export_request r = {
        .e = {.last = INT64_C(9007199254740992), .every = 1, .box_px = 20.0, .star_limit = 10.0},
        .frames = NOT_ASKED,
        .table = NOT_ASKED,
        .orbits = NOT_ASKED,
        .observations = NOT_ASKED};
    bst_option options[sizeof OPTIONS / sizeof *OPTIONS];
    bst_options_bind(OPTIONS, &r, options);
    bst_ctx ctx;
    bst_ctx_init(&ctx, bst_cli_log, NULL, BST_LOG_WARNING);
    int arguments = 0;
    if (bst_options_parse(&ctx, options, argc, argv, &arguments) != BST_OK) {
        return bst_options_misuse(&ctx, "export");
    }
    if (r.help) {
        fputs(help_text, stdout);
        bst_options_print(stdout, options);
        return BST_EXIT_OK;
    }
    if (arguments != 1) {
        bst_fail(&ctx, BST_ERR_ARGUMENT, "one folder of a run is expected, %d were given",
                 arguments);
        return bst_options_misuse(&ctx, "export");
    }
    if (settle(&ctx, &r) != BST_OK) {
        return bst_options_misuse(&ctx, "export");
    }
    bst_stop_catch_signals();
    bst_run_reader *run = NULL;
    bst_status status = bst_run_reader_open(&ctx, argv[1], &run);
    if (status == BST_OK) {
        r.e.run = run;
        status = export_run(&ctx, &r);
    }
    bst_run_reader_close(run);
    if (status != BST_OK) {
        fprintf(stderr, "boresight: %s\n", ctx.message);
    }
    return status == BST_OK                ? BST_EXIT_OK
           : status == BST_ERR_INTERRUPTED ? BST_EXIT_INTERRUPTED
                                           : BST_EXIT_FAILED;
}
