#include "imgproc/filter.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "imgproc/rows.h"
#include "sim/core/pages.h"

enum {
    PART_PX = 131072, /* pixels of a part of a pass */
    GROUP = 4,        /* rows that are made at a time */
    LATEST = 3,       /* of the streak map that are kept beside it */
    CACHED_PX = 1 << 20,
    FEW_TAPS = 24,  /* of a streak whose output is quickly made where it is asked for */
    CROWD_PX = 400, /* to a maximum: where they are as dense as that it is asked for often */
    SOON_PX = 512   /* that are read ahead at a time: as many lines as are on their way at once */
};

bst_status bst_filter_create(bst_ctx *ctx, int max_width, int max_height, double streak_max_px,
                             int threads, bst_filter *out) {
    int pad = (int)ceil(0.5 * streak_max_px) + 2;
    /* what looks for maxima reads beyond a row */
    pad = pad > 2 * BST_ROW_LANES ? pad : 2 * BST_ROW_LANES;
    /* rows begin where lines of the cache do, as far as the frame's width allows */
    pad = (pad + BST_ROW_LANES - 1) / BST_ROW_LANES * BST_ROW_LANES;
    *out = (bst_filter){.max_width = max_width, .max_height = max_height, .pad = pad};
    size_t pixels = (size_t)max_width * (size_t)max_height;
    size_t line = (size_t)(max_width + 2 * pad);
    /* three rows, the latest, the parts of a row (two for each four pixels at the most, of five
     * numbers), and a ring of rows */
    out->line_floats = line * (3 + LATEST + 3 + 2 * BST_FILTER_MAX_RADIUS + GROUP);
    size_t map = line * (size_t)(max_height + 2 * pad) * sizeof(float);
    out->point = bst_pages_alloc(map);
    out->best = bst_pages_alloc(map);
    out->maxima = calloc((size_t)max_height, sizeof *out->maxima);
    out->maximum_x = calloc(pixels, sizeof *out->maximum_x);
    out->maximum_snr = calloc(pixels, sizeof *out->maximum_snr);
    out->lines = calloc(out->line_floats * (size_t)threads, sizeof(float));
    out->lent = calloc(1, sizeof *out->lent);
    out->edge_x = calloc((size_t)max_width, sizeof(float));
    out->edge_y = calloc((size_t)max_height, sizeof(float));
    if (!out->point || !out->best || !out->maxima || !out->maximum_x || !out->maximum_snr ||
        !out->lines || !out->lent || !out->edge_x || !out->edge_y) {
        bst_filter_free(out);
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the filters of a %d x %d frame",
                        max_width, max_height);
    }
    bst_borrow_init(out->lent, threads);
    return BST_OK;
}

void bst_filter_free(bst_filter *f) {
    free(f->point);
    free(f->best);
    free(f->maxima);
    free(f->maximum_x);
    free(f->maximum_snr);
    free(f->lines);
    free(f->lent);
    free(f->edge_x);
    free(f->edge_y);
    *f = (bst_filter){0};
}

/* Autocorrelation of the one-axis kernel (unit norm) at integer lags. */
static void correlate(bst_filter *f) {
    for (int lag = 0; lag <= 2 * f->radius; lag++) {
        double sum = 0.0;
        for (int i = 0; i + lag <= 2 * f->radius; i++) {
            sum += (double)f->kernel[i] * (double)f->kernel[i + lag];
        }
        f->correlation[lag] = sum;
    }
}

static double axis_correlation(const bst_filter *f, int lag) {
    return abs(lag) <= 2 * f->radius ? f->correlation[abs(lag)] : 0.0;
}

/* Covariance of the streak output at places a lag apart, with the weights as they are. */
static double streak_covariance(const bst_filter *f, int lag_x, int lag_y) {
    double sum = 0.0;
    for (int a = 0; a < f->taps; a++) {
        for (int b = 0; b < f->taps; b++) {
            int lx = f->tap_x[a] - f->tap_x[b] + lag_x, ly = f->tap_y[a] - f->tap_y[b] + lag_y;
            if (abs(lx) <= 2 * f->radius && abs(ly) <= 2 * f->radius) {
                sum += (double)f->tap_weight[a] * (double)f->tap_weight[b] *
                       axis_correlation(f, lx) * axis_correlation(f, ly);
            }
        }
    }
    return sum;
}

