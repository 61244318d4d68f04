/* Tracking filters of the sky state: extended Kalman, unscented Kalman, and interacting multiple
 * models (quiet and manoeuvring). The update accepts several candidate detections. */
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
    double noise_rad2ps3; /* power spectral density of the acceleration; IMM: of the quiet model */
    /* EKF and UKF: the object may be steady, with this smaller density; 0: there is one level */
    double steady_noise_rad2ps3;
    /* IMM only */
    double manoeuvre_noise_rad2ps3;
    /* mean time between manoeuvres, and mean duration of a manoeuvre, > 0 */
    double quiescent_sojourn_s, manoeuvre_sojourn_s;
} bst_filter_params;

/* Most mixture components of a filter. */
#define BST_FILTER_COMPONENTS 12

/* Levels of process noise of an adaptive filter: 0 has the configured density, the last one that of
 * a steady object, those between are spaced evenly in their logarithm. */
enum { BST_FILTER_LEVELS = 3 };

/* Models of an IMM (0 quiet, 1 manoeuvring), or components of a mixture of association hypotheses
 * and levels of process noise. The state is their mean and covariance. */
typedef struct bst_filter_models {
    int count;           /* 0: the state is a single Gaussian */
    int levels;          /* BST_FILTER_LEVELS: components have levels, 0: they have none */
    double unswitched_s; /* time since changes between levels were last taken into account */
    int level[BST_FILTER_COMPONENTS];
    bst_sky_state state[BST_FILTER_COMPONENTS];
    double probability[BST_FILTER_COMPONENTS];
} bst_filter_models;

/* Fit of a detection to a predicted filter. */
typedef struct bst_filter_fit {
    double chi2;                   /* smallest of the components */
    double log_likelihood;         /* log-likelihood of the detection, rad^-2 */
    bst_sky_innovation innovation; /* of the state; IMM: of the quiet model */
} bst_filter_fit;

/* A detection that may originate from the tracked object. */
typedef struct bst_filter_candidate {
    const bst_sky_measurement *measurement;
    const double *extra; /* extra covariance as in bst_sky_innovate; NULL: none */
    double log_weight;   /* ln of a factor of its hypothesis; bst_filter_evaluate ignores it */
} bst_filter_candidate;

/* Initialises the models of a newly started state. */
void bst_filter_start(const bst_filter_params *params, const bst_sky_state *state,
                      bst_filter_models *models);

/* Predicts state and models over dt_s >= 0.
 *
 * EKF: bst_sky_predict. UKF: bst_sky_predict_unscented. IMM: mixing of the two models with the
 * transition probabilities of a two-state Markov chain in continuous time, then bst_sky_predict in
 * each; the state becomes their mixture.
 *
 * Notes:     with steady_noise_rad2ps3 each component assumes a level of process noise. Components
 *            without levels get all of them. From then on an object takes any level anew at random
 *            times, which is taken into account every 4 s: each level's components are merged to
 *            as many as it had. Without steady_noise_rad2ps3 levels are forgotten.
 * Reference: Blom and Bar-Shalom 1988 */
void bst_filter_predict(const bst_filter_params *params, double dt_s, bst_sky_state *state,
                        bst_filter_models *models);

/* Shifts state and models by a known motion (bst_sky_shift). */
void bst_filter_shift(bst_sky_state *state, bst_filter_models *models, bst_vec3 direction_rad,
                      bst_vec3 rate_radps);

/* Evaluates the likelihood of a detection under a predicted filter. Returns false if an innovation
 * covariance is not positive definite. */
bool bst_filter_evaluate(const bst_filter_params *params, const bst_sky_state *state,
                         const bst_filter_models *models, const bst_filter_candidate *candidate,
                         bst_filter_fit *out);

/* Most candidate detections of bst_filter_update. */
#define BST_FILTER_CANDIDATES 16

/* Candidate detections of a frame, of which at most one originates from the object, and the weights
 * of the hypotheses. */
typedef struct bst_filter_evidence {
    const bst_filter_candidate *candidates; /* [count] detections */
    int count;                              /* 0 to BST_FILTER_CANDIDATES */
    double miss_weight;                     /* weight of the missed-detection hypothesis */
    /* factor from the innovation's likelihood to the weight of a detection hypothesis */
    double hit_weight;
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
 *            Components of different levels of process noise are not merged; each level keeps
 *            its part of `components`, at least one.
 * Reference: Bar-Shalom and Tse 1975 (PDA); Salmond 1990 (mixture reduction) */
void bst_filter_update(const bst_filter_params *params, bst_sky_state *state,
                       bst_filter_models *models, const bst_filter_evidence *evidence,
                       int components);

/* Unscented prediction of state and covariance over dt_s, as bst_sky_predict. It uses eight sigma
 * points with kappa = 0, whose weights are all positive, in the tangent plane of the predicted
 * mean. The measurement is part of the state, so the unscented update equals bst_sky_update.
 *
 * Reference: Julier and Uhlmann 1997; Hauberg, Lauze and Pedersen 2013 */
void bst_sky_predict_unscented(bst_sky_state *state, double dt_s, double noise_rad2ps3);

#endif
