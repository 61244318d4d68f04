#include "scenegen/scene_plan.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>

#include "scenegen/source_order.h"
#include "sim/world/scene/skylight.h"

_Static_assert(BST_SPECTRA == (int)BST_PSF_SPECTRA, "the deposit kernel's shares are the PSF's");

void bst_scene_plan_clear(bst_scene_plan *p) {
    free(p->sources);
    free(p->list);
    free(p->results);
    free(p->shares);
    free(p->peak_e);
    bst_error_meeting_free(p->meeting);
    *p = (bst_scene_plan){.count = 0};
}

static bst_status reserve(bst_ctx *ctx, bst_scene_plan *p, int count, bool coloured, bool threads) {
    if (count <= p->capacity) {
        return BST_OK;
    }
    size_t capacity = (size_t)(count > 2 * p->capacity ? count : 2 * p->capacity);
    bst_scene_plan_clear(p);
    p->sources = malloc(capacity * sizeof *p->sources);
    p->list = malloc(capacity * sizeof *p->list);
    p->peak_e = malloc(capacity * sizeof *p->peak_e);
    p->shares = coloured ? malloc(capacity * sizeof *p->shares) : NULL;
    p->results = threads ? malloc(capacity * sizeof *p->results) : NULL;
    if (!p->sources || !p->list || !p->peak_e || (coloured && !p->shares) ||
        (threads && !p->results)) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for %d sources", count);
    }
    p->capacity = (int)capacity;
    return BST_OK;
}

/* Sorts the rendered sources and counts their blocks and boxes. Before this, first_box is the
 * source's index in the request. */
static void put_in_order(bst_scene_plan *p, const bst_camera *camera, const bst_scene_source *all) {
    bst_source_order(camera, p->list, p->count, p->sources);
    p->blocks = p->boxes = 0;
    for (int i = 0; i < p->count; i++) {
        bst_kernel_source_record *s = &p->sources[i];
        for (int k = 0; p->shares && k < BST_SPECTRA; k++) {
            p->shares[i][k] = (float)bst_psf_share(all[s->first_box].colour, k);
        }
        s->first_box = p->boxes;
        s->first = p->blocks;
        p->blocks += s->blocks;
        p->boxes += s->blocks > 1 ? (s->blocks + BST_BLOCK - 1) / BST_BLOCK : 0;
    }
}

/* Input and error sums of one planning run. */
typedef struct planning {
    bst_smear *smear;
    bst_error_budget *budget;
    const bst_fourier_render *fourier;
    const bst_render_request *request;
    double dark_e2;
    double duration_s;
    double beyond; /* light per pixel from a source beyond the margin, s */
    int blocks;    /* largest number */
    int64_t max_nodes;
    bool fine; /* use the finer grid */
    /* largest grid error, alone and with what the widening kernel differs by */
    double grid_sigma, widened_sigma;
} planning;

/* Sum of two errors of a source, with maxima on different pixels: a share of the lesser adds to the
 * greater, as for two sources in error_budget.c. Validated by tests/scenegen/test_tolerance_sweep.c
 * (slow). */
static float sum_of(double a, double b) {
    static const double REST = 0.4;
    return (float)(fmax(a, b) + REST * fmin(a, b));
}

/* Adds a rendered source's error to the frame's budget. */
static bst_status add_error(bst_ctx *ctx, planning *m, const bst_scene_source *source) {
    bst_error_budget_source error = *bst_smear_last_error(m->smear);
    if (source->rate && source->rate->error > 0.0) { /* glints that the light curve lacks */
        float glints_e = (float)(source->rate->error * (double)error.peak_e);
        error.nodes_e += glints_e;
        error.predicted_e += glints_e;
    }
    if (m->fourier) { /* error of grid and widening, on dark pixels too */
        double presence = bst_smear_last_presence(m->smear),
               noise_e = sqrt((double)error.peak_e + m->dark_e2);
        bst_fourier_point point = {
            .electrons = source->electrons_per_s * m->duration_s,
            .peak_e = bst_smear_last_read_e(m->smear),
            .dark_variance_e2 = m->dark_e2,
            .gap_px = presence < 1.0 ? bst_smear_last_gap_px(m->smear) : 0.0};
        if (point.gap_px > 0.0) { /* of the whole path */
            point.peak_e = point.electrons * bst_fourier_render_band(m->fourier)->peak;
        }
        bst_window window = m->request->window;
        double grid = bst_fourier_render_error_sigma(m->fourier, m->fine, window, &point);
        error.nodes_e = sum_of((double)error.nodes_e, grid * noise_e);
        m->grid_sigma = fmax(m->grid_sigma, grid);
        point.widening_px2 = bst_smear_last_widening_px2(m->smear);
        if (point.widening_px2 > 0.0) {
            grid = bst_fourier_render_error_sigma(m->fourier, m->fine, window, &point);
        }
        error.predicted_e = sum_of((double)error.predicted_e, grid * noise_e);
        error.grid_e = (float)(grid * noise_e);
        m->widened_sigma = fmax(m->widened_sigma, grid);
        const float *colour = source->colour;
        if (colour[0] != 0.0F || colour[1] != 0.0F || colour[2] != 0.0F) {
            error.excess_e +=
                (float)(presence * bst_fourier_render_mixing_error(m->fourier) * point.peak_e);
        }
    }
    return bst_error_budget_add(ctx, m->budget, &error);
}

