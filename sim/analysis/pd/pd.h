/* boresight pd: detection measured on frames full of targets of known place and light. */
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

/* What is asked for. */
typedef struct bst_pd_options {
    double low, high, step; /* SNR; with by_magnitude V */
    bool by_magnitude;
    int64_t trials;           /* per point */
    int64_t empty_frames;     /* without targets; 0: for 400 false alarms, 50 to 400 */
    double streak_px;         /* 0: targets at rest in the frame */
    bool known_rate;          /* the camera turns and image processing is told how */
    double false_alarms;      /* per frame; <= 0: as the scenario says */
    double background_e;      /* sky per pixel and exposure; < 0: the scenario's */
    double jitter_px;         /* blur per axis; < 0: what image processing is set to */
    double min_separation_px; /* least distance between targets beyond their own length */
    double cell_px;           /* of the grid of targets; 0: min_separation_px + length + 40 */
    bool stars;               /* the scenario's stars and sky behind the targets */
    int64_t stack;            /* frames that are searched together; 0: each by itself */
    double rates_px;          /* per frame: targets of a stack move, up to this in x and in y */
    double star_streak_px;    /* the camera turns, so that stars streak and targets do not */
    bool by_module;           /* step the scenario's module also where a function would do */
    const char *sensor;       /* "observer/sensor"; NULL: the first */
    const char *device;
    int threads;
    bst_device *opened; /* used instead of opening one, and not closed; NULL: none */
    bool quiet;         /* no progress line */
} bst_pd_options;

/* One target of a frame. */
typedef struct bst_pd_target {
    int point;              /* index of its SNR */
    double flux_e, noise_e; /* noise of a pixel without the target's light, at its place */
} bst_pd_target;

/* One frame: its targets and what is needed to render and process it. */
typedef struct bst_pd_frame {
    int count;
    bst_eval_match_target *places; /* [count] */
    bst_pd_target *targets;
    bst_scene_source *sources; /* targets, then the stars */
    int source_room;
    bst_pd_stars stars; /* that may be found */
    bst_scene_source_path *paths;
    bst_camera_motion motion; /* the camera's, as told to image processing */
    double time_s[2];
    bst_quat q[2];
    bst_los_track track;
    bst_render_request request;
} bst_pd_frame;

/* The camera that looks, and the grid on which targets are placed. */
typedef struct bst_pd_scene {
    bst_pd_options options;
    const bst_scenario *scenario;
    const bst_scenario_module_config *imgproc; /* of the sensor */
    int observer, sensor;
    char name[160];    /* observer/sensor */
    bst_camera camera; /* as rendered: widened by the jitter */
    struct bst_world *world;
    struct bst_knowledge *knowledge;
    struct bst_psf *psf; /* of the widened camera; NULL: it was not widened */
    bst_device *device;
    bst_renderer *renderer;
    bst_pd_sky *sky; /* NULL: no stars, and one level of sky all over */
    double exposure_s, sky_e, dark_e;
    double noise_e;       /* of a pixel without the source's own light, at the boresight */
    double fwhm_px;       /* of the PSF: how near a detection must be */
    double own_light;     /* as bst_eval_matched_filter_pd has it, mean of places and directions */
    double sigma_px;      /* of the Gaussian with the PSF's noise-equivalent area */
    bst_pd_image *image;  /* of targets; NULL: the PSF is that Gaussian */
    struct bst_psf *seen; /* that it is made from */
    double *sharpness;    /* of a streak, by its angle from an axis; NULL: targets are at rest */
    double cell_px, min_separation_px;
    int columns, rows;
    int points;
    double snr[BST_PD_POINTS];    /* at the boresight */
    double flux_e[BST_PD_POINTS]; /* of that SNR, of the mean place in a pixel */
    double v_mag[BST_PD_POINTS];
    bst_pd_frame frames[2]; /* one is rendered while the other is processed */
} bst_pd_scene;

/* Opens world, camera, device and renderer of the scenario's sensor. Errors name what to change. */
bst_status bst_pd_scene_open(bst_ctx *ctx, const bst_scenario *scenario,
                             const bst_pd_options *options, bst_pd_scene *out) BST_MUST_CHECK;
