#include "sim/optics/band.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "boresight/vec.h"
#include "sim/astro/bodies.h"
#include "sim/astro/curve_file.h"
#include "sim/core/file.h"
#include "sim/optics/solar_table.h"

#define PLANCK_JS 6.62607015e-34       /* SI, exact */
#define BOLTZMANN_J_PER_K 1.380649e-23 /* SI, exact */
/* Energy of a V = 0 source through Bessell's V, W/m2 per m (Bessell, Castelli and Plez 1998). */
#define V0_IRRADIANCE 3.631e-2
#define UM 1e-6

/* maximum panel width relative to its wavelength: eight points then integrate Planck's law times a
 * line to 1e-14 */
#define PANEL_SHARE 0.05
enum { GAUSS = 8, COLOURS = 117 };
#define COLOUR_FIRST (-0.4)
#define COLOUR_STEP 0.025

static const double gauss_place[GAUSS / 2] = {0.1834346424956498, 0.5255324099163290,
                                              0.7966664774136267, 0.9602898564975363};
static const double gauss_weight[GAUSS / 2] = {0.3626837833783620, 0.3137066458778873,
                                               0.2223810344533745, 0.1012285362903763};

/* A piecewise linear table. */
typedef struct table {
    const bst_optics_response_point *points;
    int count;
} table;

/* Quadrature over wavelength: the integral of f is the sum of weight * f(point). */
typedef struct quadrature {
    double *place, *weight;
    int count, capacity;
} quadrature;

struct bst_band {
    bst_optics_response_point *points[2]; /* detector, transmission */
    int count[2];
    quadrature rule; /* the weights include the response */
    double sun, mean_m;
    double sun_share[BST_SUNLIGHT_COLOURS]; /* of `sun`, next to each wavelength of
                                               bst_astro_sunlight */
    double log_star[COLOURS];
};

/* Flat tops with realistic edges; the silicon curve is a generic back-illuminated detector with a
 * visible coating. */
static const bst_optics_response_point silicon[] = {
    {0.30, 0.10}, {0.35, 0.40}, {0.40, 0.65}, {0.45, 0.85}, {0.50, 0.95}, {0.55, 1.00},
    {0.60, 1.00}, {0.65, 0.98}, {0.70, 0.94}, {0.75, 0.88}, {0.80, 0.78}, {0.85, 0.65},
    {0.90, 0.48}, {0.95, 0.30}, {1.00, 0.13}, {1.05, 0.04}, {1.10, 0.00}};
static const bst_optics_response_point swir[] = {
    {0.85, 0}, {0.95, 0.8}, {1.05, 1}, {1.60, 1}, {1.70, 0}};
static const bst_optics_response_point mwir[] = {{3.30, 0}, {3.50, 1}, {4.90, 1}, {5.10, 0}};
static const bst_optics_response_point lwir[] = {{7.80, 0}, {8.20, 1}, {11.80, 1}, {12.20, 0}};
#define COUNT_OF(a) ((int)(sizeof(a) / sizeof *(a)))
/* with the preset v a table of the optics alone uses Bessell's V as detector */
static const bst_optics_response_point bessell_v[] = {
    {0.47, 0},     {0.48, 0.03},  {0.49, 0.163}, {0.50, 0.458}, {0.51, 0.78},  {0.52, 0.967},
    {0.53, 1},     {0.54, 0.973}, {0.55, 0.898}, {0.56, 0.792}, {0.57, 0.684}, {0.58, 0.574},
    {0.59, 0.461}, {0.60, 0.359}, {0.61, 0.27},  {0.62, 0.197}, {0.63, 0.135}, {0.64, 0.081},
    {0.65, 0.045}, {0.66, 0.025}, {0.67, 0.017}, {0.68, 0.013}, {0.69, 0.009}, {0.70, 0}};

static table preset_table(int preset) {
    switch (preset) {
        case BST_BAND_SILICON:
            return (table){silicon, COUNT_OF(silicon)};
        case BST_BAND_SWIR:
            return (table){swir, COUNT_OF(swir)};
        case BST_BAND_MWIR:
            return (table){mwir, COUNT_OF(mwir)};
        case BST_BAND_LWIR:
            return (table){lwir, COUNT_OF(lwir)};
        default:
            return (table){bessell_v, COUNT_OF(bessell_v)};
    }
}

