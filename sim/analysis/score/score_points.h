/* Points of frames that are scored: detections, positions of tracks, or true objects. */
#ifndef BST_ANALYSIS_SCORE_SCORE_POINTS_H
#define BST_ANALYSIS_SCORE_SCORE_POINTS_H

#include <stdbool.h>
#include <stdint.h>

#include "boresight/status.h"

struct cJSON;

/* Number of a frame. */
typedef struct bst_score_key {
    int64_t sequence; /* of consecutive frames; 0 if there is only one */
    int64_t frame;
} bst_score_key;

/* A point of a frame. The centre of the first pixel is (0, 0). */
typedef struct bst_score_point {
    bst_score_key key;
    double x_px, y_px;
    double score;  /* of a detector, or SNR; NAN: unknown */
    int64_t id;    /* of a track or an object; -1: unknown */
    bool optional; /* of the truth: may be found, but need not */
} bst_score_point;

/* Frames and their points, from one source. */
typedef struct bst_score_points {
    bst_score_point *items; /* [count], sorted by key after bst_score_points_read */
    int count, room;
    bst_score_key *frames; /* [frame_count], sorted, each once after bst_score_points_read */
    int frame_count, frame_room;
} bst_score_points;

/* Positions that a run's folder gives. */
enum { BST_SCORE_DETECTIONS, BST_SCORE_TRACKS, BST_SCORE_TRUTH };

/* Which points are read. */
typedef struct bst_score_selection {
    int what;           /* BST_SCORE_... of a run */
    const char *sensor; /* OBSERVER/SENSOR of a run; NULL: all, each a sequence */
    bool unknown;       /* detections without a label count, too */
    double least_snr;   /* fainter true objects are optional; -INFINITY: none */
    double least_score; /* found points with a lower score are left out; -INFINITY: none */
} bst_score_selection;

/* Reads points from the folder of a run, a folder of SatNet annotations or a file of it, a JSON
 * file as the spotGEO competition has them, or a CSV file (docs/how-to/score.md).
 *
 * Errors:    BST_ERR_NOT_FOUND: no such path, sensor or table; BST_ERR_FORMAT with file, place and
 *            what is allowed; BST_ERR_ARGUMENT: a least SNR or score, and points of which none has
 *            one; BST_ERR_MEMORY
 * Ownership: free *out with bst_score_points_free, also after an error */
bst_status bst_score_points_read(bst_ctx *ctx, const char *path,
                                 const bst_score_selection *selection,
                                 bst_score_points *out) BST_MUST_CHECK;
/* Frees the arrays. */
void bst_score_points_free(bst_score_points *points);

/* Order of frames: by sequence, then by frame; as strcmp. */
int bst_score_key_compare(const bst_score_key *a, const bst_score_key *b);

/* Adds a point; its frame is added too.
 *
 * Errors:    BST_ERR_MEMORY */
bst_status bst_score_points_add(bst_ctx *ctx, bst_score_points *points,
                                const bst_score_point *point) BST_MUST_CHECK;
/* Adds a frame, which may be there already.
 *
 * Errors:    BST_ERR_MEMORY */
bst_status bst_score_points_add_frame(bst_ctx *ctx, bst_score_points *points,
                                      bst_score_key key) BST_MUST_CHECK;

/* Adds the points of one document: an array of frames as in spotGEO, or a frame of SatNet.
 *
 * Given:     name     of the file, for messages
 *            ordinal  frame number of a SatNet frame that gives none
 * Errors:    BST_ERR_FORMAT, BST_ERR_MEMORY */
bst_status bst_score_points_add_json(bst_ctx *ctx, const char *name, const struct cJSON *root,
                                     int64_t ordinal, bst_score_points *points) BST_MUST_CHECK;
/* Adds the points of a CSV file.
 *
 * Given:     text  with a terminating zero; changed
 * Errors:    BST_ERR_FORMAT with the line, BST_ERR_MEMORY */
bst_status bst_score_points_add_csv(bst_ctx *ctx, const char *name, char *text,
                                    bst_score_points *points) BST_MUST_CHECK;
/* Adds the points of a run's tables.
 *
 * Errors:    BST_ERR_NOT_FOUND, BST_ERR_FORMAT, BST_ERR_MEMORY */
bst_status bst_score_points_add_run(bst_ctx *ctx, const char *folder,
                                    const bst_score_selection *selection,
                                    bst_score_points *points) BST_MUST_CHECK;

#endif
