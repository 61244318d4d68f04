/* What star catalogues are made from: rows of Tycho-2, and the description of a part of the sky,
 * from any bytes. A row that is accepted gives a finite star. */
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "sim/catalogue/star_import.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes);

static void read_row(const char *row, size_t bytes) {
    bst_ctx ctx;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
    bst_star_values values;
    bst_star_record record;
    char *exact = malloc(bytes + 1);
    memcpy(exact, row, bytes);
    bst_status status = bst_star_parse_row(&ctx, exact, bytes, &values);
    free(exact);
    if (status == BST_OK) {
        status = bst_star_pack(&ctx, &values, &record);
    }
    if ((status == BST_OK) != (ctx.message[0] == '\0')) {
        abort(); /* a failure without its reason, or a reason without a failure */
    }
    if (status == BST_OK && !(bst_vec3_norm(bst_star_record_direction(&record, 22.5)) > 0.5)) {
        abort();
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes) {
    const char *text = (const char *)data;
    bst_ctx ctx;
    bst_star_subset subset;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
    if (bst_star_subset_read_buffer(&ctx, "input", text, bytes, &subset) == BST_OK &&
        !isfinite(subset.v_limit)) {
        abort();
    }
    while (bytes > 0) {
        const char *end = memchr(text, '\n', bytes);
        size_t length = end ? (size_t)(end - text) : bytes;
        read_row(text, length);
        text += length + (end != NULL);
        bytes -= length + (end != NULL);
    }
    return 0;
}
