/* The light curve of a sphere in a table, from a site and from an orbit, against vectors worked out
 * here; pictures and GLB of a box out of the middle. Linked with a wrap of the picture's writer. */
#include <cjson/cJSON.h>
#include <unistd.h>

#include "boresight/vec.h"
#include "sim/analysis/shape/light_curve.h"
#include "sim/analysis/shape/turntable.h"
#include "sim/astro/bodies.h"
#include "sim/cli/load.h"
#include "sim/world/world.h"
#include "sim/world/world_config.h"
#include "tests/satellite/satellite_support.h"

/* ------------------------------------------------------------------ light curves */

enum { ROWS = 13, STEP = 600, LATE = 1800 };

typedef struct fixture {
    bst_json *json;
    bst_scenario scenario;
    bst_world *world;
    bst_world_view *view;
    char path[BST_TEST_PATH];
} fixture;

static int set_up(void **state) {
    static const char *const sets[] = {"/world/star_catalogue=embedded"};
    fixture *f = test_calloc(1, sizeof *f);
    bst_load_options load = BST_LOAD_DEFAULTS;
    bst_option none[] = {{.name = NULL}};
    bst_ctx ctx = {0};
    bst_assert_ok(&ctx, bst_load_check(&ctx, &load, none));
    load.set.items[load.set.count++] = sets[0];
    bst_assert_ok(&ctx, bst_load_scenario(&ctx, "scenarios/neossat_geo_track.json", &load, &f->json,
                                          &f->scenario));
    bst_assert_ok(
        &ctx, bst_world_create(&ctx, f->scenario.file, &f->scenario.world, &f->scenario.observers,
                               f->scenario.base_dir, f->scenario.epoch, &f->world));
    bst_assert_ok(&ctx, bst_world_view_create(&ctx, f->world, &f->view));
    bst_test_template(f->path, "curve");
    int fd = mkstemp(f->path);
    assert_true(fd >= 0);
    close(fd);
    *state = f;
    return 0;
}

static int tear_down(void **state) {
    fixture *f = *state;
    unlink(f->path);
    bst_world_view_free(f->view);
    bst_world_free(f->world);
    bst_scenario_free(&f->scenario);
    bst_json_free(f->json);
    test_free(f);
    return 0;
}

typedef struct row {
    double seconds, v_mag, phase_deg, range_km, sunlit, earth_share, elevation_deg, azimuth_deg;
} row;

/* A field; empty ones are NAN. */
static double field(char **at) {
    char *end, *from = *at + 1;
    assert_true(**at == ',');
    double value = strtod(from, &end);
    *at = end;
    return end == from ? NAN : value;
}

static void make_table(fixture *f, const char *site, double extinction_mag, row rows[ROWS]) {
    bst_ctx ctx = {0};
    char line[400];
    bst_light_curve_request r = BST_LIGHT_CURVE_DEFAULTS;
    r.site = site;
    r.start = "2022-06-16T22:40:00Z"; /* LATE after the epoch */
    r.duration_s = (ROWS - 1) * STEP;
    r.step_s = STEP;
    r.extinction_mag = extinction_mag;
    r.output = f->path;
    bst_assert_ok(&ctx, bst_light_curve_make(&ctx, &r, &f->scenario));
    FILE *file = fopen(f->path, "r");
    assert_non_null(file);
    assert_non_null(fgets(line, sizeof line, file));
    for (int i = 0; i < ROWS; i++) {
        assert_non_null(fgets(line, sizeof line, file));
        char *at = strchr(line, ',');
        assert_non_null(at);
        if (i == 1) {
            assert_memory_equal(line, "2022-06-16T22:50:00.000Z", 24);
        }
        double *const fields[] = {&rows[i].seconds,       &rows[i].v_mag,      &rows[i].phase_deg,
                                  &rows[i].range_km,      &rows[i].sunlit,     &rows[i].earth_share,
                                  &rows[i].elevation_deg, &rows[i].azimuth_deg};
        for (int k = 0; k < 8; k++) {
            *fields[k] = field(&at);
        }
        bst_assert_close(rows[i].seconds, STEP * i, 0);
    }
    assert_null(fgets(line, sizeof line, file));
    fclose(file);
}

