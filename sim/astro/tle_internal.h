/* What the reader of one element set and the reader of files share. */
#ifndef BST_ASTRO_TLE_INTERNAL_H
#define BST_ASTRO_TLE_INTERNAL_H

#include "sim/astro/text_internal.h"
#include "sim/astro/tle.h"

/* Five digits, or Alpha-5: a letter for the two leading digits 10 to 33, without I and O. Reads
 * five characters at text; false when they are no number. */
bool bst_tle_decode_number(const char *text, int *out);

/* As bst_tle_parse; the name is left empty. */
bst_status bst_tle_parse_set(const bst_text_source *source, const bst_text_line *line1,
                             const bst_text_line *line2, bst_elements *out);

#endif
