#include "boresight/camera_motion.h"

#include <assert.h>
#include <string.h>

static const bst_pointing_sample *sample_at(const bst_pointing_telemetry *t, int64_t n) {
    return &t->items[n % t->capacity];
}

/* Moments of a piecewise linear rotation vector r(t), t from mid-exposure. */
typedef struct moments {
    bst_vec3 zeroth, first, second; /* integrals of r, t r and t^2 r */
} moments;

/* Adds a linear piece of the camera's rotation to its time moments. */
static void add_segment(moments *m, double t0, double t1, bst_vec3 r0, bst_vec3 r1) {
    double h = t1 - t0;
    bst_vec3 mean = bst_vec3_scale(bst_vec3_add(r0, r1), 0.5);
    bst_vec3 difference = bst_vec3_sub(r1, r0);
    m->zeroth = bst_vec3_axpy(m->zeroth, h, mean);
    /* integral of t r over a linear piece: midpoint term plus h^2 (r1 - r0) / 12 */
    m->first = bst_vec3_axpy(m->first, 0.5 * h * (t0 + t1), mean);
    m->first = bst_vec3_axpy(m->first, h * h / 12.0, difference);
    double middle = 0.5 * (t0 + t1);
    m->second = bst_vec3_axpy(m->second, h * (middle * middle + h * h / 12.0), mean);
    m->second = bst_vec3_axpy(m->second, h * h * middle / 6.0, difference);
}

static bst_vec3 lerp(bst_vec3 a, bst_vec3 b, double s) {
    return bst_vec3_axpy(a, s, bst_vec3_sub(b, a));
}

/* Estimates white noise from third differences of rotation vectors at equal steps: their variance
 * is 20 times that of the noise. */
typedef struct roughness {
    bst_vec3 last[3]; /* newest first */
    double step;
    int run, count; /* run: samples at this step; count: differences */
    double sum;     /* sum of squares about x and y */
} roughness;

/* Adds a pointing sample to the estimate of its noise by third differences. */
static void add_sample(roughness *s, double step, bst_vec3 r) {
    s->run = s->run > 0 && fabs(step - s->step) > 0.5 ? 1 : s->run;
    s->step = step;
    if (s->run >= 3) {
        double x = r.x - 3.0 * (s->last[0].x - s->last[1].x) - s->last[2].x;
        double y = r.y - 3.0 * (s->last[0].y - s->last[1].y) - s->last[2].y;
        s->sum += x * x + y * y;
        s->count++;
    }
    s->last[2] = s->last[1];
    s->last[1] = s->last[0];
    s->last[0] = r;
    s->run++;
}

/* Rotations at the knots of a departure. */
typedef struct knots {
    int count; /* those that are known */
    bst_vec3 r[BST_CAMERA_MOTION_KNOTS];
} knots;

/* A linear piece of the rotation from t = ta to tb. */
typedef struct piece {
    double ta, tb;
    bst_vec3 ra, rb;
} piece;

/* Adds the knots up to t = end on a piece. */
static void add_knots(knots *k, double half, const piece *p, double end) {
    for (; k->count < BST_CAMERA_MOTION_KNOTS; k->count++) {
        double t = half * (2.0 * k->count / (BST_CAMERA_MOTION_KNOTS - 1) - 1.0);
        if (t > end) {
            break;
        }
        k->r[k->count] = lerp(p->ra, p->rb, (t - p->ta) / (p->tb - p->ta));
    }
}

/* minimum number of third differences for a noise estimate */
enum { FEWEST_DIFFERENCES = 5 };

/* Share of the noise's variance that is left of a bend where none is measured. */
#define LEAST_UNKNOWN (1.0 / 3.0)

/* A smaller mean square of the departure, in that of its noise, is taken for noise. */
static const double LEAST_DEPARTURE = 4.0;

