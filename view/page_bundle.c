#include "view/page_bundle.h"

#include <stdlib.h>
#include <string.h>
#include <zlib.h>

#include "sim/io/html.h"
#include "view/page_files.h"

/* Names of the modules in the import map begin so: a data: address has no folder. */
#define PREFIX "boresight/"
/* Scripts of this file and the modules that they import; no connection anywhere. */
static const char policy[] = /* twice the nonce of its scripts and styles */
    "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; script-src "
    "'nonce-%s' 'strict-dynamic'; style-src 'nonce-%s'; img-src data:; base-uri 'none'; "
    "form-action 'none'\">\n";

static const bst_view_page_file *find(const char *name) {
    const bst_view_page_file *file = bst_view_page_files;
    while (file->name && strcmp(file->name, name) != 0) {
        file++;
    }
    return file->name ? file : NULL;
}

static bool ends_with(const char *name, const char *end) {
    const size_t length = strlen(name), n = strlen(end);
    return length >= n && strcmp(name + length - n, end) == 0;
}

/* True if 'NAME.js' of a module stands here, in quotes and behind "./". */
static bool is_module(const char *text) {
    char name[64];
    const char *end = strchr(text, '\'');
    return end && snprintf(name, sizeof name, "%.*s", (int)(end - text), text) < (int)sizeof name &&
           ends_with(name, ".js") && find(name);
}

/* Writes a module as an address; paths of other modules become names of the import map. */
static bst_status write_module(bst_ctx *ctx, FILE *out, const bst_view_page_file *file) {
    const char *rest = file->data, *end = file->data + file->bytes;
    const size_t room = 2 * file->bytes + 1;
    char *text = malloc(room), *to = text;
    if (!text) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a module of the page");
    }
    while (rest < end) {
        if (end - rest > 3 && memcmp(rest, "'./", 3) == 0 && is_module(rest + 3) &&
            (size_t)(to - text) + sizeof PREFIX + 2 < room) {
            to += sprintf(to, "'" PREFIX);
            rest += 3;
        } else {
            *to++ = *rest++;
        }
    }
    fputs("data:text/javascript;base64,", out);
    bst_html_base64(out, text, (size_t)(to - text));
    free(text);
    return BST_OK;
}

static bst_status write_modules(bst_ctx *ctx, FILE *out, const char *nonce) {
    fprintf(out, "<script type=\"importmap\" nonce=\"%s\">{\"imports\": {", nonce);
    bool first = true;
    for (const bst_view_page_file *file = bst_view_page_files; file->name; file++) {
        if (!ends_with(file->name, ".js") || strcmp(file->name, "recorded_api.js") == 0) {
            continue;
        }
        const bool is_api = strcmp(file->name, "api.js") == 0;
        fprintf(out, "%s\n\"" PREFIX "%s\": \"", first ? "" : ",", file->name);
        BST_TRY(write_module(ctx, out, is_api ? find("recorded_api.js") : file));
        fputc('"', out);
        first = false;
    }
    fputs("}}</script>\n", out);
    return BST_OK;
}

/* Style sheets go into one element, those of panels behind that of the page, as where they are
 * loaded. */
static void write_styles(FILE *out, const char *nonce) {
    const bst_view_page_file *first = find("style.css");
    fprintf(out, "<style nonce=\"%s\">\n", nonce);
    fwrite(first->data, 1, first->bytes, out);
    for (const bst_view_page_file *file = bst_view_page_files; file->name; file++) {
        if (ends_with(file->name, ".css") && file != first) {
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
            const bst_view_page_file *file = find(icon);
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
    const bst_view_page_file *page = find("index.html");
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
            BST_TRY(write_modules(ctx, out, nonce));
        } else if (!begins(line, bytes, "<link rel=\"modulepreload\"")) {
            write_line(out, line, bytes);
        }
        if (begins(line, bytes, "<meta charset")) {
            fprintf(out, policy, nonce, nonce);
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
    fprintf(out,
            "<script type=\"module\" nonce=\"%s\">import '" PREFIX
            "app.js';</script>\n</body>\n</html>\n",
            nonce);
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
