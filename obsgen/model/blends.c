#include <assert.h>
#include <math.h>
#include <stdlib.h>

#include "boresight/vec.h"
#include "obsgen/generator_internal.h"

/* Sources below this share of the threshold are not detected; they only contribute light. At a
 * threshold of 5, noise lifts a source of 0.3 above it with a probability of Q(3.5) = 2e-4. */
static const double FAINTEST_SHARE = 0.3;
/* Design choices for merged streaks. FLATTEST: largest error factor of a position on a flat peak.
 * MERGED_CENTROID: standard deviation along a streak, in PSF sigmas, from which the position is
 * drawn from the filter output, whose peak is no parabola there. LEAST_NOISE, MOST_NOISE: limits of
 * the output noise relative to white noise, for calibrations far from theory. Half or twice each
 * changes the RMS of positions by less than 2 % and no Pd: calibrate-obsgen --check of scene 1 of
 * tests/e2e/random_scenes.py --seed 2026 (crowded, streaks of 12 px). */
static const double FLATTEST = 6.0;
static const double MERGED_CENTROID = 0.2, LEAST_NOISE = 0.7, MOST_NOISE = 1.6;
/* Calibrated factors of streak errors at this SNR have no selection by noise any more: at a
 * threshold of 5, Pd is 1 - 3e-7. */
static const double UNLIFTED_SNR = 10.0;
/* LEAST_LIGHT: light of this SNR changes a Pd by at most 0.01 / sqrt(2 pi) = 0.004. LEAST_ON_FLANK:
 * light on a maximum's flank of a tenth of the saddle's depth, 3 sigma, decides nothing. */
static const double LEAST_LIGHT = 0.01, LEAST_ON_FLANK = 0.3;
/* Light of other sources is looked for to this distance, besides their streaks: there the filter
 * output of a point is exp(-6^2 / 4) = 1e-4 of its maximum. */
static const double REACH_SIGMAS = 6.0;
/* Half side of the stamp that images fit, as REACH_SIGMAS, LEAST_REACH_PX and FREE_OUTSIDE_PX of
 * imgproc/measure/deblend.c. */
static const double STAMP_SIGMAS = 3.6, LEAST_STAMP_PX = 3.0, FREE_OUTSIDE_PX = 1.5;
/* A streak that exceeds the image of the detection by more than this is added in pieces: a shorter
 * one has its light at one distance to 1 px. */
static const double ONE_PIECE_PX = 2.0;
/* Least part of a source that a joint fit determines. Separate sources are SAME_FWHM of
 * imgproc/measure/deblend.c apart: their overlap is at most exp(-1 / 2), and 1 - exp(-1) = 0.63 is
 * left. The limit is for streaks in line. */
static const double LEAST_OWN = 0.1;
/* A path shorter than this adds less than a tenth to the variance of the image, L^2 / 12 < sigma^2
 * / 10: a point's. */
static const double SHORT_SIGMAS = 1.1;
/* Random stream of such streaks. */
static const uint64_t CENTROID_ERROR = (uint64_t)1 << 52;

double bst_generator_overlap(const bst_generator *g, const generator_source *a,
                             const generator_source *b) {
    double dx = b->x - a->x, dy = b->y - a->y;
    double c = a->length > 0.0 ? a->path.dx / a->length : 1.0;
    double s = a->length > 0.0 ? a->path.dy / a->length : 0.0;
    double length = a->as_streak ? g->streak : a->length;
    return bst_response_falloff(&g->response, dx * c + dy * s, dy * c - dx * s, length);
}

double bst_generator_output_variance(const bst_generator *g, const generator_source *s,
                                     bool other) {
    const bst_generator_filter *filter = &g->filters[s->as_streak != other];
    double seen = other ? s->other * s->amplitude : s->amplitude;
    return filter->variance + filter->shot * fmax(seen, 0.0);
}

double bst_generator_filter_noise(const bst_generator *g, const generator_source *s, int filter) {
    double peak = bst_generator_draw(g, s, GENERATOR_PEAK), shared = g->shared_noise;
    if (filter == 1 || !(g->streak > 0.0)) {
        return peak;
    }
    return shared * peak + sqrt(1.0 - shared * shared) * bst_generator_draw(g, s, GENERATOR_SHAPE);
}

double bst_generator_other_noise(const bst_generator *g, const generator_source *s) {
    return bst_generator_filter_noise(g, s, !s->as_streak);
}

double bst_generator_other_output(const generator_source *s, double peak) {
    return s->other > 1.0 ? s->other * (peak - s->rise) + s->rise : s->other * peak;
}

