/* Reads and interpolates CCSDS Orbit Ephemeris Messages (OEM, KVN; 502.0-B-1 to -3). */
#ifndef BST_ASTRO_OEM_H
#define BST_ASTRO_OEM_H

#include "sim/astro/sky_clock.h"

/* The states of one OEM file; immutable, shareable between threads. */
typedef struct bst_oem bst_oem;

/* Reads a file of any number of segments and objects. Every segment needs OBJECT_NAME, OBJECT_ID,
 * CENTER_NAME (EARTH), REF_FRAME, TIME_SYSTEM, START_TIME, STOP_TIME and a state;
 * USEABLE_START_TIME and USEABLE_STOP_TIME narrow its span. Read are
 * - REF_FRAME GCRF, ICRF, EME2000 (also J2000; the frame bias is taken off), TEME (of date) and
 *   ITRF of any year, whose differences of centimetres are ignored;
 * - TIME_SYSTEM UTC, TAI, TT, TDB, GPS; dates by calendar or day of the year;
 * - INTERPOLATION HERMITE, LAGRANGE or LINEAR with INTERPOLATION_DEGREE 1 to 31; HERMITE of degree
 *   7 where the file says nothing, degree 7 where it says only the method.
 * Accelerations and covariances are checked for their form, not used; COMMENTs may stand anywhere.
 * Epochs must rise within a segment, and the usable spans of one object's segments must not overlap
 * but at an instant. Rows that end more than their largest step before STOP_TIME, or begin as much
 * after START_TIME, are an error: the file is truncated.
 *
 * *out is freed with bst_oem_free; NULL on error. Messages start with "path:line: ". BST_ERR_FORMAT
 * for content, also when the file is over 256 MiB; BST_ERR_NOT_FOUND when there is none; BST_ERR_IO
 * when it cannot be read or is no regular file; BST_ERR_MEMORY. */
bst_status bst_oem_load(bst_ctx *ctx, const char *path, bst_oem **out) BST_MUST_CHECK;

/* As bst_oem_load, from memory: `bytes` bytes at data (any bytes, no terminator needed); `name`:
 * file name for messages. */
bst_status bst_oem_read_buffer(bst_ctx *ctx, const char *name, const char *data, size_t bytes,
                               bst_oem **out) BST_MUST_CHECK;

void bst_oem_free(bst_oem *oem); /* NULL allowed */

/* Number of objects; objects are distinguished by name and identifier, in file order. */
int bst_oem_object_count(const bst_oem *oem);

/* OBJECT_NAME of an object; it belongs to the ephemeris.
 *
 * Given:     object  index, 0 to one less than the number of objects */
const char *bst_oem_object_name(const bst_oem *oem, int object);

/* OBJECT_ID of an object (international designator); it belongs to the ephemeris.
 *
 * Given:     object  index, 0 to one less than the number of objects */
const char *bst_oem_object_id(const bst_oem *oem, int object);

/* Finds the object with OBJECT_NAME or OBJECT_ID `name`; "": the only object. BST_ERR_NOT_FOUND
 * lists the objects. */
bst_status bst_oem_find(bst_ctx *ctx, const bst_oem *oem, const char *name,
                        int *object) BST_MUST_CHECK;

/* First and last time at which the object has a state; gaps between segments are possible. */
void bst_oem_span(const bst_oem *oem, int object, bst_time *start, bst_time *stop);

/* True if the object has a state at all times from `from` to `to`. */
bool bst_oem_covers(const bst_oem *oem, int object, bst_time from, bst_time to);

/* State at t in GCRF, m and m/s: position interpolated by the method and in the frame of the file,
 * and its time derivative. HERMITE of degree d takes (d + 1) / 2 rows, rounded up and at least two,
 * with their velocities; LAGRANGE takes d + 1 rows, positions only. Fewer rows in the segment: all
 * of them, and the lower degree that they allow. The rows are those around t, centred as far as the
 * segment's ends permit; the path is continuous. Where two segments meet, the later one holds.
 * `clock` turns TEME and ITRF; NULL does where the file is in neither (else BST_ERR_ARGUMENT). The
 * TEME and GCRF axes' own rotation against each other is left out of velocities, as in frames.h.
 * BST_ERR_NUMERIC outside the usable spans by more than 1 us, with the span; BST_ERR_RANGE from the
 * clock. O(log n); no state is kept. Newton's divided differences with repeated nodes: Stoer and
 * Bulirsch, Introduction to Numerical Analysis, section 2.1.5. */
bst_status bst_oem_state(bst_ctx *ctx, const bst_oem *oem, int object, bst_sky_clock *clock,
                         bst_time t, bst_vec3 *position_m, bst_vec3 *velocity_mps) BST_MUST_CHECK;

#endif
