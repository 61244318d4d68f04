/* Frames of other programs: files are written here byte by byte after the FITS Standard, so that
 * what is expected does not come from the library that reads.
 *
 * test_io_recorded_frames [mutations=N]: damaged files beyond the usual 2000 */
#include "tests/io/written_fits.h"

static long mutations = 2000;

/* Reads the pixels of a frame of the file. */
static void pixels_of(fixture *f, int64_t index, int width, int height, float *pixels) {
    bst_fits_source *s;
    bst_fits_source_frame frame;
    save(f, f->count);
    bst_assert_ok(&f->ctx, bst_fits_source_open(&f->ctx, f->path, &s));
    bst_assert_ok(&f->ctx, bst_fits_source_select(&f->ctx, s, index, &frame));
    assert_int_equal(frame.width, width);
    assert_int_equal(frame.height, height);
    bst_assert_ok(&f->ctx, bst_fits_source_pixels(&f->ctx, s, pixels));
    bst_fits_source_close(s);
}

/* Every kind of pixel, with scaling and blank values. */
static void test_pixels(void **state) {
    (void)state;
    static const struct {
        int bitpix;
        double zero, scale;
        int64_t raw[2];
        double expected[2];
    } cases[] = {{8, 0, 1, {0, 255}, {0, 255}},
                 {16, 32768, 1, {-32768, 32767}, {0, 65535}},
                 {16, 0, 1, {-5, 32767}, {-5, 32767}},
                 {32, 100, 0.5, {-7, 9}, {96.5, 104.5}},
                 {64, 0, 1, {-3, 4}, {-3, 4}}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        fixture f = begin("one.fits");
        begin_image(&f, true, cases[i].bitpix, 3, 1, 0);
        card(&f, "BZERO   = %20.1f", cases[i].zero);
        card(&f, "BSCALE  = %20.1f", cases[i].scale);
        card(&f, "BLANK   = %20d", 77);
        end_header(&f);
        for (int k = 0; k < 2; k++) {
            big_endian(&f, (uint64_t)cases[i].raw[k], cases[i].bitpix / 8);
        }
        big_endian(&f, 77, cases[i].bitpix / 8);
        pad(&f, 0);
        float pixels[3];
        pixels_of(&f, 0, 3, 1, pixels);
        bst_assert_close(pixels[0], cases[i].expected[0], 0.0); /* exact in single precision */
        bst_assert_close(pixels[1], cases[i].expected[1], 0.0);
        assert_true(isnan(pixels[2]));
        end(&f);
    }
    fixture f = begin("real.fits");
    begin_image(&f, true, -64, 2, 1, 0);
    card(&f, "EXTEND  =                    T");
    end_header(&f);
    real64(&f, -10453.25);
    real64(&f, (double)NAN);
    pad(&f, 0);
    begin_image(&f, false, -32, 2, 2, 0);
    end_header(&f);
    for (int i = 0; i < 4; i++) {
        real32(&f, 0.5f * (float)i);
    }
    pad(&f, 0);
    float pixels[4];
    pixels_of(&f, 0, 2, 1, pixels);
    bst_assert_close(pixels[0], -10453.25, 0.0);
    assert_true(isnan(pixels[1]));
    pixels_of(&f, 1, 2, 2, pixels);
    bst_assert_close(pixels[3], 1.5, 0.0);
    end(&f);
}

static const char map_text[] =
    "{\"boresight_keyword_map\": 1, \"name\": \"mine\", \"exposure_s\": {\"keyword\": \"EXPTIME\"},"
    " \"gain_e_per_dn\": {\"keyword\": \"GAIN|EGAIN\", \"value\": 3},"
    " \"exposure_id\": {\"keyword\": \"FRAMEID\", \"value\": -1},"
    " \"pixel_scale_arcsec\": {\"keyword\": \"CDELT1\", \"factor\": 3600, \"value\": 5},"
    " \"observer_position_gcrf_m\": {\"x\": {\"keyword\": \"POS[1]|POSX\", \"factor\": 1000},"
    " \"y\": {\"keyword\": \"POS[2]|POSY\"}, \"z\": {\"value\": 7}},"
    " \"image_section\": \"TRIMSEC\", \"bias_section\": \"BIASSEC\", \"pedestal_dn\": 10,"
    " \"dn_per_unit\": 2}";

