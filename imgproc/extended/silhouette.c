#include "imgproc/extended/silhouette.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "imgproc/extended/edges.h"
#include "sim/core/pages.h"

/* bst_bright_region.target of a small region near a target: it is none of its own. */
enum { NEAR_TARGET = -2 };
enum { REGIONS_MAX = 4096, SKY_SAMPLES = 8192, SKY_SHARE = 5 };

/* Thresholds of the hysteresis, in the noise of a dark pixel. With HIGH no region in 1e8 frames of
 * 2048^2 pixels is noise. */
static const double HIGH = 8.0, LOW = 4.0;
/* Least share of a region's median signal of its pixels: below it is light that the optics scatter.
 * Design choice: polished optics scatter less than 1e-4 into a pixel some FWHM beside a surface.
 * With a known PSF, whose wings bst_edges does not know, more in small regions: above the wings of
 * usual PSFs. In larger ones the blur of the edges matters less, and dim parts more: the share
 * falls with the size from WIDE_FWHM on. */
static const double LEAST_SHARE = 0.05, LEAST_SHARE_FAR = 1e-4, WIDE_FWHM = 10.0;
/* Least flux or area of a part relative to the part that it is joined to: smaller ones are stars or
 * hits. */
static const double LEAST_PART = 0.003;
/* Least area of a target relative to the largest of the frame: smaller ones are its fragments. */
static const double LEAST_TARGET = 0.02;
/* Reach of the mask beyond a target's light, in sigma of the PSF: edges have fallen to 1e-3 there.
 */
static const double MASK_SIGMAS = 3.0;
/* Ratio of signal and noise from which the slope of a pixel's light gives an edge: the logarithm is
 * good to a fifth, which moves the edge by a tenth of the PSF's sigma. A dim part of
 * its own, such as a panel seen edge on, counts from PART_SNR on: its place is good to a third of
 * the PSF's sigma, but without it the outline ends at the body. For the light outside of edges
 * PART_SNR trebles the errors of scenarios/inspection.json at 10 to 17 px. */
static const double EDGE_SNR = 5.0, PART_SNR = 3.0, NEIGHBOUR_SNR = 2.0;
/* Most of a frame that can be a target; a frame that is brighter has no sky to compare with. */
static const double MOST_OF_FRAME = 0.8;

bst_status bst_silhouette_finder_create(bst_ctx *ctx, int max_width, int max_height,
                                        bst_silhouette_finder *out) {
    assert(max_width > 0 && max_height > 0 && out);
    size_t pixels = (size_t)max_width * (size_t)max_height;
    size_t points = 4 * ((size_t)max_width + (size_t)max_height);
    *out = (bst_silhouette_finder){.max_width = max_width, .max_height = max_height};
    out->signal = bst_pages_alloc(pixels * sizeof *out->signal);
    out->region = bst_pages_zero(pixels, sizeof *out->region);
    /* each pixel may be in a region and outside of a silhouette */
    out->pixels = bst_pages_alloc(2 * pixels * sizeof *out->pixels);
    out->regions = calloc(REGIONS_MAX, sizeof *out->regions);
    out->points = calloc(points, sizeof *out->points);
    out->hull = calloc(2 * points, sizeof *out->hull);
    if (!out->signal || !out->region || !out->pixels || !out->regions || !out->points ||
        !out->hull) {
        bst_silhouette_finder_free(out);
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for silhouettes in frames of %d x %d",
                        max_width, max_height);
    }
    return BST_OK;
}

void bst_silhouette_finder_free(bst_silhouette_finder *finder) {
    free(finder->signal);
    bst_pages_free(finder->region);
    free(finder->pixels);
    free(finder->regions);
    free(finder->points);
    free(finder->hull);
    *finder = (bst_silhouette_finder){0};
}

static int by_signal(const void *a, const void *b) {
    float p = *(const float *)a, q = *(const float *)b;
    return (p > q) - (p < q);
}

