#include "imgproc/streak/path_filter.h"

#include <assert.h>
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "sim/core/simd.h"

/* BLOCK: side of the squares over which the path's shape changes by less than a pixel. */
enum { BLOCK = 16, KERNEL = 5, SHIFTS = 24 };
/* Widest PSF and its reach, px. */
enum { MOST_SIGMA = 4, MOST_KERNEL = KERNEL * MOST_SIGMA };
/* Passes of the clipped spread, the places that it needs, and those that it takes. */
enum { SPREAD_PASSES = 3, LEAST_PLACES = 1000, SPREAD_PLACES = 65536 };

/* Position error beside the noise: samples at whole pixels, and the path's own error. */
static const double SYSTEMATIC_PX = 0.2;
/* Reach of the fit to a maximum along a streak: length over REACH_SHARE, and at most MOST_REACH px.
 */
static const double REACH_SHARE = 12.0, MOST_REACH = 10.0;
/* Standard deviation of the place along a streak: the shift at which the expected logarithm of the
 * likelihood falls by this; calibrated by tests/imgproc/streak_fields.c. */
static const double ALONG_LOSS = 0.5;
/* Least share of the path inside the frame over what is asked: weights may exceed 1 a little. */
static const double WEIGHED = 0.8;

/* Values of the response beyond this are clipped; mean square of a normal deviate up to it:
 * 1 - 2 c phi(c) / erf(c / sqrt(2)) */
static const double SPREAD_CLIP = 3.0, SPREAD_SHARE = 0.9733;

#define BST_SIMD_KERNELS "imgproc/streak/path_filter_kernels.inc"
#include "sim/core/simd_each.inc"

/* Samples of the path whose light some places of a block have in the frame. */
typedef struct block_samples {
    int count;
    int shift[BST_STAR_PATH_ROOM][2]; /* of all samples, whole pixels */
    const float *image[BST_STAR_PATH_ROOM], *weights[BST_STAR_PATH_ROOM];
    float light[BST_STAR_PATH_ROOM], squared[BST_STAR_PATH_ROOM];
    bool whole; /* all samples of all places are inside */
} block_samples;

/* Subtractions change the image. A block of places is filtered again when its highest SNR, which
 * they can only lower, is the highest of all. */
struct bst_path_filter {
    const bst_star_path *path;
    block_samples samples;  /* of the latest block */
    int margin;             /* of places outside the frame, px */
    int width, height;      /* of the places: the frame and its margins */
    int columns, blocks;    /* of places: in a row, in all */
    size_t places, pixels;  /* that there is memory for */
    int frame[2];           /* width and height of the frame */
    size_t stride;          /* of the two images below */
    float *image, *weights; /* the input with BLOCK zeros on all sides */
    bool equal;             /* all weights are 1 */
    float *response;        /* [blocks][BLOCK][BLOCK] */
    float *per_noise;       /* likewise: one over the noise of the response; 0: not searched */
    float *highest;         /* [blocks] highest SNR when the block was filtered */
    int *filtered;          /* [blocks] subtractions before that; -1: to be filtered again */
    int subtractions;
    double correlation; /* variance of the response over the sum of the squared light */
    double squares;     /* sum of the squared light of the whole path */
    double psf_sigma_px;
    double least_inside;            /* share of the path inside the frame */
    double length_px, direction[2]; /* from end to end */
    double systematic_px;           /* position error beside the noise */
    double loss[SHIFTS]; /* share of the response that a shift by so many px along loses */
};

static void free_memory(bst_path_filter *f) {
    free(f->image);
    free(f->weights);
    free(f->response);
    free(f->per_noise);
    free(f->highest);
    free(f->filtered);
}

void bst_path_filter_free(bst_path_filter *f) {
    if (f) {
        free_memory(f);
        free(f);
    }
}

/* Greatest distance from the frame in x or y at which it has the least share of the path, with the
 * map of its corner. */
