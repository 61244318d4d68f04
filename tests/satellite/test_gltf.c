/* Meshes of glTF files that the test writes: a tetrahedron of unequal sides with all types of
 * indices, as a list, a strip and a fan, with strides and offsets, under a chain of transforms that
 * turns, scales, shears and mirrors, against corners and a volume that follow from the transforms
 * by hand. */
#include <unistd.h>

#include "sim/satellite/model_build.h"
#include "tests/test_support.h"

enum { UNUSED = 300, STRIDE = 20, BYTES = (UNUSED + 4) * STRIDE };

static const float corners[4][3] = {{0, 0, 0}, {3, 0, 0.5f}, {0.5f, 2, 0}, {0.25f, 0.5f, 1}};
static const bst_vec3 turn_axis = {1.0 / 3.0, 2.0 / 3.0, -2.0 / 3.0};
static double turn;
static const double inner[3][3] = {{1, 0.5, 0}, {0, 2, 0.25}, {0.125, 0, 3}};
static const bst_vec3 inner_shift = {4, -5, 6}, outer_shift = {-0.5, 0.25, 8};

/* Rodrigues' formula. */
static bst_vec3 turned(bst_vec3 v) {
    bst_vec3 along = bst_vec3_scale(turn_axis, (1 - cos(turn)) * bst_vec3_dot(turn_axis, v));
    return bst_vec3_add(
        bst_vec3_axpy(bst_vec3_scale(v, cos(turn)), sin(turn), bst_vec3_cross(turn_axis, v)),
        along);
}

static bst_vec3 placed(int corner, bst_vec3 scale) {
    const float *p = corners[corner];
    double v[3];
    for (int i = 0; i < 3; i++) {
        v[i] = inner[i][0] * (double)p[0] + inner[i][1] * (double)p[1] + inner[i][2] * (double)p[2];
    }
    bst_vec3 out = bst_vec3_add((bst_vec3){v[0], v[1], v[2]}, inner_shift);
    out = (bst_vec3){scale.x * out.x, scale.y * out.y, scale.z * out.z};
    return bst_vec3_add(turned(out), outer_shift);
}

static void put_index(uint8_t *to, int type, int at, int value) {
    int bytes = type == 5125 ? 4 : type == 5123 ? 2 : 1;
    for (int k = 0; k < bytes; k++) {
        to[bytes * at + k] = (uint8_t)(value >> 8 * k);
    }
}

