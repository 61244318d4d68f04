/* Bounds for the stars of a field cell against stars that are rotated one by one: light in a pixel,
 * scale of the motion, box of positions. No device. */
#include "boresight/rng.h"
#include "boresight/vec.h"
#include "scenegen/kernels/scene_shared.h"
#include "scenegen/smear/motion_map.h"
#include "tests/test_support.h"

enum { NODES = 37 };

/* A field of 600 px about the boresight, 2e-4 rad per px. */
static const double SCALE = 2e-4, REACH_PX = 600.0, ROLL_PX = 450.0;

typedef struct fixture {
    bst_ctx ctx;
    bst_motion_map *map;
    bst_smear_node nodes[NODES];
    double turn[NODES][3][3]; /* rotation matrices */
    float table[(NODES / BST_BLOCK + 1) * BST_TABLE_ROWS * BST_BLOCK];
    bst_motion_map_frame frame;
} fixture;

static int setup(void **state) {
    fixture *f = calloc(1, sizeof *f);
    assert_non_null(f);
    bst_assert_ok(&f->ctx, bst_motion_map_create(&f->ctx, &f->map));
    *state = f;
    return 0;
}

static int teardown(void **state) {
    fixture *f = *state;
    bst_motion_map_free(f->map);
    free(f);
    return 0;
}

/* Rotation matrix of a rotation vector, by Rodrigues' formula. */
static void matrix_of(const double w[3], double m[3][3]) {
    double angle = sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2]);
    double s = angle > 0.0 ? sin(angle) / angle : 1.0;
    double c = angle > 0.0 ? (1.0 - cos(angle)) / (angle * angle) : 0.5;
    const double cross[3][3] = {{0.0, -w[2], w[1]}, {w[2], 0.0, -w[0]}, {-w[1], w[0], 0.0}};
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            double square = 0.0;
            for (int k = 0; k < 3; k++) {
                square += cross[i][k] * cross[k][j];
            }
            m[i][j] = (i == j) + s * cross[i][j] + c * square;
        }
    }
}

/* Nodes of uneven weight on a path with a bend; tilts in px at the boresight times `tilt_px`, roll
 * in px at ROLL_PX. */
static void make_path(fixture *f, double length_x, double length_y, double roll_px,
                      double tilt_px) {
    double sum = 0.0;
    for (int n = 0; n < NODES; n++) {
        double u = (double)n / (NODES - 1) - 0.5;
        bst_smear_node *node = &f->nodes[n];
        *node = (bst_smear_node){.p = {tilt_px * length_x * (u + 0.3 * u * u),
                                       tilt_px * length_y * (u - 0.5 * u * u), roll_px * u},
                                 .weight = 1.0 + 0.5 * sin(0.4 * n)};
        if (n % 9 == 8) { /* a pause: no longer a step than the table's floats are exact */
            memcpy(node->p, node[-1].p, sizeof node->p);
            node->p[1] += 1e-5;
        }
        sum += node->weight;
    }
    for (int n = 0; n < NODES; n++) {
        bst_smear_node *node = &f->nodes[n];
        node->weight /= sum;
        const double w[3] = {node->p[0] / tilt_px * SCALE, node->p[1] / tilt_px * SCALE,
                             node->p[2] / ROLL_PX};
        matrix_of(w, f->turn[n]);
        double(*m)[3] = f->turn[n];
        const double row[9] = {m[0][0] - m[2][2], m[0][1],           m[0][2] / SCALE,
                               m[1][0],           m[1][1] - m[2][2], m[1][2] / SCALE,
                               m[2][0] * SCALE,   m[2][1] * SCALE,   m[2][2]};
        float *t = f->table + n / BST_BLOCK * BST_TABLE_ROWS * BST_BLOCK + n % BST_BLOCK;
        for (int i = 0; i < 9; i++) {
            t[i * BST_BLOCK] = (float)row[i];
        }
    }
    f->frame = (bst_motion_map_frame){.nodes = f->nodes,
                                      .count = NODES,
                                      .table = f->table,
                                      .scale_rad = SCALE,
                                      .tilt_px = tilt_px,
                                      .roll_px = ROLL_PX,
                                      .reach_px = REACH_PX,
                                      .sensor_px = REACH_PX,
                                      .shrink = 1.0,
                                      .stretch = 1.0,
                                      .sigma_px = 0.9,
                                      .binning = 1,
                                      .sources = 50};
}

