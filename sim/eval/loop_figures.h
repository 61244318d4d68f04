/* The figures of a sensor's loop: what each means, on one frame and over a run. The summary of a
 * run, its report and studies all take them from here; docs/user_guide.md ("The summary, exactly")
 * says the same in words. */
#ifndef BST_EVAL_LOOP_FIGURES_H
#define BST_EVAL_LOOP_FIGURES_H

#include "boresight/camera.h"
#include "sim/eval/error_statistics.h"

/* A track or a detection within this many pixels of the true place is the object's: 2.5 FWHM of the
 * shipped cameras. */
#define BST_RIGHT_TARGET_PX 5.0
/* The loop has settled when the target lies this close to the boresight, in mode track. */
#define BST_SETTLED_PX 3.0

/* One frame. */
typedef struct bst_loop_frame {
    int64_t exposure_id;
    double time_s; /* middle of the exposure */
    /* angle from the boresight to the target's true apparent direction, in pixels of the boresight,
     * and its components along columns and rows; NAN: no target */
    double error_px, error_x_px, error_y_px;
    double target_x_px, target_y_px; /* on the focal plane; NAN: it has no image */
    double target_snr;               /* true SNR, target in the field; else 0 */
    bool visible;  /* target not behind the Earth, and some of its light reaches the camera */
    bool in_track; /* the track of interest is the target's */
    bool acquired; /* the middle lies at or after the acquisition */
    bool settled;  /* the exposure began at or after the settling */
    int mode;      /* bst_mode at the end of the exposure */
} bst_loop_frame;

typedef struct bst_loop_figures {
    int64_t frames;
    int final_mode;
    double time_to_confirm_s;    /* first confirmed track of the target; NAN: never */
    double time_to_acquire_s;    /* the target's track became the track of interest; NAN: never */
    double time_to_settle_s;     /* NAN: never */
    int64_t visible_frames;      /* frames with a visible target */
    int64_t in_track_frames;     /* visible_frames that are in track */
    int64_t breaks;              /* times that a visible frame out of track follows one in track */
    bool in_track_at_end;        /* the last frame, visible or not */
    double custody;              /* in_track_frames over visible_frames; NAN: never visible */
    double track_fraction;       /* the same from the acquisition on; 0: never acquired */
    int64_t wrong_target_frames; /* the track of interest was another object's: beyond
                                    BST_RIGHT_TARGET_PX and, where the tracker expects its object to
                                    be hidden, also beyond 99.99 % of its covariance */
    /* pointing error of the frames of bst_loop_frame_is_pointing; NAN without any */
    int64_t pointing_frames;
    double pointing_rms_px, pointing_median_px, pointing_p95_px, pointing_p99_px, pointing_max_px;
    double pointing_bias_px; /* length of the mean error vector */
} bst_loop_figures;

/* What the figures of a run need of its frames. Zero it to begin. */
typedef struct bst_loop_tally {
    int64_t frames, visible, in_track, breaks;
    int64_t visible_acquired, in_track_acquired;
    bool was_in_track, in_track_at_end;
    bst_error_statistics pointing;
} bst_loop_tally;

/* Error of pointing on the sphere: the angle between the boresight and a direction, over the pixel
 * scale at the boresight. Its components are the angle times the direction's position angle along
 * columns and rows: an azimuthal equidistant projection, finite over the whole sphere. Near the
 * boresight it equals the difference of places on the focal plane.
 * Given: the camera (rotation); pixel_scale_arcsec of the exposure, <= 0: the camera's; the true
 * attitude; the apparent direction (GCRF axes, any length).
 * Returned: the size, px; its components in *x_px, *y_px. */
double bst_eval_pointing_error_px(const bst_camera *camera, double pixel_scale_arcsec,
                                  bst_quat q_cam_from_gcrf, bst_vec3 apparent, double *x_px,
                                  double *y_px);

/* Whether a track is of the object in the true direction `truth`: its direction, carried on by its
 * rate (rad/s) for `seconds`, lies within BST_RIGHT_TARGET_PX pixels of scale_rad. */
bool bst_eval_track_is_on_target(bst_vec3 direction, bst_vec3 rate_radps, double seconds,
                                 bst_vec3 truth, double scale_rad);

/* Whether the loop is settled by this frame: it was acquired before, is in mode track, and points
 * to within BST_SETTLED_PX. */
bool bst_loop_settles(bool acquired, int mode, double error_px);

/* Whether a frame counts for the pointing figures: settled, in mode track, the target visible.
 * Tracks play no part: an error of the tracker shows. */
bool bst_loop_frame_is_pointing(const bst_loop_frame *frame);

/* Adds a frame to the counts. */
void bst_loop_tally_add(bst_loop_tally *tally, const bst_loop_frame *frame);
/* Sets the figures that follow from the frames; the times, final_mode and wrong_target_frames stay
 * as they are. */
void bst_loop_tally_figures(const bst_loop_tally *tally, bst_loop_figures *figures);

#endif
