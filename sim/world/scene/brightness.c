#include "sim/world/scene/brightness.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>

#include "sim/astro/bodies.h"
#include "sim/astro/curve_file.h"
#include "sim/core/file.h"
#include "sim/optics/band.h"
#include "sim/world/world.h"

/* range to which standard magnitudes refer */
#define STANDARD_RANGE_M 1e6
/* ratio of sphere radius to range above which the finite distance is modelled; the error below is
 * 1e-5 */
#define NEAR_RATIO 1e-5

enum { BY_TIME, BY_PHASE };
enum { AS_MAGNITUDE, AS_FACTOR };

struct bst_brightness {
    bst_brightness_config config;
    bst_curve curve;
};

bst_status bst_brightness_create(bst_ctx *ctx, const bst_brightness_config *config,
                                 const char *base_dir, bst_brightness **out) {
    static const char *const abscissae[] = {"time_s", "phase_deg", NULL};
    static const char *const ordinates[] = {"v_mag_1000km", "factor", NULL};
    *out = NULL;
    bst_brightness *b = calloc(1, sizeof *b);
    if (!b) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for a brightness");
    }
    b->config = *config;
    bst_status status = BST_OK;
    const char *file = config->light_curve_file;
    if (config->model == BST_BRIGHTNESS_LIGHT_CURVE && !*file) {
        status = bst_fail(ctx, BST_ERR_CONFIG,
                          "light_curve_file: the model light_curve needs a file; give its path");
    } else if (config->model == BST_BRIGHTNESS_LIGHT_CURVE) {
        char path[1100];
        bst_file_resolve(base_dir, file, path, sizeof path);
        bst_curve_format format = {"a light curve", abscissae, ordinates, -1e9, 1e9, -40.0, 1e6};
        status = bst_curve_load(ctx, path, &format, &b->curve);
        if (status != BST_OK) {
            status = bst_fail_prefix(ctx, BST_ERR_CONFIG, "light_curve_file");
        }
        const bst_curve *c = &b->curve;
        for (int i = 0; i < c->count && status == BST_OK; i++) {
            if (c->y_column == AS_FACTOR && c->y[i] < 0.0) {
                status =
                    bst_fail(ctx, BST_ERR_CONFIG,
                             "light_curve_file: %.400s: factor %g at %g; factors are 0 or more",
                             path, c->y[i], c->x[i]);
            }
        }
        if (status == BST_OK && c->x_column == BY_PHASE &&
            (c->x[0] < 0.0 || c->x[c->count - 1] > 180.0)) {
            status = bst_fail(ctx, BST_ERR_CONFIG,
                              "light_curve_file: %.400s: phase_deg from %g to %g; phase angles are "
                              "0 to 180",
                              path, c->x[0], c->x[c->count - 1]);
        }
    }
    if (status != BST_OK) {
        bst_brightness_free(b);
        return status;
    }
    *out = b;
    return BST_OK;
}

void bst_brightness_free(bst_brightness *brightness) {
    if (brightness) {
        bst_curve_free(&brightness->curve);
        free(brightness);
    }
}

const bst_brightness_config *bst_brightness_config_of(const bst_brightness *brightness) {
    return &brightness->config;
}

/* Two unit vectors perpendicular to a unit vector and to each other. */
static void frame_about(bst_vec3 axis, bst_vec3 *e1, bst_vec3 *e2) {
    bst_vec3 helper = fabs(axis.z) < 0.9 ? (bst_vec3){0, 0, 1} : (bst_vec3){1, 0, 0};
    *e1 = bst_vec3_unit(bst_vec3_cross(helper, axis));
    *e2 = bst_vec3_cross(axis, *e1);
}

/* Eight-point Gauss-Legendre on [-1, 1], positive half (Abramowitz and Stegun, table 25.4). */
static const double gauss_place[4] = {0.1834346424956498, 0.5255324099163290, 0.7966664774136267,
                                      0.9602898564975363};
static const double gauss_weight[4] = {0.3626837833783620, 0.3137066458778873, 0.2223810344533745,
                                       0.1012285362903763};

