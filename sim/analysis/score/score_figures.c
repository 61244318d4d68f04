#include "sim/analysis/score/score_figures.h"

#include <assert.h>
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>

#include "boresight/rng.h"
#include "sim/core/compare.h"
#include "sim/eval/gospa.h"

/* Cost of an object without a pair, in units of the radius: above the sum of the distances of any
 * frame of up to a million points, so that the assignment has as many pairs as possible. */
static const double UNPAIRED_RADII = 1e6;

/* Most pairs of a true and a found point of a frame, at 16 bytes each. */
static const size_t MOST_PAIRS = 50000000;

/* Sums of a frame, or of several. */
typedef struct tally {
    double true_positives, false_positives, false_negatives, error2_px2;
    double gospa_px, frames;
    double tau_positives, tau_false, tau_missed; /* with spotGEO's radius */
    double squared_px2, unsquared_px; /* spotGEO's error: of squared distances, and of distances */
    double competition;               /* spotGEO's error per point, summed over sequences */
} tally;

/* Points of one frame, and room for their assignment. */
typedef struct scene {
    const bst_score_point *truth, *found; /* as read */
    int truth_count, found_count;
    const bst_score_point **t, **f; /* those that count */
    int truths, founds;
    bst_gospa_pair *pairs;
    int *pair_of_truth;
} scene;

/* State of the computation. */
typedef struct scorer {
    const bst_score_points *truth, *found;
    const bst_score_options *options;
    scene scene;
    bst_score_key *keys; /* [count] all frames */
    int count;
    tally *units; /* [unit_count] frames, or sequences */
    int unit_count;
    bst_score_result *result;
    int64_t *last_id; /* [2 * last_count] object, and identity of its latest pair */
    int last_count;
} scorer;

static double distance_px(const bst_score_point *a, const bst_score_point *b) {
    return hypot(a->x_px - b->x_px, a->y_px - b->y_px);
}

/* Assigns found points to true ones at most `radius` apart: most pairs, then least distances. */
static bst_status assign(bst_ctx *ctx, scene *s, double radius, bst_gospa_result *result) {
    int count = 0;
    for (int i = 0; i < s->truths; i++) {
        for (int j = 0; j < s->founds; j++) {
            double d = distance_px(s->t[i], s->f[j]);
            if (d <= radius) {
                s->pairs[count++] = (bst_gospa_pair){i, j, d};
            }
        }
    }
    const bst_gospa_problem problem = {.pairs = s->pairs,
                                       .count = count,
                                       .truths = s->truths,
                                       .tracks = s->founds,
                                       .cutoff = UNPAIRED_RADII * radius,
                                       .order = 1.0};
    return bst_gospa_near(ctx, &problem, s->pair_of_truth, result);
}

/* GOSPA of order 2 with the radius as its cutoff. */
static bst_status gospa_of(bst_ctx *ctx, scene *s, double radius, double *gospa) {
    int count = 0;
    bst_gospa_result result;
    for (int i = 0; i < s->truths; i++) {
        for (int j = 0; j < s->founds; j++) {
            double d = distance_px(s->t[i], s->f[j]);
            if (d < radius) {
                s->pairs[count++] = (bst_gospa_pair){i, j, d};
            }
        }
    }
    const bst_gospa_problem problem = {s->pairs, count, s->truths, s->founds, radius, 2.0};
    BST_TRY(bst_gospa_near(ctx, &problem, NULL, &result));
    *gospa = result.gospa;
    return BST_OK;
}

/* Removes optional true points, and found ones without a pair that are on one. */
static bst_status leave_out_optional(bst_ctx *ctx, scorer *p) {
    scene *s = &p->scene;
    double radius = p->options->radius_px;
    bst_gospa_result result;
    s->truths = s->founds = 0;
    for (int i = 0; i < s->truth_count; i++) {
        if (!s->truth[i].optional) {
            s->t[s->truths++] = &s->truth[i];
        }
    }
    for (int j = 0; j < s->found_count; j++) {
        s->f[s->founds++] = &s->found[j];
    }
    p->result->optional_truths += s->truth_count - s->truths;
    if (s->truths == s->truth_count) {
        return BST_OK;
    }
    BST_TRY(assign(ctx, s, radius, &result));
    for (int i = 0; i < s->truths; i++) {
        if (s->pair_of_truth[i] >= 0) {
            s->f[s->pair_of_truth[i]] = NULL;
        }
    }
    int kept = 0;
    for (int j = 0; j < s->found_count; j++) {
        bool ignored = false;
        for (int i = 0; i < s->truth_count && s->f[j] && !ignored; i++) {
            ignored = s->truth[i].optional && distance_px(&s->truth[i], &s->found[j]) <= radius;
        }
        if (!ignored) {
            s->f[kept++] = &s->found[j];
        }
        p->result->optional_found += ignored;
    }
    s->founds = kept;
    return BST_OK;
}

