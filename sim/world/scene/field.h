/* Field query: the sources in the field of view during one exposure, with position and brightness.
 * The renderer and the observation generator use it. */
#ifndef BST_WORLD_SCENE_FIELD_H
#define BST_WORLD_SCENE_FIELD_H

#include "boresight/messages.h"
#include "sim/optics/ghosts.h"
#include "sim/world/world.h"

/* Apparent motion of an object during an exposure, at equidistant times from start to end. The
 * relative position of a near object is almost linear in time; its direction is not. Therefore a
 * polynomial interpolates the position. Light time and aberration shift the direction by about the
 * relative velocity over c, which changes slowly. Any unit of length. */
enum { BST_PATH_NODES = 5 };
typedef struct bst_scene_source_path {
    bst_vec3 place[BST_PATH_NODES]; /* object minus observer at the same instant, GCRF axes */
    bst_vec3 shift[3]; /* at start, middle and end: position + |position| shift has the apparent
                          direction */
} bst_scene_source_path;

/* Brightness of a source that changes during an exposure (shadow edge, light curve, near pass):
 * linear between knots. */
enum { BST_RATE_KNOTS = 385 };
typedef struct bst_scene_source_rate {
    int count;                    /* knots, >= 2 */
    double u[BST_RATE_KNOTS];     /* time as a fraction of the exposure, from 0 to 1, ascending */
    double rate[BST_RATE_KNOTS];  /* relative to the mean of the exposure */
    double light[BST_RATE_KNOTS]; /* cumulative fraction of the exposure's light, 0 to 1 */
    double error;                 /* expected error of the light by too few knots, as a fraction */
} bst_scene_source_rate;

/* A sphere large enough to be rendered as a disc with a terminator. The members diffuse to thermal
 * are fractions of the light; their sum is 1. */
typedef struct bst_scene_source_shape {
    double radius;       /* radius over distance at mid-exposure; below 1 */
    bst_vec3 sun, earth; /* directions of the light: unit, from the sphere, GCRF */
    double diffuse;      /* sunlight, Lambert's law */
    double specular;     /* sunlight, mirror reflection: a point on the disc */
    double earthshine;   /* Lambert's law, from the centroid of the earthlight */
    double thermal;      /* thermal emission, uniform over the disc */
} bst_scene_source_shape;

struct bst_scene_source_body;

/* A source whose light may reach the window. */
typedef struct bst_scene_source {
    int32_t kind; /* bst_source_kind */
    uint32_t id;  /* star: identity in the catalogue, or statistical (bit 31); object: index in the
                     world */
    bst_vec3 apparent_mid;               /* at mid-exposure, GCRF axes, unit */
    const bst_scene_source_path *path;   /* NULL: at rest; owned by the creator of the source */
    const bst_scene_source_rate *rate;   /* NULL: constant; owned by the creator */
    const bst_scene_source_shape *shape; /* sphere; NULL: a point; owned by the creator */
    const bst_ghost *ghost; /* the image is that ghost of the source; NULL: of the source itself */
    const struct bst_scene_source_body *body; /* model of a satellite (source_body.h); NULL: a point
                                                 or a sphere; owned by the creator */
    double body_u[2];                         /* the exposure, as a part of the body's times */
    double electrons_per_s;                   /* detected, mean over the exposure */
    float colour[BST_PSF_COLOURS];            /* spectrum (bst_psf_colour); all 0: solar */
    double v_mag;
    double ra_rad, dec_rad; /* as in bst_truth_item */
    double sunlit_fraction, phase_rad, range_m;
    bool occulted; /* behind the Earth, a star also behind a body: no light */
    bool outside;  /* far from the window, which only charge that moves brings its light to:
                      rendered, but not in the truth (bst_field_options.read_charge) */
} bst_scene_source;

/* Relative position of an object at time u in [0, 1] of the exposure: quartic through five
 * positions. For orbits of radius r and angular rate w the error is 1e-3 r (w T / 2)^5: 1 um in LEO
 * for an exposure T of 20 s. */
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

/* Direction shift at time u: quadratic through three shifts. */
static inline bst_vec3 bst_scene_source_shift(const bst_scene_source_path *p, double u) {
    double a = 4.0 * u, c = a - 2.0, e = a - 4.0;
    bst_vec3 shift = bst_vec3_scale(p->shift[0], 0.125 * c * e);
    shift = bst_vec3_axpy(shift, -0.25 * a * e, p->shift[1]);
    return bst_vec3_axpy(shift, 0.125 * a * c, p->shift[2]);
}

