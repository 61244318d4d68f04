/* Sums along paths through a stack that is filled by hand: each value, weight, phase and frame time
 * differs, so that a place taken for another shows. */
#include <stdlib.h>

#include "imgproc/stack/stack_internal.h"
#include "tests/test_support.h"

enum { WIDTH = 60, HEIGHT = 44, MOST_WIDTH = 64, MOST_HEIGHT = 48, FRAMES = 12 };

static uint32_t draw(uint32_t *s) {
    *s = *s * 1664525u + 1013904223u;
    return *s >> 8;
}

static bst_stack *make(void) {
    bst_stack *s = calloc(1, sizeof *s);
    assert_non_null(s);
    s->max_width = MOST_WIDTH;
    s->max_height = MOST_HEIGHT;
    s->width = WIDTH;
    s->height = HEIGHT;
    s->count = FRAMES;
    s->config.rate_px_per_frame = 2.0;
    s->roughness = 0.3;
    s->time_variance = (FRAMES * FRAMES - 1) / 12.0; /* of equal steps */
    s->threshold = 4.0;
    s->maps = calloc((size_t)FRAMES * MOST_WIDTH * MOST_HEIGHT, 1);
    assert_non_null(s->maps);
    for (int i = 0; i < FRAMES; i++) {
        s->tau[i] = i - 0.5 * (FRAMES - 1) + 0.1 * (i % 3 - 1);
    }
    return s;
}

static void drop(bst_stack *s) {
    free(s->maps);
    free(s);
}

static void fill(bst_stack *s, int most) {
    uint32_t state = 5;
    for (int i = 0; i < FRAMES; i++) {
        for (int y = 0; y < HEIGHT; y++) {
            for (int x = 0; x < WIDTH; x++) {
                stack_map(s, i)[y * WIDTH + x] =
                    (int8_t)((int)(draw(&state) % (2u * (unsigned)most)) - most);
            }
        }
    }
    for (int k = 0; k <= STACK_PHASES; k++) {
        for (int j = 0; j < 4; j++) {
            s->weight[k][j] = (float)(draw(&state) % 1000) / 1000.0f;
        }
    }
}

/* The sum of a frame's 16 pixels by the definition; false: a part of them has no measurement. */
static bool one_frame(const bst_stack *s, int frame, double x, double y, double *out) {
    int fx = (int)floor(x), fy = (int)floor(y);
    if (fx < 1 || fy < 1 || fx + 2 >= WIDTH || fy + 2 >= HEIGHT) {
        return false;
    }
    *out = 0.0;
    for (int j = -1; j <= 2; j++) {
        for (int i = -1; i <= 2; i++) {
            int value = stack_map(s, frame)[(fy + j) * WIDTH + fx + i];
            if (value == STACK_NONE) {
                return false;
            }
            *out += (double)s->weight[lround((x - fx) * STACK_PHASES)][i + 1] *
                    (double)s->weight[lround((y - fy) * STACK_PHASES)][j + 1] * value;
        }
    }
    return true;
}

static void sum_of_a_path(void **state) {
    (void)state;
    bst_stack *s = make();
    fill(s, 100);
    stack_map(s, 4)[20 * WIDTH + 30] = STACK_NONE;
    static const stack_path paths[] = {{.x = 30.3, .y = 20.6, .vx = 0.7, .vy = -0.4},
                                       {.x = 12.1, .y = 33.8, .vx = -1.2, .vy = 0.9},
                                       {.x = 50.9, .y = 9.2, .vx = 1.9, .vy = -0.2},
                                       {.x = 3.3, .y = 3.3, .vx = -1.9, .vy = -1.9}};
    for (size_t k = 0; k < sizeof paths / sizeof *paths; k++) {
        const stack_path *p = &paths[k];
        for (int clamp = 40; clamp <= 127; clamp += 87) {
            double sum = 0.0, v;
            int n = 0, frames;
            for (int i = 0; i < FRAMES; i++) {
                if (one_frame(s, i, p->x + p->vx * s->tau[i], p->y + p->vy * s->tau[i], &v)) {
                    sum += fmin(v, clamp);
                    n++;
                }
            }
            double expected = 2 * n < FRAMES ? 0.0 : sum / (STACK_QUANTA * sqrt(n));
            /* sums in single precision */
            bst_assert_close(stack_sum(s, p, clamp, &frames), expected, 2e-4);
            assert_int_equal(frames, n);
        }
    }
    drop(s);
}

