/* Inside of the generator, shared by its files only. */
#ifndef BST_OBSGEN_GENERATOR_INTERNAL_H
#define BST_OBSGEN_GENERATOR_INTERNAL_H

#include "obsgen/generator.h"
#include "obsgen/model/blend_weight.h"
#include "obsgen/streak/star_trail.h"
#include "obsgen/streak/streak_centroid_error.h"

/* A source of the truth on the frame, in pixels that are read. */
typedef struct generator_source {
    double x, y; /* mean of its path */
    bst_obsgen_path_px path;
    double length, flux_e;
    double visible;        /* share of the squares of its image that is on the frame */
    double ends;           /* share of both ends that is */
    double seen_x, seen_y; /* middle of what is */
    double sharp;          /* of its amplitude: 1 for the PSF alone */
    double amplitude;      /* SNR at the filter's output, without noise */
    double peak;           /* the same with the light of neighbours */
    double noise, spread;  /* drawn for the peak; its deviation */
    double level;          /* amplitude with it */
    uint64_t name;         /* of its draws */
    int item, head;        /* head: seen in one with this source; -1: not */
    bool star, as_streak, found, saturated;
    bool broken; /* longer than is filtered for: seen in parts */
} generator_source;

typedef struct generator_rank {
    double amplitude;
    int index;
} generator_rank;

/* The light of a detection that is seen in one with others, and of what is fitted beside it. */
typedef struct generator_blend {
    double flux_e, x, y; /* as one source */
    double widen;        /* factor on the variances from neighbours that are fitted too */
    double flat;         /* factor on the error along a streak where light of others is in it */
    bool near;           /* another detection in the fitted pixels, or a merged source of note */
    bool drawn;          /* x and y have their error already */
    bool point;          /* a streak that the filter for points shows better */
    double snr;          /* of what was drawn */
} generator_blend;

/* Half pixels of the longest streak that is filtered for. */
enum { GENERATOR_STEPS = 258 };

/* Lights that the bias of stars is made for: decades of the brightest pixel over the noise's
 * variance. */
enum { GENERATOR_BIASES = 6 };
#define GENERATOR_FIRST_LIGHT 0.1

struct bst_generator {
    const bst_camera *camera;
    double electrons_per_s_v0; /* onboard zero point */
    bst_generator_settings settings;
    bool levels_columns; /* image processing takes the columns' offsets off */
    bst_obsgen_calibration calibration;
    bst_rng_key key;
    /* of the frame */
    int64_t exposure_id;
    int binning, width, height;
    double origin_x, origin_y, exposure_s;
    double sigma, total_sigma; /* of the PSF without and with the pixel's width */
    double onboard_sigma_px;   /* of the PSF that the filters are made for, sensor px */
    double fitted_sigma;       /* the same, pixels that are read */
    bst_response response;     /* of these to the frame's images */
    double filter_sigma;       /* of the filters' image of a point, with the pixel's width */
    double cross_sigma; /* of what filters show of a source beside its place: sqrt(2) of it */
    bst_generator_filter filters[2]; /* for points, for the stars' streaks */
    double white_share;              /* of the noise's variance that pixels have each for itself */
    double
        fit_light; /* brightest pixel over the noise's variance, per sqrt(sum p^2) and electron */
    bst_obsgen_path_px straight_path; /* nearest to the true one */
    double widening;      /* width of the images over the fitted ones': the path is another */
    double known_width;   /* width of the filters' images over the PSF's */
    double place_ratio2;  /* variance of a place over that of a Gaussian of the PSF's
                                         noise-equivalent             area */
    double norm_ratio[2]; /* sqrt(sum p^2) of the filters' images over the bound's */
    bst_crlb_table bound;
    const bst_crlb_table *image_bound, *onboard_bound; /* of the frame; NULL: from `bound` */
    bst_blend_weights blend_weights;
    bst_obsgen_path_px star_path;
    double bend_x, bend_y;
    bst_star_trail_path path; /* the true one; count 0: not known */
    double *path_x, *path_y, *object_x, *object_y;
    int path_room;
    double streak;                             /* 0: not filtered for */
    bst_streak_centroid_error *centroid_error; /* for `streak`, once it was asked for */
    bool smeared;
    double background_e, noise_e, threshold, streak_share;
    double open_share;   /* of a crowded frame: what is no star's; 1: not crowded */
    double dark_noise_e; /* the noise without the light that is part of it */
    double faint_light_e, faint_square_e2, background_bias_e; /* bias: what is too much of it */
    struct generator_thresholds {
        int width, height;
        double sigma, threshold[GENERATOR_STEPS], streak_share[GENERATOR_STEPS]; /* 0: not made */
    } thresholds;
    generator_source *sources; /* by row */
    generator_rank *ranks;
    int rank_count; /* by brightness, those that are no light alone */
    int source_count, source_capacity;
    double reach; /* of any source's light */
    /* the stars' way, in frames that are smeared, and a source's */
    bst_star_trail_node *route, *way;
    int route_count;
    double route_top;              /* greatest light */
    double route_box[4];           /* least and greatest x, least and greatest y */
    bst_obsgen_path_px whole_path; /* from its start to its end */
    struct generator_streaks *streaks;
    /* of fits, by how the camera really moved, and by their light */
    double star_bias[GENERATOR_BIASES][2], streak_bias[2];
    double bias_sigma; /* bst_star_trail_point_bias */
    bst_obsgen_generated *items;
    int count, lost;
};

