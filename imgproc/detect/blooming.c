#include "imgproc/detect/blooming.h"

#include <math.h>

#include "imgproc/measure/cosmic_ray.h"

enum { MOST_COLUMNS = 96, MOST_SETS = 256 };

/* Relative uncertainty of the pixels' full well. */
static const double WELL_SHARE = 0.02;
/* Largest mean square deviation, sigma^2, of an accepted fit to the PSF wings. */
static const double MOST_MISFIT = 25.0;
/* Weight of the misfit in the covariance: residuals of neighbouring pixels are correlated through
 * PSF errors (tests/imgproc/test_blooming.c). */
static const double MISFIT_WEIGHT = 3.0;
/* Standard error of a position fitted to the wings, relative to the bleed width, for a PSF 8 %
 * wider than assumed (tests/imgproc/test_blooming.c). */
static const double FLOOR_SHARE = 0.004;
/* Standard error of a position without a fit: relative to the bleed width, and its least value, px.
 * It is three times the largest error of start_position in tests/imgproc/test_blooming.c. */
static const double UNFITTED_SHARE = 0.03, UNFITTED_PX = 0.1;

/* Connected saturated pixels of a blooming source: for each column from x0 on, the first and last
 * row. */
typedef struct bleed_set {
    int x0, columns;
    int top[MOST_COLUMNS], bottom[MOST_COLUMNS];
    int first, last; /* extreme rows of all columns */
} bleed_set;

/* Signal of a pixel, e- above the background. */
static float *signal_at(const bst_locate_frame *f, int x, int y) {
    return &f->signal[(size_t)y * (size_t)f->width + (size_t)x];
}

/* True if a pixel is saturated. */
static bool is_saturated(const bst_locate_frame *f, int x, int y) {
    return x >= 0 && y >= 0 && x < f->width && y < f->height &&
           *signal_at(f, x, y) == BST_PIXEL_SATURATED;
}

/* Signal above the background at a pixel, e-; 0 outside the frame or without a measurement. */
static double signal_or_zero(const bst_locate_frame *f, int x, int y) {
    bool inside = x >= 0 && y >= 0 && x < f->width && y < f->height;
    return inside && *signal_at(f, x, y) > BST_PIXEL_NONE ? (double)*signal_at(f, x, y) : 0.0;
}