static int margin_of(const bst_path_filter *f) {
    const bst_star_path *p = f->path;
    double share[BST_STAR_PATH_ROOM + 1] = {0}, m[3], least = 0.0;
    bst_star_path_map(p, 2.0 * p->centre[0], 2.0 * p->centre[1], m);
    for (int k = 0; k < p->count; k++) {
        least += WEIGHED * f->least_inside * p->light[k] * p->light[k];
    }
    int most = 0;
    for (int side = 0; side < 4; side++) {
        double sum = 0.0;
        memset(share, 0, sizeof share);
        for (int k = 0; k < p->count; k++) {
            double u = p->place[k][side % 2], v = fabs(p->place[k][1 - side % 2]);
            double d = m[side % 2 ? 2 : 0] * (side < 2 ? u : -u) + fabs(m[1]) * v;
            int at = (int)fmax(fmin(ceil(d), BST_STAR_PATH_ROOM), 0.0);
            share[at] += p->light[k] * p->light[k];
        }
        for (int d = BST_STAR_PATH_ROOM; d > most; d--) {
            sum += share[d];
            most = sum >= least ? d : most;
        }
    }
    return most + 2;
}

/* Correlation of two samples of the image at a distance. */
static double correlation_at(const bst_path_filter *f, double r2) {
    return exp(-0.25 * r2 / (f->psf_sigma_px * f->psf_sigma_px));
}

/* Response of the filter to its own path, shifted along it. */
static double response_at(const bst_path_filter *f, double shift_px) {
    const bst_star_path *p = f->path;
    double sum = 0.0;
    for (int k = 0; k < p->count; k++) {
        for (int l = 0; l < p->count; l++) {
            double dx = p->place[k][0] - p->place[l][0] - shift_px * f->direction[0];
            double dy = p->place[k][1] - p->place[l][1] - shift_px * f->direction[1];
            double r2 = dx * dx + dy * dy;
            if (r2 < KERNEL * KERNEL * f->psf_sigma_px * f->psf_sigma_px) {
                sum += p->light[k] * p->light[l] * correlation_at(f, r2);
            }
        }
    }
    return sum;
}

static void measure_path(bst_path_filter *f) {
    const bst_star_path *p = f->path;
    f->squares = 0.0;
    for (int k = 0; k < p->count; k++) {
        f->squares += p->light[k] * p->light[k];
    }
    double dx = p->ends[1][0] - p->ends[0][0], dy = p->ends[1][1] - p->ends[0][1];
    f->length_px = hypot(dx, dy);
    /* the map is of first order in the rotation: half its square is left out */
    double half = 0.5 * f->length_px * p->tangent_per_px;
    f->systematic_px = SYSTEMATIC_PX + 0.5 * half * half * fmax(p->centre[0], p->centre[1]);
    f->direction[0] = f->length_px > 0.0 ? dx / f->length_px : 1.0;
    f->direction[1] = f->length_px > 0.0 ? dy / f->length_px : 0.0;
    double whole = response_at(f, 0.0);
    f->correlation = whole / f->squares;
    for (int i = 0; i < SHIFTS; i++) {
        f->loss[i] = 1.0 - response_at(f, i) / whole;
    }
}

/* Nearest whole number, halves away from zero. */
static int nearest(double v) {
    return (int)(v < 0.0 ? v - 0.5 : v + 0.5);
}

/* Shifts of the path's samples at a place, to whole pixels. */
BST_CLONES
static void shift_samples(const double (*place)[2], int count, const double m[3],
                          int (*restrict shift)[2]) {
    for (int k = 0; k < count; k++) {
        shift[k][0] = nearest(m[0] * place[k][0] + m[1] * place[k][1]);
        shift[k][1] = nearest(m[1] * place[k][0] + m[2] * place[k][1]);
    }
}

