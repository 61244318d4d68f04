/* Angles of a TDM up to the fit, and what is made of its solution: report, words, ephemeris and
 * mean elements, against Kepler's closed forms. Linked with a wrap of the fit itself. */
#include <cjson/cJSON.h>

#include "boresight/vec.h"
#include "sim/analysis/orbit/orbit_determination.h"
#include "sim/astro/bodies.h"
#include "sim/astro/sgp4_fit.h"
#include "tests/stdout_text.h"
#include "tests/test_support.h"
#include "tracker/orbit/orbit_initial.h"
#include "tracker/orbit/orbit_photocentre.h"

enum { ANGLES = 5 };

#define MU 3.986004418e14 /* m^3/s^2, GM of the Earth; models differ by 1e-9 of it */
#define EPOCH "2022-06-16T22:10:00Z"

/* Times of the angles, in the order of time; the file has the last two first. */
static const double times_s[ANGLES] = {0, 60, 150, 400, 630},
                    ra_deg[ANGLES] = {350, 355.5, 3.25, 20, 41},
                    dec_deg[ANGLES] = {-21, -20, -17.5, -8, 4.5};
#define SIGMA_ARCSEC 1.5

static bst_od_solution solution; /* that the wrapped fit finds */
static bst_od_observation seen[ANGLES];

bst_status __wrap_bst_od_determine(bst_ctx *ctx, const bst_od_observation *observations, int count,
                                   const bst_od_options *options, double *chi2,
                                   bst_od_solution *out, bst_od_report *report);
bst_status __wrap_bst_od_determine(bst_ctx *ctx, const bst_od_observation *observations, int count,
                                   const bst_od_options *options, double *chi2,
                                   bst_od_solution *out, bst_od_report *report) {
    (void)ctx;
    assert_int_equal(count, ANGLES);
    bst_assert_close(options->reject_chi2, 25.0, 0);
    assert_true(options->scale_variance);
    bst_assert_close(options->photocentre_m, 0.5 * 3.0, 0); /* half the radius */
    memcpy(seen, observations, sizeof seen);
    for (int i = 0; i < ANGLES; i++) {
        chi2[i] = 1.0 + i;
    }
    *out = solution;
    *report = (bst_od_report){.method = BST_OD_GAUSS, .first_chi2 = 4.0, .other_chi2 = 100.0};
    return BST_OK;
}

enum { PLACES = 73 };
static bst_sgp4_place fitted[PLACES]; /* by the mean elements */

bst_status __real_bst_sgp4_fit(bst_ctx *ctx, const bst_sgp4_place *places, int count, bst_vec3 r,
                               bst_vec3 v, bst_elements *elements, double *rms_m);
bst_status __wrap_bst_sgp4_fit(bst_ctx *ctx, const bst_sgp4_place *places, int count, bst_vec3 r,
                               bst_vec3 v, bst_elements *elements, double *rms_m);
bst_status __wrap_bst_sgp4_fit(bst_ctx *ctx, const bst_sgp4_place *places, int count, bst_vec3 r,
                               bst_vec3 v, bst_elements *elements, double *rms_m) {
    assert_int_equal(count, PLACES);
    memcpy(fitted, places, sizeof fitted);
    return __real_bst_sgp4_fit(ctx, places, count, r, v, elements, rms_m);
}

/* The observer's circle, inclined by 30 degrees about x. */
static void eye_at(double seconds, bst_vec3 *r, bst_vec3 *v) {
    const double a = 7.0e6, n = sqrt(MU / (a * a * a)), u = 0.4 + n * seconds;
    const double c = cos(30 * BST_DEG_RAD), s = sin(30 * BST_DEG_RAD);
    *r = (bst_vec3){a * cos(u), a * sin(u) * c, a * sin(u) * s};
    *v = (bst_vec3){-a * n * sin(u), a * n * cos(u) * c, a * n * cos(u) * s};
}

static void put_time(FILE *file, double seconds) {
    fprintf(file, "2022-06-16T22:%02d:%02d", 10 + (int)(seconds / 60), (int)fmod(seconds, 60));
}