/* Cards that the map above asks for. */
static void mapped_cards(fixture *f, const char *exptime, const char *date, const char *trim) {
    card(f, "DATE-OBS= '%s'", date);
    card(f, "EXPTIME = %s / [s]", exptime);
    card(f, "EGAIN   = '1.10    '           / text, as some archives write numbers");
    card(f, "POSX    =                 6.5D3");
    card(f, "POSY    =                   -2.");
    card(f, "TRIMSEC = '%s'", trim);
    card(f, "BIASSEC = '[1:1,1:2]'");
}

/* A frame of 3 x 2 pixels whose first column is overscan. */
static void mapped_file(fixture *f, const char *exptime, const char *date, const char *trim) {
    begin_image(f, true, 16, 3, 2, 0);
    mapped_cards(f, exptime, date, trim);
    end_header(f);
    const int16_t values[] = {100, 103, 90, 100, 120, 140};
    for (int i = 0; i < 6; i++) {
        big_endian(f, (uint64_t)(int64_t)values[i], 2);
    }
    pad(f, 0);
    save(f, f->count);
}

static void test_keywords_and_sections(void **state) {
    (void)state;
    fixture f = begin("raw.fits");
    bst_keyword_map map;
    load_map(&f, map_text, &map);
    mapped_file(&f, "2.5", "2024-08-26T17:45:45.582", "[2:3,1:2]");
    const char *paths[] = {f.path};
    bst_recorded_frames *frames;
    bst_recorded_frame r;
    bst_recorded_options options = {.map = &map, .flip_rows = true};
    bst_assert_ok(&f.ctx, bst_recorded_frames_open(&f.ctx, paths, 1, NULL, &frames));
    bst_assert_ok(&f.ctx, bst_recorded_frames_select(&f.ctx, frames, 0, &options, &r));
    assert_int_equal(r.width, 2);
    assert_int_equal(r.height, 2);
    bst_time expected;
    bst_assert_ok(&f.ctx, bst_time_from_utc(&f.ctx, "2024-08-26T17:45:45.582Z", &expected));
    bst_assert_close(bst_time_diff(r.values.start, expected), 0.0, 1e-9); /* the same text */
    bst_assert_close(r.values.exposure_s, 2.5, 0.0);
    bst_assert_close(r.values.gain_e_per_dn, 1.1, 0.0);
    bst_assert_close(r.values.pixel_scale_arcsec, 5.0, 0.0);
    assert_int_equal(r.values.exposure_id, -1);
    assert_true(r.values.has_position);
    assert_false(r.values.has_velocity);
    bst_assert_close(r.values.position_gcrf_m.x, 6.5e6, 0.0);
    bst_assert_close(r.values.position_gcrf_m.z, 7.0, 0.0);
    const float *pixels;
    uint16_t dn[4];
    int64_t clipped, blank;
    bst_assert_ok(&f.ctx, bst_recorded_frames_pixels(&f.ctx, frames, &options, &r, &pixels));
    bst_assert_close(r.bias_dn, 100.0, 0.0);
    bst_assert_close(pixels[0], 20.0, 0.0); /* the last row comes first */
    bst_assert_close(pixels[3], -10.0, 0.0);
    bst_assert_ok(&f.ctx, bst_recorded_counts(&f.ctx, pixels, 4, &map, dn, &clipped, &blank));
    assert_int_equal(dn[0], 50);
    assert_int_equal(dn[2], 16);
    assert_int_equal(dn[3], 0); /* 10 - 20 */
    assert_int_equal(clipped, 1);
    assert_int_equal(blank, 0);
    bst_recorded_frames_close(frames);
    end(&f);
}

/* Counts are the nearest whole numbers; a blank pixel has the median of the others. */
static void test_counts(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    const bst_keyword_map map = {.pedestal_dn = 7.0, .dn_per_unit = 4.0};
    const float none = (float)NAN;
    /* sorted, of those that are there: -3, 0.1, 0.15, 2, 20000, so that 7 + 4 * 0.15 fills */
    const float pixels[] = {none, 2.0f, none, 0.1f, none, 20000.0f, none, -3.0f, none, 0.15f, none};
    const uint16_t expected[] = {8, 15, 8, 7, 8, 65535, 8, 0, 8, 8, 8};
    uint16_t dn[11];
    int64_t clipped, blank;
    bst_assert_ok(&ctx, bst_recorded_counts(&ctx, pixels, 11, &map, dn, &clipped, &blank));
    for (int i = 0; i < 11; i++) {
        assert_int_equal(dn[i], expected[i]);
    }
    assert_int_equal(clipped, 2);
    assert_int_equal(blank, 6);
    /* without a map pixels are counts */
    const float whole[] = {0.49f, 0.51f, 65535.25f, 41.5f};
    const uint16_t rounded[] = {0, 1, 65535, 42};
    bst_assert_ok(&ctx, bst_recorded_counts(&ctx, whole, 4, NULL, dn, &clipped, NULL));
    for (int i = 0; i < 4; i++) {
        assert_int_equal(dn[i], rounded[i]);
    }
    assert_int_equal(clipped, 0);
}

