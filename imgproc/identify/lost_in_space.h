/* Lost in space: attitude and plate scale of a frame from its detections alone. */
#ifndef BST_IMGPROC_IDENTIFY_LOST_IN_SPACE_H
#define BST_IMGPROC_IDENTIFY_LOST_IN_SPACE_H

#include "boresight/camera.h"
#include "boresight/messages.h"
#include "imgproc/identify/star_patterns.h"
#include "imgproc/streak/star_path.h"
#include "sim/astro/bodies.h"

typedef struct bst_lost_in_space_options {
    double scale_tolerance; /* largest relative error of the camera's pixel scale, 0 to 0.1 */
    double false_rate;      /* accepted probability of a wrong attitude of a frame, by chance */
    int max_stars;          /* brightest detections that form quads, 4 to 60 */
    int max_candidates;     /* patterns that are verified at most, > 0 */
} bst_lost_in_space_options;

/* Usual options: 5 % in scale, 1e-6, 40 stars, 5000 patterns: a frame that can be solved takes a
 * few hundred at most (tests/imgproc/lost_in_space_rates.c). */
#define BST_LOST_IN_SPACE_USUAL ((bst_lost_in_space_options){0.05, 1e-6, 40, 5000})

/* Work space for one camera and catalogue. */
typedef struct bst_lost_in_space bst_lost_in_space;

/* Creates the work space.
 *
 * Given:     camera, stars, patterns  must outlive it
 *            julian_year              epoch for proper motion
 *            max_detections           most detections of a frame
 * Errors:    BST_ERR_MEMORY
 * Ownership: free *out with bst_lost_in_space_free */
bst_status bst_lost_in_space_create(bst_ctx *ctx, const bst_camera *camera, const bst_stars *stars,
                                    const bst_star_patterns *patterns, double julian_year,
                                    int max_detections, bst_lost_in_space **out) BST_MUST_CHECK;
/* Frees a work space; NULL is allowed. */
void bst_lost_in_space_free(bst_lost_in_space *lost);

typedef struct bst_lost_in_space_result {
    bool solved; /* the rest holds only if true, but for the last three */
    bst_quat q_cam_from_gcrf;
    double scale;           /* true pixel scale over the camera's */
    int predicted, matched; /* stars up to v_limit */
    double rms_px;          /* residual per axis of the matched stars */
    double log_chance;   /* natural logarithm of an upper limit of the chance of such a match under
                            the null model */
    int quads, patterns; /* tried; patterns whose code agreed with one */
    int candidates;      /* of these, patterns whose four stars fit one attitude and scale */
    double least_log_chance; /* over all candidates, of log_chance plus the logarithm of the number
                                of candidates so far, accepted or not; at most 0 */
} bst_lost_in_space_result;

/* A frame's detections, and what is known besides. */
typedef struct bst_lost_in_space_frame {
    const bst_detection *items; /* only those labelled UNKNOWN or STAR take part */
    int count;
    bst_window window; /* of the detections */
    double v_limit;    /* faintest star that is surely detected, wholly inside the window */
    const bst_light *light;
    const bst_star_path *path; /* of all stars; NULL: they are points. Detections are places of its
                                  origin, also outside the window. */
    const bst_lost_in_space_result *near; /* a solution of the same frame with other places, which
                                             is tried first; NULL: none */
} bst_lost_in_space_frame;

/* Identifies the stars of a frame without an attitude.
 *
 * Quads of detections, the brightest first, are looked up among the patterns. A pattern that agrees
 * gives attitude and scale; if its four stars fit them, the catalogue's stars are predicted, those
 * up to half a magnitude beyond v_limit too, and matched with the detections. The attitude is
 * accepted if the likelihood of the detections is greater than that of evenly spread ones by more
 * than the number of candidates so far over options.false_rate. Attitude and scale are last fitted
 * to all matched stars by least squares.
 *
 * Errors:    those of the catalogue
 * Notes:     a mirrored frame is not solved, by its patterns' handedness
 * Reference: Lang et al. 2010, AJ 139, 1782 (codes of quads); Padgett & Kreutz-Delgado 1997, IEEE
 *            Trans. AES 33, 202 (identification without attitude) */
bst_status bst_lost_in_space_solve(bst_ctx *ctx, bst_lost_in_space *lost,
                                   const bst_lost_in_space_options *options,
                                   const bst_lost_in_space_frame *frame,
                                   bst_lost_in_space_result *out) BST_MUST_CHECK;

/* True if the latest frame was solved and a detection of it was matched to a star. */
bool bst_lost_in_space_matched(const bst_lost_in_space *lost, int detection);

#endif