static void add_tap(bst_filter *f, int x, int y, double weight) {
    if (weight > 0.0 && f->taps < BST_FILTER_MAX_TAPS - 4) {
        f->tap_x[f->taps] = x;
        f->tap_y[f->taps] = y;
        f->tap_weight[f->taps++] = (float)weight;
    }
}

/* The Gaussian's share of each pixel of one axis about a centre `shift` px off the middle one, for
 * -radius - 1 .. radius + 1. */
static void axis_shares(double sigma_px, double shift, int radius, double *out) {
    double root = sigma_px * sqrt(2.0);
    for (int i = -radius - 1; i <= radius + 1; i++) {
        out[i + radius + 1] = 0.5 * (erf((i + 0.5 - shift) / root) - erf((i - 0.5 - shift) / root));
    }
}

static void add_powers(double k, double *powers) {
    double power = k * k;
    for (int i = 0; i < BST_TAIL_POWERS; i++) {
        power *= k;
        powers[i] += power;
    }
}

/* Density of maxima and sums of powers for the point, and the shifted kernels. The gradient's
 * covariance is that of unit-norm kernels by shift, averaged over the phases. */
static void describe_point(bst_filter *f, double sigma_px) {
    enum { SIZE = 2 * BST_FILTER_MAX_RADIUS + 3 };
    int n = 2 * f->radius + 3;
    double roughness = 0.0, powers[BST_TAIL_POWERS] = {0.0};
    for (int p = 0; p < BST_FILTER_PHASES; p++) {
        double here[SIZE], before[SIZE], after[SIZE], h = 1e-3, squares[3] = {0}, metric = 0.0;
        double shift = -0.5 + (double)p / (BST_FILTER_PHASES - 1);
        axis_shares(sigma_px, shift, f->radius, here);
        axis_shares(sigma_px, shift - h, f->radius, before);
        axis_shares(sigma_px, shift + h, f->radius, after);
        for (int i = 0; i < n; i++) {
            squares[0] += before[i] * before[i];
            squares[1] += here[i] * here[i];
            squares[2] += after[i] * after[i];
        }
        for (int i = 0; i < n; i++) {
            double slope = (after[i] / sqrt(squares[2]) - before[i] / sqrt(squares[0])) / (2.0 * h);
            double k = here[i] / sqrt(squares[1]);
            metric += slope * slope;
            add_powers(k, powers);
            f->phase[p][i] = (float)k;
        }
        /* the two ends are one phase */
        double weight = p == 0 || p == BST_FILTER_PHASES - 1 ? 0.5 : 1.0;
        roughness += weight * metric / (BST_FILTER_PHASES - 1);
    }
    double half = 0.0;
    for (int i = 0; i < n; i++) {
        half += (double)f->phase[BST_FILTER_PHASES / 2][i] * (double)f->phase[0][i];
    }
    f->corner = half * half;
    f->point_density = roughness; /* sqrt of the product over both axes, which are alike */
    for (int i = 0; i < BST_TAIL_POWERS; i++) {
        double one_axis = powers[i] / BST_FILTER_PHASES;
        f->point_weights.power[i] = one_axis * one_axis;
    }
}

/* The same for the streak: the gradient's covariance from its correlations at lags of a pixel,
 * whose logarithm is quadratic near 0, sums of powers from its kernel's values. */
static void describe_streak(bst_filter *f) {
    double r[3][3];
    for (int j = -1; j <= 1; j++) {
        for (int i = -1; i <= 1; i++) {
            r[j + 1][i + 1] = streak_covariance(f, i, j) / streak_covariance(f, 0, 0);
        }
    }
    double lxx = -2.0 * log(fmax(r[1][2], 1e-6)), lyy = -2.0 * log(fmax(r[2][1], 1e-6));
    double lxy = -0.5 * (log(fmax(r[2][2], 1e-6)) - log(fmax(r[2][0], 1e-6)));
    f->streak_density = sqrt(fmax(lxx * lyy - lxy * lxy, 1e-8));
    /* the kernel's values at whole pixels */
    int reach_x = 0, reach_y = 0;
    for (int t = 0; t < f->taps; t++) {
        reach_x = abs(f->tap_x[t]) > reach_x ? abs(f->tap_x[t]) : reach_x;
        reach_y = abs(f->tap_y[t]) > reach_y ? abs(f->tap_y[t]) : reach_y;
    }
    f->streak_weights = (bst_tail_weights){{0.0}};
    for (int y = -reach_y - f->radius; y <= reach_y + f->radius; y++) {
        for (int x = -reach_x - f->radius; x <= reach_x + f->radius; x++) {
            double k = 0.0;
            for (int t = 0; t < f->taps; t++) {
                int u = x - f->tap_x[t], v = y - f->tap_y[t];
                if (abs(u) <= f->radius && abs(v) <= f->radius) {
                    k += (double)f->tap_weight[t] * (double)f->kernel[u + f->radius] *
                         (double)f->kernel[v + f->radius];
                }
            }
            add_powers(k, f->streak_weights.power);
        }
    }
}

