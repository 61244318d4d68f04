#include "imgproc/identify/lost_in_space.h"

#include <assert.h>
#include <stdlib.h>
#include <string.h>

#include "imgproc/identify/lost_in_space_internal.h"
#include "sim/core/heapsort.h"

enum { MOST_PREDICTED = 512, MOST_CANDIDATES = 64, PASSES = 5, PATH_STEPS = 32 };
/* Patterns that are looked at for each one that is verified. */
enum { PATTERNS_PER_CANDIDATE = 8 };

/* Centroid error beyond a detection's own covariance (catalogue, distortion), px. */
static const double SYSTEMATIC_PX = 0.1;
/* Tolerance of a code: so many standard deviations of a star's place in it, and more by the
 * rounding of the catalogue and by aberration. */
static const double CODE_SIGMAS = 5.0, CODE_FLOOR = 8e-4;
/* Largest tolerance, at which one pattern of FEW agrees with a quad by chance: the codes fill about
 * half of a box of unit volume, and the sizes of a tenth agree. */
static const double LEAST_MOST_TOLERANCE = 0.02, MOST_TOLERANCE = 0.06, FEW = 10.0;
/* Least distance of a quad's furthest pair, share of the field's shorter side. */
static const double LEAST_SIZE = 0.08;
/* Tolerances of matched stars: first, by the quad alone, and last. */
static const double FIRST_PX = 2.0, MOST_FIRST_PX = 8.0, LAST_PX = 0.6,
                    LAST_SIGMAS = BST_LOST_LAST_SIGMAS;
/* Logarithm of the likelihood ratio of a first match below which a candidate is dropped at once. */
static const double LEAST_FIRST = 1.5;
/* Stars are predicted so much beyond the limit at which all are detected, mag. Probabilities that a
 * catalogue star up to that limit, and one at the end, is among the detections: 0.9 falls linearly
 * to 0.2, to a half near an SNR of 6 where the limit is one of 8. */
static const double FAINTER_MAG = 0.5, SURELY_FOUND = BST_LOST_SURELY_FOUND, LEAST_FOUND = 0.2;
static const double BRIGHTEST_V = -2.0;
/* Least share of the predicted stars that a right attitude matches over the whole field. */
static const double LEAST_SHARE = 0.35;
/* Largest chi-square of four stars about the attitude and scale that fit them best, of four degrees
 * of freedom. Right quads with a star on another's streak have up to 25. A candidate by chance has
 * a chi-square below c with a probability that grows with c^2. The error is added to that of each
 * place: distortion and neighbours. */
static const double MOST_CHI_SQUARED = BST_LOST_MOST_CHI_SQUARED, QUAD_PX = 0.3;
/* Least share of a streak inside the window, for a star to be predicted. */
static const double LEAST_INSIDE = 0.25;
/* Error of a quad's own scale. */
static const double SCALE_MARGIN = 3e-3;

typedef bst_lost_in_space_source source;
typedef bst_lost_in_space_attempt attempt;

static void lay_out(bst_lost_in_space *s) {
    size_t items = (size_t)s->max_detections + 1;
    BST_ARENA_TAKE(&s->arena, s->order, items);
    BST_ARENA_TAKE(&s->arena, s->sources, items);
    BST_ARENA_TAKE(&s->arena, s->nearest2, items);
    BST_ARENA_TAKE(&s->arena, s->area_px2, items);
    BST_ARENA_TAKE(&s->arena, s->inverse, items);
    BST_ARENA_TAKE(&s->arena, s->star_of, items);
    BST_ARENA_TAKE(&s->arena, s->found, MOST_PREDICTED);
    BST_ARENA_TAKE(&s->arena, s->expected, MOST_PREDICTED);
    BST_ARENA_TAKE(&s->arena, s->found_share, MOST_PREDICTED);
    BST_ARENA_TAKE(&s->arena, s->v_mag, MOST_PREDICTED);
    BST_ARENA_TAKE(&s->arena, s->matched, MOST_PREDICTED);
}

