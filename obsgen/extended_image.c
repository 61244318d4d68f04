/* Sources whose image is larger than the PSF: satellites with a shape. */
#include <math.h>

#include "obsgen/generator_internal.h"

void bst_generator_set_image(const bst_generator *g, const bst_truth *truth, generator_source *s) {
    double pixel2 = (double)g->binning * g->binning;
    s->snr_ratio = s->filter_ratio = 1.0;
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
