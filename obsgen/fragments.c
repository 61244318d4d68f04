#include "obsgen/fragments.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "obsgen/clutter.h"
#include "sim/core/vec.h"

/* As image processing tells maxima apart. */
static const double SADDLE_SIGMA = 3.0, SADDLE_SHARE = 0.15;
/* What stays further below the threshold is seen as often as noise alone, which has its own draws.
 */
static const double FAINTEST_SIGMA = 4.0;
/* Draws of pixels; those of other clutter stay below. */
static const uint64_t PIXEL_NOISE = (uint64_t)1 << 60;

/* Rows on either side of the way whose output is made, taps of the filter on either side, and rows
 * of noise that is filtered across the way already. */
enum {
    ROWS = 2,
    WIDE = 2 * ROWS + 1,
    MOST_TAPS = 9,
    HALF = ROWS + MOST_TAPS + 1,
    MOST_MAXIMA = 2048,
    NORMALS = 4096,
    LANES = 16,
    MOST_GROUPS = (2 * (HALF + MOST_TAPS) + 8) / 8 + 1 /* of eight pixels across the way */
};

/* One step of a pixel along the way: a column of the frame where the way runs more along the rows,
 * a row otherwise. */
typedef struct section {
    int at, middle;            /* along, and the nearest pixel across */
    float height;              /* of the light */
    float noise[2 * HALF + 1]; /* filtered across */
    float output[WIDE];        /* SNR */
} section;

typedef struct maximum {
    int x, y, section, part; /* part: of the way */
    float value;
    bool dropped;
} maximum;

struct generator_streaks {
    section sections[BST_ROUTE_NODES];
    maximum maxima[MOST_MAXIMA]; /* of one part of the way */
    maximum kept[MOST_MAXIMA];   /* of the whole */
    int kept_count;
    float taps[2 * MOST_TAPS + 1];
    int reach;
    double taps_sigma;
    float normals[NORMALS];
    float light[BST_ROUTE_NODES * WIDE]; /* of the sections' rows, over their height */
};

/* Wider vectors where the processor has them; what comes out is the same. */
#if defined(__x86_64__) && defined(__linux__)
#define LANES_FUNCTION __attribute__((target_clones("default", "avx2", "avx512f")))
#else
#define LANES_FUNCTION
#endif

static void set_taps(struct generator_streaks *w, double sigma) {
    if (w->taps_sigma == sigma) {
        return;
    }
    w->reach = (int)fmin(ceil(3.0 * sigma), MOST_TAPS);
    double square = 0.0;
    for (int pass = 0; pass < 2; pass++) {
        for (int i = -w->reach; i <= w->reach; i++) {
            double tap = exp(-0.5 * i * i / (sigma * sigma));
            square += pass ? 0.0 : tap * tap;
            w->taps[i + w->reach] = (float)(tap / sqrt(square));
        }
    }
    w->taps_sigma = sigma;
}

/* Normal deviates at the middles of equal shares of probability, by bisection, with unit variance.
 */
static void set_normals(float *out) {
    double low = -9.0, square = 0.0;
    for (int i = 0; i < NORMALS; i++) {
        double high = 9.0, p = (i + 0.5) / NORMALS;
        for (int k = 0; k < 40; k++) {
            double z = 0.5 * (low + high);
            *(0.5 * erfc(-z * sqrt(0.5)) < p ? &low : &high) = z;
        }
        out[i] = (float)low;
        square += low * low / NORMALS;
    }
    for (int i = 0; i < NORMALS; i++) {
        out[i] = (float)((double)out[i] / sqrt(square));
    }
}

/* bst_philox4x32 of LANES counters. */
typedef struct lanes {
    uint32_t c0[LANES], c1[LANES], c2[LANES], c3[LANES];
} lanes;

