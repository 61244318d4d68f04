/* Reads files of two-line element sets. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sim/astro/elements_internal.h"
#include "sim/astro/tle_internal.h"
#include "sim/core/file.h"

#define MAX_FILE_BYTES ((uint64_t)256 << 20)

static bst_status read_set(bst_elements_reader *r, const bst_text_line *name,
                           const bst_text_line *line1, const bst_text_line *line2) {
    int number;
    if (r->options.norad != 0 && line1->length >= 7 &&
        bst_tle_decode_number(line1->text + 2, &number) && number != r->options.norad) {
        r->others++;
        return BST_OK;
    }
    bst_elements set;
    BST_TRY(bst_tle_parse_set(&r->source, line1, line2, &set));
    if (name->text) {
        if (!bst_text_is_plain((bst_text_span){name->text, name->length})) {
            return bst_text_fail_at(&r->source, name,
                                    "name has a character that is not printable ASCII", name->text,
                                    name->length, "a plain ASCII name");
        }
        bool prefixed = name->length >= 2 && name->text[0] == '0' && name->text[1] == ' ';
        size_t skip = prefixed ? 2 : 0;
        bst_text_copy((bst_text_span){name->text + skip, name->length - skip}, set.name,
                      sizeof set.name);
    }
    return bst_elements_append(r, &set);
}

/* Processes the lines; `name` and `line1` wait for the following lines. */
static bst_status read_lines(bst_elements_reader *r, const char *data, size_t bytes) {
    const bst_text_line none = {NULL, 0, 0};
    bst_text_line name = none, line1 = none, line = none;
    bst_text_cursor cursor = bst_text_start(data, bytes);
    while (bst_text_next_line(&cursor, &line)) {
        if (line.length == 0 || line.text[0] == '#') {
            continue;
        }
        bool blank_second = line.length >= 2 && line.text[1] == ' ';
        bool is_line1 = blank_second && line.text[0] == '1';
        bool is_line2 = blank_second && line.text[0] == '2';
        if (line1.text && !is_line2) {
            BST_TRY(bst_elements_tolerate(
                r, bst_text_fail_at(&r->source, &line, "element set has no line 2", line.text,
                                    line.length, "a line that starts with \"2 \"")));
            line1 = name = none;
        }
        if (is_line2) {
            if (line1.text) {
                BST_TRY(bst_elements_tolerate(r, read_set(r, &name, &line1, &line)));
            } else {
                BST_TRY(bst_elements_tolerate(
                    r, bst_text_fail_at(&r->source, &line, "element set has no line 1", line.text,
                                        line.length, "a line that starts with \"1 \" before it")));
            }
            line1 = name = none;
        } else if (is_line1) {
            line1 = line;
        } else {
            if (name.text) {
                BST_TRY(bst_elements_tolerate(
                    r, bst_text_fail_at(&r->source, &line,
                                        "no element set follows the name before this line",
                                        line.text, line.length, "a line that starts with \"1 \"")));
            }
            name = line;
        }
    }
    if (line1.text || name.text) {
        const bst_text_line *last = line1.text ? &line1 : &name;
        return bst_elements_tolerate(
            r, bst_text_fail_at(&r->source, last, "the file ends within an element set", last->text,
                                last->length,
                                line1.text ? "a line that starts with \"2 \" after it"
                                           : "a line that starts with \"1 \" after it"));
    }
    return BST_OK;
}

bst_status bst_tle_read_buffer(bst_ctx *ctx, const char *name, const char *data, size_t bytes,
                               const bst_tle_options *options, bst_elements **out, int *count) {
    *out = NULL;
    *count = 0;
    BST_TRY(bst_file_check_text(ctx, name, data, bytes));
    bst_elements_reader reader = bst_elements_start(ctx, name, options);
    bst_status status = bytes > 0 ? read_lines(&reader, data, bytes) : BST_OK;
    return bst_elements_finish(&reader, status, bytes == 0, "two-line element sets", out, count);
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
