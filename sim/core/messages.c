#include "sim/core/messages.h"

#include <string.h>

static void release_frame(void *payload) {
    bst_frame_message *message = payload;
    bst_frame_release(message->frame);
    message->frame = NULL;
}

static const bst_channel_type types[] = {
    {BST_CHANNEL_SENSOR_COMMAND, BST_CHANNEL_LATEST, sizeof(bst_sensor_command), 0, NULL},
    {BST_CHANNEL_EXPOSURE, BST_CHANNEL_QUEUE, sizeof(bst_exposure), 0, NULL},
    {BST_CHANNEL_LOS_COMMAND, BST_CHANNEL_LATEST, sizeof(bst_los_command), 0, NULL},
    {BST_CHANNEL_LOS_HISTORY, BST_CHANNEL_LATEST, sizeof(bst_los_history), sizeof(bst_los_sample),
     NULL},
    {BST_CHANNEL_POINTING_TELEMETRY, BST_CHANNEL_LATEST, sizeof(bst_pointing_telemetry),
     sizeof(bst_pointing_sample), NULL},
    {BST_CHANNEL_NAV_TELEMETRY, BST_CHANNEL_LATEST, sizeof(bst_nav_telemetry), 0, NULL},
    {BST_CHANNEL_FRAME, BST_CHANNEL_QUEUE, sizeof(bst_frame_message), 0, release_frame},
    {BST_CHANNEL_TRUTH, BST_CHANNEL_QUEUE, sizeof(bst_truth), sizeof(bst_truth_item), NULL},
    {BST_CHANNEL_DETECTIONS, BST_CHANNEL_QUEUE, sizeof(bst_detections), sizeof(bst_detection),
     NULL},
    {BST_CHANNEL_PREDICTIONS, BST_CHANNEL_LATEST, sizeof(bst_predictions), sizeof(bst_prediction),
     NULL},
    {BST_CHANNEL_TRACKS, BST_CHANNEL_QUEUE, sizeof(bst_tracks), sizeof(bst_track), NULL},
    {BST_CHANNEL_CONTROL_STATUS, BST_CHANNEL_LATEST, sizeof(bst_control_status), 0, NULL},
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
                                                      "track", "reacquire", "stare",  "rate"};
    return mode >= 0 && mode < BST_MODE_COUNT ? names[mode] : "unknown";
}
