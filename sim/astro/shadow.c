#include "sim/astro/earth_limb.h"

/* curvature limit: a flatter limb is treated as a circle of radius 1000 rad, which deviates from a
 * straight line by 1e-8 rad over the Sun's disc */
#define FLATTEST 1e-3

/* Area of a circle's segment: radius r, half its opening angle. */
static double segment_area(double r, double half_angle) {
    return r * r * (half_angle - 0.5 * sin(2.0 * half_angle));
}

/* Area common to circles of radii a and b with centres b + gap apart, |a - b| < b + gap < a + b.
 * The half chord uses Heron's formula, which stays precise near tangency. */
static double lens_area(double a, double b, double gap) {
    double c = b + gap;
    double heron = (a + b + c) * (a - gap) * (a + gap) * (b + c - a);
    double half_chord = sqrt(fmax(heron, 0.0)) / (2.0 * c);
    double from_a = (a * a + gap * (c + b)) / (2.0 * c);
    return segment_area(a, atan2(half_chord, from_a)) +
           segment_area(b, atan2(half_chord, c - from_a));
}

double bst_earth_limb_share(const bst_earth_limb *limb, double disc) {
    double b = 1.0 / fmax(limb->curvature, FLATTEST);
    if (limb->beyond >= disc) {
        return 1.0;
    }
    if (limb->beyond <= -disc && disc <= b) {
        return 0.0;
    }
    double centre = b + limb->beyond;
    if (centre <= disc - b) {
        return 1.0 - (b / disc) * (b / disc);
    }
    double share = 1.0 - lens_area(disc, b, limb->beyond) / (BST_PI * disc * disc);
    return fmin(fmax(share, 0.0), 1.0);
}

/* With A the matrix of the grown ellipsoid x.A x = 1, the ray from p along d meets it where
 *   N(d) = -p.A d - sqrt((p.A p - 1) d.A d) > 0.
 * N = 0 is the limb. */
typedef struct form {
    bst_vec3 p;    /* A p */
    double inside; /* sqrt(p.A p - 1) */
    bst_vec3 pole;
    double across, along; /* eigenvalues of A: at right angles to the pole, and along it */
} form;

static bst_vec3 times(const form *f, bst_vec3 v) {
    double along = bst_vec3_dot(v, f->pole) * (f->along - f->across);
    return bst_vec3_axpy(bst_vec3_scale(v, f->across), along, f->pole);
}

/* N, its gradient and second derivatives with respect to x and y of d = z + x e1 + y e2. */
typedef struct slope {
    double n, x, y, xx, xy, yy;
} slope;

static slope slope_at(const form *f, bst_vec3 d, bst_vec3 e1, bst_vec3 e2) {
    bst_vec3 u = times(f, d);
    double q = sqrt(bst_vec3_dot(d, u)), w = f->inside / q;
    double u1 = bst_vec3_dot(u, e1), u2 = bst_vec3_dot(u, e2), w3 = w / (q * q);
    return (slope){.n = -bst_vec3_dot(f->p, d) - f->inside * q,
                   .x = -bst_vec3_dot(f->p, e1) - w * u1,
                   .y = -bst_vec3_dot(f->p, e2) - w * u2,
                   .xx = w3 * u1 * u1 - w * bst_vec3_dot(e1, times(f, e1)),
                   .xy = w3 * u1 * u2 - w * bst_vec3_dot(e1, times(f, e2)),
                   .yy = w3 * u2 * u2 - w * bst_vec3_dot(e2, times(f, e2))};
}

bool bst_earth_limb_at(bst_vec3 position_m, bst_vec3 pole, double height_m, bst_vec3 towards,
                       bst_earth_limb *out) {
    /* lengths in units of the position: N is an angle */
    double r = bst_vec3_norm(position_m);
    double a = (BST_EARTH_RADIUS_M + height_m) / r;
    double b = (BST_EARTH_RADIUS_M * (1.0 - BST_EARTH_FLATTENING) + height_m) / r;
    form f = {.pole = pole, .across = 1.0 / (a * a), .along = 1.0 / (b * b)};
    bst_vec3 up = bst_vec3_scale(position_m, 1.0 / r);
    f.p = times(&f, up);
    f.inside = sqrt(fmax(bst_vec3_dot(up, f.p) - 1.0, 0.0));
    /* search direction to the limb: radial in the sky */
    bst_vec3 across = bst_vec3_axpy(up, -bst_vec3_dot(up, towards), towards);
    if (bst_vec3_dot(across, across) < 1e-24) {
        across = bst_vec3_perpendicular(towards);
    }
    bst_vec3 e1 = bst_vec3_scale(bst_vec3_unit(across), -1.0);
    bst_vec3 e2 = bst_vec3_cross(towards, e1);
    double off = bst_vec3_angle(bst_vec3_scale(up, -1.0), towards) - asin(fmin(a, 1.0));
    if (off > 1.5) {
        return false;
    }
    double x = tan(fmax(off, -1.5));
    slope s = {0};
    for (int i = 0; i < 20; i++) {
        s = slope_at(&f, bst_vec3_axpy(towards, x, e1), e1, e2);
        double step = s.x != 0.0 ? -s.n / s.x : INFINITY;
        if (!(fabs(x + step) < 1e3)) {
            return false;
        }
        x += step;
        if (fabs(step) < 1e-15) {
            break;
        }
    }
    if (!(fabs(s.n) < 1e-9 * hypot(s.x, s.y))) {
        return false;
    }
    double g2 = s.x * s.x + s.y * s.y, g = sqrt(g2);
    /* Distance of the origin from (x, 0) on the limb, to second order along the tangent: the limb's
     * normal deviates from e1 by the order of the flattening. */
    double normal = x * s.x / g, tangent = x * s.y / g;
    out->curvature = -(s.xx * s.y * s.y - 2.0 * s.xy * s.x * s.y + s.yy * s.x * s.x) / (g2 * g);
    double square = tangent * tangent, k = out->curvature;
    /* circle of curvature k: its centre is 1 / k inside along the normal */
    double gap = normal + 0.5 * k * (normal * normal + square);
    out->beyond = 2.0 * gap / (1.0 + sqrt(fmax(1.0 + 2.0 * k * gap, 0.0)));
    return true;
}

