#include "scenegen/fourier/psf_sensitivity.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "boresight/vec.h"
#include "sim/core/fft.h"

/* LATTICE: frequencies per axis over the band. SIDE: image samples, four per period of the highest
 * frequency. */
enum { LATTICE = 64, SIDE = 128 };

/* Peak derivatives of order 2, 4 and 6 of a Gaussian with sigma 1, relative to its peak. */
static const double GAUSSIAN[3] = {1.0, 3.0, 15.0};

/* The light that a derivative falls on is that of a path: smoothed along it at least as by a group
 * of nodes, 2.5 sigma long. Variance of that length, in sigma squared. */
#define SMOOTHED (BST_STREAK_SIGMAS * BST_STREAK_SIGMAS / 12.0)

typedef struct measuring {
    bst_fft_complex_f32 *room; /* [SIDE][SIDE] */
    bst_fft *inverse;
    double step; /* of the frequencies, cycles/px */
    double otf[LATTICE * LATTICE][2];
    /* over the peak: of the point, and of a path; one over its square root */
    float light[BST_FLANKS][SIDE * SIDE], quiet[BST_FLANKS][SIDE * SIDE];
    bst_light_flank flank[BST_FLANKS][BST_NODE_DIRECTIONS][3];
    bst_light_flank smooth_flank[BST_NODE_DIRECTIONS][BST_SMOOTH_STEPS - 1][2];
    bst_light_flank row_flank[BST_NODE_DIRECTIONS][BST_ROW_LENGTHS];
    /* of the frequencies about each step of a row along the direction, across it */
    double across[BST_ROW_STEPS + 1][SIDE][2];
} measuring;

/* At frequencies of whole cycles per px the limit: its sign does not matter to a modulus, but to
 * an image: (-1)^(f (binning - 1)). */
double bst_psf_binned(double f, int binning) {
    double s = sin(BST_PI * f), whole = cos(BST_PI * (binning - 1) * f);
    return fabs(s) < 1e-9 ? whole : sin(BST_PI * binning * f) / (binning * s);
}

static double frequency(const measuring *m, int i) {
    return (i - LATTICE / 2) * m->step;
}

static float *room_at(const measuring *m, int i, int j) {
    return m->room[((j - LATTICE / 2 + SIDE) % SIDE) * SIDE + (i - LATTICE / 2 + SIDE) % SIDE];
}

static double power_of(double x, int n) {
    double power = 1.0;
    for (; n > 0; n--) {
        power *= x;
    }
    return power;
}

/* Images of two derivatives of even order along a direction, as the real and the imaginary part:
 * both are real. The first is smoothed along the direction, the second if both are derivatives. */
static void make_images(measuring *m, double angle, double smoothed_px2, const int order[2]) {
    memset(m->room, 0, sizeof *m->room * SIDE * SIDE);
    for (int k = 0; k < LATTICE * LATTICE; k++) {
        int i = k % LATTICE, j = k / LATTICE;
        if (i == 0 || j == 0) { /* its opposite frequency is not on the lattice */
            continue;
        }
        double w = 2.0 * BST_PI * (frequency(m, i) * cos(angle) + frequency(m, j) * sin(angle));
        double w2 = w * w, smooth = exp(-0.5 * smoothed_px2 * w2);
        double a = smooth * power_of(w2, order[0] / 2), b = power_of(w2, order[1] / 2);
        b *= order[0] > 0 ? smooth : 1.0;
        const double *v = m->otf[k];
        float *z = room_at(m, i, j);
        z[0] = (float)(a * v[0] - b * v[1]);
        z[1] = (float)(a * v[1] + b * v[0]);
    }
    bst_fft_run(m->inverse);
}

/* Greatest value near sample k by parabolas along x and y: samples are up to an eighth of the
 * shortest period from it. */
static double greatest_near(const measuring *m, int k, int part) {
    int x = k % SIDE, y = k / SIDE;
    double here = fabs((double)m->room[k][part]), more = 0.0;
    for (int axis = 0; axis < 2; axis++) {
        int before = axis ? (y + SIDE - 1) % SIDE * SIDE + x : y * SIDE + (x + SIDE - 1) % SIDE;
        int after = axis ? (y + 1) % SIDE * SIDE + x : y * SIDE + (x + 1) % SIDE;
        double sign = m->room[k][part] < 0.0F ? -1.0 : 1.0;
        double low = sign * (double)m->room[before][part],
               high = sign * (double)m->room[after][part];
        double bend = 2.0 * here - low - high;
        more += bend > 0.0 ? (high - low) * (high - low) / (8.0 * bend) : 0.0;
    }
    return here + more;
}

