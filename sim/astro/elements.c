#include "sim/astro/elements.h"

#include <stdlib.h>
#include <string.h>

#include "sim/astro/elements_internal.h"
#include "sim/astro/tle.h"
#include "sim/core/file.h"

#define MAX_FILE_BYTES ((uint64_t)256 << 20)

typedef enum form { FORM_LINES, FORM_JSON, FORM_CSV, FORM_OTHER } form;

static bool starts_with(const bst_text_line *line, const char *text) {
    size_t length = strlen(text);
    return line->length >= length && memcmp(line->text, text, length) == 0;
}

/* Detects the format of an element-set file from its first non-empty line. */
static form recognise(const char *data, size_t bytes, bst_text_line *line) {
    bst_text_cursor cursor = bst_text_start(data, bytes);
    while (bst_text_next_line(&cursor, line)) {
        bst_text_span s = bst_text_trimmed((bst_text_span){line->text, line->length});
        if (s.length == 0 || s.text[0] == '#') {
            continue;
        }
        if (s.text[0] == '{' || s.text[0] == '[') {
            return FORM_JSON;
        }
        if (s.text[0] == '<' || starts_with(line, "CCSDS_")) {
            return FORM_OTHER;
        }
        /* a CSV header row contains one of these column names */
        while (s.length > 0) {
            const char *comma = memchr(s.text, ',', s.length);
            size_t length = comma ? (size_t)(comma - s.text) : s.length;
            bst_text_span column = bst_text_trimmed((bst_text_span){s.text, length});
            if (column.length > 1 && column.text[0] == '"') {
                column = (bst_text_span){column.text + 1, column.length - 2};
            }
            if (bst_text_is(column, "EPOCH") || bst_text_is(column, "NORAD_CAT_ID")) {
                return FORM_CSV;
            }
            s = comma ? (bst_text_span){comma + 1, s.length - length - 1} : (bst_text_span){0};
        }
        return FORM_LINES;
    }
    return FORM_LINES;
}

bst_status bst_elements_read_buffer(bst_ctx *ctx, const char *name, const char *data, size_t bytes,
                                    const bst_elements_options *options, bst_elements **out,
                                    int *count) {
    *out = NULL;
    *count = 0;
    BST_TRY(bst_file_check_text(ctx, name, data, bytes));
    bst_elements_reader reader = bst_elements_start(ctx, name, options);
    bst_text_line line;
    switch (recognise(data, bytes, &line)) {
        case FORM_JSON:
            return bst_elements_finish(&reader, bst_astro_omm_read_json(&reader, data, bytes),
                                       false, "orbit mean-elements messages", out, count);
        case FORM_CSV:
            return bst_elements_finish(&reader, bst_astro_omm_read_csv(&reader, data, bytes), false,
                                       "rows of orbit mean-elements messages", out, count);
        case FORM_OTHER:
            return bst_text_fail_at(&reader.source, &line,
                                    "the file is in a form that is not read here", line.text,
                                    line.length, "two-line element sets, or OMM as JSON or CSV");
        default:
            return bst_tle_read_buffer(ctx, name, data, bytes, options, out, count);
    }
}

bst_status bst_elements_load(bst_ctx *ctx, const char *path, const bst_elements_options *options,
                             bst_elements **out, int *count) {
    *out = NULL;
    *count = 0;
    char *data;
    size_t bytes;
    BST_TRY(bst_file_read(ctx, path, MAX_FILE_BYTES,
                          "a file of element sets (TLE, or OMM as JSON or CSV)", &data, &bytes));
    bst_status status = bst_elements_read_buffer(ctx, path, data, bytes, options, out, count);
    free(data);
    return status;
}
