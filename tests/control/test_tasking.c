/* The rule that gives sensors their targets, on a small catalogue. */
#include "tests/archive_support.h"
#include "tests/control/tasking_fixture.h"

/* A frame in which the target is tracked. */
static void tell_tracked(fixture *f, int sensor, int64_t tick) {
    bst_tracks *tracks = test_calloc(1, sizeof *tracks + sizeof tracks->items[0]);
    tracks->tick = tick;
    tracks->count = 1;
    tracks->items[0] = (bst_track){.status = BST_TRACK_CONFIRMED, .target_of_interest = true};
    bst_tasking_tracks(&f->tasking, sensor, tracks);
    test_free(tracks);
}

static void earth_and_sun_are_where_the_geometry_has_them(void **state) {
    (void)state;
    fixture f;
    start(&f,
          "{\"targets\": [{}], \"min_snr\": 0, \"max_rate_arcsec_per_s\": 1e6, "
          "\"sun_keep_out_deg\": 90, \"moon_keep_out_deg\": 40, "
          "\"earth_limb_keep_out_deg\": 8, \"earth_limb_altitude_km\": 100}");
    bst_world_view *view;
    bst_assert_ok(&f.ctx, bst_world_view_create(&f.ctx, f.world, &view));
    int reasons[BST_WHY_COUNT] = {0};
    for (double t = 0.0; t < 12000.0; t += 60.0) {
        for (int object = GX5; object <= GPS; object++) {
            bst_tasking_why expected = BST_WHY_NOT;
            bst_tasking_visibility seen;
            bst_assert_ok(&f.ctx, bst_tasking_look(&f.ctx, &f.tasking, 0, object, t, &seen));
            reasons[seen.why]++;
            bst_world_state eye, target;
            bst_bodies bodies;
            bst_assert_ok(&f.ctx, bst_world_view_observer_state(&f.ctx, view, 0, t, &eye));
            bst_assert_ok(&f.ctx, bst_world_view_object_state(&f.ctx, view, object, t, &target));
            bst_assert_ok(&f.ctx, bst_world_view_bodies(&f.ctx, view, t, &bodies));
            bst_vec3 to = bst_vec3_sub(target.position_m, eye.position_m);
            double limb = asin((6378137.0 + 1e5) / bst_vec3_norm(eye.position_m));
            double nadir = bst_vec3_angle(to, bst_vec3_scale(eye.position_m, -1.0));
            double sun = bst_vec3_angle(to, bst_vec3_sub(bodies.sun_m, eye.position_m));
            double earth_off = nadir - limb - 8.0 * BST_DEG_RAD, sun_off = sun - 90.0 * BST_DEG_RAD;
            /* light time and aberration move directions by up to 0.2 mrad: not judged there */
            double moon_off = bst_vec3_angle(to, bst_vec3_sub(bodies.moon_m, eye.position_m)) -
                              40.0 * BST_DEG_RAD;
            if (fabs(earth_off) < 1e-3 || fabs(sun_off) < 1e-3 || fabs(moon_off) < 1e-3) {
                continue;
            }
            expected = earth_off < 0.0  ? BST_WHY_EARTH
                       : sun_off < 0.0  ? BST_WHY_SUN
                       : moon_off < 0.0 ? BST_WHY_MOON
                                        : expected;
            if (expected == BST_WHY_NOT) {
                assert_true(seen.why == BST_WHY_NOT || seen.why == BST_WHY_SHADOW);
                double lit =
                    bst_astro_sun_fraction(target.position_m, bodies.sun_m, BST_EARTH_POLE_J2000);
                assert_true(seen.why == BST_WHY_SHADOW ? lit < 0.6 : lit > 0.4);
            } else {
                assert_int_equal(seen.why, expected);
            }
        }
    }
    assert_true(reasons[BST_WHY_NOT] > 50 && reasons[BST_WHY_EARTH] > 50 &&
                reasons[BST_WHY_SUN] > 5 && reasons[BST_WHY_MOON] > 5);
    bst_tasking_visibility seen;
    bst_assert_ok(&f.ctx, bst_tasking_look(&f.ctx, &f.tasking, 0, NEOSSAT_OBJECT, 0.0, &seen));
    assert_int_equal(seen.why, BST_WHY_ITSELF);
    bst_world_view_free(view);
    tear_down(&f);
}

