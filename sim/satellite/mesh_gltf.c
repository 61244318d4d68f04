/* glTF 2.0 and GLB: the triangles of a scene. A reader of our own on the strict JSON parser of
 * sim/core, which limits depth, size and numbers: only what a shape needs, every index checked. */
#include <assert.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sim/core/file.h"
#include "sim/core/json_member.h"
#include "sim/satellite/model_build.h"

enum { BUFFERS_MAX = 64, DEPTH_MAX = 32, NODES_MAX = 20000 };
#define GLTF_BYTES_MAX ((uint64_t)256 << 20)
#define GLB_MAGIC 0x46546C67u
#define CHUNK_JSON 0x4E4F534Au
#define CHUNK_BIN 0x004E4942u

/* The bytes of a buffer. */
typedef struct buffer {
    uint8_t *bytes;
    size_t count;
    bool owned;
} buffer;

typedef struct gltf {
    bst_ctx *ctx;
    const char *path;
    const cJSON *root;
    bst_mesh *mesh;
    buffer buffers[BUFFERS_MAX];
    int buffer_count;
    int *material; /* by material of the file: index in the mesh */
    int nodes;     /* visited so far */
} gltf;

/* A run of numbers in a buffer. */
typedef struct accessor {
    const uint8_t *bytes;
    size_t stride;
    int64_t count;
    int type; /* componentType */
} accessor;

static uint32_t word_at(const uint8_t *b) {
    return (uint32_t)b[0] | (uint32_t)b[1] << 8 | (uint32_t)b[2] << 16 | (uint32_t)b[3] << 24;
}

/* Whole number of a member in [0, limit); `missing` if there is none, -1 if it is no such number.
 */
static int64_t whole(const cJSON *node, const char *key, double limit, int64_t missing) {
    const cJSON *item = bst_json_member(node, key);
    if (!item) {
        return missing;
    }
    double v = cJSON_IsNumber(item) ? item->valuedouble : -1.0;
    return v >= 0.0 && v < limit && v == floor(v) ? (int64_t)v : -1;
}

/* Element of an array of the root; NULL: none. */
static const cJSON *element(const gltf *g, const char *list, int64_t index) {
    const cJSON *array = bst_json_member(g->root, list);
    return index >= 0 && cJSON_IsArray(array) ? cJSON_GetArrayItem(array, (int)index) : NULL;
}

static int base64_digit(char c) {
    static const char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    const char *at = c ? strchr(digits, c) : NULL;
    return at ? (int)(at - digits) : -1;
}

/* Decodes base64 text. */
static bst_status decode(const gltf *g, const char *text, buffer *out) {
    size_t n = strlen(text);
    out->bytes = malloc(n / 4 * 3 + 4);
    out->owned = true;
    if (!out->bytes) {
        return bst_fail(g->ctx, BST_ERR_MEMORY, "no memory for a buffer");
    }
    uint32_t bits = 0;
    int have = 0;
    for (; *text && *text != '='; text++) {
        int digit = base64_digit(*text);
        if (digit < 0) {
            return bst_fail(g->ctx, BST_ERR_FORMAT, "a data URI that is not base64");
        }
        bits = bits << 6 | (uint32_t)digit;
        have += 6;
        if (have >= 8) {
            have -= 8;
            out->bytes[out->count++] = (uint8_t)(bits >> have);
        }
    }
    return BST_OK;
}

/* Reads one buffer: of the GLB, a data URI, or a file in the same folder. */
static bst_status read_buffer(gltf *g, const cJSON *node, const buffer *bin, buffer *out) {
    const char *uri = bst_json_member_text(node, "uri", NULL);
    if (!uri) {
        *out = (buffer){bin->bytes, bin->count, false};
        return bin->bytes
                   ? BST_OK
                   : bst_fail(g->ctx, BST_ERR_FORMAT, "no uri, and the file has no binary chunk");
    }
    if (strncmp(uri, "data:", 5) == 0) {
        const char *comma = strstr(uri, ";base64,");
        return comma ? decode(g, comma + 8, out)
                     : bst_fail(g->ctx, BST_ERR_FORMAT, "a data URI without \";base64,\"");
    }
    if (strchr(uri, '/') || strchr(uri, '\\') || strchr(uri, ':') || *uri == '.') {
        return bst_fail(g->ctx, BST_ERR_FORMAT,
                        "uri \"%.60s\" (allowed: a data URI, or a file in the same folder)", uri);
    }
    char path[1400];
    const char *slash = strrchr(g->path, '/');
    int folder = slash ? (int)(slash - g->path) + 1 : 0;
    snprintf(path, sizeof path, "%.*s%s", folder, g->path, uri);
    out->owned = true;
    return bst_file_read(g->ctx, path, GLTF_BYTES_MAX, "a buffer of a glTF file",
                         (char **)&out->bytes, &out->count);
}

