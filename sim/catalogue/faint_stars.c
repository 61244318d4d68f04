#include "sim/catalogue/faint_stars.h"

#include <stdlib.h>

#include "sim/catalogue/faint_internal.h"

/* Random counters of a cell: stars are drawn at (cell, bin), numbers of stars at (cell, bin +
 * COUNT_DRAW). */
#define CELL_SHIFT 8
#define COUNT_DRAW 128u

#define NO_CELL UINT32_MAX

/* A cache slot with the stars of a cell. */
typedef struct slot {
    uint32_t cell;
    int bins; /* number of magnitude bins in the slot, from the brightest */
    int64_t used;
    bst_star *stars;
    int count, capacity;
} slot;

struct bst_faint_stars {
    const bst_faint_sky *sky;
    slot *slots;
    int slot_count, slot_capacity;
    int empty_slots;       /* slots without a cell */
    int32_t *slot_of_cell; /* -1: not cached */
    int64_t query;
    int64_t stars_held, stars_limit;
};

bst_status bst_faint_stars_create(bst_ctx *ctx, const bst_faint_sky *sky, int cache_stars,
                                  bst_faint_stars **out) {
    *out = NULL;
    bst_faint_stars *f = calloc(1, sizeof *f);
    uint32_t cells = faint_cells(sky);
    if (f) {
        f->slot_of_cell = malloc(cells * sizeof *f->slot_of_cell);
    }
    if (!f || !f->slot_of_cell) {
        bst_faint_stars_free(f);
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for statistical stars");
    }
    f->sky = sky;
    f->stars_limit = cache_stars;
    for (uint32_t i = 0; i < cells; i++) {
        f->slot_of_cell[i] = -1;
    }
    *out = f;
    return BST_OK;
}

void bst_faint_stars_free(bst_faint_stars *f) {
    if (f) {
        for (int i = 0; i < f->slot_count; i++) {
            free(f->slots[i].stars);
        }
        free(f->slots);
        free(f->slot_of_cell);
        free(f);
    }
}

/* Converts 32 random bits to the open interval (0, 1). */
static double unit(uint32_t word) {
    return ((double)word + 0.5) * (1.0 / 4294967296.0);
}

/* Exact Poisson deviate: sum of deviates with means up to 200, each by inversion. */
static int poisson(bst_rng_key key, uint64_t a, double mean) {
    const double piece = 200.0;
    int total = 0;
    for (uint64_t draw = 0; mean > 0.0; draw++, mean -= piece) {
        double m = fmin(mean, piece), u = bst_rng_uniform(key, a, draw);
        double p = exp(-m), sum = p;
        int n = 0;
        while (u > sum && n < 1000) { /* beyond 1000 the probability is below 1e-300 */
            n++;
            p *= m / n;
            sum += p;
        }
        total += n;
    }
    return total;
}

static bst_status reserve_stars(bst_ctx *ctx, slot *s, int count) {
    if (count > s->capacity) {
        int capacity = count + count / 2 + 64;
        bst_star *more = realloc(s->stars, (size_t)capacity * sizeof *more);
        if (!more) {
            return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for %d statistical stars", count);
        }
        s->stars = more;
        s->capacity = capacity;
    }
    return BST_OK;
}

/* Fraction of a cell's stars to keep per bin, by its zone; NULL near a patch, where each star's
 * position decides. */
static const float *share_of_cell(const bst_faint_sky *sky, const faint_cell *c) {
    for (int i = 0; i < sky->patch_count; i++) {
        const faint_patch *p = &sky->patches[i];
        if (bst_vec3_angle(p->centre, c->centre) <= p->radius_rad + c->radius_rad) {
            return NULL;
        }
    }
    return sky->kept[bst_faint_zone(c->centre)];
}

/* True if a synthetic faint star is kept: fainter than the catalogue's completeness limit. */
static bool is_kept(const bst_faint_sky *sky, const float *share, bst_vec3 icrs, double v,
                    uint32_t word) {
    double complete_to_v = sky->complete_to_v;
    if (!share) {
        int patch = bst_faint_patch(sky, icrs, &complete_to_v);
        share = sky->kept[patch < 0 ? bst_faint_zone(icrs) : FAINT_ZONES + patch];
    }
    int q = (int)((v - BST_COUNT_FIRST_V) * 4.0);
    q = q < FAINT_QUARTERS ? q : FAINT_QUARTERS - 1;
    return v > complete_to_v && unit(word) < (double)share[q];
}

