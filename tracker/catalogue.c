#include "tracker/catalogue.h"

#include <assert.h>
#include <stdlib.h>

#include "sim/core/arena.h"

struct bst_tracker_catalogue {
    bst_arena arena;
    const bst_knowledge *knowledge;
    bst_knowledge_view *view;
    double sigma_m, sigma_mps, mag_sigma;
    double seconds, clock_sigma_s;
    int32_t cue_object;
    bool failed; /* the latest search */
    int *near;   /* [number of objects] */
};

static void lay_out(bst_tracker_catalogue *c) {
    BST_ARENA_TAKE(&c->arena, c->near, (size_t)bst_knowledge_object_count(c->knowledge) + 1);
}

bst_status bst_tracker_catalogue_create(bst_ctx *ctx, const bst_tracker_config *config,
                                        const bst_knowledge *knowledge, bst_knowledge_view *view,
                                        bst_tracker_catalogue **out) {
    assert(config && knowledge && view && out);
    *out = NULL;
    bst_tracker_catalogue *c = calloc(1, sizeof *c);
    if (!c) {
        return bst_fail(ctx, BST_ERR_MEMORY, "tracker: out of memory");
    }
    *c = (bst_tracker_catalogue){.knowledge = knowledge,
                                 .view = view,
                                 .sigma_m = config->catalogue_sigma_m,
                                 .sigma_mps = config->catalogue_sigma_mps,
                                 .mag_sigma = config->catalogue_mag_sigma,
                                 .cue_object = -1};
    lay_out(c);
    bst_status status = bst_arena_alloc(ctx, &c->arena, "the tracker's view of the catalogue");
    if (status != BST_OK) {
        free(c);
        return status;
    }
    lay_out(c);
    *out = c;
    return BST_OK;
}

void bst_tracker_catalogue_free(bst_tracker_catalogue *c) {
    if (c) {
        bst_arena_free(&c->arena);
        free(c);
    }
}

int32_t bst_tracker_catalogue_set(bst_tracker_catalogue *c, double seconds, double clock_sigma_s) {
    c->seconds = seconds;
    c->clock_sigma_s = clock_sigma_s;
    c->failed = false;
    c->cue_object = bst_knowledge_cue_object(c->view);
    return c->cue_object;
}

/* Predicts an object; false if it cannot be seen within the cone of a search. */
static bool predict(const bst_tracker_catalogue *c, const bst_tracker_search *search, int object,
                    bst_identity_object *out) {
    const double h = 0.5; /* s, of the central difference */
    bst_ctx quiet = {0};  /* after the end of an orbit there is no direction: no error here */
    bst_world_sight now;
    bst_vec3 middle, before, after;
    /* most objects are beside the cone, and need no light */
    if (bst_knowledge_direction_at(&quiet, c->view, object, c->seconds, &middle) != BST_OK ||
        bst_vec3_angle(middle, search->axis) > search->half_angle_rad ||
        bst_knowledge_sight_at(&quiet, c->view, object, c->seconds, &now) != BST_OK ||
        now.occulted || !(now.sunlit_fraction > 0.0) ||
        bst_knowledge_direction_at(&quiet, c->view, object, c->seconds - h, &before) != BST_OK ||
        bst_knowledge_direction_at(&quiet, c->view, object, c->seconds + h, &after) != BST_OK) {
        return false;
    }
    bool bright = isfinite(now.v_mag);
    bst_vec3 rate = bst_vec3_scale(bst_vec3_sub(after, before), 0.5 / h);
    bst_vec3 turn = bst_vec3_scale(bst_vec3_axpy(bst_vec3_add(before, after), -2.0, now.geometric),
                                   1.0 / (h * h));
    *out = (bst_identity_object){
        .object = object,
        .direction = now.geometric,
        .rate_radps = rate,
        .sigma_rad = hypot(c->sigma_m / now.range_m, c->clock_sigma_s * bst_vec3_norm(rate)),
        .rate_sigma_radps =
            hypot(c->sigma_mps / now.range_m, c->clock_sigma_s * bst_vec3_norm(turn)),
        .v_mag = bright ? now.v_mag : 0.0,
        .v_mag_sigma = bright ? c->mag_sigma : INFINITY};
    return true;
}

/* Angle of a direction to the nearest track of a search, without any to its axis. */
static double nearness(const bst_tracker_search *search, bst_vec3 direction) {
    double least = search->track_count > 0 ? INFINITY : bst_vec3_angle(direction, search->axis);
    for (int i = 0; i < search->track_count; i++) {
        least = fmin(least, bst_vec3_angle(direction, search->tracks[i]));
    }
    return least;
}

int bst_tracker_catalogue_near(void *user, const bst_tracker_search *search,
                               bst_identity_object *out, int room, int *left_out) {
    bst_tracker_catalogue *c = user;
    assert(room >= 1 && room <= BST_IDENTITY_OBJECTS);
    double off[BST_IDENTITY_OBJECTS];
    int near = 0, count = 0;
    bst_ctx quiet = {0};
    *left_out = 0;
    c->failed = bst_knowledge_near(&quiet, c->view, c->seconds, search->axis,
                                   search->half_angle_rad, c->near, &near) != BST_OK;
    if (c->failed) {
        return -1;
    }
    for (int i = 0; i < near; i++) {
        bst_identity_object object;
        if (c->near[i] == c->cue_object || bst_knowledge_is_itself(c->knowledge, c->near[i]) ||
            !predict(c, search, c->near[i], &object)) {
            continue;
        }
        int at = count;
        double this_off = nearness(search, object.direction);
        if (count == room) {
            ++*left_out;
            at = 0;
            for (int k = 1; k < room; k++) {
                at = off[k] > off[at] ? k : at;
            }
            if (this_off >= off[at]) {
                continue;
            }
        } else {
            count++;
        }
        out[at] = object;
        off[at] = this_off;
    }
    return count;
}

bool bst_tracker_catalogue_sight(void *user, int32_t object, bst_clock_sight *out) {
    const bst_tracker_catalogue *c = user;
    bst_ctx quiet = {0}; /* after the end of an orbit there is no direction: no error here */
    bst_onboard_line line;
    if (bst_knowledge_line_at(&quiet, c->view, object, c->seconds, &line) != BST_OK) {
        return false;
    }
    *out = (bst_clock_sight){.object = object,
                             .direction = line.direction,
                             .range_m = line.range_m,
                             .object_m = line.object.position_m,
                             .object_mps = line.object.velocity_mps,
                             .observer_m = line.eye.position_m,
                             .observer_mps = line.eye.velocity_mps,
                             .corrected_s = bst_knowledge_view_clock_s(c->view)};
    return true;
}

bool bst_tracker_catalogue_failed(const bst_tracker_catalogue *c) {
    return c->failed;
}
