/* Temperatures of facets against closed forms. */
#include "sim/astro/bodies.h"
#include "sim/satellite/heat_history.h"
#include "tests/satellite/satellite_support.h"

#define SURFACE(more) \
    "\"materials\": [{\"name\": \"w\", \"diffuse\": 0.4, \"emissivity\": 0.7" more "}]"
#define PLATE(more) \
    "{" SURFACE(more) ", \"parts\": [{\"name\": \"p\", \"kind\": \"plate\", \"material\": " \
                      "\"w\"}]}"

/* A model with its absorptances. */
static bst_test_model open_model(const char *text) {
    bst_test_model m = bst_test_model_open(text);
    bst_satellite_make_surfaces(m.satellite);
    return m;
}

static const double S = BST_SOLAR_IRRADIANCE_WPM2, SIGMA = BST_STEFAN_BOLTZMANN;

/* A plate at an angle to the Sun: emissivity sigma T^4 = absorptance S cos. */
static void a_plate_emits_what_it_absorbs(void **state) {
    (void)state;
    static const char *const texts[] = {PLATE(""), PLATE(", \"absorptance\": 0.25")};
    static const double absorptance[] = {0.6, 0.25}; /* 1 - diffuse; as given */
    for (int k = 0; k < 2; k++) {
        bst_test_model m = open_model(texts[k]);
        for (int deg = 0; deg < 90; deg += 15) {
            double a = deg * BST_DEG_RAD, load[2];
            bst_heat_environment e = {.sun = {sin(a), 0, cos(a)}, .sunlight_wpm2 = S};
            bst_heat_loads(m.pose, &e, load);
            double want = pow(absorptance[k] * S * cos(a) / (0.7 * SIGMA), 0.25);
            /* the quadrature of bst_brdf_reflectance misses 0.4 by 1e-5 */
            bst_assert_close(bst_heat_steady_k(load[0], 0.7), want, k ? 1e-9 : 1e-5 * want);
            bst_assert_close(load[1], 0, 0);
        }
        bst_test_model_close(&m);
    }
}

/* Earthlight from three directions: cosines by hand, from the front alone, times the absorptance.
 */
static void earthlight_heats_by_its_directions(void **state) {
    (void)state;
    bst_test_model m = open_model(PLATE(", \"absorptance\": 0.25"));
    const bst_earthlight light = {.direction = {{0.6, 0, 0.8}, {0, -0.96, 0.28}, {0.8, 0, -0.6}},
                                  .irradiance = {0.02, 0.05, 0.4},
                                  .count = 3,
                                  .centre = {0, 0, 1}};
    const bst_heat_environment e = {
        .sun = {0, 0, -1}, .earth = {0, 0, 1}, .earthlight = &light, .earthlight_wpm2 = 1300.0};
    double load[2];
    bst_heat_loads(m.pose, &e, load);
    int front = m.pose->normals[0].z > 0.0 ? 0 : 1;
    bst_assert_close(load[front], 0.25 * 1300.0 * (0.02 * 0.8 + 0.05 * 0.28), 1e-9);
    bst_assert_close(load[1 - front], 0.25 * 1300.0 * 0.4 * 0.6, 1e-9);
    bst_test_model_close(&m);
}

/* A sphere of facets: each at its own temperature; together they emit what its disc absorbs. */
static void a_sphere_emits_what_its_disc_absorbs(void **state) {
    (void)state;
    bst_test_model m = open_model("{" SURFACE(
        "") ", \"parts\": [{\"name\": \"s\", \"kind\": \"sphere\", \"radius_m\": 2, "
            "\"segments\": 64, \"material\": \"w\"}]}");
    const bst_satellite *s = m.satellite;
    double *load = calloc((size_t)s->facet_count, sizeof *load), emitted = 0, hottest = 0;
    bst_heat_environment e = {.sun = bst_vec3_unit((bst_vec3){1, 2, -3}), .sunlight_wpm2 = S};
    bst_heat_loads(m.pose, &e, load);
    for (int i = 0; i < s->facet_count; i++) {
        double t = bst_heat_steady_k(load[i], 0.7);
        emitted += 0.7 * SIGMA * t * t * t * t * s->facets[i].area_m2;
        hottest = fmax(hottest, t);
    }
    double disc = 0.6 * S * BST_PI * 4;
    bst_assert_close(emitted, disc, 5e-3 * disc); /* the disc is one of facets of 6 degrees */
    double want = pow(0.6 * S / (0.7 * SIGMA), 0.25);
    bst_assert_close(hottest, want, 1e-3 * want); /* cos 3 degrees, fourth root */
    free(load);
    bst_test_model_close(&m);
}

