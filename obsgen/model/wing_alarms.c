#include "obsgen/model/wing_alarms.h"

#include <assert.h>
#include <math.h>

#include "obsgen/generator_internal.h"
#include "obsgen/model/false_alarms.h"

/* Random stream, beyond those of sources, whose numbers have 33 bits. */
static const uint64_t WING_ALARM = (uint64_t)1 << 42;
/* Wing light below LEAST_WING (SNR) causes a negligible number of false alarms; the law of rare
 * maxima holds above LEAST_OUTPUT. */
static const double LEAST_WING = 0.3, LEAST_OUTPUT = 1.5;
/* Number of independent noise values between two adjacent maxima. */
static const double WAY_PLACES = 2.0;
/* Wing light per pixel, in pixel noises, that no longer adds to the background of a mesh. */
static const double LEAST_LIGHT = 0.01;
/* Half distance of the difference that is the slope of wing light, px. */
static const double SLOPE_PX = 0.5;

/* A source and the frame in which it has wings. */
typedef struct winged {
    const bst_generator *g;
    const generator_source *s;
    double norm; /* sqrt(sum k^2) of the point filter's image k of unit sum */
} winged;

/* Output and noise of the filter on wing light, SNR, relative to open sky. */
typedef struct wing_place {
    double light; /* without the background that image processing subtracts */
    double noise;
    double estimated; /* noise that image processing divides by */
    double slope;     /* of the light per px, along the distance */
    double nearer;    /* light at the next place of independent noise towards the source */
} wing_place;

/* Farthest distance of the tabulated falloff, px. */
static double table_end_px(const bst_generator *g) {
    return (BST_FALLOFF_DISTANCES - 1.0) / BST_FALLOFF_PER_PX / g->response.falloff_scale;
}

/* Filter output caused by a source's wings at a distance. Image and filter have equal wings, whose
 * correlation is the sum of both; but image processing's kernel is truncated, hence half. */
static double wing_output(const winged *w, double distance_px) {
    return 0.5 * w->s->amplitude * bst_response_falloff(&w->g->response, distance_px, 0.0, 0.0);
}

/* Wing light per pixel, in pixel noises (callback). Wings change little over the filter's image,
 * whose output for even light is that over the norm. Beyond the table they decrease with the third
 * power of the distance, as those of an aperture with an edge do. */
static double wing_light(const void *user, double distance_px) {
    const winged *w = user;
    double end = table_end_px(w->g) - 1.0;
    double beyond = fmin(end / distance_px, 1.0);
    return w->norm * wing_output(w, fmin(distance_px, end)) * beyond * beyond * beyond;
}

/* Half side of the box about a source in which a false alarm is connected to it by its flank, px:
 * image processing compares maxima within it. */
static double nearest_px(const bst_generator *g) {
    return ceil(6.0 * g->fitted_sigma + g->streak) + 2.5;
}

static bool has_wings(const winged *w) {
    double from = nearest_px(w->g);
    return w->s->found && table_end_px(w->g) > from && wing_output(w, from) >= LEAST_WING;
}

/* Adds the wings of all bright sources to the background by mesh; *any: false if there are none. */
static bst_status set_wing_sky(bst_ctx *ctx, bst_generator *g, double norm, bool *any) {
    *any = false;
    for (int i = 0; i < g->source_count; i++) {
        const generator_source *s = &g->sources[i];
        winged w = {g, s, norm};
        if (!has_wings(&w)) {
            continue;
        }
        if (!*any) {
            BST_TRY(bst_local_sky_begin(ctx, &g->wing_sky, g->width, g->height, g->settings.mesh_px,
                                        g->total_sigma));
        }
        *any = true;
        double end = table_end_px(g) - 1.0;
        double reach = fmax(end * cbrt(wing_light(&w, end) / LEAST_LIGHT), nearest_px(g));
        bst_local_sky_add_wings(&g->wing_sky, s->x, s->y, reach, wing_light, &w);
    }
    if (*any) {
        bst_local_sky_settle(&g->wing_sky, 1.0, 1.0);
    }
    return BST_OK;
}

static wing_place place_at(const winged *w, double x, double y, double distance_px) {
    double level, noise, raw = wing_output(w, distance_px);
    bst_local_sky_at(&w->g->wing_sky, x, y, &level, &noise);
    double taken = level / w->norm;
    return (wing_place){
        .light = raw - taken,
        .noise = sqrt(1.0 + raw * w->norm / w->g->noise_e),
        .estimated = noise,
        .slope = wing_output(w, distance_px + SLOPE_PX) - wing_output(w, distance_px - SLOPE_PX),
        .nearer = wing_output(w, distance_px - w->g->cross_sigma) - taken};
}

