#include "imgproc/streak/star_path.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "imgproc/streak/star_path_internal.h"
#include "sim/core/symmetric.h"

enum { DEGREE = 4, TERMS = DEGREE + 1, BEYOND = 12, MOST_STARS = 15, ACROSS = 3 };
enum { PASSES = 10, LEAST_SAMPLES = 5 };

/* A source whose variance along its longer axis is below this times that across is a point. */
static const double ROUND = 2.5;
/* Samples of an image above this, in units of its noise, belong to a source. */
static const double LEAST_SAMPLE = 2.0;
/* Light of a sample, over that of the path, below which it has no place of its own. */
static const double LEAST_LIGHT = 1.0;
/* Samples by which ends may differ and be the same. */
enum { SAME_END = BST_STAR_PATH_SAME_END };
/* Share of samples with light of another star, and the range of that light, in units of the image's
 * noise. */
static const double CROWDED = 0.2, OTHER_RANGE = 10.0;
/* Unevenness of a star's light along its streak, 1 sigma. Dark samples have it, too, by the wings
 * of the PSF: an end then lies where the light has fallen to half. */
static const double UNEVEN = 0.25;
/* Neighbouring samples share noise: so many count as one (exp(-1) at a distance of two sigma). */
static const double CORRELATED = 1.7;
static const double ROOT_2PI = 2.5066282746310002;
/* Largest correction of the centre line, px. */
static const double MOST_SHIFT_PX = 2.0;

void bst_star_path_map(const bst_star_path *path, double x_px, double y_px, double m[3]) {
    double x = (x_px - path->centre[0]) * path->tangent_per_px;
    double y = (y_px - path->centre[1]) * path->tangent_per_px;
    m[0] = 1.0 + x * x;
    m[1] = x * y;
    m[2] = 1.0 + y * y;
}

double bst_star_path_image_at(const bst_star_path_image *image, double x_px, double y_px) {
    int i = (int)floor(x_px), j = (int)floor(y_px);
    if (i < 0 || j < 0 || i + 1 >= image->width || j + 1 >= image->height) {
        return 0.0;
    }
    const float *v = &image->values[j * image->width + i];
    double f = x_px - i, g = y_px - j;
    return (1.0 - g) * ((1.0 - f) * (double)v[0] + f * (double)v[1]) +
           g * ((1.0 - f) * (double)v[image->width] + f * (double)v[image->width + 1]);
}

/* Centre, axes and extent of a source. */
typedef struct frame {
    double x, y, c, s; /* centre; the longer axis points right */
    double low, high;  /* along it */
    bool round;
} frame;

static frame frame_of(const bst_star_path_image *image, const int *pixels, int count) {
    double sum = 1e-9, m[5] = {0};
    for (int i = 0; i < count; i++) {
        double x = pixels[i] % image->width, y = pixels[i] / image->width;
        double v = fmax((double)image->values[pixels[i]] - LEAST_SAMPLE, 0.0);
        sum += v;
        m[0] += v * x;
        m[1] += v * y;
        m[2] += v * x * x;
        m[3] += v * x * y;
        m[4] += v * y * y;
    }
    frame f = {.x = m[0] / sum, .y = m[1] / sum, .low = HUGE_VAL, .high = -HUGE_VAL};
    double xx = m[2] / sum - f.x * f.x, xy = m[3] / sum - f.x * f.y, yy = m[4] / sum - f.y * f.y;
    double angle = 0.5 * atan2(2.0 * xy, xx - yy), spread = hypot(xx - yy, 2.0 * xy);
    f.c = cos(angle);
    f.s = sin(angle);
    f.round = !(xx + yy + spread > ROUND * (xx + yy - spread));
    for (int i = 0; i < count; i++) {
        if ((double)image->values[pixels[i]] > LEAST_SAMPLE) {
            double u =
                (pixels[i] % image->width - f.x) * f.c + (pixels[i] / image->width - f.y) * f.s;
            f.low = fmin(f.low, u);
            f.high = fmax(f.high, u);
        }
    }
    return f;
}

