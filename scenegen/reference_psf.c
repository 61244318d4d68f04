#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "scenegen/reference_internal.h"
#include "sim/core/fft.h"

/* The image is the inverse transform of the OTF times the spectrum S(f) = sum w_j exp(-2 pi i f .
 * x_j) of the positions x_j in time. S is computed on a frequency grid by a non-uniform FFT. The
 * positions are spread over a grid 1.5 times finer with exp(b (sqrt(1 - z^2) - 1)), transformed,
 * and divided by the spreading function's transform (Barnett, Magland and af Klinteberg 2019, SIAM
 * J. Sci. Comput. 41, C479). With 16 points the error is exp(-pi 16 sqrt(1 - 1 / 1.5)), 3e-13 of
 * the light. Frequencies beyond half a cycle per pixel are reached by multiplying the weights by
 * exp(-2 pi i a . x_j) for integer a, as sampling at pixel centres aliases them. */
enum { SPREAD = 16 };

/* Gauss-Legendre on [0, 1] (Abramowitz and Stegun, table 25.4): few points for short intervals of a
 * finely sampled track, more for coarse ones. */
enum { POINTS = 8 };
typedef struct time_rule {
    int count;
    double place[POINTS], weight[POINTS];
} time_rule;
static const time_rule rules[2] = {
    {4,
     {0.06943184420297371, 0.33000947820757187, 0.66999052179242813, 0.93056815579702629},
     {0.17392742256872693, 0.32607257743127307, 0.32607257743127307, 0.17392742256872693}},
    {8,
     {0.019855071751231884, 0.10166676129318664, 0.2372337950418355, 0.4082826787521751,
      0.5917173212478249, 0.7627662049581645, 0.8983332387068134, 0.9801449282487681},
     {0.05061426814518813, 0.11119051722668724, 0.15685332293894363, 0.18134189168918100,
      0.18134189168918100, 0.15685332293894363, 0.11119051722668724, 0.05061426814518813}},
};

/* Number of frequency directions at which the time quadrature is tested. */
enum { TRIALS = 6 };

/* Most halvings of an interval between two samples. */
enum { DEEPEST = 50 };

typedef struct spectrum {
    const bst_camera *camera;
    const bst_psf *psf;
    bst_window window;
    const bst_los_track *track;
    double tolerance, cutoff;
    int margin; /* margin around the window, px */
    int side;   /* period of the image, px; odd */
    int fine;   /* size of the spreading grid */
    double beta;
    bst_fft_complex_f64 *spread; /* [fine][fine] */
    bst_fft_complex_f64 *sum;    /* [side][side], frequencies in wrap-around order */
    double *shape;               /* [side / 2 + 1]: transform of the spreading function */
    bst_fft *forward, *back;
    int node;     /* current PSF node */
    int shift[2]; /* current frequency shift, cycles/px */
} spectrum;

static int quick_size(int least, int step) {
    for (int n = least;; n += step) {
        int rest = n;
        for (int p = 2; p <= 7; p++) {
            while (rest % p == 0) {
                rest /= p;
            }
        }
        if (rest == 1) {
            return n;
        }
    }
}

/* Spreading function exp(b (sqrt(1 - z^2) - 1)) at |z| < 1. */
static double bump(double beta, double z) {
    double r = 1.0 - z * z;
    return r > 0.0 ? exp(beta * (sqrt(r) - 1.0)) : 0.0;
}

/* Transform of the spreading function at frequency index k; with z = sin t the equidistant rule
 * converges geometrically. */
static double bump_transform(const spectrum *s, int k) {
    enum { STEPS = 400 };
    double sum = 0.0, turn = BST_PI * SPREAD * k / s->fine;
    for (int i = 0; i < STEPS; i++) {
        double t = BST_PI * ((i + 0.5) / STEPS - 0.5), z = sin(t);
        sum += cos(t) * exp(s->beta * (cos(t) - 1.0)) * cos(turn * z);
    }
    return sum * BST_PI / STEPS * 0.5 * SPREAD;
}

