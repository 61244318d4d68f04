/* Sightings: which sensor detected and tracked which object, when and how accurately, over a
 * run. */
#ifndef BST_EVAL_SIGHTINGS_H
#define BST_EVAL_SIGHTINGS_H

#include "boresight/messages.h"
#include "sim/world/world.h"

/* Direction errors against the truth, arcsec. */
typedef struct bst_sighting_error {
    int64_t count;
    double sum2, greatest;
} bst_sighting_error;

double bst_sighting_rms(
    const bst_sighting_error *error); /* RMS of both components, arcsec; NAN without errors */

/* Maximum gap within a pass of an object through a sensor's field, s. */
#define BST_PASS_BREAK_S 60.0
typedef struct bst_eval_pass {
    int sensor, object;
    double start_s, end_s;    /* mid-exposure of the first and last frame */
    int64_t frames, lit;      /* frames with the object in the field; illuminated in it */
    int64_t detected;         /* frames in which it was detected */
    int64_t tracked;          /* frames with a confirmed track of it */
    int64_t target;           /* frames in which it was the track of interest */
    double first_s, last_s;   /* first and last detection; NAN: none */
    double snr, v_mag;        /* largest true SNR of a frame, and the brightness at that time */
    double range_m;           /* shortest */
    bst_sighting_error place; /* of detections, by the stellar attitude */
    bst_sighting_error track; /* of confirmed tracks */
} bst_eval_pass;

/* All passes of an object through the field of a sensor; sensor -1: of all sensors. */
typedef struct bst_sighting {
    int sensor, object;
    int64_t passes, passes_seen; /* passes_seen: with a detection */
    int64_t frames, lit, detected, tracked;
    double first_s, last_s; /* detections; NAN: none */
    /* intervals between passes with detections, from the last detection of one to the first of the
     * next, over all sensors */
    int64_t revisits;
    double revisit_sum_s, revisit_most_s;
    double longest_gap_s; /* longest interval without a detection, including start and end of the
                             run */
    double custody_s;     /* time within custody_s after a detection */
    double snr;
    bst_sighting_error place, track;
} bst_sighting;

/* Figures of the summary. Means are over the objects that were detected. */
typedef struct bst_sightings_figures {
    int64_t objects, in_field, seen;
    int64_t passes, passes_seen, detections;
    int64_t revisits;
    double revisit_mean_s, revisit_most_s;
    double custody_fraction;     /* mean over detected objects */
    double custody_fraction_all; /* mean over all objects */
    double gap_mean_s;           /* mean of the longest gaps */
    double place_rms_arcsec, track_rms_arcsec;
    int64_t tasks, tasks_done, tasks_not_found, tasks_lost;
} bst_sightings_figures;

typedef struct bst_sightings bst_sightings;

/* Callback for a completed pass; the pass is borrowed. */
typedef bst_status (*bst_eval_pass_fn)(void *user, bst_ctx *ctx, const bst_eval_pass *pass);
typedef bst_status (*bst_sighting_fn)(void *user, bst_ctx *ctx, const bst_sighting *sighting);

/* Creates the record of sightings for all sensors of the world. custody_s: time after a detection
 * during which an object counts as in custody. The world must outlive it. */
bst_status bst_sightings_create(bst_ctx *ctx, const bst_world *world, int64_t tick_rate_hz,
                                double custody_s, bst_eval_pass_fn pass, void *user,
                                bst_sightings **out) BST_MUST_CHECK;
/* Frees the record of sightings; NULL is allowed. */
void bst_sightings_free(bst_sightings *sightings);

/* Saves or restores what has been seen.
 *
 * Errors:    BST_ERR_MEMORY */
bst_status bst_sightings_archive(bst_sightings *sightings, bst_archive *archive) BST_MUST_CHECK;

/* Adds the truth of an exposure. It comes before the detections of its frame, and these before its
 * tracks.
 *
 * Given:     sensor  index of the sensor, from 0 over all observers
 * Errors:    BST_ERR_MEMORY and those of the world */
bst_status bst_sightings_truth(bst_ctx *ctx, bst_sightings *sightings, int sensor,
                               const bst_truth *truth) BST_MUST_CHECK;

/* Counts which objects of a frame were detected.
 *
 * Given:     sensor  index of the sensor, from 0 over all observers */
void bst_sightings_detections(bst_sightings *sightings, int sensor,
                              const bst_detections *detections);

/* Counts which objects of a frame were tracked, and adds the errors of directions.
 *
 * Given:     sensor  index of the sensor, from 0 over all observers */
void bst_sightings_tracks(bst_sightings *sightings, int sensor, const bst_tracks *tracks);
/* Counts a new task of the tasking module and the end of the previous one. */
void bst_sightings_task(bst_sightings *sightings, const bst_task *task);

/* Ends all passes, at end_s. */
bst_status bst_sightings_finish(bst_ctx *ctx, bst_sightings *sightings,
                                double end_s) BST_MUST_CHECK;
/* After bst_sightings_finish: calls a function for each object, first for all sensors together,
 * then per sensor. */
bst_status bst_sightings_each(bst_ctx *ctx, const bst_sightings *sightings, bst_sighting_fn fn,
                              void *user) BST_MUST_CHECK;
/* Computes the figures of all objects together. */
void bst_sightings_summary(const bst_sightings *sightings, bst_sightings_figures *out);

#endif
