/* A table of stars into a catalogue: with and without the stars of a base, and back by queries. */
#define _XOPEN_SOURCE 700 /* mkstemp */
#include "tests/test_support.h"

#include <stdlib.h>
#include <unistd.h>

#include "sim/catalogue/star_merge.h"
#include "sim/catalogue/star_table_internal.h"
#include "sim/catalogue/stars.h"

#define ARCSEC_DEG (1.0 / 3600.0)

typedef struct files {
    char table[BST_TEST_PATH], base[BST_TEST_PATH], out[BST_TEST_PATH];
    bst_ctx ctx;
} files;

static void name_file(char *path, const char *suffix) {
    snprintf(path, BST_TEST_PATH, "/tmp/bst_star_merge_XXXXXX");
    int fd = mkstemp(path);
    assert_true(fd >= 0);
    close(fd);
    unlink(path);
    strncat(path, suffix, BST_TEST_PATH - strlen(path) - 1);
}

static int setup(void **state) {
    files *f = calloc(1, sizeof *f);
    name_file(f->table, ".csv");
    name_file(f->base, ".stars");
    name_file(f->out, ".stars");
    bst_ctx_init(&f->ctx, NULL, NULL, BST_LOG_ERROR);
    *state = f;
    return 0;
}

static int teardown(void **state) {
    files *f = *state;
    unlink(f->table);
    unlink(f->base);
    unlink(f->out);
    free(f);
    return 0;
}

static void write_text(const char *path, const char *text) {
    FILE *file = fopen(path, "w");
    assert_non_null(file);
    assert_true(fputs(text, file) >= 0);
    assert_int_equal(fclose(file), 0);
}

static bst_star_merge_request request_of(const files *f) {
    return (bst_star_merge_request){.table = f->table,
                                    .options = {.epoch_year = NAN, .zero_point_mag = NAN},
                                    .complete_to_v_mag = NAN,
                                    .out = f->out};
}

static bst_stars *open_stars(files *f, const char *path) {
    bst_stars *stars = NULL;
    bst_assert_ok(&f->ctx, bst_stars_open(&f->ctx, path, &stars));
    return stars;
}

/* ---------------------------------------------------------------- cells */

/* Stars all over the sky and in a dense cluster over the corner of four octants: each query finds
 * what a comparison with every star finds. */
static void test_queries_find_each_star_once(void **state) {
    files *f = *state;
    enum { STARS = 6000 };
    static double ra[STARS], dec[STARS], v[STARS];
    FILE *file = fopen(f->table, "w");
    assert_non_null(file);
    fputs("source_id,ra,dec,ref_epoch,v_mag,b_minus_v\n", file);
    uint64_t seed = 12345;
    for (int i = 0; i < STARS; i++) {
        double draw[3];
        for (int k = 0; k < 3; k++) {
            seed = seed * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
            draw[k] = (double)(seed >> 11) / 9007199254740992.0;
        }
        bool cluster = i % 2 == 1;
        ra[i] = cluster ? fmod(360.0 + 1.5 * (draw[0] - 0.5), 360.0) : 360.0 * draw[0];
        dec[i] = cluster ? 1.5 * (draw[1] - 0.5) : asin(2.0 * draw[1] - 1.0) / BST_DEG_RAD;
        v[i] = 5.005 + 0.01 * floor(1000.0 * draw[2]); /* off the limits */
        fprintf(file, "%d,%.9f,%.9f,2000,%.3f,0.5\n", i + 1, ra[i], dec[i], v[i]);
    }
    assert_int_equal(fclose(file), 0);
    bst_star_merge_request q = request_of(f);
    bst_star_merge_counts n;
    bst_assert_ok(&f->ctx, bst_star_merge(&f->ctx, &q, &n));
    assert_int_equal(n.written, STARS);
    bst_stars *stars = open_stars(f, f->out);
    static const double cones[][4] = {
        {0, 0, 0.4, 12},    {359.9, 0.1, 2, 16}, {45, 35.26, 20, 16},   {0, 90, 30, 14},
        {180, -90, 45, 16}, {90, 0, 10, 16},     {0.3, -0.3, 0.05, 16}, {123, -45, 180, 16}};
    for (size_t c = 0; c < sizeof cones / sizeof *cones; c++) {
        static bst_star found[STARS];
        static bool seen[STARS];
        memset(seen, 0, sizeof seen);
        bst_vec3 centre = bst_vec3_from_radec(cones[c][0] * BST_DEG_RAD, cones[c][1] * BST_DEG_RAD);
        double radius = cones[c][2] * BST_DEG_RAD;
        int count = 0, expected = 0;
        bst_assert_ok(&f->ctx, bst_stars_query(&f->ctx, stars, centre, radius, cones[c][3], 2000.0,
                                               found, STARS, &count));
        for (int i = 0; i < STARS; i++) {
            bst_vec3 u = bst_vec3_from_radec(ra[i] * BST_DEG_RAD, dec[i] * BST_DEG_RAD);
            double away = bst_vec3_angle(centre, u);
            /* no star is so near the edge that rounding (0.3 mas) decides */
            assert_true(fabs(away - radius) > 2e-9 || radius > 3.0);
            expected += away <= radius && v[i] <= cones[c][3];
        }
        assert_int_equal(count, expected);
        for (int k = 0; k < count; k++) {
            int64_t source = bst_stars_source(stars, found[k].id);
            assert_in_range(source, 1, STARS);
            assert_false(seen[source - 1]);
            seen[source - 1] = true;
            bst_vec3 u =
                bst_vec3_from_radec(ra[source - 1] * BST_DEG_RAD, dec[source - 1] * BST_DEG_RAD);
            assert_true(bst_vec3_angle(u, found[k].icrs) < 2e-9);
            bst_assert_close((double)found[k].v_mag, v[source - 1], 2e-3);
            bst_assert_close((double)found[k].b_minus_v, 0.5, 1e-3);
            bst_star again;
            bst_assert_ok(&f->ctx, bst_stars_find(&f->ctx, stars, found[k].id, 2000.0, &again));
            assert_true(bst_vec3_angle(again.icrs, found[k].icrs) < 1e-12);
        }
    }
    bst_star none;
    assert_int_equal(bst_stars_find(&f->ctx, stars, BST_STAR_TABLE_ID + STARS, 2000.0, &none),
                     BST_ERR_NOT_FOUND);
    assert_int_equal(bst_stars_source(stars, BST_STAR_TABLE_ID + STARS), 0);
    bst_stars_close(stars);
}

