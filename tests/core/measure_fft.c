/* Processor time and error of the Fourier transforms of this build, for the sizes in use, as rows
 * of a table in Markdown (docs/results/fft.md).
 *
 *     measure_fft */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "boresight/vec.h"
#include "sim/core/fft.h"

/* frequencies at which the error is measured, and time that each transform gets, s */
enum { TRIALS = 48 };
static const double BUDGET_S = 0.3;

typedef struct use {
    const char *what;
    bst_fft_kind kind;
    int is_double, side;
} use;

static const use USES[] = {
    {"far wings, 2048 px, sparse cells", BST_FFT_REAL_FORWARD, 0, 144},
    {"the same, back", BST_FFT_REAL_INVERSE, 0, 144},
    {"far wings, 2048 px, dense cells", BST_FFT_REAL_FORWARD, 0, 288},
    {"the same, back", BST_FFT_REAL_INVERSE, 0, 288},
    {"kernel of the far wings", BST_FFT_REAL_INVERSE, 0, 1152},
    {"aperture, small", BST_FFT_FORWARD, 0, 144},
    {"the same, its power", BST_FFT_REAL_FORWARD, 0, 144},
    {"aperture, large", BST_FFT_FORWARD, 0, 512},
    {"band of a PSF", BST_FFT_INVERSE, 0, 256},
    {"error of the frequency grid", BST_FFT_INVERSE, 1, 192},
    {"image of a point, 7 x 22", BST_FFT_INVERSE, 1, 154},
    {"image of a point, 8 per px", BST_FFT_INVERSE, 1, 768},
    {"sampled PSF", BST_FFT_REAL_FORWARD, 1, 512},
    {"sampled PSF, largest", BST_FFT_REAL_FORWARD, 1, 4096},
    {"reference image", BST_FFT_FORWARD, 1, 1024},
    {"reference image, back", BST_FFT_INVERSE, 1, 675},
};

static double cpu_s(void) {
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

/* What a transform is run on: `pitch` real numbers a row. */
typedef struct data {
    const use *u;
    size_t pitch;
    double *given; /* [side][pitch] */
    void *work;
} data;

static double get(const data *d, size_t i) {
    return d->u->is_double ? ((const double *)d->work)[i] : (double)((const float *)d->work)[i];
}

static void fill(const data *d) {
    for (size_t i = 0; i < (size_t)d->u->side * d->pitch; i++) {
        if (d->u->is_double) {
            ((double *)d->work)[i] = d->given[i];
        } else {
            ((float *)d->work)[i] = (float)d->given[i];
        }
    }
}

static int is_real(const use *u) {
    return u->kind == BST_FFT_REAL_FORWARD || u->kind == BST_FFT_REAL_INVERSE;
}

/* Random input: noise for forward and complex transforms; for the others three waves, whose sum is
 * known. */
static void make_input(const data *d) {
    int n = d->u->side;
    memset(d->given, 0, (size_t)n * d->pitch * sizeof *d->given);
    if (d->u->kind == BST_FFT_REAL_INVERSE) {
        for (int k = 1; k <= 3; k++) {
            d->given[(size_t)(7 * k) * d->pitch + (size_t)(2 * 5 * k)] = k;
        }
        return;
    }
    size_t used = (size_t)n * (is_real(d->u) ? 1 : 2);
    for (int j = 0; j < n; j++) {
        for (size_t i = 0; i < used; i++) {
            double v = (double)rand() / RAND_MAX - 0.5;
            d->given[(size_t)j * d->pitch + i] = (double)(float)v;
        }
    }
}

/* The defining sum at frequency (or position) u, v. */
static void exact(const data *d, int u, int v, double out[2]) {
    int n = d->u->side;
    double sign = d->u->kind == BST_FFT_FORWARD || d->u->kind == BST_FFT_REAL_FORWARD ? -1.0 : 1.0;
    out[0] = out[1] = 0.0;
    if (d->u->kind == BST_FFT_REAL_INVERSE) {
        for (int k = 1; k <= 3; k++) {
            out[0] += 2.0 * k * cos(2.0 * BST_PI * (5.0 * k * u + 7.0 * k * v) / n);
        }
        return;
    }
    long double sum[2] = {0.0L, 0.0L}; /* of up to 4096² terms */
    for (int j = 0; j < n; j++) {
        for (int i = 0; i < n; i++) {
            const double *z = d->given + (size_t)j * d->pitch + (size_t)i * (is_real(d->u) ? 1 : 2);
            double a = sign * 2.0 * BST_PI * (double)(((long)u * i + (long)v * j) % n) / n;
            double c = cos(a), s = sin(a), re = z[0], im = is_real(d->u) ? 0.0 : z[1];
            sum[0] += re * c - im * s;
            sum[1] += re * s + im * c;
        }
    }
    out[0] = (double)sum[0];
    out[1] = (double)sum[1];
}

/* Relative RMS error at random frequencies. */
static double error_of(const data *d) {
    int n = d->u->side;
    double error = 0.0, size = 0.0;
    for (int t = 0; t < (n > 1500 ? TRIALS / 8 : TRIALS); t++) {
        int u = rand() % (is_real(d->u) ? n / 2 + 1 : n), v = rand() % n;
        double truth[2];
        exact(d, u, v, truth);
        int real_output = d->u->kind == BST_FFT_REAL_INVERSE;
        size_t at = (size_t)v * d->pitch + (size_t)u * (real_output ? 1 : 2);
        double re = get(d, at), im = real_output ? 0.0 : get(d, at + 1);
        error += pow(re - truth[0], 2.0) + pow(im - truth[1], 2.0);
        size += truth[0] * truth[0] + truth[1] * truth[1];
    }
    return sqrt(error / size);
}

static int measure(const use *u) {
    data d = {.u = u, .pitch = 2 * (size_t)(is_real(u) ? u->side / 2 + 1 : u->side)};
    size_t count = (size_t)u->side * d.pitch;
    d.given = malloc(count * sizeof *d.given);
    d.work = bst_fft_array(count * (u->is_double ? sizeof(double) : sizeof(float)));
    bst_ctx ctx = {0};
    bst_fft *fft = NULL;
    double from = cpu_s();
    if (!d.given || !d.work ||
        (u->is_double ? bst_fft_create_f64(&ctx, u->kind, u->side, u->side, d.work, d.work, &fft)
                      : bst_fft_create_f32(&ctx, u->kind, u->side, u->side, d.work, d.work,
                                           &fft)) != BST_OK) {
        return 1;
    }
    double create_s = cpu_s() - from, least_s = INFINITY, all_s = 0.0;
    make_input(&d);
    for (int run = 0; run < 3 || all_s < BUDGET_S; run++) {
        fill(&d);
        from = cpu_s();
        bst_fft_run(fft);
        double took_s = cpu_s() - from;
        least_s = fmin(least_s, took_s);
        all_s += took_s;
    }
    static const char *const names[] = {"complex", "complex", "real", "real, back"};
    printf("| %s | %d² | %s, %s | %.0f | %.0f | %.1e |\n", u->what, u->side, names[u->kind],
           u->is_double ? "double" : "single", 1e6 * create_s, 1e6 * least_s, error_of(&d));
    bst_fft_free(fft);
    bst_fft_array_free(d.work);
    free(d.given);
    return 0;
}

int main(void) {
    puts(
        "| use | size | numbers | create, µs | run, µs | relative error "
        "|\n|---|---|---|---|---|---|");
    for (size_t i = 0; i < sizeof USES / sizeof *USES; i++) {
        if (measure(&USES[i])) {
            return 1;
        }
    }
    return 0;
}
