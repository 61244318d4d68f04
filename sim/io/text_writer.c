#include <inttypes.h>
#include <string.h>

#include "sim/io/text_writer_internal.h"

void bst_text_utc(bst_time t, char text[BST_TIME_TEXT_BYTES]) {
    bst_time_to_utc(t, 9, text, BST_TIME_TEXT_BYTES);
    size_t length = strcspn(text, "Z"), point = strcspn(text, ".");
    while (length > point + 4 && text[length - 1] == '0') {
        length--;
    }
    text[length] = '\0';
}

static void write_printable(FILE *stream, const char *text, size_t length) {
    for (size_t i = 0; i < length; i++) {
        unsigned char c = (unsigned char)text[i];
        fputc(c >= 0x20 && c < 0x7f ? c : '_', stream);
    }
}

void bst_io_kvn_write(FILE *stream, const char *key, const char *value) {
    fprintf(stream, "%s = ", key);
    write_printable(stream, value, strlen(value));
    fputc('\n', stream);
}

void bst_io_kvn_comment(FILE *stream, const char *text) {
    while (text && *text) {
        size_t length = strcspn(text, "\n");
        fputs("COMMENT ", stream);
        write_printable(stream, text, length);
        fputc('\n', stream);
        text += length + (text[length] == '\n');
    }
}

bst_status bst_text_stream_ok(bst_ctx *ctx, FILE *stream) {
    return ferror(stream) ? bst_fail(ctx, BST_ERR_IO, "writing failed; is the disk full?") : BST_OK;
}

bst_status bst_text_rising(bst_ctx *ctx, const char *what, int64_t row, bst_time before,
                           bst_time after) {
    if (bst_time_diff(after, before) > 0.0) {
        return BST_OK;
    }
    char text[BST_TIME_TEXT_BYTES];
    bst_text_utc(after, text);
    return bst_fail(ctx, BST_ERR_ARGUMENT,
                    "%.200s: row %" PRId64 " at %s is not later than the one before it", what, row,
                    text);
}
