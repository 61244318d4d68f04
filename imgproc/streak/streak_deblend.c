#include "imgproc/streak/streak_deblend.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "imgproc/value_of_rank.h"
#include "sim/core/symmetric.h"

/* CELL: side of the cells of the background, px. LEAST_CELL: values of a cell that has a median.
 * MOST_REACH: of the PSF, px. SAMPLED: pixels that tell
 * the noise. LEAST_ERRORS: pixels that tell the error of the model. */
enum {
    CELL = 64,
    LEAST_CELL = 100,
    MOST_REACH = 24,
    LEAST_ERRORS = 60,
    SHIFTS = 6,
    CLIP_PASSES = 3,
    SAMPLED = 65536
};

/* Extent of the PSF, sigma. */
static const double REACH_SIGMA = 3.5;
/* Pixels of a bright star's streak whose error of the model is the same: some px along times the
 * width. A design choice; a wrong path moves light across over such a length. */
static const double COHERENT = 25.0;
/* The error of the model is measured where it is brighter than this, in units of the noise; usual
 * error where no star is so bright, and the range of the measured one. */
static const double BRIGHT = 20.0, USUAL_ERROR = 0.05, LEAST_ERROR = 0.01, MOST_ERROR = 0.5;
/* Pixels with less light than this tell background and noise. */
static const double DARK = 1.0;
/* Least variance of a background pixel, in units of what it was before the stars were known. */
static const double LEAST_NOISE2 = 0.1;
/* Mean absolute value of a normal deviate up to CLIP sigma: sqrt(2 / pi) (1 - exp(-CLIP^2 / 2)) /
 * erf(CLIP / sqrt(2)). */
static const double CLIP = 2.5, CLIPPED_MEAN = 0.7724;
/* Median of chi squared with one degree of freedom: over it, a squared residual's median is the
 * variance. */
static const double MEDIAN_CHI2 = 0.455;
/* Largest step of a place in a sweep, px; standard deviation of the step that damps it. */
static const double MOST_STEP_PX = 1.5, STEP_SIGMA_PX = 2.0;

void bst_streak_deblend_free(bst_streak_deblend *d) {
    free(d->residual);
    free(d->stars);
    free(d->touched);
    *d = (bst_streak_deblend){.width = 0};
}

bst_status bst_streak_deblend_create(bst_ctx *ctx, const float *image,
                                     const bst_streak_deblend_config *config,
                                     bst_streak_deblend *out) {
    assert(image && config && config->width > 0 && config->height > 0 && config->path &&
           config->psf_sigma_px > 0.0 && config->shot >= 0.0 && config->room > 0 && out);
    const int width = config->width, height = config->height, room = config->room;
    const size_t n = (size_t)width * (size_t)height;
    *out = (bst_streak_deblend){.width = width,
                                .height = height,
                                .path = config->path,
                                .psf_sigma_px = config->psf_sigma_px,
                                .shot = config->shot,
                                .noise2 = 1.0,
                                .spread = 1.0,
                                .error = USUAL_ERROR,
                                .room = room};
    out->residual = calloc(7 * n, sizeof *out->residual);
    out->stars = calloc((size_t)room, sizeof *out->stars);
    out->touched = calloc(n, sizeof *out->touched);
    if (!out->residual || !out->stars || !out->touched) {
        bst_streak_deblend_free(out);
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the fit of %d x %d px", width,
                        height);
    }
    out->model = out->residual + n;
    out->weight = out->residual + 2 * n;
    out->image = out->residual + 3 * n;
    out->image_x = out->residual + 4 * n;
    out->image_y = out->residual + 5 * n;
    out->scratch = out->residual + 6 * n;
    for (size_t i = 0; i < n; i++) {
        out->residual[i] = isnan(image[i]) ? 0.0f : image[i];
        out->weight[i] = isnan(image[i]) ? 0.0f : 1.0f;
    }
    return BST_OK;
}

/* Clears the image of a star. */
static void clear_image(bst_streak_deblend *d) {
    for (int i = 0; i < d->touched_count; i++) {
        int at = d->touched[i];
        d->image[at] = d->image_x[at] = d->image_y[at] = 0.0f;
    }
    d->touched_count = 0;
}

