/* Image of a satellite's shape in perspective, before the PSF: exact coverage of small cells. */
#ifndef BST_SATELLITE_RESOLVED_IMAGE_H
#define BST_SATELLITE_RESOLVED_IMAGE_H

#include "sim/core/parallel.h"
#include "sim/satellite/flux.h"
#include "sim/satellite/polygon_clip.h"

/* Corners of a hidden region, at most. */
enum { BST_RESOLVED_HIDDEN_CORNERS = 67 };

/* A convex region of the image in which something nearer hides the body, such as the Earth. */
typedef struct bst_resolved_hidden {
    bst_point2 corner[BST_RESOLVED_HIDDEN_CORNERS]; /* px from the boresight, counter-clockwise */
    int count;
} bst_resolved_hidden;

/* Where the body is in a camera without distortion. Image axes: x right, y down, z along the
 * boresight. A point at (X, Y, Z) is at x = X / (Z scale_rad) px from the boresight, y likewise. */
typedef struct bst_resolved_view {
    bst_quat q_image_from_body;
    bst_vec3 origin_m; /* from the observer to the body's origin, image axes */
    double scale_rad;  /* angle of a px at the boresight */
    double limb_px;    /* error of borders of curved surfaces that is allowed, px: at most
                          curved_px; 0: BST_RESOLVED_LIMB_PX */
    double curved_px;  /* the same between parts of curved surfaces, which is in proportion to the
                          square of their size; 0: BST_RESOLVED_CURVED_PX */
    const bst_resolved_hidden *hidden; /* NULL: nothing hides the body; borrowed */
} bst_resolved_view;

/* Light of a material, in any unit: from a solid angle of one steradian whose BRDF times cosine of
 * incidence is 1 (sun: full sunlight; earth: that of bst_earthlight), or that emits. */
typedef struct bst_resolved_gain {
    double sun, earth, emission;
} bst_resolved_gain;

/* Illumination, body frame. */
typedef struct bst_resolved_light {
    bst_vec3 sun;                     /* unit */
    double sun_radius_rad;            /* angular radius of the Sun's disc; 0: a point */
    double shadow_at[2];              /* point of the disc that casts the shadows, from its centre:
                                         right and up in any axes, in radii of the disc */
    bool penumbrae;                   /* find the widths in bst_resolved_image.penumbrae */
    const bst_earthlight *earthlight; /* NULL: none */
    const bst_resolved_gain *gain;    /* [material_count] */
} bst_resolved_light;

/* A cell: its light, as a quantity and its first moments about the cell's centre in cells, and the
 * fraction that the body covers. Sums of all poses times their weights. */
typedef struct bst_resolved_cell {
    float light, moment_x, moment_y, cover;
} bst_resolved_cell;

/* Second moments of a cell's light about its centre, in cells. */
typedef struct bst_resolved_second {
    float xx, xy, yy;
} bst_resolved_second;

/* Borders of shadows of which the penumbrae are as wide, but for a factor of two. */
typedef struct bst_resolved_penumbra {
    double px;        /* half width across the widest, px */
    double light_px2; /* most of the sunlight beside one, per px^2 and without the weight, times the
                         square of its half width */
} bst_resolved_penumbra;

/* Widths, powers of two: half widths from 2^-8 px. */
enum { BST_RESOLVED_PENUMBRAE = 16 };

/* A grid of cells. Cell (i, j) has its centre at ((x0 + i + 0.5) cell_px, (y0 + j + 0.5) cell_px)
 * from the boresight. */
typedef struct bst_resolved_image {
    double cell_px;
    int x0, y0, width, height;
    bst_resolved_cell *cells;    /* [height][width] */
    bst_resolved_second *second; /* [height][width], after bst_resolved_end_light; else NULL */
    /* most light of a surface in any pose, and of one that is curved or has a round border, per
     * px^2, without the weight */
    double surface_light, curved_light;
    bst_resolved_penumbra penumbrae[BST_RESOLVED_PENUMBRAE]; /* that the Sun's disc would make */
    /* error of parts of curved surfaces ([0]) and of their borders ([1]) where more parts were
     * asked for than are made, px; 0: none */
    double reached_px[2];
    int16_t *part; /* [height][width] part that covers most of the cell in the latest pose
                      added; -1: none */
} bst_resolved_image;

/* The image of a model, with its work memory; for one thread. */
typedef struct bst_resolved bst_resolved;

/* Gaps and overlaps between parts of curved surfaces have up to half of that width, px. */
#define BST_RESOLVED_CURVED_PX 2.5e-4
/* Error of their borders, px. */
#define BST_RESOLVED_LIMB_PX 4e-5

/* Largest number of cells. */
enum { BST_RESOLVED_CELLS_MAX = 1 << 26 };

