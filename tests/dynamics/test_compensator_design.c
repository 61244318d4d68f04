/* Designed loops against their specification, the loop worked out anew. */
#include "boresight/compensator.h"
#include "boresight/vec.h"
#include "tests/test_support.h"

typedef struct plant {
    double dt_s, inertia, delay_s;
    double mode_hz, mode_damping, mode_share; /* of a flexible mode; mode_hz 0: none */
} plant;

/* Torque held over a step on a rigid body: h^2 / (2 J) (z + 1) / (z - 1)^2, a delay, and a mode
 * (continuous: well below half the rate). */
static double complex body(const void *user, double w) {
    const plant *p = user;
    double complex z = cexp(I * w * p->dt_s);
    double complex out = p->dt_s * p->dt_s / (2 * p->inertia) * (z + 1) / ((z - 1) * (z - 1));
    if (p->mode_hz > 0.0) {
        double wm = 2 * BST_PI * p->mode_hz;
        double complex s = I * w;
        out *= 1.0 + p->mode_share * s * s / (s * s + 2 * p->mode_damping * wm * s + wm * wm);
    }
    return out * cexp(-I * w * p->delay_s);
}

/* A correction that is seen delay_s later. */
static double complex delay_only(const void *user, double w) {
    return cexp(-I * w * ((const plant *)user)->delay_s);
}

/* An integrator with a delay: rate out, angle seen. */
static double complex integrator(const void *user, double w) {
    return cexp(-I * w * ((const plant *)user)->delay_s) / (I * w);
}

static double complex loop_at(const bst_compensator *c, bst_dynamics_response_fn fn, const plant *p,
                              double hz) {
    return bst_compensator_response(c, 2 * BST_PI * hz) * fn(p, 2 * BST_PI * hz);
}

static double phase_margin_deg(double complex l) {
    double margin = carg(l) / BST_DEG_RAD + 180.0;
    return margin > 180.0 ? margin - 360.0 : margin;
}

/* Scans for where the closed loop last leaves -3 dB, to 1e-5. */
static double bandwidth(const bst_compensator *c, bst_dynamics_response_fn fn, const plant *p,
                        double from, double to) {
    double last = 0.0;
    for (double hz = from; hz < to; hz *= 1.00001) {
        double complex l = loop_at(c, fn, p, hz);
        if (cabs(l / (1 + l)) > sqrt(0.5)) {
            last = hz;
        } else if (last > 0.0) {
            break;
        }
    }
    return last;
}

static void check(int type, bst_dynamics_response_fn fn, plant p, double crossover_hz,
                  double margin_deg, bst_config_list notches) {
    bst_ctx ctx = {0};
    bst_compensator_config config = {.type = type,
                                     .crossover_hz = crossover_hz,
                                     .phase_margin_deg = margin_deg,
                                     .integral_ratio = 0.1,
                                     .notches = notches,
                                     .gain_scale = 1.0};
    bst_compensator c;
    bst_assert_ok(&ctx, bst_compensator_init(&ctx, &c, &config, p.dt_s, fn, &p));
    double complex l = loop_at(&c, fn, &p, crossover_hz);
    /* solved in closed form: rounding, amplified by the subtraction of phases */
    bst_assert_close(cabs(l), 1.0, 1e-9);
    bst_assert_close(phase_margin_deg(l), margin_deg, 1e-6);

    /* the same by bandwidth: within 1 % as specified; the design bisects to 1e-9 */
    config.crossover_hz = 0.0;
    config.bandwidth_hz = 1.5 * crossover_hz;
    bst_assert_ok(&ctx, bst_compensator_init(&ctx, &c, &config, p.dt_s, fn, &p));
    double found = bandwidth(&c, fn, &p, 0.2 * crossover_hz, 0.5 / p.dt_s);
    bst_assert_close(found / config.bandwidth_hz, 1.0, 1e-4);
    double hz = 0.2 * crossover_hz; /* and the phase margin at the crossover, found by scanning */
    while (cabs(loop_at(&c, fn, &p, hz)) > 1.0) {
        hz *= 1.00001;
    }
    bst_assert_close(phase_margin_deg(loop_at(&c, fn, &p, hz)), margin_deg, 0.01);
}