bst_status bst_lost_in_space_create(bst_ctx *ctx, const bst_camera *camera, const bst_stars *stars,
                                    const bst_star_patterns *patterns, double julian_year,
                                    int max_detections, bst_lost_in_space **out) {
    assert(camera && stars && patterns && max_detections >= 0 && out);
    *out = NULL;
    bst_lost_in_space *s = calloc(1, sizeof *s);
    if (!s) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for star identification");
    }
    bst_star_patterns_info info;
    bst_star_patterns_get_info(patterns, &info);
    s->camera = camera;
    s->stars = stars;
    s->patterns = patterns;
    s->julian_year = julian_year;
    s->depth_v_mag = info.depth_v_mag;
    s->most_tolerance =
        fmin(0.5 * pow(FEW / fmax((double)info.patterns, 1.0), 0.25), MOST_TOLERANCE);
    s->most_tolerance = fmax(s->most_tolerance, LEAST_MOST_TOLERANCE);
    s->max_detections = max_detections;
    lay_out(s);
    bst_status status = bst_arena_alloc(ctx, &s->arena, "star identification");
    if (status != BST_OK) {
        bst_lost_in_space_free(s);
        return status;
    }
    lay_out(s);
    *out = s;
    return BST_OK;
}

void bst_lost_in_space_free(bst_lost_in_space *s) {
    if (!s) {
        return;
    }
    bst_arena_free(&s->arena);
    free(s);
}

static bool brighter(const void *context, int a, int b) {
    const bst_detection *items = context;
    return items[a].flux_e != items[b].flux_e ? items[a].flux_e > items[b].flux_e : a < b;
}

/* Takes over the detections that may be stars, brightest first. */
static void read_sources(bst_lost_in_space *s, const bst_lost_in_space_frame *frame) {
    int count = 0;
    for (int i = 0; i < frame->count && count < s->max_detections; i++) {
        const bst_detection *d = &frame->items[i];
        if ((d->label == BST_LABEL_UNKNOWN || d->label == BST_LABEL_STAR) &&
            !(d->flags & BST_DETECTION_EXTENDED)) {
            s->order[count++] = i;
        }
    }
    bst_heapsort_indices(s->order, count, brighter, frame->items);
    for (int i = 0; i < count; i++) {
        const bst_detection *d = &frame->items[s->order[i]];
        const double least = SYSTEMATIC_PX * SYSTEMATIC_PX, xx = fmax(d->cov_xx, 0.0),
                     yy = fmax(d->cov_yy, 0.0), most = sqrt(xx * yy);
        s->sources[i] = (source){.x_px = d->x_px,
                                 .y_px = d->y_px,
                                 .cov_xx = xx + least,
                                 .cov_xy = fmin(fmax(d->cov_xy, -most), most),
                                 .cov_yy = yy + least,
                                 .cam = bst_camera_unproject(s->camera, d->x_px, d->y_px),
                                 .mag = -2.5 * log10(fmax(d->flux_e, 1e-9))};
    }
    s->count = count;
}

bool bst_lost_in_space_matched(const bst_lost_in_space *s, int detection) {
    for (int i = 0; i < s->matched_of; i++) {
        if (s->order[i] == detection) {
            return s->star_of[i] >= 0;
        }
    }
    return false;
}

/* A source and its star. */
static bst_star_fit_pair pair_of(const source *s, bst_vec3 gcrf) {
    return (bst_star_fit_pair){.gcrf = gcrf,
                               .x_px = s->x_px,
                               .y_px = s->y_px,
                               .cov_xx = s->cov_xx,
                               .cov_xy = s->cov_xy,
                               .cov_yy = s->cov_yy};
}

static bool is_inside(const attempt *a, double x_px, double y_px) {
    const bst_window w = a->frame->window;
    return x_px >= w.x0 && x_px <= w.x0 + w.width - 1 && y_px >= w.y0 &&
           y_px <= w.y0 + w.height - 1;
}

