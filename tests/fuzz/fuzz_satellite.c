/* The readers of shapes (JSON, OBJ, glTF, GLB) on any bytes. What is accepted has finite facets
 * with an area, and reflects a finite amount of light. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sim/satellite/flux.h"
#include "tests/fuzz/input_file.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes);

/* True if the bytes hold a word. */
static bool holds(const uint8_t *data, size_t bytes, const char *word) {
    size_t n = strlen(word);
    for (size_t i = 0; i + n <= bytes; i++) {
        if (memcmp(data + i, word, n) == 0) {
            return true;
        }
    }
    return false;
}

/* draw: a number that follows from the input. */
static void check(bst_ctx *ctx, const bst_satellite *s, unsigned draw) {
    for (int f = 0; f < s->facet_count; f++) {
        if (!(s->facets[f].area_m2 > 0.0) || !isfinite(s->facets[f].area_m2) ||
            !(fabs(bst_vec3_norm(s->facets[f].normal) - 1.0) < 1e-9)) {
            abort();
        }
    }
    bst_satellite_pose *pose;
    /* with sanitizers light takes ten times as long as reading: small models always, others, of
     * more bodies than BST_SEPARATION_BODIES too, one in eight */
    bool wanted = s->facet_count <= 24 || (s->facet_count <= 160 && draw % 8 == 0);
    if (!wanted || bst_satellite_pose_create(ctx, s, &pose) != BST_OK) {
        return;
    }
    bst_vec3 sun = bst_vec3_unit((bst_vec3){0.3, -0.5, 0.7}), eye = {0.6, 0.64, 0.48};
    bst_satellite_light light = {.sun = sun, .observer = eye, .sunlit = 1.0, .emission = true};
    bst_satellite_flux flux;
    bst_satellite_pose_set(pose, &(bst_satellite_aim){sun, {0, 0, 1}, eye, 5.0});
    bst_satellite_flux_at(pose, &light, &flux);
    if (!isfinite(flux.sun[BST_SUNLIGHT_V]) || flux.sun[BST_SUNLIGHT_V] < 0.0 ||
        !isfinite(flux.visible_m2)) {
        abort();
    }
    bst_satellite_pose_free(pose);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes) {
    bool json = bytes > 0 && (data[0] == '{' || data[0] == 'g');
    bool scene = holds(data, bytes, "scenes");
    const char *name = !json ? "input.obj" : scene ? "input.glb" : "input.json";
    const char *path = fuzz_write_file(name, data, bytes);
    bst_ctx ctx;
    bst_satellite *s;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
    bst_status status = bst_satellite_load(&ctx, path, &s);
    FUZZ_CHECK_REASON(ctx, status);
    if (status == BST_OK) {
        unsigned draw = 0;
        for (size_t i = 0; i < bytes; i++) {
            draw = 31 * draw + data[i];
        }
        check(&ctx, s, draw >> 8);
    } else if (s) {
        abort();
    }
    bst_satellite_free(s);
    return 0;
}
