/* Who saw what: passes, gaps, custody and errors of made-up messages. */
#include "sim/eval/sightings.h"
#include "tests/world/world_support.h"

#define FILE_ "\"elements_file\": \"scenarios/catalogue_2022-06.tle\""
#define SENSOR_ "\"sensors\": [{" TEST_CAMERA "}]"

static const char world_text[] =
    "{\"world\": {\"star_catalogue\": \"embedded\", \"catalogues\": [{" FILE_
    "}]}, \"observers\": [{\"name\": \"a\", \"orbit\": {" FILE_ ", \"norad\": 39089}, " SENSOR_
    "}, {\"name\": \"b\", \"orbit\": {" FILE_ ", \"norad\": 25544}, " SENSOR_ "}]}";

enum { RATE = 10 };

typedef struct fixture {
    bst_ctx ctx;
    bst_world *world;
    bst_sightings *sightings;
    bst_eval_pass passes[16];
    int pass_count;
    bst_sighting sums[16];
    int sum_count;
} fixture;

static bst_status keep_pass(void *user, bst_ctx *ctx, const bst_eval_pass *pass) {
    fixture *f = user;
    (void)ctx;
    assert_true(f->pass_count < 16);
    f->passes[f->pass_count++] = *pass;
    return BST_OK;
}

static bst_status keep_sum(void *user, bst_ctx *ctx, const bst_sighting *sum) {
    fixture *f = user;
    (void)ctx;
    assert_true(f->sum_count < 16);
    f->sums[f->sum_count++] = *sum;
    return BST_OK;
}

static void set_up(fixture *f, double custody_s) {
    *f = (fixture){.world = test_world(world_text)};
    bst_assert_ok(&f->ctx, bst_sightings_create(&f->ctx, f->world, RATE, custody_s, keep_pass, f,
                                                &f->sightings));
}

static void tear_down(fixture *f) {
    bst_sightings_free(f->sightings);
    bst_world_free(f->world);
}

/* A frame of one object with its detection and its track: the camera looks along its own +z axis,
 * GCRF; there is no aberration. */
typedef struct shot {
    int sensor, object;
    double seconds;
    bool dark, detected, taken_for_star, tracked;
    double off_px, track_off_arcsec;
} shot;

static void take(fixture *f, shot s) {
    static int64_t exposure;
    const bst_camera *camera = bst_world_camera(f->world, s.sensor, 0);
    double x = bst_camera_centre_x(camera) + 100.0, y = bst_camera_centre_y(camera);
    bst_vec3 d = bst_camera_unproject(camera, x, y);
    int64_t tick = (int64_t)(s.seconds * RATE);
    bst_truth *truth = test_calloc(1, sizeof *truth + sizeof truth->items[0]);
    *truth = (bst_truth){.exposure_id = ++exposure,
                         .start_tick = tick,
                         .end_tick = tick,
                         .sun_m = {1.5e11, 0, 0},
                         .count = s.object >= 0};
    truth->items[0] = (bst_truth_item){.kind = BST_SOURCE_OBJECT,
                                       .id = (uint32_t)s.object,
                                       .flags = BST_TRUTH_IN_FIELD,
                                       .x_centroid_px = x,
                                       .y_centroid_px = y,
                                       .electrons = s.dark ? 0.0 : 1000.0,
                                       .snr = s.dark ? 0.0 : 20.0 + s.seconds,
                                       .v_mag = 12.0,
                                       .range_m = 1e6 + s.seconds};
    bst_vec3_to_radec(d, &truth->items[0].ra_rad, &truth->items[0].dec_rad);
    bst_assert_ok(&f->ctx, bst_sightings_truth(&f->ctx, f->sightings, s.sensor, truth));
    bst_detections *found = test_calloc(1, sizeof *found + sizeof found->items[0]);
    *found = (bst_detections){.exposure_id = exposure, .count = s.detected};
    found->items[0] = (bst_detection){.x_px = x + s.off_px,
                                      .y_px = y,
                                      .label = s.taken_for_star ? BST_LABEL_STAR : BST_LABEL_OBJECT,
                                      .star_id = s.taken_for_star ? 7 : 0};
    bst_sightings_detections(f->sightings, s.sensor, found);
    bst_tracks *tracks = test_calloc(1, sizeof *tracks + sizeof tracks->items[0]);
    *tracks = (bst_tracks){.exposure_id = exposure,
                           .tick = tick,
                           .attitude = {.valid = true, .q_cam_from_gcrf = {0, 0, 0, 1}},
                           .count = s.tracked};
    bst_vec3 off = {0, s.track_off_arcsec * BST_ARCSEC_RAD, 0};
    tracks->items[0] = (bst_track){.status = BST_TRACK_CONFIRMED,
                                   .target_of_interest = true,
                                   .direction_gcrf = bst_vec3_unit(bst_vec3_add(d, off))};
    bst_sightings_tracks(f->sightings, s.sensor, tracks);
    test_free(truth);
    test_free(found);
    test_free(tracks);
}

