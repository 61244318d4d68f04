/* Channel frame: the image that the detector delivers. */
#ifndef BORESIGHT_MESSAGES_FRAME_MESSAGE_H
#define BORESIGHT_MESSAGES_FRAME_MESSAGE_H

#include <stdint.h>

#include "boresight/frame.h"
#include "boresight/messages/window.h"

#define BST_CHANNEL_FRAME "frame"

/* frame (queue). The channel slot owns one reference of `frame`; NULL for an observer that does not
 * read pixels. */
typedef struct bst_frame_message {
    bst_frame *frame;
    int64_t exposure_id;
    int64_t start_tick, end_tick;
    bst_window window;
    int binning;
    int bits; /* 8 to 16 */
} bst_frame_message;

#endif
