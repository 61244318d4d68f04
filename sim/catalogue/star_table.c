#include "sim/catalogue/star_table.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "sim/catalogue/star_index.h"
#include "sim/catalogue/star_table_internal.h"
#include "sim/core/file.h"
#include "sim/core/text.h"

/* zero of the times of Gaia's tables of variable stars, barycentric Julian date */
static const double GAIA_JD = 2455197.5;

/* ---------------------------------------------------------------- photometry */

static double polynomial(const double *c, int terms, double x) {
    double sum = 0.0;
    for (int k = terms; k-- > 0;) {
        sum = sum * x + c[k];
    }
    return sum;
}

/* V and B-V of a star by Gaia's magnitudes. */
static void from_gaia(double g, double bp_rp, double *v_mag, double *b_minus_v) {
    static const double v[] = {-0.02704, 0.01424, -0.2156, 0.01426}, v_range[] = {-0.5, 5.0};
    static const double vt[] = {-0.01077, -0.0682, -0.2387, 0.02342};
    static const double bt[] = {-0.004288, -0.8547, 0.1244, -0.9085, 0.4843, -0.06814};
    static const double bt_range[] = {-0.3, 3.0};
    /* BP-RP of a star with the colour that is assumed for Tycho-2's stars without one */
    static const double usual = 0.82;
    double colour = isnan(bp_rp) ? usual : fmin(fmax(bp_rp, v_range[0]), v_range[1]);
    *v_mag = g - polynomial(v, 4, colour);
    colour = fmin(fmax(colour, bt_range[0]), bt_range[1]);
    double bt_minus_vt = polynomial(vt, 4, colour) - polynomial(bt, 6, colour);
    *b_minus_v = isnan(bp_rp) ? NAN : 0.850 * bt_minus_vt; /* Tycho-2's ReadMe, note 7 */
}

/* Sets the magnitudes of a star from what its row has; V is preferred. */
static void set_magnitudes(const bst_star_table_options *options, const double *value,
                           bst_star_table_row *row) {
    row->b_minus_v = isnan(value[BST_STAR_B_MINUS_V]) ? value[BST_STAR_B] - value[BST_STAR_V]
                                                      : value[BST_STAR_B_MINUS_V];
    row->v_mag = value[BST_STAR_V];
    if (isnan(row->v_mag) && value[BST_STAR_ELECTRONS] > 0.0) {
        row->v_mag = options->zero_point_mag - 2.5 * log10(value[BST_STAR_ELECTRONS]);
    } else if (isnan(row->v_mag)) {
        double bp_rp = isnan(value[BST_STAR_BP_RP]) ? value[BST_STAR_BP] - value[BST_STAR_RP]
                                                    : value[BST_STAR_BP_RP];
        from_gaia(value[BST_STAR_G], bp_rp, &row->v_mag, &row->b_minus_v);
    }
}

/* Checks that a number of the present row is within its range. */
static bst_status check_range(bst_ctx *ctx, const bst_star_table *t, bst_star_quantity q,
                              double value, double low, double high) {
    if (value >= low && value <= high) {
        return BST_OK;
    }
    return bst_fail(ctx, BST_ERR_RANGE, "%s: row %lld: column %s: %.17g is outside %g to %g",
                    t->path, (long long)t->rows, t->name[q][0] ? t->name[q] : "magnitude", value,
                    low, high);
}

/* Sets what of a star changes with place and time, from the values that are known.
 *
 * Errors:    BST_ERR_RANGE with row, column and what is allowed */
static bst_status set_parallax_and_period(bst_ctx *ctx, const bst_star_table *t, const double *v,
                                          bst_star_table_row *row) {
    if (!isnan(v[BST_STAR_PARALLAX])) {
        /* a measured parallax has noise on both sides of 0 */
        BST_TRY(check_range(ctx, t, BST_STAR_PARALLAX, v[BST_STAR_PARALLAX], -1e3,
                            BST_STAR_PARALLAX_MAX_MAS));
        row->parallax_mas = fmax(v[BST_STAR_PARALLAX], 0.0);
    }
    if (!isnan(v[BST_STAR_PERIOD])) {
        if (v[BST_STAR_PERIOD] != 0.0) { /* 0: unknown */
            BST_TRY(check_range(ctx, t, BST_STAR_PERIOD, v[BST_STAR_PERIOD], BST_STAR_PERIOD_MIN_D,
                                BST_STAR_PERIOD_MAX_D));
        }
        row->period_d = v[BST_STAR_PERIOD];
    }
    if (!isnan(v[BST_STAR_AMPLITUDE])) {
        BST_TRY(check_range(ctx, t, BST_STAR_AMPLITUDE, v[BST_STAR_AMPLITUDE], 0.0, 20.0));
        row->amplitude_mag = v[BST_STAR_AMPLITUDE];
    }
    row->maximum_jd = 2451545.0;
    if (!isnan(v[BST_STAR_MAXIMUM])) {
        BST_TRY(check_range(ctx, t, BST_STAR_MAXIMUM, v[BST_STAR_MAXIMUM], 2e6, 3e6));
        row->maximum_jd = v[BST_STAR_MAXIMUM];
    } else if (!isnan(v[BST_STAR_MAXIMUM_GAIA])) {
        BST_TRY(check_range(ctx, t, BST_STAR_MAXIMUM_GAIA, v[BST_STAR_MAXIMUM_GAIA], -4e5, 4e5));
        row->maximum_jd = GAIA_JD + v[BST_STAR_MAXIMUM_GAIA];
    }
    return BST_OK;
}

