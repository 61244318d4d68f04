/* Learns bad pixels on board: pixels that show a maximum repeatedly while the sky moves across
 * them.
 *
 * Sequential likelihood ratios compare a defective pixel with three other causes of a maximum. The
 * first is light of the sky, which leaves the pixel when the camera turns. The second is a
 * cosmic-ray hit, which does not return. The third is light at rest in the frame, such as a
 * followed target, whose image has the PSF's shape. The sum over frames of log p1 / p0 has two
 * kinds of terms:
 *
 * - Return. A pixel with k maxima in n looks shows another with P = (k + 1) / (n + 2). A good one
 *   shows one with q, the share of the frame's pixels with a maximum. The term is log(P / q), or
 *   log((1 - P) / (1 - q)) without a maximum. A return counts only after the sky has moved by three
 *   pixels. Against light at rest it counts only at a new boresight offset from steady motion (a
 *   slew or a step of a search, but not the way back). It does not count where a track is
 *   predicted.
 * - Shape. The deviation from the PSF is normal about 0 for light, and about the value of charge in
 *   one pixel for a defect. A share of the light, measured on identified stars, has any deviation.
 *
 * A pixel is bad when the smallest of the three sums reaches log(1 / false_alarm_probability). Each
 * sum is the logarithm of a likelihood ratio with mean 1 under its cause. Hence the probability
 * that a good pixel ever reaches it is at most false_alarm_probability (Ville 1939; Wald,
 * Sequential Analysis, 1947, eq. 3:12). A masked pixel is re-checked; it is good again when the sum
 * of its re-checks falls to 0.
 *
 * Nothing is learned while the sky is at rest in the frame. */
#ifndef BST_IMGPROC_CALIBRATE_PIXEL_LEARNER_H
#define BST_IMGPROC_CALIBRATE_PIXEL_LEARNER_H

#include "boresight/module.h"
#include "imgproc/calibrate/pixel_evidence.h"
#include "imgproc/calibrate/pixel_learner_config.h"

/* Geometry and coverage of a frame whose evidence updates the learner. */
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

/* Saves or restores what was learned, and the published bad-pixel maps.
 *
 * Errors:    BST_ERR_FORMAT for restored pixels that are not on the sensor or not in order; nothing
 *            is learned then */
bst_status bst_pixel_learner_archive(bst_pixel_learner *learner,
                                     bst_archive *archive) BST_MUST_CHECK;

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
/* Number of pixels dropped so far because the capacity was reached. */
int64_t bst_pixel_learner_lost(const bst_pixel_learner *learner);
/* True if pixels of the latest frame showed charge again but the sky had not moved enough to count.
 */
bool bst_pixel_learner_waits(const bst_pixel_learner *learner);

/* A published bad-pixel map. */
typedef struct bst_pixel_map {
    bst_bad_rows rows;
    /* selects the masked pixels that are re-checked */
    int64_t turn;
} bst_pixel_map;

/* Published bad-pixel map in a slot; it belongs to the learner.
 *
 * Given:     slot  0 to BST_STEP_LANES - 1 */
const bst_pixel_map *bst_pixel_learner_map(const bst_pixel_learner *learner, int slot);
/* Log odds that a maximum at the pixel is a defect, against any other cause of equal prior: the
 * smallest of the pixel's sums, at least 0.
 *
 * Given:     used   bad-pixel map that the frame was searched with
 *            pixel  y * width + x on the sensor
 * Returned:  0 if `used` masks the pixel: its charge cannot have caused a maximum */
double bst_pixel_learner_suspicion(const bst_pixel_learner *learner, const bst_pixel_map *used,
                                   int32_t pixel);
/* Updates the published bad-pixel map in `slot`. */
void bst_pixel_learner_publish(bst_pixel_learner *learner, int slot, int64_t turn);

/* Adds re-checks of a share of the map's masked pixels to the evidence of a frame.
 *
 * Given:     read  unmasked pixels of the frame, e- (background.h)
 *            user  passed to read */
void bst_pixel_map_check(const bst_pixel_map *map, const bst_locate_frame *frame,
                         const bst_window *window, bst_imgproc_pixel_fn read, const void *user,
                         bst_pixel_shows *shows);

#endif
