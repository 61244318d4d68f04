/* Configuration of image processing for extended targets. */
#ifndef BST_IMGPROC_EXTENDED_EXTENDED_CONFIG_H
#define BST_IMGPROC_EXTENDED_EXTENDED_CONFIG_H

#include "boresight/config.h"

typedef struct bst_extended_config {
    bool enabled;
    double handover_fwhm; /* size from which a target is extended, in FWHM of the PSF */
    double return_share;  /* share of that size below which it is a point again */
    double join_share; /* gap up to which parts belong together, share of the larger one's size */
    double phase_offset_factor; /* offset of the outline towards the Sun, 1: of a sphere */
    double centre_sigma;        /* of the estimated centre of mass, share of the size */
    double target_size_m, target_size_sigma_m; /* onboard knowledge; 0: unknown */
    char target_model[512];                    /* file of a model on board; "": none */
    double target_model_sigma;                 /* of its dimensions, share of the size */
} bst_extended_config;

extern const bst_config_desc bst_extended_config_table[];

#endif
