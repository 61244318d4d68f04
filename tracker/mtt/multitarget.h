/* Multi-target tracking on the celestial sphere: gating, association, filtering, two-point
 * initiation, M-of-N confirmation, coasting, deletion, and re-identification of deleted tracks.
 *
 * Two detections start a tentative track. It is confirmed after M hits in its first N frames if its
 * innovations are consistent and its log-likelihood ratio against clutter is high enough (Blackman
 * and Popoli 1999, section 6.2). Dense clutter therefore requires more hits. With BST_MTT_PMB the
 * existence probability stands in place of N. Frames in which a track lies outside the field do not
 * count.
 *
 * Stars that are in no catalogue are recognised by their rate. A track is stationary while its rate
 * is compatible with zero, or while it has not moved by the length of its image, unless the cue
 * expects it (blends and truncated streaks displace a centroid by as much). A stationary track is
 * not confirmed; a pair of detections at one position starts one before any other pairing. Once its
 * rate is known to be below any object's, the track is a star: a fixed direction whose detections
 * no other track gets. Stationary tracks have a capacity of their own.
 *
 * On a sensor with bad pixels a track is confirmed only if its motion is likelier than one fixed
 * pixel, by a likelihood ratio of at least the number of known bad pixels. */
#ifndef BST_TRACKER_MTT_MULTITARGET_H
#define BST_TRACKER_MTT_MULTITARGET_H

#include <stdbool.h>
#include <stdint.h>

#include "boresight/archive.h"
#include "boresight/messages.h"
#include "boresight/status.h"
#include "tracker/mtt/filter.h"
#include "tracker/orbit/orbit_track.h"

typedef enum bst_mtt_association {
    BST_MTT_GNN = 0, /* global nearest neighbour: the assignment of least total cost */
    BST_MTT_NEAREST, /* the cheapest pair first, then the cheapest remaining one */
    /* probabilistic data association: as GNN, but a confirmed track's filter weighs every detection
     * in its gate that no other confirmed track has */
    BST_MTT_PDA,
    /* as PDA, but the filter keeps the likeliest association hypotheses as a mixture, so that later
     * detections decide; with BST_FILTER_IMM equal to PDA */
    BST_MTT_MIXTURE,
    /* joint probabilities of all tracks and detections, with existence probabilities and merged
     * measurements (joint_association.h); filters keep mixtures as with BST_MTT_MIXTURE */
    BST_MTT_PMB,
} bst_mtt_association;

