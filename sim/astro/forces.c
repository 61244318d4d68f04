#include "sim/astro/forces.h"

#include <stdint.h>
#include <stdlib.h>

#include "sim/astro/atmosphere.h"
#include "sim/astro/bodies.h"
#include "sim/astro/frames_internal.h"

#define NODE_STEP_S 3600.0
/* grid nodes for the longest integrator step, with neighbours */
#define NODES 16

typedef struct node {
    int64_t index;
    bool has_bodies, has_earth;
    bst_astro_earth_parts parts;
    bst_vec3 sun_m, moon_m;
} node;

struct bst_forces {
    bst_force_model model;
    bst_time epoch;
    bool turns;            /* the Earth's rotation is modelled */
    bool has_bodies;       /* Sun or Moon is modelled */
    double light_accel_au; /* m/s^2 at 1 au */
    bst_vec3 pole;         /* at the epoch */
    double drag_factor;    /* m^2/kg: cd A / (2 m), times density_scale */
    node nodes[NODES];
};

/* Checks mass, areas and coefficients of the force model's spacecraft. */
static bst_status check(bst_ctx *ctx, const bst_force_model *m) {
    const bst_astro_spacecraft *s = &m->spacecraft;
    if ((m->solar_pressure || m->drag) && !(s->mass_kg > 0.0 && isfinite(s->mass_kg))) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "solar pressure and drag need a mass above 0 (found %g kg)", s->mass_kg);
    }
    if (m->solar_pressure && !(s->light_area_m2 >= 0.0 && s->light_coefficient >= 0.0 &&
                               isfinite(s->light_area_m2 * s->light_coefficient))) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "solar pressure on %g m2 with a coefficient of %g (0 and above allowed)",
                        s->light_area_m2, s->light_coefficient);
    }
    if (m->drag &&
        !(s->drag_area_m2 >= 0.0 && s->drag_coefficient >= 0.0 && m->density_scale >= 0.0 &&
          isfinite(s->drag_area_m2 * s->drag_coefficient * m->density_scale))) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "drag on %g m2 with a coefficient of %g in %g times the air (0 and above "
                        "allowed)",
                        s->drag_area_m2, s->drag_coefficient, m->density_scale);
    }
    return BST_OK;
}

bst_status bst_forces_create(bst_ctx *ctx, const bst_force_model *model, bst_time epoch,
                             bst_forces **out) {
    *out = NULL;
    BST_TRY(check(ctx, model));
    bst_forces *f = calloc(1, sizeof *f);
    if (!f) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a force model");
    }
    f->model = *model;
    f->epoch = epoch;
    f->turns = model->eop && (bst_gravity_degree(model->gravity) >= 2 || model->drag);
    f->has_bodies = model->sun || model->moon || model->solar_pressure || model->surface;
    bst_bodies bodies;
    bst_bodies_at(epoch, &bodies);
    f->pole = bodies.pole; /* constant: it moves by 0.06 arcsec per day, the limb by 6 mm */
    const bst_astro_spacecraft *s = &model->spacecraft;
    if (model->solar_pressure) {
        f->light_accel_au =
            BST_SUNLIGHT_PRESSURE_PA * s->light_coefficient * s->light_area_m2 / s->mass_kg;
    }
    if (model->drag) {
        f->drag_factor =
            0.5 * s->drag_coefficient * s->drag_area_m2 / s->mass_kg * model->density_scale;
    }
    *out = f;
    return BST_OK;
}

void bst_forces_free(bst_forces *forces) {
    free(forces);
}

/* Cache entry of a time node. */
static node *slot(bst_forces *f, int64_t index) {
    node *n = &f->nodes[((index % NODES) + NODES) % NODES];
    if (n->index != index) {
        n->has_bodies = n->has_earth = false;
        n->index = index;
    }
    return n;
}