static void faint_and_fast_ones_are_left_out(void **state) {
    (void)state;
    fixture f;
    start(&f, "{\"targets\": [{\"object\": \"INMARSAT GX5\"}], \"min_snr\": 8}");
    bst_tasking_visibility seen;
    bst_assert_ok(&f.ctx, bst_tasking_look(&f.ctx, &f.tasking, 0, GX5, 0.0, &seen));
    assert_int_equal(seen.why, BST_WHY_NOT);
    double enough = seen.snr;
    f.tasking.config.min_snr = 1.01 * enough;
    bst_assert_ok(&f.ctx, bst_tasking_look(&f.ctx, &f.tasking, 0, GX5, 0.0, &seen));
    assert_int_equal(seen.why, BST_WHY_FAINT);
    f.tasking.config.min_snr = 0.99 * enough;
    f.tasking.config.max_rate_arcsec_per_s = 10.0; /* it moves at about 50 */
    bst_assert_ok(&f.ctx, bst_tasking_look(&f.ctx, &f.tasking, 0, GX5, 0.0, &seen));
    assert_int_equal(seen.why, BST_WHY_RATE);
    tear_down(&f);
}

/* What the rule expects of a frame, by closed forms: noise of a pixel, the pixels that a point
 * fills (4 pi sigma^2, the pixel's own width added), electrons over both. */
static void noise_and_snr_are_the_cameras(void **state) {
    (void)state;
    fixture f;
    start(&f, "{\"targets\": [{}], \"min_snr\": 0}");
    const bst_camera *c = bst_knowledge_camera(f.knowledge[0]);
    double area = BST_PI / 4.0 * c->aperture_m * c->aperture_m;
    double v0 = c->photon_flux_v0_per_s_m2 * area * c->throughput * c->quantum_efficiency;
    double sky = v0 * pow(10.0, -0.4 * c->background_mag_arcsec2) * 9.0; /* 3 arcsec a pixel */
    double noise2 = 0.5 * (sky + 0.5) + c->read_noise_e * c->read_noise_e;
    double sigma = c->psf_fwhm_px / 2.3548200450309493;
    double pixels = 4.0 * BST_PI * (sigma * sigma + 1.0 / 12.0);
    bst_assert_close(f.tasking.sensors[0].noise_e, sqrt(noise2), 1e-9); /* rounding */
    bst_assert_close(f.tasking.sensors[0].pixels, pixels, 1e-9);
    bst_tasking_visibility seen;
    bst_assert_ok(&f.ctx, bst_tasking_look(&f.ctx, &f.tasking, 0, GX5, 0.0, &seen));
    assert_int_equal(seen.why, BST_WHY_NOT);
    double electrons = 0.5 * v0 * pow(10.0, -0.4 * seen.sight.v_mag);
    /* the object's light is of the Sun's colour, as the magnitude is */
    bst_assert_close(seen.snr, electrons / sqrt(noise2 * pixels), 1e-3 * seen.snr);

    /* a multiplication register, and dark current gathered while the frame is read */
    bst_detector_config *d = &((bst_camera *)c)->detector;
    d->em_gain = 4.0;
    d->clock_induced_e = 3.0;
    bst_tasking_noise(&f.tasking.sensors[0]);
    noise2 = 1.75 * (0.5 * (sky + 0.5) + 3.0) + c->read_noise_e * c->read_noise_e;
    bst_assert_close(f.tasking.sensors[0].noise_e, sqrt(noise2), 1e-9); /* rounding */
    tear_down(&f);
}