/* Samples one pixel apart along the longer axis; between the two nearest pixels of the other axis
 * by linear interpolation, which broadens the kernel by at most 1/4 px^2 and costs 0.3 % of the SNR
 * at FWHM 2. */
static void set_streak(bst_filter *f, double dx, double dy) {
    bool along_x = fabs(dx) >= fabs(dy);
    double major = along_x ? dx : dy, minor = along_x ? dy : dx;
    double slope = minor / major, half = 0.5 * fabs(major);
    int reach = (int)ceil(half + 0.5);
    f->taps = 0;
    for (int j = -reach; j <= reach; j++) {
        double lo = fmax(j - 0.5, -half), hi = fmin(j + 0.5, half);
        if (hi <= lo) {
            continue;
        }
        double across = 0.5 * (lo + hi) * slope, base = floor(across), fraction = across - base;
        for (int k = 0; k < 2; k++) {
            double weight = (hi - lo) * (k ? fraction : 1.0 - fraction);
            int m = (int)base + k;
            add_tap(f, along_x ? j : m, along_x ? m : j, weight);
        }
    }
    double scale = 1.0 / sqrt(streak_covariance(f, 0, 0));
    double total = 0.0, shared = 0.0;
    for (int t = 0; t < f->taps; t++) {
        total += (double)f->tap_weight[t];
        f->tap_weight[t] = (float)((double)f->tap_weight[t] * scale);
        shared += (double)f->tap_weight[t] * axis_correlation(f, f->tap_x[t]) *
                  axis_correlation(f, f->tap_y[t]);
    }
    f->overlap = fmin(shared, 1.0);
    /* norm of the drawn kernel at unit flux: the point kernel's over total weight times scale */
    f->streak_norm = f->norm / (scale * total);
    describe_streak(f);
}

void bst_filter_set(bst_filter *f, double sigma_px, double dx_px, double dy_px) {
    if (f->made_sigma == sigma_px && f->made_dx == dx_px && f->made_dy == dy_px) {
        return;
    }
    f->made_sigma = sigma_px;
    f->made_dx = dx_px;
    f->made_dy = dy_px;
    f->radius = (int)ceil(3.2 * sigma_px);
    f->radius = f->radius < 1                       ? 1
                : f->radius > BST_FILTER_MAX_RADIUS ? BST_FILTER_MAX_RADIUS
                                                    : f->radius;
    double share[2 * BST_FILTER_MAX_RADIUS + 1], square = 0.0;
    for (int i = -f->radius; i <= f->radius; i++) {
        double root = sigma_px * sqrt(2.0);
        double p = 0.5 * (erf((i + 0.5) / root) - erf((i - 0.5) / root));
        share[i + f->radius] = p;
        square += p * p;
    }
    f->norm = square;
    for (int i = 0; i <= 2 * f->radius; i++) {
        f->kernel[i] = (float)(share[i] / sqrt(square));
    }
    for (int i = 2 * f->radius + 1; i < 2 * f->radius + 4; i++) {
        f->kernel[i] = 0.0f;
    }
    f->streak = dx_px != 0.0 || dy_px != 0.0;
    f->dx_px = dx_px;
    f->dy_px = dy_px;
    f->overlap = 0.0;
    f->taps = 0;
    f->threshold = 0.0;
    correlate(f);
    describe_point(f, sigma_px);
    if (f->streak) {
        set_streak(f, dx_px, dy_px);
    }
}

/* Share of a smooth field's maxima above a threshold that a parabola through five shifts sees above
 * it: nine see 1.7 % more, in 2,000 maxima. */
static const double SEEN = 0.97;

