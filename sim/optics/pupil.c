#include "sim/optics/pupil.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "boresight/vec.h"
#include "sim/core/fft.h"

/* lines per cell for measuring its open fraction */
enum { LINES = 16 };

/* maximum open intervals on one line through the aperture */
enum { STRETCHES = 80 };
typedef struct stretches {
    double from[STRETCHES], to[STRETCHES];
    int count;
} stretches;

struct bst_pupil_work {
    int side;
    double *open;                  /* [side][side] */
    bst_fft_complex_f32 *field;    /* [side][side] */
    float *power;                  /* [side][side] */
    bst_fft_complex_f32 *transfer; /* [side][side / 2 + 1] */
    bst_fft *forward, *back;
};

/* Next even number of the form 2^a 3^b 5^c, fast for the FFT. */
static int quick_size(int least) {
    for (int n = least + least % 2;; n += 2) {
        int rest = n;
        for (int p = 2; p <= 5; p++) {
            while (rest % p == 0) {
                rest /= p;
            }
        }
        if (rest == 1) {
            return n;
        }
    }
}

/* Side of the grid: shifts by a whole aperture must not wrap around. */
static int side_for(int cells) {
    return quick_size(2 * cells + 6);
}

bst_status bst_pupil_work_create(bst_ctx *ctx, int cells, bst_pupil_work **out) {
    bst_pupil_work *w = calloc(1, sizeof *w);
    *out = NULL;
    if (w) {
        size_t side = (size_t)side_for(cells), n = side * side;
        w->open = malloc(n * sizeof *w->open);
        w->field = bst_fft_array(n * sizeof *w->field);
        w->power = bst_fft_array(n * sizeof *w->power);
        w->transfer = bst_fft_array(side * (side / 2 + 1) * sizeof *w->transfer);
    }
    if (!w || !w->open || !w->field || !w->power || !w->transfer) {
        bst_pupil_work_free(w);
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for an aperture of %d cells", cells);
    }
    *out = w;
    return BST_OK;
}

static void drop_plans(bst_pupil_work *w) {
    bst_fft_free(w->forward);
    bst_fft_free(w->back);
    w->forward = w->back = NULL;
    w->side = 0;
}

/* Creates the transforms for apertures of `cells` cells. */
static bst_status plan(bst_ctx *ctx, bst_pupil_work *w, int cells) {
    int side = side_for(cells);
    if (side != w->side) {
        drop_plans(w);
        BST_TRY(bst_fft_create_f32(ctx, BST_FFT_FORWARD, side, side, *w->field, *w->field,
                                   &w->forward));
        BST_TRY(bst_fft_create_f32(ctx, BST_FFT_REAL_FORWARD, side, side, w->power, *w->transfer,
                                   &w->back));
        w->side = side;
    }
    return BST_OK;
}

void bst_pupil_work_free(bst_pupil_work *w) {
    if (w) {
        drop_plans(w);
        free(w->open);
        bst_fft_array_free(w->field);
        bst_fft_array_free(w->power);
        bst_fft_array_free(w->transfer);
        free(w);
    }
}

/* Removes (from, to) from the open intervals. */
static void close_stretch(stretches *s, double from, double to) {
    int count = s->count;
    for (int i = 0; i < count && from < to; i++) {
        double a = s->from[i], b = s->to[i];
        if (to <= a || from >= b) {
            continue;
        }
        if (from > a && to < b) {
            if (s->count < STRETCHES) {
                s->from[s->count] = to;
                s->to[s->count++] = b;
            }
            s->to[i] = from;
        } else if (from > a) {
            s->to[i] = from;
        } else if (to < b) {
            s->from[i] = to;
        } else {
            s->to[i] = a; /* nothing remains */
        }
    }
}

/* Removes the part of the line at y that a vane in direction (c, s) covers. */
static void close_vane(stretches *open, double half_width, double c, double s, double y) {
    double from = -1.0, to = 1.0;
    if (fabs(s) > 1e-12) { /* within half_width of the vane's axis */
        double a = (y * c - half_width) / s, b = (y * c + half_width) / s;
        from = fmax(from, fmin(a, b));
        to = fmin(to, fmax(a, b));
    } else if (fabs(y * c) >= half_width) {
        return;
    }
    if (fabs(c) > 1e-12) { /* on the vane's side of the centre */
        double start = -y * s / c;
        if (c > 0.0) {
            from = fmax(from, start);
        } else {
            to = fmin(to, start);
        }
    } else if (y * s < 0.0) {
        return;
    }
    close_stretch(open, from, to);
}

