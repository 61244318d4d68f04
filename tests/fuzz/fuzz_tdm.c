/* The reader of TDM files on any bytes. What is accepted is in order of time and on the sphere. */
#include <math.h>
#include <stdint.h>
#include <stdlib.h>

#include "sim/astro/tdm.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes) {
    bst_ctx ctx;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
    bst_tdm *tdm = NULL;
    bst_status status = bst_tdm_read_buffer(&ctx, "input", (const char *)data, bytes, &tdm);
    if ((status == BST_OK) != (ctx.message[0] == '\0') || (status == BST_OK) != (tdm != NULL)) {
        abort(); /* a failure without its reason, or a reason without a failure */
    }
    for (int i = 0; tdm && i < bst_tdm_pair_count(tdm); i++) {
        const bst_tdm_pair *pair = bst_tdm_pair_at(tdm, i);
        for (int64_t k = 0; k < pair->count; k++) {
            const bst_tdm_angles *a = &pair->items[k];
            if (!(a->ra_rad >= 0.0 && a->ra_rad < 6.2831853071795871) ||
                !(fabs(a->dec_rad) <= 1.5707963267948968) ||
                (k > 0 && !(bst_time_diff(a->time, a[-1].time) > 0.0))) {
                abort();
            }
        }
    }
    bst_tdm_free(tdm);
    return 0;
}
