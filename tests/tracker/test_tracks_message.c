/* What the tracker's messages hold of its tracks: tracks of a script, each field with a number of
 * its own, in the order of the message. The linker puts these functions in the place of the
 * multi-target tracker's. */
#include "tests/test_support.h"
#include "tracker/tracker_internal.h"

enum { TRACKS = 8, ROOM = 6, TARGET = 14 };

static bst_mtt_track script[TRACKS];

const bst_mtt_track *__wrap_bst_mtt_tracks(const bst_mtt *mtt, int *count);
const bst_mtt_track *__wrap_bst_mtt_tracks(const bst_mtt *mtt, int *count) {
    (void)mtt;
    *count = TRACKS;
    return script;
}

const bst_mtt_track *__wrap_bst_mtt_find(const bst_mtt *mtt, int64_t id);
const bst_mtt_track *__wrap_bst_mtt_find(const bst_mtt *mtt, int64_t id) {
    (void)mtt;
    for (int i = 0; i < TRACKS; i++) {
        if (script[i].id == id) {
            return &script[i];
        }
    }
    return NULL;
}

void __wrap_bst_mtt_skip(bst_mtt *mtt, const bst_mtt_frame *frame);
void __wrap_bst_mtt_skip(bst_mtt *mtt, const bst_mtt_frame *frame) {
    (void)mtt;
    (void)frame;
}

static bool no_star(void *user, uint32_t id, bst_vec3 *icrs) {
    (void)user;
    (void)id;
    (void)icrs;
    return false;
}

/* Why each track is not seen, and in which place of the message it is; -1: none. The last confirmed
 * track has no room, and the tentative one follows all of them. */
static const struct {
    bst_track_status status;
    bool asleep, at_rest;
    bst_mtt_sight sight;
    double sunlight;
    int hidden, place;
} rows[TRACKS] = {
    {BST_TRACK_TENTATIVE, false, false, BST_MTT_CLEAR, 1.0, BST_HIDDEN_NOT, -1},
    {BST_TRACK_COASTING, true, false, BST_MTT_FAINT, 0.9, BST_HIDDEN_SHADOW, 1},
    {BST_TRACK_COASTING, true, false, BST_MTT_FAINT, 1.0, BST_HIDDEN_DIM, 2},
    {BST_TRACK_CONFIRMED, false, true, BST_MTT_CLEAR, 1.0, BST_HIDDEN_NOT, -1},
    {BST_TRACK_COASTING, true, false, BST_MTT_EARTH, 0.5, BST_HIDDEN_EARTH, 0},
    {BST_TRACK_COASTING, true, false, BST_MTT_CLEAR, 1.0, BST_HIDDEN_AWAITED, 3},
    {BST_TRACK_CONFIRMED, false, false, BST_MTT_EARTH, 0.5, BST_HIDDEN_NOT, 4},
    {BST_TRACK_COASTING, true, false, BST_MTT_DARK, 0.0, BST_HIDDEN_SHADOW, 5},
};

static void fill_script(void) {
    for (int i = 0; i < TRACKS; i++) {
        bst_mtt_track *t = &script[i];
        *t = (bst_mtt_track){.id = 10 + i,
                             .status = rows[i].status,
                             .asleep = rows[i].asleep,
                             .at_rest = rows[i].at_rest,
                             .sight = rows[i].sight,
                             .light = {.sunlight = rows[i].sunlight},
                             .v_mag = 11.0 + i,
                             .snr = 21.0 + i,
                             .score = 31.0 + i,
                             .hits = 41 + i,
                             .misses_in_row = 51 + i,
                             .first_tick = 61 + i,
                             .last_update_tick = 71 + i,
                             .x_px = 81.0 + i,
                             .y_px = 91.0 + i};
        t->state.direction = bst_vec3_from_radec(0.1 * i, 0.2);
        t->state.rate_radps = (bst_vec3){1e-6 * i, 2e-6, -3e-6};
        for (int a = 0; a < 4; a++) {
            for (int b = 0; b < 4; b++) {
                t->state.covariance[a][b] = 1e-9 * (1 + i) * (a == b ? 4 + a : 0.1 * (a + b));
            }
        }
    }
    script[5].state.covariance[1][1] = 1e-12; /* wider along the other axis */
}