/* Draws a sample of the path. */
static void draw_sample(bst_streak_deblend *d, double x, double y, double light) {
    const double s2 = d->psf_sigma_px * d->psf_sigma_px;
    const int reach = (int)fmin(ceil(REACH_SIGMA * d->psf_sigma_px), MOST_REACH);
    const int cx = (int)lround(x), cy = (int)lround(y);
    float along_x[2 * MOST_REACH + 1];
    for (int i = -reach; i <= reach; i++) {
        double u = cx + i - x;
        along_x[i + reach] = (float)exp(-0.5 * u * u / s2);
    }
    const int x0 = cx - reach > 0 ? cx - reach : 0;
    const int x1 = cx + reach < d->width - 1 ? cx + reach : d->width - 1;
    for (int j = cy - reach > 0 ? cy - reach : 0; j <= cy + reach && j < d->height; j++) {
        double v = j - y;
        float g = (float)(light / (2.0 * 3.14159265358979323846 * s2) * exp(-0.5 * v * v / s2));
        float gy = (float)(v / s2);
        for (int i = x0; i <= x1; i++) {
            int at = j * d->width + i;
            float value = g * along_x[i - cx + reach];
            if (d->image[at] == 0.0f && value > 0.0f) {
                d->touched[d->touched_count++] = at;
            }
            d->image[at] += value;
            d->image_x[at] += value * (float)((i - x) / s2);
            d->image_y[at] += value * gy;
        }
    }
}

/* Draws the image of a star of unit flux and its derivatives by the place. */
static void draw(bst_streak_deblend *d, double x_px, double y_px) {
    const bst_star_path *p = d->path;
    double m[3];
    clear_image(d);
    bst_star_path_map(p, x_px, y_px, m);
    const double reach = ceil(REACH_SIGMA * d->psf_sigma_px);
    for (int k = 0; k < p->count; k++) {
        double x = x_px + m[0] * p->place[k][0] + m[1] * p->place[k][1];
        double y = y_px + m[1] * p->place[k][0] + m[2] * p->place[k][1];
        if (x > -reach && y > -reach && x < d->width - 1 + reach && y < d->height - 1 + reach) {
            draw_sample(d, x, y, p->light[k] / p->count);
        }
    }
}

/* Adds a multiple of the drawn image to the model and takes it from the residual. */
static void subtract(bst_streak_deblend *d, double flux) {
    for (int i = 0; i < d->touched_count; i++) {
        int at = d->touched[i];
        float v = (float)flux * d->image[at];
        d->model[at] += v;
        d->residual[at] -= d->weight[at] > 0.0f ? v : 0.0f;
    }
}

bool bst_streak_deblend_add(bst_streak_deblend *d, double x_px, double y_px, double flux) {
    assert(d);
    if (d->count == d->room) {
        return false;
    }
    draw(d, x_px, y_px);
    subtract(d, flux);
    d->stars[d->count++] = (bst_deblended_star){.x_px = x_px, .y_px = y_px, .flux = flux};
    return true;
}

void bst_streak_deblend_leave_out(bst_streak_deblend *d, double x_px, double y_px,
                                  double radius_px) {
    assert(d);
    const int r = (int)ceil(radius_px), cx = (int)lround(x_px), cy = (int)lround(y_px);
    for (int y = cy - r > 0 ? cy - r : 0; y <= cy + r && y < d->height; y++) {
        for (int x = cx - r > 0 ? cx - r : 0; x <= cx + r && x < d->width; x++) {
            if (hypot(x - cx, y - cy) <= radius_px) {
                d->residual[y * d->width + x] = d->weight[y * d->width + x] = 0.0f;
            }
        }
    }
}

/* Weight of a pixel for a star: the light of the others has the error of their model. */
static double weight_at(const bst_streak_deblend *d, int at, double own) {
    if (!(d->weight[at] > 0.0f)) {
        return 0.0;
    }
    double model = fmax((double)d->model[at], 0.0), other = fmax(model - fmax(own, 0.0), 0.0);
    double error = d->error * other;
    return 1.0 / (d->noise2 + d->shot * model + COHERENT * error * error);
}

