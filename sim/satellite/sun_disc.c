#include "sim/satellite/sun_disc.h"

/* Radius of the Sun over the width of a lobe above which the disc matters: 1e-3 of the flux. */
static const double SHARP = 0.05;

/* Nodes for a lobe: limb darkening 1 - 0.6 (1 - mu) (Cox, Allen's Astrophysical Quantities, 4th
 * edition, section 14.7) has the mean square radius 0.45. */
void bst_sun_disc_make(bst_vec3 sun, double r, double lobe_rad, bst_sun_disc *out) {
    bst_vec3 e1 = bst_vec3_perpendicular(sun), e2 = bst_vec3_cross(sun, e1);
    out->centre = sun;
    out->radius_rad = r;
    out->count = 1;
    out->direction[0] = sun;
    out->weight[0] = 1.0;
    if (!(r > SHARP * lobe_rad)) {
        return;
    }
    /* one ring with the second moment of the disc, or four rings */
    static const double ring_one[] = {0.7745966692414834}, weight_one[] = {0.75};
    static const double ring_four[] = {0.35, 0.61, 0.79, 0.94};
    bool fine = r > 0.3 * lobe_rad;
    int rings = fine ? 4 : 1, around = fine ? 12 : 6;
    double weights[4] = {weight_one[0]}, total = 0.0;
    for (int i = 0; i < 4 && fine; i++) { /* rings of equal area, each with its brightness */
        weights[i] = 1.0 - 0.6 * (1.0 - sqrt(1.0 - ring_four[i] * ring_four[i]));
        total += weights[i];
    }
    out->count = fine ? 0 : 1;
    out->weight[0] = 0.25;
    for (int i = 0; i < rings; i++) {
        double radius = r * (fine ? ring_four[i] : ring_one[i]);
        for (int k = 0; k < around; k++) {
            double a = 2.0 * BST_PI * (k + 0.5 * i) / around;
            bst_vec3 d =
                bst_vec3_axpy(bst_vec3_axpy(sun, radius * cos(a), e1), radius * sin(a), e2);
            out->direction[out->count] = bst_vec3_unit(d);
            out->weight[out->count++] = (fine ? weights[i] / total : weights[i]) / around;
        }
    }
}

int bst_sun_disc_nodes(const bst_material *m, const bst_sun_disc *sun) {
    bool wide = sun->radius_rad <= SHARP * bst_brdf_lobe_rad(&m->brdf);
    return wide ? 1 : sun->count;
}

double bst_facet_light(const bst_material *m, const bst_sun_disc *sun, bst_vec3 normal,
                       bst_vec3 observer) {
    double out = fmin(bst_vec3_dot(normal, observer), 1.0), sum = 0.0;
    int nodes = bst_sun_disc_nodes(m, sun);
    if (nodes == 1) {
        double in = fmin(bst_vec3_dot(normal, sun->centre), 1.0);
        return m->scale * in * out *
               bst_brdf_value(&m->brdf, in, out, bst_vec3_dot(sun->centre, observer));
    }
    for (int i = 0; i < sun->count; i++) {
        double in = bst_vec3_dot(normal, sun->direction[i]);
        if (in > 1e-9 && out > 1e-9) {
            sum += sun->weight[i] * fmin(in, 1.0) * out *
                   bst_brdf_value(&m->brdf, fmin(in, 1.0), out,
                                  bst_vec3_dot(sun->direction[i], observer));
        }
    }
    return sum * m->scale;
}
