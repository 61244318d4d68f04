/* Camera motion as the smear sees it: shifts, midpoints, brightness and errors, against rotations
 * written out and sums over fine steps. No device. */
#include "boresight/vec.h"
#include "scenegen/smear/motion.h"
#include "scenegen/smear/smear_internal.h"
#include "scenegen/smear/smear_quadrature_internal.h"
#include "tests/test_support.h"

/* Rotates v by the rotation vector w: Rodrigues' formula, written out. */
static void rotate(const double w[3], const double v[3], double out[3]) {
    double angle = sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2]);
    double u[3] = {0.0, 0.0, 0.0}, c = cos(angle), s = sin(angle);
    for (int i = 0; i < 3 && angle > 0.0; i++) {
        u[i] = w[i] / angle;
    }
    double dot = u[0] * v[0] + u[1] * v[1] + u[2] * v[2];
    for (int i = 0; i < 3; i++) {
        int j = (i + 1) % 3, k = (i + 2) % 3;
        out[i] = v[i] * c + (u[j] * v[k] - u[k] * v[j]) * s + u[i] * dot * (1.0 - c);
    }
}

/* Tilts in px times a stretch of 1.3, roll in px at 700 px from the boresight. */
static void a_rotation_becomes_the_shift_of_the_boresight(void **state) {
    (void)state;
    const double scale = 1e-4, stretch = 1.3, roll_px = 700.0;
    const double paths[][3] = {{5.0, -3.0, 2.0}, {400.0, 900.0, -60.0}, {-2000.0, 100.0, 300.0}};
    for (int n = 0; n < 3; n++) {
        const double *p = paths[n], ahead[3] = {0.0, 0.0, 1.0};
        const double w[3] = {p[0] * scale / stretch, p[1] * scale / stretch, p[2] / roll_px};
        double v[3];
        rotate(w, ahead, v);
        bst_smear_path_point point = {{p[0], p[1], p[2]}, 0.3};
        bst_motion_to_shift(&point, scale, stretch, roll_px);
        double per = stretch / scale; /* px per tangent, times the stretch */
        bst_assert_close(point.p[0], per * v[0] / v[2], 1e-9 * per);
        bst_assert_close(point.p[1], per * v[1] / v[2], 1e-9 * per);
        assert_true(point.p[2] == 0.0 && point.s == 0.3);
    }
    /* a rotation to the side: far away, on the side to which it turns */
    bst_smear_path_point aside = {{0.0, stretch * 1.6 / scale, 0.0}, 0.0};
    bst_motion_to_shift(&aside, scale, stretch, roll_px);
    assert_true(aside.p[0] > 1e9 && fabs(aside.p[1]) < 1e-3 * aside.p[0]);
}

/* Largest difference between the motions of a star `corner` (tangent) from the boresight and of one
 * at it, px, over the directions in which that star may lie. */
static double true_spread(const double w[3], double corner, double scale) {
    const double ahead[3] = {0.0, 0.0, 1.0};
    double a[3], b[3], worst = 0.0;
    rotate(w, ahead, a);
    for (int k = 0; k < 720; k++) {
        double angle = BST_PI * k / 360.0, x = corner * cos(angle), y = corner * sin(angle);
        const double v[3] = {x, y, 1.0};
        rotate(w, v, b);
        worst = fmax(worst, hypot(b[0] / b[2] - x - a[0] / a[2], b[1] / b[2] - y - a[1] / a[2]));
    }
    return worst / scale;
}

static void corner_stars_move_otherwise_by_as_much(void **state) {
    (void)state;
    const double scale = 1e-4, stretch = 1.3, roll_px = 700.0, corner_px = 900.0;
    const struct {
        double tilt_x, tilt_y, roll; /* rad */
        double slack;                /* of the bound over the truth */
    } cases[] = {{0.0, 0.0, 0.01, 0.01},   {0.0, 0.0, -0.2, 0.12}, {0.004, -0.003, 0.0, 0.01},
                 {-0.03, 0.04, 0.0, 0.02}, {0.0, 0.05, 0.0, 0.02}, {0.002, 0.001, 1e-5, 0.1},
                 {0.03, 0.02, 0.03, 0.4}};
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        const double w[3] = {cases[k].tilt_x, cases[k].tilt_y, cases[k].roll};
        double truth = true_spread(w, corner_px * scale, scale);
        /* the worst point of the path counts */
        const bst_smear_path_point path[3] = {
            {{0.0, 0.0, 0.0}, 0.0},
            {{w[0] * stretch / scale, w[1] * stretch / scale, w[2] * roll_px}, 0.5},
            {{0.3 * w[0] * stretch / scale, 0.2 * w[1] * stretch / scale, 0.1 * w[2] * roll_px},
             1.0}};
        double bound = bst_motion_spread_px(path, 3, scale, stretch, roll_px, corner_px);
        /* to the second order: the third, tilt squared and corner squared, is left out */
        assert_true(bound >= truth * (1.0 - 0.01));
        assert_true(bound <= truth * (1.0 + cases[k].slack));
    }
}

