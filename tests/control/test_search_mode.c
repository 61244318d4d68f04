/* Searches and aims by hand-made cues: the field that a region's tiles have, the frames that count,
 * the track that is taken, and where the boresight is sent. */
#include "boresight/rng.h"
#include "boresight/vec.h"
#include "control/control_internal.h"
#include "tests/test_support.h"

#define TICKS 1000.0
#define PX (3.0 * BST_ARCSEC_RAD)
#define SPIN 2e-4 /* rad/s of the region */

static bst_search_area planned;
static bst_vec3 expected_rate;
static double asked_along_rad;

void __real_bst_search_plan(bst_search *search, bst_search_pattern pattern,
                            const bst_search_area *area);
void __wrap_bst_search_plan(bst_search *search, bst_search_pattern pattern,
                            const bst_search_area *area);
void __wrap_bst_search_plan(bst_search *search, bst_search_pattern pattern,
                            const bst_search_area *area) {
    planned = *area;
    __real_bst_search_plan(search, pattern, area);
}

bst_status __wrap_bst_control_expected_rate(bst_ctx *ctx, const bst_control *c, int64_t tick,
                                            bst_vec3 direction, bool *known, bst_vec3 *rate_radps);
bst_status __wrap_bst_control_expected_rate(bst_ctx *ctx, const bst_control *c, int64_t tick,
                                            bst_vec3 direction, bool *known, bst_vec3 *rate_radps) {
    (void)ctx;
    (void)c;
    (void)tick;
    (void)direction;
    *known = true;
    *rate_radps = expected_rate;
    return BST_OK;
}

/* Longitude and latitude on a sphere that turns: 1.2 and 0.9 rad on the sky for one of the region.
 */
static bst_status region_at(void *user, bst_ctx *ctx, double seconds, double along, double across,
                            bst_vec3 *direction) {
    (void)user;
    (void)ctx;
    double a = 1.2 * along + SPIN * seconds, b = 0.9 * across;
    asked_along_rad = along;
    *direction = (bst_vec3){cos(b) * cos(a), cos(b) * sin(a), sin(b)};
    return BST_OK;
}

static bst_status cue_at(void *user, bst_ctx *ctx, double seconds, bst_onboard_cue *out) {
    (void)ctx;
    double rate = 3e-4, a = rate * seconds;
    *out = *(const bst_onboard_cue *)user;
    out->valid = true;
    out->direction_gcrf = (bst_vec3){cos(a), 0.0, sin(a)};
    out->rate_gcrf_radps = (bst_vec3){-rate * sin(a), 0.0, rate * cos(a)};
    return BST_OK;
}

static bst_status cue_direction_at(void *user, bst_ctx *ctx, double seconds, bool *valid,
                                   bst_vec3 *direction) {
    bst_onboard_cue cue;
    BST_TRY(cue_at(user, ctx, seconds, &cue));
    *valid = cue.valid;
    *direction = cue.direction_gcrf;
    return BST_OK;
}

static bst_control *make(bst_onboard_cue *cue, bool in_region) {
    static bst_control c;
    bst_ctx ctx = {0};
    bst_control_config config;
    bst_assert_ok(&ctx, bst_config_defaults(&ctx, bst_control_config_table, &config));
    memset(&c, 0, sizeof c);
    c.config = config;
    c.config.dwell_frames = 3;
    c.config.period_s = 2.0;
    c.config.exposure_s = 0.5;
    c.config.search_step = 0.8;
    c.env = (bst_control_env){.tick_rate_hz = TICKS,
                              .pixel_rad = PX,
                              .width_px = 1200,
                              .height_px = 800,
                              .cue_at = cue_at,
                              .cue_direction_at = cue_direction_at,
                              .region_at = region_at,
                              .cue_user = cue};
    if (in_region) {
        c.env.region = (bst_region){BST_REGION_GEOSTATIONARY, 0.2, 0.03};
    }
    c.pointing_valid = true;
    return &c;
}

