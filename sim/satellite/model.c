#include "sim/satellite/model.h"

#include <assert.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "sim/core/file.h"
#include "sim/satellite/model_build.h"

void bst_satellite_free(bst_satellite *s) {
    if (!s) {
        return;
    }
    for (int i = 0; i < s->material_count && s->tables; i++) {
        bst_brdf_table_free(s->tables[i]);
    }
    for (int i = 0; i < s->joint_count; i++) {
        bst_curve_free(&s->joints[i].table);
    }
    free(s->tables);
    free(s->vertices);
    free(s->vertex_joint);
    free(s->corner);
    free(s->edges);
    free(s->facets);
    free(s->occluders);
    free(s->curved);
    free(s->shells);
    free(s->parts);
    free(s->materials);
    free(s->surfaces);
    free(s->joints);
    free(s);
}

/* The values of a material of the configuration. */
static bst_status make_material(bst_ctx *ctx, bst_satellite *s,
                                const bst_satellite_material_config *c, const char *base_dir) {
    bst_material *m = &s->materials[s->material_count];
    if (c->library > 0) {
        *m = *bst_material_library(c->library);
    } else {
        *m = (bst_material){.brdf = {.model = c->model,
                                     .diffuse = c->diffuse,
                                     .volume = c->volume,
                                     .specular = c->specular,
                                     .exponent = c->exponent,
                                     .roughness = c->roughness,
                                     .tau_rad = c->tau_deg * BST_DEG_RAD,
                                     .omega_rad = c->omega_deg * BST_DEG_RAD,
                                     .base = c->binomial_base,
                                     .first_power = (int)c->binomial_first_power,
                                     .terms = BST_BRDF_BINOMIAL_TERMS},
                            .emissivity = c->emissivity};
        memcpy(m->brdf.b, c->binomial_b, sizeof m->brdf.b);
        memcpy(m->brdf.c, c->binomial_c, sizeof m->brdf.c);
        memcpy(m->colour, c->colour, sizeof m->colour);
    }
    m->scale = c->scale;
    snprintf(m->name, sizeof m->name, "%s", c->name);
    s->surfaces[s->material_count] = (bst_surface_heat){
        .absorptance = c->absorptance, .capacity_jpm2k = c->heat_capacity_j_per_m2_k};
    s->material_count++;
    if (c->library == 0 && c->model == BST_BRDF_TABLE) {
        char path[1100];
        if (!*c->table_file) {
            return bst_fail(ctx, BST_ERR_CONFIG,
                            "table_file: the model table needs a file; give its path");
        }
        bst_file_resolve(base_dir, c->table_file, path, sizeof path);
        bst_status status = bst_brdf_table_load(ctx, path, &s->tables[s->material_count - 1]);
        if (status != BST_OK) {
            return bst_fail_prefix(ctx, BST_ERR_CONFIG, "table_file");
        }
        m->brdf.table = s->tables[s->material_count - 1];
    }
    return c->library > 0 ? BST_OK : bst_brdf_check(ctx, &m->brdf);
}

static bst_status make_materials(bst_ctx *ctx, bst_satellite *s, const bst_config_list *list,
                                 const char *base_dir) {
    const bst_satellite_material_config *c = list->items;
    for (int i = 0; i < list->count; i++) {
        for (int k = 0; k < i; k++) {
            if (strcmp(c[k].name, c[i].name) == 0) {
                return bst_fail(ctx, BST_ERR_CONFIG,
                                "/materials/%d/name: \"%s\" is the name of /materials/%d too "
                                "(allowed: unique names)",
                                i, c[i].name, k);
            }
        }
        bst_status status = make_material(ctx, s, &c[i], base_dir);
        if (status != BST_OK) {
            return bst_fail_prefix(ctx, status, "/materials/%d", i);
        }
    }
    return BST_OK;
}

static int find_joint(const bst_satellite *s, const char *name) {
    for (int i = 0; i < s->joint_count; i++) {
        if (strcmp(s->joints[i].name, name) == 0) {
            return i;
        }
    }
    return -1;
}

