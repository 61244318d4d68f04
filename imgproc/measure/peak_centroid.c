#include "imgproc/measure/peak_centroid.h"

#include <math.h>

#include "imgproc/measure/cosmic_ray.h"

/* Measured with boresight pd: position error of a quadratic through 3 x 3 outputs, px, and its
 * increase per px of streak length by the rounding of the filter's path. */
static const double FLOOR_PX = 0.012, FLOOR_SLOPE = 0.0013;

bst_imgproc_peak_law bst_peak_centroid_law_of(const bst_imgproc_worker *w,
                                              const bst_imgproc_shape *shape) {
    enum { PLACES = 2 };
    bst_imgproc_peak_law law = {0};
    double s[3] = {0}, k[3] = {0}, square = 0.0, cube = 0.0;
    for (int place = 0; place < PLACES * PLACES; place++) {
        bst_imgproc_source source = {.shape = *shape};
        /* average over positions within the pixel, far from the frame's edges */
        source.shape.x_px = 500.0 + (place % PLACES + 0.5) / PLACES;
        source.shape.y_px = 500.0 + (place / PLACES + 0.5) / PLACES;
        bst_imgproc_stamp stamp =
            bst_fit_stamp(&source, bst_deblend_reach(w->f), w->l->max_side, 1000, 1000);
        bst_source_profile_render(w->fit->profiles, w->fit->psf, &source.shape, &stamp,
                                  w->fit->scratch, w->fit->model);
        int stride = bst_simd_layout_round_up(stamp.width), n = stride * stamp.height;
        for (int at = 0; at < n; at++) {
            if (at % stride >= stamp.width) {
                continue;
            }
            double p = (double)w->fit->model[at];
            double px = (double)w->fit->model[n + at], py = (double)w->fit->model[2 * n + at];
            s[0] += px * px;
            s[1] += px * py;
            s[2] += py * py;
            k[0] += px * px * p;
            k[1] += px * py * p;
            k[2] += py * py * p;
            square += p * p;
            cube += p * p * p;
        }
    }
    double det = fmax(s[0] * s[2] - s[1] * s[1], 1e-30), share = PLACES * PLACES;
    law.xx = share * s[2] / det;
    law.xy = -share * s[1] / det;
    law.yy = share * s[0] / det;
    law.photons = (k[0] * s[2] - 2.0 * k[1] * s[1] + k[2] * s[0]) / (2.0 * det);
    double floor_px = FLOOR_PX + FLOOR_SLOPE * hypot(shape->dx_px, shape->dy_px);
    law.floor_px2 = floor_px * floor_px;
    law.norm2 = square / share;
    law.flux_photons = cube / square;
    return law;
}

void bst_peak_centroid_star_path(const bst_locate_frame *f, bst_imgproc_shape *s) {
    bst_camera_motion_streak(f->motion, f->camera, f->origin_x_px + f->binning * s->x_px,
                             f->origin_y_px + f->binning * s->y_px, &s->dx_px, &s->dy_px);
    bst_camera_motion_bend(f->motion, f->camera, &s->bend_x_px, &s->bend_y_px);
    s->dx_px /= f->binning;
    s->dy_px /= f->binning;
    s->bend_x_px /= f->binning;
    s->bend_y_px /= f->binning;
    s->departure = f->departure;
}

void bst_peak_centroid_camera_path(const bst_locate_frame *f, bst_imgproc_shape *s) {
    if (!f->uneven) {
        return;
    }
    bst_peak_centroid_star_path(f, s);
    if (f->filter->streak) { /* no star: how it moves is not known, but how the camera does */
        s->dx_px = s->dy_px = 0.0;
    }
}

/* Mean of the point filter's output along a path, at whole pixels; 0 outside the frame. */
static double mean_on_path(const bst_locate_frame *f, const bst_imgproc_shape *path, double x,
                           double y) {
    double sum = 0.0;
    for (int k = 0; k < BST_PATH_KNOTS; k++) {
        double px, py, bow;
        bst_imgproc_shape_at(path, (double)k / (BST_PATH_KNOTS - 1) - 0.5, &px, &py, &bow);
        const int u = (int)floor(x + px + 0.5), v = (int)floor(y + py + 0.5);
        if (u >= 0 && v >= 0 && u < f->width && v < f->height) {
            sum += (double)bst_filter_point_at(f->filter, u, v);
        }
    }
    return sum / BST_PATH_KNOTS;
}

