#include "scenegen/smear/body_glints.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Turn between times at which glints are sought. */
#define GLINT_STEP_RAD 0.15
/* Width of a lobe that passes as quickly as poses about a kink must follow, exposures. */
#define KINK_PER 0.02

enum { KINK_FACETS = 1024 };

bst_status bst_body_glints_list(bst_ctx *ctx, const bst_satellite *satellite,
                                bst_body_glint_list *out) {
    bst_glint_surface all[BST_GLINT_SURFACES];
    int count = bst_glint_surfaces(satellite, all);
    if (count > 0) {
        out->items = malloc((size_t)count * sizeof *out->items);
        if (!out->items) {
            return bst_fail(ctx, BST_ERR_MEMORY, "no memory for %d surfaces that glint", count);
        }
        memcpy(out->items, all, (size_t)count * sizeof *out->items);
        out->count = count;
    }
    return BST_OK;
}

/* The surfaces that may glint, and where they are. */
typedef struct glint_course {
    const bst_scene_source *source;
    const bst_body_glint_list *list;
    bst_satellite_pose *pose;
} glint_course;

static void glint_offsets(void *user, double u, double *offsets) {
    const glint_course *c = user;
    bst_source_body_state state;
    bst_source_body_at(c->source, u, &state, NULL);
    c->pose->burn_s = c->source->body->burn_s;
    c->pose->burn_count = c->source->body->burn_count;
    bst_satellite_pose_turn(c->pose, &state.aim);
    bst_vec3 half = bst_vec3_unit(bst_vec3_add(state.aim.sun, state.aim.target));
    for (int i = 0; i < c->list->count; i++) {
        offsets[i] = bst_glint_offset(&c->list->items[i], c->pose, half);
    }
}

/* Where an end of the exposure cuts a glint, the midpoint rule lacks a term in the square of its
 * step there: poses follow each other by CUT of what the glint asks for. */
static const double CUT = 0.05, REACH = 5.0;

/* Adds a glint, or its width to those without room. */
static void add_glint(bst_body_glints *out, int room, bst_glint glint) {
    if (out->count < room) {
        out->items[out->count++] = glint;
    } else {
        out->lost += glint.per;
    }
}

void bst_body_glints_cut(bst_body_glints *glints, int room) {
    const int whole = glints->count;
    for (int i = 0; i < whole; i++) {
        const bst_glint g = glints->items[i];
        for (int n = 0; n < 2; n++) {
            if (fabs(g.u - n) < REACH * g.per) {
                add_glint(glints, room, (bst_glint){n, CUT * g.per});
            }
        }
    }
}

/* Adds the surfaces of which the glint is near but beside the exposure: their light rises toward
 * that end. */
static void add_ends(glint_course *c, double widen_rad, bst_body_glints *out) {
    static const double STEP = 1.0 / 16.0; /* of glint.c */
    double end[BST_GLINT_SURFACES], within[BST_GLINT_SURFACES];
    for (int n = 0; n < 2; n++) {
        glint_offsets(c, n, end);
        glint_offsets(c, n == 0 ? STEP : 1.0 - STEP, within);
        for (int i = 0; i < c->list->count; i++) {
            double lobe = c->list->items[i].lobe_rad + widen_rad, rise = within[i] - end[i];
            if (end[i] < REACH * lobe && rise * 16.0 > 0.2 * lobe) {
                add_glint(out, BST_BODY_GLINTS_MAX, (bst_glint){n, fmin(STEP * lobe / rise, 1.0)});
            }
        }
    }
}

/* Largest width over that asked for of poses that another glint, narrower and at a distance, asks
 * for: theirs grows with the distance by GROWTH, GLINT_GROWTH / GLINT_STEP of body_poses.c. */
static const double COVERED = 1.2, GROWTH = 1.75;

static int compare_widths(const void *a, const void *b) {
    const bst_glint *x = a, *y = b;
    return (x->per > y->per) - (x->per < y->per);
}

/* Sorts glints by width, and leaves out those for which others already ask for poses that are close
 * enough. Returned: number of those that are left. */
static int merge(bst_glint *glints, int count) {
    int left = 0;
    qsort(glints, (size_t)count, sizeof *glints, compare_widths);
    for (int i = 0; i < count; i++) {
        const bst_glint g = glints[i];
        bool covered = false;
        for (int k = 0; k < left && !covered; k++) {
            covered = hypot(glints[k].per, GROWTH * (glints[k].u - g.u)) <= COVERED * g.per;
        }
        if (!covered) {
            glints[left++] = g;
        }
    }
    return left;
}