/* What a star at (x, y) has: by its places at all nodes. */
static bst_smear_star_motion_cell star_of(const fixture *f, double x, double y) {
    bst_smear_star_motion_cell out = {.low = {INFINITY, INFINITY}, .high = {-INFINITY, -INFINITY}};
    double at[NODES][2];
    for (int n = 0; n < NODES; n++) {
        const double v[3] = {x * SCALE, y * SCALE, 1.0};
        double r[3] = {0.0, 0.0, 0.0};
        for (int i = 0; i < 9; i++) {
            r[i / 3] += f->turn[n][i / 3][i % 3] * v[i % 3];
        }
        at[n][0] = r[0] / r[2] / SCALE;
        at[n][1] = r[1] / r[2] / SCALE;
        for (int i = 0; i < 2; i++) {
            double moved = at[n][i] - (i == 0 ? x : y);
            out.low[i] = fmin(out.low[i], moved);
            out.high[i] = fmax(out.high[i], moved);
        }
    }
    for (int b = 1; b <= f->frame.binning; b += f->frame.binning > 1 ? f->frame.binning - 1 : 1) {
        double sigma = f->frame.sigma_px, wide2 = sigma * sigma + (b * b - 1.0) / 12.0;
        double line = erf(0.5 * b / (sigma * sqrt(2.0))), most = 0.0;
        for (int a = 0; a < NODES; a++) {
            double light = 0.0;
            for (int n = 0; n < NODES; n++) {
                double dx = f->frame.shrink * (at[n][0] - at[a][0]);
                double dy = f->frame.shrink * (at[n][1] - at[a][1]);
                light += f->nodes[n].weight * exp(-0.5 * (dx * dx + dy * dy) / wide2);
            }
            most = fmax(most, light);
        }
        *(b == 1 ? &out.share : &out.read_share) = most * line * line;
    }
    out.read_share = f->frame.binning == 1 ? out.share : out.read_share;
    for (int n = 0; n + 1 < NODES; n++) {
        const double *p = f->nodes[n].p, *q = f->nodes[n + 1].p;
        double step = sqrt((p[0] - q[0]) * (p[0] - q[0]) + (p[1] - q[1]) * (p[1] - q[1]) +
                           (p[2] - q[2]) * (p[2] - q[2]));
        double moved = hypot(at[n][0] - at[n + 1][0], at[n][1] - at[n + 1][1]);
        out.scale = step > 1e-3 ? fmax(out.scale, f->frame.stretch * moved / step) : out.scale;
    }
    return out;
}

/* Many stars all over the field are within the bounds of their cells, and those at the middle of a
 * cell close to them: `slack`, relative, and in px. */
static void compare(fixture *f, double slack, double slack_px) {
    bst_assert_ok(&f->ctx, bst_motion_map_begin(&f->ctx, f->map, &f->frame));
    bst_rng_key key = bst_rng_make_key(3, 0, "test", "motion map");
    for (uint64_t k = 0; k < 400; k++) {
        double angle = 2.0 * BST_PI * bst_rng_uniform(key, k, 0);
        double away = REACH_PX * sqrt(bst_rng_uniform(key, k, 1));
        double x = away * cos(angle), y = away * sin(angle);
        const bst_smear_star_motion_cell *c = bst_motion_map_at(f->map, x, y);
        bst_smear_star_motion_cell star = star_of(f, x, y);
        /* 1e-4: the table is of floats */
        assert_true(c->share > star.share * (1.0 - 1e-4));
        assert_true(c->read_share > star.read_share * (1.0 - 1e-4));
        assert_true(c->scale > star.scale * (1.0 - 1e-3));
        assert_true(c->share < star.share * (1.0 + slack));
        assert_true(c->read_share < star.read_share * (1.0 + slack));
        assert_true(c->scale < star.scale * (1.0 + slack));
        for (int i = 0; i < 2; i++) {
            assert_true(c->low[i] < star.low[i] + 1e-3 && c->low[i] > star.low[i] - slack_px);
            assert_true(c->high[i] > star.high[i] - 1e-3 && c->high[i] < star.high[i] + slack_px);
        }
        for (int i = 0; i < BST_MOTION_ERRORS; i++) {
            assert_true(c->error[i] < 0.0);
        }
    }
}

