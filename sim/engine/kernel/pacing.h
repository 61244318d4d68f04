/* Pacing of a run by the wall clock. The clock affects the simulation only through overruns:
 * dropped frames, and answers of peers that are not awaited. */
#ifndef BST_ENGINE_KERNEL_PACING_H
#define BST_ENGINE_KERNEL_PACING_H

#include "boresight/config.h"

typedef enum bst_pacing_mode {
    BST_PACING_LOCKSTEP, /* as fast as possible; waits for answers of peers */
    BST_PACING_REALTIME, /* ticks wait for their wall-clock time */
    BST_PACING_FAST,     /* as fast as possible; does not wait for peers */
} bst_pacing_mode;

/* Policy when the run is behind the wall clock by more than the deadline. */
typedef enum bst_overrun {
    BST_OVERRUN_SLIP, /* shift the clock: all later ticks are due later */
    BST_OVERRUN_DROP, /* drop frames until the run has caught up */
    BST_OVERRUN_HOLD, /* process all frames late; do not wait for a peer beyond the deadline */
} bst_overrun;

/* The "pacing" block of a scenario. */
typedef struct bst_pacing_config {
    int32_t mode;      /* bst_pacing_mode */
    int32_t overrun;   /* bst_overrun */
    double speed;      /* simulated seconds per second of wall time */
    double deadline_s; /* seconds of wall time; 0: a frame period */
    int64_t priority;  /* SCHED_FIFO priority; 0: none */
    int64_t cpu;       /* processor to which the stepping thread is bound; -1: any */
    bool replay; /* not in the table: no clock; dropped frames come from the recording of a link */
} bst_pacing_config;

extern const bst_config_desc bst_pacing_config_table[];
/* Name of a pacing mode, as in scenarios. */
const char *bst_pacing_mode_name(int32_t mode);
/* Name of an overrun policy, as in scenarios. */
const char *bst_overrun_name(int32_t overrun);

enum { BST_PACING_BINS = 16 };
/* Upper limits of the histogram's bins in ms; the last bin is unbounded. */
extern const double bst_pacing_edges_ms[BST_PACING_BINS - 1];

/* Timing of a paced run. The response of a frame is the wall time from when its readers may see it
 * (end of exposure plus declared delay) until its detections are published, or the frame if there
 * are no detections. With BST_PACING_FAST there are no overruns, and the response counts from the
 * frame's publication. */
typedef struct bst_pacing_figures {
    int64_t frames;  /* exposures that ended, including dropped ones */
    int64_t dropped; /* dropped by the overrun policy */
    int64_t done;    /* number of response times */
    int64_t late;    /* responses beyond the deadline */
    int64_t overruns;
    double slipped_s;  /* total shift of the clock */
    double longest_s;  /* longest response */
    double sum_s;      /* sum of all responses */
    double deadline_s; /* longest deadline in use */
    int64_t histogram[BST_PACING_BINS];
    bool priority, cpu; /* granted by the operating system */
} bst_pacing_figures;

#endif
