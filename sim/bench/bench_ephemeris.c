#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "boresight/rng.h"
#include "sim/astro/sgp4.h"
#include "sim/bench/bench.h"
#include "sim/world/scene/field.h"
#include "sim/world/world_config.h"

/* Field queries without stars: thousands of objects, three observers, one query per second each. */
enum { OBSERVERS = 3, FRAMES = 1000, CHECKED_FRAMES = 20, CHECKED_OBJECTS = 250, RATE = 1000 };

static const char scenario[] =
    "{\"world\": {\"star_catalogue\": \"embedded\", \"catalogues\": [{\"elements_file\": \"%s\"}]},"
    " \"observers\": [%s]}";
static const char observer[] =
    "%s{\"name\": \"%d\", \"orbit\": {\"elements_file\": \"%s\", \"norad\": %d}, \"sensors\": "
    "[{\"camera\": {\"width_px\": 4096, \"height_px\": 4096, \"pixel_scale_arcsec\": 0.5, "
    "\"aperture_m\": 0.15, \"throughput\": 0.7, \"quantum_efficiency\": 0.7, "
    "\"photon_flux_v0_per_s_m2\": 3.6e10, \"dark_current_e_per_s\": 0.5}}]}";

typedef struct scene_config {
    bst_world_config world;
    bst_config_list observers;
} scene_config;

static const bst_config_desc scene_table[] = {
    BST_OBJECT(scene_config, world, bst_world_config_table, "{}", "The world."),
    BST_LIST(scene_config, observers, bst_observer_config, bst_observer_config_table, 1, OBSERVERS,
             NULL, "Observers."),
    BST_CONFIG_END};

/* A population of orbits like the catalogued ones: percentage, ranges of perigee and apogee height
 * (km) and inclination (degrees). */
typedef struct family {
    int percent;
    double perigee_km[2], apogee_km[2], inclination_deg[2], bstar;
} family;

static const family families[] = {
    {45, {520, 580}, {540, 590}, {53, 53.2}, 3e-4},   /* constellations */
    {22, {450, 1000}, {600, 1100}, {97, 100}, 1e-4},  /* Sun-synchronous and others */
    {10, {300, 800}, {800, 1500}, {30, 90}, 2e-4},    /* debris in low orbits */
    {11, {35600, 35900}, {35700, 36000}, {0, 15}, 0}, /* geostationary, drifting */
    {4, {180, 700}, {20000, 36000}, {5, 28}, 5e-5},   /* transfer orbits */
    {3, {500, 2000}, {38000, 39800}, {62, 65}, 1e-5}, /* Molniya */
    {5, {19000, 20300}, {20100, 23300}, {54, 65}, 0}, /* navigation, half-day resonance */
};

static double between(bst_rng_key key, int i, int what, const double range[2]) {
    return range[0] + (range[1] - range[0]) * bst_rng_uniform(key, (uint64_t)i, (uint64_t)what);
}

static bst_elements synthetic_set(int i) {
    bst_rng_key key = bst_rng_make_key(1, 0, "bench", "population");
    int part = (int)(100.0 * bst_rng_uniform(key, (uint64_t)i, 0)), n = 0;
    while (n + 1 < (int)(sizeof families / sizeof *families) && part >= families[n].percent) {
        part -= families[n++].percent;
    }
    const family *f = &families[n];
    double p = between(key, i, 1, f->perigee_km), q = between(key, i, 2, f->apogee_km);
    double low = 6378.1 + fmin(p, q), high = 6378.1 + fmax(p, q), a = 0.5 * (low + high);
    const double turn[2] = {0.0, 2.0 * BST_PI};
    return (bst_elements){.epoch_utc_jd1 = 2459745.5, /* 2022-06-15 */
                          .epoch_utc_jd2 = bst_rng_uniform(key, (uint64_t)i, 3),
                          .bstar = f->bstar,
                          .inclination_rad = between(key, i, 4, f->inclination_deg) * BST_DEG_RAD,
                          .raan_rad = between(key, i, 5, turn),
                          .eccentricity = (high - low) / (high + low),
                          .arg_perigee_rad = between(key, i, 6, turn),
                          .mean_anomaly_rad = between(key, i, 7, turn),
                          .mean_motion_radpmin = 60.0 * sqrt(3.986008e5 / (a * a * a))};
}

/* Terminates a TLE line with its checksum: sum of digits and minus signs. */
static void end_line(FILE *file, char *line) {
    int sum = 0;
    for (const char *c = line; *c; c++) {
        sum += *c >= '0' && *c <= '9' ? *c - '0' : *c == '-';
    }
    fprintf(file, "%s%d\n", line, sum % 10);
}

