#include <math.h>

#include "imgproc/stack/stack_internal.h"

/* A signal from fewer frames than this share of the stack is chance: cosmic rays in a line. */
static const double CHANCE_SHARE = 0.375;
/* Squared rate over its variance above which a source moves. Stars, far more numerous than slow
 * objects, exceed it once in 270,000. */
static const double REST_MOTION2 = 25.0;

/* Value of an aligned frame at a position; false without a measurement. */
static bool sample_frame(const bst_stack *s, int frame, double x, double y, float *out) {
    double fx = floor(x), fy = floor(y);
    if (!(fx >= 1.0 && fy >= 1.0 && fx < s->width - 2.0 && fy < s->height - 2.0)) {
        return false;
    }
    const float *wx = s->weight[(int)((x - fx) * STACK_PHASES + 0.5)];
    const float *wy = s->weight[(int)((y - fy) * STACK_PHASES + 0.5)];
    const int8_t *at = stack_map(s, frame) + ((long)fy - 1) * s->width + (long)fx - 1;
    float sum = 0.0f;
    int none = 0;
    for (int j = 0; j < 4; j++, at += s->width) {
        none |= (at[0] == STACK_NONE) | (at[1] == STACK_NONE) | (at[2] == STACK_NONE) |
                (at[3] == STACK_NONE);
        sum += wy[j] * (wx[0] * (float)at[0] + wx[1] * (float)at[1] + wx[2] * (float)at[2] +
                        wx[3] * (float)at[3]);
    }
    *out = sum;
    return !none;
}

double stack_sum(const bst_stack *s, const stack_path *p, int clamp, int *frames) {
    float sum = 0.0f, most = (float)clamp;
    int n = 0;
    for (int i = 0; i < s->count; i++) {
        float v;
        if (sample_frame(s, i, p->x + p->vx * s->tau[i], p->y + p->vy * s->tau[i], &v)) {
            sum += v > most ? most : v;
            n++;
        }
    }
    *frames = n;
    return 2 * n < s->count ? 0.0 : (double)sum / (STACK_QUANTA * sqrt((double)n));
}

/* Coordinate k of a path: x, y, vx, vy. */
static double *coordinate(stack_path *p, int k) {
    return k == 0 ? &p->x : k == 1 ? &p->y : k == 2 ? &p->vx : &p->vy;
}

/* Limits a path to the frame and to the searched rates. */
static void limit_path(const bst_stack *s, stack_path *p) {
    double rate = s->config.rate_px_per_frame;
    p->x = fmin(fmax(p->x, 0.0), s->width - 1.0);
    p->y = fmin(fmax(p->y, 0.0), s->height - 1.0);
    p->vx = fmin(fmax(p->vx, -rate), rate);
    p->vy = fmin(fmax(p->vy, -rate), rate);
}

/* Maximises the stacked sum: each round fits a parabola along each of the four coordinates, whose
 * gradients are uncorrelated. It moves to all four vertices together, or to the best sampled point
 * if that is higher. */
static void maximise_sum(const bst_stack *s, stack_path *p, int clamp) {
    enum { ROUNDS = 8 };
    double steps[4];
    steps[0] = steps[1] = 0.6 / sqrt(s->roughness);
    steps[2] = steps[3] = steps[0] / sqrt(s->time_variance);
    p->snr = stack_sum(s, p, clamp, &p->frames);
    for (int round = 0; round < ROUNDS; round++) {
        stack_path top = *p, best = *p;
        for (int k = 0; k < 4; k++) {
            double side[2], h = steps[k];
            for (int e = 0; e < 2; e++) {
                stack_path at = *p;
                *coordinate(&at, k) += e ? h : -h;
                limit_path(s, &at);
                side[e] = at.snr = stack_sum(s, &at, clamp, &at.frames);
                best = at.snr > best.snr ? at : best;
            }
            double bend = side[0] - 2.0 * p->snr + side[1], move = side[1] > side[0] ? h : -h;
            if (bend < 0.0) {
                move = fmin(fmax(0.5 * h * (side[0] - side[1]) / bend, -h), h);
            }
            *coordinate(&top, k) += move;
        }
        limit_path(s, &top);
        top.snr = stack_sum(s, &top, clamp, &top.frames);
        best = top.snr > best.snr ? top : best;
        double gain = best.snr - p->snr;
        *p = best;
        /* a gain below 0.02 sigma changes no decision by more than 0.02 / sqrt(2 pi) = 0.8 % */
        if (gain < 0.02) {
            for (int k = 0; k < 4; k++) {
                steps[k] *= 0.4;
            }
            if (steps[0] * sqrt(s->roughness) < 0.08) {
                break;
            }
        }
    }
}

/* Number of frames in which a path is visible by itself, and the sum without them. */
static int count_visible(const bst_stack *s, const stack_path *p, double *without) {
    float sum = 0.0f;
    int n = 0, seen = 0;
    for (int i = 0; i < s->count; i++) {
        float v;
        if (sample_frame(s, i, p->x + p->vx * s->tau[i], p->y + p->vy * s->tau[i], &v)) {
            bool bright = v > (float)STACK_VISIBLE;
            seen += bright;
            n += !bright;
            sum += bright ? 0.0f : v;
        }
    }
    *without = n > 0 ? (double)sum / (STACK_QUANTA * sqrt((double)n)) : 0.0;
    return seen;
}

void stack_climb(const bst_stack *s, stack_path *p) {
    maximise_sum(s, p, STACK_VISIBLE);
    double without;
    if (count_visible(s, p, &without) >= CHANCE_SHARE * s->count) {
        maximise_sum(s, p, STACK_CLAMP);
    }
}

bool stack_holds(const bst_stack *s, const stack_path *p) {
    double without;
    int seen = count_visible(s, p, &without);
    return seen == 0 || seen >= CHANCE_SHARE * s->count || without > s->threshold;
}

bool stack_at_rest(const bst_stack *s, const stack_path *p) {
    double precision = s->roughness * s->time_variance * p->snr * p->snr;
    return (p->vx * p->vx + p->vy * p->vy) * precision < REST_MOTION2;
}
