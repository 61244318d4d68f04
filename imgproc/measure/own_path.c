#include "imgproc/measure/own_path.h"

#include <assert.h>
#include <math.h>

#include "imgproc/measure/peak_centroid.h"
#include "imgproc/measure/source_moments.h"

enum { ROUNDS = 8, HALVINGS = 5 };
/* Step of the derivatives by the path, px, and the change of the path that ends the search. */
static const double STEP_PX = 0.15, SMALL_PX = 0.02;
/* Largest change of the path per round, px and share of it. */
static const double MOST_STEP_PX = 1.0, MOST_STEP = 0.3;
/* 1 sigma per axis of a path before it is measured, px: none where the light shows it. */
static const double PRIOR_PX = 5.0;

/* A star's streak has another path if that differs by so much, and by 5 sigma: what the roll of the
 * camera changes in a field is less. */
static const double LEAST_OTHER_PX = 0.3, LEAST_OTHER_CHI2 = 25.0;

/* A fit at one path. */
typedef struct at_path {
    bst_imgproc_source source;
    double chi_square; /* with the prior; infinity if the fit failed */
} at_path;

/* What is fitted at all paths. */
typedef struct search {
    const bst_imgproc_worker *w;
    int i;
    bst_imgproc_found *found;
    bst_imgproc_source start;
    bst_imgproc_stamp stamp;
} search;

static at_path fit_at(const search *s, double dx, double dy) {
    s->found->source = s->start;
    s->found->source.shape.dx_px = dx;
    s->found->source.shape.dy_px = dy;
    at_path out = {.chi_square = INFINITY};
    if (bst_deblend_fit(s->w, s->i, s->found, &s->stamp, false)) {
        out.source = s->found->source;
        out.chi_square = out.source.chi_square + (dx * dx + dy * dy) / (PRIOR_PX * PRIOR_PX);
    }
    return out;
}

/* Chi-square and place about a path: slopes and curvatures by dx and dy. */
typedef struct around {
    double slope[2], curvature[2][2], by_path[2][2]; /* by_path: place by path */
} around;

static bool look_around(const search *s, const at_path *at, around *out) {
    const double dx = at->source.shape.dx_px, dy = at->source.shape.dy_px, h = STEP_PX;
    const double chi = at->chi_square;
    const at_path plus[2] = {fit_at(s, dx + h, dy), fit_at(s, dx, dy + h)};
    const at_path minus[2] = {fit_at(s, dx - h, dy), fit_at(s, dx, dy - h)};
    const at_path both = fit_at(s, dx + h, dy + h);
    for (int k = 0; k < 2; k++) {
        const bst_imgproc_shape *a = &plus[k].source.shape, *b = &minus[k].source.shape;
        out->slope[k] = (plus[k].chi_square - minus[k].chi_square) / (2.0 * h);
        out->curvature[k][k] = (plus[k].chi_square + minus[k].chi_square - 2.0 * chi) / (h * h);
        out->by_path[0][k] = (a->x_px - b->x_px) / (2.0 * h);
        out->by_path[1][k] = (a->y_px - b->y_px) / (2.0 * h);
    }
    out->curvature[0][1] = out->curvature[1][0] =
        (both.chi_square - plus[0].chi_square - plus[1].chi_square + chi) / (h * h);
    return isfinite(out->curvature[0][0] + out->curvature[1][1] + out->curvature[0][1]);
}

/* Twice the inverse of the curvature, the covariance of the path; false if it is no minimum. */
static bool invert(const around *a, double out[2][2]) {
    const double(*c)[2] = a->curvature;
    const double det = c[0][0] * c[1][1] - c[0][1] * c[0][1];
    if (!(c[0][0] > 0.0) || !(det > 1e-6 * c[0][0] * c[1][1])) {
        return false;
    }
    out[0][0] = 2.0 * c[1][1] / det;
    out[0][1] = out[1][0] = -2.0 * c[0][1] / det;
    out[1][1] = 2.0 * c[0][0] / det;
    return true;
}

/* The path's step to the minimum, limited in length. */
static void step_of(const around *a, const double covariance[2][2], double path_px,
                    double step[2]) {
    for (int k = 0; k < 2; k++) {
        step[k] = -0.5 * (covariance[k][0] * a->slope[0] + covariance[k][1] * a->slope[1]);
    }
    const double far = hypot(step[0], step[1]), most = MOST_STEP_PX + MOST_STEP * path_px;
    if (far > most) {
        step[0] *= most / far;
        step[1] *= most / far;
    }
}

/* Moments of the light less those of PSF and camera's path: the square of the path over 12. Returns
 * the path along the axis of the moments. */
static void path_of_moments(const bst_imgproc_found *found, double psf_fwhm, double path[2]) {
    const double along2 = found->length_px * found->length_px - psf_fwhm * psf_fwhm;
    const double across2 = found->width_px * found->width_px - psf_fwhm * psf_fwhm;
    const double unit = BST_FWHM_PER_SIGMA * BST_FWHM_PER_SIGMA;
    const double c = cos(found->angle_rad), s = sin(found->angle_rad);
    bst_imgproc_shape camera = found->source.shape;
    camera.dx_px = camera.dy_px = 0.0;
    double own[3];
    bst_imgproc_shape_path_variance(&camera, own);
    const double xx = (along2 * c * c + across2 * s * s) / unit - own[0];
    const double xy = (along2 - across2) * c * s / unit - own[1];
    const double yy = (along2 * s * s + across2 * c * c) / unit - own[2];
    const double mean = 0.5 * (xx + yy), half = hypot(0.5 * (xx - yy), xy);
    const double length = sqrt(12.0 * fmax(mean + half, 0.0)),
                 angle = 0.5 * atan2(2.0 * xy, xx - yy);
    path[0] = length * cos(angle);
    path[1] = length * sin(angle);
}

