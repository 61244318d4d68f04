/* Locates and measures the candidate sources of a frame. */
#ifndef BST_IMGPROC_MEASURE_LOCATE_H
#define BST_IMGPROC_MEASURE_LOCATE_H

#include <stddef.h>

#include "boresight/camera_motion.h"
#include "imgproc/detect/candidates.h"
#include "imgproc/measure/fit.h"
#include "imgproc/measure/frame_width.h"
#include "imgproc/measure/sharpness.h"

/* Hot-pixel or cosmic-ray charge at a candidate, in frame pixels. */
typedef struct bst_imgproc_cosmic_ray {
    int pixels;       /* number of charged pixels; 0: none */
    double sharpness; /* the largest of them, see sharpness.h */
    double x_px, y_px, electrons;
    double snr; /* sqrt(sum d^2) / background noise */
    double length_px, width_px, angle_rad;
} bst_imgproc_cosmic_ray;

/* A located source. */
typedef struct bst_imgproc_found {
    bst_imgproc_source source;
    double noise_e; /* background noise at the source */
    double snr;     /* relative to background noise */
    double length_px, width_px, angle_rad;
    unsigned flags;  /* BST_DETECTION_... */
    bool streak;     /* the fitted shape is not a point */
    bool own_streak; /* a point that was fitted again as a streak */
    bool own_path;   /* its path was fitted beside the camera's uneven motion: own_path.h */
    bool joined;     /* put together from fragments: streak_fragments.h */
    bool dropped;
    bool bleed;               /* its charge blooms along columns: blooming.h */
    double bleed_e, bleed_px; /* with bleed: total charge, and width of the saturated columns */
    bool rough;               /* located by the filter's peak, not fitted */
    int neighbours;           /* number of neighbours in the latest fit */
    int label; /* bst_label: UNKNOWN, ARTEFACT, HOT_PIXEL (charge of one pixel) or HIT */
    double label_probability;
    bst_imgproc_cosmic_ray charge;
    float peak_snr;
    int peak_x, peak_y;
    double top_snr, top_x_px, top_y_px; /* interpolated peak of the filter output */
    int next;                           /* next in its cell of the spatial index */
} bst_imgproc_found;

/* The located source that contains a bst_imgproc_source. */
static inline const bst_imgproc_found *bst_imgproc_found_of(const bst_imgproc_source *source) {
    return (const bst_imgproc_found *)(const void *)((const char *)source -
                                                     offsetof(bst_imgproc_found, source));
}

/* Error law of filter-peak positions, see peak_centroid.h. */
typedef struct bst_imgproc_peak_law {
    double xx, xy, yy, photons, norm2, flux_photons, floor_px2;
} bst_imgproc_peak_law;

/* Scale between light and SNR, in noise of one electron. */
typedef struct bst_imgproc_light {
    double norm;     /* SNR of a source of one electron: sqrt(sum p^2), in the PSF of the fits */
    double response; /* output of the matched filter for it; the same if the filter has that PSF */
} bst_imgproc_light;

typedef struct bst_imgproc_locator {
    bst_imgproc_gauss psf;
    bst_source_profiles profiles;
    bst_fit *fits; /* one per thread */
    int threads;
    bst_scratch_pool lent;
    bst_sharpness sharpness;
    bst_imgproc_light light[2];  /* of a point, and of a star streak */
    bst_imgproc_peak_law law[2]; /* of a point, and of a star streak at the frame's centre */
    int max_side, capacity;
    int max_fits;                    /* number of brightest sources that are fitted; 0: all */
    double false_splits;             /* share of single sources reported as two; 0: no pair test */
    bst_imgproc_found *found, *next; /* [capacity]; next: results of a loop */
    int *from;                       /* [capacity]: candidate of each source */
    uint8_t *chosen;                 /* per candidate: it is selected */
    int count;
    int *cell; /* spatial index: first source of each cell, by its maximum */
    int columns, rows;
    double longest_px;     /* half of the longest source path of this frame, along an axis */
    bst_frame_width width; /* of the PSF in this frame, beside that of `profiles` */
    int *charged;          /* masked pixels of the latest frame that hold charge */
    int charged_count, charged_capacity;
} bst_imgproc_locator;

