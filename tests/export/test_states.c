/* States by SGP4: rows against the published verification run of SGP4 (Vallado, Crawford, Hujsak
 * and Kelso 2006, AIAA 2006-6753), and the celestial frame against precession and nutation by hand.
 */
#include <math.h>

#include "boresight/vec.h"
#include "sim/astro/sgp4.h"
#include "sim/export/export_states.h"
#include "tests/io/scratch.h"
#include "tests/test_support.h"

/* Satellite 5 twice: two days before the start in another orbit, then at the start. The other is
 * in so low an orbit that it lies below the ground at 720 minutes. */
static const char sets[] =
    "1 00005U 58002B   20177.78495062  .00000023  00000-0  28098-4 0  4753\n"
    "2 00005  44.2682 348.7242 1859667 331.7664  99.3264 10.82419157413666\n"
    "0 VANGUARD 1\n"
    "1 00005U 58002B   20179.78495062  .00000023  00000-0  28098-4 0  4755\n"
    "2 00005  34.2682 348.7242 1859667 331.7664  19.3264 10.82419157413667\n"
    "0 LOW\n"
    "1 28872U          20179.78495062  .25992681  00000-0  24476-3 0  1537\n"
    "2 28872  96.4736 157.9986 0303955 244.0492 110.6523 17.00015938107087\n";

/* km and km/s at 0, 360 and 720 minutes */
static const double truth[3][6] = {
    {7022.46529266, -1400.08296755, 0.03995155, 1.893841015, 6.405893759, 4.534807250},
    {-7154.03120202, -3783.17682504, -3536.19412294, 4.741887409, -4.151817765, -2.093935425},
    {-7134.59340119, 6531.68641334, 3260.27186483, -4.113793027, -2.911922039, -2.557327851}};

typedef struct bench {
    scratch place;
    bst_export_states_request q;
    char elements[1024], output[1024], text[8192];
} bench;

static void open_bench(bench *b) {
    bst_ctx ctx = {0};
    memset(b, 0, sizeof *b);
    scratch_make(&b->place);
    snprintf(b->elements, sizeof b->elements, "%s", scratch_path(&b->place, "elements.tle"));
    snprintf(b->output, sizeof b->output, "%s", scratch_path(&b->place, "states"));
    FILE *file = fopen(b->elements, "w");
    assert_non_null(file);
    fputs(sets, file);
    assert_int_equal(fclose(file), 0);
    b->q = (bst_export_states_request){.elements = b->elements,
                                       .output = b->output,
                                       .norad = 5,
                                       .gravity = BST_SGP4_WGS72,
                                       .mode = BST_SGP4_AFSPC,
                                       .step_ticks = INT64_C(21600000000),
                                       .rows = 3,
                                       .time_digits = 6};
    bst_assert_ok(&ctx, bst_time_from_utc(&ctx, "2020-06-27T18:50:19.733568Z", &b->q.start));
}

/* Writes the states and reads the file. */
static bool written(bench *b) {
    bst_ctx ctx = {0};
    bool complete = false;
    bst_assert_ok(&ctx, bst_export_states(&ctx, &b->q, &complete));
    FILE *file = fopen(b->output, "r");
    assert_non_null(file);
    size_t n = fread(b->text, 1, sizeof b->text - 1, file);
    b->text[n] = '\0';
    fclose(file);
    return complete;
}

/* Six numbers after `from`, each within `tolerance` of truth + shift. */
static void expect_row(const char *from, int row, const double *shift, double tolerance) {
    double v[6];
    int n = *from == ','
                ? sscanf(from, ",%lf,%lf,%lf,%lf,%lf,%lf", &v[0], &v[1], &v[2], &v[3], &v[4], &v[5])
                : sscanf(from, "%lf %lf %lf %lf %lf %lf", &v[0], &v[1], &v[2], &v[3], &v[4], &v[5]);
    assert_int_equal(n, 6);
    for (int i = 0; i < 6; i++) {
        double wanted = truth[row][i] + (shift ? shift[i] : 0);
        bst_assert_close(v[i], wanted, i < 3 ? tolerance : 1e-3 * tolerance);
    }
}

static const char *after(const char *text, const char *what) {
    const char *at = strstr(text, what);
    if (!at) {
        fail_msg("no %s in %s", what, text);
    }
    return at + strlen(what);
}

static const char *const times[] = {"2020-06-27T18:50:19.733568", "2020-06-28T00:50:19.733568",
                                    "2020-06-28T06:50:19.733568"};

