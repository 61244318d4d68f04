/* Render plan of an exposure: which sources are rendered, with how many nodes, and in which order.
 */
#ifndef BST_SCENEGEN_SCENE_PLAN_H
#define BST_SCENEGEN_SCENE_PLAN_H

#include "scenegen/fourier/fourier_render.h"
#include "scenegen/renderer.h"
#include "scenegen/smear/error_budget.h"
#include "scenegen/smear/error_meeting.h"
#include "scenegen/smear/smear.h"

typedef struct bst_scene_plan {
    bst_kernel_source_record
        *sources;                 /* [count] rendered sources, in the order of bst_source_order */
    float (*shares)[BST_SPECTRA]; /* [count] shares of the PSF's spectra; NULL: one spectrum */
    int count;
    int blocks;     /* of their nodes */
    int boxes;      /* of the blocks, in groups of BST_BLOCK */
    bool bounded;   /* limited by the number of nodes: coarser than the tolerance requires */
    bool fine;      /* on the finer grid of the Fourier path */
    double *peak_e; /* of all sources of the request: most expected electrons in one pixel */
    bst_kernel_source_record *list; /* [count] the same in the order of the request */
    bst_smear_result *results;      /* work space, if the smear has threads */
    bst_error_meeting *meeting;     /* work space of the predicted error */
    int capacity;
    int binning;
    bool gaussian, distorted; /* the PSF; the camera */
} bst_scene_plan;

/* Limit of the nodes spent on the tolerance, beyond one block per source: MOST, or the renderer's
 * max_nodes. If the paths of a slew need more at any tolerance, up to SLEW times as many are used.
 */
enum { BST_SCENE_MOST_NODES = 1 << 24, BST_SCENE_SLEW = 4 };

typedef struct bst_scene_plan_limits {
    double tolerance_sigma; /* limit of the frame's predicted error; INFINITY: none */
    double margin_px;       /* extent of a source's light */
    uint64_t bytes;         /* largest buffer of the device */
    long long nodes;        /* see above; 0: BST_SCENE_MOST_NODES */
} bst_scene_plan_limits;

/* Plans a request with a smear and an error budget that are started for it. The predicted error is
 * within the tolerance if the number of nodes and the Fourier path's grid permit it.
 *
 * Given:     fourier  Fourier render path; NULL: stamps
 * Errors:    BST_ERR_RANGE if the coarsest nodes need more than a buffer or than SLEW times the
 *            most nodes */
bst_status bst_scene_plan_make(bst_ctx *ctx, bst_scene_plan *plan, const bst_camera *camera,
                               bst_smear *smear, bst_error_budget *budget,
                               bst_fourier_render *fourier, const bst_scene_plan_limits *limits,
                               const bst_render_request *request) BST_MUST_CHECK;

/* Predicted error of the latest request in any pixel, in its sigma; at most that of the budget.
 *
 * Given:     smear, budget  as they are after its planning */
double bst_scene_plan_error_sigma(bst_scene_plan *plan, const bst_smear *smear,
                                  bst_error_budget *budget);

/* Frees the memory of a plan. */
void bst_scene_plan_clear(bst_scene_plan *plan);

/* Bytes of a block's box on the device. */
enum { BST_BOX_BYTES = 4 * (int)sizeof(float) };

#endif
