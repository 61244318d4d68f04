/* Field query: which sources the swept field holds during one exposure, where they are and how
 * bright. For rendering and for the observation generator. */
#ifndef BST_WORLD_SCENE_FIELD_H
#define BST_WORLD_SCENE_FIELD_H

#include "boresight/messages.h"
#include "sim/world/world.h"

/* Apparent motion of an object during an exposure, at equidistant times from its start to its end.
 * A near object passes along an almost straight line at almost constant speed: its place is what a
 * polynomial follows, its direction is not. What light time and aberration add in direction is
 * first of all the relative velocity over c, which changes little. Any unit of length. */
enum { BST_PATH_NODES = 5 };
typedef struct bst_scene_source_path {
    bst_vec3 place[BST_PATH_NODES]; /* object minus observer at the same instant, GCRF axes */
    bst_vec3 shift[3]; /* at start, middle and end: place + |place| shift has the apparent direction
                        */
} bst_scene_source_path;

/* Brightness through an exposure, where it changes (the edge of the Earth's shadow, a light curve,
 * a near pass): straight between knots. */
enum { BST_RATE_KNOTS = 129 };
typedef struct bst_scene_source_rate {
    int count;                    /* knots, >= 2 */
    double u[BST_RATE_KNOTS];     /* time as a fraction of the exposure, from 0 to 1, ascending */
    double rate[BST_RATE_KNOTS];  /* over the mean of the exposure */
    double light[BST_RATE_KNOTS]; /* share of the exposure's light until then, from 0 to 1 */
} bst_scene_source_rate;

/* A sphere that is large enough to be drawn as what it is, a disc with a terminator. Its parts are
 * shares of the light, together 1. */
typedef struct bst_scene_source_shape {
    double radius;       /* of the sphere, over its distance at mid-exposure; below 1 */
    bst_vec3 sun, earth; /* where light comes from: unit, from the sphere, GCRF */
    double diffuse;      /* sunlight, Lambert's law */
    double specular;     /* sunlight, mirror ball: a point on the disc */
    double earthshine;   /* Lambert's law, as if it all came from its middle */
    double thermal;      /* the same from all of the disc */
} bst_scene_source_shape;

/* A source that may put light on the window. */
typedef struct bst_scene_source {
    int32_t kind; /* bst_source_kind */
    uint32_t id;  /* star: Tycho-2 identity, or statistical (bit 31); object: index in the world */
    bst_vec3 apparent_mid;               /* at mid-exposure, GCRF axes, unit */
    const bst_scene_source_path *path;   /* NULL: at rest; owned by who made the source */
    const bst_scene_source_rate *rate;   /* NULL: constant; owned likewise */
    const bst_scene_source_shape *shape; /* NULL: a point; owned likewise */
    double electrons_per_s;              /* detected, mean of the exposure */
    float colour[BST_PSF_COLOURS];       /* of its light (bst_psf_colour); all 0: the Sun's */
    double v_mag;
    double ra_rad, dec_rad; /* as in bst_truth_item */
    double sunlit_fraction, phase_rad, range_m;
    bool occulted; /* no light */
} bst_scene_source;

/* Place at time u in [0, 1] of the exposure: the quartic through the five. For orbits of radius r
 * and angular rate w about the Earth it misses the path by 1e-3 r (w T / 2)^5: 1 um in LEO for an
 * exposure T of 20 s. */
static inline bst_vec3 bst_scene_source_place(const bst_scene_source_path *p, double u) {
    double a = 4.0 * u, b = a - 1.0, c = a - 2.0, d = a - 3.0, e = a - 4.0;
    const double w[BST_PATH_NODES] = {b * c * d * e / 24.0, -a * c * d * e / 6.0,
                                      a * b * d * e / 4.0, -a * b * c * e / 6.0,
                                      a * b * c * d / 24.0};
    bst_vec3 place = bst_vec3_scale(p->place[0], w[0]);
    for (int k = 1; k < BST_PATH_NODES; k++) {
        place = bst_vec3_axpy(place, w[k], p->place[k]);
    }
    return place;
}

/* The quadratic through the three shifts. */
static inline bst_vec3 bst_scene_source_shift(const bst_scene_source_path *p, double u) {
    double a = 4.0 * u, c = a - 2.0, e = a - 4.0;
    bst_vec3 shift = bst_vec3_scale(p->shift[0], 0.125 * c * e);
    shift = bst_vec3_axpy(shift, -0.25 * a * e, p->shift[1]);
    return bst_vec3_axpy(shift, 0.125 * a * c, p->shift[2]);
}

/* Apparent direction (any length) at time u in [0, 1] of the exposure. */
static inline bst_vec3 bst_scene_source_direction(const bst_scene_source *s, double u) {
    if (!s->path) {
        return s->apparent_mid;
    }
    bst_vec3 place = bst_scene_source_place(s->path, u);
    return bst_vec3_axpy(place, bst_vec3_norm(place), bst_scene_source_shift(s->path, u));
}

/* Share of the exposure's light that comes until time u in [0, 1]: what weighs the places of a
 * source in its image. */
static inline double bst_scene_source_light(const bst_scene_source *s, double u) {
    const bst_scene_source_rate *r = s->rate;
    if (!r) {
        return u;
    }
    int low = 0, high = r->count - 1;
    while (high - low > 1) {
        int middle = (low + high) / 2;
        *(r->u[middle] <= u ? &low : &high) = middle;
    }
    double h = r->u[high] - r->u[low], d = u - r->u[low];
    double slope = h > 0.0 ? (r->rate[high] - r->rate[low]) / h : 0.0;
    return r->light[low] + d * (r->rate[low] + 0.5 * slope * d);
}

