/* Places of a pose's facets in the image, and the light that they have if nothing hides them. */
#include <math.h>

#include "sim/satellite/resolved_faces.h"

/* Finds planes and middles of the facets. */
static void place_planes(const bst_resolved_adding *a) {
    bst_resolved_areas *s = &a->r->areas;
    const bst_satellite *sat = a->r->satellite;
    for (int f = 0; f < sat->facet_count && !s->placed; f++) {
        const int *corner = s->net.corner + s->net.first[f];
        int count = s->net.first[f + 1] - s->net.first[f];
        bst_vec3 normal = a->pose->normals[f], middle = {0};
        for (int i = 0; i < count; i++) {
            middle =
                bst_vec3_axpy(middle, 1.0 / count, a->pose->vertices[s->net.vertex[corner[i]]]);
        }
        bst_vec3 from = a->pose->vertices[s->net.vertex[corner[0]]];
        s->planes[f] = (bst_resolved_plane){normal, bst_vec3_dot(normal, from)};
        s->middles[f] = middle;
    }
    s->placed = sat->joint_count == 0;
}

/* Most cells per metre between two places of the body: a place at (x, y, z) is at x / z and y / z.
 * 0: not known. */
static double cells_per_m(const bst_resolved_adding *a) {
    bst_vec3 o = a->view->origin_m;
    double radius_m = a->r->satellite->radius_m, nearest_m = o.z - radius_m;
    if (!(nearest_m > 0.0)) {
        return 0.0;
    }
    double tangent = (hypot(o.x, o.y) + radius_m) / nearest_m;
    return a->per_m / nearest_m * sqrt(1.0 + tangent * tangent);
}

/* Places the vertices in the image, as bst_resolved_project, and in the view from the Sun: both at
 * once, because they come from slow memory. */
static void place_vertices(const bst_resolved_adding *a, const bst_resolved_light_view *sun) {
    bst_resolved_areas *s = &a->r->areas;
    const bst_mat3 m = a->image_from_body;
    const bst_vec3 o = a->view->origin_m, *place = a->pose->vertices;
    const bst_resolved_light_view view = *sun;
    double per_m = a->per_m, x0 = a->r->image.x0, y0 = a->r->image.y0;
    for (int v = 0; v < s->net.vertex_count; v++) {
        bst_vec3 p = place[s->net.vertex[v]];
        double depth = o.z + (m.m[2][0] * p.x + m.m[2][1] * p.y + m.m[2][2] * p.z);
        double by = 1.0 / depth, f = per_m * by;
        double x = o.x + (m.m[0][0] * p.x + m.m[0][1] * p.y + m.m[0][2] * p.z);
        double y = o.y + (m.m[1][0] * p.x + m.m[1][1] * p.y + m.m[1][2] * p.z);
        s->eye.at[v] = (bst_point2){x * f - x0, y * f - y0};
        s->eye.near[v] = o.z * ((o.z - depth) * by);
        s->lit[0].at[v] = bst_resolved_light_place(&view, p);
        s->lit[0].near[v] = bst_vec3_dot(p, view.z);
    }
}

/* Sunlight of a Lambertian material per cell, over the cosine of incidence: seen from any side. 0:
 * it is not the same for all directions. */
static double even_sun(const bst_resolved_adding *a, int material) {
    const bst_material *m = &a->r->satellite->materials[material];
    bool even = m->brdf.model == BST_BRDF_LAMBERT && bst_sun_disc_nodes(m, &a->r->disc) == 1;
    double gain = even ? a->light->gain[material].sun : 0.0;
    return gain * m->scale * bst_brdf_value(&m->brdf, 1.0, 1.0, 1.0) / (a->per_m * a->per_m);
}

/* Light of a facet in sight by bst_resolved_shade, or the same light with less work.
 *
 * Given:     even  even_sun of its material
 *            in    cosine of the Sun's incidence */
static bst_resolved_shading shade_facet(const bst_resolved_adding *a, int facet, double even,
                                        double in) {
    static const double EDGE_ON = 1e-4; /* cosine of the angle of sight: dimmed below it */
    const bst_resolved_areas *s = &a->r->areas;
    int material = s->net.material[facet];
    bst_vec3 normal = s->planes[facet].normal;
    if (even > 0.0 && in > 1e-9) {
        bst_vec3 way = bst_vec3_sub(a->eye_m, s->middles[facet]);
        double out = bst_vec3_dot(normal, way);
        if (out > 0.0 && out * out > EDGE_ON * EDGE_ON * bst_vec3_dot(way, way)) {
            double uniform = a->light->gain[material].emission / (a->per_m * a->per_m);
            return (bst_resolved_shading){even * (in < 1.0 ? in : 1.0), 0.0, uniform, {0.0, 0.0}};
        }
    }
    return bst_resolved_shade(a, material, s->middles[facet], normal);
}

/* Finds the facets that face the observer, with their light, and those that face the Sun. */
static void shade(const bst_resolved_adding *a, bst_vec3 toward_sun) {
    bst_resolved_areas *s = &a->r->areas;
    const bst_satellite *sat = a->r->satellite;
    const bst_vec3 eye_m = a->eye_m, sun = a->light->sun;
    bst_resolved_shading most = {0.0, 0.0, 0.0, {0.0, 0.0}};
    int known = -1; /* material of `even` */
    double even = 0.0, brightest = 0.0;
    for (int f = 0; f < sat->facet_count; f++) {
        bst_vec3 normal = s->planes[f].normal;
        bool facing = bst_vec3_dot(normal, eye_m) > s->planes[f].offset_m;
        s->eye.facing[f] = facing;
        s->lit[0].facing[f] = bst_vec3_dot(normal, toward_sun) > 0.0;
        s->wanted[f] = 0;
        if (!facing) {
            continue;
        }
        bst_resolved_shading light = {0.0, 0.0, 0.0, {0.0, 0.0}};
        int material = s->net.material[f];
        double in = bst_vec3_dot(normal, sun);
        if (material != known) {
            known = material;
            even = a->earth ? 0.0 : even_sun(a, material);
        }
        if (in > 0.0 || a->earth || a->light->gain[material].emission > 0.0) {
            light = shade_facet(a, f, even, in);
        }
        double sum = light.uniform + light.sun + light.earth;
        s->even[f] = light.uniform;
        s->from[0][f] = light.sun;
        s->from[1][f] = light.earth;
        s->wanted[f] = sum > 0.0;
        if (sum > brightest) {
            brightest = sum;
            most = light;
        }
    }
    s->eye.facing[sat->facet_count] = s->lit[0].facing[sat->facet_count] = 0;
    bst_resolved_note_light(a, &most, false);
}

bst_status bst_resolved_place_facets(bst_ctx *ctx, const bst_resolved_adding *a,
                                     const bst_resolved_light_view *sun) {
    bst_resolved_areas *s = &a->r->areas;
    bst_facet_layers *l = &s->eye;
    BST_TRY(bst_facet_layers_begin(ctx, l, &s->net, a->r->image.width, a->r->image.height));
    l->same = BST_RESOLVED_SAME * a->r->satellite->radius_m;
    l->cells_per_m = cells_per_m(a);
    place_planes(a);
    place_vertices(a, sun);
    shade(a, sun->z);
    return BST_OK;
}
