#include "imgproc/measure/light_scale.h"

#include <math.h>

#include "imgproc/measure/peak_centroid.h"

void bst_light_scale_clear(bst_imgproc_locator *l, const bst_locate_frame *f) {
    l->light[0].norm = l->light[0].response = f->filter->norm;
    l->light[1].norm = l->light[1].response = f->filter->streak_norm;
}

/* sum p^2 of a shape, the mean of places in a pixel, with a PSF of sigma_px. */
static double square_of(bst_imgproc_locator *l, const bst_locate_frame *f, double sigma_px,
                        const bst_imgproc_shape *shape) {
    const bst_imgproc_worker w = {l, f, &l->fits[0]};
    bst_source_profiles_set(&l->profiles, &l->psf, sigma_px);
    return bst_peak_centroid_law_of(&w, shape).norm2;
}

void bst_light_scale_adapt(bst_imgproc_locator *l, const bst_locate_frame *f) {
    const double filter = f->sigma_px, fitted = l->profiles.sigma_px;
    const double own = sqrt(fitted * fitted + bst_frame_width_mean(&l->width));
    const double between = sqrt(0.5 * (filter * filter + own * own));
    for (int k = 0; k < (f->filter->streak ? 2 : 1); k++) {
        bst_imgproc_shape shape = {
            .x_px = 0.5 * f->width, .y_px = 0.5 * f->height, .sigma_px = own};
        if (k == 1) {
            bst_peak_centroid_star_path(f, &shape);
        }
        double square = square_of(l, f, filter, &shape);
        l->light[k].response *= square_of(l, f, between, &shape) / square;
        l->light[k].norm *= sqrt(square_of(l, f, own, &shape) / square);
    }
    bst_source_profiles_set(&l->profiles, &l->psf, fitted);
}
