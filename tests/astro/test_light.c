#include <erfa.h>

#include "sim/astro/bodies.h"
#include "tests/astro/astropy_reference.h"
#include "tests/test_support.h"

#define MICROARCSEC (1e-6 * BST_ARCSEC_RAD)

static bst_vec3 vec(const double v[3]) {
    return bst_vec3_make(v[0], v[1], v[2]);
}

static bst_light light_at(const char *utc, bst_vec3 position_m, bst_vec3 velocity_mps) {
    bst_ctx ctx = {0};
    bst_time t;
    bst_bodies bodies;
    bst_assert_ok(&ctx, bst_time_from_utc(&ctx, utc, &t));
    bst_bodies_at(t, &bodies);
    return bst_light_at(&bodies, position_m, velocity_mps);
}

/* Directions over the whole sky, without a generator: a Fibonacci lattice. */
static bst_vec3 lattice(int i, int n) {
    double z = 1.0 - (2.0 * i + 1.0) / n, r = sqrt(1.0 - z * z);
    double a = i * BST_PI * (3.0 - sqrt(5.0));
    return bst_vec3_make(r * cos(a), r * sin(a), z);
}

static void stars_agree_with_astropy(void **state) {
    (void)state;
    for (size_t i = 0; i < sizeof reference_stars / sizeof *reference_stars; i++) {
        bst_light light = light_at(reference_stars[i].utc, vec(reference_stars[i].position_m),
                                   vec(reference_stars[i].velocity_mps));
        bst_vec3 seen = bst_light_apparent_star(&light, vec(reference_stars[i].icrs));
        /* TT for TDB moves the Earth's velocity by 1e-5 m/s, 7 nanoarcsec; required is 1 mas */
        bst_assert_close(bst_vec3_angle(seen, vec(reference_stars[i].apparent)), 0.0,
                         0.1 * MICROARCSEC);
        bst_vec3 back = bst_light_catalogue_star(&light, vec(reference_stars[i].apparent));
        bst_assert_close(bst_vec3_angle(back, vec(reference_stars[i].icrs)), 0.0,
                         0.1 * MICROARCSEC);
    }
}

static void stars_agree_with_erfa(void **state) {
    (void)state;
    bst_light light = light_at("2022-06-16T22:10:00Z", bst_vec3_make(7.1e6, 4e5, 5e5),
                               bst_vec3_make(1, 2, 7.5e3));
    double sun_distance_m = bst_vec3_norm(light.sun_m);
    bst_vec3 to_observer = bst_vec3_scale(light.sun_m, -1.0 / sun_distance_m);
    double em = sun_distance_m / BST_AU_M;
    double e[3] = {to_observer.x, to_observer.y, to_observer.z};
    bst_vec3 beta = bst_vec3_scale(light.velocity_mps, 1.0 / BST_LIGHT_SPEED_MPS);
    double v[3] = {beta.x, beta.y, beta.z};
    double bm1 = sqrt(1.0 - bst_vec3_dot(beta, beta));
    for (int i = 0; i < 2010; i++) {
        /* the whole sky, then towards the Sun from 1 degree to its centre */
        bst_vec3 star = lattice(i, 2000);
        if (i >= 2000) {
            bst_vec3 side = bst_vec3_perpendicular(to_observer);
            star = bst_vec3_unit(
                bst_vec3_axpy(bst_vec3_scale(to_observer, -1.0), 0.0175 * (2009 - i) / 9.0, side));
        }
        double p[3] = {star.x, star.y, star.z}, deflected[3], seen[3];
        eraLdsun(p, e, em, deflected);
        eraAb(deflected, v, em, bm1, seen);
        /* the same equations: a few roundings of 1e-16 */
        bst_assert_close(bst_vec3_angle(bst_light_apparent_star(&light, star), vec(seen)), 0.0,
                         2e-15);
        eraAb(p, v, em, bm1, seen);
        bst_assert_close(bst_vec3_angle(bst_light_aberrate(&light, star), vec(seen)), 0.0, 2e-15);
    }
}

/* Beside the Sun from other distances than the Earth's, without motion: within some arcminutes of
 * its centre the deflection is limited, by the square of the distance beyond 1 au. */
static void deflection_from_other_distances(void **state) {
    (void)state;
    static const double distances_au[] = {0.4, 0.99, 1.02, 1.9, 5.0};
    for (int k = 0; k < 5; k++) {
        const bst_vec3 towards = bst_vec3_unit((bst_vec3){0.3, -0.8, 0.2});
        const bst_light light = {{0, 0, 0}, bst_vec3_scale(towards, distances_au[k] * BST_AU_M)};
        double e[3] = {-towards.x, -towards.y, -towards.z}, deflected[3];
        for (int i = 0; i < 24; i++) {
            const double off = 1e-5 * pow(2.0, 0.6 * i); /* 2 arcsec to 8 degrees */
            const bst_vec3 star =
                bst_vec3_unit(bst_vec3_axpy(towards, tan(off), bst_vec3_perpendicular(towards)));
            double p[3] = {star.x, star.y, star.z};
            eraLdsun(p, e, distances_au[k], deflected);
            /* ERFA's result is no unit vector: the square of the deflection, 1e-11 rad */
            bst_assert_close(bst_vec3_angle(bst_light_apparent_star(&light, star), vec(deflected)),
                             0.0, MICROARCSEC);
        }
    }
}

