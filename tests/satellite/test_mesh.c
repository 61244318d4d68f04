/* Meshes from files: OBJ and glTF give the light of the same boxes; damaged ones are refused. */
#include <unistd.h>

#include "tests/satellite/satellite_support.h"

static void write_file(const char *suffix, const char *text, char path[BST_TEST_PATH]) {
    bst_test_template(path, "mesh");
    int fd = mkstemp(path); /* the name is ours: with the suffix, too */
    assert_true(fd >= 0);
    close(fd);
    remove(path);
    strcat(path, suffix);
    FILE *f = fopen(path, "w");
    assert_non_null(f);
    fputs(text, f);
    fclose(f);
}

/* The corners and faces of an axis-parallel box as OBJ, its vertices after `first` others. */
static void put_box(char *text, int first, bst_vec3 low, bst_vec3 high) {
    static const int faces[6][4] = {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4},
                                    {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}};
    for (int i = 0; i < 8; i++) {
        sprintf(text + strlen(text), "v %g %g %g\n", i & 1 ? high.x : low.x, i & 2 ? high.y : low.y,
                i & 4 ? high.z : low.z);
    }
    for (int f = 0; f < 6; f++) {
        sprintf(text + strlen(text), "f %d %d %d %d\n", first + faces[f][0] + 1,
                first + faces[f][1] + 1, first + faces[f][2] + 1, first + faces[f][3] + 1);
    }
}

static bst_test_model open_mesh(const char *path) {
    char text[600];
    snprintf(text, sizeof text,
             "{\"materials\": [{\"name\": \"w\", \"diffuse\": 0.5}], \"parts\": [{\"name\": \"m\", "
             "\"kind\": \"mesh\", \"file\": \"%s\", \"material\": \"w\"}]}",
             path);
    return bst_test_model_open(text);
}

static void obj_boxes_are_convex_bodies(void **state) {
    (void)state;
    char text[4000] = "", path[BST_TEST_PATH];
    put_box(text, 0, (bst_vec3){-1, -1, -1}, (bst_vec3){1, 1, 1});
    put_box(text, 8, (bst_vec3){2, -3, -1}, (bst_vec3){3, 3, 4});
    write_file(".obj", text, path);
    bst_test_model
        mesh = open_mesh(path),
        boxes = bst_test_model_open(
            "{\"materials\": [{\"name\": \"w\", \"diffuse\": 0.5}], \"parts\": [{\"name\": \"a\", "
            "\"size_m\": [2, 2, 2], \"material\": \"w\"}, {\"name\": \"b\", \"size_m\": [1, 6, 5], "
            "\"position_m\": [2.5, 0, 1.5], \"material\": \"w\"}]}");
    assert_int_equal(mesh.satellite->occluder_count, 2);
    assert_int_equal(mesh.satellite->facet_count, 24);
    uint64_t random = 4;
    for (int i = 0; i < 50; i++) {
        bst_vec3 sun = bst_test_direction(&random), eye = bst_test_direction(&random);
        bst_assert_close(bst_test_flux(&mesh, sun, eye), bst_test_flux(&boxes, sun, eye), 1e-9);
    }
    bst_test_model_close(&mesh);
    bst_test_model_close(&boxes);
    remove(path);
}

/* A box whose faces are divided: as triangles of an open mesh (one face is missing), many bodies,
 * it needs the grid; the light of its remaining outer faces is that of the whole box where the
 * missing face is turned away. */
