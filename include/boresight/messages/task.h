/* Channel task: the object that a sensor is to look for. */
#ifndef BORESIGHT_MESSAGES_TASK_H
#define BORESIGHT_MESSAGES_TASK_H

#include <stdint.h>

#pragma GCC visibility push(default)

#define BST_CHANNEL_TASK "task"

/* How a task ended. */
typedef enum bst_task_end {
    BST_TASK_NONE = 0,  /* there was none, or it was the own cue */
    BST_TASK_DONE,      /* the target was seen as often as it was to be */
    BST_TASK_NOT_FOUND, /* it was not found in time */
    BST_TASK_LOST,      /* it was found, and not seen any more */
    BST_TASK_END_COUNT
} bst_task_end;

/* task (latest): whom a sensor is to look for from now on, from who plans for several. Before the
 * first one, and with object -1, it is the sensor's own cue. */
typedef struct bst_task {
    int64_t id;     /* 1, 2, ... by sensor: what follows a new one begins anew; 0: none was given */
    int64_t tick;   /* when it was given */
    int32_t object; /* in the onboard catalogue (bst_knowledge_object_count), -1: the own cue */
    int32_t norad;  /* its catalogue number, 0: none */
    double sigma_rad, rate_sigma_radps; /* how far its place and rate may be off, 1 sigma per axis;
                                           0: as the own cue's */
    double v_mag, v_mag_sigma;          /* brightness to be expected; sigma 0: as the own cue's */
    double snr;                         /* expected of a frame, 0: not known */
    int32_t before;                     /* bst_task_end of the task before this one */
} bst_task;

/* "done" for BST_TASK_DONE, and so on. */
const char *bst_task_end_name(int end);

#pragma GCC visibility pop

#endif