/* ---------------------------------------------------------------- with a base */

/* A base of six stars: A moves, B is double in the table, C has no motion (and moves fast), D is
 * bright, E is not in the table, F is fainter in the table by 2 mag (another star). */
static void write_base(files *f) {
    const bst_star_values base[] = {
        {10.0 * BST_DEG_RAD, 20.0 * BST_DEG_RAD, 1000, -2000, 9000, 700, 1,
         bst_star_id_make(1000, 1, 1)},
        {11.0 * BST_DEG_RAD, 20.0 * BST_DEG_RAD, 0, 10, 9500, 500, 1, bst_star_id_make(1000, 2, 1)},
        {12.0 * BST_DEG_RAD, (20.0 - 8.5 * ARCSEC_DEG) * BST_DEG_RAD, 0, 0, 10000, 500, 0,
         bst_star_id_make(1000, 3, 1)},
        {13.0 * BST_DEG_RAD, 20.0 * BST_DEG_RAD, 0, 10, 2000, 0, 1, bst_star_id_make(1000, 4, 1)},
        {14.0 * BST_DEG_RAD, 20.0 * BST_DEG_RAD, 0, 10, 8000, 0, 1, bst_star_id_make(1001, 5, 1)},
        {15.0 * BST_DEG_RAD, 20.0 * BST_DEG_RAD, 0, 10, 8000, 0, 1, bst_star_id_make(1001, 6, 1)},
    };
    const bst_star_patch all = {0.0, 0.0, 180.0, 9.0};
    bst_assert_ok(&f->ctx, bst_star_write(&f->ctx, base, 6, &all, f->base));
}

/* The star nearest to a direction, degrees, at J2000. */
static bst_star nearest(files *f, const bst_stars *stars, double ra, double dec, int expected) {
    bst_star found[8];
    int count;
    bst_vec3 at = bst_vec3_from_radec(ra * BST_DEG_RAD, dec * BST_DEG_RAD);
    bst_assert_ok(&f->ctx, bst_stars_query(&f->ctx, stars, at, 20.0 * BST_ARCSEC_RAD, 30.0, 2000.0,
                                           found, 8, &count));
    assert_int_equal(count, expected);
    int best = 0;
    for (int i = 1; i < count; i++) {
        if (bst_vec3_angle(found[i].icrs, at) < bst_vec3_angle(found[best].icrs, at)) {
            best = i;
        }
    }
    return found[best];
}

