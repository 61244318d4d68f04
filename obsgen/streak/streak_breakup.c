#include "obsgen/streak/streak_breakup.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "boresight/vec.h"
#include "obsgen/model/false_alarms.h"
#include "obsgen/model/local_sky.h"
#include "obsgen/streak/streak_light.h"
#include "obsgen/streak/streak_noise.h"
#include "obsgen/streak/streak_path.h"
#include "sim/core/pages.h"

/* Saddle criterion of image processing for separate maxima. */
static const double SADDLE_SIGMA = 3.0, SADDLE_SHARE = 0.15;
/* Light further below the threshold is treated statistically: positions of its detections are
 * drawn. */
static const double FAINTEST_SIGMA = 3.0;
/* Light below LEAST_LIGHT does not affect other streaks; below LEAST_SEEN it adds no false alarms.
 */
static const double LEAST_LIGHT = 0.25, LEAST_SEEN = 0.25;
/* Share of the light on a pixel above which a source searches that pixel itself. */
static const double OWN_SHARE = 0.3;
/* Random stream of faint streaks; those of other false alarms are lower. */
static const uint64_t FAINT_STREAK = (uint64_t)1 << 59;

enum {
    ROWS = BST_STREAK_ROWS,
    WIDE = BST_STREAK_WIDE,
    SPARSE = BST_STREAK_SPARSE,
    /* table steps: outputs from 1 in steps of 1/8, lights in steps of 1/8 */
    OUTPUTS = 64,
    LIGHTS = 48,
    FLANK = 8,   /* half pixels */
    SKY_STEP = 8 /* one of so many places of a run represents their light in the background */
};

typedef bst_streak_section section;

typedef struct maximum {
    int x, y, item, order; /* order: in which it was found */
    bool by_row;
    float value;
} maximum;

struct generator_streaks {
    section sections[BST_ROUTE_NODES];
    bst_streak_light light;
    bst_streak_ways ways;
    bst_streak_noise noise;
    bst_local_sky sky;
    double norm, taken; /* norm of the point filter; mean loss of its output, see taken_from */
    double shot;        /* variance added by shot noise per unit output */
    /* log of the density of maxima per pixel above an output */
    double log_maxima[OUTPUTS], maxima_sigma;
    double alarms[LIGHTS]; /* additional false alarms per pixel of a trail */
    float *output;         /* frame-sized; pixels marked `shown` hold outputs above the threshold */
    size_t output_room;
    int *shown;
    maximum *maxima;
    int shown_count, shown_room, maxima_count, maxima_room;
};

static float output_at(const section *s, int count, int k, int across) {
    int r = k >= 0 && k < count ? across - s[k].middle + ROWS : -1;
    return r >= 0 && r <= 2 * ROWS ? s[k].output[r] : -INFINITY;
}

static bst_status grow(bst_ctx *ctx, void **items, int needed, int *room, size_t bytes) {
    if (needed <= *room) {
        return BST_OK;
    }
    int more = 2 * needed + 1024;
    void *moved = realloc(*items, (size_t)more * bytes);
    if (!moved) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for %d pixels of streaks", more);
    }
    *items = moved;
    *room = more;
    return BST_OK;
}

static bool is_on_frame(const bst_generator *g, int x, int y) {
    return x >= 0 && y >= 0 && x < g->width && y < g->height;
}

/* True if no neighbour of row r of section k is higher. */
static bool is_maximum(const section *s, int count, int k, int r) {
    int across = s[k].middle + r - ROWS;
    float value = s[k].output[r];
    bool top = r > 0 && r < WIDE - 1;
    for (int i = -1; i <= 1 && top; i++) {
        for (int j = -1; j <= 1 && top; j++) {
            top = (i == 0 && j == 0) || value > output_at(s, count, k + i, across + j);
        }
    }
    return top;
}

