/* Table of object states per frame from another program: at start and end of each exposure. */
#ifndef BST_ASTRO_STATE_TABLE_H
#define BST_ASTRO_STATE_TABLE_H

#include "boresight/vec.h"
#include "sim/astro/time.h"

/* The states of one file; immutable, shareable between threads. */
typedef struct bst_state_table bst_state_table;

/* Reads a file of comma-separated values with a header row (docs/reference/file_formats.md,
 * "Injected states"). Columns, in any order: object; start_s and end_s (seconds after `epoch`) or
 * start_utc and end_utc; start_x_m, _y_m, _z_m, start_vx_mps, _vy_mps, _vz_mps and the same with
 * end_. One row per object and frame; an object's frames come in the order of time and do not
 * overlap. Blank lines and lines that start with # are left out. *out is freed with
 * bst_state_table_free; NULL on error. Messages start with "path:line: ". BST_ERR_FORMAT for
 * content, also when the file is over 128 MiB; BST_ERR_NOT_FOUND when there is none; BST_ERR_IO
 * when it cannot be read or is no regular file; BST_ERR_MEMORY. */
bst_status bst_state_table_load(bst_ctx *ctx, const char *path, bst_time epoch,
                                bst_state_table **out) BST_MUST_CHECK;

/* As bst_state_table_load, from memory: `bytes` bytes at data (any bytes, no terminator needed);
 * `name`: file name for messages. */
bst_status bst_state_table_read_buffer(bst_ctx *ctx, const char *name, const char *data,
                                       size_t bytes, bst_time epoch,
                                       bst_state_table **out) BST_MUST_CHECK;

/* An object's states in one frame, seconds after the epoch. */
typedef struct bst_state_table_frame {
    const char *object; /* borrowed for the call; at most 63 bytes */
    int64_t number;     /* increasing; for messages */
    double start_s, end_s;
    bst_vec3 start_position_m, start_velocity_mps, end_position_m, end_velocity_mps;
} bst_state_table_frame;

/* Creates a table from states in memory. BST_ERR_FORMAT: none, or frames of an object overlap or
 * are not in order of time. */
bst_status bst_state_table_create(bst_ctx *ctx, const char *name,
                                  const bst_state_table_frame *frames, int64_t count,
                                  bst_state_table **out) BST_MUST_CHECK;

void bst_state_table_free(bst_state_table *injected); /* NULL allowed */

/* Number of objects of a table. */
int bst_state_table_object_count(const bst_state_table *injected);

/* Name of an object; it belongs to the table.
 *
 * Given:     object  index, 0 to one less than the number of objects */
const char *bst_state_table_object_name(const bst_state_table *injected, int object);

/* Finds an object by name; "": the only object. BST_ERR_NOT_FOUND lists the objects. */
bst_status bst_state_table_find(bst_ctx *ctx, const bst_state_table *injected, const char *name,
                                int *object) BST_MUST_CHECK;

/* Start of the object's first frame and end of its last frame, seconds after the epoch. */
void bst_state_table_span(const bst_state_table *injected, int object, double *start_s,
                          double *end_s);

/* State `seconds` after the epoch in the file's axes, m and m/s: the cubic that has the position
 * and velocity of both ends, within a frame and from a frame's end to the start of the next; the
 * velocity is its derivative. Where a frame starts as the one before it ends, its own state holds.
 * BST_ERR_NUMERIC outside the span by more than 1 us, with the span. O(log n). */
bst_status bst_state_table_state(bst_ctx *ctx, const bst_state_table *injected, int object,
                                 double seconds, bst_vec3 *position_m,
                                 bst_vec3 *velocity_mps) BST_MUST_CHECK;

#endif
