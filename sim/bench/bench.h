/* Benchmarks: what each measures and how it reports. */
#ifndef BST_BENCH_BENCH_H
#define BST_BENCH_BENCH_H

#include <cjson/cJSON.h>

#include "boresight/status.h"

enum { BST_BENCH_PHASES = 8 };

/* One line of the report. Members that do not apply are NAN. */
typedef struct bst_bench_result {
    const char *name;
    double frames_per_s;              /* or calls per second */
    double ms_median, ms_min, cpu_ms; /* per frame (or call) */
    double latency_ms;                /* median time from asking for a frame until it is there */
    double error_sigma_max, error_sigma_rms, error_peak_max, flux_error_rel, centroid_error_px;
    double predicted_error_sigma; /* the renderer's own */
    int error_sources; /* how many sources the error was measured on, 0: does not apply */
    double peak_rss_mib;
    double setup_s, ms_max, error_px;
    double error_m;                     /* of a place */
    double detections, detections_lost; /* per frame: reported; more than there was room for */
    struct bst_bench_phase {
        char name[24];
        double ms;
    } phases[BST_BENCH_PHASES]; /* what the time goes into, where that is told */
    int phase_count;
} bst_bench_result;

/* No member applies. */
bst_bench_result bst_bench_nothing(const char *name);

typedef struct bst_bench_options {
    const char *device;   /* selector, NULL: default */
    int threads;          /* 0: all */
    const char *tle_file; /* NULL: each benchmark's own */
    const char *scenario;
} bst_bench_options;

typedef struct bst_bench {
    const char *name, *doc;
    bst_status (*run)(bst_ctx *ctx, const struct bst_bench *self, const bst_bench_options *options,
                      bst_bench_result *out);
} bst_bench;

/* Benchmark: SGP4 propagation (bench_foundations.c). */
bst_status bst_bench_sgp4(bst_ctx *ctx, const bst_bench *self, const bst_bench_options *options,
                          bst_bench_result *out) BST_MUST_CHECK;

/* Benchmark: star queries in 500 fields over the sky, with the catalogue in the page cache
 * (bench_foundations.c). */
bst_status bst_bench_star_cull(bst_ctx *ctx, const bst_bench *self,
                               const bst_bench_options *options,
                               bst_bench_result *out) BST_MUST_CHECK;
/* Objects by the thousand (bench_ephemeris.c). */
bst_status bst_bench_ephemeris(bst_ctx *ctx, const bst_bench *self,
                               const bst_bench_options *options,
                               bst_bench_result *out) BST_MUST_CHECK;
/* A day of a numerical low orbit with all forces, its error against a tolerance a hundred times
 * finer (bench_orbits.c). */
bst_status bst_bench_numerical(bst_ctx *ctx, const bst_bench *self,
                               const bst_bench_options *options,
                               bst_bench_result *out) BST_MUST_CHECK;
/* Rendering scenes, by self->name (bench_scenes.c). */
bst_status bst_bench_scene_run(bst_ctx *ctx, const bst_bench *self,
                               const bst_bench_options *options,
                               bst_bench_result *out) BST_MUST_CHECK;
/* Image processing on the frames of the scene whose name follows "imgproc_" (bench_imgproc.c). */
bst_status bst_bench_imgproc(bst_ctx *ctx, const bst_bench *self, const bst_bench_options *options,
                             bst_bench_result *out) BST_MUST_CHECK;
/* Stacks of 16 frames of 2048 x 2048 pixels: per frame (bench_stack.c). */
bst_status bst_bench_stack(bst_ctx *ctx, const bst_bench *self, const bst_bench_options *options,
                           bst_bench_result *out) BST_MUST_CHECK;
/* First frame of fresh processes, from their start until its pixels are mapped, kernels in the
 * cache (cold_start.c). */
bst_status bst_bench_cold_start(bst_ctx *ctx, const bst_bench *self,
                                const bst_bench_options *options,
                                bst_bench_result *out) BST_MUST_CHECK;
/* A study of 100,000 runs without anything to simulate: per run (bench_study.c). */
bst_status bst_bench_study(bst_ctx *ctx, const bst_bench *self, const bst_bench_options *options,
                           bst_bench_result *out) BST_MUST_CHECK;
/* What such a process does: prints when each step was done, seconds of the monotonic clock. */
bst_status bst_bench_first_frame(bst_ctx *ctx, const bst_bench_options *options) BST_MUST_CHECK;
/* The closed loop (bench_foundations.c). */
bst_status bst_bench_loop(bst_ctx *ctx, const bst_bench *self, const bst_bench_options *options,
                          bst_bench_result *out) BST_MUST_CHECK;
