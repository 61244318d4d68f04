/* Identification without an attitude: codes, database, null model, fit, and fields of the sky. */
#include "imgproc/identify/null_model.h"
#include "imgproc/identify/sky_cells.h"
#include "imgproc/identify/star_fit.h"
#include "tests/imgproc/random_sky.h"
#include "tests/test_support.h"

static const double YEAR = 2024.6, FIELD_DEG = 10.0, V_LIMIT = 7.0;

typedef struct scene {
    bst_ctx ctx;
    bst_stars *sky, *onboard; /* the onboard catalogue lacks 40 % of the stars */
    bst_star_patterns *patterns;
    bst_random_sky drawn;
    bst_lost_in_space_result result;
} scene;

static int setup(void **state) {
    scene *s = calloc(1, sizeof *s);
    assert_non_null(s);
    bst_assert_ok(&s->ctx, bst_stars_open(&s->ctx, "embedded", &s->sky));
    const bst_star_errors_config errors = {.missing_fraction = 0.4, .seed = 7};
    bst_assert_ok(&s->ctx, bst_stars_with_errors(&s->ctx, s->sky, &errors, &s->onboard));
    const bst_star_patterns_options options = {FIELD_DEG * BST_DEG_RAD, V_LIMIT, YEAR};
    bst_assert_ok(&s->ctx, bst_star_patterns_create(&s->ctx, s->onboard, &options, &s->patterns));
    *state = s;
    return 0;
}
static int teardown(void **state) {
    scene *s = *state;
    bst_star_patterns_free(s->patterns);
    bst_stars_close(s->onboard);
    bst_stars_close(s->sky);
    free(s);
    return 0;
}

/* Solves the detections that were drawn in a window.
 *
 * Given:     near  an attitude that is tried first; NULL: none */
static void solve_near(scene *s, int count, bst_window window,
                       const bst_lost_in_space_result *near) {
    bst_lost_in_space *lost;
    bst_assert_ok(&s->ctx, bst_lost_in_space_create(&s->ctx, &s->drawn.camera, s->onboard,
                                                    s->patterns, YEAR, BST_RANDOM_SKY_ROOM, &lost));
    const bst_lost_in_space_options options = BST_LOST_IN_SPACE_USUAL;
    const bst_lost_in_space_frame frame = {s->drawn.items,  count, window, V_LIMIT,
                                           &s->drawn.light, NULL,  near};
    bst_assert_ok(&s->ctx, bst_lost_in_space_solve(&s->ctx, lost, &options, &frame, &s->result));
    bst_lost_in_space_free(lost);
}

static void solve_window(scene *s, int count, bst_window window) {
    solve_near(s, count, window, NULL);
}

static void solve(scene *s, int count) {
    solve_window(s, count, (bst_window){0, 0, 1024, 1024});
}

/* Distance of the solved boresight from the true one, px. */
static double off_px(const scene *s) {
    bst_vec3 e = bst_quat_to_rotvec(
        bst_quat_mul(s->result.q_cam_from_gcrf, bst_quat_conj(s->drawn.q_cam_from_gcrf)));
    return hypot(e.x, e.y) / bst_camera_scale_rad(&s->drawn.camera);
}

static bst_random_sky_options usual(void) {
    return (bst_random_sky_options){
        .field_deg = FIELD_DEG, .v_limit = V_LIMIT, .false_detections = 10};
}

static double uniform(uint64_t a, uint64_t b) {
    return bst_rng_uniform(bst_rng_make_key(2, 0, "test", "lost in space"), a, b);
}

/* 40 % of the stars are not in the catalogue, the scale is up to 5 % wrong, 10 detections are
 * false. */
static void random_fields_are_solved(void **state) {
    scene *s = *state;
    int tried = 0, solved = 0;
    for (uint64_t i = 0; i < 100; i++) {
        bst_random_sky_options o = usual();
        o.scale_error = 0.1 * uniform(i, 0) - 0.05;
        bst_random_sky_draw(&o, s->sky, s->onboard, 21, i, &s->drawn);
        solve(s, s->drawn.count);
        tried += s->drawn.usable >= 6;
        solved += s->result.solved && s->drawn.usable >= 6;
        if (s->result.solved) {
            /* eight stars of 0.15 px and more give 0.05 px and scale to 1e-4: ten sigma */
            assert_true(off_px(s) < 0.6);
            bst_assert_close(s->result.scale, 1.0 + o.scale_error, 1e-3);
            assert_true(s->result.log_chance < log(1e-6));
        }
    }
    print_message("%d of %d fields solved\n", solved, tried);
    assert_true(tried >= 99);
    assert_true(solved >= tried - 1);
}

