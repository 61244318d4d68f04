/* Visibility of tracked objects: Earth's shadow, occultation and brightness. */
#include "tracker/mtt/visibility.h"

#include <assert.h>

#include "tracker/mtt/multitarget_internal.h"

/* Margin of the Earth's radius for possible shadow and occultation: atmosphere and orbit errors. */
#define LIMB_SHARE 0.02
/* Earth's polar radius in equatorial radii: a line of sight below it is certainly occulted. */
#define POLE (1.0 - BST_EARTH_FLATTENING)
/* DARK_SHARE: share of the detection threshold below which an object is practically undetectable
 * and its centroid biased by noise. BRIGHT_ABOVE: margin above the threshold, sigma, beyond which
 * nearly every frame detects it. */
#define DARK_SHARE 0.6
#define BRIGHT_ABOVE 3.0
/* Factor on the covariance of a track that becomes dormant: blends with stars and the last faint
 * detections leave errors that the filter underestimates. */
#define DOUBT 4.0
#define LIGHT_GAIN 0.1
/* Share of max_coast_s without a detection after which a faint track becomes dormant. */
#define FADED_SHARE 0.5
#define FULL_LIGHT 0.99
/* Mean times for which an object that the cue expects is bright and dark (flashes, turning away,
 * fading), s: design choices. With 1 frame/s and a detection probability of 0.9 a track is rather
 * dark than lost from the third miss on, and a track of one false alarm in 600 is given up. */
static const double BRIGHT_S = 600.0, DARK_S = 60.0;

/* Smallest distance of the segment between two geocentric points from the Earth's centre, m. */
static double least_distance(bst_vec3 a, bst_vec3 b) {
    bst_vec3 along = bst_vec3_sub(b, a);
    double length2 = bst_vec3_dot(along, along);
    double s = length2 > 0.0 ? -bst_vec3_dot(a, along) / length2 : 0.0;
    return bst_vec3_norm(bst_vec3_axpy(a, fmin(fmax(s, 0.0), 1.0), along));
}

bst_mtt_sight bst_visibility_of(bst_vec3 object_m, bst_vec3 observer_m, bst_vec3 sun_m,
                                const bst_visibility_seen *seen, double threshold_snr,
                                bst_mtt_light *light) {
    bst_vec3 to_eye = bst_vec3_sub(observer_m, object_m);
    double phase = bst_vec3_angle(to_eye, bst_vec3_sub(sun_m, object_m));
    light->sunlight = bst_astro_sun_fraction(object_m, sun_m, BST_EARTH_POLE_J2000);
    light->glow = bst_astro_sphere_phase(0.0, phase) / bst_vec3_dot(to_eye, to_eye);
    double kept = seen->glow > 0.0 ? light->glow / seen->glow : 1.0;
    light->snr = seen->snr * light->sunlight * kept;
    light->bright = light->snr > threshold_snr + BRIGHT_ABOVE;
    double distance = least_distance(object_m, observer_m) / BST_EARTH_RADIUS_M;
    if (distance < POLE) {
        return BST_MTT_EARTH;
    }
    bst_vec3 farther = bst_vec3_scale(object_m, 1.0 + LIMB_SHARE);
    if (bst_astro_sun_fraction(farther, sun_m, BST_EARTH_POLE_J2000) == 0.0) {
        return BST_MTT_DARK;
    }
    if (seen->snr > 0.0 ? light->snr < DARK_SHARE * threshold_snr : light->sunlight == 0.0) {
        return BST_MTT_SHADOW;
    }
    bst_vec3 nearer = bst_vec3_scale(object_m, 1.0 / (1.0 + LIMB_SHARE));
    bool in_full_light =
        bst_astro_sun_fraction(nearer, sun_m, BST_EARTH_POLE_J2000) == 1.0 && !seen->was_bright;
    bool dim = !in_full_light && !light->bright;
    return dim || distance < 1.0 + LIMB_SHARE ? BST_MTT_FAINT : BST_MTT_CLEAR;
}

