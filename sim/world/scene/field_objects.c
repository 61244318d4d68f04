/* Objects of a field query: paths, brightness and shape during the exposure. */
#include "sim/world/scene/field_objects.h"

#include <assert.h>
#include <stdlib.h>
#include <string.h>

#include "sim/optics/psf.h"
#include "sim/world/scene/body_limb.h"

/* instants of the exposure at which an object's light is sampled */
enum { TIMES = 16 };

/* Checks whether an object's image path touches a part of the sensor, within the cone that contains
 * it. disc: its angular radius, rad. */
static bool path_touches(const bst_scene_object_query *q, const bst_scene_source *s, double disc,
                         bst_window part, const bst_scene_cone *cone) {
    enum { PIECES = 8 };
    double disc_px = tan(disc) / bst_camera_scale_rad(q->camera) * bst_camera_stretch(q->camera);
    bst_vec3 at[PIECES + 1];
    double x[PIECES + 1], y[PIECES + 1], bend = 0.0;
    bool front[PIECES + 1];
    for (int k = 0; k <= PIECES; k++) {
        at[k] = bst_scene_source_direction(s, (double)k / PIECES);
        x[k] = y[k] = 0.0;
        front[k] = bst_camera_project(q->camera, bst_quat_rotate(q->q_mid, at[k]), &x[k], &y[k]);
    }
    for (int k = 1; k < PIECES; k++) {
        /* the path deviates from the chord by an eighth of this */
        bend = front[k - 1] && front[k] && front[k + 1]
                   ? fmax(bend,
                          hypot(x[k - 1] - 2.0 * x[k] + x[k + 1], y[k - 1] - 2.0 * y[k] + y[k + 1]))
                   : INFINITY;
    }
    for (int k = 0; k < PIECES; k++) {
        double arc = bst_vec3_angle(at[k], at[k + 1]);
        if (bst_vec3_angle(cone->axis, at[k]) > cone->radius + disc + 1.25 * arc) {
            continue;
        }
        double reach = q->margin_px + disc_px + bend;
        if (fmax(x[k], x[k + 1]) >= part.x0 - reach &&
            fmin(x[k], x[k + 1]) <= part.x0 + part.width - 1 + reach &&
            fmax(y[k], y[k + 1]) >= part.y0 - reach &&
            fmin(y[k], y[k + 1]) <= part.y0 + part.height - 1 + reach) {
            return true;
        }
    }
    return false;
}

/* Knots with which a light curve begins, ascending. Value: index of the middle of the exposure. */
static int first_knots(const bst_field_rate_start *start, bst_scene_source_rate *out) {
    out->count = start->intervals + 1;
    for (int k = 0; k <= start->intervals; k++) {
        out->u[k] = (double)k / start->intervals;
    }
    int middle = start->intervals / 2;
    for (int i = 0; i < start->time_count; i++) {
        int k = out->count;
        while (k > 1 && out->u[k - 1] > start->times[i]) {
            k--;
        }
        if (!(start->times[i] > out->u[k - 1])) {
            continue; /* twice the same time */
        }
        memmove(out->u + k + 1, out->u + k, (size_t)(out->count - k) * sizeof *out->u);
        out->u[k] = start->times[i];
        out->count++;
        middle += k <= middle;
    }
    return middle;
}

/* Light that a straight line misses in an interval whose middle has a brightness. */
static double missed(const bst_scene_source_rate *r, const double *middle, int k) {
    return fabs(middle[k] - 0.5 * (r->rate[k] + r->rate[k + 1])) * (r->u[k + 1] - r->u[k]);
}

