/* Paths of stars and their filter against curves, sums and Gaussians written down here, in a wide
 * field whose middle is not on a diagonal. */
#include "boresight/vec.h"
#include "imgproc/streak/path_filter.h"
#include "tests/test_support.h"

enum { WIDE = 150, HIGH = 110, MIDDLE_X = 75, MIDDLE_Y = 55 };
#define TANGENT 0.009 /* a field of 68 x 52 degrees */
#define PSF 1.3
#define LEAST_INSIDE 0.25

static float image[WIDE * HIGH];
static const bst_star_path_image picture = {image, WIDE, HIGH};

/* A turn of the camera about axes across its boresight moves a star's gnomonic place by the map
 * times the motion of the boresight's place. */
static void map_of_a_turn(void **state) {
    (void)state;
    const bst_star_path path = {.centre = {MIDDLE_X, MIDDLE_Y}, .tangent_per_px = TANGENT};
    const double places[][2] = {{12.0, 95.0}, {140.0, 20.0}, {75.0, 55.0}, {75.0, 100.0}};
    for (int i = 0; i < 4; i++) {
        double m[3];
        bst_star_path_map(&path, places[i][0], places[i][1], m);
        for (int axis = 0; axis < 2; axis++) {
            const double eps = 1e-6;
            bst_vec3 turn = {axis == 1 ? -eps : 0.0, axis == 0 ? eps : 0.0, 0.0};
            bst_vec3 star = {(places[i][0] - MIDDLE_X) * TANGENT,
                             (places[i][1] - MIDDLE_Y) * TANGENT, 1.0};
            bst_vec3 moved = bst_quat_rotate(bst_quat_from_rotvec(turn), star);
            double dx = (moved.x / moved.z - star.x) / eps, dy = (moved.y / moved.z - star.y) / eps;
            bst_assert_close(axis == 0 ? m[0] : m[1], dx, 1e-5);
            bst_assert_close(axis == 0 ? m[1] : m[2], dy, 1e-5);
        }
    }
}

static void between_pixels(void **state) {
    (void)state;
    for (int i = 0; i < WIDE * HIGH; i++) {
        double x = i % WIDE, y = i / WIDE;
        image[i] = (float)(3.0 + 0.5 * x - 0.25 * y + 0.125 * x * y);
    }
    const double at[][2] = {{0.0, 0.0}, {10.25, 30.75}, {148.9, 3.5}, {2.5, 108.9}};
    for (int i = 0; i < 4; i++) {
        double x = at[i][0], y = at[i][1];
        bst_assert_close(bst_star_path_image_at(&picture, x, y),
                         3.0 + 0.5 * x - 0.25 * y + 0.125 * x * y, 1e-3);
    }
    const double out[][2] = {{-0.1, 5.0}, {5.0, -0.1}, {149.0, 5.0}, {5.0, 109.0}};
    for (int i = 0; i < 4; i++) {
        bst_assert_close(bst_star_path_image_at(&picture, out[i][0], out[i][1]), 0.0, 0.0);
    }
}

/* A bent path about the middle: u from -0.5 to 0.5, in pixels at the boresight. `way` turns it by
 * quarters. */
static void curve(int way, double u, double *x, double *y) {
    double a = 40.0 * u, b = 9.0 * u + 22.0 * u * u;
    *x = way % 2 ? -b : a;
    *y = way % 2 ? a : b;
    if (way > 1) {
        *y = -*y;
    }
}

/* The place of a star's path, by its own map. */
static void on_image(const bst_star_path *p, double sx, double sy, double dx, double dy, double *x,
                     double *y) {
    double tx = (sx - MIDDLE_X) * p->tangent_per_px, ty = (sy - MIDDLE_Y) * p->tangent_per_px;
    *x = sx + (1 + tx * tx) * dx + tx * ty * dy;
    *y = sy + tx * ty * dx + (1 + ty * ty) * dy;
}