/* Margin of a peak above the threshold of the filter that shows the source best, or of the other
 * one, SNR: image processing accepts a maximum that exceeds either. */
static double margin_of(const bst_generator *g, const generator_source *s, double peak,
                        bool other) {
    double threshold = g->filters[s->as_streak != other].threshold;
    if (!other) {
        return g->calibration.slope * (peak - threshold) + s->spread * s->noise;
    }
    double spread = sqrt(bst_generator_output_variance(g, s, true));
    return g->calibration.slope * (bst_generator_other_output(s, peak) - threshold) +
           spread * bst_generator_other_noise(g, s);
}

/* Amplitude of a source with noise: in its own filter, or in the other one if that is larger. */
static double noisy_level(const bst_generator *g, const generator_source *s) {
    double level = s->amplitude + s->spread * s->noise / g->calibration.slope;
    if (s->other > 0.0) {
        double spread = sqrt(bst_generator_output_variance(g, s, true));
        level = fmax(level, bst_generator_other_output(s, s->amplitude) +
                                spread * bst_generator_other_noise(g, s) / g->calibration.slope);
    }
    return level;
}

/* Index of the first source at most `reach` px above source i; sources are in order of y. */
static int first_near(const bst_generator *g, int i, double reach) {
    int k = i;
    while (k > 0 && g->sources[k - 1].y >= g->sources[i].y - reach) {
        k--;
    }
    return k;
}

/* qsort order by falling brightness. */
static int brighter(const void *a, const void *b) {
    const generator_rank *p = a, *q = b;
    if (p->amplitude != q->amplitude) {
        return p->amplitude > q->amplitude ? -1 : 1;
    }
    return (p->index > q->index) - (p->index < q->index);
}

/* Light of a brighter source on the flank of another, SNR: on the line between both, where the
 * output of the fainter one has fallen so far that its maximum is one of its own. Of streaks in
 * line it can be much there and none at the maximum: each output reaches a streak's length along
 * it. */
static double light_on_flank(const bst_generator *g, const generator_source *s,
                             const generator_source *bright) {
    double dx = bright->x - s->x, dy = bright->y - s->y, apart = hypot(dx, dy);
    double least = 1.0 - bst_generator_fall_of_saddle(s->level) / s->level;
    for (double step = 1.0; step < apart; step += 1.0) {
        generator_source at = {.x = s->x + step / apart * dx, .y = s->y + step / apart * dy};
        if (bst_generator_overlap(g, s, &at) < least) {
            return bright->amplitude * bst_generator_overlap(g, bright, &at);
        }
    }
    return bright->amplitude;
}

/* Decides which sources are detected and which are merged with a brighter one. */
void bst_generator_decide(bst_generator *g) {
    double most = 0.0;
    for (int i = 0; i < g->source_count; i++) {
        most = fmax(most, g->sources[i].broken ? 0.0 : g->sources[i].length);
    }
    g->reach = REACH_SIGMAS * g->total_sigma + most;
    int ranks = 0;
    for (int i = 0; i < g->source_count; i++) {
        generator_source *s = &g->sources[i];
        if (s->amplitude > FAINTEST_SHARE * g->threshold) {
            s->noise = bst_generator_filter_noise(g, s, s->as_streak);
            s->spread = sqrt(bst_generator_output_variance(g, s, false));
            s->level = noisy_level(g, s);
            generator_source pixel = {.x = round(s->x), .y = round(s->y)};
            assert(ranks < g->source_count);
            g->ranks[ranks++] = (generator_rank){s->level * bst_generator_overlap(g, s, &pixel), i};
        }
    }
    qsort(g->ranks, (size_t)ranks, sizeof *g->ranks, brighter);
    g->rank_count = ranks;
    for (int r = 0; r < ranks; r++) {
        int i = g->ranks[r].index;
        generator_source *s = &g->sources[i];
        if (s->broken) {
            continue;
        }
        double own = s->amplitude, peak = own;
        bool merged = false;
        for (int k = first_near(g, i, g->reach);
             k < g->source_count && g->sources[k].y <= s->y + g->reach; k++) {
            generator_source *o = &g->sources[k];
            if (k == i || o->broken || fabs(o->x - s->x) > g->reach) {
                continue;
            }
            double light = o->amplitude * bst_generator_overlap(g, o, s);
            bool brighter_one = o->found || o->head >= 0; /* a merged maximum counts as well */
            bool joins = brighter_one && !merged &&
                         (light > LEAST_LIGHT || light_on_flank(g, s, o) > LEAST_ON_FLANK);
            if (joins && !bst_generator_separates(g, o, s)) {
                s->head = o->found ? k : o->head;
                merged = true;
            }
            peak += light > LEAST_LIGHT ? light : 0.0;
        }
        if (merged) {
            continue;
        }
        s->found = margin_of(g, s, peak, false) > 0.0 ||
                   (s->other > 0.0 && margin_of(g, s, peak, true) > 0.0);
        s->peak = peak;
    }
}