double bst_filter_threshold(bst_filter *f, double false_alarms, double pixels) {
    if (f->threshold > 0.0 && f->threshold_density == false_alarms / pixels) {
        return f->threshold;
    }
    double lo = 2.5, hi = 9.0;
    for (int i = 0; i < 24; i++) {
        double u = 0.5 * (lo + hi);
        double rate = bst_tail_maxima(u, f->point_density);
        if (f->streak) {
            rate += bst_tail_maxima(u, f->streak_density) * (1.0 - bst_tail_both(u, u, f->overlap));
        }
        if (SEEN * rate * pixels > false_alarms) {
            lo = u;
        } else {
            hi = u;
        }
    }
    f->threshold = 0.5 * (lo + hi);
    f->threshold_density = false_alarms / pixels;
    return f->threshold;
}

/* 1 / norm of the part of the kernel that lies on pixels 0..count-1, for each centre. */
static void edge_factors(const bst_filter *f, int count, float *out) {
    for (int x = 0; x < count; x++) {
        out[x] = 1.0f;
        if (x >= f->radius && x + f->radius < count) {
            continue;
        }
        double square = 0.0;
        for (int i = -f->radius; i <= f->radius; i++) {
            double k = (double)f->kernel[i + f->radius];
            square += x + i >= 0 && x + i < count ? k * k : 0.0;
        }
        out[x] = (float)(1.0 / sqrt(square));
    }
}

/* What a pass over the frame needs. */
typedef struct pass {
    bst_filter *f;
    const bst_background *background;
    bst_pixel_fn read;
    const void *user;
    const uint16_t *raw;
    float *signal;
    int saturated_dn, part_rows;
    int reach;       /* rows above and below that a row of the streak map needs */
    bool past_cache; /* the frame is larger than that */
    bool apart;      /* rows of the streak map are kept no longer than maxima need them */
    float threshold;
} pass;

static float *map_row(const bst_filter *f, float *map, int y) {
    return map + (long)(y + f->pad) * (long)f->stride + f->pad;
}

static void note_maxima(bst_filter *f, int y, const float *above, const float *row,
                        const float *below, float threshold) {
    size_t at = (size_t)y * (size_t)f->max_width;
    f->maxima[y] = bst_row_maxima(above, row, below, f->width, threshold, f->maximum_x + at,
                                  f->maximum_snr + at);
}

/* Needs the rows above and below; those beyond the frame are 0. */
static void find_maxima(bst_filter *f, int y, float threshold) {
    const float *row = map_row(f, f->streak ? f->best : f->point, y);
    note_maxima(f, y, row - f->stride, row, row + f->stride, threshold);
}

/* A row of the streak map, and its copy, NULL: none. Needs the rows of the point map that the taps
 * reach. */
static void filter_streak(const bst_filter *f, int y, float *row, float *copy) {
    const float *in[BST_FILTER_MAX_TAPS], *point = map_row(f, f->point, y);
    for (int t = 0; t < f->taps; t++) {
        in[t] = point + (long)f->tap_y[t] * (long)f->stride + f->tap_x[t];
    }
    bst_row_streak(row, copy, f->width, in, f->tap_weight, f->taps, point);
}

/* The kernel's cut at the frame's edges. */
static void mend_edges(const bst_filter *f, int y, float *row) {
    int r = f->radius < f->width ? f->radius : f->width, last = f->width - r;
    if (f->edge_y[y] != 1.0f || last < r) {
        bst_row_scale(row, f->edge_x, f->edge_y[y], f->width);
    } else {
        bst_row_scale(row, f->edge_x, 1.0f, r);
        bst_row_scale(row + last, f->edge_x + last, 1.0f, r);
    }
}

/* One row of the kernel's horizontal part; own: with its row of signal. */
static void filter_across(const pass *p, int y, bool own, float *lines, float *out) {
    const bst_filter *f = p->f;
    int width = f->width, r = f->radius;
    if (y < 0 || y >= f->height) {
        memset(out, 0, (size_t)width * sizeof(float));
        return;
    }
    size_t row = (size_t)y * (size_t)width, line = (size_t)f->stride;
    float *normalised = lines, *electrons = lines + line;
    float *signal = own ? p->signal + row : lines + 2 * line;
    bst_row_part *parts = (bst_row_part *)(void *)(lines + 3 * line);
    p->read(p->user, y, 0, width, electrons);
    bst_row_normalise(p->raw + row, electrons, parts, bst_background_parts(p->background, y, parts),
                      p->saturated_dn, own && p->past_cache, signal, normalised + r);
    const float *in[2 * BST_FILTER_MAX_RADIUS + 1];
    for (int x = 0; x < width; x += SOON_PX) {
        int count = width - x < SOON_PX ? width - x : SOON_PX;
        if (y + 1 < f->height) {
            bst_row_prefetch(p->raw + row + (size_t)(width + x), count);
        }
        for (int t = 0; t <= 2 * r; t++) {
            in[t] = normalised + x + t;
        }
        bst_row_even(out + x, count, in + r, f->kernel + r, r);
    }
}

