#include "sim/world/scene/field_ghosts.h"

#include <assert.h>
#include <stdlib.h>
#include <string.h>

#include "sim/world/scene/body_limb.h"
#include "sim/world/scene/skylight.h"

/* Colours make a star brighter in the camera's band than its V magnitude says, at most by this. */
#define COLOUR_MARGIN_MAG 1.5

/* Upper bound of the light in a read-out pixel over a ghost's light. */
static double peak_share(const bst_field *field, const bst_field_scene *q, const bst_ghost *ghost) {
    double sigma = bst_camera_psf_sigma_px(field->camera);
    double psf = fmin(1.0, 1.0 / (2.0 * BST_PI * sigma * sigma)); /* of a pixel, per px^2 */
    return fmin(1.0, q->binning * q->binning * fmin(psf, bst_ghost_peak_share(ghost)));
}

void bst_field_limit_ghosts(const bst_field *field, bst_field_scene *q, const bst_truth *truth) {
    if (!(q->ghost_sigma > 0.0)) {
        return;
    }
    double sky = field->map ? fmin(field->map->least_e, truth->background_e) : truth->background_e;
    double read_e = bst_camera_read_noise_e(field->camera);
    double variance = q->binning * q->binning * (fmax(sky, 0.0) + truth->dark_e) + read_e * read_e;
    q->ghost_least_e = q->ghost_sigma * sqrt(fmax(variance, 0.01));
}

/* The query for sources that have ghosts: the sensor and what the ghosts say is around it, down to
 * the magnitude at which a ghost counts. */
static bst_field_scene sources_of_ghosts(const bst_field *field, const bst_field_scene *q) {
    const bst_camera *camera = field->camera;
    const bst_ghosts *ghosts = camera->ghost_images;
    bst_field_scene out = *q;
    double low[2] = {0.0, 0.0};
    double high[2] = {(double)camera->width_px, (double)camera->height_px}, share = 0.0;
    for (int i = 0; i < ghosts->count; i++) {
        const bst_ghost *g = &ghosts->items[i];
        const bst_ghost_map *m = &g->map;
        double far = g->outside_px, most = 1.0;
        double x0 = 0.0, y0 = 0.0, x1 = high[0], y1 = high[1];
        if (m->columns > 0) {
            x0 = m->source_x[0];
            x1 = m->source_x[m->columns - 1];
            y0 = m->source_y[0];
            y1 = m->source_y[m->rows - 1];
            most = 0.0;
            for (int k = 0; k < m->columns * m->rows; k++) {
                most = fmax(most, m->intensity[k]);
            }
        }
        low[0] = fmin(low[0], x0 - far);
        low[1] = fmin(low[1], y0 - far);
        high[0] = fmax(high[0], x1 + far);
        high[1] = fmax(high[1], y1 + far);
        share = fmax(share, g->intensity * most * peak_share(field, q, g));
    }
    out.lit = (bst_window){(int)floor(low[0]) - 1, (int)floor(low[1]) - 1,
                           (int)ceil(high[0] - low[0]) + 2, (int)ceil(high[1] - low[1]) + 2};
    out.window = out.lit;
    out.wider = false;
    out.margin_px = 0.0;
    out.cone = out.near_cone = bst_field_find_cone(field, &out, out.lit);
    double least_e_per_s = q->ghost_least_e / (share * fmax(q->exposure_s, 1e-9));
    double v = share > 0.0 ? bst_camera_v_mag(camera, least_e_per_s) + COLOUR_MARGIN_MAG : -99.0;
    out.v_limit = fmin(q->v_limit, v);
    out.faint_limit = fmin(q->faint_limit, v);
    return out;
}

bst_status bst_field_near_ghosts(bst_ctx *ctx, bst_field *field, const bst_field_scene *q,
                                 int *count) {
    *count = 0;
    if (!(q->ghost_sigma > 0.0)) {
        return BST_OK;
    }
    if (!field->ghost_near) {
        size_t room = (size_t)bst_world_object_count(field->world) + 1;
        field->ghost_near = malloc(room * sizeof *field->ghost_near);
        if (!field->ghost_near) {
            return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a field query");
        }
    }
    const bst_field_scene wide = sources_of_ghosts(field, q);
    const bst_world_view_span span = {field->observer, q->start_s, q->end_s};
    return bst_world_view_near(ctx, field->view, &span, wide.cone.axis, wide.cone.radius,
                               field->ghost_near, count);
}

