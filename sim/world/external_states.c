#include "sim/world/external_states.h"

#include <assert.h>
#include <pthread.h>
#include <stdlib.h>

#include "sim/astro/kepler.h"
#include "sim/world/scene/object_shape.h"
#include "sim/world/world_internal.h"

enum { KEPT = 4096 };

typedef struct kept_state {
    double seconds;
    bst_world_state state;
} kept_state;

struct bst_external_states {
    pthread_mutex_t lock;
    kept_state states[KEPT]; /* ring buffer: state n is at states[n % KEPT] */
    int64_t count;
};

bst_status bst_external_states_create(bst_ctx *ctx, bst_external_states **out) {
    *out = calloc(1, sizeof **out);
    if (!*out) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for states that come by message");
    }
    pthread_mutex_init(&(*out)->lock, NULL);
    return BST_OK;
}

void bst_external_states_free(bst_external_states *s) {
    if (s) {
        pthread_mutex_destroy(&s->lock);
        free(s);
    }
}

bst_status bst_external_states_add(bst_ctx *ctx, bst_external_states *s, double seconds,
                                   const bst_world_state *state) {
    assert(s && state && isfinite(seconds));
    pthread_mutex_lock(&s->lock);
    double last = s->count > 0 ? s->states[(s->count - 1) % KEPT].seconds : -INFINITY;
    bool later = seconds > last;
    if (later) {
        s->states[s->count++ % KEPT] = (kept_state){seconds, *state};
    }
    pthread_mutex_unlock(&s->lock);
    return later ? BST_OK
                 : bst_fail(ctx, BST_ERR_ARGUMENT,
                            "a state at %.9g s after one at %.9g s: they come in the order of time",
                            seconds, last);
}

bst_status bst_external_states_state(bst_ctx *ctx, bst_external_states *s, double seconds,
                                     bool *steered, bst_world_state *out) {
    pthread_mutex_lock(&s->lock);
    int64_t low = s->count > KEPT ? s->count - KEPT : 0, high = s->count;
    /* the last state at or before `seconds`; else the oldest one that is kept */
    *steered = s->count > 0 && (low > 0 || s->states[0].seconds <= seconds);
    while (high - low > 1) {
        int64_t middle = low + (high - low) / 2;
        if (s->states[middle % KEPT].seconds <= seconds) {
            low = middle;
        } else {
            high = middle;
        }
    }
    kept_state from = s->states[low % KEPT];
    pthread_mutex_unlock(&s->lock);
    return *steered ? bst_kepler_propagate(ctx, BST_EARTH_MU_M3PS2, from.state.position_m,
                                           from.state.velocity_mps, seconds - from.seconds,
                                           &out->position_m, &out->velocity_mps)
                    : BST_OK;
}

void bst_external_states_archive(bst_external_states *s, bst_archive *archive) {
    pthread_mutex_lock(&s->lock);
    s->count = bst_archive_integer(archive, s->count, 0, INT64_MAX - KEPT);
    int kept = s->count < KEPT ? (int)s->count : KEPT;
    bst_archive_bytes(archive, s->states, (size_t)kept * sizeof *s->states);
    pthread_mutex_unlock(&s->lock);
}

void bst_world_archive(const bst_world *world, bst_archive *archive) {
    for (int i = 0; i < world->object_count; i++) {
        if (world->objects[i].orbit.external) {
            bst_external_states_archive(world->objects[i].orbit.external, archive);
        }
    }
    for (int i = 0; i < world->shape_count; i++) {
        bst_commanded_attitude *commands = bst_body_attitude_commands(world->shapes[i]->attitude);
        if (commands) {
            bst_commanded_attitude_archive(commands, archive);
        }
    }
}

bst_status bst_world_turn(bst_ctx *ctx, const bst_world *world, const char *name, double seconds,
                          bst_quat q_body_from_gcrf, bst_vec3 rate_body_radps) {
    int object = bst_world_find_object(world, name);
    const bst_object_shape *shape = object >= 0 ? world->objects[object].info.shape : NULL;
    bst_commanded_attitude *commands = shape ? bst_body_attitude_commands(shape->attitude) : NULL;
    if (!commands) {
        return bst_fail(ctx, BST_ERR_NOT_FOUND,
                        "no object \"%.64s\" with a shape whose key \"external_states\" is true",
                        name);
    }
    bst_quat q = q_body_from_gcrf;
    double norm = sqrt(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w);
    if (!(fabs(norm - 1.0) < 1e-3)) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "%.64s: the quaternion has the length %g (allowed: 1 to 1e-3)", name, norm);
    }
    return bst_commanded_attitude_add(ctx, commands, seconds, bst_quat_unit(q), rate_body_radps);
}

bst_status bst_world_steer(bst_ctx *ctx, const bst_world *world, const char *name, double seconds,
                           const bst_world_state *state) {
    int object = bst_world_find_object(world, name);
    bst_external_states *external = object >= 0 ? world->objects[object].orbit.external : NULL;
    if (!external) {
        return bst_fail(ctx, BST_ERR_NOT_FOUND,
                        "no object \"%.64s\" whose key \"external_states\" is true", name);
    }
    return bst_external_states_add(ctx, external, seconds, state);
}
