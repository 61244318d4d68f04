/* What smear.c and smear_moving.c share. */
#ifndef BST_SCENEGEN_SMEAR_SMEAR_INTERNAL_H
#define BST_SCENEGEN_SMEAR_SMEAR_INTERNAL_H

#include "scenegen/smear/extended_source.h"
#include "scenegen/smear/motion_map.h"
#include "scenegen/smear/smear.h"
#include "scenegen/smear/smear_quadrature.h"
#include "scenegen/stamp/stamp.h"

/* Errors of nodes are greatest beside the middle, where a bright source's own noise is less: those
 * of third order where the light is this share of the peak. */
#define FLANK 0.76

/* Fidelities: level n is right to about 0.08 * 2^-n of the smeared image's peak. */
enum { BST_SMEAR_LEVELS = 14 };

typedef struct bst_smear_level {
    int first_block, blocks; /* blocks 0: not made in this frame */
    /* expected, of the smeared image's peak: for motions as in bst_smear_nodes_error, and of
     * profiles */
    double error[BST_NODE_SCALES], profile_error;
} bst_smear_level;

struct bst_smear {
    bst_camera camera;
    bst_smear_options options;
    double sigma_px, share_sigma_px, widest;
    bst_stamp stamp;
    double tolerance[BST_SMEAR_LEVELS];
    double point_error,
        edge_error; /* of stamps by the profile law, and without it, over the peak */
    double half_diagonal_px;
    double stretch;             /* of the image by distortion where it is greatest */
    double wide_field;          /* the same by the tangent plane */
    double curvature;           /* of the image's place by the path of the stars, at most, 1/px */
    double far_px, place_parts; /* see fixed_point_px.h */

    bst_los_track track;
    bst_window window;
    double margin_px, dark_variance_e2, duration_s;
    int binning, sources;
    double pixel_part[3]; /* as in bst_smear_node_aim */
    double aim;           /* part of the tolerance */
    bst_quat q_reference;
    bst_quat *turn; /* attitude at each point of the path */
    int *parts;     /* straight parts of the path from each sample of the track */
    int turn_capacity, parts_capacity;
    double tilt_rad, roll_rad; /* most of the camera's turn from the reference attitude */
    /* largest share of a star's light on one pixel and on one that is read, of one track */
    double star_share, read_share;
    bst_motion_map *map; /* the same, and more, of stars on tracks of their own */
    bool single;         /* stars share one track */
    double spread_px;    /* by which stars in the corners move otherwise */
    double travel_px;    /* largest distance of a node from its source's place */
    double last_peak_e, last_read_e, last_presence;
    bool last_leaves;
    double chord_error;     /* of the last source's path, over its peak */
    double low[2], high[2]; /* box of one track's places about a star's, px */
    bst_error_budget_source last_error;
    bst_smear_level levels[BST_SMEAR_LEVELS];

    bst_smear_path_point *path, *own_path;
    int path_count, path_capacity, own_capacity;
    bst_smear_node_list nodes; /* scratch */
    bst_disc_points points;    /* scratch */
    double disc_px;            /* radius of the present source's disc; 0: a point */
    float *table;
    int table_blocks, table_capacity;
};

/* Makes room for `need` items of so many bytes. */
bst_status bst_smear_reserve(bst_ctx *ctx, void **items, int *capacity, int need,
                             size_t bytes) BST_MUST_CHECK;

/* Place on the focal plane from the boresight, px, without the distortion, which the kernel adds;
 * false when it is not in front of the camera or far away. */
bool bst_smear_project(const bst_smear *s, bst_quat q, bst_vec3 v, double *x, double *y);

/* Adds to the scratch nodes those of a path that takes `part` of the exposure. turns: a path of the
 * camera, not of the image. */
bst_status bst_smear_path_nodes(bst_ctx *ctx, bst_smear *s, const bst_smear_path_point *path,
                                int count, double part, bool turns,
                                double tolerance) BST_MUST_CHECK;

/* Largest share of light on one pixel over the scratch nodes, where the distortion stretches the
 * image least, and on one that is read. Spoils their places. */
double bst_smear_largest_share(bst_smear *s, double *read_share);

/* The box of the scratch nodes' places on the image, px. */
void bst_smear_nodes_box(const bst_smear *s, double low[2], double high[2]);

/* The error of an image that the tolerance allows, over its peak. */
double bst_smear_allowed(const bst_smear *s, double peak_e);

/* The coarsest level whose tolerance is within the aim for the last source, if its image moves by
 * `scale` of the path. */
int bst_smear_choose_level(const bst_smear *s, double scale);

/* Makes the scratch nodes of a source that moves by itself, changes or is a disc, relative to the
 * place (x, y), last_peak_e and last_read_e; none when it gives the sensor no light. electrons: in
 * the exposure. */
bst_status bst_smear_moving_nodes(bst_ctx *ctx, bst_smear *s, const bst_scene_source *source,
                                  double electrons, double x, double y) BST_MUST_CHECK;

/* The parts of bst_smear_node_aim for a Gaussian whose pixels are binned. */
void bst_smear_find_pixel_parts(double sigma_px, int binning, double part[3]);

/* A level's error for an image that moves by `scale` of the path, over the peak. */
double bst_smear_level_error(const bst_smear_level *level, double scale);

/* Error of a star so far from the boresight that follows its track, in sigma of its worst pixel. */
double bst_smear_single_error(const bst_smear *s, double peak_e, double from_boresight_px);

/* The last source's drawing: its place (px from the boresight), nodes, and motion over theirs. */
typedef struct bst_smear_drawn {
    double x, y, travel_px;
    double low[2], high[2]; /* box of its places about (x, y) */
    double error;           /* of its nodes and profiles, over the peak */
    int radius;             /* of the stamp */
    bool moving;
} bst_smear_drawn;

/* Sets last_error of the image of that source, wherever it falls. */
void bst_smear_set_error(bst_smear *s, const bst_smear_drawn *d);

/* What of those errors reaches the window, from where the source's places lie: lowers last_error,
 * sets last_presence and last_leaves. */
void bst_smear_bring_to_window(bst_smear *s, const bst_smear_drawn *d);

#endif
