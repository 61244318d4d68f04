#include "imgproc/measure/source_moments.h"

#include <assert.h>
#include <math.h>

#include "imgproc/measure/cosmic_ray.h"

/* Largest change of the path's length per round, share: the three chi-squares of the parabola. */
static const double MOST_STEP = 0.2;

bool bst_source_moments_measure(const bst_imgproc_worker *w, int i, bst_imgproc_found *found,
                                double wider) {
    assert(w && found && i >= 0 && i < w->l->count);
    const bst_locate_frame *f = w->f;
    const bst_imgproc_shape *s = &found->source.shape;
    double base = s->sigma_px * s->sigma_px + fmax(found->source.widening_px2, 0.0);
    double m[3];
    bst_imgproc_shape_path_variance(s, m);
    m[0] += base;
    m[2] += base;
    bool measured = false;
    if (found->snr >= BST_EXTENT_SNR && !(found->flags & BST_DETECTION_EDGE)) {
        bst_imgproc_stamp stamp = bst_fit_stamp(&found->source, bst_deblend_reach(f) + wider,
                                                w->l->max_side, f->width, f->height);
        bst_deblend c;
        c.free_count = c.fixed_count = 0;
        if (!found->rough) {
            bst_deblend_gather(w->l, f, i, &found->source, &stamp, &c);
        }
        const bst_imgproc_source *others[BST_FIT_MAX_FREE + BST_DEBLEND_MAX_FIXED];
        int count = 0;
        for (int k = 1; k < c.free_count; k++) {
            others[count++] = c.free[k];
        }
        for (int k = 0; k < c.fixed_count; k++) {
            others[count++] = c.fixed[k];
        }
        bst_fit_data data = {f->signal, f->width, f->height, found->noise_e, f->excess};
        double d[3];
        if (bst_fit_moments(w->fit, &data, &stamp, &found->source, others, count, d)) {
            /* subtract the pixel's own variance */
            d[0] = fmax(d[0] - 1.0 / 12.0, 0.01);
            d[2] = fmax(d[2] - 1.0 / 12.0, 0.01);
            if (d[0] * d[2] > d[1] * d[1]) {
                m[0] = d[0];
                m[1] = d[1];
                m[2] = d[2];
                measured = true;
            }
        }
    }
    double mean = 0.5 * (m[0] + m[2]), half = hypot(0.5 * (m[0] - m[2]), m[1]);
    double limit = 0.5 * w->l->max_side;
    found->length_px = fmin(BST_FWHM_PER_SIGMA * sqrt(mean + half), limit);
    found->width_px = fmin(BST_FWHM_PER_SIGMA * sqrt(fmax(mean - half, 0.0)), limit);
    found->angle_rad = half > 1e-9 * mean ? 0.5 * atan2(2.0 * m[1], m[0] - m[2]) : 0.0;
    return measured;
}

/* Chi-square of the source fitted as a streak of `path` px along `angle`; infinity if the fit
 * fails. */
static double chi_square_of_path(const bst_imgproc_worker *w, int i, bst_imgproc_found *found,
                                 const bst_imgproc_stamp *stamp,
                                 const bst_imgproc_source *start_from, double path, double angle) {
    found->source = *start_from;
    found->source.shape.dx_px = path * cos(angle);
    found->source.shape.dy_px = path * sin(angle);
    return bst_deblend_fit(w, i, found, stamp, false) ? found->source.chi_square : INFINITY;
}

void bst_source_moments_own_streak(const bst_imgproc_worker *w, int i, bst_imgproc_found *found) {
    const bst_locate_frame *f = w->f;
    double psf_fwhm = BST_FWHM_PER_SIGMA * w->l->profiles.sigma_px;
    for (int round = 0; round < 4; round++) {
        if (!bst_source_moments_measure(w, i, found, 2.0 * bst_deblend_reach(f)) ||
            found->length_px < BST_OWN_STREAK_LENGTH * psf_fwhm) {
            return;
        }
        double spread = (found->length_px * found->length_px - psf_fwhm * psf_fwhm) /
                        (BST_FWHM_PER_SIGMA * BST_FWHM_PER_SIGMA);
        double path = fmin(sqrt(12.0 * spread), 0.4 * w->l->max_side), angle = found->angle_rad;
        bst_imgproc_found before = *found;
        bst_imgproc_source longest = before.source;
        longest.shape.dx_px = (1.0 + MOST_STEP) * path * cos(angle);
        longest.shape.dy_px = (1.0 + MOST_STEP) * path * sin(angle);
        bst_imgproc_stamp stamp = bst_deblend_stamp(w->l, f, &longest);
        double old_path = hypot(before.source.shape.dx_px, before.source.shape.dy_px);
        double old_angle = atan2(before.source.shape.dy_px, before.source.shape.dx_px);
        double old_chi =
            chi_square_of_path(w, i, found, &stamp, &before.source, old_path, old_angle);
        double low = chi_square_of_path(w, i, found, &stamp, &before.source,
                                        (1.0 - MOST_STEP) * path, angle);
        double high = chi_square_of_path(w, i, found, &stamp, &before.source,
                                         (1.0 + MOST_STEP) * path, angle);
        double chi = chi_square_of_path(w, i, found, &stamp, &before.source, path, angle);
        double bend = low + high - 2.0 * chi, step = 0.0;
        if (isfinite(bend)) {
            step = bend > 0.0   ? 0.5 * MOST_STEP * (low - high) / bend
                   : low < high ? -MOST_STEP
                                : MOST_STEP;
            step = fmax(-MOST_STEP, fmin(step, MOST_STEP));
            chi =
                chi_square_of_path(w, i, found, &stamp, &before.source, path * (1.0 + step), angle);
        }
        if (!(chi < old_chi - BST_OWN_STREAK_GAIN)) {
            *found = before;
            return;
        }
        found->streak = true;
        found->snr = found->source.flux_e * bst_fit_norm(w->fit, &stamp) / found->noise_e;
    }
}
