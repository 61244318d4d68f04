/* Reads frames of other programs from a file of any kind, with the values that belong to each: FITS
 * with its headers and tables, PNG and TIFF without, or a side table (CSV) with the pictures that
 * it names. */
#ifndef BST_IO_FRAME_SOURCE_H
#define BST_IO_FRAME_SOURCE_H

#include "sim/io/fits_source.h"
#include "sim/io/image_file.h"
#include "sim/io/side_table.h"

typedef struct bst_frame_source bst_frame_source;

/* Place and size of a frame. */
typedef struct bst_frame_place {
    int hdu;       /* of a FITS file, from 1; 0: a picture */
    int64_t plane; /* of a FITS cube, from 0; -1: none */
    int64_t page;  /* of a TIFF file with several, from 1; 0: none */
    int64_t line;  /* of a side table, from 1; 0: none */
    int width, height;
} bst_frame_place;

enum { BST_FRAME_WHERE_TEXT = 600 };

/* Place in words, for messages: "night.fits: HDU 2, plane 3", "night.csv: line 4", "a.tif: page 2".
 *
 * Given:     path  of the file that was opened
 * Returned:  text, cut to its room */
const char *bst_frame_where(const char *path, const bst_frame_place *place,
                            char text[BST_FRAME_WHERE_TEXT]);

/* How pictures are read. */
typedef struct bst_frame_source_options {
    bst_side_table_columns columns;
    bst_image_colour colour;
} bst_frame_source_options;

/* Columns and colour without a keyword map. */
#define BST_FRAME_FILE_COLUMNS "file|filename|file_name|image"
#define BST_FRAME_PAGE_COLUMNS "page"

/* Opens a file and lists its frames. A path that ends in .csv is a side table; all its pictures are
 * opened once. In a table without a column of pages, several rows that name one TIFF file are its
 * pages in their order.
 *
 * Given:     options  NULL: the columns above, colour is refused
 * Errors:    those of bst_fits_source_open, bst_image_file_open and bst_side_table_open;
 *            BST_ERR_FORMAT with file, line and column: a picture or page named twice, a TIFF file
 *            with another number of pages than rows
 * Ownership: free *out with bst_frame_source_close */
bst_status bst_frame_source_open(bst_ctx *ctx, const char *path,
                                 const bst_frame_source_options *options,
                                 bst_frame_source **out) BST_MUST_CHECK;
/* Closes a file; NULL is allowed. */
void bst_frame_source_close(bst_frame_source *source);

/* Name of the file that was opened, which belongs to the source. */
const char *bst_frame_source_path(const bst_frame_source *source);
/* Number of frames, 1 or more. */
int64_t bst_frame_source_count(const bst_frame_source *source);
/* Path of the selected frame's pixels: of the picture of a side table's row, else that of the file.
 * It belongs to the source. */
const char *bst_frame_source_picture(const bst_frame_source *source);
/* What the values of a frame are called in messages: "column " of a side table, else "". */
const char *bst_frame_source_noun(const bst_frame_source *source);

/* Selects a frame: the functions below refer to it.
 *
 * Given:     index  from 0
 * Errors:    those of bst_fits_source_select and bst_image_file_select */
bst_status bst_frame_source_select(bst_ctx *ctx, bst_frame_source *source, int64_t index,
                                   bst_frame_place *out) BST_MUST_CHECK;

/* Value of a keyword or column of the selected frame, as bst_fits_source_text and
 * bst_side_table_text have it. A PNG or TIFF file alone has none. */
bool bst_frame_source_text(bst_frame_source *source, const char *keyword,
                           char value[BST_FITS_SOURCE_TEXT]);

/* Pixels of the selected frame: [height][width], NAN for blank ones. The first row of a FITS file,
 * the top row of a picture is row 0. Errors: those of bst_fits_source_pixels and
 * bst_image_file_pixels, of a side table with its line */
bst_status bst_frame_source_pixels(bst_ctx *ctx, bst_frame_source *source,
                                   float *pixels) BST_MUST_CHECK;

#endif
