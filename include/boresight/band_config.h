/* Configuration block `band` of a camera: its spectral response. All zero: V band of
 * photon_flux_v0_per_s_m2. */
#ifndef BORESIGHT_BAND_CONFIG_H
#define BORESIGHT_BAND_CONFIG_H

#include "boresight/config.h"

#pragma GCC visibility push(default)

enum {
    BST_BAND_V,
    BST_BAND_SILICON,
    BST_BAND_SWIR,
    BST_BAND_MWIR,
    BST_BAND_LWIR,
    BST_BAND_PRESETS
};

/* A point of a spectral table; linear between points, zero beyond. */
typedef struct bst_optics_response_point {
    double wavelength_um, value;
} bst_optics_response_point;

typedef struct bst_band_config {
    int32_t preset; /* BST_BAND_... */
    bst_config_list
        response; /* bst_optics_response_point: of the detector, instead of the preset's */
    char response_file[512];      /* response from a CSV file; "": none */
    bst_config_list transmission; /* bst_optics_response_point: of the optics; empty: 1 */
    char transmission_file[512];
    double optics_temperature_k;
    double optics_emissivity;
    double optics_beam_factor; /* solid angle from which a pixel receives thermal emission of the
                                  optics, relative to that of the imaging beam */
} bst_band_config;

extern const bst_config_desc bst_band_config_table[];

#pragma GCC visibility pop

#endif
