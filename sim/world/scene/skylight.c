#include <assert.h>
#include <stdlib.h>
#include <string.h>

#include "sim/messages/message_invariants.h"
#include "sim/world/scene/skylight_internal.h"
#include "sim/world/scene/stray.h"
#include "sim/world/scene/stray_map.h"
#include "sim/world/scene/zodiacal.h"
#include "sim/world/world_internal.h"

enum { STAR_NODES = 8 };

/* upper limit of the angular distance between nodes of the sky background */
#define MOST_STEP_RAD (0.3 * BST_DEG_RAD)

#define DEG2_PER_SR (1.0 / (BST_DEG_RAD * BST_DEG_RAD))

bool bst_skylight_varies(const bst_camera *camera) {
    const bst_background_config *c = &camera->background;
    const bst_optics_vignetting *v = &camera->optics.vignetting;
    bool added = c->stray_e_per_s != 0.0 || *c->stray_map_file;
    for (int i = 0; i < 2; i++) {
        added = added || c->gradient_e_per_s[i] != 0.0;
    }
    for (int i = 0; i < 3; i++) {
        added = added || c->curvature_e_per_s[i] != 0.0;
    }
    return c->model == BST_BACKGROUND_SKY || added || v->model != BST_VIGNETTING_NONE ||
           v->limit_px > 0.0;
}

bool bst_skylight_may_vary(const bst_camera *camera) {
    return bst_skylight_varies(camera) || bst_discs_wanted(camera);
}

bst_status bst_skylight_create(bst_ctx *ctx, const bst_world *world, const bst_camera *camera,
                               bst_skylight **out) {
    *out = NULL;
    bst_skylight *b = calloc(1, sizeof *b);
    if (!b) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the background");
    }
    b->world = world;
    bst_skylight_fill_weights(&b->weights);
    bst_skylight_set_camera(b, camera);
    *out = b;
    return BST_OK;
}

void bst_skylight_set_camera(bst_skylight *b, const bst_camera *camera) {
    b->camera = camera;
    b->step = BST_SKYLIGHT_MOST_STEP_PX;
    while (b->step > 1 && b->step * bst_camera_scale_rad(camera) > MOST_STEP_RAD) {
        b->step /= 2;
    }
}

void bst_skylight_free(bst_skylight *b) {
    if (b) {
        free(b->stars.value);
        free(b->sky.value);
        free(b->nodes.value);
        free(b->pixels.value);
        free(b);
    }
}

bst_status bst_skylight_set_nodes(bst_ctx *ctx, bst_skylight_lattice *l, int step, bst_window w) {
    l->step = step;
    l->x0 = w.x0 / step * step;
    l->y0 = w.y0 / step * step;
    l->columns = (w.x0 + w.width - 1 - l->x0) / step + 2;
    l->rows = (w.y0 + w.height - 1 - l->y0) / step + 2;
    l->columns = l->columns < 3 ? 3 : l->columns;
    l->rows = l->rows < 3 ? 3 : l->rows;
    size_t need = (size_t)l->columns * (size_t)l->rows;
    if (need > l->capacity) {
        free(l->value);
        l->value = malloc(need * sizeof *l->value);
        l->capacity = l->value ? need : 0;
        if (!l->value) {
            return bst_fail(ctx, BST_ERR_MEMORY, "no memory for a background of %zu nodes", need);
        }
    }
    return BST_OK;
}

/* Rotates a direction from the camera frame to GCRF. */
static bst_vec3 to_gcrf(const bst_skylight_painter *p, bst_vec3 direction) {
    return bst_mat3_mul_vec(&p->gcrf_from_cam, direction);
}

/* Radiance of stars that are not rendered, stars of V = 0 per steradian. */
static double star_light(const bst_skylight_painter *p, bst_vec3 icrs) {
    const bst_background_config *c = &p->b->camera->background;
    bool sky = c->model == BST_BACKGROUND_SKY;
    const bst_faint_sky *faint = p->b->world->faint;
    double sum = 0.0;
    if (faint && (sky ? c->starlight : isfinite(p->b->world->faint_limit_v_mag))) {
        sum += bst_faint_sky_undrawn(faint, icrs, p->around->v_limit, p->around->faint_limit);
    }
    if (sky && c->diffuse_galactic_fraction > 0.0) {
        bst_star_counts counts;
        bst_star_counts_at(icrs, &counts);
        sum += c->diffuse_galactic_fraction * DEG2_PER_SR *
               bst_star_counts_light(&counts, BST_COUNT_FIRST_V, INFINITY);
    }
    return sum;
}