static void midpoints_of_equal_parts(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    /* from 0.2 to 1.0 with a jump in speed at 0.4 and a pause at 0.7 */
    const bst_smear_path_point path[] = {{{0.0, 1.0, 2.0}, 0.2},
                                         {{4.0, 0.0, 2.5}, 0.4},
                                         {{5.0, -3.0, 2.5}, 0.7},
                                         {{5.0, -3.0, 0.0}, 1.0}};
    bst_smear_node_list list = {0};
    bst_assert_ok(&ctx, bst_motion_midpoints(&ctx, path, 4, 2, &list));
    bst_assert_ok(&ctx, bst_motion_midpoints(&ctx, path, 4, 4, &list));
    assert_int_equal(list.count, 6);
    /* at 0.4 and 0.8; at 0.3, 0.5, 0.7, 0.9 */
    const double want[6][3] = {{4.0, 0.0, 2.5},  {5.0, -3.0, 2.5 - 2.5 / 3.0},
                               {2.0, 0.5, 2.25}, {4.0 + 1.0 / 3.0, -1.0, 2.5},
                               {5.0, -3.0, 2.5}, {5.0, -3.0, 2.5 - 5.0 / 3.0}};
    for (int n = 0; n < 6; n++) {
        bst_assert_close(list.items[n].weight, n < 2 ? 0.5 : 0.25, 1e-15);
        assert_true(list.items[n].variance == 0.0);
        for (int i = 0; i < 3; i++) {
            bst_assert_close(list.items[n].p[i], want[n][i], 1e-12);
        }
    }
    free(list.items);
}

/* Moves of some px by shares of the light, one after the other: does the path rest, by 2.5 px? */
static void paths_that_rest(void **state) {
    (void)state;
    static const struct {
        double px[4], light[4];
        bool rests;
    } cases[] = {{{3.0, 3.0, 3.0, 3.0}, {0.25, 0.25, 0.25, 0.25}, false},
                 {{100.0, 100.0, 100.0, 1e3}, {0.08, 0.08, 0.08, 0.76}, false},
                 {{0.0, 10.0, 0.0, 0.0}, {0.5, 0.0, 0.25, 0.25}, true},
                 {{1.5, 10.0, 1.0, 0.5}, {0.5, 0.01, 0.24, 0.25}, true},
                 {{500.0, 0.01, 500.0, 1.0}, {0.49, 0.02, 0.489, 0.001}, true},
                 {{0.3, 3.0, 0.2, 0.1}, {0.5, 0.0, 0.3, 0.2}, true}};
    for (size_t n = 0; n < sizeof cases / sizeof *cases; n++) {
        bst_smear_path_point path[5] = {{{7.0, -3.0, 0.0}, 0.0}};
        for (int k = 0; k < 4; k++) {
            path[k + 1] = path[k];
            path[k + 1].p[0] += 0.6 * cases[n].px[k];
            path[k + 1].p[1] += 0.8 * cases[n].px[k];
            path[k + 1].s += cases[n].light[k];
        }
        assert_int_equal(bst_motion_rests(path, 5, 2.5), cases[n].rests);
    }
}

