/* Frames of a measurement of detection, of a scene that is set by hand: each target's cell, path,
 * motion and light. */
#include "boresight/vec.h"
#include "sim/analysis/pd/pd.h"
#include "sim/world/scene/field.h"
#include "tests/test_support.h"

enum { COLUMNS = 4, ROWS = 3, ROOM = COLUMNS * ROWS };

typedef struct fixture {
    bst_scenario scenario;
    bst_pd_scene scene;
    bst_pd_frame frame;
    bst_eval_match_target places[ROOM];
    bst_pd_target targets[ROOM];
    bst_scene_source sources[ROOM];
    bst_scene_source_path paths[ROOM];
} fixture;

/* A sky that grows across the frame, unlike in x and y, without stars. */
static double sky_at(double x_px, double y_px) {
    return 40.0 + 0.3 * x_px + 0.05 * y_px;
}

double __wrap_bst_pd_sky_e(const bst_pd_sky *sky, double x_px, double y_px);
double __wrap_bst_pd_sky_e(const bst_pd_sky *sky, double x_px, double y_px) {
    assert_non_null(sky);
    return sky_at(x_px, y_px);
}

bst_quat __wrap_bst_pd_sky_attitude(const bst_pd_sky *sky, double roll_rad);
bst_quat __wrap_bst_pd_sky_attitude(const bst_pd_sky *sky, double roll_rad) {
    (void)sky, (void)roll_rad;
    return BST_QUAT_IDENTITY;
}

bst_status __wrap_bst_pd_sky_look(bst_ctx *ctx, bst_pd_sky *sky, const bst_los_track *track,
                                  const bst_scene_source **stars, int *count);
bst_status __wrap_bst_pd_sky_look(bst_ctx *ctx, bst_pd_sky *sky, const bst_los_track *track,
                                  const bst_scene_source **stars, int *count) {
    static const bst_scene_source none;
    (void)ctx, (void)sky, (void)track;
    *stars = &none;
    *count = 0;
    return BST_OK;
}

bst_status __wrap_bst_pd_sky_stars(bst_ctx *ctx, bst_pd_sky *sky, const bst_los_track *track,
                                   const bst_scene_source *sources, int count, bst_pd_stars *out);
bst_status __wrap_bst_pd_sky_stars(bst_ctx *ctx, bst_pd_sky *sky, const bst_los_track *track,
                                   const bst_scene_source *sources, int count, bst_pd_stars *out) {
    (void)ctx, (void)sky, (void)track, (void)sources, (void)count, (void)out;
    return BST_OK;
}

static const struct bst_skylight_map *map_of_the_sky;
const struct bst_skylight_map *__wrap_bst_pd_sky_map(const bst_pd_sky *sky);
const struct bst_skylight_map *__wrap_bst_pd_sky_map(const bst_pd_sky *sky) {
    (void)sky;
    return map_of_the_sky;
}

static fixture *make(const bst_pd_options *options) {
    fixture *f = calloc(1, sizeof *f);
    assert_non_null(f);
    f->scenario.seed = 11;
    bst_pd_scene *s = &f->scene;
    s->options = *options;
    s->scenario = &f->scenario;
    snprintf(s->name, sizeof s->name, "eye/camera");
    s->camera = (bst_camera){.width_px = 640,
                             .height_px = 420,
                             .pixel_scale_arcsec = 6.0,
                             .psf_fwhm_px = 2.4,
                             .aperture_m = 0.2,
                             .throughput = 0.7,
                             .quantum_efficiency = 0.8,
                             .photon_flux_v0_per_s_m2 = 3.6e10,
                             .dark_current_e_per_s = 10.0,
                             .read_noise_e = 6.0};
    s->sigma_px = bst_camera_psf_sigma_px(&s->camera);
    s->exposure_s = 0.4;
    s->sky_e = 30.0;
    s->dark_e = bst_camera_dark_e(&s->camera, s->exposure_s);
    bst_assert_close(s->dark_e, 4.0, 1e-12);
    s->noise_e = sqrt(30.0 + 4.0 + 36.0);
    s->columns = COLUMNS;
    s->rows = ROWS;
    s->cell_px = 130.0;
    s->min_separation_px = 50.0;
    s->points = 5;
    for (int k = 0; k < s->points; k++) {
        s->snr[k] = 4.0 + 2.5 * k;
        s->flux_e[k] = 700.0 + 100.0 * k;
    }
    f->frame = (bst_pd_frame){.places = f->places,
                              .targets = f->targets,
                              .sources = f->sources,
                              .paths = f->paths,
                              .source_room = ROOM};
    return f;
}