static void write_table(files *f) {
    FILE *file = fopen(f->table, "w");
    assert_non_null(file);
    const double c = cos(20.0 * BST_DEG_RAD);
    fputs("# a comment\nSOURCE_ID,RA,Dec,ref_epoch,pmRA,pmDE,\"Vmag\",B-V,name\n", file);
    /* A at 2016, by its motion of 100 and -200 mas/yr, 0.05 arcsec off */
    fprintf(file, "101,%.10f,%.10f,2016,100.5,-200.5,8.9,0.6,\"A, the first\"\n",
            10.0 + 16 * 0.1 * ARCSEC_DEG / c, 20.0 - 16 * 0.2 * ARCSEC_DEG + 0.05 * ARCSEC_DEG);
    /* B, and its companion at 1.2 arcsec, which comes first */
    fprintf(file, "102,%.10f,20,2000,0,0,9.9,0.6,\n", 11.0 + 1.2 * ARCSEC_DEG / c);
    fprintf(file, "103,%.10f,20,2000,0,0,9.4,0.6,\n", 11.0 + 0.1 * ARCSEC_DEG / c);
    /* C moves north by 1 arcsec a year: at 20 deg in 2000, 8.5 arcsec south in 1991.5 */
    fprintf(file, "104,12,%.10f,2016,0,1000,9.9,,\n", 20.0 + 16 * ARCSEC_DEG);
    fprintf(file, "105,13,20,2000,0,0,3.1,0.1,\n");  /* D */
    fprintf(file, "106,15,20,2000,0,0,10.1,0.1,\n"); /* not F */
    fprintf(file, "107,16,20,2000,0,0,,0.1,\n");     /* no magnitude */
    fprintf(file, "108,16,-20,2000,null,nan,12.5,,\n");
    assert_int_equal(fclose(file), 0);
}

static void test_stars_of_both_are_united(void **state) {
    files *f = *state;
    write_base(f);
    write_table(f);
    bst_star_merge_request q = request_of(f);
    bst_star_merge_counts n;
    q.base = f->base;
    bst_assert_ok(&f->ctx, bst_star_merge(&f->ctx, &q, &n));
    assert_int_equal(n.rows, 8);
    assert_int_equal(n.skipped, 1);
    assert_int_equal(n.base, 6);
    assert_int_equal(n.same, 4);
    assert_int_equal(n.written, 6 + 3);
    bst_stars *stars = open_stars(f, f->out);
    bst_stars_info info;
    bst_stars_get_info(stars, &info);
    assert_int_equal(info.table_count, 3);

    bst_star a = nearest(f, stars, 10.0, 20.0 + 0.05 * ARCSEC_DEG, 1);
    assert_int_equal(a.id, bst_star_id_make(1000, 1, 1));
    bst_assert_close((double)a.v_mag, 8.9, 1e-3);
    /* 16 years of 0.5 mas, and the rounding of the record */
    assert_true(
        bst_vec3_angle(a.icrs, bst_vec3_from_radec(10.0 * BST_DEG_RAD,
                                                   (20.0 + 0.05 * ARCSEC_DEG) * BST_DEG_RAD)) <
        0.013 * BST_ARCSEC_RAD);
    bst_star later;
    bst_assert_ok(&f->ctx, bst_stars_find(&f->ctx, stars, a.id, 2010.0, &later));
    bst_assert_close(bst_vec3_angle(a.icrs, later.icrs) / BST_ARCSEC_RAD,
                     10.0 * hypot(0.1005, 0.2005), 1e-3);

    bst_star b = nearest(f, stars, 11.0, 20.0, 2);
    assert_int_equal(b.id, bst_star_id_make(1000, 2, 1));
    bst_assert_close((double)b.v_mag, 9.4, 1e-3);
    bst_star companion = nearest(f, stars, 11.0 + 1.2 * ARCSEC_DEG, 20.0, 2);
    assert_true(companion.id >= BST_STAR_TABLE_ID);
    assert_int_equal(bst_stars_source(stars, companion.id), 102);

    bst_star c = nearest(f, stars, 12.0, 20.0, 1);
    assert_int_equal(c.id, bst_star_id_make(1000, 3, 1));
    assert_true(isnan(c.b_minus_v)); /* neither has a colour */
    bst_star d = nearest(f, stars, 13.0, 20.0, 1);
    assert_int_equal(d.id, bst_star_id_make(1000, 4, 1));
    bst_assert_close((double)d.v_mag, 2.0, 1e-3); /* bright: the base's */
    bst_star e = nearest(f, stars, 14.0, 20.0, 1);
    assert_int_equal(e.id, bst_star_id_make(1001, 5, 1));
    nearest(f, stars, 15.0, 20.0, 2);
    bst_star last = nearest(f, stars, 16.0, -20.0, 1);
    assert_int_equal(bst_stars_source(stars, last.id), 108);
    assert_true(isnan(last.b_minus_v));
    bst_stars_close(stars);

    /* the same table again adds nothing */
    char again[BST_TEST_PATH];
    name_file(again, ".stars");
    q.base = f->out;
    q.out = again;
    bst_assert_ok(&f->ctx, bst_star_merge(&f->ctx, &q, &n));
    assert_int_equal(n.written, 9);
    assert_int_equal(n.same, 7);
    stars = open_stars(f, again);
    last = nearest(f, stars, 16.0, -20.0, 1);
    assert_int_equal(bst_stars_source(stars, last.id), 108);
    bst_stars_close(stars);
    unlink(again);
}

