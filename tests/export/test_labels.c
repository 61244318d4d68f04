/* Labels of frames for training networks (COCO, YOLO, SatNet) of a run that is written here: places
 * and boxes in the pixels of a binned window, against the sensor's. */
#include <cjson/cJSON.h>

#include "sim/cli/load.h"
#include "sim/export/export.h"
#include "sim/io/fits_frames.h"
#include "sim/run/run_sensors.h"
#include "tests/report/run_tables.h"

enum { WIDTH = 40, HEIGHT = 24, FRAMES = 3, X0 = 100, Y0 = 60 };

/* Frame k is binned by k + 1; two extensions are of other exposures. */
static int binning_of(int k) {
    return k + 1;
}

typedef struct source {
    const char *kind;
    int id, norad, item;
    double x[3], y[3]; /* chief ray at start, middle and end, sensor px */
    double chief[2], centroid[2], v_mag, electrons, snr;
} source;

/* On the frame unless said otherwise; the light lies beside the chief ray. */
static const source sources[] = {
    {"object", 0, 44801, 1, {106, 108, 112}, {70, 69, 66}, {108, 69}, {108.6, 68.7}, 13.5, 900, 21},
    {"star", 77, 0, 2, {120, 120.5, 121}, {75, 75, 75}, {120.5, 75}, {120.5, 75}, 9.9, 5000, 90},
    {"star", 78, 0, 3, {110, 110, 110}, {64, 64, 64}, {110, 64}, {110, 64}, 10.1, 700, 9},
    {"object", 1, 0, 4, {98, 99, 99.5}, {62, 62, 62}, {99, 62}, {99.2, 62}, 12, 100, 5},
    {"object", 2, 9, 5, {105, 105, 105}, {65, 65, 65}, {105, 65}, {105, 65}, 15, 0, 0},
    {"object", 3, 8, 6, {900, 900, 900}, {65, 65, 65}, {900, 65}, {900, 65}, 12, 100, 5},
};
enum { SOURCES = sizeof sources / sizeof *sources };

static void write_scenario(run_tables *t) {
    bst_ctx ctx = {0};
    bst_load_options load = BST_LOAD_DEFAULTS;
    bst_option none[] = {{.name = NULL}};
    bst_json *json;
    bst_scenario scenario;
    bst_assert_ok(&ctx, bst_load_check(&ctx, &load, none));
    bst_assert_ok(
        &ctx, bst_load_scenario(&ctx, "scenarios/neossat_geo_track.json", &load, &json, &scenario));
    cJSON *echo = bst_scenario_echo(&scenario);
    char *text = cJSON_Print(echo);
    run_tables_file(t, "scenario.json", text);
    cJSON_free(text);
    cJSON_Delete(echo);
    bst_scenario_free(&scenario);
    bst_json_free(json);
}

static void write_frames(run_tables *t) {
    bst_ctx ctx = {0};
    bst_camera camera = {.width_px = 1024, .height_px = 1024, .pixel_scale_arcsec = 3};
    bst_fits_info info = {.observer = "eye", .instrument = "camera", .camera = &camera};
    bst_fits *frames, *masks;
    uint16_t pixels[WIDTH * HEIGHT];
    static int32_t items[WIDTH * HEIGHT];
    bst_assert_ok(&ctx, bst_fits_create(&ctx, scratch_path(&t->place, "frames.fits"),
                                        BST_FITS_EXTENSIONS, &info, &frames));
    info.content = BST_FITS_ITEMS;
    bst_assert_ok(&ctx, bst_fits_create(&ctx, scratch_path(&t->place, "segmentation.fits"),
                                        BST_FITS_EXTENSIONS, &info, &masks));
    for (int k = 0; k < FRAMES; k++) {
        bst_fits_frame frame = {.id = 10 + 5 * k,
                                .exposure_s = 0.5,
                                .window = {X0, Y0, WIDTH * binning_of(k), HEIGHT * binning_of(k)},
                                .binning = binning_of(k),
                                .bits = 14};
        bst_assert_ok(&ctx, bst_time_from_utc(&ctx, "2022-06-16T22:10:00Z", &frame.start));
        for (int i = 0; i < WIDTH * HEIGHT; i++) {
            pixels[i] = (uint16_t)(500 + i + k);
            items[i] = 0;
        }
        for (int y = 3; y < 5; y++) { /* a box of 3 x 2 for the first source, a corner missing */
            for (int x = 6; x < 9; x++) {
                items[y * WIDTH + x] = x == 8 && y == 3 ? 2 : 1;
            }
        }
        bst_assert_ok(&ctx, bst_fits_write(&ctx, frames, &frame, pixels, WIDTH, HEIGHT, NULL));
        const bst_fits_plane plane = {"SEGMENTATION", items, WIDTH, HEIGHT};
        bst_assert_ok(&ctx, bst_fits_write_plane(&ctx, masks, &frame, &plane, NULL));
    }
    bst_assert_ok(&ctx, bst_fits_close(&ctx, frames));
    bst_assert_ok(&ctx, bst_fits_close(&ctx, masks));
}

