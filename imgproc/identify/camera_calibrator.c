#include "imgproc/identify/camera_calibrator.h"

#include <assert.h>
#include <string.h>

#include "sim/core/symmetric.h"

/* SIZE: parameters of the camera; then come three angles of the frame's attitude. */
enum { SIZE = BST_CAMERA_CALIBRATION_SIZE, ALL = SIZE + 3, ITERATIONS = 6, LEAST_STARS = 4 };
/* The first iterations use all stars: with a wrong scale all are far off. */
enum { UNGATED = 3 };

/* Standard deviation of a parameter that is known exactly. */
static const double EXACT = 1e-10;
/* The attitude's error is unknown, 1 sigma, rad. */
static const double FREE_RAD = 0.1;
/* Noise of the telemetry's roll between frames beside its constant error, rad. */
static const double ROLL_NOISE_RAD = 2e-5;
/* Squared normalised residual (two degrees of freedom) above which a star is left out. */
static const double GATE = 20.0;
/* Share of the stars that must remain, and the largest mean of chi2 per degree of freedom. */
static const double LEAST_SHARE = 0.6, MOST_CHI2 = 5.0;
/* Steps of the numerical derivatives, relative and rad. */
static const double STEP = 1e-6;

const bst_config_desc bst_camera_calibrator_config_table[] = {
    BST_BOOL(bst_camera_calibrator_config, enabled, "false",
             "Learn the camera's pixel scale, rotation and distortion from identified stars."),
    BST_REAL(bst_camera_calibrator_config, scale_sigma, "", 0, 0.05, "0.02",
             "1 sigma of the onboard pixel scale's relative error; 0: it is known exactly."),
    BST_REAL(
        bst_camera_calibrator_config, rotation_sigma_deg, "deg", 0, 5, "0.1",
        "1 sigma of the error of the focal plane's rotation on board; 0: it is known exactly."),
    BST_REAL(
        bst_camera_calibrator_config, distortion_sigma_px, "px", 0, 100, "1",
        "1 sigma of the distortion that is not known on board, in the field's corner; 0: it is "
        "known exactly."),
    BST_REAL(bst_camera_calibrator_config, telemetry_roll_sigma_arcsec, "arcsec", 0, 36000, "20",
             "1 sigma of the attitude telemetry's constant error about the boresight, which stars "
             "cannot tell from a rotation of the focal plane."),
    BST_REAL(bst_camera_calibrator_config, drift_px_per_sqrt_h, "px", 0, 100, "0.05",
             "Random walk of each parameter in an hour, in the field's corner."),
    BST_REAL(
        bst_camera_calibrator_config, star_sigma_px, "px", 1e-3, 10, "0.05",
        "1 sigma per axis of a star's place beyond its centroid error: catalogue, distortion of "
        "higher order."),
    BST_CONFIG_END,
};

static double squared(double v) {
    return v * v;
}

/* Length that a unit of a parameter moves a star in the field's corner, px. */
static double corner_px(const bst_camera_calibrator *c) {
    return c->corner / bst_camera_scale_rad(&c->onboard);
}

void bst_camera_calibrator_begin(const bst_camera_calibrator_config *config,
                                 const bst_camera *onboard, bst_camera_calibrator *out) {
    assert(config && onboard && out);
    *out = (bst_camera_calibrator){.config = config, .onboard = *onboard, .camera = *onboard};
    out->corner = tan(bst_camera_half_diagonal_rad(onboard));
    double distortion = config->distortion_sigma_px / corner_px(out);
    const double sigma[SIZE] = {config->scale_sigma, config->rotation_sigma_deg * BST_DEG_RAD,
                                distortion, distortion, distortion};
    for (int i = 0; i < SIZE; i++) {
        out->p[i][i] = squared(fmax(sigma[i], EXACT));
    }
}

/* Calibration with parameters x, without covariance. */
static bst_camera_calibration calibration_of(const bst_camera_calibrator *c, const double x[SIZE]) {
    return (bst_camera_calibration){.frames = 1,
                                    .scale = exp(x[0]),
                                    .rotation_rad = x[1],
                                    .k1 = x[2] / squared(c->corner),
                                    .p1 = x[3] / c->corner,
                                    .p2 = x[4] / c->corner};
}

/* Camera with parameters x; false if it folds the image. */
static bool camera_of(const bst_camera_calibrator *c, const double x[SIZE], bst_camera *out) {
    bst_ctx ignored = {0};
    bst_camera_calibration calibration = calibration_of(c, x);
    return bst_camera_apply_calibration(&ignored, &c->onboard, &calibration, out) == BST_OK;
}

