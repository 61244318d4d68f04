/* Times of recorded frames in the time scale of their header, against ERFA, and keywords of several
 * words. */
#include <erfa.h>

#include "tests/io/written_fits.h"

typedef struct header {
    const char *map;     /* keys of the map's time */
    const char *date;    /* card */
    const char *timesys; /* NULL: none */
    const char *scale;   /* what the date is in; NULL: refused */
    const char *said;    /* of a refusal */
} header;

/* Reads the only frame of a file with this header. */
static bst_status read_frame(fixture *f, const header *h, bst_recorded_frame *r) {
    char text[400];
    bst_keyword_map map;
    snprintf(text, sizeof text,
             "{\"boresight_keyword_map\": 1, \"name\": \"mine\", \"time\": {%s},"
             " \"exposure_s\": {\"keyword\": \"ESO DET EXPTIME|EXPTIME\"},"
             " \"gain_e_per_dn\": {\"keyword\": \"HIERARCH ESO DET GAIN\", \"value\": 7},"
             " \"pixel_scale_arcsec\": {\"value\": 5}}",
             h->map);
    load_map(f, text, &map);
    f->count = 0;
    begin_image(f, true, 16, 1, 1, 0);
    card(f, "HIERARCH ESO DET EXPTIMES = 9.0 / another word");
    card(f, "HIERARCH ESO  DET EXPTIME = 2.5 / [s] ESO DET GAIN = 3");
    card(f, "HIERARCH ESO DET GAIN='1.25'");
    card(f, "%s", h->date);
    if (h->timesys) {
        card(f, "TIMESYS = '%s'", h->timesys);
    }
    end_header(f);
    big_endian(f, 0, 2);
    pad(f, 0);
    save(f, f->count);
    const char *paths[] = {f->path};
    bst_recorded_frames *frames;
    bst_recorded_options options = {.map = &map};
    bst_status status = bst_recorded_frames_open(&f->ctx, paths, 1, NULL, &frames);
    if (status == BST_OK) {
        status = bst_recorded_frames_select(&f->ctx, frames, 0, &options, r);
        bst_recorded_frames_close(frames);
    }
    return status;
}

/* TAI of 2022-06-16T22:10:00.5 in a time scale, by ERFA. */
static bst_time by_erfa(const char *scale) {
    double day, part, tt1, tt2, tai1, tai2;
    bool utc = strcmp(scale, "UTC") == 0;
    assert_int_equal(eraDtf2d(utc ? "UTC" : "TAI", 2022, 6, 16, 22, 10, 0.5, &day, &part), 0);
    tai1 = day;
    tai2 = part;
    if (utc) {
        assert_int_equal(eraUtctai(day, part, &tai1, &tai2), 0);
    } else if (strcmp(scale, "TT") == 0) {
        assert_int_equal(eraTttai(day, part, &tai1, &tai2), 0);
    } else if (strcmp(scale, "TDB") == 0) {
        assert_int_equal(eraTdbtt(day, part, eraDtdb(day, part, 0, 0, 0, 0), &tt1, &tt2), 0);
        assert_int_equal(eraTttai(tt1, tt2, &tai1, &tai2), 0);
    } else if (strcmp(scale, "GPS") == 0) {
        tai2 += 19.0 / 86400.0;
    }
    return bst_time_add((bst_time){tai1, tai2}, 0.0);
}

