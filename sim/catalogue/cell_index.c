#include "sim/catalogue/cell_index.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { BRANCHES = BST_CELL_BRANCHES, TOP = BST_CELL_LEVELS - 1 };

/* Single precision: three differences of up to 2 with an error of 1.2e-7 each, and their root */
static const float ROUNDING = 2e-6F;

/* A centre from which no cone is reached. */
static const float NOWHERE = 1e15F;

/* In which the slowest star that a record can hold goes around the sky; squares of what the fastest
 * one moves are finite, and less than NOWHERE's. */
static const double MOST_YEARS = 1e13;

static uint32_t whole_blocks(uint32_t count) {
    return (count + BRANCHES - 1) / BRANCHES * BRANCHES;
}

/* Points the arrays of a level into memory; returns what is behind them. */
static float *place_arrays(bst_cell_caps *caps, float *memory) {
    float **arrays[] = {&caps->x, &caps->y, &caps->z, &caps->radius, &caps->motion};
    for (size_t i = 0; i < sizeof arrays / sizeof *arrays; i++) {
        *arrays[i] = memory;
        memory += caps->count;
    }
    caps->brightest = (int32_t *)(void *)memory;
    return memory + caps->count;
}

static void set_empty(bst_cell_caps *caps, uint32_t i) {
    caps->x[i] = NOWHERE;
    caps->y[i] = caps->z[i] = caps->radius[i] = caps->motion[i] = 0.0F;
    caps->brightest[i] = INT32_MAX;
}

/* Cap i of a level around those of the level below. */
static void enclose(const bst_cell_caps *below, bst_cell_caps *caps, uint32_t i) {
    const uint32_t first = i * BRANCHES, end = first < below->count ? first + BRANCHES : first;
    double centre[3] = {0.0, 0.0, 0.0}, radius = 0.0;
    int filled = 0;
    for (uint32_t c = first; c < end; c++) {
        if (below->x[c] < NOWHERE) {
            centre[0] += (double)below->x[c];
            centre[1] += (double)below->y[c];
            centre[2] += (double)below->z[c];
            filled++;
        }
    }
    set_empty(caps, i);
    if (filled == 0) {
        return;
    }
    caps->x[i] = (float)(centre[0] / filled);
    caps->y[i] = (float)(centre[1] / filled);
    caps->z[i] = (float)(centre[2] / filled);
    for (uint32_t c = first; c < end; c++) {
        if (below->x[c] < NOWHERE) {
            double dx = (double)below->x[c] - (double)caps->x[i],
                   dy = (double)below->y[c] - (double)caps->y[i],
                   dz = (double)below->z[c] - (double)caps->z[i];
            radius = fmax(radius, sqrt(dx * dx + dy * dy + dz * dz) + (double)below->radius[c]);
            caps->motion[i] = fmaxf(caps->motion[i], below->motion[c]);
            caps->brightest[i] =
                below->brightest[c] < caps->brightest[i] ? below->brightest[c] : caps->brightest[i];
        }
    }
    caps->radius[i] = (float)radius * (1.0F + 1e-6F);
}

bst_status bst_cell_index_create(bst_ctx *ctx, const bst_star_view *view, bst_cell_index **out) {
    bst_cell_index *index = calloc(1, sizeof *index);
    size_t caps = 0;
    uint32_t count = view->header->cell_count;
    for (int k = 0; index && k < BST_CELL_LEVELS; k++) {
        index->level[k].count = whole_blocks(count);
        caps += index->level[k].count;
        count = index->level[k].count / BRANCHES;
    }
    float *memory = index ? malloc(caps * (5 * sizeof(float) + sizeof(int32_t))) : NULL;
    if (!memory) {
        free(index);
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the star catalogue");
    }
    index->memory = memory;
    for (int k = 0; k < BST_CELL_LEVELS; k++) {
        memory = place_arrays(&index->level[k], memory);
    }
    bst_cell_caps *cells = &index->level[0];
    for (uint32_t c = 0; c < cells->count; c++) {
        set_empty(cells, c);
        if (c < view->header->cell_count && view->cells[c].count > 0) {
            const bst_star_cell *cell = &view->cells[c];
            cells->x[c] = cell->centre[0];
            cells->y[c] = cell->centre[1];
            cells->z[c] = cell->centre[2];
            cells->radius[c] = cell->radius_rad;
            cells->motion[c] = cell->pm_max_radpyr;
            cells->brightest[c] = bst_star_record_v(&view->records[cell->first]);
        }
    }
    for (int k = 1; k < BST_CELL_LEVELS; k++) {
        for (uint32_t i = 0; i < index->level[k].count; i++) {
            enclose(&index->level[k - 1], &index->level[k], i);
        }
    }
    *out = index;
    return BST_OK;
}

