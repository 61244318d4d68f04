/* Gates: the detections that may be of a track. */
#include <assert.h>

#include "tracker/mtt/multitarget_internal.h"

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

int bst_mtt_gate(const bst_mtt *mtt, int t, int *columns, double *costs) {
    assert(mtt && columns && costs && t >= 0 && t < mtt->track_count);
    const bst_mtt_params *params = &mtt->params;
    const bst_mtt_track *track = &mtt->tracks[t];
    double sigma = largest_spread(track);
    double radius = sqrt(params->gate_chi2) * hypot(sigma, mtt->largest_sigma);
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
                      log(bst_mtt_detection_probability(mtt, track)) +
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
    double costs[BST_MTT_CANDIDATES];
    return bst_mtt_gate(mtt, t, columns, costs);
}
