/* Filters of catalogued orbits: on objects of the shipped catalogue, with observations that are
 * drawn about their true directions. */
#include "sim/astro/sgp4.h"
#include "tracker/orbit/custody.h"

#include <math.h>
#include <stdlib.h>

#include "boresight/rng.h"
#include "sim/astro/sgp4_fit.h"
#include "sim/core/tangent.h"
#include "tests/test_support.h"
#include "tracker/orbit/orbit_photocentre.h"

#define CATALOGUE "scenarios/objects_2022-06.tle"

static const bst_mat3 same_axes = {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
static const bst_mat3 both_axes[2] = {{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}},
                                      {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}}};
static const bst_custody_config config = {.sigma_m = 500, .drift_m_per_day = 1500};

/* What an observer in a circular orbit of 1,000 km height measures of an object: 0.5 arcsec and
 * 0.05 arcsec/s per axis. */
static bool observe(const bst_sgp4 *sgp4, double offset_s, double time_s, bst_rng_key key,
                    uint64_t number, bst_custody_observation *out) {
    const double radius = 7.378e6, rate = sqrt(BST_EARTH_MU_M3PS2 / radius) / radius;
    const double c = cos(rate * time_s), s = sin(rate * time_s);
    const double sigma[4] = {0.5 * BST_ARCSEC_RAD, 0.5 * BST_ARCSEC_RAD, 0.05 * BST_ARCSEC_RAD,
                             0.05 * BST_ARCSEC_RAD};
    bst_od_state state = {.time_s = time_s};
    bst_od_sight sight;
    double noise[4];
    *out = (bst_custody_observation){
        .observer = {.time_s = time_s,
                     .position_m = {radius * c, 0, radius * s},
                     .velocity_mps = {-radius * rate * s, 0, radius * rate * c}},
        .gcrf_from_teme = same_axes};
    if (!bst_sgp4_motion(sgp4, (offset_s + time_s) / 60.0, &state.position_m,
                         &state.velocity_mps)) {
        return false;
    }
    bst_od_see(&state, &out->observer, &sight);
    /* and a larger error of all four at once: their covariance slants */
    const double slant = bst_rng_normal(key, number, 4), part[4] = {2.0, -1.5, 1.0, 1.5};
    for (int i = 0; i < 4; i++) {
        noise[i] = sigma[i] * (bst_rng_normal(key, number, (uint64_t)i) + part[i] * slant);
        for (int k = 0; k < 4; k++) {
            out->covariance[i][k] = sigma[i] * sigma[k] * (part[i] * part[k] + (i == k));
        }
    }
    bst_tangent axes = bst_tangent_at(sight.direction);
    out->direction =
        bst_tangent_exp(sight.direction, bst_tangent_vector(&axes, noise[0], noise[1]));
    bst_vec3 turn = bst_tangent_vector(&axes, noise[2], noise[3]);
    out->rate_radps =
        bst_tangent_carry(sight.direction, out->direction, bst_vec3_add(sight.rate_radps, turn));
    return true;
}

