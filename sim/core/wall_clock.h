/* Wall-clock time, for progress, rates and pacing only: no simulated quantity may depend on it. */
#ifndef BST_CORE_WALL_CLOCK_H
#define BST_CORE_WALL_CLOCK_H

#include <time.h>

/* Seconds of the monotonic clock since an arbitrary origin. */
static inline double bst_wall_seconds(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

#endif
