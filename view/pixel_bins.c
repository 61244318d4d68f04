#include "view/pixel_bins.h"

#include <stdlib.h>
#include <string.h>

/* Largest number in a request for a part. */
static const int64_t NUMBER_MOST = INT64_C(1) << 40;

bool bst_view_fit_part(bst_view_part *part, int width, int height) {
    const int64_t numbers[] = {part->x,      part->y,       part->width,
                               part->height, part->binning, part->longest};
    for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++) {
        if (numbers[i] < 0 || numbers[i] > NUMBER_MOST) {
            return false;
        }
    }
    if (part->x >= width || part->y >= height || part->binning > BST_VIEW_BINNING_MOST) {
        return false;
    }
    const int64_t right = width - part->x, below = height - part->y;
    part->width = part->width == 0 || part->width > right ? right : part->width;
    part->height = part->height == 0 || part->height > below ? below : part->height;
    part->binning = part->binning > 0 ? part->binning : 1;
    if (part->longest > 0) {
        const int64_t side = part->width > part->height ? part->width : part->height;
        const int64_t least = bst_view_bins(side, part->longest);
        part->binning = part->binning > least ? part->binning : least;
    }
    return part->binning <= BST_VIEW_BINNING_MOST;
}

/* Bins of 2 x 2 pixels, as most pages of live runs ask for: the compiler makes vectors of it. */
static void bin_pairs(const uint16_t *row, const uint16_t *next, int bins, uint16_t *out) {
    for (int k = 0; k < bins; k++) {
        out[k] =
            (uint16_t)((2u + row[2 * k] + row[2 * k + 1] + next[2 * k] + next[2 * k + 1]) >> 2);
    }
}

void bst_view_bin_row(const uint16_t *rows, size_t stride, int width, int count, int n,
                      uint32_t *sums, uint16_t *out) {
    if (n == 1) {
        memcpy(out, rows, (size_t)width * sizeof *out);
        return;
    }
    if (n == 2 && count == 2 && width % 2 == 0) {
        bin_pairs(rows, rows + stride, width / 2, out);
        return;
    }
    for (int x = 0; x < width; x++) {
        sums[x] = rows[x];
    }
    for (int y = 1; y < count; y++) { /* along columns first: the compiler makes vectors of it */
        const uint16_t *row = rows + (size_t)y * stride;
        for (int x = 0; x < width; x++) {
            sums[x] += row[x];
        }
    }
    for (int x = 0; x < width; x += n) {
        const int end = x + n < width ? x + n : width;
        const uint32_t pixels = (uint32_t)(end - x) * (uint32_t)count;
        uint32_t sum = pixels / 2; /* at most 256 * 256 * 65535.5: within 32 bits */
        for (int i = x; i < end; i++) {
            sum += sums[i];
        }
        *out++ = (uint16_t)(sum / pixels);
    }
}

bool bst_view_bin_part(const uint16_t *pixels, size_t stride, const bst_view_part *part,
                       uint16_t *out) {
    const int n = (int)part->binning, width = (int)part->width;
    uint32_t *sums = malloc((size_t)width * sizeof *sums);
    for (int64_t y = 0; sums && y < part->height; y += n) {
        const int64_t left = part->height - y;
        bst_view_bin_row(pixels + (size_t)(part->y + y) * stride + part->x, stride, width,
                         left < n ? (int)left : n, n, sums, out);
        out += bst_view_bins(width, n);
    }
    free(sums);
    return sums != NULL;
}

void bst_view_peak_pixels(const uint16_t *pixels, int width, int height, int n, uint16_t *row,
                          uint16_t *out) {
    for (int y = 0; y < height; y += n) {
        const int rows = y + n < height ? n : height - y;
        memcpy(row, pixels + (size_t)y * (size_t)width, (size_t)width * sizeof *row);
        for (int j = 1; j < rows; j++) { /* along columns first: the compiler makes vectors of it */
            const uint16_t *next = pixels + (size_t)(y + j) * (size_t)width;
            for (int x = 0; x < width; x++) {
                row[x] = next[x] > row[x] ? next[x] : row[x];
            }
        }
        for (int x = 0; x < width; x += n) {
            const int end = x + n < width ? x + n : width;
            uint16_t peak = row[x];
            for (int i = x + 1; i < end; i++) {
                peak = row[i] > peak ? row[i] : peak;
            }
            *out++ = peak;
        }
    }
}
