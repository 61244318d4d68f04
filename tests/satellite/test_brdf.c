/* Reflectance models: reciprocity, energy, and known values. */
#include "tests/satellite/satellite_support.h"

static const bst_brdf models[] = {
    {.model = BST_BRDF_LAMBERT, .diffuse = 1.0},
    {.model = BST_BRDF_PHONG, .diffuse = 0.3, .specular = 0.7, .exponent = 1},
    {.model = BST_BRDF_PHONG, .diffuse = 0.3, .specular = 0.7, .exponent = 500},
    {.model = BST_BRDF_ASHIKHMIN_SHIRLEY, .diffuse = 0.9, .specular = 0.05, .exponent = 10},
    {.model = BST_BRDF_ASHIKHMIN_SHIRLEY, .diffuse = 0.0, .specular = 1.0, .exponent = 1000},
    {.model = BST_BRDF_COOK_TORRANCE, .specular = 1.0, .roughness = 0.02},
    {.model = BST_BRDF_COOK_TORRANCE, .specular = 1.0, .roughness = 0.7},
    {.model = BST_BRDF_COOK_TORRANCE, .specular = 0.04, .diffuse = 0.9, .roughness = 0.3},
    {.model = BST_BRDF_MAXWELL_BEARD,
     .specular = 0.3,
     .diffuse = 0.2,
     .volume = 0.1,
     .roughness = 0.2,
     .tau_rad = 0.5,
     .omega_rad = 0.5},
    {.model = BST_BRDF_MAXWELL_BEARD, .specular = 0.9, .roughness = 0.05},
};
enum { MODELS = sizeof models / sizeof models[0] };

/* The models, then the library. */
static int count(void) {
    int n = 0;
    while (bst_material_library_names[n + 1]) {
        n++;
    }
    return MODELS + n;
}

static const bst_brdf *at(int i) {
    return i < MODELS ? &models[i] : &bst_material_library(i - MODELS + 1)->brdf;
}

static void all_are_reciprocal(void **state) {
    (void)state;
    uint64_t random = 9;
    for (int m = 0; m < count(); m++) {
        for (int i = 0; i < 1000; i++) {
            bst_vec3 a = bst_test_direction(&random), b = bst_test_direction(&random);
            double x = fabs(a.z), y = fabs(b.z), c = a.x * b.x + a.y * b.y + x * y;
            double forth = bst_brdf_value(at(m), x, y, c), back = bst_brdf_value(at(m), y, x, c);
            assert_true(isfinite(forth) && forth >= 0.0);
            bst_assert_close(forth, back, 1e-12 * forth);
        }
    }
}

static void none_makes_light(void **state) {
    (void)state;
    for (int m = 0; m < count(); m++) {
        for (int deg = 0; deg <= 88; deg += 8) {
            double share = bst_brdf_reflectance(at(m), cos(deg * BST_DEG_RAD));
            if (!(share <= 1.003)) { /* the accuracy of the integral */
                fail_msg("model %d reflects %g at %d degrees", m, share, deg);
            }
        }
    }
}

static void known_reflectances(void **state) {
    (void)state;
    /* Lambert: its albedo at all angles; Phong at normal incidence: both coefficients, as the lobe
     * is cut nowhere; GGX of a narrow mirror: its Fresnel factor */
    bst_assert_close(bst_brdf_reflectance(&models[0], 0.3), 1.0, 1e-3);
    bst_assert_close(bst_brdf_reflectance(&models[2], 1.0), 0.3 + 0.7, 2e-3);
    bst_brdf mirror = {.model = BST_BRDF_COOK_TORRANCE, .specular = 0.5, .roughness = 0.01};
    double c = cos(60 * BST_DEG_RAD);
    bst_assert_close(bst_brdf_reflectance(&mirror, c), 0.5 + 0.5 * pow(1 - c, 5), 5e-3);
    /* the diffuse part of Ashikhmin and Shirley reflects Rd (1 - Rs) at normal incidence: their
     * equation 5, 28/23 * (31/32) * 2 * integral of (1 - (1 - u/2)^5) u du */
    bst_brdf rough = {
        .model = BST_BRDF_ASHIKHMIN_SHIRLEY, .diffuse = 0.5, .specular = 0.0, .exponent = 0};
    double sum = 0.0;
    for (int i = 0; i < 100000; i++) {
        double u = (i + 0.5) / 100000;
        sum += (1 - pow(1 - u / 2, 5)) * u / 100000;
    }
    double expected = 28.0 / 23.0 * 0.5 * (31.0 / 32.0) * 2.0 * sum;
    double fresnel = bst_brdf_reflectance(&rough, 1.0) - expected; /* of reflectance 0 at normal */
    assert_true(fresnel > 0.0 && fresnel < 0.05);
}

