/* Shard files: text, one line per row, with a checksum at the end. */
#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "sim/core/draft.h"
#include "sim/core/file.h"
#include "sim/core/fnv.h"
#include "sim/studies/results.h"

static const uint64_t MOST_BYTES = (uint64_t)4 << 30;

static uint64_t checksum(const char *text, size_t bytes) {
    return bst_fnv(BST_FNV_START, text, bytes);
}

/* ------------------------------------------------------------------ writing */

static void print_names(FILE *stream, const char *what, const bst_study_metric *list, int count) {
    fputs(what, stream);
    for (int i = 0; i < count; i++) {
        fprintf(stream, " %s", list[i].name);
    }
    fputc('\n', stream);
}

static void print_numbers(FILE *stream, const double *values, int count) {
    for (int i = 0; i < count; i++) {
        if (isnan(values[i])) {
            fputs(" nan", stream);
        } else if (values[i] == floor(values[i]) && fabs(values[i]) < 1e15) {
            fprintf(stream, " %.0f", values[i]);
        } else {
            fprintf(stream, " %.17g", values[i]);
        }
    }
    fputc('\n', stream);
}

bst_status bst_study_shard_begin(bst_ctx *ctx, const bst_study *study, const bst_study_kind *kind,
                                 int64_t first, bst_study_shard_draft *out) {
    *out = (bst_study_shard_draft){.first = first, .kind = kind};
    out->stream = open_memstream(&out->text, &out->bytes);
    if (!out->stream) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the rows of a shard");
    }
    fprintf(out->stream, "boresight shard 2\nstudy %s %s\n", study->digest, kind->name);
    print_names(out->stream, "metrics", kind->metrics, kind->metric_count);
    print_names(out->stream, "series", kind->series, kind->series_count);
    return BST_OK;
}

void bst_study_shard_add(bst_study_shard_draft *d, const bst_study_result *result, double wall_s,
                         const char *error) {
    int64_t run = d->first + d->count++;
    if (error) {
        fprintf(d->stream, "F %" PRId64 " %.6f %.6f ", run, wall_s, result->cpu_s);
        for (; *error; error++) {
            fputc(*error == '\n' ? '\x1f' : *error, d->stream);
        }
        fputc('\n', d->stream);
        return;
    }
    fprintf(d->stream, "R %" PRId64 " %.6f %.6f", run, wall_s, result->cpu_s);
    print_numbers(d->stream, result->metrics, d->kind->metric_count);
    for (int i = 0; i < result->rows; i++) {
        fputc('S', d->stream);
        print_numbers(d->stream, result->series + (size_t)i * (size_t)d->kind->series_count,
                      d->kind->series_count);
    }
}

void bst_study_shard_drop(bst_study_shard_draft *d) {
    if (d->stream) {
        fclose(d->stream);
    }
    free(d->text);
    *d = (bst_study_shard_draft){.count = 0};
}

bst_status bst_study_shard_path(bst_ctx *ctx, const char *out, int64_t first, int64_t count,
                                char *path, size_t bytes) {
    int n = snprintf(path, bytes, "%s/shards/%09" PRId64 "-%09" PRId64 ".rows", out, first,
                     first + count - 1);
    return n > 0 && (size_t)n < bytes
               ? BST_OK
               : bst_fail(ctx, BST_ERR_ARGUMENT, "%s: the path is too long", out);
}

