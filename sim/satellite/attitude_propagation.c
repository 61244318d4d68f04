#include "sim/satellite/attitude_propagation.h"

#include <assert.h>
#include <pthread.h>
#include <stdlib.h>

#include "sim/satellite/tumbling.h"

#define LONGEST_S 120.0 /* an orbit at the lowest height takes 5,300 s */
#define LONGEST_RAD 1.0 /* of rotation in a step */
#define SHORTEST 1e-5   /* shortest over longest step */
#define ROUNDING 1e-14  /* of attitude and rate in some hundred operations, relative */
#define DAY_S 86400.0
#define TURN_STEP_RAD 5e-3 /* Runge-Kutta: h^5 / 120 a step, 5e-12 rad a radian */
#define READ_STEP_RAD 0.02 /* between nodes: 1e-9 rad over half a step */

typedef struct motion {
    bst_quat q; /* body from GCRF */
    bst_vec3 w; /* body axes */
} motion;

/* Start of half a step. */
typedef struct node {
    double at_s, length_s;
    motion m;
    /* at the end of the half step: deviation of the body from the motion without torque, and its
     * rate, GCRF */
    bst_vec3 deviation_rad, deviation_radps;
} node;

struct bst_attitude_propagation {
    pthread_mutex_t lock;
    double inertia[3], tolerance_rad;
    bst_attitude_torque_fn torque;
    void *user;
    node *nodes; /* [count], the last one without end */
    int64_t count, room, calls;
    double next_s;      /* length of the next step to try */
    bst_vec3 torque_nm; /* at the last node, once there is more than one */
    bool ended;         /* the torque is unknown after the last node */
};

bst_status bst_attitude_propagation_create(bst_ctx *ctx, const bst_attitude_motion *start,
                                           double tolerance_rad, bst_attitude_torque_fn torque,
                                           void *user, bst_attitude_propagation **out) {
    enum { ROOM = 64 };
    bst_attitude_propagation *p = *out = calloc(1, sizeof *p);
    node *nodes = p ? calloc(ROOM, sizeof *nodes) : NULL;
    if (!nodes) {
        free(p);
        *out = NULL;
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for a rotation under torques");
    }
    pthread_mutex_init(&p->lock, NULL);
    for (int k = 0; k < 3; k++) {
        p->inertia[k] = start->inertia_kg_m2[k];
    }
    p->tolerance_rad = tolerance_rad;
    p->torque = torque;
    p->user = user;
    p->nodes = nodes;
    p->room = ROOM;
    p->count = 1;
    p->next_s = 10.0;
    nodes[0].at_s = start->start_s;
    nodes[0].m = (motion){bst_quat_unit(start->q_body_from_gcrf), start->rate_radps};
    return BST_OK;
}

void bst_attitude_propagation_free(bst_attitude_propagation *p) {
    if (p) {
        pthread_mutex_destroy(&p->lock);
        free(p->nodes);
        free(p);
    }
}

void bst_attitude_propagation_start(bst_attitude_propagation *p, bst_quat q) {
    assert(p->count == 1);
    p->nodes[0].m.q = bst_quat_unit(q);
}

static void turn(const bst_attitude_propagation *p, double seconds, double step_rad, motion *m) {
    bst_tumbling_turn(p->inertia, seconds, step_rad, &m->q, &m->w);
}

/* Torque at a time, N m; false: unknown. */
static bool torque_at(bst_attitude_propagation *p, double at_s, bst_quat q, bst_vec3 *out) {
    p->calls++;
    return p->torque(p->user, at_s, q, out) && isfinite(bst_vec3_norm(*out));
}

/* Change of the rate by a torque over some seconds. */
static void kick(const bst_attitude_propagation *p, bst_vec3 torque, double seconds, motion *m) {
    const double *i = p->inertia;
    m->w =
        bst_vec3_axpy(m->w, seconds, (bst_vec3){torque.x / i[0], torque.y / i[1], torque.z / i[2]});
}

/* Motion over h_s with impulses at start, middle and end; false: torque unknown.
 *
 * Given:     *torque_nm  at the start
 * Returned:  *torque_nm  at the end */
static bool move(bst_attitude_propagation *p, double at_s, double h_s, bst_vec3 *torque_nm,
                 motion *m) {
    kick(p, *torque_nm, h_s / 6.0, m);
    turn(p, 0.5 * h_s, TURN_STEP_RAD, m);
    if (!torque_at(p, at_s + 0.5 * h_s, m->q, torque_nm)) {
        return false;
    }
    kick(p, *torque_nm, h_s * 2.0 / 3.0, m);
    turn(p, 0.5 * h_s, TURN_STEP_RAD, m);
    if (!torque_at(p, at_s + h_s, m->q, torque_nm)) {
        return false;
    }
    kick(p, *torque_nm, h_s / 6.0, m);
    return true;
}

static bst_vec3 to_gcrf(bst_quat q_body_from_gcrf, bst_vec3 v) {
    return bst_quat_rotate(bst_quat_conj(q_body_from_gcrf), v);
}

