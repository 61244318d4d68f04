#include "imgproc/measure/sensor_order.h"

#include <string.h>

/* Row of a source, clipped to the frame. */
static int row_of(const bst_imgproc_found *found, int height) {
    double y = found->source.shape.y_px;
    return y > height - 1.0 ? height - 1 : y > 0.0 ? (int)y : 0;
}

/* Sort order of sources within a row: y, then x, then index. */
static bool before_on_sensor(const bst_imgproc_found *found, int a, int b) {
    const bst_imgproc_shape *p = &found[a].source.shape, *q = &found[b].source.shape;
    if (p->y_px != q->y_px) {
        return p->y_px < q->y_px;
    }
    return p->x_px != q->x_px ? p->x_px < q->x_px : a < b;
}

void bst_sensor_order(const bst_imgproc_found *found, int count, int height, int *order, int *swap,
                      int *row) {
    memset(row, 0, ((size_t)height + 1) * sizeof *row);
    for (int i = 0; i < count; i++) {
        row[row_of(&found[order[i]], height) + 1]++;
    }
    for (int y = 0; y < height; y++) {
        row[y + 1] += row[y];
    }
    for (int i = 0; i < count; i++) {
        swap[row[row_of(&found[order[i]], height)]++] = order[i];
    }
    for (int i = 0; i < count; i++) {
        int moved = swap[i], at = i;
        for (; at > 0 && before_on_sensor(found, moved, order[at - 1]); at--) {
            order[at] = order[at - 1];
        }
        order[at] = moved;
    }
}
