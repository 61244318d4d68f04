#include "sim/satellite/flux.h"

#include <assert.h>
#include <string.h>

#include "sim/satellite/curved_light.h"
#include "sim/satellite/gauss_legendre.h"
#include "sim/satellite/pose_view.h"
#include "sim/satellite/sun_disc.h"
#include "sim/satellite/surface_shadow.h"

enum { ROUND_MAX = 32 };

/* Sums of one evaluation. */
typedef struct sums {
    double sun[BST_SATELLITE_MATERIALS_MAX]; /* m^2/sr by material */
    double earth[BST_SATELLITE_MATERIALS_MAX];
    double all, error; /* sunlight so far, and its error, in V */
    struct {
        int facet;
        double area, light; /* free area by polygons; light of a square metre */
    } round[ROUND_MAX];     /* plane facets in part shadow of which a border is round */
    int round_count;
    bst_sun_disc disc;
} sums;

/* Error of one panel of a shadow's integral, of all light. */
static const double TOLERANCE = 4e-4;
/* What polygons of 24 sides in place of circles do to the free area of a facet, of its area, but
 * for few views (docs/results/satellites.md); and the error that it may have so, of all light. */
static const double POLYGON_ERROR = 3e-3, POLYGON_TOLERANCE = 7e-4;

/* The last facet whose reflection was computed: large plane faces consist of many. */
typedef struct last_facet {
    bst_vec3 normal;
    int material;
    double light;
} last_facet;

/* Adds what a surface reflects. `to_v`: factor to V. */
static void add_light(sums *s, int material, double light, double error, double to_v) {
    s->sun[material] += light;
    s->all += light * to_v;
    s->error += error * to_v;
}

static void add_sunlight(bst_satellite_pose *p, const bst_satellite_light *l, int index,
                         last_facet *last, sums *s) {
    const bst_facet *f = &p->satellite->facets[index];
    bst_vec3 n = p->normals[index];
    double in = bst_vec3_dot(n, l->sun), out = bst_vec3_dot(n, l->observer), error = 0.0;
    /* one branch: none of the comparisons is likely */
    if (!((in > 1e-9) & (out > 1e-9) & (f->curved < 0))) {
        return;
    }
    const bst_material *m = &p->satellite->materials[f->material];
    double area = bst_pose_unshadowed_area(p, index, 2);
    if (last->material != f->material || memcmp(&last->normal, &n, sizeof n) != 0) {
        *last = (last_facet){n, f->material, bst_facet_light(m, &s->disc, n, l->observer)};
    }
    if (area > 0.0 && area < f->area_m2 && bst_plane_is_round(p, index)) {
        error = POLYGON_ERROR * f->area_m2 * last->light;
        if (s->round_count < ROUND_MAX && bst_plane_has_lines(p, index)) {
            s->round[s->round_count].facet = index;
            s->round[s->round_count].area = area;
            s->round[s->round_count++].light = last->light;
        }
    }
    add_light(s, f->material, area * last->light, error, m->colour[BST_SUNLIGHT_V]);
}

/* Gives plane facets in part shadow round borders where these matter. */
static void correct_round(bst_satellite_pose *p, sums *s) {
    double all = s->all;
    for (int i = 0; i < s->round_count; i++) {
        const bst_facet *f = &p->satellite->facets[s->round[i].facet];
        double to_v = p->satellite->materials[f->material].colour[BST_SUNLIGHT_V];
        double whole = f->area_m2 * s->round[i].light, light = whole * to_v, error;
        if (POLYGON_ERROR * light > POLYGON_TOLERANCE * all) {
            double share =
                bst_plane_free_share(p, s->round[i].facet, TOLERANCE * (all / light), &error);
            add_light(s, f->material, share * whole - s->round[i].area * s->round[i].light,
                      (error - POLYGON_ERROR) * whole, to_v);
        }
    }
}

/* True if two curved surfaces have the same light without shadows: the same form and material, side
 * by side. */
static bool are_alike(const bst_curved *a, const bst_curved *b) {
    return a->material == b->material && a->joint == b->joint && a->sphere == b->sphere &&
           a->side == b->side && a->radius_m == b->radius_m && a->top_radius_m == b->top_radius_m &&
           a->length_m == b->length_m && memcmp(&a->x, &b->x, sizeof a->x) == 0 &&
           memcmp(&a->y, &b->y, sizeof a->y) == 0 && memcmp(&a->z, &b->z, sizeof a->z) == 0;
}

