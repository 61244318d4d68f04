/* Side tables: values of pictures by a keyword map, their pages, and what is wrong with a table. */
#include "tests/io/written_pictures.h"

static const char map_text[] =
    "{\"boresight_keyword_map\": 1, \"name\": \"mine\", \"time\": {\"keyword\": \"WHEN\"},"
    " \"exposure_s\": {\"keyword\": \"ms\", \"factor\": 0.001},"
    " \"gain_e_per_dn\": {\"keyword\": \"Gain\", \"value\": 3},"
    " \"pixel_scale_arcsec\": {\"value\": 5}, \"image_section\": \"part\","
    " \"file_column\": \"path|file\", \"attitude\": \"direction\","
    " \"exposure_id\": {\"keyword\": \"id\", \"value\": -1}}";

/* Writes text to a file of the scratch folder. */
static void write_text(fixture *f, const char *name, const char *text) {
    snprintf(f->path, sizeof f->path, "%s/%s", f->place.folder, name);
    FILE *file = fopen(f->path, "w");
    assert_non_null(file);
    fputs(text, file);
    fclose(file);
}

/* Pictures a.png, b.png of 3 x 2 px and cube.tif of two pages of 2 x 1. */
static fixture begin_pictures(bst_keyword_map *map, const char *text) {
    fixture f = begin("a.png");
    write_png16(&f, 3, 2, 100);
    snprintf(f.path, sizeof f.path, "%s/b.png", f.place.folder);
    write_png16(&f, 3, 2, 200);
    snprintf(f.path, sizeof f.path, "%s/cube.tif", f.place.folder);
    const tiff_page pages[] = {{.width = 2, .height = 1, .bits = 8, .data = "\1\2", .bytes = 2},
                               {.width = 2, .height = 1, .bits = 8, .data = "\3\4", .bytes = 2}};
    write_tiff(&f, false, pages, 2);
    load_map(&f, text, map);
    return f;
}

/* Reads all frames of the table; sum: of the last frame's pixels. */
static bst_status read_all(fixture *f, const bst_keyword_map *map, bst_recorded_frame *last,
                           double *sum) {
    const char *paths[] = {f->path};
    const bst_recorded_options options = {.map = map};
    bst_recorded_frames *frames;
    bst_status status = bst_recorded_frames_open(&f->ctx, paths, 1, map, &frames);
    for (int64_t i = 0; status == BST_OK && i < bst_recorded_frames_count(frames); i++) {
        const float *pixels;
        bst_quat q;
        bool has;
        status = bst_recorded_frames_select(&f->ctx, frames, i, &options, last);
        if (status == BST_OK) {
            status = bst_keyword_attitude(&f->ctx, map, bst_recorded_frames_source(frames),
                                          &last->place, false, &has, &q);
        }
        if (status == BST_OK) {
            status = bst_recorded_frames_pixels(&f->ctx, frames, &options, last, &pixels);
        }
        *sum = 0.0;
        for (int k = 0; status == BST_OK && k < last->width * last->height; k++) {
            *sum += (double)pixels[k];
        }
    }
    bst_recorded_frames_close(frames);
    return status;
}

static void test_values(void **state) {
    (void)state;
    bst_keyword_map map;
    fixture f = begin_pictures(&map, map_text);
    bst_recorded_frame r;
    double sum;
    write_text(&f, "night.csv",
               "# of the camera's program\r\n"
               "File , WHEN,ms,GAIN,part,remark\r\n"
               "\r\n"
               "a.png,2024-08-26T17:45:45,250,1.5,\"[2:3,1:1]\",\"a, \"\"b\"\"\"\r\n"
               " \"b.png\",2024-08-26 17:45:46.5Z, 500 ,,\"[1:1,1:2]\",\r\n");
    bst_assert_ok(&f.ctx, read_all(&f, &map, &r, &sum));
    assert_int_equal(r.width, 1);
    assert_int_equal(r.height, 2);
    assert_int_equal(r.place.line, 5);
    assert_int_equal(r.place.hdu, 0);
    bst_assert_close(sum, 200 + 203, 0.0); /* the first column of b.png */
    bst_assert_close(r.values.exposure_s, 0.5, 0.0);
    bst_assert_close(r.values.gain_e_per_dn, 3.0, 0.0); /* the field is empty */
    bst_time expected;
    bst_assert_ok(&f.ctx, bst_time_from_utc(&f.ctx, "2024-08-26T17:45:46.5Z", &expected));
    bst_assert_close(bst_time_diff(r.values.start, expected), 0.0, 1e-9); /* the same text */
    end(&f);
}

