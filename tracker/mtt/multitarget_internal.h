/* Declarations shared by the files of the multi-target tracker. */
#ifndef BST_TRACKER_MTT_MULTITARGET_INTERNAL_H
#define BST_TRACKER_MTT_MULTITARGET_INTERNAL_H

#include "boresight/archive.h"
#include "sim/core/arena.h"
#include "tracker/mtt/assignment.h"
#include "tracker/mtt/joint_association.h"
#include "tracker/mtt/multitarget.h"

/* Number of frames whose unused detections are kept for two-point initiation. */
#define BST_MTT_HISTORY 3
/* Candidate detections per track: the likeliest. */
#define BST_MTT_CANDIDATES BST_FILTER_CANDIDATES

/* Intervals of the SNR of false alarms. */
enum { BST_MTT_SNR_INTERVALS = 6 };

/* Values of `owner` for detections without a single confirmed track. */
#define BST_MTT_NOBODY (-1)
#define BST_MTT_SEVERAL (-2)

/* How a track shares its detection. */
typedef enum bst_mtt_sharing {
    BST_MTT_ALONE = 0,
    BST_MTT_WIDENED,    /* shared; covariance increased by `extra` */
    BST_MTT_HIDDEN,     /* belongs to a brighter object that hides this one: no filter update */
    BST_MTT_OUTSHINING, /* its own, increased by `extra`: it hides another object */
} bst_mtt_sharing;

/* Unused detections of one frame, sorted along one axis. */
typedef struct bst_mtt_pool {
    double seconds;
    int64_t tick;
    double undetected; /* mean number of undetected objects in the field before this frame */
    int count;
    int axis;    /* 0, 1, 2: direction component by which detections are sorted */
    int *order;  /* indices into items by ascending component */
    double *key; /* component of items[order[i]] */
    bst_mtt_detection *items;
    bool *used;
} bst_mtt_pool;

struct bst_mtt {
    bst_arena arena; /* of all arrays below */
    bst_mtt_params params;
    bst_filter_params filter;
    bst_mtt_track *tracks;
    bst_mtt_track *memory; /* stored deleted tracks, oldest first */
    int memory_count;
    int track_count;
    int rest_count; /* number of stationary tracks */
    int sleepers;   /* number of dormant tracks in this frame */
    int64_t next_id;
    double seconds; /* time of the latest frame */
    bool started;
    /* Difference of the cue's rate at the frame and its mean rate over the interval before, per
     * second of the interval; in the tangent plane at the cue. */
    bool cue_lag_valid;
    bst_vec3 cue_lag_radps2;
    double undetected;      /* mean number of undetected objects in the field */
    bst_vec3 boresight;     /* of the latest frame; zero vector: unknown */
    int bad_pixels;         /* of the latest frame */
    int charged;            /* charge detections of the latest frame */
    double threshold_snr;   /* of this frame; 0: unknown, no object is taken for faint */
    double clutter;         /* smoothed number of unused detections per frame */
    double clutter_density; /* per steradian, for this frame */
    /* smoothed number of detections without a confirmed track, number of frames averaged, and
     * density */
    double alarms;
    int alarm_frames;
    double alarm_density;
    double alarm_snr[BST_MTT_SNR_INTERVALS]; /* number of those of the latest frames by SNR */
    int lost;
    bst_mtt_event *events;
    int event_count;
    bst_assignment *assignment;
    bst_mtt_pool now;
    bst_mtt_pool history[BST_MTT_HISTORY]; /* newest first */
    int history_count;
    /* association work space, per track or per edge */
    int *rows; /* track of each assignment row */
    int *first, *edge_columns, *column_of_row;
    double *edge_costs, *miss_costs;
    int *edge_order, *edge_row; /* edges sorted by cost */
    double *edge_key;
    int *owner; /* index of the confirmed track that owns a detection; negative: none or several */
    double largest_sigma;    /* of the frame's detections, rad */
    int *detection_of_track; /* index into now.items, -1 none */
    double (*extra)[3];      /* extra covariance of a shared detection, tangent axes of the track */
    bst_mtt_sharing *shared;
    bool *observable;
    bst_mtt_joint joint;   /* BST_MTT_PMB only */
    bst_mtt_prior *priors; /* keep_priors only */
    int prior_count;
    double *departed_chi2; /* chi-square of a manoeuvre detected in this frame with the wider gate;
                              0: none */
};

/* Takes the arrays of a pool for `capacity` detections from an arena. */
void bst_mtt_pool_lay_out(bst_mtt_pool *pool, int capacity, bst_arena *arena);
/* Saves or restores a pool.
 *
 * Given:     capacity  as in bst_mtt_pool_lay_out */
void bst_mtt_pool_archive(bst_mtt_pool *pool, int capacity, bst_archive *archive);
/* Heap sort of `count` keys, ascending, and of what goes with them: in place, no worst case, no
 * library sort that may allocate. */
