/* Steps of `boresight process`: attitudes along streaks of a solver that answers from a script,
 * which end came first, zero points, and the pointing of frames with and without stars. */
#include <cjson/cJSON.h>

#include "sim/process/process_internal.h"
#include "tests/test_support.h"

enum { FRAMES = 3, PATH = 9 };
#define SCALE_ARCSEC 20.0
#define PX (SCALE_ARCSEC * BST_PI / 648000.0)

static struct {
    bst_plate_solve_result result[FRAMES];
    int64_t selected;
    bool flipped, needs_flip; /* rows as they are read; stars are found in those only */
    double v_limit;           /* that the catalogue, the solver and the zero points are to have */
    bst_imgproc_expected_star expected[8];
    int expected_count;
    bst_predicted_stars_query query;
} script;

#define WRAP(type, name, arguments) \
    type __wrap_##name arguments;   \
    type __wrap_##name arguments

WRAP(bst_status, bst_stars_open, (bst_ctx * ctx, const char *path, bst_stars **out)) {
    (void)ctx;
    (void)path;
    *out = NULL;
    return BST_OK;
}

WRAP(bst_status, bst_star_patterns_create,
     (bst_ctx * ctx, const bst_stars *stars, const bst_star_patterns_options *options,
      bst_star_patterns **out)) {
    (void)ctx;
    (void)stars;
    /* the smaller side's angle */
    bst_assert_close(options->field_rad, 2.0 * atan(0.5 * 400.0 * PX), 1e-12);
    bst_assert_close(options->v_limit, script.v_limit, 0.0);
    *out = NULL;
    return BST_OK;
}

WRAP(bst_status, bst_predicted_stars_create,
     (bst_ctx * ctx, const bst_camera *camera, const bst_stars *stars, double julian_year,
      int capacity, bst_predicted_stars *out)) {
    (void)ctx;
    (void)stars;
    (void)capacity;
    *out = (bst_predicted_stars){
        .camera = camera, .julian_year = julian_year, .expected = script.expected};
    return BST_OK;
}

WRAP(void, bst_predicted_stars_free, (bst_predicted_stars * sky)) {
    sky->expected = NULL;
}

WRAP(bst_status, bst_predicted_stars_expect,
     (bst_ctx * ctx, bst_predicted_stars *sky, const bst_predicted_stars_query *query,
      int *count)) {
    (void)ctx;
    (void)sky;
    script.query = *query;
    *count = script.expected_count;
    return BST_OK;
}

WRAP(bst_status, bst_lost_in_space_create,
     (bst_ctx * ctx, const bst_camera *camera, const bst_stars *stars,
      const bst_star_patterns *patterns, double julian_year, int capacity,
      bst_lost_in_space **out)) {
    (void)ctx;
    (void)camera;
    (void)stars;
    (void)patterns;
    (void)julian_year;
    (void)capacity;
    *out = NULL;
    return BST_OK;
}

WRAP(bst_status, bst_recorded_frames_select,
     (bst_ctx * ctx, bst_recorded_frames *frames, int64_t index,
      const bst_recorded_options *options, bst_recorded_frame *out)) {
    (void)ctx;
    (void)frames;
    script.selected = index;
    script.flipped = options->flip_rows;
    *out = (bst_recorded_frame){.width = 600, .height = 400};
    return BST_OK;
}

WRAP(bst_status, bst_recorded_frames_pixels,
     (bst_ctx * ctx, bst_recorded_frames *frames, const bst_recorded_options *options,
      bst_recorded_frame *frame, const float **pixels)) {
    (void)ctx;
    (void)frames;
    (void)options;
    (void)frame;
    *pixels = NULL;
    return BST_OK;
}

WRAP(bst_status, bst_plate_solve,
     (bst_ctx * ctx, bst_lost_in_space *lost, const bst_plate_solve_options *options,
      const float *pixels, int width, int height, bst_plate_solve_result *out)) {
    (void)ctx;
    (void)lost;
    (void)pixels;
    assert_int_equal(width, 600);
    assert_int_equal(height, 400);
    bst_assert_close(options->tangent_per_px, PX, 1e-15);
    bst_assert_close(options->v_limit, script.v_limit, 0.0);
    bst_assert_close(options->scale_tolerance, 0.07, 0.0);
    bst_assert_close(options->least_snr, 13.5, 0.0);
    *out = script.flipped == script.needs_flip ? script.result[script.selected]
                                               : (bst_plate_solve_result){.stars = 5};
    return BST_OK;
}

