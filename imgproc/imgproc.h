/* Image processing: from a raw frame to located, measured and identified detections. It is onboard
 * software: it reads frames, telemetry and onboard knowledge, never the truth.
 *
 * Pixel coordinates at public interfaces are full-sensor coordinates. "Electrons" are detected
 * electrons above the background. */
#ifndef BST_IMGPROC_IMGPROC_H
#define BST_IMGPROC_IMGPROC_H

#include "boresight/camera.h"
#include "boresight/camera_motion.h"
#include "boresight/messages.h"
#include "boresight/module.h"
#include "boresight/stage.h"
#include "imgproc/calibrate/pixel_learner_config.h"
#include "imgproc/extended/extended_config.h"
#include "imgproc/identify/camera_calibrator.h"
#include "imgproc/stack/stack.h"
#include "sim/optics/photometry.h"

typedef struct bst_imgproc_bad_pixel {
    int64_t x, y; /* full-sensor coordinates */
} bst_imgproc_bad_pixel;

/* Subtraction of reference pixels (calibrate/reference_pixels.h). */
typedef struct bst_reference_pixels_config {
    bool enabled, alternating_columns;
    int64_t smooth_rows;
} bst_reference_pixels_config;

extern const bst_config_desc bst_reference_pixels_config_table[];

typedef struct bst_imgproc_config {
    int64_t capacity;              /* detections per frame */
    int64_t max_fits;              /* number of brightest detections located by a fit; 0: all */
    double false_splits;           /* share of single sources split by noise; 0: no pair test */
    int64_t mesh_px;               /* side of a background mesh */
    double false_alarms_per_frame; /* expected from noise alone */
    double jitter_px;              /* RMS jitter per axis by which the PSF is broadened */
    double motion_bend_px;         /* RMS bend per axis that neither telemetry nor jitter has */
    double streak_min_px, streak_max_px;
    bool long_streaks;       /* find star streaks beyond streak_max_px by their path */
    double streak_search_px; /* 0: no search for streaks of unknown rate and direction */
    double search_radius_px, match_tolerance_px;
    int attitude;              /* at start, 0: by telemetry, 1: unknown */
    int64_t lost_after_frames; /* without a star, in a row; 0: never lost again */
    double lost_scale_tolerance;
    bst_camera_calibrator_config camera_calibration;
    bool track_windows; /* search only windows while a target is tracked */
    int64_t window_px, window_stars, full_frame_period, full_frame_count;
    bst_stack_config stack;
    bst_extended_config extended;
    bst_pixel_learner_config bad_pixel_learning;
    bst_reference_pixels_config reference_pixels;
    int column_correction;      /* see sim/optics/column_level.h */
    int64_t threads;            /* 0: one per processor */
    bst_config_list bad_pixels; /* of bst_imgproc_bad_pixel */
    /* FITS files of the calibration maps; "": none. The caller loads them (calibration.h). */
    char dark_file[512], flat_file[512], bad_pixel_file[512];
    /* plug-in detector in place of bst_imgproc_detect; created by the caller */
    bst_stage_use detector;
} bst_imgproc_config;

extern const bst_config_desc bst_imgproc_config_table[];

struct bst_pixel_map;
struct bst_pixel_shows;
struct bst_silhouettes;
struct bst_psf;
struct bst_star_path_node;

/* Sensor calibration: maps on the full sensor, row-major [height_px][width_px], and the PSF. NULL
 * means: uniform dark, uniform flat, no bad pixels, Gaussian PSF of the camera's psf_fwhm_px. All
 * must outlive the bst_imgproc that uses them. */
typedef struct bst_imgproc_maps {
    const float *dark_e_per_s; /* dark signal's deviation from its mean; subtracted */
    const float *flat;         /* relative response, > 0; the pixel is divided by it */
    const uint8_t *bad;        /* non-zero: pixel is masked */
    const struct bst_psf *psf; /* see sim/optics/psf.h */
    struct bst_psf *own_psf;   /* owned PSF, freed by bst_calibration_free */
} bst_imgproc_maps;