/* The part of a sphere that a plane element sees, against a sum over the sphere's cap. */
static void the_view_factor_is_the_integral(void **state) {
    (void)state;
    enum { RINGS = 400, AROUND = 720 };
    static const double sines[] = {0.15, 0.5, 0.92};
    for (int k = 0; k < 3; k++) {
        for (int deg = 0; deg <= 180; deg += 20) {
            double a = deg * BST_DEG_RAD, sum = 0;
            bst_vec3 n = {sin(a), 0, cos(a)};
            double cap = 1 - sqrt(1 - sines[k] * sines[k]);
            for (int i = 0; i < RINGS; i++) {
                double c = 1 - cap * (i + 0.5) / RINGS, s = sqrt(1 - c * c);
                for (int j = 0; j < AROUND; j++) {
                    double b = 2 * BST_PI * (j + 0.5) / AROUND;
                    sum += fmax(n.x * s * cos(b) + n.z * c, 0) / (RINGS * AROUND);
                }
            }
            double want = sum * 2 * BST_PI * cap / BST_PI;
            /* cells of 1/400 of the cap at the border of the visible part */
            bst_assert_close(bst_heat_sphere_factor(cos(a), sines[k]), want, 2e-5);
        }
    }
    bst_assert_close(bst_heat_sphere_factor(1, 0.5), 0.25, 1e-15);
    bst_assert_close(bst_heat_sphere_factor(0, 0.5), (asin(0.5) - 0.5 * sqrt(0.75)) / BST_PI,
                     1e-15);
}

/* Over the night side only the Earth's infrared heats it: T^4 = F E / sigma, emissivity cancels. */
static void the_earth_heats_by_its_infrared(void **state) {
    (void)state;
    bst_test_model m = open_model(PLATE(""));
    double load[2], sine = 6378137.0 / 6878137.0;
    bst_heat_environment e = {
        .sun = {0, 0, 1}, .earth = {0, 0, 1}, .earth_sine = sine, .earth_infrared_wpm2 = 237};
    bst_heat_loads(m.pose, &e, load);
    bst_assert_close(bst_heat_steady_k(load[0], 0.7), pow(237 * sine * sine / SIGMA, 0.25), 1e-9);
    bst_assert_close(load[1], 0, 0);
    bst_test_model_close(&m);
}

/* Without a load: 1 / T^3 grows by 3 emissivity sigma t / C. */
static void a_surface_cools_by_its_closed_form(void **state) {
    (void)state;
    static const double dark[2] = {0, 0};
    for (double t = 1; t < 2e4; t *= 3) {
        double want = pow(1 / (350.0 * 350 * 350) + 3 * 0.7 * SIGMA * t / 5000, -1.0 / 3);
        /* fourth order with ten steps a time constant */
        bst_assert_close(bst_heat_after(350, dark, 0.7, 5000, t), want, 1e-4);
    }
    const double rising[2] = {100, 400}; /* almost no heat capacity: it follows */
    bst_assert_close(bst_heat_after(350, rising, 0.7, 1e-6, 60), bst_heat_steady_k(400, 0.7), 1e-9);
    /* it lags by its time constant, C / (4 emissivity sigma T^3), times dT/dt = T / (4 q) dq/dt */
    double last = bst_heat_steady_k(400, 0.7), slope = last / (4 * 400) * 300 / 60;
    double lag = 5 / (4 * 0.7 * SIGMA * last * last * last) * slope;
    bst_assert_close(bst_heat_after(350, rising, 0.7, 5, 60), last - lag, 0.03 * lag + 0.01);
    /* small steps are exponential with the time constant C / (4 emissivity sigma T^3) */
    double q = 0.7 * SIGMA * 300 * 300 * 300 * 300, tau = 5000 / (4 * 0.7 * SIGMA * 2.7e7);
    const double level[2] = {q, q};
    double left = bst_heat_after(300.01, level, 0.7, 5000, tau) - 300;
    bst_assert_close(left, 0.01 * exp(-1), 1e-6);
}

/* A plate that the Sun lights from a time on. */
typedef struct sunrise {
    double at_s;
    int calls;
} sunrise;

static bool rise(void *user, bst_satellite_pose *pose, double seconds, bst_heat_environment *out) {
    (void)pose;
    sunrise *s = user;
    s->calls++;
    *out = (bst_heat_environment){.sun = {0, 0, 1},
                                  .earth = {0, 0, 1},
                                  .earth_sine = 0.9,
                                  .earth_infrared_wpm2 = 237,
                                  .sunlight_wpm2 = seconds >= s->at_s ? S : 0};
    return true;
}

/* Sunlight that grows by 0.05 W/m^2 each second. */
static bool brighten(void *user, bst_satellite_pose *pose, double seconds,
                     bst_heat_environment *out) {
    sunrise always = {.at_s = -INFINITY};
    (void)user;
    (void)rise(&always, pose, seconds, out);
    out->sunlight_wpm2 = 0.05 * seconds;
    return true;
}

/* A load that grows evenly, against C dT/dt = load - emissivity sigma T^4 in steps of 1 s. Within a
 * step of 60 s the history takes the load as even too, so that half a step of delay (1 K) shows. */