/* Computes the sky without bright bodies at the nodes, electrons per pixel and second. */
static bst_status paint_sky(bst_ctx *ctx, const bst_skylight_painter *p, bst_skylight *b,
                            bst_window window) {
    const bst_camera *camera = b->camera;
    const bst_background_config *c = &camera->background;
    bool sky = c->model == BST_BACKGROUND_SKY;
    double uniform =
        sky ? 0.0 : bst_camera_background_e_per_s(camera) - bst_camera_optics_e_per_s(camera);
    BST_TRY(bst_skylight_set_nodes(ctx, &b->sky, b->step, window));
    bst_skylight_lattice *s = &b->sky, *l = &b->stars;
    bst_window nodes = {s->x0, s->y0, (s->columns - 1) * s->step + 1, (s->rows - 1) * s->step + 1};
    BST_TRY(bst_skylight_set_nodes(ctx, l, STAR_NODES * b->step, nodes));
    for (int j = 0; j < l->rows; j++) {
        for (int i = 0; i < l->columns; i++) {
            bst_vec3 d = bst_camera_unproject(camera, l->x0 + i * l->step, l->y0 + j * l->step);
            l->value[j * l->columns + i] = (float)(p->star_e * star_light(p, to_gcrf(p, d)));
        }
    }
    for (int j = 0; j < s->rows; j++) {
        for (int i = 0; i < s->columns; i++) {
            int x = s->x0 + i * s->step, y = s->y0 + j * s->step;
            double e = uniform + (double)bst_skylight_interpolate(l, (float)x, (float)y);
            if (sky && c->zodiacal) {
                bst_vec3 d = to_gcrf(p, bst_camera_unproject(camera, x, y));
                e += p->sun_e * 1e-4 * DEG2_PER_SR * bst_zodiacal_towards(d, p->sun);
            }
            s->value[j * s->columns + i] = (float)e;
        }
    }
    return BST_OK;
}

/* Distance of a corner from an edge within which the edge may be in its cells, px. */
static double edge_reach_px(const bst_skylight_painter *p) {
    return 1.06 * p->b->step / bst_camera_shrink(p->b->camera);
}

/* Whether no edge of a disc or of the vignetting can be on the sensor, by bounds that need few
 * directions. They do not depend on the window. */
static bool is_far_from_edges(const bst_skylight_painter *p) {
    const bst_camera *camera = p->b->camera;
    const int step = p->b->step;
    const double x = (double)(((int)camera->width_px + step - 1) / step * step);
    const double y = (double)(((int)camera->height_px + step - 1) / step * step);
    const double limit = camera->optics.vignetting.limit_px, reach = edge_reach_px(p);
    double corner_px = 0.0, radius = 0.0;
    const bst_vec3 middle = bst_camera_unproject(camera, 0.5 * x, 0.5 * y);
    for (int k = 0; k < 4; k++) {
        const double cx = k & 1 ? x : 0.0, cy = k >> 1 ? y : 0.0;
        corner_px = fmax(corner_px,
                         hypot(cx - bst_camera_centre_x(camera), cy - bst_camera_centre_y(camera)));
        radius = fmax(radius, bst_vec3_angle(middle, bst_camera_unproject(camera, cx, cy)));
    }
    if (limit > 0.0 && limit < corner_px + reach) {
        return false;
    }
    /* with a margin for distortion, which may bend a side outwards */
    return !bst_discs_any(&p->discs) ||
           bst_discs_none_begins(&p->discs, middle, 1.05 * radius, reach);
}

/* Background at a pixel, with the interpolated sky. */
static float paint_pixel(const bst_skylight_painter *p, int x, int y) {
    unsigned sides;
    return (float)bst_skylight_paint(p, x, y, &sides);
}

/* Background at a position between pixels, from the four around it. */
static double place_at(const bst_skylight *b, double x_px, double y_px) {
    const bst_window *w = &b->window;
    double x = fmin(fmax(x_px, w->x0), w->x0 + w->width - 1.0);
    double y = fmin(fmax(y_px, w->y0), w->y0 + w->height - 1.0);
    int i = (int)floor(x), j = (int)floor(y);
    double s = x - i, t = y - j, sum = 0.0;
    for (int k = 0; k < 4; k++) {
        double weight = (k & 1 ? s : 1.0 - s) * (k >> 1 ? t : 1.0 - t);
        sum += weight > 0.0 ? weight * (double)paint_pixel(&b->painter, i + (k & 1), j + (k >> 1))
                            : 0.0;
    }
    return b->painter.map_e > 0.0
               ? sum + b->painter.map_e * bst_stray_map_at(b->camera->stray_map, x, y)
               : sum;
}