/* Counts a change of the identity that an object has among the found points. */
static void note_identity(scorer *p, int64_t object, int64_t id) {
    if (object < 0 || id < 0) {
        return;
    }
    if (p->result->identity_changes < 0) {
        p->result->identity_changes = 0;
    }
    for (int i = 0; i < p->last_count; i++) {
        if (p->last_id[2 * i] == object) {
            p->result->identity_changes += p->last_id[2 * i + 1] != id;
            p->last_id[2 * i + 1] = id;
            return;
        }
    }
    p->last_id[2 * p->last_count] = object;
    p->last_id[2 * p->last_count++ + 1] = id;
}

/* spotGEO's errors: distances below epsilon count as 0; tau^2 for each missed and false point. */
static bst_status add_spotgeo(bst_ctx *ctx, scorer *p, tally *out) {
    scene *s = &p->scene;
    bst_gospa_result result;
    BST_TRY(assign(ctx, s, BST_SPOTGEO_TAU_PX, &result));
    for (int i = 0; i < s->truths; i++) {
        double d = s->pair_of_truth[i] >= 0 ? distance_px(s->t[i], s->f[s->pair_of_truth[i]]) : 0.0;
        double e = d < BST_SPOTGEO_EPSILON_PX ? 0.0 : d;
        out->squared_px2 += e * e;
        out->unsquared_px += e;
    }
    int wrong = s->truths + s->founds - 2 * result.pairs;
    out->tau_positives = result.pairs;
    out->tau_missed = s->truths - result.pairs;
    out->tau_false = s->founds - result.pairs;
    out->squared_px2 += wrong * BST_SPOTGEO_TAU_PX * BST_SPOTGEO_TAU_PX;
    out->unsquared_px += wrong * BST_SPOTGEO_TAU_PX * BST_SPOTGEO_TAU_PX;
    return BST_OK;
}

/* Sums of one frame. */
static bst_status score_frame(bst_ctx *ctx, scorer *p, tally *out) {
    scene *s = &p->scene;
    bst_gospa_result result;
    *out = (tally){.frames = 1.0};
    BST_TRY(leave_out_optional(ctx, p));
    BST_TRY(assign(ctx, s, p->options->radius_px, &result));
    out->true_positives = result.pairs;
    out->false_negatives = s->truths - result.pairs;
    out->false_positives = s->founds - result.pairs;
    for (int i = 0; i < s->truths; i++) {
        int j = s->pair_of_truth[i];
        if (j >= 0) {
            double d = distance_px(s->t[i], s->f[j]);
            out->error2_px2 += d * d;
            note_identity(p, s->t[i]->id, s->f[j]->id);
        }
    }
    BST_TRY(add_spotgeo(ctx, p, out));
    return gospa_of(ctx, s, p->options->radius_px, &out->gospa_px);
}

static void add_tally(tally *to, const tally *t) {
    double *sum = (double *)to;
    const double *part = (const double *)t;
    for (size_t i = 0; i < sizeof *t / sizeof *sum; i++) {
        sum[i] += part[i];
    }
}

static double ratio(double part, double whole) {
    return whole > 0.0 ? part / whole : NAN;
}

/* Figures of sums. */
static void figures_of(const tally *t, double out[BST_SCORE_FIGURES]) {
    double tau = 2.0 * t->tau_positives + t->tau_false + t->tau_missed;
    double points = t->tau_positives + t->tau_false + t->tau_missed;
    out[BST_SCORE_PRECISION] = ratio(t->true_positives, t->true_positives + t->false_positives);
    out[BST_SCORE_RECALL] = ratio(t->true_positives, t->true_positives + t->false_negatives);
    out[BST_SCORE_F1] = ratio(2.0 * t->true_positives,
                              2.0 * t->true_positives + t->false_positives + t->false_negatives);
    out[BST_SCORE_RMS_PX] = sqrt(ratio(t->error2_px2, t->true_positives));
    out[BST_SCORE_GOSPA_PX] = ratio(t->gospa_px, t->frames);
    out[BST_SCORE_SPOTGEO_1_F1] = 1.0 - ratio(2.0 * t->tau_positives, tau);
    out[BST_SCORE_SPOTGEO_MSE] = points > 0.0 ? t->squared_px2 / points : 0.0;
    out[BST_SCORE_SPOTGEO_COMPETITION] = t->competition;
}

