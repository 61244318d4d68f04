/* Components of a simulation's state, for saving and restoring in parts. */
#ifndef BORESIGHT_STATE_H
#define BORESIGHT_STATE_H

/* Parts of a state; a channel belongs to the component of the module that writes it. */
typedef enum bst_state_component {
    BST_STATE_PLANT = 1 << 0,   /* gimbal, spacecraft, detector or observation generator, injected
                                   states of objects */
    BST_STATE_ONBOARD = 1 << 1, /* image processing, tracker, control, tasking */
    BST_STATE_RANDOM = 1 << 2,  /* seed and run number, which key all random streams */
    BST_STATE_TIME = 1 << 3,    /* the clock, exposures, counters */
    BST_STATE_ALL = (1 << 4) - 1,
} bst_state_component;

#endif
