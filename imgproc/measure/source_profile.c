#include "imgproc/measure/source_profile.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "imgproc/measure/source_profile_internal.h"
#include "sim/core/pages.h"

enum { SIDE = BST_PSF_MAX_SIDE + BST_LANES };

bst_status bst_source_profiles_create(bst_ctx *ctx, const bst_known_psf *known,
                                      bst_source_profiles *out) {
    *out = (bst_source_profiles){.known = known, .binning = 1};
    int length = known ? bst_simd_layout_round_up(2 * known->reach_px + 1) : BST_PROFILE_LENGTH;
    size_t row = (size_t)(BST_PROFILE_PHASES + 1) * PARTS * (size_t)(length + BST_LANES);
    size_t terms = known ? (size_t)known->terms : 1, nodes = known ? (size_t)known->nodes : 1;
    out->rows = bst_pages_zero(BST_LANES + nodes * terms * row, sizeof(float));
    out->down = known ? calloc(BST_LANES + terms * row, sizeof(float)) : NULL;
    if (!out->rows || (known && !out->down)) {
        bst_source_profiles_free(out);
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for profiles");
    }
    return BST_OK;
}

void bst_source_profiles_free(bst_source_profiles *p) {
    bst_pages_free(p->rows);
    free(p->down);
    *p = (bst_source_profiles){0};
}

void bst_source_profiles_on(bst_source_profiles *p, double origin_x_px, double origin_y_px,
                            int binning) {
    p->origin_x_px = origin_x_px;
    p->origin_y_px = origin_y_px;
    p->binning = binning;
}

void bst_source_profiles_set(bst_source_profiles *p, const bst_imgproc_gauss *psf,
                             double sigma_px) {
    if (p->known) {
        p->sigma_px = sigma_px;
        bst_source_profiles_set_known(p);
        return;
    }
    if (p->sigma_px == sigma_px) {
        return;
    }
    p->sigma_px = sigma_px;
    int half = (int)ceil(4.5 * sigma_px);
    half = half < BST_LANES / 2 - 1 ? BST_LANES / 2 - 1 : half;
    p->length = bst_simd_layout_round_up(2 * half + 1);
    p->length = p->length < BST_PROFILE_LENGTH ? p->length : BST_PROFILE_LENGTH;
    p->half = (p->length - 1) / 2;
    p->pitch = p->length + BST_LANES;
    p->reach = (int)ceil(4.5 * sigma_px) + 1;
    p->reach = p->reach < p->half ? p->reach : p->half;
    double share[BST_PROFILE_LENGTH], slope[BST_PROFILE_LENGTH], curvature[BST_PROFILE_LENGTH];
    for (int phase = 0; phase <= BST_PROFILE_PHASES; phase++) {
        double centre = (double)phase / BST_PROFILE_PHASES - 0.5 + p->half;
        bst_imgproc_gauss_profile(psf, centre, sigma_px, p->length, share, slope, curvature);
        float *row = p->rows + BST_LANES + (size_t)phase * PARTS * (size_t)p->pitch;
        memset(row, 0, PARTS * (size_t)p->pitch * sizeof *row);
        for (int i = 0; i < p->length; i++) {
            row[i] = (float)share[i];
            row[p->pitch + i] = (float)slope[i];
            row[2 * p->pitch + i] = (float)(0.5 * curvature[i]);
        }
    }
}

size_t bst_source_profile_scratch(int max_side) {
    size_t side = (size_t)bst_simd_layout_round_up(max_side);
    return 2 * BST_PSF_MAX_NODES * PARTS * side;
}

/* Range of path nodes that affect a row or a block of columns of a stamp. */
typedef struct range {
    short first, end;
} range;

/* Extends a range of nodes. */
static inline void widen(range *r, int first, int end, int node) {
    for (int i = first; i < end; i++) {
        r[i].first = r[i].first < node ? r[i].first : (short)node;
        r[i].end = (short)(node + 1);
    }
}

/* Path of a source discretised on a stamp. */
typedef struct layout {
    int stride, rows, used; /* rows: in lanes; used: nodes that affect the stamp */
    const float *across, *down;
    range column[SIDE / BST_LANES], row[SIDE];
    float node[BST_PSF_MAX_NODES], bow[BST_PSF_MAX_NODES];
} layout;

/* Nodes that affect row j and column block b. */
static inline range reaching(const layout *l, int j, int b) {
    range r = l->row[j], c = l->column[b];
    return (range){r.first > c.first ? r.first : c.first, r.end < c.end ? r.end : c.end};
}

#define BST_SIMD_KERNELS "imgproc/measure/source_profile_kernels.inc"
#include "sim/core/simd_each.inc"

void bst_source_profile_render(const bst_source_profiles *t, const bst_imgproc_gauss *psf,
                               const bst_imgproc_shape *shape, const bst_imgproc_stamp *stamp,
                               float *scratch, float *planes) {
    if (t->known) {
        bst_source_profile_render_known(t, psf, shape, stamp, NULL, scratch, planes);
        return;
    }
    BST_SIMD_PICK(render)(t, psf, shape, stamp, scratch, planes);
}

void bst_source_profile_render_motion(const bst_source_profiles *t, const bst_imgproc_gauss *psf,
                                      const bst_imgproc_shape *shape,
                                      const bst_imgproc_stamp *stamp, const double along[2],
                                      float *scratch, float *planes) {
    if (t->known) {
        bst_source_profile_render_known(t, psf, shape, stamp, along, scratch, planes);
        return;
    }
    BST_SIMD_PICK(render_motion)(t, psf, shape, stamp, along, scratch, planes);
}