/* Index of the sample of the greatest absolute value of an image. */
static int greatest_of(const measuring *m, int part) {
    int greatest = 0;
    for (int k = 0; k < SIDE * SIDE; k++) {
        greatest = fabsf(m->room[k][part]) > fabsf(m->room[greatest][part]) ? k : greatest;
    }
    return greatest;
}

/* Raises a flank to the pattern of an image, of which `top` is the greatest value. */
static void add_flank(const measuring *m, int part, double top, int light, bst_light_flank *flank) {
    double per = 1.0 / fmax(top, 1e-30);
    for (int k = 0; k < SIDE * SIDE; k++) {
        double value = fabs((double)m->room[k][part]) * per;
        bst_light_flank_raise(flank, (double)m->light[light][k], value,
                              value * (double)m->quiet[light][k]);
    }
}

/* Raises the sensitivities to those of one derivative of a field node, along direction d. */
static void add_derivative(measuring *m, int part, double gaussian, int d, int order,
                           bst_psf_sensitivity *out) {
    double *most = &out->part[d][order];
    int greatest = greatest_of(m, part);
    *most = fmax(*most, greatest_near(m, greatest, part) / gaussian);
    for (int f = 0; f < BST_FLANKS; f++) {
        double top = fabs((double)m->room[greatest][part]);
        add_flank(m, part, top, f, &m->flank[f][d][order]);
    }
}

/* Adds the image across a direction of one frequency, `across` cycles/px along that, to those of
 * two steps of a row, by weights. */
static void add_across(measuring *m, const double otf[2], double across, int bin,
                       const double weight[2]) {
    double turn = 2.0 * BST_PI * across / (SIDE * m->step), c = cos(turn), s = sin(turn);
    double from = -0.5 * SIDE * turn;
    double z[2] = {otf[0] * cos(from) - otf[1] * sin(from),
                   otf[1] * cos(from) + otf[0] * sin(from)};
    for (int v = 0; v < SIDE; v++) {
        for (int k = 0; k < 2; k++) {
            m->across[bin + k][v][0] += weight[k] * z[0];
            m->across[bin + k][v][1] += weight[k] * z[1];
        }
        double re = z[0] * c - z[1] * s;
        z[1] = z[1] * c + z[0] * s;
        z[0] = re;
    }
}

/* Images across a streak along a direction of the frequencies about each step of a row. */
static void find_across(measuring *m, double angle) {
    enum { WIDTH = 2 }; /* steps of the lattice: as many points in each */
    memset(m->across, 0, sizeof m->across);
    for (int k = 0; k < LATTICE * LATTICE; k++) {
        int i = k % LATTICE - LATTICE / 2, j = k / LATTICE - LATTICE / 2;
        double along = (i * cos(angle) + j * sin(angle)) / WIDTH;
        int bin = (int)fabs(along);
        double part = fabs(along) - bin;
        /* the image is twice the real part of that of the positive frequencies */
        const double weight[2] = {along >= 0.0 || bin == 0 ? 1.0 - part : 0.0,
                                  along >= 0.0 ? part : 0.0};
        if (bin < BST_ROW_STEPS && weight[0] + weight[1] > 0.0 &&
            fabs(m->otf[k][0]) + fabs(m->otf[k][1]) > 1e-9) {
            add_across(m, m->otf[k], (j * cos(angle) - i * sin(angle)) * m->step, bin, weight);
        }
    }
}

/* Steps of a row lie between those of its groups. */
#define UNEQUAL 1.03
/* Ripple below which its pattern does not count. */
#define LEAST_RIPPLE 1e-4
/* Light across a streak, over its peak, below which the lattice resolves nothing. */
#define LEAST_LIGHT 1e-12

/* Raises the ripples of a row of equal groups of nodes on a streak along direction d, and their
 * pattern across it: a comb, of whose frequencies w = 2 pi / length the image keeps the OTF's.
 * Relative to the streak's light that is 2 A(w) / A(0), with A the greatest value across the
 * streak of the image of these frequencies. */