/* Chooses nodes and stamps of all sources. *fits: false if they need more blocks than allowed; the
 * plan is then unusable. */
static bst_status plan_sources(bst_ctx *ctx, bst_scene_plan *p, planning *m, bool *fits) {
    const bst_render_request *q = m->request;
    bst_error_budget_motion motion = bst_smear_motion(m->smear);
    bst_error_budget_begin(m->budget, &motion);
    p->count = p->blocks = 0;
    m->grid_sigma = m->widened_sigma = 0.0;
    *fits = true;
    if (p->results) {
        BST_TRY(bst_smear_sources(ctx, m->smear, q->sources, q->count, p->results));
    }
    for (int i = 0; i < q->count && *fits; i++) {
        bst_kernel_source_record *s = &p->list[p->count];
        bool visible;
        if (p->results && p->results[i].known) {
            bst_smear_recall(m->smear, &p->results[i], s, &visible);
        } else {
            BST_TRY(bst_smear_source(ctx, m->smear, &q->sources[i], s, &visible));
        }
        p->peak_e[i] = bst_smear_last_peak_e(m->smear);
        if (m->fourier && !q->sources[i].occulted && bst_smear_last_leaves(m->smear)) {
            bst_error_budget_miss(m->budget, m->beyond * q->sources[i].electrons_per_s);
        }
        if (!visible) {
            continue;
        }
        *fits = s->blocks <= m->blocks - p->blocks;
        p->blocks += *fits ? s->blocks : 0;
        s->first_box = i;
        p->count++;
        if (m->fourier) {
            bst_fourier_render_stamp(m->fourier, s);
        }
        BST_TRY(add_error(ctx, m, &q->sources[i]));
    }
    return BST_OK;
}

/* Blocks for a number of nodes plus one per source, within the limit. */
static int blocks_of(int64_t nodes, int sources, int most_blocks) {
    int64_t blocks = nodes / BST_BLOCK + sources;
    return (int)(blocks < most_blocks ? blocks : most_blocks);
}

/* Share of the tolerance at which the planning starts. In crowded frames errors of neighbouring
 * stars add up; starting at about half the tolerance avoids a second planning. */
static double first_aim(const bst_render_request *q) {
    enum { CROWD = 500 };
    static const double CROWD_AIM = 0.45;
    return q->count > CROWD ? CROWD_AIM : 1.0;
}

/* Repeats the planning until the predicted error is within the tolerance: with a smaller share of
 * it each time, or, if there are too many nodes, a larger one. */
static bst_status plan_to_tolerance(bst_ctx *ctx, bst_scene_plan *p, planning *m, double tolerance,
                                    int most_blocks) {
    enum { ROUNDS = 8, TOO_MANY = 20000 };
    /* LESS: factor below the predicted share. GAIN: improvement that a round must bring, because
     * levels of detail go by factors of two. GRID_SHARE: share of the tolerance above which a finer
     * grid pays. */
    static const double LESS = 0.97, GAIN = 0.98, MOST_STEP = 0.2, LEAST_STEP = 0.85,
                        GRID_SHARE = 0.25, IDLE_STEP = 0.6, COARSER = 16.0, COARSEST = 1e9;
    p->bounded = false;
    m->blocks = blocks_of(m->max_nodes, m->request->count, most_blocks);
    double aim = first_aim(m->request), before = INFINITY;
    bool fits, coarse = false;
    bst_smear_restart(m->smear, aim);
    BST_TRY(plan_sources(ctx, p, m, &fits));
    if (!fits) { /* crowds along the paths of a slew, which no tolerance shortens */
        coarse = p->bounded = true;
        m->blocks = blocks_of(BST_SCENE_SLEW * m->max_nodes, m->request->count, most_blocks);
        bst_smear_restart(m->smear, aim);
        BST_TRY(plan_sources(ctx, p, m, &fits));
    }
    for (; !fits && aim < COARSEST; aim *= COARSER) {
        bst_smear_restart(m->smear, COARSER * aim);
        BST_TRY(plan_sources(ctx, p, m, &fits));
    }
    if (!fits) {
        return bst_fail(
            ctx, BST_ERR_RANGE,
            "the sources move too far in one exposure to be drawn: %d of %d need %.0f "
            "million points already, %.3g million are allowed; expose for a shorter "
            "time, turn more slowly, draw fewer stars (star_limit_v_mag), or allow more points "
            "(fidelity.max_nodes) if the device has the memory",
            p->count, m->request->count, 1e-6 * BST_BLOCK * p->blocks,
            1e-6 * BST_BLOCK * m->blocks);
    }
    /* the error budget of very many sources takes as long as rendering; it is then computed only on
     * request */
    coarse = coarse || m->request->count > TOO_MANY;
    for (int round = 0, idle = 0; round < ROUNDS && idle < 2 && !coarse; round++) {
        /* the bound, so that images do not change with the prediction if it is within it */
        double bound = bst_error_budget_bound_sigma(m->budget), last = aim;
        double error = fmax(bound, bst_error_budget_error_sigma(m->budget));
        if (error <= tolerance) {
            break;
        }
        double grid = bound <= tolerance ? m->widened_sigma : m->grid_sigma;
        idle = error > GAIN * before ? idle + 1 : 0;
        before = error;
        if (m->fourier && !m->fine && grid > GRID_SHARE * tolerance) {
            m->fine = true;
            bst_smear_refine_grid(m->smear, bst_fourier_render_density(m->fourier, true));
        } else {
            /* a round without a gain: the next one must reach another level */
            aim *= fmin(fmax(LESS * tolerance / error, MOST_STEP), idle ? IDLE_STEP : LEAST_STEP);
        }
        bst_smear_restart(m->smear, aim);
        BST_TRY(plan_sources(ctx, p, m, &fits));
        if (!fits) { /* restore the previous plan */
            p->bounded = true;
            bst_smear_restart(m->smear, last);
            return plan_sources(ctx, p, m, &fits);
        }
    }
    return BST_OK;
}

