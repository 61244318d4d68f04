/* Parts of a tracker's frame against numbers that are worked out here: the acceleration of a cue
 * far from the equator, the light of an object whose orbit is known, which earlier track a new one
 * continues, and the models of an IMM in a plane. */
#include "tests/tracker/sky_bench.h"
#include "tracker/mtt/filter.h"
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

/* A Gaussian in a plane: arcsec and arcsec/s. */
typedef struct flat {
    double weight, x[4], p[4][4];
} flat;

static const bst_vec3 flat_at = {0.6, -0.79, 0.1};

static bst_sky_state of_flat(const flat *f) {
    bst_vec3 at = bst_vec3_unit(flat_at);
    bst_sky_state s = {.direction = place_at(at, f->x[0] * AS, f->x[1] * AS)};
    bst_tangent axes = bst_tangent_at(s.direction);
    s.rate_radps = bst_tangent_vector(&axes, f->x[2] * AS, f->x[3] * AS);
    for (int i = 0; i < 16; i++) {
        s.covariance[i / 4][i % 4] = f->p[i / 4][i % 4] * AS * AS;
    }
    return s;
}

static void expect_flat(const bst_sky_state *s, const flat *f) {
    bst_vec3 at = bst_vec3_unit(flat_at), to = bst_tangent_log(at, s->direction);
    bst_tangent axes = bst_tangent_at(at), own = bst_tangent_at(s->direction);
    /* over a minute of arc the sky is a plane to 1e-4 */
    bst_assert_close(bst_vec3_dot(to, axes.e1) / AS, f->x[0], 2e-3);
    bst_assert_close(bst_vec3_dot(to, axes.e2) / AS, f->x[1], 2e-3);
    bst_assert_close(bst_vec3_dot(s->rate_radps, own.e1) / AS, f->x[2], 1e-3);
    bst_assert_close(bst_vec3_dot(s->rate_radps, own.e2) / AS, f->x[3], 1e-3);
    for (int i = 0; i < 16; i++) {
        double most = 1e-3 * sqrt(f->p[i / 4][i / 4] * f->p[i % 4][i % 4]);
        bst_assert_close(s->covariance[i / 4][i % 4] / (AS * AS), f->p[i / 4][i % 4], most);
    }
}

/* One Gaussian of the mean and the covariance of several. */
static flat mixture(const flat *items, int count) {
    flat out = {0};
    for (int n = 0; n < count; n++) {
        out.weight += items[n].weight;
    }
    for (int n = 0; n < count; n++) {
        for (int i = 0; i < 4; i++) {
            out.x[i] += items[n].weight / out.weight * items[n].x[i];
        }
    }
    for (int n = 0; n < count; n++) {
        for (int i = 0; i < 16; i++) {
            int a = i / 4, b = i % 4;
            double d = (items[n].x[a] - out.x[a]) * (items[n].x[b] - out.x[b]);
            out.p[a][b] += items[n].weight / out.weight * (items[n].p[a][b] + d);
        }
    }
    return out;
}

/* Kalman update with a place z of covariance r (11, 12, 22); the density of z is returned. */
static double update(flat *f, const double z[2], const double r[3]) {
    double s[3] = {f->p[0][0] + r[0], f->p[0][1] + r[1], f->p[1][1] + r[2]};
    double det = s[0] * s[2] - s[1] * s[1], y[2] = {z[0] - f->x[0], z[1] - f->x[1]};
    const double inverse[2][2] = {{s[2] / det, -s[1] / det}, {-s[1] / det, s[0] / det}};
    double k[4][2], chi2 = 0.0, before[4][4];
    memcpy(before, f->p, sizeof before);
    for (int i = 0; i < 4; i++) {
        for (int a = 0; a < 2; a++) {
            k[i][a] = before[i][0] * inverse[0][a] + before[i][1] * inverse[1][a];
        }
        f->x[i] += k[i][0] * y[0] + k[i][1] * y[1];
    }
    for (int i = 0; i < 16; i++) {
        f->p[i / 4][i % 4] -= k[i / 4][0] * before[0][i % 4] + k[i / 4][1] * before[1][i % 4];
    }
    for (int i = 0; i < 4; i++) {
        chi2 += y[i / 2] * inverse[i / 2][i % 2] * y[i % 2];
    }
    return exp(-0.5 * chi2) / (2.0 * BST_PI * sqrt(det));
}

