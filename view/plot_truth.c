#include "view/plot_truth.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "sim/core/memory.h"
#include "view/plot_samples.h"
#include "view/plot_values.h"

/* The table of the truth may have gigabytes, and no index. What belongs to the exposures is read
 * before, and found by their numbers. */
#define TRUTH_COLUMNS "exposure_id, mid_s, snr, x_mid_px, y_mid_px, ra_deg, dec_deg, in_field"
/* All rows of the target. The number is compared first: a word takes longer. */
static const char truth_sql[] =
    "SELECT " TRUTH_COLUMNS " FROM truth WHERE id = ?2 AND sensor = ?1 AND kind = 'object'";
/* Those of them in a range of rows. */
static const char truth_part_sql[] =
    "SELECT " TRUTH_COLUMNS ", rowid FROM truth WHERE rowid BETWEEN ?1 AND ?2 AND id = %" PRId64
    " AND sensor = %" PRId64 " AND kind = 'object'";
/* The rows at the ends of a range, and those beside it. */
static const char truth_ends_sql[] =
    "SELECT exposure_id, sensor, rowid FROM truth WHERE rowid IN (?1 - 1, ?1, ?2, ?2 + 1)";
/* Of all sensors: their exposures, in the order in which the truth has their rows, with the number
 * of these. */
static const char exposures_sql[] =
    "SELECT exposure_id, mid_s, boresight_x_px, boresight_y_px, sensor, sources FROM exposures"
    " ORDER BY rowid";
/* Those of the sensor; tables of others may have no number of rows. */
static const char own_exposures_sql[] =
    "SELECT exposure_id, mid_s, boresight_x_px, boresight_y_px FROM exposures WHERE sensor = ?1";
static const char target_tracks_sql[] =
    "SELECT exposure_id, time_s, ra_deg, dec_deg FROM tracks WHERE sensor = ?1"
    " AND target_of_interest = 1";
/* Exposures and states that are found so, 48 bytes each; with more, each line is read alone. */
static const size_t FOUND_MOST = 4000000;

/* Two numbers of an exposure at a time. */
typedef struct of_exposure {
    int64_t id;
    double time_s, a, b;    /* time NAN: taken */
    int64_t first_row, end; /* its rows of the truth; of the list of exposures only */
} of_exposure;

typedef struct exposure_list {
    void *items; /* of_exposure[count], by their numbers */
    size_t room, count;
    bool too_many;
} exposure_list;

static int compare_exposures(const void *left, const void *right) {
    const of_exposure *a = left, *b = right;
    return (a->id > b->id) - (a->id < b->id);
}

/* Lists rows {exposure, time, a, b} of the sensor whose time is a number; none if the table was not
 * recorded. With columns {sensor, sources} behind them the rows are of all sensors: the last row of
 * the truth that they name is in *last_row. */
static bst_status list_rows(bst_ctx *ctx, bst_view_run *run, const bst_view_sensor *s,
                            const char *sql, exposure_list *list, int64_t *last_row) {
    bst_ctx ignored = {0};
    bst_io_rows *rows;
    bst_status status;
    bool more, sorted = true;
    int64_t first = 1, end = 1;
    if (bst_io_rows_open(&ignored, run->reader, sql, s->sensor.index, 0, &rows) != BST_OK) {
        return BST_OK;
    }
    while ((status = bst_io_rows_next(ctx, rows, &more)) == BST_OK && more) {
        if (last_row) {
            const int64_t sources = bst_io_rows_int(rows, 5);
            first = end;
            end += sources > 0 && sources < INT32_MAX ? sources : 0;
            *last_row = end - 1;
        }
        if (!isfinite(bst_io_rows_real(rows, 1)) ||
            (last_row && bst_io_rows_int(rows, 4) != s->sensor.index)) {
            continue;
        }
        if (list->count == FOUND_MOST) {
            list->too_many = true;
            break;
        }
        const size_t bytes = (list->count + 1) * sizeof(of_exposure);
        if (list->room < bytes) {
            status = bst_memory_grow(ctx, "out of memory for a time series", &list->items,
                                     &list->room, 2 * list->room + 65536);
            if (status != BST_OK) {
                break;
            }
        }
        of_exposure *item = (of_exposure *)list->items + list->count++;
        *item = (of_exposure){bst_io_rows_int(rows, 0),
                              bst_io_rows_real(rows, 1),
                              bst_io_rows_real(rows, 2),
                              bst_io_rows_real(rows, 3),
                              first,
                              end};
        sorted = sorted && (list->count == 1 || item[-1].id <= item->id);
    }
    bst_io_rows_close(rows);
    if (!sorted) {
        qsort(list->items, list->count, sizeof(of_exposure), compare_exposures);
    }
    return status;
}

