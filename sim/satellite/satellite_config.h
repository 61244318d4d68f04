/* Configuration of a satellite's shape: materials, joints and parts, in a scenario or in a file of
 * its own. */
#ifndef BST_SATELLITE_SATELLITE_CONFIG_H
#define BST_SATELLITE_SATELLITE_CONFIG_H

#include "boresight/config.h"
#include "sim/astro/bodies.h"
#include "sim/satellite/brdf.h"

typedef struct bst_satellite_material_config {
    char name[64];
    int32_t library; /* index into bst_material_library; 0: the values below */
    int32_t model;   /* BST_BRDF_... */
    double diffuse, volume, specular, exponent, roughness, tau_deg, omega_deg;
    double binomial_b[2], binomial_c[BST_BRDF_BINOMIAL_TERMS], binomial_base;
    int64_t binomial_first_power;
    char table_file[512];
    double colour[BST_SUNLIGHT_COLOURS]; /* reflectance over that in V, at
                                            bst_sunlight_wavelength_m */
    double scale;                        /* factor on the BRDF */
    double emissivity;
    double absorptance; /* NAN: by the reflectance */
    double heat_capacity_j_per_m2_k;
} bst_satellite_material_config;

enum {
    BST_JOINT_FIXED,
    BST_JOINT_SUN,
    BST_JOINT_EARTH,
    BST_JOINT_TARGET,
    BST_JOINT_SPIN,
    BST_JOINT_TABLE,
    BST_JOINT_BURN
};

typedef struct bst_satellite_joint_config {
    char name[64], parent[64];
    int32_t follows;  /* BST_JOINT_... */
    int64_t axes;     /* 1 or 2 */
    double axis[3];   /* of the first rotation, in the parent's frame */
    double normal[3]; /* what is turned toward what the joint follows */
    double position_m[3];
    double offset_deg, rate_deg_per_s;
    double limit_deg[2];
    char file[512];  /* table */
    int64_t burn;    /* from 1 */
    double turn_deg; /* burn */
} bst_satellite_joint_config;

enum {
    BST_PART_BOX,
    BST_PART_PLATE,
    BST_PART_CYLINDER,
    BST_PART_CONE,
    BST_PART_SPHERE,
    BST_PART_DISH,
    BST_PART_MESH
};

typedef struct bst_satellite_part_config {
    char name[64];
    int32_t kind; /* BST_PART_... */
    double size_m[3];
    double radius_m, top_radius_m, length_m;
    int64_t segments;
    bool open; /* without end faces */
    char file[512];
    double scale;
    double position_m[3], rotation_deg[3];
    char material[64], back_material[64], joint[64];
} bst_satellite_part_config;

typedef struct bst_satellite_config {
    char file[512]; /* JSON, glTF, GLB or OBJ; "": the lists below */
    char source[256];
    int32_t confidence;
    bst_config_list materials, joints, parts;
} bst_satellite_config;

extern const bst_config_desc bst_satellite_config_table[];

#endif