/* `count` (1 or GROUP) rows of the point map from the ring of horizontal parts. */
static void filter_down(bst_filter *f, int y, int count, const float *ring, int ring_rows) {
    const float *in[2 * BST_FILTER_MAX_RADIUS + GROUP];
    size_t line = (size_t)f->stride;
    int r = f->radius;
    for (int t = 0; t < 2 * r + count; t++) {
        in[t] = ring + line * (size_t)((y - r + t + ring_rows) % ring_rows);
    }
    float *out = map_row(f, f->point, y);
    if (count == GROUP) {
        bst_row_even_4(out, line, f->width, in + r, f->kernel + r, r);
    } else {
        bst_row_even(out, f->width, in + r, f->kernel + r, r);
    }
    for (int k = 0; k < count; k++) {
        mend_edges(f, y + k, out + (size_t)k * line);
    }
}

/* Rows begin to end of the point map, with the rows of signal that are theirs; of the streak map
 * and of maxima, those that need no other rows. */
static void filter_rows(void *user, int begin, int end) {
    const pass *p = user;
    bst_filter *f = p->f;
    int r = f->radius, ring_rows = 2 * r + GROUP;
    size_t line = (size_t)f->stride;
    int taken = bst_borrow_take(f->lent);
    float *lines = f->lines + f->line_floats * (size_t)taken, *ring = lines + 6 * line;
    /* the latest rows of the streak map: maxima are looked for while they are near */
    float *latest = ring + line * (size_t)ring_rows + f->pad;
    bool ring_of_streaks = f->streak && p->past_cache;
    memset(lines, 0, line * sizeof(float));
    memset(latest - f->pad, 0, LATEST * line * sizeof(float));
    for (int y = begin - r, next = begin; y < end + r; y++) {
        filter_across(p, y, y >= begin && y < end, lines,
                      ring + line * (size_t)((y + ring_rows) % ring_rows));
        int last = y - r; /* the last row that can be made */
        int count = last - next + 1 == GROUP ? GROUP : last + 1 == end ? 1 : 0;
        for (; count > 0 && next <= last; next += count) {
            filter_down(f, next, count, ring, ring_rows);
            for (int k = next; k < next + count; k++) {
                int ready = k - p->reach;
                if (f->streak && ready >= begin + p->reach) {
                    float *row = map_row(f, f->best, ready);
                    filter_streak(f, ready,
                                  ring_of_streaks ? latest + line * (size_t)(ready % LATEST) : row,
                                  ring_of_streaks && !p->apart ? row : NULL);
                }
                if (ready - 2 < begin + p->reach) {
                    continue;
                }
                if (ring_of_streaks) {
                    note_maxima(f, ready - 1, latest + line * (size_t)((ready - 2) % LATEST),
                                latest + line * (size_t)((ready - 1) % LATEST),
                                latest + line * (size_t)(ready % LATEST), p->threshold);
                } else {
                    find_maxima(f, ready - 1, p->threshold);
                }
            }
        }
    }
    bst_borrow_give(f->lent, taken);
}

/* Whether a row depends on rows of other parts, `reach` away. */
static bool is_border(const pass *p, int y, int reach) {
    int begin = y / p->part_rows * p->part_rows, end = begin + p->part_rows;
    end = end < p->f->height ? end : p->f->height;
    return y < begin + reach || y >= end - reach;
}

static void finish_streaks(void *user, int begin, int end) {
    const pass *p = user;
    for (int y = begin; y < end; y++) {
        if (is_border(p, y, p->reach)) {
            filter_streak(p->f, y, map_row(p->f, p->f->best, y), NULL);
        }
    }
}

static void keep_streaks(void *user, int begin, int end) {
    const pass *p = user;
    for (int y = begin; y < end; y++) {
        filter_streak(p->f, y, map_row(p->f, p->f->best, y), NULL);
    }
}

