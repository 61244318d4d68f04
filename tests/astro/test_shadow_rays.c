/* The shadow against rays round the ellipsoid: lines from points of the Sun's disc to the place,
 * each with the quadratic equation of its meeting the ellipsoid. */
#include "sim/astro/bodies.h"
#include "tests/test_support.h"

#define POLAR_M 6356752.314245 /* WGS 84, as published */
enum { RAYS = 4000 };

/* What shadow a place is in. */
typedef struct scene {
    bst_vec3 pole, sun;
    double a, e, inclination, node, perigee; /* orbit about `pole`: m, rad */
} scene;

static bst_vec3 turned(bst_vec3 v, bst_vec3 axis, double angle) {
    return bst_quat_rotate(bst_quat_from_rotvec(bst_vec3_scale(axis, angle)), v);
}

static bst_vec3 place_at(const scene *s, double seconds) {
    double m = seconds * sqrt(BST_EARTH_MU_M3PS2 / (s->a * s->a * s->a)), big_e = m;
    for (int i = 0; i < 30; i++) {
        big_e = m + s->e * sin(big_e);
    }
    for (int i = 0; i < 10; i++) {
        big_e -= (big_e - s->e * sin(big_e) - m) / (1.0 - s->e * cos(big_e));
    }
    bst_vec3 p = {s->a * (cos(big_e) - s->e), s->a * sqrt(1.0 - s->e * s->e) * sin(big_e), 0.0};
    p = turned(p, bst_vec3_make(0, 0, 1), s->perigee);
    p = turned(p, bst_vec3_make(1, 0, 0), s->inclination);
    p = turned(p, bst_vec3_make(0, 0, 1), s->node);
    /* from axes with the pole along z to the scene's */
    bst_vec3 axis = bst_vec3_cross(bst_vec3_make(0, 0, 1), s->pole);
    double sine = bst_vec3_norm(axis);
    return sine > 0.0 ? turned(p, bst_vec3_scale(axis, 1.0 / sine), asin(sine)) : p;
}

/* Whether the line from the place towards a direction meets the ellipsoid: the discriminant of
 * (x^2 + y^2) / a^2 + z^2 / b^2 = 1 along it. */
static bool hidden(const scene *s, bst_vec3 from, bst_vec3 direction) {
    double a2 = BST_EARTH_RADIUS_M * BST_EARTH_RADIUS_M, b2 = POLAR_M * POLAR_M;
    double pz = bst_vec3_dot(from, s->pole), dz = bst_vec3_dot(direction, s->pole);
    bst_vec3 p = bst_vec3_axpy(from, -pz, s->pole), d = bst_vec3_axpy(direction, -dz, s->pole);
    double dd = bst_vec3_dot(d, d) / a2 + dz * dz / b2;
    double pd = bst_vec3_dot(p, d) / a2 + pz * dz / b2;
    double pp = bst_vec3_dot(p, p) / a2 + pz * pz / b2 - 1.0;
    return pd < 0.0 && pd * pd > dd * pp;
}

/* Point of the Sun's disc: x towards the Earth's middle, y across, in radii. */
static bst_vec3 sun_ray(const scene *s, bst_vec3 from, double x, double y) {
    bst_vec3 to_sun = bst_vec3_sub(s->sun, from);
    double distance = bst_vec3_norm(to_sun), angle = asin(BST_SUN_RADIUS_M / distance);
    bst_vec3 e3 = bst_vec3_scale(to_sun, 1.0 / distance);
    bst_vec3 e1 = bst_vec3_unit(bst_vec3_axpy(from, -bst_vec3_dot(from, e3), e3));
    bst_vec3 e2 = bst_vec3_cross(e3, e1);
    double off = angle * hypot(x, y), turn = atan2(y, -x);
    bst_vec3 across = bst_vec3_add(bst_vec3_scale(e1, cos(turn)), bst_vec3_scale(e2, sin(turn)));
    return bst_vec3_add(bst_vec3_scale(e3, cos(off)), bst_vec3_scale(across, sin(off)));
}

/* Rays from the rim: how many are hidden. */
static int hidden_rim(const scene *s, bst_vec3 from) {
    int count = 0;
    for (int i = 0; i < RAYS; i++) {
        double turn = 2.0 * BST_PI * i / RAYS;
        count += hidden(s, from, sun_ray(s, from, cos(turn), sin(turn)));
    }
    return count;
}

/* Free part of the disc by chords towards the Earth, each with the place where it becomes hidden.
 */