static const bst_quat start_attitude = {0.3 / 0.93273790530888, -0.5 / 0.93273790530888,
                                        0.2 / 0.93273790530888, 0.7 / 0.93273790530888};

static bst_quat turned(bst_quat q, double x, double y, double z) {
    return bst_quat_unit(bst_quat_mul(bst_quat_from_rotvec((bst_vec3){x, y, z}), q));
}

/* A streak along (3, 4) that is bent, brighter at its right end: the image of a star. */
static void set_result(int i, bst_quat middle, double scale) {
    bst_plate_solve_result *r = &script.result[i];
    *r = (bst_plate_solve_result){
        .stars = 30 + i,
        .ends = {{.x_px = -12.0, .y_px = -16.0}, {.x_px = 12.0, .y_px = 16.0}},
        .path = {.count = PATH, .ends = {{-12.0, -16.0}, {12.0, 16.0}}}};
    r->attitude = (bst_lost_in_space_result){.solved = true,
                                             .q_cam_from_gcrf = middle,
                                             .scale = scale,
                                             .rms_px = 0.2 + i,
                                             .matched = 20 + i,
                                             .predicted = 25 + i};
    for (int k = 0; k < PATH; k++) {
        double u = (k - 4.0) / 4.5;
        r->path.place[k][0] = 12.0 * u - 1.0 + u * u;
        r->path.place[k][1] = 16.0 * u + 0.5;
        r->path.light[k] = 1.0 + 0.1 * k;
    }
    r->matched_count = 3;
    r->matched[0] = (bst_plate_solve_star){100.0, 50.0, 400.0};
    r->matched[1] = (bst_plate_solve_star){200.0, 350.0, 1000.0};
    r->matched[2] = (bst_plate_solve_star){500.0, 90.0, 250.0};
}

static bst_process_request request = {
    .catalogue = "embedded", .v_limit = 9.5, .scale_tolerance = 0.07, .least_snr = 13.5};
static bst_process_frame frames[FRAMES];

static bst_process make(void) {
    bst_time start;
    bst_ctx ctx = {0};
    bst_assert_ok(&ctx, bst_time_from_utc(&ctx, "2024-01-01T12:00:00Z", &start));
    for (int i = 0; i < FRAMES; i++) {
        free(frames[i].nodes);
        frames[i] = (bst_process_frame){.index = i,
                                        .values = {.start = bst_time_add(start, 10.0 * i),
                                                   .exposure_s = 4.0,
                                                   .gain_e_per_dn = 2.0},
                                        .start_tick = 100000 * i,
                                        .exposure_ticks = 40000};
    }
    return (bst_process){.request = &request,
                         .frames = frames,
                         .count = FRAMES,
                         .map.star_limit_v_mag = 8.25,
                         .width = 600,
                         .height = 400,
                         .scale_arcsec = SCALE_ARCSEC};
}

/* Stars of the catalogue: at the first two places of the solver, a fainter one beside the first. */
static void set_expected(void) {
    script.expected[0] = (bst_imgproc_expected_star){.x_px = 101.0, .y_px = 52.0, .v_mag = 9.0};
    script.expected[1] = (bst_imgproc_expected_star){.x_px = 99.0, .y_px = 50.0, .v_mag = 8.0};
    script.expected[2] = (bst_imgproc_expected_star){.x_px = 203.0, .y_px = 352.0, .v_mag = 7.5};
    script.expected[3] = (bst_imgproc_expected_star){.x_px = 505.0, .y_px = 90.0, .v_mag = 6.0};
    script.expected_count = 4;
}