static void add_row(measuring *m, int d, double sigma_px, bst_psf_sensitivity *out) {
    double peak = 0.0, per_sigma = out->most_per_px * sigma_px / BST_ROW_STEPS;
    find_across(m, d * BST_PI / BST_NODE_DIRECTIONS);
    for (int v = 0; v < SIDE; v++) {
        peak = fmax(peak, m->across[0][v][0]);
    }
    for (int b = 1; b < BST_ROW_STEPS; b++) {
        double top = 0.0, length = 1.0 / (b * per_sigma);
        for (int v = 0; v < SIDE; v++) {
            top = fmax(top, hypot(m->across[b][v][0], m->across[b][v][1]));
        }
        out->row[d][b] = fmax(out->row[d][b], 2.0 * top / peak);
        int first = bst_row_length(length / UNEQUAL), last = bst_row_length(length * UNEQUAL);
        for (int v = 0; v < SIDE && top > LEAST_RIPPLE * peak; v++) {
            double share = fmax(m->across[0][v][0] / peak, LEAST_LIGHT);
            double error = hypot(m->across[b][v][0], m->across[b][v][1]) / top;
            for (int n = first; n <= last; n++) {
                bst_light_flank_raise(&m->row_flank[d][n], share, error, error / sqrt(share));
            }
        }
    }
}

/* Index of the brightest sample, by the real part. */
static int brightest_of(const measuring *m) {
    int best = 0;
    for (int k = 0; k < SIDE * SIDE; k++) {
        best = m->room[k][0] > m->room[best][0] ? k : best;
    }
    return best;
}

/* Value between the samples, at (x, y) samples. */
static double between(const measuring *m, double x, double y) {
    int i = (int)floor(x), j = (int)floor(y);
    double u = x - i, v = y - j, sum = 0.0;
    for (int k = 0; k < 4; k++) {
        int at = ((j + k / 2 + SIDE) % SIDE) * SIDE + (i + k % 2 + SIDE) % SIDE;
        sum += (k % 2 ? u : 1.0 - u) * (k / 2 ? v : 1.0 - v) * (double)m->room[at][0];
    }
    return sum;
}

/* Lowers the light beside the peak to that of a field node, whose image is in the room. */
static void add_light(const measuring *m, double sigma_px, bst_psf_sensitivity *out) {
    int top = brightest_of(m);
    double x = top % SIDE, y = top / SIDE, per = 1.0 / (double)m->room[top][0];
    double step = SIDE * m->step * sigma_px / BST_LIGHT_PER; /* samples */
    for (int d = 0; d < BST_NODE_DIRECTIONS; d++) {
        double angle = d * BST_PI / BST_NODE_DIRECTIONS, least = 1.0;
        double dx = step * cos(angle), dy = step * sin(angle);
        for (int n = 0; n < BST_LIGHT_STEPS; n++) {
            double before = n * step < SIDE / 2 ? between(m, x - n * dx, y - n * dy) : 0.0;
            double after = n * step < SIDE / 2 ? between(m, x + n * dx, y + n * dy) : 0.0;
            least = fmin(least, fmax(fmin(before, after) * per, 0.0));
            out->light[d][n] = fmin(out->light[d][n], least);
        }
    }
}

/* Keeps the image in the room, over its peak, as light. */
static void keep_light(measuring *m, int flank) {
    float top = m->room[brightest_of(m)][0];
    for (int k = 0; k < SIDE * SIDE; k++) {
        m->light[flank][k] = m->room[k][0] / top;
        m->quiet[flank][k] = 1.0F / sqrtf(fmaxf(m->light[flank][k], 1e-12F));
    }
}

/* Raises the greatest smoothed derivatives along direction d. */
static void add_smoothed(measuring *m, int d, double peak, double sigma_px,
                         double smooth[BST_SMOOTH_STEPS][2]) {
    double angle = d * BST_PI / BST_NODE_DIRECTIONS;
    double square = sigma_px * sigma_px, fourth = square * square;
    for (int n = 1; n < BST_SMOOTH_STEPS; n++) {
        make_images(m, angle, n * square / BST_SMOOTH_PER, (const int[2]){4, 6});
        for (int part = 0; part < 2; part++) {
            int greatest = greatest_of(m, part);
            double unit = GAUSSIAN[part + 1] * peak / (part == 0 ? fourth : fourth * square);
            smooth[n][part] = fmax(smooth[n][part], greatest_near(m, greatest, part) / unit);
            double top = fabs((double)m->room[greatest][part]);
            add_flank(m, part, top, BST_FLANK_STREAK, &m->smooth_flank[d][n - 1][part]);
        }
    }
}

