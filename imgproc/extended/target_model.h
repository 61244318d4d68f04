/* A model of the target on board: where its lit and visible surfaces end in an image. */
#ifndef BST_IMGPROC_EXTENDED_TARGET_MODEL_H
#define BST_IMGPROC_EXTENDED_TARGET_MODEL_H

#include <stdbool.h>

#include "boresight/status.h"
#include "boresight/vec.h"
#include "imgproc/extended/outline.h"

/* Directions in which outlines are compared: multiples of 2 pi / BST_TARGET_DIRECTIONS from +x
 * towards +y. */
enum { BST_TARGET_DIRECTIONS = 36 };

/* A model with its work memory; for one thread. */
typedef struct bst_target_model bst_target_model;

/* Reads a model.
 *
 * Given:     path  JSON or a mesh, as for bst_satellite_load
 * Returned:  *out  NULL on error
 * Errors:    those of bst_satellite_load; BST_ERR_CONFIG for a joint that turns toward the Earth,
 *            by a table, by a burn or at a rate: its angle is not known on board
 * Ownership: free *out with bst_target_model_free */
bst_status bst_target_model_load(bst_ctx *ctx, const char *path,
                                 bst_target_model **out) BST_MUST_CHECK;
/* Frees a model; NULL is allowed. */
void bst_target_model_free(bst_target_model *model);

/* Radius of a sphere about the body's origin that contains all parts, m. */
double bst_target_model_radius_m(const bst_target_model *model);

/* How a frame sees the target. Local axes: z towards the middle of the outline, px of the tangent
 * plane: (X / Z) / scale_rad. */
typedef struct bst_target_sight {
    bst_quat q_local_from_gcrf;
    bst_vec3 sun_local; /* unit, to the Sun */
    double scale_rad;   /* angle of a px */
    double full_e;      /* signal of a px of BRDF times cosine of incidence 1 / sr, e- */
    double least_e;     /* signal of a px from which a surface is seen */
    double support_px[BST_TARGET_DIRECTIONS]; /* measured outline: farthest along each direction */
    double size_px;                           /* its largest extent */
    double model_sigma; /* standard deviation of the model's dimensions, share of the size */
} bst_target_sight;

/* Where the target is supposed to be. */
typedef struct bst_target_pose {
    bst_quat q_body_from_gcrf;
    double x_px, y_px; /* centre of mass, local */
    double depth_m;    /* of the centre of mass along local z */
    unsigned dimming;  /* below BST_TARGET_DIMMINGS: which grazing surfaces are not seen */
    int without;       /* 1 to bst_target_model_lacks: a part or material that is not seen; 0: none;
                          BST_TARGET_WHOLE: all is seen, lit or not */
} bst_target_pose;

/* Assumptions on surfaces at grazing angles, which an error of the attitude by a degree turns away:
 * bit 0 set, those are not seen that are seen edge on; bit 1, those in grazing light. */
enum { BST_TARGET_DIMMINGS = 4 };

/* See bst_target_pose.without. */
enum { BST_TARGET_WHOLE = -1 };

/* Parts and materials that may be darker than their reflectance says, at most. */
enum { BST_TARGET_LACKS = 32 };

/* Number of parts and materials, one of which may be darker than its reflectance says: 1 to
 * BST_TARGET_LACKS. */
int bst_target_model_lacks(const bst_target_model *model);

/* Predicted outline: farthest lit, visible point of the model along each direction. */
typedef struct bst_target_outline {
    bst_mat3 local_from_body;
    bst_vec3 centre_m;                       /* of mass, local axes */
    bst_vec3 point_m[BST_TARGET_DIRECTIONS]; /* body frame */
    double support_px[BST_TARGET_DIRECTIONS];
} bst_target_outline;

/* Predicts the outline.
 *
 * Returned:  false: nothing is lit and visible, or the target is not in front of the camera
 * Notes:     surfaces that face the Sun and the observer, less what other parts hide from either
 *            (bst_pose_unshadowed, with parallel rays), in perspective. A surface is left out whose
 *            light by its reflectance is below sight->least_e, or a multiple of it with
 *            pose->dimming. */
bool bst_target_model_predict(bst_target_model *model, const bst_target_sight *sight,
                              const bst_target_pose *pose, bst_target_outline *out);

#endif