/* ---------------------------------------------------------------- opening */

/* Checks that the table has what a star needs. */
static bst_status check_columns(bst_ctx *ctx, const bst_star_table *t) {
    const int *c = t->column;
    static const bst_star_quantity needed[] = {BST_STAR_RA, BST_STAR_DEC};
    for (size_t i = 0; i < sizeof needed / sizeof *needed; i++) {
        if (c[needed[i]] < 0) {
            return bst_fail(ctx, BST_ERR_FORMAT,
                            "%s: has no column of %s; allowed names: %s (degrees, ICRS)", t->path,
                            i ? "declinations" : "right ascensions",
                            bst_star_quantity_names[needed[i]]);
        }
    }
    if (c[BST_STAR_G] < 0 && c[BST_STAR_V] < 0 && c[BST_STAR_ELECTRONS] < 0) {
        return bst_fail(ctx, BST_ERR_FORMAT,
                        "%s: has no column of magnitudes; allowed names: %s (Gaia's G), %s (V), or "
                        "%s with --zero-point",
                        t->path, bst_star_quantity_names[BST_STAR_G],
                        bst_star_quantity_names[BST_STAR_V],
                        bst_star_quantity_names[BST_STAR_ELECTRONS]);
    }
    if (c[BST_STAR_G] < 0 && c[BST_STAR_V] < 0 && isnan(t->options.zero_point_mag)) {
        return bst_fail(ctx, BST_ERR_FORMAT,
                        "%s: column %s needs --zero-point, the V of a star of 1 electron/s",
                        t->path, t->name[BST_STAR_ELECTRONS]);
    }
    if ((c[BST_STAR_PM_RA] < 0) != (c[BST_STAR_PM_DEC] < 0)) {
        const bst_star_quantity lacks = c[BST_STAR_PM_RA] < 0 ? BST_STAR_PM_RA : BST_STAR_PM_DEC;
        return bst_fail(ctx, BST_ERR_FORMAT,
                        "%s: has one column of proper motion only; the other may be named %s",
                        t->path, bst_star_quantity_names[lacks]);
    }
    if (c[BST_STAR_EPOCH] < 0 && isnan(t->options.epoch_year)) {
        return bst_fail(ctx, BST_ERR_FORMAT,
                        "%s: has no column of epochs (allowed names: %s); give --epoch, the Julian "
                        "year of the positions: 2016 for Gaia DR3",
                        t->path, bst_star_quantity_names[BST_STAR_EPOCH]);
    }
    return BST_OK;
}

/* Opens a table by the first bytes of its file. */
static bst_status open_kind(bst_ctx *ctx, bst_star_table *t) {
    int fd;
    uint64_t bytes;
    BST_TRY(bst_file_open(ctx, t->path, UINT64_C(1) << 40,
                          "a table of stars (CSV, ECSV, VOTable, all also gzipped, or FITS)", &fd,
                          &bytes));
    unsigned char head[512] = {0};
    ssize_t got = read(fd, head, sizeof head - 1);
    close(fd);
    const char *text = (const char *)head;
    bool gzip = got > 2 && head[0] == 0x1F && head[1] == 0x8B;
    if ((gzip && bst_text_ends_in(t->path, ".fits.gz")) || strncmp(text, "SIMPLE  =", 9) == 0) {
        return bst_star_fits_open(ctx, t);
    }
    if (strncmp(text, "<?xml", 5) == 0 || strstr(text, "<VOTABLE")) {
        return bst_star_votable_open(ctx, t, false);
    }
    if (gzip && (bst_text_ends_in(t->path, ".vot.gz") || bst_text_ends_in(t->path, ".xml.gz") ||
                 bst_text_ends_in(t->path, ".votable.gz"))) {
        return bst_star_votable_open(ctx, t, true);
    }
    return bst_star_text_open(ctx, t, gzip);
}

