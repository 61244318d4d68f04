#include "imgproc/measure/sharpness.h"

#include <assert.h>
#include <math.h>
#include <stdbool.h>

#include "imgproc/detect/background.h"

/* Model error of a pixel's light as estimated from its neighbours, share of the light: that of a
 * PSF width wrong by 7 % at sigma 0.85 px. The ratio of neighbouring pixels, exp(-1 / (2 s^2)),
 * changes by 1 / s^2 times the relative error of s; s^2 = sigma^2 + 1/12 px^2. */
static const double MODEL_SHARE = 0.09;

typedef struct neighbour {
    int dx, dy;
} neighbour;

static const neighbour neighbours[8] = {{-1, 0},  {1, 0}, {0, -1}, {0, 1},
                                        {-1, -1}, {1, 1}, {1, -1}, {-1, 1}};
static const int first_of[BST_SHARP_GROUPS] = {0, 0, 2, 4, 6},
                 end_of[BST_SHARP_GROUPS] = {8, 2, 4, 6, 8};

/* Estimate of a pixel's signal from one group of its neighbours, by the PSF ratios. */
static double estimate_from_neighbours(const bst_sharpness *s, int group, const double (*at)[3]) {
    double sum = 0.0;
    for (int k = first_of[group]; k < end_of[group]; k++) {
        const neighbour *n = &neighbours[k];
        sum += s->ratio[n->dy + 1][n->dx + 1] * at[n->dy + 1][n->dx + 1];
    }
    return sum * s->inverse_square[group];
}

/* PSF from which the neighbour ratios are computed. */
typedef struct source {
    const bst_imgproc_gauss *psf;
    const bst_known_psf *known;
    int binning;
    double sigma_px;
} source;

/* PSF shares of the 3 x 3 pixels about a pixel, for a source offset by (x, y) from its centre;
 * node: of a known PSF's field. */
static void psf_on_nine_pixels(const source *from, int node, double x, double y,
                               double image[3][3]) {
    if (!from->known) {
        double unused[3][9];
        bst_imgproc_stamp stamp = {-1, -1, 3, 3};
        bst_imgproc_shape shape = {.x_px = x, .y_px = y, .sigma_px = from->sigma_px};
        bst_imgproc_gauss_render(from->psf, &shape, &stamp, image[0], unused[0], unused[1],
                                 unused[2]);
        return;
    }
    for (int j = 0; j < 3; j++) {
        for (int i = 0; i < 3; i++) {
            image[j][i] =
                bst_known_psf_share(from->known, node, from->binning, i - 1 - x, j - 1 - y);
        }
    }
}

void bst_sharpness_set(bst_sharpness *s, const bst_imgproc_gauss *psf, const bst_known_psf *known,
                       int binning, double sigma_px) {
    if (s->sigma_px == sigma_px && s->binning == binning) {
        return;
    }
    enum { PHASES = 5 };
    double image[3][3];
    source from = {psf, known, binning, sigma_px};
    int nodes = known ? known->nodes : 0;
    s->sigma_px = sigma_px;
    s->binning = binning;
    psf_on_nine_pixels(&from, nodes, 0.0, 0.0, image);
    for (int j = 0; j < 3; j++) {
        for (int i = 0; i < 3; i++) {
            s->ratio[j][i] = image[j][i] / image[1][1];
        }
    }
    for (int g = 0; g < BST_SHARP_GROUPS; g++) {
        double square = 0.0, cube = 0.0;
        for (int k = first_of[g]; k < end_of[g]; k++) {
            double r = s->ratio[neighbours[k].dy + 1][neighbours[k].dx + 1];
            square += r * r;
            cube += r * r * r;
        }
        square = fmax(square, 1e-12);
        s->inverse_square[g] = 1.0 / square;
        s->cube[g] = cube / (square * square);
        s->floor[g] = 1.0;
    }
    for (int p = 0; p < PHASES * PHASES * (nodes + 1); p++) {
        psf_on_nine_pixels(&from, p / (PHASES * PHASES), (p % PHASES + 0.5) / PHASES - 0.5,
                           (p / PHASES % PHASES + 0.5) / PHASES - 0.5, image);
        for (int g = 0; g < BST_SHARP_GROUPS; g++) {
            double ratio = estimate_from_neighbours(s, g, (const double(*)[3])image) / image[1][1];
            s->floor[g] = fmin(s->floor[g], ratio);
        }
    }
    for (int g = 0; g < BST_SHARP_GROUPS; g++) {
        const neighbour *n = &neighbours[first_of[g]];
        s->factor[g] = (float)(s->ratio[n->dy + 1][n->dx + 1] * s->inverse_square[g]);
        s->share[g] = (float)(s->inverse_square[0] / s->inverse_square[g]);
        /* slightly below the double-precision limit */
        double noise = sqrt(s->floor[g] * s->floor[g] + s->inverse_square[g]);
        s->deviation[g] = (float)(0.999 * BST_SHARP_DEVIATION * noise);
    }
}

double bst_sharpness_signal(const bst_sharpness *s, float signal) {
    return signal == BST_PIXEL_SATURATED && s->full_e > 0.0 ? s->full_e : (double)signal;
}