void bst_body_glints_find(const bst_scene_source *source, const bst_body_glint_list *list,
                          double turn_rad, bst_satellite_pose *pose, bst_body_glints *out) {
    enum { FEWEST = 16, MOST = 4096 };
    glint_course course = {source, list, pose};
    double half_sun_rad = 0.5 * BST_SUN_RADIUS_M / BST_AU_M; /* widens the lobes */
    int steps = (int)fmin(fmax(ceil(turn_rad / GLINT_STEP_RAD), FEWEST), MOST);
    out->count = 0;
    out->lost = 0.0;
    if (list->count == 0) {
        return;
    }
    bst_glint all[BST_GLINTS_MAX];
    int count =
        bst_glint_find(list->items, list->count, half_sun_rad, steps, glint_offsets, &course, all);
    if (count == BST_GLINTS_MAX) {
        out->lost = 1.0; /* there may be more */
    }
    if (count > BST_BODY_GLINTS_MAX / 2) { /* room for those of the ends */
        count = merge(all, count);
    }
    for (int i = 0; i < count; i++) {
        add_glint(out, BST_BODY_GLINTS_MAX, all[i]);
    }
    add_ends(&course, half_sun_rad, out);
    bst_body_glints_cut(out, BST_BODY_GLINTS_MAX);
}

/* Kinks of an exposure, with their changes of slope. */
typedef struct kink_list {
    double u[BST_BODY_KINKS_MAX], rad[BST_BODY_KINKS_MAX], lost_rad;
    int count;
} kink_list;

/* Adds a kink. A full list gives up the smallest. */
static void add_kink(kink_list *list, double u, double rad) {
    int least = 0;
    for (int m = 0; m < list->count; m++) {
        if (fabs(list->u[m] - u) <= 0.1 * KINK_PER) {
            list->rad[m] = fmax(list->rad[m], rad);
            return;
        }
        least = list->rad[m] < list->rad[least] ? m : least;
    }
    if (list->count < BST_BODY_KINKS_MAX) {
        least = list->count++;
    } else {
        list->lost_rad += fmin(list->rad[least], rad);
        if (rad <= list->rad[least]) {
            return;
        }
    }
    list->u[least] = u;
    list->rad[least] = rad;
}

/* Adds the kinks of a facet between two of `steps` times.
 *
 * Given:     from, to  cosines of the angles to the Sun and to the observer at the times k - 1 and
 * k
 */
static void add_kinks(const double from[2], const double to[2], int k, int steps, double least_rad,
                      kink_list *list) {
    for (int i = 0; i < 2; i++) {
        double change = fabs(to[i] - from[i]) * steps, other = fmax(fmax(from[!i], to[!i]), 0.0);
        if ((from[i] < 0.0) != (to[i] < 0.0) && change * other > least_rad) {
            add_kink(list, (k - 1 + from[i] / (from[i] - to[i])) / steps, change * other);
        }
    }
}

double bst_body_kinks_find(const bst_scene_source *source, double turn_rad, double least_rad,
                           bst_satellite_pose *pose, bst_body_glints *glints) {
    enum { FEWEST = 8, MOST = 512 };
    const bst_satellite *satellite = source->body->satellite;
    int steps = (int)fmin(fmax(ceil(turn_rad / GLINT_STEP_RAD), FEWEST), MOST);
    double before[KINK_FACETS][2];
    kink_list list = {.count = 0};
    for (int k = 0; k <= steps && satellite->facet_count <= KINK_FACETS; k++) {
        bst_source_body_state state;
        bst_source_body_at(source, (double)k / steps, &state, NULL);
        bst_source_body_set_pose(source, &state, pose);
        for (int f = 0; f < satellite->facet_count; f++) {
            const double here[2] = {bst_vec3_dot(pose->normals[f], state.aim.sun),
                                    bst_vec3_dot(pose->normals[f], state.aim.target)};
            if (k > 0 && satellite->facets[f].curved < 0) {
                add_kinks(before[f], here, k, steps, least_rad, &list);
            }
            before[f][0] = here[0];
            before[f][1] = here[1];
        }
    }
    for (int m = 0; m < list.count; m++) {
        glints->items[glints->count++] = (bst_glint){list.u[m], KINK_PER};
    }
    return list.lost_rad;
}