/* First item from `at` on that is not before a frame. */
static int skip_to(const bst_score_points *p, int at, const bst_score_key *key) {
    while (at < p->count && bst_score_key_compare(&p->items[at].key, key) < 0) {
        at++;
    }
    return at;
}

/* Number of items from `at` on that are of a frame. */
static int items_of(const bst_score_points *p, int at, const bst_score_key *key) {
    int count = 0;
    while (at + count < p->count && bst_score_key_compare(&p->items[at + count].key, key) == 0) {
        count++;
    }
    return count;
}

/* The error per point of a sequence, as the competition's program computes it. */
static void end_sequence(tally *t) {
    double points = t->tau_positives + t->tau_false + t->tau_missed;
    t->competition = points > 0.0 ? t->unsquared_px / points : 0.0;
}

/* Scores all frames, and collects them into the units of the bootstrap. */
static bst_status score_all(bst_ctx *ctx, scorer *p) {
    scene *s = &p->scene;
    int t = 0, f = 0;
    bool several = p->result->sequences > 1;
    tally sequence = {0};
    for (int i = 0; i < p->count; i++) {
        const bst_score_key *key = &p->keys[i];
        tally frame;
        t = skip_to(p->truth, t, key);
        f = skip_to(p->found, f, key);
        s->truth = p->truth->items ? p->truth->items + t : NULL;
        s->found = p->found->items ? p->found->items + f : NULL;
        s->truth_count = items_of(p->truth, t, key);
        s->found_count = items_of(p->found, f, key);
        bool first = i == 0 || p->keys[i - 1].sequence != key->sequence;
        bool last = i + 1 == p->count || p->keys[i + 1].sequence != key->sequence;
        sequence = first ? (tally){0} : sequence;
        p->last_count = first ? 0 : p->last_count;
        BST_TRY(score_frame(ctx, p, &frame));
        add_tally(&sequence, &frame);
        if (several && last) {
            end_sequence(&sequence);
            p->units[p->unit_count++] = sequence;
        } else if (!several) {
            p->units[p->unit_count++] = frame;
        }
    }
    return BST_OK;
}

/* Figures of all units, or of a resample. With one sequence its error per point is that of the
 * drawn frames. */
static void figures_of_units(const scorer *p, const int *drawn, double out[BST_SCORE_FIGURES]) {
    tally sum = {0};
    for (int i = 0; i < p->unit_count; i++) {
        add_tally(&sum, &p->units[drawn ? drawn[i] : i]);
    }
    if (!p->result->by_sequence) {
        end_sequence(&sum);
    }
    figures_of(&sum, out);
}

/* Percentile intervals (Efron and Tibshirani 1993, equation 13.5). */
static bst_status bootstrap(bst_ctx *ctx, scorer *p) {
    size_t n = (size_t)p->options->resamples;
    double *values = malloc((n * BST_SCORE_FIGURES + 1) * sizeof *values);
    int *drawn = malloc((size_t)p->unit_count * sizeof *drawn);
    bst_rng_key key = bst_rng_make_key(p->options->seed, 0, "score", "bootstrap");
    if (!values || !drawn) {
        free(values);
        free(drawn);
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for %zu resamples", n);
    }
    for (size_t k = 0; k < n; k++) {
        double figures[BST_SCORE_FIGURES];
        for (int i = 0; i < p->unit_count; i++) {
            drawn[i] = (int)(bst_rng_uniform(key, k, (uint64_t)i) * p->unit_count);
        }
        figures_of_units(p, drawn, figures);
        for (int q = 0; q < BST_SCORE_FIGURES; q++) {
            values[(size_t)q * n + k] = figures[q];
        }
    }
    for (int q = 0; q < BST_SCORE_FIGURES; q++) {
        double *v = values + (size_t)q * n;
        size_t kept = 0;
        for (size_t k = 0; k < n; k++) { /* resamples without a point have no figure */
            if (isfinite(v[k])) {
                v[kept++] = v[k];
            }
        }
        bst_score_value *figure = &p->result->figures[q];
        figure->low = figure->high = NAN;
        if (kept > 0 && isfinite(figure->value)) {
            qsort(v, kept, sizeof *v, bst_compare_doubles);
            figure->low = v[(size_t)(0.025 * (double)(kept - 1) + 0.5)];
            figure->high = v[(size_t)(0.975 * (double)(kept - 1) + 0.5)];
        }
    }
    free(values);
    free(drawn);
    return BST_OK;
}

