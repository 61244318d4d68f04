#include "imgproc/detect/blooming.h"

#include <math.h>

#include "imgproc/measure/cosmic_ray.h"

enum { MOST_COLUMNS = 96, MOST_SETS = 256 };

/* The full well of the pixels is known to this share. */
static const double WELL_SHARE = 0.02;
/* A fit whose mean square deviation is greater has not found the wings. */
static const double MOST_MISFIT = 25.0;
/* Weight of the deviation beyond noise in the covariance: neighbouring pixels share the PSF's error
 * (tests/imgproc/test_blooming.c). */
static const double MISFIT_WEIGHT = 3.0;
/* Standard deviation of a place by the wings of a PSF that is 8 % wider than believed, of the
 * saturated columns' width (tests/imgproc/test_blooming.c). */
static const double FLOOR_SHARE = 0.004;
/* Standard deviation of a place that no fit determines, of the saturated columns' width, and its
 * least, px: three times the greatest error of start_beside in tests/imgproc/test_blooming.c. */
static const double UNFITTED_SHARE = 0.03, UNFITTED_PX = 0.1;

/* Saturated pixels that touch: in each of the columns from x0 on, rows top to bottom. */
typedef struct bleed_set {
    int x0, columns;
    int top[MOST_COLUMNS], bottom[MOST_COLUMNS];
    int first, last; /* rows of them all */
} bleed_set;

static float *at(const bst_locate_frame *f, int x, int y) {
    return &f->signal[(size_t)y * (size_t)f->width + (size_t)x];
}

static bool is_full(const bst_locate_frame *f, int x, int y) {
    return x >= 0 && y >= 0 && x < f->width && y < f->height && *at(f, x, y) == BST_PIXEL_SATURATED;
}

/* Light above the background at a pixel; 0 where none was measured. */
static double light(const bst_locate_frame *f, int x, int y) {
    bool inside = x >= 0 && y >= 0 && x < f->width && y < f->height;
    return inside && *at(f, x, y) > BST_PIXEL_NONE ? (double)*at(f, x, y) : 0.0;
}

/* The longest run of full pixels in column x that touches rows from to end. */
static bool find_run(const bst_locate_frame *f, int x, int from, int end, int *top, int *bottom) {
    bool found = false;
    for (int y = from; y <= end; y++) {
        if (!is_full(f, x, y)) {
            continue;
        }
        int t = y, b = y;
        while (is_full(f, x, t - 1)) {
            t--;
        }
        while (is_full(f, x, b + 1)) {
            b++;
        }
        if (!found || b - t > *bottom - *top) {
            *top = t;
            *bottom = b;
        }
        found = true;
        y = b;
    }
    return found;
}

/* The set about a full pixel, columns to the left of it first. */
static void gather(const bst_locate_frame *f, int x, int y, bleed_set *out) {
    int top, bottom, left = x;
    (void)find_run(f, x, y, y, &top, &bottom);
    int t = top, b = bottom;
    while (x - left + 1 < MOST_COLUMNS / 2 && find_run(f, left - 1, t - 1, b + 1, &t, &b)) {
        left--;
    }
    *out = (bleed_set){.x0 = left, .first = top, .last = bottom};
    t = top;
    b = bottom;
    for (int u = x; u >= left; u--) {
        out->top[u - left] = t;
        out->bottom[u - left] = b;
        if (u > left) {
            (void)find_run(f, u - 1, t - 1, b + 1, &t, &b);
        }
    }
    out->columns = x - left + 1;
    t = top;
    b = bottom;
    while (out->columns < MOST_COLUMNS &&
           find_run(f, out->x0 + out->columns, t - 1, b + 1, &t, &b)) {
        out->top[out->columns] = t;
        out->bottom[out->columns++] = b;
    }
    for (int k = 0; k < out->columns; k++) {
        out->first = out->top[k] < out->first ? out->top[k] : out->first;
        out->last = out->bottom[k] > out->last ? out->bottom[k] : out->last;
    }
}

/* Whether a candidate is one of a set's: on it, beside it, or at an end of one of its columns. */
static bool belongs(const bleed_set *set, const bst_imgproc_found *found) {
    int k = found->peak_x - set->x0;
    if (k < -1 || k > set->columns) {
        return false;
    }
    k = k < 0 ? 0 : k >= set->columns ? set->columns - 1 : k;
    return found->peak_y >= set->top[k] - 2 && found->peak_y <= set->bottom[k] + 2;
}

static double beside(const bst_locate_frame *f, const bleed_set *set, int y) {
    return light(f, set->x0 - 1, y) + light(f, set->x0 + set->columns, y);
}

/* Charge of a set and of the light about it. */
static double charge_of(const bst_locate_frame *f, const bleed_set *set, int reach) {
    double well = f->camera->full_well_e * f->binning * f->binning, sum = 0.0;
    for (int y = set->first - reach; y <= set->last + reach; y++) {
        for (int x = set->x0 - reach; x < set->x0 + set->columns + reach; x++) {
            sum += is_full(f, x, y) ? well - bst_background_level_at(f->background, x, y)
                                    : light(f, x, y);
        }
    }
    return sum;
}

/* Puts a source where its light beside the full columns is the highest. In a row, of a Gaussian's
 * values L and R at places l and r: ln(L / R) = ((r - x)^2 - (l - x)^2) / (2 sigma^2). */
