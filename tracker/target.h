/* Which confirmed track is the target of interest. */
#ifndef BST_TRACKER_TARGET_H
#define BST_TRACKER_TARGET_H

#include "sim/astro/belt.h"
#include "tracker/mtt/multitarget.h"

typedef struct bst_target_params {
    double direction_chi2;   /* largest misfit of the cue's direction, 2 degrees of freedom */
    double rate_chi2;        /* of the rate, 2 */
    double magnitude_chi2;   /* of the brightness, 1 */
    double release_chi2;     /* a kept target is let go when its rate misfits the cue by more and
                                is a star's, or has changed by more while it was not seen alone */
    double rate_floor_radps; /* 1 sigma per axis by which any cue's rate may be wrong */
    double max_rate_sigma_radps; /* a track is judged once its rate is known to this */
    double max_chi2; /* a track whose mean innovation (per degree of freedom) exceeds this is
                        not taken */
    /* the fewest hits that a track is taken with, and one more for every 2 of its chi-square: a
     * poor candidate waits for a better one */
    int min_hits;
    double margin;      /* log-likelihood by which the best must lead the second ... */
    int margin_hits;    /* ... unless it has this many hits */
    double memory_s;    /* a lost target's extrapolation binds the next choice for this long */
    double memory_chi2; /* its largest misfit, 4 degrees of freedom */
    double memory_noise_rad2ps3; /* acceleration that a lost target may have */
} bst_target_params;

/* The cue as the onboard side has it. */
typedef struct bst_target_cue {
    bool valid;
    bst_vec3 direction, rate_radps;
    double sigma_rad, rate_sigma_radps;
    double v_mag, v_mag_sigma;
    bool in_region; /* the rate is that of the belt at the track's place, seen from: */
    bst_belt_eye belt_eye;
} bst_target_cue;

/* The rate that a valid cue expects of what is seen in a direction, perpendicular to it. */
bst_vec3 bst_target_expected_rate(const bst_target_cue *cue, bst_vec3 direction);

typedef struct bst_target {
    int64_t id; /* 0: none */
    bool remembered;
    bst_sky_state memory; /* of the present or last target, at memory_seconds */
    double memory_seconds;
    double lost_seconds; /* when the last target was lost */
    /* rate less the cue's when the present target was last seen alone: a manoeuvre adds to it */
    bool departed;
    bst_vec3 departure_radps;
} bst_target;

/* Result of bst_target_misfit. */
typedef struct bst_target_fit {
    double chi2;    /* sum of the parts; INFINITY when any is beyond its limit, the track is not
                       confirmed, or its rate is not known well enough yet */
    double log_det; /* sum of the logarithms of their covariances' determinants: chi2 + log_det is
                       twice the negative log-likelihood but for a constant */
} bst_target_fit;

/* Misfit of a track to the cue over direction, rate and brightness.
 *
 * Returned:  chi2 INFINITY if there is no cue, or if the track is stationary, tentative, or its
 *            rate is not known */
bst_target_fit bst_target_misfit(const bst_target_params *params, const bst_target_cue *cue,
                                 const bst_mtt_track *track);

/* Does the cue's rate speak for the track, so that its slowness does not make it a star? For the
 * track of the target of interest (`target`, else NULL) unless it is to be let go, for others by
 * direction, rate and brightness, each within its limit. */
bool bst_target_is_expected(const bst_target_params *params, const bst_target_cue *cue,
                            const bst_mtt_track *track, const bst_target *target);

/* Keeps the target while its track lives and is not another object's. A manoeuvre takes the rate
 * away from that of the cue, as far as it lasts, but frame by frame: a target that is detected and
 * shares no detection may change its rate at will, within the gate of its filter. Else chooses
 * among the tracks by the cue and, after a loss, by the lost target's extrapolation. Without a cue
 * nothing new is chosen. */
void bst_target_step(bst_target *target, const bst_target_params *params, const bst_target_cue *cue,
                     double seconds, const bst_mtt_track *tracks, int count);

#endif
