/* Who saw what, when, and how well: the objects of a run against the frames of all its sensors. */
#ifndef BST_EVAL_SIGHTINGS_H
#define BST_EVAL_SIGHTINGS_H

#include "boresight/messages.h"
#include "sim/world/world.h"

/* Errors against the truth, arcsec. */
typedef struct bst_sighting_error {
    int64_t count;
    double sum2, greatest;
} bst_sighting_error;

double bst_sighting_rms(const bst_sighting_error *error); /* NAN: there are none */

/* An object in a sensor's field, without a break of more than BST_PASS_BREAK_S. */
#define BST_PASS_BREAK_S 60.0
typedef struct bst_eval_pass {
    int sensor, object;
    double start_s, end_s;    /* middles of the first and the last frame */
    int64_t frames, lit;      /* frames that it was in; with light of it */
    int64_t detected;         /* frames in which it was detected */
    int64_t tracked;          /* frames in which a confirmed track was its */
    int64_t target;           /* of these, that of interest */
    double first_s, last_s;   /* first and last detection; NAN: none */
    double snr, v_mag;        /* greatest true SNR of a frame, and the brightness then */
    double range_m;           /* shortest */
    bst_sighting_error place; /* of detections, by the attitude from stars */
    bst_sighting_error track; /* of confirmed tracks */
} bst_eval_pass;

/* All passes of an object over a sensor; of all sensors with sensor -1. */
typedef struct bst_sighting {
    int sensor, object;
    int64_t passes, passes_seen; /* seen: with a detection */
    int64_t frames, lit, detected, tracked;
    double first_s, last_s; /* detections; NAN: none */
    /* times between two passes with detections, from the last of one to the first of the next, by
     * any of the sensors */
    int64_t revisits;
    double revisit_sum_s, revisit_most_s;
    double longest_gap_s; /* without a detection, from the run's start and to its end as well */
    double custody_s;     /* time within custody_s after a detection */
    double snr;
    bst_sighting_error place, track;
} bst_sighting;

/* What a run's summary tells. Means are over the objects that were seen. */
typedef struct bst_sightings_figures {
    int64_t objects, in_field, seen;
    int64_t passes, passes_seen, detections;
    int64_t revisits;
    double revisit_mean_s, revisit_most_s;
    double custody_fraction;     /* mean of the objects that were seen */
    double custody_fraction_all; /* mean of all objects */
    double gap_mean_s;           /* mean of the longest gaps */
    double place_rms_arcsec, track_rms_arcsec;
    int64_t tasks, tasks_done, tasks_not_found, tasks_lost;
} bst_sightings_figures;

typedef struct bst_sightings bst_sightings;

/* Takes a pass that is over; lent. */
typedef bst_status (*bst_eval_pass_fn)(void *user, bst_ctx *ctx, const bst_eval_pass *pass);
typedef bst_status (*bst_sighting_fn)(void *user, bst_ctx *ctx, const bst_sighting *sighting);

/* The sensors are all of the world's, in its order. custody_s: how long an object counts as known
 * after a detection. The world outlives it. */
bst_status bst_sightings_create(bst_ctx *ctx, const bst_world *world, int64_t tick_rate_hz,
                                double custody_s, bst_eval_pass_fn pass, void *user,
                                bst_sightings **out) BST_MUST_CHECK;
/* Frees the record of sightings; NULL is allowed. */
void bst_sightings_free(bst_sightings *sightings);

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
/* Counts a new task and the end of the one before it. */
void bst_sightings_task(bst_sightings *sightings, const bst_task *task);

/* Ends all passes, at end_s. */
bst_status bst_sightings_finish(bst_ctx *ctx, bst_sightings *sightings,
                                double end_s) BST_MUST_CHECK;
/* After that: by object, for each first of all sensors together, then of those that had it. */
bst_status bst_sightings_each(bst_ctx *ctx, const bst_sightings *sightings, bst_sighting_fn fn,
                              void *user) BST_MUST_CHECK;
/* Computes the figures of all objects together. */
void bst_sightings_summary(const bst_sightings *sightings, bst_sightings_figures *out);

#endif