/* An attitude a few pixels off is improved without a search, a wrong one does no harm. */
static void an_earlier_attitude_is_tried_first(void **state) {
    scene *s = *state;
    const bst_window whole = {0, 0, 1024, 1024};
    bst_random_sky_options o = usual();
    bst_random_sky_draw(&o, s->sky, s->onboard, 29, 0, &s->drawn);
    solve(s, s->drawn.count);
    assert_true(s->result.solved && s->result.quads > 0);
    const bst_lost_in_space_result first = s->result;
    const bst_vec3 turn[] = {{4.0 * bst_camera_scale_rad(&s->drawn.camera), 0.0, 0.0},
                             {0.3, 0.2, 0.1}};
    for (int i = 0; i < 2; i++) {
        bst_lost_in_space_result near = first;
        near.q_cam_from_gcrf = bst_quat_mul(bst_quat_from_rotvec(turn[i]), near.q_cam_from_gcrf);
        solve_near(s, s->drawn.count, whole, &near);
        assert_true(s->result.solved);
        assert_int_equal(s->result.quads > 0, i);
        bst_assert_close(s->result.scale, first.scale, 1e-6); /* the same stars, fitted alike */
        assert_true(off_px(s) < 0.6);
    }
}

/* Neither a mirrored sky nor stars in other places look like any part of it. */
static void wrong_skies_are_not_solved(void **state) {
    scene *s = *state;
    for (uint64_t i = 0; i < 16; i++) {
        bst_random_sky_options o = usual();
        o.mirrored = i % 2 == 0;
        o.scrambled = i % 2 == 1;
        bst_random_sky_draw(&o, s->sky, s->onboard, 22, i, &s->drawn);
        solve(s, s->drawn.count);
        assert_true(s->result.quads > 1000);
        assert_false(s->result.solved);
    }
}

/* Places with errors along a streak leave room for codes that agree by chance: of such patterns,
 * those whose four stars do not fit one attitude and scale are no candidates. */
static void patterns_must_fit_their_four_stars(void **state) {
    scene *s = *state;
    int patterns = 0, candidates = 0;
    for (uint64_t i = 0; i < 4; i++) {
        bst_random_sky_options o = usual();
        o.streak_px = 800.0;
        o.scrambled = true;
        bst_random_sky_draw(&o, s->sky, s->onboard, 28, i, &s->drawn);
        solve(s, s->drawn.count);
        assert_false(s->result.solved);
        patterns += s->result.patterns;
        candidates += s->result.candidates;
    }
    print_message("%d patterns agree, %d fit\n", patterns, candidates);
    assert_true(patterns > 1000);
    assert_true(candidates < 0.1 * patterns);
}

/* Places with long, slanting errors in a window off the corner: the stars that are predicted are
 * those of the window, and those that match are those within three sigma by their covariance. */
static void streaks_in_a_window(void **state) {
    scene *s = *state;
    const bst_window w = {40, 352, 944, 560};
    bst_star *stars = calloc(4000, sizeof *stars);
    assert_non_null(stars);
    int solved = 0, all_far = 0;
    for (uint64_t i = 0; i < 6; i++) {
        bst_random_sky_options o = usual();
        o.streak_px = 800.0;
        bst_random_sky_draw(&o, s->sky, s->onboard, 27, i, &s->drawn);
        int kept = 0, count, predicted = 0, matched = 0, far = 0;
        for (int k = 0; k < s->drawn.count; k++) {
            const bst_detection d = s->drawn.items[k];
            if (d.x_px >= w.x0 && d.x_px < w.x0 + w.width && d.y_px >= w.y0 &&
                d.y_px < w.y0 + w.height) {
                s->drawn.items[kept++] = d;
            }
        }
        solve_window(s, kept, w);
        if (!s->result.solved) {
            continue;
        }
        solved++;
        const bst_camera *camera = &s->drawn.camera;
        bst_vec3 axis =
            bst_quat_rotate(bst_quat_conj(s->drawn.q_cam_from_gcrf), (bst_vec3){0, 0, 1});
        bst_assert_ok(&s->ctx, bst_stars_query(&s->ctx, s->onboard, axis, 0.15, V_LIMIT, YEAR,
                                               stars, 4000, &count));
        for (int k = 0; k < count; k++) {
            double x, y, near = INFINITY;
            bst_vec3 v = bst_quat_rotate(s->drawn.q_cam_from_gcrf,
                                         bst_light_apparent_star(&s->drawn.light, stars[k].icrs));
            if (!bst_camera_project(camera, v, &x, &y) || x < w.x0 || x > w.x0 + w.width - 1 ||
                y < w.y0 || y > w.y0 + w.height - 1) {
                continue;
            }
            predicted++;
            for (int n = 0; n < kept; n++) {
                const bst_detection *d = &s->drawn.items[n];
                double dx = d->x_px - x, dy = d->y_px - y;
                double det = d->cov_xx * d->cov_yy - d->cov_xy * d->cov_xy;
                near = fmin(
                    near,
                    (d->cov_yy * dx * dx - 2.0 * d->cov_xy * dx * dy + d->cov_xx * dy * dy) / det);
            }
            matched += near < 9.0;
            far += near < 9.0 && near > 1.0;
        }
        all_far += far;
        assert_in_range(s->result.predicted, predicted - 1, predicted + 1); /* at the edges */
        assert_in_range(s->result.matched, matched, matched + 1);           /* within 0.6 px more */
    }
    print_message("%d of 6 solved, %d stars beyond one sigma\n", solved, all_far);
    assert_true(solved >= 4 && all_far > 15);
    free(stars);
}

