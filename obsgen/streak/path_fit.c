#include "obsgen/streak/path_fit.h"

#include <assert.h>
#include <math.h>

#include "boresight/vec.h"
#include "sim/core/cholesky.h"
#include "sim/core/simd.h"

enum {
    SAMPLES = 64, /* of a path that is not longer than as many steps */
    MODEL = 48,   /* of a streak model */
    LIGHTS = 256, /* of several streaks or a long path */
    COLUMNS = BST_PATH_COLUMNS,
    ROWS = BST_PATH_ROWS,
    PARAMETERS = 4,
    ROUNDS = 12
};

/* Margin of the grid about the streak model, and its greatest step, sigmas: at one sigma, sums of
 * products of two Gaussians are their integrals to 1e-4. */
static const double MARGIN_SIGMAS = 4.0, STEP_SIGMAS = 1.0;
/* Step about a saturated point relative to others, for the edge of the saturated pixels. */
static const double SATURATED_STEP = 0.3;
/* Least margin of the pixels on which a point is fitted (imgproc/measure/deblend.c). */
static const double LEAST_MARGIN_PX = 3.5;
/* A longer streak's fit is on a grid along it: one along the frame's axes would have wide steps. */
static const double LONG_SIGMAS = 20.0;
/* Limits of the fitted widening relative to the PSF's variance (imgproc/measure/fit.c). */
static const double LEAST_WIDENING = -0.6, MOST_WIDENING = 1.8;
/* About a maximum of the streak filter, image processing looks so far on each axis for one of the
 * point filter (imgproc/measure/locate.c). */
static const double BESIDE_PX = 2.0;
/* Largest and smallest step of a fit, px. */
static const double MOST_STEP_PX = 0.7, SETTLED_PX = 1e-3;

typedef struct samples {
    double x[LIGHTS], y[LIGHTS], weight[LIGHTS]; /* weight: share of the exposure */
    int count;
    double spread; /* mean variance of the path about its samples, per axis, px^2 */
} samples;

/* Turns samples into the axes along and across a direction. */
static void turn(samples *s, double cosine, double sine) {
    for (int i = 0; i < s->count; i++) {
        double x = s->x[i];
        s->x[i] = x * cosine + s->y[i] * sine;
        s->y[i] = s->y[i] * cosine - x * sine;
    }
}

/* Least and greatest coordinates of places. */
static void find_box(const double *x, const double *y, int count, double low[2], double high[2]) {
    low[0] = low[1] = INFINITY;
    high[0] = high[1] = -INFINITY;
    for (int k = 0; k < count; k++) {
        low[0] = fmin(low[0], x[k]);
        high[0] = fmax(high[0], x[k]);
        low[1] = fmin(low[1], y[k]);
        high[1] = fmax(high[1], y[k]);
    }
}

/* Distance over which a path goes on the whole: jitter is not counted. */
static double extent_of(const bst_star_trail_path *p) {
    double low[2], high[2];
    find_box(p->x_px, p->y_px, p->count, low, high);
    return hypot(high[0] - low[0], high[1] - low[1]);
}

/* Averages the path over equal parts of the exposure: SAMPLES, or as many as make steps of `step`,
 * at most LIGHTS. Faster jitter is in the spread. */
static void sample_path(const bst_star_trail_path *p, double step, samples *out) {
    int parts = (int)fmin(fmax(ceil(extent_of(p) / step), SAMPLES), LIGHTS);
    out->count = p->count < parts ? p->count : parts;
    double squares = 0.0;
    for (int i = 0; i < out->count; i++) {
        out->x[i] = out->y[i] = out->weight[i] = 0.0;
    }
    for (int k = 0; k < p->count; k++) {
        int i = (int)((long)k * out->count / p->count);
        double w = (k == 0 || k == p->count - 1 ? 0.5 : 1.0) / (p->count - 1);
        out->x[i] += w * p->x_px[k];
        out->y[i] += w * p->y_px[k];
        out->weight[i] += w;
        squares += w * (p->x_px[k] * p->x_px[k] + p->y_px[k] * p->y_px[k]);
    }
    for (int i = 0; i < out->count; i++) {
        out->x[i] /= out->weight[i];
        out->y[i] /= out->weight[i];
        squares -= out->weight[i] * (out->x[i] * out->x[i] + out->y[i] * out->y[i]);
    }
    out->spread = fmax(0.5 * squares, 0.0);
}

