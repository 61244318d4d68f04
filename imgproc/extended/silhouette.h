/* Silhouettes: bright regions of a frame that are larger than the PSF. */
#ifndef BST_IMGPROC_EXTENDED_SILHOUETTE_H
#define BST_IMGPROC_EXTENDED_SILHOUETTE_H

#include <stdint.h>

#include "boresight/status.h"
#include "boresight/vec.h"
#include "imgproc/detect/background.h"
#include "imgproc/extended/extended_config.h"
#include "imgproc/extended/outline.h"

/* Silhouettes per frame. */
enum { BST_SILHOUETTES_MAX = 8 };

/* An extended target in a frame; pixels of the frame, origin at the centre of its first pixel. */
typedef struct bst_silhouette {
    double centre_x_px, centre_y_px; /* of the area within the outline */
    double area_px2;               /* of pixels that are not outside of edges, dark holes filled */
    double x_px, y_px;             /* centroid of that area */
    double light_x_px, light_y_px; /* centroid of light */
    double flux_e, flux_variance;
    double least_e;        /* signal of a pixel from which a part of its own has edges */
    double moment_size_px; /* size by the second moments of the light, less PSF and star streak */
    double length_px, width_px, angle_rad; /* extents of the outline */
    double x0_px, y0_px, x1_px, y1_px;     /* bounding box of the outline */
    bst_outline outline;
    int saturated_px; /* pixels */
    int parts;        /* connected regions that were joined */
    bool edge;        /* touches the frame's edge */
    bool masked;      /* its pixels are left out of the detection of points */
    bool may_extend;  /* of at least return_share times the hand-over size */
} bst_silhouette;

typedef struct bst_silhouettes {
    bst_silhouette items[BST_SILHOUETTES_MAX];
    int count;
} bst_silhouettes;

/* A connected bright region. */
typedef struct bst_bright_region {
    int first, count; /* its pixels in `pixels` */
    int x0, y0, x1, y1;
    double flux_e;
    int target; /* silhouette that it belongs to; below 0: none */
} bst_bright_region;

/* Work space for frames up to a size. */
typedef struct bst_silhouette_finder {
    int max_width, max_height;
    float *signal;     /* [height][width] e- above the sky */
    float saturated_e; /* signal of saturated pixels in the latest frame */
    uint8_t
        *region; /* [height][width] 1: in a bright region; later, in a bounding box: 2 outside */
    int *pixels; /* [2 * height * width] pixels of the regions, region after region */
    int pixel_count; /* of the regions */
    bst_bright_region *regions;
    int region_count;
    bst_outline_point *points, *hull;
} bst_silhouette_finder;

/* Allocates a finder.
 *
 * Errors:    BST_ERR_MEMORY; then `out` holds nothing to free
 * Ownership: free with bst_silhouette_finder_free */
bst_status bst_silhouette_finder_create(bst_ctx *ctx, int max_width, int max_height,
                                        bst_silhouette_finder *out) BST_MUST_CHECK;
/* Frees the memory of a finder and clears the struct, which belongs to the caller. */
void bst_silhouette_finder_free(bst_silhouette_finder *finder);

/* A frame in which silhouettes are searched. */
typedef struct bst_silhouette_frame {
    bst_imgproc_pixel_fn read; /* calibrated pixels, e-, background included */
    const void *user;
    const uint16_t *raw; /* [height][width], DN */
    int width, height;
    int saturated_dn;                /* least raw value of a saturated pixel */
    double full_e;                   /* signal that a saturated pixel counts for, e- */
    double read_variance_e2;         /* noise of a dark pixel, e-^2 */
    double sigma_px;                 /* of the PSF */
    bool wings;                      /* the PSF has more light far out than a Gaussian */
    double streak_x_px, streak_y_px; /* of a star in this frame */
} bst_silhouette_frame;

/* Size, share of the hand-over size, from which a source has a silhouette. */
#define BST_SILHOUETTE_LEAST 0.3

/* Finds the silhouettes of a frame, the largest first.
 *
 * Given:     config  handover_fwhm, return_share and join_share are used
 * Returned:  *out  sources of at least BST_SILHOUETTE_LEAST times the hand-over size; `masked`: of
 *                  at least the hand-over size
 *            mask  [height][width] set to 1 on pixels of masked targets and near them; else
 *                  unchanged
 * Notes:     level of the sky: the middle of the narrowest interval that holds a fifth of the
 *            pixels, so that a target may fill most of the frame. Hysteresis: a region consists of
 *            the pixels above 4 sigma that are connected with one above 8 sigma. Pixels below a
 *            ten-thousandth of the region's median are then left out (with `wings` a twentieth,
 * down to a thousandth in large regions and of a saturated median). Light, flux and moments are
 *            those of these pixels. The area leaves out light beyond the edges (bst_edges_outside),
 * and the outline lies at the edges (bst_edges_place) of light of SNR 5, and of parts that
 * are not outside of a brighter edge from SNR 3 on. Reference: hysteresis: Canny, IEEE Trans. PAMI
 * 8, 679 (1986), section VI */
void bst_silhouettes_find(bst_silhouette_finder *finder, const bst_extended_config *config,
                          const bst_silhouette_frame *frame, uint8_t *mask, bst_silhouettes *out);

#endif