static void a_history_follows_a_growing_load(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_test_model m = open_model(PLATE(", \"heat_capacity_j_per_m2_k\": 4000"));
    bst_heat_history *h;
    bst_assert_ok(&ctx, bst_heat_history_create(&ctx, m.satellite, &h));
    double kelvin = 300.0;
    for (int t = 2000; t <= 24000; t++) {
        if (t >= 22000 && t % 420 == 0) {
            bst_assert_close(bst_heat_history_at(h, m.pose, t, brighten, NULL)[0], kelvin, 0.02);
        }
        double load = 0.7 * 237 * 0.81 + 0.6 * 0.05 * (t + 0.5);
        double half = kelvin + 0.5 * (load - 0.7 * SIGMA * pow(kelvin, 4)) / 4000;
        kelvin += (load - 0.7 * SIGMA * pow(half, 4)) / 4000;
    }
    bst_heat_history_free(h);
    bst_test_model_close(&m);
}

/* The step response: from one steady state to the other, in the order of time and in any other. */
static void a_history_has_its_time_constant(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_test_model m = open_model(PLATE(", \"heat_capacity_j_per_m2_k\": 4000"));
    bst_heat_history *h, *other;
    bst_assert_ok(&ctx, bst_heat_history_create(&ctx, m.satellite, &h));
    bst_assert_ok(&ctx, bst_heat_history_create(&ctx, m.satellite, &other));
    sunrise s = {.at_s = 6000.5};
    double cold = 0.7 * 237 * 0.81, hot = cold + 0.6 * S, before = pow(cold / 0.7 / SIGMA, 0.25);
    double truth = before, at[12];
    for (int i = 0; i < 12; i++) {
        double t = 5900 + 300 * i;
        at[i] = bst_heat_history_at(h, m.pose, t, rise, &s)[0];
        const double load[2] = {hot, hot};
        truth = t > s.at_s ? bst_heat_after(before, load, 0.7, 4000, t - s.at_s) : before;
        /* the sunrise is spread over a step of 60 s at most, 18 K; later that fades */
        double since = t - s.at_s;
        bst_assert_close(at[i], truth, since < 0 ? 2e-2 : 10 * exp(-since / 700) + 2e-2);
    }
    assert_true(truth > before + 100);
    for (int i = 11; i >= 0; i -= 3) {
        bst_assert_close(bst_heat_history_at(other, m.pose, 5900 + 300 * i, rise, &s)[0], at[i], 0);
    }
    s.calls = 0; /* on the same chain, a step further costs one load */
    (void)bst_heat_history_at(h, m.pose, 9200 + 60, rise, &s);
    assert_true(s.calls <= 2);
    bst_heat_history_free(h);
    bst_heat_history_free(other);
    bst_test_model_close(&m);
}

/* Sorted by temperature, the emission keeps its area and its moments. */
static void emission_keeps_its_moments(void **state) {
    (void)state;
    bst_test_model m = open_model("{" SURFACE(
        "") ", \"parts\": [{\"name\": \"s\", \"kind\": \"sphere\", \"segments\": 32, "
            "\"material\": \"w\"}]}");
    const bst_satellite *s = m.satellite;
    double *kelvin = calloc((size_t)s->facet_count, sizeof *kelvin), want[5] = {0}, got[5] = {0};
    bst_vec3 eye = bst_vec3_unit((bst_vec3){1, 1, 0.3});
    for (int i = 0; i < s->facet_count; i++) {
        kelvin[i] = 300 + 80 * m.pose->normals[i].x;
        double area = 0.7 * s->facets[i].area_m2 * fmax(bst_vec3_dot(m.pose->normals[i], eye), 0);
        for (int k = 0; k < 5; k++) {
            want[k] += area * pow(kelvin[i] / 300, 3 * k);
        }
    }
    bst_thermal_emission e;
    bst_heat_emission(m.pose, eye, kelvin, &e);
    assert_true(e.count > 3 && e.count <= BST_EMISSION_BINS);
    for (int b = 0; b < e.count; b++) {
        for (int k = 0; k < 5; k++) {
            double t = e.bins[b].kelvin, d = e.bins[b].deviation;
            got[k] +=
                0.5 * e.bins[b].area_m2 * (pow((t - d) / 300, 3 * k) + pow((t + d) / 300, 3 * k));
        }
    }
    for (int k = 0; k < 5; k++) { /* Planck's law in the MWIR goes as T^12 */
        bst_assert_close(got[k], want[k], 2e-4 * want[k]);
    }
    free(kelvin);
    bst_test_model_close(&m);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_plate_emits_what_it_absorbs),
        cmocka_unit_test(earthlight_heats_by_its_directions),
        cmocka_unit_test(a_sphere_emits_what_its_disc_absorbs),
        cmocka_unit_test(the_view_factor_is_the_integral),
        cmocka_unit_test(the_earth_heats_by_its_infrared),
        cmocka_unit_test(a_surface_cools_by_its_closed_form),
        cmocka_unit_test(a_history_has_its_time_constant),
        cmocka_unit_test(a_history_follows_a_growing_load),
        cmocka_unit_test(emission_keeps_its_moments),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