/* A raw frame. */
typedef struct bst_imgproc_frame {
    const uint16_t *pixels; /* [window.height / binning][window.width / binning], DN */
    bst_window window;      /* full-sensor pixels */
    int binning;            /* sensor pixels summed per side of a pixel, >= 1 */
    int bits;
    double exposure_s;
    /* another frame is processed concurrently: use half of the threads */
    bool beside_another;
    /* only the detections are needed: neither bst_imgproc_stack_frame nor
     * bst_imgproc_follow_streaks is called for this frame */
    bool detections_only;
} bst_imgproc_frame;

/* Detector of one camera: configuration and work space. */
typedef struct bst_imgproc bst_imgproc;

/* Creates a detector; allocates all memory that bst_imgproc_detect needs.
 *
 * Given:     camera              copied
 *            electrons_per_s_v0  bst_camera_electrons_per_s(camera, 0)
 * Errors:    BST_ERR_CONFIG for a bad pixel outside the sensor, BST_ERR_ARGUMENT for a camera out
 *            of range, BST_ERR_MEMORY */
bst_status bst_imgproc_create(bst_ctx *ctx, const bst_camera *camera, double electrons_per_s_v0,
                              const bst_imgproc_config *config, const bst_imgproc_maps *maps,
                              bst_imgproc **out) BST_MUST_CHECK;
/* Frees an image processor; NULL is allowed. */
void bst_imgproc_free(bst_imgproc *ip);

/* Detects and measures the sources of a frame.
 *
 * Steps:
 * 1. calibration to electrons; background and noise by mesh (sigma-clipped);
 * 2. two matched filters of unit output noise: for points, and for the streak of stars while the
 *    camera moves by `motion` (NULL: at rest). The larger of both outputs is the generalised
 *    likelihood ratio test between the shapes (Kay, Fundamentals of Statistical Signal Processing
 *    II, 1998, ch. 7);
 * 3. maxima of the larger output, interpolated between pixels, against a detection threshold that
 *    includes the noise's skewness; in a crowded frame steps 1 to 3 are repeated with the found
 *    stars masked;
 * 4. of maxima without a saddle between them, the highest;
 * 5. weighted least-squares fit of the pixel-integrated PSF or streak, neighbours jointly (not if
 *    bst_imgproc_smeared).
 * The loops run on config->threads threads; the result does not depend on their number.
 *
 * With config.streak_search_px, a frame with point-like stars is also searched for streaks of any
 * direction up to that length (streak_locate.h). Points and streaks then share the false alarms
 * equally; threshold_snr is that of points.
 *
 * With config.max_fits, fainter detections beyond that number are located at the interpolated peak
 * of the matched filter. Their covariance is that of the filter for an isolated source.
 *
 * Returned:  *out  background_e, noise_e, threshold_snr, shared_xx, shared_xy, shared_yy,
 *                  stars_identified (0), count, lost and items, sorted by y, then x; label UNKNOWN
 *                  or ARTEFACT, star_id 0. Beyond `capacity` the faintest are lost. No value is
 *                  NaN
 * Errors:    BST_ERR_ARGUMENT for a window or binning that does not fit the sensor
 * Notes:     The covariance is the inverse Fisher matrix without background uncertainty, plus an
 *            allowance for non-uniform motion. snr is sqrt(sum s^2 / sigma^2) with background noise
 *            only. length_px and width_px are FWHM of the Gaussian with the source's second
 *            moments. */
bst_status bst_imgproc_detect(bst_ctx *ctx, bst_imgproc *ip, const bst_imgproc_frame *frame,
                              const bst_camera_motion *motion, bst_detections *out,
                              int capacity) BST_MUST_CHECK;

/* Extended targets of the latest bst_imgproc_detect, in its frame's pixels; valid until the next
 * frame. None without config.extended.enabled. Pixels of those that are `masked` had no part in the
 * background and in the detection of points. */
const struct bst_silhouettes *bst_imgproc_silhouettes(const bst_imgproc *ip);

/* Windows of a frame: disjoint, inside the frame's own window, aligned with its binned pixels, and
 * at least about 24 pixels a side for the background estimate. */
typedef struct bst_imgproc_windows {
    const bst_window *items;
    int count;
} bst_imgproc_windows;

/* Detects sources in windows of a frame only, as bst_imgproc_detect. The threshold is that of the
 * whole frame. Background and noise are estimated per window; their mean over the windows is
 * reported. Streaks of unknown rate are not searched. The computing time is proportional to the
 * windows' area. */
