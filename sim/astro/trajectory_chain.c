/* Integration of a trajectory in one time direction: steps, their window, checkpoints. */
#include <stdio.h>
#include <string.h>

#include "sim/astro/atmosphere.h"
#include "sim/astro/trajectory_internal.h"

#define LONGEST_STEP_S 21600.0
#define SHORTEST_STEP_S 1e-6
/* limit of the change in step size; beyond it the error estimate is unreliable */
#define LARGEST_CHANGE 4.0
/* accuracy of shadow edges and of the end, s; closer to the start of a step they do not count */
#define EDGE_S 1e-4

static bst_vec3 from_rtn(bst_vec3 r, bst_vec3 v, bst_vec3 rtn) {
    bst_vec3 radial = bst_vec3_unit(r), normal = bst_vec3_unit(bst_vec3_cross(r, v));
    bst_vec3 transverse = bst_vec3_cross(normal, radial);
    return bst_vec3_axpy(bst_vec3_axpy(bst_vec3_scale(radial, rtn.x), rtn.y, transverse), rtn.z,
                         normal);
}

/* Velocity before an impulse from that after it: the radius is the same; the transverse direction
 * follows from transverse^2 + normal^2 of the horizontal speed. */
static bst_status undo_impulse(bst_ctx *ctx, bst_vec3 r, bst_vec3 dv, bst_vec3 *v) {
    bst_vec3 radial = bst_vec3_unit(r);
    double v_radial = bst_vec3_dot(*v, radial);
    bst_vec3 flat = bst_vec3_axpy(*v, -v_radial, radial);
    double speed = bst_vec3_norm(flat), root2 = speed * speed - dv.z * dv.z;
    double after = root2 >= 0.0 ? sqrt(root2) : -1.0; /* transverse component after the burn */
    if (-after - dv.y >= 0.0) {
        after = -after; /* the burn reversed the direction of a slower orbit */
    }
    if (!(root2 >= 0.0) || !(after - dv.y >= 0.0) || !(speed > 0.0)) {
        return bst_fail(ctx, BST_ERR_NUMERIC, "no orbit before a burn leads to the one after it");
    }
    bst_vec3 along = bst_vec3_scale(flat, 1.0 / speed), aside = bst_vec3_cross(radial, along);
    double c = after / speed, s = dv.z / speed;
    bst_vec3 transverse = bst_vec3_axpy(bst_vec3_scale(along, c), -s, aside);
    *v = bst_vec3_axpy(bst_vec3_scale(radial, v_radial - dv.x), after - dv.y, transverse);
    return BST_OK;
}

/* Velocity after an impulsive manoeuvre given in the RTN frame. */
static bst_vec3 kick(const bst_radau_point *p, bst_vec3 dv_rtn) {
    return bst_vec3_add(p->velocity_mps, from_rtn(p->position_m, p->velocity_mps, dv_rtn));
}

/* Applies the edge (burn start or end) at the current time. */
static bst_status cross_edge(bst_ctx *ctx, const bst_trajectory_chain_context *context,
                             double direction, bst_trajectory_chain_point *p) {
    const bst_trajectory_edge *edge = &context->edges->items[p->edge];
    const bst_vec3 *impulses = context->edges->impulses_rtn_mps + edge->first_impulse;
    for (int i = 0; i < edge->impulse_count; i++) {
        if (direction > 0.0) {
            p->motion.velocity_mps = kick(&p->motion, impulses[i]);
        } else {
            BST_TRY(undo_impulse(ctx, p->motion.position_m, impulses[edge->impulse_count - 1 - i],
                                 &p->motion.velocity_mps));
        }
    }
    p->edge += direction > 0.0 ? 1 : -1;
    p->motion.h_s = 0.0; /* restart the prediction after a discontinuity */
    return BST_OK;
}

/* True if the point lies at a thrust edge: start or end of a burn, or an impulse. */
static bool at_edge(const bst_trajectory_chain_context *context,
                    const bst_trajectory_chain_point *p) {
    return p->edge >= 0 && p->edge < context->edges->count &&
           context->edges->items[p->edge].time_s == p->time_s && p->time_low_s == 0.0;
}

/* Thrust acceleration in the RTN frame after the last edge. */
static bst_vec3 thrust_now(const bst_trajectory_chain_context *context, double direction,
                           const bst_trajectory_chain_point *p) {
    int last = direction > 0.0 ? p->edge - 1 : p->edge; /* the previous edge */
    return last >= 0 && last < context->edges->count ? context->edges->items[last].thrust_rtn_mps2
                                                     : (bst_vec3){0.0, 0.0, 0.0};
}

