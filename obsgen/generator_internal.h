/* Internal declarations of the observation generator. */
#ifndef BST_OBSGEN_GENERATOR_INTERNAL_H
#define BST_OBSGEN_GENERATOR_INTERNAL_H

#include "obsgen/generator.h"
#include "obsgen/model/blend_weight.h"
#include "obsgen/model/local_sky.h"
#include "obsgen/streak/path_fit.h"
#include "obsgen/streak/star_trail.h"
#include "obsgen/streak/streak_centroid_error.h"
#include "sim/optics/ghosts.h"

/* A truth source on the frame, in read-out pixels. */
typedef struct generator_source {
    double x, y; /* mean of its path */
    bst_obsgen_path_px path;
    double length, flux_e;
    double visible;        /* share of its squared image on the frame */
    double ends;           /* share of both streak ends on the frame */
    double seen_x, seen_y; /* centre of the visible part */
    /* image of a shape (bst_truth_shape), read-out px^2; ratios 1 and moments 0: a point */
    double snr_ratio, filter_ratio, shape_xx, shape_xy, shape_yy;
    double blur;          /* variance of a ghost's image besides the PSF's, per axis, px^2 */
    double curvature;     /* of its maximum in the filter output, relative to a point's */
    double sharp;         /* factor on its amplitude; 1 for the PSF alone */
    double unraised;      /* SNR in the filter output at its place, without noise */
    double rise;          /* by noise, in `amplitude` */
    double amplitude;     /* mean peak of the filter output, SNR */
    double peak;          /* amplitude including the light of neighbours */
    double noise, spread; /* noise draw of the peak; its standard deviation */
    double level;         /* amplitude including noise */
    /* output of the frame's other filter relative to this one's amplitude; 0: one filter only */
    double other;
    /* where a point fit to it begins, or its own streak's ends, relative to the mean of its path */
    double start_x, start_y;
    double point_flux;    /* uneven path: light that this fit finds, of the whole */
    uint64_t name;        /* stream of its random draws */
    int item, head;       /* head: source with which it is merged; -1: none */
    int partner;          /* the other source of a pair that the pair test found; -1: none */
    double partner_widen; /* variance factor of its position by the fit of both */
    bool star, as_streak, found, saturated;
    bool own_streak; /* object on an uneven path: a point that is fitted again as a streak */
    bool broken;     /* longer than is filtered for: detected in fragments */
} generator_source;

typedef struct generator_rank {
    double amplitude;
    int index;
} generator_rank;

/* Light of a merged detection and its fitted neighbours. */
typedef struct generator_blend {
    double flux_e, x, y; /* as a single source */
    double widen;        /* variance factor by neighbours fitted jointly */
    double flat;         /* error factor along a streak that contains other light */
    bool near;  /* another detection in the fitted pixels, or a significant merged source */
    bool drawn; /* x and y already include their error */
    bool point; /* streak that the point filter shows better */
    double snr; /* of the drawn peak */
} generator_blend;

/* SNR above which size and own streak of a source are measured. */
enum { GENERATOR_MOMENTS_SNR = 10 };

/* Most places of a path whose steps are divided; see bst_star_trail_parts(). */
enum { GENERATOR_PLACES = 512 };

/* Streak-length steps of half a pixel up to the longest filtered streak. */
enum { GENERATOR_STEPS = 258 };

/* Light levels of the stars' bias table: decades of brightest pixel over noise variance. */
enum { GENERATOR_BIASES = 6 };
#define GENERATOR_FIRST_LIGHT 0.1