static void spectrum_free(spectrum *s) {
    bst_fft_free(s->forward);
    bst_fft_free(s->back);
    bst_fft_array_free(s->spread);
    bst_fft_array_free(s->sum);
    free(s->shape);
}

static bst_status spectrum_create(bst_ctx *ctx, spectrum *s) {
    int longest = s->window.width > s->window.height ? s->window.width : s->window.height;
    int least = longest + 2 * s->margin;
    s->side = quick_size(least | 1, 2);
    s->fine = quick_size((3 * s->side + 1) / 2 + SPREAD, 1);
    s->beta = 0.976 * BST_PI * SPREAD * (1.0 - 0.5 * s->side / s->fine);
    size_t fine = (size_t)s->fine * (size_t)s->fine, side = (size_t)s->side * (size_t)s->side;
    s->spread = bst_fft_array(fine * sizeof *s->spread);
    s->sum = bst_fft_array(side * sizeof *s->sum);
    s->shape = malloc((size_t)(s->side / 2 + 1) * sizeof *s->shape);
    if (!s->spread || !s->sum || !s->shape) {
        return bst_fail(ctx, BST_ERR_MEMORY,
                        "no memory for the reference image's spectrum on %d x %d places", s->fine,
                        s->fine);
    }
    BST_TRY(bst_fft_create_f64(ctx, BST_FFT_FORWARD, s->fine, s->fine, *s->spread, *s->spread,
                               &s->forward));
    BST_TRY(bst_fft_create_f64(ctx, BST_FFT_INVERSE, s->side, s->side, *s->sum, *s->sum, &s->back));
    memset(s->sum, 0, side * sizeof *s->sum);
    for (int k = 0; k <= s->side / 2; k++) {
        s->shape[k] = bump_transform(s, k);
    }
    return BST_OK;
}

/* Position of the source at a quadrature point, and its share of the interval's light. */
typedef struct instant {
    double x, y, light;
    bool there;
} instant;

/* Spreads a point of light on the grid; points beyond the margin are skipped. */
static void spread_point(spectrum *s, const instant *p, double light) {
    double x = p->x - s->window.x0, y = p->y - s->window.y0, share = 0.0, weight[4];
    int node[4], n = s->fine, nodes = bst_psf_weights(s->psf, p->x, p->y, node, weight);
    if (!(x >= -s->margin && x <= s->window.width + s->margin && y >= -s->margin &&
          y <= s->window.height + s->margin)) {
        return;
    }
    int fields = bst_psf_nodes(s->psf) / bst_psf_spectra(s->psf);
    for (int k = 0; k < nodes; k++) {
        share += node[k] == s->node % fields ? weight[k] : 0.0;
    }
    if (share == 0.0) {
        return;
    }
    double turn = -2.0 * BST_PI * (s->shift[0] * x + s->shift[1] * y);
    double re = share * light * cos(turn), im = share * light * sin(turn);
    double u = x * n / s->side, v = y * n / s->side;
    int first_x = (int)ceil(u - 0.5 * SPREAD), first_y = (int)ceil(v - 0.5 * SPREAD);
    double along_x[SPREAD];
    int column[SPREAD];
    for (int k = 0; k < SPREAD; k++) {
        along_x[k] = bump(s->beta, (first_x + k - u) * 2.0 / SPREAD);
        column[k] = ((first_x + k) % n + n) % n;
    }
    for (int j = 0; j < SPREAD; j++) {
        double b = bump(s->beta, (first_y + j - v) * 2.0 / SPREAD);
        bst_fft_complex_f64 *row = s->spread + (size_t)(((first_y + j) % n + n) % n) * (size_t)n;
        for (int k = 0; k < SPREAD; k++) {
            row[column[k]][0] += re * b * along_x[k];
            row[column[k]][1] += im * b * along_x[k];
        }
    }
}

