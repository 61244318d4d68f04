#include "sim/astro/earth_limb.h"
#include "tests/test_support.h"

/* Fraction of a disc of radius a outside of one of radius b, centres c apart. */
static double fraction_at(double a, double b, double c) {
    return bst_earth_limb_share(&(bst_earth_limb){.beyond = c - b, .curvature = 1.0 / b}, a);
}

/* The same by summing strips of the Sun's disc. */
static double fraction_by_strips(double a, double b, double c) {
    const int strips = 200000;
    double covered = 0.0;
    for (int i = 0; i < strips; i++) {
        double x = a * (2.0 * (i + 0.5) / strips - 1.0), chord = sqrt(a * a - x * x);
        double earth2 = b * b - (x - c) * (x - c);
        covered += earth2 > 0.0 ? fmin(chord, sqrt(earth2)) : 0.0;
    }
    return 1.0 - covered * (2.0 * a / strips) * 2.0 / (BST_PI * a * a);
}

static void discs_of_equal_size(void **state) {
    (void)state;
    /* centre on the other's limb: overlap a^2 (2 pi / 3 - sqrt(3) / 2); angles good to 1e-13 */
    double expected = 1.0 - (2.0 / 3.0 - sqrt(3.0) / (2.0 * BST_PI));
    bst_assert_close(fraction_at(0.00465, 0.00465, 0.00465), expected, 1e-10);
}

static void partial_shadow_agrees_with_summed_strips(void **state) {
    (void)state;
    static const double earth[] = {1.15, 0.152, 0.01, 0.0047, 0.0046, 0.002};
    const double a = 0.00465;
    for (size_t k = 0; k < sizeof earth / sizeof *earth; k++) {
        double b = earth[k];
        for (int i = 1; i < 20; i++) {
            double c = fabs(b - a) + (b + a - fabs(b - a)) * i / 20.0;
            /* strips: error of the ends of 1e5^-1.5 */
            bst_assert_close(fraction_at(a, b, c), fraction_by_strips(a, b, c), 1e-7);
        }
    }
}

static void penumbra_is_monotonic_and_meets_its_ends(void **state) {
    (void)state;
    static const double earth[] = {1.15, 0.152, 0.00466, 0.00465, 0.00464, 0.001};
    const double a = 0.00465;
    for (size_t k = 0; k < sizeof earth / sizeof *earth; k++) {
        double b = earth[k], inner = fabs(b - a), outer = a + b, last = -1.0;
        double floor_fraction = b >= a ? 0.0 : 1.0 - b * b / (a * a);
        for (int i = -50; i <= 1050; i++) {
            double f = fraction_at(a, b, fmax(inner + (outer - inner) * i / 1000.0, 0.0));
            assert_true(f >= 0.0 && f <= 1.0);
            assert_true(f >= last - 1e-12); /* rounding of angles, by the disc's width */
            last = f;
        }
        assert_true(last == 1.0);
        /* on the edges and a hair off, no jump: the lens closes with the power 1.5 */
        bst_assert_close(fraction_at(a, b, inner), floor_fraction, 1e-8);
        bst_assert_close(fraction_at(a, b, inner + 1e-9 * a), floor_fraction, 1e-6);
        bst_assert_close(fraction_at(a, b, outer), 1.0, 1e-12);
        bst_assert_close(fraction_at(a, b, outer - 1e-9 * a), 1.0, 1e-12);
    }
}

static double sun_at(bst_vec3 position, bst_vec3 sun) {
    return bst_astro_sun_fraction(position, sun, bst_vec3_make(0, 0, 1));
}

static void places_around_the_earth(void **state) {
    (void)state;
    bst_vec3 sun = {BST_AU_M, 0, 0};
    assert_true(sun_at(bst_vec3_make(7e6, 0, 0), sun) == 1.0);      /* noon */
    assert_true(sun_at(bst_vec3_make(0, 4.2e7, 0), sun) == 1.0);    /* above the side */
    assert_true(sun_at(bst_vec3_make(-4.2e7, 0, 0), sun) == 0.0);   /* on the axis */
    assert_true(sun_at(bst_vec3_make(-4.2e7, 6e6, 0), sun) == 0.0); /* in umbra */
    assert_true(sun_at(bst_vec3_make(-4.2e7, 6.7e6, 0), sun) == 1.0);
    double part = sun_at(bst_vec3_make(-4.2e7, BST_EARTH_RADIUS_M, 0), sun);
    assert_true(part > 0.3 && part < 0.7);
    assert_true(sun_at(bst_vec3_make(-1e7, 4e8, 0), sun) == 1.0); /* beside, as far as the Moon */
    assert_true(sun_at(bst_vec3_make(0, 0, 0), sun) == 0.0);      /* centre of the Earth */
    assert_true(sun_at(bst_vec3_make(1e6, 0, 0), sun) == 0.0);
    assert_true(sun_at(bst_vec3_make(BST_EARTH_RADIUS_M, 0, 0), sun) == 1.0);
    assert_true(sun_at(bst_vec3_make(-BST_EARTH_RADIUS_M, 0, 0), sun) == 0.0);
    assert_true(sun_at(bst_vec3_make(2.0 * BST_AU_M, 0, 0), sun) == 1.0); /* beyond */
    assert_true(sun_at(sun, sun) == 1.0);

    /* The umbra ends where the discs have one size: d / (AU + d) = Re / Rs, 1.384e9 m. Beyond, the
     * Earth stands before the Sun: the fraction is 1 - (b / a)^2. */
    double tip = BST_AU_M * BST_EARTH_RADIUS_M / (BST_SUN_RADIUS_M - BST_EARTH_RADIUS_M);
    assert_true(sun_at(bst_vec3_make(-tip * 0.99, 0, 0), sun) == 0.0);
    assert_true(sun_at(bst_vec3_make(-tip * 1.0001, 0, 0), sun) > 0.0);
    double b = asin(BST_EARTH_RADIUS_M / 3e9), a = asin(BST_SUN_RADIUS_M / (BST_AU_M + 3e9));
    /* the ellipse seen from the side; the circle that osculates it at a pole or at the equator is
     * off by the flattening */
    bst_assert_close(sun_at(bst_vec3_make(-3e9, 0, 0), sun),
                     1.0 - b * b * (1.0 - BST_EARTH_FLATTENING) / (a * a), BST_EARTH_FLATTENING);
}