/* Brightness 1 until 0.4 of the exposure, up to 1.8 at 0.6, down to 0.4 at its end. */
static void stretches_end_at_knots_and_follow_the_brightness(void **state) {
    (void)state;
    const bst_scene_source_rate rate = {
        .count = 4, .u = {0.0, 0.4, 0.6, 1.0}, .rate = {1.0, 1.0, 1.8, 0.4}};
    const bst_scene_source source = {.rate = &rate};
    const struct {
        double begin_s, length_s, from, to;
        double change; /* of the brightness within it */
    } cases[] = {{0.0, 10.0, 0.0, 0.4, 0.0}, {0.0, 10.0, 0.4, 0.6, 0.8}, {0.0, 10.0, 0.6, 1.0, 1.4},
                 {2.0, 4.0, 0.0, 0.5, 0.0},  {2.0, 4.0, 0.5, 1.0, 0.8},  {7.0, 1.0, 0.0, 1.0, 0.35},
                 {5.0, 0.5, 0.2, 1.0, 0.16}};
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        int parts = 0;
        double to = bst_motion_stretch(&source, cases[k].begin_s, cases[k].length_s, 10.0,
                                       cases[k].from, &parts);
        bst_assert_close(to, cases[k].to, 1e-12);
        /* 512 an exposure, or one for each 2 % */
        double span = (to - cases[k].from) * cases[k].length_s / 10.0;
        double wanted = fmax(cases[k].change / 0.02, 512.0 * span);
        bst_assert_close(parts, wanted, 1.0);
        assert_true(parts >= wanted - 1e-9);
    }
    /* a flash: a part for each 2 %, up to 1000 */
    const bst_scene_source_rate flash = {
        .count = 3, .u = {0.0, 0.5, 1.0}, .rate = {0.0, 30.0, 0.0}};
    const bst_scene_source bright = {.rate = &flash}, constant = {.rate = NULL};
    int parts = 0;
    bst_assert_close(bst_motion_stretch(&bright, 0.0, 0.02, 10.0, 0.0, &parts), 1.0, 0.0);
    assert_int_equal(parts, 6); /* 0.12 of 60 a unit */
    bst_assert_close(bst_motion_stretch(&bright, 0.0, 10.0, 10.0, 0.0, &parts), 0.5, 1e-12);
    assert_int_equal(parts, 1000);
    bst_assert_close(bst_motion_stretch(&constant, 0.0, 10.0, 10.0, 0.0, &parts), 1.0, 0.0);
    assert_int_equal(parts, 1);
    bst_assert_close(bst_motion_stretch(&bright, 0.0, 0.0, 10.0, 0.0, &parts), 1.0, 0.0);
    assert_int_equal(parts, 1);
}

/* Matrices with known eigenvectors, none along an axis. */
static void the_main_axis_of_a_matrix(void **state) {
    (void)state;
    const double values[3] = {4.0, 2.5, 0.7};
    for (int n = 0; n < 6; n++) {
        const double w[3] = {0.9 * sin(n + 0.3), 1.1 * cos(2.0 * n), 0.4 + n};
        double columns[3][3], a[3][3] = {{0.0}}, axis[3];
        for (int k = 0; k < 3; k++) {
            const double unit[3] = {k == 0, k == 1, k == 2};
            rotate(w, unit, columns[k]);
        }
        for (int i = 0; i < 3; i++) {
            for (int j = 0; j < 3; j++) {
                for (int k = 0; k < 3; k++) {
                    a[i][j] += values[(k + n) % 3] * columns[k][i] * columns[k][j];
                }
            }
        }
        bst_smear_nodes_main_axis(a, axis);
        const double *want = columns[(3 - n % 3) % 3];
        double dot = axis[0] * want[0] + axis[1] * want[1] + axis[2] * want[2];
        bst_assert_close(fabs(dot), 1.0, 1e-12); /* (2.5 / 4)^64 = 1e-13 */
        bst_assert_close(axis[0] * axis[0] + axis[1] * axis[1] + axis[2] * axis[2], 1.0, 1e-12);
    }
}

/* Errors that go with a power of the motion's scale are given back at any scale within the table,
 * and at most with the sixth power beyond. */
