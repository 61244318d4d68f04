#include "imgproc/extended/centre_of_mass.h"

#include <assert.h>
#include <math.h>

/* Standard error of the extents: share of the PSF's sigma, and of the size. Measured in
 * tests/imgproc/test_extended.c */
static const double LIMB_SIGMA = 0.6, SIZE_SIGMA = 0.02;
/* Standard error of the offset towards the Sun, share of it. The factor varies by about as much
 * with the attitude of one satellite: tests/imgproc/calibrate_outline.c */
static const double OFFSET_SIGMA = 0.5;
/* Standard error of the centre of a target cut by the frame's edge, share of its visible size.
 * Design choice: a target of twice that size, of which half is seen, has its centre half of it
 * away. */
static const double EDGE_SIGMA = 0.25;

double bst_outline_phase_offset(double phase_rad) {
    return 2.0 / (3.0 * BST_PI) * (1.0 - cos(phase_rad));
}

double bst_light_phase_offset(double phase_rad) {
    double sine = sin(phase_rad), cosine = cos(phase_rad);
    double light = sine + (BST_PI - phase_rad) * cosine;
    return light > 1e-9 ? 3.0 * BST_PI / 32.0 * sine * (1.0 + cosine) / light : 0.5;
}

/* Direction of the Sun in the image at a place of the sensor; false: none. */
static bool sun_in_image(const bst_extended_view *v, double x_px, double y_px, double *phase_rad,
                         double along[2]) {
    if (!v->sun_known) {
        return false;
    }
    bst_vec3 target = bst_camera_unproject(v->camera, x_px, y_px);
    *phase_rad = bst_vec3_angle(v->sun_cam, bst_vec3_scale(target, -1.0));
    bst_vec3 across = bst_vec3_axpy(v->sun_cam, -bst_vec3_dot(v->sun_cam, target), target);
    double sine = bst_vec3_norm(across), x1, y1;
    const double step = 1e-4; /* rad */
    if (!(sine > 1e-6) ||
        !bst_camera_project(v->camera, bst_vec3_axpy(target, step / sine, across), &x1, &y1)) {
        return false;
    }
    double length = hypot(x1 - x_px, y1 - y_px);
    along[0] = (x1 - x_px) / length;
    along[1] = (y1 - y_px) / length;
    return length > 0.0;
}

/* Share of the outline's centre in the position: 0 below 0.8 times the hand-over size, 1 from 1.2
 * times that on. An outline of that size is good to a tenth of the PSF; the light of parts that
 * reflect differently, to a third. */
static double outline_share(const bst_extended_config *config, const bst_camera *camera,
                            double size_px) {
    double handover = config->handover_fwhm * camera->psf_fwhm_px;
    double t = fmin(fmax((size_px / handover - 0.8) / 0.4, 0.0), 1.0);
    return t * t * (3.0 - 2.0 * t);
}

/* Range from the known size and the angle that it spans. */
static void estimate_range(const bst_extended_config *config, const bst_camera *camera,
                           bst_detection_extent *e) {
    if (!(config->target_size_m > 0.0) || !(e->size_px > 0.0)) {
        return;
    }
    double half = 0.5 * e->size_px * bst_camera_scale_rad(camera);
    e->range_m = 0.5 * config->target_size_m / half;
    e->range_sigma_m = e->range_m * hypot(e->size_sigma_px / e->size_px,
                                          config->target_size_sigma_m / config->target_size_m);
}

void bst_extended_correct_point(const bst_extended_config *config, const bst_extended_view *v,
                                const bst_silhouette *s, bst_detection *d) {
    assert(config && v && v->camera && s && d);
    double phase, along[2];
    if (!sun_in_image(v, d->x_px, d->y_px, &phase, along)) {
        return;
    }
    double across = bst_outline_extent_along(&s->outline, -along[1], along[0]);
    across = v->binning * across;
    double least = BST_SILHOUETTE_LEAST * config->handover_fwhm * v->camera->psf_fwhm_px;
    double share = fmin(fmax(v->binning * s->moment_size_px / least - 1.0, 0.0), 1.0);
    double offset = share * config->phase_offset_factor * bst_light_phase_offset(phase) * across;
    double variance = OFFSET_SIGMA * OFFSET_SIGMA * offset * offset;
    d->x_px -= offset * along[0];
    d->y_px -= offset * along[1];
    d->cov_xx += variance * along[0] * along[0];
    d->cov_xy += variance * along[0] * along[1];
    d->cov_yy += variance * along[1] * along[1];
}