/* Interpolated spectral response at a wavelength; 0 outside the table. */
static double table_at(const bst_optics_response_point *points, int count, double wavelength_um) {
    if (count == 0 || wavelength_um < points[0].wavelength_um ||
        wavelength_um > points[count - 1].wavelength_um) {
        return 0.0;
    }
    int low = 0, high = count - 1;
    while (high - low > 1) {
        int middle = (low + high) / 2;
        *(points[middle].wavelength_um <= wavelength_um ? &low : &high) = middle;
    }
    double span = points[high].wavelength_um - points[low].wavelength_um;
    double u = span > 0.0 ? (wavelength_um - points[low].wavelength_um) / span : 0.0;
    return points[low].value + u * (points[high].value - points[low].value);
}

double bst_optics_planck_photons(double wavelength_m, double temperature_k) {
    if (!(temperature_k > 0.0)) {
        return 0.0;
    }
    double x = PLANCK_JS * BST_LIGHT_SPEED_MPS / (wavelength_m * BOLTZMANN_J_PER_K * temperature_k);
    double squared = wavelength_m * wavelength_m;
    return 2.0 * BST_LIGHT_SPEED_MPS / (squared * squared * expm1(x));
}

static double photon_energy_j(double wavelength_m) {
    return PLANCK_JS * BST_LIGHT_SPEED_MPS / wavelength_m;
}

double bst_optics_sun_irradiance(double wavelength_m) {
    double nm = wavelength_m * 1e9;
    const int last = SOLAR_NODES - 1;
    if (!(nm >= (double)solar_table[0][0])) {
        return 0.0;
    }
    if (nm >= (double)solar_table[last][0]) {
        const double temperature_k = 5562.5;
        double edge_m = (double)solar_table[last][0] * 1e-9;
        double ratio = bst_optics_planck_photons(wavelength_m, temperature_k) *
                       photon_energy_j(wavelength_m) /
                       (bst_optics_planck_photons(edge_m, temperature_k) * photon_energy_j(edge_m));
        return (double)solar_table[last][1] * 1e9 * ratio;
    }
    int low = 0, high = last;
    while (high - low > 1) {
        int middle = (low + high) / 2;
        *((double)solar_table[middle][0] <= nm ? &low : &high) = middle;
    }
    double a = (double)solar_table[low][0], b = (double)solar_table[high][0];
    double u = (nm - a) / (b - a), from = (double)solar_table[low][1] * 1e9,
           to = (double)solar_table[high][1] * 1e9;
    /* steep and smooth in the infrared, lines in the visible */
    return a < 1000.0 ? from + u * (to - from) : from * pow(to / from, log(nm / a) / log(b / a));
}

double bst_optics_star_temperature_k(double b_minus_v) {
    double x = 0.92 * b_minus_v;
    return 4600.0 * (1.0 / (x + 1.7) + 1.0 / (x + 0.62));
}

double bst_optics_star_spectrum_k(double b_minus_v) {
    double colour = isnan(b_minus_v) ? BST_SUN_B_MINUS_V : b_minus_v;
    return bst_optics_star_temperature_k(
        fmin(fmax(colour, COLOUR_FIRST), COLOUR_FIRST + (COLOURS - 1) * COLOUR_STEP));
}

/* Adds quadrature nodes for a wavelength interval. */
static bst_status add_panel(bst_ctx *ctx, quadrature *q, double from_m, double to_m) {
    int pieces = (int)ceil((to_m - from_m) / (PANEL_SHARE * from_m));
    for (int p = 0; p < pieces; p++) {
        double half = 0.5 * (to_m - from_m) / pieces, centre = from_m + half * (2 * p + 1);
        if (q->count + GAUSS > q->capacity) {
            int capacity = 2 * q->capacity + 512;
            double *place = realloc(q->place, (size_t)capacity * sizeof *place);
            q->place = place ? place : q->place;
            double *weight = realloc(q->weight, (size_t)capacity * sizeof *weight);
            q->weight = weight ? weight : q->weight;
            if (!place || !weight) {
                return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the quadrature of a band");
            }
            q->capacity = capacity;
        }
        for (int i = 0; i < GAUSS; i++) {
            double sign = i < GAUSS / 2 ? -1.0 : 1.0;
            int k = i < GAUSS / 2 ? GAUSS / 2 - 1 - i : i - GAUSS / 2;
            q->place[q->count] = centre + sign * half * gauss_place[k];
            q->weight[q->count++] = half * gauss_weight[k];
        }
    }
    return BST_OK;
}

