/* Scenes of the rendering benchmarks: camera, sources and motion, equal in every process. */
#ifndef BST_BENCH_BENCH_SCENES_H
#define BST_BENCH_BENCH_SCENES_H

#include "scenegen/renderer.h"
#include "sim/bench/bench.h"

typedef struct bst_bench_scene {
    const char *name;
    int side;          /* of the sensor, px */
    bst_window window; /* width 0: full sensor */
    int stars, targets;
    double magnitudes; /* range of star magnitudes; counts increase as 10^(0.4 m) */
    double exposure_s;
    double travel_px; /* streak length of the stars, along the diagonal */
    double bend_px;   /* quadratic part of the motion */
    double roll_rad;
    double jitter_px; /* RMS per axis, 5 to 200 Hz */
    bool target_at_rest;
    double background_e;
    double tolerance_sigma;
    int error_sources; /* number of sources whose error is measured, the brightest and an even
                          selection; limited because the reference is slow */
    double q;          /* wavelength x focal ratio / pixel of a diffraction PSF; 0: the Gaussian */
    bool plain;        /* only shot and read noise, full well and converter; else all effects */
} bst_bench_scene;

/* Finds a scene by name; NULL: none. */
const bst_bench_scene *bst_bench_find_scene(const char *name);

enum { BST_BENCH_TARGETS = 4 };

/* A scene with buffers for its frames. */
typedef struct bst_bench_view {
    bst_bench_scene scene;
    bst_camera camera;
    bst_window window;
    bst_scene_source *sources; /* targets last */
    int count;
    bst_scene_source_path paths[BST_BENCH_TARGETS];
    double *time_s;
    bst_quat *q;
    bst_los_track track;
    bst_render_request request; /* request of the current frame */
} bst_bench_view;

/* Creates camera, attitude track and sources of a benchmark scene.
 *
 * Errors:    BST_ERR_MEMORY; then `out` holds nothing to free
 * Ownership: free with bst_bench_view_close */
bst_status bst_bench_view_open(bst_ctx *ctx, const bst_bench_scene *scene,
                               bst_bench_view *out) BST_MUST_CHECK;
/* Frees the arrays of a view and clears it. */
void bst_bench_view_close(bst_bench_view *view);
/* Sets pointing, jitter, targets and noise of frame n in `request`. */
void bst_bench_view_set(bst_bench_view *view, int frame);
/* Times the rendering of `frames` frames after warm-up, each with its own pointing, targets and
 * noise. ahead: a frame is requested before the previous one is mapped, so that planning overlaps
 * with the device; times are intervals between mapped frames, averaged over four. Otherwise each
 * frame is mapped before the next request. */
bst_status bst_bench_view_time(bst_ctx *ctx, bst_renderer *renderer, bst_bench_view *view,
                               int frames, bool ahead, bst_bench_result *out) BST_MUST_CHECK;

/* Reference image of selected sources of a view, for many comparisons. */
typedef struct bst_bench_truth {
    bst_bench_view *view;
    bst_scene_source *sources; /* selected */
    int count;
    double *image; /* [height][width] of the window */
    struct bst_bench_moment {
        bst_window box;
        double electrons, x, y; /* within the box: total light and centroid */
        bool inside;
    } * moments;
} bst_bench_truth;

/* Renders the reference image of a view.
 *
 * Given:     view  must outlive the result
 * Errors:    BST_ERR_MEMORY, and those of bst_reference_render
 * Ownership: free with bst_bench_truth_free */
bst_status bst_bench_truth_make(bst_ctx *ctx, bst_bench_view *view,
                                bst_bench_truth *out) BST_MUST_CHECK;
/* Frees the memory of a reference image and clears the struct, which belongs to the caller. */
void bst_bench_truth_free(bst_bench_truth *truth);
/* Compares the renderer's image with the reference; only sources of at least `faintest_e_per_s` are
 * rendered. */
bst_status bst_bench_truth_compare(bst_ctx *ctx, bst_renderer *renderer,
                                   const bst_bench_truth *truth, double faintest_e_per_s,
                                   bst_bench_result *out) BST_MUST_CHECK;

/* Waits for a frame, maps its pixels once and releases it. BST_ERR_DEVICE. */
bst_status bst_bench_map_and_release(bst_ctx *ctx, bst_frame *frame) BST_MUST_CHECK;

#endif