void bst_peak_centroid_on_path(const bst_locate_frame *f, bst_imgproc_shape *shape) {
    enum { ACROSS = 2 };
    bst_imgproc_shape path = *shape;
    path.x_px = path.y_px = 0.0;
    double half_x, half_y, best = -INFINITY;
    bst_imgproc_shape_reach(&path, &half_x, &half_y);
    const double reach = hypot(half_x, half_y);
    if (reach < 1.0) {
        return;
    }
    /* the axis of the path's moments */
    double m[3];
    bst_imgproc_shape_path_variance(&path, m);
    const double angle = 0.5 * atan2(2.0 * m[1], m[0] - m[2]), ex = cos(angle), ey = sin(angle);
    const int along = (int)ceil(reach);
    const double from_x = shape->x_px, from_y = shape->y_px;
    for (int a = -along; a <= along; a++) {
        for (int b = -ACROSS; b <= ACROSS; b++) {
            const double x = from_x + a * ex - b * ey, y = from_y + a * ey + b * ex;
            const double mean = mean_on_path(f, &path, x, y);
            if (mean > best) {
                best = mean;
                shape->x_px = x;
                shape->y_px = y;
            }
        }
    }
}

void bst_peak_centroid_set_laws(bst_imgproc_locator *l, const bst_locate_frame *f) {
    bst_imgproc_worker w = {l, f, &l->fits[0]};
    bst_imgproc_shape shape = {
        .x_px = 0.5 * f->width, .y_px = 0.5 * f->height, .sigma_px = f->sigma_px};
    l->law[0] = bst_peak_centroid_law_of(&w, &shape);
    if (f->filter->streak) {
        bst_peak_centroid_star_path(f, &shape);
        l->law[1] = bst_peak_centroid_law_of(&w, &shape);
    }
    for (int k = 0; k < (f->filter->streak ? 2 : 1); k++) {
        double q = l->light[k].norm / l->light[k].response, wrong = q * q;
        l->law[k].norm2 /= wrong;
        l->law[k].xx *= wrong * wrong;
        l->law[k].xy *= wrong * wrong;
        l->law[k].yy *= wrong * wrong;
    }
}

/* Finds neighbours of a filter-peak source: flags it as a BLEND, and drops it if a brighter source
 * was fitted at its position. */
static void check_neighbours(const bst_imgproc_worker *w, int i, bst_imgproc_found *found) {
    const bst_imgproc_locator *l = w->l;
    const bst_imgproc_shape *s = &found->source.shape;
    double radius = 0.6 * BST_FWHM_PER_SIGMA * s->sigma_px, reach = bst_deblend_reach(w->f);
    double half_x = 0.5 * fabs(s->dx_px) + reach, half_y = 0.5 * fabs(s->dy_px) + reach;
    int margin_x = (int)half_x + 4, margin_y = (int)half_y + 4;
    int left = found->peak_x > margin_x ? (found->peak_x - margin_x) / BST_LOCATE_CELL_PX : 0;
    int top = found->peak_y > margin_y ? (found->peak_y - margin_y) / BST_LOCATE_CELL_PX : 0;
    int right = (found->peak_x + margin_x) / BST_LOCATE_CELL_PX;
    int bottom = (found->peak_y + margin_y) / BST_LOCATE_CELL_PX;
    right = right < l->columns ? right : l->columns - 1;
    bottom = bottom < l->rows ? bottom : l->rows - 1;
    for (int v = top; v <= bottom; v++) {
        for (int u = left; u <= right; u++) {
            for (int k = l->cell[v * l->columns + u]; k >= 0; k = l->found[k].next) {
                const bst_imgproc_found *other = &l->found[k];
                if (k == i || other->dropped || bst_label_is_charge(other->label)) {
                    continue;
                }
                double dx = fabs(other->source.shape.x_px - s->x_px);
                double dy = fabs(other->source.shape.y_px - s->y_px);
                if (dx < half_x && dy < half_y) {
                    found->flags |= BST_DETECTION_BLEND;
                    found->dropped |= k < i && dx * dx + dy * dy < radius * radius;
                }
            }
        }
    }
}

void bst_peak_centroid_place(const bst_imgproc_worker *w, int i, bst_imgproc_found *found) {
    bst_imgproc_source *s = &found->source;
    const bst_imgproc_peak_law *law = &w->l->law[found->streak ? 1 : 0];
    double noise2 = found->noise_e * found->noise_e, flux = fmax(s->flux_e, 1e-3 * found->noise_e);
    double excess = w->f->excess, scale = noise2 / (flux * flux) + excess * law->photons / flux;
    s->cov_xx = scale * law->xx + law->floor_px2;
    s->cov_xy = scale * law->xy;
    s->cov_yy = scale * law->yy + law->floor_px2;
    s->flux_variance = (noise2 + excess * law->flux_photons * flux) / law->norm2;
    s->fitted = true;
    found->rough = true;
    check_neighbours(w, i, found);
}