static void make_run(run_tables *t, bool masks) {
    run_tables_begin(t, "run.sqlite");
    write_scenario(t);
    write_frames(t);
    if (!masks) {
        unlink(scratch_path(&t->place, "segmentation.fits"));
    }
    run_tables_sql(
        t,
        "CREATE TABLE run (tick_rate_hz INT, epoch_utc TEXT);"
        "INSERT INTO run VALUES (1000, '2022-06-16T22:10:00Z');"
        "CREATE TABLE sensors (sensor INT, observer TEXT, name TEXT, target TEXT, file TEXT);"
        "INSERT INTO sensors VALUES (0, 'neossat', 'telescope', 'PREY', 'frames.fits');"
        "CREATE TABLE objects (id INT, name TEXT);"
        "INSERT INTO objects VALUES (0, 'PREY'), (1, 'B'), (2, 'C'), (3, 'D');"
        "CREATE TABLE frames (sensor INT, exposure_id INT, fits_index INT, start_tick INT, "
        "exposure_s"
        " REAL, x0_px INT, y0_px INT, width_px INT, height_px INT, binning INT, bits INT,"
        " start_utc TEXT);"
        "CREATE TABLE exposures (sensor INT, exposure_id INT, pixel_scale_arcsec REAL,"
        " q_cam_from_gcrf_mean_x REAL, q_cam_from_gcrf_mean_y REAL, q_cam_from_gcrf_mean_z REAL,"
        " q_cam_from_gcrf_mean_w REAL, observer_gcrf_x_m REAL, observer_gcrf_y_m REAL,"
        " observer_gcrf_z_m REAL, observer_gcrf_x_mps REAL, observer_gcrf_y_mps REAL,"
        " observer_gcrf_z_mps REAL, velocity_bary_x_mps REAL, velocity_bary_y_mps REAL,"
        " velocity_bary_z_mps REAL, sun_x_m REAL, sun_y_m REAL, sun_z_m REAL);"
        "CREATE TABLE truth (sensor INT, exposure_id INT, kind TEXT, id INT, norad INT, item INT,"
        " x_start_px REAL, x_mid_px REAL, x_end_px REAL, y_start_px REAL, y_mid_px REAL, y_end_px "
        "REAL,"
        " x_chief_px REAL, y_chief_px REAL, x_centroid_px REAL, y_centroid_px REAL, v_mag REAL,"
        " electrons REAL, snr REAL, ra_deg REAL, dec_deg REAL);"
        "CREATE TABLE shapes (sensor INT, exposure_id INT, item INT, x_px REAL, y_px REAL, x0_px "
        "REAL, y0_px REAL, x1_px REAL, y1_px REAL, size_px REAL, phase_deg REAL, range_m REAL,"
        " q_body_from_gcrf_x REAL, q_body_from_gcrf_y REAL, q_body_from_gcrf_z REAL,"
        " q_body_from_gcrf_w REAL)");
    for (int k = 0; k < FRAMES; k++) {
        int id = 10 + 5 * k;
        run_tables_sql(
            t,
            "INSERT INTO frames VALUES (0, %d, %d, %d, 0.5, %d, %d, %d, %d, %d, 14,"
            " '2022-06-16T22:1%d:00.5Z');"
            "INSERT INTO exposures VALUES (0, %d, 3, 0, 0, 0, 1, 7e6, 0, 0, 0, 7e3, 0, 0, 3e4,"
            " 0, 1.5e11, 0, 0)",
            id, k + 1, 1000 * k, X0, Y0, WIDTH * binning_of(k), HEIGHT * binning_of(k),
            binning_of(k), k, id);
        for (int i = 0; i < SOURCES; i++) {
            const source *s = &sources[i];
            run_tables_sql(
                t,
                "INSERT INTO truth VALUES (0, %d, '%s', %d, %d, %d, %g, %g, %g, %g, %g, %g, %g,"
                " %g, %g, %g, %g, %g, %g, 123.5, -7.25)",
                id, s->kind, s->id, s->norad, s->item, s->x[0], s->x[1], s->x[2], s->y[0], s->y[1],
                s->y[2], s->chief[0], s->chief[1], s->centroid[0], s->centroid[1], s->v_mag,
                s->electrons, s->snr);
        }
        /* the first one is a body: of 11 x 7 px, a corner beyond the frame; the others' are small
         */
        run_tables_sql(t,
                       "INSERT INTO shapes VALUES (0, %d, 1, 107.5, 68.25, 98.5, 64.5, 109.5, 71.5,"
                       " 15, 35.5, 4.2e5, 0.1, -0.2, 0.3, 0.9), (0, %d, 4, 99, 62, 98, 61, 100, 63,"
                       " 2, 30, 4e5, 0, 0, 0, 1)",
                       id, id);
        run_tables_sql(
            t, /* of an exposure that is not kept */
            "INSERT INTO truth VALUES (0, %d, 'object', 1, 9, 9, 110, 110, 110, 70, 70, 70,"
            " 110, 70, 110, 70, 5, 1, 1, 0, 0)",
            id + 2);
    }
}