/* Level and noise of the sky, e-. The noise is at least that of the deviations below the level. */
static void measure_sky(const bst_silhouette_finder *s, const bst_silhouette_frame *f,
                        double *level_e, double *noise_e) {
    float sample[SKY_SAMPLES];
    int total = f->width * f->height, step = total / SKY_SAMPLES + 1, count = 0;
    for (int i = 0; i < total && count < SKY_SAMPLES; i += step) {
        if (s->signal[i] > BST_PIXEL_NONE) {
            sample[count++] = s->signal[i];
        }
    }
    qsort(sample, (size_t)count, sizeof *sample, by_signal);
    int share = count / SKY_SHARE, best = 0;
    for (int i = 0; i + share < count; i++) {
        if (sample[i + share] - sample[i] < sample[best + share] - sample[best]) {
            best = i;
        }
    }
    int middle = count > 0 ? best + share / 2 : 0;
    *level_e = count > 0 ? (double)sample[middle] : 0.0;
    /* 68.3 % of the deviations below the level are smaller than one sigma */
    int below = (int)(0.317 * middle);
    double spread = count > 0 ? *level_e - (double)sample[below] : 0.0;
    *noise_e = fmax(sqrt(f->read_variance_e2 + fmax(*level_e, 0.0)), spread);
}

/* Reads the frame: s->signal becomes the signal above the sky. Returns the sky's noise, e-. */
static double read_signal(bst_silhouette_finder *s, const bst_silhouette_frame *f) {
    double level, noise;
    size_t width = (size_t)f->width;
    for (int y = 0; y < f->height; y++) {
        f->read(f->user, y, 0, f->width, s->signal + (size_t)y * width);
    }
    measure_sky(s, f, &level, &noise);
    s->saturated_e = (float)(f->full_e - level);
    for (size_t i = 0; i < width * (size_t)f->height; i++) {
        float e = s->signal[i];
        s->signal[i] = e <= BST_PIXEL_NONE            ? 0.0f
                       : f->raw[i] >= f->saturated_dn ? s->saturated_e
                                                      : e - (float)level;
    }
    return noise;
}

/* Collects the pixels above `low` that are connected (8 neighbours) with pixel `seed`. */
static void flood(bst_silhouette_finder *s, const bst_silhouette_frame *f, int seed, float low,
                  bst_bright_region *out) {
    int end = out->first;
    s->region[seed] = 1;
    s->pixels[end++] = seed;
    out->x0 = out->x1 = seed % f->width;
    out->y0 = out->y1 = seed / f->width;
    out->flux_e = 0.0;
    out->target = -1;
    for (int next = out->first; next < end; next++) {
        int x = s->pixels[next] % f->width, y = s->pixels[next] / f->width;
        out->flux_e += (double)s->signal[s->pixels[next]];
        out->x0 = x < out->x0 ? x : out->x0;
        out->x1 = x > out->x1 ? x : out->x1;
        out->y0 = y < out->y0 ? y : out->y0;
        out->y1 = y > out->y1 ? y : out->y1;
        for (int k = 0; k < 9; k++) {
            int u = x + k % 3 - 1, v = y + k / 3 - 1;
            int at = v * f->width + u;
            if (u >= 0 && v >= 0 && u < f->width && v < f->height && !s->region[at] &&
                s->signal[at] > low) {
                s->region[at] = 1;
                s->pixels[end++] = at;
            }
        }
    }
    out->count = end - out->first;
}

/* Median signal of a region, e-, from a sample. */
static double median_of(const bst_silhouette_finder *s, const bst_bright_region *r) {
    float sample[SKY_SAMPLES];
    int step = r->count / SKY_SAMPLES + 1, count = 0;
    for (int i = 0; i < r->count; i += step) {
        sample[count++] = s->signal[s->pixels[r->first + i]];
    }
    qsort(sample, (size_t)count, sizeof *sample, by_signal);
    return (double)sample[count / 2];
}

/* Least signal of a region's pixels, e-. A saturated median says that a glint outshines the rest.
 */
static double least_of(const bst_silhouette_finder *s, const bst_silhouette_frame *f,
                       const bst_bright_region *r, double noise) {
    double median = median_of(s, r), wide = WIDE_FWHM * BST_FWHM_PER_SIGMA * f->sigma_px;
    double share = LEAST_SHARE * fmin(pow(wide / sqrt((double)r->count), 2.0), 1.0);
    bool steep = !f->wings || median >= (double)s->saturated_e;
    return fmax(LOW * noise, (steep ? LEAST_SHARE_FAR : fmax(share, LEAST_SHARE_FAR)) * median);
}