/* Positions of the streak model about its mean. */
static void sample_model(const bst_streak_model *m, samples *out) {
    double length = hypot(m->path.dx, m->path.dy) + 2.0 * hypot(m->bend.dx, m->bend.dy);
    out->count = (int)fmin(ceil(1.5 * length / m->sigma_px) + 1.0, MODEL);
    for (int i = 0; i < out->count; i++) {
        double u = out->count > 1 ? (i + 0.5) / out->count * 2.0 - 1.0 : 0.0;
        double bent = out->count > 1 ? 0.5 * (3.0 * u * u - 1.0) : 0.0;
        out->x[i] = 0.5 * u * m->path.dx + bent * m->bend.dx;
        out->y[i] = 0.5 * u * m->path.dy + bent * m->bend.dy;
        out->weight[i] = 1.0 / out->count;
    }
}

/* Grid of places about a fitted streak. */
typedef struct grid {
    double x0, y0, step;
    int columns, rows;
} grid;

/* Covers the model with a margin; image processing fits no other pixels. */
static grid grid_about(const samples *model, double sigma, double margin) {
    double low[2], high[2];
    find_box(model->x, model->y, model->count, low, high);
    double wide = high[0] - low[0], tall = high[1] - low[1];
    double step = fmax(STEP_SIGMAS * sigma, fmax((wide + 2.0 * margin) / (COLUMNS - 1),
                                                 (tall + 2.0 * margin) / (ROWS - 1)));
    int columns = (int)((wide + 2.0 * margin) / step) + 1;
    int rows = (int)((tall + 2.0 * margin) / step) + 1;
    /* about the middle: the fit is the same whichever way the frame is turned */
    return (grid){0.5 * (low[0] + high[0] - step * (columns - 1)),
                  0.5 * (low[1] + high[1] - step * (rows - 1)), step, columns, rows};
}

/* Light of a model on the grid and its derivatives by x, by y and by variance. */
typedef struct planes {
    double value[4][BST_PATH_PIXELS];
    double full; /* pixels on which more light is seen are left out of the fit */
} planes;

/* Adds Gaussians at all samples, displaced by (dx, dy); the derivatives too if `all`. */
BST_CLONES_256
static void render(const grid *g, const samples *s, double dx, double dy, double sigma, bool all,
                   double (*value)[BST_PATH_PIXELS]) {
    int n = g->columns * g->rows;
    double v = sigma * sigma, across[3][COLUMNS], down[3][ROWS];
    for (int k = 0; k < (all ? 4 : 1); k++) {
        for (int i = 0; i < n; i++) {
            value[k][i] = 0.0;
        }
    }
    for (int i = 0; i < s->count; i++) {
        for (int c = 0; c < g->columns; c++) {
            double x = g->x0 + c * g->step - s->x[i] - dx, e = exp(-0.5 * x * x / v);
            across[0][c] = s->weight[i] * e;
            across[1][c] = s->weight[i] * e * x / v;
            across[2][c] = s->weight[i] * e * (x * x / v - 1.0) / v;
        }
        for (int r = 0; r < g->rows; r++) {
            double y = g->y0 + r * g->step - s->y[i] - dy, e = exp(-0.5 * y * y / v);
            down[0][r] = e;
            down[1][r] = e * y / v;
            down[2][r] = e * (y * y / v - 1.0) / v;
        }
        for (int r = 0; r < g->rows; r++) {
            for (int c = 0; c < g->columns; c++) {
                int at = r * g->columns + c;
                value[0][at] += down[0][r] * across[0][c];
                if (all) {
                    value[1][at] += down[0][r] * across[1][c];
                    value[2][at] += down[1][r] * across[0][c];
                    value[3][at] += 0.5 * (down[2][r] * across[0][c] + down[0][r] * across[2][c]);
                }
            }
        }
    }
}

/* Fitted parameters: place, flux relative to the true one, widening of the variance, px^2. */
typedef struct fitted {
    double x, y, flux, widening;
} fitted;

