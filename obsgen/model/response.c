#define _XOPEN_SOURCE 700 /* j0 */
#include "obsgen/model/response.h"

#include <assert.h>
#include <math.h>

#include "boresight/vec.h"

/* Variance of a pixel, px^2. */
static const double PIXEL_VARIANCE = 1.0 / 12.0;
/* Frequency steps of the OTF sums: exact for images that end within REACH_PX. */
enum { REACH_PX = 24 };
/* OTF value, without the pixel, below which frequencies are neglected. */
static const double LEAST_OTF = 1e-4;
/* Frequency, cycles per sensor pixel, beyond which no pixel-integrated OTF is significant. */
static const double MOST_FREQUENCY = 3.0;

/* Spectral sums of the products of source and filter image: at rest and along a line. */
typedef struct spectral_sums {
    double point[3], line[3];     /* source x source, filter x filter, source x filter */
    double gradient[3], filtered; /* of the filter: xx, xy, yy */
} spectral_sums;

/* Transfer function of binning b x b, relative to one sensor pixel, at f cycles per sensor pixel.
 */
static double binning_factor(double f, int b) {
    double s = sin(BST_PI * f);
    return b == 1 || fabs(s) < 1e-9 ? 1.0 : sin(BST_PI * f * b) / (b * s);
}

static double sinc(double x) {
    return fabs(x) < 1e-9 ? 1.0 : sin(BST_PI * x) / (BST_PI * x);
}

/* OTF of an image without the pixel. */
static void transfer(const bst_response_side *side, const int *node, const double *weight,
                     int nodes, double fx, double fy, double out[2]) {
    double blur =
        exp(-2.0 * BST_PI * BST_PI * side->sigma_px * side->sigma_px * (fx * fx + fy * fy));
    if (!side->psf) {
        out[0] = blur * sinc(fx) * sinc(fy);
        out[1] = 0.0;
        return;
    }
    out[0] = out[1] = 0.0;
    for (int n = 0; n < nodes; n++) {
        double at[2];
        bst_psf_otf(side->psf, node[n], fx, fy, at);
        out[0] += weight[n] * blur * at[0];
        out[1] += weight[n] * blur * at[1];
    }
}

/* Cutoff frequency of an image's OTF, cycles per sensor pixel. */
static double cutoff(const bst_response_side *side) {
    double widened =
        side->sigma_px > 0.0 ? sqrt(-log(LEAST_OTF) / 2.0) / (BST_PI * side->sigma_px) : INFINITY;
    return side->psf ? fmin(bst_psf_cutoff(side->psf), widened) : widened;
}

void bst_response_nodes_at(const bst_response_side *side, double x_px, double y_px,
                           bst_response_nodes *out) {
    *out = (bst_response_nodes){.count = 0};
    if (side->psf) {
        out->count = bst_psf_weights(side->psf, x_px, y_px, out->node, out->weight);
    }
}

void bst_response_otf(const bst_response_side *side, const bst_response_nodes *nodes, int binning,
                      double fx, double fy, double out[2]) {
    double bin = binning_factor(fx, binning) * binning_factor(fy, binning);
    transfer(side, nodes->node, nodes->weight, nodes->count, fx, fy, out);
    out[0] *= bin;
    out[1] *= bin;
}

double bst_response_cutoff(const bst_response_side *side) {
    return cutoff(side);
}