/* Ends the integration with its reason. */
static void end_chain(bst_trajectory_chain *chain, double at_s, bst_status why,
                      const char *message) {
    chain->ended = true;
    chain->end_s = at_s;
    chain->end_step = chain->here.step;
    chain->why = why;
    snprintf(chain->message, sizeof chain->message, "%.255s", message);
}

void bst_trajectory_chain_start(bst_trajectory_chain *chain,
                                const bst_trajectory_chain_context *context, double direction,
                                double at_s, bst_vec3 position_m, bst_vec3 velocity_mps) {
    memset(chain, 0, sizeof *chain);
    chain->direction = direction;
    chain->stride = BST_CHAIN_WINDOW / 2;
    bst_trajectory_chain_point *p = &chain->here;
    p->time_s = at_s;
    p->motion.position_m = position_m;
    p->motion.velocity_mps = velocity_mps;
    const bst_trajectory_edges *edges = context->edges;
    while (p->edge < edges->count && edges->items[p->edge].time_s < at_s) {
        p->edge++;
    }
    if (direction > 0.0) {
        if (at_edge(context, p)) {
            (void)cross_edge(NULL, context, direction, p); /* forward it cannot fail */
        }
    } else {
        p->edge--;
    }
    /* one twentieth of the time scales of free fall and fly-by */
    double r = bst_vec3_norm(position_m), v = bst_vec3_norm(velocity_mps);
    double fall = sqrt(r * r * r / 3.986e14);
    p->h_s = direction * fmin(0.05 * (v > 0.0 ? fmin(fall, r / v) : fall), LONGEST_STEP_S);
    chain->furthest = *p;
}

/* Context of the force callback. */
typedef struct step_forces {
    bst_ctx *ctx;
    bst_trajectory_chain_context *context;
    double time_s, time_low_s;
    bst_vec3 thrust_rtn;
} step_forces;

/* Acceleration of the spacecraft: force model and thrust. */
static bst_status force(void *user, double offset_s, bst_vec3 r, bst_vec3 v, bst_vec3 *a) {
    step_forces *f = user;
    BST_TRY(
        bst_forces_at(f->ctx, f->context->forces, f->time_s + (f->time_low_s + offset_s), r, v, a));
    const bst_vec3 *t = &f->thrust_rtn;
    if (t->x != 0.0 || t->y != 0.0 || t->z != 0.0) {
        *a = bst_vec3_add(*a, from_rtn(r, v, *t));
    }
    return BST_OK;
}

/* Illumination of the spacecraft: 0 umbra, 1 penumbra, 2 full sunlight. */
static int light_zone(const step_forces *f, const bst_radau_step *step, double s) {
    bst_vec3 r;
    bst_radau_state(step, s, &r, NULL);
    double sunlight =
        bst_forces_sunlight(f->context->forces, f->time_s + (f->time_low_s + s * step->h_s), r);
    return sunlight <= 0.0 ? 0 : sunlight < 1.0 ? 1 : 2;
}

/* True if the orbit is below the lowest height within a step. */
static bool below_floor(const bst_radau_step *step, double s) {
    bst_vec3 r;
    bst_radau_state(step, s, &r, NULL);
    /* uses GCRF's pole instead of the Earth's: an error of 0.1 km at most */
    return !(bst_astro_height_m(r) >= BST_TRAJECTORY_FLOOR_M);
}

/* First time between s = low and high at which zone() differs from its value at low, accurate to
 * EDGE_S. */
static double bisect(const step_forces *f, const bst_radau_step *step, double low, double high,
                     bool light) {
    int at_low = light ? light_zone(f, step, low) : below_floor(step, low);
    while ((high - low) * fabs(step->h_s) > EDGE_S) {
        double middle = 0.5 * (low + high);
        if (middle <= low || middle >= high) {
            break;
        }
        int now = light ? light_zone(f, step, middle) : below_floor(step, middle);
        if (now == at_low) {
            low = middle;
        } else {
            high = middle;
        }
    }
    return high;
}

/* First change of illumination within a step, as s; 1: none. A change at the start is the edge at
 * which the step began. */
