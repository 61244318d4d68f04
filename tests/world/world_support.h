/* A world out of JSON text, for tests. */
#ifndef BST_TESTS_WORLD_WORLD_SUPPORT_H
#define BST_TESTS_WORLD_WORLD_SUPPORT_H

#include "sim/optics/psf.h"
#include "sim/world/world_internal.h"
#include "tests/test_support.h"

typedef struct test_scene {
    bst_world_config world;
    bst_config_list observers;
} test_scene;

static const bst_config_desc test_scene_table[] = {
    BST_OBJECT(test_scene, world, bst_world_config_table, "{}", "The world."),
    BST_LIST(test_scene, observers, bst_observer_config, bst_observer_config_table, 1, 10, NULL,
             "Observers."),
    BST_CONFIG_END};

#define TEST_NEOSSAT \
    "\"orbit\": {\"elements_file\": \"scenarios/catalogue_2022-06.tle\", \"norad\": 39089}"
#define TEST_GX5 \
    "\"orbit\": {\"elements_file\": \"scenarios/catalogue_2022-06.tle\", \"norad\": 44801}"
#define TEST_CAMERA                                                                       \
    "\"camera\": {\"pixel_scale_arcsec\": 3, \"aperture_m\": 0.15, \"throughput\": 0.7, " \
    "\"quantum_efficiency\": 0.7, \"photon_flux_v0_per_s_m2\": 3.6e10, "                  \
    "\"dark_current_e_per_s\": 0.5}"

/* The main scenario's epoch. */
#define TEST_EPOCH "2022-06-16T22:10:00Z"

static inline bst_status test_world_try(bst_ctx *ctx, const char *epoch_utc, const char *text,
                                        bst_world **out) {
    bst_json *json = NULL;
    test_scene scene;
    bst_time epoch;
    *out = NULL;
    bst_assert_ok(ctx, bst_time_from_utc(ctx, epoch_utc, &epoch));
    bst_assert_ok(ctx, bst_json_parse(ctx, "test", text, strlen(text), &json));
    bst_assert_ok(ctx,
                  bst_config_read(ctx, json, bst_json_root(json), "", test_scene_table, &scene));
    bst_status status =
        bst_world_create(ctx, "test", &scene.world, &scene.observers, "", epoch, out);
    bst_config_free(test_scene_table, &scene);
    bst_json_free(json);
    return status;
}

static inline bst_world *test_world(const char *text) {
    bst_ctx ctx = {0};
    bst_world *world;
    bst_assert_ok(&ctx, test_world_try(&ctx, TEST_EPOCH, text, &world));
    return world;
}

/* A world with these objects, seen from NEOSSat, and these keys in its sensor. */
static inline bst_world *test_world_with(const char *objects, const char *sensor) {
    char text[4000];
    snprintf(text, sizeof text,
             "{\"world\": {\"star_catalogue\": \"embedded\", \"objects\": [%s]}, \"observers\": "
             "[{\"name\": \"neossat\", " TEST_NEOSSAT ", \"sensors\": [{" TEST_CAMERA "%s}]}]}",
             objects, sensor);
    return test_world(text);
}

static inline double test_distance(bst_vec3 a, bst_vec3 b) {
    return bst_vec3_norm(bst_vec3_sub(a, b));
}

/* Integral of the squared image that is (1 - u) of the first node's and u of the second one's, both
 * round. */
static inline double test_mixed_square(const bst_psf *psf, double u) {
    const double df = 0.002; /* 1/px; both images are round */
    double sum = 0.0, a[2], b[2];
    for (double f = 0.5 * df; f < 1.0; f += df) {
        bst_psf_otf(psf, 0, f, 0.0, a);
        bst_psf_otf(psf, 1, f, 0.0, b);
        sum += 2.0 * BST_PI * f * df * pow((1.0 - u) * a[0] + u * b[0], 2.0);
    }
    return sum;
}

#endif