static int compare_doubles(const void *a, const void *b) {
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* Makes quadrature panels between all nodes of the tables and the solar spectrum. */
static bst_status make_rule(bst_ctx *ctx, bst_band *band) {
    int capacity = band->count[0] + band->count[1] + SOLAR_NODES;
    double *corners = malloc((size_t)capacity * sizeof *corners);
    if (!corners) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the quadrature of a band");
    }
    int n = 0;
    for (int t = 0; t < 2; t++) {
        for (int i = 0; i < band->count[t]; i++) {
            corners[n++] = band->points[t][i].wavelength_um * UM;
        }
    }
    for (int i = 0; i < SOLAR_NODES; i++) {
        corners[n++] = (double)solar_table[i][0] * 1e-9;
    }
    qsort(corners, (size_t)n, sizeof *corners, compare_doubles);
    double from = band->points[0][0].wavelength_um * UM,
           to = band->points[0][band->count[0] - 1].wavelength_um * UM;
    bst_status status = BST_OK;
    for (int i = 0; i + 1 < n && status == BST_OK; i++) {
        if (corners[i] >= from && corners[i + 1] <= to &&
            corners[i + 1] - corners[i] > 1e-9 * corners[i]) {
            status = add_panel(ctx, &band->rule, corners[i], corners[i + 1]);
        }
    }
    free(corners);
    for (int i = 0; i < band->rule.count; i++) {
        band->rule.weight[i] *= bst_band_response(band, band->rule.place[i]);
    }
    return status;
}

double bst_band_response(const bst_band *band, double wavelength_m) {
    double um = wavelength_m / UM, detector = table_at(band->points[0], band->count[0], um);
    return band->count[1] > 0 ? detector * table_at(band->points[1], band->count[1], um) : detector;
}

/* Ratio of photons per m2 and s of a V = 0 star of this temperature to those of a black body of one
 * steradian. Normalised by energy through V: Bessell's passbands apply to energy integrals. */
static double star_scale(double temperature_k) {
    double through = 0.0, width = 0.0;
    const int pieces = 4;
    for (int k = 0; k + 1 < COUNT_OF(bessell_v); k++) {
        double a = bessell_v[k].wavelength_um * UM, b = bessell_v[k + 1].wavelength_um * UM;
        for (int i = 0; i < pieces; i++) { /* midpoints: 1e-6 of the integral */
            double u = (i + 0.5) / pieces, lambda = a + u * (b - a);
            double v = (bessell_v[k].value * (1.0 - u) + bessell_v[k + 1].value * u) * (b - a);
            through +=
                v * bst_optics_planck_photons(lambda, temperature_k) * photon_energy_j(lambda);
            width += v;
        }
    }
    return V0_IRRADIANCE * width / through;
}

/* Distributes `light` of one wavelength to the two adjacent wavelengths of
 * bst_sunlight_wavelength_m. */
static void add_sunlight(bst_band *band, double wavelength_m, double light) {
    const double *w = bst_sunlight_wavelength_m;
    int k = 0;
    while (k + 2 < BST_SUNLIGHT_COLOURS && wavelength_m > w[k + 1]) {
        k++;
    }
    double u = fmin(fmax((wavelength_m - w[k]) / (w[k + 1] - w[k]), 0.0), 1.0);
    band->sun += light;
    band->sun_share[k] += (1.0 - u) * light;
    band->sun_share[k + 1] += u * light;
}

/* Computes the mean wavelength of the band and its response to sunlight. */
static bst_status prepare(bst_ctx *ctx, bst_band *band) {
    BST_TRY(make_rule(ctx, band));
    const quadrature *q = &band->rule;
    double total = 0.0;
    for (int i = 0; i < q->count; i++) {
        total += q->weight[i];
        band->mean_m += q->weight[i] * q->place[i];
        add_sunlight(
            band, q->place[i],
            q->weight[i] * bst_optics_sun_irradiance(q->place[i]) / photon_energy_j(q->place[i]));
    }
    if (!(total > 0.0)) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "response: response times transmission is zero at all wavelengths");
    }
    band->mean_m /= total;
    for (int k = 0; k < BST_SUNLIGHT_COLOURS; k++) {
        band->sun_share[k] = band->sun > 0.0 ? band->sun_share[k] / band->sun : 0.0;
    }
    for (int i = 0; i < COLOURS; i++) {
        double temperature = bst_optics_star_temperature_k(COLOUR_FIRST + COLOUR_STEP * i);
        band->log_star[i] = log(bst_band_radiance(band, temperature) * star_scale(temperature));
    }
    return BST_OK;
}