/* Errors are what the covariances say: before, at and after updates, near the equator too. */
static void errors_agree_with_covariances(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_elements *sets = NULL;
    int count = 0, used = 0, flat = 0, updates = 0;
    const bst_elements_options options = {.skip_bad_sets = true};
    bst_assert_ok(&ctx, bst_elements_load(&ctx, CATALOGUE, &options, &sets, &count));
    bst_rng_key key = bst_rng_make_key(7, 0, "test", "custody");
    double before = 0.0, innovations = 0.0, after = 0.0, sigma_before = 0.0, sigma_after = 0.0;
    for (int i = 3; i < count; i += 29) {
        bst_custody_orbit orbit;
        bst_custody_filter filter;
        bst_sgp4 *sgp4;
        double normals[BST_CUSTODY_STATE];
        const double offset_s = 3000.0 * (i % 50); /* elements up to two days old */
        if (bst_sgp4_create(&ctx, &sets[i], BST_SGP4_WGS72, BST_SGP4_IMPROVED, &sgp4) != BST_OK) {
            continue;
        }
        bst_assert_ok(&ctx, bst_custody_orbit_init(&ctx, &sets[i], offset_s, 0.0, &orbit));
        for (int k = 0; k < BST_CUSTODY_STATE; k++) {
            normals[k] = bst_rng_normal(key, (uint64_t)(1000000 + i), (uint64_t)k);
        }
        bst_custody_filter_init(&config, &orbit, normals, &filter);
        double nees = bst_custody_nees(&filter), sigma;
        bst_vec3 place;
        bool good = bst_custody_predict_position(&orbit, &filter, 20000.0, &place, &sigma);
        sigma_before += good ? sigma : 0.0;
        for (int k = 0; good && k < 4; k++) {
            bst_custody_observation z;
            bst_custody_prediction p;
            good = observe(sgp4, offset_s, 5000.0 * (k + 1), key, (uint64_t)(8 * i + k), &z) &&
                   bst_custody_predict(&orbit, &filter, &z, &p);
            if (good) {
                innovations += p.chi2;
                updates++;
                assert_true(bst_custody_update(&orbit, &z, &filter));
            }
        }
        bst_sgp4_free(sgp4);
        if (good) {
            used++;
            flat += sets[i].inclination_rad < 0.2 * BST_DEG_RAD;
            before += nees;
            after += bst_custody_nees(&filter);
            assert_true(bst_custody_predict_position(&orbit, &filter, 20000.0, &place, &sigma));
            sigma_after += sigma;
        }
    }
    free(sets);
    print_message(
        "%d objects, %d near the equator: NEES %.2f, %.2f; chi2 %.2f; sigma %.0f, %.0f m\n", used,
        flat, before / used, after / used, innovations / updates, sigma_before / used,
        sigma_after / used);
    assert_true(used > 150 && flat > 8);
    /* the means of chi-square of 6 and 4 degrees of freedom are within 4 sigma of 6 and 4 */
    bst_assert_close(before / used, 6.0, 4.0 * sqrt(12.0 / used));
    bst_assert_close(after / used, 6.0, 4.0 * sqrt(12.0 / used));
    bst_assert_close(innovations / updates, 4.0, 4.0 * sqrt(8.0 / updates));
    assert_true(sigma_after < 0.2 * sigma_before);
}

/* Four directions of a pass of a minute with slanting errors of 0.5 to 1.3 arcsec, and one of 2
 * arcsec that they share. */
static bool observe_pass(const bst_sgp4 *sgp4, double offset_s, double time_s, bst_rng_key key,
                         uint64_t number, bst_od_observation out[4]) {
    const double own = 0.5 * BST_ARCSEC_RAD, shared = 2.0 * BST_ARCSEC_RAD;
    double common[2] = {bst_rng_normal(key, number, 100), bst_rng_normal(key, number, 101)};
    for (int i = 0; i < 4; i++) {
        bst_custody_observation at;
        if (!observe(sgp4, offset_s, time_s + 20.0 * i, key, 8 * number + (uint64_t)i, &at)) {
            return false;
        }
        bst_tangent axes = bst_tangent_at(at.direction);
        out[i] = (bst_od_observation){
            .observer = at.observer,
            .direction = bst_tangent_exp(
                at.direction, bst_tangent_vector(&axes, shared * common[0], shared * common[1])),
            .cov_11 = own * own * (1.0 + 4.0) + shared * shared, /* as in observe */
            .cov_12 = own * own * -3.0,
            .cov_22 = own * own * (1.0 + 2.25) + shared * shared,
            .shared_rad = {{shared, 0.0}, {0.0, shared}}};
    }
    return true;
}

/* Mean NEES over draws of the error of an object after an update with a pass. */
static double nees_of_passes(const bst_elements *set, double offset_s, int draws) {
    bst_ctx ctx = {0};
    bst_custody_orbit orbit;
    bst_sgp4 *sgp4;
    const bst_rng_key key = bst_rng_make_key(3, 0, "test", "passes");
    double sum = 0.0;
    bst_assert_ok(&ctx, bst_sgp4_create(&ctx, set, BST_SGP4_WGS72, BST_SGP4_IMPROVED, &sgp4));
    bst_assert_ok(&ctx, bst_custody_orbit_init(&ctx, set, offset_s, 0.0, &orbit));
    for (int i = 0; i < draws; i++) {
        double normals[BST_CUSTODY_STATE];
        bst_custody_filter filter;
        bst_od_observation pass[4];
        const uint64_t number = (uint64_t)(1000 * set->norad + i);
        for (int k = 0; k < BST_CUSTODY_STATE; k++) {
            normals[k] = bst_rng_normal(key, number, (uint64_t)(200 + k));
        }
        bst_custody_filter_init(&config, &orbit, normals, &filter);
        assert_true(observe_pass(sgp4, offset_s, 200.0 * i, key, number, pass));
        assert_true(bst_custody_update_directions(&orbit, both_axes, pass, 4, &filter));
        const bst_custody_filter updated = filter;
        /* half of another object, that stood still */
        pass[2].direction = pass[3].direction = pass[0].direction;
        assert_false(bst_custody_update_directions(&orbit, both_axes, pass, 4, &filter));
        assert_memory_equal(&filter, &updated, sizeof filter);
        sum += bst_custody_nees(&filter);
    }
    bst_sgp4_free(sgp4);
    return sum / draws;
}

