/* Channel control_status: mode and target of control. */
#ifndef BORESIGHT_MESSAGES_CONTROL_STATUS_H
#define BORESIGHT_MESSAGES_CONTROL_STATUS_H

#include <stdint.h>

#pragma GCC visibility push(default)

#define BST_CHANNEL_CONTROL_STATUS "control_status"

typedef enum bst_mode {
    BST_MODE_IDLE = 0,
    BST_MODE_SLEW,    /* to the cue */
    BST_MODE_SEARCH,  /* step-stare pattern about the cue */
    BST_MODE_ACQUIRE, /* a candidate is being centred and confirmed */
    BST_MODE_TRACK,
    BST_MODE_REACQUIRE, /* target lost: predicted position, then search around it */
    BST_MODE_STARE,     /* open loop, inertial */
    BST_MODE_RATE,      /* open loop, on the cue */
    BST_MODE_COAST,     /* on the prediction of a target that cannot be seen */
    BST_MODE_FIXED,     /* open loop, constant direction in inertial space or in the body */
    BST_MODE_SCAN,      /* open loop, along an arc at a constant rate */
    BST_MODE_LOST,      /* the attitude is unknown: nothing is commanded until stars give it */
    BST_MODE_COUNT
} bst_mode;

/* control_status (latest): mode and aim of control; for record, progress display and evaluation. */
typedef struct bst_control_status {
    int64_t tick;
    int32_t mode; /* bst_mode */
    int64_t target_id;
    int32_t search_step;
    double aim_error_px[2]; /* target minus boresight, as control estimates it */
} bst_control_status;

/* Name of a bst_mode ("track" for BST_MODE_TRACK); "unknown" for other numbers. Never NULL. */
const char *bst_mode_name(int mode);

#pragma GCC visibility pop

#endif
