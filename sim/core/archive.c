#include "sim/core/archive.h"

#include <assert.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* First bytes of a record. */
typedef struct record_head {
    uint64_t bytes; /* of the record after its name */
    uint32_t name_bytes;
    uint32_t check; /* RECORD_CHECK */
} record_head;

enum { NAME_BYTES = 256, FIRST_ROOM = 4096 };
#define RECORD_CHECK UINT32_C(0xB0E51647)

struct bst_archive {
    bst_ctx *ctx;
    bool restoring;
    bool refers;          /* bst_archive_refer */
    unsigned char *saved; /* NULL while restoring */
    const unsigned char *bytes;
    size_t size, room, position; /* position: of the next byte to restore */
    size_t record;               /* position of the open record's head (saving) or its end */
    bool open;
    char name[NAME_BYTES]; /* of the open record */
    bool ended_early, out_of_range, no_memory;
    int64_t found, least, most; /* number that was out of range, and its limits */
};

bst_status bst_archive_create(bst_ctx *ctx, bst_archive **out) {
    assert(out);
    *out = calloc(1, sizeof **out);
    if (!*out) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a saved state");
    }
    (*out)->ctx = ctx;
    return BST_OK;
}

bst_status bst_archive_open(bst_ctx *ctx, const void *bytes, size_t size, bst_archive **out) {
    assert(bytes || size == 0);
    BST_TRY(bst_archive_create(ctx, out));
    (*out)->restoring = true;
    (*out)->bytes = bytes;
    (*out)->size = size;
    return BST_OK;
}

void bst_archive_refer(bst_archive *archive) {
    archive->refers = true;
}

bool bst_archive_refers(const bst_archive *archive) {
    return archive->refers;
}

void bst_archive_free(bst_archive *archive) {
    if (archive) {
        free(archive->saved);
        free(archive);
    }
}

const void *bst_archive_data(const bst_archive *archive, size_t *size) {
    *size = archive->size;
    return archive->restoring ? archive->bytes : archive->saved;
}

bool bst_archive_is_restoring(const bst_archive *archive) {
    return archive->restoring;
}

bst_ctx *bst_archive_ctx(bst_archive *archive) {
    return archive->ctx;
}

/* Makes room for more bytes; false: there is no memory. */
static bool reserve(bst_archive *archive, size_t more) {
    if (archive->room - archive->size >= more) {
        return true;
    }
    size_t room = archive->room ? archive->room : FIRST_ROOM;
    while (room - archive->size < more) {
        room *= 2;
    }
    unsigned char *saved = realloc(archive->saved, room);
    if (!saved) {
        archive->no_memory = true;
        return false;
    }
    archive->saved = saved;
    archive->room = room;
    return true;
}

static void save(bst_archive *archive, const void *data, size_t bytes) {
    if (bytes > 0 && reserve(archive, bytes)) {
        memcpy(archive->saved + archive->size, data, bytes);
        archive->size += bytes;
    }
}

static void restore(bst_archive *archive, void *data, size_t bytes) {
    size_t end = archive->open ? archive->record : archive->size;
    if (bytes > end - archive->position) {
        archive->ended_early = true;
        archive->position = end;
        memset(data, 0, bytes);
    } else if (bytes > 0) {
        memcpy(data, archive->bytes + archive->position, bytes);
        archive->position += bytes;
    }
}

void bst_archive_bytes(bst_archive *archive, void *data, size_t bytes) {
    assert(archive && (data || bytes == 0));
    if (archive->restoring) {
        restore(archive, data, bytes);
    } else {
        save(archive, data, bytes);
    }
}

void bst_archive_raw(bst_archive *archive, const void *data, size_t bytes) {
    assert(archive && !archive->restoring && !archive->open);
    save(archive, data, bytes);
}

void *bst_archive_take(bst_archive *archive, size_t *size) {
    assert(archive && !archive->restoring && !archive->open);
    void *saved = archive->saved;
    *size = archive->size;
    if (archive->no_memory) {
        free(saved);
        saved = NULL;
    }
    archive->saved = NULL;
    archive->size = archive->room = 0;
    return saved;
}

/* Notes a restored number that is out of range. */
static bool in_range(bst_archive *archive, int64_t value, int64_t least, int64_t most) {
    if (value >= least && value <= most) {
        return true;
    }
    archive->out_of_range = true;
    archive->found = value;
    archive->least = least;
    archive->most = most;
    return false;
}

