/* Maxima of a matched filter along a path, and their subtraction. */
#include <assert.h>
#include <math.h>

#include "imgproc/streak/path_filter_internal.h"

enum { BLOCK = BST_PATH_BLOCK, SHIFTS = BST_PATH_SHIFTS };
/* Reach of a sample in PSF sigma, and that of the widest PSF in px. */
enum { KERNEL = 5, MOST_KERNEL = 20 };

/* Reach of the fit to a maximum along a streak: length over REACH_SHARE, and at most MOST_REACH px.
 */
static const double REACH_SHARE = 12.0, MOST_REACH = 10.0;
/* Standard deviation of the place along a streak: the shift at which the expected logarithm of the
 * likelihood falls by this; calibrated by tests/imgproc/streak_fields.c. */
static const double ALONG_LOSS = 0.5;
/* Index of a place in arrays by blocks. */
static size_t index_of(const bst_path_filter *f, int x, int y) {
    size_t block = (size_t)(y / BLOCK * f->columns + x / BLOCK);
    return (block * BLOCK + (size_t)(y % BLOCK)) * BLOCK + (size_t)(x % BLOCK);
}

static float snr_at(const bst_path_filter *f, int x, int y) {
    if (x < 0 || y < 0 || x >= f->width || y >= f->height) {
        return -1.0f;
    }
    size_t at = index_of(f, x, y);
    return f->per_noise[at] > 0.0f ? f->response[at] * f->per_noise[at] : -1.0f;
}

/* SNR at a place, bilinear. */
static double snr_between(const bst_path_filter *f, double x, double y) {
    int i = (int)floor(x), j = (int)floor(y);
    double u = x - i, v = y - j;
    return (1.0 - v) * ((1.0 - u) * (double)snr_at(f, i, j) + u * (double)snr_at(f, i + 1, j)) +
           v * ((1.0 - u) * (double)snr_at(f, i, j + 1) + u * (double)snr_at(f, i + 1, j + 1));
}

/* Shift along a direction to the vertex of a parabola that fits the SNR over a reach on both sides,
 * px. Along a streak the maximum is flat, and samples at whole pixels make ripples on it. */
static double vertex(const bst_path_filter *f, double x, double y, double dx, double dy,
                     int reach) {
    double odd = 0.0, even = 0.0, square = 0.0, fourth = 0.0, sum = 0.0;
    for (int k = -reach; k <= reach; k++) {
        double v = snr_between(f, x + k * dx, y + k * dy), k2 = (double)k * k;
        sum += v;
        odd += k * v;
        even += k2 * v;
        square += k2;
        fourth += k2 * k2;
    }
    int n = 2 * reach + 1;
    double bend = (n * even - square * sum) / (n * fourth - square * square);
    double slope = odd / square;
    return bend < 0.0 ? fmax(fmin(-0.5 * slope / bend, reach), -reach) : 0.0;
}

/* Standard deviation of a star's place along its streak. */
static double along_sigma_px(bst_path_filter *f, double snr) {
    double wanted = ALONG_LOSS / (snr * snr), before = bst_path_filter_loss(f, 0);
    for (int i = 1; i < SHIFTS; i++) {
        double loss = bst_path_filter_loss(f, i);
        if (loss >= wanted) {
            double share = (wanted - before) / (loss - before);
            return i == 1 ? sqrt(share) : i - 1 + share; /* parabolic at its maximum */
        }
        before = loss;
    }
    return SHIFTS;
}

/* Block with the highest SNR or bound; -1: none is positive. */
static int first_block(const bst_path_filter *f) {
    int best = -1;
    float most = 0.0f;
    for (int y = 0; y < f->rows; y++) {
        if (f->of_row[y] > most) {
            most = f->of_row[y];
            best = y * f->columns;
        }
    }
    while (best >= 0 && !(f->highest[best] >= most)) {
        best++;
    }
    return best;
}

/* Block with the highest SNR; -1: no SNR is positive. It and those about it are up to date. */
static int highest_block(bst_path_filter *f) {
    for (int best = first_block(f); best >= 0; best = first_block(f)) {
        const int x = best % f->columns, y = best / f->columns;
        if (f->filtered[best] < f->subtractions) {
            bst_path_filter_refresh(f, best);
            continue;
        }
        for (int k = 0; k < 9; k++) {
            int i = x + k % 3 - 1, j = y + k / 3 - 1;
            if (i >= 0 && j >= 0 && i < f->columns && j < f->rows) {
                bst_path_filter_refresh(f, j * f->columns + i);
            }
        }
        if (first_block(f) == best) { /* none of them is higher than its bound was */
            return best;
        }
    }
    return -1;
}

