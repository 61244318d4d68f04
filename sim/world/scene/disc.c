#include "sim/world/scene/disc.h"

#include <math.h>
#include <stdlib.h>

#include "sim/world/scene/brightness.h"

enum { GAUSS = 4 };

/* Four-point Gauss-Legendre on [0, 1] (Abramowitz and Stegun, table 25.4). */
static const double gauss_place[GAUSS] = {0.06943184420297371, 0.33000947820757187,
                                          0.66999052179242813, 0.93056815579702629};
static const double gauss_weight[GAUSS] = {0.17392742256872693, 0.32607257743127307,
                                           0.32607257743127307, 0.17392742256872693};

typedef bst_disc_aspect aspect;

/* Frame and illumination geometry of a resolved sphere. */
static aspect make_aspect(const bst_scene_source *source, bst_vec3 light) {
    aspect a = {.z = bst_vec3_scale(bst_vec3_unit(source->apparent_mid), -1.0),
                .radius = source->shape->radius};
    a.cosine = bst_vec3_dot(light, a.z);
    bst_vec3 across = bst_vec3_cross(a.z, light);
    a.sine = bst_vec3_norm(across);
    bst_vec3 helper = fabs(a.z.z) < 0.9 ? (bst_vec3){0, 0, 1} : (bst_vec3){1, 0, 0};
    a.y = a.sine > 1e-12 ? bst_vec3_scale(across, 1.0 / a.sine)
                         : bst_vec3_unit(bst_vec3_cross(a.z, helper));
    a.x = bst_vec3_cross(a.y, a.z);
    return a;
}

/* Cosine of the light's angle of incidence at a point of a sphere's disc: x, y in units in which
 * the limb has q = 1, q the sine of the angle from the centre over that of the limb. At a finite
 * distance the surface point is nearer to the sub-observer point. */
static double incidence(const aspect *a, double x, double y) {
    double q2 = fmin(x * x + y * y, 1.0), k = a->radius;
    /* cosine, and sine over q, of asin(q) - asin(k q) */
    double far = sqrt(1.0 - q2), near = sqrt(1.0 - k * k * q2);
    return (far * near + k * q2) * a->cosine + (near - k * far) * x * a->sine;
}

/* Direction offset of a point on the disc. */
static bst_vec3 offset_at(const aspect *a, double x, double y) {
    double q2 = x * x + y * y;
    double scale = a->radius / sqrt(1.0 - a->radius * a->radius * fmin(q2, 1.0));
    return bst_vec3_axpy(bst_vec3_scale(a->x, scale * x), scale * y, a->y);
}

/* Adds a point source of a resolved disc. */
static bst_status push(bst_ctx *ctx, bst_disc_points *list, bst_vec3 offset, double share) {
    if (list->count == list->capacity) {
        int capacity = list->capacity ? 2 * list->capacity : 256;
        bst_disc_point *items = realloc(list->items, (size_t)capacity * sizeof *items);
        if (!items) {
            return bst_fail(ctx, BST_ERR_MEMORY, "no memory for %d points of a disc", capacity);
        }
        list->items = items;
        list->capacity = capacity;
    }
    list->items[list->count++] = (bst_disc_point){offset, share};
    return BST_OK;
}

/* Longitude of the terminator at latitude asin(y), from the sub-observer meridian towards the
 * light; pi / 2: nothing is lit. */
static double terminator(const aspect *a, double y) {
    double across = sqrt(fmax(1.0 - y * y, 0.0)), dark = -0.5 * BST_PI, lit = 0.5 * BST_PI;
    if (a->radius < 1e-9) {
        return fmin(fmax(atan2(a->sine, a->cosine) - 0.5 * BST_PI, dark), lit);
    }
    if (incidence(a, across, y) <= 0.0) {
        return lit;
    }
    if (incidence(a, -across, y) >= 0.0) {
        return dark;
    }
    for (int i = 0; i < 50; i++) {
        double middle = 0.5 * (dark + lit);
        *(incidence(a, across * sin(middle), y) > 0.0 ? &lit : &dark) = middle;
    }
    return lit;
}

