/* Guidance with a simulated mount: slews that take the least time, keep-out cones that the true
 * boresight stays out of, and its events beforehand. */
#include <string.h>

#include "control/guidance/guidance.h"
#include "gimbal/mount/second_order.h"
#include "sim/astro/bodies.h"
#include "tests/test_support.h"

#define TICKS 1000
#define DEG BST_DEG_RAD

typedef struct bench {
    bst_ctx ctx;
    bst_guidance guidance;
    bst_mount_two_axis plant;
    bst_nav_telemetry nav;
    bst_vec3 from, rate; /* the aim moves along a great circle: direction and rate at tick 0 */
    bst_vec3 jump_to;    /* and is elsewhere from jump_tick on */
    int64_t jump_tick;
    bool jumped; /* not announced beforehand */
    double range_m;
    /* found */
    double arrival_s;   /* from when on the boresight is on the aim, to 0.02 degree */
    double nearest_rad; /* least distance to the Sun's direction, after `leaving` */
    int events[8];
    bst_guidance_event last[8];
    bst_los_command before; /* of the slew under way, the latest */
    int followed;           /* commands of slews whose rates have been judged */
    int kept;               /* commands on the aim whose mount solution has been judged */
} bench;

static bst_vec3 aim_of(const bench *b, int64_t tick) {
    if (b->jumped) {
        return b->jump_to;
    }
    double t = (double)tick / TICKS, w = bst_vec3_norm(b->rate);
    if (w == 0.0) {
        return b->from;
    }
    return bst_vec3_axpy(bst_vec3_scale(b->from, cos(w * t)), sin(w * t) / w, b->rate);
}

static bst_status aim(void *user, bst_ctx *ctx, int64_t tick, bool *valid, bst_vec3 *direction) {
    (void)ctx;
    *valid = true;
    *direction = aim_of(user, tick);
    return BST_OK;
}

static bst_status range(void *user, bst_ctx *ctx, int64_t tick, double *range_m) {
    (void)ctx;
    (void)tick;
    *range_m = ((bench *)user)->range_m;
    return BST_OK;
}

static void open_bench(bench *b, bst_vec3 from, bst_vec3 rate) {
    *b = (bench){.from = from, .rate = rate, .jump_tick = INT64_MAX};
    bst_guidance_config config;
    bst_assert_ok(&b->ctx, bst_config_defaults(&b->ctx, bst_guidance_config_table, &config));
    const bst_guidance_env env = {
        .tick_rate_hz = TICKS, .pixel_rad = 1e-4, .aim = aim, .range = range, .user = b};
    bst_guidance_init(&b->guidance, &config, &env);
    bst_mount_two_axis_config mount;
    bst_assert_ok(&b->ctx, bst_config_defaults(&b->ctx, bst_two_axis_config_table, &mount));
    mount.encoder_noise_arcsec = 0;
    bst_mount_two_axis_keys keys = {0};
    bst_assert_ok(&b->ctx, bst_mount_two_axis_init(&b->ctx, &b->plant, &mount, BST_QUAT_IDENTITY,
                                                   1e-5, 1e-3, &keys));
    b->nav = (bst_nav_telemetry){.position_gcrf_m = {0, 0, 7000e3}, .sun_m = {0, 0, -1.5e11}};
    b->nearest_rad = INFINITY;
    b->arrival_s = INFINITY;
}

/* A slew's commands tell the rates at which their directions and angles change: half the sum of two
 * rates 50 ms apart, but for a change of the acceleration in between, 2 x 3.8 deg/s^2 of it at
 * most. */
static void judge_rates(bench *b, const bst_los_command *now) {
    const bst_los_command *before = &b->before;
    double dt = (double)(now->tick - before->tick) / TICKS, most = 0.5 * 7.6 * DEG * dt;
    if (b->guidance.slew.active && before->near_given && now->near_given && dt == 0.05) {
        bst_vec3 moved =
            bst_vec3_scale(bst_vec3_sub(now->direction_gcrf, before->direction_gcrf), 1.0 / dt);
        bst_vec3 commanded =
            bst_vec3_scale(bst_vec3_add(now->rate_gcrf_radps, before->rate_gcrf_radps), 0.5);
        assert_true(bst_vec3_norm(bst_vec3_sub(moved, commanded)) < most);
        for (int i = 0; i < 2; i++) {
            double turned = (now->near_rad[i] - before->near_rad[i]) / dt;
            bst_assert_close(0.5 * (now->near_radps[i] + before->near_radps[i]), turned, most);
        }
        b->followed++;
    }
    b->before = *now;
    b->before.near_given = now->near_given && b->guidance.slew.active;
}

