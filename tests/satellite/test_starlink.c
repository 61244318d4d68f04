/* Starlink v1.5 against photometry: the laboratory BRDFs and the Pomenis observations of
 * Fankhauser, Tyson and Askari, AJ 166, 59 (2023). The data are not part of the project: the
 * environment variable BORESIGHT_STARLINK_DATA names a folder with chassis_brdf.csv,
 * solar_array_brdf.csv and pomenis_observations.csv of the authors' repository
 * (satellite-optical-brightness, folder data). */
#include "sim/astro/frames.h"
#include "sim/astro/geodesy.h"
#include "tests/satellite/satellite_support.h"

/* Sun in the AB system, V (Willmer, ApJS 236, 47, 2018), at 1 au. */
static const double SUN_AB_MAG = -26.77;
/* and as the authors count it: 1360 W/m^2 of light at 532 nm */
static const double SUN_AB_AUTHORS_MAG = -27.056;

typedef struct observation {
    bst_satellite_light light; /* body frame: z to nadir, x to the Sun's horizontal direction */
    bst_earthlight earth;
    double range_m, ab_mag;
} observation;

typedef struct observations {
    observation *items;
    int count;
} observations;

/* Site of Pomenis: Mount Lemmon. */
static const double SITE_LATITUDE_DEG = 32.4434, SITE_LONGITUDE_DEG = -110.7881,
                    SITE_HEIGHT_M = 2790.0;

/* Geometry of one row: satellite by altitude, azimuth and height above the ellipsoid. */
static void place(bst_ctx *ctx, const bst_astro_eop *eop, const char *utc, const double v[4],
                  observation *out) {
    bst_time t;
    bst_astro_earth_frames frames;
    bst_bodies bodies;
    double site[3], latitude = SITE_LATITUDE_DEG * BST_DEG_RAD,
                    longitude = SITE_LONGITUDE_DEG * BST_DEG_RAD;
    bst_assert_ok(ctx, bst_time_from_utc(ctx, utc, &t));
    bst_assert_ok(ctx, bst_astro_earth_frames_at(ctx, eop, t, &frames));
    bst_bodies_at(t, &bodies);
    bst_assert_ok(ctx, bst_astro_geodetic_to_itrf(ctx, latitude, longitude, SITE_HEIGHT_M, site));
    bst_vec3 east = {-sin(longitude), cos(longitude), 0};
    bst_vec3 up = {cos(latitude) * cos(longitude), cos(latitude) * sin(longitude), sin(latitude)};
    bst_vec3 north = bst_vec3_cross(up, east), at = bst_vec3_from_array(site);
    double h = v[1] * BST_DEG_RAD, a = v[2] * BST_DEG_RAD;
    bst_vec3 way = bst_vec3_scale(up, sin(h));
    way = bst_vec3_axpy(bst_vec3_axpy(way, cos(h) * cos(a), north), cos(h) * sin(a), east);
    double low = 1e5, high = 4e6;
    for (int i = 0; i < 60; i++) {
        double middle = 0.5 * (low + high), latitude_rad, longitude_rad, height_m;
        bst_vec3 p = bst_vec3_axpy(at, middle, way);
        const double itrf[3] = {p.x, p.y, p.z};
        bst_assert_ok(
            ctx, bst_astro_itrf_to_geodetic(ctx, itrf, &latitude_rad, &longitude_rad, &height_m));
        *(height_m < v[0] * 1e3 ? &low : &high) = middle;
    }
    bst_vec3 satellite = bst_vec3_axpy(at, low, way);
    bst_vec3 sun = bst_vec3_unit(bst_mat3_mul_vec(&frames.itrf_from_gcrf, bodies.sun_m));
    const double itrf_m[3] = {satellite.x, satellite.y, satellite.z};
    double lat, lon, height; /* the chassis faces geodetic nadir */
    bst_assert_ok(ctx, bst_astro_itrf_to_geodetic(ctx, itrf_m, &lat, &lon, &height));
    bst_vec3 z = {-cos(lat) * cos(lon), -cos(lat) * sin(lon), -sin(lat)};
    bst_vec3 y = bst_vec3_unit(bst_vec3_cross(z, sun)), x = bst_vec3_cross(y, z);
    bst_mat3 body = {{{x.x, x.y, x.z}, {y.x, y.y, y.z}, {z.x, z.y, z.z}}};
    bst_vec3 to_site = bst_vec3_scale(way, -1.0);
    out->range_m = low;
    out->ab_mag = v[3];
    bst_earth_surface ground = {.diffuse = 0.3, .fineness = BST_EARTHLIGHT_FINEST};
    bst_earthlight_at(&ground, satellite, sun, &out->earth);
    for (int i = 0; i < out->earth.count; i++) {
        out->earth.direction[i] = bst_mat3_mul_vec(&body, out->earth.direction[i]);
    }
    out->earth.centre = bst_mat3_mul_vec(&body, out->earth.centre);
    out->light = (bst_satellite_light){.sun = bst_mat3_mul_vec(&body, sun),
                                       .observer = bst_mat3_mul_vec(&body, to_site),
                                       .sun_radius_rad = 4.65e-3,
                                       .sunlit = 1.0};
}

