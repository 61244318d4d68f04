/* Image processing: from one raw frame to located, measured and identified detections. Onboard
 * side: sees frames, telemetry and the onboard knowledge, never the truth.
 *
 * Pixel coordinates are full-sensor coordinates at every public boundary; electrons are detected
 * electrons above the background. */
#ifndef BST_IMGPROC_IMGPROC_H
#define BST_IMGPROC_IMGPROC_H

#include "boresight/camera.h"
#include "boresight/camera_motion.h"
#include "boresight/messages.h"
#include "boresight/module.h"
#include "boresight/stage.h"
#include "imgproc/calibrate/pixel_learner_config.h"
#include "imgproc/stack/stack.h"
#include "sim/optics/photometry.h"

typedef struct bst_imgproc_bad_pixel {
    int64_t x, y; /* full-sensor coordinates */
} bst_imgproc_bad_pixel;

typedef struct bst_imgproc_config {
    int64_t capacity;              /* detections per frame */
    int64_t max_fits;              /* of them, the brightest, located by fits; 0: all */
    int64_t mesh_px;               /* side of a background mesh */
    double false_alarms_per_frame; /* on noise alone */
    double jitter_px;              /* RMS per axis by which the PSF is expected to be widened */
    double streak_min_px, streak_max_px;
    double streak_search_px; /* 0: no search for streaks of unknown rate and direction */
    double search_radius_px, match_tolerance_px;
    bool track_windows; /* look only at windows while a target is followed */
    int64_t window_px, window_stars, full_frame_period, full_frame_count;
    bst_stack_config stack;
    bst_pixel_learner_config bad_pixel_learning;
    int column_correction;      /* see sim/optics/column_level.h */
    int64_t threads;            /* 0: one per processor */
    bst_config_list bad_pixels; /* of bst_imgproc_bad_pixel */
    /* FITS images of the maps; "": none. bst_imgproc_create leaves them to the caller. */
    char dark_file[512], flat_file[512], bad_pixel_file[512];
    bst_stage_use detector; /* a plug-in's in place of bst_imgproc_detect; left to the caller too */
} bst_imgproc_config;

extern const bst_config_desc bst_imgproc_config_table[];

struct bst_pixel_map;
struct bst_pixel_shows;
struct bst_psf;

/* What is known of the sensor beside the camera's numbers. Maps on the full sensor, row-major
 * [height_px][width_px]; any may be NULL: uniform dark, uniform flat, no bad pixels, the PSF the
 * Gaussian of the camera's psf_fwhm_px. They must outlive the bst_imgproc that uses them. */
typedef struct bst_imgproc_maps {
    const float *dark_e_per_s; /* dark signal's departure from its mean; taken off */
    const float *flat;         /* relative response, > 0; divided by */
    const uint8_t *bad;        /* non-zero: pixel is left out */
    const struct bst_psf *psf; /* see sim/optics/psf.h */
    struct bst_psf *own_psf;   /* bst_calibration_psf: what bst_calibration_free frees of it */
} bst_imgproc_maps;

/* One frame as it was read out. */
typedef struct bst_imgproc_frame {
    const uint16_t *pixels; /* [window.height / binning][window.width / binning], DN */
    bst_window window;      /* full-sensor pixels */
    int binning;            /* sensor pixels summed per side of a pixel, >= 1 */
    int bits;
    double exposure_s;
    /* another frame is processed meanwhile: leave half of the threads to it */
    bool beside_another;
} bst_imgproc_frame;

/* Work space for one camera. */
typedef struct bst_imgproc bst_imgproc;

/* Makes the work space: all memory that bst_imgproc_detect needs. `camera` is copied;
 * electrons_per_s_v0 is bst_camera_electrons_per_s(camera, 0). BST_ERR_CONFIG for a bad pixel
 * outside the sensor, BST_ERR_ARGUMENT for a camera out of range, BST_ERR_MEMORY. */
bst_status bst_imgproc_create(bst_ctx *ctx, const bst_camera *camera, double electrons_per_s_v0,
                              const bst_imgproc_config *config, const bst_imgproc_maps *maps,
                              bst_imgproc **out) BST_MUST_CHECK;
/* Frees an image processor; NULL is allowed. */
void bst_imgproc_free(bst_imgproc *ip);