/* The largest field of the camera's proportion in a field that is turned by the angle: the corners
 * of the one touch the sides of the other. */
static void expect_field(double width, double height, double angle) {
    double c = fabs(cos(angle)), s = fabs(sin(angle));
    double k = fmin(width / (width * c + height * s), height / (width * s + height * c));
    bst_assert_close(planned.field_x_rad * 1.2, k * width, 2e-3 * k * width);
    bst_assert_close(planned.field_y_rad * 0.9, k * height, 2e-3 * k * height);
    bst_assert_close(planned.half_x_rad, 0.2, 0.0);
    bst_assert_close(planned.half_y_rad, 0.03, 0.0);
}

static void tiles_of_a_region(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_onboard_cue cue = {.sigma_rad = 0.01};
    const double angles[] = {0.0, 0.35, -0.6};
    double width = 2 * atan(600 * PX), height = 2 * atan(400 * PX);
    for (int i = 0; i < 3; i++) {
        bst_control *c = make(&cue, true);
        int64_t tick = 5000 * i;
        double turn = SPIN * 5.0 * i;
        /* the camera looks at the region's middle, its x axis at the angle to the region's length;
         * half of that angle is the image's own rotation */
        bst_vec3 d = {cos(turn), sin(turn), 0.0}, along = {-sin(turn), cos(turn), 0.0};
        c->env.rotation_rad = 0.5 * angles[i];
        bst_vec3 up = {0, 0, 1};
        double own = 0.5 * angles[i];
        bst_vec3 x = bst_vec3_axpy(bst_vec3_scale(along, cos(own)), sin(own), up);
        c->pointing.q_cam_from_gcrf = bst_quat_look(d, x);
        c->config.search_rate = BST_CONTROL_RATE_BELT; /* the boresight follows the region */
        expected_rate = (bst_vec3){1, 1, 1};
        bst_assert_ok(&ctx, bst_control_start_search(&ctx, c, BST_MODE_SEARCH, tick, "test"));
        expect_field(width, height, angles[i]);
        bst_assert_close(planned.step, 0.8, 0.0);
        bool valid;
        bst_vec3 aim, asked;
        c->search_step = 1;
        bst_search_tile tile = c->search.tile[1];
        bst_assert_ok(&ctx, bst_control_aim(&ctx, c, tick + 3000, &valid, &aim));
        bst_assert_ok(
            &ctx, region_at(NULL, &ctx, 1e-3 * (double)tick + 3.0, tile.x_rad, tile.y_rad, &asked));
        bst_assert_close(bst_vec3_angle(aim, asked), 0.0, 1e-9);
        /* it does not: what drifts in three frames of 2 s is lost, at most half of the field */
        c->config.search_rate = BST_CONTROL_RATE_SIDEREAL;
        for (int fast = 0; fast < 2; fast++) {
            expected_rate = (bst_vec3){fast ? 0.3 : 3e-4, 0.0, fast ? 0.0 : -4e-4};
            bst_assert_ok(&ctx, bst_control_start_search(&ctx, c, BST_MODE_SEARCH, tick, "test"));
            double drift = fast ? 0.5 * height : 5e-4 * 6.0;
            expect_field(width - drift, height - drift, angles[i]);
        }
    }
}

