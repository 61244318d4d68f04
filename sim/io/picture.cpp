#include "sim/io/picture.h"

#include <png.h>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <new>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <string>
#include <vector>

#include "sim/io/manifest.h"

/* drawn at twice the size and reduced when saved: smoother lines and letters */
static constexpr int kOver = 2;
static constexpr int kShift = 4; /* fractional bits of OpenCV's coordinates */

struct bst_picture {
    cv::Mat image; /* BGR, kOver times as large as the picture */
    cv::Rect clip;
};

namespace {

cv::Scalar scalar(bst_io_colour c) {
    return cv::Scalar(c.b, c.g, c.r);
}

/* Centre of picture pixel v in the enlarged image, fixed point. */
int fixed(double v) {
    double over = (v + 0.5) * kOver - 0.5;
    return static_cast<int>(std::lround(std::clamp(over, -1e6, 1e6) * (1 << kShift)));
}

int stroke(double thickness) {
    return std::max(1, static_cast<int>(std::lround(std::min(thickness, 1000.0) * kOver)));
}

cv::Rect enlarged(bst_io_box box) {
    return cv::Rect(box.x * kOver, box.y * kOver, box.width * kOver, box.height * kOver);
}

/* Calls body(view, origin) on the clipped part of the image. An exception in drawing is ignored:
 * the shape is omitted. */
template <typename Body>
void draw(bst_picture *picture, Body body) noexcept {
    try {
        cv::Rect clip = picture->clip & cv::Rect(0, 0, picture->image.cols, picture->image.rows);
        if (clip.area() > 0) {
            cv::Mat view = picture->image(clip);
            body(view, cv::Point(clip.x << kShift, clip.y << kShift));
        }
    } catch (...) {
    }
}

constexpr int kFont = cv::FONT_HERSHEY_DUPLEX;
constexpr double kCapital = 21.0; /* height of a capital letter of the Hershey fonts at scale 1 */

double font_scale(double height) {
    return height * kOver / kCapital;
}

int font_stroke(double height, bool bold) {
    double width = height * kOver / kCapital * (bold ? 2.4 : 1.3);
    return std::max(1, static_cast<int>(std::lround(width)));
}

std::string ascii(const char *text) {
    std::string s(text ? text : "");
    for (char &c : s) {
        c = c >= ' ' && c <= '~' ? c : '?';
    }
    return s;
}

cv::Mat to_grey(const cv::Mat &frame, bst_io_stretch s) {
    cv::Mat table(1, 65536, CV_8U);
    double top = std::asinh((s.white - s.black) / s.softening);
    for (int i = 0; i < 65536; i++) {
        double v = std::asinh((i - s.black) / s.softening) / top;
        table.at<uchar>(i) = static_cast<uchar>(std::lround(255.0 * std::clamp(v, 0.0, 1.0)));
    }
    cv::Mat grey(frame.size(), CV_8U);
    for (int y = 0; y < frame.rows; y++) {
        const uint16_t *in = frame.ptr<uint16_t>(y);
        uchar *out = grey.ptr<uchar>(y);
        for (int x = 0; x < frame.cols; x++) {
            out[x] = table.ptr<uchar>(0)[in[x]];
        }
    }
    return grey;
}

}  // namespace

extern "C" bst_status bst_picture_create(bst_ctx *ctx, int width, int height,
                                         bst_io_colour background, bst_picture **out) noexcept {
    *out = nullptr;
    if (width < 1 || height < 1 || width > 16384 || height > 16384) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "a picture of %d x %d pixels", width, height);
    }
    try {
        bst_picture *picture = new bst_picture;
        try {
            picture->image.create(height * kOver, width * kOver, CV_8UC3);
            picture->image.setTo(scalar(background));
            picture->clip = cv::Rect(0, 0, width * kOver, height * kOver);
        } catch (...) {
            delete picture;
            throw;
        }
        *out = picture;
        return BST_OK;
    } catch (...) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for a picture of %d x %d pixels", width,
                        height);
    }
}

extern "C" void bst_picture_free(bst_picture *picture) noexcept {
    delete picture;
}

extern "C" bst_io_stretch bst_io_stretch_of(const uint16_t *pixels, int width,
                                            int height) noexcept {
    size_t count = static_cast<size_t>(width) * static_cast<size_t>(height);
    uint32_t histogram[65536] = {0};
    for (size_t i = 0; i < count; i++) {
        histogram[pixels[i]]++;
    }
    size_t seen = 0;
    int quarter = -1, median = 65535;
    for (int v = 0; v < 65536; v++) {
        seen += histogram[v];
        if (quarter < 0 && 4 * seen >= count) {
            quarter = v;
        }
        if (2 * seen >= count) {
            median = v;
            break;
        }
    }
    double sigma = std::max(1.0, 1.4826 * (median - quarter));
    return bst_io_stretch{median - 1.0 * sigma, median + 15.0 * sigma, 1.5 * sigma};
}

