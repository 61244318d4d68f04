/* Measurement-to-track association: gating and assignment. */
#include <assert.h>
#include <stdlib.h>
#include <string.h>

#include "tracker/mtt/multitarget_internal.h"

/* Gain of the smoothed number of false alarms per frame, after the first frames. */
#define ALARM_GAIN 0.1

/* Largest 1 sigma of a direction measurement in the frame, rad. */
static double largest_sigma(const bst_mtt_pool *pool) {
    double variance = 0.0;
    for (int i = 0; i < pool->count; i++) {
        variance = fmax(variance, pool->items[i].sky.cov_11 + pool->items[i].sky.cov_22);
    }
    return sqrt(variance);
}

/* Largest position uncertainty of a track over its models or mixture components, rad. */
static double largest_spread(const bst_mtt_track *track) {
    double sigma2 = track->state.covariance[0][0] + track->state.covariance[1][1];
    for (int m = 0; m < track->models.count; m++) {
        const bst_sky_state *model = &track->models.state[m];
        bst_vec3 off = bst_vec3_sub(model->direction, track->state.direction);
        sigma2 = fmax(sigma2,
                      model->covariance[0][0] + model->covariance[1][1] + bst_vec3_dot(off, off));
    }
    return sqrt(sigma2);
}

/* Gates the detections of track t: the BST_MTT_CANDIDATES cheapest that are free or its own.
 * Returns their number. */
static int gate_detections(const bst_mtt *mtt, int t, double detection_sigma, int *columns,
                           double *costs) {
    const bst_mtt_params *params = &mtt->params;
    const bst_mtt_track *track = &mtt->tracks[t];
    double sigma = largest_spread(track);
    double radius = sqrt(params->gate_chi2) * hypot(sigma, detection_sigma);
    int begin, end, count = 0;
    bst_mtt_pool_range(&mtt->now, track->state.direction, radius, &begin, &end);
    for (int i = begin; i < end; i++) {
        int column = mtt->now.order[i];
        const bst_mtt_detection *detection = &mtt->now.items[column];
        bst_filter_candidate candidate = {.measurement = &detection->sky};
        bst_filter_fit fit;
        if ((mtt->owner[column] != BST_MTT_NOBODY && mtt->owner[column] != t) ||
            bst_vec3_norm(bst_vec3_sub(detection->sky.direction, track->state.direction)) >
                radius ||
            !bst_filter_evaluate(&mtt->filter, &track->state, &track->models, &candidate, &fit) ||
            fit.chi2 > params->gate_chi2) {
            continue;
        }
        double cost = -fit.log_likelihood + log(mtt->clutter_density) -
                      log(params->detection_probability) +
                      bst_mtt_brightness_cost(track, detection);
        int at = count;
        if (count == BST_MTT_CANDIDATES) {
            at = 0;
            for (int k = 1; k < count; k++) {
                if (costs[k] > costs[at]) {
                    at = k;
                }
            }
            if (costs[at] <= cost) {
                continue;
            }
        } else {
            count++;
        }
        columns[at] = column;
        costs[at] = cost;
    }
    return count;
}

int bst_mtt_gated(const bst_mtt *mtt, int t, int *columns) {
    assert(mtt && columns && t >= 0 && t < mtt->track_count);
    double costs[BST_MTT_CANDIDATES];
    return gate_detections(mtt, t, mtt->largest_sigma, columns, costs);
}

int bst_mtt_gate(const bst_mtt *mtt, int t, int *columns, double *costs) {
    assert(mtt && columns && costs && t >= 0 && t < mtt->track_count);
    return gate_detections(mtt, t, mtt->largest_sigma, columns, costs);
}

