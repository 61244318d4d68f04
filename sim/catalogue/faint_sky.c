#include <stdlib.h>

#include "sim/catalogue/faint_internal.h"
#include "sim/catalogue/star_index.h"
#include "sim/catalogue/stars.h"

/* Tycho-2 has 98 % of the stars at V 11 and 76 % at 11.5: a catalogue made from it alone is
 * complete at most to this limit, whatever its patches state. */
#define SOURCE_COMPLETE_V 11.0

#define DEG2_PER_SR (1.0 / (BST_DEG_RAD * BST_DEG_RAD))

faint_cell bst_faint_cell(const bst_faint_sky *sky, int band, uint32_t cell) {
    uint32_t first = sky->first_cell[band];
    double width = 2.0 * BST_PI / (double)(sky->first_cell[band + 1] - first);
    double south = -0.5 * BST_PI + band * FAINT_BAND_RAD, north = south + FAINT_BAND_RAD;
    faint_cell c = {.ra_rad = (double)(cell - first) * width,
                    .width_rad = width,
                    .sin_dec_min = band == 0 ? -1.0 : sin(south),
                    .sin_dec_max = band == FAINT_BANDS - 1 ? 1.0 : sin(north)};
    c.centre = bst_vec3_from_radec(c.ra_rad + 0.5 * width, south + 0.5 * FAINT_BAND_RAD);
    /* use the side nearer to the equator: an arc of the parallel is longer than the chord */
    double cos_dec = band < FAINT_BANDS / 2 ? cos(north) : cos(south);
    c.radius_rad = 0.5 * (width * cos_dec + FAINT_BAND_RAD);
    c.area_deg2 = width * (c.sin_dec_max - c.sin_dec_min) * DEG2_PER_SR;
    return c;
}

int bst_faint_zone(bst_vec3 icrs) {
    bst_vec3 g = bst_catalogue_galactic_from_icrs(icrs);
    int band = (int)(0.5 * (g.z + 1.0) * FAINT_ZONE_BANDS);
    int sector = (int)((atan2(g.y, g.x) / (2.0 * BST_PI) + 0.5) * FAINT_ZONE_SECTORS);
    band = band < 0 ? 0 : band >= FAINT_ZONE_BANDS ? FAINT_ZONE_BANDS - 1 : band;
    sector = sector >= FAINT_ZONE_SECTORS ? FAINT_ZONE_SECTORS - 1 : sector;
    return band * FAINT_ZONE_SECTORS + sector;
}

int bst_faint_patch(const bst_faint_sky *sky, bst_vec3 icrs, double *complete_to_v) {
    int found = -1;
    *complete_to_v = sky->complete_to_v;
    for (int i = 0; i < sky->patch_count; i++) {
        const faint_patch *p = &sky->patches[i];
        if (bst_vec3_dot(p->centre, icrs) >= p->cos_radius) {
            found = found < 0 ? i : found;
            *complete_to_v = fmax(*complete_to_v, p->complete_to_v);
        }
    }
    return found;
}

/* Adds the expected stars in each quarter of a magnitude beyond complete_to_v, for an area around
 * `icrs`, by the table of star counts. */
static void expect(bst_vec3 icrs, double area_deg2, double complete_to_v, double *expected) {
    bst_star_counts counts;
    bst_star_counts_at(icrs, &counts);
    double below = 0.0;
    for (int q = -1; q < FAINT_QUARTERS; q++) {
        double v = fmax(BST_COUNT_FIRST_V + 0.25 * (q + 1), complete_to_v);
        double n = bst_star_counts_brighter(&counts, v);
        if (q >= 0) {
            expected[q] += area_deg2 * (n - below);
        }
        below = n;
    }
}

/* Expected stars of a patch, by an equal-area grid over its cap, without earlier patches. */
static void expect_patch(const bst_faint_sky *sky, int patch, double *expected) {
    enum { RINGS = 24, SPOKES = 24 };
    const faint_patch *p = &sky->patches[patch];
    bst_vec3 e1 = bst_vec3_unit(bst_vec3_cross(
        fabs(p->centre.z) < 0.9 ? (bst_vec3){0, 0, 1} : (bst_vec3){1, 0, 0}, p->centre));
    bst_vec3 e2 = bst_vec3_cross(p->centre, e1);
    double area = 2.0 * BST_PI * (1.0 - p->cos_radius) * DEG2_PER_SR / (RINGS * SPOKES);
    for (int r = 0; r < RINGS; r++) {
        double c = 1.0 - (1.0 - p->cos_radius) * (r + 0.5) / RINGS, s = sqrt(1.0 - c * c);
        for (int k = 0; k < SPOKES; k++) {
            double a = 2.0 * BST_PI * k / SPOKES;
            bst_vec3 at = bst_vec3_axpy(bst_vec3_axpy(bst_vec3_scale(p->centre, c), s * cos(a), e1),
                                        s * sin(a), e2);
            double complete_to_v;
            if (bst_faint_patch(sky, at, &complete_to_v) == patch) {
                expect(at, area, complete_to_v, expected);
            }
        }
    }
}