static int find_material(const bst_satellite *s, const char *name) {
    for (int i = 0; i < s->material_count; i++) {
        if (strcmp(s->materials[i].name, name) == 0) {
            return i;
        }
    }
    return -1;
}

/* Reads the angles of a joint. */
static bst_status load_angles(bst_ctx *ctx, const bst_satellite_joint_config *c,
                              const char *base_dir, bst_curve *out) {
    static const char *const times[] = {"time_s", NULL}, *const angles[] = {"angle_deg", NULL};
    const bst_curve_format format = {
        "a table of a joint's angles", times, angles, -1e9, 1e9, -1e6, 1e6};
    char path[1100];
    if (!*c->file) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "file: a joint that follows a table needs a file; "
                        "give its path");
    }
    bst_file_resolve(base_dir, c->file, path, sizeof path);
    return bst_curve_load(ctx, path, &format, out) == BST_OK
               ? BST_OK
               : bst_fail_prefix(ctx, BST_ERR_CONFIG, "file");
}

static bst_status make_joint(bst_ctx *ctx, bst_satellite *s, const bst_satellite_joint_config *c,
                             const char *base_dir) {
    bst_joint j = {.parent = -1,
                   .follows = c->follows,
                   .axes = (int)c->axes,
                   .axis = bst_vec3_unit(bst_vec3_from_array(c->axis)),
                   .normal = bst_vec3_unit(bst_vec3_from_array(c->normal)),
                   .position_m = bst_vec3_from_array(c->position_m),
                   .offset_rad = c->offset_deg * BST_DEG_RAD,
                   .rate_radps = c->rate_deg_per_s * BST_DEG_RAD,
                   .limit_rad = {c->limit_deg[0] * BST_DEG_RAD, c->limit_deg[1] * BST_DEG_RAD},
                   .burn = (int)c->burn - 1,
                   .turn_rad = c->turn_deg * BST_DEG_RAD};
    memcpy(j.name, c->name, sizeof j.name);
    if (find_joint(s, c->name) >= 0) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "name: \"%s\" is the name of another joint (allowed: "
                        "unique names)",
                        c->name);
    }
    if (*c->parent && (j.parent = find_joint(s, c->parent)) < 0) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "parent: there is no joint \"%s\" before this one (allowed: a joint "
                        "earlier in the list)",
                        c->parent);
    }
    if (bst_vec3_norm(bst_vec3_cross(j.axis, j.normal)) < 1e-3) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "normal: it is along axis, or one of them is zero (allowed: two vectors "
                        "in different directions)");
    }
    if (!(j.limit_rad[0] <= j.limit_rad[1])) {
        return bst_fail(ctx, BST_ERR_CONFIG, "limit_deg: found [%g, %g] (allowed: ascending)",
                        c->limit_deg[0], c->limit_deg[1]);
    }
    s->joints[s->joint_count++] = j;
    return j.follows == BST_JOINT_TABLE
               ? load_angles(ctx, c, base_dir, &s->joints[s->joint_count - 1].table)
               : BST_OK;
}

/* Rotation about x, then y, then z. */
static bst_mat3 rotation_of(const double deg[3]) {
    bst_quat q = bst_quat_from_rotvec((bst_vec3){deg[0] * BST_DEG_RAD, 0, 0});
    q = bst_quat_mul(bst_quat_from_rotvec((bst_vec3){0, deg[1] * BST_DEG_RAD, 0}), q);
    q = bst_quat_mul(bst_quat_from_rotvec((bst_vec3){0, 0, deg[2] * BST_DEG_RAD}), q);
    return bst_quat_to_mat3(q);
}

/* True if a file's name ends so. */
static bool ends(const char *path, const char *ending) {
    size_t n = strlen(path), m = strlen(ending);
    return n >= m && strcasecmp(path + n - m, ending) == 0;
}

