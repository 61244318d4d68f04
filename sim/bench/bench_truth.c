#include <math.h>
#include <stdlib.h>

#include "scenegen/reference.h"
#include "sim/bench/bench_scenes.h"

/* radius in sigma beyond which a Gaussian's light is below 1e-20 */
#define REACH_SIGMAS 9.5

static int compare_rates(const void *a, const void *b) {
    double p = ((const bst_scene_source *)a)->electrons_per_s,
           q = ((const bst_scene_source *)b)->electrons_per_s;
    return (p < q) - (p > q);
}

/* Selects targets, the brightest stars and an even selection of the others. */
static bst_status choose_sources(bst_ctx *ctx, const bst_bench_view *v, bst_bench_truth *t) {
    int stars = v->scene.stars, want = v->scene.error_sources, brightest = want / 8 + 1;
    bst_scene_source *sorted = malloc((size_t)v->count * sizeof *sorted);
    t->sources = malloc((size_t)v->count * sizeof *t->sources);
    if (!sorted || !t->sources) {
        free(sorted);
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the error's sources");
    }
    for (int i = 0; i < v->count; i++) {
        sorted[i] = v->sources[i];
    }
    qsort(sorted, (size_t)stars, sizeof *sorted, compare_rates);
    int stride = stars / (want > 0 ? want : 1) + 1;
    for (int i = 0; i < v->count; i++) {
        if (i >= stars || i < brightest || i % stride == 0) {
            t->sources[t->count++] = sorted[i];
        }
    }
    free(sorted);
    return BST_OK;
}

/* Box of pixels that a source's light reaches in the exposure, clipped to the window; false: none.
 * *inside: not clipped. */
static bool box_of(const bst_bench_view *v, const bst_scene_source *s, bst_window *box,
                   bool *inside) {
    double x0 = INFINITY, y0 = INFINITY, x1 = -INFINITY, y1 = -INFINITY;
    double reach = REACH_SIGMAS * bst_camera_psf_sigma_px(&v->camera) + 3.0;
    bst_window w = v->window;
    for (int k = 0; k < v->track.count; k++) {
        double x, y, u = v->time_s[k] / v->time_s[v->track.count - 1];
        if (bst_camera_project(
                &v->camera, bst_quat_rotate(v->q[k], bst_scene_source_direction(s, u)), &x, &y)) {
            x0 = fmin(x0, x);
            x1 = fmax(x1, x);
            y0 = fmin(y0, y);
            y1 = fmax(y1, y);
        }
    }
    x0 = floor(x0 - reach), y0 = floor(y0 - reach), x1 = ceil(x1 + reach), y1 = ceil(y1 + reach);
    *inside = x0 >= w.x0 && y0 >= w.y0 && x1 < w.x0 + w.width && y1 < w.y0 + w.height;
    x0 = fmax(x0, w.x0), y0 = fmax(y0, w.y0);
    x1 = fmin(x1, w.x0 + w.width - 1), y1 = fmin(y1, w.y0 + w.height - 1);
    if (!(x1 >= x0 && y1 >= y0)) {
        return false;
    }
    *box = (bst_window){(int)x0, (int)y0, (int)(x1 - x0) + 1, (int)(y1 - y0) + 1};
    return true;
}

static void add_to_moment(struct bst_bench_moment *m, int x, int y, double electrons) {
    m->electrons += electrons;
    m->x += electrons * x;
    m->y += electrons * y;
}

/* Adds the reference image of one source with a Gaussian PSF, and its moments. */
static bst_status add_source(bst_ctx *ctx, bst_bench_truth *t, int i) {
    const bst_bench_view *v = t->view;
    struct bst_bench_moment *m = &t->moments[i];
    *m = (struct bst_bench_moment){.inside = false};
    if (!box_of(v, &t->sources[i], &m->box, &m->inside)) {
        return BST_OK;
    }
    bst_window b = m->box, w = v->window;
    double *image = calloc((size_t)b.width * (size_t)b.height, sizeof *image);
    if (!image) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a reference image");
    }
    bst_status status =
        bst_reference_render(ctx, &v->camera, b, &v->track, &t->sources[i], 1, 1e-9, image);
    for (int y = 0; status == BST_OK && y < b.height; y++) {
        double *row = t->image + (size_t)(b.y0 - w.y0 + y) * (size_t)w.width + (b.x0 - w.x0);
        for (int x = 0; x < b.width; x++) {
            double e = image[(size_t)y * (size_t)b.width + (size_t)x];
            row[x] += e;
            add_to_moment(m, x, y, e);
        }
    }
    free(image);
    return status;
}