static void add_gaussian(double cx, double cy, double height) {
    for (int y = (int)fmax(cy - 9, 0); y <= cy + 9 && y < HIGH; y++) {
        for (int x = (int)fmax(cx - 9, 0); x <= cx + 9 && x < WIDE; x++) {
            double r2 = (x - cx) * (x - cx) + (y - cy) * (y - cy);
            image[y * WIDE + x] += (float)(height * exp(-r2 / (4.0 * PSF * PSF)));
        }
    }
}

/* Light of the curve at a star, of `height` far from its ends: Gaussians of sqrt(2) PSF. */
static void draw_curve(const bst_star_path *p, int way, double sx, double sy, double height) {
    enum { PARTS = 200 };
    double previous[2] = {0}, norm = 1.0 / (2.0 * PSF * sqrt(BST_PI));
    for (int k = 0; k <= PARTS; k++) {
        double dx, dy, cx, cy;
        curve(way, (double)k / PARTS - 0.5, &dx, &dy);
        on_image(p, sx, sy, dx, dy, &cx, &cy);
        double step = k > 0 ? hypot(cx - previous[0], cy - previous[1]) : 0.0;
        previous[0] = cx;
        previous[1] = cy;
        add_gaussian(cx, cy, height * norm * step);
    }
}

/* Distance of a place from the curve. */
static double off_curve(int way, double x, double y) {
    double least = INFINITY;
    for (int k = 0; k <= 300; k++) {
        double cx, cy;
        curve(way, 1.2 * (k / 300.0 - 0.5), &cx, &cy); /* and beyond its ends */
        least = fmin(least, hypot(cx - x, cy - y));
    }
    return least;
}

/* The path's places are 2 px apart on the curve, its light is even, and it ends as the curve does;
 * relative to the place of its middle sample. */
static void check_path(const bst_star_path *p, int way, double mx, double my, double rms_px,
                       double apart) {
    double sum = 0.0, square = 0.0, x[2], y[2];
    assert_true(p->count >= 17 && p->count <= 27);
    for (int k = 0; k < p->count; k++) {
        double px = p->place[k][0], py = p->place[k][1];
        square += pow(off_curve(way, px + mx, py + my), 2.0) / p->count;
        if (k > 0) {
            bst_assert_close(hypot(px - p->place[k - 1][0], py - p->place[k - 1][1]), 2.0, apart);
        }
        sum += p->light[k];
        if (k > 3 && k < p->count - 4) {
            bst_assert_close(p->light[k], 1.0, 0.12);
        } else if (k > 0 && k < p->count - 1) { /* the PSF dims what is next to an end */
            bst_assert_close(p->light[k], 1.0, 0.05);
        }
    }
    assert_true(square < rms_px * rms_px);
    bst_assert_close(sum / p->count, 1.0, 1e-9);
    int a = (p->count - 1) / 2, b = p->count / 2;
    bst_assert_close(p->place[a][0] + p->place[b][0], 0.0, 1e-6);
    bst_assert_close(p->place[a][1] + p->place[b][1], 0.0, 1e-6);
    curve(way, -0.5, &x[0], &y[0]);
    curve(way, 0.5, &x[1], &y[1]);
    int first = hypot(x[0] - mx - p->ends[0][0], y[0] - my - p->ends[0][1]) < 10.0 ? 0 : 1;
    for (int e = 0; e < 2; e++) {
        bst_assert_close(p->ends[e][0] + mx, x[first ^ e], 1.5);
        bst_assert_close(p->ends[e][1] + my, y[first ^ e], 1.5);
    }
}

/* Pixels above a level; their number. */
static int above(double level, int *out) {
    int n = 0;
    for (int i = 0; i < WIDE * HIGH; i++) {
        if ((double)image[i] > level) {
            out[n++] = i;
        }
    }
    return n;
}

