#include "sim/satellite/resolved_image.h"

#include <assert.h>
#include <stdlib.h>
#include <string.h>

#include "sim/satellite/resolved_faces.h"

bst_status bst_resolved_create(bst_ctx *ctx, const bst_satellite *satellite, bst_resolved **out) {
    bst_resolved *r = *out = calloc(1, sizeof *r);
    if (!r) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the image of a satellite");
    }
    r->satellite = satellite;
    int most = 0;
    for (int o = 0; o < satellite->occluder_count; o++) {
        int count = satellite->occluders[o].vertex_count;
        most = count > most ? count : most;
    }
    r->outline = malloc((4 * (size_t)most + 4) * sizeof *r->outline);
    r->hull = malloc((8 * (size_t)most + 8) * sizeof *r->hull);
    bst_status status = r->outline && r->hull
                            ? bst_curved_places_create(ctx, satellite, &r->places)
                            : bst_fail(ctx, BST_ERR_MEMORY, "no memory for the image of a body");
    if (status != BST_OK) {
        bst_resolved_free(r);
        *out = NULL;
    }
    return status;
}

void bst_resolved_free(bst_resolved *r) {
    if (r) {
        free(r->image.cells);
        free(r->image.part);
        free(r->lit_cells);
        free(r->outline);
        free(r->hull);
        bst_curved_places_free(&r->places);
        bst_visible_surface_free(&r->surface);
        bst_resolved_areas_free(&r->areas);
        bst_polygon_coverage_free(&r->whole);
        bst_polygon_coverage_free(&r->lit);
        bst_polygon_coverage_free(&r->hidden);
        free(r);
    }
}

const bst_resolved_image *bst_resolved_image_of(const bst_resolved *r) {
    return &r->image;
}

bool bst_resolved_box(const bst_satellite_pose *pose, const bst_resolved_view *view, double low[2],
                      double high[2]) {
    bst_mat3 turn = bst_quat_to_mat3(view->q_image_from_body);
    /* facets of curved surfaces are outside of it by a part of their size */
    double margin_m = 0.02 * pose->satellite->radius_m;
    low[0] = low[1] = INFINITY;
    high[0] = high[1] = -INFINITY;
    for (int v = 0; v < pose->satellite->vertex_count; v++) {
        bst_vec3 p = bst_vec3_add(view->origin_m, bst_mat3_mul_vec(&turn, pose->vertices[v]));
        if (!(p.z > margin_m)) {
            return false;
        }
        double f = 1.0 / (p.z * view->scale_rad), margin = margin_m * f;
        const double at[2] = {p.x * f, p.y * f};
        for (int i = 0; i < 2; i++) { /* calls of fmin would take most of the time */
            low[i] = at[i] - margin < low[i] ? at[i] - margin : low[i];
            high[i] = at[i] + margin > high[i] ? at[i] + margin : high[i];
        }
    }
    return pose->satellite->vertex_count > 0;
}

bst_status bst_resolved_begin_box(bst_ctx *ctx, bst_resolved *r, const double low[2],
                                  const double high[2], double cell_px) {
    assert(cell_px > 0.0 && high[0] >= low[0] && high[1] >= low[1]);
    bst_resolved_image *m = &r->image;
    double x0 = floor(low[0] / cell_px), y0 = floor(low[1] / cell_px);
    double width = ceil(high[0] / cell_px) - x0, height = ceil(high[1] / cell_px) - y0;
    if (!(width * height <= BST_RESOLVED_CELLS_MAX) || fabs(x0) > 1e9 || fabs(y0) > 1e9) {
        return bst_fail(ctx, BST_ERR_RANGE,
                        "the image of a satellite has %.3g x %.3g px, which are %.3g million cells "
                        "(allowed: %d million); use a larger range or coarser pixels",
                        width * cell_px, height * cell_px, 1e-6 * width * height,
                        BST_RESOLVED_CELLS_MAX >> 20);
    }
    m->cell_px = cell_px;
    m->x0 = (int)x0;
    m->y0 = (int)y0;
    m->width = width < 1.0 ? 1 : (int)width;
    m->height = height < 1.0 ? 1 : (int)height;
    size_t need = (size_t)m->width * (size_t)m->height;
    if (need > r->cell_capacity) {
        free(m->cells);
        free(m->part);
        size_t capacity =
            need + need / 4; /* boxes of a body that turns differ from frame to frame */
        m->cells = malloc(capacity * sizeof *m->cells);
        m->part = malloc(capacity * sizeof *m->part);
        r->cell_capacity = m->cells && m->part ? capacity : 0;
        if (r->cell_capacity == 0) {
            return bst_fail(ctx, BST_ERR_MEMORY, "no memory for an image of %d x %d cells",
                            m->width, m->height);
        }
    }
    m->second = NULL;
    memset(m->penumbrae, 0, sizeof m->penumbrae);
    m->surface_light = m->curved_light = m->reached_px[0] = m->reached_px[1] = 0.0;
    return BST_OK;
}

