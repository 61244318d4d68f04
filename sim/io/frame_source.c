#include "sim/io/frame_source.h"

#include <assert.h>
#include <fcntl.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "sim/core/text.h"

struct bst_frame_source {
    bst_frame_source_options options;
    char path[4096];
    bst_fits_source *fits;
    bst_side_table *table;
    bst_image_file *image; /* a picture, or that of the table's selected row */
    int64_t *pages;        /* [rows] of the table: page of each, from 0 */
    int64_t selected;
    bst_frame_place place;
};

const char *bst_frame_where(const char *path, const bst_frame_place *p,
                            char text[BST_FRAME_WHERE_TEXT]) {
    char part[64] = "";
    if (p->line > 0) {
        snprintf(part, sizeof part, ": line %" PRId64, p->line);
    } else if (p->plane >= 0) {
        snprintf(part, sizeof part, ": HDU %d, plane %" PRId64, p->hdu, p->plane + 1);
    } else if (p->hdu > 0) {
        snprintf(part, sizeof part, ": HDU %d", p->hdu);
    } else if (p->page > 0) {
        snprintf(part, sizeof part, ": page %" PRId64, p->page);
    }
    snprintf(text, BST_FRAME_WHERE_TEXT, "%.500s%s", path, part);
    return text;
}

/* A row of a table, in the order of its picture. */
typedef struct picture_row {
    const char *file;
    int64_t row, page, line;
} picture_row;

static int by_file(const void *a, const void *b) {
    const picture_row *p = a, *q = b;
    int order = strcmp(p->file, q->file);
    order = order != 0 ? order : (p->page > q->page) - (p->page < q->page);
    return order != 0 ? order : (p->row > q->row) - (p->row < q->row);
}

/* Fails at a column of a row. */
static bst_status fail_row(bst_ctx *ctx, const bst_frame_source *s, const picture_row *r,
                           const char *column, const char *what) {
    return bst_fail(ctx, BST_ERR_FORMAT, "%.400s: line %" PRId64 ": column %.80s: %s", s->path,
                    r->line, column, what);
}

/* Gives each row of one picture its page. rows: [count], of one file, by page, then row */
static bst_status assign_pages(bst_ctx *ctx, bst_frame_source *s, const picture_row *rows,
                               int64_t count) {
    const char *file = bst_side_table_file_column(s->table);
    const char *column = bst_side_table_page_column(s->table);
    char what[400];
    bst_image_file *image;
    bst_status status = bst_image_file_open(ctx, rows[0].file, s->options.colour, &image);
    if (status != BST_OK) {
        return bst_fail_prefix(ctx, status, "%.400s: line %" PRId64 ": column %.80s", s->path,
                               rows[0].line, file);
    }
    int64_t pages = bst_image_file_pages(image);
    bst_image_file_close(image);
    for (int64_t i = 0; i < count; i++) {
        int64_t page = *column ? rows[i].page : i + 1;
        bool twice = i > 0 && (pages == 1 || (*column && page == rows[i - 1].page));
        if (twice) {
            snprintf(what, sizeof what,
                     "%.200s is in line %" PRId64 ", too (allowed: a row a frame)", rows[i].file,
                     rows[i - 1].line);
            return fail_row(ctx, s, &rows[i], file, what);
        }
        if (page > pages || (!*column && pages > 1 && count != pages)) {
            snprintf(what, sizeof what,
                     "%.200s has %" PRId64
                     " pages, %s (allowed: a row for each page in their "
                     "order, or a column `page`)",
                     rows[i].file, pages, *column ? "fewer than this" : "not as many as rows");
            return fail_row(ctx, s, &rows[i], *column ? column : file, what);
        }
        s->pages[rows[i].row] = page - 1;
    }
    return BST_OK;
}

/* Finds the pages of all rows, which opens each picture once. */
static bst_status find_pages(bst_ctx *ctx, bst_frame_source *s) {
    int64_t count = bst_side_table_count(s->table);
    picture_row *rows = calloc((size_t)count, sizeof *rows);
    s->pages = calloc((size_t)count, sizeof *s->pages);
    if (!rows || !s->pages) {
        free(rows);
        return bst_fail(ctx, BST_ERR_MEMORY, "%.400s: no memory for %" PRId64 " rows", s->path,
                        count);
    }
    for (int64_t i = 0; i < count; i++) {
        bst_side_table_row r = bst_side_table_at(s->table, i);
        rows[i] = (picture_row){r.file, i, r.page, r.line};
    }
    qsort(rows, (size_t)count, sizeof *rows, by_file);
    bst_status status = BST_OK;
    for (int64_t i = 0, end; i < count && status == BST_OK; i = end) {
        for (end = i + 1; end < count && strcmp(rows[end].file, rows[i].file) == 0;) {
            end++;
        }
        status = assign_pages(ctx, s, rows + i, end - i);
    }
    free(rows);
    return status;
}

/* True if a file begins as a picture does. */
static bool is_picture(const char *path) {
    char begins[8];
    int fd = open(path, O_RDONLY | O_NONBLOCK | O_CLOEXEC);
    ssize_t n = fd >= 0 ? read(fd, begins, sizeof begins) : -1;
    if (fd >= 0) {
        close(fd);
    }
    return n > 0 && bst_image_file_begins(begins, (size_t)n);
}

