/* Tracks whose objects are seen as one: their light has melted into one detection, or they are one
 * object with two tracks. */
#include <string.h>

#include "tracker/mtt/multitarget_internal.h"

/* Frames in a row with one detection after which two tracks may prove to be the same, and frames
 * with a detection for each of two neighbours after which they are known to be two. */
#define SAME_FRAMES 5
/* Of merge_rad: as far apart two that are seen side by side are looked for. */
#define SIDE_BY_SIDE 3.0
/* Of two lights: one with a greater share than this has the image, and hides the other one. */
#define OUTSHINES (2.0 / 3.0)

/* Share of a's light in that of a and b. */
static double share_of_light(const bst_mtt_track *a, const bst_mtt_track *b) {
    return 1.0 / (1.0 + pow(10.0, 0.4 * (a->v_mag - b->v_mag)));
}

/* Have both been seen, side by side, and one as much the brighter? */
static bool one_hides(const bst_mtt_track *a, const bst_mtt_track *b) {
    double light = share_of_light(a, b);
    return a->apart >= SAME_FRAMES && b->apart >= SAME_FRAMES &&
           (light > OUTSHINES || light < 1.0 - OUTSHINES);
}

/* Widening of a detection that tracks a and b may share, in a's axes: the light's centroid lies
 * somewhere between them. */
static void widen(const bst_mtt *mtt, const bst_mtt_track *a, const bst_mtt_track *b,
                  double out[3]) {
    bst_tangent axes = bst_tangent_at(a->state.direction);
    bst_vec3 to = bst_tangent_log(a->state.direction, b->state.direction);
    double s1 = bst_vec3_dot(to, axes.e1), s2 = bst_vec3_dot(to, axes.e2);
    double floor2 = mtt->params.merge_floor_rad * mtt->params.merge_floor_rad;
    out[0] = s1 * s1 + floor2;
    out[1] = s1 * s2;
    out[2] = s2 * s2 + floor2;
}

static bool fits(const bst_mtt *mtt, const bst_mtt_track *track, int column,
                 const double extra[3]) {
    bst_sky_innovation innovation;
    return bst_sky_innovate(&track->state, &mtt->now.items[column].sky, extra, &innovation) &&
           innovation.chi2 <= mtt->params.gate_chi2;
}

static void give(bst_mtt *m, int t, int column, bst_mtt_sharing sharing) {
    m->detection_of_track[t] = column;
    m->shared[t] = sharing;
}

/* Of two tracks with much and with little light the former has the detection, whose centroid the
 * latter's light draws aside, and the latter is hidden. False where it does not fit the former, or
 * is as dim as the latter. */
static bool outshine(bst_mtt *m, int bright, int dim, int column) {
    const bst_mtt_track *a = &m->tracks[bright], *b = &m->tracks[dim];
    double extra[3], share = 1.0 - share_of_light(a, b), v = m->now.items[column].v_mag;
    double floor2 = m->params.merge_floor_rad * m->params.merge_floor_rad;
    widen(m, a, b, extra);
    extra[0] = share * share * (extra[0] - floor2) + floor2;
    extra[1] *= share * share;
    extra[2] = share * share * (extra[2] - floor2) + floor2;
    if (fabs(v - b->v_mag) < fabs(v - a->v_mag) || !fits(m, a, column, extra)) {
        return false;
    }
    give(m, bright, column, BST_MTT_OUTSHINING);
    give(m, dim, column, BST_MTT_HIDDEN);
    memcpy(m->extra[bright], extra, sizeof extra);
    m->owner[column] = bright;
    m->now.used[column] = true;
    return true;
}

/* A missed track and its neighbour, one of which hides the other: the detection that the neighbour
 * or nobody has is the bright one's; the dim one is not missed while the bright one is seen. */
static void hide(bst_mtt *m, int missed, int partner, int column) {
    bool owned = m->detection_of_track[partner] >= 0;
    if (share_of_light(&m->tracks[missed], &m->tracks[partner]) > OUTSHINES) {
        (void)outshine(m, missed, partner, column);
    } else if (!outshine(m, partner, missed, column) && owned) {
        give(m, missed, column, BST_MTT_HIDDEN);
    }
}

/* The free detection nearest to the middle of a and b, within merge_rad of it. */
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

/* Notes which confirmed tracks have a detection beside that of another one. */
static void note_apart(bst_mtt *mtt) {
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

/* Two tracks nearer to each other than any two objects are seen apart, moving alike, have one
 * object, which has started a second track by a detection far off. */
static bool same(const bst_mtt *mtt, const bst_mtt_track *a, const bst_mtt_track *b) {
    bst_vec3 apart = bst_vec3_sub(a->state.direction, b->state.direction);
    bst_vec3 rate = bst_vec3_sub(a->state.rate_radps, b->state.rate_radps);
    double variance = a->state.covariance[2][2] + a->state.covariance[3][3] +
                      b->state.covariance[2][2] + b->state.covariance[3][3];
    return a->merged_in_row >= SAME_FRAMES && b->merged_in_row >= SAME_FRAMES &&
           bst_vec3_norm(apart) < mtt->params.merge_floor_rad &&
           bst_vec3_dot(rate, rate) < 9.0 * variance;
}

/* Of two tracks that have lived on one detection for too long, the one that was seen more often
 * goes on with it, alone; where they are the same, the other one ends. False while the detection is
 * not that one's without widening. */
static bool settle(bst_mtt *mtt, int missed, int owner, bool alike) {
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

/* A missed confirmed track beside another one, or beside a star that is seen, may have melted into
 * one detection with it: both then take that detection, widened along the line between them. Of two
 * known to be two, a bright one has it alone. */
void bst_mtt_share(bst_mtt *mtt) {
    note_apart(mtt);
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
        bool alike = same(mtt, missed, other);
        bool long_since = missed->merged_in_row >= most && other->merged_in_row >= most;
        bool hides = !other->star && one_hides(missed, other);
        if (column >= 0 && !hides && !other->star && !mtt->shared[partner] && most > 0 &&
            (alike || long_since) && settle(mtt, t, partner, alike)) {
            continue;
        }
        if (column < 0) {
            column = free_between(mtt, missed, other);
        }
        if (column < 0) {
            continue;
        }
        if (hides && mtt->shared[partner] == BST_MTT_ALONE) {
            hide(mtt, t, partner, column);
            continue;
        }
        double extra[3], extra_other[3];
        widen(mtt, missed, other, extra);
        widen(mtt, other, missed, extra_other);
        if (!fits(mtt, missed, column, extra) || !fits(mtt, other, column, extra_other)) {
            continue;
        }
        give(mtt, t, column, BST_MTT_WIDENED);
        memcpy(mtt->extra[t], extra, sizeof extra);
        if (mtt->shared[partner] < BST_MTT_HIDDEN) {
            give(mtt, partner, column, BST_MTT_WIDENED);
            memcpy(mtt->extra[partner], extra_other, sizeof extra_other);
        }
        mtt->now.used[column] = true;
        mtt->owner[column] = BST_MTT_SEVERAL;
    }
}