bst_status bst_bench_truth_make(bst_ctx *ctx, bst_bench_view *v, bst_bench_truth *t) {
    size_t pixels = (size_t)v->window.width * (size_t)v->window.height;
    *t = (bst_bench_truth){.view = v, .image = calloc(pixels, sizeof(double))};
    bst_status status =
        t->image ? choose_sources(ctx, v, t)
                 : bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the reference image");
    if (status == BST_OK) {
        t->moments = calloc((size_t)t->count, sizeof *t->moments);
        status = t->moments
                     ? BST_OK
                     : bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the sources' places");
    }
    if (status == BST_OK && v->scene.q > 0.0) {
        /* PSF wings extend over the whole frame: rendering sources one by one would take too
         * long */
        status = bst_reference_render(ctx, &v->camera, v->window, &v->track, t->sources, t->count,
                                      1e-9, t->image);
    }
    for (int i = 0; status == BST_OK && v->scene.q == 0.0 && i < t->count; i++) {
        status = add_source(ctx, t, i);
    }
    if (status != BST_OK) {
        bst_bench_truth_free(t);
    }
    return status;
}

void bst_bench_truth_free(bst_bench_truth *t) {
    free(t->sources);
    free(t->image);
    free(t->moments);
    *t = (bst_bench_truth){.count = 0};
}

/* Largest centroid shift of a source, each rendered alone, and error of its total light. */
static bst_status compare_moments(bst_ctx *ctx, bst_renderer *renderer, const bst_bench_truth *t,
                                  double faintest_e_per_s, float *image, bst_bench_result *out) {
    double fast = 0.0, exact = 0.0, shift = -1.0;
    for (int i = 0; i < t->count; i++) {
        const struct bst_bench_moment *m = &t->moments[i];
        if (!m->inside) {
            continue;
        }
        exact += m->electrons;
        if (t->sources[i].electrons_per_s < faintest_e_per_s) {
            continue;
        }
        bst_render_request request = t->view->request;
        request.window = m->box;
        request.sources = &t->sources[i];
        request.count = 1;
        BST_TRY(bst_renderer_render_noise_free(ctx, renderer, &request, image));
        struct bst_bench_moment drawn = {.electrons = 0.0};
        for (int y = 0; y < m->box.height; y++) {
            for (int x = 0; x < m->box.width; x++) {
                add_to_moment(&drawn, x, y,
                              (double)image[(size_t)y * (size_t)m->box.width + (size_t)x] -
                                  request.background_e);
            }
        }
        fast += drawn.electrons;
        shift = fmax(shift, hypot(drawn.x / drawn.electrons - m->x / m->electrons,
                                  drawn.y / drawn.electrons - m->y / m->electrons));
    }
    if (exact > 0.0) {
        out->flux_error_rel = fabs(fast / exact - 1.0);
        out->centroid_error_px = shift >= 0.0 ? shift : NAN;
    }
    return BST_OK;
}

bst_status bst_bench_truth_compare(bst_ctx *ctx, bst_renderer *renderer, const bst_bench_truth *t,
                                   double faintest_e_per_s, bst_bench_result *out) {
    const bst_bench_view *v = t->view;
    size_t pixels = (size_t)v->window.width * (size_t)v->window.height;
    float *image = malloc(pixels * sizeof *image);
    bst_scene_source *drawn = malloc((size_t)(t->count + 1) * sizeof *drawn);
    if (!image || !drawn) {
        free(image);
        free(drawn);
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the error's images");
    }
    bst_render_request request = v->request;
    request.sources = drawn;
    request.count = 0;
    for (int i = 0; i < t->count; i++) {
        if (t->sources[i].electrons_per_s >= faintest_e_per_s) {
            drawn[request.count++] = t->sources[i];
        }
    }
    bst_status status = bst_renderer_render_noise_free(ctx, renderer, &request, image);
    double worst = 0.0, sum2 = 0.0, peak = 0.0, absolute = 0.0, fast = 0.0, exact = 0.0;
    double dark = request.background_e + v->camera.read_noise_e * v->camera.read_noise_e;
    for (size_t i = 0; status == BST_OK && i < pixels; i++) {
        double light = (double)image[i] - request.background_e, error = light - t->image[i];
        double sigmas = fabs(error) / sqrt(fmax(t->image[i], 0.0) + dark);
        worst = fmax(worst, sigmas);
        sum2 += sigmas * sigmas;
        absolute = fmax(absolute, fabs(error));
        peak = fmax(peak, t->image[i]);
        fast += light;
        exact += t->image[i];
    }
    bst_render_stats stats;
    bst_renderer_get_stats(renderer, &stats);
    out->predicted_error_sigma = faintest_e_per_s > 0.0 ? NAN : stats.predicted_sigma;
    out->error_sources = t->count;
    out->error_sigma_max = worst;
    out->error_sigma_rms = sqrt(sum2 / (double)pixels);
    out->error_peak_max = peak > 0.0 ? absolute / peak : NAN;
    if (status == BST_OK && v->scene.q > 0.0) {
        out->flux_error_rel = exact > 0.0 ? fabs(fast / exact - 1.0) : NAN;
    } else if (status == BST_OK) {
        status = compare_moments(ctx, renderer, t, faintest_e_per_s, image, out);
    }
    free(image);
    free(drawn);
    return status;
}