static void write_set(FILE *file, const bst_elements *s, int number) {
    static const char letters[] = "ABCDEFGHJKLMNPQRSTUVWXYZ";
    char id[8], line[160];
    if (number < 100000) {
        snprintf(id, sizeof id, "%05d", number);
    } else {
        snprintf(id, sizeof id, "%c%04d", letters[(number / 10000 - 10) % 24], number % 10000);
    }
    int year = 1957;
    double day = s->epoch_utc_jd1 - 2435839.5 + s->epoch_utc_jd2; /* since 1957 January 1 */
    for (int days; day >= (days = year % 4 ? 365 : 366); year++) {
        day -= days;
    }
    int exponent = s->bstar > 0.0 ? (int)floor(log10(s->bstar)) + 1 : 0;
    snprintf(line, sizeof line, "1 %sU 22001A   %02d%012.8f  .00000000  00000-0  %05.0f%+d 0  999",
             id, year % 100, 1.0 + day,
             s->bstar > 0.0 ? floor(s->bstar * pow(10.0, 5 - exponent)) : 0.0, exponent);
    if (exponent == 0) {
        memcpy(strstr(line, "+0 0  999"), "-0", 2);
    }
    end_line(file, line);
    double m = fmod(s->mean_anomaly_rad, 2.0 * BST_PI) / BST_DEG_RAD;
    snprintf(line, sizeof line, "2 %s %8.4f %8.4f %07.0f %8.4f %8.4f %11.8f    1", id,
             s->inclination_rad / BST_DEG_RAD, s->raan_rad / BST_DEG_RAD,
             fmin(floor(s->eccentricity * 1e7), 9999999.0), s->arg_perigee_rad / BST_DEG_RAD, m,
             s->mean_motion_radpmin * 1440.0 / (2.0 * BST_PI));
    end_line(file, line);
}

/* Writes `count` element sets: those of the user's file repeated with other mean anomalies, or
 * synthetic ones. */
static bst_status write_sets(bst_ctx *ctx, const bst_bench_options *options, int count,
                             FILE *file) {
    bst_elements *sets = NULL;
    int known = 0;
    if (options->tle_file) {
        const bst_tle_options tle_options = {.skip_bad_sets = true};
        BST_TRY(bst_tle_load(ctx, options->tle_file, &tle_options, &sets, &known));
    }
    for (int i = 0; i < count; i++) {
        bst_elements set = known > 0 ? sets[i % known] : synthetic_set(i);
        set.mean_anomaly_rad += known > 0 ? 2.399963229728653 * (i / known) : 0.0;
        write_set(file, &set, i + 1);
    }
    free(sets);
    return BST_OK;
}

static bst_status make_file(bst_ctx *ctx, const bst_bench_options *options, int count, char *path) {
    int descriptor = mkstemp(path);
    FILE *file = descriptor >= 0 ? fdopen(descriptor, "w") : NULL;
    if (!file) {
        return bst_fail(ctx, BST_ERR_IO, "cannot write element sets to %s", path);
    }
    bst_status status = write_sets(ctx, options, count, file);
    if (fclose(file) != 0 && status == BST_OK) {
        status = bst_fail(ctx, BST_ERR_IO, "cannot write element sets to %s", path);
    }
    return status;
}

/* Creates a world with the sets as objects, three of them as observers; epoch: newest set. */
static bst_status make_world(bst_ctx *ctx, const bst_bench_options *options, const char *path,
                             bst_time epoch, int count, bst_bench_result *out, bst_world **world) {
    char text[4000], observers[3000] = "";
    for (int i = 0; i < OBSERVERS; i++) {
        size_t used = strlen(observers);
        snprintf(observers + used, sizeof observers - used, observer, i ? ", " : "", i, path,
                 1 + i * (count / OBSERVERS));
    }
    snprintf(text, sizeof text, scenario, path, observers);
    bst_json *json = NULL;
    scene_config config = {0};
    BST_TRY(bst_json_parse(ctx, "bench", text, strlen(text), &json));
    bst_status status = bst_config_read(ctx, json, bst_json_root(json), "", scene_table, &config);
    if (status == BST_OK) {
        bst_bench_clock clock = {.count = 0};
        bst_bench_start(&clock);
        status = bst_world_create(ctx, "bench", &config.world, &config.observers, "", epoch, world);
        if (status == BST_OK) {
            status = bst_world_prepare(ctx, *world, options->threads);
        }
        bst_bench_stop(&clock, 1);
        out->setup_s = 1e-3 * clock.ms[0];
        bst_config_free(scene_table, &config);
    }
    bst_json_free(json);
    return status;
}

/* Camera attitude: scans the sky at half a degree per second. */
static bst_quat attitude(int who, double seconds) {
    double ra = 2.0 * who + 0.5 * BST_DEG_RAD * seconds;
    return bst_quat_look(bst_vec3_from_radec(ra, 0.3 * sin(0.1 * ra)), (bst_vec3){0, 0, 1});
}

static bst_status run_frames(bst_ctx *ctx, bst_field *const *fields, bst_bench_clock *clock) {
    const bst_field_options options = {.v_limit = -90.0, .margin_px = 16.0};
    const bst_window window = {0, 0, 4096, 4096};
    double times[2] = {0.0, 0.5};
    for (int f = 0; f < FRAMES; f++) {
        for (int i = 0; i < OBSERVERS; i++) {
            bst_quat q = attitude(i, f);
            const bst_quat attitudes[2] = {q, q};
            const bst_los_track track = {2, times, attitudes};
            bst_truth truth;
            const bst_scene_source *sources;
            int count;
            bst_bench_start(clock);
            BST_TRY(bst_field_query(ctx, fields[i], &track, (int64_t)f * RATE,
                                    (int64_t)f * RATE + RATE / 2, RATE, window, &options, &truth,
                                    &sources, &count));
            bst_bench_stop(clock, 1);
        }
    }
    return BST_OK;
}

