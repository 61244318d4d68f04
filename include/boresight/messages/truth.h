/* Channel truth: the true scene of one exposure. */
#ifndef BORESIGHT_MESSAGES_TRUTH_H
#define BORESIGHT_MESSAGES_TRUTH_H

#include <stdbool.h>
#include <stdint.h>

#include "boresight/vec.h"

#define BST_CHANNEL_TRUTH "truth"

typedef enum bst_source_kind {
    BST_SOURCE_STAR = 0,
    BST_SOURCE_OBJECT = 1,
    BST_SOURCE_STAR_GHOST = 2, /* ghost of a star, or of an object */
    BST_SOURCE_OBJECT_GHOST = 3
} bst_source_kind;

/* True for an object and for a ghost of an object: the id is the object's. */
static inline bool bst_source_is_object(int32_t kind) {
    return kind == BST_SOURCE_OBJECT || kind == BST_SOURCE_OBJECT_GHOST;
}
/* True for a ghost. */
static inline bool bst_source_is_ghost(int32_t kind) {
    return kind == BST_SOURCE_STAR_GHOST || kind == BST_SOURCE_OBJECT_GHOST;
}

enum {
    BST_TRUTH_IN_FIELD = 1u << 0, /* mean position on the window */
    BST_TRUTH_OCCULTED = 1u << 1, /* behind the Earth */
    BST_TRUTH_SATURATED = 1u << 2,
};

/* One source of the true scene. Pixels are full-sensor coordinates; NAN where behind the camera. */
typedef struct bst_truth_item {
    int32_t kind;  /* bst_source_kind */
    uint32_t id;   /* star: identity in the catalogue, or statistical (bit 31); object: index in the
                      world; ghost: that of its source */
    int32_t norad; /* object: catalogue number, else 0 */
    uint32_t flags;
    double x_start_px, y_start_px, x_mid_px, y_mid_px, x_end_px, y_end_px;
    /* Light-weighted means over the exposure: of the chief ray, to which the other positions and
     * the WCS refer; and of the centroid on the focal plane, shifted by coma and other odd
     * aberrations, disc phase and vignetting. */
    double x_chief_px, y_chief_px, x_centroid_px, y_centroid_px;
    double delay_s; /* rolling shutter: delay of the middle of the source's own row exposure, to
                       which these positions refer, relative to the header's ticks; else 0 */
    double ra_rad, dec_rad; /* ICRS; star: place at epoch, from the observer (parallax); object:
                               geometric with light time, mid-exposure */
    double v_mag;           /* of a variable star: at mid-exposure */
    double electrons;       /* detected in the exposure, whole PSF */
    double snr;             /* sqrt(sum s^2 / sigma^2), sigma without the source's own light */
    double sunlit_fraction; /* object: visible fraction of the Sun's disc, mid-exposure */
    double phase_rad;       /* object: Sun - object - observer */
    double range_m;         /* object: mid */
} bst_truth_item;

/* Objects with a shape in one exposure, at most. */
enum { BST_TRUTH_SHAPES = 8 };

/* An object with a shape at mid-exposure. Pixels are full-sensor coordinates; NAN where a part is
 * behind the camera. */
typedef struct bst_truth_shape {
    int32_t item;      /* index in items */
    double x_px, y_px; /* centre of mass: the origin of the body */
    /* box around all parts, lit or not, without the PSF, and their largest extent; of what the
     * Earth's limb leaves, NAN for nothing */
    double x0_px, y0_px, x1_px, y1_px, size_px;
    double x_light_px, y_light_px; /* centroid of light; of the centre of mass without light */
    double light_xx_px2, light_xy_px2,
        light_yy_px2; /* second central moments of the light, without the PSF */
    /* relative to a point of the same light, 1 for a small body: SNR, output of a filter matched to
     * a point, and light of the brightest pixel */
    double snr_ratio, filter_ratio, peak_ratio;
    double visible; /* share of the light that the Earth's limb leaves, 0 to 1 */
    bst_quat q_body_from_gcrf;
} bst_truth_shape;

/* truth (queue): the true scene of one exposure. */
typedef struct bst_truth {
    int64_t exposure_id;
    int64_t start_tick, end_tick;
    bool dropped;
    bst_quat q_cam_from_gcrf_mid;  /* at the middle of the exposure, jitter included */
    bst_quat q_cam_from_gcrf_mean; /* mean over the exposure: shows stars at their mean positions;
                                      attitude of the header's WCS */
    bst_vec3 observer_gcrf_m, observer_gcrf_mps; /* mid-exposure */
    bst_vec3 velocity_bary_mps; /* mid-exposure; with sun_m for aberration and light deflection */
    bst_vec3 sun_m;             /* observer to Sun, mid-exposure */
    double boresight_x_px, boresight_y_px; /* intersection of the boresight with the focal plane */
    double background_e, dark_e;           /* expected electrons per pixel */
    double earth_fraction, moon_fraction,
        sun_fraction;   /* fraction of the window's area that the discs cover, 0 to 1 */
    double hits_e;      /* total charge of the radiation hits, electrons */
    int32_t hits;       /* radiation hits */
    double error_sigma; /* largest predicted rendering error of a pixel, in units of its noise; NAN:
                           unknown */
    int64_t nodes;      /* quadrature points of the sources' tracks */
    bool one_track;     /* all stars were rendered with one track */
    double pixel_scale_arcsec; /* of this exposure */
    int32_t shape_count;
    bst_truth_shape shapes[BST_TRUTH_SHAPES];
    int32_t count, lost; /* items; sources beyond the capacity */
    bst_truth_item items[];
} bst_truth;

#endif
