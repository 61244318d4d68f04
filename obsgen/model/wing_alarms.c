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
/* Reach of a PSF that image processing knows, in its equivalent FWHM, and limits of it, sensor px
 * (imgproc/detect/known_psf.c). */
static const double REACH_FWHM = 2.2, LEAST_REACH_PX = 7.0, MOST_REACH_PX = 46.0;

/* Pixels about a source: half side of the patch, and of the light under its kernels. */
enum {
    RADIUS = 22,
    SIDE = 2 * RADIUS + 1,
    MOST_MAXIMA = 256,
    MOST_RADIUS = 15,
    MOST_SHIFT = 7, /* of the point outputs that the streak filter sums: half a streak */
    POINTS = SIDE + 2 * MOST_SHIFT,
    WIDE = POINTS + 2 * MOST_RADIUS,
    MOST_TAPS = 2 * (2 * MOST_SHIFT + 1),
    MOST_NODES = 32, /* of a source's path */
    PER_PX = 3,      /* of the table of outputs */
    DISTANCES = BST_FALLOFF_DISTANCES / BST_FALLOFF_PER_PX * PER_PX
};
_Static_assert(WIDE *WIDE <= 1 << PIXEL_BITS, "a pixel has its own number");
/* Longer streaks have no wing alarms: box and streak would exceed the patch. */
static const double MOST_STREAK_PX = 2.0 * MOST_SHIFT - 1.0;

/* Weighted shift of point outputs, px. */
typedef struct tap {
    int x, y;
    float weight;
} tap;

/* The filters of image processing, and the point filter's output by distance from a source at rest,
 * per electron over the pixel noise. */
typedef struct outputs {
    float kernel[MOST_RADIUS + 1][MOST_RADIUS + 1]; /* unit sum of squares; [|y|][|x|] */
    int radius;
    double sum; /* of the kernel */
    float at[DISTANCES];
    double end_px; /* last distance */
    /* streak filter: sum of shifted point outputs, of unit noise; none in frames without */
    tap taps[MOST_TAPS];
    int tap_count, shift; /* shift: largest, px */
    double tap_sum;       /* of the weights */
} outputs;

/* Place on a source's path, frame px. */
typedef struct path_node {
    double x, y;
} path_node;

/* A source and the frame in which it has wings. */
typedef struct winged {
    const bst_generator *g;
    const generator_source *s;
    const outputs *outputs;
    path_node nodes[MOST_NODES]; /* equal shares of its light */
    int node_count;
} winged;

/* Outputs of the filters about a source, SNR as image processing measures it, and the light of its
 * wings on the pixels. */
typedef struct patch {
    int x0, y0; /* frame pixel of the first output */
    float light[WIDE][WIDE], pixels[WIDE][WIDE];
    float point[POINTS][POINTS]; /* before the background is subtracted */
    float output[SIDE][SIDE];    /* larger one of the filters */
    bool streak[SIDE][SIDE];     /* it is that of the streak filter */
} patch;

typedef struct maximum {
    int x, y; /* in the patch */
    float snr;
} maximum;

/* Half side to which image processing knows the PSF, read-out px. */
static int known_reach(const bst_generator *g) {
    const bst_obsgen_image_width *w = &g->response.filter;
    double fwhm =
        g->binning * BST_FWHM_PER_SIGMA * sqrt(fmax(w->across_px * w->along_px - 1.0 / 12.0, 0.0));
    double reach = fmin(fmax(ceil(REACH_FWHM * fwhm), LEAST_REACH_PX), MOST_REACH_PX);
    return (int)fmin(ceil(reach / g->binning), MOST_RADIUS);
}

/* Sets the filter's kernel: the fitted PSF on a square. A square one pixel too wide has twice the
 * output on a wing, because its rim has light of the star's core. */
static void set_kernel(const bst_generator *g, outputs *out) {
    double square[MOST_RADIUS + 1] = {0.0}; /* sum of squares within each half side */
    int reach = known_reach(g);
    for (int v = 0; v <= reach; v++) {
        for (int u = 0; u <= reach; u++) {
            double slope, curvature,
                share = bst_response_model_share(&g->response, hypot(u, v), &slope, &curvature);
            out->kernel[v][u] = (float)share;
            square[u > v ? u : v] += share * share * (u > 0 ? 2.0 : 1.0) * (v > 0 ? 2.0 : 1.0);
        }
    }
    double all = 0.0, inside = square[0];
    for (int k = 0; k <= reach; k++) {
        all += square[k];
    }
    for (out->radius = 0; out->radius < reach && inside < (1.0 - RADIUS_SHARE) * all;) {
        inside += square[++out->radius];
    }
    out->sum = 0.0;
    for (int v = 0; v <= out->radius; v++) {
        for (int u = 0; u <= out->radius; u++) {
            out->kernel[v][u] /= (float)sqrt(inside);
            out->sum += (double)out->kernel[v][u] * (u > 0 ? 2.0 : 1.0) * (v > 0 ? 2.0 : 1.0);
        }
    }
}

