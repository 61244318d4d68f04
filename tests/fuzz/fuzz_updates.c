/* The reader of frame updates on any bytes. What is accepted leads from frame to frame with
 * settings in their ranges. */
#include <math.h>
#include <stdint.h>
#include <stdlib.h>

#include "sim/world/frame_updates.h"
#include "tests/fuzz/input_file.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes);

static const bst_camera camera = {.width_px = 640, .height_px = 480, .pixel_scale_arcsec = 3.0};
static const bst_exposure_config exposure = {.exposure_s = 0.5, .period_s = 1.0, .first_s = 2.0};

static void check_update(const bst_frame_update *update, int64_t before) {
    if (update->frame <= before || update->node_count < 0 || update->object_count < 0) {
        abort();
    }
    for (int i = 0; i < update->node_count; i++) {
        const bst_quat q = update->nodes[i].q_cam_from_gcrf;
        double norm = sqrt(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w);
        if (!(fabs(norm - 1.0) < 1e-9) ||
            (i > 0 && !(update->nodes[i].time_s > update->nodes[i - 1].time_s))) {
            abort();
        }
    }
    for (int i = 0; i < update->object_count; i++) {
        if (!isfinite(bst_vec3_norm(update->objects[i].start_position_m))) {
            abort();
        }
    }
}

static void follow(const bst_frame_updates *updates) {
    bst_frame_cursor c = bst_frame_cursor_begin(updates, &camera, &exposure, 1000.0);
    for (int i = 0; i < 100; i++, bst_frame_cursor_next(&c)) {
        if (!(c.exposure_s >= 0.0) || !(c.period_s > 0.0) || !isfinite(c.start_s) ||
            c.binning < 1 || c.window.width < 1 || c.window.height < 1 || c.window.x0 < 0 ||
            c.window.y0 < 0 || c.window.x0 + c.window.width > camera.width_px ||
            c.window.y0 + c.window.height > camera.height_px) {
            abort();
        }
    }
    double longest_s, shortest_s;
    bst_frame_updates_limits(updates, &camera, &exposure, &longest_s, &shortest_s);
    if (!(longest_s >= 0.0) || !(shortest_s > 0.0)) {
        abort();
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes) {
    bst_ctx ctx;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
    bst_frame_updates *updates = NULL;
    bst_status status = bst_frame_updates_parse(&ctx, "input", (const char *)data, bytes, &camera,
                                                &exposure, &updates);
    FUZZ_CHECK_REASON(ctx, status);
    if ((status == BST_OK) != (updates != NULL)) {
        abort();
    }
    int64_t before = -1;
    for (int i = 0; updates && i < bst_frame_updates_count(updates); i++) {
        const bst_frame_update *update = bst_frame_updates_item(updates, i);
        check_update(update, before);
        before = update->frame;
    }
    if (updates) {
        follow(updates);
    }
    bst_frame_updates_free(updates);
    return 0;
}