/* The greatest rate is that of the line of sight: differences over a second, forwards. */
static void the_rate_is_that_of_the_line_of_sight(void **state) {
    (void)state;
    fixture f;
    start(&f,
          "{\"targets\": [{}], \"min_snr\": 0, \"sun_keep_out_deg\": 0, \"moon_keep_out_deg\": 0, "
          "\"earth_limb_keep_out_deg\": 0}");
    bst_world_view *view;
    bst_assert_ok(&f.ctx, bst_world_view_create(&f.ctx, f.world, &view));
    bst_vec3 to[2];
    for (int k = 0; k < 2; k++) {
        bst_world_state eye, target;
        bst_assert_ok(&f.ctx, bst_world_view_observer_state(&f.ctx, view, 0, k, &eye));
        bst_assert_ok(&f.ctx, bst_world_view_object_state(&f.ctx, view, GX5, k, &target));
        to[k] = bst_vec3_sub(target.position_m, eye.position_m);
    }
    double rate = bst_vec3_angle(to[0], to[1]) / BST_ARCSEC_RAD;
    for (int slower = 0; slower < 2; slower++) {
        bst_tasking_visibility seen;
        /* light time changes the rate by some 1e-4 of itself; a second later it is another by more
         * than that */
        f.tasking.config.max_rate_arcsec_per_s = (slower ? 0.9997 : 1.0003) * rate;
        bst_assert_ok(&f.ctx, bst_tasking_look(&f.ctx, &f.tasking, 0, GX5, 0.0, &seen));
        assert_int_equal(seen.why, slower ? BST_WHY_RATE : BST_WHY_NOT);
    }
    bst_world_view_free(view);
    tear_down(&f);
}

/* A mount of five degrees of travel on a body that turns: it reaches the target when the body has
 * turned its zero there, 15 s after its telemetry, and not before. */
