/* Merged measurements: two unresolved objects in one detection, or one object with two tracks. */
#include <string.h>

#include "tracker/mtt/multitarget_internal.h"

/* Frames in a row with one shared detection after which two tracks may be duplicates; also frames
 * with separate detections after which two tracks are known to be two objects. */
#define SAME_FRAMES 5
/* Distance, in merge_rad, within which two detections count as resolved neighbours. */
#define SIDE_BY_SIDE 3.0
/* Share of the combined light above which one object dominates the image and hides the other. */
#define OUTSHINES (2.0 / 3.0)

/* Share of object a in the combined light of a and b. */
static double flux_ratio(const bst_mtt_track *a, const bst_mtt_track *b) {
    return 1.0 / (1.0 + pow(10.0, 0.4 * (a->v_mag - b->v_mag)));
}

/* True if both tracks are known as separate objects and one dominates the light. */
static bool is_one_dominant(const bst_mtt_track *a, const bst_mtt_track *b) {
    double light = flux_ratio(a, b);
    return a->apart >= SAME_FRAMES && b->apart >= SAME_FRAMES &&
           (light > OUTSHINES || light < 1.0 - OUTSHINES);
}

/* Extra covariance of a detection shared by tracks a and b, in a's tangent axes: the merged
 * centroid lies between them. */
static void merged_covariance(const bst_mtt *mtt, const bst_mtt_track *a, const bst_mtt_track *b,
                              double out[3]) {
    bst_tangent axes = bst_tangent_at(a->state.direction);
    bst_vec3 to = bst_tangent_log(a->state.direction, b->state.direction);
    double s1 = bst_vec3_dot(to, axes.e1), s2 = bst_vec3_dot(to, axes.e2);
    double floor2 = mtt->params.merge_floor_rad * mtt->params.merge_floor_rad;
    out[0] = s1 * s1 + floor2;
    out[1] = s1 * s2;
    out[2] = s2 * s2 + floor2;
}

/* True if a detection with extra covariance lies in a track's gate. */
static bool fits(const bst_mtt *mtt, const bst_mtt_track *track, int column,
                 const double extra[3]) {
    bst_sky_innovation innovation;
    return bst_sky_innovate(&track->state, &mtt->now.items[column].sky, extra, &innovation) &&
           innovation.chi2 <= mtt->params.gate_chi2;
}

/* Assigns a detection to a track. */
static void assign(bst_mtt *m, int t, int column, bst_mtt_sharing sharing) {
    m->detection_of_track[t] = column;
    m->shared[t] = sharing;
}

/* Assigns a merged detection to the brighter track, with a covariance for the shift by the fainter
 * one's light; the fainter track is marked hidden. Returns false if the detection does not fit the
 * brighter track or is nearer in magnitude to the fainter one. */
static bool assign_to_brighter(bst_mtt *m, int bright, int dim, int column) {
    const bst_mtt_track *a = &m->tracks[bright], *b = &m->tracks[dim];
    double extra[3], share = 1.0 - flux_ratio(a, b), v = m->now.items[column].v_mag;
    double floor2 = m->params.merge_floor_rad * m->params.merge_floor_rad;
    merged_covariance(m, a, b, extra);
    extra[0] = share * share * (extra[0] - floor2) + floor2;
    extra[1] *= share * share;
    extra[2] = share * share * (extra[2] - floor2) + floor2;
    if (fabs(v - b->v_mag) < fabs(v - a->v_mag) || !fits(m, a, column, extra)) {
        return false;
    }
    assign(m, bright, column, BST_MTT_OUTSHINING);
    assign(m, dim, column, BST_MTT_HIDDEN);
    memcpy(m->extra[bright], extra, sizeof extra);
    m->owner[column] = bright;
    m->now.used[column] = true;
    return true;
}

/* Resolves a missed track and its neighbour, of which one dominates. Their common detection belongs
 * to the brighter one; the fainter one counts as hidden, not as missed. */
static void resolve_hidden(bst_mtt *m, int missed, int partner, int column) {
    bool owned = m->detection_of_track[partner] >= 0;
    if (flux_ratio(&m->tracks[missed], &m->tracks[partner]) > OUTSHINES) {
        (void)assign_to_brighter(m, missed, partner, column);
    } else if (!assign_to_brighter(m, partner, missed, column) && owned) {
        assign(m, missed, column, BST_MTT_HIDDEN);
    }
}

/* Nearest free detection to the midpoint of tracks a and b, within merge_rad; -1: none. */
static int free_between(const bst_mtt *mtt, const bst_mtt_track *a, const bst_mtt_track *b) {
    bst_vec3 middle = bst_vec3_unit(bst_vec3_add(a->state.direction, b->state.direction));
    int begin, end, best = -1;
    double nearest = mtt->params.merge_rad;
    bst_mtt_pool_range(&mtt->now, middle, nearest, &begin, &end);
    for (int i = begin; i < end; i++) {
        int column = mtt->now.order[i];
        double distance = bst_vec3_norm(bst_vec3_sub(mtt->now.items[column].sky.direction, middle));
        if (!mtt->now.used[column] && distance < nearest) {
            nearest = distance;
            best = column;
        }
    }
    return best;
}