static void segment(FILE *file, const char *object, int first, int last) {
    fprintf(file,
            "META_START\nTIME_SYSTEM = UTC\nPARTICIPANT_1 = EYE\nPARTICIPANT_2 = %s\nMODE = "
            "SEQUENTIAL\nPATH = 2,1\nANGLE_TYPE = RADEC\nREFERENCE_FRAME = ICRF\nMETA_STOP\n"
            "DATA_START\n",
            object);
    for (int i = first; i <= last; i++) {
        fputs("ANGLE_1 = ", file);
        put_time(file, times_s[i]);
        fprintf(file, " %.9f\nANGLE_2 = ", ra_deg[i]);
        put_time(file, times_s[i]);
        fprintf(file, " %.9f\n", dec_deg[i]);
    }
    fputs("DATA_STOP\n", file);
}

typedef struct fixture {
    char folder[BST_TEST_PATH], tdm[300], eye[300], oem[300], omm[300], report[300];
} fixture;

static FILE *open_file(const char *path, const char *mode) {
    FILE *file = fopen(path, mode);
    assert_non_null(file);
    return file;
}

static int set_up(void **state) {
    fixture *f = test_calloc(1, sizeof *f);
    bst_test_template(f->folder, "orbit");
    assert_non_null(mkdtemp(f->folder));
    char *const paths[] = {f->tdm, f->eye, f->oem, f->omm, f->report};
    for (int i = 0; i < 5; i++) {
        static const char *const names[] = {"in.tdm", "eye.oem", "out.oem", "out.omm", "out.json"};
        snprintf(paths[i], sizeof f->tdm, "%s/%s", f->folder, names[i]);
    }
    FILE *file = open_file(f->tdm, "w");
    fputs("CCSDS_TDM_VERS = 2.0\nCREATION_DATE = 2026-01-02T03:04:05\nORIGINATOR = TEST\n", file);
    segment(file, "OTHER", 0, 3);
    segment(file, "BODY", 3, 4);
    segment(file, "BODY", 0, 2);
    fclose(file);
    file = open_file(f->eye, "w");
    fputs(
        "CCSDS_OEM_VERS = 2.0\nCREATION_DATE = 2022-06-16T00:00:00\nORIGINATOR = TEST\n"
        "META_START\nOBJECT_NAME = EYE\nOBJECT_ID = EYE\nCENTER_NAME = EARTH\nREF_FRAME = GCRF\n"
        "TIME_SYSTEM = UTC\nSTART_TIME = 2022-06-16T22:10:00\nSTOP_TIME = 2022-06-16T22:22:00\n"
        "INTERPOLATION = HERMITE\nINTERPOLATION_DEGREE = 7\nMETA_STOP\n",
        file);
    for (int t = 0; t <= 720; t += 30) {
        bst_vec3 r, v;
        eye_at(t, &r, &v);
        put_time(file, t);
        fprintf(file, " %.9f %.9f %.9f %.12f %.12f %.12f\n", r.x / 1e3, r.y / 1e3, r.z / 1e3,
                v.x / 1e3, v.y / 1e3, v.z / 1e3);
    }
    fclose(file);
    solution = (bst_od_solution){.state = {.time_s = 150.25,
                                           .position_m = {-5.2e6, 3.1e6, 4.4e6},
                                           .velocity_mps = {-4.6e3, -6.1e3, -0.9e3}},
                                 .chi2 = 24.0,
                                 .dof = 4,
                                 .variance_factor = 44.0 / 24.0,
                                 .used = 5,
                                 .rejected = 1,
                                 .rms_rad = 2.25 * BST_ARCSEC_RAD,
                                 .range_m = 1.25e6,
                                 .range_sigma_m = 350.0,
                                 .bend = 0.125};
    for (int i = 0; i < 6; i++) {
        for (int k = 0; k < 6; k++) {
            solution.covariance[i][k] = (i == k ? 100.0 : 1.0) * (i < 3 ? 100.0 : 0.1) *
                                        (k < 3 ? 100.0 : 0.1) * (i == k ? 1 + i : 0.1 * (i + k));
        }
    }
    *state = f;
    return 0;
}

static int tear_down(void **state) {
    char command[BST_TEST_PATH + 16];
    fixture *f = *state;
    snprintf(command, sizeof command, "rm -rf '%s'", f->folder);
    assert_int_equal(system(command), 0);
    test_free(f);
    return 0;
}

