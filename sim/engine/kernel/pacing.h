/* How simulated time goes by the wall clock. No simulated quantity depends on the clock but through
 * what is lost when it is not kept: frames that are dropped, answers of peers that are not awaited.
 */
#ifndef BST_ENGINE_KERNEL_PACING_H
#define BST_ENGINE_KERNEL_PACING_H

#include "boresight/config.h"

typedef enum bst_pacing_mode {
    BST_PACING_LOCKSTEP, /* as quickly as the work and the answers of peers allow */
    BST_PACING_REALTIME, /* not before its time by the wall clock */
    BST_PACING_FAST,     /* as quickly as the work allows; peers are not waited for */
} bst_pacing_mode;

/* What happens when the run is behind its clock by more than the deadline. */
typedef enum bst_overrun {
    BST_OVERRUN_SLIP, /* the clock is set back by as much: all that follows is due later */
    BST_OVERRUN_DROP, /* frames are lost until the run has caught up */
    BST_OVERRUN_HOLD, /* all frames are made, late; a peer is not waited for beyond the deadline */
} bst_overrun;

/* A scenario's "pacing". */
typedef struct bst_pacing_config {
    int32_t mode;      /* bst_pacing_mode */
    int32_t overrun;   /* bst_overrun */
    double speed;      /* simulated seconds per second of the clock */
    double deadline_s; /* of wall time; 0: a frame period */
    int64_t priority;  /* SCHED_FIFO, 0: none */
    int64_t cpu;       /* processor of the stepping thread; -1: any */
    bool replay;       /* not in the table: no clock; drops come from a link's recording */
} bst_pacing_config;

extern const bst_config_desc bst_pacing_config_table[];
/* Name of a pacing mode, as scenarios write it. */
const char *bst_pacing_mode_name(int32_t mode);
/* Name of an overrun policy, as scenarios write it. */
const char *bst_overrun_name(int32_t overrun);

enum { BST_PACING_BINS = 16 };
/* Upper ends of the bins of the histogram in milliseconds; the last bin has none. */
extern const double bst_pacing_edges_ms[BST_PACING_BINS - 1];

/* Timing of a paced run. The response of a frame is the wall time from when its readers may see it
 * (end of exposure plus declared delay) until its detections are published, or, without detections,
 * until the frame is. With BST_PACING_FAST there are no overruns, and the response counts from the
 * frame's publication. */
typedef struct bst_pacing_figures {
    int64_t frames;  /* exposures that ended, dropped ones too */
    int64_t dropped; /* of these, by the overrun policy */
    int64_t done;    /* responses */
    int64_t late;    /* of these, beyond the deadline */
    int64_t overruns;
    double slipped_s;  /* total by which the clock was set back */
    double longest_s;  /* response */
    double sum_s;      /* of all responses */
    double deadline_s; /* the longest that was used */
    int64_t histogram[BST_PACING_BINS];
    bool priority, cpu; /* were granted */
} bst_pacing_figures;

#endif