static void attitudes_along_the_streaks(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_process p = make();
    static const double scales[FRAMES] = {1.01, 1.03, 1.02};
    /* from frame to frame stars move by (3, 4), then back: the camera turns about (4, -3) */
    const double away[FRAMES] = {0.0, 200.0, 100.0};
    for (int i = 0; i < FRAMES; i++) {
        set_result(i, turned(start_attitude, -0.8 * PX * away[i], 0.6 * PX * away[i], 0.0),
                   scales[i]);
    }
    set_expected();
    script.v_limit = 9.5;
    bst_assert_ok(&ctx, bst_process_solve(&ctx, &p));
    assert_int_equal(p.solved, FRAMES);
    assert_true(p.direction_known);
    bst_assert_close(p.scale_arcsec, SCALE_ARCSEC * 1.02, 1e-12);
    bst_camera camera = {.width_px = 601, .height_px = 401};
    for (int i = 0; i < FRAMES; i++) {
        const bst_process_frame *f = &frames[i];
        const bst_plate_solve_result *r = &script.result[i];
        assert_int_equal(f->node_count, PATH); /* both ends, and all but the outer samples */
        assert_int_equal(f->found, 30 + i);
        assert_int_equal(f->matched, 20 + i);
        assert_int_equal(f->predicted, 25 + i);
        bst_assert_close(f->rms_px, 0.2 + i, 0.0);
        bst_assert_close(f->streak_px, 40.0, 1e-12);
        /* only the first moves on in the direction of its streak; the others come back */
        assert_int_equal(f->reversed, i > 0);
        camera.pixel_scale_arcsec = SCALE_ARCSEC * scales[i];
        double light = 0.0, all = 0.0;
        for (int k = 0; k < PATH; k++) {
            all += r->path.light[k];
        }
        for (int k = 0; k < PATH; k++) {
            const bst_process_node *n = &f->nodes[i > 0 ? PATH - 1 - k : k];
            bool end = k == 0 || k == PATH - 1;
            double share = k == 0          ? 0.0
                           : k == PATH - 1 ? 1.0
                                           : (light + 0.5 * r->path.light[k]) / all;
            const double *place = end ? r->path.ends[k > 0] : r->path.place[k];
            light += r->path.light[k];
            bst_assert_close(n->share, i > 0 ? 1.0 - share : share, 1e-12);
            /* a star at the frame's middle is there then */
            bst_vec3 star = bst_quat_rotate(bst_quat_conj(f->q_middle), (bst_vec3){0, 0, 1});
            double x, y;
            assert_true(
                bst_camera_project(&camera, bst_quat_rotate(n->q_cam_from_gcrf, star), &x, &y));
            bst_assert_close(x - 300.0, place[0], 1e-6);
            bst_assert_close(y - 200.0, place[1], 1e-6);
        }
    }
    /* two stars: 8 + 2.5 log10(200), 7.5 + 2.5 log10(500): the higher of two; one is 5 px off */
    double zero = fmax(8.0 + 2.5 * log10(200.0), 7.5 + 2.5 * log10(500.0));
    bst_assert_close(frames[1].zero_point_mag, zero, 1e-12);
    bst_assert_close(p.zero_point_mag, zero, 1e-12);
    bst_assert_close(script.query.v_limit, 11.5, 0.0);
    assert_int_equal(script.query.window.width, 600);
    assert_int_equal(script.query.window.height, 400);
}

/* Rows are read from the other end if no frame has stars so, unless the request names their order;
 * what a WCS says of the attitude is of the order in which the headers were read. */
static void order_of_rows(void **state) {
    (void)state;
    static const struct {
        int request;
        bool needs, found, flipped; /* `flipped`: in the end */
        int attitude;
        bool keeps; /* the header's attitude */
    } rows[] = {{BST_PROCESS_FLIP_AUTO, false, true, false, BST_KEYWORD_WCS, true},
                {BST_PROCESS_FLIP_AUTO, true, true, true, BST_KEYWORD_WCS, false},
                {BST_PROCESS_FLIP_AUTO, true, true, true, BST_KEYWORD_QUATERNION, true},
                {BST_PROCESS_FLIP_NO, true, false, false, BST_KEYWORD_WCS, true},
                {BST_PROCESS_FLIP_YES, true, true, true, BST_KEYWORD_WCS, true},
                {BST_PROCESS_FLIP_AUTO, true, false, false, BST_KEYWORD_WCS, true}};
    for (size_t k = 0; k < sizeof rows / sizeof *rows; k++) {
        bst_ctx ctx = {0};
        bst_process p = make();
        bool starless = rows[k].needs && !rows[k].found;
        for (int i = 0; i < FRAMES; i++) {
            set_result(i, start_attitude, 1.0);
            script.result[i].attitude.solved = !starless;
            frames[i].has_header_attitude = true;
            frames[i].q_header = start_attitude;
        }
        script.needs_flip = rows[k].needs;
        script.v_limit = request.v_limit;
        request.flip = rows[k].request;
        p.options.flip_rows = rows[k].request == BST_PROCESS_FLIP_YES; /* as the survey has it */
        p.map.attitude = rows[k].attitude;
        bst_assert_ok(&ctx, bst_process_solve(&ctx, &p));
        assert_int_equal(p.solved, rows[k].found ? FRAMES : 0);
        assert_int_equal(p.options.flip_rows, rows[k].flipped);
        assert_int_equal(frames[1].has_header_attitude, rows[k].keeps);
    }
    request.flip = BST_PROCESS_FLIP_AUTO;
    script.needs_flip = false;
}

