#include "sim/optics/ghosts.h"

#include <assert.h>
#include <stdlib.h>

#include "sim/optics/ghost_map.h"

static bst_status check(bst_ctx *ctx, const bst_ghost_config *c, int i) {
    if (c->radius_px > 0.0 && c->fwhm_px > 0.0) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "ghosts/%d/fwhm_px: is %g, and radius_px is %g; give either a Gaussian or "
                        "a disc",
                        i, c->fwhm_px, c->radius_px);
    }
    if (c->inner_radius_px > 0.0 && !(c->inner_radius_px < c->radius_px)) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "ghosts/%d/inner_radius_px: is %g, but has to be below radius_px (%g)", i,
                        c->inner_radius_px, c->radius_px);
    }
    return BST_OK;
}

bst_status bst_ghosts_create(bst_ctx *ctx, const bst_camera *camera, const char *base_dir,
                             bst_ghosts **out) {
    assert(camera && base_dir && out);
    const bst_ghost_config *list = camera->ghosts.items;
    int count = camera->ghosts.count;
    *out = NULL;
    if (count == 0) {
        return BST_OK;
    }
    bst_ghosts *g = calloc(1, sizeof *g + (size_t)count * sizeof *g->items);
    if (!g) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for %d ghosts", count);
    }
    bst_status status = BST_OK;
    for (int i = 0; i < count && status == BST_OK; i++) {
        const bst_ghost_config *c = &list[i];
        status = check(ctx, c, i);
        if (status != BST_OK) {
            break;
        }
        g->items[g->count] =
            (bst_ghost){.intensity = c->intensity,
                        .factor = c->factor,
                        .centre_x_px = bst_camera_centre_x(camera) + c->centre_px[0],
                        .centre_y_px = bst_camera_centre_y(camera) + c->centre_px[1],
                        .sigma_px = c->fwhm_px / BST_FWHM_PER_SIGMA,
                        .radius_px = c->radius_px,
                        .inner_radius_px = c->inner_radius_px,
                        .outside_px = c->outside_px};
        if (*c->map_file) {
            status = bst_ghost_map_load(ctx, c->map_file, base_dir, &g->items[g->count].map);
            status = status == BST_OK
                         ? status
                         : bst_fail_prefix(ctx, BST_ERR_CONFIG, "ghosts/%d/map_file", i);
        }
        g->count += status == BST_OK;
    }
    if (status != BST_OK) {
        bst_ghosts_free(g);
        return status;
    }
    *out = g;
    return BST_OK;
}

void bst_ghosts_free(bst_ghosts *g) {
    for (int i = 0; g && i < g->count; i++) {
        bst_ghost_map_free(&g->items[i].map);
    }
    free(g);
}

void bst_ghost_place(const bst_ghost *g, double x_px, double y_px, double to[2]) {
    if (g->map.columns > 0) {
        bst_ghost_map_place(&g->map, x_px, y_px, to);
        return;
    }
    to[0] = g->centre_x_px + g->factor * (x_px - g->centre_x_px);
    to[1] = g->centre_y_px + g->factor * (y_px - g->centre_y_px);
}

double bst_ghost_intensity(const bst_ghost *g, const bst_camera *camera, double x_px, double y_px) {
    const bst_ghost_map *m = &g->map;
    double far = g->outside_px;
    if (m->columns > 0) {
        bool inside = x_px >= m->source_x[0] - far && x_px <= m->source_x[m->columns - 1] + far &&
                      y_px >= m->source_y[0] - far && y_px <= m->source_y[m->rows - 1] + far;
        return inside ? g->intensity * bst_ghost_map_intensity(m, x_px, y_px) : 0.0;
    }
    bool inside = x_px >= -0.5 - far && y_px >= -0.5 - far &&
                  x_px <= (double)camera->width_px - 0.5 + far &&
                  y_px <= (double)camera->height_px - 0.5 + far;
    return inside ? g->intensity : 0.0;
}

double bst_ghost_magnification(const bst_ghost *g) {
    return g->map.columns > 0 ? g->map.magnification : fabs(g->factor);
}

double bst_ghost_reach_px(const bst_ghost *g) {
    return g->radius_px + 5.5 * g->sigma_px; /* beyond 5.5 sigma: 3e-7 of a Gaussian's light */
}

double bst_ghost_variance_px2(const bst_ghost *g) {
    double r2 = g->radius_px * g->radius_px, hole2 = g->inner_radius_px * g->inner_radius_px;
    return g->sigma_px * g->sigma_px + 0.25 * (r2 + hole2);
}

double bst_ghost_peak_share(const bst_ghost *g) {
    double r2 = g->radius_px * g->radius_px, hole2 = g->inner_radius_px * g->inner_radius_px;
    double disc = r2 > 0.0 ? 1.0 / (BST_PI * (r2 - hole2)) : 1.0;
    double gauss = g->sigma_px > 0.0 ? 1.0 / (2.0 * BST_PI * g->sigma_px * g->sigma_px) : 1.0;
    return fmin(1.0, fmin(disc, gauss));
}

bst_vec3 bst_ghost_direction(const bst_ghost *g, const bst_camera *camera, bst_vec3 v_cam) {
    double x, y, to[2];
    if (!bst_camera_project(camera, v_cam, &x, &y)) {
        return (bst_vec3){0.0, 0.0, -1.0};
    }
    bst_ghost_place(g, x, y, to);
    return bst_camera_unproject(camera, to[0], to[1]);
}
