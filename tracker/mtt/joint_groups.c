/* Groups of tracks that may be unresolved, and their joint hypotheses. */
#include <assert.h>
#include <math.h>
#include <string.h>

#include "tracker/mtt/multitarget_internal.h"
#include "tracker/mtt/resolution.h"

/* Pairs less probably unresolved than this are taken as resolved. */
static const double LEAST_UNRESOLVED = 0.01;
/* ln of the smallest weight of a joint hypothesis relative to the largest, 4e-18. A miss of a track
 * next to which another claims its detection is 1e-8 before the groups exchange messages. */
static const double LEAST_LOG_WEIGHT = -40.0;
/* Most detections of each track of a group that has several. */
enum { MOST_OWN = 6 };

int bst_mtt_joint_add(bst_mtt_joint *j, int track, const bst_joint_hypothesis *hypothesis) {
    if (j->hypotheses == j->hypothesis_room) {
        return -1;
    }
    int at = j->hypotheses++, *link = &j->head[track];
    j->hypothesis[at] = *hypothesis;
    while (*link >= 0 &&
           (hypothesis->partner >= 0 || j->hypothesis[*link].log_odds >= hypothesis->log_odds)) {
        link = &j->hypothesis[*link].next;
    }
    j->hypothesis[at].next = *link;
    *link = at;
    return at;
}

/* Root of the set of track t. */
static int find_root(bst_mtt_joint *j, int t) {
    while (j->root[t] != t) {
        j->root[t] = j->root[j->root[t]];
        t = j->root[t];
    }
    return t;
}

/* True if a track may share a detection with another one. */
static bool may_share(const bst_mtt *m, int t) {
    return m->tracks[t].status != BST_TRACK_TENTATIVE && m->observable[t];
}

/* Unites tracks that may be unresolved, as long as groups stay small. */
static void unite(bst_mtt *m) {
    bst_mtt_joint *j = &m->joint;
    double near2 = pow(2.0 * m->params.merge_rad, 2);
    for (int t = 0; t < m->track_count; t++) {
        j->root[t] = t;
        j->size[t] = 1;
    }
    for (int t = 0; t < m->track_count && m->params.merge_rad > 0.0; t++) {
        if (!may_share(m, t) || m->tracks[t].star) {
            continue;
        }
        for (int u = 0; u < m->track_count; u++) {
            const bst_mtt_track *a = &m->tracks[t], *b = &m->tracks[u];
            bst_vec3 off = bst_vec3_sub(a->state.direction, b->state.direction);
            /* next to a star a track is looked for only where it has no detection of its own */
            if ((b->star ? j->head[t] >= 0 : u <= t) || !may_share(m, u) ||
                bst_vec3_dot(off, off) > near2 ||
                bst_mtt_unresolved(m->params.merge_rad, a, b) < LEAST_UNRESOLVED) {
                continue;
            }
            int ra = find_root(j, t), rb = find_root(j, u);
            if (ra != rb && j->size[ra] + j->size[rb] <= BST_JOINT_MEMBERS) {
                j->root[rb] = ra;
                j->size[ra] += j->size[rb];
            }
        }
    }
}

/* Index of a detection among those of a group; -1 if there is no room. */
static int edge_of(bst_mtt_joint *j, bst_joint_group *g, int column) {
    for (int e = 0; e < g->edges; e++) {
        if (j->edge[g->first_edge + e].column == column) {
            return e;
        }
    }
    if (g->edges == BST_JOINT_EDGES) {
        return -1;
    }
    j->edge[g->first_edge + g->edges] = (bst_joint_edge){column, 0.0, 1.0};
    j->edges++;
    return g->edges++;
}

/* ln of the probability that a track is missed or does not exist. */
static double log_missed(const bst_mtt *m, int t) {
    const bst_mtt_track *track = &m->tracks[t];
    return log1p(-track->existence * bst_mtt_detectable(m, track));
}

