/* Declarations shared by the files of the smear. */
#ifndef BST_SCENEGEN_SMEAR_SMEAR_INTERNAL_H
#define BST_SCENEGEN_SMEAR_SMEAR_INTERNAL_H

#include "scenegen/smear/extended_source.h"
#include "scenegen/smear/ghost_points.h"
#include "scenegen/smear/motion_map.h"
#include "scenegen/smear/smear.h"
#include "scenegen/smear/smear_body.h"
#include "scenegen/smear/smear_quadrature.h"
#include "scenegen/stamp/stamp.h"

/* Light share of the peak at which node errors of third order are largest: beside the centre, where
 * a bright source's own noise is lower. */
#define FLANK 0.76

/* Share of the tolerance for nodes. */
#define NODE_SHARE 0.85

/* Floats of a block of the node table. */
enum { BST_TABLE_FLOATS = BST_TABLE_ROWS * BST_BLOCK };

/* Levels of detail: level n is accurate to about 0.08 * 2^-n of the smeared image's peak. */
enum { BST_SMEAR_LEVELS = 14 };

typedef struct bst_smear_level {
    int first_block, blocks; /* blocks 0: not computed in this frame */
    /* errors relative to the smeared image's peak: of nodes by motion scale as in
     * bst_smear_nodes_error, their bound and what is predicted, and of profiles */
    double error[BST_NODE_SCALES], predicted[BST_NODE_SCALES];
    double profile_error, predicted_profile;
    /* part of the nodes' predicted error, at each motion scale and all larger ones, that is not of
     * missed highest moments, and parts of these by pattern; `directions` as of
     * bst_smear_node_list */
    double higher_part[BST_NODE_SCALES], missed_part[BST_NODE_SCALES][BST_PATTERNS];
    unsigned directions;
    bool rests;          /* as of bst_smear_node_list */
    bool alike;          /* predicted errors are the bounds: all groups are short */
    double widening_px2; /* largest mean widening of the nodes at one place */
} bst_smear_level;

/* A level computed ahead of its first use, on another thread. */
typedef struct bst_smear_ahead_level {
    bool ready; /* for this frame */
    bst_smear_node_list nodes;
    float *table; /* [level.blocks] */
    int capacity;
    bst_smear_level level;
} bst_smear_ahead_level;

/* A moving source whose nodes are computed ahead. */
typedef struct bst_smear_ahead_path bst_smear_ahead_path;

struct bst_smear {
    bst_camera camera;
    bst_smear_options options;
    double sigma_px, share_sigma_px, widest;
    bst_stamp stamp;
    double tolerance[BST_SMEAR_LEVELS];
    double point_error,
        edge_error; /* of stamps with and without the profile law, relative to the peak */
    double half_diagonal_px;
    double stretch;    /* largest image scale by distortion */
    double wide_field; /* the same by the tangent plane */
    double curvature;  /* largest curvature of the image position by the stars' path, 1/px */
    double far_px, place_parts; /* see fixed_point_px.h */

    bst_los_track track;
    bst_window window;
    double margin_px, dark_variance_e2, duration_s;
    int binning, sources;
    double pixel_part[3];                   /* as in bst_smear_node_aim */
    int parts_binning;                      /* of which pixel_part is, for a Gaussian; 0: of none */
    const bst_psf_sensitivity *sensitivity; /* of the frame; NULL: as of the Gaussian */
    const bst_flank_curve *flanks;          /* [BST_FLANKS] of the frame, for any derivative */
    /* those of binnings used so far, by binning - 1, NULL: none. Without a sensitivity of the PSF
     * the flanks of the Gaussian. */
    bst_psf_sensitivity *binned[BST_PIXEL_PARTS];
    bst_flank_curve *gaussian_flanks[BST_PIXEL_PARTS];
    double aim;         /* share of the tolerance */
    double grid_per_px; /* least grid samples per px of the frame */
    bst_quat q_reference;
    bst_quat *turn; /* attitude at each path point */
    int *parts;     /* straight parts of the path from each track sample */
    int turn_capacity, parts_capacity;
    double tilt_rad, roll_rad; /* largest camera rotation from the reference attitude */
    /* shared track: largest light share of a star in one pixel and in a read-out pixel */
    double star_share, read_share;
    bst_motion_map *map; /* the same, and more, for stars on their own tracks */
    bool single;         /* the stars share one track */
    double spread_px;    /* largest deviation of corner stars from a shared track */
    double travel_px;    /* largest distance of a node from its source's position */
    double last_peak_e, last_read_e, last_presence, last_gap_px, last_widening_px2;
    bool last_leaves;
    double chord_error; /* error of the latest source's chord approximation, relative to its peak */
    double body_sigma;  /* of the latest body's image but for its nodes, in sigma of the worst
                           pixel */
    double low[2], high[2]; /* box of a shared track's positions relative to a star's, px */
    bst_error_budget_source last_error;
    bst_smear_level levels[BST_SMEAR_LEVELS];
    bst_smear_ahead_level ahead[BST_SMEAR_LEVELS];
    bst_smear_ahead_path *ahead_paths;
    int ahead_count, ahead_capacity;
    bool ahead_cells; /* the map's cells of all stars are filled */
    bool fixed;       /* a thread's copy, which must not change what the copies share */
    double *ahead_xy; /* positions of the stars, px from the boresight */
    int ahead_xy_capacity;