typedef struct bst_mtt_params {
    int max_tracks, max_detections;
    bst_filter_kind filter;
    bst_mtt_association association;
    double noise_rad2ps3; /* power spectral density of the acceleration of a quiet object */
    /* and of a steady one, smaller (filter.h); 0: the noise is not adapted; not with IMM */
    double steady_noise_rad2ps3;
    /* manoeuvring object: acceleration, mean time between manoeuvres and mean duration; IMM only */
    double manoeuvre_noise_rad2ps3, quiescent_sojourn_s, manoeuvre_sojourn_s;
    double gate_chi2; /* 2 degrees of freedom */
    double detection_probability;
    double false_alarms_per_frame;    /* lower limit of the estimated clutter density */
    double field_sr;                  /* solid angle of the field of view */
    double pixel_rad;                 /* 0: no test for defective pixels */
    int confirm_hits, confirm_frames; /* M of N, including the two initial detections */
    double confirm_score;             /* least log-likelihood ratio */
    bool orbits; /* tracks whose range is known or assumed move along orbits (orbit_track.h) */
    double range_correlation_s;   /* of ranges of detections; 0: they are not used */
    double orbit_noise_m2ps3;     /* white acceleration in addition to two-body motion */
    double max_rate_radps;        /* of tracks that start without the cue */
    double cue_rate_margin_radps; /* widens the cue's rate sigma */
    double initiation_gap_s;      /* longest time between the two detections that start a track */
    int max_misses;       /* missed detections in a row after which a confirmed track is deleted */
    double max_coast_s;   /* longest time without a detection */
    double max_sigma_rad; /* a track with a direction worse than this is deleted */
    double merge_rad;     /* distance below which two objects may share one detection */
    double merge_floor_rad;  /* 1 sigma per axis added to a shared detection */
    int max_merged_frames;   /* most frames in a row that a track may use shared detections */
    double feed_forward_rad; /* tracks this close to the cue follow the cue's acceleration */
    double star_rate_radps;  /* rate of the slowest object; 0: no track becomes a star */
    double motion_chi2; /* chi-square of a rate above which a track moves, 2 degrees of freedom */
    int max_stationary_tracks;        /* capacity for stationary tracks */
    double brightness_systematic_mag; /* 1 sigma added to every magnitude */
    double
        brightness_random_walk_mag; /* 1 sigma by which an object's brightness changes per frame */
    /* Manoeuvres and changes of brightness are detected in the innovations of the latest
     * event_window hits (at most BST_MTT_EVENT_WINDOW). false_events_per_hour bounds the false
     * events of either kind per track; 0: no detection of events. */
    int event_window;
    double false_events_per_hour;
    /* Deleted tracks that had been confirmed are kept. A new confirmed track whose direction and
     * rate fit the prediction of a kept one takes over its identity. */
    int max_dormant_tracks;       /* most tracks kept; 0: none */
    double max_dormant_s;         /* time that they are kept, s */
    double max_dormant_sigma_rad; /* and while the 1 sigma of their direction is below this */
    double dormant_gate_chi2;     /* largest misfit of direction and rate, 4 degrees of freedom */
    bool keep_priors;             /* bst_mtt_priors has them */
} bst_mtt_params;

#define BST_MTT_EVENT_WINDOW 16

/* Visibility of an object, predicted from its orbit. */
typedef enum bst_mtt_sight {
    BST_MTT_CLEAR = 0,
    BST_MTT_FAINT,  /* possibly too dim, or behind the Earth's limb: misses do not count */
    BST_MTT_SHADOW, /* too dim (penumbra or phase) */
    BST_MTT_DARK,   /* certainly in the Earth's umbra */
    BST_MTT_EARTH,  /* occulted by the Earth */
} bst_mtt_sight;

/* Predicted brightness of an object on an orbit. */
typedef struct bst_mtt_light {
    double sunlight; /* illuminated share of the Sun's disc */
    /* 1/m^2: brightness of a diffuse sphere at its range and phase angle; 0: unknown */
    double glow;
    double snr;  /* predicted SNR; 0: unknown */
    bool bright; /* so far above the threshold that nearly every frame detects it */
} bst_mtt_light;

/* A detection that is no star, as a direction on the sky. */
typedef struct bst_mtt_detection {
    bst_sky_measurement sky; /* geometric */
    double x_px, y_px;
    double v_mag, v_mag_sigma; /* sigma INFINITY: brightness unknown */
    double snr;
    double length_rad;             /* FWHM of its image along its longer axis */
    double width_px;               /* FWHM across; 0: unknown */
    double range_m, range_sigma_m; /* from its size; 0: unknown */
} bst_mtt_detection;

/* Hypothetical defective pixel that caused a track's detections. */
typedef struct bst_mtt_defect {
    double x_px, y_px, variance_px2; /* variance per axis */
} bst_mtt_defect;

/* Defective-pixel hypothesis of a track (fixed_pixel.c). */
typedef struct bst_mtt_fixed {
    bst_mtt_defect now, before;
    double log_odds; /* log-likelihood ratio of the track's motion against it */
} bst_mtt_fixed;

/* Levels of an object's SNR: -1, 0 ... 5 above the detection threshold, the last one stands for all
 * above it. */
enum { BST_MTT_SNR_LEVELS = 7 };

