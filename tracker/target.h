/* Selection of the target of interest among the confirmed tracks. */
#ifndef BST_TRACKER_TARGET_H
#define BST_TRACKER_TARGET_H

#include "sim/astro/belt.h"
#include "tracker/mtt/multitarget.h"

typedef struct bst_target_params {
    double direction_chi2; /* largest misfit of the direction to the cue's, 2 degrees of freedom */
    double rate_chi2;      /* largest misfit of the rate, 2 */
    double magnitude_chi2; /* largest misfit of the brightness, 1 */
    double release_chi2;   /* a target is released if its rate misfits the cue by more and is a
                              star's, or has changed by more since it was last resolved */
    double rate_floor_radps;     /* 1 sigma per axis added to the rate error of any cue */
    double max_rate_sigma_radps; /* a track is compared once its rate is known to this, 1 sigma */
    /* a track whose mean innovation chi-square per degree of freedom exceeds this is not selected
     */
    double max_chi2;
    /* least hits of a track, plus one for every 2 of its chi-square, so that a poor candidate waits
     * for a better one */
    int min_hits;
    double margin;   /* log-likelihood margin of the best candidate over the second ... */
    int margin_hits; /* ... unless it has this many hits */
    /* time for which a lost target's prediction restricts the next choice, s */
    double max_dormant_s;
    double dormant_gate_chi2;    /* its largest misfit, 4 degrees of freedom */
    double memory_noise_rad2ps3; /* power spectral density of the acceleration of a lost target */
} bst_target_params;

struct bst_identity;
typedef struct bst_identity bst_identity; /* identity.h */

/* The onboard cue: predicted direction, rate and brightness of the target. */
typedef struct bst_target_cue {
    bool valid;
    bst_vec3 direction, rate_radps;
    double sigma_rad, rate_sigma_radps;
    double v_mag, v_mag_sigma;
    /* the cue is a region: its rate is that of the belt at the track's direction, seen from
     * belt_eye */
    bool in_region;
    bst_belt_eye belt_eye;
    /* comparison of the tracks with the catalogue; NULL: none. A track that another object explains
     * is the less likely to be of the cue's. */
    const bst_identity *identity;
    int32_t object; /* the cue's in that comparison */
    /* density, as of bst_identity_scale, that stands for the cue's object having no track */
    double unseen_density;
} bst_target_cue;

/* Rate that a valid cue expects in a direction, rad/s, perpendicular to it. */
bst_vec3 bst_target_expected_rate(const bst_target_cue *cue, bst_vec3 direction);

typedef struct bst_target {
    int64_t id; /* 0: none */
    bool remembered;
    bst_sky_state memory; /* state of the current or last target, at memory_seconds */
    double memory_seconds;
    double lost_seconds; /* time at which the last target was lost */
    /* rate minus the cue's rate when the target was last resolved: the contribution of manoeuvres
     */
    bool departed;
    bst_vec3 departure_radps;
    /* Identity: the probability that the target is the cue's object, given that one of the tracks
     * is. While `ambiguous` it is computed anew in each frame; a target that was once certain keeps
     * its identity until it has shared detections with another object, or a new track may be the
     * cue's object.
     */
    bool ambiguous;
    bool merged; /* it has shared detections since it was last resolved */
    double probability;
    int64_t rival_id; /* the likeliest other track; 0: none */
    double rival_probability;
    double rival_seconds; /* latest time at which there was one */
} bst_target;

/* Result of bst_target_misfit. */
typedef struct bst_target_fit {
    bool fits;   /* each term is within its limit */
    double chi2; /* sum of the terms; INFINITY if the track cannot be compared */
    /* sum of the log determinants of their covariances: chi2 + log_det is twice the negative
     * log-likelihood up to a constant */
    double log_det;
} bst_target_fit;

/* Misfit of a track to the cue over direction, rate and brightness.
 *
 * Returned:  `fits` false and chi2 INFINITY if there is no cue, or if the track is stationary,
 *            tentative, moves unlike any object, or its rate is not known */
bst_target_fit bst_target_misfit(const bst_target_params *params, const bst_target_cue *cue,
                                 const bst_mtt_track *track);

/* True if the cue explains a track, so that a low rate does not make it a star.
 *
 * Given:     target  the target of interest if it is this track, else NULL
 * Notes:     for the target it is true unless the target is released; for other tracks direction,
 *            rate and brightness must each be within their limit. */
bool bst_target_is_expected(const bst_target_params *params, const bst_target_cue *cue,
                            const bst_mtt_track *track, const bst_target *target);

/* Probabilities of identity: below the first a target is ambiguous; above the second it is certain,
 * and so is another track, which then replaces an ambiguous target. */
#define BST_TARGET_AMBIGUOUS 0.95
#define BST_TARGET_CERTAIN 0.99

/* Updates the target of interest after a frame.
 *
 * Given:     seconds  time of the frame
 *            tracks   [count] tracks after the frame
 * Notes:     the target is kept while its track exists and is not released. A manoeuvre changes the
 *            rate gradually: a target that is detected and shares no detection may change its rate
 *            freely, within the gate of its filter. Otherwise a track is chosen by the cue and,
 *            after a loss, by the lost target's prediction. Without a cue no new target is chosen.
 *            Of several tracks, each has the probability exp(-(chi2 + log_det)/2) over the sum of
 *            all, also of those beyond a limit: if the cue is far off its object, that object's
 *            track fits hardly better than others. With a comparison with the catalogue
 *            times the odds that no other object explains the track, and the sum includes
 *            that of no track, which no chosen track may be below. While the target's is not
 *            certain, it is ambiguous, and another track replaces it as soon as that one is
 *            certain. After frames with shared detections, and when a new track fits the cue, the
 *            identity is open again, unless the target has manoeuvred away from the cue. An
 *            ambiguity does not end because the other track does: the probability stays for
 *            max_dormant_s. */
void bst_target_step(bst_target *target, const bst_target_params *params, const bst_target_cue *cue,
                     double seconds, const bst_mtt_track *tracks, int count);

#endif
