/* The Earth's gravity field against GeographicLib, closed forms and wrong files. */
#include <stdbool.h>
#include <stdlib.h>

#include "sim/astro/gravity_internal.h"
#include "tests/astro/spherical_harmonic.h"
#include "tests/test_support.h"

static bst_gravity *builtin(int degree, int order) {
    bst_ctx ctx = {0};
    bst_gravity *g;
    bst_assert_ok(&ctx, bst_gravity_builtin(&ctx, degree, order, &g));
    return g;
}

static double distance(bst_vec3 a, bst_vec3 b) {
    return bst_vec3_norm(bst_vec3_sub(a, b));
}

/* Points all over the sphere, at heights of 0 to 40,000 km, and on and beside the polar axis. */
enum { POINTS = 300 };
static bst_vec3 point(int i) {
    static const bst_vec3 special[] = {{0, 0, 6.8e6},   {0, 0, -6.8e6}, {1e-9, 0, 6.5e6},
                                       {0, 1e-3, -7e6}, {1, -1, 6.4e6}, {100, 50, 6.6e6},
                                       {6378137, 0, 0}, {0, -4.2e7, 0}, {1e9, 1e9, -1e9}};
    if (i < (int)(sizeof special / sizeof *special)) {
        return special[i];
    }
    double z = 1.0 - (2.0 * i + 1.0) / POINTS;
    bst_vec3 u = bst_vec3_from_radec(fmod(2.399963229728653 * i, 2.0 * BST_PI), asin(z));
    return bst_vec3_scale(u, 6378136.3 * (1.0 + 6.3 * pow((i % 17) / 16.0, 3.0)));
}

static void harmonics_agree_with_geographiclib(void **state) {
    (void)state;
    static const int cuts[][2] = {{2, 0}, {2, 2}, {6, 0}, {8, 3}, {20, 0}, {20, 7}, {20, 20}};
    for (size_t k = 0; k < sizeof cuts / sizeof *cuts; k++) {
        bst_gravity *g = builtin(cuts[k][0], cuts[k][1]);
        assert_int_equal(bst_gravity_degree(g), cuts[k][0]);
        assert_int_equal(bst_gravity_order(g), cuts[k][1]);
        for (int i = 0; i < POINTS; i++) {
            bst_vec3 p = point(i), a = bst_gravity_acceleration(g, p);
            const double xyz[3] = {p.x, p.y, p.z};
            double d[3];
            double u = test_spherical_harmonic(3.986004415e14, 6378136.3, cuts[k][0], cuts[k][1],
                                               bst_gravity_table, xyz, d);
            /* rounding: a few units of the last place of the whole */
            bst_assert_close(distance(a, (bst_vec3){d[0], d[1], d[2]}) / bst_vec3_norm(a), 0,
                             2e-15);
            bst_assert_close(bst_gravity_potential(g, p) / u, 1, 2e-15);
        }
        bst_gravity_free(g);
    }
}

/* The oblateness in closed form (Vallado, Fundamentals of Astrodynamics, equation 8-30). */
static void oblateness_has_its_closed_form(void **state) {
    (void)state;
    bst_gravity *g = builtin(2, 0);
    const double gm = 3.986004415e14, radius = 6378136.3, j2 = 0.000484165143790815 * sqrt(5.0);
    bst_assert_close(j2, 1.08263e-3, 1e-8); /* the Earth's, to the digits everybody knows */
    for (int i = 0; i < POINTS; i++) {
        bst_vec3 p = point(i);
        double r = bst_vec3_norm(p), s = p.z * p.z / (r * r);
        double k = -1.5 * j2 * gm * radius * radius / pow(r, 5);
        bst_vec3 expected = {-gm * p.x / pow(r, 3) + k * p.x * (1 - 5 * s),
                             -gm * p.y / pow(r, 3) + k * p.y * (1 - 5 * s),
                             -gm * p.z / pow(r, 3) + k * p.z * (3 - 5 * s)};
        /* rounding of either */
        bst_assert_close(distance(bst_gravity_acceleration(g, p), expected) * r * r / gm, 0, 3e-15);
    }
    bst_gravity_free(g);
}

static void a_point_mass_is_newton_s(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_gravity *g;
    bst_assert_ok(&ctx, bst_gravity_point(&ctx, 4e14, &g));
    bst_vec3 a = bst_gravity_acceleration(g, (bst_vec3){3e6, 4e6, 12e6}); /* 13,000 km */
    /* rounding */
    bst_assert_close(a.x, -4e14 * 3e6 / 2.197e21, 1e-15);
    bst_assert_close(a.z, -4e14 * 12e6 / 2.197e21, 1e-15);
    bst_assert_close(bst_gravity_potential(g, (bst_vec3){3e6, 4e6, 12e6}), 4e14 / 13e6, 1e-8);
    assert_true(bst_gravity_gm(g) == 4e14);
    bst_gravity_free(g);
    bst_gravity_free(NULL);
}

/* The built-in field as a file: highest degree first, with D exponents, errors, Windows line ends;
 * unnormalised when asked for. */
