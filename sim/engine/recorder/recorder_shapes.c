/* Writes the rows of objects with a shape: truth, and extended targets of image processing. */
#include <math.h>

#include "sim/engine/recorder/recorder_internal.h"
#include "sim/world/scene/object_shape.h"

#define DEG (180.0 / BST_PI)

bst_status bst_recorder_shape_rows(bst_ctx *ctx, bst_recorder *recorder, int sensor,
                                   const bst_truth *t) {
    if (!recorder->tables[BST_TABLE_SHAPES]) {
        return BST_OK;
    }
    for (int i = 0; i < t->shape_count; i++) {
        const bst_truth_shape *s = &t->shapes[i];
        const bst_truth_item *item = &t->items[s->item];
        const bst_io_value row[] = {
            bst_io_int_value(sensor),
            bst_io_int_value(t->exposure_id),
            bst_io_real_value(bst_recorder_mid_s(recorder, t->start_tick, t->end_tick)),
            bst_io_int_value(s->item + 1),
            bst_io_int_value(item->id),
            bst_io_real_value(s->x_px),
            bst_io_real_value(s->y_px),
            bst_io_real_value(s->x_light_px),
            bst_io_real_value(s->y_light_px),
            bst_io_real_value(s->x0_px),
            bst_io_real_value(s->y0_px),
            bst_io_real_value(s->x1_px),
            bst_io_real_value(s->y1_px),
            bst_io_real_value(s->size_px),
            bst_io_real_value(s->visible),
            bst_io_real_value(s->q_body_from_gcrf.x),
            bst_io_real_value(s->q_body_from_gcrf.y),
            bst_io_real_value(s->q_body_from_gcrf.z),
            bst_io_real_value(s->q_body_from_gcrf.w),
            bst_io_real_value(item->phase_rad * DEG),
            bst_io_real_value(item->range_m),
        };
        BST_TRY(bst_io_table_append(ctx, recorder->tables[BST_TABLE_SHAPES], row));
    }
    return BST_OK;
}

bst_status bst_recorder_part_rows(bst_ctx *ctx, bst_recorder *recorder) {
    bst_io_table *table = recorder->tables[BST_TABLE_PARTS];
    int count = table && recorder->world ? bst_world_object_count(recorder->world) : 0;
    for (int i = 0; i < count; i++) {
        const bst_world_object_info *info = bst_world_object(recorder->world, i);
        const bst_satellite *satellite = info->shape ? info->shape->satellite : NULL;
        int first = bst_world_first_part(recorder->world, i);
        for (int p = 0; satellite && p < satellite->part_count; p++) {
            const bst_io_value row[] = {
                bst_io_int_value(first + p),
                bst_io_int_value(i),
                bst_io_text_value(info->name),
                bst_io_text_value(satellite->parts[p].name),
            };
            BST_TRY(bst_io_table_append(ctx, table, row));
        }
    }
    return BST_OK;
}

bst_status bst_recorder_extended_row(bst_ctx *ctx, bst_recorder *recorder, int sensor,
                                     const bst_detections *d, int item) {
    const bst_detection *target = &d->items[item];
    const bst_detection_extent *e = &target->extent;
    bst_io_table *table = recorder->tables[BST_TABLE_EXTENDED];
    if (!table || !(target->flags & BST_DETECTION_EXTENDED)) {
        return BST_OK;
    }
    bool known = e->range_m > 0.0;
    const bst_io_value row[] = {
        bst_io_int_value(sensor),
        bst_io_int_value(d->exposure_id),
        bst_io_real_value(bst_recorder_mid_s(recorder, d->start_tick, d->end_tick)),
        bst_io_int_value(item),
        bst_io_real_value(target->x_px),
        bst_io_real_value(target->y_px),
        bst_io_real_value(e->light_x_px),
        bst_io_real_value(e->light_y_px),
        bst_io_real_value(e->x0_px),
        bst_io_real_value(e->y0_px),
        bst_io_real_value(e->x1_px),
        bst_io_real_value(e->y1_px),
        bst_io_real_value(e->size_px),
        bst_io_real_value(e->size_sigma_px),
        bst_io_real_value(e->area_px2),
        bst_io_real_value(e->saturated_share),
        bst_io_real_value(e->phase_rad * DEG),
        bst_io_real_value(known ? e->range_m : NAN),
        bst_io_real_value(known ? e->range_sigma_m : NAN),
    };
    return bst_io_table_append(ctx, table, row);
}