/* True if a place is in a window or near it. */
static bool is_near(const bst_window *w, const double at[2], double margin) {
    return at[0] >= w->x0 - margin && at[1] >= w->y0 - margin &&
           at[0] <= w->x0 + w->width - 1 + margin && at[1] <= w->y0 + w->height - 1 + margin;
}

/* Appends the ghosts of a source that count. */
static bst_status add_of_source(bst_ctx *ctx, bst_field *field, const bst_field_scene *q,
                                const bst_scene_source *source, int *count) {
    const bst_camera *camera = field->camera;
    const bst_ghosts *ghosts = camera->ghost_images;
    double x, y, at[2];
    bool hidden = source->body && bst_body_limb_behind(source, 0.5) > 0.0;
    if (source->occulted || hidden ||
        !bst_camera_project(camera, bst_quat_rotate(field->q_mid, source->apparent_mid), &x, &y)) {
        return BST_OK;
    }
    for (int i = 0; i < ghosts->count; i++) {
        const bst_ghost *g = &ghosts->items[i];
        double intensity = bst_ghost_intensity(g, camera, x, y);
        double e = intensity * source->electrons_per_s * q->exposure_s;
        bst_ghost_place(g, x, y, at);
        double motion = (q->margin_px - q->image_margin_px) * bst_ghost_magnification(g);
        double margin = q->image_margin_px + motion + bst_ghost_reach_px(g);
        if (!(e * peak_share(field, q, g) > q->ghost_least_e) || !is_near(&q->lit, at, margin)) {
            continue;
        }
        BST_TRY(bst_field_reserve_sources(ctx, field, *count + 1));
        bst_scene_source *s = &field->sources[(*count)++];
        *s = *source;
        s->kind = source->kind == BST_SOURCE_STAR ? BST_SOURCE_STAR_GHOST : BST_SOURCE_OBJECT_GHOST;
        s->ghost = g;
        s->shape = NULL;
        s->body = NULL;
        s->electrons_per_s *= intensity;
        s->v_mag -= 2.5 * log10(intensity);
        s->outside = q->wider && !is_near(&q->window, at, margin);
    }
    return BST_OK;
}

/* Moves the last `ghosts` of `count` sources before the objects. */
static bst_status put_before_objects(bst_ctx *ctx, bst_scene_source *sources, int stars, int count,
                                     int ghosts) {
    int objects = count - ghosts - stars;
    if (ghosts == 0 || objects == 0) {
        return BST_OK;
    }
    size_t bytes = (size_t)objects * sizeof *sources;
    bst_scene_source *kept = malloc(bytes);
    if (!kept) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for %d sources", objects);
    }
    memcpy(kept, sources + stars, bytes);
    memmove(sources + stars, sources + stars + objects, (size_t)ghosts * sizeof *sources);
    memcpy(sources + stars + ghosts, kept, bytes);
    free(kept);
    return BST_OK;
}

bst_status bst_field_add_ghosts(bst_ctx *ctx, bst_field *field, const bst_field_scene *q, int stars,
                                int near, int parts, int *count) {
    assert(stars >= 0 && stars <= *count && parts + near <= field->part_capacity);
    if (!(q->ghost_sigma > 0.0)) {
        return BST_OK;
    }
    const bst_field_scene wide = sources_of_ghosts(field, q);
    int first = *count, found;
    BST_TRY(bst_field_query_stars(ctx, field, &wide, &found));
    for (int i = 0; i < found; i++) {
        bst_scene_source source;
        if (bst_field_make_star(field, &wide, &field->stars[i], &source)) {
            BST_TRY(add_of_source(ctx, field, q, &source, count));
        }
    }
    const bst_scene_object_query objects = {.view = field->view,
                                            .camera = field->camera,
                                            .span = {field->observer, q->start_s, q->end_s},
                                            .q_mid = field->q_mid,
                                            .lit = wide.lit,
                                            .window = wide.window,
                                            .cone = wide.cone,
                                            .near_cone = wide.near_cone};
    for (int i = 0; i < near; i++) {
        bst_scene_source source;
        bool there;
        if (bst_field_is_self(field, field->ghost_near[i])) {
            continue;
        }
        BST_TRY(bst_field_object(ctx, &objects, field->ghost_near[i], &field->parts[parts], &source,
                                 &there));
        if (there) {
            parts++;
            BST_TRY(add_of_source(ctx, field, q, &source, count));
        }
    }
    return put_before_objects(ctx, field->sources, stars, *count, *count - first);
}