/* Light of a curved surface without shadows, m^2/sr. */
static double light_of_curved(const bst_satellite_pose *p, const bst_satellite_light *l,
                              const bst_sun_disc *disc, const bst_curved *c) {
    const bst_material *m = &p->satellite->materials[c->material];
    int nodes = bst_sun_disc_nodes(m, disc);
    double sum = 0.0;
    for (int k = 0; k < nodes; k++) {
        bst_vec3 sun =
            bst_pose_turned_back(p, c->joint, nodes == 1 ? disc->centre : disc->direction[k]);
        bst_vec3 observer = bst_pose_turned_back(p, c->joint, l->observer);
        sum += (nodes == 1 ? 1.0 : disc->weight[k]) * bst_curved_light(c, &m->brdf, sun, observer);
    }
    return m->scale * sum;
}

/* Light of all curved surfaces without shadows: pose->curved[i].light. Returned: its sum in V. */
static double light_without_shadows(bst_satellite_pose *p, const bst_satellite_light *l,
                                    const sums *s) {
    const bst_satellite *sat = p->satellite;
    const bst_curved *last = NULL; /* of which the light is known */
    double all = 0.0, light = 0.0;
    for (int i = 0; i < sat->curved_count; i++) {
        const bst_curved *c = &sat->curved[i];
        if (!last || !are_alike(last, c)) {
            light = light_of_curved(p, l, &s->disc, c);
            last = c;
        }
        p->curved[i].light = light;
        all += light * sat->materials[c->material].colour[BST_SUNLIGHT_V];
    }
    return all;
}

/* Adds the curved surfaces: exact without shadows, times the part that nothing hides. */
static void add_curved(bst_satellite_pose *p, const bst_satellite_light *l, sums *s) {
    const bst_satellite *sat = p->satellite;
    double all = s->all + light_without_shadows(p, l, s), left = all;
    do { /* again if most is in shadow: errors are to be small against what is left */
        all = fmax(left, 1e-4 * all);
        left = s->all;
        for (int i = 0; i < sat->curved_count; i++) {
            const bst_material *m = &sat->materials[sat->curved[i].material];
            double light = p->curved[i].light, in_v = light * m->colour[BST_SUNLIGHT_V];
            p->curved[i].share = 0.0;
            if (light > 0.0) {
                p->curved[i].share = bst_curved_free_share(
                    p, i, light / m->scale, bst_sun_disc_nodes(m, &s->disc) > 1,
                    TOLERANCE * (all / in_v), &p->curved[i].error);
                left += p->curved[i].share * in_v;
            }
        }
    } while (left < 0.25 * all && left > 0.0);
    for (int i = 0; i < sat->curved_count; i++) {
        int material = sat->curved[i].material;
        double light = p->curved[i].light;
        if (light > 0.0) {
            add_light(s, material, p->curved[i].share * light, p->curved[i].error * light,
                      sat->materials[material].colour[BST_SUNLIGHT_V]);
        }
    }
}

/* Reflected earthlight of a facet, and its thermal emission. */
static void add_facing(bst_satellite_pose *p, const bst_satellite_light *l, int index,
                       double visible_m2, sums *s) {
    const bst_facet *f = &p->satellite->facets[index];
    const bst_material *m = &p->satellite->materials[f->material];
    const bst_earthlight *e = l->earthlight;
    bst_vec3 n = p->normals[index];
    double out = fmin(bst_vec3_dot(n, l->observer), 1.0), sum = 0.0, lit_m2 = visible_m2;
    for (int i = 0; i < e->count; i++) {
        double in = bst_vec3_dot(n, e->direction[i]);
        if (in > 1e-9) {
            sum += e->irradiance[i] * in *
                   bst_brdf_value(&m->brdf, fmin(in, 1.0), out,
                                  bst_vec3_dot(e->direction[i], l->observer));
        }
    }
    if (sum > 0.0 && bst_vec3_dot(n, e->centre) > 0.05) {
        lit_m2 = bst_pose_unshadowed_area(p, index, 2);
    }
    s->earth[f->material] += sum * out * m->scale * lit_m2;
}

/* Light of the facets that face the observer, apart from sunlight. */
static void add_earth_and_emission(bst_satellite_pose *p, const bst_satellite_light *l, sums *s,
                                   bst_satellite_flux *out) {
    const bst_satellite *sat = p->satellite;
    bool earth = l->earthlight && l->earthlight->count > 0;
    if (earth) {
        bst_pose_look(p, 1, l->earthlight->centre);
    }
    for (int i = 0; i < sat->facet_count; i++) {
        double cosine = bst_vec3_dot(p->normals[i], l->observer);
        if (!(cosine > 1e-9)) {
            continue;
        }
        double visible = bst_pose_unshadowed_area(p, i, 1);
        out->visible_m2 += visible * cosine;
        out->emission_m2 += visible * cosine * sat->materials[sat->facets[i].material].emissivity;
        if (earth && visible > 0.0) {
            add_facing(p, l, i, visible, s);
        }
    }
}

