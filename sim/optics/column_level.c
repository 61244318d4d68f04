#include "sim/optics/column_level.h"

#include <stddef.h>

/* Column offsets above this fraction of the read noise are subtracted. They add about twice their
 * variance to a point filter, three rows of which share a column: at 0.2 this triples the false
 * alarms at 5 sigma, exp(25 * 2 * 0.04 / 2). */
static const double OFFSET_SHARE = 0.2;

const char *const bst_column_level_words[] = {"auto", "on", "off", NULL};

bool bst_column_level_wanted(int choice, const bst_camera *camera) {
    const bst_detector_config *d = &camera->detector;
    bool uneven = d->frame_transfer_s > 0.0 ||
                  d->column_offset_rms_e > OFFSET_SHARE * bst_camera_read_noise_e(camera);
    return choice == BST_COLUMN_LEVEL_ON || (choice == BST_COLUMN_LEVEL_AUTO && uneven);
}