/* Updates with directions leave the error that the covariance says: errors that directions share
 * count, and so does the curvature where drag is strong (ACRUX 1, weeks before its decay; element
 * sets of Starlinks that climb), where a filter without it had a mean NEES of 48 and 7.6 after one
 * observation of direction and rate. */
static void directions_and_strong_drag(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_elements *sets = NULL;
    int count = 0;
    enum { DRAWS = 120 };
    const struct {
        int norad;
        double age_days; /* of the elements */
    } objects[] = {{25544, 0.3}, {44801, 0.5}, {52135, 0.05}, {44369, 2.4}};
    const bst_elements_options options = {.skip_bad_sets = true};
    bst_assert_ok(&ctx, bst_elements_load(&ctx, CATALOGUE, &options, &sets, &count));
    int found = 0;
    for (int k = 0; k < 4; k++) {
        for (int i = 0; i < count; i++) {
            if (sets[i].norad == objects[k].norad) {
                double nees = nees_of_passes(&sets[i], 86400.0 * objects[k].age_days, DRAWS);
                print_message("%d: NEES %.2f\n", sets[i].norad, nees);
                bst_assert_close(nees, 6.0, 4.0 * sqrt(12.0 / DRAWS));
                found++;
            }
        }
    }
    assert_int_equal(found, 4);
    free(sets);
}

/* Mean NEES of low orbits after a pass of twelve directions whose errors are `scale` times as large
 * as stated; the last `outliers` are half a degree off. *sigma: mean of the position's standard
 * deviation, m; *updated: how many. */
static double nees_of_arcs(double scale, int outliers, double *sigma, int *updated) {
    bst_ctx ctx = {0};
    enum { DRAWS = 400, COUNT = 12 };
    const bst_elements set = {.norad = 6,
                              .epoch_utc_jd1 = 2459746.5,
                              .eccentricity = 0.01,
                              .inclination_rad = 1.2,
                              .raan_rad = 1.0,
                              .arg_perigee_rad = 2.0,
                              .mean_anomaly_rad = 0.5,
                              .mean_motion_radpmin = 0.06};
    const bst_rng_key key = bst_rng_make_key(9, 0, "test", "arcs");
    const double own = 0.5 * BST_ARCSEC_RAD;
    bst_custody_orbit orbit;
    bst_sgp4 *sgp4;
    double sum = 0.0;
    *sigma = 0.0;
    *updated = 0;
    bst_assert_ok(&ctx, bst_sgp4_create(&ctx, &set, BST_SGP4_WGS72, BST_SGP4_IMPROVED, &sgp4));
    bst_assert_ok(&ctx, bst_custody_orbit_init(&ctx, &set, 0.0, 0.0, &orbit));
    for (int i = 0; i < DRAWS; i++) {
        double normals[BST_CUSTODY_STATE], one;
        bst_vec3 place;
        bst_custody_filter filter;
        bst_od_observation arc[COUNT];
        for (int k = 0; k < BST_CUSTODY_STATE; k++) {
            normals[k] = bst_rng_normal(key, (uint64_t)i, (uint64_t)k);
        }
        bst_custody_filter_init(&config, &orbit, normals, &filter);
        for (int k = 0; k < COUNT; k++) {
            bst_custody_observation at;
            bst_od_state object = {.time_s = 500.0 + 5.0 * k};
            bst_od_sight sight;
            assert_true(observe(sgp4, 0.0, object.time_s, key, 0, &at));
            assert_true(bst_sgp4_motion(sgp4, object.time_s / 60.0, &object.position_m,
                                        &object.velocity_mps));
            bst_od_see(&object, &at.observer, &sight);
            const bst_tangent axes = bst_tangent_at(sight.direction);
            const double off = k >= COUNT - outliers ? 0.5 * BST_DEG_RAD : 0.0;
            const bst_vec3 error = bst_tangent_vector(
                &axes, off + scale * own * bst_rng_normal(key, (uint64_t)i, (uint64_t)(10 + 2 * k)),
                scale * own * bst_rng_normal(key, (uint64_t)i, (uint64_t)(11 + 2 * k)));
            arc[k] = (bst_od_observation){.observer = at.observer,
                                          .direction = bst_tangent_exp(sight.direction, error),
                                          .cov_11 = own * own,
                                          .cov_22 = own * own};
        }
        if (bst_custody_update_directions(&orbit, both_axes, arc, COUNT, &filter)) {
            double nees = bst_custody_nees(&filter);
            assert_true(bst_custody_predict_position(&orbit, &filter, 530.0, &place, &one));
            *sigma += one;
            sum += nees;
            (*updated)++;
        }
    }
    bst_sgp4_free(sgp4);
    *sigma /= fmax(*updated, 1.0);
    return sum / fmax(*updated, 1.0);
}

