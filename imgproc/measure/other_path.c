#include "imgproc/measure/other_path.h"

#include <assert.h>
#include <math.h>

#include "imgproc/measure/peak_centroid.h"
#include "imgproc/measure/source_moments.h"
#include "sim/onboard/other_path.h"

/* nodes of a path */
enum { NODES = 33 };
/* The ends of another path are so far apart: what the roll of the camera changes in a field is
 * less. */
static const double LEAST_OTHER_PX = 0.3;

/* Length that moments have of a uniform streak of a star, px: a Gaussian window of twice its
 * covariance weighs the ends least (bst_fit_moments). */
static double length_of_star(const bst_imgproc_worker *w, const bst_imgproc_found *found,
                             double path_px) {
    const double sigma = w->l->profiles.sigma_px;
    const double base = sigma * sigma + fmax(found->source.widening_px2, 0.0) + 1.0 / 12.0;
    const double window = 2.0 * (base + path_px * path_px / 12.0), both = base + window;
    double all = 0.0, square = 0.0;
    for (int k = 0; k < NODES; k++) {
        const double u = ((k + 0.5) / NODES - 0.5) * path_px, weight = exp(-0.5 * u * u / both);
        all += weight;
        square += weight * u * u;
    }
    const double seen = window / both * (base + window / both * square / all);
    return BST_FWHM_PER_SIGMA * sqrt(1.0 / (1.0 / seen - 1.0 / window) - 1.0 / 12.0);
}

/* True if moments say that a star's streak may have another path. */
static bool is_suspicious(const bst_imgproc_worker *w, const bst_imgproc_found *found,
                          const double star[2]) {
    const double path = hypot(star[0], star[1]), expected = length_of_star(w, found, path);
    const double apart = bst_paths_apart_px(found->length_px * cos(found->angle_rad),
                                            found->length_px * sin(found->angle_rad),
                                            star[0] / path * expected, star[1] / path * expected);
    return apart > BST_OTHER_PATH_PX + BST_OTHER_PATH_SHARE * expected;
}

/* The fit of a source with a path, on a stamp; chi-square is infinite if it fails. */
static bst_imgproc_source fit_path(const bst_imgproc_worker *w, int i, bst_imgproc_found *found,
                                   const bst_imgproc_stamp *stamp, const double path[2]) {
    found->source.shape.dx_px = path[0];
    found->source.shape.dy_px = path[1];
    if (!bst_deblend_fit(w, i, found, stamp, false)) {
        found->source.chi_square = INFINITY;
    }
    return found->source;
}

/* True if a source's path explains its pixels, and that of stars does not. */
static bool is_other(const bst_imgproc_worker *w, int i, const bst_imgproc_found *found,
                     const double star[2]) {
    const bst_imgproc_shape *s = &found->source.shape;
    const double own[2] = {s->dx_px, s->dy_px};
    if (bst_paths_apart_px(own[0], own[1], star[0], star[1]) < LEAST_OTHER_PX) {
        return false;
    }
    bst_imgproc_source longest = found->source;
    longest.shape.dx_px = fmax(fabs(own[0]), fabs(star[0]));
    longest.shape.dy_px = fmax(fabs(own[1]), fabs(star[1]));
    const bst_imgproc_stamp stamp = bst_deblend_stamp(w->l, w->f, &longest);
    bst_imgproc_found trial = *found;
    const bst_imgproc_source mine = fit_path(w, i, &trial, &stamp, own);
    trial.source = found->source;
    const bst_imgproc_source theirs = fit_path(w, i, &trial, &stamp, star);
    const double free = mine.pixels, left = mine.chi_square - free - 2.0 * sqrt(2.0 * free);
    return theirs.chi_square - mine.chi_square > BST_OTHER_PATH_GAIN + fmax(left, 0.0);
}

