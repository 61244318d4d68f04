#include "gimbal/spacecraft/spacecraft_body.h"
#include "tests/test_support.h"

/* The free rigid body in Jacobi's elliptic functions (Landau and Lifshitz, Mechanics, section 37),
 * moments A < B < C about x, y, z, L^2 > 2 E B: the rate is {a cn, b sn, c dn}. */
typedef struct jacobi {
    double moment[3];
    double amplitude[3], per_s, modulus2, momentum;
} jacobi;

/* sn, cn, dn by the arithmetic-geometric mean (Abramowitz and Stegun 16.4). */
static void elliptic(double u, double m, double *sn, double *cn, double *dn) {
    double a[16], c[16], b = sqrt(1.0 - m);
    int n = 0;
    a[0] = 1.0;
    c[0] = sqrt(m);
    while (fabs(c[n]) > 1e-17 && n < 15) {
        a[n + 1] = 0.5 * (a[n] + b);
        c[n + 1] = 0.5 * (a[n] - b);
        b = sqrt(a[n] * b);
        n++;
    }
    double phi = ldexp(a[n] * u, n);
    for (; n > 0; n--) {
        phi = 0.5 * (phi + asin(c[n] / a[n] * sin(phi)));
    }
    *sn = sin(phi);
    *cn = cos(phi);
    *dn = sqrt(1.0 - m * *sn * *sn);
}

/* Motion with rate (w_x, 0, w_z) at time 0. */
static jacobi jacobi_make(const double moment[3], double wx, double wz) {
    double a = moment[0], b = moment[1], c = moment[2];
    double energy2 = a * wx * wx + c * wz * wz, l2 = a * a * wx * wx + c * c * wz * wz;
    assert_true(l2 > energy2 * b);
    jacobi j = {.moment = {a, b, c}, .momentum = sqrt(l2)};
    j.amplitude[0] = sqrt((energy2 * c - l2) / (a * (c - a)));
    j.amplitude[1] = sqrt((energy2 * c - l2) / (b * (c - b)));
    j.amplitude[2] = sqrt((l2 - energy2 * a) / (c * (c - a)));
    j.per_s = sqrt((c - b) * (l2 - energy2 * a) / (a * b * c));
    j.modulus2 = (b - a) * (energy2 * c - l2) / ((c - b) * (l2 - energy2 * a));
    return j;
}

static bst_vec3 jacobi_rate(const jacobi *j, double t) {
    double sn, cn, dn;
    elliptic(j->per_s * t, j->modulus2, &sn, &cn, &dn);
    return (bst_vec3){j->amplitude[0] * cn, j->amplitude[1] * sn, j->amplitude[2] * dn};
}

/* Attitude: the momentum along inertial Z; nutation and spin from the rate, precession by its
 * integral, Simpson's rule with steps that leave 1e-13. */
static bst_quat jacobi_attitude(const jacobi *j, double t, int intervals) {
    double psi = 0.0;
    for (int i = 0; i <= intervals; i++) {
        bst_vec3 w = jacobi_rate(j, t * i / intervals);
        double x = j->moment[0] * w.x, y = j->moment[1] * w.y;
        double rate = j->momentum * (x * w.x + y * w.y) / (x * x + y * y);
        psi += rate * (i == 0 || i == intervals ? 1.0 : i % 2 ? 4.0 : 2.0);
    }
    psi *= t / intervals / 3.0;
    bst_vec3 w = jacobi_rate(j, t);
    double phi = atan2(j->moment[0] * w.x, j->moment[1] * w.y);
    double theta = acos(j->moment[2] * w.z / j->momentum);
    /* z-x-z: body = R3(phi) R1(theta) R3(psi) inertial, of frames */
    bst_quat a = bst_quat_from_rotvec((bst_vec3){0, 0, -psi});
    bst_quat b = bst_quat_from_rotvec((bst_vec3){-theta, 0, 0});
    bst_quat c = bst_quat_from_rotvec((bst_vec3){0, 0, -phi});
    return bst_quat_mul(c, bst_quat_mul(b, a));
}

static double between(bst_quat a, bst_quat b) {
    return bst_vec3_norm(bst_quat_to_rotvec(bst_quat_mul(a, bst_quat_conj(b))));
}

