#include "tests/imgproc/random_sky.h"

#include "tests/test_support.h"

static const double YEAR = 2024.6;
static const double FWHM_PX = 2.0;
enum { PLANTED = 4, BRIGHT = 9 };

/* Random rotation (Shoemake 1992, Graphics Gems III). */
static bst_quat random_attitude(bst_rng_key key, uint64_t index) {
    double u = bst_rng_uniform(key, index, 0), a = 2.0 * BST_PI * bst_rng_uniform(key, index, 1);
    double b = 2.0 * BST_PI * bst_rng_uniform(key, index, 2);
    return (bst_quat){sqrt(1.0 - u) * sin(a), sqrt(1.0 - u) * cos(a), sqrt(u) * sin(b),
                      sqrt(u) * cos(b)};
}

/* Appends a detection with the centroid error of its SNR (King 1983, PASP 95, 163: FWHM over 2.355
 * SNR and more for pixels), larger along a streak by the root of its length in FWHM. */
static void append(const bst_random_sky_options *o, bst_rng_key key, uint64_t index, double x,
                   double y, double snr, bool scrambled, bst_random_sky *out) {
    if (out->count == BST_RANDOM_SKY_ROOM) {
        return;
    }
    double z[2], sigma = 1.3 * FWHM_PX / BST_FWHM_PER_SIGMA / snr;
    double along = sigma * sqrt(1.0 + o->streak_px / FWHM_PX), angle = 0.4;
    double c = cos(angle), s = sin(angle);
    bst_rng_normal2(key, index, 100000 + (uint64_t)out->count, z);
    if (scrambled) {
        x = 1023.0 * bst_rng_uniform(key, index, 200000 + 2 * (uint64_t)out->count);
        y = 1023.0 * bst_rng_uniform(key, index, 200001 + 2 * (uint64_t)out->count);
    }
    x += c * along * z[0] - s * sigma * z[1];
    y += s * along * z[0] + c * sigma * z[1];
    if (x < 0.0 || y < 0.0 || x > 1023.0 || y > 1023.0) {
        return;
    }
    out->items[out->count++] = (bst_detection){
        .x_px = o->mirrored ? 1023.0 - x : x,
        .y_px = y,
        .cov_xx = c * c * along * along + s * s * sigma * sigma,
        .cov_xy = (o->mirrored ? -1.0 : 1.0) * c * s * (along * along - sigma * sigma),
        .cov_yy = s * s * along * along + c * c * sigma * sigma,
        .flux_e = o->even ? 1000.0 : 100.0 * snr,
        .flux_sigma_e = 100.0,
        .snr = snr,
        .label = BST_LABEL_UNKNOWN};
}

/* Reads the stars of the field down to a magnitude; the caller frees them. */
static bst_star *stars_of(const bst_stars *stars, bst_vec3 direction, double radius, double v,
                          int *count) {
    bst_ctx ctx = {0};
    bst_assert_ok(&ctx, bst_stars_query(&ctx, stars, direction, radius, v, YEAR, NULL, 0, count));
    bst_star *out = calloc((size_t)*count + 1, sizeof *out);
    assert_non_null(out);
    bst_assert_ok(&ctx,
                  bst_stars_query(&ctx, stars, direction, radius, v, YEAR, out, *count, count));
    return out;
}

static bool is_planted(const uint32_t planted[PLANTED], uint32_t id) {
    bool found = false;
    for (int i = 0; i < PLANTED; i++) {
        found = found || (planted[i] != 0 && planted[i] == id);
    }
    return found;
}

/* A star of the onboard catalogue in the field. */
typedef struct place {
    double x, y;
    float v_mag;
    uint32_t id;
} place;

/* Of the brightest stars the one nearest to the middle of the field, and its nearest neighbours: a
 * quad that the patterns are likely to have. */
static void choose_planted(const place *bright, int count, uint32_t planted[PLANTED]) {
    double x = 511.5, y = 511.5;
    for (int k = 0; k < PLANTED && k < count; k++) {
        double least = HUGE_VAL;
        int best = -1;
        for (int i = 0; i < count; i++) {
            double r = hypot(bright[i].x - x, bright[i].y - y);
            if (r < least && !is_planted(planted, bright[i].id)) {
                least = r;
                best = i;
            }
        }
        planted[k] = bright[best].id;
        if (k == 0) {
            x = bright[best].x;
            y = bright[best].y;
        }
    }
}

