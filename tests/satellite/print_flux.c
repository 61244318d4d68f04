/* Prints the light of a satellite in some geometries, with its triangles, for compare_mitsuba.py:
 * one JSON object a line. Material m reflects by the model of the number FIRST + m, modulo the
 * seven models, with parameters that are the same in compare_mitsuba.py; FIRST "lambert": all by
 * Lambert's law. Fine facets stand for curved surfaces, finer ones with `image`, where each
 * geometry has a resolved image too: `radiance` over irradiance, per pixel, from a distance of 300
 * radii.
 *
 *   print_flux SATELLITE.json GEOMETRIES FIRST TABLE.csv [image] */
#include "sim/satellite/curved_patches.h"
#include "sim/satellite/resolved_image.h"
#include "tests/satellite/satellite_support.h"

/* Parameters of the models: all of them have lobes that are wide against a facet. */
static const bst_brdf models[] = {
    {.model = BST_BRDF_LAMBERT},
    {.model = BST_BRDF_PHONG, .diffuse = 0.2, .specular = 0.5, .exponent = 20.0},
    {.model = BST_BRDF_ASHIKHMIN_SHIRLEY, .diffuse = 0.3, .specular = 0.2, .exponent = 30.0},
    {.model = BST_BRDF_COOK_TORRANCE, .diffuse = 0.2, .specular = 0.5, .roughness = 0.35},
    {.model = BST_BRDF_BINOMIAL,
     .b = {-0.4, -0.7},
     .c = {-1.2, -0.8},
     .base = 3.0,
     .first_power = 1,
     .terms = 2},
    {.model = BST_BRDF_MAXWELL_BEARD,
     .diffuse = 0.1,
     .volume = 0.15,
     .specular = 0.3,
     .roughness = 0.35,
     .tau_rad = 0.3,
     .omega_rad = 0.5},
    {.model = BST_BRDF_TABLE},
};

enum { MODELS = sizeof models / sizeof models[0] };

static void give_up(const bst_ctx *ctx) {
    fprintf(stderr, "%s\n", ctx->message);
    exit(1);
}

/* Loads a satellite and makes its curved parts fine. `first` below 0: Lambert. */
static bst_satellite *load(const char *path, int first, const bst_brdf_table *table) {
    bst_ctx ctx = {0};
    bst_json *json;
    bst_satellite_config config;
    bst_satellite *s = NULL;
    if (bst_json_load(&ctx, path, &json) != BST_OK ||
        bst_config_read(&ctx, json, bst_json_root(json), "", bst_satellite_config_table, &config) !=
            BST_OK) {
        give_up(&ctx);
    }
    bst_satellite_part_config *parts = config.parts.items;
    for (int i = 0; i < config.parts.count; i++) {
        parts[i].segments = 96;
    }
    if (bst_satellite_create(&ctx, &config, "", &s) != BST_OK) {
        give_up(&ctx);
    }
    bst_config_free(bst_satellite_config_table, &config);
    bst_json_free(json);
    for (int m = 0; m < s->material_count; m++) {
        bst_brdf *brdf = &s->materials[m].brdf;
        *brdf = models[first < 0 ? 0 : (first + m) % MODELS];
        if (brdf->model == BST_BRDF_LAMBERT) {
            brdf->diffuse = 0.2 + 0.6 * m / s->material_count;
        }
        brdf->table = brdf->model == BST_BRDF_TABLE ? table : NULL;
        s->materials[m].scale = 1.0;
    }
    return s;
}

/* Pixels of the image along a side, of which the satellite's sphere spans SPAN, and cells of one.
 */
enum { SIDE = 64, SPAN = 56, FINE = 4 };
/* Distance of the camera, radii. */
static const double RANGE = 300.0;

/* Prints the image of a pose as seen from `eye`, and how the camera stands. */
static void print_image(bst_satellite_pose *p, bst_vec3 sun, bst_vec3 eye) {
    const bst_satellite *s = p->satellite;
    bst_ctx ctx = {0};
    bst_resolved *resolved;
    bst_resolved_gain gain[BST_SATELLITE_MATERIALS_MAX];
    double range_m = RANGE * s->radius_m, scale_rad = 2.0 * s->radius_m / range_m / SPAN;
    bst_quat look = bst_quat_look(bst_vec3_scale(eye, -1.0), bst_vec3_perpendicular(eye));
    bst_vec3 down = bst_quat_rotate(bst_quat_conj(look), (bst_vec3){0, 1, 0});
    bst_resolved_view view = {look, {0, 0, range_m}, scale_rad, 0.0, 0.0, NULL};
    bst_resolved_light light = {.sun = sun, .gain = gain};
    double low[2] = {-SIDE / 2, -SIDE / 2}, high[2] = {SIDE / 2, SIDE / 2};
    for (int i = 0; i < s->material_count; i++) {
        gain[i] = (bst_resolved_gain){.sun = 1.0};
    }
    if (bst_resolved_create(&ctx, s, &resolved) != BST_OK ||
        bst_resolved_begin(&ctx, resolved, low, high, 1.0 / FINE) != BST_OK ||
        bst_resolved_add(&ctx, resolved, p, &view, &light, 1.0, NULL) != BST_OK) {
        give_up(&ctx);
    }
    const bst_resolved_image *image = bst_resolved_image_of(resolved);
    printf(", \"range\": %.17g, \"scale\": %.17g, \"down\": [%.17g, %.17g, %.17g], \"radiance\": [",
           range_m, scale_rad, down.x, down.y, down.z);
    for (int y = 0; y < SIDE; y++) {
        for (int x = 0; x < SIDE; x++) {
            double sum = 0.0;
            for (int k = 0; k < FINE * FINE; k++) {
                int at = (FINE * y + k / FINE) * image->width + FINE * x + k % FINE;
                sum += (double)image->cells[at].light;
            }
            printf("%s%.9g", x || y ? ", " : "", sum / (scale_rad * scale_rad));
        }
    }
    printf("]");
    bst_resolved_free(resolved);
}