/* Adds the shared detections of a link. */
static void merge_link(bst_mtt *m, bst_joint_group *g, bst_joint_link *link) {
    bst_mtt_joint *j = &m->joint;
    int ta = j->member[g->first_member + link->a], tb = j->member[g->first_member + link->b];
    const bst_mtt_track *a = &m->tracks[ta], *b = &m->tracks[tb];
    double pd = m->params.detection_probability;
    double seen = (1.0 - a->dark) * (1.0 - b->dark);
    double prior = log(a->existence * b->existence * seen * link->unresolved) - log_missed(m, ta) -
                   log_missed(m, tb);
    link->log_miss = prior + log(1.0 - pd);
    link->first = j->hypotheses;
    link->count = 0;
    double w = bst_mtt_light_share(a, b);
    bst_vec3 to = bst_tangent_log(a->state.direction, b->state.direction);
    bst_vec3 centre = bst_tangent_exp(a->state.direction, bst_vec3_scale(to, 1.0 - w));
    double reach =
        sqrt(m->params.gate_chi2) *
        sqrt(a->state.covariance[0][0] + a->state.covariance[1][1] + b->state.covariance[0][0] +
             b->state.covariance[1][1] + m->largest_sigma * m->largest_sigma +
             2.0 * m->params.merge_floor_rad * m->params.merge_floor_rad);
    int begin, end;
    bst_mtt_pool_range(&m->now, centre, reach, &begin, &end);
    for (int i = begin; i < end && link->count < MOST_OWN; i++) {
        int column = m->now.order[i];
        const bst_mtt_detection *detection = &m->now.items[column];
        bst_mtt_merged fit;
        if (bst_vec3_norm(bst_vec3_sub(detection->sky.direction, centre)) > reach ||
            !bst_mtt_merge(a, b, &detection->sky, m->params.merge_floor_rad, &fit) ||
            fit.chi2 > m->params.gate_chi2) {
            continue;
        }
        int edge = edge_of(j, g, column);
        bst_joint_hypothesis h = {.column = column,
                                  .partner = tb,
                                  .edge = edge,
                                  .sky = fit.of_a,
                                  .log_odds = prior + log(pd / m->clutter_density) +
                                              fit.log_likelihood -
                                              bst_mtt_merged_brightness_cost(a, b, detection)};
        bst_joint_hypothesis other = h;
        other.partner = ta;
        other.sky = fit.of_b;
        if (edge < 0 || bst_mtt_joint_add(j, ta, &h) < 0 || bst_mtt_joint_add(j, tb, &other) < 0) {
            break;
        }
        link->count++;
    }
}

/* Search for the joint hypotheses of a group. */
typedef struct search {
    bst_mtt *m;
    bst_joint_group *group;
    bst_joint_link links[BST_JOINT_LINKS];
    int link_count;
    double bound[BST_JOINT_MEMBERS + 1]; /* most ln weight that members from i on can add */
    int choice[BST_JOINT_MEMBERS];
    double best;
} search;

/* A member's choice that is open. */
enum { OPEN = -2 };

/* Stores a joint hypothesis. */
static void store_state(search *s, double log_weight, uint64_t used) {
    bst_mtt_joint *j = &s->m->joint;
    bst_joint_group *g = s->group;
    if (g->states == BST_JOINT_MOST_STATES) {
        return;
    }
    s->best = fmax(s->best, log_weight);
    g->states++;
    j->state[j->states++] =
        (bst_joint_state){.weight = log_weight, .edges = used, .choices = j->choices};
    for (int i = 0; i < g->members; i++) {
        j->choice[j->choices++] = s->choice[i];
    }
}

/* Branches over the choices of member i and of those after it (depth-first, branch and bound). */
static void branch(search *s, int i, double log_weight, uint64_t used) {
    const bst_mtt_joint *j = &s->m->joint;
    const bst_joint_group *g = s->group;
    while (i < g->members && s->choice[i] != OPEN) {
        i++;
    }
    if (log_weight + s->bound[i] < s->best + LEAST_LOG_WEIGHT) {
        return;
    }
    if (i == g->members) {
        store_state(s, log_weight, used);
        return;
    }
    int own = 0;
    for (int h = j->head[j->member[g->first_member + i]]; h >= 0; h = j->hypothesis[h].next) {
        const bst_joint_hypothesis *hypothesis = &j->hypothesis[h];
        uint64_t bit = hypothesis->edge >= 0 ? (uint64_t)1 << hypothesis->edge : 0;
        if (hypothesis->partner >= 0 || bit == 0 || (used & bit)) {
            continue;
        }
        if (g->members > 1 && own++ == MOST_OWN) {
            break;
        }
        s->choice[i] = h;
        branch(s, i + 1, log_weight + hypothesis->log_odds, used | bit);
    }
    for (int l = 0; l < s->link_count; l++) {
        const bst_joint_link *link = &s->links[l];
        if (link->a != i || s->choice[link->b] != OPEN) {
            continue;
        }
        double base = log_weight - log1p(-fmin(link->unresolved, 0.999));
        for (int k = 0; k < link->count; k++) {
            int h = link->first + 2 * k;
            uint64_t bit = (uint64_t)1 << j->hypothesis[h].edge;
            if (!(used & bit)) {
                s->choice[i] = h;
                s->choice[link->b] = h + 1;
                branch(s, i + 1, base + j->hypothesis[h].log_odds, used | bit);
            }
        }
        s->choice[i] = s->choice[link->b] = BST_JOINT_LOST;
        branch(s, i + 1, base + link->log_miss, used);
        s->choice[link->b] = OPEN;
    }
    s->choice[i] = BST_JOINT_MISSED;
    branch(s, i + 1, log_weight, used);
    s->choice[i] = OPEN;
}

