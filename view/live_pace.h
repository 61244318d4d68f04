/* How many pictures a second are taken of a live run for those who watch it. Pictures cost the run
 * processor time, most of all in a browser on the same machine. So they are few while all
 * processors are busy, and as many as a screen shows while some are idle. */
#ifndef BST_VIEW_LIVE_PACE_H
#define BST_VIEW_LIVE_PACE_H

#include <stdbool.h>
#include <stdint.h>

/* Least and most pictures a second. A run that makes fewer frames is shown whole. A picture is
 * taken when the one before has been sent, so what is taken is shown: at least 15. */
#define BST_VIEW_PICTURES_LEAST 15.6
#define BST_VIEW_PICTURES_MOST 50.0

/* Time of the processors since the machine has started, in any unit. */
typedef struct bst_view_processor_time {
    double idle, all;
} bst_view_processor_time;

/* Zero to begin with. */
typedef struct bst_view_pace {
    double pictures_hz; /* 0: the least */
    double due_s;       /* wall time from which the next picture is due */
    double looked_s;    /* wall time of the last look at the processors */
    bst_view_processor_time then;
} bst_view_pace;

/* Takes a picture if one is due: on average as many as `pictures_hz`, at frames that come now.
 *
 * Given:     now_s  wall time
 * Returned:  true: the frame is taken */
bool bst_view_pace_take(bst_view_pace *pace, double now_s);
/* Adapts the pictures to how busy the processors have been since the last look; at most once a
 * second, else nothing happens.
 *
 * Given:     read  reads the time of the processors; false: unknown, and the pictures stay */
void bst_view_pace_adapt(bst_view_pace *pace, double now_s,
                         bool (*read)(bst_view_processor_time *out));
/* Reads the time of the processors from /proc/stat. */
bool bst_view_read_processors(bst_view_processor_time *out);

#endif
