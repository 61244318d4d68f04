/* Smear of an exposure: node tables shared by the stars, separate ones for moving sources, and the
 * level of detail of each source. */
#ifndef BST_SCENEGEN_SMEAR_SMEAR_H
#define BST_SCENEGEN_SMEAR_SMEAR_H

#include <stdbool.h>

#include "scenegen/fourier/fourier_grid.h"
#include "scenegen/kernels/scene_shared.h"
#include "scenegen/smear/error_budget.h"
#include "sim/core/parallel.h"
#include "sim/world/scene/field.h"

typedef struct bst_smear bst_smear;

/* Track of the stars. */
typedef enum bst_smear_star_motion {
    BST_STAR_MOTION_AUTO,   /* the cheapest that meets the tolerance */
    BST_STAR_MOTION_SINGLE, /* all follow the star at the boresight, as an image shift */
    BST_STAR_MOTION_MULTI   /* each star its own */
} bst_smear_star_motion;

typedef struct bst_smear_options {
    double tolerance_sigma; /* image error of a source in any pixel, in that pixel's sigma */
    int taps;               /* longest stamp, px */
    /* stamps: error of the profile law for nodes as wide as the PSF, relative to the peak, and the
     * largest widening it supports, PSF variances (scenegen/stamp/profile_law.h); 0: none */
    double law_error, law_widest;
    bst_smear_star_motion motion;
    int temporal_oversample; /* 0: by the tolerance; else number of equal parts of the exposure */
    bool penumbrae;          /* shadows of parts on parts are those of the Sun's disc */
    int stamp_radius_px;     /* 0: by the tolerance; else of all stamps */
    /* non-Gaussian PSF, else 0: Gaussians with the same node sensitivity and the same peak pixel
     * share */
    double node_sigma_px, share_sigma_px;
    double smoothed_variance_px2; /* as in bst_fourier_band; 0: that of node_sigma_px */
    double grid_per_px;           /* least grid samples per px */
    double pixel_part[BST_PIXEL_PARTS]
                     [3]; /* of the PSF as in bst_smear_node_aim, by binning from 1 on */
    const bst_psf_sensitivity *sensitivity; /* of that PSF, unbinned, lent; NULL: unknown */
    double widest;      /* largest node widening, PSF variances; 0: as much as nodes allow */
    bst_parallel *pool; /* threads that share the work; lent; NULL: the caller's alone */
    int body_threads;   /* without a pool: for bodies that turn; 0: one per processor */
} bst_smear_options;

/* Creates the smear of a camera.
 *
 * Given:     camera   copied
 *            options  copied; zero members are the defaults
 * Returned:  *out  to be freed with bst_smear_free, after an error too, if it is not NULL
 * Errors:    BST_ERR_MEMORY */
bst_status bst_smear_create(bst_ctx *ctx, const bst_camera *camera,
                            const bst_smear_options *options, bst_smear **out) BST_MUST_CHECK;
/* Frees a smear; NULL is allowed. */
void bst_smear_free(bst_smear *smear);

/* Exposure for which sources are rendered. */
typedef struct bst_smear_frame {
    const bst_los_track *track; /* must stay valid until the frame's last source */
    bst_window window;          /* on the sensor */
    double margin_px; /* distance from which a source outside the window can still light it */
    int sources;      /* expected number */
    int binning;      /* of the read-out pixels, 1 or more */
    double dark_variance_e2;  /* noise variance of a dark pixel: background, dark and read noise */
    double brightest_e_per_s; /* of the stars */
    /* to share the work among threads; NULL: each source when it is asked for */
    const bst_scene_source *list; /* [sources] */
    double aim;                   /* of the first bst_smear_restart; 0: 1 */
} bst_smear_frame;

/* Begins an exposure: attitude track, window and sources.
 *
 * Given:     frame  its arrays must outlive the exposure
 * Errors:    BST_ERR_MEMORY */
bst_status bst_smear_begin(bst_ctx *ctx, bst_smear *smear,
                           const bst_smear_frame *frame) BST_MUST_CHECK;

/* Restarts the sources of the frame, aiming at `aim` (> 0; above 1: coarser) of the tolerance. */
void bst_smear_restart(bst_smear *smear, double aim);

/* Predicts errors for a finer grid, from the frame's next restart to its end.
 *
 * Given:     per_px  least grid samples per px */
void bst_smear_refine_grid(bst_smear *smear, double per_px);

/* True if the frame's stars follow one track as an image shift. */
bool bst_smear_single(const bst_smear *smear);

/* Chooses nodes and stamp of a source.
 *
 * Returned:  *visible  false if the source gives the window no light (occulted, behind the camera,
 *                      too far off); *out is then unchanged
 *            *out      record, with first_block 0 */
bst_status bst_smear_source(bst_ctx *ctx, bst_smear *smear, const bst_scene_source *source,
                            bst_kernel_source_record *out, bool *visible) BST_MUST_CHECK;

/* What bst_smear_source and the calls about the latest source return. */
typedef struct bst_smear_result {
    bool known, visible, leaves;
    bst_kernel_source_record record;
    double peak_e, read_e, presence, gap_px, widening_px2;
    bst_error_budget_source error;
} bst_smear_result;

/* Computes several sources of the frame at a time with the options' pool: those that need nothing
 * but what was computed at the beginning; the others stay unknown. Without a pool all do.
 *
 * Given:     list  [count], the frame's sources
 * Returned:  out   [count]
 * Errors:    BST_ERR_MEMORY */
bst_status bst_smear_sources(bst_ctx *ctx, bst_smear *smear, const bst_scene_source *list,
                             int count, bst_smear_result *out) BST_MUST_CHECK;
/* True if the options have a pool of several threads. */
bool bst_smear_has_threads(const bst_smear *smear);
/* Makes a known source the latest one, as bst_smear_source does; *visible and *out as there. */
void bst_smear_recall(bst_smear *smear, const bst_smear_result *result,
                      bst_kernel_source_record *out, bool *visible);

/* Largest expected electrons of the latest source in a pixel. */
double bst_smear_last_peak_e(const bst_smear *smear);

/* Largest expected electrons of the latest source in a read-out pixel, if the window contains it.
 */
double bst_smear_last_read_e(const bst_smear *smear);
/* Share of that source's errors that reaches the window: 1 unless it stays beside it. */
double bst_smear_last_presence(const bst_smear *smear);
/* Distance of that source from the window, px, if the share is below 1. */
double bst_smear_last_gap_px(const bst_smear *smear);
/* Largest mean widening of that source's nodes at one place, px^2. */
double bst_smear_last_widening_px2(const bst_smear *smear);
/* True if that source may at times be further from the window than margin_px. */
bool bst_smear_last_leaves(const bst_smear *smear);

/* Predicted image error of the latest source: at most tolerance_sigma in its worst pixel, unless
 * the finest level does not reach it or another setting prevents it. Not predicted with
 * temporal_oversample. */
const bst_error_budget_source *bst_smear_last_error(const bst_smear *smear);

/* Motion of the frame's stars. */
bst_error_budget_motion bst_smear_motion(const bst_smear *smear);

/* Node table of the frame so far: *blocks blocks of BST_TABLE_ROWS x BST_BLOCK floats. */
const float *bst_smear_table(const bst_smear *smear, int *blocks);

#endif
