/* Configuration keys of the learned bad-pixel map (pixel_learner.h). */
#ifndef BST_IMGPROC_CALIBRATE_PIXEL_LEARNER_CONFIG_H
#define BST_IMGPROC_CALIBRATE_PIXEL_LEARNER_CONFIG_H

#include "boresight/config.h"

typedef struct bst_pixel_learner_config {
    bool enabled;
    int64_t capacity;               /* most suspected and bad pixels together */
    double false_alarm_probability; /* largest probability that a good suspected pixel is declared
                                       bad */
} bst_pixel_learner_config;

extern const bst_config_desc bst_pixel_learner_config_table[];

#endif