/* Rows of one TIFF file are its pages in their order, or those of the column. */
static void test_pages(void **state) {
    (void)state;
    bst_keyword_map map;
    fixture f = begin_pictures(
        &map,
        "{\"boresight_keyword_map\": 1, \"time\": {\"keyword\": \"t\", \"format\": \"unix\"},"
        " \"exposure_s\": {\"value\": 1}, \"pixel_scale_arcsec\": {\"value\": 5}}");
    bst_recorded_frame r;
    double sum;
    write_text(&f, "t.csv", "image,t\ncube.tif,10\ncube.tif,1724694345.25\n");
    bst_assert_ok(&f.ctx, read_all(&f, &map, &r, &sum));
    bst_assert_close(sum, 7.0, 0.0);
    bst_time expected;
    bst_assert_ok(&f.ctx, bst_time_from_utc(&f.ctx, "2024-08-26T17:45:45.25Z", &expected));
    bst_assert_close(bst_time_diff(r.values.start, expected), 0.0, 1e-6); /* digits of the number */
    write_text(&f, "t.csv", "image,t,page\ncube.tif,10,2\n./cube.tif,20,1\n");
    bst_assert_ok(&f.ctx, read_all(&f, &map, &r, &sum));
    bst_assert_close(sum, 3.0, 0.0);
    end(&f);
}

/* first_row and flip_rows: the picture's top row is row 0 unless one of them reverses it. */
static void test_first_row(void **state) {
    (void)state;
    for (int k = 0; k < 4; k++) {
        bst_keyword_map map;
        fixture f = begin_pictures(&map, k & 1 ? "{\"boresight_keyword_map\": 1, \"exposure_s\":"
                                                 " {\"value\": 1}, \"first_row\": \"bottom\"}"
                                               : "{\"boresight_keyword_map\": 1, \"exposure_s\":"
                                                 " {\"value\": 1}}");
        snprintf(f.path, sizeof f.path, "%s/a.png", f.place.folder);
        const char *paths[] = {f.path};
        /* without a table a picture has no keywords: those of the map are not asked for */
        bst_recorded_options options = {.flip_rows = k >= 2};
        bst_recorded_frames *frames;
        bst_recorded_frame r;
        const float *pixels;
        bst_assert_ok(&f.ctx, bst_recorded_frames_open(&f.ctx, paths, 1, &map, &frames));
        bst_assert_ok(&f.ctx, bst_recorded_frames_select(&f.ctx, frames, 0, &options, &r));
        options.map = &map;
        bst_assert_ok(&f.ctx, bst_recorded_frames_pixels(&f.ctx, frames, &options, &r, &pixels));
        bst_assert_close(pixels[0], k == 0 || k == 3 ? 100.0 : 103.0, 0.0);
        bst_recorded_frames_close(frames);
        end(&f);
    }
}

/* Attitude of the only row of a table. */
static bst_status read_attitude(fixture *f, const char *map_text_, const char *table, bool *has,
                                bst_quat *q) {
    bst_keyword_map map;
    load_map(f, map_text_, &map);
    write_text(f, "one.csv", table);
    const char *paths[] = {f->path};
    const bst_recorded_options options = {.map = &map};
    bst_recorded_frames *frames;
    bst_recorded_frame r;
    bst_assert_ok(&f->ctx, bst_recorded_frames_open(&f->ctx, paths, 1, &map, &frames));
    bst_assert_ok(&f->ctx, bst_recorded_frames_select(&f->ctx, frames, 0, &options, &r));
    bst_status status = bst_keyword_attitude(&f->ctx, &map, bst_recorded_frames_source(frames),
                                             &r.place, false, has, q);
    bst_recorded_frames_close(frames);
    return status;
}

/* Attitudes by direction and by quaternion: a camera at RA 90, Dec 0 with up to the north looks
 * along GCRF's y, its x is GCRF's x (the west), its y the south: a rotation by 90 degrees about x.
 */
