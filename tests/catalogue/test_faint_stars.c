/* The statistical sky against its table, against Tycho-2's own counts, and against itself. */
#include "sim/catalogue/faint_stars.h"

#include <erfa.h>
#include <stdlib.h>

#include "sim/catalogue/faint_internal.h"
#include "tests/world/world_support.h"

#define DEG2 (1.0 / (BST_DEG_RAD * BST_DEG_RAD)) /* square degrees in a steradian */
#define FIELD_RAD 0.0985066                      /* cap of 100 square degrees */

typedef struct sky {
    bst_ctx ctx;
    bst_stars *catalogue;
    bst_faint_sky *sky;
    bst_faint_stars *window;
    bst_star *stars;
    int capacity, count;
} sky;

static sky open_sky(const char *catalogue, uint64_t seed) {
    sky s = {0};
    bst_assert_ok(&s.ctx, bst_stars_open(&s.ctx, catalogue, &s.catalogue));
    bst_assert_ok(&s.ctx, bst_faint_sky_create(&s.ctx, s.catalogue, seed, &s.sky));
    bst_assert_ok(&s.ctx, bst_faint_stars_create(&s.ctx, s.sky, 1 << 20, &s.window));
    return s;
}

static void close_sky(sky *s) {
    bst_faint_stars_free(s->window);
    bst_faint_sky_free(s->sky);
    bst_stars_close(s->catalogue);
    free(s->stars);
}

static void look(sky *s, bst_vec3 centre, double radius, double v_limit) {
    for (;;) {
        bst_assert_ok(&s->ctx, bst_faint_stars_query(&s->ctx, s->window, centre, radius, v_limit,
                                                     s->stars, s->capacity, &s->count));
        if (s->count <= s->capacity) {
            return;
        }
        free(s->stars);
        s->capacity = s->count;
        s->stars = malloc((size_t)s->capacity * sizeof *s->stars);
        assert_non_null(s->stars);
    }
}

static bst_vec3 galactic(double l_deg, double b_deg) {
    return bst_catalogue_icrs_from_galactic(
        bst_vec3_from_radec(l_deg * BST_DEG_RAD, b_deg * BST_DEG_RAD));
}

static bst_vec3 radec(double ra_deg, double dec_deg) {
    return bst_vec3_from_radec(ra_deg * BST_DEG_RAD, dec_deg * BST_DEG_RAD);
}

/* Integral of `value` over a cap by a lattice of equal areas; the area is in square degrees. */
static double over_cap(bst_vec3 centre, double radius, double (*value)(bst_vec3, const void *),
                       const void *data) {
    enum { RINGS = 120, SPOKES = 120 };
    bst_vec3 e1 = bst_vec3_unit(
        bst_vec3_cross(fabs(centre.z) < 0.9 ? (bst_vec3){0, 0, 1} : (bst_vec3){1, 0, 0}, centre));
    bst_vec3 e2 = bst_vec3_cross(centre, e1);
    double sum = 0;
    for (int r = 0; r < RINGS; r++) {
        double c = 1 - (1 - cos(radius)) * (r + 0.5) / RINGS, s = sqrt(1 - c * c);
        for (int k = 0; k < SPOKES; k++) {
            double a = 2 * BST_PI * (k + 0.5 * (r & 1)) / SPOKES;
            bst_vec3 at = bst_vec3_axpy(bst_vec3_axpy(bst_vec3_scale(centre, c), s * cos(a), e1),
                                        s * sin(a), e2);
            sum += value(at, data);
        }
    }
    return sum * 2 * BST_PI * (1 - cos(radius)) * DEG2 / (RINGS * SPOKES);
}

typedef struct range {
    const bst_stars *catalogue; /* NULL: from v_from on */
    double v_from, v_to;
} range;

/* How far the catalogue is complete at a place: Tycho-2 itself ends at V 11. */
static double complete_to(const bst_stars *stars, bst_vec3 at) {
    return fmin(11.0, bst_stars_complete_to(stars, at, 0));
}

static double table_density(bst_vec3 at, const void *data) {
    const range *r = data;
    bst_star_counts counts;
    bst_star_counts_at(at, &counts);
    double from = r->catalogue ? complete_to(r->catalogue, at) : r->v_from;
    return bst_star_counts_brighter(&counts, r->v_to) - bst_star_counts_brighter(&counts, from);
}