static bst_ctx ctx;
static const double no_torque[BST_WHEELS_MOST];
static const double moments[3] = {1.0, 2.0, 2.5};

static bst_spacecraft_body free_body(bst_integrator integrator, double dt_s, bst_quat q,
                                     bst_vec3 rate) {
    bst_spacecraft_spec spec = {.inertia_kgm2 = {moments[0], moments[1], moments[2], 0, 0, 0},
                                .integrator = integrator,
                                .dt_s = dt_s};
    bst_spacecraft_body body;
    bst_assert_ok(&ctx, bst_spacecraft_body_init(&ctx, &body, &spec, q, rate, no_torque));
    return body;
}

typedef struct errors {
    double attitude_rad, rate, momentum, energy, norm;
} errors;

static errors run_jacobi(bst_integrator integrator, double dt_s, int64_t steps) {
    jacobi j = jacobi_make(moments, 0.4, 0.7);
    bst_spacecraft_body body =
        free_body(integrator, dt_s, jacobi_attitude(&j, 0.0, 2), jacobi_rate(&j, 0.0));
    bst_vec3 l0 = bst_spacecraft_body_momentum(&body);
    double e0 = bst_spacecraft_body_energy(&body);
    errors out = {0};
    for (int64_t n = 1; n <= steps; n++) {
        bst_spacecraft_body_step(&body, (bst_vec3){0, 0, 0}, no_torque);
        out.energy = fmax(out.energy, fabs(bst_spacecraft_body_energy(&body) / e0 - 1.0));
    }
    double t = dt_s * (double)steps;
    bst_quat q = bst_spacecraft_body_attitude(&body);
    bst_vec3 rate = jacobi_rate(&j, t);
    out.attitude_rad = between(q, jacobi_attitude(&j, t, 40000));
    out.rate =
        bst_vec3_norm(bst_vec3_sub(bst_spacecraft_body_rate(&body), rate)) / bst_vec3_norm(rate);
    out.momentum =
        bst_vec3_norm(bst_vec3_sub(bst_spacecraft_body_momentum(&body), l0)) / j.momentum;
    out.norm = fabs(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w - 1.0);
    return out;
}

static void test_jacobi(void **state) {
    (void)state;
    /* 0.8 rad/s turn the body 13 times in 100 s. Bounds of the attitude at 0.1 s: a third above
     * what was measured; the constants are the methods' own. The energy of the symplectic ones is
     * off by as much after the first turn as after the last. */
    static const struct {
        bst_integrator integrator;
        double order, attitude_rad, energy;
    } cases[] = {{BST_INTEGRATE_SYMPLECTIC, 2, 4.2e-3, 1.2e-4},
                 {BST_INTEGRATE_SYMPLECTIC4, 4, 1.5e-6, 6e-9},
                 {BST_INTEGRATE_RK4, 4, 2e-5, 5e-7}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        double last = 0.0;
        for (int k = 0; k < 3; k++) {
            errors e = run_jacobi(cases[i].integrator, 0.1 / (1 << k), 1000 << k);
            print_message(
                "%-12s %-6g s: attitude %.2e rad, rate %.2e, energy %.2e, momentum "
                "%.1e, norm %.1e\n",
                bst_integrator_names[cases[i].integrator], 0.1 / (1 << k), e.attitude_rad, e.rate,
                e.energy, e.momentum, e.norm);
            bst_assert_close(e.momentum, 0.0, 1e-14); /* rounding of its parts */
            bst_assert_close(e.norm, 0.0, 1e-15);     /* renormalised each step */
            assert_true(e.attitude_rad < cases[i].attitude_rad);
            assert_true(e.energy < cases[i].energy);
            if (k > 0) { /* higher terms of the error make up the rest */
                bst_assert_close(log2(last / e.attitude_rad), cases[i].order, 0.3);
            }
            last = e.attitude_rad;
        }
    }
}

/* A body of revolution: about the fixed momentum it precesses at L / A, and spins in itself at
 * (C - A) / A of its axial rate (Landau and Lifshitz, section 33). */
