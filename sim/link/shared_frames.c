#include "sim/link/shared_frames.h"

#include <errno.h>
#include <fcntl.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include "sim/core/parallel.h"

struct bst_shared_frames {
    char name[64]; /* including the slash */
    unsigned char *memory;
    size_t slot_bytes;
    int slots;
    int64_t next;
    bool owner;
    bst_parallel *threads; /* of the writer: one core does not saturate the memory bandwidth */
};

/* bytes per copied piece; small enough for the shared cache */
enum { PIECE = 256 << 10 };
typedef struct copy {
    unsigned char *to;
    const unsigned char *from;
    size_t bytes;
} copy;

/* Copies pieces of a frame's pixels; run in parallel. */
static void copy_pieces(void *user, int begin, int end) {
    const copy *c = user;
    for (int i = begin; i < end; i++) {
        size_t at = (size_t)i * PIECE, left = c->bytes - at;
        memcpy(c->to + at, c->from + at, left < PIECE ? left : PIECE);
    }
}

/* Maps the shared memory of the frames; the owner allocates it. */
static bst_status map(bst_ctx *ctx, bst_shared_frames *f, int fd) {
    size_t bytes = f->slot_bytes * (size_t)f->slots;
    struct stat about;
    if (f->owner && posix_fallocate(fd, 0, (off_t)bytes) != 0) {
        return bst_fail(
            ctx, BST_ERR_IO,
            "link: no room for %zu bytes in shared memory (/dev/shm); free some, or run "
            "without /link/shared_memory",
            bytes);
    }
    if (fstat(fd, &about) != 0 || about.st_size < (off_t)bytes) {
        return bst_fail(ctx, BST_ERR_FORMAT, "link: the shared memory %s is shorter than %zu bytes",
                        f->name, bytes);
    }
    int access = f->owner ? PROT_READ | PROT_WRITE : PROT_READ;
    void *memory = mmap(NULL, bytes, access, MAP_SHARED, fd, 0);
    if (memory == MAP_FAILED) {
        return bst_fail(ctx, BST_ERR_IO, "link: cannot map the shared memory %s: %s", f->name,
                        strerror(errno));
    }
    f->memory = memory;
    return BST_OK;
}

/* Creates the shared memory of the simulation, or opens it as a peer. */
static bst_status make(bst_ctx *ctx, bst_shared_frames *made, bst_shared_frames **out) {
    bst_shared_frames *f = malloc(sizeof *f);
    if (!f) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the link's frames");
    }
    *f = *made;
    int fd = -1;
    for (int i = 0; fd < 0 && i < 100; i++) {
        if (f->owner) {
            snprintf(f->name, sizeof f->name, "/boresight-%ld-%d", (long)getpid(), i);
        }
        fd = shm_open(f->name, f->owner ? O_RDWR | O_CREAT | O_EXCL : O_RDONLY, 0600);
        if (fd < 0 && (errno != EEXIST || !f->owner)) {
            break;
        }
    }
    bst_status status =
        fd >= 0 ? map(ctx, f, fd)
                : bst_fail(ctx, BST_ERR_IO, "link: cannot open the shared memory %s: %s", f->name,
                           strerror(errno));
    if (status != BST_OK && fd >= 0 && f->owner) {
        shm_unlink(f->name);
    }
    if (fd >= 0) {
        close(fd);
    }
    if (status != BST_OK) {
        free(f);
        return status;
    }
    *out = f;
    return BST_OK;
}

bst_status bst_shared_frames_create(bst_ctx *ctx, size_t pixel_bytes, bst_shared_frames **out) {
    *out = NULL;
    bst_shared_frames f = {.slots = BST_LINK_SLOTS, .owner = true};
    f.slot_bytes = BST_LINK_PIXELS_AT + (pixel_bytes + 4095) / 4096 * 4096;
    BST_TRY(make(ctx, &f, out));
    bst_status status = bst_parallel_create(ctx, 2, &(*out)->threads);
    if (status != BST_OK) {
        bst_shared_frames_free(*out);
        *out = NULL;
        return status;
    }
    int64_t none = -1;
    for (int i = 0; i < f.slots; i++) {
        memcpy((*out)->memory + (size_t)i * f.slot_bytes, &none, sizeof none);
    }
    return BST_OK;
}

