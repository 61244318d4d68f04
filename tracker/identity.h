/* Identity of tracks: probabilities over the objects of the onboard catalogue. */
#ifndef BST_TRACKER_IDENTITY_H
#define BST_TRACKER_IDENTITY_H

#include "tracker/target.h"

/* Most objects and tracks of one comparison. */
#define BST_IDENTITY_OBJECTS 64
#define BST_IDENTITY_TRACKS 64
/* Index of objects that the catalogue lacks. */
#define BST_IDENTITY_UNKNOWN (-1)

/* An object that a track may be of, as predicted on board. */
typedef struct bst_identity_object {
    int32_t object; /* index in the catalogue */
    bst_vec3 direction, rate_radps;
    double sigma_rad, rate_sigma_radps; /* 1 sigma per axis */
    double v_mag, v_mag_sigma;          /* sigma INFINITY: brightness unknown */
} bst_identity_object;

typedef struct bst_identity_params {
    /* density of objects that the catalogue lacks, per sr, (rad/s)^2 and mag */
    double unknown_density;
    double detection_probability; /* that an object of the catalogue in the field has a track */
    bst_target_params fit;        /* limits of a fit, and the floor of the rate's error */
} bst_identity_params;

/* Probabilities of the tracks of one comparison. */
struct bst_identity {
    int tracks, objects;
    int64_t track_id[BST_IDENTITY_TRACKS];
    int32_t object[BST_IDENTITY_OBJECTS];
    double probability[BST_IDENTITY_TRACKS][BST_IDENTITY_OBJECTS];
    double unknown[BST_IDENTITY_TRACKS]; /* that it is of no object of the comparison */
    int left_out;                        /* tracks and objects without room */
};

/* Brightness over which objects are spread if an object's or a track's is unknown, mag. */
#define BST_IDENTITY_MAG 10.0

/* Factor from exp(-(chi2 + log_det) / 2) of bst_target_misfit to a density per sr, (rad/s)^2 and
 * mag. */
double bst_identity_scale(const bst_target_cue *cue, const bst_mtt_track *track);

/* True if a track takes part in a comparison: confirmed, moving, and of known rate. */
bool bst_identity_compares(const bst_identity_params *params, const bst_mtt_track *track);

/* Compares confirmed tracks with objects: each track is of at most one object, or of an unknown
 * one, and each object has at most one track.
 *
 * Given:     tracks   [track_count]; those that are tentative, at rest, or of unknown rate are left
 *                     out, and so are those beyond BST_IDENTITY_TRACKS
 *            objects  [object_count], at most BST_IDENTITY_OBJECTS
 * Returned:  *out     a row of probabilities for each track that was compared; with `unknown` it
 *                     adds up to 1
 * Notes:     a likelihood is Gaussian in direction, rate and brightness. The marginal probabilities
 *            are those of all joint assignments, in groups of up to 10 objects and 16 tracks; in a
 *            larger group each track is taken alone, which wastes information but is reliable, too.
 */
void bst_identity_match(const bst_identity_params *params, const bst_mtt_track *tracks,
                        int track_count, const bst_identity_object *objects, int object_count,
                        bst_identity *out);

/* Ln of the odds that a track is of no object of the comparison but at most of `object`; at most 0.
 * 0 for a track that was not compared. */
double bst_identity_log_unexplained(const bst_identity *identity, int64_t track_id, int32_t object);

#endif