static void poles(void **state) {
    scene *s = *state;
    for (int sign = -1; sign <= 1; sign += 2) {
        bst_quat q = bst_quat_look((bst_vec3){0.01, 0.0, sign}, (bst_vec3){0.3, 1.0, 0.0});
        bst_random_sky_options o = usual();
        o.q_cam_from_gcrf = &q;
        bst_random_sky_draw(&o, s->sky, s->onboard, 23, 0, &s->drawn);
        solve(s, s->drawn.count);
        assert_true(s->result.solved);
        assert_true(off_px(s) < 0.6);
    }
}

/* The order by brightness only says what is tried first. */
static void stars_of_one_brightness(void **state) {
    scene *s = *state;
    bst_random_sky_options o = usual();
    o.even = true;
    o.false_detections = 0;
    int solved = 0;
    for (uint64_t i = 0; i < 5; i++) {
        bst_random_sky_draw(&o, s->sky, s->onboard, 24, i, &s->drawn);
        solve(s, s->drawn.count);
        solved += s->result.solved && off_px(s) < 0.6;
    }
    assert_true(solved >= 4);
}

static void too_few_stars(void **state) {
    scene *s = *state;
    bst_random_sky_options o = usual();
    o.false_detections = 0;
    bst_random_sky_draw(&o, s->sky, s->sky, 25, 0, &s->drawn);
    for (int count = 0; count <= 5; count++) {
        /* four stars are one quad and nothing to check it by; one more is not enough */
        solve(s, count);
        assert_false(s->result.solved);
        assert_int_equal(s->result.quads > 0, count >= 4);
    }
    for (int i = 1; i < s->drawn.count; i++) { /* all at one place */
        s->drawn.items[i].x_px = s->drawn.items[0].x_px;
        s->drawn.items[i].y_px = s->drawn.items[0].y_px;
    }
    solve(s, s->drawn.count);
    assert_false(s->result.solved);
}

static void null_model(void **state) {
    (void)state;
    /* closed forms: rounding of logarithms */
    bst_assert_close(bst_null_model_log_tail(7, 1, 0.2), log(1.0 - pow(0.8, 7)), 1e-12);
    bst_assert_close(bst_null_model_log_tail(9, 9, 0.3), 9 * log(0.3), 1e-12);
    /* 10 * 0.3^3 * 0.7^2 + 5 * 0.3^4 * 0.7 + 0.3^5 */
    bst_assert_close(bst_null_model_log_tail(5, 3, 0.3), log(0.16308), 1e-12);
    bst_assert_close(bst_null_model_log_tail(5, 0, 0.3), 0.0, 0.0);
    assert_true(isinf(bst_null_model_log_tail(3, 4, 0.3)));
    assert_true(isinf(bst_null_model_log_tail(3, 1, 0.0)));
    /* counted: places of 40 detections within 10 px of a random point */
    int hits = 0;
    enum { TRIES = 20000 };
    for (uint64_t i = 0; i < TRIES; i++) {
        double x = 1000 * uniform(i + 10, 0), y = 1000 * uniform(i + 10, 1);
        bool hit = false;
        for (uint64_t k = 0; k < 40; k++) {
            double a = 1200 * uniform(i + 10, 2 + 2 * k) - 100 - x;
            double b = 1200 * uniform(i + 10, 3 + 2 * k) - 100 - y;
            hit = hit || a * a + b * b < 100.0;
        }
        hits += hit;
    }
    double p = bst_null_model_chance(40 * BST_PI * 10.0 * 10.0, 1200.0 * 1200.0);
    bst_assert_close((double)hits / TRIES, p, 4.0 * sqrt(p / TRIES));
}