/* Light of unit-height steps along the curve between two of its u. */
static void draw_part(double sx, double sy, double from, double to, double height) {
    const int steps = (int)ceil(40.0 * (to - from) / 0.3);
    for (int k = 0; k < steps; k++) {
        double dx, dy;
        curve(0, from + (to - from) * (k + 0.5) / steps, &dx, &dy);
        add_gaussian(sx + dx, sy + dy, height * 0.3 / (2.0 * PSF * sqrt(BST_PI)));
    }
}

/* A bright star and five faint ones, whose streaks end earlier: they may be pieces of streaks. If
 * they decide the end of the path while the bright star's light goes on, with that of another star
 * on it, the end is not certain. */
static void light_beyond_an_end(void **state) {
    (void)state;
    enum { STARS = 6 };
    static bst_star_path p;
    static int pixels[WIDE * HIGH];
    static const double at[STARS][2] = {{62, 46},  {30, 25}, {115, 90},
                                        {110, 25}, {40, 85}, {80, 70}};
    bst_star_path_star stars[STARS];
    double x, y;
    p = (bst_star_path){.centre = {MIDDLE_X, MIDDLE_Y}, .tangent_per_px = 1e-6};
    memset(image, 0, sizeof image);
    draw_part(at[0][0], at[0][1], -0.5, 0.2, 30.0);
    assert_true(bst_star_path_fit(&p, &picture, pixels, above(5.0, pixels), &x, &y));
    for (int lit = 0; lit < 2; lit++) {
        bst_star_path path = p;
        for (int i = 0; i < STARS; i++) {
            stars[i] = (bst_star_path_star){x + at[i][0] - at[0][0], y + at[i][1] - at[0][1],
                                            i == 0 ? 30.0 : 5.0};
            if (lit == 0 && i > 0) {
                draw_part(at[i][0], at[i][1], -0.5, 0.2, 5.0);
            }
        }
        if (lit) {
            draw_part(at[0][0], at[0][1], 0.2, 0.5, 60.0);
        }
        bst_star_path_refine(&path, &picture, stars, STARS);
        print_message("%d samples, margins %.1f and %.1f\n", path.count, path.margin[0],
                      path.margin[1]);
        assert_true(fmax(path.margin[0], path.margin[1]) > 6.0);
        assert_true((fmin(path.margin[0], path.margin[1]) > 6.0) == !lit);
    }
}

/* Path of a curve's part, to vote on; the stars' amplitudes. */
static bst_star_path part_of_curve(double from, double to, bst_star_path_star *stars, int count,
                                   const double (*at)[2], const double *amplitudes) {
    static int pixels[WIDE * HIGH];
    bst_star_path p = {.centre = {MIDDLE_X, MIDDLE_Y}, .tangent_per_px = 1e-6};
    double x, y;
    memset(image, 0, sizeof image);
    draw_part(at[0][0], at[0][1], from, to, 30.0);
    assert_true(bst_star_path_fit(&p, &picture, pixels, above(5.0, pixels), &x, &y));
    for (int i = 0; i < count; i++) {
        stars[i] =
            (bst_star_path_star){x + at[i][0] - at[0][0], y + at[i][1] - at[0][1], amplitudes[i]};
    }
    return p;
}

/* Identified stars vote on the ends of a path: against others where their light ends, whatever lies
 * beyond a bright one; for others if the path is a piece of their streaks, or longer than they. */