/* Most sources, or pieces of longer streaks, in the light of a merged detection. */
enum { MOST_MERGED = 64 };

/* Adds a source's light to that of a merged detection; returns the number of sources then. A
 * streak longer than the detection's image is added in pieces: its parts lie at various distances.
 */
static int add_merged(const bst_generator *g, const generator_source *s, const generator_source *o,
                      generator_source merged[MOST_MERGED], int count) {
    int pieces = o->length < s->length + ONE_PIECE_PX ? 1 : (int)ceil(o->length / g->total_sigma);
    int room = MOST_MERGED - count;
    pieces = pieces < room ? pieces : room;
    for (int i = 0; i < pieces; i++) {
        double u = (i + 0.5) / pieces - 0.5;
        generator_source *m = &merged[count++];
        *m = *o;
        m->x = o->x + u * o->path.dx;
        m->y = o->y + u * o->path.dy;
        m->flux_e = o->flux_e / pieces;
        m->path = (bst_obsgen_path_px){o->path.dx / pieces, o->path.dy / pieces};
        bst_generator_cut_light(g, m);
    }
    return count;
}

/* Weight of light at b in the position of a fit to source a that is limited by noise: gradient of
 * the filter's output, per distance. For Gaussian images it is the output. */
static double pull_of(const bst_generator *g, const generator_source *a,
                      const generator_source *b) {
    double length = a->as_streak ? g->streak : a->length;
    return length < SHORT_SIGMAS * g->total_sigma
               ? bst_response_pull(&g->response, hypot(b->x - a->x, b->y - a->y))
               : bst_generator_overlap(g, a, b);
}

/* Draws the position of a faint streak, whose filter output has a peak that scatters along it.
 *
 * Given:     beside  part of the output caused by detected neighbours */
static void draw_streak_position(const bst_generator *g, const generator_source *s,
                                 const generator_source *merged, int count, double beside,
                                 generator_blend *out) {
    if (!s->as_streak || s->length < 1.0 || s->blur > 0.0) { /* the peak is that of a PSF's image */
        return;
    }
    const bst_obsgen_calibration *cal = &g->calibration;
    /* of the image that the true path widens; output and noise fall off between its width and that
     * of the filters */
    bst_crlb_table_at bound =
        bst_crlb_table_wider(g->image_bound ? g->image_bound : &g->bound, s->flux_e, g->noise_e,
                             s->length, g->widening, g->excess);
    const double sigma = g->cross_sigma;
    /* below UNLIFTED_SNR the factors already include the selection by noise, which is simulated
     * here */
    double snr = fmax(s->flux_e * bound.norm / g->noise_e, UNLIFTED_SNR);
    double along = bst_obsgen_between(bst_obsgen_snrs, cal->along_factor, BST_OBSGEN_SNRS, snr) *
                   sqrt(bound.var_along_px2 * out->widen);
    if (along * out->flat < MERGED_CENTROID * sigma) {
        return;
    }
    bst_streak_centroid_error_set(g->centroid_error, g->streak, sigma);
    if (g->centroid_error->steps == 0) {
        return;
    }
    double across = bst_obsgen_between(bst_obsgen_snrs, cal->across_factor, BST_OBSGEN_SNRS, snr) *
                    sqrt(bound.var_across_px2 * out->widen);
    double own = s->unraised;
    /* standard deviation of the bound relative to the filters' peak without scatter */
    double noise = along * own * sqrt(g->centroid_error->curvature);
    noise = fmin(fmax(noise, LEAST_NOISE), MOST_NOISE);
    double turned = across * own / (sigma * sqrt(2.0)) / noise;
    turned = fmin(fmax(turned, LEAST_NOISE), MOST_NOISE);
    double c = s->path.dx / s->length, n = s->path.dy / s->length;
    bst_streak_centroid_error_source sources[BST_WANDER_SOURCES] = {{0.0, 0.0, own}};
    int used = 1;
    for (int k = 0; k < count && used < BST_WANDER_SOURCES; k++) {
        const generator_source *m = &merged[k];
        double dx = m->x - s->x, dy = m->y - s->y;
        assert(used < BST_WANDER_SOURCES);
        sources[used++] = (bst_streak_centroid_error_source){dx * c + dy * n, dy * c - dx * n,
                                                             own * m->flux_e / s->flux_e};
    }
    bst_philox_words words =
        bst_rng_words(g->key, (uint64_t)g->exposure_id, CENTROID_ERROR | s->name);
    const bst_rng_key key = {{words.w[0], words.w[1]}};
    double threshold = g->filters[1].threshold - beside;
    bst_streak_centroid_error_peak top =
        bst_streak_centroid_error_draw(g->centroid_error, key, sources, used, noise, threshold);
    if (!(top.snr > threshold)) {
        return; /* so faint that it is detected for another reason */
    }
    double v = turned * top.across_px;
    out->x = s->x + c * top.along_px - n * v;
    out->y = s->y + n * top.along_px + c * v;
    out->drawn = true;
    out->point = top.point;
    out->snr = top.snr;
}