static void test_completeness(void **state) {
    files *f = *state;
    write_base(f);
    write_table(f);
    bst_star_merge_request q = request_of(f);
    bst_star_merge_counts n;
    q.base = f->base;
    q.complete_to_v_mag = 13.0;
    q.has_cone = true;
    q.cone = (bst_star_patch){12.0, 20.0, 5.0, 0.0};
    bst_assert_ok(&f->ctx, bst_star_merge(&f->ctx, &q, &n));
    bst_stars *stars = open_stars(f, f->out);
    bst_vec3 in = bst_vec3_from_radec(12.0 * BST_DEG_RAD, 20.0 * BST_DEG_RAD);
    assert_true(bst_stars_complete_to(stars, in, 4.9 * BST_DEG_RAD) == 13.0);
    assert_true(bst_stars_complete_to(stars, in, 5.1 * BST_DEG_RAD) == 9.0); /* the base's */
    bst_stars_close(stars);
    q.has_cone = false;
    bst_assert_ok(&f->ctx, bst_star_merge(&f->ctx, &q, &n));
    stars = open_stars(f, f->out);
    assert_true(bst_stars_complete_to(stars, in, BST_PI) == 13.0);
    bst_stars_close(stars);
}

/* Two stars of the base 1 arcsec apart, and two rows that are both nearest to the first: the
 * farther row is the second star. Rows without colour or motion: the base's stay, with the table's
 * V. */
static void test_rows_share_out_the_base(void **state) {
    files *f = *state;
    const double c = cos(20.0 * BST_DEG_RAD);
    const bst_star_values base[] = {
        {10.0 * BST_DEG_RAD, 20.0 * BST_DEG_RAD, 0, 0, 9000, 2000, 1, bst_star_id_make(1000, 1, 1)},
        {(10.0 + 1.0 * ARCSEC_DEG / c) * BST_DEG_RAD, 20.0 * BST_DEG_RAD, 0, 0, 9000, 0, 1,
         bst_star_id_make(1000, 2, 1)},
        /* 0.3 arcsec a year to the north */
        {12.0 * BST_DEG_RAD, 20.0 * BST_DEG_RAD, 0, 3000, 9000, 500, 1,
         bst_star_id_make(1000, 3, 1)},
    };
    const bst_star_patch all = {0.0, 0.0, 180.0, 9.0};
    bst_assert_ok(&f->ctx, bst_star_write(&f->ctx, base, 3, &all, f->base));
    FILE *file = fopen(f->table, "w");
    assert_non_null(file);
    fputs("ra,dec,ref_epoch,v_mag,b_minus_v\n", file);
    fprintf(file, "%.10f,20,2016,9.1,\n", 10.0 + 0.4 * ARCSEC_DEG / c);
    fprintf(file, "%.10f,20,2016,8.95,\n", 10.0 + 0.1 * ARCSEC_DEG / c);
    fprintf(file, "12,%.10f,2016,8.8,0.3\n", 20.0 + 16 * 0.3 * ARCSEC_DEG);
    assert_int_equal(fclose(file), 0);
    bst_star_merge_request q = request_of(f);
    bst_star_merge_counts n;
    q.base = f->base;
    bst_assert_ok(&f->ctx, bst_star_merge(&f->ctx, &q, &n));
    assert_int_equal(n.written, 3);
    assert_int_equal(n.same, 3);
    assert_int_equal(n.at_rest, 3);
    bst_stars *stars = open_stars(f, f->out);
    bst_star one;
    bst_assert_ok(&f->ctx, bst_stars_find(&f->ctx, stars, base[0].id, 2000.0, &one));
    bst_assert_close((double)one.v_mag, 8.95, 1e-3);
    bst_assert_close((double)one.b_minus_v, 1.7, 1e-3);
    bst_assert_ok(&f->ctx, bst_stars_find(&f->ctx, stars, base[1].id, 2000.0, &one));
    bst_assert_close((double)one.v_mag, 9.1, 1e-3);
    bst_assert_ok(&f->ctx, bst_stars_find(&f->ctx, stars, base[2].id, 2016.0, &one));
    bst_assert_close((double)one.v_mag, 8.8, 1e-3);
    bst_assert_close((double)one.b_minus_v, 0.3, 1e-3);
    bst_vec3 there =
        bst_vec3_from_radec(12.0 * BST_DEG_RAD, (20.0 + 16 * 0.3 * ARCSEC_DEG) * BST_DEG_RAD);
    assert_true(bst_vec3_angle(one.icrs, there) < 0.002 * BST_ARCSEC_RAD);
    bst_stars_close(stars);
}

