#include <assert.h>
#include <string.h>

#include "boresight/camera.h"

/* The map u -> u L(r^2) + 2 u (q.u) + q r^2 with q = (p2, p1) is the gradient of a potential: its
 * Jacobian is symmetric. Where it is positive definite on a disc, the map is injective. Radial
 * part: eigenvalues d(r L)/dr along r and L across; the tangential part lowers them by 6 |q| r at
 * most. */

enum { DEGREE = 6, SAMPLES = 256 };

/* margin beyond the farthest corner for the limits of the local scale */
static const double FIELD_MARGIN = 1.1;
/* tangent of the largest field angle considered (89.4 degrees) */
static const double WIDEST = 100.0;

typedef struct plane {
    double x, y;
} plane;

static double horner(const double *c, int degree, double x) {
    double v = c[degree];
    for (int i = degree - 1; i >= 0; i--) {
        v = v * x + c[i];
    }
    return v;
}

/* Roots with a change of sign on (0, most], ascending: between consecutive extrema a polynomial is
 * monotonic, so that bisection finds them. */
static int roots(const double *c, int degree, double most, double *out) {
    if (degree == 0) {
        return 0;
    }
    double slope[DEGREE], at[DEGREE + 1];
    for (int i = 0; i < degree; i++) {
        slope[i] = (i + 1) * c[i + 1];
    }
    int extrema = roots(slope, degree - 1, most, at), count = 0;
    at[extrema] = most;
    double low = 0.0;
    for (int i = 0; i <= extrema; i++) {
        double a = low, b = at[i];
        bool rising = horner(c, degree, b) > 0.0;
        low = b;
        if ((horner(c, degree, a) > 0.0) == rising) {
            continue;
        }
        for (int k = 0; k < 200; k++) {
            double middle = 0.5 * (a + b);
            if ((horner(c, degree, middle) > 0.0) == rising) {
                b = middle;
            } else {
                a = middle;
            }
        }
        out[count++] = a;
    }
    return count;
}

/* Radial distortion factor at a squared radius. */
static double radial(const bst_camera_distortion *d, double s) {
    return 1.0 + s * (d->k1 + s * (d->k2 + s * d->k3));
}
static double radial_slope(const bst_camera_distortion *d, double s) {
    return 1.0 + s * (3.0 * d->k1 + s * (5.0 * d->k2 + s * 7.0 * d->k3));
}

/* Applies radial and tangential distortion to tangent-plane coordinates. */
static plane distort(const bst_camera_distortion *d, plane u) {
    double s = u.x * u.x + u.y * u.y, l = radial(d, s), xy = 2.0 * u.x * u.y;
    return (plane){u.x * l + d->p1 * xy + d->p2 * (s + 2.0 * u.x * u.x),
                   u.y * l + d->p1 * (s + 2.0 * u.y * u.y) + d->p2 * xy};
}

/* xx, xy, yy of the symmetric Jacobian. */
static void slopes(const bst_camera_distortion *d, plane u, double j[3]) {
    double s = u.x * u.x + u.y * u.y, l = radial(d, s);
    double by_s = 2.0 * (d->k1 + s * (2.0 * d->k2 + s * 3.0 * d->k3));
    j[0] = l + u.x * u.x * by_s + 2.0 * d->p1 * u.y + 6.0 * d->p2 * u.x;
    j[1] = u.x * u.y * by_s + 2.0 * (d->p1 * u.x + d->p2 * u.y);
    j[2] = l + u.y * u.y * by_s + 6.0 * d->p1 * u.y + 2.0 * d->p2 * u.x;
}

/* Newton's method for distort(u) = target from *u. False, *u undefined: it left the domain or did
 * not converge. */