static void passes_gaps_and_custody(void **state) {
    (void)state;
    fixture f;
    set_up(&f, 100.0);
    /* sensor 0 sees object 2 at 100, 110, 120 s, not at 130; again at 400 */
    for (int k = 0; k < 4; k++) {
        take(&f, (shot){.object = 2, .seconds = 100.0 + 10.0 * k, .detected = k < 3});
    }
    take(&f, (shot){.object = -1, .seconds = 300.0});
    assert_int_equal(f.pass_count, 1); /* it is over once 60 s have gone by */
    take(&f, (shot){.object = 2, .seconds = 400.0, .detected = true});
    /* sensor 1 sees it at 450 s, and object 3 in the dark, and one that it takes for a star */
    take(&f, (shot){.sensor = 1, .object = 2, .seconds = 450.0, .detected = true});
    take(&f, (shot){.sensor = 1, .object = 3, .seconds = 460.0, .dark = true});
    take(&f,
         (shot){
             .sensor = 1, .object = 4, .seconds = 470.0, .detected = true, .taken_for_star = true});
    bst_assert_ok(&f.ctx, bst_sightings_finish(&f.ctx, f.sightings, 1000.0));
    assert_int_equal(f.pass_count, 5);
    assert_int_equal(f.passes[0].frames, 4);
    assert_int_equal(f.passes[0].lit, 4);
    assert_int_equal(f.passes[0].detected, 3);
    /* times are tenths of seconds */
    bst_assert_close(f.passes[0].start_s, 100.0, 1e-9);
    bst_assert_close(f.passes[0].end_s, 130.0, 1e-9);
    bst_assert_close(f.passes[0].first_s, 100.0, 1e-9);
    bst_assert_close(f.passes[0].last_s, 120.0, 1e-9);
    bst_assert_close(f.passes[0].snr, 150.0, 1e-9);
    bst_assert_close(f.passes[0].range_m, 1e6 + 100.0, 1e-3);
    bst_assert_ok(&f.ctx, bst_sightings_each(&f.ctx, f.sightings, keep_sum, &f));
    assert_int_equal(f.sum_count, 7); /* 2: all, 0, 1; 3: all, 1; 4: all, 1 */
    const bst_sighting *all = &f.sums[0], *own = &f.sums[1];
    assert_int_equal(all->sensor, -1);
    assert_int_equal(all->object, 2);
    assert_int_equal(all->passes, 3);
    assert_int_equal(all->detected, 5);
    assert_int_equal(all->revisits, 1); /* 280 s; 50 s are no revisit */
    bst_assert_close(all->revisit_sum_s, 280.0, 1e-9);
    bst_assert_close(all->longest_gap_s, 550.0, 1e-9); /* to the end */
    /* 10 + 10 + 100 of 280 + 50 + 100 of the rest */
    bst_assert_close(all->custody_s, 270.0, 1e-9);
    assert_int_equal(own->sensor, 0);
    assert_int_equal(own->passes, 2);
    bst_assert_close(own->last_s, 400.0, 1e-9);
    bst_assert_close(own->longest_gap_s, 600.0, 1e-9);
    assert_int_equal(f.sums[3].object, 3);
    assert_int_equal(f.sums[3].lit, 0);
    assert_true(isnan(f.sums[3].first_s));
    bst_assert_close(f.sums[3].longest_gap_s, 1000.0, 1e-9);
    assert_int_equal(f.sums[5].detected, 0);
    bst_sightings_figures sum;
    bst_sightings_summary(f.sightings, &sum);
    assert_int_equal(sum.objects, 5);
    assert_int_equal(sum.in_field, 3);
    assert_int_equal(sum.seen, 1);
    assert_int_equal(sum.passes, 5);
    assert_int_equal(sum.passes_seen, 3);
    bst_assert_close(sum.custody_fraction, 0.27, 1e-12);
    bst_assert_close(sum.custody_fraction_all, 0.27 / 5.0, 1e-12);
    bst_assert_close(sum.gap_mean_s, 550.0, 1e-9);
    tear_down(&f);
}

