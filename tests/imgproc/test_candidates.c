/* Candidates against their definition: every pair of maxima, and the line between them. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "imgproc/detect/candidates.h"
#include "tests/test_support.h"

enum { WIDTH = 131, HEIGHT = 77, PAD = 5, STRIDE = WIDTH + 2 * PAD + 3, ROOM = 140 };

static double draw(uint64_t *seed) {
    *seed = *seed * 6364136223846793005u + 1442695040888963407u;
    return (double)(*seed >> 33) / 2147483648.0;
}

/* A map of noise and sources, some of them in whole numbers so that many values are equal. */
typedef struct bench {
    float map[(HEIGHT + 2 * PAD) * STRIDE], snr[HEIGHT * ROOM];
    int maxima[HEIGHT];
    int32_t x[HEIGHT * ROOM];
    bst_filter f;
    bst_candidates c;
} bench;

static bench b;

static float at(int x, int y) {
    return b.map[(y + PAD) * STRIDE + x + PAD];
}

static bool is_maximum(int x, int y, float above) {
    float own = at(x, y);
    bool top = own > above;
    for (int v = y - 1; v <= y + 1; v++) {
        for (int u = x - 1; u <= x + 1; u++) {
            bool before = v < y || (v == y && u < x);
            top = top && ((u == x && v == y) || (before ? at(u, v) < own : at(u, v) <= own));
        }
    }
    return top;
}

static void make(uint64_t *seed, int width, int height, int sources, double noise, bool whole) {
    memset(b.map, 0, sizeof b.map);
    for (int s = 0; s < sources; s++) {
        double x = width * draw(seed), y = height * draw(seed), e = 3 + pow(60, draw(seed));
        double length = draw(seed) < 0.3 ? 12 * draw(seed) : 0, angle = 6.3 * draw(seed);
        for (double t = 0; t <= length; t += 0.7) {
            double cx = x + t * cos(angle), cy = y + t * sin(angle);
            for (int v = (int)fmax(0, cy - 4); v < height && v < cy + 5; v++) {
                for (int u = (int)fmax(0, cx - 4); u < width && u < cx + 5; u++) {
                    double r2 = (u - cx) * (u - cx) + (v - cy) * (v - cy);
                    float *p = &b.map[(v + PAD) * STRIDE + u + PAD];
                    *p = fmaxf(*p, (float)(e * exp(-0.25 * r2)));
                }
            }
        }
    }
    b.f = (bst_filter){.max_width = ROOM,
                       .pad = PAD,
                       .stride = STRIDE,
                       .width = width,
                       .height = height,
                       .point = b.map,
                       .maxima = b.maxima,
                       .maximum_x = b.x,
                       .maximum_snr = b.snr};
    for (int v = 0; v < height; v++) {
        for (int u = 0; u < width; u++) {
            float *p = &b.map[(v + PAD) * STRIDE + u + PAD];
            *p += (float)(noise * draw(seed));
            *p = whole ? floorf(*p) : *p;
        }
    }
    for (int v = 0; v < height; v++) {
        b.maxima[v] = 0;
        for (int u = 0; u < width; u++) {
            if (is_maximum(u, v, 2.0f)) {
                b.x[v * ROOM + b.maxima[v]] = u;
                b.snr[v * ROOM + b.maxima[v]++] = at(u, v);
            }
        }
    }
}

/* The SNR falls to `least` or below on the pixels nearest to the line from one to the other. */
static bool parted(int x0, int y0, int x1, int y1, double least) {
    int steps = abs(x1 - x0) > abs(y1 - y0) ? abs(x1 - x0) : abs(y1 - y0);
    for (int i = 1; i < steps; i++) {
        double dx = (double)i * (x1 - x0) / steps, dy = (double)i * (y1 - y0) / steps;
        if (at(x0 + (int)floor(dx + 0.5 + 1e-9), y0 + (int)floor(dy + 0.5 + 1e-9)) <= least) {
            return true;
        }
    }
    return false;
}

static bool wanted(int x, int y, const bst_candidates_criteria *q) {
    float own = at(x, y);
    double least = fmax(own - fmax(3.0f, 0.15f * own), q->floor);
    for (int v = 0; v < b.f.height; v++) {
        for (int i = 0; i < b.maxima[v]; i++) {
            int u = b.x[v * ROOM + i];
            bool near = abs(u - x) <= q->reach_px && abs(v - y) <= q->reach_px;
            bool before = v < y || (v == y && u < x);
            if (near && (at(u, v) > own || (at(u, v) == own && before)) &&
                !parted(x, y, u, v, (float)least)) {
                return false;
            }
        }
    }
    return own > q->certain || (x + 2 * y) % 3 == 0;
}

static bool accept(const void *user, const bst_candidate *c) {
    assert_ptr_equal(user, &b);
    return (c->x + 2 * c->y) % 3 == 0;
}

static void every_pair(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    uint64_t seed = 11;
    int few = 0, many = 0;
    bst_assert_ok(&ctx, bst_candidates_create(&ctx, WIDTH, HEIGHT, &b.c));
    for (int round = 0; round < 40; round++) {
        bool whole = round % 3 == 0;
        make(&seed, round % 2 ? WIDTH : 31 + round, round % 5 ? HEIGHT : 20 + round, 3 + 4 * round,
             round % 4 ? 2.5 : 7, whole);
        b.f.crowded = round % 2;
        b.f.best = b.map; /* with a streak filter that keeps the larger output: the same values */
        b.f.streak = b.f.kept = round % 7 == 0;
        const bst_candidates_criteria q = {1 + round % 13, 2.5f, round % 4 ? 6.0f : 1e9f, accept,
                                           &b};
        bst_candidates_find(&b.c, NULL, &b.f, &q);
        int n = 0;
        for (int y = 0; y < b.f.height; y++) {
            for (int i = 0; i < b.maxima[y]; i++) {
                int x = b.x[y * ROOM + i];
                if (wanted(x, y, &q)) {
                    assert_in_range(n, 0, b.c.count - 1);
                    assert_int_equal(b.c.items[n].x, x);
                    assert_int_equal(b.c.items[n].y, y);
                    assert_true(b.c.items[n].snr == at(x, y));
                    n++;
                }
            }
        }
        assert_int_equal(b.c.count, n);
        few += n > 1 && n < 64;
        many += n >= 64;
        for (int i = 1; i < n; i++) { /* each index once: strictly rising places of equal SNR */
            int p = b.c.order[i - 1], o = b.c.order[i];
            float before = b.c.items[p].snr, now = b.c.items[o].snr;
            assert_true(before > now || (before == now && p < o));
        }
    }
    assert_true(few > 5 && many > 5);
    bst_candidates_free(&b.c);
    assert_null(b.c.items);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(every_pair)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
