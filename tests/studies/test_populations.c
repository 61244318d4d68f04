/* Populations of a study: numbers, orbits and brightnesses of objects against their laws. */
#include <cjson/cJSON.h>

#include "tests/studies/study_fixture.h"

static char folder[BST_TEST_PATH];

static int set_up(void **state) {
    (void)state;
    fixture_folder(folder);
    return 0;
}

static int tear_down(void **state) {
    (void)state;
    fixture_remove(folder);
    return 0;
}

/* Standard normal, and sqrt(n) times the Kolmogorov distance, exceeded once in 10,000. */
static const double normal_limit = 3.719, kolmogorov_limit = 2.225;

static void open_study(const char *body, bst_study *out) {
    bst_ctx ctx = {0};
    bst_assert_ok(&ctx, fixture_open(&ctx, folder, body, out));
}

/* A run's scenario; the caller frees it. */
static bst_json *scenario_of(const bst_study *s, int64_t run) {
    bst_ctx ctx = {0};
    bst_study_value v[8];
    bst_json *json;
    cJSON *settings;
    bst_study_place place = bst_study_place_of(s, run);
    bst_study_values(s, &place, v);
    bst_assert_ok(&ctx, bst_study_document(&ctx, s, &place, v, &json, &settings));
    return json;
}

static const cJSON *objects_of(const bst_json *json) {
    const cJSON *world = cJSON_GetObjectItem(bst_json_root(json), "world");
    return cJSON_GetObjectItem(world, "objects");
}

/* Wilson and Hilferty 1931: the cube root of chi-square by its degrees of freedom is normal. */
static void assert_chi_square(double chi2, double degrees) {
    double k = 2.0 / (9.0 * degrees);
    double z = (cbrt(chi2 / degrees) - 1.0 + k) / sqrt(k);
    if (!(z < normal_limit)) {
        fail_msg("chi-square %g of %g degrees", chi2, degrees);
    }
}

/* How often each number came in `runs` runs, against its probabilities [bins], of which the last
 * is that of all greater ones. */
static void check_numbers(const char *number, int runs, const double *p, int bins) {
    char body[400];
    bst_study s;
    snprintf(body, sizeof body,
             "\"replicates\": %d, \"populations\": [{\"name\": \"targets\", \"number\": %s, "
             "\"object\": {\"orbit\": {}}}]",
             runs, number);
    open_study(body, &s);
    double *seen = calloc((size_t)bins, sizeof *seen), chi2 = 0.0, degrees = -1.0;
    assert_non_null(seen);
    for (int64_t run = 0; run < s.runs; run++) {
        bst_study_value v[8];
        bst_study_place place = bst_study_place_of(&s, run);
        bst_study_values(&s, &place, v);
        int n = (int)v[0].number;
        assert_true(v[0].given && v[0].is_number && v[0].number == n && n >= 0);
        seen[n < bins ? n : bins - 1]++;
    }
    for (int i = 0; i < bins; i++) {
        if (p[i] == 0.0) {
            assert_true(seen[i] == 0.0);
            continue;
        }
        chi2 += pow(seen[i] - runs * p[i], 2) / (runs * p[i]);
        degrees++;
    }
    assert_chi_square(chi2, degrees);
    assert_string_equal(s.axes[0].name, "targets");
    free(seen);
    bst_study_close(&s);
}

static void test_numbers(void **state) {
    (void)state;
    double uniform[8] = {0.0, 0.0, 0.2, 0.2, 0.2, 0.2, 0.2, 0.0};
    check_numbers("{\"distribution\": \"uniform\", \"from\": 2, \"to\": 6}", 20000, uniform, 8);
    double poisson[12], rest = 1.0, all = 0.0;
    for (int k = 0; k < 12; k++) {
        poisson[k] = k < 11 ? exp(-3.5 + k * log(3.5) - lgamma(k + 1.0)) : rest;
        rest -= poisson[k];
    }
    check_numbers("{\"distribution\": \"poisson\", \"mean\": 3.5}", 20000, poisson, 12);
    double four[6];
    for (int k = 0; k < 6; k++) {
        four[k] = k < 5 ? poisson[k] : 0.0;
        all += four[k];
    }
    for (int k = 0; k < 5; k++) {
        four[k] /= all;
    }
    check_numbers("{\"distribution\": \"poisson\", \"mean\": 3.5, \"max\": 4}", 20000, four, 6);
}

