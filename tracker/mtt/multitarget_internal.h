/* Shared by the files of the multi-target tracker. */
#ifndef BST_TRACKER_MTT_MULTITARGET_INTERNAL_H
#define BST_TRACKER_MTT_MULTITARGET_INTERNAL_H

#include "sim/core/arena.h"
#include "tracker/mtt/assignment.h"
#include "tracker/mtt/multitarget.h"

/* Frames whose unused detections wait for a partner. */
#define BST_MTT_HISTORY 3
/* Candidates kept per track: the likeliest. */
#define BST_MTT_CANDIDATES BST_FILTER_CANDIDATES

/* Owners of a detection beside the confirmed tracks. */
#define BST_MTT_NOBODY (-1)
#define BST_MTT_SEVERAL (-2)

/* How a track has its detection. */
typedef enum bst_mtt_sharing {
    BST_MTT_ALONE = 0,
    BST_MTT_WIDENED,    /* shared, and widened by `extra` */
    BST_MTT_HIDDEN,     /* another's, which hides it: its filter gets nothing */
    BST_MTT_OUTSHINING, /* its own, widened by `extra`: it hides another */
} bst_mtt_sharing;

/* Unused detections of one frame, sorted along one axis. */
typedef struct bst_mtt_pool {
    double seconds;
    int64_t tick;
    int count;
    int axis;    /* 0, 1, 2: of the direction's component that detections are sorted by */
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
    bst_mtt_track *memory; /* what was deleted, oldest first */
    int memory_count;
    int track_count;
    int rest_count; /* of them at rest */
    int sleepers;   /* of them asleep in this frame */
    int64_t next_id;
    double seconds; /* of the latest frame */
    bool started;
    /* By how much the cue's mean rate of the time before the frame is behind its rate at the frame,
     * per second of that time; in the tangent plane at the cue. */
    bool cue_lag_valid;
    bst_vec3 cue_lag_radps2;
    int bad_pixels;         /* of the latest frame */
    int charged;            /* the same */
    double clutter;         /* smoothed number of unused detections per frame */
    double clutter_density; /* per steradian, for this frame */
    /* smoothed number of detections that no confirmed track has, of how many frames, and their
     * density */
    double alarms;
    int alarm_frames;
    double alarm_density;
    int lost;
    bst_mtt_event *events;
    int event_count;
    bst_assignment *assignment;
    bst_mtt_pool now;
    bst_mtt_pool history[BST_MTT_HISTORY]; /* newest first */
    int history_count;
    /* work space of association, per track or per edge */
    int *rows; /* track of each assignment row */
    int *first, *edge_columns, *column_of_row;
    double *edge_costs, *miss_costs;
    int *edge_order, *edge_row; /* for the cheapest pair first */
    double *edge_key;
    int *owner; /* index of the confirmed track that has a detection; negative: none or several */
    double largest_sigma;    /* of the frame's detections, rad */
    int *detection_of_track; /* index into now.items, -1 none */
    double (*extra)[3];      /* widening of a shared detection, tangent axes of the track */
    bst_mtt_sharing *shared;
    bool *observable;
    double
        *departed_chi2; /* chi2 of a manoeuvre found in this frame with the wider gate; 0: none */
};

/* Takes the arrays of a pool for `capacity` detections from an arena. */
void bst_mtt_pool_lay_out(bst_mtt_pool *pool, int capacity, bst_arena *arena);
/* Heap sort of `count` keys, ascending, and of what goes with them: in place, no worst case, no
 * library sort that may allocate. */
void bst_mtt_sort(double *key, int *order, int count);
/* Sorts the pool's detections so that ranges can be looked up. */
void bst_mtt_pool_index(bst_mtt_pool *pool);
/* Range of sorted positions whose component lies within `chord` of direction's. */
void bst_mtt_pool_range(const bst_mtt_pool *pool, bst_vec3 direction, double chord, int *begin,
                        int *end);

/* Fills detection_of_track, shared and extra for the tracks of this frame (already predicted). */
void bst_mtt_associate(bst_mtt *mtt, bool partial);

/* What a detection's brightness adds to -ln of its likelihood, at most 4.5. */
double bst_mtt_brightness_cost(const bst_mtt_track *track, const bst_mtt_detection *detection);