/* Merged light of source i and the neighbours fitted jointly. A single-source fit to several
 * sources converges to the filter output's maximum, found by mean shift. */
generator_blend bst_generator_blend_of(const bst_generator *g, int i) {
    assert(g && i >= 0 && i < g->source_count);
    enum { ROUNDS = 8 };
    const generator_source *s = &g->sources[i];
    generator_source merged[MOST_MERGED];
    generator_blend out = {
        .flux_e = s->flux_e, .x = s->x, .y = s->y, .widen = 1.0, .flat = 1.0, .near = false};
    int count = 0;
    double beside = 0.0,
           stamp = fmax(LEAST_STAMP_PX, ceil(STAMP_SIGMAS * g->fitted_sigma)) + FREE_OUTSIDE_PX;
    for (int k = first_near(g, i, g->reach);
         k < g->source_count && g->sources[k].y <= s->y + g->reach; k++) {
        const generator_source *o = &g->sources[k];
        double dx = o->x - s->x, dy = o->y - s->y;
        double half_x = stamp + 0.5 * fabs(s->path.dx), half_y = stamp + 0.5 * fabs(s->path.dy);
        if (k == i || fabs(dx) > half_x + stamp || fabs(dy) > half_y + stamp) {
            continue;
        }
        double share = bst_generator_overlap(g, s, o);
        if (o->found && !g->smeared) { /* in smeared frames nothing is fitted jointly */
            beside += o->amplitude * share;
            out.near = out.near || (fabs(dx) <= half_x && fabs(dy) <= half_y);
            /* both fluxes and positions are free, so their common part is undetermined */
            out.widen *=
                s->partner == k ? s->partner_widen : 1.0 / fmax(1.0 - share * share, LEAST_OWN);
        } else {
            count = add_merged(g, s, o, merged, count);
        }
    }
    generator_source at = *s;
    for (int round = 0; round < ROUNDS && count > 0; round++) {
        at.x = out.x;
        at.y = out.y;
        /* brightest pixel of the fitted light over the noise variance */
        double bright = g->smeared
                            ? 0.0
                            : out.flux_e * bst_crlb_table_norm(&g->bound, s->length) * g->fit_light;
        double sum = s->flux_e * bst_blend_weight(&g->blend_weights, bright, pull_of(g, &at, s));
        double x = 0.0, y = 0.0;
        for (int k = 0; k < count; k++) {
            double light = merged[k].flux_e *
                           bst_blend_weight(&g->blend_weights, bright, pull_of(g, &at, &merged[k]));
            sum += light;
            x += light * (merged[k].x - s->x);
            y += light * (merged[k].y - s->y);
        }
        out.flux_e = sum;
        out.x = s->x + x / sum;
        out.y = s->y + y / sum;
    }
    if (count > 0) {
        bst_generator_fit_merged(g, s, merged, count, &out);
    }
    if (count > 0 && s->length > 1.0) {
        /* two streaks in line have a flat peak between them, where noise determines the position */
        double h = fmax(g->total_sigma, 0.25 * s->length) / s->length, alone = 0.0, all = 0.0;
        for (int step = -1; step <= 1; step++) {
            double weight = step == 0 ? 2.0 : -1.0;
            at.x = out.x + step * h * s->path.dx;
            at.y = out.y + step * h * s->path.dy;
            all += weight * s->flux_e * bst_generator_overlap(g, &at, s);
            for (int k = 0; k < count; k++) {
                all += weight * merged[k].flux_e * bst_generator_overlap(g, &at, &merged[k]);
            }
            generator_source off = *s;
            off.x = s->x + step * h * s->path.dx;
            off.y = s->y + step * h * s->path.dy;
            alone += weight * s->flux_e * bst_generator_overlap(g, &off, s);
        }
        out.flat = fmin(fmax(alone / fmax(all, 1e-9 * alone), 1.0), FLATTEST);
    }
    draw_streak_position(g, s, merged, count, beside, &out);
    return out;
}