extern "C" bst_status bst_picture_frame(bst_ctx *ctx, bst_picture *picture, bst_io_box to,
                                        const uint16_t *pixels, int width, int height, int x0,
                                        int y0, int columns, int rows,
                                        bst_io_stretch stretch) noexcept {
    if (columns < 1 || rows < 1 || to.width < 1 || to.height < 1 ||
        !(stretch.white > stretch.black) || !(stretch.softening > 0.0)) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "an empty part of a frame, box or stretch");
    }
    try {
        cv::Rect target = enlarged(to);
        if ((target & cv::Rect(0, 0, picture->image.cols, picture->image.rows)) != target) {
            return bst_fail(ctx, BST_ERR_ARGUMENT, "the frame's box leaves the picture");
        }
        cv::Mat frame(height, width, CV_16U, const_cast<uint16_t *>(pixels));
        cv::Mat part = cv::Mat::zeros(rows, columns, CV_8U);
        cv::Rect source = cv::Rect(x0, y0, columns, rows) & cv::Rect(0, 0, width, height);
        if (source.area() > 0) {
            to_grey(frame(source), stretch)
                .copyTo(part(cv::Rect(source.x - x0, source.y - y0, source.width, source.height)));
        }
        cv::Mat scaled, colour;
        bool smaller = target.width < columns;
        cv::resize(part, scaled, target.size(), 0, 0, smaller ? cv::INTER_AREA : cv::INTER_NEAREST);
        cv::cvtColor(scaled, colour, cv::COLOR_GRAY2BGR);
        colour.copyTo(picture->image(target));
        return BST_OK;
    } catch (const std::exception &e) {
        return bst_fail(ctx, BST_ERR_MEMORY, "cannot paint a frame: %s", e.what());
    } catch (...) {
        return bst_fail(ctx, BST_ERR_MEMORY, "cannot paint a frame");
    }
}

extern "C" void bst_picture_clip(bst_picture *picture, bst_io_box box) noexcept {
    picture->clip = enlarged(box);
}

extern "C" void bst_picture_unclip(bst_picture *picture) noexcept {
    picture->clip = cv::Rect(0, 0, picture->image.cols, picture->image.rows);
}

extern "C" void bst_picture_line(bst_picture *picture, double x0, double y0, double x1, double y1,
                                 bst_io_colour colour, double thickness) noexcept {
    draw(picture, [&](cv::Mat &view, cv::Point origin) {
        cv::line(view, cv::Point(fixed(x0), fixed(y0)) - origin,
                 cv::Point(fixed(x1), fixed(y1)) - origin, scalar(colour), stroke(thickness),
                 cv::LINE_AA, kShift);
    });
}

extern "C" void bst_picture_circle(bst_picture *picture, double x, double y, double radius,
                                   bst_io_colour colour, double thickness) noexcept {
    draw(picture, [&](cv::Mat &view, cv::Point origin) {
        int r = static_cast<int>(std::lround(std::clamp(radius, 0.0, 1e5) * kOver * (1 << kShift)));
        cv::circle(view, cv::Point(fixed(x), fixed(y)) - origin, r, scalar(colour),
                   stroke(thickness), cv::LINE_AA, kShift);
    });
}

extern "C" void bst_picture_rectangle(bst_picture *picture, double x, double y, double width,
                                      double height, bst_io_colour colour,
                                      double thickness) noexcept {
    draw(picture, [&](cv::Mat &view, cv::Point origin) {
        cv::rectangle(view, cv::Point(fixed(x), fixed(y)) - origin,
                      cv::Point(fixed(x + width), fixed(y + height)) - origin, scalar(colour),
                      stroke(thickness), cv::LINE_AA, kShift);
    });
}

extern "C" void bst_picture_fill(bst_picture *picture, bst_io_box box,
                                 bst_io_colour colour) noexcept {
    draw(picture, [&](cv::Mat &view, cv::Point origin) {
        cv::Rect r = enlarged(box) - cv::Point(origin.x >> kShift, origin.y >> kShift);
        cv::rectangle(view, r, scalar(colour), cv::FILLED);
    });
}

extern "C" double bst_picture_text(bst_picture *picture, double x, double y, double height,
                                   bst_io_colour colour, bool bold, const char *text) noexcept {
    draw(picture, [&](cv::Mat &view, cv::Point origin) {
        cv::Point at((fixed(x) - origin.x) >> kShift, (fixed(y) - origin.y) >> kShift);
        cv::putText(view, ascii(text), at, kFont, font_scale(height), scalar(colour),
                    font_stroke(height, bold), cv::LINE_AA);
    });
    return bst_picture_text_width(height, bold, text);
}

