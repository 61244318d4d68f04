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

static void a_surface_that_makes_light_is_refused(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_brdf bright = {.model = BST_BRDF_PHONG, .diffuse = 0.6, .specular = 0.6, .exponent = 20};
    assert_int_equal(bst_brdf_check(&ctx, &bright), BST_ERR_CONFIG);
    assert_non_null(strstr(ctx.message, "allowed: at most 1"));
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
        cmocka_unit_test(a_surface_that_makes_light_is_refused),
        cmocka_unit_test(table_gives_its_values_and_moves_its_lobe),
        cmocka_unit_test(damaged_tables_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
