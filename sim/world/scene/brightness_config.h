/* The block `brightness` of an object. All zero except `earth_albedo`: a cold diffuse sphere of the
 * object's area and albedo. */
#ifndef BST_WORLD_SCENE_BRIGHTNESS_CONFIG_H
#define BST_WORLD_SCENE_BRIGHTNESS_CONFIG_H

#include "boresight/config.h"

enum { BST_HEAT_NONE, BST_HEAT_STEADY, BST_HEAT_TRANSIENT };

enum {
    BST_BRIGHTNESS_SPHERE,
    BST_BRIGHTNESS_STANDARD,
    BST_BRIGHTNESS_LIGHT_CURVE,
    BST_BRIGHTNESS_SHAPE
};

typedef struct bst_brightness_config {
    int32_t model;            /* BST_BRIGHTNESS_... */
    double specular_fraction; /* fraction of reflected light as from a mirror ball; the remainder is
                                 diffuse */
    double standard_v_mag;    /* at 1000 km, phase 90 degrees, Sun at 1 au */
    char light_curve_file[512];  /* CSV */
    double light_curve_period_s; /* 0: the first and last values hold beyond the ends */
    bool earthshine;
    double earth_albedo;
    double emissivity;
    double temperature_k, shadow_temperature_k;
    int32_t heat_balance; /* BST_HEAT_... */
    double earth_infrared_w_per_m2;
    bool interreflection;
    bool resolved; /* rendered as a disc if it is large enough */
} bst_brightness_config;

extern const bst_config_desc bst_brightness_config_table[];

#endif
