/* The keys of the learned bad-pixel map (pixel_learner.h). */
#ifndef BST_IMGPROC_CALIBRATE_PIXEL_LEARNER_CONFIG_H
#define BST_IMGPROC_CALIBRATE_PIXEL_LEARNER_CONFIG_H

#include "boresight/config.h"

typedef struct bst_pixel_learner_config {
    bool enabled;
    int64_t capacity;               /* pixels under suspicion and bad ones */
    double false_alarm_probability; /* greatest chance that a good pixel under suspicion is taken
                                       for bad */
} bst_pixel_learner_config;

extern const bst_config_desc bst_pixel_learner_config_table[];

#endif