/* Appends the quadrature points of one light, or of a disc of uniform radiance. */
static bst_status add_light(bst_ctx *ctx, const aspect *a, bool uniform, double share,
                            double panel_rad, bst_disc_points *out) {
    int first = out->count;
    double size = asin(a->radius), total = 0.0;
    int rows = (int)fmin(fmax(ceil(2.0 * size / panel_rad), 3.0), 1e5);
    for (int r = 0; r < GAUSS * rows; r++) {
        double y = 2.0 * (r / GAUSS + gauss_place[r % GAUSS]) / rows - 1.0;
        double across = sqrt(1.0 - y * y);
        double from = uniform ? -0.5 * BST_PI : terminator(a, y), span = 0.5 * BST_PI - from;
        int columns = (int)fmin(fmax(ceil(span * across * size / panel_rad), 3.0), 1e5);
        for (int c = 0; c < GAUSS * columns && span > 0.0; c++) {
            double l = from + span * (c / GAUSS + gauss_place[c % GAUSS]) / columns;
            double x = across * sin(l);
            double narrow = sqrt(1.0 - a->radius * a->radius * (x * x + y * y));
            double light = uniform ? 1.0 : fmax(incidence(a, x, y), 0.0);
            double weight = gauss_weight[r % GAUSS] * gauss_weight[c % GAUSS] * span / columns *
                            across * cos(l) * light / narrow;
            BST_TRY(push(ctx, out, offset_at(a, x, y), weight));
            total += weight;
        }
    }
    for (int i = first; i < out->count && total > 0.0; i++) {
        out->items[i].share *= share / total;
    }
    if (!(total > 0.0)) { /* the crescent is below numerical resolution */
        return push(ctx, out, offset_at(a, 1.0, 0.0), share);
    }
    return BST_OK;
}

bst_vec3 bst_disc_specular(const bst_scene_source *source) {
    aspect a = make_aspect(source, source->shape->sun);
    /* the specular normal bisects the phase angle */
    double half = 0.5 * atan2(a.sine, a.cosine);
    return offset_at(&a, sin(half), 0.0);
}

bst_status bst_disc_make_points(bst_ctx *ctx, const bst_scene_source *source, int lights,
                                double panel_rad, bst_disc_points *out) {
    const bst_scene_source_shape *s = source->shape;
    aspect sun = make_aspect(source, s->sun);
    if ((lights & BST_DISC_SUN) && s->diffuse > 0.0) {
        BST_TRY(add_light(ctx, &sun, false, s->diffuse, panel_rad, out));
    }
    if ((lights & BST_DISC_SPECULAR) && s->specular > 0.0) {
        BST_TRY(push(ctx, out, bst_disc_specular(source), s->specular));
    }
    if ((lights & BST_DISC_EARTH) && s->earthshine > 0.0) {
        aspect earth = make_aspect(source, s->earth);
        BST_TRY(add_light(ctx, &earth, false, s->earthshine, panel_rad, out));
    }
    if ((lights & BST_DISC_THERMAL) && s->thermal > 0.0) {
        BST_TRY(add_light(ctx, &sun, true, s->thermal, panel_rad, out));
    }
    return BST_OK;
}

/* Aspect of a sphere whose diffuse reflection has the given flux. */
static aspect lit_aspect(const bst_scene_source *source, bst_vec3 light, double share) {
    aspect a = make_aspect(source, light);
    double phase = atan2(a.sine, a.cosine);
    /* integral of the cosine of incidence over the disc's solid angle */
    double whole = BST_PI * BST_PI * a.radius * a.radius * bst_astro_sphere_phase(0.0, phase) *
                   bst_scene_sphere_nearness(a.radius, phase);
    a.scale = whole > 0.0 ? share / whole : 0.0;
    return a;
}

void bst_disc_begin(const bst_scene_source *source, bst_disc *out) {
    const bst_scene_source_shape *s = source->shape;
    double r2 = s->radius * s->radius;
    *out = (bst_disc){.sun = lit_aspect(source, s->sun, s->diffuse),
                      .earth = lit_aspect(source, s->earth, s->earthshine),
                      .thermal = s->thermal * (1.0 + sqrt(1.0 - r2)) / (2.0 * BST_PI * r2)};
}

/* Radiance of the lit sphere in a direction; 0 on the dark side. */
static double radiance(const aspect *a, bst_vec3 direction) {
    double x = bst_vec3_dot(direction, a->x) / a->radius;
    double y = bst_vec3_dot(direction, a->y) / a->radius;
    return a->scale * fmax(incidence(a, x, y), 0.0);
}

double bst_disc_radiance(const bst_disc *disc, bst_vec3 direction) {
    const aspect *a = &disc->sun;
    double x = bst_vec3_dot(direction, a->x), y = bst_vec3_dot(direction, a->y);
    if (x * x + y * y > a->radius * a->radius || bst_vec3_dot(direction, a->z) > 0.0) {
        return 0.0;
    }
    double sum = disc->thermal + radiance(a, direction);
    return disc->earth.scale > 0.0 ? sum + radiance(&disc->earth, direction) : sum;
}