static bst_orbit_determination request_of(const fixture *f) {
    return (bst_orbit_determination){.choice = {.angles = {.observer = f->eye}},
                                     .oem = f->oem,
                                     .report = f->report,
                                     .sigma_arcsec = SIGMA_ARCSEC,
                                     .radius_m = 3.0,
                                     .predict_s = 330,
                                     .reject_chi2 = 25,
                                     .forces = BST_ORBIT_FORCES_TWO_BODY};
}

static void read_text(const char *path, char *text, size_t bytes) {
    FILE *file = open_file(path, "r");
    text[fread(text, 1, bytes - 1, file)] = '\0';
    fclose(file);
}

/* Semi-major axis, eccentricity, inclination, node, perigee, mean anomaly (rad). */
static void elements_of(bst_vec3 r, bst_vec3 v, double out[6]) {
    bst_vec3 h = bst_vec3_cross(r, v), node = {-h.y, h.x, 0};
    double distance = bst_vec3_norm(r);
    bst_vec3 e =
        bst_vec3_sub(bst_vec3_scale(bst_vec3_cross(v, h), 1 / MU), bst_vec3_scale(r, 1 / distance));
    out[0] = 1 / (2 / distance - bst_vec3_dot(v, v) / MU);
    out[1] = bst_vec3_norm(e);
    out[2] = acos(h.z / bst_vec3_norm(h));
    out[3] = fmod(atan2(node.y, node.x) + 2 * BST_PI, 2 * BST_PI);
    double perigee = acos(bst_vec3_dot(node, e) / bst_vec3_norm(node) / out[1]);
    out[4] = e.z < 0 ? 2 * BST_PI - perigee : perigee;
    double sine = bst_vec3_dot(r, v) / sqrt(MU * out[0]), cosine = 1 - distance / out[0];
    out[5] = fmod(atan2(sine, cosine) - sine + 2 * BST_PI, 2 * BST_PI);
}

static double number(const cJSON *node, const char *key) {
    const cJSON *item = cJSON_GetObjectItemCaseSensitive(node, key);
    if (!cJSON_IsNumber(item)) {
        fail_msg("no number %s", key);
    }
    return item->valuedouble;
}

static void expect_observations(bool aberrated) {
    bst_ctx ctx = {0};
    bst_time epoch;
    bst_bodies bodies;
    bst_assert_ok(&ctx, bst_time_from_utc(&ctx, EPOCH, &epoch));
    for (int i = 0; i < ANGLES; i++) {
        const bst_od_observation *o = &seen[i];
        bst_vec3 r, v;
        eye_at(times_s[i], &r, &v);
        bst_assert_close(o->observer.time_s, times_s[i], 1e-9);
        /* the file has millimetres, its interpolation errs by less */
        bst_assert_close(bst_vec3_norm(bst_vec3_sub(o->observer.position_m, r)), 0, 0.01);
        bst_assert_close(bst_vec3_norm(bst_vec3_sub(o->observer.velocity_mps, v)), 0, 1e-4);
        bst_bodies_at(bst_time_add(epoch, times_s[i]), &bodies);
        bst_assert_close(
            bst_vec3_norm(bst_vec3_sub(o->observer.earth_bary_mps, bodies.earth_bary_mps)), 0,
            1e-6);
        double ra = ra_deg[i] * BST_DEG_RAD, dec = dec_deg[i] * BST_DEG_RAD;
        bst_vec3 d = {cos(dec) * cos(ra), cos(dec) * sin(ra), sin(dec)};
        if (aberrated) { /* to first order; the second is 1e-8 rad */
            d = bst_vec3_unit(
                bst_vec3_axpy(d, -1.0 / 299792458.0,
                              bst_vec3_add(o->observer.earth_bary_mps, o->observer.velocity_mps)));
        }
        bst_assert_close(bst_vec3_angle(d, o->direction), 0, aberrated ? 2e-8 : 1e-12);
        const double phase = bst_vec3_angle(bodies.sun_m, bst_vec3_scale(o->direction, -1.0));
        bst_assert_close(o->photocentre_factor, bst_od_photocentre_factor(phase), 1e-6);
        bst_assert_close(bst_vec3_angle(o->sun, bodies.sun_m), 0, 1e-6);
        bst_assert_close(bst_vec3_norm(o->sun), 1, 1e-12);
        double variance = SIGMA_ARCSEC * SIGMA_ARCSEC * BST_ARCSEC_RAD * BST_ARCSEC_RAD;
        bst_assert_close(o->cov_11, variance, 1e-9 * variance);
        bst_assert_close(o->cov_22, variance, 1e-9 * variance);
        bst_assert_close(o->cov_12, 0, 0);
    }
}