static char *field_text(int degree, bool unnormalised, const char *extra) {
    size_t room = 200 + (size_t)(degree + 1) * (size_t)(degree + 2) * 60 + strlen(extra);
    char *text = malloc(room), *end = text;
    assert_non_null(text);
    end += sprintf(end,
                   "some words\nproduct_type gravity_field\r\nearth_gravity_constant "
                   "0.3986004415D+15\r\nradius 6378136.3\nmax_degree %d\n%serrors no\n"
                   "end_of_head ====\r\n",
                   degree, unnormalised ? "norm unnormalized\n" : "");
    for (int n = degree; n >= 2; n--) {
        for (int m = 0; m <= n; m++) {
            double factor = 1.0;
            for (int k = n - m + 1; unnormalised && k <= n + m; k++) {
                factor /= k;
            }
            factor = unnormalised ? sqrt(factor * (m ? 2 : 1) * (2 * n + 1)) : 1.0;
            char c[40], s[40];
            snprintf(c, sizeof c, "%.17e", bst_gravity_table[bst_gravity_index(n, m)][0] * factor);
            snprintf(s, sizeof s, "%.17e", bst_gravity_table[bst_gravity_index(n, m)][1] * factor);
            *strchr(c, 'e') = 'D';
            end += sprintf(end, "gfc %d %d %s %s 1e-12 1e-12\r\n", n, m, c, s);
        }
    }
    strcpy(end, extra);
    return text;
}

static void a_file_gives_the_field_in_it(void **state) {
    (void)state;
    for (int form = 0; form < 2; form++) {
        char *text = field_text(20, form == 1, "\n\n");
        bst_ctx ctx = {0};
        bst_gravity *g, *own = builtin(12, 9);
        bst_assert_ok(&ctx, bst_gravity_read_buffer(&ctx, "f", text, strlen(text), 12, 9, &g));
        for (int i = 0; i < POINTS; i++) {
            bst_vec3 p = point(i), a = bst_gravity_acceleration(own, p);
            /* 17 digits are exact; factorials of the unnormalised round to 1e-14 of harmonics of
             * 1e-3 */
            bst_assert_close(distance(bst_gravity_acceleration(g, p), a) / bst_vec3_norm(a), 0,
                             form == 0 ? 0 : 1e-16);
        }
        bst_gravity_free(g);
        bst_gravity_free(own);
        free(text);
    }
}

static void refuse(const char *text, int degree, int order, bst_status status,
                   const char *message) {
    bst_ctx ctx = {0};
    bst_gravity *g;
    /* a copy of just the right size, so that sanitizers see reads beyond it */
    size_t bytes = strlen(text);
    char *copy = malloc(bytes + 1);
    assert_non_null(copy);
    memcpy(copy, text, bytes);
    assert_int_equal(bst_gravity_read_buffer(&ctx, "f.gfc", copy, bytes, degree, order, &g),
                     status);
    assert_null(g);
    assert_string_equal(ctx.message, message);
    free(copy);
}

#define HEAD "earth_gravity_constant 3.986004415e14\nradius 6378136.3\nmax_degree 2\nend_of_head\n"
#define ROWS "gfc 2 0 -4.8e-4 0\ngfc 2 1 0 0\n"