/* Line of sight with light time from a place, Sun - object - observer, and the range to where the
 * light left relative to the Earth. */
static bst_vec3 line_from(const fixture *f, bst_vec3 place, double seconds, double *phase_deg,
                          double *range_m) {
    bst_ctx ctx = {0};
    bst_world_state object;
    bst_bodies bodies;
    bst_assert_ok(&ctx, bst_world_view_object_state(&ctx, f->view, 0, seconds, &object));
    bst_assert_ok(&ctx, bst_world_view_bodies(&ctx, f->view, seconds, &bodies));
    bst_vec3 line = bst_vec3_sub(object.position_m, place);
    /* the object and the Earth's centre have moved since the light left */
    double delay_s = bst_vec3_norm(line) / 299792458.0;
    line = bst_vec3_axpy(line, -delay_s, object.velocity_mps);
    *range_m = bst_vec3_norm(line);
    *phase_deg =
        bst_vec3_angle(bst_vec3_sub(bodies.sun_m, object.position_m), bst_vec3_scale(line, -1.0)) *
        180 / BST_PI;
    return bst_vec3_axpy(line, -delay_s, bodies.earth_bary_mps);
}

/* Lambert's sphere of 4 m^2 and albedo 0.25 under a Sun of -26.74 at 1 au. */
static double magnitude(const fixture *f, double seconds, double phase_deg, double range_m) {
    bst_ctx ctx = {0};
    bst_world_state object;
    bst_bodies bodies;
    bst_assert_ok(&ctx, bst_world_view_object_state(&ctx, f->view, 0, seconds, &object));
    bst_assert_ok(&ctx, bst_world_view_bodies(&ctx, f->view, seconds, &bodies));
    double au = bst_vec3_norm(bst_vec3_sub(bodies.sun_m, object.position_m)) / 149597870700.0;
    double a = phase_deg * BST_PI / 180;
    double light = 2 * 0.25 * 4.0 * ((BST_PI - a) * cos(a) + sin(a)) /
                   (3 * BST_PI * BST_PI * range_m * range_m * au * au);
    return -26.74 - 2.5 * log10(light);
}

static void from_an_orbit(void **state) {
    fixture *f = *state;
    bst_ctx ctx = {0};
    row rows[ROWS];
    int bright = 0;
    make_table(f, NULL, 0.0, rows);
    for (int i = 0; i < ROWS; i++) {
        const row *r = &rows[i];
        double at_s = LATE + r->seconds, phase_deg, range_m;
        bst_world_state eye;
        bst_assert_ok(&ctx, bst_world_view_observer_state(&ctx, f->view, 0, at_s, &eye));
        bst_vec3 line = line_from(f, eye.position_m, at_s, &phase_deg, &range_m);
        bst_assert_close(r->range_km, range_m / 1e3, 0.01);
        bst_assert_close(r->phase_deg, phase_deg, 2e-4);
        assert_true(isnan(r->elevation_deg) && isnan(r->azimuth_deg));
        /* behind the Earth: the line passes within 6378 km of the centre, on this side of it */
        bst_vec3 d = bst_vec3_unit(line);
        double along = -bst_vec3_dot(eye.position_m, d),
               miss = bst_vec3_norm(bst_vec3_axpy(eye.position_m, along, d));
        bool hidden = along > 0 && along < bst_vec3_norm(line) && miss < 6.36e6;
        assert_int_equal(isnan(r->v_mag), hidden);
        if (!hidden) {
            bst_assert_close(r->v_mag, magnitude(f, at_s, phase_deg, range_m), 1e-3);
            bst_assert_close(r->sunlit, 1.0, 0);
            bright++;
        }
    }
    assert_in_range(bright, 3, ROWS);
}