/* Sun and Moon at a time node, cached. */
static const node *bodies_at(bst_forces *f, int64_t index) {
    node *n = slot(f, index);
    if (!n->has_bodies) {
        bst_bodies bodies;
        bst_bodies_at(bst_time_add(f->epoch, NODE_STEP_S * (double)index), &bodies);
        n->sun_m = bodies.sun_m;
        n->moon_m = bodies.moon_m;
        n->has_bodies = true;
    }
    return n;
}

/* Earth rotation at a time node, cached. */
static bst_status earth_at(bst_ctx *ctx, bst_forces *f, int64_t index, const node **out) {
    node *n = slot(f, index);
    if (!n->has_earth) {
        bst_time t = bst_time_add(f->epoch, NODE_STEP_S * (double)index);
        BST_TRY(bst_astro_earth_parts_at(ctx, f->model.eop, t, t, &n->parts));
        n->has_earth = true;
    }
    *out = n;
    return BST_OK;
}

/* Splits a time into the index of its node and the fraction after it. */
static void split(double seconds, int64_t *index, double *f) {
    double steps = seconds / NODE_STEP_S, whole = floor(steps);
    *index = (int64_t)whole;
    *f = steps - whole;
}

/* Sun and Moon by cubic Lagrange interpolation in the four nearest grid values. */
static void sun_and_moon(bst_forces *forces, double seconds, bst_vec3 *sun, bst_vec3 *moon) {
    int64_t index;
    double f;
    split(seconds, &index, &f);
    const double w[4] = {-f * (f - 1) * (f - 2) / 6, (f + 1) * (f - 1) * (f - 2) / 2,
                         -(f + 1) * f * (f - 2) / 2, (f + 1) * f * (f - 1) / 6};
    *sun = *moon = (bst_vec3){0.0, 0.0, 0.0};
    for (int i = 0; i < 4; i++) {
        const node *n = bodies_at(forces, index - 1 + i);
        *sun = bst_vec3_axpy(*sun, w[i], n->sun_m);
        *moon = bst_vec3_axpy(*moon, w[i], n->moon_m);
    }
}

/* Third-body acceleration by Battin's formula: body at s, spacecraft at r, both geocentric. */
static bst_vec3 third_body(double gm, bst_vec3 r, bst_vec3 s) {
    bst_vec3 d = bst_vec3_sub(r, s);
    double q = bst_vec3_dot(r, bst_vec3_axpy(r, -2.0, s)) / bst_vec3_dot(s, s);
    double f = q * (3.0 + q * (3.0 + q)) / (1.0 + (1.0 + q) * sqrt(1.0 + q));
    double d2 = bst_vec3_dot(d, d);
    return bst_vec3_scale(bst_vec3_axpy(r, f, s), -gm / (d2 * sqrt(d2)));
}

/* Acceleration of a shape by sunlight and air, m/s2. */
static bst_vec3 surface_forces(const bst_forces *f, const bst_force_state *at, bst_vec3 sun_m,
                               bst_vec3 fixed, bst_vec3 spin) {
    const bst_force_model *m = &f->model;
    const bst_force_surface *s = m->surface;
    bst_vec3 a = {0.0, 0.0, 0.0}, d = bst_vec3_sub(at->position_m, sun_m);
    double sunlight =
        m->solar_pressure ? bst_astro_sun_fraction(at->position_m, sun_m, f->pole) : 0.0;
    if (sunlight > 0.0) {
        double pressure =
            BST_SUNLIGHT_PRESSURE_PA * sunlight * BST_AU_M * BST_AU_M / bst_vec3_dot(d, d);
        a = bst_vec3_scale(s->light_area_m2(s->user, at), pressure / m->spacecraft.mass_kg);
    }
    if (m->drag) {
        bst_vec3 wind = bst_vec3_sub(at->velocity_mps, bst_vec3_cross(spin, at->position_m));
        double speed = bst_vec3_norm(wind), height = bst_astro_height_m(fixed);
        double density = bst_atmosphere_density_kgpm3(height) * m->density_scale;
        if (density > 0.0 && speed > 0.0) {
            double area = s->drag_area_m2(s->user, at, bst_vec3_scale(wind, 1.0 / speed));
            double factor = 0.5 * m->spacecraft.drag_coefficient * area / m->spacecraft.mass_kg;
            a = bst_vec3_axpy(a, -factor * density * speed, wind);
        }
    }
    return a;
}