static bst_status load_mesh(bst_ctx *ctx, const char *path, bst_mesh *mesh) {
    if (ends(path, ".obj")) {
        return bst_mesh_load_obj(ctx, path, mesh);
    }
    if (ends(path, ".gltf") || ends(path, ".glb")) {
        return bst_mesh_load_gltf(ctx, path, mesh);
    }
    return bst_fail(ctx, BST_ERR_CONFIG,
                    "%.400s: no mesh by its name (allowed: files .obj, .gltf, .glb)", path);
}

/* Adds a mesh from a file, with its materials where the place names none. */
static bst_status add_mesh_file(bst_ctx *ctx, bst_satellite *s, const char *path, double scale,
                                const bst_part_place *place) {
    bst_mesh mesh = {0};
    bst_status status = load_mesh(ctx, path, &mesh);
    bst_part_place own = *place;
    if (status == BST_OK && place->material < 0) {
        if (s->material_count + mesh.material_count + 1 > BST_SATELLITE_MATERIALS_MAX) {
            status = bst_fail(ctx, BST_ERR_CONFIG, "%.400s: %d materials (allowed: %d in all)",
                              path, mesh.material_count, BST_SATELLITE_MATERIALS_MAX - 1);
        } else {
            int base = s->material_count;
            for (int i = 0; i < mesh.material_count; i++) {
                s->materials[s->material_count++] = mesh.materials[i];
            }
            /* what the file gives no material is grey */
            s->materials[s->material_count++] = (bst_material){
                "grey", {.model = BST_BRDF_LAMBERT, .diffuse = 0.3}, 1.0, {1, 1, 1, 1}, 0.8};
            for (int i = 0; i < mesh.triangle_count; i++) {
                int m = mesh.triangle_material[i];
                mesh.triangle_material[i] = base + (m >= 0 ? m : mesh.material_count);
            }
        }
    } else if (status == BST_OK) {
        for (int i = 0; i < mesh.triangle_count; i++) {
            mesh.triangle_material[i] = place->material;
        }
    }
    if (status == BST_OK) {
        status = bst_model_add_mesh(ctx, s, &mesh, scale, &own);
        if (status != BST_OK) {
            status = bst_fail_prefix(ctx, status, "%.400s", path);
        }
    }
    bst_mesh_free(&mesh);
    return status;
}

static bst_status find_place(bst_ctx *ctx, const bst_satellite *s,
                             const bst_satellite_part_config *c, bst_part_place *place) {
    *place = (bst_part_place){.rotation = rotation_of(c->rotation_deg),
                              .position_m = bst_vec3_from_array(c->position_m),
                              .part = s->part_count,
                              .joint = -1,
                              .material = -1};
    for (int i = 0; i < s->part_count; i++) {
        if (strcmp(s->parts[i].name, c->name) == 0) {
            return bst_fail(ctx, BST_ERR_CONFIG,
                            "name: \"%s\" is the name of /parts/%d too (allowed: unique names)",
                            c->name, i);
        }
    }
    if (*c->joint && (place->joint = find_joint(s, c->joint)) < 0) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "joint: there is no joint \"%s\" (allowed: one of /joints, or empty)",
                        c->joint);
    }
    bool needed = c->kind != BST_PART_MESH || *c->material;
    if (needed && (place->material = find_material(s, c->material)) < 0) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "material: there is no material \"%s\" (allowed: one of /materials)",
                        c->material);
    }
    place->back_material = place->material;
    if (*c->back_material && (place->back_material = find_material(s, c->back_material)) < 0) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "back_material: there is no material \"%s\" (allowed: one of /materials)",
                        c->back_material);
    }
    return BST_OK;
}

