#include "scenegen/batch_fft.h"

#include <math.h>
#include <stdlib.h>

#include "sim/core/vec.h"

enum { MOST_PASSES = 24, MOST_RADIX = 8 };

/* One pass: blocks of `radix` x `step` elements; of each, radix elements that are `step` apart are
 * transformed and turned by twiddle[j][1 .. radix - 1], j the place of the first. */
typedef struct fft_pass {
    int radix, step;
    float *twiddle; /* [step][radix - 1][2]; NULL: no turn */
} fft_pass;

struct bst_batch_fft {
    int n, passes;
    fft_pass pass[MOST_PASSES];
    int *order;
};

/* ------------------------------------------------------------------ passes */

BST_LANES_INLINE void sum_and_difference(bst_batch *a, bst_batch *b) {
    bst_batch s = {a->re + b->re, a->im + b->im};
    b->re = a->re - b->re;
    b->im = a->im - b->im;
    *a = s;
}

/* times -i */
BST_LANES_INLINE void quarter_turn(bst_batch *a) {
    bst_lanes re = a->im;
    a->im = -a->re;
    a->re = re;
}

BST_LANES_INLINE void turn(bst_batch *a, const float *w) {
    bst_lanes re = a->re * w[0] - a->im * w[1];
    a->im = a->re * w[1] + a->im * w[0];
    a->re = re;
}

/* Transforms of r elements in place; frequency k ends at the place that `places` gives. */
BST_LANES_INLINE void butterfly2(bst_batch *a) {
    sum_and_difference(&a[0], &a[1]);
}

BST_LANES_INLINE void butterfly3(bst_batch *a) {
    const float s = 0.86602540378443865f; /* sin(pi / 3) */
    bst_batch sum = {a[1].re + a[2].re, a[1].im + a[2].im};
    bst_batch side = {s * (a[1].im - a[2].im), s * (a[2].re - a[1].re)};
    bst_batch base = {a[0].re - 0.5f * sum.re, a[0].im - 0.5f * sum.im};
    a[0].re += sum.re;
    a[0].im += sum.im;
    a[1] = (bst_batch){base.re + side.re, base.im + side.im};
    a[2] = (bst_batch){base.re - side.re, base.im - side.im};
}

BST_LANES_INLINE void butterfly4(bst_batch *a) {
    sum_and_difference(&a[0], &a[2]);
    sum_and_difference(&a[1], &a[3]);
    quarter_turn(&a[3]);
    sum_and_difference(&a[0], &a[1]);
    sum_and_difference(&a[2], &a[3]);
}

BST_LANES_INLINE void butterfly5(bst_batch *a) {
    /* cos and sin of 2 pi / 5 and 4 pi / 5 */
    const float c1 = 0.30901699437494742f, c2 = -0.80901699437494742f;
    const float s1 = 0.95105651629515357f, s2 = 0.58778525229247313f;
    bst_batch p = a[1], q = a[2], u = a[4], v = a[3];
    sum_and_difference(&p, &u);
    sum_and_difference(&q, &v);
    bst_batch x = {a[0].re + c1 * p.re + c2 * q.re, a[0].im + c1 * p.im + c2 * q.im};
    bst_batch y = {a[0].re + c2 * p.re + c1 * q.re, a[0].im + c2 * p.im + c1 * q.im};
    bst_batch g = {s1 * u.im + s2 * v.im, -s1 * u.re - s2 * v.re};
    bst_batch h = {s2 * u.im - s1 * v.im, s1 * v.re - s2 * u.re};
    a[0].re += p.re + q.re;
    a[0].im += p.im + q.im;
    a[1] = (bst_batch){x.re + g.re, x.im + g.im};
    a[4] = (bst_batch){x.re - g.re, x.im - g.im};
    a[2] = (bst_batch){y.re + h.re, y.im + h.im};
    a[3] = (bst_batch){y.re - h.re, y.im - h.im};
}

BST_LANES_INLINE void butterfly8(bst_batch *a) {
    const float h = 0.70710678118654752f;
    for (int i = 0; i < 4; i++) {
        sum_and_difference(&a[i], &a[i + 4]);
    }
    a[5] = (bst_batch){h * (a[5].re + a[5].im), h * (a[5].im - a[5].re)};
    quarter_turn(&a[6]);
    a[7] = (bst_batch){h * (a[7].im - a[7].re), -h * (a[7].re + a[7].im)};
    butterfly4(a);
    butterfly4(a + 4);
}

/* Where the butterflies leave frequency k. */
static const signed char places[MOST_RADIX + 1][MOST_RADIX] = {[2] = {0, 1},
                                                               [3] = {0, 1, 2},
                                                               [4] = {0, 2, 1, 3},
                                                               [5] = {0, 1, 2, 3, 4},
                                                               [8] = {0, 4, 2, 6, 1, 5, 3, 7}};

/* The blocks of a pass, with a constant radix and knowledge of whether there are turns. */
#define PASS_BODY(radix, butterfly)                                        \
    for (bst_batch *x = data, *end = data + count; x < end;) {             \
        for (int j = 0; j < p->step; j++, x++) {                           \
            bst_batch a[radix];                                            \
            for (int k = 0; k < radix; k++) {                              \
                a[k] = x[k * p->step];                                     \
            }                                                              \
            butterfly(a);                                                  \
            if (p->twiddle) {                                              \
                const float *w = p->twiddle + 2 * (radix - 1) * (size_t)j; \
                for (int k = 1; k < radix; k++) {                          \
                    turn(&a[k], w + 2 * (k - 1));                          \
                }                                                          \
            }                                                              \
            for (int k = 0; k < radix; k++) {                              \
                x[k * p->step] = a[k];                                     \
            }                                                              \
        }                                                                  \
        x += (radix - 1) * p->step;                                        \
    }

