#include "tracker/identity.h"

#include <assert.h>

/* Largest group of tracks and objects whose joint assignments are enumerated. */
enum { GROUP_OBJECTS = 10, GROUP_TRACKS = 16, SETS = 1 << GROUP_OBJECTS };
/* Weight, relative to that of an unknown object, that joins a track and an object in a group. */
static const double LEAST_WEIGHT = 1e-3;

/* Tracks and objects of which each may be of another of the group. */
typedef struct group {
    int tracks, objects;
    int track[BST_IDENTITY_TRACKS], object[BST_IDENTITY_OBJECTS];
} group;

/* Rows are divided by a power of two above 1 + their largest weight, which changes no digit of a
 * probability, so that products of many rows stay in range: the share of an unknown object is then
 * at least 2^-LEAST_EXPONENT, and 2^-960 over the tracks of a group. */
enum { LEAST_EXPONENT = 60 };
static const double MOST_WEIGHT = 1e300;

/* Likelihood ratio of a track being of an object against being of an unknown one, times the odds
 * that the object has a track. */
static double weight_of(const bst_identity_params *params, const bst_mtt_track *track,
                        const bst_identity_object *object) {
    const bst_target_cue as_cue = {.valid = true,
                                   .direction = object->direction,
                                   .rate_radps = object->rate_radps,
                                   .sigma_rad = object->sigma_rad,
                                   .rate_sigma_radps = object->rate_sigma_radps,
                                   .v_mag = object->v_mag,
                                   .v_mag_sigma = object->v_mag_sigma};
    bst_target_fit fit = bst_target_misfit(&params->fit, &as_cue, track);
    if (!fit.fits) {
        return 0.0;
    }
    double odds = params->detection_probability / (1.0 - params->detection_probability);
    return fmin(odds * exp(-0.5 * (fit.chi2 + fit.log_det)) * bst_identity_scale(&as_cue, track) /
                    params->unknown_density,
                MOST_WEIGHT);
}

/* Scales a track's weights; `unknown` becomes that of an unknown object on the same scale. */
static void scale_row(bst_identity *m, int t) {
    double most = 0.0;
    int exponent;
    for (int o = 0; o < m->objects; o++) {
        most = fmax(most, m->probability[t][o]);
    }
    (void)frexp(1.0 + most, &exponent);
    for (int o = 0; o < m->objects; o++) {
        m->probability[t][o] = ldexp(m->probability[t][o], -exponent);
    }
    m->unknown[t] = ldexp(1.0, -(exponent < LEAST_EXPONENT ? exponent : LEAST_EXPONENT));
}

/* True if a track may be of an object. */
static bool may_be(const bst_identity *m, int t, int o) {
    return m->probability[t][o] > LEAST_WEIGHT * m->unknown[t];
}

bool bst_identity_compares(const bst_identity_params *params, const bst_mtt_track *track) {
    double limit = params->fit.max_rate_sigma_radps;
    return track->status != BST_TRACK_TENTATIVE && !track->at_rest && !track->star &&
           track->state.covariance[2][2] <= limit * limit &&
           track->state.covariance[3][3] <= limit * limit;
}

/* Collects the group of a track, and marks its members. */
static void collect(const bst_identity *m, int first, bool *track_seen, bool *object_seen,
                    group *g) {
    *g = (group){.tracks = 1, .track = {first}};
    track_seen[first] = true;
    for (int i = 0; i < g->tracks; i++) {
        for (int o = 0; o < m->objects; o++) {
            if (object_seen[o] || !may_be(m, g->track[i], o)) {
                continue;
            }
            object_seen[o] = true;
            g->object[g->objects++] = o;
            for (int t = 0; t < m->tracks; t++) {
                if (!track_seen[t] && may_be(m, t, o)) {
                    track_seen[t] = true;
                    g->track[g->tracks++] = t;
                }
            }
        }
    }
}

/* Replaces the weights of a group by the marginals of all joint assignments, relative to that of an
 * unknown object: sums over the sets of objects that the tracks before and after a track have. */
static void enumerate(bst_identity *m, const group *g) {
    double after[GROUP_TRACKS + 1][SETS], before[2][SETS];
    int sets = 1 << g->objects;
    for (int s = 0; s < sets; s++) {
        after[g->tracks][s] = 1.0;
        before[0][s] = s == 0;
    }
    for (int t = g->tracks - 1; t >= 0; t--) {
        const double *w = m->probability[g->track[t]];
        for (int s = 0; s < sets; s++) {
            after[t][s] = m->unknown[g->track[t]] * after[t + 1][s];
            for (int o = 0; o < g->objects; o++) {
                after[t][s] += s >> o & 1 ? 0.0 : w[g->object[o]] * after[t + 1][s | 1 << o];
            }
        }
    }
    for (int t = 0; t < g->tracks; t++) {
        double *w = m->probability[g->track[t]], *unknown = &m->unknown[g->track[t]];
        double sum[GROUP_OBJECTS] = {0}, none = 0.0;
        const double *now = before[t % 2];
        double *next = before[(t + 1) % 2];
        for (int s = 0; s < sets; s++) {
            next[s] = now[s] * *unknown;
            none += next[s] * after[t + 1][s];
        }
        for (int s = 0; s < sets; s++) {
            for (int o = 0; now[s] > 0.0 && o < g->objects; o++) {
                if (!(s >> o & 1)) {
                    double product = now[s] * w[g->object[o]];
                    next[s | 1 << o] += product;
                    sum[o] += product * after[t + 1][s | 1 << o];
                }
            }
        }
        for (int o = 0; o < g->objects; o++) {
            w[g->object[o]] = sum[o] / none;
        }
        *unknown = 1.0;
    }
}

void bst_identity_match(const bst_identity_params *params, const bst_mtt_track *tracks,
                        int track_count, const bst_identity_object *objects, int object_count,
                        bst_identity *out) {
    bool track_seen[BST_IDENTITY_TRACKS] = {0}, object_seen[BST_IDENTITY_OBJECTS] = {0};
    assert(params && (tracks || track_count == 0) && out);
    assert(object_count >= 0 && object_count <= BST_IDENTITY_OBJECTS);
    assert(params->unknown_density > 0.0);
    out->tracks = out->left_out = 0;
    out->objects = object_count;
    for (int o = 0; o < object_count; o++) {
        out->object[o] = objects[o].object;
    }
    for (int i = 0; i < track_count; i++) {
        if (!bst_identity_compares(params, &tracks[i])) {
            continue;
        }
        if (out->tracks == BST_IDENTITY_TRACKS) {
            out->left_out++;
            continue;
        }
        int t = out->tracks++;
        out->track_id[t] = tracks[i].id;
        for (int o = 0; o < object_count; o++) {
            out->probability[t][o] = weight_of(params, &tracks[i], &objects[o]);
        }
        scale_row(out, t);
    }
    for (int t = 0; t < out->tracks; t++) {
        group g;
        if (!track_seen[t]) {
            collect(out, t, track_seen, object_seen, &g);
            if (g.objects > 0 && g.objects <= GROUP_OBJECTS && g.tracks <= GROUP_TRACKS) {
                enumerate(out, &g);
            }
        }
    }
    for (int t = 0; t < out->tracks; t++) {
        double sum = out->unknown[t];
        for (int o = 0; o < object_count; o++) {
            sum += out->probability[t][o];
        }
        for (int o = 0; o < object_count; o++) {
            out->probability[t][o] /= sum;
        }
        out->unknown[t] /= sum;
    }
}
