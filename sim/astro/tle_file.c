/* Element-set files: lines to sets. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sim/astro/tle_internal.h"
#include "sim/core/file.h"

#define MAX_FILE_BYTES ((uint64_t)256 << 20)

typedef struct reader {
    bst_tle_source source;
    bst_elements *sets;
    int count, capacity;
    int skipped; /* bad sets */
    int others;  /* sets of other satellites than the one asked for */
} reader;

static bst_status append(reader *r, const bst_elements *set) {
    if (r->count == r->capacity) {
        int capacity = r->capacity ? 2 * r->capacity : 16;
        bst_elements *sets = realloc(r->sets, (size_t)capacity * sizeof *sets);
        if (!sets) {
            return bst_fail(r->source.ctx, BST_ERR_MEMORY, "%.400s: no memory for %d element sets",
                            r->source.name, capacity);
        }
        r->sets = sets;
        r->capacity = capacity;
    }
    r->sets[r->count++] = *set;
    return BST_OK;
}

/* A format error stops reading, or is logged and counted where the caller asked for that. */
static bst_status tolerate(reader *r, const bst_tle_options *options, bst_status status) {
    if (status == BST_ERR_FORMAT && options->skip_bad_sets) {
        r->skipped++;
        bst_log(r->source.ctx, BST_LOG_WARNING, "%s; element set left out",
                r->source.ctx ? r->source.ctx->message : "");
        if (r->source.ctx) {
            r->source.ctx->message[0] = '\0';
        }
        return BST_OK;
    }
    return status;
}

static bst_status read_set(reader *r, const bst_tle_options *options, const bst_tle_line *name,
                           const bst_tle_line *line1, const bst_tle_line *line2) {
    int number;
    if (options->norad != 0 && line1->length >= 7 &&
        bst_tle_decode_number(line1->text + 2, &number) && number != options->norad) {
        r->others++;
        return BST_OK;
    }
    bst_elements set;
    BST_TRY(bst_tle_parse_set(&r->source, line1, line2, &set));
    if (name->text) {
        for (size_t i = 0; i < name->length; i++) {
            unsigned char c = (unsigned char)name->text[i];
            if (c < 0x20 || c >= 0x7f) {
                return bst_tle_fail_at(&r->source, name,
                                       "name has a character that is not printable ASCII",
                                       name->text, name->length, "a plain ASCII name");
            }
        }
        bool prefixed = name->length >= 2 && name->text[0] == '0' && name->text[1] == ' ';
        size_t skip = prefixed ? 2 : 0;
        bst_tle_copy_trimmed(name->text + skip, name->length - skip, set.name, sizeof set.name);
    }
    return append(r, &set);
}

/* Walks over the lines; `name` and `line1` wait for what must follow them. */
static bst_status read_lines(reader *r, const char *data, size_t bytes,
                             const bst_tle_options *options) {
    const bst_tle_line none = {NULL, 0, 0};
    bst_tle_line name = none, line1 = none, line = none;
    const char *next = data, *end = data + bytes;
    if (bytes >= 3 && memcmp(data, "\xEF\xBB\xBF", 3) == 0) {
        next += 3;
    }
    int number = 0;
    while (next < end) {
        const char *stop = memchr(next, '\n', (size_t)(end - next));
        stop = stop ? stop : end;
        line = (bst_tle_line){next, (size_t)(stop - next), ++number};
        next = stop < end ? stop + 1 : end;
        bst_tle_trim_end(&line);
        if (line.length == 0 || line.text[0] == '#') {
            continue;
        }
        bool blank_second = line.length >= 2 && line.text[1] == ' ';
        bool is_line1 = blank_second && line.text[0] == '1';
        bool is_line2 = blank_second && line.text[0] == '2';
        if (line1.text && !is_line2) {
            BST_TRY(
                tolerate(r, options,
                         bst_tle_fail_at(&r->source, &line, "element set has no line 2", line.text,
                                         line.length, "a line that starts with \"2 \"")));
            line1 = name = none;
        }
        if (is_line2) {
            if (line1.text) {
                BST_TRY(tolerate(r, options, read_set(r, options, &name, &line1, &line)));
            } else {
                BST_TRY(tolerate(
                    r, options,
                    bst_tle_fail_at(&r->source, &line, "element set has no line 1", line.text,
                                    line.length, "a line that starts with \"1 \" before it")));
            }
            line1 = name = none;
        } else if (is_line1) {
            line1 = line;
        } else {
            if (name.text) {
                BST_TRY(tolerate(
                    r, options,
                    bst_tle_fail_at(&r->source, &line,
                                    "no element set follows the name before this line", line.text,
                                    line.length, "a line that starts with \"1 \"")));
            }
            name = line;
        }
    }
    if (line1.text || name.text) {
        const bst_tle_line *last = line1.text ? &line1 : &name;
        return tolerate(r, options,
                        bst_tle_fail_at(&r->source, last, "the file ends within an element set",
                                        last->text, last->length,
                                        line1.text ? "a line that starts with \"2 \" after it"
                                                   : "a line that starts with \"1 \" after it"));
    }
    return BST_OK;
}

bst_status bst_tle_read_buffer(bst_ctx *ctx, const char *name, const char *data, size_t bytes,
                               const bst_tle_options *options, bst_elements **out, int *count) {
    const bst_tle_options defaults = {0};
    options = options ? options : &defaults;
    *out = NULL;
    *count = 0;
    reader r = {.source = {ctx, name}};
    bst_status status = bst_file_check_text(ctx, name, data, bytes);
    if (status == BST_OK && bytes > 0) {
        status = read_lines(&r, data, bytes, options);
    }
    if (status == BST_OK && r.count == 0) {
        if (bytes == 0) {
            status = bst_fail(ctx, BST_ERR_FORMAT,
                              "%.400s:1: the file is empty (expected two-line element sets)", name);
        } else if (r.others > 0) {
            status = bst_fail(ctx, BST_ERR_NOT_FOUND,
                              "%.400s: no element set of satellite %d, only %d of others", name,
                              options->norad, r.others);
        } else {
            status = bst_fail(ctx, BST_ERR_FORMAT,
                              "%.400s:1: the file holds no element set that can be used (%d bad "
                              "ones left out; expected two-line element sets)",
                              name, r.skipped);
        }
    }
    if (status != BST_OK) {
        free(r.sets);
        return status;
    }
    *out = r.sets;
    *count = r.count;
    return BST_OK;
}

bst_status bst_tle_load(bst_ctx *ctx, const char *path, const bst_tle_options *options,
                        bst_elements **out, int *count) {
    *out = NULL;
    *count = 0;
    char *data;
    size_t bytes;
    BST_TRY(
        bst_file_read(ctx, path, MAX_FILE_BYTES, "a file of two-line element sets", &data, &bytes));
    bst_status status = bst_tle_read_buffer(ctx, path, data, bytes, options, out, count);
    free(data);
    return status;
}