/* Without a limit in the request that of the map holds. */
static void limits_of_request_and_map(void **state) {
    (void)state;
    for (int given = 0; given < 2; given++) {
        bst_ctx ctx = {0};
        bst_process p = make();
        for (int i = 0; i < FRAMES; i++) {
            script.result[i] = (bst_plate_solve_result){.stars = 5};
        }
        set_result(1, start_attitude, 1.0);
        request.v_limit =
            given ? 7.75 : 0.0; /* brighter than the map's, in the first test fainter */
        script.v_limit = given ? 7.75 : 8.25;
        bst_assert_ok(&ctx, bst_process_solve(&ctx, &p));
        bst_assert_close(script.query.v_limit, script.v_limit + 2.0, 0.0);
        assert_int_equal(p.solved, 1);
    }
    request.v_limit = 9.5;
}

/* Rate of turn of the camera by the header's history: it accelerates from share to share. */
static void rates_tell_which_end_came_first(void **state) {
    (void)state;
    for (int trial = 0; trial < 4; trial++) {
        bst_process_node nodes[5];
        bst_process_frame f = {.nodes = nodes, .node_count = 5, .rate_trend_sigma = 0.01};
        double angle = 0.0;
        for (int k = 0; k < 5; k++) {
            double share = k / 4.0;
            angle = 0.01 * (share + 0.2 * share * share); /* rate 1 + 0.4 share */
            nodes[k] = (bst_process_node){share, turned(start_attitude, angle, 0.0, 0.0)};
        }
        f.rate_trend = trial == 0 ? 0.33 : trial == 1 ? -0.33 : trial == 2 ? 0.049 : -0.33;
        f.rate_trend_sigma = trial == 3 ? 0.12 : 0.01;
        assert_int_equal(bst_process_orient_by_rates(&f), trial < 2);
        assert_int_equal(f.reversed, trial == 1);
        bst_vec3 first = bst_process_turn(nodes[0].q_cam_from_gcrf, nodes[1].q_cam_from_gcrf);
        double whole = 0.012, quarter = 0.01 * (0.25 + 0.2 / 16.0),
               last = whole - 0.01 * (0.75 + 0.2 * 9.0 / 16.0);
        bst_assert_close(first.x, trial == 1 ? -last : quarter, 1e-12);
        bst_assert_close(nodes[1].share, 0.25, 1e-15);
    }
    /* a camera that turns evenly has no trend to see */
    bst_process_node even[3];
    bst_process_frame f = {.nodes = even, .node_count = 3, .rate_trend = 0.3};
    for (int k = 0; k < 3; k++) {
        even[k] = (bst_process_node){0.5 * k, turned(start_attitude, 0.0, 0.01 * k, 0.0)};
    }
    assert_false(bst_process_orient_by_rates(&f));
}

static double at(const cJSON *array, int i) {
    const cJSON *item = cJSON_GetArrayItem(array, i);
    assert_non_null(item);
    return cJSON_IsNumber(item) ? item->valuedouble : strtod(item->valuestring, NULL);
}

static double number(const cJSON *object, const char *key) {
    const cJSON *item = cJSON_GetObjectItem(object, key);
    assert_non_null(item);
    return cJSON_IsNumber(item) ? item->valuedouble : strtod(item->valuestring, NULL);
}

static void expect_quat(const cJSON *node, bst_quat q) {
    const cJSON *array = cJSON_GetObjectItem(node, "q_cam_from_gcrf");
    double sign = at(array, 3) * q.w < 0.0 ? -1.0 : 1.0;
    bst_assert_close(at(array, 0), sign * q.x, 1e-12);
    bst_assert_close(at(array, 1), sign * q.y, 1e-12);
    bst_assert_close(at(array, 2), sign * q.z, 1e-12);
    bst_assert_close(at(array, 3), sign * q.w, 1e-12);
}

/* Pointing of a solved streak, of a frame without stars between two others, and of points; the
 * observer at both ends of an exposure. */