static void errors_between_scales(void **state) {
    (void)state;
    for (int power = 2; power <= 6; power++) {
        double error[BST_NODE_SCALES];
        for (int k = 0; k < BST_NODE_SCALES; k++) {
            error[k] = 0.03 * pow(2.0, 0.5 * power * (k - BST_NODE_SCALES + 2));
        }
        for (double scale = 0.1; scale < 1.4142; scale *= 1.17) {
            bst_assert_close(bst_smear_nodes_error(error, scale) / (0.03 * pow(scale, power)), 1.0,
                             1e-9);
        }
        bst_assert_close(bst_smear_nodes_error(error, 0.01), error[0], 0.0);
        bst_assert_close(bst_smear_nodes_error(error, 2.0) / error[BST_NODE_SCALES - 1], 8.0, 1e-9);
    }
    const double jump[BST_NODE_SCALES] = {0, 0, 0, 0, 0, 0, 0, 0.5, 0.6};
    bst_assert_close(bst_smear_nodes_error(jump, 0.8), 0.5, 0.0); /* no chord from nothing */
    bst_assert_close(bst_smear_nodes_error(jump, 0.5), 0.0, 0.0);
    const bst_smear_level level = {.error = {0, 0, 0, 0, 0, 0, 0, 0.5, 0.6},
                                   .predicted = {0, 0, 0, 0, 0, 0, 0, 0.4, 0.5},
                                   .profile_error = 0.25,
                                   .predicted_profile = 0.125};
    bst_assert_close(bst_smear_level_error(&level, 1.0), 0.75, 1e-12);
    bst_assert_close(bst_smear_level_prediction(&level, 1.0), 0.525, 1e-12);
}

/* Two groups, the fainter with the larger error, apart along each coordinate: at each place the sum
 * of weights and errors with a Gaussian of their distance. Predicted errors and widenings add up in
 * the same way, and do not change the part of the bounds. */
static void errors_of_faint_groups_count_less(void **state) {
    (void)state;
    const double sigma = 0.85;
    for (int axis = 0; axis < 3; axis++) {
        const double apart[] = {20.0, 1.0, 0.5};
        for (int k = 0; k < 3; k++) {
            bst_smear_node nodes[2] = {{{1.0, 2.0, 3.0}, 0.8, 0.03, 0.1, 0.2},
                                       {{1.0, 2.0, 3.0}, 0.2, 0.01, 1.0, 0.5}};
            nodes[1].p[axis] += apart[k];
            double g = exp(-0.5 * apart[k] * apart[k] / (sigma * sigma));
            double light = fmax(0.8 + 0.2 * g, 0.2 + 0.8 * g);
            const double sums[BST_NODE_PARTS] = {fmax(0.08 + 0.2 * g, 0.2 + 0.08 * g),
                                                 fmax(0.16 + 0.1 * g, 0.1 + 0.16 * g) / 0.5,
                                                 fmax(0.024 + 0.002 * g, 0.002 + 0.024 * g) / 0.03};
            double part[BST_NODE_PARTS];
            bst_smear_nodes_parts(nodes, 2, sigma, true, part);
            for (int i = 0; i < BST_NODE_PARTS; i++) {
                bst_assert_close(part[i], sums[i] / light, 1e-8);
            }
        }
    }
    /* of errors that are nearly alike all count */
    double part[BST_NODE_PARTS];
    const bst_smear_node alike[2] = {{{0, 0, 0}, 0.9, 0.0, 0.95, 0.95},
                                     {{9, 0, 0}, 0.1, 0.0, 1.0, 1.0}};
    bst_smear_nodes_parts(alike, 2, sigma, true, part);
    bst_assert_close(part[BST_PART_BOUND], 1.0, 0.0);
    bst_assert_close(part[BST_PART_PREDICTED], 1.0, 0.0);
    const bst_smear_node exact[2] = {{{0, 0, 0}, 0.9, 0.0, 0.0, 0.0},
                                     {{9, 0, 0}, 0.1, 0.0, 0.0, 0.0}};
    bst_smear_nodes_parts(exact, 2, sigma, true, part);
    bst_assert_close(part[BST_PART_BOUND], 1.0, 0.0);
}

/* Integral of a derivative of the Gaussian (Hermite polynomial of this order times it) over a pixel
 * at x, by Simpson's rule; in sigma. */
static double hermite_in_pixel(int order, double x, double side) {
    enum { STEPS = 200 };
    double sum = 0.0;
    for (int i = 0; i <= STEPS; i++) {
        double u = x + side * ((double)i / STEPS - 0.5), y = u * u;
        double h = order == 0   ? 1.0
                   : order == 2 ? y - 1.0
                   : order == 4 ? y * y - 6.0 * y + 3.0
                                : y * y * y - 15.0 * y * y + 45.0 * y - 15.0;
        double weight = i == 0 || i == STEPS ? 1.0 : i % 2 ? 4.0 : 2.0;
        sum += weight * h * exp(-0.5 * y) * side / STEPS / 3.0;
    }
    return sum;
}