/* An arc shows how large its errors are, and single directions far off are left out; several are
 * another object's. */
static void arcs_scale_their_errors(void **state) {
    (void)state;
    double stated_m, larger_m, without_m, unused_m;
    int stated_count, larger_count, without_count, refused_count;
    const double stated = nees_of_arcs(1.0, 0, &stated_m, &stated_count);
    const double larger = nees_of_arcs(2.0, 0, &larger_m, &larger_count);
    const double without = nees_of_arcs(1.0, 2, &without_m, &without_count);
    (void)nees_of_arcs(1.0, 6, &unused_m, &refused_count);
    print_message("NEES %.2f (%.1f m), %.2f (%.1f m), %.2f (%.1f m)\n", stated, stated_m, larger,
                  larger_m, without, without_m);
    assert_int_equal(stated_count, 400);
    assert_true(larger_count > 390);
    assert_int_equal(without_count, 400);
    assert_int_equal(refused_count, 0);
    /* 4 sigma of the mean of 400 chi-squares of 6 degrees of freedom, and the scatter of the
     * factor: its mean of 1 / factor is above 1 by its variance, 2 * 18 / 38^2 */
    bst_assert_close(stated, 6.0 * 1.025, 4.0 * sqrt(12.0 / 400.0));
    bst_assert_close(without, 6.0 * 1.025, 4.0 * sqrt(12.0 / 400.0));
    /* errors of twice the size, not known before, half made good by the factor (20 + 4 * 18) / (20
     * + 18): 4 / 2.4 of the variance remain for what the pass measures */
    assert_true(larger > 6.0 && larger < 6.0 * 4.0 / 2.2);
    assert_true(larger_m > 1.2 * stated_m);
}

static bst_elements low_orbit(void) {
    return (bst_elements){.norad = 5,
                          .epoch_utc_jd1 = 2459746.5,
                          .eccentricity = 0.01,
                          .inclination_rad = 1.2,
                          .raan_rad = 1.0,
                          .arg_perigee_rad = 2.0,
                          .mean_anomaly_rad = 0.5,
                          .mean_motion_radpmin = 0.06};
}

/* Orientation of TEME, which precesses. */
static bst_mat3 axes_at(double time_s) {
    const double angle = 7.7e-12 * time_s;
    return (bst_mat3){{{1, -angle, 0}, {angle, 1, 0}, {0, 0, 1}}};
}

/* State on an element set; GCRF. */
static bst_od_state state_of(const bst_sgp4 *sgp4, double time_s) {
    const bst_mat3 axes = axes_at(time_s);
    bst_od_state out = {.time_s = time_s};
    assert_true(bst_sgp4_motion(sgp4, time_s / 60.0, &out.position_m, &out.velocity_mps));
    out.position_m = bst_mat3_mul_vec(&axes, out.position_m);
    out.velocity_mps = bst_mat3_mul_vec(&axes, out.velocity_mps);
    return out;
}

/* Mean NEES of an object `ahead_m` ahead of its observer on the same orbit, after an arc of a
 * minute and a half; *updated: how many of 100. */
