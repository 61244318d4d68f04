#include "view/page_modules.h"

#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "sim/io/html.h"

/* Names of the modules in the import map begin so: a data: address has no folder. */
#define PREFIX "boresight/"
/* Scripts of this file and the modules that they import; no connection anywhere. */
static const char policy[] = /* twice the nonce of its scripts and styles */
    "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; script-src "
    "'nonce-%s' 'strict-dynamic'; style-src 'nonce-%s'; img-src data:; base-uri 'none'; "
    "form-action 'none'\"/>\n";

const bst_view_page_file *bst_view_page_find(const char *name) {
    const bst_view_page_file *file = bst_view_page_files;
    while (file->name && strcmp(file->name, name) != 0) {
        file++;
    }
    return file->name ? file : NULL;
}

static bool is_script(const char *name) {
    const size_t length = strlen(name);
    return length >= 3 && strcmp(name + length - 3, ".js") == 0;
}

/* True if 'NAME.js' of a module stands here, in quotes and behind "./". */
static bool is_module(const char *text) {
    char name[64];
    const char *end = strchr(text, '\'');
    return end && snprintf(name, sizeof name, "%.*s", (int)(end - text), text) < (int)sizeof name &&
           is_script(name) && bst_view_page_find(name);
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

/* True if a file belongs into the import map. */
static bool is_wanted(const char *name, const char *const *names) {
    if (!names) {
        return is_script(name) && strcmp(name, "recorded_api.js") != 0 &&
               strcmp(name, "report_charts.js") != 0;
    }
    for (; *names; names++) {
        if (strcmp(name, *names) == 0) {
            return true;
        }
    }
    return false;
}

void bst_view_page_write_policy(FILE *out, const char *nonce) {
    fprintf(out, policy, nonce, nonce);
}

bst_status bst_view_page_write_modules(bst_ctx *ctx, FILE *out, const char *nonce,
                                       const char *const *names) {
    fprintf(out, "<script type=\"importmap\" nonce=\"%s\">{\"imports\": {", nonce);
    bool first = true;
    for (const bst_view_page_file *file = bst_view_page_files; file->name; file++) {
        if (is_wanted(file->name, names)) {
            const bool is_api = strcmp(file->name, "api.js") == 0;
            fprintf(out, "%s\n\"" PREFIX "%s\": \"", first ? "" : ",", file->name);
            BST_TRY(write_module(ctx, out, is_api ? bst_view_page_find("recorded_api.js") : file));
            fputc('"', out);
            first = false;
        }
    }
    fputs("}}</script>\n", out);
    return BST_OK;
}

void bst_view_page_write_start(FILE *out, const char *nonce, const char *name) {
    fprintf(out, "<script type=\"module\" nonce=\"%s\">import '" PREFIX "%s';</script>\n", nonce,
            name);
}
