/* The centre of light of a near object is not its centre of mass: covariances of orbits against the
 * errors that this makes, over many seeds, and against sums over all pairs. */
#include "tests/tracker/orbit_scene.h"
#include "tracker/orbit/orbit_photocentre.h"

enum { COUNT = 60, SEEDS = 60, WAVES = 32 };
static const double RADIUS_M = 5.0;
/* 0.5 m of one direction at 5,600 km, where the object is, and 0.07 m of the mean of all */
static const double SIGMA_RAD = 0.02 * BST_ARCSEC_RAD;

static scene near_pass(void) {
    return (scene){.body = from_elements(6.79e6, 0.0005, 51.6, 40.0, 30.0, 45.0),
                   .eye = from_elements(7.155e6, 0.001, 98.5, 40.0, 80.0, 5.0),
                   .earth_mps = {21000.0, -18500.0, -8000.0},
                   .to_s = 240,
                   .count = COUNT,
                   .sigma_rad = SIGMA_RAD};
}

static double range_at(const scene *s, const bst_od_observation *o) {
    const bst_od_state there = truth_at(s, o->observer.time_s);
    bst_od_sight sight;
    bst_od_see(&there, &o->observer, &sight);
    return sight.range_m;
}

/* Displaces a direction by an offset of the light, m. */
static void displace(const scene *s, bst_vec3 offset_m, bst_od_observation *o) {
    const bst_vec3 across = bst_tangent_project(o->direction, offset_m);
    o->direction = bst_tangent_exp(o->direction, bst_vec3_scale(across, 1.0 / range_at(s, o)));
}

/* Chi-square, 6 degrees of freedom, of the error of an orbit fitted to observations. */
static double error_of(const scene *s, const bst_od_observation *items, double photocentre_m) {
    bst_ctx ctx = {0};
    const bst_od_options options = {.motion = s->motion, .photocentre_m = photocentre_m};
    bst_od_solution got;
    double e[6];
    bst_assert_ok(&ctx, bst_od_fit(&ctx, items, s->count, &options, &s->body, NULL, &got));
    const bst_od_state truth = truth_at(s, got.state.time_s);
    difference(&got.state, &truth, e);
    return normalised(e, (const double(*)[6])got.covariance);
}

/* A random unit vector. */
static bst_vec3 any_direction(bst_rng_key key, uint64_t at) {
    return bst_vec3_unit((bst_vec3){bst_rng_normal(key, at, 0), bst_rng_normal(key, at, 1),
                                    bst_rng_normal(key, at, 2)});
}

/* Mean and limits of the sum of chi-squares with 6 degrees of freedom each over all seeds:
 * probability 1e-4 on each side, z = 3.72 (Wilson and Hilferty, PNAS 17, 1931). */
static double limit(double z) {
    const double dof = 6.0 * SEEDS, d = 2.0 / (9.0 * dof), root = 1.0 - d + z * sqrt(d);
    return dof * root * root * root;
}

/* Displacements with the statistics of the model: of each axis a sum of waves in the object's turn
 * and the direction, whose numbers are normal, has the correlation exp(-(turn^2 + d^2) / 2). */
static void errors_are_as_stated(void **state) {
    (void)state;
    const scene s = near_pass();
    const bst_vec3 r = s.body.position_m, v = s.body.velocity_mps;
    const double perigee_m = 6.79e6 * (1.0 - 0.0005);
    const double rate = bst_vec3_norm(bst_vec3_cross(r, v)) / (perigee_m * perigee_m);
    double sum = 0.0, without = 0.0;
    for (int seed = 0; seed < SEEDS; seed++) {
        const bst_rng_key key = bst_rng_make_key(3, (uint64_t)seed, "test", "photocentre");
        bst_od_observation items[COUNT];
        observe(&s, seed, items);
        for (int i = 0; i < COUNT; i++) {
            const bst_vec3 d = items[i].direction;
            const double factor = i % 3 ? 1.2 : 0.0; /* 0: not known, 1 */
            double offset[3] = {0.0};
            for (int k = 0; k < 3 * WAVES; k++) {
                double w[5];
                for (int n = 0; n < 4; n++) {
                    w[n] = bst_rng_normal(key, (uint64_t)k, (uint64_t)n);
                }
                w[4] = 2.0 * BST_PI * bst_rng_uniform(key, (uint64_t)k, 9);
                offset[k % 3] += sqrt(2.0 / WAVES) * 0.5 * RADIUS_M *
                                 (factor > 0.0 ? factor : 1.0) *
                                 cos(w[0] * rate * items[i].observer.time_s + w[1] * d.x +
                                     w[2] * d.y + w[3] * d.z + w[4]);
            }
            items[i].photocentre_factor = factor;
            displace(&s, (bst_vec3){offset[0], offset[1], offset[2]}, &items[i]);
        }
        sum += error_of(&s, items, 0.5 * RADIUS_M);
        without += error_of(&s, items, 0.0);
    }
    print_message("model: %.1f of %d, without %.1f\n", sum, 6 * SEEDS, without);
    assert_true(sum > limit(-3.72) && sum < limit(3.72));
    assert_true(without > 10.0 * sum); /* the displacement matters here */
}

