/* Fourier transforms against the sum that defines them, for the library of this build. */
#include <pthread.h>

#include "boresight/vec.h"
#include "sim/core/fft.h"
#include "tests/test_support.h"

/* Relative RMS differences allowed, single and double precision, up to 154 values along an axis. An
 * FFT adds a rounding of about half a unit per pass, random in sign: eight passes of radix 2 along
 * each axis give sqrt(16) times half of 6e-8 or 1.1e-16. The prime sums 37 terms in a row. OpenCV
 * computes its tables by a recurrence in double precision, whose error is up to 154 units. */
static const double TOLERANCE[2] = {3e-7, 1e-14};

typedef struct field {
    int rows, columns, is_double;
    bst_fft_complex_f64 *value; /* [rows][columns] */
} field;

static field make_field(int rows, int columns, int is_double) {
    field f = {rows, columns, is_double,
               calloc((size_t)rows * (size_t)columns, sizeof(bst_fft_complex_f64))};
    assert_non_null(f.value);
    return f;
}

static bst_fft_complex_f64 *at(const field *f, int row, int column) {
    return &f->value[(size_t)row * (size_t)f->columns + (size_t)column];
}

/* Fills a field with uniform numbers that both precisions represent. */
static void fill_random(field *f, int is_real) {
    uint64_t state = 1;
    for (int i = 0; i < f->rows * f->columns; i++) {
        for (int part = 0; part < 2; part++) {
            state = state * 6364136223846793005ULL + 1442695040888963407ULL;
            double v = (double)(float)((double)(state >> 40) * 0x1p-24 - 0.5);
            f->value[i][part] = part == 1 && is_real ? 0.0 : v;
        }
    }
}

/* One pass of the defining sum along an axis; sign: of the exponent. */
static void sum_along(const field *in, field *out, int axis, double sign) {
    int n = axis == 0 ? in->columns : in->rows, lines = axis == 0 ? in->rows : in->columns;
    for (int line = 0; line < lines; line++) {
        for (int k = 0; k < n; k++) {
            double re = 0.0, im = 0.0;
            for (int j = 0; j < n; j++) {
                const double *v = axis == 0 ? *at(in, line, j) : *at(in, j, line);
                double a = sign * 2.0 * BST_PI * (double)((long)j * k % n) / n;
                re += v[0] * cos(a) - v[1] * sin(a);
                im += v[0] * sin(a) + v[1] * cos(a);
            }
            double *to = axis == 0 ? *at(out, line, k) : *at(out, k, line);
            to[0] = re;
            to[1] = im;
        }
    }
}

static field sum_directly(const field *in, double sign) {
    field half = make_field(in->rows, in->columns, in->is_double), out = half;
    out.value = calloc((size_t)in->rows * (size_t)in->columns, sizeof *out.value);
    assert_non_null(out.value);
    sum_along(in, &half, 0, sign);
    sum_along(&half, &out, 1, sign);
    free(half.value);
    return out;
}

/* An array of a transform: values of `width` numbers a row, in either precision. */
typedef struct array {
    int is_double;
    size_t width;
    void *memory;
} array;

static array make_array(int is_double, int rows, size_t width) {
    array a = {is_double, width, NULL};
    size_t bytes = (size_t)rows * width * (is_double ? sizeof(double) : sizeof(float));
    a.memory = bst_fft_array(bytes);
    assert_non_null(a.memory);
    memset(a.memory, 0, bytes);
    return a;
}

static double get(const array *a, int row, size_t i) {
    size_t k = (size_t)row * a->width + i;
    return a->is_double ? ((const double *)a->memory)[k] : (double)((const float *)a->memory)[k];
}

static void put(array *a, int row, size_t i, double v) {
    size_t k = (size_t)row * a->width + i;
    if (a->is_double) {
        ((double *)a->memory)[k] = v;
    } else {
        ((float *)a->memory)[k] = (float)v;
    }
}

static bst_fft *create(bst_fft_kind kind, const field *f, array *in, array *out) {
    bst_ctx ctx = {0};
    bst_fft *fft = NULL;
    bst_assert_ok(&ctx, f->is_double ? bst_fft_create_f64(&ctx, kind, f->rows, f->columns,
                                                          in->memory, out->memory, &fft)
                                     : bst_fft_create_f32(&ctx, kind, f->rows, f->columns,
                                                          in->memory, out->memory, &fft));
    return fft;
}

/* Fails unless the first `columns` complex numbers of each row of `a` are those of `truth`. */
static void assert_spectrum(const array *a, const field *truth, int columns) {
    double error = 0.0, size = 0.0;
    for (int j = 0; j < truth->rows; j++) {
        for (int i = 0; i < columns; i++) {
            const double *t = *at(truth, j, i);
            error += pow(get(a, j, 2 * (size_t)i) - t[0], 2.0);
            error += pow(get(a, j, 2 * (size_t)i + 1) - t[1], 2.0);
            size += t[0] * t[0] + t[1] * t[1];
        }
    }
    bst_assert_close(sqrt(error / size), 0.0, TOLERANCE[truth->is_double]);
}

static void check_complex(field *f) {
    fill_random(f, 0);
    for (int inverse = 0; inverse < 2; inverse++) {
        array a = make_array(f->is_double, f->rows, 2 * (size_t)f->columns);
        bst_fft *fft = create(inverse ? BST_FFT_INVERSE : BST_FFT_FORWARD, f, &a, &a);
        for (int j = 0; j < f->rows; j++) {
            for (int i = 0; i < 2 * f->columns; i++) {
                put(&a, j, (size_t)i, (*at(f, j, i / 2))[i % 2]);
            }
        }
        bst_fft_run(fft);
        field truth = sum_directly(f, inverse ? 1.0 : -1.0);
        assert_spectrum(&a, &truth, f->columns);
        free(truth.value);
        bst_fft_free(fft);
        bst_fft_array_free(a.memory);
    }
}

