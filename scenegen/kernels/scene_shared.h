/* Constants, frame parameters and source records shared by host and kernels. C17 and OpenCL C. */
#ifndef BST_SCENEGEN_SCENE_SHARED_H
#define BST_SCENEGEN_SCENE_SHARED_H

/* Nodes per block: one vector register. */
#define BST_BLOCK 16
/* Stamp rows added at once, and the spare rows below a tile that such a run may write. */
#define BST_STAMP_RUN 2
#define BST_SPARE_ROWS (BST_STAMP_RUN - 1)
/* Floats before the profile law in its buffer (profile_law.h). */
#define BST_LAW_HEAD 2
/* Number of coefficients of the profile law's first two derivatives by the widening
 * (profile_law.h). */
#define BST_LAW_FIRST 6
#define BST_LAW_SECOND 4
/* Cosmic-ray pixels placed by a work-group. */
#define BST_HIT_GROUP 64
/* Widths in the Fourier path's table: (n / BST_WIDTHS)^2 BST_WIDEST of the PSF variance, n from 0
 * to BST_WIDTHS. Between them it is interpolated linearly in the variance. A Gaussian's peak varies
 * as the inverse square root, so each axis has a relative error of 3/8 w / BST_WIDTHS^2 / (1 + w)^2
 * for a widening of w variances. */
#define BST_WIDTHS 32
#define BST_WIDEST 1.0f
/* Floats per node of a node table: homography from the reference attitude's tangent plane to the
 * node's (nine coefficients), weight, and widening in PSF variances. */
#define BST_TABLE_ROWS 11
/* Limit of fixed-point positions relative to the boresight, so that the sum of two fits an int. */
#define BST_PLACE_LIMIT (1 << 29)

/* Saturation flags: the well is full (for a binned pixel, one of its wells), or the converter is at
 * its maximum. Bits of bst_planes.saturation. */
#define BST_FLAG_FULL_WELL 1
#define BST_FLAG_CONVERTER 2

/* Only 32-bit members, so that both languages have the same layout. */
typedef struct bst_kernel_frame_params {
    int window_x0, window_y0, window_width, window_height;
    int sensor_width;
    int tiles_x0; /* sensor column of the first tile: a multiple of 64 */
    int tiles_x, tiles_y;
    int first_row, first_tile; /* within the frame, if the window is one of its bands */
    int source_groups;         /* sources / BST_BLOCK, rounded up */
    unsigned key0, key1, exposure_low, exposure_high;
    float background_e; /* expected per pixel: sky and dark current */
    float dark_e;       /* dark current part of background_e */
    float exposure_s;
    float read_noise_e;
    float full_well_e;
    float per_full_well; /* 1 / full_well_e */
    float near_full_e;   /* means above it may reach the full well */
    float dn_per_e;
    float offset_dn;
    float max_dn;
    int light_first, light_pitch; /* of the Fourier path's image, floats */
    int image_stride;             /* of the image of expected electrons, floats */
    int light_y0, light_height,
        light_stride; /* image that is read out: first sensor row, rows, floats per row */
    int binning;
    int map_step, map_x0, map_y0, map_columns, map_rows; /* of the background map, if it varies */
} bst_kernel_frame_params;

/* Record of one source for the node kernel. */
typedef struct bst_kernel_source_record {
    float x_px, y_px; /* relative to the boresight at the reference attitude, without distortion */
    int place_x, place_y; /* the same in fixed-point px on the sensor (2^PLACE_BITS per px) */
    float electrons;      /* in the exposure */
    int first_table;      /* first block in the node table */
    int blocks;
    int first_box; /* of the blocks' boxes, in groups of BST_BLOCK */
    int radius;    /* stamp radius beyond the two nearest pixels of a node */
} bst_kernel_source_record;

#endif
