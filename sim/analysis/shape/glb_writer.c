/* Writes a model as GLB. */
#include <cjson/cJSON.h>
#include <stdlib.h>
#include <string.h>

#include "sim/analysis/shape/turntable.h"
#include "sim/io/draft_file.h"
#include "sim/satellite/pose.h"

/* The vertices of all triangles, sorted by material. */
typedef struct triangles {
    float (*vertices)[3];
    int first[BST_SATELLITE_MATERIALS_MAX + 1]; /* vertex, by material */
} triangles;

/* y up: (x, y, z) of the body is (x, z, -y) in the file. */
static void put_vertex(float out[3], bst_vec3 v) {
    out[0] = (float)v.x;
    out[1] = (float)v.z;
    out[2] = (float)-v.y;
}

static bst_status collect(bst_ctx *ctx, const bst_satellite_pose *p, triangles *out) {
    const bst_satellite *s = p->satellite;
    int count = 0;
    for (int f = 0; f < s->facet_count; f++) {
        count += 3 * (s->facets[f].count - 2);
    }
    out->vertices = malloc((size_t)count * sizeof *out->vertices);
    if (!out->vertices) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for %d vertices", count);
    }
    int n = 0;
    for (int m = 0; m < s->material_count; m++) {
        out->first[m] = n;
        for (int f = 0; f < s->facet_count; f++) {
            const int *c = s->corner + s->facets[f].first;
            for (int i = 2; i < s->facets[f].count && s->facets[f].material == m; i++) {
                put_vertex(out->vertices[n++], p->vertices[c[0]]);
                put_vertex(out->vertices[n++], p->vertices[c[i - 1]]);
                put_vertex(out->vertices[n++], p->vertices[c[i]]);
            }
        }
    }
    out->first[s->material_count] = n;
    return BST_OK;
}

void bst_turntable_colour(const bst_material *m, double rgb[3]) {
    double seen = m->brdf.diffuse + m->brdf.specular + m->brdf.volume;
    double level = m->scale * (seen > 0.0 ? seen : bst_brdf_reflectance(&m->brdf, 0.7));
    for (int k = 0; k < 3; k++) {
        rgb[k] = fmin(level * m->colour[2 - k], 1.0);
    }
}

/* Appends a material. */
static void put_material(cJSON *list, const bst_material *m) {
    double rgb[3];
    bst_turntable_colour(m, rgb);
    cJSON *item = cJSON_CreateObject(),
          *pbr = cJSON_AddObjectToObject(item, "pbrMetallicRoughness");
    cJSON *colour = cJSON_AddArrayToObject(pbr, "baseColorFactor");
    for (int k = 0; k < 3; k++) {
        cJSON_AddItemToArray(colour, cJSON_CreateNumber(rgb[k]));
    }
    cJSON_AddItemToArray(colour, cJSON_CreateNumber(1.0));
    cJSON_AddNumberToObject(pbr, "metallicFactor", m->brdf.specular > 0.3 ? 1.0 : 0.0);
    double lobe = fmin(bst_brdf_lobe_rad(&m->brdf), 1.0);
    cJSON_AddNumberToObject(pbr, "roughnessFactor", sqrt(lobe));
    cJSON_AddStringToObject(item, "name", m->name);
    cJSON_AddItemToArray(list, item);
}

static void put_bounds(cJSON *accessor, const char *key, const double v[3]) {
    cJSON *array = cJSON_AddArrayToObject(accessor, key);
    for (int k = 0; k < 3; k++) {
        cJSON_AddItemToArray(array, cJSON_CreateNumber(v[k]));
    }
}

/* Appends the primitive, accessor and view of one material's triangles. */
static void put_primitive(cJSON *root, cJSON *primitives, const triangles *t, int material) {
    int first = t->first[material], count = t->first[material + 1] - first;
    double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
    for (int i = first; i < first + count; i++) {
        for (int k = 0; k < 3; k++) {
            low[k] = fmin(low[k], (double)t->vertices[i][k]);
            high[k] = fmax(high[k], (double)t->vertices[i][k]);
        }
    }
    cJSON *views = cJSON_GetObjectItem(root, "bufferViews"), *view = cJSON_CreateObject();
    cJSON *accessors = cJSON_GetObjectItem(root, "accessors"), *accessor = cJSON_CreateObject();
    int index = cJSON_GetArraySize(accessors);
    cJSON_AddNumberToObject(view, "buffer", 0);
    cJSON_AddNumberToObject(view, "byteOffset", 12.0 * first);
    cJSON_AddNumberToObject(view, "byteLength", 12.0 * count);
    cJSON_AddItemToArray(views, view);
    cJSON_AddNumberToObject(accessor, "bufferView", index);
    cJSON_AddNumberToObject(accessor, "componentType", 5126);
    cJSON_AddNumberToObject(accessor, "count", count);
    cJSON_AddStringToObject(accessor, "type", "VEC3");
    put_bounds(accessor, "min", low);
    put_bounds(accessor, "max", high);
    cJSON_AddItemToArray(accessors, accessor);
    cJSON *primitive = cJSON_CreateObject();
    cJSON_AddNumberToObject(cJSON_AddObjectToObject(primitive, "attributes"), "POSITION", index);
    cJSON_AddNumberToObject(primitive, "material", material);
    cJSON_AddItemToArray(primitives, primitive);
}