static double polynomial(const double c[TERMS], double t) {
    double v = 0.0;
    for (int k = TERMS - 1; k >= 0; k--) {
        v = v * t + c[k];
    }
    return v;
}

/* Polynomial of the source's centre line across the axis, in t from -1 to 1 along it. */
static bool centre_line(const frame *f, const bst_star_path_image *image, const int *pixels,
                        int count, double c[TERMS]) {
    double a[TERMS][TERMS] = {{0}}, g[TERMS] = {0}, inverse[TERMS][TERMS];
    double half = 0.5 * (f->high - f->low), middle = 0.5 * (f->high + f->low);
    for (int i = 0; i < count; i++) {
        double x = pixels[i] % image->width - f->x, y = pixels[i] / image->width - f->y;
        double w = (double)image->values[pixels[i]] - LEAST_SAMPLE;
        double t = (x * f->c + y * f->s - middle) / half, across = y * f->c - x * f->s,
               power[TERMS];
        if (w <= 0.0) {
            continue;
        }
        power[0] = 1.0;
        for (int k = 1; k < TERMS; k++) {
            power[k] = power[k - 1] * t;
        }
        for (int k = 0; k < TERMS; k++) {
            g[k] += w * power[k] * across;
            for (int l = 0; l < TERMS; l++) {
                a[k][l] += w * power[k] * power[l];
            }
        }
    }
    for (int k = 1; k < TERMS; k++) { /* a bend of a tenth of the length is usual */
        a[k][k] += pow(0.1 * half, -2.0) * pow(4.0, k);
    }
    if (!bst_symmetric_invert(TERMS, a[0], inverse[0])) {
        return false;
    }
    for (int k = 0; k < TERMS; k++) {
        c[k] = 0.0;
        for (int l = 0; l < TERMS; l++) {
            c[k] += inverse[k][l] * g[l];
        }
    }
    return true;
}

/* A path of samples under construction: places on the image. */
typedef struct draft {
    int count;
    double x[BST_STAR_PATH_ROOM], y[BST_STAR_PATH_ROOM], light[BST_STAR_PATH_ROOM];
    double evidence[BST_STAR_PATH_ROOM]; /* log-likelihood of a lit sample over a dark one */
} draft;

/* Greatest likelihood of a first (step -1) or last (step 1) sample more than SAME_END away from a
 * given one, over the likelihood of that one; logarithm, at most 0.
 *
 * Given:     from, end  the path's other and its own last sample */
static double rival_end(const draft *d, int from, int end, int step) {
    double sum = 0.0, best = -HUGE_VAL, own = 0.0;
    int stop = step > 0 ? d->count : -1;
    for (int k = from; k != stop; k += step) {
        sum += d->evidence[k];
        own = k == end ? sum : own;
        best = abs(k - end) > SAME_END ? fmax(best, sum) : best;
    }
    return best - own;
}

/* Distance from a lit sample towards a dark one at which the light has fallen to half, samples. */
static double half_light(const draft *d, double level, int lit, int dark) {
    double from = d->light[lit] / level;
    double to = dark >= 0 && dark < d->count ? d->light[dark] / level : 0.0;
    return from > to ? fmax(fmin((from - 0.5) / (from - to), 1.0), 0.0) : 0.0;
}

/* True if the stars' light goes on beyond an end of the path: at two of the second to fourth sample
 * beyond it, which the PSF does not reach, it is more than half the level. Where most stars have
 * light of others there, it is neither one star's light nor none, and is no evidence. */
static bool goes_on(const draft *d, double level, int end, int step) {
    int lit = 0;
    for (int i = 2; i <= 4; i++) {
        int k = end + step * i;
        lit += k >= 0 && k < d->count && d->light[k] > 0.5 * level;
    }
    return lit >= 2;
}

/* First and last sample of the path, with fractions: the most likely ends, which are those of the
 * stretch with the greatest sum of evidence. An end beyond which light goes on has no margin. */