static void expect_report(const fixture *f, const double elements[6]) {
    static char text[20000];
    static const char *const keys[] = {"semi_major_axis_m", "eccentricity",    "inclination_deg",
                                       "raan_deg",          "arg_perigee_deg", "mean_anomaly_deg"};
    read_text(f->report, text, sizeof text);
    cJSON *root = cJSON_Parse(text);
    assert_non_null(root);
    const cJSON *osculating = cJSON_GetObjectItem(root, "osculating");
    for (int k = 0; k < 6; k++) {
        double value = elements[k] * (k > 1 ? 180 / BST_PI : 1.0);
        bst_assert_close(number(osculating, keys[k]), value, 1e-7 * fabs(value));
    }
    const struct {
        const char *key;
        double value;
    } numbers[] = {{"used", 5},
                   {"rejected", 1},
                   {"arc_s", 630},
                   {"rms_arcsec", 2.25},
                   {"chi2", 24.0 * 24 / 44},
                   {"chi2_stated", 24},
                   {"dof", 4},
                   {"covariance_factor", 44.0 / 24},
                   {"epoch_s", 150.25},
                   {"bend", 0.125},
                   {"radius_m", 3.0},
                   {"range_m", 1.25e6},
                   {"range_sigma_m", 350}};
    for (size_t k = 0; k < sizeof numbers / sizeof *numbers; k++) {
        bst_assert_close(number(root, numbers[k].key), numbers[k].value,
                         1e-9 * fabs(numbers[k].value));
    }
    const double *r = &solution.state.position_m.x, *v = &solution.state.velocity_mps.x;
    for (int i = 0; i < 3; i++) {
        const cJSON *at = cJSON_GetObjectItem(root, "position_gcrf_m"),
                    *moves = cJSON_GetObjectItem(root, "velocity_gcrf_mps");
        bst_assert_close(cJSON_GetArrayItem(at, i)->valuedouble, r[i], 1e-6);
        bst_assert_close(cJSON_GetArrayItem(moves, i)->valuedouble, v[i], 1e-9);
    }
    const cJSON *rows = cJSON_GetObjectItem(root, "covariance_gcrf"),
                *items = cJSON_GetObjectItem(root, "observations");
    for (int i = 0; i < 6; i++) {
        for (int k = 0; k < 6; k++) {
            double c = solution.covariance[i][k];
            bst_assert_close(cJSON_GetArrayItem(cJSON_GetArrayItem(rows, i), k)->valuedouble, c,
                             1e-12 * fabs(c));
        }
    }
    for (int i = 0; i < ANGLES; i++) {
        bst_assert_close(number(cJSON_GetArrayItem(items, i), "chi2"), (1.0 + i) * 24 / 44, 1e-12);
    }
    assert_string_equal(cJSON_GetObjectItem(root, "epoch_utc")->valuestring,
                        "2022-06-16T22:12:30.250000000Z");
    cJSON_Delete(root);
}