/* Sets the departure from mean, turn and bend, shrunk by its noise of `variance` per axis. */
static void set_departure(const knots *k, bst_vec3 mean, double variance, bst_camera_motion *out) {
    const int last = BST_CAMERA_MOTION_KNOTS - 1;
    double square = 0.0;
    for (int i = 0; i <= last && k->count > last; i++) {
        const double u = 2.0 * i / last - 1.0;
        bst_vec3 left = bst_vec3_axpy(bst_vec3_sub(k->r[i], mean), -0.5 * u, out->turn_cam_rad);
        left = bst_vec3_axpy(left, 0.5 - 1.5 * u * u, out->bend_cam_rad);
        out->departure_cam_rad[0][i] = left.x;
        out->departure_cam_rad[1][i] = left.y;
        square += (i % last ? 1.0 : 0.5) / last * (left.x * left.x + left.y * left.y);
    }
    const double noise = 2.0 * variance;
    const double share = square > LEAST_DEPARTURE * noise ? 1.0 - noise / square : 0.0;
    for (int i = 0; i <= last; i++) {
        out->departure_cam_rad[0][i] *= share;
        out->departure_cam_rad[1][i] *= share;
    }
}

/* Variance of the telemetry's noise per sample and axis. */
static double noise_variance(const roughness *s) {
    return s->sum / (2.0 * s->count * 20.0);
}

/* Shrinks the estimated curvature of the motion by its noise. */
static void judge_bend(const roughness *s, double samples, bst_camera_motion *motion) {
    /* least-squares coefficient of a second-degree Legendre polynomial */
    double variance = noise_variance(s) * 5.0 / samples;
    bst_vec3 b = motion->bend_cam_rad;
    double square = b.x * b.x + b.y * b.y;
    double share = square > 2.0 * variance ? 1.0 - 2.0 * variance / square : 0.0;
    motion->bend_cam_rad = (bst_vec3){share * b.x, share * b.y, b.z};
    motion->bend_sigma_rad = sqrt(fmax(share, LEAST_UNKNOWN) * variance);
}

bool bst_camera_motion_from_telemetry(const bst_pointing_telemetry *telemetry, int64_t start_tick,
                                      int64_t end_tick, bst_camera_motion *out) {
    if (telemetry->written <= 0 || telemetry->capacity <= 0) {
        return false;
    }
    int64_t newest = telemetry->written - 1;
    int64_t oldest =
        telemetry->written > telemetry->capacity ? telemetry->written - telemetry->capacity : 0;
    /* first: the last sample at or before the start of the exposure, or the oldest one */
    int64_t first = newest;
    while (first > oldest && sample_at(telemetry, first)->tick > start_tick) {
        first--;
    }
    bst_quat reference = sample_at(telemetry, first)->q_cam_from_gcrf;
    bst_quat inverse = bst_quat_conj(reference);
    if (first == newest && first > oldest) {
        first--;
    }
    double middle = 0.5 * ((double)(end_tick - start_tick));
    double half = middle > 0.0 ? middle : 0.0;
    moments m = {{0, 0, 0}, {0, 0, 0}, {0, 0, 0}};
    bst_vec3 at_middle = {0, 0, 0};
    roughness noise = {.run = 0};
    knots path = {.count = 0};
    bst_vec3 rb = {0, 0, 0};
    int64_t known = -1; /* sample to which rb belongs */
    for (int64_t n = first; n < newest; n++) {
        const bst_pointing_sample *a = sample_at(telemetry, n), *b = sample_at(telemetry, n + 1);
        double ta = (double)(a->tick - start_tick) - middle;
        double tb = (double)(b->tick - start_tick) - middle;
        if (!(tb > ta)) {
            continue;
        }
        bst_vec3 ra =
            n == known ? rb : bst_quat_to_rotvec(bst_quat_mul(a->q_cam_from_gcrf, inverse));
        rb = bst_quat_to_rotvec(bst_quat_mul(b->q_cam_from_gcrf, inverse));
        known = n + 1;
        double lo = n == first || ta < -half ? -half : ta;
        double hi = n + 1 == newest || tb > half ? half : tb;
        if ((n == first || ta <= 0.0) && (n + 1 == newest || tb >= 0.0)) {
            at_middle = lerp(ra, rb, (0.0 - ta) / (tb - ta));
        }
        if (noise.run == 0) {
            add_sample(&noise, tb - ta, ra);
        }
        add_sample(&noise, tb - ta, rb);
        if (hi > lo) {
            add_segment(&m, lo, hi, lerp(ra, rb, (lo - ta) / (tb - ta)),
                        lerp(ra, rb, (hi - ta) / (tb - ta)));
            /* the last knot is at the end but for rounding */
            bool last = n + 1 == newest || tb >= half;
            add_knots(&path, half, &(piece){ta, tb, ra, rb}, last ? INFINITY : hi);
        }
        if (tb >= half) {
            break;
        }
    }
    bst_vec3 mean = at_middle, turn = {0, 0, 0}, bend = {0, 0, 0};
    if (half > 0.0) {
        double span = 2.0 * half;
        mean = bst_vec3_scale(m.zeroth, 1.0 / span);
        /* slope = 12 / T^3 integral of t r; the rotation is slope times T */
        turn = bst_vec3_scale(m.first, 12.0 / (span * span));
        /* (5 / T) integral of P2(2 t / T) r, P2: Legendre polynomial */
        bend = bst_vec3_axpy(bst_vec3_scale(m.zeroth, -2.5 / span), 30.0 / (span * span * span),
                             m.second);
    }
    out->q_cam_from_gcrf = bst_quat_unit(bst_quat_mul(bst_quat_from_rotvec(mean), reference));
    out->turn_cam_rad = turn;
    out->bend_cam_rad = bend;
    out->bend_sigma_rad = 0.0;
    memset(out->departure_cam_rad, 0, sizeof out->departure_cam_rad);
    if (noise.count >= FEWEST_DIFFERENCES) {
        set_departure(&path, mean, noise_variance(&noise), out);
        judge_bend(&noise, 2.0 * half / fmax(noise.step, 1.0), out);
    }
    return true;
}

