/* Constants, frame parameters and source records shared by host and kernels. C17 and OpenCL C. */
#ifndef BST_SCENEGEN_SCENE_SHARED_H
#define BST_SCENEGEN_SCENE_SHARED_H

#ifdef __OPENCL_VERSION__
/* Forces inlining: outside the kernel compilers use short vectors. */
#define INLINE static inline __attribute__((always_inline))
/* Before a loop over the vectors of a chunk in rarely used code, which unrolled would take most of
 * the program's compile time. A lane's pixels are few, and an array of them that a loop runs over
 * would go through memory. */
#ifdef ONE_LANE
#define KEEP_LOOP _Pragma("unroll")
#else
#define KEEP_LOOP _Pragma("unroll 1")
#endif
#endif

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
/* Blocks whose boxes a work-group of kernels/block_boxes.cl makes, and its work-items. */
#define BST_BOX_GROUP (BST_BLOCK * BST_BLOCK)
/* Work-items of a work-group that renders a tile of 64 columns together, for each of its rows. */
#define BST_ROW_LANES 16
/* Cosmic-ray pixels placed by a work-group. */
#define BST_HIT_GROUP 64
/* Rows of a block of the read-out in which the tail of the read noise is drawn (read_tail.cl). */
#define BST_TAIL_ROWS 16
/* Work-items of a work-group of the staged read-out. */
#define BST_READOUT_GROUP 64
/* Multiplication register (multiplication.h): fewer electrons than this have a row in its table
 * each, the others share an empty one; each has so many steps from -reach to reach standard
 * deviations. */
#define BST_MULTIPLY_FEW 16
#define BST_MULTIPLY_STEPS 448
#define BST_MULTIPLY_REACH 7.0f
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

/* Effects of a camera's detector: response per pixel, dark current per pixel, charge in addition to
 * light (cosmic rays), nonlinearity, offsets of columns and rows, table of output codes, blooming,
 * light during the transfer; whether saturation flags are stored; charge gathered outside the
 * exposure, coherent pick-up. */
#define BST_EFFECT_GAIN 1
#define BST_EFFECT_DARK 2
#define BST_EFFECT_OVERLAY 4
#define BST_EFFECT_NONLINEAR 8
#define BST_EFFECT_OFFSETS 16
#define BST_EFFECT_CODES 32
#define BST_EFFECT_BLOOM 64
#define BST_EFFECT_TRANSFER 128
#define BST_EFFECT_FLAGS 256
#define BST_EFFECT_READOUT 512
#define BST_EFFECT_PICK_UP 1024
#define BST_EFFECT_MARKS 2048      /* pixels at full well are marked before charge moves on */
#define BST_EFFECT_MEANS 4096      /* the image holds expected charge, dark current included */
#define BST_EFFECT_FLICKER 8192    /* the read noise of each pixel is drawn beforehand */
#define BST_EFFECT_CROSSTALK 16384 /* is added while charge is read */

/* Laws of bst_kernel_vignetting_params: none; the fourth power of the cosine of the field angle,
 * 1 / (1 + v1 s)^2; a polynomial, 1 + v1 s + v2 s^2 + v3 s^3. s: squared distance from the centre.
 */
#define BST_SHADE_NONE 0
#define BST_SHADE_COS4 1
#define BST_SHADE_POLYNOMIAL 2

/* The structures have only 32-bit members, so that both languages have the same layout. */

/* Fixed-point positions of nodes on a camera's sensor. */
typedef struct bst_kernel_node_params {
    int place_bits;           /* binary digits after the point */
    float parts, per_parts;   /* 2^place_bits and its inverse */
    float subpixels;          /* parts of a pixel per axis to whose centres nodes move; 0: exact */
    float per_subpixels;      /* 1 / subpixels */
    int distorted;            /* 0: the members below are not used */
    float k1, k2, k3, p1, p2; /* distortion (include/boresight/camera.h), scaled to pixels */
    float fold2;              /* squared distance of the fold from the boresight, px^2 */
} bst_kernel_node_params;

/* Vignetting of the sources' light. */
typedef struct bst_kernel_vignetting_params {
    int law;                  /* BST_SHADE_... */
    float centre_x, centre_y; /* boresight, px */
    float limit2;             /* squared distance beyond which there is no light, px^2 */
    float v1, v2, v3;         /* coefficients of the law, px^-2, px^-4, px^-6 */
} bst_kernel_vignetting_params;

