/* Records the answers of peers to a file, and replays them.
 *
 * Packets as in docs/reference/icd.md, each after the bytes of its header and of its payload (two
 * uint32, little-endian). A call with an answer is stored as outputs and `done`; `step` with
 * attempt 0 records whether a part was ready, with attempt 1 that there was no further answer. */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "sim/core/file.h"
#include "sim/link/crc32c.h"
#include "sim/link/link_internal.h"

enum { HEADER_ROOM = BST_LINK_HEADER_BYTES, PAYLOAD_MOST = 64 << 20 };

struct link_tape {
    FILE *file;
    bool writing;
    char path[600];
    uint8_t *payload;
    size_t room;
    int64_t packets;
    int failed; /* errno of the first failed write */
};

/* Opens the file link.packets for recording or replay. */
static bst_status open_tape(bst_ctx *ctx, bst_link *link, const char *path, bool writing) {
    if (link->exchanges > 0 || link->tape) {
        return bst_fail(ctx, BST_ERR_STATE, "link: recorded or replayed once, before it begins");
    }
    link_tape *tape = calloc(1, sizeof *tape);
    if (!tape) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the link's recording");
    }
    tape->writing = writing;
    snprintf(tape->path, sizeof tape->path, "%s", path);
    if (!writing) {
        int fd;
        uint64_t bytes;
        bst_ctx why_not = {0};
        bst_status status =
            bst_file_open(&why_not, path, INT64_MAX, "a run's link.packets", &fd, &bytes);
        if (status != BST_OK && status != BST_ERR_NOT_FOUND) {
            free(tape);
            return bst_fail(ctx, status, "link: %s", why_not.message);
        }
        tape->file = status == BST_OK ? fdopen(fd, "rb") : NULL;
        errno = status == BST_OK ? errno : ENOENT;
    } else {
        tape->file = fopen(path, "wb");
    }
    if (!tape->file) {
        int why = errno;
        free(tape);
        return bst_fail(ctx, !writing && why == ENOENT ? BST_ERR_NOT_FOUND : BST_ERR_IO,
                        "link: cannot open %s: %s%s", path, strerror(why),
                        writing ? "" : "; only a run with modules of type \"external\" has it");
    }
    link->tape = tape;
    return BST_OK;
}

bst_status bst_link_record(bst_ctx *ctx, bst_link *link, const char *path) {
    return open_tape(ctx, link, path, true);
}

bst_status bst_link_replay(bst_ctx *ctx, bst_link *link, const char *path) {
    return open_tape(ctx, link, path, false);
}

bool bst_link_replays(const bst_link *link) {
    return link->tape && !link->tape->writing;
}

void bst_link_tape_free(link_tape *tape) {
    if (tape) {
        if (tape->file) {
            (void)fclose(tape->file);
        }
        free(tape->payload);
        free(tape);
    }
}

bst_status bst_link_record_end(bst_ctx *ctx, bst_link *link) {
    link_tape *tape = link->tape;
    if (!tape || !tape->writing || !tape->file) {
        return BST_OK;
    }
    if (fflush(tape->file) != 0 || fsync(fileno(tape->file)) != 0) {
        tape->failed = tape->failed ? tape->failed : errno;
    }
    if (fclose(tape->file) != 0) {
        tape->failed = tape->failed ? tape->failed : errno;
    }
    tape->file = NULL;
    return tape->failed ? bst_fail(ctx, BST_ERR_IO, "link: cannot write %s: %s", tape->path,
                                   strerror(tape->failed))
                        : BST_OK;
}

static bool grow(link_tape *tape, size_t bytes) {
    if (tape->room < bytes) {
        void *more = realloc(tape->payload, bytes);
        if (!more) {
            return false;
        }
        tape->payload = more;
        tape->room = bytes;
    }
    return true;
}