static bst_vec3 on_sphere(uint64_t i) {
    double z = 2.0 * uniform(i, 0) - 1.0;
    return bst_vec3_unit(bst_vec3_add(
        bst_vec3_scale(bst_vec3_from_radec(2 * BST_PI * uniform(i, 1), 0.0), sqrt(1.0 - z * z)),
        (bst_vec3){0, 0, z}));
}

static void codes(void **state) {
    (void)state;
    for (uint64_t i = 0; i < 50; i++) {
        bst_vec3 v[4], turned[4], mirrored[4];
        bst_quat q = bst_quat_from_rotvec(bst_vec3_scale(on_sphere(i), 3.0 * uniform(i, 2)));
        for (uint64_t k = 0; k < 4; k++) {
            v[k] = bst_vec3_unit((bst_vec3){0.1 * uniform(i, 10 + k), 0.1 * uniform(i, 20 + k), 1});
            turned[3 - k] = bst_quat_rotate(q, v[k]);
            mirrored[k] = (bst_vec3){-v[k].x, v[k].y, v[k].z};
        }
        bst_star_quad a, b, c, forms[3];
        assert_true(bst_star_quad_make(v, &a) && bst_star_quad_make(turned, &b) &&
                    bst_star_quad_make(mirrored, &c));
        bst_assert_close(a.size_rad, b.size_rad, 1e-14); /* rounding */
        assert_true(a.code[0] <= a.code[2] && a.code[0] + a.code[2] <= 1.0);
        for (int k = 0; k < 4; k++) {
            bst_assert_close(a.code[k], b.code[k], 1e-12);
            assert_int_equal(a.order[k], 3 - b.order[k]);
            bst_assert_close(c.code[k], k % 2 ? -a.code[k] : a.code[k], 1e-12);
        }
        /* with a tolerance that leaves all open: each exchange is its own inverse */
        assert_int_equal(bst_star_quad_alternatives(&a, 10.0, forms), 3);
        bst_assert_close(forms[0].code[0], a.code[2], 0.0);
        bst_assert_close(forms[1].code[0], 1.0 - a.code[2], 0.0);
        bst_assert_close(forms[2].code[3], -a.code[3], 0.0);
        assert_int_equal(forms[2].order[0], a.order[1]);
    }
    const bst_vec3 one = {0, 0, 1}, same[4] = {one, one, one, one};
    bst_star_quad none;
    assert_false(bst_star_quad_make(same, &none));
}

static void sky_cells(void **state) {
    (void)state;
    enum { STARS = 2000 };
    static bst_vec3 v[STARS];
    bst_ctx ctx = {0};
    bst_sky_cells sky;
    bst_assert_ok(&ctx, bst_sky_cells_open(&ctx, &sky, 0.1, STARS));
    for (int i = 0; i < STARS; i++) {
        v[i] = i < 100 ? bst_vec3_unit((bst_vec3){0.2 * uniform(3000 + (uint64_t)i, 0) - 0.1,
                                                  0.2 * uniform(3000 + (uint64_t)i, 1) - 0.1,
                                                  i % 2 ? 1 : -1})
                       : on_sphere((uint64_t)i);
        bst_sky_cells_add(&sky, v[i]);
    }
    for (int sorted = 0; sorted < 2; sorted++) {
        for (uint64_t k = 0; k < 200; k++) {
            bst_vec3 at = k < 20 ? (bst_vec3){1e-3 * (double)k, 0, k % 2 ? 1 : -1} : on_sphere(k);
            at = bst_vec3_unit(at);
            double radius = 0.3 * uniform(k, 5);
            int expected = 0;
            for (int i = 0; i < STARS; i++) {
                expected += bst_vec3_angle(v[i], at) <= radius;
            }
            assert_int_equal(bst_sky_cells_near(&sky, at, radius, STARS, NULL), expected);
        }
        if (sorted == 0) {
            bst_assert_ok(&ctx, bst_sky_cells_sort(&ctx, &sky));
        }
    }
    bst_sky_cells_close(&sky);
}

