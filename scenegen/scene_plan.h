/* What of an exposure's sources is drawn, how finely, and in which order. */
#ifndef BST_SCENEGEN_SCENE_PLAN_H
#define BST_SCENEGEN_SCENE_PLAN_H

#include "scenegen/fourier/fourier_render.h"
#include "scenegen/renderer.h"
#include "scenegen/smear/error_budget.h"
#include "scenegen/smear/smear.h"

typedef struct bst_scene_plan {
    bst_kernel_source_record
        *sources;                 /* [count] that are drawn, in the order of bst_source_order */
    float (*shares)[BST_SPECTRA]; /* [count] of the PSF's spectra; NULL: there is one */
    int count;
    int blocks;     /* of their nodes */
    int boxes;      /* of the blocks, by groups of BST_BLOCK */
    bool bounded;   /* by the most nodes: sources are coarser than the tolerance asks for */
    bool fine;      /* on the finer grid of the Fourier path */
    double *peak_e; /* of all sources of the request: most expected electrons on one pixel */
    bst_kernel_source_record *list; /* scratch */
    int capacity;
} bst_scene_plan;

/* More nodes than MOST (or the renderer's max_nodes), beyond a block for each source, are not
 * spent on the tolerance. Where the paths of a slew need more whatever the tolerance is, SLEW times
 * as many are drawn: sources then get what the first plan gave them, or fewer. */
enum { BST_SCENE_MOST_NODES = 1 << 24, BST_SCENE_SLEW = 4 };

typedef struct bst_scene_plan_limits {
    double tolerance_sigma; /* of the frame's predicted error; INFINITY: any will do */
    double margin_px;       /* reach of the light of a source */
    uint64_t bytes;         /* of one buffer on the device */
    long long nodes;        /* as above; 0: BST_SCENE_MOST_NODES */
} bst_scene_plan_limits;

/* Plans a request with a smear and a budget, which are begun for it, so that the predicted error is
 * within the tolerance where the number of nodes and the Fourier path's grid allow it. fourier:
 * the Fourier path, or NULL where stamps are drawn. BST_ERR_RANGE when the coarsest nodes need more
 * than a buffer or than SLEW times the most nodes. */
bst_status bst_scene_plan_make(bst_ctx *ctx, bst_scene_plan *plan, const bst_camera *camera,
                               bst_smear *smear, bst_error_budget *budget,
                               const bst_fourier_render *fourier,
                               const bst_scene_plan_limits *limits,
                               const bst_render_request *request) BST_MUST_CHECK;

/* Frees what the plan holds. */
void bst_scene_plan_clear(bst_scene_plan *plan);

/* Bytes on the device of a block's box. */
enum { BST_BOX_BYTES = 4 * (int)sizeof(float) };

#endif