/* A great mean: its moments, within 5 standard errors, where the first term is 1e-196. */
static void test_great_mean(void **state) {
    (void)state;
    bst_study s;
    open_study(
        "\"replicates\": 4000, \"populations\": [{\"name\": \"many\", \"number\": "
        "{\"distribution\": "
        "\"poisson\", \"mean\": 450}, \"object\": {\"orbit\": {}}}]",
        &s);
    double sum = 0.0, squares = 0.0;
    for (int64_t run = 0; run < s.runs; run++) {
        bst_study_value v[8];
        bst_study_place place = bst_study_place_of(&s, run);
        bst_study_values(&s, &place, v);
        sum += v[0].number - 450.0;
        squares += pow(v[0].number - 450.0, 2);
    }
    bst_assert_close(sum / 4000.0, 0.0, 5.0 * sqrt(450.0 / 4000.0));
    bst_assert_close(squares / 4000.0, 450.0, 5.0 * 450.0 * sqrt(2.0 / 4000.0));
    bst_study_close(&s);
}

static int compare(const void *a, const void *b) {
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* sqrt(n) times the greatest distance of n values from a uniform distribution of 0 to 1. */
static double distance(double *u, int n) {
    double worst = 0.0;
    qsort(u, (size_t)n, sizeof *u, compare);
    for (int i = 0; i < n; i++) {
        worst = fmax(worst, fmax((i + 1.0) / n - u[i], u[i] - (double)i / n));
    }
    return worst * sqrt(n);
}

/* Orbits and brightnesses: each law by its distribution function, no two draws alike, neighbours in
 * a run and objects of the same number in two runs uncorrelated. */
static void test_values(void **state) {
    (void)state;
    enum { RUNS = 1500, EACH = 3, ALL = RUNS * EACH };
    bst_study s;
    open_study(
        "\"replicates\": 1500, \"populations\": [{\"name\": \"t\", \"number\": {\"count\": 3}, "
        "\"object\": {\"orbit\": {\"source\": \"relative\", \"reference\": \"x\", "
        "\"offset_rtn_m\": [0, 5, 0]}, \"brightness\": {\"standard_v_mag\": 7}}, "
        "\"dispersions\": [{\"path\": \"/orbit/offset_rtn_m/0\", \"from\": -2, \"to\": 6}, "
        "{\"path\": \"/orbit/offset_rtn_m/1\", \"distribution\": \"normal\", \"mean\": 1, "
        "\"sigma\": 3, \"truncate_sigma\": 2, \"apply\": \"add\"}, "
        "{\"path\": \"/brightness/standard_v_mag\", \"distribution\": \"log_uniform\", \"from\": "
        "1, \"to\": 10, \"linked_paths\": [\"/brightness/also\"]}]}]",
        &s);
    double *u[3], product = 0.0, across = 0.0;
    for (int k = 0; k < 3; k++) {
        u[k] = calloc(ALL, sizeof **u);
        assert_non_null(u[k]);
    }
    for (int64_t run = 0; run < RUNS; run++) {
        bst_json *json = scenario_of(&s, run);
        const cJSON *list = objects_of(json);
        assert_int_equal(cJSON_GetArraySize(list), EACH);
        for (int k = 0; k < EACH; k++) {
            const cJSON *object = cJSON_GetArrayItem(list, k);
            const cJSON *offset =
                cJSON_GetObjectItem(cJSON_GetObjectItem(object, "orbit"), "offset_rtn_m");
            const cJSON *brightness = cJSON_GetObjectItem(object, "brightness");
            char name[16];
            snprintf(name, sizeof name, "t_%d", k + 1);
            assert_string_equal(cJSON_GetObjectItem(object, "name")->valuestring, name);
            double z = (cJSON_GetArrayItem(offset, 1)->valuedouble - 5.0 - 1.0) / 3.0;
            double magnitude = cJSON_GetObjectItem(brightness, "standard_v_mag")->valuedouble;
            assert_true(cJSON_GetObjectItem(brightness, "also")->valuedouble == magnitude);
            assert_true(fabs(z) <= 2.0);
            int i = (int)run * EACH + k;
            u[0][i] = (cJSON_GetArrayItem(offset, 0)->valuedouble + 2.0) / 8.0;
            u[1][i] = 0.5 * (1.0 + erf(z / sqrt(2.0)) / erf(sqrt(2.0)));
            u[2][i] = log10(magnitude);
            product += k > 0 ? (u[0][i] - 0.5) * (u[0][i - 1] - 0.5) : 0.0;
            across += run > 0 ? (u[0][i] - 0.5) * (u[0][i - EACH] - 0.5) : 0.0;
        }
        bst_json_free(json);
    }
    /* 5 standard errors of products of two independent uniform deviates of variance 1/12 */
    bst_assert_close(product / (2.0 * RUNS), 0.0, 5.0 / 12.0 / sqrt(2.0 * RUNS));
    bst_assert_close(across / (double)ALL, 0.0, 5.0 / 12.0 / sqrt((double)ALL));
    for (int k = 0; k < 3; k++) {
        double d = distance(u[k], ALL);
        if (!(d < kolmogorov_limit)) {
            fail_msg("law %d: %g above %g", k, d, kolmogorov_limit);
        }
        for (int i = 1; i < ALL; i++) {
            assert_true(u[k][i] > u[k][i - 1]);
        }
        free(u[k]);
    }
    bst_study_close(&s);
}

static char *text_of(const bst_study *s, int64_t run) {
    bst_json *json = scenario_of(s, run);
    char *text = cJSON_PrintUnformatted(objects_of(json));
    bst_json_free(json);
    return text;
}

/* The same study gives the same objects; the seed, the run and the name give others; neither
 * another population nor a further dispersion nor a greater number changes the first objects. */
static void test_reproducible(void **state) {
    (void)state;
    const char *body =
        "\"seed\": \"0x%d\", \"replicates\": 2, \"random\": \"common\", \"sweeps\": [{\"axes\": "
        "[{\"path\": \"/populations/0/number/count\", \"values\": [%d, 3]}]}], \"populations\": "
        "[{\"name\": \"%s\", \"object\": {\"orbit\": {\"at_s\": 0, \"r\": 0}}, \"dispersions\": "
        "[%s{\"path\": \"/orbit/at_s\", \"from\": 0, \"to\": 1}]}%s]";
    const char *more = "{\"path\": \"/orbit/r\", \"from\": 0, \"to\": 1}, ";
    const char *second =
        ", {\"name\": \"u\", \"number\": {\"count\": 0}, \"object\": {\"orbit\": {}}}";
    struct {
        int seed, count;
        const char *name, *extra, *other;
        bool alike;
    } cases[] = {{1, 2, "t", "", "", true},       {1, 2, "t", "", second, true},
                 {2, 2, "t", "", "", false},      {1, 2, "v", "", "", false},
                 {1, 2, "t", more, second, true}, {1, 3, "t", "", "", true}};
    double first[2] = {0.0, 0.0};
    for (size_t c = 0; c < sizeof cases / sizeof *cases; c++) {
        char text[1024];
        bst_study s;
        snprintf(text, sizeof text, body, cases[c].seed, cases[c].count, cases[c].name,
                 cases[c].extra, cases[c].other);
        open_study(text, &s);
        assert_int_equal(s.runs, 4);
        for (int k = 0; k < 2; k++) {
            double at[4];
            for (int run = 0; run < 4; run++) {
                bst_json *json = scenario_of(&s, run);
                const cJSON *list = objects_of(json);
                assert_int_equal(cJSON_GetArraySize(list), run < 2 ? cases[c].count : 3);
                const cJSON *orbit = cJSON_GetObjectItem(cJSON_GetArrayItem(list, k), "orbit");
                at[run] = cJSON_GetObjectItem(orbit, "at_s")->valuedouble;
                bst_json_free(json);
            }
            /* common random numbers: the replicates of both settings */
            assert_true(at[0] == at[2] && at[1] == at[3] && at[0] != at[1]);
            first[k] = c == 0 ? at[0] : first[k];
            assert_int_equal(at[0] == first[k], cases[c].alike);
        }
        char *once = text_of(&s, 3), *again = text_of(&s, 3);
        assert_string_equal(once, again);
        free(once);
        free(again);
        bst_study_close(&s);
    }
}

/* Checksums of lines are not the study's to judge: bst_elements_load does. */
static void write_sets(int count) {
    char text[4000] = "";
    size_t n = 0;
    for (int i = 0; i < count; i++) {
        /* CCSDS OMM as CSV */
        n += (size_t)snprintf(
            text + n, sizeof text - n, "%s%d,2022-06-16T00:00:00,15,0.001,50,0,0,0,0\n",
            i == 0 ? "NORAD_CAT_ID,EPOCH,MEAN_MOTION,ECCENTRICITY,INCLINATION,RA_OF_ASC_NODE,"
                     "ARG_OF_PERICENTER,MEAN_ANOMALY,BSTAR\n"
                   : "",
            100 + i);
    }
    fixture_write(folder, "sets.csv", text);
}

/* Satellites of a file: each as often as the others, none twice in a run, none that the scenario
 * or another population has. */
static void test_satellites(void **state) {
    (void)state;
    enum { RUNS = 3000, SATELLITES = 12 };
    bst_study s, again;
    bst_ctx ctx = {0};
    write_sets(SATELLITES);
    fixture_write(
        folder, "scenario.json",
        "{\"name\": \"base\", \"world\": {\"objects\": [{\"name\": \"x\", \"orbit\": "
        "{\"norad\": 103}}]}, \"observers\": [{\"orbit\": {\"tle_line1\": \"1 00107U\"}}]}");
    open_study(
        "\"replicates\": 3000, \"populations\": [{\"name\": \"a\", \"number\": {\"count\": 4}, "
        "\"elements_file\": \"sets.csv\"}, {\"name\": \"b\", \"number\": {\"count\": 6}, "
        "\"elements_file\": \"sets.csv\", \"object\": {\"area_m2\": 1}, \"dispersions\": "
        "[{\"path\": "
        "\"/area_m2\", \"from\": 1, \"to\": 2}]}]",
        &s);
    double seen[SATELLITES] = {0.0}, together[SATELLITES] = {0.0}, chi2 = 0.0;
    for (int64_t run = 0; run < RUNS; run++) {
        bst_json *json = scenario_of(&s, run);
        const cJSON *list = objects_of(json);
        bool there[SATELLITES] = {false};
        assert_int_equal(cJSON_GetArraySize(list), 11);
        int first = 0;
        for (int k = 0; k < 11; k++) {
            const cJSON *orbit = cJSON_GetObjectItem(cJSON_GetArrayItem(list, k), "orbit");
            int i = cJSON_GetObjectItem(orbit, "norad")->valueint - 100;
            assert_in_range(i, 0, SATELLITES - 1);
            assert_false(there[i]);
            there[i] = true;
            first = k == 1 ? i : first;
            seen[i] += k == 1;
            together[i] += k == 2 && first == 0;
        }
        assert_true(there[3] && !there[7]);
        bst_json_free(json);
    }
    for (int i = 0; i < SATELLITES; i++) {
        bool never = i == 3 || i == 7;
        double p = never ? 0.0 : RUNS / 10.0;
        chi2 += never ? 0.0 : pow(seen[i] - p, 2) / p;
        assert_true(!never || seen[i] == 0.0);
        assert_true(i != 0 || together[i] == 0.0);
    }
    assert_chi_square(chi2, 9.0);
    /* the resolved study has the file's full path, and is the same study */
    char path[512];
    cJSON *echo = bst_study_echo(&s);
    char *text = cJSON_Print(echo);
    fixture_write(folder, "resolved.json", text);
    snprintf(path, sizeof path, "%s/resolved.json", folder);
    bst_assert_ok(&ctx, bst_study_open(&ctx, path, NULL, &again));
    assert_string_equal(again.digest, s.digest);
    char *a = text_of(&s, 17), *b = text_of(&again, 17);
    assert_string_equal(a, b);
    free(a);
    free(b);
    free(text);
    cJSON_Delete(echo);
    bst_study_close(&again);
    /* other satellites in the file: another study */
    char digest[20];
    strcpy(digest, s.digest);
    bst_study_close(&s);
    write_sets(SATELLITES + 1);
    bst_assert_ok(&ctx, bst_study_open(&ctx, path, NULL, &again));
    assert_string_not_equal(again.digest, digest);
    bst_study_close(&again);
}

/* A kind that refuses a great area and more than seven objects. */
static bst_status check_run(bst_ctx *ctx, void *user, const bst_study_run *run, bool deep) {
    (void)user;
    (void)deep;
    const cJSON *list = objects_of(run->scenario);
    if (cJSON_GetArraySize(list) > 7) {
        return bst_fail(ctx, BST_ERR_CONFIG, "too many objects");
    }
    for (const cJSON *o = list ? list->child : NULL; o; o = o->next) {
        const cJSON *area = cJSON_GetObjectItem(o, "area_m2");
        if (area && area->valuedouble > 9.999) {
            return bst_fail(ctx, BST_ERR_CONFIG, "too great an area");
        }
    }
    return BST_OK;
}

#define NUMBER(text) \
    "\"populations\": [{\"name\": \"t\", \"object\": {\"orbit\": {}}, \"number\": " text "}]"
#define AREA(to)                                                                                   \
    "\"populations\": [{\"name\": \"t\", \"number\": {\"count\": 0}, \"object\": {\"orbit\": {}, " \
    "\"area_m2\": 1}, \"dispersions\": [{\"path\": \"/area_m2\", \"from\": 1, \"to\": " to "}]}]"

/* Ends of ranges are tried before anything runs, with the least and the greatest number. */
static void test_check(void **state) {
    (void)state;
    const bst_study_kind kind = {.name = "loop", .check = check_run};
    static const char *const cases[][2] = {
        {NUMBER("{\"distribution\": \"uniform\", \"to\": 7}"), ""},
        {NUMBER("{\"distribution\": \"uniform\", \"to\": 8}"), "/populations/0: value 8 of t: too"},
        {NUMBER("{\"distribution\": \"poisson\", \"mean\": 0.001, \"max\": 8}"),
         "/populations/0: value 8 of t: too many objects"},
        {NUMBER("{\"count\": 8}"), "too many objects"},
        {AREA("9"), ""},
        {AREA("10"), "/populations/0/dispersions/0: value 10 of /area_m2: too great an area"}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        bst_ctx ctx = {0};
        bst_study s;
        open_study(cases[i][0], &s);
        bst_status status = bst_study_check(&ctx, &s, &kind);
        assert_int_equal(status == BST_OK, !*cases[i][1]);
        if (!strstr(ctx.message, cases[i][1])) {
            fail_msg("\"%s\" is not in: %s", cases[i][1], ctx.message);
        }
        bst_study_close(&s);
    }
}

#define ZEROS_10 "0, 0, 0, 0, 0, 0, 0, 0, 0, 0"
#define ZEROS_50 ZEROS_10 ", " ZEROS_10 ", " ZEROS_10 ", " ZEROS_10 ", " ZEROS_10
#define ZEROS_250 ZEROS_50 ", " ZEROS_50 ", " ZEROS_50 ", " ZEROS_50 ", " ZEROS_50
#define ZEROS_1000 ZEROS_250 ", " ZEROS_250 ", " ZEROS_250 ", " ZEROS_250

static void test_errors(void **state) {
    (void)state;
    static const char *const cases[][2] = {
        {"{\"name\": \"a b\", \"object\": {\"orbit\": {}}}",
         "/populations/0/name: no name of a column (found \"a b\""},
        {"{\"name\": \"run\", \"object\": {\"orbit\": {}}}", "/populations/0/name: in use"},
        {"{\"name\": \"t\"}", "/populations/0: without an orbit"},
        {"{\"name\": \"t\", \"object\": {\"orbit\": {}}, \"elements_file\": \"sets.csv\"}",
         "/populations/0: two orbits"},
        {"{\"name\": \"t\", \"elements_file\": \"none.csv\"}", "/populations/0/elements_file: "},
        {"{\"name\": \"t\", \"object\": 3}", "/populations/0/object: wrong type"},
        {"{\"name\": \"t\", \"object\": {\"orbit\": {}, \"name\": \"x\"}}",
         "/populations/0/object/name: the objects are called t_1"},
        {"{\"name\": \"t\", \"object\": {\"orbit\": {}}, \"number\": {\"distribution\": "
         "\"uniform\", \"from\": 3, \"to\": 2}}",
         "/populations/0/number: from 3 to 2 is no range"},
        {"{\"name\": \"t\", \"object\": {\"orbit\": {}}, \"number\": {\"distribution\": "
         "\"poisson\", \"mean\": 5, \"max\": 4}}",
         "/populations/0/number/max: less than the mean (found 4"},
        {"{\"name\": \"t\", \"object\": {\"orbit\": {}}, \"dispersions\": [{\"path\": \"area\", "
         "\"to\": 1}]}",
         "/populations/0/dispersions/0/path: no JSON pointer (found \"area\"; allowed: a JSON "
         "pointer into the object"},
        {"{\"name\": \"t\", \"object\": {\"orbit\": {}}, \"dispersions\": [{\"path\": \"/a\", "
         "\"to\": 1}, {\"path\": \"/a\", \"to\": 1}]}",
         "/populations/0/dispersions/1/path: \"/a\" is dispersed by /populations/0/dispersions/0"},
        {"{\"name\": \"t\", \"object\": {\"orbit\": {}}, \"dispersions\": [{\"path\": \"/a\", "
         "\"name\": \"b\", \"to\": 1}]}",
         "/populations/0/dispersions/0/name: unknown key"},
        {"{\"name\": \"t\", \"object\": {\"orbit\": {}, \"l\": [" ZEROS_1000
         "]}, \"number\": {\"count\": 10000}}",
         "/populations/0: 10000 objects of 1003 values each (allowed: 8000000 values in all)"},
        {"{\"name\": \"t\", \"object\": {\"orbit\": {}}, \"nummer\": 2}",
         "/populations/0/nummer: unknown key; did you mean \"number\""},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        bst_ctx ctx = {0};
        bst_study s;
        char body[4000];
        snprintf(body, sizeof body, "\"populations\": [%s]", cases[i][0]);
        write_sets(2);
        assert_int_not_equal(fixture_open(&ctx, folder, body, &s), BST_OK);
        if (!strstr(ctx.message, cases[i][1])) {
            fail_msg("\"%s\" is not in: %s", cases[i][1], ctx.message);
        }
    }
}

#define LONG_20 "aaaaaaaaaaaaaaaaaaaa"
#define LONG_100 LONG_20 LONG_20 LONG_20 LONG_20 LONG_20

/* What is wrong with a run is said with its place. */
static void test_run_errors(void **state) {
    (void)state;
    const bst_study_kind kind = {.name = "loop", .check = check_run};
    static const char *const cases[][2] = {
        {"\"populations\": [{\"name\": \"t\", \"number\": {\"count\": 3}, \"elements_file\": "
         "\"sets.csv\"}]",
         "/populations/0/number: 3 objects of the 2 satellites in "},
        {"\"populations\": [{\"name\": \"t\", \"object\": {\"orbit\": {}}, \"dispersions\": "
         "[{\"path\": \"/albedo\", \"to\": 1, \"apply\": \"multiply\"}]}]",
         "/populations/0/dispersions/0: /world/objects/0/albedo has no number"},
        {"\"populations\": [{\"name\": \"t\", \"object\": {\"orbit\": {}}, \"dispersions\": "
         "[{\"path\": \"/b\", \"to\": 1, \"linked_paths\": [\"/" LONG_100 LONG_100 LONG_100 LONG_100
             LONG_100 "\"]}]}]",
         "/populations/0/dispersions/0: a pointer is too long"},
        {"\"sweeps\": [{\"axes\": [{\"path\": \"/populations/0/name\", \"values\": [\"u\"]}]}], "
         "\"populations\": [{\"name\": \"t\", \"object\": {\"orbit\": {}}}]",
         "cannot be varied"},
        {"\"sweeps\": [{\"axes\": [{\"path\": \"/populations/0/number/mean\", \"values\": [1, "
         "-1]}]}], \"populations\": [{\"name\": \"t\", \"object\": {\"orbit\": {}}, \"number\": "
         "{\"distribution\": \"poisson\"}}]",
         "/populations/0/number/mean: out of range (found -1"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        bst_ctx ctx = {0};
        bst_study s;
        write_sets(2);
        open_study(cases[i][0], &s);
        assert_int_not_equal(bst_study_check(&ctx, &s, &kind), BST_OK);
        if (!strstr(ctx.message, cases[i][1])) {
            fail_msg("\"%s\" is not in: %s", cases[i][1], ctx.message);
        }
        bst_study_close(&s);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_numbers, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_great_mean, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_values, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_reproducible, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_satellites, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_check, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_errors, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_run_errors, set_up, tear_down),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
