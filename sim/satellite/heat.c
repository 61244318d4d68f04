#include "sim/satellite/heat.h"

#include <assert.h>

double bst_heat_sphere_factor(double cosine, double sine) {
    double whole = sine * sine;
    if (!(sine > 0.0) || cosine >= sine) { /* the whole sphere is above the element's plane */
        return fmax(cosine, 0.0) * whole;
    }
    if (cosine <= -sine) {
        return 0.0;
    }
    double up = sqrt(1.0 - cosine * cosine), root = sqrt(1.0 / whole - 1.0);
    double inner = sqrt(fmax(1.0 - cosine * cosine / whole, 0.0));
    double turn = acos(fmin(fmax(-root * cosine / up, -1.0), 1.0));
    return 0.5 - asin(fmin(root * sine / up, 1.0)) / BST_PI +
           whole / BST_PI * (cosine * turn - root * inner);
}

/* The part of a facet that the parts of the model leave free toward view 0. */
static double free_part(bst_satellite_pose *p, int facet) {
    return bst_pose_unshadowed_area(p, facet, 1) / p->satellite->facets[facet].area_m2;
}

/* Irradiance of a facet by earthlight over that of the Sun, without shadows. */
static double earthlight_on(const bst_earthlight *light, bst_vec3 normal) {
    double sum = 0.0;
    for (int i = 0; i < light->count; i++) {
        sum += light->irradiance[i] * fmax(bst_vec3_dot(normal, light->direction[i]), 0.0);
    }
    return sum;
}

void bst_heat_loads(bst_satellite_pose *p, const bst_heat_environment *e, double *load) {
    const bst_satellite *s = p->satellite;
    assert(s->has_surfaces);
    bool lit = e->sunlight_wpm2 > 0.0;
    if (lit) {
        bst_pose_look(p, 0, e->sun);
    }
    for (int i = 0; i < s->facet_count; i++) {
        double cosine = bst_vec3_dot(p->normals[i], e->sun);
        double absorptance = s->surfaces[s->facets[i].material].absorptance;
        load[i] = lit && cosine > 1e-9
                      ? absorptance * e->sunlight_wpm2 * fmin(cosine, 1.0) * free_part(p, i)
                      : 0.0;
    }
    bool earthlit = e->earthlight && e->earthlight->count > 0;
    if (!earthlit && !(e->earth_infrared_wpm2 > 0.0)) {
        return;
    }
    bst_pose_look(p, 0, earthlit ? e->earthlight->centre : e->earth);
    for (int i = 0; i < s->facet_count; i++) {
        int m = s->facets[i].material;
        bst_vec3 n = p->normals[i];
        double heat = s->materials[m].emissivity * e->earth_infrared_wpm2 *
                      bst_heat_sphere_factor(bst_vec3_dot(n, e->earth), e->earth_sine);
        heat += earthlit ? s->surfaces[m].absorptance * e->earthlight_wpm2 *
                               earthlight_on(e->earthlight, n)
                         : 0.0;
        /* a facet that sees only the edge of the Earth has no shadow of its middle */
        bool faces = bst_vec3_dot(n, p->views[0].z) > 0.05;
        load[i] += heat > 0.0 ? heat * (faces ? free_part(p, i) : 1.0) : 0.0;
    }
}

double bst_heat_steady_k(double load_wpm2, double emissivity) {
    return emissivity > 0.0 && load_wpm2 > 0.0
               ? sqrt(sqrt(load_wpm2 / (emissivity * BST_STEFAN_BOLTZMANN)))
               : 0.0;
}

double bst_heat_after(double kelvin, const double load[2], double emissivity, double capacity,
                      double seconds) {
    assert(capacity > 0.0 && seconds >= 0.0);
    double emit = emissivity * BST_STEFAN_BOLTZMANN;
    double hottest = fmax(kelvin, bst_heat_steady_k(fmax(load[0], load[1]), emissivity));
    double rate = 4.0 * emit * hottest * hottest * hottest / capacity; /* 1 / time constant */
    if (rate * seconds > 90.0) { /* it has long followed the load */
        return bst_heat_steady_k(load[1], emissivity);
    }
    int steps = (int)fmax(ceil(10.0 * rate * seconds), 1.0);
    double h = seconds / steps, t = kelvin;
    for (int i = 0; i < steps; i++) {
        double slope = (load[1] - load[0]) / steps, q0 = load[0] + slope * i;
        double k[4], at = t;
        for (int r = 0; r < 4; r++) {
            double q = q0 + slope * (r == 0 ? 0.0 : r == 3 ? 1.0 : 0.5);
            k[r] = (q - emit * at * at * at * at) / capacity;
            at = t + h * k[r] * (r == 2 ? 1.0 : 0.5);
        }
        t += h / 6.0 * (k[0] + 2.0 * k[1] + 2.0 * k[2] + k[3]);
    }
    return fmax(t, 0.0);
}

void bst_heat_emission(bst_satellite_pose *p, bst_vec3 observer, const double *kelvin,
                       bst_thermal_emission *out) {
    const bst_satellite *s = p->satellite;
    double sum[BST_EMISSION_BINS][3] = {{0}}; /* area, times T - low, times its square */
    double low = INFINITY, high = 0.0;
    for (int i = 0; i < s->facet_count; i++) {
        low = fmin(low, kelvin[i]);
        high = fmax(high, kelvin[i]);
    }
    bst_pose_look(p, 0, observer);
    for (int i = 0; i < s->facet_count; i++) {
        double cosine = bst_vec3_dot(p->normals[i], observer);
        double emissivity = s->materials[s->facets[i].material].emissivity;
        if (!(cosine > 1e-9) || !(emissivity > 0.0)) {
            continue;
        }
        double above = kelvin[i] - low;
        int bin = high > low ? (int)(above / (high - low) * BST_EMISSION_BINS) : 0;
        bin = bin < BST_EMISSION_BINS ? bin : BST_EMISSION_BINS - 1;
        double area = emissivity * cosine * s->facets[i].area_m2 * free_part(p, i);
        sum[bin][0] += area;
        sum[bin][1] += area * above;
        sum[bin][2] += area * above * above;
    }
    out->count = 0;
    for (int b = 0; b < BST_EMISSION_BINS; b++) {
        if (sum[b][0] > 0.0) {
            double mean = sum[b][1] / sum[b][0];
            double variance = fmax(sum[b][2] / sum[b][0] - mean * mean, 0.0);
            out->bins[out->count++] =
                (struct bst_emission_bin){sum[b][0], low + mean, sqrt(variance)};
        }
    }
}
