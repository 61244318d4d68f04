#include "sim/world/scene/stray.h"

#include <stdlib.h>

#include "sim/astro/curve_file.h"
#include "sim/core/file.h"
#include "sim/optics/band.h"

struct bst_scene_pst {
    int count;
    double pixel_m;
    bst_optics_pst_point points[];
};

/* Loads a table of point source transmittance. */
static bst_status load(bst_ctx *ctx, const char *file, const char *base_dir, bst_curve *curve) {
    static const char *const angle[] = {"angle_deg", NULL};
    static const char *const value[] = {"pst", NULL};
    const bst_curve_format format = {
        "a table of point source transmittance", angle, value, 0.0, 180.0, 0.0, 1e6};
    char path[1100];
    bst_file_resolve(base_dir, file, path, sizeof path);
    bst_status status = bst_curve_load(ctx, path, &format, curve);
    return status == BST_OK ? status : bst_fail_prefix(ctx, BST_ERR_CONFIG, "pst_file");
}

/* Checks the pixel pitch and the angles of a point source transmittance. */
static bst_status check(bst_ctx *ctx, const bst_scene_pst *pst) {
    if (!(pst->pixel_m > 0.0)) {
        return bst_fail(
            ctx, BST_ERR_CONFIG,
            "pixel_pitch_um: stray light by a table needs the pixel pitch; give it here or "
            "in the block optics");
    }
    for (int i = 1; i < pst->count; i++) {
        if (!(pst->points[i].angle_deg > pst->points[i - 1].angle_deg)) {
            return bst_fail(ctx, BST_ERR_CONFIG,
                            "pst/%d/angle_deg: angles have to ascend (found %g after %g)", i,
                            pst->points[i].angle_deg, pst->points[i - 1].angle_deg);
        }
    }
    return BST_OK;
}

bst_status bst_scene_pst_create(bst_ctx *ctx, const bst_background_config *config,
                                double optics_pixel_um, const char *base_dir, bst_scene_pst **out) {
    *out = NULL;
    bst_curve curve = {0};
    if (*config->pst_file && config->pst.count > 0) {
        return bst_fail(ctx, BST_ERR_CONFIG, "pst: give either the list or pst_file, not both");
    }
    bst_status status = BST_OK;
    if (*config->pst_file) {
        status = load(ctx, config->pst_file, base_dir, &curve);
    }
    int count = *config->pst_file ? curve.count : config->pst.count;
    if (status != BST_OK || count == 0) {
        bst_curve_free(&curve);
        return status;
    }
    bst_scene_pst *pst = malloc(sizeof *pst + (size_t)count * sizeof *pst->points);
    if (!pst) {
        bst_curve_free(&curve);
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for %d points of transmittance", count);
    }
    const bst_optics_pst_point *given = config->pst.items;
    pst->count = count;
    pst->pixel_m = 1e-6 * (config->pixel_pitch_um > 0.0 ? config->pixel_pitch_um : optics_pixel_um);
    for (int i = 0; i < count; i++) {
        pst->points[i] =
            *config->pst_file ? (bst_optics_pst_point){curve.x[i], curve.y[i]} : given[i];
    }
    bst_curve_free(&curve);
    status = check(ctx, pst);
    if (status != BST_OK) {
        free(pst);
        return status;
    }
    *out = pst;
    return BST_OK;
}

void bst_scene_pst_free(bst_scene_pst *pst) {
    free(pst);
}

double bst_scene_pst_at(const bst_scene_pst *pst, double angle_rad) {
    double angle = angle_rad / BST_DEG_RAD;
    const bst_optics_pst_point *p = pst->points;
    if (angle <= p[0].angle_deg || pst->count == 1) {
        return p[0].pst;
    }
    int i = 0;
    while (i + 2 < pst->count && angle > p[i + 1].angle_deg) {
        i++;
    }
    double s = fmin((angle - p[i].angle_deg) / (p[i + 1].angle_deg - p[i].angle_deg), 1.0);
    if (p[i].pst > 0.0 && p[i + 1].pst > 0.0) {
        return p[i].pst * pow(p[i + 1].pst / p[i].pst, s);
    }
    return (1.0 - s) * p[i].pst + s * p[i + 1].pst;
}

double bst_scene_pst_pixel_m(const bst_scene_pst *pst) {
    return pst->pixel_m;
}

