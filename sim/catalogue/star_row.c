/* Parses one row of Tycho-2 into a star. Byte ranges below are 1-based, as in the catalogue's
 * ReadMe. */
#include <string.h>

#include "sim/catalogue/star_import.h"
#include "sim/catalogue/stars.h"

#define MAIN_BYTES 206u
#define SUPPLEMENT_BYTES 122u
#define SUPPLEMENT_EPOCH_YEAR 1991.25
#define ASSUMED_COLOUR_MMAG 700

typedef struct row_reader {
    bst_ctx *ctx;
    const char *row;
    bst_status status; /* the first error is kept */
} row_reader;

/* Fails: bytes of a star catalogue row are not a number. */
static void bad_bytes(row_reader *r, int first, int last) {
    if (r->status == BST_OK) {
        r->status = bst_fail(r->ctx, BST_ERR_FORMAT, "bytes %d-%d hold \"%.*s\", not a number",
                             first, last, last - first + 1, r->row + first - 1);
    }
}

/* Parses a fixed-point number with `decimals` decimals in bytes first to last, times 10^decimals,
 * exactly. False: blank field. */
static bool read_fixed(row_reader *r, int first, int last, int decimals, long long *out) {
    const char *p = r->row + first - 1, *end = r->row + last;
    while (p < end && *p == ' ') {
        p++;
    }
    if (p == end) {
        return false;
    }
    bool negative = *p == '-';
    if (*p == '-' || *p == '+') {
        p++;
    }
    long long value = 0;
    int after_point = -1, digits = 0;
    for (; p < end && *p != ' '; p++) {
        if (*p == '.' && after_point < 0) {
            after_point = 0;
        } else if (*p >= '0' && *p <= '9' && digits < 15) {
            value = value * 10 + (*p - '0');
            digits++;
            after_point += after_point >= 0;
        } else {
            bad_bytes(r, first, last);
            return false;
        }
    }
    while (p < end && *p == ' ') {
        p++;
    }
    if (p != end || digits == 0 || (decimals > 0 ? after_point != decimals : after_point >= 0)) {
        bad_bytes(r, first, last);
        return false;
    }
    *out = negative ? -value : value;
    return true;
}

/* Reads a required fixed-point number of a star catalogue row. */
static long long need_fixed(row_reader *r, int first, int last, int decimals) {
    long long value = 0;
    if (!read_fixed(r, first, last, decimals, &value)) {
        bad_bytes(r, first, last);
    }
    return value;
}

static void read_position(row_reader *r, int ra_first, int dec_first, bst_star_values *out) {
    long long ra = need_fixed(r, ra_first, ra_first + 11, 8);
    long long dec = need_fixed(r, dec_first, dec_first + 11, 8);
    if (r->status == BST_OK &&
        (ra < 0 || ra > 36000000000 || dec < -9000000000 || dec > 9000000000)) {
        r->status = bst_fail(r->ctx, BST_ERR_FORMAT,
                             "right ascension %.8f or declination %.8f out of range",
                             (double)ra * 1e-8, (double)dec * 1e-8);
    }
    out->ra_rad = (double)ra * 1e-8 * BST_DEG_RAD;
    out->dec_rad = (double)dec * 1e-8 * BST_DEG_RAD;
}

/* Parses both components of the proper motion in bytes 42-48 and 50-56, or none. */
static bool read_motion(row_reader *r, bst_star_values *out) {
    long long ra = 0, dec = 0;
    if (!read_fixed(r, 42, 48, 1, &ra) || !read_fixed(r, 50, 56, 1, &dec)) {
        return false;
    }
    out->pm_ra_cosdec = (int)ra;
    out->pm_dec = (int)dec;
    return true;
}

static void read_magnitudes(row_reader *r, int bt_first, int vt_first, bst_star_values *out) {
    long long bt = 0, vt = 0;
    bool has_bt = read_fixed(r, bt_first, bt_first + 5, 3, &bt);
    bool has_vt = read_fixed(r, vt_first, vt_first + 5, 3, &vt);
    if (!has_bt && !has_vt) {
        bad_bytes(r, vt_first, vt_first + 5);
    }
    out->has_colour = has_bt && has_vt;
    out->colour_mmag = out->has_colour ? (int)(bt - vt) : ASSUMED_COLOUR_MMAG;
    out->vt_mmag = has_vt ? (int)vt : (int)bt - ASSUMED_COLOUR_MMAG;
}

bst_status bst_star_parse_row(bst_ctx *ctx, const char *row, size_t bytes, bst_star_values *out) {
    memset(out, 0, sizeof *out);
    if (bytes != MAIN_BYTES && bytes != SUPPLEMENT_BYTES) {
        return bst_fail(ctx, BST_ERR_FORMAT,
                        "the row has %zu bytes; Tycho-2's rows have %u, its supplement's %u", bytes,
                        MAIN_BYTES, SUPPLEMENT_BYTES);
    }
    row_reader r = {ctx, row, BST_OK};
    long long tyc1 = need_fixed(&r, 1, 4, 0);
    long long tyc2 = need_fixed(&r, 6, 10, 0);
    long long tyc3 = need_fixed(&r, 12, 12, 0);
    if (r.status == BST_OK && (tyc1 < 1 || tyc1 >= (long long)BST_STAR_CELLS || tyc2 < 1 ||
                               tyc2 > 0x3FFF || tyc3 < 1 || tyc3 > 4)) {
        return bst_fail(ctx, BST_ERR_FORMAT, "TYC %lld-%lld-%lld is no Tycho-2 identity", tyc1,
                        tyc2, tyc3);
    }
    out->id = bst_star_id_make((unsigned)tyc1, (unsigned)tyc2, (unsigned)tyc3);
    if (bytes == MAIN_BYTES) {
        if (row[13] == 'X') {
            read_position(&r, 153, 166, out);
        } else if (row[13] == 'P') {
            read_position(&r, 153, 166, out);
            double epoch = 1990.0 + 0.005 * (double)(need_fixed(&r, 179, 182, 2) +
                                                     need_fixed(&r, 184, 187, 2));
            if (read_motion(&r, out) && r.status == BST_OK) {
                bst_star_move_epoch(out, BST_STAR_EPOCH_YEAR - epoch);
            }
        } else {
            read_position(&r, 16, 29, out);
            read_motion(&r, out);
        }
        read_magnitudes(&r, 111, 124, out);
    } else {
        read_position(&r, 16, 29, out);
        read_magnitudes(&r, 84, 97, out);
        if (read_motion(&r, out) && r.status == BST_OK) {
            bst_star_move_epoch(out, BST_STAR_EPOCH_YEAR - SUPPLEMENT_EPOCH_YEAR);
        }
    }
    return r.status;
}
