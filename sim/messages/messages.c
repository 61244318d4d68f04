#include "boresight/messages.h"

#include <string.h>

static void release_frame(void *payload) {
    bst_frame_message *message = payload;
    bst_frame_release(message->frame);
    message->frame = NULL;
}

static void retain_frame(void *payload) {
    bst_frame *frame = ((bst_frame_message *)payload)->frame;
    if (frame) {
        bst_frame_retain(frame);
    }
}

static int count_truth(const void *payload) {
    return ((const bst_truth *)payload)->count;
}
static int count_detections(const void *payload) {
    return ((const bst_detections *)payload)->count;
}
static int count_predictions(const void *payload) {
    return ((const bst_predictions *)payload)->count;
}
static int count_tracks(const void *payload) {
    return ((const bst_tracks *)payload)->count;
}
static int count_identities(const void *payload) {
    return ((const bst_track_identities *)payload)->count;
}
static int count_regions(const void *payload) {
    return ((const bst_regions_of_interest *)payload)->count;
}
static int count_wheels(const void *payload) {
    return ((const bst_wheel_status *)payload)->count;
}
static int count_smoothed(const void *payload) {
    return ((const bst_tracks_smoothed *)payload)->count;
}

#define HEADER_ONLY(name, kind, header) \
    { name, kind, sizeof(header), 0, false, NULL, NULL, false, NULL }
#define RING(name, header, item) \
    { name, BST_CHANNEL_LATEST, sizeof(header), sizeof(item), true, NULL, NULL, false, NULL }
#define WITH_ITEMS(name, kind, header, item, count) \
    { name, kind, sizeof(header), sizeof(item), false, NULL, NULL, false, count }

static const bst_channel_type types[] = {
    HEADER_ONLY(BST_CHANNEL_SENSOR_COMMAND, BST_CHANNEL_LATEST, bst_sensor_command),
    HEADER_ONLY(BST_CHANNEL_EXPOSURE, BST_CHANNEL_QUEUE, bst_exposure),
    HEADER_ONLY(BST_CHANNEL_LOS_COMMAND, BST_CHANNEL_LATEST, bst_los_command),
    RING(BST_CHANNEL_LOS_HISTORY, bst_los_history, bst_los_sample),
    RING(BST_CHANNEL_POINTING_TELEMETRY, bst_pointing_telemetry, bst_pointing_sample),
    HEADER_ONLY(BST_CHANNEL_MOUNT_STATUS, BST_CHANNEL_LATEST, bst_mount_status),
    WITH_ITEMS(BST_CHANNEL_WHEEL_STATUS, BST_CHANNEL_LATEST, bst_wheel_status, bst_wheel_state,
               count_wheels),
    HEADER_ONLY(BST_CHANNEL_NAV_TELEMETRY, BST_CHANNEL_LATEST, bst_nav_telemetry),
    {BST_CHANNEL_FRAME, BST_CHANNEL_QUEUE, sizeof(bst_frame_message), 0, false, release_frame,
     retain_frame, false, NULL},
    WITH_ITEMS(BST_CHANNEL_TRUTH, BST_CHANNEL_QUEUE, bst_truth, bst_truth_item, count_truth),
    {BST_CHANNEL_PLANES, BST_CHANNEL_LATEST, sizeof(bst_planes), 0, false, NULL, NULL, true, NULL},
    WITH_ITEMS(BST_CHANNEL_DETECTIONS, BST_CHANNEL_QUEUE, bst_detections, bst_detection,
               count_detections),
    WITH_ITEMS(BST_CHANNEL_PREDICTIONS, BST_CHANNEL_LATEST, bst_predictions, bst_prediction,
               count_predictions),
    WITH_ITEMS(BST_CHANNEL_REGIONS_OF_INTEREST, BST_CHANNEL_QUEUE, bst_regions_of_interest,
               bst_searched_window, count_regions),
    WITH_ITEMS(BST_CHANNEL_TRACKS, BST_CHANNEL_QUEUE, bst_tracks, bst_track, count_tracks),
    WITH_ITEMS(BST_CHANNEL_TRACK_IDENTITIES, BST_CHANNEL_QUEUE, bst_track_identities,
               bst_track_identity, count_identities),
    WITH_ITEMS(BST_CHANNEL_TRACKS_SMOOTHED, BST_CHANNEL_QUEUE, bst_tracks_smoothed,
               bst_track_smoothed, count_smoothed),
    HEADER_ONLY(BST_CHANNEL_CONTROL_STATUS, BST_CHANNEL_LATEST, bst_control_status),
    HEADER_ONLY(BST_CHANNEL_TASK, BST_CHANNEL_LATEST, bst_task),
};

const bst_channel_type *bst_channel_type_find(const char *name) {
    for (size_t i = 0; i < sizeof types / sizeof *types; i++) {
        if (strcmp(types[i].name, name) == 0) {
            return &types[i];
        }
    }
    return NULL;
}

const char *bst_channel_writers(const char *name) {
    static const char *const writers[][2] = {
        {BST_CHANNEL_LOS_HISTORY, "gimbal"},
        {BST_CHANNEL_POINTING_TELEMETRY, "gimbal"},
        {BST_CHANNEL_MOUNT_STATUS, "gimbal"},
        {BST_CHANNEL_WHEEL_STATUS, "gimbal"},
        {BST_CHANNEL_FRAME, "scenegen"},
        {BST_CHANNEL_PLANES, "scenegen"},
        {BST_CHANNEL_TRUTH, "scenegen or obsgen"},
        {BST_CHANNEL_DETECTIONS, "imgproc or obsgen"},
        {BST_CHANNEL_REGIONS_OF_INTEREST, "imgproc"},
        {BST_CHANNEL_PREDICTIONS, "tracker"},
        {BST_CHANNEL_TRACKS, "tracker"},
        {BST_CHANNEL_TRACK_IDENTITIES, "tracker"},
        {BST_CHANNEL_TRACKS_SMOOTHED, "tracker"},
        {BST_CHANNEL_LOS_COMMAND, "control"},
        {BST_CHANNEL_SENSOR_COMMAND, "control"},
        {BST_CHANNEL_CONTROL_STATUS, "control"},
        {BST_CHANNEL_TASK, "tasking"},
    };
    for (size_t i = 0; i < sizeof writers / sizeof *writers; i++) {
        if (strcmp(writers[i][0], name) == 0) {
            return writers[i][1];
        }
    }
    return NULL;
}

const char *bst_mode_name(int mode) {
    static const char *const names[BST_MODE_COUNT] = {"idle",  "slew",      "search", "acquire",
                                                      "track", "reacquire", "stare",  "rate",
                                                      "coast", "fixed",     "scan",   "lost"};
    return mode >= 0 && mode < BST_MODE_COUNT ? names[mode] : "unknown";
}

const char *bst_task_end_name(int end) {
    static const char *const names[BST_TASK_END_COUNT] = {"none", "done", "not_found", "lost"};
    return end >= 0 && end < BST_TASK_END_COUNT ? names[end] : "unknown";
}