typedef struct bst_mtt_track {
    int64_t id;
    bst_track_status status;
    bst_sky_state state;
    bst_filter_models models;
    bst_orbit_track orbit; /* valid: `state` is derived from it */
    double v_mag, v_mag_variance;
    double snr, x_px, y_px;               /* latest detection */
    double snr_level[BST_MTT_SNR_LEVELS]; /* probability of each level of its SNR */
    int hits, misses_in_row, merged_in_row;
    /* number of frames since confirmation in which another track was resolved next to it */
    int apart;
    int frames;       /* frames since the first detection in which it was observable */
    double score;     /* log-likelihood ratio against clutter */
    double existence; /* probability that the object exists; BST_MTT_PMB only */
    double chi2;      /* sum over the hits after initiation, 2 degrees of freedom each */
    double last_chi2; /* of the latest detection; negative if the latest frame had none */
    int64_t first_tick, last_update_tick;
    int64_t gate_tick; /* latest frame with a detection in its gate, not in a wider one */
    double last_update_s;
    bst_vec3 first_direction; /* of its first detection */
    double first_length_rad;
    bst_mtt_fixed fixed;
    bool moved;   /* the latest detection is farther from the first than their images are long */
    bool at_rest; /* shows no motion and is not what the cue expects */
    bst_mtt_sight sight; /* visibility in the latest frame; BST_MTT_CLEAR without an orbit */
    bst_mtt_light light; /* predicted light in the latest frame; with an orbit only */
    /* Dormant: it was hidden (shadow, occultation) and not detected since. It follows its orbit
     * only, until a newly confirmed track is identified with it. It is deleted as stored tracks
     * are, or by misses. */
    bool asleep;
    bool lit;      /* its orbit has predicted it visible at least once */
    bool replaced; /* replaced in this frame by the track identified with it */
    bool may_miss; /* a missing detection in the latest frame counts */
    double dark;   /* probability that the object gives too little light, see visibility.h */
    /* running means over detections in full sunlight without selection bias; SNR, glow 0: none yet
     */
    double full_snr, full_v_mag, full_glow;
    bool was_bright; /* was predicted bright in an earlier frame */
    /* stationary and known to be slower than any object: zero rate, status not tentative, deleted
     * only after max_coast_s */
    bool star;
    /* ring buffers of normalised innovations of the latest hits: direction (2) and brightness */
    double innovations[BST_MTT_EVENT_WINDOW][2], brightness[BST_MTT_EVENT_WINDOW];
    int innovation_count, brightness_count; /* since the start or the latest event */
    double manoeuvre_end_s;                 /* the filter assumes a detected manoeuvre until then */
    bool burned; /* in this frame it took over the identity of a track that it left by a burn */
} bst_mtt_track;

/* Predicted state of a track, before the update of a frame. */
typedef struct bst_mtt_prior {
    int64_t id; /* of the track before the frame */
    bst_sky_state state;
} bst_mtt_prior;

/* Input of one frame. */
typedef struct bst_mtt_frame {
    int64_t tick;   /* mid-exposure */
    double seconds; /* mid-exposure, s since the epoch */
    const bst_mtt_detection *detections;
    int count;
    /* only windows about the confirmed tracks were searched: tentative tracks are not missed, and
     * the clutter density is not updated */
    bool partial;
    /* True if a geometric direction is on the sensor, well inside its edge. NULL: always. */
    bool (*in_field)(const void *user, bst_vec3 direction);
    const void *user;
    double threshold_snr; /* detection threshold; 0: unknown; BST_MTT_PMB only */
    bst_vec3 boresight;   /* zero vector: the field does not move; BST_MTT_PMB only */
    /* Cue's direction and rate at the previous frame and at this one: for acceleration feed-forward
     * and for the rate gate of initiation. */
    bool cue_valid, cue_before_valid;
    bst_vec3 cue_direction, cue_rate_radps;
    bst_vec3 cue_before_direction, cue_before_rate_radps;
    double cue_rate_sigma_radps;
    /* Rate that the cue expects in a direction; false: none. NULL: the cue's own rate everywhere.
     */
    bool (*expected_rate)(const void *user, bst_vec3 direction, bst_vec3 *rate_radps);
    /* True if the cue explains a track, so that a low rate does not make it a star. NULL: never. */
    bool (*expected)(const void *user, const bst_mtt_track *track);
    /* Observer's state, for tracks on orbits; NULL: orbits are not predicted. */
    const bst_od_observer *observer;
    /* Prior of a confirmed track's range; false: none. NULL: none for any track. */
    bool (*range)(const void *user, const bst_mtt_track *track, bst_orbit_range *out);
    /* Visibility of a confirmed track with an orbit at the frame's time. NULL: everything is in
     * full sunlight. */
    bst_mtt_sight (*sight)(const void *user, const bst_mtt_track *track, bst_mtt_light *light);
    int bad_pixels; /* number of known bad pixels; as many unknown ones are assumed */
    int charged;    /* detections omitted because they were classified as charge, not light */
    /* 1 sigma per axis of an apparent rate common to all directions of the frame */
    double common_rate_sigma_radps;
} bst_mtt_frame;

