#include "imgproc/identify/star_patterns.h"

#include <assert.h>
#include <stdlib.h>
#include <string.h>

#include "imgproc/identify/sky_cells.h"
#include "sim/core/pages.h"

/* Greatest number of neighbours of a star: the ordinals of three fit a pattern's 12 bits. */
enum { MOST_NEIGHBOURS = 8, ENTRIES_PER_CELL = 8 };
/* Stars within NEAR_NEIGHBOURS of one in a crowded place, and its neighbours. */
enum { CROWDED = 8, CROWDED_NEIGHBOURS = 6 };

/* A star is kept if fewer than KEPT_WITHIN brighter kept ones lie within KEPT_RADIUS fields: 12 a
 * square field on average. */
enum { KEPT_WITHIN = 8 };
static const double KEPT_RADIUS = 0.45;
/* Nearest and furthest neighbours of a quad, fields. */
static const double LEAST_SEPARATION = 0.01, NEAR_NEIGHBOURS = 0.5, FAR_NEIGHBOURS = 1.0;
/* Catalogue stars per field that suffice, on average over the sky: four times those kept, because
 * the galactic poles have a third of the mean density. */
static const double WANTED_PER_FIELD = 48.0;
/* Patterns that the number of neighbours is chosen for: 16 bytes each. Three of five quads of a
 * star are another star's too. */
static const double WANTED_PATTERNS = 1e7, OWN_SHARE = 0.4;
static const double FAINTEST_V = 20.0, BRIGHTEST_V = 2.0, V_STEP = 0.5;
/* Ranges of the code's numbers: |C| and |C - 1| are at most 1. */
static const double MOST_IM = 0.87;
static const double LEAST_LOG_SIZE = -12.0, LOG_SIZE_RANGE = 13.0;

typedef struct pattern {
    uint16_t code[4];  /* -1 to 1 */
    uint16_t log_size; /* LEAST_LOG_SIZE and LOG_SIZE_RANGE above it */
    uint16_t ordinals; /* of three neighbours of the star, four bits each */
    uint32_t star;
} pattern;

struct bst_star_patterns {
    int count, neighbours; /* neighbours of a star outside crowded places */
    float (*place)[3];     /* [count] unit vectors */
    uint32_t *near;        /* [count][MOST_NEIGHBOURS], nearest first; UINT32_MAX: none */
    int re_cells, im_cells;
    int64_t cells, pattern_count;
    uint32_t *first;   /* [cells + 1] first pattern of each cell */
    pattern *patterns; /* in order of their cells */
    double depth_v_mag, stars_per_sr;
};

static bst_vec3 place_of(const bst_star_patterns *p, uint32_t star) {
    const float *v = p->place[star]; /* accurate to 0.01 arcsec, of unit length to 1e-7 */
    return (bst_vec3){(double)v[0], (double)v[1], (double)v[2]};
}

/* ---- cells of the code space ---- */

static uint16_t code_word(double v) {
    double w = (v + 1.0) * 0.5 * 65535.0;
    return (uint16_t)(w <= 0.0 ? 0.0 : w >= 65535.0 ? 65535.0 : w + 0.5);
}
static uint16_t size_word(double size_rad) {
    double w = (log(size_rad) - LEAST_LOG_SIZE) / LOG_SIZE_RANGE * 65535.0;
    return (uint16_t)(w <= 0.0 ? 0.0 : w >= 65535.0 ? 65535.0 : w + 0.5);
}

/* Cell of a number of the code; even ones are real parts. */
static int cell_of(const bst_star_patterns *p, int number, double v) {
    int cells = number % 2 ? p->im_cells : p->re_cells;
    double share = number % 2 ? (v + MOST_IM) / (2.0 * MOST_IM) : v;
    int cell = (int)floor(share * cells);
    return cell < 0 ? 0 : cell >= cells ? cells - 1 : cell;
}
static int64_t index_of(const bst_star_patterns *p, const int cell[4]) {
    return (((int64_t)cell[0] * p->im_cells + cell[1]) * p->re_cells + cell[2]) * p->im_cells +
           cell[3];
}