static void pointing_of_frames(void **state) {
    (void)state;
    bst_process p = make();
    bst_process_node *nodes = calloc(3, sizeof *nodes);
    nodes[0] = (bst_process_node){0.0, turned(start_attitude, -0.01, 0.0, 0.0)};
    nodes[1] = (bst_process_node){0.3, turned(start_attitude, 0.002, 0.001, 0.0)};
    nodes[2] = (bst_process_node){1.0, turned(start_attitude, 0.01, 0.0, 0.0)};
    frames[0].nodes = nodes;
    frames[0].node_count = 3;
    frames[0].solved = frames[2].solved = true;
    frames[0].q_middle = start_attitude;
    frames[2].q_middle = turned(start_attitude, 0.2, -0.1, 0.0);
    frames[1].start_tick = 60000; /* 6 s of 20 s */
    frames[1].values.has_position = frames[1].values.has_velocity = true;
    const bst_vec3 r = {7e6, 1e6, -2e6}, v = {1000.0, 7000.0, 500.0};
    frames[1].values.position_gcrf_m = r;
    frames[1].values.velocity_gcrf_mps = v;
    cJSON *root = bst_process_make_pointing(&p);
    const cJSON *list = cJSON_GetObjectItem(root, "frames"), *f = list->child;
    assert_int_equal(cJSON_GetArraySize(list), FRAMES);
    bst_assert_close(number(f, "exposure_s"), 4.0, 0.0);
    bst_assert_close(number(f, "period_s"), 6.0, 0.0);
    const cJSON *pointing = cJSON_GetObjectItem(f, "pointing")->child;
    for (int k = 0; k < 3; k++, pointing = pointing->next) {
        bst_assert_close(number(pointing, "time_s"), k == 1 ? 1.2 : 2.0 * k, 1e-12);
        expect_quat(pointing, nodes[k].q_cam_from_gcrf);
    }
    assert_null(pointing);
    f = f->next;
    bst_assert_close(number(f, "period_s"), 14.0, 0.0);
    expect_quat(cJSON_GetObjectItem(f, "pointing")->child,
                turned(start_attitude, 0.3 * 0.2, 0.3 * -0.1, 0.0));
    /* the way of the observer in 2 s before and after mid-exposure, under the Earth's pull */
    const cJSON *eye = cJSON_GetObjectItem(f, "objects")->child;
    double range = bst_vec3_norm(r), pull = -3.986004415e14 / (range * range * range);
    for (int end = 0; end < 2; end++) {
        const cJSON *place = cJSON_GetObjectItem(eye, end ? "end_position_m" : "start_position_m");
        const cJSON *speed =
            cJSON_GetObjectItem(eye, end ? "end_velocity_mps" : "start_velocity_mps");
        double t = end ? 2.0 : -2.0;
        bst_assert_close(at(place, 0), r.x + t * v.x + 2.0 * pull * r.x, 1e-6);
        bst_assert_close(at(place, 1), r.y + t * v.y + 2.0 * pull * r.y, 1e-6);
        bst_assert_close(at(place, 2), r.z + t * v.z + 2.0 * pull * r.z, 1e-6);
        bst_assert_close(at(speed, 0), v.x + t * pull * r.x, 1e-9);
        bst_assert_close(at(speed, 1), v.y + t * pull * r.y, 1e-9);
        bst_assert_close(at(speed, 2), v.z + t * pull * r.z, 1e-9);
    }
    f = f->next;
    bst_assert_close(number(f, "period_s"), 6.0, 0.0); /* the exposure and 2 s */
    expect_quat(cJSON_GetObjectItem(f, "pointing")->child, frames[2].q_middle);
    /* without a position: behind the camera the Earth, at the distance of geostationary orbits */
    const cJSON *place =
        cJSON_GetObjectItem(cJSON_GetObjectItem(f, "objects")->child, "start_position_m");
    bst_vec3 ahead = bst_quat_rotate(bst_quat_conj(frames[2].q_middle), (bst_vec3){0, 0, 1});
    bst_assert_close(at(place, 0), 42164e3 * ahead.x, 1e-3);
    bst_assert_close(at(place, 1), 42164e3 * ahead.y, 1e-3);
    bst_assert_close(at(place, 2), 42164e3 * ahead.z, 1e-3);
    cJSON_Delete(root);
    /* 2024-01-01T12:00:69.184 TT: 8766 days after J2000 */
    bst_assert_close(bst_process_julian_year(&frames[0]),
                     2000.0 + (8766.0 + 69.184 / 86400.0) / 365.25, 1e-9);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(attitudes_along_the_streaks),
        cmocka_unit_test(limits_of_request_and_map),
        cmocka_unit_test(order_of_rows),
        cmocka_unit_test(rates_tell_which_end_came_first),
        cmocka_unit_test(pointing_of_frames),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