/* Real to spectrum, in place and not; and back, which gives the input times its number of values.
 */
static void check_real(field *f) {
    fill_random(f, 1);
    int half = f->columns / 2 + 1;
    field truth = sum_directly(f, -1.0);
    for (int in_place = 0; in_place < 2; in_place++) {
        array out = make_array(f->is_double, f->rows, 2 * (size_t)half), in = out;
        if (!in_place) {
            in = make_array(f->is_double, f->rows, (size_t)f->columns);
        }
        bst_fft *forward = create(BST_FFT_REAL_FORWARD, f, &in, &out);
        bst_fft *back = create(BST_FFT_REAL_INVERSE, f, &out, &out);
        for (int j = 0; j < f->rows; j++) {
            for (int i = 0; i < f->columns; i++) {
                put(&in, j, (size_t)i, (*at(f, j, i))[0]);
            }
        }
        bst_fft_run(forward);
        assert_spectrum(&out, &truth, half);
        bst_fft_run(back);
        double error = 0.0, size = 0.0, count = (double)f->rows * f->columns;
        for (int j = 0; j < f->rows; j++) {
            for (int i = 0; i < f->columns; i++) {
                double t = (*at(f, j, i))[0];
                error += pow(get(&out, j, (size_t)i) / count - t, 2.0);
                size += t * t;
            }
        }
        bst_assert_close(sqrt(error / size), 0.0, 1.5 * TOLERANCE[f->is_double]);
        bst_fft_free(forward);
        bst_fft_free(back);
        bst_fft_array_free(out.memory);
        if (!in_place) {
            bst_fft_array_free(in.memory);
        }
    }
    free(truth.value);
}

/* Powers, products of 2, 3, 5 and 7, a prime; odd and even along each axis. */
static const int SIZES[][2] = {{16, 16}, {64, 48},  {45, 32}, {32, 45}, {25, 27},
                               {1, 8},   {154, 14}, {37, 10}, {10, 37}};

static void complex_arrays_are_summed(void **state) {
    (void)state;
    for (size_t i = 0; i < sizeof SIZES / sizeof *SIZES; i++) {
        for (int is_double = 0; is_double < 2; is_double++) {
            field f = make_field(SIZES[i][0], SIZES[i][1], is_double);
            check_complex(&f);
            free(f.value);
        }
    }
}

static void real_arrays_are_summed(void **state) {
    (void)state;
    for (size_t i = 0; i < sizeof SIZES / sizeof *SIZES; i++) {
        for (int is_double = 0; is_double < 2; is_double++) {
            field f = make_field(SIZES[i][0], SIZES[i][1], is_double);
            check_real(&f);
            free(f.value);
        }
    }
}

enum { POINTS = 5, THREADS = 4 };

/* A few points of light on a large grid: their transform is a sum of as many waves. Returns the
 * largest error relative to the sum of the points. */
static void *transform_points(void *user) {
    static const int place[POINTS][2] = {{0, 0}, {1, 3}, {511, 17}, {900, 767}, {77, 384}};
    const int rows = 1024, columns = 768, half = columns / 2 + 1;
    double *worst = user;
    bst_ctx ctx = {0};
    bst_fft *fft = NULL;
    double *in = bst_fft_array(sizeof *in * (size_t)(rows * columns));
    bst_fft_complex_f64 *out = bst_fft_array(sizeof *out * (size_t)(rows * half));
    *worst = 1.0;
    if (in && out &&
        bst_fft_create_f64(&ctx, BST_FFT_REAL_FORWARD, rows, columns, in, *out, &fft) == BST_OK) {
        memset(in, 0, sizeof *in * (size_t)(rows * columns));
        for (int k = 0; k < POINTS; k++) {
            in[place[k][0] * columns + place[k][1]] = 1.0 + k;
        }
        bst_fft_run(fft);
        *worst = 0.0;
        for (int v = 0; v < rows; v += 31) {
            for (int u = 0; u < half; u++) {
                double re = 0.0, im = 0.0;
                for (int k = 0; k < POINTS; k++) {
                    double a = -2.0 * BST_PI *
                               ((double)(v * place[k][0] % rows) / rows +
                                (double)(u * place[k][1] % columns) / columns);
                    re += (1.0 + k) * cos(a);
                    im += (1.0 + k) * sin(a);
                }
                const double *x = out[v * half + u];
                *worst = fmax(*worst, hypot(x[0] - re, x[1] - im) / 15.0);
            }
        }
    }
    bst_fft_free(fft);
    bst_fft_array_free(in);
    bst_fft_array_free(out);
    return NULL;
}

/* Simulations of one process create transforms at the same time. */
static void several_threads_create_and_run(void **state) {
    (void)state;
    pthread_t thread[THREADS];
    double worst[THREADS];
    for (int i = 0; i < THREADS; i++) {
        assert_int_equal(pthread_create(&thread[i], NULL, transform_points, &worst[i]), 0);
    }
    for (int i = 0; i < THREADS; i++) {
        assert_int_equal(pthread_join(thread[i], NULL), 0);
        /* recurrences of 1024 steps, each with a rounding of 1.1e-16 at most */
        bst_assert_close(worst[i], 0.0, 1e-13);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(complex_arrays_are_summed),
        cmocka_unit_test(real_arrays_are_summed),
        cmocka_unit_test(several_threads_create_and_run),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