/* South and east of the satellite. */
static void from_a_site(void **state) {
    fixture *f = *state;
    bst_ctx ctx = {0};
    row rows[ROWS], clear[ROWS];
    const double lat = -32.44 * BST_DEG_RAD, lon = 45.0 * BST_DEG_RAD, height = 2790;
    make_table(f, "-32.44,45,2790", 0.2, rows);
    make_table(f, "-32.44,45,2790", 0.0, clear);
    /* WGS84 */
    const double a = 6378137.0, e2 = 6.69437999014e-3;
    double n = a / sqrt(1 - e2 * sin(lat) * sin(lat));
    bst_vec3 site = {(n + height) * cos(lat) * cos(lon), (n + height) * cos(lat) * sin(lon),
                     (n * (1 - e2) + height) * sin(lat)};
    bst_vec3 up = {cos(lat) * cos(lon), cos(lat) * sin(lon), sin(lat)},
             north = {-sin(lat) * cos(lon), -sin(lat) * sin(lon), cos(lat)},
             east = {-sin(lon), cos(lon), 0};
    int above = 0;
    for (int i = 0; i < ROWS; i++) {
        const row *r = &rows[i];
        double at_s = LATE + r->seconds, phase_deg, range_m;
        bst_astro_earth_frames frames;
        bst_bodies bodies;
        bst_assert_ok(&ctx, bst_world_view_earth_frames(&ctx, f->view, at_s, &frames));
        bst_assert_ok(&ctx, bst_world_view_bodies(&ctx, f->view, at_s, &bodies));
        bst_vec3 place = bst_mat3_transpose_mul_vec(&frames.itrf_from_gcrf, site);
        bst_vec3 line = line_from(f, place, at_s, &phase_deg, &range_m);
        bst_assert_close(r->range_km, range_m / 1e3, 0.01);
        bst_assert_close(r->phase_deg, phase_deg, 2e-4);
        /* aberration by the Earth's motion and its rotation of 7.292e-5 rad/s */
        bst_vec3 spin = bst_vec3_cross((bst_vec3){0, 0, 7.292115e-5}, site);
        bst_vec3 velocity = bst_vec3_add(bodies.earth_bary_mps,
                                         bst_mat3_transpose_mul_vec(&frames.itrf_from_gcrf, spin));
        bst_vec3 seen = bst_mat3_mul_vec(
            &frames.itrf_from_gcrf,
            bst_vec3_unit(bst_vec3_axpy(bst_vec3_unit(line), 1 / 299792458.0, velocity)));
        double elevation = asin(bst_vec3_dot(seen, up)) * 180 / BST_PI;
        double azimuth = atan2(bst_vec3_dot(seen, east), bst_vec3_dot(seen, north)) * 180 / BST_PI;
        bst_assert_close(r->elevation_deg, elevation, 2e-5);
        bst_assert_close(r->azimuth_deg, fmod(azimuth + 360, 360), 2e-5);
        if (elevation > 0) {
            above++;
            double mass =
                1 / (sin(elevation * BST_DEG_RAD) + 0.50572 * pow(elevation + 6.07995, -1.6364));
            bst_assert_close(r->v_mag - clear[i].v_mag, 0.2 * mass, 3e-5);
            bst_assert_close(clear[i].v_mag, magnitude(f, at_s, phase_deg, range_m), 1e-3);
        } else {
            assert_true(isnan(r->v_mag));
        }
    }
    assert_in_range(above, 3, ROWS);
}

/* ------------------------------------------------------------------ pictures and GLB of a box */

#define BOX                                                                                      \
    "{\"materials\": [{\"name\": \"w\", \"diffuse\": 0.8}], \"parts\": [{\"name\": \"b\", "      \
    "\"kind\": \"box\", \"size_m\": [1, 2, 3], \"position_m\": [0.4, -0.3, 0.5], \"material\": " \
    "\"w\"}]}"

enum { SIDE = 128 };

static uint8_t sheet[2 * SIDE][4 * SIDE];

