#include "sim/analysis/characterize/neighbour_covariance.h"

#include <assert.h>
#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdlib.h>

static const int neighbours[BST_NEIGHBOURS][2] = {{1, 0},  {2, 0}, {-2, 1}, {-1, 1},
                                                  {0, 1},  {1, 1}, {2, 1},  {-2, 2},
                                                  {-1, 2}, {0, 2}, {1, 2},  {2, 2}};
/* Standard deviations beyond which a neighbour shares noise: those that touch (all effects begin
 * with them), and the others. One sensor in 160 by chance. */
static const double CERTAIN_BESIDE = 3.0, CERTAIN = 4.0;

void bst_neighbour_covariance_add(bst_neighbour_covariance *c, const float *difference, int width,
                                  int height) {
    assert(c && difference && width > 2 && height > 2);
    double square = 0.0, count = 0.0;
    for (size_t i = 0; i < (size_t)width * (size_t)height; i++) {
        if (!isnan(difference[i])) {
            square += (double)difference[i] * (double)difference[i];
            count += 1.0;
        }
    }
    for (int n = 0; n < BST_NEIGHBOURS; n++) {
        int dx = neighbours[n][0], dy = neighbours[n][1];
        int from = dx < 0 ? -dx : 0, to = dx > 0 ? width - dx : width;
        double sum = 0.0, products = 0.0;
        for (int y = 0; y + dy < height; y++) {
            const float *a = difference + (size_t)y * (size_t)width;
            const float *b = a + (ptrdiff_t)dy * width + dx;
            for (int x = from; x < to; x++) {
                double p = (double)a[x] * (double)b[x];
                sum += isnan(p) ? 0.0 : p;
                products += !isnan(p);
            }
        }
        double of_mean = dy == 0 && count > 0.0 ? square / count / width : 0.0;
        double value = products > 0.0 ? 0.5 * (sum / products + of_mean) : 0.0;
        c->covariance[n] = c->count + count > 0.0
                               ? (c->count * c->covariance[n] + count * value) / (c->count + count)
                               : 0.0;
    }
    c->count += count;
}

double bst_neighbour_covariance_along(const bst_neighbour_covariance *c, int rows) {
    int n = 0;
    while (n < BST_NEIGHBOURS && !(neighbours[n][0] == 0 && neighbours[n][1] == rows)) {
        n++;
    }
    assert(n < BST_NEIGHBOURS);
    return c->covariance[n];
}

void bst_shared_noise_add(bst_shared_noise *sum, double weight,
                          const bst_neighbour_covariance *light, double light_variance,
                          const bst_neighbour_covariance *dark, double dark_variance) {
    assert(sum && light && dark);
    if (light->count > 0.0 && dark->count > 0.0 && isfinite(light_variance + dark_variance)) {
        double error2 = light_variance * light_variance / light->count +
                        dark_variance * dark_variance / dark->count;
        for (int n = 0; n < BST_NEIGHBOURS; n++) {
            sum->covariance[n] += weight * (light->covariance[n] - dark->covariance[n]);
            sum->error2[n] += weight * weight * error2;
        }
        sum->excess += weight * (light_variance - dark_variance);
    }
}

bst_sensor_estimate bst_shared_noise_factor(const bst_shared_noise *sum) {
    assert(sum);
    double shared = 0.0, error2 = 0.0;
    for (int n = 0; n < BST_NEIGHBOURS; n++) {
        bool beside = abs(neighbours[n][0]) + neighbours[n][1] == 1;
        double limit = (beside ? CERTAIN_BESIDE : CERTAIN) * sqrt(sum->error2[n]);
        if (fabs(sum->covariance[n]) > limit) {
            shared += 2.0 * sum->covariance[n];
            error2 += 4.0 * sum->error2[n];
        }
    }
    return sum->excess > 0.0
               ? (bst_sensor_estimate){1.0 + shared / sum->excess, sqrt(error2) / sum->excess}
               : (bst_sensor_estimate){1.0, 0.0};
}