static void the_body_turns_on_after_its_telemetry(void **state) {
    (void)state;
    fixture f;
    start(&f,
          "{\"targets\": [{}], \"min_snr\": 0, \"sun_keep_out_deg\": 0, \"moon_keep_out_deg\": 0, "
          "\"earth_limb_keep_out_deg\": 0}");
    const bst_vec3 rates[3] = {{0.02, 0, 0}, {0, 0.02, 0}, {-0.01, 0.02, 0.01}};
    for (int k = 0; k < 3; k++) {
        bst_tasking_visibility seen;
        f.tasking.sensors[0].mount_known = false;
        bst_assert_ok(&f.ctx, bst_tasking_look(&f.ctx, &f.tasking, 0, GX5, 20.0, &seen));
        assert_int_equal(seen.why, BST_WHY_NOT);
        /* z on the target at 20 s; the body's coordinates turn against its own motion */
        bst_quat then = bst_quat_look(seen.sight.apparent, (bst_vec3){0.3, -0.5, 0.8});
        bst_mount_status mount = {.tick = 50, /* 5 s */
                                  .axes = 2,
                                  .q_body_from_cam_at_zero = BST_QUAT_IDENTITY,
                                  .q_body_from_gcrf = bst_quat_mul(
                                      bst_quat_from_rotvec(bst_vec3_scale(rates[k], 15.0)), then),
                                  .rate_body_radps = rates[k]};
        for (int a = 0; a < 2; a++) {
            mount.axis[a] = (bst_mount_axis){.axis_body = {a == 1, a == 0, 0},
                                             .rate_limit_radps = 10 * BST_DEG_RAD,
                                             .accel_limit_radps2 = 10 * BST_DEG_RAD,
                                             .min_rad = -5 * BST_DEG_RAD,
                                             .max_rad = 5 * BST_DEG_RAD};
        }
        bst_tasking_telemetry(&f.tasking, 0, NULL, &mount);
        const double times[3] = {20.0, 5.0, 35.0};
        for (int i = 0; i < 3; i++) {
            bst_assert_ok(&f.ctx, bst_tasking_look(&f.ctx, &f.tasking, 0, GX5, times[i], &seen));
            assert_int_equal(seen.why, i == 0 ? BST_WHY_NOT : BST_WHY_MOUNT);
        }
        mount.axes = 0; /* follows at once */
        bst_tasking_telemetry(&f.tasking, 0, NULL, &mount);
        bst_assert_ok(&f.ctx, bst_tasking_look(&f.ctx, &f.tasking, 0, GX5, 5.0, &seen));
        assert_int_equal(seen.why, BST_WHY_NOT);
    }
    /* nine tenths of an axis' rate may be used: the camera's x along the target's motion, so that
     * one axis makes all of it, the body at rest */
    bst_tasking_visibility now, later, seen;
    bst_assert_ok(&f.ctx, bst_tasking_look(&f.ctx, &f.tasking, 0, GX5, 0.0, &now));
    bst_assert_ok(&f.ctx, bst_tasking_look(&f.ctx, &f.tasking, 0, GX5, 1.0, &later));
    bst_vec3 moved = bst_vec3_sub(later.sight.apparent, now.sight.apparent);
    for (int enough = 0; enough < 2; enough++) {
        double limit = bst_vec3_norm(moved) / (enough ? 0.88 : 0.92);
        bst_mount_status mount = {.axes = 2,
                                  .q_body_from_cam_at_zero = BST_QUAT_IDENTITY,
                                  .q_body_from_gcrf = bst_quat_look(now.sight.apparent, moved)};
        for (int a = 0; a < 2; a++) {
            mount.axis[a] = (bst_mount_axis){.axis_body = {a == 1, a == 0, 0},
                                             .rate_limit_radps = limit,
                                             .accel_limit_radps2 = 10 * BST_DEG_RAD,
                                             .min_rad = -50 * BST_DEG_RAD,
                                             .max_rad = 50 * BST_DEG_RAD};
        }
        bst_tasking_telemetry(&f.tasking, 0, NULL, &mount);
        bst_assert_ok(&f.ctx, bst_tasking_look(&f.ctx, &f.tasking, 0, GX5, 0.0, &seen));
        assert_int_equal(seen.why, enough ? BST_WHY_NOT : BST_WHY_MOUNT);
    }
    assert_string_equal(bst_tasking_reason(BST_WHY_MOUNT), "out of the mount's reach");
    assert_string_equal(bst_tasking_reason(BST_WHY_NOT), "visible");
    assert_string_equal(bst_tasking_reason(-1), "unknown");
    assert_string_equal(bst_tasking_reason(BST_WHY_COUNT), "unknown");
    tear_down(&f);
}

static void the_first_line_that_fits_counts(void **state) {
    (void)state;
    fixture f;
    start(&f,
          "{\"targets\": [{\"perigee_km\": [35000, 36600]}, {\"object\": \"INMARSAT GX5\"}, "
          "{\"object\": \"GPS BIIR-4  (PRN 20)\"}, {\"apogee_km\": [30000, 1e9]}, "
          "{\"apogee_km\": [0, 1000], \"priority\": 0}]}");
    assert_int_equal(f.tasking.line[GX5], 0);
    assert_int_equal(f.tasking.line[GPS], 2);
    assert_int_equal(f.tasking.line[MOLNIYA], 3);
    assert_int_equal(f.tasking.line[ISS], -1); /* priority 0 */
    tear_down(&f);
    set_up(&f, "{\"targets\": [{\"object\": \"NOBODY\"}]}");
    assert_int_equal(bst_tasking_init(&f.ctx, &f.tasking, &f.config, f.members, 2, 10.0),
                     BST_ERR_CONFIG);
    assert_non_null(strstr(f.ctx.message, "targets/0/object: there is no object \"NOBODY\""));
    tear_down(&f);
}