static bool newton(const bst_camera *c, plane target, plane *u) {
    const bst_camera_distortion *d = &c->distortion;
    double domain2 = c->geometry.domain * c->geometry.domain;
    double size = hypot(target.x, target.y), before = INFINITY;
    for (int k = 0; k < 30; k++) {
        plane f = distort(d, *u);
        double rx = target.x - f.x, ry = target.y - f.y, rest = hypot(rx, ry);
        /* rounding level: the residual no longer decreases */
        if (rest == 0.0 || (rest <= 1e-10 * size && rest >= 0.5 * before)) {
            return true;
        }
        double j[3];
        slopes(d, *u, j);
        double det = j[0] * j[2] - j[1] * j[1];
        if (!(det > 0.0)) {
            return rest <= 1e-12 * size;
        }
        plane next = {u->x + (j[2] * rx - j[1] * ry) / det, u->y + (j[0] * ry - j[1] * rx) / det};
        if (!(next.x * next.x + next.y * next.y <= domain2)) {
            return rest <= 1e-12 * size;
        }
        *u = next;
        before = rest;
    }
    return false;
}

/* Inverts the distortion: Newton's method along the ray from the boresight, in steps that are
 * halved until it converges. The ray stays inside the domain with a positive definite Jacobian, so
 * that small enough steps exist. */
static plane undistort(const bst_camera *c, plane target) {
    double size = hypot(target.x, target.y);
    /* the Jacobian is singular at the border */
    double most = c->geometry.image_radius * (1.0 - 1e-13);
    if (!(size <= most)) {
        double f = isfinite(size) ? most / size : 0.0;
        target = (plane){target.x * f, target.y * f};
    }
    plane u = {0.0, 0.0};
    double done = 0.0, step = 1.0;
    for (int k = 0; k < 400 && done < 1.0; k++) {
        double to = fmin(done + step, 1.0);
        plane aim = {to * target.x, to * target.y}, next = u;
        if (newton(c, aim, &next)) {
            u = next;
            done = to;
            step *= 2.0;
        } else {
            step *= 0.5;
        }
    }
    return u;
}

/* Rotates coordinates by the camera's rotation angle. */
static plane to_focal(const bst_camera *c, double a, double b) {
    double cs = c->geometry.cos_rotation, sn = c->geometry.sin_rotation;
    return (plane){cs * a + sn * b, cs * b - sn * a};
}

bool bst_camera_project_general(const bst_camera *c, bst_vec3 v, double *x_px, double *y_px) {
    if (!(v.z > 0.0)) {
        return false;
    }
    plane u = to_focal(c, v.x / v.z, v.y / v.z);
    double domain = c->geometry.domain;
    if (!(u.x * u.x + u.y * u.y <= domain * domain)) {
        return false;
    }
    plane p = distort(&c->distortion, u);
    double f = 1.0 / bst_camera_scale_rad(c);
    *x_px = bst_camera_centre_x(c) + p.x * f;
    *y_px = bst_camera_centre_y(c) + p.y * f;
    return true;
}

bool bst_camera_beyond_fold(const bst_camera *c, bst_vec3 v, double margin_px) {
    double r = hypot(v.x, v.y) / v.z;
    return v.z > 0.0 && r > c->geometry.domain &&
           r <= c->geometry.domain + margin_px * bst_camera_scale_rad(c);
}

bst_vec3 bst_camera_unproject_general(const bst_camera *c, double x_px, double y_px) {
    double s = bst_camera_scale_rad(c);
    plane u = undistort(
        c, (plane){(x_px - bst_camera_centre_x(c)) * s, (y_px - bst_camera_centre_y(c)) * s});
    double cs = c->geometry.cos_rotation, sn = c->geometry.sin_rotation;
    return bst_vec3_unit((bst_vec3){cs * u.x - sn * u.y, sn * u.x + cs * u.y, 1.0});
}

void bst_camera_unproject_points(const bst_camera *c, const double *x_px, const double *y_px,
                                 int count, bst_vec3 *v_cam) {
    assert(c && count >= 0);
    for (int i = 0; i < count; i++) {
        v_cam[i] = bst_camera_unproject(c, x_px[i], y_px[i]);
    }
}

