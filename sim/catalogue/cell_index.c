#include "sim/catalogue/cell_index.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>

enum { BRANCHES = BST_CELL_BRANCHES, TOP = BST_CELL_LEVELS - 1 };

/* Single precision: three differences of up to 2 with an error of 1.2e-7 each, and their root */
static const float ROUNDING = 2e-6F;

/* A centre from which no cone is reached. */
static const float NOWHERE = 1e15F;

/* In which the slowest star that a record can hold goes around the sky; squares of what the fastest
 * one moves are finite, and less than NOWHERE's. */
static const double MOST_YEARS = 1e13;

static void set_empty(bst_cell_block *block, uint32_t i) {
    block->x[i] = NOWHERE;
    block->y[i] = block->z[i] = block->radius[i] = block->motion[i] = 0.0F;
    block->brightest[i] = INT32_MAX;
}

/* Cap i of a block around the caps of a block of the level below. */
static void enclose(const bst_cell_block *below, bst_cell_block *block, uint32_t i) {
    double centre[3] = {0.0, 0.0, 0.0}, radius = 0.0;
    int filled = 0;
    for (uint32_t c = 0; c < BRANCHES; c++) {
        if (below->x[c] < NOWHERE) {
            centre[0] += (double)below->x[c];
            centre[1] += (double)below->y[c];
            centre[2] += (double)below->z[c];
            filled++;
        }
    }
    set_empty(block, i);
    if (filled == 0) {
        return;
    }
    block->x[i] = (float)(centre[0] / filled);
    block->y[i] = (float)(centre[1] / filled);
    block->z[i] = (float)(centre[2] / filled);
    for (uint32_t c = 0; c < BRANCHES; c++) {
        if (below->x[c] < NOWHERE) {
            double dx = (double)below->x[c] - (double)block->x[i],
                   dy = (double)below->y[c] - (double)block->y[i],
                   dz = (double)below->z[c] - (double)block->z[i];
            radius = fmax(radius, sqrt(dx * dx + dy * dy + dz * dz) + (double)below->radius[c]);
            block->motion[i] = fmaxf(block->motion[i], below->motion[c]);
            block->brightest[i] = below->brightest[c] < block->brightest[i] ? below->brightest[c]
                                                                            : block->brightest[i];
        }
    }
    block->radius[i] = (float)radius * (1.0F + 1e-6F);
}

bst_status bst_cell_index_create(bst_ctx *ctx, const bst_star_view *view, bst_cell_index **out) {
    bst_cell_index *index = calloc(1, sizeof *index);
    size_t blocks = 0;
    uint32_t count = view->header->cell_count;
    for (int k = 0; index && k < BST_CELL_LEVELS; k++) {
        count = (count + BRANCHES - 1) / BRANCHES;
        index->blocks[k] = count;
        blocks += count;
    }
    bst_cell_block *block = index ? aligned_alloc(64, blocks * sizeof *block) : NULL;
    if (!block) {
        free(index);
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the star catalogue");
    }
    for (int k = 0; k < BST_CELL_LEVELS; k++) {
        index->level[k] = block;
        block += index->blocks[k];
    }
    for (uint32_t c = 0; c < index->blocks[0] * BRANCHES; c++) {
        bst_cell_block *to = &index->level[0][c / BRANCHES];
        const uint32_t i = c % BRANCHES;
        set_empty(to, i);
        if (c < view->header->cell_count && view->cells[c].count > 0) {
            const bst_star_cell *cell = &view->cells[c];
            to->x[i] = cell->centre[0];
            to->y[i] = cell->centre[1];
            to->z[i] = cell->centre[2];
            to->radius[i] = cell->radius_rad;
            to->motion[i] = cell->pm_max_radpyr;
            to->brightest[i] = bst_star_record_v(&view->records[cell->first]);
        }
    }
    for (int k = 1; k < BST_CELL_LEVELS; k++) {
        for (uint32_t c = 0; c < index->blocks[k] * BRANCHES; c++) {
            bst_cell_block *to = &index->level[k][c / BRANCHES];
            if (c < index->blocks[k - 1]) {
                enclose(&index->level[k - 1][c], to, c % BRANCHES);
            } else {
                set_empty(to, c % BRANCHES);
            }
        }
    }
    *out = index;
    return BST_OK;
}

void bst_cell_index_free(bst_cell_index *index) {
    if (index) {
        free(index->level[0]);
        free(index);
    }
}

/* Goes to a block of a level; its bits are the caps that the cone reaches. */
static void visit(bst_cell_search *s, int level, uint32_t number) {
    const bst_cell_block *b = &s->index->level[level][number];
    const float cx = s->centre[0], cy = s->centre[1], cz = s->centre[2];
    const float base = s->reach, years = s->years;
    const int32_t faintest = s->faintest;
    int32_t is_hit[BRANCHES];
    for (int i = 0; i < BRANCHES; i++) { /* vectorised: no branch, no call */
        const float dx = b->x[i] - cx, dy = b->y[i] - cy, dz = b->z[i] - cz;
        const float reach = base + b->radius[i] + b->motion[i] * years;
        /* a chord is shorter than its angle: no cap is missed */
        is_hit[i] = (dx * dx + dy * dy + dz * dz <= reach * reach) & (b->brightest[i] <= faintest);
    }
    uint32_t bits = 0;
    for (uint32_t i = 0; i < BRANCHES; i++) {
        bits |= (uint32_t)is_hit[i] << i;
    }
    s->block[level] = number;
    s->hits[level] = bits;
}

void bst_cell_search_begin(const bst_cell_index *index, const bst_cell_cone *cone,
                           bst_cell_search *s) {
    *s = (bst_cell_search){
        .index = index,
        .centre = {(float)cone->centre.x, (float)cone->centre.y, (float)cone->centre.z},
        .reach = (float)cone->radius_rad + ROUNDING,
        .years = (float)fmin(cone->years, MOST_YEARS) * (1.0F + 1e-6F),
        .faintest = cone->faintest};
    visit(s, TOP, 0);
}

/* Number of the lowest bit of bits, which are not 0. */
static uint32_t lowest(uint32_t bits) {
    return (uint32_t)__builtin_ctz(bits);
}

/* Goes down to the next block of cells that the cone reaches; false: there are no more. */
static bool find_cells(bst_cell_search *s) {
    while (s->hits[0] == 0) {
        int k = 1; /* lowest level that has caps to be visited */
        while (k <= TOP && s->hits[k] == 0) {
            k++;
        }
        if (k <= TOP) {
            const uint32_t next = s->block[k] * BRANCHES + lowest(s->hits[k]);
            s->hits[k] &= s->hits[k] - 1;
            visit(s, k - 1, next);
        } else if (s->block[TOP] + 1 < s->index->blocks[TOP]) {
            visit(s, TOP, s->block[TOP] + 1);
        } else {
            return false;
        }
    }
    return true;
}

uint32_t bst_cell_search_next(bst_cell_search *s, uint32_t *cells, uint32_t room) {
    uint32_t count = 0;
    while (count + BRANCHES <= room && find_cells(s)) {
        for (uint32_t bits = s->hits[0]; bits != 0; bits &= bits - 1) {
            cells[count++] = s->block[0] * BRANCHES + lowest(bits);
        }
        s->hits[0] = 0;
    }
    return count;
}
