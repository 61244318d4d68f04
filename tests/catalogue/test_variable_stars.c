/* Parallaxes and variable stars of a user's table: against ERFA's eraPmpx and closed forms. */
#define _XOPEN_SOURCE 700 /* mkstemp */
#include "tests/test_support.h"

#include <erfa.h>
#include <erfam.h>
#include <stdlib.h>
#include <unistd.h>

#include "sim/catalogue/star_curves.h"
#include "sim/catalogue/star_merge.h"
#include "sim/catalogue/stars.h"

#define MAS_RAD (1e-3 * BST_ARCSEC_RAD)
#define AU_M 149597870700.0

typedef struct files {
    char table[BST_TEST_PATH], curves[BST_TEST_PATH], out[BST_TEST_PATH], again[BST_TEST_PATH];
    bst_ctx ctx;
    bst_star_merge_counts n;
} files;

static void name_file(char *path, const char *suffix) {
    snprintf(path, BST_TEST_PATH, "/tmp/bst_variable_XXXXXX");
    int fd = mkstemp(path);
    assert_true(fd >= 0);
    close(fd);
    unlink(path);
    strncat(path, suffix, BST_TEST_PATH - strlen(path) - 1);
}

static int setup(void **state) {
    files *f = calloc(1, sizeof *f);
    name_file(f->table, ".csv");
    name_file(f->curves, ".curves.csv");
    name_file(f->out, ".stars");
    name_file(f->again, ".again.stars");
    bst_ctx_init(&f->ctx, NULL, NULL, BST_LOG_ERROR);
    *state = f;
    return 0;
}

static int teardown(void **state) {
    files *f = *state;
    unlink(f->table);
    unlink(f->curves);
    unlink(f->out);
    unlink(f->again);
    free(f);
    return 0;
}

static void write_text(const char *path, const char *text) {
    FILE *file = fopen(path, "w");
    assert_non_null(file);
    assert_true(fputs(text, file) >= 0);
    assert_int_equal(fclose(file), 0);
}

static bst_status merge(files *f, const char *base, bool curves, const char *out) {
    bst_star_merge_request q = {.table = f->table,
                                .options = {.epoch_year = NAN, .zero_point_mag = NAN},
                                .curves = curves ? f->curves : NULL,
                                .base = base,
                                .complete_to_v_mag = NAN,
                                .out = out};
    return bst_star_merge(&f->ctx, &q, &f->n);
}

static bst_stars *open_stars(files *f, const char *path) {
    bst_stars *stars = NULL;
    bst_assert_ok(&f->ctx, bst_stars_open(&f->ctx, path, &stars));
    return stars;
}

/* A star by its source, seen at an epoch. */
static bst_star find(files *f, const bst_stars *stars, int64_t source, const bst_star_epoch *at) {
    bst_stars_info info;
    bst_stars_get_info(stars, &info);
    bst_star star = {.id = 0};
    for (uint32_t i = 0; i < info.table_count; i++) {
        if (bst_stars_source(stars, BST_STAR_TABLE_ID + i) == source) {
            bst_assert_ok(&f->ctx,
                          bst_stars_find_seen(&f->ctx, stars, BST_STAR_TABLE_ID + i, at, &star));
        }
    }
    assert_true(star.id != 0);
    return star;
}

static bst_status query(files *f, const bst_stars *stars, bst_vec3 centre, double radius_rad,
                        double v_limit, const bst_star_epoch *at, bst_star *found, int *count) {
    const bst_star_query cone = {centre, radius_rad, v_limit, *at};
    return bst_stars_query_seen(&f->ctx, stars, &cone, found, 1, count);
}

static uint32_t file_version(const char *path) {
    FILE *file = fopen(path, "rb");
    bst_star_header h;
    assert_non_null(file);
    assert_int_equal(fread(&h, sizeof h, 1, file), 1);
    fclose(file);
    return h.version;
}

static bst_vec3 vec(const double v[3]) {
    return (bst_vec3){v[0], v[1], v[2]};
}