bst_status bst_resolved_begin(bst_ctx *ctx, bst_resolved *r, const double low[2],
                              const double high[2], double cell_px) {
    BST_TRY(bst_resolved_begin_box(ctx, r, low, high, cell_px));
    bst_resolved_image *m = &r->image;
    size_t need = (size_t)m->width * (size_t)m->height;
    memset(m->cells, 0, need * sizeof *m->cells);
    memset(m->part, -1, need * sizeof *m->part);
    return bst_visible_surface_begin(ctx, &r->surface, m->width, m->height);
}

/* A pose with its view and light. */
static bst_resolved_adding start(bst_resolved *r, bst_satellite_pose *pose,
                                 const bst_resolved_view *view, const bst_resolved_light *light) {
    assert(pose->satellite == r->satellite && r->image.width > 0);
    bst_resolved_adding a = {.r = r,
                             .pose = pose,
                             .view = view,
                             .light = light,
                             .image_from_body = bst_quat_to_mat3(view->q_image_from_body),
                             .per_m = 1.0 / (view->scale_rad * r->image.cell_px)};
    a.eye_m = bst_vec3_scale(bst_mat3_transpose_mul_vec(&a.image_from_body, view->origin_m), -1.0);
    bst_resolved_set_hidden(&a);
    if (light) {
        a.earth = light->earthlight && light->earthlight->count > 0;
        bst_sun_disc_make(light->sun, light->sun_radius_rad, r->satellite->lobe_rad, &r->disc);
    }
    return a;
}

bst_status bst_resolved_add(bst_ctx *ctx, bst_resolved *r, bst_satellite_pose *pose,
                            const bst_resolved_view *view, const bst_resolved_light *light,
                            double weight, double *total) {
    const bst_satellite *sat = r->satellite;
    bst_resolved_adding a = start(r, pose, view, light);
    if (light) {
        bst_pose_look(pose, 0, bst_resolved_shadow_sun(light));
        if (a.earth) {
            bst_pose_look(pose, 1, light->earthlight->centre);
        }
    }
    BST_TRY(bst_resolved_reach(ctx, &a));
    BST_TRY(bst_resolved_reach_hidden(ctx, &a));
    bst_resolved_face f;
    for (int i = 0; i < sat->facet_count; i++) {
        f.part = sat->facets[i].part;
        f.body = 2 * sat->facets[i].occluder + sat->facets[i].inside;
        BST_TRY(sat->facets[i].curved >= 0 ? bst_resolved_add_curved_facet(ctx, &a, i, &f)
                                           : bst_resolved_add_plane_facet(ctx, &a, i, &f));
    }
    BST_TRY(bst_resolved_hide(ctx, &a));
    double sum;
    BST_TRY(bst_visible_surface_resolve(ctx, &r->surface, &pose->clip,
                                        BST_RESOLVED_SAME * sat->radius_m, 1.0 / a.per_m, weight,
                                        &r->image, &sum));
    if (total) {
        *total = sum;
    }
    return BST_OK;
}

bst_status bst_resolved_add_light(bst_ctx *ctx, bst_resolved *r, bst_satellite_pose *pose,
                                  const bst_resolved_view *view, const bst_resolved_light *light,
                                  double weight) {
    bst_resolved_adding a = start(r, pose, view, light);
    return bst_resolved_add_areas(ctx, &a, weight);
}