static bst_export request_of(run_tables *t) {
    return (bst_export){.run = t->run,
                        .out = t->place.folder,
                        .last = INT64_MAX,
                        .every = 1,
                        .box_px = 6,
                        .star_limit = 10,
                        .image_bits = 16};
}

static cJSON *read_json(const char *folder, const char *name) {
    char path[2000];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    FILE *file = fopen(path, "r");
    if (!file) {
        fail_msg("no %s", path);
    }
    static char text[100000];
    size_t n = fread(text, 1, sizeof text - 1, file);
    text[n] = '\0';
    fclose(file);
    cJSON *root = cJSON_Parse(text);
    assert_non_null(root);
    return root;
}

static double number(const cJSON *node, const char *key) {
    const cJSON *item = cJSON_GetObjectItemCaseSensitive(node, key);
    if (!cJSON_IsNumber(item)) {
        fail_msg("no number %s", key);
    }
    return item->valuedouble;
}

/* Place on the image in its pixels from the outer corner. */
static double place(double px, double first, int binning) {
    return (px - first + 0.5) / binning;
}

/* The light's box grown by half the given side, within the image; false: none of it. A body of more
 * than the side has the box of its parts, half a pixel of the image wider at each end. */
static bool box_of(const source *s, int binning, double side, double box[4]) {
    double shift[2] = {s->centroid[0] - s->chief[0], s->centroid[1] - s->chief[1]};
    const double *way[2] = {s->x, s->y};
    const double first[2] = {X0, Y0}, size[2] = {WIDTH, HEIGHT};
    for (int a = 0; a < 2; a++) {
        double low = INFINITY, high = -INFINITY;
        for (int k = 0; k < 3; k++) {
            double p = place(way[a][k] + shift[a], first[a], binning);
            low = fmin(low, p);
            high = fmax(high, p);
        }
        if (s->item == 1 && 15 > binning * side) {
            low = place(a == 0 ? 98.5 : 64.5, first[a], binning) + side / 2 - 0.5;
            high = place(a == 0 ? 109.5 : 71.5, first[a], binning) - side / 2 + 0.5;
        }
        low = fmax(low - side / 2, 0);
        high = fmin(high + side / 2, size[a]);
        if (high - low < 1) {
            return false;
        }
        box[a] = low;
        box[a + 2] = high - low;
    }
    return s->electrons > 0 && (strcmp(s->kind, "star") != 0 || s->v_mag <= 10);
}