void bst_cell_index_free(bst_cell_index *index) {
    if (index) {
        free(index->memory);
        free(index);
    }
}

/* Bits of the caps first to first + BRANCHES - 1 that the cone reaches. */
static uint32_t reached(const bst_cell_search *s, const bst_cell_caps *caps, uint32_t first) {
    const float *x = caps->x + first, *y = caps->y + first, *z = caps->z + first;
    const float *radius = caps->radius + first, *motion = caps->motion + first;
    const int32_t *brightest = caps->brightest + first;
    const float cx = s->centre[0], cy = s->centre[1], cz = s->centre[2];
    const float base = s->reach, years = s->years;
    const int32_t faintest = s->faintest;
    int32_t is_hit[BRANCHES];
    for (int i = 0; i < BRANCHES; i++) { /* vectorised: no branch, no call */
        const float dx = x[i] - cx, dy = y[i] - cy, dz = z[i] - cz;
        const float reach = base + radius[i] + motion[i] * years;
        /* a chord is shorter than its angle: no cap is missed */
        is_hit[i] = (dx * dx + dy * dy + dz * dz <= reach * reach) & (brightest[i] <= faintest);
    }
    uint32_t bits = 0;
    for (uint32_t i = 0; i < BRANCHES; i++) {
        bits |= (uint32_t)is_hit[i] << i;
    }
    return bits;
}

void bst_cell_search_begin(const bst_cell_index *index, const bst_cell_cone *cone,
                           bst_cell_search *s) {
    *s = (bst_cell_search){
        .index = index,
        .centre = {(float)cone->centre.x, (float)cone->centre.y, (float)cone->centre.z},
        .reach = (float)cone->radius_rad + ROUNDING,
        .years = (float)fmin(cone->years, MOST_YEARS) * (1.0F + 1e-6F),
        .faintest = cone->faintest};
    s->hits[TOP] = reached(s, &index->level[TOP], 0);
}

/* Number of the lowest bit of bits, which are not 0. */
static uint32_t lowest(uint32_t bits) {
    return (uint32_t)__builtin_ctz(bits);
}

/* Goes down to the next block of cells that the cone reaches; false: there are no more. */
static bool find_cells(bst_cell_search *s) {
    const bst_cell_index *index = s->index;
    while (s->hits[0] == 0) {
        int k = 1; /* lowest level that has caps to be visited */
        while (k <= TOP && s->hits[k] == 0) {
            k++;
        }
        if (k > TOP) {
            s->first[TOP] += BRANCHES;
            if (s->first[TOP] >= index->level[TOP].count) {
                s->first[TOP] -= BRANCHES; /* stays at the end */
                return false;
            }
            s->hits[TOP] = reached(s, &index->level[TOP], s->first[TOP]);
            continue;
        }
        s->first[k - 1] = (s->first[k] + lowest(s->hits[k])) * BRANCHES;
        s->hits[k] &= s->hits[k] - 1;
        s->hits[k - 1] = reached(s, &index->level[k - 1], s->first[k - 1]);
    }
    return true;
}

uint32_t bst_cell_search_next(bst_cell_search *s, uint32_t *cells, uint32_t room) {
    uint32_t count = 0;
    while (count + BRANCHES <= room && find_cells(s)) {
        for (uint32_t bits = s->hits[0]; bits != 0; bits &= bits - 1) {
            cells[count++] = s->first[0] + lowest(bits);
        }
        s->hits[0] = 0;
    }
    return count;
}
