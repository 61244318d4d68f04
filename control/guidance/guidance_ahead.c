/* Look-ahead of guidance: predicts loss of the aim by limits, keep-out cones and occultation. */
#include <assert.h>
#include <stdio.h>

#include "control/guidance/guidance.h"
#include "sim/astro/bodies.h"
#include "sim/astro/kepler.h"

/* Limits of the look-ahead step, which is a thousandth of the interval. */
#define LEAST_STEP_S 1.0
#define MOST_STEP_S 10.0
/* Run-up of the simulated pursuit before a limit is met, when the mount is still on its target. */
#define RUN_UP_S 5.0
/* A predicted loss is reported again if it moves by more than this share of its length. */
#define CHANGED 0.1

typedef struct looking {
    bst_guidance *g;
    int64_t tick; /* now; seconds count from it */
} looking;

/* Prediction of aim, observer and body for the feasibility test (callback). */
static bst_status look(void *user, bst_ctx *ctx, double seconds,
                       bst_pointing_feasibility_look *out) {
    const looking *l = user;
    bst_guidance *g = l->g;
    int64_t tick = l->tick + (int64_t)llround(seconds * g->env.tick_rate_hz);
    *out = (bst_pointing_feasibility_look){.valid = false};
    BST_TRY(g->env.aim(g->env.user, ctx, tick, &out->valid, &out->direction_gcrf));
    if (!out->valid) {
        return BST_OK;
    }
    if (g->env.range) {
        BST_TRY(g->env.range(g->env.user, ctx, tick, &out->range_m));
    }
    bst_ctx quiet = {0}; /* telemetry that is no orbit is no failure of the run */
    bst_nav_telemetry nav = g->nav;
    double ahead = (double)(tick - nav.tick) / g->env.tick_rate_hz;
    if (bst_kepler_propagate(&quiet, BST_EARTH_MU_M3PS2, g->nav.position_gcrf_m,
                             g->nav.velocity_gcrf_mps, ahead, &nav.position_gcrf_m,
                             &nav.velocity_gcrf_mps) != BST_OK) {
        nav.position_gcrf_m = g->nav.position_gcrf_m;
    }
    out->position_m = nav.position_gcrf_m;
    out->q_body_from_gcrf = g->mount_known ? bst_guidance_body(g, tick) : BST_QUAT_IDENTITY;
    out->zone_count = bst_guidance_zones(g, &nav, out->zones);
    return BST_OK;
}

/* Appends a look-ahead event. */
static void add_event(bst_guidance *g, int kind, int reason, double from_s, double until_s) {
    if (g->event_count < BST_GUIDANCE_EVENTS) {
        g->events[g->event_count++] = (bst_guidance_event){
            .kind = kind, .reason = reason, .from_s = from_s, .until_s = until_s};
    }
}

/* True if a predicted time has changed by more than CHANGED of the loss's length. */
static bool moved(double a, double b, double span) {
    return isinf(a) != isinf(b) || (isfinite(a) && fabs(a - b) > CHANGED * span);
}

/* Reports a predicted loss at `from` (seconds from now) unless it is already reported. */
static void report_loss(bst_guidance *g, double now_s, int kind, int reason, double from,
                        double until) {
    double span = isfinite(until) ? until - from : 10.0;
    if (moved(now_s + from, g->told_from_s, span) || moved(now_s + until, g->told_until_s, span)) {
        g->told_from_s = now_s + from;
        g->told_until_s = now_s + until;
        add_event(g, kind, reason, g->told_from_s, g->told_until_s);
    }
}