static void votes_on_the_ends(void **state) {
    (void)state;
    enum { STARS = 6 };
    static const double at[STARS][2] = {{62, 46},  {30, 25}, {115, 90},
                                        {110, 25}, {40, 85}, {80, 70}};
    static const double amplitudes[STARS] = {30.0, 5.0, 5.0, 4.0, 4.0, 3.0};
    /* the path's end, and those of the streaks */
    static const double ends[][2] = {{0.5, 0.5}, {0.2, 0.5}, {0.5, 0.2}, {0.2, 0.2}};
    bst_star_path_star stars[STARS];
    for (int i = 0; i < 4; i++) {
        bst_star_path p = part_of_curve(-0.5, ends[i][0], stars, STARS, at, amplitudes);
        double votes[2];
        memset(image, 0, sizeof image);
        for (int k = 0; k < STARS; k++) {
            draw_part(at[k][0], at[k][1], -0.5, ends[i][1], amplitudes[k]);
        }
        if (i == 3) { /* another star's light */
            draw_part(at[0][0], at[0][1], 0.2, 0.5, 60.0);
        }
        bst_star_path_vote(&p, &picture, stars, STARS, votes);
        print_message("path to %.1f, light to %.1f: votes %.1f and %.1f\n", ends[i][0], ends[i][1],
                      votes[0], votes[1]);
        if (i == 1 || i == 2) { /* ln 4 of each star, and one may be in doubt */
            assert_true(fmax(votes[0], votes[1]) > (STARS - 1) * log(4.0));
        } else {
            assert_true(fmax(votes[0], votes[1]) < -(STARS - 3) * log(4.0));
        }
        assert_true(fmin(votes[0], votes[1]) < -(STARS - 2) * log(4.0));
        /* the ends move to where the light ends; a sample is 2 px */
        const int before = p.count;
        assert_true(bst_star_path_move_ends(&p, &picture, stars, STARS) == (i == 1 || i == 2));
        double dx, dy, ex, ey;
        curve(0, ends[i][1], &dx, &dy);
        curve(0, -0.5, &ex, &ey);
        double length = hypot(p.ends[1][0] - p.ends[0][0], p.ends[1][1] - p.ends[0][1]);
        bst_assert_close(length, hypot(dx - ex, dy - ey), 3.0);
        assert_true(i == 1   ? p.count > before + 4
                    : i == 2 ? p.count < before - 4
                             : p.count == before);
        bst_assert_close(hypot(p.ends[0][0] + p.ends[1][0], p.ends[0][1] + p.ends[1][1]), 0.0,
                         0.3 * length);
    }
    bst_star_path point = {.count = 1};
    double votes[2];
    assert_false(bst_star_path_move_ends(&point, &picture, stars, STARS));
    bst_star_path_vote(&point, &picture, stars, STARS, votes);
    assert_true(isinf(votes[0]) && votes[0] < 0.0 && isinf(votes[1]) && votes[1] < 0.0);
}