/* Acceleration by atmospheric drag in m/s2; the atmosphere rotates with the Earth. */
static bst_vec3 drag(const bst_forces *f, bst_vec3 fixed, bst_vec3 r, bst_vec3 v, bst_vec3 spin) {
    bst_vec3 wind = bst_vec3_sub(v, bst_vec3_cross(spin, r));
    double density = bst_atmosphere_density_kgpm3(bst_astro_height_m(fixed));
    return bst_vec3_scale(wind, -f->drag_factor * density * bst_vec3_norm(wind));
}

bst_status bst_forces_at(bst_ctx *ctx, bst_forces *f, double seconds, bst_vec3 r, bst_vec3 v,
                         bst_vec3 *out) {
    const bst_force_model *m = &f->model;
    if (!isfinite(seconds) || fabs(seconds) > 1e10) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "forces at %g s after the epoch", seconds);
    }
    bst_vec3 a, spin = {0.0, 0.0, 0.0}, fixed = r;
    if (f->turns) {
        int64_t index;
        double fraction;
        split(seconds, &index, &fraction);
        const node *before, *after;
        BST_TRY(earth_at(ctx, f, index, &before));
        BST_TRY(earth_at(ctx, f, index + 1, &after));
        bst_astro_earth_parts parts =
            bst_astro_earth_parts_between(&before->parts, &after->parts, fraction);
        bst_astro_earth_frames frames = bst_astro_earth_frames_from_parts(&parts);
        fixed = bst_mat3_mul_vec(&frames.itrf_from_gcrf, r);
        a = bst_mat3_transpose_mul_vec(&frames.itrf_from_gcrf,
                                       bst_gravity_acceleration(m->gravity, fixed));
        spin = bst_astro_earth_rate_gcrf(&frames);
    } else {
        a = bst_gravity_acceleration(m->gravity, r);
    }
    if (m->drag && !m->surface) {
        a = bst_vec3_add(a, drag(f, fixed, r, v, spin));
    }
    if (f->has_bodies) {
        bst_vec3 sun, moon;
        sun_and_moon(f, seconds, &sun, &moon);
        if (m->sun) {
            a = bst_vec3_add(a, third_body(BST_SUN_GM_M3PS2, r, sun));
        }
        if (m->moon) {
            a = bst_vec3_add(a, third_body(BST_MOON_GM_M3PS2, r, moon));
        }
        if (m->surface) {
            bst_force_state at = {seconds, r, v, bst_vec3_unit(bst_vec3_sub(sun, r))};
            a = bst_vec3_add(a, surface_forces(f, &at, sun, fixed, spin));
        } else if (m->solar_pressure) {
            bst_vec3 d = bst_vec3_sub(r, sun);
            double d2 = bst_vec3_dot(d, d);
            double size = f->light_accel_au * bst_astro_sun_fraction(r, sun, f->pole) * BST_AU_M *
                          BST_AU_M / d2;
            a = bst_vec3_axpy(a, size / sqrt(d2), d);
        }
    }
    *out = a;
    return BST_OK;
}

double bst_forces_sunlight(bst_forces *f, double seconds, bst_vec3 position_m) {
    if (!f->model.solar_pressure || !isfinite(seconds) || fabs(seconds) > 1e10) {
        return 1.0;
    }
    bst_vec3 sun, moon;
    sun_and_moon(f, seconds, &sun, &moon);
    return bst_astro_sun_fraction(position_m, sun, f->pole);
}