void bst_camera_jacobian(const bst_camera *c, bst_vec3 v, double k[2][2]) {
    if (!c->geometry.general) {
        k[0][0] = k[1][1] = 1.0;
        k[0][1] = k[1][0] = 0.0;
        return;
    }
    double j[3], cs = c->geometry.cos_rotation, sn = c->geometry.sin_rotation;
    slopes(&c->distortion, to_focal(c, v.x / v.z, v.y / v.z), j);
    k[0][0] = j[0] * cs - j[1] * sn;
    k[0][1] = j[0] * sn + j[1] * cs;
    k[1][0] = j[1] * cs - j[2] * sn;
    k[1][1] = j[1] * sn + j[2] * cs;
}

double bst_camera_reach_rad(const bst_camera *c, bst_vec3 centre, double x0, double y0, double x1,
                            double y1, double margin_px) {
    enum { SIDE = 16 };
    double reach = 0.0, gap = 0.0;
    bst_vec3 last = bst_camera_unproject(c, x0, y0);
    for (int i = 1; i <= 4 * SIDE; i++) {
        double u = (double)(i % SIDE) / SIDE;
        double x = i < SIDE       ? x0 + u * (x1 - x0)
                   : i < 2 * SIDE ? x1
                   : i < 3 * SIDE ? x1 - u * (x1 - x0)
                                  : x0;
        double y = i < SIDE       ? y0
                   : i < 2 * SIDE ? y0 + u * (y1 - y0)
                   : i < 3 * SIDE ? y1
                                  : y1 - u * (y1 - y0);
        if (i == 4 * SIDE) {
            y = y0;
        }
        bst_vec3 v = bst_camera_unproject(c, x, y);
        reach = fmax(reach, bst_vec3_angle(centre, v));
        gap = fmax(gap, bst_vec3_angle(last, v));
        last = v;
    }
    double far_x = fmax(x1 - bst_camera_centre_x(c), bst_camera_centre_x(c) - x0);
    double far_y = fmax(y1 - bst_camera_centre_y(c), bst_camera_centre_y(c) - y0);
    bool folds = hypot(far_x, far_y) * bst_camera_scale_rad(c) > c->geometry.image_radius;
    /* light from beyond the fold may overlap */
    return reach + gap + (folds ? margin_px * bst_camera_scale_rad(c) : 0.0);
}

void bst_camera_field_px(const bst_camera *c, double *width_px, double *height_px) {
    enum { SIDE = 16 };
    double cx = bst_camera_centre_x(c) + 0.5, cy = bst_camera_centre_y(c) + 0.5;
    double w = (double)c->width_px, h = (double)c->height_px;
    *width_px = 2.0 * fmin(cx, w - cx);
    *height_px = 2.0 * fmin(cy, h - cy);
    if (!c->geometry.general) {
        return;
    }
    double scale = bst_camera_scale_rad(c), half_x = INFINITY, half_y = INFINITY;
    for (int i = 0; i <= SIDE; i++) {
        for (int side = 0; side < 2; side++) {
            double x = side * w - cx, y = side * h - cy;
            double u = w * i / SIDE - cx, v = h * i / SIDE - cy;
            half_x = fmin(half_x, fabs(undistort(c, (plane){x * scale, v * scale}).x));
            half_y = fmin(half_y, fabs(undistort(c, (plane){u * scale, y * scale}).y));
        }
    }
    *width_px = 2.0 * half_x / scale;
    *height_px = 2.0 * half_y / scale;
}

/* Pixel position of corner i of the sensor. */
static void corner(const bst_camera *c, int i, double *x, double *y) {
    *x = i & 1 ? (double)c->width_px - 0.5 : -0.5;
    *y = i & 2 ? (double)c->height_px - 0.5 : -0.5;
}

