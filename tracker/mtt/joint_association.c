#include "tracker/mtt/joint_association.h"

#include <assert.h>
#include <math.h>
#include <string.h>

#include "tracker/mtt/multitarget_internal.h"
#include "tracker/mtt/resolution.h"

/* Belief propagation ends when no message changes by more, or after so many rounds. */
static const double MESSAGE_TOLERANCE = 1e-4;
enum { MOST_ROUNDS = 30 };
/* Tracks whose states agree to this chi-square (4 degrees of freedom, 50 %) are hypotheses on one
 * object. */
static const double SAME_CHI2 = 3.36;
/* Largest existence probability: 12 misses at a detection probability of 0.9 then make it 0.5. */
static const double MOST_EXISTENCE = 1.0 - 1e-12;
/* Frames in a row of two tracks on one detection after which they may be of one object. */
enum { SAME_FRAMES = 5 };
/* Share of the light above which one object dominates the image and hides the other. */
static const double OUTSHINES = 2.0 / 3.0;

/* Hypotheses less probable than this do not enter the filter, whose mixture would drop them. */
static const double LEAST_PROBABILITY = 1e-4;

/* Existence probabilities at which a track is confirmed and below which it is deleted. At the
 * first, at most one confirmed track in a hundred is false when it is confirmed. A track is
 * reported while it rather exists than not: the least mean GOSPA. The last two free the slots of
 * hopeless tentative tracks; at the last if more than half of all slots are in use, measured with
 * the scene `clutter` (docs/results/close_objects.md). */
static const double CONFIRMED_EXISTENCE = 0.99, REPORTED_EXISTENCE = 0.5, LEAST_EXISTENCE = 1e-6,
                    LEAST_IN_CROWD = 1e-5;

void bst_mtt_joint_lay_out(bst_mtt_joint *j, int tracks, int detections, bst_arena *arena) {
    j->hypothesis_room = 8 * tracks + 4096;
    j->state_room = j->hypothesis_room + tracks + 4 * BST_JOINT_MOST_STATES;
    j->choice_room = 2 * j->state_room + BST_JOINT_MEMBERS * BST_JOINT_MOST_STATES;
    size_t nt = (size_t)tracks, nd = (size_t)detections + 1;
    BST_ARENA_TAKE(arena, j->hypothesis, (size_t)j->hypothesis_room);
    BST_ARENA_TAKE(arena, j->edge, (size_t)j->hypothesis_room);
    BST_ARENA_TAKE(arena, j->state, (size_t)j->state_room);
    BST_ARENA_TAKE(arena, j->choice, (size_t)j->choice_room);
    BST_ARENA_TAKE(arena, j->group, nt);
    BST_ARENA_TAKE(arena, j->member, nt);
    BST_ARENA_TAKE(arena, j->head, nt);
    BST_ARENA_TAKE(arena, j->root, nt);
    BST_ARENA_TAKE(arena, j->size, nt);
    BST_ARENA_TAKE(arena, j->missed, nt);
    BST_ARENA_TAKE(arena, j->decided, nt);
    BST_ARENA_TAKE(arena, j->claimed, nd);
    BST_ARENA_TAKE(arena, j->claimed_firm, nd);
}

/* ln of the probability that tentative track t is resolved from every confirmed one. */
static double log_resolved(const bst_mtt *m, int t) {
    double sum = 0.0, near2 = pow(2.0 * m->params.merge_rad, 2);
    for (int u = 0; u < m->track_count; u++) {
        const bst_mtt_track *a = &m->tracks[t], *b = &m->tracks[u];
        bst_vec3 off = bst_vec3_sub(a->state.direction, b->state.direction);
        if (b->status == BST_TRACK_TENTATIVE || b->star || bst_vec3_dot(off, off) > near2) {
            continue;
        }
        double both = b->existence * bst_mtt_unresolved(m->params.merge_rad, a, b);
        sum += log1p(-fmin(both, 0.999));
    }
    return sum;
}