/* One Gauss-Newton step; *squares are those before it. False if the place is settled. */
static bool improve(const double *seen, const planes *model, int n, double light, double variance,
                    fitted *f, bst_path_fit_squares *squares) {
    double a[PARAMETERS][PARAMETERS] = {{0.0}}, g[PARAMETERS] = {0.0}, top = 0.0;
    for (int i = 0; i < n; i++) {
        top = fmax(top, model->value[0][i]);
    }
    *squares = (bst_path_fit_squares){0.0, 0.0, 0.0};
    for (int i = 0; i < n; i++) {
        double shape = model->value[0][i] + f->widening * model->value[3][i];
        const double by[PARAMETERS] = {f->flux * model->value[1][i], f->flux * model->value[2][i],
                                       shape, f->flux * model->value[3][i]};
        double left = seen[i] - f->flux * shape;
        double weight =
            seen[i] > model->full ? 0.0 : 1.0 / (1.0 + light * fmax(f->flux * shape, 0.0) / top);
        squares->all += weight * seen[i] * seen[i];
        squares->left += weight * left * left;
        for (int p = 0; p < PARAMETERS; p++) {
            g[p] += weight * by[p] * left;
            for (int q = 0; q <= p; q++) {
                a[p][q] += weight * by[p] * by[q];
            }
        }
    }
    if (!bst_cholesky_factor(a[0], PARAMETERS, PARAMETERS, 1e-11)) {
        return false;
    }
    bst_cholesky_solve(a[0], PARAMETERS, PARAMETERS, g);
    f->x += fmin(fmax(g[0], -MOST_STEP_PX), MOST_STEP_PX);
    f->y += fmin(fmax(g[1], -MOST_STEP_PX), MOST_STEP_PX);
    /* as in imgproc/measure/fit.c */
    f->flux = fmax(f->flux + g[2], 0.1 * f->flux);
    f->widening =
        fmin(fmax(f->widening + g[3], LEAST_WIDENING * variance), MOST_WIDENING * variance);
    return fabs(g[0]) > SETTLED_PX || fabs(g[1]) > SETTLED_PX;
}

/* Direction of a streak's path. */
static void direction_of(const bst_streak_model *m, double *cosine, double *sine) {
    double length = hypot(m->path.dx, m->path.dy);
    *cosine = length > 0.0 ? m->path.dx / length : 1.0;
    *sine = length > 0.0 ? m->path.dy / length : 0.0;
}

void bst_path_light_make(const bst_star_trail_path *path, double sigma_px,
                         const bst_streak_model *stamp, bst_path_light *out) {
    samples star, about;
    sample_path(path, sigma_px, &star);
    sample_model(stamp, &about);
    direction_of(stamp, &out->cosine, &out->sine);
    turn(&star, out->cosine, out->sine);
    turn(&about, out->cosine, out->sine);
    grid g = grid_about(&about, stamp->sigma_px, MARGIN_SIGMAS * stamp->sigma_px);
    double image = sqrt(sigma_px * sigma_px + star.spread);
    for (int i = 0; i < star.count; i++) { /* render() gives each Gaussian the peak of its weight */
        star.weight[i] *= sigma_px * sigma_px / (image * image);
    }
    render(&g, &star, 0.0, 0.0, image, false, &out->value);
    out->sigma_px = sigma_px;
    out->x0_px = g.x0;
    out->y0_px = g.y0;
    out->step_px = g.step;
    out->columns = g.columns;
    out->rows = g.rows;
}

bst_path_fit_squares bst_path_fit_light(const bst_path_light *star, const bst_streak_model *model,
                                        double light, double place_px[2]) {
    assert(star && model && model->sigma_px == star->sigma_px);
    bst_path_fit_squares squares = {0.0, 0.0, 0.0};
    samples streak;
    planes shape;
    const double c = star->cosine, s = star->sine, sigma = model->sigma_px;
    const grid g = {star->x0_px, star->y0_px, star->step_px, star->columns, star->rows};
    const int n = g.columns * g.rows;
    sample_model(model, &streak);
    turn(&streak, c, s);
    shape.full = model->saturated > 0.0 ? model->saturated : INFINITY;
    fitted f = {place_px[0] * c + place_px[1] * s, place_px[1] * c - place_px[0] * s, 1.0, 0.0};
    bool moving = true;
    for (int round = 0; round < ROUNDS && moving; round++) {
        render(&g, &streak, f.x, f.y, sigma, true, shape.value);
        moving = improve(star->value, &shape, n, light, sigma * sigma, &f, &squares);
    }
    place_px[0] = f.x * c - f.y * s;
    place_px[1] = f.x * s + f.y * c;
    squares.flux = f.flux;
    return squares;
}

