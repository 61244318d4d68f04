#include "sim/astro/bodies.h"

#define SUN_SCHWARZSCHILD_M (1.97412574336e-8 * BST_AU_M)

bst_light bst_light_at(const bst_bodies *bodies, bst_vec3 position_m, bst_vec3 velocity_mps) {
    return (bst_light){bst_vec3_add(bodies->earth_bary_mps, velocity_mps),
                       bst_vec3_sub(bodies->sun_m, position_m)};
}

/* Direction of a star after light deflection by the Sun. Near the Sun's centre the deflection is
 * limited as in eraLdsun. */
static bst_vec3 deflect(const bst_light *light, bst_vec3 p) {
    double distance = bst_vec3_norm(light->sun_m);
    double distance_au = distance * (1.0 / BST_AU_M);
    bst_vec3 e = bst_vec3_scale(light->sun_m, -1.0 / distance); /* Sun to observer */
    double pe = bst_vec3_dot(p, e);
    double limit = distance_au > 1.0 ? 1e-6 / (distance_au * distance_au) : 1e-6;
    double w = SUN_SCHWARZSCHILD_M / (distance * fmax(1.0 + pe, limit));
    return bst_vec3_axpy(p, w, bst_vec3_axpy(e, -pe, p));
}

bst_light_aberration bst_light_aberration_of(const bst_light *light) {
    bst_vec3 v = bst_vec3_scale(light->velocity_mps, 1.0 / BST_LIGHT_SPEED_MPS);
    double inverse_gamma = sqrt(1.0 - bst_vec3_dot(v, v));
    return (bst_light_aberration){v, inverse_gamma, 1.0 / (1.0 + inverse_gamma),
                                  SUN_SCHWARZSCHILD_M / bst_vec3_norm(light->sun_m)};
}

/* Apparent direction by stellar aberration. */
static bst_vec3 aberrate(const bst_light *light, bst_vec3 p) {
    bst_light_aberration a = bst_light_aberration_of(light);
    return bst_light_aberration_apply(&a, p);
}

bst_vec3 bst_light_apparent_star(const bst_light *light, bst_vec3 icrs) {
    return aberrate(light, deflect(light, icrs));
}

bst_vec3 bst_light_aberrate(const bst_light *light, bst_vec3 direction) {
    return aberrate(light, direction);
}

/* Inverts forward(light, p) = apparent by iteration. Each step reduces the error by the gradient of
 * deflection or aberration: 1e-4, and 0.02 in front of the Sun's disc. */
static bst_vec3 invert(bst_vec3 (*forward)(const bst_light *, bst_vec3), const bst_light *light,
                       bst_vec3 apparent) {
    bst_vec3 p = apparent;
    for (int i = 0; i < 12; i++) {
        bst_vec3 miss = bst_vec3_sub(apparent, forward(light, p));
        p = bst_vec3_unit(bst_vec3_add(p, miss));
        if (bst_vec3_dot(miss, miss) < 1e-30) {
            break;
        }
    }
    return p;
}

bst_vec3 bst_light_catalogue_star(const bst_light *light, bst_vec3 apparent) {
    return invert(bst_light_apparent_star, light, apparent);
}

bst_vec3 bst_light_unaberrate(const bst_light *light, bst_vec3 apparent) {
    return invert(aberrate, light, apparent);
}