static double year_of(double jd) {
    return 2000.0 + (jd - 2451545.0) / 365.25;
}

/* An observer about the Earth: the epoch of a query, and the place relative to the barycentre. */
static bst_star_epoch observer_at(double jd, bst_vec3 geocentric_m, bst_vec3 *bary_m) {
    double helio[2][3], bary[2][3];
    (void)eraEpv00(jd, 0.0, helio, bary);
    *bary_m = bst_vec3_add(bst_vec3_scale(vec(bary[0]), AU_M), geocentric_m);
    bst_vec3 sun = bst_vec3_sub(bst_vec3_scale(vec(helio[0]), -AU_M), geocentric_m);
    return (bst_star_epoch){year_of(jd), sun};
}

/* Proxima, Barnard's star, 61 Cyg A, a star of 50 pc, one without a parallax, one measured below 0:
 * ra, dec (deg), proper motions (mas/yr), parallax (mas), all at J2000. */
static const double nearby[][5] = {{217.42894, -62.67949, -3781.3, 769.8, 768.5},
                                   {269.45208, 4.69339, -801.6, 10362.4, 546.9},
                                   {316.72475, 38.74942, 4164.2, 3250.0, 286.0},
                                   {83.82, -5.39, 12.0, -7.0, 20.0},
                                   {120.0, 60.0, 1.0, 1.0, 0.0},
                                   {5.0, -88.0, 1.0, 2.0, -0.4}};
enum { NEARBY = sizeof nearby / sizeof *nearby };

static void test_parallax_as_erfa(void **state) {
    files *f = *state;
    FILE *file = fopen(f->table, "w");
    assert_non_null(file);
    fputs("source_id,ra,dec,ref_epoch,pmra,pmdec,parallax,v_mag\n", file);
    for (int i = 0; i < NEARBY; i++) {
        const double *s = nearby[i];
        fprintf(file, "%d,%.9f,%.9f,2000,%.2f,%.2f,%.2f,9\n", i + 1, s[0], s[1], s[2], s[3], s[4]);
    }
    assert_int_equal(fclose(file), 0);
    bst_assert_ok(&f->ctx, merge(f, NULL, false, f->out));
    assert_int_equal(f->n.parallaxes, 4);
    bst_stars *stars = open_stars(f, f->out);
    double worst = 0.0, largest = 0.0;
    for (int day = 0; day < 9700; day += 97) {
        const double jd = 2451545.0 + day;
        bst_vec3 bary, place = {4e7 * cos(day), 4e7 * sin(day), 6e6};
        const bst_star_epoch at = observer_at(jd, place, &bary),
                             still = {.julian_year = at.julian_year};
        double pob[3] = {bary.x / AU_M, bary.y / AU_M, bary.z / AU_M};
        for (int i = 0; i < NEARBY; i++) {
            const double *s = nearby[i];
            double u[3], ra = s[0] * BST_DEG_RAD, dec = s[1] * BST_DEG_RAD;
            eraPmpx(ra, dec, s[2] * MAS_RAD / cos(dec), s[3] * MAS_RAD, fmax(s[4], 0.0) * 1e-3, 0.0,
                    at.julian_year - 2000.0, pob, u);
            bst_star star = find(f, stars, i + 1, &at);
            worst = fmax(worst, bst_vec3_angle(star.icrs, vec(u)));
            bst_star there = find(f, stars, i + 1, &still);
            largest = fmax(largest, bst_vec3_angle(star.icrs, there.icrs));
            assert_true(s[4] > 0.0 || bst_vec3_angle(star.icrs, there.icrs) == 0.0);
            /* in the query of its place, and not in one beside the barycentric place */
            int count;
            bst_star found;
            bst_assert_ok(&f->ctx,
                          query(f, stars, vec(u), 3.0 * MAS_RAD, 20.0, &at, &found, &count));
            assert_int_equal(count, 1);
            assert_true(found.id == star.id && bst_vec3_angle(found.icrs, star.icrs) == 0.0);
            bst_assert_ok(&f->ctx,
                          query(f, stars, there.icrs, 3.0 * MAS_RAD, 20.0, &at, &found, &count));
            assert_int_equal(count, bst_vec3_angle(star.icrs, there.icrs) < 3.0 * MAS_RAD);
        }
    }
    bst_stars_close(stars);
    print_message("parallax: largest %.1f mas, error %.2f mas\n", largest / MAS_RAD,
                  worst / MAS_RAD);
    /* places are rounded to 0.3 mas and parallaxes to 0.2 mas; proper motions to 0.1 mas/yr are
     * those of the list; the light time across the orbit moves Barnard's star by 0.2 mas */
    assert_true(worst < 1.0 * MAS_RAD);
    assert_true(largest > 700.0 * MAS_RAD);
}

