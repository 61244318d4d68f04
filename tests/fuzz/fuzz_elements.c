/* The reader of element sets in every form (lines, OMM as JSON and as CSV) on any bytes. What is
 * accepted has elements in their ranges. */
#include <math.h>
#include <stdint.h>
#include <stdlib.h>

#include "sim/astro/elements.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes) {
    for (int pass = 0; pass < 2; pass++) {
        bst_ctx ctx;
        bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
        const bst_elements_options options = {.skip_bad_sets = pass > 0};
        bst_elements *sets = NULL;
        int count = 0;
        bst_status status = bst_elements_read_buffer(&ctx, "input", (const char *)data, bytes,
                                                     &options, &sets, &count);
        if ((status == BST_OK) != (ctx.message[0] == '\0') || (status == BST_OK) != (count > 0) ||
            (count > 0) != (sets != NULL)) {
            abort(); /* a failure without its reason, or a reason without a failure */
        }
        for (int i = 0; i < count; i++) {
            const bst_elements *e = &sets[i];
            if (e->norad < 0 || e->norad > BST_NORAD_MAX || !(e->eccentricity >= 0.0) ||
                !(e->eccentricity < 1.0) || !(e->mean_motion_radpmin > 0.0) ||
                !isfinite(e->mean_motion_radpmin) || !isfinite(e->raan_rad) ||
                !isfinite(e->bstar) || !isfinite(e->epoch_utc_jd1 + e->epoch_utc_jd2)) {
                abort();
            }
        }
        free(sets);
    }
    return 0;
}