bst_status bst_camera_calibrator_set(bst_ctx *ctx, bst_camera_calibrator *c, double scale,
                                     double rotation_rad, double sigma) {
    assert(c && scale > 0.0 && sigma > 0.0);
    double x[SIZE];
    memcpy(x, c->x, sizeof x);
    x[0] = log(scale);
    x[1] = rotation_rad;
    bst_camera_calibration calibration = calibration_of(c, x);
    BST_TRY(bst_camera_apply_calibration(ctx, &c->onboard, &calibration, &c->camera));
    memcpy(c->x, x, sizeof x);
    for (int i = 0; i < 2; i++) {
        double known = c->p[i][i] <= squared(EXACT) ? EXACT : sigma;
        for (int k = 0; k < SIZE; k++) {
            c->p[i][k] = c->p[k][i] = 0.0;
        }
        c->p[i][i] = squared(known);
    }
    return BST_OK;
}

/* Normal equations of a frame about a trial. */
typedef struct normal {
    double a[ALL][ALL], g[ALL];
    double chi2;
    int used;
} normal;

/* A trial: parameters, the attitude's error, and cameras for derivatives. */
typedef struct trial {
    double x[SIZE];
    bst_vec3 turn; /* rotation vector: true attitude from the predicted one */
    bst_camera camera, stepped[SIZE];
} trial;

/* Places of a star in the trial's cameras: itself, and with each parameter stepped. */
static bool places_of(const trial *t, bst_vec3 star, double place[1 + ALL][2]) {
    bst_vec3 v = bst_quat_rotate(bst_quat_from_rotvec(t->turn), star);
    bool seen = bst_camera_project(&t->camera, v, &place[0][0], &place[0][1]);
    for (int i = 0; seen && i < SIZE; i++) {
        seen = bst_camera_project(&t->stepped[i], v, &place[1 + i][0], &place[1 + i][1]);
    }
    const bst_vec3 axes[3] = {{STEP, 0, 0}, {0, STEP, 0}, {0, 0, STEP}};
    for (int i = 0; seen && i < 3; i++) {
        bst_vec3 u = bst_vec3_add(v, bst_vec3_cross(axes[i], v));
        seen = bst_camera_project(&t->camera, u, &place[1 + SIZE + i][0], &place[1 + SIZE + i][1]);
    }
    return seen;
}

/* Adds a star to the normal equations. */
static void add_star(const bst_camera_calibrator *c, const trial *t,
                     const bst_camera_calibrator_star *star, bool gated, normal *n) {
    double place[1 + ALL][2];
    if (!places_of(t, star->cam, place)) {
        return;
    }
    const double floor2 = squared(c->config->star_sigma_px);
    const double xx = star->cov_xx + floor2, yy = star->cov_yy + floor2, xy = star->cov_xy;
    const double det = xx * yy - xy * xy;
    const double w[2][2] = {{yy / det, -xy / det}, {-xy / det, xx / det}};
    const double r[2] = {star->x_px - place[0][0], star->y_px - place[0][1]};
    double chi2 = w[0][0] * r[0] * r[0] + 2.0 * w[0][1] * r[0] * r[1] + w[1][1] * r[1] * r[1];
    if (!(det > 0.0) || (gated && chi2 > GATE)) {
        return;
    }
    double j[ALL][2];
    for (int i = 0; i < ALL; i++) {
        for (int k = 0; k < 2; k++) {
            j[i][k] = (place[1 + i][k] - place[0][k]) / STEP;
        }
    }
    n->chi2 += chi2;
    n->used++;
    for (int i = 0; i < ALL; i++) {
        double a0 = w[0][0] * j[i][0] + w[1][0] * j[i][1];
        double a1 = w[0][1] * j[i][0] + w[1][1] * j[i][1];
        n->g[i] += a0 * r[0] + a1 * r[1];
        for (int k = 0; k < ALL; k++) {
            n->a[i][k] += a0 * j[k][0] + a1 * j[k][1];
        }
    }
}

/* Adds what is known before the frame. */
static void add_prior(const bst_camera_calibrator *c, const trial *t,
                      const double inverse[SIZE][SIZE], double telemetry_roll_rad, normal *n) {
    for (int i = 0; i < SIZE; i++) {
        for (int k = 0; k < SIZE; k++) {
            n->a[i][k] += inverse[i][k];
            n->g[i] += inverse[i][k] * (c->x[k] - t->x[k]);
        }
    }
    const double turn[3] = {t->turn.x, t->turn.y, t->turn.z};
    for (int i = 0; i < 3; i++) {
        bool roll = i == 2 && !isnan(telemetry_roll_rad);
        double weight = 1.0 / squared(roll ? ROLL_NOISE_RAD : FREE_RAD);
        n->a[SIZE + i][SIZE + i] += weight;
        n->g[SIZE + i] += weight * ((roll ? telemetry_roll_rad : 0.0) - turn[i]);
    }
}