/* Increases the covariance of a track that becomes dormant. */
static void inflate_covariance(bst_mtt_track *track) {
    for (int i = 0; i < 6; i++) {
        for (int j = 0; j < 6; j++) {
            track->orbit.covariance[i][j] *= DOUBT;
        }
        for (int j = 0; j < 4; j++) {
            track->orbit.cross[i][j] *= DOUBT;
        }
    }
    for (int i = 0; i < 4; i++) {
        for (int j = 0; j < 4; j++) {
            track->orbit.sky.covariance[i][j] *= DOUBT;
        }
    }
    track->state = track->orbit.sky;
}

/* True if a faint track had no detection for so long that it would soon be deleted. */
static bool has_faded(const bst_mtt *m, const bst_mtt_track *track, double seconds) {
    return track->sight == BST_MTT_FAINT &&
           seconds - track->last_update_s > FADED_SHARE * m->params.max_coast_s;
}

/* Predicts the probability that the object of a track is dark: a Markov chain of two states. Only
 * an object that the cue expects is waited for. */
static void predict_darkness(bst_mtt_track *track, double dt_s, const bst_mtt_frame *frame) {
    bool waits = track->status != BST_TRACK_TENTATIVE && !track->star && !track->asleep &&
                 frame->expected && frame->expected(frame->user, track);
    const double settled = DARK_S / (BRIGHT_S + DARK_S);
    const double left = exp(-dt_s * (1.0 / BRIGHT_S + 1.0 / DARK_S));
    track->dark = waits ? settled + (track->dark - settled) * left : 0.0;
}

void bst_mtt_note_darkness(const bst_mtt *m, int t) {
    bst_mtt_track *track = &m->tracks[t];
    if (m->detection_of_track[t] >= 0) {
        track->dark = 0.0;
    } else if (track->may_miss) {
        double pd = bst_mtt_detection_probability(m, track); /* before this miss */
        track->score += log(1.0 - pd);
        bst_mtt_note_missed(m, track);
        track->dark /= 1.0 - pd * (1.0 - track->dark);
    }
}

void bst_mtt_look(bst_mtt *m, int t, const bst_mtt_frame *frame) {
    assert(m && frame && t >= 0 && t < m->track_count);
    bst_mtt_track *track = &m->tracks[t];
    track->sight = BST_MTT_CLEAR;
    track->light = (bst_mtt_light){.sunlight = 1.0};
    if (m->params.orbits && frame->sight && track->orbit.valid &&
        track->status != BST_TRACK_TENTATIVE) {
        track->sight = frame->sight(frame->user, track, &track->light);
        track->was_bright = track->was_bright || track->light.bright;
        track->lit = track->lit || track->sight < BST_MTT_SHADOW;
        if (!track->lit) {
            track->sight = BST_MTT_CLEAR; /* never predicted visible: the orbit cannot be right */
        } else if (!track->asleep &&
                   (track->sight >= BST_MTT_SHADOW || has_faded(m, track, frame->seconds))) {
            track->asleep = true;
            inflate_covariance(track);
        }
    }
    predict_darkness(track, fmax(frame->seconds - m->seconds, 0.0), frame);
    m->sleepers += track->asleep;
    track->may_miss = m->observable[t] && track->sight == BST_MTT_CLEAR;
    m->observable[t] = m->observable[t] && !track->asleep;
}

void bst_mtt_note_light(bst_mtt_track *track) {
    const bst_mtt_light *light = &track->light;
    bool seen = track->full_snr > 0.0;
    /* selection bias: near the threshold only detections brightened by noise are found */
    bool picked = seen && track->sight != BST_MTT_CLEAR && track->snr < light->snr + BRIGHT_ABOVE;
    if (track->orbit.valid && (light->sunlight < FULL_LIGHT || picked)) {
        return;
    }
    track->full_snr += (seen ? LIGHT_GAIN : 1.0) * (track->snr - track->full_snr);
    track->full_glow +=
        (track->full_glow > 0.0 ? LIGHT_GAIN : 1.0) * (light->glow - track->full_glow);
    track->full_v_mag = track->v_mag;
}