bst_status __wrap_bst_grey_png_write8(bst_ctx *ctx, const char *path, const uint8_t *pixels,
                                      int width, int height);
bst_status __wrap_bst_grey_png_write8(bst_ctx *ctx, const char *path, const uint8_t *pixels,
                                      int width, int height) {
    (void)ctx;
    (void)path;
    assert_int_equal(width, 4 * SIDE);
    assert_int_equal(height, 2 * SIDE);
    memcpy(sheet, pixels, sizeof sheet);
    return BST_OK;
}

static void a_box_from_eight_sides(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_test_model m = bst_test_model_open(BOX);
    const bst_vec3 middle = {0.4, -0.3, 0.5};
    const double half[3] = {0.5, 1, 1.5}, up = 20 * BST_DEG_RAD;
    /* the corner that is farthest from the origin */
    double scale = 0.48 * SIDE / sqrt(0.9 * 0.9 + 1.3 * 1.3 + 2.0 * 2.0);
    bst_assert_ok(&ctx, bst_turntable_draw(&ctx, m.satellite, "x.png", SIDE));
    for (int k = 0; k < 8; k++) {
        double a = k * 45 * BST_DEG_RAD, area = 0;
        bst_vec3 eye = {cos(up) * cos(a), cos(up) * sin(a), sin(up)}, right = {-sin(a), cos(a), 0},
                 above = {-sin(up) * cos(a), -sin(up) * sin(a), cos(up)};
        bst_vec3 sun = bst_vec3_unit(bst_vec3_axpy(bst_vec3_axpy(eye, 0.6, right), 0.45, above));
        int left = k % 4 * SIDE, top = k / 4 * SIDE, count = 0;
        double x_sum = 0, y_sum = 0;
        for (int y = 0; y < SIDE; y++) {
            for (int x = 0; x < SIDE; x++) {
                bool drawn = sheet[top + y][left + x] != 24;
                count += drawn;
                x_sum += drawn * (x + 0.5);
                y_sum += drawn * (y + 0.5);
            }
        }
        const double *to = &eye.x, *light = &sun.x;
        for (int i = 0; i < 3; i++) {
            double face = 4 * half[(i + 1) % 3] * half[(i + 2) % 3];
            area += face * fabs(to[i]);
            if (fabs(to[i]) < 0.1) {
                continue;
            }
            /* the middle of the face that is seen; white in full light is 255, dark is 32, a cube
             * root in between; 2 % of light from everywhere */
            double side = to[i] > 0 ? 1 : -1, at[3] = {middle.x, middle.y, middle.z};
            at[i] += side * half[i];
            bst_vec3 p = {at[0], at[1], at[2]};
            int x = (int)(0.5 * SIDE + scale * bst_vec3_dot(p, right)),
                y = (int)(0.5 * SIDE - scale * bst_vec3_dot(p, above));
            double lit = side * light[i], share = lit > 0 ? 0.8 * lit : 0.02 * 0.8;
            bst_assert_close(sheet[top + y][left + x], 32 + 223 * cbrt(share), 1.0);
        }
        /* an edge of pixels is uncertain by a quarter */
        bst_assert_close(count, area * scale * scale, 0.02 * area * scale * scale);
        bst_assert_close(x_sum / count, 0.5 * SIDE + scale * bst_vec3_dot(middle, right), 0.6);
        bst_assert_close(y_sum / count, 0.5 * SIDE - scale * bst_vec3_dot(middle, above), 0.6);
    }
    bst_test_model_close(&m);
}

#define TWO_BOXES                                                                                  \
    "{\"materials\": [{\"name\": \"w\", \"diffuse\": 0.8}], \"parts\": [{\"name\": \"a\", "        \
    "\"kind\": \"box\", \"size_m\": [0.2, 2, 3], \"position_m\": [-0.6, 0.1, 0.2], \"material\": " \
    "\"w\"}, {\"name\": \"b\", \"kind\": \"box\", \"size_m\": [0.3, 0.8, 0.7], \"position_m\": "   \
    "[0.7, -0.2, 0.3], \"material\": \"w\"}]}"