/* Sums source and filter spectra over all frequencies. */
static void sum_spectra(spectral_sums *s, const bst_response_side *source,
                        const bst_response_side *filter, int binning, double x_px, double y_px) {
    const bst_response_side *const sides[2] = {source, filter};
    int node[2][4] = {{0}}, nodes[2] = {0, 0};
    double weight[2][4] = {{0.0}}, step = 0.5 / (REACH_PX * binning);
    double limit = fmin(fmax(cutoff(source), cutoff(filter)), MOST_FREQUENCY);
    for (int k = 0; k < 2; k++) {
        if (sides[k]->psf) {
            nodes[k] = bst_psf_weights(sides[k]->psf, x_px, y_px, node[k], weight[k]);
        }
    }
    *s = (spectral_sums){.filtered = 0.0};
    int count = (int)ceil(limit / step);
    for (int j = 0; j <= count; j++) { /* half plane: the images are real */
        for (int i = -count; i <= count; i++) {
            double fx = i * step, fy = j * step, f = hypot(fx, fy), at[2][2];
            if (f > limit) {
                continue;
            }
            double bin = binning_factor(fx, binning) * binning_factor(fy, binning);
            double area = (j == 0 ? 1.0 : 2.0) * step * step * binning * binning * bin * bin;
            for (int k = 0; k < 2; k++) {
                transfer(sides[k], node[k], weight[k], nodes[k], fx, fy, at[k]);
            }
            const double products[3] = {
                at[0][0] * at[0][0] + at[0][1] * at[0][1],
                at[1][0] * at[1][0] + at[1][1] * at[1][1],
                at[0][0] * at[1][0] + at[0][1] * at[1][1],
            };
            /* mean over all directions of the line integral through the origin: 1 / (pi f) of the
             * plane; at the origin its mean over the cell */
            double line = i == 0 && j == 0 ? 4.0 * log(1.0 + sqrt(2.0)) / (BST_PI * step)
                                           : 1.0 / (BST_PI * f);
            for (int k = 0; k < 3; k++) {
                s->point[k] += area * products[k];
                s->line[k] += area * line / binning * products[k];
            }
            double turn = 2.0 * BST_PI * binning;
            s->gradient[0] += area * products[1] * turn * turn * fx * fx;
            s->gradient[1] += area * products[1] * turn * turn * fx * fy;
            s->gradient[2] += area * products[1] * turn * turn * fy * fy;
        }
    }
    s->filtered = s->point[1];
}

/* Frequencies of the sums over rings, and directions on half of each. */
enum { RINGS = 768, DIRECTIONS = 12 };

/* Correlation of an image with the Gaussian of sigma_px in the same pixels, over the Gaussian's own
 * norm. image, pixel: means over the rings of frequency. */
static double similarity(const double image[RINGS], const double pixel[RINGS], double step,
                         double sigma_px) {
    double both = 0.0, own = 0.0;
    for (int i = 0; i < RINGS; i++) {
        double f = step * (i + 0.5), turn = BST_PI * f * sigma_px;
        double gaussian = pixel[i] * exp(-2.0 * turn * turn);
        both += f * image[i] * gaussian;
        own += f * gaussian * gaussian;
    }
    return both / sqrt(own);
}

/* Sigma of the Gaussian nearest to an image, as image processing finds it for its widths
 * (imgproc/detect/known_psf.c), sensor px. */
static double nearest_sigma(const bst_response_side *side, int binning, double x_px, double y_px) {
    const bst_response_side point = {NULL, 0.0};
    bst_response_nodes nodes, none = {.count = 0};
    double image[RINGS] = {0.0}, pixel[RINGS] = {0.0};
    double step = fmin(cutoff(side), MOST_FREQUENCY) / RINGS;
    bst_response_nodes_at(side, x_px, y_px, &nodes);
    for (int i = 0; i < RINGS; i++) {
        for (int a = 0; a < DIRECTIONS; a++) {
            double f = step * (i + 0.5), angle = BST_PI * (a + 0.5) / DIRECTIONS, at[2];
            bst_response_otf(side, &nodes, binning, f * cos(angle), f * sin(angle), at);
            image[i] += at[0];
            bst_response_otf(&point, &none, binning, f * cos(angle), f * sin(angle), at);
            pixel[i] += at[0];
        }
    }
    double low = 0.05, high = 20.0;
    for (int round = 0; round < 40; round++) { /* one maximum */
        double third = (high - low) / 3.0;
        bool wider = similarity(image, pixel, step, low + third) <
                     similarity(image, pixel, step, high - third);
        low += wider ? third : 0.0;
        high -= wider ? 0.0 : third;
    }
    return 0.5 * (low + high);
}

