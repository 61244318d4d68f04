/* Benchmark of image processing: frames of the rendering scenes are rendered once, then processed
 * repeatedly. */
#include <stdlib.h>
#include <string.h>

#include "imgproc/imgproc.h"
#include "sim/bench/bench_scenes.h"
#include "sim/core/pages.h"
#include "sim/device/device.h"

enum { KEPT = 4, WARM_UP = 4, CALLS = 24, SMALL_CALLS = 2000, SMALL_PX = 512 * 512 };
enum { FITS = 2048, ALL = 40000 }; /* FITS: also the default capacity */

static const char PREFIX[] = "imgproc_", CROWDED[] = "imgproc_crowded";

typedef struct shot {
    uint16_t *pixels;
    bst_camera_motion motion;
} shot;

typedef struct shots {
    bst_bench_view view;
    shot items[KEPT];
} shots;

/* Camera motion of the last frame, as perfect telemetry would give it. */
static bst_status motion_of(bst_ctx *ctx, const bst_bench_view *v, bst_camera_motion *out) {
    int count = v->track.count;
    bst_pointing_telemetry *ring =
        calloc(1, sizeof *ring + (size_t)count * sizeof(bst_pointing_sample));
    if (!ring) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a scene's telemetry");
    }
    ring->written = ring->capacity = count;
    for (int i = 0; i < count; i++) {
        ring->items[i].tick = i;
        ring->items[i].q_cam_from_gcrf = v->track.q_cam_from_gcrf[i];
    }
    bool known = bst_camera_motion_from_telemetry(ring, 0, count - 1, out);
    free(ring);
    return known ? BST_OK : bst_fail(ctx, BST_ERR_STATE, "a scene without attitudes");
}

static bst_status keep_frame(bst_ctx *ctx, bst_renderer *renderer, shots *s, int n) {
    size_t bytes = (size_t)s->view.window.width * (size_t)s->view.window.height * sizeof(uint16_t);
    bst_bench_view_set(&s->view, n);
    s->items[n].pixels = bst_pages_alloc(bytes); /* allocated like those of a device */
    if (!s->items[n].pixels) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the frames of a scene");
    }
    BST_TRY(motion_of(ctx, &s->view, &s->items[n].motion));
    bst_frame *frame = NULL;
    BST_TRY(bst_renderer_render(ctx, renderer, &s->view.request, &frame));
    const uint16_t *pixels;
    bst_status status = bst_frame_map(frame, ctx, &pixels);
    if (status == BST_OK) {
        memcpy(s->items[n].pixels, pixels, bytes);
        bst_frame_unmap(frame);
    }
    bst_frame_release(frame);
    return status;
}

static bst_status render(bst_ctx *ctx, const bst_bench_options *options, shots *s) {
    bst_device *device = NULL;
    bst_renderer *renderer = NULL;
    bst_status status =
        bst_device_open(ctx, options->device ? options->device : "", options->threads, &device);
    if (status == BST_OK) {
        bst_renderer_options fidelity = bst_renderer_default_options();
        fidelity.tolerance_sigma = s->view.scene.tolerance_sigma;
        status = bst_renderer_create(ctx, device, &s->view.camera, &fidelity, &renderer);
    }
    for (int n = 0; n < KEPT && status == BST_OK; n++) {
        status = keep_frame(ctx, renderer, s, n);
    }
    bst_renderer_free(renderer);
    bst_device_close(device);
    return status;
}

static bst_status process(bst_ctx *ctx, const bst_bench_options *options, shots *s, int room,
                          bst_bench_result *out) {
    const bst_camera *camera = &s->view.camera;
    bst_imgproc_config config = {.capacity = room,
                                 .max_fits = FITS,
                                 .mesh_px = 64,
                                 .false_alarms_per_frame = 1.0,
                                 .jitter_px = s->view.scene.jitter_px,
                                 .streak_min_px = 1.5,
                                 .streak_max_px = 64.0,
                                 .search_radius_px = 60.0,
                                 .match_tolerance_px = 3.0,
                                 .threads = options->threads};
    bst_imgproc *ip = NULL;
    bst_detections *found =
        calloc(1, sizeof *found + (size_t)config.capacity * sizeof found->items[0]);
    if (!found) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for detections");
    }
    bst_status status = bst_imgproc_create(ctx, camera, bst_camera_electrons_per_s(camera, 0.0),
                                           &config, NULL, &ip);
    bool small = s->view.window.width * s->view.window.height <= SMALL_PX;
    int calls = small ? SMALL_CALLS : CALLS;
    bst_bench_clock clock = {.count = 0};
    double sum = 0.0, lost = 0.0;
    for (int i = 0; i < WARM_UP + calls && status == BST_OK; i++) {
        const shot *shown = &s->items[i % KEPT];
        bst_imgproc_frame frame = {.pixels = shown->pixels,
                                   .window = s->view.window,
                                   .binning = 1,
                                   .bits = (int)camera->bits,
                                   .exposure_s = s->view.scene.exposure_s,
                                   .detections_only = true};
        bst_bench_start(&clock);
        status = bst_imgproc_detect(ctx, ip, &frame, &shown->motion, found, (int)config.capacity);
        if (i >= WARM_UP) {
            bst_bench_stop(&clock, 1);
            sum += found->count;
            lost += found->lost;
        }
    }
    bst_imgproc_free(ip);
    free(found);
    if (status == BST_OK) {
        out->detections = sum / calls;
        out->detections_lost = lost / calls;
        bst_bench_summarise(&clock, out);
    }
    return status;
}

bst_status bst_bench_imgproc(bst_ctx *ctx, const bst_bench *self, const bst_bench_options *options,
                             bst_bench_result *out) {
    bool crowded = strcmp(self->name, CROWDED) == 0;
    const bst_bench_scene *scene =
        bst_bench_find_scene(crowded ? "galactic_core" : self->name + strlen(PREFIX));
    if (!scene) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "there is no scene for \"%s\"", self->name);
    }
    shots s = {.items = {{.pixels = NULL}}};
    bst_status status = bst_bench_view_open(ctx, scene, &s.view);
    if (status == BST_OK) {
        status = render(ctx, options, &s);
    }
    if (status == BST_OK) {
        status = process(ctx, options, &s, crowded ? ALL : FITS, out);
    }
    for (int n = 0; n < KEPT; n++) {
        free(s.items[n].pixels);
    }
    bst_bench_view_close(&s.view);
    return status;
}
