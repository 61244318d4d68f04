#include "sim/world/scene/field_image.h"

#include "sim/optics/psf.h"
#include "sim/world/scene/disc.h"
#include "sim/world/scene/los_track.h"

bst_scene_image_moments bst_scene_image_by_light(const bst_camera *camera,
                                                 const bst_los_track *track,
                                                 const bst_scene_source *source, double u0,
                                                 double u1) {
    bst_scene_image_moments m = {0};
    double total = bst_scene_source_light(source, u1) - bst_scene_source_light(source, u0);
    double whole = u0 > 0.0 || u1 < 1.0 ? (total > 0.0 ? total : 1.0) : 1.0;
    double duration = track->time_s[track->count - 1];
    int sample = 0;
    int count = 2 * track->count < 128 ? 128 : 2 * track->count < 2048 ? 2 * track->count : 2048;
    double xx = 0.0, xy = 0.0, yy = 0.0, t = 0.0, tt = 0.0, tx = 0.0, ty = 0.0;
    for (int n = 0; n < count; n++) {
        double u = u0 + (u1 - u0) * ((n + 0.5) / count), x = NAN, y = NAN;
        double weight = (bst_scene_source_light(source, u0 + (u1 - u0) * ((n + 1.0) / count)) -
                         bst_scene_source_light(source, u0 + (u1 - u0) * ((double)n / count))) /
                        whole;
        while (sample + 2 < track->count && track->time_s[sample + 1] < u * duration) {
            sample++;
        }
        double step = track->time_s[sample + 1] - track->time_s[sample];
        bst_quat q =
            bst_quat_slerp(track->q_cam_from_gcrf[sample], track->q_cam_from_gcrf[sample + 1],
                           step > 0.0 ? (u * duration - track->time_s[sample]) / step : 0.0);
        bst_vec3 v = bst_quat_rotate(q, bst_scene_source_direction(source, u));
        (void)bst_camera_project(camera, bst_scene_source_seen(camera, source, v), &x, &y);
        double dx = x - m.x_mean, dy = y - m.y_mean;
        if (n == 0) { /* moments about the first position */
            m.x_mean = x;
            m.y_mean = y;
            dx = dy = 0.0;
        }
        m.xx += weight * dx;
        m.xy += weight * dy;
        xx += weight * dx * dx;
        xy += weight * dx * dy;
        yy += weight * dy * dy;
        double time = (n + 0.5) / count - 0.5;
        t += weight * time;
        tt += weight * time * time;
        tx += weight * time * dx;
        ty += weight * time * dy;
    }
    double ex = m.xx, ey = m.xy, spread = fmax(tt - t * t, 1e-9); /* 1 / 12 of constant light */
    return (bst_scene_image_moments){m.x_mean + ex,         m.y_mean + ey, xx - ex * ex,
                                     xy - ex * ey,          yy - ey * ey,  (tx - t * ex) / spread,
                                     (ty - t * ey) / spread};
}