/* Stores the outputs above the threshold and finds their maxima. */
static bst_status find_maxima(bst_ctx *ctx, bst_generator *g, const section *s, int count,
                              bool by_row, int item) {
    struct generator_streaks *w = g->streaks;
    float threshold = (float)g->threshold;
    BST_TRY(grow(ctx, (void **)&w->shown, w->shown_count + count * WIDE, &w->shown_room,
                 sizeof *w->shown));
    BST_TRY(grow(ctx, (void **)&w->maxima, w->maxima_count + count * WIDE, &w->maxima_room,
                 sizeof *w->maxima));
    for (int k = 0; k < count; k++) {
        for (int r = 0; r < WIDE; r++) {
            float value = s[k].output[r];
            if (!(value > threshold)) {
                continue;
            }
            int across = s[k].middle + r - ROWS;
            int x = by_row ? across : s[k].at, y = by_row ? s[k].at : across;
            if (!is_on_frame(g, x, y)) {
                continue;
            }
            assert(w->shown_count < w->shown_room);
            w->shown[w->shown_count] = y * g->width + x;
            w->output[w->shown[w->shown_count++]] = value;
            if (is_maximum(s, count, k, r)) {
                w->maxima[w->maxima_count] = (maximum){.x = x,
                                                       .y = y,
                                                       .item = item,
                                                       .order = w->maxima_count,
                                                       .by_row = by_row,
                                                       .value = value};
                w->maxima_count++;
            }
        }
    }
    return BST_OK;
}

/* Fast lroundf for small values. */
static int nearest(float value) {
    return (int)((double)value + (value < 0.0f ? -0.5 : 0.5));
}

/* True if the output stays above `least` (at least the threshold) on the pixels between two maxima.
 */
static bool is_ridge(const bst_generator *g, const maximum *a, const maximum *b, float least) {
    int dx = b->x - a->x, dy = b->y - a->y;
    int steps = abs(dx) > abs(dy) ? abs(dx) : abs(dy);
    for (int i = 1; i < steps; i++) {
        float t = (float)i / (float)steps;
        int x = a->x + nearest(t * (float)dx), y = a->y + nearest(t * (float)dy);
        if (!(g->streaks->output[y * g->width + x] > least)) {
            return false;
        }
    }
    return true;
}

/* qsort order by position; of equal positions the brightest source first. */
static int by_position(const void *a, const void *b) {
    const maximum *p = a, *q = b;
    if (p->y != q->y) {
        return p->y < q->y ? -1 : 1;
    }
    if (p->x != q->x) {
        return p->x < q->x ? -1 : 1;
    }
    return p->order < q->order ? -1 : 1;
}

/* Keeps the maxima without a higher one connected by a ridge in the search box. */
static void keep_maxima(bst_generator *g) {
    struct generator_streaks *w = g->streaks;
    int reach = (int)ceil(6.0 * g->fitted_sigma) + 2;
    if (w->maxima_count > 0) {
        qsort(w->maxima, (size_t)w->maxima_count, sizeof *w->maxima, by_position);
    }
    for (int i = 0; i < w->maxima_count; i++) {
        const maximum *m = &w->maxima[i];
        bool kept = i == 0 || m->x != m[-1].x || m->y != m[-1].y;
        double saddle = m->value - fmax(SADDLE_SIGMA, SADDLE_SHARE * m->value);
        float least = (float)fmax(saddle, g->threshold);
        for (int way = -1; way <= 1 && kept; way += 2) {
            for (int k = i + way; k >= 0 && k < w->maxima_count && kept; k += way) {
                const maximum *o = &w->maxima[k];
                if (abs(o->y - m->y) > reach) {
                    break;
                }
                /* where a trail turns, both of its parts form one ridge */
                kept = !(o->value > m->value) || abs(o->x - m->x) > reach ||
                       (o->by_row == m->by_row && !is_ridge(g, m, o, least));
            }
        }
        if (kept) {
            bst_generator_keep_rough(g, m->x, m->y, (double)m->value, m->item);
        }
    }
}

/* Loss of filter output by streak light in background and noise estimates, in noises of the frame
 * without it: the background is too high, and the threshold scales with an increased noise. */
static double output_loss(const bst_generator *g, double level, double noise) {
    return level / g->streaks->norm + g->threshold * (noise - 1.0);
}

/* Sets the mean output loss over the frame. */
static void set_mean_loss(bst_generator *g) {
    g->streaks->norm = bst_crlb_table_norm(&g->bound, 0.0);
    g->streaks->taken =
        output_loss(g, g->background_bias_e / g->dark_noise_e, g->noise_e / g->dark_noise_e);
}