/* Node and weight of the 8-point Gauss-Legendre quadrature on [-1, 1]. */
static double gauss8(int i, double *weight) {
    int k = i < 4 ? 3 - i : i - 4;
    *weight = gauss_weight[k];
    return i < 4 ? -gauss_place[k] : gauss_place[k];
}

double bst_scene_earthshine(double specular_fraction, double earth_albedo, bst_vec3 object_m,
                            bst_vec3 eye_m, bst_vec3 sun_m, bst_vec3 *middle) {
    enum { PANELS = 3, AROUND = 48 };
    double distance = bst_vec3_norm(object_m), au = bst_vec3_norm(sun_m) / BST_AU_M;
    *middle = bst_vec3_scale(object_m, -1.0 / distance);
    if (!(distance > BST_EARTH_RADIUS_M)) {
        return 0.0;
    }
    bst_vec3 down = *middle, e1, e2, to_sun = bst_vec3_unit(sun_m);
    bst_vec3 to_eye = bst_vec3_unit(bst_vec3_sub(eye_m, object_m));
    frame_about(down, &e1, &e2);
    double ratio = BST_EARTH_RADIUS_M / distance;
    /* 1 - cos(half angle), without cancellation from far */
    double cap = ratio * ratio / (1.0 + sqrt((1.0 - ratio) * (1.0 + ratio))), total = 0.0;
    bst_vec3 sum = {0};
    for (int n = 0; n < 8 * PANELS; n++) {
        double weight, place = gauss8(n % 8, &weight);
        /* uniform in 1 - cos of the angle: smooth at the Earth's limb */
        double t = 0.5 * BST_PI * (n / 8 + 0.5 + 0.5 * place) / PANELS,
               drop = cap * sin(t) * sin(t);
        double c = 1.0 - drop, s = sqrt(drop * (2.0 - drop));
        double solid_angle =
            cap * sin(2.0 * t) * 0.25 * BST_PI / PANELS * weight * 2.0 * BST_PI / AROUND;
        double half_chord2 = BST_EARTH_RADIUS_M * BST_EARTH_RADIUS_M - distance * distance * s * s;
        double way = distance * c - sqrt(fmax(half_chord2, 0.0));
        for (int m = 0; m < AROUND; m++) {
            double a = 2.0 * BST_PI * (m + 0.5) / AROUND;
            bst_vec3 u = bst_vec3_axpy(bst_vec3_axpy(bst_vec3_scale(down, c), s * cos(a), e1),
                                       s * sin(a), e2);
            bst_vec3 normal = bst_vec3_unit(bst_vec3_axpy(object_m, way, u));
            double radiance = earth_albedo / BST_PI * fmax(bst_vec3_dot(normal, to_sun), 0.0);
            double light = radiance * solid_angle *
                           bst_astro_sphere_phase(specular_fraction, bst_vec3_angle(u, to_eye));
            total += light;
            sum = bst_vec3_axpy(sum, light, u);
        }
    }
    if (total > 0.0) {
        *middle = bst_vec3_unit(sum);
    }
    return total / (au * au);
}

/* Light of the visible disc of a diffuse sphere near the observer. Integrates over q, the sine of
 * the angle from the centre over that of the limb, and a, the angle from the Sun's direction; q =
 * sin t avoids the infinite slope at the limb. */
static double disc_light(double ratio, double phi) {
    enum { PANELS = 3, N = 8 * PANELS };
    /* Rings are fully lit on one side of this angle from the sub-observer point. On the other side
     * the terminator cuts them or they are dark. */
    double border = fabs(0.5 * BST_PI - phi), t0 = border, sum = 0.0;
    for (int i = 0; i < 60; i++) {
        t0 = fmin(border + asin(ratio * sin(fmin(t0, 0.5 * BST_PI))), 0.5 * BST_PI);
    }
    for (int part = phi < 0.5 * BST_PI ? 0 : 1; part < 2; part++) {
        double from = part == 0 ? 0.0 : t0, span = (part == 0 ? t0 : 0.5 * BST_PI) - from;
        for (int i = 0; i < N; i++) {
            double weight, place = gauss8(i % 8, &weight);
            double t = from + span * (i / 8 + 0.5 + 0.5 * place) / PANELS, q = sin(t);
            double gamma = t - asin(ratio * q); /* angle from the sub-observer point */
            double up = cos(gamma) * cos(phi), out = sin(gamma) * sin(phi);
            /* integral of max(0, up + out cos a) over a full turn */
            double k = out > 0.0 ? fmin(fmax(-up / out, -1.0), 1.0) : up > 0.0 ? -1.0 : 1.0;
            double edge = acos(k), light = 2.0 * (up * edge + out * sin(edge));
            sum += span * weight * light * q * cos(t) / sqrt(1.0 - ratio * ratio * q * q);
        }
    }
    return sum;
}

