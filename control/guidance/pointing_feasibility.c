#include "control/guidance/pointing_feasibility.h"

#include "sim/astro/bodies.h"

/* Half the interval of the differences that give axis rates. */
#define HALF_S 0.05
#define FOUND_TO_S 0.01

const char *bst_pointing_feasibility_reason(int reach) {
    static const char *const reasons[BST_REACH_COUNT] = {
        [BST_REACH_OK] = "within reach",
        [BST_REACH_NO_CUE] = "not cued",
        [BST_REACH_BEHIND_EARTH] = "behind the Earth",
        [BST_REACH_SUN] = "in the keep-out cone of the Sun",
        [BST_REACH_MOON] = "in the keep-out cone of the Moon",
        [BST_REACH_EARTH] = "in the keep-out cone of the Earth's limb",
        [BST_REACH_TRAVEL] = "outside of the mount's travel",
        [BST_REACH_RATE] = "faster than the mount turns",
        [BST_REACH_ACCEL] = "accelerating faster than the mount does",
        [BST_REACH_KEYHOLE] = "in the keyhole at the mount's pole"};
    return reach >= 0 && reach < BST_REACH_COUNT ? reasons[reach] : "unknown";
}

/* True if the Earth hides the target. */
static bool behind_earth(const bst_pointing_feasibility_look *look) {
    double r2 = bst_vec3_dot(look->position_m, look->position_m);
    double towards = -bst_vec3_dot(look->position_m, look->direction_gcrf);
    double miss2 = r2 - towards * towards;
    return look->range_m > towards && towards > 0.0 &&
           miss2 < BST_EARTH_RADIUS_M * BST_EARTH_RADIUS_M;
}

static bst_pointing_feasibility of_zone(int kind) {
    return kind == BST_ZONE_SUN    ? BST_REACH_SUN
           : kind == BST_ZONE_MOON ? BST_REACH_MOON
                                   : BST_REACH_EARTH;
}

static bst_vec3 in_body(const bst_pointing_feasibility_look *look) {
    return bst_quat_rotate(look->q_body_from_gcrf, look->direction_gcrf);
}

/* True if the mount has a redundant axis. */
static bool has_redundant(const bst_mount_status *mount) {
    bool has = false;
    for (int i = 0; i < mount->axes; i++) {
        has = has || mount->axis[i].redundant;
    }
    return has;
}

/* Checks axis rates and accelerations over three directions HALF_S apart. */
static bst_pointing_feasibility check_axis_limits(const bst_pointing_feasibility_problem *problem,
                                                  const bst_vec3 body[3]) {
    const bst_mount_status *mount = problem->mount;
    double present[BST_MOUNT_AXES], angle[3][BST_MOUNT_AXES], ways[2][BST_MOUNT_AXES];
    for (int i = 0; i < BST_MOUNT_AXES; i++) {
        present[i] = mount->axis[i].redundant ? 0.0 : mount->axis[i].angle_rad;
    }
    if (!bst_mount_nearest(mount, body[1], present, angle[1])) {
        return BST_REACH_TRAVEL;
    }
    for (int k = 0; k <= 2; k += 2) {
        if (bst_mount_angles(mount, body[k], angle[1], ways) == 0) {
            return BST_REACH_TRAVEL;
        }
        for (int i = 0; i < BST_MOUNT_AXES; i++) {
            angle[k][i] = ways[0][i];
        }
    }
    double sky = bst_vec3_norm(bst_vec3_sub(body[2], body[0])) / (2.0 * HALF_S);
    bst_pointing_feasibility worst = BST_REACH_OK;
    for (int i = 0; i < mount->axes; i++) {
        double share = problem->limit_fraction, limit = share * mount->axis[i].rate_limit_radps;
        double hard = share * mount->axis[i].accel_limit_radps2;
        double rate = fabs(angle[2][i] - angle[0][i]) / (2.0 * HALF_S);
        double accel = fabs(angle[2][i] - 2.0 * angle[1][i] + angle[0][i]) / (HALF_S * HALF_S);
        if (limit > 0.0 && rate > limit) {
            if (sky > limit) {
                return BST_REACH_RATE;
            }
            /* near the pole a redundant axis takes over */
            worst = has_redundant(mount) ? worst : BST_REACH_KEYHOLE;
            continue;
        }
        if (hard > 0.0 && accel > hard) {
            /* an axis much faster than the line of sight is near its pole */
            bool pole = rate > 2.0 * sky;
            if (worst == BST_REACH_OK && !(pole && has_redundant(mount))) {
                worst = pole ? BST_REACH_KEYHOLE : BST_REACH_ACCEL;
            }
        }
    }
    return worst;
}