static void open_meshes_have_two_sides_and_shadows(void **state) {
    (void)state;
    enum { N = 9 };
    static char text[200000];
    char path[BST_TEST_PATH];
    int vertices = 0;
    text[0] = '\0';
    for (int face = 0; face < 5; face++) { /* all but z = -1 */
        for (int i = 0; i < N * N; i++) {
            for (int k = 0; k < 4; k++) {
                double u = 2.0 * (i % N + (k == 1 || k == 2)) / N - 1;
                double v = 2.0 * ((double)(i / N) + (k >= 2)) / N - 1;
                static const int axes[5][3] = {
                    {0, 1, 2}, {1, 2, 0}, {2, 0, 1}, {2, 1, 0}, {0, 2, 1}};
                double p[3];
                p[axes[face][0]] = u;
                p[axes[face][1]] = v;
                p[axes[face][2]] = face < 3 ? 1 : -1;
                sprintf(text + strlen(text), "v %.17g %.17g %.17g\n", p[0], p[1], p[2]);
            }
            sprintf(text + strlen(text), "f %d %d %d %d\n", vertices + 1, vertices + 2,
                    vertices + 3, vertices + 4);
            vertices += 4;
        }
    }
    write_file(".obj", text, path);
    bst_test_model
        mesh = open_mesh(path),
        box = bst_test_model_open(
            "{\"materials\": [{\"name\": \"w\", \"diffuse\": 0.5}], \"parts\": [{\"name\": \"a\", "
            "\"size_m\": [2, 2, 2], \"material\": \"w\"}]}");
    assert_int_equal(mesh.satellite->occluder_count, 5 * N * N * 2);
    uint64_t random = 8;
    int inside = 0;
    for (int i = 0; i < 40; i++) {
        bst_vec3 sun = bst_test_direction(&random), eye = bst_test_direction(&random);
        double open = bst_test_flux(&mesh, sun, eye), closed = bst_test_flux(&box, sun, eye);
        if (sun.z > 0 || eye.z > 0) { /* the inside is dark or not seen */
            bst_assert_close(open, closed - 4 * 0.5 / BST_PI * fmax(-sun.z, 0) * fmax(-eye.z, 0),
                             1e-6);
        } else {
            inside += open > closed - 4 * 0.5 / BST_PI * sun.z * eye.z + 1e-6;
        }
    }
    assert_true(inside > 0);
    bst_test_model_close(&mesh);
    bst_test_model_close(&box);
    remove(path);
}

/* The cube of the corpus, 4 x 2 x 2 after its nodes' transforms, as text and as GLB. */
static void gltf_has_its_transforms_and_materials(void **state) {
    (void)state;
    static const char *const files[] = {"tests/fuzz/corpus/satellite/cube.gltf",
                                        "tests/fuzz/corpus/satellite/cube.glb"};
    for (int i = 0; i < 2; i++) {
        bst_ctx ctx = {0};
        bst_test_model m;
        bst_assert_ok(&ctx, bst_satellite_load(&ctx, files[i], &m.satellite));
        bst_assert_ok(&ctx, bst_satellite_pose_create(&ctx, m.satellite, &m.pose));
        assert_int_equal(m.satellite->occluder_count, 1);
        double area = 0.0;
        for (int f = 0; f < m.satellite->facet_count; f++) {
            area += m.satellite->facets[f].area_m2;
        }
        bst_assert_close(area, 2 * (4 * 2 + 4 * 2 + 2 * 2), 1e-5); /* floats of a turn */
        assert_string_equal(m.satellite->materials[0].name, "m");
        bst_assert_close(m.satellite->materials[0].colour[2], 0.8 / 0.6, 1e-12);
        bst_test_model_close(&m);
    }
}

/* Triangles of two materials, and before them one that the file gives none: grey, after the others.
 */
static void triangles_without_a_material_are_grey(void **state) {
    (void)state;
    char path[BST_TEST_PATH];
    write_file(".obj",
               "v 0 0 0\nv 2 0 0\nv 0 2 0\nv 0 0 2\nf 1 3 2\nusemtl gilt\nf 1 2 4\n"
               "usemtl tin\nf 1 4 3\nf 2 3 4\n",
               path);
    bst_ctx ctx = {0};
    bst_satellite *s;
    bst_assert_ok(&ctx, bst_satellite_load(&ctx, path, &s));
    double area[3] = {0.0};
    static const char *const names[] = {"gilt", "tin", "grey"};
    assert_int_equal(s->material_count, 3);
    for (int f = 0; f < s->facet_count; f++) {
        area[s->facets[f].material] += s->facets[f].area_m2;
    }
    for (int i = 0; i < 3; i++) {
        assert_string_equal(s->materials[i].name, names[i]);
    }
    bst_assert_close(area[0], 2, 1e-12);
    bst_assert_close(area[1], 2 + sqrt(12), 1e-12);
    bst_assert_close(area[2], 2, 1e-12);
    bst_satellite_free(s);
    remove(path);
}

/* A mesh of a million vertices is refused at the first one too many, and says how many are
 * allowed. */
