/* State of a live run, shared by live_run.c (stepping and states) and live_commands.c. */
#ifndef BST_VIEW_LIVE_INTERNAL_H
#define BST_VIEW_LIVE_INTERNAL_H

#include <pthread.h>

#include "view/live_run.h"

enum { BST_VIEW_LIVE_STATES = 24, BST_VIEW_LIVE_COMMANDS = 16 };

/* A saved state to which the run can go back. */
typedef struct bst_view_state {
    int64_t id, tick;
    void *bytes;
    size_t size;
    int made;        /* changes before it */
    const char *why; /* "start", "pause", "change", "saved", "automatic" */
} bst_view_state;

struct bst_view_live {
    pthread_mutex_t lock; /* of all below but `parts`, which the stepping thread alone uses */
    pthread_cond_t commanded;
    bst_run_parts *parts; /* NULL: another caller steps the run */
    bst_run_steering steering;
    bst_view_subject *subject;
    bst_view_feed *feed;
    bst_ctx ctx; /* for messages of commands */
    char out[4096];
    int64_t run; /* number of the subject's run; -1: not open yet */
    double tick_rate_hz, duration_s;
    int64_t period_ticks; /* of the first sensor's frames */
    const char *counted;  /* channel that ends a frame of the first sensor */
    cJSON *commands[BST_VIEW_LIVE_COMMANDS];
    int command_count;
    int64_t obeyed; /* commands so far */
    /* how it goes on */
    bool paused, settled; /* settled: the state at the pause is saved */
    double rate;          /* x real time; 0: flat out */
    int64_t steps;        /* frames to go until the pause; 0: none */
    int64_t frames;       /* of the first sensor so far; atomic */
    int64_t frames_then;  /* at the last look */
    double anchor_s;      /* wall time at which the rate began */
    int64_t anchor_tick, chunk_ticks;
    double asked_s; /* wall time of the last advance */
    /* where it is */
    int64_t tick, until_tick, speed_tick; /* until_tick: of the last advance */
    double speed_s, speed;                /* x real time, over about a second */
    bool ended, branching;
    bool opened;               /* a watched run's folder */
    bool part_begun;           /* the part has begun to step */
    void (*begun)(void *user); /* called when the first part has begun; NULL: it was */
    void *begun_user;
    int64_t go_to;                   /* id of the state to go to; 0: none */
    char message[BST_MESSAGE_BYTES]; /* of the last command; "": it was obeyed */
    char *scenario;                  /* text at the time of the run */
    /* states, in the order of time */
    bst_view_state states[BST_VIEW_LIVE_STATES];
    int state_count, made; /* made: changes of the part in progress */
    int64_t next_id;
    double saved_s; /* wall time of the last state */
    const char *why;
};

/* Obeys the first command that waits. Call it with the lock held, by the stepping thread.
 *
 * Returned:  *action  what the run does next
 *            false: the command needs none */
bool bst_view_live_obey(bst_view_live *live, int64_t tick, bst_run_action *action);

/* A state by its id; NULL: none. */
const bst_view_state *bst_view_live_find(const bst_view_live *live, int64_t id);

/* Begins to count simulated time against the wall clock. */
void bst_view_live_anchor(bst_view_live *live);

#endif