static void test_cosine_with_light_time(void **state) {
    files *f = *state;
    /* 1: in the ecliptic, period 0.1 d; 2: Gaia's epoch; 3: no amplitude; 4: no period */
    write_text(f->table,
               "source_id,ra,dec,ref_epoch,v_mag,b_minus_v,period_d,amplitude_mag,maximum_jd,"
               "epoch_g\n"
               "1,100,23,2016,10,0.5,0.1,1.2,2459000.25,\n"
               "2,10,-40,2016,12,0.5,531.7,6,,3802.5\n"
               "3,20,-40,2016,12,0.5,0.3,,,\n4,30,-40,2016,12,0.5,,0.7,,\n");
    bst_assert_ok(&f->ctx, merge(f, NULL, false, f->out));
    assert_int_equal(f->n.variables, 2);
    assert_int_equal(file_version(f->out), BST_STAR_TIME_VERSION);
    bst_stars *stars = open_stars(f, f->out);
    double greatest_delay_s = 0.0;
    for (int k = 0; k < 400; k++) {
        const double jd = 2459000.0 + 0.913 * k;
        bst_vec3 bary;
        const bst_star_epoch at = observer_at(jd, (bst_vec3){7e6, 0, 0}, &bary);
        bst_star star = find(f, stars, 1, &at);
        double delay_s = bst_vec3_dot(bary, star.icrs) / 299792458.0;
        greatest_delay_s = fmax(greatest_delay_s, fabs(delay_s));
        double phase = (jd + delay_s / 86400.0 - 2459000.25) / 0.1;
        /* tolerance: the year in double (7 us), V in 1e-3 mag, magnitudes in single precision */
        bst_assert_close((double)star.v_mag, 10.0 - 0.6 * cos(2.0 * BST_PI * phase), 1.1e-3);
        star = find(f, stars, 2, &at);
        delay_s = bst_vec3_dot(bary, star.icrs) / 299792458.0;
        phase = (jd + delay_s / 86400.0 - (2455197.5 + 3802.5)) / 531.7;
        bst_assert_close((double)star.v_mag, 12.0 - 3.0 * cos(2.0 * BST_PI * phase), 1.1e-3);
        /* limits hold for the magnitude of the time */
        bst_star none;
        int above, below;
        const double v = (double)star.v_mag;
        bst_assert_ok(&f->ctx, query(f, stars, star.icrs, 1e-5, v + 1e-4, &at, &none, &above));
        bst_assert_ok(&f->ctx, query(f, stars, star.icrs, 1e-5, v - 1e-4, &at, &none, &below));
        assert_int_equal(above, 1);
        assert_int_equal(below, 0);
        bst_assert_close((double)find(f, stars, 3, &at).v_mag, 12.0, 1.1e-3);
        bst_assert_close((double)find(f, stars, 4, &at).v_mag, 12.0, 1.1e-3);
    }
    assert_true(greatest_delay_s > 450.0); /* 8 minutes are a twelfth of the period */
    bst_star_change change;
    bst_stars_change(stars, find(f, stars, 2, &(bst_star_epoch){.julian_year = 2020.0}).id,
                     &change);
    assert_true(change.varies && change.points == 0 && change.parallax_mas == 0.0);
    bst_assert_close(change.brightest_v_mag, 9.0, 1.1e-3);
    bst_assert_close(change.faintest_v_mag, 15.0, 1.1e-3);
    bst_assert_close(change.period_d, 531.7, 0.0);
    bst_stars_close(stars);
    /* imported again, nothing changes */
    bst_assert_ok(&f->ctx, merge(f, f->out, false, f->again));
    assert_int_equal(f->n.same, 4);
    assert_int_equal(f->n.written, 4);
    bst_stars *one = open_stars(f, f->out), *two = open_stars(f, f->again);
    for (int64_t source = 1; source <= 4; source++) {
        const bst_star_epoch at = {2021.337, {1e11, 1e11, 2e10}};
        bst_star a = find(f, one, source, &at), b = find(f, two, source, &at);
        assert_true(bst_vec3_angle(a.icrs, b.icrs) < 2e-9); /* unit of the places */
        bst_assert_close((double)a.v_mag, (double)b.v_mag, 1.1e-3);
    }
    bst_stars_close(one);
    bst_stars_close(two);
}