static void place_rule(const spectrum *s, const time_rule *rule, const bst_scene_source *source,
                       int k, double u0, double u1, instant p[POINTS]) {
    for (int i = 0; i < rule->count; i++) {
        double u = u0 + rule->place[i] * (u1 - u0);
        p[i] = (instant){0};
        p[i].there =
            bst_reference_place(s->camera, s->track, source, k, u, &p[i].x, &p[i].y, &p[i].light);
        p[i].light *= rule->weight[i] * (u1 - u0);
    }
}

/* Sides of the margin (bits) beyond which all points lie; points behind the camera count for any.
 */
static unsigned sides_of(const spectrum *s, const instant *p, int count) {
    const bst_window *w = &s->window;
    unsigned sides = 15U;
    for (int i = 0; i < count; i++) {
        if (p[i].there) {
            sides &= (p[i].x < w->x0 - s->margin ? 1U : 0U) |
                     (p[i].x > w->x0 + w->width + s->margin ? 2U : 0U) |
                     (p[i].y < w->y0 - s->margin ? 4U : 0U) |
                     (p[i].y > w->y0 + w->height + s->margin ? 8U : 0U);
        }
    }
    return sides;
}

/* Adds the quadrature sum at trial frequency `trial`. */
static void try_rule(const spectrum *s, const instant *p, int count, int trial, double sign,
                     double sum[2]) {
    double angle = BST_PI * trial / TRIALS, c = s->cutoff * cos(angle), d = s->cutoff * sin(angle);
    for (int i = 0; i < count; i++) {
        double turn = 2.0 * BST_PI * (c * p[i].x + d * p[i].y);
        sum[0] += sign * p[i].light * cos(turn);
        sum[1] += sign * p[i].light * sin(turn);
    }
}

/* Adds the part [u0, u1] of an interval with `light` electrons at mean brightness. It is halved
 * until the two halves change nothing, or no more than a thousandth of the interval's part:
 * brightness may have kinks. */
static bst_status add_part(bst_ctx *ctx, spectrum *s, const bst_scene_source *source, int k,
                           double u0, double u1, double light, int depth) {
    const time_rule *rule = &rules[depth > 0];
    instant whole[POINTS] = {{0}}, half[2][POINTS] = {{{0}}};
    double middle = 0.5 * (u0 + u1), all = 0.0, worst = 0.0;
    int n = rule->count;
    place_rule(s, rule, source, k, u0, u1, whole);
    place_rule(s, rule, source, k, u0, middle, half[0]);
    place_rule(s, rule, source, k, middle, u1, half[1]);
    if (sides_of(s, whole, n) & sides_of(s, half[0], n) & sides_of(s, half[1], n)) {
        return BST_OK;
    }
    for (int i = 0; i < n; i++) {
        all += whole[i].light;
    }
    for (int trial = 0; trial < TRIALS; trial++) {
        double sum[2] = {0.0, 0.0};
        try_rule(s, whole, n, trial, 1.0, sum);
        try_rule(s, half[0], n, trial, -1.0, sum);
        try_rule(s, half[1], n, trial, -1.0, sum);
        worst = fmax(worst, hypot(sum[0], sum[1]));
    }
    /* positions come from unit vectors and are limited by their rounding */
    double rounding = 32.0 * 2.2e-16 * BST_PI * s->cutoff / bst_camera_scale_rad(s->camera);
    if (worst <= fmax(s->tolerance, rounding) * fmax(all, 1e-3)) {
        for (int i = 0; i < n; i++) {
            spread_point(s, &half[0][i], light * half[0][i].light);
            spread_point(s, &half[1][i], light * half[1][i].light);
        }
        return BST_OK;
    }
    if (depth >= DEEPEST) {
        return bst_fail(ctx, BST_ERR_NUMERIC, "the reference image of a source does not settle");
    }
    BST_TRY(add_part(ctx, s, source, k, u0, middle, light, depth + 1));
    return add_part(ctx, s, source, k, middle, u1, light, depth + 1);
}