/* Quads of known stars: every pattern found for them agrees. Returns how many are the very stars.
 */
static int find_quads(scene *s, const bst_star *found, int count) {
    static bst_star_patterns_match all[64];
    int quads = 0;
    for (int a = 0; a < count; a++) {
        for (int b = a + 1; b < count; b++) {
            for (int c = b + 1; c < count; c++) {
                for (int d = c + 1; d < count; d++) {
                    const bst_vec3 v[4] = {found[a].icrs, found[b].icrs, found[c].icrs,
                                           found[d].icrs};
                    bst_star_quad quad, again;
                    assert_true(bst_star_quad_make(v, &quad));
                    int n = bst_star_patterns_find(s->patterns, &quad, 1e-4, 0.01, all, 64);
                    for (int k = 0; k < n && k < 64; k++) {
                        assert_true(bst_star_quad_make(all[k].icrs, &again));
                        for (int m = 0; m < 4; m++) { /* tolerance and rounding to 16 bits */
                            bst_assert_close(again.code[m], quad.code[m], 2e-4);
                        }
                        bst_assert_close(all[k].size_ratio, again.size_rad / quad.size_rad, 1e-12);
                        quads += bst_vec3_angle(all[k].icrs[0], v[quad.order[0]]) < 1e-6;
                    }
                }
            }
        }
    }
    return quads;
}

static void patterns(void **state) {
    scene *s = *state;
    bst_star_patterns_info info;
    bst_star_patterns_get_info(s->patterns, &info);
    assert_true(info.stars > 2000 && info.stars < 10000);
    assert_true(info.patterns > 5 * info.stars && info.bytes < 10000000);
    for (uint64_t i = 0; i < 10; i++) {
        bst_star found[200];
        int count;
        bst_assert_ok(&s->ctx, bst_stars_query(&s->ctx, s->onboard, on_sphere(i), 0.08, V_LIMIT,
                                               YEAR, found, 200, &count));
        assert_true(find_quads(s, found, count < 16 ? count : 16) >= 4);
    }
    bst_star_patterns *none;
    const bst_star_patterns_options wide = {2.0, 7.0, YEAR};
    assert_int_equal(bst_star_patterns_create(&s->ctx, s->sky, &wide, &none), BST_ERR_ARGUMENT);
    assert_non_null(strstr(s->ctx.message, "114.592 deg"));
}

/* An exchange is open where errors of the tolerance in each number of the code may undo its rule:
 * Re D - Re C and 1 - Re C - Re D then change by twice the tolerance. Both sides of each limit. */
static void alternatives_within_the_tolerance(void **state) {
    (void)state;
    static const struct {
        double c, d; /* real parts of C and D */
        bool inner, outer;
    } all[] = {{0.30, 0.339, true, false}, {0.30, 0.341, false, false},
               {0.30, 0.661, false, true}, {0.30, 0.659, false, false},
               {0.48, 0.51, true, true},   {0.10, 0.50, false, false}};
    for (size_t k = 0; k < sizeof all / sizeof all[0]; k++) {
        const bst_star_quad quad = {.code = {all[k].c, 0.2, all[k].d, -0.1}, .order = {3, 1, 0, 2}};
        bst_star_quad out[3];
        int count = bst_star_quad_alternatives(&quad, 0.02, out), inner = 0, outer = 0;
        for (int i = 0; i < count; i++) {
            bool ends = out[i].order[0] == 1, middle = out[i].order[2] == 2;
            inner += middle && !ends;
            outer += middle && ends;
        }
        assert_int_equal(inner, all[k].inner);
        assert_int_equal(outer, all[k].outer);
        assert_int_equal(count, all[k].inner + all[k].outer + (all[k].inner && all[k].outer));
    }
}

/* A quad of the catalogue whose numbers are changed one at a time is found up to the tolerances
 * and not beyond them: by a number of the code, and by its size, which may be smaller or larger
 * than the pattern's by the scale's tolerance and that of the code. Words have 16 bits: 2e-4 of
 * the size, 3e-5 of the code. */
