#include "sim/astro/bodies.h"

/* Area of a circle's segment: radius r, half its opening angle. */
static double segment_area(double r, double half_angle) {
    return r * r * (half_angle - 0.5 * sin(2.0 * half_angle));
}

/* Area common to circles of radii a and b whose centres are c apart, |a - b| < c < a + b. The half
 * chord comes from Heron's product of differences, which stays exact where the circles touch. */
static double lens_area(double a, double b, double c) {
    double heron = (a + b + c) * (b + c - a) * (a + c - b) * (a + b - c);
    double half_chord = sqrt(fmax(heron, 0.0)) / (2.0 * c);
    double from_a = (a * a + (c - b) * (c + b)) / (2.0 * c);
    return segment_area(a, atan2(half_chord, from_a)) +
           segment_area(b, atan2(half_chord, c - from_a));
}

double bst_sun_fraction(bst_vec3 position_m, bst_vec3 sun_m) {
    bst_vec3 to_sun = bst_vec3_sub(sun_m, position_m);
    double distance = bst_vec3_norm(position_m), sun_distance = bst_vec3_norm(to_sun);
    if (distance < BST_EARTH_RADIUS_M) {
        return 0.0;
    }
    if (sun_distance <= BST_SUN_RADIUS_M || sun_distance < distance) {
        return 1.0; /* the Sun is nearer than the Earth, which cannot cover it */
    }
    if (bst_vec3_dot(position_m, to_sun) > 0.0 && distance > 1.0001 * BST_EARTH_RADIUS_M &&
        sun_distance > 200.0 * BST_SUN_RADIUS_M) {
        return 1.0; /* the Earth fills less than a half of the sky, on the other side */
    }
    double a = asin(BST_SUN_RADIUS_M / sun_distance);
    double b = asin(BST_EARTH_RADIUS_M / distance);
    double c = bst_vec3_angle(bst_vec3_scale(position_m, -1.0), to_sun);
    if (c >= a + b) {
        return 1.0;
    }
    if (c <= b - a) {
        return 0.0;
    }
    if (c <= a - b) {
        return 1.0 - (b / a) * (b / a);
    }
    double fraction = 1.0 - lens_area(a, b, c) / (BST_PI * a * a);
    return fmin(fmax(fraction, 0.0), 1.0);
}

/* Coordinates in which the ellipsoid is the unit sphere. */
static bst_vec3 to_unit_sphere(bst_vec3 gcrf_m, const bst_mat3 *itrf_from_gcrf) {
    bst_vec3 p = bst_vec3_scale(bst_mat3_mul_vec(itrf_from_gcrf, gcrf_m), 1.0 / BST_EARTH_RADIUS_M);
    p.z /= 1.0 - BST_EARTH_FLATTENING;
    return p;
}

bool bst_earth_occults(bst_vec3 a_m, bst_vec3 b_m, const bst_mat3 *itrf_from_gcrf) {
    const double touch = 1.5e-9; /* depth in Earth radii, 1 cm */
    bst_vec3 near = to_unit_sphere(a_m, itrf_from_gcrf);
    bst_vec3 far = to_unit_sphere(b_m, itrf_from_gcrf);
    if (bst_vec3_dot(far, far) < bst_vec3_dot(near, near)) {
        bst_vec3 swap = near; /* measured from the nearer end, rounding is that of its distance */
        near = far;
        far = swap;
    }
    bst_vec3 along = bst_vec3_sub(far, near);
    double length2 = bst_vec3_dot(along, along);
    double s = length2 > 0.0 ? -bst_vec3_dot(near, along) / length2 : 0.0;
    bst_vec3 closest = bst_vec3_axpy(near, fmin(fmax(s, 0.0), 1.0), along);
    return bst_vec3_norm(closest) < 1.0 - touch;
}