int bst_archive_count(bst_archive *archive, int count, int capacity) {
    assert(capacity >= 0 && (archive->restoring || (count >= 0 && count <= capacity)));
    BST_ARCHIVE(archive, count);
    return in_range(archive, count, 0, capacity) ? count : 0;
}

int64_t bst_archive_integer(bst_archive *archive, int64_t value, int64_t least, int64_t most) {
    assert(least <= most && (archive->restoring || (value >= least && value <= most)));
    BST_ARCHIVE(archive, value);
    return in_range(archive, value, least, most) ? value : least;
}

void bst_archive_bool(bst_archive *archive, bool *flag) {
    unsigned char byte = archive->restoring ? 0 : *flag;
    BST_ARCHIVE(archive, byte);
    if (archive->restoring) {
        *flag = byte != 0;
    }
}

size_t bst_archive_remaining(const bst_archive *archive) {
    assert(archive->restoring && archive->open);
    return archive->record - archive->position;
}

static bst_status begin_saving(bst_ctx *ctx, bst_archive *archive, const char *name) {
    size_t length = strlen(name);
    assert(length < NAME_BYTES);
    archive->record = archive->size;
    const record_head head = {0, (uint32_t)length, RECORD_CHECK};
    save(archive, &head, sizeof head);
    save(archive, name, length);
    return archive->no_memory ? bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a saved state")
                              : BST_OK;
}

/* Reads the head of the next record and checks it. */
static bst_status begin_restoring(bst_ctx *ctx, bst_archive *archive, const char *name) {
    record_head head;
    char found[NAME_BYTES] = "";
    archive->ended_early = false;
    restore(archive, &head, sizeof head);
    if (archive->ended_early) {
        return bst_fail(ctx, BST_ERR_FORMAT, "the saved state ends before the record \"%s\"", name);
    }
    if (head.check != RECORD_CHECK || head.name_bytes >= NAME_BYTES ||
        head.name_bytes > archive->size - archive->position ||
        head.bytes > archive->size - archive->position - head.name_bytes) {
        return bst_fail(ctx, BST_ERR_FORMAT, "the saved state is damaged before the record \"%s\"",
                        name);
    }
    restore(archive, found, head.name_bytes);
    if (strcmp(found, name) != 0) {
        return bst_fail(ctx, BST_ERR_FORMAT,
                        "the saved state has the record \"%s\" where \"%s\" is expected: it is "
                        "that of another scenario",
                        found, name);
    }
    archive->record = archive->position + (size_t)head.bytes;
    return BST_OK;
}

bst_status bst_archive_begin(bst_ctx *ctx, bst_archive *archive, const char *name) {
    assert(archive && name && !archive->open);
    BST_TRY(archive->restoring ? begin_restoring(ctx, archive, name)
                               : begin_saving(ctx, archive, name));
    archive->ctx = ctx;
    archive->open = true;
    archive->out_of_range = false;
    snprintf(archive->name, sizeof archive->name, "%s", name);
    return BST_OK;
}

bst_status bst_archive_end(bst_ctx *ctx, bst_archive *archive) {
    assert(archive && archive->open);
    archive->open = false;
    if (archive->no_memory) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the saved state of %s",
                        archive->name);
    }
    if (!archive->restoring) {
        record_head head;
        unsigned char *at = archive->saved + archive->record;
        memcpy(&head, at, sizeof head);
        head.bytes = archive->size - archive->record - sizeof head - head.name_bytes;
        memcpy(at, &head, sizeof head);
        return BST_OK;
    }
    if (archive->out_of_range) {
        return bst_fail(ctx, BST_ERR_FORMAT,
                        "the saved state of %s has the number %lld where %lld to %lld are allowed",
                        archive->name, (long long)archive->found, (long long)archive->least,
                        (long long)archive->most);
    }
    if (archive->ended_early || archive->position != archive->record) {
        return bst_fail(ctx, BST_ERR_FORMAT,
                        "the saved state of %s does not fit: it is that of another scenario or "
                        "another version of the program",
                        archive->name);
    }
    return BST_OK;
}

bst_status bst_archive_skip(bst_ctx *ctx, bst_archive *archive, const char *name) {
    assert(archive->restoring);
    BST_TRY(bst_archive_begin(ctx, archive, name));
    archive->position = archive->record;
    return bst_archive_end(ctx, archive);
}
