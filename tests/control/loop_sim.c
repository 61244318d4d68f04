#include "tests/control/loop_sim.h"
#include "sim/onboard/knowledge.h"

#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include "tests/archive_support.h"

#define MU 3.986004418e14

typedef struct scene {
    const sim_options *o;
    bst_vec3 cue_error; /* rotation vector */
} scene;

/* Circular orbits: an observer at 790 km, a geostationary target. */
static bst_vec3 on_circle(double radius, double inclination, double phase, double t,
                          bst_vec3 *velocity) {
    double n = sqrt(MU / (radius * radius * radius)), a = phase + n * t;
    double c = cos(inclination), s = sin(inclination), v = n * radius;
    if (velocity) {
        *velocity = (bst_vec3){-v * sin(a), v * cos(a) * c, v * cos(a) * s};
    }
    return (bst_vec3){radius * cos(a), radius * sin(a) * c, radius * sin(a) * s};
}

static bst_vec3 observer(double t, bst_vec3 *velocity) {
    return on_circle(7168e3, 98.5 * BST_DEG_RAD, 0.4, t, velocity);
}

static bst_vec3 target_direction(const scene *s, double t, bool as_cue) {
    bst_vec3 p = on_circle(42164e3, 0.0, 0.1, t, NULL);
    if (!as_cue && t > s->o->burn_at_s) {
        p.z += s->o->burn_mps * (t - s->o->burn_at_s);
    }
    return bst_vec3_unit(bst_vec3_sub(p, observer(t, NULL)));
}