/* The path of one star, and that of several from a worse start, on all four sides. */
static void path_of_stars(void **state) {
    (void)state;
    static bst_star_path p, rough;
    static int pixels[WIDE * HIGH];
    for (int way = 0; way < 4; way++) {
        p = (bst_star_path){.centre = {MIDDLE_X, MIDDLE_Y}, .tangent_per_px = TANGENT};
        memset(image, 0, sizeof image);
        /* the first one near the middle, where steps of its path are those of the frame, or far */
        const bst_star_path_star at[] = {{way < 2 ? 62.0 : 32.0, way < 2 ? 46.0 : 30.0, 40.0},
                                         {118.0, 78.0, 30.0},
                                         {118.0, 30.0, 35.0}};
        draw_curve(&p, way, at[0].x_px, at[0].y_px, at[0].amplitude);
        double x, y, dx, dy;
        assert_true(bst_star_path_fit(&p, &picture, pixels, above(3.0, pixels), &x, &y));
        /* the middle sample's place on the curve: by the first-order map back */
        double tx = (at[0].x_px - MIDDLE_X) * TANGENT, ty = (at[0].y_px - MIDDLE_Y) * TANGENT;
        double det = 1.0 + tx * tx + ty * ty, u = x - at[0].x_px, v = y - at[0].y_px;
        dx = ((1 + ty * ty) * u - tx * ty * v) / det;
        dy = ((1 + tx * tx) * v - tx * ty * u) / det;
        assert_true(off_curve(way, dx, dy) < 0.4);
        check_path(&p, way, dx, dy, 0.3, way < 2 ? 0.12 : 0.35);
        double sx, sy; /* what crosses the first star's path changes no other's */
        curve(way, 0.25, &sx, &sy);
        on_image(&p, at[0].x_px, at[0].y_px, sx, sy, &sx, &sy);
        add_gaussian(sx, sy, 300.0);
        /* other stars, from a start that is short at one end and 1 px off across */
        for (int i = 1; i < 3; i++) {
            draw_curve(&p, way, at[i].x_px, at[i].y_px, at[i].amplitude);
        }
        rough = p;
        rough.count = p.count - 4;
        for (int k = 0; k < rough.count; k++) {
            rough.place[k][0] += way % 2 ? 1.0 : 0.0;
            rough.place[k][1] += way % 2 ? 0.0 : 1.0;
        }
        bst_star_path_star stars[3];
        for (int i = 0; i < 3; i++) {
            stars[i].amplitude = at[i].amplitude;
            on_image(&p, at[i].x_px, at[i].y_px, dx, dy, &stars[i].x_px, &stars[i].y_px);
        }
        bst_star_path_refine(&rough, &picture, stars, 3);
        /* where the refined middle lies on the curve: the nearest shift of the middle along it */
        double best = INFINITY, mx = 0.0, my = 0.0;
        for (int k = 0; k <= 60; k++) {
            double cx, cy, sum = 0.0;
            curve(way, 0.4 * (k / 60.0 - 0.5), &cx, &cy);
            for (int i = 0; i < rough.count; i++) {
                sum += pow(off_curve(way, cx + rough.place[i][0], cy + rough.place[i][1]), 2.0);
            }
            if (sum < best) {
                best = sum;
                mx = cx;
                my = cy;
            }
        }
        check_path(&rough, way, mx, my, 0.3, 0.35);
    }
}

/* A round source is a point at its centroid; nothing is too long for the room here. */
static void point_source(void **state) {
    (void)state;
    static bst_star_path p;
    static int pixels[WIDE * HIGH];
    p = (bst_star_path){.centre = {MIDDLE_X, MIDDLE_Y}, .tangent_per_px = TANGENT};
    double x, y;
    memset(image, 0, sizeof image);
    for (int i = 0; i < WIDE * HIGH; i++) {
        double dx = i % WIDE - 40.3, dy = i / WIDE - 61.8;
        image[i] = (float)(200.0 * exp(-(dx * dx + dy * dy) / (4.0 * PSF * PSF)));
    }
    assert_true(bst_star_path_fit(&p, &picture, pixels, above(3.0, pixels), &x, &y));
    assert_int_equal(p.count, 1);
    bst_assert_close(x, 40.3, 0.05);
    bst_assert_close(y, 61.8, 0.05);
    bst_assert_close(hypot(p.place[0][0], p.place[0][1]), 0.0, 0.0);
    bst_assert_close(p.light[0], 1.0, 0.0);
}

/* ---- the filter ---- */

/* Sum over pairs of samples of light, light and correlation, one of the paths shifted along x, y.
 */
static double pairs(const bst_star_path *p, double x, double y) {
    double sum = 0.0;
    for (int k = 0; k < p->count; k++) {
        for (int l = 0; l < p->count; l++) {
            double dx = p->place[k][0] - p->place[l][0] - x,
                   dy = p->place[k][1] - p->place[l][1] - y;
            sum += p->light[k] * p->light[l] * exp(-(dx * dx + dy * dy) / (4.0 * PSF * PSF));
        }
    }
    return sum;
}