/* True if a detection has another one within merge_rad. */
static bool is_resolved(const bst_mtt *m, int column) {
    bst_vec3 at = m->now.items[column].sky.direction;
    int begin, end;
    bst_mtt_pool_range(&m->now, at, m->params.merge_rad, &begin, &end);
    for (int i = begin; i < end; i++) {
        bst_vec3 off = bst_vec3_sub(m->now.items[m->now.order[i]].sky.direction, at);
        if (m->now.order[i] != column && bst_vec3_norm(off) < m->params.merge_rad) {
            return true;
        }
    }
    return false;
}

/* False if two tracks are resolved for certain: 24 of chi-square apart without position errors, and
 * 9 with large ones. */
static bool may_be_unresolved(const bst_mtt *m, const bst_mtt_track *a, const bst_mtt_track *b) {
    double variance = a->state.covariance[0][0] + a->state.covariance[1][1] +
                      b->state.covariance[0][0] + b->state.covariance[1][1];
    double reach = 2.0 * m->params.merge_rad + 3.0 * sqrt(variance);
    bst_vec3 off = bst_vec3_sub(a->state.direction, b->state.direction);
    return bst_vec3_dot(off, off) <= reach * reach;
}

/* Allows for a detection of tentative track t that is of another tentative track, too: the one with
 * which it is likeliest merged. Such tracks share no detections, but neither may take the centre of
 * light for its own direction. */
static void doubt(const bst_mtt *m, int t, bst_joint_hypothesis *h, double single_log_likelihood) {
    const bst_mtt_track *track = &m->tracks[t];
    for (int u = 0; u < m->track_count; u++) {
        const bst_mtt_track *other = &m->tracks[u];
        if (u == t || other->status != BST_TRACK_TENTATIVE || other->at_rest || other->star ||
            !m->observable[u] || !may_be_unresolved(m, track, other) ||
            bst_sky_distance2(&track->state, &other->state) < SAME_CHI2) {
            continue;
        }
        bst_mtt_doubtful both =
            bst_mtt_doubt_of_track(&m->params, track, other, &m->now.items[h->column],
                                   bst_mtt_detection_probability(m, other), single_log_likelihood);
        if (both.merged > h->merged) {
            h->merged = both.merged;
            h->sky = both.sky;
        }
    }
}

/* Lists the detections in each track's gate as hypotheses. */
static void gate_tracks(bst_mtt *m) {
    bst_mtt_joint *j = &m->joint;
    j->hypotheses = j->groups = j->edges = j->states = j->choices = j->members = 0;
    for (int t = 0; t < m->track_count; t++) {
        bst_mtt_track *track = &m->tracks[t];
        j->head[t] = -1;
        if (!m->observable[t]) {
            continue;
        }
        int columns[BST_MTT_CANDIDATES];
        double costs[BST_MTT_CANDIDATES];
        int count = bst_mtt_gate(m, t, columns, costs);
        bool firm = track->status != BST_TRACK_TENTATIVE;
        double pd = bst_mtt_detectable(m, track);
        double prior = log(track->existence * (1.0 - track->dark)) - log1p(-track->existence * pd);
        prior += count > 0 && !firm && m->params.merge_rad > 0.0 ? log_resolved(m, t) : 0.0;
        for (int i = 0; i < count; i++) {
            bst_joint_hypothesis h = {.column = columns[i],
                                      .partner = -1,
                                      .sky = m->now.items[columns[i]].sky,
                                      .log_odds = prior - costs[i]};
            if (!firm && !track->at_rest && m->params.merge_rad > 0.0 &&
                !is_resolved(m, columns[i])) {
                doubt(m, t, &h,
                      log(m->clutter_density / bst_mtt_detection_probability(m, track)) - costs[i]);
            }
            (void)bst_mtt_joint_add(j, t, &h);
        }
    }
}