static void test_light_curves(void **state) {
    files *f = *state;
    write_text(f->table,
               "source_id,ra,dec,ref_epoch,v_mag,period_d,maximum_jd\n"
               "7,100,10,2016,8,2.5,2459000\n8,101,10,2016,9,,\n9,102,10,2016,9,,\n");
    /* an eclipse of 1.5 mag from phase 0.9 over 0 to 0.1; out of order */
    write_text(f->curves,
               "# eclipsing\nsource_id,phase,delta_mag\n7,0.1,0\n7,0.9,0\n7,0,1.5\n"
               "77,0,1\n77,0.5,0\n");
    bst_assert_ok(&f->ctx, merge(f, NULL, true, f->out));
    assert_int_equal(f->n.variables, 1);
    assert_int_equal(f->n.curves_left, 1);
    static const double phases[][2] = {{0.0, 1.5}, {0.05, 0.75},   {0.1, 0.0}, {0.5, 0.0},
                                       {0.9, 0.0}, {0.925, 0.375}, {0.98, 1.2}};
    bst_stars *stars = open_stars(f, f->out);
    for (size_t i = 0; i < sizeof phases / sizeof *phases; i++) {
        for (int turn = -3; turn <= 4; turn += 7) {
            const bst_star_epoch at = {.julian_year =
                                           year_of(2459000.0 + 2.5 * (turn + phases[i][0]))};
            /* tolerance: V in 1e-3 mag; 7 us of the year are nothing */
            bst_assert_close((double)find(f, stars, 7, &at).v_mag, 8.0 + phases[i][1], 1.1e-3);
        }
    }
    bst_stars_close(stars);
    /* by time, brighter and fainter than the table, constant beyond the ends */
    write_text(f->curves,
               "source_id,time_jd,delta_mag\n8,2459010,-1\n8,2459000,0.5\n8,2459020,3\n");
    bst_assert_ok(&f->ctx, merge(f, NULL, true, f->out));
    stars = open_stars(f, f->out);
    static const double times[][2] = {{-50, 0.5}, {0, 0.5}, {5, -0.25}, {10, -1},
                                      {15, 1},    {20, 3},  {900, 3}};
    for (size_t i = 0; i < sizeof times / sizeof *times; i++) {
        const bst_star_epoch at = {.julian_year = year_of(2459000.0 + times[i][0])};
        bst_assert_close((double)find(f, stars, 8, &at).v_mag, 9.0 + times[i][1], 1.1e-3);
        bst_assert_close((double)find(f, stars, 9, &at).v_mag, 9.0, 1.1e-3);
    }
    bst_stars_close(stars);
}

