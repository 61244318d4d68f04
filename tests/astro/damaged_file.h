/* Every cut of a file and many changed bytes, for readers of buffers. */
#ifndef BST_TESTS_ASTRO_DAMAGED_FILE_H
#define BST_TESTS_ASTRO_DAMAGED_FILE_H

#include <stdlib.h>
#include <string.h>

#include "tests/test_support.h"

/* Calls `read` with each damaged copy of `good`: cut before each of its bytes, and with each byte
 * replaced by each of `bytes`. A copy's buffer has exactly its size, so that a sanitizer sees a
 * read beyond it. */
static inline void bst_damage(const char *good, const unsigned char *bytes, size_t count,
                              void (*read)(const char *data, size_t size)) {
    size_t length = strlen(good);
    for (size_t i = 0; i < length; i++) {
        for (size_t k = 0; k <= count; k++) {
            bool cut = k == count;
            size_t size = cut ? i : length;
            char *data = malloc(size ? size : 1);
            assert_non_null(data);
            memcpy(data, good, size);
            if (!cut) {
                data[i] = (char)bytes[k];
            }
            read(data, size);
            free(data);
        }
    }
}

#endif
