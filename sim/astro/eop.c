#include <erfa.h>
#include <erfam.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "sim/astro/eop_table.h"
#include "sim/astro/frames_internal.h"
#include "sim/core/file.h"

#define MAX_FILE_BYTES ((uint64_t)64 << 20)

static const char NO_MEMORY[] = "no memory for the Earth-orientation table";

struct bst_astro_eop {
    int first_mjd; /* of rows[0], 0h UTC */
    int count;     /* >= 2 */
    bst_astro_eop_values *rows;
    bst_astro_eop_prediction after;
};

bst_status bst_astro_eop_builtin(bst_ctx *ctx, bst_astro_eop **out) {
    int count = bst_eop_table_rows;
    bst_astro_eop *eop = calloc(1, sizeof *eop);
    bst_astro_eop_values *rows = malloc((size_t)count * sizeof *rows);
    if (!eop || !rows) {
        free(eop);
        free(rows);
        return bst_fail(ctx, BST_ERR_MEMORY, "%s", NO_MEMORY);
    }
    for (int i = 0; i < count; i++) {
        const bst_eop_table_row *row = &bst_eop_table[i];
        rows[i] =
            (bst_astro_eop_values){row->ut1_minus_utc * 1e-7, row->xp_uas * (1e-6 * BST_ARCSEC_RAD),
                                   row->yp_uas * (1e-6 * BST_ARCSEC_RAD)};
    }
    *eop = (bst_astro_eop){.first_mjd = bst_eop_table_first_mjd, .count = count, .rows = rows};
    bst_status status = bst_astro_eop_prediction_fit(ctx, eop->first_mjd, count, rows, &eop->after);
    if (status != BST_OK) {
        bst_astro_eop_free(eop);
        return status;
    }
    *out = eop;
    return BST_OK;
}

void bst_astro_eop_free(bst_astro_eop *eop) {
    if (eop) {
        free(eop->rows);
        free(eop);
    }
}

/* Parses up to `wanted` numbers separated by blanks; returns their number. */
static int read_numbers(const char *text, double *values, int wanted) {
    int n = 0;
    while (n < wanted) {
        char *end;
        values[n] = strtod(text, &end);
        bool is_hexadecimal = memchr(text, 'x', (size_t)(end - text)) != NULL;
        if (end == text || is_hexadecimal || (*end && !strchr(" \t", *end))) {
            break;
        }
        text = end;
        n++;
    }
    return n;
}

/* Parses a data row: year month day [hour] MJD x y UT1-UTC ...; the hour column identifies the 20
 * C04 series. */
static bst_status read_row(bst_ctx *ctx, const char *line, int *mjd, bst_astro_eop_values *row) {
    double v[8];
    int n = read_numbers(line, v, 8);
    int hour = n > 3 && v[3] < 24.0;
    if (n < 7 + hour) {
        return bst_fail(ctx, BST_ERR_FORMAT,
                        "expected year month day [hour] MJD x y UT1-UTC of an IERS EOP C04 file, "
                        "found %d numbers in \"%.60s\"",
                        n, line);
    }
    const double *data = v + 3 + hour;
    double djm0, djm;
    bool whole = v[0] == floor(v[0]) && v[1] == floor(v[1]) && v[2] == floor(v[2]);
    bool dated = whole && v[0] >= 1900.0 && v[0] < 2200.0 && v[1] >= 1.0 && v[1] <= 12.0 &&
                 v[2] >= 1.0 && v[2] <= 31.0 &&
                 eraCal2jd((int)v[0], (int)v[1], (int)v[2], &djm0, &djm) == 0;
    if (!dated || djm != data[0] || (hour && v[3] != 0.0)) {
        return bst_fail(ctx, BST_ERR_FORMAT,
                        "date and MJD are not one and the same midnight in \"%.60s\"", line);
    }
    if (!(fabs(data[1]) < 2.0 && fabs(data[2]) < 2.0 && fabs(data[3]) < 1.5)) {
        return bst_fail(ctx, BST_ERR_FORMAT,
                        "pole of 2 arcsec or more, or UT1-UTC of 1.5 s or more, in \"%.60s\"",
                        line);
    }
    *mjd = (int)djm;
    *row = (bst_astro_eop_values){data[3], data[1] * BST_ARCSEC_RAD, data[2] * BST_ARCSEC_RAD};
    return BST_OK;
}

