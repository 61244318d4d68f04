/* Parts of a tracker's frame against numbers that are worked out here: the acceleration of a cue
 * far from the equator, the light of an object whose orbit is known, which earlier track a new one
 * continues. */
#include "tests/tracker/sky_bench.h"
#include "tracker/mtt/multitarget_internal.h"
#include "tracker/mtt/visibility.h"

static bst_vec3 place_at(bst_vec3 at, double x, double y) {
    bst_tangent axes = bst_tangent_at(at);
    return bst_tangent_exp(at, bst_tangent_vector(&axes, x, y));
}

/* A cue with an acceleration in both axes: half of it times the square of the time, and its change
 * of rate, whatever the axes of the two places. */
static void cues_accelerate(void **state) {
    (void)state;
    const double dt = 8.0, r[2] = {300 * AS, -170 * AS}, a[2] = {3 * AS, 7 * AS};
    bst_vec3 at = bst_vec3_unit((bst_vec3){0.3, -0.2, 0.93});
    bst_tangent axes = bst_tangent_at(at);
    bst_vec3 place[2], rate[2];
    for (int k = 0; k < 2; k++) { /* gnomonic about the middle of the path */
        double t = (k - 0.5) * dt, x[2], v[2];
        for (int i = 0; i < 2; i++) {
            x[i] = r[i] * t + 0.5 * a[i] * t * t;
            v[i] = r[i] + a[i] * t;
        }
        bst_vec3 p = bst_vec3_add(at, bst_tangent_vector(&axes, x[0], x[1]));
        bst_vec3 moved = bst_tangent_vector(&axes, v[0], v[1]);
        double n = bst_vec3_norm(p);
        place[k] = bst_vec3_scale(p, 1.0 / n);
        rate[k] = bst_vec3_scale(bst_tangent_project(place[k], moved), 1.0 / n);
    }
    bst_mtt_frame frame = {.cue_valid = true,
                           .cue_before_valid = true,
                           .cue_before_direction = place[0],
                           .cue_before_rate_radps = rate[0],
                           .cue_direction = place[1],
                           .cue_rate_radps = rate[1]};
    bst_vec3 step, change;
    assert_true(bst_mtt_cue_acceleration(&frame, dt, &step, &change));
    /* the path is 1400 arcsec in each direction of the middle: 5e-5 of it is curvature */
    bst_assert_close(bst_vec3_dot(step, axes.e1), 0.5 * a[0] * dt * dt, 0.1 * AS);
    bst_assert_close(bst_vec3_dot(step, axes.e2), 0.5 * a[1] * dt * dt, 0.1 * AS);
    bst_assert_close(bst_vec3_dot(change, axes.e1), a[0] * dt, 0.03 * AS);
    bst_assert_close(bst_vec3_dot(change, axes.e2), a[1] * dt, 0.03 * AS);
    bst_assert_close(bst_vec3_dot(step, place[1]), 0.0, 1e-12);
    /* a jump: farther off than two rates explain */
    double most = 2.0 * bst_vec3_norm(rate[1]) * dt;
    for (int k = 0; k < 2; k++) {
        bst_mtt_frame jumped = frame;
        bst_vec3 last = bst_vec3_unit(bst_vec3_sub(place[1], step));
        bst_vec3 along = bst_vec3_unit(bst_vec3_cross(last, rate[1]));
        jumped.cue_direction =
            bst_tangent_exp(last, bst_vec3_scale(along, most * (0.95 + 0.1 * k)));
        bool near = bst_mtt_cue_acceleration(&jumped, dt, &step, &change);
        assert_int_equal(near, k == 0);
        (void)bst_mtt_cue_acceleration(&frame, dt, &step, &change);
    }
    frame.cue_before_valid = false;
    assert_false(bst_mtt_cue_acceleration(&frame, dt, &step, &change));
}