static const double box_half[2][3] = {{0.1, 1.0, 1.5}, {0.15, 0.4, 0.35}};
static const double box_at[2][3] = {{-0.6, 0.1, 0.2}, {0.7, -0.2, 0.3}};

/* Distance along a ray to the nearest face of both boxes, and its axis; INFINITY: none. */
static double trace(bst_vec3 from, bst_vec3 way, int *face) {
    const double *q = &from.x, *d = &way.x;
    double best = INFINITY;
    for (int b = 0; b < 2; b++) {
        double in = -INFINITY, out = INFINITY;
        int axis = 0;
        for (int i = 0; i < 3; i++) {
            double near = (box_at[b][i] - copysign(box_half[b][i], d[i]) - q[i]) / d[i];
            double far = (box_at[b][i] + copysign(box_half[b][i], d[i]) - q[i]) / d[i];
            axis = near > in ? i : axis;
            in = fmax(in, near);
            out = fmin(out, far);
        }
        if (in < out && out > 0 && in < best) {
            best = in;
            *face = axis;
        }
    }
    return best;
}

/* One box before another, and in its light, pixel by pixel from rays. */
static void boxes_hide_each_other(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_test_model m = bst_test_model_open(TWO_BOXES);
    const double up = 20 * BST_DEG_RAD,
                 scale = 0.48 * SIDE / sqrt(0.7 * 0.7 + 1.1 * 1.1 + 1.7 * 1.7);
    int seen = 0, dark = 0, wrong = 0;
    bst_assert_ok(&ctx, bst_turntable_draw(&ctx, m.satellite, "x.png", SIDE));
    for (int k = 0; k < 8; k++) {
        const double a = k * 45 * BST_DEG_RAD;
        const bst_vec3 eye = {cos(up) * cos(a), cos(up) * sin(a), sin(up)},
                       right = {-sin(a), cos(a), 0},
                       above = {-sin(up) * cos(a), -sin(up) * sin(a), cos(up)};
        const bst_vec3 sun =
            bst_vec3_unit(bst_vec3_axpy(bst_vec3_axpy(eye, 0.6, right), 0.45, above));
        for (int y = 0; y < SIDE; y++) {
            for (int x = 0; x < SIDE; x++) {
                bst_vec3 q = bst_vec3_scale(right, (x + 0.5 - 0.5 * SIDE) / scale);
                q = bst_vec3_axpy(q, (0.5 * SIDE - y - 0.5) / scale, above);
                q = bst_vec3_axpy(q, 10.0, eye);
                int axis = 0, other;
                double expected = 24, way = trace(q, bst_vec3_scale(eye, -1.0), &axis);
                if (isfinite(way)) {
                    const bst_vec3 hit = bst_vec3_axpy(bst_vec3_axpy(q, -way, eye), 1e-6, sun);
                    const double side = copysign(1.0, (&eye.x)[axis]);
                    const double in = side * (&sun.x)[axis];
                    const bool lit = in > 0 && !isfinite(trace(hit, sun, &other));
                    expected = 32 + 223 * cbrt(lit ? 0.8 * in : 0.02 * 0.8);
                    seen++;
                    dark += in > 0 && !lit;
                }
                wrong += fabs(sheet[k / 4 * SIDE + y][k % 4 * SIDE + x] - expected) > 1.5;
            }
        }
    }
    print_message("%d pixels, %d of them in a shadow, %d unlike\n", seen, dark, wrong);
    assert_true(dark > seen / 50);
    assert_true(wrong < seen / 500); /* rounding at edges */
    bst_test_model_close(&m);
}

static uint32_t word_at(const uint8_t *bytes) {
    return bytes[0] | (uint32_t)bytes[1] << 8 | (uint32_t)bytes[2] << 16 | (uint32_t)bytes[3] << 24;
}

