/* Writes mean elements as a CCSDS Orbit Mean-elements Message in JSON, with the keys of 502.0-B-3
 * and as celestrak.org and space-track.org deliver them. */
#ifndef BST_IO_OMM_WRITER_H
#define BST_IO_OMM_WRITER_H

#include <stdio.h>

#include "sim/astro/elements.h"

#ifdef __cplusplus
extern "C" {
#endif

/* One message, in an array: what bst_elements_load reads. Angles in degrees to 1e-8, mean motion in
 * rev/day to 1e-12. `creation_utc` is "YYYY-MM-DDThh:mm:ss"; `comment` may be NULL. An empty name
 * becomes "UNKNOWN"; what is not printable ASCII in a text is written as '_'. BST_ERR_IO when the
 * stream has an error; BST_ERR_ARGUMENT for elements that are not finite; BST_ERR_RANGE for an
 * epoch that bst_time_from_utc_jd refuses. */
bst_status bst_omm_write(bst_ctx *ctx, FILE *stream, const bst_elements *elements,
                         const char *creation_utc, const char *originator,
                         const char *comment) BST_MUST_CHECK;

#ifdef __cplusplus
}
#endif

#endif