void bst_mtt_sort(double *key, int *order, int count);
/* Sorts the pool's detections for range searches. */
void bst_mtt_pool_index(bst_mtt_pool *pool);
/* Range of sorted positions of detections whose component lies within `chord` of the direction's.
 */
void bst_mtt_pool_range(const bst_mtt_pool *pool, bst_vec3 direction, double chord, int *begin,
                        int *end);

/* Associates the frame's detections with the predicted tracks: sets detection_of_track, shared and
 * extra. */
void bst_mtt_associate(bst_mtt *mtt, bool partial);
/* Takes the detections of a track that has just been confirmed out of the mean number of those
 * without a confirmed track. */
void bst_mtt_recount_alarms(bst_mtt *mtt, const bst_mtt_track *track);

/* Brightness term of the association cost (-ln likelihood), at most 4.5. */
double bst_mtt_brightness_cost(const bst_mtt_track *track, const bst_mtt_detection *detection);

/* Assigns shared detections to missed confirmed tracks next to a neighbour. */
void bst_mtt_share(bst_mtt *mtt);

/* Detections in the gate of track t, free or its own, and their costs (-ln of the likelihood ratio
 * against clutter): at most BST_MTT_CANDIDATES, the likeliest. Returns their number. */
int bst_mtt_gate(const bst_mtt *mtt, int t, int *columns, double *costs);

/* Detections in the gate of track t that no other confirmed track has: at most BST_MTT_CANDIDATES,
 * the likeliest. Returns their number. */
int bst_mtt_gated(const bst_mtt *mtt, int t, int *columns);

/* Sets the visibility of predicted track t and whether it is dormant; updates observable (on entry:
 * in the field) and may_miss. */
void bst_mtt_look(bst_mtt *mtt, int t, const bst_mtt_frame *frame);
/* Probability that a frame detects an object of the track's SNR. */
double bst_mtt_detection_probability(const bst_mtt *mtt, const bst_mtt_track *track);
/* Probability that a frame detects the object of a track, if it exists. */
static inline double bst_mtt_detectable(const bst_mtt *mtt, const bst_mtt_track *track) {
    bool counts = track->may_miss || track->star;
    return counts ? bst_mtt_detection_probability(mtt, track) * (1.0 - track->dark) : 0.0;
}
/* ln of the likelihood ratio of the SNR of a pair of detections: of one object, or false alarms;
 * not below 0. */
double bst_mtt_pair_brightness(const bst_mtt *mtt, double first_snr, double second_snr);
/* Reduces the number of false alarms seen so far before a frame's are added. */
void bst_mtt_fade_alarms(bst_mtt *mtt);
/* Adds false alarms of an SNR; count < 0: takes out detections that were none. */
void bst_mtt_note_alarm(bst_mtt *mtt, double snr, double count);
/* Starts the distribution of a track's SNR: all levels are equally probable. */
void bst_mtt_start_snr(bst_mtt_track *track);
/* Updates it by a detection with the light of the track's object alone. */
void bst_mtt_note_snr(const bst_mtt *mtt, double snr, bst_mtt_track *track);
/* Updates it by a frame that may have detected the object and did not. */
void bst_mtt_note_missed(const bst_mtt *mtt, bst_mtt_track *track);
/* Updates the probability that the object of track t is dark, and by a miss its SNR, after the
 * association, and its score by the miss. */
void bst_mtt_note_darkness(const bst_mtt *mtt, int t);
/* Updates a track's brightness in full sunlight after a detection, if it is in full sunlight. */
void bst_mtt_note_light(bst_mtt_track *track);

/* Predicts the stored tracks to a frame; drops those too old or too uncertain. */
void bst_mtt_predict_memory(bst_mtt *mtt, const bst_mtt_frame *frame);
/* Predicts a track to a frame by its orbit.
 *
 * Returned:  false if it has no orbit, or if the frame has no observer position */
bool bst_mtt_predict_orbit(const bst_mtt *mtt, bst_mtt_track *track, const bst_mtt_frame *frame);
/* Updates the orbits of tracks with the frame's detections, and starts new orbits. */
void bst_mtt_update_orbits(bst_mtt *mtt, const bst_mtt_frame *frame);
/* Stores a deleted confirmed track for bst_mtt_resume. */
void bst_mtt_remember(bst_mtt *mtt, const bst_mtt_track *track);
/* Gives a confirmed track the identity of an earlier track of the same object.
 *
 * Given:     anew  the track has just been confirmed: kept (deleted) tracks are considered too
 * Returned:  false if no earlier track fits, or if two fit about equally well
 * Notes:     a dormant track that had no detection since the track began is marked `replaced`. */
bool bst_mtt_resume(bst_mtt *mtt, bst_mtt_track *track, bool anew);