/* Best of the path that the source has and of paths along the axis of its moments, either way: as
 * long as the moments say and as long as that of the source. */
static at_path first_of(const search *s, const double path[2]) {
    const double dx = s->start.shape.dx_px, dy = s->start.shape.dy_px;
    const double as_long = hypot(dx, dy) / fmax(hypot(path[0], path[1]), 1e-6);
    const double share[4] = {1.0, -1.0, as_long, -as_long};
    at_path best = fit_at(s, dx, dy);
    for (int k = 0; k < (as_long > 0.0 ? 4 : 2); k++) {
        const at_path other = fit_at(s, share[k] * path[0], share[k] * path[1]);
        best = other.chi_square < best.chi_square ? other : best;
    }
    return best;
}

/* The fit after a step, which is halved until it lowers chi-square; `at` if none does. */
static at_path after(const search *s, const at_path *at, const double step[2]) {
    double share = 1.0;
    for (int k = 0; k < HALVINGS; k++, share *= 0.5) {
        const at_path next = fit_at(s, at->source.shape.dx_px + share * step[0],
                                    at->source.shape.dy_px + share * step[1]);
        if (next.chi_square < at->chi_square) {
            return next;
        }
    }
    return *at;
}

/* Adds the path's covariance to that of the place. */
static void add_path_covariance(const around *a, const double covariance[2][2],
                                bst_imgproc_source *out) {
    double sum[2][2] = {{0}};
    for (int k = 0; k < 16; k++) {
        const int p = k & 1, q = k >> 1 & 1, m = k >> 2 & 1, n = k >> 3;
        sum[p][q] += a->by_path[p][m] * covariance[m][n] * a->by_path[q][n];
    }
    out->cov_xx += sum[0][0];
    out->cov_xy += 0.5 * (sum[0][1] + sum[1][0]);
    out->cov_yy += sum[1][1];
}

/* True if a path is not that of the stars. */
static bool differs(const bst_imgproc_shape *own, const bst_imgproc_shape *star,
                    const double covariance[2][2]) {
    const double x = own->dx_px - star->dx_px, y = own->dy_px - star->dy_px;
    const double(*c)[2] = covariance;
    const double det = c[0][0] * c[1][1] - c[0][1] * c[0][1];
    const double chi2 = (c[1][1] * x * x - 2.0 * c[0][1] * x * y + c[0][0] * y * y) / det;
    return hypot(x, y) > LEAST_OTHER_PX && chi2 > LEAST_OTHER_CHI2;
}

/* True if stars are streaks, and a path is less than half as long: what nearly moves with the
 * camera is no streak among them. */
static bool is_short(const bst_locate_frame *f, const bst_imgproc_shape *own) {
    bst_imgproc_shape star = *own;
    bst_peak_centroid_star_path(f, &star);
    return f->filter->streak && hypot(own->dx_px, own->dy_px) < 0.5 * hypot(star.dx_px, star.dy_px);
}

void bst_own_path_fit(const bst_imgproc_worker *w, int i, bst_imgproc_found *found) {
    assert(w && found && i >= 0 && i < w->l->count);
    const bst_locate_frame *f = w->f;
    const double psf_fwhm = BST_FWHM_PER_SIGMA * w->l->profiles.sigma_px;
    if (!bst_source_moments_measure(w, i, found, 2.0 * bst_deblend_reach(f))) {
        return;
    }
    const bst_imgproc_found before = *found;
    search s = {.w = w, .i = i, .found = found, .start = found->source};
    s.start.widening_px2 = bst_frame_width_mean(&w->l->width);
    double path[2], covariance[2][2];
    path_of_moments(found, psf_fwhm, path);
    bst_imgproc_source longest = s.start;
    longest.shape.dx_px = fmax(fabs(path[0]), fabs(longest.shape.dx_px)) + 2.0;
    longest.shape.dy_px = fmax(fabs(path[1]), fabs(longest.shape.dy_px)) + 2.0;
    s.stamp = bst_deblend_stamp(w->l, f, &longest);
    const double old_chi = fit_at(&s, s.start.shape.dx_px, s.start.shape.dy_px).chi_square;
    at_path at = first_of(&s, path);
    around a;
    bool good = isfinite(at.chi_square), settled = false;
    for (int round = 0; round < ROUNDS && good && !settled; round++) {
        const double dx = at.source.shape.dx_px, dy = at.source.shape.dy_px;
        double step[2];
        good = look_around(&s, &at, &a) && invert(&a, covariance);
        if (!good) {
            break;
        }
        step_of(&a, covariance, hypot(dx, dy), step);
        const at_path next = after(&s, &at, step);
        settled = hypot(step[0], step[1]) < SMALL_PX || !(next.chi_square < at.chi_square);
        at = next;
        if (settled) { /* the other way round the light is nearly the same */
            const at_path back = fit_at(&s, -at.source.shape.dx_px, -at.source.shape.dy_px);
            settled = !(back.chi_square < at.chi_square);
            at = settled ? at : back;
        }
    }
    *found = before;
    if (!good || (before.streak && !differs(&at.source.shape, &before.source.shape, covariance))) {
        return;
    }
    found->source = at.source;
    add_path_covariance(&a, covariance, &found->source);
    found->own_path = true;
    found->streak = before.length_px >= BST_OWN_STREAK_LENGTH * psf_fwhm &&
                    at.chi_square < old_chi - BST_OWN_STREAK_GAIN && !is_short(f, &at.source.shape);
    found->snr = found->source.flux_e * bst_fit_norm(w->fit, &s.stamp) / found->noise_e;
}