/* ---------------------------------------------------------------- magnitudes */

static double magnitude_of(files *f, const char *head, const char *row, double zero_point,
                           double *b_minus_v) {
    char text[400];
    snprintf(text, sizeof text, "ra,dec,epoch,%s\n1,2,2016,%s\n", head, row);
    write_text(f->table, text);
    bst_star_table_options options = {NAN, zero_point};
    bst_star_table *table = NULL;
    bst_assert_ok(&f->ctx, bst_star_table_open(&f->ctx, f->table, &options, &table));
    bst_star_table_row r;
    bool end;
    bst_assert_ok(&f->ctx, bst_star_table_next(&f->ctx, table, &r, &end));
    assert_false(end);
    *b_minus_v = r.b_minus_v;
    bst_star_table_close(table);
    return r.v_mag;
}

static void test_magnitudes(void **state) {
    files *f = *state;
    double colour;
    /* the Sun: G -26.90, V -26.76 (Willmer 2018), BP-RP 0.82, B-V 0.65; here 30 mag fainter */
    bst_assert_close(magnitude_of(f, "gmag,bp_rp", "3.10,0.82", NAN, &colour), 3.24, 0.03);
    bst_assert_close(colour, 0.65, 0.06);
    /* Vega defines G = BP = RP = V = 0.03 */
    bst_assert_close(magnitude_of(f, "phot_g_mean_mag,phot_bp_mean_mag,phot_rp_mean_mag",
                                  "0.03,0.03,0.03", NAN, &colour),
                     0.03, 0.03);
    bst_assert_close(colour, 0.0, 0.02);
    /* Proxima: G 8.98, BP 11.37, RP 7.57, V 11.13, B-V 1.82 */
    bst_assert_close(magnitude_of(f, "gmag,bpmag,rpmag", "8.98,11.37,7.57", NAN, &colour), 11.13,
                     0.25);
    assert_true(colour > 1.3 && colour < 2.1); /* that of BP-RP 3, where the relation ends */
    bst_assert_close(magnitude_of(f, "g,bp-rp", "12,", NAN, &colour), 12.16, 0.02);
    assert_true(isnan(colour));
    /* V goes before G, B-V before B */
    bst_assert_close(magnitude_of(f, "g,bp_rp,v,b_minus_v,b", "12,1,11,0.3,9", NAN, &colour), 11.0,
                     1e-12);
    bst_assert_close(colour, 0.3, 1e-12);
    bst_assert_close(magnitude_of(f, "v,b", "11,11.7", NAN, &colour), 11.0, 1e-12);
    bst_assert_close(colour, 0.7, 1e-12);
    bst_assert_close(magnitude_of(f, "electrons_per_s", "1000", 25.0, &colour), 17.5, 1e-12);
}

/* Rows that are read and those of them without position or magnitude, of a VOTable with integer
 * magnitudes, whose null is given with the element VALUES. */
static void count_rows(files *f, const char *values, const char *data, int64_t *rows,
                       int64_t *skipped) {
    char text[2048];
    snprintf(text, sizeof text,
             "<?xml version=\"1.0\"?>\n<VOTABLE version=\"1.4\"><RESOURCE><TABLE>"
             "<FIELD name=\"ra\" datatype=\"short\" unit=\"deg\"/>"
             "<FIELD name=\"dec\" datatype=\"short\"/>"
             "<FIELD name=\"V\" datatype=\"long\">%s<DATA>%s</DATA></TABLE></RESOURCE></VOTABLE>",
             values, data);
    write_text(f->table, text);
    const bst_star_table_options options = {.epoch_year = 2000.0, .zero_point_mag = NAN};
    bst_star_table *table;
    bool end = false;
    bst_assert_ok(&f->ctx, bst_star_table_open(&f->ctx, f->table, &options, &table));
    while (!end) {
        bst_star_table_row row;
        bst_assert_ok(&f->ctx, bst_star_table_next(&f->ctx, table, &row, &end));
    }
    bst_star_table_counts(table, rows, skipped);
    bst_star_table_close(table);
}

