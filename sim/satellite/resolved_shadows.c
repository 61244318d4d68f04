/* Penumbrae: the point of the Sun's disc that casts the shadows, and how wide they are. */
#include "sim/satellite/pose_view.h"
#include "sim/satellite/resolved_faces.h"

bst_vec3 bst_resolved_shadow_sun(const bst_resolved_light *l) {
    if (l->shadow_at[0] == 0.0 && l->shadow_at[1] == 0.0) {
        return l->sun;
    }
    bst_vec3 right = bst_vec3_perpendicular(l->sun), up = bst_vec3_cross(l->sun, right);
    bst_vec3 at = bst_vec3_axpy(l->sun, l->sun_radius_rad * l->shadow_at[0], right);
    return bst_vec3_unit(bst_vec3_axpy(at, l->sun_radius_rad * l->shadow_at[1], up));
}

/* Least cosine of incidence: at less, the penumbra is as wide as the facet. */
static const double GRAZING = 0.005;

/* Where the Sun is moved by d across the light, a shadow moves by gap (d - z (n . d) / (n . z)) on
 * the facet; half the width of the penumbra is the larger singular value of that in the image. */
void bst_resolved_note_shadow(const bst_resolved_adding *a, bst_vec3 normal, bst_vec3 place,
                              double light, double gap_m) {
    bst_resolved_image *m = &a->r->image;
    bst_vec3 z = a->light->sun, eye = bst_vec3_sub(a->eye_m, place), way[2];
    double range_m = bst_vec3_norm(eye), in = fmax(bst_vec3_dot(normal, z), GRAZING);
    if (!(a->light->sun_radius_rad > 0.0 && gap_m > 0.0 && light > 0.0)) {
        return;
    }
    eye = bst_vec3_scale(eye, 1.0 / range_m);
    way[0] = bst_vec3_perpendicular(z);
    way[1] = bst_vec3_cross(z, way[0]);
    for (int i = 0; i < 2; i++) {
        way[i] = bst_vec3_axpy(way[i], -bst_vec3_dot(normal, way[i]) / in, z);
        way[i] = bst_vec3_axpy(way[i], -bst_vec3_dot(way[i], eye), eye);
    }
    double xx = bst_vec3_dot(way[0], way[0]), yy = bst_vec3_dot(way[1], way[1]);
    double xy = bst_vec3_dot(way[0], way[1]);
    double largest = sqrt(0.5 * (xx + yy) + hypot(0.5 * (xx - yy), xy));
    double px = a->light->sun_radius_rad * gap_m * largest * a->per_m * m->cell_px / range_m;
    int octave = (int)fmin(fmax(floor(log2(px)) + 8.0, 0.0), BST_RESOLVED_PENUMBRAE - 1.0);
    bst_resolved_penumbra *p = &m->penumbrae[octave];
    p->light_px2 = fmax(p->light_px2, light / (m->cell_px * m->cell_px) * px * px);
    p->px = fmax(p->px, px);
}

void bst_resolved_note_shadows_on(const bst_resolved_adding *a, int index, double light) {
    const bst_satellite_pose *p = a->pose;
    const bst_satellite *s = p->satellite;
    const bst_facet *facet = &s->facets[index];
    const bst_pose_view *v = &p->views[0];
    bst_vec3 normal = p->normals[index], place = p->vertices[s->corner[facet->first]];
    double bounds[6], gap_m = 0.0, in = fmax(bst_vec3_dot(normal, v->z), GRAZING);
    bst_pose_start_bounds(bounds);
    for (int i = 0; i < facet->count; i++) {
        bst_pose_add_to_bounds(v, s->corner[facet->first + i], bounds);
    }
    for (int o = 0; o < s->occluder_count; o++) {
        const bst_occluder *body = &s->occluders[o];
        if ((o == facet->occluder && !facet->inside) || !bst_pose_may_hide(v->bounds[o], bounds)) {
            continue;
        }
        double most_m = -INFINITY;
        for (int i = body->first_vertex; i < body->first_vertex + body->vertex_count; i++) {
            double up_m = bst_vec3_dot(normal, bst_vec3_sub(p->vertices[i], place));
            most_m = fmax(most_m, up_m / in);
        }
        gap_m = fmax(gap_m, fmin(most_m, v->bounds[o][5] - bounds[4]));
    }
    bst_resolved_note_shadow(a, normal, place, light, gap_m);
}