/* Root of the variance share at a node of the tabulated widths. */
static double width_node(int k) {
    double least = sqrt(BST_FALLOFF_LEAST);
    double place = cos(BST_PI * (k + 0.5) / BST_FALLOFF_WIDTHS);
    return 0.5 * (1.0 + least) + 0.5 * (1.0 - least) * place;
}

/* Most spectra that are transformed together. */
enum { SPECTRA = BST_FALLOFF_WIDTHS + 2 };

/* Share of a spectrum that widening leaves at a frequency.
 *
 * Given:     f            cycles/px
 *            variance_px2 before the widening
 *            share        root of its share in the widened variance */
static double widened_share(double f, int binning, double variance_px2, double share) {
    double turn = BST_PI * f * binning, more = variance_px2 * (1.0 / (share * share) - 1.0);
    return exp(-2.0 * turn * turn * more);
}

/* Hankel transform of spectra, given on rings up to the frequency `limit`, at the n-th tabulated
 * distance. */
static void transform_at(double (*spectrum)[SPECTRA], int count, double limit, int binning, int n,
                         double sum[SPECTRA]) {
    double turn = 2.0 * BST_PI * n / BST_FALLOFF_PER_PX * limit * binning / RINGS;
    for (int k = 0; k < count; k++) {
        sum[k] = 0.0;
    }
    for (int i = 0; i < RINGS; i++) {
        double wave = j0(turn * (i + 0.5));
        for (int k = 0; k < count; k++) {
            sum[k] += spectrum[i][k] * wave;
        }
    }
}

/* Mean correlation of source and filter over all directions, as a Hankel transform of its spectrum,
 * for images widened by Gaussians. The steps resolve the cusp at 0, which produces the wings. */
static void tabulate_falloff(const bst_response_side *source, const bst_response_side *filter,
                             int binning, double x_px, double y_px, bst_response *out) {
    enum { ALL = BST_FALLOFF_WIDTHS + 1 };
    bst_response_nodes nodes[2];
    double limit = fmin(fmax(cutoff(source), cutoff(filter)), MOST_FREQUENCY);
    double spectrum[RINGS][SPECTRA], peak = 0.0;
    bst_response_nodes_at(source, x_px, y_px, &nodes[0]);
    bst_response_nodes_at(filter, x_px, y_px, &nodes[1]);
    for (int i = 0; i < RINGS; i++) {
        double f = limit * (i + 0.5) / RINGS, all = 0.0;
        for (int a = 0; a < DIRECTIONS; a++) {
            double angle = BST_PI * (a + 0.5) / DIRECTIONS, p[2], q[2];
            bst_response_otf(source, &nodes[0], binning, f * cos(angle), f * sin(angle), p);
            bst_response_otf(filter, &nodes[1], binning, f * cos(angle), f * sin(angle), q);
            all += f * (p[0] * q[0] + p[1] * q[1]);
        }
        for (int k = 0; k < ALL; k++) {
            double share = k == 0 ? 1.0 : width_node(k - 1);
            spectrum[i][k] = all * widened_share(f, binning, out->product_px2, share);
        }
        peak += spectrum[i][0];
    }
    for (int n = 0; n < BST_FALLOFF_DISTANCES; n++) {
        double sum[SPECTRA];
        transform_at(spectrum, ALL, limit, binning, n, sum);
        out->falloff.value[n] = (float)(sum[0] / peak);
        for (int k = 1; k < ALL; k++) {
            out->falloff.widened[k - 1][n] = (float)(sum[k] / peak);
        }
    }
    out->falloff.tabulated = true;
}

/* Lagrange's interpolation between the tabulated widths; share: of the narrowest image's variance
 * in that of the widened one. */
