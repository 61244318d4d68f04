/* Scenes of close objects as detections, not images: formations, crossings, clutter, dropped and
 * dim detections. Positions are in px of 3 arcsec on the tangent plane at CLOSE_CENTRE. Two objects
 * closer than CLOSE_RESOLUTION_PX give one detection at the centre of their light. */
#ifndef BST_TESTS_CLOSE_SCENES_H
#define BST_TESTS_CLOSE_SCENES_H

#include <stdlib.h>

#include "boresight/rng.h"
#include "tests/test_support.h"
#include "tracker/mtt/multitarget.h"

#define CLOSE_FRAMES 60
#define CLOSE_OBJECTS 24
#define CLOSE_DETECTIONS 256
#define CLOSE_FIELD_PX 512.0
/* pairs of equal brightness at rest are separated from 3.5 px on, FWHM 2 px */
#define CLOSE_RESOLUTION_PX 3.5
#define CLOSE_PIXEL_RAD (3.0 * BST_ARCSEC_RAD)
/* and never in frames of bad resolution (kind `half_resolved`) */
#define CLOSE_BLENDED_PX 5.0
/* detection threshold, SNR */
#define CLOSE_THRESHOLD 5.0

/* Parameters as of the tracker's default configuration at 3 arcsec a pixel. */
static inline bst_mtt_params close_parameters(bst_mtt_association association) {
    return (bst_mtt_params){.max_tracks = 256,
                            .max_detections = CLOSE_DETECTIONS,
                            .association = association,
                            .noise_rad2ps3 = pow(0.02 * BST_ARCSEC_RAD, 2),
                            .steady_noise_rad2ps3 = pow(0.002 * BST_ARCSEC_RAD, 2),
                            .manoeuvre_noise_rad2ps3 = pow(3 * BST_ARCSEC_RAD, 2),
                            .quiescent_sojourn_s = 3600,
                            .manoeuvre_sojourn_s = 60,
                            .gate_chi2 = 16,
                            .detection_probability = 0.9,
                            .false_alarms_per_frame = 1,
                            .field_sr = pow(CLOSE_FIELD_PX * CLOSE_PIXEL_RAD, 2),
                            .pixel_rad = CLOSE_PIXEL_RAD,
                            .confirm_hits = 3,
                            .confirm_frames = 5,
                            .confirm_score = 12,
                            .max_rate_radps = 120 * BST_ARCSEC_RAD,
                            .initiation_gap_s = 5,
                            .max_misses = 12,
                            .max_coast_s = 120,
                            .max_sigma_rad = 60 * BST_ARCSEC_RAD,
                            .merge_rad = 6 * CLOSE_PIXEL_RAD,
                            .merge_floor_rad = 0.3 * CLOSE_PIXEL_RAD,
                            .max_merged_frames = 60,
                            .star_rate_radps = 0.5 * BST_ARCSEC_RAD,
                            .motion_chi2 = 25,
                            .max_stationary_tracks = 4096,
                            .brightness_systematic_mag = 0.2,
                            .brightness_random_walk_mag = 0.05,
                            .event_window = 8,
                            .false_events_per_hour = 0.01,
                            .max_dormant_tracks = 64,
                            .max_dormant_s = 7200,
                            .max_dormant_sigma_rad = BST_DEG_RAD,
                            .dormant_gate_chi2 = 18.5};
}

typedef struct close_kind {
    const char *name;
    int objects;
    double nearest_px, farthest_px;    /* of neighbours in a formation; 0: no formation */
    bool crossing;                     /* objects 2 i and 2 i + 1 cross */
    double snr_low, snr_high, dropped; /* dropped: share beside those below the threshold */
    double false_alarms;               /* mean per frame */
    double blended; /* share of the frames that resolve no pair closer than CLOSE_BLENDED_PX */
} close_kind;

static const close_kind close_kinds[] = {
    {"formation7", 7, 7.0, 12.0, false, 12.0, 30.0, 0.05, 1.0, 0.0},
    {"formation12", 12, 4.0, 15.0, false, 12.0, 30.0, 0.05, 10.0, 0.0},
    {"crossings", 18, 0.0, 0.0, true, 12.0, 30.0, 0.05, 5.0, 0.0},
    {"clutter", 8, 0.0, 0.0, false, 5.0, 8.0, 0.0, 30.0, 0.0},
    {"dropped", 8, 0.0, 0.0, false, 10.0, 20.0, 0.2, 5.0, 0.0},
    {"dim_crossings", 10, 0.0, 0.0, true, 6.0, 8.0, 0.0, 10.0, 0.0},
    {"half_resolved", 2, 3.7, 4.2, false, 12.0, 18.0, 0.1, 1.0, 0.5},
};
#define CLOSE_KINDS ((int)(sizeof close_kinds / sizeof *close_kinds))