static void wrong_files_are_refused(void **state) {
    (void)state;
    const bst_status bad = BST_ERR_FORMAT;
    refuse("", 2, 2, bad, "f.gfc:0: the file ends before the line \"end_of_head\"");
    refuse("radius 6378136.3\n", 2, 2, bad,
           "f.gfc:1: the file ends before the line \"end_of_head\"");
    refuse("radius 6378136.3\nend_of_head\n", 2, 2, bad,
           "f.gfc:2: the header must give earth_gravity_constant, about 3.986e14 m^3/s^2 (found "
           "0)");
    refuse("earth_gravity_constant 4.9e12\nradius 1738e3\nend_of_head\n", 2, 2, bad,
           "f.gfc:3: the header must give earth_gravity_constant, about 3.986e14 m^3/s^2 (found "
           "4.9e+12)");
    refuse("gravity_constant 3.986e14\nend_of_head\n", 2, 2, bad,
           "f.gfc:2: the header must give radius, about 6.378e6 m (found 0)");
    refuse("gravity_constant 3.986e14\nradius 1e400\nend_of_head\n", 2, 2, bad,
           "f.gfc:2: radius (found \"1e400\"; expected a finite number)");
    refuse("gravity_constant nan\n", 2, 2, bad,
           "f.gfc:1: gravity_constant (found \"nan\"; expected a finite number)");
    refuse("norm half_normalized\n", 2, 2, bad,
           "f.gfc:1: norm (found \"half_normalized\"; expected fully_normalized or unnormalized)");
    refuse("max_degree -2\n", 2, 2, bad,
           "f.gfc:1: max_degree (found \"-2\"; expected a whole number 0 to 100000)");
    refuse(HEAD ROWS "gfc 2 2 1e-6 1e-6\n", 3, 2, bad,
           "f.gfc:4: the file has degree 2 at most (max_degree), 3 is asked for");
    refuse(HEAD ROWS, 2, 2, bad, "f.gfc:6: the file ends without degree 2, order 2");
    refuse(HEAD ROWS "gfc 2 2 1e-6", 2, 2, bad,
           "f.gfc:7: a coefficient is cut short (found \"1e-6\"; expected \"gfc\", degree, order, "
           "C, S)");
    refuse(HEAD "gfc 2 3 0 0\n", 2, 2, bad,
           "f.gfc:5: order (found \"3\"; expected at most the degree)");
    refuse(HEAD "gfc 3 0 0 0\n", 2, 2, bad,
           "f.gfc:5: degree (found \"3\"; expected at most the header's max_degree)");
    refuse(HEAD ROWS "gfc 2 0 0 0\n", 2, 2, bad,
           "f.gfc:7: a degree and order that came before (found \"0\"; expected each once)");
    refuse(HEAD "gfc 2 0 -4.8e-4x 0\n", 2, 2, bad,
           "f.gfc:5: C (found \"-4.8e-4x\"; expected a finite number)");
    refuse(HEAD "gfct 2 0 -4.8e-4 0 20000101\n", 2, 2, bad,
           "f.gfc:5: not a static coefficient (found \"gfct\"; expected \"gfc\": time-variable "
           "terms are not read)");
    refuse(HEAD, 2, 3, BST_ERR_ARGUMENT,
           "gravity field of degree 2, order 3 (allowed: degree 0 to 360, order 0 to the degree)");
    refuse(HEAD, 361, 3, BST_ERR_ARGUMENT,
           "gravity field of degree 361, order 3 (allowed: degree 0 to 360, order 0 to the "
           "degree)");
    char longest[700];
    memset(longest, 'a', sizeof longest - 1);
    longest[sizeof longest - 1] = '\0';
    refuse(longest, 2, 2, bad, "f.gfc:1: line of 699 characters (at most 511)");
    bst_ctx ctx = {0};
    bst_gravity *g;
    assert_int_equal(bst_gravity_read_buffer(&ctx, "f.gfc", "rad\0ius", 7, 2, 2, &g), bad);
    assert_int_equal(bst_gravity_load(&ctx, "nowhere.gfc", 2, 2, &g), BST_ERR_NOT_FOUND);
    assert_string_equal(ctx.message,
                        "nowhere.gfc: cannot be opened: No such file or directory; give a gravity "
                        "field in the ICGEM format");
    assert_int_equal(bst_gravity_load(&ctx, "tests", 2, 2, &g), BST_ERR_IO);
    assert_int_equal(bst_gravity_builtin(&ctx, 21, 0, &g), BST_ERR_ARGUMENT);
    assert_string_equal(ctx.message,
                        "built-in gravity field of degree 21, order 0 (allowed: degree 0 to 20, "
                        "order 0 to the degree)");
    assert_int_equal(bst_gravity_builtin(&ctx, 4, 5, &g), BST_ERR_ARGUMENT);
}

/* A field of degree 360, as large as is read: recursions and factors stay finite. */
static void the_largest_field_is_sound(void **state) {
    (void)state;
    const int degree = BST_GRAVITY_MAX_DEGREE;
    size_t count = bst_gravity_index(degree + 1, 0);
    double(*cs)[2] = calloc(count, sizeof *cs);
    assert_non_null(cs);
    for (size_t i = 3; i < count; i++) {
        cs[i][0] = 1e-9 * cos(0.7 * (double)i);
        cs[i][1] = 1e-9 * sin(1.3 * (double)i);
    }
    cs[0][0] = 1.0;
    for (int n = 2; n <= degree; n++) {
        cs[bst_gravity_index(n, 0)][1] = 0.0;
    }
    bst_ctx ctx = {0};
    bst_gravity *g;
    bst_assert_ok(&ctx, bst_gravity_make(&ctx, 3.986004415e14, 6378136.3, degree, degree,
                                         (const double(*)[2])cs, &g));
    for (int i = 0; i < 20; i++) {
        bst_vec3 p = point(i * 14), a = bst_gravity_acceleration(g, p);
        const double xyz[3] = {p.x, p.y, p.z};
        double d[3];
        test_spherical_harmonic(3.986004415e14, 6378136.3, degree, degree, (const double(*)[2])cs,
                                xyz, d);
        /* 65,000 terms whose recursions gather rounding over 360 degrees */
        bst_assert_close(distance(a, (bst_vec3){d[0], d[1], d[2]}) / bst_vec3_norm(a), 0, 1e-13);
    }
    bst_gravity_free(g);
    free(cs);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(harmonics_agree_with_geographiclib),
        cmocka_unit_test(oblateness_has_its_closed_form),
        cmocka_unit_test(a_point_mass_is_newton_s),
        cmocka_unit_test(a_file_gives_the_field_in_it),
        cmocka_unit_test(wrong_files_are_refused),
        cmocka_unit_test(the_largest_field_is_sound),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