static void derivatives_in_pixels(void **state) {
    (void)state;
    const double sigmas[] = {0.6, 1.0, 2.5}, greatest[3] = {1.0, 3.0, 15.0};
    for (int n = 0; n < 9; n++) {
        int binning = 1 + n / 3 * n / 3; /* 1, 2, 5 */
        double sigma = sigmas[n % 3], side = binning / sigma, part[3];
        bst_smear_find_pixel_parts(sigma, binning, part);
        for (int k = 0; k < 3; k++) {
            double most = 0.0;
            for (double x = 0.0; x < 4.0; x += 0.01) {
                most = fmax(most, fabs(hermite_in_pixel(2 * k + 2, x, side)));
            }
            double want = most / (greatest[k] * hermite_in_pixel(0, 0.0, side));
            /* steps of 0.07 sigma about a maximum; along the diagonal more where pixels are wide */
            assert_true(part[k] / want > 0.98);
            assert_true(part[k] / want < (side < 1.5 ? 1.02 : 1.25));
        }
    }
    /* along the diagonal: sums over frequencies of the OTF times those along it to the power of the
     * order, on a grid of 801 x 801, at 14 places */
    const double widths[] = {0.47138, 0.63700},
                 diagonal[2][3] = {{0.678, 0.442, 0.272}, {0.811, 0.651, 0.517}};
    for (int n = 0; n < 2; n++) {
        double part[3];
        bst_smear_find_pixel_parts(widths[n], 1, part);
        for (int k = 0; k < 3; k++) {
            bst_assert_close(part[k], diagonal[n][k], 2e-3);
        }
    }
}

/* Largest change of a Gaussian of amplitude A, over its noise there, by a shift d: by steps. */
static double shifted(double peak_e, double sigma, double dark_e2, double d) {
    double worst = 0.0;
    for (double x = -6.0 * sigma; x < 6.0 * sigma; x += 0.002 * sigma) {
        double here = peak_e * exp(-0.5 * x * x / (sigma * sigma));
        double there = peak_e * exp(-0.5 * (x + d) * (x + d) / (sigma * sigma));
        worst = fmax(worst, fabs(there - here) / sqrt(here + dark_e2));
    }
    return worst;
}

static void a_shared_track_costs_the_shift(void **state) {
    (void)state;
    bst_smear *s = calloc(1, sizeof *s);
    assert_non_null(s);
    s->half_diagonal_px = 700.0;
    s->spread_px = 0.004;
    s->stretch = 1.2;
    s->sigma_px = 0.9;
    s->dark_variance_e2 = 100.0;
    /* in proportion to the distance, with its square beyond the corner */
    const double distance[] = {70.0, 350.0, 700.0, 1050.0}, part[] = {0.1, 0.5, 1.0, 2.25};
    for (int k = 0; k < 4; k++) {
        double d = 0.004 * 1.2 * part[k];
        for (double peak_e = 10.0; peak_e < 1e8; peak_e *= 10.0) {
            double bound = bst_smear_single_error(s, peak_e, distance[k]);
            double truth = shifted(peak_e, 0.9, 100.0, d);
            assert_true(bound >= 0.99 * truth);
            assert_true(peak_e < 1e6 || bound <= 1.05 * truth); /* bright: sqrt(2 / e) / sigma */
            assert_true(bound <= 1.5 * truth);                  /* faint: e^-1/2 / sigma */
        }
    }
    /* no more than all its light, at another place */
    s->spread_px = 50.0;
    bst_assert_close(bst_smear_single_error(s, 500.0, 700.0), 500.0 / 10.0, 1e-9);
    free(s);
}

/* Sources beside a window at (100, 50) that is wider than high, on a sensor with its boresight off
 * the middle: what reaches it goes with the sixth power of the distance, in diffraction wings with
 * the third. */
