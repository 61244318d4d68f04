#include "sim/analysis/camera/effective_psf.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "boresight/vec.h"
#include "sim/core/cholesky.h"

enum { OVER = BST_EFFECTIVE_PSF_OVERSAMPLING, PARTS = BST_EFFECTIVE_PSF_PARTS };
enum { MOST_NODES = BST_EFFECTIVE_PSF_NODES * BST_EFFECTIVE_PSF_NODES };
/* Iterations of all stars, and of each part left out, which begin with the PSF of all. */
enum { ITERATIONS = 60, PART_ITERATIONS = 5, STAR_VALUES = 3 };
enum { LEAST_STARS = 10 };
enum { MOST_HALF = 12 }; /* of the smoothing's windows, samples */
/* The PSF has settled when its samples change by less than this share of its peak. At 1e-3 fine
 * structure was still on its way, and the samples within 1 px of the middle scattered 1.7 times as
 * much as settled ones (docs/results/camera.md). */
static const double SETTLED = 1e-4;
/* Errors of the form, as a share of the light: at first, and at least. */
static const double FIRST_FORM = 0.1, LEAST_FORM = 1e-3;
/* Pixels this far off, and steps of a place this long, are not used. */
static const double CLIP = 5.0, MOST_STEP_PX = 0.3, MOST_OFF_PX = 1.5;
/* Light within this radius gives the middle and the error of the form. */
static const double CORE_PX = 3.0;
/* A node without stars nearby has no PSF: sum of the stars' shares of it. */
static const double LEAST_SHARE = 3.0;
/* Corrections are taken so many times: the residuals of a sample are averages over its
 * neighbourhood, in which fine structure is less. */
static const double RELAXATION = 1.6;
/* Standard deviation of a sample that is expected without any star. */
static const double PRIOR = 0.01;

/* Place, light and level of a star. */
typedef struct place {
    double x, y, light, level;
    bool used;
} place;

/* What a fit works on. */
typedef struct fit {
    const bst_effective_psf_star *stars;
    place *places;
    int count, nodes, columns, rows, half, stamp, side;
    size_t samples;                   /* of a plane */
    double *value;                    /* [nodes][side][side] */
    double *mixed, *smooth, *scratch; /* [side][side] */
    double *normal;                   /* [samples][nodes (nodes + 1) / 2 + nodes] */
    double form;
} fit;

/* Weights of cubic convolution (Keys 1981, a = -1/2) of the samples -1 to 2 at t, and their
 * derivatives. */
static void cubic(double t, double w[4], double d[4]) {
    w[0] = 0.5 * t * (-1.0 + t * (2.0 - t));
    w[1] = 1.0 + 0.5 * t * t * (-5.0 + 3.0 * t);
    w[2] = 0.5 * t * (1.0 + t * (4.0 - 3.0 * t));
    w[3] = 0.5 * t * t * (t - 1.0);
    d[0] = 0.5 * (-1.0 + t * (4.0 - 3.0 * t));
    d[1] = 0.5 * t * (-10.0 + 9.0 * t);
    d[2] = 0.5 * (1.0 + t * (8.0 - 9.0 * t));
    d[3] = 0.5 * t * (3.0 * t - 2.0);
}

/* Value of a plane and its gradient per pixel (g; NULL: not wanted) at an offset from the middle; 0
 * outside. */