/* The body of source 0 in pixels of the image, or in fractions of it. */
static void expect_shape(const cJSON *label, int binning, double width, double height) {
    const cJSON *shape = cJSON_GetObjectItem(label, "shape"),
                *box = cJSON_GetObjectItem(shape, "box"),
                *q = cJSON_GetObjectItem(shape, "q_body_from_gcrf");
    const double ends[] = {place(98.5, X0, binning) / width, place(64.5, Y0, binning) / height,
                           11.0 / binning / width, 7.0 / binning / height},
                 turn[] = {0.1, -0.2, 0.3, 0.9};
    bst_assert_close(number(shape, "x_centre_of_mass"), place(107.5, X0, binning) / width, 1e-12);
    bst_assert_close(number(shape, "y_centre_of_mass"), place(68.25, Y0, binning) / height, 1e-12);
    for (int e = 0; e < 4; e++) {
        bst_assert_close(cJSON_GetArrayItem(box, e)->valuedouble, ends[e], 1e-12);
        bst_assert_close(cJSON_GetArrayItem(q, e)->valuedouble, turn[e], 0);
    }
    bst_assert_close(number(shape, "size_px"), 15, 0);
    bst_assert_close(number(shape, "phase_deg"), 35.5, 0);
    bst_assert_close(number(shape, "range_m"), 4.2e5, 0);
}

static void expect_coco(const cJSON *root, bool masks) {
    const cJSON *boxes = cJSON_GetObjectItem(root, "annotations"),
                *images = cJSON_GetObjectItem(root, "images");
    assert_int_equal(cJSON_GetArraySize(images), FRAMES);
    int n = 0;
    for (int k = 0; k < FRAMES; k++) {
        const cJSON *image = cJSON_GetArrayItem(images, k);
        bst_assert_close(number(image, "id"), k + 1, 0);
        bst_assert_close(number(image, "width"), WIDTH, 0);
        bst_assert_close(number(image, "height"), HEIGHT, 0);
        bst_assert_close(number(image, "exposure_id"), 10 + 5 * k, 0);
        for (int i = 0; i < SOURCES; i++) {
            const source *s = &sources[i];
            double box[4];
            if (!box_of(s, binning_of(k), 6, box)) {
                continue;
            }
            const cJSON *a = cJSON_GetArrayItem(boxes, n++);
            bst_assert_close(number(a, "id"), n, 0);
            bst_assert_close(number(a, "image_id"), k + 1, 0);
            bst_assert_close(number(a, "category_id"), strcmp(s->kind, "star") == 0 ? 2 : 1, 0);
            for (int e = 0; e < 4; e++) {
                bst_assert_close(cJSON_GetArrayItem(cJSON_GetObjectItem(a, "bbox"), e)->valuedouble,
                                 box[e], 1e-9);
            }
            bst_assert_close(number(a, "x_centroid"), place(s->centroid[0], X0, binning_of(k)),
                             1e-9);
            bst_assert_close(number(a, "y_centroid"), place(s->centroid[1], Y0, binning_of(k)),
                             1e-9);
            bst_assert_close(number(a, "v_mag"), s->v_mag, 0);
            bst_assert_close(number(a, "snr"), s->snr, 0);
            bst_assert_close(number(a, "norad"), s->norad, 0);
            if (s->item == 1) {
                expect_shape(a, binning_of(k), 1, 1);
            }
            assert_int_equal(cJSON_HasObjectItem(a, "shape"), s->item == 1 || s->item == 4);
            bool masked = masks && s->item <= 2;
            bst_assert_close(number(a, "area"), masked ? (s->item == 1 ? 5 : 1) : box[2] * box[3],
                             1e-9);
            assert_int_equal(cJSON_GetArraySize(cJSON_GetObjectItem(a, "segmentation")), masked);
        }
    }
    assert_int_equal(cJSON_GetArraySize(boxes), n);
    assert_true(n == 3 * FRAMES);
}

