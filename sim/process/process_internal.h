/* Steps of `boresight process`. */
#ifndef BST_PROCESS_PROCESS_INTERNAL_H
#define BST_PROCESS_PROCESS_INTERNAL_H

#include "boresight/camera.h"
#include "imgproc/identify/plate_solve.h"
#include "imgproc/identify/predicted_stars.h"
#include "sim/io/recorded_frames.h"
#include "sim/process/process.h"

/* Attitudes per frame that the pointing file holds at most. */
enum { BST_PROCESS_NODES = 65 };

/* Attitude at a share of the exposure, 0 to 1. */
typedef struct bst_process_node {
    double share;
    bst_quat q_cam_from_gcrf;
} bst_process_node;

/* A frame and what is known of it. */
typedef struct bst_process_frame {
    int64_t index; /* in the recorded frames */
    const char *path;
    bst_frame_place place;
    bst_keyword_values values;
    int64_t start_tick, exposure_ticks; /* after the first frame's start */
    bool has_header_attitude;
    bst_quat q_header;                   /* by the header */
    double rate_trend, rate_trend_sigma; /* bst_keyword_rate_trend */
    /* of the stars */
    bool solved, points;
    bst_quat q_middle; /* at the middle of the streaks */
    double scale;      /* pixel scale over the camera's */
    double rms_px, streak_px;
    double
        zero_point_mag; /* V of one electron per second, by the catalogue's stars; NAN: unknown */
    int matched, predicted, found;
    bst_process_node *nodes; /* [node_count], owned; NULL: not solved, or points */
    int node_count;
    bool reversed; /* the star moved from the right end to the left one */
} bst_process_frame;

/* State of a run of the command. */
typedef struct bst_process {
    const bst_process_request *request;
    char map_path[4096];
    bst_keyword_map map;
    bst_recorded_options options;
    bst_recorded_frames *recorded;
    bst_process_frame *frames; /* [count], by time */
    int count;
    int width, height;
    double scale_arcsec;   /* nominal; after solving that of the stars */
    double zero_point_mag; /* median of the frames'; NAN: unknown */
    int solved;
    bool direction_known; /* which end of the streaks came first */
    bool placed;          /* the headers give the observer's position */
} bst_process;

enum { BST_PROCESS_TICK_RATE_HZ = 10000 };

/* Turn of the camera from one attitude to another, rotation vector, rad. */
bst_vec3 bst_process_turn(bst_quat from, bst_quat to);
/* Turns the order of a frame's nodes: the star moved from the right end to the left one. */
void bst_process_reverse(bst_process_frame *f);
/* Orders the nodes of a frame so that its speed changes as the header's history says.
 *
 * Returned:  false: the history has no trend of three standard errors, or the path none */
bool bst_process_orient_by_rates(bst_process_frame *f);

/* Reads the map and all headers.
 *
 * Errors:    those of bst_keyword_map_load and bst_recorded_frames_open; BST_ERR_ARGUMENT with
 * place and keyword for frames of several sizes or times out of order */
bst_status bst_process_survey(bst_ctx *ctx, bst_process *p, const char *const *paths,
                              int count) BST_MUST_CHECK;
/* Finds the attitudes of the frames from their stars; frames without enough stars stay unsolved.
 *
 * Errors:    those of the catalogue and the files; BST_ERR_MEMORY, BST_ERR_INTERRUPTED */
bst_status bst_process_solve(bst_ctx *ctx, bst_process *p) BST_MUST_CHECK;
/* Scenario that takes the frames from their files.
 *
 * Returned:  *out  JSON, which the caller deletes
 * Errors:    those of bst_keyword_map_camera */
bst_status bst_process_make_scenario(bst_ctx *ctx, const bst_process *p,
                                     struct cJSON **out) BST_MUST_CHECK;
/* Frame updates of its sensor: pointing and observer in each frame. The caller deletes the JSON;
 * NULL: out of memory. */
struct cJSON *bst_process_make_pointing(const bst_process *p);
/* Writes input/ of the folder: scenario.json, pointing.json, keyword_map.json, frames.txt.
 *
 * Errors:    BST_ERR_IO, BST_ERR_MEMORY */
bst_status bst_process_write_input(bst_ctx *ctx, const bst_process *p) BST_MUST_CHECK;
/* Writes products/ and report.html from the run's folder.
 *
 * Errors:    those of bst_run_reader_open, bst_export_run and bst_report_write */
bst_status bst_process_write_products(bst_ctx *ctx, const bst_process *p) BST_MUST_CHECK;
/* Zero point of a frame by the stars that the solver matched.
 *
 * Given:     sky     for the camera at the frame's pixel scale
 *            light   of the observer
 *            result  of the frame
 * Returned:  frame->zero_point_mag
 * Errors:    those of the catalogue; BST_ERR_MEMORY */
bst_status bst_process_zero_point(bst_ctx *ctx, bst_predicted_stars *sky, const bst_light *light,
                                  const bst_plate_solve_result *result, double v_limit,
                                  bst_process_frame *frame) BST_MUST_CHECK;

/* Frees what the steps allocated. */
void bst_process_free(bst_process *p);

/* Observer's place at mid-exposure, by the header or assumed.
 *
 * Returned:  position_m, velocity_mps  geocentric, GCRF axes */
void bst_process_observer(const bst_process_frame *frame, bst_vec3 *position_m,
                          bst_vec3 *velocity_mps);

/* Observer's light at the middle of a frame, for apparent places. */
bst_light bst_process_light(const bst_process_frame *frame);
/* Julian year of a frame's start, for proper motions. */
double bst_process_julian_year(const bst_process_frame *frame);

/* Path of a file in the folder.
 *
 * Errors:    BST_ERR_ARGUMENT: too long */
bst_status bst_process_path(bst_ctx *ctx, const bst_process *p, const char *name,
                            char path[4096]) BST_MUST_CHECK;

#endif
