/* Channel detections: the sources found in one frame. */
#ifndef BORESIGHT_MESSAGES_DETECTIONS_H
#define BORESIGHT_MESSAGES_DETECTIONS_H

#include <stdint.h>

#include "boresight/vec.h"

#define BST_CHANNEL_DETECTIONS "detections"

typedef enum bst_label {
    BST_LABEL_UNKNOWN = 0,
    BST_LABEL_STAR,   /* identified in the onboard catalogue; without star_id: moves like a star */
    BST_LABEL_OBJECT, /* not a star: it moves, or the catalogue has no star there */
    BST_LABEL_ARTEFACT,  /* cut by the edge, spike of a bright star, or no source by its shape */
    BST_LABEL_HOT_PIXEL, /* sharper than the PSF, at the same pixel again, or one pixel alone */
    BST_LABEL_HIT,       /* radiation: sharper than the PSF, in this frame only */
} bst_label;

enum {
    BST_DETECTION_SATURATED = 1u << 0,
    BST_DETECTION_EDGE = 1u << 1,
    BST_DETECTION_STREAK = 1u << 2, /* elongated beyond the PSF */
    BST_DETECTION_BLEND = 1u << 3,
    BST_DETECTION_BLOOM =
        1u << 5, /* charge overflowed along its columns: centroid from its wings */
    BST_DETECTION_STACK = 1u << 4, /* detected in a stack of frames that ends with this one */
    /* larger than the PSF: x_px and y_px are its estimated centre of mass, see extent */
    BST_DETECTION_EXTENDED = 1u << 6,
    /* streak among streaks of stars whose length or direction is another one than theirs */
    BST_DETECTION_OTHER_PATH = 1u << 7,
};

/* Measures of an extended target, full-sensor coordinates; all 0 without BST_DETECTION_EXTENDED. */
typedef struct bst_detection_extent {
    double light_x_px, light_y_px;     /* centroid of light */
    double x0_px, y0_px, x1_px, y1_px; /* bounding box */
    double size_px, size_sigma_px;     /* largest extent of the outline */
    double area_px2;                   /* of the silhouette, dark holes filled */
    double phase_rad;                  /* Sun - target - observer, by the onboard Sun */
    double saturated_share;            /* share of the area that is saturated */
    double range_m, range_sigma_m;     /* from the known size or model; 0: unknown */
} bst_detection_extent;

typedef struct bst_detection {
    double x_px, y_px;             /* full-sensor coordinates, mid-exposure centroid */
    double cov_xx, cov_xy, cov_yy; /* px^2 */
    double flux_e, flux_sigma_e;
    double snr;
    double length_px, width_px, angle_rad; /* extent; angle of the long axis from +x towards +y */
    double v_mag;                          /* from flux and zero point */
    double v_mag_sigma; /* of the flux's noise and the zero point; INFINITY without light */
    uint32_t flags;
    uint32_t star_id;         /* identity in the star catalogue, 0 when none */
    int32_t label;            /* bst_label */
    double label_probability; /* that the label is right, 0 to 1; 0 where the label is UNKNOWN */
    double rate_x_pxps,
        rate_y_pxps;        /* rate against the stars; only with BST_DETECTION_STACK, else 0 */
    double rate_sigma_pxps; /* per axis */
    bst_detection_extent extent;
} bst_detection;

/* Number of parameters of bst_camera_calibration. */
enum { BST_CAMERA_CALIBRATION_SIZE = 5 };

/* What image processing has learned from stars about the camera's geometry, relative to the onboard
 * camera: bst_camera_apply_calibration. */
typedef struct bst_camera_calibration {
    int32_t frames; /* measured so far; 0: none, and the rest is 0 */
    double scale;   /* true pixel scale over the onboard one */
    /* to be added to the onboard camera's rotation_deg (in rad) and distortion */
    double rotation_rad, k1, p1, p2;
    /* of scale, rotation_rad, k1, p1, p2 */
    double covariance[BST_CAMERA_CALIBRATION_SIZE][BST_CAMERA_CALIBRATION_SIZE];
} bst_camera_calibration;

/* detections (queue): what image processing (or the generator) found in one frame. */
typedef struct bst_detections {
    int64_t exposure_id;
    int64_t start_tick, end_tick;
    bst_quat q_cam_from_gcrf;       /* onboard attitude used for star identification, mid-exposure:
                                       telemetry with the       tracker's predicted correction */
    bst_quat q_telemetry_from_gcrf; /* telemetry alone, mid-exposure */
    double background_e, noise_e;   /* median per pixel */
    double threshold_snr;
    /* covariance of a displacement that all streaks of stars share, px^2: by motion of the camera
     * that is not known. cov_xx of the items is without it */
    double shared_xx, shared_xy, shared_yy;
    /* V of one electron per second, from zero_point_stars of the frame's stars; if there are none,
     * the camera's nominal value */
    double zero_point_mag, zero_point_sigma_mag;
    int32_t zero_point_stars;
    int32_t stars_identified;
    int32_t windows; /* number of searched regions of interest around predictions; 0: full frame */
    int32_t count, lost; /* items; detections beyond the capacity */
    int32_t bad_pixels;  /* on the sensor, learned by image processing so far */
    bst_camera_calibration calibration;
    bst_detection items[];
} bst_detections;

#endif