/* Gives missed confirmed tracks a detection that they share with a neighbour. */
void bst_mtt_share(bst_mtt *mtt);

/* Detections in the gate of track t that no other confirmed track has: at most BST_MTT_CANDIDATES,
 * the likeliest. Returns their number. */
int bst_mtt_gated(const bst_mtt *mtt, int t, int *columns);

/* Notes what there is to see of track t, already predicted, and whether it sleeps; sets observable
 * and may_miss, the former having said whether its place is in the field. */
void bst_mtt_look(bst_mtt *mtt, int t, const bst_mtt_frame *frame);
/* After a detection: notes what the track looks like in full light, if it is in that. */
void bst_mtt_note_light(bst_mtt_track *track);

/* Predicts the kept tracks to a frame; drops those that are too old or too uncertain. */
void bst_mtt_predict_memory(bst_mtt *mtt, const bst_mtt_frame *frame);
/* Predicts a track to a frame by its orbit.
 *
 * Returned:  false if it has no orbit, or if the frame has no observer position */
bool bst_mtt_predict_orbit(const bst_mtt *mtt, bst_mtt_track *track, const bst_mtt_frame *frame);
/* Updates the orbits of tracks with the frame's detections, and starts new orbits. */
void bst_mtt_update_orbits(bst_mtt *mtt, const bst_mtt_frame *frame);
/* Keeps a confirmed track that is deleted, for bst_mtt_resume. */
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

/* Gates the detections that are left for a manoeuvre of confirmed tracks without a detection.
 *
 * Notes:     the manoeuvre began after the track's latest detection. A track gets the likeliest
 *            detection if that is likelier than a miss and clutter together; then its covariance
 *            is increased by the manoeuvre's process noise over that time. */
void bst_mtt_gate_manoeuvres(bst_mtt *mtt);

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

/* Whether there is room for one more track, at rest or not, with `reserve` places left over. */
bool bst_mtt_has_room(const bst_mtt *mtt, bool at_rest, int reserve);

/* Does a track show no motion, and is it not what the cue expects? */
bool bst_mtt_is_at_rest(const bst_mtt *mtt, const bst_mtt_frame *frame, const bst_mtt_track *track);

/* Is the rate of a track at rest known to be less than any object's? */
bool bst_mtt_is_star(const bst_mtt *mtt, const bst_mtt_frame *frame, const bst_mtt_track *track);

/* Notes whether a track's newest detection shows it to have moved. */
void bst_mtt_note_place(bst_mtt_track *track, const bst_mtt_detection *detection);

/* Moves a track to what is at rest or from there, if there is room for it. */
void bst_mtt_set_rest(bst_mtt *mtt, bst_mtt_track *track, bool at_rest);

/* Makes a track at rest a star. */
void bst_mtt_make_star(bst_mtt_track *track);

/* Carries a star over dt_s. */
void bst_mtt_predict_star(const bst_mtt *mtt, double dt_s, bst_mtt_track *track);

/* Begins the comparison of a track with a fixed place of the sensor. */
void bst_mtt_start_fixed(const bst_mtt *mtt, const bst_mtt_detection *first, bst_mtt_track *track);
/* Compares the track's next detection, which has `log_density` (rad^-2) by its motion. */
void bst_mtt_note_fixed(const bst_mtt *mtt, const bst_mtt_detection *detection, double log_density,
                        bst_mtt_track *track);
/* Whether a track may be a defective pixel for all that its detections say. */
bool bst_mtt_may_be_fixed(const bst_mtt *mtt, const bst_mtt_track *track);

/* Whether a track has the cue's acceleration. What the observer's motion adds to a rate falls with
 * the range, as the rate itself does: what is at rest, or nearly so beside the cue, is too far away
 * to share it. */
bool bst_mtt_shares_acceleration(const bst_mtt *mtt, const bst_mtt_track *track,
                                 const bst_mtt_frame *frame);
/* What the cue's motion over dt_s has that a constant rate has not, as tangent vectors at the cue's
 * present direction; false: it cannot be told. */
bool bst_mtt_cue_acceleration(const bst_mtt_frame *frame, double dt_s, bst_vec3 *step,
                              bst_vec3 *rate);

/* Starts tentative tracks from unused detections of this frame and of earlier ones. */
void bst_mtt_initiate(bst_mtt *mtt, const bst_mtt_frame *frame);

#endif