/* A frame counts if its whole exposure came after the arrival; the third one ends the dwell. */
static void frames_of_a_dwell(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_onboard_cue cue = {.sigma_rad = 0.02};
    bst_control *c = make(&cue, false);
    bst_assert_ok(&ctx, bst_control_start_search(&ctx, c, BST_MODE_SEARCH, 0, "test"));
    bst_assert_close(planned.half_x_rad,
                     fmin(c->config.search_sigmas * 0.02, c->config.search_max_deg * BST_DEG_RAD),
                     1e-12);
    assert_true(c->search.count > 3);
    bst_tracks tracks = {.attitude = {.stars = 5, .valid = true}};
    const struct {
        int64_t mid;
        bool valid;
        int64_t frames;
    } steps[] = {{1249, true, 0}, {1250, true, 1}, {3000, false, 1}, {5000, true, 2}};
    c->arrival_tick = 1000; /* half of the exposure is 250 ticks */
    for (int i = 0; i < 4; i++) {
        tracks.tick = steps[i].mid;
        tracks.attitude.valid = steps[i].valid;
        bst_assert_ok(&ctx, bst_control_count_frame(&ctx, c, steps[i].mid + 300, &tracks));
        assert_int_equal(c->frames, steps[i].frames);
        assert_int_equal(c->search_step, 0);
    }
    tracks.tick = 7000;
    bst_assert_ok(&ctx, bst_control_count_frame(&ctx, c, 7300, &tracks));
    assert_int_equal(c->search_step, 1);
    /* along the image's x axis, and across it towards y */
    bst_search_tile tile = c->search.tile[1];
    bst_vec3 d, aim;
    bool valid;
    bst_assert_ok(&ctx, cue_direction_at(&cue, &ctx, 9.0, &valid, &d));
    bst_assert_ok(&ctx, bst_control_aim(&ctx, c, 9000, &valid, &aim));
    bst_vec3 x =
        bst_vec3_unit(bst_vec3_axpy(c->search_x_gcrf, -bst_vec3_dot(c->search_x_gcrf, d), d));
    bst_assert_close(bst_vec3_dot(aim, x) / bst_vec3_dot(aim, d), tile.x_rad, 1e-9);
    bst_assert_close(bst_vec3_dot(aim, bst_vec3_cross(d, x)) / bst_vec3_dot(aim, d), tile.y_rad,
                     1e-9);
}

/* Of tracks whose rate agrees, the one with more hits, then the one that agrees better; with a
 * region only those of the cue's brightness. */
static void candidates(void **state) {
    (void)state;
    enum { COUNT = 6 };
    bst_ctx ctx = {0};
    bst_onboard_cue cue = {.sigma_rad = 0.01, .v_mag = 12.0, .v_mag_sigma = 0.4};
    bst_rng_key key = bst_rng_make_key(2, 0, "test", "candidates");
    bst_tracks *tracks = calloc(1, sizeof *tracks + COUNT * sizeof tracks->items[0]);
    assert_non_null(tracks);
    int taken = 0, none = 0, dim = 0;
    for (int i = 0; i < 900; i++) {
        bool in_region = i % 3 == 0, lost = i % 3 == 1;
        bst_control *c = make(&cue, in_region);
        cue.rate_sigma_radps = 2e-6;
        c->config.candidate_rate_sigmas = 4.0;
        c->config.candidate_hits = 3;
        c->config.candidate_score = 10.0;
        c->search_in_region = in_region;
        c->mode = lost ? BST_MODE_REACQUIRE : BST_MODE_SEARCH;
        c->lost.rate_gcrf_radps = (bst_vec3){1e-5, 2e-5, 0.0};
        c->rejected_id = 1;
        expected_rate = (bst_vec3){2e-5, 0.0, 1e-5};
        tracks->tick = 4000;
        tracks->count = COUNT;
        bst_onboard_cue then;
        bst_assert_ok(&ctx, cue_at(&cue, &ctx, 4.0, &then));
        bst_vec3 rate = in_region ? expected_rate
                        : lost    ? c->lost.rate_gcrf_radps
                                  : then.rate_gcrf_radps;
        int best = -1;
        double most = 0.0;
        for (int k = 0; k < COUNT; k++) {
            uint64_t n = (uint64_t)(COUNT * i + k);
            bst_track *t = &tracks->items[k];
            double sigma = 4e-6 * bst_rng_uniform(key, n, 0),
                   off = 2e-5 * bst_rng_uniform(key, n, 1);
            double angle = 6.28 * bst_rng_uniform(key, n, 2);
            *t = (bst_track){.id = 1 + k,
                             .hits = 2 + (int)(4 * bst_rng_uniform(key, n, 3)),
                             .score = 8.0 + 12.0 * bst_rng_uniform(key, n, 4),
                             .v_mag = (float)(9.0 + 6.0 * bst_rng_uniform(key, n, 5)),
                             .uncorrelated = bst_rng_uniform(key, n, 6) < 0.1};
            t->rate_gcrf_radps =
                bst_vec3_add(rate, (bst_vec3){off * cos(angle), off * sin(angle), 0.0});
            t->covariance[2 + (int)(n % 2)][2 + (int)(n % 2)] = sigma * sigma;
            /* 4 sigma of both rates; one that holds nothing of the target's is no agreement */
            double gate = 4.0 * sqrt(4e-12 + sigma * sigma);
            double widest = fmax(2.0 * 4.0 * 2e-6, bst_vec3_norm(rate));
            bool bright =
                !in_region || (fabs((double)t->v_mag - 12.0) <= 4.0 * 0.5 && !t->uncorrelated);
            bool fits = t->hits >= 3 && t->score >= 10.0 && k > 0 && off <= gate && gate <= widest;
            dim += fits && !bright;
            if (fits && bright && t->hits + 1.0 - off / gate > most) {
                most = t->hits + 1.0 - off / gate;
                best = k;
            }
        }
        const bst_track *out;
        bst_assert_ok(&ctx, bst_control_best_candidate(&ctx, c, tracks, &out));
        assert_int_equal(out ? (int)(out - tracks->items) : -1, best);
        taken += best >= 0;
        none += best < 0;
    }
    assert_true(taken > 300 && none > 30 && dim > 50);
    free(tracks);
}

