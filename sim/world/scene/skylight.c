#include "sim/world/scene/skylight.h"

#include <assert.h>
#include <stdlib.h>
#include <string.h>

#include "sim/messages/message_invariants.h"
#include "sim/world/scene/stray.h"
#include "sim/world/scene/stray_map.h"
#include "sim/world/scene/zodiacal.h"
#include "sim/world/world_internal.h"

enum { MOST_STEP_PX = 32, STAR_NODES = 8 };

/* upper limit of the angular distance between nodes of the sky background */
#define MOST_STEP_RAD (0.3 * BST_DEG_RAD)

#define DEG2_PER_SR (1.0 / (BST_DEG_RAD * BST_DEG_RAD))

/* Sky background at nodes of the sensor. */
typedef struct lattice {
    int step, x0, y0, columns, rows;
    float *value;
    size_t capacity;
} lattice;

/* Corner of cells of the sensor: its distance from the nearest edge of a disc or of the vignetting,
 * and whether the Earth there is lit, and dark. */
typedef struct cell_corner {
    double edge_px;
    bool day, night;
} cell_corner;

/* State of computing the background map of one exposure. */
typedef struct painter {
    const bst_skylight *b;
    const bst_scene_surroundings *around;
    bst_discs discs;
    bst_mat3 gcrf_from_cam;
    bst_vec3 sun;
    double sun_e, star_e; /* electrons per pixel and second of one star of V = 0 per steradian */
    double even_e;        /* uniform background per pixel and second, after vignetting */
    double earth_e;       /* the Earth's own emission, per pixel and second */
    double map_e; /* electrons of an exposure that 1 of the map of stray light is; 0: none */
} painter;

struct bst_skylight {
    const bst_world *world;
    const bst_camera *camera;
    int step;
    lattice stars, sky, nodes, pixels;
    cell_corner *corners; /* two rows of `row_corners` */
    int row_corners;
    bst_skylight_map map;
    bool places_only;
    /* of the latest map, for places */
    painter painter;
    bst_scene_surroundings around;
    bst_window window;
};

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

/* Index of the cell that has a position, in steps from the first node; the first or last beyond. */
static int cell_of(float u, int nodes) {
    const int i = (int)floorf(u);
    return i < 0 ? 0 : i > nodes - 2 ? nodes - 2 : i;
}

/* Bilinear interpolation between nodes. The step is a power of two: the weights are exact, and
 * overlapping maps agree to the bit. */
static float interpolate(const lattice *l, float x, float y) {
    float u = (x - (float)l->x0) / (float)l->step, v = (y - (float)l->y0) / (float)l->step;
    int i = cell_of(u, l->columns), j = cell_of(v, l->rows);
    float s = u - (float)i, t = v - (float)j;
    const float *a = l->value + (size_t)j * (size_t)l->columns + (size_t)i, *b = a + l->columns;
    float left = a[0] + t * (b[0] - a[0]), right = a[1] + t * (b[1] - a[1]);
    return left + s * (right - left);
}

bst_status bst_skylight_create(bst_ctx *ctx, const bst_world *world, const bst_camera *camera,
                               bst_skylight **out) {
    *out = NULL;
    bst_skylight *b = calloc(1, sizeof *b);
    if (!b) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the background");
    }
    b->world = world;
    bst_skylight_set_camera(b, camera);
    *out = b;
    return BST_OK;
}

void bst_skylight_set_camera(bst_skylight *b, const bst_camera *camera) {
    b->camera = camera;
    b->step = MOST_STEP_PX;
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
        free(b->corners);
        free(b);
    }
}