/* Creates the work memory for a model.
 *
 * Given:     satellite  outlives it
 * Returned:  *out  NULL on error
 * Errors:    BST_ERR_MEMORY
 * Ownership: free *out with bst_resolved_free */
bst_status bst_resolved_create(bst_ctx *ctx, const bst_satellite *satellite,
                               bst_resolved **out) BST_MUST_CHECK;
/* Frees the work memory; NULL is allowed. */
void bst_resolved_free(bst_resolved *resolved);

/* Box of a pose in the image, px from the boresight.
 *
 * Returned:  false if a part of the body is beside or behind the observer: it has no image */
bool bst_resolved_box(const bst_satellite_pose *pose, const bst_resolved_view *view, double low[2],
                      double high[2]);

/* Starts an empty image.
 *
 * Given:     low, high  corners of the box that is wanted, px; light outside is left out
 *            cell_px    side of a cell
 * Errors:    BST_ERR_RANGE for more than BST_RESOLVED_CELLS_MAX cells, BST_ERR_MEMORY */
bst_status bst_resolved_begin(bst_ctx *ctx, bst_resolved *resolved, const double low[2],
                              const double high[2], double cell_px) BST_MUST_CHECK;

/* The same for bst_resolved_begin_light alone: cells have no cover, and their parts are undefined,
 * and no values before bst_resolved_end_light. */
bst_status bst_resolved_begin_box(bst_ctx *ctx, bst_resolved *resolved, const double low[2],
                                  const double high[2], double cell_px) BST_MUST_CHECK;

/* Adds a pose.
 *
 * Given:     pose    joints as bst_satellite_pose_set left them; its views are changed
 *            light   illumination; NULL: only cover and parts
 *            weight  factor on light and cover, for example a share of the exposure
 * Returned:  *total  light of the pose within the box, without the weight; may be NULL
 * Errors:    BST_ERR_MEMORY
 * Notes:     sides of facets and borders of shadows are exact: the light of a cell is that of the
 *            areas of its visible, lit polygons: facets, also of parts that intersect, are cut
 * where others are nearer. Curved surfaces consist of facets of a fraction of a pixel, and their
 * shadows at grazing incidence are those on the middles of these. The Sun casts shadows from one
 * point of its disc: the mean of poses that differ in shadow_at has penumbrae. Light that is
 * reflected twice is left out. */
bst_status bst_resolved_add(bst_ctx *ctx, bst_resolved *resolved, bst_satellite_pose *pose,
                            const bst_resolved_view *view, const bst_resolved_light *light,
                            double weight, double *total) BST_MUST_CHECK;

/* True if the functions below draw a model as bst_resolved_add does: it has no curved surfaces. */
bool bst_resolved_may_add_light(const bst_satellite *satellite);

/* Starts to sum the light of poses, after bst_resolved_begin or
 * bst_resolved_begin_box. BST_ERR_MEMORY.
 *
 * Given:     blurred  there are so many poses that they blur the edges between facets of almost the
 *                     same light, whose second moments are then left out */
bst_status bst_resolved_begin_light(bst_ctx *ctx, bst_resolved *resolved,
                                    bool blurred) BST_MUST_CHECK;

/* The same for an image that bst_resolved_join_light adds to `first`, in which it has begun: the
 * edges of the model's facets are not found again, but borrowed from `first`, which must be freed
 * or made for another model only when this image is drawn no more. BST_ERR_MEMORY. */
bst_status bst_resolved_begin_light_beside(bst_ctx *ctx, bst_resolved *resolved,
                                           const bst_resolved *first, bool blurred) BST_MUST_CHECK;

/* Adds the light of a pose to these sums, as bst_resolved_add but fast for models of many facets,
 * with second moments and without cover and parts. `light` is not NULL. BST_ERR_MEMORY. */
bst_status bst_resolved_add_light(bst_ctx *ctx, bst_resolved *resolved, bst_satellite_pose *pose,
                                  const bst_resolved_view *view, const bst_resolved_light *light,
                                  double weight) BST_MUST_CHECK;

/* Ends the poses of an image: before others are joined to it, or it to another one. */
void bst_resolved_settle_light(bst_resolved *resolved);

/* Adds the sums of another image that began with the same box and cells; the poses of both have
 * ended.
 *
 * Given:     pool  of threads; NULL: the caller's alone */
void bst_resolved_join_light(bst_resolved *to, const bst_resolved *from, bst_parallel *pool);

/* Sets the light of the image, with its moments, to the sums.
 *
 * Given:     scale_rad  angle of a px at the boresight */
void bst_resolved_end_light(bst_resolved *resolved, double scale_rad);

/* The image so far; valid until the next call with `resolved`. */
const bst_resolved_image *bst_resolved_image_of(const bst_resolved *resolved);

#endif
