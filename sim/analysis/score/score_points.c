/* Points from any source, sorted by frame. */
#include "sim/analysis/score/score_points.h"

#include <cjson/cJSON.h>
#include <dirent.h>
#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "boresight/config.h"
#include "sim/core/file.h"
#include "sim/io/run_files.h"

enum { MOST_FILES = 1000000 };

/* Largest CSV file. */
static const uint64_t MOST_BYTES = (uint64_t)256 << 20;

static int by_key(const void *a, const void *b) {
    return bst_score_key_compare(a, b);
}

/* By frame, then by place: results do not depend on the order in the file. */
static int by_place(const void *a, const void *b) {
    const bst_score_point *p = a, *q = b;
    int order = bst_score_key_compare(&p->key, &q->key);
    if (order != 0) {
        return order;
    }
    return p->x_px != q->x_px ? (p->x_px > q->x_px ? 1 : -1)
                              : (p->y_px > q->y_px) - (p->y_px < q->y_px);
}

/* Sorts frames and points, and removes repeated frames. */
static void sort_points(bst_score_points *p) {
    if (p->count > 0) {
        qsort(p->items, (size_t)p->count, sizeof *p->items, by_place);
    }
    if (p->frame_count > 0) {
        qsort(p->frames, (size_t)p->frame_count, sizeof *p->frames, by_key);
    }
    int kept = 0;
    for (int i = 0; i < p->frame_count; i++) {
        if (kept == 0 || by_key(&p->frames[kept - 1], &p->frames[i]) != 0) {
            p->frames[kept++] = p->frames[i];
        }
    }
    p->frame_count = kept;
}

/* Fails if the selection compares scores and no point has one. */
static bst_status check_scores(bst_ctx *ctx, const char *path, const bst_score_selection *selection,
                               const bst_score_points *p) {
    bool is_truth = selection->what == BST_SCORE_TRUTH;
    double least = is_truth ? selection->least_snr : selection->least_score;
    bool known = least == -(double)INFINITY || p->count == 0;
    for (int i = 0; i < p->count && !known; i++) {
        known = !isnan(p->items[i].score);
    }
    return known ? BST_OK
                 : bst_fail(ctx, BST_ERR_ARGUMENT,
                            "%s %g: no point of %.400s has a score or SNR (allowed: a run, SatNet "
                            "annotations with confidence or snr_aperture, CSV with the column "
                            "score or snr)",
                            is_truth ? "--least-snr" : "--least-score", least, path);
}

/* Removes points below the least score. */
static void leave_out_weak(bst_score_points *p, double least_score) {
    int kept = 0;
    for (int i = 0; i < p->count; i++) {
        if (!(p->items[i].score < least_score)) {
            p->items[kept++] = p->items[i];
        }
    }
    p->count = kept;
}

static bst_status read_json(bst_ctx *ctx, const char *path, int64_t ordinal,
                            bst_score_points *out) {
    bst_json *json;
    BST_TRY(bst_json_load(ctx, path, &json));
    bst_status status = bst_score_points_add_json(ctx, path, bst_json_root(json), ordinal, out);
    bst_json_free(json);
    return status;
}

static int is_annotation(const struct dirent *entry) {
    size_t length = strlen(entry->d_name);
    return length > 5 && entry->d_name[0] != '.' &&
           strcmp(entry->d_name + length - 5, ".json") == 0;
}

/* Fails if two files begin with the same frame. `first` has a frame a file; it gets sorted. */
static bst_status check_files(bst_ctx *ctx, const char *folder, bst_score_key *first, int count) {
    qsort(first, (size_t)count, sizeof *first, by_key);
    for (int i = 1; i < count; i++) {
        if (by_key(&first[i - 1], &first[i]) == 0) {
            return bst_fail(ctx, BST_ERR_FORMAT,
                            "%.400s: frame %" PRId64 " of sequence %" PRId64
                            " is in two files (allowed: a number of its own in "
                            "/data/file/sequence_id of each file, or in none)",
                            folder, first[i].frame, first[i].sequence);
        }
    }
    return BST_OK;
}