static void list_samples(bst_path_filter *f, int block) {
    const bst_star_path *p = f->path;
    const int bx = block % f->columns * BLOCK, by = block / f->columns * BLOCK;
    const int width = f->frame[0], height = f->frame[1];
    block_samples *out = &f->samples;
    double m[3];
    out->count = 0;
    out->whole = true;
    bst_star_path_map(p, bx + 0.5 * BLOCK - f->margin, by + 0.5 * BLOCK - f->margin, m);
    shift_samples(p->place, p->count, m, out->shift);
    for (int k = 0; k < p->count; k++) {
        int x = bx + out->shift[k][0] - f->margin, y = by + out->shift[k][1] - f->margin;
        out->whole = out->whole && x >= 0 && x + BLOCK <= width && y >= 0 && y + BLOCK <= height;
        if (x <= -BLOCK || x >= width || y <= -BLOCK || y >= height) {
            continue;
        }
        size_t at = (size_t)(y + BLOCK) * f->stride + (size_t)(x + BLOCK);
        float w = (float)p->light[k];
        out->image[out->count] = f->image + at;
        out->weights[out->count] = f->weights + at;
        out->light[out->count] = w;
        out->squared[out->count++] = w * w;
    }
}

/* Greatest product of two arrays of a block. */
BST_CLONES
static float highest_product(const float *a, const float *b) {
    float most[BLOCK] = {0.0f};
    for (int i = 0; i < BLOCK * BLOCK; i += BLOCK) {
        for (int k = 0; k < BLOCK; k++) {
            float v = a[i + k] * b[i + k];
            most[k] = v > most[k] ? v : most[k];
        }
    }
    for (int k = 1; k < BLOCK; k++) {
        most[0] = most[k] > most[0] ? most[k] : most[0];
    }
    return most[0];
}

/* Sums the image along the path for the places of a block; its samples are listed. */
static void sum_light(bst_path_filter *f, int block) {
    const block_samples *s = &f->samples;
    float *response = f->response + (size_t)block * BLOCK * BLOCK;
    BST_SIMD_PICK(sum_block)(s->image, s->light, s->count, f->stride, response);
    f->highest[block] = highest_product(response, f->per_noise + (size_t)block * BLOCK * BLOCK);
    f->filtered[block] = f->subtractions;
}

/* One over the noise of the response at the places of a block, from the sums of squares there. */
BST_CLONES
static void invert_noise(float *values, float least, float correlation) {
    for (int i = 0; i < BLOCK * BLOCK; i++) {
        float v = 1.0f / sqrtf(values[i] * correlation);
        values[i] = values[i] < least ? 0.0f : v;
    }
}

/* Places of the last blocks beyond the right and the lower end are none. */
static void leave_out_beyond(const bst_path_filter *f, int block) {
    const int columns = f->width - block % f->columns * BLOCK;
    const int rows = f->height - block / f->columns * BLOCK;
    float *per_noise = f->per_noise + (size_t)block * BLOCK * BLOCK;
    for (int i = 0; i < BLOCK * BLOCK && (columns < BLOCK || rows < BLOCK); i++) {
        per_noise[i] = i % BLOCK < columns && i / BLOCK < rows ? per_noise[i] : 0.0f;
    }
}

/* Filters a block of places for the first time. */
static void filter_block(bst_path_filter *f, int block) {
    const block_samples *s = &f->samples;
    float *per_noise = f->per_noise + (size_t)block * BLOCK * BLOCK;
    double most = 0.0;
    list_samples(f, block);
    for (int k = 0; k < s->count; k++) {
        most += (double)s->squared[k];
    }
    f->highest[block] = 0.0f;
    f->filtered[block] = 0;
    if (f->equal && most < f->least_inside * f->squares) {
        /* no place of the block has enough of the path inside */
        memset(per_noise, 0, sizeof(float) * BLOCK * BLOCK);
        memset(f->response + (size_t)block * BLOCK * BLOCK, 0, sizeof(float) * BLOCK * BLOCK);
        return;
    }
    if (f->equal && s->whole) {
        for (int i = 0; i < BLOCK * BLOCK; i++) {
            per_noise[i] = (float)(1.0 / sqrt(f->squares * f->correlation));
        }
    } else {
        BST_SIMD_PICK(sum_block)(s->weights, s->squared, s->count, f->stride, per_noise);
        invert_noise(per_noise, (float)(f->least_inside * f->squares), (float)f->correlation);
    }
    leave_out_beyond(f, block);
    sum_light(f, block);
}

