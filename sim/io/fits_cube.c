/* Writes frames as a FITS datacube. Planes are written to the file directly. NAXIS3 is increased
 * only after a plane is complete, so that a killed run leaves a valid cube. cfitsio makes the
 * header and, at the end, the table in memory. */
#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "sim/io/fits_internal.h"

/* offset of NAXIS3: SIMPLE, BITPIX, NAXIS, NAXIS1, NAXIS2, NAXIS3 have this order (FITS 4.0,
 * section 4.4.1.1) */
#define NAXIS3_OFFSET (5 * 80)
#define SUM_CARDS (2 * BST_FITS_CARD)
#define ONE_PAGE 4096

bst_status bst_fits_cube_open(bst_ctx *ctx, bst_fits *fits) {
    bst_fits_cube *cube = &fits->cube;
    char path[BST_FITS_PATH_BYTES];
    memcpy(path, fits->path, sizeof path);
    memcpy(path + strlen(path), ".rows", 6);
    cube->rows = open(path, O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
    if (cube->rows < 0 || unlink(path) != 0) {
        return bst_fits_fail_errno(ctx, fits, "cannot make the table's file");
    }
    return BST_OK;
}

/* Leaves the checksum cards blank until the end: every plane changes the sums. They come first, so
 * that each is in one memory page and is written atomically. */
static bool blank_sums(bst_fits_cube *cube, char *hdu) {
    for (cube->sums_at = 0; cube->sums_at + SUM_CARDS <= ONE_PAGE; cube->sums_at += BST_FITS_CARD) {
        char *cards = hdu + cube->sums_at;
        if (memcmp(cards, "CHECKSUM= '", 11) == 0) {
            memcpy(cube->sum_cards, cards, SUM_CARDS);
            memset(cards, ' ', SUM_CARDS);
            return true;
        }
    }
    return false;
}

/* Writes the checksums of the completed cube. */
static bst_status write_sums(bst_ctx *ctx, bst_fits *fits) {
    bst_fits_cube *cube = &fits->cube;
    size_t bytes = (size_t)cube->data_start;
    char *header = malloc(bytes);
    if (!header) {
        return bst_fail(ctx, BST_ERR_MEMORY, "%s: out of memory for its header", fits->path);
    }
    bst_status status = BST_OK;
    if (pread(fits->file, header, bytes, 0) != (ssize_t)bytes) {
        status = bst_fits_fail_errno(ctx, fits, "cannot be read again");
    } else {
        char *cards = header + cube->sums_at;
        memcpy(cards, cube->sum_cards, SUM_CARDS);
        bool ok = bst_fits_sign(header, bytes, cube->sum);
        /* a DATASUM alone is valid; a CHECKSUM alone is not */
        ok = ok && bst_fits_write_at(fits->file, cards + BST_FITS_CARD, BST_FITS_CARD,
                                     cube->sums_at + BST_FITS_CARD);
        ok = ok && bst_fits_write_at(fits->file, cards, BST_FITS_CARD, cube->sums_at);
        status = ok ? BST_OK : bst_fits_fail_errno(ctx, fits, "cannot be completed");
    }
    free(header);
    return status;
}

/* Writes the header of an empty cube. */
static bst_status start(bst_ctx *ctx, bst_fits *fits, int width, int height) {
    bst_fits_cube *cube = &fits->cube;
    long size[3] = {width, height, 0};
    char *hdu = NULL;
    long long bytes = 0;
    int code = 0;
    errno = 0;
    bst_fits_memory_open(&fits->memory, false, &code);
    fitsfile *file = fits->memory.file;
    fits_create_img(file, USHORT_IMG, 3, size, &code);
    bst_fits_put_sums(fits, file, &code);
    bst_fits_put_run_keys(file, &fits->names, &code);
    fits_write_comment(
        file, "Third axis: frames. Row k of the table FRAMES has plane k's time and WCS.", &code);
    bst_fits_put_statements(file, &code);
    bst_fits_memory_hdu(&fits->memory, &hdu, &bytes, &code);
    bst_status status = bst_fits_check(ctx, fits, code, "cannot be made");
    if (status == BST_OK && memcmp(hdu + NAXIS3_OFFSET, "NAXIS3  =", 9) != 0) {
        status = bst_fail(ctx, BST_ERR_FORMAT, "%s: NAXIS3 is not where it belongs", fits->path);
    }
    if (status == BST_OK && fits->checksums && !blank_sums(cube, hdu)) {
        status = bst_fail(ctx, BST_ERR_FORMAT, "%s: no place for CHECKSUM", fits->path);
    }
    if (status == BST_OK) {
        status = bst_fits_start_file(ctx, fits, hdu, bytes);
    }
    bst_fits_memory_close(&fits->memory, &code);
    cube->width = width;
    cube->height = height;
    cube->data_start = bytes;
    return status;
}

static bool write_row(const bst_fits_cube *cube, const bst_fits_frame *frame) {
    return bst_fits_write_at(cube->rows, frame, sizeof *frame,
                             (long long)sizeof *frame * (long long)cube->planes);
}

/* Writes the number of planes to the header. */
static bool write_planes(const bst_fits *fits, int64_t planes) {
    char value[24];
    snprintf(value, sizeof value, "%20lld", (long long)planes);
    /* the card is in one memory page: the write is atomic */
    return bst_fits_write_at(fits->file, value, 20, NAXIS3_OFFSET + 10);
}

bst_status bst_fits_cube_write(bst_ctx *ctx, bst_fits *fits, const bst_fits_frame *frame,
                               const uint16_t *pixels, int width, int height) {
    bst_fits_cube *cube = &fits->cube;
    if (fits->file < 0) {
        BST_TRY(start(ctx, fits, width, height));
    }
    if (width != cube->width || height != cube->height) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "%s: a frame of %d x %d pixels does not fit a cube of %d x %d; record "
                        "frames as extensions when windows change",
                        fits->path, width, height, cube->width, cube->height);
    }
    size_t count = (size_t)width * (size_t)height;
    long long plane = (long long)count * 2;
    long long offset = cube->data_start + cube->planes * plane, after = offset + plane;
    long long fill =
        (BST_FITS_BLOCK - (after - cube->data_start) % BST_FITS_BLOCK) % BST_FITS_BLOCK;
    bool ok = write_row(cube, frame) && bst_fits_open_tail(fits, after + fill - fits->end) &&
              bst_fits_write_pixels(fits, pixels, count, offset, fill);
    ok = ok && write_planes(fits, cube->planes + 1);
    bst_status status = ok ? BST_OK : bst_fits_fail_errno(ctx, fits, "cannot be written");
    if (ok) {
        cube->planes++;
        if (fits->checksums) {
            bst_fits_sum_pixels(&cube->sum, pixels, count);
        }
        fits->end = after + fill;
    }
    if (fits->file >= 0 && !bst_fits_close_tail(fits) && ok) {
        status = bst_fits_fail_errno(ctx, fits, "cannot be written");
    }
    return status;
}

