/* Frames to FITS as they come: an image extension per frame, or a datacube with a table of times
 * and WCS. */
#ifndef BST_IO_FITS_FRAMES_H
#define BST_IO_FITS_FRAMES_H

#include <stdbool.h>
#include <stdint.h>

#include "sim/astro/time.h"
#include "sim/io/wcs.h"

typedef enum bst_fits_layout { BST_FITS_EXTENSIONS, BST_FITS_CUBE } bst_fits_layout;

/* Rice: FITS tile compression (FITS 4.0, section 10), lossless, a tile a row; extensions only. */
typedef enum bst_fits_compression { BST_FITS_RAW, BST_FITS_RICE } bst_fits_compression;

/* What pixels are: counts of the converter (uint16), expected electrons (float), numbers of items
 * of the truth (int32), or flags of saturated pixels (uint8). */
typedef enum bst_fits_content {
    BST_FITS_COUNTS,
    BST_FITS_ELECTRONS,
    BST_FITS_ITEMS,
    BST_FITS_FLAGS
} bst_fits_content;

/* What holds for the whole file; read in create only. */
typedef struct bst_fits_info {
    const char *observer;     /* OBSERVER: spacecraft */
    const char *instrument;   /* INSTRUME: sensor */
    const char *object;       /* OBJECT: what is looked for; may be NULL */
    const char *image_type;   /* IMAGETYP: "BIAS", "DARK" ...; may be NULL */
    const char *program;      /* CREATOR: "boresight 0.1.0"; may be NULL */
    const bst_camera *camera; /* the true camera */
    bst_fits_compression compression;
    bst_fits_content
        content;    /* others than counts: extensions, not compressed, by bst_fits_write_plane */
    bool checksums; /* CHECKSUM and DATASUM in every HDU; of a cube they come at its end */
} bst_fits_info;

/* What holds for one frame. */
typedef struct bst_fits_frame {
    int64_t id;     /* exposure */
    bst_time start; /* of the exposure */
    double exposure_s;
    bst_window window; /* full-sensor pixels */
    int binning;
    int bits;
    double pixel_scale_arcsec; /* at the boresight, unbinned; 0: the camera's */
    bool has_wcs, has_observer;
    bst_wcs wcs; /* of the whole sensor: the writer shifts and scales it to the window */
    bst_vec3 observer_gcrf_m, observer_gcrf_mps; /* mid exposure, geocentric */
    double body_fraction[3]; /* of the image that Earth, Moon and Sun cover; with has_observer */
} bst_fits_frame;

typedef struct bst_fits bst_fits;

/* Makes the file (an existing one is refused; a cube's appears with its first frame). The layout of
 * the pixels: unsigned 16 bit through BZERO 32768, row y = 0 first. Memory does not depend on the
 * number of frames, which need not be known. Compressed frames are made and written by a thread of
 * this file's own (by the caller's where cfitsio was built without threads). BST_ERR_ARGUMENT for a
 * compressed cube. */
bst_status bst_fits_create(bst_ctx *ctx, const char *path, bst_fits_layout layout,
                           const bst_fits_info *info, bst_fits **out) BST_MUST_CHECK;

/* Writes a frame of width x height pixels (row-major, after windowing and binning) and hands it to
 * the operating system: when this returns, a frame that is not compressed outlives the process. At
 * every moment the file is one that readers open without error: a frame is in it whole or not at
 * all, also when the process is killed or the disk is full. Compressed frames wait for their
 * thread, at most four of them: then this waits too. BST_ERR_IO with file and reason (disk full
 * ...; of a compressed frame at one of the next calls); BST_ERR_ARGUMENT when a cube's frame size
 * changes. *index (may be NULL): extension number counted from 1, or plane counted from 0. */
bst_status bst_fits_write(bst_ctx *ctx, bst_fits *fits, const bst_fits_frame *frame,
                          const uint16_t *pixels, int width, int height,
                          int64_t *index) BST_MUST_CHECK;

typedef struct bst_fits_plane {
    const char *name;   /* EXTNAME */
    const void *pixels; /* [height][width] */
    int width, height;
} bst_fits_plane;

/* Writes a plane of a file of electrons (float), items (int32) or flags (uint8) as bst_fits_write
 * does a frame. */
bst_status bst_fits_write_plane(bst_ctx *ctx, bst_fits *fits, const bst_fits_frame *frame,
                                const bst_fits_plane *plane, int64_t *index) BST_MUST_CHECK;

/* Writes one frame as a file of its own, its pixels in the primary array, with the keys that
 * bst_fits_write gives a frame; the file appears whole or not at all, and replaces an earlier one.
 */
bst_status bst_fits_write_single(bst_ctx *ctx, const char *path, const bst_fits_info *info,
                                 const bst_fits_frame *frame, const uint16_t *pixels, int width,
                                 int height) BST_MUST_CHECK;

/* Waits until every frame given so far is with the operating system; reports what failed. NULL is
 * allowed. */
bst_status bst_fits_flush(bst_ctx *ctx, bst_fits *fits) BST_MUST_CHECK;

/* Completes the file (a cube gets its table FRAMES here) and frees `fits` in every case. NULL is
 * allowed. */
bst_status bst_fits_close(bst_ctx *ctx, bst_fits *fits) BST_MUST_CHECK;

#endif
