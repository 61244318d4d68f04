/* The reader of element sets and the start of SGP4 on any bytes. What is accepted must propagate to
 * numbers or say why not. */
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "sim/astro/sgp4.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes);

static void propagate(const bst_elements *elements) {
    static const double minutes[] = {0.0, 1440.0, -1440.0, 100000.0};
    bst_ctx ctx = {0};
    bst_sgp4 *sgp4 = NULL;
    if (bst_sgp4_create(&ctx, elements, BST_SGP4_WGS72, BST_SGP4_IMPROVED, &sgp4) != BST_OK) {
        if (ctx.message[0] == '\0' || sgp4) {
            abort();
        }
        return;
    }
    for (size_t i = 0; i < sizeof minutes / sizeof *minutes; i++) {
        double r[3], v[3];
        if (bst_sgp4_propagate(sgp4, minutes[i], r, v) == BST_SGP4_OK) {
            for (int k = 0; k < 3; k++) {
                if (!isfinite(r[k]) || !isfinite(v[k])) {
                    abort();
                }
            }
        }
    }
    bst_sgp4_free(sgp4);
}

/* Makes the checksums of what may be element lines right, or hardly a changed line gets past them.
 */
static void repair_checksums(char *text, size_t bytes) {
    size_t start = 0;
    for (size_t i = 0; i < bytes; i++) {
        if (text[i] == '\n') {
            start = i + 1;
        } else if (i - start == 68 && (text[start] == '1' || text[start] == '2')) {
            int sum = 0;
            for (size_t k = start; k < i; k++) {
                sum += text[k] >= '0' && text[k] <= '9' ? text[k] - '0' : text[k] == '-';
            }
            text[i] = (char)('0' + sum % 10);
        }
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes) {
    char *text = malloc(bytes + 1);
    if (!text) {
        return 0;
    }
    if (bytes) {
        memcpy(text, data, bytes);
    }
    for (int pass = 0; pass < 3; pass++) {
        if (pass == 2) {
            repair_checksums(text, bytes);
        }
        bst_ctx ctx;
        bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
        const bst_tle_options options = {.skip_bad_sets = pass > 0};
        bst_elements *sets = NULL;
        int count = 0;
        bst_status status =
            bst_tle_read_buffer(&ctx, "input", (const char *)data, bytes, &options, &sets, &count);
        if ((status == BST_OK) != (count > 0) || (count > 0) != (sets != NULL)) {
            abort();
        }
        for (int i = 0; i < count; i++) {
            propagate(&sets[i]);
        }
        free(sets);
    }
    free(text);
    return 0;
}