/* Improves one star. The image's derivatives are by the place. */
static void improve(bst_streak_deblend *d, bst_deblended_star *s) {
    double a[3][3] = {{0}}, b[3] = {0}, inverse[3][3];
    draw(d, s->x_px, s->y_px);
    for (int i = 0; i < d->touched_count; i++) {
        int at = d->touched[i];
        double own = s->flux * (double)d->image[at], w = weight_at(d, at, own);
        double j[3] = {(double)d->image[at], s->flux * (double)d->image_x[at],
                       s->flux * (double)d->image_y[at]};
        for (int k = 0; k < 3; k++) {
            b[k] += w * j[k] * (double)d->residual[at];
            for (int l = 0; l < 3; l++) {
                a[k][l] += w * j[k] * j[l];
            }
        }
    }
    if (!(a[0][0] > 0.0)) {
        s->snr = 0.0;
        return;
    }
    a[1][1] += 1.0 / (STEP_SIGMA_PX * STEP_SIGMA_PX);
    a[2][2] += 1.0 / (STEP_SIGMA_PX * STEP_SIGMA_PX);
    double step[3] = {b[0] / a[0][0], 0.0, 0.0};
    if (bst_symmetric_invert(3, a[0], inverse[0])) {
        for (int k = 0; k < 3; k++) {
            step[k] = inverse[k][0] * b[0] + inverse[k][1] * b[1] + inverse[k][2] * b[2];
        }
    }
    double length = hypot(step[1], step[2]);
    double limit = length > MOST_STEP_PX ? MOST_STEP_PX / length : 1.0;
    subtract(d, -s->flux);
    s->x_px += limit * step[1];
    s->y_px += limit * step[2];
    s->flux += limit * step[0];
    draw(d, s->x_px, s->y_px);
    subtract(d, s->flux);
}

/* Measures the SNR of a star and its share in the frame. */
static void measure(bst_streak_deblend *d, bst_deblended_star *s) {
    double sum = 0.0, squares = 0.0;
    draw(d, s->x_px, s->y_px);
    for (int i = 0; i < d->touched_count; i++) {
        int at = d->touched[i];
        double v = (double)d->image[at];
        /* its own shot noise is no doubt of its existence */
        double w = weight_at(d, at, s->flux * v);
        double own = d->shot * fmax(s->flux, 0.0) * v;
        w = w > 0.0 ? 1.0 / fmax(1.0 / w - own, d->noise2) : 0.0;
        sum += w * v * v;
        squares += v * v;
    }
    s->snr = s->flux * sqrt(sum) / d->spread;
    s->inside = squares;
}

void bst_streak_deblend_fit(bst_streak_deblend *d, int sweeps, int first) {
    assert(d && sweeps >= 1 && first >= 0);
    for (int k = 0; k < sweeps; k++) {
        for (int i = k + 1 < sweeps ? 0 : first; i < d->count; i++) {
            improve(d, &d->stars[i]);
        }
    }
    double whole = 0.0;
    for (int k = 0; k < d->path->count; k++) {
        for (int l = 0; l < d->path->count; l++) {
            double dx = d->path->place[k][0] - d->path->place[l][0];
            double dy = d->path->place[k][1] - d->path->place[l][1];
            double r2 = (dx * dx + dy * dy) / (d->psf_sigma_px * d->psf_sigma_px);
            whole += r2 < 100.0 ? d->path->light[k] * d->path->light[l] * exp(-0.25 * r2) : 0.0;
        }
    }
    whole /= 4.0 * 3.14159265358979323846 * d->psf_sigma_px * d->psf_sigma_px * d->path->count *
             d->path->count;
    for (int i = 0; i < d->count; i++) {
        measure(d, &d->stars[i]);
        d->stars[i].inside = fmin(d->stars[i].inside / whole, 1.0);
    }
    clear_image(d);
}

int bst_streak_deblend_drop(bst_streak_deblend *d, double least_snr) {
    assert(d);
    int kept = 0, dropped = 0;
    for (int i = 0; i < d->count; i++) {
        bst_deblended_star *s = &d->stars[i];
        if (s->snr >= least_snr) {
            d->stars[kept++] = *s;
            continue;
        }
        draw(d, s->x_px, s->y_px);
        subtract(d, -s->flux);
        dropped++;
    }
    d->count = kept;
    clear_image(d);
    return dropped;
}