static void test_nulls_of_votables(void **state) {
    files *f = *state;
    static const char cells[] =
        "<TABLEDATA><TR><TD>1</TD><TD>2</TD><TD>7</TD></TR>"
        "<TR><TD>1</TD><TD>2</TD><TD>9</TD></TR></TABLEDATA>";
    /* the same, and a magnitude of -2^63 */
    static const char binary[] =
        "<BINARY><STREAM encoding=\"base64\">AAEAAgAAAAAAAAAHAAEAAgAAAAAAAAAJ</STREAM></BINARY>";
    static const char lowest[] =
        "<BINARY><STREAM encoding=\"base64\">AAEAAgAAAAAAAAAHAAEAAoAAAAAAAAAA</STREAM></BINARY>";
    static const struct {
        const char *values, *data;
        int skipped;
    } cases[] = {
        {"</FIELD>", cells, 0},
        {"<VALUES null=\"7\"/></FIELD>", cells, 1},
        /* of a PARAM, not of the FIELD before it */
        {"</FIELD><PARAM name=\"p\" datatype=\"int\" value=\"7\"><VALUES null=\"7\"/></PARAM>",
         cells, 0},
        {"<VALUES null=\"8\"/></FIELD><PARAM name=\"p\" datatype=\"int\" value=\"7\">"
         "<VALUES null=\"7\"/></PARAM>",
         binary, 0},
        {"<VALUES null=\"7\"/></FIELD>", binary, 1},
        {"<VALUES null=\"0x7\"/></FIELD>", binary, 1},
        {"<VALUES null=\"7x\"/></FIELD>", binary, 0},
        {"<VALUES null=\"-9223372036854775808\"/></FIELD>", lowest, 1},
        {"<VALUES null=\"-0x8000000000000000\"/></FIELD>", lowest, 1},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        int64_t rows, skipped;
        count_rows(f, cases[i].values, cases[i].data, &rows, &skipped);
        assert_int_equal(rows, 2);
        if (skipped != cases[i].skipped) {
            fail_msg("case %zu: %lld rows skipped", i, (long long)skipped);
        }
    }
}

/* ---------------------------------------------------------------- bad tables */