bst_path_fit_squares bst_path_fit(const bst_star_trail_path *path, const bst_streak_model *model,
                                  double light, double place_px[2]) {
    bst_path_light star;
    bst_path_light_make(path, model->sigma_px, model, &star);
    return bst_path_fit_light(&star, model, light, place_px);
}

bst_path_point_fit bst_path_fit_points(const bst_path_point *points, int count, double image_px,
                                       double model_px, double light, double saturated) {
    static_assert((int)BST_PATH_POINTS == (int)SAMPLES, "a point is a sample");
    samples seen_at = {.count = count < SAMPLES ? count : SAMPLES};
    /* render() gives each Gaussian the peak of its weight */
    double peak = model_px * model_px / (image_px * image_px);
    fitted f = {0.0, 0.0, 0.0, 0.0};
    for (int i = 0; i < seen_at.count; i++) {
        seen_at.x[i] = points[i].x_px;
        seen_at.y[i] = points[i].y_px;
        seen_at.weight[i] = peak * points[i].flux;
        f.flux += points[i].flux;
    }
    const samples point = {.weight = {1.0}, .count = 1};
    planes shape;
    double seen[1][BST_PATH_PIXELS];
    bst_path_fit_squares squares;
    double margin = fmax(MARGIN_SIGMAS * model_px, LEAST_MARGIN_PX);
    grid g = grid_about(&point, saturated > 0.0 ? SATURATED_STEP * model_px : model_px, margin);
    int n = g.columns * g.rows;
    render(&g, &seen_at, 0.0, 0.0, image_px, false, seen);
    shape.full = saturated > 0.0 ? saturated : INFINITY;
    for (int round = 0; round < ROUNDS; round++) { /* the width settles after the place */
        render(&g, &point, f.x, f.y, model_px, true, shape.value);
        (void)improve(seen[0], &shape, n, light, model_px * model_px, &f, &squares);
    }
    return (bst_path_point_fit){f.x, f.y, f.flux, f.widening};
}

/* Adds a streak's light at points at most a sigma of the image apart, or `most` points. */
static void add_streak(const bst_path_streak *s, double image_px, double peak, int most,
                       samples *out) {
    int pieces = (int)fmin(ceil(1.5 * hypot(s->path.dx, s->path.dy) / image_px) + 1.0, most);
    for (int i = 0; i < pieces; i++) {
        double u = (i + 0.5) / pieces - 0.5;
        out->x[out->count] = s->x_px + u * s->path.dx;
        out->y[out->count] = s->y_px + u * s->path.dy;
        out->weight[out->count++] = peak * s->flux / pieces;
    }
}

bst_path_point_fit bst_path_fit_streaks(const bst_path_streak *streaks, int count, double image_px,
                                        const bst_streak_model *model, double light,
                                        double margin_px, double limit_px) {
    assert(streaks && count > 0 && count <= LIGHTS && model && image_px > 0.0 &&
           model->sigma_px > 0.0);
    const double sigma = model->sigma_px, length = hypot(model->path.dx, model->path.dy);
    /* pixels of images are those of the frame's axes; a long streak's margin is small beside it */
    bool turned = length > LONG_SIGMAS * sigma;
    const double c = turned ? model->path.dx / length : 1.0;
    const double s = turned ? model->path.dy / length : 0.0;
    const bst_streak_model straight = {.path = model->path, .sigma_px = sigma};
    samples seen_at = {.count = 0}, streak;
    fitted f = {0.0, 0.0, 0.0, 0.0};
    const int most = LIGHTS / count < MODEL ? LIGHTS / count : MODEL;
    for (int i = 0; i < count; i++) {
        /* render() gives each Gaussian the peak of its weight */
        add_streak(&streaks[i], image_px, sigma * sigma / (image_px * image_px), most, &seen_at);
        f.flux += streaks[i].flux;
    }
    sample_model(&straight, &streak);
    turn(&seen_at, c, s);
    turn(&streak, c, s);
    planes shape;
    double seen[1][BST_PATH_PIXELS];
    bst_path_fit_squares squares;
    grid g =
        grid_about(&streak, model->saturated > 0.0 ? SATURATED_STEP * sigma : sigma, margin_px);
    const int n = g.columns * g.rows;
    render(&g, &seen_at, 0.0, 0.0, image_px, false, seen);
    shape.full = model->saturated > 0.0 ? model->saturated : INFINITY;
    for (int round = 0; round < ROUNDS; round++) { /* the width settles after the place */
        render(&g, &streak, f.x, f.y, sigma, true, shape.value);
        (void)improve(seen[0], &shape, n, light, sigma * sigma, &f, &squares);
        f.x = fmin(fmax(f.x, -limit_px), limit_px);
        f.y = fmin(fmax(f.y, -limit_px), limit_px);
    }
    return (bst_path_point_fit){f.x * c - f.y * s, f.x * s + f.y * c, f.flux, f.widening};
}

