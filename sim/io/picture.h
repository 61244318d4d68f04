/* Drawing on 8-bit RGB pictures, and PNG: a shim over OpenCV's core and imgproc, and libpng. */
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

/* Grey levels of a frame: what is shown as black and as white, and how hard the asinh bends. */
typedef struct bst_io_stretch {
    double black, white; /* DN */
    double softening; /* > 0: DN above black at which the scale turns from linear to logarithmic */
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

/* A stretch from the frame's own histogram: black a little below the median, white far above the
 * noise (robust sigma from the lower quartile). A flat frame gives a valid stretch. */
bst_io_stretch bst_io_stretch_of(const uint16_t *pixels, int width, int height) BST_NOEXCEPT;

/* Fills `to` with the part of a frame that begins at (x0, y0), `columns` x `rows` pixels large,
 * row 0 at the top. Reduced by area averaging, enlarged by whole pixels as they are. The part is
 * clipped to the frame; what lies outside is painted black. */
bst_status bst_picture_frame(bst_ctx *ctx, bst_picture *picture, bst_io_box to,
                             const uint16_t *pixels, int width, int height, int x0, int y0,
                             int columns, int rows,
                             bst_io_stretch stretch) BST_NOEXCEPT BST_MUST_CHECK;

/* Anti-aliased shapes; coordinates in picture pixels (centre of the first: 0, 0), thickness in
 * pixels. What lies outside the picture, or outside the box last given to bst_picture_clip, is cut.
 */
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
/* Text (ASCII; other bytes are shown as '?') with its base line's left end at (x, y); `height` is
 * that of a capital letter, px. Returns the width, px. */
double bst_picture_text(bst_picture *picture, double x, double y, double height,
                        bst_io_colour colour, bool bold, const char *text) BST_NOEXCEPT;
/* Width that bst_picture_text would return, px, without drawing. */
double bst_picture_text_width(double height, bool bold, const char *text) BST_NOEXCEPT;

/* Copies the picture to `bgr`: height x width pixels of three bytes, blue first, no padding. */
bst_status bst_picture_copy(bst_ctx *ctx, const bst_picture *picture,
                            uint8_t *bgr) BST_NOEXCEPT BST_MUST_CHECK;

/* Encodes the picture as a grey PNG of `levels` grey levels, 2 to 256, evenly spread: few levels
 * make noise small. The caller frees *png. */
bst_status bst_picture_grey_png(bst_ctx *ctx, const bst_picture *picture, int levels, uint8_t **png,
                                size_t *bytes) BST_NOEXCEPT BST_MUST_CHECK;

/* Writes a PNG, whole or not at all. */
bst_status bst_picture_save(bst_ctx *ctx, const bst_picture *picture,
                            const char *path) BST_NOEXCEPT BST_MUST_CHECK;

#ifdef __cplusplus
}
#endif

#endif
