/* The scenes of the benchmark: what a camera sees and how it moves, the same in every process. */
#ifndef BST_BENCH_BENCH_SCENES_H
#define BST_BENCH_BENCH_SCENES_H

#include "scenegen/renderer.h"
#include "sim/bench/bench.h"

typedef struct bst_bench_scene {
    const char *name;
    int side;          /* of the sensor, px */
    bst_window window; /* width 0: all of it */
    int stars, targets;
    double magnitudes; /* star brightnesses span this, counts growing as 10^(0.4 m) */
    double exposure_s;
    double travel_px; /* of the stars along the diagonal */
    double bend_px;   /* acceleration: the quadratic part */
    double roll_rad;
    double jitter_px; /* RMS per axis, 5 to 200 Hz */
    bool target_at_rest;
    double background_e;
    double tolerance_sigma;
    int error_sources; /* sources whose error is measured, the brightest and an even choice of the
                          others; the reference takes its time */
    double q;          /* wavelength x focal ratio / pixel of a diffraction PSF; 0: the Gaussian */
    bool plain;        /* shot and read noise, full well and converter; else all effects */
} bst_bench_scene;

/* NULL: there is none of that name. */
const bst_bench_scene *bst_bench_find_scene(const char *name);

enum { BST_BENCH_TARGETS = 4 };

/* A scene with room for its frames. */
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
    bst_render_request request; /* of the frame that was set last */
} bst_bench_view;

/* Creates camera, attitude track and sources of a benchmark scene.
 *
 * Errors:    BST_ERR_MEMORY; then `out` holds nothing to free
 * Ownership: free with bst_bench_view_close */
bst_status bst_bench_view_open(bst_ctx *ctx, const bst_bench_scene *scene,
                               bst_bench_view *out) BST_MUST_CHECK;
/* Frees the arrays of a view and clears it. */
void bst_bench_view_close(bst_bench_view *view);
/* Pointing, jitter, targets and noise of frame n; fills `request`. */
void bst_bench_view_set(bst_bench_view *view, int frame);
/* Renders `frames` frames (after warm-up, each with pointing, targets and noise of its own) and
 * fills the times. ahead: a frame is asked for before the one before is mapped, so that it is
 * planned while the device renders that one, and times are from one mapped frame to the next, means
 * over four of them; else each is mapped before the next is asked for. */
bst_status bst_bench_view_time(bst_ctx *ctx, bst_renderer *renderer, bst_bench_view *view,
                               int frames, bool ahead, bst_bench_result *out) BST_MUST_CHECK;

/* The reference image of a choice of a view's sources in its frame, made once for many
 * comparisons. */
typedef struct bst_bench_truth {
    bst_bench_view *view;
    bst_scene_source *sources; /* chosen */
    int count;
    double *image; /* [height][width] of the window */
    struct bst_bench_moment {
        bst_window box;
        double electrons, x, y; /* on the box; of light that lies within it as a whole */
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
/* Errors of the renderer's image of those sources; of them only those of at least
 * `faintest_e_per_s` are drawn. */
bst_status bst_bench_truth_compare(bst_ctx *ctx, bst_renderer *renderer,
                                   const bst_bench_truth *truth, double faintest_e_per_s,
                                   bst_bench_result *out) BST_MUST_CHECK;

#endif
