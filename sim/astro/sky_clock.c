#include "sim/astro/sky_clock.h"

#include <pthread.h>
#include <stdint.h>
#include <stdlib.h>

#include "sim/astro/frames_internal.h"

#define STEPS_PER_DAY 720
/* grid nodes kept: queries slightly back in time must not displace current nodes */
#define NODES 4
/* grid nodes kept for clocks at different times of a run */
#define SHARED_NODES 16

typedef struct node {
    int64_t index;
    bool valid;
    bool beyond; /* after the end of the Earth orientation table */
    bst_astro_earth_parts parts;
    bst_bodies bodies;
} node;

struct bst_sky_clock_grid {
    const bst_astro_eop *eop;
    pthread_mutex_t lock;
    node nodes[SHARED_NODES];
};

struct bst_sky_clock {
    const bst_astro_eop *eop;
    bst_sky_clock_grid *grid; /* NULL: computes its own grid values */
    node nodes[NODES];
    bool asked; /* `last` holds the time of the previous call */
    bst_time last;
    bst_sky_rotation sky;
};

bst_status bst_sky_clock_grid_create(bst_ctx *ctx, const bst_astro_eop *eop,
                                     bst_sky_clock_grid **out) {
    bst_sky_clock_grid *grid = calloc(1, sizeof *grid);
    *out = NULL;
    if (!grid) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the values of sky clocks");
    }
    grid->eop = eop;
    pthread_mutex_init(&grid->lock, NULL);
    *out = grid;
    return BST_OK;
}

void bst_sky_clock_grid_free(bst_sky_clock_grid *grid) {
    if (grid) {
        pthread_mutex_destroy(&grid->lock);
        free(grid);
    }
}

bst_status bst_sky_clock_create_on(bst_ctx *ctx, bst_sky_clock_grid *grid, bst_sky_clock **out) {
    BST_TRY(bst_sky_clock_create(ctx, grid->eop, out));
    (*out)->grid = grid;
    return BST_OK;
}

bst_status bst_sky_clock_create(bst_ctx *ctx, const bst_astro_eop *eop, bst_sky_clock **out) {
    bst_sky_clock *clock = calloc(1, sizeof *clock);
    if (!clock) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for a sky clock");
    }
    clock->eop = eop;
    *out = clock;
    return BST_OK;
}

void bst_sky_clock_free(bst_sky_clock *clock) {
    free(clock);
}

/* Computes the grid value of an index. After the Earth orientation table it uses the values of its
 * end, for times just before. */
static bst_status make_node(bst_ctx *ctx, const bst_astro_eop *eop, int64_t index, node *n) {
    int64_t day = index / STEPS_PER_DAY, step = index % STEPS_PER_DAY;
    bst_time t = {(double)day + 0.5, (double)step / STEPS_PER_DAY};
    n->valid = false;
    bst_status status = bst_astro_earth_parts_at(ctx, eop, t, t, &n->parts);
    n->beyond = status == BST_ERR_RANGE;
    if (n->beyond) {
        bst_time read_at;
        BST_TRY(bst_astro_eop_nearest(ctx, eop, t, &read_at));
        status = bst_astro_earth_parts_at(ctx, eop, t, read_at, &n->parts);
    }
    BST_TRY(status);
    bst_bodies_at(t, &n->bodies);
    n->index = index;
    n->valid = true;
    return BST_OK;
}

/* Takes a grid value from the shared grid, computing it if missing. */
static bst_status shared_node(bst_ctx *ctx, bst_sky_clock_grid *grid, int64_t index, node *out) {
    node *n = &grid->nodes[index % SHARED_NODES];
    bst_status status = BST_OK;
    pthread_mutex_lock(&grid->lock);
    if (!n->valid || n->index != index) {
        status = make_node(ctx, grid->eop, index, n);
    }
    *out = *n;
    pthread_mutex_unlock(&grid->lock);
    return status;
}