/* What the window's borders cost a star, mag, at most 0: the SNR of a streak falls with the root of
 * its share inside. */
static double loss_mag(const attempt *a, double x_px, double y_px) {
    const bst_star_path *p = a->frame->path;
    const bst_window w = a->frame->window;
    if (!p) {
        return is_inside(a, x_px, y_px) ? 0.0 : -HUGE_VAL;
    }
    if (x_px - a->reach_px >= w.x0 && x_px + a->reach_px <= w.x0 + w.width - 1 &&
        y_px - a->reach_px >= w.y0 && y_px + a->reach_px <= w.y0 + w.height - 1) {
        return 0.0;
    }
    double m[3], inside = 0.0, all = 0.0;
    const int step = 1 + p->count / PATH_STEPS;
    bst_star_path_map(p, x_px, y_px, m);
    for (int k = 0; k < p->count; k += step) {
        const double *u = p->place[k];
        all += p->light[k];
        inside += is_inside(a, x_px + m[0] * u[0] + m[1] * u[1], y_px + m[1] * u[0] + m[2] * u[1])
                      ? p->light[k]
                      : 0.0;
    }
    return inside >= LEAST_INSIDE * all ? 1.25 * log10(inside / all) : -HUGE_VAL;
}

/* Probability that a star is detected, by the magnitudes that it lies beyond the limit. */
static double found_share_of(double beyond_mag) {
    double share = fmax(beyond_mag, 0.0) / FAINTER_MAG;
    return SURELY_FOUND + share * (LEAST_FOUND - SURELY_FOUND);
}

/* Magnitudes of a star beyond the limit at its place. False: it is too faint to be seen. */
static bool beyond_limit(const attempt *a, const bst_star *star, const bst_star_fit_pair *place,
                         double *beyond_mag) {
    *beyond_mag = (double)star->v_mag - a->frame->v_limit - loss_mag(a, place->x_px, place->y_px);
    return *beyond_mag <= FAINTER_MAG;
}

/* Predicts the catalogue stars that the window may show. */
static bst_status predict(const attempt *a, const bst_star_fit *fit, int *count) {
    bst_lost_in_space *s = a->s;
    const bst_window w = a->frame->window;
    bst_vec3 centre =
        bst_camera_unproject(s->camera, w.x0 + 0.5 * (w.width - 1), w.y0 + 0.5 * (w.height - 1));
    double radius = 0.0;
    for (int i = 0; i < 4; i++) {
        bst_vec3 corner = bst_camera_unproject(s->camera, i % 2 ? w.x0 - 0.5 : w.x0 + w.width - 0.5,
                                               i / 2 ? w.y0 - 0.5 : w.y0 + w.height - 0.5);
        radius = fmax(radius, bst_vec3_angle(centre, corner));
    }
    radius *= 1.0 + a->options->scale_tolerance;
    radius += a->reach_px * bst_camera_scale_rad(s->camera);
    bst_vec3 direction = bst_light_catalogue_star(
        a->frame->light, bst_quat_rotate(bst_quat_conj(fit->q_cam_from_gcrf), centre));
    int total = 0;
    bst_star_query cone = {direction,
                           radius,
                           fmin(a->frame->v_limit, s->depth_v_mag) + FAINTER_MAG,
                           {s->julian_year, a->frame->light->sun_m}};
    for (; cone.v_limit > BRIGHTEST_V; cone.v_limit -= 0.5) {
        BST_TRY(bst_stars_query_seen(a->ctx, s->stars, &cone, s->found, MOST_PREDICTED, &total));
        if (total <= MOST_PREDICTED) {
            break;
        }
    }
    *count = 0;
    for (int i = 0; i < total && i < MOST_PREDICTED; i++) {
        bst_star_fit_pair *e = &s->expected[*count];
        double beyond_mag;
        e->gcrf = bst_light_apparent_star(a->frame->light, s->found[i].icrs);
        if (bst_star_fit_project(fit, s->camera, e->gcrf, &e->x_px, &e->y_px) &&
            beyond_limit(a, &s->found[i], e, &beyond_mag)) {
            s->v_mag[*count] = (double)s->found[i].v_mag;
            s->found_share[(*count)++] = found_share_of(beyond_mag);
        }
    }
    return BST_OK;
}

