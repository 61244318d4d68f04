/* Motion of the camera as image processing measures it on bright star streaks
 * (imgproc/streak/streak_motion.c): what it fits to all streaks of the frame. */
#include <math.h>

#include "boresight/camera_motion.h"
#include "boresight/vec.h"
#include "obsgen/generator_internal.h"
#include "sim/onboard/measured_path.h"

/* Stars that are used, and the least SNR of one. */
enum { MOST_STARS = 12 };
static const double LEAST_SNR = 20.0;
/* 1 sigma of the telemetry's error of length and direction that image processing expects, px
 * (imgproc/detect/camera_motion_left.c). */
static const double DRIFT_PX = 1.0;
/* Random stream of the bend's error. */
static const uint64_t BEND_ERROR = (uint64_t)1 << 55;

/* Sum of the squared SNR of the brightest stars, with the noise of their own light: that of their
 * brightest pixels. */
static double snr2_of_stars(const bst_generator *g, const bst_truth *t) {
    double best[MOST_STARS] = {0.0}, sum = 0.0;
    double read_e = bst_camera_read_noise_e(g->camera), added = (double)g->binning * g->binning;
    double excess = bst_camera_excess_noise(g->camera);
    double variance = excess * added * (t->background_e + t->dark_e) + read_e * read_e;
    double norm = bst_crlb_table_norm(&g->bound, g->streak);
    for (int i = 0; i < t->count; i++) {
        const bst_truth_item *item = &t->items[i];
        bool used = item->kind == BST_SOURCE_STAR && item->snr > LEAST_SNR &&
                    (item->flags & BST_TRUTH_IN_FIELD) && !(item->flags & BST_TRUTH_SATURATED);
        /* the brightest pixel of a long line is sqrt(2) sum p^2 of its light */
        double own = excess * sqrt(2.0) * item->electrons * norm * norm / fmax(variance, 1e-6);
        double snr2 = item->snr * item->snr / (1.0 + own);
        if (!used || snr2 <= best[MOST_STARS - 1]) {
            continue;
        }
        int at = MOST_STARS - 1;
        for (; at > 0 && best[at - 1] < snr2; at--) {
            best[at] = best[at - 1];
        }
        best[at] = snr2;
    }
    for (int i = 0; i < MOST_STARS; i++) {
        sum += best[i];
    }
    return sum;
}

/* Least-squares coefficients of the path: uniform motion along and across the telemetry's path, and
 * bend along it. */
static void project(const bst_generator *g, double c, double s, double *along, double *across,
                    double *bend) {
    double moment = 0.0, square = 0.0, sums[3] = {0.0};
    int last = g->path.count - 1;
    for (int k = 0; k <= last; k++) {
        double u = (double)k / last - 0.5, bent = 6.0 * u * u - 0.5;
        double weight = k == 0 || k == last ? 0.5 : 1.0;
        double x = g->path_x[k] * c + g->path_y[k] * s, y = g->path_y[k] * c - g->path_x[k] * s;
        moment += weight * u * u;
        square += weight * bent * bent;
        sums[0] += weight * u * x;
        sums[1] += weight * u * y;
        sums[2] += weight * bent * x;
    }
    *along = sums[0] / moment;
    *across = sums[1] / moment;
    *bend = sums[2] / square;
}

/* True if images show stars as streaks: the motion is measured on maxima of the streak filter. Of a
 * path that dwells for most of the exposure the point filter's output is larger. */
static bool are_streaks(const bst_generator *g) {
    if (!g->followed) {
        return true;
    }
    const bst_path_widths widths = {g->image_sigma, g->filter_sigma, g->bias_sigma};
    const bst_path_outputs out = bst_path_fit_outputs(&g->path, g->star_path, &widths);
    return out.streak > out.point;
}

void bst_generator_measure_motion(bst_generator *g, const bst_generator_frame *f) {
    g->fit_path = g->star_path;
    g->fit_bend_x = g->bend_x;
    g->fit_bend_y = g->bend_y;
    double prior = bst_camera_motion_unknown_bend_px(g->settings.jitter_px,
                                                     g->settings.motion_bend_px, f->bend_sigma_px) /
                   g->binning;
    g->bend_before = g->bend_after = prior;
    g->ends_after = 0.0;
    double snr2 = snr2_of_stars(g, f->truth), length = g->streak;
    if (g->smeared || g->path.count < 3 || !(length > 0.0) || !(snr2 > 0.0) ||
        !bst_path_is_measured(length, hypot(g->bend_x, g->bend_y), g->fitted_sigma, g->followed) ||
        !are_streaks(g)) {
        return;
    }
    double c = g->star_path.dx / length, s = g->star_path.dy / length, along, across, bend;
    project(g, c, s, &along, &across, &bend);
    double reported = g->bend_x * c + g->bend_y * s; /* by telemetry */
    /* The bend shows as a slope of the light along the streak, 6 bend / length from end to middle:
     * its mean square is 12 (bend / length)^2 of the squared SNR. The ends give the length. */
    double error2 = length * length / (12.0 * snr2);
    double share = prior * prior / (prior * prior + error2);
    g->bend_after = sqrt(share * error2);
    double ends2 = 8.0 * g->total_sigma * length / snr2, drift = DRIFT_PX / g->binning;
    double whole = drift * drift / (drift * drift + ends2);
    g->ends_after = sqrt(whole * ends2);
    double noise =
        share * sqrt(error2) * bst_rng_normal(g->key, (uint64_t)f->truth->exposure_id, BEND_ERROR);
    double more = share * (bend - reported) + noise, dx = whole * (along - length);
    g->fit_path.dx += dx * c - whole * across * s;
    g->fit_path.dy += dx * s + whole * across * c;
    g->fit_bend_x += more * c;
    g->fit_bend_y += more * s;
}

void bst_generator_set_shared(const bst_camera_motion *motion, const bst_camera *camera,
                              const bst_generator_frame *f, const bst_generator_result *made,
                              bst_detections *out) {
    bst_camera_motion_set_shared(made->shared_dx_px, made->shared_dy_px, made->shared_along_px2,
                                 made->shared_across_px2, out);
    if (!f->followed || made->smeared) {
        return;
    }
    const double length = hypot(made->shared_dx_px, made->shared_dy_px);
    const double after2 = made->bend_after_px * made->bend_after_px;
    const double ends2 = made->ends_after_px * made->ends_after_px;
    const double covariance[3][3] = {{ends2}, {0.0, ends2}, {0.0, 0.0, after2}};
    const bool measured = length > 0.0 && made->bend_after_px < made->bend_before_px;
    const bst_camera_motion_unknown unknown = {.bend_px = made->bend_before_px,
                                               .drift_px = BST_CAMERA_MOTION_DRIFT_PX,
                                               .covariance = measured ? covariance : NULL,
                                               .ex = measured ? made->shared_dx_px / length : 1.0,
                                               .ey = measured ? made->shared_dy_px / length : 0.0};
    const double pixel = f->binning > 1 ? f->binning : 1;
    const double sigma = sqrt(f->sigma_px * f->sigma_px + pixel * pixel / 12.0);
    bst_camera_motion_set_uneven_shift(motion, camera, sigma, &unknown, out);
}