void bst_camera_motion_streak(const bst_camera_motion *motion, const bst_camera *camera,
                              double x_px, double y_px, double *dx_px, double *dy_px) {
    bst_vec3 v = bst_camera_unproject(camera, x_px, y_px);
    bst_quat half = bst_quat_from_rotvec(bst_vec3_scale(motion->turn_cam_rad, 0.5));
    double x0, y0, x1, y1;
    *dx_px = *dy_px = 0.0;
    if (bst_camera_project(camera, bst_quat_rotate(bst_quat_conj(half), v), &x0, &y0) &&
        bst_camera_project(camera, bst_quat_rotate(half, v), &x1, &y1)) {
        *dx_px = x1 - x0;
        *dy_px = y1 - y0;
    }
}

void bst_camera_motion_bend(const bst_camera_motion *motion, const bst_camera *camera, double *x_px,
                            double *y_px) {
    double scale = bst_camera_scale_rad(camera), k[2][2];
    bst_camera_jacobian(camera, (bst_vec3){0, 0, 1}, k);
    double a = motion->bend_cam_rad.y, b = -motion->bend_cam_rad.x;
    *x_px = (k[0][0] * a + k[0][1] * b) / scale;
    *y_px = (k[1][0] * a + k[1][1] * b) / scale;
}

void bst_camera_motion_departure(const bst_camera_motion *motion, const bst_camera *camera,
                                 int knot, double *x_px, double *y_px) {
    assert(knot >= 0 && knot < BST_CAMERA_MOTION_KNOTS);
    double scale = bst_camera_scale_rad(camera), k[2][2];
    bst_camera_jacobian(camera, (bst_vec3){0, 0, 1}, k);
    double a = motion->departure_cam_rad[1][knot], b = -motion->departure_cam_rad[0][knot];
    *x_px = (k[0][0] * a + k[0][1] * b) / scale;
    *y_px = (k[1][0] * a + k[1][1] * b) / scale;
}

/* possible error of a measured or commanded curvature, as a fraction */
static const double BEND_LEFT = 0.05;

/* Adds a displacement to the covariance of a detection. */
static void widen(double x, double y, bst_detection *d) {
    d->cov_xx += x * x;
    d->cov_xy += x * y;
    d->cov_yy += y * y;
}

void bst_camera_motion_widen(double bend_x_px, double bend_y_px, double followed_x_px,
                             double followed_y_px, bst_detection *d) {
    widen(0.5 * (bend_x_px - followed_x_px), 0.5 * (bend_y_px - followed_y_px), d);
    widen(BEND_LEFT * followed_x_px, BEND_LEFT * followed_y_px, d);
}

