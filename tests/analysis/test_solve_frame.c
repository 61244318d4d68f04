/* What `boresight solve` asks of the solver, and what it prints of streaks that a script has
 * solved. The linker puts these functions in the place of the solver's parts. */
#include "imgproc/identify/plate_solve.h"
#include "sim/analysis/solve/solve_frame.h"
#include "sim/astro/time.h"
#include "sim/io/fits_image.h"
#include "tests/test_support.h"

enum { WIDTH = 60, HEIGHT = 40 };

static bst_plate_solve_result script;
static bst_plate_solve_options asked;
static bst_light light;
static double field_rad;

bst_status __wrap_bst_fits_read_image(bst_ctx *ctx, const char *path, int *width, int *height,
                                      float **pixels);
bst_status __wrap_bst_fits_read_image(bst_ctx *ctx, const char *path, int *width, int *height,
                                      float **pixels) {
    (void)ctx;
    assert_string_equal(path, "frame.fits");
    *width = WIDTH;
    *height = HEIGHT;
    *pixels = calloc((size_t)WIDTH * HEIGHT, sizeof **pixels);
    return BST_OK;
}

bst_status __wrap_bst_stars_open(bst_ctx *ctx, const char *name, bst_stars **out);
bst_status __wrap_bst_stars_open(bst_ctx *ctx, const char *name, bst_stars **out) {
    (void)ctx;
    assert_string_equal(name, "default");
    *out = NULL;
    return BST_OK;
}

bst_status __wrap_bst_star_patterns_create(bst_ctx *ctx, const bst_stars *stars,
                                           const bst_star_patterns_options *options,
                                           bst_star_patterns **out);
bst_status __wrap_bst_star_patterns_create(bst_ctx *ctx, const bst_stars *stars,
                                           const bst_star_patterns_options *options,
                                           bst_star_patterns **out) {
    (void)ctx;
    (void)stars;
    bst_assert_close(options->v_limit, 11.0, 0.0);
    bst_assert_close(options->julian_year, 2022.4546, 1e-3);
    field_rad = options->field_rad;
    *out = NULL;
    return BST_OK;
}

bst_status __wrap_bst_lost_in_space_create(bst_ctx *ctx, const bst_camera *camera,
                                           const bst_stars *stars,
                                           const bst_star_patterns *patterns, double julian_year,
                                           int most_stars, bst_lost_in_space **out);
bst_status __wrap_bst_lost_in_space_create(bst_ctx *ctx, const bst_camera *camera,
                                           const bst_stars *stars,
                                           const bst_star_patterns *patterns, double julian_year,
                                           int most_stars, bst_lost_in_space **out) {
    (void)ctx;
    (void)stars;
    (void)patterns;
    (void)most_stars;
    assert_true(camera->width_px == WIDTH && camera->height_px == HEIGHT);
    bst_assert_close(camera->pixel_scale_arcsec, 120.0, 0.0);
    bst_assert_close(julian_year, 2022.4546, 1e-3);
    *out = NULL;
    return BST_OK;
}

bst_status __wrap_bst_plate_solve(bst_ctx *ctx, bst_lost_in_space *solver,
                                  const bst_plate_solve_options *options, const float *pixels,
                                  int width, int height, bst_plate_solve_result *out);
bst_status __wrap_bst_plate_solve(bst_ctx *ctx, bst_lost_in_space *solver,
                                  const bst_plate_solve_options *options, const float *pixels,
                                  int width, int height, bst_plate_solve_result *out) {
    (void)ctx;
    (void)solver;
    (void)pixels;
    assert_true(width == WIDTH && height == HEIGHT);
    asked = *options;
    light = *options->light;
    *out = script;
    return BST_OK;
}

static double after(const char *text, const char *label) {
    const char *at = strstr(text, label);
    assert_non_null(at);
    return strtod(at + strlen(label), NULL);
}

