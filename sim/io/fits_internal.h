/* What the two layouts of frame files share. */
#ifndef BST_IO_FITS_INTERNAL_H
#define BST_IO_FITS_INTERNAL_H

#include <fitsio.h>

#include "sim/io/fits_frames.h"

#define BST_FITS_PATH_BYTES 4096
#define BST_FITS_NAME_BYTES 69

/* bst_fits_info with its own memory. */
typedef struct bst_fits_names {
    char observer[BST_FITS_NAME_BYTES], instrument[BST_FITS_NAME_BYTES],
        object[BST_FITS_NAME_BYTES], program[BST_FITS_NAME_BYTES];
    bst_camera camera;
} bst_fits_names;

/* A datacube that is being written. */
typedef struct bst_fits_cube {
    int file; /* -1 until the first frame */
    int rows; /* unlinked file of bst_fits_frame, the future table */
    int width, height;
    long long data_start;
    int64_t planes;
    uint16_t *buffer; /* BST_FITS_CUBE_BUFFER pixels, big-endian */
} bst_fits_cube;

#define BST_FITS_CUBE_BUFFER 65536

struct bst_fits {
    char path[BST_FITS_PATH_BYTES];
    bst_fits_layout layout;
    bst_fits_names names;
    fitsfile *file; /* open with cfitsio; NULL while a cube takes planes */
    int64_t frames;
    bst_fits_cube cube;
};

/* BST_OK when code is 0; else BST_ERR_IO with file, cfitsio's and the system's reason. */
bst_status bst_fits_check(bst_ctx *ctx, const bst_fits *fits, int code,
                          const char *what) BST_MUST_CHECK;
/* The same for a failed system call. */
bst_status bst_fits_fail_errno(bst_ctx *ctx, const bst_fits *fits, const char *what);

/* Keys of the whole file. As all of cfitsio: nothing is done when *code is not 0. */
void bst_fits_put_run_keys(fitsfile *file, const bst_fits_names *names, int *code);
/* The statements about time scale, light time and aberration. */
void bst_fits_put_statements(fitsfile *file, int *code);
/* Keys of one frame. */
void bst_fits_put_frame_keys(fitsfile *file, const bst_fits_names *names,
                             const bst_fits_frame *frame, int *code);

/* Keys of the distortion polynomials of a WCS. */
void bst_fits_put_sip(fitsfile *file, const bst_sip *sip, int *code);
/* Rotation and distortion of the camera; none for a camera without. */
void bst_fits_put_lens(fitsfile *file, const bst_camera *camera, int *code);
/* A cube's table: columns for the polynomials of each row's WCS, and the values of a row. */
void bst_fits_sip_columns(fitsfile *file, int *code);
void bst_fits_sip_row(fitsfile *file, long long row, const bst_sip *sip, int *code);

typedef enum bst_fits_moment { BST_FITS_BEGIN, BST_FITS_MIDDLE, BST_FITS_END } bst_fits_moment;
/* UTC of a moment of the exposure as FITS writes it (no Z), and as modified Julian date. */
double bst_fits_date(const bst_fits_frame *frame, bst_fits_moment moment, char text[40]);
/* DN at which a pixel of this camera is full, at this many bits. */
double bst_fits_saturation_dn(const bst_camera *camera, int bits);

bst_status bst_fits_cube_open(bst_ctx *ctx, bst_fits *fits) BST_MUST_CHECK;
bst_status bst_fits_cube_write(bst_ctx *ctx, bst_fits *fits, const bst_fits_frame *frame,
                               const uint16_t *pixels, int width, int height) BST_MUST_CHECK;
/* Writes the table; leaves the file open with cfitsio. */
bst_status bst_fits_cube_finish(bst_ctx *ctx, bst_fits *fits) BST_MUST_CHECK;
void bst_fits_cube_free(bst_fits *fits);

#endif
