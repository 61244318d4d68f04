/* Writes frames to FITS during a run: image extensions, or a datacube with a table of times and
 * WCS. */
#ifndef BST_IO_FITS_FRAMES_H
#define BST_IO_FITS_FRAMES_H

#include <stdbool.h>
#include <stdint.h>

#include "boresight/archive.h"
#include "sim/astro/time.h"
#include "sim/io/wcs.h"

typedef enum bst_fits_layout { BST_FITS_EXTENSIONS, BST_FITS_CUBE } bst_fits_layout;

/* Rice: lossless FITS tile compression (FITS 4.0, section 10), one tile per row; extensions
 * only. */
typedef enum bst_fits_compression { BST_FITS_RAW, BST_FITS_RICE } bst_fits_compression;

/* Content of the pixels: DN (uint16), expected electrons (float), item numbers of the truth or
 * numbers of parts (int32), or saturation flags (uint8). */
typedef enum bst_fits_content {
    BST_FITS_COUNTS,
    BST_FITS_ELECTRONS,
    BST_FITS_ITEMS,
    BST_FITS_PARTS,
    BST_FITS_FLAGS
} bst_fits_content;

/* Header values of the whole file; read in create only. */
typedef struct bst_fits_info {
    const char *observer;     /* OBSERVER: spacecraft */
    const char *instrument;   /* INSTRUME: sensor */
    const char *object;       /* OBJECT: target; may be NULL */
    const char *image_type;   /* IMAGETYP: "BIAS", "DARK" ...; may be NULL */
    const char *program;      /* CREATOR: "boresight 0.1.0"; may be NULL */
    const bst_camera *camera; /* the true camera */
    bst_fits_compression compression;
    bst_fits_content
        content;    /* other than counts: uncompressed extensions, by bst_fits_write_plane */
    bool checksums; /* CHECKSUM and DATASUM in every HDU; for a cube at its end */
} bst_fits_info;

/* Header values of one frame. */
typedef struct bst_fits_frame {
    int64_t id;     /* exposure */
    bst_time start; /* of the exposure */
    double exposure_s;
    bst_window window; /* full-sensor pixels */
    int binning;
    int bits;
    double pixel_scale_arcsec; /* at the boresight, unbinned; 0: the camera's */
    bool has_wcs, has_observer;
    bst_wcs wcs; /* of the full sensor; the writer adapts it to the window */
    bst_vec3 observer_gcrf_m, observer_gcrf_mps; /* mid exposure, geocentric */
    double body_fraction[3]; /* fraction of the image that Earth, Moon and Sun cover; with
                                has_observer */
} bst_fits_frame;

typedef struct bst_fits bst_fits;

/* Creates a FITS file for frames. An existing file is refused; a cube appears with its first frame.
 * Pixels: unsigned 16 bit by BZERO 32768, row y = 0 first. Memory is constant; the number of frames
 * need not be known. A thread of the file compresses and writes Rice frames (the caller's thread if
 * cfitsio has no thread support). BST_ERR_ARGUMENT for a compressed cube. */
bst_status bst_fits_create(bst_ctx *ctx, const char *path, bst_fits_layout layout,
                           const bst_fits_info *info, bst_fits **out) BST_MUST_CHECK;

/* Opens a file that bst_fits_create made, to go on after its archived frames: restore them with
 * bst_fits_archive before anything else. Arguments and errors as bst_fits_create; BST_ERR_IO also
 * if the file is missing. */
bst_status bst_fits_reopen(bst_ctx *ctx, const char *path, bst_fits_layout layout,
                           const bst_fits_info *info, bst_fits **out) BST_MUST_CHECK;

/* Saves where the file ends, with all frames on the disk, or removes what was appended since.
 *
 * Errors:    BST_ERR_IO with file and reason; BST_ERR_FORMAT: the file is shorter than the saved
 *            one
 * Notes:     a cube also saves the rows of its table, about 1 KB a frame. */
bst_status bst_fits_archive(bst_ctx *ctx, bst_fits *fits, bst_archive *archive) BST_MUST_CHECK;

/* Writes a frame of width x height pixels (row-major, after windowing and binning).
 *
 * Returned:  *index (may be NULL)  extension number from 1, or plane number from 0
 * Errors:    BST_ERR_IO with file and reason (of a compressed frame at a later call);
 *            BST_ERR_ARGUMENT: the frame size of a cube changes
 * Notes:     An uncompressed frame is with the operating system on return. The file is
 *            valid at any time, also if the process is killed or the disk is full: a frame is
 *            complete or absent.
 *            Compressed frames wait for their thread; if four wait, the function blocks. */
bst_status bst_fits_write(bst_ctx *ctx, bst_fits *fits, const bst_fits_frame *frame,
                          const uint16_t *pixels, int width, int height,
                          int64_t *index) BST_MUST_CHECK;

typedef struct bst_fits_plane {
    const char *name;   /* EXTNAME */
    const void *pixels; /* [height][width] */
    int width, height;
} bst_fits_plane;

/* Writes a plane to a file of electrons (float), items (int32) or flags (uint8), as bst_fits_write
 * writes a frame. */
bst_status bst_fits_write_plane(bst_ctx *ctx, bst_fits *fits, const bst_fits_frame *frame,
                                const bst_fits_plane *plane, int64_t *index) BST_MUST_CHECK;

/* Writes one frame to a FITS file of its own, in the primary array, with the keys of
 * bst_fits_write. The file appears complete or not at all and replaces an older one. */
bst_status bst_fits_write_single(bst_ctx *ctx, const char *path, const bst_fits_info *info,
                                 const bst_fits_frame *frame, const uint16_t *pixels, int width,
                                 int height) BST_MUST_CHECK;

/* Waits until the operating system has all frames; reports their errors. NULL is allowed. */
bst_status bst_fits_flush(bst_ctx *ctx, bst_fits *fits) BST_MUST_CHECK;

/* Completes the file (a cube gets its table FRAMES) and frees `fits`, also after an error. NULL is
 * allowed. */
bst_status bst_fits_close(bst_ctx *ctx, bst_fits *fits) BST_MUST_CHECK;

#endif