/* Draws the stars of the first `bins` magnitude bins of a cell. */
static bst_status draw_cell(bst_ctx *ctx, const bst_faint_sky *sky, int band, uint32_t cell,
                            int bins, slot *s) {
    faint_cell c = bst_faint_cell(sky, band, cell);
    bst_star_counts counts;
    bst_star_counts_at(c.centre, &counts);
    const float *share = share_of_cell(sky, &c);
    uint32_t room = sky->first_id[cell + 1] - sky->first_id[cell], number = 0;
    double brighter = 0.0;
    s->cell = cell;
    s->bins = bins;
    s->count = 0;
    for (int k = 0; k < bins; k++) {
        uint64_t a = (uint64_t)cell << CELL_SHIFT | (unsigned)k;
        double n = c.area_deg2 * pow(10.0, counts.log_n[k]);
        double growth = pow(10.0, counts.log_n[k + 1] - counts.log_n[k]);
        int drawn = poisson(sky->key, a | COUNT_DRAW, n * (growth - 1.0));
        brighter = BST_COUNT_FIRST_V + k;
        uint32_t first = number;
        number += (uint32_t)drawn;
        if (brighter + 1.0 <= sky->complete_to_v) {
            continue; /* the catalogue contains all of them */
        }
        BST_TRY(reserve_stars(ctx, s, s->count + drawn));
        double per_decade = 1.0 / (counts.log_n[k + 1] - counts.log_n[k]);
        for (uint32_t i = 0; i < (uint32_t)drawn && first + i < room; i++) {
            bst_philox_words w = bst_rng_words(sky->key, a, i);
            double v = brighter + log10(1.0 + unit(w.w[2]) * (growth - 1.0)) * per_decade;
            double ra = c.ra_rad + unit(w.w[0]) * c.width_rad;
            double z = c.sin_dec_min + unit(w.w[1]) * (c.sin_dec_max - c.sin_dec_min);
            double r = sqrt(1.0 - z * z);
            bst_vec3 icrs = {r * cos(ra), r * sin(ra), z};
            if (is_kept(sky, share, icrs, v, w.w[3])) {
                s->stars[s->count++] =
                    (bst_star){.icrs = icrs,
                               .v_mag = (float)v,
                               .b_minus_v = NAN,
                               .id = BST_FAINT_ID_BIT | (sky->first_id[cell] + first + i)};
            }
        }
    }
    return BST_OK;
}

/* An empty cache slot, else a new one; -1: out of memory. */
static int empty_slot(bst_faint_stars *f) {
    for (int i = 0; f->empty_slots > 0 && i < f->slot_count; i++) {
        if (f->slots[i].cell == NO_CELL) {
            return i;
        }
    }
    if (f->slot_count == f->slot_capacity) {
        int capacity = 2 * f->slot_capacity + 64;
        slot *more = realloc(f->slots, (size_t)capacity * sizeof *more);
        if (!more) {
            return -1;
        }
        f->slots = more;
        f->slot_capacity = capacity;
    }
    f->slots[f->slot_count] = (slot){.cell = NO_CELL};
    f->empty_slots++;
    return f->slot_count++;
}

/* Removes the least recently used cells that this query does not need, until the cache is within
 * its limit. The memory of one is reused. */
static void make_room(bst_faint_stars *f) {
    bool keep_memory = true;
    while (f->stars_held >= f->stars_limit) {
        slot *oldest = NULL;
        for (int i = 0; i < f->slot_count; i++) {
            slot *s = &f->slots[i];
            if (s->cell != NO_CELL && s->used < f->query && (!oldest || s->used < oldest->used)) {
                oldest = s;
            }
        }
        if (!oldest) {
            return;
        }
        f->slot_of_cell[oldest->cell] = -1;
        f->stars_held -= oldest->count;
        oldest->cell = NO_CELL;
        f->empty_slots++;
        oldest->bins = oldest->count = 0;
        if (!keep_memory) {
            free(oldest->stars);
            oldest->stars = NULL;
            oldest->capacity = 0;
        }
        keep_memory = false;
    }
}

static bst_status find_slot(bst_ctx *ctx, bst_faint_stars *f, uint32_t cell, slot **out) {
    int index = f->slot_of_cell[cell];
    if (index < 0) {
        make_room(f);
        index = empty_slot(f);
        if (index < 0) {
            return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for statistical stars");
        }
        f->slot_of_cell[cell] = index;
        f->slots[index].cell = cell;
        f->empty_slots--;
    }
    *out = &f->slots[index];
    (*out)->used = f->query;
    return BST_OK;
}

