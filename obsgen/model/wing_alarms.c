#include "obsgen/model/wing_alarms.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>

#include "obsgen/generator_internal.h"
#include "obsgen/model/false_alarms.h"

/* Random stream, beyond those of other draws, and bits of a patch's pixels. */
static const uint64_t WING_ALARM = (uint64_t)1 << 47;
enum { PIXEL_BITS = 13 };
/* Wing light below LEAST_WING (SNR) causes a negligible number of false alarms. */
static const double LEAST_WING = 0.5;
/* Wing light per pixel, in pixel noises, that no longer adds to the background of a mesh. */
static const double LEAST_LIGHT = 0.01;
/* Within so many sigmas of the PSF a maximum is the source's own: the reach of its fit
 * (REACH_SIGMAS of imgproc/measure/deblend.c, in whole pixels). */
static const double CORE_SIGMAS = 4.0;
/* Share of a known PSF's sum of squares that the kernel of image processing may lose by its radius
 * (imgproc/detect/filter_kernel.c). */
static const double RADIUS_SHARE = 1e-3;

/* Pixels about a source: half side of the patch, reach of the filter's kernel. */
enum {
    RADIUS = 22,
    KERNEL = 9,
    SIDE = 2 * RADIUS + 1,
    WIDE = SIDE + 2 * KERNEL,
    MOST_MAXIMA = 256,
    MOST_RADIUS = 15, /* BST_FILTER_MAX_RADIUS */
    PER_PX = 3,       /* of the table of outputs */
    DISTANCES = BST_FALLOFF_DISTANCES / BST_FALLOFF_PER_PX * PER_PX
};
_Static_assert(WIDE *WIDE <= 1 << PIXEL_BITS, "a pixel has its own number");

/* Output of the point filter by distance from a source, relative to that at it, and share of the
 * source's light on a pixel, averaged with the squares of the kernel: its shot noise in the output.
 */
typedef struct outputs {
    float at[DISTANCES], light[DISTANCES];
    double end_px; /* last distance */
} outputs;

/* A source and the frame in which it has wings. */
typedef struct winged {
    const bst_generator *g;
    const generator_source *s;
    const outputs *outputs;
    double norm; /* sqrt(sum k^2) of the point filter's image k of unit sum */
} winged;

/* Output of the filter about a source, SNR as image processing measures it. */
typedef struct patch {
    int x0, y0; /* frame pixel of the first */
    float output[SIDE][SIDE], light[SIDE][SIDE];
} patch;

typedef struct maximum {
    int x, y; /* in the patch */
    float snr;
} maximum;

/* Half side of the filter's square kernel, px, and the fitted PSF on it. */
static int set_kernel(const bst_response *r, float kernel[MOST_RADIUS + 1][MOST_RADIUS + 1]) {
    double square[MOST_RADIUS + 1] = {0.0}; /* sum of squares within each half side */
    for (int v = 0; v <= MOST_RADIUS; v++) {
        for (int u = 0; u <= MOST_RADIUS; u++) {
            double slope, curvature,
                share = bst_response_model_share(r, hypot(u, v), &slope, &curvature);
            kernel[v][u] = (float)share;
            square[u > v ? u : v] += share * share * (u > 0 ? 2.0 : 1.0) * (v > 0 ? 2.0 : 1.0);
        }
    }
    double all = 0.0, inside = 0.0;
    for (int k = 0; k <= MOST_RADIUS; k++) {
        all += square[k];
    }
    int radius = 0;
    while (radius < MOST_RADIUS && !((inside += square[radius]) >= (1.0 - RADIUS_SHARE) * all)) {
        radius++;
    }
    return radius;
}

/* Computes the outputs: sums of kernel and image over the kernel's pixels, in the mean of the
 * directions along the pixels and across them. */
static void set_outputs(const bst_response *r, outputs *out) {
    float kernel[MOST_RADIUS + 1][MOST_RADIUS + 1];
    int radius = set_kernel(r, kernel);
    out->end_px = (DISTANCES - 1.0) / PER_PX / r->image_scale - radius;
    for (int n = 0; n < DISTANCES; n++) {
        double away = (double)n / PER_PX, sum = 0.0, light = 0.0, squares = 0.0;
        for (int turned = 0; turned < 2 && away <= out->end_px + 1.0; turned++) {
            double x = turned ? sqrt(0.5) * away : away, y = turned ? x : 0.0;
            for (int v = -radius; v <= radius; v++) {
                for (int u = -radius; u <= radius; u++) {
                    double weight = (double)kernel[abs(v)][abs(u)];
                    double share = bst_response_image_share(r, hypot(x - u, y - v));
                    sum += weight * share;
                    light += weight * weight * share;
                    squares += weight * weight;
                }
            }
        }
        out->light[n] = (float)(squares > 0.0 ? light / squares : 0.0);
        out->at[n] = (float)(n == 0 ? sum : sum / (double)out->at[0]);
    }
    out->at[0] = 1.0f;
}

/* Farthest distance of the table of outputs, px. */
static double table_end_px(const winged *w) {
    return w->outputs->end_px;
}

