/* Removes from the stacked frames: charge at the same sensor pixels of all frames, sources at rest
 * among the stars, and the light of detected objects. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "imgproc/stack/stack_internal.h"
#include "sim/core/heapsort.h"

/* Charge: SNR of the pixel's own sum over the frames, and the deficit of its neighbours against a
 * point's. */
static const double CHARGE_SNR = 5.5, CHARGE_SHARP = 4.0;
/* Sources at rest: SNR of the stacked sum at a pixel. */
static const double REST_SNR = 4.5;
/* Light is masked down to this many standard deviations, of the sum or of a frame. */
static const double FADED = 1.5;
enum { REACH_PX = 48 };

/* Masks a disc in an aligned frame. */
static void mask_disc(bst_stack *s, int frame, double x, double y, double radius) {
    int8_t *map = stack_map(s, frame);
    int top = (int)fmax(ceil(y - radius), 0.0), left = (int)fmax(ceil(x - radius), 0.0);
    int bottom = (int)fmin(floor(y + radius), s->height - 1.0);
    int right = (int)fmin(floor(x + radius), s->width - 1.0);
    for (int j = top; j <= bottom; j++) {
        for (int i = left; i <= right; i++) {
            if ((i - x) * (i - x) + (j - y) * (j - y) <= radius * radius) {
                map[(size_t)j * (size_t)s->width + (size_t)i] = STACK_NONE;
            }
        }
    }
}

/* Position of a frame's sensor pixel in the first frame; false if it is out of view. */
static bool frame_to_first(const bst_stack *s, int frame, double x, double y, double *u,
                           double *v) {
    bst_quat turn = bst_quat_mul(s->q[0], bst_quat_conj(s->q[frame]));
    bst_vec3 seen = bst_camera_unproject(&s->camera, s->origin_x_px + s->binning * x,
                                         s->origin_y_px + s->binning * y);
    if (!bst_camera_project(&s->camera, bst_quat_rotate(turn, seen), u, v)) {
        return false;
    }
    *u = (*u - s->origin_x_px) / s->binning;
    *v = (*v - s->origin_y_px) / s->binning;
    return true;
}

/* True if a sensor pixel is sharp and bright in the sum of all frames. */
static bool is_charge(const bst_stack *s, size_t at, double scale) {
    const float *p = s->steady + at;
    double here = (double)p[0] * scale;
    if (!(here > CHARGE_SNR)) {
        return false;
    }
    int w = s->width;
    double beside = 0.25 * scale * ((double)p[-1] + (double)p[1] + (double)p[-w] + (double)p[w]);
    const float *kernel = s->map.kernel + s->map.radius;
    double share = (double)kernel[1] / (double)kernel[0];
    return share * here - beside > CHARGE_SHARP * sqrt(0.25 + share * share);
}

void stack_clean_charge(bst_stack *s) {
    /* filter output of charge in a pixel: at 2.6 sigma exp(-2.6^2 / 4) = 0.18 of its maximum, in
     * whole pixels and one more */
    double scale = 1.0 / sqrt((double)s->count), radius = ceil(2.6 * s->sigma_px) + 1.0;
    for (int y = 1; y + 1 < s->height; y++) {
        for (int x = 1; x + 1 < s->width; x++) {
            if (!is_charge(s, (size_t)y * (size_t)s->width + (size_t)x, scale)) {
                continue;
            }
            for (int i = 0; i < s->count; i++) {
                double u, v;
                if (frame_to_first(s, i, x, y, &u, &v)) {
                    mask_disc(s, i, u, v, radius);
                }
            }
        }
    }
}

typedef struct rest_job {
    bst_stack *s;
    const int *at;
    stack_path *paths;
} rest_job;

/* Sums rows of the aligned frames (loop body). */
static void sum_rows(void *user, int begin, int end) {
    bst_stack *s = user;
    size_t first = (size_t)begin * (size_t)s->width;
    size_t count = (size_t)(end - begin) * (size_t)s->width;
    memset(s->rest + first, 0, count * sizeof *s->rest);
    for (int i = 0; i < s->count; i++) {
        stack_rows_add_bytes(stack_map(s, i) + first, s->rest + first, (int)count);
    }
}

/* Refines the maxima of the sum to paths at rest (loop body). */
static void refine_maxima(void *user, int begin, int end) {
    const rest_job *j = user;
    for (int i = begin; i < end; i++) {
        j->paths[i] = (stack_path){.x = j->at[i] % j->s->width, .y = j->at[i] / j->s->width};
        stack_climb(j->s, &j->paths[i]);
    }
}