/* Output loss at a place of a run; cell: of the previous place, as in bst_local_sky_next. */
static inline double loss_at(const bst_generator *g, bst_local_sky_cell *cell,
                             const bst_streak_place *p, bool by_row) {
    int x = by_row ? p->middle : p->at, y = by_row ? p->at : p->middle;
    double level, noise;
    if (is_on_frame(g, x, y)) {
        bst_local_sky_next(&g->streaks->sky, cell, x, y, &level, &noise);
    } else {
        bst_local_sky_at(&g->streaks->sky, x, y, &level, &noise);
    }
    return output_loss(g, level, noise);
}

/* Background and noise by mesh with the light of all runs. */
static bst_status set_local_sky(bst_ctx *ctx, bst_generator *g) {
    struct generator_streaks *w = g->streaks;
    const bst_streak_light *l = &w->light;
    double steep = 2.0 * g->total_sigma;
    BST_TRY(bst_local_sky_begin(ctx, &w->sky, g->width, g->height, g->settings.mesh_px,
                                g->total_sigma));
    for (int i = 0; i < l->run_count; i++) {
        const bst_streak_run *run = &l->runs[i];
        for (int k = 0; k < run->count; k += SKY_STEP) {
            const bst_streak_place *p = &l->places[run->first + (size_t)k];
            int x = run->by_row ? p->middle : p->at, y = run->by_row ? p->at : p->middle;
            int places = run->count - k < SKY_STEP ? run->count - k : SKY_STEP;
            if (is_on_frame(g, x, y)) {
                bst_local_sky_add(&w->sky, x, y, (double)p->height,
                                  places / (steep * sqrt((double)p->fall)));
            }
        }
    }
    bst_local_sky_settle(&w->sky, g->calibration.background_fraction, g->calibration.crowding);
    return BST_OK;
}

/* Finds the maxima about places first to last of a run, with noise. */
static bst_status search_places(bst_ctx *ctx, bst_generator *g, const bst_streak_run *run,
                                int first, int last) {
    struct generator_streaks *w = g->streaks;
    section *s = w->sections;
    const bst_streak_place *places = &w->light.places[run->first];
    int count = last - first + 1 < BST_ROUTE_NODES ? last - first + 1 : BST_ROUTE_NODES;
    bst_local_sky_cell cell = {.column = -1};
    for (int k = 0; k < count; k++) {
        const float *seen = bst_streak_seen(&w->light, run, first + k);
        float taken = (float)loss_at(g, &cell, &places[first + k], run->by_row);
        s[k].at = places[first + k].at;
        s[k].middle = places[first + k].middle;
        for (int r = 0; r < WIDE; r++) {
            s[k].output[r] = seen[r] - taken;
        }
        memset(s[k].output + WIDE, 0, sizeof s[k].output - WIDE * sizeof *seen);
    }
    bst_streak_noise_add(&w->noise, g->key, g->exposure_id, run->by_row, w->shot, s, count);
    return find_maxima(ctx, g, s, count, run->by_row, g->sources[run->source].item);
}

static double log_maxima_above(const struct generator_streaks *w, double output) {
    double at = fmin(fmax(8.0 * (output - 1.0), 0.0), OUTPUTS - 1.001);
    int i = (int)at;
    return w->log_maxima[i] + (at - i) * (w->log_maxima[i + 1] - w->log_maxima[i]);
}

/* Tabulates the false alarms caused by trail light below the threshold. */
static void set_alarms(bst_generator *g) {
    struct generator_streaks *w = g->streaks;
    /* the squared filter averages a line's electrons over 1 / (sqrt(3 pi) S) px; they equal output
     * times pixel noise */
    w->shot =
        bst_camera_excess_noise(g->camera) / (sqrt(3.0 * BST_PI) * g->total_sigma * g->noise_e);
    if (w->maxima_sigma != g->filter_sigma) {
        for (int i = 0; i < OUTPUTS; i++) {
            w->log_maxima[i] = log(bst_matched_pixel_maxima(g->filter_sigma, 1.0 + i / 8.0));
        }
        w->maxima_sigma = g->filter_sigma;
    }
    double threshold = g->threshold + w->taken, fall = 0.25 / (g->cross_sigma * g->cross_sigma);
    double alone = exp(log_maxima_above(w, threshold));
    for (int i = 0; i < LIGHTS; i++) {
        double more[FLANK + 1]; /* at so many half pixels from the trail */
        for (int k = 0; k <= FLANK; k++) {
            double d = 0.5 * k, light = i / 8.0 * exp(-fall * d * d);
            double output = (threshold - light) / sqrt(1.0 + w->shot * light);
            more[k] = 0.5 * (exp(log_maxima_above(w, output)) - alone);
        }
        w->alarms[i] = 0.0;
        for (int k = -FLANK; k <= FLANK; k++) {
            w->alarms[i] += more[abs(k)];
        }
    }
}