bool bst_path_filter_highest(bst_path_filter *f, bst_path_filter_peak *out) {
    assert(f && out);
    const int block = highest_block(f);
    if (block < 0) {
        return false;
    }
    const float best = f->highest[block];
    size_t at = (size_t)block * BLOCK * BLOCK;
    while (!(f->response[at] * f->per_noise[at] >= best)) { /* of values that are not NAN */
        at++;
    }
    const int x = block % f->columns * BLOCK + (int)(at % BLOCK);
    const int y = block / f->columns * BLOCK + (int)(at / BLOCK % BLOCK);
    bool whole = true;
    for (int k = 0; k < 9; k++) {
        whole = whole && snr_at(f, x + k % 3 - 1, y + k / 3 - 1) >= 0.0f;
    }
    double noise = 1.0 / (double)f->per_noise[at], variance = noise * noise;
    double inside = variance / (f->squares * f->correlation);
    double along = along_sigma_px(f, (double)best);
    double across = 1.42 * f->psf_sigma_px / (double)best;
    double c2 = across * across + f->systematic_px * f->systematic_px, a2 = along * along + c2;
    double c = f->direction[0], s = f->direction[1], u = x, v = y;
    if (whole) {
        int reach = (int)fmax(fmin(f->length_px * inside / REACH_SHARE, MOST_REACH), 1.0);
        double shift = vertex(f, u, v, c, s, reach);
        u += shift * c;
        v += shift * s;
        shift = vertex(f, u, v, -s, c, 1);
        u -= shift * s;
        v += shift * c;
    }
    *out = (bst_path_filter_peak){.x_px = u - f->margin,
                                  .y_px = v - f->margin,
                                  .amplitude = (double)f->response[at] / variance,
                                  .snr = (double)best,
                                  .inside = inside,
                                  .cov_xx = c * c * a2 + s * s * c2,
                                  .cov_xy = c * s * (a2 - c2),
                                  .cov_yy = s * s * a2 + c * c * c2,
                                  .whole = whole};
    return true;
}

/* Subtracts a point from the image, convolved as it is. */
static void subtract_from_image(bst_path_filter *f, double x, double y, double amplitude) {
    const int reach = (int)ceil(KERNEL * f->psf_sigma_px);
    if (!(x > -reach && y > -reach && x < f->frame[0] + reach && y < f->frame[1] + reach)) {
        return;
    }
    const int i0 = (int)floor(x), j0 = (int)floor(y);
    const int left = i0 - reach > 0 ? i0 - reach : 0, top = j0 - reach > 0 ? j0 - reach : 0;
    const int right = i0 + reach < f->frame[0] - 1 ? i0 + reach : f->frame[0] - 1;
    const int bottom = j0 + reach < f->frame[1] - 1 ? j0 + reach : f->frame[1] - 1;
    float along[2 * MOST_KERNEL + 1];
    for (int i = left; i <= right; i++) {
        along[i - left] = (float)bst_path_filter_correlation(f, (i - x) * (i - x));
    }
    for (int j = top; j <= bottom; j++) {
        float *row = f->image + (size_t)(j + BLOCK) * f->stride + BLOCK;
        float value = (float)(amplitude * bst_path_filter_correlation(f, (j - y) * (j - y)));
        for (int i = left; i <= right; i++) {
            row[i] -= value * along[i - left];
        }
    }
}

void bst_path_filter_subtract(bst_path_filter *f, const bst_path_filter_peak *peak) {
    assert(f && peak);
    const bst_star_path *p = &f->path;
    double m[3];
    bst_star_path_map(p, peak->x_px, peak->y_px, m);
    for (int l = 0; l < p->count; l++) {
        double x = peak->x_px + m[0] * p->place[l][0] + m[1] * p->place[l][1];
        double y = peak->y_px + m[1] * p->place[l][0] + m[2] * p->place[l][1];
        subtract_from_image(f, x, y, peak->amplitude * p->light[l]);
    }
    f->subtractions++;
}

void bst_path_filter_subtract_point(bst_path_filter *f, double x_px, double y_px,
                                    double amplitude) {
    assert(f);
    subtract_from_image(f, x_px, y_px, amplitude);
    f->subtractions++;
}

void bst_path_filter_leave_out(bst_path_filter *f, const bst_path_filter_peak *peak,
                               double radius_px) {
    double cx = peak->x_px + f->margin, cy = peak->y_px + f->margin;
    const int y0 = (int)fmax(ceil(cy - radius_px), 0.0);
    const int y1 = (int)fmin(floor(cy + radius_px), f->height - 1.0);
    const int x0 = (int)fmax(ceil(cx - radius_px), 0.0);
    const int x1 = (int)fmin(floor(cx + radius_px), f->width - 1.0);
    for (int y = y0; y <= y1; y++) {
        for (int x = x0; x <= x1; x++) {
            if (hypot(x - cx, y - cy) <= radius_px) {
                const int block = y / BLOCK * f->columns + x / BLOCK;
                if (f->filtered[block] == BST_PATH_BOUND) {
                    bst_path_filter_refresh(f, block);
                }
                f->per_noise[index_of(f, x, y)] = 0.0f;
                f->filtered[block] = BST_PATH_AGAIN;
                f->left_out = true;
            }
        }
    }
}
