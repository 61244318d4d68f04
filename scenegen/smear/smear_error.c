/* Image error of a source from the errors of its nodes. */
#include <math.h>
#include <stdlib.h>

#include "scenegen/smear/gaussian_flank.h"
#include "scenegen/smear/smear_internal.h"

enum { MAX_TAPS = BST_PLACE_TAPS };

/* Means over a pixel's side of a Gaussian of unit sigma at x and of its derivatives up to the
 * sixth; integrals of Hermite functions are those of one order less. */
static void find_means(double x, double half, double out[7]) {
    double side[2][6];
    for (int end = 0; end < 2; end++) {
        double at = x + (end ? half : -half);
        side[end][0] = exp(-0.5 * at * at);
        side[end][1] = -at * side[end][0];
        for (int n = 2; n < 6; n++) {
            side[end][n] = -at * side[end][n - 1] - (n - 1) * side[end][n - 2];
        }
    }
    out[0] = sqrt(0.5 * BST_PI) * (erf((x + half) / sqrt(2.0)) - erf((x - half) / sqrt(2.0)));
    for (int n = 1; n < 7; n++) {
        out[n] = side[1][n - 1] - side[0][n - 1];
    }
}

/* pixel_part of bst_smear_node_aim for a Gaussian: its derivatives and values averaged over the
 * `binning` pixels of a side, the greatest of the directions along the rows to the diagonal. Along
 * the diagonal a pixel smooths the high frequencies of a narrow Gaussian less. */
void bst_smear_find_pixel_parts(double sigma_px, int binning, double part[3]) {
    enum { STEPS = 48, ANGLES = 3 };
    static const double greatest[3] = {1.0, 3.0, 15.0};
    double half = 0.5 * binning / sigma_px, most[3] = {0.0}, x[7], y[7];
    for (int k = 0; k < ANGLES * (STEPS + 1); k++) {
        double angle = 0.25 * BST_PI * (k % ANGLES) / (ANGLES - 1), at = 3.5 * (k / ANGLES) / STEPS;
        double c = cos(angle), d = sin(angle);
        find_means(at * c, half, x);
        find_means(at * d, half, y);
        for (int n = 0; n < 3; n++) {
            int order = 2 * n + 2;
            double sum = 0.0, choose = 1.0;
            for (int i = 0; i <= order; i++) {
                sum += choose * pow(c, order - i) * pow(d, i) * x[order - i] * y[i];
                choose *= (double)(order - i) / (i + 1);
            }
            most[n] = fmax(most[n], fabs(sum));
        }
    }
    find_means(0.0, half, x);
    for (int n = 0; n < 3; n++) {
        part[n] = most[n] / (greatest[n] * x[0] * x[0]);
    }
}

double bst_smear_level_prediction(const bst_smear_level *level, double scale) {
    return bst_smear_nodes_error(level->predicted, scale) + level->predicted_profile;
}

double bst_smear_level_error(const bst_smear_level *level, double scale) {
    return bst_smear_nodes_error(level->error, scale) + level->profile_error;
}

/* Error of a star `from_boresight_px` away that follows the boresight's track, in sigma of its
 * worst pixel. A Gaussian of amplitude A on dark noise d changes by at most 0.86 / sigma of A /
 * sqrt(A + d^2) per px of shift, and by all of its light at a different position. */
double bst_smear_single_error(const bst_smear *s, double peak_e, double from_boresight_px) {
    double part = s->half_diagonal_px > 0.0 ? from_boresight_px / s->half_diagonal_px : 0.0;
    double moved = s->spread_px * part * fmax(part, 1.0) * s->stretch;
    return fmin(0.86 * moved / s->sigma_px * peak_e / sqrt(peak_e + s->dark_variance_e2),
                peak_e / sqrt(s->dark_variance_e2));
}