static void straight(bst_star_path *p, double angle_rad, double tangent) {
    *p = (bst_star_path){.count = 11, .centre = {MIDDLE_X, MIDDLE_Y}, .tangent_per_px = tangent};
    for (int k = 0; k < p->count; k++) {
        p->place[k][0] = 2.0 * (k - 5) * cos(angle_rad);
        p->place[k][1] = 2.0 * (k - 5) * sin(angle_rad);
        p->light[k] = 0.4 + 0.12 * k;
    }
    for (int e = 0; e < 2; e++) {
        p->ends[e][0] = p->place[e ? 10 : 0][0];
        p->ends[e][1] = p->place[e ? 10 : 0][1];
    }
}

static void draw_star(const bst_star_path *p, double sx, double sy, double amplitude) {
    for (int k = 0; k < p->count; k++) {
        double cx, cy;
        on_image(p, sx, sy, p->place[k][0], p->place[k][1], &cx, &cy);
        add_gaussian(cx, cy, amplitude * p->light[k]);
    }
}

/* Finds the brighter of two stars, at any angle of their streak; then the other, once the first is
 * subtracted or left out. */
static void two_stars(void **state) {
    (void)state;
    static bst_star_path p;
    bst_ctx ctx = {0};
    const double angles[] = {-0.8, -1.2, 1.5};
    for (int i = 0; i < 3; i++) {
        double c = cos(angles[i]), s = sin(angles[i]);
        const double bright = i == 1 ? 0.7 : 9.0;
        straight(&p, angles[i], i == 0 ? TANGENT : 0.0);
        memset(image, 0, sizeof image);
        draw_star(&p, 40.3, 31.6, bright);
        draw_star(&p, 112.7, 76.2, 0.6 * bright);
        bst_path_filter *f;
        bst_path_filter_peak one, two;
        bst_assert_ok(&ctx, bst_path_filter_create(&ctx, &p, &picture, PSF, LEAST_INSIDE, &f));
        assert_true(bst_path_filter_highest(f, &one));
        /* samples are read at whole pixels: 0.3 px, and a few per cent of the light */
        double near = i == 0 ? 0.8 : 0.4; /* maps are those of blocks of 16 px */
        bst_assert_close(one.x_px, 40.3, near);
        bst_assert_close(one.y_px, 31.6, near);
        bst_assert_close(one.amplitude / bright, 1.0, 0.15);
        double gain = sqrt(pairs(&p, 0.0, 0.0));
        bst_assert_close(one.snr / one.amplitude, gain, 1e-4 * gain);
        bst_assert_close(one.inside, 1.0, 1e-5);
        assert_true(one.whole);
        /* along: where the shifted path has lost 0.5 / snr^2; across by sqrt(2) PSF over the SNR;
         * 0.2 px both ways, and half the square of half the length in a wide field */
        double wanted = 0.5 / (one.snr * one.snr), along = 0.0;
        while (1.0 - pairs(&p, (along + 0.01) * c, (along + 0.01) * s) / gain / gain < wanted) {
            along += 0.01;
        }
        double half = i == 0 ? 10.0 * TANGENT : 0.0, fixed = 0.2 + 0.5 * half * half * MIDDLE_X;
        double across2 = 2.0 * PSF * PSF / one.snr / one.snr + fixed * fixed;
        double along2 = along * along + across2;
        bst_assert_close(one.cov_xx, c * c * along2 + s * s * across2, 0.06 * along2);
        bst_assert_close(one.cov_yy, s * s * along2 + c * c * across2, 0.06 * along2);
        bst_assert_close(one.cov_xy, c * s * (along2 - across2), 0.06 * along2);
        bst_path_filter_subtract(f, &one);
        assert_true(bst_path_filter_highest(f, &two));
        bst_assert_close(two.x_px, 112.7, near);
        bst_assert_close(two.y_px, 76.2, near);
        bst_assert_close(two.amplitude / bright, 0.6, 0.09);
        bst_path_filter_subtract(f, &two);
        if (bst_path_filter_highest(f, &two)) {
            assert_true(two.snr < 0.2 * one.snr);
        }
        bst_path_filter_free(f);
        bst_assert_ok(&ctx, bst_path_filter_create(&ctx, &p, &picture, PSF, LEAST_INSIDE, &f));
        bst_path_filter_leave_out(f, &one, 25.0);
        assert_true(bst_path_filter_highest(f, &two));
        bst_assert_close(two.x_px, 112.7, near);
        bst_assert_close(two.y_px, 76.2, near);
        /* a circle, and no more */
        bst_path_filter_peak there = {.x_px = 112.7, .y_px = 76.2 - 25.0};
        bst_path_filter_leave_out(f, &there, 23.5);
        assert_true(bst_path_filter_highest(f, &two));
        bst_assert_close(two.y_px, 76.2, near);
        bst_path_filter_free(f);
    }
}

