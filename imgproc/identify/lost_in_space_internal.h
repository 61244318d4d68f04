/* State of the identification without an attitude, shared by its source files. */
#ifndef BST_IMGPROC_IDENTIFY_LOST_IN_SPACE_INTERNAL_H
#define BST_IMGPROC_IDENTIFY_LOST_IN_SPACE_INTERNAL_H

#include "imgproc/identify/lost_in_space.h"
#include "imgproc/identify/star_fit.h"
#include "sim/core/arena.h"

/* Probability that a catalogue star up to the frame's limit is among the detections. */
#define BST_LOST_SURELY_FOUND 0.9
/* Standard deviations of a detection's place in its ellipse. */
#define BST_LOST_LAST_SIGMAS 3.0
/* Largest chi-square of a quad's four stars. */
#define BST_LOST_MOST_CHI_SQUARED 28.5

/* A detection that takes part. */
typedef struct bst_lost_in_space_source {
    double x_px, y_px;
    double cov_xx, cov_xy, cov_yy; /* of the place, px^2 */
    bst_vec3 cam;                  /* unit, by the camera's own scale */
    double mag;                    /* of its flux, without a zero point */
} bst_lost_in_space_source;

struct bst_lost_in_space {
    const bst_camera *camera;
    const bst_stars *stars;
    const bst_star_patterns *patterns;
    double julian_year, depth_v_mag;
    double most_tolerance; /* of a code */
    int max_detections;
    bst_arena arena;
    int *order;                        /* [max_detections] indices of detections, brightest first */
    bst_lost_in_space_source *sources; /* [max_detections] in that order */
    int count;
    double *nearest2; /* [max_detections] distance^2 of the star matched to a source, in units of
                         its tolerance */
    double *area_px2; /* [max_detections] of a source's tolerance ellipse */
    double (*inverse)[3]; /* [max_detections] of the tolerance ellipse's matrix: xx, xy, yy */
    int matched_of;       /* sources of star_of; 0: not solved */
    int *star_of;         /* [max_detections] predicted star; -1: none */
    bst_star *found;      /* [MOST_PREDICTED] */
    bst_star_fit_pair *expected; /* [MOST_PREDICTED] */
    double *found_share;         /* [MOST_PREDICTED] probability that each is detected */
    double *v_mag;               /* [MOST_PREDICTED] */
    bst_star_fit_pair *matched;  /* [MOST_PREDICTED] */
};

/* A frame that is being solved. */
typedef struct bst_lost_in_space_attempt {
    bst_ctx *ctx;
    bst_lost_in_space *s;
    const bst_lost_in_space_options *options;
    const bst_lost_in_space_frame *frame;
    double area_px2, side_px; /* of the window; its shorter side */
    double most_r2;           /* greatest tangent radius^2 in the window */
    double reach_px;          /* of a star's path from its place */
} bst_lost_in_space_attempt;

/* Logarithm of the likelihood ratio of a quad whose four stars fit one attitude and scale with a
 * chi-square, at most BST_LOST_MOST_CHI_SQUARED. Its mean over quads that fit by chance is 1. */
double bst_lost_in_space_log_quad(double chi_squared);

/* Weighs a match of predicted stars: the likelihood of the detections if the attitude is right,
 * over that if they are spread evenly. A star is detected with its probability; it is then the
 * detection with which it is matched with a probability by brightness, and lies in its ellipse. By
 * chance it lies there as in any place. Of the quad's own detections only the brightnesses count;
 * stars that are as probable by chance do not.
 *
 * Given:     quad       sources that gave the attitude; negative: none
 *            predicted  number of stars
 *            sources    number of the brightest sources that take part
 * Returned:  out->predicted, matched  those up to the frame's limit
 *            logarithm of the ratio. By the null model its mean is 1, so that it exceeds R with a
 *            probability of at most 1 / R (Markov's inequality) */
double bst_lost_in_space_log_ratio(const bst_lost_in_space_attempt *a, const int quad[4],
                                   int predicted, int sources, bst_lost_in_space_result *out);

#endif