/* Longest run of saturated pixels in column x that touches rows `from` to `end`. */
static bool find_run(const bst_locate_frame *f, int x, int from, int end, int *top, int *bottom) {
    bool found = false;
    for (int y = from; y <= end; y++) {
        if (!is_saturated(f, x, y)) {
            continue;
        }
        int t = y, b = y;
        while (is_saturated(f, x, t - 1)) {
            t--;
        }
        while (is_saturated(f, x, b + 1)) {
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

/* Collects the saturated columns connected to a saturated pixel, first to the left, then to the
 * right. */
static void collect_bleed_columns(const bst_locate_frame *f, int x, int y, bleed_set *out) {
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

/* True if a candidate lies on a bleed set, beside it, or at the end of one of its columns. */
static bool is_part_of_bleed(const bleed_set *set, const bst_imgproc_found *found) {
    int k = found->peak_x - set->x0;
    if (k < -1 || k > set->columns) {
        return false;
    }
    k = k < 0 ? 0 : k >= set->columns ? set->columns - 1 : k;
    return found->peak_y >= set->top[k] - 2 && found->peak_y <= set->bottom[k] + 2;
}

/* Signal of the two pixels left and right of a bleed set in row y, e-. */
static double beside(const bst_locate_frame *f, const bleed_set *set, int y) {
    return signal_or_zero(f, set->x0 - 1, y) + signal_or_zero(f, set->x0 + set->columns, y);
}

/* Charge of a bleed set and of the light within `reach` px of it, e-. */
static double bleed_charge(const bst_locate_frame *f, const bleed_set *set, int reach) {
    double well = f->camera->full_well_e * f->binning * f->binning, sum = 0.0;
    for (int y = set->first - reach; y <= set->last + reach; y++) {
        for (int x = set->x0 - reach; x < set->x0 + set->columns + reach; x++) {
            sum += is_saturated(f, x, y) ? well - bst_background_level_at(f->background, x, y)
                                         : signal_or_zero(f, x, y);
        }
    }
    return sum;
}

/* Start position of a saturated source: the row where the light beside the saturated columns peaks.
 * In that row, for a Gaussian with values L, R at columns l, r: ln(L / R) = ((r - x)^2 - (l - x)^2)
 * / (2 sigma^2). */
static void start_position(const bst_locate_frame *f, const bleed_set *set,
                           bst_imgproc_found *out) {
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
        left += signal_or_zero(f, set->x0 - 1, y);
        right += signal_or_zero(f, set->x0 + set->columns, y);
    }
    double l = set->x0 - 1, r = set->x0 + set->columns, x = 0.5 * (l + r);
    if (left > 0.0 && right > 0.0) {
        double off = f->sigma_px * f->sigma_px * log(left / right) / (r - l);
        x -= fmax(fmin(off, 0.4 * (r - l)), -0.4 * (r - l));
    }
    out->top_x_px = x;
    out->top_y_px = sum > 0.0 ? moment / sum : 0.5 * (set->first + set->last);
}

/* Masks the pixel beyond each end of a saturated column, which overflow fills in part. */
static void mask_bleed_ends(const bst_locate_frame *f, const bleed_set *set) {
    for (int k = 0; k < set->columns; k++) {
        if (set->top[k] > 0) {
            *signal_at(f, set->x0 + k, set->top[k] - 1) = BST_PIXEL_BAD;
        }
        if (set->bottom[k] + 1 < f->height) {
            *signal_at(f, set->x0 + k, set->bottom[k] + 1) = BST_PIXEL_BAD;
        }
    }
}

/* Finds a saturated pixel among the 3 x 3 about a candidate's maximum. */
static bool find_saturated(const bst_locate_frame *f, const bst_imgproc_found *found, int *x,
                           int *y) {
    for (int k = 0; k < 9; k++) {
        /* the maximum itself first */
        *x = found->peak_x + (k + 1) % 3 - 1;
        *y = found->peak_y + (k / 3 + 1) % 3 - 1;
        if (is_saturated(f, *x, *y)) {
            return true;
        }
    }
    return false;
}

/* Initial source of a bleed set: position, flux and shape before the fit. */
static void initial_bleed_source(const bst_locate_frame *f, const bleed_set *set,
                                 bst_imgproc_found *out) {
    int reach = (int)bst_deblend_reach(f);
    out->bleed_e = bleed_charge(f, set, reach);
    bool drawn = f->filter->streak && set->columns > 2 * reach + 1;
    if (!drawn) {
        out->bleed = true;
        out->bleed_px = set->columns;
        out->streak = false;
        start_position(f, set, out);
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
        if (l->found[i].dropped || !find_saturated(f, &l->found[i], &x, &y)) {
            continue;
        }
        collect_bleed_columns(f, x, y, &set);
        initial_bleed_source(f, &set, &l->found[i]);
        mask_bleed_ends(f, &set);
        sets++;
        for (int k = i + 1; k < l->count; k++) {
            l->found[k].dropped = l->found[k].dropped || is_part_of_bleed(&set, &l->found[k]);
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

void bst_blooming_finish(const bst_locate_frame *f, double norm, bst_imgproc_found *found) {
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
    found->snr = s->flux_e * norm / found->noise_e;
    found->flags |= BST_DETECTION_SATURATED | BST_DETECTION_BLOOM;
    found->length_px = found->width_px = BST_FWHM_PER_SIGMA * f->sigma_px;
    found->angle_rad = 0.0;
}