static void expect_zone(const bst_faint_sky *sky, int zone, double *expected) {
    enum { SIDE = 6 };
    const double area = 4.0 * BST_PI * DEG2_PER_SR / (FAINT_ZONES * SIDE * SIDE);
    for (int i = 0; i < SIDE * SIDE; i++) {
        double z =
            -1.0 + 2.0 * (zone / FAINT_ZONE_SECTORS + (i / SIDE + 0.5) / SIDE) / FAINT_ZONE_BANDS;
        double l =
            2.0 * BST_PI *
            ((zone % FAINT_ZONE_SECTORS + (i % SIDE + 0.5) / SIDE) / FAINT_ZONE_SECTORS - 0.5);
        double s = sqrt(1.0 - z * z);
        bst_vec3 at = bst_catalogue_icrs_from_galactic((bst_vec3){s * cos(l), s * sin(l), z});
        expect(at, area, sky->complete_to_v, expected);
    }
}

/* Counts the catalogue's stars beyond its completeness limit, by zone or patch and quarter of a
 * magnitude. */
static void count_catalogue(const bst_faint_sky *sky, const bst_star_view *view,
                            double (*seen)[FAINT_QUARTERS]) {
    for (uint32_t c = 0; c < view->header->cell_count; c++) {
        const bst_star_record *first = view->records + view->cells[c].first;
        /* sorted brightest first: go from the faint end until all are within the limit */
        for (const bst_star_record *r = first + view->cells[c].count; r-- > first;) {
            double v = bst_star_record_v(r) / 1e5;
            if (v <= sky->complete_to_v) {
                break;
            }
            int q = (int)((v - BST_COUNT_FIRST_V) * 4.0);
            if (q < 0 || q >= FAINT_QUARTERS) {
                continue;
            }
            bst_vec3 at = bst_star_record_direction(r, 0.0);
            double complete_to_v;
            int patch = bst_faint_patch(sky, at, &complete_to_v);
            if (v > complete_to_v) {
                seen[patch < 0 ? bst_faint_zone(at) : FAINT_ZONES + patch][q] += 1.0;
            }
        }
    }
}

/* Computes the fraction of statistical stars to keep in each zone and patch. */
static bst_status weigh(bst_ctx *ctx, bst_faint_sky *sky, const bst_star_view *view) {
    int regions = FAINT_ZONES + sky->patch_count;
    double(*seen)[FAINT_QUARTERS] = calloc((size_t)regions, sizeof *seen);
    sky->kept = calloc((size_t)regions, sizeof *sky->kept);
    if (!seen || !sky->kept) {
        free(seen);
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the statistical sky");
    }
    count_catalogue(sky, view, seen);
    for (int i = 0; i < regions; i++) {
        double expected[FAINT_QUARTERS] = {0};
        if (i < FAINT_ZONES) {
            expect_zone(sky, i, expected);
        } else {
            expect_patch(sky, i - FAINT_ZONES, expected);
        }
        for (int q = 0; q < FAINT_QUARTERS; q++) {
            sky->kept[i][q] =
                expected[q] > 0.0 ? (float)fmax(0.0, 1.0 - seen[i][q] / expected[q]) : 0.0f;
        }
    }
    free(seen);
    return BST_OK;
}

/* Assigns each cell a range of identities with capacity for all stars to BST_FAINT_LIMIT_V: 8
 * standard deviations above the mean. The sum stays below 2^31, see the test. */
