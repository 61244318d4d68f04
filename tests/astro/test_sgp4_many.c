/* SGP4 of many sets against the scalar code, which test_sgp4.c compares with the published one. */
#include <float.h>
#include <stdlib.h>

#include "boresight/vec.h"
#include "sim/astro/sgp4.h"
#include "sim/core/simd.h"
#include "tests/test_support.h"

/* made by make_sgp4_reference.py: both gravity models and modes, orbits at the edges of the theory,
 * up to ten years from the epoch */
#define REFERENCE "tests/astro/sgp4_reference.txt"
#define CATALOGUE "scenarios/objects_2022-06.tle"

/* Sets with their times. */
typedef struct list {
    const bst_sgp4 **sets;
    double *minutes;
    bst_sgp4_state *scalar, *many;
    int count, room;
    bst_sgp4 **owned;
    int owned_count;
} list;

static bst_sgp4 *own(list *l, const bst_elements *el, bst_sgp4_gravity gravity,
                     bst_sgp4_mode mode) {
    bst_ctx ctx;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
    bst_sgp4 *s = NULL;
    if (bst_sgp4_create(&ctx, el, gravity, mode, &s) != BST_OK) {
        return NULL; /* one of the sets that are no orbit */
    }
    l->owned = realloc(l->owned, (size_t)(l->owned_count + 1) * sizeof *l->owned);
    l->owned[l->owned_count++] = s;
    return s;
}

static void put(list *l, const bst_sgp4 *s, double minutes) {
    if (l->count == l->room) {
        l->room = 2 * l->room + 1024;
        l->sets = realloc(l->sets, (size_t)l->room * sizeof *l->sets);
        l->minutes = realloc(l->minutes, (size_t)l->room * sizeof *l->minutes);
        assert_true(l->sets && l->minutes);
    }
    l->sets[l->count] = s;
    l->minutes[l->count++] = minutes;
}

static void drop(list *l) {
    for (int i = 0; i < l->owned_count; i++) {
        bst_sgp4_free(l->owned[i]);
    }
    free(l->owned);
    free(l->sets);
    free(l->minutes);
    free(l->scalar);
    free(l->many);
    *l = (list){.count = 0};
}

/* Compares all states with those of the scalar code, bit by bit where the scalar code has to do
 * them. *far: those whose time is beyond what the vectors do. */
static void compare(list *l) {
    l->scalar = calloc((size_t)l->count, sizeof *l->scalar);
    l->many = calloc((size_t)l->count, sizeof *l->many);
    for (int i = 0; i < l->count; i++) {
        bst_sgp4_state *s = &l->scalar[i];
        s->error = bst_sgp4_propagate(l->sets[i], l->minutes[i], s->position_teme_km,
                                      s->velocity_teme_kmps);
    }
    bst_sgp4_propagate_many(l->sets, l->minutes, l->count, l->many);
    double most_km = 0.0, most_kmps = 0.0;
    for (int i = 0; i < l->count; i++) {
        const bst_sgp4_state *a = &l->scalar[i], *b = &l->many[i];
        assert_int_equal(a->error, b->error);
        if (a->error != BST_SGP4_OK) {
            assert_memory_equal(a, b, sizeof *a);
            continue;
        }
        for (int j = 0; j < 3; j++) {
            double d = fabs(a->position_teme_km[j] - b->position_teme_km[j]);
            double w = fabs(a->velocity_teme_kmps[j] - b->velocity_teme_kmps[j]);
            if (!(d <= 1e-9 && w <= 1e-12)) {
                fail_msg("state %d at %g min: axis %d off by %g km, %g km/s", i, l->minutes[i], j,
                         d, w);
            }
            most_km = fmax(most_km, d);
            most_kmps = fmax(most_kmps, w);
        }
    }
    print_message("%d states: %.2g km, %.2g km/s\n", l->count, most_km, most_kmps);
}

