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

int bst_body_glints_cut(bst_glint *glints, int count, int room) {
    const int whole = count;
    for (int i = 0; i < whole; i++) {
        for (int n = 0; n < 2 && count < room; n++) {
            if (fabs(glints[i].u - n) < REACH * glints[i].per) {
                glints[count++] = (bst_glint){n, CUT * glints[i].per};
            }
        }
    }
    return count;
}

/* Adds the surfaces of which the glint is near but beside the exposure: their light rises toward
 * that end. */
static int add_ends(glint_course *c, double widen_rad, bst_glint *glints, int count) {
    static const double STEP = 1.0 / 16.0; /* of glint.c */
    double end[BST_GLINT_SURFACES], within[BST_GLINT_SURFACES];
    for (int n = 0; n < 2; n++) {
        glint_offsets(c, n, end);
        glint_offsets(c, n == 0 ? STEP : 1.0 - STEP, within);
        for (int i = 0; i < c->list->count && count < BST_BODY_GLINTS_MAX; i++) {
            double lobe = c->list->items[i].lobe_rad + widen_rad, rise = within[i] - end[i];
            if (end[i] < REACH * lobe && rise * 16.0 > 0.2 * lobe) {
                glints[count++] = (bst_glint){n, fmin(STEP * lobe / rise, 1.0)};
            }
        }
    }
    return count;
}

int bst_body_glints_find(const bst_scene_source *source, const bst_body_glint_list *list,
                         double turn_rad, bst_satellite_pose *pose,
                         bst_glint glints[BST_BODY_GLINTS_MAX]) {
    enum { FEWEST = 16, MOST = 4096 };
    glint_course course = {source, list, pose};
    double half_sun_rad = 0.5 * BST_SUN_RADIUS_M / BST_AU_M; /* widens the lobes */
    int steps = (int)fmin(fmax(ceil(turn_rad / GLINT_STEP_RAD), FEWEST), MOST);
    if (list->count == 0) {
        return 0;
    }
    bst_glint all[BST_GLINTS_MAX];
    int count =
        bst_glint_find(list->items, list->count, half_sun_rad, steps, glint_offsets, &course, all);
    count = count < BST_BODY_GLINTS_MAX ? count : BST_BODY_GLINTS_MAX;
    memcpy(glints, all, (size_t)count * sizeof *glints);
    count = add_ends(&course, half_sun_rad, glints, count);
    return bst_body_glints_cut(glints, count, BST_BODY_GLINTS_MAX);
}

/* Adds the kinks of a facet between two of `steps` times.
 *
 * Given:     from, to  cosines of the angles to the Sun and to the observer at the times k - 1 and
 * k
 */
static void add_kinks(const double from[2], const double to[2], int k, int steps, double least_rad,
                      bst_glint *kinks, int *count) {
    for (int i = 0; i < 2; i++) {
        double change = fabs(to[i] - from[i]) * steps, other = fmax(fmax(from[!i], to[!i]), 0.0);
        bool wanted = (from[i] < 0.0) != (to[i] < 0.0) && *count < BST_BODY_KINKS_MAX &&
                      change * other > least_rad;
        double u = wanted ? (k - 1 + from[i] / (from[i] - to[i])) / steps : 0.0;
        for (int m = 0; m < *count; m++) {
            wanted = wanted && fabs(kinks[m].u - u) > 0.1 * KINK_PER;
        }
        if (wanted) {
            kinks[(*count)++] = (bst_glint){u, KINK_PER};
        }
    }
}

int bst_body_kinks_find(const bst_scene_source *source, double least_rad, bst_satellite_pose *pose,
                        bst_glint kinks[BST_BODY_KINKS_MAX]) {
    enum { STEPS = 8 };
    const bst_satellite *satellite = source->body->satellite;
    double before[KINK_FACETS][2];
    int count = 0;
    for (int k = 0; k <= STEPS && satellite->facet_count <= KINK_FACETS; k++) {
        bst_source_body_state state;
        bst_source_body_at(source, (double)k / STEPS, &state, NULL);
        bst_source_body_set_pose(source, &state, pose);
        for (int f = 0; f < satellite->facet_count; f++) {
            const double here[2] = {bst_vec3_dot(pose->normals[f], state.aim.sun),
                                    bst_vec3_dot(pose->normals[f], state.aim.target)};
            if (k > 0 && satellite->facets[f].curved < 0) {
                add_kinks(before[f], here, k, STEPS, least_rad, kinks, &count);
            }
            before[f][0] = here[0];
            before[f][1] = here[1];
        }
    }
    return count;
}