/* Ends the last node after length_s in the motion `end`, and appends the next one. */
static void append(bst_attitude_propagation *p, double length_s, const motion *end) {
    node *last = &p->nodes[p->count - 1];
    motion alone = last->m;
    turn(p, length_s, TURN_STEP_RAD, &alone);
    last->length_s = length_s;
    last->deviation_rad = bst_quat_to_rotvec(bst_quat_mul(bst_quat_conj(end->q), alone.q));
    last->deviation_radps = bst_vec3_sub(to_gcrf(end->q, end->w), to_gcrf(alone.q, alone.w));
    last[1] = (node){.at_s = last->at_s + length_s, .m = *end};
    p->count++;
}

/* Integrates one step, or notes that there is none. */
static void extend(bst_attitude_propagation *p) {
    if (p->count + 2 > p->room) {
        node *more = realloc(p->nodes, 2 * (size_t)p->room * sizeof *more);
        p->ended = !more;
        p->nodes = more ? more : p->nodes;
        p->room *= more ? 2 : 1;
    }
    if (p->count == 1) {
        p->ended = !torque_at(p, p->nodes[0].at_s, p->nodes[0].m.q, &p->torque_nm);
    }
    while (!p->ended) {
        const node *from = &p->nodes[p->count - 1];
        double longest = fmin(LONGEST_S, LONGEST_RAD / fmax(bst_vec3_norm(from->m.w), 1e-9));
        double h = fmin(p->next_s, longest), error = 0.0;
        motion once = from->m, half = from->m;
        bst_vec3 torque = p->torque_nm, of_half = torque;
        bool known =
            move(p, from->at_s, h, &torque, &once) && move(p, from->at_s, 0.5 * h, &of_half, &half);
        motion end = half;
        known = known && move(p, from->at_s + 0.5 * h, 0.5 * h, &of_half, &end);
        bst_vec3 dq = {0.0, 0.0, 0.0}, dw = dq;
        if (known) {
            dq = bst_quat_to_rotvec(bst_quat_mul(end.q, bst_quat_conj(once.q)));
            dw = bst_vec3_sub(end.w, once.w);
            error = (bst_vec3_norm(dq) + DAY_S * bst_vec3_norm(dw)) / 3.0;
            known = isfinite(error);
        }
        error = known ? error : (double)INFINITY;
        /* the error of a step over its length grows with its second to fourth power */
        double rounding = ROUNDING * (1.0 + DAY_S * bst_vec3_norm(from->m.w));
        double allowed = fmax(p->tolerance_rad * h / DAY_S, rounding);
        double factor = 0.9 * cbrt(allowed / fmax(error, 1e-30));
        p->next_s = fmax(h * fmin(fmax(factor, 0.2), 3.0), SHORTEST * longest);
        bool shortest = h <= SHORTEST * longest * (1.0 + 1e-9);
        if (known && (error <= allowed || shortest)) {
            end.q = bst_quat_unit(
                bst_quat_mul(bst_quat_from_rotvec(bst_vec3_scale(dq, 1.0 / 3.0)), end.q));
            end.w = bst_vec3_axpy(end.w, 1.0 / 3.0, dw);
            append(p, 0.5 * h, &half);
            append(p, 0.5 * h, &end);
            p->ended = !torque_at(p, p->nodes[p->count - 1].at_s, end.q, &p->torque_nm);
            return;
        }
        p->ended = shortest;
    }
}

/* The node at or before a time. */
static node node_before(const bst_attitude_propagation *p, double seconds) {
    int64_t low = 0, high = p->count;
    while (high - low > 1) {
        int64_t middle = low + (high - low) / 2;
        *(p->nodes[middle].at_s <= seconds ? &low : &high) = middle;
    }
    return p->nodes[low];
}

bst_quat bst_attitude_propagation_at(bst_attitude_propagation *p, double seconds, bst_vec3 *rate) {
    pthread_mutex_lock(&p->lock);
    while (p->nodes[p->count - 1].at_s <= seconds && !p->ended) {
        extend(p);
    }
    node n = node_before(p, seconds);
    pthread_mutex_unlock(&p->lock);
    motion m = n.m;
    double s = seconds - n.at_s;
    turn(p, s, READ_STEP_RAD, &m);
    if (n.length_s > 0.0 && s > 0.0) {
        /* cubic Hermite polynomial from no deviation and no rate of it */
        double u = s / n.length_s, of_end = u * u * (3.0 - 2.0 * u), of_rate = u * u * (u - 1.0);
        bst_vec3 d = bst_vec3_scale(n.deviation_rad, of_end);
        d = bst_vec3_axpy(d, of_rate * n.length_s, n.deviation_radps);
        bst_vec3 v = bst_vec3_scale(n.deviation_rad, 6.0 * u * (1.0 - u) / n.length_s);
        v = bst_vec3_axpy(v, u * (3.0 * u - 2.0), n.deviation_radps);
        v = bst_vec3_add(v, to_gcrf(m.q, m.w));
        m.q = bst_quat_unit(bst_quat_mul(m.q, bst_quat_from_rotvec(bst_vec3_scale(d, -1.0))));
        m.w = bst_quat_rotate(m.q, v);
    }
    if (rate) {
        *rate = m.w;
    }
    return m.q;
}

int64_t bst_attitude_propagation_calls(bst_attitude_propagation *p) {
    pthread_mutex_lock(&p->lock);
    int64_t calls = p->calls;
    pthread_mutex_unlock(&p->lock);
    return calls;
}
