/* Functions of `boresight pd`: measures the probability of detection on frames with targets of
 * known position and brightness. */
#ifndef BST_ANALYSIS_PD_PD_H
#define BST_ANALYSIS_PD_PD_H

#include "imgproc/imgproc.h"
#include "scenegen/renderer.h"
#include "sim/analysis/pd/pd_image.h"
#include "sim/analysis/pd/pd_sky.h"
#include "sim/engine/scenario/scenario.h"
#include "sim/eval/pd_curve.h"
#include "sim/eval/target_match.h"

enum { BST_PD_POINTS = 200, BST_PD_PHASES = 10 };
/* Largest separation of pairs that are chosen by the bound, FWHM. */
#define BST_PD_WIDEST_PAIR_FWHM 4.0

/* Detections within this many FWHM of a pair's light, beside its separation, are its own. */
#define BST_PD_PAIR_REACH_FWHM 2.5

/* Options of a measurement. */
typedef struct bst_pd_options {
    double low, high, step; /* SNR; V magnitude if by_magnitude */
    bool by_magnitude;
    int64_t trials;       /* per point */
    int64_t empty_frames; /* frames without targets; 0: for 400 false alarms, 50 to 400 frames */
    double streak_px;     /* 0: targets at rest in the frame */
    bool known_rate;      /* the camera rotates, and image processing gets its rate */
    double false_alarms;  /* per frame; <= 0: from the scenario */
    double background_e;  /* sky per pixel and exposure; < 0: from the scenario */
    double jitter_px;     /* blur per axis; < 0: as configured for image processing */
    double min_separation_px; /* minimum distance between targets, beyond their length */
    double cell_px;           /* cell size of the target grid; 0: the distance that is kept + 40, of
                               * pairs + 4 */
    bool pairs;               /* targets are pairs of sources: pd_pair.h */
    double widest_pair_px;    /* largest separation; 0: BST_PD_WIDEST_PAIR_FWHM */
    double false_splits;      /* share of single sources, asked of the detector; < 0: scenario's */
    bool stars;               /* with the stars and sky of the scenario */
    int64_t stack;            /* frames that are searched together; 0: single frames */
    double rates_px;          /* per frame: maximum motion of a stack's targets in x and y */
    double star_streak_px;    /* the camera follows the targets: stars are streaks */
    bool by_module;           /* step the scenario's module also if a function is available */
    const char *sensor;       /* "observer/sensor"; NULL: the first */
    const char *device;
    int threads;
    bst_device *opened; /* an open device to use; the caller closes it; NULL: none */
    bool quiet;         /* no progress display */
} bst_pd_options;

/* One target in a frame. */
typedef struct bst_pd_target {
    int point;              /* index of its SNR */
    double flux_e, noise_e; /* noise of a pixel at its position without its own light */
} bst_pd_target;

/* One frame: targets and input of renderer and image processing. */
typedef struct bst_pd_frame {
    int count;
    bst_eval_match_target *places; /* [count] */
    bst_pd_target *targets;
    bst_scene_source *sources; /* targets, then the stars */
    int source_room;
    bst_pd_stars stars; /* stars that may be detected */
    bst_scene_source_path *paths;
    bst_camera_motion motion; /* camera motion that image processing receives */
    double time_s[2];
    bst_quat q[2];
    bst_los_track track;
    bst_render_request request;
} bst_pd_frame;

/* Camera, target grid and noise of a measurement. */
typedef struct bst_pd_scene {
    bst_pd_options options;
    const bst_scenario *scenario;
    const bst_scenario_module_config *imgproc; /* of the sensor */
    int observer, sensor;
    char name[160];    /* observer/sensor */
    bst_camera camera; /* as rendered: widened by the jitter */
    struct bst_world *world;
    struct bst_knowledge *knowledge;
    struct bst_psf *psf; /* PSF of the widened camera; NULL: not widened */
    bst_device *device;
    bst_renderer *renderer;
    bst_pd_sky *sky; /* NULL: no stars, uniform sky */
    double exposure_s, sky_e, dark_e;
    double noise_e;       /* at the boresight, without the source's own light */
    double fwhm_px;       /* of the PSF: matching distance of detections */
    double own_light;     /* as in bst_eval_matched_filter_pd, mean over positions and directions */
    double sigma_px;      /* of the Gaussian with the same noise-equivalent area */
    bst_pd_image *image;  /* image model of targets; NULL: the PSF is Gaussian */
    struct bst_psf *seen; /* PSF of the image model */
    double *sharpness;    /* sum p^2 of a streak by its angle from an axis; NULL: point targets */
    double cell_px, min_separation_px;
    int columns, rows;
    int points;
    double snr[BST_PD_POINTS];    /* at the boresight */
    double flux_e[BST_PD_POINTS]; /* flux for that SNR, mean over the pixel phase */
    double v_mag[BST_PD_POINTS];
    bst_pd_frame frames[2]; /* one is rendered while the other is processed */
} bst_pd_scene;

/* Opens world, camera, device and renderer for the scenario's sensor. Errors name the remedy. */
bst_status bst_pd_scene_open(bst_ctx *ctx, const bst_scenario *scenario,
                             const bst_pd_options *options, bst_pd_scene *out) BST_MUST_CHECK;
/* Frees the content of a scene and clears it; the caller's device stays open. */
void bst_pd_scene_close(bst_pd_scene *scene);
/* Number of targets per full frame. */
int bst_pd_scene_room(const bst_pd_scene *scene);
/* Defines frame `number` (0, 1, ...): positions, brightness and noise depend only on the scenario's
 * seed and the number. Frames without targets have different noise. */
bst_status bst_pd_scene_set(bst_ctx *ctx, bst_pd_scene *scene, int64_t number, bool targets,
                            bst_pd_frame *frame) BST_MUST_CHECK;