static void one_target_goes_to_one_sensor_until_it_is_due_again(void **state) {
    (void)state;
    fixture f;
    start(&f,
          "{\"targets\": [{\"object\": \"INMARSAT GX5\", \"revisit_s\": 600, \"frames\": 3}], "
          "\"min_snr\": 0, \"sun_keep_out_deg\": 0, \"sigma_deg\": 0.3, "
          "\"rate_sigma_arcsec_per_s\": 0.75, \"v_mag_sigma\": 0.4}");
    assert_true(plan(&f, 0, 0));
    const bst_task *task = &f.tasking.sensors[0].task;
    bst_assert_close(task->sigma_rad, 0.3 * BST_DEG_RAD, 1e-15);
    bst_assert_close(task->rate_sigma_radps, 0.75 * BST_ARCSEC_RAD, 1e-18);
    bst_assert_close(task->v_mag_sigma, 0.4, 0);
    assert_int_equal(task->object, GX5);
    assert_int_equal(task->id, 1);
    assert_int_equal(task->norad, 44801);
    assert_int_equal(task->before, BST_TASK_NONE);
    assert_false(plan(&f, 1, 0)); /* taken */
    for (int64_t k = 1; k <= 3; k++) {
        assert_false(plan(&f, 0, 20 * k - 1));
        tell_tracked(&f, 0, 20 * k);
    }
    assert_true(plan(&f, 0, 61)); /* done, and nothing else is there */
    assert_int_equal(task->object, -1);
    assert_int_equal(task->before, BST_TASK_DONE);
    assert_false(plan(&f, 1, 200)); /* seen 14 s ago */
    assert_false(plan(&f, 1, 5990));
    assert_true(plan(&f, 1, 6100)); /* 604 s ago */
    assert_int_equal(f.tasking.sensors[1].task.object, GX5);
    tear_down(&f);
}

static void a_target_is_given_up_in_time(void **state) {
    (void)state;
    fixture f;
    start(&f,
          "{\"targets\": [{\"object\": \"INMARSAT GX5\", \"frames\": 100, \"revisit_s\": 1}], "
          "\"min_snr\": 0, \"settle_s\": 10, \"find_timeout_s\": 30, \"retry_s\": 100}");
    assert_true(plan(&f, 1, 0));
    const bst_task *task = &f.tasking.sensors[1].task;
    assert_int_equal(task->object, GX5);
    assert_false(plan(&f, 1, 399)); /* arrival at 10 s, and 30 s */
    assert_true(plan(&f, 1, 401));
    assert_int_equal(task->before, BST_TASK_NOT_FOUND);
    assert_int_equal(task->object, -1);
    assert_false(plan(&f, 1, 1395)); /* not before 100 s have gone by */
    assert_true(plan(&f, 1, 1505));
    tell_tracked(&f, 1, 1700);
    assert_false(plan(&f, 1, 1999)); /* seen at 170 s */
    assert_true(plan(&f, 1, 2001));
    assert_int_equal(task->before, BST_TASK_LOST);
    tear_down(&f);
}

/* What it says of the time in which nothing will change comes true, however often it is asked. */
static void quiet_times_are_kept(void **state) {
    (void)state;
    fixture f;
    start(&f,
          "{\"targets\": [{\"object\": \"INMARSAT GX5\", \"frames\": 5, \"revisit_s\": 1}], "
          "\"min_snr\": 0, \"settle_s\": 10, \"find_timeout_s\": 30, \"replan_interval_s\": 7}");
    f.tasking.sensors[1].period_s = 2.0;
    assert_true(plan(&f, 1, 0));
    assert_int_equal(bst_tasking_quiet_until(&f.tasking, 1), 80); /* four periods of five frames */
    assert_false(plan(&f, 1, 100));
    assert_int_equal(bst_tasking_quiet_until(&f.tasking, 1), 180);
    for (int frame = 0; frame < 4; frame++) {
        tell_tracked(&f, 1, 181 + 20 * frame);
        assert_false(plan(&f, 1, 182 + 20 * frame));
        assert_int_equal(bst_tasking_quiet_until(&f.tasking, 1), 182 + 60);
    }
    tell_tracked(&f, 1, 262);
    assert_true(plan(&f, 1, 270)); /* done */
    f.tasking.holder[GX5] = 0;
    f.tasking.sensors[1].task.object = -1;
    assert_false(plan(&f, 1, 500));
    assert_int_equal(bst_tasking_quiet_until(&f.tasking, 1), 570);
    tear_down(&f);
}

