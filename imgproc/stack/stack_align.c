#include <math.h>
#include <string.h>

#include "imgproc/stack/stack_internal.h"

/* Cubic convolution weights of four samples (Keys 1981, a = -1/2). */
static void cubic_weights(double f, double w[4]) {
    w[0] = ((-0.5 * f + 1.0) * f - 0.5) * f;
    w[1] = (1.5 * f - 2.5) * f * f + 1.0;
    w[2] = ((-1.5 * f + 2.0) * f + 0.5) * f;
    w[3] = (0.5 * f - 0.5) * f * f;
}

/* Variance of a weighted sum of samples with this autocorrelation. */
static double interpolated_variance(const double w[4], const double correlation[64]) {
    double sum = 0.0;
    for (int i = 0; i < 4; i++) {
        for (int j = 0; j < 4; j++) {
            sum += w[i] * w[j] * correlation[i > j ? i - j : j - i];
        }
    }
    return sum;
}

void stack_set_interpolation(bst_stack *s, double sigma_px, const double correlation[64]) {
    if (s->weight_sigma == sigma_px) {
        return;
    }
    s->weight_sigma = sigma_px;
    double before[4] = {0}, metric = 0.0;
    for (int p = 0; p <= STACK_PHASES; p++) {
        double w[4], step[4];
        cubic_weights((double)p / STACK_PHASES, w);
        double norm = sqrt(interpolated_variance(w, correlation));
        for (int i = 0; i < 4; i++) {
            w[i] /= norm;
            s->weight[p][i] = (float)w[i];
            step[i] = (w[i] - before[i]) * STACK_PHASES;
            before[i] = w[i];
        }
        metric += p > 0 ? interpolated_variance(step, correlation) / STACK_PHASES : 0.0;
    }
    s->roughness = metric;
}

/* Shift of the alignment grid's nodes from the first frame to frame `f`. */
static void set_node_shifts(bst_stack *s, const bst_stack_frame *f) {
    int columns = s->width / STACK_NODE_PX + 2, rows = s->height / STACK_NODE_PX + 2;
    bst_quat turn = bst_quat_mul(f->q_cam_from_gcrf, bst_quat_conj(s->q[0]));
    for (int j = 0; j < rows; j++) {
        for (int i = 0; i < columns; i++) {
            double x = f->origin_x_px + f->binning * i * STACK_NODE_PX;
            double y = f->origin_y_px + f->binning * j * STACK_NODE_PX, u, v;
            bst_vec3 seen = bst_quat_rotate(turn, bst_camera_unproject(&s->camera, x, y));
            int k = j * columns + i;
            bool ahead = bst_camera_project(&s->camera, seen, &u, &v);
            s->node_x[k] = ahead ? (u - x) / f->binning : 1e6;
            s->node_y[k] = ahead ? (v - y) / f->binning : 1e6;
        }
    }
}

/* Shift at the middle of a row segment, interpolated between alignment nodes. */
static void shift_at(const bst_stack *s, int node, int y, double out[2]) {
    int columns = s->width / STACK_NODE_PX + 2;
    int k = y / STACK_NODE_PX * columns + node;
    double v = (double)(y % STACK_NODE_PX) / STACK_NODE_PX;
    const double *const of[2] = {s->node_x, s->node_y};
    for (int a = 0; a < 2; a++) {
        const double *n = of[a] + k;
        out[a] = 0.5 * ((1.0 - v) * (n[0] + n[1]) + v * (n[columns] + n[columns + 1]));
    }
}

/* SNR as 8-bit quanta. */
static int8_t quantise(float v) {
    v = v > (float)STACK_CLAMP ? (float)STACK_CLAMP : v < -127.0f ? -127.0f : v;
    return (int8_t)((int)(v + 256.5f) - 256);
}

typedef struct align_job {
    bst_stack *s;
    int8_t *out;
    bool shifted;
} align_job;

/* True for pixels of the frame whose filter support does not extend far beyond it. */
static bool is_inside(int at, int size) {
    return at >= 1 && at < size - 1;
}

