/* Uncertainty of each object's place along its orbit, as the tasking keeps it. */
#include <assert.h>
#include <math.h>

#include "control/tasking/tasking_internal.h"
#include "sim/astro/time.h"
#include "sim/core/symmetric.h"
#include "sim/core/tangent.h"

/* time between the two places that give the direction of motion, s */
static const double STEP_S = 1.0;

void bst_tasking_uncertainty_init(bst_tasking *t) {
    const double sigma = t->config.catalogue_sigma_m, drift = t->config.catalogue_drift_m_per_day;
    for (int i = 0; i < t->object_count; i++) {
        double age_s = 0.0;
        (void)bst_knowledge_element_age(t->sensors[0].knowledge, i, &age_s);
        const double age = age_s / BST_DAY_S;
        t->along[i] = (bst_tasking_along){.aa = sigma * sigma + drift * drift * age * age,
                                          .ad = drift * drift * age,
                                          .dd = drift * drift};
    }
}

/* Adds the process noise until a time: a random walk of the drift. */
static void add_noise(const bst_tasking *t, double days, bst_tasking_along *p) {
    if (!(days > p->until_days)) {
        return;
    }
    const double q = t->config.catalogue_noise_m_per_day * t->config.catalogue_noise_m_per_day;
    const double from = p->until_days;
    p->dd += q * (days - from);
    p->ad -= q * (days * days - from * from) / 2.0;
    p->aa += q * (days * days * days - from * from * from) / 3.0;
    p->until_days = days;
}

double bst_tasking_sigma_m(const bst_tasking *t, int object, double now_s) {
    const double days = now_s / BST_DAY_S;
    bst_tasking_along p = t->along[object];
    add_noise(t, days, &p);
    return sqrt(fmax(p.aa + days * (2.0 * p.ad + days * p.dd), 0.0));
}

void bst_tasking_uncertainty_update(bst_tasking *t, int object, double seen_s,
                                    double information_m2) {
    const double days = seen_s / BST_DAY_S;
    bst_tasking_along *p = &t->along[object];
    if (!(information_m2 > 0.0)) {
        return;
    }
    add_noise(t, days, p);
    /* the place at the time of the track is A + days D */
    const double ha = p->aa + days * p->ad, hd = p->ad + days * p->dd;
    const double others = t->config.catalogue_sigma_m * t->config.catalogue_sigma_m;
    const double s = ha + days * hd + 1.0 / information_m2 + others;
    p->aa -= ha * ha / s;
    p->ad -= ha * hd / s;
    p->dd -= hd * hd / s;
}

double bst_tasking_information_m2(bst_vec3 direction, double range_m, bst_vec3 motion,
                                  const double covariance[2][2]) {
    const bst_tangent axes = bst_tangent_at(direction);
    const bst_vec3 u = bst_vec3_unit(motion);
    const double a[2] = {bst_vec3_dot(u, axes.e1) / range_m, bst_vec3_dot(u, axes.e2) / range_m};
    double inverse[2][2];
    if (!bst_symmetric_invert(2, covariance[0], inverse[0])) {
        return 0.0;
    }
    return a[0] * a[0] * inverse[0][0] + 2.0 * a[0] * a[1] * inverse[0][1] +
           a[1] * a[1] * inverse[1][1];
}

/* Catalogued place of an object as a sensor's onboard knowledge has it. */
static bst_status place_at(bst_ctx *ctx, const bst_tasking_sensor *s, int object, double seconds,
                           bst_vec3 *place_m, bst_world_sight *sight) {
    bst_world_state eye;
    bst_bodies bodies;
    BST_TRY(bst_knowledge_eye_at(ctx, s->view, seconds, &eye, &bodies));
    BST_TRY(bst_knowledge_sight_at(ctx, s->view, object, seconds, sight));
    *place_m = bst_vec3_axpy(eye.position_m, sight->range_m, sight->geometric);
    return BST_OK;
}

void bst_tasking_take_track(bst_tasking *t, int sensor) {
    const bst_tasking_sensor *s = &t->sensors[sensor];
    bst_vec3 place[2];
    bst_world_sight sight, before;
    assert(s->task.object >= 0);
    if (s->frames == 0) {
        return;
    }
    /* an orbit that ends has no place afterwards; the last sighting then updates nothing */
    bst_ctx quiet = {0};
    if (place_at(&quiet, s, s->task.object, s->last_seen_s, &place[1], &sight) != BST_OK ||
        place_at(&quiet, s, s->task.object, s->last_seen_s - STEP_S, &place[0], &before) !=
            BST_OK) {
        return;
    }
    bst_tasking_uncertainty_update(
        t, s->task.object, s->last_seen_s,
        bst_tasking_information_m2(s->seen_direction, sight.range_m,
                                   bst_vec3_sub(place[1], place[0]), s->seen_covariance));
}
