/* Functions of `boresight export`: convert a run folder to pictures, tables, orbits, observations
 * and training sets. Each writes below an existing folder. */
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
    bool film; /* one mp4, else PNG files */
    bool annotate, each_stretch;
    int64_t first, last, every, longest_side; /* longest_side 0: original size */
    double frame_rate;
    /* orbits */
    bool czml;
    double step_s;
    const char *objects; /* see bst_orbit_selection_make; NULL: default */
    /* observations */
    int observation_format; /* bst_export_observation_format */
    bool filtered;          /* tracked directions instead of measured ones */
    /* SatNet */
    const char *satnet; /* folder */
    double box_px;      /* side of a bounding box; 0: the extent of the streak */
    double star_limit;  /* magnitude limit of labelled stars, V */
    /* boxes */
    const char *coco, *yolo; /* folders; NULL: not requested */
    int image_bits;          /* 16, or 8 */
    const char *split; /* "80,10,10": fractions of training, validation and test; NULL: no split */
} bst_export;

/* Requested exports of a run: format numbers, BST_EXPORT_NOT: none. */
enum { BST_EXPORT_NOT = -1 };
typedef struct bst_export_parts {
    bst_export e;
    const char *out;      /* folder; NULL: RUN.export */
    const char *page;     /* file of one page; NULL: none (written by the viewer) */
    double page_limit_mb; /* of that file */
    const char *tables;   /* "a,b"; NULL: all */
    int frames, table, orbits,
        observations; /* frames: pictures 0, video 1; table: csv; orbits: oem 0, czml 1;
                         observations: bst_export_observation_format */
} bst_export_parts;

/* True if a requested export writes into the folder `out`. */
bool bst_export_into_folder(const bst_export_parts *parts);

/* Executes all requested exports of the run parts->e.run and creates the folders. Folders of
 * satnet, coco and yolo are inside `out` if given. BST_ERR_ARGUMENT: path too long, or the run
 * itself; BST_ERR_NOT_FOUND: the run has no such frames; errors of the exports. */
bst_status bst_export_run(bst_ctx *ctx, bst_export_parts *parts) BST_MUST_CHECK;

/* Writes the selected frames as pictures or as a video.
 *
 * Given:     e  the checked request
 * Errors:    BST_ERR_MEMORY, and those of reading the run and writing the files */
bst_status bst_export_frames(bst_ctx *ctx, const bst_export *e) BST_MUST_CHECK;
/* Writes the run's tables as CSV files. `tables`: list "a,b"; NULL: all. */
bst_status bst_export_tables(bst_ctx *ctx, const bst_export *e, const char *tables) BST_MUST_CHECK;

/* Writes the true orbits of the selected objects.
 *
 * Given:     e  the checked request
 * Errors:    BST_ERR_MEMORY, and those of reading the run and writing the files */
bst_status bst_export_orbits(bst_ctx *ctx, const bst_export *e) BST_MUST_CHECK;
/* Writes the sensors' fields of view as packets of a CZML document that contains their
 * observers. */
bst_status bst_export_views(bst_ctx *ctx, const bst_export *e, const bst_scenario *scenario,
                            const bst_world *world, bst_world_view *view,
                            FILE *stream) BST_MUST_CHECK;
/* Parses the fractions of training, validation and test, normalised to 1. BST_ERR_ARGUMENT: not
 * three non-negative numbers, or all 0. */
bst_status bst_export_split(bst_ctx *ctx, const char *text, double shares[3]) BST_MUST_CHECK;
/* Writes frames and annotations in SatNet format below e->satnet. */
bst_status bst_export_satnet(bst_ctx *ctx, const bst_export *e) BST_MUST_CHECK;
/* Writes PNG frames with bounding boxes in COCO and YOLO format below e->coco and e->yolo. */
bst_status bst_export_boxes(bst_ctx *ctx, const bst_export *e) BST_MUST_CHECK;
/* Name of a training set: the run's folder, with the sensor's name (NULL: without). */
void bst_export_set_name(const bst_run_reader *run, const bst_run_sensor *sensor, char out[256]);
/* BST_ERR_NOT_FOUND for a run without recorded truth, which labels need. */
bst_status bst_export_need_truth(bst_ctx *ctx, const bst_run_reader *run) BST_MUST_CHECK;
/* Writes observations.tdm, .json or .csv: directions measured on tracks. */
bst_status bst_export_observations(bst_ctx *ctx, const bst_export *e) BST_MUST_CHECK;
/* Writes observers.oem: the observers' orbits by onboard navigation; a TDM refers to it. */
bst_status bst_export_observers(bst_ctx *ctx, const bst_export *e) BST_MUST_CHECK;

/* BST_ERR_INTERRUPTED if the user requested a stop. */
static inline bst_status bst_export_check(bst_ctx *ctx) {
    return bst_stop_requested() ? bst_fail(ctx, BST_ERR_INTERRUPTED, "interrupted") : BST_OK;
}

#endif