/* Weight of a joint hypothesis with the messages of its detections, but for one of them. */
static double state_weight(const bst_mtt_joint *j, const bst_joint_group *g,
                           const bst_joint_state *state, int but) {
    double weight = state->weight;
    for (int e = 0; e < g->edges; e++) {
        if (e != but && (state->edges >> e & 1)) {
            weight *= j->edge[g->first_edge + e].from_detection;
        }
    }
    return weight;
}

/* Messages from a group to its detections: odds that it uses each. */
static void send(bst_mtt_joint *j, const bst_joint_group *g) {
    for (int e = 0; e < g->edges; e++) {
        double with = 0.0, without = 1e-300;
        for (int k = 0; k < g->states; k++) {
            const bst_joint_state *state = &j->state[g->first_state + k];
            *(state->edges >> e & 1 ? &with : &without) += state_weight(j, g, state, e);
        }
        j->edge[g->first_edge + e].to_detection = fmin(with / without, 1e200);
    }
}

/* Belief propagation between groups and detections. */
static void propagate(bst_mtt *m) {
    bst_mtt_joint *j = &m->joint;
    double *sum = j->claimed;
    for (int round = 0; round < MOST_ROUNDS; round++) {
        double change = 0.0;
        memset(sum, 0, (size_t)m->now.count * sizeof *sum);
        for (int g = 0; g < j->groups; g++) {
            send(j, &j->group[g]);
        }
        for (int e = 0; e < j->edges; e++) {
            sum[j->edge[e].column] += j->edge[e].to_detection;
        }
        for (int e = 0; e < j->edges; e++) {
            bst_joint_edge *edge = &j->edge[e];
            double others = fmax(sum[edge->column] - edge->to_detection, 0.0);
            /* of large odds the difference above is rounding */
            others = others < 1e-12 * edge->to_detection ? 0.0 : others;
            double value = 1.0 / (1.0 + others);
            change = fmax(change, fabs(value - edge->from_detection));
            edge->from_detection = value;
        }
        if (change < MESSAGE_TOLERANCE) {
            break;
        }
    }
}

/* Probabilities of a group's hypotheses, and existence of its tracks. */
static void marginalise(bst_mtt *m, const bst_joint_group *g) {
    bst_mtt_joint *j = &m->joint;
    double total = 0.0, missed[BST_JOINT_MEMBERS] = {0}, lost[BST_JOINT_MEMBERS] = {0};
    for (int k = 0; k < g->states; k++) {
        total += state_weight(j, g, &j->state[g->first_state + k], -1);
    }
    for (int k = 0; k < g->states; k++) {
        const bst_joint_state *state = &j->state[g->first_state + k];
        double p = state_weight(j, g, state, -1) / total;
        for (int i = 0; i < g->members; i++) {
            int choice = j->choice[state->choices + i];
            if (choice >= 0) {
                j->hypothesis[choice].probability += p;
            } else {
                *(choice == BST_JOINT_LOST ? &lost[i] : &missed[i]) += p;
            }
        }
    }
    for (int i = 0; i < g->members; i++) {
        int t = j->member[g->first_member + i];
        bst_mtt_track *track = &m->tracks[t];
        double pd = bst_mtt_detectable(m, track);
        double r = track->existence, found = 0.0;
        j->missed[t] = lost[i] + missed[i] * r * (1.0 - pd) / (1.0 - r * pd);
        for (int h = j->head[t]; h >= 0; h = j->hypothesis[h].next) {
            found += j->hypothesis[h].probability;
        }
        track->existence = fmin(found + j->missed[t], MOST_EXISTENCE);
        j->root[t] = -1;
    }
}

/* Sets a track's detection: the likeliest if the track, given that it exists, was rather detected
 * than not. */