/* Records one message of the link. */
static void record_message(bst_link *link, const char *instance, int64_t tick, bst_link_type type,
                           const void *payload) {
    link_tape *tape = link->tape;
    const bst_wire_message *about = bst_wire_message_of(type);
    size_t bytes = bst_wire_payload_bytes(about, bst_wire_items(about, payload));
    if (tape->failed || !grow(tape, bytes)) {
        tape->failed = tape->failed ? tape->failed : ENOMEM;
        return;
    }
    bst_wire_encode(about, payload, tape->payload);
    bst_link_header header = {.type = type,
                              .tick = tick,
                              .sequence = tape->packets++,
                              .step = -1,
                              .slot = -1,
                              .parts = 1,
                              .lengths = {(int64_t)bytes},
                              .crcs = {bst_crc32c(tape->payload, bytes)}};
    snprintf(header.instance, sizeof header.instance, "%s", instance);
    char text[HEADER_ROOM];
    uint32_t lengths[2] = {(uint32_t)bst_link_header_write(&header, text), (uint32_t)bytes};
    uint8_t ahead[8];
    for (int i = 0; i < 8; i++) {
        ahead[i] = (uint8_t)(lengths[i / 4] >> (8 * (i % 4)));
    }
    if (fwrite(ahead, 1, 8, tape->file) != 8 ||
        fwrite(text, 1, lengths[0], tape->file) != lengths[0] ||
        fwrite(tape->payload, 1, bytes, tape->file) != bytes) {
        tape->failed = errno ? errno : EIO;
    }
}

void bst_link_tape_answer(bst_link *link, int part, int64_t tick, const bst_link_output *outputs,
                          int count) {
    if (!link->tape || !link->tape->writing || !link->tape->file) {
        return;
    }
    const char *instance = link->parts[part].about.instance;
    bst_link_done done = {.outputs = 0};
    for (int i = 0; i < count; i++) {
        if (outputs[i].given) {
            record_message(link, instance, tick, outputs[i].type, outputs[i].payload);
            done.outputs++;
        }
    }
    record_message(link, instance, tick, BST_LINK_DONE, &done);
}

void bst_link_tape_note(bst_link *link, int part, int64_t tick, bool ready, bool more) {
    if (link->tape && link->tape->writing && link->tape->file) {
        const bst_link_step step = {.inputs = ready, .attempt = more};
        record_message(link, link->parts[part].about.instance, tick, BST_LINK_STEP, &step);
    }
}

/* Fails: the recording does not match this run. */
static bst_status fail_mismatch(bst_ctx *ctx, const bst_link *link, const char *instance,
                                int64_t tick, const bst_link_header *found) {
    const link_tape *tape = link->tape;
    if (!found) {
        return bst_fail(
            ctx, BST_ERR_FORMAT,
            "link: %s ends before %s at tick %lld: the recorded run was shorter, or its "
            "file is cut",
            tape->path, instance, (long long)tick);
    }
    return bst_fail(
        ctx, BST_ERR_FORMAT,
        "link: packet %lld of %s is %s of %.160s at tick %lld, where this run asks %s at "
        "tick %lld: a recording is replayed by the scenario, seed and options of its run "
        "(scenario.json in its folder)",
        (long long)tape->packets - 1, tape->path, bst_wire_message_of(found->type)->name,
        found->instance, (long long)found->tick, instance, (long long)tick);
}

/* Reads the next packet; tape->payload holds its payload. */
static bst_status get(bst_ctx *ctx, const bst_link *link, const char *instance, int64_t tick,
                      bst_link_header *header) {
    link_tape *tape = link->tape;
    uint8_t ahead[8];
    char text[HEADER_ROOM];
    uint32_t lengths[2] = {0};
    size_t got = fread(ahead, 1, 8, tape->file);
    for (int i = 0; i < 8; i++) {
        lengths[i / 4] |= (uint32_t)ahead[i] << (8 * (i % 4));
    }
    if (got < 8) {
        return fail_mismatch(ctx, link, instance, tick, NULL);
    }
    if (lengths[0] > HEADER_ROOM || lengths[1] > PAYLOAD_MOST) {
        return bst_fail(ctx, BST_ERR_FORMAT, "link: %s is damaged behind packet %lld", tape->path,
                        (long long)tape->packets);
    }
    if (!grow(tape, lengths[1] + 1)) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the link's recording");
    }
    if (fread(text, 1, lengths[0], tape->file) != lengths[0] ||
        fread(tape->payload, 1, lengths[1], tape->file) != lengths[1]) {
        return fail_mismatch(ctx, link, instance, tick, NULL);
    }
    tape->packets++;
    if (bst_link_header_read(ctx, text, lengths[0], header) != BST_WIRE_GOOD ||
        bst_link_part_check(ctx, header, 0, tape->payload, lengths[1]) != BST_WIRE_GOOD) {
        return bst_fail_prefix(ctx, BST_ERR_FORMAT, "link: %s, packet %lld", tape->path,
                               (long long)tape->packets - 1);
    }
    return header->tick == tick && strcmp(header->instance, instance) == 0
               ? BST_OK
               : fail_mismatch(ctx, link, instance, tick, header);
}

