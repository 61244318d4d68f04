/* Multi-target tracking on the sky: gating, association and filter by name, two-point initiation,
 * M-of-N confirmation, coasting, deletion, and memory of what was deleted.
 *
 * A track that two detections start is tentative; it is confirmed when it has M hits in its first N
 * frames, its innovations fit their covariances, and its log-likelihood ratio against clutter
 * (Blackman and Popoli 1999, section 6.2) is high enough, so that dense clutter asks for more hits.
 * Frames in which a track lies outside the field count neither for nor against it.
 *
 * Stars that are in no catalogue are recognised by their rate. A track is stationary while its rate
 * is compatible with zero, or while it has not moved by the length of its image (blends and cut
 * streaks displace a centroid by as much), unless the cue expects it. A stationary track is not
 * confirmed; a pair of detections at one position starts one before any other pairing. Once its
 * rate is known to be less than any object's the track is a star: a fixed direction whose
 * detections no other track gets. Stationary tracks have a capacity of their own.
 *
 * On a sensor with bad pixels a track is confirmed when its detections prefer its motion to one
 * fixed place of the sensor, by a likelihood ratio of at least the number of bad pixels known. */
#ifndef BST_TRACKER_MTT_MULTITARGET_H
#define BST_TRACKER_MTT_MULTITARGET_H

#include <stdbool.h>
#include <stdint.h>

#include "boresight/messages.h"
#include "boresight/status.h"
#include "tracker/mtt/filter.h"
#include "tracker/orbit/orbit_track.h"

typedef enum bst_mtt_association {
    BST_MTT_GNN = 0, /* the assignment of least total cost */
    BST_MTT_NEAREST, /* the cheapest pair first, then the cheapest of the rest */
    BST_MTT_PDA, /* as GNN, but a confirmed track's filter weighs every detection in its gate that
                    no other confirmed track has */
    BST_MTT_MIXTURE, /* as PDA, and the filter keeps the likeliest choices apart, so that later
                        detections decide; with BST_FILTER_IMM the same as PDA */
} bst_mtt_association;

typedef struct bst_mtt_params {
    int max_tracks, max_detections;
    bst_filter_kind filter;
    bst_mtt_association association;
    double noise_rad2ps3; /* acceleration's power spectral density; of a quiet object */
    /* of a manoeuvring one, and mean times between manoeuvres and of one: IMM only */
    double manoeuvre_noise_rad2ps3, quiescent_sojourn_s, manoeuvre_sojourn_s;
    double gate_chi2; /* 2 degrees of freedom */
    double detection_probability;
    double false_alarms_per_frame; /* least density of clutter that is believed */
    double field_sr;               /* solid angle of the field */
    double pixel_rad;              /* 0: that a track may be a place of the sensor is not asked */
    int confirm_hits, confirm_frames; /* M of N, the two initial detections included */
    double confirm_score;             /* least log-likelihood ratio */
    bool orbits; /* tracks whose range is known or assumed move along orbits (orbit_track.h) */
    double orbit_noise_m2ps3;     /* white acceleration beside two-body motion */
    double max_rate_radps;        /* of tracks that start without the cue */
    double cue_rate_margin_radps; /* widens the cue's rate sigma */
    double initiation_gap_s;      /* longest time between the two detections that start a track */
    int max_misses;               /* in a row, after which a confirmed track is deleted */
    double max_coast_s;           /* longest time without a detection */
    double max_sigma_rad;         /* a track with a direction worse than this is deleted */
    double merge_rad;             /* closer than this two objects may share one detection */
    double merge_floor_rad;       /* 1 sigma per axis added to a shared detection */
    int max_merged_frames;        /* frames in a row that a track may live on shared detections */
    double feed_forward_rad;      /* tracks this close to the cue follow the cue's acceleration */
    double star_rate_radps;       /* rate of the slowest object; 0: no track is taken for a star */
    double motion_chi2;        /* chi2 of a rate above which a track moves, 2 degrees of freedom */
    int max_stationary_tracks; /* room for tracks at rest */
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
    int max_dormant_tracks;   /* most tracks kept; 0: none */
    double max_dormant_s;     /* time that they are kept, s */
    double memory_sigma_rad;  /* and while their direction is known to this, 1 sigma */
    double dormant_gate_chi2; /* largest misfit of direction and rate, 4 degrees of freedom */
} bst_mtt_params;