/* Chooses cells that hold ENTRIES_PER_CELL patterns each: half of the box is never used. */
static bst_status open_cells(bst_ctx *ctx, bst_star_patterns *p) {
    double wanted = fmax((double)p->pattern_count / ENTRIES_PER_CELL, 16.0);
    double side = pow(wanted / (4.0 * MOST_IM * MOST_IM), 0.25);
    p->re_cells = (int)ceil(side);
    p->im_cells = (int)ceil(2.0 * MOST_IM * side);
    p->cells = (int64_t)p->re_cells * p->re_cells * p->im_cells * p->im_cells;
    p->first = bst_pages_zero((size_t)p->cells + 2, sizeof *p->first);
    return p->first ? BST_OK : bst_fail(ctx, BST_ERR_MEMORY, "no memory for star patterns");
}

/* ---- the kept stars and their neighbours ---- */

/* Orders stars by brightness, ties by identity and place in the catalogue: counting sort over
 * hundredths of a magnitude would leave ties, qsort of a total order does not. */
static int brighter_first(const void *a, const void *b) {
    const bst_star *s = a, *t = b;
    if (s->v_mag != t->v_mag) {
        return s->v_mag < t->v_mag ? -1 : 1;
    }
    if (s->id != t->id) {
        return s->id < t->id ? -1 : 1;
    }
    return s->icrs.x < t->icrs.x ? -1 : s->icrs.x > t->icrs.x;
}

/* V down to which the catalogue has the wanted number of stars, and that number. */
static bst_status choose_depth(bst_ctx *ctx, const bst_stars *stars,
                               const bst_star_patterns_options *o, double *depth, int *count) {
    const double wanted = WANTED_PER_FIELD * 4.0 * BST_PI / (o->field_rad * o->field_rad);
    double limit = fmin(o->v_limit, FAINTEST_V);
    for (double v = BRIGHTEST_V;; v += V_STEP) {
        *depth = fmin(v, limit);
        BST_TRY(bst_stars_query(ctx, stars, (bst_vec3){0, 0, 1}, BST_PI, *depth, o->julian_year,
                                NULL, 0, count));
        if (*count >= wanted || v >= limit) {
            return BST_OK;
        }
    }
}

static bst_status read_stars(bst_ctx *ctx, const bst_stars *stars,
                             const bst_star_patterns_options *o, bst_star_patterns *p,
                             bst_star **out, int *count) {
    BST_TRY(choose_depth(ctx, stars, o, &p->depth_v_mag, count));
    *out = bst_pages_zero((size_t)*count + 1, sizeof **out);
    if (!*out) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for %d catalogue stars", *count);
    }
    int capacity = *count;
    BST_TRY(bst_stars_query(ctx, stars, (bst_vec3){0, 0, 1}, BST_PI, p->depth_v_mag, o->julian_year,
                            *out, capacity, count));
    *count = *count < capacity ? *count : capacity;
    p->stars_per_sr = *count / (4.0 * BST_PI);
    qsort(*out, (size_t)*count, sizeof **out, brighter_first);
    return BST_OK;
}

/* Keeps the locally brightest stars. */
static bst_status keep_stars(bst_ctx *ctx, bst_star_patterns *p, bst_sky_cells *sky,
                             const bst_star *stars, int count, double radius_rad) {
    for (int i = 0; i < count; i++) {
        if (bst_sky_cells_near(sky, stars[i].icrs, radius_rad, KEPT_WITHIN, NULL) < KEPT_WITHIN) {
            bst_sky_cells_add(sky, stars[i].icrs);
        }
    }
    BST_TRY(bst_sky_cells_sort(ctx, sky));
    p->count = sky->count;
    p->place = sky->place; /* of `sky` until bst_star_patterns_create has closed it */
    return BST_OK;
}

