/* Writes the rows of the tasking module's tasks. */
#include "sim/engine/recorder/recorder_internal.h"

static bst_io_value integer(int64_t value) {
    return (bst_io_value){.type = BST_COLUMN_INT, .as.integer = value};
}
static bst_io_value real(double value) {
    return (bst_io_value){.type = BST_COLUMN_REAL, .is_null = !isfinite(value), .as.real = value};
}
static bst_io_value text(const char *value) {
    return (bst_io_value){.type = BST_COLUMN_TEXT, .is_null = !value, .as.text = value};
}

bst_status bst_recorder_task_rows(bst_ctx *ctx, bst_recorder *recorder, int sensor,
                                  const void *payload, int64_t written_tick) {
    const bst_task *task = payload;
    bool named = recorder->world && task->object >= 0;
    (void)written_tick;
    const bst_io_value row[] = {
        integer(sensor),
        integer(task->tick),
        real((double)task->tick / (double)recorder->tick_rate_hz),
        integer(task->id),
        integer(task->object),
        text(named ? bst_world_object(recorder->world, task->object)->name : NULL),
        integer(task->norad),
        real(task->object >= 0 ? task->v_mag : NAN),
        real(task->object >= 0 ? task->snr : NAN),
        text(bst_task_end_name(task->before)),
    };
    return bst_io_table_append(ctx, recorder->tables[BST_TABLE_TASKS], row);
}