static void inverses_return_to_the_start(void **state) {
    (void)state;
    bst_light light =
        light_at("2025-01-03T00:00:00Z", bst_vec3_make(-4.2e7, 0, 0), bst_vec3_make(0, -3.07e3, 0));
    for (int i = 0; i < 2010; i++) {
        bst_vec3 star = lattice(i, 2000);
        if (i >= 2000) { /* before and beside the Sun's disc, where deflection is steepest */
            bst_vec3 sun = bst_vec3_unit(light.sun_m);
            star = bst_vec3_unit(
                bst_vec3_axpy(sun, 0.006 * (2009 - i) / 9.0, bst_vec3_perpendicular(sun)));
        }
        bst_vec3 seen = bst_light_apparent_star(&light, star);
        bst_assert_close(bst_vec3_norm(seen), 1.0, 4e-16 * 2);
        /* the header's bound */
        bst_assert_close(bst_vec3_angle(bst_light_catalogue_star(&light, seen), star), 0.0, 1e-12);
        seen = bst_light_aberrate(&light, star);
        bst_assert_close(bst_vec3_angle(bst_light_unaberrate(&light, seen), star), 0.0, 1e-12);
    }
}

static void aberration_points_forward(void **state) {
    (void)state;
    /* perpendicular to the motion, without a Sun nearby: sin(shift) = v / c (special relativity) */
    bst_light light = {{3e4, 0, 0}, {0, 1e30, 0}};
    bst_vec3 seen = bst_light_aberrate(&light, bst_vec3_make(0, 0, 1));
    bst_assert_close(seen.x, 3e4 / BST_LIGHT_SPEED_MPS, 1e-18); /* rounding of 1e-4 */
    bst_assert_close(seen.y, 0.0, 1e-18);
    /* straight ahead nothing moves */
    seen = bst_light_aberrate(&light, bst_vec3_make(1, 0, 0));
    bst_assert_close(bst_vec3_angle(seen, bst_vec3_make(1, 0, 0)), 0.0, 1e-16);
}

/* Barycentric light path and aberration must give the same as the frame that moves with the Earth,
 * where light time and aberration know the geocentric velocities alone. */
static void near_objects_do_not_see_the_earths_motion_twice(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_time t;
    bst_bodies bodies;
    bst_assert_ok(&ctx, bst_time_from_utc(&ctx, "2022-06-16T22:10:00Z", &t));
    bst_bodies_at(t, &bodies);
    bst_vec3 observer = {7.1e6, 4e5, 5e5}, observer_velocity = {-4e2, 1.2e3, 7.3e3};
    bst_vec3 object = {-2.0e7, 3.7e7, 1.0e6}, object_velocity = {-2.7e3, -1.46e3, 30.0};
    bst_light moving = bst_light_at(&bodies, observer, observer_velocity);
    bst_light geocentric = {observer_velocity, moving.sun_m};

    double tau_geo = 0.0, tau = 0.0;
    bst_vec3 path_geo = {0}, path = {0};
    for (int i = 0; i < 8; i++) {
        bst_vec3 then = bst_vec3_axpy(object, -tau_geo, object_velocity);
        path_geo = bst_vec3_sub(then, observer);
        tau_geo = bst_vec3_norm(path_geo) / BST_LIGHT_SPEED_MPS;
        then = bst_vec3_axpy(object, -tau, object_velocity);
        path = bst_light_path(&bodies, then, observer, tau);
        tau = bst_vec3_norm(path) / BST_LIGHT_SPEED_MPS;
    }
    bst_vec3 a = bst_light_aberrate(&geocentric, bst_vec3_unit(path_geo));
    bst_vec3 b = bst_light_aberrate(&moving, bst_vec3_unit(path));
    /* They differ in second order: (v/c)^2 = 1e-8 times the angles and velocity ratios. Counting
     * the Earth once too often or too seldom would be 1e-4. */
    bst_assert_close(bst_vec3_angle(a, b), 0.0, 1e-8);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(stars_agree_with_astropy),
        cmocka_unit_test(stars_agree_with_erfa),
        cmocka_unit_test(deflection_from_other_distances),
        cmocka_unit_test(inverses_return_to_the_start),
        cmocka_unit_test(aberration_points_forward),
        cmocka_unit_test(near_objects_do_not_see_the_earths_motion_twice),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