static void test_attitudes(void **state) {
    (void)state;
#define TIMES                                                                               \
    "\"time\": {\"keyword\": \"t\", \"format\": \"mjd\"}, \"exposure_s\": {\"value\": 1}, " \
    "\"pixel_scale_arcsec\": {\"value\": 5}"
    static const char by_direction[] =
        "{\"boresight_keyword_map\": 1, " TIMES ", \"attitude\": \"direction\"}";
    static const char inward[] =
        "{\"boresight_keyword_map\": 1, " TIMES ", \"attitude\": \"quaternion\"}";
    static const char outward[] = "{\"boresight_keyword_map\": 1, " TIMES
                                  ", \"attitude\": \"quaternion\", \"quaternion\":"
                                  " {\"rotates\": \"camera_to_gcrf\"}}";
    static const struct {
        const char *map, *table;
        double x, y, z; /* what the camera's x axis is in GCRF */
    } cases[] = {
        {by_direction, "file,t,ra,dec,roll\na.png,60000,90,0,0\n", 1, 0, 0},
        {by_direction, "file,t,ra,dec,roll\na.png,60000,6:00:00.0,-0:00:00,0\n", 1, 0, 0},
        {by_direction, "file,t,RA,DEC,ROLL\na.png,60000,6 00 00,0,90\n", 0, 0, 1}, /* up is east */
        {inward, "file,t,qw,qx,qy,qz\na.png,60000,0.70710678,0.70710678,0,0\n", 1, 0, 0},
        {outward, "file,t,qx,qy,qz,qw\na.png,60000,0.70710678,0,0,-0.70710678\n", 1, 0, 0},
    };
    bst_keyword_map map;
    fixture f = begin_pictures(&map, map_text);
    bool has;
    bst_quat q;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        bst_assert_ok(&f.ctx, read_attitude(&f, cases[i].map, cases[i].table, &has, &q));
        assert_true(has);
        bst_vec3 z = bst_quat_rotate(q, (bst_vec3){0, 1, 0});
        bst_vec3 x = bst_quat_rotate(bst_quat_conj(q), (bst_vec3){1, 0, 0});
        bst_assert_close(z.z, 1.0, 1e-8); /* eight digits of the quaternion */
        bst_assert_close(x.x, cases[i].x, 1e-8);
        bst_assert_close(x.y, cases[i].y, 1e-8);
        bst_assert_close(x.z, cases[i].z, 1e-8);
    }
    bst_assert_ok(&f.ctx, read_attitude(&f, inward, "file,t,qx\na.png,60000,1\n", &has, &q));
    assert_false(has); /* not all of it */
    assert_int_equal(
        read_attitude(&f, inward, "file,t,qx,qy,qz,qw\na.png,60000,1,1,0,0\n", &has, &q),
        BST_ERR_FORMAT);
    assert_non_null(strstr(f.ctx.message,
                           "one.csv: line 2: column QW (quaternion of the map map): "
                           "is a quaternion of length 1.41421"));
    assert_int_equal(
        read_attitude(&f, by_direction, "file,t,ra,dec,roll\na.png,60000,1,91:00:00,0\n", &has, &q),
        BST_ERR_FORMAT);
    assert_non_null(strstr(f.ctx.message, "column DEC (dec_deg of the map map): is out of range"));
    end(&f);
}