static bst_status add_sources(bst_ctx *ctx, spectrum *s, const bst_scene_source *sources,
                              int count) {
    const bst_los_track *t = s->track;
    int spectra = bst_psf_spectra(s->psf), of = s->node * spectra / bst_psf_nodes(s->psf);
    for (int i = 0; i < count; i++) {
        double share = spectra > 1 ? bst_psf_share(sources[i].colour, of) : 1.0;
        for (int k = 0; k + 1 < t->count; k++) {
            double light = share * sources[i].electrons_per_s * (t->time_s[k + 1] - t->time_s[k]);
            if (!sources[i].occulted && light != 0.0) {
                BST_TRY(add_part(ctx, s, &sources[i], k, 0.0, 1.0, light, 0));
            }
        }
    }
    return BST_OK;
}

/* Adds the spectrum of the spread points times the OTF; `times` also counts mirrored frequencies.
 */
static void add_spectrum(spectrum *s, double times) {
    int reach = s->side / 2, n = s->fine;
    for (int ky = -reach; ky <= reach; ky++) {
        const bst_fft_complex_f64 *from = s->spread + (size_t)((ky + n) % n) * (size_t)n;
        bst_fft_complex_f64 *to = s->sum + (size_t)((ky + s->side) % s->side) * (size_t)s->side;
        double fy = (double)ky / s->side + s->shift[1];
        for (int kx = -reach; kx <= reach; kx++) {
            double fx = (double)kx / s->side + s->shift[0], h[2];
            if (fx * fx + fy * fy > s->cutoff * s->cutoff) {
                continue;
            }
            bst_psf_otf(s->psf, s->node, fx, fy, h);
            const double *v = from[(kx + n) % n];
            double scale = times / (s->shape[abs(kx)] * s->shape[abs(ky)]);
            double *sum = to[(kx + s->side) % s->side];
            sum[0] += scale * (h[0] * v[0] - h[1] * v[1]);
            sum[1] += scale * (h[0] * v[1] + h[1] * v[0]);
        }
    }
}

static bst_status add_all(bst_ctx *ctx, spectrum *s, const bst_scene_source *sources, int count) {
    int most = (int)ceil(s->cutoff - 0.5);
    for (s->node = 0; s->node < bst_psf_nodes(s->psf); s->node++) {
        /* half of the integer shifts; the others are their mirror images */
        for (int ay = 0; ay <= most; ay++) {
            for (int ax = ay > 0 ? -most : 0; ax <= most; ax++) {
                double nearest = hypot(fmax(abs(ax) - 0.5, 0.0), fmax(ay - 0.5, 0.0));
                if (nearest > s->cutoff) {
                    continue;
                }
                s->shift[0] = ax;
                s->shift[1] = ay;
                memset(s->spread, 0, (size_t)s->fine * (size_t)s->fine * sizeof *s->spread);
                BST_TRY(add_sources(ctx, s, sources, count));
                bst_fft_run(s->forward);
                add_spectrum(s, ax == 0 && ay == 0 ? 1.0 : 2.0);
            }
        }
    }
    return BST_OK;
}

bst_status bst_reference_spectrum(bst_ctx *ctx, const bst_camera *camera, const bst_psf *psf,
                                  bst_window window, const bst_los_track *track,
                                  const bst_scene_source *sources, int count, double tolerance,
                                  double *image) {
    spectrum s = {.camera = camera,
                  .psf = psf,
                  .window = window,
                  .track = track,
                  .tolerance = tolerance,
                  .cutoff = bst_psf_cutoff(psf),
                  .margin = (int)fmin(
                      fmax(ceil(bst_psf_reach_px(psf, fmax(tolerance, 1e-9))), 16.0), 1024.0)};
    bst_status status = spectrum_create(ctx, &s);
    if (status == BST_OK) {
        status = add_all(ctx, &s, sources, count);
    }
    if (status == BST_OK) {
        bst_fft_run(s.back);
        double scale = 1.0 / ((double)s.side * s.side);
        for (int j = 0; j < window.height; j++) {
            for (int i = 0; i < window.width; i++) {
                image[(size_t)j * (size_t)window.width + (size_t)i] +=
                    scale * s.sum[(size_t)j * (size_t)s.side + (size_t)i][0];
            }
        }
    }
    spectrum_free(&s);
    return status;
}