static void galactic_axes_are_erfas(void **state) {
    (void)state;
    for (int i = 0; i < 50; i++) {
        double ra = 0.13 * i, dec = -1.5 + 0.06 * i, l, b;
        eraIcrs2g(ra, dec, &l, &b);
        bst_vec3 expected = bst_vec3_from_radec(l, b);
        bst_vec3 got = bst_catalogue_galactic_from_icrs(bst_vec3_from_radec(ra, dec));
        /* rounding of the matrix's 16 digits */
        assert_true(test_distance(got, expected) < 1e-14);
        assert_true(test_distance(bst_catalogue_icrs_from_galactic(got),
                                  bst_vec3_from_radec(ra, dec)) < 1e-14);
    }
}

static void light_is_the_integral_of_the_counts(void **state) {
    (void)state;
    bst_star_counts counts;
    bst_star_counts_at(galactic(75, -12), &counts);
    const double ranges[][2] = {{9, 12}, {11.3, 11.4}, {4, 8.5}, {15.2, 29}};
    for (int i = 0; i < 4; i++) {
        double sum = 0, a = ranges[i][0], b = ranges[i][1];
        enum { STEPS = 200000 };
        for (int k = 0; k < STEPS; k++) {
            double v0 = a + (b - a) * k / STEPS, v1 = a + (b - a) * (k + 1) / STEPS;
            sum += pow(10, -0.2 * (v0 + v1)) *
                   (bst_star_counts_brighter(&counts, v1) - bst_star_counts_brighter(&counts, v0));
        }
        /* midpoint rule: (0.4 ln10 dV)^2 / 24 < 1e-9; differences of counts lose 1e-9 more */
        bst_assert_close(bst_star_counts_light(&counts, a, b) / sum, 1.0, 1e-7);
    }
    double all = bst_star_counts_light(&counts, 15.2, INFINITY);
    assert_true(all > bst_star_counts_light(&counts, 15.2, 29));
    bst_assert_close(bst_star_counts_light(&counts, 15.2, 60) / all, 1.0, 1e-3); /* slope < 0.3 */
}

/* Twelve fields of 100 square degrees: both galactic poles, both celestial poles, the plane, the
 * centre with its catalogue patch, the wrap of right ascension. */
static void fields_have_the_tables_counts(void **state) {
    (void)state;
    const bst_vec3 fields[12] = {galactic(0, 90),  galactic(0, -90),   galactic(0, 0.1),
                                 galactic(85, -3), galactic(180, 6),   galactic(270, -11),
                                 galactic(45, 22), galactic(200, -35), galactic(310, 55),
                                 radec(0, 0),      radec(10, 90),      radec(200, -89)};
    sky s = open_sky("embedded", BST_FAINT_SEED);
    double chi2 = 0;
    int cases = 0;
    for (int i = 0; i < 12; i++) {
        for (double v = 11.5; v <= 14.5; v += 1.5) {
            look(&s, fields[i], FIELD_RAD, v);
            range r = {s.catalogue, 0, v};
            double expected = over_cap(fields[i], FIELD_RAD, table_density, &r);
            /* in a patch the catalogue has stars beyond V 11: they count */
            int known, beyond = 0;
            bst_star *stars = malloc(100000 * sizeof *stars);
            bst_assert_ok(&s.ctx, bst_stars_query(&s.ctx, s.catalogue, fields[i], FIELD_RAD, v,
                                                  2000.0, stars, 100000, &known));
            assert_true(known <= 100000);
            for (int k = 0; k < known; k++) {
                beyond += (double)stars[k].v_mag > complete_to(s.catalogue, stars[k].icrs) + 1e-6;
            }
            free(stars);
            double got = s.count + beyond, sigma = sqrt(expected);
            /* Poisson, and 0.5 % for the density that is constant in a cell; 5 % is asked for */
            bst_assert_close(got, expected, 4 * sigma + 0.005 * expected);
            if (beyond == 0) {
                chi2 += (got - expected) * (got - expected) / expected;
                cases++;
            }
        }
    }
    /* the three limits of a field share stars: their chi-square has the right mean but up to three
     * times the variance */
    assert_true(cases >= 33);
    assert_true(chi2 < cases + 5 * sqrt(6.0 * cases));
    assert_true(chi2 > cases - 5 * sqrt(6.0 * cases) && chi2 > 5);
    close_sky(&s);
}

