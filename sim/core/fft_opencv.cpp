/* Fourier transforms by OpenCV, whose licence (Apache 2.0) does not affect programs that use it.
 *
 * cv::hal::DFT2D is the transform inside cv::dft with tables that are kept. Its spectrum of a real
 * array has the size of that array ("CCS", OpenCV reference manual, cv::dft): columns 2 k - 1 and
 * 2 k hold real and imaginary part of frequency k. Column 0, and the last one if their number is
 * even, hold frequencies 0 and columns / 2, packed in the same way along the column. */
#include <opencv2/core/hal/interface.h>
#include <cassert>
#include <cstdlib>
#include <new>
#include <opencv2/core.hpp>
#include <opencv2/core/hal/hal.hpp>
#include <opencv2/core/version.hpp>

#include "sim/core/fft.h"
#include "sim/core/pages.h"

struct bst_fft {
    bst_fft_kind kind;
    int rows, columns;
    size_t value_bytes;
    unsigned char *in, *out;
    unsigned char *packed; /* [rows][columns] values for transforms of real arrays, or NULL */
    cv::Ptr<cv::hal::DFT2D> transform;
};

namespace {

/* Calls body(column of CCS, frequency) for the columns that are packed along their length. */
template <typename Body>
void for_packed_columns(int columns, Body body) {
    body(0, 0);
    if (columns % 2 == 0) {
        body(columns - 1, columns / 2);
    }
}

template <typename Real>
void unpack(const bst_fft *f) {
    size_t columns = static_cast<size_t>(f->columns), half = columns / 2 + 1;
    int rows = f->rows;
    const Real *from = reinterpret_cast<const Real *>(f->packed);
    Real *to = reinterpret_cast<Real *>(f->out);
    for (size_t v = 0; v < static_cast<size_t>(rows); v++) {
        for (size_t u = 1; 2 * u < columns; u++) {
            to[2 * (v * half + u)] = from[v * columns + 2 * u - 1];
            to[2 * (v * half + u) + 1] = from[v * columns + 2 * u];
        }
    }
    for_packed_columns(f->columns, [&](int column, int u) {
        auto value = [&](int row) {
            return from[static_cast<size_t>(row) * columns + static_cast<size_t>(column)];
        };
        auto put = [&](int v, Real re, Real im) {
            Real *z = to + 2 * (static_cast<size_t>(v) * half + static_cast<size_t>(u));
            z[0] = re;
            z[1] = im;
        };
        put(0, value(0), Real(0));
        for (int v = 1; 2 * v < rows; v++) {
            put(v, value(2 * v - 1), value(2 * v));
            put(rows - v, value(2 * v - 1), -value(2 * v));
        }
        if (rows % 2 == 0) {
            put(rows / 2, value(rows - 1), Real(0));
        }
    });
}

template <typename Real>
void pack(const bst_fft *f) {
    size_t columns = static_cast<size_t>(f->columns), half = columns / 2 + 1;
    int rows = f->rows;
    const Real *from = reinterpret_cast<const Real *>(f->in);
    Real *to = reinterpret_cast<Real *>(f->packed);
    for (size_t v = 0; v < static_cast<size_t>(rows); v++) {
        for (size_t u = 1; 2 * u < columns; u++) {
            to[v * columns + 2 * u - 1] = from[2 * (v * half + u)];
            to[v * columns + 2 * u] = from[2 * (v * half + u) + 1];
        }
    }
    for_packed_columns(f->columns, [&](int column, int u) {
        auto part = [&](int v, size_t which) {
            return from[2 * (static_cast<size_t>(v) * half + static_cast<size_t>(u)) + which];
        };
        auto put = [&](int row, Real value) {
            to[static_cast<size_t>(row) * columns + static_cast<size_t>(column)] = value;
        };
        put(0, part(0, 0));
        for (int v = 1; 2 * v < rows; v++) {
            put(2 * v - 1, part(v, 0));
            put(2 * v, part(v, 1));
        }
        if (rows % 2 == 0) {
            put(rows - 1, part(rows / 2, 0));
        }
    });
}

bool is_real(bst_fft_kind kind) {
    return kind == BST_FFT_REAL_FORWARD || kind == BST_FFT_REAL_INVERSE;
}

/* Bytes of a row of a real array in place of its spectrum. */
size_t padded_line(const bst_fft *f) {
    return 2 * (static_cast<size_t>(f->columns) / 2 + 1) * f->value_bytes;
}

/* Creates OpenCV's transform and the work space; throws what OpenCV throws. */
void prepare(bst_fft *f) {
    bool inverse = f->kind == BST_FFT_INVERSE || f->kind == BST_FFT_REAL_INVERSE;
    int flags = inverse ? CV_HAL_DFT_INVERSE : 0, channels = is_real(f->kind) ? 1 : 2;
    if (is_real(f->kind)) {
        size_t count = static_cast<size_t>(f->rows) * static_cast<size_t>(f->columns);
        f->packed = static_cast<unsigned char *>(bst_pages_alloc(count * f->value_bytes));
        if (!f->packed) {
            throw std::bad_alloc();
        }
    } else {
        flags |= CV_HAL_DFT_IS_INPLACE;
    }
    f->transform = cv::hal::DFT2D::create(f->columns, f->rows,
                                          f->value_bytes == sizeof(double) ? CV_64F : CV_32F,
                                          channels, channels, flags, 0);
}

bst_status create(bst_ctx *ctx, bst_fft_kind kind, int rows, int columns, size_t value_bytes,
                  void *in, void *out, bst_fft **out_fft) noexcept {
    assert(rows > 0 && columns > 0 && in && out && out_fft);
    assert(in == out || kind == BST_FFT_REAL_FORWARD);
    *out_fft = nullptr;
    bst_fft *fft = nullptr;
    try {
        fft = new bst_fft{};
        fft->kind = kind;
        fft->rows = rows;
        fft->columns = columns;
        fft->value_bytes = value_bytes;
        fft->in = static_cast<unsigned char *>(in);
        fft->out = static_cast<unsigned char *>(out);
        prepare(fft);
        *out_fft = fft;
        return BST_OK;
    } catch (...) {
        bst_fft_free(fft);
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for a Fourier transform of %d x %d", rows,
                        columns);
    }
}

}  // namespace

