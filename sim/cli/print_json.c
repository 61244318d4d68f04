#include "sim/cli/print_json.h"

#include <stdio.h>
#include <stdlib.h>

#include "sim/cli/cli.h"

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
