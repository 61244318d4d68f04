/* Points from JSON: annotations of SatNet, and labels of the spotGEO competition. */
#include <cjson/cJSON.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "sim/analysis/score/score_points.h"
#include "sim/core/json_member.h"

/* Fails at an element: "FILE: /place: WHAT". */
static bst_status fail_at(bst_ctx *ctx, const char *name, const char *place, const char *what) {
    return bst_fail(ctx, BST_ERR_FORMAT, "%.400s: %.100s: %s", name, place, what);
}

/* A whole number of a JSON object; false: none. */
static bool whole(const cJSON *node, const char *key, int64_t *out) {
    double value = bst_json_member_number(node, key);
    if (!(fabs(value) < 9e15) || value != floor(value)) {
        return false;
    }
    *out = (int64_t)value;
    return true;
}

/* Adds a frame of spotGEO: sequence_id, frame, object_coords [[x, y], ...]. */
static bst_status add_spotgeo(bst_ctx *ctx, const char *name, const cJSON *node, int index,
                              bst_score_points *points) {
    char place[64];
    bst_score_key key;
    snprintf(place, sizeof place, "/%d", index);
    const cJSON *list = bst_json_member(node, "object_coords");
    if (!whole(node, "sequence_id", &key.sequence) || !whole(node, "frame", &key.frame) ||
        !cJSON_IsArray(list)) {
        return fail_at(ctx, name, place,
                       "is no frame (allowed: an object with the integers sequence_id and frame, "
                       "and the list object_coords, as the spotGEO competition has them)");
    }
    BST_TRY(bst_score_points_add_frame(ctx, points, key));
    int number = 0;
    for (const cJSON *pair = list->child; pair; pair = pair->next, number++) {
        const cJSON *x = cJSON_IsArray(pair) ? pair->child : NULL, *y = x ? x->next : NULL;
        if (!cJSON_IsNumber(x) || !cJSON_IsNumber(y) || y->next) {
            snprintf(place, sizeof place, "/%d/object_coords/%d", index, number);
            return fail_at(ctx, name, place, "is no position (allowed: [x, y] in pixels)");
        }
        const bst_score_point point = {
            .key = key, .x_px = x->valuedouble, .y_px = y->valuedouble, .score = NAN, .id = -1};
        BST_TRY(bst_score_points_add(ctx, points, &point));
    }
    return BST_OK;
}

/* Adds a satellite of SatNet, whose positions are fractions of the image between its edges. */
static bst_status add_satellite(bst_ctx *ctx, const char *name, const cJSON *object, int index,
                                const double size_px[2], bst_score_points *points) {
    char place[64];
    const char *class_name = bst_json_member_text(object, "class_name", "");
    if (bst_json_member_number(object, "class_id") != 1.0 && strcmp(class_name, "Satellite") != 0) {
        return BST_OK; /* a star */
    }
    double x = bst_json_member_number(object, "x_centroid"),
           y = bst_json_member_number(object, "y_centroid");
    if (!isfinite(x) || !isfinite(y)) {
        x = bst_json_member_number(object, "x_center");
        y = bst_json_member_number(object, "y_center");
    }
    if (!isfinite(x) || !isfinite(y)) {
        snprintf(place, sizeof place, "/data/objects/%d", index);
        return fail_at(ctx, name, place,
                       "has no position (allowed: x_centroid and y_centroid, or x_center and "
                       "y_center, as fractions of the image)");
    }
    double score = bst_json_member_number(object, "confidence");
    int64_t id = -1;
    const char *text = bst_json_member_text(object, "object_id", "");
    if (*text && sscanf(text, "%" SCNd64, &id) != 1) {
        id = -1;
    }
    const bst_score_point point = {
        .key = points->frames[points->frame_count - 1],
        .x_px = x * size_px[0] - 0.5,
        .y_px = y * size_px[1] - 0.5,
        .score = isfinite(score) ? score : bst_json_member_number(object, "snr_aperture"),
        .id = id};
    return bst_score_points_add(ctx, points, &point);
}

/* Adds a frame of SatNet. */
static bst_status add_satnet(bst_ctx *ctx, const char *name, const cJSON *data, int64_t ordinal,
                             bst_score_points *points) {
    const cJSON *file = bst_json_member(data, "file"), *sensor = bst_json_member(data, "sensor");
    const cJSON *objects = bst_json_member(data, "objects");
    double size_px[] = {bst_json_member_number(sensor, "width"),
                        bst_json_member_number(sensor, "height")};
    bst_score_key key = {0, ordinal};
    if (!whole(file, "sequence", &key.sequence)) {
        key.sequence = 0;
    }
    if (!whole(file, "sequence_id", &key.frame)) {
        key.frame = ordinal;
    }
    if (!(size_px[0] >= 1.0) || !(size_px[1] >= 1.0) || !cJSON_IsArray(objects)) {
        return fail_at(ctx, name, "/data",
                       "is no frame (allowed: sensor with width and height in pixels, and the list "
                       "objects, as SatNet has them)");
    }
    int before = points->frame_count;
    BST_TRY(bst_score_points_add_frame(ctx, points, key));
    if (points->frame_count == before) {
        return fail_at(ctx, name, "/data/file",
                       "the same frame is in two files (allowed: a sequence_id of its own in each "
                       "file, or in none)");
    }
    int index = 0;
    for (const cJSON *object = objects->child; object; object = object->next, index++) {
        BST_TRY(add_satellite(ctx, name, object, index, size_px, points));
    }
    return BST_OK;
}

bst_status bst_score_points_add_json(bst_ctx *ctx, const char *name, const cJSON *root,
                                     int64_t ordinal, bst_score_points *points) {
    const cJSON *data = bst_json_member(root, "data");
    if (cJSON_IsObject(data)) {
        return add_satnet(ctx, name, data, ordinal, points);
    }
    if (!cJSON_IsArray(root)) {
        return fail_at(ctx, name, "/",
                       "is no list of points (allowed: an array of frames with sequence_id, frame "
                       "and object_coords, or an object data as SatNet has it)");
    }
    int index = 0;
    for (const cJSON *node = root->child; node; node = node->next, index++) {
        BST_TRY(add_spotgeo(ctx, name, node, index, points));
    }
    return BST_OK;
}