void bst_satellite_flux_at(bst_satellite_pose *p, const bst_satellite_light *l,
                           bst_satellite_flux *out) {
    assert(p && l && out);
    const bst_satellite *sat = p->satellite;
    sums s;
    memset(s.sun, 0, (size_t)sat->material_count * sizeof s.sun[0]);
    memset(s.earth, 0, (size_t)sat->material_count * sizeof s.earth[0]);
    *out = (bst_satellite_flux){.error = 0.0};
    bst_pose_look(p, 0, l->observer);
    if (l->sunlit > 0.0) {
        bst_sun_disc_make(l->sun, l->sun_radius_rad, sat->lobe_rad, &s.disc);
        bst_pose_look(p, 1, l->sun);
        s.all = s.error = 0.0;
        s.round_count = 0;
        last_facet last = {.material = -1};
        for (int i = 0; i < sat->facet_count; i++) {
            add_sunlight(p, l, i, &last, &s);
        }
        add_curved(p, l, &s);
        correct_round(p, &s);
        out->error = fmax(s.error, 0.0); /* rounding */
    }
    if (l->earthlight || l->emission) {
        add_earth_and_emission(p, l, &s, out);
    }
    for (int m = 0; m < sat->material_count; m++) {
        for (int k = 0; k < BST_SUNLIGHT_COLOURS; k++) {
            out->sun[k] += s.sun[m] * sat->materials[m].colour[k];
            out->earth[k] += s.earth[m] * sat->materials[m].colour[k];
        }
    }
}

void bst_earthlight_at(const bst_earth_surface *surface, bst_vec3 object_m, bst_vec3 sun,
                       bst_earthlight *out) {
    enum { RINGS = BST_GAUSS_POINTS };
    const bst_brdf ground = {.model = BST_BRDF_PHONG,
                             .diffuse = surface->diffuse,
                             .specular = surface->specular,
                             .exponent = surface->exponent};
    double distance = bst_vec3_norm(object_m);
    out->count = 0;
    out->centre = bst_vec3_scale(object_m, -1.0 / distance);
    if (!(distance > BST_EARTH_RADIUS_M)) {
        return;
    }
    bst_vec3 down = out->centre, e1 = bst_vec3_perpendicular(down), e2 = bst_vec3_cross(down, e1);
    bst_vec3 sum = {0};
    double ratio = BST_EARTH_RADIUS_M / distance;
    double cap = ratio * ratio / (1.0 + sqrt((1.0 - ratio) * (1.0 + ratio)));
    assert(surface->fineness >= 1 && surface->fineness <= BST_EARTHLIGHT_FINEST);
    int panels = surface->fineness, around = 24 * panels;
    for (int n = 0; n < RINGS * panels; n++) {
        /* uniform in the square root of the solid angle: smooth at the limb */
        double t = 0.5 * BST_PI * (n / RINGS + 0.5 * (1.0 + bst_gauss_place[n % RINGS])) / panels,
               drop = cap * sin(t) * sin(t), c = 1.0 - drop;
        double s = sqrt(drop * (2.0 - drop));
        double solid = cap * sin(2.0 * t) * 0.25 * BST_PI * bst_gauss_weight[n % RINGS] / panels *
                       2.0 * BST_PI / around;
        double chord2 = BST_EARTH_RADIUS_M * BST_EARTH_RADIUS_M - distance * distance * s * s;
        double way = distance * c - sqrt(fmax(chord2, 0.0));
        for (int m = 0; m < around; m++) {
            double a = 2.0 * BST_PI * (m + 0.5 * (n % 2)) / around;
            bst_vec3 u = bst_vec3_axpy(bst_vec3_axpy(bst_vec3_scale(down, c), s * cos(a), e1),
                                       s * sin(a), e2);
            bst_vec3 normal = bst_vec3_unit(bst_vec3_axpy(object_m, way, u));
            double in = bst_vec3_dot(normal, sun), up = -bst_vec3_dot(normal, u);
            if (!(in > 0.0) || !(up > 0.0)) {
                continue;
            }
            double light = solid * in * bst_brdf_value(&ground, in, up, -bst_vec3_dot(u, sun));
            out->direction[out->count] = u;
            out->irradiance[out->count++] = light;
            sum = bst_vec3_axpy(sum, light, u);
        }
    }
    out->centre = out->count ? bst_vec3_unit(sum) : out->centre;
}

void bst_earthlight_turn(bst_quat q, bst_earthlight *light) {
    for (int i = 0; i < light->count; i++) {
        light->direction[i] = bst_quat_rotate(q, light->direction[i]);
    }
    light->centre = bst_quat_rotate(q, light->centre);
}
