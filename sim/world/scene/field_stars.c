/* Stars of a field query, and the geometry that stars, objects and ghosts share. */
#include <limits.h>
#include <stdlib.h>

#include "sim/optics/psf.h"
#include "sim/world/scene/field_internal.h"

/* upper limit of aberration and light deflection */
#define APPARENT_SHIFT_RAD (30.0 * BST_ARCSEC_RAD)

/* Capacity for `count` items and half as many more: few later frames then need another one. */
static int with_margin(int count) {
    return count < INT_MAX / 2 ? count + count / 2 : count;
}

static bst_status reserve_stars(bst_ctx *ctx, bst_field *field, int count) {
    if (count > field->star_capacity) {
        count = with_margin(count);
        bst_star *more = realloc(field->stars, (size_t)count * sizeof *more);
        if (!more) {
            return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for %d stars", count);
        }
        field->stars = more;
        field->star_capacity = count;
    }
    return BST_OK;
}

bst_status bst_field_reserve_sources(bst_ctx *ctx, bst_field *field, int count) {
    if (count > field->source_capacity) {
        count = with_margin(count);
        bst_scene_source *more = realloc(field->sources, (size_t)count * sizeof *more);
        if (!more) {
            return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for %d sources", count);
        }
        field->sources = more;
        field->source_capacity = count;
    }
    return BST_OK;
}

/* True if a direction projects into the window with its margin. */
static bool near_window(const bst_field *field, bst_quat q, bst_vec3 direction, bst_window window,
                        double margin_px) {
    double x, y;
    bst_vec3 v = bst_quat_rotate(q, direction);
    if (field->camera->geometry.general && bst_camera_beyond_fold(field->camera, v, margin_px)) {
        return true; /* behind the camera now, but it may enter during the exposure */
    }
    return bst_camera_project(field->camera, v, &x, &y) && x >= window.x0 - margin_px &&
           y >= window.y0 - margin_px && x <= window.x0 + window.width - 1 + margin_px &&
           y <= window.y0 + window.height - 1 + margin_px;
}

/* Checks whether a catalogue object is the observer's own satellite; both orbits may differ by
 * metres. */
bool bst_field_is_self(const bst_field *field, int index) {
    const world_object *object = &field->world->objects[index];
    if (index == field->world->observers[field->observer].own_object) {
        return true;
    }
    return object->catalogued && object->info.norad != 0 &&
           object->info.norad == field->world->observers[field->observer].norad;
}

/* Computes the cone of directions that contains a part of the sensor with its margin. */
bst_scene_cone bst_field_find_cone(const bst_field *field, const bst_field_scene *q,
                                   bst_window window) {
    const bst_camera *camera = field->camera;
    bst_scene_cone cone;
    bst_vec3 centre_cam = bst_camera_unproject(camera, window.x0 + 0.5 * (window.width - 1),
                                               window.y0 + 0.5 * (window.height - 1));
    cone.axis = bst_quat_rotate(bst_quat_conj(field->q_mid), centre_cam);
    cone.radius = APPARENT_SHIFT_RAD;
    if (camera->geometry.general) {
        cone.radius +=
            bst_camera_reach_rad(camera, centre_cam, window.x0 - q->margin_px,
                                 window.y0 - q->margin_px, window.x0 + window.width + q->margin_px,
                                 window.y0 + window.height + q->margin_px, q->margin_px);
    } else {
        cone.radius += atan(bst_camera_scale_rad(camera) *
                            (0.5 * hypot(window.width, window.height) + sqrt(2.0) * q->margin_px));
    }
    return cone;
}

/* Collects catalogue stars, then statistical stars down to faint_limit, in the cone. */
bst_status bst_field_query_stars(bst_ctx *ctx, bst_field *field, const bst_field_scene *q,
                                 int *count) {
    int known, drawn = 0;
    double julian_year = bst_time_julian_year(bst_world_time(field->world, q->mid_s));
    const bst_star_query cone = {
        q->cone.axis, q->cone.radius, q->v_limit, {julian_year, q->light.sun_m}};
    for (;;) {
        BST_TRY(bst_stars_query_seen(ctx, bst_world_stars(field->world), &cone, field->stars,
                                     field->star_capacity, &known));
        if (known > field->star_capacity) {
            BST_TRY(reserve_stars(ctx, field, known));
            continue;
        }
        if (field->faint) {
            int room = field->star_capacity - known;
            BST_TRY(bst_faint_stars_query(ctx, field->faint, q->cone.axis, q->cone.radius,
                                          q->faint_limit, field->stars + known, room, &drawn));
            if (drawn > room) {
                BST_TRY(reserve_stars(ctx, field, known + drawn + drawn / 4));
                continue;
            }
        }
        *count = known + drawn;
        return BST_OK;
    }
}

/* Makes the source of a star. False: its image does not touch the lit part of the sensor. */
bool bst_field_make_star(const bst_field *field, const bst_field_scene *q, const bst_star *star,
                         bst_scene_source *s) {
    const bst_camera *camera = field->camera;
    bst_vec3 apparent = bst_light_apparent_star(&q->light, star->icrs);
    if (!near_window(field, field->q_mid, apparent, q->lit, q->margin_px)) {
        return false;
    }
    *s = (bst_scene_source){
        .kind = BST_SOURCE_STAR,
        .id = star->id,
        .apparent_mid = apparent,
        .electrons_per_s =
            bst_camera_star_electrons_per_s(camera, (double)star->v_mag, (double)star->b_minus_v),
        .v_mag = (double)star->v_mag,
        .sunlit_fraction = NAN,
        .phase_rad = NAN,
        .range_m = INFINITY,
        .outside =
            q->wider && !(bst_vec3_angle(star->icrs, q->near_cone.axis) <= q->near_cone.radius &&
                          near_window(field, field->q_mid, apparent, q->window, q->margin_px))};
    bool coloured = camera->psf && bst_psf_spectra(camera->psf) > 1;
    if (coloured && !isnan(star->b_minus_v)) {
        bst_psf_colour(camera->psf, bst_optics_star_spectrum_k((double)star->b_minus_v), s->colour);
    }
    /* the Earth occults stars too: a distant point on the line of sight, in axes that move with the
     * Earth, represents the star */
    bst_vec3 ray = bst_light_apparent_star(&q->geocentric, star->icrs);
    s->occulted = bst_astro_earth_occults(
        q->eye.position_m, bst_vec3_axpy(q->eye.position_m, 1e12, ray), q->bodies.pole);
    if (s->occulted) {
        s->electrons_per_s = 0.0;
    }
    bst_vec3_to_radec(star->icrs, &s->ra_rad, &s->dec_rad);
    return true;
}