/* Sets the nodes around a rectangle of pixels, at least 3 per axis. */
static bst_status set_nodes(bst_ctx *ctx, lattice *l, int step, bst_window w) {
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
static bst_vec3 to_gcrf(const painter *p, bst_vec3 direction) {
    return bst_mat3_mul_vec(&p->gcrf_from_cam, direction);
}

/* Radiance of stars that are not rendered, stars of V = 0 per steradian. */
static double star_light(const painter *p, bst_vec3 icrs) {
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
static bst_status paint_sky(bst_ctx *ctx, const painter *p, bst_skylight *b, bst_window window) {
    const bst_camera *camera = b->camera;
    const bst_background_config *c = &camera->background;
    bool sky = c->model == BST_BACKGROUND_SKY;
    double uniform =
        sky ? 0.0 : bst_camera_background_e_per_s(camera) - bst_camera_optics_e_per_s(camera);
    BST_TRY(set_nodes(ctx, &b->sky, b->step, window));
    lattice *s = &b->sky, *l = &b->stars;
    bst_window nodes = {s->x0, s->y0, (s->columns - 1) * s->step + 1, (s->rows - 1) * s->step + 1};
    BST_TRY(set_nodes(ctx, l, STAR_NODES * b->step, nodes));
    for (int j = 0; j < l->rows; j++) {
        for (int i = 0; i < l->columns; i++) {
            bst_vec3 d = bst_camera_unproject(camera, l->x0 + i * l->step, l->y0 + j * l->step);
            l->value[j * l->columns + i] = (float)(p->star_e * star_light(p, to_gcrf(p, d)));
        }
    }
    for (int j = 0; j < s->rows; j++) {
        for (int i = 0; i < s->columns; i++) {
            int x = s->x0 + i * s->step, y = s->y0 + j * s->step;
            double e = uniform + (double)interpolate(l, (float)x, (float)y);
            if (sky && c->zodiacal) {
                bst_vec3 d = to_gcrf(p, bst_camera_unproject(camera, x, y));
                e += p->sun_e * 1e-4 * DEG2_PER_SR * bst_zodiacal_towards(d, p->sun);
            }
            s->value[j * s->columns + i] = (float)e;
        }
    }
    return BST_OK;
}

/* Total background at a pixel position, electrons per pixel of the exposure; sky_e from
 * paint_sky. */
static float paint(const painter *p, double x, double y, double sky_e) {
    const bst_camera *camera = p->b->camera;
    const bst_background_config *c = &camera->background;
    double seen = sky_e;
    if (bst_discs_any(&p->discs)) {
        bst_disc_light light = bst_discs_light(&p->discs, bst_camera_unproject(camera, x, y));
        seen = sky_e * (1.0 - light.earth) + p->sun_e * light.sunlight + p->earth_e * light.earth;
    }
    double u = (2.0 * x + 1.0) / (double)camera->width_px - 1.0;
    double v = (2.0 * y + 1.0) / (double)camera->height_px - 1.0;
    double added = c->stray_e_per_s + c->gradient_e_per_s[0] * u + c->gradient_e_per_s[1] * v +
                   c->curvature_e_per_s[0] * u * u + c->curvature_e_per_s[1] * u * v +
                   c->curvature_e_per_s[2] * v * v;
    double e = seen * bst_camera_illumination(camera, x, y) + p->even_e + added;
    return (float)(fmax(e, 0.0) * p->around->exposure_s);
}

/* Distance of a position from the edge of the vignetting, px. */
static double vignetting_edge_px(const bst_camera *camera, double x, double y) {
    double limit = camera->optics.vignetting.limit_px;
    double dx = x - bst_camera_centre_x(camera), dy = y - bst_camera_centre_y(camera);
    return limit > 0.0 ? fabs(hypot(dx, dy) - limit) : INFINITY;
}

/* Distance of a node from the nearest edge of a disc or of the vignetting, px. */
static double edge_px(const painter *p, double x, double y) {
    const bst_camera *camera = p->b->camera;
    double edge = vignetting_edge_px(camera, x, y);
    return bst_discs_any(&p->discs)
               ? fmin(edge, bst_discs_edge_px(&p->discs, bst_camera_unproject(camera, x, y)))
               : edge;
}

static void fill_corners(const painter *p, int x0, int y, cell_corner *row) {
    for (int i = 0; i < p->b->row_corners; i++) {
        int x = x0 + i * p->b->step;
        cell_corner *c = &row[i];
        c->edge_px = edge_px(p, x, y);
        bst_discs_daylight(&p->discs, bst_camera_unproject(p->b->camera, x, y), &c->day, &c->night);
    }
}

/* Begins rows of cells at pixel (x0, y0) that reach x1. */
static bst_status begin_cells(bst_ctx *ctx, const painter *p, bst_skylight *b, int x0, int y0,
                              int x1) {
    int count = (x1 - x0 + b->step - 1) / b->step + 1;
    cell_corner *corners = realloc(b->corners, 2 * (size_t)count * sizeof *corners);
    if (!corners) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for %d corners of background cells", count);
    }
    b->corners = corners;
    b->row_corners = count;
    fill_corners(p, x0, y0, corners + count);
    return BST_OK;
}

/* Proceeds to the row of cells whose lower corners are at y. */
static void next_cells(const painter *p, bst_skylight *b, int x0, int y) {
    cell_corner *last = b->corners + b->row_corners;
    memcpy(b->corners, last, (size_t)b->row_corners * sizeof *last);
    fill_corners(p, x0, y, last);
}

/* Distance of a corner from an edge within which the edge may be in its cells, px. */
static double edge_reach_px(const painter *p) {
    return 1.06 * p->b->step / bst_camera_shrink(p->b->camera);
}

/* Checks whether cell i of the row may contain an edge: within half a cell's diagonal, with a
 * margin for larger pixels off axis; or the terminator. */
static bool cell_has_edge(const painter *p, int i) {
    double near = INFINITY;
    bool day = false, night = false;
    for (int k = 0; k < 4; k++) {
        const cell_corner *c = &p->b->corners[(k >> 1) * p->b->row_corners + i + (k & 1)];
        near = fmin(near, c->edge_px);
        day = day || c->day;
        night = night || c->night;
    }
    return (day && night) || near < edge_reach_px(p);
}

/* Whether no edge of a disc can be on the sensor: a bound that needs one direction. */
static bool is_far_from_edges(const painter *p) {
    const bst_camera *camera = p->b->camera;
    const int step = p->b->step;
    const double x = (double)(((int)camera->width_px + step - 1) / step * step);
    const double y = (double)(((int)camera->height_px + step - 1) / step * step);
    const bst_vec3 middle = bst_camera_unproject(camera, 0.5 * x, 0.5 * y);
    double radius = 0.0;
    for (int k = 0; k < 4; k++) {
        radius = fmax(radius, bst_vec3_angle(middle, bst_camera_unproject(camera, k & 1 ? x : 0.0,
                                                                          k >> 1 ? y : 0.0)));
    }
    /* with a margin for distortion, which may bend a side outwards */
    return bst_discs_none_begins(&p->discs, middle, 1.05 * radius, edge_reach_px(p));
}

/* Whether the edge of a body's disc or of the vignetting crosses the sensor. */
static bst_status find_edge(bst_ctx *ctx, const painter *p, bst_skylight *b, bool *found) {
    const bst_camera *camera = b->camera;
    *found = false;
    if (b->step == 1 ||
        (!bst_discs_any(&p->discs) && !(camera->optics.vignetting.limit_px > 0.0))) {
        return BST_OK;
    }
    if (!(camera->optics.vignetting.limit_px > 0.0) && is_far_from_edges(p)) {
        return BST_OK;
    }
    BST_TRY(begin_cells(ctx, p, b, 0, 0, (int)camera->width_px));
    for (int y = 0; y < camera->height_px && !*found; y += b->step) {
        next_cells(p, b, 0, y + b->step);
        for (int i = 0; i < b->row_corners - 1 && !*found; i++) {
            *found = cell_has_edge(p, i);
        }
    }
    return BST_OK;
}

/* A square of pixels with the background at its corners: (x, y), (x + size, y), (x, y + size),
 * (x + size, y + size). */
typedef struct square {
    int x, y, size;
    float corner[4];
} square;

/* Interpolates between the corners of a square; size is a power of two. */
static float interpolate_square(const square *q, int x, int y) {
    float s = (float)(x - q->x) / (float)q->size, t = (float)(y - q->y) / (float)q->size;
    float left = q->corner[0] + t * (q->corner[2] - q->corner[0]);
    float right = q->corner[1] + t * (q->corner[3] - q->corner[1]);
    return left + s * (right - left);
}

/* Background at a pixel, with the interpolated sky. */
static float paint_pixel(const painter *p, int x, int y) {
    return paint(p, x, y, (double)interpolate(&p->b->sky, (float)x, (float)y));
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
    const lattice *n = &b->nodes;
    return paint(&b->painter, n->x0 + k % n->columns * n->step, n->y0 + k / n->columns * n->step,
                 (double)b->sky.value[k]);
}

/* Paints the nodes around a position on the lattice that are not painted yet. */
static void paint_around(bst_skylight *b, double x, double y) {
    const lattice *n = &b->nodes;
    const int i = cell_of(((float)x - (float)n->x0) / (float)n->step, n->columns);
    const int j = cell_of(((float)y - (float)n->y0) / (float)n->step, n->rows);
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
    const lattice l = {.step = map->step_px,
                       .x0 = map->x0_px,
                       .y0 = map->y0_px,
                       .columns = map->columns,
                       .rows = map->rows,
                       .value = (float *)(uintptr_t)map->e};
    return (double)interpolate(&l, (float)x, (float)y);
}

/* Cuts a square into four. True: linear interpolation between its corners agrees with the
 * background at the five new corners to 0.01 sigma of its photon noise or 3e-5 of it. Within the
 * four squares the error is then about a quarter of that where the light is smooth, and up to a few
 * times that at the limb and at the terminator. */
static bool cut_square(const painter *p, const square *q, square part[4]) {
    int half = q->size / 2;
    float v[3][3];
    bool even = true;
    for (int j = 0; j < 3; j++) {
        for (int i = 0; i < 3; i++) {
            if (i != 1 && j != 1) {
                v[j][i] = q->corner[j + i / 2];
                continue;
            }
            int x = q->x + i * half, y = q->y + j * half;
            v[j][i] = paint_pixel(p, x, y);
            float error = fabsf(v[j][i] - interpolate_square(q, x, y));
            even = even && error <= fmaxf(0.01F * sqrtf(fmaxf(v[j][i], 1.0F)), 3e-5F * v[j][i]);
        }
    }
    for (int k = 0; k < 4; k++) {
        int i = k & 1, j = k >> 1;
        part[k] = (square){q->x + i * half,
                           q->y + j * half,
                           half,
                           {v[j][i], v[j][i + 1], v[j + 1][i], v[j + 1][i + 1]}};
    }
    return even;
}

/* Fills the pixels of a square in the window: exactly, or by interpolation. */
static void fill_pixels(const painter *p, lattice *out, const square *q, bool exact) {
    int x1 = out->x0 + out->columns, y1 = out->y0 + out->rows;
    for (int y = q->y > out->y0 ? q->y : out->y0; y < q->y + q->size && y < y1; y++) {
        float *row = out->value + (size_t)(y - out->y0) * (size_t)out->columns;
        for (int x = q->x > out->x0 ? q->x : out->x0; x < q->x + q->size && x < x1; x++) {
            row[x - out->x0] = exact ? paint_pixel(p, x, y) : interpolate_square(q, x, y);
        }
    }
}

/* Fills a square by interpolation within its four quarters, or by smaller squares, down to pixels
 * where a blurred edge passes. Nine places of a small square see any edge in it, because it is
 * almost straight; in a large one a disc could lie between them. */
static void fill_square(const painter *p, lattice *out, const square *q) {
    enum { SMALL = 8, LEAST = 4 };
    const bst_camera *camera = p->b->camera;
    if (q->x + q->size <= out->x0 || q->x >= out->x0 + out->columns || q->y + q->size <= out->y0 ||
        q->y >= out->y0 + out->rows) {
        return;
    }
    if (q->size <= LEAST) {
        fill_pixels(p, out, q, true);
        return;
    }
    square part[4];
    bool even = cut_square(p, q, part);
    if (even && q->size > SMALL) {
        double x = q->x + 0.5 * q->size, y = q->y + 0.5 * q->size;
        double edge = fmin(vignetting_edge_px(camera, x, y),
                           bst_discs_sharp_edge_px(&p->discs, bst_camera_unproject(camera, x, y)));
        /* half a diagonal, and more: the light of the limb bends next to it */
        even = edge > 1.7 * q->size / bst_camera_shrink(camera);
    }
    for (int k = 0; k < 4; k++) {
        if (even) {
            fill_pixels(p, out, &part[k], false);
        } else {
            fill_square(p, out, &part[k]);
        }
    }
}

/* Computes the background per pixel, cell by cell of the nodes. */
static bst_status paint_pixels(bst_ctx *ctx, const painter *p, bst_skylight *b, bst_window window) {
    lattice *out = &b->pixels;
    const lattice *n = &b->nodes;
    BST_TRY(set_nodes(ctx, out, 1, window));
    out->columns = window.width;
    out->rows = window.height;
    for (int j = 0; j < n->rows - 1; j++) {
        for (int i = 0; i < n->columns - 1; i++) {
            const float *c = n->value + (size_t)j * (size_t)n->columns + i;
            const square cell = {n->x0 + i * n->step,
                                 n->y0 + j * n->step,
                                 n->step,
                                 {c[0], c[1], c[n->columns], c[n->columns + 1]}};
            fill_square(p, out, &cell);
        }
    }
    return BST_OK;
}

/* Computes the quantities of the sky background that all pixels share. */
static void prepare(painter *p) {
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
static bst_status spread_nodes(bst_ctx *ctx, bst_skylight *b, bst_window window) {
    lattice *out = &b->pixels;
    const lattice *n = &b->nodes;
    BST_TRY(set_nodes(ctx, out, 1, window));
    out->columns = window.width;
    out->rows = window.height;
    for (int y = 0; y < out->rows; y++) {
        int down = window.y0 + y - n->y0, j = down / n->step;
        float t = (float)(down - j * n->step) / (float)n->step;
        float *row = out->value + (size_t)y * (size_t)out->columns;
        for (int i = 0; i < n->columns - 1; i++) {
            const float *a = n->value + (size_t)j * (size_t)n->columns + i, *c = a + n->columns;
            float left = a[0] + t * (c[0] - a[0]), right = a[1] + t * (c[1] - a[1]);
            float slope = (right - left) / (float)n->step;
            int first = n->x0 + i * n->step - window.x0, last = first + n->step;
            int from = first > 0 ? first : 0, to = last < out->columns ? last : out->columns;
            for (int x = from; x < to; x++) {
                row[x] = left + slope * (float)(x - first);
            }
        }
    }
    return BST_OK;
}

/* Adds the map of stray light to the pixels. */
static void add_stray_map(const painter *p, lattice *pixels) {
    for (int y = 0; y < pixels->rows; y++) {
        bst_stray_map_add_row(p->b->camera->stray_map, pixels->x0, pixels->y0 + y, pixels->columns,
                              (float)p->map_e, pixels->value + (size_t)y * (size_t)pixels->columns);
    }
}

void bst_skylight_set_places_only(bst_skylight *b) {
    b->places_only = true;
}

bst_status bst_skylight_make(bst_ctx *ctx, bst_skylight *b, const bst_scene_surroundings *around,
                             bst_window window, const bst_skylight_map **out) {
    assert(b && around && out && bst_window_is_valid(&window));
    b->around = *around;
    b->window = window;
    b->painter = (painter){.b = b, .around = &b->around};
    prepare(&b->painter);
    const painter p = b->painter;
    BST_TRY(paint_sky(ctx, &p, b, window));
    BST_TRY(set_nodes(ctx, &b->nodes, b->step, window));
    bool edge, mapped = p.map_e > 0.0;
    BST_TRY(find_edge(ctx, &p, b, &edge));
    lattice *n = &b->nodes;
    /* ghosts need the least value of all nodes */
    const bool by_need = b->places_only && !edge && !mapped && !b->camera->ghost_images;
    for (int k = 0; k < n->columns * n->rows; k++) {
        n->value[k] = by_need ? NAN : paint_node(b, k);
    }
    if ((edge || mapped) && !b->places_only) {
        BST_TRY(edge ? paint_pixels(ctx, &p, b, window) : spread_nodes(ctx, b, window));
        n = &b->pixels;
        n->x0 = window.x0;
        n->y0 = window.y0;
        if (mapped) {
            add_stray_map(&p, n);
        }
    }
    double least = by_need ? 0.0 : INFINITY;
    for (int i = 0; i < n->columns * n->rows && !by_need; i++) {
        least = fmin(least, (double)n->value[i]);
    }
    const bst_skylight *const at_pixels = (edge || mapped) && b->places_only ? b : NULL;
    b->map = (bst_skylight_map){n->step,  n->x0, n->y0,     n->columns,        n->rows,
                                n->value, least, at_pixels, by_need ? b : NULL};
    *out = &b->map;
    return BST_OK;
}