static void set(fixture *f, int64_t number) {
    bst_ctx ctx = {0};
    bst_assert_ok(&ctx, bst_pd_scene_set(&ctx, &f->scene, number, true, &f->frame));
}

/* Where a source is at the start (0), middle (1) and end (2) of the exposure. */
static void seen(const fixture *f, int i, int when, double *x, double *y) {
    const bst_pd_frame *frame = &f->frame;
    bst_quat q = when == 1 ? frame->motion.q_cam_from_gcrf : frame->q[when / 2];
    bst_vec3 d = bst_scene_source_direction(&frame->sources[i], 0.5 * when);
    assert_true(bst_camera_project(&f->scene.camera, bst_quat_rotate(q, d), x, y));
}

/* Sum of the squared pixel parts of a Gaussian drawn along (dx, dy), by many points of the path. */
static double squares(double x, double y, double dx, double dy, double sigma) {
    enum { PARTS = 120, HALF = 24 };
    double sum = 0.0, root = sigma * sqrt(2.0);
    int parts = dx == 0.0 && dy == 0.0 ? 1 : PARTS;
    for (int j = -HALF; j <= HALF; j++) {
        for (int i = -HALF; i <= HALF; i++) {
            double light = 0.0;
            for (int n = 0; n < parts; n++) {
                double t = (n + 0.5) / parts - 0.5, u = i - (x - floor(x)) - t * dx,
                       v = j - (y - floor(y)) - t * dy;
                light += 0.25 * (erf((u + 0.5) / root) - erf((u - 0.5) / root)) *
                         (erf((v + 0.5) / root) - erf((v - 0.5) / root)) / parts;
            }
            sum += light * light;
        }
    }
    return sum;
}

/* In its cell, half the separation from the edges, the grid in the middle of the sensor; points in
 * turn. */
static void expect_cells(const fixture *f, double moved) {
    assert_int_equal(f->frame.count, ROOM);
    for (int i = 0; i < ROOM; i++) {
        double left = 0.5 * (640 - COLUMNS * 130.0) - 0.5 + 130.0 * (i % COLUMNS);
        double top = 0.5 * (420 - ROWS * 130.0) - 0.5 + 130.0 * (i / COLUMNS);
        assert_true(f->places[i].x_px >= left + 25 - moved &&
                    f->places[i].x_px <= left + 105 + moved);
        assert_true(f->places[i].y_px >= top + 25 - moved &&
                    f->places[i].y_px <= top + 105 + moved);
    }
}

static void targets_at_rest(void **state) {
    (void)state;
    fixture *f = make(&(bst_pd_options){.trials = 1000});
    double lowest = 1.0, highest = 0.0;
    for (int64_t number = 0; number < 3; number++) {
        set(f, number);
        expect_cells(f, 0.0);
        for (int i = 0; i < ROOM; i++) {
            double x, y, px = f->places[i].x_px, py = f->places[i].y_px;
            seen(f, i, 1, &x, &y);
            bst_assert_close(x, px, 1e-6);
            bst_assert_close(y, py, 1e-6);
            int point = (int)((number * ROOM + i) % 5);
            assert_int_equal(f->targets[i].point, point);
            double flux =
                f->scene.snr[point] * sqrt(70.0) / sqrt(squares(px, py, 0, 0, f->scene.sigma_px));
            bst_assert_close(f->targets[i].flux_e / flux, 1.0, 1e-6);
            bst_assert_close(f->sources[i].electrons_per_s * 0.4 / flux, 1.0, 1e-6);
            bst_assert_close(f->targets[i].noise_e, sqrt(70.0), 1e-12);
            lowest = fmin(lowest, fmod(px, 1.0));
            highest = fmax(highest, fmod(px, 1.0));
        }
        bst_assert_close(f->frame.request.background_e, 34.0, 1e-12);
        assert_int_equal(f->frame.request.count, ROOM);
        assert_int_equal(f->frame.request.exposure_id, number);
    }
    assert_true(lowest < 0.2 && highest > 0.8);
    free(f);
}