/* A held track keeps its offset from the cue on the cue's arc; after a jump of the cue it goes on
 * straight. A scan goes to and fro along the region, from either end. */
static void aims(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_onboard_cue cue = {.sigma_rad = 0.01};
    bst_control *c = make(&cue, false);
    bool valid;
    bst_vec3 aim, offset = {1e-4, -2e-4, 5e-5};
    c->mode = BST_MODE_TRACK;
    c->held.tick = 2000;
    bst_assert_ok(&ctx, cue_at(&cue, &ctx, 2.0, &c->held.cue));
    c->held.direction_gcrf = bst_vec3_add(c->held.cue.direction_gcrf, offset);
    c->held.rate_gcrf_radps = c->held.cue.rate_gcrf_radps;
    for (int after = 0; after < 2; after++) {
        c->watch.jump_tick = after ? 2500 : 1500;
        bst_onboard_cue then;
        bst_assert_ok(&ctx, cue_at(&cue, &ctx, 402.0, &then));
        bst_vec3 straight = bst_vec3_axpy(c->held.direction_gcrf, 400.0, c->held.rate_gcrf_radps);
        bst_vec3 arc = bst_vec3_add(then.direction_gcrf, offset);
        bst_assert_ok(&ctx, bst_control_aim(&ctx, c, 402000, &valid, &aim));
        assert_true(valid);
        bst_assert_close(bst_vec3_angle(aim, after ? straight : arc), 0.0, 1e-9);
        assert_true(bst_vec3_angle(straight, arc) > 1e-4);
    }
    c = make(&cue, true);
    c->mode = BST_MODE_SCAN;
    c->mode_tick = 1000;
    for (int way = -1; way <= 1; way += 2) {
        c->config.scan_rate_arcsec_per_s = way * 100.0;
        double rate = 100.0 * BST_ARCSEC_RAD, once = 0.4 / rate;
        const double at[][2] = {{0.0, -0.2}, {0.25, -0.1}, {1.0, 0.2}, {1.75, -0.1}, {2.5, 0.0}};
        for (int i = 0; i < 5; i++) {
            int64_t tick = 1000 + (int64_t)llround(1000.0 * once * at[i][0]);
            bst_assert_ok(&ctx, bst_control_aim(&ctx, c, tick, &valid, &aim));
            bst_assert_close(asked_along_rad, way * at[i][1], 1e-6);
        }
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(tiles_of_a_region),
        cmocka_unit_test(frames_of_a_dwell),
        cmocka_unit_test(candidates),
        cmocka_unit_test(aims),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