/* Value of a table at a distance within it. */
static double table_at(const float table[DISTANCES], double distance_px) {
    double at = fmin(distance_px * PER_PX, DISTANCES - 1.001);
    int i = (int)at;
    return (double)table[i] + (at - i) * ((double)table[i + 1] - (double)table[i]);
}

/* Filter output caused by a source at a distance within the table. */
static double wing_output(const winged *w, double distance_px) {
    return w->s->amplitude * table_at(w->outputs->at, distance_px);
}

/* Wing light per pixel, in pixel noises (callback). Beyond the table wings decrease with the third
 * power of the distance, as those of an aperture with an edge do. */
static double wing_light(const void *user, double distance_px) {
    const winged *w = user;
    double end = table_end_px(w) - 1.0, beyond = fmin(end / distance_px, 1.0);
    return w->s->flux_e / w->g->noise_e *
           bst_response_image_share(&w->g->response, fmin(distance_px, end)) * beyond * beyond *
           beyond;
}

/* Distance from a source beyond which maxima can be detections of their own, px. */
static double nearest_px(const bst_generator *g) {
    return ceil(6.0 * g->fitted_sigma + g->streak) + 2.5;
}

static bool has_wings(const winged *w) {
    double from = nearest_px(w->g);
    return w->s->found && table_end_px(w) > from && wing_output(w, from) >= LEAST_WING;
}

/* Adds the wings of all bright sources to the background by mesh; *any: false if there are none. */
static bst_status set_wing_sky(bst_ctx *ctx, bst_generator *g, const outputs *table, double norm,
                               bool *any) {
    *any = false;
    for (int i = 0; i < g->source_count; i++) {
        const generator_source *s = &g->sources[i];
        winged w = {g, s, table, norm};
        if (!has_wings(&w)) {
            continue;
        }
        if (!*any) {
            BST_TRY(bst_local_sky_begin(ctx, &g->wing_sky, g->width, g->height, g->settings.mesh_px,
                                        g->total_sigma));
            BST_TRY(bst_local_sky_begin_wings(ctx, &g->wing_sky));
        }
        *any = true;
        double end = table_end_px(&w) - 1.0;
        double reach = fmax(end * cbrt(wing_light(&w, end) / LEAST_LIGHT), nearest_px(g));
        bst_local_sky_add_wings(&g->wing_sky, s->x, s->y, reach, wing_light, &w);
    }
    if (*any) {
        bst_local_sky_settle_wings(&g->wing_sky, 1.0 / g->noise_e);
    }
    return BST_OK;
}

/* Draws noise with the correlation of the filter's output: white noise under a Gaussian kernel. */
static void draw_noise(const bst_generator *g, const generator_source *s, float out[SIDE][SIDE]) {
    float kernel[2 * KERNEL + 1], sum = 0.0f, rows[WIDE][SIDE];
    double sigma = g->response.maxima_sigma_px;
    for (int i = 0; i <= 2 * KERNEL; i++) {
        double at = (i - KERNEL) / sigma;
        kernel[i] = (float)exp(-0.5 * at * at);
        sum += kernel[i] * kernel[i];
    }
    uint64_t first = WING_ALARM | s->name << PIXEL_BITS;
    for (int j = 0; j < WIDE; j++) {
        float white[WIDE];
        for (int i = 0; i < WIDE; i++) {
            white[i] = (float)bst_rng_normal(g->key, (uint64_t)g->exposure_id,
                                             first + (uint64_t)(j * WIDE + i));
        }
        for (int i = 0; i < SIDE; i++) {
            rows[j][i] = 0.0f;
            for (int k = 0; k <= 2 * KERNEL; k++) {
                rows[j][i] += kernel[k] * white[i + k] / sum;
            }
        }
    }
    for (int j = 0; j < SIDE; j++) {
        for (int i = 0; i < SIDE; i++) {
            out[j][i] = 0.0f;
        }
        for (int k = 0; k <= 2 * KERNEL; k++) {
            for (int i = 0; i < SIDE; i++) {
                out[j][i] += kernel[k] * rows[j + k][i];
            }
        }
    }
}

/* Sets the filter's output about a source: wing light less the background of the mesh, and noise,
 * both over the noise that image processing measures. */
static void set_patch(const winged *w, patch *p) {
    const bst_generator *g = w->g;
    p->x0 = (int)lround(w->s->x) - RADIUS;
    p->y0 = (int)lround(w->s->y) - RADIUS;
    draw_noise(g, w->s, p->output);
    for (int j = 0; j < SIDE; j++) {
        for (int i = 0; i < SIDE; i++) {
            double x = p->x0 + i, y = p->y0 + j, r = hypot(x - w->s->x, y - w->s->y), level, noise;
            bst_local_sky_at(&g->wing_sky, x, y, &level, &noise);
            double away = fmin(r, table_end_px(w)), raw = wing_output(w, away);
            double own = sqrt(1.0 + w->s->flux_e * table_at(w->outputs->light, away) /
                                        (g->noise_e * g->noise_e));
            p->light[j][i] = (float)((raw - level / w->norm) / noise);
            p->output[j][i] = p->light[j][i] + (float)(own / noise) * p->output[j][i];
        }
    }
}