/* Reads JSON files of a folder. */
static bst_status read_files(bst_ctx *ctx, const char *folder, struct dirent **entries, int count,
                             bst_score_points *out) {
    char file[4400];
    int files = 0;
    bst_score_key *first = malloc((size_t)count * sizeof *first);
    bst_status status =
        first ? BST_OK : bst_fail(ctx, BST_ERR_MEMORY, "out of memory for %d files", count);
    for (int i = 0; status == BST_OK && i < count; i++) {
        int before = out->frame_count;
        snprintf(file, sizeof file, "%s/%s", folder, entries[i]->d_name);
        status = read_json(ctx, file, i, out);
        if (status == BST_OK && out->frame_count > before) {
            first[files++] = out->frames[before];
        }
    }
    if (status == BST_OK) {
        status = check_files(ctx, folder, first, files);
    }
    free(first);
    return status;
}

/* Reads the JSON files of a folder, or of its folder Annotations, in the order of their names. */
static bst_status read_folder(bst_ctx *ctx, const char *path, bst_score_points *out) {
    char folder[4096];
    struct stat there;
    struct dirent **entries = NULL;
    snprintf(folder, sizeof folder, "%.4000s/Annotations", path);
    if (stat(folder, &there) != 0) {
        snprintf(folder, sizeof folder, "%.4000s", path);
    }
    int count = scandir(folder, &entries, is_annotation, alphasort);
    bst_status status = BST_OK;
    if (count <= 0 || count > MOST_FILES) {
        status = bst_fail(ctx, BST_ERR_NOT_FOUND,
                          "%.400s: holds neither a run nor annotations (allowed: the folder of a "
                          "run, or one with 1 to %d files *.json as SatNet has them)",
                          folder, MOST_FILES);
    } else {
        status = read_files(ctx, folder, entries, count, out);
    }
    for (int i = 0; i < count; i++) {
        free(entries[i]);
    }
    free(entries);
    return status;
}

static bst_status read_csv(bst_ctx *ctx, const char *path, bst_score_points *out) {
    char *text;
    size_t bytes;
    BST_TRY(bst_file_read(ctx, path, MOST_BYTES, "a CSV file of points", &text, &bytes));
    bst_status status = bst_file_check_text(ctx, path, text, bytes);
    if (status == BST_OK) {
        status = bst_score_points_add_csv(ctx, path, text, out);
    }
    free(text);
    return status;
}

bst_status bst_score_points_read(bst_ctx *ctx, const char *path,
                                 const bst_score_selection *selection, bst_score_points *out) {
    struct stat there;
    size_t length = strlen(path);
    *out = (bst_score_points){0};
    if (stat(path, &there) != 0) {
        return bst_fail(ctx, BST_ERR_NOT_FOUND, "%.400s: cannot be opened: %s", path,
                        strerror(errno));
    }
    bst_status status;
    if (S_ISDIR(there.st_mode)) {
        status = bst_io_folder_is_run(path) ? bst_score_points_add_run(ctx, path, selection, out)
                                            : read_folder(ctx, path, out);
    } else if (length > 5 && strcmp(path + length - 5, ".json") == 0) {
        status = read_json(ctx, path, 0, out);
    } else {
        status = read_csv(ctx, path, out);
    }
    status = status == BST_OK ? check_scores(ctx, path, selection, out) : status;
    if (status == BST_OK && selection->what != BST_SCORE_TRUTH) {
        leave_out_weak(out, selection->least_score);
    }
    for (int i = 0; selection->what == BST_SCORE_TRUTH && i < out->count; i++) {
        out->items[i].optional = out->items[i].score < selection->least_snr;
    }
    sort_points(out);
    return status;
}