static void interpolate_widths(float (*table)[BST_FALLOFF_DISTANCES], double share,
                               double value[BST_FALLOFF_DISTANCES]) {
    double root = sqrt(fmax(share, BST_FALLOFF_LEAST));
    for (int n = 0; n < BST_FALLOFF_DISTANCES; n++) {
        value[n] = 0.0;
    }
    for (int k = 0; k < BST_FALLOFF_WIDTHS; k++) {
        double weight = 1.0;
        for (int j = 0; j < BST_FALLOFF_WIDTHS; j++) {
            double at = width_node(j);
            weight *= j == k ? 1.0 : (root - at) / (width_node(k) - at);
        }
        for (int n = 0; n < BST_FALLOFF_DISTANCES; n++) {
            value[n] += weight * (double)table[k][n];
        }
    }
}

/* Sets falloff and image of widened images. */
static void widen_falloff(bst_response *r) {
    double value[BST_FALLOFF_DISTANCES];
    double share = r->product_px2 / (r->product_px2 + r->widened_px2);
    interpolate_widths(r->falloff.widened, share, value);
    for (int n = 0; n < BST_FALLOFF_DISTANCES; n++) {
        r->falloff.value[n] = (float)(value[n] / value[0]);
    }
    r->falloff_scale = fmin(sqrt(share / BST_FALLOFF_LEAST), 1.0);
    share = r->image_px2 / (r->image_px2 + r->widened_px2);
    interpolate_widths(r->falloff.widened_image, share, value);
    for (int n = 0; n < BST_FALLOFF_DISTANCES; n++) {
        r->falloff.image[n] = (float)value[n];
    }
    r->image_scale = fmin(sqrt(share / BST_FALLOFF_LEAST), 1.0);
}

/* Tabulates the images of a point, source and fitted PSF, for distances and the source's widths. */
static void tabulate_images(const bst_response_side *source, const bst_response_side *filter,
                            int binning, double x_px, double y_px, bst_response *out) {
    const bst_response_side *const sides[2] = {source, filter};
    double limit = fmin(fmax(cutoff(source), cutoff(filter)), MOST_FREQUENCY);
    double spectrum[RINGS][SPECTRA];
    bst_response_nodes nodes[2];
    bst_response_nodes_at(source, x_px, y_px, &nodes[0]);
    bst_response_nodes_at(filter, x_px, y_px, &nodes[1]);
    for (int i = 0; i < RINGS; i++) {
        double f = limit * (i + 0.5) / RINGS, mean[2] = {0.0, 0.0};
        for (int a = 0; a < 2 * DIRECTIONS; a++) {
            double angle = BST_PI * (0.5 * a + 0.25) / DIRECTIONS, at[2];
            double fx = f * cos(angle), fy = f * sin(angle);
            for (int k = 0; k < 2; k++) {
                bst_response_otf(sides[k], &nodes[k], binning, fx, fy, at);
                mean[k] += at[0] / (2 * DIRECTIONS);
            }
        }
        /* area of the ring, in cycles per read-out pixel */
        double area = 2.0 * BST_PI * f * limit / RINGS * binning * binning;
        spectrum[i][0] = area * mean[1];
        spectrum[i][1] = area * mean[0];
        for (int k = 0; k < BST_FALLOFF_WIDTHS; k++) {
            spectrum[i][k + 2] =
                area * mean[0] * widened_share(f, binning, out->image_px2, width_node(k));
        }
    }
    for (int n = 0; n < BST_FALLOFF_DISTANCES; n++) {
        double sum[SPECTRA];
        transform_at(spectrum, SPECTRA, limit, binning, n, sum);
        out->falloff.model[n] = (float)sum[0];
        out->falloff.image[n] = (float)sum[1];
        for (int k = 0; k < BST_FALLOFF_WIDTHS; k++) {
            out->falloff.widened_image[k][n] = (float)sum[k + 2];
        }
    }
}