/* Lowest chi-square along a line of paths: a parabola through three of them. */
static void step_along(const bst_imgproc_worker *w, int i, bst_imgproc_found *found,
                       const bst_imgproc_stamp *stamp, const double way[2]) {
    const bst_imgproc_source start = found->source;
    bst_imgproc_source best = start, at[3];
    double share = 0.0;
    for (int k = 0; k < 4; k++) {
        const double by = k < 3 ? k - 1.0 : share;
        found->source = start;
        const double path[2] = {start.shape.dx_px + by * way[0], start.shape.dy_px + by * way[1]};
        const bst_imgproc_source now = fit_path(w, i, found, stamp, path);
        best = k == 0 || now.chi_square < best.chi_square ? now : best;
        if (k < 3) {
            at[k] = now;
        }
        if (k == 2) {
            const double low = at[0].chi_square, high = at[2].chi_square;
            const double bend = low + high - 2.0 * at[1].chi_square;
            share = isfinite(bend) && bend > 0.0 ? 0.5 * (low - high) / bend : 0.0;
            share = fmax(-1.0, fmin(share, 1.0));
        }
    }
    found->source = best;
}

/* Fits a streak with a path of its own: by its moments, then by chi-square along and across. */
static void fit_own(const bst_imgproc_worker *w, int i, bst_imgproc_found *found) {
    static const double STEPS[] = {0.1, 0.03, 0.01, 0.003};
    bst_source_moments_own_streak(w, i, found);
    bst_imgproc_source longest = found->source;
    longest.shape.dx_px *= 1.2;
    longest.shape.dy_px *= 1.2;
    const bst_imgproc_stamp stamp = bst_deblend_stamp(w->l, w->f, &longest);
    for (size_t k = 0; k < sizeof STEPS / sizeof *STEPS; k++) {
        const double dx = found->source.shape.dx_px, dy = found->source.shape.dy_px;
        step_along(w, i, found, &stamp, (const double[2]){STEPS[k] * dx, STEPS[k] * dy});
        step_along(w, i, found, &stamp, (const double[2]){-STEPS[k] * dy, STEPS[k] * dx});
    }
}

/* Fits a streak with a path of its own, and keeps it if that is another one. */
static bool refit(const bst_imgproc_worker *w, int i, bst_imgproc_found *found,
                  const double star[2]) {
    bst_imgproc_found trial = *found;
    fit_own(w, i, &trial);
    if ((trial.flags & BST_DETECTION_BLEND) || !is_other(w, i, &trial, star)) {
        return false;
    }
    trial.streak = trial.own_streak = true;
    *found = trial;
    bst_source_moments_measure(w, i, found, 0.0);
    return true;
}

void bst_other_path_judge(const bst_imgproc_worker *w, int i, bst_imgproc_found *found) {
    assert(w && found && i >= 0 && i < w->l->count);
    const unsigned unclear =
        BST_DETECTION_BLEND | BST_DETECTION_EDGE | BST_DETECTION_SATURATED | BST_DETECTION_BLOOM;
    if (!w->f->filter->streak || !(found->flags & BST_DETECTION_STREAK) ||
        (found->flags & unclear) || found->rough || found->label != BST_LABEL_UNKNOWN ||
        found->snr < BST_EXTENT_SNR) {
        return;
    }
    bst_imgproc_shape shape = found->source.shape;
    bst_peak_centroid_star_path(w->f, &shape);
    const double star[2] = {shape.dx_px, shape.dy_px};
    const bool own = found->own_streak || found->own_path;
    const double fwhm_px = BST_FWHM_PER_SIGMA * w->l->profiles.sigma_px;
    const bool brief = hypot(star[0], star[1]) < BST_OTHER_PATH_SHORT_FWHM * fwhm_px;
    if (brief && (found->length_px <= BST_OTHER_PATH_LONG_SHARE * found->width_px || !own)) {
        return;
    }
    if (!found->streak || (own && is_other(w, i, found, star)) ||
        (!brief && !w->f->uneven && (own || is_suspicious(w, found, star)) &&
         refit(w, i, found, star))) {
        found->flags |= BST_DETECTION_OTHER_PATH;
    }
}