double bst_scene_sphere_nearness(double ratio, double phase_rad) {
    double far = disc_light(0.0, fabs(phase_rad));
    return ratio > 0.0 && far > 0.0 ? disc_light(ratio, fabs(phase_rad)) / far : 1.0;
}

/* V magnitude of reflected sunlight at the range of the object, with the full Sun visible. */
static double full_v_mag(const bst_brightness *b, const bst_scene_lighting *l, double phase,
                         double range_m, double sun_distance_m) {
    const bst_brightness_config *c = &b->config;
    double au = sun_distance_m / BST_AU_M;
    double far = 5.0 * log10(range_m / STANDARD_RANGE_M) + 5.0 * log10(au);
    if (c->model == BST_BRIGHTNESS_STANDARD) {
        double law = bst_astro_sphere_phase(c->specular_fraction, phase) /
                     bst_astro_sphere_phase(c->specular_fraction, 0.5 * BST_PI);
        return law > 0.0 ? c->standard_v_mag - 2.5 * log10(law) + far : (double)INFINITY;
    }
    double curve = 1.0;
    if (c->model == BST_BRIGHTNESS_LIGHT_CURVE) {
        double x = b->curve.x_column == BY_PHASE ? phase / BST_DEG_RAD : l->seconds;
        if (b->curve.x_column == BY_TIME && c->light_curve_period_s > 0.0) {
            double turns = (x - b->curve.x[0]) / c->light_curve_period_s;
            x = b->curve.x[0] + (turns - floor(turns)) * c->light_curve_period_s;
        }
        curve = bst_curve_at(&b->curve, x);
        if (b->curve.y_column == AS_MAGNITUDE) {
            return curve + far;
        }
    }
    double v;
    if (c->specular_fraction > 0.0) {
        double ratio = l->albedo * l->area_m2 *
                       bst_astro_sphere_phase(c->specular_fraction, phase) /
                       (range_m * range_m * au * au);
        v = ratio > 0.0 ? BST_SUN_V_MAG - 2.5 * log10(ratio) : (double)INFINITY;
    } else {
        v = bst_world_lambert_sphere_v_mag(l->area_m2, l->albedo, phase, range_m, sun_distance_m);
    }
    return curve > 0.0 ? v - 2.5 * log10(curve) : (double)INFINITY;
}

/* Flux of a V magnitude relative to the Sun. */
static double ratio_of(double v_mag) {
    return pow(10.0, -0.4 * (v_mag - BST_SUN_V_MAG));
}

