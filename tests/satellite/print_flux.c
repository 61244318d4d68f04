/* Prints the light of a satellite in some geometries, with its triangles, for compare_mitsuba.py:
 * one JSON object a line. Materials become Lambertian, the finest facets stand for curved surfaces.
 *
 *   print_flux SATELLITE.json GEOMETRIES */
#include "sim/satellite/flux.h"
#include "tests/satellite/satellite_support.h"

/* Loads a satellite and makes its curved parts fine. */
static bst_satellite *load(const char *path) {
    bst_ctx ctx = {0};
    bst_json *json;
    bst_satellite_config config;
    bst_satellite *s = NULL;
    if (bst_json_load(&ctx, path, &json) != BST_OK ||
        bst_config_read(&ctx, json, bst_json_root(json), "", bst_satellite_config_table, &config) !=
            BST_OK) {
        fprintf(stderr, "%s\n", ctx.message);
        exit(1);
    }
    bst_satellite_part_config *parts = config.parts.items;
    for (int i = 0; i < config.parts.count; i++) {
        parts[i].segments = 96;
    }
    if (bst_satellite_create(&ctx, &config, "", &s) != BST_OK) {
        fprintf(stderr, "%s\n", ctx.message);
        exit(1);
    }
    bst_config_free(bst_satellite_config_table, &config);
    bst_json_free(json);
    for (int m = 0; m < s->material_count; m++) {
        s->materials[m].brdf =
            (bst_brdf){.model = BST_BRDF_LAMBERT, .diffuse = 0.2 + 0.6 * m / s->material_count};
        s->materials[m].scale = 1.0;
    }
    return s;
}

static void print_geometry(bst_satellite_pose *p, bst_vec3 sun, bst_vec3 eye) {
    const bst_satellite *s = p->satellite;
    bst_satellite_light light = {.sun = sun, .observer = eye, .sunlit = 1.0};
    bst_satellite_flux flux;
    bst_satellite_pose_set(p, &(bst_satellite_aim){sun, {0, 0, 1}, eye, 0.0});
    bst_satellite_flux_at(p, &light, &flux);
    printf(
        "{\"sun\": [%.17g, %.17g, %.17g], \"eye\": [%.17g, %.17g, %.17g], \"flux\": %.17g, "
        "\"triangles\": [",
        sun.x, sun.y, sun.z, eye.x, eye.y, eye.z, flux.sun[BST_SUNLIGHT_V]);
    const char *comma = "";
    for (int f = 0; f < s->facet_count; f++) {
        const int *c = s->corner + s->facets[f].first;
        const bst_occluder *body = &s->occluders[s->facets[f].occluder];
        /* of two facets in one place only the one that is seen */
        bool thin = body->vertex_count == s->facets[f].count || body->shell >= 0;
        if (thin && bst_vec3_dot(p->normals[f], eye) <= 0.0) {
            continue;
        }
        for (int i = 2; i < s->facets[f].count; i++) {
            printf("%s[%.4f", comma, s->materials[s->facets[f].material].brdf.diffuse);
            const int v[3] = {c[0], c[i - 1], c[i]};
            for (int k = 0; k < 3; k++) {
                bst_vec3 q = p->vertices[v[k]];
                printf(", %.9g, %.9g, %.9g", q.x, q.y, q.z);
            }
            printf("]");
            comma = ", ";
        }
    }
    printf("]}\n");
}

int main(int argc, char **argv) {
    if (argc != 3) {
        fprintf(stderr, "usage: print_flux SATELLITE.json GEOMETRIES\n");
        return 2;
    }
    bst_ctx ctx = {0};
    bst_satellite *s = load(argv[1]);
    bst_satellite_pose *pose;
    if (bst_satellite_pose_create(&ctx, s, &pose) != BST_OK) {
        return 1;
    }
    uint64_t random = 31;
    for (int i = 0; i < atoi(argv[2]);) {
        bst_vec3 sun = bst_test_direction(&random), eye = bst_test_direction(&random);
        if (bst_vec3_dot(sun, eye) > -0.3) { /* enough light to compare */
            print_geometry(pose, sun, eye);
            i++;
        }
    }
    bst_satellite_pose_free(pose);
    bst_satellite_free(s);
    return 0;
}