/* Removes pixels below `least` from a region. */
static void keep_above(bst_silhouette_finder *s, const bst_silhouette_frame *f, float least,
                       bst_bright_region *r) {
    int kept = 0;
    bst_bright_region out = {
        .first = r->first, .x0 = f->width, .y0 = f->height, .x1 = -1, .y1 = -1, .target = -1};
    for (int i = 0; i < r->count; i++) {
        int at = s->pixels[r->first + i], x = at % f->width, y = at / f->width;
        if (s->signal[at] < least) {
            s->region[at] = 0;
            continue;
        }
        s->pixels[r->first + kept++] = at;
        out.flux_e += (double)s->signal[at];
        out.x0 = x < out.x0 ? x : out.x0;
        out.x1 = x > out.x1 ? x : out.x1;
        out.y0 = y < out.y0 ? y : out.y0;
        out.y1 = y > out.y1 ? y : out.y1;
    }
    out.count = kept;
    *r = out;
}

static int largest_first(const void *a, const void *b) {
    const bst_bright_region *p = a, *q = b;
    if (p->count != q->count) {
        return p->count > q->count ? -1 : 1;
    }
    return (p->first > q->first) - (p->first < q->first);
}

/* Finds the bright regions, the largest first. */
static void find_regions(bst_silhouette_finder *s, const bst_silhouette_frame *f, double noise) {
    int total = f->width * f->height;
    s->pixel_count = 0;
    memset(s->region, 0, (size_t)total);
    s->region_count = 0;
    for (int i = 0; i < total && s->region_count < REGIONS_MAX; i++) {
        if (s->region[i] || !((double)s->signal[i] > HIGH * noise)) {
            continue;
        }
        bst_bright_region *r = &s->regions[s->region_count++];
        r->first = s->pixel_count;
        flood(s, f, i, (float)(LOW * noise), r);
        s->pixel_count += r->count;
    }
    for (int i = 0; i < s->region_count; i++) {
        double least = least_of(s, f, &s->regions[i], noise);
        keep_above(s, f, (float)least, &s->regions[i]);
    }
    qsort(s->regions, (size_t)s->region_count, sizeof *s->regions, largest_first);
}

/* Gap between the bounding boxes of two regions, px; 0: they overlap. */
static double gap_of(const bst_bright_region *a, const bst_bright_region *b) {
    int x = a->x0 > b->x1 ? a->x0 - b->x1 : b->x0 > a->x1 ? b->x0 - a->x1 : 0;
    int y = a->y0 > b->y1 ? a->y0 - b->y1 : b->y0 > a->y1 ? b->y0 - a->y1 : 0;
    return hypot(x, y);
}

/* Joins to region `first` those near it. Returns the number of parts; *box bounds them. */
static int join_parts(bst_silhouette_finder *s, const bst_extended_config *config, int first,
                      int target, bst_bright_region *box) {
    int parts = 1;
    s->regions[first].target = target;
    *box = s->regions[first];
    for (bool more = true; more;) {
        more = false;
        for (int i = first + 1; i < s->region_count; i++) {
            bst_bright_region *r = &s->regions[i];
            double size = hypot(box->x1 - box->x0 + 1, box->y1 - box->y0 + 1);
            bool small = r->flux_e < LEAST_PART * s->regions[first].flux_e &&
                         r->count < LEAST_PART * s->regions[first].count;
            if (r->target != -1 || gap_of(box, r) > config->join_share * size) {
                continue;
            }
            if (small) {
                r->target = NEAR_TARGET;
                continue;
            }
            r->target = target;
            box->x0 = r->x0 < box->x0 ? r->x0 : box->x0;
            box->x1 = r->x1 > box->x1 ? r->x1 : box->x1;
            box->y0 = r->y0 < box->y0 ? r->y0 : box->y0;
            box->y1 = r->y1 > box->y1 ? r->y1 : box->y1;
            box->flux_e += r->flux_e;
            box->count += r->count;
            parts++;
            more = true;
        }
    }
    return parts;
}

