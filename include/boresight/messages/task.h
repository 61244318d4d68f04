/* Channel task: the object that a sensor shall search for. */
#ifndef BORESIGHT_MESSAGES_TASK_H
#define BORESIGHT_MESSAGES_TASK_H

#include <stdint.h>

#pragma GCC visibility push(default)

#define BST_CHANNEL_TASK "task"

/* How a task ended. */
typedef enum bst_task_end {
    BST_TASK_NONE = 0,  /* no task before, or the sensor's own cue */
    BST_TASK_DONE,      /* the target was seen as often as required */
    BST_TASK_NOT_FOUND, /* it was not found in time */
    BST_TASK_LOST,      /* it was found, then lost */
    BST_TASK_END_COUNT
} bst_task_end;

/* task (latest): object that a sensor searches for from now on, written by the tasking module. The
 * sensor's own cue applies before the first task and for object -1. */
typedef struct bst_task {
    int64_t id;     /* 1, 2, ... per sensor; modules restart with a new task; 0: no task */
    int64_t tick;   /* time of assignment */
    int32_t object; /* in the onboard catalogue (bst_knowledge_object_count), -1: the own cue */
    int32_t norad;  /* its catalogue number, 0: none */
    double sigma_rad, rate_sigma_radps; /* errors of its position and rate, 1 sigma per axis;
                                           0: as the own cue's */
    double v_mag, v_mag_sigma;          /* expected brightness; sigma 0: as the own cue's */
    double snr;                         /* expected in a frame, 0: unknown */
    int32_t before;                     /* bst_task_end of the previous task */
} bst_task;

/* Name of a bst_task_end ("done" for BST_TASK_DONE); "unknown" for other numbers. Never NULL. */
const char *bst_task_end_name(int end);

#pragma GCC visibility pop

#endif
