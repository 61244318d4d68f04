#include <assert.h>
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "imgproc/streak/path_filter_internal.h"
#include "sim/core/simd.h"

enum { BLOCK = BST_PATH_BLOCK, KERNEL = 5 };
enum { MOST_SIGMA = 4 }; /* widest PSF, px */
/* Passes of the clipped spread, the places that it needs, and those that it takes. */
enum { SPREAD_PASSES = 3, LEAST_PLACES = 1000, SPREAD_PLACES = 65536 };
/* Samples of a path from which on every second place of every second row shows where no star is:
 * a star is less than 1 px beside the lines through them along its path. */
enum { LONG_PATH = 16 };

/* Position error beside the noise: samples at whole pixels, and the path's own error. */
static const double SYSTEMATIC_PX = 0.2;
/* Least share of the path inside the frame over what is asked: weights may exceed 1 a little. */
static const double WEIGHED = 0.8;

/* The highest SNR of a block over that of its places on every second row and column: a place is up
 * to 1 px beside the next of them, of streaks that the frame cuts short a little more; and by noise
 * so many standard deviations of what two places 1 px apart do not share. */
static const double BESIDE2_PX2 = 1.5, BOUND_SIGMAS = 2.5;
/* Values of the response beyond this are clipped; mean square of a normal deviate up to it:
 * 1 - 2 c phi(c) / erf(c / sqrt(2)) */
static const double SPREAD_CLIP = 3.0, SPREAD_SHARE = 0.9733;

#define BST_SIMD_KERNELS "imgproc/streak/path_filter_kernels.inc"
#include "sim/core/simd_each.inc"