/* Values of each plane are in the table behind a cube. */
static void test_cube_table(void **state) {
    (void)state;
    fixture f = begin("cube.fits");
    bst_keyword_map map;
    load_map(&f,
             "{\"boresight_keyword_map\": 1, \"exposure_s\": {\"keyword\": \"EXPTIME\"},"
             " \"pixel_scale_arcsec\": {\"keyword\": \"PIXSCALE\"},"
             " \"exposure_id\": {\"keyword\": \"FRAMEID\"}, \"observer_position_gcrf_m\": {"
             " \"x\": {\"keyword\": \"POS[1]\"}, \"y\": {\"keyword\": \"POS[2]\"},"
             " \"z\": {\"keyword\": \"POS[3]\"}}}",
             &map);
    begin_image(&f, true, 8, 2, 1, 2);
    card(&f, "PIXSCALE=                   4.");
    end_header(&f);
    put(&f, "\1\2\3\4", 4);
    pad(&f, 0);
    card(&f, "XTENSION= 'BINTABLE'");
    card(&f, "BITPIX  =                    8");
    card(&f, "NAXIS   =                    2");
    card(&f, "NAXIS1  =                   52");
    card(&f, "NAXIS2  =                    2");
    card(&f, "PCOUNT  =                    0");
    card(&f, "GCOUNT  =                    1");
    card(&f, "TFIELDS =                    4");
    card(&f, "TTYPE1  = 'FRAMEID '");
    card(&f, "TFORM1  = '1J      '");
    card(&f, "TTYPE2  = 'DATE-OBS'");
    card(&f, "TFORM2  = '20A     '");
    card(&f, "TTYPE3  = 'POS     '");
    card(&f, "TFORM3  = '3D      '");
    card(&f, "TTYPE4  = 'EXPTIME '");
    card(&f, "TFORM4  = 'E       '");
    end_header(&f);
    for (int row = 0; row < 2; row++) {
        big_endian(&f, (uint64_t)(row + 41), 4);
        put(&f, row == 0 ? "2024-08-26T17:45:45 " : "2024-08-26T17:45:55 ", 20);
        for (int k = 0; k < 3; k++) {
            real64(&f, 1e6 * (row + 1) + k);
        }
        real32(&f, 0.5f);
    }
    pad(&f, 0);
    save(&f, f.count);
    const char *paths[] = {f.path};
    bst_recorded_frames *frames;
    bst_recorded_frame r;
    const bst_recorded_options options = {.map = &map};
    const float *pixels;
    bst_assert_ok(&f.ctx, bst_recorded_frames_open(&f.ctx, paths, 1, NULL, &frames));
    assert_int_equal(bst_recorded_frames_count(frames), 2);
    bst_assert_ok(&f.ctx, bst_recorded_frames_select(&f.ctx, frames, 1, &options, &r));
    assert_int_equal(r.values.exposure_id, 42);
    bst_assert_close(r.values.exposure_s, 0.5, 0.0);
    bst_assert_close(r.values.position_gcrf_m.z, 2e6 + 2.0, 0.0);
    bst_assert_close(r.values.pixel_scale_arcsec, 4.0, 0.0);
    bst_assert_ok(&f.ctx, bst_recorded_frames_pixels(&f.ctx, frames, &options, &r, &pixels));
    bst_assert_close(pixels[1], 4.0, 0.0);
    /* one time for all planes */
    bst_time start = r.values.start;
    map.plane_period_s = (bst_keyword_number){.factor = 1.0, .value = 2.5};
    bst_assert_ok(&f.ctx, bst_recorded_frames_select(&f.ctx, frames, 1, &options, &r));
    bst_assert_close(bst_time_diff(r.values.start, start), 2.5, 1e-9); /* rounded once */
    bst_recorded_frames_close(frames);
    end(&f);
}

