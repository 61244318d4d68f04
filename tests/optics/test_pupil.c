/* The aperture on a small grid and its autocorrelation, against counts of points and sums over
 * shifts; three vanes that no axis is parallel to, and a wavefront without symmetry. */
#include "sim/optics/pupil.h"

#include "boresight/vec.h"
#include "tests/test_support.h"

enum { SIDE = 24 };
#define CELL (1.0 / 21.0)

static bst_pupil make(void) {
    bst_pupil p = {.inner = 0.35, .vanes = 3, .vane_width = 0.06, .vane_rad = 0.4};
    /* over the disc of radius 1: twice the coordinates in diameters */
    p.wavefront.c[1][0] = 3e-8;
    p.wavefront.c[0][1] = -2e-8;
    p.wavefront.c[2][1] = 9e-8;
    p.wavefront.c[0][2] = -4e-8;
    p.wavefront.c[1][1] = 5e-8;
    return p;
}

/* Whether a place, in diameters from the centre, is open. */
static bool is_open(const bst_pupil *p, double x, double y) {
    double r = hypot(x, y);
    if (r > 0.5 || r < 0.5 * p->inner) {
        return false;
    }
    for (int k = 0; k < p->vanes; k++) {
        double angle = p->vane_rad + 2.0 * BST_PI * k / p->vanes;
        double along = x * cos(angle) + y * sin(angle), across = y * cos(angle) - x * sin(angle);
        if (along > 0.0 && fabs(across) < 0.5 * p->vane_width) {
            return false;
        }
    }
    return true;
}

static void mask_is_the_share_of_open_points(void **state) {
    (void)state;
    enum { POINTS = 40 };
    static double open[SIDE * SIDE];
    bst_pupil p = make();
    for (int pass = 0; pass < 3; pass++) {
        p.vanes = pass == 2 ? 0 : 3 + pass;
        p.vane_rad = pass == 1 ? 0.0 : 0.4; /* along the axes */
        p.inner = pass == 2 ? 0.0 : 0.35;
        bst_pupil_mask(&p, CELL, SIDE, open);
        double sum = 0.0;
        for (int i = 0; i < SIDE * SIDE; i++) {
            double share = 0.0;
            for (int n = 0; n < POINTS * POINTS; n++) {
                double x = i % SIDE - SIDE / 2 + (n % POINTS + 0.5) / POINTS - 0.5;
                double y = i / SIDE - SIDE / 2 + (n / POINTS + 0.5) / POINTS - 0.5;
                share += is_open(&p, CELL * x, CELL * y) ? 1.0 / (POINTS * POINTS) : 0.0;
            }
            /* lines of the mask, points of the count */
            bst_assert_close(open[i], share, 0.06);
            sum += open[i] - share;
        }
        bst_assert_close(sum, 0.0, 0.5);
    }
    double area = 0.0; /* of the last: a circle */
    for (int i = 0; i < SIDE * SIDE; i++) {
        area += open[i] * CELL * CELL;
    }
    bst_assert_close(area, 0.25 * BST_PI, 2e-3);
}

static double wavefront(const bst_pupil *p, double x, double y) {
    const double(*c)[BST_ZERNIKE_DEGREE + 1] = p->wavefront.c;
    double u = 2.0 * x, v = 2.0 * y;
    return c[1][0] * u + c[0][1] * v + c[2][1] * u * u * v + c[0][2] * v * v + c[1][1] * u * v;
}

static void transfer_is_the_autocorrelation(void **state) {
    (void)state;
    static double open[2 * SIDE * 2 * SIDE];
    bst_ctx ctx = {0};
    bst_pupil p = make();
    bst_pupil_work *work;
    bst_pupil_shifts h;
    bst_assert_ok(&ctx, bst_pupil_work_create(&ctx, SIDE, &work));
    for (int pass = 0; pass < 2; pass++) {
        double wavelength = pass ? 6e-7 : 0.0; /* 0: without the wavefront */
        bst_assert_ok(&ctx, bst_pupil_transfer(&ctx, work, &p, CELL, wavelength, &h));
        int n = h.side;
        assert_true(n >= 2 * 21 && n <= 2 * 2 * SIDE);
        bst_pupil_mask(&p, CELL, n < 2 * SIDE ? n : 2 * SIDE, open);
        int side = n < 2 * SIDE ? n : 2 * SIDE, middle = side / 2;
        double area = 0.0;
        for (int i = 0; i < side * side; i++) {
            area += open[i];
        }
        for (int ky = -9; ky <= 9; ky += 3) {
            for (int kx = 0; kx <= 12; kx += 4) {
                double sum[2] = {0.0, 0.0};
                for (int j = 0; j < side; j++) {
                    for (int i = 0; i < side; i++) {
                        int a = i + kx, b = j + ky;
                        if (a < 0 || b < 0 || a >= side || b >= side) {
                            continue;
                        }
                        double both = open[j * side + i] * open[b * side + a];
                        double turn = wavefront(&p, CELL * (a - middle), CELL * (b - middle)) -
                                      wavefront(&p, CELL * (i - middle), CELL * (j - middle));
                        double phase = pass ? 2.0 * BST_PI * turn / 6e-7 : 0.0;
                        sum[0] += both * cos(phase) / area;
                        sum[1] += both * sin(phase) / area;
                    }
                }
                const float *at =
                    h.rows + 2 * ((size_t)((ky + n) % n) * (size_t)h.stride + (size_t)kx);
                bst_assert_close(at[0], sum[0], 1e-5);  /* single precision */
                bst_assert_close(at[1], -sum[1], 1e-5); /* conjugated */
            }
        }
    }
    bst_pupil_work_free(work);
}

/* Largest gradient over the disc by a search of its own. */
static void slope_is_the_largest_gradient(void **state) {
    (void)state;
    const bst_pupil p = make();
    double most = 0.0;
    for (int k = 0; k < 20000; k++) {
        double r = 0.5 * sqrt((k % 40 + 1) / 40.0), angle = 2.0 * BST_PI * (k / 40) / 500.0;
        double x = r * cos(angle), y = r * sin(angle), step = 1e-5;
        double gx = (wavefront(&p, x + step, y) - wavefront(&p, x - step, y)) / (2.0 * step);
        double gy = (wavefront(&p, x, y + step) - wavefront(&p, x, y - step)) / (2.0 * step);
        most = fmax(most, hypot(gx, gy));
    }
    bst_assert_close(bst_pupil_slope_m(&p), most, 0.01 * most);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(mask_is_the_share_of_open_points),
        cmocka_unit_test(transfer_is_the_autocorrelation),
        cmocka_unit_test(slope_is_the_largest_gradient),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