/* On the aim, the solution that goes with a command is where the axes are: to half a
 * degree, of the 50 ms until it acts and of what changes no solution. */
static void judge_solution(bench *b, const bst_los_command *now) {
    if (now->near_given && !b->guidance.slew.active && isfinite(b->arrival_s)) {
        for (int i = 0; i < 2; i++) {
            bst_assert_close(bst_wrap_angle(now->near_rad[i] - b->plant.axis[i].angle_rad) / DEG,
                             0.0, 0.5);
        }
        b->kept++;
    }
}

/* Commands at 20 Hz with a latency of 50 ms, telemetry at 100 Hz. */
static void run(bench *b, double seconds) {
    bst_los_command waiting = {0}, active = {0};
    bool has = false, first = true;
    bst_vec3 sun = bst_vec3_unit(b->nav.sun_m);
    bool off_sun = bst_vec3_angle(sun, (bst_vec3){0, 0, 1}) >
                   b->guidance.config.sun_keep_out_deg * DEG; /* the mount's start */
    for (int64_t n = 0; n < (int64_t)(seconds * TICKS); n++) {
        b->jumped = n >= b->jump_tick;
        if (n % 50 == 0) {
            active = waiting;
            has = !first;
            bst_vec3 boresight =
                bst_quat_rotate(bst_quat_conj(b->plant.q_cam_from_gcrf), (bst_vec3){0, 0, 1});
            int64_t effect = n + 50;
            bst_vec3 up = aim_of(b, effect + 1), down = aim_of(b, effect - 1);
            waiting = (bst_los_command){.tick = effect, .direction_gcrf = aim_of(b, effect)};
            waiting.rate_gcrf_radps = bst_vec3_scale(bst_vec3_sub(up, down), 0.5 * TICKS);
            bool give;
            bst_guidance_see_sky(&b->guidance, &b->nav, BST_QUAT_IDENTITY);
            bst_assert_ok(&b->ctx,
                          bst_guidance_command(&b->ctx, &b->guidance, n > 0 ? &boresight : NULL,
                                               &waiting, &give));
            judge_rates(b, &waiting);
            judge_solution(b, &waiting);
            first = first && !give;
            for (int i = 0; i < b->guidance.event_count; i++) {
                b->events[b->guidance.events[i].kind]++;
                b->last[b->guidance.events[i].kind] = b->guidance.events[i];
            }
            b->guidance.event_count = 0;
        }
        bool measure = n % 10 == 0;
        bst_mount_two_axis_step(&b->plant, has ? &active : NULL, (double)(n - active.tick) / TICKS,
                                measure);
        if (measure) {
            bst_mount_status status = {0};
            bst_mount_two_axis_status(&b->plant, n, &status);
            bst_guidance_telemetry(&b->guidance, &status);
        }
        bst_vec3 d = bst_quat_rotate(bst_quat_conj(b->plant.q_cam_from_gcrf), (bst_vec3){0, 0, 1});
        double off = bst_vec3_angle(d, aim_of(b, n));
        b->arrival_s = off > 0.02 * DEG      ? INFINITY
                       : isinf(b->arrival_s) ? (double)n / TICKS
                                             : b->arrival_s;
        double to_sun = bst_vec3_angle(d, sun);
        off_sun = off_sun || to_sun > b->guidance.config.sun_keep_out_deg * DEG;
        if (off_sun) {
            b->nearest_rad = fmin(b->nearest_rad, to_sun);
        }
    }
}

/* Body axes = GCRF; the boresight starts on +z, outer axis about y. */
static bst_vec3 mount_at(double outer_deg, double inner_deg) {
    double o = outer_deg * DEG, i = inner_deg * DEG;
    return (bst_vec3){cos(i) * sin(o), -sin(i), cos(i) * cos(o)};
}