void bst_scene_image_add_disc(const bst_camera *camera, bst_quat q_mid,
                              const bst_scene_source *source, bst_scene_image_moments *m) {
    enum { TIMES = 24, AROUND = 48 };
    bst_disc disc;
    bst_disc_begin(source, &disc);
    double x0, y0, sum = 0.0, ex = 0.0, ey = 0.0, xx = 0.0, xy = 0.0, yy = 0.0;
    bst_vec3 z = bst_vec3_unit(source->apparent_mid), e1, e2;
    if (!bst_camera_project(camera, bst_quat_rotate(q_mid, z), &x0, &y0)) {
        return;
    }
    e1 = bst_vec3_unit(
        bst_vec3_cross(fabs(z.z) < 0.9 ? (bst_vec3){0, 0, 1} : (bst_vec3){1, 0, 0}, z));
    e2 = bst_vec3_cross(z, e1);
    double cosine[2][AROUND], sine[2][AROUND]; /* of even and odd rings */
    for (int n = 0; n < 2 * AROUND; n++) {
        double a = 2.0 * BST_PI * (n % AROUND + 0.5 * (n / AROUND)) / AROUND;
        cosine[n / AROUND][n % AROUND] = cos(a);
        sine[n / AROUND][n % AROUND] = sin(a);
    }
    for (int n = 0; n <= TIMES * AROUND; n++) {
        /* rings of equal area, and the specular point */
        double s = source->shape->radius * sqrt((n / AROUND + 0.5) / TIMES);
        const int odd = n / AROUND % 2, k = n % AROUND;
        double x, y;
        bst_vec3 d = bst_vec3_axpy(bst_vec3_axpy(z, s * cosine[odd][k], e1), s * sine[odd][k], e2);
        bst_vec3 ray = d;
        double share = 0.0;
        if (n == TIMES * AROUND) {
            ray = bst_vec3_add(z, bst_disc_specular(source));
            share = source->shape->specular;
        } else {
            share = bst_disc_radiance(&disc, bst_vec3_unit(d)) * BST_PI * source->shape->radius *
                    source->shape->radius / (TIMES * AROUND);
        }
        if (share > 0.0 && bst_camera_project(camera, bst_quat_rotate(q_mid, ray), &x, &y)) {
            x -= x0;
            y -= y0;
            sum += share;
            ex += share * x;
            ey += share * y;
            xx += share * x * x;
            xy += share * x * y;
            yy += share * y * y;
        }
    }
    if (sum > 0.0) {
        m->x_mean += ex / sum;
        m->y_mean += ey / sum;
        m->xx += xx / sum - ex * ex / (sum * sum);
        m->xy += xy / sum - ex * ey / (sum * sum);
        m->yy += yy / sum - ey * ey / (sum * sum);
    }
}

void bst_scene_image_centroid(const bst_camera *camera, const bst_scene_source *source,
                              const bst_scene_image_moments *m, double *x_px, double *y_px) {
    double shift[2] = {0.0, 0.0}, sigma = bst_camera_psf_sigma_px(camera);
    *x_px = m->x_mean;
    *y_px = m->y_mean;
    if (!isfinite(m->x_mean) || !isfinite(m->y_mean)) {
        return;
    }
    if (camera->psf) {
        bst_psf_centroid_px(camera->psf, source->colour, m->x_mean, m->y_mean, shift);
        sigma = bst_psf_coloured_fwhm_px(camera->psf, source->colour, m->x_mean, m->y_mean) /
                BST_FWHM_PER_SIGMA;
    }
    /* a light distribution of variance v on an illumination with slope s per px shifts by v s */
    double here = bst_camera_illumination(camera, m->x_mean, m->y_mean), variance = sigma * sigma;
    if (here > 0.0) {
        double sx = 0.5 / here *
                    (bst_camera_illumination(camera, m->x_mean + 1.0, m->y_mean) -
                     bst_camera_illumination(camera, m->x_mean - 1.0, m->y_mean));
        double sy = 0.5 / here *
                    (bst_camera_illumination(camera, m->x_mean, m->y_mean + 1.0) -
                     bst_camera_illumination(camera, m->x_mean, m->y_mean - 1.0));
        shift[0] += (m->xx + variance) * sx + m->xy * sy;
        shift[1] += m->xy * sx + (m->yy + variance) * sy;
    }
    *x_px += shift[0];
    *y_px += shift[1];
}

/* Variance of uncorrelated jitter in a path, both axes, px^2. Second differences have 6 times the
 * variance of white errors; smooth paths contribute little. */
static double roughness(const double *x, const double *y, int count) {
    double sum = 0.0;
    for (int k = 1; k + 1 < count; k++) {
        double dx = x[k - 1] - 2.0 * x[k] + x[k + 1], dy = y[k - 1] - 2.0 * y[k] + y[k + 1];
        sum += (dx * dx + dy * dy) / (6.0 * (count - 2));
    }
    return sum;
}

/* A path as straight pieces, each with a share of the light: its corners, px. */
enum { MOST_PIECES = 64 };