/* A deep field in the plane and one at the pole. */
static void deep_fields_have_the_tables_counts(void **state) {
    (void)state;
    sky s = open_sky("embedded", 77);
    const bst_vec3 at[2] = {galactic(30, 4), galactic(0, 89)};
    const double radius[2] = {0.4 * BST_DEG_RAD, FIELD_RAD}, limits[3] = {17, 19.3, 21};
    for (int i = 0; i < 2; i++) {
        for (int k = 0; k < 3; k++) {
            look(&s, at[i], radius[i], limits[k]);
            range r = {s.catalogue, 0, limits[k]};
            double expected = over_cap(at[i], radius[i], table_density, &r);
            bst_assert_close(s.count, expected, 4 * sqrt(expected) + 0.01 * expected);
        }
    }
    close_sky(&s);
}

/* Beyond V 9, where the embedded catalogue ends, the statistical sky has as many stars as Tycho-2
 * really has: 586,562 to V 10.5, 130,728 to V 9. */
static void whole_sky_is_as_rich_as_tycho2(void **state) {
    (void)state;
    sky s = open_sky("embedded", BST_FAINT_SEED);
    look(&s, (bst_vec3){1, 0, 0}, BST_PI, 10.5);
    double really = 586562.0 - 130728.0;
    bst_assert_close(s.count / really, 1.0, 0.03); /* log-linear between whole magnitudes */
    close_sky(&s);
}

static int by_id(const void *a, const void *b) {
    uint32_t x = ((const bst_star *)a)->id, y = ((const bst_star *)b)->id;
    return x < y ? -1 : x > y;
}

/* The same stars for every query: overlapping cones, another order, a cache that holds nothing. */
static void queries_agree(void **state) {
    (void)state;
    sky a = open_sky("embedded", BST_FAINT_SEED), b = open_sky("embedded", BST_FAINT_SEED);
    bst_faint_stars_free(b.window);
    bst_assert_ok(&b.ctx, bst_faint_stars_create(&b.ctx, b.sky, 0, &b.window));
    const bst_vec3 places[4] = {radec(359.9, 12), radec(83, 89.6), radec(266, -29),
                                radec(120, -90)};
    for (int p = 0; p < 4; p++) {
        look(&a, places[p], 0.02, 15.2);
        qsort(a.stars, (size_t)a.count, sizeof *a.stars, by_id);
        assert_true(a.count > 100);
        for (int i = 0; i < a.count; i++) {
            assert_true(a.stars[i].id & BST_FAINT_ID_BIT);
            assert_true(i == 0 || a.stars[i].id != a.stars[i - 1].id);
            assert_true(isnan(a.stars[i].b_minus_v));
        }
        for (int step = 0; step < 5; step++) {
            bst_vec3 aside = bst_vec3_unit(
                bst_vec3_add(places[p], (bst_vec3){0.008 * step, 0.01 - 0.004 * step, 0.003}));
            double limit = 13.0 + 0.7 * step;
            look(&b, aside, 0.013, limit);
            int shared = 0, expected = 0;
            for (int i = 0; i < b.count; i++) {
                assert_true((double)b.stars[i].v_mag <= limit);
                const bst_star *same =
                    bsearch(&b.stars[i], a.stars, (size_t)a.count, sizeof *a.stars, by_id);
                bool inside = bst_vec3_angle(b.stars[i].icrs, places[p]) < 0.02 - 1e-12 &&
                              (double)b.stars[i].v_mag <= 15.2;
                assert_true(!inside || same);
                if (same) {
                    assert_memory_equal(&same->icrs, &b.stars[i].icrs, sizeof same->icrs);
                    assert_true(same->v_mag == b.stars[i].v_mag);
                    shared++;
                }
            }
            for (int i = 0; i < a.count; i++) {
                expected += bst_vec3_angle(a.stars[i].icrs, aside) < 0.013 &&
                            (double)a.stars[i].v_mag <= limit;
            }
            assert_int_equal(shared, expected);
            assert_true(shared > 0);
        }
    }
    close_sky(&a);
    close_sky(&b);
}

