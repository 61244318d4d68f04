#include "imgproc/measure/cosmic_ray.h"

#include <math.h>

enum { MAX_CHARGE = 64 };

/* Collects the pixels sharper than the PSF about a candidate's maximum, and pixels connected to
 * them. Returns their number. */
static int find_charge_pixels(const bst_imgproc_locator *l, const bst_locate_frame *f,
                              const bst_imgproc_found *found, int at[MAX_CHARGE],
                              double *sharpest) {
    int reach_px = 1 + (int)f->sigma_px, count = 0;
    *sharpest = 0.0;
    for (int round = -1; round < count; round++) {
        int x = round < 0 ? found->peak_x : at[round] % f->width;
        int y = round < 0 ? found->peak_y : at[round] / f->width;
        int r = round < 0 ? reach_px : 1;
        for (int v = y - r; v <= y + r; v++) {
            for (int u = x - r; u <= x + r && count < MAX_CHARGE; u++) {
                if (!bst_sharpness_is_open(&l->sharpness, f->signal, f->width, f->height,
                                           (float)found->noise_e, u, v)) {
                    continue;
                }
                double sharp = bst_sharpness_at(&l->sharpness, f->signal, f->width, f->height,
                                                found->noise_e, u, v);
                bool known = false;
                for (int k = 0; k < count && sharp > BST_SHARP_DEVIATION; k++) {
                    known = known || at[k] == v * f->width + u;
                }
                if (sharp > BST_SHARP_DEVIATION && !known) {
                    at[count++] = v * f->width + u;
                    *sharpest = fmax(*sharpest, sharp);
                }
            }
        }
    }
    return count;
}

/* Measures a cosmic-ray or hot-pixel candidate: centroid and moments of its charge. */
static void measure_charge(const bst_sharpness *s, const bst_locate_frame *f, const int *at,
                           int count, double sharpest, bst_imgproc_found *found) {
    double sum = 0.0, square = 0.0, mx = 0.0, my = 0.0, mxx = 0.0, mxy = 0.0, myy = 0.0;
    for (int k = 0; k < count; k++) {
        double v = bst_sharpness_signal(s, f->signal[at[k]]), x = at[k] % f->width - found->peak_x,
               y = at[k] / f->width - found->peak_y;
        sum += v;
        square += v * v;
        mx += v * x;
        my += v * y;
        mxx += v * x * x;
        mxy += v * x * y;
        myy += v * y * y;
    }
    mx /= sum;
    my /= sum;
    mxx = fmax(mxx / sum - mx * mx, 0.0) + 1.0 / 12.0;
    myy = fmax(myy / sum - my * my, 0.0) + 1.0 / 12.0;
    mxy = mxy / sum - mx * my;
    double mean = 0.5 * (mxx + myy), half = hypot(0.5 * (mxx - myy), mxy);
    found->charge =
        (bst_imgproc_cosmic_ray){.pixels = count,
                                 .sharpness = sharpest,
                                 .x_px = found->peak_x + mx,
                                 .y_px = found->peak_y + my,
                                 .electrons = sum,
                                 .snr = sqrt(square) / found->noise_e,
                                 .length_px = BST_FWHM_PER_SIGMA * sqrt(mean + half),
                                 .width_px = BST_FWHM_PER_SIGMA * sqrt(fmax(mean - half, 0.0)),
                                 .angle_rad = half > 1e-9 ? 0.5 * atan2(2.0 * mxy, mxx - myy) : 0};
}

typedef struct search {
    bst_imgproc_locator *l;
    const bst_locate_frame *f;
} search;

/* Finds the charge pixels of candidates begin to end - 1 (loop body of bst_parallel_for). */
static void count_charge(void *user, int begin, int end) {
    const search *s = user;
    for (int i = begin; i < end; i++) {
        int at[MAX_CHARGE];
        double sharpest;
        bst_imgproc_found *found = &s->l->found[i];
        bool light = found->dropped || found->bleed;
        found->charge.pixels = light ? 0 : find_charge_pixels(s->l, s->f, found, at, &sharpest);
    }
}