static void patterns_within_the_tolerances(void **state) {
    scene *s = *state;
    const double tolerance = 0.03, scale = 0.05, most = tolerance - log(1.0 - scale);
    static bst_star_patterns_match all[4096];
    int quads = 0;
    for (uint64_t i = 0; quads < 8 && i < 40; i++) {
        bst_star found[200];
        int count;
        bst_assert_ok(&s->ctx, bst_stars_query(&s->ctx, s->onboard, on_sphere(700 + i), 0.06,
                                               V_LIMIT, YEAR, found, 200, &count));
        bst_star_quad quad;
        if (count < 4 ||
            !bst_star_quad_make(
                (bst_vec3[4]){found[0].icrs, found[1].icrs, found[2].icrs, found[3].icrs}, &quad) ||
            bst_star_patterns_find(s->patterns, &quad, 1e-4, 1e-3, all, 1) != 1) {
            continue;
        }
        const bst_vec3 own = all[0].icrs[0], other = all[0].icrs[2];
        quads++;
        for (int k = 0; k < 20; k++) {
            int number = k / 4;
            double share = k % 2 ? 0.99 : 1.01, sign = k % 4 < 2 ? 1.0 : -1.0;
            bst_star_quad off = quad;
            if (number < 4) {
                off.code[number] += sign * share * tolerance;
            } else {
                off.size_rad *= exp(sign * share * most);
            }
            int n = bst_star_patterns_find(s->patterns, &off, tolerance, scale, all, 4096);
            assert_true(n <= 4096);
            bool here = false;
            for (int m = 0; m < n; m++) {
                here = here || (bst_vec3_angle(all[m].icrs[0], own) < 1e-9 &&
                                bst_vec3_angle(all[m].icrs[2], other) < 1e-9 &&
                                fabs(all[m].size_ratio * off.size_rad / quad.size_rad - 1) < 1e-6);
            }
            assert_int_equal(here, k % 2);
        }
    }
    assert_int_equal(quads, 8);
}

/* Attitude and scale of exact places come back to rounding, from a start 0.3 deg and 3 % off. */
static void the_fit_is_exact(void **state) {
    scene *s = *state;
    bst_random_sky_options o = usual();
    bst_random_sky_draw(&o, s->sky, s->sky, 26, 0, &s->drawn);
    const bst_camera *camera = &s->drawn.camera;
    const bst_star_fit truth = {.q_cam_from_gcrf = s->drawn.q_cam_from_gcrf, .scale = 1.02};
    bst_star_fit_pair pairs[8];
    for (uint64_t i = 0; i < 8; i++) {
        bst_vec3 v = bst_camera_unproject(camera, 1000 * uniform(i, 7), 1000 * uniform(i, 8));
        pairs[i].gcrf = bst_quat_rotate(bst_quat_conj(truth.q_cam_from_gcrf), v);
        pairs[i].cov_xx = 0.01 + 0.1 * (double)i;
        pairs[i].cov_xy = 0.004 * (double)i;
        pairs[i].cov_yy = 0.02;
        assert_true(
            bst_star_fit_project(&truth, camera, pairs[i].gcrf, &pairs[i].x_px, &pairs[i].y_px));
    }
    bst_star_fit fit;
    assert_true(bst_star_fit_start(camera, pairs, 0.99, &fit));
    assert_true(bst_star_fit_refine(camera, pairs, 8, &fit));
    bst_vec3 e =
        bst_quat_to_rotvec(bst_quat_mul(fit.q_cam_from_gcrf, bst_quat_conj(truth.q_cam_from_gcrf)));
    bst_assert_close(bst_vec3_norm(e), 0.0, 1e-12);
    bst_assert_close(fit.scale, 1.02, 1e-12);
    bst_assert_close(fit.rms_px, 0.0, 1e-8);
    pairs[1] = pairs[0];
    assert_false(bst_star_fit_start(camera, pairs, 1.0, &fit));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(random_fields_are_solved),
        cmocka_unit_test(an_earlier_attitude_is_tried_first),
        cmocka_unit_test(wrong_skies_are_not_solved),
        cmocka_unit_test(patterns_must_fit_their_four_stars),
        cmocka_unit_test(streaks_in_a_window),
        cmocka_unit_test(poles),
        cmocka_unit_test(stars_of_one_brightness),
        cmocka_unit_test(too_few_stars),
        cmocka_unit_test(null_model),
        cmocka_unit_test(codes),
        cmocka_unit_test(sky_cells),
        cmocka_unit_test(patterns),
        cmocka_unit_test(alternatives_within_the_tolerance),
        cmocka_unit_test(patterns_within_the_tolerances),
        cmocka_unit_test(the_fit_is_exact),
    };
    return cmocka_run_group_tests(tests, setup, teardown);
}
