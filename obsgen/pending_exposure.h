/* Truth of an exposure until its detections are generated. Internal to the module. */
#ifndef BST_OBSGEN_PENDING_EXPOSURE_H
#define BST_OBSGEN_PENDING_EXPOSURE_H

#include "boresight/archive.h"
#include "boresight/messages.h"
#include "obsgen/generator.h"
#include "obsgen/model/crlb_table.h"
#include "obsgen/model/response.h"
#include "sim/world/scene/los_track.h"

typedef struct bst_obsgen_pending {
    int64_t exposure_id; /* -1: none */
    bst_truth *truth;
    int32_t *ghost; /* [truth->count]: index of the camera's ghost that an item is; -1: of none */
    int room;       /* items of `truth` and `ghost`; 0 with NULL */
    double sigma_px;
    bst_response response; /* valid if `own_response` */
    bst_crlb_table image_bound, onboard_bound;
    bool own_response;             /* one of the PSFs is not Gaussian */
    double *path_x_px, *path_y_px; /* of a star at the window's centre, minus its mean */
    int path_count, path_room;
} bst_obsgen_pending;

/* Frees the memory of a pending exposure; the struct belongs to the caller. */
void bst_obsgen_pending_free(bst_obsgen_pending *pending);

/* Makes room for the truth of a number of sources and their ghosts.
 *
 * Errors:    BST_ERR_MEMORY */
bst_status bst_obsgen_pending_reserve(bst_ctx *ctx, bst_obsgen_pending *pending,
                                      int count) BST_MUST_CHECK;

/* Makes room for a path of a number of steps.
 *
 * Errors:    BST_ERR_MEMORY */
bst_status bst_obsgen_pending_reserve_path(bst_ctx *ctx, bst_obsgen_pending *pending,
                                           int count) BST_MUST_CHECK;

/* Sets the path of a star at the window's centre, at even steps: the plant's steps within the
 * exposure. The path is left empty if the star leaves the camera's view.
 *
 * Given:     track   attitude from lead_s before the exposure to lead_s after it
 * Errors:    BST_ERR_MEMORY */
bst_status bst_obsgen_pending_set_path(bst_ctx *ctx, bst_obsgen_pending *pending,
                                       const bst_camera *camera, const bst_los_track *track,
                                       double lead_s, bst_window window) BST_MUST_CHECK;

/* Frame of the generator for a pending exposure, whose memory it lends; what telemetry says of the
 * camera's motion is 0. */
bst_generator_frame bst_obsgen_pending_frame(const bst_obsgen_pending *pending,
                                             const bst_exposure *exposure, double tick_rate_hz);

/* Saves or restores a pending exposure, for bst_module_desc.archive.
 *
 * Given:     ghosts  number of ghosts of the camera; those that were saved beyond it have no light
 * Errors:    BST_ERR_FORMAT for a damaged truth, ghost or path; BST_ERR_MEMORY */
bst_status bst_obsgen_pending_archive(bst_obsgen_pending *pending, int ghosts,
                                      bst_archive *archive) BST_MUST_CHECK;

#endif
