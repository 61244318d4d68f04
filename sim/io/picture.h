/* Draws on 8-bit RGB pictures and writes PNG: a shim over OpenCV (core, imgproc) and libpng. */
#ifndef BST_IO_PICTURE_H
#define BST_IO_PICTURE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "boresight/status.h"

#ifdef __cplusplus
#define BST_NOEXCEPT noexcept
extern "C" {
#else
#define BST_NOEXCEPT
#endif

typedef struct bst_picture bst_picture;

typedef struct bst_io_colour {
    uint8_t r, g, b;
} bst_io_colour;

/* Mapping of frame values to grey levels: black and white level, and softening of the asinh
 * stretch. */
typedef struct bst_io_stretch {
    double black, white; /* DN */
    double softening; /* > 0: DN above black where the scale changes from linear to logarithmic */
} bst_io_stretch;

/* A rectangle in picture pixels. */
typedef struct bst_io_box {
    int x, y, width, height;
} bst_io_box;

/* Creates a picture of one colour.
 *
 * Given:     width, height  px, 1 to 16384
 * Returned:  *out  NULL on error
 * Errors:    BST_ERR_ARGUMENT for the size, BST_ERR_MEMORY
 * Ownership: free *out with bst_picture_free */
bst_status bst_picture_create(bst_ctx *ctx, int width, int height, bst_io_colour background,
                              bst_picture **out) BST_NOEXCEPT BST_MUST_CHECK;
/* Frees a picture; NULL is allowed. */
void bst_picture_free(bst_picture *picture) BST_NOEXCEPT;

/* Computes a stretch from the frame's histogram: black just below the median, white far above the
 * noise (robust sigma from the lower quartile). A uniform frame gives a valid stretch. */
bst_io_stretch bst_io_stretch_of(const uint16_t *pixels, int width, int height) BST_NOEXCEPT;

/* Draws `columns` x `rows` pixels of a frame, starting at (x0, y0), into the box `to`, row 0 at the
 * top. Reduction averages areas; enlargement repeats pixels. The parts outside the frame are
 * black. */
bst_status bst_picture_frame(bst_ctx *ctx, bst_picture *picture, bst_io_box to,
                             const uint16_t *pixels, int width, int height, int x0, int y0,
                             int columns, int rows,
                             bst_io_stretch stretch) BST_NOEXCEPT BST_MUST_CHECK;

/* Limits drawing to a box. Shapes are anti-aliased; coordinates and thickness in picture pixels
 * (centre of the first: 0, 0). */
void bst_picture_clip(bst_picture *picture, bst_io_box box) BST_NOEXCEPT;
/* Ends the clipping of bst_picture_clip: shapes may cover the whole picture. */
void bst_picture_unclip(bst_picture *picture) BST_NOEXCEPT;
/* Draws a line from (x0, y0) to (x1, y1). */
void bst_picture_line(bst_picture *picture, double x0, double y0, double x1, double y1,
                      bst_io_colour colour, double thickness) BST_NOEXCEPT;
/* Draws a circle about (x, y); radius in px. */
void bst_picture_circle(bst_picture *picture, double x, double y, double radius,
                        bst_io_colour colour, double thickness) BST_NOEXCEPT;
/* Draws the outline of a rectangle whose upper left corner is (x, y). */
void bst_picture_rectangle(bst_picture *picture, double x, double y, double width, double height,
                           bst_io_colour colour, double thickness) BST_NOEXCEPT;
/* Fills a box with a colour. */
void bst_picture_fill(bst_picture *picture, bst_io_box box, bst_io_colour colour) BST_NOEXCEPT;
/* Draws text (ASCII; other bytes become '?') with the left end of its base line at (x, y);
 * `height`: of a capital letter, px. Returns the width, px. */
double bst_picture_text(bst_picture *picture, double x, double y, double height,
                        bst_io_colour colour, bool bold, const char *text) BST_NOEXCEPT;
/* Width that bst_picture_text would return, px, without drawing. */
double bst_picture_text_width(double height, bool bold, const char *text) BST_NOEXCEPT;

/* Copies the picture to `bgr`: height x width pixels of three bytes, blue first, without
 * padding. */
bst_status bst_picture_copy(bst_ctx *ctx, const bst_picture *picture,
                            uint8_t *bgr) BST_NOEXCEPT BST_MUST_CHECK;

/* Encodes the picture as a grey PNG with 2 to 256 evenly spaced levels; few levels compress noise
 * well. The caller frees *png. */
bst_status bst_picture_grey_png(bst_ctx *ctx, const bst_picture *picture, int levels, uint8_t **png,
                                size_t *bytes) BST_NOEXCEPT BST_MUST_CHECK;

/* Writes the picture as a PNG file, complete or not at all. */
bst_status bst_picture_save(bst_ctx *ctx, const bst_picture *picture,
                            const char *path) BST_NOEXCEPT BST_MUST_CHECK;

#ifdef __cplusplus
}
#endif

#endif
