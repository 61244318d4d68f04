/* Rolls the body to keep the aim away from the mount's pole (keyhole). */
#include "control/guidance/guidance.h"

/* Share of the mount's limits used for the choice, as a margin for errors and lags. */
#define SHARE 0.8
/* Share of the body's limits used in the prediction. */
#define BODY_SHARE 0.9
#define STEP_RAD (5.0 * BST_DEG_RAD)
enum { MOST_STEPS = 18 };

bst_quat bst_guidance_rolled(const bst_guidance *g, double seconds, double roll_rad) {
    const bst_body_roll *roll = &g->mount.roll;
    double angle = roll->angle_rad + roll->rate_radps * seconds, rate, accel;
    bst_slew_axis slew;
    if (bst_slew_axis_plan(roll->angle_rad, roll->rate_radps, roll_rad, 0.0,
                           BODY_SHARE * roll->rate_limit_radps,
                           BODY_SHARE * roll->accel_limit_radps2, &slew)) {
        bst_slew_axis_at(&slew, seconds, &angle, &rate, &accel);
    }
    /* motion without the roll, then the remaining roll */
    bst_vec3 base = bst_vec3_axpy(g->mount.rate_body_radps, -roll->rate_radps, roll->axis_body);
    bst_quat q = bst_quat_mul(bst_quat_from_rotvec(bst_vec3_scale(base, -seconds)),
                              g->mount.q_body_from_gcrf);
    bst_vec3 turn = bst_vec3_scale(roll->axis_body, roll->angle_rad - angle);
    return bst_quat_mul(bst_quat_from_rotvec(turn), q);
}

bst_status bst_guidance_choose_roll(bst_ctx *ctx, bst_guidance *g,
                                    const bst_pointing_feasibility_problem *problem,
                                    double horizon_s, bool *found) {
    const bst_body_roll *roll = &g->mount.roll;
    *found = false;
    if (!g->mount_known || bst_vec3_norm(roll->axis_body) == 0.0) {
        return BST_OK;
    }
    bool given = g->roll_given;
    double before = g->roll_rad, from = given ? before : roll->angle_rad;
    bst_pointing_feasibility_problem careful = *problem;
    careful.limit_fraction *= SHARE;
    const bst_pointing_feasibility_search unreached = {0.0, horizon_s, 0.5, false};
    const bst_pointing_feasibility_span span = {0.0, horizon_s,
                                                g->config.loss_tolerance_px * g->env.pixel_rad};
    g->roll_given = true;
    for (int i = 1; i <= MOST_STEPS && !*found; i++) {
        for (int side = -1; side <= 1 && !*found; side += 2) {
            bst_pointing_feasibility_loss loss;
            bst_pointing_feasibility_change out;
            int losses;
            g->roll_rad = from + side * i * STEP_RAD;
            BST_TRY(bst_pointing_feasibility_next(ctx, &careful, &unreached, &out));
            if (out.found) {
                continue;
            }
            BST_TRY(bst_pointing_feasibility_chase(ctx, &careful, &span, &loss, 1, &losses));
            *found = losses == 0;
        }
    }
    if (!*found) {
        g->roll_given = given;
        g->roll_rad = before;
    }
    return BST_OK;
}
