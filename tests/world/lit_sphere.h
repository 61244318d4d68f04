/* The light of a lit sphere by sums over its surface: elements of area, each with the light that
 * falls on it and the cosine under which it is seen. */
#ifndef BST_TESTS_WORLD_LIT_SPHERE_H
#define BST_TESTS_WORLD_LIT_SPHERE_H

#include "boresight/vec.h"
#include "tests/test_support.h"

/* Mean direction beside the middle, second moments and total of the light, by elements of the
 * surface. */
typedef struct moments {
    bst_vec3 mean;
    double along_xx, along_yy,
        along_xy; /* about the middle, on two axes across the line of sight */
    double total;
} moments;

/* No axis is like another. */
static const bst_vec3 ahead = {0.48, -0.64, 0.6};
static const bst_vec3 cross_x = {0.8, 0.6, 0.0}; /* at right angles to `ahead`, as cross_y */
static const bst_vec3 cross_y = {-0.36, 0.48, 0.8};

static inline void moments_add(moments *m, bst_vec3 offset, double light) {
    double x = bst_vec3_dot(offset, cross_x), y = bst_vec3_dot(offset, cross_y);
    m->mean = bst_vec3_axpy(m->mean, light, offset);
    m->along_xx += light * x * x;
    m->along_yy += light * y * y;
    m->along_xy += light * x * y;
    m->total += light;
}

static inline void moments_close(moments *m) {
    m->mean = bst_vec3_scale(m->mean, 1.0 / m->total);
    m->along_xx /= m->total;
    m->along_yy /= m->total;
    m->along_xy /= m->total;
}

enum { LIT_RINGS = 700, LIT_SPOKES = 1400 };

/* Elements of a sphere of radius k at distance 1. light: unit, from the sphere; NULL: it glows
 * evenly. */
static inline moments lit_surface(double k, const bst_vec3 *light) {
    moments m = {.total = 0};
    for (int i = 0; i < LIT_RINGS; i++) {
        double c = 1 - 2 * (i + 0.5) / LIT_RINGS, s = sqrt(1 - c * c);
        for (int j = 0; j < LIT_SPOKES; j++) {
            double phi = 2 * BST_PI * (j + 0.5) / LIT_SPOKES;
            bst_vec3 n = {s * cos(phi), s * sin(phi), c};
            bst_vec3 place = bst_vec3_axpy(ahead, k, n); /* from the eye */
            double range = bst_vec3_norm(place), seen = -bst_vec3_dot(n, place) / range;
            double lit = light ? bst_vec3_dot(n, *light) : 1;
            if (seen > 0 && lit > 0) {
                bst_vec3 at = bst_vec3_scale(place, 1 / bst_vec3_dot(place, ahead));
                moments_add(&m, bst_vec3_sub(at, ahead), lit * seen / (range * range));
            }
        }
    }
    moments_close(&m);
    return m;
}

#endif