LANES_FUNCTION static void draw_lanes(bst_rng_key key, lanes *l) {
    uint32_t key0 = key.k[0], key1 = key.k[1];
    for (int round = 0; round < 10; round++) {
        for (int i = 0; i < LANES; i++) {
            uint64_t p0 = (uint64_t)0xD2511F53u * l->c0[i];
            uint64_t p1 = (uint64_t)0xCD9E8D57u * l->c2[i];
            l->c0[i] = (uint32_t)(p1 >> 32) ^ l->c1[i] ^ key0;
            l->c2[i] = (uint32_t)(p0 >> 32) ^ l->c3[i] ^ key1;
            l->c1[i] = (uint32_t)p1;
            l->c3[i] = (uint32_t)p0;
        }
        key0 += 0x9E3779B9u;
        key1 += 0xBB67AE85u;
    }
}

/* White noise of the pixels of up to LANES sections from `first` pixels before their middles on,
 * eight to a draw: the same wherever a streak runs. The filter's many taps smooth the steps of the
 * table. */
static void white(const bst_generator *g, bool by_row, const section *s, int sections, int first,
                  int count, float out[LANES][2 * (HALF + MOST_TAPS) + 1]) {
    const float *normals = g->streaks->normals;
    int groups = (count + 14) / 8;
    for (int k = 0; k < groups; k++) {
        lanes l;
        for (int i = 0; i < LANES; i++) {
            const section *one = &s[i < sections ? i : 0];
            uint64_t draw = PIXEL_NOISE | (uint64_t)by_row << 56 |
                            (uint64_t)(uint32_t)(one->at + 65536) << 24 |
                            (uint64_t)(((one->middle - first) >> 3) + k + 65536);
            l.c0[i] = (uint32_t)draw;
            l.c1[i] = (uint32_t)(draw >> 32);
            l.c2[i] = (uint32_t)g->exposure_id;
            l.c3[i] = (uint32_t)((uint64_t)g->exposure_id >> 32);
        }
        draw_lanes(g->key, &l);
        for (int i = 0; i < sections; i++) {
            int from = 8 * k - ((s[i].middle - first) & 7);
            uint32_t words[4] = {l.c0[i], l.c1[i], l.c2[i], l.c3[i]};
            int low = from < 0 ? -from : 0, high = count - from < 8 ? count - from : 8;
            for (int p = low; p < high; p++) {
                out[i][from + p] = normals[(words[p >> 1] >> (p & 1 ? 16 : 0)) & (NORMALS - 1)];
            }
        }
    }
}

/* Of all sections, filtered across the way. */
static void fill_noise(const bst_generator *g, struct generator_streaks *w, bool by_row, section *s,
                       int count) {
    int half = ROWS + w->reach + 1, rows = 2 * half + 1;
    float noise[LANES][2 * (HALF + MOST_TAPS) + 1];
    for (int first = 0; first < count; first += LANES) {
        int sections = count - first < LANES ? count - first : LANES;
        white(g, by_row, &s[first], sections, half + w->reach, rows + 2 * w->reach, noise);
        for (int k = 0; k < sections; k++) {
            float *out = s[first + k].noise;
            for (int r = 0; r < rows; r++) {
                out[r] = 0.0f;
            }
            for (int i = 0; i <= 2 * w->reach; i++) {
                float tap = w->taps[i];
                for (int r = 0; r < rows; r++) {
                    out[r] += tap * noise[k][r + i];
                }
            }
        }
    }
}

/* exp of numbers from -80 to 0: 2^n times the series of 2^f, |f| <= 1/2, to a float's rounding. */
LANES_FUNCTION static void exponentials(float *x, int count) {
    for (int i = 0; i < count; i++) {
        float y = (x[i] > -80.0f ? x[i] : -80.0f) * 1.442695041f;
        int32_t n = (int32_t)(y - 0.5f);
        float f = (y - (float)n) * 0.6931471806f;
        float e = 1.0f + f * (1.0f / 7.0f);
        e = 1.0f + f * (1.0f / 6.0f) * e;
        e = 1.0f + f * (1.0f / 5.0f) * e;
        e = 1.0f + f * (1.0f / 4.0f) * e;
        e = 1.0f + f * (1.0f / 3.0f) * e;
        e = 1.0f + f * (1.0f / 2.0f) * e;
        e = 1.0f + f * e;
        union {
            uint32_t bits;
            float value;
        } power = {.bits = (uint32_t)(n + 127) << 23};
        x[i] = e * power.value;
    }
}