/* Maxima of the stacked sum above a level, in row-major order; -1 if there are more than `room`. */
static int find_maxima(const bst_stack *s, int level, int *out, int room) {
    int count = 0;
    long w = s->width;
    for (int y = 1; y + 1 < s->height; y++) {
        for (int x = 1; x + 1 < s->width; x++) {
            const int16_t *p = s->rest + (size_t)y * (size_t)w + (size_t)x;
            int v = p[0];
            if (v <= level || p[-w - 1] >= v || p[-w] >= v || p[-w + 1] >= v || p[-1] >= v ||
                p[1] > v || p[w - 1] > v || p[w] > v || p[w + 1] > v) {
                continue;
            }
            if (count == room) {
                return -1;
            }
            out[count++] = (int)(y * w + x);
        }
    }
    return count;
}

/* Masks the light of a source: pixels connected to (x, y) along which the light does not rise
 * again. frame < 0: by the sum, in all frames; else in that frame. */
static void mask_source_light(bst_stack *s, int frame, int x, int y) {
    int8_t *map = frame < 0 ? NULL : stack_map(s, frame);
    int level = (int)(FADED * STACK_QUANTA * (map ? 1.0 : sqrt((double)s->count)));
    int slack = level / 3, count = 0;
    long w = s->width;
    if (x < 0 || y < 0 || x >= s->width || y >= s->height) {
        return;
    }
    s->visit[count++] = (int)(y * w + x);
    for (int next = 0; next < count; next++) {
        int at = s->visit[next], here = map ? map[at] : s->rest[at];
        int px = (int)(at % w), py = (int)(at / w);
        for (int side = 0; side < 4; side++) {
            int qx = px + (side == 0) - (side == 1), qy = py + (side == 2) - (side == 3);
            if (qx < 0 || qy < 0 || qx >= s->width || qy >= s->height || abs(qx - x) > REACH_PX ||
                abs(qy - y) > REACH_PX || count == STACK_VISITS) {
                continue;
            }
            int to = (int)(qy * w + qx), value = map ? map[to] : s->rest[to];
            if (value > level && value <= here + slack && !s->visited[to]) {
                s->visited[to] = 1;
                s->visit[count++] = to;
            }
        }
    }
    for (int i = 0; i < count; i++) {
        int at = s->visit[i];
        s->visited[at] = 0;
        if (map) {
            map[at] = STACK_NONE;
            continue;
        }
        s->rest[at] = INT16_MIN;
        for (int k = 0; k < s->count; k++) {
            stack_map(s, k)[at] = STACK_NONE;
        }
    }
}

static bool stronger_path(const void *context, int a, int b) {
    const stack_path *p = (const stack_path *)context + a, *q = (const stack_path *)context + b;
    return p->snr != q->snr ? p->snr > q->snr : a < b;
}

int stack_clean_rest(bst_stack *s) {
    bst_parallel_for(s->pool, s->height, 64, sum_rows, s);
    double level = REST_SNR * STACK_QUANTA * sqrt((double)s->count);
    int count;
    while ((count = find_maxima(s, (int)level, s->maxima, STACK_REST)) < 0) {
        /* too many maxima for the list: a threshold raised by a quarter */
        level *= 1.25;
    }
    rest_job job = {s, s->maxima, s->rest_paths};
    bst_parallel_for(s->pool, count, 16, refine_maxima, &job);
    for (int i = 0; i < count; i++) {
        s->order[i] = i;
    }
    bst_heapsort_indices(s->order, count, stronger_path, s->rest_paths);
    int kept = 0;
    /* two outputs of equal sources have one maximum to 2 sqrt(2) sigma; 2.2 sigma, design choice,
     * is well inside */
    double radius = 2.2 * s->sigma_px;
    double seen_by_itself = (double)STACK_VISIBLE / STACK_QUANTA * sqrt((double)s->count);
    for (int i = 0; i < count; i++) {
        int k = s->order[i];
        const stack_path *p = &s->rest_paths[k];
        if (s->rest[s->maxima[k]] == INT16_MIN || !stack_at_rest(s, p)) {
            continue;
        }
        bool counts = p->snr > s->threshold && p->snr < seen_by_itself &&
                      kept < BST_STACK_MAX_FOUND && stack_holds(s, p);
        mask_source_light(s, -1, s->maxima[k] % s->width, s->maxima[k] / s->width);
        for (int f = 0; f < s->count; f++) {
            mask_disc(s, f, p->x, p->y, radius);
        }
        if (counts) {
            s->paths[kept++] = *p;
        }
    }
    return kept;
}

void stack_clean_path(bst_stack *s, const stack_path *p) {
    /* filter output of the source: at 3.2 sigma exp(-3.2^2 / 4) = 0.08 of its maximum */
    double radius = 3.2 * s->sigma_px;
    for (int i = 0; i < s->count; i++) {
        double x = p->x + p->vx * s->tau[i], y = p->y + p->vy * s->tau[i];
        mask_source_light(s, i, (int)floor(x + 0.5), (int)floor(y + 0.5));
        mask_disc(s, i, x, y, radius);
    }
}