/* Standard deviation of a source's place along its worse axis. */
static double worst_sigma_px(const source *s) {
    double spread = hypot(s->cov_xx - s->cov_yy, 2.0 * s->cov_xy);
    return sqrt(0.5 * (s->cov_xx + s->cov_yy + spread));
}

/* Ellipse about a source that holds its star: so many standard deviations and a tolerance.
 *
 * Returned:  inverse  of the ellipse's matrix: xx, xy, yy
 *            its area, px^2 */
static double tolerance_ellipse(const source *s, double tolerance_px, double inverse[3]) {
    const double k = LAST_SIGMAS * LAST_SIGMAS, t = tolerance_px * tolerance_px;
    const double xx = k * s->cov_xx + t, xy = k * s->cov_xy, yy = k * s->cov_yy + t;
    const double det = xx * yy - xy * xy;
    inverse[0] = yy / det;
    inverse[1] = -xy / det;
    inverse[2] = xx / det;
    return BST_PI * sqrt(det);
}

/* Matches predicted stars to the nearest of the brightest sources, one to one.
 *
 * Returned:  s->matched  the pairs
 *            number of pairs */
static int match(const attempt *a, int predicted, int sources, double tolerance_px) {
    bst_lost_in_space *s = a->s;
    int count = 0;
    for (int i = 0; i < sources; i++) {
        s->star_of[i] = -1;
        s->nearest2[i] = 1.0;
        s->area_px2[i] = tolerance_ellipse(&s->sources[i], tolerance_px, s->inverse[i]);
    }
    for (int k = 0; k < predicted; k++) {
        const bst_star_fit_pair *e = &s->expected[k];
        int best = -1;
        double best2 = 1.0;
        for (int i = 0; i < sources; i++) {
            const double *m = s->inverse[i];
            double dx = s->sources[i].x_px - e->x_px, dy = s->sources[i].y_px - e->y_px;
            double d2 = m[0] * dx * dx + 2.0 * m[1] * dx * dy + m[2] * dy * dy;
            if (d2 < best2) {
                best2 = d2;
                best = i;
            }
        }
        if (best >= 0 && (s->star_of[best] < 0 || best2 < s->nearest2[best])) {
            s->star_of[best] = k;
            s->nearest2[best] = best2;
        }
    }
    for (int i = 0; i < sources && count < MOST_PREDICTED; i++) {
        if (s->star_of[i] >= 0) {
            s->matched[count++] = pair_of(&s->sources[i], s->expected[s->star_of[i]].gcrf);
        }
    }
    return count;
}

/* Number of brightest sources that the predicted stars can be among: detections may be twice as
 * many as the catalogue's stars. */
static int rivals(const bst_lost_in_space *s, int predicted) {
    int most = 2 * predicted + 20;
    return s->count < most ? s->count : most;
}

/* Weighs the stars of an attitude and refines it.
 *
 * Given:     quad       sources that gave it
 *            tolerance  of the first match, px */