/* Lists the nearest of the stars found about a star, nearest first; returns their number. */
static int nearest_of(const bst_star_patterns *p, uint32_t star, double least_rad,
                      const uint32_t *found, int found_count, uint32_t *out) {
    double chord2[MOST_NEIGHBOURS];
    bst_vec3 v = place_of(p, star);
    int count = 0;
    for (int i = 0; i < found_count; i++) {
        bst_vec3 d = bst_vec3_sub(place_of(p, found[i]), v);
        double d2 = bst_vec3_dot(d, d);
        if (d2 < least_rad * least_rad) {
            continue;
        }
        int at = count;
        while (at > 0 && chord2[at - 1] > d2) {
            at--;
        }
        if (at >= MOST_NEIGHBOURS) {
            continue;
        }
        int last = count < MOST_NEIGHBOURS ? count++ : MOST_NEIGHBOURS - 1;
        memmove(chord2 + at + 1, chord2 + at, (size_t)(last - at) * sizeof *chord2);
        memmove(out + at + 1, out + at, (size_t)(last - at) * sizeof *out);
        chord2[at] = d2;
        out[at] = found[i];
    }
    return count;
}

static void find_neighbours(bst_star_patterns *p, const bst_sky_cells *sky, double field_rad) {
    enum { ROOM = 512 };
    uint32_t found[ROOM];
    for (uint32_t i = 0; i < (uint32_t)p->count; i++) {
        uint32_t *out = &p->near[(size_t)i * MOST_NEIGHBOURS];
        bst_vec3 v = place_of(p, i);
        int all = bst_sky_cells_near(sky, v, NEAR_NEIGHBOURS * field_rad, ROOM, found);
        int most = all - 1 >= CROWDED && p->neighbours > CROWDED_NEIGHBOURS ? CROWDED_NEIGHBOURS
                                                                            : p->neighbours;
        if (all - 1 < most) {
            all = bst_sky_cells_near(sky, v, FAR_NEIGHBOURS * field_rad, ROOM, found);
        }
        int count = nearest_of(p, i, LEAST_SEPARATION * field_rad, found, all, out);
        for (int k = count < most ? count : most; k < MOST_NEIGHBOURS; k++) {
            out[k] = UINT32_MAX;
        }
    }
}

/* ---- the patterns ---- */

/* True if `star` has the three others among its neighbours. */
static bool has_neighbours(const bst_star_patterns *p, uint32_t star, const uint32_t others[3]) {
    const uint32_t *near = &p->near[(size_t)star * MOST_NEIGHBOURS];
    int found = 0;
    for (int i = 0; i < MOST_NEIGHBOURS; i++) {
        found += near[i] == others[0] || near[i] == others[1] || near[i] == others[2];
    }
    return found == 3;
}

/* Makes the quad of a star and three of its neighbours. False: another star has the same quad, and
 * comes first, or it is degenerate. */
static bool make_quad(const bst_star_patterns *p, uint32_t star, const int ordinal[3],
                      bst_star_quad *quad) {
    const uint32_t *near = &p->near[(size_t)star * MOST_NEIGHBOURS];
    uint32_t s[4] = {star, near[ordinal[0]], near[ordinal[1]], near[ordinal[2]]};
    bst_vec3 v[4];
    for (int i = 0; i < 4; i++) {
        if (s[i] == UINT32_MAX) {
            return false;
        }
    }
    for (int i = 1; i < 4; i++) {
        const uint32_t others[3] = {star, s[i == 1 ? 2 : 1], s[i == 3 ? 2 : 3]};
        if (s[i] < star && has_neighbours(p, s[i], others)) {
            return false;
        }
    }
    for (int i = 0; i < 4; i++) {
        v[i] = place_of(p, s[i]);
    }
    return bst_star_quad_make(v, quad);
}

/* Appends a pattern to the unsorted list. */
static bst_status append(bst_ctx *ctx, bst_star_patterns *p, int64_t *room, const pattern *item) {
    if (p->pattern_count == *room) {
        *room = *room < 4096 ? 4096 : *room + *room / 2;
        pattern *more = realloc(p->patterns, (size_t)*room * sizeof *more);
        if (!more) {
            return bst_fail(ctx, BST_ERR_MEMORY, "no memory for %lld star patterns",
                            (long long)*room);
        }
        p->patterns = more;
    }
    p->patterns[p->pattern_count++] = *item;
    return BST_OK;
}

