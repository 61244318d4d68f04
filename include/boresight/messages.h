/* The messages that modules exchange: one header for each channel in messages/, and what a channel
 * is. The table in sim/messages/messages.c gives each channel its kind.
 *
 * Camera frame: +z boresight, +x along columns (image x), +y along rows (image y), right-handed.
 * Pixel (0, 0) has its centre at (0.0, 0.0). Directions are unit vectors in GCRF axes (ICRS
 * orientation). "Apparent" directions contain stellar aberration of the observer; "geometric" ones
 * have it removed and hold light time. */
#ifndef BORESIGHT_MESSAGES_H
#define BORESIGHT_MESSAGES_H

#include <stdbool.h>
#include <stddef.h>

#include "boresight/messages/control_status.h"
#include "boresight/messages/detections.h"
#include "boresight/messages/exposure.h"
#include "boresight/messages/frame_message.h"
#include "boresight/messages/los_command.h"
#include "boresight/messages/los_history.h"
#include "boresight/messages/mount_status.h"
#include "boresight/messages/nav_telemetry.h"
#include "boresight/messages/planes.h"
#include "boresight/messages/pointing_telemetry.h"
#include "boresight/messages/predictions.h"
#include "boresight/messages/regions_of_interest.h"
#include "boresight/messages/sensor_command.h"
#include "boresight/messages/task.h"
#include "boresight/messages/track_identities.h"
#include "boresight/messages/tracks.h"
#include "boresight/messages/tracks_smoothed.h"
#include "boresight/messages/truth.h"
#include "boresight/messages/wheel_status.h"
#include "boresight/messages/window.h"

#pragma GCC visibility push(default)

typedef enum bst_channel_kind { BST_CHANNEL_LATEST, BST_CHANNEL_QUEUE } bst_channel_kind;

/* How a channel stores its payload: `header_bytes` then `capacity` items of `item_bytes`. */
typedef struct bst_channel_type {
    const char *name;
    bst_channel_kind kind;
    size_t header_bytes;
    size_t item_bytes; /* 0: no items */
    bool in_place;     /* a ring that its writer extends in place; it cannot be read with a delay */
    void (*release)(
        void *payload); /* releases the resources of a slot before it is overwritten; may be NULL */
    void (*retain)(void *payload); /* retains the resources for a copy of the payload; set together
                                      with release */
    bool lends; /* the payload refers to memory of the writer, valid until its next message */
    int (*count)(const void *payload); /* number of items in use, from the first; NULL: all items */
} bst_channel_type;

/* Type of a channel.
 *
 * Given:     name  unscoped name ("detections")
 * Returned:  NULL if there is no such channel */
const bst_channel_type *bst_channel_type_find(const char *name);

/* Names the modules that write a channel, for messages: "gimbal", "imgproc or obsgen".
 *
 * Given:     name  unscoped name
 * Returned:  NULL for channels that every sensor has, and for unknown names */
const char *bst_channel_writers(const char *name);

#pragma GCC visibility pop

#endif