static void errors_are_angles_to_the_truth(void **state) {
    (void)state;
    fixture f;
    set_up(&f, 100.0);
    take(&f, (shot){.object = 1,
                    .seconds = 0.0,
                    .detected = true,
                    .off_px = 0.3,
                    .tracked = true,
                    .track_off_arcsec = 0.5});
    take(&f, (shot){.object = 1,
                    .seconds = 2.0,
                    .detected = true,
                    .off_px = -0.4,
                    .tracked = true,
                    .track_off_arcsec = -1.2});
    /* a track 20 arcsec off is something else: 5 px are 15 */
    take(&f, (shot){.object = 1, .seconds = 4.0, .tracked = true, .track_off_arcsec = 20.0});
    bst_assert_ok(&f.ctx, bst_sightings_finish(&f.ctx, f.sightings, 10.0));
    assert_int_equal(f.pass_count, 1);
    const bst_eval_pass *pass = &f.passes[0];
    assert_int_equal(pass->detected, 2);
    assert_int_equal(pass->tracked, 2);
    assert_int_equal(pass->target, 2);
    /* 3 arcsec a pixel, less by the tangent's fall over 100 px: 2e-6 of it; light is deflected by
     * the Sun by 4 mas, which the frame's light takes out of what is seen */
    double rms = 3.0 * sqrt((0.09 + 0.16) / 2.0);
    bst_assert_close(bst_sighting_rms(&pass->place), rms, 0.01);
    bst_assert_close(pass->place.greatest, 1.2, 0.01);
    bst_assert_close(bst_sighting_rms(&pass->track), sqrt((0.25 + 1.44) / 2.0), 1e-6);
    tear_down(&f);
}

static void tasks_are_counted_by_their_ends(void **state) {
    (void)state;
    fixture f;
    set_up(&f, 100.0);
    const int ends[] = {BST_TASK_NONE, BST_TASK_DONE, BST_TASK_DONE, BST_TASK_LOST,
                        BST_TASK_NOT_FOUND};
    for (int i = 0; i < 5; i++) {
        bst_task task = {.id = i + 1, .object = i == 4 ? -1 : i, .before = ends[i]};
        bst_sightings_task(f.sightings, &task);
    }
    bst_assert_ok(&f.ctx, bst_sightings_finish(&f.ctx, f.sightings, 10.0));
    bst_sightings_figures sum;
    bst_sightings_summary(f.sightings, &sum);
    assert_int_equal(sum.tasks, 4);
    assert_int_equal(sum.tasks_done, 2);
    assert_int_equal(sum.tasks_not_found, 1);
    assert_int_equal(sum.tasks_lost, 1);
    assert_int_equal(sum.seen, 0);
    tear_down(&f);
}

/* Messages of a frame in which nothing is symmetric: a turned camera that moves, two objects, and
 * past the end of each list what would count if it were read. */
enum { ITEMS = 8 };
typedef struct messages {
    bst_truth *truth;
    bst_detections *found;
    bst_tracks *tracks;
} messages;

static messages make_messages(int64_t exposure, double seconds) {
    messages m = {test_calloc(1, sizeof *m.truth + ITEMS * sizeof m.truth->items[0]),
                  test_calloc(1, sizeof *m.found + ITEMS * sizeof m.found->items[0]),
                  test_calloc(1, sizeof *m.tracks + ITEMS * sizeof m.tracks->items[0])};
    int64_t tick = (int64_t)(seconds * RATE);
    *m.truth = (bst_truth){.exposure_id = exposure,
                           .start_tick = tick - 3,
                           .end_tick = tick + 3,
                           .sun_m = {-1e11, 1e11, 3e10},
                           .velocity_bary_mps = {11e3, -24e3, 14e3}};
    *m.found = (bst_detections){.exposure_id = exposure};
    *m.tracks = (bst_tracks){.exposure_id = exposure, .tick = tick, .attitude = {.valid = true}};
    return m;
}

static void give(fixture *f, int sensor, messages *m) {
    bst_assert_ok(&f->ctx, bst_sightings_truth(&f->ctx, f->sightings, sensor, m->truth));
    bst_sightings_detections(f->sightings, sensor, m->found);
    bst_sightings_tracks(f->sightings, sensor, m->tracks);
    test_free(m->truth);
    test_free(m->found);
    test_free(m->tracks);
}