static double value_at(const double *plane, int side, double dx_px, double dy_px, double g[2]) {
    double u = dx_px * OVER + 0.5 * (side - 1), v = dy_px * OVER + 0.5 * (side - 1);
    double wx[4], wy[4], sx[4], sy[4], sum = 0.0;
    int i = (int)floor(u), j = (int)floor(v);
    if (g) {
        g[0] = g[1] = 0.0;
    }
    if (i < 1 || j < 1 || i + 2 >= side || j + 2 >= side) {
        return 0.0;
    }
    cubic(u - i, wx, sx);
    cubic(v - j, wy, sy);
    for (int b = 0; b < 4; b++) {
        const double *row = &plane[(size_t)(j - 1 + b) * (size_t)side + (size_t)(i - 1)];
        double along = 0.0, slope = 0.0;
        for (int a = 0; a < 4; a++) {
            along += wx[a] * row[a];
            slope += g ? sx[a] * row[a] : 0.0;
        }
        sum += wy[b] * along;
        if (g) {
            g[0] += OVER * wy[b] * slope;
            g[1] += OVER * sy[b] * along;
        }
    }
    return sum;
}

/* Bilinear shares of the nodes at a star's place in the field. */
static void shares_of(const fit *f, const bst_effective_psf_star *s, double share[MOST_NODES]) {
    double x = fmin(fmax(s->field_x, 0.0), 1.0) * (f->columns - 1),
           y = fmin(fmax(s->field_y, 0.0), 1.0) * (f->rows - 1);
    for (int j = 0; j < f->rows; j++) {
        for (int i = 0; i < f->columns; i++) {
            share[j * f->columns + i] = fmax(1.0 - fabs(x - i), 0.0) * fmax(1.0 - fabs(y - j), 0.0);
        }
    }
}

static void mix(fit *f, const double share[MOST_NODES]) {
    memset(f->mixed, 0, f->samples * sizeof *f->mixed);
    for (int n = 0; n < f->nodes; n++) {
        if (share[n] > 0.0) {
            const double *plane = f->value + (size_t)n * f->samples;
            const double w = share[n];
            double *restrict mixed = f->mixed;
            for (size_t k = 0; k < f->samples; k++) {
                mixed[k] += w * plane[k];
            }
        }
    }
}

/* Variance of a pixel with so much light of the star. */
static double variance_of(const fit *f, const bst_effective_psf_star *s, double light) {
    return s->noise_e * s->noise_e + fmax(light, 0.0) + f->form * f->form * light * light;
}

/* First level and light: mean of the stamp's border, and what lies above it within the core. */
static void begin_star(const fit *f, int index) {
    const bst_effective_psf_star *s = &f->stars[index];
    place *p = &f->places[index];
    double border = 0.0, in = 0.0, light = 0.0;
    const int last = f->stamp - 1;
    *p = (place){.x = s->x_px, .y = s->y_px};
    for (int pass = 0; pass < 2; pass++) {
        for (int k = 0; k < f->stamp * f->stamp; k++) {
            int i = k % f->stamp, j = k / f->stamp;
            double v = (double)s->pixels[k], r = hypot(i - f->half - p->x, j - f->half - p->y);
            if (isnan(v)) {
                continue;
            }
            if (pass == 0 && (i == 0 || j == 0 || i == last || j == last)) {
                border += v;
                in += 1.0;
            }
            light += pass == 1 && r < 2.0 * CORE_PX ? v - p->level : 0.0;
        }
        p->level = in > 0.0 ? border / in : 0.0;
    }
    p->light = light;
    p->used = light > 10.0 * s->noise_e;
}

