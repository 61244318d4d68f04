/* Truth items of sources: image position, size and SNR. */
#include "sim/optics/psf.h"
#include "sim/world/scene/field_image.h"
#include "sim/world/scene/field_internal.h"
#include "sim/world/scene/row_exposure.h"

/* Image moments of a point source; NAN: behind the camera. */
static bst_scene_image_moments smear_of(const bst_field *field, const bst_scene_source *source) {
    bst_scene_image_moments m = {0};
    double x[BST_FIELD_SIGMA_POINTS], y[BST_FIELD_SIGMA_POINTS];
    for (int p = 0; p < BST_FIELD_SIGMA_POINTS; p++) {
        bst_vec3 d = bst_scene_source_direction(source, field->sigma_time[p]);
        x[p] = y[p] = NAN;
        d = bst_scene_source_seen(field->camera, source, bst_quat_rotate(field->sigma_q[p], d));
        (void)bst_camera_project(field->camera, d, &x[p], &y[p]);
    }
    for (int p = 1; p < BST_FIELD_SIGMA_POINTS; p++) {
        m.x_mean += x[p] / (BST_FIELD_SIGMA_POINTS - 1);
        m.y_mean += y[p] / (BST_FIELD_SIGMA_POINTS - 1);
    }
    for (int p = 1; p < BST_FIELD_SIGMA_POINTS; p++) {
        double dx = x[p] - m.x_mean, dy = y[p] - m.y_mean;
        m.xx += dx * dx / (BST_FIELD_SIGMA_POINTS - 1);
        m.xy += dx * dy / (BST_FIELD_SIGMA_POINTS - 1);
        m.yy += dy * dy / (BST_FIELD_SIGMA_POINTS - 1);
        /* the exposure's time has the mean 1 / 2 and the variance 1 / 12 */
        double time = 12.0 * (field->sigma_time[p] - 0.5) / (BST_FIELD_SIGMA_POINTS - 1);
        m.dx += time * dx;
        m.dy += time * dy;
    }
    return m;
}

/* Variance of a path beyond a straight one, relative to the PSF's, above which the path is
 * integrated. Below it the Gaussian approximation of the curvature changes the SNR of a long streak
 * by at most 3 %. */
static const double BENT = 0.12;

/* Image moments and positions of a source with a rolling shutter: the exposure of the row where it
 * is. */
static bst_scene_image_moments image_in_rows(const bst_field *field, const bst_los_track *track,
                                             const bst_scene_source *source, bst_window window,
                                             double u[2], bst_quat *q_mid, bst_truth_item *out) {
    const bst_row_times rows = {field->camera->detector.row_time_s, field->exposure_s, window};
    double duration = track->time_s[track->count - 1];
    bst_row_source_times(field->camera, &rows, track, source, u);
    double middle = 0.5 * (u[0] + u[1]);
    const double when[3] = {u[0], middle, u[1]};
    double *const x[3] = {&out->x_start_px, &out->x_mid_px, &out->x_end_px};
    double *const y[3] = {&out->y_start_px, &out->y_mid_px, &out->y_end_px};
    *q_mid = bst_los_track_attitude(track, middle * duration);
    for (int k = 0; k < 3; k++) {
        bst_quat q = bst_los_track_attitude(track, when[k] * duration);
        bst_vec3 v = bst_quat_rotate(q, bst_scene_source_direction(source, when[k]));
        (void)bst_camera_project(field->camera, bst_scene_source_seen(field->camera, source, v),
                                 x[k], y[k]);
    }
    out->delay_s = (middle - 0.5) * duration;
    out->electrons = source->electrons_per_s * duration *
                     (bst_scene_source_light(source, u[1]) - bst_scene_source_light(source, u[0]));
    return bst_scene_image_by_light(field->camera, track, source, u[0], u[1]);
}

