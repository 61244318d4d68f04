#include "sim/cli/print_json.h"

#include <errno.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sim/cli/cli.h"
#include "sim/io/draft_file.h"

int bst_cli_print_json(cJSON *node) {
    char *text = node ? cJSON_Print(node) : NULL;
    cJSON_Delete(node);
    if (!text) {
        fprintf(stderr, "boresight: out of memory\n");
        return BST_EXIT_FAILED;
    }
    int written = printf("%s\n", text);
    free(text);
    if (written < 0 || fflush(stdout) != 0) {
        fprintf(stderr, "boresight: the output cannot be written\n");
        return BST_EXIT_FAILED;
    }
    return BST_EXIT_OK;
}

bst_status bst_cli_write_json(bst_ctx *ctx, const char *path, cJSON *node) {
    char *text = node ? cJSON_Print(node) : NULL;
    cJSON_Delete(node);
    if (!text) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory");
    }
    bool print = strcmp(path, "-") == 0;
    bst_draft draft = {.stream = stdout};
    bst_status status = print ? BST_OK : bst_draft_open(ctx, path, &draft);
    if (status == BST_OK) {
        bool good = fprintf(draft.stream, "%s\n", text) > 0 && fflush(draft.stream) == 0;
        status =
            good ? BST_OK
                 : bst_fail(ctx, BST_ERR_IO, "%s: cannot be written: %s", path, strerror(errno));
        status = print ? status : bst_draft_close(ctx, &draft, status);
    }
    free(text);
    return status;
}
