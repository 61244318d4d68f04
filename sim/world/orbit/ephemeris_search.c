#include "sim/world/orbit/ephemeris_search.h"

#include <math.h>

#include "sim/astro/bodies.h"
#include "sim/core/simd.h"

/* Rounding of the first pass, in single precision: of the distance from the axis the square root of
 * some 1e-7 of the range, rad; and m. */
static const double ROUNDING_RAD = 1.5e-3, ROUNDING_M = 100.0;
/* error of a velocity times the longest time from the table, where a position's error is 1 km */
static const double VELOCITY_ERROR_M = 1000.0;

enum { BLOCK = 256, GROUP = 8 };

size_t bst_ephemeris_rows_bytes(int objects) {
    return ((size_t)objects + 1) * (3 * sizeof(double) + 7 * sizeof(float));
}

bst_ephemeris_rows bst_ephemeris_rows_in(void *memory, int objects) {
    const size_t rows = (size_t)objects + 1;
    double *places = memory;
    float *others = (float *)(void *)(places + 3 * rows);
    return (bst_ephemeris_rows){
        .x_m = places,
        .y_m = places + rows,
        .z_m = places + 2 * rows,
        .speed_mps = others,
        .near_m = {others + rows, others + 2 * rows, others + 3 * rows},
        .velocity_mps = {others + 4 * rows, others + 5 * rows, others + 6 * rows}};
}

void bst_ephemeris_rows_set(const bst_ephemeris_rows *rows, int object, const double place_m[3],
                            const double velocity_mps[3], double speed_mps) {
    rows->x_m[object] = place_m[0];
    rows->y_m[object] = place_m[1];
    rows->z_m[object] = place_m[2];
    const bool unknown = isnan(place_m[0]);
    rows->speed_mps[object] = unknown ? INFINITY : (float)speed_mps; /* it may be anywhere */
    for (int i = 0; i < 3; i++) {
        rows->near_m[i][object] = unknown ? 0.0f : (float)place_m[i];
        rows->velocity_mps[i][object] = velocity_mps ? (float)velocity_mps[i] : NAN;
    }
}

/* A cone in single precision. */
typedef struct cone_pass {
    float apex_m[3], axis[3], sin_half, cos_half, span_s, sure_m, least_mps;
} cone_pass;

/* Distance of n objects from the surface of the cone, minus their uncertainty. Behind the apex it
 * is a lower limit. */
BST_CLONES_256 static void distances(const bst_ephemeris_rows *rows, int begin, int n,
                                     const cone_pass *cone, float *outside_m) {
    const float *px = rows->near_m[0] + begin, *py = rows->near_m[1] + begin,
                *pz = rows->near_m[2] + begin, *speed = rows->speed_mps + begin;
    const cone_pass c = *cone;
    for (int i = 0; i < n; i++) {
        float x = px[i] - c.apex_m[0], y = py[i] - c.apex_m[1], z = pz[i] - c.apex_m[2];
        float along = x * c.axis[0] + y * c.axis[1] + z * c.axis[2];
        float square = x * x + y * y + z * z - along * along;
        float across = sqrtf(square > 0.0f ? square : 0.0f);
        float least = speed[i] < 0.0f ? speed[i] : c.least_mps;
        float fastest = speed[i] > least ? speed[i] : least;
        outside_m[i] = across * c.cos_half - along * c.sin_half - fastest * c.span_s - c.sure_m;
    }
}

/* True if one of a group of objects may be in the cone. */
static bool any_inside(const float outside_m[GROUP]) {
    float least = outside_m[0];
    for (int i = 1; i < GROUP; i++) {
        least = outside_m[i] < least ? outside_m[i] : least;
    }
    return !(least > 0.0f);
}

/* False if an object of known velocity is certainly outside of the cone. */
static bool may_be_in(const bst_ephemeris_rows *rows, int i, const bst_ephemeris_search *s,
                      double sin_half, double cos_half) {
    const bst_vec3 v = {(double)rows->velocity_mps[0][i], (double)rows->velocity_mps[1][i],
                        (double)rows->velocity_mps[2][i]};
    bst_vec3 p = {rows->x_m[i], rows->y_m[i], rows->z_m[i]};
    const double r2 = bst_vec3_dot(p, p), t = s->after_s;
    const double fall = 0.5 * BST_EARTH_MU_M3PS2 * t * t / (r2 * sqrt(r2));
    p = bst_vec3_sub(bst_vec3_axpy(bst_vec3_scale(p, 1.0 - fall), t, v), s->cone.apex_m);
    const double along = bst_vec3_dot(p, s->cone.axis);
    const double across = sqrt(fmax(bst_vec3_dot(p, p) - along * along, 0.0));
    const double fastest = (double)fmaxf(rows->speed_mps[i], s->least_mps);
    const double sure =
        fastest * s->cone.half_span_s + s->error_m + VELOCITY_ERROR_M + s->cone.apex_span_m;
    return !(across * cos_half - along * sin_half > sure); /* also NAN */
}

int bst_ephemeris_rows_near(const bst_ephemeris_rows *rows, int objects,
                            const bst_ephemeris_search *s, int *indices) {
    const double half = s->cone.half_angle_rad + s->shift_rad, wide = half + ROUNDING_RAD;
    const double sin_half = sin(half), cos_half = cos(half);
    const cone_pass pass = {
        .apex_m = {(float)s->cone.apex_m.x, (float)s->cone.apex_m.y, (float)s->cone.apex_m.z},
        .axis = {(float)s->cone.axis.x, (float)s->cone.axis.y, (float)s->cone.axis.z},
        .sin_half = (float)sin(wide),
        .cos_half = (float)cos(wide),
        .span_s = (float)(fabs(s->after_s) + s->cone.half_span_s),
        .sure_m = (float)(s->error_m + s->cone.apex_span_m + ROUNDING_M),
        .least_mps = s->least_mps};
    float outside_m[BLOCK + GROUP];
    int count = 0;
    for (int begin = 0; begin < objects; begin += BLOCK) {
        const int n = objects - begin < BLOCK ? objects - begin : BLOCK;
        distances(rows, begin, n, &pass, outside_m);
        for (int i = n; i < n + GROUP; i++) {
            outside_m[i] = INFINITY;
        }
        for (int k = 0; k < n; k += GROUP) {
            const bool any = any_inside(outside_m + k);
            for (int i = k; any && i < k + GROUP; i++) {
                if (!(outside_m[i] > 0.0f) && may_be_in(rows, begin + i, s, sin_half, cos_half)) {
                    indices[count++] = begin + i;
                }
            }
        }
    }
    return count;
}
