#include "sim/export/shape_labels.h"

#include <math.h>

#include <cjson/cJSON.h>

#include "sim/core/json_number.h"

static const char table_sql[] =
    "SELECT count(*) FROM sqlite_master WHERE type = 'table' AND name = 'shapes'";
static const char shapes_sql[] =
    "SELECT exposure_id, item, x_px, y_px, x0_px, y0_px, x1_px, y1_px, size_px, phase_deg, range_m,"
    " q_body_from_gcrf_x, q_body_from_gcrf_y, q_body_from_gcrf_z, q_body_from_gcrf_w FROM shapes"
    " WHERE sensor = ?1 ORDER BY exposure_id, item";

bst_status bst_shape_labels_open(bst_ctx *ctx, const bst_export *e, int sensor,
                                 bst_shape_labels *out) {
    *out = (bst_shape_labels){0};
    if (bst_run_reader_int(e->run, table_sql, 0, 0) == 0) {
        return BST_OK;
    }
    BST_TRY(bst_io_rows_open(ctx, e->run, shapes_sql, sensor, 0, &out->rows));
    return bst_io_rows_next(ctx, out->rows, &out->more);
}

void bst_shape_labels_close(bst_shape_labels *labels) {
    bst_io_rows_close(labels->rows);
    *labels = (bst_shape_labels){0};
}

bst_status bst_shape_labels_find(bst_ctx *ctx, bst_shape_labels *l, int64_t exposure_id,
                                 int64_t item, bst_shape_label *out, bool *found) {
    *found = false;
    while (l->more) {
        int64_t exposure = bst_io_rows_int(l->rows, 0), at = bst_io_rows_int(l->rows, 1);
        if (exposure > exposure_id || (exposure == exposure_id && at > item)) {
            break;
        }
        if (exposure == exposure_id && at == item) {
            double v[13];
            for (int k = 0; k < 13; k++) {
                v[k] = bst_io_rows_real(l->rows, 2 + k);
            }
            *out = (bst_shape_label){v[0], v[1], v[2], v[3], v[4],
                                     v[5], v[6], v[7], v[8], {v[9], v[10], v[11], v[12]}};
            *found = isfinite(out->size_px) && isfinite(out->x_px) && isfinite(out->y_px);
        }
        BST_TRY(bst_io_rows_next(ctx, l->rows, &l->more));
    }
    return BST_OK;
}

void bst_shape_label_add(const bst_shape_label *s, const bst_shape_label_view *v, cJSON *node) {
    cJSON *shape = cJSON_AddObjectToObject(node, "shape");
    double x0 = (s->x0_px - v->first_x_px + 0.5) / v->scale_x;
    double y0 = (s->y0_px - v->first_y_px + 0.5) / v->scale_y;
    bst_json_add_number(shape, "x_centre_of_mass", (s->x_px - v->first_x_px + 0.5) / v->scale_x);
    bst_json_add_number(shape, "y_centre_of_mass", (s->y_px - v->first_y_px + 0.5) / v->scale_y);
    cJSON_AddItemToObject(
        shape, "box",
        cJSON_CreateDoubleArray((double[]){x0, y0, (s->x1_px - s->x0_px) / v->scale_x,
                                           (s->y1_px - s->y0_px) / v->scale_y},
                                4));
    bst_json_add_number(shape, "size_px", s->size_px);
    cJSON_AddItemToObject(shape, "q_body_from_gcrf",
                          cJSON_CreateDoubleArray(s->q_body_from_gcrf, 4));
    bst_json_add_number(shape, "phase_deg", s->phase_deg);
    bst_json_add_number(shape, "range_m", s->range_m);
}