static void nothing_asked_nothing_changed(void **state) {
    (void)state;
    bench b;
    open_bench(&b, mount_at(100, 20), (bst_vec3){0, 0, 0});
    bst_los_command before = {.tick = 7,
                              .direction_gcrf = mount_at(100, 20),
                              .rate_gcrf_radps = {1e-5, 2e-5, 3e-5}},
                    after = before;
    bool give;
    bst_guidance_see_sky(&b.guidance, &b.nav, BST_QUAT_IDENTITY);
    bst_assert_ok(&b.ctx, bst_guidance_command(&b.ctx, &b.guidance, NULL, &after, &give));
    assert_true(give);
    assert_memory_equal(&before, &after, sizeof before);
    assert_int_equal(b.guidance.event_count, 0);
}

/* Limits of 2 deg/s and 4 deg/s^2, 0.95 of them used: 180 degrees take 180 / 1.9 + 1.9 / 3.8 s and
 * the latency; the mount by itself brakes earlier. */
static void slews_of_least_time(void **state) {
    (void)state;
    for (int planned = 0; planned < 2; planned++) {
        bench b;
        open_bench(&b, mount_at(179.99, 0), (bst_vec3){0, 0, 0});
        b.guidance.config.slews = planned ? BST_SLEWS_PLANNED : BST_SLEWS_MOUNT;
        run(&b, 100.0);
        double bound = 179.99 / 1.9 + 1.9 / 3.8 + 0.1;
        print_message("180 deg %s: %.2f s, bound %.2f s\n", planned ? "planned" : "by the mount",
                      b.arrival_s, bound);
        if (planned) {
            bst_assert_close(b.arrival_s, bound, 0.01 * bound);
            assert_true(b.followed > 1500); /* of 95 s at 20 Hz */
        }
        assert_true(b.arrival_s < 1.02 * bound);
    }
    /* exactly antipodal, and onto an aim that moves at 1 deg/s */
    bench b;
    open_bench(&b, (bst_vec3){0, 0, -1}, (bst_vec3){0, 0, 0});
    b.guidance.config.slews = BST_SLEWS_PLANNED;
    run(&b, 100.0);
    assert_true(b.arrival_s < 97.0);
    open_bench(&b, mount_at(40, 0), bst_vec3_scale(mount_at(130, 0), 1.0 * DEG));
    b.guidance.config.slews = BST_SLEWS_PLANNED;
    run(&b, 60.0);
    /* 40 deg at 1.9 - 1 deg/s, 1.9 / 3.8 s to full rate (0.475 deg short) and 0.9 / 3.8 s back */
    print_message("onto an aim at 1 deg/s: %.2f s\n", b.arrival_s);
    bst_assert_close(b.arrival_s, (40 + 0.475 - 0.1) / 0.9 + 0.24, 0.5);
    assert_true(b.kept > 200); /* of 15 s at 20 Hz */
    /* round and round, off the equator of the outer axis */
    open_bench(&b, mount_at(150, 30),
               bst_vec3_scale(bst_vec3_sub(mount_at(150.5, 30), mount_at(149.5, 30)), 1.2));
    b.guidance.config.slews = BST_SLEWS_PLANNED;
    run(&b, 130.0);
    assert_true(b.kept > 200);
    /* the aim jumps while the slew is under way */
    open_bench(&b, mount_at(100, 0), (bst_vec3){0, 0, 0});
    b.guidance.config.slews = BST_SLEWS_PLANNED;
    b.jump_tick = 20000;
    b.jump_to = mount_at(-20, 10);
    run(&b, 70.0);
    print_message("after a jump at 20 s: %.2f s\n", b.arrival_s);
    /* 37 deg out by then: a stop, 58 deg and two changes of rate at full speed, latency */
    assert_true(b.arrival_s < 20.0 + 58.0 / 1.9 + 2.0);
}