/* Rows of the ephemeris: 960 s in steps of 48 s, on the ellipse. */
static void expect_ephemeris(const fixture *f, const double elements[6]) {
    static char text[40000];
    read_text(f->oem, text, sizeof text);
    bst_assert_has(text, "from 5 directions of EYE/TDM over 630 s");
    bst_assert_has(text,
                   "rms of residuals 2.2500 arcsec, chi2/dof 6.0000, covariance multiplied by "
                   "1.8333");
    const char *line = strstr(text, "META_STOP"), *end_of_rows = strstr(text, "COVARIANCE_START");
    assert_true(line && end_of_rows);
    int rows = 0;
    double n = sqrt(MU / (elements[0] * elements[0] * elements[0]));
    while ((line = strchr(line, '\n')) < end_of_rows) {
        int minutes;
        double s, found[6];
        bst_vec3 r, v;
        if (sscanf(++line, "2022-06-16T22:%d:%lf %lf %lf %lf %lf %lf %lf", &minutes, &s, &r.x, &r.y,
                   &r.z, &v.x, &v.y, &v.z) != 8) {
            continue;
        }
        double t = 60 * (minutes - 10) + s;
        bst_assert_close(t, rows * 48.0, 1e-6);
        elements_of(bst_vec3_scale(r, 1e3), bst_vec3_scale(v, 1e3), found);
        for (int k = 0; k < 5; k++) {
            bst_assert_close(found[k], elements[k], 1e-8 * fabs(elements[k]));
        }
        bst_assert_close(remainder(found[5] - elements[5] - n * (t - 150.25), 2 * BST_PI), 0, 1e-8);
        rows++;
    }
    assert_int_equal(rows, 21);
    line = end_of_rows;
    bst_assert_has(line, "EPOCH = 2022-06-16T22:12:30.25");
    line = strchr(strstr(line, "EPOCH = "), '\n');
    for (int i = 0; i < 6; i++) { /* km^2, km^2/s, km^2/s^2 */
        for (int k = 0; k <= i; k++) {
            char *end;
            double value;
            while ((value = strtod(line, &end)), end == line) {
                line = strchr(line + 1, '\n');
                assert_non_null(line);
            }
            line = end;
            bst_assert_close(value, solution.covariance[i][k] * 1e-6,
                             1e-11 * fabs(solution.covariance[i][k] * 1e-6));
        }
    }
}

static void a_solution_of_two_bodies(void **state) {
    fixture *f = *state;
    bst_ctx ctx = {0};
    bst_stdout_text out;
    char text[4000];
    double elements[6];
    bst_orbit_determination q = request_of(f);
    bst_stdout_take(&out);
    bst_status status = bst_orbit_determine(&ctx, &q, f->tdm);
    bst_stdout_give(&out, text, sizeof text);
    bst_assert_ok(&ctx, status);
    expect_observations(false);
    elements_of(solution.state.position_m, solution.state.velocity_mps, elements);
    assert_true(elements[1] > 0.05); /* an ellipse */
    expect_report(f, elements);
    expect_ephemeris(f, elements);
    bst_assert_has(text, "EYE/TDM, track 0 (BODY)\n");
    bst_assert_has(text, "5 used, 1 left out, 0 without");
    bst_assert_has(text, "       630.0 s\n");
    bst_assert_has(text, "2.250 arcsec rms, chi2/dof 6.000\n");
    bst_assert_has(text, "1.833 times");
    bst_assert_has(text, "2022-06-16T22:12:30.250Z");
    /* sigmas of the places 100 sqrt(100 (1, 2, 3)) m, of the rates 0.1 sqrt(100 (4, 5, 6)) m/s */
    bst_assert_has(text, "-5200.000000 3100.000000 4400.000000 km, +- 2.449 km");
    bst_assert_has(text, "-4.600000000 -6.100000000 -0.900000000 km/s, +- 0.003873 km/s");
    bst_assert_has(text, "1250.000 km, +- 0.350 km");
    char shape[100];
    snprintf(shape, sizeof shape, "%.3f km, %.6f, %.4f deg", elements[0] / 1e3, elements[1],
             elements[2] * 180 / BST_PI);
    bst_assert_has(text, shape);
    assert_null(strstr(text, "note"));
}

static void notes_and_aberration(void **state) {
    fixture *f = *state;
    bst_ctx ctx = {0};
    bst_stdout_text out;
    char text[4000];
    bst_orbit_determination q = request_of(f);
    q.aberration = BST_ORBIT_ABERRATION_CONTAINED;
    q.choice.angles.object = "BODY";
    solution.variance_factor = 4.01;
    solution.bend = 0.51;
    bst_stdout_take(&out);
    bst_status status = bst_orbit_determine(&ctx, &q, f->tdm);
    bst_stdout_give(&out, text, sizeof text);
    bst_assert_ok(&ctx, status);
    expect_observations(true);
    bst_assert_has(text, "note: residuals are far above");
    bst_assert_has(text, "note: the arc is short");
    assert_null(strstr(text, "another orbit"));
}