static double nees_of_neighbours(const bst_elements *set, double ahead_m, int *updated) {
    bst_ctx ctx = {0};
    enum { DRAWS = 100, COUNT = 12 };
    bst_elements behind = *set;
    const bst_rng_key key = bst_rng_make_key(11, 0, "test", "neighbours");
    const double own = 0.01 * BST_ARCSEC_RAD, photocentre_m = 0.5;
    bst_custody_orbit orbit;
    bst_sgp4 *object, *eye;
    double sum = 0.0;
    *updated = 0;
    bst_assert_ok(&ctx, bst_custody_orbit_init(&ctx, set, 0.0, photocentre_m, &orbit));
    behind.mean_anomaly_rad -= ahead_m / orbit.a_m;
    bst_assert_ok(&ctx, bst_sgp4_create(&ctx, set, BST_SGP4_WGS72, BST_SGP4_IMPROVED, &object));
    bst_assert_ok(&ctx, bst_sgp4_create(&ctx, &behind, BST_SGP4_WGS72, BST_SGP4_IMPROVED, &eye));
    for (int i = 0; i < DRAWS; i++) {
        const double factor = i % 2 ? 1.8 : 1.0; /* of the photocentre by phase */
        double normals[BST_CUSTODY_STATE], draws[6];
        bst_custody_filter filter;
        bst_od_observation arc[COUNT];
        for (int k = 0; k < BST_CUSTODY_STATE; k++) {
            normals[k] = bst_rng_normal(key, (uint64_t)i, (uint64_t)k);
            draws[k] =
                factor * photocentre_m * bst_rng_normal(key, (uint64_t)i, (uint64_t)(100 + k));
        }
        bst_custody_filter_init(&config, &orbit, normals, &filter);
        for (int k = 0; k < COUNT; k++) {
            const double time_s = 500.0 + 8.0 * k;
            const bst_od_state from = state_of(eye, time_s);
            bst_od_state at = state_of(object, time_s);
            bst_od_sight sight;
            /* the photocentre turns as the object goes round */
            const double turn = set->mean_motion_radpmin / 60.0 * time_s;
            at.position_m.x += cos(turn) * draws[0] + sin(turn) * draws[1];
            at.position_m.y += cos(turn) * draws[2] + sin(turn) * draws[3];
            at.position_m.z += cos(turn) * draws[4] + sin(turn) * draws[5];
            arc[k] = (bst_od_observation){.observer = {.time_s = time_s,
                                                       .position_m = from.position_m,
                                                       .velocity_mps = from.velocity_mps},
                                          .cov_11 = own * own,
                                          .cov_22 = own * own,
                                          .photocentre_factor = i % 2 ? factor : 0.0};
            bst_od_see(&at, &arc[k].observer, &sight);
            const bst_tangent axes = bst_tangent_at(sight.direction);
            arc[k].direction = bst_tangent_exp(
                sight.direction,
                bst_tangent_vector(&axes,
                                   own * bst_rng_normal(key, (uint64_t)i, (uint64_t)(10 + 2 * k)),
                                   own * bst_rng_normal(key, (uint64_t)i, (uint64_t)(11 + 2 * k))));
        }
        const bst_mat3 ends[2] = {axes_at(arc[0].observer.time_s),
                                  axes_at(arc[COUNT - 1].observer.time_s)};
        if (bst_custody_update_directions(&orbit, ends, arc, COUNT, &filter)) {
            sum += bst_custody_nees(&filter);
            (*updated)++;
        }
    }
    bst_sgp4_free(object);
    bst_sgp4_free(eye);
    return sum / fmax(*updated, 1.0);
}

/* The photocentre of a Lambertian sphere against the sum of its light over points of it. */
static void photocentre_of_a_sphere(void **state) {
    (void)state;
    enum { POINTS = 400 };
    for (int degrees = 20; degrees <= 160; degrees += 20) {
        const double phase = degrees * BST_DEG_RAD;
        double light = 0.0, moment = 0.0;
        for (int i = 0; i < POINTS; i++) {
            for (int k = 0; k < POINTS; k++) {
                const double up = asin(2.0 * (i + 0.5) / POINTS - 1.0); /* equal areas */
                const double round = BST_PI * ((k + 0.5) / POINTS - 0.5);
                const double x = cos(up) * sin(round), z = cos(up) * cos(round);
                const double lit = fmax(x * sin(phase) + z * cos(phase), 0.0);
                light += lit * z;
                moment += lit * z * x;
            }
        }
        bst_assert_close(bst_od_photocentre_factor(phase), fmax(moment / light * sqrt(2.0), 0.2),
                         2e-3);
    }
    assert_true(bst_od_photocentre_factor(0.0) == 0.2);
    bst_assert_close(bst_od_photocentre_factor(BST_PI), 9.0 * BST_PI / 32.0 * sqrt(2.0), 1e-3);
}

