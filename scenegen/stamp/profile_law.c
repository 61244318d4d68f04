#include "scenegen/stamp/profile_law.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>

#include "boresight/vec.h"
#include "scenegen/kernels/scene_shared.h"
#include "scenegen/reference.h"

/* Light share of pixel d and its derivatives by the widening over order!, order 0 to 2. By the heat
 * equation these are derivatives by position, those of the Gaussian at the pixel's edges. */
static double share(double sigma_px, double f, int d, int order) {
    if (order == 0) {
        return bst_reference_pixel_share(f, sigma_px, d);
    }
    double value = 0.0;
    for (int side = -1; side <= 1; side += 2) {
        double u = (d - f + 0.5 * side) / sigma_px;
        double density = exp(-0.5 * u * u) / sqrt(2.0 * BST_PI);
        double slope = order == 1 ? -0.5 * u : -0.125 * u * (u * u - 3.0);
        value += side * slope * density;
    }
    return value;
}

/* Powers of g, |g| <= 1, of the interpolation polynomial through `count` Chebyshev nodes. */
static void interpolate(double sigma_px, int d, int order, int count, double *power) {
    double chebyshev[BST_LAW_MOST_DEGREE + 1],
        before[BST_LAW_MOST_DEGREE + 2] = {0}, now[BST_LAW_MOST_DEGREE + 2] = {1.0};
    for (int k = 0; k < count; k++) {
        chebyshev[k] = power[k] = 0.0;
        for (int n = 0; n < count; n++) {
            double angle = BST_PI * (n + 0.5) / count;
            chebyshev[k] += share(sigma_px, 0.5 * (cos(angle) + 1.0), d, order) * cos(k * angle);
        }
        chebyshev[k] *= (k == 0 ? 1.0 : 2.0) / count;
    }
    for (int k = 0; k < count; k++) { /* T(k + 1) = 2 g T(k) - T(k - 1) */
        for (int i = 0; i <= k; i++) {
            power[i] += chebyshev[k] * now[i];
        }
        for (int i = k + 1; i >= 0; i--) {
            double next = (i > 0 ? (k == 0 ? 1.0 : 2.0) * now[i - 1] : 0.0) - before[i];
            before[i] = now[i];
            now[i] = next;
        }
    }
}

static double value_of(const double *power, int count, double g) {
    double v = 0.0;
    for (int i = count - 1; i >= 0; i--) {
        v = v * g + power[i];
    }
    return v;
}

/* Error of the law near the centre for a widened PSF, relative to the central share. */
static double law_error(double sigma_px, int degree, double widening) {
    const int counts[3] = {degree + 1, BST_LAW_FIRST, BST_LAW_SECOND};
    double worst = 0.0;
    for (int d = 1; d <= 4; d++) {
        double power[3][BST_LAW_MOST_DEGREE + 1];
        for (int order = 0; order < 3; order++) {
            interpolate(sigma_px, d, order, counts[order], power[order]);
        }
        for (int k = 0; k <= 64; k++) {
            double g = k / 32.0 - 1.0, law = 0.0;
            for (int order = 2; order >= 0; order--) {
                law = law * widening + value_of(power[order], counts[order], g);
            }
            double truth = share(sigma_px * sqrt(1.0 + widening), 0.5 * (g + 1.0), d, 0);
            worst = fmax(worst, fabs(law - truth));
        }
    }
    return worst / share(sigma_px, 0.0, 0, 0);
}

double bst_profile_law_error(double sigma_px, int degree) {
    return law_error(sigma_px, degree, 0.0);
}

int bst_profile_law_degree(double sigma_px) {
    for (int degree = 5; degree <= BST_LAW_MOST_DEGREE; degree += 2) {
        if (bst_profile_law_error(sigma_px, degree) < 0.1 * BST_LAW_ERROR) {
            return degree;
        }
    }
    return 0;
}

double bst_profile_law_widest(double sigma_px, int degree) {
    double widest = 0.1;
    while (widest > 1e-6 && law_error(sigma_px, degree, widest) > BST_LAW_ERROR) {
        widest *= 0.8;
    }
    return widest;
}

int bst_profile_law_floats(int degree, int reach) {
    return reach * (degree + 1 + BST_LAW_FIRST + BST_LAW_SECOND);
}

void bst_profile_law(double sigma_px, int degree, int reach, float *law) {
    assert(law && sigma_px > 0.0 && degree % 2 == 1 && reach >= 0);
    const int counts[3] = {degree + 1, BST_LAW_FIRST, BST_LAW_SECOND};
    for (int d = 1; d <= reach; d++) {
        for (int order = 0; order < 3; order++) {
            double power[BST_LAW_MOST_DEGREE + 1];
            interpolate(sigma_px, d, order, counts[order], power);
            for (int i = 0; i < counts[order]; i++) {
                *law++ = (float)power[i];
            }
        }
    }
}

bst_status bst_profile_law_buffer(bst_ctx *ctx, cl_context context, double sigma_px, int degree,
                                  int reach, cl_mem *out) {
    if (degree > BST_LAW_MOST_DEGREE || (degree > 0 && degree % 2 == 0)) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "psf_degree is %d: allowed are 0 and the odd numbers up to %d", degree,
                        BST_LAW_MOST_DEGREE);
    }
    size_t count = BST_LAW_HEAD + (size_t)(degree > 0 ? bst_profile_law_floats(degree, reach) : 0);
    float *law = calloc(count, sizeof *law);
    if (!law) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the PSF's profile");
    }
    law[0] = (float)(1.0 / (sqrt(2.0) * sigma_px));
    if (degree > 0) {
        law[1] = (float)bst_profile_law_widest(sigma_px, degree);
        bst_profile_law(sigma_px, degree, reach, law + BST_LAW_HEAD);
    }
    cl_int code;
    *out = clCreateBuffer(context, CL_MEM_READ_ONLY | CL_MEM_COPY_HOST_PTR, count * sizeof *law,
                          law, &code);
    free(law);
    return bst_device_check(ctx, code, "allocating the PSF's profile");
}
