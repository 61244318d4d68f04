#include "tracker/attitude/attitude_shared.h"

#include <assert.h>
#include <math.h>
#include <string.h>

enum { FEWEST_STARS = 4 };
/* Prior of the ratio: 0.2 of the standard deviation (tests/e2e/test_orbit_consistency.py), with the
 * weight of so many frames. */
static const double PRIOR_SHARE = 0.04, PRIOR_FRAMES = 10.0;
static const double MOST_FRAMES = 1000.0;
/* Largest leverage of a star used in the correction: above it residuals mainly show the errors of
 * other stars. */
static const double MOST_LEVERAGE = 0.5;

void bst_attitude_shared_update(bst_attitude_shared *shared, const bst_attitude_solution *solution,
                                const bst_attitude_star *stars, int count) {
    assert(shared && solution && count >= 0 && (stars || count == 0));
    if (solution->stars_used < FEWEST_STARS) {
        return;
    }
    const double(*c)[3] = solution->covariance;
    bst_quat back = bst_quat_conj(solution->q_cam_from_gcrf);
    double before_rad2 = shared->variance_rad2, sum = 0.0;
    int again = 0;
    shared->variance_rad2 = c[0][0] + c[1][1];
    shared->frame++;
    for (int i = 0; i < count; i++) {
        const bst_attitude_star *s = &stars[i];
        if (!(s->weight > 0.0)) {
            continue;
        }
        bst_vec3 pull = bst_quat_rotate(back, (bst_vec3){s->pull_rad.x, s->pull_rad.y, 0.0});
        uint32_t slot = (s->id * 2654435761u >> 16) & (BST_ATTITUDE_SHARED_STARS - 1);
        if (shared->stars[slot].id == s->id && shared->stars[slot].frame == shared->frame - 1) {
            /* a star pulls the mean towards itself, so residuals are smaller than errors */
            sum += bst_vec3_dot(pull, shared->stars[slot].pull_rad) /
                   (1.0 - fmin(s->leverage, MOST_LEVERAGE));
            again++;
        }
        shared->stars[slot].id = s->id;
        shared->stars[slot].frame = shared->frame;
        shared->stars[slot].pull_rad = pull;
    }
    if (again > 0) {
        shared->ratios += sum / sqrt(before_rad2 * shared->variance_rad2);
        shared->frames += 1.0;
        if (shared->frames > MOST_FRAMES) {
            shared->ratios *= MOST_FRAMES / shared->frames;
            shared->frames = MOST_FRAMES;
        }
    }
}

double bst_attitude_shared_get(const bst_attitude_shared *shared) {
    double mean = (PRIOR_SHARE * PRIOR_FRAMES + shared->ratios) / (PRIOR_FRAMES + shared->frames);
    return fmin(fmax(mean, 0.0), 1.0);
}

/* True if a slot has a star of the latest frame. */
static bool is_latest(const bst_attitude_shared *shared, int slot) {
    return shared->frame > 0 && shared->stars[slot].frame == shared->frame;
}

void bst_attitude_shared_archive(bst_attitude_shared *shared, bst_archive *archive) {
    BST_ARCHIVE(archive, shared->frame);
    BST_ARCHIVE(archive, shared->variance_rad2);
    BST_ARCHIVE(archive, shared->ratios);
    BST_ARCHIVE(archive, shared->frames);
    bool restoring = bst_archive_is_restoring(archive);
    int count = 0, next = 0;
    for (int i = 0; !restoring && i < BST_ATTITUDE_SHARED_STARS; i++) {
        count += is_latest(shared, i);
    }
    count = bst_archive_count(archive, count, BST_ATTITUDE_SHARED_STARS);
    if (restoring) {
        memset(shared->stars, 0, sizeof shared->stars);
    }
    for (int k = 0; k < count; k++) {
        while (!restoring && !is_latest(shared, next)) {
            next++;
        }
        int slot = (int)bst_archive_integer(archive, next++, 0, BST_ATTITUDE_SHARED_STARS - 1);
        BST_ARCHIVE(archive, shared->stars[slot]);
    }
}
