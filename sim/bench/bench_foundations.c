#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sim/astro/sgp4.h"
#include "sim/bench/bench.h"
#include "sim/catalogue/stars.h"
#include "sim/cli/cli.h"
#include "sim/cli/load.h"
#include "sim/cli/shipped.h"
#include "sim/engine/simulation.h"

enum { SATELLITES = 1000, EPOCHS = 1000 };

/* The states of a set at all epochs; their sum over x. */
static double propagate_set(const bst_sgp4 *set, bst_sgp4_state *states) {
    const bst_sgp4 *sets[EPOCHS];
    double minutes[EPOCHS], sum = 0.0;
    for (int e = 0; e < EPOCHS; e++) {
        sets[e] = set;
        minutes[e] = 7.0 * 1440.0 * e / EPOCHS;
    }
    bst_sgp4_propagate_many(sets, minutes, EPOCHS, states);
    for (int e = 0; e < EPOCHS; e++) {
        sum += states[e].position_teme_km[0];
    }
    return sum;
}

/* The states of all sets at an epoch, one by one; their sum over x. */
static double propagate_epoch(bst_sgp4 *const *sets, double minutes) {
    double sum = 0.0;
    for (int i = 0; i < SATELLITES; i++) {
        double r[3] = {0}, v[3];
        (void)bst_sgp4_propagate(sets[i], minutes, r, v);
        sum += r[0];
    }
    return sum;
}

/* Propagates 1,000 satellites (sets of the file in turn) at 1,000 epochs over the week after their
 * epochs; `sgp4_batch`: all epochs of a satellite in one call. */
bst_status bst_bench_sgp4(bst_ctx *ctx, const bst_bench *self, const bst_bench_options *options,
                          bst_bench_result *out) {
    const bool batch = strcmp(self->name, "sgp4_batch") == 0;
    bst_elements *sets = NULL;
    int count = 0;
    const bst_tle_options tle_options = {.skip_bad_sets = true};
    char file[4096];
    if (options->tle_file) {
        snprintf(file, sizeof file, "%s", options->tle_file);
    } else {
        bst_cli_shipped_file("scenarios/catalogue_2022-06.tle", file, sizeof file);
    }
    BST_TRY(bst_tle_load(ctx, file, &tle_options, &sets, &count));
    bst_sgp4 **models = calloc(SATELLITES, sizeof *models);
    bst_sgp4_state *states = calloc(EPOCHS, sizeof *states);
    bst_status status = models && states && count > 0
                            ? BST_OK
                            : bst_fail(ctx, BST_ERR_MEMORY, "no element sets to measure with");
    for (int i = 0; status == BST_OK && i < SATELLITES; i++) {
        /* evenly spaced over the file */
        int set = (int)((long long)i * count / SATELLITES) % count;
        set = count < SATELLITES ? i % count : set;
        status = bst_sgp4_create(ctx, &sets[set], BST_SGP4_WGS72, BST_SGP4_IMPROVED, &models[i]);
    }
    bst_bench_clock clock = {.count = 0};
    double checksum = 0.0;
    for (int round = 0; status == BST_OK && round < 5; round++) {
        bst_bench_start(&clock);
        for (int i = 0; batch && i < SATELLITES; i++) {
            checksum += propagate_set(models[i], states);
        }
        for (int e = 0; !batch && e < EPOCHS; e++) {
            checksum += propagate_epoch(models, 7.0 * 1440.0 * e / EPOCHS);
        }
        bst_bench_stop(&clock, SATELLITES * EPOCHS);
    }
    if (status == BST_OK && !isfinite(checksum)) {
        status = bst_fail(ctx, BST_ERR_NUMERIC, "an orbit became infinite");
    }
    bst_bench_summarise(&clock, out);
    for (int i = 0; models && i < SATELLITES; i++) {
        bst_sgp4_free(models[i]);
    }
    free(models);
    free(states);
    free(sets);
    return status;
}

/* Cones that contain a 1.5 degree square field, all over the sky, with a warm catalogue. */
bst_status bst_bench_star_cull(bst_ctx *ctx, const bst_bench *self,
                               const bst_bench_options *options, bst_bench_result *out) {
    (void)self;
    (void)options;
    enum { FIELDS = 500, CAPACITY = 65536 };
    bst_stars *stars = NULL;
    BST_TRY(bst_stars_open(ctx, "default", &stars));
    bst_star *found = malloc(CAPACITY * sizeof *found);
    bst_status status = found ? BST_OK : bst_fail(ctx, BST_ERR_MEMORY, "out of memory");
    double radius = 0.75 * sqrt(2.0) * BST_DEG_RAD;
    bst_bench_clock clock = {.count = 0};
    for (int round = 0; status == BST_OK && round < 2; round++) {
        clock.count = 0; /* the first round loads the file */
        for (int i = 0; status == BST_OK && i < FIELDS; i++) {
            /* golden-angle spiral: uniform over the sphere */
            double z = 1.0 - (2.0 * i + 1.0) / FIELDS;
            bst_vec3 centre =
                bst_vec3_from_radec(fmod(2.399963229728653 * i, 2.0 * BST_PI), asin(z));
            int count;
            bst_bench_start(&clock);
            status =
                bst_stars_query(ctx, stars, centre, radius, 99.0, 2022.46, found, CAPACITY, &count);
            bst_bench_stop(&clock, 1);
        }
    }
    bst_bench_summarise(&clock, out);
    free(found);
    bst_stars_close(stars);
    return status;
}

/* Closed loop of the scenario without recording: time per frame of rendering, processing, tracking,
 * control and plant. */
/* Runs a scenario in parts of part_s with `frames` each; the first is warm-up. */
static bst_status run_in_parts(bst_ctx *ctx, const bst_bench_options *options, const char *file,
                               double duration_s, int part_s, int frames, bst_bench_result *out) {
    bst_load_options load = BST_LOAD_DEFAULTS;
    load.duration_s = duration_s;
    bst_json *json = NULL;
    bst_scenario scenario;
    BST_TRY(bst_load_scenario(ctx, file, &load, &json, &scenario));
    bst_simulation *sim = NULL;
    const bst_simulation_options sim_options = {.device = options->device,
                                                .threads = options->threads};
    bst_status status = bst_simulation_create(ctx, &scenario, &sim_options, &sim);
    bst_bench_clock clock = {.count = 0};
    int parts = (int)scenario.duration_s / part_s;
    for (int p = 0; status == BST_OK && p < parts; p++) {
        bst_bench_start(&clock);
        status = bst_engine_run(ctx, bst_simulation_engine(sim),
                                (p + 1) * part_s * scenario.tick_rate_hz);
        bst_bench_stop(&clock, frames);
        if (p == 0) {
            clock.count = 0;
            clock.cpu_total_ms = 0.0;
        }
    }
    bst_bench_summarise(&clock, out);
    bst_simulation_free(sim);
    bst_scenario_free(&scenario);
    bst_json_free(json);
    return status;
}

bst_status bst_bench_loop(bst_ctx *ctx, const bst_bench *self, const bst_bench_options *options,
                          bst_bench_result *out) {
    (void)self;
    return run_in_parts(ctx, options, options->scenario, 60.0, 1, 1, out);
}

bst_status bst_bench_loop_obsgen(bst_ctx *ctx, const bst_bench *self,
                                 const bst_bench_options *options, bst_bench_result *out) {
    (void)self;
    const int hour_s = 3600, frames = 1800;
    char file[4096];
    bst_cli_shipped_file("scenarios/day_generator.json", file, sizeof file);
    return run_in_parts(ctx, options, file, 86400.0, hour_s, frames, out);
}