static const bst_vec3 north = {0, 0, 1};

/* The point of the ellipsoid at geodetic latitude and longitude, and its normal. */
static bst_vec3 surface(double latitude, double longitude, bst_vec3 *normal) {
    double e2 = BST_EARTH_FLATTENING * (2.0 - BST_EARTH_FLATTENING);
    double n = BST_EARTH_RADIUS_M / sqrt(1.0 - e2 * sin(latitude) * sin(latitude));
    *normal = bst_vec3_from_radec(longitude, latitude);
    return bst_vec3_make(n * normal->x, n * normal->y, n * (1.0 - e2) * normal->z);
}

static void grazing_lines(void **state) {
    (void)state;
    bst_mat3 turned = bst_quat_to_mat3(bst_quat_from_rotvec(bst_vec3_make(0.3, -0.7, 1.9)));
    bst_vec3 pole = bst_mat3_transpose_mul_vec(&turned, north);
    static const double reach_m[] = {1e3, 1e6, 4e7, 1.5e11, 1e17};
    for (int i = 0; i < 60; i++) {
        bst_vec3 normal, point = surface(-BST_PI / 2.0 + BST_PI * i / 59.0, 0.37 * i, &normal);
        bst_vec3 tangent = bst_vec3_perpendicular(normal);
        tangent = bst_vec3_add(bst_vec3_scale(tangent, cos(1.0 * i)),
                               bst_vec3_scale(bst_vec3_cross(normal, tangent), sin(1.0 * i)));
        for (size_t k = 0; k < sizeof reach_m / sizeof *reach_m; k++) {
            for (int up = -1; up <= 1; up += 2) {
                bst_vec3 middle = bst_vec3_axpy(point, 0.1 * up, normal);
                bst_vec3 a = bst_vec3_axpy(middle, -4e7, tangent);
                bst_vec3 b = bst_vec3_axpy(middle, reach_m[k], tangent);
                bst_vec3 a_gcrf = bst_mat3_transpose_mul_vec(&turned, a);
                bst_vec3 b_gcrf = bst_mat3_transpose_mul_vec(&turned, b);
                assert_true(bst_astro_earth_occults(a_gcrf, b_gcrf, pole) == (up < 0));
                assert_true(bst_astro_earth_occults(b_gcrf, a_gcrf, pole) == (up < 0));
            }
        }
    }
}

static void ends_of_the_line(void **state) {
    (void)state;
    bst_vec3 high = {0, 0, 4.2e7}, low = {0, 0, -4.2e7}, centre = {0, 0, 0}, inside = {0, 1e6, 2e6};
    bst_vec3 normal, ground = surface(0.8, 1.2, &normal);
    bst_vec3 tangent = bst_vec3_perpendicular(normal);
    assert_true(bst_astro_earth_occults(high, low, north));
    assert_false(bst_astro_earth_occults(high, high, north)); /* one and the same point */
    assert_true(bst_astro_earth_occults(centre, centre, north));
    assert_true(bst_astro_earth_occults(inside, inside, north));
    assert_true(bst_astro_earth_occults(high, centre, north));
    assert_true(bst_astro_earth_occults(inside, high, north));
    assert_false(bst_astro_earth_occults(ground, ground, north));
    /* from the surface: up, along the horizon, below it */
    bst_vec3 along = bst_vec3_axpy(ground, 1e7, tangent);
    assert_false(bst_astro_earth_occults(ground, bst_vec3_axpy(ground, 1e7, normal), north));
    assert_false(bst_astro_earth_occults(ground, bst_vec3_axpy(along, 1e4, normal), north));
    assert_true(bst_astro_earth_occults(ground, bst_vec3_axpy(along, -1e4, normal), north));
    assert_true(bst_astro_earth_occults(ground, bst_vec3_scale(ground, -1.0), north));
    assert_true(bst_astro_earth_occults(bst_vec3_axpy(ground, -1.0, normal), high, north));
    /* the line would meet the Earth only beyond its ends */
    assert_false(bst_astro_earth_occults(high, bst_vec3_scale(high, 0.5), north));
    /* over the pole, where a sphere of the equator's radius would hide it */
    bst_vec3 over_a = {-1e7, 0, 6.36e6}, over_b = {1e7, 0, 6.36e6};
    assert_false(bst_astro_earth_occults(over_a, over_b, north));
    bst_vec3 side_a = {-1e7, 6.36e6, 0}, side_b = {1e7, 6.36e6, 0};
    assert_true(bst_astro_earth_occults(side_a, side_b, north));
}

