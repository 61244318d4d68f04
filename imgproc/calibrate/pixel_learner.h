/* Bad-pixel map learned on board: pixels that show a maximum again and again while the sky moves.
 *
 * A defective pixel is distinguished from three other causes of a maximum by sequential likelihood
 * ratios, one against each: light of the sky, which leaves the pixel when the camera turns; a
 * radiation hit, which does not return; and light at rest in the frame, as of a target that the
 * camera follows, whose image is a PSF. The sum over frames of log p1 / p0 has two kinds of terms:
 *
 * - Return. A pixel that showed k maxima in n looks shows another with P = (k + 1) / (n + 2), a
 * good one with the share of the frame's pixels that hold a maximum, q: log(P / q), or log((1 - P)
 * / (1 - q)) without one. A return counts only after the sky has moved by three pixels; against
 * light at rest only where the boresight is off its steady motion by another offset than at the
 * return before (a slew, a step of a search, but not the way back), and not where a track is
 * predicted.
 * - Shape. The deviation from light is normal about 0 for light, about its value for the pixel's
 *   charge alone for a defect; a share of light, measured on identified stars, has any.
 *
 * The pixel is bad when the least of the three sums reaches log(1 / false_alarm_probability).
 * Because each sum is the logarithm of a likelihood ratio whose mean is 1 for its cause, the chance
 * that a good pixel ever gets there is at most false_alarm_probability (Ville 1939; Wald,
 * Sequential Analysis, 1947, eq. 3:12). A bad pixel is looked at again while it is left out; it is
 * good again when the sum of those looks falls to 0.
 *
 * While the sky is at rest nothing is learned. */
#ifndef BST_IMGPROC_CALIBRATE_PIXEL_LEARNER_H
#define BST_IMGPROC_CALIBRATE_PIXEL_LEARNER_H

#include "boresight/module.h"
#include "imgproc/calibrate/pixel_evidence.h"
#include "imgproc/calibrate/pixel_learner_config.h"

/* Properties of a frame that its pixels' evidence depends on. */
typedef struct bst_pixel_frame {
    bst_quat q_cam_from_gcrf; /* mid-exposure */
    double time_s;
    bst_window window;
    int binning;
    const bst_window *windows;    /* regions of interest that were searched */
    int window_count;             /* 0: all of `window` */
    const double (*predicted)[3]; /* x, y, radius of predicted tracks, px */
    int predicted_count;
} bst_pixel_frame;

typedef struct bst_pixel_learner bst_pixel_learner;

/* Creates a learner for a sensor.
 *
 * Given:     camera  copied
 *            config  its capacity determines the memory
 * Returned:  *out  NULL on error
 * Errors:    BST_ERR_MEMORY
 * Ownership: free *out with bst_pixel_learner_free */
bst_status bst_pixel_learner_create(bst_ctx *ctx, const bst_camera *camera,
                                    const bst_pixel_learner_config *config,
                                    bst_pixel_learner **out) BST_MUST_CHECK;
/* Frees a pixel learner; NULL is allowed. */
void bst_pixel_learner_free(bst_pixel_learner *learner);

/* Counts an identified star; sharp: its maximum was sharper than the PSF allows. */
void bst_pixel_learner_note_star(bst_pixel_learner *learner, bool sharp);

/* Updates the learner with the evidence of the next frame.
 *
 * Given:     shows  in ascending order of pixel */
void bst_pixel_learner_update(bst_pixel_learner *learner, const bst_pixel_frame *frame,
                              const bst_pixel_shows *shows);

/* Number of bad pixels. */
int bst_pixel_learner_bad_count(const bst_pixel_learner *learner);
/* Number of pixels that are suspected but not yet declared bad. */
int bst_pixel_learner_suspects(const bst_pixel_learner *learner);
/* Number of pixels so far that were dropped for lack of room. */
int64_t bst_pixel_learner_lost(const bst_pixel_learner *learner);
/* True if pixels of the latest frame showed charge again while the sky had not moved. */
bool bst_pixel_learner_waits(const bst_pixel_learner *learner);

/* The map in `slot`, 0 to BST_STEP_LANES - 1; its `turn` picks the pixels that are looked at again.
 * Lent. */
typedef struct bst_pixel_map {
    bst_bad_rows rows;
    int64_t turn;
} bst_pixel_map;

/* Map of bad pixels in one of the slots; it belongs to the learner.
 *
 * Given:     slot  0 to BST_STEP_LANES - 1 */
const bst_pixel_map *bst_pixel_learner_map(const bst_pixel_learner *learner, int slot);
/* The least of a pixel's sums, at least 0: the logarithm of the odds, against any other cause that
 * is as likely beforehand, that a maximum there is a defect's. 0 where `used`, the map that the
 * frame was searched with, leaves the pixel out: its charge made no maximum then. */
double bst_pixel_learner_suspicion(const bst_pixel_learner *learner, const bst_pixel_map *used,
                                   int32_t pixel);
/* Brings the map in `slot` up to date. */
void bst_pixel_learner_publish(bst_pixel_learner *learner, int slot, int64_t turn);

/* Adds to `shows` the signals of a share of the pixels of the map that a frame covers; `read` gives
 * electrons without the map (background.h). */
void bst_pixel_map_check(const bst_pixel_map *map, const bst_locate_frame *frame,
                         const bst_window *window, bst_imgproc_pixel_fn read, const void *user,
                         bst_pixel_shows *shows);

#endif