/* Copies a row segment aligned to whole pixels. */
static void copy_segment(const bst_stack *s, int x0, int count, int from_x, int from_y,
                         int8_t *out) {
    const int16_t *in = bst_streak_map_plane(&s->map, 0) + (long)from_y * s->map.stride[0];
    for (int x = x0; x < x0 + count; x++) {
        int at = x + from_x;
        int v = is_inside(at, s->width) && is_inside(from_y, s->height) ? in[at] : STACK_NONE;
        out[x] = (int8_t)(v > STACK_CLAMP ? STACK_CLAMP : v < STACK_NONE ? STACK_NONE : v);
    }
}

/* Interpolates a row segment at a sub-pixel shift. */
static void interpolate_segment(const bst_stack *s, int x0, int count, int y, const double shift[2],
                                int8_t *out) {
    double fx = floor(shift[0]), fy = floor(shift[1]);
    int ix = (int)fx, iy = y + (int)fy;
    const float *wx = s->weight[(int)((shift[0] - fx) * STACK_PHASES + 0.5)];
    const float *wy = s->weight[(int)((shift[1] - fy) * STACK_PHASES + 0.5)];
    long stride = s->map.stride[0];
    const int16_t *in = bst_streak_map_plane(&s->map, 0) + (long)(iy - 1) * stride;
    if (!is_inside(iy, s->height - 1) || x0 + count - 1 + ix < 1 || x0 + ix >= s->width - 2) {
        memset(out + x0, STACK_NONE, (size_t)count);
        return;
    }
    float column[STACK_NODE_PX + 3], mixed[STACK_NODE_PX];
    int first = x0 + ix - 1;
    first = first < -BST_STREAK_PAD ? -BST_STREAK_PAD : first;
    for (int k = 0; k < count + 3; k++) {
        long at = first + k < s->width + BST_STREAK_PAD ? first + k : s->width;
        column[k] = wy[0] * (float)in[at] + wy[1] * (float)in[at + stride] +
                    wy[2] * (float)in[at + 2 * stride] + wy[3] * (float)in[at + 3 * stride];
    }
    for (int k = 0; k < count; k++) {
        mixed[k] = wx[0] * column[k] + wx[1] * column[k + 1] + wx[2] * column[k + 2] +
                   wx[3] * column[k + 3];
    }
    for (int k = 0; k < count; k++) {
        out[x0 + k] = is_inside(x0 + k + ix, s->width - 1) ? quantise(mixed[k]) : STACK_NONE;
    }
}

/* Aligns rows begin to end - 1 of a frame with the first frame (loop body). */
static void align_rows(void *user, int begin, int end) {
    const align_job *j = user;
    const bst_stack *s = j->s;
    for (int y = begin; y < end; y++) {
        int8_t *out = j->out + (size_t)y * (size_t)s->width;
        if (!j->shifted) {
            copy_segment(s, 0, s->width, 0, y, out);
            continue;
        }
        for (int node = 0; node * STACK_NODE_PX < s->width; node++) {
            double shift[2];
            int x0 = node * STACK_NODE_PX;
            int count = s->width - x0 < STACK_NODE_PX ? s->width - x0 : STACK_NODE_PX;
            shift_at(s, node, y, shift);
            if (fabs(shift[0]) > s->width || fabs(shift[1]) > s->height) {
                memset(out + x0, STACK_NONE, (size_t)count);
            } else {
                interpolate_segment(s, x0, count, y, shift, out);
            }
        }
    }
}

void stack_align(bst_stack *s, const bst_stack_frame *f, int number) {
    /* a shift that interpolation may omit: it lowers a sum of many frames by less than 1e-4 */
    static const double AT_REST_PX = 0.005;
    const bst_streak_map_input input = {f->signal, f->width, f->height, f->background, f->sigma_px};
    bst_streak_map_filter(&s->map, s->pool, &input, STACK_CLAMP, s->steady);
    stack_set_interpolation(s, f->sigma_px, s->map.correlation);
    align_job job = {s, stack_map(s, number), false};
    if (number > 0) {
        set_node_shifts(s, f);
        int nodes = (s->width / STACK_NODE_PX + 2) * (s->height / STACK_NODE_PX + 2);
        for (int k = 0; k < nodes && !job.shifted; k++) {
            job.shifted = fabs(s->node_x[k]) > AT_REST_PX || fabs(s->node_y[k]) > AT_REST_PX;
        }
    }
    bst_parallel_for(s->pool, s->height, 64, align_rows, &job);
}