static void find_ends(const draft *d, double level, double ends[2], double margin[2]) {
    double sum = 0.0, best = -HUGE_VAL;
    int from = 0, first = 0, last = d->count - 1;
    for (int k = 0; k < d->count; k++) {
        if (sum < 0.0) {
            sum = 0.0;
            from = k;
        }
        sum += d->evidence[k];
        if (sum > best) {
            best = sum;
            first = from;
            last = k;
        }
    }
    margin[0] = goes_on(d, level, first, -1) ? 0.0 : -rival_end(d, last, first, -1);
    margin[1] = goes_on(d, level, last, 1) ? 0.0 : -rival_end(d, first, last, 1);
    ends[0] = first - half_light(d, level, first, first - 1);
    ends[1] = last + half_light(d, level, last, last + 1);
}

static void point_at(const draft *d, double k, double *x, double *y) {
    int i = (int)floor(k);
    i = i < 0 ? 0 : i > d->count - 2 ? d->count - 2 : i;
    double f = k - i;
    *x = (1.0 - f) * d->x[i] + f * d->x[i + 1];
    *y = (1.0 - f) * d->y[i] + f * d->y[i + 1];
}

/* Smooths over five samples. */
static void smooth(const double *in, double *out, int count) {
    for (int k = 0; k < count; k++) {
        double sum = 0.0;
        int n = 0;
        for (int j = k - 2; j <= k + 2; j++) {
            if (j >= 0 && j < count) {
                sum += in[j];
                n++;
            }
        }
        out[k] = sum / n;
    }
}

static int by_value(const void *a, const void *b) {
    double d = *(const double *)a - *(const double *)b;
    return (d > 0.0) - (d < 0.0);
}

/* Level of a draft's light. */
static double level_of(const draft *d) {
    double sorted[BST_STAR_PATH_ROOM];
    memcpy(sorted, d->light, (size_t)d->count * sizeof *sorted);
    qsort(sorted, (size_t)d->count, sizeof *sorted, by_value);
    return fmax(sorted[d->count * 2 / 3], 1e-9);
}

/* Light of a sample of the path between ends: the mean nearby, without the samples next to the
 * ends, which the PSF has dimmed; and of a sample that an end divides the part inside. */
static double light_inside(const draft *d, const double ends[2], double level, int k) {
    double sum = 0.0;
    int n = 0;
    for (int j = k - 2; j <= k + 2; j++) {
        if (j >= ends[0] + 1.0 && j <= ends[1] - 1.0) {
            sum += d->light[j];
            n++;
        }
    }
    double from = fmax(ends[0], k - 0.5), to = fmin(ends[1], k + 0.5);
    return fmax(n > 0 ? sum / n : level, 0.05 * level) * fmax(to - from, 0.05);
}

/* Cuts a draft at its ends and sets the path from it; the map is that of the middle's place.
 *
 * Returned:  x_px, y_px  place of the middle */
static void finish(bst_star_path *path, draft *d, double *x_px, double *y_px) {
    double m[3], ends[2], level = level_of(d);
    find_ends(d, level, ends, path->margin);
    int first = (int)fmax(ceil(ends[0] - 0.5), 0.0);
    int last = (int)fmin(floor(ends[1] + 0.5), d->count - 1.0);
    point_at(d, 0.5 * (first + last), x_px, y_px);
    bst_star_path_map(path, *x_px, *y_px, m);
    double det = m[0] * m[2] - m[1] * m[1], sum = 0.0;
    path->count = last - first + 1;
    for (int k = 0; k < path->count; k++) {
        double u = d->x[first + k] - *x_px, v = d->y[first + k] - *y_px;
        path->place[k][0] = (m[2] * u - m[1] * v) / det;
        path->place[k][1] = (m[0] * v - m[1] * u) / det;
        path->light[k] = light_inside(d, ends, level, first + k);
        sum += path->light[k];
    }
    for (int k = 0; k < path->count; k++) {
        path->light[k] *= path->count / sum;
    }
    for (int e = 0; e < 2; e++) {
        double x, y;
        point_at(d, ends[e], &x, &y);
        path->ends[e][0] = (m[2] * (x - *x_px) - m[1] * (y - *y_px)) / det;
        path->ends[e][1] = (m[0] * (y - *y_px) - m[1] * (x - *x_px)) / det;
    }
}