bool bst_sharpness_is_open(const bst_sharpness *s, const float *signal, int width, int height,
                           float noise_e, int x, int y) {
    if (x < 1 || y < 1 || x + 1 >= width || y + 1 >= height) {
        return true;
    }
    const float *pixel = signal + (long)y * width + x, *above = pixel - width,
                *below = pixel + width;
    float c = (float)bst_sharpness_signal(s, *pixel), e1 = (pixel[-1] + pixel[1]) * s->factor[1],
          e2 = (above[0] + below[0]) * s->factor[2], e3 = (above[-1] + below[1]) * s->factor[3],
          e4 = (above[1] + below[-1]) * s->factor[4];
    float all = (e1 * s->share[1] + e2 * s->share[2]) + (e3 * s->share[3] + e4 * s->share[4]);
    float f0 = (float)s->floor[0], f1 = (float)s->floor[1], f2 = (float)s->floor[2],
          f3 = (float)s->floor[3], f4 = (float)s->floor[4];
    /* the source's shot noise and the model error would only add to the deviations */
    return (f0 * c - all > noise_e * s->deviation[0]) | (f1 * c - e1 > noise_e * s->deviation[1]) |
           (f2 * c - e2 > noise_e * s->deviation[2]) | (f3 * c - e3 > noise_e * s->deviation[3]) |
           (f4 * c - e4 > noise_e * s->deviation[4]);
}

bool bst_sharpness_is_telling(const bst_sharpness *s, float signal, float noise_e) {
    float c = (float)bst_sharpness_signal(s, signal);
    bool telling = false;
    for (int g = 0; g < BST_SHARP_GROUPS; g++) {
        telling = telling || (float)s->floor[g] * c > 2.0f * noise_e * s->deviation[g];
    }
    return telling;
}

/* A pixel's signal and its eight neighbours'. */
typedef struct neighbourhood {
    double centre, at[3][3];
    bool known[3][3];
} neighbourhood;

/* least: neighbours that are full count with their least charge */
static neighbourhood read_neighbourhood(const bst_sharpness *sharpness, const float *signal,
                                        int width, int height, int x, int y, bool least) {
    neighbourhood s = {.centre = bst_sharpness_signal(sharpness, signal[(long)y * width + x])};
    for (int j = 0; j < 3; j++) {
        for (int i = 0; i < 3; i++) {
            int u = x + i - 1, v = y + j - 1;
            bool inside = u >= 0 && v >= 0 && u < width && v < height;
            float here = inside ? signal[(long)v * width + u] : BST_PIXEL_NONE;
            s.at[j][i] = least ? bst_sharpness_signal(sharpness, here) : (double)here;
            s.known[j][i] = s.at[j][i] > (double)BST_PIXEL_NONE;
            s.at[j][i] = s.known[j][i] ? s.at[j][i] : 0.0;
        }
    }
    return s;
}

/* True if all neighbours of a group are measurements. */
static bool is_whole(const neighbourhood *s, int group) {
    bool all = true;
    for (int k = first_of[group]; k < end_of[group]; k++) {
        all = all && s->known[neighbours[k].dy + 1][neighbours[k].dx + 1];
    }
    return all;
}

/* Standard deviation of the light missing in a group of neighbours, for a given signal of the
 * pixel. */
static double sigma_of_group(const bst_sharpness *s, int g, double centre, double noise2) {
    double own = s->floor[g] * s->floor[g] * (noise2 + centre);
    double others = s->inverse_square[g] * noise2 + s->cube[g] * centre;
    double model = MODEL_SHARE * centre;
    return sqrt(own + others + model * model);
}

/* Largest deviation of the groups; 0 if none lacks light. */
static double largest_deviation(const bst_sharpness *s, const neighbourhood *p, double noise_e) {
    double worst = 0.0;
    for (int g = 0; g < BST_SHARP_GROUPS; g++) {
        if (is_whole(p, g)) {
            double missing = s->floor[g] * p->centre - estimate_from_neighbours(s, g, p->at);
            worst = fmax(worst, missing / sigma_of_group(s, g, p->centre, noise_e * noise_e));
        }
    }
    return worst;
}

double bst_sharpness_at(const bst_sharpness *s, const float *signal, int width, int height,
                        double noise_e, int x, int y) {
    assert(s && signal && width > 0 && height > 0);
    if (x < 0 || y < 0 || x >= width || y >= height ||
        !(bst_sharpness_signal(s, signal[(long)y * width + x]) > 3.0 * noise_e)) {
        return 0.0;
    }
    neighbourhood p = read_neighbourhood(s, signal, width, height, x, y, false);
    bool suspicious = false;
    /* the mean over all groups falls short only if one of the pairs does */
    for (int g = 1; g < BST_SHARP_GROUPS; g++) {
        suspicious = suspicious || estimate_from_neighbours(s, g, p.at) < s->floor[g] * p.centre;
    }
    return suspicious ? largest_deviation(s, &p, noise_e) : 0.0;
}

bst_sharpness_test bst_sharpness_compare(const bst_sharpness *s, const float *signal, int width,
                                         int height, double noise_e, int x, int y) {
    bst_sharpness_test out = {0};
    if (x < 0 || y < 0 || x >= width || y >= height ||
        !(bst_sharpness_signal(s, signal[(long)y * width + x]) > 3.0 * noise_e)) {
        return out;
    }
    bool full = signal[(long)y * width + x] == BST_PIXEL_SATURATED;
    neighbourhood p = read_neighbourhood(s, signal, width, height, x, y, full);
    double alone = 0.0;
    for (int g = 0; g < BST_SHARP_GROUPS; g++) {
        if (!is_whole(&p, g)) {
            continue;
        }
        double light = s->floor[g] * p.centre;
        double deviation = sigma_of_group(s, g, p.centre, noise_e * noise_e);
        alone = fmax(alone, light / deviation);
        if (g == 0) {
            out.all = (float)((light - estimate_from_neighbours(s, g, p.at)) / deviation);
            out.all_alone = (float)(light / deviation);
        }
    }
    out.worst = (float)largest_deviation(s, &p, noise_e);
    out.worst_alone = (float)alone;
    return out;
}