static void priority_and_waiting_decide(void **state) {
    (void)state;
    fixture f;
    start(&f,
          "{\"targets\": [{\"object\": \"INMARSAT GX5\", \"priority\": 1}, {\"object\": "
          "\"MOLNIYA 3-8\", \"priority\": 3}], \"min_snr\": 0, \"sun_keep_out_deg\": 0, "
          "\"moon_keep_out_deg\": 0, \"max_rate_arcsec_per_s\": 1e6, "
          "\"earth_limb_keep_out_deg\": 0}");
    /* a time at which the low one sees both */
    double t = 4000.0;
    bst_tasking_visibility a, b;
    for (; t < 24000.0; t += 60.0) {
        bst_tasking_visibility later_a, later_b;
        bst_assert_ok(&f.ctx, bst_tasking_look(&f.ctx, &f.tasking, 0, GX5, t, &a));
        bst_assert_ok(&f.ctx, bst_tasking_look(&f.ctx, &f.tasking, 0, MOLNIYA, t, &b));
        bst_assert_ok(&f.ctx, bst_tasking_look(&f.ctx, &f.tasking, 0, GX5, t + 120.0, &later_a));
        bst_assert_ok(&f.ctx,
                      bst_tasking_look(&f.ctx, &f.tasking, 0, MOLNIYA, t + 120.0, &later_b));
        if (a.why == BST_WHY_NOT && b.why == BST_WHY_NOT && later_a.why == BST_WHY_NOT &&
            later_b.why == BST_WHY_NOT) {
            break;
        }
    }
    assert_int_equal(a.why, BST_WHY_NOT);
    assert_true(plan(&f, 0, (int64_t)(10.0 * t)));
    assert_int_equal(f.tasking.sensors[0].task.object, MOLNIYA);
    /* the other has waited for longer than its wish by a factor of more than 3 */
    f.tasking.holder[MOLNIYA] = -1;
    f.tasking.sensors[0].task.object = -1;
    f.tasking.sensors[0].pointed = false;
    f.tasking.sensors[0].quiet_until = 0;
    f.tasking.seen_s[MOLNIYA] = t - 3700.0;
    f.tasking.seen_s[GX5] = 0.0;
    bst_tasking_line *lines = f.tasking.config.targets.items;
    lines[0].revisit_s = fmax(t / 3.9, 1.0);
    lines[1].revisit_s = 3600.0;
    assert_true(plan(&f, 0, (int64_t)(10.0 * t)));
    assert_int_equal(f.tasking.sensors[0].task.object, GX5);
    tear_down(&f);
}

static void a_survey_counts_every_target_once(void **state) {
    (void)state;
    fixture f;
    start(&f, "{\"targets\": [{}]}");
    bst_tasking_report r;
    bst_assert_ok(&f.ctx, bst_tasking_survey(&f.ctx, &f.tasking, 0.0, &r));
    int sum = r.visible;
    for (int i = 0; i < BST_WHY_COUNT; i++) {
        sum += r.why[i];
    }
    assert_int_equal(r.targets, 5);
    assert_int_equal(sum, 5);
    assert_int_equal(r.seen, 0);
    assert_int_equal(r.why[BST_WHY_NOT], 0);
    tear_down(&f);
}

