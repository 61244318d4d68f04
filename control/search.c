#include "control/search.h"

#include <math.h>
#include <stdbool.h>

#include "sim/core/vec.h"

/* Fields on each side of the centre. */
static int reach(double extent, double field, double step) {
    double need = ceil((extent - 0.5 * field) / (step * field) - 1e-9);
    double most = (BST_SEARCH_TILES_PER_SIDE - 1) / 2;
    return (int)fmin(fmax(need, 0.0), most);
}

static double angle_of(const bst_search_tile *t) {
    double a = atan2(t->y_rad, t->x_rad);
    return a < -1e-12 ? a + 2.0 * BST_PI : a;
}

static bool before(const bst_search_tile *a, const bst_search_tile *b) {
    double ra = hypot(a->x_rad, a->y_rad), rb = hypot(b->x_rad, b->y_rad);
    if (fabs(ra - rb) > 1e-9 * (ra + rb)) {
        return ra < rb;
    }
    return angle_of(a) < angle_of(b);
}

void bst_search_plan(bst_search *search, double extent_rad, double field_x_rad, double field_y_rad,
                     double step) {
    int nx = reach(extent_rad, field_x_rad, step), ny = reach(extent_rad, field_y_rad, step);
    search->count = 0;
    for (int j = -ny; j <= ny; j++) {
        for (int i = -nx; i <= nx; i++) {
            bst_search_tile tile = {i * step * field_x_rad, j * step * field_y_rad};
            int k = search->count++;
            for (; k > 0 && before(&tile, &search->tile[k - 1]); k--) {
                search->tile[k] = search->tile[k - 1];
            }
            search->tile[k] = tile;
        }
    }
}