static void coco_and_yolo(void **state) {
    (void)state;
    for (int masks = 0; masks < 2; masks++) {
        bst_ctx ctx = {0};
        run_tables t;
        char coco[700], yolo[700];
        make_run(&t, masks);
        run_tables_open(&t);
        bst_export e = request_of(&t);
        snprintf(coco, sizeof coco, "%s/coco", t.place.folder);
        snprintf(yolo, sizeof yolo, "%s/yolo", t.place.folder);
        mkdir(coco, 0700);
        mkdir(yolo, 0700);
        e.coco = coco;
        e.yolo = yolo;
        bst_assert_ok(&ctx, bst_export_boxes(&ctx, &e));
        cJSON *root = read_json(coco, "annotations.json");
        expect_coco(root, masks);
        const char *name =
            cJSON_GetObjectItem(cJSON_GetArrayItem(cJSON_GetObjectItem(root, "images"), 1),
                                "file_name")
                ->valuestring;
        char path[2000];
        snprintf(path, sizeof path, "%s/images/%s", coco, name);
        assert_true(scratch_has(path));
        snprintf(path, sizeof path, "%s/labels/%.*s.txt", yolo, (int)strlen(name) - 4, name);
        FILE *file = fopen(path, "r");
        assert_non_null(file);
        for (int i = 0; i < SOURCES; i++) {
            double box[4], x, y, w, h;
            int class_of;
            if (!box_of(&sources[i], 2, 6, box)) {
                continue;
            }
            assert_int_equal(fscanf(file, "%d %lf %lf %lf %lf", &class_of, &x, &y, &w, &h), 5);
            assert_int_equal(class_of, strcmp(sources[i].kind, "star") == 0);
            bst_assert_close(x, (box[0] + box[2] / 2) / WIDTH, 1e-9);
            bst_assert_close(y, (box[1] + box[3] / 2) / HEIGHT, 1e-9);
            bst_assert_close(w, box[2] / WIDTH, 1e-9);
            bst_assert_close(h, box[3] / HEIGHT, 1e-9);
        }
        assert_int_equal(fgetc(file), '\n');
        assert_int_equal(fgetc(file), EOF);
        fclose(file);
        cJSON_Delete(root);
        run_tables_end(&t);
    }
}

/* Every second exposure number from 10 on: 10 and 20, not 15. */
static void some_frames(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    run_tables t;
    char coco[700];
    make_run(&t, false);
    run_tables_open(&t);
    bst_export e = request_of(&t);
    snprintf(coco, sizeof coco, "%s/coco", t.place.folder);
    mkdir(coco, 0700);
    e.coco = coco;
    e.first = 10;
    e.every = 2;
    e.image_bits = 8;
    bst_assert_ok(&ctx, bst_export_boxes(&ctx, &e));
    cJSON *root = read_json(coco, "annotations.json");
    const cJSON *images = cJSON_GetObjectItem(root, "images");
    assert_int_equal(cJSON_GetArraySize(images), 2);
    bst_assert_close(number(cJSON_GetArrayItem(images, 1), "exposure_id"), 20, 0);
    assert_int_equal(cJSON_GetArraySize(cJSON_GetObjectItem(root, "annotations")), 6);
    cJSON_Delete(root);
    run_tables_end(&t);
}

static void expect_axis(const cJSON *node, char axis, const double v[3], double box) {
    const char *const names[] = {"min", "max", "center", "start", "mid", "end"};
    double low = fmin(v[0], fmin(v[1], v[2])), high = fmax(v[0], fmax(v[1], v[2]));
    const double values[] = {low, high, (low + high) / 2, v[0], v[1], v[2]};
    for (int k = 0; k < 6; k++) {
        char key[16];
        snprintf(key, sizeof key, "%c_%s", axis, names[k]);
        bst_assert_close(number(node, key), values[k], 1e-12);
    }
    bst_assert_close(number(node, axis == 'x' ? "bbox_width" : "bbox_height"),
                     box > 0 ? box : high - low, 1e-12);
}