/* An orbit that SGP4 makes has mean elements that give it back. */
static void mean_elements(void **state) {
    fixture *f = *state;
    bst_ctx ctx = {0};
    bst_stdout_text out;
    char text[4000], omm[4000];
    double elements[6];
    bst_orbit_determination q = request_of(f);
    q.forces = BST_ORBIT_FORCES_SGP4;
    q.omm = f->omm;
    q.oem = NULL;
    bst_stdout_take(&out);
    bst_status status = bst_orbit_determine(&ctx, &q, f->tdm);
    bst_stdout_give(&out, text, sizeof text);
    bst_assert_ok(&ctx, status);
    const char *words = strstr(text, "mean elements");
    assert_non_null(words);
    double rms_km = strtod(words + strlen("mean elements"), NULL), mean_motion, inclination_deg;
    assert_true(rms_km < 0.05); /* tens of metres by rounding to an element set's digits */
    read_text(f->omm, omm, sizeof omm);
    bst_assert_has(omm, "2022-06-16T22:12:30.25");
    elements_of(solution.state.position_m, solution.state.velocity_mps, elements);
    const char *at = strstr(omm, "MEAN_MOTION"), *tilt = strstr(omm, "INCLINATION");
    assert_true(at && tilt);
    assert_int_equal(sscanf(at, "MEAN_MOTION%*[^0-9]%lf", &mean_motion), 1);
    assert_int_equal(sscanf(tilt, "INCLINATION%*[^0-9]%lf", &inclination_deg), 1);
    /* J2 makes osculating elements vary by 0.2 % and 0.1 degrees; TEME is off GCRF by 0.3 degrees
     */
    double n = sqrt(MU / (elements[0] * elements[0] * elements[0])) * 86400 / 2 / BST_PI;
    bst_assert_close(mean_motion, n, 0.005 * n);
    bst_assert_close(inclination_deg, elements[2] * 180 / BST_PI, 0.3);
}

/* Distance from the Earth's centre on Kepler's orbit through the solution, seconds later. */
static double distance_at(double seconds) {
    double e[6];
    elements_of(solution.state.position_m, solution.state.velocity_mps, e);
    double mean = e[5] + sqrt(MU / (e[0] * e[0] * e[0])) * seconds, eccentric = mean;
    for (int i = 0; i < 50; i++) {
        eccentric = mean + e[1] * sin(eccentric);
    }
    return e[0] * (1.0 - e[1] * cos(eccentric));
}

/* Mean elements are fitted to a revolution about the epoch, or to the arc if that reaches farther
 * to either side: of angles from 0 to 630 s. */
static void arc_of_mean_elements(void **state) {
    fixture *f = *state;
    static const double epochs_s[] = {150.25, -4400.25, 5000.25};
    for (int k = 0; k < 3; k++) {
        bst_ctx ctx = {0};
        bst_stdout_text out;
        char text[4000];
        double e[6];
        bst_orbit_determination q = request_of(f);
        q.omm = f->omm;
        q.oem = NULL;
        solution.state.time_s = epochs_s[k];
        elements_of(solution.state.position_m, solution.state.velocity_mps, e);
        double half = BST_PI * sqrt(e[0] * e[0] * e[0] / MU);
        half = k == 0 ? half : k == 1 ? 630 + 4400.25 : 5000.25;
        bst_stdout_take(&out);
        bst_status status = bst_orbit_determine(&ctx, &q, f->tdm);
        bst_stdout_give(&out, text, sizeof text);
        bst_assert_ok(&ctx, status);
        for (int i = 0; i < PLACES; i++) {
            double seconds = half * (i - PLACES / 2) / (PLACES / 2);
            /* constants of the Earth: 1e-9; the path is integrated */
            bst_assert_close(60.0 * fitted[i].minutes, seconds, 1e-6 * half);
            bst_assert_close(bst_vec3_norm(fitted[i].position_teme_m), distance_at(seconds), 1.0);
        }
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(a_solution_of_two_bodies, set_up, tear_down),
        cmocka_unit_test_setup_teardown(notes_and_aberration, set_up, tear_down),
        cmocka_unit_test_setup_teardown(mean_elements, set_up, tear_down),
        cmocka_unit_test_setup_teardown(arc_of_mean_elements, set_up, tear_down),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