/* Lists the patterns of a star. */
static bst_status list_patterns(bst_ctx *ctx, bst_star_patterns *p, int64_t *room, uint32_t star) {
    for (int a = 0; a < MOST_NEIGHBOURS; a++) {
        for (int b = a + 1; b < MOST_NEIGHBOURS; b++) {
            for (int c = b + 1; c < MOST_NEIGHBOURS; c++) {
                bst_star_quad quad;
                if (!make_quad(p, star, (const int[3]){a, b, c}, &quad)) {
                    continue;
                }
                pattern item = {.log_size = size_word(quad.size_rad),
                                .ordinals = (uint16_t)(a | b << 4 | c << 8),
                                .star = star};
                for (int i = 0; i < 4; i++) {
                    item.code[i] = code_word(quad.code[i]);
                }
                BST_TRY(append(ctx, p, room, &item));
            }
        }
    }
    return BST_OK;
}

/* Cell of a pattern, by its rounded code. */
static int64_t cell_of_pattern(const bst_star_patterns *p, const pattern *item) {
    int cell[4];
    for (int i = 0; i < 4; i++) {
        cell[i] = cell_of(p, i, item->code[i] / 65535.0 * 2.0 - 1.0);
    }
    return index_of(p, cell);
}

/* Makes all patterns and sorts them by cell (counting sort). */
static bst_status make_patterns(bst_ctx *ctx, bst_star_patterns *p) {
    int64_t room = 0;
    for (uint32_t star = 0; star < (uint32_t)p->count; star++) {
        BST_TRY(list_patterns(ctx, p, &room, star));
    }
    BST_TRY(open_cells(ctx, p));
    pattern *sorted = malloc(((size_t)p->pattern_count + 1) * sizeof *sorted);
    if (!sorted) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for %lld star patterns",
                        (long long)p->pattern_count);
    }
    for (int64_t i = 0; i < p->pattern_count; i++) {
        p->first[cell_of_pattern(p, &p->patterns[i]) + 1]++;
    }
    /* numbers per cell, at cell + 1, become first places, which the filling moves on by one cell */
    uint32_t before = 0;
    for (int64_t cell = 0; cell < p->cells; cell++) {
        uint32_t here = p->first[cell + 1];
        p->first[cell + 1] = before;
        before += here;
    }
    for (int64_t i = 0; i < p->pattern_count; i++) {
        sorted[p->first[cell_of_pattern(p, &p->patterns[i]) + 1]++] = p->patterns[i];
    }
    free(p->patterns);
    p->patterns = sorted;
    return BST_OK;
}

/* Greatest number of neighbours for the wanted number of patterns. */
static int choose_neighbours(int stars) {
    for (int m = MOST_NEIGHBOURS; m > 4; m--) {
        if ((double)stars * (m * (m - 1) * (m - 2) / 6) * OWN_SHARE <= WANTED_PATTERNS) {
            return m;
        }
    }
    return 4;
}

static bst_status build(bst_ctx *ctx, const bst_stars *stars, const bst_star_patterns_options *o,
                        bst_star_patterns *p, bst_star **all, bst_sky_cells *sky) {
    int count;
    BST_TRY(read_stars(ctx, stars, o, p, all, &count));
    double radius = KEPT_RADIUS * o->field_rad;
    BST_TRY(bst_sky_cells_open(ctx, sky, radius, count));
    BST_TRY(keep_stars(ctx, p, sky, *all, count, radius));
    p->near = bst_pages_zero((size_t)p->count + 1, MOST_NEIGHBOURS * sizeof *p->near);
    if (!p->near) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for star patterns");
    }
    p->neighbours = choose_neighbours(p->count);
    find_neighbours(p, sky, o->field_rad);
    return make_patterns(ctx, p);
}

bst_status bst_star_patterns_create(bst_ctx *ctx, const bst_stars *stars,
                                    const bst_star_patterns_options *options,
                                    bst_star_patterns **out) {
    assert(stars && options && out);
    *out = NULL;
    if (!(options->field_rad >= 0.003 && options->field_rad <= 0.8)) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "star patterns: a field of %g deg; identification without an attitude "
                        "needs 0.2 to 45 deg",
                        options->field_rad / BST_DEG_RAD);
    }
    bst_star_patterns *p = calloc(1, sizeof *p);
    if (!p) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for star patterns");
    }
    bst_star *all = NULL;
    bst_sky_cells sky = {0};
    bst_status status = build(ctx, stars, options, p, &all, &sky);
    bst_pages_free(all);
    sky.place = p->place ? NULL : sky.place;
    bst_sky_cells_close(&sky);
    if (status != BST_OK) {
        bst_star_patterns_free(p);
        return status;
    }
    *out = p;
    return BST_OK;
}