static bst_status read_buffers(gltf *g, const buffer *bin) {
    const cJSON *list = bst_json_member(g->root, "buffers"), *node;
    if (!list) {
        return BST_OK;
    }
    cJSON_ArrayForEach(node, list) {
        if (g->buffer_count == BUFFERS_MAX) {
            return bst_fail(g->ctx, BST_ERR_FORMAT, "/buffers: more than %d (allowed: %d)",
                            BUFFERS_MAX, BUFFERS_MAX);
        }
        buffer *b = &g->buffers[g->buffer_count++];
        bst_status status = read_buffer(g, node, bin, b);
        if (status != BST_OK) {
            return bst_fail_prefix(g->ctx, status, "/buffers/%d", g->buffer_count - 1);
        }
    }
    return BST_OK;
}

/* Bytes of one component; 0: a type that no shape has. */
static size_t component_bytes(int type) {
    return type == 5126 || type == 5125 ? 4 : type == 5123 ? 2 : type == 5121 ? 1 : 0;
}

/* Finds the numbers of an accessor with `parts` components, all within its buffer. */
static bst_status find_accessor(const gltf *g, int64_t index, const char *shape, int parts,
                                accessor *out) {
    const cJSON *a = element(g, "accessors", index);
    int64_t view_index = whole(a, "bufferView", 1e6, -1);
    const cJSON *view = element(g, "bufferViews", view_index);
    int64_t which = whole(view, "buffer", BUFFERS_MAX, -1);
    int64_t start = whole(a, "byteOffset", 1e9, 0), length = whole(view, "byteLength", 1e9, -1);
    int64_t view_start = whole(view, "byteOffset", 1e9, 0);
    int64_t stride = whole(view, "byteStride", 256, 0);
    *out = (accessor){.count = whole(a, "count", 1e8, -1),
                      .type = (int)whole(a, "componentType", 1e4, -1)};
    size_t size = component_bytes(out->type) * (size_t)parts;
    const char *type = bst_json_member_text(a, "type", "");
    if (!a || !view || which < 0 || which >= g->buffer_count || start < 0 || length < 0 ||
        view_start < 0 || stride < 0 || out->count < 0 || size == 0 || strcmp(type, shape) != 0 ||
        bst_json_member(a, "sparse")) {
        return bst_fail(g->ctx, BST_ERR_FORMAT,
                        "/accessors/%lld: type \"%.20s\", component type %d (allowed: %s without "
                        "sparse values, with existing bufferView and buffer)",
                        (long long)index, type, out->type, shape);
    }
    out->stride = stride > 0 ? (size_t)stride : size;
    const buffer *b = &g->buffers[which];
    size_t end = out->count > 0 ? (size_t)(out->count - 1) * out->stride + size : 0;
    if ((size_t)start + end > (size_t)length || (size_t)(view_start + length) > b->count) {
        return bst_fail(g->ctx, BST_ERR_FORMAT,
                        "/accessors/%lld: its %lld elements end beyond their bufferView or buffer",
                        (long long)index, (long long)out->count);
    }
    out->bytes = b->bytes + view_start + start;
    return BST_OK;
}

static float float_at(const uint8_t *b) {
    uint32_t word = word_at(b);
    float f;
    memcpy(&f, &word, sizeof f);
    return f;
}

static int64_t index_at(const accessor *a, int64_t i) {
    const uint8_t *b = a->bytes + (size_t)i * a->stride;
    return a->type == 5125 ? (int64_t)word_at(b) : a->type == 5123 ? b[0] | b[1] << 8 : b[0];
}