extern "C" double bst_picture_text_width(double height, bool bold, const char *text) noexcept {
    try {
        int base = 0;
        cv::Size size = cv::getTextSize(ascii(text), kFont, font_scale(height),
                                        font_stroke(height, bold), &base);
        return static_cast<double>(size.width) / kOver;
    } catch (...) {
        return 0.0;
    }
}

extern "C" bst_status bst_picture_copy(bst_ctx *ctx, const bst_picture *picture,
                                       uint8_t *bgr) noexcept {
    try {
        cv::Mat to(picture->image.rows / kOver, picture->image.cols / kOver, CV_8UC3, bgr);
        cv::resize(picture->image, to, to.size(), 0, 0, cv::INTER_AREA);
        return BST_OK;
    } catch (const std::exception &e) {
        return bst_fail(ctx, BST_ERR_MEMORY, "cannot copy a picture: %s", e.what());
    } catch (...) {
        return bst_fail(ctx, BST_ERR_MEMORY, "cannot copy a picture");
    }
}

extern "C" bst_status bst_picture_grey_png(bst_ctx *ctx, const bst_picture *picture, int levels,
                                           uint8_t **out, size_t *bytes) noexcept {
    *out = nullptr;
    *bytes = 0;
    if (levels < 2 || levels > 256) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "%d grey levels: 2 to 256 are possible", levels);
    }
    try {
        cv::Mat final_size, grey;
        cv::resize(picture->image, final_size, cv::Size(), 1.0 / kOver, 1.0 / kOver,
                   cv::INTER_AREA);
        cv::extractChannel(final_size, grey, 1);
        std::vector<uchar> map(static_cast<size_t>(levels)),
            indices(static_cast<size_t>(grey.total()));
        for (int i = 0; i < levels; i++) {
            map[static_cast<size_t>(i)] =
                static_cast<uchar>((255 * i + (levels - 1) / 2) / (levels - 1));
        }
        for (int y = 0; y < grey.rows; y++) {
            for (int x = 0; x < grey.cols; x++) {
                indices[static_cast<size_t>(y) * static_cast<size_t>(grey.cols) +
                        static_cast<size_t>(x)] =
                    static_cast<uchar>((grey.at<uchar>(y, x) * (levels - 1) + 127) / 255);
            }
        }
        png_image png = {};
        png.version = PNG_IMAGE_VERSION;
        png.width = static_cast<png_uint_32>(grey.cols);
        png.height = static_cast<png_uint_32>(grey.rows);
        png.format = PNG_FORMAT_GRAY | PNG_FORMAT_FLAG_COLORMAP;
        png.colormap_entries = static_cast<png_uint_32>(levels);
        png_alloc_size_t size = PNG_IMAGE_PNG_SIZE_MAX(png);
        uint8_t *encoded = static_cast<uint8_t *>(malloc(size));
        if (!encoded) {
            return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a PNG");
        }
        if (!png_image_write_to_memory(&png, encoded, &size, 0, indices.data(), grey.cols,
                                       map.data())) {
            free(encoded);
            return bst_fail(ctx, BST_ERR_IO, "no PNG can be made: %s", png.message);
        }
        *out = encoded;
        *bytes = size;
        return BST_OK;
    } catch (const std::exception &e) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no PNG can be made: %s", e.what());
    } catch (...) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no PNG can be made");
    }
}

extern "C" bst_status bst_picture_save(bst_ctx *ctx, const bst_picture *picture,
                                       const char *path) noexcept {
    try {
        cv::Mat final_size;
        cv::resize(picture->image, final_size, cv::Size(), 1.0 / kOver, 1.0 / kOver,
                   cv::INTER_AREA);
        png_image png = {};
        png.version = PNG_IMAGE_VERSION;
        png.width = static_cast<png_uint_32>(final_size.cols);
        png.height = static_cast<png_uint_32>(final_size.rows);
        png.format = PNG_FORMAT_BGR;
        png.flags = PNG_IMAGE_FLAG_FAST;
        png_alloc_size_t size = PNG_IMAGE_PNG_SIZE_MAX(png);
        std::vector<uchar> bytes(size);
        if (!png_image_write_to_memory(&png, bytes.data(), &size, 0, final_size.data,
                                       static_cast<png_int_32>(final_size.step[0]), nullptr)) {
            return bst_fail(ctx, BST_ERR_IO, "%s: no PNG can be made: %s", path, png.message);
        }
        return bst_io_write_file_atomic(ctx, path, bytes.data(), size);
    } catch (const std::exception &e) {
        return bst_fail(ctx, BST_ERR_MEMORY, "%s: %s", path, e.what());
    } catch (...) {
        return bst_fail(ctx, BST_ERR_MEMORY, "%s: cannot be made", path);
    }
}