/* A slew at a slant: all stars alike, up to the tangent plane's stretch. */
static void slews(void **state) {
    fixture *f = *state;
    make_path(f, 14.0, -6.0, 0.0, 1.0);
    compare(f, 0.015, 0.12);
    f->frame.binning = 3;
    compare(f, 0.015, 0.12);
    /* px of tilts that are those of the corners, 3 % more */
    make_path(f, 14.0, -6.0, 0.0, 1.03);
    compare(f, 0.015, 0.12);
    /* an image that distortion shrinks or stretches */
    f->frame.shrink = 0.8;
    f->frame.stretch = 1.25;
    compare(f, 0.015, 0.12);
}

/* Roll about the boresight, and a slew with it: the pole of the motion lies in the field, where a
 * star is at rest. */
static void rolls(void **state) {
    fixture *f = *state;
    make_path(f, 0.0, 0.0, 25.0, 1.0);
    bst_assert_ok(&f->ctx, bst_motion_map_begin(&f->ctx, f->map, &f->frame));
    /* at 450 px by 25 px, at the boresight not at all: all its light in one pixel */
    double line = erf(0.5 / (0.9 * sqrt(2.0)));
    const bst_smear_star_motion_cell *far = bst_motion_map_at(f->map, 0.0, 450.0);
    bst_assert_close(far->high[0] - far->low[0], 25.0, 1.0);
    bst_assert_close(far->scale, 1.0, 0.05);
    const bst_smear_star_motion_cell *still = bst_motion_map_at(f->map, 0.5, 0.5);
    bst_assert_close(still->share, line * line, 0.02);
    compare(f, 0.5, 0.5);
    f->frame.sources = 5000; /* as exact as a sixteenth of it pays for */
    make_path(f, 9.0, 4.0, 25.0, 1.0);
    compare(f, 0.2, 0.5);
}

/* Stars that are behind the camera at the end of a turn: only the nodes at which they are before it
 * count. */
static void stars_behind_the_camera(void **state) {
    fixture *f = *state;
    make_path(f, 4.0, 2.0, 0.0, 1.0);
    bst_assert_ok(&f->ctx, bst_motion_map_begin(&f->ctx, f->map, &f->frame));
    const bst_smear_star_motion_cell before = *bst_motion_map_at(f->map, 300.0, -200.0);
    /* the last node: 115 degrees about x, or about y, in place of the path's end */
    for (int axis = 0; axis < 2; axis++) {
        make_path(f, 4.0, 2.0, 0.0, 1.0);
        bst_smear_node *last = &f->nodes[NODES - 1];
        last->p[axis] = 2.0 / SCALE;
        const double w[3] = {last->p[0] * SCALE, last->p[1] * SCALE, 0.0};
        double m[3][3];
        matrix_of(w, m);
        float *t = f->table + (NODES - 1) / BST_BLOCK * BST_TABLE_ROWS * BST_BLOCK +
                   (NODES - 1) % BST_BLOCK;
        const double row[9] = {m[0][0] - m[2][2], m[0][1],           m[0][2] / SCALE,
                               m[1][0],           m[1][1] - m[2][2], m[1][2] / SCALE,
                               m[2][0] * SCALE,   m[2][1] * SCALE,   m[2][2]};
        for (int i = 0; i < 9; i++) {
            t[i * BST_BLOCK] = (float)row[i];
        }
        bst_assert_ok(&f->ctx, bst_motion_map_begin(&f->ctx, f->map, &f->frame));
        const bst_smear_star_motion_cell *cell = bst_motion_map_at(f->map, 300.0, -200.0);
        bst_assert_close(cell->scale / before.scale, 1.0, 0.02); /* cells of other sizes */
        assert_true(cell->share > 0.0 && cell->share < 1.1 * before.share);
    }
}

/* A centred Gaussian's light in a binned pixel, and its variance with that of a uniform
 * distribution over b pixels less that over one, (b^2 - 1) / 12. */
static void shares_of_binned_pixels(void **state) {
    (void)state;
    for (int b = 1; b <= 4; b++) {
        double spread, sigma = 0.7, part = bst_motion_pixel_share(sigma, b, &spread);
        bst_assert_close(spread, sqrt(sigma * sigma + (b * b - 1.0) / 12.0), 1e-12);
        bst_assert_close(part, pow(erf(0.5 * b / (sigma * sqrt(2.0))), 2.0), 1e-12);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(slews, setup, teardown),
        cmocka_unit_test_setup_teardown(rolls, setup, teardown),
        cmocka_unit_test_setup_teardown(stars_behind_the_camera, setup, teardown),
        cmocka_unit_test(shares_of_binned_pixels),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