enum { TABLE_COLUMNS = 24 };

static void make_table(fitsfile *file, LONGLONG rows, int *code) {
    static const char *const columns[TABLE_COLUMNS][3] = {
        {"FRAMEID", "1K", ""},        {"DATE-OBS", "26A", ""},      {"MJD-OBS", "1D", "d"},
        {"DATE-AVG", "26A", ""},      {"MJD-AVG", "1D", "d"},       {"EXPTIME", "1D", "s"},
        {"WINX0", "1J", "pixel"},     {"WINY0", "1J", "pixel"},     {"BINNING", "1J", ""},
        {"CRPIX1", "1D", "pixel"},    {"CRPIX2", "1D", "pixel"},    {"CRVAL1", "1D", "deg"},
        {"CRVAL2", "1D", "deg"},      {"CD1_1", "1D", "deg/pixel"}, {"CD1_2", "1D", "deg/pixel"},
        {"CD2_1", "1D", "deg/pixel"}, {"CD2_2", "1D", "deg/pixel"}, {"WCSRESID", "1D", "pixel"},
        {"OBSPOS", "3D", "m"},        {"OBSVEL", "3D", "m/s"},      {"BITS", "1J", "bit"},
        {"EARTHFRC", "1D", ""},       {"MOONFRC", "1D", ""},        {"SUNFRC", "1D", ""},
    };
    char *names[TABLE_COLUMNS], *forms[TABLE_COLUMNS], *units[TABLE_COLUMNS];
    for (int i = 0; i < TABLE_COLUMNS; i++) {
        /* cfitsio's prototype lacks const */
        names[i] = (char *)(uintptr_t)columns[i][0];
        forms[i] = (char *)(uintptr_t)columns[i][1];
        units[i] = (char *)(uintptr_t)columns[i][2];
    }
    fits_create_tbl(file, BINARY_TBL, rows, TABLE_COLUMNS, names, forms, units, "FRAMES", code);
    fits_write_key_str(file, "TIMESYS", "UTC", "time scale of the dates", code);
    fits_write_key_str(file, "RADESYS", "ICRS", "reference system of the WCS", code);
    fits_write_key_str(file, "CTYPE1", "RA---TAN", "projection of the WCS in each row", code);
    fits_write_key_str(file, "CTYPE2", "DEC--TAN", "projection of the WCS in each row", code);
    fits_write_key_str(file, "ABERRAT", "absorbed", "stellar aberration is in the WCS", code);
    bst_fits_put_statements(file, code);
}

