#include "gimbal/jitter/jitter_noise.h"

#include <math.h>
#include <string.h>

#include "boresight/vec.h"

enum { N = BST_NOISE_POINTS, HALF = N / 2 };

#define NODES_PER_PERIOD 20.0

void bst_jitter_noise_init(bst_jitter_noise *noise, const bst_jitter_density *density,
                           double top_hz, double dt_s, bst_rng_key key) {
    memset(noise, 0, sizeof *noise);
    noise->key = key;
    noise->dt_s = dt_s;
    noise->stride = 1;
    double top = fmin(top_hz, bst_jitter_density_top_hz(density));
    while (top > 0.0 && NODES_PER_PERIOD * top * dt_s * 2.0 * (double)noise->stride <= 1.0 &&
           noise->stride < ((int64_t)1 << 40)) {
        noise->stride *= 2;
    }
    double bin_hz = 1.0 / (N * dt_s * (double)noise->stride);
    for (int k = 0; k < HALF; k++) {
        double low = fmax(0.0, (k - 0.5) * bin_hz), high = fmin(top_hz, (k + 0.5) * bin_hz);
        double share = high > low ? bst_jitter_density_integral(density, low, high) : 0.0;
        /* bin 0 is shared by both signs */
        noise->gain[k] = sqrt(k == 0 ? 2.0 * share : share) * sqrt(0.5);
        noise->lines = share > 0.0 ? k : noise->lines;
    }
    for (int i = 0; i < HALF; i++) {
        noise->turn_re[i] = cos(2.0 * BST_PI * i / N);
        noise->turn_im[i] = sin(2.0 * BST_PI * i / N);
    }
    for (int i = 0; i < N; i++) {
        noise->window[i] = sin(BST_PI * (i + 0.5) / N);
    }
    noise->block[0] = noise->block[1] = noise->interval = -1;
}

static unsigned reversed(unsigned i) {
    unsigned r = 0;
    for (unsigned bit = 1; bit < N; bit <<= 1) {
        r = (r << 1) | (i & 1u);
        i >>= 1;
    }
    return r;
}

/* Inverse FFT: sum of x[k] exp(2 pi i j k / N), input in bit-reversed order (Cooley and Tukey,
 * radix 2). */
static void transform(const bst_jitter_noise *noise, double *re, double *im) {
    for (int span = 1; span < N; span *= 2) {
        int skip = HALF / span;
        for (int from = 0; from < N; from += 2 * span) {
            for (int i = 0; i < span; i++) {
                double wr = noise->turn_re[i * skip], wi = noise->turn_im[i * skip];
                int a = from + i, b = a + span;
                double tr = re[b] * wr - im[b] * wi, ti = re[b] * wi + im[b] * wr;
                re[b] = re[a] - tr;
                im[b] = im[a] - ti;
                re[a] += tr;
                im[a] += ti;
            }
        }
    }
}

static void make_block(bst_jitter_noise *noise, int64_t block) {
    int slot = (int)(block & 1);
    double *re = noise->x[slot], *im = noise->y[slot];
    memset(re, 0, sizeof noise->x[slot]);
    memset(im, 0, sizeof noise->y[slot]);
    for (int k = -noise->lines; k <= noise->lines; k++) {
        double gain = noise->gain[k < 0 ? -k : k];
        if (gain > 0.0) {
            double pair[2];
            unsigned bin = (unsigned)(k + N) % N;
            bst_rng_normal2(noise->key, (uint64_t)block, bin, pair);
            unsigned at = reversed(bin);
            re[at] = gain * pair[0];
            im[at] = gain * pair[1];
        }
    }
    transform(noise, re, im);
    noise->block[slot] = block;
}

/* Noise at a node; block b starts at node b * HALF. The first half block is never requested
 * (bst_jitter_noise_at), because it has no overlap. */
static void noise_at_node(bst_jitter_noise *noise, int64_t at, double out[2]) {
    int64_t block = at / HALF;
    int i = (int)(at % HALF);
    out[0] = out[1] = 0.0;
    for (int back = 0; back < 2; back++) {
        int64_t b = block - back;
        int slot = (int)(b & 1);
        if (noise->block[slot] != b) {
            make_block(noise, b);
        }
        int place = i + back * HALF;
        out[0] += noise->window[place] * noise->x[slot][place];
        out[1] += noise->window[place] * noise->y[slot][place];
    }
}

void bst_jitter_noise_at(bst_jitter_noise *noise, int64_t n, double out[2]) {
    /* starts at the second block, so that every node lies in two blocks and has predecessors */
    int64_t first = HALF + 2;
    if (noise->stride == 1) {
        noise_at_node(noise, first + n, out);
        return;
    }
    int64_t interval = n / noise->stride;
    if (interval != noise->interval) {
        double p[4][2];
        for (int i = 0; i < 4; i++) {
            noise_at_node(noise, first + interval - 1 + i, p[i]);
        }
        for (int a = 0; a < 2; a++) {
            /* cubic Lagrange interpolation through -1, 0, 1, 2 */
            double d1 = p[1][a], second = p[2][a] - 2.0 * p[1][a] + p[0][a];
            double third = p[3][a] - 3.0 * p[2][a] + 3.0 * p[1][a] - p[0][a];
            noise->cubic[a][0] = d1;
            noise->cubic[a][1] = p[2][a] - p[1][a] - 0.5 * second - third / 6.0;
            noise->cubic[a][2] = 0.5 * second;
            noise->cubic[a][3] = third / 6.0;
        }
        noise->interval = interval;
    }
    double t = (double)(n - interval * noise->stride) / (double)noise->stride;
    for (int a = 0; a < 2; a++) {
        const double *c = noise->cubic[a];
        out[a] = c[0] + t * (c[1] + t * (c[2] + t * c[3]));
    }
}