/* Counts, per confirmed track, the frames in which a neighbour was resolved. */
static void count_resolved(bst_mtt *mtt) {
    for (int t = 0; t < mtt->track_count; t++) {
        int column = mtt->detection_of_track[t], begin, end;
        if (column < 0 || mtt->tracks[t].status == BST_TRACK_TENTATIVE || mtt->tracks[t].star) {
            continue;
        }
        bst_vec3 place = mtt->now.items[column].sky.direction;
        bool apart = false;
        bst_mtt_pool_range(&mtt->now, place, SIDE_BY_SIDE * mtt->params.merge_rad, &begin, &end);
        for (int i = begin; i < end && !apart; i++) {
            int near = mtt->now.order[i], other = mtt->owner[near];
            bst_vec3 off = bst_vec3_sub(mtt->now.items[near].sky.direction, place);
            apart = other >= 0 && other != t && !mtt->tracks[other].star &&
                    bst_vec3_norm(off) < SIDE_BY_SIDE * mtt->params.merge_rad;
        }
        mtt->tracks[t].apart += apart;
    }
}

/* True if two tracks are duplicates of one object: closer than any resolved pair, at the same rate,
 * both on shared detections for SAME_FRAMES. */
static bool is_duplicate(const bst_mtt *mtt, const bst_mtt_track *a, const bst_mtt_track *b) {
    bst_vec3 apart = bst_vec3_sub(a->state.direction, b->state.direction);
    bst_vec3 rate = bst_vec3_sub(a->state.rate_radps, b->state.rate_radps);
    double variance = a->state.covariance[2][2] + a->state.covariance[3][3] +
                      b->state.covariance[2][2] + b->state.covariance[3][3];
    return a->merged_in_row >= SAME_FRAMES && b->merged_in_row >= SAME_FRAMES &&
           bst_vec3_norm(apart) < mtt->params.merge_floor_rad &&
           /* equal rates to 3 sigma */
           bst_vec3_dot(rate, rate) < 9.0 * variance;
}

/* Ends a long-lasting merge of two tracks: the one with more hits keeps the detection alone; a
 * duplicate is terminated. Returns false if the detection does not fit that track without extra
 * covariance. */
static bool end_merge(bst_mtt *mtt, int missed, int owner, bool alike) {
    int column = mtt->detection_of_track[owner];
    if (mtt->tracks[missed].hits > mtt->tracks[owner].hits) {
        if (!fits(mtt, &mtt->tracks[missed], column, NULL)) {
            return false;
        }
        mtt->detection_of_track[missed] = column;
        mtt->detection_of_track[owner] = -1;
        mtt->owner[column] = missed;
        missed = owner;
    }
    if (alike) {
        mtt->tracks[missed].misses_in_row = mtt->params.max_misses + 1;
    }
    return true;
}

/* Assigns merged detections to missed confirmed tracks next to another track or a detected star.
 * Both then use the detection with extra covariance along the line between them. If they are known
 * as two objects and one dominates, that one gets the detection alone. */
void bst_mtt_share(bst_mtt *mtt) {
    count_resolved(mtt);
    double near2 = mtt->params.merge_rad * mtt->params.merge_rad;
    for (int t = 0; t < mtt->track_count; t++) {
        bst_mtt_track *missed = &mtt->tracks[t];
        if (missed->status == BST_TRACK_TENTATIVE || missed->star || !mtt->observable[t] ||
            mtt->detection_of_track[t] >= 0) {
            continue;
        }
        int partner = -1;
        double nearest2 = near2;
        for (int u = 0; u < mtt->track_count; u++) {
            if (u == t || mtt->tracks[u].status == BST_TRACK_TENTATIVE || mtt->tracks[u].asleep ||
                (mtt->tracks[u].star && mtt->detection_of_track[u] < 0)) {
                continue;
            }
            bst_vec3 apart = bst_vec3_sub(mtt->tracks[u].state.direction, missed->state.direction);
            if (bst_vec3_dot(apart, apart) < nearest2) {
                nearest2 = bst_vec3_dot(apart, apart);
                partner = u;
            }
        }
        if (partner < 0) {
            continue;
        }
        bst_mtt_track *other = &mtt->tracks[partner];
        int column = mtt->detection_of_track[partner], most = mtt->params.max_merged_frames;
        bool alike = is_duplicate(mtt, missed, other);
        bool long_since = missed->merged_in_row >= most && other->merged_in_row >= most;
        bool hides = !other->star && is_one_dominant(missed, other);
        if (column >= 0 && !hides && !other->star && !mtt->shared[partner] && most > 0 &&
            (alike || long_since) && end_merge(mtt, t, partner, alike)) {
            continue;
        }
        if (column < 0) {
            column = free_between(mtt, missed, other);
        }
        if (column < 0) {
            continue;
        }
        if (hides && mtt->shared[partner] == BST_MTT_ALONE) {
            resolve_hidden(mtt, t, partner, column);
            continue;
        }
        double extra[3], extra_other[3];
        merged_covariance(mtt, missed, other, extra);
        merged_covariance(mtt, other, missed, extra_other);
        if (!fits(mtt, missed, column, extra) || !fits(mtt, other, column, extra_other)) {
            continue;
        }
        assign(mtt, t, column, BST_MTT_WIDENED);
        memcpy(mtt->extra[t], extra, sizeof extra);
        if (mtt->shared[partner] < BST_MTT_HIDDEN) {
            assign(mtt, partner, column, BST_MTT_WIDENED);
            memcpy(mtt->extra[partner], extra_other, sizeof extra_other);
        }
        mtt->now.used[column] = true;
        mtt->owner[column] = BST_MTT_SEVERAL;
    }
}