static void start_beside(const bst_locate_frame *f, const bleed_set *set, bst_imgproc_found *out) {
    int best = set->first;
    for (int y = set->first; y <= set->last; y++) {
        best = beside(f, set, y) > beside(f, set, best) ? y : best;
    }
    double sum = 0.0, moment = 0.0, left = 0.0, right = 0.0;
    int reach = 1 + (int)ceil(f->sigma_px);
    for (int y = best - reach; y <= best + reach; y++) {
        double s = fmax(beside(f, set, y), 0.0);
        sum += s;
        moment += s * y;
        left += light(f, set->x0 - 1, y);
        right += light(f, set->x0 + set->columns, y);
    }
    double l = set->x0 - 1, r = set->x0 + set->columns, x = 0.5 * (l + r);
    if (left > 0.0 && right > 0.0) {
        double off = f->sigma_px * f->sigma_px * log(left / right) / (r - l);
        x -= fmax(fmin(off, 0.4 * (r - l)), -0.4 * (r - l));
    }
    out->top_x_px = x;
    out->top_y_px = sum > 0.0 ? moment / sum : 0.5 * (set->first + set->last);
}

/* Overflow fills the pixel beyond each end of a column in part. */
static void cut_ends(const bst_locate_frame *f, const bleed_set *set) {
    for (int k = 0; k < set->columns; k++) {
        if (set->top[k] > 0) {
            *at(f, set->x0 + k, set->top[k] - 1) = BST_PIXEL_BAD;
        }
        if (set->bottom[k] + 1 < f->height) {
            *at(f, set->x0 + k, set->bottom[k] + 1) = BST_PIXEL_BAD;
        }
    }
}

/* A full pixel among the nine about a candidate's maximum. */
static bool find_full(const bst_locate_frame *f, const bst_imgproc_found *found, int *x, int *y) {
    for (int k = 0; k < 9; k++) {
        /* the maximum itself first */
        *x = found->peak_x + (k + 1) % 3 - 1;
        *y = found->peak_y + (k / 3 + 1) % 3 - 1;
        if (is_full(f, *x, *y)) {
            return true;
        }
    }
    return false;
}

static void begin_source(const bst_locate_frame *f, const bleed_set *set, bst_imgproc_found *out) {
    int reach = (int)bst_deblend_reach(f);
    out->bleed_e = charge_of(f, set, reach);
    bool drawn = f->filter->streak && set->columns > 2 * reach + 1;
    if (!drawn) {
        out->bleed = true;
        out->bleed_px = set->columns;
        out->streak = false;
        start_beside(f, set, out);
        out->source.flux_e = out->bleed_e;
        out->source.shape = (bst_imgproc_shape){
            .x_px = out->top_x_px, .y_px = out->top_y_px, .sigma_px = f->sigma_px};
    }
}

void bst_blooming_join(bst_imgproc_locator *l, const bst_locate_frame *f) {
    if (f->camera->detector.saturation != BST_WELL_BLOOM) {
        return;
    }
    bleed_set set;
    int sets = 0;
    for (int i = 0; i < l->count && sets < MOST_SETS; i++) {
        int x, y;
        if (l->found[i].dropped || !find_full(f, &l->found[i], &x, &y)) {
            continue;
        }
        gather(f, x, y, &set);
        begin_source(f, &set, &l->found[i]);
        cut_ends(f, &set);
        sets++;
        for (int k = i + 1; k < l->count; k++) {
            l->found[k].dropped = l->found[k].dropped || belongs(&set, &l->found[k]);
        }
    }
}

bool bst_blooming_fit(const bst_imgproc_worker *w, int i, bst_imgproc_found *found) {
    const bst_locate_frame *f = w->f;
    double reach = bst_deblend_reach(f) + 0.5 * found->bleed_px;
    bst_imgproc_stamp stamp =
        bst_fit_stamp(&found->source, reach, w->l->max_side, f->width, f->height);
    bst_imgproc_source start = found->source;
    for (int k = 0; k < 2; k++) {
        found->source = start;
        if (bst_deblend_fit(w, i, found, &stamp, k == 0) &&
            found->source.chi_square < MOST_MISFIT * found->source.pixels) {
            return true;
        }
    }
    found->source = start;
    return false;
}

void bst_blooming_finish(const bst_locate_frame *f, bst_imgproc_found *found) {
    bst_imgproc_source *s = &found->source;
    double width = UNFITTED_SHARE * found->bleed_px;
    if (s->fitted) {
        double misfit = s->chi_square / fmax(s->pixels - 4.0, 1.0);
        misfit = 1.0 + MISFIT_WEIGHT * fmax(misfit - 1.0, 0.0);
        double floor = FLOOR_SHARE * found->bleed_px;
        s->cov_xx = misfit * s->cov_xx + floor * floor;
        s->cov_xy *= misfit;
        s->cov_yy = misfit * s->cov_yy + floor * floor;
    } else {
        s->shape.x_px = found->top_x_px;
        s->shape.y_px = found->top_y_px;
        s->cov_xx = s->cov_yy = fmax(width * width, UNFITTED_PX * UNFITTED_PX);
        s->cov_xy = 0.0;
    }
    double well = WELL_SHARE * found->bleed_e;
    s->flux_e = found->bleed_e;
    s->flux_variance = found->bleed_e + well * well;
    found->snr = s->flux_e * bst_locate_norm(f, false) / found->noise_e;
    found->flags |= BST_DETECTION_SATURATED | BST_DETECTION_BLOOM;
    found->length_px = found->width_px = BST_FWHM_PER_SIGMA * f->sigma_px;
    found->angle_rad = 0.0;
}
