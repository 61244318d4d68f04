/* The detections that made a track: what updated it in each exposure. */
#ifndef BST_VIEW_TRACK_HISTORY_H
#define BST_VIEW_TRACK_HISTORY_H

#include "view/routes.h"

/* Exposures up to the frame that are looked at. */
enum { BST_VIEW_TRACK_EXPOSURES = 2000 };

/* The route: states of track x->object in the exposures up to x->frame: {track, first_s: time of
 * its first detection, earlier: there are states before those listed, states: [{frame, time_s,
 * status, hits, misses, snr, v_mag, detection: {x, y, label, snr, v_mag, streak, blend}}]}. Places
 * in px of the sensor. `detection` is missing where none updated the track.
 *
 * Returned:  x->json
 * Errors:    BST_ERR_NOT_FOUND: no such sensor or frame; BST_ERR_FORMAT: damaged tables
 * Notes:     A track that is updated has the place of its detection (sim/run/run_observations.c).
 */
bst_status bst_view_route_track(bst_ctx *ctx, bst_view_exchange *x) BST_MUST_CHECK;

#endif