/* Sums over the light of a target. */
typedef struct light_sums {
    double s, x, y, xx, xy, yy;
    int pixels, saturated;
} light_sums;

static light_sums add_light(const bst_silhouette_finder *s, const bst_silhouette_frame *f,
                            int target, const bst_bright_region *box) {
    light_sums m = {0};
    for (int k = 0; k < s->region_count; k++) {
        const bst_bright_region *r = &s->regions[k];
        for (int i = 0; r->target == target && i < r->count; i++) {
            int at = s->pixels[r->first + i];
            double e = (double)s->signal[at];
            double x = at % f->width - box->x0, y = at / f->width - box->y0;
            m.s += e;
            m.x += e * x;
            m.y += e * y;
            m.xx += e * x * x;
            m.xy += e * x * y;
            m.yy += e * y * y;
            m.pixels++;
            m.saturated += f->raw[at] >= f->saturated_dn;
        }
    }
    return m;
}

/* Size of a uniform disc with the largest second moment of the light, less those of the PSF and of
 * a star's streak, px. A uniform disc of radius R has the variance R^2 / 4 along each axis. */
static double moment_size(const bst_silhouette_frame *f, const light_sums *m) {
    double x = m->x / m->s, y = m->y / m->s, psf = f->sigma_px * f->sigma_px;
    double xx = m->xx / m->s - x * x - psf - f->streak_x_px * f->streak_x_px / 12.0;
    double yy = m->yy / m->s - y * y - psf - f->streak_y_px * f->streak_y_px / 12.0;
    double xy = m->xy / m->s - x * y - f->streak_x_px * f->streak_y_px / 12.0;
    double largest = 0.5 * (xx + yy) + hypot(0.5 * (xx - yy), xy);
    return 4.0 * sqrt(fmax(largest, 0.0));
}

/* Marks what a closed silhouette encloses: in its box, pixels that no path outside the silhouette
 * connects with the box's border belong to it. Returns the sum over its pixels. */
static light_sums fill_holes(bst_silhouette_finder *s, const bst_silhouette_frame *f,
                             const bst_bright_region *box, int *queue) {
    int begin = 0, end = 0;
    light_sums area = {0};
    for (int y = box->y0; y <= box->y1; y++) {
        for (int x = box->x0; x <= box->x1; x++) {
            bool border = x == box->x0 || x == box->x1 || y == box->y0 || y == box->y1;
            if (border && s->region[y * f->width + x] == 0) {
                s->region[y * f->width + x] = 2;
                queue[end++] = y * f->width + x;
            }
        }
    }
    while (begin < end) {
        int x = queue[begin] % f->width, y = queue[begin] / f->width;
        begin++;
        for (int k = 0; k < 4; k++) {
            int u = x + (k == 0) - (k == 1), v = y + (k == 2) - (k == 3);
            if (u >= box->x0 && u <= box->x1 && v >= box->y0 && v <= box->y1 &&
                s->region[v * f->width + u] == 0) {
                s->region[v * f->width + u] = 2;
                queue[end++] = v * f->width + u;
            }
        }
    }
    for (int y = box->y0; y <= box->y1; y++) {
        for (int x = box->x0; x <= box->x1; x++) {
            uint8_t *at = &s->region[y * f->width + x];
            area.pixels += *at != 2;
            area.x += *at != 2 ? x : 0;
            area.y += *at != 2 ? y : 0;
            *at = *at != 2;
        }
    }
    return area;
}

/* Least signals of a pixel next to the outline. */
typedef struct least_signals {
    double slope_e, part_e, neighbour_e;
} least_signals;

/* Signal whose ratio to the noise of shot and sky is `snr`, e-. */
static double signal_of(double snr, double noise) {
    double half = 0.5 * snr * snr;
    return half + hypot(half, snr * noise);
}

/* True for a pixel that has `least` e- and is not outside of a brighter edge. */
static bool is_lit(const bst_silhouette_finder *s, const bst_edges *edges, int at, double least) {
    return (double)s->signal[at] >= least &&
           !bst_edges_outside(edges, at % edges->width, at / edges->width);
}

/* True for a pixel of a dim part: lit, as are two of its neighbours, since noise lifts single
 * pixels. The neighbours may be dimmer, and below the region's least signal. */