static void start_models(flat own[2], bst_filter_models *models, bst_sky_state *s) {
    const flat both[2] = {{0.7,
                           {3.0, -4.0, 0.5, -0.3},
                           {{90, 20, 6, -3}, {20, 60, -2, 5}, {6, -2, 2, 0.4}, {-3, 5, 0.4, 3}}},
                          {0.3,
                           {-6.0, 9.0, -0.2, 0.9},
                           {{150, -60, 9, 4}, {-60, 210, 3, -8}, {9, 3, 5, -1}, {4, -8, -1, 6}}}};
    *models = (bst_filter_models){.count = 2};
    for (int m = 0; m < 2; m++) {
        own[m] = both[m];
        models->state[m] = of_flat(&both[m]);
        models->probability[m] = both[m].weight;
    }
    const flat whole = mixture(both, 2);
    *s = of_flat(&whole);
}

/* Each model by its own likelihood of all detections and of none, the state as their mixture. */
static void models_follow_their_likelihoods(void **state) {
    (void)state;
    const bst_filter_params params = {.kind = BST_FILTER_IMM};
    bst_filter_models models;
    bst_sky_state s;
    flat own[2];
    start_models(own, &models, &s);
    const double z[2][2] = {{12.0, -9.0}, {-14.0, 16.0}}, r[2][3] = {{40, 15, 25}, {30, -12, 50}};
    bst_sky_measurement measured[2];
    for (int c = 0; c < 2; c++) {
        const double as2 = AS * AS;
        measured[c] =
            (bst_sky_measurement){place_at(bst_vec3_unit(flat_at), z[c][0] * AS, z[c][1] * AS),
                                  r[c][0] * as2, r[c][1] * as2, r[c][2] * as2};
    }
    const bst_filter_candidate candidates[2] = {{.measurement = &measured[0], .log_weight = -0.4},
                                                {.measurement = &measured[1], .log_weight = 0.3}};
    double density = 0.0, chi2 = INFINITY;
    flat updated[2];
    for (int m = 0; m < 2; m++) {
        flat branch[3] = {own[m], own[m], own[m]};
        branch[0].weight = 0.2; /* no detection */
        for (int c = 0; c < 2; c++) {
            double one = update(&branch[c + 1], z[c], r[c]);
            branch[c + 1].weight = exp(candidates[c].log_weight) * 700.0 * one;
            if (c == 0) { /* the first of them alone, below */
                density += own[m].weight * one;
                bst_sky_innovation i;
                assert_true(bst_sky_innovate(&models.state[m], &measured[0], NULL, &i));
                chi2 = fmin(chi2, i.chi2);
            }
        }
        updated[m] = mixture(branch, 3);
        updated[m].weight *= own[m].weight;
    }
    bst_filter_fit fit;
    assert_true(bst_filter_evaluate(&params, &s, &models, &candidates[0], &fit));
    bst_assert_close(fit.log_likelihood, log(density / (AS * AS)), 1e-3);
    bst_assert_close(fit.chi2, chi2, 0.0);
    const bst_filter_evidence evidence = {
        .candidates = candidates, .count = 2, .miss_weight = 0.2, .hit_weight = 700.0 * AS * AS};
    bst_filter_update(&params, &s, &models, &evidence, 1);
    double sum = updated[0].weight + updated[1].weight;
    for (int m = 0; m < 2; m++) {
        bst_assert_close(models.probability[m], updated[m].weight / sum, 1e-3);
        expect_flat(&models.state[m], &updated[m]);
    }
    const flat whole = mixture(updated, 2);
    expect_flat(&s, &whole);
}

