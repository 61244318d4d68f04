#include "gimbal/spacecraft/spacecraft_sky.h"

static bst_status fill(bst_spacecraft_sky_grid *grid, bst_ctx *ctx, int64_t first) {
    for (int i = 0; i < 4; i++) {
        int64_t old = first + i - grid->first;
        if (grid->filled && old >= i && old < 4) {
            grid->node[i] = grid->node[old];
            grid->attitude[i] = grid->attitude[old];
            continue;
        }
        double t = (double)(first + i) / BST_SKY_NODES_PER_S;
        bst_status status = grid->sky_at(grid->user, ctx, t, &grid->node[i]);
        if (status != BST_OK) {
            grid->filled = 0;
            return status;
        }
        grid->attitude[i] = bst_pointing_law_attitude(grid->law, &grid->node[i].known);
    }
    grid->first = first;
    grid->filled = 4;
    return BST_OK;
}

bst_status bst_spacecraft_sky_grid_at(bst_spacecraft_sky_grid *grid, bst_ctx *ctx, double seconds,
                                      bst_spacecraft_sky *sky,
                                      bst_spacecraft_attitude_reference *reference) {
    double x = seconds * BST_SKY_NODES_PER_S;
    int64_t cell = (int64_t)floor(x);
    int64_t first = cell >= 1 || cell < 0 ? cell - 1 : cell;
    if (!grid->filled || first != grid->first) {
        BST_TRY(fill(grid, ctx, first));
    }
    double a = x - (double)first, b = a - 1.0, c = a - 2.0, d = a - 3.0;
    const double w[4] = {-b * c * d / 6.0, a * c * d / 2.0, -a * b * d / 2.0, a * b * c / 6.0};
    *sky = (bst_spacecraft_sky){.sunlit = 0.0};
    for (int k = 0; k < 4; k++) {
        sky->position_m = bst_vec3_axpy(sky->position_m, w[k], grid->node[k].position_m);
        sky->velocity_mps = bst_vec3_axpy(sky->velocity_mps, w[k], grid->node[k].velocity_mps);
        sky->sun_m = bst_vec3_axpy(sky->sun_m, w[k], grid->node[k].sun_m);
        sky->sunlit += w[k] * grid->node[k].sunlit;
    }
    sky->sunlit = fmin(1.0, fmax(0.0, sky->sunlit));
    *reference = bst_spacecraft_attitude_reference_at(grid->attitude, 1.0 / BST_SKY_NODES_PER_S, a);
    return BST_OK;
}

void bst_spacecraft_sky_grid_archive(bst_spacecraft_sky_grid *grid, bst_archive *archive) {
    grid->first = bst_archive_integer(archive, grid->first, INT64_MIN / 4, INT64_MAX / 4);
    grid->filled = (int)bst_archive_integer(archive, grid->filled, 0, 4);
    BST_ARCHIVE(archive, grid->node);
    BST_ARCHIVE(archive, grid->attitude);
}
