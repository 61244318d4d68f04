#include "view/pixel_bins.h"

#include <string.h>

/* Mean of the pixels of a bin. */
static uint16_t mean_of(const uint16_t *data, int width, int height, int x0, int y0, int n) {
    const int x1 = x0 + n < width ? x0 + n : width, y1 = y0 + n < height ? y0 + n : height;
    const uint64_t count = (uint64_t)(x1 - x0) * (uint64_t)(y1 - y0);
    uint64_t sum = 0;
    for (int y = y0; y < y1; y++) {
        const uint16_t *row = data + (size_t)y * (size_t)width;
        for (int x = x0; x < x1; x++) {
            sum += row[x];
        }
    }
    return (uint16_t)((sum + count / 2) / count);
}

void bst_view_bin_pixels(bst_view_bytes *pixels, int n) {
    const int width = pixels->width, height = pixels->height;
    uint16_t *data = pixels->data;
    if (n <= 1 || width <= 0 || height <= 0) {
        return;
    }
    size_t k = 0; /* a bin lies behind the place where its mean goes, or at it */
    for (int y = 0; y < height; y += n) {
        for (int x = 0; x < width; x += n) {
            data[k++] = mean_of(data, width, height, x, y, n);
        }
    }
    pixels->binning = n;
    pixels->frame_width = width;
    pixels->frame_height = height;
    pixels->width = (width + n - 1) / n;
    pixels->height = (height + n - 1) / n;
    pixels->bytes = k * sizeof *data;
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
