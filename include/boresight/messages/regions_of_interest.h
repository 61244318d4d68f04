/* Channel regions_of_interest: the windows of a frame that image processing searched. */
#ifndef BORESIGHT_MESSAGES_REGIONS_OF_INTEREST_H
#define BORESIGHT_MESSAGES_REGIONS_OF_INTEREST_H

#include <stdint.h>

#include "boresight/messages/window.h"

#define BST_CHANNEL_REGIONS_OF_INTEREST "regions_of_interest"

/* What a window is planned for. */
typedef enum bst_region_reason {
    BST_REGION_TARGET, /* the predicted place of the target of interest */
    BST_REGION_TRACK,  /* that of another track */
    BST_REGION_STAR,   /* the expected place of a bright star */
    BST_REGION_REASON_COUNT
} bst_region_reason;

/* One reason of a window. Windows that touched are merged: several reasons have the same one. */
typedef struct bst_searched_window {
    bst_window window; /* searched, full-sensor px */
    int32_t number;    /* of the window in its frame, from 0 */
    int32_t reason;    /* bst_region_reason */
    int64_t track_id;  /* as in tracks; 0: a star */
    uint32_t star_id;  /* identity in the star catalogue; 0: a track */
    double x_px, y_px; /* predicted position at mid-exposure, full-sensor px; it may lie outside the
                          frame, whose window is clipped */
} bst_searched_window;

/* regions_of_interest (queue): the windows of one frame. A frame that was searched as a whole has
 * no message. */
typedef struct bst_regions_of_interest {
    int64_t exposure_id;
    int64_t start_tick, end_tick;
    int32_t count;
    bst_searched_window items[];
} bst_regions_of_interest;

#endif