/* Finds and measures the sources of one frame.
 *
 * Steps: artefact correction; electrons; background and noise by mesh (clipped mean and standard
 * deviation); two matched filters, for points and for the streak that stars draw when the camera
 * moves by `motion` (NULL: at rest), both normalised to unit noise; maxima of the greater of the
 * two, looked for between the pixels, against a threshold that counts with the noise's tail; in a
 * crowded frame all that again with background and noise of what lies between the maxima;
 * of maxima that no saddle parts the highest; weighted least-squares fit of the pixel-integrated
 * Gaussian or streak, close neighbours together (none when bst_imgproc_smeared). The greater of two
 * matched-filter outputs is the generalised likelihood ratio test between both shapes (Kay,
 * Fundamentals of Statistical Signal Processing II, 1998, ch. 7). The passes run on
 * config->threads threads; the result does not depend on them.
 *
 * With config.streak_search_px, a frame in which stars are points is also searched for streaks of
 * any direction and length up to that (streak_locate.h); points and streaks then have half of the
 * false alarms each, and threshold_snr is that of points.
 *
 * With config.max_fits, of more detections the fainter ones stand where the matched filter's
 * output is the greatest, between the pixels; their covariance is that of the filter for a source
 * alone.
 *
 * Fills background_e, noise_e, threshold_snr, count, lost and items of *out (room for `capacity`),
 * sorted by y, then x; label is UNKNOWN or ARTEFACT, star_id 0. When there is no room the brightest
 * stay. The covariance is the inverse of the Fisher matrix, without background uncertainty, plus
 * what a motion that was not uniform may add; snr is sqrt(sum s^2 / sigma^2) with the background's
 * noise only; length_px and width_px are the full widths at half maximum of the Gaussian with the
 * source's second moments. No output is NaN. BST_ERR_ARGUMENT for a window or binning that does not
 * fit the sensor. */
bst_status bst_imgproc_detect(bst_ctx *ctx, bst_imgproc *ip, const bst_imgproc_frame *frame,
                              const bst_camera_motion *motion, bst_detections *out,
                              int capacity) BST_MUST_CHECK;

/* Parts of a frame: apart from each other, inside the frame's own window and along its binned
 * pixels, none smaller than a mesh is good for (about 24 pixels a side). */
typedef struct bst_imgproc_windows {
    const bst_window *items;
    int count;
} bst_imgproc_windows;

/* The same in windows of the frame only. Thresholds are those of the whole frame; background and
 * noise are each window's own, and what is reported of them is the mean over the windows. No
 * streaks of unknown rate are searched for. The time that it takes follows the windows' area. */
bst_status bst_imgproc_detect_windows(bst_ctx *ctx, bst_imgproc *ip, const bst_imgproc_frame *frame,
                                      const bst_imgproc_windows *windows,
                                      const bst_camera_motion *motion, bst_detections *out,
                                      int capacity) BST_MUST_CHECK;

/* Has the following frames collect evidence of defective pixels, up to `capacity` pixels of a
 * frame. BST_ERR_MEMORY. */
bst_status bst_imgproc_collect_shows(bst_ctx *ctx, bst_imgproc *ip, int capacity) BST_MUST_CHECK;
/* The pixels of `map` (lent; NULL: none) are left out of the following frames. */
void bst_imgproc_use_map(bst_imgproc *ip, const struct bst_pixel_map *map);
/* The evidence of the latest frame, in order of pixel. Lent until the next frame. */
const struct bst_pixel_shows *bst_imgproc_shows(const bst_imgproc *ip);

/* Fits detection `index` of the latest bst_imgproc_detect if the matched filter placed it (see
 * max_fits), and sets all of it but label, label_probability and star_id; the magnitude is put on
 * zero_point. In windows all are fitted.
 */
void bst_imgproc_refine(bst_imgproc *ip, bst_detections *detections, int index,
                        const bst_optics_zero_point *zero_point);

/* V magnitude of the faintest star that the latest frame could show at `snr`, with the shape
 * (point or streak) that stars had in it. */
double bst_imgproc_v_limit(const bst_imgproc *ip, double snr);
/* Background and its noise at a place of the sensor, per pixel of the latest frame; not in windows.
 */
void bst_imgproc_ground(const bst_imgproc *ip, double x_px, double y_px, double *level_e,
                        double *noise_e);
/* Length of the star streak that the latest frame was filtered for, px; 0: points only. */
double bst_imgproc_streak_px(const bst_imgproc *ip);
/* Whether stars moved further in the latest frame than is modelled (streak_max_px): what was found
 * then is parts of streaks, and no place of it is to be trusted. */
bool bst_imgproc_smeared(const bst_imgproc *ip);

/* The latest frame for a stack (stack.h); its signal is lent until the next frame. q_cam_from_gcrf
 * and time_s are of the middle of the exposure. */
bst_stack_frame bst_imgproc_stack_frame(const bst_imgproc *ip, double time_s,
                                        bst_quat q_cam_from_gcrf);
/* Appends what a stack shows to the detections of its last frame (room for `capacity`), with the
 * flag BST_DETECTION_STACK, labelled STAR where at rest and else OBJECT; not what lies within
 * reach_px, or three of its standard deviations, of a detection that is there. */
void bst_imgproc_append_stack(const bst_imgproc *ip, const bst_stack_found *found, int count,
                              double reach_px, bst_detections *out, int capacity);

extern const bst_module_desc bst_imgproc_module;

#endif
