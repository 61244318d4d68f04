#include "control/guidance/guidance.h"

/* Margin added to keep-out cones for planning: aberration, and overshoot of mounts. */
#include <assert.h>
#include "sim/core/invariant.h"
#define WIDER_RAD (0.05 * BST_DEG_RAD)
/* Half the interval of the differences that give a slew's rate and acceleration. */
#define DIFFERENCE_S 0.01
/* Samples along an axis motion that are checked against keep-out cones, and nodes of a path. */
#define SAMPLES 96
#define PATH_NODES 385
/* Share of limit_fraction used along paths: limits hold at the nodes, and between them to a few
 * percent. */
#define PATH_SHARE 0.9
/* Angular distance after which the mount angles that select the solution are recomputed. */
#define NEAR_RAD 1e-4
/* Number of future directions by which a mount solution is chosen. */
#define COMING 256

void bst_guidance_init(bst_guidance *g, const bst_guidance_config *config,
                       const bst_guidance_env *env) {
    assert(g && config && env);
    *g = (bst_guidance){
        .config = *config, .env = *env, .told_from_s = INFINITY, .told_until_s = INFINITY};
}

/* True if the numbers by which arrays of a slew are accessed are in range. */
static bool is_intact_slew(const bst_guidance_slew *slew) {
    return slew->path.count >= 0 && slew->path.count <= BST_PATH_ARCS && slew->speed.count >= 0 &&
           slew->speed.count <= BST_SLEW_NODES && (!slew->along_path || slew->speed.count >= 2);
}

/* Saves or restores the slew in progress; none: all zero. */
static bst_status archive_slew(bst_guidance_slew *slew, bst_archive *archive) {
    bool active = slew->active;
    bst_archive_bool(archive, &active);
    if (active) {
        BST_ARCHIVE(archive, *slew);
    }
    if (!active && bst_archive_is_restoring(archive)) {
        *slew = (bst_guidance_slew){.active = false};
    }
    return is_intact_slew(slew)
               ? BST_OK
               : bst_fail(bst_archive_ctx(archive), BST_ERR_FORMAT,
                          "the saved slew of the guidance is damaged: %d arcs, %d nodes",
                          slew->path.count, slew->speed.count);
}

/* Sets the keep-out cones from `nav`. */
static void set_zones(bst_guidance *g) {
    g->zone_count = bst_guidance_zones(g, &g->nav, g->zones);
    for (int i = 0; i < g->zone_count; i++) {
        double *half = &g->zones[i].half_angle_rad;
        *half = fmin(*half + WIDER_RAD, BST_PI - 1e-6);
    }
}

/* `nodes` is the work space of one plan. */
bst_status bst_guidance_archive(bst_guidance *g, bst_archive *archive) {
    BST_ARCHIVE(archive, g->mount);
    bst_archive_bool(archive, &g->mount_known);
    BST_ARCHIVE(archive, g->nav);
    bst_archive_bool(archive, &g->nav_known);
    bst_archive_bool(archive, &g->commanded);
    BST_ARCHIVE(archive, g->last);
    BST_TRY(archive_slew(&g->slew, archive));
    bst_archive_bool(archive, &g->near_known);
    BST_ARCHIVE(archive, g->near_rad);
    BST_ARCHIVE(archive, g->near_body);
    g->reach = (int)bst_archive_integer(archive, g->reach, 0, BST_REACH_COUNT - 1);
    bst_archive_bool(archive, &g->no_way);
    BST_ARCHIVE(archive, g->ahead_tick);
    bst_archive_bool(archive, &g->roll_given);
    BST_ARCHIVE(archive, g->roll_rad);
    BST_ARCHIVE(archive, g->told_from_s);
    BST_ARCHIVE(archive, g->told_until_s);
    if (bst_archive_is_restoring(archive)) {
        g->event_count = g->zone_count = 0;
        if (g->nav_known) {
            set_zones(g);
        }
    }
    return g->mount.axes >= 0 && g->mount.axes <= BST_MOUNT_AXES
               ? BST_OK
               : bst_fail(bst_archive_ctx(archive), BST_ERR_FORMAT,
                          "the saved mount of the guidance has %d axes, 0 to %d are allowed",
                          (int)g->mount.axes, BST_MOUNT_AXES);
}

