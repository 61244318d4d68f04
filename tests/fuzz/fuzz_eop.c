/* The reader of Earth-orientation files on any bytes. A table that is accepted gives finite values
 * for the days that it covers. */
#include <math.h>
#include <stdint.h>
#include <stdlib.h>

#include "sim/astro/frames.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes) {
    bst_ctx ctx;
    bst_astro_eop *eop = NULL;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
    bst_status status = bst_astro_eop_read_buffer(&ctx, "input", (const char *)data, bytes, &eop);
    if ((status == BST_OK) != (ctx.message[0] == '\0') || (status == BST_OK) != (eop != NULL)) {
        abort(); /* a failure without its reason, or a reason without a failure */
    }
    bst_time noon;
    if (status == BST_OK && bst_time_from_utc(&ctx, "2022-06-15T12:00:00Z", &noon) == BST_OK) {
        bst_astro_eop_values v;
        bst_astro_eop_uncertainty u;
        /* 30 years of a clock that is 10 ms a day off, and 40 leap seconds */
        double most_s = bst_astro_eop_uncertainty_at(eop, noon, &u) ? 150.0 : 2.0;
        if (bst_astro_eop_at(&ctx, eop, noon, &v) == BST_OK &&
            !(fabs(v.ut1_minus_utc_s) < most_s && fabs(v.xp_rad) < 2e-5 && fabs(v.yp_rad) < 2e-5)) {
            abort();
        }
    }
    bst_astro_eop_free(eop);
    return 0;
}
