#include "imgproc/detect/simd_layout.h"
#include "imgproc/stack/stack_internal.h"

BST_CLONES_256
void stack_rows_add4(const int16_t *const in[4], int in_stride, int16_t *restrict out,
                     int out_stride, int width, int height) {
    for (int y = 0; y < height; y++) {
        const int16_t *a = in[0] + (long)y * in_stride, *b = in[1] + (long)y * in_stride,
                      *c = in[2] + (long)y * in_stride, *d = in[3] + (long)y * in_stride;
        int16_t *to = out + (long)y * out_stride;
        for (int x = 0; x < width; x++) {
            to[x] = (int16_t)(a[x] + b[x] + c[x] + d[x]);
        }
    }
}

/* Largest sum of four rectangles. */
BST_CLONES_256
static int greatest4(const int16_t *const *in, int stride, int width, int height) {
    int16_t most = INT16_MIN;
    for (int y = 0; y < height; y++) {
        const int16_t *a = in[0] + (long)y * stride, *b = in[1] + (long)y * stride,
                      *c = in[2] + (long)y * stride, *d = in[3] + (long)y * stride;
        for (int x = 0; x < width; x++) {
            int16_t sum = (int16_t)(a[x] + b[x] + c[x] + d[x]);
            most = sum > most ? sum : most;
        }
    }
    return most;
}

/* Largest sum of `count` rectangles. */
BST_CLONES_256
static int greatest(const int16_t *const *in, int count, int stride, int16_t *restrict row,
                    int width, int height) {
    int16_t most = INT16_MIN;
    for (int y = 0; y < height; y++) {
        for (int x = 0; x < width; x++) {
            row[x] = in[0][(long)y * stride + x];
        }
        for (int i = 1; i < count; i++) {
            const int16_t *from = in[i] + (long)y * stride;
            for (int x = 0; x < width; x++) {
                row[x] = (int16_t)(row[x] + from[x]);
            }
        }
        for (int x = 0; x < width; x++) {
            most = row[x] > most ? row[x] : most;
        }
    }
    return most;
}

int stack_rows_greatest(const int16_t *const *in, int count, int stride, int16_t *row, int width,
                        int height) {
    return count == 4 ? greatest4(in, stride, width, height)
                      : greatest(in, count, stride, row, width, height);
}

BST_CLONES_256
void stack_rows_add_bytes(const int8_t *restrict in, int16_t *restrict sum, int count) {
    for (int x = 0; x < count; x++) {
        sum[x] = (int16_t)(sum[x] + (in[x] == STACK_NONE ? 0 : in[x]));
    }
}
