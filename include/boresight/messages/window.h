/* A read-out window of the sensor. */
#ifndef BORESIGHT_MESSAGES_WINDOW_H
#define BORESIGHT_MESSAGES_WINDOW_H

/* A read-out window in full-sensor pixels. */
typedef struct bst_window {
    int x0, y0, width, height;
} bst_window;

#endif