static bst_status verify(const attempt *a, bst_star_fit fit, const int quad[4], double tolerance,
                         bst_lost_in_space_result *out) {
    const double log_quad = quad[0] < 0 ? 0.0 : bst_lost_in_space_log_quad(fit.chi_squared);
    double evidence = 0.0;
    int predicted, sources, matched;
    for (int pass = 0; pass < PASSES; pass++) {
        BST_TRY(predict(a, &fit, &predicted));
        sources = rivals(a->s, predicted);
        matched = match(a, predicted, sources, tolerance);
        evidence = log_quad + bst_lost_in_space_log_ratio(a, quad, predicted, sources, out);
        if (pass == 0 || pass == PASSES - 1) {
            out->least_log_chance = fmin(out->least_log_chance, log(out->candidates) - evidence);
        }
        if (matched < 5 || (pass == 0 && !(evidence >= LEAST_FIRST))) {
            return BST_OK;
        }
        if (!bst_star_fit_refine(a->s->camera, a->s->matched, matched, &fit)) {
            return BST_OK;
        }
        /* the stars near the quad are matched first, and carry the fit on to the others */
        tolerance = pass + 2 < PASSES ? fmax(LAST_PX, 0.5 * tolerance) : LAST_PX;
    }
    if (out->matched < LEAST_SHARE * out->predicted ||
        !(log(out->candidates) - evidence <= log(a->options->false_rate)) ||
        fabs(fit.scale - 1.0) > a->options->scale_tolerance + SCALE_MARGIN) {
        return BST_OK;
    }
    out->solved = true;
    a->s->matched_of = sources;
    out->q_cam_from_gcrf = fit.q_cam_from_gcrf;
    out->scale = fit.scale;
    out->rms_px = fit.rms_px;
    out->log_chance = -evidence;
    return BST_OK;
}

/* Tries an attitude from a pattern.
 *
 * Given:     pairs  the quad's four stars
 *            quad   their sources */
static bst_status try_pattern(const attempt *a, const bst_star_fit_pair pairs[4], const int quad[4],
                              double extrapolation_px, double ratio,
                              bst_lost_in_space_result *out) {
    bst_star_fit fit;
    if (!bst_star_fit_start(a->s->camera, pairs, ratio, &fit) ||
        !bst_star_fit_refine(a->s->camera, pairs, 4, &fit) ||
        fabs(fit.scale - 1.0) > a->options->scale_tolerance + SCALE_MARGIN ||
        fit.chi_squared > MOST_CHI_SQUARED) {
        return BST_OK;
    }
    out->candidates++;
    /* the quad's own error grows with the distance from it */
    return verify(a, fit, quad, fmin(FIRST_PX + extrapolation_px, MOST_FIRST_PX), out);
}

/* Tolerance of the code of four sources.
 *
 * Returned:  *size_px           distance of the furthest pair
 *            *extrapolation_px  error over the field of an attitude from the four */
static double code_tolerance(const attempt *a, const bst_star_quad *quad, const int star[4],
                             double *size_px, double *extrapolation_px) {
    const source *s = a->s->sources;
    const source *from = &s[star[quad->order[0]]], *to = &s[star[quad->order[1]]];
    double sigma_px = 0.0;
    for (int i = 0; i < 4; i++) {
        sigma_px = fmax(sigma_px, worst_sigma_px(&s[star[i]]));
    }
    *size_px = hypot(to->x_px - from->x_px, to->y_px - from->y_px);
    *extrapolation_px = 3.0 * sigma_px * a->side_px / *size_px;
    /* a wrong scale shears the tangent plane away from the boresight */
    return CODE_FLOOR + CODE_SIGMAS * sigma_px / *size_px +
           0.5 * a->options->scale_tolerance * a->most_r2;
}

/* Looks a form of a quad up and tries the patterns that agree. */
static bst_status try_form(const attempt *a, const bst_star_quad *quad, const int star[4],
                           double tolerance, double extrapolation_px,
                           bst_lost_in_space_result *out) {
    bst_star_patterns_match found[MOST_CANDIDATES];
    int count = bst_star_patterns_find(a->s->patterns, quad, tolerance, a->options->scale_tolerance,
                                       found, MOST_CANDIDATES);
    count = count < MOST_CANDIDATES ? count : MOST_CANDIDATES;
    for (int k = 0; k < count && !out->solved; k++) {
        bst_star_fit_pair pairs[4];
        for (int i = 0; i < 4; i++) {
            pairs[i] = pair_of(&a->s->sources[star[quad->order[i]]],
                               bst_light_apparent_star(a->frame->light, found[k].icrs[i]));
            pairs[i].cov_xx += QUAD_PX * QUAD_PX;
            pairs[i].cov_yy += QUAD_PX * QUAD_PX;
        }
        out->patterns++;
        BST_TRY(try_pattern(a, pairs, star, extrapolation_px, found[k].size_ratio, out));
    }
    return BST_OK;
}

