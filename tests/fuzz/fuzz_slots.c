/* The reader of frames in shared memory on any bytes in it. Input: bytes of a slot (8 bytes),
 * number of slots (1), number of the message (8) and bytes of its pixels (8) as a peer is given
 * them, then the memory. What is accepted lies in the memory, aligned, and its header is read. */
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

#include "sim/link/packet.h"
#include "sim/link/shared_frames.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes);

enum { ARGUMENTS = 25 };

static void read_slot(bst_shared_frames *frames, int64_t number, int64_t bytes) {
    const uint16_t *pixels = bst_shared_frames_read(frames, number, bytes);
    uint64_t sum = 0;
    for (int64_t i = 0; pixels && i < bytes / 2; i++) {
        sum += pixels[i];
    }
    if (!pixels || sum > UINT64_MAX / 2) {
        return;
    }
    bst_ctx ctx = {0};
    bst_link_header header;
    const char *text = (const char *)pixels - BST_LINK_PIXELS_AT + BST_LINK_SLOT_HEADER_AT;
    size_t length = strnlen(text, BST_LINK_PIXELS_AT - BST_LINK_SLOT_HEADER_AT);
    bst_wire_fault fault = bst_link_header_read(&ctx, text, length, &header);
    if ((fault == BST_WIRE_GOOD) != (ctx.message[0] == '\0')) {
        abort(); /* a fault without its reason, or a reason without a fault */
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes) {
    int64_t slot_bytes, number, pixel_bytes;
    if (bytes < ARGUMENTS) {
        return 0;
    }
    memcpy(&slot_bytes, data, 8);
    int slots = data[8];
    memcpy(&number, data + 9, 8);
    memcpy(&pixel_bytes, data + 17, 8);
    data += ARGUMENTS;
    bytes -= ARGUMENTS;
    char name[64];
    snprintf(name, sizeof name, "/boresight-fuzz-%ld", (long)getpid());
    int fd = shm_open(name, O_RDWR | O_CREAT | O_TRUNC, 0600);
    if (fd < 0 || write(fd, data, bytes) != (ssize_t)bytes) {
        fprintf(stderr, "%s: cannot be written\n", name);
        exit(1);
    }
    close(fd);
    bst_ctx ctx;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
    bst_shared_frames *frames = NULL;
    bst_status status = bst_shared_frames_open(&ctx, name, slot_bytes, slots, &frames);
    shm_unlink(name);
    if ((status == BST_OK) != (ctx.message[0] == '\0') || (status == BST_OK) != (frames != NULL) ||
        (frames && (size_t)slot_bytes * (size_t)slots > bytes)) {
        abort(); /* a failure without its reason, or a reason without a failure */
    }
    if (frames) {
        read_slot(frames, number, pixel_bytes);
        read_slot(frames, 0, slot_bytes - BST_LINK_PIXELS_AT);
        bst_shared_frames_free(frames);
    }
    return 0;
}