static double number(const cJSON *node, const char *key) {
    const cJSON *item = cJSON_GetObjectItem(node, key);
    assert_true(cJSON_IsNumber(item));
    return item->valuedouble;
}

static void a_box_as_glb(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_test_model m = bst_test_model_open(BOX);
    char path[BST_TEST_PATH];
    static uint8_t bytes[20000];
    static char text[10000];
    bst_test_template(path, "box");
    int fd = mkstemp(path);
    assert_true(fd >= 0);
    close(fd);
    bst_assert_ok(&ctx, bst_turntable_write_glb(&ctx, m.satellite, path));
    FILE *file = fopen(path, "r");
    assert_non_null(file);
    size_t size = fread(bytes, 1, sizeof bytes, file);
    fclose(file);
    unlink(path);
    assert_memory_equal(bytes, "glTF\2\0\0\0", 8);
    assert_int_equal(word_at(bytes + 8), size);
    uint32_t length = word_at(bytes + 12);
    assert_int_equal(length % 4, 0);
    assert_memory_equal(bytes + 16, "JSON", 4);
    assert_true(length < sizeof text);
    memcpy(text, bytes + 20, length);
    cJSON *root = cJSON_Parse(text);
    const uint8_t *chunk = bytes + 20 + length;
    assert_memory_equal(chunk + 4, "BIN\0", 4);
    assert_int_equal(word_at(chunk), 36 * 12); /* six faces of two triangles, 12 bytes a vertex */
    assert_ptr_equal(chunk + 8 + 36 * 12, bytes + size);
    const cJSON *accessor = cJSON_GetArrayItem(cJSON_GetObjectItem(root, "accessors"), 0),
                *view = cJSON_GetArrayItem(cJSON_GetObjectItem(root, "bufferViews"), 0),
                *buffer = cJSON_GetArrayItem(cJSON_GetObjectItem(root, "buffers"), 0);
    assert_true(number(accessor, "count") == 36 && number(view, "byteLength") == 36 * 12 &&
                number(view, "byteOffset") == 0 && number(buffer, "byteLength") == 36 * 12);
    /* y up: x, z, -y of the body */
    const double low[3] = {-0.1, -1.0, -0.7}, high[3] = {0.9, 2.0, 1.3};
    double area = 0, volume = 0;
    for (int t = 0; t < 12; t++) {
        bst_vec3 v[3];
        for (int i = 0; i < 3; i++) {
            float p[3];
            memcpy(p, chunk + 8 + 36 * t + 12 * i, sizeof p);
            v[i] = (bst_vec3){(double)p[0], (double)p[1], (double)p[2]};
            for (int k = 0; k < 3; k++) {
                double value = (double)p[k]; /* each coordinate of a corner is an end */
                assert_true(fabs(value - low[k]) < 1e-6 || fabs(value - high[k]) < 1e-6);
            }
        }
        bst_vec3 normal = bst_vec3_cross(bst_vec3_sub(v[1], v[0]), bst_vec3_sub(v[2], v[0]));
        area += 0.5 * bst_vec3_norm(normal);
        volume += bst_vec3_dot(v[0], normal) / 6;
    }
    bst_assert_close(area, 22.0, 1e-5);
    bst_assert_close(volume, 6.0, 1e-5); /* triangles are counterclockwise from outside */
    for (int k = 0; k < 3; k++) {
        bst_assert_close(cJSON_GetArrayItem(cJSON_GetObjectItem(accessor, "min"), k)->valuedouble,
                         low[k], 1e-6);
        bst_assert_close(cJSON_GetArrayItem(cJSON_GetObjectItem(accessor, "max"), k)->valuedouble,
                         high[k], 1e-6);
    }
    cJSON_Delete(root);
    bst_test_model_close(&m);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(from_an_orbit, set_up, tear_down),
        cmocka_unit_test_setup_teardown(from_a_site, set_up, tear_down),
        cmocka_unit_test(a_box_from_eight_sides),
        cmocka_unit_test(boxes_hide_each_other),
        cmocka_unit_test(a_box_as_glb),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