void bst_star_path_point(bst_star_path *path) {
    path->count = 1;
    path->place[0][0] = path->place[0][1] = 0.0;
    path->light[0] = 1.0;
    memset(path->ends, 0, sizeof path->ends);
    path->margin[0] = path->margin[1] = HUGE_VAL;
}

bool bst_star_path_fit(bst_star_path *path, const bst_star_path_image *image, const int *pixels,
                       int count, double *x_px, double *y_px) {
    assert(path && image && pixels && count > 0);
    frame f = frame_of(image, pixels, count);
    double c[TERMS], half = 0.5 * (f.high - f.low), middle = 0.5 * (f.high + f.low);
    if (f.round || !(half > 2.0) || !centre_line(&f, image, pixels, count, c)) {
        bst_star_path_point(path);
        *x_px = f.x;
        *y_px = f.y;
        return true;
    }
    draft d = {.count = 0};
    double reach = half + BEYOND * BST_STAR_PATH_STEP_PX;
    for (double u = -reach; u <= reach;) {
        if (d.count == BST_STAR_PATH_ROOM) {
            return false;
        }
        double t = u / half, clipped = fmax(fmin(t, 1.0), -1.0), h = 1e-4;
        double slope = (polynomial(c, clipped) - polynomial(c, clipped - h)) / (h * half);
        double across = polynomial(c, clipped) + (t - clipped) * half * slope, along = u + middle;
        d.x[d.count] = f.x + along * f.c - across * f.s;
        d.y[d.count] = f.y + along * f.s + across * f.c;
        d.light[d.count] = bst_star_path_image_at(image, d.x[d.count], d.y[d.count]);
        d.count++;
        u += BST_STAR_PATH_STEP_PX / hypot(1.0, slope);
    }
    /* one source: the evidence of Gaussian noise, but for a factor */
    double level = level_of(&d);
    for (int k = 0; k < d.count; k++) {
        d.evidence[k] = d.light[k] - 0.5 * level;
    }
    finish(path, &d, x_px, y_px);
    return true;
}

/* Light of a star at a sample, in units of its amplitude. */
typedef struct light_of_star {
    double value, amplitude;
} light_of_star;

static int by_light(const void *a, const void *b) {
    double d = ((const light_of_star *)a)->value - ((const light_of_star *)b)->value;
    return (d > 0.0) - (d < 0.0);
}

/* Light at a place of the path: the median over the stars that have it in the frame, weighted by
 * their amplitudes. What crosses a bright star's streak changes it less. */
static double light_at(const bst_star_path *path, const bst_star_path_image *image,
                       const bst_star_path_star *stars, int count, const double place[2]) {
    light_of_star all[MOST_STARS];
    int inside = 0;
    double half = 0.0;
    for (int i = 0; i < count; i++) {
        double m[3];
        bst_star_path_map(path, stars[i].x_px, stars[i].y_px, m);
        double x = stars[i].x_px + m[0] * place[0] + m[1] * place[1];
        double y = stars[i].y_px + m[1] * place[0] + m[2] * place[1];
        if (x >= 0.0 && y >= 0.0 && x < image->width - 1 && y < image->height - 1) {
            double a = stars[i].amplitude;
            all[inside++] = (light_of_star){bst_star_path_image_at(image, x, y) / a, a};
            half += 0.5 * a;
        }
    }
    qsort(all, (size_t)inside, sizeof *all, by_light);
    for (int i = 0; i < inside; i++) {
        half -= all[i].amplitude;
        if (half <= 0.0) {
            return all[i].value;
        }
    }
    return 0.0;
}

