#include "scenegen/source_order.h"

#include <assert.h>

enum { SIDE = 64 }; /* cells along each axis */

/* Cells of a sensor: its centre, px, and cells per px. */
typedef struct grid {
    double x, y, per_x, per_y;
} grid;

static int along(double from_centre, double centre, double per_px) {
    double cell = (from_centre + centre) * per_px;
    return cell > 0.0 ? (cell < SIDE - 1.0 ? (int)cell : SIDE - 1) : 0;
}

static int cell_of(const grid *g, const bst_kernel_source_record *s) {
    return along(s->y_px, g->y, g->per_y) * SIDE + along(s->x_px, g->x, g->per_x);
}

void bst_source_order(const bst_camera *camera, const bst_kernel_source_record *list, int count,
                      bst_kernel_source_record *sorted) {
    assert(camera && count >= 0 && ((list && sorted) || count == 0));
    const grid cells = {.x = bst_camera_centre_x(camera),
                        .y = bst_camera_centre_y(camera),
                        .per_x = SIDE / (double)camera->width_px,
                        .per_y = SIDE / (double)camera->height_px};
    int first[SIDE * SIDE + 1] = {0};
    for (int i = 0; i < count; i++) {
        first[cell_of(&cells, &list[i]) + 1]++;
    }
    for (int c = 0; c < SIDE * SIDE; c++) {
        first[c + 1] += first[c];
    }
    for (int i = 0; i < count; i++) {
        sorted[first[cell_of(&cells, &list[i])]++] = list[i];
    }
}
