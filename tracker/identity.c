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
    if (!(fit.chi2 < INFINITY)) {
        return 0.0;
    }
    double odds = params->detection_probability / (1.0 - params->detection_probability);
    return odds * exp(-0.5 * (fit.chi2 + fit.log_det)) * bst_identity_scale(&as_cue, track) /
           params->unknown_density;
}

/* True if a track takes part in a comparison. */
static bool is_compared(const bst_identity_params *params, const bst_mtt_track *track) {
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
            if (object_seen[o] || !(m->probability[g->track[i]][o] > LEAST_WEIGHT)) {
                continue;
            }
            object_seen[o] = true;
            g->object[g->objects++] = o;
            for (int t = 0; t < m->tracks; t++) {
                if (!track_seen[t] && m->probability[t][o] > LEAST_WEIGHT) {
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
            after[t][s] = after[t + 1][s];
            for (int o = 0; o < g->objects; o++) {
                after[t][s] += s >> o & 1 ? 0.0 : w[g->object[o]] * after[t + 1][s | 1 << o];
            }
        }
    }
    for (int t = 0; t < g->tracks; t++) {
        double *w = m->probability[g->track[t]], sum[GROUP_OBJECTS] = {0}, none = 0.0;
        const double *now = before[t % 2];
        double *next = before[(t + 1) % 2];
        for (int s = 0; s < sets; s++) {
            next[s] = now[s];
            none += now[s] * after[t + 1][s];
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
    }
}

void bst_identity_match(const bst_identity_params *params, const bst_mtt_track *tracks,
                        int track_count, const bst_identity_object *objects, int object_count,
                        bst_identity *out) {
    bool track_seen[BST_IDENTITY_TRACKS] = {0}, object_seen[BST_IDENTITY_OBJECTS] = {0};
    assert(params && (tracks || track_count == 0) && out);
    assert(object_count >= 0 && object_count <= BST_IDENTITY_OBJECTS);
    assert(params->unknown_density > 0.0);
    out->tracks = 0;
    out->objects = object_count;
    for (int o = 0; o < object_count; o++) {
        out->object[o] = objects[o].object;
    }
    for (int i = 0; i < track_count && out->tracks < BST_IDENTITY_TRACKS; i++) {
        if (!is_compared(params, &tracks[i])) {
            continue;
        }
        int t = out->tracks++;
        out->track_id[t] = tracks[i].id;
        for (int o = 0; o < object_count; o++) {
            out->probability[t][o] = weight_of(params, &tracks[i], &objects[o]);
        }
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
        double sum = 1.0;
        for (int o = 0; o < object_count; o++) {
            sum += out->probability[t][o];
        }
        for (int o = 0; o < object_count; o++) {
            out->probability[t][o] /= sum;
        }
        out->unknown[t] = 1.0 / sum;
    }
}