/* The sets of a file of elements, spread over a week about their epochs. */
static void put_file(list *l, const char *path, int times) {
    bst_ctx ctx;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
    bst_elements *sets = NULL;
    int count = 0;
    const bst_tle_options options = {.skip_bad_sets = true};
    bst_assert_ok(&ctx, bst_tle_load(&ctx, path, &options, &sets, &count));
    for (int i = 0; i < count; i++) {
        const bst_sgp4 *s = own(l, &sets[i], BST_SGP4_WGS72, BST_SGP4_IMPROVED);
        for (int k = 0; s && k < times; k++) {
            put(l, s, 10080.0 * ((k + (i % 97) / 97.0) / times - 0.5));
        }
    }
    free(sets);
}

static void shipped_catalogue(void **state) {
    (void)state;
    list l = {.count = 0};
    put_file(&l, CATALOGUE, 12);
    assert_true(l.count > 60000);
    compare(&l);
    drop(&l);
}

/* Orbits at the edges of the theory, with all its errors, and times up to ten years. */
static void edges_of_the_theory(void **state) {
    (void)state;
    FILE *file = fopen(REFERENCE, "r");
    assert_non_null(file);
    list l = {.count = 0};
    char line[512];
    const bst_sgp4 *s = NULL;
    while (fgets(line, sizeof line, file)) {
        int gravity, mode;
        bst_elements el = {.norad = 1};
        double t;
        if (line[0] == 'E') {
            assert_int_equal(
                sscanf(line, "E %d %d %lf %lf %lf %lf %lf %lf %lf %lf %lf", &gravity, &mode,
                       &el.epoch_utc_jd1, &el.epoch_utc_jd2, &el.bstar, &el.eccentricity,
                       &el.inclination_rad, &el.raan_rad, &el.arg_perigee_rad, &el.mean_anomaly_rad,
                       &el.mean_motion_radpmin),
                11);
            s = own(&l, &el, gravity ? BST_SGP4_WGS84 : BST_SGP4_WGS72,
                    mode ? BST_SGP4_AFSPC : BST_SGP4_IMPROVED);
        } else if (line[0] != '#' && line[0] != 'S' && s && sscanf(line, "%lf", &t) == 1) {
            put(&l, s, t);
        }
    }
    fclose(file);
    assert_true(l.count > 1000);
    const double beyond[] = {2.1e6, -3e6, 2e9, NAN, INFINITY};
    for (size_t i = 0; i < sizeof beyond / sizeof *beyond; i++) {
        put(&l, l.owned[i], beyond[i]);
    }
    compare(&l);
    int errors[7] = {0};
    for (int i = 0; i < l.count; i++) {
        errors[l.many[i].error]++;
    }
    assert_true(errors[0] > 0 && errors[1] > 0 && errors[2] > 0 && errors[3] > 0 && errors[4] > 0 &&
                errors[6] > 0);
    drop(&l);
}

/* Another width of vectors, another order and other neighbours change no bit. */
static void widths_and_neighbours_do_not_matter(void **state) {
    (void)state;
    list l = {.count = 0};
    put_file(&l, CATALOGUE, 1);
    size_t bytes = (size_t)l.count * sizeof(bst_sgp4_state);
    l.many = calloc(1, bytes);
    l.scalar = calloc(1, bytes); /* here: of another width */
    bst_sgp4_propagate_many(l.sets, l.minutes, l.count, l.many);
    for (int floats = 4; floats <= 8; floats *= 2) {
        memset(l.scalar, 0, bytes);
        bst_simd_limit(floats);
        bst_sgp4_propagate_many(l.sets, l.minutes, l.count, l.scalar);
        bst_simd_limit(16);
        assert_memory_equal(l.scalar, l.many, bytes);
    }
    for (int i = 0; i < l.count; i += 7) {
        bst_sgp4_state one = {.error = BST_SGP4_OK};
        bst_sgp4_propagate_many(&l.sets[i], &l.minutes[i], 1, &one);
        assert_memory_equal(&one, &l.many[i], sizeof one);
    }
    drop(&l);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(shipped_catalogue),
        cmocka_unit_test(edges_of_the_theory),
        cmocka_unit_test(widths_and_neighbours_do_not_matter),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
