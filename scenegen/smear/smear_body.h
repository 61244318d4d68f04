/* Sources with the model of a satellite: the image of the body during the exposure. */
#ifndef BST_SCENEGEN_SMEAR_SMEAR_BODY_H
#define BST_SCENEGEN_SMEAR_SMEAR_BODY_H

#include "scenegen/smear/body_glints.h"
#include "scenegen/smear/body_poses.h"
#include "sim/world/scene/source_body.h"

struct bst_smear;

/* The image of one source's body, with its work memory. */
typedef struct bst_smear_body {
    const bst_satellite *satellite;
    uint32_t id; /* of the source */
    bst_satellite_pose *pose;
    bst_resolved *image, *trial; /* trial: of single poses, for their light */
    bst_body_poses others;       /* for images of many poses */
    int64_t frame;               /* for which the image is made; 0: none */
    double cell_px;
    double x0, y0;  /* origin of the image's positions, px from the boresight */
    bool blurred;   /* borders fall on all parts of the cells */
    bool penumbrae; /* shadows from several points of the Sun's disc */
    bool one_pose;  /* the image of mid-exposure, to be moved along the path */
    double sigma;   /* error of the image but for its nodes, sigma of a pixel */
    bst_body_glint_list glints;
    bool empty; /* no image */
} bst_smear_body;

/* The bodies of a camera's sources; zero-initialise it. */
typedef struct bst_smear_bodies {
    bst_smear_body *items;
    int count, capacity;
    bst_parallel *pool; /* for images of many poses, if the options have none */
} bst_smear_bodies;

/* Frees the memory of the bodies. */
void bst_smear_bodies_clear(bst_smear_bodies *bodies);

/* Radius of a source's disc, or of its body about its origin, px at the boresight; 0: a point. */
double bst_smear_radius_px(const struct bst_smear *smear, const bst_scene_source *source);

#endif