static bst_status append_row(bst_ctx *ctx, bst_astro_eop *eop, int *capacity, int mjd,
                             bst_astro_eop_values row) {
    if (eop->count == 0) {
        eop->first_mjd = mjd;
    } else if (mjd != eop->first_mjd + eop->count) {
        return bst_fail(ctx, BST_ERR_FORMAT, "MJD %d does not follow MJD %d: rows must be daily",
                        mjd, eop->first_mjd + eop->count - 1);
    }
    if (eop->count == *capacity) {
        int grown = *capacity ? 2 * *capacity : 1024;
        bst_astro_eop_values *rows = realloc(eop->rows, (size_t)grown * sizeof *rows);
        if (!rows) {
            return bst_fail(ctx, BST_ERR_MEMORY, "%s", NO_MEMORY);
        }
        eop->rows = rows;
        *capacity = grown;
    }
    eop->rows[eop->count++] = row;
    return BST_OK;
}

static int count_words(const char *text) {
    int words = 0;
    for (text += strspn(text, " \t"); *text; text += strspn(text, " \t")) {
        text += strcspn(text, " \t");
        words++;
    }
    return words;
}

static bst_status read_rows(bst_ctx *ctx, const char *name, const char *data, size_t bytes,
                            bst_astro_eop *eop) {
    char line[512];
    int capacity = 0, number = 0, columns = 0;
    for (const char *next = data, *end = data + bytes; next < end;) {
        number++;
        const char *stop = memchr(next, '\n', (size_t)(end - next));
        size_t length = (size_t)((stop ? stop : end) - next);
        if (length >= sizeof line) {
            return bst_fail(ctx, BST_ERR_FORMAT,
                            "%.400s:%d: a line of %zu bytes (allowed: at most %zu); expected an "
                            "IERS EOP C04 file",
                            name, number, length, sizeof line - 1);
        }
        memcpy(line, next, length);
        line[length] = '\0';
        line[strcspn(line, "\r")] = '\0';
        next = stop ? stop + 1 : end;
        const char *text = line + strspn(line, " \t");
        bool numeric = *text >= '0' && *text <= '9';
        if (!numeric && (eop->count == 0 || *text == '#' || *text == '\0')) {
            continue; /* header or comment */
        }
        int mjd = 0;
        bst_astro_eop_values row = {0};
        bst_status status = read_row(ctx, line, &mjd, &row);
        /* a truncated file may end inside a number */
        int words = count_words(line);
        columns = columns ? columns : words;
        if (status == BST_OK && words != columns) {
            status = bst_fail(ctx, BST_ERR_FORMAT,
                              "%d columns where the rows before have %d in \"%.60s\"", words,
                              columns, line);
        }
        if (status == BST_OK) {
            status = append_row(ctx, eop, &capacity, mjd, row);
        }
        if (status != BST_OK) {
            return bst_fail_prefix(ctx, status, "%.400s:%d", name, number);
        }
    }
    if (eop->count < 2) {
        return bst_fail(ctx, BST_ERR_FORMAT,
                        "%.400s: %d rows of Earth orientation found, at least 2 are needed; "
                        "expected an IERS EOP C04 file",
                        name, eop->count);
    }
    return BST_OK;
}

bst_status bst_astro_eop_read_buffer(bst_ctx *ctx, const char *name, const char *data, size_t bytes,
                                     bst_astro_eop **out) {
    *out = NULL;
    BST_TRY(bst_file_check_text(ctx, name, data, bytes));
    bst_astro_eop *eop = calloc(1, sizeof *eop);
    bst_status status = eop ? read_rows(ctx, name, data, bytes, eop)
                            : bst_fail(ctx, BST_ERR_MEMORY, "%s", NO_MEMORY);
    if (status == BST_OK) {
        status =
            bst_astro_eop_prediction_fit(ctx, eop->first_mjd, eop->count, eop->rows, &eop->after);
    }
    if (status != BST_OK) {
        bst_astro_eop_free(eop);
        return status;
    }
    *out = eop;
    return BST_OK;
}

bst_status bst_astro_eop_load(bst_ctx *ctx, const char *path, bst_astro_eop **out) {
    *out = NULL;
    char *data;
    size_t bytes;
    BST_TRY(bst_file_read(ctx, path, MAX_FILE_BYTES, "an IERS EOP C04 file", &data, &bytes));
    bst_status status = bst_astro_eop_read_buffer(ctx, path, data, bytes, out);
    free(data);
    return status;
}

/* days of prediction after the last row */
static const double PREDICTED_DAYS = 365.25 * BST_EOP_PREDICTED_YEARS;