/* The filter along the way of the sections' noise, added to their signal. Light has shot noise: the
 * squares of the filter average a line's over 1 / (sqrt(3 pi) S) px of it, whose electrons are the
 * output times the noise of a pixel. */
static void add_noise(const bst_generator *g, const struct generator_streaks *w, section *s,
                      int count) {
    float shot = (float)(1.0 / (sqrt(3.0 * BST_PI) * g->total_sigma * g->noise_e));
    int top = w->reach + 1;
    for (int k = 0; k < count; k++) {
        float sum[WIDE] = {0.0f};
        for (int i = -w->reach; i <= w->reach; i++) {
            int n = k + i;
            /* the way leaves no more than a row a step */
            int row = n >= 0 && n < count ? s[k].middle - s[n].middle + top : -1;
            if (row >= 0 && row <= 2 * top) {
                for (int r = 0; r < WIDE; r++) {
                    sum[r] += w->taps[i + w->reach] * s[n].noise[row + r];
                }
            }
        }
        for (int r = 0; r < WIDE; r++) {
            float light = s[k].output[r];
            s[k].output[r] = light + sum[r] * sqrtf(1.0f + shot * (light > 0.0f ? light : 0.0f));
        }
    }
}

static float output_at(const section *s, int count, int k, int across) {
    int r = k >= 0 && k < count ? across - s[k].middle + ROWS : -1;
    return r >= 0 && r <= 2 * ROWS ? s[k].output[r] : -INFINITY;
}

static int find_maxima(const bst_generator *g, const section *s, int count, bool by_row, int part,
                       maximum *out) {
    int found = 0, wide = by_row ? g->height : g->width, high = by_row ? g->width : g->height;
    for (int k = 0; k < count; k++) {
        for (int r = -ROWS + 1; r < ROWS && s[k].at >= 0 && s[k].at < wide; r++) {
            int across = s[k].middle + r;
            float value = s[k].output[r + ROWS];
            bool top = value > (float)g->threshold && across >= 0 && across < high;
            for (int i = -1; i <= 1 && top; i++) {
                for (int j = -1; j <= 1 && top; j++) {
                    top = (i == 0 && j == 0) || value > output_at(s, count, k + i, across + j);
                }
            }
            if (top && found < MOST_MAXIMA) {
                out[found++] = (maximum){.x = by_row ? across : s[k].at,
                                         .y = by_row ? s[k].at : across,
                                         .section = k,
                                         .part = part,
                                         .value = value};
            }
        }
    }
    return found;
}

/* Whether the output stays above `least` on the pixels between two maxima. */
static bool is_ridge(const section *s, int count, bool by_row, const maximum *a, const maximum *b,
                     float least) {
    int dx = b->x - a->x, dy = b->y - a->y;
    int steps = abs(dx) > abs(dy) ? abs(dx) : abs(dy);
    for (int i = 1; i < steps; i++) {
        float t = (float)i / (float)steps;
        int x = a->x + (int)lroundf(t * (float)dx), y = a->y + (int)lroundf(t * (float)dy);
        int at = by_row ? y : x, first = by_row ? a->y : a->x;
        int way = s[1].at > s[0].at ? 1 : -1;
        if (!(output_at(s, count, a->section + way * (at - first), by_row ? x : y) > least)) {
            return false;
        }
    }
    return true;
}

/* Half the side of the box in which maxima compete. */
static int reach_of(const bst_generator *g) {
    return (int)ceil(6.0 * g->sigma) + 2;
}