/* A Lambertian sphere, lit from any side. Its displacement towards the Sun has the model's mean
 * square in each direction, but turns less than an object's: chi-squares of a pass are smaller. */
static void sphere_in_arc(double arc_s, double z) {
    scene s = near_pass();
    s.to_s = arc_s;
    double sum = 0.0, without = 0.0;
    for (int seed = 0; seed < SEEDS; seed++) {
        const bst_rng_key key = bst_rng_make_key(4, (uint64_t)seed, "test", "sun");
        const bst_vec3 sun = any_direction(key, 0);
        bst_od_observation items[COUNT];
        observe(&s, seed, items);
        for (int i = 0; i < COUNT; i++) {
            const double a = bst_vec3_angle(sun, bst_vec3_scale(items[i].direction, -1.0));
            const double off_m = RADIUS_M * 3.0 * BST_PI / 16.0 * sin(a) * (1.0 + cos(a)) /
                                 (sin(a) + (BST_PI - a) * cos(a));
            const bst_vec3 across = bst_vec3_unit(bst_tangent_project(items[i].direction, sun));
            items[i].photocentre_factor = bst_od_photocentre_factor_seen(sun, items[i].direction);
            items[i].sun = sun;
            displace(&s, bst_vec3_scale(across, off_m), &items[i]);
        }
        sum += error_of(&s, items, 0.5 * RADIUS_M);
        without += error_of(&s, items, 0.0);
    }
    print_message("sphere, %g s: %.1f of %d, without %.1f\n", arc_s, sum, 6 * SEEDS, without);
    assert_true(sum < limit(z));
    assert_true(without > 10.0 * sum);
}

/* A pass, and more than a revolution, after which the displacement is still towards the Sun: within
 * the central 95 %; 1.64 times as much if all of it turned with the object. */
static void a_sphere_is_within_its_covariance(void **state) {
    (void)state;
    sphere_in_arc(240.0, 3.72);
    sphere_in_arc(20000.0, 1.96);
}

/* The sum over all pairs, for successive observations that count as one and for such as do not. */
static void sums_over_all_pairs(void **state) {
    (void)state;
    enum { N = 50 };
    const double rate = 1e-3;
    for (int wide = 0; wide < 2; wide++) {
        const bst_rng_key key = bst_rng_make_key(5, (uint64_t)wide, "test", "pairs");
        bst_od_photocentre_effect items[N];
        double want[6][6] = {{0.0}}, got[6][6];
        for (int i = 0; i < N; i++) {
            /* rad; 0.3 in all, or 15 */
            const double turn = (wide ? 0.3 : 0.006) * i;
            items[i] = (bst_od_photocentre_effect){
                .time_s = turn / rate, .direction = {cos(0.7 * turn), sin(0.7 * turn), 0.0}};
            for (int k = 0; k < 18; k++) {
                items[i].rhs[k / 6][k % 6] =
                    1.0 + 0.5 * k + bst_rng_normal(key, (uint64_t)i, (uint64_t)k);
            }
        }
        for (int i = 0; i < N; i++) {
            for (int j = 0; j < N; j++) {
                const double turn = rate * (items[i].time_s - items[j].time_s);
                const double apart =
                    bst_vec3_norm(bst_vec3_sub(items[i].direction, items[j].direction));
                const double kept = exp(-0.5 * (turn * turn + apart * apart));
                for (int k = 0; k < 36; k++) {
                    for (int c = 0; c < 3; c++) {
                        want[k / 6][k % 6] +=
                            kept * items[i].rhs[c][k / 6] * items[j].rhs[c][k % 6];
                    }
                }
            }
        }
        bst_od_photocentre_covariance(items, N, rate, got);
        for (int k = 0; k < 36; k++) {
            const double scale = sqrt(want[k / 6][k / 6] * want[k % 6][k % 6]);
            /* 0.02 rad in the time of one of a pair; none of them are within that if wide */
            bst_assert_close(got[k / 6][k % 6], want[k / 6][k % 6], (wide ? 1e-7 : 0.01) * scale);
        }
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(errors_are_as_stated),
        cmocka_unit_test(a_sphere_is_within_its_covariance),
        cmocka_unit_test(sums_over_all_pairs),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
