#include "imgproc/detect/low_rank.h"

#include <math.h>
#include <string.h>

enum { ITERATIONS = 24 };

/* A vector that orthogonalisation shrinks below this share of its length is rounding error. */
static const double NOTHING = 1e-10;

static double dot(const double *a, const double *b, int n) {
    double sum = 0.0;
    for (int i = 0; i < n; i++) {
        sum += a[i] * b[i];
    }
    return sum;
}

/* Gram-Schmidt orthonormalisation of the rows; linearly dependent rows become 0. */
static void orthonormalise(double *v, int count, int side) {
    for (int t = 0; t < count; t++) {
        double *row = v + t * side, before = sqrt(dot(row, row, side));
        for (int again = 0; again < 2; again++) {
            for (int u = 0; u < t; u++) {
                double share = dot(row, v + u * side, side);
                for (int i = 0; i < side; i++) {
                    row[i] -= share * v[u * side + i];
                }
            }
        }
        double left = sqrt(dot(row, row, side));
        double scale = left > NOTHING * before ? 1.0 / left : 0.0;
        for (int i = 0; i < side; i++) {
            row[i] *= scale;
        }
    }
}

/* Projects an image on the row functions: out[t][i] = sum over j of v[t][j] image[j][i]. */
static void project_rows(const double *v, int count, const double *image, int side, double *out) {
    memset(out, 0, (size_t)count * (size_t)side * sizeof *out);
    for (int j = 0; j < side; j++) {
        for (int t = 0; t < count; t++) {
            double by = v[t * side + j];
            for (int i = 0; i < side; i++) {
                out[t * side + i] += by * image[j * side + i];
            }
        }
    }
}

/* One subspace iteration: v becomes the sum over images of image image^T v. */
static void subspace_step(const double *images, int planes, int side, int most, double *v,
                          double *next, double *across) {
    memset(next, 0, (size_t)most * (size_t)side * sizeof *next);
    for (int p = 0; p < planes; p++) {
        const double *image = images + (size_t)p * (size_t)side * (size_t)side;
        project_rows(v, most, image, side, across);
        for (int t = 0; t < most; t++) {
            for (int j = 0; j < side; j++) {
                next[t * side + j] += dot(image + j * side, across + t * side, side);
            }
        }
    }
    memcpy(v, next, (size_t)most * (size_t)side * sizeof *v);
    orthonormalise(v, most, side);
}

int bst_low_rank(const bst_low_rank_images *given, int most, double tolerance, double *down,
                 double *across, double *work) {
    const double *images = given->items;
    const int planes = given->planes, side = given->side;
    /* start vectors need only a component along each singular vector */
    unsigned state = 1;
    for (int i = 0; i < most * side; i++) {
        state = state * 1664525u + 1013904223u;
        down[i] = (double)(state >> 8) / 16777216.0 - 0.5;
    }
    orthonormalise(down, most, side);
    for (int k = 0; k < ITERATIONS; k++) {
        subspace_step(images, planes, side, most, down, work, across);
    }
    int terms = 1;
    for (int p = 0; p < planes; p++) {
        const double *image = images + (size_t)p * (size_t)side * (size_t)side;
        project_rows(down, most, image, side, across);
        double left = dot(image, image, side * side), least = tolerance * left;
        for (int t = 0; t < most; t++) {
            left -= dot(across + t * side, across + t * side, side);
            if (left > least && t + 2 > terms) {
                terms = t + 2 < most ? t + 2 : most;
            }
        }
    }
    for (int p = 0; p < planes; p++) {
        project_rows(down, terms, images + (size_t)p * (size_t)side * (size_t)side, side,
                     across + (size_t)p * (size_t)terms * (size_t)side);
    }
    return terms;
}
