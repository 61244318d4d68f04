/* Simulated detections of the main scenario: a target at 50 arcsec/s with 0.02 arcsec/s2 of
 * acceleration, a body that drifts by 5 arcsec/s without telemetry's knowledge, jitter, a cue that
 * is 0.6 degree wrong. */
#ifndef BST_TESTS_MOVING_SKY_H
#define BST_TESTS_MOVING_SKY_H

#include <stdlib.h>

#include "boresight/rng.h"
#include "sim/astro/bodies.h"
#include "sim/core/tangent.h"
#include "tests/test_support.h"
#include "tracker/tracker.h"

#define AS BST_ARCSEC_RAD
#define RATE_HZ 6000
#define STARS 3000
#define ROOM 600
#define NEIGHBOURS 4

static const bst_camera camera = {
    .width_px = 1024, .height_px = 1024, .pixel_scale_arcsec = 3.0, .psf_fwhm_px = 2.0};
/* about the Earth's and a low orbit's velocity; Sun 100 degrees away */
static const bst_nav_telemetry nav = {.velocity_bary_mps = {-21000, 19000, 11000},
                                      .sun_m = {-0.2e11, 1.4e11, 0.3e11}};

typedef struct options {
    double sigma_px, pd, false_alarms, dropped;
    bool dark;                            /* the target sends no light ... */
    double dark_from_s;                   /* ... from then on */
    double burn_s;                        /* time of a rate change of 0.05 arcsec/s; 0: none */
    int neighbours;                       /* objects of other rates */
    double neighbour_rate[NEIGHBOURS][2]; /* arcsec/s, relative to the target's */
    double starless_from_s, starless_to_s;
    int frames;
} options;

typedef struct world {
    bst_vec3 centre, e1, e2;
    bst_vec3 stars[STARS];
    bst_rng_key key;
    uint64_t draw;
    const options *o;
    bst_light light;
    bst_detections *detections;
    bst_tracks *tracks;
    bst_predictions *predictions;
    bst_tracker *tracker;
} world;

static inline double normal(world *w) {
    return bst_rng_normal(w->key, 1, w->draw++);
}

static inline double uniform(world *w) {
    return bst_rng_uniform(w->key, 0, w->draw++);
}

static inline bool find_star(void *user, uint32_t id, bst_vec3 *icrs) {
    const world *w = user;
    if (id == 0 || id > STARS) {
        return false;
    }
    *icrs = w->stars[id - 1];
    return true;
}

/* A point of the sky a1, a2 arcsec from the centre. */
static inline bst_vec3 at(const world *w, double a1, double a2) {
    return bst_vec3_unit(bst_vec3_add(
        w->centre, bst_vec3_add(bst_vec3_scale(w->e1, a1 * AS), bst_vec3_scale(w->e2, a2 * AS))));
}

/* The target's place, arcsec; its burn is not in the cue. */
static inline void target_place(const options *o, double t, bool burn, double out[2]) {
    out[0] = 48.0 * t + 0.01 * t * t;
    out[1] = 14.0 * t - 0.004 * t * t;
    if (burn && o->burn_s > 0.0 && t > o->burn_s) {
        out[1] += 0.05 * (t - o->burn_s);
    }
}

static inline bst_vec3 target_direction(const world *w, double t, bool burn) {
    double p[2];
    target_place(w->o, t, burn, p);
    return at(w, p[0], p[1]);
}

static inline bst_vec3 target_rate(const world *w, double t, bool burn) {
    bst_vec3 d =
        bst_vec3_sub(target_direction(w, t + 0.01, burn), target_direction(w, t - 0.01, burn));
    return bst_tangent_project(target_direction(w, t, burn), bst_vec3_scale(d, 50.0));
}

static inline void world_open(world *w, uint64_t seed, const options *o) {
    bst_ctx ctx = {0};
    memset(w, 0, sizeof *w);
    w->o = o;
    w->key = bst_rng_make_key(seed, 0, "test", "tracker");
    w->centre = bst_vec3_from_radec(359.7 * BST_DEG_RAD, -8.0 * BST_DEG_RAD);
    w->e1 = bst_vec3_unit(bst_vec3_cross((bst_vec3){0, 0, 1}, w->centre));
    w->e2 = bst_vec3_cross(w->centre, w->e1);
    w->light = (bst_light){.velocity_mps = nav.velocity_bary_mps, .sun_m = nav.sun_m};
    for (int i = 0; i < STARS; i++) {
        /* about 40 a field over the sky that the run crosses */
        w->stars[i] = at(w, 36000 * uniform(w) - 4000, 18000 * uniform(w) - 6000);
    }
    w->detections = calloc(1, sizeof *w->detections + ROOM * sizeof(bst_detection));
    w->tracks = calloc(1, sizeof *w->tracks + 256 * sizeof(bst_track));
    w->predictions = calloc(1, sizeof *w->predictions + 256 * sizeof(bst_prediction));
    bst_tracker_config config;
    bst_assert_ok(&ctx, bst_config_defaults(&ctx, bst_tracker_config_table, &config));
    bst_assert_ok(&ctx,
                  bst_tracker_create(&ctx, &config, &camera, RATE_HZ, find_star, w, &w->tracker));
}