static bool is_dim_part(const bst_silhouette_finder *s, const bst_edges *edges, int at,
                        const least_signals *least) {
    int x = at % edges->width, y = at / edges->width, lit = 0;
    if (!is_lit(s, edges, at, least->part_e)) {
        return false;
    }
    for (int k = 0; k < 9; k++) {
        int u = x + k % 3 - 1, v = y + k / 3 - 1;
        lit += u >= 0 && v >= 0 && u < edges->width && v < edges->height &&
               is_lit(s, edges, v * edges->width + u, least->neighbour_e);
    }
    return lit >= 3;
}

/* True for a pixel of the shown target with enough light for its logarithm. */
static bool is_bright(const bst_silhouette_finder *s, const bst_edges *edges, int at,
                      const least_signals *least) {
    return s->region[at] &&
           ((double)s->signal[at] >= least->slope_e || is_dim_part(s, edges, at, least));
}

/* Outline from the light next to the first and last pixel of each row and column that have at least
 * `least`, or that are shown if none has. */
static void make_outline(bst_silhouette_finder *s, const bst_edges *edges,
                         const bst_bright_region *box, const least_signals *least, double noise,
                         bst_outline *out) {
    int n = 0;
    for (int k = 0; k < 2; k++) { /* rows, then columns */
        int lines = k == 0 ? box->y1 - box->y0 + 1 : box->x1 - box->x0 + 1;
        int length = k == 0 ? box->x1 - box->x0 + 1 : box->y1 - box->y0 + 1;
        int step = k == 0 ? 1 : edges->width, across = k == 0 ? edges->width : 1;
        for (int i = 0; i < lines; i++) {
            int from = box->y0 * edges->width + box->x0 + i * across;
            int a = 0, b = length - 1;
            while (a < length && !is_bright(s, edges, from + a * step, least)) {
                a++;
            }
            while (b > a && !is_bright(s, edges, from + b * step, least)) {
                b--;
            }
            for (int end = 0; a < length && end < 2; end++) {
                /* one pixel farther in, neighbours are above the noise */
                int at = b - a < 2 ? (a + b) / 2 : end == 0 ? a + 1 : b - 1;
                s->points[n++] = bst_edges_place(edges, box->x0 + (k == 0 ? at : i),
                                                 box->y0 + (k == 0 ? i : at), noise);
            }
        }
    }
    bst_outline_make(s->points, n, s->hull, out);
}

/* Measures a target, whose light is shown. */
static void measure(bst_silhouette_finder *s, const bst_silhouette_frame *f, double noise,
                    const bst_edges *edges, const bst_bright_region *box, const light_sums *m,
                    bst_silhouette *out) {
    out->flux_e = m->s;
    out->flux_variance = m->s + m->pixels * noise * noise;
    out->light_x_px = box->x0 + m->x / m->s;
    out->light_y_px = box->y0 + m->y / m->s;
    out->saturated_px = m->saturated;
    out->edge = box->x0 <= 0 || box->y0 <= 0 || box->x1 >= f->width - 1 || box->y1 >= f->height - 1;
    least_signals least = {signal_of(EDGE_SNR, noise), signal_of(PART_SNR, noise),
                           signal_of(NEIGHBOUR_SNR, noise)};
    out->least_e = least.part_e;
    make_outline(s, edges, box, &least, noise, &out->outline);
    if (out->outline.count < 3) { /* all of it is dim */
        least = (least_signals){noise, noise, noise};
        make_outline(s, edges, box, &least, noise, &out->outline);
    }
    (void)bst_outline_centroid(&out->outline, &out->centre_x_px, &out->centre_y_px);
    bst_outline_extent(&out->outline, &out->length_px, &out->angle_rad, &out->width_px);
    bst_outline_bounds(&out->outline, &out->x0_px, &out->y0_px, &out->x1_px, &out->y1_px);
}

