#include "view/page_bundle.h"

#include <stdlib.h>
#include <string.h>
#include <zlib.h>

#include "sim/io/html.h"
#include "view/page_modules.h"

/* Style sheets go into one element, those of panels behind that of the page, as where they are
 * loaded. */
static void write_styles(FILE *out, const char *nonce) {
    const bst_view_page_file *first = bst_view_page_find("style.css");
    fprintf(out, "<style nonce=\"%s\">\n", nonce);
    fwrite(first->data, 1, first->bytes, out);
    for (const bst_view_page_file *file = bst_view_page_files; file->name; file++) {
        if (strstr(file->name, ".css") && file != first) {
            fwrite(file->data, 1, file->bytes, out);
        }
    }
    fputs("</style>\n", out);
}

/* Writes a line with the address of the icon as data. */
static void write_line(FILE *out, const char *line, size_t bytes) {
    static const char icon[] = "icon.svg";
    for (size_t k = 0; k < bytes;) {
        if (bytes - k >= sizeof icon - 1 && memcmp(line + k, icon, sizeof icon - 1) == 0) {
            const bst_view_page_file *file = bst_view_page_find(icon);
            fputs("data:image/svg+xml;base64,", out);
            bst_html_base64(out, file->data, file->bytes);
            k += sizeof icon - 1;
        } else {
            fputc(line[k++], out);
        }
    }
}

static bool begins(const char *line, size_t bytes, const char *with) {
    const size_t n = strlen(with);
    return bytes >= n && memcmp(line, with, n) == 0;
}

bst_status bst_view_bundle_begin(bst_ctx *ctx, FILE *out, const char *nonce) {
    const bst_view_page_file *page = bst_view_page_find("index.html");
    const char *line = page->data, *end = page->data + page->bytes;
    while (line < end) {
        const char *next = memchr(line, '\n', (size_t)(end - line));
        const size_t bytes = (size_t)((next ? next + 1 : end) - line);
        if (begins(line, bytes, "</body>")) {
            break;
        }
        if (begins(line, bytes, "<link rel=\"stylesheet\"")) {
            write_styles(out, nonce);
        } else if (begins(line, bytes, "<script ")) {
            BST_TRY(bst_view_page_write_modules(ctx, out, nonce, NULL));
        } else if (!begins(line, bytes, "<link rel=\"modulepreload\"")) {
            write_line(out, line, bytes);
        }
        if (begins(line, bytes, "<meta charset")) {
            bst_view_page_write_policy(out, nonce);
        }
        line += bytes;
    }
    return BST_OK;
}

void bst_view_bundle_add(FILE *out, const char *key, const bst_view_bytes *packed) {
    fputs("<script type=\"text/plain\" data-key=\"", out);
    bst_html_text(out, key);
    if (packed->width > 0) {
        fprintf(out,
                "\" data-width=\"%d\" data-height=\"%d\" data-binning=\"%d\" data-frame=\"%d,%d",
                packed->width, packed->height, packed->binning, packed->frame_width,
                packed->frame_height);
    }
    fputs("\">", out);
    bst_html_base64(out, packed->data, packed->bytes);
    fputs("</script>\n", out);
}

void bst_view_bundle_end(FILE *out, const char *nonce) {
    bst_view_page_write_start(out, nonce, "app.js");
    fputs("</body>\n</html>\n", out);
}

size_t bst_view_bundle_size(const bst_view_bytes *packed) {
    return packed->data ? (packed->bytes + 2) / 3 * 4 + 128 : 0;
}

/* Low bytes of all pixels, then high bytes: noise is in the low ones, the high ones hardly vary. */
static void split_bytes(const bst_view_bytes *data, unsigned char *out) {
    const uint16_t *pixels = data->data;
    const size_t count = data->bytes / 2;
    for (size_t i = 0; i < count; i++) {
        out[i] = (unsigned char)(pixels[i] & 255);
        out[count + i] = (unsigned char)(pixels[i] >> 8);
    }
}

bst_status bst_view_bundle_pack(bst_ctx *ctx, const bst_view_bytes *data, bst_view_bytes *packed) {
    uLongf bytes = compressBound((uLong)data->bytes);
    unsigned char *split = data->width > 0 ? malloc(data->bytes + 1) : NULL;
    *packed = *data;
    packed->data = malloc(bytes);
    bst_status status = BST_OK;
    if (split) {
        split_bytes(data, split);
    }
    if (!packed->data || (data->width > 0 && !split) ||
        compress2(packed->data, &bytes, split ? split : data->data, (uLong)data->bytes, 6) !=
            Z_OK) {
        status =
            bst_fail(ctx, BST_ERR_MEMORY, "out of memory for %zu bytes of a page", data->bytes);
        free(packed->data);
        packed->data = NULL;
    }
    packed->bytes = (size_t)bytes;
    free(split);
    return status;
}