typedef enum bst_mtt_event_kind {
    BST_MTT_CONFIRMED,
    BST_MTT_RESUMED, /* confirmed and identified with an earlier track, whose identity it takes */
    BST_MTT_LOST,
    BST_MTT_MANOEUVRE,
    BST_MTT_BRIGHTNESS,
} bst_mtt_event_kind;

typedef struct bst_mtt_event {
    bst_mtt_event_kind kind;
    /* test statistic of a manoeuvre (chi-square, 2 degrees of freedom) or brightness change (1) */
    double statistic;
    bst_mtt_track track; /* state at the event */
} bst_mtt_event;

typedef struct bst_mtt bst_mtt;

/* Creates a multi-target tracker; allocates all memory.
 *
 * Errors:    BST_ERR_ARGUMENT, BST_ERR_MEMORY
 * Ownership: free with bst_mtt_free */
bst_status bst_mtt_create(bst_ctx *ctx, const bst_mtt_params *params, bst_mtt **out) BST_MUST_CHECK;
/* Frees a multi-target tracker; NULL is allowed. */
void bst_mtt_free(bst_mtt *mtt);

/* Saves or restores all tracks, for bst_module_desc.archive. After a restore there are no events.
 *
 * Errors:    BST_ERR_FORMAT for damaged tracks */
bst_status bst_mtt_archive(bst_mtt *mtt, bst_archive *archive) BST_MUST_CHECK;

/* Processes one frame; frames must be in ascending order of time. Detections beyond max_detections
 * are ignored and counted by bst_mtt_lost. */
void bst_mtt_step(bst_mtt *mtt, const bst_mtt_frame *frame);

/* Predicts the tracks to a frame without usable detections (no attitude). No misses are counted. */
void bst_mtt_skip(bst_mtt *mtt, const bst_mtt_frame *frame);

/* Tracks after the latest frame by ascending id, including stationary ones; valid until the next
 * step. */
const bst_mtt_track *bst_mtt_tracks(const bst_mtt *mtt, int *count);
/* Track with an identity; NULL if there is none. It belongs to the tracker. */
const bst_mtt_track *bst_mtt_find(const bst_mtt *mtt, int64_t id);
/* Predicted states of the latest frame in the order of its tracks, those that it deleted included;
 * none unless the parameter keep_priors is set. Valid until the next step. */
const bst_mtt_prior *bst_mtt_priors(const bst_mtt *mtt, int *count);
/* Track events of the latest frame; valid until the next step. */
const bst_mtt_event *bst_mtt_events(const bst_mtt *mtt, int *count);
/* Stored (deleted) tracks predicted to the latest frame; valid until the next step. */
const bst_mtt_track *bst_mtt_memory(const bst_mtt *mtt, int *count);
/* Clutter density per steradian used for confirmed tracks in the latest frame. */
double bst_mtt_clutter_density(const bst_mtt *mtt);
/* Number of tracks and detections of the latest frame dropped for lack of capacity. */
int bst_mtt_lost(const bst_mtt *mtt);

#endif