typedef struct light_path {
    int count;
    double x[MOST_PIECES + 1], y[MOST_PIECES + 1], light[MOST_PIECES];
} light_path;

/* The path in `count` pieces of equal time; false when a corner is behind the camera. */
static bool path_in_pieces(const bst_camera *camera, const bst_los_track *track,
                           const bst_scene_source *source, const double u01[2], int count,
                           light_path *path) {
    double duration = track->time_s[track->count - 1], before = 0.0;
    path->count = count;
    for (int k = 0; k <= count; k++) {
        double u = u01[0] + (u01[1] - u01[0]) * k / count;
        bst_quat q = bst_los_track_attitude(track, u * duration);
        double after = bst_scene_source_light(source, u);
        bst_vec3 v = bst_quat_rotate(q, bst_scene_source_direction(source, u));
        if (!bst_camera_project(camera, bst_scene_source_seen(camera, source, v), &path->x[k],
                                &path->y[k])) {
            return false;
        }
        if (k > 0) {
            path->light[k - 1] = after - before;
        }
        before = after;
    }
    return true;
}

/* A straight piece of uniform light. */
typedef struct piece {
    double light, x, y;            /* x, y: its middle */
    double step_x, step_y, length; /* length 0: as a point */
    double near2;                  /* square of the distance from which its light counts */
} piece;

/* Light per px^2 of a piece at the place (dx, dy) from its middle, blurred by a Gaussian of
 * variance 2 v. scale: 0.5 / sqrt(v); peak: sqrt(16 pi v). */
static double light_of_piece(const piece *p, double dx, double dy, double v, double scale,
                             double peak) {
    if (p->length == 0.0) {
        return p->light * exp(-0.25 * (dx * dx + dy * dy) / v) / (4.0 * BST_PI * v);
    }
    double along = (dx * p->step_x + dy * p->step_y) / p->length;
    double across = (dy * p->step_x - dx * p->step_y) / p->length, half = 0.5 * p->length;
    return p->light / p->length * exp(-0.25 * across * across / v) / peak *
           (erf((half - along) * scale) + erf((half + along) * scale));
}

/* The integral of the squared light of a path that is blurred by a Gaussian of variance v: the sum
 * over its pieces of their light times the light of all pieces, blurred twice, in their middles. */
static double squared_light_of_path(const light_path *path, double v) {
    const double far = 12.0 * sqrt(v); /* where a point's light has fallen to exp(-36) */
    const double scale = 0.5 / sqrt(v), peak = sqrt(16.0 * BST_PI * v);
    piece pieces[MOST_PIECES];
    double total = 0.0, sum = 0.0;
    for (int k = 0; k < path->count; k++) {
        double dx = path->x[k + 1] - path->x[k], dy = path->y[k + 1] - path->y[k];
        double length2 = dx * dx + dy * dy, length = sqrt(length2), near = 0.5 * length + far;
        pieces[k] = (piece){.light = path->light[k],
                            .x = path->x[k] + 0.5 * dx,
                            .y = path->y[k] + 0.5 * dy,
                            .step_x = dx,
                            .step_y = dy,
                            /* shorter ones as points: right to 0.09 / 96 */
                            .length = length2 < 0.09 * v ? 0.0 : length,
                            .near2 = near * near};
    }
    for (int k = 0; k < path->count; k++) {
        double light = 0.0;
        for (int i = 0; i < path->count; i++) {
            double dx = pieces[k].x - pieces[i].x, dy = pieces[k].y - pieces[i].y;
            if (dx * dx + dy * dy < pieces[i].near2) {
                light += light_of_piece(&pieces[i], dx, dy, v, scale, peak);
            }
        }
        total += path->light[k];
        sum += path->light[k] * light;
    }
    return total > 0.0 ? sum / (total * total) : NAN;
}

/* Variance that the bend of a path adds to that of its straight part, both axes: the bend is its
 * part in 6 s^2 - 1/2, where s is the time from -1/2 to 1/2. */