static inline void world_close(world *w) {
    bst_tracker_free(w->tracker);
    free(w->detections);
    free(w->tracks);
    free(w->predictions);
}

static inline bool project(bst_quat q, bst_vec3 apparent, double *x, double *y) {
    return bst_camera_project(&camera, bst_quat_rotate(q, apparent), x, y) && *x > 1 && *y > 1 &&
           *x < 1022 && *y < 1022;
}

static inline void detect(world *w, double x, double y, double sigma, uint32_t star_id,
                          double v_mag) {
    bst_detections *d = w->detections;
    if (d->count == ROOM) {
        return;
    }
    d->items[d->count++] = (bst_detection){.x_px = x + sigma * normal(w),
                                           .y_px = y + sigma * normal(w),
                                           .cov_xx = sigma * sigma,
                                           .cov_yy = sigma * sigma,
                                           .flux_e = 1000,
                                           .flux_sigma_e = 50,
                                           .snr = 20,
                                           .v_mag = v_mag + 0.1 * normal(w),
                                           .star_id = star_id,
                                           .label = star_id ? BST_LABEL_STAR : BST_LABEL_OBJECT};
}

/* Fills the detections of frame k; the true camera looks at the target but for the telemetry's
 * error, which a perfect loop is taken to remove. */
static inline bst_quat expose(world *w, int k) {
    const options *o = w->o;
    bst_detections *d = w->detections;
    double t = k;
    *d = (bst_detections){.exposure_id = k,
                          .start_tick = (int64_t)k * RATE_HZ - RATE_HZ / 4,
                          .end_tick = (int64_t)k * RATE_HZ + RATE_HZ / 4};
    bst_vec3 sight = bst_light_aberrate(&w->light, target_direction(w, t, true));
    bst_quat q_true = bst_quat_look(sight, w->e1);
    bst_vec3 deviation = {3 * AS * sin(0.2 * t) + 0.6 * AS * normal(w),
                          3 * AS * cos(0.17 * t) + 0.6 * AS * normal(w), 2 * AS * normal(w)};
    q_true = bst_quat_unit(bst_quat_mul(bst_quat_from_rotvec(deviation), q_true));
    bst_vec3 drift = {3.6 * AS * t, -3.4 * AS * t, 0.5 * AS * t}; /* 5 arcsec/s */
    drift = bst_vec3_add(drift, deviation);
    d->q_telemetry_from_gcrf =
        bst_quat_unit(bst_quat_mul(bst_quat_from_rotvec(bst_vec3_scale(drift, -1.0)), q_true));
    d->q_cam_from_gcrf = d->q_telemetry_from_gcrf;
    double x, y;
    bool starless = t >= o->starless_from_s && t < o->starless_to_s;
    for (uint32_t i = 0; i < STARS && !starless; i++) {
        if (bst_vec3_dot(w->stars[i], sight) < 0.9998) {
            continue; /* 1.1 degrees away */
        }
        if (project(q_true, bst_light_apparent_star(&w->light, w->stars[i]), &x, &y)) {
            bool wrong = uniform(w) < 0.05;
            /* a misidentified star bears a neighbour's name */
            detect(w, x, y, 0.1, wrong ? 1 + (i + 1) % STARS : i + 1, 9.0);
        }
    }
    bool lit = !(o->dark && t >= o->dark_from_s);
    bst_vec3 target = bst_light_aberrate(&w->light, target_direction(w, t, true));
    if (lit && uniform(w) < o->pd && project(q_true, target, &x, &y)) {
        detect(w, x, y, o->sigma_px, 0, 13.0);
    }
    for (int n = 0; n < o->neighbours; n++) {
        double p[2];
        target_place(o, t, false, p);
        double tau = t - 150.0; /* all pass the target within 20 px about then */
        p[0] += o->neighbour_rate[n][0] * tau + 15.0 * (n - 1);
        p[1] += o->neighbour_rate[n][1] * tau + 20.0;
        bst_vec3 apparent = bst_light_aberrate(&w->light, at(w, p[0], p[1]));
        if (uniform(w) < o->pd && project(q_true, apparent, &x, &y)) {
            detect(w, x, y, o->sigma_px, 0, 13.0);
        }
    }
    for (double p = uniform(w), l = exp(-o->false_alarms); p > l; p *= uniform(w)) {
        detect(w, 1023 * uniform(w), 1023 * uniform(w), o->sigma_px, 0, 14.0);
    }
    return q_true;
}

static inline bst_tracker_input make_input(const world *w, double t) {
    /* the cue is the target without its burn, turned by 0.6 degree */
    bst_quat off = bst_quat_from_rotvec(bst_vec3_scale(w->e2, 0.6 * BST_DEG_RAD));
    return (bst_tracker_input){
        .detections = w->detections,
        .nav = &nav,
        .cue = {.valid = true,
                .direction_gcrf = bst_quat_rotate(off, target_direction(w, t, false)),
                .rate_gcrf_radps = bst_quat_rotate(off, target_rate(w, t, false)),
                .sigma_rad = 0.5 * BST_DEG_RAD,
                .rate_sigma_radps = 0.5 * AS,
                .v_mag = 13,
                .v_mag_sigma = 1}};
}

#endif
