/* Benchmark of the tracker on made-up detections: a frame of the main scenario, and a crowd. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "boresight/rng.h"
#include "sim/bench/bench.h"
#include "tracker/mtt/multitarget.h"
#include "tracker/tracker.h"

enum { STARS = 40, MOST_OBJECTS = 200, ROOM = 600, TICKS_PER_S = 1000 };
/* 1 sigma of a centroid, px; detection probability; unscored and scored frames */
static const double SIGMA_PX = 0.1, DETECTION_PROBABILITY = 0.9;
enum { SETTLING_FRAMES = 20, FRAMES = 200 };

/* side of the sensor, px */
enum { SIDE_PX = 1024 };

static const bst_camera camera = {
    .width_px = SIDE_PX, .height_px = SIDE_PX, .pixel_scale_arcsec = 3.0, .psf_fwhm_px = 2.0};

typedef struct scene {
    int objects;
    double false_alarms; /* per frame */
    bst_rng_key key;
    uint64_t draw;
    bst_quat q; /* camera from GCRF; at rest */
    bst_vec3 stars[STARS];
    double place[MOST_OBJECTS][2], rate[MOST_OBJECTS][2]; /* px, px/s */
    bst_tracker *tracker;
    bst_detections *detections;
    bst_tracks *tracks;
    bst_predictions *predictions;
} scene;

static double uniform(scene *s, double low, double high) {
    return low + (high - low) * bst_rng_uniform(s->key, 0, s->draw++);
}

static bool find_star(void *user, uint32_t id, bst_vec3 *icrs) {
    const scene *s = user;
    bool known = id >= 1 && id <= STARS;
    if (known) {
        *icrs = s->stars[id - 1];
    }
    return known;
}

static bst_vec3 direction_of(const scene *s, double x, double y) {
    return bst_quat_rotate(bst_quat_conj(s->q), bst_camera_unproject(&camera, x, y));
}

static void add(scene *s, double x, double y, uint32_t star_id) {
    bst_detections *d = s->detections;
    double n[2];
    bst_rng_normal2(s->key, 1, s->draw++, n);
    if (d->count < ROOM && x > 0.0 && y > 0.0 && x < SIDE_PX && y < SIDE_PX) {
        d->items[d->count++] =
            (bst_detection){.x_px = x + SIGMA_PX * n[0],
                            .y_px = y + SIGMA_PX * n[1],
                            .cov_xx = SIGMA_PX * SIGMA_PX,
                            .cov_yy = SIGMA_PX * SIGMA_PX,
                            .snr = 10.0,
                            .length_px = camera.psf_fwhm_px,
                            .width_px = camera.psf_fwhm_px,
                            .v_mag = 13.0,
                            .v_mag_sigma = 0.1,
                            .star_id = star_id,
                            .label = star_id ? BST_LABEL_STAR : BST_LABEL_OBJECT};
    }
}

/* Makes the detections of second k. */
static void expose(scene *s, int k) {
    bst_detections *d = s->detections;
    *d = (bst_detections){.exposure_id = k + 1,
                          .start_tick = (int64_t)k * TICKS_PER_S,
                          .end_tick = (int64_t)k * TICKS_PER_S + TICKS_PER_S / 2,
                          .q_telemetry_from_gcrf = s->q,
                          .q_cam_from_gcrf = s->q};
    for (int i = 0; i < STARS; i++) {
        double x, y;
        if (bst_camera_project(&camera, bst_quat_rotate(s->q, s->stars[i]), &x, &y)) {
            add(s, x, y, (uint32_t)i + 1);
        }
    }
    for (int i = 0; i < s->objects; i++) {
        for (int a = 0; a < 2; a++) {
            s->place[i][a] += s->rate[i][a];
        }
        if (uniform(s, 0.0, 1.0) < DETECTION_PROBABILITY) {
            add(s, s->place[i][0], s->place[i][1], 0);
        }
    }
    for (double p = uniform(s, 0.0, 1.0), l = exp(-s->false_alarms); p > l;
         p *= uniform(s, 0.0, 1.0)) {
        double x = uniform(s, 0.0, SIDE_PX);
        add(s, x, uniform(s, 0.0, SIDE_PX), 0);
    }
}