/* Median of the dark pixels of a cell; NAN: there are too few. */
static float cell_median(const bst_streak_deblend *d, int cx, int cy) {
    int count = 0;
    for (int y = cy * CELL; y < (cy + 1) * CELL && y < d->height; y++) {
        for (int x = cx * CELL; x < (cx + 1) * CELL && x < d->width; x++) {
            int at = y * d->width + x;
            if (d->weight[at] > 0.0f && (double)d->model[at] < DARK) {
                d->scratch[count++] = d->residual[at];
            }
        }
    }
    return count >= LEAST_CELL ? bst_value_of_rank(d->scratch, count, count / 2) : NAN;
}

/* Subtracts the background of what is left: bilinear between the cells' middles. */
static void subtract_background(bst_streak_deblend *d) {
    const int nx = (d->width + CELL - 1) / CELL, ny = (d->height + CELL - 1) / CELL;
    float *cells = d->image, *column = d->image_x; /* at rest */
    for (int i = 0; i < nx * ny; i++) {
        cells[i] = cell_median(d, i % nx, i / nx);
    }
    for (int i = 0; i < nx * ny; i++) {
        cells[i] = isnan(cells[i]) ? 0.0f : cells[i];
    }
    for (int y = 0; y < d->height; y++) {
        float v = fmaxf(((float)y + 0.5f) / CELL - 0.5f, 0.0f);
        int j = (int)v, j1 = j + 1 < ny ? j + 1 : j;
        for (int i = 0; i < nx; i++) {
            column[i] =
                cells[j * nx + i] + (v - (float)j) * (cells[j1 * nx + i] - cells[j * nx + i]);
        }
        for (int x = 0; x < d->width; x++) {
            float u = fmaxf(((float)x + 0.5f) / CELL - 0.5f, 0.0f);
            int i = (int)u, i1 = i + 1 < nx ? i + 1 : i;
            float f = u - (float)i, level = column[i] + f * (column[i1] - column[i]);
            int at = y * d->width + x;
            d->residual[at] -= d->weight[at] > 0.0f ? level : 0.0f;
        }
    }
    memset(cells, 0, (size_t)(nx * ny) * sizeof *cells);
    memset(column, 0, (size_t)nx * sizeof *column);
}

/* Every so many pixels tell the noise; odd, so that columns do not repeat. */
static int stride_of(const bst_streak_deblend *d) {
    return d->width * d->height / SAMPLED | 1;
}

/* Variance of the dark pixels: by the mean of their absolute values up to CLIP sigma, which coarse
 * counts change less than their median. */
static double noise2_of(const bst_streak_deblend *d) {
    int count = 0, stride = stride_of(d);
    for (int i = 0; i < d->width * d->height; i += stride) {
        if (d->weight[i] > 0.0f && (double)d->model[i] < DARK) {
            d->scratch[count++] = fabsf(d->residual[i]);
        }
    }
    if (count < LEAST_CELL) {
        return 1.0;
    }
    double noise = 1.4826 * (double)bst_value_of_rank(d->scratch, count, count / 2);
    for (int pass = 0; pass < CLIP_PASSES; pass++) {
        double sum = 0.0;
        int kept = 0;
        for (int i = 0; i < count; i++) {
            bool near = (double)d->scratch[i] < CLIP * noise;
            sum += near ? (double)d->scratch[i] : 0.0;
            kept += near;
        }
        noise = kept > 0 ? sum / kept / CLIPPED_MEAN : noise;
    }
    return fmax(noise * noise, LEAST_NOISE2);
}

/* Relative error of the model: the residual of bright pixels over their light, less its noise. */
static double error_of(const bst_streak_deblend *d) {
    int count = 0;
    for (int i = 0; i < d->width * d->height; i++) {
        double m = (double)d->model[i];
        if (m > BRIGHT && d->weight[i] > 0.0f) {
            double r = (double)d->residual[i];
            d->scratch[count++] =
                (float)((r * r / MEDIAN_CHI2 - d->noise2 - d->shot * m) / (m * m));
        }
    }
    if (count < LEAST_ERRORS) {
        return USUAL_ERROR;
    }
    double middle = (double)bst_value_of_rank(d->scratch, count, count / 2);
    return fmin(fmax(sqrt(fmax(middle, 0.0)), LEAST_ERROR), MOST_ERROR);
}