static void finish_maxima(void *user, int begin, int end) {
    const pass *p = user;
    for (int y = begin; y < end; y++) {
        if (is_border(p, y, p->reach + 1)) {
            find_maxima(p->f, y, p->threshold);
        }
    }
}

/* The same where there is no map of the streak's output. */
static void finish_apart(void *user, int begin, int end) {
    const pass *p = user;
    bst_filter *f = p->f;
    size_t line = (size_t)f->stride;
    int taken = bst_borrow_take(f->lent), made = -2;
    float *ring = f->lines + f->line_floats * (size_t)taken;
    memset(ring, 0, LATEST * line * sizeof(float));
    for (int y = begin; y < end; y++) {
        if (!is_border(p, y, p->reach + 1)) {
            continue;
        }
        const float *rows[LATEST];
        for (int k = 0; k < LATEST; k++) {
            int at = y - 1 + k;
            float *row = ring + line * (size_t)((at + LATEST) % LATEST) + f->pad;
            bool outside = at < 0 || at >= f->height;
            if (!outside && at > made) {
                filter_streak(f, at, row, NULL);
                made = at;
            }
            rows[k] = outside ? map_row(f, f->best, at) : row;
        }
        note_maxima(f, y, rows[0], rows[1], rows[2], p->threshold);
    }
    bst_borrow_give(f->lent, taken);
}

/* Whether the greater output will be asked for at so many places that a map of it is quicker. */
static bool is_crowded(const bst_filter *f) {
    long maxima = 0;
    for (int y = 0; y < f->height; y++) {
        maxima += f->maxima[y];
    }
    return maxima * CROWD_PX > (long)f->width * f->height;
}

void bst_filter_run(bst_filter *f, bst_parallel *pool, const bst_background *background,
                    bst_pixel_fn read, const void *user, const uint16_t *raw, float *signal,
                    int width, int height, int saturated_dn, float threshold) {
    if (f->width != width || f->height != height) {
        f->width = width;
        f->height = height;
        f->stride = width + 2 * f->pad;
        size_t bytes = (size_t)f->stride * (size_t)(height + 2 * f->pad) * sizeof(float);
        memset(f->point, 0, bytes);
        memset(f->best, 0, bytes);
    }
    edge_factors(f, width, f->edge_x);
    edge_factors(f, height, f->edge_y);
    /* large parts: each reads 2 radius rows of its neighbours again */
    int rows = PART_PX / width > 0 ? PART_PX / width : 1, reach = 0;
    for (int t = 0; t < f->taps; t++) {
        reach = abs(f->tap_y[t]) > reach ? abs(f->tap_y[t]) : reach;
    }
    bool past_cache = width * height > CACHED_PX;
    pass p = {.f = f,
              .background = background,
              .read = read,
              .user = user,
              .raw = raw,
              .signal = signal,
              .saturated_dn = saturated_dn,
              .part_rows = rows,
              .reach = reach,
              .past_cache = past_cache,
              .apart = f->streak && past_cache && f->taps <= FEW_TAPS && !f->crowded,
              .threshold = threshold};
    f->kept = f->streak && !p.apart;
    bst_parallel_for(pool, height, rows, filter_rows, &p);
    if (f->kept) {
        bst_parallel_for(pool, height, rows, finish_streaks, &p);
    }
    bst_parallel_for(pool, height, rows, p.apart ? finish_apart : finish_maxima, &p);
    f->crowded = is_crowded(f);
    if (p.apart && f->crowded) {
        bst_parallel_for(pool, height, rows, keep_streaks, &p);
        f->kept = true;
    }
}

float bst_filter_streak_at(const bst_filter *f, int x, int y) {
    float sum = 0.0f;
    for (int t = 0; t < f->taps; t++) {
        sum += f->tap_weight[t] * bst_filter_point_at(f, x + f->tap_x[t], y + f->tap_y[t]);
    }
    return sum;
}

void bst_filter_mask(const bst_filter *f, int y, int x, int count, float snr, float *out) {
    /* the map's margin is zero */
    const float *map = f->streak ? f->best : f->point;
    const float *rows[2 * BST_ROW_NEAR + 1];
    for (int j = -BST_ROW_NEAR; j <= BST_ROW_NEAR; j++) {
        int v = y + j < 0 ? 0 : y + j < f->height ? y + j : f->height - 1;
        rows[j + BST_ROW_NEAR] = map + (long)(v + f->pad) * f->stride + f->pad + x;
    }
    bst_row_mask(rows, count, snr, out);
}
