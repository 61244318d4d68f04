/* What of an exposure's sources is drawn, how finely, and in which order. */
#ifndef BST_SCENEGEN_SCENE_PLAN_H
#define BST_SCENEGEN_SCENE_PLAN_H

#include "scenegen/crowd.h"
#include "scenegen/fft_light.h"
#include "scenegen/renderer.h"
#include "scenegen/smear.h"

typedef struct bst_scene_plan {
    bst_scene_source *sources;    /* [count] that are drawn, in the order of bst_source_order */
    float (*shares)[BST_SPECTRA]; /* [count] of the PSF's spectra; NULL: there is one */
    int count;
    int blocks;     /* of their nodes */
    int boxes;      /* of the blocks, by groups of BST_BLOCK */
    double *peak_e; /* of all sources of the request: most expected electrons on one pixel */
    bst_scene_source *list; /* scratch */
    int capacity;
} bst_scene_plan;

/* Plans a request with a smear and a crowd, which are begun for it. fft_light: the Fourier path, or
 * NULL where stamps are drawn. most_bytes: of one buffer on the device; BST_ERR_RANGE when the
 * nodes would need more. margin_px: reach of the light of a source. */
bst_status bst_scene_plan_make(bst_ctx *ctx, bst_scene_plan *plan, const bst_camera *camera,
                               bst_smear *smear, bst_crowd *crowd, const bst_fft_light *fft_light,
                               uint64_t most_bytes, double margin_px,
                               const bst_render_request *request) BST_MUST_CHECK;

/* Frees what the plan holds. */
void bst_scene_plan_clear(bst_scene_plan *plan);

/* Bytes on the device of a block's box. */
enum { BST_BOX_BYTES = 4 * (int)sizeof(float) };

#endif