static void keeps_out_of_the_sun(void **state) {
    (void)state;
    /* the Sun half way on the straight line, cone of 30 degrees */
    bench b;
    open_bench(&b, mount_at(120, 3), (bst_vec3){0, 0, 0});
    b.nav.sun_m = bst_vec3_scale(mount_at(60, 0), 1.5e11);
    b.guidance.config.sun_keep_out_deg = 30;
    run(&b, 130.0);
    print_message("detour of %.1f deg, arrived at %.1f s, %.3f deg from the Sun\n",
                  b.last[BST_GUIDANCE_DETOUR].length_rad / DEG, b.arrival_s, b.nearest_rad / DEG);
    assert_int_equal(b.events[BST_GUIDANCE_DETOUR], 1);
    assert_true(b.arrival_s < 125.0);
    assert_true(b.nearest_rad > 30 * DEG);
    /* cue and Sun parallel: it waits beside the cone, and goes on when the cue leaves it */
    open_bench(&b, mount_at(60, 0), bst_vec3_scale(mount_at(150, 0), 0.5 * DEG));
    b.nav.sun_m = bst_vec3_scale(mount_at(60, 0), 1.5e11);
    b.guidance.config.sun_keep_out_deg = 25;
    b.guidance.config.prediction_horizon_s = 200;
    run(&b, 110.0);
    assert_true(b.nearest_rad > 25 * DEG);
    assert_int_equal(b.events[BST_GUIDANCE_UNREACHABLE], 1);
    assert_int_equal(b.last[BST_GUIDANCE_UNREACHABLE].reason, BST_REACH_SUN);
    bst_assert_close(b.last[BST_GUIDANCE_UNREACHABLE].until_s, 50.0, 0.02); /* 25 / 0.5 */
    assert_int_equal(b.events[BST_GUIDANCE_REACHABLE], 1);
    print_message("out of the cone at 50 s, followed from %.1f s on\n", b.arrival_s);
    assert_true(b.arrival_s < 105.0);
    /* inside of the cone at the start: out by the shortest way, and round it */
    open_bench(&b, mount_at(90, 0), (bst_vec3){0, 0, 0});
    b.nav.sun_m = bst_vec3_scale(mount_at(20, 0), 1.5e11);
    b.guidance.config.sun_keep_out_deg = 40;
    run(&b, 120.0);
    assert_true(b.arrival_s < 115.0);
    assert_true(b.nearest_rad > 40 * DEG * (1 - 1e-9));
    /* unreachable for ever */
    open_bench(&b, mount_at(20, 0), (bst_vec3){0, 0, 0});
    b.nav.sun_m = bst_vec3_scale(mount_at(20, 0), 1.5e11);
    b.guidance.config.sun_keep_out_deg = 40;
    b.guidance.config.prediction_horizon_s = 300;
    run(&b, 60.0);
    assert_int_equal(b.events[BST_GUIDANCE_UNREACHABLE], 1);
    assert_true(isinf(b.last[BST_GUIDANCE_UNREACHABLE].until_s));
    assert_true(isinf(b.arrival_s));
}

/* A target that goes down behind the Earth, with an event before it does. */
static void occultation_ahead(void **state) {
    (void)state;
    bench b;
    open_bench(&b, (bst_vec3){0, 0, 1}, (bst_vec3){1 * DEG, 0, 0});
    b.range_m = 2e7;
    b.guidance.config.prediction_horizon_s = 150;
    run(&b, 40.0);
    assert_int_equal(b.events[BST_GUIDANCE_AHEAD], 1);
    assert_int_equal(b.last[BST_GUIDANCE_AHEAD].reason, BST_REACH_BEHIND_EARTH);
    double limb = asin(BST_EARTH_RADIUS_M / 7000e3) / DEG;
    bst_assert_close(b.last[BST_GUIDANCE_AHEAD].from_s, 180.0 - limb, 0.1);
    char text[160];
    bst_guidance_describe(&b.last[BST_GUIDANCE_AHEAD], text, sizeof text);
    assert_non_null(strstr(text, "behind the Earth"));
}

/* Cones as the spacecraft's own reckoning turns them, each about its own body and 0.05 degree wider
 * than asked: the Earth's by its radius and 80 km of air, seen from 8000 km, and 3 degrees more. */