/* Uniform motion with white noise of the acceleration, arcsec^2/s^3. */
static flat flat_later(const flat *at, double dt, double noise) {
    flat out = *at;
    for (int i = 0; i < 2; i++) {
        out.x[i] += dt * at->x[i + 2];
        for (int k = 0; k < 2; k++) {
            const double q = i == k ? noise : 0.0;
            out.p[i][k] = at->p[i][k] + dt * (at->p[i + 2][k] + at->p[i][k + 2]) +
                          dt * dt * at->p[i + 2][k + 2] + q * dt * dt * dt / 3.0;
            out.p[i][k + 2] = at->p[i][k + 2] + dt * at->p[i + 2][k + 2] + q * dt * dt / 2.0;
            out.p[k + 2][i] = out.p[i][k + 2];
            out.p[i + 2][k + 2] = at->p[i + 2][k + 2] + q * dt;
        }
    }
    return out;
}

/* Both kinds of prediction of one Gaussian. */
static void one_model_moves(void **state) {
    (void)state;
    flat own[2];
    bst_filter_models models, none = {0};
    bst_sky_state s;
    start_models(own, &models, &s);
    for (int unscented = 0; unscented < 2; unscented++) {
        for (int m = 0; m < 2; m++) {
            const bst_filter_params params = {.kind = unscented ? BST_FILTER_UKF : BST_FILTER_EKF,
                                              .noise_rad2ps3 = 0.4 * AS * AS};
            bst_sky_state one = of_flat(&own[m]);
            bst_filter_predict(&params, 5.0, &one, &none);
            const flat moved = flat_later(&own[m], 5.0, 0.4);
            expect_flat(&one, &moved);
        }
    }
}

/* A chain of two states in continuous time mixes the models, each then moves with its own noise. */
static void models_are_mixed_and_move(void **state) {
    (void)state;
    const double dt = 4.0, out_per_s = 1.0 / 30.0, back_per_s = 1.0 / 9.0;
    const double noise[2] = {0.02, 0.3}; /* arcsec^2/s^3 */
    const bst_filter_params params = {.kind = BST_FILTER_IMM,
                                      .noise_rad2ps3 = noise[0] * AS * AS,
                                      .manoeuvre_noise_rad2ps3 = noise[1] * AS * AS,
                                      .quiescent_sojourn_s = 30.0,
                                      .manoeuvre_sojourn_s = 9.0};
    bst_filter_models models;
    bst_sky_state s;
    flat own[2], moved[2];
    start_models(own, &models, &s);
    bst_filter_predict(&params, dt, &s, &models);
    /* the chain in small steps: from each state to each state */
    double stay[2][2] = {{1.0, 0.0}, {0.0, 1.0}};
    for (int n = 0; n < 100000; n++) {
        for (int from = 0; from < 2; from++) {
            double flow = (stay[from][0] * out_per_s - stay[from][1] * back_per_s) * dt / 100000;
            stay[from][0] -= flow;
            stay[from][1] += flow;
        }
    }
    for (int m = 0; m < 2; m++) {
        flat part[2] = {own[0], own[1]};
        part[0].weight *= stay[0][m];
        part[1].weight *= stay[1][m];
        const flat at = mixture(part, 2);
        moved[m] = flat_later(&at, dt, noise[m]);
        bst_assert_close(models.probability[m], moved[m].weight, 1e-5);
        expect_flat(&models.state[m], &moved[m]);
    }
    const flat whole = mixture(moved, 2);
    expect_flat(&s, &whole);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(models_follow_their_likelihoods),
        cmocka_unit_test(models_are_mixed_and_move),
        cmocka_unit_test(one_model_moves),
        cmocka_unit_test(cues_accelerate),
        cmocka_unit_test(tracks_share_it),
        cmocka_unit_test(light_of_an_orbit),
        cmocka_unit_test(mean_of_the_light),
        cmocka_unit_test(earlier_tracks),
        cmocka_unit_test(stored_tracks_move),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