static void test_meets(void **state) {
    (void)state;
    const bst_config_list none = {NULL, 0};
    plant rigid = {.dt_s = 1e-3, .inertia = 0.2, .delay_s = 1e-3};
    check(BST_COMPENSATOR_PID, body, rigid, 10.0, 50.0, none);
    check(BST_COMPENSATOR_PID, body, rigid, 25.0, 35.0, none);
    check(BST_COMPENSATOR_LEAD_LAG, body, rigid, 10.0, 50.0, none);
    check(BST_COMPENSATOR_LEAD_LAG, body, rigid, 0.1, 60.0, none);
    bst_dynamics_notch_config notch = {60.0, 40.0, 30.0};
    plant flexible = rigid;
    flexible.mode_hz = 60.0;
    flexible.mode_damping = 0.005;
    flexible.mode_share = 0.3;
    check(BST_COMPENSATOR_PID, body, flexible, 8.0, 45.0, (bst_config_list){&notch, 1});
    plant frames = {.dt_s = 0.1, .delay_s = 0.3};
    check(BST_COMPENSATOR_PI, delay_only, frames, 0.3, 70.0, none);
    check(BST_COMPENSATOR_PI, integrator, frames, 0.2, 55.0, none);
    check(BST_COMPENSATOR_PID, integrator, frames, 0.3, 50.0, none);
}

static void test_more_than_asked(void **state) {
    (void)state;
    /* a static plant with little delay has more phase than 45 deg under a pure integrator */
    bst_ctx ctx = {0};
    plant p = {.dt_s = 0.1, .delay_s = 0.1};
    bst_compensator_config config = {.type = BST_COMPENSATOR_PI,
                                     .crossover_hz = 0.1,
                                     .phase_margin_deg = 45.0,
                                     .gain_scale = 1.0},
                           out;
    bst_assert_ok(&ctx, bst_compensator_design(&ctx, &config, p.dt_s, delay_only, &p, &out));
    bst_assert_close(out.proportional, 0.0, 1e-12);
    bst_compensator c;
    bst_assert_ok(&ctx, bst_compensator_init(&ctx, &c, &out, p.dt_s, NULL, NULL));
    double complex l = loop_at(&c, delay_only, &p, 0.1);
    bst_assert_close(cabs(l), 1.0, 1e-9);
    bst_assert_close(phase_margin_deg(l), 90.0 - 360.0 * 0.1 * 0.1, 1e-6);
}

static void test_cannot(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    plant rigid = {.dt_s = 1e-3, .inertia = 0.2, .delay_s = 1e-3};
    bst_compensator_config config = {.type = BST_COMPENSATOR_PI,
                                     .crossover_hz = 10.0,
                                     .phase_margin_deg = 40.0,
                                     .integral_ratio = 0.1,
                                     .gain_scale = 1.0},
                           out;
    /* pi on a double integrator: no phase at any frequency */
    assert_int_equal(bst_compensator_design(&ctx, &config, 1e-3, body, &rigid, &out),
                     BST_ERR_CONFIG);
    assert_non_null(strstr(ctx.message, "does not reach it at lower frequencies"));
    /* an integrator with 0.3 s of delay and pi: 90 deg - 360 deg f 0.3 s = 50 deg at f = 0.3704 Hz
     */
    plant frames = {.dt_s = 0.1, .delay_s = 0.3};
    config.crossover_hz = 2.0;
    config.phase_margin_deg = 50.0;
    assert_int_equal(bst_compensator_design(&ctx, &config, 0.1, integrator, &frames, &out),
                     BST_ERR_CONFIG);
    assert_non_null(strstr(ctx.message, "at most 0.3704 Hz"));
    config.crossover_hz = 0.370;
    bst_assert_ok(&ctx, bst_compensator_design(&ctx, &config, 0.1, integrator, &frames, &out));
    /* by bandwidth: what it says can be had can be had */
    config.crossover_hz = 0.0;
    config.bandwidth_hz = 3.0;
    assert_int_equal(bst_compensator_design(&ctx, &config, 0.1, integrator, &frames, &out),
                     BST_ERR_CONFIG);
    const char *most = strstr(ctx.message, "at most ");
    assert_non_null(most);
    config.bandwidth_hz = 0.999 * strtod(most + 8, NULL);
    assert_true(config.bandwidth_hz > 0.3704);
    bst_assert_ok(&ctx, bst_compensator_design(&ctx, &config, 0.1, integrator, &frames, &out));
    config.crossover_hz = 0.1;
    assert_int_equal(bst_compensator_design(&ctx, &config, 0.1, integrator, &frames, &out),
                     BST_ERR_CONFIG);
    assert_non_null(strstr(ctx.message, "not both"));
    config.crossover_hz = 0.0;
    config.bandwidth_hz = 6.0; /* beyond half the rate */
    bst_compensator c;
    assert_int_equal(bst_compensator_init(&ctx, &c, &config, 0.1, integrator, &frames),
                     BST_ERR_CONFIG);
    config.bandwidth_hz = 0.2;
    config.proportional = 1.0;
    assert_int_equal(bst_compensator_init(&ctx, &c, &config, 0.1, integrator, &frames),
                     BST_ERR_CONFIG);
    assert_non_null(strstr(ctx.message, "both gains and a specification"));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_meets),
        cmocka_unit_test(test_more_than_asked),
        cmocka_unit_test(test_cannot),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
