/* Recorded frames: the frames of FITS files and of pictures in their order, one at a time, prepared
 * as counts. */
#ifndef BST_IO_RECORDED_FRAMES_H
#define BST_IO_RECORDED_FRAMES_H

#include "sim/io/keyword_map.h"

typedef struct bst_recorded_frames bst_recorded_frames;

/* Opens files of frames. All headers are read once; one file is open at a time.
 *
 * A path is a FITS file, a PNG or TIFF file, a side table *.csv, a folder or a text file. In a
 * folder the files *.fits, *.fit, *.fts and *.fits.fz count, in the order of their names; of a run
 * only frames.fits, of a SatNet set those in ImageFiles; without any of them its only *.csv, else
 * *.png,
 * *.tif and *.tiff. A text file *.txt has a path a line, relative to its folder; # begins a
 * comment.
 *
 * Given:     map  names the columns of side tables, and colour; NULL: bst_frame_source_open's
 * Errors:    BST_ERR_NOT_FOUND: no file, or a folder without one; BST_ERR_ARGUMENT: a folder with
 *            several side tables; those of bst_frame_source_open
 * Ownership: free *out with bst_recorded_frames_close */
bst_status bst_recorded_frames_open(bst_ctx *ctx, const char *const *paths, int count,
                                    const bst_keyword_map *map,
                                    bst_recorded_frames **out) BST_MUST_CHECK;
/* Closes the files; NULL is allowed. */
void bst_recorded_frames_close(bst_recorded_frames *frames);

/* Number of frames in all files. */
int64_t bst_recorded_frames_count(const bst_recorded_frames *frames);
/* Number of files. */
int bst_recorded_frames_files(const bst_recorded_frames *frames);
/* Path of a file, which belongs to the frames. */
const char *bst_recorded_frames_file(const bst_recorded_frames *frames, int index);

/* Preparation of the pixels. */
typedef struct bst_recorded_options {
    const bst_keyword_map *map; /* NULL: no keyword is read, the whole image is taken as counts */
    bool flip_rows;             /* reverses the rows that the map's first_row gives */
} bst_recorded_options;

/* True if the camera's first row is the last of the file. */
bool bst_recorded_flips(const bst_recorded_options *options);

/* A frame. */
typedef struct bst_recorded_frame {
    const char *path; /* of its file; belongs to the frames */
    bst_frame_place place;
    int width, height;         /* of the used part */
    double bias_dn;            /* median of the overscan, in the file's unit; 0: none */
    bst_keyword_values values; /* with a map */
} bst_recorded_frame;

/* Selects a frame and reads its keywords.
 *
 * Given:     index    from 0
 * Errors:    those of bst_frame_source_select, bst_keyword_map_read and bst_keyword_section */
bst_status bst_recorded_frames_select(bst_ctx *ctx, bst_recorded_frames *frames, int64_t index,
                                      const bst_recorded_options *options,
                                      bst_recorded_frame *out) BST_MUST_CHECK;

/* Fails for a frame: its place in words before the message. Returns `status`. */
bst_status bst_recorded_frame_fail(bst_ctx *ctx, const char *path, const bst_frame_place *place,
                                   bst_status status);

/* File of the selected frame, for other keywords. */
bst_frame_source *bst_recorded_frames_source(bst_recorded_frames *frames);

/* Reads the pixels of the selected frame: cut to the image section, less the overscan.
 *
 * Given:     frame   as bst_recorded_frames_select gave it
 * Returned:  *pixels  [frame->height][frame->width] in the unit of the file, NAN for blank ones;
 *                     they belong to the frames, until the next call
 *            frame->bias_dn
 * Errors:    those of bst_frame_source_pixels; BST_ERR_MEMORY */
bst_status bst_recorded_frames_pixels(bst_ctx *ctx, bst_recorded_frames *frames,
                                      const bst_recorded_options *options,
                                      bst_recorded_frame *frame,
                                      const float **pixels) BST_MUST_CHECK;

/* Converts pixels to 16-bit counts, pedestal_dn + dn_per_unit * value, rounded; blank pixels become
 * the median of the others.
 *
 * Given:     pixels, count  values
 *            map            NULL: pedestal 0, 1 count per unit
 * Returned:  dn       [count]; what lies outside 0 to 65535 is set to the nearer end
 *            *clipped number of those; may be NULL
 *            *blank   number of blank pixels; may be NULL
 * Errors:    BST_ERR_MEMORY */
bst_status bst_recorded_counts(bst_ctx *ctx, const float *pixels, size_t count,
                               const bst_keyword_map *map, uint16_t *dn, int64_t *clipped,
                               int64_t *blank) BST_MUST_CHECK;

#endif