/* Largest difference of an object's position from SGP4 at `seconds`, m. */
static bst_status largest_difference(bst_ctx *ctx, const bst_world *world, bst_world_view *view,
                                     const bst_elements *sets, double seconds, double *largest_m) {
    bst_astro_earth_frames frames;
    BST_TRY(bst_world_view_earth_frames(ctx, view, seconds, &frames));
    int objects = bst_world_object_count(world), step = objects / CHECKED_OBJECTS + 1;
    for (int i = 0; i < objects; i += step) {
        const bst_elements *set = &sets[bst_world_object(world, i)->norad - 1];
        bst_time epoch;
        bst_sgp4 *sgp4;
        double r_km[3], v_kmps[3];
        BST_TRY(bst_time_from_utc_jd(ctx, set->epoch_utc_jd1, set->epoch_utc_jd2, &epoch));
        BST_TRY(bst_sgp4_create(ctx, set, BST_SGP4_WGS72, BST_SGP4_IMPROVED, &sgp4));
        double minutes = (bst_time_diff(bst_world_time(world, 0.0), epoch) + seconds) / 60.0;
        bst_sgp4_error error = bst_sgp4_propagate(sgp4, minutes, r_km, v_kmps);
        bst_sgp4_free(sgp4);
        bst_world_state state;
        bst_status status = bst_world_view_object_state(ctx, view, i, seconds, &state);
        if (error != BST_SGP4_OK || status == BST_ERR_NUMERIC) {
            continue; /* decayed */
        }
        BST_TRY(status);
        bst_vec3 direct = bst_mat3_mul_vec(&frames.gcrf_from_teme,
                                           (bst_vec3){1e3 * r_km[0], 1e3 * r_km[1], 1e3 * r_km[2]});
        *largest_m = fmax(*largest_m, bst_vec3_norm(bst_vec3_sub(state.position_m, direct)));
    }
    return BST_OK;
}

/* Largest angular error of object and observer positions, at the shortest range with
 * interpolation. */
static bst_status measure_error(bst_ctx *ctx, const bst_world *world, const bst_elements *sets,
                                bst_bench_result *out) {
    bst_world_view *view;
    BST_TRY(bst_world_view_create(ctx, world, &view));
    double largest_m = 0.0;
    bst_status status = BST_OK;
    for (int k = 0; k < CHECKED_FRAMES && status == BST_OK; k++) {
        status = largest_difference(ctx, world, view, sets, 12345.678 * k, &largest_m);
    }
    out->error_px = 2.0 * largest_m / 1e4 / bst_camera_scale_rad(bst_world_camera(world, 0, 0));
    bst_world_view_free(view);
    return status;
}

static bst_status bench_world(bst_ctx *ctx, const bst_bench_options *options, const char *path,
                              bst_world **world, bst_elements **sets, bst_bench_result *out) {
    int count;
    BST_TRY(bst_tle_load(ctx, path, NULL, sets, &count));
    double newest = 0.0;
    for (int i = 0; i < count; i++) {
        newest = fmax(newest, (*sets)[i].epoch_utc_jd1 + (*sets)[i].epoch_utc_jd2);
    }
    bst_time epoch;
    BST_TRY(bst_time_from_utc_jd(ctx, floor(newest - 0.5) + 0.5, 0.0, &epoch));
    BST_TRY(make_world(ctx, options, path, epoch, count, out, world));
    bst_field *fields[OBSERVERS] = {NULL};
    bst_bench_clock *clock = calloc(1, sizeof *clock);
    bst_status status =
        clock ? BST_OK : bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the times of a bench");
    for (int i = 0; status == BST_OK && i < OBSERVERS; i++) {
        status = bst_field_create(ctx, *world, i, 0, &fields[i]);
    }
    if (status == BST_OK) {
        status = run_frames(ctx, fields, clock);
    }
    if (status == BST_OK) {
        bst_bench_summarise(clock, out);
        out->ms_max = clock->ms[clock->count - 1];
        status = measure_error(ctx, *world, *sets, out);
    }
    for (int i = 0; i < OBSERVERS; i++) {
        bst_field_free(fields[i]);
    }
    free(clock);
    return status;
}

bst_status bst_bench_ephemeris(bst_ctx *ctx, const bst_bench *self,
                               const bst_bench_options *options, bst_bench_result *out) {
    char path[] = "/tmp/boresight-bench-XXXXXX";
    bst_world *world = NULL;
    bst_elements *sets = NULL;
    bst_status status = make_file(ctx, options, strstr(self->name, "30000") ? 30000 : 5000, path);
    if (status == BST_OK) {
        status = bench_world(ctx, options, path, &world, &sets, out);
    }
    unlink(path);
    bst_world_free(world);
    free(sets);
    return status;
}