static bst_status open_kind(bst_ctx *ctx, bst_frame_source *s) {
    if (bst_text_ends_in(s->path, ".csv")) {
        BST_TRY(bst_side_table_open(ctx, s->path, &s->options.columns, &s->table));
        return find_pages(ctx, s);
    }
    bool named = bst_text_ends_in(s->path, ".png") || bst_text_ends_in(s->path, ".tif") ||
                 bst_text_ends_in(s->path, ".tiff");
    return named || is_picture(s->path)
               ? bst_image_file_open(ctx, s->path, s->options.colour, &s->image)
               : bst_fits_source_open(ctx, s->path, &s->fits);
}

bst_status bst_frame_source_open(bst_ctx *ctx, const char *path,
                                 const bst_frame_source_options *options, bst_frame_source **out) {
    assert(path && out);
    *out = NULL;
    bst_frame_source *s = calloc(1, sizeof *s);
    if (!s) {
        return bst_fail(ctx, BST_ERR_MEMORY, "%.400s: no memory to open it", path);
    }
    s->selected = -1;
    s->options = options ? *options
                         : (bst_frame_source_options){
                               .columns = {BST_FRAME_FILE_COLUMNS, BST_FRAME_PAGE_COLUMNS}};
    int n = snprintf(s->path, sizeof s->path, "%s", path);
    bst_status status =
        n < 0 || (size_t)n >= sizeof s->path
            ? bst_fail(ctx, BST_ERR_ARGUMENT, "%.80s...: the path is too long", path)
            : open_kind(ctx, s);
    if (status != BST_OK) {
        bst_frame_source_close(s);
        return status;
    }
    *out = s;
    return BST_OK;
}

void bst_frame_source_close(bst_frame_source *s) {
    if (s) {
        bst_fits_source_close(s->fits);
        bst_image_file_close(s->image);
        bst_side_table_close(s->table);
        free(s->pages);
        free(s);
    }
}

const char *bst_frame_source_path(const bst_frame_source *s) {
    return s->path;
}

int64_t bst_frame_source_count(const bst_frame_source *s) {
    return s->fits    ? bst_fits_source_count(s->fits)
           : s->table ? bst_side_table_count(s->table)
                      : bst_image_file_pages(s->image);
}

const char *bst_frame_source_picture(const bst_frame_source *s) {
    return s->table && s->image ? bst_image_file_path(s->image) : s->path;
}

const char *bst_frame_source_noun(const bst_frame_source *s) {
    return s->table ? "column " : "";
}

/* Fails in the picture of a row. */
static bst_status in_row(bst_ctx *ctx, const bst_frame_source *s, int64_t line, bst_status status) {
    return status == BST_OK || !s->table
               ? status
               : bst_fail_prefix(ctx, status, "%.400s: line %" PRId64, s->path, line);
}

/* Selects a page of the open picture. */
static bst_status select_page(bst_ctx *ctx, bst_frame_source *s, int64_t page,
                              bst_frame_place *out) {
    BST_TRY(bst_image_file_select(ctx, s->image, page, &out->width, &out->height));
    out->page = bst_image_file_pages(s->image) > 1 ? page + 1 : 0;
    return BST_OK;
}

/* Opens the picture of a row unless it is open. */
static bst_status select_row(bst_ctx *ctx, bst_frame_source *s, int64_t index,
                             bst_frame_place *out) {
    bst_side_table_row r = bst_side_table_at(s->table, index);
    out->line = r.line;
    bst_status status = BST_OK;
    if (!s->image || strcmp(bst_image_file_path(s->image), r.file) != 0) {
        bst_image_file_close(s->image);
        s->image = NULL;
        status = bst_image_file_open(ctx, r.file, s->options.colour, &s->image);
    }
    status = status == BST_OK ? select_page(ctx, s, s->pages[index], out) : status;
    return in_row(ctx, s, r.line, status);
}

bst_status bst_frame_source_select(bst_ctx *ctx, bst_frame_source *s, int64_t index,
                                   bst_frame_place *out) {
    assert(s && out);
    bst_frame_place place = {.plane = -1};
    if (index < 0 || index >= bst_frame_source_count(s)) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "%.400s: has no frame %" PRId64 "; it has %" PRId64,
                        s->path, index, bst_frame_source_count(s));
    }
    if (s->fits) {
        bst_fits_source_frame f;
        BST_TRY(bst_fits_source_select(ctx, s->fits, index, &f));
        place =
            (bst_frame_place){.hdu = f.hdu, .plane = f.plane, .width = f.width, .height = f.height};
    } else {
        BST_TRY(s->table ? select_row(ctx, s, index, &place) : select_page(ctx, s, index, &place));
    }
    s->selected = index;
    s->place = *out = place;
    return BST_OK;
}

bool bst_frame_source_text(bst_frame_source *s, const char *keyword,
                           char value[BST_FITS_SOURCE_TEXT]) {
    return s->fits    ? bst_fits_source_text(s->fits, keyword, value)
           : s->table ? s->selected >= 0 && bst_side_table_text(s->table, s->selected, keyword,
                                                                value, BST_FITS_SOURCE_TEXT)
                      : false;
}

bst_status bst_frame_source_pixels(bst_ctx *ctx, bst_frame_source *s, float *pixels) {
    assert(s && s->selected >= 0 && pixels);
    return s->fits ? bst_fits_source_pixels(ctx, s->fits, pixels)
                   : in_row(ctx, s, s->place.line, bst_image_file_pixels(ctx, s->image, pixels));
}
