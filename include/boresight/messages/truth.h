/* Channel truth: the true scene of one exposure. */
#ifndef BORESIGHT_MESSAGES_TRUTH_H
#define BORESIGHT_MESSAGES_TRUTH_H

#include <stdbool.h>
#include <stdint.h>

#include "boresight/vec.h"

#define BST_CHANNEL_TRUTH "truth"

typedef enum bst_source_kind { BST_SOURCE_STAR = 0, BST_SOURCE_OBJECT = 1 } bst_source_kind;

enum {
    BST_TRUTH_IN_FIELD = 1u << 0, /* mean position on the window */
    BST_TRUTH_OCCULTED = 1u << 1, /* behind the Earth */
    BST_TRUTH_SATURATED = 1u << 2,
};

/* One source of the true scene. Pixels are full-sensor coordinates; NAN where behind the camera. */
typedef struct bst_truth_item {
    int32_t kind;  /* bst_source_kind */
    uint32_t id;   /* star: Tycho-2 identity, or statistical (bit 31); object: index in the world */
    int32_t norad; /* object: catalogue number, else 0 */
    uint32_t flags;
    double x_start_px, y_start_px, x_mid_px, y_mid_px, x_end_px, y_end_px;
    /* Means over the exposure, weighted with the source's light in time: of the chief ray, whose
     * the other places are too and whose place the WCS gives; and of the light on the focal plane,
     * which coma and other odd aberrations, the phase of a disc and vignetting move from there. */
    double x_chief_px, y_chief_px, x_centroid_px, y_centroid_px;
    double delay_s; /* rolling shutter: the exposure of the source's own row, whose these places
                       are, has its middle so much later than the header's ticks; else 0 */
    double ra_rad,
        dec_rad; /* ICRS; star: catalogue place at epoch; object: geometric with light time, mid */
    double v_mag;
    double electrons;       /* detected in the exposure, whole PSF */
    double snr;             /* sqrt(sum s^2 / sigma^2), sigma without the source's own light */
    double sunlit_fraction; /* object: of the Sun's disc, mid */
    double phase_rad;       /* object: Sun - object - observer */
    double range_m;         /* object: mid */
} bst_truth_item;

/* truth (queue): the true scene of one exposure. */
typedef struct bst_truth {
    int64_t exposure_id;
    int64_t start_tick, end_tick;
    bool dropped;
    bst_quat q_cam_from_gcrf_mid;  /* at the middle of the exposure, jitter included */
    bst_quat q_cam_from_gcrf_mean; /* averaged over the exposure, so that it shows stars at their
                                      mean places: the attitude of the header's WCS */
    bst_vec3 observer_gcrf_m, observer_gcrf_mps; /* mid */
    bst_vec3 velocity_bary_mps;            /* mid; with sun_m it gives the light's corrections */
    bst_vec3 sun_m;                        /* observer to Sun, mid */
    double boresight_x_px, boresight_y_px; /* where the boresight meets the focal plane */
    double background_e, dark_e;           /* expected electrons per pixel */
    double earth_fraction, moon_fraction, sun_fraction; /* of the window's area that their discs
                                                           cover, 0 to 1 */
    double hits_e;      /* charge of the radiation hits on the sensor, electrons */
    int32_t hits;       /* radiation hits */
    double error_sigma; /* largest expected rendering error of a pixel, in units of its noise; NAN:
                           unknown */
    int64_t nodes;      /* quadrature points of the sources' tracks */
    bool one_track;     /* the stars followed one track */
    double pixel_scale_arcsec; /* of this exposure */
    int32_t count, lost;       /* items; sources beyond the capacity */
    bst_truth_item items[];
} bst_truth;

#endif