/* Finds the links of a group and the detections of its tracks; prepares the bounds. */
static void prepare(search *s) {
    bst_mtt *m = s->m;
    bst_mtt_joint *j = &m->joint;
    bst_joint_group *g = s->group;
    double most[BST_JOINT_MEMBERS] = {0};
    for (int i = 0; i < g->members; i++) {
        int t = j->member[g->first_member + i], own = 0;
        for (int h = j->head[t]; h >= 0; h = j->hypothesis[h].next) {
            bool taken = g->members == 1 || own++ < MOST_OWN;
            j->hypothesis[h].edge = taken ? edge_of(j, g, j->hypothesis[h].column) : -1;
            most[i] = fmax(most[i], taken ? j->hypothesis[h].log_odds : 0.0);
        }
        s->choice[i] = OPEN;
    }
    for (int a = 0; a < g->members; a++) {
        for (int b = a + 1; b < g->members; b++) {
            int ta = j->member[g->first_member + a], tb = j->member[g->first_member + b];
            double unresolved =
                m->tracks[ta].star && m->tracks[tb].star
                    ? 0.0
                    : bst_mtt_unresolved(m->params.merge_rad, &m->tracks[ta], &m->tracks[tb]);
            if (unresolved < LEAST_UNRESOLVED || s->link_count == BST_JOINT_LINKS) {
                continue;
            }
            bst_joint_link *link = &s->links[s->link_count++];
            *link = (bst_joint_link){.a = a, .b = b, .unresolved = unresolved};
            merge_link(m, g, link);
            double high = link->log_miss;
            for (int k = 0; k < link->count; k++) {
                high = fmax(high, j->hypothesis[link->first + 2 * k].log_odds);
            }
            most[a] = fmax(most[a], high - log1p(-fmin(unresolved, 0.999)));
        }
    }
    s->bound[g->members] = 0.0;
    for (int i = g->members - 1; i >= 0; i--) {
        s->bound[i] = s->bound[i + 1] + most[i];
    }
}

/* Enumerates the joint hypotheses of the group of the tracks in member[]. */
static void enumerate_group(bst_mtt *m, bst_joint_group *g) {
    bst_mtt_joint *j = &m->joint;
    g->first_edge = j->edges;
    g->first_state = j->states;
    search s = {.m = m, .group = g, .best = -INFINITY};
    prepare(&s);
    branch(&s, 0, 0.0, 0);
    for (int k = 0; k < g->states; k++) {
        bst_joint_state *state = &j->state[g->first_state + k];
        state->weight = exp(state->weight - s.best);
    }
}

void bst_mtt_joint_enumerate(bst_mtt *m) {
    bst_mtt_joint *j = &m->joint;
    unite(m);
    for (int t = 0; t < m->track_count; t++) {
        int root = find_root(j, t);
        /* the first track of a set forms the group; a track without any detection has none */
        if (!m->observable[t] || j->size[root] < 0 || (j->head[t] < 0 && j->size[root] == 1)) {
            continue;
        }
        int most = j->size[root] * BST_JOINT_MOST_STATES;
        if (j->states + BST_JOINT_MOST_STATES > j->state_room ||
            j->edges + BST_JOINT_EDGES > j->hypothesis_room || j->choices + most > j->choice_room) {
            m->lost++;
            return;
        }
        bst_joint_group *g = &j->group[j->groups++];
        *g = (bst_joint_group){.first_member = j->members};
        for (int u = t; u < m->track_count && j->size[root] > 0; u++) {
            if (find_root(j, u) == root) {
                j->member[j->members++] = u;
                g->members++;
                j->size[root] = g->members == j->size[root] ? -1 : j->size[root];
            }
        }
        enumerate_group(m, g);
    }
}