/* Grid value of an index, from the cache or computed. */
static bst_status node_at(bst_ctx *ctx, bst_sky_clock *clock, int64_t index, const node **out) {
    node *n = &clock->nodes[index % NODES];
    if (!n->valid || n->index != index) {
        n->valid = false;
        BST_TRY(clock->grid ? shared_node(ctx, clock->grid, index, n)
                            : make_node(ctx, clock->eop, index, n));
    }
    *out = n;
    return BST_OK;
}

static bst_vec3 lerp(bst_vec3 a, bst_vec3 b, double f) {
    return bst_vec3_axpy(a, f, bst_vec3_sub(b, a));
}

/* Linear interpolation of matrix elements: nearby rotations stay orthogonal to double precision. */
static bst_mat3 lerp_rotation(const bst_mat3 *a, const bst_mat3 *b, double f) {
    bst_mat3 r;
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            r.m[i][j] = a->m[i][j] + f * (b->m[i][j] - a->m[i][j]);
        }
    }
    return r;
}

static double lerp_angle(double a, double b, double f) {
    double step = b - a;
    if (step < -BST_PI) {
        step += 2.0 * BST_PI;
    } else if (step > BST_PI) {
        step -= 2.0 * BST_PI;
    }
    return a + f * step;
}

bst_astro_earth_parts bst_astro_earth_parts_between(const bst_astro_earth_parts *a,
                                                    const bst_astro_earth_parts *b, double f) {
    return (bst_astro_earth_parts){
        .cirs_from_gcrf = lerp_rotation(&a->cirs_from_gcrf, &b->cirs_from_gcrf, f),
        .itrf_from_tirs = lerp_rotation(&a->itrf_from_tirs, &b->itrf_from_tirs, f),
        .era_rad = lerp_angle(a->era_rad, b->era_rad, f),
        .teme_turn_rad = lerp_angle(a->teme_turn_rad, b->teme_turn_rad, f),
    };
}

bst_status bst_sky_clock_at(bst_ctx *ctx, bst_sky_clock *clock, bst_time t, bst_sky_rotation *out) {
    /* repeated calls for one time are common */
    if (clock->asked && t.jd1 == clock->last.jd1 && t.jd2 == clock->last.jd2) {
        *out = clock->sky;
        return BST_OK;
    }
    if (!(t.jd1 >= 0.5 && t.jd1 < 1e8 && t.jd2 >= 0.0 && t.jd2 < 1.0)) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "JD %g + %g is not an instant", t.jd1, t.jd2);
    }
    double steps = t.jd2 * STEPS_PER_DAY;
    int64_t step = (int64_t)steps;
    if (step >= STEPS_PER_DAY) { /* rounding just before midnight */
        step = STEPS_PER_DAY - 1;
    }
    int64_t index = (int64_t)t.jd1 * STEPS_PER_DAY + step;
    double f = (t.jd2 - (double)step / STEPS_PER_DAY) * STEPS_PER_DAY;
    const node *a, *b;
    BST_TRY(node_at(ctx, clock, index, &a));
    BST_TRY(node_at(ctx, clock, index + 1, &b));
    if (a->beyond || b->beyond) {
        bst_astro_eop_values covered;
        BST_TRY(bst_astro_eop_at(ctx, clock->eop, t, &covered));
    }
    bst_astro_earth_parts parts = bst_astro_earth_parts_between(&a->parts, &b->parts, f);
    out->frames = bst_astro_earth_frames_from_parts(&parts);
    out->bodies.sun_m = lerp(a->bodies.sun_m, b->bodies.sun_m, f);
    out->bodies.moon_m = lerp(a->bodies.moon_m, b->bodies.moon_m, f);
    out->bodies.earth_bary_m = lerp(a->bodies.earth_bary_m, b->bodies.earth_bary_m, f);
    out->bodies.earth_bary_mps = lerp(a->bodies.earth_bary_mps, b->bodies.earth_bary_mps, f);
    out->bodies.pole = lerp(a->bodies.pole, b->bodies.pole, f);
    clock->asked = true;
    clock->last = t;
    clock->sky = *out;
    return BST_OK;
}
