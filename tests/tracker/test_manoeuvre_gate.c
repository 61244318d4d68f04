/* The second, wider gate: which detection a missed track takes, from both sides of each limit. The
 * track moves by itself with 0.5 arcsec, a manoeuvre within the last second adds 1.73 arcsec. */
#include "tests/tracker/sky_bench.h"
#include "tracker/mtt/multitarget_internal.h"

/* A track and a detection on a slanting line, each arcsec from the first track. */
typedef struct layout {
    double neighbour_as, detection_as;
    int neighbour; /* its status; negative: none */
    int owner;     /* of the detection; negative: none */
    bool merged, missed, quiet;
} layout;

static bst_vec3 on_line(double as) {
    const bst_vec3 middle = bst_vec3_from_radec(-2.1, 0.9);
    bst_tangent axes = bst_tangent_at(middle);
    return bst_tangent_exp(middle, bst_tangent_vector(&axes, -0.6 * as * AS, 0.8 * as * AS));
}

static void put_track(bst_mtt *m, double as, int status) {
    bst_mtt_track *t = &m->tracks[m->track_count];
    *t = (bst_mtt_track){.id = 10 + m->track_count,
                         .status = status,
                         .v_mag = 12.0,
                         .v_mag_variance = 0.01,
                         .may_miss = true,
                         .last_update_s = m->now.seconds - 1.0};
    bst_mtt_start_snr(t);
    t->state.direction = on_line(as);
    for (int i = 0; i < 4; i++) {
        t->state.covariance[i][i] = (i < 2 ? 0.25 : 1e-4) * AS * AS;
    }
    m->detection_of_track[m->track_count] = -1;
    m->observable[m->track_count] = true;
    m->shared[m->track_count++] = BST_MTT_ALONE;
}

/* Runs the gate on a layout; the mtt, to be freed. */
static bst_mtt *gate(const layout *l) {
    bst_ctx ctx = {0};
    bst_mtt *m;
    bst_mtt_params params = defaults(); /* merge_rad 18 arcsec, gate at 4 sigma */
    params.max_tracks = params.max_detections = 10;
    params.false_events_per_hour = 0.1;
    params.manoeuvre_noise_rad2ps3 = l->quiet ? params.noise_rad2ps3 : pow(3.0 * AS, 2);
    bst_assert_ok(&ctx, bst_mtt_create(&ctx, &params, &m));
    m->now.seconds = m->seconds = 100.0;
    m->history_count = 1;
    m->history[0].seconds = 99.0;
    m->clutter_density = 1.0 / params.field_sr;
    m->now.count = 1;
    m->largest_sigma = 0.3 * AS;
    put_track(m, 0.0, BST_TRACK_CONFIRMED);
    if (l->neighbour >= 0) {
        put_track(m, l->neighbour_as, l->neighbour);
    }
    m->tracks[0].merged_in_row = l->merged;
    m->now.items[0] = (bst_mtt_detection){.sky = {.direction = on_line(l->detection_as),
                                                  .cov_11 = 0.09 * AS * AS,
                                                  .cov_22 = 0.09 * AS * AS},
                                          .v_mag = 12.0,
                                          .v_mag_sigma = 0.1};
    m->now.used[0] = l->owner >= 0;
    m->owner[0] = l->owner >= 0 ? l->owner : BST_MTT_NOBODY;
    m->tracks[0].may_miss = !l->missed;
    bst_mtt_pool_index(&m->now);
    bst_mtt_gate_manoeuvres(m);
    return m;
}

/* What a track without a detection takes: 0.34 arcsec^2 if it is quiet, 3.34 after a
 * manoeuvre, which has the probability 1 / 3600. Beyond 2.33 arcsec the detection is outside of the
 * gate, beyond 2.8 a manoeuvre is likelier, and beyond 6.83 a miss and a false alarm, of which
 * there is one in (3000 arcsec)^2. */
static void limits_of_the_place(void **state) {
    (void)state;
    static const double as[] = {2.2, 2.45, 2.65, 3.0, 5.0, 6.75, 6.9};
    static const int wanted[] = {0, 1, 1, 2, 2, 2, 0}; /* 1: as the quiet track, 2: a manoeuvre */
    for (int n = 0; n < 7; n++) {
        bst_mtt *m = gate(&(layout){.detection_as = as[n], .neighbour = -1, .owner = -1});
        assert_int_equal(m->detection_of_track[0], wanted[n] ? 0 : -1);
        assert_int_equal(m->owner[0], wanted[n] ? 0 : BST_MTT_NOBODY);
        assert_int_equal(m->now.used[0], wanted[n] > 0);
        bst_assert_close(m->tracks[0].state.covariance[1][1] / (AS * AS),
                         wanted[n] == 2 ? 3.25 : 0.25, 1e-3); /* and (0.02 arcsec)^2 less */
        bst_assert_close(m->tracks[0].manoeuvre_end_s, wanted[n] == 2 ? 160.0 : 0.0, 1e-9);
        bst_mtt_free(m);
    }
}

/* Outside of the gate, but likelier of the quiet track: only if no other track may have it, none
 * within three times the distance of merging. A manoeuvre takes it beside a neighbour too. */
static void neighbours_may_have_it(void **state) {
    (void)state;
    static const struct {
        layout l;
        bool taken;
    } cases[] = {{{54.3, 2.6, BST_TRACK_CONFIRMED, -1, false, false, false}, true},
                 {{53.7, 2.6, BST_TRACK_CONFIRMED, -1, false, false, false}, false},
                 {{-53.7, 2.6, BST_TRACK_CONFIRMED, -1, false, false, false}, false},
                 {{53.7, 2.6, BST_TRACK_TENTATIVE, -1, false, false, false}, true},
                 {{53.7, 4.0, BST_TRACK_CONFIRMED, -1, false, false, false}, true},
                 {{0.0, 2.6, -1, -1, true, false, false}, false},
                 {{0.0, 4.0, -1, -1, true, false, false}, true},
                 {{54.3, 4.0, BST_TRACK_CONFIRMED, 1, false, false, false}, false},
                 {{0.0, 4.0, -1, -1, false, true, false}, false},
                 {{0.0, 4.0, -1, -1, false, false, true}, false}};
    for (size_t n = 0; n < sizeof cases / sizeof *cases; n++) {
        bst_mtt *m = gate(&cases[n].l);
        if (m->detection_of_track[0] != (cases[n].taken ? 0 : -1)) {
            fail_msg("case %zu: detection %d", n, m->detection_of_track[0]);
        }
        bst_mtt_free(m);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(limits_of_the_place),
                                       cmocka_unit_test(neighbours_may_have_it)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