/* Fits place, light and level of a star by its mixed PSF: some steps of Gauss and Newton. */
static void fit_star(const fit *f, int index, int steps) {
    const bst_effective_psf_star *s = &f->stars[index];
    place *p = &f->places[index];
    for (int step = 0; step < steps && p->used; step++) {
        double a[16] = {0}, b[4] = {0}, g[2];
        for (int k = 0; k < f->stamp * f->stamp; k++) {
            double dx = k % f->stamp - f->half - p->x, dy = k / f->stamp - f->half - p->y;
            double e = value_at(f->mixed, f->side, dx, dy, g);
            double left = (double)s->pixels[k] - p->level - p->light * e;
            double variance = variance_of(f, s, p->light * e);
            if (!(left * left < CLIP * CLIP * variance)) {
                continue;
            }
            const double by[4] = {-p->light * g[0], -p->light * g[1], e, 1.0};
            for (int i = 0; i < 4; i++) {
                b[i] += by[i] * left / variance;
                for (int j = 0; j <= i; j++) {
                    a[4 * i + j] += by[i] * by[j] / variance;
                }
            }
        }
        if (!bst_cholesky_factor(a, 4, 4, 1e-12)) {
            p->used = false;
            break;
        }
        bst_cholesky_solve(a, 4, 4, b);
        p->x += fmin(fmax(b[0], -MOST_STEP_PX), MOST_STEP_PX);
        p->y += fmin(fmax(b[1], -MOST_STEP_PX), MOST_STEP_PX);
        p->light += b[2];
        p->level += b[3];
        p->used =
            hypot(p->x - s->x_px, p->y - s->y_px) < MOST_OFF_PX && p->light > 10.0 * s->noise_e;
    }
}

/* Adds a pixel's residual to the normal equations of the four samples about it. */
static void add_residual(fit *f, const double share[MOST_NODES], double dx, double dy, double value,
                         double weight) {
    const int n = f->nodes, size = n * (n + 1) / 2 + n;
    double u = dx * OVER + 0.5 * (f->side - 1), v = dy * OVER + 0.5 * (f->side - 1);
    int i = (int)floor(u), j = (int)floor(v);
    if (i < 0 || j < 0 || i + 1 >= f->side || j + 1 >= f->side) {
        return;
    }
    for (int c = 0; c < 4; c++) {
        double near = (c % 2 ? u - i : 1.0 - (u - i)) * (c / 2 ? v - j : 1.0 - (v - j));
        double w = weight * near;
        double *at = &f->normal[((size_t)(j + c / 2) * (size_t)f->side + (size_t)(i + c % 2)) *
                                (size_t)size];
        for (int a = 0, m = 0; a < n; a++) {
            for (int b = 0; b <= a; b++, m++) {
                at[m] += w * share[a] * share[b];
            }
            at[n * (n + 1) / 2 + a] += w * share[a] * value;
        }
    }
}

/* Fits the stars and gathers what is left of their pixels.
 *
 * Given:     without      part that is left out; -1: none
 *            first        places stay
 *            steps        of the fit of each star
 * Returned:  chi_squared  of a pixel of a star's core; form_error  its error beyond the noise */
static void gather(fit *f, int without, bool first, int steps, double *chi_squared,
                   double *form_error) {
    double chi2 = 0.0, pixels = 0.0, excess = 0.0, light2 = 0.0, share[MOST_NODES];
    memset(f->normal, 0,
           f->samples * (size_t)(f->nodes * (f->nodes + 1) / 2 + f->nodes) * sizeof *f->normal);
    for (int i = 0; i < f->count; i++) {
        const bst_effective_psf_star *s = &f->stars[i];
        const place *p = &f->places[i];
        if (s->part == without) {
            continue;
        }
        shares_of(f, s, share);
        mix(f, share);
        if (!first) {
            fit_star(f, i, steps);
        }
        pixels -= p->used ? STAR_VALUES : 0.0;
        for (int k = 0; k < f->stamp * f->stamp && p->used; k++) {
            double dx = k % f->stamp - f->half - p->x, dy = k / f->stamp - f->half - p->y;
            double e = value_at(f->mixed, f->side, dx, dy, NULL), light = p->light * e;
            double left = (double)s->pixels[k] - p->level - light;
            double variance = variance_of(f, s, first ? (double)s->pixels[k] - p->level : light);
            if (!(left * left < CLIP * CLIP * variance) && !(first && isfinite(left))) {
                continue;
            }
            add_residual(f, share, dx, dy, left / p->light, p->light * p->light / variance);
            if (dx * dx + dy * dy < CORE_PX * CORE_PX) {
                double noise2 = s->noise_e * s->noise_e + fmax(light, 0.0);
                chi2 += left * left / noise2;
                pixels += 1.0;
                excess += left * left - noise2;
                light2 += light * light;
            }
        }
    }
    *chi_squared = pixels > 0.0 ? chi2 / pixels : NAN;
    *form_error = light2 > 0.0 ? sqrt(fmax(excess, 0.0) / light2) : FIRST_FORM;
}