/* Interpolated falloff at a distance. */
static double falloff_at(const bst_response *r, double distance_px) {
    double at = distance_px * r->falloff_scale * BST_FALLOFF_PER_PX;
    int i = (int)at;
    if (i >= BST_FALLOFF_DISTANCES - 1) {
        return 0.0;
    }
    double low = (double)r->falloff.value[i], high = (double)r->falloff.value[i + 1];
    return low + (at - i) * (high - low);
}

/* Cubic interpolation of a table at a place in it, in steps (Lagrange, four points; even about 0),
 * with its derivatives. */
static double cubic_at(const float *table, double at, double *slope, double *curvature) {
    int i = (int)at;
    if (i >= BST_FALLOFF_DISTANCES - 2) {
        *slope = *curvature = 0.0;
        return 0.0;
    }
    double t = at - i, a = (double)table[i > 0 ? i - 1 : 1], b = (double)table[i];
    double c = (double)table[i + 1], d = (double)table[i + 2];
    double third = (d - a) / 6.0 + 0.5 * (b - c), second = 0.5 * (a + c) - b;
    double first = c - b - second - third;
    *slope = first + t * (2.0 * second + 3.0 * t * third);
    *curvature = 2.0 * second + 6.0 * t * third;
    return b + t * (first + t * (second + t * third));
}

double bst_response_image_share(const bst_response *r, double distance_px) {
    double slope, curvature, scale = r->image_scale;
    return scale * scale *
           cubic_at(r->falloff.image, distance_px * scale * BST_FALLOFF_PER_PX, &slope, &curvature);
}

double bst_response_model_share(const bst_response *r, double distance_px, double *slope,
                                double *curvature) {
    double value = cubic_at(r->falloff.model, distance_px * BST_FALLOFF_PER_PX, slope, curvature);
    *slope *= BST_FALLOFF_PER_PX;
    *curvature *= BST_FALLOFF_PER_PX * BST_FALLOFF_PER_PX;
    return value;
}

double bst_response_falloff(const bst_response *r, double along_px, double across_px,
                            double length_px) {
    if (!r->falloff.tabulated) {
        double sigma_px = sqrt(r->both.across_px * r->both.along_px);
        return bst_matched_falloff(along_px, across_px, length_px, sigma_px);
    }
    if (length_px < 0.5) {
        return falloff_at(r, hypot(along_px, across_px));
    }
    /* the difference of positions on image and filter path has a triangular distribution */
    enum { MOST = 64 };
    int half = (int)fmin(ceil(1.5 * length_px), MOST);
    double sum = 0.0, own = 0.0;
    for (int k = 1 - half; k < half; k++) {
        double weight = 1.0 - fabs((double)k) / half, at = length_px * k / half;
        sum += weight * falloff_at(r, hypot(along_px - at, across_px));
        own += weight * falloff_at(r, fabs(at));
    }
    return sum / own;
}

double bst_response_pull(const bst_response *r, double distance_px) {
    if (!r->falloff.tabulated) {
        return bst_response_falloff(r, distance_px, 0.0, 0.0);
    }
    /* differences over one step of the table */
    double step = 1.0 / (BST_FALLOFF_PER_PX * r->falloff_scale);
    double curve = 2.0 * (1.0 - falloff_at(r, step)) / (step * step);
    double at = fmax(distance_px, step);
    double slope = (falloff_at(r, at - step) - falloff_at(r, at + step)) / (2.0 * step);
    return fmin(fmax(slope / (at * curve), 0.0), 1.0);
}

/* Equivalent Gaussian width from point and line sums. */
static bst_obsgen_image_width width_of(double point, double line) {
    bst_obsgen_image_width w = {.across_px = 1.0 / (2.0 * sqrt(BST_PI) * line)};
    w.along_px = 1.0 / (4.0 * BST_PI * point * w.across_px);
    return w;
}

/* Width of a circular Gaussian of this variance. */
static bst_obsgen_image_width even(double variance_px2) {
    return (bst_obsgen_image_width){sqrt(variance_px2), sqrt(variance_px2)};
}

