#include "view/plot_truth.h"

#include <math.h>
#include <stdlib.h>

#include "sim/core/memory.h"
#include "view/plot_samples.h"
#include "view/plot_values.h"

/* The table of the truth may have gigabytes, and no index. The number is compared first: a word
 * takes longer. What belongs to the exposures is read before, and found by their numbers. */
static const char truth_sql[] =
    "SELECT exposure_id, mid_s, snr, x_mid_px, y_mid_px, ra_deg, dec_deg, in_field FROM truth"
    " WHERE id = ?2 AND sensor = ?1 AND kind = 'object'";
static const char exposures_sql[] =
    "SELECT exposure_id, mid_s, boresight_x_px, boresight_y_px FROM exposures WHERE sensor = ?1";
static const char target_tracks_sql[] =
    "SELECT exposure_id, time_s, ra_deg, dec_deg FROM tracks WHERE sensor = ?1"
    " AND target_of_interest = 1";
/* Exposures and states that are found so, 32 bytes each; with more, each line is read alone. */
static const size_t FOUND_MOST = 4000000;

/* Two numbers of an exposure at a time. */
typedef struct of_exposure {
    int64_t id;
    double time_s, a, b; /* time NAN: taken */
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

/* Lists rows {exposure, time, a, b} whose time is a number; none if the table was not recorded. */
static bst_status list_rows(bst_ctx *ctx, bst_view_run *run, const bst_view_sensor *s,
                            const char *sql, exposure_list *list) {
    bst_ctx ignored = {0};
    bst_io_rows *rows;
    bst_status status;
    bool more, sorted = true;
    if (bst_io_rows_open(&ignored, run->reader, sql, s->sensor.index, 0, &rows) != BST_OK) {
        return BST_OK;
    }
    while ((status = bst_io_rows_next(ctx, rows, &more)) == BST_OK && more) {
        if (!isfinite(bst_io_rows_real(rows, 1))) {
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
        *item = (of_exposure){bst_io_rows_int(rows, 0), bst_io_rows_real(rows, 1),
                              bst_io_rows_real(rows, 2), bst_io_rows_real(rows, 3)};
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

bst_status bst_view_read_truth(bst_ctx *ctx, bst_view_run *run, const bst_view_sensor *s,
                               bst_view_line *error, bst_view_line *snr, bst_view_line *angle,
                               bool *done) {
    truth_lines t = {.errors = {.samples = NULL}};
    bst_ctx ignored = {0};
    bst_io_rows *rows = NULL;
    bool more;
    bst_status status = list_rows(ctx, run, s, exposures_sql, &t.exposures);
    status = status == BST_OK ? list_rows(ctx, run, s, target_tracks_sql, &t.tracks) : status;
    *done = status != BST_OK || (!t.exposures.too_many && !t.tracks.too_many &&
                                 bst_io_rows_open(&ignored, run->reader, truth_sql, s->sensor.index,
                                                  s->target, &rows) == BST_OK);
    while (rows && status == BST_OK && (status = bst_io_rows_next(ctx, rows, &more)) == BST_OK &&
           more) {
        status = take_truth(ctx, rows, &t);
    }
    free(t.exposures.items);
    free(t.tracks.items);
    if (!rows) {
        return status;
    }
    bst_io_rows_close(rows);
    error->used = snr->used = angle->used = run->requests;
    const bst_status kept[] = {bst_view_keep_line(ctx, status, run, &t.errors, error),
                               bst_view_keep_line(ctx, status, run, &t.snrs, snr),
                               bst_view_keep_line(ctx, status, run, &t.angles, angle)};
    return kept[0] != BST_OK ? kept[0] : kept[1] != BST_OK ? kept[1] : kept[2];
}