/* Tracks that share it: not at rest, near the cue, at least a tenth as fast. */
static void tracks_share_it(void **state) {
    (void)state;
    bst_mtt_params params = defaults();
    params.feed_forward_rad = 0.09;
    bench *b = start(1, &params);
    bst_vec3 cue = bst_vec3_from_radec(2.0, -1.2);
    bst_tangent axes = bst_tangent_at(cue);
    const bst_mtt_frame f = {.cue_direction = cue,
                             .cue_rate_radps = bst_tangent_vector(&axes, 60 * AS, -80 * AS)};
    static const struct {
        double off, rate_as;
        bool rest, shares;
    } rows[] = {{0.089, 11, false, true},
                {0.091, 11, false, false},
                {0.05, 9, false, false},
                {0.05, 11, true, false},
                {0.05, 500, false, true}};
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        bst_mtt_track t = {.at_rest = rows[i].rest};
        t.state.direction = place_at(cue, 0.6 * rows[i].off, -0.8 * rows[i].off);
        bst_tangent own = bst_tangent_at(t.state.direction);
        t.state.rate_radps =
            bst_tangent_vector(&own, 0.8 * rows[i].rate_as * AS, 0.6 * rows[i].rate_as * AS);
        assert_int_equal(bst_mtt_shares_acceleration(b->mtt, &t, &f), rows[i].shares);
    }
    bst_mtt_free(b->mtt);
}

/* Light of a diffuse sphere with the Sun aside, and what it makes of an SNR. */
static void light_of_an_orbit(void **state) {
    (void)state;
    const double au = 1.496e11, threshold = 5.0;
    const bst_vec3 sun = {0.8 * au, 0.6 * au, 0.0};
    const bst_vec3 eye = {0.0, 7.0e6, 2.0e6}, object = {3.0e7, 2.0e7, 1.5e7};
    bst_vec3 line = bst_vec3_sub(eye, object), light_from = bst_vec3_sub(sun, object);
    double far2 = bst_vec3_dot(line, line);
    double phase = acos(bst_vec3_dot(line, light_from) / sqrt(far2) / bst_vec3_norm(light_from));
    double law = (BST_PI - phase) * cos(phase) + sin(phase); /* of a Lambert sphere */
    bst_visibility_seen seen = {.snr = 20.0};
    bst_mtt_light light;
    assert_int_equal(bst_visibility_of(object, eye, sun, &seen, threshold, &light), BST_MTT_CLEAR);
    bst_assert_close(light.sunlight, 1.0, 0.0);
    bst_assert_close(light.snr, 20.0, 1e-12);
    assert_true(light.bright);
    double glow = light.glow;
    /* seen before from another side and distance */
    const bst_vec3 there = {1.0e7, 5.0e6, -6.0e6};
    bst_vec3 other = bst_vec3_sub(there, object);
    double other2 = bst_vec3_dot(other, other);
    double other_phase =
        acos(bst_vec3_dot(other, light_from) / sqrt(other2) / bst_vec3_norm(light_from));
    double other_law = (BST_PI - other_phase) * cos(other_phase) + sin(other_phase);
    seen.glow = glow;
    bst_visibility_of(object, there, sun, &seen, threshold, &light);
    bst_assert_close(light.glow / glow, other_law / law * far2 / other2, 1e-9);
    bst_assert_close(light.snr, 20.0 * other_law / law * far2 / other2, 1e-7);
    /* below the threshold and 3: faint unless it is certainly in the light and never was bright;
     * below 0.6 of the threshold: too dark */
    static const struct {
        double snr;
        bool was_bright;
        bst_mtt_sight sight;
    } rows[] = {{7.9, false, BST_MTT_CLEAR},
                {7.9, true, BST_MTT_FAINT},
                {8.1, true, BST_MTT_CLEAR},
                {3.1, false, BST_MTT_CLEAR},
                {2.9, false, BST_MTT_SHADOW}};
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        seen = (bst_visibility_seen){.snr = rows[i].snr, .was_bright = rows[i].was_bright};
        assert_int_equal(bst_visibility_of(object, eye, sun, &seen, threshold, &light),
                         rows[i].sight);
        assert_int_equal(light.bright, rows[i].snr > 8.0);
    }
    /* behind the Earth, near its limb, in the umbra */
    seen = (bst_visibility_seen){.snr = 50.0};
    const bst_vec3 x = {4.2e7, 0, 0};
    static const struct {
        double height; /* of the line of sight above the centre, Earth radii, in the plane of the
                          poles */
        bst_mtt_sight sight;
    } limbs[] = {{0.99, BST_MTT_EARTH}, {1.01, BST_MTT_FAINT}, {1.03, BST_MTT_CLEAR}};
    for (size_t i = 0; i < sizeof limbs / sizeof *limbs; i++) {
        double h = limbs[i].height * BST_EARTH_RADIUS_M;
        assert_int_equal(bst_visibility_of((bst_vec3){x.x, 0, h}, (bst_vec3){-1e7, 0, h},
                                           (bst_vec3){0, au, 0}, &seen, threshold, &light),
                         limbs[i].sight);
    }
    assert_int_equal(bst_visibility_of(x, (bst_vec3){1e7, 2e7, 0}, (bst_vec3){-au, 0, 0}, &seen,
                                       threshold, &light),
                     BST_MTT_DARK);
    bst_assert_close(light.sunlight, 0.0, 0.0);
}