static void cones_of_the_sky(void **state) {
    (void)state;
    bench b;
    open_bench(&b, mount_at(100, 20), (bst_vec3){0, 0, 0});
    bst_guidance_config *c = &b.guidance.config;
    c->sun_keep_out_deg = 30.0;
    c->moon_keep_out_deg = 7.0;
    c->earth_keep_out = true;
    c->earth_limb_keep_out_deg = 3.0;
    c->earth_limb_altitude_km = 80.0;
    const bst_quat error = bst_quat_from_rotvec((bst_vec3){0.2, -0.1, 0.3});
    const bst_nav_telemetry nav = {.position_gcrf_m = {0, 8000e3, 0},
                                   .velocity_gcrf_mps = {7000, 0, 100},
                                   .sun_m = {1.5e11, 0, 0},
                                   .moon_m = {0, 0, 3.8e8}};
    bst_guidance_see_sky(&b.guidance, &nav, error);
    assert_int_equal(b.guidance.zone_count, 3);
    bool seen[3] = {false, false, false};
    for (int i = 0; i < 3; i++) {
        const bst_keep_out_zone *zone = &b.guidance.zones[i];
        int kind = zone->kind == BST_ZONE_SUN ? 0 : zone->kind == BST_ZONE_MOON ? 1 : 2;
        const bst_vec3 to[3] = {{1, 0, 0}, {0, 0, 1}, {0, -1, 0}};
        double earth = asin((BST_EARTH_RADIUS_M + 80e3) / 8000e3) + 3.0 * DEG;
        const double half[3] = {30.0 * DEG, 7.0 * DEG, earth};
        bst_vec3 axis = bst_quat_rotate(error, to[kind]);
        bst_assert_close(bst_vec3_angle(zone->axis, axis), 0.0, 1e-7); /* cosine's rounding */
        bst_assert_close(zone->half_angle_rad, half[kind] + 0.05 * DEG, 1e-12);
        seen[kind] = true;
    }
    assert_true(seen[0] && seen[1] && seen[2]);
    bst_vec3 v = bst_quat_rotate(error, nav.velocity_gcrf_mps);
    bst_assert_close(bst_vec3_norm(bst_vec3_sub(v, b.guidance.nav.velocity_gcrf_mps)), 0.0, 1e-9);
}

/* What the look-ahead says of the Earth, of an equatorial circular orbit whose telemetry is 40 s
 * old: the star at the angle 1.9 + pi from the telemetry's place goes behind the Earth where the
 * orbit is asin(R / r) before 1.9, and comes back as far after it. */
static void the_earth_ahead(void **state) {
    (void)state;
    bench b;
    const double r = 7000e3, n = sqrt(BST_EARTH_MU_M3PS2 / (r * r * r)),
                 half = asin(BST_EARTH_RADIUS_M / r);
    open_bench(&b, (bst_vec3){cos(1.9 + BST_PI), sin(1.9 + BST_PI), 0}, (bst_vec3){0, 0, 0});
    b.range_m = 4e7;
    b.guidance.config.prediction_horizon_s = 4000.0;
    const bst_nav_telemetry nav = {.tick = 5 * TICKS,
                                   .position_gcrf_m = {r, 0, 0},
                                   .velocity_gcrf_mps = {0, r * n, 0},
                                   .sun_m = {0, 0, 1.5e11}};
    bst_guidance_see_sky(&b.guidance, &nav, BST_QUAT_IDENTITY);
    bst_assert_ok(&b.ctx, bst_guidance_look_ahead(&b.ctx, &b.guidance, 45 * TICKS));
    assert_int_equal(b.guidance.event_count, 1);
    const bst_guidance_event *e = &b.guidance.events[0];
    assert_int_equal(e->kind, BST_GUIDANCE_AHEAD);
    assert_int_equal(e->reason, BST_REACH_BEHIND_EARTH);
    bst_assert_close(e->from_s, 5.0 + (1.9 - half) / n, 0.5);
    bst_assert_close(e->until_s, 5.0 + (1.9 + half) / n, 0.5);
    /* within it: until when */
    b.guidance.event_count = 0;
    int64_t inside = (int64_t)((5.0 + 1.9 / n) * TICKS);
    bst_assert_ok(&b.ctx, bst_guidance_look_ahead(&b.ctx, &b.guidance, inside));
    assert_int_equal(b.guidance.event_count, 1);
    assert_int_equal(e->kind, BST_GUIDANCE_UNREACHABLE);
    bst_assert_close(e->until_s, 5.0 + (1.9 + half) / n, 0.5);
}

/* In a body that turns at w, what rests among the stars moves by v x w. */
static void the_body_turns_on(void **state) {
    (void)state;
    bench b;
    open_bench(&b, mount_at(100, 20), (bst_vec3){0, 0, 0});
    const bst_vec3 w = {2e-3, -1e-3, 3e-3}, star = {0.6, 0.0, 0.8};
    const bst_quat q = bst_quat_from_rotvec((bst_vec3){0.3, 0.9, -0.4});
    const bst_mount_status status = {.tick = 500, .q_body_from_gcrf = q, .rate_body_radps = w};
    bst_guidance_telemetry(&b.guidance, &status);
    bst_vec3 now = bst_quat_rotate(bst_guidance_body(&b.guidance, 500), star);
    bst_vec3 then = bst_quat_rotate(bst_guidance_body(&b.guidance, 1500), star);
    bst_assert_close(bst_vec3_norm(bst_vec3_sub(now, bst_quat_rotate(q, star))), 0.0, 1e-15);
    bst_vec3 change = bst_vec3_sub(bst_vec3_sub(then, now), bst_vec3_cross(now, w));
    bst_assert_close(bst_vec3_norm(change), 0.0, 1e-5); /* half of w^2 in a second */
}