bst_status bst_shared_frames_open(bst_ctx *ctx, const char *name, int64_t slot_bytes, int slots,
                                  bst_shared_frames **out) {
    *out = NULL;
    bst_shared_frames f = {.slots = slots};
    if (strncmp(name, "/boresight-", 11) != 0 || strchr(name + 1, '/') || slots < 1 || slots > 64 ||
        slot_bytes <= BST_LINK_PIXELS_AT || slot_bytes > INT64_C(1) << 34 || slot_bytes % 8 != 0) {
        return bst_fail(ctx, BST_ERR_FORMAT,
                        "link: \"%.64s\" with %d slots of %lld bytes is no shared memory for "
                        "frames (allowed: \"/boresight-...\" with 1 to 64 slots of 4104 to 2^34 "
                        "bytes, a multiple of 8)",
                        name, slots, (long long)slot_bytes);
    }
    f.slot_bytes = (size_t)slot_bytes;
    snprintf(f.name, sizeof f.name, "%s", name);
    return make(ctx, &f, out);
}

void bst_shared_frames_free(bst_shared_frames *f) {
    if (f) {
        bst_parallel_free(f->threads);
        munmap(f->memory, f->slot_bytes * (size_t)f->slots);
        if (f->owner) {
            shm_unlink(f->name);
        }
        free(f);
    }
}

const char *bst_shared_frames_name(const bst_shared_frames *f) {
    return f->name;
}
int64_t bst_shared_frames_slot_bytes(const bst_shared_frames *f) {
    return (int64_t)f->slot_bytes;
}
int64_t bst_shared_frames_next(const bst_shared_frames *f) {
    return f->next;
}

/* Memory of the frame slot with this number. */
static unsigned char *slot_of(const bst_shared_frames *f, int64_t number) {
    return f->memory + (size_t)(number % f->slots) * f->slot_bytes;
}

void bst_shared_frames_write(bst_shared_frames *f, const char *header, size_t header_bytes,
                             const void *pixels, size_t bytes) {
    unsigned char *slot = slot_of(f, f->next);
    int64_t length = (int64_t)bytes;
    __atomic_store_n((int64_t *)(void *)slot, -1, __ATOMIC_RELAXED);
    __atomic_thread_fence(__ATOMIC_RELEASE);
    memcpy(slot + 8, &length, sizeof length);
    memcpy(slot + BST_LINK_SLOT_HEADER_AT, header, header_bytes);
    memset(slot + BST_LINK_SLOT_HEADER_AT + header_bytes, 0,
           BST_LINK_PIXELS_AT - BST_LINK_SLOT_HEADER_AT - header_bytes);
    copy c = {slot + BST_LINK_PIXELS_AT, pixels, bytes};
    bst_parallel_for(f->threads, (int)((bytes + PIECE - 1) / PIECE), 1, copy_pieces, &c);
    __atomic_store_n((int64_t *)(void *)slot, f->next, __ATOMIC_RELEASE);
    f->next++;
}

bool bst_shared_frames_holds(const bst_shared_frames *f, int64_t number) {
    __atomic_thread_fence(__ATOMIC_ACQUIRE);
    return number >= 0 && __atomic_load_n((const int64_t *)(const void *)slot_of(f, number),
                                          __ATOMIC_ACQUIRE) == number;
}

const uint16_t *bst_shared_frames_read(const bst_shared_frames *f, int64_t number, int64_t bytes) {
    int64_t length;
    if (!bst_shared_frames_holds(f, number)) {
        return NULL;
    }
    const unsigned char *slot = slot_of(f, number);
    memcpy(&length, slot + 8, sizeof length);
    return length == bytes && bytes >= 0 && (size_t)bytes <= f->slot_bytes - BST_LINK_PIXELS_AT
               ? (const uint16_t *)(const void *)(slot + BST_LINK_PIXELS_AT)
               : NULL;
}