/* Running means of the SNR and of the light in full sunlight; none of a picked detection. */
static void mean_of_the_light(void **state) {
    (void)state;
    bst_mtt_track t = {.snr = 10.0, .v_mag = 12.0, .light = {.sunlight = 1.0, .glow = 4.0}};
    bst_mtt_note_light(&t);
    bst_assert_close(t.full_snr, 10.0, 1e-15);
    bst_assert_close(t.full_glow, 4.0, 1e-15);
    t.snr = 14.0;
    t.light.glow = 5.0;
    t.v_mag = 12.5;
    bst_mtt_note_light(&t);
    bst_assert_close(t.full_snr, 10.4, 1e-14);
    bst_assert_close(t.full_glow, 4.1, 1e-14);
    bst_assert_close(t.full_v_mag, 12.5, 0.0);
    t.orbit.valid = true;
    t.light.sunlight = 0.98; /* not in full light */
    bst_mtt_note_light(&t);
    bst_assert_close(t.full_snr, 10.4, 1e-14);
    t.light.sunlight = 1.0;
    t.light.snr = 12.0;
    t.sight = BST_MTT_FAINT;
    t.snr = 14.9; /* less than 3 above its prediction: it may have been found by its noise */
    bst_mtt_note_light(&t);
    bst_assert_close(t.full_snr, 10.4, 1e-14);
    t.snr = 15.1;
    bst_mtt_note_light(&t);
    bst_assert_close(t.full_snr, 10.4 + 0.1 * (15.1 - 10.4), 1e-14);
}

static bst_mtt_track kept(int64_t id, bst_vec3 at, double s1, double s2) {
    bst_mtt_track t = {.id = id, .status = BST_TRACK_CONFIRMED, .hits = 10 + (int)id, .apart = 3};
    t.state.direction = at;
    const double sigma[4] = {s1, s2, 1 * AS, 1 * AS};
    for (int i = 0; i < 4; i++) {
        t.state.covariance[i][i] = sigma[i] * sigma[i];
    }
    return t;
}

