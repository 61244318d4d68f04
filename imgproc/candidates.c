#include "imgproc/candidates.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "imgproc/heapsort.h"

static const float SADDLE_SIGMA = 3.0f, SADDLE_SHARE = 0.15f;

bst_status bst_candidates_create(bst_ctx *ctx, int max_width, int max_height, bst_candidates *out) {
    size_t pixels = (size_t)max_width * (size_t)max_height;
    /* maxima of an 8-connected neighbourhood cannot be denser than one in four */
    *out = (bst_candidates){.capacity = ((max_width + 1) / 2) * ((max_height + 1) / 2)};
    out->owner = calloc(pixels, sizeof *out->owner);
    out->hit = calloc(pixels, sizeof *out->hit);
    out->hit_swap = calloc(pixels, sizeof *out->hit_swap);
    out->key = calloc(pixels, sizeof *out->key);
    out->key_swap = calloc(pixels, sizeof *out->key_swap);
    out->items = calloc((size_t)out->capacity, sizeof *out->items);
    out->order = calloc((size_t)out->capacity, sizeof *out->order);
    out->parent = calloc((size_t)out->capacity, sizeof *out->parent);
    if (!out->owner || !out->hit || !out->hit_swap || !out->key || !out->key_swap || !out->items ||
        !out->order || !out->parent) {
        bst_candidates_free(out);
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the candidates of a %d x %d frame",
                        max_width, max_height);
    }
    return BST_OK;
}

void bst_candidates_free(bst_candidates *c) {
    free(c->owner);
    free(c->hit);
    free(c->hit_swap);
    free(c->key);
    free(c->key_swap);
    free(c->items);
    free(c->order);
    free(c->parent);
    *c = (bst_candidates){0};
}

static bool brighter_candidate(const bst_candidate *a, const bst_candidate *b) {
    if (a->snr != b->snr) {
        return a->snr > b->snr;
    }
    return a->y != b->y ? a->y < b->y : a->x < b->x;
}

static int32_t root_of(bst_candidates *c, int32_t i) {
    while (c->parent[i] != i) {
        c->parent[i] = c->parent[c->parent[i]];
        i = c->parent[i];
    }
    return i;
}

/* Hits by falling SNR, then rising pixel number: a stable radix sort. The bits of positive floats
 * sort as the floats do. */
static int sorted_hits(bst_candidates *c, const bst_filter *f) {
    enum { BITS = 11, BINS = 1 << BITS, PASSES = 3 };
    int count = 0, bins[PASSES][BINS] = {{0}};
    for (int y = 0; y < f->height; y++) {
        size_t at = (size_t)y * (size_t)f->max_width;
        for (int h = 0; h < f->hits[y]; h++) {
            uint32_t bits;
            memcpy(&bits, &f->hit_snr[at + (size_t)h], sizeof bits);
            bits = ~bits;
            c->key[count] = bits;
            c->hit[count++] = y * f->width + f->hit_x[at + (size_t)h];
            for (int pass = 0; pass < PASSES; pass++) {
                bins[pass][bits >> (pass * BITS) & (BINS - 1)]++;
            }
        }
    }
    for (int pass = 0; pass < PASSES; pass++) {
        int sum = 0;
        for (int b = 0; b < BINS; b++) {
            int n = bins[pass][b];
            bins[pass][b] = sum;
            sum += n;
        }
        for (int i = 0; i < count; i++) {
            int to = bins[pass][c->key[i] >> (pass * BITS) & (BINS - 1)]++;
            c->key_swap[to] = c->key[i];
            c->hit_swap[to] = c->hit[i];
        }
        uint32_t *key = c->key;
        int *hit = c->hit;
        c->key = c->key_swap;
        c->hit = c->hit_swap;
        c->key_swap = key;
        c->hit_swap = hit;
    }
    return count;
}

/* Joins two candidates that meet at a pixel of this value; returns the brighter. */
static int32_t meet(bst_candidates *c, int32_t a, int32_t b, float value) {
    int32_t high = a, low = b;
    if (brighter_candidate(&c->items[low], &c->items[high])) {
        high = b;
        low = a;
    }
    float peak = c->items[low].snr;
    if (peak - value < fmaxf(SADDLE_SIGMA, SADDLE_SHARE * peak)) {
        c->parent[low] = high;
        c->items[high].pixels += c->items[low].pixels;
    }
    return high;
}

/* Takes the pixel in: to its neighbours' owner, or as a new maximum. */
static void flood(bst_candidates *c, const bst_filter *f, int p, float value, bool counts) {
    int width = f->width, x = p % width, y = p / width;
    int left = x > 0 ? -1 : 0, right = x + 1 < width ? 1 : 0;
    int32_t owner = -1;
    for (int dy = y > 0 ? -1 : 0; dy <= (y + 1 < f->height ? 1 : 0); dy++) {
        const int32_t *row = c->owner + p + dy * width;
        for (int dx = left; dx <= right; dx++) {
            if (row[dx] == 0) {
                continue;
            }
            int32_t other = root_of(c, row[dx] - 1);
            owner = owner < 0 || owner == other || !counts ? other
                                                          : meet(c, owner, other, value);
        }
    }
    if (owner < 0) {
        owner = c->count++;
        c->items[owner] = (bst_candidate){x, y, value, 0};
        c->parent[owner] = owner;
    }
    c->items[owner].pixels += counts;
    c->owner[p] = owner + 1;
}

static bool before_candidate(const void *context, int a, int b) {
    const bst_candidate *items = context;
    return brighter_candidate(&items[a], &items[b]);
}

void bst_candidates_find(bst_candidates *c, const bst_filter *f, float threshold, float certain,
                         bst_candidate_fn accept, const void *user) {
    c->count = 0;
    int hits = sorted_hits(c, f);
    for (int i = 0; i < hits; i++) {
        uint32_t bits = ~c->key[i];
        float value;
        memcpy(&value, &bits, sizeof value);
        flood(c, f, c->hit[i], value, value > threshold);
    }
    for (int i = 0; i < hits; i++) {
        c->owner[c->hit[i]] = 0;
    }
    /* keep the roots */
    int kept = 0;
    for (int i = 0; i < c->count; i++) {
        if (c->parent[i] == i && (c->items[i].snr > certain || accept(user, &c->items[i]))) {
            c->items[kept++] = c->items[i];
        }
    }
    c->count = kept;
    for (int i = 0; i < c->count; i++) {
        c->order[i] = i;
    }
    bst_heapsort_indices(c->order, c->count, before_candidate, c->items);
}
