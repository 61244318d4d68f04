/* The smear of one exposure: node tables that stars share, own ones for what moves by itself, and
 * for each source how finely it is drawn. */
#ifndef BST_SCENEGEN_SMEAR_SMEAR_H
#define BST_SCENEGEN_SMEAR_SMEAR_H

#include <stdbool.h>

#include "scenegen/fourier/fourier_grid.h"
#include "scenegen/kernels/scene_shared.h"
#include "scenegen/smear/error_budget.h"
#include "sim/world/scene/field.h"

typedef struct bst_smear bst_smear;

/* Whose track the stars follow. */
typedef enum bst_smear_star_motion {
    BST_STAR_MOTION_AUTO,   /* the cheapest that meets the tolerance */
    BST_STAR_MOTION_SINGLE, /* all that of the star at the boresight, as a shift of the image */
    BST_STAR_MOTION_MULTI   /* each its own */
} bst_smear_star_motion;

typedef struct bst_smear_options {
    double tolerance_sigma; /* error of a source's image in any pixel, in that pixel's sigma */
    int taps;               /* length of the longest stamp, px */
    /* of stamps: what the profile law misses of nodes as wide as the PSF, over the peak, and the
     * widening up to which it serves, PSF variances (scenegen/stamp/profile_law.h); 0: there is
     * none */
    double law_error, law_widest;
    bst_smear_star_motion motion;
    int temporal_oversample; /* 0: by the tolerance; else so many equal parts of the exposure */
    int stamp_radius_px;     /* 0: by the tolerance; else of all stamps */
    /* for a PSF that is no Gaussian, else 0: those that need nodes as fine, and that put as much of
     * a point's light in one pixel */
    double node_sigma_px, share_sigma_px;
    double grid_per_px; /* least samples per px that its nodes are spread on */
    double pixel_part[BST_PIXEL_PARTS]
                     [3]; /* of it as in bst_smear_node_aim, by binning from 1 on */
    double widest;        /* widening of nodes, PSF variances; 0: as much as nodes may be */
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

/* What sources are drawn for. */
typedef struct bst_smear_frame {
    const bst_los_track *track; /* needed until the frame's last source */
    bst_window window;          /* of the sensor */
    double margin_px;           /* from which a source outside the window can still light it */
    int sources;                /* how many there will be */
    int binning;                /* of the pixels that are read, 1 or more */
    double dark_variance_e2;    /* noise of a dark one: background, dark and read noise */
    double brightest_e_per_s;   /* of the stars */
} bst_smear_frame;

/* Begins an exposure: attitude track, window and sources.
 *
 * Given:     frame  its arrays must outlive the exposure
 * Errors:    BST_ERR_MEMORY */
bst_status bst_smear_begin(bst_ctx *ctx, bst_smear *smear,
                           const bst_smear_frame *frame) BST_MUST_CHECK;

/* Starts again with the sources, aiming at `aim` (0 to 1) of the tolerance. */
void bst_smear_restart(bst_smear *smear, double aim);

/* The frame's stars follow one track as a shift. */
bool bst_smear_single(const bst_smear *smear);

/* Chooses a source's nodes and stamp. *visible is false for one that gives the window no light
 * (occulted, not in front of the camera, a star too far off); *out is then untouched. first_block
 * is left 0. */
bst_status bst_smear_source(bst_ctx *ctx, bst_smear *smear, const bst_scene_source *source,
                            bst_kernel_source_record *out, bool *visible) BST_MUST_CHECK;

/* Largest expected electrons that the latest source gives a pixel. */
double bst_smear_last_peak_e(const bst_smear *smear);

/* Largest expected electrons that the latest source gives a pixel that is read, if the window holds
 * it. */
double bst_smear_last_read_e(const bst_smear *smear);
/* What is left of that source's errors at the window: 1 unless it stays beside it. */
double bst_smear_last_presence(const bst_smear *smear);
/* Whether that source may be further from the window, at times, than margin_px. */
bool bst_smear_last_leaves(const bst_smear *smear);

/* Predicted error of the image of the source given last: in its worst pixel at most tolerance_sigma
 * of that pixel's sigma, unless the brightest level of detail does not reach it or a knob other
 * than the tolerance forbids it. With temporal_oversample errors are not foreseen. */
const bst_error_budget_source *bst_smear_last_error(const bst_smear *smear);

/* How the frame's stars move. */
bst_error_budget_motion bst_smear_motion(const bst_smear *smear);

/* The frame's node table so far: *blocks blocks of BST_TABLE_ROWS x BST_BLOCK floats. */
const float *bst_smear_table(const bst_smear *smear, int *blocks);

#endif