void bst_extended_measure(const bst_extended_config *config, const bst_extended_view *v,
                          const bst_silhouette *s, double size_px, bst_detection *out) {
    assert(config && v && v->camera && s && out && v->binning >= 1.0);
    double b = v->binning, x0 = v->origin_x_px, y0 = v->origin_y_px;
    double length = b * s->length_px;
    double light_x = x0 + b * s->light_x_px, light_y = y0 + b * s->light_y_px;
    double centre_x = s->centre_x_px, centre_y = s->centre_y_px;
    if (!s->edge) {
        double spanned = length * bst_camera_scale_rad(v->camera);
        bst_outline_centre(&s->outline, spanned, &centre_x, &centre_y);
    }
    centre_x = x0 + b * centre_x;
    centre_y = y0 + b * centre_y;
    double phase = 0.0, along[2] = {0.0, 0.0}, offset = 0.0, light_offset = 0.0;
    bool lit = sun_in_image(v, centre_x, centre_y, &phase, along);
    if (lit) {
        double across = bst_outline_extent_along(&s->outline, -along[1], along[0]);
        across *= b;
        offset = config->phase_offset_factor * bst_outline_phase_offset(phase) * across;
        light_offset = config->phase_offset_factor * bst_light_phase_offset(phase) * across;
    }
    double share = outline_share(config, v->camera, length);
    double total = share * offset + (1.0 - share) * light_offset;
    double x = share * centre_x + (1.0 - share) * light_x;
    double y = share * centre_y + (1.0 - share) * light_y;
    double sigma =
        hypot(config->centre_sigma * fmax(length, size_px), s->edge ? EDGE_SIGMA * length : 0.0);
    /* without the Sun's direction: the offset of half a lit sphere */
    double radial = lit ? OFFSET_SIGMA * total : bst_outline_phase_offset(0.5 * BST_PI) * length;
    double variance = sigma * sigma + s->flux_variance / (s->flux_e * s->flux_e) * length * length;
    *out = (bst_detection){
        .x_px = x - total * along[0],
        .y_px = y - total * along[1],
        .cov_xx = variance + radial * radial * (lit ? along[0] * along[0] : 1.0),
        .cov_xy = radial * radial * along[0] * along[1],
        .cov_yy = variance + radial * radial * (lit ? along[1] * along[1] : 1.0),
        .flux_e = s->flux_e,
        .flux_sigma_e = sqrt(s->flux_variance),
        .snr = s->flux_e / sqrt(s->flux_variance),
        .length_px = length,
        .width_px = b * s->width_px,
        .angle_rad = s->angle_rad,
        .flags = BST_DETECTION_EXTENDED | (s->saturated_px > 0 ? BST_DETECTION_SATURATED : 0u) |
                 (s->edge ? BST_DETECTION_EDGE : 0u),
        .label = BST_LABEL_OBJECT,
        .label_probability = 0.99,
        .extent = {.light_x_px = light_x,
                   .light_y_px = light_y,
                   .x0_px = x0 + b * s->x0_px,
                   .y0_px = y0 + b * s->y0_px,
                   .x1_px = x0 + b * s->x1_px,
                   .y1_px = y0 + b * s->y1_px,
                   .size_px = length,
                   .size_sigma_px =
                       hypot(LIMB_SIGMA * bst_camera_psf_sigma_px(v->camera), SIZE_SIGMA * length),
                   .area_px2 = b * b * s->area_px2,
                   .phase_rad = lit ? phase : 0.0,
                   .saturated_share = s->area_px2 > 0.0 ? s->saturated_px / s->area_px2 : 0.0}};
    estimate_range(config, v->camera, &out->extent);
}
