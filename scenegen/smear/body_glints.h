/* Times at which the light of a turning body changes quickly: between them few poses do. */
#ifndef BST_SCENEGEN_SMEAR_BODY_GLINTS_H
#define BST_SCENEGEN_SMEAR_BODY_GLINTS_H

#include "sim/world/scene/source_body.h"

/* Glints of an exposure, and times at which a facet turns into the light or the view, at most. */
enum { BST_BODY_GLINTS_MAX = 32, BST_BODY_KINKS_MAX = 16 };

/* Times about which poses must be close. */
typedef struct bst_body_glints {
    bst_glint items[BST_BODY_GLINTS_MAX + BST_BODY_KINKS_MAX]; /* fractions of the exposure */
    int count;
    double lost; /* widths of those without room, fractions of the exposure */
} bst_body_glints;

/* Surfaces of a body that may glint; zero-initialise, free `items`. */
typedef struct bst_body_glint_list {
    bst_glint_surface *items;
    int count;
} bst_body_glint_list;

/* Lists the surfaces of a satellite that may glint. BST_ERR_MEMORY. */
bst_status bst_body_glints_list(bst_ctx *ctx, const bst_satellite *satellite,
                                bst_body_glint_list *out) BST_MUST_CHECK;

/* Finds the glints of an exposure.
 *
 * Given:     turn_rad  rotation of the body and its joints in the exposure
 *            pose      work memory; its joints are turned
 * Returned:  *out  if there are too many, those are left out that others have poses for; then what
 *                   the ends of the exposure ask for, which comes last, and then the widest */
void bst_body_glints_find(const bst_scene_source *source, const bst_body_glint_list *list,
                          double turn_rad, bst_satellite_pose *pose, bst_body_glints *out);

/* Adds what the ends of an exposure that cut a glint, or pass it by at a few of its widths, ask of
 * the poses: up to `room` in all. */
void bst_body_glints_cut(bst_body_glints *glints, int room);

/* Finds the times at which a plane facet turns into the light or out of it, or into the view: there
 * the slope of its light changes, which the midpoint rule with N steps misses by 1 / (8 N^2) of
 * that. In models with more than 1,024 facets they are not looked for.
 *
 * Given:     turn_rad   as bst_body_glints_find
 *            least_rad  least change of slope that counts, per exposure
 *            pose       work memory
 * Returned:  *glints    with the largest kinks added as glints that make poses close enough
 * Value:     changes of slope of the others together, rad */
double bst_body_kinks_find(const bst_scene_source *source, double turn_rad, double least_rad,
                           bst_satellite_pose *pose, bst_body_glints *glints);

#endif