/* Nearest-neighbour association: assigns the cheapest track-detection pair first. */
static void assign_nearest(bst_mtt *mtt, int rows) {
    int edges = mtt->first[rows];
    for (int r = 0; r < rows; r++) {
        mtt->column_of_row[r] = -1;
        for (int e = mtt->first[r]; e < mtt->first[r + 1]; e++) {
            mtt->edge_row[e] = r;
            mtt->edge_order[e] = e;
            mtt->edge_key[e] = mtt->edge_costs[e];
        }
    }
    bst_mtt_sort(mtt->edge_key, mtt->edge_order, edges);
    for (int i = 0; i < edges; i++) {
        int e = mtt->edge_order[i], row = mtt->edge_row[e], column = mtt->edge_columns[e];
        if (mtt->column_of_row[row] < 0 && !mtt->now.used[column] &&
            mtt->edge_costs[e] < mtt->miss_costs[row]) {
            mtt->column_of_row[row] = column;
            mtt->now.used[column] = true;
        }
    }
}

/* Associates all confirmed or all tentative tracks with the frame's detections. */
static void associate_tracks(bst_mtt *mtt, bool tentative) {
    int rows = 0, edges = 0;
    for (int t = 0; t < mtt->track_count; t++) {
        if ((mtt->tracks[t].status == BST_TRACK_TENTATIVE) != tentative || !mtt->observable[t]) {
            continue;
        }
        mtt->rows[rows] = t;
        mtt->first[rows] = edges;
        mtt->miss_costs[rows] = -log(1.0 - mtt->params.detection_probability);
        int found = gate_detections(mtt, t, mtt->largest_sigma, mtt->edge_columns + edges,
                                    mtt->edge_costs + edges);
        edges += found;
        rows += found > 0;
    }
    mtt->first[rows] = edges;
    if (mtt->params.association == BST_MTT_NEAREST) {
        assign_nearest(mtt, rows);
    } else {
        const bst_assignment_problem problem = {.rows = rows,
                                                .columns = mtt->now.count,
                                                .first = mtt->first,
                                                .edge_columns = mtt->edge_columns,
                                                .costs = mtt->edge_costs,
                                                .miss = mtt->miss_costs};
        bst_assignment_solve(mtt->assignment, &problem, mtt->column_of_row);
    }
    for (int r = 0; r < rows; r++) {
        int column = mtt->column_of_row[r];
        mtt->detection_of_track[mtt->rows[r]] = column;
        if (column >= 0) {
            mtt->now.used[column] = true;
            /* tentative tracks own no detection: a confirmed track may use it as well */
            mtt->owner[column] = tentative ? BST_MTT_NOBODY : mtt->rows[r];
        }
    }
}

void bst_mtt_associate(bst_mtt *mtt, bool partial) {
    assert(mtt && mtt->now.count <= mtt->params.max_detections);
    mtt->largest_sigma = largest_sigma(&mtt->now);
    for (int t = 0; t < mtt->track_count; t++) {
        mtt->detection_of_track[t] = -1;
        mtt->shared[t] = BST_MTT_ALONE;
    }
    for (int i = 0; i < mtt->now.count; i++) {
        mtt->owner[i] = BST_MTT_NOBODY;
    }
    bool jointly = mtt->params.association == BST_MTT_PMB;
    if (jointly) {
        bst_mtt_associate_jointly(mtt);
    } else {
        /* confirmed tracks are associated first: a false tentative track must not take their
         * detections */
        associate_tracks(mtt, false);
        bst_mtt_share(mtt);
    }
    if (jointly) {
        bst_mtt_split_tracks(mtt);
    }
    bst_mtt_gate_manoeuvres(mtt);
    int unused = 0;
    for (int i = 0; i < mtt->now.count; i++) {
        unused += jointly ? mtt->joint.claimed_firm[i] <= 0.5 : !mtt->now.used[i];
    }
    if (!partial) {
        mtt->alarm_frames++;
        mtt->alarms += fmax(ALARM_GAIN, 1.0 / mtt->alarm_frames) * (unused - mtt->alarms);
        mtt->clutter_density =
            fmax(fmax(mtt->clutter, unused), mtt->params.false_alarms_per_frame) /
            mtt->params.field_sr;
    }
    if (!jointly) {
        associate_tracks(mtt, true);
    }
}