double bst_star_path_evidence(const bst_star_path *path, const bst_star_path_image *image,
                              const bst_star_path_star *star, const double place[2]) {
    double m[3], a = star->amplitude;
    bst_star_path_map(path, star->x_px, star->y_px, m);
    double x = star->x_px + m[0] * place[0] + m[1] * place[1];
    double y = star->y_px + m[1] * place[0] + m[2] * place[1];
    if (x < 0.0 || y < 0.0 || x >= image->width - 1 || y >= image->height - 1) {
        return 0.0;
    }
    double v = bst_star_path_image_at(image, x, y), spread = hypot(1.0, UNEVEN * a);
    double other = CROWDED / (OTHER_RANGE + 4.0 * a);
    double lit = exp(-0.5 * (v - a) * (v - a) / (spread * spread)) / spread;
    double dark = exp(-0.5 * v * v / (spread * spread)) / spread;
    return log(((1.0 - CROWDED) / ROOT_2PI * lit + other) /
               ((1.0 - CROWDED) / ROOT_2PI * dark + other)) /
           CORRELATED;
}

/* Evidence that a place of the path is lit, in the light of all stars together. */
static double evidence_at(const bst_star_path *path, const bst_star_path_image *image,
                          const bst_star_path_star *stars, int count, const double place[2]) {
    double sum = 0.0;
    for (int i = 0; i < count; i++) {
        sum += bst_star_path_evidence(path, image, &stars[i], place);
    }
    return sum;
}

/* Place of a sample, counted from the path's first and extrapolated beyond its ends; its normal. */
static void extended_place(const bst_star_path *p, int k, double place[2], double normal[2]) {
    int near = k < 0 ? 0 : k >= p->count ? p->count - 1 : k;
    int a = near >= 3 ? near - 3 : 0, b = near + 3 < p->count ? near + 3 : p->count - 1;
    double tx = p->place[b][0] - p->place[a][0], ty = p->place[b][1] - p->place[a][1];
    double length = fmax(hypot(tx, ty), 1e-9);
    tx /= length;
    ty /= length;
    place[0] = p->place[near][0] + (k - near) * BST_STAR_PATH_STEP_PX * tx;
    place[1] = p->place[near][1] + (k - near) * BST_STAR_PATH_STEP_PX * ty;
    normal[0] = -ty;
    normal[1] = tx;
}

/* One pass: measures the path and its continuation beyond the ends.
 *
 * Returned:  x_px, y_px  place of the new middle relative to the old one */
static void refine_once(bst_star_path *path, const bst_star_path_image *image,
                        const bst_star_path_star *stars, int count, double *x_px, double *y_px) {
    draft d = {.count = path->count + 2 * BEYOND};
    double shift[BST_STAR_PATH_ROOM], smoothed[BST_STAR_PATH_ROOM];
    for (int k = 0; k < d.count; k++) {
        double place[2], normal[2], sum = 0.0, moment = 0.0;
        extended_place(path, k - BEYOND, place, normal);
        for (int t = -ACROSS; t <= ACROSS; t++) {
            const double at[2] = {place[0] + t * normal[0], place[1] + t * normal[1]};
            double v = fmax(light_at(path, image, stars, count, at), 0.0);
            sum += v;
            moment += t * v;
        }
        shift[k] = fmax(fmin(moment / fmax(sum, LEAST_LIGHT), MOST_SHIFT_PX), -MOST_SHIFT_PX);
    }
    smooth(shift, smoothed, d.count);
    for (int k = 0; k < d.count; k++) {
        double place[2], normal[2];
        extended_place(path, k - BEYOND, place, normal);
        double at[2] = {place[0] + smoothed[k] * normal[0], place[1] + smoothed[k] * normal[1]};
        d.light[k] = light_at(path, image, stars, count, at);
        d.evidence[k] = evidence_at(path, image, stars, count, at);
        d.x[k] = path->centre[0] + at[0];
        d.y[k] = path->centre[1] + at[1];
    }
    finish(path, &d, x_px, y_px);
    *x_px -= path->centre[0];
    *y_px -= path->centre[1];
}

