/* Satellites from JSON text. */
#ifndef BST_TESTS_SATELLITE_SUPPORT_H
#define BST_TESTS_SATELLITE_SUPPORT_H

#include "sim/satellite/flux.h"
#include "tests/test_support.h"

/* Builds a satellite from the JSON text of its shape. */
static inline bst_status bst_test_satellite(bst_ctx *ctx, const char *text, bst_satellite **out) {
    bst_json *json;
    bst_satellite_config config;
    *out = NULL;
    BST_TRY(bst_json_parse(ctx, "shape.json", text, strlen(text), &json));
    bst_status status =
        bst_config_read(ctx, json, bst_json_root(json), "", bst_satellite_config_table, &config);
    if (status == BST_OK) {
        status = bst_satellite_create(ctx, &config, "", out);
        bst_config_free(bst_satellite_config_table, &config);
    }
    bst_json_free(json);
    return status;
}

/* A model with its pose. */
typedef struct bst_test_model {
    bst_satellite *satellite;
    bst_satellite_pose *pose;
} bst_test_model;

static inline bst_test_model bst_test_model_open(const char *text) {
    bst_ctx ctx = {0};
    bst_test_model m;
    bst_assert_ok(&ctx, bst_test_satellite(&ctx, text, &m.satellite));
    bst_assert_ok(&ctx, bst_satellite_pose_create(&ctx, m.satellite, &m.pose));
    return m;
}

static inline void bst_test_model_close(bst_test_model *m) {
    bst_satellite_pose_free(m->pose);
    bst_satellite_free(m->satellite);
}

/* Reflected sunlight in V, m^2/sr, with a point Sun. */
static inline double bst_test_flux(bst_test_model *m, bst_vec3 sun, bst_vec3 observer) {
    bst_satellite_light light = {.sun = sun, .observer = observer, .sunlit = 1.0};
    bst_satellite_aim aim = {.sun = sun, .earth = {0, 0, 1}, .target = observer};
    bst_satellite_flux flux;
    bst_satellite_pose_set(m->pose, &aim);
    bst_satellite_flux_at(m->pose, &light, &flux);
    return flux.sun[BST_SUNLIGHT_V];
}

/* Pseudo-random numbers in [0, 1) (Park and Miller 1988). */
static inline double bst_test_uniform(uint64_t *state) {
    *state = *state * 48271u % 2147483647u;
    return (double)*state / 2147483647.0;
}

static inline bst_vec3 bst_test_direction(uint64_t *state) {
    double z = 2.0 * bst_test_uniform(state) - 1.0, a = 2.0 * BST_PI * bst_test_uniform(state);
    double r = sqrt(1.0 - z * z);
    return (bst_vec3){r * cos(a), r * sin(a), z};
}

#endif