void bst_guidance_telemetry(bst_guidance *g, const bst_mount_status *mount) {
    if (mount) {
        g->mount = *mount;
        g->mount_known = true;
    }
}

/* Appends a guidance event. */
static void add_event(bst_guidance *g, bst_guidance_event event) {
    if (g->event_count < BST_GUIDANCE_EVENTS) {
        g->events[g->event_count++] = event;
    }
}

/* True if two unit vectors are farther apart than an angle of up to 1 rad; the chord decides most
 * cases. */
static bool is_beyond(bst_vec3 a, bst_vec3 b, double angle_rad) {
    bst_vec3 chord = bst_vec3_sub(a, b);
    return !(bst_vec3_dot(chord, chord) < 0.9 * angle_rad * angle_rad) &&
           bst_vec3_angle(a, b) > angle_rad;
}

/* Direction after `seconds` at a constant rate. */
static bst_vec3 unit_after(bst_vec3 d, bst_vec3 rate, double seconds) {
    return bst_vec3_unit(bst_vec3_axpy(d, seconds, rate));
}

/* ---- Slews ---- */

/* Commanded direction of the current slew, `seconds` after its start. */
static bst_vec3 slew_at(const bst_guidance *g, double seconds, double near_rad[BST_MOUNT_AXES]) {
    const bst_guidance_slew *slew = &g->slew;
    double s, rate, accel, angle[BST_MOUNT_AXES] = {0.0};
    bst_vec3 tangent, bend;
    if (slew->along_path) {
        bst_slew_path_at(&slew->speed, seconds, &s, &rate, &accel);
        return bst_keep_out_route_at(&slew->path, s, &tangent, &bend);
    }
    for (int i = 0; i < g->mount.axes; i++) {
        bst_slew_axis_at(&slew->axis[i], seconds, &angle[i], &rate, &accel);
        if (near_rad) {
            near_rad[i] = angle[i];
        }
    }
    int64_t tick = slew->start_tick + (int64_t)llround(seconds * g->env.tick_rate_hz);
    return bst_quat_rotate(bst_quat_conj(bst_guidance_body(g, tick)),
                           bst_mount_boresight(&g->mount, angle));
}

/* End angles of a slew: the solution and whole turn that serve the coming directions, if look-ahead
 * is on. */
static bst_status target_angles(bst_ctx *ctx, const bst_guidance *g, int64_t tick,
                                bst_vec3 direction, const double present[],
                                double angle[BST_MOUNT_AXES], bool *found) {
    bst_vec3 coming[COMING] = {bst_quat_rotate(bst_guidance_body(g, tick), direction)};
    int count = 1;
    double step = g->config.prediction_horizon_s / (COMING - 1);
    for (; g->config.prediction_horizon_s > 0.0 && count < COMING; count++) {
        int64_t then = tick + (int64_t)llround(count * step * g->env.tick_rate_hz);
        bool valid;
        BST_TRY(g->env.aim(g->env.user, ctx, then, &valid, &direction));
        if (!valid) {
            break;
        }
        coming[count] = bst_quat_rotate(bst_guidance_body(g, then), direction);
    }
    bst_mount_status mount = g->mount;
    for (int i = 0; i < mount.axes; i++) {
        mount.axis[i].angle_rad = present[i];
    }
    bst_mount_turn_choice choice;
    *found = bst_mount_choose_turn(&mount, coming, count, &choice);
    for (int i = 0; *found && i < BST_MOUNT_AXES; i++) {
        angle[i] = choice.angle_rad[i];
    }
    return BST_OK;
}

/* Aim at the end of a slew, and its rate. */
typedef struct aim {
    bool valid;
    bst_vec3 direction, rate_radps;
} aim;

