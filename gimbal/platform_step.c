#include "gimbal/platform.h"

bst_status bst_platform_step(struct bst_step *step, bst_platform *platform, int64_t n,
                             bst_vec3 reaction_nm) {
    bool saturated = platform->wheels_saturated, blind = platform->trackers_blind;
    BST_TRY(
        bst_platform_advance(bst_step_ctx(step), platform, n, bst_step_seconds(step), reaction_nm));
    if (platform->wheels_saturated != saturated) {
        if (saturated) {
            bst_step_event(step, "wheels", "reaction wheels within their limits again");
        } else {
            bst_step_event(step, "wheels", "reaction wheels at their limit");
            bst_step_count(step, "wheels_saturated");
        }
    }
    if (platform->trackers_blind != blind) {
        if (blind) {
            bst_step_event(step, "star_trackers", "stars in sight again");
        } else {
            bst_step_event(step, "star_trackers", "no star tracker sees stars");
            bst_step_count(step, "star_trackers_blind");
        }
    }
    return BST_OK;
}
