/* A full mount on a free spacecraft: what one turns, the other turns back. */
#include "gimbal/mount/mount.h"
#include "gimbal/mount/mount_geometry.h"
#include "gimbal/platform.h"
#include "tests/test_support.h"

static bst_ctx ctx;

static bst_status sky_at(void *user, bst_ctx *c, double seconds, bst_spacecraft_sky *out) {
    (void)user;
    (void)c;
    (void)seconds;
    *out = (bst_spacecraft_sky){.position_m = {1e9, 0, 0}, .sun_m = {0, 1.5e11, 0}};
    out->known = (bst_spacecraft_law_inputs){.position_m = out->position_m, .sun_m = out->sun_m};
    return BST_OK;
}

static bst_spacecraft *make(bst_spacecraft_law law) {
    bst_spacecraft_config c;
    bst_assert_ok(&ctx, bst_config_defaults(&ctx, bst_spacecraft_config_table, &c));
    c.attitude.law = (int32_t)law;
    c.disturbances.gravity_gradient = false;
    bst_spacecraft_setup setup = {.dt_s = 1e-3,
                                  .q_nominal = BST_QUAT_IDENTITY,
                                  .sky_at = sky_at,
                                  .seed = 1,
                                  .instance = "craft"};
    bst_spacecraft *craft = NULL;
    bst_assert_ok(&ctx, bst_spacecraft_create(&ctx, &c, &setup, &craft));
    return craft;
}

static bst_mount mount_make(void) {
    bst_mount_config c;
    bst_assert_ok(&ctx, bst_config_defaults(&ctx, bst_mount_config_table, &c));
    bst_mount mount;
    bst_assert_ok(&ctx, bst_mount_init(&ctx, &mount, BST_MOUNT_AZIMUTH_ELEVATION, &c, 1e-3,
                                       (bst_rng_key){{1, 2}}));
    mount.want_reaction = true;
    return mount;
}

static bst_vec3 total(const bst_spacecraft *craft, const bst_mount *mount) {
    const bst_body_state *body = &bst_spacecraft_at(craft)->body;
    bst_vec3 rate = bst_mount_swap(mount->type, body->rate_radps);
    bst_vec3 h = bst_mount_swap(
        mount->type, bst_mount_chain_momentum(&mount->joints.chain, &mount->joints.state, rate));
    h = bst_quat_rotate(bst_quat_conj(body->q_body_from_gcrf), h);
    return bst_vec3_add(h, bst_spacecraft_body_momentum(bst_spacecraft_dynamics(craft)));
}

/* Slews about both axes, to and fro: the momentum of both together stays zero but for the step by
 * which the reaction comes late. */
static void test_momentum_of_both(void **state) {
    (void)state;
    bst_spacecraft *craft = make(BST_LAW_FREE);
    bst_mount mount = mount_make();
    const bst_spacecraft_now *now = bst_spacecraft_at(craft);
    double most = 0.0, fastest = 0.0;
    for (int64_t n = 0; n < 20000; n++) {
        double t = 1e-3 * (double)n;
        bst_assert_ok(&ctx, bst_spacecraft_step(&ctx, craft, n, t, mount.reaction_nm));
        bst_los_command command = {.direction_gcrf =
                                       bst_vec3_unit(n < 6000    ? (bst_vec3){0.3, 0.5, 0.8}
                                                     : n < 12000 ? (bst_vec3){-0.2, 0.4, 0.9}
                                                                 : (bst_vec3){0.1, -0.3, 0.9})};
        bst_mount_body body = {now->body.rate_radps, now->q_believed_from_gcrf,
                               now->rate_believed_radps};
        bst_mount_step(&mount, &body, &command, 0.0, n % 10 == 0);
        bst_vec3 l = total(craft, &mount);
        /* what has not yet acted: the reaction of the step that ends now */
        bst_vec3 late = bst_vec3_scale(
            bst_quat_rotate(bst_quat_conj(now->body.q_body_from_gcrf), mount.reaction_nm), 1e-3);
        most = fmax(most, bst_vec3_norm(bst_vec3_add(l, late)));
        fastest = fmax(fastest, bst_vec3_norm(now->body.rate_radps));
    }
    print_message("body turned at up to %.2g rad/s, momentum off by %.1e N m s\n", fastest, most);
    assert_true(fastest > 1e-3);
    /* 14 kg m^2 at that rate are 0.02 N m s and more; what is left is of second order in the turn
     * of a step, over thousands of them */
    assert_true(most < 1e-6 * 10.0 * fastest);
    bst_spacecraft_free(craft);
}

/* With the attitude held, a slew of the mount disturbs the body and leaves it where it was. */
static void test_held_under_a_slew(void **state) {
    (void)state;
    bst_spacecraft *craft = make(BST_LAW_INERTIAL);
    bst_mount mount = mount_make();
    const bst_spacecraft_now *now = bst_spacecraft_at(craft);
    double worst = 0.0;
    for (int64_t n = 0; n < 120000; n++) {
        bst_assert_ok(&ctx,
                      bst_spacecraft_step(&ctx, craft, n, 1e-3 * (double)n, mount.reaction_nm));
        bst_los_command command = {
            .direction_gcrf =
                bst_vec3_unit(n < 30000 ? (bst_vec3){0, 0, 1} : (bst_vec3){0.3, 0.5, 0.8})};
        bst_mount_body body = {now->body.rate_radps, now->q_believed_from_gcrf,
                               now->rate_believed_radps};
        bst_mount_step(&mount, &body, &command, 0.0, n % 10 == 0);
        double off = bst_vec3_norm(
            bst_attitude_filter_error(now->body.q_body_from_gcrf, now->reference.q_body_from_gcrf));
        worst = n > 30000 ? fmax(worst, off) : 0.0;
    }
    double rest = bst_vec3_norm(
        bst_attitude_filter_error(now->body.q_body_from_gcrf, now->reference.q_body_from_gcrf));
    print_message("a slew turned the body by %.1f arcsec, %.1f are left\n", worst / BST_ARCSEC_RAD,
                  rest / BST_ARCSEC_RAD);
    assert_true(worst > 60.0 * BST_ARCSEC_RAD);
    assert_true(rest < 20.0 * BST_ARCSEC_RAD);
    /* the boresight is on its target but for what is known wrongly of the body */
    bst_quat cam = bst_quat_mul(mount.q_cam_from_body, now->body.q_body_from_gcrf);
    bst_vec3 axis = bst_quat_rotate(bst_quat_conj(cam), (bst_vec3){0, 0, 1});
    assert_true(bst_vec3_angle(axis, (bst_vec3){0.3, 0.5, 0.8}) < 20.0 * BST_ARCSEC_RAD);
    bst_spacecraft_free(craft);
}

static void test_mount_too_heavy(void **state) {
    (void)state;
    bst_platform platform = {.spacecraft = make(BST_LAW_FREE)};
    bst_assert_ok(&ctx, bst_platform_check_mount(&ctx, &platform, (double[6]){1, 1, 1, 0, 0, 0}));
    assert_int_equal(bst_platform_check_mount(&ctx, &platform, (double[6]){1, 6, 1, 0, 0, 0}),
                     BST_ERR_CONFIG);
    assert_non_null(strstr(ctx.message, "mount's largest is 6"));
    bst_platform_free(&platform);
    bst_assert_ok(&ctx, bst_platform_check_mount(&ctx, &platform, (double[6]){9, 9, 9, 0, 0, 0}));
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_momentum_of_both),
                                       cmocka_unit_test(test_held_under_a_slew),
                                       cmocka_unit_test(test_mount_too_heavy)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
