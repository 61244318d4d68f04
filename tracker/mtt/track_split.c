/* Split of a track that turns out to be two objects: until now they gave merged measurements. */
#include <assert.h>
#include <math.h>

#include "tracker/mtt/multitarget_internal.h"
#include "tracker/mtt/resolution.h"

/* Two detections of a missed track, and ln of the odds that they are the two objects that it was.
 */
typedef struct pair {
    int columns[2];
    double log_odds, share; /* share: of the first one in their light */
} pair;

/* Odds of a pair of detections: their centre of light continues the track, and they have just been
 * resolved. The alternative is that the track was missed and both are clutter or other objects. The
 * prior of a companion is the one of an undetected object within merge_rad. */
static bool judge(const bst_mtt *m, int t, pair *p) {
    const bst_mtt_track *track = &m->tracks[t];
    const bst_mtt_detection *a = &m->now.items[p->columns[0]], *b = &m->now.items[p->columns[1]];
    bst_vec3 to = bst_tangent_log(a->sky.direction, b->sky.direction);
    p->share = bst_mtt_detection_share(a, b);
    bst_sky_measurement centre = a->sky;
    centre.direction = bst_tangent_exp(a->sky.direction, bst_vec3_scale(to, 1.0 - p->share));
    double floor2 = m->params.merge_floor_rad * m->params.merge_floor_rad;
    const double extra[3] = {floor2, 0.0, floor2};
    bst_filter_candidate candidate = {.measurement = &centre, .extra = extra};
    bst_filter_fit fit;
    if (!bst_filter_evaluate(&m->filter, &track->state, &track->models, &candidate, &fit) ||
        fit.chi2 > m->params.gate_chi2) {
        return false;
    }
    double area = BST_PI * m->params.merge_rad * m->params.merge_rad;
    double pd = m->params.detection_probability, beta = m->alarm_density;
    double missed = 1.0 - bst_mtt_detection_probability(m, track);
    bst_mtt_detection both = *a;
    both.v_mag += 2.5 * log10(p->share);
    p->log_odds = log(area / m->params.field_sr) + 2.0 * log(pd / beta) - log(area) +
                  fit.log_likelihood - log(missed) - bst_mtt_brightness_cost(track, &both);
    return true;
}

/* Finds the likeliest pair of unused detections of a missed track. */
static pair find_pair(const bst_mtt *m, int t) {
    const bst_mtt_track *track = &m->tracks[t];
    const bst_mtt_pool *now = &m->now;
    double spread = sqrt(track->state.covariance[0][0] + track->state.covariance[1][1]);
    double reach = m->params.merge_rad + sqrt(m->params.gate_chi2) * spread;
    pair best = {.log_odds = 0.0, .columns = {-1, -1}};
    int begin, end;
    bst_mtt_pool_range(now, track->state.direction, reach, &begin, &end);
    for (int i = begin; i < end; i++) {
        bst_vec3 a = now->items[now->order[i]].sky.direction;
        if (now->used[now->order[i]] ||
            bst_vec3_norm(bst_vec3_sub(a, track->state.direction)) > reach) {
            continue;
        }
        for (int k = i + 1; k < end; k++) {
            pair p = {.columns = {now->order[i], now->order[k]}};
            bst_vec3 off = bst_vec3_sub(a, now->items[p.columns[1]].sky.direction);
            if (!now->used[p.columns[1]] && bst_vec3_norm(off) < m->params.merge_rad &&
                judge(m, t, &p) && p.log_odds > best.log_odds) {
                best = p;
            }
        }
    }
    return best;
}

/* Widens a track to one of its two objects, which is `off` (rad) from the centre of light and may
 * have reached it within interval_s. */
static void widen(bst_mtt_track *track, bst_vec3 off, double interval_s) {
    bst_sky_state *s = &track->state;
    bst_tangent axes = bst_tangent_at(s->direction);
    double x[2] = {bst_vec3_dot(off, axes.e1), bst_vec3_dot(off, axes.e2)};
    for (int i = 0; i < 2; i++) {
        for (int k = 0; k < 2; k++) {
            s->covariance[i][k] += x[i] * x[k];
            s->covariance[i + 2][k + 2] += x[i] * x[k] / (interval_s * interval_s);
        }
    }
    track->models.count = 0;
    track->innovation_count = track->brightness_count = 0;
}

/* Gives a track one of the two detections. */
static void take(bst_mtt *m, int t, int column, bst_vec3 centre, double interval_s) {
    bst_mtt_track *track = &m->tracks[t];
    const bst_mtt_detection *d = &m->now.items[column];
    widen(track, bst_vec3_sub(d->sky.direction, centre), interval_s);
    m->detection_of_track[t] = column;
    m->owner[column] = t;
    m->shared[t] = BST_MTT_ALONE;
    m->joint.decided[t] = m->joint.head[t] = -1;
    m->departed_chi2[t] = 0.0;
    m->now.used[column] = true;
    bst_mtt_start_snr(track); /* so far of the light of both */
    if (isfinite(d->v_mag_sigma)) {
        double floor = m->params.brightness_systematic_mag;
        track->v_mag = d->v_mag;
        track->v_mag_variance = floor * floor + d->v_mag_sigma * d->v_mag_sigma;
    }
}

/* Splits a track: the brighter object keeps its identity, the other one starts a tentative track.
 */
static void split(bst_mtt *m, int t, const pair *p) {
    bst_mtt_track *child = &m->tracks[m->track_count], *track = &m->tracks[t];
    const bst_mtt_detection *a = &m->now.items[p->columns[0]], *b = &m->now.items[p->columns[1]];
    bst_vec3 to = bst_tangent_log(a->sky.direction, b->sky.direction);
    bst_vec3 centre = bst_tangent_exp(a->sky.direction, bst_vec3_scale(to, 1.0 - p->share));
    double before = m->history_count > 0 ? m->history[0].seconds : track->last_update_s;
    double interval_s = fmax(m->now.seconds - before, 1e-3);
    int brighter = p->columns[p->share < 0.5], other = p->columns[p->share >= 0.5];
    track->existence *= 1.0 / (1.0 + exp(-p->log_odds));
    *child = *track;
    child->id = m->next_id++;
    child->status = BST_TRACK_TENTATIVE;
    child->hits = 1;
    child->frames = 1;
    child->misses_in_row = child->merged_in_row = child->apart = 0;
    child->score = p->log_odds;
    child->chi2 = 0.0;
    child->orbit.valid = false;
    child->first_tick = m->now.tick;
    child->first_direction = track->state.direction;
    m->observable[m->track_count] = true;
    child->may_miss = track->may_miss;
    int at = m->track_count++;
    take(m, t, brighter, centre, interval_s);
    take(m, at, other, centre, interval_s);
}

void bst_mtt_split_tracks(bst_mtt *m) {
    int count = m->track_count;
    for (int t = 0; t < count; t++) {
        const bst_mtt_track *track = &m->tracks[t];
        if (track->status == BST_TRACK_TENTATIVE || track->star || !m->observable[t] ||
            m->detection_of_track[t] >= 0 || !track->may_miss || track->orbit.valid ||
            track->asleep || !(m->params.merge_rad > 0.0) || !bst_mtt_has_room(m, false, 0)) {
            continue;
        }
        pair best = find_pair(m, t);
        if (best.columns[0] >= 0) {
            split(m, t, &best);
        }
    }
}
