#include "scenegen/detector.h"

#include <math.h>
#include <stdio.h>

int bst_detector_options(const bst_camera *camera, char *text, size_t bytes) {
    double read = camera->read_noise_e;
    int order = read >= 5.0 ? 2 : read >= 3.0 ? 3 : 4;
    const char *from = read >= 2.0    ? "-1.0f"
                       : read >= 0.75 ? "30.0f -DSEARCH"
                                      : "INFINITY -DSEARCH";
    return snprintf(text, bytes, " -DCF_ORDER=%d -DSINGLE_FROM=%s", order, from);
}

double bst_detector_near_full_e(double full_well_e) {
    return full_well_e - 8.0 * sqrt(full_well_e) - 20.0;
}
