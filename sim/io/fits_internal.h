/* What the two layouts of frame files share. */
#ifndef BST_IO_FITS_INTERNAL_H
#define BST_IO_FITS_INTERNAL_H

#include <fitsio.h>

#include "sim/io/fits_cards_internal.h"
#include "sim/io/fits_frames.h"

#define BST_FITS_PATH_BYTES 4096
#define BST_FITS_NAME_BYTES 69

/* bst_fits_info with its own memory. */
typedef struct bst_fits_names {
    char observer[BST_FITS_NAME_BYTES], instrument[BST_FITS_NAME_BYTES],
        object[BST_FITS_NAME_BYTES], image_type[BST_FITS_NAME_BYTES], program[BST_FITS_NAME_BYTES];
    bst_camera camera;
} bst_fits_names;

/* A FITS file that cfitsio makes in memory; the memory is kept from one to the next. */
typedef struct bst_fits_memory {
    fitsfile *file;
    void *bytes;
    size_t size;
} bst_fits_memory;

/* Ones' complement sum of 32-bit big-endian words, in halves. */
typedef struct bst_fits_sum {
    uint64_t high, low;
    bool is_odd; /* the last word has its upper half only */
} bst_fits_sum;

/* A datacube that is being written. */
typedef struct bst_fits_cube {
    int rows; /* unlinked file of bst_fits_frame, the future table; -1 without one */
    int width, height;
    long long data_start;
    int64_t planes;
    bst_fits_sum sum;  /* of the planes */
    long long sums_at; /* where the cards of the sums belong */
    char sum_cards[2 * BST_FITS_CARD];
} bst_fits_cube;

#define BST_FITS_BUFFER_PIXELS 65536

struct bst_fits_queue;

struct bst_fits {
    char path[BST_FITS_PATH_BYTES];
    bst_fits_layout layout;
    bst_fits_compression compression;
    bst_fits_content content;
    bool checksums;
    bst_fits_names names;
    int file;      /* -1: not made yet */
    long long end; /* bytes of the HDUs that are complete */
    int64_t frames;
    bst_fits_memory memory;
    uint16_t *buffer; /* BST_FITS_BUFFER_PIXELS, big-endian */
    bst_fits_cube cube;
    struct bst_fits_queue *queue; /* NULL: frames are written by the caller's thread */
};

/* BST_OK when code is 0; else BST_ERR_IO with file, cfitsio's and the system's reason. */
bst_status bst_fits_check(bst_ctx *ctx, const bst_fits *fits, int code,
                          const char *what) BST_MUST_CHECK;
/* The same for a failed system call. */
bst_status bst_fits_fail_errno(bst_ctx *ctx, const bst_fits *fits, const char *what);

/* Opens a FITS file in memory with an empty primary HDU when `primary` is set. */
void bst_fits_memory_open(bst_fits_memory *memory, bool primary, int *code);
/* Completes its current HDU; the bytes of that HDU hold until the memory is opened again. */
void bst_fits_memory_hdu(bst_fits_memory *memory, char **bytes, long long *count, int *code);
/* Closes it, in every case. */
void bst_fits_memory_close(bst_fits_memory *memory, int *code);
/* Frees the bytes of a FITS file in memory; the struct itself belongs to the caller. */
void bst_fits_memory_free(bst_fits_memory *memory);

/* Writes bytes at an offset of a file, all of them.
 *
 * Given:     data    [bytes]
 *            offset  bytes from the start of the file
 * Returned:  false on error, with errno */
bool bst_fits_write_at(int fd, const void *data, size_t bytes, long long offset);
/* Writes pixels as FITS wants them, and zeros up to the end of the block. */
bool bst_fits_write_pixels(bst_fits *fits, const uint16_t *pixels, size_t count, long long offset,
                           long long fill);

/* Adds pixels as they lie in the file. */
void bst_fits_sum_pixels(bst_fits_sum *sum, const uint16_t *pixels, size_t count);
/* Makes place in a header for what bst_fits_sign sets, in a file that has checksums. */
void bst_fits_put_sums(const bst_fits *fits, fitsfile *file, int *code);
/* Sets DATASUM and CHECKSUM in the header at `hdu`, whose data are what follows it within the
 * `bytes` bytes and those that have been added to `data`; blocks filled. False when the header has
 * no place for them. */
bool bst_fits_sign(char *hdu, size_t bytes, bst_fits_sum data);

/* Sets the sums of an HDU with the pixels behind it (NULL: none), in a file that has checksums. */
bst_status bst_fits_sign_hdu(bst_ctx *ctx, const bst_fits *fits, char *hdu, long long bytes,
                             const uint16_t *pixels, size_t count) BST_MUST_CHECK;

