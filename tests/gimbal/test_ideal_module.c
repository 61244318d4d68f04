/* The gimbal of type "ideal" from a scenario's JSON, against ERFA. */
#include <erfa.h>
#include <erfam.h>
#include <stdlib.h>

#include "gimbal/modules.h"
#include "sim/engine/simulation.h"
#include "sim/world/world.h"
#include "tests/test_support.h"

static const bst_module_desc *const modules[] = {&bst_gimbal_ideal_module};
static const bst_scenario_registry registry = {.modules = modules, .count = 1};

#define SCENARIO(gimbal_)                                                                          \
    "{\"boresight\": 1, \"epoch_utc\": \"2022-06-16T22:10:00Z\", \"duration_s\": 2, "              \
    "\"world\": {\"star_catalogue\": \"embedded\"}, \"observers\": [{\"name\": \"sat\", "          \
    "\"orbit\": {\"elements_file\": \"catalogue_2022-06.tle\", \"norad\": 39089}, \"sensors\": [{" \
    "\"camera\": {\"pixel_scale_arcsec\": 3, \"aperture_m\": 0.15}, \"modules\": {\"gimbal\": "    \
    "{\"type\": \"ideal\", \"rate_hz\": 100, " gimbal_ "}}}]}]}"

typedef struct fixture {
    bst_ctx ctx;
    bst_scenario scenario;
    bst_simulation *simulation;
    const bst_world *world;
    bst_world_view *view;
    bst_vec3 icrs; /* where it shall look; astrometric */
    int samples;
    double worst_rad;
} fixture;

static bst_status open_simulation(fixture *f, const char *text) {
    bst_json *json;
    bst_assert_ok(&f->ctx,
                  bst_json_parse(&f->ctx, "scenarios/test.json", text, strlen(text), &json));
    bst_assert_ok(&f->ctx, bst_scenario_read(&f->ctx, json, &registry, &f->scenario));
    bst_json_free(json);
    static const bst_simulation_options options = {0};
    bst_status status = bst_simulation_create(&f->ctx, &f->scenario, &options, &f->simulation);
    if (status == BST_OK) {
        f->world = bst_simulation_world(f->simulation);
        bst_assert_ok(&f->ctx, bst_world_view_create(&f->ctx, f->world, &f->view));
    }
    return status;
}

static void end(fixture *f) {
    bst_world_view_free(f->view);
    bst_simulation_free(f->simulation);
    bst_scenario_free(&f->scenario);
}

/* Apparent direction by ERFA alone; only the observer's orbit is the world's. TT serves as TDB. */
static void apparent(const fixture *f, bst_ctx *ctx, double seconds, double out[3]) {
    bst_world_state s;
    bst_assert_ok(ctx, bst_world_view_observer_state(ctx, f->view, 0, seconds, &s));
    double tai1, tai2, tt1, tt2, heliocentric[2][3], barycentric[2][3];
    assert_int_equal(eraDtf2d("UTC", 2022, 6, 16, 22, 10, 0.0, &tai1, &tai2), 0);
    assert_int_equal(eraUtctai(tai1, tai2, &tai1, &tai2), 0);
    assert_int_equal(eraTaitt(tai1, tai2 + seconds / 86400.0, &tt1, &tt2), 0);
    eraEpv00(tt1, tt2, heliocentric, barycentric);
    const double r[3] = {s.position_m.x, s.position_m.y, s.position_m.z};
    const double u[3] = {s.velocity_mps.x, s.velocity_mps.y, s.velocity_mps.z};
    const double p[3] = {f->icrs.x, f->icrs.y, f->icrs.z};
    double from_sun[3], v[3], em, e[3], bent[3], v2 = 0.0;
    for (int i = 0; i < 3; i++) {
        from_sun[i] = heliocentric[0][i] + r[i] / ERFA_DAU;
        v[i] = (barycentric[1][i] * ERFA_DAU / ERFA_DAYSEC + u[i]) / ERFA_CMPS;
        v2 += v[i] * v[i];
    }
    eraPn(from_sun, &em, e);
    eraLdsun((double *)(uintptr_t)p, e, em, bent);
    eraAb(bent, v, em, sqrt(1.0 - v2), out);
}