/* A survey finds what the exact test finds, of every object: though the table of positions is up to
 * 4 s old, 12 km for GX5, which a spacecraft 30 km away then sees elsewhere. */
static void a_survey_agrees_with_the_exact_test(void **state) {
    (void)state;
    static const char *const offsets[] = {"-200000, -300000, 50000", "-10000, -27000, 8000"};
    static const char *const lists[] = {
        "{\"targets\": [{}], \"min_snr\": 0, \"max_rate_arcsec_per_s\": 1e6, "
        "\"sun_keep_out_deg\": 60, \"moon_keep_out_deg\": 60, \"earth_limb_keep_out_deg\": 20}",
        "{\"targets\": [{}], \"min_snr\": 0, \"max_rate_arcsec_per_s\": 1e6, "
        "\"earth_limb_keep_out_deg\": -20}"};
    int counts[BST_WHY_COUNT] = {0};
    for (int k = 0; k < 4; k++) {
        fixture f;
        char text[2048];
        snprintf(text, sizeof text, world_text, offsets[k % 2]);
        set_up_in(&f, test_world(text), lists[k / 2]);
        bst_assert_ok(&f.ctx, bst_tasking_init(&f.ctx, &f.tasking, &f.config, f.members, 2, 10.0));
        for (double t = 4.0; t < 86400.0; t += 131.9) {
            (void)bst_knowledge_places(f.knowledge[0], t, f.tasking.place_m[0],
                                       f.tasking.place_m[1], f.tasking.place_m[2]);
            for (int i = 0; i < 10; i++) {
                bst_tasking_visibility exact;
                bst_tasking_why why;
                if (i % 5 == 0) {
                    tell_place(&f, i / 5, t - 1.0); /* a second old */
                }
                bst_assert_ok(&f.ctx,
                              bst_tasking_look(&f.ctx, &f.tasking, i / 5, i % 5, t, &exact));
                bst_assert_ok(&f.ctx,
                              bst_tasking_survey_look(&f.ctx, &f.tasking, i / 5, i % 5, t, &why));
                assert_int_equal(why, exact.why);
                counts[why]++;
            }
        }
        tear_down(&f);
    }
    assert_true(counts[BST_WHY_NOT] > 100 && counts[BST_WHY_EARTH] > 100 &&
                counts[BST_WHY_SUN] > 100 && counts[BST_WHY_MOON] > 100 &&
                counts[BST_WHY_SHADOW] > 10);
}

static bst_status archive_tasking(void *tasking, bst_archive *archive) {
    return bst_tasking_archive(tasking, archive);
}

/* Replaces a tasking by a new one with its saved state. */
static void restore(fixture *f) {
    test_saved saved = test_save(archive_tasking, &f->tasking);
    bst_tasking_free(&f->tasking);
    bst_assert_ok(&f->ctx, bst_tasking_init(&f->ctx, &f->tasking, &f->config, f->members, 2, 10.0));
    bst_assert_ok(&f->ctx, test_restore(&f->ctx, archive_tasking, &f->tasking, saved));
    free(saved.bytes);
}

static const char busy_list[] =
    "{\"targets\": [{\"frames\": 3, \"revisit_s\": 60}], \"min_snr\": 0, \"sun_keep_out_deg\": "
    "40, \"max_rate_arcsec_per_s\": 1e6, \"find_timeout_s\": 20, \"retry_s\": 30}";

