/* Rows of table wheels. */
#include "sim/engine/recorder/recorder_internal.h"

bst_status bst_recorder_wheel_rows(bst_ctx *ctx, bst_recorder *recorder, int sensor,
                                   const void *payload, int64_t written_tick) {
    const bst_wheel_status *status = payload;
    const double rpm = 60.0 / (2.0 * BST_PI);
    if (!bst_recorder_due(recorder, written_tick, &recorder->sensors[sensor].last_wheels)) {
        return BST_OK;
    }
    for (int i = 0; i < status->count; i++) {
        const bst_wheel_state *w = &status->items[i];
        const bst_io_value cells[] = {
            bst_io_int_value(sensor),
            bst_io_int_value(status->tick),
            bst_io_real_value((double)status->tick / (double)recorder->tick_rate_hz),
            bst_io_int_value(i),
            bst_io_real_value(w->speed_radps * rpm),
            bst_io_real_value(w->speed_limit_radps * rpm),
            bst_io_real_value(w->motor_nm),
            bst_io_real_value(w->motor_limit_nm)};
        BST_TRY(bst_io_table_append(ctx, recorder->tables[BST_TABLE_WHEELS], cells));
    }
    return BST_OK;
}