/* Aim at a tick, moved out of keep-out cones. */
static bst_status aim_at(bst_ctx *ctx, const bst_guidance *g, int64_t tick, bst_vec3 towards,
                         aim *out) {
    int64_t half = (int64_t)llround(0.1 * g->env.tick_rate_hz);
    half = half > 0 ? half : 1;
    bst_vec3 ahead, behind, free;
    bool both[2];
    BST_TRY(g->env.aim(g->env.user, ctx, tick, &out->valid, &out->direction));
    BST_TRY(g->env.aim(g->env.user, ctx, tick + half, &both[0], &ahead));
    BST_TRY(g->env.aim(g->env.user, ctx, tick - half, &both[1], &behind));
    if (!out->valid) {
        return BST_OK;
    }
    out->rate_radps = both[0] && both[1] ? bst_vec3_scale(bst_vec3_sub(ahead, behind),
                                                          0.5 * g->env.tick_rate_hz / (double)half)
                                         : (bst_vec3){0.0, 0.0, 0.0};
    if (!bst_keep_out_nearest(g->zones, g->zone_count, out->direction, towards, &free)) {
        out->valid = false;
    } else if (bst_vec3_angle(free, out->direction) > 0.0) {
        out->direction = free;
        out->rate_radps = (bst_vec3){0.0, 0.0, 0.0};
    }
    return BST_OK;
}

/* Angles and rates of the axes from the current slew or, without one, the encoders. */
static void present_axes(const bst_guidance *g, int64_t tick, double angle[], double rate[]) {
    double since = (double)(tick - g->slew.start_tick) / g->env.tick_rate_hz;
    double dt = (double)(tick - g->mount.tick) / g->env.tick_rate_hz, accel;
    for (int i = 0; i < BST_MOUNT_AXES; i++) {
        angle[i] = rate[i] = 0.0;
        if (i < g->mount.axes && g->slew.active && !g->slew.along_path) {
            bst_slew_axis_at(&g->slew.axis[i], since, &angle[i], &rate[i], &accel);
        } else if (i < g->mount.axes) {
            rate[i] = g->mount.axis[i].rate_radps;
            angle[i] = g->mount.axis[i].angle_rad + rate[i] * dt;
        }
    }
}

/* Plans the fastest axis motion onto the moving aim. *made: false if it is impossible or would
 * cross a keep-out cone. */
static bst_status plan_axes(bst_ctx *ctx, bst_guidance *g, int64_t tick, bst_vec3 from,
                            bool *made) {
    *made = false;
    if (!g->mount_known || !bst_mount_steers(&g->mount)) {
        return BST_OK;
    }
    double angle[BST_MOUNT_AXES], rate[BST_MOUNT_AXES];
    double to[BST_MOUNT_AXES], ways[2][BST_MOUNT_AXES];
    present_axes(g, tick, angle, rate);
    bst_guidance_slew slew = {.active = true, .start_tick = tick};
    for (int round = 0; round < 4; round++) {
        int64_t arrival = tick + (int64_t)llround(slew.duration_s * g->env.tick_rate_hz);
        aim end;
        bool found;
        BST_TRY(aim_at(ctx, g, arrival, from, &end));
        if (!end.valid) {
            return BST_OK;
        }
        BST_TRY(target_angles(ctx, g, arrival, end.direction, angle, to, &found));
        bst_quat body = bst_guidance_body(g, arrival + (int64_t)(0.1 * g->env.tick_rate_hz));
        bst_vec3 next = bst_quat_rotate(body, unit_after(end.direction, end.rate_radps, 0.1));
        if (!found || bst_mount_angles(&g->mount, next, to, ways) == 0) {
            return BST_OK;
        }
        double duration = 0.0;
        slew.arrival = end.direction;
        for (int i = 0; i < g->mount.axes; i++) {
            const bst_mount_axis *axis = &g->mount.axis[i];
            double share = g->config.limit_fraction, limit = share * axis->rate_limit_radps;
            /* near the pole the aim may be faster than the axis; the axis then ends at rest */
            double moving = (ways[0][i] - to[i]) / 0.1;
            moving = limit > 0.0 && fabs(moving) > 0.9 * limit ? 0.0 : moving;
            if (!bst_slew_axis_plan(angle[i], rate[i], to[i] - moving * slew.duration_s, moving,
                                    limit, share * axis->accel_limit_radps2, &slew.axis[i])) {
                return BST_OK;
            }
            duration = fmax(duration, slew.axis[i].duration_s);
        }
        slew.duration_s = duration;
    }
    bst_guidance_slew before = g->slew;
    g->slew = slew;
    for (int k = 0; k <= SAMPLES && g->zone_count > 0; k++) {
        double depth;
        bst_vec3 d = slew_at(g, slew.duration_s * k / SAMPLES, NULL);
        if (bst_keep_out_inside(g->zones, g->zone_count, d, &depth) >= 0) {
            g->slew = before;
            return BST_OK;
        }
    }
    *made = true;
    return BST_OK;
}