/* A rotation with scale, and a shift: parent from child. */
typedef struct transform {
    bst_mat3 m;
    bst_vec3 shift;
} transform;

/* Numbers of an array member; false if it is there and not `count` finite numbers. */
static bool numbers(const cJSON *node, const char *key, int count, double *out) {
    const cJSON *array = bst_json_member(node, key), *item;
    int n = 0;
    if (!array) {
        return true;
    }
    cJSON_ArrayForEach(item, array) {
        if (n == count || !cJSON_IsNumber(item) || !(fabs(item->valuedouble) <= 1e7)) {
            return false;
        }
        out[n++] = item->valuedouble;
    }
    return n == count;
}

static bst_status node_transform(const gltf *g, const cJSON *node, int64_t index, transform *out) {
    double m[16], t[3] = {0}, r[4] = {0, 0, 0, 1}, s[3] = {1, 1, 1};
    bool given = bst_json_member(node, "matrix") != NULL;
    if (!numbers(node, "matrix", 16, m) || !numbers(node, "translation", 3, t) ||
        !numbers(node, "rotation", 4, r) || !numbers(node, "scale", 3, s)) {
        return bst_fail(g->ctx, BST_ERR_FORMAT,
                        "/nodes/%lld: its transform is not finite (allowed: 16 numbers in matrix, "
                        "or 3 in translation, 4 in rotation, 3 in scale)",
                        (long long)index);
    }
    if (given) { /* by columns */
        for (int i = 0; i < 3; i++) {
            for (int k = 0; k < 3; k++) {
                out->m.m[i][k] = m[4 * k + i];
            }
        }
        out->shift = (bst_vec3){m[12], m[13], m[14]};
        return BST_OK;
    }
    out->m = bst_quat_to_mat3(bst_quat_unit((bst_quat){r[0], r[1], r[2], r[3]}));
    for (int i = 0; i < 3; i++) {
        for (int k = 0; k < 3; k++) {
            out->m.m[i][k] *= s[k];
        }
    }
    out->shift = bst_vec3_from_array(t);
    return BST_OK;
}

static double determinant(const bst_mat3 *a) {
    bst_vec3 x = {a->m[0][0], a->m[1][0], a->m[2][0]}, y = {a->m[0][1], a->m[1][1], a->m[2][1]};
    return bst_vec3_dot(bst_vec3_cross(x, y), (bst_vec3){a->m[0][2], a->m[1][2], a->m[2][2]});
}

/* Adds the triangles of a primitive: lists, strips and fans. */
static bst_status add_triangles(gltf *g, const accessor *indices, int64_t count, int64_t base,
                                int mode, bool mirrored, int material) {
    int64_t triangles = mode == 4 ? count / 3 : count - 2;
    for (int64_t i = 0; i < triangles; i++) {
        int64_t v[3];
        for (int k = 0; k < 3; k++) {
            int64_t at = mode == 4 ? 3 * i + k : mode == 5 ? i + k : k == 0 ? 0 : i + k;
            v[k] = base + (indices ? index_at(indices, at) : at);
        }
        if (mirrored != (mode == 5 && i % 2 == 1)) {
            int64_t swap = v[1];
            v[1] = v[2];
            v[2] = swap;
        }
        BST_TRY(bst_mesh_add_triangle(g->ctx, g->mesh, v, material));
    }
    return BST_OK;
}