static void sync_folder(const char *out) {
    char folder[4096];
    snprintf(folder, sizeof folder, "%s/shards", out);
    int fd = open(folder, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (fd >= 0) {
        fsync(fd);
        close(fd);
    }
}

/* Renames a draft to its final name unless it exists; without hard links by rename. */
static bool take_name(const char *draft, const char *path) {
    struct stat info;
    if (link(draft, path) == 0) {
        unlink(draft);
        return true;
    }
    if (errno == EEXIST) {
        /* anything but a regular file, such as a dangling link, has no rows */
        bool taken = stat(path, &info) == 0 && S_ISREG(info.st_mode);
        return taken ? unlink(draft) == 0 : rename(draft, path) == 0;
    }
    if (errno == EPERM || errno == EOPNOTSUPP || errno == ENOSYS) {
        return access(path, F_OK) == 0 ? unlink(draft) == 0 : rename(draft, path) == 0;
    }
    return false;
}

static bst_status write_file(bst_ctx *ctx, const bst_study_shard_draft *d, const char *out) {
    char path[4096], draft[4200];
    int fd;
    BST_TRY(bst_study_shard_path(ctx, out, d->first, d->count, path, sizeof path));
    BST_TRY(bst_draft_make(ctx, path, draft, sizeof draft, &fd));
    bool ok = bst_file_write_all(fd, d->text, d->bytes) && fsync(fd) == 0;
    int error = ok ? 0 : errno;
    if (close(fd) != 0 && ok) {
        ok = false;
        error = errno;
    }
    if (ok && !take_name(draft, path)) {
        ok = false;
        error = errno;
    }
    if (!ok) {
        unlink(draft);
        return bst_fail(ctx, BST_ERR_IO, "%s: cannot be written: %s", path, strerror(error));
    }
    sync_folder(out);
    return BST_OK;
}

bst_status bst_study_shard_publish(bst_ctx *ctx, bst_study_shard_draft *d, const char *out) {
    bst_status status = BST_OK;
    if (d->count > 0) {
        fflush(d->stream);
        fprintf(d->stream, "end %" PRId64 " %016" PRIx64 "\n", d->count,
                checksum(d->text, d->bytes));
        bool good = fflush(d->stream) == 0 && !ferror(d->stream);
        status = good ? write_file(ctx, d, out)
                      : bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the rows of a shard");
    }
    bst_study_shard_drop(d);
    return status;
}

/* ------------------------------------------------------------------ reading */

static bst_status grow(bst_ctx *ctx, void **list, int64_t count, int64_t *room, size_t item) {
    if (count < *room) {
        return BST_OK;
    }
    int64_t wanted = 2 * *room > 64 ? 2 * *room : 64;
    void *grown = realloc(*list, (size_t)wanted * item);
    if (!grown) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the rows of runs");
    }
    *list = grown;
    *room = wanted;
    return BST_OK;
}

static bool read_numbers(char **at, int count, double *out) {
    for (int i = 0; i < count; i++) {
        char *end;
        out[i] = strtod(*at, &end);
        if (end == *at) {
            return false;
        }
        *at = end;
    }
    return **at == '\0';
}

/* Bitwise equality of result rows; NAN equals NAN. */
static bool same(const double *a, const double *b, int count) {
    for (int i = 0; i < count; i++) {
        if (a[i] != b[i] && !(isnan(a[i]) && isnan(b[i]))) {
            return false;
        }
    }
    return true;
}

/* One line of a shard file: the row of a run, or of its series. */
typedef struct shard_row {
    char kind; /* 'R' done, 'F' failed, 'S' series */
    int64_t run;
    double wall_s, cpu_s;
    double values[BST_STUDY_METRICS]; /* R: metrics; S: columns of the series */
    char *error;                      /* F: points into the line, still escaped */
} shard_row;

/* Parses a line of a shard file. False: not a row of this study's kind. */
static bool read_row(const bst_results *r, char *line, shard_row *out) {
    char *at = line + 1, *end;
    out->kind = line[0];
    if (line[0] == 'S') {
        return r->kind->series_count > 0 && read_numbers(&at, r->kind->series_count, out->values);
    }
    if (line[0] != 'R' && line[0] != 'F') {
        return false;
    }
    out->run = strtoll(line + 1, &at, 10);
    if (at == line + 1 || out->run < 0 || out->run >= r->study->runs) {
        return false;
    }
    out->wall_s = strtod(at, &end);
    if (end == at) {
        return false;
    }
    at = end;
    out->cpu_s = strtod(at, &end);
    if (end == at) {
        return false;
    }
    out->error = end + 1;
    return line[0] == 'F' ? *end == ' ' : read_numbers(&end, r->kind->metric_count, out->values);
}

/* Adds a series row of the latest run. */
static bst_status take_series(bst_ctx *ctx, bst_results *r, const shard_row *row) {
    size_t columns = (size_t)r->kind->series_count;
    if (r->series_rows == r->series_room) {
        size_t room = 2 * r->series_room + 256;
        double *grown = realloc(r->series, room * columns * sizeof *grown);
        if (!grown) {
            return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the rows of runs");
        }
        r->series = grown;
        r->series_room = room;
    }
    memcpy(r->series + r->series_rows * columns, row->values, columns * sizeof *r->series);
    r->series_rows++;
    r->parts[r->part_count - 1].rows++;
    return BST_OK;
}