static void test_bad_tables(void **state) {
    files *f = *state;
    static const struct {
        const char *text, *message;
    } bad[] = {
        {"", "is empty; give a table with a line of names"},
        {"ra,dek,epoch,v\n", "has no column of declinations; allowed names: dec dec_deg"},
        {"ra,dec,epoch\n1,2,3\n", "has no column of magnitudes; allowed names: phot_g_mean_mag"},
        {"ra,dec,v\n1,2,3\n", "has no column of epochs (allowed names: ref_epoch"},
        {"ra,dec,epoch,electrons_per_s\n", "column electrons_per_s needs --zero-point"},
        {"ra,dec,epoch,v\n1,2,2000,5\n1,2,2000,five\n",
         ":3: bad number in column v (found \"five\""},
        {"ra,dec,epoch,v\n361,2,2000,5\n", "row 1: column ra: 361 is outside 0 to 360"},
        {"ra,dec,epoch,v\n1,-90.5,2000,5\n", "column dec: -90.5 is outside -90 to 90"},
        {"ra,dec,epoch,v\n1,2,20,5\n", "column epoch: 20 is outside 1800 to 2200"},
        {"ra,dec,epoch,v\n1,2,2000,55\n", "column v: 55 is outside -2.5 to 40"},
        {"ra,dec,epoch,v,pmra,pmdec\n1,2,2000,5,0,13001\n", "column pmdec: 13001 is outside"},
        {"ra,dec,epoch,v\n1,2,2000,\"5\n", ":2: a quotation mark has no end"},
        {"ra,dec,epoch,v\n,,,\n", "no stars to write"},
        {"ra,dec,epoch,v\n1,2,2000\n", ":2: 3 fields, but 4 names of columns"},
        {"ra,dec,epoch,v,pmra\n", "one column of proper motion only; the other may be named pmdec"},
        {"# %ECSV 1.0\n# - {name: ra, unit: rad, datatype: float64}\nra dec epoch v\n1 2 2000 5\n",
         "column ra: unit \"rad\"; allowed: deg"},
        {"<?xml version=\"1.0\"?>\n<VOTABLE>", "is no XML: no element found"},
        {"<?xml version=\"1.0\"?>\n<VOTABLE></VOTABLE>", "has no TABLE with FIELDs"},
        {"<?xml version=\"1.0\"?>\n<!DOCTYPE VOTABLE [<!ENTITY a \"b\">]><VOTABLE>&a;</VOTABLE>",
         "a document type declaration is not allowed"},
        {"<?xml version=\"1.0\"?>\n<VOTABLE version=\"1.4\"><RESOURCE><TABLE><FIELD name=\"ra\" "
         "datatype=\"degrees\"/>",
         "column ra: datatype \"degrees\" with arraysize \"\" is not"},
        {"<?xml version=\"1.0\"?>\n<VOTABLE version=\"1.4\"><RESOURCE><TABLE><FIELD name=\"ra\" "
         "datatype=\"int\" arraysize=\"2x0\"/>",
         "with arraysize \"2x0\" is not"},
        {"<?xml version=\"1.0\"?>\n<VOTABLE version=\"1.4\"><RESOURCE><TABLE><FIELD name=\"n\" "
         "datatype=\"char\" arraysize=\"268435456x*\"/>",
         "column n: arraysize \"268435456x*\" has more than 268435455 elements in each item"},
        {"<?xml version=\"1.0\"?>\n<VOTABLE version=\"1.4\"><RESOURCE><TABLE><FIELD name=\"ra\" "
         "datatype=\"char\" arraysize=\"*\"/>",
         "column ra does not hold one number"},
        {"<?xml version=\"1.0\"?>\n<VOTABLE version=\"1.4\"><RESOURCE><TABLE><FIELD name=\"ra\" "
         "datatype=\"float\" unit=\"rad\"/>",
         "column ra: unit \"rad\"; allowed: deg"},
        {"<?xml version=\"1.0\"?>\n<VOTABLE version=\"1.4\"><RESOURCE><TABLE><FIELD name=\"ra\" "
         "datatype=\"double\" unit=\"deg\"/><FIELD name=\"dec\" "
         "datatype=\"double\"/></TABLE></RESOURCE></VOTABLE>",
         "has no column of magnitudes"},
        {"<?xml version=\"1.0\"?>\n<VOTABLE version=\"1.4\"><RESOURCE><TABLE><FIELD name=\"ra\" "
         "datatype=\"double\" unit=\"deg\"/><FIELD name=\"dec\" datatype=\"double\"/><FIELD "
         "name=\"V\" datatype=\"float\"/><FIELD name=\"epoch\" "
         "datatype=\"short\"/><DATA><TABLEDATA><TR><TD>1</TD></TR>",
         "a row has fewer cells than"},
        {"<?xml version=\"1.0\"?>\n<VOTABLE version=\"1.4\"><RESOURCE><TABLE><FIELD name=\"ra\" "
         "datatype=\"double\" unit=\"deg\"/><FIELD name=\"dec\" datatype=\"double\"/><FIELD "
         "name=\"V\" datatype=\"float\"/><FIELD name=\"epoch\" "
         "datatype=\"short\"/><DATA><TABLEDATA><TR><TD>1</TD><TD>2</TD><TD/><TD/><TD/></TR>",
         "a row has more cells than"},
        {"<?xml version=\"1.0\"?>\n<VOTABLE version=\"1.4\"><RESOURCE><TABLE><FIELD name=\"ra\" "
         "datatype=\"double\" unit=\"deg\"/><FIELD name=\"dec\" datatype=\"double\"/><FIELD "
         "name=\"V\" datatype=\"float\"/><FIELD name=\"epoch\" "
         "datatype=\"short\"/><DATA><TABLEDATA><TR><TD>1</TD><TD>two</TD>",
         "row 1: bad number in column dec: \"two\""},
        {"<?xml version=\"1.0\"?>\n<VOTABLE version=\"1.4\"><RESOURCE><TABLE><FIELD name=\"ra\" "
         "datatype=\"double\" unit=\"deg\"/><FIELD name=\"dec\" datatype=\"double\"/><FIELD "
         "name=\"V\" datatype=\"float\"/><FIELD name=\"epoch\" "
         "datatype=\"short\"/><DATA><BINARY2><STREAM encoding=\"base64\">A*==</STREAM>",
         "the STREAM is not base64"},
        {"<?xml version=\"1.0\"?>\n<VOTABLE version=\"1.4\"><RESOURCE><TABLE><FIELD name=\"ra\" "
         "datatype=\"double\" unit=\"deg\"/><FIELD name=\"dec\" datatype=\"double\"/><FIELD "
         "name=\"V\" datatype=\"float\"/><FIELD name=\"epoch\" "
         "datatype=\"short\"/><DATA><BINARY2><STREAM encoding=\"base64\">AAAA</STREAM>",
         "the STREAM ends within a row"},
        {"<?xml version=\"1.0\"?>\n<VOTABLE version=\"1.4\"><RESOURCE><TABLE><FIELD name=\"ra\" "
         "datatype=\"double\" unit=\"deg\"/><FIELD name=\"dec\" datatype=\"double\"/><FIELD "
         "name=\"V\" datatype=\"float\"/><FIELD name=\"epoch\" "
         "datatype=\"short\"/><DATA><BINARY><STREAM encoding=\"gzip\"/>",
         "another encoding than base64"},
        {"<?xml version=\"1.0\"?>\n<VOTABLE version=\"1.4\"><RESOURCE><TABLE><FIELD name=\"ra\" "
         "datatype=\"double\" unit=\"deg\"/><FIELD name=\"dec\" datatype=\"double\"/><FIELD "
         "name=\"V\" datatype=\"float\"/><FIELD name=\"epoch\" "
         "datatype=\"short\"/><DATA><BINARY2><STREAM href=\"file:///etc/passwd\" "
         "encoding=\"base64\"/>",
         "refers to another file by href"},
        {"<?xml version=\"1.0\"?>\n<VOTABLE version=\"1.4\"><RESOURCE><TABLE><FIELD name=\"ra\" "
         "datatype=\"double\" unit=\"deg\"/><FIELD name=\"dec\" datatype=\"double\"/><FIELD "
         "name=\"V\" datatype=\"float\"/><FIELD name=\"epoch\" datatype=\"short\"/><DATA><FITS>",
         "its rows are a FITS file"},
        {"<?xml version=\"1.0\"?>\n<VOTABLE><INFO name=\"QUERY_STATUS\" value=\"ERROR\"/>",
         "the query that made it has failed"},
        {"SIMPLE  =                    T", "cannot be opened"},
    };
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        write_text(f->table, bad[i].text);
        bst_star_merge_request q = request_of(f);
        bst_star_merge_counts n;
        assert_true(bst_star_merge(&f->ctx, &q, &n) != BST_OK);
        if (!strstr(f->ctx.message, bad[i].message)) {
            fail_msg("\"%s\" lacks \"%s\"", f->ctx.message, bad[i].message);
        }
        assert_int_equal(access(f->out, F_OK), -1);
    }
    bst_star_merge_request q = request_of(f);
    bst_star_merge_counts n;
    q.table = "/nowhere/x.csv";
    assert_int_equal(bst_star_merge(&f->ctx, &q, &n), BST_ERR_NOT_FOUND);
}