static observations load(const char *folder) {
    bst_ctx ctx = {0};
    bst_astro_eop *eop;
    char path[1000], line[400];
    observations list = {calloc(2000, sizeof *list.items), 0};
    bst_assert_ok(&ctx, bst_astro_eop_builtin(&ctx, &eop));
    snprintf(path, sizeof path, "%s/pomenis_observations.csv", folder);
    FILE *f = fopen(path, "r");
    assert_non_null(f);
    while (fgets(line, sizeof line, f)) {
        char utc[32];
        double v[4];
        if (sscanf(line, "%19[0-9T:-],%lf,%lf,%lf,%lf", utc, &v[0], &v[1], &v[2], &v[3]) == 5) {
            assert_true(list.count < 2000);
            strcat(utc, "Z");
            place(&ctx, eop, utc, v, &list.items[list.count++]);
        }
    }
    fclose(f);
    bst_astro_eop_free(eop);
    return list;
}

/* Correlation R, the mean of (model - measured)^2 / measured, and the same after one factor on all
 * light that minimises it. */
typedef struct score {
    double r, chi2, fitted_chi2, shift_mag;
} score;

static score judge(const observations *list, const char *shape, double sun_mag, bool earth) {
    bst_test_model m = bst_test_model_open(shape);
    double n = list->count, sx = 0, sy = 0, sxx = 0, syy = 0, sxy = 0, chi2 = 0, up = 0, down = 0;
    for (int i = 0; i < list->count; i++) {
        const observation *o = &list->items[i];
        bst_satellite_light light = o->light;
        light.earthlight = earth ? &o->earth : NULL;
        bst_satellite_aim aim = {light.sun, {0, 0, 1}, light.observer, 0};
        bst_satellite_flux flux;
        bst_satellite_pose_set(m.pose, &aim);
        bst_satellite_flux_at(m.pose, &light, &flux);
        double all = flux.sun[BST_SUNLIGHT_V] + flux.earth[BST_SUNLIGHT_V];
        /* the authors' limit */
        double x = fmin(sun_mag - 2.5 * log10(all / (o->range_m * o->range_m)), 12.5);
        double y = o->ab_mag;
        sx += x, sy += y, sxx += x * x, syy += y * y, sxy += x * y;
        chi2 += (x - y) * (x - y) / y / n;
        up += (x - y) / y / n;
        down += 1.0 / y / n;
    }
    bst_test_model_close(&m);
    return (score){(n * sxy - sx * sy) / sqrt((n * sxx - sx * sx) * (n * syy - sy * sy)), chi2,
                   chi2 - up * up / down, up / down};
}