struct bst_generator {
    const bst_camera *camera;
    double electrons_per_s_v0; /* onboard zero point */
    bst_generator_settings settings;
    bool levels_columns; /* image processing subtracts column offsets */
    bst_obsgen_calibration calibration;
    bst_rng_key key;
    /* of the current frame */
    int64_t exposure_id;
    int binning, width, height;
    double origin_x, origin_y, exposure_s;
    double sigma, total_sigma; /* PSF without and with the pixel width, read-out px */
    double onboard_sigma_px;   /* PSF of the filters, sensor px */
    double fitted_sigma;       /* the same in read-out px */
    bst_response response;     /* of the filters to the frame's images */
    double filter_sigma;       /* filters' point image, with the pixel width */
    double cross_sigma;        /* width of the filter output about a source: sqrt(2) times it */
    bst_generator_filter filters[2]; /* for points, for star streaks */
    double shared_noise;             /* correlation of the two filters' noise */
    double white_share; /* share of the noise variance that is independent between pixels */
    /* shot noise of the brightest pixel over noise variance, per sqrt(sum p^2) and electron */
    double fit_light;
    bst_obsgen_path_px straight_path; /* nearest straight path to the true one */
    /* width of the images relative to the fitted ones, by deviations of the path */
    double widening;
    double path_rms_px; /* of the true path about the fitted one, per axis */
    bool followed;      /* image processing draws the whole path: its places have no bias */
    bool uneven;        /* the path is far from uniform: filter outputs follow `outputs` */
    bst_path_outputs outputs;
    /* lead of a point's fit over a streak's on an uneven path, by light level; see point_lead() */
    double point_lead[GENERATOR_BIASES];
    double point_flux[GENERATOR_BIASES]; /* light that a point's fit finds on it, of the whole */
    double known_width; /* width of the fits' images relative to the PSF's: that of the filters */
    double fit_px2;     /* squared width of the fits' images */
    /* centroid variance relative to a Gaussian of the PSF's noise-equivalent area */
    double place_ratio2;
    double norm_ratio[2]; /* sqrt(sum p^2) of the fits' images relative to the bound's */
    bst_crlb_table bound;
    const bst_crlb_table *image_bound, *onboard_bound; /* of the frame; NULL: from `bound` */
    bst_blend_weights blend_weights;
    bst_obsgen_path_px star_path;
    double bend_x, bend_y;
    bst_obsgen_path_px fit_path; /* of the streaks that are fitted, and its bend */
    double fit_bend_x, fit_bend_y;
    double bend_before,
        bend_after;           /* 1 sigma of the unknown bend without and with bright streaks */
    double ends_after;        /* 1 sigma of the measured length and of end minus start across */
    bst_star_trail_path path; /* true path; count 0: unknown */
    double *path_x, *path_y, *object_x, *object_y;
    int path_room;
    double streak;                             /* streak length, px; 0: not filtered for */
    bst_streak_centroid_error *centroid_error; /* for `streak`, once needed */
    bool smeared;
    double background_e, noise_e, threshold, streak_share;
    double excess;       /* variance of shot noise per electron: bst_camera_excess_noise */
    double open_share;   /* open-sky share of a crowded frame; 1: not crowded */
    double dark_noise_e; /* noise without the sources' light */
    /* background_bias_e: excess of the estimated background */
    double faint_light_e, faint_square_e2, background_bias_e;
    struct generator_thresholds {
        int width, height;
        /* 0: not computed */
        double sigma, threshold[GENERATOR_STEPS], streak_share[GENERATOR_STEPS];
    } thresholds;
    generator_source *sources; /* by row */
    generator_rank *ranks;
    int rank_count; /* by brightness, without light-only sources */
    int source_count, source_capacity;
    double reach; /* largest extent of any source's light, px */
    /* star trail in smeared frames, and trail of an individual source */
    bst_star_trail_node *route, *way;
    int route_count;
    double route_top;              /* largest light */
    double route_box[4];           /* least and greatest x, least and greatest y */
    bst_obsgen_path_px whole_path; /* from start to end */
    struct generator_streaks *streaks;
    bst_local_sky wing_sky; /* background by mesh with the wings of bright sources */
    /* centroid bias of fits by the true camera motion, by light level */
    double star_bias[GENERATOR_BIASES][2], streak_bias[GENERATOR_BIASES][2];
    double bias_sigma;  /* see bst_star_trail_point_bias */
    double image_sigma; /* width of a point at rest, including the pixel */
    bst_obsgen_generated *items;
    int count, lost;
};

/* Sets the visible share of a source's image. The squared light counts, because the image's square
 * is narrower than the image. */
void bst_generator_set_visible_share(const bst_generator *g, generator_source *s);
/* Reduces a short piece of light whose centre is off the frame to its part on the frame: flux and
 * place. That part alone is in the pixels that are fitted. */
void bst_generator_cut_light(const bst_generator *g, generator_source *light);
/* Sets the image of a source that has a shape in the truth. */
void bst_generator_set_image(const bst_generator *g, const bst_truth *truth, generator_source *s);
/* Sets the image of a ghost at its path, which must be set, and moves it to the brightest place of
 * its image in the filter output. */
void bst_generator_set_ghost_image(const bst_generator *g, const bst_ghost *ghost,
                                   generator_source *s);
/* Factor on the standard deviation of a source's position by the width of its image, along a unit
 * direction (c, n): that of a Gaussian with its second moments, at its lower SNR. */
double bst_generator_image_factor(const bst_generator *g, const generator_source *s, double c,
                                  double n);
/* Sets length, width and angle of the light of a source with a shape and a path of this length. */
void bst_generator_set_image_extent(const bst_generator *g, const generator_source *s,
                                    double length, bst_detection *d);
/* Sets the response of the frame's filters; the path must be set. */
void bst_generator_set_response(bst_generator *g, const bst_generator_frame *f);
/* Gives the fits of a Gaussian PSF the width of the images if enough bright sources show another
 * one; after bst_generator_decide. */
void bst_generator_adapt_width(bst_generator *g);
/* Sets the path and bend of the fitted streaks: those of telemetry, corrected by what image
 * processing measures on bright streaks; the path must be set. */
void bst_generator_measure_motion(bst_generator *g, const bst_generator_frame *f);
/* Sets thresholds and noise of the frame's filters; the pixel noise must be set. */
void bst_generator_set_filters(bst_generator *g);
/* Share of a crowded frame that image processing uses as open sky, from its sources' amplitudes; 1:
 * not crowded. */