void bst_streak_deblend_weigh(bst_streak_deblend *d) {
    assert(d);
    clear_image(d);
    subtract_background(d);
    d->noise2 = noise2_of(d);
    d->error = error_of(d);
    const float dark = (float)(1.0 / d->noise2);
    for (int i = 0; i < d->width * d->height; i++) {
        if (d->weight[i] > 0.0f) {
            d->weight[i] = d->model[i] > 0.0f ? (float)weight_at(d, i, 0.0) : dark;
        }
    }
}

/* Half the squared difference of a star's image and that shifted, over the variance. */
static double loss_of_shift(bst_streak_deblend *d, const bst_deblended_star *s, double dx,
                            double dy) {
    double sum = 0.0;
    draw(d, s->x_px, s->y_px);
    int count = d->touched_count;
    for (int i = 0; i < count; i++) {
        d->scratch[d->touched[i]] = (float)s->flux * d->image[d->touched[i]];
    }
    /* pixels of the first image that the second does not touch */
    double first = 0.0;
    for (int i = 0; i < count; i++) {
        int at = d->touched[i];
        double own = (double)d->scratch[at];
        first += weight_at(d, at, own) * own * own;
    }
    draw(d, s->x_px + dx, s->y_px + dy);
    for (int i = 0; i < d->touched_count; i++) {
        int at = d->touched[i];
        double own = (double)d->scratch[at], w = weight_at(d, at, own);
        double difference = own - s->flux * (double)d->image[at];
        sum += w * (difference * difference - own * own);
    }
    draw(d, s->x_px, s->y_px);
    for (int i = 0; i < d->touched_count; i++) {
        d->scratch[d->touched[i]] = 0.0f;
    }
    return 0.5 * (sum + first);
}

/* Shift along a direction by which the expected logarithm of the likelihood falls by a half. */
static double sigma_along(bst_streak_deblend *d, const bst_deblended_star *s, double dx,
                          double dy) {
    double shift = 0.25, before = 0.0, loss_before = 0.0;
    for (int i = 0; i < SHIFTS; i++) {
        double loss = 0.5 * (loss_of_shift(d, s, shift * dx, shift * dy) +
                             loss_of_shift(d, s, -shift * dx, -shift * dy));
        if (loss >= 0.5) {
            /* parabolic at first, linear further out */
            return i == 0 ? shift * sqrt(0.5 / loss)
                          : before + (shift - before) * (0.5 - loss_before) / (loss - loss_before);
        }
        before = shift;
        loss_before = loss;
        shift *= 2.5;
    }
    return before;
}

/* Mean direction of the part of a star's path that is in the frame. */
static void direction_of(const bst_streak_deblend *d, const bst_deblended_star *s, double out[2]) {
    const bst_star_path *p = d->path;
    double m[3], first[2] = {0}, last[2] = {0};
    bool any = false;
    bst_star_path_map(p, s->x_px, s->y_px, m);
    for (int k = 0; k < p->count; k++) {
        double x = s->x_px + m[0] * p->place[k][0] + m[1] * p->place[k][1];
        double y = s->y_px + m[1] * p->place[k][0] + m[2] * p->place[k][1];
        if (x > -1.0 && y > -1.0 && x < d->width && y < d->height) {
            last[0] = x;
            last[1] = y;
            if (!any) {
                memcpy(first, last, sizeof first);
            }
            any = true;
        }
    }
    double length = hypot(last[0] - first[0], last[1] - first[1]);
    out[0] = length > 0.0 ? (last[0] - first[0]) / length : 1.0;
    out[1] = length > 0.0 ? (last[1] - first[1]) / length : 0.0;
}

void bst_streak_deblend_finish(bst_streak_deblend *d, double systematic_px) {
    assert(d && systematic_px >= 0.0);
    memset(d->scratch, 0, (size_t)d->width * (size_t)d->height * sizeof *d->scratch);
    for (int i = 0; i < d->count; i++) {
        bst_deblended_star *s = &d->stars[i];
        double u[2];
        direction_of(d, s, u);
        double along = sigma_along(d, s, u[0], u[1]), across = sigma_along(d, s, -u[1], u[0]);
        double a2 = along * along + systematic_px * systematic_px;
        double c2 = across * across + systematic_px * systematic_px;
        s->cov_xx = u[0] * u[0] * a2 + u[1] * u[1] * c2;
        s->cov_xy = u[0] * u[1] * (a2 - c2);
        s->cov_yy = u[1] * u[1] * a2 + u[0] * u[0] * c2;
    }
    clear_image(d);
}