/* Axis angles along a path; for a mount with unknown axes, the path itself. */
static void path_nodes(const bst_guidance *g, const bst_keep_out_route *path, int64_t tick,
                       bst_slew_nodes *nodes, bst_slew_limits *limits) {
    bool steers = g->mount_known && bst_mount_steers(&g->mount);
    double near[BST_MOUNT_AXES], rate[BST_MOUNT_AXES], ways[2][BST_MOUNT_AXES];
    bst_quat body = steers ? bst_guidance_body(g, tick) : BST_QUAT_IDENTITY;
    bst_vec3 tangent, bend, before = {0.0, 0.0, 0.0};
    present_axes(g, tick, near, rate);
    nodes->count = PATH_NODES;
    nodes->step = path->length_rad / (PATH_NODES - 1);
    *limits = (bst_slew_limits){.axes = steers ? g->mount.axes : 1};
    for (int i = 0; i < limits->axes; i++) {
        double share = PATH_SHARE * g->config.limit_fraction;
        double hard = steers ? share * g->mount.axis[i].accel_limit_radps2 : 0.0;
        limits->rate_radps[i] = steers ? share * g->mount.axis[i].rate_limit_radps : 0.0;
        limits->accel_radps2[i] = hard > 0.0 ? hard : 1.0;
    }
    for (int j = 0; j < PATH_NODES; j++) {
        bst_vec3 d = bst_keep_out_route_at(path, j * nodes->step, &tangent, &bend);
        /* An arc turns within a step only by its own curvature; near the ends, which are slow
         * anyway, the second differences of the angles suffice. */
        nodes->corner[j] = j > 2 && j < PATH_NODES - 3 && !nodes->corner[j - 1] &&
                           bst_vec3_dot(tangent, before) < 0.9;
        before = tangent;
        if (!steers) {
            nodes->angle_rad[j][0] = j * nodes->step;
            continue;
        }
        bool solved = bst_mount_nearest(&g->mount, bst_quat_rotate(body, d), near, ways[0]);
        for (int i = 0; i < BST_MOUNT_AXES; i++) {
            near[i] = solved ? ways[0][i] : near[i];
            nodes->angle_rad[j][i] = near[i];
        }
    }
}

/* Plans the shortest path around the keep-out cones, as fast as the axes allow. */
static bst_status plan_path(bst_ctx *ctx, bst_guidance *g, int64_t tick, bst_vec3 from,
                            bst_vec3 from_rate, bool *made) {
    bst_guidance_slew *slew = &g->slew;
    bst_guidance_slew before = *slew;
    double duration = 0.0;
    *made = false;
    for (int round = 0; round < 3; round++) {
        int64_t arrival = tick + (int64_t)llround(duration * g->env.tick_rate_hz);
        aim goal;
        bst_vec3 tangent, end, bend;
        bst_slew_limits limits;
        *slew = before;
        BST_TRY(aim_at(ctx, g, arrival, from, &goal));
        if (!goal.valid ||
            !bst_keep_out_path(g->zones, g->zone_count, from, goal.direction, &slew->path)) {
            *slew = before;
            return BST_OK;
        }
        if (slew->path.count == 0) {
            *slew = before;
            return BST_OK;
        }
        (void)bst_keep_out_route_at(&slew->path, 0.0, &tangent, &bend);
        (void)bst_keep_out_route_at(&slew->path, slew->path.length_rad, &end, &bend);
        path_nodes(g, &slew->path, tick, &g->nodes, &limits);
        if (!bst_slew_path_plan(&g->nodes, &limits, fmax(bst_vec3_dot(from_rate, tangent), 0.0),
                                fmax(bst_vec3_dot(goal.rate_radps, end), 0.0), &slew->speed)) {
            *slew = before;
            return BST_OK;
        }
        slew->active = slew->along_path = true;
        slew->start_tick = tick;
        slew->duration_s = duration = slew->speed.duration_s;
        slew->arrival = goal.direction;
    }
    *made = true;
    if (slew->path.count > 1) {
        add_event(g, (bst_guidance_event){.kind = BST_GUIDANCE_DETOUR,
                                          .from_s = (double)tick / g->env.tick_rate_hz,
                                          .until_s = (double)tick / g->env.tick_rate_hz + duration,
                                          .length_rad = slew->path.length_rad});
    }
    return BST_OK;
}

