/* Detection of manoeuvres and brightness changes from the innovations of a track. */
#include "tracker/mtt/multitarget_internal.h"

/* True if event detection is enabled. */
static bool is_enabled(const bst_mtt_params *params) {
    return params->event_window > 0 && params->false_events_per_hour > 0.0;
}

double bst_mtt_event_probability(const bst_mtt_params *params, double dt_s) {
    if (!is_enabled(params)) {
        return 0.0;
    }
    int tests = 0;
    for (int n = 1; n <= params->event_window; n *= 2) {
        tests++;
    }
    return fmin(0.5, params->false_events_per_hour * dt_s / 3600.0 / tests);
}

bool bst_mtt_note_innovation(const bst_mtt_params *params, bst_mtt_track *track,
                             const bst_sky_innovation *innovation, double dt_s, double *statistic) {
    if (!is_enabled(params)) {
        return false;
    }
    int window = params->event_window, count = ++track->innovation_count;
    /* innovation whitened by the Cholesky factor of S */
    double l11 = sqrt(innovation->s[0]), l21 = innovation->s[1] / l11;
    double l22 = sqrt(innovation->s[2] - l21 * l21);
    double *slot = track->innovations[(count - 1) % window];
    slot[0] = innovation->nu[0] / l11;
    slot[1] = (innovation->nu[1] - l21 * slot[0]) / l22;
    double allowed = bst_mtt_event_probability(params, dt_s), sum[2] = {0.0, 0.0};
    for (int n = 1, test = 1; n <= window && n <= count; n++) {
        const double *z = track->innovations[(count - n) % window];
        sum[0] += z[0];
        sum[1] += z[1];
        if (n != test) {
            continue;
        }
        test *= 2;
        *statistic = (sum[0] * sum[0] + sum[1] * sum[1]) / n;
        /* exp(-x/2) is the tail probability of chi-square with 2 degrees of freedom */
        if (exp(-0.5 * *statistic) < allowed) {
            track->innovation_count = 0;
            return true;
        }
    }
    return false;
}

bool bst_mtt_note_brightness(const bst_mtt_params *params, bst_mtt_track *track, double z,
                             double dt_s, double *statistic) {
    if (!is_enabled(params)) {
        return false;
    }
    int window = params->event_window, count = ++track->brightness_count;
    track->brightness[(count - 1) % window] = z;
    double allowed = bst_mtt_event_probability(params, dt_s), sum = 0.0;
    for (int n = 1, test = 1; n <= window && n <= count; n++) {
        sum += track->brightness[(count - n) % window];
        if (n != test) {
            continue;
        }
        test *= 2;
        *statistic = sum * sum / n;
        if (erfc(sqrt(0.5 * *statistic)) < allowed) {
            track->brightness_count = 0;
            return true;
        }
    }
    return false;
}