void bst_brightness_at(const bst_brightness *b, const bst_scene_lighting *l, bst_scene_glow *out) {
    assert(l && out);
    static const bst_brightness plain = {.config = {.model = BST_BRIGHTNESS_SPHERE}};
    b = b ? b : &plain;
    const bst_brightness_config *c = &b->config;
    bst_vec3 to_eye = bst_vec3_sub(l->eye_m, l->object_m);
    bst_vec3 to_sun = bst_vec3_sub(l->sun_m, l->object_m);
    double range_m = bst_vec3_norm(to_eye), phase = bst_vec3_angle(to_eye, to_sun);
    double full = full_v_mag(b, l, phase, range_m, bst_vec3_norm(to_sun));
    double sunlight = l->sunlight ? l->sunlight->light[BST_SUNLIGHT_V] : l->sunlit_fraction;
    *out =
        (bst_scene_glow){.v_mag = sunlight > 0.0 ? full - 2.5 * log10(sunlight) : (double)INFINITY,
                         .resolved = c->resolved};
    for (int k = 0; k < BST_SUNLIGHT_COLOURS; k++) {
        out->redness[k] = l->sunlight && sunlight > 0.0 ? l->sunlight->light[k] / sunlight : 1.0;
    }
    double law = bst_astro_sphere_phase(c->specular_fraction, phase);
    out->specular_share = law > 0.0 ? c->specular_fraction / (4.0 * BST_PI) / law : 0.0;
    double ratio = sqrt(l->area_m2 / BST_PI) / range_m, disc = 1.0;
    if (c->model != BST_BRIGHTNESS_SPHERE) {
        ratio = 0.0; /* a fixed magnitude does not depend on range */
    }
    if (ratio > NEAR_RATIO && ratio < 1.0) {
        double nearness = bst_scene_sphere_nearness(ratio, phase);
        double factor = out->specular_share + (1.0 - out->specular_share) * nearness;
        out->v_mag = factor > 0.0 ? out->v_mag - 2.5 * log10(factor) : (double)INFINITY;
        out->specular_share = factor > 0.0 ? out->specular_share / factor : 0.0;
        double limb = ratio * ratio / (1.0 + sqrt(1.0 - ratio * ratio));
        disc = 2.0 * limb / (ratio * ratio);
    }
    if (c->earthshine) {
        double sphere = l->albedo * l->area_m2;
        if (c->model == BST_BRIGHTNESS_STANDARD) {
            sphere = ratio_of(c->standard_v_mag) * STANDARD_RANGE_M * STANDARD_RANGE_M /
                     bst_astro_sphere_phase(c->specular_fraction, 0.5 * BST_PI);
        }
        double earth = sphere / (range_m * range_m) *
                       bst_scene_earthshine(c->specular_fraction, c->earth_albedo, l->object_m,
                                            l->eye_m, l->sun_m, &out->earth);
        double sun = ratio_of(out->v_mag), all = sun + earth;
        out->earth_share = all > 0.0 ? earth / all : 0.0;
        out->specular_share *= 1.0 - out->earth_share;
        out->v_mag = all > 0.0 ? BST_SUN_V_MAG - 2.5 * log10(all) : (double)INFINITY;
    }
    out->emission_sr = c->emissivity * l->area_m2 / (range_m * range_m) * disc;
    double warm = l->sunlit_fraction * pow(c->temperature_k, 4.0) +
                  (1.0 - l->sunlit_fraction) * pow(c->shadow_temperature_k, 4.0);
    out->temperature_k = sqrt(sqrt(warm));
    out->thermal_reflection = l->albedo > 0.0 ? (1.0 - c->emissivity) / l->albedo : 0.0;
}

void bst_scene_glow_dim(bst_scene_glow *glow, double part) {
    glow->v_mag = part > 0.0 ? glow->v_mag - 2.5 * log10(part) : (double)INFINITY;
    glow->emission_sr *= part;
    for (int i = 0; i < glow->emission_count; i++) {
        glow->emissions[i].sr *= part;
    }
}

/* Detected electrons per second of the thermal emission. */
static double thermal_electrons_per_s(const bst_camera *camera, const bst_scene_glow *glow) {
    if (glow->emission_count == 0) {
        return bst_camera_thermal_electrons_per_s(camera, glow->temperature_k, glow->emission_sr);
    }
    double sum = 0.0;
    for (int i = 0; i < glow->emission_count; i++) {
        const bst_scene_emission *e = &glow->emissions[i];
        for (int side = -1; side <= 1; side += 2) {
            sum += bst_camera_thermal_electrons_per_s(
                camera, e->temperature_k + side * e->deviation_k, 0.5 * e->sr);
        }
    }
    return sum;
}

double bst_scene_glow_electrons_per_s(const bst_camera *camera, const bst_scene_glow *glow,
                                      double *reflected) {
    bool thermal = camera->spectrum && bst_band_is_thermal(camera->spectrum);
    double sunlight = isinf(glow->v_mag) ? 0.0 : bst_camera_electrons_per_s(camera, glow->v_mag);
    if (camera->spectrum) {
        double red = bst_band_reddened_sun(camera->spectrum, glow->redness);
        sunlight *= glow->earth_share + (1.0 - glow->earth_share) * red;
    }
    if (thermal) {
        sunlight *= glow->thermal_reflection;
    }
    if (reflected) {
        *reflected = sunlight;
    }
    return sunlight + thermal_electrons_per_s(camera, glow);
}
