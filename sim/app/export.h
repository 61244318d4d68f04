/* The parts of boresight export: each writes what it makes below a folder that is there. */
#ifndef BST_APP_EXPORT_H
#define BST_APP_EXPORT_H

#include <stdio.h>

#include "sim/app/stop_signals.h"
#include "sim/engine/scenario.h"
#include "sim/io/run_reader.h"
#include "sim/world/world.h"

typedef enum bst_observation_format {
    BST_OBSERVATIONS_TDM,
    BST_OBSERVATIONS_JSON,
    BST_OBSERVATIONS_CSV
} bst_observation_format;

/* A sensor of the run. */
typedef struct bst_export_sensor {
    int64_t index; /* row of the table sensors */
    char observer[80], name[80];
    char target[80]; /* "" for none */
    char file[256];  /* FITS file of its frames; "" when none are kept */
} bst_export_sensor;

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
    int observation_format; /* bst_observation_format */
    bool filtered;          /* the tracker's states instead of measured directions */
    /* SatNet */
    const char *satnet; /* folder */
    double box_px;      /* side of a box; 0: the extent of the track */
    double star_limit;  /* faintest V of the stars that are labelled */
    const char *split;  /* "80,10,10": shares of training, validation and test; NULL: none */
} bst_export;

enum { BST_EXPORT_SENSORS = 64 };

/* The sensors that are asked for. BST_ERR_NOT_FOUND when there is none of that name: the message
 * lists what there is. A run without readable tables has one sensor, of the file frames.fits. */
bst_status bst_export_sensors(bst_ctx *ctx, const bst_export *e,
                              bst_export_sensor sensors[BST_EXPORT_SENSORS],
                              int *count) BST_MUST_CHECK;

bst_status bst_export_frames(bst_ctx *ctx, const bst_export *e) BST_MUST_CHECK;
/* `tables` is a list "a,b"; NULL: all. */
bst_status bst_export_tables(bst_ctx *ctx, const bst_export *e, const char *tables) BST_MUST_CHECK;
bst_status bst_export_orbits(bst_ctx *ctx, const bst_export *e) BST_MUST_CHECK;
/* The sensors' fields of view, as packets of a CZML document that holds their observers. */
bst_status bst_export_views(bst_ctx *ctx, const bst_export *e, const bst_scenario *scenario,
                            const bst_world *world, bst_view *view, FILE *stream) BST_MUST_CHECK;
/* Shares of training, validation and test, made to add up to 1. BST_ERR_ARGUMENT for a text that is
 * not three numbers of 0 or more, or all 0. */
bst_status bst_export_split(bst_ctx *ctx, const char *text, double shares[3]) BST_MUST_CHECK;
/* Images and annotations as SatNet has them, below e->satnet. */
bst_status bst_export_satnet(bst_ctx *ctx, const bst_export *e) BST_MUST_CHECK;
/* observations.tdm, .json or .csv: what sensors measured of tracks. */
bst_status bst_export_observations(bst_ctx *ctx, const bst_export *e) BST_MUST_CHECK;
/* observers.oem: the observers' orbits as they are known on board, which a TDM refers to. */
bst_status bst_export_observers(bst_ctx *ctx, const bst_export *e) BST_MUST_CHECK;

/* BST_ERR_INTERRUPTED when the user asked to stop. */
static inline bst_status bst_export_check(bst_ctx *ctx) {
    return bst_stop_requested() ? bst_fail(ctx, BST_ERR_INTERRUPTED, "interrupted") : BST_OK;
}

#endif