static void decide(bst_mtt *m, int t) {
    bst_mtt_joint *j = &m->joint;
    const bst_mtt_track *track = &m->tracks[t];
    double detected = 0.0, most = 0.0;
    int best = -1;
    for (int h = j->head[t]; h >= 0; h = j->hypothesis[h].next) {
        const bst_joint_hypothesis *hypothesis = &j->hypothesis[h];
        detected += hypothesis->probability;
        if (hypothesis->probability > most) {
            most = hypothesis->probability;
            best = h;
        }
        /* a shared detection is counted by one of its tracks */
        if (hypothesis->partner < t) {
            j->claimed[hypothesis->column] += hypothesis->probability;
            if (track->status != BST_TRACK_TENTATIVE) {
                j->claimed_firm[hypothesis->column] += hypothesis->probability;
            }
        }
    }
    if (best < 0 || detected < j->missed[t]) {
        return;
    }
    const bst_joint_hypothesis *chosen = &j->hypothesis[best];
    j->decided[t] = best;
    m->detection_of_track[t] = chosen->column;
    if (chosen->partner >= 0) {
        const bst_mtt_track *other = &m->tracks[chosen->partner];
        double share = bst_mtt_light_share(track, other);
        m->shared[t] = other->star               ? BST_MTT_WIDENED
                       : share > OUTSHINES       ? BST_MTT_OUTSHINING
                       : share < 1.0 - OUTSHINES ? BST_MTT_HIDDEN
                                                 : BST_MTT_WIDENED;
        bst_tangent axes = bst_tangent_at(track->state.direction);
        bst_vec3 to = bst_tangent_log(track->state.direction, other->state.direction);
        double s1 = (1.0 - share) * bst_vec3_dot(to, axes.e1);
        double s2 = (1.0 - share) * bst_vec3_dot(to, axes.e2);
        double floor2 = m->params.merge_floor_rad * m->params.merge_floor_rad;
        m->extra[t][0] = s1 * s1 + floor2;
        m->extra[t][1] = s1 * s2;
        m->extra[t][2] = s2 * s2 + floor2;
    }
}

/* Ends the track with fewer hits of two that have shared detections for too long, or agree after a
 * while. */
static void end_long_merge(bst_mtt *m, int t) {
    const bst_mtt_joint *j = &m->joint;
    if (j->decided[t] < 0 || j->hypothesis[j->decided[t]].partner < 0) {
        return;
    }
    bst_mtt_track *a = &m->tracks[t], *b = &m->tracks[j->hypothesis[j->decided[t]].partner];
    int frames = a->merged_in_row < b->merged_in_row ? a->merged_in_row : b->merged_in_row;
    bst_vec3 off = bst_vec3_sub(a->state.direction, b->state.direction);
    bool alike = frames >= SAME_FRAMES && bst_vec3_norm(off) < m->params.merge_floor_rad &&
                 bst_sky_distance2(&a->state, &b->state) < 9.0;
    /* an object hidden by a brighter one is followed until max_coast_s */
    bool equal = m->shared[t] == BST_MTT_WIDENED;
    if (b->star || m->params.max_merged_frames == 0 ||
        (!alike && (!equal || frames < m->params.max_merged_frames))) {
        return;
    }
    bst_mtt_track *ended = a->hits > b->hits ? b : a, *kept = ended == a ? b : a;
    ended->existence = 0.0;
    kept->merged_in_row = 0;
}

void bst_mtt_associate_jointly(bst_mtt *m) {
    bst_mtt_joint *j = &m->joint;
    m->clutter_density = m->alarm_density;
    for (int t = 0; t < m->track_count; t++) {
        m->tracks[t].existence = m->tracks[t].star ? MOST_EXISTENCE : m->tracks[t].existence;
        j->decided[t] = -1;
        j->missed[t] = m->tracks[t].existence;
    }
    gate_tracks(m);
    /* a track without any detection in its gate is missed */
    for (int t = 0; t < m->track_count; t++) {
        bst_mtt_track *track = &m->tracks[t];
        if (j->head[t] < 0 && track->may_miss && m->observable[t] && !track->star) {
            double r = track->existence, pd = bst_mtt_detectable(m, track);
            j->missed[t] = r * (1.0 - pd) / (1.0 - r * pd);
        }
    }
    bst_mtt_joint_enumerate(m);
    propagate(m);
    for (int g = 0; g < j->groups; g++) {
        marginalise(m, &j->group[g]);
    }
    memset(j->claimed, 0, (size_t)m->now.count * sizeof *j->claimed);
    memset(j->claimed_firm, 0, (size_t)m->now.count * sizeof *j->claimed_firm);
    for (int t = 0; t < m->track_count; t++) {
        if (j->root[t] >= 0) { /* of no group */
            m->tracks[t].existence = j->missed[t];
        }
        decide(m, t);
    }
    for (int i = 0; i < m->now.count; i++) {
        m->now.used[i] = j->claimed[i] > 0.5;
    }
    for (int t = 0; t < m->track_count; t++) {
        end_long_merge(m, t);
    }
}