bool bst_earth_far_from_shadow(bst_vec3 position_m, bst_vec3 to_sun, double sun_distance_m,
                               double height_m, double *sunlit) {
    double along = -bst_vec3_dot(position_m, to_sun) / sun_distance_m;
    if (!(along > 0.0) || !(sun_distance_m > 200.0 * BST_SUN_RADIUS_M)) {
        return false;
    }
    double across2 = bst_vec3_dot(position_m, position_m) - along * along;
    /* half-angle of the cones: the Sun's radius and the Earth's over the distance, and margins of a
     * tenth, and of 0.1 % of the Earth's radius; 0.995 is more than its flattening takes away */
    double cone = 1.1 * BST_SUN_RADIUS_M / sun_distance_m * along;
    double outer = 1.001 * (BST_EARTH_RADIUS_M + height_m) + cone;
    double inner = 0.995 * BST_EARTH_RADIUS_M - cone;
    *sunlit = across2 > outer * outer ? 1.0 : 0.0;
    return *sunlit > 0.0 || (inner > 0.0 && across2 < inner * inner);
}

double bst_astro_sun_fraction(bst_vec3 position_m, bst_vec3 sun_m, bst_vec3 pole) {
    bst_vec3 to_sun = bst_vec3_sub(sun_m, position_m);
    double distance = bst_vec3_norm(position_m), sun_distance = bst_vec3_norm(to_sun), sunlit;
    if (distance < BST_EARTH_RADIUS_M && bst_earth_depth(position_m, pole) < 0.0) {
        return 0.0;
    }
    if (sun_distance <= BST_SUN_RADIUS_M || sun_distance < distance) {
        return 1.0; /* the Sun is nearer than the Earth: no occultation */
    }
    if (bst_vec3_dot(position_m, to_sun) > 0.0 && distance > 1.0001 * BST_EARTH_RADIUS_M &&
        sun_distance > 200.0 * BST_SUN_RADIUS_M) {
        return 1.0; /* the Earth subtends less than half of the sky, on the other side */
    }
    if (bst_earth_far_from_shadow(position_m, to_sun, sun_distance, 0.0, &sunlit)) {
        return sunlit;
    }
    bst_earth_limb limb;
    if (!bst_earth_limb_at(position_m, pole, 0.0, bst_vec3_scale(to_sun, 1.0 / sun_distance),
                           &limb)) {
        return bst_vec3_dot(position_m, to_sun) > 0.0 ? 1.0 : 0.0;
    }
    double sine = BST_SUN_RADIUS_M / sun_distance;
    return bst_earth_limb_share(&limb, sine / sqrt(1.0 - sine * sine));
}

double bst_astro_earth_limb_angle(bst_vec3 position_m, bst_vec3 pole, bst_vec3 direction) {
    bst_earth_limb limb;
    if (bst_earth_depth(position_m, pole) < 0.0) {
        return -BST_PI;
    }
    return bst_earth_limb_at(position_m, pole, 0.0, direction, &limb) ? atan(limb.beyond) : BST_PI;
}

bool bst_astro_earth_occults(bst_vec3 a_m, bst_vec3 b_m, bst_vec3 pole) {
    bst_vec3 near = bst_earth_unit_sphere(a_m, pole, 0.0);
    bst_vec3 far = bst_earth_unit_sphere(b_m, pole, 0.0);
    if (bst_vec3_dot(far, far) < bst_vec3_dot(near, near)) {
        bst_vec3 swap = near; /* measure from the nearer end, for small rounding errors */
        near = far;
        far = swap;
    }
    bst_vec3 along = bst_vec3_sub(far, near);
    double length2 = bst_vec3_dot(along, along);
    double s = length2 > 0.0 ? -bst_vec3_dot(near, along) / length2 : 0.0;
    bst_vec3 closest = bst_vec3_axpy(near, fmin(fmax(s, 0.0), 1.0), along);
    return bst_vec3_norm(closest) < 1.0 - BST_EARTH_TOUCH;
}