/* Keeps what no higher maximum in a box about it shares a ridge with. */
static void keep_highest(bst_generator *g, const section *s, int count, bool by_row,
                         maximum *maxima, int found) {
    int reach = reach_of(g);
    for (int i = 0; i < found; i++) {
        maximum *m = &maxima[i];
        double least = m->value - fmax(SADDLE_SIGMA, SADDLE_SHARE * m->value);
        for (int way = -1; way <= 1 && !m->dropped; way += 2) {
            for (int k = i + way; k >= 0 && k < found && !m->dropped; k += way) {
                const maximum *o = &maxima[k];
                if (abs(o->section - m->section) > reach) {
                    break;
                }
                m->dropped = o->value > m->value && abs(o->x - m->x) <= reach &&
                             abs(o->y - m->y) <= reach &&
                             is_ridge(s, count, by_row, m, o, (float)fmax(least, g->threshold));
            }
        }
    }
    struct generator_streaks *w = g->streaks;
    for (int i = 0; i < found; i++) {
        if (!maxima[i].dropped && w->kept_count < MOST_MAXIMA) {
            w->kept[w->kept_count++] = maxima[i];
        }
    }
}

/* Where the way turns, light of both of its parts is one ridge. */
static void report(bst_generator *g, const generator_source *source) {
    struct generator_streaks *w = g->streaks;
    int reach = reach_of(g);
    for (int i = 0; i < w->kept_count; i++) {
        const maximum *m = &w->kept[i];
        bool alone = true;
        for (int k = 0; k < w->kept_count && alone; k++) {
            const maximum *o = &w->kept[k];
            alone = o->part == m->part || o->value <= m->value || abs(o->x - m->x) > reach ||
                    abs(o->y - m->y) > reach;
        }
        if (alone) {
            bst_generator_keep_rough(g, m->x, m->y, (double)m->value, source->item);
        }
    }
}

/* A part of the way that runs more along one axis, one way. Its nodes become sections. */
static void run_part(bst_generator *g, const generator_source *source, const bst_route_node *nodes,
                     int count, bool by_row, int number) {
    struct generator_streaks *w = g->streaks;
    section *s = w->sections;
    double height = source->amplitude, scale = 0.25 / (g->total_sigma * g->total_sigma);
    /* the background that was found is too much by this */
    double taken = g->background_bias_e / (bst_bound_norm(&g->bound, 0.0) * g->noise_e);
    int made = 0, outside = w->reach + 1;
    int wide = by_row ? g->height : g->width;
    double from = by_row ? nodes[0].y : nodes[0].x;
    double to = by_row ? nodes[count - 1].y : nodes[count - 1].x, way = to > from ? 1.0 : -1.0;
    double at = way > 0.0 ? ceil(from) : floor(from);
    for (int k = 0; k + 1 < count; k++) {
        const bst_route_node *n = &nodes[k], *m = &nodes[k + 1];
        double a = by_row ? n->y : n->x, run = (by_row ? m->y : m->x) - a;
        double rise = by_row ? m->x - n->x : m->y - n->y;
        /* distances across the way, not across the axis */
        double slant = run * run / (run * run + rise * rise);
        for (; way * (a + run - at) > 0.0 && made < BST_ROUTE_NODES; at += way) {
            double part = fmax((at - a) / run, 0.0);
            double across = (by_row ? n->x : n->y) + part * rise;
            if (at < -outside || at > wide + outside) {
                continue;
            }
            section *now = &s[made++];
            now->at = (int)at;
            now->middle = (int)lround(across);
            now->height = (float)(height * (n->light + part * (m->light - n->light)));
            float *light = &w->light[(made - 1) * WIDE];
            for (int r = -ROWS; r <= ROWS; r++) {
                double d = now->middle + r - across;
                light[r + ROWS] = (float)(-scale * d * d * slant);
            }
        }
    }
    if (made < 2) {
        return;
    }
    exponentials(w->light, made * WIDE);
    for (int k = 0; k < made; k++) {
        for (int r = 0; r < WIDE; r++) {
            s[k].output[r] = s[k].height * w->light[k * WIDE + r] - (float)taken;
        }
    }
    fill_noise(g, w, by_row, s, made);
    add_noise(g, w, s, made);
    int found = find_maxima(g, s, made, by_row, number, w->maxima);
    keep_highest(g, s, made, by_row, w->maxima, found);
}