double bst_generator_open_share(const bst_generator *g);
/* Variance per pixel by column offsets, e-^2; 0 if image processing subtracts the column levels. */
double bst_generator_column_variance(const bst_generator *g);
/* Variance of a filter's output at a source, in SNR^2; other: of the filter that it does not show
 * best. */
double bst_generator_output_variance(const bst_generator *g, const generator_source *s, bool other);
/* Standard normal noise of a filter (0: for points, 1: for streaks) at a source. */
double bst_generator_filter_noise(const bst_generator *g, const generator_source *s, int filter);
/* Output of the other filter at a source whose own filter has the output `peak`. */
double bst_generator_other_output(const generator_source *s, double peak);
/* Standard normal noise of the other filter at a source, of which the own filter has s->noise. */
double bst_generator_other_noise(const bst_generator *g, const generator_source *s);
/* Output of the filter for source a at its position, caused by source b, relative to b's amplitude.
 */
double bst_generator_overlap(const bst_generator *g, const generator_source *a,
                             const generator_source *b);
/* Sets the centroid bias of the stars' images for each light level: as streaks, and as points. */
void bst_generator_set_star_bias(bst_generator *g);
/* Sets the shape in which a source is seen, and the output of the frame's other filter; returns the
 * efficiency of the filter for that shape. */
double bst_generator_set_filter(const bst_generator *g, generator_source *s);
/* Path of an object: that of the stars plus its own uniform motion, relative to its mean; valid
 * until the next call. */
bst_star_trail_path bst_generator_object_path(const bst_generator *g, const generator_source *s);
/* Streak model of image processing in the frame. */
bst_streak_model bst_generator_streak_model(const bst_generator *g);
/* True if the streak's fit is worth an iteration of its own: see UNIFORM_PX. */
bool bst_generator_is_uniform(const bst_generator *g);
/* Light level of a streak's fit: brightest pixel of the fitted streak over the noise variance. */
double bst_generator_streak_light(const bst_generator *g, double flux_e);
/* Filter output above which image processing interpolates maxima. */
double bst_generator_looks_from(const bst_generator *g);
/* By how much the output must fall about a maximum of this level, SNR, for a source of its own. */
double bst_generator_fall_of_saddle(double level);
/* True if image processing resolves two sources as separate maxima. */
bool bst_generator_separates(const bst_generator *g, const generator_source *bright,
                             const generator_source *faint);
/* Decides which sources are detected and which are merged with a brighter one. */
void bst_generator_decide(bst_generator *g);
/* Finds pairs among the merged sources as the pair test of image processing does; after
 * bst_generator_decide, with settings.false_splits > 0. Single sources that noise splits are not
 * generated. */
void bst_generator_split_pairs(bst_generator *g);
/* SNR per electron of a fit with the PSF that image processing knows.
 *
 * Given:     length_px  of the fitted streak; 0: a point
 *            as_streak  the fit is that of the streak filter */
double bst_generator_fit_norm(const bst_generator *g, const generator_source *s, double length_px,
                              bool as_streak);
/* Merged light of source i and the neighbours fitted with it. */
generator_blend bst_generator_blend_of(const bst_generator *g, int i);
/* Fits an isolated merged detection as image processing does: a bright point with a free width; one
 * longer than a point as a single streak at the centroid of its light. */
void bst_generator_fit_merged(const bst_generator *g, const generator_source *s,
                              const generator_source *merged, int count, generator_blend *out);
/* True if a point fits a noisy star better than the star streak; for positions not drawn from the
 * filter outputs. */
bool bst_generator_fits_point(const bst_generator *g, const generator_source *s,
                              const generator_blend *b);
/* Generates the detection of a found source: position, flux and size with errors. */
bst_detection bst_generator_measure(const bst_generator *g, const generator_source *s,
                                    const generator_blend *b);
/* Light of a pixel from which image processing takes it for saturated, e-: by the converter, or at
 * 0.98 of the full well (imgproc/detect/detect.c). */
double bst_generator_saturation_e(const bst_generator *g);
/* Uniform draw in (0, 1) of the frame, by its number. */
double bst_generator_uniform(const bst_generator *g, uint64_t draw);
/* Standard normal draw number `which` of a source. */
double bst_generator_draw(const bst_generator *g, const generator_source *s, int which);

/* Numbers of a source's random draws. */
enum {
    GENERATOR_PEAK,
    GENERATOR_PLACE,
    GENERATOR_FLUX,
    GENERATOR_SHAPE,
    GENERATOR_MOMENT,
    GENERATOR_CURVATURE,
    GENERATOR_TWIST,
    GENERATOR_DRAWS = 8
};

/* Keeps an unfitted maximum of the filter output at (x, y), read-out px. item: truth item or -1. */
void bst_generator_keep_rough(bst_generator *g, double x, double y, double snr, int item);

/* Keeps a detection, replacing the faintest if there is no room. */
void bst_generator_keep(bst_generator *g, const bst_obsgen_generated *item);

#endif