/* Sum of the products of two sets of Gaussians whose product has the deviation `root`, the second
 * set displaced by (dx, dy). */
static double overlap(const samples *a, const samples *b, double dx, double dy, double root) {
    double sum = 0.0;
    for (int i = 0; i < a->count; i++) {
        for (int k = 0; k < b->count; k++) {
            double x = a->x[i] - b->x[k] - dx, y = a->y[i] - b->y[k] - dy;
            sum += a->weight[i] * b->weight[k] * exp(-0.5 * (x * x + y * y) / (root * root));
        }
    }
    return sum / (2.0 * BST_PI * root * root);
}

/* sqrt(sum p^2) of the star's image. */
static double image_norm(const samples *s, const bst_path_widths *w) {
    return sqrt(overlap(s, s, 0.0, 0.0, sqrt(2.0 * (w->source_px * w->source_px + s->spread))));
}

bst_path_outputs bst_path_fit_outputs(const bst_star_trail_path *path, bst_obsgen_path_px filter,
                                      const bst_path_widths *w) {
    samples s;
    sample_path(path, w->both_px, &s);
    double length = hypot(filter.dx, filter.dy);
    double root = sqrt(2.0 * w->both_px * w->both_px + s.spread);
    double far = length + 9.0 * root; /* beyond, there is no light */
    double c = length > 0.0 ? filter.dx / length : 1.0, n = length > 0.0 ? filter.dy / length : 0.0;
    double streak = 0.0, beside = 0.0, points[LIGHTS];
    int streak_at = 0;
    bst_path_outputs out = {.point = 0.0};
    for (int k = 0; k < s.count; k++) {
        double point = 0.0, drawn = 0.0;
        for (int i = 0; i < s.count; i++) {
            double dx = s.x[i] - s.x[k], dy = s.y[i] - s.y[k], d2 = dx * dx + dy * dy;
            if (d2 > far * far) {
                continue;
            }
            point += s.weight[i] * exp(-0.5 * d2 / (root * root));
            if (length > 0.0) {
                double u = dx * c + dy * n, v = dy * c - dx * n;
                drawn += s.weight[i] * exp(-0.5 * v * v / (root * root)) *
                         (bst_matched_normal_below((u + 0.5 * length) / root) -
                          bst_matched_normal_below((u - 0.5 * length) / root));
            }
        }
        if (point > out.point) {
            out.point = point;
            out.point_at[0] = s.x[k];
            out.point_at[1] = s.y[k];
            beside = drawn;
        }
        points[k] = point;
        if (drawn > streak) {
            streak = drawn;
            streak_at = k;
        }
    }
    for (int k = 0; k < s.count; k++) {
        if (fmax(fabs(s.x[k] - s.x[streak_at]), fabs(s.y[k] - s.y[streak_at])) <= BESIDE_PX) {
            out.point_beside = fmax(out.point_beside, points[k]);
        }
    }
    const bst_obsgen_path_px rest = {0.0, 0.0};
    double norm = image_norm(&s, w);
    double unit =
        2.0 * BST_PI * root * root * sqrt(bst_matched_product(rest, rest, w->filter_px)) * norm;
    out.point /= unit;
    out.point_beside /= unit;
    if (length > 0.0) {
        double scale = 1.0 / (sqrt(2.0 * BST_PI) * root * length *
                              sqrt(bst_matched_product(filter, filter, w->filter_px)) * norm);
        out.streak = scale * streak;
        out.streak_beside = scale * beside;
    }
    return out;
}