static double fresnel_of(double at_normal, double cosine) {
    return at_normal + (1.0 - at_normal) * pow(1.0 - cosine, 5.0);
}

/* Each model by its publication, for directions of two angles out of one plane. */
static void values_by_vectors(void **state) {
    (void)state;
    const bst_vec3 n = {0, 0, 1}, in = bst_vec3_unit((bst_vec3){0.5, 0.2, 0.9}),
                   out = bst_vec3_unit((bst_vec3){0.9, 0.5, 0.25});
    const bst_vec3 h = bst_vec3_unit(bst_vec3_add(in, out));
    double ni = in.z, no = out.z, nh = h.z, hi = bst_vec3_dot(h, in), io = bst_vec3_dot(in, out);
    bst_vec3 mirror = bst_vec3_sub(bst_vec3_scale(n, 2.0 * ni), in);
    bst_brdf f = {.model = BST_BRDF_LAMBERT, .diffuse = 0.3};
    bst_assert_close(bst_brdf_value(&f, ni, no, io), 0.3 / BST_PI, 1e-15);
    f = (bst_brdf){.model = BST_BRDF_PHONG, .diffuse = 0.3, .specular = 0.4, .exponent = 3.0};
    const bst_vec3 beside = bst_vec3_unit((bst_vec3){-0.9, 0.5, 0.6}); /* in the lobe */
    double want = 0.4 * 5.0 / (2.0 * BST_PI) * pow(bst_vec3_dot(mirror, beside), 3.0);
    bst_assert_close(bst_brdf_value(&f, ni, beside.z, bst_vec3_dot(in, beside)),
                     0.3 / BST_PI + want, 1e-12);
    bst_assert_close(bst_brdf_value(&f, ni, no, io), 0.3 / BST_PI, 1e-15); /* out of it */
    f = (bst_brdf){
        .model = BST_BRDF_ASHIKHMIN_SHIRLEY, .diffuse = 0.6, .specular = 0.1, .exponent = 7.0};
    want = 8.0 / (8.0 * BST_PI) * pow(nh, 7.0) / (hi * fmax(ni, no)) * fresnel_of(0.1, hi) +
           28.0 * 0.6 / (23.0 * BST_PI) * 0.9 * (1.0 - pow(1.0 - ni / 2.0, 5.0)) *
               (1.0 - pow(1.0 - no / 2.0, 5.0));
    bst_assert_close(bst_brdf_value(&f, ni, no, io), want, 1e-12);
    /* GGX by its slope form, with Smith's lambdas */
    f = (bst_brdf){
        .model = BST_BRDF_COOK_TORRANCE, .diffuse = 0.6, .specular = 0.1, .roughness = 0.4};
    double t2 = 1.0 / (nh * nh) - 1.0;
    double d = 1.0 / (BST_PI * 0.16 * pow(nh, 4.0) * pow(1.0 + t2 / 0.16, 2.0)), lambda[2];
    for (int k = 0; k < 2; k++) {
        double c = k ? no : ni;
        lambda[k] = 0.5 * (sqrt(1.0 + 0.16 * (1.0 / (c * c) - 1.0)) - 1.0);
    }
    want = d * fresnel_of(0.1, hi) / (1.0 + lambda[0] + lambda[1]) / (4.0 * ni * no) +
           0.6 / BST_PI * (1.0 - fresnel_of(0.1, ni)) * (1.0 - fresnel_of(0.1, no));
    bst_assert_close(bst_brdf_value(&f, ni, no, io), want, 1e-12);
    f = (bst_brdf){.model = BST_BRDF_MAXWELL_BEARD,
                   .specular = 0.3,
                   .diffuse = 0.2,
                   .volume = 0.1,
                   .roughness = 0.4,
                   .tau_rad = 0.5,
                   .omega_rad = 0.7};
    double tilt = acos(nh), bistatic = acos(hi), slopes = 0.16 / pow(0.16 + t2, 2.0);
    slopes /= BST_PI * pow(nh, 4.0);
    double mask = fmin(1.0, 2.0 * nh * no / hi); /* no is the smaller one */
    double shadow = (1.0 + tilt / 0.7 * exp(-2.0 * bistatic / 0.5)) / (1.0 + tilt / 0.7);
    want = fresnel_of(0.3, hi) * slopes * mask * shadow / (4.0 * ni * no) + 0.2 / BST_PI +
           2.0 * 0.1 / (BST_PI * (ni + no));
    assert_true(mask < 0.99);
    bst_assert_close(bst_brdf_value(&f, ni, no, io), want, 1e-12);
    f.tau_rad = f.omega_rad = 0.0; /* neither shadowing nor obscuration */
    want += fresnel_of(0.3, hi) * slopes * mask * (1.0 - shadow) / (4.0 * ni * no);
    bst_assert_close(bst_brdf_value(&f, ni, no, io), want, 1e-12);
    f = (bst_brdf){.model = BST_BRDF_BINOMIAL,
                   .b = {-1.5, -0.3},
                   .c = {-0.4, 0.25},
                   .base = 3.0,
                   .first_power = 1,
                   .terms = 2};
    double x = in.x + out.x, y = in.y + out.y, d2 = x * x + y * y;
    want = pow(10.0,
               -1.5 - 0.3 * sqrt(d2) - 0.2 * log10(1.0 + 3.0 * d2) + 0.125 * log10(1.0 + 9.0 * d2));
    bst_assert_close(bst_brdf_value(&f, ni, no, io), want, 1e-12);
}

