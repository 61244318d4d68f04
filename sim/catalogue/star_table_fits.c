/* Tables of stars in FITS: the first binary table of the file. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sim/catalogue/star_table_internal.h"

enum { BLOCK = 4096 };

static bst_status fail_fits(bst_ctx *ctx, const bst_star_table *t, const char *what, int code) {
    char reason[FLEN_STATUS];
    fits_get_errstatus(code, reason);
    fits_clear_errmsg();
    return bst_fail(ctx, BST_ERR_FORMAT, "%s: %s: %s", t->path, what, reason);
}

/* Finds the columns of the table by their names. */
static bst_status find_columns(bst_ctx *ctx, bst_star_table *t) {
    int count = 0, code = 0;
    fits_get_num_cols(t->fits, &count, &code);
    for (int c = 1; c <= count && code == 0; c++) {
        char key[FLEN_KEYWORD], name[FLEN_VALUE] = "";
        int type = 0, none = 0;
        long repeat = 0;
        fits_make_keyn("TTYPE", c, key, &code);
        fits_read_key_str(t->fits, key, name, NULL, &none);
        fits_get_coltype(t->fits, c, &type, &repeat, NULL, &code);
        const size_t length = strlen(name);
        const bool number =
            repeat == 1 && (type == TDOUBLE || type == TFLOAT || type == TLONG || type == TULONG ||
                            type == TLONGLONG || type == TULONGLONG || type == TSHORT ||
                            type == TUSHORT || type == TBYTE || type == TSBYTE);
        if (t->source_column < 0 && number && type != TDOUBLE && type != TFLOAT &&
            bst_star_name_is(bst_star_source_names, name, length)) {
            t->source_column = c - 1;
        }
        for (int q = 0; q < BST_STAR_QUANTITIES; q++) {
            if (t->column[q] < 0 && bst_star_name_is(bst_star_quantity_names[q], name, length)) {
                if (!number) {
                    return bst_fail(
                        ctx, BST_ERR_FORMAT,
                        "%s: column %s does not hold one number in each row, or of a type "
                        "that is not read",
                        t->path, name);
                }
                char unit[FLEN_VALUE] = "";
                t->column[q] = c - 1;
                snprintf(t->name[q], sizeof t->name[q], "%s", name);
                fits_make_keyn("TUNIT", c, key, &code);
                none = 0;
                fits_read_key_str(t->fits, key, unit, NULL, &none);
                BST_TRY(bst_star_unit_check(ctx, t, (bst_star_quantity)q, unit, strlen(unit)));
            }
        }
    }
    return code == 0 ? BST_OK : fail_fits(ctx, t, "its columns cannot be read", code);
}

bst_status bst_star_fits_open(bst_ctx *ctx, bst_star_table *t) {
    int code = 0, count = 0, type = 0;
    if (fits_open_diskfile(&t->fits, t->path, READONLY, &code) != 0) {
        t->fits = NULL;
        return fail_fits(ctx, t, "cannot be opened", code);
    }
    fits_get_num_hdus(t->fits, &count, &code);
    for (int hdu = 1; hdu <= count && code == 0 && type != BINARY_TBL; hdu++) {
        fits_movabs_hdu(t->fits, hdu, &type, &code);
    }
    if (code != 0) {
        return fail_fits(ctx, t, "is damaged", code);
    }
    if (type != BINARY_TBL) {
        return bst_fail(ctx, BST_ERR_FORMAT, "%s: has no binary table", t->path);
    }
    LONGLONG rows = 0;
    fits_get_num_rowsll(t->fits, &rows, &code);
    t->fits_rows = rows;
    BST_TRY(find_columns(ctx, t));
    for (int q = 0; q < BST_STAR_QUANTITIES; q++) {
        t->block[q] = t->column[q] >= 0 ? malloc(BLOCK * sizeof(double)) : NULL;
        if (t->column[q] >= 0 && !t->block[q]) {
            return bst_fail(ctx, BST_ERR_MEMORY, "%s: out of memory", t->path);
        }
    }
    t->block_source = calloc(BLOCK, sizeof *t->block_source);
    return t->block_source ? BST_OK : bst_fail(ctx, BST_ERR_MEMORY, "%s: out of memory", t->path);
}

/* Reads the next rows. */
static bst_status read_block(bst_ctx *ctx, bst_star_table *t) {
    int code = 0, any = 0;
    t->block_first += t->block_count;
    int64_t left = t->fits_rows - t->block_first;
    t->block_count = left < BLOCK ? left : BLOCK;
    for (int q = 0; q < BST_STAR_QUANTITIES && code == 0; q++) {
        double none = NAN;
        if (t->block[q]) {
            fits_read_col(t->fits, TDOUBLE, t->column[q] + 1, t->block_first + 1, 1, t->block_count,
                          &none, t->block[q], &any, &code);
        }
    }
    if (t->source_column >= 0 && code == 0) {
        LONGLONG none = 0, *values = malloc(BLOCK * sizeof *values);
        if (!values) {
            return bst_fail(ctx, BST_ERR_MEMORY, "%s: out of memory", t->path);
        }
        fits_read_col(t->fits, TLONGLONG, t->source_column + 1, t->block_first + 1, 1,
                      t->block_count, &none, values, &any, &code);
        /* beyond 63 bits: no identity, as names */
        const bool fits = code != NUM_OVERFLOW;
        code = fits ? code : 0;
        for (int64_t i = 0; i < t->block_count && code == 0; i++) {
            t->block_source[i] = fits ? values[i] : 0;
        }
        free(values);
    }
    return code == 0 ? BST_OK : fail_fits(ctx, t, "its rows cannot be read", code);
}

bst_status bst_star_fits_next(bst_ctx *ctx, bst_star_table *t, int64_t *source,
                              double value[BST_STAR_QUANTITIES], bool *end) {
    *end = t->rows >= t->fits_rows;
    if (*end) {
        return BST_OK;
    }
    if (t->rows == t->block_first + t->block_count) {
        BST_TRY(read_block(ctx, t));
    }
    const int64_t i = t->rows - t->block_first;
    *source = t->block_source[i];
    for (int q = 0; q < BST_STAR_QUANTITIES; q++) {
        value[q] = t->block[q] && isfinite(t->block[q][i]) ? t->block[q][i] : NAN;
    }
    return BST_OK;
}