const bst_joint_hypothesis *bst_mtt_joint_decision(const bst_mtt *m, int t) {
    const bst_mtt_joint *j = &m->joint;
    bool chosen = m->params.association == BST_MTT_PMB && j->decided[t] >= 0 &&
                  j->hypothesis[j->decided[t]].column == m->detection_of_track[t];
    return chosen ? &j->hypothesis[j->decided[t]] : NULL;
}

bool bst_mtt_joint_update(bst_mtt *m, int t, int components) {
    const bst_mtt_joint *j = &m->joint;
    bst_mtt_track *track = &m->tracks[t];
    if (track->star || (m->detection_of_track[t] >= 0 && !bst_mtt_joint_decision(m, t))) {
        return false;
    }
    bst_filter_candidate candidates[BST_MTT_CANDIDATES];
    int count = 0;
    for (int h = j->head[t]; h >= 0 && count < BST_MTT_CANDIDATES; h = j->hypothesis[h].next) {
        const bst_joint_hypothesis *hypothesis = &j->hypothesis[h];
        bst_filter_candidate candidate = {.measurement = &hypothesis->sky};
        bst_filter_fit fit;
        if (hypothesis->probability > LEAST_PROBABILITY &&
            bst_filter_evaluate(&m->filter, &track->state, &track->models, &candidate, &fit)) {
            candidate.log_weight = log(hypothesis->probability) - fit.log_likelihood;
            candidates[count++] = candidate;
        }
    }
    if (count > 0) {
        const bst_filter_evidence evidence = {candidates, count, j->missed[t], 1.0};
        bst_filter_update(&m->filter, &track->state, &track->models, &evidence, components);
    }
    return true;
}

bool bst_mtt_joint_exists(const bst_mtt *m, const bst_mtt_track *track) {
    return m->params.association != BST_MTT_PMB || track->existence > CONFIRMED_EXISTENCE;
}

bool bst_mtt_joint_is_gone(const bst_mtt *m, const bst_mtt_track *track) {
    bool crowd = 2 * (m->track_count - m->rest_count) > m->params.max_tracks;
    double least = track->status != BST_TRACK_TENTATIVE ? REPORTED_EXISTENCE
                   : crowd                              ? LEAST_IN_CROWD
                                                        : LEAST_EXISTENCE;
    return m->params.association == BST_MTT_PMB && !track->asleep &&
           (!track->at_rest || track->hits < m->params.confirm_hits) && track->existence < least;
}

void bst_mtt_joint_drop_duplicates(bst_mtt *m, double same_chi2) {
    for (int t = 0; t < m->track_count; t++) {
        bst_mtt_track *track = &m->tracks[t];
        int column = m->detection_of_track[t];
        bool open = track->status == BST_TRACK_TENTATIVE && column >= 0 && !track->at_rest;
        for (int u = 0; u < m->track_count && open && track->existence > 0.0; u++) {
            bst_mtt_track *other = &m->tracks[u];
            if (u == t || m->detection_of_track[u] != column || m->shared[u] || other->star ||
                other->existence < track->existence ||
                (other->existence == track->existence && other->hits < track->hits) ||
                bst_sky_distance2(&track->state, &other->state) > same_chi2) {
                continue;
            }
            other->existence = fmin(other->existence + track->existence, MOST_EXISTENCE);
            track->existence = 0.0;
        }
    }
}
