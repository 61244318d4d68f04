/* The reader of injected states on any bytes. What is accepted gives states within its spans. */
#include <stdint.h>
#include <stdlib.h>

#include "sim/astro/state_table.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes) {
    bst_ctx ctx;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
    bst_time epoch;
    if (bst_time_from_utc(&ctx, "2022-06-16T22:10:00Z", &epoch) != BST_OK) {
        abort();
    }
    bst_state_table *states = NULL;
    bst_status status =
        bst_state_table_read_buffer(&ctx, "input", (const char *)data, bytes, epoch, &states);
    if ((status == BST_OK) != (ctx.message[0] == '\0') || (status == BST_OK) != (states != NULL)) {
        abort(); /* a failure without its reason, or a reason without a failure */
    }
    for (int i = 0; states && i < bst_state_table_object_count(states); i++) {
        double start_s, end_s;
        bst_vec3 r, v;
        bst_state_table_span(states, i, &start_s, &end_s);
        if (!(start_s <= end_s) ||
            bst_state_table_state(&ctx, states, i, start_s, &r, &v) != BST_OK ||
            bst_state_table_state(&ctx, states, i, 0.5 * (start_s + end_s), &r, &v) != BST_OK) {
            abort();
        }
    }
    bst_state_table_free(states);
    return 0;
}