/* Apparent direction (any length) of a source at time u in [0, 1] of the exposure. */
static inline bst_vec3 bst_scene_source_direction(const bst_scene_source *s, double u) {
    if (!s->path) {
        return s->apparent_mid;
    }
    bst_vec3 place = bst_scene_source_place(s->path, u);
    return bst_vec3_axpy(place, bst_vec3_norm(place), bst_scene_source_shift(s->path, u));
}

/* Direction in the camera frame of a source's image, from the direction v_cam of its light: the
 * same, but for a ghost. */
static inline bst_vec3 bst_scene_source_seen(const bst_camera *camera, const bst_scene_source *s,
                                             bst_vec3 v_cam) {
    return s->ghost ? bst_ghost_direction(s->ghost, camera, v_cam) : v_cam;
}

/* Fraction of the exposure's light that a source emits until time u in [0, 1]; it weights the
 * positions in the image. */
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

/* Brightness of a source at time u relative to its mean. */
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

/* Path through three directions (quadratic, in apparent_mid's unit), for scenes without orbits. */
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

/* True camera attitude during an exposure, extracted from los_history. */
typedef struct bst_los_track {
    int count; /* samples, >= 2; first and last are interpolated at the ends of the exposure */
    const double *time_s; /* [count] since the start of the exposure, ascending, time_s[0] = 0 */
    const bst_quat *q_cam_from_gcrf; /* [count], consecutive signs agree */
} bst_los_track;

typedef struct bst_field_options {
    double v_limit;   /* magnitude limit of stars */
    double margin_px; /* margin around the window in which sources still count (PSF wings) */
    double lead_s;    /* rolling shutter: the track extends by this before and after the exposure of
                         the window's middle row */
    /* ghosts count whose light in a pixel is above this, in sigma of a dark pixel; 0: none do */
    double ghost_sigma;
    int binning;      /* of the read-out pixels, for ghost_sigma; 0: 1 */
    bool read_charge; /* sources count that light any part of the sensor whose charge the read-out
                         of the window depends on (bst_detector_config_whole_columns) */
} bst_field_options;

typedef struct bst_field
    bst_field; /* work space and result of a field query, reused for every frame */

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
/* Uses another camera from the next query on; the camera is borrowed. */
void bst_field_set_camera(bst_field *field, const bst_camera *camera);

/* From the next query on the background at an edge of the Earth or of another body is computed at
 * the sources only: bst_field_background has no edges. For modules that render no frame. */
void bst_field_set_background_places_only(bst_field *field);

/* Extracts the attitude samples from start_tick to end_tick from the ring, interpolated at the
 * ends. `field` holds the track until the next call. BST_ERR_STATE if the ring does not cover the
 * exposure. A zero-length exposure gives two equal samples. */
bst_status bst_field_track(bst_ctx *ctx, bst_field *field, const bst_los_history *history,
                           int64_t start_tick, int64_t end_tick, int64_t tick_rate_hz,
                           bst_los_track *out) BST_MUST_CHECK;

/* Fills the header of `truth` (attitudes, observer, light, background) and returns the sources that
 * touch `window`: stars by cell and brightness, then ghosts, then objects by index. `field` holds
 * *sources until the next query. Paths and rates refer to the complete track. */
bst_status bst_field_query(bst_ctx *ctx, bst_field *field, const bst_los_track *track,
                           int64_t start_tick, int64_t end_tick, int64_t tick_rate_hz,
                           bst_window window, const bst_field_options *options, bst_truth *truth,
                           const bst_scene_source **sources, int *count) BST_MUST_CHECK;

/* Background of the latest query: map of expected electrons without dark current, held until the
 * next query. NULL: uniform, truth->background_e. */
const struct bst_skylight_map *bst_field_background(const bst_field *field);
/* Background without dark current at a pixel position of the latest query. */
double bst_field_background_e(const bst_field *field, const bst_truth *header, double x_px,
                              double y_px);

/* Pixel position of a source at sample k of the track. False: behind the camera. */
bool bst_field_project(const bst_camera *camera, const bst_los_track *track, int k,
                       const bst_scene_source *source, double *x_px, double *y_px);

/* Fills the truth item of a source: positions, magnitude, electrons after vignetting, SNR.
 *
 * Notes:     SNR: of a Gaussian PSF smeared along the source's track, or of the Gaussian
 *            with the same noise-equivalent area. Noise: background, dark and read noise per read
 *            pixel (binning x binning sensor pixels).
 *            Rolling shutter: all values refer to the exposure of the row where the source is. */
void bst_field_truth_item(const bst_field *field, const bst_los_track *track,
                          const bst_scene_source *source, bst_window window, int binning,
                          const bst_truth *header, bst_truth_item *out);

#endif
