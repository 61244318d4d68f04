#include "imgproc/measure/deblend.h"

#include <assert.h>
#include <math.h>

#include "imgproc/measure/cosmic_ray.h"

/* Half side of the fitted stamp. REACH_SIGMAS: of a Gaussian's light 6e-4 lies outside of the
 * square (tests/imgproc/calibrate_deblend.c). LEAST_REACH_PX, design choice: 49 pixels for the
 * three parameters of the narrowest PSF, most of them with sky only, which determine the fit's
 * level. */
static const double REACH_SIGMAS = 3.6, LEAST_REACH_PX = 3.0;
/* A centre moves by at most LIMIT_PX, one sigma and LIMIT_PER_PATH of the path. Calibrated by
 * tests/imgproc/calibrate_deblend.c: of fits beside neighbours 99 % move by less than a third of
 * it, and the farthest of points by all of it, of streaks by 0.3 of it. */
static const double LIMIT_PX = 1.5, LIMIT_PER_PATH = 0.4;
/* Fits that end this near to one another are of one source: sqrt(2) sigma, where the images of two
 * equal sources have a correlation of exp(-1/2) (Gaussian: exp(-d^2 / (4 sigma^2))). */
static const double SAME_FWHM = 0.6;
/* Neighbours up to a pixel outside of the stamp's border, 1.5 px from its outermost pixel's centre,
 * are fitted with the source: at 1.5 to 3 px FWHM 6 to 22 % of their light is inside. */
static const double FREE_OUTSIDE_PX = 1.5;

double bst_deblend_reach(const bst_locate_frame *f) {
    return fmax(LEAST_REACH_PX, ceil(REACH_SIGMAS * f->sigma_px));
}

double bst_deblend_fit_limit(const bst_locate_frame *f, double path_px) {
    return LIMIT_PX + f->sigma_px + LIMIT_PER_PATH * path_px;
}

/* How far the longest path of the frame (half its length and its bend: longest_px) reaches from its
 * maximum, without the limit of a point: half the path, and LIMIT_PER_PATH of all of it. */
static double path_margin(const bst_imgproc_locator *l) {
    return (1.0 + 2.0 * LIMIT_PER_PATH) * l->longest_px;
}

bst_imgproc_stamp bst_deblend_stamp(const bst_imgproc_locator *l, const bst_locate_frame *f,
                                    const bst_imgproc_source *s) {
    return bst_fit_stamp(s, bst_deblend_reach(f), l->max_side, f->width, f->height);
}

void bst_deblend_index(bst_imgproc_locator *l, const bst_locate_frame *f) {
    assert(l && f && l->count >= 0 && l->count <= l->capacity && f->width > 0 && f->height > 0);
    l->columns = f->width / BST_LOCATE_CELL_PX + 1;
    l->rows = f->height / BST_LOCATE_CELL_PX + 1;
    for (int i = 0; i < l->columns * l->rows; i++) {
        l->cell[i] = -1;
    }
    for (int i = l->count - 1; i >= 0; i--) {
        int *cell = &l->cell[l->found[i].peak_y / BST_LOCATE_CELL_PX * l->columns +
                             l->found[i].peak_x / BST_LOCATE_CELL_PX];
        l->found[i].next = *cell;
        *cell = i;
    }
}

/* First and last cell of the source index, along one axis, that can hold maxima within margin_px of
 * a pixel range. */
static void cell_range(double from, double to, double margin_px, int cells, int *first, int *last) {
    double lo = floor((from - margin_px) / BST_LOCATE_CELL_PX),
           hi = floor((to + margin_px) / BST_LOCATE_CELL_PX);
    *first = lo < 0.0 ? 0 : lo > cells - 1 ? cells - 1 : (int)lo;
    *last = hi < 0.0 ? 0 : hi > cells - 1 ? cells - 1 : (int)hi;
}