static void put_row(fitsfile *file, LONGLONG row, const bst_fits_frame *f, int *code) {
    char date[2][40];
    char *texts[2] = {date[0], date[1]};
    double mjd[2] = {bst_fits_date(f, BST_FITS_BEGIN, date[0]),
                     bst_fits_date(f, BST_FITS_MIDDLE, date[1])};
    double missing = NAN;
    long long id = f->id;
    int binning = f->binning > 1 ? f->binning : 1;
    bst_wcs w = {.crpix = {missing, missing},
                 .crval_deg = {missing, missing},
                 .cd_deg = {{missing, missing}, {missing, missing}},
                 .residual_px = missing};
    if (f->has_wcs) {
        w = bst_wcs_window(&f->wcs, f->window, binning);
    }
    double observer[6] = {missing, missing, missing, missing, missing, missing};
    if (f->has_observer) {
        memcpy(observer, &f->observer_gcrf_m, 3 * sizeof(double));
        memcpy(observer + 3, &f->observer_gcrf_mps, 3 * sizeof(double));
    }
    int integers[3] = {f->window.x0, f->window.y0, binning};
    int bits = f->bits;
    double reals[9] = {w.crpix[0],     w.crpix[1],     w.crval_deg[0],
                       w.crval_deg[1], w.cd_deg[0][0], w.cd_deg[0][1],
                       w.cd_deg[1][0], w.cd_deg[1][1], w.residual_px};
    double exposure_s = f->exposure_s;
    fits_write_col(file, TLONGLONG, 1, row, 1, 1, &id, code);
    for (int k = 0; k < 2; k++) {
        fits_write_col(file, TSTRING, 2 + 2 * k, row, 1, 1, &texts[k], code);
        fits_write_col(file, TDOUBLE, 3 + 2 * k, row, 1, 1, &mjd[k], code);
    }
    fits_write_col(file, TDOUBLE, 6, row, 1, 1, &exposure_s, code);
    for (int k = 0; k < 3; k++) {
        fits_write_col(file, TINT, 7 + k, row, 1, 1, &integers[k], code);
    }
    for (int k = 0; k < 9; k++) {
        fits_write_col(file, TDOUBLE, 10 + k, row, 1, 1, &reals[k], code);
    }
    fits_write_col(file, TDOUBLE, 19, row, 1, 3, observer, code);
    fits_write_col(file, TDOUBLE, 20, row, 1, 3, observer + 3, code);
    fits_write_col(file, TINT, 21, row, 1, 1, &bits, code);
    for (int k = 0; k < 3; k++) {
        double share = f->has_observer ? f->body_fraction[k] : NAN;
        fits_write_col(file, TDOUBLE, 22 + k, row, 1, 1, &share, code);
    }
}