bst_status bst_pointing_feasibility_at(bst_ctx *ctx,
                                       const bst_pointing_feasibility_problem *problem,
                                       double seconds, bst_pointing_feasibility *out) {
    bst_pointing_feasibility_look look, beside;
    BST_TRY(problem->look(problem->user, ctx, seconds, &look));
    double depth;
    *out = BST_REACH_OK;
    if (!look.valid) {
        *out = BST_REACH_NO_CUE;
        return BST_OK;
    }
    if (behind_earth(&look)) {
        *out = BST_REACH_BEHIND_EARTH;
        return BST_OK;
    }
    int zone = bst_keep_out_inside(look.zones, look.zone_count, look.direction_gcrf, &depth);
    if (zone >= 0) {
        *out = of_zone(look.zones[zone].kind);
        return BST_OK;
    }
    if (!problem->mount || !bst_mount_steers(problem->mount)) {
        return BST_OK;
    }
    bst_vec3 body[3] = {[1] = in_body(&look)};
    for (int k = 0; k <= 2; k += 2) {
        BST_TRY(problem->look(problem->user, ctx, seconds + (k - 1) * HALF_S, &beside));
        body[k] = in_body(beside.valid ? &beside : &look);
    }
    *out = check_axis_limits(problem, body);
    return BST_OK;
}

bst_status bst_pointing_feasibility_next(bst_ctx *ctx,
                                         const bst_pointing_feasibility_problem *problem,
                                         const bst_pointing_feasibility_search *search,
                                         bst_pointing_feasibility_change *out) {
    const bool wanted = search->wanted;
    const double end = search->from_s + search->horizon_s;
    double before = search->from_s;
    *out = (bst_pointing_feasibility_change){.found = false};
    for (double at = search->from_s;; at = fmin(at + search->step_s, end)) {
        bst_pointing_feasibility reach;
        BST_TRY(bst_pointing_feasibility_at(ctx, problem, at, &reach));
        if ((reach == BST_REACH_OK) != wanted) {
            if (at >= end) {
                return BST_OK;
            }
            before = at;
            continue;
        }
        while (at - before > FOUND_TO_S) {
            double middle = 0.5 * (before + at);
            bst_pointing_feasibility there;
            BST_TRY(bst_pointing_feasibility_at(ctx, problem, middle, &there));
            if ((there == BST_REACH_OK) == wanted) {
                at = middle;
                reach = there;
            } else {
                before = middle;
            }
        }
        *out = (bst_pointing_feasibility_change){true, at, reach};
        return BST_OK;
    }
}

/* ---- Simulated pursuit ---- */

#define CHASE_STEP_S 0.01
#define CHASE_EVERY 5 /* steps between two predictions; angles are linear in between */

typedef struct follower {
    double angle, rate;
} follower;

static double clamped(double x, double limit) {
    return fmax(fmin(x, limit), -limit);
}

/* One step of an axis towards a target at `to` with rate `to_rate` at the step's end. */
static void step_axis(follower *f, const bst_mount_axis *axis, double share, double to,
                      double to_rate) {
    const double gain = 10.0, h = CHASE_STEP_S; /* 1/s, near the target */
    double hard = axis->accel_limit_radps2 > 0.0 ? share * axis->accel_limit_radps2 : INFINITY;
    double limit = axis->rate_limit_radps > 0.0 ? share * axis->rate_limit_radps : INFINITY;
    if (isinf(hard)) {
        f->rate = clamped(to_rate + (to - f->angle) / h, limit);
        f->angle += f->rate * h;
        return;
    }
    double d = f->angle - (to - to_rate * h), brake = 0.8 * hard, linear = brake / (gain * gain);
    double approach =
        fabs(d) <= linear ? gain * fabs(d) : sqrt(2.0 * brake * (fabs(d) - 0.5 * linear));
    double wanted = clamped(to_rate - copysign(approach, d), limit);
    double accel = clamped((wanted - f->rate) / h, hard);
    f->angle += f->rate * h + 0.5 * accel * h * h;
    f->rate += accel * h;
}