/* Frees everything that a scene holds and clears it; a device that the caller lent stays open. */
void bst_pd_scene_close(bst_pd_scene *scene);
/* Targets per full frame. */
int bst_pd_scene_room(const bst_pd_scene *scene);
/* Frame `number` (0, 1, ...) into `frame`: places, light and noise follow from the scenario's seed
 * and the number alone. Without targets: its noise is another. */
bst_status bst_pd_scene_set(bst_ctx *ctx, bst_pd_scene *scene, int64_t number, bool targets,
                            bst_pd_frame *frame) BST_MUST_CHECK;
/* sum p^2 of a target of unit flux. */
double bst_pd_sharpness(const bst_pd_scene *scene, const bst_eval_match_target *place);

/* Frames that a detector takes before it answers. */
int bst_pd_scene_stacked(const bst_pd_scene *scene);

/* What was counted and measured at one SNR, of matched targets. Along and across the streak; x and
 * y of targets at rest. */
typedef struct bst_pd_tally {
    int64_t trials, matched;
    double error_sum[2], error_square[2], bound_square[2]; /* px, px^2 */
    double flux_sum, flux_square, flux_bound_square;       /* over the true flux */
    double chi_square; /* of the place with the covariance that was told; 2 a target if that is true
                        */
    int64_t bounds;    /* targets that the bounds are the sum of */
    double phase_sum[2][BST_PD_PHASES]; /* error along x and y by the place within the pixel */
    int64_t phase_count[2][BST_PD_PHASES];
} bst_pd_tally;

typedef struct bst_pd_result {
    bst_pd_tally tallies[BST_PD_POINTS];
    int64_t frames, empty_frames;
    int64_t false_alarms;      /* in the frames without targets */
    int64_t stars;             /* detections in them that may be stars: no false alarms */
    int64_t unmatched, second; /* in those with: detections that are no target's; a target's
                                  beyond its first */
    int64_t chance_trials, chance_hits; /* targets that are not there */
    int64_t lost;                       /* detections that found no room */
    double pixels;                      /* of a frame */
    double threshold_snr;               /* as image processing told it */
    double wall_s, process_s;           /* process_s: of the frames without targets, mean */
} bst_pd_result;

/* What finds the targets: image processing that comes with Boresight, as the scenario configures it
 * and with room for all targets; another module of the role "imgproc" (or that one, with by_module)
 * is stepped as in a run. */
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
/* What it finds in one frame, at most `capacity`. */
bst_status bst_pd_detect(bst_ctx *ctx, bst_pd_detector *detector, const bst_pd_scene *scene,
                         bst_frame *frame, const bst_pd_frame *targets, bst_detections *out,
                         int capacity) BST_MUST_CHECK;

/* Renders, processes and counts. BST_ERR_INTERRUPTED when the user asks to stop. */
bst_status bst_pd_run(bst_ctx *ctx, bst_pd_scene *scene, bst_pd_detector *detector,
                      bst_pd_result *out) BST_MUST_CHECK;

/* Figures of a result. */
typedef struct bst_pd_figures {
    double false_alarms_per_frame, false_alarms_low, false_alarms_high, pfa, chance;
    bst_pd_needed pd50, pd90;
    double loss_db_pd50, loss_db_pd90, loss_db_sigma_pd50, loss_db_sigma_pd90;
    /* in SNR per frame over one frame by itself at the same false alarms per frame: of the ideal
     * detector, and of this one (NAN unless told) */
    double gain_db_pd50, gain_db_pd90, gain_over_single_db_pd50, gain_over_single_db_pd90;
    /* against a matched filter, whose output has the target's own photon noise too */
    double own_light_db_pd50, own_light_db_pd90;
} bst_pd_figures;

/* Computes the figures of a measurement: SNR at Pd 0.5 and 0.9, losses against the matched filter,
 * and false alarms with 95 % intervals.
 *
 * Given:     scene, result  the measured scene and its counts; at least one empty frame */
void bst_pd_figures_of(const bst_pd_scene *scene, const bst_pd_result *result, bst_pd_figures *out);

/* What the detector needs in one frame by itself: fills in gain_over_single of a stack's figures.
 */
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