/* The earlier track with the smaller misfit in its own ellipse, if it leads by enough. */
static void earlier_tracks(void **state) {
    (void)state;
    bst_mtt_params params = defaults();
    bst_vec3 at = bst_vec3_from_radec(0.5, 0.3);
    for (int way = 0; way < 3; way++) {
        bench *b = start(1, &params);
        bst_mtt *m = b->mtt;
        /* 30 arcsec along the long axis of one, 9.8 along the short axis of the other: misfits of
         * (30/40)^2 and (9.8/4)^2 of it; or along the wrong axes; or two that are alike */
        double dx = way == 1 ? 0 : -30 * AS, dy = way == 1 ? -30 * AS : 0;
        bst_mtt_track a = kept(1, place_at(at, dx, dy), 40 * AS, 4 * AS),
                      c = kept(2, place_at(at, way == 2 ? 31 * AS : 9.8 * AS, 0),
                               (way == 2 ? 40 : 4) * AS, (way == 2 ? 4 : 40) * AS);
        bst_mtt_remember(m, &a);
        bst_mtt_remember(m, &c);
        bst_mtt_track new = kept(9, at, 0.3 * AS, 0.3 * AS);
        new.hits = 4;
        new.first_tick = 100;
        bool found = bst_mtt_resume(m, &new, true);
        double misfit_a = way == 1 ? 900 / 16.09 : 900 / 1600.09;
        double misfit_c = way == 2 ? 961 / 1600.09 : 96.04 / 16.09;
        bool leads = 0.5 * fabs(misfit_a - misfit_c) >= 2.0;
        assert_int_equal(found, leads && fmin(misfit_a, misfit_c) <= params.dormant_gate_chi2);
        if (found) {
            int64_t id = misfit_a < misfit_c ? 1 : 2;
            assert_int_equal(new.id, id);
            assert_int_equal(new.hits, 4 + 10 + id);
            assert_int_equal(new.apart, 6);
            assert_int_equal(new.first_tick, 0);
            assert_int_equal(m->memory_count, 1);
            assert_int_equal(m->memory[0].id, 3 - id);
        } else {
            assert_int_equal(new.id, 9);
            assert_int_equal(m->memory_count, 2);
        }
        bst_mtt_free(m);
    }
    /* one that sleeps, dimmed to a tenth: it should be 2.5 mag fainter */
    for (int k = 0; k < 4; k++) {
        bench *b = start(1, &params);
        bst_mtt *m = b->mtt;
        m->track_count = 1;
        m->tracks[0] = kept(5, place_at(at, 2 * AS, 1 * AS), 4 * AS, 4 * AS);
        m->tracks[0].asleep = true;
        m->tracks[0].full_snr = 30.0;
        m->tracks[0].full_v_mag = 11.0;
        m->tracks[0].light.snr = 3.0;
        m->tracks[0].v_mag_variance = 0.04;
        m->tracks[0].last_update_tick = 50;
        bst_mtt_track new = kept(9, at, 0.3 * AS, 0.3 * AS);
        new.first_tick = 100;
        new.v_mag_variance = 0.09;
        /* variance 0.04 + 0.09 + 0.25; the gate less 5/16.09 of the place */
        double most = sqrt(0.38 * (params.dormant_gate_chi2 - 5.0 / 16.09));
        new.v_mag = 13.5 + most *(k < 2 ? 1.0 : -1.0) * (k % 2 ? 1.01 : 0.99);
        assert_int_equal(bst_mtt_resume(m, &new, false), k % 2 == 0);
        assert_int_equal(m->tracks[0].replaced, k % 2 == 0);
        bst_mtt_free(m);
    }
}

/* Stored tracks move on with the time since the latest frame, until they are too old or either axis
 * is too uncertain. */
static void stored_tracks_move(void **state) {
    (void)state;
    bst_mtt_params params = defaults();
    params.max_dormant_sigma_rad = 50 * AS;
    params.max_dormant_s = 600.0;
    bench *b = start(1, &params);
    bst_mtt *m = b->mtt;
    m->seconds = 1000.0;
    bst_vec3 at = bst_vec3_from_radec(0.5, 0.3);
    bst_tangent axes = bst_tangent_at(at);
    static const struct {
        double s1, s2, updated_s;
    } rows[] = {{20, 20, 990}, {51, 20, 990}, {20, 51, 990}, {20, 20, 411}, {20, 20, 409}};
    for (int i = 0; i < 5; i++) {
        bst_mtt_track t = kept(i, at, rows[i].s1 * AS, rows[i].s2 * AS);
        t.state.rate_radps = bst_tangent_vector(&axes, 3 * AS, -7 * AS);
        t.last_update_s = rows[i].updated_s;
        bst_mtt_remember(m, &t);
    }
    const bst_mtt_frame frame = {.seconds = 1010.0};
    bst_mtt_predict_memory(m, &frame);
    assert_int_equal(m->memory_count, 2);
    assert_int_equal(m->memory[0].id, 0);
    assert_int_equal(m->memory[1].id, 3);
    const bst_sky_state *s = &m->memory[0].state;
    bst_assert_close(bst_vec3_dot(s->direction, axes.e1), 30 * AS, 1e-3 * AS);
    bst_assert_close(bst_vec3_dot(s->direction, axes.e2), -70 * AS, 1e-3 * AS);
    /* 20^2 + (1 arcsec/s * 10 s)^2, and (0.02 arcsec)^2/s^3 of noise for 10 s */
    for (int i = 0; i < 2; i++) {
        bst_assert_close(s->covariance[i][i] / (AS * AS), 500 + 0.0004 * 1000 / 3, 0.01);
    }
    bst_mtt_free(m);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(cues_accelerate),   cmocka_unit_test(tracks_share_it),
        cmocka_unit_test(light_of_an_orbit), cmocka_unit_test(mean_of_the_light),
        cmocka_unit_test(earlier_tracks),    cmocka_unit_test(stored_tracks_move),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