typedef struct close_object {
    double x, y, vx, vy; /* px and px/s, at the middle of the scene */
    double snr;
} close_object;

typedef struct close_detection {
    double x, y, sigma, v_mag, snr;
} close_detection;

typedef struct close_scene {
    const close_kind *kind;
    close_object objects[CLOSE_OBJECTS];
    bst_rng_key key;
    uint64_t draw;
    close_detection list[CLOSE_DETECTIONS];
    int count;
} close_scene;

static inline double close_uniform(close_scene *s, double low, double high) {
    return low + (high - low) * bst_rng_uniform(s->key, 0, s->draw++);
}

static inline double close_normal(close_scene *s) {
    return bst_rng_normal(s->key, 1, s->draw++);
}

static inline void close_place(const close_object *o, int frame, double *x, double *y) {
    double t = frame - 0.5 * CLOSE_FRAMES;
    *x = o->x + o->vx * t;
    *y = o->y + o->vy * t;
}

/* Distance of the nearest of the first `count` objects at the middle of the scene, px. */
static inline double close_nearest(const close_scene *s, int count, double x, double y) {
    double nearest = INFINITY;
    for (int i = 0; i < count; i++) {
        nearest = fmin(nearest, hypot(s->objects[i].x - x, s->objects[i].y - y));
    }
    return nearest;
}

/* A connected formation that moves at 5 px/s; its members drift by 0.01 px/s. */
static inline void close_form(close_scene *s) {
    double heading = close_uniform(s, 0.0, (2.0 * BST_PI)), far = s->kind->farthest_px;
    for (int i = 0; i < s->kind->objects; i++) {
        close_object *o = &s->objects[i];
        double nearest = 0.0;
        do {
            const close_object *near = &s->objects[i > 0 ? (int)close_uniform(s, 0.0, i) : 0];
            double centre = 0.5 * CLOSE_FIELD_PX;
            o->x = (i > 0 ? near->x : centre) + close_uniform(s, -far, far);
            o->y = (i > 0 ? near->y : centre) + close_uniform(s, -far, far);
            nearest = close_nearest(s, i, o->x, o->y);
        } while (i > 0 && (nearest < s->kind->nearest_px || nearest > far));
        o->vx = 5.0 * cos(heading) + 0.01 * close_normal(s);
        o->vy = 5.0 * sin(heading) + 0.01 * close_normal(s);
    }
}

/* Pairs on a grid of three columns that pass each other at up to 2 px at 0.3 to 1.5 px/s. */
static inline void close_cross(close_scene *s) {
    for (int i = 0; i + 1 < s->kind->objects; i += 2) {
        close_object *a = &s->objects[i], *b = &s->objects[i + 1];
        double heading = close_uniform(s, 0.0, (2.0 * BST_PI));
        double across = close_uniform(s, 0.0, (2.0 * BST_PI)), miss = close_uniform(s, 0.0, 2.0);
        double rate = close_uniform(s, 0.3, 1.5), late = close_uniform(s, -5.0, 5.0);
        a->x = CLOSE_FIELD_PX * (1 + (i / 2) % 3) / 4.0;
        a->y = CLOSE_FIELD_PX * (1 + (i / 2) / 3) / 4.0;
        a->vx = 2.0 * cos(heading);
        a->vy = 2.0 * sin(heading);
        b->vx = a->vx + rate * cos(across);
        b->vy = a->vy + rate * sin(across);
        b->x = a->x - miss * sin(across) - late * rate * cos(across);
        b->y = a->y + miss * cos(across) - late * rate * sin(across);
    }
}

static inline void close_open(close_scene *s, const close_kind *kind, uint64_t seed) {
    memset(s, 0, sizeof *s);
    s->kind = kind;
    s->key = bst_rng_make_key(seed, 0, "close", kind->name);
    if (kind->farthest_px > 0.0) {
        close_form(s);
    } else if (kind->crossing) {
        close_cross(s);
    }
    for (int i = 0; i < kind->objects; i++) {
        close_object *o = &s->objects[i];
        o->snr = close_uniform(s, kind->snr_low, kind->snr_high);
        if (kind->farthest_px > 0.0 || kind->crossing) {
            continue;
        }
        double heading = close_uniform(s, 0.0, (2.0 * BST_PI)), rate = close_uniform(s, 1.0, 5.0);
        o->x = close_uniform(s, 0.3, 0.7) * CLOSE_FIELD_PX;
        o->y = close_uniform(s, 0.3, 0.7) * CLOSE_FIELD_PX;
        o->vx = rate * cos(heading);
        o->vy = rate * sin(heading);
    }
}