bst_status bst_star_table_open(bst_ctx *ctx, const char *path,
                               const bst_star_table_options *options, bst_star_table **out) {
    *out = NULL;
    bst_star_table *t = calloc(1, sizeof *t);
    if (!t) {
        return bst_fail(ctx, BST_ERR_MEMORY, "%s: out of memory", path);
    }
    t->options = *options;
    t->source_column = -1;
    for (int q = 0; q < BST_STAR_QUANTITIES; q++) {
        t->column[q] = -1;
    }
    bst_status status = BST_OK;
    int n = snprintf(t->path, sizeof t->path, "%s", path);
    if (n < 0 || (size_t)n >= sizeof t->path) {
        status = bst_fail(ctx, BST_ERR_ARGUMENT, "%.100s...: the path is longer than %zu bytes",
                          path, sizeof t->path - 1);
    }
    if (status == BST_OK) {
        status = open_kind(ctx, t);
    }
    if (status == BST_OK) {
        status = check_columns(ctx, t);
    }
    if (status != BST_OK) {
        bst_star_table_close(t);
        return status;
    }
    *out = t;
    return BST_OK;
}

/* ---------------------------------------------------------------- rows */

bst_status bst_star_table_next(bst_ctx *ctx, bst_star_table *t, bst_star_table_row *row,
                               bool *end) {
    for (;;) {
        double v[BST_STAR_QUANTITIES];
        *row = (bst_star_table_row){0};
        BST_TRY(t->votable ? bst_star_votable_next(ctx, t, &row->source, v, end)
                : t->text  ? bst_star_text_next(ctx, t, &row->source, v, end)
                           : bst_star_fits_next(ctx, t, &row->source, v, end));
        if (*end) {
            return BST_OK;
        }
        t->rows++;
        set_magnitudes(&t->options, v, row);
        row->epoch_year = isnan(v[BST_STAR_EPOCH]) ? t->options.epoch_year : v[BST_STAR_EPOCH];
        if (isnan(v[BST_STAR_RA]) || isnan(v[BST_STAR_DEC]) || isnan(row->v_mag) ||
            isnan(row->epoch_year)) {
            t->skipped++;
            continue;
        }
        BST_TRY(check_range(ctx, t, BST_STAR_RA, v[BST_STAR_RA], 0.0, 360.0));
        BST_TRY(check_range(ctx, t, BST_STAR_DEC, v[BST_STAR_DEC], -90.0, 90.0));
        BST_TRY(check_range(ctx, t, BST_STAR_EPOCH, row->epoch_year, 1800.0, 2200.0));
        BST_TRY(check_range(ctx, t, BST_STAR_V, row->v_mag, -2.5, 40.0));
        row->ra_deg = v[BST_STAR_RA];
        row->dec_deg = v[BST_STAR_DEC];
        if (!isnan(v[BST_STAR_PM_RA]) && !isnan(v[BST_STAR_PM_DEC])) {
            row->has_motion = true;
            row->pm_ra_cosdec_masyr = v[BST_STAR_PM_RA];
            row->pm_dec_masyr = v[BST_STAR_PM_DEC];
            BST_TRY(check_range(ctx, t, BST_STAR_PM_RA, row->pm_ra_cosdec_masyr, -13e3, 13e3));
            BST_TRY(check_range(ctx, t, BST_STAR_PM_DEC, row->pm_dec_masyr, -13e3, 13e3));
        }
        BST_TRY(set_parallax_and_period(ctx, t, v, row));
        if (!isnan(row->b_minus_v)) {
            row->b_minus_v = fmin(fmax(row->b_minus_v, -1.0), 6.0);
        }
        return BST_OK;
    }
}

void bst_star_table_counts(const bst_star_table *t, int64_t *rows, int64_t *skipped) {
    *rows = t->rows;
    *skipped = t->skipped;
}

void bst_star_table_close(bst_star_table *t) {
    if (!t) {
        return;
    }
    bst_star_votable_close(t);
    if (t->text && t->unzips) {
        /* an unread rest is no failure */
        (void)bst_subprocess_wait(&t->unzip);
    } else if (t->text) {
        fclose(t->text);
    }
    if (t->fits) {
        int ignored = 0;
        fits_close_file(t->fits, &ignored);
        fits_clear_errmsg();
    }
    for (int q = 0; q < BST_STAR_QUANTITIES; q++) {
        free(t->block[q]);
    }
    free(t->block_source);
    free(t->line);
    free(t->scratch);
    free(t->units);
    free(t);
}