static void deeper_limits_only_add_stars(void **state) {
    (void)state;
    sky a = open_sky("embedded", BST_FAINT_SEED), b = open_sky("embedded", BST_FAINT_SEED);
    bst_vec3 at = galactic(100, 20);
    look(&b, at, 0.03, 17.5);
    qsort(b.stars, (size_t)b.count, sizeof *b.stars, by_id);
    int before = 0;
    for (double v = 8.8; v <= 17.5; v += 0.6) {
        look(&a, at, 0.03, v); /* ascending limits: cells of the cache are drawn deeper */
        int brighter = 0;
        for (int i = 0; i < b.count; i++) {
            brighter += (double)b.stars[i].v_mag <= v;
        }
        assert_int_equal(a.count, brighter);
        assert_true(a.count >= before && (v > 9.0 || a.count == 0));
        before = a.count;
        for (int i = 0; i < a.count; i++) {
            const bst_star *same =
                bsearch(&a.stars[i], b.stars, (size_t)b.count, sizeof *b.stars, by_id);
            assert_non_null(same);
            assert_memory_equal(&same->icrs, &a.stars[i].icrs, sizeof same->icrs);
        }
    }
    /* another seed is another sky */
    sky c = open_sky("embedded", 1);
    look(&c, at, 0.03, 17.5);
    int same_places = 0;
    for (int i = 0; i < c.count && i < 100; i++) {
        for (int k = 0; k < b.count; k++) {
            same_places += bst_vec3_dot(c.stars[i].icrs, b.stars[k].icrs) > 1 - 1e-17;
        }
    }
    assert_int_equal(same_places, 0);
    close_sky(&a);
    close_sky(&b);
    close_sky(&c);
}

/* Cells are independent Poisson numbers, and stars are uniform in them. */
static void cells_are_poisson_and_independent(void **state) {
    (void)state;
    sky s = open_sky("embedded", 5);
    look(&s, galactic(0, 90), 0.2, 14);
    enum { SIDE = 60, PARTS = 16 };
    double in_cell[2 * SIDE][SIDE] = {{0}}, along[2][PARTS] = {{0}};
    /* bands around dec +27.128 and 60 cells east of ra 185 */
    int first_band = (int)((27.0 + 90) / 0.45) - 10;
    int total = 0;
    for (int i = 0; i < s.count; i++) {
        double ra, dec;
        bst_vec3_to_radec(s.stars[i].icrs, &ra, &dec);
        int band = (int)((dec + BST_PI / 2) / FAINT_BAND_RAD);
        if (band < first_band || band >= first_band + 20) {
            continue;
        }
        uint32_t pieces = s.sky->first_cell[band + 1] - s.sky->first_cell[band];
        double at = ra * pieces / (2 * BST_PI);
        uint32_t cell = s.sky->first_cell[band] + (uint32_t)at;
        /* an identity lies in the range of its cell */
        uint32_t number = s.stars[i].id & ~BST_FAINT_ID_BIT;
        assert_true(number >= s.sky->first_id[cell] && number < s.sky->first_id[cell + 1]);
        faint_cell c = bst_faint_cell(s.sky, band, cell);
        along[0][(int)((at - floor(at)) * PARTS)]++;
        along[1][(int)((sin(dec) - c.sin_dec_min) / (c.sin_dec_max - c.sin_dec_min) * PARTS)]++;
        total++;
        int column = (int)at - (int)(185.0 / 360.0 * pieces);
        if (column >= 0 && column < 20) {
            in_cell[band - first_band][column]++;
        }
    }
    double chi2 = 0, neighbours = 0, mean = 0;
    for (int i = 0; i < 20; i++) {
        for (int k = 0; k < 20; k++) {
            mean += in_cell[i][k] / 400;
        }
    }
    for (int i = 0; i < 20; i++) {
        for (int k = 0; k < 20; k++) {
            chi2 += (in_cell[i][k] - mean) * (in_cell[i][k] - mean) / mean;
            if (k > 0) {
                neighbours += (in_cell[i][k] - mean) * (in_cell[i][k - 1] - mean) / mean / 380;
            }
        }
    }
    assert_true(mean > 10);
    /* chi-square of 399: 399 +- 28; 5 sigma, and 5 % for the slope of density and area there */
    bst_assert_close(chi2, 399, 5 * 28.3 + 20);
    bst_assert_close(neighbours, 0, 5 / sqrt(380.0)); /* correlation coefficient */
    for (int axis = 0; axis < 2; axis++) {
        double c2 = 0, part = (double)total / PARTS;
        for (int k = 0; k < PARTS; k++) {
            c2 += (along[axis][k] - part) * (along[axis][k] - part) / part;
        }
        assert_true(c2 < 44); /* chi-square of 15: probability 1e-4 */
    }
    close_sky(&s);
}