/* Computes the outputs: sums of kernel and image over the kernel's pixels, in the mean of the
 * directions along the pixels and across them. */
static void set_outputs(const bst_generator *g, outputs *out) {
    const bst_response *r = &g->response;
    set_kernel(g, out);
    int radius = out->radius;
    out->end_px = (DISTANCES - 1.0) / PER_PX / r->image_scale - radius;
    for (int n = 0; n < DISTANCES; n++) {
        double away = (double)n / PER_PX, sum = 0.0;
        for (int turned = 0; turned < 2 && away <= out->end_px + 1.0; turned++) {
            double x = turned ? sqrt(0.5) * away : away, y = turned ? x : 0.0;
            for (int v = -radius; v <= radius; v++) {
                for (int u = -radius; u <= radius; u++) {
                    sum += (double)out->kernel[abs(v)][abs(u)] *
                           bst_response_image_share(r, hypot(x - u, y - v));
                }
            }
        }
        out->at[n] = (float)(0.5 * sum);
    }
}

/* Covariance of the point filter's noise at two pixels. */
static double point_covariance(const outputs *f, int x, int y) {
    int r = f->radius;
    double sum = 0.0;
    for (int v = -r; v <= r; v++) {
        for (int u = -r; u <= r; u++) {
            int i = abs(u + x), j = abs(v + y);
            sum += i <= r && j <= r ? (double)(f->kernel[abs(v)][abs(u)] * f->kernel[j][i]) : 0.0;
        }
    }
    return sum;
}

/* Sets the shifts of the streak filter as image processing lays them out: one place per pixel along
 * the longer axis, shared by the two nearest pixels across (imgproc/detect/filter_kernel.c). */