/* Background at a node. */
static float paint_node(const bst_skylight *b, int k) {
    const bst_skylight_lattice *n = &b->nodes;
    unsigned sides;
    return (float)bst_skylight_paint_at(&b->painter, n->x0 + k % n->columns * n->step,
                                        n->y0 + k / n->columns * n->step, (double)b->sky.value[k],
                                        &sides);
}

/* Paints the nodes around a position on the lattice that are not painted yet. */
static void paint_around(bst_skylight *b, double x, double y) {
    const bst_skylight_lattice *n = &b->nodes;
    const int i = bst_skylight_cell_of(((float)x - (float)n->x0) / (float)n->step, n->columns);
    const int j = bst_skylight_cell_of(((float)y - (float)n->y0) / (float)n->step, n->rows);
    for (int c = 0; c < 4; c++) {
        const int k = (j + (c >> 1)) * n->columns + i + (c & 1);
        n->value[k] = isnan(n->value[k]) ? paint_node(b, k) : n->value[k];
    }
}

double bst_skylight_at(const bst_skylight_map *map, double x_px, double y_px) {
    if (map->at_pixels) {
        return place_at(map->at_pixels, x_px, y_px);
    }
    double x = fmin(fmax(x_px, map->x0_px), map->x0_px + (map->columns - 1.0) * map->step_px);
    double y = fmin(fmax(y_px, map->y0_px), map->y0_px + (map->rows - 1.0) * map->step_px);
    if (map->columns < 2 || map->rows < 2) {
        size_t i = (size_t)(x - map->x0_px + 0.5), j = (size_t)(y - map->y0_px + 0.5);
        return (double)map->e[j * (size_t)map->columns + i];
    }
    if (map->at_nodes) {
        paint_around(map->at_nodes, x, y);
    }
    const bst_skylight_lattice l = {.step = map->step_px,
                                    .x0 = map->x0_px,
                                    .y0 = map->y0_px,
                                    .columns = map->columns,
                                    .rows = map->rows,
                                    .value = (float *)(uintptr_t)map->e};
    return (double)bst_skylight_interpolate(&l, (float)x, (float)y);
}

/* Computes the quantities of the sky background that all pixels share. */
static void prepare(bst_skylight_painter *p) {
    const bst_camera *camera = p->b->camera;
    const bst_background_config *c = &camera->background;
    const bst_scene_surroundings *a = p->around;
    double pixel_sr = bst_camera_scale_rad(camera) * bst_camera_scale_rad(camera);
    bst_quat mid = a->q[BST_DISC_PARTS / 2];
    p->gcrf_from_cam = bst_quat_to_mat3(bst_quat_conj(mid));
    p->sun = bst_vec3_sub(a->bodies.sun_m, a->eye_m);
    p->sun_e = bst_camera_electrons_per_s(camera, 0.0) * pixel_sr;
    p->star_e = bst_camera_star_electrons_per_s(camera, 0.0, NAN) * pixel_sr;
    p->earth_e = bst_camera_thermal_electrons_per_s(camera, c->earth_temperature_k, pixel_sr);
    p->even_e = bst_camera_optics_e_per_s(camera);
    bst_discs_make(camera, a, &p->discs);
    double stray_e = 0.0;
    if (c->model == BST_BACKGROUND_SKY && camera->pst) {
        /* irradiance per detector area equals that at the entrance times PST; the PST includes
         * light-gathering area and transmission */
        double gathered = 0.25 * BST_PI * camera->aperture_m * camera->aperture_m *
                          (1.0 - camera->obscuration) * camera->throughput;
        double pitch = bst_scene_pst_pixel_m(camera->pst);
        double irradiance = bst_stray_irradiance(camera->pst, c, a->eye_m, &a->bodies,
                                                 to_gcrf(p, (bst_vec3){0, 0, 1}));
        stray_e = gathered > 0.0 ? irradiance * pitch * pitch *
                                       bst_camera_electrons_per_s(camera, 0.0) / gathered
                                 : 0.0;
    }
    bool shared = camera->stray_map && c->stray_map == BST_STRAY_MAP_SHARE;
    p->even_e += shared ? 0.0 : stray_e;
    p->map_e = camera->stray_map ? (shared ? stray_e : 1.0) * a->exposure_s : 0.0;
}

