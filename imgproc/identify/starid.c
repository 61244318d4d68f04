#include "imgproc/identify/starid.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sim/core/arena.h"
#include "sim/core/heapsort.h"
#include "sim/optics/photometry.h"

enum { VOTERS = 150, PASSES = 5 };

/* Design choices. CELL_PX: vote cell; a shift is refined from there, and stars and detections agree
 * to a pixel when roll is known. CHANCE: largest probability that votes of chance matches alone are
 * as many. */
static const double CELL_PX = 2.0;
static const double CHANCE = 0.01;
/* 1 sigma prior of the roll error from onboard knowledge */
static const double ROLL_SIGMA_RAD = 3e-3;

struct bst_starid {
    bst_arena arena;                      /* of all arrays below */
    int max_stars, max_detections, cells; /* cells per side of the vote map */
    uint16_t *votes;
    int *by_y;         /* star indices sorted by y */
    int *bright;       /* indices of the brightest stars, brightest detections */
    int *star_of;      /* [detections]: matched star, -1: none */
    int matched_of;    /* number of detections in star_of; 0: no match */
    int *detection_of; /* [stars]: matched detection, -1: none */
    double *distance;  /* [stars]: distance to the matched detection, px */
};

static void lay_out(bst_starid *s) {
    int most = s->max_stars > s->max_detections ? s->max_stars : s->max_detections;
    size_t stars = (size_t)s->max_stars + 1;
    BST_ARENA_TAKE(&s->arena, s->votes, (size_t)s->cells * (size_t)s->cells);
    BST_ARENA_TAKE(&s->arena, s->by_y, stars);
    BST_ARENA_TAKE(&s->arena, s->bright, 2 * (size_t)most + 1);
    BST_ARENA_TAKE(&s->arena, s->star_of, (size_t)s->max_detections + 1);
    BST_ARENA_TAKE(&s->arena, s->detection_of, stars);
    BST_ARENA_TAKE(&s->arena, s->distance, stars);
}

bst_status bst_starid_create(bst_ctx *ctx, int max_stars, int max_detections, double max_radius_px,
                             bst_starid **out) {
    assert(out && max_stars >= 0 && max_detections >= 0 && max_radius_px > 0.0);
    *out = NULL;
    bst_starid *s = calloc(1, sizeof *s);
    if (!s) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for star identification");
    }
    s->max_stars = max_stars;
    s->max_detections = max_detections;
    s->cells = 2 * (int)ceil(max_radius_px / CELL_PX) + 2;
    lay_out(s);
    bst_status status = bst_arena_alloc(ctx, &s->arena, "star identification");
    if (status != BST_OK) {
        bst_starid_free(s);
        return status;
    }
    lay_out(s);
    *out = s;
    return BST_OK;
}

void bst_starid_free(bst_starid *s) {
    if (!s) {
        return;
    }
    bst_arena_free(&s->arena);
    free(s);
}

/* Sort order of expected stars by y. */
static bool star_higher(const void *context, int a, int b) {
    const bst_imgproc_expected_star *stars = context;
    return stars[a].y_px != stars[b].y_px ? stars[a].y_px < stars[b].y_px : a < b;
}
/* Sort order of expected stars by brightness. */
static bool star_brighter(const void *context, int a, int b) {
    const bst_imgproc_expected_star *stars = context;
    return stars[a].v_mag != stars[b].v_mag ? stars[a].v_mag < stars[b].v_mag : a < b;
}
/* Sort order of detections by brightness. */
static bool detection_brighter(const void *context, int a, int b) {
    const bst_detection *items = context;
    return items[a].flux_e != items[b].flux_e ? items[a].flux_e > items[b].flux_e : a < b;
}

/* True if a detection's label and magnitude are consistent with a star. Saturated or truncated
 * sources may be brighter than measured. */
static bool consistent(const bst_detection *d, const bst_imgproc_expected_star *s) {
    if (d->label != BST_LABEL_UNKNOWN && d->label != BST_LABEL_STAR) {
        return false;
    }
    double limit = 1.0 + 3.0 * fmin(bst_photometry_noise_mag(d), 1.0);
    double excess = d->v_mag - s->v_mag; /* > 0: fainter than the star */
    bool cut = (d->flags & (BST_DETECTION_SATURATED | BST_DETECTION_EDGE)) != 0;
    return excess > -limit && excess < (cut ? limit + 2.5 : limit);
}

