/* The Earth's limb before a body that is rendered with its shape. */
#ifndef BST_WORLD_SCENE_BODY_LIMB_H
#define BST_WORLD_SCENE_BODY_LIMB_H

#include "sim/world/scene/source_body.h"

/* Angle by which the Earth's limb has passed the origin of a body: how deep that is behind the
 * Earth, rad; negative: in sight.
 *
 * Given:     u  time as a fraction of the source's exposure
 * Returned:  -INFINITY without a limb (body->limb), before the Earth, and far from the limb
 * Notes:     the WGS-84 ellipsoid without atmosphere, as for points (bst_astro_earth_occults); in
 *            the tangent plane at the body */
double bst_body_limb_behind(const bst_scene_source *source, double u);

/* Attitude and scale of an image without distortion (bst_resolved_view). */
typedef struct bst_body_limb_view {
    bst_quat q_image_from_gcrf; /* apparent directions */
    double scale_rad;           /* angle of a px at the boresight */
} bst_body_limb_view;

/* The region about a body in which the Earth hides it.
 *
 * Given:     u  time as a fraction of the source's exposure
 * Returned:  false: none of the body is hidden, or it has no limb (body->limb)
 * Notes:     the region ends with chords of the limb, at most 1e-5 px or 1 / 4096 of what the limb
 *            bends within it from the limb. Aberration moves the limb as it does the body, and as
 *            bst_discs_make does the Earth's disc. */
bool bst_body_limb_hidden(const bst_scene_source *source, double u, const bst_body_limb_view *view,
                          bst_resolved_hidden *out);

/* What the Earth's limb does to a body during an exposure. */
typedef enum bst_body_limb_kind {
    BST_BODY_LIMB_FAR,  /* nothing: the body is before the Earth, or beside it */
    BST_BODY_LIMB_CUTS, /* it hides a part at some time, perhaps, and not all of it always */
    BST_BODY_LIMB_HIDES /* it hides all of it all the time */
} bst_body_limb_kind;

/* What the limb does to the sphere about a body.
 *
 * Given:     source  its path; its body has eye, lag_m and pole, and satellite */
bst_body_limb_kind bst_body_limb_during(const bst_scene_source *source);

#endif