/* One iteration: the normal equations about the trial. */
static bool linearise(const bst_camera_calibrator *c, const bst_camera_calibrator_frame *f,
                      const double inverse[SIZE][SIZE], bool gated, trial *t, normal *n) {
    if (!camera_of(c, t->x, &t->camera)) {
        return false;
    }
    for (int i = 0; i < SIZE; i++) {
        double x[SIZE];
        memcpy(x, t->x, sizeof x);
        x[i] += STEP;
        if (!camera_of(c, x, &t->stepped[i])) {
            return false;
        }
    }
    *n = (normal){.used = 0};
    for (int i = 0; i < f->count; i++) {
        add_star(c, t, &f->stars[i], gated, n);
    }
    /* residuals above what the covariances say make the frame less certain */
    double excess = n->chi2 / fmax(2.0 * n->used - ALL, 1.0);
    if (gated && excess > 1.0) {
        for (int i = 0; i < ALL; i++) {
            n->g[i] /= excess;
            for (int k = 0; k < ALL; k++) {
                n->a[i][k] /= excess;
            }
        }
    }
    add_prior(c, t, inverse, f->telemetry_roll_rad, n);
    return n->used >= LEAST_STARS;
}

bool bst_camera_calibrator_update(bst_camera_calibrator *c, const bst_camera_calibrator_frame *f) {
    assert(c && f && (f->stars || f->count == 0));
    if (f->count < LEAST_STARS) {
        return false;
    }
    double p[SIZE][SIZE], inverse[SIZE][SIZE], covariance[ALL][ALL];
    memcpy(p, c->p, sizeof p);
    double hours = c->frames > 0 ? fmax(f->seconds - c->seconds, 0.0) / 3600.0 : 0.0;
    double walk = squared(c->config->drift_px_per_sqrt_h / corner_px(c)) * hours;
    for (int i = 0; i < SIZE; i++) {
        p[i][i] += p[i][i] <= squared(EXACT) ? 0.0 : walk;
    }
    if (!bst_symmetric_invert(SIZE, p[0], inverse[0])) {
        return false;
    }
    trial t = {.turn = {0.0, 0.0, 0.0}};
    normal n;
    memcpy(t.x, c->x, sizeof t.x);
    for (int pass = 0; pass <= ITERATIONS; pass++) {
        if (!linearise(c, f, inverse, pass >= UNGATED, &t, &n) ||
            !bst_symmetric_invert(ALL, n.a[0], covariance[0])) {
            return false;
        }
        double step[ALL] = {0};
        for (int i = 0; i < ALL && pass < ITERATIONS; i++) {
            for (int k = 0; k < ALL; k++) {
                step[i] += covariance[i][k] * n.g[k];
            }
        }
        for (int i = 0; i < SIZE; i++) {
            t.x[i] += step[i];
        }
        t.turn = bst_vec3_add(t.turn, (bst_vec3){step[SIZE], step[SIZE + 1], step[SIZE + 2]});
    }
    if (n.used < LEAST_SHARE * f->count || n.chi2 > MOST_CHI2 * (2.0 * n.used)) {
        return false;
    }
    memcpy(c->x, t.x, sizeof c->x);
    for (int i = 0; i < SIZE; i++) {
        memcpy(c->p[i], covariance[i], sizeof c->p[i]);
    }
    c->camera = t.camera;
    c->seconds = f->seconds;
    c->frames++;
    return true;
}

void bst_camera_calibrator_get(const bst_camera_calibrator *c, bst_camera_calibration *out) {
    assert(c && out);
    if (c->frames == 0) {
        *out = (bst_camera_calibration){.frames = 0};
        return;
    }
    *out = calibration_of(c, c->x);
    out->frames = c->frames;
    const double unit[SIZE] = {out->scale, 1.0, 1.0 / squared(c->corner), 1.0 / c->corner,
                               1.0 / c->corner};
    for (int i = 0; i < SIZE; i++) {
        for (int k = 0; k < SIZE; k++) {
            out->covariance[i][k] = c->p[i][k] * unit[i] * unit[k];
        }
    }
    /* the telemetry's constant error about the boresight does not average out */
    out->covariance[1][1] += c->p[1][1] <= squared(EXACT)
                                 ? 0.0
                                 : squared(c->config->telemetry_roll_sigma_arcsec * BST_ARCSEC_RAD);
}

bst_status bst_camera_calibrator_archive(bst_camera_calibrator *c, bst_archive *archive) {
    assert(c && archive);
    BST_ARCHIVE(archive, c->x);
    BST_ARCHIVE(archive, c->p);
    BST_ARCHIVE(archive, c->frames);
    BST_ARCHIVE(archive, c->seconds);
    if (!bst_archive_is_restoring(archive)) {
        return BST_OK;
    }
    bool valid = c->frames >= 0 && isfinite(c->seconds);
    for (int i = 0; i < SIZE; i++) {
        valid = valid && isfinite(c->x[i]) && c->p[i][i] > 0.0 && isfinite(c->p[i][i]);
    }
    if (!valid || !camera_of(c, c->x, &c->camera)) {
        return bst_fail(bst_archive_ctx(archive), BST_ERR_RANGE,
                        "the saved camera calibration is damaged");
    }
    return BST_OK;
}