/* The same where light comes near enough to the threshold, and as far about it as noise is
 * filtered.
 */
static void run_bright(bst_generator *g, const generator_source *source,
                       const bst_route_node *nodes, int count, bool by_row, int number) {
    double least = (g->threshold - FAINTEST_SIGMA) / source->amplitude;
    int margin = 2 * g->streaks->reach + 4;
    for (int first = 0; first < count;) {
        while (first < count && nodes[first].light < least) {
            first++;
        }
        int last = first, seen = first;
        for (; seen < count && seen <= last + 2 * margin; seen++) {
            last = nodes[seen].light >= least ? seen : last;
        }
        if (first < count) {
            int from = first > margin ? first - margin : 0;
            int to = last + margin < count ? last + margin : count - 1;
            run_part(g, source, nodes + from, to - from + 1, by_row, number + from);
        }
        first = seen;
    }
}

/* Where the way goes from a node on; it trembles from one to the next. */
static void course(const bst_route_node *way, int count, int at, double *dx, double *dy) {
    enum { AHEAD = 12 };
    int end = at + AHEAD < count ? at + AHEAD : count - 1;
    int start = end - AHEAD > 0 ? end - AHEAD : 0;
    *dx = way[end].x - way[start].x;
    *dy = way[end].y - way[start].y;
}

/* Whether a source's way comes near the frame at all. */
static bool comes_in(const bst_generator *g, const generator_source *s) {
    double margin_x = ROWS + 1.0 + 0.5 * fabs(s->path.dx - g->whole_path.dx);
    double margin_y = ROWS + 1.0 + 0.5 * fabs(s->path.dy - g->whole_path.dy);
    return s->x + g->route_box[1] > -margin_x && s->x + g->route_box[0] < g->width + margin_x &&
           s->y + g->route_box[3] > -margin_y && s->y + g->route_box[2] < g->height + margin_y;
}

bst_status bst_generator_fragments(bst_ctx *ctx, bst_generator *g, const generator_source *source) {
    if (source->amplitude * g->route_top < g->threshold - FAINTEST_SIGMA || !comes_in(g, source)) {
        return BST_OK;
    }
    if (!g->streaks) {
        g->streaks = calloc(1, sizeof *g->streaks);
        if (!g->streaks) {
            return bst_fail(ctx, BST_ERR_MEMORY, "no memory for long streaks");
        }
        set_normals(g->streaks->normals);
    }
    set_taps(g->streaks, g->total_sigma);
    /* the stars' way in the middle of the frame, turned into this source's by what its own ends
     * differ */
    bst_route_node *way = g->way;
    for (int i = 0; i < g->route_count; i++) {
        const bst_route_node *n = &g->route[i];
        double u = n->time - 0.5;
        way[i] = *n;
        way[i].x += source->x + u * (source->path.dx - g->whole_path.dx);
        way[i].y += source->y + u * (source->path.dy - g->whole_path.dy);
    }
    g->streaks->kept_count = 0;
    for (int first = 0, end; first + 1 < g->route_count; first = end) {
        double dx, dy;
        course(way, g->route_count, first, &dx, &dy);
        bool by_row = fabs(dy) > fabs(dx);
        for (end = first + 1; end + 1 < g->route_count; end++) {
            double ex, ey;
            course(way, g->route_count, end, &ex, &ey);
            /* a little past the diagonal is no reason to part it */
            bool same = by_row ? ey * dy > 0.0 && fabs(ey) > 0.6 * fabs(ex)
                               : ex * dx > 0.0 && fabs(ex) > 0.6 * fabs(ey);
            if (!same) {
                break;
            }
        }
        run_bright(g, source, way + first, end - first + 1, by_row, first);
    }
    report(g, source);
    return BST_OK;
}
