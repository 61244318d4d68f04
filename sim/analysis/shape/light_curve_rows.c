#include "sim/analysis/shape/light_curve_rows.h"

#include <stdlib.h>

#include "sim/astro/frames.h"
#include "sim/core/parallel.h"

/* Rows of a block: a view caches rotations near its last time, so that a block has a view of its
 * own, and its rows do not depend on who computes it. */
enum { BLOCK_ROWS = 512 };

/* An object that is nearer is the observer itself; positions are exact to far less. */
static const double SAME_PLACE_M = 0.01;

/* A block's outcome. */
typedef struct block {
    bst_status status;
    bst_ctx ctx;
} block;

typedef struct job {
    const bst_light_curve *curve;
    int count;
    bst_light_curve_row *rows;
    block *blocks;
} job;

/* Air mass at an apparent elevation (Kasten and Young 1989). */
static double air_mass(double elevation_rad) {
    double deg = elevation_rad / BST_DEG_RAD;
    return 1.0 / (sin(elevation_rad) + 0.50572 * pow(deg + 6.07995, -1.6364));
}

static bst_status row_of_site(bst_ctx *ctx, const bst_light_curve *c, bst_world_view *view,
                              double at_s, bst_light_curve_row *out) {
    bst_astro_earth_frames frames;
    bst_world_state place;
    BST_TRY(bst_world_view_earth_frames(ctx, view, at_s, &frames));
    place.position_m = bst_mat3_transpose_mul_vec(&frames.itrf_from_gcrf, c->site_itrf_m);
    place.velocity_mps = bst_vec3_cross(bst_astro_earth_rate_gcrf(&frames), place.position_m);
    BST_TRY(bst_world_view_sight_from(ctx, view, &place, c->object, at_s, &out->sight));
    bst_vec3 way = bst_mat3_mul_vec(&frames.itrf_from_gcrf, out->sight.apparent);
    out->elevation_rad = asin(fmin(fmax(bst_vec3_dot(way, c->up), -1.0), 1.0));
    double azimuth = atan2(bst_vec3_dot(way, c->east), bst_vec3_dot(way, c->north));
    out->azimuth_rad = azimuth < 0.0 ? azimuth + 2.0 * BST_PI : azimuth;
    out->v_mag = out->elevation_rad > 0.0
                     ? out->sight.v_mag + c->request->extinction_mag * air_mass(out->elevation_rad)
                     : (double)INFINITY;
    return BST_OK;
}

/* Fails where the observer is at the place of the object, from which there is no magnitude. */
static bst_status check_range(bst_ctx *ctx, const bst_light_curve *c,
                              const bst_light_curve_row *row) {
    const bst_light_curve_request *r = c->request;
    if (row->sight.range_m > SAME_PLACE_M) {
        return BST_OK;
    }
    if (c->observing_object >= 0) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "--observer-norad %lld: is at the place of the satellite itself, --norad "
                        "%lld, after %g s; give another satellite, or --site",
                        (long long)r->observer_norad, (long long)r->norad, row->seconds);
    }
    return bst_fail(ctx, BST_ERR_ARGUMENT,
                    "object %s: the observer%s%s is at its place after %g s; give another --object "
                    "or --observer, or --site",
                    bst_world_object(c->world, c->object)->name, c->observer >= 0 ? " " : "",
                    c->observer >= 0 ? bst_world_observer_name(c->world, c->observer) : "",
                    row->seconds);
}

static bst_status make_row(bst_ctx *ctx, const bst_light_curve *c, bst_world_view *view,
                           double seconds, bst_light_curve_row *out) {
    double at_s = c->start_s + seconds;
    *out = (bst_light_curve_row){.seconds = seconds, .elevation_rad = NAN, .azimuth_rad = NAN};
    if (c->observer < 0 && c->observing_object < 0) {
        return row_of_site(ctx, c, view, at_s, out);
    }
    if (c->observing_object >= 0) {
        bst_world_state place;
        BST_TRY(bst_world_view_object_state(ctx, view, c->observing_object, at_s, &place));
        BST_TRY(bst_world_view_sight_from(ctx, view, &place, c->object, at_s, &out->sight));
    } else {
        BST_TRY(bst_world_view_sight(ctx, view, c->observer, c->object, at_s, &out->sight));
    }
    BST_TRY(check_range(ctx, c, out));
    out->v_mag = out->sight.occulted ? (double)INFINITY : out->sight.v_mag;
    return BST_OK;
}

static bst_status make_block(bst_ctx *ctx, const job *j, int first) {
    const bst_light_curve *c = j->curve;
    int end = first + BLOCK_ROWS < j->count ? first + BLOCK_ROWS : j->count;
    bst_world_view *view;
    BST_TRY(bst_world_view_create(ctx, c->world, &view));
    bst_world_view_reflected_only(view);
    bst_status status = BST_OK;
    for (int i = first; i < end && status == BST_OK; i++) {
        status = make_row(ctx, c, view, i * c->request->step_s, &j->rows[i]);
    }
    bst_world_view_free(view);
    return status;
}

static void make_blocks(void *user, int begin, int end) {
    const job *j = user;
    for (int b = begin; b < end; b++) {
        j->blocks[b].status = make_block(&j->blocks[b].ctx, j, b * BLOCK_ROWS);
    }
}

bst_status bst_light_curve_rows(bst_ctx *ctx, const bst_light_curve *c, int threads, int count,
                                bst_light_curve_row *rows) {
    int blocks = (count + BLOCK_ROWS - 1) / BLOCK_ROWS;
    job j = {c, count, rows, calloc((size_t)blocks + 1, sizeof(block))};
    bst_parallel *pool;
    if (!j.blocks) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for a light curve of %d rows", count);
    }
    bst_status status = bst_parallel_create(ctx, threads, &pool);
    if (status == BST_OK) {
        for (int b = 0; b < blocks; b++) {
            j.blocks[b].ctx = *ctx;
        }
        bst_parallel_for(pool, blocks, 1, make_blocks, &j);
        bst_parallel_free(pool);
    }
    for (int b = 0; b < blocks && status == BST_OK; b++) {
        status = j.blocks[b].status;
        if (status != BST_OK) {
            *ctx = j.blocks[b].ctx;
        }
    }
    free(j.blocks);
    return status;
}
