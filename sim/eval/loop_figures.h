/* Figures of merit of a sensor's tracking loop, per frame and per run. Summary, report and studies
 * use these definitions; docs/reference/summary.md describes them. */
#ifndef BST_EVAL_LOOP_FIGURES_H
#define BST_EVAL_LOOP_FIGURES_H

#include "boresight/camera.h"
#include "sim/eval/error_statistics.h"

/* A track or detection within this distance of the true position belongs to the object: 2.5 FWHM of
 * the shipped cameras, px. */
#define BST_RIGHT_TARGET_PX 5.0
/* The loop has settled when the target is within this distance of the boresight in mode track,
 * px. */
#define BST_SETTLED_PX 3.0

/* Loop figures of one frame. */
typedef struct bst_loop_frame {
    int64_t exposure_id;
    double time_s; /* middle of the exposure */
    /* angle from boresight to the target's true apparent direction, px at the boresight, and its
     * components; NAN: no target */
    double error_px, error_x_px, error_y_px;
    double target_x_px, target_y_px; /* on the focal plane; NAN: no image */
    double target_snr;               /* true SNR if the target is in the field; else 0 */
    bool visible;                    /* target not occulted and illuminated */
    bool in_track;                   /* the track of interest is of the target */
    bool acquired;                   /* mid-exposure at or after acquisition */
    bool settled;                    /* the exposure began at or after settling */
    int mode;                        /* bst_mode at the end of the exposure */
} bst_loop_frame;

typedef struct bst_loop_figures {
    int64_t frames;
    int final_mode;
    double time_to_confirm_s;    /* first confirmed track of the target; NAN: never */
    double time_to_acquire_s;    /* the target's track became the track of interest; NAN: never */
    double time_to_settle_s;     /* first settled frame; NAN: never */
    int64_t visible_frames;      /* frames with a visible target */
    int64_t in_track_frames;     /* visible_frames that are in track */
    int64_t breaks;              /* number of visible frames without track after one in track */
    bool in_track_at_end;        /* in the last frame, visible or not */
    double custody;              /* in_track_frames over visible_frames; NAN: never visible */
    double track_fraction;       /* custody from acquisition on; 0: never acquired */
    int64_t wrong_target_frames; /* the track of interest was of another object: beyond
                                    BST_RIGHT_TARGET_PX and, where the tracker expects its object to
                                    be hidden, also beyond 99.99 % of its covariance */
    /* pointing error, over frames for which bst_loop_frame_is_pointing is true; NAN without any */
    int64_t pointing_frames;
    double pointing_rms_px, pointing_median_px, pointing_p95_px, pointing_p99_px, pointing_max_px;
    double pointing_bias_px; /* length of the mean error vector */
} bst_loop_figures;

/* Accumulated values of the frames of a run. Zero it first. */
typedef struct bst_loop_tally {
    int64_t frames, visible, in_track, breaks;
    int64_t visible_acquired, in_track_acquired;
    bool was_in_track, in_track_at_end;
    bst_error_statistics pointing;
} bst_loop_tally;

/* Pointing error on the sphere: angle between the boresight and a direction, in pixels at the
 * boresight. Its components are the angle times the direction's position angle along
 * columns and rows: an azimuthal equidistant projection, finite over the whole sphere. Near the
 * boresight it equals the position difference on the focal plane.
 * Given: the camera (rotation); pixel_scale_arcsec of the exposure, <= 0: the camera's; the true
 * attitude; the apparent direction (GCRF axes, any length).
 * Returned: the size, px; its components in *x_px, *y_px. */
double bst_eval_pointing_error_px(const bst_camera *camera, double pixel_scale_arcsec,
                                  bst_quat q_cam_from_gcrf, bst_vec3 apparent, double *x_px,
                                  double *y_px);

/* True if a track belongs to the object in the true direction `truth`: the track's direction,
 * propagated by its rate (rad/s) for `seconds`, is within BST_RIGHT_TARGET_PX pixels of
 * scale_rad. */
bool bst_eval_track_is_on_target(bst_vec3 direction, bst_vec3 rate_radps, double seconds,
                                 bst_vec3 truth, double scale_rad);

/* True if the loop has settled in this frame: acquired before, in mode track, and pointing error
 * within BST_SETTLED_PX. */
bool bst_loop_settles(bool acquired, int mode, double error_px);

/* True if a frame counts for the pointing figures: settled, in mode track, target visible. Tracks
 * do not matter: an error of the tracker counts as pointing error. */
bool bst_loop_frame_is_pointing(const bst_loop_frame *frame);

/* Adds a frame to the accumulated loop figures. */
void bst_loop_tally_add(bst_loop_tally *tally, const bst_loop_frame *frame);
/* Saves or restores the accumulated loop figures. */
void bst_loop_tally_archive(bst_loop_tally *tally, bst_archive *archive);
/* Computes the figures that follow from the accumulated frames; the times, final_mode and
 * wrong_target_frames are not changed. */
void bst_loop_tally_figures(const bst_loop_tally *tally, bst_loop_figures *figures);

#endif