void bst_deblend_gather(const bst_imgproc_locator *l, const bst_locate_frame *f, int i,
                        const bst_imgproc_source *own, const bst_imgproc_stamp *stamp,
                        bst_deblend *out) {
    assert(l && f && own && stamp && out && i >= 0 && i < l->count);
    out->free[0] = own;
    out->free_count = 1;
    out->fixed_count = 0;
    /* a fit moves a source from its maximum by its limit at most; a pixel for rounding */
    double margin = bst_deblend_reach(f) + path_margin(l) + bst_deblend_fit_limit(f, 0.0) + 1.0;
    int first_column, last_column, first_row, last_row;
    cell_range(stamp->x0, stamp->x0 + stamp->width, margin, l->columns, &first_column,
               &last_column);
    cell_range(stamp->y0, stamp->y0 + stamp->height, margin, l->rows, &first_row, &last_row);
    int near[BST_DEBLEND_MAX_FIXED + BST_FIT_MAX_FREE], count = 0,
                                                        across = last_column - first_column + 1;
    for (int c = 0; c < across * (last_row - first_row + 1); c++) {
        int cell = (first_row + c / across) * l->columns + first_column + c % across;
        for (int k = l->cell[cell]; k >= 0; k = l->found[k].next) {
            if (k == i || l->found[k].dropped || bst_label_is_charge(l->found[k].label)) {
                continue;
            }
            bst_imgproc_stamp other = bst_fit_stamp(&l->found[k].source, bst_deblend_reach(f),
                                                    l->max_side, f->width, f->height);
            if (other.x0 >= stamp->x0 + stamp->width || stamp->x0 >= other.x0 + other.width ||
                other.y0 >= stamp->y0 + stamp->height || stamp->y0 >= other.y0 + other.height) {
                continue;
            }
            /* keep the brightest neighbours, sorted by index */
            int at = count;
            while (at > 0 && near[at - 1] > k) {
                at--;
            }
            if (count == BST_DEBLEND_MAX_FIXED + BST_FIT_MAX_FREE && at == count) {
                continue;
            }
            count += count < BST_DEBLEND_MAX_FIXED + BST_FIT_MAX_FREE;
            for (int m = count - 1; m > at; m--) {
                near[m] = near[m - 1];
            }
            near[at] = k;
        }
    }
    for (int n = 0; n < count; n++) {
        const bst_imgproc_source *s = &l->found[near[n]].source;
        bool inside = s->shape.x_px >= stamp->x0 - FREE_OUTSIDE_PX &&
                      s->shape.y_px >= stamp->y0 - FREE_OUTSIDE_PX &&
                      s->shape.x_px <= stamp->x0 + stamp->width - 1 + FREE_OUTSIDE_PX &&
                      s->shape.y_px <= stamp->y0 + stamp->height - 1 + FREE_OUTSIDE_PX;
        if (inside && out->free_count < BST_FIT_MAX_FREE) {
            out->free[out->free_count++] = s;
        } else if (out->fixed_count < BST_DEBLEND_MAX_FIXED) {
            out->fixed[out->fixed_count++] = s;
        }
    }
}

bool bst_deblend_fit(const bst_imgproc_worker *w, int i, bst_imgproc_found *found,
                     const bst_imgproc_stamp *stamp, bool free_width) {
    assert(w && found && stamp && i >= 0 && i < w->l->count);
    const bst_locate_frame *f = w->f;
    bst_deblend c;
    bst_deblend_gather(w->l, f, i, &found->source, stamp, &c);
    bst_imgproc_source copies[BST_FIT_MAX_FREE];
    bst_imgproc_source *free_sources[BST_FIT_MAX_FREE];
    for (int k = 0; k < c.free_count; k++) {
        copies[k] = *c.free[k];
        copies[k].shape.sigma_px = w->l->profiles.sigma_px;
        free_sources[k] = &copies[k];
    }
    bst_fit_data data = {f->signal, f->width, f->height, found->noise_e, f->excess};
    bst_fit_request request = {
        .data = &data,
        .stamp = stamp,
        .free = free_sources,
        .free_count = c.free_count,
        .fixed = c.fixed,
        .fixed_count = c.fixed_count,
        .free_width = free_width && c.free_count == 1,
        .limit_px = bst_deblend_fit_limit(f, hypot(copies[0].shape.dx_px, copies[0].shape.dy_px))};
    bool ok = bst_fit_run(w->fit, &request);
    if (!ok && c.free_count > 1) {
        /* The pixels do not constrain a neighbour, e.g. at the stamp's edge: it stays fixed. */
        for (int k = 1; k < c.free_count && request.fixed_count < BST_DEBLEND_MAX_FIXED; k++) {
            c.fixed[request.fixed_count++] = c.free[k];
        }
        copies[0] = *c.free[0];
        copies[0].shape.sigma_px = w->l->profiles.sigma_px;
        request.free_count = 1;
        ok = bst_fit_run(w->fit, &request);
    }
    if (ok) {
        found->source = copies[0];
    }
    found->neighbours = c.free_count - 1 + c.fixed_count;
    if (c.free_count > 1) {
        found->flags |= BST_DETECTION_BLEND;
    }
    return ok;
}

void bst_deblend_drop_doubles(bst_imgproc_locator *l, const bst_locate_frame *f, int end) {
    assert(l && f && end >= 0 && end <= l->count);
    double radius = SAME_FWHM * BST_FWHM_PER_SIGMA * f->sigma_px;
    /* both may have moved by their limits */
    double margin = radius + path_margin(l) + 2.0 * bst_deblend_fit_limit(f, 0.0);
    for (int i = 0; i < end; i++) {
        const bst_imgproc_shape *a = &l->found[i].source.shape;
        int x0, x1, y0, y1;
        cell_range(a->x_px, a->x_px, margin, l->columns, &x0, &x1);
        cell_range(a->y_px, a->y_px, margin, l->rows, &y0, &y1);
        for (int c = 0; c < (x1 - x0 + 1) * (y1 - y0 + 1); c++) {
            int cell = (y0 + c / (x1 - x0 + 1)) * l->columns + x0 + c % (x1 - x0 + 1);
            for (int k = l->cell[cell]; k >= 0; k = l->found[k].next) {
                const bst_imgproc_shape *b = &l->found[k].source.shape;
                /* indices are by brightness: drop the fainter one */
                if (k < i && !l->found[k].dropped &&
                    bst_label_is_charge(l->found[k].label) ==
                        bst_label_is_charge(l->found[i].label) &&
                    hypot(a->x_px - b->x_px, a->y_px - b->y_px) < radius) {
                    l->found[i].dropped = true;
                }
            }
        }
    }
}