/* Names of columns in the archives' tables (Gaia's archive, VizieR's I/355, and our own) are found,
 * in any case, and no name means two quantities. */
static void test_names_of_columns(void **state) {
    (void)state;
    static const struct {
        const char *name;
        bst_star_quantity quantity;
    } known[] = {{"ra", BST_STAR_RA},
                 {"RA_ICRS", BST_STAR_RA},
                 {"DE_ICRS", BST_STAR_DEC},
                 {"dec_deg", BST_STAR_DEC},
                 {"ref_epoch", BST_STAR_EPOCH},
                 {"pmRA", BST_STAR_PM_RA},
                 {"pmDE", BST_STAR_PM_DEC},
                 {"pmdec", BST_STAR_PM_DEC},
                 {"phot_g_mean_mag", BST_STAR_G},
                 {"Gmag", BST_STAR_G},
                 {"bp_rp", BST_STAR_BP_RP},
                 {"BP-RP", BST_STAR_BP_RP},
                 {"phot_bp_mean_mag", BST_STAR_BP},
                 {"BPmag", BST_STAR_BP},
                 {"bp", BST_STAR_BP},
                 {"phot_rp_mean_mag", BST_STAR_RP},
                 {"RPmag", BST_STAR_RP},
                 {"Vmag", BST_STAR_V},
                 {"V", BST_STAR_V},
                 {"B-V", BST_STAR_B_MINUS_V},
                 {"b_minus_v", BST_STAR_B_MINUS_V},
                 {"Bmag", BST_STAR_B},
                 {"b", BST_STAR_B},
                 {"electrons_per_s", BST_STAR_ELECTRONS}};
    for (size_t i = 0; i < sizeof known / sizeof *known; i++) {
        for (int q = 0; q < BST_STAR_QUANTITIES; q++) {
            bool found =
                bst_star_name_is(bst_star_quantity_names[q], known[i].name, strlen(known[i].name));
            if (found != (q == (int)known[i].quantity)) {
                fail_msg("%s is%s quantity %d", known[i].name, found ? "" : " not", q);
            }
        }
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_names_of_columns),
        cmocka_unit_test_setup_teardown(test_queries_find_each_star_once, setup, teardown),
        cmocka_unit_test_setup_teardown(test_stars_of_both_are_united, setup, teardown),
        cmocka_unit_test_setup_teardown(test_rows_share_out_the_base, setup, teardown),
        cmocka_unit_test_setup_teardown(test_completeness, setup, teardown),
        cmocka_unit_test_setup_teardown(test_magnitudes, setup, teardown),
        cmocka_unit_test_setup_teardown(test_nulls_of_votables, setup, teardown),
        cmocka_unit_test_setup_teardown(test_bad_tables, setup, teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