/* A tasking that is saved and restored before every plan gives the tasks that another one does. */
static void a_tasking_is_saved_and_restored(void **state) {
    (void)state;
    fixture f, g;
    start(&f, busy_list);
    start(&g, busy_list);
    const bst_mount_status mount = {.axes = 0, .q_body_from_gcrf = BST_QUAT_IDENTITY};
    bst_tasking_telemetry(&f.tasking, 1, NULL, &mount);
    bst_tasking_telemetry(&g.tasking, 1, NULL, &mount);
    int tasks = 0, lost = 0;
    for (int64_t tick = 0; tick < 6000; tick += 20) {
        for (int s = 0; s < 2; s++) {
            restore(&g);
            if (tick % 100 == 0 && f.tasking.sensors[s].task.object % 2 == 0) {
                tell_tracked(&f, s, tick);
                tell_tracked(&g, s, tick);
            }
            /* where the spacecraft is, is known from an earlier message in two of three plans */
            bool published = tick % 60 == 0, given, other;
            if (published) {
                tell_place(&f, s, (double)tick / 10.0);
                tell_place(&g, s, (double)tick / 10.0);
            }
            bst_assert_ok(&f.ctx, bst_tasking_plan(&f.ctx, &f.tasking, s, tick, &given));
            bst_assert_ok(&g.ctx, bst_tasking_plan(&g.ctx, &g.tasking, s, tick, &other));
            assert_int_equal(other, given);
            const bst_tasking_sensor *a = &f.tasking.sensors[s], *b = &g.tasking.sensors[s];
            assert_memory_equal(&a->task, &b->task, sizeof a->task);
            assert_int_equal(a->quiet_until, b->quiet_until);
            assert_true(a->next_plan_s == b->next_plan_s && a->given_s == b->given_s);
            assert_memory_equal(&a->nav, &b->nav, sizeof a->nav);
            assert_memory_equal(&a->mount, &b->mount, sizeof a->mount);
            assert_int_equal(a->mount_known, b->mount_known);
            tasks += given;
            lost += given && a->task.before != BST_TASK_DONE && a->task.before != BST_TASK_NONE;
        }
    }
    print_message("%d tasks, %d before them not done\n", tasks, lost);
    assert_true(tasks > 5 && lost > 0);
    bst_tasking_report a, b;
    bst_assert_ok(&f.ctx, bst_tasking_survey(&f.ctx, &f.tasking, 600.0, &a));
    bst_assert_ok(&g.ctx, bst_tasking_survey(&g.ctx, &g.tasking, 600.0, &b));
    assert_memory_equal(&a, &b, sizeof a);
    tear_down(&f);
    tear_down(&g);
}

static void damaged_tasks_are_refused(void **state) {
    (void)state;
    fixture f;
    start(&f, busy_list);
    (void)plan(&f, 0, 10);
    test_saved saved = test_save(archive_tasking, &f.tasking);
    test_restore_damaged(archive_tasking, &f.tasking, saved, 1);
    free(saved.bytes);
    bst_archive *archive;
    bst_assert_ok(&f.ctx, bst_archive_create(&f.ctx, &archive));
    f.tasking.sensors[1].task.object = f.tasking.object_count;
    assert_int_equal(bst_tasking_archive(&f.tasking, archive), BST_ERR_FORMAT);
    assert_non_null(strstr(f.ctx.message, "task of sensor 1"));
    bst_archive_free(archive);
    f.tasking.sensors[1].task.object = -1;
    tear_down(&f);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(earth_and_sun_are_where_the_geometry_has_them),
        cmocka_unit_test(faint_and_fast_ones_are_left_out),
        cmocka_unit_test(noise_and_snr_are_the_cameras),
        cmocka_unit_test(the_rate_is_that_of_the_line_of_sight),
        cmocka_unit_test(the_body_turns_on_after_its_telemetry),
        cmocka_unit_test(the_first_line_that_fits_counts),
        cmocka_unit_test(one_target_goes_to_one_sensor_until_it_is_due_again),
        cmocka_unit_test(a_target_is_given_up_in_time),
        cmocka_unit_test(quiet_times_are_kept),
        cmocka_unit_test(priority_and_waiting_decide),
        cmocka_unit_test(a_survey_counts_every_target_once),
        cmocka_unit_test(a_survey_agrees_with_the_exact_test),
        cmocka_unit_test(a_tasking_is_saved_and_restored),
        cmocka_unit_test(damaged_tasks_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