#define BST_MTT_EVENT_WINDOW 16

/* What there is to see of an object, as its orbit has it. */
typedef enum bst_mtt_sight {
    BST_MTT_CLEAR = 0,
    BST_MTT_FAINT,  /* it may be too dim to be seen, or behind the Earth's limb: no miss counts */
    BST_MTT_SHADOW, /* too dim */
    BST_MTT_DARK,   /* for sure without any light */
    BST_MTT_EARTH,  /* behind the Earth */
} bst_mtt_sight;

/* Light of an object that moves along an orbit, by what is foreseen of it. */
typedef struct bst_mtt_light {
    double sunlight; /* share of the Sun's disc that it sees */
    double glow; /* 1/m^2: of a diffuse sphere, as far and lit from as far aside; 0: not known */
    double snr;  /* that it should have; 0: not known */
    bool bright; /* so far above the threshold that nearly every frame shows it */
} bst_mtt_light;

/* One detection that is not a star, on the sky. */
typedef struct bst_mtt_detection {
    bst_sky_measurement sky; /* geometric */
    double x_px, y_px;
    double v_mag, v_mag_sigma; /* sigma INFINITY: no brightness */
    double snr;
    double length_rad; /* of its image, FWHM */
    double width_px;   /* the same, across; 0: not known */
} bst_mtt_detection;

/* A defective pixel that a track's detections may be of. */
typedef struct bst_mtt_defect {
    double x_px, y_px, variance_px2; /* variance per axis */
} bst_mtt_defect;

/* A track as detections of defective pixels (fixed_pixel.c). */
typedef struct bst_mtt_fixed {
    bst_mtt_defect now, before;
    double log_odds; /* log-likelihood ratio of the track's motion against it */
} bst_mtt_fixed;

typedef struct bst_mtt_track {
    int64_t id;
    bst_track_status status;
    bst_sky_state state;
    bst_filter_models models;
    bst_orbit_track orbit; /* valid: what state comes from */
    double v_mag, v_mag_variance;
    double snr, x_px, y_px; /* latest detection */
    int hits, misses_in_row, merged_in_row;
    int apart;  /* frames, since it was confirmed, in which another track's detection lay beside its
                 */
    int frames; /* observable frames since the first detection */
    double score;     /* log-likelihood ratio against clutter */
    double chi2;      /* sum over the hits after initiation, 2 degrees of freedom each */
    double last_chi2; /* of the latest detection; negative when the latest frame brought none */
    int64_t first_tick, last_update_tick;
    double last_update_s;
    bst_vec3 first_direction; /* of its first detection */
    double first_length_rad;
    bst_mtt_fixed fixed;
    bool moved;   /* the latest detection lies farther from the first than their images are long */
    bool at_rest; /* shows no motion and is not what the cue expects */
    bst_mtt_sight sight; /* in the latest frame; BST_MTT_CLEAR without an orbit */
    bst_mtt_light light; /* in the latest frame; with an orbit only */
    /* It has been hidden and was not seen again yet: it only follows its orbit, and wakes when what
     * is confirmed anew is known again as it. Ends as what is remembered does, or by misses. */
    bool asleep;
    bool lit;      /* it has had an orbit by which there was something to see */
    bool replaced; /* by the track that it woke as, in this frame */
    bool may_miss; /* in the latest frame */
    /* smoothed over detections in full light that the threshold has not picked; SNR, glow 0: none
     * yet */
    double full_snr, full_v_mag, full_glow;
    bool was_bright; /* in a frame so far */
    bool star; /* and is known to be slower than any object: its rate is zero, its status is not
                  tentative, its life is only ended by max_coast_s */
    /* normalised innovations of the latest hits: two of place, one of brightness; rings */
    double innovations[BST_MTT_EVENT_WINDOW][2], brightness[BST_MTT_EVENT_WINDOW];
    int innovation_count, brightness_count; /* since the start or the latest event */
    double
        manoeuvre_end_s; /* the filter follows a manoeuvre that the innovations show until then */
} bst_mtt_track;