bool bst_field_rate(double (*at)(void *user, double u), void *user,
                    const bst_field_rate_start *start, bst_scene_source_rate *out, double *mean) {
    double middle[BST_RATE_KNOTS], low = INFINITY, high = 0.0;
    assert(start->intervals >= 2 && start->intervals <= 64 && start->intervals % 2 == 0);
    assert(start->most_knots <= BST_RATE_KNOTS &&
           start->intervals + 1 + start->time_count < start->most_knots);
    int central = first_knots(start, out);
    for (int k = 0; k < out->count; k++) {
        out->rate[k] = at(user, out->u[k]);
        low = fmin(low, out->rate[k]);
        high = fmax(high, out->rate[k]);
    }
    *mean = out->rate[central];
    if (!(high - low > 1e-3 * high)) {
        return false;
    }
    for (int k = 0; k + 1 < out->count; k++) {
        middle[k] = at(user, 0.5 * (out->u[k] + out->u[k + 1]));
    }
    while (out->count < start->most_knots) {
        int worst = 0;
        double most = 0.0;
        for (int k = 0; k + 1 < out->count; k++) {
            /* error in area: an image integrates the light */
            double miss = missed(out, middle, k);
            if (miss > most) {
                most = miss;
                worst = k;
            }
        }
        if (most < 1e-7 * high) {
            break;
        }
        for (int k = out->count; k > worst + 1; k--) {
            out->u[k] = out->u[k - 1];
            out->rate[k] = out->rate[k - 1];
            middle[k] = middle[k - 1];
        }
        out->u[worst + 1] = 0.5 * (out->u[worst] + out->u[worst + 2]);
        out->rate[worst + 1] = middle[worst];
        out->count++;
        for (int k = worst; k <= worst + 1; k++) {
            middle[k] = at(user, 0.5 * (out->u[k] + out->u[k + 1]));
        }
    }
    double miss = 0.0;
    out->light[0] = 0.0;
    for (int k = 1; k < out->count; k++) {
        out->light[k] = out->light[k - 1] +
                        0.5 * (out->rate[k] + out->rate[k - 1]) * (out->u[k] - out->u[k - 1]);
        miss += 2.0 / 3.0 * missed(out, middle, k - 1); /* Simpson's rule against the line */
    }
    *mean = out->light[out->count - 1];
    out->error = miss / *mean;
    for (int k = 0; k < out->count; k++) {
        out->rate[k] /= *mean;
        out->light[k] /= *mean;
    }
    return true;
}

/* Context of an object's brightness during an exposure, for bst_field_rate. */
typedef struct course {
    const bst_scene_object_query *query;
    int object;
    const bst_scene_source_path *path;
    const bst_scene_path_light *light;
} course;

/* Light of an object in electrons/s at a fraction of the exposure. */
static double course_at(void *user, double u) {
    const course *c = user;
    bst_world_sight sight;
    bst_scene_view_light(c->query->view, &c->query->span, c->object, c->path, c->light, u, &sight);
    return bst_scene_glow_electrons_per_s(c->query->camera, &sight.glow, NULL);
}

/* Adds the light of one instant to the components of a shape, in electrons. */
static void add_parts(const bst_camera *camera, const bst_scene_glow *glow, double weight,
                      bst_scene_source_shape *shape) {
    double reflected, all = bst_scene_glow_electrons_per_s(camera, glow, &reflected);
    double direct = 1.0 - glow->earth_share - glow->specular_share;
    shape->diffuse += weight * reflected * direct;
    shape->specular += weight * reflected * glow->specular_share;
    shape->earthshine += weight * reflected * glow->earth_share;
    shape->thermal += weight * (all - reflected);
}

/* Brightness and lighting of an object at instant k of TIMES, or at mid-exposure if constant. */
static bst_world_sight sight_at(const course *c, const bst_world_sight *mid,
                                const bst_scene_source *source, int k) {
    bst_world_sight sight = *mid;
    if (source->rate) {
        bst_scene_view_light(c->query->view, &c->query->span, c->object, c->path, c->light,
                             (k + 0.5) / TIMES, &sight);
    }
    return sight;
}

/* Spectrum of an object: sunlight and thermal emission by their fractions of the light. */
static void make_colour(const course *c, const bst_world_sight *mid, bst_scene_source *source) {
    const bst_camera *camera = c->query->camera;
    double sum[BST_PSF_COLOURS] = {0}, total = 0.0;
    for (int k = 0; k < (source->rate ? TIMES : 1); k++) {
        bst_world_sight sight = sight_at(c, mid, source, k);
        double reflected, all = bst_scene_glow_electrons_per_s(camera, &sight.glow, &reflected);
        float warm[BST_PSF_COLOURS];
        bst_psf_colour(camera->psf, sight.glow.temperature_k, warm);
        total += all;
        for (int s = 0; s < BST_PSF_COLOURS; s++) {
            sum[s] += (all - reflected) * (double)warm[s];
        }
    }
    for (int s = 0; s < BST_PSF_COLOURS && total > 0.0; s++) {
        source->colour[s] = (float)(sum[s] / total);
    }
}