void bst_cosmic_ray_remove(bst_imgproc_locator *l, const bst_locate_frame *f) {
    enum { A_TIME = 64 };
    search s = {l, f};
    bst_parallel_for(f->pool, l->count, A_TIME, count_charge, &s);
    l->charged_count = 0;
    for (int i = 0; i < l->count; i++) {
        if (l->found[i].charge.pixels == 0) {
            continue;
        }
        int at[MAX_CHARGE];
        double sharpest;
        int count = find_charge_pixels(l, f, &l->found[i], at, &sharpest);
        measure_charge(&l->sharpness, f, at, count, sharpest, &l->found[i]);
        for (int k = 0; k < count && l->charged_count < l->charged_capacity; k++) {
            l->charged[l->charged_count++] = at[k];
        }
    }
    for (int k = 0; k < l->charged_count; k++) {
        f->signal[l->charged[k]] = BST_PIXEL_BAD;
    }
}

double bst_cosmic_ray_light(const bst_locate_frame *f, const bst_imgproc_found *found) {
    int r = 1 + (int)ceil(1.5 * f->sigma_px);
    double sum = 0.0, norm = 0.0, scale = -0.5 / (f->sigma_px * f->sigma_px + 1.0 / 12.0);
    for (int y = found->peak_y - r; y <= found->peak_y + r; y++) {
        for (int x = found->peak_x - r; x <= found->peak_x + r; x++) {
            if (x < 0 || y < 0 || x >= f->width || y >= f->height) {
                continue;
            }
            float v = f->signal[(size_t)y * (size_t)f->width + (size_t)x];
            if (v > BST_PIXEL_NONE) {
                double dx = x - found->charge.x_px, dy = y - found->charge.y_px;
                double w = exp(scale * (dx * dx + dy * dy));
                sum += w * (double)v;
                norm += w * w;
            }
        }
    }
    return norm > 0.0 ? sum / (sqrt(norm) * found->noise_e) : 0.0;
}

void bst_cosmic_ray_take(bst_imgproc_found *found) {
    const bst_imgproc_cosmic_ray *c = &found->charge;
    found->label = c->pixels == 1 ? BST_LABEL_HOT_PIXEL : BST_LABEL_HIT;
    /* odds of charge to light: normal tail of the sharpness, prior one candidate in a thousand */
    double odds = exp(fmin(0.5 * c->sharpness * c->sharpness, 300.0) - 7.0);
    found->label_probability = odds / (1.0 + odds);
    found->streak = false;
    found->flags = 0;
    found->source.shape.x_px = c->x_px;
    found->source.shape.y_px = c->y_px;
    found->source.shape.dx_px = found->source.shape.dy_px = 0.0;
    found->source.shape.bend_x_px = found->source.shape.bend_y_px = 0.0;
    found->source.flux_e = c->electrons;
    found->source.flux_variance = c->pixels * found->noise_e * found->noise_e + c->electrons;
    found->source.cov_xx = found->source.cov_yy = 1.0 / 12.0;
    found->source.cov_xy = 0.0;
    found->snr = c->snr;
    found->length_px = c->length_px;
    found->width_px = c->width_px;
    found->angle_rad = c->angle_rad;
}

bool bst_cosmic_ray_alone(const bst_imgproc_found *found) {
    const bst_imgproc_source *s = &found->source;
    double snr2 = s->flux_e * s->flux_e / fmax(s->flux_variance, 1e-30);
    double excess = s->chi_square - s->pixels;
    return !s->fitted || snr2 < BST_CHARGE_LIGHT_SNR * BST_CHARGE_LIGHT_SNR ||
           excess > 5.0 * sqrt(2.0 * s->pixels) + 0.1 * snr2;
}

bool bst_cosmic_ray_in(const bst_imgproc_locator *l, int width, const bst_imgproc_stamp *stamp) {
    bool in = false;
    for (int k = 0; k < l->charged_count && !in; k++) {
        int x = l->charged[k] % width - stamp->x0, y = l->charged[k] / width - stamp->y0;
        in = x >= 0 && y >= 0 && x < stamp->width && y < stamp->height;
    }
    return in;
}