void bst_star_path_refine(bst_star_path *path, const bst_star_path_image *image,
                          const bst_star_path_star *stars, int count) {
    assert(path && image && stars && count >= 0);
    bst_star_path_star moved[MOST_STARS];
    count = count < MOST_STARS ? count : MOST_STARS;
    memcpy(moved, stars, (size_t)count * sizeof *moved);
    for (int pass = 0; pass < PASSES; pass++) {
        if (path->count < LEAST_SAMPLES || count < 1 ||
            path->count + 2 * BEYOND > BST_STAR_PATH_ROOM) {
            return;
        }
        int before = path->count;
        double x, y, m[3];
        refine_once(path, image, moved, count, &x, &y);
        for (int i = 0; i < count; i++) {
            bst_star_path_map(path, moved[i].x_px, moved[i].y_px, m);
            moved[i].x_px += m[0] * x + m[1] * y;
            moved[i].y_px += m[1] * x + m[2] * y;
        }
        if (abs(path->count - before) <= 1 && pass > 0) {
            return;
        }
    }
}

/* Mean place over the time of a motion. */
static void mean_place(const bst_star_path_node *nodes, int count, double mean[2]) {
    double sum[2] = {0.0, 0.0}, total = nodes[count - 1].time - nodes[0].time;
    for (int i = 1; i < count; i++) {
        double dt = nodes[i].time - nodes[i - 1].time;
        sum[0] += 0.5 * dt * (nodes[i].x_px + nodes[i - 1].x_px);
        sum[1] += 0.5 * dt * (nodes[i].y_px + nodes[i - 1].y_px);
    }
    mean[0] = sum[0] / total;
    mean[1] = sum[1] / total;
}

bool bst_star_path_of_motion(bst_star_path *path, const bst_star_path_node *nodes, int count) {
    assert(path && nodes && count >= 2);
    double length = 0.0, mean[2], total = nodes[count - 1].time - nodes[0].time;
    for (int i = 1; i < count; i++) {
        length += hypot(nodes[i].x_px - nodes[i - 1].x_px, nodes[i].y_px - nodes[i - 1].y_px);
    }
    int samples = (int)fmin(floor(length / BST_STAR_PATH_STEP_PX + 0.5), BST_STAR_PATH_ROOM + 1);
    if (!(total > 0.0) || samples < 2 || samples > BST_STAR_PATH_ROOM) {
        return false;
    }
    mean_place(nodes, count, mean);
    memset(path->light, 0, sizeof path->light);
    path->count = samples;
    double step = length / samples, done = 0.0;
    int next = 0; /* sample whose middle comes next */
    for (int i = 1; i < count; i++) {
        double dx = nodes[i].x_px - nodes[i - 1].x_px, dy = nodes[i].y_px - nodes[i - 1].y_px;
        double piece = hypot(dx, dy), dt = nodes[i].time - nodes[i - 1].time, end = done + piece;
        for (; next < samples && (next + 0.5) * step <= end && piece > 0.0; next++) {
            double share = ((next + 0.5) * step - done) / piece;
            path->place[next][0] = nodes[i - 1].x_px + share * dx - mean[0];
            path->place[next][1] = nodes[i - 1].y_px + share * dy - mean[1];
        }
        /* the light of the piece goes to the samples that it crosses */
        int first = (int)fmin(floor(done / step), samples - 1);
        int last = (int)fmin(floor(end / step), samples - 1);
        for (int k = first; k <= last; k++) {
            double from = fmax(done, k * step), to = fmin(end, (k + 1) * step);
            path->light[k] += piece > 0.0 ? dt * fmax(to - from, 0.0) / piece : dt;
        }
        done = end;
    }
    for (; next < samples; next++) { /* rounding */
        path->place[next][0] = nodes[count - 1].x_px - mean[0];
        path->place[next][1] = nodes[count - 1].y_px - mean[1];
    }
    for (int k = 0; k < samples; k++) {
        path->light[k] *= samples / total;
    }
    for (int e = 0; e < 2; e++) {
        const bst_star_path_node *n = e == 0 ? &nodes[0] : &nodes[count - 1];
        path->ends[e][0] = n->x_px - mean[0];
        path->ends[e][1] = n->y_px - mean[1];
    }
    return true;
}
