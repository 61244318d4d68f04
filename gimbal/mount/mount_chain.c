#include "gimbal/mount/mount_chain.h"

enum { XX, YY, ZZ, XY, XZ, YZ };

/* Rotates a vector by an angle about the axis of stage k: from frame k to frame k - 1. */
static inline bst_vec3 outward(int k, bst_vec3 v, double s, double c) {
    return k == 1 ? (bst_vec3){c * v.x + s * v.z, v.y, c * v.z - s * v.x}
                  : (bst_vec3){v.x, c * v.y - s * v.z, s * v.y + c * v.z};
}

/* Inverse rotation: from frame k - 1 to frame k. */
static inline bst_vec3 inward(int k, bst_vec3 v, double s, double c) {
    return outward(k, v, -s, c);
}

static inline double along(int k, bst_vec3 v) {
    return k == 1 ? v.y : v.x;
}

/* Vector of length a along the axis of stage k. */
static inline bst_vec3 on_axis(int k, double a) {
    return k == 1 ? (bst_vec3){0.0, a, 0.0} : (bst_vec3){a, 0.0, 0.0};
}

static inline bst_vec3 times(const double j[6], bst_vec3 v) {
    return (bst_vec3){j[XX] * v.x + j[XY] * v.y + j[XZ] * v.z,
                      j[XY] * v.x + j[YY] * v.y + j[YZ] * v.z,
                      j[XZ] * v.x + j[YZ] * v.y + j[ZZ] * v.z};
}

/* Adds an inertia tensor of frame k, rotated to frame k - 1. */
static inline void add_outward(int k, double to[6], const double j[6], double s, double c) {
    double s2 = s * s, c2 = c * c, sc = s * c;
    if (k == 1) { /* z, x rotate */
        to[YY] += j[YY];
        to[ZZ] += c2 * j[ZZ] - 2.0 * sc * j[XZ] + s2 * j[XX];
        to[XX] += s2 * j[ZZ] + 2.0 * sc * j[XZ] + c2 * j[XX];
        to[XZ] += sc * (j[ZZ] - j[XX]) + (c2 - s2) * j[XZ];
        to[XY] += c * j[XY] + s * j[YZ];
        to[YZ] += c * j[YZ] - s * j[XY];
    } else { /* y, z rotate */
        to[XX] += j[XX];
        to[YY] += c2 * j[YY] - 2.0 * sc * j[YZ] + s2 * j[ZZ];
        to[ZZ] += s2 * j[YY] + 2.0 * sc * j[YZ] + c2 * j[ZZ];
        to[YZ] += sc * (j[YY] - j[ZZ]) + (c2 - s2) * j[YZ];
        to[XY] += c * j[XY] - s * j[XZ];
        to[XZ] += s * j[XY] + c * j[XZ];
    }
}

