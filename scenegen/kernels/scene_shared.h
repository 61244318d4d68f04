/* What host and kernels agree on: sizes, parameters of a frame, its sources. C17 and OpenCL C. */
#ifndef BST_SCENEGEN_SCENE_SHARED_H
#define BST_SCENEGEN_SCENE_SHARED_H

/* Nodes travel in blocks of this many, one vector register. */
#define BST_BLOCK 16
/* Rows of a stamp that are added at once, and those below a tile that are then written to no
 * purpose. */
#define BST_STAMP_RUN 2
#define BST_SPARE_ROWS (BST_STAMP_RUN - 1)
/* Coefficients of the profile law's first two derivatives by the widening (profile_law.h). */
#define BST_LAW_FIRST 6
#define BST_LAW_SECOND 4
/* Pixels with radiation hits that a work-group places. */
#define BST_HIT_GROUP 64
/* The Fourier path's table holds nodes widened by (n / BST_WIDTHS)^2 BST_WIDEST of the PSF's
 * variance, n from 0 to BST_WIDTHS. Between widths it is interpolated linearly in the variance,
 * between which a Gaussian's peak goes as the square root of its inverse: on each axis that misses
 * 3/8 w / BST_WIDTHS^2 / (1 + w)^2 of the peak for a widening by w variances. */
#define BST_WIDTHS 32
#define BST_WIDEST 1.0f
/* Floats per node of a node table: the homography from the reference attitude's tangent plane to
 * the node's, as nine coefficients, then the weight and the widening in PSF variances. */
#define BST_TABLE_ROWS 11
/* Places from the boresight stay below this many parts of a pixel, so that sums of two fit an int.
 */
#define BST_PLACE_LIMIT (1 << 29)

/* Why a pixel is saturated: the well (of a binned pixel, one of them) is full, the converter is at
 * its top. The bits of bst_planes.saturation. */
#define BST_FLAG_FULL_WELL 1
#define BST_FLAG_CONVERTER 2

/* 32-bit members only, so that both languages lay it out alike. */
typedef struct bst_kernel_frame_params {
    int window_x0, window_y0, window_width, window_height;
    int sensor_width;
    int tiles_x0; /* sensor column of the first tile: a multiple of 64 */
    int tiles_x, tiles_y;
    int first_row, first_tile; /* of the frame: where the window is one of its bands */
    int source_groups;         /* sources / BST_BLOCK, rounded up */
    unsigned key0, key1, exposure_low, exposure_high;
    float background_e; /* expected, per pixel: sky and dark current */
    float dark_e;       /* of it, dark current */
    float exposure_s;
    float read_noise_e;
    float full_well_e;
    float per_full_well; /* 1 / full_well_e */
    float near_full_e;   /* means above may fill the well */
    float dn_per_e;
    float offset_dn;
    float max_dn;
    int light_first, light_pitch; /* of the Fourier path's image, floats */
    int image_stride;             /* of the image of expected electrons, floats */
    int light_y0, light_height,
        light_stride; /* of the image that is read out: sensor row, rows, floats */
    int binning;
    int map_step, map_x0, map_y0, map_columns, map_rows; /* of the background, if it varies */
} bst_kernel_frame_params;

/* One source on its way to its nodes. */
typedef struct bst_kernel_source_record {
    float x_px, y_px;     /* at the reference attitude, from the boresight, without distortion */
    int place_x, place_y; /* the same on the sensor, px times 2^PLACE_BITS */
    float electrons;      /* in the exposure */
    int first_table;      /* block of the node table */
    int blocks;
    int first_box; /* of the blocks' boxes, by groups of BST_BLOCK */
    int radius;    /* the stamp reaches this far beyond the two nearest pixels of a node */
} bst_kernel_source_record;

#endif