/* Copies an image into a padded one; NULL: ones. */
static void pad_image(const bst_path_filter *f, float *to, const float *values) {
    const int width = f->frame[0], height = f->frame[1];
    memset(to, 0, f->stride * ((size_t)height + 2 * BLOCK) * sizeof *to);
    for (int y = 0; y < height; y++) {
        float *row = to + (size_t)(y + BLOCK) * f->stride + BLOCK;
        for (int x = 0; x < width && !values; x++) {
            row[x] = 1.0f;
        }
        if (values) {
            memcpy(row, values + (size_t)y * (size_t)width, (size_t)width * sizeof *row);
        }
    }
}

/* Makes room for the places of a filter and its input. */
static bst_status make_room(bst_ctx *ctx, bst_path_filter *f) {
    const size_t blocks = (size_t)f->blocks, places = blocks * BLOCK * BLOCK;
    const size_t pixels = f->stride * ((size_t)f->frame[1] + 2 * BLOCK);
    if (places <= f->places && pixels <= f->pixels) {
        return BST_OK;
    }
    free_memory(f);
    f->places = places;
    f->pixels = pixels;
    f->image = malloc(pixels * sizeof *f->image);
    f->weights = malloc(pixels * sizeof *f->weights);
    f->response = malloc(places * sizeof *f->response);
    f->per_noise = malloc(places * sizeof *f->per_noise);
    f->highest = malloc(blocks * sizeof *f->highest);
    f->filtered = malloc(blocks * sizeof *f->filtered);
    if (!f->image || !f->weights || !f->response || !f->per_noise || !f->highest || !f->filtered) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a matched filter of %d x %d px",
                        f->frame[0], f->frame[1]);
    }
    return BST_OK;
}

bst_status bst_path_filter_create(bst_ctx *ctx, const bst_star_path *path,
                                  const bst_star_path_image *image, double psf_sigma_px,
                                  double least_inside, bst_path_filter **out) {
    return bst_path_filter_create_weighted(ctx, path, image, NULL, psf_sigma_px, least_inside, out);
}

bst_status bst_path_filter_create_weighted(bst_ctx *ctx, const bst_star_path *path,
                                           const bst_star_path_image *image, const float *weights,
                                           double psf_sigma_px, double least_inside,
                                           bst_path_filter **out) {
    *out = NULL;
    return bst_path_filter_renew(ctx, path, image, weights, psf_sigma_px, least_inside, out);
}

bst_status bst_path_filter_renew(bst_ctx *ctx, const bst_star_path *path,
                                 const bst_star_path_image *image, const float *weights,
                                 double psf_sigma_px, double least_inside, bst_path_filter **out) {
    assert(path && path->count > 0 && image && psf_sigma_px > 0.0 && psf_sigma_px <= MOST_SIGMA &&
           least_inside > 0.0 && out);
    bst_path_filter *f = *out ? *out : calloc(1, sizeof *f);
    if (!f) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a matched filter");
    }
    *out = f;
    f->path = path;
    f->psf_sigma_px = psf_sigma_px;
    f->least_inside = least_inside;
    f->equal = !weights;
    f->margin = margin_of(f);
    f->width = image->width + 2 * f->margin;
    f->height = image->height + 2 * f->margin;
    f->columns = (f->width + BLOCK - 1) / BLOCK;
    f->blocks = f->columns * ((f->height + BLOCK - 1) / BLOCK);
    f->frame[0] = image->width;
    f->frame[1] = image->height;
    f->stride = (size_t)image->width + 2 * BLOCK;
    f->subtractions = 0;
    bst_status status = make_room(ctx, f);
    if (status != BST_OK) {
        bst_path_filter_free(f);
        *out = NULL;
        return status;
    }
    measure_path(f);
    pad_image(f, f->image, image->values);
    pad_image(f, f->weights, weights);
    for (int i = 0; i < f->blocks; i++) {
        filter_block(f, i);
    }
    return BST_OK;
}

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