static void set_taps(const bst_generator *g, outputs *out) {
    out->tap_count = out->shift = 0;
    out->tap_sum = 0.0;
    double dx = 0.5 * round(2.0 * g->star_path.dx), dy = 0.5 * round(2.0 * g->star_path.dy);
    bool along_x = fabs(dx) >= fabs(dy);
    double major = along_x ? dx : dy, minor = along_x ? dy : dx, half = 0.5 * fabs(major);
    if (!(g->streak > 0.0) || half == 0.0) {
        return;
    }
    for (int j = -(int)ceil(half + 0.5); j <= (int)ceil(half + 0.5); j++) {
        double lo = fmax(j - 0.5, -half), hi = fmin(j + 0.5, half);
        double across = 0.5 * (lo + hi) * minor / major, base = floor(across);
        for (int k = 0; k < 2 && hi > lo; k++) {
            double weight = (hi - lo) * (k ? across - base : 1.0 - across + base);
            int m = (int)base + k;
            if (weight > 0.0) {
                assert(out->tap_count < MOST_TAPS && abs(j) <= MOST_SHIFT && abs(m) <= MOST_SHIFT);
                out->taps[out->tap_count++] =
                    (tap){along_x ? j : m, along_x ? m : j, (float)weight};
                out->shift = abs(j) > out->shift ? abs(j) : out->shift;
                out->shift = abs(m) > out->shift ? abs(m) : out->shift;
            }
        }
    }
    double variance = 0.0;
    for (int a = 0; a < out->tap_count; a++) {
        for (int b = 0; b < out->tap_count; b++) {
            const tap *p = &out->taps[a], *q = &out->taps[b];
            variance +=
                (double)(p->weight * q->weight) * point_covariance(out, p->x - q->x, p->y - q->y);
        }
    }
    for (int a = 0; a < out->tap_count; a++) {
        out->taps[a].weight /= (float)sqrt(variance);
        out->tap_sum += (double)out->taps[a].weight;
    }
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

/* Output of the point filter caused by a source at rest at a distance within the table. */
static double wing_output(const winged *w, double distance_px) {
    return w->s->flux_e / w->g->noise_e * table_at(w->outputs->at, distance_px);
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

/* Lays out a source's path: uniform, or the true one if that is far from uniform. */
static void set_nodes(winged *w) {
    const bst_generator *g = w->g;
    const generator_source *s = w->s;
    if (g->uneven) {
        bst_star_trail_path path = bst_generator_object_path(g, s);
        w->node_count = path.count < MOST_NODES ? path.count : MOST_NODES;
        for (int k = 0; k < w->node_count; k++) {
            int at = (int)((k + 0.5) / w->node_count * path.count);
            w->nodes[k] = (path_node){s->x + g->object_x[at], s->y + g->object_y[at]};
        }
        return;
    }
    w->node_count = (int)fmin(fmax(ceil(s->length), 1.0), MOST_NODES);
    for (int k = 0; k < w->node_count; k++) {
        double u = (k + 0.5) / w->node_count - 0.5;
        w->nodes[k] = (path_node){s->x + u * s->path.dx, s->y + u * s->path.dy};
    }
}

/* Distance of a pixel from a source's path, px. */
static double path_distance(const winged *w, double x, double y) {
    double least = INFINITY;
    for (int k = 0; k < w->node_count; k++) {
        least = fmin(least, hypot(x - w->nodes[k].x, y - w->nodes[k].y));
    }
    return least;
}

static bool has_wings(const winged *w) {
    double from = nearest_px(w->g);
    return w->s->found && table_end_px(w) > from && wing_output(w, from) >= LEAST_WING;
}

/* Adds the wings of all bright sources to the background by mesh; *any: false if there are none. */
static bst_status set_wing_sky(bst_ctx *ctx, bst_generator *g, const outputs *table, bool *any) {
    *any = false;
    for (int i = 0; i < g->source_count; i++) {
        const generator_source *s = &g->sources[i];
        winged w = {.g = g, .s = s, .outputs = table};
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
        bst_local_sky_settle_wings(&g->wing_sky, g->excess / g->noise_e);
    }
    return BST_OK;
}

/* Share of the noise variance of a dark pixel that is of counted electrons. */
static double counted_share(const bst_generator *g) {
    const bst_camera *c = g->camera;
    double read_e = bst_camera_read_noise_e(c);
    double normal = read_e * read_e + c->gain_e_per_dn * c->gain_e_per_dn / 12.0;
    return fmax(1.0 - normal / (g->noise_e * g->noise_e), 0.0);
}

double bst_wing_alarms_cube(double excess) {
    double part = sqrt(excess - 1.0);
    return 1.0 + part * part * (3.0 + 2.0 * part);
}

double bst_wing_alarms_noise(const bst_wing_noise *noise, double light, double z) {
    double shot = light / noise->noise_e, cube = bst_wing_alarms_cube(noise->excess);
    double variance = 1.0 + noise->excess * shot;
    double third = (cube / noise->excess * noise->counted + cube * shot) / noise->noise_e;
    return sqrt(variance) * z + third / (6.0 * variance) * (z * z - 1.0);
}

/* Draws the pixels under the filters of a patch, in pixel noises: light of the source, its shot
 * noise, noise of the background. */
static void draw_pixels(const winged *w, patch *p) {
    const bst_generator *g = w->g;
    int before = w->outputs->radius + w->outputs->shift, side = SIDE + 2 * before;
    uint64_t first = WING_ALARM | w->s->name << PIXEL_BITS;
    const bst_wing_noise noise = {g->noise_e, counted_share(g), g->excess};
    for (int j = 0; j < side; j++) {
        for (int i = 0; i < side; i++) {
            double x = p->x0 + i - before, y = p->y0 + j - before, light = 0.0;
            for (int k = 0; k < w->node_count; k++) {
                light += wing_light(w, hypot(x - w->nodes[k].x, y - w->nodes[k].y));
            }
            light /= w->node_count;
            double z =
                bst_rng_normal(g->key, (uint64_t)g->exposure_id, first + (uint64_t)(j * WIDE + i));
            p->light[j][i] = (float)light;
            p->pixels[j][i] = (float)(light + bst_wing_alarms_noise(&noise, light, z));
        }
    }
}

/* Sum of pixels under the point filter for `count` outputs of a row. */
static void filter_row(const outputs *f, float pixels[WIDE][WIDE], int x, int y, int count,
                       float *out) {
    int r = f->radius;
    for (int i = 0; i < count; i++) {
        out[i] = 0.0f;
    }
    for (int v = 0; v <= 2 * r; v++) {
        for (int u = 0; u <= 2 * r; u++) {
            float weight = f->kernel[abs(v - r)][abs(u - r)];
            const float *from = &pixels[y + v][x + u];
            for (int i = 0; i < count; i++) {
                out[i] += weight * from[i];
            }
        }
    }
}

/* Sets the outputs about a source less the background of the mesh, over the noise that image
 * processing measures. */
static void set_patch(const winged *w, patch *p) {
    const bst_generator *g = w->g;
    const outputs *f = w->outputs;
    int shift = f->shift, side = SIDE + 2 * shift;
    p->x0 = (int)lround(w->s->x) - RADIUS;
    p->y0 = (int)lround(w->s->y) - RADIUS;
    draw_pixels(w, p);
    for (int j = 0; j < side; j++) {
        filter_row(f, p->pixels, 0, j, side, p->point[j]);
    }
    for (int j = 0; j < SIDE; j++) {
        for (int i = 0; i < SIDE; i++) {
            double level, noise;
            bst_local_sky_at(&g->wing_sky, p->x0 + i, p->y0 + j, &level, &noise);
            double point = (double)p->point[j + shift][i + shift] - f->sum * level, streak = 0.0;
            for (int k = 0; k < f->tap_count; k++) {
                const tap *t = &f->taps[k];
                streak += (double)(t->weight * p->point[j + shift + t->y][i + shift + t->x]);
            }
            streak -= f->tap_sum * f->sum * level;
            p->streak[j][i] = f->tap_count > 0 && streak > point;
            p->output[j][i] = (float)((p->streak[j][i] ? streak : point) / noise);
        }
    }
}

/* Output of the point filter at a pixel of the patch by the wings' light alone. */
static double light_output(const winged *w, patch *p, int i, int j) {
    double level, noise;
    float sum;
    bst_local_sky_at(&w->g->wing_sky, p->x0 + i, p->y0 + j, &level, &noise);
    filter_row(w->outputs, p->light, i + w->outputs->shift, j + w->outputs->shift, 1, &sum);
    return ((double)sum - w->outputs->sum * level) / noise;
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
static void draw_about(bst_generator *g, winged *w) {
    patch p;
    maximum found[MOST_MAXIMA];
    set_nodes(w);
    set_patch(w, &p);
    int count = find_maxima(&p, bst_generator_looks_from(g), found);
    double core = CORE_SIGMAS * g->fitted_sigma;
    for (int k = 0; k < count; k++) {
        int i = found[k].x, j = found[k].y, x = p.x0 + i, y = p.y0 + j;
        bool streak = p.streak[j][i];
        double snr = (double)found[k].snr +
                     rise(p.output[j][i - 1], found[k].snr, p.output[j][i + 1]) +
                     rise(p.output[j - 1][i], found[k].snr, p.output[j + 1][i]);
        if (snr <= g->filters[streak].threshold || x < 0 || y < 0 || x >= g->width ||
            y >= g->height || path_distance(w, x, y) < core ||
            light_output(w, &p, i, j) < LEAST_WING || is_connected(g, &p, found, count, k)) {
            continue;
        }
        bst_obsgen_generated item = {
            .detection = bst_false_alarms_point(g, x, y, snr, streak ? g->streak : 0.0),
            .item = -1,
            .drawn = streak};
        item.detection.label = BST_LABEL_ARTEFACT;
        bst_generator_keep(g, &item);
    }
}

/* False if no source is bright enough for wings: without its wings the kernel's output is at most
 * that of the whole filter. Saves the table of outputs. */
static bool may_have_wings(const bst_generator *g) {
    double most_e = 0.0, from = nearest_px(g);
    for (int i = 0; i < g->source_count; i++) {
        const generator_source *s = &g->sources[i];
        most_e = fmax(most_e, s->found ? s->flux_e : 0.0);
    }
    return most_e / g->noise_e * bst_crlb_table_norm(&g->bound, 0.0) *
               bst_response_falloff(&g->response, from, 0.0, 0.0) >=
           LEAST_WING;
}

bst_status bst_wing_alarms_draw(bst_ctx *ctx, bst_generator *g) {
    assert(ctx && g);
    if (!g->response.falloff.tabulated || g->smeared || g->streak > MOST_STREAK_PX ||
        !may_have_wings(g)) {
        return BST_OK;
    }
    outputs table;
    bool any;
    set_outputs(g, &table);
    set_taps(g, &table);
    BST_TRY(set_wing_sky(ctx, g, &table, &any));
    for (int i = 0; i < g->source_count && any; i++) {
        winged w = {.g = g, .s = &g->sources[i], .outputs = &table};
        if (has_wings(&w)) {
            draw_about(g, &w);
        }
    }
    return BST_OK;
}