/* Prints a polygon as triangles. */
static void print_polygon(const bst_brdf *brdf, const bst_vec3 *corner, int count) {
    static const char *comma = "";
    if (count == 0) {
        comma = "";
    }
    for (int i = 2; i < count; i++) {
        printf("%s[[%d, %.17g]", comma, brdf->model, brdf->diffuse);
        const bst_vec3 q[3] = {corner[0], corner[i - 1], corner[i]};
        for (int k = 0; k < 3; k++) {
            printf(", %.12g, %.12g, %.12g", q[k].x, q[k].y, q[k].z);
        }
        printf("]");
        comma = ", ";
    }
}

/* Prints a facet. For an image, facets of curved surfaces are divided: with 96 around, their
 * outlines differ from circles by 2e-4 of the radius, and their normals by 2 degrees. */
static void print_facet(const bst_satellite_pose *p, const bst_curved_places *places, int facet,
                        bool finer) {
    enum { FINER = 4 };
    const bst_facet *f = &p->satellite->facets[facet];
    const bst_brdf *brdf = &p->satellite->materials[f->material].brdf;
    bst_vec3 corner[BST_POLYGON_CORNERS_MAX];
    if (!finer || f->curved < 0) {
        int count = bst_plane_facet_corners(p, places, facet, finer ? FINER : 1, corner);
        print_polygon(brdf, corner, count);
        return;
    }
    bst_curved_facet c;
    bst_curved_facet_make(p, places, facet, &c);
    int parts[2] = {FINER, c.curved->sphere ? FINER : 1};
    double scale = bst_curved_facet_scale(&c, parts[0], parts[1]);
    for (int n = 0; n < parts[0] * parts[1]; n++) {
        const int place[2] = {n % parts[0], n / parts[0]};
        bst_curved_facet_part(&c, parts, place, scale, corner);
        if (c.curved->side < 0.0) { /* seen from inside */
            bst_vec3 swap = corner[1];
            corner[1] = corner[3];
            corner[3] = swap;
        }
        print_polygon(brdf, corner, 4);
    }
}

static void print_geometry(bst_satellite_pose *p, const bst_curved_places *places, bst_vec3 sun,
                           bst_vec3 eye, bool image) {
    const bst_satellite *s = p->satellite;
    bst_satellite_light light = {.sun = sun, .observer = eye, .sunlit = 1.0};
    bst_satellite_flux flux;
    bst_satellite_pose_set(p, &(bst_satellite_aim){sun, {0, 0, 1}, eye, 0.0});
    bst_satellite_flux_at(p, &light, &flux);
    printf(
        "{\"sun\": [%.17g, %.17g, %.17g], \"eye\": [%.17g, %.17g, %.17g], \"flux\": %.17g, "
        "\"error\": %.17g, \"triangles\": [",
        sun.x, sun.y, sun.z, eye.x, eye.y, eye.z, flux.sun[BST_SUNLIGHT_V], flux.error);
    print_polygon(NULL, NULL, 0);
    for (int f = 0; f < s->facet_count; f++) {
        const int *c = s->corner + s->facets[f].first;
        const bst_occluder *body = &s->occluders[s->facets[f].occluder];
        /* of two facets in one place only the one that is seen */
        bool thin = body->vertex_count == s->facets[f].count || body->shell >= 0;
        bst_vec3 to_eye =
            image ? bst_vec3_sub(bst_vec3_scale(eye, RANGE * s->radius_m), p->vertices[c[0]]) : eye;
        if (!thin || bst_vec3_dot(p->normals[f], to_eye) > 0.0) {
            print_facet(p, places, f, image);
        }
    }
    printf("]");
    if (image) {
        print_image(p, sun, eye);
    }
    printf("}\n");
}

int main(int argc, char **argv) {
    bool image = argc == 6 && strcmp(argv[5], "image") == 0;
    if (argc != 5 && !image) {
        fprintf(stderr, "usage: print_flux SATELLITE.json GEOMETRIES FIRST TABLE.csv [image]\n");
        return 2;
    }
    bst_ctx ctx = {0};
    bst_brdf_table *table;
    bst_satellite_pose *pose;
    bst_curved_places places;
    if (bst_brdf_table_load(&ctx, argv[4], &table) != BST_OK) {
        give_up(&ctx);
    }
    bst_satellite *s = load(argv[1], strcmp(argv[3], "lambert") == 0 ? -1 : atoi(argv[3]), table);
    if (bst_satellite_pose_create(&ctx, s, &pose) != BST_OK ||
        bst_curved_places_create(&ctx, s, &places) != BST_OK) {
        give_up(&ctx);
    }
    uint64_t random = 31;
    for (int i = 0; i < atoi(argv[2]);) {
        bst_vec3 sun = bst_test_direction(&random), eye = bst_test_direction(&random);
        if (bst_vec3_dot(sun, eye) > -0.3) { /* enough light to compare */
            print_geometry(pose, &places, sun, eye, image);
            i++;
        }
    }
    bst_satellite_pose_free(pose);
    bst_curved_places_free(&places);
    bst_satellite_free(s);
    bst_brdf_table_free(table);
    return 0;
}