/* Computes the background per pixel by interpolation between the nodes. */
static void spread_nodes(bst_skylight *b) {
    bst_skylight_lattice *out = &b->pixels;
    const bst_skylight_lattice *n = &b->nodes;
    for (int y = 0; y < out->rows; y++) {
        int down = out->y0 + y - n->y0, j = down / n->step;
        float t = (float)(down - j * n->step) / (float)n->step;
        float *row = out->value + (size_t)y * (size_t)out->columns;
        for (int i = 0; i < n->columns - 1; i++) {
            const float *a = n->value + (size_t)j * (size_t)n->columns + i, *c = a + n->columns;
            float left = a[0] + t * (c[0] - a[0]), right = a[1] + t * (c[1] - a[1]);
            float slope = (right - left) / (float)n->step;
            int first = n->x0 + i * n->step - out->x0, last = first + n->step;
            int from = first > 0 ? first : 0, to = last < out->columns ? last : out->columns;
            for (int x = from; x < to; x++) {
                row[x] = left + slope * (float)(x - first);
            }
        }
    }
}

/* Adds the map of stray light to the pixels. */
static void add_stray_map(const bst_skylight_painter *p, bst_skylight_lattice *pixels) {
    for (int y = 0; y < pixels->rows; y++) {
        bst_stray_map_add_row(p->b->camera->stray_map, pixels->x0, pixels->y0 + y, pixels->columns,
                              (float)p->map_e, pixels->value + (size_t)y * (size_t)pixels->columns);
    }
}

void bst_skylight_set_places_only(bst_skylight *b) {
    b->places_only = true;
}

/* Computes the background per pixel. */
static bst_status make_pixels(bst_ctx *ctx, const bst_skylight_painter *p, bst_skylight *b,
                              bool edge) {
    bst_skylight_lattice *out = &b->pixels;
    BST_TRY(bst_skylight_set_nodes(ctx, out, 1, b->window));
    out->columns = b->window.width;
    out->rows = b->window.height;
    if (edge) {
        bst_skylight_fill_cells(p, b);
    } else {
        spread_nodes(b);
    }
    if (p->map_e > 0.0) {
        add_stray_map(p, out);
    }
    return BST_OK;
}

/* Smallest value of a map. */
static double least_of(const bst_skylight_lattice *l) {
    float least = INFINITY;
    for (int i = 0; i < l->columns * l->rows; i++) {
        least = l->value[i] < least ? l->value[i] : least;
    }
    return (double)least;
}

bst_status bst_skylight_make(bst_ctx *ctx, bst_skylight *b, const bst_scene_surroundings *around,
                             bst_window window, const bst_skylight_map **out) {
    assert(b && around && out && bst_window_is_valid(&window));
    b->around = *around;
    b->window = window;
    b->painter = (bst_skylight_painter){.b = b, .around = &b->around};
    prepare(&b->painter);
    const bst_skylight_painter p = b->painter;
    BST_TRY(paint_sky(ctx, &p, b, window));
    bst_skylight_lattice *n = &b->nodes;
    BST_TRY(bst_skylight_set_nodes(ctx, n, b->step, window));
    const bool mapped = p.map_e > 0.0, edge = b->step > 1 && !is_far_from_edges(&p);
    const bst_skylight *const at_pixels = (edge || mapped) && b->places_only ? b : NULL;
    /* ghosts need the least value of all nodes */
    const bool by_need = b->places_only && (edge || (!mapped && !b->camera->ghost_images));
    for (int k = 0; k < n->columns * n->rows && (by_need || !edge); k++) {
        n->value[k] = by_need ? NAN : paint_node(b, k);
    }
    if ((edge || mapped) && !b->places_only) {
        BST_TRY(make_pixels(ctx, &p, b, edge));
        n = &b->pixels;
    }
    const double least = by_need ? 0.0 : least_of(n);
    b->map = (bst_skylight_map){n->step,    n->x0,     n->y0,
                                n->columns, n->rows,   n->value,
                                least,      at_pixels, by_need && !at_pixels ? b : NULL};
    *out = &b->map;
    return BST_OK;
}