bst_status bst_scene_plan_make(bst_ctx *ctx, bst_scene_plan *p, const bst_camera *camera,
                               bst_smear *smear, bst_error_budget *budget,
                               bst_fourier_render *fourier, const bst_scene_plan_limits *limits,
                               const bst_render_request *q) {
    assert(p && camera && smear && budget && limits && q && q->count >= 0);
    double read = camera->read_noise_e, brightest = 0.0;
    bool coloured = fourier && bst_fourier_render_spectra(fourier) > 1;
    BST_TRY(reserve(ctx, p, q->count, coloured, bst_smear_has_threads(smear)));
    for (int i = 0; i < q->count; i++) {
        /* few sources are brighter than all before: of the others only one member is read */
        const bst_scene_source *source = &q->sources[i];
        if (source->electrons_per_s > brightest && !source->path && !source->ghost) {
            brightest = source->electrons_per_s; /* a source on the stars' track */
        }
    }
    double least_e = q->background_e + (q->background ? q->background->least_e : 0.0);
    int binning = q->binning > 1 ? q->binning : 1;
    double dark_e2 = fmax(binning * binning * least_e + read * read, 1e-2);
    bst_smear_frame frame = {.track = q->track,
                             .window = q->window,
                             .margin_px = limits->margin_px,
                             .binning = binning,
                             .sources = q->count,
                             .dark_variance_e2 = dark_e2,
                             .brightest_e_per_s = brightest,
                             .list = q->sources,
                             .aim = first_aim(q)};
    BST_TRY(bst_smear_begin(ctx, smear, &frame));
    if (fourier) {
        BST_TRY(bst_fourier_render_begin(ctx, fourier, binning));
    }
    planning m = {.smear = smear,
                  .budget = budget,
                  .fourier = fourier,
                  .request = q,
                  .dark_e2 = dark_e2,
                  .max_nodes = limits->nodes > 0 ? limits->nodes : BST_SCENE_MOST_NODES,
                  .duration_s = q->track->time_s[q->track->count - 1],
                  .beyond = fourier ? bst_fourier_render_band(fourier)->beyond * binning * binning *
                                          q->track->time_s[q->track->count - 1]
                                    : 0.0};
    /* limit of the kernels' int indices */
    const uint64_t counted = (uint64_t)INT32_MAX * sizeof(float);
    uint64_t most = limits->bytes < counted ? limits->bytes : counted;
    /* two blocks occupy a whole group of boxes */
    int most_blocks = (int)(most / (BST_BLOCK / 2 * BST_BOX_BYTES));
    BST_TRY(plan_to_tolerance(ctx, p, &m, limits->tolerance_sigma, most_blocks));
    p->fine = m.fine;
    p->binning = binning;
    p->gaussian = !fourier;
    p->distorted = bst_camera_distorted(camera);
    put_in_order(p, camera, q->sources);
    return BST_OK;
}

double bst_scene_plan_error_sigma(bst_scene_plan *p, const bst_smear *smear,
                                  bst_error_budget *budget) {
    assert(p && smear && budget);
    if (p->distorted) { /* the table's places are without distortion */
        return bst_error_budget_error_sigma(budget);
    }
    int blocks;
    const bst_error_meeting_paths paths = {.sources = p->list,
                                           .table = bst_smear_table(smear, &blocks),
                                           .binning = p->binning,
                                           .gaussian = p->gaussian};
    return bst_error_meeting_sigma(&p->meeting, budget, &paths);
}
