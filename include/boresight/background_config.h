/* Configuration block `background` of a camera: light between the sources. All zero: uniform sky of
 * background_mag_arcsec2. */
#ifndef BORESIGHT_BACKGROUND_CONFIG_H
#define BORESIGHT_BACKGROUND_CONFIG_H

#include <stdbool.h>

#include "boresight/config.h"

#pragma GCC visibility push(default)

enum { BST_BACKGROUND_UNIFORM, BST_BACKGROUND_SKY };
/* What the numbers of a map of stray light are. */
enum { BST_STRAY_MAP_ELECTRONS, BST_STRAY_MAP_SHARE };

/* A point of the table of point source transmittance. */
typedef struct bst_optics_pst_point {
    double angle_deg, pst;
} bst_optics_pst_point;

typedef struct bst_background_config {
    int32_t model; /* BST_BACKGROUND_... */
    bool zodiacal, starlight;
    double diffuse_galactic_fraction;
    bool earth, moon, sun; /* discs, and in model `sky` with a PST their stray light */
    double earth_albedo, earth_night_mag_arcsec2, earth_temperature_k, limb_scale_height_m;
    bst_config_list pst;   /* bst_optics_pst_point; empty: no stray light */
    char pst_file[512];    /* PST from a CSV file; "": none */
    double pixel_pitch_um; /* pitch, for stray light; 0: that of the optics */
    /* added in either model: with u, v from -1 to 1 over the sensor's columns and rows,
     * stray + gradient . (u, v) + curvature . (u^2, u v, v^2) */
    double stray_e_per_s, gradient_e_per_s[2], curvature_e_per_s[3];
    char stray_map_file[512]; /* FITS image over the sensor; "": none */
    int32_t stray_map;        /* BST_STRAY_MAP_... */
    double stray_map_scale;   /* factor on its numbers */
} bst_background_config;

extern const bst_config_desc bst_background_config_table[];

#pragma GCC visibility pop

#endif
