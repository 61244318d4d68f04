/* Statistics of blocks of a map. */
#include "sim/analysis/characterize/sensor_figures.h"

bool bst_sensor_has_level(const bst_sensor_stacks *s) {
    return s->bias.count > 0 || (s->dark.count > 0 && s->dark.overscan_width > 0);
}

void bst_sensor_block_moments(const float *map, int width, int height, double clip, float *scratch,
                              double *mean, double *variance) {
    for (int k = 0; k < BST_STACK_BLOCKS; k++) {
        int bx = k % BST_STACK_SIDE, by = k / BST_STACK_SIDE;
        size_t n = 0;
        for (int y = by * height / BST_STACK_SIDE; y < (by + 1) * height / BST_STACK_SIDE; y++) {
            for (int x = bx * width / BST_STACK_SIDE; x < (bx + 1) * width / BST_STACK_SIDE; x++) {
                scratch[n++] = map[(size_t)y * (size_t)width + (size_t)x];
            }
        }
        bst_clipped_moments m = bst_clipped_moments_of(scratch, n, clip);
        mean[k] = m.mean;
        if (variance) {
            variance[k] = m.variance;
        }
    }
}
