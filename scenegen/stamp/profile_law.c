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

enum { MOST_NODES = BST_LAW_MOST_DEGREE + 1, CENTRAL_PX = 4, ERROR_POINTS = 64 };

/* Chebyshev nodes: their places in [-1, 1], and the polynomials T(k) there. */
typedef struct chebyshev_nodes {
    int count;
    double place[MOST_NODES], polynomial[MOST_NODES][MOST_NODES]; /* [k][node] */
} chebyshev_nodes;

static void set_nodes(chebyshev_nodes *nodes, int count) {
    assert(count > 0 && count <= MOST_NODES);
    nodes->count = count;
    for (int n = 0; n < count; n++) {
        double angle = BST_PI * (n + 0.5) / count;
        nodes->place[n] = cos(angle);
        for (int k = 0; k < count; k++) {
            nodes->polynomial[k][n] = cos(k * angle);
        }
    }
}

/* Nodes of a law's three orders. */
static void set_orders(chebyshev_nodes nodes[3], int degree) {
    const int counts[3] = {degree + 1, BST_LAW_FIRST, BST_LAW_SECOND};
    for (int order = 0; order < 3; order++) {
        set_nodes(&nodes[order], counts[order]);
    }
}

/* Powers of g, |g| <= 1, of the interpolation polynomial through Chebyshev nodes. */
static void interpolate(const chebyshev_nodes *nodes, double sigma_px, int d, int order,
                        double *power) {
    const int count = nodes->count;
    double value[MOST_NODES], chebyshev[MOST_NODES],
        before[MOST_NODES + 1] = {0}, now[MOST_NODES + 1] = {1.0};
    for (int n = 0; n < count; n++) {
        value[n] = share(sigma_px, 0.5 * (nodes->place[n] + 1.0), d, order);
    }
    for (int k = 0; k < count; k++) {
        chebyshev[k] = power[k] = 0.0;
        for (int n = 0; n < count; n++) {
            chebyshev[k] += value[n] * nodes->polynomial[k][n];
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

/* The law near the centre, of pixels 1 to CENTRAL_PX. */
typedef struct central_law {
    double sigma_px;
    int counts[3];
    double power[CENTRAL_PX][3][MOST_NODES];
} central_law;

static void set_central(central_law *law, double sigma_px, int degree) {
    chebyshev_nodes nodes[3];
    set_orders(nodes, degree);
    law->sigma_px = sigma_px;
    for (int order = 0; order < 3; order++) {
        law->counts[order] = nodes[order].count;
        for (int d = 1; d <= CENTRAL_PX; d++) {
            interpolate(&nodes[order], sigma_px, d, order, law->power[d - 1][order]);
        }
    }
}

/* Error of the law for a widened PSF, relative to the central share. Above `limit` it is only a
 * lower bound: the search ends at the first point where it exceeds the limit. */
static double law_error(const central_law *law, double widening, double limit) {
    double worst = 0.0, peak = share(law->sigma_px, 0.0, 0, 0);
    for (int d = 1; d <= CENTRAL_PX; d++) {
        for (int k = 0; k <= ERROR_POINTS; k++) {
            double g = k / (0.5 * ERROR_POINTS) - 1.0, value = 0.0;
            for (int order = 2; order >= 0; order--) {
                value =
                    value * widening + value_of(law->power[d - 1][order], law->counts[order], g);
            }
            double truth = share(law->sigma_px * sqrt(1.0 + widening), 0.5 * (g + 1.0), d, 0);
            worst = fmax(worst, fabs(value - truth));
            if (worst / peak > limit) {
                return worst / peak;
            }
        }
    }
    return worst / peak;
}

double bst_profile_law_error(double sigma_px, int degree) {
    central_law law;
    set_central(&law, sigma_px, degree);
    return law_error(&law, 0.0, INFINITY);
}

int bst_profile_law_degree(double sigma_px) {
    for (int degree = 5; degree <= BST_LAW_MOST_DEGREE; degree += 2) {
        central_law law;
        set_central(&law, sigma_px, degree);
        if (law_error(&law, 0.0, 0.1 * BST_LAW_ERROR) < 0.1 * BST_LAW_ERROR) {
            return degree;
        }
    }
    return 0;
}

double bst_profile_law_widest(double sigma_px, int degree) {
    double widest = 0.1;
    central_law law;
    set_central(&law, sigma_px, degree);
    while (widest > 1e-6 && law_error(&law, widest, BST_LAW_ERROR) > BST_LAW_ERROR) {
        widest *= 0.8;
    }
    return widest;
}

int bst_profile_law_floats(int degree, int reach) {
    return reach * (degree + 1 + BST_LAW_FIRST + BST_LAW_SECOND);
}

void bst_profile_law(double sigma_px, int degree, int reach, float *law) {
    assert(law && sigma_px > 0.0 && degree % 2 == 1 && reach >= 0);
    chebyshev_nodes nodes[3];
    set_orders(nodes, degree);
    for (int d = 1; d <= reach; d++) {
        for (int order = 0; order < 3; order++) {
            double power[MOST_NODES];
            interpolate(&nodes[order], sigma_px, d, order, power);
            for (int i = 0; i < nodes[order].count; i++) {
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