/* The JSON chunk; NULL: out of memory. */
static char *make_json(const bst_satellite *s, const triangles *t) {
    cJSON *root = cJSON_CreateObject();
    cJSON_AddStringToObject(cJSON_AddObjectToObject(root, "asset"), "version", "2.0");
    cJSON_AddNumberToObject(root, "scene", 0);
    cJSON *scene = cJSON_CreateObject(), *node = cJSON_CreateObject(), *mesh = cJSON_CreateObject();
    cJSON_AddItemToArray(cJSON_AddArrayToObject(scene, "nodes"), cJSON_CreateNumber(0));
    cJSON_AddItemToArray(cJSON_AddArrayToObject(root, "scenes"), scene);
    cJSON_AddNumberToObject(node, "mesh", 0);
    cJSON_AddItemToArray(cJSON_AddArrayToObject(root, "nodes"), node);
    cJSON *primitives = cJSON_AddArrayToObject(mesh, "primitives");
    cJSON_AddItemToArray(cJSON_AddArrayToObject(root, "meshes"), mesh);
    cJSON *materials = cJSON_AddArrayToObject(root, "materials");
    cJSON_AddArrayToObject(root, "bufferViews");
    cJSON_AddArrayToObject(root, "accessors");
    for (int m = 0; m < s->material_count; m++) {
        put_material(materials, &s->materials[m]);
        if (t->first[m + 1] > t->first[m]) {
            put_primitive(root, primitives, t, m);
        }
    }
    cJSON *buffer = cJSON_CreateObject();
    cJSON_AddNumberToObject(buffer, "byteLength", 12.0 * t->first[s->material_count]);
    cJSON_AddItemToArray(cJSON_AddArrayToObject(root, "buffers"), buffer);
    char *text = cJSON_PrintUnformatted(root);
    cJSON_Delete(root);
    return text;
}

static void put_word(FILE *f, uint32_t word) {
    const uint8_t bytes[4] = {(uint8_t)word, (uint8_t)(word >> 8), (uint8_t)(word >> 16),
                              (uint8_t)(word >> 24)};
    fwrite(bytes, 1, 4, f);
}

/* Header, JSON chunk and binary chunk; floats are little-endian on all supported machines. */
static void write_chunks(FILE *f, const char *json, const triangles *t, int vertices) {
    uint32_t text = (uint32_t)strlen(json), padded = (text + 3u) & ~3u;
    uint32_t binary = 12u * (uint32_t)vertices;
    put_word(f, 0x46546C67u);
    put_word(f, 2u);
    put_word(f, 12u + 8u + padded + 8u + binary);
    put_word(f, padded);
    put_word(f, 0x4E4F534Au);
    fwrite(json, 1, text, f);
    for (uint32_t i = text; i < padded; i++) {
        fputc(' ', f);
    }
    put_word(f, binary);
    put_word(f, 0x004E4942u);
    fwrite(t->vertices, 12, (size_t)vertices, f);
}

bst_status bst_turntable_write_glb(bst_ctx *ctx, const bst_satellite *satellite, const char *path) {
    bst_satellite_pose *pose;
    triangles t = {0};
    BST_TRY(bst_satellite_pose_create(ctx, satellite, &pose));
    bst_satellite_pose_set(pose, &(bst_satellite_aim){{1, 0, 0}, {0, 0, 1}, {0, 1, 0}, 0.0});
    bst_status status = collect(ctx, pose, &t);
    char *json = status == BST_OK ? make_json(satellite, &t) : NULL;
    if (status == BST_OK && !json) {
        status = bst_fail(ctx, BST_ERR_MEMORY, "no memory for a GLB file");
    }
    bst_draft draft;
    if (status == BST_OK) {
        status = bst_draft_open(ctx, path, &draft);
    }
    if (status == BST_OK) {
        write_chunks(draft.stream, json, &t, t.first[satellite->material_count]);
        status = bst_draft_close(ctx, &draft, BST_OK);
    }
    cJSON_free(json);
    free(t.vertices);
    bst_satellite_pose_free(pose);
    return status;
}