static void test_axisymmetric(void **state) {
    (void)state;
    double a = 3.0, c = 4.5, wx = 0.2, wz = 0.5, dt = 1e-3;
    bst_spacecraft_spec spec = {
        .inertia_kgm2 = {a, a, c, 0, 0, 0}, .integrator = BST_INTEGRATE_SYMPLECTIC, .dt_s = dt};
    bst_spacecraft_body body;
    bst_assert_ok(&ctx, bst_spacecraft_body_init(&ctx, &body, &spec, BST_QUAT_IDENTITY,
                                                 (bst_vec3){wx, 0, wz}, no_torque));
    int64_t steps = 200000;
    for (int64_t n = 0; n < steps; n++) {
        bst_spacecraft_body_step(&body, (bst_vec3){0, 0, 0}, no_torque);
    }
    double t = dt * (double)steps, spin = (c - a) / a * wz;
    bst_vec3 rate = bst_spacecraft_body_rate(&body);
    /* second order: the phases are off by (w dt)^2 / 24 of themselves, 100 rad; 1e-6 */
    bst_assert_close(rate.x, wx * cos(spin * t), 1e-6);
    bst_assert_close(rate.y, wx * sin(spin * t), 1e-6);
    bst_assert_close(rate.z, wz, 1e-8); /* swings by (w dt)^2 / 24 of itself */
    bst_vec3 l = {a * wx, 0, c * wz};
    bst_quat precession = bst_quat_from_rotvec(bst_vec3_scale(l, -t / a));
    bst_quat self = bst_quat_from_rotvec((bst_vec3){0, 0, spin * t});
    /* R(t) of the body's axes: exp(L t / A) about L, then back by the spin about the axis */
    bst_quat expected = bst_quat_mul(self, precession);
    bst_assert_close(between(bst_spacecraft_body_attitude(&body), expected), 0.0, 5e-6);
}

/* Turned about its intermediate axis a body flips over and over (Dzhanibekov): the time between
 * flips is half the period of Jacobi's functions, 2 K / p, to the digits of its modulus near 1. */
static void test_intermediate_axis(void **state) {
    (void)state;
    double a = moments[0], b = moments[1], c = moments[2], wy = 1.0, wz = 1e-3;
    /* rate {0, wy, wz} at the start: L^2 > 2 E B, so z stays on one side and x and y swing */
    double energy2 = b * wy * wy + c * wz * wz, l2 = b * b * wy * wy + c * c * wz * wz;
    double p = sqrt((c - b) * (l2 - energy2 * a) / (a * b * c));
    double rest = (c - a) * (l2 - energy2 * b) / ((c - b) * (l2 - energy2 * a)); /* 1 - m */
    double x = 1.0, y = sqrt(rest); /* K = pi / 2 / agm(1, sqrt(1 - m)) */
    for (int i = 0; i < 30; i++) {
        double mean = 0.5 * (x + y);
        y = sqrt(x * y);
        x = mean;
    }
    double flip_s = BST_PI / x / p;
    bst_spacecraft_body body =
        free_body(BST_INTEGRATE_SYMPLECTIC4, 2e-3, BST_QUAT_IDENTITY, (bst_vec3){0, wy, wz});
    double l = bst_vec3_norm(bst_spacecraft_body_momentum(&body)), last_s = 0.0, before = wy;
    int flips = 0;
    for (int64_t n = 1; flips < 10 && n < 1000000; n++) {
        bst_spacecraft_body_step(&body, (bst_vec3){0, 0, 0}, no_torque);
        double now = bst_spacecraft_body_rate(&body).y;
        if (now * before < 0.0) {
            double t = 2e-3 * ((double)n - now / (now - before));
            if (flips > 0) { /* crossings by straight lines, 1e-3 s; the first comes at half */
                bst_assert_close(t - last_s, flip_s, 2e-3);
            }
            last_s = t;
            flips++;
        }
        before = now;
    }
    assert_int_equal(flips, 10);
    bst_assert_close(bst_vec3_norm(bst_spacecraft_body_momentum(&body)) / l, 1.0, 1e-14);
}

