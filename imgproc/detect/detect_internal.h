/* State of the detector (bst_imgproc), shared by its source files. */
#ifndef BST_IMGPROC_DETECT_DETECT_INTERNAL_H
#define BST_IMGPROC_DETECT_DETECT_INTERNAL_H

#include <math.h>

#include "imgproc/calibrate/calibrate_pixels.h"
#include "imgproc/calibrate/pixel_learner.h"
#include "imgproc/extended/silhouette.h"
#include "imgproc/imgproc.h"
#include "imgproc/measure/locate.h"
#include "imgproc/streak/streak_fragments.h"
#include "imgproc/streak/streak_locate.h"
#include "imgproc/streak/streak_motion.h"

struct bst_imgproc {
    bst_camera camera;
    bst_imgproc_config config;
    bst_imgproc_maps maps;
    uint8_t *bad; /* [height_px][width_px]: bad pixels of map and list; NULL: none */
    double electrons_per_s_v0;
    /* [height][width]: signal above the background after the filter has run, e- */
    float *electrons;
    bst_background background;
    bst_filter filter;
    bst_candidates candidates;
    bst_imgproc_locator locator;
    bst_streak_motion streak_motion;
    bst_streak_locator streaks; /* only when config.streak_search_px > 0 */
    bst_streak_fragments fragments;
    bst_parallel *pool;
    int *order, *order_swap, *row;
    uint16_t *cropped; /* pixels of a cropped window */
    /* with config.extended.enabled */
    bst_silhouette_finder finder;
    bst_silhouettes silhouettes; /* of the latest frame */
    uint8_t *silhouette_mask;    /* [height][width] of the latest frame: masked targets */
    uint8_t *masked; /* [height_px][width_px]: `bad` and masked targets; used if there are some */
    /* of the latest frame */
    bst_locate_frame view;
    bst_camera_motion motion;
    bst_path_departure departure;
    double exposure_s, binning, streak_px;
    bool smeared, windowed;
    double followed_sigma_e; /* noise of the flux of a followed streak, e-; 0: none was followed */
    bst_stack_frame left;
    bst_known_psf *known;     /* NULL: Gaussian PSF */
    const bst_pixel_map *map; /* learned bad pixels; NULL: none */
    bst_columns columns;      /* column levels of the latest frame; capacity 0: not measured */
    bst_pixel_shows shows; /* bad-pixel evidence of the latest frame; capacity 0: not collected */
};

/* Memory for the frame's signal above the background; NULL: it is not read, because a frame with
 * too long streaks is not measured. */
static inline float *bst_imgproc_signal_of(const bst_imgproc *ip, const bst_imgproc_frame *frame) {
    return ip->smeared && frame->detections_only ? NULL : ip->electrons;
}

/* Allocates what extended targets need, with config.extended.enabled. BST_ERR_MEMORY. */
bst_status bst_imgproc_open_silhouettes(bst_ctx *ctx, bst_imgproc *ip) BST_MUST_CHECK;
/* Frees it. */
void bst_imgproc_close_silhouettes(bst_imgproc *ip);

/* Searches the frame for extended targets: fills ip->silhouettes and, if some are masked,
 * ip->masked. Returns the map of pixels to leave out: ip->masked or ip->bad. */
const uint8_t *bst_imgproc_find_silhouettes(bst_imgproc *ip, const bst_imgproc_frame *frame,
                                            const bst_camera_motion *motion, double sigma_px,
                                            int saturated_dn);

/* Sets the departure of the camera's path from a quadratic one, and whether it matters to points,
 * in ip->view. */
void bst_imgproc_set_departure(bst_imgproc *ip);
/* Adds the uncertainty of the camera's bend to the covariance of a source's place. */
void bst_imgproc_add_bend_covariance(const bst_camera *camera, const bst_locate_frame *frame,
                                     const bst_imgproc_found *found, bst_detection *detection);
/* Corrects the camera motion by the star streaks that ip->streak_motion has. */
void bst_imgproc_correct_motion(bst_imgproc *ip, double binning, bst_camera_motion *motion);
/* Sets the covariance of the displacement that all star streaks of a frame share.
 *
 * Given:     motion     by telemetry; NULL: unknown, and nothing is set
 *            corrected  by streaks; NULL: they were not measured */
void bst_imgproc_set_shared_shift(const bst_imgproc *ip, const bst_camera_motion *motion,
                                  const bst_camera_motion *corrected, bst_detections *out);

/* Clears the bad-pixel evidence (ip->shows) before a frame. */
void bst_imgproc_begin_shows(bst_imgproc *ip);
/* Adds the bad-pixel evidence of a searched frame, or of a window of it. */
void bst_imgproc_add_shows(bst_imgproc *ip, const bst_imgproc_frame *frame,
                           const bst_imgproc_frame *whole);

/* Electrons of a Poisson charge that is as skewed as electrons after a multiplication register:
 * third cumulant over the second of what one becomes, 1 + p (e - 1), p^2 = excess - 1, e
 * exponential.
 *
 * Given:     excess     bst_camera_excess_noise, 1 or more
 * Reference: Basden, Haniff & Mackay 2003, MNRAS 345, 985 (law of the register) */
static inline double bst_imgproc_charge(double excess) {
    double p = sqrt(excess - 1.0);
    return (1.0 + p * p * (3.0 + 2.0 * p)) / excess;
}

#endif
