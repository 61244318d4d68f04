#include "sim/satellite/glint.h"

#include <assert.h>

/* Lobe widths from the half vector within which a glint matters: GGX falls to 1e-3 of its peak. */
static const double REACH = 5.0;

/* Index of the surface with this joint, axis, angle and lobe; -1: none. */
static int find(const bst_glint_surface *surfaces, int count, const bst_glint_surface *s) {
    for (int i = 0; i < count; i++) {
        const bst_glint_surface *t = &surfaces[i];
        bst_vec3 apart = bst_vec3_sub(s->axis, t->axis);
        double near_rad = 1e-3 * s->lobe_rad;
        if (t->joint == s->joint && t->lobe_rad == s->lobe_rad &&
            fabs(s->angle - t->angle) < near_rad &&
            bst_vec3_dot(apart, apart) < near_rad * near_rad) {
            return i;
        }
    }
    return -1;
}

/* Adds a surface, or its area to an equal one. A full list gives up its smallest surface. */
static void add(bst_glint_surface *surfaces, int *count, const bst_glint_surface *s) {
    int at = find(surfaces, *count, s);
    if (at >= 0) {
        surfaces[at].area_m2 += s->area_m2;
    } else if (*count < BST_GLINT_SURFACES) {
        surfaces[(*count)++] = *s;
    } else {
        int least = 0;
        for (int i = 1; i < *count; i++) {
            least = surfaces[i].area_m2 < surfaces[least].area_m2 ? i : least;
        }
        if (s->area_m2 > surfaces[least].area_m2) {
            surfaces[least] = *s;
        }
    }
}

int bst_glint_surfaces(const bst_satellite *sat, bst_glint_surface *surfaces) {
    int count = 0;
    for (int i = 0; i < sat->facet_count; i++) {
        const bst_facet *f = &sat->facets[i];
        double lobe = bst_brdf_lobe_rad(&sat->materials[f->material].brdf);
        if (f->curved < 0 && lobe < BST_GLINT_WIDEST_RAD) {
            add(surfaces, &count, &(bst_glint_surface){f->joint, f->normal, 0.0, lobe, f->area_m2});
        }
    }
    for (int i = 0; i < sat->curved_count; i++) {
        const bst_curved *c = &sat->curved[i];
        double lobe = bst_brdf_lobe_rad(&sat->materials[c->material].brdf);
        if (c->sphere || !(lobe < BST_GLINT_WIDEST_RAD)) {
            continue;
        }
        /* the outward normal of a cone leans toward its narrow end */
        double angle = atan2(c->length_m, c->radius_m - c->top_radius_m);
        double slant_m = hypot(c->length_m, c->radius_m - c->top_radius_m);
        add(surfaces, &count,
            &(bst_glint_surface){c->joint, c->z, c->side < 0.0 ? BST_PI - angle : angle, lobe,
                                 BST_PI * (c->radius_m + c->top_radius_m) * slant_m});
    }
    return count;
}

double bst_glint_offset(const bst_glint_surface *s, const bst_satellite_pose *pose, bst_vec3 half) {
    bst_vec3 axis = s->joint < 0 ? s->axis : bst_mat3_mul_vec(&pose->rotation[s->joint], s->axis);
    return fabs(bst_vec3_angle(axis, half) - s->angle);
}

/* Scan of one surface and the times found so far. */
typedef struct search {
    bst_glint_course course;
    void *user;
    bst_glint *glints;
    int count;
} search;

static double offset_at(const search *s, int surface, double u) {
    double offsets[BST_GLINT_SURFACES];
    s->course(s->user, u, offsets);
    return offsets[surface];
}

/* Time of least offset between two times, by golden section. */
static double least_between(const search *s, int surface, double low, double high, double *least) {
    static const double GOLD = 0.6180339887498949;
    double a = high - GOLD * (high - low), b = low + GOLD * (high - low);
    double at_a = offset_at(s, surface, a), at_b = offset_at(s, surface, b);
    for (int i = 0; i < 24; i++) { /* to 1e-5 of the step */
        if (at_a < at_b) {
            high = b;
            b = a;
            at_b = at_a;
            a = high - GOLD * (high - low);
            at_a = offset_at(s, surface, a);
        } else {
            low = a;
            a = b;
            at_a = at_b;
            b = low + GOLD * (high - low);
            at_b = offset_at(s, surface, b);
        }
    }
    *least = fmin(at_a, at_b);
    return at_a < at_b ? a : b;
}

int bst_glint_find(const bst_glint_surface *surfaces, int count, double widen_rad, int steps,
                   bst_glint_course course, void *user, bst_glint glints[BST_GLINTS_MAX]) {
    assert(count >= 0 && count <= BST_GLINT_SURFACES && steps >= 2 && course && glints);
    double before[BST_GLINT_SURFACES], here[BST_GLINT_SURFACES], after[BST_GLINT_SURFACES];
    search s = {course, user, glints, 0};
    double step = 1.0 / steps;
    course(user, -step, before);
    course(user, 0.0, here);
    for (int n = 0; n <= steps; n++) {
        double u = n * step;
        course(user, u + step, after);
        for (int i = 0; i < count; i++) {
            if (!(here[i] <= before[i]) || !(here[i] < after[i]) || s.count == BST_GLINTS_MAX) {
                continue;
            }
            double lobe = surfaces[i].lobe_rad + widen_rad, least;
            /* the offset falls by at most what it changed by in both steps */
            double slope = fmax(before[i] - here[i], after[i] - here[i]);
            if (here[i] - 2.0 * slope > REACH * lobe) {
                continue;
            }
            double at = least_between(&s, i, u - step, u + step, &least);
            double fall = fmax(before[i], after[i]) - least;
            if (least < REACH * lobe && fall > 0.2 * lobe) {
                s.glints[s.count++] = (bst_glint){at, step * lobe / fall};
            }
        }
        for (int i = 0; i < count; i++) {
            before[i] = here[i];
            here[i] = after[i];
        }
    }
    return s.count;
}

int bst_glint_times(const bst_glint_surface *surfaces, int count, double widen_rad, int steps,
                    bst_glint_course course, void *user, double *times, int most) {
    static const double parts[] = {0.0, -0.5, 0.5, -1.0, 1.0, -2.0, 2.0, -4.0, 4.0};
    enum { PARTS = sizeof parts / sizeof parts[0] };
    bst_glint glints[BST_GLINTS_MAX];
    int times_count = 0,
        found = bst_glint_find(surfaces, count, widen_rad, steps, course, user, glints);
    found = found < most / PARTS ? found : most / PARTS;
    for (int i = 0; i < found * PARTS; i++) {
        double at = glints[i / PARTS].u + parts[i % PARTS] * glints[i / PARTS].per;
        if (at > 0.0 && at < 1.0) {
            times[times_count++] = at;
        }
    }
    return times_count;
}
