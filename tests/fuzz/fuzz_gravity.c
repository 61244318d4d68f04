/* The reader of gravity fields (ICGEM) on any bytes. What is accepted can be evaluated.
 */

#include <stdint.h>
#include <stdlib.h>

#include "sim/astro/gravity.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes) {
    for (int degree = 0; degree <= 4; degree += 2) {
        bst_ctx ctx;
        bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
        bst_gravity *field = NULL;
        bst_status status = bst_gravity_read_buffer(&ctx, "input", (const char *)data, bytes,
                                                    degree, degree / 2, &field);
        if ((status == BST_OK) != (ctx.message[0] == '\0') ||
            (status == BST_OK) != (field != NULL)) {
            abort(); /* a failure without its reason, or a reason without a failure */
        }
        if (field) {
            (void)bst_gravity_acceleration(field, (bst_vec3){0.0, 0.0, 7e6});
            (void)bst_gravity_potential(field, (bst_vec3){7e6, 1e5, -2e6});
            bst_gravity_free(field);
        }
    }
    return 0;
}