/* First row of an exposure; NULL: none. The rows of its exposure follow. */
static of_exposure *find_exposure(const exposure_list *list, int64_t id) {
    of_exposure *items = list->items;
    size_t low = 0, high = list->count;
    while (low < high) {
        const size_t middle = low + (high - low) / 2;
        if (items[middle].id < id) {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    return low < list->count && items[low].id == id ? &items[low] : NULL;
}

/* Lines that are read at once. */
typedef struct truth_lines {
    exposure_list exposures, tracks;
    bst_view_samples errors, snrs, angles;
} truth_lines;

/* Takes a row of the target's truth. */
static bst_status take_truth(bst_ctx *ctx, const bst_io_rows *rows, truth_lines *t) {
    const int64_t id = bst_io_rows_int(rows, 0);
    if (bst_io_rows_int(rows, 7) == 1) {
        const of_exposure *e = find_exposure(&t->exposures, id);
        BST_TRY(
            bst_view_collect(ctx, &t->snrs, bst_io_rows_real(rows, 1), bst_io_rows_real(rows, 2)));
        if (e) {
            BST_TRY(bst_view_collect(
                ctx, &t->errors, e->time_s,
                hypot(bst_io_rows_real(rows, 3) - e->a, bst_io_rows_real(rows, 4) - e->b)));
        }
    }
    const of_exposure *end = (const of_exposure *)t->tracks.items + t->tracks.count;
    /* repeated rows of a hostile file would multiply: those of an exposure are taken once */
    for (of_exposure *track = find_exposure(&t->tracks, id);
         track && track < end && track->id == id && isfinite(track->time_s); track++) {
        BST_TRY(
            bst_view_collect(ctx, &t->angles, track->time_s,
                             bst_view_angle_arcsec(track->a, track->b, bst_io_rows_real(rows, 5),
                                                   bst_io_rows_real(rows, 6))));
        track->time_s = NAN;
    }
    return BST_OK;
}

/* Looks whether an exposure has the rows that it should have, and none beside them: those of an
 * exposure follow each other.
 *
 * Given:     ends  of truth_ends_sql */
static bst_status has_its_rows(bst_ctx *ctx, bst_io_rows *ends, const of_exposure *e,
                               int64_t sensor, bool *has) {
    bst_status status;
    bool more;
    bst_io_rows_restart(ends, e->first_row, e->end - 1);
    while ((status = bst_io_rows_next(ctx, ends, &more)) == BST_OK && more) {
        const int64_t row = bst_io_rows_int(ends, 2);
        const bool own = bst_io_rows_int(ends, 0) == e->id && bst_io_rows_int(ends, 1) == sensor;
        *has = *has && own == (row >= e->first_row && row < e->end);
    }
    return status;
}

/* Reads the rows of the target where the exposures say that they are: an object's row is as far
 * from the end of its exposure's rows as in the exposure before, most often. So not all rows are
 * read.
 *
 * Given:     rows, ends  of truth_part_sql and truth_ends_sql
 * Returned:  *there  false: the rows are not where they should be, and some may be missing */
static bst_status read_parts(bst_ctx *ctx, bst_io_rows *rows, bst_io_rows *ends, int64_t sensor,
                             truth_lines *t, bool *there) {
    const of_exposure *exposures = t->exposures.items;
    int64_t from_end = 1;
    for (size_t k = 0; k < t->exposures.count && *there; k++) {
        const of_exposure *e = &exposures[k];
        const int64_t guess = e->end - from_end;
        bool more = false;
        if (guess >= e->first_row) {
            bst_io_rows_restart(rows, guess, guess);
            BST_TRY(bst_io_rows_next(ctx, rows, &more));
        }
        if (!more) {
            BST_TRY(has_its_rows(ctx, ends, e, sensor, there));
            bst_io_rows_restart(rows, e->first_row, e->end - 1);
            BST_TRY(bst_io_rows_next(ctx, rows, &more));
        }
        if (more) {
            from_end = e->end - bst_io_rows_int(rows, 8);
            *there = *there && bst_io_rows_int(rows, 0) == e->id;
            BST_TRY(take_truth(ctx, rows, t));
        }
    }
    return BST_OK;
}

/* Forgets what was read of the truth. */
static void forget_samples(truth_lines *t) {
    bst_view_samples *const all[] = {&t->errors, &t->snrs, &t->angles};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++) {
        free(all[i]->samples);
        *all[i] = (bst_view_samples){.samples = NULL};
    }
}

/* Reads the truth in parts. False: its rows are not as the exposures say, or they do not say it. */
static bool read_known_places(bst_view_run *run, const bst_view_sensor *s, int64_t last_row,
                              truth_lines *t) {
    bst_ctx ignored = {0};
    bst_io_rows *rows, *ends;
    char sql[sizeof truth_part_sql + 48];
    bool there = last_row > 0 &&
                 bst_run_reader_int(run->reader, "SELECT max(rowid) FROM truth", 0, 0) == last_row;
    snprintf(sql, sizeof sql, truth_part_sql, s->target, (int64_t)s->sensor.index);
    if (!there || bst_io_rows_open(&ignored, run->reader, sql, 0, 0, &rows) != BST_OK) {
        return false;
    }
    there = bst_io_rows_open(&ignored, run->reader, truth_ends_sql, 0, 0, &ends) == BST_OK;
    if (there) {
        there = read_parts(&ignored, rows, ends, s->sensor.index, t, &there) == BST_OK && there;
        bst_io_rows_close(ends);
    }
    bst_io_rows_close(rows);
    return there;
}

/* Reads the whole truth. */
static bst_status read_all(bst_ctx *ctx, bst_io_rows *rows, truth_lines *t) {
    bst_status status;
    bool more;
    while ((status = bst_io_rows_next(ctx, rows, &more)) == BST_OK && more) {
        BST_TRY(take_truth(ctx, rows, t));
    }
    return status;
}

/* Lists what is found by the numbers of exposures. */
static bst_status list_found(bst_ctx *ctx, bst_view_run *run, const bst_view_sensor *s,
                             truth_lines *t, int64_t *last_row) {
    t->exposures.count = t->tracks.count = 0;
    BST_TRY(list_rows(ctx, run, s, exposures_sql, &t->exposures, last_row));
    if (t->exposures.count == 0) {
        BST_TRY(list_rows(ctx, run, s, own_exposures_sql, &t->exposures, NULL));
    }
    return list_rows(ctx, run, s, target_tracks_sql, &t->tracks, NULL);
}

bst_status bst_view_read_truth(bst_ctx *ctx, bst_view_run *run, const bst_view_sensor *s,
                               bst_view_line *error, bst_view_line *snr, bst_view_line *angle,
                               bool *done) {
    truth_lines t = {.errors = {.samples = NULL}};
    bst_ctx ignored = {0};
    bst_io_rows *rows = NULL;
    int64_t last_row = 0;
    bst_status status = list_found(ctx, run, s, &t, &last_row);
    const bool few = !t.exposures.too_many && !t.tracks.too_many;
    bool read = status == BST_OK && few && read_known_places(run, s, last_row, &t);
    *done = status != BST_OK || read ||
            (few && bst_io_rows_open(&ignored, run->reader, truth_sql, s->sensor.index, s->target,
                                     &rows) == BST_OK);
    if (rows) {
        forget_samples(&t); /* and the marks of tracks that were taken */
        status = list_found(ctx, run, s, &t, &last_row);
        status = status == BST_OK ? read_all(ctx, rows, &t) : status;
        bst_io_rows_close(rows);
        read = true;
    }
    free(t.exposures.items);
    free(t.tracks.items);
    if (!read) {
        forget_samples(&t);
        return status;
    }
    error->used = snr->used = angle->used = run->requests;
    const bst_status kept[] = {bst_view_keep_line(ctx, status, run, &t.errors, error),
                               bst_view_keep_line(ctx, status, run, &t.snrs, snr),
                               bst_view_keep_line(ctx, status, run, &t.angles, angle)};
    return kept[0] != BST_OK ? kept[0] : kept[1] != BST_OK ? kept[1] : kept[2];
}
