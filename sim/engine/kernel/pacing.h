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
    int64_t cpu;       /* that the stepping thread stays on; -1: any */
    bool replay;       /* not by the table: there is no clock, a link's recording tells of drops */
} bst_pacing_config;

extern const bst_config_desc bst_pacing_config_table[];
/* Name of a pacing mode, as scenarios write it. */
const char *bst_pacing_mode_name(int32_t mode);
/* Name of an overrun policy, as scenarios write it. */
const char *bst_overrun_name(int32_t overrun);

enum { BST_PACING_BINS = 16 };
/* Upper ends of the bins of the histogram in milliseconds; the last bin has none. */
extern const double bst_pacing_edges_ms[BST_PACING_BINS - 1];

/* How the clock was kept. A frame's response is the wall time from when it was due to those who
 * read it (its exposure's end and the declared delay) until their detections were there; without
 * any, until it was made. Where time is not kept by the clock (BST_PACING_FAST) nothing is an
 * overrun, and a response is the wall time from when the frame was made. */
typedef struct bst_pacing_figures {
    int64_t frames;  /* exposures that ended, dropped ones too */
    int64_t dropped; /* of these, by the overrun policy */
    int64_t done;    /* responses */
    int64_t late;    /* of these, beyond the deadline */
    int64_t overruns;
    double slipped_s;  /* by how much the clock has been set back */
    double longest_s;  /* response */
    double sum_s;      /* of all responses */
    double deadline_s; /* the longest that was used */
    int64_t histogram[BST_PACING_BINS];
    bool priority, cpu; /* were granted */
} bst_pacing_figures;

#endif