static inline void close_add(close_scene *s, double x, double y, double snr, bool noisy) {
    if (s->count < CLOSE_DETECTIONS) {
        /* centroid error of a Gaussian image of FWHM 2 px: its standard deviation over the SNR */
        double sigma = hypot(2.0 / 2.3548 / snr, 0.02);
        double v = 15.0 - 2.5 * log10(snr / 10.0);
        s->list[s->count++] = (close_detection){
            .x = x + (noisy ? sigma * close_normal(s) : 0.0),
            .y = y + (noisy ? sigma * close_normal(s) : 0.0),
            .sigma = sigma,
            .v_mag = v + (noisy ? 1.0857 / snr * close_normal(s) : 0.0),
            .snr = snr,
        };
    }
}

/* The detections of a frame: groups of unresolved objects, and false alarms. */
static inline void close_expose(close_scene *s, int frame) {
    int n = s->kind->objects, group[CLOSE_OBJECTS];
    double x[CLOSE_OBJECTS], y[CLOSE_OBJECTS];
    bool bad = s->kind->blended > 0.0 && close_uniform(s, 0.0, 1.0) < s->kind->blended;
    double resolution_px = bad ? CLOSE_BLENDED_PX : CLOSE_RESOLUTION_PX;
    s->count = 0;
    for (int i = 0; i < n; i++) {
        close_place(&s->objects[i], frame, &x[i], &y[i]);
        group[i] = i;
    }
    for (int i = 0; i < n; i++) {
        for (int j = 0; j < i; j++) {
            if (hypot(x[i] - x[j], y[i] - y[j]) < resolution_px && group[i] != group[j]) {
                int from = group[i], to = group[j];
                for (int k = 0; k < n; k++) {
                    group[k] = group[k] == from ? to : group[k];
                }
            }
        }
    }
    for (int g = 0; g < n; g++) {
        double light = 0.0, sx = 0.0, sy = 0.0;
        for (int i = 0; i < n; i++) {
            if (group[i] == g) {
                light += s->objects[i].snr;
                sx += s->objects[i].snr * x[i];
                sy += s->objects[i].snr * y[i];
            }
        }
        if (light > 0.0 && light + close_normal(s) > CLOSE_THRESHOLD &&
            close_uniform(s, 0.0, 1.0) >= s->kind->dropped) {
            close_add(s, sx / light, sy / light, light, true);
        }
    }
    double l = exp(-s->kind->false_alarms);
    for (double p = close_uniform(s, 0.0, 1.0); p > l; p *= close_uniform(s, 0.0, 1.0)) {
        double snr = CLOSE_THRESHOLD - 0.5 * log(close_uniform(s, 0.0, 1.0));
        double fx = close_uniform(s, 0.0, CLOSE_FIELD_PX);
        close_add(s, fx, close_uniform(s, 0.0, CLOSE_FIELD_PX), snr, false);
    }
}

static inline bst_vec3 close_direction(double x, double y) {
    bst_vec3 centre = bst_vec3_from_radec(0.7, 0.2);
    bst_tangent axes = bst_tangent_at(centre);
    double half = 0.5 * CLOSE_FIELD_PX;
    return bst_tangent_exp(centre, bst_tangent_vector(&axes, CLOSE_PIXEL_RAD * (x - half),
                                                      CLOSE_PIXEL_RAD * (y - half)));
}

static inline void close_pixel(bst_vec3 direction, double *x, double *y) {
    bst_vec3 centre = bst_vec3_from_radec(0.7, 0.2), to = bst_tangent_log(centre, direction);
    bst_tangent axes = bst_tangent_at(centre);
    *x = 0.5 * CLOSE_FIELD_PX + bst_vec3_dot(to, axes.e1) / CLOSE_PIXEL_RAD;
    *y = 0.5 * CLOSE_FIELD_PX + bst_vec3_dot(to, axes.e2) / CLOSE_PIXEL_RAD;
}

/* The frame's detections for the tracker. */
static inline void close_detections(const close_scene *s, bst_mtt_detection *list) {
    for (int i = 0; i < s->count; i++) {
        const close_detection *d = &s->list[i];
        double variance = pow(d->sigma * CLOSE_PIXEL_RAD, 2);
        list[i] = (bst_mtt_detection){.sky = {.direction = close_direction(d->x, d->y),
                                              .cov_11 = variance,
                                              .cov_22 = variance},
                                      .x_px = d->x,
                                      .y_px = d->y,
                                      .v_mag = d->v_mag,
                                      .v_mag_sigma = 1.0857 / d->snr,
                                      .snr = d->snr,
                                      .length_rad = 2 * CLOSE_PIXEL_RAD,
                                      .width_px = 2};
    }
}

#endif