/* Half widths of lobes: of a power of the cosine of the half vector cos^n t = exp(-n t^2 / 2) to
 * 1 / e; half of that in Phong's angle from the mirror direction; the slope of facets. */
static void widths_of_lobes(void **state) {
    (void)state;
    const struct {
        bst_brdf f;
        double rad;
    } cases[] = {
        {{.model = BST_BRDF_PHONG, .specular = 0.5, .exponent = 200.0}, 0.05},
        {{.model = BST_BRDF_PHONG, .specular = 0.0, .exponent = 200.0}, 0.5 * BST_PI},
        {{.model = BST_BRDF_PHONG, .specular = 0.5, .exponent = 0.0}, 0.5 * BST_PI},
        {{.model = BST_BRDF_ASHIKHMIN_SHIRLEY, .exponent = 200.0}, 0.1},
        {{.model = BST_BRDF_ASHIKHMIN_SHIRLEY, .exponent = 0.1}, 0.5 * BST_PI},
        {{.model = BST_BRDF_COOK_TORRANCE, .roughness = 1.0}, 0.25 * BST_PI},
        {{.model = BST_BRDF_MAXWELL_BEARD, .roughness = 0.1}, 0.0996686524911620},
        {{.model = BST_BRDF_BINOMIAL}, 0.05}, /* by definition, as tables */
        {{.model = BST_BRDF_LAMBERT, .diffuse = 1.0}, 0.5 * BST_PI},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        bst_assert_close(bst_brdf_lobe_rad(&cases[i].f), cases[i].rad, 1e-9);
    }
}