/* Adds the row of a run without row, with its error or series. */
static bst_status take_run(bst_ctx *ctx, bst_results *r, const shard_row *row) {
    int metrics = r->kind->metric_count;
    bool failed = row->kind == 'F';
    if (failed) {
        BST_TRY(grow(ctx, (void **)&r->errors, r->error_count, &r->error_room, sizeof *r->errors));
        char *text = strdup(row->error);
        if (!text) {
            return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the rows of runs");
        }
        for (char *c = text; *c; c++) {
            *c = *c == '\x1f' ? '\n' : *c;
        }
        r->errors[r->error_count++] = (bst_study_row_error){row->run, text};
    } else if (r->kind->series_count > 0) {
        BST_TRY(grow(ctx, (void **)&r->parts, r->part_count, &r->part_room, sizeof *r->parts));
        r->parts[r->part_count++] = (bst_study_series_part){row->run, r->series_rows, 0};
    }
    r->wall_s[row->run] = row->wall_s;
    r->cpu_s[row->run] = row->cpu_s;
    r->state[row->run] = failed ? BST_ROW_FAILED : BST_ROW_DONE;
    r->done++;
    r->failed += failed;
    for (int m = 0; m < metrics; m++) {
        r->metrics[row->run * metrics + m] = failed ? NAN : row->values[m];
    }
    return BST_OK;
}

/* Adds the rows of a verified shard file. */
static bst_status take_rows(bst_ctx *ctx, bst_results *r, char *text, const char *end) {
    int metrics = r->kind->metric_count;
    bool skip = false;
    shard_row row = {.run = -1};
    for (char *line = text; line < end && read_row(r, line, &row); line += strlen(line) + 1) {
        if (row.kind == 'S') {
            BST_TRY(skip ? BST_OK : take_series(ctx, r, &row));
            continue;
        }
        bool failed = row.kind == 'F';
        skip = r->state[row.run] != BST_ROW_MISSING;
        if (skip) {
            r->doubled++;
            r->differing += (r->state[row.run] == BST_ROW_FAILED) != failed ||
                            (!failed && !same(row.values, r->metrics + row.run * metrics, metrics));
        } else {
            BST_TRY(take_run(ctx, r, &row));
        }
    }
    return BST_OK;
}

static bst_status damaged(bst_ctx *ctx, const char *path) {
    return bst_fail(ctx, BST_ERR_FORMAT, "%s: is damaged", path);
}

/* Run range in the name of a shard file; false: another name. */
static bool runs_of_name(const char *path, int64_t *from, int64_t *to) {
    const char *slash = strrchr(path, '/'), *name = slash ? slash + 1 : path;
    int end = 0;
    return sscanf(name, "%" SCNd64 "-%" SCNd64 ".rows%n", from, to, &end) == 2 && end &&
           !name[end] && *from >= 0 && *to >= *from;
}

/* Checks that the rows of a shard are those of the runs in its name, in order. */
static bst_status check_runs(bst_ctx *ctx, const char *path, const char *text) {
    int64_t from, to, next;
    if (!runs_of_name(path, &from, &to)) {
        return BST_OK;
    }
    next = from;
    for (const char *line = text; line; line = strchr(line, '\n')) {
        line += *line == '\n';
        if (*line != 'R' && *line != 'F') {
            continue;
        }
        int64_t run = strtoll(line + 1, NULL, 10);
        if (run != next || run > to) {
            return bst_fail(ctx, BST_ERR_FORMAT,
                            "%s: holds a row of run %" PRId64 " (expected: run %" PRId64 ")", path,
                            run, next);
        }
        next++;
    }
    return next == to + 1 ? BST_OK
                          : bst_fail(ctx, BST_ERR_FORMAT,
                                     "%s: ends before run %" PRId64 " of %" PRId64, path, next, to);
}

/* Terminates the line at *text and advances to the next; NULL at the end. */
static char *next_line(char **text) {
    char *line = *text, *end = line ? strchr(line, '\n') : NULL;
    if (!end) {
        return NULL;
    }
    *end = '\0';
    *text = end + 1;
    return line;
}

/* Checks that all lines up to `end` are rows, `count` of them of runs, with series only after
 * successful runs. Terminates the lines. */
static bool are_rows(const bst_results *r, char *text, const char *end, int64_t count) {
    int64_t seen = 0;
    shard_row row = {.run = -1};
    bool has_series = false;
    for (char *line; text < end && (line = next_line(&text));) {
        if (!read_row(r, line, &row) || (row.kind == 'S' && !has_series)) {
            return false;
        }
        has_series = row.kind == 'S' || row.kind == 'R';
        seen += row.kind != 'S';
    }
    return text == end && seen == count;
}