/* Rotation vector that moves the boresight by (x_px, y_px). */
static bst_vec3 rotation_of(const bst_camera *camera, double x_px, double y_px) {
    double scale = bst_camera_scale_rad(camera), k[2][2];
    bst_camera_jacobian(camera, (bst_vec3){0, 0, 1}, k);
    double det = k[0][0] * k[1][1] - k[0][1] * k[1][0];
    return (bst_vec3){-(k[0][0] * y_px - k[1][0] * x_px) * scale / det,
                      (k[1][1] * x_px - k[0][1] * y_px) * scale / det, 0.0};
}

void bst_camera_motion_add(bst_camera_motion *motion, const bst_camera *camera, double dx_px,
                           double dy_px, double bend_x_px, double bend_y_px) {
    motion->turn_cam_rad = bst_vec3_add(motion->turn_cam_rad, rotation_of(camera, dx_px, dy_px));
    motion->bend_cam_rad =
        bst_vec3_add(motion->bend_cam_rad, rotation_of(camera, bend_x_px, bend_y_px));
}

/* Derivative of exp(-z^2 / 2), negative. */
static double flank(double z) {
    return z * exp(-0.5 * z * z);
}

/* Standard normal distribution. */
static double below(double z) {
    return 0.5 * erfc(-z / 1.4142135623730951);
}

/* steps of the integrals over the exposure: 0.2 % for streaks of 200 sigma */
enum { SHIFT_STEPS = 512 };
/* A shorter streak, in sigmas of the PSF, is located as a point: at its centroid, the path's mean.
 */
static const double LEAST_STREAK_SIGMAS = 0.5;

double bst_camera_motion_unknown_bend_px(double jitter_px, double own_px, double telemetry_px) {
    static const double JITTER_BEND = 0.075; /* RMS bend per RMS of jitter */
    return hypot(hypot(JITTER_BEND * jitter_px, own_px), telemetry_px);
}

void bst_camera_motion_shared_shift(double length_px, double sigma_px, double before_px,
                                    double after_px, double *along_px2, double *across_px2) {
    *along_px2 = *across_px2 = 0.0;
    if (!(length_px > LEAST_STREAK_SIGMAS * sigma_px)) {
        return;
    }
    /* the overlap of two equal streaks has the variance of both profiles */
    const double half = 0.5 * length_px / (sigma_px * sqrt(2.0));
    double along = 0.0, across = 0.0, bend = 0.0, along2 = 0.0, across2 = 0.0;
    for (int k = 0; k <= SHIFT_STEPS; k++) {
        /* Simpson's rule; t from -1 to 1 over the exposure */
        const double weight = (k == 0 || k == SHIFT_STEPS ? 1.0
                               : k % 2                    ? 4.0
                                                          : 2.0) /
                              3.0 * 2.0 / SHIFT_STEPS;
        const double t = 2.0 * k / SHIFT_STEPS - 1.0;
        const double from_end = half * (t - 1.0), from_start = half * (t + 1.0);
        const double a = flank(from_start) - flank(from_end);
        const double c = below(from_start) - below(from_end);
        along += weight * a;
        along2 += weight * a * a;
        bend += weight * a * (1.5 * t * t - 0.5);
        across += weight * c;
        across2 += weight * c * c;
    }
    bend /= along;
    /* sum over even n of (2 n + 1) k_n^2 = 2 (mean of the squared weight), n = 0 has k = 1 */
    const double all = 2.0 * along2 / (along * along) - 1.0;
    const double higher = fmax(all - 5.0 * bend * bend, 0.0) / 5.0;
    *along_px2 = higher * before_px * before_px + bend * bend * after_px * after_px;
    *across_px2 = fmax(2.0 * across2 / (across * across) - 1.0, 0.0) / 5.0 * before_px * before_px;
}

void bst_camera_motion_set_shared(double dx_px, double dy_px, double along_px2, double across_px2,
                                  bst_detections *detections) {
    const double length = hypot(dx_px, dy_px);
    const double c = length > 0.0 ? dx_px / length : 1.0, s = length > 0.0 ? dy_px / length : 0.0;
    detections->shared_xx = c * c * along_px2 + s * s * across_px2;
    detections->shared_xy = c * s * (along_px2 - across_px2);
    detections->shared_yy = s * s * along_px2 + c * c * across_px2;
}