double bst_path_filter_spread(const bst_path_filter *f) {
    assert(f && f->subtractions == 0);
    double spread = 1.0;
    const int places = f->blocks * BLOCK * BLOCK;
    const int stride = places / SPREAD_PLACES | 1; /* odd: columns do not repeat */
    for (int pass = 0; pass < SPREAD_PASSES; pass++) {
        double sum = 0.0;
        int64_t count = 0;
        for (int i = 0; i < places; i += stride) {
            double snr = (double)(f->response[i] * f->per_noise[i]);
            if (snr < 0.0 && snr > -SPREAD_CLIP * spread) {
                sum += snr * snr;
                count++;
            }
        }
        if (count < LEAST_PLACES) {
            return 1.0;
        }
        spread = sqrt(sum / (double)count / SPREAD_SHARE);
    }
    return spread;
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
static double along_sigma_px(const bst_path_filter *f, double snr) {
    double wanted = ALONG_LOSS / (snr * snr);
    for (int i = 1; i < SHIFTS; i++) {
        if (f->loss[i] >= wanted) {
            double share = (wanted - f->loss[i - 1]) / (f->loss[i] - f->loss[i - 1]);
            return i == 1 ? sqrt(share) : i - 1 + share; /* parabolic at its maximum */
        }
    }
    return SHIFTS;
}

/* Filters a block again if it was before the latest subtraction. */
static void refresh(bst_path_filter *f, int block) {
    if (f->filtered[block] < f->subtractions) {
        list_samples(f, block);
        sum_light(f, block);
    }
}

/* Block with the highest SNR; -1: no SNR is positive. It and those about it are up to date. */
static int highest_block(bst_path_filter *f) {
    int best = -1;
    do {
        float most = 0.0f;
        if (best >= 0) {
            refresh(f, best);
            most = f->highest[best];
        }
        for (int i = 0; i < f->blocks; i++) {
            if (f->highest[i] > most) {
                most = f->highest[i];
                best = i;
            }
        }
        if (!(most > 0.0f)) {
            return -1;
        }
    } while (f->filtered[best] < f->subtractions);
    const int x = best % f->columns, y = best / f->columns, rows = f->blocks / f->columns;
    for (int k = 0; k < 9; k++) {
        int i = x + k % 3 - 1, j = y + k / 3 - 1;
        if (i >= 0 && j >= 0 && i < f->columns && j < rows) {
            refresh(f, j * f->columns + i);
        }
    }
    return best;
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
        along[i - left] = (float)correlation_at(f, (i - x) * (i - x));
    }
    for (int j = top; j <= bottom; j++) {
        float *row = f->image + (size_t)(j + BLOCK) * f->stride + BLOCK;
        float value = (float)(amplitude * correlation_at(f, (j - y) * (j - y)));
        for (int i = left; i <= right; i++) {
            row[i] -= value * along[i - left];
        }
    }
}

void bst_path_filter_subtract(bst_path_filter *f, const bst_path_filter_peak *peak) {
    assert(f && peak);
    const bst_star_path *p = f->path;
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
                f->per_noise[index_of(f, x, y)] = 0.0f;
                f->filtered[y / BLOCK * f->columns + x / BLOCK] = -1;
            }
        }
    }
}