/* Probability that a Poisson variable of mean mu is k or more. */
static double poisson_tail(double mu, int k) {
    if (k <= 0) {
        return 1.0;
    }
    double term = exp(-mu);
    for (int i = 1; i <= k; i++) {
        term *= mu / i;
    }
    double sum = 0.0;
    for (int i = k; i < k + 200 && term > 1e-300; i++) {
        sum += term;
        term *= mu / (i + 1);
    }
    return fmin(sum, 1.0);
}

/* Stars and detections to be matched. */
typedef struct match_input {
    const bst_starid_options *options;
    const bst_imgproc_expected_star *stars;
    int star_count;
    const bst_detection *items;
    int count;
} match_input;

/* Common shift of detections against stars, px, by voting over pairs. Returns false if no shift is
 * significant. */
static bool vote_for_shift(bst_starid *s, const match_input *p, double *shift_x, double *shift_y) {
    const bst_starid_options *o = p->options;
    const bst_imgproc_expected_star *stars = p->stars;
    const bst_detection *items = p->items;
    const int star_count = p->star_count, count = p->count;
    int *bright_stars = s->bright, *bright_items = s->bright + star_count;
    for (int i = 0; i < star_count; i++) {
        bright_stars[i] = i;
    }
    for (int i = 0; i < count; i++) {
        bright_items[i] = i;
    }
    bst_heapsort_indices(bright_stars, star_count, star_brighter, stars);
    bst_heapsort_indices(bright_items, count, detection_brighter, items);
    int m = star_count < VOTERS ? star_count : VOTERS, n = count < VOTERS ? count : VOTERS;
    int half = (int)ceil(o->search_radius_px / CELL_PX), side = 2 * half + 2;
    if (side > s->cells) {
        side = s->cells;
        half = (side - 2) / 2;
    }
    memset(s->votes, 0, (size_t)side * (size_t)side * sizeof *s->votes);
    double pairs = 0.0;
    for (int j = 0; j < m; j++) {
        const bst_imgproc_expected_star *star = &stars[bright_stars[j]];
        for (int i = 0; i < n; i++) {
            const bst_detection *d = &items[bright_items[i]];
            if (!consistent(d, star)) {
                continue;
            }
            pairs += 1.0;
            int cx = (int)floor((d->x_px - star->x_px) / CELL_PX) + half + 1;
            int cy = (int)floor((d->y_px - star->y_px) / CELL_PX) + half + 1;
            if (cx >= 0 && cy >= 0 && cx < side && cy < side) {
                s->votes[cy * side + cx]++;
            }
        }
    }
    int best = 0;
    double nearest = 0.0;
    for (int y = 0; y + 1 < side; y++) {
        for (int x = 0; x + 1 < side; x++) {
            const uint16_t *v = s->votes + y * side + x;
            int sum = v[0] + v[1] + v[side] + v[side + 1];
            double px = (x - half) * CELL_PX, py = (y - half) * CELL_PX;
            double from_zero = px * px + py * py;
            if (sum > best || (sum == best && sum > 0 && from_zero < nearest)) {
                best = sum;
                nearest = from_zero;
                *shift_x = px;
                *shift_y = py;
            }
        }
    }
    if (best == 0) {
        return false;
    }
    /* density of chance pairs: pairs over the area from which expected stars can come */
    double search = 2.0 * o->search_radius_px;
    double area = (o->field_width_px + search) * (o->field_height_px + search);
    double mean = pairs * 4.0 * CELL_PX * CELL_PX / area;
    double trials = fmax(search * search / (4.0 * CELL_PX * CELL_PX), 1.0);
    return trials * poisson_tail(mean, best) < CHANCE;
}

/* Predicted position of a star after the fitted shift and roll, px. */
static void expected_place(const bst_starid_options *o, const bst_imgproc_expected_star *star,
                           const bst_starid_result *r, double *x, double *y) {
    *x = star->x_px + r->shift_x_px - r->roll_rad * (star->y_px - o->centre_y_px);
    *y = star->y_px + r->shift_y_px + r->roll_rad * (star->x_px - o->centre_x_px);
}