/* Corrects the samples of all nodes by the normal equations. */
static void correct(fit *f) {
    const int n = f->nodes, triangle = n * (n + 1) / 2;
    double a[MOST_NODES * MOST_NODES], b[MOST_NODES];
    for (size_t k = 0; k < f->samples; k++) {
        const double *from = &f->normal[k * (size_t)(triangle + n)];
        for (int i = 0, m = 0; i < n; i++) {
            for (int j = 0; j <= i; j++, m++) {
                a[i * n + j] = from[m];
            }
            a[i * n + i] += 1.0 / (PRIOR * PRIOR);
            b[i] = from[triangle + i];
        }
        if (bst_cholesky_factor(a, n, n, 1e-14)) {
            bst_cholesky_solve(a, n, n, b);
            for (int i = 0; i < n; i++) {
                f->value[(size_t)i * f->samples + k] += RELAXATION * b[i];
            }
        }
    }
}

/* Weight of a local polynomial in a window of 2 h + 1 samples (Savitzky & Golay 1964, Anal. Chem.
 * 36, 1627): of degree 4 for h = 3, of degree 2 for others. */
static double polynomial_weight(int h, int k) {
    static const double quartic[] = {131.0, 75.0, -30.0, 5.0};
    if (h == 3) {
        return quartic[abs(k)] / 231.0;
    }
    return 3.0 * (3 * h * h + 3 * h - 1 - 5 * k * k) /
           ((2.0 * h + 1.0) * (4.0 * h * h + 4.0 * h - 3.0));
}

/* Filters a plane along both axes; samples outside repeat those of the border. */
static void filter(const fit *f, const double *plane, int h, double *out) {
    const int side = f->side;
    double weights[2 * MOST_HALF + 1];
    assert(h <= MOST_HALF);
    for (int k = -h; k <= h; k++) {
        weights[k + h] = polynomial_weight(h, k);
    }
    for (int pass = 0; pass < 2; pass++) {
        const double *from = pass == 0 ? plane : f->scratch;
        double *to = pass == 0 ? f->scratch : out;
        for (int j = 0; j < side; j++) {
            for (int i = 0; i < side; i++) {
                double sum = 0.0;
                for (int k = -h; k <= h; k++) {
                    int at = (pass == 0 ? i : j) + k;
                    at = at < 0 ? 0 : at >= side ? side - 1 : at;
                    sum +=
                        weights[k + h] * (pass == 0 ? from[(size_t)j * (size_t)side + (size_t)at]
                                                    : from[(size_t)at * (size_t)side + (size_t)i]);
                }
                to[(size_t)j * (size_t)side + (size_t)i] = sum;
            }
        }
    }
}

static double radius_px(const fit *f, size_t k) {
    double middle = 0.5 * (f->side - 1);
    return hypot((double)(k % (size_t)f->side) - middle, (double)(k / (size_t)f->side) - middle) /
           OVER;
}

/* Smooths the planes, the more the further out. */
static void smooth(fit *f) {
    static const struct {
        int half;
        double from_px;
    } windows[] = {{3, 0.0}, {4, 4.0}, {8, 7.0}, {MOST_HALF, 11.0}};
    enum { WINDOWS = sizeof windows / sizeof *windows };
    for (int n = 0; n < f->nodes; n++) {
        double *plane = f->value + (size_t)n * f->samples;
        for (int w = WINDOWS - 1; w >= 0; w--) { /* the outer ones first: each has its own source */
            filter(f, plane, windows[w].half, f->smooth);
            double to_px = w + 1 < WINDOWS ? windows[w + 1].from_px : HUGE_VAL;
            for (size_t k = 0; k < f->samples; k++) {
                double r = radius_px(f, k);
                plane[k] = r >= windows[w].from_px && r < to_px ? f->smooth[k] : plane[k];
            }
        }
    }
}