/* What is wrong is said with the table, its line and column. */
static void test_messages(void **state) {
    (void)state;
#define ROW "a.png,2024-08-26T17:45:45,250,1.5,\n"
#define HEAD "path,WHEN,ms,gain,part\n"
    static const struct {
        const char *table, *says[2];
    } cases[] = {
        {HEAD "a.png,yesterday,250,1,\n",
         {"line 2: column WHEN (time of the map mine)", "no time"}},
        {HEAD "a.png,,250,1,\n", {"line 2: column WHEN", "is missing"}},
        {HEAD ROW "b.png,2024-08-26T17:45:45,long,1,\n",
         {"line 3: column ms (exposure_s of the map mine)", "no number"}},
        {HEAD "a.png,2024-08-26T17:45:45,-250,1,\n", {"line 2: column ms", "gives -0.25"}},
        {HEAD "a.png,2024-08-26T17:45:45,250,1,\"[1:4,1:2]\"\n",
         {"line 2: column part (section of the map): ", "within 3 x 2"}},
        {HEAD "a.png,2024-08-26T17:45:45,250\n", {"line 2: has 3 fields", "has 5 columns"}},
        {HEAD "a.png,\"2024,250,1,\n", {"line 2: has an unclosed quote", "RFC 4180"}},
        {HEAD ",2024-08-26T17:45:45,250,1,\n", {"line 2: column path", "is empty"}},
        {HEAD ROW "# again\n" ROW, {"line 4: column path", "is in line 2, too"}},
        {HEAD "c.png,2024-08-26T17:45:45,250,1,\n", {"line 2: column path", "c.png: cannot be"}},
        {HEAD "cube.tif,2024-08-26T17:45:45,250,1,\n",
         {"line 2: column path", "cube.tif has 2 pages, not as many as rows"}},
        {"path,WHEN,ms,page\ncube.tif,1,2,3\n", {"line 2: column page", "fewer than this"}},
        {"path,WHEN,ms,page\ncube.tif,1,2,x\n", {"line 2: column page", "\"x\" is no page"}},
        {"path,page\ncube.tif,1\na.png,1\ncube.tif,1\n", {"line 4: column path", "in line 2, too"}},
        {"path,page\ncube.tif,2\ncube.tif,1\ncube.tif,2\n",
         {"line 4: column path", "in line 2, too"}},
        {"path,ms,MS\na.png,1,2\n", {"line 1: column MS", "twice, as columns 2 and 3"}},
        {"name,ms\na.png,1\n", {"line 1: has no column", "path|file"}},
        {"path;ms\na.png;1\n", {"line 1: has column names", "(allowed: by commas)"}},
        {"path;time_utc;exposure_s;gain_e_per_dn;read_noise_e;offset_dn;pixel_scale_arcsec;ra_"
         "deg\n",
         {"line 1: has column names", "(allowed: by commas)"}},
        {"path,WHEN,ms,id\na.png,2024-08-26T17:45:45,1,7.5\n",
         {"line 2: column id (exposure_id of the map mine)", "gives 7.5 (allowed: a whole number"}},
        {HEAD, {"has no rows", "a row for each frame"}},
        {"path,WHEN,ms,ra,dec,roll\na.png,2024-08-26T17:45:45,1,x,0,0\n",
         {"line 2: column RA (ra_deg of the map mine)", "no number"}},
    };
    bst_keyword_map map;
    fixture f = begin_pictures(&map, map_text);
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        bst_recorded_frame r;
        double sum;
        write_text(&f, "bad.csv", cases[i].table);
        /* the table of the last case has no column of sections */
        snprintf(map.image_section, sizeof map.image_section, "%s",
                 strstr(cases[i].table, "part") ? "part" : "");
        bst_status status = read_all(&f, &map, &r, &sum);
        for (int k = 0; k < 2; k++) {
            if (status == BST_OK || !strstr(f.ctx.message, cases[i].says[k]) ||
                !strstr(f.ctx.message, "bad.csv: ")) {
                fail_msg("case %zu: \"%s\" does not say \"%s\"", i, f.ctx.message,
                         cases[i].says[k]);
            }
        }
    }
    end(&f);
}

/* A picture that is damaged after the table was opened, or has another size, names the line. */
static void test_damaged_picture(void **state) {
    (void)state;
    bst_keyword_map map;
    fixture f = begin_pictures(&map, map_text);
    bst_recorded_frame r;
    double sum;
    *map.image_section = '\0';
    snprintf(f.path, sizeof f.path, "%s/b.png", f.place.folder);
    write_png16(&f, 3, 2, 7);
    save(&f, f.count - 16);
    write_text(&f, "night.csv",
               "file,WHEN,ms\na.png,2024-08-26T17:45:45,1\nb.png,2024-08-26T17:45:46,1\n");
    assert_int_equal(read_all(&f, &map, &r, &sum), BST_ERR_FORMAT);
    assert_non_null(strstr(f.ctx.message, "night.csv: line 3: "));
    assert_non_null(strstr(f.ctx.message, "b.png: is cut short"));
    end(&f);
}

/* A folder with one side table gives its frames; several are an error; without any the pictures. */
static void test_folder(void **state) {
    (void)state;
    bst_keyword_map map;
    fixture f = begin_pictures(&map, map_text);
    bst_recorded_frames *frames;
    const char *paths[] = {f.place.folder};
    bst_assert_ok(&f.ctx, bst_recorded_frames_open(&f.ctx, paths, 1, &map, &frames));
    assert_int_equal(bst_recorded_frames_count(frames), 4); /* a.png, b.png, two of cube.tif */
    bst_recorded_frames_close(frames);
    write_text(&f, "night.csv", "file\nb.png\n");
    bst_assert_ok(&f.ctx, bst_recorded_frames_open(&f.ctx, paths, 1, &map, &frames));
    assert_int_equal(bst_recorded_frames_count(frames), 1);
    assert_non_null(strstr(bst_recorded_frames_file(frames, 0), "night.csv"));
    bst_recorded_frames_close(frames);
    write_text(&f, "other.csv", "file\na.png\n");
    assert_int_equal(bst_recorded_frames_open(&f.ctx, paths, 1, &map, &frames), BST_ERR_ARGUMENT);
    assert_non_null(strstr(f.ctx.message, "has several side tables"));
    end(&f);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_values),    cmocka_unit_test(test_pages),
        cmocka_unit_test(test_first_row), cmocka_unit_test(test_attitudes),
        cmocka_unit_test(test_messages),  cmocka_unit_test(test_damaged_picture),
        cmocka_unit_test(test_folder),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
