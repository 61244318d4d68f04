#include "sim/world/psf_image.h"

#include <math.h>
#include <stdlib.h>

#include "sim/core/vec.h"

enum { LEAST_PERIOD_PX = 64, MOST_FREQUENCIES = 1024 };

/* exp(-2 pi^2 (sigma f)^2) is below 1e-9 beyond this sigma f */
static const double GAUSSIAN_CUTOFF = 1.03;

typedef struct sum {
    int period, turns;             /* px; samples of a period */
    int frequencies;               /* to either side of 0 */
    int side, half;                /* samples along an axis; before the middle one */
    double *cosine, *sine;         /* [turns] */
    double *otf;                   /* [2 frequencies + 1][2]: of one fx, by fy */
    double *column_re, *column_im; /* [frequencies + 1][side]: summed over fy */
} sum;

/* The product's place in a turn: turns * [0, 1). */
static int turn_of(const sum *s, int frequency, int sample) {
    int64_t at = (int64_t)frequency * sample % s->turns;
    return (int)(at < 0 ? at + s->turns : at);
}

/* The sum over fy for one fx. */
static void sum_column(const bst_psf *psf, int node, double blur_px, const sum *s, int kx) {
    double fx = (double)kx / s->period, scale = 1.0 / ((double)s->period * s->period);
    int n = s->frequencies;
    for (int ky = -n; ky <= n; ky++) {
        double fy = (double)ky / s->period, *at = s->otf + 2 * (ky + n);
        double blur = exp(-2.0 * BST_PI * BST_PI * blur_px * blur_px * (fx * fx + fy * fy));
        bst_psf_otf(psf, node, fx, fy, at);
        at[0] *= scale * blur;
        at[1] *= scale * blur;
    }
    for (int j = 0; j < s->side; j++) {
        double re = 0.0, im = 0.0;
        int step = turn_of(s, 1, j - s->half), t = turn_of(s, -n, j - s->half);
        for (int ky = -n; ky <= n; ky++) {
            const double *at = s->otf + 2 * (ky + n);
            re += at[0] * s->cosine[t] - at[1] * s->sine[t];
            im += at[0] * s->sine[t] + at[1] * s->cosine[t];
            t += step;
            t -= t < s->turns ? 0 : s->turns;
        }
        s->column_re[kx * s->side + j] = re;
        s->column_im[kx * s->side + j] = im;
    }
}

static void sum_image(const sum *s, double *out) {
    for (int i = 0; i < s->side * s->side; i++) {
        out[i] = 0.0;
    }
    for (int kx = 0; kx <= s->frequencies; kx++) {
        /* the image is real: the other half-plane adds the same */
        double twice = kx == 0 ? 1.0 : 2.0;
        const double *re = s->column_re + kx * s->side, *im = s->column_im + kx * s->side;
        for (int i = 0; i < s->side; i++) {
            int t = turn_of(s, kx, i - s->half);
            double c = twice * s->cosine[t], d = twice * s->sine[t];
            for (int j = 0; j < s->side; j++) {
                out[i * s->side + j] += re[j] * c - im[j] * d;
            }
        }
    }
    /* made by column, wanted by row */
    for (int i = 0; i < s->side; i++) {
        for (int j = 0; j < i; j++) {
            double other = out[i * s->side + j];
            out[i * s->side + j] = out[j * s->side + i];
            out[j * s->side + i] = other;
        }
    }
}

bst_status bst_psf_image(bst_ctx *ctx, const bst_psf *psf, int node, double blur_px, int per_px,
                         int reach_px, double *out) {
    sum s = {.period = 4 * reach_px > LEAST_PERIOD_PX ? 4 * reach_px : LEAST_PERIOD_PX};
    double cutoff = bst_psf_cutoff(psf);
    cutoff = blur_px > 0.0 ? fmin(cutoff, GAUSSIAN_CUTOFF / blur_px) : cutoff;
    s.turns = s.period * per_px;
    s.frequencies = (int)fmin(ceil(cutoff * s.period), MOST_FREQUENCIES);
    s.side = bst_psf_image_side(per_px, reach_px);
    s.half = per_px * reach_px;
    size_t columns = (size_t)(s.frequencies + 1) * (size_t)s.side;
    size_t spectrum = 2 * (2 * (size_t)s.frequencies + 1);
    double *memory = malloc((2 * (size_t)s.turns + spectrum + 2 * columns) * sizeof *memory);
    if (!memory) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the image of a point");
    }
    s.cosine = memory;
    s.sine = s.cosine + s.turns;
    s.otf = s.sine + s.turns;
    s.column_re = s.otf + spectrum;
    s.column_im = s.column_re + columns;
    for (int t = 0; t < s.turns; t++) {
        s.cosine[t] = cos(2.0 * BST_PI * t / s.turns);
        s.sine[t] = sin(2.0 * BST_PI * t / s.turns);
    }
    for (int kx = 0; kx <= s.frequencies; kx++) {
        sum_column(psf, node, blur_px, &s, kx);
    }
    sum_image(&s, out);
    free(memory);
    return BST_OK;
}