double bst_camera_half_diagonal_rad(const bst_camera *c) {
    double angle = 0.0;
    for (int i = 0; i < 4; i++) {
        double x, y;
        corner(c, i, &x, &y);
        bst_vec3 v = bst_camera_unproject(c, x, y);
        angle = fmax(angle, atan2(hypot(v.x, v.y), v.z));
    }
    return angle;
}

/* Limits of scale and curvature up to the farthest corner, with a margin. */
static void bound_field(bst_camera *c) {
    bst_camera_geometry *g = &c->geometry;
    const bst_camera_distortion *d = &c->distortion;
    double q = hypot(d->p1, d->p2);
    double reach = fmin(FIELD_MARGIN * tan(bst_camera_half_diagonal_rad(c)), g->domain);
    g->stretch = g->shrink = 1.0;
    for (int i = 0; i <= SAMPLES; i++) {
        double r = reach * i / SAMPLES, s = r * r;
        double along = radial_slope(d, s), across = radial(d, s), bend = 6.0 * q * r;
        g->stretch = fmax(g->stretch, fmax(along, across) + bend);
        g->shrink = fmin(g->shrink, fmin(along, across) - bend);
        double second = r * (6.0 * d->k1 + s * (20.0 * d->k2 + s * 42.0 * d->k3));
        g->curvature = fmax(g->curvature, fabs(second) + 6.0 * q);
    }
    g->shrink = fmax(g->shrink, 0.0);
}

bst_status bst_camera_prepare(bst_ctx *ctx, bst_camera *c) {
    const bst_camera_distortion *d = &c->distortion;
    bst_camera_geometry *g = &c->geometry;
    memset(g, 0, sizeof *g);
    double q = hypot(d->p1, d->p2);
    bool distorted = bst_camera_distorted(c);
    if (!distorted && c->rotation_deg == 0.0) {
        return BST_OK;
    }
    double turn = c->rotation_deg * BST_DEG_RAD;
    g->cos_rotation = cos(turn);
    g->sin_rotation = sin(turn);
    double scale = bst_camera_scale_rad(c), farthest = 0.0;
    for (int i = 0; i < 4; i++) {
        double x, y;
        corner(c, i, &x, &y);
        farthest = fmax(farthest, hypot(x - bst_camera_centre_x(c), y - bst_camera_centre_y(c)));
    }
    double most = fmax(WIDEST, 10.0 * farthest * scale);
    g->domain = g->image_radius = INFINITY;
    if (distorted) {
        /* scaled to the farthest corner: coefficients are of order one */
        double unit = farthest * scale, u2 = unit * unit, u4 = u2 * u2, u6 = u4 * u2;
        const double along[DEGREE + 1] = {
            1.0, -6.0 * q * unit, 3.0 * d->k1 * u2, 0.0, 5.0 * d->k2 * u4, 0.0, 7.0 * d->k3 * u6};
        const double across[DEGREE + 1] = {1.0, -6.0 * q * unit, d->k1 * u2, 0.0, d->k2 * u4,
                                           0.0, d->k3 * u6};
        double found[DEGREE + 1];
        g->domain = most / unit;
        if (roots(along, DEGREE, most / unit, found) > 0) {
            g->domain = fmin(g->domain, found[0]);
        }
        if (roots(across, DEGREE, most / unit, found) > 0) {
            g->domain = fmin(g->domain, found[0]);
        }
        g->domain *= unit;
        double s = g->domain * g->domain;
        g->image_radius = g->domain * radial(d, s) - 3.0 * q * s;
    }
    if (!(g->image_radius >= farthest * scale)) {
        double reach = g->image_radius / scale;
        memset(g, 0, sizeof *g);
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "the image folds %.1f px from the boresight, inside the sensor, whose "
                        "farthest corner lies at %.1f px: weaken the coefficients (k1 %g, k2 %g, "
                        "k3 %g, p1 %g, p2 %g) or use fewer pixels",
                        reach, farthest, d->k1, d->k2, d->k3, d->p1, d->p2);
    }
    g->general = true;
    bound_field(c);
    return BST_OK;
}
