/* The parts of boresight export: each writes what it makes below a folder that is there. */
#ifndef BST_EXPORT_EXPORT_H
#define BST_EXPORT_EXPORT_H

#include <stdio.h>

#include "sim/cli/stop_signals.h"
#include "sim/engine/scenario/scenario.h"
#include "sim/io/run_reader.h"
#include "sim/run/run_sensors.h"
#include "sim/world/world.h"

typedef enum bst_export_observation_format {
    BST_OBSERVATIONS_TDM,
    BST_OBSERVATIONS_JSON,
    BST_OBSERVATIONS_CSV
} bst_export_observation_format;

typedef struct bst_export {
    const bst_run_reader *run;
    const char *out;    /* folder */
    const char *sensor; /* NULL: all; "name" or "observer/name" */
    /* frames */
    bool film; /* one mp4, else a PNG per frame */
    bool annotate, each_stretch;
    int64_t first, last, every, longest_side; /* longest_side 0: as it is */
    double frame_rate;
    /* orbits */
    bool czml;
    double step_s;
    const char *objects; /* see bst_orbit_selection_make; NULL: its default */
    /* observations */
    int observation_format; /* bst_export_observation_format */
    bool filtered;          /* the tracker's states instead of measured directions */
    /* SatNet */
    const char *satnet; /* folder */
    double box_px;      /* side of a box; 0: the extent of the track */
    double star_limit;  /* faintest V of the stars that are labelled */
    /* boxes */
    const char *coco, *yolo; /* folders; NULL: not asked for */
    int image_bits;          /* 16, or 8 */
    const char *split;       /* "80,10,10": shares of training, validation and test; NULL: none */
} bst_export;

/* What is exported of a run: formats by their numbers, BST_EXPORT_NOT for none. */
enum { BST_EXPORT_NOT = -1 };
typedef struct bst_export_parts {
    bst_export e;
    const char *out;                         /* folder; NULL: RUN.export */
    const char *tables;                      /* "a,b"; NULL: all */
    int frames, table, orbits, observations; /* pictures 0, film 1; csv; oem 0, czml 1; as
                                                bst_export_observation_format */
} bst_export_parts;

/* Whether anything goes into the folder `out`. */
bool bst_export_into_folder(const bst_export_parts *parts);

/* Makes the folders and exports all that is asked for of the run parts->e.run. Folders of satnet,
 * coco and yolo lie in `out` where that is given. BST_ERR_ARGUMENT: a path is too long or is the
 * run itself; BST_ERR_NOT_FOUND: the run has none of the frames asked for; what the parts fail
 * with. */
bst_status bst_export_run(bst_ctx *ctx, bst_export_parts *parts) BST_MUST_CHECK;

/* Writes the selected frames as pictures or as a video.
 *
 * Given:     e  the checked request
 * Errors:    BST_ERR_MEMORY, and those of reading the run and writing the files */
bst_status bst_export_frames(bst_ctx *ctx, const bst_export *e) BST_MUST_CHECK;
/* `tables` is a list "a,b"; NULL: all. */
bst_status bst_export_tables(bst_ctx *ctx, const bst_export *e, const char *tables) BST_MUST_CHECK;

/* Writes the true orbits of the selected objects.
 *
 * Given:     e  the checked request
 * Errors:    BST_ERR_MEMORY, and those of reading the run and writing the files */
bst_status bst_export_orbits(bst_ctx *ctx, const bst_export *e) BST_MUST_CHECK;
/* The sensors' fields of view, as packets of a CZML document that holds their observers. */
bst_status bst_export_views(bst_ctx *ctx, const bst_export *e, const bst_scenario *scenario,
                            const bst_world *world, bst_world_view *view,
                            FILE *stream) BST_MUST_CHECK;
/* Shares of training, validation and test, made to add up to 1. BST_ERR_ARGUMENT for a text that is
 * not three numbers of 0 or more, or all 0. */
bst_status bst_export_split(bst_ctx *ctx, const char *text, double shares[3]) BST_MUST_CHECK;
/* Images and annotations as SatNet has them, below e->satnet. */
bst_status bst_export_satnet(bst_ctx *ctx, const bst_export *e) BST_MUST_CHECK;
/* PNG images with bounding boxes, as COCO and YOLO have them, below e->coco and e->yolo. */
bst_status bst_export_boxes(bst_ctx *ctx, const bst_export *e) BST_MUST_CHECK;
/* Name of a set of frames: that of the run's folder, with the sensor's (NULL: without). */
void bst_export_set_name(const bst_run_reader *run, const bst_run_sensor *sensor, char out[256]);
/* BST_ERR_NOT_FOUND for a run without truth, by which frames are labelled. */
bst_status bst_export_need_truth(bst_ctx *ctx, const bst_run_reader *run) BST_MUST_CHECK;
/* observations.tdm, .json or .csv: what sensors measured of tracks. */
bst_status bst_export_observations(bst_ctx *ctx, const bst_export *e) BST_MUST_CHECK;
/* observers.oem: the observers' orbits as they are known on board, which a TDM refers to. */
bst_status bst_export_observers(bst_ctx *ctx, const bst_export *e) BST_MUST_CHECK;

/* BST_ERR_INTERRUPTED when the user asked to stop. */
static inline bst_status bst_export_check(bst_ctx *ctx) {
    return bst_stop_requested() ? bst_fail(ctx, BST_ERR_INTERRUPTED, "interrupted") : BST_OK;
}

#endif
