/* boresight export: frames, tables, orbits and observations of a run in formats that others read.
 */
#include <stdio.h>

#include "sim/app/app.h"
#include "sim/cli/options.h"
#include "sim/cli/stop_signals.h"
#include "sim/export/export.h"

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

typedef struct export_request {
    bst_export_parts parts;
    int stretch, angles, bits;
    bool help;
} export_request;

/* Whether what is asked for goes together; then r->parts.e as it is to be exported. */
static bst_status settle(bst_ctx *ctx, export_request *r) {
    bst_export *e = &r->parts.e;
    double split[3];
    if (e->split) {
        BST_TRY(bst_export_split(ctx, e->split, split));
    }
    if (e->last < e->first) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "--last %lld is before --first %lld: exchange them",
                        (long long)e->last, (long long)e->first);
    }
    if (e->frame_rate > 0.0 && r->parts.frames != 1) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "--fps has no effect without --frames mp4");
    }
    if (!bst_export_into_folder(&r->parts) && !e->satnet && !e->coco && !e->yolo) {
        return bst_fail(
            ctx, BST_ERR_ARGUMENT,
            "nothing to export: add --frames, --table, --orbits, --observations, --satnet, "
            "--coco or --yolo");
    }
    e->film = r->parts.frames == 1;
    e->frame_rate = e->frame_rate > 0.0 ? e->frame_rate : 10.0;
    e->czml = r->parts.orbits == 1;
    e->observation_format = r->parts.observations;
    e->filtered = r->angles == 1;
    e->each_stretch = r->stretch == 1;
    e->image_bits = r->bits == 1 ? 8 : 16;
    return BST_OK;
}

static const bst_option OPTIONS[] = {
    {.name = "frames",
     .kind = BST_OPTION_CHOICE,
     .offset = offsetof(export_request, parts.frames),
     .argument = "png|mp4",
     .doc = "pictures, or a film (needs the program ffmpeg)"},
    {.name = "table",
     .kind = BST_OPTION_CHOICE,
     .offset = offsetof(export_request, parts.table),
     .argument = "csv",
     .doc = "the tables of run.sqlite, a file each"},
    {.name = "orbits",
     .kind = BST_OPTION_CHOICE,
     .offset = offsetof(export_request, parts.orbits),
     .argument = "oem|czml",
     .doc = "true orbits of observers and objects, from the run's scenario.json"},
    {.name = "observations",
     .kind = BST_OPTION_CHOICE,
     .offset = offsetof(export_request, parts.observations),
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
     .offset = offsetof(export_request, parts.e.satnet),
     .path = BST_PATH_OUTPUT_FOLDER,
     .argument = "FOLDER",
     .doc = "a FITS file and a JSON annotation per frame, for training networks: ImageFiles/ and "
            "Annotations/ in FOLDER, which lies in that of --out where that is given"},
    {.name = "coco",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(export_request, parts.e.coco),
     .path = BST_PATH_OUTPUT_FOLDER,
     .argument = "FOLDER",
     .doc = "PNG images with bounding boxes as COCO has them: images/ and annotations.json; "
            "FOLDER as for --satnet"},
    {.name = "yolo",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(export_request, parts.e.yolo),
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
     .offset = offsetof(export_request, parts.out),
     .path = BST_PATH_OUTPUT_FOLDER,
     .argument = "FOLDER",
     .doc = "where it all goes (default RUN.export)"},
    {.name = "sensor",
     .needs = "frames|satnet|coco|yolo|observations",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(export_request, parts.e.sensor),
     .argument = "NAME",
     .doc = "frames and observations of this sensor only: name or observer/name"},
    {.name = "first",
     .needs = "frames|satnet|coco|yolo",
     .kind = BST_OPTION_INT,
     .offset = offsetof(export_request, parts.e.first),
     .argument = "N",
     .doc = "first frame, by the number of its exposure (default 0)",
     .minimum = 0,
     .maximum = 9e15},
    {.name = "last",
     .needs = "frames|satnet|coco|yolo",
     .kind = BST_OPTION_INT,
     .offset = offsetof(export_request, parts.e.last),
     .argument = "N",
     .doc = "last frame (default the run's last)",
     .minimum = 0,
     .maximum = 9e15},
    {.name = "every",
     .needs = "frames|satnet|coco|yolo",
     .kind = BST_OPTION_INT,
     .offset = offsetof(export_request, parts.e.every),
     .argument = "N",
     .doc = "every N-th frame only, from the first on (default 1)",
     .minimum = 1,
     .maximum = 9e15},
    {.name = "annotate",
     .needs = "frames",
     .kind = BST_OPTION_FLAG,
     .offset = offsetof(export_request, parts.e.annotate),
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
     .offset = offsetof(export_request, parts.e.longest_side),
     .argument = "PX",
     .doc = "longest side of the pictures (default as the frames are; never enlarged)",
     .minimum = 16,
     .maximum = 16384},
    {.name = "fps",
     .needs = "frames",
     .kind = BST_OPTION_REAL,
     .offset = offsetof(export_request, parts.e.frame_rate),
     .argument = "HZ",
     .doc = "frames per second of the film (default 10)",
     .minimum = 0.1,
     .maximum = 240},
    {.name = "tables",
     .needs = "table",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(export_request, parts.tables),
     .argument = "A,B",
     .doc = "these tables only (boresight info lists them)"},
    {.name = "step",
     .needs = "orbits|observations",
     .kind = BST_OPTION_REAL,
     .offset = offsetof(export_request, parts.e.step_s),
     .argument = "S",
     .doc = "time between states of an orbit (default 60, or a twentieth of a short run)",
     .minimum = 1e-3,
     .maximum = 86400},
    {.name = "objects",
     .needs = "orbits",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(export_request, parts.e.objects),
     .argument = "A,B|seen|all",
     .doc = "orbits: of these objects, by name or NORAD number, of those that came into a field "
            "and the targets, or of all (default all of up to 100 objects, else seen)"},
    {.name = "split",
     .needs = "satnet",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(export_request, parts.e.split),
     .argument = "A,B,C",
     .doc = "satnet: shares of train.txt, val.txt and test.txt, each frame's part following "
            "from its name, such as 80,10,10"},
    {.name = "box",
     .needs = "satnet|coco|yolo",
     .kind = BST_OPTION_REAL,
     .offset = offsetof(export_request, parts.e.box_px),
     .argument = "PX",
     .doc = "satnet: side of the boxes (default 20); 0: the extent of each track. coco, yolo: the "
            "way of the light, grown by half of it on each side",
     .minimum = 0,
     .maximum = 65536},
    {.name = "star-limit",
     .needs = "satnet|coco|yolo",
     .kind = BST_OPTION_REAL,
     .offset = offsetof(export_request, parts.e.star_limit),
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
    export_request r = {.parts = {.e = {.last = INT64_C(9007199254740992),
                                        .every = 1,
                                        .box_px = 20.0,
                                        .star_limit = 10.0},
                                  .frames = BST_EXPORT_NOT,
                                  .table = BST_EXPORT_NOT,
                                  .orbits = BST_EXPORT_NOT,
                                  .observations = BST_EXPORT_NOT}};
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
        r.parts.e.run = run;
        status = bst_export_run(&ctx, &r.parts);
    }
    bst_run_reader_close(run);
    if (status != BST_OK) {
        fprintf(stderr, "boresight: %s\n", ctx.message);
    }
    return status == BST_OK                ? BST_EXIT_OK
           : status == BST_ERR_INTERRUPTED ? BST_EXIT_INTERRUPTED
                                           : BST_EXIT_FAILED;
}