static bst_status cue_at(void *user, bst_ctx *ctx, double t, bst_onboard_cue *out) {
    (void)ctx;
    const scene *s = user;
    bst_quat wrong = bst_quat_from_rotvec(s->cue_error);
    bst_vec3 a = target_direction(s, t - 0.5, true), b = target_direction(s, t + 0.5, true);
    *out = (bst_onboard_cue){
        .valid = true,
        .direction_gcrf = bst_quat_rotate(wrong, target_direction(s, t, true)),
        .rate_gcrf_radps = bst_quat_rotate(wrong, bst_vec3_sub(b, a)),
        .sigma_rad = s->o->cue_sigma_deg * BST_DEG_RAD,
        .rate_sigma_radps = 0.3 * BST_ARCSEC_RAD,
        .v_mag_sigma = INFINITY,
    };
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

static bst_nav_telemetry nav_at(double t, int64_t tick) {
    bst_nav_telemetry nav = {.tick = tick, .sun_m = {1.5e11, 0, 0}};
    nav.position_gcrf_m = observer(t, &nav.velocity_gcrf_mps);
    nav.velocity_bary_mps = bst_vec3_add(nav.velocity_gcrf_mps, (bst_vec3){3000, 26000, 12000});
    return nav;
}

static bst_light light_of(const bst_nav_telemetry *nav) {
    return (bst_light){.velocity_mps = nav->velocity_bary_mps, .sun_m = nav->sun_m};
}

/* ---- a tracker of one target ---- */

typedef struct tracker {
    bool alive, confirmed;
    int64_t id, tick, next_id;
    bst_vec3 direction, rate;
    double p_ee, p_er, p_rr; /* per axis */
    int hits, misses;
    unsigned recent; /* hits of the latest frames, newest in bit 0 */
} tracker;

static void tracker_frame(tracker *k, int64_t tick, const bst_vec3 *seen, bst_vec3 cue_rate,
                          double sigma) {
    const double density = 3e-4 * SIM_PIXEL_RAD * SIM_PIXEL_RAD;
    if (k->alive) {
        double dt = (double)(tick - k->tick) / SIM_TICKS_PER_S;
        k->direction = bst_vec3_unit(bst_vec3_axpy(k->direction, dt, k->rate));
        k->p_ee += dt * (2.0 * k->p_er + dt * k->p_rr) + density * dt * dt * dt / 3.0;
        k->p_er += dt * k->p_rr + density * dt * dt / 2.0;
        k->p_rr += density * dt;
        k->tick = tick;
        k->recent = k->recent << 1 | (seen != NULL);
        if (seen) {
            double s = k->p_ee + sigma * sigma, alpha = k->p_ee / s, beta = k->p_er / s;
            bst_vec3 innovation = bst_vec3_sub(*seen, k->direction);
            k->direction = bst_vec3_unit(bst_vec3_axpy(k->direction, alpha, innovation));
            k->rate = bst_vec3_axpy(k->rate, beta, innovation);
            k->p_rr -= beta * k->p_er;
            k->p_ee *= 1.0 - alpha;
            k->p_er *= 1.0 - alpha;
            k->hits++;
            k->misses = 0;
        } else {
            k->misses++;
        }
        int of_five = 0;
        for (int i = 0; i < 5; i++) {
            of_five += (int)(k->recent >> i & 1u);
        }
        k->confirmed = k->confirmed || of_five >= 3;
        k->alive = k->misses <= (k->confirmed ? 5 : 2);
    } else if (seen) {
        double rate_sigma = 2.0 * BST_ARCSEC_RAD;
        *k = (tracker){.alive = true,
                       .id = k->next_id + 1,
                       .next_id = k->next_id + 1,
                       .tick = tick,
                       .direction = *seen,
                       .rate = cue_rate,
                       .p_ee = sigma * sigma,
                       .p_rr = rate_sigma * rate_sigma,
                       .hits = 1,
                       .recent = 1};
    }
}

static void tracker_report(const tracker *k, bst_tracks *out) {
    out->count = 0;
    out->target_id = 0;
    if (k->alive) {
        bst_track *t = &out->items[out->count++];
        *t = (bst_track){.id = k->id,
                         .status = !k->confirmed ? BST_TRACK_TENTATIVE
                                   : k->misses   ? BST_TRACK_COASTING
                                                 : BST_TRACK_CONFIRMED,
                         .target_of_interest = k->confirmed,
                         .direction_gcrf = k->direction,
                         .rate_gcrf_radps = k->rate,
                         .hits = k->hits,
                         .score = 20.0,
                         .misses_in_row = k->misses};
        t->covariance[0][0] = t->covariance[1][1] = k->p_ee;
        t->covariance[2][2] = t->covariance[3][3] = k->p_rr;
        out->target_id = k->confirmed ? k->id : 0;
    }
}

/* ---- the loop ---- */

sim_options sim_defaults(void) {
    return (sim_options){.seed = 1,
                         .duration_s = 300.0,
                         .cue_error_x_deg = 0.6,
                         .cue_sigma_deg = 0.35,
                         .burn_at_s = INFINITY,
                         .dark_from_s = INFINITY,
                         .blackout_from_s = INFINITY,
                         .detection_probability = 1.0,
                         .drift_arcsec_per_s = {3.0, -4.0, 0.0},
                         .jitter_low_px_rms = 0.5,
                         .jitter_high_px_rms = 0.2,
                         .centroid_sigma_px = 0.1,
                         .fix_sigma_px = 0.03,
                         .wrong_from_s = INFINITY,
                         .frame_delay_s = 0.3,
                         .control_rate_hz = 20.0};
}

bst_quat sim_body_with_pole_at(double t_s) {
    sim_options o = sim_defaults();
    scene s = {.o = &o};
    bst_nav_telemetry nav = nav_at(t_s, 0);
    bst_light light = light_of(&nav);
    bst_vec3 y = bst_light_aberrate(&light, target_direction(&s, t_s, false));
    bst_vec3 z = bst_vec3_perpendicular(y), x = bst_vec3_cross(y, z);
    bst_mat3 rows = {{{x.x, x.y, x.z}, {y.x, y.y, y.z}, {z.x, z.y, z.z}}};
    return bst_quat_from_mat3(&rows);
}

static int by_value(const void *a, const void *b) {
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* What a command moved on from the one before, less what the aim did. */
static double bump_px(bst_ctx *ctx, const bst_control *was, const bst_control *is,
                      const bst_los_command *before, const bst_los_command *after) {
    bool valid_before, valid_after;
    bst_vec3 a, b;
    bst_assert_ok(ctx, bst_control_aim(ctx, was, after->tick, &valid_before, &a));
    bst_assert_ok(ctx, bst_control_aim(ctx, is, after->tick, &valid_after, &b));
    if (!valid_before || !valid_after) {
        return 0.0;
    }
    double age = (double)(after->tick - before->tick) / SIM_TICKS_PER_S;
    bst_vec3 line = bst_vec3_axpy(before->direction_gcrf, age, before->rate_gcrf_radps);
    double made = bst_vec3_angle(line, after->direction_gcrf);
    return fabs(made - bst_vec3_angle(a, b)) / SIM_PIXEL_RAD;
}

typedef struct exposure {
    bst_vec3 error_sum;
    int samples;
    bst_quat q_tel_mid;
    int64_t mid_tick;
    bst_vec3 first, last; /* apparent target in the camera at the ends */
} exposure;

/* What the stars and the target of one exposure tell. */
static void measure(const scene *s, const exposure *x, tracker *k, int64_t frame,
                    bst_rng_key noise_key, bst_tracks *out) {
    const sim_options *o = s->o;
    double n[2], m[2], u = bst_rng_uniform(noise_key, (uint64_t)frame, 9);
    bst_rng_normal2(noise_key, (uint64_t)frame, 0, n);
    bst_rng_normal2(noise_key, (uint64_t)frame, 1, m);
    double f = o->fix_sigma_px * SIM_PIXEL_RAD, c = o->centroid_sigma_px * SIM_PIXEL_RAD;
    bst_vec3 e = bst_vec3_scale(x->error_sum, 1.0 / x->samples);
    bst_vec3 noisy = bst_vec3_add(e, (bst_vec3){f * n[0], f * n[1], 5.0 * f * m[0]});
    double t = (double)x->mid_tick / SIM_TICKS_PER_S;
    out->attitude = (bst_attitude_fix){.valid = true,
                                       .stars = 20,
                                       .tick = x->mid_tick,
                                       .error_cam_rad = noisy,
                                       .sigma_rad = {f, f, 5.0 * f}};
    out->attitude.q_cam_from_gcrf = bst_quat_mul(bst_quat_from_rotvec(noisy), x->q_tel_mid);

    bst_nav_telemetry nav = nav_at(t, x->mid_tick);
    bst_light light = light_of(&nav);
    bst_vec3 apparent = bst_light_aberrate(&light, target_direction(s, t, false));
    bst_vec3 v = bst_quat_rotate(bst_quat_mul(bst_quat_from_rotvec(e), x->q_tel_mid), apparent);
    double px = v.x / v.z / SIM_PIXEL_RAD, py = v.y / v.z / SIM_PIXEL_RAD;
    bool in_field = v.z > 0.0 && fabs(px) < 511.5 && fabs(py) < 511.5;
    bool smeared = bst_vec3_angle(x->first, x->last) > 10.0 * SIM_PIXEL_RAD;
    bool dark = t >= o->dark_from_s && t < o->dark_to_s;
    bst_vec3 seen = {0, 0, 0};
    bool detected = in_field && !smeared && !dark && u < o->detection_probability;
    if (detected) {
        if (t >= o->wrong_from_s && t < o->wrong_to_s) {
            px += 40.0 + 3.0 * (t - o->wrong_from_s);
        }
        double a[2];
        bst_rng_normal2(noise_key, (uint64_t)frame, 2, a);
        bst_vec3 w = bst_vec3_unit(
            (bst_vec3){px * SIM_PIXEL_RAD + c * a[0], py * SIM_PIXEL_RAD + c * a[1], 1.0});
        seen = bst_light_unaberrate(
            &light, bst_quat_rotate(bst_quat_conj(out->attitude.q_cam_from_gcrf), w));
    }
    bst_ctx ctx = {0};
    bst_onboard_cue cue;
    bst_assert_ok(&ctx, cue_at((void *)(uintptr_t)s, &ctx, t, &cue));
    tracker_frame(k, x->mid_tick, detected ? &seen : NULL, cue.rate_gcrf_radps, hypot(c, f));
    out->tick = x->mid_tick;
    out->exposure_id = frame;
    tracker_report(k, out);
    if (o->clutter && frame % 9 < 4) {
        /* appears for four frames near the frame's centre, then is gone */
        bst_track *t2 = &out->items[out->count++];
        *t2 = (bst_track){.id = 1000 + frame / 9, .hits = 1 + (int)(frame % 9), .score = 20.0};
        t2->direction_gcrf = bst_quat_rotate(bst_quat_conj(x->q_tel_mid), (bst_vec3){2e-4, 0, 1});
        t2->rate_gcrf_radps = cue.rate_gcrf_radps;
    }
}

static bst_status archive_control(void *control, bst_archive *archive) {
    return bst_control_archive(control, archive);
}

/* Replaces control by a new one with its saved state. */
static void restore_control(bst_ctx *ctx, bst_control *control) {
    const bst_control_config config = control->config;
    const bst_control_env env = control->env;
    test_saved saved = test_save(archive_control, control);
    memset(control, 0xa5, sizeof *control);
    bst_assert_ok(ctx, bst_control_init(ctx, control, &config, &env));
    bst_assert_ok(ctx, test_restore(ctx, archive_control, control, saved));
    free(saved.bytes);
}

static uint64_t hash_command(uint64_t hash, const bst_los_command *c) {
    const bst_vec3 parts[] = {c->direction_gcrf, c->rate_gcrf_radps, c->accel_gcrf_radps2};
    const unsigned char *bytes = (const unsigned char *)parts;
    for (size_t i = 0; i < sizeof parts; i++) {
        hash = (hash ^ bytes[i]) * UINT64_C(0x100000001B3); /* FNV-1a */
    }
    return hash;
}

/* Copies what bst_control_aim and the search need of a controller: all but the histories of the
 * compensator, which are most of its bytes. */
static void copy_aim(bst_control *to, const bst_control *from) {
    const size_t before = offsetof(bst_control, image_loop),
                 after = before + sizeof from->image_loop;
    memcpy(to, from, before);
    memcpy((char *)to + after, (const char *)from + after, sizeof *to - after);
}

enum { WAY = 256, PENDING = 8 };     /* commands and messages on their way */
enum { PER_ERROR = 10 /* steps */ }; /* one error in so many is kept for the percentile */

void sim_run(const sim_options *o, sim_result *r) {
    bst_ctx ctx = {0};
    bst_mount_two_axis_config gimbal_config;
    bst_control_config control_config;
    bst_assert_ok(&ctx, bst_config_defaults(&ctx, bst_two_axis_config_table, &gimbal_config));
    bst_assert_ok(&ctx, bst_config_defaults(&ctx, bst_control_config_table, &control_config));
    memcpy(gimbal_config.platform.drift_arcsec_per_s, o->drift_arcsec_per_s,
           sizeof o->drift_arcsec_per_s);
    gimbal_config.platform.jitter_low_px_rms = o->jitter_low_px_rms;
    gimbal_config.platform.jitter_high_px_rms = o->jitter_high_px_rms;
    control_config.exposure_s = 0.5;
    control_config.search_timeout_s = o->search_timeout_s;
    control_config.search_pattern = o->search_pattern;
    const int64_t control_period = llround(SIM_TICKS_PER_S / o->control_rate_hz);
    control_config.period_s = 1.0;

    scene s = {.o = o};
    bst_vec3 d0 = target_direction(&s, 0.0, true);
    bst_quat body = o->q_body_from_gcrf;
    if (body.x == 0.0 && body.y == 0.0 && body.z == 0.0 && body.w == 0.0) {
        body = bst_quat_look(d0, (bst_vec3){0, 1, 0.3});
    }
    /* the cue lies off by a rotation about body axes: a direction error along the image axes */
    s.cue_error = bst_quat_rotate(
        bst_quat_conj(bst_quat_look(d0, (bst_vec3){0, 1, 0.3})),
        bst_vec3_scale((bst_vec3){-o->cue_error_y_deg, o->cue_error_x_deg, 0.0}, BST_DEG_RAD));

    static bst_mount_two_axis plant;
    static bst_control control;
    bst_mount_two_axis_keys keys = {bst_rng_make_key(o->seed, 0, "loop", "jitter"),
                                    bst_rng_make_key(o->seed, 0, "loop", "attitude"),
                                    bst_rng_make_key(o->seed, 0, "loop", "encoder")};
    bst_rng_key noise_key = bst_rng_make_key(o->seed, 0, "loop", "measurement");
    double dt = (double)SIM_STEP_TICKS / SIM_TICKS_PER_S;
    bst_assert_ok(&ctx, bst_mount_two_axis_init(&ctx, &plant, &gimbal_config, body, SIM_PIXEL_RAD,
                                                dt, &keys));
    bst_control_env env = {.tick_rate_hz = SIM_TICKS_PER_S,
                           .pixel_rad = SIM_PIXEL_RAD,
                           .width_px = 1024,
                           .height_px = 1024,
                           .cue_at = cue_at,
                           .cue_direction_at = cue_direction_at,
                           .cue_user = &s};
    /* a controller that is restored designs its observer again */
    bst_assert_ok(&ctx, bst_memo_create(&ctx, &env.memo));
    if (o->configure) {
        o->configure(&control_config);
        env.frame_exposure_s = 0.5;
        env.frame_period_s = 1.0;
        env.frame_latency_s = o->frame_delay_s;
    }
    bst_assert_ok(&ctx, bst_control_init(&ctx, &control, &control_config, &env));

    int64_t steps = llround(o->duration_s / dt);
    double *errors = malloc(sizeof *errors * (size_t)(steps / PER_ERROR + 1));
    bst_tracks *tracks[PENDING];
    for (int i = 0; i < PENDING; i++) {
        tracks[i] = calloc(1, sizeof *tracks[i] + 4 * sizeof(bst_track));
        assert_non_null(tracks[i]);
    }
    bst_pointing_telemetry *telemetry =
        calloc(1, sizeof *telemetry + 3 * sizeof(bst_pointing_sample));
    assert_true(errors && telemetry);
    *r = (sim_result){.confirmed_s = INFINITY, .command_hash = UINT64_C(0xCBF29CE484222325)};
    int64_t updates = 0;
    tracker tracker_state = {0};
    exposure x = {0};
    /* commands on their way: visible 0.1 s after they were published */
    struct {
        int64_t tick;
        bst_los_command command;
    } way[WAY];
    int64_t sent = 0, arrived = 0;
    const int64_t command_delay = SIM_TICKS_PER_S / 10,
                  frame_delay = llround(o->frame_delay_s * SIM_TICKS_PER_S);
    bst_los_command current = {0};
    bool has_command = false;
    double search_from_s = 0.0;
    int64_t measured = 0, taken = 0, pending_tick[PENDING];
    double sum = 0.0, sum_track = 0.0, rate_before[2] = {0, 0};
    int64_t counted = 0, kept = 0, counted_track = 0, frames_after = 0, frames_held = 0;
    bst_vec3 apparent = d0, apparent_step = {0, 0, 0};

    for (int64_t n = 0; n < steps; n++) {
        int64_t tick = n * SIM_STEP_TICKS;
        double t = (double)tick / SIM_TICKS_PER_S;
        while (arrived < sent && way[arrived % WAY].tick + command_delay <= tick) {
            current = way[arrived++ % WAY].command;
            has_command = true;
        }
        bst_mount_two_axis_step(&plant, has_command ? &current : NULL,
                                (double)(tick - current.tick) / SIM_TICKS_PER_S, true);
        for (int a = 0; a < 2; a++) {
            double rate = plant.axis[a].rate_radps;
            r->rate_worst_radps = fmax(r->rate_worst_radps, fabs(rate));
            r->accel_worst_radps2 = fmax(r->accel_worst_radps2, fabs(rate - rate_before[a]) / dt);
            rate_before[a] = rate;
        }
        bst_nav_telemetry nav = nav_at(t, tick);
        if (n % 10 == 0) { /* the true apparent place, linear over 10 ms */
            bst_light light = light_of(&nav);
            bst_nav_telemetry nav2 = nav_at(t + 0.01, tick + 60);
            bst_light light2 = light_of(&nav2);
            apparent = bst_light_aberrate(&light, target_direction(&s, t, false));
            bst_vec3 next = bst_light_aberrate(&light2, target_direction(&s, t + 0.01, false));
            apparent_step = bst_vec3_scale(bst_vec3_sub(next, apparent), 0.1);
        }
        bst_vec3 place = bst_vec3_axpy(apparent, (double)(n % 10), apparent_step);
        bst_vec3 in_camera = bst_quat_rotate(plant.q_cam_from_gcrf, place);

        /* exposure from k to k + 0.5 s */
        int64_t phase = tick % SIM_TICKS_PER_S, frame = tick / SIM_TICKS_PER_S;
        if (phase <= SIM_TICKS_PER_S / 2) {
            if (phase == 0) {
                x = (exposure){.first = in_camera};
            }
            if (phase == SIM_TICKS_PER_S / 4) {
                x.q_tel_mid = plant.q_measured_from_gcrf;
                x.mid_tick = tick;
            }
            bst_vec3 e = bst_quat_to_rotvec(
                bst_quat_mul(plant.q_cam_from_gcrf, bst_quat_conj(plant.q_measured_from_gcrf)));
            x.error_sum = bst_vec3_add(x.error_sum, e);
            x.samples++;
            x.last = in_camera;
            bool lost = bst_rng_uniform(noise_key, (uint64_t)frame, 8) < o->drop_share ||
                        (t >= o->blackout_from_s && t < o->blackout_to_s);
            if (phase == SIM_TICKS_PER_S / 2) {
                if (!lost) {
                    measure(&s, &x, &tracker_state, frame, noise_key, tracks[measured % PENDING]);
                    pending_tick[measured++ % PENDING] = tick + frame_delay;
                }
                if (t > r->confirmed_s) {
                    frames_after++;
                    frames_held += control.mode == BST_MODE_TRACK && tracker_state.confirmed;
                }
            }
        }

        /* control at 20 Hz and whenever tracks arrive */
        bool due = taken < measured && tick >= pending_tick[taken % PENDING];
        if (tick % control_period == 0 || due) {
            telemetry->capacity = 3;
            telemetry->settled = plant.settled;
            telemetry->limited = plant.limited;
            telemetry->items[telemetry->written++ % 3] =
                (bst_pointing_sample){.tick = tick, .q_cam_from_gcrf = plant.q_measured_from_gcrf};
            if (o->restore_every > 0 && ++updates % o->restore_every == 0) {
                restore_control(&ctx, &control);
                r->restored++;
            }
            bst_control_telemetry(&control, telemetry, &nav);
            static bst_control was_control;
            copy_aim(&was_control, &control);
            bst_los_command before = sent ? way[(sent - 1) % WAY].command : current;
            if (due) {
                bst_assert_ok(&ctx,
                              bst_control_observe(&ctx, &control, tick, tracks[taken++ % PENDING]));
            }
            bool commanded;
            bst_los_command command;
            bst_control_status status;
            bst_assert_ok(&ctx,
                          bst_control_update(&ctx, &control, tick, &commanded, &command, &status));
            if (commanded) {
                way[sent % WAY].tick = tick;
                way[sent++ % WAY].command = command;
                r->command_hash = hash_command(r->command_hash, &command);
            }
            for (int i = 0; i < control.transition_count; i++) {
                int to = control.transitions[i].to;
                if (to == BST_MODE_SEARCH && r->mode_count[to] == 0) {
                    search_from_s = t;
                } else if (to == BST_MODE_SEARCH && r->mode_count[to] == 1 && r->sweep_s == 0.0) {
                    r->sweep_s = t - search_from_s;
                    r->search = was_control.search;
                }
                r->mode_count[to]++;
                if (getenv("LOOP_SIM_VERBOSE")) {
                    printf("%8.3f s %s -> %s: %s\n", t, bst_mode_name(control.transitions[i].from),
                           bst_mode_name(to), control.transitions[i].reason);
                }
                if (sent > 1 && commanded) {
                    r->worst_bump_px = fmax(
                        r->worst_bump_px, bump_px(&ctx, &was_control, &control, &before, &command));
                }
                if (to == BST_MODE_TRACK) {
                    double age = (double)(command.tick - before.tick) / SIM_TICKS_PER_S;
                    bst_vec3 was =
                        bst_vec3_axpy(before.direction_gcrf, age, before.rate_gcrf_radps);
                    r->worst_jump_px =
                        fmax(r->worst_jump_px,
                             bst_vec3_angle(was, command.direction_gcrf) / SIM_PIXEL_RAD);
                    if (t < r->confirmed_s) {
                        r->confirmed_s = t;
                    }
                }
            }
            control.transition_count = 0;
            r->tiles = control.search_step > r->tiles ? control.search_step : r->tiles;
        }
        if (t > r->confirmed_s) {
            double e = hypot(in_camera.x, in_camera.y) / SIM_PIXEL_RAD;
            if (counted++ % PER_ERROR == 0) {
                errors[kept++] = e;
            }
            sum += e * e;
            if (control.mode == BST_MODE_TRACK) {
                sum_track += e * e;
                counted_track++;
            }
        }
    }
    r->final_mode = control.mode;
    if (counted > 0) {
        r->rms_px = sqrt(sum / (double)counted);
        qsort(errors, (size_t)kept, sizeof *errors, by_value);
        r->p99_px = errors[(int64_t)(0.99 * (double)(kept - 1))];
    }
    r->rms_track_px = counted_track ? sqrt(sum_track / (double)counted_track) : 0.0;
    r->track_fraction = frames_after ? (double)frames_held / (double)frames_after : 0.0;
    free(errors);
    bst_memo_free(env.memo);
    for (int i = 0; i < PENDING; i++) {
        free(tracks[i]);
    }
    free(telemetry);
}
