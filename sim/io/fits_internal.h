/* Internal functions of FITS frame files, shared by extensions and datacubes. */
#ifndef BST_IO_FITS_INTERNAL_H
#define BST_IO_FITS_INTERNAL_H

#include <fitsio.h>

#include "sim/io/fits_cards_internal.h"
#include "sim/io/fits_frames.h"

#define BST_FITS_PATH_BYTES 4096
#define BST_FITS_NAME_BYTES 69

/* Copy of bst_fits_info that owns its strings. */
typedef struct bst_fits_names {
    char observer[BST_FITS_NAME_BYTES], instrument[BST_FITS_NAME_BYTES],
        object[BST_FITS_NAME_BYTES], image_type[BST_FITS_NAME_BYTES], program[BST_FITS_NAME_BYTES];
    bst_camera camera;
} bst_fits_names;

/* A FITS file that cfitsio makes in memory; the memory is reused. */
typedef struct bst_fits_memory {
    fitsfile *file;
    void *bytes;
    size_t size;
} bst_fits_memory;

/* Ones' complement sum of 32-bit big-endian words, in halves. */
typedef struct bst_fits_sum {
    uint64_t high, low;
    bool is_odd; /* the last word has only its upper half */
} bst_fits_sum;

/* A datacube that is being written. */
typedef struct bst_fits_cube {
    int rows; /* unlinked file with the rows of the future table; -1: none */
    int width, height;
    long long data_start;
    int64_t planes;
    bst_fits_sum sum;  /* checksum of the planes */
    long long sums_at; /* offset of the checksum cards */
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
    int file;      /* file descriptor; -1: not created yet */
    long long end; /* size of the complete HDUs */
    int64_t frames;
    bst_fits_memory memory;
    uint16_t *buffer; /* BST_FITS_BUFFER_PIXELS, big-endian */
    bst_fits_cube cube;
    struct bst_fits_queue *queue; /* NULL: the caller's thread writes frames */
};

/* BST_OK if the cfitsio code is 0; else BST_ERR_IO with file and reasons of cfitsio and the
 * system. */
bst_status bst_fits_check(bst_ctx *ctx, const bst_fits *fits, int code,
                          const char *what) BST_MUST_CHECK;
/* BST_ERR_IO for a failed system call on a FITS file, with its reason. */
bst_status bst_fits_fail_errno(bst_ctx *ctx, const bst_fits *fits, const char *what);

/* Opens a FITS file in memory; `primary`: with an empty primary HDU. */
void bst_fits_memory_open(bst_fits_memory *memory, bool primary, int *code);
/* Completes the current HDU of a FITS file in memory; its bytes are valid until the memory is
 * opened again. */
void bst_fits_memory_hdu(bst_fits_memory *memory, char **bytes, long long *count, int *code);
/* Closes a FITS file in memory, also after an error. */
void bst_fits_memory_close(bst_fits_memory *memory, int *code);
/* Frees the bytes of a FITS file in memory; the struct itself belongs to the caller. */
void bst_fits_memory_free(bst_fits_memory *memory);

/* Writes bytes at an offset of a file, all of them.
 *
 * Given:     data    [bytes]
 *            offset  bytes from the start of the file
 * Returned:  false on error, with errno */
bool bst_fits_write_at(int fd, const void *data, size_t bytes, long long offset);
/* Writes pixels in FITS byte order, padded to the end of the block. */
bool bst_fits_write_pixels(bst_fits *fits, const uint16_t *pixels, size_t count, long long offset,
                           long long fill);

/* Adds pixels, in FITS byte order, to a checksum. */
void bst_fits_sum_pixels(bst_fits_sum *sum, const uint16_t *pixels, size_t count);
/* Reserves header cards for bst_fits_sign, in a file with checksums. */
void bst_fits_put_sums(const bst_fits *fits, fitsfile *file, int *code);
/* Sets DATASUM and CHECKSUM in the header at `hdu`. The data are those after the header within
 * `bytes` and those added to `data`; padded. False: the header has no such cards. */
bool bst_fits_sign(char *hdu, size_t bytes, bst_fits_sum data);

/* Sets the checksums of an HDU with the pixels after it (NULL: none), in a file with checksums. */
bst_status bst_fits_sign_hdu(bst_ctx *ctx, const bst_fits *fits, char *hdu, long long bytes,
                             const uint16_t *pixels, size_t count) BST_MUST_CHECK;

