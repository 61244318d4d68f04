/* Locates and measures the candidates of one frame. */
#ifndef BST_IMGPROC_MEASURE_LOCATE_H
#define BST_IMGPROC_MEASURE_LOCATE_H

#include <stddef.h>

#include "boresight/camera_motion.h"
#include "imgproc/detect/candidates.h"
#include "imgproc/measure/fit.h"
#include "imgproc/measure/sharpness.h"

/* Charge that is not light, in pixels of the frame. */
typedef struct bst_imgproc_cosmic_ray {
    int pixels;       /* 0: none */
    double sharpness; /* greatest of them, see sharpness.h */
    double x_px, y_px, electrons;
    double snr; /* sqrt(sum d^2) over the background's noise */
    double length_px, width_px, angle_rad;
} bst_imgproc_cosmic_ray;

typedef struct bst_imgproc_found {
    bst_imgproc_source source;
    double noise_e; /* of the background there */
    double snr;     /* against the background's noise */
    double length_px, width_px, angle_rad;
    unsigned flags; /* BST_DETECTION_... */
    bool streak;    /* the shape that fits is not a point */
    bool dropped;
    bool bleed;               /* its charge overflowed along its columns: blooming.h */
    double bleed_e, bleed_px; /* with bleed: charge of all its pixels, width of the full ones */
    bool rough;               /* placed by the filter, not fitted */
    int neighbours;           /* neighbours that the latest fit counted with */
    int label; /* bst_label: UNKNOWN, ARTEFACT, HOT_PIXEL (one pixel's charge) or HIT */
    double label_probability;
    bst_imgproc_cosmic_ray charge;
    float peak_snr;
    int peak_x, peak_y;
    double top_snr, top_x_px, top_y_px; /* of the filter's output between the pixels */
    int next;                           /* in its cell of the frame */
} bst_imgproc_found;

/* The one that a source belongs to. */
static inline const bst_imgproc_found *bst_imgproc_found_of(const bst_imgproc_source *source) {
    return (const bst_imgproc_found *)(const void *)((const char *)source -
                                                     offsetof(bst_imgproc_found, source));
}

/* How well the filter's top is known: see peak_centroid.h. */
typedef struct bst_imgproc_peak_law {
    double xx, xy, yy, photons, norm2, flux_photons, floor_px2;
} bst_imgproc_peak_law;

typedef struct bst_imgproc_locator {
    bst_imgproc_gauss psf;
    bst_source_profiles profiles;
    bst_fit *fits; /* one for each thread */
    int threads;
    bst_scratch_pool lent;
    bst_sharpness sharpness;
    bst_imgproc_peak_law law[2]; /* of a point, and of a star's streak on the middle of the frame */
    int max_side, capacity;
    int max_fits;                    /* so many of the brightest are fitted; 0: all */
    bst_imgproc_found *found, *next; /* [capacity]; next: what a loop makes of them */
    int *from;                       /* [capacity]: the candidate of each */
    uint8_t *chosen;                 /* for each candidate that a frame may have */
    int count;
    int *cell; /* first found in each square of the frame, by its maximum */
    int columns, rows;
    double longest_px; /* half of the longest path of a source of this frame, along an axis */
    double widening_sum, widening_weight;
    int *charged; /* pixels of the latest frame that hold charge */
    int charged_count, charged_capacity;
} bst_imgproc_locator;

/* What one frame gives. */
typedef struct bst_locate_frame {
    float *signal; /* [height][width]; pixels with charge that is not light become BST_PIXEL_BAD */
    int width, height;
    const bst_background *background;
    const bst_filter *filter;
    const float *column_noise; /* [width]: of a pixel over the background's; NULL: 1 */
    double full_e;             /* least signal of a saturated pixel; 0: of one that may have taken
                                  its neighbours' overflow */
    double sigma_px;           /* of the PSF, in this frame's pixels */
    const bst_camera_motion *motion; /* NULL: stars are points */
    const bst_camera *camera;
    double origin_x_px, origin_y_px, binning; /* full-sensor = origin + binning * frame pixel */
    bst_parallel *pool;                       /* for the loops; NULL: the caller's thread */
} bst_locate_frame;

/* Noise of a pixel. */
static inline double bst_locate_noise_at(const bst_locate_frame *f, int x, int y) {
    double noise = bst_background_noise_at(f->background, x, y);
    return f->column_noise ? noise * (double)f->column_noise[x] : noise;
}

/* Squares of the frame that the found ones are kept by, px. */
enum { BST_LOCATE_CELL_PX = 16 };

/* What a locator has room for. */
typedef struct bst_imgproc_locator_limits {
    int threads;  /* of a loop */
    int capacity; /* detections */
    int max_width, max_height;
    int max_side; /* of a stamp */
} bst_imgproc_locator_limits;

/* known: lent; NULL: the PSF is a Gaussian. */
bst_status bst_imgproc_locator_create(bst_ctx *ctx, const bst_known_psf *known,
                                      const bst_imgproc_locator_limits *limits,
                                      bst_imgproc_locator *out) BST_MUST_CHECK;
/* Frees the memory of a locator and clears the struct, which belongs to the caller. */
void bst_imgproc_locator_free(bst_imgproc_locator *locator);

/* SNR of a source of one electron in noise of one, as a point or drawn as stars are. */
static inline double bst_locate_norm(const bst_locate_frame *frame, bool streak) {
    return streak ? frame->filter->streak_norm : frame->filter->norm;
}

/* Fits the brightest `capacity` candidates, brightest first: found is in that order. Each is taken
 * for a point or for a streak as the greater filter output says; both are fitted where the outputs
 * are close, or the point's is the greater but not by far, and the lower chi-square stays.
 * Neighbours whose centres lie on its pixels are fitted with it. Fits are shared by the pool's
 * threads: a group of like brightness at a time, which see the brighter ones where these were found
 * and one another at their maxima; blends are then fitted again. The widening of the PSF (jitter)
 * is measured on sources of SNR 20 and more and its mean is used for the fainter ones. A point that
 * turns out elongated is fitted again as a streak of its own length and angle.
 *
 * With locator->max_fits, fainter ones than so many stand at the top of the filter's output
 * (peak_centroid.h), unless charge lies on them.
 *
 * Pixels that are sharper than light are left out first. What the others then do not show to be a
 * source is a HOT_PIXEL or a HIT, by the number of pixels. */
void bst_locate(bst_imgproc_locator *locator, const bst_locate_frame *frame,
                const bst_candidates *candidates);

/* What bst_locate does first: the PSF's profiles and sharpness for the frame. */
void bst_locate_prepare(bst_imgproc_locator *locator, const bst_locate_frame *frame);

/* Fits number i of the latest frame if the filter placed it. */
void bst_locate_again(bst_imgproc_locator *locator, const bst_locate_frame *frame, int i);

/* The same without fits: each stands at its maximum, known to a pixel, with the flux that the
 * filter says. For frames in which stars moved further than is modelled. */
void bst_locate_roughly(bst_imgproc_locator *locator, const bst_locate_frame *frame,
                        const bst_candidates *candidates);

#endif