static bst_status fail_outside(bst_ctx *ctx, const bst_astro_eop *eop, bst_time t) {
    char when[40];
    int first[3], last[3];
    double fraction;
    bst_time_to_utc(t, 0, when, sizeof when);
    eraJd2cal(ERFA_DJM0, eop->first_mjd, &first[0], &first[1], &first[2], &fraction);
    eraJd2cal(ERFA_DJM0, eop->after.last_mjd, &last[0], &last[1], &last[2], &fraction);
    return bst_fail(ctx, BST_ERR_RANGE,
                    "%s is outside the Earth-orientation table, which covers %04d-%02d-%02d to "
                    "%04d-%02d-%02d 0h UTC and is continued for %d years; give an IERS EOP C04 "
                    "file that covers it",
                    when, first[0], first[1], first[2], last[0], last[1], last[2],
                    BST_EOP_PREDICTED_YEARS);
}

/* Days after the first row, integer and fraction. */
static double day_of(const bst_astro_eop *eop, bst_time t, double *fraction) {
    double utc1;
    bst_time_utc(t, &utc1, fraction);
    return utc1 - ERFA_DJM0 - eop->first_mjd;
}

bst_status bst_astro_eop_at(bst_ctx *ctx, const bst_astro_eop *eop, bst_time t,
                            bst_astro_eop_values *out) {
    double f, day = day_of(eop, t, &f);
    if (!(day >= 0.0 && day + f - (eop->count - 1) <= PREDICTED_DAYS)) {
        return fail_outside(ctx, eop, t);
    }
    if (day >= eop->count - 1) {
        if (day == eop->count - 1 && f == 0.0) {
            *out = eop->rows[eop->count - 1];
        } else {
            bst_astro_eop_prediction_at(&eop->after, eop->first_mjd + day + f, out);
        }
        return BST_OK;
    }
    const bst_astro_eop_values *a = &eop->rows[(int)day], *b = a + 1;
    /* A leap second at the end of the day changes UT1-UTC by one second. */
    double step = b->ut1_minus_utc_s - a->ut1_minus_utc_s;
    step -= round(step);
    out->ut1_minus_utc_s = a->ut1_minus_utc_s + f * step;
    out->xp_rad = a->xp_rad + f * (b->xp_rad - a->xp_rad);
    out->yp_rad = a->yp_rad + f * (b->yp_rad - a->yp_rad);
    return BST_OK;
}

bool bst_astro_eop_uncertainty_at(const bst_astro_eop *eop, bst_time t,
                                  bst_astro_eop_uncertainty *out) {
    double f, day = day_of(eop, t, &f);
    *out = (bst_astro_eop_uncertainty){0};
    if (!(day + f > eop->count - 1)) {
        return false;
    }
    bst_astro_eop_prediction_error(&eop->after, eop->first_mjd + day + f, out);
    return true;
}

void bst_astro_eop_warn(bst_ctx *ctx, const bst_astro_eop *eop, bst_time last, const char *where) {
    bst_astro_eop_uncertainty u;
    int end[3];
    double fraction;
    if (!bst_astro_eop_uncertainty_at(eop, last, &u)) {
        return;
    }
    eraJd2cal(ERFA_DJM0, eop->after.last_mjd, &end[0], &end[1], &end[2], &fraction);
    bst_log(ctx, BST_LOG_WARNING,
            "%sthe Earth-orientation table ends on %04d-%02d-%02d, %.0f days earlier: UT1 is "
            "predicted to within %.*f ms (%.*f arcsec of the Earth's rotation), the pole to within "
            "%.2f arcsec (95 %%); leap seconds after the last one announced are not known",
            where, end[0], end[1], end[2], u.days, u.ut1_s < 0.1, 1e3 * u.ut1_s, u.ut1_s < 0.1,
            15.041 * u.ut1_s, u.pole_arcsec);
}

bst_status bst_astro_eop_nearest(bst_ctx *ctx, const bst_astro_eop *eop, bst_time t,
                                 bst_time *out) {
    bst_time first, last;
    BST_TRY(bst_time_from_utc_jd(ctx, ERFA_DJM0, eop->first_mjd, &first));
    BST_TRY(bst_time_from_utc_jd(ctx, ERFA_DJM0, eop->after.last_mjd + PREDICTED_DAYS, &last));
    first = bst_time_add(first, 1.0);
    last = bst_time_add(last, -1.0);
    *out = bst_time_diff(t, first) < 0.0 ? first : bst_time_diff(t, last) > 0.0 ? last : t;
    return BST_OK;
}