/* Input frame of the locator. */
typedef struct bst_locate_frame {
    float *signal; /* [height][width]; charge that is not light becomes BST_PIXEL_BAD */
    int width, height;
    const bst_background *background;
    const bst_filter *filter;
    const float *column_noise; /* [width]: pixel noise relative to the background's; NULL: 1 */
    /* least signal of a saturated pixel; 0 if a saturated pixel may hold charge that bloomed from
     * its neighbours */
    double full_e;
    double excess;   /* variance of shot noise per electron: bst_camera_excess_noise */
    double sigma_px; /* of the PSF, in this frame's pixels */
    const bst_camera_motion *motion; /* NULL: stars are points */
    /* of the camera's motion, which all sources share; NULL: none that matters to streaks */
    const bst_path_departure *departure;
    bool uneven; /* bend and departure matter to points, too */
    const bst_camera *camera;
    double origin_x_px, origin_y_px, binning; /* full-sensor = origin + binning * frame pixel */
    bst_parallel *pool; /* thread pool of the loops; NULL: the caller's thread */
} bst_locate_frame;

/* Noise of a pixel, e-. */
static inline double bst_locate_noise_at(const bst_locate_frame *f, int x, int y) {
    double noise = bst_background_noise_at(f->background, x, y);
    return f->column_noise ? noise * (double)f->column_noise[x] : noise;
}

/* Side of a cell of the spatial index, px. */
enum { BST_LOCATE_CELL_PX = 16 };

/* Sizes of a locator's memory. */
typedef struct bst_imgproc_locator_limits {
    int threads;  /* threads per loop */
    int capacity; /* detections */
    int max_width, max_height;
    int max_side; /* largest side of a stamp, px */
} bst_imgproc_locator_limits;

/* Creates a locator.
 *
 * Given:     known  PSF, lent; NULL: Gaussian
 * Errors:    BST_ERR_MEMORY
 * Ownership: free with bst_imgproc_locator_free */
bst_status bst_imgproc_locator_create(bst_ctx *ctx, const bst_known_psf *known,
                                      const bst_imgproc_locator_limits *limits,
                                      bst_imgproc_locator *out) BST_MUST_CHECK;
/* Frees the memory of a locator and clears the struct, which belongs to the caller. */
void bst_imgproc_locator_free(bst_imgproc_locator *locator);

/* Locates and measures the brightest `capacity` candidates; found is sorted by falling brightness.
 *
 * Pixels sharper than the PSF are masked first. A candidate without a source in its other pixels is
 * labelled HOT_PIXEL or HIT, by its number of pixels.
 *
 * Each candidate is fitted as a point or as a star streak, by the larger filter output. If the
 * outputs are close, or the point's is larger but not by far, both are fitted; the lower chi-square
 * wins. Neighbours centred on its pixels are fitted jointly.
 *
 * The fits run in parallel, in groups of similar brightness. A group uses the fitted positions of
 * brighter sources and the filter peaks of its own. Blends are then fitted again.
 *
 * The PSF widening by jitter is measured on sources above SNR 20; its mean is used for fainter
 * ones. A point that proves elongated is fitted again as a streak of its own length and angle.
 *
 * With locator->max_fits, fainter sources beyond that number are located at the filter's peak
 * (peak_centroid.h), unless charge lies on them. */
void bst_locate(bst_imgproc_locator *locator, const bst_locate_frame *frame,
                const bst_candidates *candidates);

/* Prepares PSF profiles and sharpness test for the frame, as bst_locate does first. */
void bst_locate_prepare(bst_imgproc_locator *locator, const bst_locate_frame *frame);

/* Drops streaks that grew from other points of a brighter one's light. After a search for streaks,
 * which joins most of them with a fit of its own. */
void bst_locate_join_streaks(bst_imgproc_locator *locator, const bst_locate_frame *frame);

/* Fits source i of the latest frame if only the matched filter located it. The source stays as it
 * is if the fit fails, shows no light but that of charge, or grows into a streak that is found
 * already.
 *
 * Returned:  whether the source is now the fitted one */
bool bst_locate_again(bst_imgproc_locator *locator, const bst_locate_frame *frame, int i);

/* Locates candidates without fits: at the filter's maximum, to a pixel, with the filter's flux. For
 * frames in which stars moved further than is modelled. */
void bst_locate_roughly(bst_imgproc_locator *locator, const bst_locate_frame *frame,
                        const bst_candidates *candidates);

#endif