void bst_mount_chain_equations_at(const bst_mount_chain *chain, const bst_mount_chain_state *state,
                                  const double sine[BST_CHAIN_MOST],
                                  const double cosine[BST_CHAIN_MOST],
                                  const bst_mount_chain_base *base,
                                  bst_mount_chain_equations *out) {
    int n = chain->stages;
    bst_vec3 rate = base->rate_radps, accel = base->accel_radps2, force[BST_CHAIN_MOST];
    double stiff[BST_CHAIN_MOST][6]; /* composite inertia without the masses on the springs */
    for (int k = 0; k < n; k++) {
        double s = sine[k], c = cosine[k], v = state->rate_radps[k];
        const double *inertia = chain->inertia[k];
        bst_vec3 axis = on_axis(k, v);
        bst_vec3 carried = inward(k, rate, s, c);
        rate = bst_vec3_add(carried, axis);
        accel = bst_vec3_add(inward(k, accel, s, c), bst_vec3_cross(carried, axis));
        out->base_accel_radps2[k] = along(k, accel);
        for (int e = 0; e < 6; e++) {
            stiff[k][e] = inertia[e];
        }
        stiff[k][k == 1 ? YY : XX] -= chain->flex_inertia[k];
        double spring = chain->flex_stiffness[k] * state->flex_rad[k] +
                        chain->flex_damping[k] * state->flex_radps[k];
        bst_vec3 momentum = bst_vec3_add(times(inertia, rate),
                                         on_axis(k, chain->flex_inertia[k] * state->flex_radps[k]));
        force[k] = bst_vec3_add(times(stiff[k], accel),
                                bst_vec3_sub(bst_vec3_cross(rate, momentum), on_axis(k, spring)));
    }
    for (int k = n - 1; k >= 0; k--) {
        double s = sine[k], c = cosine[k];
        out->bias_nm[k] = along(k, force[k]);
        out->share[k][k] = 1.0;
        bst_vec3 push = times(stiff[k], on_axis(k, 1.0)), reach = on_axis(k, 1.0);
        out->mass[k][k] = along(k, push);
        for (int j = k - 1; j >= 0; j--) {
            push = outward(j + 1, push, sine[j + 1], cosine[j + 1]);
            reach = outward(j + 1, reach, sine[j + 1], cosine[j + 1]);
            out->mass[j][k] = out->mass[k][j] = along(j, push);
            out->share[k][j] = along(j, reach);
        }
        if (k > 0) {
            force[k - 1] = bst_vec3_add(force[k - 1], outward(k, force[k], s, c));
            add_outward(k, stiff[k - 1], stiff[k], s, c);
        }
    }
}

bst_vec3 bst_mount_chain_momentum(const bst_mount_chain *chain, const bst_mount_chain_state *state,
                                  bst_vec3 base_rate_radps) {
    bst_vec3 rate = base_rate_radps, momentum[BST_CHAIN_MOST];
    double s[BST_CHAIN_MOST], c[BST_CHAIN_MOST];
    for (int k = 0; k < chain->stages; k++) {
        s[k] = sin(state->angle_rad[k]);
        c[k] = cos(state->angle_rad[k]);
        rate = bst_vec3_add(inward(k, rate, s[k], c[k]), on_axis(k, state->rate_radps[k]));
        momentum[k] = bst_vec3_add(times(chain->inertia[k], rate),
                                   on_axis(k, chain->flex_inertia[k] * state->flex_radps[k]));
    }
    for (int k = chain->stages - 1; k > 0; k--) {
        momentum[k - 1] = bst_vec3_add(momentum[k - 1], outward(k, momentum[k], s[k], c[k]));
    }
    return outward(0, momentum[0], s[0], c[0]);
}

double bst_mount_chain_energy(const bst_mount_chain *chain, const bst_mount_chain_state *state,
                              bst_vec3 base_rate_radps) {
    bst_vec3 rate = base_rate_radps;
    double energy = 0.0;
    for (int k = 0; k < chain->stages; k++) {
        rate = bst_vec3_add(inward(k, rate, sin(state->angle_rad[k]), cos(state->angle_rad[k])),
                            on_axis(k, state->rate_radps[k]));
        double flex = state->flex_radps[k], bend = state->flex_rad[k];
        energy += 0.5 * bst_vec3_dot(rate, times(chain->inertia[k], rate)) +
                  chain->flex_inertia[k] * flex * (along(k, rate) + 0.5 * flex) +
                  0.5 * chain->flex_stiffness[k] * bend * bend;
    }
    return energy;
}

void bst_mount_chain_locked_inertia(const bst_mount_chain *chain,
                                    const double angle_rad[BST_CHAIN_MOST], double out[6]) {
    double sum[6] = {0.0};
    for (int k = chain->stages - 1; k >= 0; k--) {
        double here[6], turned[6] = {0.0};
        for (int e = 0; e < 6; e++) {
            here[e] = sum[e] + chain->inertia[k][e];
        }
        add_outward(k, turned, here, sin(angle_rad[k]), cos(angle_rad[k]));
        for (int e = 0; e < 6; e++) {
            sum[e] = turned[e];
        }
    }
    for (int e = 0; e < 6; e++) {
        out[e] = sum[e];
    }
}
