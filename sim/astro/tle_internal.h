/* Internal functions of the TLE readers. */
#ifndef BST_ASTRO_TLE_INTERNAL_H
#define BST_ASTRO_TLE_INTERNAL_H

#include "sim/astro/tle.h"
#include "sim/core/text_reader.h"

/* Parses a set as bst_tle_parse; the name stays empty. */
bst_status bst_tle_parse_set(const bst_text_source *source, const bst_text_line *line1,
                             const bst_text_line *line2, bst_elements *out);

#endif