/* Beside the observer directions of 0.01 arcsec are good to millimetres: they show how the
 * photocentre turns, the precession of the axes in a minute (30 mm in the geostationary ring), and
 * that they are no linear function of the orbit's errors. */
static void neighbours_of_the_observer(void **state) {
    (void)state;
    const double ahead_m[] = {5e3, 30e3, 300e3};
    bst_elements sets[] = {low_orbit(), low_orbit(), low_orbit()};
    sets[1].mean_motion_radpmin = sets[2].mean_motion_radpmin = 2.0 * BST_PI / 1436.1;
    sets[1].eccentricity = sets[2].eccentricity = 2e-4;
    sets[2].inclination_rad = 0.001;
    for (int i = 0; i < 9; i++) {
        int updated;
        const double nees = nees_of_neighbours(&sets[i / 3], ahead_m[i % 3], &updated);
        print_message("orbit %d, %.0f km: %d of 100, NEES %.2f\n", i / 3, 1e-3 * ahead_m[i % 3],
                      updated, nees);
        /* the upper bound of arcs_scale_their_errors; curvature counts as noise, so that the
         * covariance of near objects may be too large */
        assert_true(updated > 80);
        assert_true(nees > 4.0 && nees < 6.0 * 1.025 + 4.0 * sqrt(12.0 / 100.0));
    }
}

/* Process noise of half a day spreads the place then and later, in one step and in many. */
static void noise_spreads_places(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    const bst_elements set = low_orbit();
    const bst_custody_config noisy = {.sigma_m = 10, .drift_m_per_day = 10, .noise_m_per_day = 800};
    bst_custody_orbit orbit;
    bst_custody_filter plain, aged, steps;
    bst_vec3 place;
    double a, b;
    bst_assert_ok(&ctx, bst_custody_orbit_init(&ctx, &set, 0.0, 0.0, &orbit));
    bst_custody_filter_init(&noisy, &orbit, NULL, &plain);
    aged = steps = plain;
    bst_custody_add_process_noise(&noisy, 43200.0, &aged);
    assert_true(bst_custody_predict_position(&orbit, &plain, 43200.0, &place, &a));
    assert_true(bst_custody_predict_position(&orbit, &aged, 43200.0, &place, &b));
    /* 800 m sqrt(T^3 / 3) after T = 1/2 day; 2 % for the radial part */
    double spread = 800.0 * sqrt(0.125 / 3.0);
    bst_assert_close(sqrt(b * b - a * a), spread, 0.02 * spread);
    assert_true(bst_custody_predict_position(&orbit, &plain, 129600.0, &place, &a));
    assert_true(bst_custody_predict_position(&orbit, &aged, 129600.0, &place, &b));
    /* a day later: 800 m times the root of the integral of (1.5 - u)^2 from 0 to 1/2 */
    spread = 800.0 * sqrt((1.5 * 1.5 * 1.5 - 1.0) / 3.0);
    bst_assert_close(sqrt(b * b - a * a), spread, 0.02 * spread);
    for (int i = 1; i <= 20; i++) {
        bst_custody_add_process_noise(&noisy, 2160.0 * i, &steps);
    }
    for (int i = 0; i < BST_CUSTODY_STATE; i++) {
        for (int k = 0; k < BST_CUSTODY_STATE; k++) {
            bst_assert_close(steps.p[i][k], aged.p[i][k], 1e-6);
        }
    }
    bst_custody_filter again = aged;
    bst_custody_add_process_noise(&noisy, 40000.0, &again);
    assert_memory_equal(&again, &aged, sizeof aged);
}

