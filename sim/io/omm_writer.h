/* Writes mean elements as a CCSDS Orbit Mean-elements Message (OMM) in JSON, with the keys of
 * 502.0-B-3, celestrak.org and space-track.org. */
#ifndef BST_IO_OMM_WRITER_H
#define BST_IO_OMM_WRITER_H

#include <stdio.h>

#include "sim/astro/elements.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Writes an array with one OMM, readable by bst_elements_load. Angles in degrees to 1e-8, mean
 * motion in rev/day to 1e-12. `creation_utc`: "YYYY-MM-DDThh:mm:ss"; `comment` may be NULL. An
 * empty name becomes "UNKNOWN"; non-printable or non-ASCII characters become '_'. BST_ERR_IO;
 * BST_ERR_ARGUMENT: elements not finite; BST_ERR_RANGE: epoch that bst_time_from_utc_jd rejects. */
bst_status bst_omm_write(bst_ctx *ctx, FILE *stream, const bst_elements *elements,
                         const char *creation_utc, const char *originator,
                         const char *comment) BST_MUST_CHECK;

#ifdef __cplusplus
}
#endif

#endif
