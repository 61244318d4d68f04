/* Reads CCSDS Attitude Ephemeris Messages (AEM, KVN; 504.0-B-1 and -2). */
#ifndef BST_ASTRO_AEM_H
#define BST_ASTRO_AEM_H

#include <stdbool.h>
#include <stddef.h>

#include "boresight/vec.h"
#include "sim/astro/time.h"

/* An attitude at a time. */
typedef struct bst_attitude_row {
    double seconds; /* after an epoch */
    bst_quat q_body_from_gcrf;
} bst_attitude_row;

/* True if a text begins as an AEM in KVN: with CCSDS_AEM_VERS, after blank lines and comments. */
bool bst_aem_is(const char *data, size_t bytes);

/* Reads the attitudes of one object.
 *
 * Given:     name    of the file, for messages
 *            data    [bytes] its text
 *            object  OBJECT_NAME or OBJECT_ID; "": the only object of the file
 *            epoch   reference of the times
 * Returned:  *rows   [*count] seconds that do not descend; two equal ones where segments meet
 * Errors:    BST_ERR_FORMAT with file and line, what was found and what is allowed;
 *            BST_ERR_NOT_FOUND without the object; BST_ERR_MEMORY
 * Ownership: free *rows with free; NULL on error
 * Notes:     read are ATTITUDE_TYPE QUATERNION, EULER_ANGLE (both also with rates or derivatives,
 *            which are checked for their form only) and SPIN; TIME_SYSTEM UTC, TAI, TT, TDB, GPS;
 *            one of the frames GCRF, ICRF, EME2000 (J2000), the other one SC_BODY or SC_BODY_n.
 *            Versions 1.0 (ATTITUDE_DIR, QUATERNION_TYPE) and 2.0. Rows of a spin stand closer than
 *            half a turn. USEABLE_... and INTERPOLATION_... are checked for their place only.
 * Reference: CCSDS 504.0-B-1 (2008), 504.0-B-2 (2024). A CCSDS quaternion turns the frame: its
 *            conjugate turns coordinates. */
bst_status bst_aem_read(bst_ctx *ctx, const char *name, const char *data, size_t bytes,
                        const char *object, bst_time epoch, bst_attitude_row **rows,
                        int *count) BST_MUST_CHECK;

#endif