/* Makes an object's disc if it spans more than a fiftieth of a pixel: its centre of light is then
 * at most 0.01 px from its centre of mass. The fractions are means over the exposure. */
static bool make_shape(const course *c, const bst_world_sight *mid, const bst_scene_source *source,
                       bst_scene_source_shape *shape) {
    const bst_camera *camera = c->query->camera;
    const bst_world_object_info *info = bst_scene_view_object(c->query->view, (int)source->id);
    double radius = sqrt(info->area_m2 / BST_PI) / mid->range_m;
    double pixels = 2.0 * radius / bst_camera_scale_rad(camera) * bst_camera_stretch(camera);
    if (!mid->glow.resolved || !(radius < 1.0) || !(pixels > 0.02)) {
        return false;
    }
    *shape = (bst_scene_source_shape){.radius = radius};
    for (int k = 0; k < (source->rate ? TIMES : 1); k++) {
        bst_world_sight sight = sight_at(c, mid, source, k);
        add_parts(camera, &sight.glow, 1.0, shape);
    }
    double all = shape->diffuse + shape->specular + shape->earthshine + shape->thermal;
    if (!(all > 0.0)) {
        return false;
    }
    shape->diffuse /= all;
    shape->specular /= all;
    shape->earthshine /= all;
    shape->thermal /= all;
    bst_vec3 object_m =
        bst_vec3_axpy(c->light->eye_m[BST_PATH_NODES / 2], mid->range_m, mid->geometric);
    shape->sun = bst_vec3_unit(bst_vec3_sub(c->light->sun_m[BST_PATH_NODES / 2], object_m));
    shape->earth = mid->glow.earth_share > 0.0 ? mid->glow.earth : shape->sun;
    return true;
}

static void aspect_at(void *user, double u, bst_object_aspect *out) {
    const course *c = user;
    bst_scene_view_aspect(c->query->view, &c->query->span, c->object, c->path, c->light, u, out);
}

/* Samples the light of an object during the exposure. False: it is constant, see bst_field_rate. */
static bool sample_light(course *c, bst_scene_source_rate *rate, double *mean) {
    /* knots of a sphere's light; a part of a shape's for glints, and as many to refine them */
    enum { SPHERE_KNOTS = 129, GLINT_KNOTS = 160 };
    double times[GLINT_KNOTS];
    bst_field_rate_start start = {.intervals = 16, .times = times, .most_knots = SPHERE_KNOTS};
    const bst_object_shape *shape = bst_scene_view_object(c->query->view, c->object)->shape;
    if (shape) {
        const bst_world_view_span *span = &c->query->span;
        double middle_s = 0.5 * (span->start_s + span->end_s);
        double exposure_s = span->end_s - span->start_s;
        start.intervals = bst_object_shape_samples(shape, middle_s, exposure_s);
        start.time_count =
            bst_object_shape_glints(shape, bst_scene_view_pose(c->query->view, c->object), middle_s,
                                    exposure_s, aspect_at, c, times, GLINT_KNOTS);
        start.most_knots = BST_RATE_KNOTS;
    }
    bool changes = bst_field_rate(course_at, c, &start, rate, mean);
    if (!shape) {
        rate->error = 0.0; /* smooth: the knots of a sphere suffice */
    }
    return changes;
}

/* Finds what the Earth's limb does to a body. */
static bst_body_limb_kind find_limb(const course *c, const bst_scene_source *source,
                                    bst_scene_source_body *body) {
    for (int k = 0; k < BST_PATH_NODES; k++) {
        body->eye.place[k] = c->light->eye_m[k];
    }
    body->lag_m = c->light->lag_m;
    body->pole = c->light->pole;
    body->satellite = bst_scene_view_object(c->query->view, c->object)->shape->satellite;
    body->limb = true;
    bst_body_limb_kind kind = bst_body_limb_during(source);
    body->limb = kind == BST_BODY_LIMB_CUTS;
    return kind;
}

