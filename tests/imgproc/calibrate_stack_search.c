/* Measures what the search grid of imgproc/stack/stack_search.c loses (GROUP_STEP, STEP,
 * MARGIN_SNR): paths without noise at random positions and rates, whose light along the path has
 * the SNR of a threshold. Prints the losses in SNR: what the best grid sum lacks. */
#include "boresight/rng.h"
#include "imgproc/stack/stack_search.c"
#include "tests/test_support.h"

enum { SIDE = STACK_TILE, PATHS = 30, REACH = 6 };

/* About the threshold of 16 frames. */
static const double THRESHOLD = 6.5;

static void open_stack(bst_ctx *ctx, bst_stack *s, int frames, double sigma_px) {
    *s = (bst_stack){.config = {.frames = frames, .rate_px_per_frame = 3.0},
                     .max_width = SIDE,
                     .max_height = SIDE,
                     .width = SIDE,
                     .height = SIDE,
                     .count = frames,
                     .roughness = 0.5 / (sigma_px * sigma_px),
                     .threshold = THRESHOLD};
    for (int i = 0; i < frames; i++) {
        s->tau[i] = i - 0.5 * (frames - 1);
        s->time_variance += s->tau[i] * s->tau[i] / frames;
    }
    s->maps = calloc((size_t)frames * SIDE * SIDE, sizeof *s->maps);
    assert_non_null(s->maps);
    bst_assert_ok(ctx, stack_search_create(ctx, s));
}

/* Draws a path's filtered light into the frames. */
static void draw_path(bst_stack *s, const stack_path *p) {
    double each = THRESHOLD / sqrt((double)s->count) * STACK_QUANTA;
    memset(s->maps, 0, (size_t)s->count * SIDE * SIDE);
    for (int i = 0; i < s->count; i++) {
        double x = p->x + p->vx * s->tau[i], y = p->y + p->vy * s->tau[i];
        for (int j = -REACH; j <= REACH; j++) {
            for (int k = -REACH; k <= REACH; k++) {
                int column = (int)floor(x) + k, row = (int)floor(y) + j;
                double d2 = (column - x) * (column - x) + (row - y) * (row - y);
                double v = each * exp(-0.5 * s->roughness * d2);
                stack_map(s, i)[row * SIDE + column] = (int8_t)floor(v + 0.5);
            }
        }
    }
}

/* Greatest sum over all positions and rates of the grid, as SNR. */
static double greatest_on_grid(bst_stack *s) {
    grid g;
    make_grid(s, &g);
    stack_tile *t = &s->workers[0];
    read_tile(&g, t, 0, 0);
    int most = 0;
    for (int ky = 0; ky < g.rates; ky++) {
        for (int kx = 0; kx < g.rates; kx++) {
            if (kx == 0 || g.group_of[kx] != g.group_of[kx - 1]) {
                add_groups(&g, t, g.group_rate[g.group_of[kx]], g.group_rate[g.group_of[ky]]);
            }
            const int16_t *in[MAX_GROUPS];
            size_t square = (size_t)g.group_side * (size_t)g.group_side;
            for (int i = 0; i < g.groups; i++) {
                int ox = g.group_margin + nearest(g.rate[kx] * g.group_tau[i]);
                int oy = g.group_margin + nearest(g.rate[ky] * g.group_tau[i]);
                in[i] = t->groups + (size_t)i * square + (long)oy * g.group_side + ox;
            }
            int sum = stack_rows_greatest(in, g.groups, g.group_side, t->row, SIDE, SIDE);
            most = sum > most ? sum : most;
        }
    }
    return most / (STACK_QUANTA * sqrt((double)s->count));
}

/* The margin covers the loss of most paths: the others are lost only near the threshold. */
static void the_margin_covers_the_steps(void **state) {
    (void)state;
    static const int frames[] = {8, 16};
    static const double sigma[] = {0.85, 1.4};
    bst_rng_key key = bst_rng_make_key(11, 0, "test", "calibrate stack search");
    int beyond = 0, all = 0;
    double most = 0.0, total = 0.0;
    for (int c = 0; c < 4; c++) {
        bst_ctx ctx = {0};
        bst_stack s;
        double sum = 0.0, worst = 0.0;
        open_stack(&ctx, &s, frames[c % 2], sigma[c / 2]);
        for (int i = 0; i < PATHS; i++, all++) {
            double u[4];
            for (int k = 0; k < 4; k++) {
                u[k] = bst_rng_uniform(key, (uint64_t)(c * PATHS + i), (uint64_t)k);
            }
            stack_path p = {.x = SIDE / 2 + u[0],
                            .y = SIDE / 2 + u[1],
                            .vx = 3.0 * (2.0 * u[2] - 1.0),
                            .vy = 3.0 * (2.0 * u[3] - 1.0)};
            draw_path(&s, &p);
            double loss = THRESHOLD - greatest_on_grid(&s);
            sum += loss;
            worst = fmax(worst, loss);
            beyond += loss > MARGIN_SNR;
        }
        printf("%d frames, sigma %.2f px: loss %.2f on average, %.2f at most (SNR at %.1f)\n",
               frames[c % 2], sigma[c / 2], sum / PATHS, worst, THRESHOLD);
        total += sum;
        most = fmax(most, worst);
        stack_search_free(&s);
        free(s.maps);
    }
    printf("%d of %d paths lose more than %.2f, the worst %.2f\n", beyond, all, MARGIN_SNR, most);
    assert_true(beyond < all / 20);
    assert_true(total / all > 0.3 * MARGIN_SNR); /* nor is it wider than it needs to be */
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(the_margin_covers_the_steps)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