static void errors_fade_outside_the_window(void **state) {
    (void)state;
    bst_smear *s = calloc(1, sizeof *s);
    assert_non_null(s);
    s->camera = (bst_camera){.width_px = 400, .height_px = 300, .boresight_offset_px = {5.0, -7.0}};
    s->window = (bst_window){100, 50, 64, 32};
    s->sigma_px = 1.1;
    s->margin_px = 20.0;
    s->dark_variance_e2 = 100.0;
    const double gap = 9.0, low[2] = {-2.0, -1.0}, high[2] = {3.0, 4.0};
    /* positions whose nearest end is 9 px from the window's outer pixels' outer edges + 0.5 */
    const double at[4][2] = {{100.0 - 1.0 - gap - high[0], 60.0},
                             {164.0 + gap - low[0], 60.0},
                             {120.0, 50.0 - 1.0 - gap - high[1]},
                             {120.0, 82.0 + gap - low[1]}};
    const double beyond = 25.0;
    for (int k = 0; k < 8; k++) {
        bool gaussian = k < 4;
        s->options.node_sigma_px = gaussian ? 0.0 : 1.3;
        bst_smear_drawn d = {.x = at[k % 4][0] - (199.5 + 5.0),
                             .y = at[k % 4][1] - (149.5 - 7.0),
                             .low = {low[0], low[1]},
                             .high = {high[0], high[1]},
                             .radius = 6};
        const bst_error_budget_source whole = {.peak_e = 50.0f,
                                               .nodes_e = 8.0f,
                                               .predicted_e = 6.0f,
                                               .shared_e = 4.0f,
                                               .excess_e = 2.0f,
                                               .border_e = 1.0f};
        double share = gaussian ? 0.1 * pow(3.3 / gap, 6.0) : 0.3 * pow(3.3 / gap, 3.0);
        s->last_error = whole;
        bst_smear_bring_to_window(s, &d);
        bst_assert_close(s->last_presence, share, 1e-9);
        bst_assert_close(s->last_error.nodes_e, 8.0 * share, 1e-6);
        bst_assert_close(s->last_error.predicted_e, 6.0 * share, 1e-6);
        bst_assert_close(s->last_error.shared_e, 4.0 * share, 1e-6);
        assert_true(s->last_error.peak_e == 0.0f && s->last_error.border_e == 1.0f);
        assert_true(s->last_error.excess_e == (gaussian ? 0.0f : 2.0f)); /* 9 px: off the stamp */
        assert_false(s->last_leaves);
        d.radius = 8;
        s->last_error = whole;
        bst_smear_bring_to_window(s, &d);
        assert_true(s->last_error.excess_e == 2.0f);
        /* so bright that what is left of its light is still over the noise */
        s->last_error = whole;
        s->last_error.peak_e = 1e12f;
        bst_smear_bring_to_window(s, &d);
        assert_true(s->last_error.nodes_e == 8.0f && s->last_error.peak_e == 1e12f);
        assert_true(s->last_presence == 1.0);
        /* further out than what the window's margin renders */
        d.x += (k % 4 == 0 ? -1.0 : k % 4 == 1 ? 1.0 : 0.0) * beyond;
        d.y += (k % 4 == 2 ? -1.0 : k % 4 == 3 ? 1.0 : 0.0) * beyond;
        s->last_error = whole;
        bst_smear_bring_to_window(s, &d);
        assert_true(s->last_leaves);
        /* within three sigma: all of it */
        bst_smear_drawn near = {.x = at[k % 4][0] - 204.5,
                                .y = at[k % 4][1] - 142.5,
                                .low = {low[0], low[1]},
                                .high = {high[0], high[1]},
                                .radius = 6};
        near.x += (k % 4 == 0 ? 1.0 : k % 4 == 1 ? -1.0 : 0.0) * 5.8;
        near.y += (k % 4 == 2 ? 1.0 : k % 4 == 3 ? -1.0 : 0.0) * 5.8;
        s->last_error = whole;
        bst_smear_bring_to_window(s, &near);
        assert_true(s->last_presence == 1.0 && s->last_error.nodes_e == 8.0f);
        assert_false(s->last_leaves);
    }
    free(s);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_rotation_becomes_the_shift_of_the_boresight),
        cmocka_unit_test(corner_stars_move_otherwise_by_as_much),
        cmocka_unit_test(midpoints_of_equal_parts),
        cmocka_unit_test(paths_that_rest),
        cmocka_unit_test(stretches_end_at_knots_and_follow_the_brightness),
        cmocka_unit_test(the_main_axis_of_a_matrix),
        cmocka_unit_test(errors_between_scales),
        cmocka_unit_test(errors_of_faint_groups_count_less),
        cmocka_unit_test(derivatives_in_pixels),
        cmocka_unit_test(a_shared_track_costs_the_shift),
        cmocka_unit_test(errors_fade_outside_the_window),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
