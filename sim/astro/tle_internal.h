/* What the reader of one element set and the reader of files share. */
#ifndef BST_ASTRO_TLE_INTERNAL_H
#define BST_ASTRO_TLE_INTERNAL_H

#include "sim/astro/text_internal.h"
#include "sim/astro/tle.h"

/* As bst_tle_parse; the name is left empty. */
bst_status bst_tle_parse_set(const bst_text_source *source, const bst_text_line *line1,
                             const bst_text_line *line2, bst_elements *out);

#endif