static bool same(bst_vec3 a, bst_vec3 b) {
    return bst_vec3_norm(bst_vec3_sub(a, b)) == 0.0;
}

static void messages_hold_the_tracks(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_tracker_config c;
    bst_tracker *t;
    const bst_camera camera = {
        .width_px = 900, .height_px = 500, .pixel_scale_arcsec = 4.0, .psf_fwhm_px = 2.0};
    bst_assert_ok(&ctx, bst_config_defaults(&ctx, bst_tracker_config_table, &c));
    bst_assert_ok(&ctx, bst_tracker_create(&ctx, &c, &camera, 1000, no_star, NULL, &t));
    fill_script();
    t->target.id = TARGET;
    const bst_detections detections = {.exposure_id = 9, .start_tick = 5000, .end_tick = 5100};
    const bst_nav_telemetry nav = {.position_gcrf_m = {7e6, 0, 0}};
    const bst_quat q = bst_quat_from_rotvec((bst_vec3){0.1, 0.2, 0.3});
    const bst_tracker_input input = {
        .detections = &detections, .nav = &nav, .q_telemetry_now = &q, .q_telemetry_mid = &q};
    bst_tracks *out = calloc(1, sizeof *out + ROOM * sizeof *out->items);
    bst_predictions *next = calloc(1, sizeof *next + ROOM * sizeof *next->items);
    assert_true(out && next);
    assert_int_equal(bst_tracker_step(t, &input, out, ROOM, next, ROOM), BST_TRACKER_NO_ATTITUDE);
    assert_int_equal(out->exposure_id, 9);
    assert_int_equal(out->tick, 5050);
    assert_int_equal(out->target_id, TARGET);
    assert_int_equal(out->at_rest, 1);
    assert_int_equal(out->count, ROOM);
    assert_int_equal(out->lost, 1); /* the tentative one */
    assert_int_equal(next->count, ROOM);
    assert_int_equal(next->lost, 0);
    for (int i = 0; i < TRACKS; i++) {
        if (rows[i].place < 0) {
            continue;
        }
        const bst_track *o = &out->items[rows[i].place];
        const bst_prediction *p = &next->items[rows[i].place];
        assert_int_equal(o->id, 10 + i);
        assert_int_equal(o->status, rows[i].status);
        assert_int_equal(o->target_of_interest, 10 + i == TARGET);
        assert_int_equal(o->hidden, rows[i].hidden);
        assert_int_equal(o->uncorrelated, 10 + i != TARGET);
        assert_true(same(o->direction_gcrf, script[i].state.direction));
        assert_true(same(o->rate_gcrf_radps, script[i].state.rate_radps));
        assert_memory_equal(o->covariance, script[i].state.covariance, sizeof o->covariance);
        assert_true(o->v_mag == 11.0 + i && o->snr == 21.0 + i && o->score == 31.0 + i);
        assert_true(o->hits == 41 + i && o->misses_in_row == 51 + i);
        assert_true(o->first_tick == 61 + i && o->last_update_tick == 71 + i);
        assert_true(o->x_px == 81.0 + i && o->y_px == 91.0 + i);
        assert_int_equal(p->track_id, 10 + i);
        assert_int_equal(p->target_of_interest, 10 + i == TARGET);
        assert_true(same(p->direction_gcrf, script[i].state.direction));
        assert_true(same(p->rate_gcrf_radps, script[i].state.rate_radps));
        /* the wider axis: variances 4 and 5 of each, but of one */
        bst_assert_close(p->sigma_rad, sqrt(1e-9 * (1 + i) * (i == 5 ? 4.0 : 5.0)), 1e-15);
    }
    free(out);
    free(next);
    bst_tracker_free(t);
    bst_config_free(bst_tracker_config_table, &c);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(messages_hold_the_tracks)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