/* One target of a frame of pairs. */
typedef struct bst_pd_pair_target {
    double snr, ratio;    /* of both as one source; brightness of the first over the second */
    double separation_px; /* 0: a single source */
} bst_pd_pair_target;
/* Defines frame `number` of pairs, in random directions, one in each cell: targets[i] in cell i.
 * The centroid of the light becomes places[i]. For a scene opened with options.pairs. */
void bst_pd_scene_set_pairs(bst_pd_scene *scene, int64_t number, const bst_pd_pair_target *targets,
                            bst_pd_frame *frame);
/* Sum of squared pixel fractions of a target of unit flux. */
double bst_pd_sharpness(const bst_pd_scene *scene, const bst_eval_match_target *place);

/* Number of frames that a detector needs for an answer. */
int bst_pd_scene_stacked(const bst_pd_scene *scene);

/* Counts and errors of matched targets at one SNR. Along and across the streak; x and y of point
 * targets. */
typedef struct bst_pd_tally {
    int64_t trials, matched;
    double error_sum[2], error_square[2], bound_square[2]; /* px, px^2 */
    double flux_sum, flux_square, flux_bound_square;       /* relative to the true flux */
    double chi_square; /* of the position with the reported covariance; expectation 2 per target */
    int64_t bounds;    /* number of targets in the sums of bounds */
    double phase_sum[2][BST_PD_PHASES]; /* error in x and y by position within the pixel */
    int64_t phase_count[2][BST_PD_PHASES];
} bst_pd_tally;

typedef struct bst_pd_result {
    bst_pd_tally tallies[BST_PD_POINTS];
    int64_t frames, empty_frames;
    int64_t false_alarms;               /* in frames without targets */
    int64_t stars;                      /* detections in them that may be stars and do not count */
    int64_t unmatched, second;          /* in frames with targets: detections without target; second
                                           detections of a target */
    int64_t chance_trials, chance_hits; /* fictitious targets, for chance matches */
    int64_t lost;                       /* detections beyond the capacity */
    double pixels;                      /* of a frame */
    double threshold_snr;               /* as reported by image processing */
    double wall_s, process_s;           /* process_s: of frames without targets, mean */
} bst_pd_result;

/* Detector under test: the built-in image processing as the scenario configures it, or, stepped as
 * in a run, another "imgproc" module (or the built-in one with by_module). */
typedef struct bst_pd_detector bst_pd_detector;

/* Opens the sensor's image processing as a detector: as a function if possible, else as a module.
 *
 * Returned:  *out  NULL on error
 * Errors:    BST_ERR_ARGUMENT for options that a plug-in or another module does not support,
 *            BST_ERR_MEMORY, and those of image processing
 * Ownership: free *out with bst_pd_detector_close */
bst_status bst_pd_detector_open(bst_ctx *ctx, bst_pd_scene *scene,
                                bst_pd_detector **out) BST_MUST_CHECK;
/* Frees a detector; NULL is allowed. */
void bst_pd_detector_close(bst_pd_detector *detector);
/* Detects targets in one frame; at most `capacity` detections. */
bst_status bst_pd_detect(bst_ctx *ctx, bst_pd_detector *detector, const bst_pd_scene *scene,
                         bst_frame *frame, const bst_pd_frame *targets, bst_detections *out,
                         int capacity) BST_MUST_CHECK;

/* Renders, processes and counts all frames. BST_ERR_INTERRUPTED: stop requested. */
bst_status bst_pd_run(bst_ctx *ctx, bst_pd_scene *scene, bst_pd_detector *detector,
                      bst_pd_result *out) BST_MUST_CHECK;

/* Figures of a measurement. */
typedef struct bst_pd_figures {
    double false_alarms_per_frame, false_alarms_low, false_alarms_high, pfa, chance;
    bst_pd_needed pd50, pd90;
    double loss_db_pd50, loss_db_pd90, loss_db_sigma_pd50, loss_db_sigma_pd90;
    /* SNR gain per frame over a single frame at equal false alarms per frame: of the ideal
     * detector, and of this one (NAN: not computed) */
    double gain_db_pd50, gain_db_pd90, gain_over_single_db_pd50, gain_over_single_db_pd90;
    /* relative to a matched filter with the target's own photon noise */
    double own_light_db_pd50, own_light_db_pd90;
} bst_pd_figures;

/* Computes the figures of a measurement: SNR at Pd 0.5 and 0.9, losses against the matched filter,
 * and false alarms with 95 % intervals.
 *
 * Given:     scene, result  the measured scene and its counts; at least one empty frame */
void bst_pd_figures_of(const bst_pd_scene *scene, const bst_pd_result *result, bst_pd_figures *out);

/* Sets gain_over_single of a stack's figures from the figures of a single frame. */
void bst_pd_compare_single(const bst_pd_figures *single, bst_pd_figures *stack);

/* Prints the table of a measurement to stdout. */
void bst_pd_print(const bst_pd_scene *scene, const bst_pd_result *result,
                  const bst_pd_figures *figures);

/* A measurement as a JSON object.
 *
 * Returned:  NULL if out of memory
 * Ownership: free it with cJSON_Delete */
struct cJSON *bst_pd_json(const bst_pd_scene *scene, const bst_pd_result *result,
                          const bst_pd_figures *figures);

/* Plots the probability of detection over the SNR.
 *
 * Given:     path  PNG or SVG file to write
 * Errors:    those of bst_plot_begin and bst_plot_end (gnuplot is needed) */
bst_status bst_pd_plot(bst_ctx *ctx, const char *path, const bst_pd_scene *scene,
                       const bst_pd_result *result, const bst_pd_figures *figures) BST_MUST_CHECK;

#endif
