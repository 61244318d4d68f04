/* The newest frame of each sensor of a run in progress, for those who watch it. Without watchers a
 * message costs one comparison. */
#ifndef BST_VIEW_LIVE_FEED_H
#define BST_VIEW_LIVE_FEED_H

#include "sim/engine/scenario/scenario.h"

typedef struct bst_view_feed bst_view_feed;

/* A frame with its marks, which all who watch share; it does not change. */
typedef struct bst_view_live_frame {
    int64_t sequence;  /* 1, 2, ... per sensor */
    char *json;        /* in the form of bst_view_run_frame, without names */
    uint16_t *pixels;  /* [height][width], DN; NULL: none */
    int width, height; /* 0: none */
    int holders;       /* the feed's own */
} bst_view_live_frame;

/* Creates the feed of a scenario's sensors.
 *
 * Errors:    BST_ERR_MEMORY
 * Ownership: free *out with bst_view_feed_free; the scenario is not kept */
bst_status bst_view_feed_create(bst_ctx *ctx, const bst_scenario *scenario,
                                bst_view_feed **out) BST_MUST_CHECK;
/* Frees a feed; NULL is allowed. */
void bst_view_feed_free(bst_view_feed *feed);

/* Takes a message of the run: function `message` of bst_run_steering, whose `user` is the feed. */
bst_status bst_view_feed_message(void *feed, bst_ctx *ctx, int sensor, const char *channel,
                                 const void *payload, int64_t tick);

/* Gets the newest frame of a sensor, if it is newer than the one that the caller has. The sensor
 * counts as watched for a second from then on.
 *
 * Given:     sensor  in the order of the scenario; any number
 *            after   sequence of the frame that the caller has
 *            wait_s  longest time to wait for a newer one
 * Returned:  NULL: none newer, or no such sensor
 * Ownership: give it back with bst_view_feed_release, before the feed is freed */
const bst_view_live_frame *bst_view_feed_get(bst_view_feed *feed, int64_t sensor, int64_t after,
                                             double wait_s);
/* Gives a frame back; NULL is allowed. */
void bst_view_feed_release(const bst_view_live_frame *frame);
/* Says whether every frame is kept, as in single steps; else those that a screen can show. */
void bst_view_feed_set_every(bst_view_feed *feed, bool every);
/* Forgets exposures that are not complete: the run goes on from another time, with the cameras of
 * this scenario. */
void bst_view_feed_restart(bst_view_feed *feed, const bst_scenario *scenario);
/* Ends the waiting of all callers, as the state of the run has changed. */
void bst_view_feed_wake(bst_view_feed *feed);

#endif
