#include "tracker/orbit/orbit_chart.h"

#include <math.h>

#include "sim/core/tangent.h"

bst_od_chart bst_od_chart_of(const bst_od_observer *observer, double span_s,
                             const bst_od_state *s) {
    bst_od_chart c = {.observer = observer, .span_s = span_s};
    bst_vec3 line = bst_vec3_sub(s->position_m, observer->position_m);
    bst_vec3 rate = bst_vec3_sub(s->velocity_mps, observer->velocity_mps);
    c.range_m = bst_vec3_norm(line);
    c.q = bst_vec3_unit(line);
    c.u_ps = bst_vec3_dot(c.q, rate) / c.range_m;
    c.w = bst_vec3_scale(bst_tangent_project(c.q, rate), 1.0 / c.range_m);
    return c;
}

bst_od_state bst_od_chart_state(const bst_od_chart *c) {
    bst_vec3 rate = bst_vec3_axpy(c->w, c->u_ps, c->q);
    return (bst_od_state){
        .time_s = c->observer->time_s,
        .position_m = bst_vec3_axpy(c->observer->position_m, c->range_m, c->q),
        .velocity_mps = bst_vec3_axpy(c->observer->velocity_mps, c->range_m, rate)};
}

bst_od_chart bst_od_chart_moved(const bst_od_chart *c, const double step[6]) {
    bst_tangent axes = bst_tangent_at(c->q);
    bst_od_chart out = *c;
    out.q = bst_tangent_exp(c->q, bst_tangent_vector(&axes, step[0], step[1]));
    bst_vec3 w =
        bst_vec3_add(c->w, bst_tangent_vector(&axes, step[2] / c->span_s, step[3] / c->span_s));
    out.w = bst_tangent_carry(c->q, out.q, w);
    out.range_m = c->range_m * exp(step[4]);
    out.u_ps = c->u_ps + step[5] / c->span_s;
    return out;
}

void bst_od_chart_jacobian(const bst_od_chart *c, double out[6][6]) {
    bst_tangent axes = bst_tangent_at(c->q);
    const bst_vec3 e[2] = {axes.e1, axes.e2};
    bst_vec3 rate = bst_vec3_axpy(c->w, c->u_ps, c->q);
    bst_vec3 r[6] = {{0}}, v[6] = {{0}};
    for (int k = 0; k < 2; k++) {
        r[k] = bst_vec3_scale(e[k], c->range_m);
        v[k] = bst_vec3_scale(
            bst_vec3_axpy(bst_vec3_scale(e[k], c->u_ps), -bst_vec3_dot(c->w, e[k]), c->q),
            c->range_m);
        v[2 + k] = bst_vec3_scale(e[k], c->range_m / c->span_s);
    }
    r[4] = bst_vec3_scale(c->q, c->range_m);
    v[4] = bst_vec3_scale(rate, c->range_m);
    v[5] = bst_vec3_scale(c->q, c->range_m / c->span_s);
    for (int k = 0; k < 6; k++) {
        const double column[6] = {r[k].x, r[k].y, r[k].z, v[k].x, v[k].y, v[k].z};
        for (int i = 0; i < 6; i++) {
            out[i][k] = column[i];
        }
    }
}