/* What one frame brings. */
typedef struct bst_mtt_frame {
    int64_t tick;   /* mid-exposure */
    double seconds; /* the same, since the epoch */
    const bst_mtt_detection *detections;
    int count;
    /* Only windows round the confirmed tracks were looked at: tentative tracks are not missed, and
     * nothing is learnt of clutter. */
    bool partial;
    /* Is a geometric direction on the sensor, well away from its edge? NULL: everything is. */
    bool (*in_field)(const void *user, bst_vec3 direction);
    const void *user;
    /* The cue's direction and rate at the previous frame and at this one; feeds acceleration
     * forward and opens a rate gate for initiation. */
    bool cue_valid, cue_before_valid;
    bst_vec3 cue_direction, cue_rate_radps;
    bst_vec3 cue_before_direction, cue_before_rate_radps;
    double cue_rate_sigma_radps;
    /* The rate that the cue expects of what is seen in a direction; false: none. NULL: the cue's
     * own rate everywhere. */
    bool (*expected_rate)(const void *user, bst_vec3 direction, bst_vec3 *rate_radps);
    /* Is a track what the cue expects, so that its slowness says nothing? NULL: none is. */
    bool (*expected)(const void *user, const bst_mtt_track *track);
    /* Where the observer is, for tracks on orbits; NULL: their orbits wait. */
    const bst_od_observer *observer;
    /* What is believed of a confirmed track's range; false: nothing. NULL: nothing of any. */
    bool (*range)(const void *user, const bst_mtt_track *track, bst_orbit_range *out);
    /* What there is to see of a confirmed track with an orbit at the frame's time; *sunlight is the
     * share of the Sun's light that it gets. NULL: everything is in full light. */
    bst_mtt_sight (*sight)(const void *user, const bst_mtt_track *track, bst_mtt_light *light);
    int bad_pixels; /* of the sensor, known so far: as many may be unknown */
    int charged; /* detections that are not given because they were taken for charge, not light */
    /* 1 sigma per axis of an apparent rate that all of this frame's directions may share */
    double common_rate_sigma_radps;
} bst_mtt_frame;

typedef enum bst_mtt_event_kind {
    BST_MTT_CONFIRMED,
    BST_MTT_RESUMED, /* confirmed, and known again as a remembered track, whose identity it has */
    BST_MTT_LOST,
    BST_MTT_MANOEUVRE,
    BST_MTT_BRIGHTNESS,
} bst_mtt_event_kind;

typedef struct bst_mtt_event {
    bst_mtt_event_kind kind;
    double statistic;    /* of manoeuvre (chi-square, 2 degrees of freedom) and brightness (1) */
    bst_mtt_track track; /* as it was */
} bst_mtt_event;

typedef struct bst_mtt bst_mtt;

/* The caller frees. All memory is taken here. */
bst_status bst_mtt_create(bst_ctx *ctx, const bst_mtt_params *params, bst_mtt **out) BST_MUST_CHECK;
/* Frees a multi-target tracker; NULL is allowed. */
void bst_mtt_free(bst_mtt *mtt);

/* Takes one frame; frames must come in order of time (later than the one before). At most
 * max_detections detections are looked at; the rest are counted by bst_mtt_lost. */
void bst_mtt_step(bst_mtt *mtt, const bst_mtt_frame *frame);

/* Moves the tracks to a frame that says nothing about them (no attitude): no misses are counted. */
void bst_mtt_skip(bst_mtt *mtt, const bst_mtt_frame *frame);

/* Tracks after the latest frame, by ascending id, those at rest among them; lent until the next
 * step. */
const bst_mtt_track *bst_mtt_tracks(const bst_mtt *mtt, int *count);
/* Track with an identity; NULL if there is none. It belongs to the tracker. */
const bst_mtt_track *bst_mtt_find(const bst_mtt *mtt, int64_t id);
/* What happened in the latest frame; lent until the next step. */
const bst_mtt_event *bst_mtt_events(const bst_mtt *mtt, int *count);
/* Remembered tracks, carried to the latest frame; lent until the next step. */
const bst_mtt_track *bst_mtt_memory(const bst_mtt *mtt, int *count);
/* False alarms per steradian as they are believed for confirmed tracks in the latest frame. */
double bst_mtt_clutter_density(const bst_mtt *mtt);
/* Tracks and detections of the latest frame that found no room. */
int bst_mtt_lost(const bst_mtt *mtt);

#endif