/* Marks the pixels that are shown and those within `reach` px in the mask. */
static void mark(const bst_silhouette_finder *s, const bst_silhouette_frame *f,
                 const bst_bright_region *box, int reach, uint8_t *mask) {
    for (int y = box->y0; y <= box->y1; y++) {
        for (int x = box->x0; x <= box->x1; x++) {
            if (!s->region[y * f->width + x]) {
                continue;
            }
            int u0 = x > reach ? x - reach : 0, v0 = y > reach ? y - reach : 0;
            int u1 = x + reach < f->width ? x + reach : f->width - 1;
            int v1 = y + reach < f->height ? y + reach : f->height - 1;
            bool inner = x > box->x0 && x < box->x1 && y > box->y0 && y < box->y1 &&
                         s->region[y * f->width + x - 1] && s->region[y * f->width + x + 1] &&
                         s->region[(y - 1) * f->width + x] && s->region[(y + 1) * f->width + x];
            if (inner) { /* only pixels at the border reach beyond the silhouette */
                mask[y * f->width + x] = 1;
                continue;
            }
            for (int v = v0; v <= v1; v++) {
                memset(mask + (size_t)v * (size_t)f->width + u0, 1, (size_t)(u1 - u0 + 1));
            }
        }
    }
}

/* Leaves only the regions of one target in s->region within a box, without what is outside of its
 * edges if these are given. Returns true if any pixel is left. */
static bool show_target(bst_silhouette_finder *s, const bst_silhouette_frame *f, int target,
                        const bst_edges *edges, const bst_bright_region *box) {
    bool any = false;
    for (int y = box->y0; y <= box->y1; y++) {
        memset(s->region + (size_t)y * (size_t)f->width + box->x0, 0,
               (size_t)(box->x1 - box->x0 + 1));
    }
    for (int k = 0; k < s->region_count; k++) {
        const bst_bright_region *r = &s->regions[k];
        for (int i = 0; r->target == target && i < r->count; i++) {
            int at = s->pixels[r->first + i];
            s->region[at] = !edges || !bst_edges_outside(edges, at % f->width, at / f->width);
            any = any || s->region[at];
        }
    }
    return any;
}

void bst_silhouettes_find(bst_silhouette_finder *s, const bst_extended_config *config,
                          const bst_silhouette_frame *f, uint8_t *mask, bst_silhouettes *out) {
    assert(s && config && f && mask && out && f->width <= s->max_width);
    assert(f->height <= s->max_height && f->sigma_px > 0.0);
    out->count = 0;
    double noise = read_signal(s, f), total = (double)f->width * (double)f->height;
    find_regions(s, f, noise);
    bst_edges edges;
    bst_edges_init(&edges, s->signal, f->width, f->height, f->sigma_px);
    double largest = 0.0, handover = config->handover_fwhm * BST_FWHM_PER_SIGMA * f->sigma_px;
    for (int i = 0; i < s->region_count && out->count < BST_SILHOUETTES_MAX; i++) {
        if (s->regions[i].target != -1) {
            continue;
        }
        bst_bright_region box;
        int target = i;
        int parts = join_parts(s, config, i, target, &box);
        light_sums m = add_light(s, f, target, &box);
        double size = m.s > 0.0 ? moment_size(f, &m) : 0.0;
        bool filled = m.pixels > MOST_OF_FRAME * total;
        if (m.pixels < LEAST_TARGET * largest) {
            continue;
        }
        if (size < BST_SILHOUETTE_LEAST * handover || filled) {
            continue;
        }
        largest = fmax(largest, m.pixels);
        bst_silhouette *t = &out->items[out->count++];
        *t = (bst_silhouette){.moment_size_px = size,
                              .parts = parts,
                              .masked = size >= handover,
                              .may_extend = size >= config->return_share * handover};
        (void)show_target(s, f, target, NULL, &box);
        measure(s, f, noise, &edges, &box, &m, t);
        if (!show_target(s, f, target, &edges, &box)) {
            out->count--;
            continue;
        }
        light_sums area = fill_holes(s, f, &box, s->pixels + s->pixel_count);
        t->area_px2 = area.pixels;
        t->x_px = area.x / area.pixels;
        t->y_px = area.y / area.pixels;
        if (t->masked) {
            /* with the light beyond the edges */
            (void)show_target(s, f, target, NULL, &box);
            (void)fill_holes(s, f, &box, s->pixels + s->pixel_count);
            mark(s, f, &box, (int)ceil(MASK_SIGMAS * f->sigma_px), mask);
        }
    }
}