/* Frames of both sources, each once. */
static bst_status merge_frames(bst_ctx *ctx, scorer *p) {
    const bst_score_points *a = p->truth, *b = p->found;
    int i = 0, j = 0;
    p->keys = malloc((size_t)(a->frame_count + b->frame_count + 1) * sizeof *p->keys);
    if (!p->keys) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the frames");
    }
    while (i < a->frame_count || j < b->frame_count) {
        int order = i == a->frame_count   ? 1
                    : j == b->frame_count ? -1
                                          : bst_score_key_compare(&a->frames[i], &b->frames[j]);
        bst_score_key key = order <= 0 ? a->frames[i] : b->frames[j];
        p->result->frames_only_found += order > 0;
        i += order <= 0;
        j += order >= 0;
        p->result->sequences += p->count == 0 || p->keys[p->count - 1].sequence != key.sequence;
        p->keys[p->count++] = key;
    }
    p->result->frames = p->count;
    p->result->by_sequence = p->result->sequences > 1;
    return p->count > 0 ? BST_OK : bst_fail(ctx, BST_ERR_ARGUMENT, "there is no frame to score");
}

/* Room for the fullest frame. */
static bst_status make_room(bst_ctx *ctx, scorer *p) {
    scene *s = &p->scene;
    int t = 0, f = 0;
    size_t most = 1, pairs = 1;
    for (int i = 0; i < p->count; i++) {
        t = skip_to(p->truth, t, &p->keys[i]);
        f = skip_to(p->found, f, &p->keys[i]);
        size_t truths = (size_t)items_of(p->truth, t, &p->keys[i]),
               founds = (size_t)items_of(p->found, f, &p->keys[i]);
        if (truths > 0 && founds > MOST_PAIRS / truths) {
            return bst_fail(ctx, BST_ERR_ARGUMENT,
                            "frame %" PRId64
                            " has %zu true and %zu found points (allowed: a "
                            "product of at most %zu); leave out weak ones with --least-score",
                            p->keys[i].frame, truths, founds, MOST_PAIRS);
        }
        most = truths + founds > most ? truths + founds : most;
        pairs = truths * founds > pairs ? truths * founds : pairs;
    }
    s->t = malloc(most * sizeof *s->t);
    s->f = malloc(most * sizeof *s->f);
    s->pair_of_truth = malloc(most * sizeof *s->pair_of_truth);
    s->pairs = malloc(pairs * sizeof *s->pairs);
    p->units = calloc((size_t)p->count, sizeof *p->units);
    p->last_id = malloc((size_t)(p->truth->count + 1) * 2 * sizeof *p->last_id);
    return s->t && s->f && s->pair_of_truth && s->pairs && p->units && p->last_id
               ? BST_OK
               : bst_fail(ctx, BST_ERR_MEMORY, "out of memory for frames of %zu points", most);
}

/* Scores with all room made. */
static bst_status run_scorer(bst_ctx *ctx, scorer *p) {
    BST_TRY(merge_frames(ctx, p));
    BST_TRY(make_room(ctx, p));
    BST_TRY(score_all(ctx, p));
    double values[BST_SCORE_FIGURES];
    tally sum = {0};
    figures_of_units(p, NULL, values);
    for (int q = 0; q < BST_SCORE_FIGURES; q++) {
        p->result->figures[q].value = values[q];
    }
    for (int i = 0; i < p->unit_count; i++) {
        add_tally(&sum, &p->units[i]);
    }
    p->result->true_positives = (int64_t)sum.true_positives;
    p->result->false_positives = (int64_t)sum.false_positives;
    p->result->false_negatives = (int64_t)sum.false_negatives;
    p->result->truths = p->result->true_positives + p->result->false_negatives;
    p->result->found = p->result->true_positives + p->result->false_positives;
    return bootstrap(ctx, p);
}

bst_status bst_score_compute(bst_ctx *ctx, const bst_score_points *truth,
                             const bst_score_points *found, const bst_score_options *options,
                             bst_score_result *out) {
    assert(truth && found && options && options->radius_px > 0.0 && out);
    *out = (bst_score_result){.identity_changes = -1};
    scorer p = {.truth = truth, .found = found, .options = options, .result = out};
    bst_status status = run_scorer(ctx, &p);
    free(p.scene.t);
    free(p.scene.f);
    free(p.scene.pairs);
    free(p.scene.pair_of_truth);
    free(p.keys);
    free(p.units);
    free(p.last_id);
    return status;
}
