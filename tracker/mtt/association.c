/* Measurement-to-track association: gating and assignment. */
#include <assert.h>
#include <stdlib.h>
#include <string.h>

#include "tracker/mtt/multitarget_internal.h"

/* Gain of the smoothed number of false alarms per frame, after the first frames. */
#define ALARM_GAIN 0.1

/* Weight of the latest frame in the mean number of false alarms. */
static double alarm_gain(const bst_mtt *mtt) {
    return fmax(ALARM_GAIN, 1.0 / mtt->alarm_frames);
}

void bst_mtt_recount_alarms(bst_mtt *mtt, const bst_mtt_track *track) {
    assert(mtt && track && track->hits >= 0);
    /* hits of a few frames ago have nearly the weight of the latest frame, all together that of one
     * detection in each frame */
    double part = fmin(alarm_gain(mtt) * track->hits, 1.0);
    mtt->alarms = fmax(mtt->alarms - part, 0.0);
    bst_mtt_note_alarm(mtt, track->snr, -track->hits);
}

/* Largest 1 sigma of a direction measurement in the frame, rad. */
static double largest_sigma(const bst_mtt_pool *pool) {
    double variance = 0.0;
    for (int i = 0; i < pool->count; i++) {
        variance = fmax(variance, pool->items[i].sky.cov_11 + pool->items[i].sky.cov_22);
    }
    return sqrt(variance);
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
        int found = bst_mtt_gate(mtt, t, mtt->edge_columns + edges, mtt->edge_costs + edges);
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
        bst_mtt_split_tracks(mtt);
    } else {
        /* confirmed tracks are associated first: a false tentative track must not take their
         * detections */
        associate_tracks(mtt, false);
        bst_mtt_share(mtt);
    }
    bst_mtt_gate_manoeuvres(mtt);
    int unused = 0, unexplained = 0; /* without a confirmed track, without any track */
    if (!partial) {
        bst_mtt_fade_alarms(mtt);
    }
    for (int i = 0; i < mtt->now.count; i++) {
        const int owner = mtt->owner[i]; /* of a split, or by the gate of manoeuvres */
        const bool firm = owner >= 0 && mtt->tracks[owner].status != BST_TRACK_TENTATIVE;
        bool alarm = jointly ? mtt->joint.claimed_firm[i] <= 0.5 && !firm : !mtt->now.used[i];
        unexplained += !mtt->now.used[i];
        unused += alarm;
        if (alarm && !partial) {
            bst_mtt_note_alarm(mtt, mtt->now.items[i].snr, 1.0);
        }
    }
    if (!partial) {
        mtt->alarm_frames++;
        mtt->alarms += alarm_gain(mtt) * (unused - mtt->alarms);
        mtt->clutter_density =
            fmax(fmax(mtt->clutter, unexplained), mtt->params.false_alarms_per_frame) /
            mtt->params.field_sr;
    }
    if (!jointly) {
        associate_tracks(mtt, true);
    }
}