/* Where a true direction is seen: v / c of aberration; its square is 1 mas. */
static bst_vec3 apparent(const bst_truth *truth, bst_vec3 direction) {
    return bst_vec3_unit(
        bst_vec3_axpy(direction, 1 / BST_LIGHT_SPEED_MPS, truth->velocity_bary_mps));
}

static void errors_on_both_axes_of_a_moving_camera(void **state) {
    (void)state;
    fixture f;
    set_up(&f, 100.0);
    const bst_camera *camera = bst_world_camera(f.world, 0, 0);
    bst_quat q = bst_quat_from_rotvec((bst_vec3){0.7, -1.1, 0.4});
    /* px of the detections' errors, arcsec of the tracks' */
    static const double off[][2] = {{0.3, -0.2}, {-0.1, 0.5}, {0, -0.6}};
    double sum2 = 0, greatest = 0;
    for (int k = 0; k < 3; k++) {
        messages m = make_messages(1000 + k, 10.0 * k);
        m.tracks->attitude.q_cam_from_gcrf = q;
        m.truth->count = 1;
        bst_vec3 seen = bst_quat_rotate(bst_quat_conj(q), bst_camera_unproject(camera, 300, 650));
        /* the true direction is where aberration leads to that place */
        bst_vec3 v = bst_vec3_scale(m.truth->velocity_bary_mps, -1 / BST_LIGHT_SPEED_MPS);
        bst_vec3 d = bst_vec3_unit(bst_vec3_axpy(v, -bst_vec3_dot(v, seen), seen));
        d = bst_vec3_unit(bst_vec3_add(
            seen,
            bst_vec3_scale(d, bst_vec3_norm(bst_vec3_axpy(v, -bst_vec3_dot(v, seen), seen)))));
        double x = 0, y = 0;
        assert_true(bst_camera_project(camera, bst_quat_rotate(q, apparent(m.truth, d)), &x, &y));
        bst_assert_close(hypot(x - 300, y - 650), 0, 1e-3);
        for (int i = 0; i < 2; i++) { /* the second is past the end */
            m.truth->items[i] = (bst_truth_item){.kind = BST_SOURCE_OBJECT,
                                                 .id = (uint32_t)(1 + i),
                                                 .flags = BST_TRUTH_IN_FIELD,
                                                 .x_centroid_px = x,
                                                 .y_centroid_px = y,
                                                 .electrons = 500,
                                                 .snr = 9.0 + (k == 1),
                                                 .v_mag = 12.0 - k,
                                                 .range_m = 1e6 - 1e3 * k};
            bst_vec3_to_radec(d, &m.truth->items[i].ra_rad, &m.truth->items[i].dec_rad);
        }
        m.found->count = 1;
        m.found->items[0] = (bst_detection){.x_px = x + off[k][0], .y_px = y + off[k][1]};
        m.found->items[1] = (bst_detection){.x_px = x, .y_px = y};
        /* two tracks near it: the nearer is its, though it comes first; then a tentative one and
         * one that has missed the frame, on the spot; then one past the end */
        bst_vec3 side = bst_vec3_unit(bst_vec3_cross(d, (bst_vec3){0.2, 0.5, -0.7}));
        m.tracks->count = 4;
        for (int i = 0; i < 5; i++) {
            double arcsec = i == 0 ? 2.0 + k : i == 1 ? 6.0 : 0.0;
            m.tracks->items[i] =
                (bst_track){.status = i == 2 ? BST_TRACK_TENTATIVE : BST_TRACK_CONFIRMED,
                            .misses_in_row = i == 3,
                            .target_of_interest = i != 0,
                            .direction_gcrf = bst_vec3_axpy(d, arcsec * BST_ARCSEC_RAD, side)};
        }
        give(&f, 0, &m);
        sum2 += 9 * (off[k][0] * off[k][0] + off[k][1] * off[k][1]);
        greatest = fmax(greatest, 3 * hypot(off[k][0], off[k][1]));
    }
    bst_assert_ok(&f.ctx, bst_sightings_finish(&f.ctx, f.sightings, 100.0));
    assert_int_equal(f.pass_count, 1);
    const bst_eval_pass *pass = &f.passes[0];
    assert_int_equal(pass->object, 1);
    assert_int_equal(pass->place.count, 3);
    /* the Sun bends light by 5 mas, and pixels 250 px out span 1e-5 less */
    bst_assert_close(bst_sighting_rms(&pass->place), sqrt(sum2 / 3), 0.02);
    bst_assert_close(pass->place.greatest, greatest, 0.02);
    assert_int_equal(pass->track.count, 3);
    bst_assert_close(bst_sighting_rms(&pass->track), sqrt((4 + 9 + 16) / 3.0), 1e-6);
    bst_assert_close(pass->track.greatest, 4, 1e-6);
    assert_int_equal(pass->target, 0); /* none of its tracks is the one of interest */
    /* of its best frame, and its nearest */
    bst_assert_close(pass->snr, 10, 0);
    bst_assert_close(pass->v_mag, 11, 0);
    bst_assert_close(pass->range_m, 998e3, 0);
    bst_sightings_figures sum;
    bst_sightings_summary(f.sightings, &sum);
    bst_assert_close(sum.place_rms_arcsec, sqrt(sum2 / 3), 0.02);
    bst_assert_close(sum.track_rms_arcsec, sqrt(29 / 3.0), 1e-6);
    assert_int_equal(sum.detections, 3);
    tear_down(&f);
}

