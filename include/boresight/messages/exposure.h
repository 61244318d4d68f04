/* Channel exposure: times and sensor settings of each exposure. */
#ifndef BORESIGHT_MESSAGES_EXPOSURE_H
#define BORESIGHT_MESSAGES_EXPOSURE_H

#include <stdbool.h>
#include <stdint.h>

#include "boresight/messages/window.h"

#define BST_CHANNEL_EXPOSURE "exposure"

/* exposure (queue): published at the tick at which the exposure ends. */
typedef struct bst_exposure {
    int64_t id;                   /* 0, 1, 2, ... */
    int64_t start_tick, end_tick; /* rolling shutter: of the window's middle row */
    bst_window window;
    int binning;
    bool dropped; /* the frame is lost in transfer: the truth is published, but no frame */
    double pixel_scale_arcsec; /* 0: the camera's */
} bst_exposure;

#endif