static bst_spacecraft_spec full_spec(bst_integrator integrator, double dt_s) {
    double r = sqrt(1.0 / 3.0);
    bst_spacecraft_spec spec = {
        .inertia_kgm2 = {12.0, 14.0, 10.0, 0.3, -0.2, 0.1},
        .wheels = 4,
        .modes = 2,
        .wheel = {{{r, r, r}, 1e-3}, {{-r, r, r}, 1e-3}, {{-r, -r, r}, 1e-3}, {{r, -r, r}, 1e-3}},
        .mode = {{2.0 * BST_PI * 1.1, 0.0, {1.2, 0.0, 0.3}},
                 {2.0 * BST_PI * 3.4, 0.0, {0.0, 0.8, 0.1}}},
        .integrator = integrator,
        .dt_s = dt_s};
    return spec;
}

/* Wheels that spin and modes that swing keep the momentum in GCRF exactly and the energy within a
 * bound that falls with the step. */
static void test_everything_free(void **state) {
    (void)state;
    for (int i = 0; i < 2; i++) {
        bst_spacecraft_spec spec =
            full_spec(i ? BST_INTEGRATE_RK4 : BST_INTEGRATE_SYMPLECTIC, 1e-3);
        double spin[BST_WHEELS_MOST] = {300.0, -200.0, 100.0, 500.0};
        bst_spacecraft_body body;
        bst_assert_ok(&ctx, bst_spacecraft_body_init(&ctx, &body, &spec, BST_QUAT_IDENTITY,
                                                     (bst_vec3){0.02, -0.03, 0.05}, spin));
        /* a kick by the wheels' motors sets the modes swinging; the momentum does not notice */
        bst_vec3 l0 = bst_spacecraft_body_momentum(&body);
        double motor[BST_WHEELS_MOST] = {0.05, -0.05, 0.02, 0.0};
        for (int n = 0; n < 300; n++) {
            bst_spacecraft_body_step(&body, (bst_vec3){0, 0, 0}, motor);
        }
        double e0 = bst_spacecraft_body_energy(&body), worst = 0.0;
        double moving = e0;
        for (int k = 0; k < 4; k++) { /* the wheels' own energy is no measure */
            double g = body.wheel_momentum[k];
            moving -= 0.5 * g * g / spec.wheel[k].inertia_kgm2;
        }
        for (int n = 0; n < 20000; n++) {
            bst_spacecraft_body_step(&body, (bst_vec3){0, 0, 0}, no_torque);
            worst = fmax(worst, fabs(bst_spacecraft_body_energy(&body) - e0));
        }
        bst_vec3 l = bst_spacecraft_body_momentum(&body);
        bst_assert_close(bst_vec3_norm(bst_vec3_sub(l, l0)) / bst_vec3_norm(l0), 0.0, 1e-13);
        print_message("%s: energy off by %.1e of %.1e J\n", bst_integrator_names[spec.integrator],
                      worst, moving);
        /* the second-order splitting leaves (w dt)^2 of the part that moves; rk4 less */
        assert_true(worst < 2e-7 * moving);
    }
}

/* A mode on the free craft is faster than on a fixed hub by 1 / sqrt(1 - d I^-1 d) (one mode, one
 * axis), and so the exact step has it, at the largest step allowed as well. */
static void test_mode_frequency(void **state) {
    (void)state;
    double inertia = 10.0, d = 2.0, f = 2.0 * BST_PI * 2.0;
    double free = f / sqrt(1.0 - d * d / inertia);
    const double steps_s[2] = {1e-3, BST_MODE_STEP_CYCLES / (free / (2.0 * BST_PI))};
    for (int i = 0; i < 2; i++) {
        bst_spacecraft_spec spec = {.inertia_kgm2 = {inertia, 12, 11, 0, 0, 0},
                                    .modes = 1,
                                    .mode = {{f, 0.01, {d, 0, 0}}},
                                    .dt_s = steps_s[i]};
        bst_spacecraft_body body;
        bst_assert_ok(&ctx, bst_spacecraft_body_init(&ctx, &body, &spec, BST_QUAT_IDENTITY,
                                                     (bst_vec3){0, 0, 0}, no_torque));
        bst_assert_close(body.free_radps[0], free, 1e-12 * free);
        bst_spacecraft_body_step(&body, (bst_vec3){1e-3 / steps_s[i], 0, 0}, no_torque);
        /* zeros of the mode's swing, twice a cycle; damping z f^2 -> (n'' + 2 z f k n' + f^2 k n =
         * 0, k = 1 / (1 - d^2 / I)): the damped frequency */
        double k = 1.0 / (1.0 - d * d / inertia), decay = 0.01 * f * k;
        double damped = sqrt(f * f * k - decay * decay);
        double first = 0.0, last = 0.0, before = 0.0;
        int zeros = 0;
        for (int n = 1; zeros < 21; n++) {
            bst_spacecraft_body_step(&body, (bst_vec3){0, 0, 0}, no_torque);
            double now = body.mode_place[0];
            if (now * before < 0.0) {
                /* a straight line misses a crossing of a sine by (w dt)^2 / 8 dt at most */
                last = steps_s[i] * (n - now / (now - before));
                first = zeros == 0 ? last : first;
                zeros++;
            }
            before = now;
        }
        bst_assert_close(
            20.0 * BST_PI / (last - first) / damped, 1.0,
            free * free * steps_s[i] * steps_s[i] / 8.0 * steps_s[i] * free / 60.0 + 1e-9);
    }
}

