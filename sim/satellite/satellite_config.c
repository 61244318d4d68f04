#include "sim/satellite/satellite_config.h"

#include "sim/satellite/material_library.h"

static const char *const brdf_models[] = {"lambert",       "phong",    "ashikhmin_shirley",
                                          "cook_torrance", "binomial", "maxwell_beard",
                                          "table",         NULL};
static const char *const joint_targets[] = {"fixed", "sun",   "earth", "target",
                                            "spin",  "table", "burn",  NULL};
static const char *const part_kinds[] = {"box",    "plate", "cylinder", "cone",
                                         "sphere", "dish",  "mesh",     NULL};
static const char *const confidences[] = {"unrated", "guess",    "similar",
                                          "drawing", "measured", NULL};

static const bst_config_desc material_table[] = {
    BST_STRING(bst_satellite_material_config, name, NULL, "Name, unique in the satellite."),
    BST_ENUM(bst_satellite_material_config, library, bst_material_library_names, "\"none\"",
             "A material of the library, which gives all values but scale; none: those below."),
    BST_ENUM(bst_satellite_material_config, model, brdf_models, "\"lambert\"",
             "Reflectance model (BRDF)."),
    BST_REAL(bst_satellite_material_config, diffuse, "", 0, 1, "0",
             "Hemispherical reflectance of the diffuse part."),
    BST_REAL(bst_satellite_material_config, volume, "", 0, 1, "0",
             "maxwell_beard: reflectance of volume scattering."),
    BST_REAL(bst_satellite_material_config, specular, "", 0, 1, "0",
             "Reflectance of the specular part; at normal incidence for ashikhmin_shirley, "
             "cook_torrance and maxwell_beard."),
    BST_REAL(bst_satellite_material_config, exponent, "", 0, 100000, "10",
             "phong, ashikhmin_shirley: exponent of the lobe."),
    BST_REAL(bst_satellite_material_config, roughness, "", 0.001, 1, "0.3",
             "cook_torrance: alpha of the GGX distribution; maxwell_beard: RMS slope."),
    BST_REAL(bst_satellite_material_config, tau_deg, "deg", 0, 180, "0",
             "maxwell_beard: width of shadowing and obscuration in the bistatic angle; 0: none."),
    BST_REAL(bst_satellite_material_config, omega_deg, "deg", 0, 180, "0",
             "maxwell_beard: their width in the angle of the half vector."),
    BST_REALS(bst_satellite_material_config, binomial_b, "", -1e4, 1e4, "[0, 0]",
              "binomial: coefficients of D^0 and D^1 in log10 of the BRDF."),
    BST_REALS(bst_satellite_material_config, binomial_c, "", -1e4, 1e4,
              "[0, 0, 0, 0, 0, 0, 0, 0, 0, 0]",
              "binomial: coefficients of log10(1 + base^j D^2) / 2, j from first_power."),
    BST_REAL(bst_satellite_material_config, binomial_base, "", 1, 100, "3", "binomial: base."),
    BST_INT(bst_satellite_material_config, binomial_first_power, "", -20, 20, "-5",
            "binomial: power of the base in the first of binomial_c."),
    BST_PATH(bst_satellite_material_config, table_file, "\"\"",
             "table: file of measured values, relative to the folder of the file that names it."),
    BST_REALS(bst_satellite_material_config, colour, "", 0, 20, "[1, 1, 1, 1]",
              "Reflectance over that in V at 0.40, 0.55, 0.70 and 1.00 um."),
    BST_REAL(bst_satellite_material_config, scale, "", 0, 100, "1", "Factor on the reflectance."),
    BST_REAL(bst_satellite_material_config, emissivity, "", 0, 1, "0.8",
             "Emissivity in the thermal infrared."),
    BST_OPEN_REAL(bst_satellite_material_config, absorptance, "", 0, 1,
                  "Absorptance of sunlight, for temperatures (brightness.heat_balance), also with "
                  "a material of the library; null: 1 minus the reflectance at normal incidence."),
    BST_REAL(bst_satellite_material_config, heat_capacity_j_per_m2_k, "J/(m2 K)", 0, 1e8, "0",
             "Heat capacity of the surface, for the heat balance transient, also with a material "
             "of the library; 0: it follows its load at once."),
    BST_CONFIG_END,
};

