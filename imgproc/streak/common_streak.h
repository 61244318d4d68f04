/* The streak that all stars of a frame have in common, found from the frame itself. */
#ifndef BST_IMGPROC_STREAK_COMMON_STREAK_H
#define BST_IMGPROC_STREAK_COMMON_STREAK_H

#include <stdbool.h>

#include "boresight/messages.h"
#include "boresight/status.h"
#include "imgproc/streak/star_path.h"

typedef struct bst_common_streak_options {
    int max_sources;
    double least_snr;
    double tangent_per_px; /* of the gnomonic projection, at the frame's middle: streaks differ with
                              the place in a wide field; 0: all are equal */
    double psf_sigma_px;   /* 0: 1 px */
    double shot_variance;  /* of a unit of light: 1 if the pixels are electrons; 0: not known */
    bool known_path;       /* the path comes from bst_streak_finder_follow: no shapes are listed */
} bst_common_streak_options;

/* A point along the streak, relative to its middle. */
typedef struct bst_common_streak_point {
    double x_px, y_px;
} bst_common_streak_point;

typedef struct bst_common_streak {
    double sigma;                    /* noise of the given image */
    bst_common_streak_point ends[2]; /* at the frame's middle; the one further left first */
    double ends_margin;   /* log-likelihood of the ends over that of ends more than 8 px away */
    bst_detection *items; /* places of the streaks' middles */
    int count;
} bst_common_streak;

/* A frame and the shapes that its stars may have. */
typedef struct bst_streak_finder bst_streak_finder;

/* Lists the shapes of a frame.
 *
 * Short lines of many directions show streaks that single pixels do not. Connected sources are
 * candidates, first those of a size that several have, last those that the frame cuts.
 *
 * Given:     pixels  [height][width]; NAN: no value; not needed after the call
 * Errors:    BST_ERR_MEMORY
 * Ownership: free *out with bst_streak_finder_free */
bst_status bst_streak_finder_create(bst_ctx *ctx, const float *pixels, int width, int height,
                                    const bst_common_streak_options *options,
                                    bst_streak_finder **out) BST_MUST_CHECK;
/* Frees a finder; NULL is allowed. */
void bst_streak_finder_free(bst_streak_finder *finder);
/* The shape of a point, beside those of sources. */
enum { BST_STREAK_FINDER_POINT = -1 };
/* Number of shapes of sources. */
int bst_streak_finder_shapes(const bst_streak_finder *finder);

/* True for the shape of a source that the frame may cut. */
bool bst_streak_finder_is_cut(const bst_streak_finder *finder, int index);

/* Measures the path that one shape suggests.
 *
 * The centre line of the source is the path; it may be curved and of uneven brightness. A matched
 * filter along the path gives the brightest stars, one after the other: the highest maximum is
 * subtracted (Hogbom 1974, A&AS 15, 417). They then give a better path.
 *
 * Given:     index    BST_STREAK_FINDER_POINT, or 0 to bst_streak_finder_shapes - 1
 *            extend   the shape may be a piece of a streak: its path is extended along the light
 * Returned:  path     the path
 *            quality  how well the brightest stars fit it: the best path of a frame has the
 *                     greatest; 0: no path, or one that has been measured before
 * Errors:    BST_ERR_MEMORY */
bst_status bst_streak_finder_measure(bst_ctx *ctx, bst_streak_finder *finder, int index,
                                     bool extend, bst_star_path *path,
                                     double *quality) BST_MUST_CHECK;

/* True if the frame has points, and they are certain to fit worse than a path of a quality. */
bool bst_streak_finder_points_fit_worse(const bst_streak_finder *finder, double quality);

/* Finds all stars by a path, also those whose middle is outside the frame.
 *
 * Given:     path  copied; from bst_streak_finder_measure
 * Returned:  *out  valid until the next call with the same finder
 * Errors:    BST_ERR_MEMORY */
bst_status bst_streak_finder_search(bst_ctx *ctx, bst_streak_finder *finder,
                                    const bst_star_path *path,
                                    bst_common_streak *out) BST_MUST_CHECK;

/* Finds all stars by the path that one shape suggests: bst_streak_finder_measure and
 * bst_streak_finder_search. */
bst_status bst_streak_finder_find(bst_ctx *ctx, bst_streak_finder *finder, int index,
                                  bst_common_streak *out) BST_MUST_CHECK;

/* Measures the path on chosen stars of the latest search and finds all stars again.
 *
 * Given:     chosen  [out->count] stars that are surely right
 * Errors:    BST_ERR_MEMORY */
bst_status bst_streak_finder_repeat(bst_ctx *ctx, bst_streak_finder *finder, const bool *chosen,
                                    bst_common_streak *out) BST_MUST_CHECK;

/* Asks chosen stars of the latest search whether their light ends where the path does: see
 * bst_star_path_vote.
 *
 * Given:     chosen  [found->count] stars that are surely right
 * Returned:  greatest logarithm of the likelihood of another end over that of the path's */
double bst_streak_finder_votes(bst_streak_finder *finder, const bool *chosen,
                               const bst_common_streak *found);

/* Moves the ends of the path to where chosen stars of the latest search vote for, and finds all
 * stars again: see bst_star_path_move_ends. They stay as they are if the ends do.
 *
 * Given:     chosen  [out->count] stars that are surely right
 * Errors:    BST_ERR_MEMORY */
bst_status bst_streak_finder_move_ends(bst_ctx *ctx, bst_streak_finder *finder, const bool *chosen,
                                       bst_common_streak *out) BST_MUST_CHECK;

/* Path of the latest search; it belongs to the finder. */
const bst_star_path *bst_streak_finder_path(const bst_streak_finder *finder);

/* Finds all stars by a known path, also those whose own place is outside the frame.
 *
 * A matched filter along the path gives the brightest stars. All that are known are then fitted
 * together on the pixels, and the filter searches what is left for fainter ones, with weights for
 * the light of the known ones, and so on (cf. DAOPHOT, Stetson 1987, PASP 99, 191).
 *
 * Given:     finder        also one without known_path
 *            path          copied; centre and tangent_per_px as for this frame
 *            least_snr     of the part of a streak inside the frame
 *            least_inside  share of the path that must be inside the frame
 * Returned:  *out          places are those at the path's origin; flags has BST_DETECTION_EDGE for
 *                          streaks that the frame cuts; flux_e is that of the whole streak for a
 *                          Gaussian PSF of the finder's width
 * Errors:    BST_ERR_MEMORY */
bst_status bst_streak_finder_follow(bst_ctx *ctx, bst_streak_finder *finder,
                                    const bst_star_path *path, double least_snr,
                                    double least_inside, bst_common_streak *out) BST_MUST_CHECK;

/* SNR that noise alone exceeds `false_alarms` times in a frame, at all places where the frame holds
 * a part of the path.
 *
 * Given:     path  centre set
 *
 * Notes:     A smooth Gaussian field over an area A has A sqrt(det L) (2 pi)^(-3/2) u exp(-u^2 / 2)
 *            excursions above a high u, L the covariance of its gradient: minus the second
 *            derivatives of the response of the filter to its own path. Where the frame cuts the
 *            path, the rest has a greater gradient along it.
 * Reference: Adler, The Geometry of Random Fields, 1981, ch. 6 */
double bst_streak_path_threshold(const bst_star_path *path, int width, int height,
                                 double psf_sigma_px, double least_inside, double false_alarms);

#endif