/* A bright star keeps the base's magnitudes and varies about them. */
static void test_bright_star_varies(void **state) {
    files *f = *state;
    /* Polaris, TYC 4628-237-1, V 1.98 in the table of bright stars */
    bst_stars *stars = open_stars(f, "embedded");
    const uint32_t id = bst_star_id_make(4628, 237, 1);
    bst_star before;
    bst_assert_ok(&f->ctx, bst_stars_find(&f->ctx, stars, id, 2000.0, &before));
    bst_stars_close(stars);
    double ra, dec;
    char text[300];
    bst_vec3_to_radec(before.icrs, &ra, &dec);
    snprintf(text, sizeof text,
             "source_id,ra,dec,ref_epoch,pmra,pmdec,v_mag,parallax,period_d,amplitude_mag,"
             "maximum_jd\n1,%.8f,%.8f,2000,44,-12,2.1,7.5,3.97,0.5,2459000\n",
             ra / BST_DEG_RAD, dec / BST_DEG_RAD);
    write_text(f->table, text);
    bst_assert_ok(&f->ctx, merge(f, "embedded", false, f->out));
    assert_int_equal(f->n.same, 1);
    stars = open_stars(f, f->out);
    for (int k = 0; k < 8; k++) {
        bst_star star;
        double jd = 2459000.0 + 3.97 * k / 8.0;
        bst_assert_ok(&f->ctx, bst_stars_find(&f->ctx, stars, id, year_of(jd), &star));
        bst_assert_close((double)star.v_mag,
                         (double)before.v_mag - 0.25 * cos(2.0 * BST_PI * k / 8.0), 1.1e-3);
    }
    bst_star_change change;
    bst_stars_change(stars, id, &change);
    bst_assert_close(change.parallax_mas, 7.5, 0.11); /* its unit is 0.2 mas */
    bst_stars_close(stars);
}

/* Without the new columns files are what they were; damaged ones are refused. */
static void test_versions(void **state) {
    files *f = *state;
    write_text(f->table, "source_id,ra,dec,ref_epoch,v_mag,parallax\n1,2,3,2016,9,0.04\n");
    bst_assert_ok(&f->ctx, merge(f, NULL, false, f->out));
    assert_int_equal(file_version(f->out), BST_STAR_TABLE_VERSION); /* below the unit */
    bst_stars *stars = open_stars(f, f->out);
    bst_assert_close(bst_stars_year_after(stars, 2020.0, 1e6), 2020.0, 0.0);
    bst_stars_close(stars);
    write_text(f->table,
               "source_id,ra,dec,ref_epoch,v_mag,period_d,amplitude_mag\n"
               "1,2,3,2016,9,0.5,1\n2,2,4,2016,9,0.7,2\n");
    write_text(f->curves, "source_id,phase,delta_mag\n1,0,0\n1,0.5,1\n2,0.6,1\n2,1,0\n");
    bst_assert_ok(&f->ctx, merge(f, NULL, true, f->out));
    stars = open_stars(f, f->out);
    bst_assert_close(bst_stars_year_after(stars, 2020.0, 86400.0 * 365.25), 2021.0, 1e-12);
    const bst_star_view *whole = bst_stars_records(stars);
    const size_t bytes = (size_t)whole->header->file_bytes;
    unsigned char *copy = malloc(bytes);
    memcpy(copy, whole->header, bytes);
    bst_stars_close(stars);
    for (int damage = 0; damage < 13; damage++) {
        bst_star_view view;
        bst_assert_ok(&f->ctx, bst_star_view_init(&f->ctx, "copy", copy, bytes, false, &view));
        assert_int_equal(view.variable_count, 2);
        bst_star_variable *v = (bst_star_variable *)(void *)(copy + sizeof(bst_star_header) +
                                                             sizeof(bst_star_extension));
        bst_star_point *p = (bst_star_point *)(void *)(v + 2);
        const bst_star_variable kept = *v;
        const bst_star_point kept_point = *p;
        switch (damage) {
            case 0:
                v->star = 1; /* not ascending */
                break;
            case 1:
                v->point_count = 5;
                break;
            case 2:
                v->period_d = 0.0;
                v->point_count = 0;
                break;
            case 3:
                v->epoch_jd = NAN;
                break;
            case 4:
                v->amplitude_mag = NAN;
                break;
            case 5:
                v->period_d = 1e-310;
                break;
            case 6:
                v->period_d = 1e300;
                break;
            case 7:
                v->epoch_jd = -1e300;
                break;
            case 8:
                v->point_count = 4; /* all of them within the file, but two are of the other star */
                break;
            case 9:
                p->time = -5.0F; /* no phase */
                break;
            case 10:
                p->time = 0.75F; /* not ascending */
                break;
            case 11:
                p->mag = NAN;
                break;
            default:
                v->star = 9;
        }
        assert_int_equal(bst_star_view_init(&f->ctx, "copy", copy, bytes, false, &view),
                         BST_ERR_FORMAT);
        assert_non_null(strstr(f->ctx.message, "variable star"));
        *v = kept;
        *p = kept_point;
        bst_ctx_init(&f->ctx, NULL, NULL, BST_LOG_ERROR);
    }
    free(copy);
}