typedef struct cone {
    bst_vec3 centre;
    double radius_rad, chord2, v_limit;
    int bins;
    bst_star *out; /* [capacity] */
    int capacity;
} cone;

/* Returns the synthetic stars of a cell in the cone; draws them at first use. */
static bst_status query_cell(bst_ctx *ctx, bst_faint_stars *f, const cone *q, int band,
                             uint32_t cell, int *found) {
    slot *s = NULL;
    BST_TRY(find_slot(ctx, f, cell, &s));
    if (s->bins < q->bins) {
        f->stars_held -= s->count;
        bst_status status = draw_cell(ctx, f->sky, band, cell, q->bins, s);
        s->bins = status == BST_OK ? s->bins : 0;
        s->count = status == BST_OK ? s->count : 0;
        f->stars_held += s->count;
        BST_TRY(status);
    }
    for (int i = 0; i < s->count; i++) {
        const bst_star *star = &s->stars[i];
        bst_vec3 d = bst_vec3_sub(star->icrs, q->centre);
        if ((double)star->v_mag <= q->v_limit && bst_vec3_dot(d, d) <= q->chord2) {
            if (*found < q->capacity) {
                q->out[*found] = *star;
            }
            ++*found;
        }
    }
    return BST_OK;
}

bst_status bst_faint_stars_query(bst_ctx *ctx, bst_faint_stars *f, bst_vec3 centre,
                                 double radius_rad, double v_limit, bst_star *out, int capacity,
                                 int *count) {
    *count = 0;
    if (!(radius_rad >= 0.0 && radius_rad <= BST_PI) || isnan(v_limit) ||
        !(fabs(bst_vec3_norm(centre) - 1.0) < 1e-6) || capacity < 0 || (!out && capacity > 0)) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "statistical stars: radius %g rad (0 to pi), limit V %g, |centre| %g (1), "
                        "room for %d stars",
                        radius_rad, v_limit, bst_vec3_norm(centre), capacity);
    }
    const bst_faint_sky *sky = f->sky;
    double chord = 2.0 * sin(0.5 * radius_rad);
    cone q = {centre,
              radius_rad,
              radius_rad >= BST_PI - 1e-9 ? 5.0 : chord * chord,
              fmin(v_limit, BST_FAINT_LIMIT_V),
              0,
              out,
              capacity};
    q.bins = (int)fmax(0.0, ceil(q.v_limit - BST_COUNT_FIRST_V));
    if (q.bins == 0) {
        return BST_OK;
    }
    f->query++;
    double ra, dec;
    bst_vec3_to_radec(centre, &ra, &dec);
    double south = fmax(dec - radius_rad + 0.5 * BST_PI, 0.0),
           north = fmin(dec + radius_rad + 0.5 * BST_PI, BST_PI);
    int first_band = (int)(south / FAINT_BAND_RAD), last_band = (int)(north / FAINT_BAND_RAD);
    last_band = last_band < FAINT_BANDS ? last_band : FAINT_BANDS - 1;
    /* half width of the cone in right ascension: sin(dra) = sin(r) / cos(dec) */
    double half = fabs(dec) + radius_rad < 0.5 * BST_PI - 1e-6
                      ? asin(fmin(1.0, sin(radius_rad) / cos(dec)))
                      : BST_PI;
    for (int band = first_band; band <= last_band; band++) {
        int64_t pieces = sky->first_cell[band + 1] - sky->first_cell[band];
        double per_rad = (double)pieces / (2.0 * BST_PI);
        int64_t west = (int64_t)floor((ra - half) * per_rad - 1e-6),
                east = (int64_t)floor((ra + half) * per_rad + 1e-6);
        east = east - west + 1 >= pieces ? west + pieces - 1 : east;
        for (int64_t i = west; i <= east; i++) {
            uint32_t cell = sky->first_cell[band] + (uint32_t)(((i % pieces) + pieces) % pieces);
            faint_cell c = bst_faint_cell(sky, band, cell);
            double reach = radius_rad + c.radius_rad;
            /* a chord is shorter than its angle: no cell is missed */
            bst_vec3 d = bst_vec3_sub(c.centre, centre);
            if (bst_vec3_dot(d, d) <= reach * reach) {
                BST_TRY(query_cell(ctx, f, &q, band, cell, count));
            }
        }
    }
    return BST_OK;
}