/* Finds the local maxima of a patch above a level; returns their number. */
static int find_maxima(const patch *p, double level, maximum found[MOST_MAXIMA]) {
    int count = 0;
    for (int j = 1; j + 1 < SIDE; j++) {
        for (int i = 1; i + 1 < SIDE && count < MOST_MAXIMA; i++) {
            float here = p->output[j][i];
            bool top = (double)here > level;
            for (int k = 0; k < 9 && top; k++) {
                top = k == 4 || here > p->output[j + k / 3 - 1][i + k % 3 - 1];
            }
            if (top) {
                found[count++] = (maximum){i, j, here};
            }
        }
    }
    return count;
}

/* True if the output on the pixels between two maxima stays above `least`. */
static bool is_ridge(const patch *p, const maximum *a, const maximum *b, double least) {
    int dx = b->x - a->x, dy = b->y - a->y;
    int steps = abs(dx) > abs(dy) ? abs(dx) : abs(dy);
    for (int i = 1; i < steps; i++) {
        int x = a->x + (int)lround((double)i * dx / steps);
        int y = a->y + (int)lround((double)i * dy / steps);
        if (!((double)p->output[y][x] > least)) {
            return false;
        }
    }
    return true;
}

/* True if a ridge connects a maximum to a higher one within reach, as image processing decides. */
static bool is_connected(const bst_generator *g, const patch *p, const maximum *found, int count,
                         int k) {
    const maximum *m = &found[k];
    int reach = (int)ceil(6.0 * g->fitted_sigma + g->streak) + 2;
    double least = fmax((double)m->snr - bst_generator_fall_of_saddle((double)m->snr),
                        bst_generator_looks_from(g));
    for (int n = 0; n < count; n++) {
        const maximum *o = &found[n];
        if (n != k && o->snr > m->snr && abs(o->x - m->x) <= reach && abs(o->y - m->y) <= reach &&
            is_ridge(p, m, o, least)) {
            return true;
        }
    }
    return false;
}

/* By how much a parabola through three values exceeds the middle one, the largest. */
static double rise(float left, float middle, float right) {
    double bend = 2.0 * (double)middle - (double)left - (double)right;
    double slope = (double)right - (double)left;
    return bend > 0.0 ? slope * slope / (8.0 * bend) : 0.0;
}

/* Keeps the false alarms on the wings of one source: maxima above the threshold that no ridge
 * connects to a higher one, such as the source. */
static void draw_about(bst_generator *g, const winged *w) {
    patch p;
    maximum found[MOST_MAXIMA];
    set_patch(w, &p);
    int count = find_maxima(&p, bst_generator_looks_from(g), found);
    double core = CORE_SIGMAS * g->fitted_sigma;
    for (int k = 0; k < count; k++) {
        int i = found[k].x, j = found[k].y, x = p.x0 + i, y = p.y0 + j;
        double snr = (double)found[k].snr +
                     rise(p.output[j][i - 1], found[k].snr, p.output[j][i + 1]) +
                     rise(p.output[j - 1][i], found[k].snr, p.output[j + 1][i]);
        if (snr <= g->filters[0].threshold || (double)p.light[j][i] < LEAST_WING || x < 0 ||
            y < 0 || x >= g->width || y >= g->height || hypot(x - w->s->x, y - w->s->y) < core ||
            is_connected(g, &p, found, count, k)) {
            continue;
        }
        bst_obsgen_generated item = {.detection = bst_false_alarms_point(g, x, y, snr, 0.0),
                                     .item = -1};
        item.detection.label = BST_LABEL_ARTEFACT;
        bst_generator_keep(g, &item);
    }
}

/* False if no source is bright enough for wings: without its wings the kernel's output is at most
 * that of the whole filter. Saves the table of outputs. */
static bool may_have_wings(const bst_generator *g) {
    double most = 0.0, from = nearest_px(g);
    for (int i = 0; i < g->source_count; i++) {
        const generator_source *s = &g->sources[i];
        most = fmax(most, s->found ? s->amplitude : 0.0);
    }
    return most * bst_response_falloff(&g->response, from, 0.0, 0.0) >= LEAST_WING;
}

bst_status bst_wing_alarms_draw(bst_ctx *ctx, bst_generator *g) {
    assert(ctx && g);
    if (!g->response.falloff.tabulated || g->smeared || !may_have_wings(g)) {
        return BST_OK;
    }
    double norm = bst_crlb_table_norm(&g->bound, 0.0) * g->norm_ratio[0];
    outputs table;
    bool any;
    set_outputs(&g->response, &table);
    BST_TRY(set_wing_sky(ctx, g, &table, norm, &any));
    for (int i = 0; i < g->source_count && any; i++) {
        winged w = {g, &g->sources[i], &table, norm};
        if (has_wings(&w)) {
            draw_about(g, &w);
        }
    }
    return BST_OK;
}