static bst_status look(void *user, const char *scope, const char *channel, const void *payload,
                       int64_t tick) {
    fixture *f = user;
    (void)scope;
    if (strcmp(channel, BST_CHANNEL_LOS_HISTORY) != 0) {
        return BST_OK;
    }
    const bst_los_history *h = payload;
    const bst_los_sample *sample = &h->items[(h->written - 1) % h->capacity];
    assert_int_equal(sample->tick, tick);
    bst_vec3 z = bst_quat_rotate(bst_quat_conj(sample->q_cam_from_gcrf), (bst_vec3){0, 0, 1});
    double want[3];
    apparent(f, &f->ctx, (double)tick / 6000.0, want);
    double off = bst_vec3_norm(bst_vec3_sub(z, (bst_vec3){want[0], want[1], want[2]}));
    f->worst_rad = fmax(f->worst_rad, off);
    /* the camera's x axis is as near to the body's as it can be: what of that is across the sight
     */
    const bst_quat back = bst_quat_conj(bst_world_body_attitude(f->world, 0, 0));
    const bst_vec3 body_x = bst_quat_rotate(back, (bst_vec3){1, 0, 0}),
                   x = bst_quat_rotate(bst_quat_conj(sample->q_cam_from_gcrf), (bst_vec3){1, 0, 0});
    const bst_vec3 across = bst_vec3_axpy(body_x, -bst_vec3_dot(body_x, z), z);
    bst_assert_close(bst_vec3_dot(x, across), bst_vec3_norm(across), 1e-12);
    f->samples++;
    return BST_OK;
}

/* Runs 2 s (the orbit moves aberration by 1e-7 rad in that time) and compares at every step. */
static void expect_pointing(fixture *f) {
    bst_engine_hooks hooks = {.user = f, .message = look};
    bst_engine_set_hooks(bst_simulation_engine(f->simulation), &hooks);
    bst_assert_ok(&f->ctx, bst_engine_run(&f->ctx, bst_simulation_engine(f->simulation), 12000));
    assert_int_equal(f->samples, 200);
    if (!(f->worst_rad < 1e-9)) { /* what pointing truth is allowed */
        fail_msg("off by %g rad", f->worst_rad);
    }
}

static void a_direction(void **state) {
    (void)state;
    fixture f = {.samples = 0};
    bst_assert_ok(&f.ctx, open_simulation(&f, SCENARIO("\"target\": \"direction\", \"ra_deg\": "
                                                       "123.4, \"dec_deg\": -56.7")));
    double p[3];
    eraS2c(123.4 * ERFA_DD2R, -56.7 * ERFA_DD2R, p);
    f.icrs = (bst_vec3){p[0], p[1], p[2]};
    expect_pointing(&f);
    end(&f);
}

/* Vega, TYC 3105-2070-1, which moves by 0.35 arcsec a year: Hipparcos (van Leeuwen 2007) has
 * 18h 36m 56.33635s +38d 47' 01.2802" for 2000, motion 200.94 and 286.23 mas/yr. Tycho-2's own
 * numbers differ by up to 20 mas after 22 years (0.1 arcsec is 5e-7 rad), so the 1e-9 rad are
 * against the catalogue's entry and this is to show that it is the star. */
static void a_star(void **state) {
    (void)state;
    fixture f = {.samples = 0};
    bst_assert_ok(&f.ctx, open_simulation(&f, SCENARIO("\"target\": \"star\", \"star_tyc\": "
                                                       "[3105, 2070, 1]")));
    bst_star star;
    /* 2022-06-16T22:10:37 TAI is JD 2459747.4240: Julian year 2000 + 8202.4240... / 365.25 */
    double tai_days = 2459747.0 - 2451545.0 + (10.0 + 10.0 / 60.0 + 37.0 / 3600.0) / 24.0;
    bst_assert_ok(&f.ctx,
                  bst_stars_find(&f.ctx, bst_world_stars(f.world), bst_star_id_make(3105, 2070, 1),
                                 2000.0 + tai_days / 365.25, &star));
    double years = tai_days / 365.25, mas = ERFA_DAS2R / 1000.0, ra, dec, p[3];
    ra = (18.0 + 36.0 / 60.0 + 56.33635 / 3600.0) * 15.0 * ERFA_DD2R;
    dec = (38.0 + 47.0 / 60.0 + 1.2802 / 3600.0) * ERFA_DD2R;
    eraS2c(ra + 200.94 * mas * years / cos(dec), dec + 286.23 * mas * years, p);
    assert_true(bst_vec3_angle(star.icrs, (bst_vec3){p[0], p[1], p[2]}) < 100.0 * mas);
    f.icrs = star.icrs;
    expect_pointing(&f);
    end(&f);
}

static void an_unknown_star_is_refused(void **state) {
    (void)state;
    fixture f = {.samples = 0};
    assert_int_equal(open_simulation(&f, SCENARIO("\"target\": \"star\", \"star_tyc\": [1, 2, 3]")),
                     BST_ERR_NOT_FOUND);
    assert_non_null(strstr(f.ctx.message, "sat/camera/gimbal: star_tyc: "));
    end(&f);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_direction),
        cmocka_unit_test(a_star),
        cmocka_unit_test(an_unknown_star_is_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
