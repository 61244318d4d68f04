/* Writes the rows of the camera's calibration in flight. */
#include "sim/engine/recorder/recorder_internal.h"

bst_status bst_recorder_calibration_row(bst_ctx *ctx, bst_recorder *recorder, int sensor,
                                        const bst_detections *d) {
    enum { SIZE = BST_CAMERA_CALIBRATION_SIZE, FIXED = 4 };
    bst_io_table *table = recorder->tables[BST_TABLE_CAMERA_CALIBRATION];
    const bst_camera_calibration *c = &d->calibration;
    if (!table || c->frames == 0) {
        return BST_OK;
    }
    const double values[SIZE] = {c->scale, c->rotation_rad, c->k1, c->p1, c->p2};
    bst_io_value row[FIXED + SIZE + SIZE * (SIZE + 1) / 2] = {
        bst_io_int_value(sensor),
        bst_io_int_value(d->exposure_id),
        bst_io_real_value(bst_recorder_mid_s(recorder, d->start_tick, d->end_tick)),
        bst_io_int_value(c->frames),
    };
    int count = FIXED;
    for (int i = 0; i < SIZE; i++) {
        row[count++] = bst_io_real_value(values[i]);
    }
    for (int i = 0; i < SIZE; i++) {
        for (int k = i; k < SIZE; k++) {
            row[count++] = bst_io_real_value(c->covariance[i][k]);
        }
    }
    return bst_io_table_append(ctx, table, row);
}
