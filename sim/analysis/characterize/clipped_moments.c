#include "sim/analysis/characterize/clipped_moments.h"

#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "sim/core/compare.h"

/* Standard deviation of a normal distribution over its median absolute deviation. */
static const double SIGMA_PER_MAD = 1.482602218505602;

double bst_sorted_median(const float *v, size_t n) {
    return n == 0 ? NAN : 0.5 * ((double)v[(n - 1) / 2] + (double)v[n / 2]);
}

/* Bits of a number so that the order of whole numbers is that of the numbers. */
static uint32_t key_of(float value) {
    uint32_t word;
    memcpy(&word, &value, sizeof word);
    return word ^ (word >> 31 ? 0xffffffffU : 0x80000000U);
}

/* Sorts by a byte of the keys, from `from` to `to`. */
static void sort_by_byte(const float *from, float *to, size_t n, int shift) {
    size_t places[257] = {0};
    for (size_t i = 0; i < n; i++) {
        places[(key_of(from[i]) >> shift & 255U) + 1]++;
    }
    for (int k = 0; k < 256; k++) {
        places[k + 1] += places[k];
    }
    for (size_t i = 0; i < n; i++) {
        to[places[key_of(from[i]) >> shift & 255U]++] = from[i];
    }
}

void bst_sort_floats(float *values, size_t count) {
    float *other = count > 64 ? malloc(count * sizeof *other) : NULL;
    if (!other) {
        qsort(values, count, sizeof *values, bst_compare_floats);
        return;
    }
    sort_by_byte(values, other, count, 0);
    sort_by_byte(other, values, count, 8);
    sort_by_byte(values, other, count, 16);
    sort_by_byte(other, values, count, 24);
    free(other);
}

/* Sorts values after moving those that are NAN behind the others; returns the number of others. */
static size_t sort_finite(float *v, size_t n) {
    size_t kept = 0;
    for (size_t i = 0; i < n; i++) {
        if (!isnan(v[i])) {
            float value = v[i];
            v[i] = v[kept];
            v[kept++] = value;
        }
    }
    bst_sort_floats(v, kept);
    return kept;
}

/* First of sorted values that is not below a limit. */
static size_t first_from(const float *v, size_t n, double limit) {
    size_t low = 0, high = n;
    while (low < high) {
        size_t middle = low + (high - low) / 2;
        if ((double)v[middle] < limit) {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    return low;
}

/* Quantile of sorted values, where equal ones are spread over +-1/2 if they are whole numbers. */
static double spread_quantile(const float *v, size_t n, double share) {
    double rank = share * (double)n;
    size_t at = (size_t)rank;
    at = at < n ? at : n - 1;
    double value = (double)v[at];
    if (value != floor(value)) {
        return value;
    }
    size_t first = first_from(v, n, value), next = first_from(v, n, value + 0.5);
    return value - 0.5 + (rank - (double)first) / (double)(next > first ? next - first : 1);
}

double bst_robust_sigma(float *values, size_t count) {
    size_t n = sort_finite(values, count);
    if (n < 4) {
        return NAN;
    }
    /* of a distribution that is symmetric, half the distance of the quartiles is the deviation */
    return 0.5 * SIGMA_PER_MAD *
           (spread_quantile(values, n, 0.75) - spread_quantile(values, n, 0.25));
}

bst_clipped_moments bst_clipped_moments_of(float *values, size_t count, double clip) {
    size_t n = sort_finite(values, count), first = 0, last = n;
    bst_clipped_moments m = {NAN, NAN, NAN, NAN, 0};
    if (n < 2) {
        return m;
    }
    double sigma = bst_robust_sigma(values, n);
    m.mean = bst_sorted_median(values, n);
    m.variance = sigma > 0.0 ? sigma * sigma : 1.0;
    for (int turn = 0; turn < 30; turn++) {
        double reach = clip * sqrt(m.variance);
        m.low = m.mean - reach;
        m.high = m.mean + reach;
        size_t from = first_from(values, n, m.low), to = first_from(values, n, m.high);
        if (turn > 0 && from == first && to == last) {
            break;
        }
        first = from;
        last = to;
        double sum = 0.0, sum2 = 0.0, at = m.mean;
        for (size_t i = first; i < last; i++) {
            double d = (double)values[i] - at;
            sum += d;
            sum2 += d * d;
        }
        m.count = last - first;
        if (m.count < 2) {
            break;
        }
        m.mean = at + sum / (double)m.count;
        m.variance = (sum2 - sum * sum / (double)m.count) / (double)(m.count - 1);
    }
    return m;
}

bst_sensor_estimate bst_root_estimate(bst_sensor_estimate variance) {
    if (isnan(variance.value)) {
        return (bst_sensor_estimate){NAN, NAN};
    }
    double value = sqrt(fmax(variance.value, 0.0));
    /* near 0 the error of the root is that of a variance of one standard error */
    double floor_value = sqrt(fmax(fabs(variance.value), variance.sigma));
    return (bst_sensor_estimate){
        value, floor_value > 0.0 ? 0.5 * variance.sigma / floor_value : variance.sigma};
}

bst_sensor_estimate bst_mean_estimate(const double *values, int count) {
    double sum = 0.0, sum2 = 0.0;
    int n = 0;
    for (int i = 0; i < count; i++) {
        if (isfinite(values[i])) {
            sum += values[i];
            n++;
        }
    }
    double mean = n > 0 ? sum / n : NAN;
    for (int i = 0; i < count; i++) {
        if (isfinite(values[i])) {
            sum2 += (values[i] - mean) * (values[i] - mean);
        }
    }
    return (bst_sensor_estimate){mean, n > 1 ? sqrt(sum2 / (n - 1) / n) : NAN};
}

bst_sensor_estimate bst_sensor_ratio(bst_sensor_estimate above, bst_sensor_estimate below) {
    double ratio = above.value / below.value;
    return (bst_sensor_estimate){ratio,
                                 hypot(above.sigma, ratio * below.sigma) / fabs(below.value)};
}