bst_status bst_smear_find_sensitivity(bst_ctx *ctx, bst_smear *s) {
    int n = (s->binning < BST_PIXEL_PARTS ? s->binning : BST_PIXEL_PARTS) - 1;
    s->sensitivity = s->options.sensitivity;
    if (s->sensitivity && n > 0 && !s->binned[n]) {
        bst_psf_sensitivity *measured = malloc(sizeof *measured);
        if (!measured) {
            return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the derivatives of a PSF");
        }
        bst_status status =
            bst_psf_sensitivity_measure(ctx, s->sensitivity->psf, s->sensitivity->cutoff,
                                        s->options.node_sigma_px, n + 1, measured);
        if (status != BST_OK) {
            free(measured);
            return status;
        }
        s->binned[n] = measured;
    }
    if (!s->sensitivity && !s->gaussian_flanks[n]) {
        bst_flank_curve *curves = malloc(BST_FLANKS * sizeof *curves);
        if (!curves) {
            return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the errors beside a PSF's peak");
        }
        for (int f = 0; f < BST_FLANKS; f++) {
            double streak = f == BST_FLANK_STREAK ? s->sigma_px * BST_STREAK_SIGMAS : 0.0;
            bst_light_flank flank;
            bst_gaussian_flank_measure(s->sigma_px, n + 1, streak * streak / 12.0, &flank);
            bst_flank_curve_make(&flank, &curves[f]);
        }
        s->gaussian_flanks[n] = curves;
    }
    s->sensitivity = s->sensitivity && n > 0 ? s->binned[n] : s->sensitivity;
    s->flanks = s->sensitivity ? s->sensitivity->any_flank : s->gaussian_flanks[n];
    return BST_OK;
}

/* Curve of the errors beside the peak of a pattern along direction d. */
static const bst_flank_curve *curve_of(const bst_psf_sensitivity *of, int flank, int pattern,
                                       int d) {
    if (pattern < BST_PATTERN_GROUP) {
        return flank == BST_FLANK_STREAK ? &of->row_flank[d][pattern - BST_PATTERN_ROW]
                                         : &of->any_flank[flank];
    }
    int step = (pattern - BST_PATTERN_GROUP) / 2, order = (pattern - BST_PATTERN_GROUP) % 2;
    return flank == BST_FLANK_STREAK && step > 0 ? &of->smooth_flank[d][step - 1][order]
                                                 : &of->flank[flank][d][1 + order];
}

/* Error beside the peak by the patterns of a source's nodes, as flank_of. */
static double pattern_flank(const bst_smear *s, const bst_smear_drawn *drawn, int flank,
                            bst_flank_place place) {
    const bst_smear_level *level = drawn->level;
    double square = drawn->scale * drawn->scale;
    int k = BST_NODE_SCALES - 2;
    for (; k > 0 && square < 1.0; k--, square *= 2.0) {
    }
    double any = bst_flank_curve_value(&s->flanks[flank], place), higher = level->higher_part[k],
           most = higher * any;
    for (int p = 0; p < BST_PATTERNS; p++) {
        double part = fmax(level->missed_part[k][p], level->missed_part[k + 1][p]), beside = 0.0;
        for (int d = 0; d < BST_NODE_DIRECTIONS && part > 0.0; d++) {
            if (level->directions >> d & 1U) {
                const bst_flank_curve *curve = curve_of(s->sensitivity, flank, p, d);
                beside = fmax(beside, bst_flank_curve_value(curve, place));
            }
        }
        most = fmax(most, higher * any + fmin(part, 1.0 - higher) * beside);
        most = fmax(most, part * beside);
    }
    return most;
}

/* Error of the worst pixel, in its sigma, of a source whose greatest error is that of its peak:
 * beside the peak there is less noise, but not always less error. Along a path there is more light
 * than beside a point, where the path rests as a point. bound: of a Gaussian much wider than its
 * pixels. */
static double flank_of(const bst_smear *s, const bst_smear_drawn *d, bst_flank_place place,
                       double bound) {
    double wide = d->high[0] - d->low[0], high = d->high[1] - d->low[1],
           streak = BST_STREAK_SIGMAS * s->sigma_px;
    bool moves = wide * wide + high * high >= streak * streak && !d->level->rests;
    int f = moves ? BST_FLANK_STREAK : BST_FLANK_POINT;
    return s->sensitivity ? pattern_flank(s, d, f, place)
                          : fmax(bst_flank_curve_value(&s->flanks[f], place), bound);
}

/* The same of the error of profiles, which widens a point along x and y: by the steps of the grid's
 * phases, and of the widths. */
static double profile_flank_of(const bst_smear *s, bst_flank_place place, double bound) {
    enum { ALONG_X = 0, ALONG_Y = BST_NODE_DIRECTIONS / 2, SECOND_ORDER = 0 };
    if (!s->sensitivity) {
        return fmax(bst_flank_curve_value(&s->flanks[BST_FLANK_POINT], place), bound);
    }
    const bst_flank_curve(*of)[3] = s->sensitivity->flank[BST_FLANK_POINT];
    return fmax(bst_flank_curve_value(&of[ALONG_X][SECOND_ORDER], place),
                bst_flank_curve_value(&of[ALONG_Y][SECOND_ORDER], place));
}