static double shadow_edge(const step_forces *f, const bst_radau_step *step) {
    double before = 0.0;
    int zone = light_zone(f, step, 0.0);
    for (int i = 1; i <= BST_RADAU_TERMS + 1; i++) {
        double s = i <= BST_RADAU_TERMS ? bst_radau_node[i] : 1.0;
        while (light_zone(f, step, s) != zone) {
            double edge = bisect(f, step, before, s, true);
            if (edge * fabs(step->h_s) > 4.0 * EDGE_S) {
                return edge;
            }
            before = edge;
            zone = light_zone(f, step, edge);
        }
        before = s;
    }
    return 1.0;
}

/* First time within a step at which the orbit is below the floor, as s; 2: never. */
static double floor_crossing(const step_forces *f, const bst_radau_step *step) {
    double before = 0.0;
    for (int i = 1; i <= BST_RADAU_TERMS + 1; i++) {
        double s = i <= BST_RADAU_TERMS ? bst_radau_node[i] : 1.0;
        if (below_floor(step, s)) {
            return bisect(f, step, before, s, false);
        }
        before = s;
    }
    return 2.0;
}

/* Stores checkpoints at equal numbers of steps; when the array is full, every second one is
 * dropped. */
static void keep_checkpoint(bst_trajectory_chain *chain) {
    if (chain->here.step != chain->way_count * chain->stride) {
        return;
    }
    if (chain->way_count == BST_CHAIN_WAY_POINTS) {
        for (int i = 0; i < BST_CHAIN_WAY_POINTS / 2; i++) {
            chain->way[i] = chain->way[2 * i];
        }
        chain->way_count = BST_CHAIN_WAY_POINTS / 2;
        chain->stride *= 2;
    }
    chain->way[chain->way_count++] = chain->here;
}

/* Result of a step. */
typedef struct step_end {
    double next_h_s; /* proposed size of the next step */
    bool to_edge;    /* it ends at the start or end of a burn */
    double
        floor_s; /* fraction of the step after which the path is below the floor; above 1: never */
} step_end;

/* Computes a step limited by force evaluation, error and shadow edges. */
static bst_status work_step(bst_ctx *ctx, bst_trajectory_chain *chain,
                            bst_trajectory_chain_context *context,
                            const bst_trajectory_chain_point *p, bst_radau_step *step,
                            step_end *end) {
    step_forces f = {ctx, context, p->time_s, p->time_low_s,
                     thrust_now(context, chain->direction, p)};
    double h = p->h_s, h_natural = 0.0; /* step size to try after a shadow edge */
    bool edge_found = false;
    for (;;) {
        end->to_edge = false;
        if (p->edge >= 0 && p->edge < context->edges->count) {
            double left = (context->edges->items[p->edge].time_s - p->time_s) - p->time_low_s;
            if (fabs(h) >= fabs(left)) {
                h_natural = h_natural != 0.0 ? h_natural : h;
                h = left;
                end->to_edge = true;
            }
        }
        double error;
        bst_status status = bst_radau_try(context->radau, &p->motion, h, force, &f, step, &error);
        if (status != BST_OK && status != BST_ERR_RANGE) {
            return status;
        }
        /* the error scales with the seventh power of the step (Rein and Spiegel, equation 11) */
        double change = status != BST_OK || !(error < INFINITY)
                            ? 1.0 / LARGEST_CHANGE
                            : pow(context->tolerance / fmax(error, 1e-300), 1.0 / 7.0);
        change = fmin(change, LARGEST_CHANGE);
        if (!(change > 1.0 / LARGEST_CHANGE)) {
            h *= 1.0 / LARGEST_CHANGE;
            h_natural = 0.0;
            edge_found = false;
            if (!(fabs(h) > SHORTEST_STEP_S)) {
                return status != BST_OK ? status
                                        : bst_fail(ctx, BST_ERR_NUMERIC,
                                                   "no step of the integration is short enough");
            }
            continue;
        }
        double s = edge_found ? 1.0 : shadow_edge(&f, step);
        if (s < 1.0) {
            h_natural = fmax(change, 1.0) * h;
            h *= s;
            edge_found = true;
            continue;
        }
        double longer = h * change;
        longer = fabs(h_natural) > fabs(longer) ? h_natural : longer;
        end->next_h_s = chain->direction * fmin(fabs(longer), LONGEST_STEP_S);
        end->floor_s = floor_crossing(&f, step);
        return BST_OK;
    }
}