/* Poisson arrivals along the trail of one source. */
typedef struct arrivals {
    double next;
    uint64_t draw;
} arrivals;

static double draw_exponential(const bst_generator *g, arrivals *a) {
    return -log(bst_rng_uniform(g->key, (uint64_t)g->exposure_id, a->draw++));
}

/* Draws a false alarm at a place whose light is too faint for a pixel search. */
static void draw_alarm(bst_generator *g, const bst_streak_run *run, const bst_streak_place *p,
                       double light, double taken, arrivals *a) {
    double noise = sqrt(1.0 + g->streaks->shot * light);
    double least = (g->threshold + taken - light) / noise;
    double value = sqrt(least * least + 2.0 * draw_exponential(g, a));
    double off[2];
    bst_rng_normal2(g->key, (uint64_t)g->exposure_id, a->draw++, off);
    /* false alarms concentrate towards the trail */
    double spread = g->total_sigma * sqrt(2.0 / (g->threshold * light + 1.0));
    double along = p->at + spread * off[0], across = p->middle + (double)p->off + spread * off[1];
    int x = (int)lround(run->by_row ? across : along);
    int y = (int)lround(run->by_row ? along : across);
    if (is_on_frame(g, x, y)) {
        bst_generator_keep_rough(g, x, y, g->threshold + noise * (value - least),
                                 g->sources[run->source].item);
    }
}

/* Expected false alarms per pixel of a trail at this light and output loss. */
static double alarm_density(const struct generator_streaks *w, double light, double taken) {
    double at = 8.0 * (light + w->taken - taken); /* the table is for the mean loss */
    at = at > 0.0 ? at : 0.0;
    at = at < LIGHTS - 1.001 ? at : LIGHTS - 1.001;
    int i = (int)at;
    return w->alarms[i] + (at - i) * (w->alarms[i + 1] - w->alarms[i]);
}

/* Draws false alarms along a run where its light is below `least`; every SPARSEth faint place
 * represents its neighbours. */
static void draw_faint(bst_generator *g, const bst_streak_run *run, double least, arrivals *a) {
    const struct generator_streaks *w = g->streaks;
    const bst_streak_place *places = &w->light.places[run->first];
    double bright = OWN_SHARE * least, steep = 2.0 * g->total_sigma;
    double fall = 0.0, density = 0.0; /* of the previous place; trail pixels per place */
    bst_local_sky_cell cell = {.column = -1};
    for (int k = 0, step = run->dense ? 1 : SPARSE; k < run->count; k += step) {
        const bst_streak_place *p = &places[k];
        double own = (double)p->height, stands = own >= bright ? 1.0 : SPARSE;
        if (own < bright && (own <= LEAST_SEEN || k % SPARSE != 0)) {
            continue;
        }
        double light = (double)bst_streak_seen(&w->light, run, k)[run->dense ? ROWS : 0];
        light = light > own ? light : own;
        if (light >= least ||
            !is_on_frame(g, run->by_row ? p->middle : p->at, run->by_row ? p->at : p->middle)) {
            continue;
        }
        if ((double)p->fall != fall) {
            fall = (double)p->fall;
            density = 1.0 / (steep * sqrt(fall));
        }
        double taken = loss_at(g, &cell, p, run->by_row);
        /* this source's share of the light */
        a->next -= stands * density * own / light * alarm_density(w, light, taken);
        while (a->next < 0.0) {
            a->next += draw_exponential(g, a);
            draw_alarm(g, run, p, light, taken, a);
        }
    }
}

/* Searches a run pixel by pixel where its light is at least `least`, with a margin for filtered
 * noise. */