static void free_memory(bst_path_filter *f) {
    free(f->image);
    free(f->weights);
    free(f->half);
    free(f->response);
    free(f->per_noise);
    free(f->highest);
    free(f->of_row);
    free(f->first);
    free(f->filtered);
    f->image = f->weights = f->half = NULL;
    f->places = 0;
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
    const bst_star_path *p = &f->path;
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

/* Greatest distance of a sample of the path from the one before it. */
static double widest_step(const bst_star_path *p) {
    double widest = 0.0;
    for (int k = 1; k < p->count; k++) {
        widest = fmax(widest, hypot(p->place[k][0] - p->place[k - 1][0],
                                    p->place[k][1] - p->place[k - 1][1]));
    }
    return widest;
}

/* Response of the filter to its own path, shifted along it. */
static double response_at(const bst_path_filter *f, double shift_px) {
    const bst_star_path *p = &f->path;
    const double reach = KERNEL * f->psf_sigma_px;
    double sum = 0.0;
    for (int k = 0; k < p->count; k++) {
        for (int l = 0; l < p->count;) {
            double dx = p->place[k][0] - p->place[l][0] - shift_px * f->direction[0];
            double dy = p->place[k][1] - p->place[l][1] - shift_px * f->direction[1];
            double r2 = dx * dx + dy * dy;
            int next = 1;
            if (r2 < reach * reach) {
                sum += p->light[k] * p->light[l] * bst_path_filter_correlation(f, r2);
            } else { /* those that are too far away for certain */
                next = (int)fmin(fmax((sqrt(r2) - reach) / f->step_px, 1.0), p->count);
            }
            l += next;
        }
    }
    return sum;
}

static void measure_path(bst_path_filter *f) {
    const bst_star_path *p = &f->path;
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
    f->step_px = fmax(1.001 * widest_step(p), 1e-9);
    f->whole = response_at(f, 0.0);
    f->correlation = f->whole / f->squares;
    f->losses = 0;
}

double bst_path_filter_loss(bst_path_filter *f, int shift_px) {
    assert(shift_px >= 0 && shift_px < BST_PATH_SHIFTS);
    for (; f->losses <= shift_px; f->losses++) {
        f->loss[f->losses] = 1.0 - response_at(f, f->losses) / f->whole;
    }
    return f->loss[shift_px];
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

/* Lists the samples of a square of places.
 *
 * Given:     bx, by  the first place
 *            step    px from place to place: 1, or 2 for the images of every second pixel */
static void list_samples(bst_path_filter *f, int bx, int by, int step) {
    const bst_star_path *p = &f->path;
    const int width = f->frame[0], height = f->frame[1], side = step * BLOCK;
    bst_path_samples *out = &f->samples;
    double m[3];
    out->count = 0;
    out->whole = true;
    bst_star_path_map(p, bx + 0.5 * side - f->margin, by + 0.5 * side - f->margin, m);
    shift_samples(p->place, p->count, m, out->place);
    for (int k = 0; k < p->count; k++) {
        int x = bx + out->place[k][0] - f->margin, y = by + out->place[k][1] - f->margin;
        out->whole = out->whole && x >= 0 && x + side <= width && y >= 0 && y + side <= height;
        if (x <= -side || x >= width || y <= -side || y >= height) {
            continue;
        }
        const size_t u = (size_t)(x + side), v = (size_t)(y + side); /* with the zeros outside */
        const int i = out->count++;
        if (step == 1) {
            out->image[i] = f->image + v * f->stride + u;
            out->weights[i] = f->weights ? f->weights + v * f->stride + u : NULL;
        } else {
            out->image[i] =
                f->half + (v % 2 * 2 + u % 2) * f->half_size + v / 2 * f->half_stride + u / 2;
        }
        out->place[i][0] = x;
        out->place[i][1] = y;
        out->light[i] = (float)p->light[k];
        out->squared[i] = out->light[i] * out->light[i];
    }
}

/* First of BLOCK places, 1 or 2 px apart, that is not before one; BLOCK: none is. */
static int first_place(int from, int least, int step) {
    int i = from < least ? (least - from + step - 1) >> (step - 1) : 0;
    return i < BLOCK ? i : BLOCK;
}

/* Sums of the squared light inside the frame at the places of a square whose samples are listed:
 * each sample is inside over a rectangle of places. */
static void sum_inside(const bst_path_filter *f, int step, float *out) {
    const bst_path_samples *s = &f->samples;
    double sum[BLOCK + 1][BLOCK + 1] = {{0}}; /* changes from place to place, in x and in y */
    for (int k = 0; k < s->count; k++) {
        const int x = s->place[k][0], y = s->place[k][1];
        const int x0 = first_place(x, 0, step), x1 = first_place(x, f->frame[0], step);
        const int y0 = first_place(y, 0, step), y1 = first_place(y, f->frame[1], step);
        const double v = (double)s->squared[k];
        sum[y0][x0] += v;
        sum[y0][x1] -= v;
        sum[y1][x0] -= v;
        sum[y1][x1] += v;
    }
    for (int y = 0; y < BLOCK; y++) {
        double row = 0.0;
        for (int x = 0; x < BLOCK; x++) {
            row += sum[y][x];
            sum[y][x] = row + (y > 0 ? sum[y - 1][x] : 0.0);
            out[y * BLOCK + x] = (float)sum[y][x];
        }
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

/* Notes the highest SNR of a block, and that of its row. */
static void note_highest(bst_path_filter *f, int block, float snr) {
    const int row = block / f->columns;
    const float before = f->highest[block], *all = f->highest + (size_t)row * (size_t)f->columns;
    f->highest[block] = snr;
    if (snr >= f->of_row[row]) {
        f->of_row[row] = snr;
    } else if (before >= f->of_row[row]) {
        f->of_row[row] = 0.0f;
        for (int i = 0; i < f->columns; i++) {
            f->of_row[row] = all[i] > f->of_row[row] ? all[i] : f->of_row[row];
        }
    }
}

/* Sums the image along the path for the places of a block; its samples are listed. */
static void sum_light(bst_path_filter *f, int block) {
    const bst_path_samples *s = &f->samples;
    float *response = f->response + (size_t)block * BLOCK * BLOCK;
    BST_SIMD_PICK(sum_block)(s->image, s->light, s->count, f->stride, response);
    note_highest(f, block, highest_product(response, f->per_noise + (size_t)block * BLOCK * BLOCK));
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

/* One over the noise at the places of a square whose samples are listed. False: nowhere is enough
 * of the path inside. */
static bool measure_noise(const bst_path_filter *f, int step, float *per_noise) {
    const bst_path_samples *s = &f->samples;
    double most = 0.0;
    for (int k = 0; k < s->count; k++) {
        most += (double)s->squared[k];
    }
    if (!f->weights && most < f->least_inside * f->squares) {
        memset(per_noise, 0, sizeof(float) * BLOCK * BLOCK);
        return false;
    }
    if (!f->weights && s->whole) {
        const float value = (float)(1.0 / sqrt(f->squares * f->correlation));
        for (int i = 0; i < BLOCK * BLOCK; i++) {
            per_noise[i] = value;
        }
        return true;
    }
    if (f->weights) {
        BST_SIMD_PICK(sum_block)(s->weights, s->squared, s->count, f->stride, per_noise);
    } else {
        sum_inside(f, step, per_noise);
    }
    invert_noise(per_noise, (float)(f->least_inside * f->squares), (float)f->correlation);
    return true;
}

/* Filters a block of places for the first time. */
static void filter_block(bst_path_filter *f, int block) {
    float *per_noise = f->per_noise + (size_t)block * BLOCK * BLOCK;
    list_samples(f, block % f->columns * BLOCK, block / f->columns * BLOCK, 1);
    if (!measure_noise(f, 1, per_noise)) {
        memset(f->response + (size_t)block * BLOCK * BLOCK, 0, sizeof(float) * BLOCK * BLOCK);
        note_highest(f, block, 0.0f);
        f->filtered[block] = f->subtractions;
        return;
    }
    leave_out_beyond(f, block);
    sum_light(f, block);
}

void bst_path_filter_refresh(bst_path_filter *f, int block) {
    if (f->filtered[block] == BST_PATH_BOUND) {
        filter_block(f, block);
    } else if (f->filtered[block] < f->subtractions) {
        list_samples(f, block % f->columns * BLOCK, block / f->columns * BLOCK, 1);
        sum_light(f, block);
    }
}

/* Greatest products of two arrays in each quarter of a square, and whether any factor of the second
 * is not zero. */
BST_CLONES
static void highest_of_quarters(const float *a, const float *b, float highest[4], bool any[4]) {
    for (int half = 0; half < 2; half++) {
        float most[BLOCK] = {0.0f}, factor[BLOCK] = {0.0f};
        for (int y = half * BLOCK / 2; y < (half + 1) * BLOCK / 2; y++) {
            for (int x = 0; x < BLOCK; x++) {
                float v = a[y * BLOCK + x] * b[y * BLOCK + x];
                most[x] = v > most[x] ? v : most[x];
                factor[x] += b[y * BLOCK + x];
            }
        }
        for (int k = 0; k < 2; k++) {
            float sum = 0.0f, top = 0.0f;
            for (int x = k * BLOCK / 2; x < (k + 1) * BLOCK / 2; x++) {
                top = most[x] > top ? most[x] : top;
                sum += factor[x];
            }
            highest[2 * half + k] = top;
            any[2 * half + k] = sum > 0.0f;
        }
    }
}

/* Bounds of four blocks, by every second place of every second row. */
static void bound_blocks(bst_path_filter *f, int column, int row) {
    float per_noise[BLOCK * BLOCK], response[BLOCK * BLOCK], highest[4] = {0.0f};
    bool any[4] = {false};
    const double beside = bst_path_filter_correlation(f, BESIDE2_PX2);
    const double near = bst_path_filter_correlation(f, 1.0);
    const double more = BOUND_SIGMAS * sqrt(1.0 - near * near) / near;
    list_samples(f, column * BLOCK, row * BLOCK, 2);
    if (measure_noise(f, 2, per_noise)) {
        const bst_path_samples *s = &f->samples;
        BST_SIMD_PICK(sum_block)(s->image, s->light, s->count, f->half_stride, response);
        highest_of_quarters(response, per_noise, highest, any);
    }
    for (int k = 0; k < 4; k++) {
        const int x = column + k % 2, y = row + k / 2, block = y * f->columns + x;
        if (x < f->columns && y < f->rows) {
            note_highest(f, block, any[k] ? (float)((double)highest[k] / beside + more) : 0.0f);
            f->filtered[block] = BST_PATH_BOUND;
        }
    }
}

/* Copies an image into a padded one; NULL: nothing. */
static void pad_image(const bst_path_filter *f, float *to, const float *values) {
    const size_t width = (size_t)f->frame[0];
    for (size_t y = 0; values && y < (size_t)f->frame[1]; y++) {
        memcpy(to + (y + BLOCK) * f->stride + BLOCK, values + y * width, width * sizeof *to);
    }
}

/* Every second value of a row, from the first and from the second on. */
BST_CLONES
static void split_row(const float *restrict from, int count, float *restrict even,
                      float *restrict odd) {
    for (int i = 0; i < count / 2; i++) {
        even[i] = from[2 * i];
        odd[i] = from[2 * i + 1];
    }
    if (count % 2) {
        even[count / 2] = from[count - 1];
    }
}

/* Copies every second pixel of every second row, from each of the first four on, into images that
 * are padded by BLOCK zeros. */
static void split_image(bst_path_filter *f, const float *values) {
    const int width = f->frame[0];
    for (int y = 0; y < f->frame[1]; y++) {
        float *to = f->half + (size_t)(y % 2 * 2) * f->half_size +
                    (size_t)(y / 2 + BLOCK) * f->half_stride + BLOCK;
        split_row(values + (size_t)y * (size_t)width, width, to, to + f->half_size);
    }
}

/* Makes room for the places of a filter and its input; images are zero. */
static bst_status make_room(bst_ctx *ctx, bst_path_filter *f, const bst_star_path_image *image,
                            bool weights) {
    const size_t blocks = (size_t)f->blocks, places = blocks * BLOCK * BLOCK;
    if (places <= f->places && image->width == f->frame[0] && image->height == f->frame[1] &&
        weights == (f->weights != NULL) && f->by_bounds <= (f->half != NULL)) {
        return BST_OK;
    }
    free_memory(f);
    f->places = places;
    f->frame[0] = image->width;
    f->frame[1] = image->height;
    f->stride = (size_t)image->width + 2 * BLOCK;
    f->half_stride = (size_t)(image->width + 1) / 2 + 2 * BLOCK;
    f->half_size = f->half_stride * ((size_t)(image->height + 1) / 2 + 2 * BLOCK);
    const size_t pixels = f->stride * ((size_t)image->height + 2 * BLOCK);
    f->image = calloc(pixels, sizeof *f->image);
    f->weights = weights ? calloc(pixels, sizeof *f->weights) : NULL;
    f->half = f->by_bounds ? calloc(4 * f->half_size, sizeof *f->half) : NULL;
    f->response = malloc(places * sizeof *f->response);
    f->per_noise = malloc(places * sizeof *f->per_noise);
    f->highest = malloc(blocks * sizeof *f->highest);
    f->of_row = malloc(blocks * sizeof *f->of_row);
    f->first = malloc(blocks * sizeof *f->first);
    f->filtered = malloc(blocks * sizeof *f->filtered);
    if (!f->image || (weights && !f->weights) || (f->by_bounds && !f->half) || !f->response ||
        !f->per_noise || !f->highest || !f->of_row || !f->first || !f->filtered) {
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
    f->path = *path;
    f->psf_sigma_px = psf_sigma_px;
    f->least_inside = least_inside;
    f->margin = margin_of(f);
    f->width = image->width + 2 * f->margin;
    f->height = image->height + 2 * f->margin;
    f->columns = (f->width + BLOCK - 1) / BLOCK;
    f->rows = (f->height + BLOCK - 1) / BLOCK;
    f->blocks = f->columns * f->rows;
    f->subtractions = 0;
    f->left_out = false;
    f->by_bounds = !weights && path->count >= LONG_PATH;
    bst_status status = make_room(ctx, f, image, weights != NULL);
    if (status != BST_OK) {
        bst_path_filter_free(f);
        *out = NULL;
        return status;
    }
    measure_path(f);
    pad_image(f, f->image, image->values);
    pad_image(f, f->weights, weights);
    memset(f->highest, 0, (size_t)f->blocks * sizeof *f->highest);
    memset(f->of_row, 0, (size_t)f->rows * sizeof *f->of_row);
    if (f->by_bounds) {
        split_image(f, image->values);
    }
    for (int y = 0; f->by_bounds && y < f->rows; y += 2) {
        for (int x = 0; x < f->columns; x += 2) {
            bound_blocks(f, x, y);
        }
    }
    for (int i = 0; !f->by_bounds && i < f->blocks; i++) {
        filter_block(f, i);
    }
    memcpy(f->first, f->highest, (size_t)f->blocks * sizeof *f->first);
    return BST_OK;
}

bool bst_path_filter_is_of(const bst_path_filter *f, const bst_star_path *path) {
    assert(f && path);
    const bst_star_path *p = &f->path;
    const size_t count = (size_t)path->count;
    return p->count == path->count && p->tangent_per_px == path->tangent_per_px &&
           memcmp(p->centre, path->centre, sizeof p->centre) == 0 &&
           memcmp(p->ends, path->ends, sizeof p->ends) == 0 &&
           memcmp(p->place, path->place, count * sizeof *p->place) == 0 &&
           memcmp(p->light, path->light, count * sizeof *p->light) == 0;
}

void bst_path_filter_restart(bst_path_filter *f, const bst_star_path_image *image) {
    assert(f && image && image->width == f->frame[0] && image->height == f->frame[1]);
    if (f->subtractions > 0) {
        pad_image(f, f->image, image->values);
    }
    for (int i = 0; i < f->blocks; i++) {
        if (f->filtered[i] > 0 || f->left_out) {
            f->filtered[i] = BST_PATH_BOUND;
            note_highest(f, i, f->first[i]);
        }
    }
    f->subtractions = 0;
    f->left_out = false;
}

double bst_path_filter_spread(const bst_path_filter *f) {
    assert(f && f->subtractions == 0 && !f->by_bounds);
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