/* Rate at time u over the mean of the exposure. */
static inline double bst_scene_source_rate_at(const bst_scene_source *s, double u) {
    const bst_scene_source_rate *r = s->rate;
    if (!r) {
        return 1.0;
    }
    int k = 0;
    while (k + 2 < r->count && r->u[k + 1] < u) {
        k++;
    }
    double h = r->u[k + 1] - r->u[k];
    return r->rate[k] + (h > 0.0 ? (u - r->u[k]) / h : 0.0) * (r->rate[k + 1] - r->rate[k]);
}

/* A path whose direction is the quadratic through three (in apparent_mid's unit), for scenes that
 * are not made of orbits. */
static inline bst_scene_source_path bst_scene_source_path_through(bst_vec3 start, bst_vec3 mid,
                                                                  bst_vec3 end) {
    bst_scene_source_path path = {.place = {{0}}};
    bst_vec3 slope = bst_vec3_sub(end, start);
    bst_vec3 bend = bst_vec3_sub(bst_vec3_add(start, end), bst_vec3_scale(mid, 2.0));
    for (int k = 0; k < BST_PATH_NODES; k++) {
        double h = (k - 2) / (BST_PATH_NODES - 1.0);
        path.place[k] = bst_vec3_axpy(bst_vec3_axpy(mid, h, slope), 2.0 * h * h, bend);
    }
    return path;
}

/* The true attitude during an exposure, cut out of a los_history. */
typedef struct bst_los_track {
    int count; /* samples, >= 2; the first and last are at the exposure's very ends (interpolated)
                */
    const double *time_s;            /* [count] since exposure start, ascending, time_s[0] = 0 */
    const bst_quat *q_cam_from_gcrf; /* [count], neighbouring signs agree */
} bst_los_track;

typedef struct bst_field_options {
    double v_limit;   /* stars fainter than this are left out */
    double margin_px; /* sources this far outside the window still count (PSF wings) */
    double lead_s;    /* rolling shutter: the track begins so long before the exposure (of the
                         window's middle row) and ends as long after it */
} bst_field_options;

typedef struct bst_field
    bst_field; /* work space and result of one query, reused from frame to frame */

/* Creates the field query of a sensor.
 *
 * Given:     world             must outlive the query
 *            observer, sensor  indices in the world
 * Returned:  *out  NULL on error
 * Errors:    BST_ERR_MEMORY and those of the sky background
 * Ownership: free *out with bst_field_free */
bst_status bst_field_create(bst_ctx *ctx, const bst_world *world, int observer, int sensor,
                            bst_field **out) BST_MUST_CHECK;
/* Frees a field query; NULL is allowed. */
void bst_field_free(bst_field *field);
/* From the next query on another camera than the sensor's; borrowed. */
void bst_field_set_camera(bst_field *field, const bst_camera *camera);

/* Cuts the samples from start_tick to end_tick out of the ring, interpolating at the ends; held in
 * `field` until the next call. BST_ERR_STATE when the ring no longer (or not yet) covers the
 * exposure. A zero-length exposure gives two equal samples. */
bst_status bst_field_track(bst_ctx *ctx, bst_field *field, const bst_los_history *history,
                           int64_t start_tick, int64_t end_tick, int64_t tick_rate_hz,
                           bst_los_track *out) BST_MUST_CHECK;

/* Fills the header of `truth` (attitudes, observer, light, background) and returns the sources that
 * touch `window`: stars by cell then brightness, then objects by index. *sources is held in `field`
 * until the next query; their paths and rates are those of the whole track. */
bst_status bst_field_query(bst_ctx *ctx, bst_field *field, const bst_los_track *track,
                           int64_t start_tick, int64_t end_tick, int64_t tick_rate_hz,
                           bst_window window, const bst_field_options *options, bst_truth *truth,
                           const bst_scene_source **sources, int *count) BST_MUST_CHECK;

/* The background of the latest query as a map of expected electrons without dark current, held in
 * `field` until the next one; NULL where it is truth->background_e all over the sensor. */
const struct bst_skylight_map *bst_field_background(const bst_field *field);
/* Background without dark current at a place of the latest query's window. */
double bst_field_background_e(const bst_field *field, const bst_truth *header, double x_px,
                              double y_px);

/* Pixel position of a source at sample k of the track. false when behind the camera. */
bool bst_field_project(const bst_camera *camera, const bst_los_track *track, int k,
                       const bst_scene_source *source, double *x_px, double *y_px);

/* Makes the truth item of a source (positions, magnitude, electrons after vignetting at its mean
 * place; SNR for a Gaussian PSF that is smeared along the source's own track, sigma from
 * background, dark and read noise in the pixels that are read, binning x binning of the sensor's
 * added; of a PSF that is no Gaussian, the one with the same
 * noise-equivalent area). With a rolling shutter all of it is that of the row where the source is
 * at the time: start and end are where the exposure of its own row starts and ends.
 */
void bst_field_truth_item(const bst_field *field, const bst_los_track *track,
                          const bst_scene_source *source, bst_window window, int binning,
                          const bst_truth *header, bst_truth_item *out);

#endif