static double bend_variance(const light_path *path, const bst_scene_image_moments *m) {
    double x = 0.0, y = 0.0, square = 0.0;
    for (int k = 0; k <= path->count; k++) {
        double s = (double)k / path->count - 0.5, bent = 6.0 * s * s - 0.5;
        double weight = k == 0 || k == path->count ? 0.5 : 1.0;
        x += weight * bent * (path->x[k] - m->x_mean - s * m->dx);
        y += weight * bent * (path->y[k] - m->y_mean - s * m->dy);
        square += weight * bent * bent;
    }
    return 0.2 * (x * x + y * y) / (square * square);
}

/* Variance of the light along the straight pieces of a path, both axes. */
static double variance_of_path(const light_path *path) {
    double total = 0.0, x = 0.0, y = 0.0, square = 0.0;
    for (int k = 0; k < path->count; k++) {
        double ax = path->x[k] - path->x[0], bx = path->x[k + 1] - path->x[0];
        double ay = path->y[k] - path->y[0], by = path->y[k + 1] - path->y[0];
        total += path->light[k];
        x += 0.5 * path->light[k] * (ax + bx);
        y += 0.5 * path->light[k] * (ay + by);
        square +=
            path->light[k] / 3.0 * (ax * ax + ax * bx + bx * bx + ay * ay + ay * by + by * by);
    }
    return (square - (x * x + y * y) / total) / total;
}

double bst_scene_image_squared_path(const bst_camera *camera, const bst_los_track *track,
                                    const bst_scene_source *source, const double u01[2],
                                    const bst_scene_image_moments *moments, double excess_px2,
                                    double variance_px2) {
    enum { COARSE = 8, FEWEST = 20 };
    const double piece_px = 3.0;
    light_path path;
    /* few positions suffice to detect strong jitter about a straight streak: its noise in the bend
     * of nine positions adds a ninth of its variance */
    const double bent = 0.05, noise = 0.25;
    if (!path_in_pieces(camera, track, source, u01, COARSE, &path)) {
        return NAN;
    }
    if (roughness(path.x, path.y, COARSE + 1) > 0.5 * excess_px2 &&
        bend_variance(&path, moments) < bent * variance_px2 + noise * excess_px2) {
        return NAN;
    }
    /* pieces of a straight path with these moments */
    double wanted = sqrt(12.0 * (moments->xx + moments->yy)) / piece_px;
    int count = wanted < FEWEST ? FEWEST : wanted < MOST_PIECES ? (int)wanted : MOST_PIECES;
    if (!path_in_pieces(camera, track, source, u01, count, &path)) {
        return NAN;
    }
    double jitter = roughness(path.x, path.y, count + 1);
    if (jitter > 0.25 * excess_px2) {
        double missing = moments->xx + moments->yy - variance_of_path(&path);
        variance_px2 += 0.5 * fmin(fmax(missing, 0.0), jitter);
    }
    return squared_light_of_path(&path, variance_px2);
}

void bst_image_spread(double variance, const bst_scene_image_moments *m, double dx, double dy,
                      double *along, double *across) {
    double length = hypot(dx, dy);
    double c = length > 0.0 ? dx / length : 1.0, s = length > 0.0 ? dy / length : 0.0;
    double uu = m->xx * c * c + 2.0 * m->xy * c * s + m->yy * s * s;
    *along = sqrt(variance + fmax(uu - length * length / 12.0, 0.0));
    *across = sqrt(variance + fmax(m->xx + m->yy - uu, 0.0));
}

double bst_image_blur(const bst_camera *camera, const bst_scene_source *source,
                      const bst_scene_image_moments *m, double dx, double dy, double *along,
                      double *across) {
    double psf = bst_camera_psf_sigma_px(camera), sigma;
    if (camera->psf && !bst_psf_gaussian(camera->psf, &sigma) && isfinite(m->x_mean)) {
        psf = bst_psf_coloured_fwhm_px(camera->psf, source->colour, m->x_mean, m->y_mean) /
              BST_FWHM_PER_SIGMA;
    }
    double variance = psf * psf + 1.0 / 12.0;
    bst_image_spread(variance, m, dx, dy, along, across);
    return variance;
}