/* Command of the current slew at a tick. */
static void command_slew(const bst_guidance *g, int64_t tick, bst_los_command *command) {
    double t = (double)(tick - g->slew.start_tick) / g->env.tick_rate_hz, h = DIFFERENCE_S;
    double late[BST_MOUNT_AXES] = {0.0};
    *command = (bst_los_command){.tick = tick};
    bst_vec3 d = slew_at(g, t, command->near_rad);
    bst_vec3 ahead = slew_at(g, t + h, late), behind = slew_at(g, fmax(t - h, 0.0), NULL);
    double span = t + h - fmax(t - h, 0.0);
    bst_vec3 rate = bst_vec3_scale(bst_vec3_sub(ahead, behind), 1.0 / span);
    command->direction_gcrf = d;
    command->rate_gcrf_radps = bst_vec3_axpy(rate, -bst_vec3_dot(rate, d), d);
    command->near_given = !g->slew.along_path;
    for (int i = 0; i < BST_MOUNT_AXES; i++) {
        command->near_radps[i] = (late[i] - command->near_rad[i]) / h;
    }
}

/* Keeps the mount solution and whole turns that a slew has chosen. */
static void keep_mount_solution(bst_guidance *g, bst_los_command *command) {
    if (!g->near_known) {
        return;
    }
    double ways[2][BST_MOUNT_AXES];
    bst_vec3 body = bst_quat_rotate(bst_guidance_body(g, command->tick), command->direction_gcrf);
    bst_vec3 moved = bst_vec3_sub(body, g->near_body);
    /* the solution is insensitive to small changes, except for a redundant axis */
    if (g->mount.axes > 2 || bst_vec3_dot(moved, moved) > NEAR_RAD * NEAR_RAD) {
        if (bst_mount_angles(&g->mount, body, g->near_rad, ways) == 0) {
            return;
        }
        for (int i = 0; i < BST_MOUNT_AXES; i++) {
            g->near_rad[i] = ways[0][i];
        }
        g->near_body = body;
    }
    command->near_given = true;
    for (int i = 0; i < BST_MOUNT_AXES; i++) {
        command->near_rad[i] = g->near_rad[i];
    }
}

/* True if the current slew still ends on the aim. */
static bst_status still_wanted(bst_ctx *ctx, const bst_guidance *g, bst_vec3 from, bool *out) {
    int64_t arrival =
        g->slew.start_tick + (int64_t)llround(g->slew.duration_s * g->env.tick_rate_hz);
    aim now;
    BST_TRY(aim_at(ctx, g, arrival, from, &now));
    *out = now.valid && bst_vec3_angle(now.direction, g->slew.arrival) <=
                            g->config.min_planned_slew_deg * BST_DEG_RAD;
    return BST_OK;
}

/* True if there are several mount solutions or turns to choose from. */
static bool has_turn_choice(const bst_guidance *g) {
    bool matter = false;
    for (int i = 0; g->config.prediction_horizon_s > 0.0 && g->mount_known && i < g->mount.axes;
         i++) {
        matter = matter || g->mount.axis[i].max_rad - g->mount.axis[i].min_rad > 2.0 * BST_PI;
    }
    return matter;
}

