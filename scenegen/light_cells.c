#include "scenegen/light_cells.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Place among the centres of `cells` cells: the lower one, and the share of the way to the next,
 * which is below 0 or above 1 at the ends. */
static double between(double place, int cells, int *lower) {
    *lower = (int)fmin(fmax(floor(place), 0.0), cells - 2.0);
    return place - *lower;
}

static void set_shares(const bst_light_axis *x, int block, int margin, const bst_light_cells *c) {
    bst_cell_shares *s = &c->shares[block];
    memset(s, 0, sizeof *s);
    for (int l = 0; l < BST_LANES; l++) {
        double sample = (block * BST_LANES + l + margin) * (double)x->samples / x->pixels;
        int cell;
        float u = (float)between((sample + 0.5) / c->side - 0.5, c->columns, &cell);
        s->cell = l == 0 ? cell : s->cell;
        s->share[cell - s->cell][l] = 1.0f - u;
        s->share[cell - s->cell + 1][l] = u;
    }
}

bst_status bst_light_cells_create(bst_ctx *ctx, const bst_light_axis *x, const bst_light_axis *y,
                                  int width, int margin, bst_light_cells *out) {
    int blocks = (width + BST_LANES - 1) / BST_LANES;
    /* cells well below the distance from which wings wrap */
    int side = x->samples > 14 * x->pixels / 10 ? 32 : 16;
    double density = (double)y->samples / y->pixels;
    *out = (bst_light_cells){.side = side,
                             .columns = (x->samples + side - 1) / side,
                             .rows = (y->samples + side - 1) / side,
                             .rows_per_px = density / side,
                             .first_row = (margin * density + 0.5) / side - 0.5};
    out->light = malloc((size_t)out->columns * (size_t)out->rows * sizeof *out->light);
    out->shares = aligned_alloc(sizeof(bst_lanes), (size_t)blocks * sizeof *out->shares);
    if (!out->light || !out->shares) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the far wings");
    }
    for (int i = 0; i < blocks; i++) {
        set_shares(x, i, margin, out);
    }
    return BST_OK;
}

void bst_light_cells_clear(bst_light_cells *c) {
    free(c->light);
    free(c->shares);
    *c = (bst_light_cells){.side = 0};
}

void bst_light_cells_row(const bst_light_cells *c, int row, float *out) {
    int j;
    float v = (float)between(c->first_row + row * c->rows_per_px, c->rows, &j);
    const float *a = c->light + (size_t)j * (size_t)c->columns, *b = a + c->columns;
    for (int i = 0; i < c->columns; i++) {
        out[i] = a[i] + v * (b[i] - a[i]);
    }
}

int bst_light_cells_row_floats(const bst_light_cells *c) {
    return c->columns + BST_CELL_SHARES;
}
