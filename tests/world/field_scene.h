/* A field with a satellite, and the history of its camera's attitude. */
#ifndef BST_TESTS_WORLD_FIELD_SCENE_H
#define BST_TESTS_WORLD_FIELD_SCENE_H

#include <stdlib.h>

#include "sim/world/scene/field.h"
#include "sim/world/world_internal.h"
#include "tests/world/world_support.h"

#define GX5 "{\"name\": \"GX5\", " TEST_GX5 "}"
enum { RATE = 6000, HISTORY = 2000 };

typedef struct scene {
    bst_ctx ctx;
    bst_world *world;
    bst_field *field;
    bst_los_history *history;
    bst_quat target; /* camera on GX5 at the epoch */
    bst_truth truth;
    const bst_scene_source *sources;
    int count;
    bst_los_track track;
} scene;

static inline scene make_scene_in(bst_world *world) {
    scene s = {.world = world};
    bst_assert_ok(&s.ctx, bst_field_create(&s.ctx, s.world, 0, 0, &s.field));
    s.history = calloc(1, sizeof *s.history + HISTORY * sizeof *s.history->items);
    assert_non_null(s.history);
    s.history->capacity = HISTORY;
    s.target = bst_world_body_attitude(s.world, 0, 0);
    return s;
}

static inline scene make_scene(const char *objects) {
    return make_scene_in(test_world_with(objects, ", \"cue\": {\"object\": \"GX5\"}"));
}

static inline void free_scene(scene *s) {
    bst_field_free(s->field);
    bst_world_free(s->world);
    free(s->history);
}

static inline void push(bst_los_history *h, int64_t tick, bst_quat q) {
    h->items[h->written++ % h->capacity] = (bst_los_sample){tick, q};
}

/* Attitude turned by a rotation vector in camera axes, given as the displacement in px of an image
 * point at the boresight and a roll in rad. */
static inline bst_quat turned(bst_quat q, double x_px, double y_px, double roll) {
    const double scale = 3.0 * BST_ARCSEC_RAD;
    return bst_quat_mul(bst_quat_from_rotvec((bst_vec3){-y_px * scale, x_px * scale, roll}), q);
}

#endif