static void test_scales(void **state) {
    (void)state;
    static const char iso[] = "DATE-OBS= '2022-06-16T22:10:00.5'",
                      mjd[] = "MJD-OBS = 59746.92361689815     / [d]",
                      jd[] = "JD      = 2459747.42361689815   / [d]",
                      use_mjd[] = "\"keyword\": \"MJD-OBS\", \"format\": \"mjd\"";
    static const header headers[] = {
        {"", iso, NULL, "UTC", NULL},
        {"", iso, "UTC", "UTC", NULL},
        {"", iso, "TAI", "TAI", NULL},
        {"", iso, "tt(TAI)", "TT", NULL},
        {"", iso, "ET", "TT", NULL},
        {"", iso, "TDB", "TDB", NULL},
        {"", iso, "GPS", "GPS", NULL},
        {"", iso, "GMT", "UTC", NULL},
        {"", "DATE-OBS= '2022-06-16T22:10:00.5Z'", "TT", "UTC", NULL},
        {"\"scale\": \"tai\"", iso, NULL, "TAI", NULL},
        {"\"scale\": \"utc\"", iso, "TT", "UTC", NULL},
        {"\"scale\": \"gps\"", iso, "LOCAL", "GPS", NULL},
        {use_mjd, mjd, "TT", "TT", NULL},
        {use_mjd, mjd, NULL, "UTC", NULL},
        {"\"keyword\": \"JD\", \"format\": \"jd\"", jd, "TDB", "TDB", NULL},
        {"\"keyword\": \"T\", \"format\": \"unix\"", "T       = 1655417400.5", "TT", "UTC", NULL},
        {"", iso, "LOCAL", NULL, "TIMESYS (time of the map mine): names a time scale that is not"},
        {use_mjd, "MJD-OBS = 200000.0", "TT", NULL, "outside the years"},
        {"", "DATE-OBS= '2016-12-31T23:59:60.5'", "TT", NULL, "has no second in 00..59"},
    };
    fixture f = begin("frame.fits");
    for (size_t i = 0; i < sizeof headers / sizeof *headers; i++) {
        const header *h = &headers[i];
        bst_recorded_frame r;
        bst_status status = read_frame(&f, h, &r);
        if (!h->scale) {
            assert_int_equal(status, BST_ERR_FORMAT);
            assert_non_null(strstr(f.ctx.message, h->said));
            continue;
        }
        bst_assert_ok(&f.ctx, status);
        /* 60 us: half of the last digit of a Julian date; 10 us: series of TDB */
        double tolerance_s = strstr(h->map, "\"jd\"")    ? 6e-5
                             : strstr(h->map, "\"mjd\"") ? 1e-6
                                                         : 1e-5;
        bst_assert_close(bst_time_diff(r.values.start, by_erfa(h->scale)), 0.0, tolerance_s);
        bst_assert_close(r.values.exposure_s, 2.5, 0.0);
        bst_assert_close(r.values.gain_e_per_dn, 1.25, 0.0);
    }
    end(&f);
}

static void test_unix_times_are_utc(void **state) {
    (void)state;
    fixture f = begin("map.json");
    bst_keyword_map map;
    FILE *file = fopen(f.path, "w");
    assert_non_null(file);
    fputs("{\"boresight_keyword_map\": 1, \"time\": {\"format\": \"unix\", \"scale\": \"tt\"}}",
          file);
    fclose(file);
    assert_int_equal(bst_keyword_map_load(&f.ctx, f.path, &map), BST_ERR_CONFIG);
    assert_non_null(strstr(f.ctx.message, "/time/scale: is not for the format unix"));
    end(&f);
}

/* Integers of 64 bits without sign: stored minus 2^63, a difference that no double holds. */
static void test_unsigned_64_bits(void **state) {
    (void)state;
    static const uint64_t values[] = {0, 1, 500, 513, 65535, (uint64_t)1 << 63};
    fixture f = begin("wide.fits");
    begin_image(&f, true, 64, 6, 1, 0);
    card(&f, "BSCALE  =                    1");
    card(&f, "BZERO   =  9223372036854775808");
    end_header(&f);
    for (int i = 0; i < 6; i++) {
        big_endian(&f, values[i] - ((uint64_t)1 << 63), 8); /* modulo 2^64 */
    }
    pad(&f, 0);
    save(&f, f.count);
    const char *paths[] = {f.path};
    bst_recorded_frames *frames;
    bst_recorded_frame r;
    bst_recorded_options options = {.map = NULL};
    const float *pixels;
    bst_assert_ok(&f.ctx, bst_recorded_frames_open(&f.ctx, paths, 1, NULL, &frames));
    bst_assert_ok(&f.ctx, bst_recorded_frames_select(&f.ctx, frames, 0, &options, &r));
    bst_assert_ok(&f.ctx, bst_recorded_frames_pixels(&f.ctx, frames, &options, &r, &pixels));
    for (int i = 0; i < 6; i++) {
        bst_assert_close(pixels[i], (double)values[i], 0.0);
    }
    bst_recorded_frames_close(frames);
    end(&f);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_scales),
        cmocka_unit_test(test_unix_times_are_utc),
        cmocka_unit_test(test_unsigned_64_bits),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
