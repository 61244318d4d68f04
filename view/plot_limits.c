#include "view/plot_limits.h"

#include <math.h>
#include <string.h>

#include "sim/core/json_member.h"

void bst_view_add_wheel_limits(const bst_view_run *run, const bst_view_sensor *s, cJSON *panel) {
    cJSON *limits = cJSON_AddArrayToObject(panel, "stops");
    bst_ctx ignored = {0};
    bst_io_rows *rows;
    bool more;
    cJSON_AddStringToObject(panel, "limit_word", "limits");
    if (bst_io_rows_open(&ignored, run->reader,
                         "SELECT wheel, max(speed_limit_rpm) FROM wheels WHERE sensor = ?1 AND"
                         " rowid < 10000 GROUP BY wheel ORDER BY wheel LIMIT 8",
                         s->sensor.index, 0, &rows) != BST_OK) {
        return;
    }
    for (int line = 0; bst_io_rows_next(&ignored, rows, &more) == BST_OK && more; line++) {
        const double limit = bst_io_rows_real(rows, 1);
        if (isfinite(limit)) {
            cJSON *stop = cJSON_CreateObject();
            cJSON_AddItemToArray(limits, stop);
            cJSON_AddNumberToObject(stop, "line", line);
            cJSON_AddNumberToObject(stop, "low", -limit);
            cJSON_AddNumberToObject(stop, "high", limit);
        }
    }
    bst_io_rows_close(rows);
}

void bst_view_add_stops(const bst_view_run *run, const bst_view_sensor *s, cJSON *panel) {
    const cJSON *node = NULL, *gimbal = NULL,
                *observers = bst_json_member(bst_run_reader_scenario(run->reader), "observers");
    cJSON *stops = cJSON_AddArrayToObject(panel, "stops");
    cJSON_ArrayForEach(node, observers) {
        const cJSON *sensor, *name = bst_json_member(node, "name");
        cJSON_ArrayForEach(sensor, bst_json_member(node, "sensors")) {
            const cJSON *own = bst_json_member(sensor, "name");
            if (cJSON_IsString(name) && cJSON_IsString(own) &&
                strcmp(name->valuestring, s->sensor.observer) == 0 &&
                strcmp(own->valuestring, s->sensor.name) == 0) {
                gimbal = bst_json_member(bst_json_member(sensor, "modules"), "gimbal");
            }
        }
    }
    const cJSON *inner = bst_json_member(gimbal, "inner_travel_deg");
    const cJSON *low = bst_json_member(gimbal, "travel_min_deg");
    const cJSON *high = bst_json_member(gimbal, "travel_max_deg");
    for (int axis = 0; axis < 2; axis++) {
        const cJSON *a = cJSON_GetArrayItem(low, axis), *b = cJSON_GetArrayItem(high, axis);
        double ends[2] = {0.0, 0.0};
        if (cJSON_IsNumber(a) && cJSON_IsNumber(b)) {
            ends[0] = a->valuedouble;
            ends[1] = b->valuedouble;
        } else if (axis == 1 && cJSON_IsNumber(inner)) {
            ends[0] = -inner->valuedouble;
            ends[1] = inner->valuedouble;
        }
        if (ends[0] < ends[1]) {
            cJSON *stop = cJSON_CreateObject();
            cJSON_AddItemToArray(stops, stop);
            cJSON_AddNumberToObject(stop, "line", axis);
            cJSON_AddNumberToObject(stop, "low", ends[0]);
            cJSON_AddNumberToObject(stop, "high", ends[1]);
        }
    }
}