bst_status bst_fits_cube_finish(bst_ctx *ctx, bst_fits *fits) {
    bst_fits_cube *cube = &fits->cube;
    if (fits->file < 0) {
        return BST_OK; /* no frame was written, or an earlier error was reported */
    }
    char *hdu = NULL;
    long long bytes = 0;
    int code = 0;
    errno = 0;
    bst_fits_memory_open(&fits->memory, true, &code);
    if (code == 0) {
        make_table(fits->memory.file, cube->planes, &code);
        if (bst_camera_distorted(&fits->names.camera)) {
            bst_fits_sip_columns(fits->memory.file, &code);
        }
    }
    bst_status status = BST_OK;
    for (int64_t k = 0; status == BST_OK && code == 0 && k < cube->planes; k++) {
        bst_fits_frame frame;
        if (pread(cube->rows, &frame, sizeof frame, (off_t)(k * (int64_t)sizeof frame)) !=
            (ssize_t)sizeof frame) {
            status = bst_fits_fail_errno(ctx, fits, "cannot read the table's file");
        } else {
            put_row(fits->memory.file, k + 1, &frame, &code);
            if (bst_camera_distorted(&fits->names.camera)) {
                bst_wcs wcs = bst_wcs_window(&frame.wcs, frame.window, frame.binning);
                bst_fits_sip_row(fits->memory.file, k + 1, &wcs.sip, &code);
            }
        }
    }
    bst_fits_put_sums(fits, fits->memory.file, &code);
    bst_fits_memory_hdu(&fits->memory, &hdu, &bytes, &code);
    if (status == BST_OK) {
        status = bst_fits_check(ctx, fits, code, "cannot be completed");
    }
    if (status == BST_OK && fits->checksums) {
        status = bst_fits_sign(hdu, (size_t)bytes, (bst_fits_sum){0})
                     ? write_sums(ctx, fits)
                     : bst_fail(ctx, BST_ERR_FORMAT, "%s: no place for CHECKSUM", fits->path);
    }
    if (status == BST_OK) {
        status = bst_fits_append_hdu(ctx, fits, hdu, bytes);
    }
    bst_fits_memory_close(&fits->memory, &code);
    return status;
}

void bst_fits_cube_free(bst_fits *fits) {
    if (fits->cube.rows >= 0) {
        close(fits->cube.rows);
    }
}

/* Saves the rows of the table, or restores them. */
static bst_status archive_rows(bst_ctx *ctx, bst_fits *fits, bst_archive *archive) {
    const bst_fits_cube *cube = &fits->cube;
    for (int64_t k = 0; k < cube->planes; k++) {
        bst_fits_frame frame;
        const off_t at = (off_t)(k * (int64_t)sizeof frame);
        const bool restoring = bst_archive_is_restoring(archive);
        if (!restoring && pread(cube->rows, &frame, sizeof frame, at) != (ssize_t)sizeof frame) {
            return bst_fits_fail_errno(ctx, fits, "cannot read the table's file");
        }
        BST_ARCHIVE(archive, frame);
        if (restoring && !bst_fits_write_at(cube->rows, &frame, sizeof frame, at)) {
            return bst_fits_fail_errno(ctx, fits, "cannot write the table's file");
        }
    }
    return BST_OK;
}

bst_status bst_fits_cube_archive(bst_ctx *ctx, bst_fits *fits, bst_archive *archive) {
    bst_fits_cube *cube = &fits->cube;
    BST_ARCHIVE(archive, cube->width);
    BST_ARCHIVE(archive, cube->height);
    BST_ARCHIVE(archive, cube->data_start);
    BST_ARCHIVE(archive, cube->sum);
    cube->sums_at = bst_archive_integer(archive, cube->sums_at, 0, ONE_PAGE);
    BST_ARCHIVE(archive, cube->sum_cards);
    cube->planes = bst_archive_count(archive, (int)cube->planes, INT32_MAX);
    return archive_rows(ctx, fits, archive);
}

bst_status bst_fits_cube_cut(bst_ctx *ctx, bst_fits *fits) {
    char blank[SUM_CARDS];
    memset(blank, ' ', sizeof blank);
    bool ok = write_planes(fits, fits->cube.planes) &&
              (!fits->checksums ||
               bst_fits_write_at(fits->file, blank, sizeof blank, fits->cube.sums_at));
    return ok ? BST_OK : bst_fits_fail_errno(ctx, fits, "cannot be cut");
}
