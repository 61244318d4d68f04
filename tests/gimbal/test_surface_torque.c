/* Torque on a spacecraft with a shape: a plate beside the centre of mass, against closed forms. */
#include "gimbal/spacecraft/spacecraft.h"
#include "sim/astro/atmosphere.h"
#include "sim/astro/forces.h"
#include "tests/io/scratch.h"
#include "tests/test_support.h"

/* A black plate of 2 x 3 m, across z, at x = 1.5 m of its frame; centre of mass at x = 0.5 m. */
static const char *const plate =
    "{\"materials\": [{\"name\": \"b\", \"diffuse\": 0.5, \"absorptance\": 1}], \"parts\": "
    "[{\"name\": \"p\", \"kind\": \"plate\", \"size_m\": [2, 3, 0], \"position_m\": [1.5, 0, 0], "
    "\"material\": \"b\"}]}";

static scratch folder;

static int open_folder(void **state) {
    (void)state;
    scratch_make(&folder);
    FILE *file = fopen(scratch_path(&folder, "plate.json"), "w");
    if (!file || fputs(plate, file) < 0 || fclose(file) != 0) {
        fail_msg("no file of the plate");
    }
    return 0;
}

static int close_folder(void **state) {
    (void)state;
    scratch_remove(&folder);
    return 0;
}

/* Text with the path of the plate in place of %s. */
static const char *with_plate(const char *format) {
    static char text[2000];
    snprintf(text, sizeof text, format, scratch_path(&folder, "plate.json"));
    return text;
}

#define PLATE "\"shape_file\": \"%s\", \"centre_of_mass_m\": [0.5, 0, 0]"

static bst_disturbance_config read_config(const char *text) {
    bst_ctx ctx = {0};
    bst_json *json;
    bst_disturbance_config config;
    bst_assert_ok(&ctx, bst_json_parse(&ctx, "craft.json", text, strlen(text), &json));
    bst_assert_ok(&ctx, bst_config_read(&ctx, json, bst_json_root(json), "",
                                        bst_disturbance_config_table, &config));
    bst_json_free(json);
    return config;
}

static void test_plate(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_disturbance_config c = read_config(with_plate("{" PLATE ", \"cd\": 2}"));
    bst_surface_torque *t;
    bst_assert_ok(&ctx, bst_disturbance_surface_create(&ctx, &c, &t));
    assert_non_null(t);
    bst_quat q = bst_quat_unit((bst_quat){0.3, -0.2, 0.5, 0.8}), back = bst_quat_conj(q);
    const bst_vec3 z = {0, 0, 1}, x = {1, 0, 0};
    /* far from the air: sunlight on the face, at 2 au, half of the disc */
    bst_surface_state sky = {.q_body_from_gcrf = q,
                             .position_m = {42e6, 0, 0},
                             .sun_m = bst_vec3_scale(bst_quat_rotate(back, z), 2.0 * BST_AU_M),
                             .sunlit = 0.5,
                             .density_scale = 1.0};
    double force = BST_SUNLIGHT_PRESSURE_PA * 6.0 * 0.5 / 4.0;
    bst_vec3 got = bst_surface_torque_at(t, &sky);
    bst_assert_close(got.y, force * 1.0, 1e-12 * force); /* x times -z is y */
    bst_assert_close(hypot(got.x, got.z), 0.0, 1e-12 * force);
    sky.sunlit = 0.0;
    bst_assert_close(bst_vec3_norm(bst_surface_torque_at(t, &sky)), 0.0, 1e-20);
    /* air alone, against the back at 60 degrees from its normal */
    sky.position_m = bst_vec3_scale((bst_vec3){1, 0, 0}, 6778137.0);
    bst_vec3 ahead = bst_vec3_axpy(bst_vec3_scale(z, -0.5), sqrt(0.75), x);
    const bst_vec3 spin = {0, 0, 7.292115e-5};
    sky.velocity_mps =
        bst_vec3_axpy(bst_vec3_cross(spin, sky.position_m), 7500.0, bst_quat_rotate(back, ahead));
    double density = bst_atmosphere_density_kgpm3(bst_astro_height_m(sky.position_m));
    double drag = 0.5 * density * 7500.0 * 7500.0 * 2.0 * 6.0 * 0.5;
    assert_true(density > 1e-13);
    got = bst_surface_torque_at(t, &sky);
    /* force -drag ahead at (1, 0, 0): y component -(x Fz) = drag ahead.z */
    bst_assert_close(got.y, drag * ahead.z, 1e-9 * drag);
    bst_assert_close(hypot(got.x, got.z), 0.0, 1e-9 * drag);
    bst_surface_torque_free(t);
    bst_config_free(bst_disturbance_config_table, &c);
    /* without air, and without a shape */
    c = read_config(with_plate("{" PLATE ", \"drag\": false}"));
    bst_assert_ok(&ctx, bst_disturbance_surface_create(&ctx, &c, &t));
    bst_assert_close(bst_vec3_norm(bst_surface_torque_at(t, &sky)), 0.0, 0.0);
    bst_surface_torque_free(t);
    bst_config_free(bst_disturbance_config_table, &c);
    c = read_config("{}");
    bst_assert_ok(&ctx, bst_disturbance_surface_create(&ctx, &c, &t));
    assert_null(t);
    bst_config_free(bst_disturbance_config_table, &c);
    c = read_config(with_plate("{" PLATE ", \"srp_area_m2\": 2}"));
    assert_int_equal(bst_disturbance_surface_create(&ctx, &c, &t), BST_ERR_CONFIG);
    assert_non_null(strstr(ctx.message, "srp_area_m2"));
    bst_config_free(bst_disturbance_config_table, &c);
}