static void rows(void **state) {
    (void)state;
    bench b;
    char key[64];
    open_bench(&b);
    assert_true(written(&b));
    assert_int_equal(strncmp(b.text, "utc,norad,x_km,y_km,z_km,vx_kmps,vy_kmps,vz_kmps\n", 49), 0);
    for (int i = 0; i < 3; i++) {
        snprintf(key, sizeof key, "%sZ,5", times[i]);
        expect_row(after(b.text, key), i, NULL, 1e-5);
    }
    b.q.format = BST_EXPORT_STATES_OEM;
    assert_true(written(&b));
    after(b.text, "OBJECT_NAME = VANGUARD 1\n");
    after(b.text, "OBJECT_ID = 1958-002B\n");
    after(b.text, "REF_FRAME = TEME\n");
    after(b.text, "SGP4, catalogue number 5, WGS-72, opsmode a\n");
    for (int i = 0; i < 3; i++) {
        const char *data = after(b.text, "META_STOP");
        expect_row(after(data, times[i]), i, NULL, 1e-5);
    }
    scratch_remove(&b.place);
}

static bst_vec3 turned(bst_vec3 r, double a) {
    return (bst_vec3){r.x * cos(a) + r.y * sin(a), r.y * cos(a) - r.x * sin(a), r.z};
}

/* Precession of Lieske et al. 1977 after T centuries, and nutation by its four largest terms:
 * -16.89 seconds of arc in longitude and -0.17 in obliquity. */
static bst_vec3 celestial(const double *teme) {
    const double arc = 1 / 206264.8, t = 0.2048812, zeta = (2306.2181 * t + 0.302 * t * t) * arc,
                 z = (2306.2181 * t + 1.095 * t * t) * arc,
                 theta = (2004.3109 * t - 0.427 * t * t) * arc, n = -16.89 * 0.39776 * arc,
                 e = -0.17 * arc;
    bst_vec3 r = turned((bst_vec3){teme[0] + n * teme[2], teme[1] + e * teme[2],
                                   teme[2] - n * teme[0] - e * teme[1]},
                        z);
    return turned(
        (bst_vec3){r.x * cos(theta) + r.z * sin(theta), r.y, r.z * cos(theta) - r.x * sin(theta)},
        zeta);
}

static void celestial_frame(void **state) {
    (void)state;
    bench b;
    char key[64];
    open_bench(&b);
    b.q.frame = BST_EXPORT_STATES_GCRF;
    assert_true(written(&b));
    for (int i = 0; i < 3; i++) {
        double shift[6];
        for (int k = 0; k < 6; k += 3) {
            bst_vec3 r = celestial(truth[i] + k);
            shift[k] = r.x - truth[i][k];
            shift[k + 1] = r.y - truth[i][k + 1];
            shift[k + 2] = r.z - truth[i][k + 2];
        }
        snprintf(key, sizeof key, "%sZ,5", times[i]);
        expect_row(after(b.text, key), i, shift, 0.02);
    }
    b.q.format = BST_EXPORT_STATES_OEM;
    b.q.gravity = BST_SGP4_WGS84;
    b.q.mode = BST_SGP4_IMPROVED;
    assert_true(written(&b));
    after(b.text, "REF_FRAME = GCRF\n");
    after(b.text, "SGP4, catalogue number 5, WGS-84, opsmode i\n");
    scratch_remove(&b.place);
}

/* A satellite that comes down ends early, the others go on; a name and a designator that lack. */
static void all_satellites(void **state) {
    (void)state;
    bench b;
    open_bench(&b);
    b.q.norad = 0;
    assert_false(written(&b));
    int lines = 0;
    for (const char *c = b.text; *c; c++) {
        lines += *c == '\n';
    }
    assert_int_equal(lines, 1 + 3 + 2); /* one set for each satellite */
    after(b.text, "2020-06-27T18:50:19.733568Z,28872,");
    b.q.format = BST_EXPORT_STATES_OEM;
    b.q.norad = 28872;
    assert_false(written(&b));
    after(b.text, "OBJECT_NAME = LOW\n");
    after(b.text, "OBJECT_ID = NORAD-28872\n");
    b.q.norad = 5;
    b.q.start = bst_time_add(b.q.start, -1.6 * 86400); /* nearer to the first set, without a name */
    assert_true(written(&b));
    after(b.text, "OBJECT_NAME = NORAD-5\n");
    scratch_remove(&b.place);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(rows),
        cmocka_unit_test(celestial_frame),
        cmocka_unit_test(all_satellites),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