/* Adds one step, or ends the chain. */
static void extend(bst_ctx *ctx, bst_trajectory_chain *chain,
                   bst_trajectory_chain_context *context) {
    bst_trajectory_chain_point *p = &chain->here;
    keep_checkpoint(chain);
    step_end end = {.floor_s = 2.0};
    bst_radau_step motion;
    bst_status status = work_step(ctx, chain, context, p, &motion, &end);
    if (status != BST_OK) {
        end_chain(chain, p->time_s, status, ctx->message);
        return;
    }
    bst_trajectory_chain_step *kept = &chain->window[p->step % BST_CHAIN_WINDOW];
    if (p->step - chain->first_kept == BST_CHAIN_WINDOW) {
        chain->first_kept++;
    }
    kept->motion = motion;
    kept->time_s = p->time_s;
    kept->time_low_s = p->time_low_s;
    if (end.to_edge) {
        p->time_s = context->edges->items[p->edge].time_s;
        p->time_low_s = 0.0;
    } else {
        double sum = p->time_s + motion.h_s;
        double low = fabs(p->time_s) >= fabs(motion.h_s) ? (p->time_s - sum) + motion.h_s
                                                         : (motion.h_s - sum) + p->time_s;
        low += p->time_low_s;
        p->time_s = sum + low;
        p->time_low_s = low - (p->time_s - sum);
    }
    kept->end_s = p->time_s;
    bst_radau_advance(&p->motion, &motion);
    p->h_s = end.next_h_s;
    p->step++;
    if (end.floor_s <= 1.0) {
        char text[160];
        double floor_at_s = kept->time_s + (kept->time_low_s + end.floor_s * motion.h_s);
        snprintf(text, sizeof text, "the orbit passes below %.0f km, %.1f s after the epoch",
                 1e-3 * BST_TRAJECTORY_FLOOR_M, floor_at_s);
        end_chain(chain, floor_at_s, BST_ERR_NUMERIC, text);
    } else if (at_edge(context, p)) {
        status = cross_edge(ctx, context, chain->direction, p);
        if (status != BST_OK) {
            end_chain(chain, p->time_s, status, ctx->message);
        }
    }
    if (p->step > chain->furthest.step) {
        chain->furthest = *p;
    }
}

/* Checks whether `seconds` is before a point of the chain (at it: forward no, backward yes, because
 * the state at a burn is that after it). */
static bool before(const bst_trajectory_chain *chain, double seconds, double point_s) {
    return chain->direction > 0.0 ? seconds < point_s : seconds >= point_s;
}

/* Moves to the latest stored point before `seconds`. */
static void stand_before(bst_trajectory_chain *chain, double seconds) {
    const bst_trajectory_chain_point *best = NULL;
    for (int i = 0; i < chain->way_count; i++) {
        if (i == 0 || !before(chain, seconds, chain->way[i].time_s)) {
            best = &chain->way[i];
        }
    }
    if (!before(chain, seconds, chain->furthest.time_s)) {
        best = &chain->furthest;
    }
    bool behind = before(chain, seconds, chain->here.time_s);
    if (best && (behind || best->step > chain->here.step)) {
        chain->here = *best;
        chain->first_kept = best->step;
    }
}

bst_status bst_trajectory_chain_find(bst_ctx *ctx, bst_trajectory_chain *chain,
                                     bst_trajectory_chain_context *context, double seconds,
                                     const bst_trajectory_chain_step **out) {
    bool kept = chain->here.step > chain->first_kept &&
                before(chain, seconds, chain->here.time_s) &&
                !before(chain, seconds, chain->window[chain->first_kept % BST_CHAIN_WINDOW].time_s);
    if (!kept && !(chain->ended && !before(chain, seconds, chain->end_s))) {
        bst_ctx own = {0};
        stand_before(chain, seconds);
        do {
            extend(&own, chain, context);
        } while (!before(chain, seconds, chain->here.time_s) &&
                 !(chain->ended && chain->here.step >= chain->end_step));
    }
    if (chain->ended && !before(chain, seconds, chain->end_s)) {
        return bst_fail(ctx, chain->why, "%s", chain->message);
    }
    int64_t low = chain->first_kept, high = chain->here.step - 1;
    while (low < high) { /* finds the first step that ends after it */
        int64_t middle = low + (high - low) / 2;
        if (before(chain, seconds, chain->window[middle % BST_CHAIN_WINDOW].end_s)) {
            high = middle;
        } else {
            low = middle + 1;
        }
    }
    *out = &chain->window[low % BST_CHAIN_WINDOW];
    return BST_OK;
}