static double free_part(const scene *s, bst_vec3 from) {
    enum { CHORDS = 400 };
    double free = 0.0, all = 0.0;
    for (int i = 0; i < CHORDS; i++) {
        double y = cos(BST_PI * (i + 0.5) / CHORDS), half = sqrt(1.0 - y * y);
        double low = -half, high = half, weight = half;
        if (hidden(s, from, sun_ray(s, from, low, y))) {
            high = low;
        } else if (!hidden(s, from, sun_ray(s, from, high, y))) {
            low = high;
        }
        for (int k = 0; k < 40; k++) {
            double middle = 0.5 * (low + high);
            *(hidden(s, from, sun_ray(s, from, middle, y)) ? &high : &low) = middle;
        }
        free += weight * (low + half);
        all += weight * 2.0 * half;
    }
    return free / all;
}

enum { FIRST, SECOND, HALF, CONTACTS };

/* Whether the place is darker than a contact, by rays or by the function tested. */
static bool darker(const scene *s, double seconds, int contact, bool rays) {
    bst_vec3 from = place_at(s, seconds);
    double fraction = rays && contact != HALF ? 0.0
                      : rays                  ? free_part(s, from)
                                              : bst_astro_sun_fraction(from, s->sun, s->pole);
    if (contact == FIRST) {
        return rays ? hidden_rim(s, from) > 0 : fraction < 1.0;
    }
    if (contact == SECOND) {
        return rays ? hidden_rim(s, from) == RAYS : fraction <= 0.0;
    }
    return fraction < 0.5;
}

/* Instant between two times on different sides of a contact. */
static double contact_between(const scene *s, double lit, double dark, int contact, bool rays) {
    for (int i = 0; i < 40 && fabs(dark - lit) > 1e-6; i++) {
        double middle = 0.5 * (lit + dark);
        *(darker(s, middle, contact, rays) ? &dark : &lit) = middle;
    }
    return 0.5 * (lit + dark);
}

/* Compares contacts of one revolution; counts them. */
static void compare(const scene *s, int found[CONTACTS]) {
    double period = 2.0 * BST_PI * sqrt(s->a * s->a * s->a / BST_EARTH_MU_M3PS2);
    enum { STEPS = 2000 };
    for (int c = 0; c < CONTACTS; c++) {
        bool before = darker(s, 0.0, c, false);
        for (int i = 1; i <= STEPS; i++) {
            double t0 = period * (i - 1) / STEPS, t1 = period * i / STEPS;
            bool now = darker(s, t1, c, false);
            if (now != before) {
                double lit = now ? t0 : t1, dark = now ? t1 : t0;
                double ours = contact_between(s, lit, dark, c, false);
                /* rays at most 2 s off, or they would find no change */
                double side = now ? 1.0 : -1.0;
                double theirs = contact_between(s, ours - 2.0 * side, ours + 2.0 * side, c, true);
                bst_assert_close(ours, theirs, 0.02);
                found[c]++;
            }
            before = now;
        }
    }
}

static void contacts_of_orbits(void **state) {
    (void)state;
    bst_vec3 pole = bst_vec3_from_radec(1.1, BST_PI / 2.0 - 0.0025);
    /* solar declination, orbit, inclination, node from the Sun's meridian */
    static const double cases[][6] = {
        {0.0, 42164e3, 0.0, 0.0, 0.3, 0.0},  /* geostationary at the equinox */
        {8.55, 42164e3, 0.0, 0.0, 0.3, 0.0}, /* the last days of its season */
        {-8.6, 42164e3, 0.001, 0.1, 1.3, 0.0},
        {0.0, 6778e3, 1.6, 0.0, 0.0, 0.0},      /* polar, noon and midnight */
        {23.4, 6778e3, 1.5708, 1.1, 0.0, 0.0},  /* over the pole at the solstice */
        {23.4, 7178e3, 1.72, 1.0, 0.0, 0.0},    /* grazing */
        {-23.4, 7378e3, 1.5, 0.55, 2.0, 0.001}, /* beta near its end */
        {-10.0, 26560e3, 0.96, 2.0, 0.5, 0.01}, /* navigation */
        {5.0, 26600e3, 1.107, 1.2, 4.71, 0.72}, /* Molniya */
    };
    int found[CONTACTS] = {0};
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        const double *c = cases[k];
        scene s = {
            .pole = pole, .a = c[1], .e = c[5], .inclination = c[2], .node = c[3], .perigee = c[4]};
        /* declination about this pole */
        bst_vec3 equator = bst_vec3_unit(bst_vec3_perpendicular(pole));
        double d = c[0] * BST_DEG_RAD;
        s.sun = bst_vec3_scale(bst_vec3_axpy(bst_vec3_scale(equator, cos(d)), sin(d), pole),
                               BST_AU_M * 0.99);
        compare(&s, found);
    }
    assert_true(found[FIRST] >= 16 && found[SECOND] >= 10 && found[HALF] >= 16);
}