/* Adds the squared distances (px) of the tracks to the nearest objects within 3 px. */
static void judge(const scene *s, double *sum, int64_t *count) {
    for (int t = 0; t < s->tracks->count; t++) {
        const bst_track *track = &s->tracks->items[t];
        double x, y, least = 3.0;
        if (track->status == BST_TRACK_TENTATIVE ||
            !bst_camera_project(&camera, bst_quat_rotate(s->q, track->direction_gcrf), &x, &y)) {
            continue;
        }
        for (int i = 0; i < s->objects; i++) {
            least = fmin(least, hypot(x - s->place[i][0], y - s->place[i][1]));
        }
        *sum += least < 3.0 ? least * least : 0.0;
        *count += least < 3.0;
    }
}

static bst_status run(bst_ctx *ctx, scene *s, bst_bench_result *out) {
    const bst_nav_telemetry nav = {.velocity_bary_mps = {0, 0, 0}, .sun_m = {1.5e11, 0, 0}};
    bst_bench_clock clock = {.count = 0};
    double sum = 0.0;
    int64_t judged = 0, detections = 0;
    for (int k = 0; k < SETTLING_FRAMES + FRAMES; k++) {
        expose(s, k);
        const bst_tracker_input input = {.detections = s->detections, .nav = &nav};
        bst_bench_start(&clock);
        bst_tracker_outcome outcome =
            bst_tracker_step(s->tracker, &input, s->tracks, ROOM, s->predictions, ROOM);
        if (outcome != BST_TRACKER_USED) {
            return bst_fail(ctx, BST_ERR_NUMERIC, "the tracker did not use frame %d", k);
        }
        if (k >= SETTLING_FRAMES) {
            bst_bench_stop(&clock, 1);
            judge(s, &sum, &judged);
            detections += s->detections->count;
        }
    }
    bst_bench_summarise(&clock, out);
    out->centroid_error_px = judged > 0 ? sqrt(sum / (double)judged) : NAN;
    out->detections = (double)detections / FRAMES;
    out->detections_lost = 0.0;
    return BST_OK;
}

static bst_status open_scene(bst_ctx *ctx, scene *s, int objects, double false_alarms) {
    bst_tracker_config config;
    *s = (scene){.objects = objects,
                 .false_alarms = false_alarms,
                 .key = bst_rng_make_key(1, 0, "bench", "tracker"),
                 .q = bst_quat_look(bst_vec3_from_radec(0.7, 0.2), (bst_vec3){0, 0, 1})};
    for (int i = 0; i < STARS; i++) {
        double x = uniform(s, 20.0, SIDE_PX - 20.0);
        s->stars[i] = direction_of(s, x, uniform(s, 20.0, SIDE_PX - 20.0));
    }
    for (int i = 0; i < objects; i++) {
        for (int a = 0; a < 2; a++) {
            /* stays in the field: at most 221 px of motion */
            s->place[i][a] = uniform(s, 230.0, SIDE_PX - 230.0);
            s->rate[i][a] = uniform(s, -1.0, 1.0);
        }
    }
    s->detections = calloc(1, sizeof *s->detections + ROOM * sizeof(bst_detection));
    s->tracks = calloc(1, sizeof *s->tracks + ROOM * sizeof(bst_track));
    s->predictions = calloc(1, sizeof *s->predictions + ROOM * sizeof(bst_prediction));
    if (!s->detections || !s->tracks || !s->predictions) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the benchmark of the tracker");
    }
    BST_TRY(bst_config_defaults(ctx, bst_tracker_config_table, &config));
    config.max_tracks = 2 * ROOM;
    config.association = BST_MTT_PMB;
    return bst_tracker_create(ctx, &config, &camera, TICKS_PER_S, find_star, s, &s->tracker);
}

bst_status bst_bench_tracker(bst_ctx *ctx, const bst_bench *self, const bst_bench_options *options,
                             bst_bench_result *out) {
    (void)options;
    bool crowd = strcmp(self->name, "tracker_200") == 0;
    scene *s = calloc(1, sizeof *s);
    if (!s) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the benchmark of the tracker");
    }
    bst_status status = open_scene(ctx, s, crowd ? MOST_OBJECTS : 1, crowd ? MOST_OBJECTS : 1.0);
    if (status == BST_OK) {
        status = run(ctx, s, out);
    }
    bst_tracker_free(s->tracker);
    free(s->detections);
    free(s->tracks);
    free(s->predictions);
    free(s);
    return status;
}