/* A path of the length and direction in the list of places, about the middle, of a camera at rest;
 * of known rate by the camera's turn, then all in one direction. */
static void targets_in_motion(void **state) {
    (void)state;
    for (int known = 0; known < 2; known++) {
        fixture *f = make(&(bst_pd_options){
            .trials = 1000, .streak_px = 17.0, .known_rate = known, .by_magnitude = true});
        set(f, 2);
        expect_cells(f, 0.0);
        double first = atan2(f->places[0].dy_px, f->places[0].dx_px);
        int other = 0;
        for (int i = 0; i < ROOM; i++) {
            const bst_eval_match_target *p = &f->places[i];
            double x[3], y[3];
            for (int k = 0; k < 3; k++) {
                seen(f, i, k, &x[k], &y[k]);
            }
            /* 0.5 degrees from the axis lengths differ by 1e-4 */
            bst_assert_close(hypot(p->dx_px, p->dy_px), 17.0, known ? 5e-3 : 1e-9);
            bst_assert_close(x[2] - x[0], p->dx_px, 1e-4);
            bst_assert_close(y[2] - y[0], p->dy_px, 1e-4);
            bst_assert_close(x[1], p->x_px, 1e-5);
            bst_assert_close(y[1], p->y_px, 1e-5);
            bst_assert_close(0.5 * (x[0] + x[2]), p->x_px, 2e-3);
            bst_assert_close(0.5 * (y[0] + y[2]), p->y_px, 2e-3);
            other += fabs(atan2(p->dy_px, p->dx_px) - first) > 0.1;
            /* by magnitude: the flux of the list */
            bst_assert_close(f->sources[i].electrons_per_s * 0.4,
                             f->scene.flux_e[f->targets[i].point], 1e-9);
        }
        assert_true(known ? other == 0 : other > 6);
        free(f);
    }
}

/* Frames of a stack: each target moves evenly by up to the rate in x and y, about its place at the
 * middle of the stack. */
static void targets_of_a_stack(void **state) {
    (void)state;
    fixture *f = make(&(bst_pd_options){.trials = 1000, .stack = 5, .rates_px = 3.0});
    double at[5][ROOM][2], most = 0.0, apart = 0.0;
    for (int n = 0; n < 5; n++) {
        set(f, 10 + n);
        expect_cells(f, 6.0);
        for (int i = 0; i < ROOM; i++) {
            at[n][i][0] = f->places[i].x_px;
            at[n][i][1] = f->places[i].y_px;
            assert_int_equal(f->targets[i].point, (2 * ROOM + i) % 5);
        }
    }
    expect_cells(f, 6.0);
    for (int i = 0; i < ROOM; i++) {
        double step[2];
        for (int k = 0; k < 2; k++) {
            step[k] = at[1][i][k] - at[0][i][k];
            most = fmax(most, fabs(step[k]));
            for (int n = 0; n < 5; n++) {
                bst_assert_close(at[n][i][k], at[2][i][k] + (n - 2) * step[k], 1e-9);
            }
        }
        apart += fabs(step[0] - step[1]);
        double left = 0.5 * (640 - COLUMNS * 130.0) - 0.5 + 130.0 * (i % COLUMNS);
        assert_true(at[2][i][0] >= left + 25 &&
                    at[2][i][0] <= left + 105); /* the middle one in its cell */
    }
    assert_true(most > 1.5 && most <= 3.0 && apart > 1.0);
    free(f);
}

/* Behind a vignetting lens, whose light falls off from a place beside the middle: by magnitude a
 * star loses light, by SNR it is brighter in front of the lens; under a sky of its own level. */