static const bst_config_desc joint_table[] = {
    BST_STRING(bst_satellite_joint_config, name, NULL, "Name, unique in the satellite."),
    BST_STRING(bst_satellite_joint_config, parent, "\"\"",
               "The joint that carries this one; empty: the body. Parents come first."),
    BST_ENUM(bst_satellite_joint_config, follows, joint_targets, "\"fixed\"",
             "What normal is turned toward: nothing (fixed at offset_deg), the Sun, the Earth's "
             "centre, the observer (target); spin: it turns at rate_deg_per_s; table: by a file; "
             "burn: it turns once, from the start of a burn of the object."),
    BST_INT(bst_satellite_joint_config, axes, "", 1, 2, "1",
            "Number of axes: 1: about axis only; 2: then about the axis perpendicular to axis and "
            "normal, so that normal points there exactly."),
    BST_REALS(bst_satellite_joint_config, axis, "", -1, 1, "[0, 1, 0]",
              "Axis of rotation in the parent's frame."),
    BST_REALS(bst_satellite_joint_config, normal, "", -1, 1, "[0, 0, 1]",
              "Direction that follows, in the frame of the parts, not along axis."),
    BST_REALS(bst_satellite_joint_config, position_m, "m", -1e4, 1e4, "[0, 0, 0]",
              "Place of the joint in the parent's frame; parts are placed relative to it."),
    BST_REAL(bst_satellite_joint_config, offset_deg, "deg", -360, 360, "0",
             "Added rotation about axis."),
    BST_REAL(
        bst_satellite_joint_config, rate_deg_per_s, "deg/s", -1e4, 1e4, "0",
        "spin: rate about axis, from offset_deg at the epoch; burn: rate of the turn, its sign "
        "does not count; 0: at once."),
    BST_REALS(bst_satellite_joint_config, limit_deg, "deg", -180, 180, "[-180, 180]",
              "Lowest and highest rotation about axis, before offset_deg."),
    BST_PATH(bst_satellite_joint_config, file, "\"\"",
             "table: CSV with columns time_s (after the epoch) and angle_deg, added to offset_deg; "
             "linear between rows; relative to the folder of the file that names it."),
    BST_INT(bst_satellite_joint_config, burn, "", 1, 64, "1",
            "burn: which burn of the object starts the turn; without it the joint stays."),
    BST_REAL(bst_satellite_joint_config, turn_deg, "deg", -360, 360, "0",
             "burn: size of the turn about axis, from offset_deg."),
    BST_CONFIG_END,
};

static const bst_config_desc part_table[] = {
    BST_STRING(bst_satellite_part_config, name, NULL, "Name, unique in the satellite."),
    BST_ENUM(bst_satellite_part_config, kind, part_kinds, "\"box\"",
             "Form. Box, cylinder, cone and sphere are centred; a plate faces +z; a dish opens "
             "toward +z, with its vertex at position_m; mesh: from a file."),
    BST_REALS(bst_satellite_part_config, size_m, "m", 0, 1e4, "[1, 1, 1]",
              "box: lengths along x, y, z; plate: along x and y."),
    BST_REAL(bst_satellite_part_config, radius_m, "m", 0, 1e4, "0.5",
             "cylinder, sphere, dish: radius; cone: radius at the end toward -z."),
    BST_REAL(bst_satellite_part_config, top_radius_m, "m", 0, 1e4, "0",
             "cone: radius at the end toward +z."),
    BST_REAL(bst_satellite_part_config, length_m, "m", 0, 1e4, "1",
             "cylinder, cone: length along z; dish: depth."),
    BST_INT(bst_satellite_part_config, segments, "", 8, 96, "24",
            "Facets around a curved part. Its light is integrated over the curved surface, with "
            "round shadows; in images it casts the shadow of its facets."),
    BST_BOOL(bst_satellite_part_config, open, "false", "cylinder, cone: without end faces."),
    BST_PATH(bst_satellite_part_config, file, "\"\"",
             "mesh: Wavefront OBJ, glTF or GLB file, relative to the folder of the file that "
             "names it."),
    BST_REAL(bst_satellite_part_config, scale, "", 1e-6, 1e6, "1",
             "mesh: metres per unit of the file."),
    BST_REALS(bst_satellite_part_config, position_m, "m", -1e4, 1e4, "[0, 0, 0]",
              "Place in the frame of the joint or of the body."),
    BST_REALS(bst_satellite_part_config, rotation_deg, "deg", -360, 360, "[0, 0, 0]",
              "Rotation about x, then y, then z of that frame."),
    BST_STRING(bst_satellite_part_config, material, "\"\"",
               "Name of a material; a mesh may leave it out to keep the materials of its file."),
    BST_STRING(bst_satellite_part_config, back_material, "\"\"",
               "plate, dish: material of the other side; empty: the same."),
    BST_STRING(bst_satellite_part_config, joint, "\"\"",
               "The joint that carries it; empty: the body."),
    BST_CONFIG_END,
};

const bst_config_desc bst_satellite_config_table[] = {
    BST_PATH(bst_satellite_config, file, "\"\"",
             "File of the shape instead of the lists: JSON with these keys, or a mesh (OBJ, glTF, "
             "GLB), relative to the scenario's folder."),
    BST_STRING(bst_satellite_config, source, "\"\"",
               "Where dimensions and surfaces come from; free text."),
    BST_ENUM(bst_satellite_config, confidence, confidences, "\"unrated\"",
             "Grade of the model: guess, similar (by likeness to another satellite), drawing "
             "(published dimensions), measured (dimensions and surfaces)."),
    BST_LIST(bst_satellite_config, materials, bst_satellite_material_config, material_table, 0, 64,
             "[]", "Materials."),
    BST_LIST(bst_satellite_config, joints, bst_satellite_joint_config, joint_table, 0, 64, "[]",
             "Joints: frames that turn."),
    BST_LIST(bst_satellite_config, parts, bst_satellite_part_config, part_table, 0, 500, "[]",
             "Parts. No two outer faces may coincide."),
    BST_CONFIG_END,
};