/* The two plates of the authors, without shadows on each other: 4 km apart. */
#define PLATES(chassis, array)                                                                    \
    "{\"materials\": [{\"name\": \"chassis\", " chassis "}, {\"name\": \"array\", " array         \
    "}, {\"name\": \"dark\"}], \"joints\": [{\"name\": \"fin\", \"follows\": \"sun\", \"axis\": " \
    "[0, 0, 1], \"normal\": [1, 0, 0]}], \"parts\": [{\"name\": \"chassis\", \"kind\": "          \
    "\"plate\", \"size_m\": [1.3, 2.8, 1], \"material\": \"chassis\", \"back_material\": "        \
    "\"dark\"}, {\"name\": \"array\", \"kind\": \"plate\", \"size_m\": [8.1, 2.8, 1], "           \
    "\"position_m\": [0, 0, -4000], \"rotation_deg\": [0, 90, 0], \"joint\": \"fin\", "           \
    "\"material\": \"array\", \"back_material\": \"dark\"}]}"

static void print_score(const char *name, bool earth, score s) {
    printf("%-28s %s earthlight: R %.3f, chi2 %.3f; with one factor (%+.2f mag) %.3f\n", name,
           earth ? "with   " : "without", s.r, s.chi2, -s.shift_mag, s.fitted_chi2);
}

/* Shape of the project's own file, read as text. */
static char *own_shape(void) {
    char *text = calloc(1, 20000);
    FILE *f = fopen("scenarios/satellites/starlink_v1_5.json", "r");
    assert_non_null(f);
    assert_true(fread(text, 1, 19999, f) > 0);
    fclose(f);
    return text;
}

static void agrees_with_pomenis(void **state) {
    (void)state;
    const char *folder = getenv("BORESIGHT_STARLINK_DATA");
    if (!folder || !*folder) {
        printf("skipped: BORESIGHT_STARLINK_DATA names no folder\n");
        skip();
    }
    observations list = load(folder);
    assert_true(list.count > 400);
    char table[3000], *own = own_shape();
    snprintf(table, sizeof table,
             PLATES("\"model\": \"table\", \"table_file\": \"%s/chassis_brdf.csv\"",
                    "\"model\": \"table\", \"table_file\": \"%s/solar_array_brdf.csv\""),
             folder, folder);
    const char *binomial =
        PLATES("\"library\": \"starlink_chassis\"", "\"library\": \"starlink_solar_array\"");
    static const char sphere[] =
        "{\"materials\": [{\"name\": \"w\", \"diffuse\": 0.65}], \"parts\": [{\"name\": \"s\", "
        "\"kind\": \"sphere\", \"radius_m\": 1, \"material\": \"w\"}]}";
    for (int earth = 0; earth < 2; earth++) {
        score round = judge(&list, sphere, SUN_AB_AUTHORS_MAG, earth);
        score plates = judge(&list, binomial, SUN_AB_AUTHORS_MAG, earth);
        score measured = judge(&list, table, SUN_AB_AUTHORS_MAG, earth);
        score ours = judge(&list, own, SUN_AB_MAG, earth);
        print_score("sphere", earth, round);
        print_score("two plates, binomial fit", earth, plates);
        print_score("two plates, measured table", earth, measured);
        print_score("starlink_v1_5.json", earth, ours);
        /* published for all nights: two plates 0.69 and 0.22, sphere 0.47; on half of the nights
         * all models, the sphere too, correlate less by 0.02 to 0.04 */
        assert_true(plates.r > 0.66 && plates.chi2 < 0.30);
        assert_true(measured.r > 0.64);
        assert_true(plates.r > round.r + 0.2);
        /* with the sides of the chassis, whose reflectance is an estimate: of 0.3, 0.5 and 0.8,
         * which give R = 0.71, 0.72 and 0.72 here, the middle one was taken; and with one factor on
         * all */
        assert_true(ours.r > 0.69);
        assert_true(ours.fitted_chi2 < 0.25);
    }
    free(own);
    free(list.items);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(agrees_with_pomenis)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