static void targets_behind_a_vignetting_lens(void **state) {
    (void)state;
    for (int by = 0; by < 2; by++) {
        fixture *f = make(&(bst_pd_options){.trials = 1000, .by_magnitude = by});
        f->scene.camera.optics.vignetting = (bst_optics_vignetting){
            .model = BST_VIGNETTING_POLYNOMIAL, .coefficients = {-0.3, -0.2, 0.1}};
        set(f, 1);
        double least = 1.0;
        for (int i = 0; i < ROOM; i++) {
            double px = f->places[i].x_px, py = f->places[i].y_px;
            double light = bst_camera_illumination(&f->scene.camera, px, py);
            int point = f->targets[i].point;
            double front = f->sources[i].electrons_per_s * 0.4;
            double listed = f->scene.flux_e[point],
                   asked = f->scene.snr[point] * sqrt(70.0) /
                           sqrt(squares(px, py, 0, 0, f->scene.sigma_px));
            bst_assert_close(front / (by ? listed : asked / light), 1.0, 1e-6);
            bst_assert_close(f->targets[i].flux_e / (by ? listed * light : asked), 1.0, 1e-6);
            least = fmin(least, light);
        }
        assert_true(least < 0.9);
        free(f);
    }
}

/* By SNR a streak is as bright as its sum of squares at its angle asks for, from a table over 90
 * degrees that is straight here. */
static void streaks_by_snr(void **state) {
    (void)state;
    fixture *f = make(&(bst_pd_options){.trials = 1000, .streak_px = 17.0});
    double table[46];
    for (int a = 0; a < 46; a++) {
        table[a] = 0.01 * (1.0 + a / 45.0);
    }
    f->scene.sharpness = table;
    set(f, 3);
    for (int i = 0; i < ROOM; i++) {
        double angle = atan2(fabs(f->places[i].dy_px), fabs(f->places[i].dx_px));
        double square = 0.01 * (1.0 + angle / (0.5 * BST_PI));
        double flux = f->scene.snr[f->targets[i].point] * sqrt(70.0) / sqrt(square);
        bst_assert_close(f->targets[i].flux_e / flux, 1.0, 1e-9);
        bst_assert_close(f->sources[i].electrons_per_s * 0.4 / flux, 1.0, 1e-9);
    }
    free(f);
}

/* Of a sky that differs from place to place each target has the noise of its own; where a map gives
 * the frame's sky, the request has the dark current alone. */
static void targets_before_an_uneven_sky(void **state) {
    (void)state;
    for (int mapped = 0; mapped < 2; mapped++) {
        fixture *f = make(&(bst_pd_options){.trials = 1000});
        f->scene.sky = (bst_pd_sky *)(void *)f; /* only handed on */
        map_of_the_sky = mapped ? (const struct bst_skylight_map *)(const void *)f : NULL;
        set(f, 1);
        assert_int_equal(f->frame.count, ROOM);
        for (int i = 0; i < ROOM; i++) {
            double px = f->places[i].x_px, py = f->places[i].y_px;
            double noise_e = sqrt(sky_at(px, py) + 4.0 + 36.0);
            double flux = f->scene.snr[f->targets[i].point] * noise_e /
                          sqrt(squares(px, py, 0, 0, f->scene.sigma_px));
            bst_assert_close(f->targets[i].noise_e, noise_e, 1e-9);
            bst_assert_close(f->targets[i].flux_e / flux, 1.0, 1e-6);
        }
        bst_assert_close(f->frame.request.background_e, mapped ? 4.0 : sky_at(0.0, 0.0) + 4.0,
                         1e-9);
        assert_ptr_equal(f->frame.request.background, map_of_the_sky);
        free(f);
    }
    map_of_the_sky = NULL;
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(targets_at_rest),    cmocka_unit_test(targets_in_motion),
        cmocka_unit_test(targets_of_a_stack), cmocka_unit_test(targets_behind_a_vignetting_lens),
        cmocka_unit_test(streaks_by_snr),     cmocka_unit_test(targets_before_an_uneven_sky),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