static void expect_satnet(const cJSON *root, int k, double side) {
    const cJSON *data = cJSON_GetObjectItem(root, "data"),
                *list = cJSON_GetObjectItem(data, "objects");
    int b = binning_of(k), n = 0, satellites = 0;
    bst_assert_close(number(cJSON_GetObjectItem(data, "sensor"), "width"), WIDTH, 0);
    bst_assert_close(number(cJSON_GetObjectItem(data, "sensor"), "iFOVx"), 3.0 * b / 3600, 1e-15);
    for (int i = 0; i < SOURCES; i++) {
        const source *s = &sources[i];
        double x[3], y[3], shift[2] = {s->centroid[0] - s->chief[0], s->centroid[1] - s->chief[1]};
        bool star = strcmp(s->kind, "star") == 0, inside[2] = {false, false};
        for (int e = 0; e < 3; e++) {
            x[e] = place(s->x[e] + shift[0], X0, b) / WIDTH;
            y[e] = place(s->y[e] + shift[1], Y0, b) / HEIGHT;
        }
        inside[0] = fmax(x[0], fmax(x[1], x[2])) >= 0 && fmin(x[0], fmin(x[1], x[2])) <= 1;
        inside[1] = fmax(y[0], fmax(y[1], y[2])) >= 0 && fmin(y[0], fmin(y[1], y[2])) <= 1;
        if (!inside[0] || !inside[1] || !(s->electrons > 0) || (star && s->v_mag > 10)) {
            continue;
        }
        const cJSON *o = cJSON_GetArrayItem(list, n++);
        satellites += !star;
        assert_string_equal(cJSON_GetObjectItem(o, "class_name")->valuestring,
                            star ? "Star" : "Satellite");
        bst_assert_close(number(o, "class_id"), star ? 2 : 1, 0);
        expect_axis(o, 'x', x, side / WIDTH);
        expect_axis(o, 'y', y, side / HEIGHT);
        bst_assert_close(number(o, "x_centroid"), place(s->centroid[0], X0, b) / WIDTH, 1e-12);
        bst_assert_close(number(o, "y_centroid"), place(s->centroid[1], Y0, b) / HEIGHT, 1e-12);
        bst_assert_close(number(o, "x_chief"), place(s->chief[0], X0, b) / WIDTH, 1e-12);
        bst_assert_close(number(o, "y_chief"), place(s->chief[1], Y0, b) / HEIGHT, 1e-12);
        bst_assert_close(number(o, "magnitude"), s->v_mag, 0);
        bst_assert_close(number(o, "pe_per_sec"), s->electrons / 0.5, 1e-9);
        bst_assert_close(number(o, "snr_aperture"), s->snr, 0);
        bst_assert_close(number(o, "ra"), 123.5, 0);
        bst_assert_close(number(o, "dec"), -7.25, 0);
        if (s->item == 1) {
            expect_shape(o, b, WIDTH, HEIGHT);
        }
        bst_assert_close(number(o, "seg_id"), -1, 0); /* the scenario records no masks */
        char id[20];
        snprintf(id, sizeof id, "%d", !star && s->norad ? s->norad : s->id);
        assert_string_equal(cJSON_GetObjectItem(o, "object_id")->valuestring, id);
    }
    assert_int_equal(cJSON_GetArraySize(list), n);
    bst_assert_close(number(cJSON_GetObjectItem(data, "stats"), "num_obs"), satellites, 0);
    bst_assert_close(number(cJSON_GetObjectItem(data, "file"), "sequence_id"), 10 + 5 * k, 0);
    bst_assert_close(number(cJSON_GetObjectItem(data, "metadata"), "exposure_s"), 0.5, 0);
}

static void satnet(void **state) {
    (void)state;
    static const double sides[] = {20, 0};
    for (int c = 0; c < 2; c++) {
        bst_ctx ctx = {0};
        run_tables t;
        char folder[700], name[1100];
        make_run(&t, false);
        run_tables_open(&t);
        bst_export e = request_of(&t);
        snprintf(folder, sizeof folder, "%s/satnet", t.place.folder);
        mkdir(folder, 0700);
        e.satnet = folder;
        e.box_px = sides[c];
        e.split = c ? NULL : "2,1,1";
        bst_assert_ok(&ctx, bst_export_satnet(&ctx, &e));
        char set[256];
        bst_export_set_name(t.run, NULL, set);
        assert_string_equal(set, strrchr(t.place.folder, '/') + 1);
        for (int k = 0; k < FRAMES; k++) {
            snprintf(name, sizeof name, "Annotations/%s.%04d.json", set, 10 + 5 * k);
            cJSON *root = read_json(folder, name);
            expect_satnet(root, k, sides[c]);
            cJSON_Delete(root);
            snprintf(name, sizeof name, "%s/ImageFiles/%s.%04d.fits", folder, set, 10 + 5 * k);
            assert_true(scratch_has(name));
        }
        run_tables_end(&t);
    }
}

static void shares_of_parts(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    double s[3];
    bst_assert_ok(&ctx, bst_export_split(&ctx, "80,10,30", s));
    bst_assert_close(s[0], 2.0 / 3, 1e-15);
    bst_assert_close(s[1], 1.0 / 12, 1e-15);
    bst_assert_close(s[2], 0.25, 1e-15);
    static const char *const wrong[] = {"1,2",    "1,2,3,4", "-1,1,1", "1,-1,1",
                                        "1,1,-1", "0,0,0",   "a,b,c"};
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
        assert_int_equal(bst_export_split(&ctx, wrong[i], s), BST_ERR_ARGUMENT);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(coco_and_yolo),
        cmocka_unit_test(some_frames),
        cmocka_unit_test(satnet),
        cmocka_unit_test(shares_of_parts),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
