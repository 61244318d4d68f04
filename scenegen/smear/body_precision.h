/* How finely the image of a body is drawn, and its error. */
#ifndef BST_SCENEGEN_SMEAR_BODY_PRECISION_H
#define BST_SCENEGEN_SMEAR_BODY_PRECISION_H

#include "scenegen/smear/body_glints.h"
#include "scenegen/smear/body_penumbra.h"
#include "scenegen/smear/smear_internal.h"

/* What the poses of an image have in common. */
typedef struct bst_body_image_plan {
    const bst_smear *s;
    const bst_scene_source *source;
    bst_body_times times;                 /* weights with the factors on the light */
    double moved_px, turn_rad, turned_px; /* motion in the exposure */
    double hidden_px;                     /* motion of the Earth's limb across it */
    bst_body_glints glints;
    int glint_count;           /* without those of kinks, which follow */
    double kinks_e;            /* error by kinks without room, electrons */
    double light_e;            /* in a pixel, for which the image is drawn */
    double pose_e;             /* the same of a pose without motion; 0: not known yet */
    int sun_rule;              /* points of the Sun's disc: see body_penumbra.h */
    double curved_px, limb_px; /* see bst_resolved_view */
} bst_body_image_plan;

/* Error of borders of curved surfaces, px, for light_e. */
double bst_body_limb_px(const bst_smear *s, double light_e);

/* Error between parts of curved surfaces, px, for light of curved_e electrons in a pixel. */
double bst_body_curved_px(const bst_smear *s, double curved_e);

/* Side of the cells for the body, px: a power of two of pixels, or less for small bodies.
 *
 * Given:     area_px2    of the image
 *            light_only  see bst_resolved_add_light: all second moments of cells are known
 *            blurred     borders fall on all parts of the cells */
double bst_body_cell_px(const bst_body_image_plan *plan, double area_px2, bool light_only,
                        bool blurred);

/* Chooses the poses of a body that turns, in plan->times.
 *
 * Returned:  *blurred  borders fall on all parts of the cells */
void bst_body_choose_poses(bst_body_image_plan *plan, bst_satellite_pose *pose, bool *blurred);

/* Error by shadows from some points of the Sun's disc, sigma of a pixel. */
double bst_body_shadow_sigma(const bst_body_image_plan *plan, const bst_smear_body *body, int rule);

/* The points of the Sun's disc for an image that is drawn again.
 *
 * Given:     body           as bst_body_set_error left it
 *            allowed_sigma  for the whole image but its nodes
 * Returned:  the quadrature in use, if its error stays within that, or is a small part of it */
int bst_body_choose_sun(const bst_body_image_plan *plan, const bst_smear_body *body,
                        double allowed_sigma);

/* True if edges between facets of almost the same light may go without second moments. */
bool bst_body_even(const bst_body_image_plan *plan);

/* Sets the error of an image but for its nodes, in body->sigma, and plan->pose_e, by the light that
 * it has.
 *
 * Returned:  *light_e   most light in a pixel
 *            *curved_e  the same of surfaces that are curved or have round borders */
void bst_body_set_error(bst_body_image_plan *plan, bst_smear_body *body, double *light_e,
                        double *curved_e);

/* Error of the next drawing of an image but for its nodes, at least: of the light that it has, with
 * as many parts of curved surfaces as there may be, and of one pose with its cells. */
double bst_body_least_error(const bst_body_image_plan *next, const bst_smear_body *body,
                            double curved_e);

#endif
