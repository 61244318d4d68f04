/* Schedule of module instances: a binary heap ordered by due tick, then by stepping order. */
#include <stdlib.h>

#include "sim/engine/kernel/engine_internal.h"

bst_status bst_engine_make_schedule(bst_ctx *ctx, bst_engine *engine) {
    size_t n = (size_t)engine->instance_count + 1;
    engine->due = calloc(n, sizeof *engine->due);
    engine->heap.items = calloc(n, sizeof *engine->heap.items);
    engine->heap.count = engine->instance_count;
    engine->place = calloc(n, sizeof *engine->place);
    if (!engine->due || !engine->heap.items || !engine->place) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the schedule");
    }
    for (int i = 0; i < engine->instance_count; i++) {
        engine->due[i] = INT64_MAX;
        engine->heap.items[i] = i;
        engine->instances[i]->heap = &engine->heap;
        engine->place[i] = i;
    }
    for (int i = 0; i < engine->instance_count; i++) {
        bst_engine_set_due(engine, i, bst_engine_earliest(engine->instances[i]));
    }
    return BST_OK;
}

int64_t bst_engine_earliest(const instance *self) {
    int64_t due = self->next_period < self->wake ? self->next_period : self->wake;
    for (int t = 0; t < self->trigger_count; t++) {
        const port_state *port = &self->ports[self->triggers[t]];
        bst_log_lock(port->log);
        int64_t visible = bst_log_next_visible(port->log, port->trigger_cursor, port->delay_ticks);
        bst_log_unlock(port->log);
        due = visible < due ? visible : due;
    }
    return due;
}

/* Order of two instances in the heap. */
static bool is_due_before(const bst_engine *engine, int a, int b) {
    return engine->due[a] < engine->due[b] || (engine->due[a] == engine->due[b] && a < b);
}

static void place_in_heap(bst_engine *engine, bst_heap *heap, int place, int i) {
    heap->items[place] = i;
    engine->place[i] = place;
}

void bst_engine_set_due(bst_engine *engine, int i, int64_t due) {
    engine->due[i] = due;
    bst_heap *heap = engine->instances[i]->heap;
    int place = engine->place[i], n = heap->count;
    while (place > 0 && is_due_before(engine, i, heap->items[(place - 1) / 2])) {
        place_in_heap(engine, heap, place, heap->items[(place - 1) / 2]);
        place = (place - 1) / 2;
    }
    for (int child = 2 * place + 1; child < n; child = 2 * place + 1) {
        if (child + 1 < n && is_due_before(engine, heap->items[child + 1], heap->items[child])) {
            child++;
        }
        if (!is_due_before(engine, heap->items[child], i)) {
            break;
        }
        place_in_heap(engine, heap, place, heap->items[child]);
        place = child;
    }
    place_in_heap(engine, heap, place, i);
}