/* Truth item of a source without image positions. */
static bst_truth_item item_without_place(const bst_field *field, const bst_scene_source *source) {
    return (bst_truth_item){.kind = source->kind,
                            .id = source->id,
                            .norad = bst_source_is_object(source->kind)
                                         ? bst_world_object(field->world, (int)source->id)->norad
                                         : 0,
                            .ra_rad = source->ra_rad,
                            .dec_rad = source->dec_rad,
                            .v_mag = source->v_mag,
                            .electrons = source->electrons_per_s * field->exposure_s,
                            .sunlit_fraction = source->sunlit_fraction,
                            .phase_rad = source->phase_rad,
                            .range_m = source->range_m,
                            .x_start_px = NAN,
                            .y_start_px = NAN,
                            .x_mid_px = NAN,
                            .y_mid_px = NAN,
                            .x_end_px = NAN,
                            .y_end_px = NAN,
                            .x_chief_px = NAN,
                            .y_chief_px = NAN,
                            .x_centroid_px = NAN,
                            .y_centroid_px = NAN};
}

/* Positions of a source at start, middle and end, and the moments of its image. u: the part of the
 * track in which it is exposed. */
static bst_scene_image_moments source_image(const bst_field *field, const bst_los_track *track,
                                            const bst_scene_source *source, bst_window window,
                                            double u[2], bst_quat *q_mid, bst_truth_item *out) {
    const bst_camera *camera = field->camera;
    if (camera->detector.row_time_s != 0.0 && track->time_s[track->count - 1] > 0.0) {
        return image_in_rows(field, track, source, window, u, q_mid, out);
    }
    (void)bst_field_project(camera, track, 0, source, &out->x_start_px, &out->y_start_px);
    (void)bst_field_project(camera, track, track->count - 1, source, &out->x_end_px,
                            &out->y_end_px);
    bst_vec3 mid = bst_quat_rotate(field->q_mid, source->apparent_mid);
    (void)bst_camera_project(camera, bst_scene_source_seen(camera, source, mid), &out->x_mid_px,
                             &out->y_mid_px);
    return source->rate ? bst_scene_image_by_light(field->camera, track, source, 0.0, 1.0)
                        : smear_of(field, source);
}

/* Length and widths of an image, px and px^2. */
typedef struct image_width {
    double length;        /* from the first to the last position */
    double along, across; /* as of bst_image_blur */
    double sharp;         /* variance of the PSF alone */
    double widened;       /* variance that binning adds */
} image_width;

/* The same of the straight streak nearest to the path, not of that between its ends: these are
 * places of the jitter. */
static image_width nearest_streak(const bst_scene_image_moments *image, const image_width *ends) {
    image_width w = *ends;
    w.length = hypot(image->dx, image->dy);
    bst_image_spread(w.sharp, image, image->dx, image->dy, &w.along, &w.across);
    return w;
}

/* Sum of squared pixel fractions of an image that jitter makes of a straight streak. */
static double squared_light_shaken(const bst_camera *camera, const bst_scene_source *source,
                                   const bst_scene_image_moments *image, bool plain,
                                   const image_width *w) {
    double along = w->along, across = w->across, widened = w->widened;
    if (plain) {
        return bst_optics_image_squared(sqrt(along * along + widened),
                                        sqrt(across * across + widened), w->length);
    }
    double blurred = 0.5 * (along * along + across * across) - w->sharp + widened;
    return bst_psf_squared_image(camera->psf, source->colour, image->x_mean, image->y_mean, blurred,
                                 blurred, w->length);
}

