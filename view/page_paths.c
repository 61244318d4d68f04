#define _XOPEN_SOURCE 700 /* realpath */
#include "view/page_paths.h"

#include <ctype.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

/* True for a character that continues a path: "/a/runs/" in "/b/a/runs/x" is no path's begin. */
static bool is_of_path(char c) {
    return isalnum((unsigned char)c) || (unsigned char)c >= 128 || strchr("_-./~", c);
}

/* Removes a path of `length` bytes wherever one begins with it. */
static void cut_text(char *text, const char *path, size_t length) {
    char *to = text;
    for (const char *from = text; *from;) {
        if ((from == text || !is_of_path(from[-1])) && strncmp(from, path, length) == 0) {
            from += length;
            for (; *from && is_of_path(*from); from++) { /* the rest of this path stays */
                *to++ = *from;
            }
        } else {
            *to++ = *from++;
        }
    }
    *to = '\0';
}

static void cut_all(cJSON *node, const char *path, size_t length) {
    for (; node; node = node->next) {
        if (cJSON_IsString(node)) {
            cut_text(node->valuestring, path, length);
        }
        cut_all(node->child, path, length);
    }
}

/* Bytes of a path up to its last part, with the slash; 0: it has one part, or is below "/". */
static size_t length_of_parent(const char *path) {
    size_t length = strlen(path);
    while (length > 0 && path[length - 1] == '/') {
        length--;
    }
    while (length > 0 && path[length - 1] != '/') {
        length--;
    }
    return length > 1 ? length : 0;
}

void bst_view_cut_path(cJSON *node, const char *folder) {
    char *absolute = realpath(folder, NULL);
    const char *const paths[] = {absolute, folder};
    for (int i = 0; node && i < 2; i++) {
        const size_t length = paths[i] ? length_of_parent(paths[i]) : 0;
        if (length > 0) {
            cut_all(node->child, paths[i], length);
        }
    }
    free(absolute);
}
