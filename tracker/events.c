/* Manoeuvres and changes of brightness, told from the innovations of a track. */
#include "tracker/multitarget_internal.h"

/* Probability that one test may call a false event: tests come once per hit, and the chance that
 * any of them does is at most their sum. */
static double test_probability(const bst_mtt_params *params, double dt_s) {
    return fmin(0.5, params->false_events_per_hour * dt_s / 3600.0);
}

static bool is_told(const bst_mtt_params *params) {
    return params->event_window > 0 && params->false_events_per_hour > 0.0;
}

bool bst_mtt_note_innovation(const bst_mtt_params *params, bst_mtt_track *track,
                             const bst_sky_innovation *innovation, double dt_s, double *statistic) {
    if (!is_told(params)) {
        return false;
    }
    int window = params->event_window;
    /* whitened by the Cholesky factor of S */
    double l11 = sqrt(innovation->s[0]), l21 = innovation->s[1] / l11;
    double l22 = sqrt(innovation->s[2] - l21 * l21);
    double *slot = track->innovations[track->innovation_count % window];
    slot[0] = innovation->nu[0] / l11;
    slot[1] = (innovation->nu[1] - l21 * slot[0]) / l22;
    track->innovation_count++;
    int n = track->innovation_count < window ? track->innovation_count : window;
    double sum[2] = {0.0, 0.0};
    for (int i = 0; i < n; i++) {
        sum[0] += track->innovations[i][0];
        sum[1] += track->innovations[i][1];
    }
    *statistic = (sum[0] * sum[0] + sum[1] * sum[1]) / n;
    /* exp(-x/2) is the tail of chi-square with 2 degrees of freedom */
    if (exp(-0.5 * *statistic) >= test_probability(params, dt_s)) {
        return false;
    }
    track->innovation_count = 0;
    return true;
}

bool bst_mtt_note_brightness(const bst_mtt_params *params, bst_mtt_track *track, double z,
                             double dt_s, double *statistic) {
    if (!is_told(params)) {
        return false;
    }
    int window = params->event_window;
    track->brightness[track->brightness_count++ % window] = z;
    int n = track->brightness_count < window ? track->brightness_count : window;
    double sum = 0.0;
    for (int i = 0; i < n; i++) {
        sum += track->brightness[i];
    }
    *statistic = sum * sum / n;
    if (erfc(sqrt(0.5 * *statistic)) >= test_probability(params, dt_s)) {
        return false;
    }
    track->brightness_count = 0;
    return true;
}