/* Distance of the threshold from the mean output on wing light, in its noise. */
static double margin_of(const bst_generator *g, const wing_place *p) {
    return (g->filters[0].threshold * p->estimated - p->light) / p->noise;
}

/* Additional false alarms per noise maximum on wing light. A maximum must exceed the threshold, and
 * the path to a higher maximum nearby, which leads towards the source, must drop below the
 * interpolation limit of image processing.
 * At a maximum the gradient of the noise cancels that of the light; it is independent of the noise
 * itself and normal, with the variance 1 / 2 sigma^2 per axis for the filter's Gaussian (Adler
 * 1981, The Geometry of Random Fields, 6.3). */
static double wing_gain(const bst_generator *g, const wing_place *p) {
    double t = g->filters[0].threshold, u = fmax(margin_of(g, p), LEAST_OUTPUT);
    double floor = bst_generator_looks_from(g) * p->estimated;
    double above = 0.5 * erfc((floor - p->nearer) / (p->noise * sqrt(2.0)));
    double alone = 1.0 - pow(above, WAY_PLACES);
    double steep = g->response.maxima_sigma_px * p->slope / p->noise;
    return fmax(alone * u / t * exp(0.5 * (t * t - u * u) - steep * steep) - 1.0, 0.0);
}

/* Keeps a false alarm at a place on wing light; draw: number of its random draw. */
static void keep_alarm(bst_generator *g, const wing_place *p, double x, double y, uint64_t draw) {
    double least = fmax(margin_of(g, p), 0.0), energy = -log(bst_generator_uniform(g, draw));
    double above = sqrt(least * least + 2.0 * energy) - least;
    double snr = g->filters[0].threshold + p->noise / p->estimated * above;
    bst_obsgen_generated item = {.detection = bst_false_alarms_point(g, x, y, snr, 0.0),
                                 .item = -1};
    item.detection.label = BST_LABEL_ARTEFACT;
    bst_generator_keep(g, &item);
}

/* Draws false alarms on the wings of one source. Near the source none occur: it is the higher
 * maximum, connected by its flank. */
static void draw_about(bst_generator *g, const winged *w, double per_px) {
    enum { RINGS = 32, SECTORS = 8 };
    const generator_source *s = w->s;
    double from = nearest_px(g), step = (table_end_px(g) - from) / RINGS;
    uint64_t draw = WING_ALARM | s->name << 8;
    double arrival = -log(bst_generator_uniform(g, draw++));
    for (int i = 0; i < RINGS * SECTORS; i++) {
        double r = from + (i / SECTORS + 0.5) * step;
        double angle = 2.0 * BST_PI / SECTORS * (i % SECTORS + 0.5);
        wing_place p = place_at(w, s->x + r * cos(angle), s->y + r * sin(angle), r);
        if (!(p.light > 0.0)) {
            continue;
        }
        arrival -= per_px * wing_gain(g, &p) * 2.0 * BST_PI / SECTORS * r * step;
        while (arrival < 0.0) {
            double turn = angle + 2.0 * BST_PI / SECTORS * (bst_generator_uniform(g, draw) - 0.5);
            double x = s->x + r * cos(turn), y = s->y + r * sin(turn);
            arrival -= log(bst_generator_uniform(g, draw + 2));
            bool apart = fmax(fabs(x - s->x), fabs(y - s->y)) > from;
            if (apart && x > -0.5 && y > -0.5 && x < g->width - 0.5 && y < g->height - 0.5) {
                keep_alarm(g, &p, x, y, draw + 1);
            }
            draw += 3;
        }
    }
}

bst_status bst_wing_alarms_draw(bst_ctx *ctx, bst_generator *g, double per_px) {
    assert(ctx && g && per_px >= 0.0);
    if (!g->response.falloff.tabulated || g->smeared) {
        return BST_OK;
    }
    double norm = bst_crlb_table_norm(&g->bound, 0.0) * g->norm_ratio[0];
    bool any;
    BST_TRY(set_wing_sky(ctx, g, norm, &any));
    for (int i = 0; i < g->source_count && any; i++) {
        winged w = {g, &g->sources[i], norm};
        if (has_wings(&w)) {
            draw_about(g, &w, per_px);
        }
    }
    return BST_OK;
}
