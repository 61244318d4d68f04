/* Filters by name over the sky state: extended Kalman, unscented Kalman, and interacting multiple
 * models (quiet and manoeuvring); and the update by several detections that may each be the
 * object's. */
#ifndef BST_TRACKER_MTT_FILTER_H
#define BST_TRACKER_MTT_FILTER_H

#include "tracker/mtt/mixture.h"

typedef enum bst_filter_kind {
    BST_FILTER_EKF = 0,
    BST_FILTER_UKF,
    BST_FILTER_IMM,
} bst_filter_kind;

typedef struct bst_filter_params {
    bst_filter_kind kind;
    double noise_rad2ps3; /* acceleration's power spectral density; of the quiet model */
    /* the rest: IMM only */
    double manoeuvre_noise_rad2ps3;
    double quiescent_sojourn_s, manoeuvre_sojourn_s; /* mean times between the ends and the starts
                                    of manoeuvres, and of a manoeuvre; > 0 */
} bst_filter_params;

/* Most components of a mixture that a filter keeps. */
#define BST_FILTER_COMPONENTS 8

/* A filter that is more than one Gaussian: the two models of an IMM (0 quiet, 1 manoeuvring), or
 * what several earlier choices of detections have led to. The state is its mean and covariance. */
typedef struct bst_filter_models {
    int count; /* 0: the state is all there is */
    bst_sky_state state[BST_FILTER_COMPONENTS];
    double probability[BST_FILTER_COMPONENTS];
} bst_filter_models;

/* A detection as a predicted filter sees it. */
typedef struct bst_filter_fit {
    double chi2;                   /* the least of the components' */
    double log_likelihood;         /* ln of the density of the detection, rad^-2 */
    bst_sky_innovation innovation; /* of the state; IMM: of the quiet model */
} bst_filter_fit;

/* One detection that may be the object's. */
typedef struct bst_filter_candidate {
    const bst_sky_measurement *measurement;
    const double *extra; /* as bst_sky_innovate has it; NULL: none */
} bst_filter_candidate;

/* Models for a state that has just been started. */
void bst_filter_start(const bst_filter_params *params, const bst_sky_state *state,
                      bst_filter_models *models);

/* Moves state and models by dt_s >= 0.
 * EKF: bst_sky_predict. UKF: bst_sky_predict_unscented. IMM: mixing of the two models (Blom and
 * Bar-Shalom 1988) with the transition probabilities of a two-state Markov chain in continuous
 * time, then bst_sky_predict in each; the state becomes their mixture. */
void bst_filter_predict(const bst_filter_params *params, double dt_s, bst_sky_state *state,
                        bst_filter_models *models);

/* bst_sky_shift of state and models. */
void bst_filter_shift(bst_sky_state *state, bst_filter_models *models, bst_vec3 direction_rad,
                      bst_vec3 rate_radps);

/* False when an innovation's covariance is not positive definite. */
bool bst_filter_evaluate(const bst_filter_params *params, const bst_sky_state *state,
                         const bst_filter_models *models, const bst_filter_candidate *candidate,
                         bst_filter_fit *out);

/* Most candidates of bst_filter_update. */
#define BST_FILTER_CANDIDATES 16

/* The candidates of a frame, of which at most one is the object's, and the weights of hypotheses.
 */
typedef struct bst_filter_evidence {
    const bst_filter_candidate *candidates; /* [count] detections */
    int count;                              /* 0 to BST_FILTER_CANDIDATES */
    double miss_weight;                     /* of the hypothesis of a miss */
    double hit_weight; /* factor on the likelihood of the innovation for that of a detection */
} bst_filter_evidence;

/* Updates a state with the candidates of a frame.
 *
 * Given:     models      models of an IMM, or components of a mixture
 *            components  most components that are kept, 1 to BST_FILTER_COMPONENTS
 * Notes:     weights (0, 1) with one detection give the Kalman filter. (1 - PD PG, PD / clutter
 *            density) give the posterior of probabilistic data association as a mixture.
 *            components = 1 merges the mixture to one Gaussian of the same mean and covariance
 *            (for an IMM one per model, whose probability follows the model's total likelihood).
 *            More components, not for an IMM, let later detections decide between hypotheses.
 * Reference: Bar-Shalom and Tse 1975 (PDA); Salmond 1990 (mixture reduction) */
void bst_filter_update(const bst_filter_params *params, bst_sky_state *state,
                       bst_filter_models *models, const bst_filter_evidence *evidence,
                       int components);

/* bst_sky_predict with the covariance, and the mean's shift, from eight sigma points: the unscented
 * transform (Julier and Uhlmann 1997) with kappa = 0, whose weights are all positive, in the
 * tangent plane of the moved mean (Hauberg, Lauze and Pedersen 2013). Measured directions are part
 * of the state, so that the unscented update would be bst_sky_update. */
void bst_sky_predict_unscented(bst_sky_state *state, double dt_s, double noise_rad2ps3);

#endif