/* A track belongs to one object: of two within reach of it, to the nearer one. */
static void a_track_of_two_objects(void **state) {
    (void)state;
    fixture f;
    set_up(&f, 100.0);
    messages m = make_messages(1, 10.0);
    bst_vec3 d = {0, 0, 1};
    m.tracks->attitude.q_cam_from_gcrf = BST_QUAT_IDENTITY;
    m.truth->count = 2;
    for (int i = 0; i < 2; i++) {
        bst_truth_item *o = &m.truth->items[i];
        *o = (bst_truth_item){.kind = BST_SOURCE_OBJECT,
                              .id = (uint32_t)(1 + i),
                              .flags = BST_TRUTH_IN_FIELD,
                              .electrons = 1000};
        /* 12 arcsec apart: 4 px, below the 5 px within which a track may be an object's */
        bst_vec3 at = bst_vec3_unit(bst_vec3_axpy(d, 12 * i * BST_ARCSEC_RAD, (bst_vec3){1, 0, 0}));
        bst_vec3_to_radec(at, &o->ra_rad, &o->dec_rad);
    }
    m.tracks->count = 1;
    m.tracks->items[0] = (bst_track){
        .status = BST_TRACK_CONFIRMED,
        .direction_gcrf = bst_vec3_unit(bst_vec3_axpy(d, BST_ARCSEC_RAD, (bst_vec3){0, 1, 0}))};
    give(&f, 0, &m);
    bst_assert_ok(&f.ctx, bst_sightings_finish(&f.ctx, f.sightings, 1000.0));
    assert_int_equal(f.pass_count, 2);
    assert_int_equal(f.passes[0].tracked, 1);
    bst_assert_close(f.passes[0].track.greatest, 1, 1e-6); /* rounding */
    assert_int_equal(f.passes[1].tracked, 0);
    tear_down(&f);
}