/* Opens the file and reads its first frame. */
static bst_status try_file(fixture *f, const bst_keyword_map *map) {
    const char *paths[] = {f->path};
    bst_recorded_frames *frames;
    bst_recorded_frame r;
    const bst_recorded_options options = {.map = map};
    const float *pixels;
    bst_status status = bst_recorded_frames_open(&f->ctx, paths, 1, NULL, &frames);
    for (int64_t i = 0; status == BST_OK && i < bst_recorded_frames_count(frames) && i < 3; i++) {
        status = bst_recorded_frames_select(&f->ctx, frames, i, &options, &r);
        if (status == BST_OK && (int64_t)r.place.width * r.place.height < 1 << 16) {
            status = bst_recorded_frames_pixels(&f->ctx, frames, &options, &r, &pixels);
        }
    }
    bst_recorded_frames_close(frames);
    return status;
}

/* What is wrong with a file is said with file, HDU and keyword. */
static void test_messages(void **state) {
    (void)state;
    static const struct {
        const char *exptime, *date, *trim, *says[3];
    } cases[] = {
        {"'long'", "2024-08-26T17:45:45", "[2:3,1:2]", {"HDU 1", "EXPTIME", "no number"}},
        {"-1", "2024-08-26T17:45:45", "[2:3,1:2]", {"HDU 1", "EXPTIME", "gives -1"}},
        {"1", "yesterday", "[2:3,1:2]", {"HDU 1", "DATE-OBS", "no time"}},
        {"1", "2024-08-26T17:45:45", "[2:4,1:2]", {"HDU 1", "TRIMSEC", "within 3 x 2"}},
        {"1", "2024-08-26T17:45:45", "[2:3]", {"HDU 1", "TRIMSEC", "[x1:x2,y1:y2]"}},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        fixture f = begin("bad.fits");
        bst_keyword_map map;
        load_map(&f, map_text, &map);
        mapped_file(&f, cases[i].exptime, cases[i].date, cases[i].trim);
        assert_int_equal(try_file(&f, &map), BST_ERR_FORMAT);
        for (int k = 0; k < 3; k++) {
            assert_non_null(strstr(f.ctx.message, cases[i].says[k]));
        }
        assert_non_null(strstr(f.ctx.message, f.path));
        end(&f);
    }
    fixture f = begin("none.fits");
    bst_keyword_map map;
    load_map(&f, map_text, &map);
    begin_image(&f, true, 8, 1, 1, 0);
    end_header(&f);
    put(&f, "x", 1);
    pad(&f, 0);
    save(&f, f.count);
    assert_int_equal(try_file(&f, &map), BST_ERR_FORMAT);
    assert_non_null(strstr(f.ctx.message, "TRIMSEC (section of the map"));
    end(&f);
}

/* Each number of a map at its limits, and beyond them. */
static void test_limits(void **state) {
    (void)state;
#define AT(member) offsetof(bst_keyword_map, member)
    static const struct {
        size_t at;
        const char *key;
        double least, most;
    } limits[] = {
        {AT(exposure_s), "exposure_s", 0.0, 86400.0},
        {AT(gain_e_per_dn), "gain_e_per_dn", 1e-3, 1e4},
        {AT(read_noise_e), "read_noise_e", 0.0, 1e4},
        {AT(offset_dn), "offset_dn", -1e6, 1e6},
        {AT(full_well_e), "full_well_e", 1.0, 1e9},
        {AT(pixel_scale_arcsec), "pixel_scale_arcsec", 0.01, 600.0},
        {AT(exposure_id), "exposure_id", -1.0, 9e15},
        {AT(plane_period_s), "plane_period_s", 0.0, 1e6},
        {AT(observer_position_gcrf_m.x), "observer_position_gcrf_m", -1e13, 1e13},
        {AT(observer_position_gcrf_m.y), "observer_position_gcrf_m", -1e13, 1e13},
        {AT(observer_position_gcrf_m.z), "observer_position_gcrf_m", -1e13, 1e13},
        {AT(observer_velocity_gcrf_mps.x), "observer_velocity_gcrf_mps", -1e6, 1e6},
        {AT(observer_velocity_gcrf_mps.y), "observer_velocity_gcrf_mps", -1e6, 1e6},
        {AT(observer_velocity_gcrf_mps.z), "observer_velocity_gcrf_mps", -1e6, 1e6},
    };
#undef AT
    fixture f = begin("limits.fits");
    bst_keyword_map sound;
    load_map(&f, map_text, &sound);
    mapped_file(&f, "2.5", "2024-08-26T17:45:45.582", "[2:3,1:2]");
    const bst_keyword_number one = {.factor = 1.0, .value = 1.0};
    sound.observer_position_gcrf_m = (bst_keyword_vector){one, one, one};
    sound.observer_velocity_gcrf_mps = (bst_keyword_vector){one, one, one};
    for (size_t i = 0; i < sizeof limits / sizeof *limits; i++) {
        const double least = limits[i].least, most = limits[i].most;
        const double values[4] = {least > 0.0 ? 0.5 * least : 2.0 * fmin(least, -0.5), least, most,
                                  2.0 * most};
        for (int k = 0; k < 4; k++) {
            bst_keyword_map map = sound;
            bst_keyword_number *number =
                (bst_keyword_number *)(void *)((char *)&map + limits[i].at);
            *number = (bst_keyword_number){.factor = 1.0, .value = values[k]};
            bool good = k == 1 || k == 2;
            assert_int_equal(try_file(&f, &map), good ? BST_OK : BST_ERR_FORMAT);
            assert_true(good || strstr(f.ctx.message, limits[i].key));
        }
    }
    end(&f);
}