/* Index in order of y of the first star with y >= y_px. */
static int first_not_below(const bst_starid *s, const bst_imgproc_expected_star *stars, int count,
                           double y_px) {
    int lo = 0, hi = count;
    while (lo < hi) {
        int mid = lo + (hi - lo) / 2;
        if (stars[s->by_y[mid]].y_px < y_px) {
            lo = mid + 1;
        } else {
            hi = mid;
        }
    }
    return lo;
}

/* Matches each detection to the nearest star within the tolerance, one to one. Returns the number
 * of matches. */
static int match_nearest(bst_starid *s, const match_input *p, double floor_px,
                         const bst_starid_result *r) {
    const bst_starid_options *o = p->options;
    const bst_imgproc_expected_star *stars = p->stars;
    const int star_count = p->star_count;
    for (int j = 0; j < star_count; j++) {
        s->detection_of[j] = -1;
    }
    int matched = 0;
    for (int i = 0; i < p->count; i++) {
        const bst_detection *d = &p->items[i];
        s->star_of[i] = -1;
        double sigma = sqrt(fmax(d->cov_xx + d->cov_yy, 0.0) + floor_px * floor_px);
        double tolerance = fmin(o->tolerance_px, 4.0 * sigma);
        /* undo the detection's shift and roll to find the rows to search */
        double y =
            d->y_px - r->shift_y_px - r->roll_rad * (d->x_px - r->shift_x_px - o->centre_x_px);
        int best = -1;
        double closest = tolerance;
        for (int k = first_not_below(s, stars, star_count, y - o->tolerance_px - 1.0);
             k < star_count && stars[s->by_y[k]].y_px <= y + o->tolerance_px + 1.0; k++) {
            int j = s->by_y[k];
            double ex, ey;
            expected_place(o, &stars[j], r, &ex, &ey);
            double distance = hypot(d->x_px - ex, d->y_px - ey);
            if (distance < closest && consistent(d, &stars[j])) {
                closest = distance;
                best = j;
            }
        }
        if (best < 0) {
            continue;
        }
        int rival = s->detection_of[best];
        if (rival >= 0 && s->distance[best] <= closest) {
            continue;
        }
        if (rival >= 0) {
            s->star_of[rival] = -1;
            matched--;
        }
        s->star_of[i] = best;
        s->detection_of[best] = i;
        s->distance[best] = closest;
        matched++;
    }
    return matched;
}

/* Least-squares fit of shift and roll to the matches; RMS of the residuals after the fit. */
static void fit_shift_and_roll(const bst_starid *s, const match_input *p, int matched,
                               bst_starid_result *r) {
    const bst_starid_options *o = p->options;
    const bst_imgproc_expected_star *stars = p->stars;
    const bst_detection *items = p->items;
    const int count = p->count;
    double a[3][3] = {{0}}, g[3] = {0};
    for (int i = 0; i < count; i++) {
        if (s->star_of[i] < 0) {
            continue;
        }
        const bst_imgproc_expected_star *star = &stars[s->star_of[i]];
        /* 0.05 px besides the noise: errors of distortion and catalogue; bright stars get no weight
         * beyond */
        double wx = 1.0 / (fmax(items[i].cov_xx, 0.0) + 0.0025);
        double wy = 1.0 / (fmax(items[i].cov_yy, 0.0) + 0.0025);
        double dx = items[i].x_px - star->x_px, dy = items[i].y_px - star->y_px;
        double tx = -(star->y_px - o->centre_y_px), ty = star->x_px - o->centre_x_px;
        a[0][0] += wx;
        a[1][1] += wy;
        a[2][0] += wx * tx;
        a[2][1] += wy * ty;
        a[2][2] += wx * tx * tx + wy * ty * ty;
        g[0] += wx * dx;
        g[1] += wy * dy;
        g[2] += wx * tx * dx + wy * ty * dy;
    }
    a[2][2] += 1.0 / (ROLL_SIGMA_RAD * ROLL_SIGMA_RAD);
    /* eliminate both shifts */
    double pivot = a[2][2] - a[2][0] * a[2][0] / a[0][0] - a[2][1] * a[2][1] / a[1][1];
    double rest = g[2] - a[2][0] * g[0] / a[0][0] - a[2][1] * g[1] / a[1][1];
    r->roll_rad = rest / pivot;
    r->shift_x_px = (g[0] - a[2][0] * r->roll_rad) / a[0][0];
    r->shift_y_px = (g[1] - a[2][1] * r->roll_rad) / a[1][1];
    double sum = 0.0;
    for (int i = 0; i < count; i++) {
        if (s->star_of[i] >= 0) {
            double x, y;
            expected_place(o, &stars[s->star_of[i]], r, &x, &y);
            sum += (items[i].x_px - x) * (items[i].x_px - x) +
                   (items[i].y_px - y) * (items[i].y_px - y);
        }
    }
    r->rms_px = sqrt(sum / (2.0 * matched));
}