static void fractions_of_random_places(void **state) {
    (void)state;
    int partial = 0;
    for (int i = 0; i < 300; i++) {
        scene s = {.pole = bst_vec3_from_radec(0.7 * i, BST_PI / 2.0 - 0.0003 * (i % 9)),
                   .sun = bst_vec3_scale(bst_vec3_from_radec(1.7 * i, 0.4 * sin(1.3 * i)),
                                         BST_AU_M * (1.0 + 0.0167 * sin(0.9 * i)))};
        /* on the edge of the shadow, from the surface to the Moon */
        double way = 1e3 * pow(10.0, 5.5 * (i % 50) / 49.0);
        bst_vec3 down = bst_vec3_scale(bst_vec3_unit(s.sun), -1.0);
        bst_vec3 across = bst_vec3_unit(bst_vec3_perpendicular(down));
        across = turned(across, down, 2.1 * i);
        bst_vec3 edge = bst_vec3_axpy(bst_vec3_scale(across, 1.0), 0.0, down);
        double low = 6.3e6, high = 6.5e6 + 0.01 * way; /* where the middle of the Sun appears */
        for (int k = 0; k < 50; k++) {
            double middle = 0.5 * (low + high);
            bst_vec3 p = bst_vec3_axpy(bst_vec3_scale(edge, middle), way, down);
            /* of a Sun at the place itself all is seen, but from inside of the Earth */
            bool inside = bst_astro_sun_fraction(p, p, s.pole) == 0.0;
            *(inside || hidden(&s, p, bst_vec3_sub(s.sun, p)) ? &low : &high) = middle;
        }
        double shift = 0.0045 * way * sin(2.7 * i);
        shift = way < 3e5 ? fabs(shift) + 1.0 : shift; /* not into the ground */
        bst_vec3 p = bst_vec3_axpy(bst_vec3_scale(edge, high + shift), way, down);
        double expected = free_part(&s, p), found = bst_astro_sun_fraction(p, s.sun, s.pole);
        /* chords: 1e-5; the circle for the ellipse: flattening times the limb's radius */
        bst_assert_close(found, expected, 3e-5 + 4e-4 * way / 3e8);
        partial += expected > 0.05 && expected < 0.95;
    }
    assert_true(partial > 150);
}

/* Sunlight with the Sun's darkening by rays: a polar grid over the disc. */
static void limb_darkening(void **state) {
    (void)state;
    scene s = {.pole = {0, 0, 1}, .sun = {BST_AU_M, 0, 0}};
    for (int i = 0; i < 12; i++) {
        bst_vec3 p = {-4e7, 0.3 * (6378137.0 - 1.7e5 + 3.2e4 * i),
                      0.9539 * (6378137.0 - 1.7e5 + 3.2e4 * i)};
        enum { RINGS = 300, SPOKES = 600 };
        double light[2] = {0.0, 0.0};
        for (int r = 0; r < RINGS; r++) {
            double radius = (r + 0.5) / RINGS, mu = sqrt(1.0 - radius * radius);
            double bright = 0.30 + 0.93 * mu - 0.23 * mu * mu; /* 550 nm */
            for (int a = 0; a < SPOKES; a++) {
                double turn = 2.0 * BST_PI * (a + 0.5) / SPOKES;
                bst_vec3 ray = sun_ray(&s, p, radius * cos(turn), radius * sin(turn));
                light[0] += radius * bright * !hidden(&s, p, ray);
                light[1] += radius * bright;
            }
        }
        bst_astro_sunlight found;
        bst_astro_sunlight_at(p, s.sun, s.pole, false, &found);
        /* grid: 1e-3; four rings for the darkening: 1e-3 */
        bst_assert_close(found.light[BST_SUNLIGHT_V], light[0] / light[1], 2e-3);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(contacts_of_orbits),
        cmocka_unit_test(fractions_of_random_places),
        cmocka_unit_test(limb_darkening),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
