/* Sources whose image is larger than the PSF: satellites with a shape, and ghosts. */
#include <math.h>

#include "obsgen/generator_internal.h"

/* Stream of the places along rings, beyond those of the generator. */
static const uint64_t GHOST_PLACE = (uint64_t)1 << 43;

void bst_generator_set_image(const bst_generator *g, const bst_truth *truth, generator_source *s) {
    double pixel2 = (double)g->binning * g->binning;
    s->snr_ratio = s->filter_ratio = s->curvature = 1.0;
    for (int i = 0; i < truth->shape_count; i++) {
        const bst_truth_shape *shape = &truth->shapes[i];
        if (shape->item == s->item) {
            s->snr_ratio = fmax(shape->snr_ratio, 1e-3);
            s->filter_ratio = fmax(shape->filter_ratio, 1e-6);
            s->shape_xx = shape->light_xx_px2 / pixel2;
            s->shape_xy = shape->light_xy_px2 / pixel2;
            s->shape_yy = shape->light_yy_px2 / pixel2;
        }
    }
}

void bst_generator_set_ghost_image(const bst_generator *g, const bst_ghost *ghost,
                                   generator_source *s) {
    double variance = bst_ghost_variance_px2(ghost) / ((double)g->binning * g->binning);
    if (!(variance > 0.0)) {
        return;
    }
    double wide = sqrt(g->total_sigma * g->total_sigma + variance);
    double square = 2.0 * g->cross_sigma * g->cross_sigma; /* of the filter output for a point */
    s->blur = s->shape_xx = s->shape_yy = variance;
    s->curvature = square / (square + variance);
    s->snr_ratio = s->filter_ratio = sqrt(bst_matched_product(s->path, s->path, wide) /
                                          bst_matched_product(s->path, s->path, g->total_sigma));
    if (ghost->inner_radius_px > 0.0) { /* found somewhere on the ring */
        double angle =
            2.0 * BST_PI * bst_generator_uniform(g, GHOST_PLACE + s->name * GENERATOR_DRAWS);
        double far = 0.5 * (ghost->radius_px + ghost->inner_radius_px) / g->binning;
        s->x += far * cos(angle);
        s->y += far * sin(angle);
    }
}

double bst_generator_image_factor(const bst_generator *g, const generator_source *s, double c,
                                  double n) {
    double wide = c * c * s->shape_xx + 2.0 * c * n * s->shape_xy + n * n * s->shape_yy;
    return sqrt(1.0 + wide / (g->total_sigma * g->total_sigma)) / s->snr_ratio;
}

void bst_generator_set_image_extent(const bst_generator *g, const generator_source *s,
                                    double length, bst_detection *d) {
    double c = s->length > 0.0 ? s->path.dx / s->length : 1.0;
    double n = s->length > 0.0 ? s->path.dy / s->length : 0.0;
    double path2 = length * length / 12.0, psf2 = g->sigma * g->sigma;
    double xx = psf2 + c * c * path2 + s->shape_xx, xy = c * n * path2 + s->shape_xy;
    double yy = psf2 + n * n * path2 + s->shape_yy;
    double middle = 0.5 * (xx + yy), half = hypot(0.5 * (xx - yy), xy);
    d->length_px = g->binning * BST_FWHM_PER_SIGMA * sqrt(middle + half);
    d->width_px = g->binning * BST_FWHM_PER_SIGMA * sqrt(fmax(middle - half, psf2));
    d->angle_rad = 0.5 * atan2(2.0 * xy, xx - yy);
}