/* Writes and reads the tetrahedron: indices of a type from vertex `first` on, mode 4, 5 or 6. */
static void check(int type, int mode, bst_vec3 scale) {
    static const int list[] = {0, 2, 1, 0, 1, 3, 1, 2, 3, 0, 3, 2}, strip[] = {0, 2, 1, 3, 0, 2},
                     fan[] = {0, 2, 1, 3, 2}, lid[] = {1, 2, 3};
    const int *indices = mode == 4 ? list : mode == 5 ? strip : fan;
    int count = mode == 4 ? 12 : mode == 5 ? 6 : 5, first = type == 5121 ? 0 : UNUSED;
    static uint8_t bytes[BYTES + 64];
    memset(bytes, 0, sizeof bytes);
    for (int i = 0; i < 4; i++) {
        memcpy(bytes + 8 + (UNUSED + i) * STRIDE, corners[i], sizeof corners[i]);
    }
    for (int i = 0; i < count + 3; i++) {
        put_index(bytes + BYTES, type, i, first + (i < count ? indices[i] : lid[i - count]));
    }
    char folder[BST_TEST_PATH], path[BST_TEST_PATH + 16], bin[BST_TEST_PATH + 16];
    bst_test_template(folder, "gltf");
    assert_non_null(mkdtemp(folder));
    snprintf(path, sizeof path, "%s/shape.gltf", folder);
    snprintf(bin, sizeof bin, "%s/shape.bin", folder);
    FILE *f = fopen(bin, "wb");
    assert_non_null(f);
    assert_int_equal(fwrite(bytes, 1, sizeof bytes, f), sizeof bytes);
    fclose(f);
    int bytes_each = type == 5125 ? 4 : type == 5123 ? 2 : 1;
    f = fopen(path, "w");
    assert_non_null(f);
    double s = sin(0.5 * turn);
    fprintf(f,
            "{\"scene\": 1, \"scenes\": [{\"nodes\": []}, {\"nodes\": [1]}], \"nodes\": "
            "[{\"mesh\": 0, \"matrix\": "
            "[%g, %g, %g, 0, %g, %g, %g, 0, %g, %g, %g, 0, %g, %g, %g, 1]}, {\"children\": [0], "
            "\"scale\": [%g, %g, %g], "
            "\"rotation\": [%.17g, %.17g, %.17g, %.17g], \"translation\": [%g, %g, %g]}],\n",
            inner[0][0], inner[1][0], inner[2][0], inner[0][1], inner[1][1], inner[2][1],
            inner[0][2], inner[1][2], inner[2][2], inner_shift.x, inner_shift.y, inner_shift.z,
            scale.x, scale.y, scale.z, s * turn_axis.x, s * turn_axis.y, s * turn_axis.z,
            cos(0.5 * turn), outer_shift.x, outer_shift.y, outer_shift.z);
    fprintf(
        f,
        "\"meshes\": [{\"primitives\": [{\"attributes\": {\"POSITION\": 0}, \"indices\": 1, "
        "\"mode\": %d, \"material\": 1}%s]}], "
        "\"materials\": [{}, {\"name\": \"gilt\", \"pbrMetallicRoughness\": {\"baseColorFactor\": "
        "[0.8, 0.5, 0.2, 1], "
        "\"metallicFactor\": 0.25, \"roughnessFactor\": 0.6}}], "
        "\"buffers\": [{\"byteLength\": %zu, \"uri\": \"shape.bin\"}], \"bufferViews\": "
        "[{\"buffer\": 0, "
        "\"byteLength\": %d, \"byteOffset\": 4, \"byteStride\": %d}, {\"buffer\": 0, "
        "\"byteOffset\": %d, "
        "\"byteLength\": 64}], \"accessors\": [{\"bufferView\": 0, \"componentType\": 5126, "
        "\"count\": %d, "
        "\"byteOffset\": %d, \"type\": \"VEC3\"}, {\"bufferView\": 1, \"componentType\": %d, "
        "\"count\": %d, \"type\": "
        "\"SCALAR\"}, {\"bufferView\": 1, \"byteOffset\": %d, \"componentType\": %d, \"count\": 3, "
        "\"type\": \"SCALAR\"}]}",
        mode,
        mode == 6 ? ", {\"attributes\": {\"POSITION\": 0}, \"indices\": 2, \"material\": 1}" : "",
        sizeof bytes, BYTES - 4, STRIDE, BYTES, UNUSED + 4 - (UNUSED - first),
        4 + (UNUSED - first) * STRIDE, type, count, count * bytes_each, type);
    fclose(f);
    bst_ctx ctx = {0};
    bst_mesh mesh = {0};
    bst_assert_ok(&ctx, bst_mesh_load_gltf(&ctx, path, &mesh));
    assert_int_equal(mesh.triangle_count, 4);
    double volume = 0.0;
    bst_vec3 area = {0, 0, 0};
    for (int t = 0; t < mesh.triangle_count; t++) {
        bst_vec3 p[3];
        for (int k = 0; k < 3; k++) {
            int at = mesh.triangles[t][k],
                own = (at - (mode == 6 && t == 3 ? mesh.vertex_count / 2 : 0)) - first;
            assert_in_range(own, 0, 3);
            p[k] = bst_vec3_sub(mesh.vertices[at], placed(own, scale));
            bst_assert_close(bst_vec3_norm(p[k]), 0.0, 1e-12); /* the corners are floats */
            p[k] = bst_vec3_sub(mesh.vertices[at], placed(0, scale));
        }
        assert_int_equal(mesh.triangle_material[t], 1);
        bst_vec3 normal = bst_vec3_cross(bst_vec3_sub(p[1], p[0]), bst_vec3_sub(p[2], p[0]));
        area = bst_vec3_add(area, normal);
        volume += bst_vec3_dot(p[0], normal) / 6.0;
    }
    /* a closed surface with its normals outward */
    bst_assert_close(bst_vec3_norm(area), 0.0, 1e-11);
    double det = 1 * (2 * 3 - 0.25 * 0) - 0.5 * (0 * 3 - 0.25 * 0.125);
    double own = (3 * (2 * 1 - 0 * 0.5) + 0.5 * (0.5 * 0.5 - 2 * 0.25)) / 6.0;
    bst_assert_close(volume, own * det * fabs(scale.x * scale.y * scale.z), 1e-11);
    /* a quarter of metal; a file without values is a rough, white metal */
    assert_int_equal(mesh.material_count, 2);
    const bst_material *gilt = &mesh.materials[1], *plain = &mesh.materials[0];
    assert_string_equal(gilt->name, "gilt");
    assert_string_equal(plain->name, "material 0");
    bst_assert_close(gilt->brdf.specular, 0.75 * 0.04 + 0.25 * 0.95 * 0.5, 1e-12);
    bst_assert_close(gilt->brdf.diffuse, 0.75 * 0.5, 1e-12);
    bst_assert_close(gilt->brdf.roughness, 0.36, 1e-12);
    bst_assert_close(gilt->colour[0], 0.2 / 0.5, 1e-12);
    bst_assert_close(gilt->colour[1], 1.0, 0.0);
    bst_assert_close(gilt->colour[2], 0.8 / 0.5, 1e-12);
    bst_assert_close(gilt->emissivity, 0.8 - 0.7 * 0.25, 1e-12);
    bst_assert_close(plain->brdf.specular, 0.95, 1e-12);
    bst_assert_close(plain->brdf.diffuse, 0.0, 0.0);
    bst_assert_close(plain->brdf.roughness, 1.0, 0.0);
    bst_mesh_free(&mesh);
    remove(path);
    remove(bin);
    rmdir(folder);
}

static void shapes_follow_from_indices_and_transforms(void **state) {
    (void)state;
    static const int types[] = {5121, 5123, 5125};
    for (int i = 0; i < 3; i++) {
        for (int mode = 4; mode <= 6; mode++) {
            for (int signs = 0; signs < 8; signs++) { /* half of them are mirrors */
                turn = (50.0 + 37.0 * signs + 11.0 * mode) * BST_DEG_RAD;
                check(types[i], mode,
                      (bst_vec3){signs & 1 ? -0.5 : 0.5, signs & 2 ? -2.0 : 2.0,
                                 signs & 4 ? -1.5 : 1.5});
            }
        }
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(shapes_follow_from_indices_and_transforms)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
