#include "sim/cli/shipped.h"

#include <stdio.h>
#include <string.h>
#include <unistd.h>

void bst_cli_shipped_file(const char *name, char *path, size_t bytes) {
    static const char *const places[] = {"../share/boresight", ".."};
    char folder[4096];
    ssize_t length = readlink("/proc/self/exe", folder, sizeof folder - 1);
    folder[length > 0 ? length : 0] = '\0';
    char *slash = strrchr(folder, '/');
    for (size_t i = 0; slash && i < sizeof places / sizeof *places; i++) {
        *slash = '\0';
        int n = snprintf(path, bytes, "%s/%s/%s", folder, places[i], name);
        if (n > 0 && (size_t)n < bytes && access(path, R_OK) == 0) {
            return;
        }
    }
    snprintf(path, bytes, "%s", name);
}

bst_status bst_cli_find_keyword_map(bst_ctx *ctx, const char *name, char *path) {
    char shipped[256];
    snprintf(path, 4096, "%s", name);
    if (access(name, R_OK) == 0 && strchr(name, '.')) {
        return BST_OK;
    }
    if (!strchr(name, '/') && strlen(name) < 64) {
        snprintf(shipped, sizeof shipped, "scenarios/maps/%s.json", name);
        bst_cli_shipped_file(shipped, path, 4096);
        if (access(path, R_OK) == 0) {
            return BST_OK;
        }
    }
    return bst_fail(ctx, BST_ERR_NOT_FOUND,
                    "--map %.400s: there is no such keyword map (allowed: neossat, boresight, "
                    "satnet, table, or the path of a file)",
                    name);
}