static void what_is_asked_and_printed(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_solve_request request = BST_SOLVE_REQUEST_DEFAULTS;
    request.utc = "2022-06-16T00:00:00Z";
    request.scale_arcsec = 120.0;
    request.v_limit = 11.0;
    request.speed_kmps[1] = -7.5;
    const bst_quat q = bst_quat_unit((bst_quat){0.3, -0.5, 0.2, 0.7});
    script = (bst_plate_solve_result){
        .attitude = {.solved = true,
                     .q_cam_from_gcrf = q,
                     .scale = 1.02,
                     .predicted = 40,
                     .matched = 31,
                     .rms_px = 0.31,
                     .log_chance = -50.0 * log(10.0)},
        .ends = {{.x_px = -9.0, .y_px = -12.0}, {.x_px = 11.0, .y_px = 9.0}}};
    char *text = NULL;
    size_t bytes = 0;
    bool solved = false;
    FILE *out = open_memstream(&text, &bytes);
    assert_non_null(out);
    bst_assert_ok(&ctx, bst_solve_frame(&ctx, &request, "frame.fits", out, &solved));
    fclose(out);
    assert_true(solved);
    const double per_px = 120.0 * BST_ARCSEC_RAD;
    bst_assert_close(field_rad, 2.0 * atan(20.0 * per_px), 1e-9); /* of the shorter side */
    bst_assert_close(asked.tangent_per_px, per_px, 1e-12);
    bst_assert_close(asked.scale_tolerance, 0.05, 0.0);
    bst_assert_close(asked.v_limit, 11.0, 0.0);
    bst_assert_close(asked.least_snr, 12.0, 0.0);
    /* the Earth's speed about the Sun, and the observer's */
    bst_bodies bodies;
    bst_time time;
    bst_assert_ok(&ctx, bst_time_from_utc(&ctx, request.utc, &time));
    bst_bodies_at(time, &bodies);
    bst_vec3 own = bst_vec3_sub(light.velocity_mps, bodies.earth_bary_mps);
    bst_assert_close(own.x, 0.0, 1e-6);
    bst_assert_close(own.y, -7500.0, 1e-6);
    bst_assert_close(own.z, 0.0, 1e-6);
    assert_non_null(strstr(text, "31 of 40 of the catalogue matched, rms 0.31 px, chance 1e-50"));
    bst_assert_close(after(text, "scale "), 1.02 * 120.0, 1e-5);
    bst_assert_close(after(text, "streaks "), 29.0, 0.05); /* 20 and 21 px */
    /* while the stars are at an end, the camera looks as far to the other side */
    for (int end = 0; end < 2; end++) {
        const char *line = strstr(text, end ? "right end" : "left end");
        assert_non_null(line);
        const double x = -script.ends[end].x_px * per_px * 1.02;
        const double y = -script.ends[end].y_px * per_px * 1.02;
        const bst_mat3 m = bst_quat_to_mat3(q); /* its rows are the camera's axes */
        const double v[3] = {m.m[0][0] * x + m.m[1][0] * y + m.m[2][0],
                             m.m[0][1] * x + m.m[1][1] * y + m.m[2][1],
                             m.m[0][2] * x + m.m[1][2] * y + m.m[2][2]};
        const double ra = atan2(v[1], v[0]), dec = atan2(v[2], hypot(v[0], v[1]));
        /* rows count against the camera's y axis: their direction in north and east */
        const double up[3] = {-m.m[1][0], -m.m[1][1], -m.m[1][2]};
        const double east = -sin(ra) * up[0] + cos(ra) * up[1];
        const double north = -sin(dec) * (cos(ra) * up[0] + sin(ra) * up[1]) + cos(dec) * up[2];
        const double degrees = 180.0 / BST_PI;
        bst_assert_close(remainder(after(line, "RA ") - ra * degrees, 360.0), 0.0, 1e-5);
        bst_assert_close(after(line, "Dec "), dec * degrees, 1e-5);
        bst_assert_close(
            remainder(after(line, "position angle ") - atan2(east, north) * degrees, 360.0), 0.0,
            1e-3);
    }
    free(text);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(what_is_asked_and_printed)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