static void a_surface_that_makes_light_is_refused(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_brdf bright = {.model = BST_BRDF_PHONG, .diffuse = 0.6, .specular = 0.6, .exponent = 20};
    assert_int_equal(bst_brdf_check(&ctx, &bright), BST_ERR_CONFIG);
    assert_non_null(strstr(ctx.message, "allowed: at most 1"));
    double share = 0.0, deg = -1.0; /* at normal incidence both coefficients together */
    sscanf(strpbrk(ctx.message, "0123456789"), "%lf times the light that it receives at %lf",
           &share, &deg);
    bst_assert_close(share, 1.2, 3e-3); /* of the integral */
    bst_assert_close(deg, 0.0, 0.0);
    bright.specular = 0.4;
    bst_assert_ok(&ctx, bst_brdf_check(&ctx, &bright));
}

static void write_table(const char *text, char path[BST_TEST_PATH]) {
    bst_test_template(path, "brdf");
    int fd = mkstemp(path);
    assert_true(fd >= 0);
    FILE *f = fdopen(fd, "w");
    fputs(text, f);
    fclose(f);
}

static void table_gives_its_values_and_moves_its_lobe(void **state) {
    (void)state;
    char text[20000] = "# a lobe of 0.1 in the sine\n", path[BST_TEST_PATH];
    for (int in = 10; in <= 70; in += 20) {
        for (int out = -88; out <= 88; out++) {
            double d = (sin(out * BST_DEG_RAD) - sin(in * BST_DEG_RAD)) / 0.1;
            sprintf(text + strlen(text), "%d -180 %d 0 %.8g\n", in, out, exp(-d * d) + 0.01);
        }
    }
    write_table(text, path);
    bst_ctx ctx = {0};
    bst_brdf_table *table;
    bst_assert_ok(&ctx, bst_brdf_table_load(&ctx, path, &table));
    bst_assert_close(bst_brdf_table_value(table, sin(30 * BST_DEG_RAD), 0.5), 1.01, 1e-6);
    bst_brdf f = {.model = BST_BRDF_TABLE, .table = table};
    /* between the rows, at the mirror angle */
    double c = cos(40 * BST_DEG_RAD);
    bst_assert_close(bst_brdf_value(&f, c, c, cos(80 * BST_DEG_RAD)), 1.01, 1e-3);
    /* out of the plane: 0.1 rad aside of the mirror direction, D = 2 cos 0.785 sin 0.05 */
    double s = sin(45 * BST_DEG_RAD), d = 2 * s * sin(0.05) / 0.1;
    double between = -s * s * cos(0.1) + s * s;
    bst_assert_close(bst_brdf_value(&f, s, s, between), exp(-d * d) + 0.01, 5e-3);
    uint64_t random = 21;
    for (int i = 0; i < 1000; i++) {
        bst_vec3 a = bst_test_direction(&random), b = bst_test_direction(&random);
        double x = fabs(a.z), y = fabs(b.z), dot = a.x * b.x + a.y * b.y + x * y;
        double forth = bst_brdf_value(&f, x, y, dot);
        bst_assert_close(forth, bst_brdf_value(&f, y, x, dot), 1e-9 * forth);
    }
    bst_brdf_table_free(table);
    remove(path);
}

/* Rows of unequal lengths: linear in the logarithm of the value, at equal distance from the mirror
 * direction, and constant beyond the ends of rows and table. */