extern "C" void *bst_fft_array(size_t bytes) noexcept {
    assert(bytes > 0);
    return bst_pages_alloc(bytes);
}

extern "C" void bst_fft_array_free(void *array) noexcept {
    free(array);
}

extern "C" bst_status bst_fft_create_f32(bst_ctx *ctx, bst_fft_kind kind, int rows, int columns,
                                         float *in, float *out, bst_fft **out_fft) noexcept {
    return create(ctx, kind, rows, columns, sizeof(float), in, out, out_fft);
}

extern "C" bst_status bst_fft_create_f64(bst_ctx *ctx, bst_fft_kind kind, int rows, int columns,
                                         double *in, double *out, bst_fft **out_fft) noexcept {
    return create(ctx, kind, rows, columns, sizeof(double), in, out, out_fft);
}

extern "C" void bst_fft_free(bst_fft *fft) noexcept {
    if (fft) {
        free(fft->packed);
        delete fft;
    }
}

/* OpenCV's transforms throw only for arguments that prepare() excludes; noexcept ends the program
 * there, as a failed assertion. */
extern "C" void bst_fft_run(bst_fft *fft) noexcept {
    assert(fft);
    bool is_double = fft->value_bytes == sizeof(double);
    size_t line = static_cast<size_t>(fft->columns) * fft->value_bytes;
    if (fft->kind == BST_FFT_REAL_FORWARD) {
        size_t pitch = fft->in == fft->out ? padded_line(fft) : line;
        fft->transform->apply(fft->in, pitch, fft->packed, line);
        is_double ? unpack<double>(fft) : unpack<float>(fft);
    } else if (fft->kind == BST_FFT_REAL_INVERSE) {
        is_double ? pack<double>(fft) : pack<float>(fft);
        fft->transform->apply(fft->packed, line, fft->out, padded_line(fft));
    } else {
        fft->transform->apply(fft->in, 2 * line, fft->out, 2 * line);
    }
}

const char *bst_fft_library(void) noexcept {
    return "OpenCV " CV_VERSION;
}