/* A star half outside, over each edge: its noise is that of the samples inside. */
static void over_the_edges(void **state) {
    (void)state;
    static bst_star_path p;
    bst_ctx ctx = {0};
    const double places[][2] = {{3.0, 50.0}, {146.0, 50.0}, {60.0, 2.0}, {60.0, 107.0}};
    for (int i = 0; i < 4; i++) {
        bst_path_filter *f;
        bst_path_filter_peak peak;
        straight(&p, i < 2 ? 0.0 : BST_PI / 2.0, 0.0);
        memset(image, 0, sizeof image);
        draw_star(&p, places[i][0], places[i][1], 9.0);
        bst_assert_ok(&ctx, bst_path_filter_create(&ctx, &p, &picture, PSF, LEAST_INSIDE, &f));
        assert_true(bst_path_filter_highest(f, &peak));
        double inside = 0.0, all = 0.0;
        for (int k = 0; k < p.count; k++) {
            double x = round(peak.x_px) + p.place[k][0], y = round(peak.y_px) + p.place[k][1];
            bool in = x >= 0 && y >= 0 && x < WIDE && y < HIGH;
            all += p.light[k] * p.light[k];
            inside += in ? p.light[k] * p.light[k] : 0.0;
        }
        bst_assert_close(peak.x_px, places[i][0], 2.5);
        bst_assert_close(peak.y_px, places[i][1], 2.5);
        assert_true(inside / all > 0.25 && inside / all < 0.95);
        bst_assert_close(peak.inside, inside / all, 0.15);
        bst_assert_close(peak.snr / peak.amplitude, sqrt(peak.inside * pairs(&p, 0.0, 0.0)),
                         1e-3 * peak.snr / peak.amplitude);
        bst_path_filter_free(f);
    }
}

/* Once a point is subtracted, the highest place in its rows is that of the star. */
static void a_point_beside_a_star(void **state) {
    (void)state;
    static bst_star_path p;
    bst_ctx ctx = {0};
    bst_path_filter *f;
    bst_path_filter_peak peak;
    straight(&p, 0.0, 0.0);
    memset(image, 0, sizeof image);
    draw_star(&p, 100.0, 50.0, 3.0);
    add_gaussian(40.0, 51.0, 60.0);
    bst_assert_ok(&ctx, bst_path_filter_create(&ctx, &p, &picture, PSF, LEAST_INSIDE, &f));
    assert_true(bst_path_filter_highest(f, &peak));
    assert_true(peak.x_px < 55.0);
    bst_path_filter_subtract_point(f, 40.0, 51.0, 60.0);
    assert_true(bst_path_filter_highest(f, &peak));
    bst_assert_close(peak.x_px, 100.0, 0.4); /* samples at whole pixels */
    bst_assert_close(peak.y_px, 50.0, 0.4);
    bst_path_filter_free(f);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(map_of_a_turn),
        cmocka_unit_test(between_pixels),
        cmocka_unit_test(path_of_stars),
        cmocka_unit_test(light_beyond_an_end),
        cmocka_unit_test(votes_on_the_ends),
        cmocka_unit_test(point_source),
        cmocka_unit_test(two_stars),
        cmocka_unit_test(over_the_edges),
        cmocka_unit_test(a_point_beside_a_star),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