static bst_status make_part(bst_ctx *ctx, bst_satellite *s, const bst_satellite_part_config *c,
                            const char *base_dir) {
    bst_part_place place;
    BST_TRY(find_place(ctx, s, c, &place));
    bst_satellite_part *part = &s->parts[s->part_count++];
    *part = (bst_satellite_part){.first_facet = s->facet_count, .joint = place.joint};
    memcpy(part->name, c->name, sizeof part->name);
    if (c->kind == BST_PART_MESH) {
        char path[1100];
        if (!*c->file) {
            return bst_fail(ctx, BST_ERR_CONFIG, "file: a mesh needs a file; give its path");
        }
        bst_file_resolve(base_dir, c->file, path, sizeof path);
        BST_TRY(add_mesh_file(ctx, s, path, c->scale, &place));
    } else {
        BST_TRY(bst_model_add_part(ctx, s, c, &place));
    }
    part->facet_count = s->facet_count - part->first_facet;
    if (part->facet_count == 0) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "part \"%s\"%s%.400s has no facet with an area (allowed: extents above 0)",
                        c->name, *c->file ? ": " : "", c->file);
    }
    return BST_OK;
}

/* Radius of the sphere that contains all parts in any pose, and the narrowest lobe. */
static void make_extent(bst_satellite *s) {
    for (int i = 0; i < s->vertex_count; i++) {
        double reach = bst_vec3_norm(s->vertices[i]);
        for (int j = s->vertex_joint[i]; j >= 0; j = s->joints[j].parent) {
            reach += bst_vec3_norm(s->joints[j].position_m);
        }
        s->radius_m = fmax(s->radius_m, reach);
    }
    s->lobe_rad = 0.5 * BST_PI;
    for (int i = 0; i < s->material_count; i++) {
        s->lobe_rad = fmin(s->lobe_rad, bst_brdf_lobe_rad(&s->materials[i].brdf));
    }
}

static bst_status allocate(bst_ctx *ctx, int parts, int joints, bst_satellite **out) {
    bst_satellite *s = *out = calloc(1, sizeof *s);
    if (s) {
        s->materials = calloc(BST_SATELLITE_MATERIALS_MAX, sizeof *s->materials);
        s->surfaces = calloc(BST_SATELLITE_MATERIALS_MAX, sizeof *s->surfaces);
        for (int i = 0; s->surfaces && i < BST_SATELLITE_MATERIALS_MAX; i++) {
            s->surfaces[i].absorptance = (double)NAN;
        }
        s->tables = calloc(BST_SATELLITE_MATERIALS_MAX, sizeof *s->tables);
        s->parts = calloc((size_t)parts + 1, sizeof *s->parts);
        s->joints = calloc((size_t)joints + 1, sizeof *s->joints);
    }
    return s && s->materials && s->surfaces && s->tables && s->parts && s->joints
               ? BST_OK
               : bst_fail(ctx, BST_ERR_MEMORY, "no memory for a satellite");
}

/* Fills a model from the lists of a configuration. */
static bst_status fill(bst_ctx *ctx, bst_satellite *s, const bst_satellite_config *config,
                       const char *base_dir) {
    BST_TRY(make_materials(ctx, s, &config->materials, base_dir));
    const bst_satellite_joint_config *joints = config->joints.items;
    for (int i = 0; i < config->joints.count; i++) {
        bst_status status = make_joint(ctx, s, &joints[i], base_dir);
        if (status != BST_OK) {
            return bst_fail_prefix(ctx, status, "/joints/%d", i);
        }
    }
    const bst_satellite_part_config *parts = config->parts.items;
    for (int i = 0; i < config->parts.count; i++) {
        bst_status status = make_part(ctx, s, &parts[i], base_dir);
        if (status != BST_OK) {
            return bst_fail_prefix(ctx, status, "/parts/%d", i);
        }
    }
    if (s->part_count == 0) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "/parts: the satellite has no parts (allowed: at least one, or a file)");
    }
    make_extent(s);
    return BST_OK;
}