/* Single stars and the rest: all the light is there, whatever the limit. */
static void light_does_not_depend_on_the_limit(void **state) {
    (void)state;
    sky s = open_sky("embedded", BST_FAINT_SEED);
    const bst_vec3 places[3] = {galactic(60, 0.5), galactic(150, 40), galactic(1, 3)};
    for (int p = 0; p < 3; p++) {
        const double radius = 1.0 * BST_DEG_RAD;
        double area_sr = 2 * BST_PI * (1 - cos(radius));
        bst_star_counts counts;
        bst_star_counts_at(places[p], &counts);
        double all = bst_faint_sky_unresolved(s.sky, places[p], 9);
        for (double v = 10; v <= 18; v += 2) {
            double rest = bst_faint_sky_unresolved(s.sky, places[p], v);
            /* what leaves the background is the light of the table between the limits */
            bst_assert_close((all - rest) / (bst_star_counts_light(&counts, 9, v) * DEG2), 1,
                             2e-7); /* shares are floats */
            look(&s, places[p], radius, v);
            double light = 0, square = 0;
            for (int i = 0; i < s.count; i++) {
                double one = pow(10, -0.4 * (double)s.stars[i].v_mag);
                light += one;
                square += one * one;
            }
            /* 4 sigma of compound Poisson noise, and 3 % for the gradient over the cap, as the
             * background is taken at its centre */
            bst_assert_close(light / area_sr + rest, all,
                             4 * sqrt(square) / area_sr + 0.03 * light / area_sr);
        }
    }
    close_sky(&s);
}

static double table_light(bst_vec3 at, const void *data) {
    bst_star_counts counts;
    bst_star_counts_at(at, &counts);
    return bst_star_counts_light(&counts, *(const double *)data, INFINITY);
}

/* In a patch of the embedded catalogue there are some of the stars beyond V 11: their light is not
 * in the background a second time. */
static void background_leaves_out_what_the_catalogue_has(void **state) {
    (void)state;
    sky s = open_sky("embedded", BST_FAINT_SEED);
    bst_vec3 at = radec(266.4168, -29.0078); /* the patch at the galactic centre */
    const double radius = 1.0 * BST_DEG_RAD, limit = 11.0;
    int count;
    bst_star known[1000];
    bst_assert_ok(&s.ctx, bst_stars_query(&s.ctx, s.catalogue, at, radius, 12.0, 2000.0, known,
                                          1000, &count));
    assert_in_range(count, 20, 1000);
    double light = 0;
    for (int i = 0; i < count; i++) {
        light += (double)known[i].v_mag > limit ? pow(10, -0.4 * (double)known[i].v_mag) : 0;
    }
    double area_sr = 2 * BST_PI * (1 - cos(radius));
    double table = over_cap(at, radius, table_light, &limit) / area_sr;
    double rest = bst_faint_sky_unresolved(s.sky, at, limit);
    assert_true(light / area_sr > 0.03 * table); /* or this says nothing */
    /* the table varies over the patch; quarters of a magnitude where the catalogue has more stars
     * than the table count as full: up to a third of the catalogue's part */
    bst_assert_close(rest + light / area_sr, table, 0.05 * table + 0.34 * light / area_sr);
    double full = table_light(at, &limit) * DEG2;
    bst_assert_close((full - rest) / (light / area_sr), 0.85, 0.25);
    /* beyond the catalogue's last star all is left */
    double deep = 13.0;
    bst_star_counts counts;
    bst_star_counts_at(at, &counts);
    bst_assert_close(bst_faint_sky_unresolved(s.sky, at, deep) /
                         (bst_star_counts_light(&counts, deep, INFINITY) * DEG2),
                     1.0, 1e-6); /* shares are floats */
    close_sky(&s);
}

/* Catalogue and statistical stars together across the join, by the zones that they are matched in;
 * needs the full catalogue. */