static bst_status take_text(bst_ctx *ctx, bst_results *r, const char *path, char *text,
                            size_t bytes) {
    char *last = text + bytes;
    if (bytes < 32 || last[-1] != '\n') {
        return damaged(ctx, path);
    }
    last--;
    while (last > text && last[-1] != '\n') {
        last--;
    }
    int64_t count = 0;
    uint64_t sum = 0;
    if (sscanf(last, "end %" SCNd64 " %" SCNx64, &count, &sum) != 2 ||
        sum != checksum(text, (size_t)(last - text))) {
        return damaged(ctx, path);
    }
    *last = '\0';
    char expected[80];
    snprintf(expected, sizeof expected, "study %s %s", r->study->digest, r->kind->name);
    char *line = next_line(&text);
    if (!line || strcmp(line, "boresight shard 2") != 0) {
        return damaged(ctx, path);
    }
    line = next_line(&text);
    if (!line || strcmp(line, expected) != 0) {
        return bst_fail(ctx, BST_ERR_STATE, "%s: belongs to another study", path);
    }
    if (!next_line(&text) || !next_line(&text)) {
        return damaged(ctx, path);
    }
    BST_TRY(check_runs(ctx, path, text));
    /* a file with any fault is rejected completely: its other rows may be wrong too */
    return are_rows(r, text, last, count) ? take_rows(ctx, r, text, last) : damaged(ctx, path);
}

bst_status bst_results_load(bst_ctx *ctx, bst_results *r, const char *path) {
    char *text;
    size_t bytes;
    BST_TRY(bst_file_read(ctx, path, MOST_BYTES, "the rows of a shard", &text, &bytes));
    bst_status status = take_text(ctx, r, path, text, bytes);
    free(text);
    return status;
}

static int compare_names(const void *a, const void *b) {
    return strcmp(*(char *const *)a, *(char *const *)b);
}

void bst_results_reject(bst_ctx *ctx, const char *path, const char *why) {
    char aside[4700];
    int n = snprintf(aside, sizeof aside, "%s.rejected", path);
    if (n > 0 && (size_t)n < sizeof aside && rename(path, aside) == 0) {
        bst_log(ctx, BST_LOG_WARNING, "%s; its runs are made again, and it is now %s", why, aside);
    } else {
        unlink(path);
        bst_log(ctx, BST_LOG_WARNING, "%s; its runs are made again", why);
    }
}

/* Checks for a dangling link, folder or pipe with the name of a shard file. */
static bool is_no_file(const char *path) {
    struct stat info;
    return lstat(path, &info) == 0 && (stat(path, &info) != 0 || !S_ISREG(info.st_mode));
}

/* Loads a shard file by its name in the folder. */
static bst_status load_name(bst_ctx *ctx, bst_results *r, const char *folder, const char *name,
                            int64_t first, int64_t count, bool clean) {
    int64_t from, to;
    char path[4600];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    if (strstr(name, ".rows.tmp.")) {
        if (clean) {
            unlink(path);
        }
        return BST_OK;
    }
    if (!runs_of_name(name, &from, &to) || from >= first + count || to < first) {
        return BST_OK;
    }
    bst_ctx quiet = {0};
    bst_status status = bst_results_load(&quiet, r, path);
    if (clean && (status == BST_ERR_FORMAT || (status != BST_OK && is_no_file(path)))) {
        bst_results_reject(ctx, path, quiet.message);
        return BST_OK;
    }
    return status == BST_OK || status == BST_ERR_FORMAT || status == BST_ERR_NOT_FOUND
               ? BST_OK
               : bst_fail(ctx, status, "%s", quiet.message);
}

bst_status bst_results_load_folder(bst_ctx *ctx, bst_results *r, const char *out, int64_t first,
                                   int64_t count, bool clean) {
    char folder[4096];
    snprintf(folder, sizeof folder, "%s/shards", out);
    DIR *dir = opendir(folder);
    if (!dir) {
        return errno == ENOENT ? BST_OK
                               : bst_fail(ctx, BST_ERR_IO, "%s: %s", folder, strerror(errno));
    }
    char **names = NULL;
    int64_t n = 0, room = 0;
    bst_status status = BST_OK;
    for (struct dirent *entry; status == BST_OK && (entry = readdir(dir));) {
        if (!strstr(entry->d_name, ".rows")) {
            continue;
        }
        status = grow(ctx, (void **)&names, n, &room, sizeof *names);
        if (status == BST_OK && (names[n] = strdup(entry->d_name))) {
            n++;
        }
    }
    closedir(dir);
    if (n > 1) {
        qsort(names, (size_t)n, sizeof *names, compare_names);
    }
    for (int64_t i = 0; i < n; i++) {
        if (status == BST_OK) {
            status = load_name(ctx, r, folder, names[i], first, count, clean);
        }
        free(names[i]);
    }
    free(names);
    return status;
}