/* Raises the sensitivities to those of a field node. */
static void measure_node(measuring *m, const bst_psf *psf, int node, double sigma_px, int binning,
                         bst_psf_sensitivity *out) {
    double square = sigma_px * sigma_px;
    for (int k = 0; k < LATTICE * LATTICE; k++) {
        double fx = frequency(m, k % LATTICE), fy = frequency(m, k / LATTICE);
        double mean = bst_psf_binned(fx, binning) * bst_psf_binned(fy, binning);
        bst_psf_otf(psf, node, fx, fy, m->otf[k]);
        m->otf[k][0] *= mean;
        m->otf[k][1] *= mean;
    }
    make_images(m, 0.0, 0.0, (const int[2]){0, 2});
    double peak = greatest_near(m, brightest_of(m), 0);
    keep_light(m, BST_FLANK_POINT);
    add_light(m, sigma_px, out);
    for (int d = 0; d < BST_NODE_DIRECTIONS; d++) {
        double angle = d * BST_PI / BST_NODE_DIRECTIONS;
        make_images(m, angle, SMOOTHED * square, (const int[2]){0, 2});
        keep_light(m, BST_FLANK_STREAK);
        add_derivative(m, 1, GAUSSIAN[0] * peak / square, d, 0, out);
        make_images(m, angle, 0.0, (const int[2]){4, 6});
        add_derivative(m, 0, GAUSSIAN[1] * peak / (square * square), d, 1, out);
        add_derivative(m, 1, GAUSSIAN[2] * peak / (square * square * square), d, 2, out);
        add_smoothed(m, d, peak, sigma_px, out->smooth[d]);
        memcpy(out->smooth[d][0], &out->part[d][1], sizeof out->smooth[d][0]);
        add_row(m, d, sigma_px, out);
    }
}

static void make_curves(const measuring *m, bst_psf_sensitivity *out) {
    for (int k = 0; k < BST_FLANKS * BST_NODE_DIRECTIONS * 3; k++) {
        int f = k / (3 * BST_NODE_DIRECTIONS), d = k / 3 % BST_NODE_DIRECTIONS, order = k % 3;
        bst_flank_curve_make(&m->flank[f][d][order], &out->flank[f][d][order]);
        bst_flank_curve_raise(&out->any_flank[f], &out->flank[f][d][order]);
    }
    for (int d = 0; d < BST_NODE_DIRECTIONS; d++) {
        for (int k = 2 * (BST_SMOOTH_STEPS - 1) - 1; k >= 0; k--) {
            int n = k / 2, order = k % 2;
            bst_flank_curve *curve = &out->smooth_flank[d][n][order];
            bst_flank_curve_make(&m->smooth_flank[d][n][order], curve);
            if (n + 2 < BST_SMOOTH_STEPS) {
                bst_flank_curve_raise(curve, &out->smooth_flank[d][n + 1][order]);
            }
        }
        for (int n = 0; n < BST_ROW_LENGTHS; n++) {
            bst_flank_curve_make(&m->row_flank[d][n], &out->row_flank[d][n]);
        }
    }
}

bst_status bst_psf_sensitivity_measure(bst_ctx *ctx, const bst_psf *psf, double cutoff,
                                       double sigma_px, int binning, bst_psf_sensitivity *out) {
    assert(psf && cutoff > 0.0 && sigma_px > 0.0 && binning > 0 && out);
    measuring *m = calloc(1, sizeof *m);
    memset(out, 0, sizeof *out);
    out->psf = psf;
    out->cutoff = cutoff;
    for (int k = 0; k < BST_NODE_DIRECTIONS * BST_LIGHT_STEPS; k++) {
        out->light[k / BST_LIGHT_STEPS][k % BST_LIGHT_STEPS] = 1.0;
    }
    bst_status status = BST_OK;
    if (m) {
        m->step = 2.0 * cutoff / LATTICE;
        out->most_per_px = 2.0 * BST_ROW_STEPS * m->step;
        m->room = bst_fft_array(sizeof *m->room * SIDE * SIDE);
    }
    if (!m || !m->room) {
        status = bst_fail(ctx, BST_ERR_MEMORY, "no memory for the derivatives of a PSF");
    } else {
        status =
            bst_fft_create_f32(ctx, BST_FFT_INVERSE, SIDE, SIDE, *m->room, *m->room, &m->inverse);
    }
    for (int n = 0; status == BST_OK && n < bst_psf_nodes(psf); n++) {
        measure_node(m, psf, n, sigma_px, binning, out);
    }
    if (status == BST_OK) {
        make_curves(m, out);
    }
    if (m) {
        bst_fft_free(m->inverse);
        bst_fft_array_free(m->room);
        free(m);
    }
    return status;
}