/* Sum of squared pixel fractions of an image. `path`: moments without the source's disc. */
static double squared_light(const bst_camera *camera, const bst_los_track *track,
                            const bst_scene_source *source, const double u[2],
                            const bst_scene_image_moments *image,
                            const bst_scene_image_moments *path, const image_width *w) {
    double along = w->along, across = w->across, sharp = w->sharp, widened = w->widened;
    double gauss = bst_optics_image_squared(sqrt(along * along + widened),
                                            sqrt(across * across + widened), w->length);
    double square = gauss, sigma;
    bool plain = !camera->psf || bst_psf_gaussian(camera->psf, &sigma);
    if (!plain) {
        /* jitter widens both axes equally; the excess along the path is its length */
        double blurred = across * across - sharp;
        double drawn = sqrt(12.0 * fmax(image->xx + image->yy - 2.0 * blurred, 0.0));
        square = bst_psf_squared_image(camera->psf, source->colour, image->x_mean, image->y_mean,
                                       blurred + widened, blurred + widened, drawn);
    }
    const image_width nearest = nearest_streak(image, w);
    double excess = nearest.along * nearest.along + nearest.across * nearest.across - 2.0 * sharp;
    if (excess > BENT * (sharp + widened)) {
        /* the disc widens the path */
        double disc = 0.5 * fmax(image->xx + image->yy - path->xx - path->yy, 0.0);
        double exact = bst_scene_image_squared_path(camera, track, source, u, path, excess,
                                                    sharp + widened + disc);
        if (isfinite(exact)) {
            square = plain ? exact : square * exact / gauss;
        } else {
            square = squared_light_shaken(camera, source, image, plain, &nearest);
        }
    }
    return square;
}

void bst_field_truth_item(const bst_field *field, const bst_los_track *track,
                          const bst_scene_source *source, bst_window window, int binning,
                          const bst_truth *header, bst_truth_item *out) {
    const bst_camera *camera = field->camera;
    *out = item_without_place(field, source);
    bst_quat q_mid = field->q_mid;
    double u[2] = {0.0, 1.0}; /* part of the track in which the source is exposed */
    bst_scene_image_moments image = source_image(field, track, source, window, u, &q_mid, out);
    bst_scene_image_moments path = image;
    out->x_chief_px = image.x_mean;
    out->y_chief_px = image.y_mean;
    if (source->shape) {
        bst_scene_image_add_disc(field->camera, q_mid, source, &image);
    }
    if (source->ghost) {
        image.xx += bst_ghost_variance_px2(source->ghost);
        image.yy += bst_ghost_variance_px2(source->ghost);
    }
    bst_scene_image_centroid(camera, source, &image, &out->x_centroid_px, &out->y_centroid_px);
    if (isfinite(image.x_mean)) {
        out->electrons *= bst_camera_illumination(camera, image.x_mean, image.y_mean);
    }
    double dark =
        bst_field_background_e(field, header, image.x_mean, image.y_mean) + header->dark_e;
    /* binned pixels are read once; their sum is the image blurred by a wider box */
    double added = (double)binning * binning, widened = (added - 1.0) / 12.0;
    double read_e = bst_camera_read_noise_e(camera);
    double variance = bst_camera_excess_noise(camera) * dark + read_e * read_e / added;
    double length = hypot(out->x_end_px - out->x_start_px, out->y_end_px - out->y_start_px);
    double along, across;
    double sharp = bst_image_blur(camera, source, &image, out->x_end_px - out->x_start_px,
                                  out->y_end_px - out->y_start_px, &along, &across);
    if (isfinite(length) && variance > 0.0) {
        const image_width w = {length, along, across, sharp, widened};
        out->snr = out->electrons *
                   sqrt(squared_light(camera, track, source, u, &image, &path, &w) / variance);
    }
    if (source->occulted) {
        out->flags |= BST_TRUTH_OCCULTED;
    }
    if (image.x_mean >= window.x0 - 0.5 && image.x_mean < window.x0 + window.width - 0.5 &&
        image.y_mean >= window.y0 - 0.5 && image.y_mean < window.y0 + window.height - 0.5) {
        out->flags |= BST_TRUTH_IN_FIELD;
    }
    /* peak of the image: point 1 / (2 pi sigma^2); long streak 1 / (sqrt(2 pi) sigma length) */
    double peak =
        out->electrons / (2.0 * BST_PI * across * hypot(along, length / sqrt(2.0 * BST_PI)));
    if (peak + dark > bst_camera_full_e(camera) &&
        !source->body) { /* a body: bst_truth_list_fill */
        out->flags |= BST_TRUTH_SATURATED;
    }
}