/* A file that is cut anywhere is refused or read, with a message that names it. */
static void test_truncated(void **state) {
    (void)state;
    fixture f = begin("cut.fits");
    bst_keyword_map map;
    load_map(&f, map_text, &map);
    mapped_file(&f, "2.5", "2024-08-26T17:45:45.582", "[2:3,1:2]");
    size_t needed = f.count - 2880 + 12; /* padding after the data may be missing */
    for (size_t count = 0; count <= f.count; count += count < needed ? 37 : 1000) {
        save(&f, count);
        bst_status status = try_file(&f, &map);
        assert_int_equal(status == BST_OK, count >= needed);
        assert_true(status == BST_OK || strstr(f.ctx.message, f.path));
    }
    save(&f, needed - 1);
    assert_int_equal(try_file(&f, &map), BST_ERR_FORMAT);
    assert_non_null(
        strstr(f.ctx.message, "HDU 1: is cut short: BITPIX and NAXISn ask for 12 bytes"));
    end(&f);
}

/* Damaged files are refused or read, never a crash. */
static void test_mutations(void **state) {
    (void)state;
    fixture f = begin("damaged.fits");
    bst_keyword_map map;
    load_map(&f, map_text, &map);
    mapped_file(&f, "2.5", "2024-08-26T17:45:45.582", "[2:3,1:2]");
    begin_image(&f, false, -32, 2, 2, 2);
    mapped_cards(&f, "1", "2024-08-26T17:45:46", "[1:2,1:2]");
    end_header(&f);
    pad(&f, 0);
    for (int i = 0; i < 32; i++) {
        put(&f, "\0", 1);
    }
    pad(&f, 0);
    uint64_t random = 1;
    long good = 0;
    for (long i = 0; i < mutations; i++) {
        uint8_t before[8];
        size_t at[8];
        int changes = 1 + (int)(i % 8);
        for (int k = 0; k < changes; k++) {
            random = random * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
            at[k] = (size_t)(random >> 33) % f.count;
            before[k] = f.bytes[at[k]];
            /* mostly characters of headers */
            f.bytes[at[k]] =
                (uint8_t)(random >> 20 & 7 ? "0123456789-'[]:,=T ABEX"[random >> 24 & 15]
                                           : (char)(random >> 24));
        }
        save(&f, random >> 60 ? f.count : (size_t)(random >> 40) % f.count);
        bst_status status = try_file(&f, &map);
        good += status == BST_OK;
        assert_true(status == BST_OK || *f.ctx.message);
        for (int k = changes - 1; k >= 0; k--) {
            f.bytes[at[k]] = before[k];
        }
    }
    assert_true(good > 0 && good < mutations);
    end(&f);
}

/* Folders and lists give their files in order. */
static void test_files(void **state) {
    (void)state;
    fixture f = begin("b.fits");
    begin_image(&f, true, 8, 1, 1, 0);
    end_header(&f);
    put(&f, "x", 1);
    save(&f, f.count);
    snprintf(f.path, sizeof f.path, "%s/a.FIT", f.place.folder);
    save(&f, f.count);
    snprintf(f.path, sizeof f.path, "%s/notes.md", f.place.folder);
    save(&f, 1);
    snprintf(f.path, sizeof f.path, "%s/list.txt", f.place.folder);
    FILE *list = fopen(f.path, "w");
    assert_non_null(list);
    fputs("# reversed\r\nb.fits\n\na.FIT", list);
    fclose(list);
    bst_recorded_frames *frames;
    const char *folder[] = {f.place.folder}, *lists[] = {f.path};
    bst_assert_ok(&f.ctx, bst_recorded_frames_open(&f.ctx, folder, 1, NULL, &frames));
    assert_int_equal(bst_recorded_frames_files(frames), 2);
    assert_non_null(strstr(bst_recorded_frames_file(frames, 0), "a.FIT"));
    bst_recorded_frames_close(frames);
    bst_assert_ok(&f.ctx, bst_recorded_frames_open(&f.ctx, lists, 1, NULL, &frames));
    assert_int_equal(bst_recorded_frames_count(frames), 2);
    assert_non_null(strstr(bst_recorded_frames_file(frames, 0), "b.fits"));
    bst_recorded_frames_close(frames);
    end(&f);
}