/* Another object is far outside of the gate; a photocentre of metres matters next to the object. */
static void photocentre_and_strangers(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    const bst_elements set = low_orbit();
    bst_elements other = set;
    other.mean_anomaly_rad += 0.01; /* 70 km ahead */
    bst_sgp4 *sgp4;
    bst_custody_orbit orbit, wide;
    bst_custody_filter filter;
    bst_custody_observation z;
    bst_custody_prediction p, q;
    bst_rng_key key = bst_rng_make_key(1, 0, "test", "custody");
    bst_assert_ok(&ctx, bst_sgp4_create(&ctx, &other, BST_SGP4_WGS72, BST_SGP4_IMPROVED, &sgp4));
    assert_true(observe(sgp4, 0.0, 600.0, key, 0, &z));
    bst_sgp4_free(sgp4);
    bst_assert_ok(&ctx, bst_custody_orbit_init(&ctx, &set, 0.0, 0.0, &orbit));
    bst_assert_ok(&ctx, bst_custody_orbit_init(&ctx, &set, 0.0, 1000.0, &wide));
    bst_custody_filter_init(&config, &orbit, NULL, &filter);
    assert_true(bst_custody_predict(&orbit, &filter, &z, &p));
    assert_true(p.chi2 > 100.0);
    assert_true(bst_custody_predict(&wide, &filter, &z, &q));
    assert_true(q.chi2 < p.chi2 && q.covariance[0][0] > p.covariance[0][0]);
    z.covariance[1][1] = 0.0; /* no error at all: nothing to weigh by */
    bst_custody_filter unchanged = filter;
    assert_false(bst_custody_update(&orbit, &z, &filter));
    assert_memory_equal(&filter, &unchanged, sizeof filter);
}

static void refuses_what_is_no_ellipse(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_elements set = low_orbit();
    bst_custody_orbit orbit;
    set.mean_motion_radpmin = 0.0;
    assert_int_equal(bst_custody_orbit_init(&ctx, &set, 0.0, 0.0, &orbit), BST_ERR_NUMERIC);
    assert_non_null(strstr(ctx.message, "(catalogue number 5): mean motion 0 rad/min"));
    set = low_orbit();
    set.eccentricity = 1.0;
    assert_int_equal(bst_custody_orbit_init(&ctx, &set, 0.0, 0.0, &orbit), BST_ERR_NUMERIC);
    assert_non_null(strstr(ctx.message, "eccentricities from 0 to below 1"));
}

/* Where SGP4 is not smooth in its elements, the catalogued ones give the catalogued place: without
 * an eccentricity the line of apsides is nowhere, but Sun and Moon act along it. */
static void circular_orbits_keep_their_apsides(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    for (int k = 0; k < 4; k++) {
        const bst_elements set = {.epoch_utc_jd1 = 2459746.5,
                                  .inclination_rad = 55.0 * BST_DEG_RAD,
                                  .eccentricity = k == 3 ? 9e-4 : 0.0,
                                  .arg_perigee_rad = 2.0 * k,
                                  .mean_anomaly_rad = 1.0,
                                  .mean_motion_radpmin = 2.0 * BST_PI / 718.0};
        bst_custody_orbit orbit;
        bst_sgp4 *sgp4;
        bst_vec3 r, v, place;
        bst_assert_ok(&ctx, bst_custody_orbit_init(&ctx, &set, 3600.0, 0.0, &orbit));
        bst_assert_ok(&ctx, bst_sgp4_create(&ctx, &set, BST_SGP4_WGS72, BST_SGP4_IMPROVED, &sgp4));
        assert_true(bst_sgp4_motion(sgp4, 70.0, &r, &v));
        bst_sgp4_free(sgp4);
        assert_true(bst_custody_catalogued_position(&orbit, 600.0, &place));
        assert_true(bst_vec3_norm(bst_vec3_sub(place, r)) < 1e-3); /* 80 m otherwise */
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(circular_orbits_keep_their_apsides),
        cmocka_unit_test(errors_agree_with_covariances),
        cmocka_unit_test(directions_and_strong_drag),
        cmocka_unit_test(arcs_scale_their_errors),
        cmocka_unit_test(neighbours_of_the_observer),
        cmocka_unit_test(photocentre_of_a_sphere),
        cmocka_unit_test(noise_spreads_places),
        cmocka_unit_test(photocentre_and_strangers),
        cmocka_unit_test(refuses_what_is_no_ellipse),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