    bst_smear_path_point *path, *own_path;
    int path_count, path_capacity, own_capacity;
    /* the path of which bst_motion_rests was found last; count 0: of none */
    const bst_smear_path_point *rests_path;
    int rests_count;
    bool rests;
    bst_smear_node_list nodes; /* work space */
    bst_disc_points points;    /* work space */
    double disc_px;            /* radius of the current source's disc or body; 0: a point */
    bst_smear_bodies bodies;   /* images of models, kept for the frame */
    int64_t frame;             /* counts the exposures */
    float *table;
    int table_blocks, table_capacity;
};

/* Ensures room for `need` items of `bytes` each. */
bst_status bst_smear_reserve(bst_ctx *ctx, void **items, int *capacity, int need,
                             size_t bytes) BST_MUST_CHECK;

/* Projects the image of a source in direction v (GCRF) to the focal plane: position from the
 * boresight, px, without distortion, which the kernel adds. Returns false if it is behind the
 * camera or far away. */
bool bst_smear_project(const bst_smear *s, const bst_scene_source *source, bst_quat q, bst_vec3 v,
                       double *x, double *y);

/* A source's position at the reference attitude, px from the boresight; for a moving one, where its
 * nodes are relative to. */
typedef struct bst_smear_place {
    double x, y, electrons; /* electrons in the exposure */
    double disc_px;         /* radius of its disc; 0: a point */
    bool moving;            /* it has nodes of its own */
} bst_smear_place;

/* Places a source. Returns false if it gives no light. */
bool bst_smear_place_source(const bst_smear *s, const bst_scene_source *source,
                            bst_smear_place *out);

/* Appends the nodes of the work list to the table.
 *
 * Given:     shift  they are image shifts, not attitudes */
bst_status bst_smear_append_nodes(bst_ctx *ctx, bst_smear *s, bool shift,
                                  bst_smear_level *out) BST_MUST_CHECK;

/* Makes level n of the frame unless it is made; from s->ahead, if it is there. */
bst_status bst_smear_make_level(bst_ctx *ctx, bst_smear *s, int n) BST_MUST_CHECK;

/* Appends a level computed ahead to the table. */
bst_status bst_smear_append_ahead(bst_ctx *ctx, bst_smear *s, const bst_smear_ahead_level *ahead,
                                  bst_smear_level *out) BST_MUST_CHECK;
/* Makes a table of its own from the work list.
 *
 * Given:     shift  as in bst_smear_append_nodes */
bst_status bst_smear_describe_ahead(bst_ctx *ctx, const bst_smear *s, bool shift,
                                    bst_smear_ahead_level *out) BST_MUST_CHECK;
/* Computes level n ahead. Threads may do so for several levels at a time. */
bst_status bst_smear_make_ahead(bst_ctx *ctx, const bst_smear *s, int n,
                                bst_smear_ahead_level *out) BST_MUST_CHECK;

/* Forgets what was computed ahead. */
void bst_smear_clear_ahead(bst_smear *s);
/* With a pool of threads: computes the motion map's cells that hold stars, the levels with which
 * the frame's stars begin, and the nodes of its moving sources. What is missing, or fails, is
 * computed when it is used. */
void bst_smear_begin_ahead(bst_smear *s, const bst_smear_frame *frame);
/* Sets the work list and the last_... values of a moving source, as bst_smear_moving_nodes does,
 * from those computed ahead, and appends the nodes to the table. *taken: false if there are none.
 */
