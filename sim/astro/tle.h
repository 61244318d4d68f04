/* Two-line element sets: parsing, checks, formatting. */
#ifndef BST_ASTRO_TLE_H
#define BST_ASTRO_TLE_H

#include "sim/astro/elements.h"

/* Reads one element set from its two lines (no newline needed, trailing white space allowed).
 * Checked: length 69, printable ASCII, blank separator columns, checksums, equal catalogue numbers,
 * number formats, and the ranges: inclination 0 to 180 degrees, other angles 0 to 360, epoch day
 * within its year (57 to 99: 1957 to 1999; 00 to 56: 2000 to 2056), mean motion above 0. Blanks
 * count as zeros in the eccentricity and as 0 in blank B*, derivative, set and revolution fields.
 * Errors: BST_ERR_FORMAT with line 1 or 2, column, what was found and what was expected; *out is
 * then undefined. Format: Hoots and Roehrich, Spacetrack Report 3; Alpha-5 numbers as
 * space-track.org documents them (A to Z without I and O mean 10 to 33). */
bst_status bst_tle_parse(bst_ctx *ctx, const char *line1, const char *line2,
                         bst_elements *out) BST_MUST_CHECK;

enum {
    BST_TLE_CHARS = 69,
    BST_TLE_NORAD_MOST = 339999 /* greatest catalogue number of a TLE: Alpha-5 */
};

/* Writes one element set as its two lines, which bst_tle_parse reads.
 * Given: set (of any source; its name is not in the lines).
 * Returned: line1, line2 (69 characters and a NUL each), classification U, ephemeris type 0;
 * numbers rounded to the columns: epoch 1e-8 day, angles 1e-4 degree, eccentricity 1e-7, mean
 * motion 1e-8 rev/day. A set that was read from two lines comes back with the same bits.
 * Errors: BST_ERR_RANGE for what the columns cannot hold: catalogue numbers above 339999 (Alpha-5),
 * epochs before 1957 or after 2056, elements too great. Format: as bst_tle_parse. */
bst_status bst_tle_format(bst_ctx *ctx, const bst_elements *set, char line1[BST_TLE_CHARS + 1],
                          char line2[BST_TLE_CHARS + 1]) BST_MUST_CHECK;

/* Parses a catalogue number of five characters: digits, or Alpha-5, a letter for the leading digits
 * 10 to 33, without I and O. False: no number. */
bool bst_tle_decode_number(const char *text, int *out);

typedef bst_elements_options bst_tle_options;

/* Reads a file of 2LE or 3LE sets (mixed; blank lines and # comments allowed; CRLF and a UTF-8 byte
 * order mark allowed; a satellite may come more than once). A line that starts with "1 " or "2 " is
 * part of a set, another line is the name of the next set, cut to 31 characters, "0 " before it
 * dropped. options NULL: all sets, no bad ones. *out: array of *count > 0 sets in the order of the
 * file, freed with free(); NULL and 0 on error. Errors start with "path:line: "; BST_ERR_FORMAT for
 * content, also when there is no set at all; BST_ERR_NOT_FOUND when there is no such file or no set
 * of options->norad; BST_ERR_IO when it cannot be read or is no regular file; BST_ERR_FORMAT
 * also when it is over 256 MiB. */
bst_status bst_tle_load(bst_ctx *ctx, const char *path, const bst_tle_options *options,
                        bst_elements **out, int *count) BST_MUST_CHECK;

/* As bst_tle_load, from memory: `bytes` bytes at data (any bytes, no terminator needed); `name`:
 * file name for messages. */
bst_status bst_tle_read_buffer(bst_ctx *ctx, const char *name, const char *data, size_t bytes,
                               const bst_tle_options *options, bst_elements **out,
                               int *count) BST_MUST_CHECK;

#endif