/* Half of the discriminant of a ray's meeting with the ellipsoid: 0 on the limb, below 0 outside.
 */
static double grazing(bst_vec3 position, bst_vec3 pole, bst_vec3 ray) {
    bst_vec3 p = bst_earth_unit_sphere(position, pole, 0.0),
             d = bst_earth_unit_sphere(ray, pole, 0.0);
    double b = bst_vec3_dot(p, d), dd = bst_vec3_dot(d, d);
    return b * b / dd - (bst_vec3_dot(p, p) - 1.0);
}

/* Place u towards the nadir of the limb at a distance v beside a direction, by bisection. */
static double limb_beside(bst_vec3 position, bst_vec3 pole, bst_vec3 towards, double v) {
    bst_vec3 up = bst_vec3_unit(position);
    bst_vec3 e1 = bst_vec3_unit(bst_vec3_axpy(up, -bst_vec3_dot(up, towards), towards));
    e1 = bst_vec3_scale(e1, -1.0);
    bst_vec3 e2 = bst_vec3_cross(towards, e1);
    double low = -0.3, high = 0.3;
    for (int i = 0; i < 60; i++) {
        double u = 0.5 * (low + high);
        bst_vec3 ray = bst_vec3_axpy(bst_vec3_axpy(towards, u, e1), v, e2);
        *(grazing(position, pole, ray) < 0.0 ? &low : &high) = u;
    }
    return 0.5 * (low + high);
}

/* The osculating circle of the limb, seen from all latitudes in all directions past a slanting
 * pole: its curvature and place by five points of the limb. */
static void limb_is_a_circle_nearby(void **state) {
    (void)state;
    bst_vec3 pole = bst_vec3_unit((bst_vec3){0.3, -0.5, 0.8});
    static const double radii[] = {6.9e6, 8.5e6, 4.2e7};
    for (int i = 0; i < 60; i++) {
        double r = radii[i % 3], a = 0.9 * i, z = cos(0.37 * i);
        bst_vec3 up = {sqrt(1.0 - z * z) * cos(a), sqrt(1.0 - z * z) * sin(a), z};
        bst_vec3 position = bst_vec3_scale(up, r);
        bst_vec3 side = bst_vec3_perpendicular(up);
        side = bst_vec3_add(bst_vec3_scale(side, cos(1.7 * i)),
                            bst_vec3_scale(bst_vec3_cross(up, side), sin(1.7 * i)));
        double off = asin(BST_EARTH_RADIUS_M / r) + 0.01 * (i % 5 - 2); /* from the nadir */
        bst_vec3 towards =
            bst_vec3_add(bst_vec3_scale(up, -cos(off)), bst_vec3_scale(side, sin(off)));
        double h = 2e-3, u[5];
        for (int k = 0; k < 5; k++) {
            u[k] = limb_beside(position, pole, towards, (k - 2) * h);
        }
        double slope = (u[0] - 8.0 * u[1] + 8.0 * u[3] - u[4]) / (12.0 * h);
        double bend = (-u[0] + 16.0 * u[1] - 30.0 * u[2] + 16.0 * u[3] - u[4]) / (12.0 * h * h);
        double root = sqrt(1.0 + slope * slope), radius = root * root * root / bend;
        double x = u[2] + radius / root, y = -radius * slope / root;
        bst_earth_limb limb;
        assert_true(bst_earth_limb_at(position, pole, 0.0, towards, &limb));
        /* differences of numbers to 1e-16 over h^2, and h^4 of the sixth derivative: 1e-9 */
        bst_assert_close(limb.curvature, 1.0 / radius, 1e-7 / radius);
        /* hypot - radius loses six digits of the radius, 0.1 to 10 */
        bst_assert_close(limb.beyond, hypot(x, y) - radius, 1e-9);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(discs_of_equal_size),
        cmocka_unit_test(partial_shadow_agrees_with_summed_strips),
        cmocka_unit_test(penumbra_is_monotonic_and_meets_its_ends),
        cmocka_unit_test(places_around_the_earth),
        cmocka_unit_test(grazing_lines),
        cmocka_unit_test(ends_of_the_line),
        cmocka_unit_test(limb_is_a_circle_nearby),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