static bst_status number_cells(bst_ctx *ctx, bst_faint_sky *sky) {
    sky->first_id = malloc((faint_cells(sky) + 1u) * sizeof *sky->first_id);
    if (!sky->first_id) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the statistical sky");
    }
    uint64_t next = 0;
    for (int band = 0; band < FAINT_BANDS; band++) {
        for (uint32_t cell = sky->first_cell[band]; cell < sky->first_cell[band + 1]; cell++) {
            faint_cell c = bst_faint_cell(sky, band, cell);
            bst_star_counts counts;
            bst_star_counts_at(c.centre, &counts);
            double mean =
                c.area_deg2 * pow(10.0, counts.log_n[BST_FAINT_LIMIT_V - BST_COUNT_FIRST_V]);
            sky->first_id[cell] = (uint32_t)next;
            next += (uint64_t)ceil(mean + 8.0 * sqrt(mean) + 16.0);
        }
    }
    sky->first_id[faint_cells(sky)] = (uint32_t)next;
    return next < BST_FAINT_ID_BIT
               ? BST_OK
               : bst_fail(ctx, BST_ERR_RANGE, "the statistical sky needs more than 31 bits");
}

bst_status bst_faint_sky_create(bst_ctx *ctx, const bst_stars *stars, uint64_t seed,
                                bst_faint_sky **out) {
    *out = NULL;
    bst_faint_sky *sky = calloc(1, sizeof *sky);
    if (!sky) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the statistical sky");
    }
    sky->key = bst_rng_make_key(seed, 0, "sky", "faint_stars");
    for (int band = 0; band < FAINT_BANDS; band++) {
        double cos_dec = cos(-0.5 * BST_PI + (band + 0.5) * FAINT_BAND_RAD);
        double pieces = floor(2.0 * BST_PI * cos_dec / FAINT_BAND_RAD + 0.5);
        sky->first_cell[band + 1] = sky->first_cell[band] + (uint32_t)fmax(pieces, 3.0);
    }
    bst_stars_info info;
    bst_stars_get_info(stars, &info);
    const double most_v = bst_stars_records(stars)->sources ? INFINITY : SOURCE_COMPLETE_V;
    sky->complete_to_v = fmin(info.complete_to_v_mag, most_v);
    sky->patch_count = info.patches;
    sky->patches = calloc((size_t)info.patches + 1, sizeof *sky->patches);
    bst_status status =
        sky->patches ? number_cells(ctx, sky)
                     : bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the statistical sky");
    for (int i = 0; status == BST_OK && i < info.patches; i++) {
        faint_patch *p = &sky->patches[i];
        bst_stars_patch(stars, i, &p->centre, &p->radius_rad, &p->complete_to_v);
        p->cos_radius = cos(p->radius_rad);
        p->complete_to_v = fmin(p->complete_to_v, most_v);
    }
    if (status == BST_OK) {
        status = weigh(ctx, sky, bst_stars_records(stars));
    }
    if (status != BST_OK) {
        bst_faint_sky_free(sky);
        return status;
    }
    *out = sky;
    return BST_OK;
}

void bst_faint_sky_free(bst_faint_sky *sky) {
    if (sky) {
        free(sky->first_id);
        free(sky->patches);
        free(sky->kept);
        free(sky);
    }
}

double bst_faint_sky_undrawn(const bst_faint_sky *sky, bst_vec3 icrs, double v_limit,
                             double faint_limit) {
    bst_star_counts counts;
    bst_star_counts_at(icrs, &counts);
    double complete_to_v;
    int patch = bst_faint_patch(sky, icrs, &complete_to_v);
    const float *kept = sky->kept[patch < 0 ? bst_faint_zone(icrs) : FAINT_ZONES + patch];
    double from = fmax(faint_limit, complete_to_v);
    /* catalogue stars: all where it is complete, its fraction beyond */
    double sum =
        v_limit < complete_to_v ? bst_star_counts_light(&counts, v_limit, complete_to_v) : 0.0;
    sum += bst_star_counts_light(&counts, fmax(from, BST_FAINT_LIMIT_V), INFINITY);
    for (int q = 0; q < FAINT_QUARTERS; q++) {
        double high = BST_COUNT_FIRST_V + 0.25 * (q + 1);
        double low = fmax(high - 0.25, from);
        double low_known = fmax(high - 0.25, fmax(v_limit, complete_to_v));
        if (low < high && kept[q] > 0.0f) {
            sum += (double)kept[q] * bst_star_counts_light(&counts, low, high);
        }
        if (low_known < high && kept[q] < 1.0f) {
            sum += (1.0 - (double)kept[q]) * bst_star_counts_light(&counts, low_known, high);
        }
    }
    return sum * DEG2_PER_SR;
}

double bst_faint_sky_unresolved(const bst_faint_sky *sky, bst_vec3 icrs, double v_limit) {
    return bst_faint_sky_undrawn(sky, icrs, INFINITY, v_limit);
}