/* Counts the stars of the onboard catalogue in the field.
 *
 * Returned:  out->usable
 *            planted  if asked for, identities of a quad */
static void count_usable(const bst_random_sky_options *o, const bst_stars *onboard,
                         const bst_camera *camera, double radius, bst_random_sky *out,
                         uint32_t planted[PLANTED]) {
    bst_vec3 axis = bst_quat_rotate(bst_quat_conj(out->q_cam_from_gcrf), (bst_vec3){0, 0, 1});
    place bright[BRIGHT];
    int count, kept = 0;
    bst_star *stars = stars_of(onboard, axis, radius, o->v_limit, &count);
    for (int i = 0; i < count; i++) {
        place p = {.v_mag = stars[i].v_mag, .id = stars[i].id};
        bst_vec3 v = bst_light_apparent_star(&out->light, stars[i].icrs);
        if (!bst_camera_project(camera, bst_quat_rotate(out->q_cam_from_gcrf, v), &p.x, &p.y) ||
            p.x < 0.0 || p.y < 0.0 || p.x > 1023.0 || p.y > 1023.0) {
            continue;
        }
        out->usable++;
        int at = kept < BRIGHT ? kept++ : BRIGHT;
        for (; at > 0 && bright[at - 1].v_mag > p.v_mag; at--) {
            if (at < BRIGHT) {
                bright[at] = bright[at - 1];
            }
        }
        if (at < BRIGHT) {
            bright[at] = p;
        }
    }
    free(stars);
    if (o->planted) {
        choose_planted(bright, kept, planted);
    }
}

void bst_random_sky_draw(const bst_random_sky_options *o, const bst_stars *sky,
                         const bst_stars *onboard, uint64_t seed, uint64_t index,
                         bst_random_sky *out) {
    const bst_rng_key key = bst_rng_make_key(seed, 0, "test", "random sky");
    bst_ctx ctx = {0};
    int count;
    out->count = out->usable = 0;
    double tangent = tan(0.5 * o->field_deg * BST_DEG_RAD) / 512.0;
    out->camera = (bst_camera){
        .width_px = 1024, .height_px = 1024, .pixel_scale_arcsec = tangent / BST_ARCSEC_RAD};
    bst_assert_ok(&ctx, bst_camera_prepare(&ctx, &out->camera));
    bst_camera true_camera = out->camera;
    true_camera.pixel_scale_arcsec *= 1.0 + o->scale_error;
    out->light = (bst_light){{21000.0, -18000.0, 9000.0}, {1e11, 1.1e11, 0.2e11}};
    out->q_cam_from_gcrf = o->q_cam_from_gcrf ? *o->q_cam_from_gcrf : random_attitude(key, index);
    bst_vec3 axis = bst_quat_rotate(bst_quat_conj(out->q_cam_from_gcrf), (bst_vec3){0, 0, 1});
    double radius = 1.1 * bst_camera_half_diagonal_rad(&true_camera) + 2e-4;
    uint32_t planted[PLANTED] = {0};
    count_usable(o, onboard, &true_camera, radius, out, planted);
    bst_star *stars = stars_of(sky, axis, radius, o->v_limit + 0.5, &count);
    for (int i = 0; i < count; i++) {
        double x, y;
        bst_vec3 v = bst_light_apparent_star(&out->light, stars[i].icrs);
        double snr = fmin(8.0 * pow(10.0, 0.4 * (o->v_limit - (double)stars[i].v_mag)), 2000.0);
        if (bst_camera_project(&true_camera, bst_quat_rotate(out->q_cam_from_gcrf, v), &x, &y) &&
            bst_rng_uniform(key, index, 1000 + (uint64_t)i) >= o->lost_share) {
            bool kept = is_planted(planted, stars[i].id);
            int before = out->count;
            append(o, key, index, x, y, snr, o->scrambled && !kept, out);
            for (int k = before; kept && k < out->count; k++) {
                out->items[k].flux_e *= 1e6; /* tried first */
            }
        }
    }
    free(stars);
    for (int i = 0; i < o->false_detections; i++) {
        uint64_t k = 50000 + 4 * (uint64_t)i;
        append(o, key, index, 1023.0 * bst_rng_uniform(key, index, k),
               1023.0 * bst_rng_uniform(key, index, k + 1),
               8.0 * pow(10.0, bst_rng_uniform(key, index, k + 2)), o->scrambled, out);
    }
}