BST_LANES_FUNCTION
static void pass2(const fft_pass *p, bst_batch *data, int count){PASS_BODY(2, butterfly2)}

BST_LANES_FUNCTION
    static void pass3(const fft_pass *p, bst_batch *data, int count){PASS_BODY(3, butterfly3)}

BST_LANES_FUNCTION
    static void pass4(const fft_pass *p, bst_batch *data, int count){PASS_BODY(4, butterfly4)}

BST_LANES_FUNCTION
    static void pass5(const fft_pass *p, bst_batch *data, int count){PASS_BODY(5, butterfly5)}

BST_LANES_FUNCTION static void pass8(const fft_pass *p, bst_batch *data, int count) {
    PASS_BODY(8, butterfly8)
}

static void run_pass(const fft_pass *p, bst_batch *data, int count) {
    switch (p->radix) {
        case 2:
            pass2(p, data, count);
            break;
        case 3:
            pass3(p, data, count);
            break;
        case 4:
            pass4(p, data, count);
            break;
        case 5:
            pass5(p, data, count);
            break;
        default:
            pass8(p, data, count);
            break;
    }
}

void bst_batch_fft_run(const bst_batch_fft *f, bst_batch *data) {
    /* after the first pass its blocks are transforms of their own, each in a core's cache */
    run_pass(&f->pass[0], data, f->n);
    int step = f->pass[0].step;
    for (int begin = 0; begin < f->n; begin += step) {
        for (int k = 1; k < f->passes; k++) {
            run_pass(&f->pass[k], data + begin, step);
        }
    }
}

/* ------------------------------------------------------------------ plans */

/* Splits n into radices, the largest first; returns how many, 0 when n has other factors. */
static int split(int n, int radix[MOST_PASSES]) {
    static const int order[5] = {8, 5, 4, 3, 2};
    int count = 0;
    for (int i = 0; i < 5; i++) {
        while (n % order[i] == 0) {
            /* two fours rather than an eight and a two */
            if (order[i] == 8 && n % 16 == 0 && (n / 16) % 2 != 0) {
                break;
            }
            radix[count++] = order[i];
            n /= order[i];
        }
    }
    return n == 1 ? count : 0;
}

double bst_batch_fft_cost(int n) {
    int radix[MOST_PASSES], count = n >= BST_LANES ? split(n, radix) : 0;
    /* additions and multiplications per element, turns included */
    static const double work[MOST_RADIX + 1] = {
        [2] = 5.0, [3] = 9.3, [4] = 8.5, [5] = 14.0, [8] = 12.5};
    double sum = count > 0 ? 0.0 : INFINITY;
    for (int k = 0; k < count; k++) {
        sum += n * work[radix[k]];
    }
    return sum;
}

static bst_status make_pass(bst_ctx *ctx, fft_pass *p) {
    int n = p->radix * p->step;
    if (p->step == 1) {
        return BST_OK;
    }
    p->twiddle = malloc(2 * sizeof(float) * (size_t)(p->radix - 1) * (size_t)p->step);
    if (!p->twiddle) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for a transform of %d", n);
    }
    for (int j = 0; j < p->step; j++) {
        for (int k = 1; k < p->radix; k++) {
            float *w = p->twiddle + 2 * ((size_t)j * (size_t)(p->radix - 1));
            /* the butterfly leaves frequency k at another place, in whose order the turns are */
            int place = places[p->radix][k];
            double a = -2.0 * BST_PI * (double)j * k / n;
            w[2 * (place - 1)] = (float)cos(a);
            w[2 * (place - 1) + 1] = (float)sin(a);
        }
    }
    return BST_OK;
}

bst_status bst_batch_fft_create(bst_ctx *ctx, int n, bst_batch_fft **out) {
    int radix[MOST_PASSES];
    *out = NULL;
    bst_batch_fft *f = calloc(1, sizeof *f);
    int *order = malloc((size_t)n * sizeof *order);
    if (!f || !order) {
        free(f);
        free(order);
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for a transform of %d", n);
    }
    f->n = n;
    f->order = order;
    f->passes = split(n, radix);
    bst_status status = BST_OK;
    for (int k = 0, length = n; k < f->passes && status == BST_OK; k++) {
        length /= radix[k];
        f->pass[k] = (fft_pass){radix[k], length, NULL};
        status = make_pass(ctx, &f->pass[k]);
    }
    if (status != BST_OK) {
        bst_batch_fft_free(f);
        return status;
    }
    for (int k = 0; k < n; k++) {
        int rest = k, place = 0;
        for (int i = 0; i < f->passes; i++) {
            place += places[radix[i]][rest % radix[i]] * f->pass[i].step;
            rest /= radix[i];
        }
        order[k] = place;
    }
    *out = f;
    return BST_OK;
}

void bst_batch_fft_free(bst_batch_fft *f) {
    if (f) {
        for (int k = 0; k < f->passes; k++) {
            free(f->pass[k].twiddle);
        }
        free(f->order);
        free(f);
    }
}

const int *bst_batch_fft_order(const bst_batch_fft *f) {
    return f->order;
}
