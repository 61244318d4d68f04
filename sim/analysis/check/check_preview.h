/* What a scenario's numbers look like: the field with its stars at the epoch, and the target over
 * the day that begins there. */
#ifndef BST_ANALYSIS_CHECK_CHECK_PREVIEW_H
#define BST_ANALYSIS_CHECK_CHECK_PREVIEW_H

#include "sim/engine/simulation.h"

struct cJSON;

/* Stars of a field that are listed at most: the brightest. */
enum { BST_CHECK_PREVIEW_STARS = 400 };
/* Parts of the day; states are listed at their ends. */
enum { BST_CHECK_PREVIEW_STEPS = 144 };

/* Adds to each sensor of the figures (bst_check_figures) that has a cue to an object:
 *
 *   sky: {ra_deg, dec_deg, v_limit, total, stars: [[east_deg, north_deg, v_mag]]}: direction of
 *        the target at the epoch, and stars within half a diagonal of the field from there. Places
 *        are those in the tangent plane there. total: of stars down to v_mag_at_snr_5; v_limit: of
 *        those that are listed
 *   day: {step_s, v_mag: [], sunlit_fraction: [], occulted: []}: from the epoch on; ends where a
 *        body has no orbit
 *
 * Given:     figures  of the same scenario
 * Errors:    BST_ERR_MEMORY; those of bst_stars_query
 * Notes:     A state that the orbits do not give ends the day without an error. The field has north
 *            up: the roll of the camera follows from the mount, which does not move here. */
bst_status bst_check_preview(bst_ctx *ctx, const bst_scenario *scenario,
                             const bst_simulation *simulation,
                             struct cJSON *figures) BST_MUST_CHECK;

#endif