/* Sets the image errors of a source at (x, y), wherever it falls. */
void bst_smear_set_error(bst_smear *s, const bst_smear_drawn *d) {
    int radius = d->radius;
    double travel_px = d->travel_px;
    double lost = bst_stamp_excess(&s->stamp, radius), peak_e = s->last_read_e;
    double error = d->error + s->chord_error;
    double profile = fmin(d->level->predicted_profile, d->predicted);
    double predicted = d->predicted - profile + s->chord_error;
    int border = radius + 1 < MAX_TAPS / 2 ? radius + 1 : radius;
    /* rounding of fixed-point positions, of the float offset to the node, and of some sums */
    double rounded = 0.86 / s->sigma_px * (1.0 / s->place_parts + 0x1p-24 * travel_px) + 0x1p-22;
    double shared = s->single && !d->moving
                        ? bst_smear_single_error(s, peak_e, sqrt(d->x * d->x + d->y * d->y))
                        : 0.0;
    double sigma_e = sqrt(peak_e + s->dark_variance_e2);
    bst_flank_place place = bst_flank_place_of(peak_e / s->dark_variance_e2);
    double flank = sigma_e / sqrt(FLANK * peak_e + s->dark_variance_e2);
    /* a border crosses a read-out pixel along its side at most */
    double tail = s->stamp.tail[border] * s->binning;
    s->last_error = (bst_error_budget_source){
        .x_px = (float)d->x,
        .y_px = (float)d->y,
        .peak_e = (float)peak_e,
        .nodes_e = (float)((flank * error + rounded) * peak_e + s->body_sigma * sigma_e),
        .predicted_e = (float)((flank_of(s, d, place, flank) * predicted +
                                profile_flank_of(s, place, flank) * profile + rounded) *
                                   peak_e +
                               s->body_sigma * sigma_e),
        .shared_e = (float)(shared * sigma_e),
        .excess_e = (float)(lost * peak_e),
        .border_e = (float)(s->last_peak_e * tail),
        .apart = d->moving && travel_px > s->travel_px};
}

/* Distance, in sigma of a node, beyond which its errors decrease: for a Gaussian, whose sixth
 * derivative is there 0.07 of its maximum, faster than the sixth power; in diffraction wings as the
 * third. */
#define NEAR_SIGMAS 3.0

/* Reduces the latest source's errors to what reaches the window, from the range of its positions.
 */
void bst_smear_bring_to_window(bst_smear *s, const bst_smear_drawn *d) {
    const double *low = d->low, *high = d->high;
    bst_error_budget_source *e = &s->last_error;
    bool gaussian = s->options.node_sigma_px <= 0.0;
    s->last_presence = 1.0;
    s->last_leaves = true;
    if (bst_camera_distorted(&s->camera)) {
        return;
    }
    double px = d->x + bst_camera_centre_x(&s->camera) - s->window.x0,
           py = d->y + bst_camera_centre_y(&s->camera) - s->window.y0;
    double far = s->margin_px - 1.0;
    s->last_leaves = px + low[0] < -far || py + low[1] < -far ||
                     px + high[0] > s->window.width - 1.0 + far ||
                     py + high[1] > s->window.height - 1.0 + far;
    double gap_x = fmax(px + low[0] - s->window.width, -1.0 - px - high[0]),
           gap_y = fmax(py + low[1] - s->window.height, -1.0 - py - high[1]);
    double gap = fmax(gap_x, gap_y), near = NEAR_SIGMAS * s->sigma_px;
    if (gap <= near) {
        return;
    }
    double presence = gaussian ? 0.1 * pow(near / gap, 6.0) : 0.3 * pow(near / gap, 3.0);
    /* the source's shot noise does not reach the window */
    if (presence * sqrt((double)e->peak_e + s->dark_variance_e2) > sqrt(s->dark_variance_e2)) {
        return;
    }
    s->last_presence = presence;
    s->last_gap_px = gap;
    e->nodes_e *= (float)presence;
    e->predicted_e *= (float)presence;
    e->shared_e *= (float)presence;
    e->peak_e = 0.0f;
    if (gaussian && gap > d->radius + 2.0) {
        e->excess_e = 0.0f;
    }
}

double bst_smear_last_gap_px(const bst_smear *s) {
    return s->last_gap_px;
}