static void test_step_too_large_for_a_mode(void **state) {
    (void)state;
    bst_spacecraft_spec spec = full_spec(BST_INTEGRATE_SYMPLECTIC, 1e-3);
    bst_spacecraft_body body;
    bst_assert_ok(&ctx, bst_spacecraft_body_init(&ctx, &body, &spec, BST_QUAT_IDENTITY,
                                                 (bst_vec3){0, 0, 0}, no_torque));
    double longest = BST_MODE_STEP_CYCLES / (body.free_radps[1] / (2.0 * BST_PI));
    spec.dt_s = longest * 0.999;
    bst_assert_ok(&ctx, bst_spacecraft_body_init(&ctx, &body, &spec, BST_QUAT_IDENTITY,
                                                 (bst_vec3){0, 0, 0}, no_torque));
    spec.dt_s = 10.0 * longest;
    assert_int_equal(bst_spacecraft_body_init(&ctx, &body, &spec, BST_QUAT_IDENTITY,
                                              (bst_vec3){0, 0, 0}, no_torque),
                     BST_ERR_CONFIG);
    char said[64];
    snprintf(said, sizeof said, "longest step allowed is %.4g s", longest);
    assert_non_null(strstr(ctx.message, said));
}

static void refused(const double inertia[6], const char *why) {
    bst_spacecraft_spec spec = {.dt_s = 1e-3};
    memcpy(spec.inertia_kgm2, inertia, sizeof spec.inertia_kgm2);
    bst_spacecraft_body body;
    assert_int_equal(bst_spacecraft_body_init(&ctx, &body, &spec, BST_QUAT_IDENTITY,
                                              (bst_vec3){0, 0, 0}, no_torque),
                     BST_ERR_CONFIG);
    assert_non_null(strstr(ctx.message, why));
}

static void test_inertia_refused(void **state) {
    (void)state;
    refused((const double[6]){1, 1, 0, 0, 0, 0}, "not positive definite");
    refused((const double[6]){1, 1, 1, 1.5, 0, 0}, "not positive definite");
    refused((const double[6]){1, 2, 4, 0, 0, 0}, "sum of the two others");
    refused((const double[6]){1, 1, 1, 0.9, 0, 0.0}, "sum of the two others");
    bst_spacecraft_spec spec = full_spec(BST_INTEGRATE_SYMPLECTIC, 1e-3);
    spec.mode[0].coupling = (bst_vec3){4.0, 0, 0}; /* 16 kg m^2 of 12 */
    bst_spacecraft_body body;
    assert_int_equal(bst_spacecraft_body_init(&ctx, &body, &spec, BST_QUAT_IDENTITY,
                                              (bst_vec3){0, 0, 0}, no_torque),
                     BST_ERR_CONFIG);
    assert_non_null(strstr(ctx.message, "coupling"));
}

/* A rod with a millionth of its inertia about its axis, flat plates, axes that are not principal:
 * torque about the odd axis for a second and back leaves it at rest. */