static void add_stretch(double *row, int side, double cell, double from, double to) {
    double a = from / cell + side / 2 + 0.5, b = to / cell + side / 2 + 0.5;
    int i = (int)a, j = (int)b;
    if (i < 0 || j >= side || !(b > a)) {
        return;
    }
    if (i == j) {
        row[i] += (b - a) / LINES;
        return;
    }
    row[i] += (i + 1 - a) / LINES;
    for (int k = i + 1; k < j; k++) {
        row[k] += 1.0 / LINES;
    }
    row[j] += (b - j) / LINES;
}

void bst_pupil_mask(const bst_pupil *pupil, double cell, int side, double *open) {
    memset(open, 0, (size_t)side * (size_t)side * sizeof *open);
    for (int line = 0; line < side * LINES; line++) {
        double y = ((line + 0.5) / LINES - side / 2 - 0.5) * cell;
        if (fabs(y) >= 0.5) {
            continue;
        }
        double rim = sqrt(0.25 - y * y), radius = 0.5 * pupil->inner;
        stretches s = {.from = {-rim}, .to = {rim}, .count = 1};
        if (fabs(y) < radius) {
            double hole = sqrt(radius * radius - y * y);
            close_stretch(&s, -hole, hole);
        }
        for (int k = 0; k < pupil->vanes; k++) {
            double angle = pupil->vane_rad + 2.0 * BST_PI * k / pupil->vanes;
            close_vane(&s, 0.5 * pupil->vane_width, cos(angle), sin(angle), y);
        }
        for (int k = 0; k < s.count; k++) {
            add_stretch(open + (size_t)(line / LINES) * (size_t)side, side, cell, s.from[k],
                        s.to[k]);
        }
    }
}

bst_status bst_pupil_transfer(bst_ctx *ctx, bst_pupil_work *w, const bst_pupil *pupil, double cell,
                              double wavelength_m, bst_pupil_shifts *out) {
    BST_TRY(plan(ctx, w, (int)ceil(1.0 / cell)));
    int n = w->side;
    bst_pupil_mask(pupil, cell, n, w->open);
    double area = 0.0;
    for (int j = 0; j < n; j++) {
        double y = 2.0 * (j - n / 2) * cell, along_x[BST_ZERNIKE_DEGREE + 1];
        for (int p = 0; p <= BST_ZERNIKE_DEGREE; p++) {
            along_x[p] = 0.0;
            for (int q = BST_ZERNIKE_DEGREE - p; q >= 0; q--) {
                along_x[p] = along_x[p] * y + pupil->wavefront.c[p][q];
            }
        }
        for (int i = 0; i < n; i++) {
            size_t at = (size_t)j * (size_t)n + (size_t)i;
            double open = w->open[at];
            w->field[at][0] = (float)open;
            w->field[at][1] = 0.0F;
            if (open > 0.0 && wavelength_m > 0.0) {
                double x = 2.0 * (i - n / 2) * cell, phase = 0.0;
                for (int p = BST_ZERNIKE_DEGREE; p >= 0; p--) {
                    phase = phase * x + along_x[p];
                }
                phase *= 2.0 * BST_PI / wavelength_m;
                w->field[at][0] = (float)(open * cos(phase));
                w->field[at][1] = (float)(open * sin(phase));
            }
            area += open;
        }
    }
    bst_fft_run(w->forward);
    float scale = (float)(1.0 / (area * (double)n * (double)n));
    for (size_t at = 0; at < (size_t)n * (size_t)n; at++) {
        const float *a = w->field[at];
        w->power[at] = scale * (a[0] * a[0] + a[1] * a[1]);
    }
    bst_fft_run(w->back);
    *out = (bst_pupil_shifts){&w->transfer[0][0], n / 2 + 1, n};
    return BST_OK;
}

double bst_pupil_slope_m(const bst_pupil *pupil) {
    enum { STEPS = 64 };
    const double h = 1e-4;
    double most = 0.0;
    for (int j = -STEPS; j <= STEPS; j++) {
        for (int i = -STEPS; i <= STEPS; i++) {
            double x = (double)i / STEPS, y = (double)j / STEPS;
            if (x * x + y * y <= 1.0) {
                double dx = bst_zernike_at(&pupil->wavefront, x + h, y) -
                            bst_zernike_at(&pupil->wavefront, x - h, y);
                double dy = bst_zernike_at(&pupil->wavefront, x, y + h) -
                            bst_zernike_at(&pupil->wavefront, x, y - h);
                most = fmax(most, hypot(dx, dy) / h); /* twice the slope per unit disc radius */
            }
        }
    }
    return most;
}
