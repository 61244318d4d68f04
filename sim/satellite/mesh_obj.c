/* Wavefront OBJ: vertices, faces and the names of materials. */
#include <ctype.h>
#include <stdlib.h>
#include <string.h>

#include "sim/core/file.h"
#include "sim/satellite/model_build.h"

enum { FACE_CORNERS_MAX = 64 };
#define OBJ_BYTES_MAX ((uint64_t)256 << 20)

/* The reader's place in a file. */
typedef struct reader {
    bst_ctx *ctx;
    bst_mesh *mesh;
    int material; /* current one; -1: none */
} reader;

static bst_status read_vertex(reader *r, const char *text) {
    double v[3];
    for (int k = 0; k < 3; k++) {
        char *end;
        v[k] = strtod(text, &end);
        if (end == text) {
            return bst_fail(r->ctx, BST_ERR_FORMAT,
                            "a vertex with %d coordinates (allowed: three numbers)", k);
        }
        text = end;
    }
    return bst_mesh_add_vertex(r->ctx, r->mesh, bst_vec3_from_array(v));
}

/* Reads a face: corners "v", "v/vt", "v//vn" or "v/vt/vn"; negative: from the last vertex. */
static bst_status read_face(reader *r, const char *text) {
    int64_t corners[FACE_CORNERS_MAX];
    int count = 0;
    for (;;) {
        text += strspn(text, " \t\r");
        if (!*text) {
            break;
        }
        char *end;
        long long index = strtoll(text, &end, 10);
        if (end == text || count == FACE_CORNERS_MAX || index == 0) {
            return bst_fail(r->ctx, BST_ERR_FORMAT,
                            "face corner \"%.20s\" (allowed: 3 to %d vertex numbers from 1)", text,
                            FACE_CORNERS_MAX);
        }
        corners[count++] = index > 0 ? index - 1 : r->mesh->vertex_count + index;
        text = end + strcspn(end, " \t\r");
    }
    if (count < 3) {
        return bst_fail(r->ctx, BST_ERR_FORMAT, "a face with %d corners (allowed: 3 to %d)", count,
                        FACE_CORNERS_MAX);
    }
    for (int i = 2; i < count; i++) {
        const int64_t triangle[3] = {corners[0], corners[i - 1], corners[i]};
        BST_TRY(bst_mesh_add_triangle(r->ctx, r->mesh, triangle, r->material));
    }
    return BST_OK;
}

/* Selects the material of a name; its properties are in another file, which is not read. */
static bst_status use_material(reader *r, const char *text) {
    char name[64] = "";
    text += strspn(text, " \t");
    size_t n = strcspn(text, " \t\r");
    memcpy(name, text, n < sizeof name ? n : sizeof name - 1);
    for (int i = 0; i < r->mesh->material_count; i++) {
        if (strcmp(r->mesh->materials[i].name, name) == 0) {
            r->material = i;
            return BST_OK;
        }
    }
    bst_material grey = {"", {.model = BST_BRDF_LAMBERT, .diffuse = 0.3}, 1.0, {1, 1, 1, 1}, 0.8};
    memcpy(grey.name, name, sizeof grey.name);
    return bst_mesh_add_material(r->ctx, r->mesh, &grey, &r->material);
}

static bst_status read_line(reader *r, const char *line) {
    line += strspn(line, " \t");
    if (line[0] == 'v' && isspace((unsigned char)line[1])) {
        return read_vertex(r, line + 1);
    }
    if (line[0] == 'f' && isspace((unsigned char)line[1])) {
        return read_face(r, line + 1);
    }
    if (strncmp(line, "usemtl", 6) == 0 && isspace((unsigned char)line[6])) {
        return use_material(r, line + 6);
    }
    return BST_OK; /* texture coordinates, normals, groups, comments */
}

bst_status bst_mesh_load_obj(bst_ctx *ctx, const char *path, bst_mesh *mesh) {
    char *text;
    size_t bytes;
    BST_TRY(bst_file_read(ctx, path, OBJ_BYTES_MAX, "an OBJ file", &text, &bytes));
    bst_status status = bst_file_check_text(ctx, path, text, bytes);
    reader r = {ctx, mesh, -1};
    int number = 0;
    for (char *line = text, *next; line && status == BST_OK; line = next) {
        next = strchr(line, '\n');
        if (next) {
            *next++ = '\0';
        }
        number++;
        status = read_line(&r, line);
        if (status != BST_OK) {
            status = bst_fail_prefix(ctx, status, "%.400s: line %d", path, number);
        }
    }
    free(text);
    if (status == BST_OK && mesh->triangle_count == 0) {
        status = bst_fail(ctx, BST_ERR_FORMAT,
                          "%.400s: no faces (allowed: an OBJ file with at least one)", path);
    }
    return status;
}