double bst_scene_moon_v_mag(bst_vec3 moon_from_eye_m, bst_vec3 sun_from_moon_m) {
    double range = bst_vec3_norm(moon_from_eye_m), sun = bst_vec3_norm(sun_from_moon_m);
    double a = bst_vec3_angle(bst_vec3_scale(moon_from_eye_m, -1.0), sun_from_moon_m) / BST_DEG_RAD;
    return -12.73 + 0.026 * a + 4e-9 * a * a * a * a +
           5.0 * log10(range / 3.844e8 * (sun / BST_AU_M));
}

double bst_scene_disc_fraction(bst_vec3 eye_m, bst_vec3 body_m, double radius_m, bst_vec3 pole) {
    /* compares with a body of the Sun's angular size in the same direction */
    bst_vec3 from_eye = bst_vec3_sub(body_m, eye_m);
    return bst_astro_sun_fraction(
        eye_m, bst_vec3_axpy(eye_m, BST_SUN_RADIUS_M / radius_m, from_eye), pole);
}

/* Irradiance from the visible sunlit part of a Lambertian Earth, by midpoints of cells of equal
 * solid angle. */
static double earth_irradiance(const bst_scene_pst *pst, double albedo, bst_vec3 eye_m,
                               bst_vec3 sun_m, bst_vec3 boresight) {
    enum { RINGS = 16, SPOKES = 32 };
    double distance = bst_vec3_norm(eye_m);
    if (distance <= BST_EARTH_RADIUS_M) {
        return 0.0;
    }
    bst_vec3 nadir = bst_vec3_scale(eye_m, -1.0 / distance), sun = bst_vec3_unit(sun_m);
    bst_vec3 e1 = bst_vec3_unit(bst_vec3_perpendicular(nadir));
    bst_vec3 e2 = bst_vec3_cross(nadir, e1);
    double ratio = BST_EARTH_RADIUS_M / distance;
    double cap = 1.0 - sqrt(1.0 - ratio * ratio); /* solid angle over 2 pi */
    double sum = 0.0;
    for (int i = 0; i < RINGS; i++) {
        double c = 1.0 - cap * (i + 0.5) / RINGS, s = sqrt(1.0 - c * c);
        double way =
            distance * c -
            sqrt(fmax(BST_EARTH_RADIUS_M * BST_EARTH_RADIUS_M - distance * distance * s * s, 0.0));
        for (int k = 0; k < SPOKES; k++) {
            double phi = 2.0 * BST_PI * (k + 0.5) / SPOKES;
            bst_vec3 d = bst_vec3_axpy(bst_vec3_axpy(bst_vec3_scale(nadir, c), s * cos(phi), e1),
                                       s * sin(phi), e2);
            double lit = bst_vec3_dot(bst_vec3_axpy(eye_m, way, d), sun) / BST_EARTH_RADIUS_M;
            if (lit > 0.0) {
                sum += lit * bst_scene_pst_at(pst, bst_vec3_angle(d, boresight));
            }
        }
    }
    double au = bst_vec3_norm(sun_m) / BST_AU_M;
    double radiance = albedo / BST_PI * pow(10.0, -0.4 * BST_SUN_V_MAG) / (au * au);
    return radiance * sum * 2.0 * BST_PI * cap / (RINGS * SPOKES);
}

double bst_stray_irradiance(const bst_scene_pst *pst, const bst_background_config *config,
                            bst_vec3 eye_m, const bst_bodies *bodies, bst_vec3 boresight) {
    double sum = 0.0;
    bst_vec3 sun = bst_vec3_sub(bodies->sun_m, eye_m), moon = bst_vec3_sub(bodies->moon_m, eye_m);
    if (config->sun) {
        double au = bst_vec3_norm(sun) / BST_AU_M;
        sum += bst_astro_sun_fraction(eye_m, bodies->sun_m, bodies->pole) *
               pow(10.0, -0.4 * BST_SUN_V_MAG) / (au * au) *
               bst_scene_pst_at(pst, bst_vec3_angle(sun, boresight));
    }
    if (config->moon) {
        double v = bst_scene_moon_v_mag(moon, bst_vec3_sub(bodies->sun_m, bodies->moon_m));
        sum += bst_scene_disc_fraction(eye_m, bodies->moon_m, BST_MOON_RADIUS_M, bodies->pole) *
               pow(10.0, -0.4 * v) * bst_scene_pst_at(pst, bst_vec3_angle(moon, boresight));
    }
    if (config->earth) {
        sum += earth_irradiance(pst, config->earth_albedo, eye_m, bodies->sun_m, boresight);
    }
    return sum;
}