static bst_status add_primitive(gltf *g, const cJSON *primitive, const transform *place) {
    int64_t mode = whole(primitive, "mode", 7, 4);
    if (mode < 4) {
        return bst_fail(g->ctx, BST_ERR_FORMAT, "mode %lld (allowed: triangles, 4, 5 or 6)",
                        (long long)mode);
    }
    accessor positions, indices;
    const cJSON *attributes = bst_json_member(primitive, "attributes");
    BST_TRY(find_accessor(g, whole(attributes, "POSITION", 1e6, -1), "VEC3", 3, &positions));
    if (positions.type != 5126) {
        return bst_fail(g->ctx, BST_ERR_FORMAT, "positions of component type %d (allowed: 5126)",
                        positions.type);
    }
    int64_t base = g->mesh->vertex_count, count = positions.count;
    for (int64_t i = 0; i < positions.count; i++) {
        const uint8_t *b = positions.bytes + (size_t)i * positions.stride;
        bst_vec3 v = {(double)float_at(b), (double)float_at(b + 4), (double)float_at(b + 8)};
        v = bst_vec3_add(bst_mat3_mul_vec(&place->m, v), place->shift);
        BST_TRY(bst_mesh_add_vertex(g->ctx, g->mesh, v));
    }
    bool indexed = bst_json_member(primitive, "indices") != NULL;
    if (indexed) {
        BST_TRY(find_accessor(g, whole(primitive, "indices", 1e6, -1), "SCALAR", 1, &indices));
        if (indices.type == 5126) {
            return bst_fail(g->ctx, BST_ERR_FORMAT, "indices of floating point");
        }
        count = indices.count;
    }
    int64_t material = whole(primitive, "material", 1e6, -1);
    bool known = element(g, "materials", material) != NULL;
    return add_triangles(g, indexed ? &indices : NULL, count, base, (int)mode,
                         determinant(&place->m) < 0.0, known ? g->material[material] : -1);
}

static bst_status add_node_mesh(gltf *g, const cJSON *node, int64_t index, const transform *place) {
    int64_t which = whole(node, "mesh", 1e6, -1);
    const cJSON *mesh = element(g, "meshes", which), *primitive;
    if (!bst_json_member(node, "mesh")) {
        return BST_OK;
    }
    if (!mesh) {
        return bst_fail(g->ctx, BST_ERR_FORMAT, "/nodes/%lld/mesh: there is no such mesh",
                        (long long)index);
    }
    int n = 0;
    cJSON_ArrayForEach(primitive, bst_json_member(mesh, "primitives")) {
        bst_status status = add_primitive(g, primitive, place);
        if (status != BST_OK) {
            return bst_fail_prefix(g->ctx, status, "/meshes/%lld/primitives/%d", (long long)which,
                                   n);
        }
        n++;
    }
    return BST_OK;
}

/* Adds a node with its children. */
static bst_status add_node(gltf *g, int64_t index, const transform *parent, int depth) {
    const cJSON *node = element(g, "nodes", index), *child;
    if (!node || depth > DEPTH_MAX || ++g->nodes > NODES_MAX) {
        return bst_fail(g->ctx, BST_ERR_FORMAT,
                        "/nodes/%lld: there is no such node, or the nodes form a circle (allowed: "
                        "at most %d levels and %d nodes)",
                        (long long)index, DEPTH_MAX, NODES_MAX);
    }
    transform own = {0}, place;
    BST_TRY(node_transform(g, node, index, &own));
    place.m = bst_mat3_mul(&parent->m, &own.m);
    place.shift = bst_vec3_add(bst_mat3_mul_vec(&parent->m, own.shift), parent->shift);
    BST_TRY(add_node_mesh(g, node, index, &place));
    cJSON_ArrayForEach(child, bst_json_member(node, "children")) {
        double v = cJSON_IsNumber(child) ? child->valuedouble : -1.0;
        BST_TRY(add_node(g, v >= 0.0 && v < 1e6 ? (int64_t)v : -1, &place, depth + 1));
    }
    return BST_OK;
}

/* Material of the metallic-roughness model: a metal reflects by its colour, others by 4 %. */
static bst_material material_of(const cJSON *node, int index) {
    const cJSON *pbr = bst_json_member(node, "pbrMetallicRoughness");
    double colour[4] = {1, 1, 1, 1}, metallic = bst_json_member_number(pbr, "metallicFactor");
    double rough = bst_json_member_number(pbr, "roughnessFactor");
    bool good = numbers(pbr, "baseColorFactor", 4, colour);
    metallic = isfinite(metallic) ? fmin(fmax(metallic, 0.0), 1.0) : 1.0;
    rough = isfinite(rough) ? fmin(fmax(rough, 0.04), 1.0) : 1.0;
    for (int k = 0; k < 3; k++) {
        colour[k] = good ? fmin(fmax(colour[k], 0.0), 1.0) : 0.5;
    }
    double green = fmax(colour[1], 1e-3);
    bst_material m = {.brdf = {.model = BST_BRDF_COOK_TORRANCE,
                               .specular = 0.04 * (1.0 - metallic) + 0.95 * metallic * green,
                               .diffuse = (1.0 - metallic) * fmin(green, 0.95),
                               .roughness = rough * rough},
                      .scale = 1.0,
                      .colour = {colour[2] / green, 1.0, colour[0] / green, colour[0] / green},
                      .emissivity = 0.8 - 0.7 * metallic};
    snprintf(m.name, sizeof m.name, "%.40s", bst_json_member_text(node, "name", ""));
    if (!*m.name) {
        snprintf(m.name, sizeof m.name, "material %d", index);
    }
    return m;
}

