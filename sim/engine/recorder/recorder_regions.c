/* Rows of table regions_of_interest. */
#include "sim/engine/recorder/recorder_internal.h"

const char *bst_recorder_region_reason_name(int32_t reason) {
    static const char *const names[BST_REGION_REASON_COUNT] = {"target", "track", "star"};
    return reason >= 0 && reason < BST_REGION_REASON_COUNT ? names[reason] : "unknown";
}

bst_status bst_recorder_region_rows(bst_ctx *ctx, bst_recorder *recorder, int sensor,
                                    const void *payload, int64_t written_tick) {
    (void)written_tick;
    const bst_regions_of_interest *regions = payload;
    const double mid_s = bst_recorder_mid_s(recorder, regions->start_tick, regions->end_tick);
    for (int i = 0; i < regions->count; i++) {
        const bst_searched_window *k = &regions->items[i];
        const bst_io_value cells[] = {bst_io_int_value(sensor),
                                      bst_io_int_value(regions->exposure_id),
                                      bst_io_real_value(mid_s),
                                      bst_io_int_value(k->number),
                                      bst_io_int_value(k->window.x0),
                                      bst_io_int_value(k->window.y0),
                                      bst_io_int_value(k->window.width),
                                      bst_io_int_value(k->window.height),
                                      bst_io_text_value(bst_recorder_region_reason_name(k->reason)),
                                      bst_io_int_value(k->track_id),
                                      bst_io_int_value(k->star_id),
                                      bst_io_real_value(k->x_px),
                                      bst_io_real_value(k->y_px)};
        BST_TRY(bst_io_table_append(ctx, recorder->tables[BST_TABLE_REGIONS_OF_INTEREST], cells));
    }
    return BST_OK;
}