static bst_status sky_at(void *user, bst_ctx *ctx, double seconds, bst_spacecraft_sky *out) {
    (void)user;
    (void)ctx;
    (void)seconds;
    *out = (bst_spacecraft_sky){.position_m = {42e6, 0, 0},
                                .velocity_mps = {0, 3070, 0},
                                .sun_m = {0, 0, BST_AU_M},
                                .sunlit = 1.0};
    out->known = (bst_spacecraft_law_inputs){
        .position_m = out->position_m, .velocity_mps = out->velocity_mps, .sun_m = out->sun_m};
    return BST_OK;
}

/* A free body turns up at torque over inertia. */
static void test_free_body(void **state) {
    (void)state;
    enum { STEPS = 1000 };
    bst_ctx ctx = {0};
    const char *text = with_plate(
        "{\"type\": \"rigid_body\", \"inertia_kgm2\": [20, 30, 40, 0, 0, 0], \"disturbances\": "
        "{\"gravity_gradient\": false, " PLATE "}, \"attitude\": {\"law\": \"free\"}}");
    bst_json *json;
    bst_spacecraft_config config;
    bst_assert_ok(&ctx, bst_json_parse(&ctx, "craft.json", text, strlen(text), &json));
    bst_assert_ok(&ctx, bst_config_read(&ctx, json, bst_json_root(json), "",
                                        bst_spacecraft_config_table, &config));
    bst_spacecraft_setup setup = {
        .dt_s = 0.01, .q_nominal = BST_QUAT_IDENTITY, .sky_at = sky_at, .seed = 1, .instance = "a"};
    bst_spacecraft *craft;
    bst_assert_ok(&ctx, bst_spacecraft_create(&ctx, &config, &setup, &craft));
    for (int n = 0; n <= STEPS; n++) {
        bst_assert_ok(&ctx, bst_spacecraft_step(&ctx, craft, n, n * 0.01, (bst_vec3){0, 0, 0}));
    }
    double torque = BST_SUNLIGHT_PRESSURE_PA * 6.0 * 1.0, seconds = STEPS * 0.01;
    bst_vec3 rate = bst_spacecraft_at(craft)->body.rate_radps;
    /* over 5e-5 rad the plate still faces the Sun */
    bst_assert_close(rate.y, torque / 30.0 * seconds, 1e-6 * torque);
    bst_assert_close(hypot(rate.x, rate.z), 0.0, 1e-12);
    bst_spacecraft_free(craft);
    bst_config_free(bst_spacecraft_config_table, &config);
    bst_json_free(json);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_plate),
                                       cmocka_unit_test(test_free_body)};
    return cmocka_run_group_tests(tests, open_folder, close_folder);
}