bst_status bst_smear_take_ahead(bst_ctx *ctx, bst_smear *s, const bst_scene_source *source,
                                bst_smear_level *out, bool *taken) BST_MUST_CHECK;
/* Frees what was computed ahead. */
void bst_smear_free_ahead(bst_smear *s);

/* Appends the nodes of a path that takes `part` of the exposure to the work list.
 *
 * Given:     turns  a path of camera rotations, not of the image */
bst_status bst_smear_path_nodes(bst_ctx *ctx, bst_smear *s, const bst_smear_path_point *path,
                                int count, double part, bool turns,
                                double tolerance) BST_MUST_CHECK;

/* Largest light share in one pixel over the work list's nodes, at the smallest distortion scale,
 * and in a read-out pixel. Destroys their positions. */
double bst_smear_largest_share(bst_smear *s, double *read_share);

/* Box of the work list's image positions, px. */
void bst_smear_nodes_box(const bst_smear *s, double low[2], double high[2]);

/* Image error that the tolerance allows, relative to the peak. */
double bst_smear_allowed(const bst_smear *s, double peak_e);

/* Coarsest level whose error is probably at most `allowed`, relative to the peak, for an image that
 * moves by `scale` of the path. */
int bst_smear_first_level(const bst_smear *s, double scale, double allowed);

/* Coarsest level whose error is within the allowed one for the latest source, for an image that
 * moves by `scale` of the path. */
int bst_smear_choose_level(const bst_smear *s, double scale);

/* Rotation from camera axes to focal-plane axes. */
bst_quat bst_smear_focal_turn(const bst_smear *s);

/* Nodes of the centre of a source along its path, relative to (x, y), accurate to a tolerance. */
bst_status bst_smear_centre_nodes(bst_ctx *ctx, bst_smear *s, const bst_scene_source *source,
                                  double x, double y, double tolerance) BST_MUST_CHECK;

/* Nodes of a source with a body, relative to (x, y); also sets last_peak_e, last_read_e and
 * chord_error and body_sigma. No nodes if it gives the sensor no light. *there false: the body has
 * no image. */
bst_status bst_smear_body_nodes(bst_ctx *ctx, bst_smear *s, const bst_scene_source *source,
                                double x, double y, bool *there) BST_MUST_CHECK;

/* Nodes of a source that moves, varies or is a disc, relative to (x, y); also sets last_peak_e and
 * last_read_e. No nodes if it gives the sensor no light.
 *
 * Given:     electrons  in the exposure */
bst_status bst_smear_moving_nodes(bst_ctx *ctx, bst_smear *s, const bst_scene_source *source,
                                  double electrons, double x, double y) BST_MUST_CHECK;

/* pixel_part of bst_smear_node_aim for a Gaussian in binned pixels. */
void bst_smear_find_pixel_parts(double sigma_px, int binning, double part[3]);

/* Error bound of a level for an image that moves by `scale` of the path, relative to the peak. */
double bst_smear_level_error(const bst_smear_level *level, double scale);
/* Predicted error, as bst_smear_level_error. */
double bst_smear_level_prediction(const bst_smear_level *level, double scale);

/* Error of a star this far from the boresight that follows its track, in sigma of its worst pixel.
 */
double bst_smear_single_error(const bst_smear *s, double peak_e, double from_boresight_px);

/* Rendering of the latest source: position (px from the boresight), nodes, and motion relative to
 * theirs. */
typedef struct bst_smear_drawn {
    double x, y, travel_px;
    double low[2], high[2]; /* box of its positions relative to (x, y) */
    double error;           /* bound of its nodes and profiles, relative to the peak */
    double predicted;       /* the same as predicted */
    const bst_smear_level *level;
    double scale; /* of its motion relative to the level's */
    int radius;   /* of the stamp */
    bool moving;
} bst_smear_drawn;

/* Finds the PSF's sensitivity to nodes in the frame's read-out pixels, and its flanks. Errors:
 * BST_ERR_MEMORY. */
bst_status bst_smear_find_sensitivity(bst_ctx *ctx, bst_smear *s) BST_MUST_CHECK;

/* Sets last_error of that source's image, wherever it falls. */
void bst_smear_set_error(bst_smear *s, const bst_smear_drawn *d);

/* Reduces last_error to what reaches the window, from the range of the source's positions; sets
 * last_presence and last_leaves. */
void bst_smear_bring_to_window(bst_smear *s, const bst_smear_drawn *d);

#endif