static bst_status add_scene(gltf *g) {
    const transform identity = {{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}}, {0, 0, 0}};
    const cJSON *scene = element(g, "scenes", whole(g->root, "scene", 1e6, 0)), *item;
    if (!scene) {
        return bst_fail(g->ctx, BST_ERR_FORMAT, "/scenes: the file has no scene");
    }
    const cJSON *materials = bst_json_member(g->root, "materials");
    int count = cJSON_GetArraySize(materials), k = 0;
    g->material = calloc((size_t)count + 1, sizeof *g->material);
    if (!g->material) {
        return bst_fail(g->ctx, BST_ERR_MEMORY, "no memory for materials");
    }
    cJSON_ArrayForEach(item, materials) {
        bst_material m = material_of(item, k);
        BST_TRY(bst_mesh_add_material(g->ctx, g->mesh, &m, &g->material[k++]));
    }
    cJSON_ArrayForEach(item, bst_json_member(scene, "nodes")) {
        double v = cJSON_IsNumber(item) ? item->valuedouble : -1.0;
        BST_TRY(add_node(g, v >= 0.0 && v < 1e6 ? (int64_t)v : -1, &identity, 0));
    }
    return g->mesh->triangle_count > 0
               ? BST_OK
               : bst_fail(g->ctx, BST_ERR_FORMAT, "the scene has no triangles");
}

/* Splits a GLB file into its JSON text and its binary chunk. */
static bst_status split_glb(bst_ctx *ctx, const char *path, buffer *file, buffer *json,
                            buffer *bin) {
    const uint8_t *b = file->bytes;
    size_t n = file->count, at = 12;
    *json = *file;
    if (n < 12 || word_at(b) != GLB_MAGIC) {
        return BST_OK; /* text */
    }
    json->bytes = NULL;
    while (at + 8 <= n) {
        size_t length = word_at(b + at);
        uint32_t type = word_at(b + at + 4);
        if (length > n - at - 8) {
            return bst_fail(ctx, BST_ERR_FORMAT,
                            "%.400s: the chunk at byte %zu ends beyond the file", path, at);
        }
        buffer *to = type == CHUNK_JSON ? json : type == CHUNK_BIN ? bin : NULL;
        if (to && !to->bytes) {
            *to = (buffer){file->bytes + at + 8, length, false};
        }
        at += 8 + length;
    }
    return json->bytes
               ? BST_OK
               : bst_fail(ctx, BST_ERR_FORMAT, "%.400s: no JSON chunk (allowed: GLB 2)", path);
}

bst_status bst_mesh_load_gltf(bst_ctx *ctx, const char *path, bst_mesh *mesh) {
    buffer file = {0}, json = {0}, bin = {0};
    bst_json *parsed = NULL;
    BST_TRY(bst_file_read(ctx, path, GLTF_BYTES_MAX, "a glTF or GLB file", (char **)&file.bytes,
                          &file.count));
    bst_status status = split_glb(ctx, path, &file, &json, &bin);
    if (status == BST_OK) {
        status = bst_json_parse(ctx, path, (const char *)json.bytes, json.count, &parsed);
    }
    if (status == BST_OK) {
        gltf g = {.ctx = ctx, .path = path, .root = bst_json_root(parsed), .mesh = mesh};
        status = read_buffers(&g, &bin);
        if (status == BST_OK) {
            status = add_scene(&g);
        }
        if (status != BST_OK) {
            status = bst_fail_prefix(ctx, status, "%.400s", path);
        }
        for (int i = 0; i < g.buffer_count; i++) {
            if (g.buffers[i].owned) {
                free(g.buffers[i].bytes);
            }
        }
        free(g.material);
    }
    bst_json_free(parsed);
    free(file.bytes);
    return status;
}