/* Tries a quad of sources in all forms that its rules leave open. */
static bst_status try_quad(const attempt *a, const int star[4], bst_lost_in_space_result *out) {
    bst_vec3 v[4];
    bst_star_quad forms[4];
    for (int i = 0; i < 4; i++) {
        v[i] = a->s->sources[star[i]].cam;
    }
    if (!bst_star_quad_make(v, &forms[0])) {
        return BST_OK;
    }
    double size_px, extrapolation_px;
    double tolerance = code_tolerance(a, &forms[0], star, &size_px, &extrapolation_px);
    if (size_px < LEAST_SIZE * a->side_px || tolerance > a->s->most_tolerance) {
        return BST_OK;
    }
    out->quads++;
    int count = 1 + bst_star_quad_alternatives(&forms[0], tolerance, forms + 1);
    for (int i = 0; i < count && !out->solved; i++) {
        BST_TRY(try_form(a, &forms[i], star, tolerance, extrapolation_px, out));
    }
    return BST_OK;
}

/* Geometry of the window. */
static void measure_window(attempt *a) {
    const bst_window w = a->frame->window;
    a->area_px2 = (double)w.width * (double)w.height;
    a->side_px = (double)(w.width < w.height ? w.width : w.height);
    a->most_r2 = 0.0;
    for (int i = 0; i < 4; i++) {
        bst_vec3 v = bst_camera_unproject(a->s->camera, w.x0 + (i % 2 ? w.width - 1 : 0),
                                          w.y0 + (i / 2 ? w.height - 1 : 0));
        a->most_r2 = fmax(a->most_r2, (v.x * v.x + v.y * v.y) / (v.z * v.z));
    }
    const bst_star_path *path = a->frame->path;
    for (int k = 0; path && k < path->count; k++) {
        /* the map of the path grows with the tangent radius */
        double reach = hypot(path->place[k][0], path->place[k][1]) * (1.0 + a->most_r2);
        a->reach_px = fmax(a->reach_px, reach);
    }
}

/* True until the frame is solved or enough has been tried. */
static bool searching(const attempt *a, const bst_lost_in_space_result *out) {
    return !out->solved && out->candidates < a->options->max_candidates &&
           out->patterns / PATTERNS_PER_CANDIDATE < a->options->max_candidates;
}

bst_status bst_lost_in_space_solve(bst_ctx *ctx, bst_lost_in_space *lost,
                                   const bst_lost_in_space_options *options,
                                   const bst_lost_in_space_frame *frame,
                                   bst_lost_in_space_result *out) {
    assert(lost && options && frame && out && frame->light);
    assert(options->scale_tolerance >= 0.0 && options->scale_tolerance <= 0.1);
    *out = (bst_lost_in_space_result){.q_cam_from_gcrf = BST_QUAT_IDENTITY, .scale = 1.0};
    attempt a = {.ctx = ctx, .s = lost, .options = options, .frame = frame};
    lost->matched_of = 0;
    read_sources(lost, frame);
    measure_window(&a);
    if (frame->near) {
        const bst_star_fit fit = {.q_cam_from_gcrf = frame->near->q_cam_from_gcrf,
                                  .scale = frame->near->scale};
        out->candidates = 1;
        BST_TRY(verify(&a, fit, (const int[4]){-1, -1, -1, -1}, MOST_FIRST_PX, out));
    }
    int most = lost->count < options->max_stars ? lost->count : options->max_stars;
    for (int l = 3; l < most && searching(&a, out); l++) {
        for (int k = 2; k < l && searching(&a, out); k++) {
            for (int j = 1; j < k && searching(&a, out); j++) {
                for (int i = 0; i < j && searching(&a, out); i++) {
                    BST_TRY(try_quad(&a, (const int[4]){i, j, k, l}, out));
                }
            }
        }
    }
    return BST_OK;
}