void bst_star_patterns_free(bst_star_patterns *p) {
    if (!p) {
        return;
    }
    bst_pages_free(p->place);
    bst_pages_free(p->near);
    bst_pages_free(p->first);
    free(p->patterns);
    free(p);
}

void bst_star_patterns_get_info(const bst_star_patterns *p, bst_star_patterns_info *out) {
    *out = (bst_star_patterns_info){
        .stars = p->count,
        .patterns = p->pattern_count,
        .depth_v_mag = p->depth_v_mag,
        .stars_per_sr = p->stars_per_sr,
        .bytes = (int64_t)sizeof *p + p->count * (int64_t)sizeof *p->place +
                 (int64_t)p->count * MOST_NEIGHBOURS * (int64_t)sizeof *p->near +
                 p->cells * (int64_t)sizeof *p->first +
                 p->pattern_count * (int64_t)sizeof *p->patterns};
}

/* Directions of a pattern's stars in the order A, B, C, D. */
static bool pattern_stars(const bst_star_patterns *p, const pattern *e, bst_vec3 out[4],
                          double *size_rad) {
    const uint32_t *near = &p->near[(size_t)e->star * MOST_NEIGHBOURS];
    bst_vec3 v[4] = {place_of(p, e->star), place_of(p, near[e->ordinals & 15]),
                     place_of(p, near[e->ordinals >> 4 & 15]),
                     place_of(p, near[e->ordinals >> 8 & 15])};
    bst_star_quad quad;
    if (!bst_star_quad_make(v, &quad)) {
        return false;
    }
    for (int i = 0; i < 4; i++) {
        out[i] = v[quad.order[i]];
    }
    *size_rad = quad.size_rad;
    return true;
}

/* Numbers of a code and a size, and how far a pattern's may be from them. */
typedef struct window {
    int code[4], code_within;
    int log_size, size_within;
} window;

static bool agrees(const pattern *e, const window *w) {
    if (abs(e->log_size - w->log_size) > w->size_within) {
        return false;
    }
    for (int i = 0; i < 4; i++) {
        if (abs(e->code[i] - w->code[i]) > w->code_within) {
            return false;
        }
    }
    return true;
}

int bst_star_patterns_find(const bst_star_patterns *p, const bst_star_quad *quad, double tolerance,
                           double scale_tolerance, bst_star_patterns_match *out, int capacity) {
    int low[4], high[4], found = 0;
    window w = {
        .code_within = (int)ceil(tolerance * 0.5 * 65535.0),
        .log_size = size_word(quad->size_rad),
        .size_within = (int)ceil((tolerance - log1p(-scale_tolerance)) / LOG_SIZE_RANGE * 65535.0)};
    for (int i = 0; i < 4; i++) {
        low[i] = cell_of(p, i, quad->code[i] - tolerance);
        high[i] = cell_of(p, i, quad->code[i] + tolerance);
        w.code[i] = code_word(quad->code[i]);
    }
    int c[4];
    for (c[0] = low[0]; c[0] <= high[0]; c[0]++) {
        for (c[1] = low[1]; c[1] <= high[1]; c[1]++) {
            for (c[2] = low[2]; c[2] <= high[2]; c[2]++) {
                c[3] = low[3];
                int64_t cell = index_of(p, c);
                uint32_t end = p->first[cell + high[3] - low[3] + 1];
                for (uint32_t k = p->first[cell]; k < end; k++) {
                    double size;
                    if (!agrees(&p->patterns[k], &w) ||
                        (found < capacity &&
                         !pattern_stars(p, &p->patterns[k], out[found].icrs, &size))) {
                        continue;
                    }
                    if (found < capacity) {
                        out[found].size_ratio = size / quad->size_rad;
                    }
                    found++;
                }
            }
        }
    }
    return found;
}