/* Reads one of the two tables, from the list or the file. */
static bst_status take_table(bst_ctx *ctx, const bst_config_list *list, const char *file,
                             const char *base_dir, const char *key,
                             bst_optics_response_point **points, int *count) {
    static const char *const wavelength[] = {"wavelength_um", NULL};
    static const char *const response[] = {"response", NULL};
    static const char *const transmission[] = {"transmission", NULL};
    bst_curve curve = {0};
    if (*file && list->count > 0) {
        return bst_fail(ctx, BST_ERR_CONFIG, "%s: give either the list or %s_file, not both", key,
                        key);
    }
    if (*file) {
        char path[1100];
        bst_file_resolve(base_dir, file, path, sizeof path);
        bst_curve_format format = {"a table of spectral response",
                                   wavelength,
                                   strcmp(key, "response") == 0 ? response : transmission,
                                   0.2,
                                   30.0,
                                   0.0,
                                   1.0};
        bst_status status = bst_curve_load(ctx, path, &format, &curve);
        if (status != BST_OK) {
            bst_curve_free(&curve);
            return bst_fail_prefix(ctx, BST_ERR_CONFIG, "%s_file", key);
        }
    }
    *count = *file ? curve.count : list->count;
    const bst_optics_response_point *given = list->items;
    bst_status status = BST_OK;
    *points = malloc(((size_t)*count + 1) * sizeof **points);
    if (!*points) {
        status = bst_fail(ctx, BST_ERR_MEMORY, "no memory for a table of %d wavelengths", *count);
    }
    for (int i = 0; i < *count && status == BST_OK; i++) {
        (*points)[i] = *file ? (bst_optics_response_point){curve.x[i], curve.y[i]} : given[i];
        if (i > 0 && !((*points)[i].wavelength_um > (*points)[i - 1].wavelength_um)) {
            status = bst_fail(ctx, BST_ERR_CONFIG,
                              "%s/%d/wavelength_um: wavelengths have to ascend (found %g after %g)",
                              key, i, (*points)[i].wavelength_um, (*points)[i - 1].wavelength_um);
        }
    }
    if (status == BST_OK && *count == 1) {
        status =
            bst_fail(ctx, BST_ERR_CONFIG, "%s: one wavelength is no band; give two or more", key);
    }
    bst_curve_free(&curve);
    return status;
}

bst_status bst_band_create(bst_ctx *ctx, const bst_band_config *c, const char *base_dir,
                           bst_band **out) {
    *out = NULL;
    bool tables = c->response.count > 0 || c->transmission.count > 0 || *c->response_file ||
                  *c->transmission_file;
    if (c->preset == BST_BAND_V && !tables) {
        return BST_OK;
    }
    bst_band *band = calloc(1, sizeof *band);
    if (!band) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for a band");
    }
    bst_status status = take_table(ctx, &c->response, c->response_file, base_dir, "response",
                                   &band->points[0], &band->count[0]);
    if (status == BST_OK) {
        status = take_table(ctx, &c->transmission, c->transmission_file, base_dir, "transmission",
                            &band->points[1], &band->count[1]);
    }
    if (status == BST_OK && band->count[0] == 0) {
        table t = preset_table(c->preset);
        size_t bytes = (size_t)t.count * sizeof *t.points;
        free(band->points[0]);
        band->points[0] = malloc(bytes);
        if (band->points[0]) {
            memcpy(band->points[0], t.points, bytes);
            band->count[0] = t.count;
        } else {
            status = bst_fail(ctx, BST_ERR_MEMORY, "no memory for a band");
        }
    }
    if (status == BST_OK) {
        status = prepare(ctx, band);
    }
    if (status != BST_OK) {
        bst_band_free(band);
        return status;
    }
    *out = band;
    return BST_OK;
}

void bst_band_free(bst_band *band) {
    if (band) {
        free(band->points[0]);
        free(band->points[1]);
        free(band->rule.place);
        free(band->rule.weight);
        free(band);
    }
}

double bst_band_star(const bst_band *band, double b_minus_v) {
    double colour = isnan(b_minus_v) ? BST_SUN_B_MINUS_V : b_minus_v;
    double at = (colour - COLOUR_FIRST) / COLOUR_STEP;
    at = fmin(fmax(at, 0.0), COLOURS - 1.0);
    int i = (int)fmin(at, COLOURS - 2.0);
    return exp(band->log_star[i] + (at - i) * (band->log_star[i + 1] - band->log_star[i]));
}

double bst_band_sun(const bst_band *band) {
    return band->sun;
}

double bst_band_reddened_sun(const bst_band *band, const double light[BST_SUNLIGHT_COLOURS]) {
    double sum = 0.0;
    for (int k = 0; k < BST_SUNLIGHT_COLOURS; k++) {
        sum += band->sun_share[k] * light[k];
    }
    return sum;
}

double bst_band_radiance(const bst_band *band, double temperature_k) {
    double sum = 0.0;
    for (int i = 0; i < band->rule.count; i++) {
        sum += band->rule.weight[i] * bst_optics_planck_photons(band->rule.place[i], temperature_k);
    }
    return sum;
}

bool bst_band_is_thermal(const bst_band *band) {
    return band->mean_m > 3e-6;
}