/* Target angles and rates of the axes at a time. */
static bst_status target_angles(bst_ctx *ctx, const bst_pointing_feasibility_problem *problem,
                                double seconds, const follower *now, double to[], bst_vec3 *body,
                                bool *valid) {
    bst_pointing_feasibility_look look;
    double near[BST_MOUNT_AXES];
    BST_TRY(problem->look(problem->user, ctx, seconds, &look));
    for (int i = 0; i < BST_MOUNT_AXES; i++) {
        near[i] = now[i].angle;
    }
    *body = in_body(&look);
    *valid = look.valid && bst_mount_nearest(problem->mount, *body, near, to);
    return BST_OK;
}

bst_status bst_pointing_feasibility_chase(bst_ctx *ctx,
                                          const bst_pointing_feasibility_problem *problem,
                                          const bst_pointing_feasibility_span *span,
                                          bst_pointing_feasibility_loss *losses, int most,
                                          int *count) {
    const bst_mount_status *mount = problem->mount;
    const double from_s = span->from_s;
    *count = 0;
    if (!mount || !bst_mount_steers(mount) || has_redundant(mount) || most < 1) {
        return BST_OK;
    }
    follower axes[BST_MOUNT_AXES] = {{0.0, 0.0}};
    for (int i = 0; i < mount->axes; i++) {
        axes[i].angle = mount->axis[i].angle_rad;
    }
    double to[BST_MOUNT_AXES], next[BST_MOUNT_AXES];
    bst_vec3 body, body_next;
    bool valid, valid_next, lost = false, started = false;
    const double look_s = CHASE_STEP_S * CHASE_EVERY;
    BST_TRY(target_angles(ctx, problem, from_s, axes, to, &body, &valid));
    for (int64_t n = 0; from_s + (double)n * look_s < span->until_s; n++) {
        double at = from_s + (double)n * look_s;
        BST_TRY(target_angles(ctx, problem, at + look_s, axes, next, &body_next, &valid_next));
        for (int i = 0; i < mount->axes && valid && valid_next; i++) {
            /* `to` and `next` in the same turn */
            to[i] -= 2.0 * BST_PI * round((to[i] - next[i]) / (2.0 * BST_PI));
        }
        for (int k = 1; k <= CHASE_EVERY && valid && valid_next; k++) {
            double share = (double)k / CHASE_EVERY;
            double angle[BST_MOUNT_AXES] = {0.0};
            for (int i = 0; i < mount->axes; i++) {
                double rate = (next[i] - to[i]) / look_s;
                double goal = to[i] + share * (next[i] - to[i]);
                if (!started) {
                    axes[i] = (follower){to[i] + share * (next[i] - to[i]), rate};
                } else {
                    step_axis(&axes[i], &mount->axis[i], problem->limit_fraction, goal, rate);
                }
                angle[i] = axes[i].angle;
            }
            started = true;
            bst_vec3 wanted = bst_vec3_axpy(bst_vec3_scale(body, 1.0 - share), share, body_next);
            double off = bst_vec3_angle(bst_mount_boresight(mount, angle), wanted);
            double t = at + k * CHASE_STEP_S;
            if (off > span->tolerance_rad && !lost && *count < most) {
                losses[(*count)++] = (bst_pointing_feasibility_loss){t, INFINITY, off};
                lost = true;
            } else if (off <= span->tolerance_rad && lost) {
                losses[*count - 1].until_s = t;
                lost = false;
            }
            if (lost) {
                losses[*count - 1].worst_rad = fmax(losses[*count - 1].worst_rad, off);
            }
        }
        if (*count == most && !lost) {
            return BST_OK;
        }
        for (int i = 0; i < BST_MOUNT_AXES; i++) {
            to[i] = next[i];
        }
        body = body_next;
        valid = valid_next;
    }
    return BST_OK;
}