/* A day of it with the observation generator, hour by hour: a frame every 2 s, plant and control at
 * 100 Hz (scenarios/day_generator.json). */
bst_status bst_bench_loop_obsgen(bst_ctx *ctx, const bst_bench *self,
                                 const bst_bench_options *options,
                                 bst_bench_result *out) BST_MUST_CHECK;

/* Benchmark: steps of the second-order mount at 1 kHz (bench_plant.c). */
bst_status bst_bench_plant_second_order(bst_ctx *ctx, const bst_bench *self,
                                        const bst_bench_options *options,
                                        bst_bench_result *out) BST_MUST_CHECK;

/* Benchmark: steps of the full mount on a drifting platform at 1 kHz (bench_plant.c). */
bst_status bst_bench_plant_full(bst_ctx *ctx, const bst_bench *self,
                                const bst_bench_options *options,
                                bst_bench_result *out) BST_MUST_CHECK;

/* Benchmark: steps of a spacecraft (bench_spacecraft.c). */
bst_status bst_bench_plant_spacecraft(bst_ctx *ctx, const bst_bench *self,
                                      const bst_bench_options *options,
                                      bst_bench_result *out) BST_MUST_CHECK;

/* Benchmark: steps of a full mount on a spacecraft, with the reaction between them
 * (bench_spacecraft.c). */
bst_status bst_bench_plant_all(bst_ctx *ctx, const bst_bench *self,
                               const bst_bench_options *options,
                               bst_bench_result *out) BST_MUST_CHECK;

/* Whole runs of an open-loop scenario, frames recorded, with and without --serial, in processes of
 * their own: per frame, start and end taken off (bench_open_loop.c). */
bst_status bst_bench_open_loop(bst_ctx *ctx, const bst_bench *self,
                               const bst_bench_options *options,
                               bst_bench_result *out) BST_MUST_CHECK;

/* Round trips of a frame of 2048 x 2048 pixels to a peer in a process of its own, which looks at
 * every pixel and answers with a pointing, over what self->name says (bench_link.c). */
bst_status bst_bench_link(bst_ctx *ctx, const bst_bench *self, const bst_bench_options *options,
                          bst_bench_result *out) BST_MUST_CHECK;

/* Times of repeated calls. */
enum { BST_BENCH_TIMES = 4096 };
typedef struct bst_bench_clock {
    double ms[BST_BENCH_TIMES];
    int count;
    double started_ms, cpu_started_ms, cpu_total_ms;
} bst_bench_clock;

/* Starts an interval: stores wall time and processor time. */
void bst_bench_start(bst_bench_clock *clock);
/* Ends what bst_bench_start began; the time is divided by `calls`. */
void bst_bench_stop(bst_bench_clock *clock, int calls);
/* Median of times[count], which it sorts. */
double bst_bench_median(double *times, int count);
/* Fills the time members of a result but latency_ms. */
void bst_bench_summarise(bst_bench_clock *clock, bst_bench_result *out);
double bst_bench_wall_s(void); /* monotonic */

/* Most memory of this process so far. */
double bst_bench_peak_rss_mib(void);

/* What runs in a process of its own, so that its memory is its own: fills out[0 .. bytes - 1]. */
typedef bst_status (*bst_bench_task)(bst_ctx *ctx, void *user, void *out);
/* The status and message are those of the task; `out` is plain data. To be called
 * before this process has opened a device: drivers do not survive a fork. */
bst_status bst_bench_apart(bst_ctx *ctx, bst_bench_task task, void *user, void *out,
                           size_t bytes) BST_MUST_CHECK;

/* OpenCL device that the options choose. */
typedef struct bst_bench_device {
    char description[256], driver[128];
    int threads; /* compute units */
} bst_bench_device;

/* Describes the OpenCL device that the options choose; opens it in a child process.
 *
 * Errors:    those of opening a device and of bst_bench_apart */
bst_status bst_bench_describe_device(bst_ctx *ctx, const bst_bench_options *options,
                                     bst_bench_device *out) BST_MUST_CHECK;
/* Processor, cores, memory, system, compiler, driver, version, revision and date. */
cJSON *bst_bench_machine(const bst_bench_device *device);
/* One object of the list of results, with the keys of the report. */
cJSON *bst_bench_result_json(const bst_bench_result *result, const bst_bench_device *device);

/* Sweeps of fidelity and of size, and the report on them: folder/speed_error.md with its pictures
 * in folder/images; `scene` NULL: those of the report. */
bst_status bst_bench_curve(bst_ctx *ctx, const bst_bench_options *options, const char *scene,
                           const char *folder) BST_MUST_CHECK;

#endif
