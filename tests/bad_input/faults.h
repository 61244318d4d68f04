/* Files that no reader may stumble over, the same for every reader. */
#ifndef BST_TESTS_BAD_INPUT_FAULTS_H
#define BST_TESTS_BAD_INPUT_FAULTS_H

#include <fcntl.h>
#include <stdlib.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <time.h>
#include <unistd.h>

#include "boresight/status.h"
#include "tests/io/scratch.h"

/* A reader of one kind of file. `read` opens a path, releases what it got and returns how it went.
 */
typedef struct bad_reader {
    bst_status (*read)(bst_ctx *ctx, const char *path);
    const char *expected;         /* what the reader's messages tell to give */
    const char *prefix;           /* before the path in messages; "" for most */
    unsigned long long max_bytes; /* the largest file it takes */
} bad_reader;

/* Reads a path and compares status and message; `message` comes after prefix and path. */
static inline void bad_expect(const bad_reader *r, const char *path, bst_status status,
                              const char *message) {
    bst_ctx ctx = {0};
    char expected[4 * BST_MESSAGE_BYTES];
    bst_status got = r->read(&ctx, path);
    snprintf(expected, sizeof expected, "%s%s%s", r->prefix, path, message);
    assert_string_equal(ctx.message, expected);
    assert_int_equal(got, status);
}

/* The same with ": PROBLEM; give EXPECTED". */
static inline void bad_expect_kind(const bad_reader *r, const char *path, bst_status status,
                                   const char *problem) {
    char message[BST_MESSAGE_BYTES];
    snprintf(message, sizeof message, ": %s; give %s", problem, r->expected);
    bad_expect(r, path, status, message);
}

/* What is wrong with the path, not with what is in the file: none of these may hang or crash. */
static inline void bad_paths(const bad_reader *r) {
    scratch place;
    scratch_make(&place);
    char path[1024];
    snprintf(path, sizeof path, "%s", scratch_path(&place, "x"));
    bad_expect_kind(r, path, BST_ERR_NOT_FOUND, "cannot be opened: No such file or directory");
    bad_expect_kind(r, place.folder, BST_ERR_IO, "is a folder");
    bad_expect_kind(r, "/dev/zero", BST_ERR_IO, "is a device");
    bad_expect_kind(r, "/dev/null", BST_ERR_IO, "is a device");
    assert_int_equal(mkfifo(path, 0600), 0);
    bad_expect_kind(r, path, BST_ERR_IO, "is a pipe");
    unlink(path);
    assert_int_equal(symlink("x", path), 0);
    bad_expect_kind(r, path, BST_ERR_IO, "cannot be opened: Too many levels of symbolic links");
    unlink(path);
    int fd = open(path, O_WRONLY | O_CREAT | O_EXCL, 0600);
    assert_true(fd >= 0);
    close(fd);
    char below[1100];
    snprintf(below, sizeof below, "%s/y", path);
    bad_expect_kind(r, below, BST_ERR_IO, "cannot be opened: Not a directory");
    if (geteuid() != 0) { /* root may read anything */
        assert_int_equal(chmod(path, 0), 0);
        bad_expect_kind(r, path, BST_ERR_IO, "cannot be opened: Permission denied");
        assert_int_equal(chmod(path, 0600), 0);
    }
    /* a hole: one byte more than what is taken */
    assert_int_equal(truncate(path, (off_t)r->max_bytes + 1), 0);
    char problem[120];
    snprintf(problem, sizeof problem, "too large (found %llu bytes; allowed: at most %llu)",
             r->max_bytes + 1, r->max_bytes);
    bad_expect_kind(r, path, BST_ERR_FORMAT, problem);
    scratch_remove(&place);
}

/* Writes `bytes` bytes into a scratch file and reads it; the message comes after the path. */
static inline void bad_bytes(const bad_reader *r, const void *data, size_t bytes, bst_status status,
                             const char *message) {
    scratch place;
    scratch_make(&place);
    const char *path = scratch_path(&place, "x");
    FILE *file = fopen(path, "wb");
    assert_non_null(file);
    assert_int_equal(fwrite(data, 1, bytes, file), bytes);
    assert_int_equal(fclose(file), 0);
    bad_expect(r, path, status, message);
    scratch_remove(&place);
}

static inline void bad_text(const bad_reader *r, const char *text, bst_status status,
                            const char *message) {
    bad_bytes(r, text, strlen(text), status, message);
}

/* The text as UTF-16, with or without byte order mark, little-endian or big. */
static inline size_t bad_utf16(const char *text, bool mark, bool big, char *out) {
    size_t n = 0;
    if (mark) {
        out[n++] = big ? '\xFE' : '\xFF';
        out[n++] = big ? '\xFF' : '\xFE';
    }
    for (; *text; text++) {
        out[n++] = big ? '\0' : *text;
        out[n++] = big ? *text : '\0';
    }
    return n;
}

/* A file of about 200 MB that repeats `text` after `head`; the path is valid until removed. */
static inline void bad_make_large(scratch *place, const char *head, const char *text) {
    enum { MEGABYTE = 1000000 };
    scratch_make(place);
    FILE *file = fopen(scratch_path(place, "large"), "wb");
    assert_non_null(file);
    size_t length = strlen(text), repeats = MEGABYTE / length + 1;
    char *block = malloc(repeats * length + 1);
    assert_non_null(block);
    for (size_t i = 0; i < repeats; i++) {
        memcpy(block + i * length, text, length);
    }
    assert_true(fputs(head, file) >= 0);
    for (int i = 0; i < 200; i++) {
        assert_int_equal(fwrite(block, length, repeats, file), repeats);
    }
    free(block);
    assert_int_equal(fclose(file), 0);
}

/* Reads the file that bad_make_large made, within 10 s of processor time and 2 GiB. */
static inline bst_status bad_read_large(const bad_reader *r, bst_ctx *ctx, scratch *place) {
    const clock_t start = clock();
    bst_status status = r->read(ctx, scratch_path(place, "large"));
    double seconds = (double)(clock() - start) / CLOCKS_PER_SEC;
    struct rusage usage;
    getrusage(RUSAGE_SELF, &usage);
    print_message("%.2f s, %ld MiB: %s\n", seconds, usage.ru_maxrss / 1024,
                  status == BST_OK ? "read" : ctx->message);
    assert_true(seconds < 10.0);
    assert_true(usage.ru_maxrss < 2L << 20);
    return status;
}

#endif