/* Parameters of a frame. Those from `nodes` on are the camera's, equal in all frames. */
typedef struct bst_kernel_frame_params {
    int window_x0, window_y0, window_width, window_height;
    int sensor_width;
    int tiles_x0; /* sensor column of the first tile: a multiple of 64 */
    int tiles_x, tiles_y;
    int first_row, first_tile; /* within the frame, if the window is one of its bands */
    int source_groups;         /* sources / BST_BLOCK, rounded up */
    int sources, blocks;       /* rendered sources and blocks of their nodes */
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
        light_stride;     /* image that is read out: first sensor row, rows, floats per row */
    int real_y0, real_y1; /* its rows that are no overscan: first, and behind the last */
    int binning;
    int map_step, map_x0, map_y0, map_columns, map_rows; /* of the background map, if it varies */
    bst_kernel_node_params nodes;
    bst_kernel_vignetting_params vignetting;
    int effects;                /* BST_EFFECT_..., where they are no build option */
    int maps_stride, maps_rows; /* of the detector's maps; the stride is a multiple of 64 */
    float single_from;          /* means from here on use one deviate for both noises */
    float bend1, bend2, bend3;  /* nonlinearity, by the share of the full well */
    float tail_gap, tail_rms_e; /* read noise's tail (read_tail.cl) */
    float transfer_row_s;       /* transfer time per row */
    int offsets_rows;           /* first row offset in the buffer of offsets */
    float multiply_rms;         /* spread of the multiplication: sqrt(1 - 1 / gain) */
    int outputs, mirrored;      /* crosstalk, with BST_EFFECT_CROSSTALK, as in */
    float crosstalk;            /* bst_kernel_coupling_params */
} bst_kernel_frame_params;

#define BST_TRAP_KINDS 3
/* Traps on the way of charge packets (kernels/charge_transfer.cl). */
typedef struct bst_kernel_trap_params {
    int width, height, stride; /* of the image */
    int backwards;             /* the last row or column is read first */
    int kinds;                 /* species with traps */
    float exponent;
    float density[BST_TRAP_KINDS]; /* traps in a pixel over reference charge to `exponent` */
    float release[BST_TRAP_KINDS]; /* share released in the time of one transfer */
} bst_kernel_trap_params;

#define BST_PERSISTENCE_KINDS 5
/* Traps that keep charge from frame to frame (kernels/persistence.cl). */
typedef struct bst_kernel_persistence_params {
    bst_kernel_frame_params frame;
    int kinds;                             /* species with traps */
    int in_ramp;                           /* the image is the charge of an interval of a ramp */
    int continues;                         /* not its first interval: the pixels hold charge */
    int image;                             /* 0, 1, ...: of the light, in its buffer */
    float share[BST_PERSISTENCE_KINDS];    /* of the charge that they hold after a long time */
    float gap[BST_PERSISTENCE_KINDS];      /* of their charge that stays between the exposures */
    float stay[BST_PERSISTENCE_KINDS];     /* and during the exposure */
    float fill[BST_PERSISTENCE_KINDS];     /* of `share` that a steady growth from 0 has filled */
    float duration[BST_PERSISTENCE_KINDS]; /* of the exposure in time constants */
} bst_kernel_persistence_params;

#define BST_FLICKER_KINDS 10
/* 1/f noise of single pixels (kernels/pixel_flicker.cl). */
typedef struct bst_kernel_flicker_params {
    bst_kernel_frame_params frame;
    int terms;
    float spread; /* of a frame about what is expected, e- */
    float weight[BST_FLICKER_KINDS], decay[BST_FLICKER_KINDS];
    float gain[BST_FLICKER_KINDS]; /* e- */
} bst_kernel_flicker_params;

/* A ramp of non-destructive reads (kernels/ramp.cl). */
typedef struct bst_kernel_ramp_params {
    bst_kernel_frame_params frame; /* of each interval */
    int interval;                  /* 0, 1, ...: that before read interval + 1; the first one */
    int intervals;                 /* from it on, whose light lies in images behind each other */
    int reads;
    int last_minus_first; /* instead of the least-squares line */
    float line_from;      /* signals from here on, e-, are drawn at once; below 0: none */
    float weight[64];     /* of the charge of each interval in the signal */
    float variance[65];   /* of the read noise, by the number of reads used, e-^2 */
} bst_kernel_ramp_params;

/* Effects between pixels of an image (kernels/charge_coupling.cl). */
typedef struct bst_kernel_coupling_params {
    int width, height, stride;
    int x0, x1, y0, y1; /* real pixels: first column and row, and those behind the last */
    float coupling;     /* share that each of the four neighbours takes over */
    float shift;        /* of the border between two pixels, px per electron */
    int outputs;        /* crosstalk: equal parts of a row */
    int mirrored;       /* every second part is read from its last column on */
    float crosstalk;    /* share of each other output */
} bst_kernel_coupling_params;

/* Record of one source for the node kernel. */
typedef struct bst_kernel_source_record {
    float x_px, y_px; /* relative to the boresight at the reference attitude, without distortion */
    int place_x, place_y; /* the same in fixed-point px on the sensor (bst_kernel_node_params) */
    float electrons;      /* in the exposure */
    int first_table;      /* first block in the node table */
    int blocks;
    int first_box; /* of the blocks' boxes, in groups of BST_BLOCK */
    int radius;    /* stamp radius beyond the two nearest pixels of a node */
    int first;     /* of its blocks, among those of all sources */
} bst_kernel_source_record;

#endif
