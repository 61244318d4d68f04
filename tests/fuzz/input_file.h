/* What the fuzzers of readers share that take a path: a folder of their own with the input in it.
 */
#ifndef BST_TESTS_FUZZ_INPUT_FILE_H
#define BST_TESTS_FUZZ_INPUT_FILE_H

#include <stddef.h>
#include <stdint.h>

enum { FUZZ_PATH_BYTES = 512 };

/* Writes (anew) a file into a folder of this process, which is made at the first call and removed
 * at exit, and returns its path: valid until the next call. */
const char *fuzz_write_file(const char *name, const void *data, size_t bytes);
/* The folder; valid for the life of the process. */
const char *fuzz_folder(void);
/* Aborts where a failure has no reason, or a reason no failure. */
#define FUZZ_CHECK_REASON(ctx, status)                            \
    do {                                                          \
        if (((status) == BST_OK) != ((ctx).message[0] == '\0')) { \
            abort();                                              \
        }                                                         \
    } while (0)

#endif