/* Largest false-alarm probability of one test for events of a track.
 *
 * Given:     dt_s  time since the test before, s
 * Returned:  0: events are not detected
 * Notes:     tests run at each hit, for windows of 1, 2, 4, ... hits; the probability that any of
 *            them is false is at most the sum of theirs. */
double bst_mtt_event_probability(const bst_mtt_params *params, double dt_s);

/* Associates remaining detections with confirmed tracks under the hypothesis of a manoeuvre.
 *
 * Notes:     the manoeuvre began after the track's latest detection. A track gets the likeliest
 *            detection if that is likelier than a miss and clutter together; then its covariance is
 *            increased by the manoeuvre's process noise over that time. */
void bst_mtt_gate_manoeuvres(bst_mtt *mtt);

/* Splits missed tracks into two objects that were unresolved until now, if two unused detections
 * are likelier so than as clutter. BST_MTT_PMB only. */
void bst_mtt_split_tracks(bst_mtt *m);

/* Predicts the mean number of undetected objects to a frame: objects enter with the sky that the
 * field reaches, and by their own motion. Called before the time of the frame is set. */
void bst_mtt_predict_undetected(bst_mtt *m, const bst_mtt_frame *frame);
/* Stores that number with the frame's detections, and reduces it by the frame's observation.
 *
 * Given:     partial  as in bst_mtt_frame */
void bst_mtt_observe_undetected(bst_mtt *m, bool partial);

/* Tests the innovations of a track's latest hits for a manoeuvre.
 *
 * Given:     innovation  that of the newest hit
 *            dt_s        time since the hit before, s
 * Returned:  true if they are an event; then the window starts anew
 *            *statistic  test statistic of the decision */
bool bst_mtt_note_innovation(const bst_mtt_params *params, bst_mtt_track *track,
                             const bst_sky_innovation *innovation, double dt_s, double *statistic);

/* Tests the magnitudes of a track's latest hits for a change of brightness.
 *
 * Given:     z     difference of the newest magnitude over its standard deviation
 *            dt_s  time since the hit before, s
 * Returned:  true if they are an event; then the window starts anew
 *            *statistic  test statistic of the decision */
bool bst_mtt_note_brightness(const bst_mtt_params *params, bst_mtt_track *track, double z,
                             double dt_s, double *statistic);

/* True if there is a free slot for one more track, stationary or not, with `reserve` slots left. */
bool bst_mtt_has_room(const bst_mtt *mtt, bool at_rest, int reserve);

/* True if a track shows no motion and the cue does not expect it. */
bool bst_mtt_is_at_rest(const bst_mtt *mtt, const bst_mtt_frame *frame, const bst_mtt_track *track);

/* True if the rate of a stationary track is known to be below any object's. */
bool bst_mtt_is_star(const bst_mtt *mtt, const bst_mtt_frame *frame, const bst_mtt_track *track);

/* Updates `moved`: the newest detection is displaced from the first. */
void bst_mtt_note_place(bst_mtt_track *track, const bst_mtt_detection *detection);

/* Makes a track stationary or not, if there is capacity. */
void bst_mtt_set_rest(bst_mtt *mtt, bst_mtt_track *track, bool at_rest);

/* Converts a stationary track to a star. */
void bst_mtt_make_star(bst_mtt_track *track);

/* Predicts a star over dt_s. */
void bst_mtt_predict_star(const bst_mtt *mtt, double dt_s, bst_mtt_track *track);

/* Starts the defective-pixel test of a track. */
void bst_mtt_start_fixed(const bst_mtt *mtt, const bst_mtt_detection *first, bst_mtt_track *track);
/* Updates the defective-pixel test with the track's next detection.
 *
 * Given:     log_density  log-likelihood of the detection under the track's motion, rad^-2 */
void bst_mtt_note_fixed(const bst_mtt *mtt, const bst_mtt_detection *detection, double log_density,
                        bst_mtt_track *track);
/* True if the track's detections are consistent with a defective pixel. */
bool bst_mtt_may_be_fixed(const bst_mtt *mtt, const bst_mtt_track *track);

/* True if a track shares the cue's acceleration. The observer's motion contributes to rates in
 * inverse proportion to range. A track at rest, or much slower than the cue, is too far away to
 * share it. */
bool bst_mtt_shares_acceleration(const bst_mtt *mtt, const bst_mtt_track *track,
                                 const bst_mtt_frame *frame);
/* Departure of the cue's motion over dt_s from a constant rate, as tangent vectors at the cue's
 * current direction. Returns false if it is unknown. */
bool bst_mtt_cue_acceleration(const bst_mtt_frame *frame, double dt_s, bst_vec3 *step,
                              bst_vec3 *rate);

/* Starts tentative tracks from unused detections of this frame and of earlier ones. */
void bst_mtt_initiate(bst_mtt *mtt, const bst_mtt_frame *frame);

#endif