/* Sets level, sum and middle of each plane. */
static void normalise(fit *f) {
    for (int n = 0; n < f->nodes; n++) {
        double *plane = f->value + (size_t)n * f->samples;
        double ring = 0.0, in = 0.0, sum = 0.0, core = 0.0, x = 0.0, y = 0.0;
        for (size_t k = 0; k < f->samples; k++) {
            double r = radius_px(f, k);
            ring += r > f->half - 1.0 && r <= f->half ? plane[k] : 0.0;
            in += r > f->half - 1.0 && r <= f->half ? 1.0 : 0.0;
        }
        for (size_t k = 0; k < f->samples; k++) {
            double r = radius_px(f, k);
            plane[k] = r <= f->half ? plane[k] - ring / in : 0.0;
            sum += plane[k];
            if (r <= CORE_PX) {
                core += plane[k];
                x += plane[k] * ((double)(k % (size_t)f->side) - 0.5 * (f->side - 1));
                y += plane[k] * ((double)(k / (size_t)f->side) - 0.5 * (f->side - 1));
            }
        }
        sum /= OVER * OVER;
        if (!(sum > 0.0) || !(core > 0.0)) {
            continue;
        }
        x /= core * OVER;
        y /= core * OVER;
        memcpy(f->smooth, plane, f->samples * sizeof *plane);
        for (size_t k = 0; k < f->samples; k++) {
            double dx = ((double)(k % (size_t)f->side) - 0.5 * (f->side - 1)) / OVER,
                   dy = ((double)(k / (size_t)f->side) - 0.5 * (f->side - 1)) / OVER;
            plane[k] = value_at(f->smooth, f->side, dx + x, dy + y, NULL) / sum;
        }
    }
}

/* Iterates until the PSF has settled; returns the iterations. */
static int iterate(fit *f, int without, int most, bool first, bst_effective_psf *out) {
    int done = 0;
    for (bool settled = false; done < most && !settled; done++) {
        double form, change = 0.0, peak = 0.0;
        double *before = f->value + (size_t)f->nodes * f->samples; /* room behind the planes */
        memcpy(before, f->value, (size_t)f->nodes * f->samples * sizeof *before);
        gather(f, without, first && done == 0, first && done < 3 ? 3 : 1, &out->chi_squared, &form);
        f->form = fmin(fmax(form, LEAST_FORM), FIRST_FORM);
        correct(f);
        smooth(f);
        normalise(f);
        for (size_t k = 0; k < (size_t)f->nodes * f->samples; k++) {
            change = fmax(change, fabs(f->value[k] - before[k]));
            peak = fmax(peak, f->value[k]);
        }
        settled = first && change < SETTLED * peak;
    }
    return done;
}

/* Stars that are used, and their shares of each node. */
static bst_status check_stars(bst_ctx *ctx, const fit *f, bst_effective_psf *out) {
    double all[MOST_NODES] = {0}, share[MOST_NODES];
    out->stars = 0;
    for (int i = 0; i < f->count; i++) {
        out->stars += f->places[i].used;
        shares_of(f, &f->stars[i], share);
        for (int n = 0; n < f->nodes && f->places[i].used; n++) {
            all[n] += share[n];
        }
    }
    if (out->stars < LEAST_STARS * f->nodes) {
        return bst_fail(ctx, BST_ERR_RANGE,
                        "%d stars are too few for a PSF at %d places of the field (allowed: at "
                        "least %d a place)",
                        out->stars, f->nodes, LEAST_STARS);
    }
    for (int n = 0; n < f->nodes; n++) {
        if (all[n] < LEAST_SHARE) {
            return bst_fail(ctx, BST_ERR_RANGE,
                            "too few stars are near the node of the field in column %d, row %d "
                            "(from 0); use fewer columns and rows",
                            n % f->columns, n / f->columns);
        }
    }
    return BST_OK;
}

