#include "sim/eval/error_statistics.h"

#include <math.h>
#include <string.h>

#define BIN_RATIO 1.001
#define BIN_FIRST_PX 1e-5

void bst_error_statistics_add(bst_error_statistics *s, double x_px, double y_px) {
    double size = hypot(x_px, y_px);
    double bin = size > BIN_FIRST_PX ? log(size / BIN_FIRST_PX) / log(BIN_RATIO) : 0.0;
    s->bins[bin < BST_ERROR_BINS - 1 ? (int)bin : BST_ERROR_BINS - 1]++;
    s->count++;
    s->sum_x += x_px;
    s->sum_y += y_px;
    s->sum2 += size * size;
    s->largest = fmax(s->largest, size);
}

void bst_error_statistics_archive(bst_error_statistics *s, bst_archive *archive) {
    int filled = 0;
    for (int b = 0; b < BST_ERROR_BINS; b++) {
        filled += s->bins[b] != 0;
    }
    filled = bst_archive_count(archive, filled, BST_ERROR_BINS);
    if (bst_archive_is_restoring(archive)) {
        memset(s->bins, 0, sizeof s->bins);
    }
    for (int b = 0, k = 0; k < filled; b++, k++) {
        while (!bst_archive_is_restoring(archive) && s->bins[b] == 0) {
            b++;
        }
        b = (int)bst_archive_integer(archive, b, 0, BST_ERROR_BINS - 1);
        BST_ARCHIVE(archive, s->bins[b]);
    }
    BST_ARCHIVE(archive, s->count);
    BST_ARCHIVE(archive, s->sum_x);
    BST_ARCHIVE(archive, s->sum_y);
    BST_ARCHIVE(archive, s->sum2);
    BST_ARCHIVE(archive, s->largest);
}

double bst_error_statistics_rms(const bst_error_statistics *s) {
    return s->count > 0 ? sqrt(s->sum2 / (double)s->count) : NAN;
}

double bst_error_statistics_bias(const bst_error_statistics *s) {
    return s->count > 0 ? hypot(s->sum_x, s->sum_y) / (double)s->count : NAN;
}

double bst_error_statistics_quantile(const bst_error_statistics *s, double q) {
    int64_t seen = 0;
    for (int b = 0; b < BST_ERROR_BINS && s->count > 0; b++) {
        seen += s->bins[b];
        if (seen > 0 && (double)seen >= q * (double)s->count) {
            return fmin(BIN_FIRST_PX * pow(BIN_RATIO, b + 0.5), s->largest);
        }
    }
    return NAN;
}

double bst_error_statistics_largest(const bst_error_statistics *s) {
    return s->count > 0 ? s->largest : NAN;
}