/* A rate that grows from 3 to 5 in an exposure of 4 s. */
static void test_rate_trend(void **state) {
    (void)state;
    fixture f = begin("history.fits");
    bst_keyword_map map;
    bst_frame_source *s;
    bst_frame_place frame;
    double trend, sigma;
    const double uneven[7] = {9.0, 1.0, 1.0, 2.0, 3.0, 1.0, 9.0};
    load_map(&f,
             "{\"boresight_keyword_map\": 1, \"rate_history\": {\"time\": \"T_##\", \"rate\": "
             "\"V_##\"}}",
             &map);
    begin_image(&f, true, 8, 1, 1, 0);
    for (int i = 0; i < 7; i++) { /* times -1 to 5: the first and the last are outside */
        card(&f, "T_%02d    = %20.1f", i, i - 1.0);
        card(&f, "V_%02d    = '%g 0 0'", i, i == 0 ? 90.0 : 3.0 + 0.5 * (i - 1));
        card(&f, "W_%02d    = %20.1f", i, uneven[i]);
    }
    card(&f, "A_00    = %20.1f", 6.0);
    card(&f, "B_00    = 'fast'");
    end_header(&f);
    put(&f, "x", 1);
    pad(&f, 0);
    save(&f, f.count);
    bst_assert_ok(&f.ctx, bst_frame_source_open(&f.ctx, f.path, NULL, &s));
    bst_assert_ok(&f.ctx, bst_frame_source_select(&f.ctx, s, 0, &frame));
    bst_keyword_rate_trend(&f.ctx, &map, s, &frame, 4.0, &trend, &sigma);
    bst_assert_close(trend, 0.5 * 4.0 / 4.0, 1e-12); /* slope times exposure over the mean */
    bst_assert_close(sigma, 0.0, 1e-7);              /* a root of rounding errors */
    snprintf(map.rate_history.rate, sizeof map.rate_history.rate, "W_##");
    bst_keyword_rate_trend(&f.ctx, &map, s, &frame, 4.0, &trend, &sigma);
    /* the rates 1, 1, 2, 3, 1 at 0 to 4 s: slope 0.2, rest 16 - 64/5 - 0.4 = 2.8 with 3 degrees
     * of freedom, spread 10, mean 1.6 */
    bst_assert_close(trend, 0.2 * 4.0 / 1.6, 1e-12);
    bst_assert_close(sigma, sqrt(2.8 / 3.0 / 10.0) * 4.0 / 1.6, 1e-12);
    snprintf(map.rate_history.time, sizeof map.rate_history.time, "T_#"); /* T_0 is not there */
    bst_keyword_rate_trend(&f.ctx, &map, s, &frame, 4.0, &trend, &sigma);
    assert_true(isnan(trend));
    assert_int_equal(f.ctx.warnings, 0);
    snprintf(map.rate_history.time, sizeof map.rate_history.time, "A_##");
    snprintf(map.rate_history.rate, sizeof map.rate_history.rate, "B_##");
    bst_keyword_rate_trend(&f.ctx, &map, s, &frame, 4.0, &trend, &sigma);
    assert_true(isnan(trend) && isnan(sigma)); /* a hint that cannot be read is none */
    assert_int_equal(f.ctx.warnings, 1);
    bst_frame_source_close(s);
    end(&f);
}

int main(int argc, char **argv) {
    for (int i = 1; i < argc; i++) {
        (void)sscanf(argv[i], "mutations=%ld", &mutations);
    }
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_pixels),     cmocka_unit_test(test_keywords_and_sections),
        cmocka_unit_test(test_cube_table), cmocka_unit_test(test_messages),
        cmocka_unit_test(test_limits),     cmocka_unit_test(test_truncated),
        cmocka_unit_test(test_mutations),  cmocka_unit_test(test_files),
        cmocka_unit_test(test_rate_trend), cmocka_unit_test(test_counts),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