/* A Gaussian that moves is climbed from beside it: place, rate and height. */
static void climb(void **state) {
    (void)state;
    static const double x0 = 27.3, y0 = 21.8, vx = 0.62, vy = -0.35, sigma = 1.6;
    bst_stack *s = make();
    s->roughness =
        0.5 /
        (sigma * sigma); /* curvature of the squared field's correlation, any length of the order */
    for (int k = 0; k <= STACK_PHASES; k++) { /* cubic convolution (Keys 1981, eq. 15) */
        double t = (double)k / STACK_PHASES, t2 = t * t, t3 = t2 * t;
        const double w[4] = {0.5 * (-t3 + 2 * t2 - t), 0.5 * (3 * t3 - 5 * t2 + 2),
                             0.5 * (-3 * t3 + 4 * t2 + t), 0.5 * (t3 - t2)};
        for (int j = 0; j < 4; j++) {
            s->weight[k][j] = (float)w[j];
        }
    }
    for (int i = 0; i < FRAMES; i++) {
        for (int y = 0; y < HEIGHT; y++) {
            for (int x = 0; x < WIDTH; x++) {
                double dx = x - x0 - vx * s->tau[i], dy = y - y0 - vy * s->tau[i];
                double value = 60.0 * exp(-0.5 * (dx * dx + dy * dy) / (sigma * sigma));
                stack_map(s, i)[y * WIDTH + x] = (int8_t)lround(value);
            }
        }
    }
    stack_path p = {.x = x0 + 0.8, .y = y0 - 0.7, .vx = vx - 0.1, .vy = vy + 0.1};
    stack_climb(s, &p);
    /* it ends at a twelfth of the field's length, 0.2 px, or nearer */
    bst_assert_close(p.x, x0, 0.1);
    bst_assert_close(p.y, y0, 0.1);
    bst_assert_close(p.vx, vx, 0.03);
    bst_assert_close(p.vy, vy, 0.03);
    assert_int_equal(p.frames, FRAMES);
    bst_assert_close(p.snr, 60.0 / STACK_QUANTA * sqrt(FRAMES), 0.2);
    drop(s);
}

/* A few bright frames do not carry a path, unless the others do without them. */
static void few_bright_frames(void **state) {
    (void)state;
    bst_stack *s = make();
    for (int k = 0; k <= STACK_PHASES; k++) {
        s->weight[k][1] = 1.0f; /* the pixel of the place's whole part */
    }
    const stack_path p = {.x = 30.5, .y = 20.5, .vx = 1.0, .vy = 0.5};
    for (int bright = 0; bright <= 6; bright++) {
        for (int faint = 0; faint <= 32; faint += 8) {
            for (int i = 0; i < FRAMES; i++) {
                int x = (int)floor(p.x + p.vx * s->tau[i]), y = (int)floor(p.y + p.vy * s->tau[i]);
                stack_map(s, i)[y * WIDTH + x] = (int8_t)(i < bright ? 100 : faint);
            }
            double without = (double)faint / STACK_QUANTA * sqrt(FRAMES - bright);
            bool holds = bright == 0 || bright >= 0.375 * FRAMES || without > s->threshold;
            assert_int_equal(stack_holds(s, &p), holds);
        }
    }
    drop(s);
}

/* At rest: the rate within 5 standard deviations of zero, which are 1 / (SNR sqrt(roughness
 * var(t))). */
static void at_rest(void **state) {
    (void)state;
    bst_stack *s = make();
    for (double snr = 5.0; snr < 200.0; snr *= 2.0) {
        double sigma = 1.0 / (snr * sqrt(s->roughness * s->time_variance));
        for (double angle = 0.1; angle < 6.2; angle += 1.0) {
            stack_path p = {
                .vx = 4.9 * sigma * cos(angle), .vy = 4.9 * sigma * sin(angle), .snr = snr};
            assert_true(stack_at_rest(s, &p));
            p.vx *= 5.1 / 4.9;
            p.vy *= 5.1 / 4.9;
            assert_false(stack_at_rest(s, &p));
        }
    }
    drop(s);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(sum_of_a_path),
        cmocka_unit_test(climb),
        cmocka_unit_test(few_bright_frames),
        cmocka_unit_test(at_rest),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