static void too_many_vertices_are_refused(void **state) {
    (void)state;
    enum { VERTICES = 1000000, MOST = 4 * BST_SATELLITE_FACETS_MAX };
    static const char line[] = "v 0 1 2\n";
    char path[BST_TEST_PATH], text[700], says[64];
    char *mesh = malloc(VERTICES * (sizeof line - 1) + 1);
    bst_ctx ctx = {0};
    bst_satellite *s;
    assert_non_null(mesh);
    for (size_t i = 0; i < VERTICES; i++) {
        memcpy(mesh + i * (sizeof line - 1), line, sizeof line);
    }
    write_file(".obj", mesh, path);
    snprintf(text, sizeof text,
             "{\"parts\": [{\"name\": \"m\", \"kind\": \"mesh\", \"file\": \"%s\"}]}", path);
    assert_int_not_equal(bst_test_satellite(&ctx, text, &s), BST_OK);
    snprintf(says, sizeof says, "line %d: more than %d vertices (allowed: %d)", MOST + 1, MOST,
             MOST);
    assert_non_null(strstr(ctx.message, says));
    assert_non_null(strstr(ctx.message, path));
    remove(path);
    free(mesh);
}

static void damaged_meshes_are_refused(void **state) {
    (void)state;
    static const char *const wrong[][3] = {
        {".obj", "", "no faces"},
        {".obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n", "line 4: triangle 0 uses vertex 3"},
        {".obj", "v 0 0 nan\n", "line 1: vertex"},
        {".obj", "v 0 0 inf\n", "line 1: vertex"},
        {".obj", "v 0 0 1e300\n", "line 1: vertex"},
        {".obj", "v 0 0\n", "line 1: a vertex with 2"},
        {".obj", "v 0 0 0\nv 1 0 0\nf 1 1 2\n", "has no facet with an area"},
        {".obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n", "part \"m\": "},
        {".obj", "v 0 0 0\nf 1 x 1\n", "line 2: face corner"},
        {".gltf", "{}", "/scenes: the file has no scene"},
        {".gltf", "{\"scenes\": [{\"nodes\": [3]}]}", "/nodes/3"},
        {".gltf", "{\"scenes\": [{\"nodes\": [0]}], \"nodes\": [{\"children\": [0]}]}", "circle"},
        {".gltf", "{\"scenes\": [{\"nodes\": [0]}], \"nodes\": [{\"scale\": [1, 1]}]}",
         "its transform is not finite"},
        {".gltf", "{\"buffers\": [{\"uri\": \"../secret\"}], \"scenes\": [{}]}", "same folder"},
        {".gltf", "[", ""},
        {".glb", "glTF....", ""},
        {".stl", "solid", "no mesh by its name"}};
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        char path[BST_TEST_PATH], text[700];
        bst_ctx ctx = {0};
        bst_satellite *s;
        write_file(wrong[i][0], wrong[i][1], path);
        snprintf(text, sizeof text,
                 "{\"parts\": [{\"name\": \"m\", \"kind\": \"mesh\", \"file\": \"%s\"}]}", path);
        assert_int_not_equal(bst_test_satellite(&ctx, text, &s), BST_OK);
        assert_null(s);
        if (!strstr(ctx.message, wrong[i][2]) || !strstr(ctx.message, "/parts/0: ") ||
            !strstr(ctx.message, path)) {
            fail_msg("%s: not in: %s", wrong[i][2], ctx.message);
        }
        remove(path);
    }
}

/* More triangles than are allowed: refused at the line that has the first one too many. */
static void too_many_facets_are_refused(void **state) {
    (void)state;
    char path[BST_TEST_PATH];
    write_file(".obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\n", path);
    FILE *f = fopen(path, "a");
    for (int i = 0; i <= BST_SATELLITE_FACETS_MAX; i++) {
        fputs("f 1 2 3\n", f);
    }
    fclose(f);
    bst_ctx ctx = {0};
    bst_satellite *s;
    assert_int_equal(bst_satellite_load(&ctx, path, &s), BST_ERR_FORMAT);
    assert_non_null(strstr(ctx.message, "line 200004: more than 200000 triangles"));
    remove(path);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(obj_boxes_are_convex_bodies),
        cmocka_unit_test(open_meshes_have_two_sides_and_shadows),
        cmocka_unit_test(gltf_has_its_transforms_and_materials),
        cmocka_unit_test(triangles_without_a_material_are_grey),
        cmocka_unit_test(damaged_meshes_are_refused),
        cmocka_unit_test(too_many_vertices_are_refused),
        cmocka_unit_test(too_many_facets_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