/* Makes the body of an object with a shape, if it spans more than a fiftieth of a pixel: its centre
 * of light is then at most 0.01 px from its centre of mass. One that the Earth's limb cuts is not
 * occulted. */
static bst_status make_body(bst_ctx *ctx, const course *c, const bst_world_sight *mid,
                            bst_scene_object_parts *parts, bst_scene_source *out) {
    static const double LEAST_PX = 0.02;
    const bst_scene_object_query *q = c->query;
    const bst_object_shape *shape = bst_scene_view_object(q->view, c->object)->shape;
    double pixels = shape ? 2.0 * shape->satellite->radius_m / mid->range_m /
                                bst_camera_scale_rad(q->camera) * bst_camera_stretch(q->camera)
                          : 0.0;
    if (!mid->glow.resolved || !(pixels > LEAST_PX)) {
        return BST_OK;
    }
    if (!parts->body) {
        parts->body = malloc(sizeof *parts->body);
        if (!parts->body) {
            return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the shape of an object");
        }
    }
    out->body = parts->body;
    out->body_u[0] = 0.0;
    out->body_u[1] = 1.0;
    bool cut = find_limb(c, out, parts->body) == BST_BODY_LIMB_CUTS;
    out->occulted = mid->occulted && !cut;
    if (out->occulted) {
        out->body = NULL;
        return BST_OK;
    }
    bst_scene_view_body(q->view, &q->span, c->object, c->path, c->light, q->camera, parts->body);
    return BST_OK;
}

bst_status bst_field_object(bst_ctx *ctx, const bst_scene_object_query *q, int object,
                            bst_scene_object_parts *parts, bst_scene_source *out, bool *there) {
    bst_world_sight mid;
    bst_scene_path_light light;
    *there = false;
    bst_status status =
        bst_world_view_path(ctx, q->view, &q->span, object, &parts->path, &light, &mid);
    if (status == BST_ERR_NUMERIC) {
        return BST_OK;
    }
    BST_TRY(status);
    if (!(mid.range_m > 0.0)) {
        return BST_OK;
    }
    *out = (bst_scene_source){.kind = BST_SOURCE_OBJECT,
                              .id = (uint32_t)object,
                              .apparent_mid = mid.apparent,
                              .path = &parts->path,
                              .v_mag = mid.v_mag,
                              .sunlit_fraction = mid.sunlit_fraction,
                              .phase_rad = mid.phase_rad,
                              .range_m = mid.range_m,
                              .occulted = mid.occulted};
    bst_vec3_to_radec(mid.geometric, &out->ra_rad, &out->dec_rad);
    const bst_world_object_info *info = bst_scene_view_object(q->view, object);
    double radius = info->shape ? info->shape->satellite->radius_m / mid.range_m
                                : sqrt(info->area_m2 / BST_PI) / mid.range_m;
    double disc = mid.glow.resolved && radius < 1.0 ? asin(radius) : 0.0;
    *there = path_touches(q, out, disc, q->lit, &q->cone);
    if (!*there) {
        return BST_OK;
    }
    out->outside = q->wider && !path_touches(q, out, disc, q->window, &q->near_cone);
    course c = {q, object, &parts->path, &light};
    if (info->shape) {
        BST_TRY(make_body(ctx, &c, &mid, parts, out));
    }
    if (!out->occulted && q->span.end_s > q->span.start_s &&
        sample_light(&c, &parts->rate, &out->electrons_per_s)) {
        out->rate = &parts->rate;
    } else {
        out->electrons_per_s =
            out->occulted ? 0.0 : bst_scene_glow_electrons_per_s(q->camera, &mid.glow, NULL);
    }
    if (q->camera->psf && bst_psf_spectra(q->camera->psf) > 1) {
        make_colour(&c, &mid, out);
    }
    if (!info->shape && make_shape(&c, &mid, out, &parts->shape)) {
        out->shape = &parts->shape;
    }
    return BST_OK;
}