/* Creates the file with its first HDU: complete or not at all. */
bst_status bst_fits_start_file(bst_ctx *ctx, bst_fits *fits, const char *hdu,
                               long long bytes) BST_MUST_CHECK;
/* Appends a complete HDU (header and data, padded). A reader finds the HDU complete or not at all,
 * also if this process is killed. After an error the file is unchanged. */
bst_status bst_fits_append_hdu(bst_ctx *ctx, bst_fits *fits, const char *hdu,
                               long long bytes) BST_MUST_CHECK;
/* Appends an HDU given as header and pixels. */
bst_status bst_fits_append_image(bst_ctx *ctx, bst_fits *fits, const char *header, long long bytes,
                                 const uint16_t *pixels, size_t count) BST_MUST_CHECK;

/* Extends the file after the last complete HDU, so that readers ignore the extension.
 *
 * Given:     bytes  size of the data
 * Returned:  false on error, with errno */
bool bst_fits_open_tail(const bst_fits *fits, long long bytes);

/* Truncates a FITS file to its complete HDUs (fits->end).
 *
 * Returned:  false on error, with errno */
bool bst_fits_close_tail(const bst_fits *fits);

/* Makes and appends the image extension of a frame. */
bst_status bst_fits_write_extension(bst_ctx *ctx, bst_fits *fits, const bst_fits_frame *frame,
                                    const uint16_t *pixels, int width, int height,
                                    int64_t number) BST_MUST_CHECK;

/* Starts the thread that compresses and writes FITS extensions. */
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
/* Ends the compression thread after the queued frames are written. NULL queue is allowed. */
void bst_fits_queue_free(bst_fits *fits);

/* Writes the header keys of the whole file. Nothing happens if the cfitsio status *code is not
 * 0. */
void bst_fits_put_run_keys(fitsfile *file, const bst_fits_names *names, int *code);
/* Replaces keys that refer to DN by a description of the plane's content. */
void bst_fits_put_content(fitsfile *file, bst_fits_content content, int *code);
/* Writes comments on time scale, light time and aberration to the header. */
void bst_fits_put_statements(fitsfile *file, int *code);
/* Writes the header keys of one frame. */
void bst_fits_put_frame_keys(fitsfile *file, const bst_fits_names *names,
                             const bst_fits_frame *frame, int *code);

/* Writes the SIP distortion keys of a WCS. */
void bst_fits_put_sip(fitsfile *file, const bst_sip *sip, int *code);
/* Writes rotation and distortion of the camera; nothing for a camera without distortion. */
void bst_fits_put_lens(fitsfile *file, const bst_camera *camera, int *code);
/* Adds the columns of SIP coefficients to a cube's table. */
void bst_fits_sip_columns(fitsfile *file, int *code);

/* Writes the SIP coefficients of a frame to a row of a cube's table.
 *
 * Given:     row   row, from 1
 *            code  CFITSIO status; nothing is written if it is not 0 */
void bst_fits_sip_row(fitsfile *file, long long row, const bst_sip *sip, int *code);

typedef enum bst_fits_moment { BST_FITS_BEGIN, BST_FITS_MIDDLE, BST_FITS_END } bst_fits_moment;
/* UTC of an instant of the exposure in FITS format (without Z), and as modified Julian date. */
double bst_fits_date(const bst_fits_frame *frame, bst_fits_moment moment, char text[40]);
/* Saturation level of this camera in DN, for a number of bits. */
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
/* Writes the table of a cube: times and WCS of its planes. */
bst_status bst_fits_cube_finish(bst_ctx *ctx, bst_fits *fits) BST_MUST_CHECK;
/* Saves the planes of a cube and the rows of its table, or restores them.
 *
 * Errors:    BST_ERR_IO */
bst_status bst_fits_cube_archive(bst_ctx *ctx, bst_fits *fits, bst_archive *archive) BST_MUST_CHECK;
/* Sets the header of a cube to the archived planes, without checksums until it is complete.
 *
 * Errors:    BST_ERR_IO */
bst_status bst_fits_cube_cut(bst_ctx *ctx, bst_fits *fits) BST_MUST_CHECK;
/* Closes the unlinked file with the rows of a cube's table, if it is open. */
void bst_fits_cube_free(bst_fits *fits);

#endif