bst_status bst_imgproc_detect_windows(bst_ctx *ctx, bst_imgproc *ip, const bst_imgproc_frame *frame,
                                      const bst_imgproc_windows *windows,
                                      const bst_camera_motion *motion, bst_detections *out,
                                      int capacity) BST_MUST_CHECK;

/* Enables the collection of bad-pixel evidence, up to `capacity` pixels per frame. Errors:
 * BST_ERR_MEMORY. */
bst_status bst_imgproc_collect_shows(bst_ctx *ctx, bst_imgproc *ip, int capacity) BST_MUST_CHECK;
/* Sets the map of learned bad pixels to be masked in the following frames (lent; NULL: none). */
void bst_imgproc_use_map(bst_imgproc *ip, const struct bst_pixel_map *map);
/* Bad-pixel evidence of the latest frame, in order of pixel; valid until the next frame. */
const struct bst_pixel_shows *bst_imgproc_shows(const bst_imgproc *ip);

/* Fits detection `index` of the latest bst_imgproc_detect if only the matched filter located it
 * (see max_fits). All its fields but label, label_probability and star_id are updated; the
 * magnitude uses zero_point. One whose fit fails, shows no light but that of charge, or grows into
 * a streak that is detected already stays as it is. Detections in windows are always fitted. */
void bst_imgproc_refine(bst_imgproc *ip, bst_detections *detections, int index,
                        const bst_optics_zero_point *zero_point);

/* V magnitude of the faintest star detectable in the latest frame at `snr`, with the stars' shape
 * (point or streak) in it. */
double bst_imgproc_v_limit(const bst_imgproc *ip, double snr);
/* Background level and noise at a position of the sensor, e- per pixel of the latest frame. Not
 * available after bst_imgproc_detect_windows. */
void bst_imgproc_ground(const bst_imgproc *ip, double x_px, double y_px, double *level_e,
                        double *noise_e);
/* Length of the star streak that the latest frame was filtered for, px; 0: points only. */
double bst_imgproc_streak_px(const bst_imgproc *ip);
/* True if stars moved further in the latest frame than is modelled (streak_max_px). Its detections
 * are then fragments of streaks, and their positions are unreliable. */
bool bst_imgproc_smeared(const bst_imgproc *ip);

/* Finds the stars of a frame whose streaks are longer than is filtered for (bst_imgproc_smeared),
 * by a matched filter along the path that they share. Fragments of the streaks among the detections
 * are removed; what remains are points that did not move with the stars.
 *
 * Given:     nodes, count  motion of a star at the middle of the frame, sensor px
 *            *out          of the latest bst_imgproc_detect
 * Returned:  *out          streaks with BST_DETECTION_STREAK and their mean place, which may lie
 *                          outside the frame, and BST_DETECTION_EDGE for those that the frame cuts
 *            *followed     false: the path is too long, too short, or the frame is empty; then
 *                          nothing has changed
 * Errors:    BST_ERR_MEMORY
 * Notes:     bst_imgproc_v_limit and bst_imgproc_streak_px refer to the streaks then.
 *            bst_imgproc_refine does nothing until the next frame. */
bst_status bst_imgproc_follow_streaks(bst_ctx *ctx, bst_imgproc *ip,
                                      const struct bst_star_path_node *nodes, int count,
                                      bst_detections *out, int capacity,
                                      bool *followed) BST_MUST_CHECK;
/* True for a streak that bst_imgproc_follow_streaks found in the latest frame. */
bool bst_imgproc_is_followed(const bst_imgproc *ip, const bst_detection *detection);

/* The latest frame as input of a stack (stack.h). Its signal is valid until the next frame.
 * q_cam_from_gcrf and time_s are mid-exposure. */
bst_stack_frame bst_imgproc_stack_frame(const bst_imgproc *ip, double time_s,
                                        bst_quat q_cam_from_gcrf);
/* Appends detections of a stack to those of its last frame (room for `capacity`), with flag
 * BST_DETECTION_STACK, label STAR if at rest and OBJECT otherwise. Those within reach_px, or three
 * of their standard deviations, of an existing detection are omitted. */
void bst_imgproc_append_stack(const bst_imgproc *ip, const bst_stack_found *found, int count,
                              double reach_px, bst_detections *out, int capacity);

extern const bst_module_desc bst_imgproc_module;

#endif