bst_status bst_guidance_look_ahead(bst_ctx *ctx, bst_guidance *g, int64_t tick) {
    looking user = {g, tick};
    const bst_pointing_feasibility_problem problem = {.look = look,
                                                      .user = &user,
                                                      .mount = g->mount_known ? &g->mount : NULL,
                                                      .limit_fraction = g->config.limit_fraction};
    double horizon = g->config.prediction_horizon_s, now_s = (double)tick / g->env.tick_rate_hz;
    double step = fmin(fmax(1e-3 * horizon, LEAST_STEP_S), MOST_STEP_S);
    bst_pointing_feasibility reach;
    bst_pointing_feasibility_change lost, back;
    const bst_pointing_feasibility_search reached = {0.0, horizon, step, true};
    const bst_pointing_feasibility_search unreached = {0.0, horizon, step, false};
    BST_TRY(bst_pointing_feasibility_at(ctx, &problem, 0.0, &reach));
    if (reach != BST_REACH_OK) {
        if ((int)reach != g->reach) {
            BST_TRY(bst_pointing_feasibility_next(ctx, &problem, &reached, &back));
            add_event(g, BST_GUIDANCE_UNREACHABLE, (int)reach, now_s,
                      back.found ? now_s + back.when_s : INFINITY);
        }
        g->reach = (int)reach;
        return BST_OK;
    }
    if (g->reach != BST_REACH_OK) {
        add_event(g, BST_GUIDANCE_REACHABLE, g->reach, now_s, now_s);
    }
    g->reach = BST_REACH_OK;
    BST_TRY(bst_pointing_feasibility_next(ctx, &problem, &unreached, &lost));
    if (!lost.found) {
        return BST_OK;
    }
    const bst_pointing_feasibility why = lost.why;
    if (why == BST_REACH_KEYHOLE || why == BST_REACH_RATE || why == BST_REACH_ACCEL) {
        bst_pointing_feasibility_loss loss;
        int losses;
        const bst_pointing_feasibility_span span = {fmax(lost.when_s - RUN_UP_S, 0.0), horizon,
                                                    g->config.loss_tolerance_px * g->env.pixel_rad};
        BST_TRY(bst_pointing_feasibility_chase(ctx, &problem, &span, &loss, 1, &losses));
        bool rolls = false;
        const double before = g->roll_given ? g->roll_rad : g->mount.roll.angle_rad;
        if (losses > 0 && g->config.body_roll) {
            BST_TRY(bst_guidance_choose_roll(ctx, g, &problem, horizon, &rolls));
        }
        if (rolls && g->event_count < BST_GUIDANCE_EVENTS) {
            g->events[g->event_count++] = (bst_guidance_event){
                .kind = BST_GUIDANCE_ROLL, .reason = (int)why, .length_rad = g->roll_rad - before};
        } else if (losses > 0) {
            report_loss(g, now_s, BST_GUIDANCE_LOSS, (int)why, loss.from_s, loss.until_s);
        }
        return BST_OK;
    }
    const bst_pointing_feasibility_search again = {lost.when_s, horizon, step, true};
    BST_TRY(bst_pointing_feasibility_next(ctx, &problem, &again, &back));
    report_loss(g, now_s, BST_GUIDANCE_AHEAD, (int)why, lost.when_s,
                back.found ? back.when_s : INFINITY);
    return BST_OK;
}

void bst_guidance_describe(const bst_guidance_event *event, char *text, size_t bytes) {
    assert(event && text && bytes > 0);
    char until[48] = "for as long as is looked ahead";
    const char *why = bst_pointing_feasibility_reason(event->reason);
    if (isfinite(event->until_s)) {
        snprintf(until, sizeof until, "until %.1f s", event->until_s);
    }
    switch (event->kind) {
        case BST_GUIDANCE_UNREACHABLE:
            snprintf(text, bytes, "unreachable %s: %s", until, why);
            break;
        case BST_GUIDANCE_REACHABLE:
            snprintf(text, bytes, "within reach again, no longer %s", why);
            break;
        case BST_GUIDANCE_AHEAD:
            snprintf(text, bytes, "unreachable from %.1f s %s: %s", event->from_s, until, why);
            break;
        case BST_GUIDANCE_LOSS:
            snprintf(text, bytes, "will be lost from %.1f s %s: %s", event->from_s, until, why);
            break;
        case BST_GUIDANCE_DETOUR:
            snprintf(text, bytes, "slew round keep-out cones by %.1f deg %s",
                     event->length_rad / BST_DEG_RAD, until);
            break;
        case BST_GUIDANCE_ROLL:
            snprintf(text, bytes, "the body rolls by %.1f deg, lest the target be %s",
                     event->length_rad / BST_DEG_RAD, why);
            break;
        default:
            snprintf(text, bytes, "keep-out cones leave no way to the aim");
            break;
    }
}