/* Hits, hot pixels and frames that are lost are no sightings; streaks count along their way. */
static void what_is_no_sighting(void **state) {
    (void)state;
    fixture f;
    set_up(&f, 100.0);
    const struct {
        int label;
        uint32_t star;
        bool dropped;
        double dx, x, y; /* the streak's length; the detection beside its middle */
        bool counts;
    } cases[] = {
        {BST_LABEL_OBJECT, 0, false, 0, 0, 0, true},
        {BST_LABEL_STAR, 0, false, 0, 0, 0, true}, /* a star by its rest, of no catalogue */
        {BST_LABEL_STAR, 9, false, 0, 0, 0, false},
        {BST_LABEL_HIT, 0, false, 0, 0, 0, false},
        {BST_LABEL_HOT_PIXEL, 0, false, 0, 0, 0, false},
        {BST_LABEL_OBJECT, 0, true, 0, 0, 0, false},
        {BST_LABEL_OBJECT, 0, false, 40, 19, 0, true},
        {BST_LABEL_OBJECT, 0, false, 40, 0, 19, false},
        {BST_LABEL_OBJECT, 0, false, -40, 0, 19, true}, /* negative: along y */
        {BST_LABEL_OBJECT, 0, false, -40, 19, 0, false},
        {BST_LABEL_OBJECT, 0, false, 0, 1.5, 1.2, true}, /* a width of 2 px */
        {BST_LABEL_OBJECT, 0, false, 0, 1.5, 1.5, false},
    };
    int64_t expected = 0;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        messages m = make_messages(2000 + (int64_t)i, 10.0 * (double)i);
        m.truth->count = 1;
        m.truth->dropped = cases[i].dropped;
        m.truth->items[0] = (bst_truth_item){.kind = BST_SOURCE_OBJECT,
                                             .id = 3,
                                             .flags = BST_TRUTH_IN_FIELD,
                                             .x_centroid_px = 200,
                                             .y_centroid_px = 300,
                                             .x_start_px = 200 - 0.5 * fmax(cases[i].dx, 0),
                                             .x_end_px = 200 + 0.5 * fmax(cases[i].dx, 0),
                                             .y_start_px = 300 + 0.5 * fmin(cases[i].dx, 0),
                                             .y_end_px = 300 - 0.5 * fmin(cases[i].dx, 0),
                                             .electrons = 10,
                                             .snr = 5};
        m.found->count = 1;
        m.found->items[0] = (bst_detection){.x_px = 200 + cases[i].x,
                                            .y_px = 300 + cases[i].y,
                                            .label = cases[i].label,
                                            .star_id = cases[i].star};
        m.tracks->attitude.valid = false;
        give(&f, 1, &m);
        expected += cases[i].counts;
    }
    /* not in the field, hidden, and a star: no pass of these */
    for (int i = 0; i < 3; i++) {
        messages m = make_messages(3000 + i, 200.0 + i);
        m.truth->count = 1;
        m.truth->items[0] =
            (bst_truth_item){.kind = i == 2 ? BST_SOURCE_STAR : BST_SOURCE_OBJECT,
                             .id = 4,
                             .flags = i == 0   ? 0
                                      : i == 1 ? BST_TRUTH_IN_FIELD | BST_TRUTH_OCCULTED
                                               : BST_TRUTH_IN_FIELD,
                             .electrons = 10};
        give(&f, 1, &m);
    }
    bst_assert_ok(&f.ctx, bst_sightings_finish(&f.ctx, f.sightings, 1000.0));
    assert_int_equal(f.pass_count, 1);
    assert_int_equal(f.passes[0].frames, 12);
    assert_int_equal(f.passes[0].detected, expected);
    assert_int_equal(f.passes[0].place.count, 0); /* no attitude to judge it by */
    bst_assert_close(f.passes[0].first_s, 0, 1e-12);
    bst_assert_close(f.passes[0].last_s, 100, 1e-12);
    tear_down(&f);
}

/* Times between the sightings of an object by any sensor, of two objects. */
static void revisits_of_several_objects(void **state) {
    (void)state;
    fixture f;
    set_up(&f, 50.0);
    static const struct {
        int object, sensor;
        double at;
    } seen[] = {{1, 0, 10}, {2, 1, 30}, {1, 1, 210}, {2, 0, 400}, {1, 0, 600}, {2, 0, 900}};
    for (size_t i = 0; i < sizeof seen / sizeof *seen; i++) {
        take(&f, (shot){.sensor = seen[i].sensor,
                        .object = seen[i].object,
                        .seconds = seen[i].at,
                        .detected = true,
                        .off_px = i == 4 ? 0.5 : 0.1});
    }
    bst_assert_ok(&f.ctx, bst_sightings_finish(&f.ctx, f.sightings, 1000.0));
    bst_sightings_figures sum;
    bst_sightings_summary(f.sightings, &sum);
    /* object 1: 200, 390 s; object 2: 370, 500 s */
    assert_int_equal(sum.revisits, 4);
    bst_assert_close(sum.revisit_mean_s, (200 + 390 + 370 + 500) / 4.0, 1e-9);
    bst_assert_close(sum.revisit_most_s, 500, 1e-9);
    bst_assert_close(sum.gap_mean_s, (400 + 500) / 2.0, 1e-9); /* to the end: 400; 500 */
    /* 50 s after each sighting */
    bst_assert_close(sum.custody_fraction, 0.15, 1e-12);
    bst_assert_close(sum.custody_fraction_all, 0.3 / 5, 1e-12);
    assert_int_equal(sum.seen, 2);
    assert_int_equal(sum.passes, 6);
    assert_int_equal(sum.passes_seen, 6);
    bst_assert_close(sum.place_rms_arcsec, 3 * sqrt((5 * 0.01 + 0.25) / 6), 0.01);
    tear_down(&f);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(passes_gaps_and_custody),
                                       cmocka_unit_test(errors_are_angles_to_the_truth),
                                       cmocka_unit_test(errors_on_both_axes_of_a_moving_camera),
                                       cmocka_unit_test(a_track_of_two_objects),
                                       cmocka_unit_test(what_is_no_sighting),
                                       cmocka_unit_test(revisits_of_several_objects),
                                       cmocka_unit_test(tasks_are_counted_by_their_ends)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