/* Makes the file with one HDU in it: it appears whole or not at all. */
bst_status bst_fits_start_file(bst_ctx *ctx, bst_fits *fits, const char *hdu,
                               long long bytes) BST_MUST_CHECK;
/* Appends a whole HDU (header and data, blocks filled). A reader of the file, also after the death
 * of this process at any instruction, finds the HDU complete or does not find it; after an error
 * the file is as it was before. */
bst_status bst_fits_append_hdu(bst_ctx *ctx, bst_fits *fits, const char *hdu,
                               long long bytes) BST_MUST_CHECK;
/* The same for a header and its pixels. */
bst_status bst_fits_append_image(bst_ctx *ctx, bst_fits *fits, const char *header, long long bytes,
                                 const uint16_t *pixels, size_t count) BST_MUST_CHECK;

/* Makes room for data after the last complete HDU, in a way that readers do not take them for an
 * HDU.
 *
 * Given:     bytes  size of the data
 * Returned:  false on error, with errno */
bool bst_fits_open_tail(const bst_fits *fits, long long bytes);

/* Truncates the file at fits->end, whether that has been raised or not.
 *
 * Returned:  false on error, with errno */
bool bst_fits_close_tail(const bst_fits *fits);

/* Makes and appends the extension of a frame. */
bst_status bst_fits_write_extension(bst_ctx *ctx, bst_fits *fits, const bst_fits_frame *frame,
                                    const uint16_t *pixels, int width, int height,
                                    int64_t number) BST_MUST_CHECK;

/* The thread that compresses and writes extensions. */
bst_status bst_fits_queue_create(bst_ctx *ctx, bst_fits *fits) BST_MUST_CHECK;

/* Queues a frame for the thread that writes; waits while the queue is full.
 *
 * Given:     frame   header values; copied
 *            pixels  [height][width], DN; copied
 *            number  number of the frame in the file
 * Errors:    those of an earlier frame that could not be written; BST_ERR_MEMORY */
bst_status bst_fits_queue_put(bst_ctx *ctx, bst_fits *fits, const bst_fits_frame *frame,
                              const uint16_t *pixels, int width, int height,
                              int64_t number) BST_MUST_CHECK;

/* Waits until all queued frames are written.
 *
 * Errors:    those of the thread that writes */
bst_status bst_fits_queue_drain(bst_ctx *ctx, bst_fits *fits) BST_MUST_CHECK;
/* Ends the thread after what waits has been written. NULL queue allowed. */
void bst_fits_queue_free(bst_fits *fits);

/* Keys of the whole file. As all of cfitsio: nothing is done when *code is not 0. */
void bst_fits_put_run_keys(fitsfile *file, const bst_fits_names *names, int *code);
/* Takes what speaks of the converter's counts out of keys, and says what the pixels are instead. */
void bst_fits_put_content(fitsfile *file, bst_fits_content content, int *code);
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

/* Writes the SIP coefficients of a frame to a row of a cube's table.
 *
 * Given:     row   row, from 1
 *            code  CFITSIO status; nothing is written if it is not 0 */
void bst_fits_sip_row(fitsfile *file, long long row, const bst_sip *sip, int *code);

typedef enum bst_fits_moment { BST_FITS_BEGIN, BST_FITS_MIDDLE, BST_FITS_END } bst_fits_moment;
/* UTC of a moment of the exposure as FITS writes it (no Z), and as modified Julian date. */
double bst_fits_date(const bst_fits_frame *frame, bst_fits_moment moment, char text[40]);
/* DN at which a pixel of this camera is full, at this many bits. */
double bst_fits_saturation_dn(const bst_camera *camera, int bits);

/* Opens the unlinked file that keeps the rows of a cube's table until the file is closed.
 *
 * Errors:    BST_ERR_IO */
bst_status bst_fits_cube_open(bst_ctx *ctx, bst_fits *fits) BST_MUST_CHECK;

/* Appends a frame as a plane of the cube.
 *
 * Given:     frame   header values
 *            pixels  [height][width], DN; the size of the first frame
 * Errors:    BST_ERR_ARGUMENT for another size, BST_ERR_IO */
bst_status bst_fits_cube_write(bst_ctx *ctx, bst_fits *fits, const bst_fits_frame *frame,
                               const uint16_t *pixels, int width, int height) BST_MUST_CHECK;
/* Writes the table. */
bst_status bst_fits_cube_finish(bst_ctx *ctx, bst_fits *fits) BST_MUST_CHECK;
/* Closes the unlinked file with the rows of a cube's table, if it is open. */
void bst_fits_cube_free(bst_fits *fits);

#endif
