#include "view/live_pace.h"

#include <math.h>
#include <stdio.h>

/* Time between two looks at the processors, s. */
static const double LOOK_S = 1.0;
/* Shares of idle time above and below which there are more and fewer pictures. A picture of the
 * main scenario costs some 15 ms in a browser without a graphics processor (docs/results/view.md):
 * a step from 16 to 20 a second costs 3 % of two processors, one from 40 to 50 costs 8 %, less than
 * the distance of the shares. So a step does not cause the step back. */
static const double IDLE_SHARE = 0.35;
static const double BUSY_SHARE = 0.25;
/* Factors by which they become more and fewer. */
static const double MORE = 1.25;
static const double FEWER = 0.7;

bool bst_view_pace_take(bst_view_pace *pace, double now_s) {
    if (now_s < pace->due_s) {
        return false;
    }
    const double interval_s = 1.0 / fmax(pace->pictures_hz, BST_VIEW_PICTURES_LEAST);
    /* counted from when it was due: frames come some time later. One that was late is made up for,
     * those of a gap are not */
    pace->due_s = fmax(pace->due_s + interval_s, now_s - interval_s);
    return true;
}

void bst_view_pace_adapt(bst_view_pace *pace, double now_s,
                         bool (*read)(bst_view_processor_time *out)) {
    bst_view_processor_time now;
    if (now_s - pace->looked_s < LOOK_S) {
        return;
    }
    pace->looked_s = now_s;
    if (!read(&now)) {
        return;
    }
    const double all = now.all - pace->then.all, idle = now.idle - pace->then.idle;
    if (pace->then.all > 0.0 && all > 0.0) {
        const double share = idle / all;
        const double factor = share > IDLE_SHARE ? MORE : share < BUSY_SHARE ? FEWER : 1.0;
        pace->pictures_hz =
            fmin(fmax(pace->pictures_hz * factor, BST_VIEW_PICTURES_LEAST), BST_VIEW_PICTURES_MOST);
    }
    pace->then = now;
}

bool bst_view_read_processors(bst_view_processor_time *out) {
    /* user, nice, system, idle, iowait, irq, softirq, steal: proc(5) */
    double t[8] = {0.0};
    FILE *file = fopen("/proc/stat", "r");
    const int found = file ? fscanf(file, "cpu %lf %lf %lf %lf %lf %lf %lf %lf", &t[0], &t[1],
                                    &t[2], &t[3], &t[4], &t[5], &t[6], &t[7])
                           : 0;
    if (file) {
        fclose(file);
    }
    *out = (bst_view_processor_time){.idle = t[3] + t[4]};
    for (int i = 0; i < 8; i++) {
        out->all += t[i];
    }
    return found >= 4;
}