static bst_status search_bright(bst_ctx *ctx, bst_generator *g, const bst_streak_run *run,
                                double least) {
    const struct generator_streaks *w = g->streaks;
    int margin = 2 * w->noise.reach + 4, from = -1, last = -1;
    for (int k = 0; k < run->count; k++) {
        double own = (double)w->light.places[run->first + (size_t)k].height;
        if (own >= OWN_SHARE * least) {
            double light = (double)bst_streak_seen(&w->light, run, k)[ROWS];
            light = light > own ? light : own;
            if (light >= least && own >= OWN_SHARE * light) {
                from = from < 0 ? k : from;
                last = k;
            }
        }
        if (from >= 0 && (k > last + 2 * margin || k == run->count - 1)) {
            int start = from > margin ? from - margin : 0;
            int end = last + margin < run->count ? last + margin : run->count - 1;
            BST_TRY(search_places(ctx, g, run, start, end));
            from = -1;
        }
    }
    return BST_OK;
}

/* Searches all runs of the frame. */
static bst_status search_runs(bst_ctx *ctx, bst_generator *g) {
    const bst_streak_light *l = &g->streaks->light;
    double least = g->threshold - FAINTEST_SIGMA;
    arrivals faint = {0};
    for (int i = 0; i < l->run_count; i++) {
        const bst_streak_run *run = &l->runs[i];
        if (i == 0 || run->source != run[-1].source) {
            faint.draw = FAINT_STREAK | g->sources[run->source].name << 24;
            faint.next = draw_exponential(g, &faint);
        }
        draw_faint(g, run, least, &faint);
        if (run->dense) {
            BST_TRY(search_bright(ctx, g, run, least));
        }
    }
    return BST_OK;
}

/* Writes to the memory, so that its pages are allocated now. */
bst_status bst_generator_reserve_streaks(bst_ctx *ctx, bst_generator *g, int width, int height) {
    if (!g->streaks) {
        g->streaks = bst_pages_alloc(sizeof *g->streaks);
        if (!g->streaks) {
            return bst_fail(ctx, BST_ERR_MEMORY, "no memory for long streaks");
        }
        memset(g->streaks, 0, sizeof *g->streaks);
        bst_streak_noise_init(&g->streaks->noise);
    }
    struct generator_streaks *w = g->streaks;
    size_t pixels = (size_t)width * (size_t)height;
    if (pixels > w->output_room) {
        free(w->output);
        w->output = bst_pages_alloc(pixels * sizeof *w->output);
        w->output_room = w->output ? pixels : 0;
        if (!w->output) {
            return bst_fail(ctx, BST_ERR_MEMORY, "no memory for long streaks");
        }
        memset(w->output, 0, pixels * sizeof *w->output);
    }
    return BST_OK;
}

bst_status bst_streak_breakup_fragments(bst_ctx *ctx, bst_generator *g) {
    BST_TRY(bst_generator_reserve_streaks(ctx, g, g->width, g->height));
    struct generator_streaks *w = g->streaks;
    bst_streak_noise_set(&w->noise, g->filter_sigma);
    set_mean_loss(g);
    set_alarms(g);
    bst_streak_light_begin(&w->light, g->width, g->height,
                           fabs(g->whole_path.dy) > fabs(g->whole_path.dx));
    const bst_streak_limits limits = {.beyond = w->noise.reach + 1,
                                      .seen = LEAST_SEEN,
                                      .lit = LEAST_LIGHT,
                                      .dense = OWN_SHARE * (g->threshold - FAINTEST_SIGMA)};
    bst_streak_ways_begin(&w->ways, g, &limits);
    for (int r = 0; r < g->rank_count; r++) {
        if (g->sources[g->ranks[r].index].broken) {
            BST_TRY(bst_streak_ways_add(ctx, &w->ways, g, g->ranks[r].index, &w->light));
        }
    }
    BST_TRY(bst_streak_light_add_up(ctx, &w->light));
    BST_TRY(set_local_sky(ctx, g));
    bst_status status = search_runs(ctx, g);
    if (status == BST_OK) {
        keep_maxima(g);
    }
    for (int i = 0; i < w->shown_count; i++) {
        w->output[w->shown[i]] = 0.0f;
    }
    w->shown_count = w->maxima_count = 0;
    return status;
}

void bst_streak_breakup_free(struct generator_streaks *w) {
    if (w) {
        bst_streak_light_free(&w->light);
        bst_local_sky_free(&w->sky);
        free(w->output);
        free(w->shown);
        free(w->maxima);
        free(w);
    }
}