void bst_response_set(bst_response *out, const bst_response_side *source,
                      const bst_response_side *filter, int binning, double x_px, double y_px) {
    assert(out && source && filter && binning >= 1);
    if (!source->psf && !filter->psf) {
        double scale = 1.0 / ((double)binning * binning);
        double s = source->sigma_px * source->sigma_px * scale + PIXEL_VARIANCE;
        double f = filter->sigma_px * filter->sigma_px * scale + PIXEL_VARIANCE;
        *out = (bst_response){.source = even(s),
                              .filter = even(f),
                              .both = even(0.5 * (s + f)),
                              .maxima_sigma_px = sqrt(f),
                              .nearest_sigma_px = filter->sigma_px / binning,
                              .falloff_scale = 1.0};
        return;
    }
    spectral_sums sums;
    sum_spectra(&sums, source, filter, binning, x_px, y_px);
    out->source = width_of(sums.point[0], sums.line[0]);
    out->filter = width_of(sums.point[1], sums.line[1]);
    out->both = width_of(sums.point[2], sums.line[2]);
    double steep =
        sqrt(fmax(sums.gradient[0] * sums.gradient[2] - sums.gradient[1] * sums.gradient[1], 0.0)) /
        sums.filtered;
    out->maxima_sigma_px = sqrt(0.5 / fmax(steep, 1e-6));
    out->falloff_scale = 1.0;
    out->nearest_sigma_px = nearest_sigma(filter, binning, x_px, y_px) / binning;
    out->product_px2 = 2.0 * out->both.across_px * out->both.along_px;
    out->widened_px2 = 0.0;
    tabulate_falloff(source, filter, binning, x_px, y_px, out);
    out->image_px2 = out->source.across_px * out->source.along_px;
    out->image_scale = 1.0;
    tabulate_images(source, filter, binning, x_px, y_px, out);
}

static bst_obsgen_image_width widen(bst_obsgen_image_width w, double variance_px2) {
    return (bst_obsgen_image_width){sqrt(w.across_px * w.across_px + variance_px2),
                                    sqrt(w.along_px * w.along_px + variance_px2)};
}

bst_response bst_response_widened(const bst_response *r, double variance_px2) {
    bst_response out = *r;
    out.source = widen(r->source, variance_px2);
    out.both = widen(r->both, 0.5 * variance_px2);
    out.widened_px2 += variance_px2;
    if (out.falloff.tabulated && variance_px2 > 0.0) {
        widen_falloff(&out);
    }
    return out;
}

double bst_response_product(const bst_obsgen_image_width *w, bst_obsgen_path_px p,
                            bst_obsgen_path_px q) {
    double ratio = w->across_px / w->along_px;
    bst_obsgen_path_px longer = hypot(p.dx, p.dy) > hypot(q.dx, q.dy) ? p : q;
    double length = hypot(longer.dx, longer.dy);
    if (ratio != 1.0 && length > 0.0) { /* along shrunk until both widths are one */
        double c = longer.dx / length, s = longer.dy / length;
        bst_obsgen_path_px *const both[2] = {&p, &q};
        for (int k = 0; k < 2; k++) {
            double along = (both[k]->dx * c + both[k]->dy * s) * (ratio - 1.0);
            both[k]->dx += along * c;
            both[k]->dy += along * s;
        }
    }
    return ratio * bst_matched_product(p, q, w->across_px);
}

double bst_response_efficiency(const bst_response *r, bst_obsgen_path_px source,
                               bst_obsgen_path_px filter) {
    double own = bst_response_product(&r->source, source, source) *
                 bst_response_product(&r->filter, filter, filter);
    return fmin(bst_response_product(&r->both, source, filter) / sqrt(own), 1.0);
}

double bst_response_norm_ratio(const bst_response *r, double length_px) {
    double sigma = sqrt(r->source.across_px * r->source.along_px);
    bst_obsgen_path_px path = {length_px, 0.0};
    return sqrt(bst_response_product(&r->source, path, path) /
                bst_matched_product(path, path, sigma));
}
