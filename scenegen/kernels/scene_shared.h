/* What host and kernels agree on: sizes and the parameters of one frame. C17 and OpenCL C. */
#ifndef BST_SCENEGEN_SCENE_SHARED_H
#define BST_SCENEGEN_SCENE_SHARED_H

/* Nodes travel in blocks of this many, one vector register. */
#define BST_BLOCK 16
/* Sub-pixel phases of the profile table; one more row closes the interval. */
#define BST_PHASES 256
/* Floats per node of a node table: the homography from the reference attitude's tangent plane to
 * the node's, as nine coefficients, then the weight. */
#define BST_TABLE_ROWS 10

/* 32-bit members only, so that both languages lay it out alike. */
typedef struct bst_scene_params {
    int window_x0, window_y0, window_width, window_height;
    int sensor_width;
    int tiles_x0; /* sensor column of the first tile: a multiple of 64 */
    int tiles_x, tiles_y;
    int source_groups; /* sources / BST_BLOCK, rounded up */
    unsigned key0, key1, exposure_low, exposure_high;
    float background_e; /* expected, per pixel */
    float read_noise_e;
    float full_well_e;
    float near_full_e; /* means above may fill the well */
    float dn_per_e;
    float offset_dn;
    float max_dn;
    int map_step, map_x0, map_y0, map_columns, map_rows; /* of the background, if it varies */
} bst_scene_params;

/* One source on its way to its nodes. */
typedef struct bst_scene_source {
    float x_px, y_px; /* at the reference attitude, from the boresight, without distortion */
    float electrons;  /* in the exposure */
    int first_table;  /* block of the node table */
    int first_block;  /* block of the frame's nodes */
    int blocks;
    int radius; /* stamp rows reach this far beyond the two nearest pixels */
    int chunks; /* stamp columns in vectors of 16 */
} bst_scene_source;

#endif