/* Reads a JSON file of a satellite. */
static bst_status load_json(bst_ctx *ctx, const char *path, bst_satellite **out) {
    bst_json *json;
    bst_satellite_config config;
    char folder[1100];
    BST_TRY(bst_json_load(ctx, path, &json));
    bst_status status =
        bst_config_read(ctx, json, bst_json_root(json), "", bst_satellite_config_table, &config);
    if (status == BST_OK) {
        snprintf(folder, sizeof folder, "%s", path);
        char *slash = strrchr(folder, '/');
        *(slash ? slash : folder) = '\0';
        status = *config.file ? bst_fail(ctx, BST_ERR_CONFIG,
                                         "/file: a satellite's file names no other file (found "
                                         "\"%.200s\"); give its parts",
                                         config.file)
                              : bst_satellite_create(ctx, &config, folder, out);
        if (status != BST_OK) {
            status = bst_fail_prefix(ctx, status, "%.400s", path);
        }
        bst_config_free(bst_satellite_config_table, &config);
    }
    bst_json_free(json);
    return status;
}

/* Makes a satellite of one mesh. */
static bst_status load_single_mesh(bst_ctx *ctx, const char *path, bst_satellite **out) {
    bst_satellite_part_config part = {.name = "mesh", .kind = BST_PART_MESH, .scale = 1.0};
    snprintf(part.file, sizeof part.file, "%s", path);
    if (strlen(path) >= sizeof part.file) {
        return bst_fail(ctx, BST_ERR_CONFIG, "%.400s: the path is too long (allowed: %zu bytes)",
                        path, sizeof part.file - 1);
    }
    bst_satellite_config config = {.parts = {.items = &part, .count = 1}};
    return bst_satellite_create(ctx, &config, "", out);
}

bst_status bst_satellite_load(bst_ctx *ctx, const char *path, bst_satellite **out) {
    assert(path && out);
    *out = NULL;
    return ends(path, ".obj") || ends(path, ".gltf") || ends(path, ".glb")
               ? load_single_mesh(ctx, path, out)
               : load_json(ctx, path, out);
}

bst_status bst_satellite_create(bst_ctx *ctx, const bst_satellite_config *config,
                                const char *base_dir, bst_satellite **out) {
    assert(config && base_dir && out);
    *out = NULL;
    if (*config->file) {
        char path[1100];
        bst_file_resolve(base_dir, config->file, path, sizeof path);
        bst_status status = bst_satellite_load(ctx, path, out);
        return status == BST_OK ? BST_OK : bst_fail_prefix(ctx, BST_ERR_CONFIG, "/file");
    }
    bst_satellite *s;
    bst_status status = allocate(ctx, config->parts.count, config->joints.count, &s);
    if (status == BST_OK) {
        status = fill(ctx, s, config, base_dir);
    }
    if (status != BST_OK) {
        bst_satellite_free(s);
        return status;
    }
    *out = s;
    return BST_OK;
}

void bst_satellite_make_surfaces(bst_satellite *s) {
    s->has_surfaces = true;
    /* shares of the sunlight (a black body of 5772 K) nearest to bst_sunlight_wavelength_m:
     * bounds at 0.475, 0.625 and 0.85 um */
    static const double share[BST_SUNLIGHT_COLOURS] = {0.215, 0.190, 0.217, 0.378};
    for (int i = 0; i < s->material_count; i++) {
        const bst_material *m = &s->materials[i];
        double colour = 0.0;
        for (int k = 0; k < BST_SUNLIGHT_COLOURS; k++) {
            colour += share[k] * m->colour[k];
        }
        double *table = s->surfaces[i].reflectance;
        for (int k = 0; k < BST_REFLECTANCE_POINTS; k++) {
            /* the models are not defined at grazing incidence */
            double cosine = fmax((double)k / (BST_REFLECTANCE_POINTS - 1), 0.02);
            table[k] = m->scale * bst_brdf_reflectance(&m->brdf, cosine);
        }
        if (isnan(s->surfaces[i].absorptance)) {
            double reflected = colour * table[BST_REFLECTANCE_POINTS - 1];
            s->surfaces[i].absorptance = fmin(fmax(1.0 - reflected, 0.0), 1.0);
        }
    }
}