void bst_starid_match(bst_starid *s, const bst_starid_options *o,
                      const bst_imgproc_expected_star *stars, int star_count, bst_detection *items,
                      int count, bst_starid_result *out) {
    assert(s && o && out && star_count >= 0 && count >= 0);
    assert((stars || star_count == 0) && (items || count == 0));
    *out = (bst_starid_result){0};
    s->matched_of = 0;
    star_count = star_count < s->max_stars ? star_count : s->max_stars;
    count = count < s->max_detections ? count : s->max_detections;
    const match_input p = {o, stars, star_count, items, count};
    if (star_count <= 0 || count <= 0 ||
        !vote_for_shift(s, &p, &out->shift_x_px, &out->shift_y_px)) {
        *out = (bst_starid_result){0};
        return;
    }
    for (int j = 0; j < star_count; j++) {
        s->by_y[j] = j;
    }
    bst_heapsort_indices(s->by_y, star_count, star_higher, stars);
    double floor_px = o->tolerance_px;
    for (int pass = 0; pass < PASSES; pass++) {
        out->matched = match_nearest(s, &p, floor_px, out);
        if (out->matched == 0) {
            *out = (bst_starid_result){0};
            return;
        }
        if (pass + 1 < PASSES) {
            fit_shift_and_roll(s, &p, out->matched, out);
            floor_px = fmax(0.25, fmin(out->rms_px, 0.5 * floor_px));
        }
    }
    s->matched_of = count;
    double others = 0.0; /* density of detections that are no catalogue stars, px^-2 */
    for (int i = 0; i < count; i++) {
        others += s->star_of[i] < 0;
    }
    others /= fmax(o->field_width_px * o->field_height_px, 1.0);
    for (int i = 0; i < count; i++) {
        if (s->star_of[i] < 0) {
            continue;
        }
        bst_detection *d = &items[i];
        /* likelihood of the same position given the errors, against the chance density of other
         * detections */
        double distance = s->distance[s->star_of[i]];
        double variance =
            0.5 * fmax(d->cov_xx + d->cov_yy, 0.0) + fmax(out->rms_px * out->rms_px, 1e-4);
        double near = exp(-0.5 * distance * distance / variance) / (2.0 * BST_PI * variance);
        d->star_id = stars[s->star_of[i]].id;
        d->label = BST_LABEL_STAR;
        d->label_probability = near / (near + others);
    }
}

bst_quat bst_starid_attitude(const bst_camera *camera, const bst_starid_options *o,
                             const bst_starid_result *r, bst_quat q_cam_from_gcrf) {
    bst_vec3 seen = bst_camera_unproject(camera, o->centre_x_px + r->shift_x_px,
                                         o->centre_y_px + r->shift_y_px);
    bst_vec3 meant = bst_camera_unproject(camera, o->centre_x_px, o->centre_y_px);
    bst_vec3 turn = bst_vec3_axpy(bst_vec3_cross(meant, seen), r->roll_rad, meant);
    return bst_quat_unit(bst_quat_mul(bst_quat_from_rotvec(turn), q_cam_from_gcrf));
}

int bst_starid_star_of(const bst_starid *s, int detection) {
    return detection < s->matched_of ? s->star_of[detection] : -1;
}
