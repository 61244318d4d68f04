/* Frames of the link in shared memory: a ring of slots that one process writes and others on the
 * same machine read. A slot begins with the message header; pixels follow at BST_LINK_PIXELS_AT. */
#ifndef BST_LINK_SHARED_FRAMES_H
#define BST_LINK_SHARED_FRAMES_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "boresight/status.h"

enum {
    BST_LINK_SLOTS = 2,
    BST_LINK_SLOT_HEADER_AT = 16, /* preceded by: int64 number (-1: being written), int64 bytes */
    BST_LINK_PIXELS_AT = 4096,
};

typedef struct bst_shared_frames bst_shared_frames;

/* Creates the shared memory for images of up to pixel_bytes, accessible to this user only.
 * bst_shared_frames_free removes it. */
bst_status bst_shared_frames_create(bst_ctx *ctx, size_t pixel_bytes,
                                    bst_shared_frames **out) BST_MUST_CHECK;
/* Opens the shared memory of another process for reading. */
bst_status bst_shared_frames_open(bst_ctx *ctx, const char *name, int64_t slot_bytes, int slots,
                                  bst_shared_frames **out) BST_MUST_CHECK;

/* Unmaps the shared memory, removes its name if this side created it, and frees the handle. NULL is
 * allowed. */
void bst_shared_frames_free(bst_shared_frames *frames);

/* Name of the shared memory; it belongs to the handle. */
const char *bst_shared_frames_name(const bst_shared_frames *frames);
/* Size of a slot, bytes. */
int64_t bst_shared_frames_slot_bytes(const bst_shared_frames *frames);

/* Writer: number of the next message, 0, 1, ...; its slot is number modulo slots. */
int64_t bst_shared_frames_next(const bst_shared_frames *frames);

/* Writer: writes the next message to its slot.
 *
 * Given:     header  [header_bytes] link header of the frame, as text
 *            pixels  [bytes] */
void bst_shared_frames_write(bst_shared_frames *frames, const char *header, size_t header_bytes,
                             const void *pixels, size_t bytes);

/* Reader: pixels of a message.
 *
 * Given:     number  number of the message
 *            bytes   size of its pixels
 * Returned:  NULL if its slot holds another message or is shorter
 * Notes:     the writer may overwrite them at any time; after use, bst_shared_frames_holds says if
 *            they were valid. */
const uint16_t *bst_shared_frames_read(const bst_shared_frames *frames, int64_t number,
                                       int64_t bytes);
/* Reader: true if the slot of message `number` still holds it. */
bool bst_shared_frames_holds(const bst_shared_frames *frames, int64_t number);

#endif
