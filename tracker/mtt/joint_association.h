/* Joint probabilistic association of all tracks and detections of a frame, with existence
 * probabilities and merged measurements: the data association of a track-oriented Poisson
 * multi-Bernoulli filter (Williams, IEEE Trans. AES 51, 2015).
 *
 * Tracks that may be unresolved from each other form a group. The joint hypotheses of a group are
 * enumerated: each track is missed, has a detection of its own, or shares one with another track of
 * the group. Groups compete for detections; belief propagation gives the probabilities (Williams
 * and Lau, IEEE Trans. AES 50, 2014), exactly where no detection has two groups. */
#ifndef BST_TRACKER_MTT_JOINT_ASSOCIATION_H
#define BST_TRACKER_MTT_JOINT_ASSOCIATION_H

#include <stdbool.h>
#include <stdint.h>

#include "sim/core/arena.h"
#include "tracker/mtt/sky_filter.h"

/* Most tracks of a group, links between them, detections (bits of a mask) and joint hypotheses. */
enum {
    BST_JOINT_MEMBERS = 8,
    BST_JOINT_LINKS = 28,
    BST_JOINT_EDGES = 64,
    BST_JOINT_MOST_STATES = 1024
};
/* Choices of a member: no detection; no detection and unresolved from another member. */
enum { BST_JOINT_MISSED = -1, BST_JOINT_LOST = -3 };

/* A detection as the origin of a track's measurement. */
typedef struct bst_joint_hypothesis {
    int column;  /* detection */
    int partner; /* track that shares it; -1: none */
    int edge;    /* index among the detections of the group */
    int next;    /* next hypothesis of the track, by descending odds if alone; -1: last */
    /* of the track alone; for a shared detection: given the partner's predicted state */
    bst_sky_measurement sky;
    double log_odds; /* ln of the weight over that of a miss; shared: of both tracks */
    double probability;
    double merged; /* tentative track: probability that the detection is of another one, too */
} bst_joint_hypothesis;

/* Two tracks that may be unresolved. */
typedef struct bst_joint_link {
    int a, b;          /* members of the group */
    double unresolved; /* probability */
    double log_miss;   /* ln of the weight of unresolved and missed over both missed */
    int first, count;  /* hypotheses: first + 2 i of a, first + 2 i + 1 of b */
} bst_joint_link;

/* A joint hypothesis of a group. */
typedef struct bst_joint_state {
    double weight;  /* largest of the group: 1 */
    uint64_t edges; /* detections used */
    int choices;    /* first of the members' choices: a hypothesis, or BST_JOINT_MISSED, _LOST */
} bst_joint_state;

typedef struct bst_joint_edge {
    int column;
    double to_detection, from_detection; /* messages */
} bst_joint_edge;

typedef struct bst_joint_group {
    int members, first_member;
    int edges, first_edge;
    int states, first_state;
} bst_joint_group;

/* Work space of one frame. */
typedef struct bst_mtt_joint {
    int hypothesis_room, state_room, choice_room;
    int hypotheses, groups, edges, states, choices, members;
    bst_joint_hypothesis *hypothesis;
    bst_joint_group *group;
    bst_joint_edge *edge;
    bst_joint_state *state;
    int *choice;
    int *member;    /* tracks by group */
    int *head;      /* first hypothesis of each track; -1: none */
    int *root;      /* union-find of tracks that may be unresolved; -1: the track was in a group */
    int *size;      /* tracks of the set of a root */
    double *missed; /* probability that a track exists and has no detection */
    double *claimed,
        *claimed_firm; /* probability that a detection is any, or a confirmed, track's */
    int *decided;      /* hypothesis of the track's detection; -1: none */
} bst_mtt_joint;

struct bst_mtt;
struct bst_mtt_track;

/* Takes the arrays of a work space for `tracks` tracks and `detections` detections. */
void bst_mtt_joint_lay_out(bst_mtt_joint *joint, int tracks, int detections, bst_arena *arena);

/* Associates the frame's detections with the predicted tracks: sets the probabilities, the
 * existence of each track, detection_of_track, shared and used. */
void bst_mtt_associate_jointly(struct bst_mtt *mtt);

/* Updates the filter of track t with the probabilities of its hypotheses.
 *
 * Given:     components  as in bst_filter_update
 * Returned:  false if the track's detection is not one of its hypotheses (manoeuvre gate), or if it
 *            is a star */
bool bst_mtt_joint_update(struct bst_mtt *mtt, int t, int components);

/* Hypothesis of the detection of track t; NULL: it is missed, or has a detection of the manoeuvre
 * gate or of a split. */
const bst_joint_hypothesis *bst_mtt_joint_decision(const struct bst_mtt *mtt, int t);

/* True if the existence probability of a tentative track is high enough for its confirmation; with
 * other associations always. */
bool bst_mtt_joint_exists(const struct bst_mtt *mtt, const struct bst_mtt_track *track);
/* True if a track is to be deleted because it rather does not exist; with other associations never.
 */
bool bst_mtt_joint_is_gone(const struct bst_mtt *mtt, const struct bst_mtt_track *track);

/* Ends tentative tracks that have the detection and the state of a likelier track, which takes over
 * their existence probability: hypotheses on one object that began with different detections.
 *
 * Given:     same_chi2  largest distance of their states, 4 degrees of freedom */
void bst_mtt_joint_drop_duplicates(struct bst_mtt *mtt, double same_chi2);

/* Forms the groups of tracks and enumerates their joint hypotheses. */
void bst_mtt_joint_enumerate(struct bst_mtt *mtt);

/* Adds a hypothesis to a track's list. Returns its index; -1 if there is no room. */
int bst_mtt_joint_add(bst_mtt_joint *joint, int track, const bst_joint_hypothesis *hypothesis);

#endif
