#include "scenegen/source_order.h"

#include <assert.h>

enum { SIDE = 64 }; /* cells along each axis */

static int along(double from_centre, double centre, double pixels) {
    double cell = (from_centre + centre) * (SIDE / pixels);
    return cell > 0.0 ? (cell < SIDE - 1.0 ? (int)cell : SIDE - 1) : 0;
}

static int cell_of(const bst_camera *camera, const bst_kernel_source_record *s) {
    return along(s->y_px, bst_camera_centre_y(camera), (double)camera->height_px) * SIDE +
           along(s->x_px, bst_camera_centre_x(camera), (double)camera->width_px);
}

void bst_source_order(const bst_camera *camera, const bst_kernel_source_record *list, int count,
                      bst_kernel_source_record *sorted) {
    assert(camera && count >= 0 && ((list && sorted) || count == 0));
    int first[SIDE * SIDE + 1] = {0};
    for (int i = 0; i < count; i++) {
        first[cell_of(camera, &list[i]) + 1]++;
    }
    for (int c = 0; c < SIDE * SIDE; c++) {
        first[c + 1] += first[c];
    }
    for (int i = 0; i < count; i++) {
        sorted[first[cell_of(camera, &list[i])]++] = list[i];
    }
}