static bst_status allocate(bst_ctx *ctx, fit *f, bst_effective_psf *out) {
    const size_t all = (size_t)f->nodes * f->samples;
    const size_t size = (size_t)(f->nodes * (f->nodes + 1) / 2 + f->nodes);
    f->places = calloc((size_t)f->count + 1, sizeof *f->places);
    f->value = calloc(2 * all, sizeof *f->value);
    f->mixed = calloc(3 * f->samples, sizeof *f->mixed);
    f->normal = calloc(f->samples * size, sizeof *f->normal);
    out->value = calloc(all, sizeof *out->value);
    out->without = calloc((size_t)PARTS * all, sizeof *out->without);
    if (!f->places || !f->value || !f->mixed || !f->normal || !out->value || !out->without) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for a PSF of %d x %d samples at %d nodes",
                        f->side, f->side, f->nodes);
    }
    f->smooth = f->mixed + f->samples;
    f->scratch = f->smooth + f->samples;
    return BST_OK;
}

/* Fits all stars, then without one part after the other. */
static bst_status fit_all(bst_ctx *ctx, fit *f, bst_effective_psf *out) {
    const size_t all = (size_t)f->nodes * f->samples;
    for (int i = 0; i < f->count; i++) {
        begin_star(f, i);
    }
    f->form = FIRST_FORM;
    BST_TRY(check_stars(ctx, f, out));
    out->iterations = iterate(f, -1, ITERATIONS, true, out);
    BST_TRY(check_stars(ctx, f, out));
    memcpy(out->value, f->value, all * sizeof *out->value);
    out->form_error = f->form;
    const double chi_squared = out->chi_squared;
    place *places = malloc(((size_t)f->count + 1) * sizeof *places);
    if (!places) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for %d stars", f->count);
    }
    memcpy(places, f->places, (size_t)f->count * sizeof *places);
    for (int part = 0; part < PARTS; part++) {
        memcpy(f->value, out->value, all * sizeof *f->value);
        memcpy(f->places, places, (size_t)f->count * sizeof *places);
        iterate(f, part, PART_ITERATIONS, false, out);
        memcpy(out->without + (size_t)part * all, f->value, all * sizeof *f->value);
    }
    free(places);
    out->chi_squared = chi_squared;
    return BST_OK;
}

bst_status bst_effective_psf_fit(bst_ctx *ctx, const bst_effective_psf_star *stars, int count,
                                 const bst_effective_psf_options *o, bst_effective_psf *out) {
    assert((stars || count == 0) && count >= 0 && o && out);
    assert(o->columns >= 1 && o->columns <= BST_EFFECTIVE_PSF_NODES && o->rows >= 1 &&
           o->rows <= BST_EFFECTIVE_PSF_NODES && o->half_px >= 6 && o->half_px <= 64);
    *out = (bst_effective_psf){.options = *o, .side = 2 * o->half_px * OVER + 1};
    fit f = {.stars = stars,
             .count = count,
             .nodes = o->columns * o->rows,
             .columns = o->columns,
             .rows = o->rows,
             .half = o->half_px,
             .stamp = 2 * o->half_px + 1,
             .side = out->side,
             .samples = (size_t)out->side * (size_t)out->side};
    bst_status status = allocate(ctx, &f, out);
    if (status == BST_OK) {
        status = fit_all(ctx, &f, out);
    }
    free(f.places);
    free(f.value);
    free(f.mixed);
    free(f.normal);
    if (status != BST_OK) {
        bst_effective_psf_free(out);
    }
    return status;
}

void bst_effective_psf_free(bst_effective_psf *psf) {
    free(psf->value);
    free(psf->without);
    psf->value = psf->without = NULL;
}