static void join_to_the_full_catalogue_is_smooth(void **state) {
    (void)state;
    sky s = open_sky("default", BST_FAINT_SEED);
    bst_stars_info info;
    bst_stars_get_info(s.catalogue, &info);
    if (info.embedded) {
        close_sky(&s);
        skip();
    }
    bst_star *known = malloc(400000 * sizeof *known);
    for (int zone = 11; zone < FAINT_ZONES; zone += 36) {
        double z = -1 + 2 * (zone / FAINT_ZONE_SECTORS + 0.5) / FAINT_ZONE_BANDS;
        double l = 360.0 * ((zone % FAINT_ZONE_SECTORS + 0.5) / FAINT_ZONE_SECTORS - 0.5);
        bst_vec3 at = galactic(l, asin(z) / BST_DEG_RAD);
        const double radius = 0.35; /* holds the widest zone's larger part */
        look(&s, at, radius, 12.5);
        int count;
        bst_assert_ok(&s.ctx, bst_stars_query(&s.ctx, s.catalogue, at, radius, 12.5, 2000.0, known,
                                              400000, &count));
        assert_true(count <= 400000);
        double n[3] = {0}, expected[3] = {0};
        for (int i = 0; i < s.count + count; i++) {
            const bst_star *star = i < s.count ? &s.stars[i] : &known[i - s.count];
            int half = (int)floor(((double)star->v_mag - 11.0) * 2);
            if (i < s.count) {
                assert_true((double)star->v_mag > 11.0 - 1e-6);
            }
            if (half >= 0 && half < 3 && bst_faint_zone(star->icrs) == zone) {
                n[half]++;
            }
        }
        enum { SIDE = 20 };
        for (int i = 0; i < SIDE * SIDE; i++) {
            double zz =
                -1 + 2 * (zone / FAINT_ZONE_SECTORS + (i / SIDE + 0.5) / SIDE) / FAINT_ZONE_BANDS;
            double ll =
                360.0 *
                ((zone % FAINT_ZONE_SECTORS + (i % SIDE + 0.5) / SIDE) / FAINT_ZONE_SECTORS - 0.5);
            bst_vec3 there = galactic(ll, asin(zz) / BST_DEG_RAD);
            if (bst_vec3_angle(there, at) > radius) {
                expected[0] = NAN;
            }
            for (int half = 0; half < 3; half++) {
                range r = {NULL, 11 + 0.5 * half, 11.5 + 0.5 * half};
                expected[half] += table_density(there, &r) * 41252.96 / FAINT_ZONES / (SIDE * SIDE);
            }
        }
        if (isnan(expected[0])) {
            continue;
        }
        for (int half = 0; half < 3; half++) {
            /* Poisson, and 5 % by which quarters of a magnitude are matched; more where the real
             * sky is richer than the table */
            int real = 0;
            for (int i = 0; i < count; i++) {
                real += bst_faint_zone(known[i].icrs) == zone &&
                        (int)floor(((double)known[i].v_mag - 11.0) * 2) == half;
            }
            double more = fmax(0.0, real - 0.97 * expected[half]);
            bst_assert_close(n[half], expected[half],
                             4 * sqrt(expected[half]) + 0.05 * expected[half] + more);
        }
    }
    free(known);
    close_sky(&s);
}

static void bad_arguments_are_errors(void **state) {
    (void)state;
    sky s = open_sky("embedded", 1);
    int count;
    bst_vec3 up = {0, 0, 1};
    assert_int_equal(
        bst_faint_stars_query(&s.ctx, s.window, (bst_vec3){0, 0, 2}, 0.1, 12, NULL, 0, &count),
        BST_ERR_ARGUMENT);
    assert_int_equal(bst_faint_stars_query(&s.ctx, s.window, up, -0.1, 12, NULL, 0, &count),
                     BST_ERR_ARGUMENT);
    assert_int_equal(bst_faint_stars_query(&s.ctx, s.window, up, 0.1, NAN, NULL, 0, &count),
                     BST_ERR_ARGUMENT);
    assert_int_equal(bst_faint_stars_query(&s.ctx, s.window, up, 0.1, 12, NULL, 3, &count),
                     BST_ERR_ARGUMENT);
    bst_assert_ok(&s.ctx, bst_faint_stars_query(&s.ctx, s.window, up, 0.1, 5, NULL, 0, &count));
    assert_int_equal(count, 0);
    assert_true(s.sky->first_id[faint_cells(s.sky)] < BST_FAINT_ID_BIT);
    close_sky(&s);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(galactic_axes_are_erfas),
        cmocka_unit_test(light_is_the_integral_of_the_counts),
        cmocka_unit_test(fields_have_the_tables_counts),
        cmocka_unit_test(deep_fields_have_the_tables_counts),
        cmocka_unit_test(whole_sky_is_as_rich_as_tycho2),
        cmocka_unit_test(queries_agree),
        cmocka_unit_test(deeper_limits_only_add_stars),
        cmocka_unit_test(cells_are_poisson_and_independent),
        cmocka_unit_test(light_does_not_depend_on_the_limit),
        cmocka_unit_test(background_leaves_out_what_the_catalogue_has),
        cmocka_unit_test(join_to_the_full_catalogue_is_smooth),
        cmocka_unit_test(bad_arguments_are_errors),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