/* Replaces the command by a slew's command if a slew is needed. */
static bst_status shape_command(bst_ctx *ctx, bst_guidance *g, const bst_vec3 *boresight,
                                bst_los_command *command, bool *give) {
    if (g->zone_count == 0 && g->config.slews != BST_SLEWS_PLANNED && !has_turn_choice(g)) {
        return BST_OK;
    }
    int64_t tick = command->tick;
    bst_vec3 from, from_rate = {0.0, 0.0, 0.0}, target = command->direction_gcrf;
    if (g->commanded) {
        double dt = (double)(tick - g->last.tick) / g->env.tick_rate_hz;
        from_rate = g->last.rate_gcrf_radps;
        from = unit_after(g->last.direction_gcrf, from_rate, dt);
    } else if (boresight) {
        from = *boresight;
    } else {
        *give = false;
        return BST_OK;
    }
    if (g->slew.active) {
        double t = (double)(tick - g->slew.start_tick) / g->env.tick_rate_hz;
        bool wanted;
        BST_TRY(still_wanted(ctx, g, from, &wanted));
        if (wanted && t < g->slew.duration_s) {
            command_slew(g, tick, command);
            return BST_OK;
        }
        if (wanted) {
            g->near_known = !g->slew.along_path;
            g->near_body = (bst_vec3){0.0, 0.0, 0.0};
            for (int i = 0; i < g->mount.axes && g->near_known; i++) {
                double rate, accel;
                bst_slew_axis_at(&g->slew.axis[i], t, &g->near_rad[i], &rate, &accel);
            }
            g->slew.active = false;
        }
    }
    double depth;
    bool inside = bst_keep_out_inside(g->zones, g->zone_count, target, &depth) >= 0;
    bool blocked = inside && !bst_keep_out_nearest(g->zones, g->zone_count, target, from, &target);
    bool made = false;
    if (!blocked && is_beyond(from, target, g->config.min_planned_slew_deg * BST_DEG_RAD)) {
        BST_TRY(plan_axes(ctx, g, tick, from, &made));
        if (!made) {
            BST_TRY(plan_path(ctx, g, tick, from, from_rate, &made));
        }
        blocked = !made && g->zone_count > 0;
    }
    if (blocked && !g->no_way) {
        add_event(g, (bst_guidance_event){.kind = BST_GUIDANCE_NO_WAY,
                                          .from_s = (double)tick / g->env.tick_rate_hz});
    }
    g->no_way = blocked;
    if (made) {
        command_slew(g, tick, command);
    } else if (blocked || inside) {
        *command = (bst_los_command){.tick = tick, .direction_gcrf = blocked ? from : target};
        g->slew.active = false;
    } else {
        g->slew.active = false;
        keep_mount_solution(g, command);
    }
    return BST_OK;
}

void bst_guidance_see_sky(bst_guidance *g, const bst_nav_telemetry *nav, bst_quat error) {
    g->nav = *nav;
    g->nav_known = true;
    g->nav.position_gcrf_m = bst_quat_rotate(error, nav->position_gcrf_m);
    g->nav.velocity_gcrf_mps = bst_quat_rotate(error, nav->velocity_gcrf_mps);
    g->nav.sun_m = bst_quat_rotate(error, nav->sun_m);
    g->nav.moon_m = bst_quat_rotate(error, nav->moon_m);
    set_zones(g);
}

bst_status bst_guidance_command(bst_ctx *ctx, bst_guidance *g, const bst_vec3 *boresight,
                                bst_los_command *command, bool *give) {
    assert(g && command && give && bst_is_unit_vec3(command->direction_gcrf, BST_UNIT_TOLERANCE));
    /* after the first command the boresight is not read */
    assert(!boresight || g->commanded || bst_is_unit_vec3(*boresight, BST_LINK_UNIT_TOLERANCE));
    *give = true;
    if (g->config.prediction_horizon_s > 0.0 && command->tick >= g->ahead_tick) {
        g->ahead_tick =
            command->tick + (int64_t)llround(g->config.prediction_interval_s * g->env.tick_rate_hz);
        BST_TRY(bst_guidance_look_ahead(ctx, g, command->tick));
    }
    BST_TRY(shape_command(ctx, g, boresight, command, give));
    if (*give) {
        command->roll_given = g->roll_given;
        command->roll_rad = g->roll_rad;
        g->last = *command;
        g->commanded = true;
    }
    return BST_OK;
}