static void test_nearly_singular(void **state) {
    (void)state;
    static const double shapes[3][6] = {
        {10, 10, 1e-5, 0, 0, 0}, {5, 5, 10, 0, 0, 0}, {10, 10, 10, 4.99, 0, 0}};
    for (int i = 0; i < 3; i++) {
        bst_spacecraft_spec spec = {.dt_s = 1e-3};
        memcpy(spec.inertia_kgm2, shapes[i], sizeof spec.inertia_kgm2);
        bst_spacecraft_body body;
        bst_assert_ok(&ctx, bst_spacecraft_body_init(&ctx, &body, &spec, BST_QUAT_IDENTITY,
                                                     (bst_vec3){0, 0, 0}, no_torque));
        for (int n = 0; n < 2000; n++) {
            double t = (n < 1000 ? 1.0 : -1.0) * shapes[i][2] * 0.5;
            bst_spacecraft_body_step(&body, (bst_vec3){0, 0, t}, no_torque);
        }
        /* the torque is about a principal axis: half a radian of turn each second, to rounding */
        bst_vec3 turn = bst_quat_to_rotvec(bst_spacecraft_body_attitude(&body));
        bst_assert_close(turn.x, 0.0, 1e-9);
        bst_assert_close(turn.y, 0.0, 1e-9);
        bst_assert_close(turn.z, -0.5, 1e-9);
        bst_assert_close(bst_vec3_norm(bst_spacecraft_body_rate(&body)), 0.0, 1e-9);
    }
}

/* A motor torque u on a wheel: at any time the body has what the wheel lost, and the wheel's speed
 * is u t / load. */
static void test_wheel_against_body(void **state) {
    (void)state;
    bst_spacecraft_spec spec = {.inertia_kgm2 = {12, 14, 10, 0, 0, 0},
                                .wheels = 1,
                                .wheel = {{{0, 0, 1}, 0.01}},
                                .dt_s = 1e-3};
    bst_spacecraft_body body;
    bst_assert_ok(&ctx, bst_spacecraft_body_init(&ctx, &body, &spec, BST_QUAT_IDENTITY,
                                                 (bst_vec3){0, 0, 0}, no_torque));
    double motor[BST_WHEELS_MOST] = {0.1};
    for (int n = 0; n < 5000; n++) {
        bst_spacecraft_body_step(&body, (bst_vec3){0, 0, 0}, motor);
    }
    double impulse = 0.5, rest = 10.0 - 0.01;
    bst_assert_close(bst_spacecraft_body_rate(&body).z, -impulse / rest, 1e-12);
    bst_assert_close(bst_spacecraft_body_wheel_radps(&body, 0), impulse / 0.01 + impulse / rest,
                     1e-9);
    bst_assert_close(bst_spacecraft_body_wheel_radps(&body, 0),
                     impulse / bst_spacecraft_body_wheel_load_kgm2(&body, 0), 1e-9);
    bst_assert_close(bst_vec3_norm(bst_spacecraft_body_momentum(&body)), 0.0, 1e-13);
}

static void test_zero_rate(void **state) {
    (void)state;
    bst_spacecraft_spec spec = full_spec(BST_INTEGRATE_SYMPLECTIC, 1e-3);
    bst_quat q = bst_quat_unit((bst_quat){0.1, -0.2, 0.3, 0.9});
    bst_spacecraft_body body;
    bst_assert_ok(&ctx,
                  bst_spacecraft_body_init(&ctx, &body, &spec, q, (bst_vec3){0, 0, 0}, no_torque));
    for (int n = 0; n < 10000; n++) {
        bst_spacecraft_body_step(&body, (bst_vec3){0, 0, 0}, no_torque);
    }
    bst_assert_close(bst_vec3_norm(bst_spacecraft_body_rate(&body)), 0.0, 0.0); /* exactly */
    bst_assert_close(between(bst_spacecraft_body_attitude(&body), q), 0.0, 1e-15);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_jacobi),
                                       cmocka_unit_test(test_axisymmetric),
                                       cmocka_unit_test(test_intermediate_axis),
                                       cmocka_unit_test(test_everything_free),
                                       cmocka_unit_test(test_mode_frequency),
                                       cmocka_unit_test(test_step_too_large_for_a_mode),
                                       cmocka_unit_test(test_inertia_refused),
                                       cmocka_unit_test(test_nearly_singular),
                                       cmocka_unit_test(test_wheel_against_body),
                                       cmocka_unit_test(test_zero_rate)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