/* Decodes a recorded message. */
static bst_status decode(bst_ctx *ctx, const bst_link *link, const bst_link_header *header,
                         void *payload, int capacity) {
    if (bst_wire_decode(ctx, bst_wire_message_of(header->type), link->tape->payload,
                        (size_t)header->lengths[0], payload, capacity, NULL) == BST_WIRE_GOOD) {
        return BST_OK;
    }
    return bst_fail_prefix(ctx, BST_ERR_FORMAT, "link: %s", link->tape->path);
}

/* Reads the remaining packets of an answer, after the header of the first. */
static bst_status read_answer(bst_ctx *ctx, const bst_link *link, int part, int64_t tick,
                              bst_link_header *header, bst_link_output *outputs, int count) {
    for (int i = 0; i < count; i++) {
        outputs[i].given = false;
        outputs[i].dropped = 0;
    }
    while (header->type != BST_LINK_DONE) {
        int i = 0;
        while (i < count && outputs[i].type != header->type) {
            i++;
        }
        if (i == count) {
            return fail_mismatch(ctx, link, link->parts[part].about.instance, tick, header);
        }
        BST_TRY(decode(ctx, link, header, outputs[i].payload, outputs[i].capacity));
        outputs[i].given = true;
        BST_TRY(get(ctx, link, link->parts[part].about.instance, tick, header));
    }
    return BST_OK;
}

bst_status bst_link_tape_read(bst_ctx *ctx, bst_link *link, int part, int64_t tick,
                              bst_link_output *outputs, int count) {
    bst_link_header header;
    BST_TRY(get(ctx, link, link->parts[part].about.instance, tick, &header));
    return header.type == BST_LINK_STEP
               ? fail_mismatch(ctx, link, link->parts[part].about.instance, tick, &header)
               : read_answer(ctx, link, part, tick, &header, outputs, count);
}

bst_status bst_link_tape_read_more(bst_ctx *ctx, bst_link *link, int part, int64_t tick,
                                   bst_link_output *outputs, int count, bool *more) {
    bst_link_header header;
    bst_link_step step;
    *more = false;
    BST_TRY(get(ctx, link, link->parts[part].about.instance, tick, &header));
    if (header.type != BST_LINK_STEP) {
        *more = true;
        return read_answer(ctx, link, part, tick, &header, outputs, count);
    }
    BST_TRY(decode(ctx, link, &header, &step, 0));
    return step.attempt == 1
               ? BST_OK
               : fail_mismatch(ctx, link, link->parts[part].about.instance, tick, &header);
}

bst_status bst_link_tape_read_ready(bst_ctx *ctx, bst_link *link, int part, int64_t tick,
                                    bool *ready) {
    bst_link_header header;
    bst_link_step step;
    BST_TRY(get(ctx, link, link->parts[part].about.instance, tick, &header));
    if (header.type != BST_LINK_STEP) {
        return fail_mismatch(ctx, link, link->parts[part].about.instance, tick, &header);
    }
    BST_TRY(decode(ctx, link, &header, &step, 0));
    *ready = step.inputs != 0;
    return step.attempt == 0
               ? BST_OK
               : fail_mismatch(ctx, link, link->parts[part].about.instance, tick, &header);
}

bst_status bst_link_keep_drop(bst_ctx *ctx, bst_link *link, const char *instance, int64_t tick,
                              bool *dropped) {
    bst_link_header header;
    bst_link_step step = {.inputs = *dropped, .attempt = 2};
    if (!bst_link_replays(link)) {
        if (link->tape && link->tape->file) {
            record_message(link, instance, tick, BST_LINK_STEP, &step);
        }
        return BST_OK;
    }
    BST_TRY(get(ctx, link, instance, tick, &header));
    if (header.type != BST_LINK_STEP) {
        return fail_mismatch(ctx, link, instance, tick, &header);
    }
    BST_TRY(decode(ctx, link, &header, &step, 0));
    *dropped = step.inputs != 0;
    return step.attempt == 2 ? BST_OK : fail_mismatch(ctx, link, instance, tick, &header);
}
