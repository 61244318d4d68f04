/* Sources whose image is larger than the PSF: satellites with a shape, and ghosts. */
#include <math.h>

#include "obsgen/generator_internal.h"

/* Stream of the places along rings, beyond those of the generator. */
static const uint64_t GHOST_PLACE = (uint64_t)1 << 43;

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

/* Output of a filter for a ghost's image at rest over that for a point of the same light; width:
 * of the filter output about a point, per axis. A disc with a hole has its greatest output in its
 * middle, or along its ring: there as a straight strip. *from_middle: distance of that place. */
static double ghost_output(const bst_ghost *ghost, double pixel, double width,
                           double *from_middle) {
    *from_middle = 0.0;
    double square = width * width;
    if (!(ghost->radius_px > 0.0)) {
        double sigma = ghost->sigma_px / pixel;
        return square / (square + sigma * sigma);
    }
    double far = ghost->radius_px / pixel, near = ghost->inner_radius_px / pixel;
    double share = 2.0 * square / (far * far - near * near);
    double middle = share * (exp(-0.5 * near * near / square) - exp(-0.5 * far * far / square));
    double ring = share * erf(0.5 * (far - near) / (sqrt(2.0) * width));
    *from_middle = near > 0.0 && ring > middle ? 0.5 * (far + near) : 0.0;
    return near > 0.0 ? fmax(ring, middle) : middle;
}

void bst_generator_set_ghost_image(const bst_generator *g, const bst_ghost *ghost,
                                   generator_source *s) {
    double pixel = g->binning, from_middle;
    double variance = bst_ghost_variance_px2(ghost) / (pixel * pixel);
    if (!(variance > 0.0)) {
        return;
    }
    double wide = sqrt(g->total_sigma * g->total_sigma + variance);
    s->shape_xx = s->shape_yy = variance;
    s->snr_ratio = sqrt(bst_matched_product(s->path, s->path, wide) /
                        bst_matched_product(s->path, s->path, g->total_sigma));
    /* a Gaussian that has the same output at rest */
    double output = ghost_output(ghost, pixel, sqrt(2.0) * g->cross_sigma, &from_middle);
    double blur = g->cross_sigma / sqrt(fmax(output, 1e-6));
    const bst_obsgen_path_px rest = {0.0, 0.0};
    s->filter_ratio = bst_matched_product(s->path, rest, blur) /
                      bst_matched_product(s->path, rest, g->cross_sigma);
    double angle = 2.0 * BST_PI *
                   bst_generator_uniform(g, GHOST_PLACE + s->name * GENERATOR_DRAWS);
    s->x += from_middle * cos(angle);
    s->y += from_middle * sin(angle);
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