/* A slew begins where the axes are at its tick: at the encoders' angles, carried on by their rates
 * since. */
static void slews_begin_at_the_axes(void **state) {
    (void)state;
    bench b;
    open_bench(&b, mount_at(100, 20), (bst_vec3){0, 0, 0});
    b.guidance.config.slews = BST_SLEWS_PLANNED;
    bst_mount_status status = {0};
    bst_mount_two_axis_status(&b.plant, 1000, &status);
    const double angle[2] = {0.3, -0.2}, rate[2] = {0.02, -0.013};
    for (int i = 0; i < 2; i++) {
        status.axis[i].angle_rad = angle[i];
        status.axis[i].rate_radps = rate[i];
    }
    bst_guidance_telemetry(&b.guidance, &status);
    bst_guidance_see_sky(&b.guidance, &b.nav, BST_QUAT_IDENTITY);
    bst_los_command command = {.tick = 1400, .direction_gcrf = mount_at(100, 20)};
    bool give;
    bst_vec3 boresight = mount_at(0, 0);
    bst_assert_ok(&b.ctx, bst_guidance_command(&b.ctx, &b.guidance, &boresight, &command, &give));
    assert_true(give && b.guidance.slew.active && command.near_given);
    for (int i = 0; i < 2; i++) {
        double at, speed, accel;
        bst_slew_axis_at(&b.guidance.slew.axis[i], 0.0, &at, &speed, &accel);
        bst_assert_close(at, angle[i] + 0.4 * rate[i], 1e-12);
        bst_assert_close(speed, rate[i], 1e-12);
        bst_assert_close(command.near_rad[i], angle[i] + 0.4 * rate[i], 1e-12);
    }
}

/* The words of every event, with times and angles in degrees. */
static void words_of_events(void **state) {
    (void)state;
    const char *why = bst_pointing_feasibility_reason(1);
    const struct {
        bst_guidance_event event;
        const char *words; /* %s: the reason */
    } cases[] = {
        {{BST_GUIDANCE_UNREACHABLE, 1, 0, 32.5, 0}, "unreachable until 32.5 s: %s"},
        {{BST_GUIDANCE_UNREACHABLE, 1, 0, INFINITY, 0},
         "unreachable for as long as is looked ahead: %s"},
        {{BST_GUIDANCE_REACHABLE, 1, 0, 0, 0}, "within reach again, no longer %s"},
        {{BST_GUIDANCE_AHEAD, 1, 12.25, 40.75, 0}, "unreachable from 12.2 s until 40.8 s: %s"},
        {{BST_GUIDANCE_LOSS, 1, 7, INFINITY, 0},
         "will be lost from 7.0 s for as long as is looked ahead: %s"},
        {{BST_GUIDANCE_DETOUR, 1, 0, 60, 0.5},
         "slew round keep-out cones by 28.6 deg until 60.0 s"},
        {{BST_GUIDANCE_ROLL, 1, 0, 0, 0.2}, "the body rolls by 11.5 deg, lest the target be %s"}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        char expected[300], text[300];
        const char *at = strstr(cases[i].words, "%s");
        int plain = at ? (int)(at - cases[i].words) : (int)strlen(cases[i].words);
        snprintf(expected, sizeof expected, "%.*s%s", plain, cases[i].words, at ? why : "");
        bst_guidance_describe(&cases[i].event, text, sizeof text);
        assert_string_equal(text, expected);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_body_turns_on),
        cmocka_unit_test(the_earth_ahead),
        cmocka_unit_test(slews_begin_at_the_axes),
        cmocka_unit_test(cones_of_the_sky),
        cmocka_unit_test(nothing_asked_nothing_changed),
        cmocka_unit_test(slews_of_least_time),
        cmocka_unit_test(words_of_events),
        cmocka_unit_test(keeps_out_of_the_sun),
        cmocka_unit_test(occultation_ahead),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