static void table_between_its_values(void **state) {
    (void)state;
    char path[BST_TEST_PATH];
    /* sines 0 and 0.5 of incidence; reflected 0, 0.5 and -0.5, 0.5, 1; comma and text lines */
    write_table(
        "angle azimuth angle azimuth value\n# comment\n 0 180 30 0 100\n0,180,0,0,1\n"
        "30 180 90 0 1000\n30 180 30 0 10\r\n\n30\t180\t-30 0 0.1\n",
        path);
    bst_ctx ctx = {0};
    bst_brdf_table *t;
    bst_assert_ok(&ctx, bst_brdf_table_load(&ctx, path, &t));
    const double cases[][3] =
        {
            /* in, out, log10: on the rows */
            {0.0, 0.0, 0.0},   {0.0, 0.25, 1.0}, {0.0, 0.9, 2.0},
            {0.0, -0.3, 0.0},  {0.5, 0.0, 0.0},  {0.5, 0.75, 2.0},
            {0.5, -0.9, -1.0}, {0.9, 0.9, 1.0}, /* beyond the last row, at its mirror direction */
            {0.9, 1.0, 1.4},                    /* 0.1 from it: at 0.6 of the last row */
            {0.25, 0.25, 0.5},                  /* half of 0 and 1 */
            {0.25, 0.35, 0.9},                  /* half of 0.4 and 1.4 */
            {0.1, 0.0, 0.16},                   /* -0.1 from it: 0.8 x 0 and 0.2 x (1 - 0.2) */
        };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        double found = log10(bst_brdf_table_value(t, cases[i][0], cases[i][1]));
        bst_assert_close(found, cases[i][2], 1e-9);
    }
    bst_brdf_table_free(t);
    remove(path);
}

/* Limits of a line and of the number of rows, from both sides. */
static void limits_of_tables(void **state) {
    (void)state;
    static const struct {
        const char *line;
        bool good;
    } cases[] = {
        {"0 0 -90 0 0\n", true},      {"90 0 90 0 1e9\n", true},  {"-0.1 0 0 0 1\n", false},
        {"90.1 0 0 0 1\n", false},    {"5 0 90.1 0 1\n", false},  {"5 0 -90.1 0 1\n", false},
        {"5 0 5 0 1.001e9\n", false}, {"5 0 5 0 -1e-9\n", false}, {"5 999 5 -999 1\n", true},
        {"5 0 5 0\n", false},         {"5 0 5 0 1 1\n", false},   {"5 0 5 0 1 # x\n", false}};
    char path[BST_TEST_PATH], text[4000] = "";
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        bst_ctx ctx = {0};
        bst_brdf_table *t;
        write_table(cases[i].line, path);
        assert_int_equal(bst_brdf_table_load(&ctx, path, &t) == BST_OK, cases[i].good);
        bst_brdf_table_free(t);
        remove(path);
    }
    for (int rows = 1; rows <= 65; rows++) { /* 64 angles of incidence, of two values each */
        bst_ctx ctx = {0};
        bst_brdf_table *t;
        sprintf(text + strlen(text), "%d 0 1 0 1\n%d 0 2 0 1\n", rows, rows);
        if (rows >= 64) {
            write_table(text, path);
            assert_int_equal(bst_brdf_table_load(&ctx, path, &t) == BST_OK, rows == 64);
            bst_brdf_table_free(t);
            remove(path);
        }
    }
}

static void damaged_tables_are_refused(void **state) {
    (void)state;
    static const char *const texts[] = {
        "", "1 2 3\n", "1 2 3 4 x\n", "95 0 0 0 1\n", "5 0 0 0 -1\n", "5 0 0 0 nan\n"};
    for (int i = 0; i < 6; i++) {
        bst_ctx ctx = {0};
        bst_brdf_table *table;
        char path[BST_TEST_PATH];
        write_table(texts[i], path);
        assert_int_equal(bst_brdf_table_load(&ctx, path, &table), BST_ERR_FORMAT);
        assert_null(table);
        assert_non_null(strstr(ctx.message, path));
        remove(path);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(all_are_reciprocal),
        cmocka_unit_test(none_makes_light),
        cmocka_unit_test(known_reflectances),
        cmocka_unit_test(values_by_vectors),
        cmocka_unit_test(widths_of_lobes),
        cmocka_unit_test(a_surface_that_makes_light_is_refused),
        cmocka_unit_test(table_between_its_values),
        cmocka_unit_test(limits_of_tables),
        cmocka_unit_test(table_gives_its_values_and_moves_its_lobe),
        cmocka_unit_test(damaged_tables_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
