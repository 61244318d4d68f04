/* Configuration list `ghosts` of a camera: faint second images of bright sources, by reflections
 * between surfaces of the optics. Empty: none. */
#ifndef BORESIGHT_GHOST_CONFIG_H
#define BORESIGHT_GHOST_CONFIG_H

#include "boresight/config.h"

#pragma GCC visibility push(default)

/* One ghost that every bright source has. */
typedef struct bst_ghost_config {
    double intensity;       /* light of the ghost over that of the source */
    double factor;          /* place from the centre over the source's; -1: opposite */
    double centre_px[2];    /* from the place of the boresight */
    char map_file[512];     /* places by a table, instead of factor and centre_px; "": none */
    double fwhm_px;         /* Gaussian blur; 0: none */
    double radius_px;       /* disc (image of the pupil out of focus); 0: none */
    double inner_radius_px; /* of its hole (central obscuration) */
    double outside_px;      /* how far outside the sensor sources have this ghost, too */
} bst_ghost_config;

extern const bst_config_desc bst_ghost_config_table[];

#pragma GCC visibility pop

#endif