/* Share of the frame that a Gaussian's light at (x, y) has. */
double bst_generator_inside(const bst_generator *g, double x, double y, double sigma);
/* Computes the response of the frame's filters, once its path is set. */
void bst_generator_set_response(bst_generator *g, const bst_generator_frame *f);
/* Computes thresholds and noise of the frame's filters, once its noise is set. */
void bst_generator_set_filters(bst_generator *g);
/* Share of a crowded frame that image processing takes for open sky, by the amplitudes of its
 * sources; 1 where it is not crowded. */
double bst_generator_open_share(const bst_generator *g);
/* What offsets of columns add to the variance of a pixel, electrons^2: none where image processing
 * takes the columns' levels off. */
double bst_generator_column_variance(const bst_generator *g);
/* Variance of the filter's output at a source, SNR 1. */
double bst_generator_output_variance(const bst_generator *g, const generator_source *s);
/* What source b adds at source a's place to the output of the filter for a. */
double bst_generator_overlap(const bst_generator *g, const generator_source *a,
                             const generator_source *b);
/* The output from which image processing looks at maxima. */
double bst_generator_looks_from(const bst_generator *g);
/* Whether image processing would find two maxima: the fainter source beside the brighter one. */
bool bst_generator_separates(const bst_generator *g, const generator_source *bright,
                             const generator_source *faint);
/* Finds which sources are detected, and which are seen in one with a brighter one. */
void bst_generator_decide(bst_generator *g);
/* What is seen in source number i and fitted beside it. */
generator_blend bst_generator_blend_of(const bst_generator *g, int i);
/* Whether a point fits a star better in its noise than the stars' streak, where the place is not
 * drawn from the filters' outputs. */
bool bst_generator_fits_point(const bst_generator *g, const generator_source *s,
                              const generator_blend *b);
/* The detection of a source that was found. */
bst_detection bst_generator_measure(const bst_generator *g, const generator_source *s,
                                    const generator_blend *b);
/* Draw number `which` of a source, a standard normal one. */
double bst_generator_draw(const bst_generator *g, const generator_source *s, int which);

/* Draws of one source. */
enum { GENERATOR_PEAK, GENERATOR_PLACE, GENERATOR_FLUX, GENERATOR_SHAPE, GENERATOR_DRAWS = 8 };

/* Takes a maximum of the filter's output that is not fitted, at its top (x, y), pixels that are
 * read. item: of the truth, or -1. */
void bst_generator_keep_rough(bst_generator *g, double x, double y, double snr, int item);

/* Takes a detection, in place of the faintest where there is no room. */
void bst_generator_keep(bst_generator *g, const bst_obsgen_generated *item);

#endif
