/* Benchmarks of `boresight bench`: definitions and results. */
#ifndef BST_BENCH_BENCH_H
#define BST_BENCH_BENCH_H

#include <cjson/cJSON.h>

#include "boresight/status.h"

enum { BST_BENCH_PHASES = 8 };

/* One line of the benchmark report. Members that do not apply are NAN. */
typedef struct bst_bench_result {
    const char *name;
    double frames_per_s;              /* or calls per second */
    double ms_median, ms_min, cpu_ms; /* per frame (or call) */
    double latency_ms; /* median time from requesting a frame until it is available */
    double error_sigma_max, error_sigma_rms, error_peak_max, flux_error_rel, centroid_error_px;
    double predicted_error_sigma; /* as the renderer predicts */
    int error_sources; /* number of sources whose error was measured, 0: does not apply */
    double peak_rss_mib;
    double setup_s, ms_max, error_px;
    double error_m;                     /* position error */
    double detections, detections_lost; /* per frame: reported; beyond the capacity */
    struct bst_bench_phase {
        char name[24];
        double ms;
    } phases[BST_BENCH_PHASES]; /* parts of the time, if available */
    int phase_count;
} bst_bench_result;

/* A result in which no member applies. */
bst_bench_result bst_bench_nothing(const char *name);

typedef struct bst_bench_options {
    const char *device;   /* selector, NULL: default */
    int threads;          /* 0: all */
    const char *tle_file; /* NULL: default of each benchmark */
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
/* Benchmark: field queries with thousands of objects (bench_ephemeris.c). */
bst_status bst_bench_ephemeris(bst_ctx *ctx, const bst_bench *self,
                               const bst_bench_options *options,
                               bst_bench_result *out) BST_MUST_CHECK;
/* Benchmark: one day of a numerical low orbit with all forces; error against a tolerance a hundred
 * times finer (bench_orbits.c). */
bst_status bst_bench_numerical(bst_ctx *ctx, const bst_bench *self,
                               const bst_bench_options *options,
                               bst_bench_result *out) BST_MUST_CHECK;
/* Benchmark: frames with the shape of a satellite (bench_resolved.c). */
bst_status bst_bench_resolved(bst_ctx *ctx, const bst_bench *self, const bst_bench_options *options,
                              bst_bench_result *out) BST_MUST_CHECK;

/* Benchmark: rendering of the scene self->name (bench_scenes.c). */
bst_status bst_bench_scene_run(bst_ctx *ctx, const bst_bench *self,
                               const bst_bench_options *options,
                               bst_bench_result *out) BST_MUST_CHECK;
/* Benchmark: image processing on the frames of the scene whose name follows "imgproc_"
 * (bench_imgproc.c). */
bst_status bst_bench_imgproc(bst_ctx *ctx, const bst_bench *self, const bst_bench_options *options,
                             bst_bench_result *out) BST_MUST_CHECK;
/* Benchmark: stacks of 16 frames of 2048 x 2048 pixels, per frame (bench_stack.c). */
bst_status bst_bench_stack(bst_ctx *ctx, const bst_bench *self, const bst_bench_options *options,
                           bst_bench_result *out) BST_MUST_CHECK;
/* Benchmark: the tracker on made-up detections (bench_tracker.c). */
bst_status bst_bench_tracker(bst_ctx *ctx, const bst_bench *self, const bst_bench_options *options,
                             bst_bench_result *out) BST_MUST_CHECK;
/* Benchmark: a light curve of a satellite with a shape, per epoch (bench_lightcurve.c). */
bst_status bst_bench_lightcurve(bst_ctx *ctx, const bst_bench *self,
                                const bst_bench_options *options,
                                bst_bench_result *out) BST_MUST_CHECK;
/* Benchmark: first frame of new processes, from their start until its pixels are mapped, with
 * cached kernels (cold_start.c). */
bst_status bst_bench_cold_start(bst_ctx *ctx, const bst_bench *self,
                                const bst_bench_options *options,
                                bst_bench_result *out) BST_MUST_CHECK;
/* Benchmark: a study of 100,000 runs without simulation, per run (bench_study.c). */
bst_status bst_bench_study(bst_ctx *ctx, const bst_bench *self, const bst_bench_options *options,
                           bst_bench_result *out) BST_MUST_CHECK;
/* Process of the cold-start benchmark: prints the time of each completed step, seconds of the
 * monotonic clock. */
bst_status bst_bench_first_frame(bst_ctx *ctx, const bst_bench_options *options) BST_MUST_CHECK;
/* Benchmark: the closed loop (bench_foundations.c). */
bst_status bst_bench_loop(bst_ctx *ctx, const bst_bench *self, const bst_bench_options *options,
                          bst_bench_result *out) BST_MUST_CHECK;
/* Benchmark: a day of closed loop with the observation generator, hour by hour: a frame every 2 s,
 * plant and control at 100 Hz (scenarios/day_generator.json). */
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

/* Benchmark: complete runs of an open-loop scenario with recording, with and without --serial, in
 * separate processes: per frame, without start and end (bench_open_loop.c). */
bst_status bst_bench_open_loop(bst_ctx *ctx, const bst_bench *self,
                               const bst_bench_options *options,
                               bst_bench_result *out) BST_MUST_CHECK;

/* Benchmark: round trips of a 2048 x 2048 frame to a peer process that reads every pixel and
 * answers with a pointing, over the transport in self->name (bench_link.c). */
bst_status bst_bench_link(bst_ctx *ctx, const bst_bench *self, const bst_bench_options *options,
                          bst_bench_result *out) BST_MUST_CHECK;

/* Benchmark: a second simulation on a model (bench_sims.c). */
bst_status bst_bench_sim_create(bst_ctx *ctx, const bst_bench *self,
                                const bst_bench_options *options,
                                bst_bench_result *out) BST_MUST_CHECK;
/* Benchmark: the clone of a running simulation (bench_sims.c). */
bst_status bst_bench_sim_clone(bst_ctx *ctx, const bst_bench *self,
                               const bst_bench_options *options,
                               bst_bench_result *out) BST_MUST_CHECK;
/* Benchmark: a simulation that the program commands each frame: the least that an environment of
 * Python can cost (bench_envs.c). */
bst_status bst_bench_env(bst_ctx *ctx, const bst_bench *self, const bst_bench_options *options,
                         bst_bench_result *out) BST_MUST_CHECK;
/* Benchmark: 64 of them in threads (bench_envs.c). */
bst_status bst_bench_envs(bst_ctx *ctx, const bst_bench *self, const bst_bench_options *options,
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
/* Ends an interval and stores its times, divided by `calls`. */
void bst_bench_stop(bst_bench_clock *clock, int calls);
/* Median of times[count], which it sorts. */
double bst_bench_median(double *times, int count);
/* Fills the time members of a result except latency_ms. */
void bst_bench_summarise(bst_bench_clock *clock, bst_bench_result *out);
double bst_bench_wall_s(void); /* monotonic */

/* Peak memory (RSS) of this process, MiB. */
double bst_bench_peak_rss_mib(void);

/* A task that runs in a process of its own, to measure its memory; fills out[0 .. bytes - 1]. */
typedef bst_status (*bst_bench_task)(bst_ctx *ctx, void *user, void *out);
/* Runs a task in a child process; returns its status and message. `out`: plain data. Call it before
 * this process opens a device: drivers do not survive a fork. */
bst_status bst_bench_apart(bst_ctx *ctx, bst_bench_task task, void *user, void *out,
                           size_t bytes) BST_MUST_CHECK;

/* OpenCL device selected by the options. */
typedef struct bst_bench_device {
    char description[256], driver[128];
    int threads; /* compute units */
} bst_bench_device;

/* Describes the OpenCL device that the options choose; opens it in a child process.
 *
 * Errors:    those of opening a device and of bst_bench_apart */
bst_status bst_bench_describe_device(bst_ctx *ctx, const bst_bench_options *options,
                                     bst_bench_device *out) BST_MUST_CHECK;
/* Description of the machine as JSON: processor, cores, memory, system, compiler, driver, version,
 * revision and date. */
cJSON *bst_bench_machine(const bst_bench_device *device);
/* A result as JSON object for the report. */
cJSON *bst_bench_result_json(const bst_bench_result *result, const bst_bench_device *device);

/* Measures speed against rendering error and size, and writes folder/speed_error.md with pictures
 * in folder/images; `scene` NULL: all scenes of the report. */
bst_status bst_bench_curve(bst_ctx *ctx, const bst_bench_options *options, const char *scene,
                           const char *folder) BST_MUST_CHECK;

#endif