static void test_bad_input(void **state) {
    files *f = *state;
    static const struct {
        const char *table, *curves, *says;
    } cases[] = {
        {"ra,dec,ref_epoch,v_mag,parallax\n1,2,2016,9,820\n", NULL,
         "column parallax: 820 is outside -1000 to 819"},
        {"ra,dec,ref_epoch,v_mag,period_d\n1,2,2016,9,-1\n", NULL, "column period_d: -1"},
        /* the phase of so short a period overflows */
        {"ra,dec,ref_epoch,v_mag,period_d\n1,2,2016,9,1e-305\n", NULL, "is outside 1e-09 to 1e+07"},
        {"ra,dec,ref_epoch,v_mag,amplitude_mag\n1,2,2016,9,21\n", NULL, "column amplitude_mag: 21"},
        {"ra,dec,ref_epoch,v_mag,maximum_jd\n1,2,2016,9,59000\n", NULL, "column maximum_jd: 59000"},
        {"source_id,ra,dec,ref_epoch,v_mag\n1,1,2,2016,9\n",
         "source_id,phase,delta_mag\n1,0,0\n1,0.5,1\n", "source_id 1 has a light curve by phase"},
        {"", "source_id,delta_mag\n1,0\n", "either phase or time_jd"},
        {"", "source_id,phase,delta_mag\n1,1.5,0\n", "column phase"},
        {"", "source_id,phase,delta_mag\n1,0.5,x\n", "column delta_mag"},
        {"", "source_id,phase,delta_mag\none,0.5,1\n", "column source_id"},
        {"", "source_id,phase,delta_mag\n1,0.5\n", "wrong number of fields"},
        {"", "source_id,phase,delta_mag\n1,0.5,1\n", "has one point"},
        {"", "source_id,phase,delta_mag\n1,0.5,1\n1,0.5,2\n", "at the same time, in line 2"},
        /* phases are stored as they are, times from the first one on */
        {"", "source_id,phase,delta_mag\n1,0.9,1\n1,0.900000001,2\n", "as phases"},
        {"", "source_id,time_jd,delta_mag\n1,2400000,1\n1,2500000,1\n1,2500000.0001,2\n",
         "as days after the first"},
        {"", "source_id,phase,delta_mag\n", "is empty"}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        write_text(f->table, *cases[i].table ? cases[i].table
                                             : "source_id,ra,dec,ref_epoch,v_mag\n1,1,2,2016,9\n");
        write_text(f->curves, cases[i].curves ? cases[i].curves : "");
        bst_ctx_init(&f->ctx, NULL, NULL, BST_LOG_ERROR);
        assert_int_not_equal(merge(f, NULL, cases[i].curves != NULL, f->out), BST_OK);
        assert_non_null(strstr(f->ctx.message, cases[i].says));
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_parallax_as_erfa, setup, teardown),
        cmocka_unit_test_setup_teardown(test_cosine_with_light_time, setup, teardown),
        cmocka_unit_test_setup_teardown(test_light_curves, setup, teardown),
        cmocka_unit_test_setup_teardown(test_bright_star_varies, setup, teardown),
        cmocka_unit_test_setup_teardown(test_versions, setup, teardown),
        cmocka_unit_test_setup_teardown(test_bad_input, setup, teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
