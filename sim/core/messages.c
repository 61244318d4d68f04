#include "sim/core/messages.h"

#include <string.h>

static void release_frame(void *payload) {
    bst_frame_message *message = payload;
    bst_frame_release(message->frame);
    message->frame = NULL;
}

static void retain_frame(void *payload) {
    bst_frame_retain(((bst_frame_message *)payload)->frame);
}

#define HEADER_ONLY(name, kind, header) \
    { name, kind, sizeof(header), 0, false, NULL, NULL, false }
#define WITH_ITEMS(name, kind, header, item, in_place) \
    { name, kind, sizeof(header), sizeof(item), in_place, NULL, NULL, false }

static const bst_channel_type types[] = {
    HEADER_ONLY(BST_CHANNEL_SENSOR_COMMAND, BST_CHANNEL_LATEST, bst_sensor_command),
    HEADER_ONLY(BST_CHANNEL_EXPOSURE, BST_CHANNEL_QUEUE, bst_exposure),
    HEADER_ONLY(BST_CHANNEL_LOS_COMMAND, BST_CHANNEL_LATEST, bst_los_command),
    WITH_ITEMS(BST_CHANNEL_LOS_HISTORY, BST_CHANNEL_LATEST, bst_los_history, bst_los_sample, true),
    WITH_ITEMS(BST_CHANNEL_POINTING_TELEMETRY, BST_CHANNEL_LATEST, bst_pointing_telemetry,
               bst_pointing_sample, true),
    HEADER_ONLY(BST_CHANNEL_MOUNT_STATUS, BST_CHANNEL_LATEST, bst_mount_status),
    HEADER_ONLY(BST_CHANNEL_NAV_TELEMETRY, BST_CHANNEL_LATEST, bst_nav_telemetry),
    {BST_CHANNEL_FRAME, BST_CHANNEL_QUEUE, sizeof(bst_frame_message), 0, false, release_frame,
     retain_frame, false},
    WITH_ITEMS(BST_CHANNEL_TRUTH, BST_CHANNEL_QUEUE, bst_truth, bst_truth_item, false),
    {BST_CHANNEL_PLANES, BST_CHANNEL_LATEST, sizeof(bst_planes), 0, false, NULL, NULL, true},
    WITH_ITEMS(BST_CHANNEL_DETECTIONS, BST_CHANNEL_QUEUE, bst_detections, bst_detection, false),
    WITH_ITEMS(BST_CHANNEL_PREDICTIONS, BST_CHANNEL_LATEST, bst_predictions, bst_prediction, false),
    WITH_ITEMS(BST_CHANNEL_TRACKS, BST_CHANNEL_QUEUE, bst_tracks, bst_track, false),
    HEADER_ONLY(BST_CHANNEL_CONTROL_STATUS, BST_CHANNEL_LATEST, bst_control_status),
};

const bst_channel_type *bst_channel_type_find(const char *name) {
    for (size_t i = 0; i < sizeof types / sizeof *types; i++) {
        if (strcmp(types[i].name, name) == 0) {
            return &types[i];
        }
    }
    return NULL;
}

const char *bst_mode_name(int mode) {
    static const char *const names[BST_MODE_COUNT] = {"idle",  "slew",      "search", "acquire",
                                                      "track", "reacquire", "stare",  "rate",
                                                      "coast", "fixed",     "scan"};
    return mode >= 0 && mode < BST_MODE_COUNT ? names[mode] : "unknown";
}
