/* A filter that begins with bounds, against one that filters every block: the same stars, in the
 * same order, in noise and over the edges. */
#include "boresight/rng.h"
#include "boresight/vec.h"
#include "imgproc/streak/path_filter_internal.h"
#include "tests/test_support.h"

enum { WIDE = 230, HIGH = 190, MOST = 60, STARS = 14, FIELDS = 12 };
#define LEAST_SNR 6.0
#define LEAST_INSIDE 0.25

static float image[WIDE * HIGH], noise[WIDE * HIGH], ones[WIDE * HIGH];
static const bst_star_path_image picture = {image, WIDE, HIGH};

/* A bent path of 30 to 60 samples whose light varies. */
static void make_path(bst_star_path *p, bst_rng_key key, uint64_t field) {
    const double angle = 2.0 * BST_PI * bst_rng_uniform(key, field, 0);
    *p = (bst_star_path){.count = 30 + (int)(30.0 * bst_rng_uniform(key, field, 1)),
                         .centre = {0.5 * (WIDE - 1), 0.5 * (HIGH - 1)},
                         .tangent_per_px = field % 2 ? 0.002 : 0.0};
    const double middle = 0.5 * (p->count - 1);
    for (int k = 0; k < p->count; k++) {
        const double u = 1.97 * (k - middle), v = 0.006 * u * u;
        p->place[k][0] = u * cos(angle) - v * sin(angle);
        p->place[k][1] = u * sin(angle) + v * cos(angle);
        p->light[k] = 1.0 + 0.3 * sin(0.4 * k);
    }
    for (int e = 0; e < 2; e++) {
        memcpy(p->ends[e], p->place[e ? p->count - 1 : 0], sizeof p->ends[e]);
    }
}

/* Adds a Gaussian of the convolved image. */
static void add_point(double cx, double cy, double height, double psf_px) {
    const int reach = (int)ceil(6.0 * psf_px);
    for (int y = (int)fmax(cy - reach, 0); y <= cy + reach && y < HIGH; y++) {
        for (int x = (int)fmax(cx - reach, 0); x <= cx + reach && x < WIDE; x++) {
            const double r2 = (x - cx) * (x - cx) + (y - cy) * (y - cy);
            image[y * WIDE + x] += (float)(height * exp(-0.25 * r2 / (psf_px * psf_px)));
        }
    }
}

static void add_star(const bst_star_path *p, double x, double y, double amplitude, double psf_px) {
    double m[3];
    bst_star_path_map(p, x, y, m);
    for (int k = 0; k < p->count; k++) {
        const double *u = p->place[k];
        add_point(x + m[0] * u[0] + m[1] * u[1], y + m[1] * u[0] + m[2] * u[1],
                  amplitude * p->light[k], psf_px);
    }
}

/* White noise, convolved with the PSF of unit sum of squares. */
static void add_noise(bst_rng_key key, uint64_t field, double psf_px) {
    const int reach = (int)ceil(4.0 * psf_px);
    for (uint64_t i = 0; i < WIDE * HIGH; i++) {
        noise[i] = (float)bst_rng_normal(key, field, i);
    }
    for (int y = 0; y < HIGH; y++) {
        for (int x = 0; x < WIDE; x++) {
            double sum = 0.0;
            for (int j = -reach; j <= reach; j++) {
                for (int i = -reach; i <= reach; i++) {
                    const int u = (x + i + WIDE) % WIDE, v = (y + j + HIGH) % HIGH;
                    sum += (double)noise[v * WIDE + u] *
                           exp(-0.5 * (i * i + j * j) / (psf_px * psf_px));
                }
            }
            image[y * WIDE + x] = (float)(sum / (sqrt(BST_PI) * psf_px));
        }
    }
}

/* Stars of SNR 4 to 100, half of them faint, up to some way outside the frame. */
static void draw(const bst_star_path *p, bst_rng_key key, uint64_t field, double psf_px) {
    const double gain = sqrt(p->count * sqrt(BST_PI) * psf_px); /* SNR over amplitude, about */
    add_noise(key, field, psf_px);
    for (uint64_t i = 0; i < STARS; i++) {
        const double snr = i % 2 ? 4.0 + 5.0 * bst_rng_uniform(key, field, 1000 + i)
                                 : 5.0 * pow(20.0, bst_rng_uniform(key, field, 1000 + i));
        add_star(p, (WIDE + 40) * bst_rng_uniform(key, field, 2000 + i) - 20,
                 (HIGH + 40) * bst_rng_uniform(key, field, 3000 + i) - 20, snr / gain, psf_px);
    }
}

/* True for a block of at least the SNR of a star and of all blocks about it. */
static bool holds_star(const bst_path_filter *f, int block) {
    const int x = block % f->columns, y = block / f->columns;
    bool star = (double)f->highest[block] > LEAST_SNR;
    for (int k = 0; k < 9; k++) {
        const int u = x + k % 3 - 1, v = y + k / 3 - 1;
        star = star && (u < 0 || v < 0 || u >= f->columns || v >= f->rows ||
                        f->highest[v * f->columns + u] <= f->highest[block]);
    }
    return star;
}

/* Blocks with a star; out: those whose bound is below its SNR. */
static int count_hidden(const bst_path_filter *bounded, const bst_path_filter *all, int *hidden) {
    int stars = 0;
    assert_int_equal(bounded->blocks, all->blocks);
    for (int i = 0; i < all->blocks; i++) {
        assert_int_equal(bounded->filtered[i], BST_PATH_BOUND);
        if (holds_star(all, i)) {
            stars++;
            *hidden += bounded->highest[i] < all->highest[i];
            assert_true(bounded->highest[i] < 2.2f * all->highest[i] + 3.0f);
        }
    }
    return stars;
}

/* Response of the filter to its own path, by all pairs of samples. */
static double own_response(const bst_star_path *p, double psf_px) {
    double sum = 0.0;
    for (int k = 0; k < p->count; k++) {
        for (int l = 0; l < p->count; l++) {
            const double x = p->place[k][0] - p->place[l][0], y = p->place[k][1] - p->place[l][1];
            sum += p->light[k] * p->light[l] * exp(-0.25 * (x * x + y * y) / (psf_px * psf_px));
        }
    }
    return sum;
}

static int list(bst_path_filter *f, bool leave_out, bst_path_filter_peak out[MOST]) {
    int count = 0;
    while (count < MOST && bst_path_filter_highest(f, &out[count]) && out[count].snr >= LEAST_SNR) {
        if (leave_out && count % 5 == 4) {
            bst_path_filter_leave_out(f, &out[count], 5.0);
        } else {
            bst_path_filter_subtract(f, &out[count]);
        }
        count++;
    }
    return count;
}

static void assert_same(const bst_path_filter_peak *a, int m, const bst_path_filter_peak *b,
                        int n) {
    assert_int_equal(m, n);
    for (int i = 0; i < n; i++) {
        /* the other filter sums floats for the noise, 1e-6 off; along a streak its maximum is flat,
         * and what the subtraction of a bright star leaves is a small difference */
        bst_assert_close(a[i].x_px, b[i].x_px, 0.01);
        bst_assert_close(a[i].y_px, b[i].y_px, 0.01);
        bst_assert_close(a[i].snr, b[i].snr, 1e-3 * b[i].snr);
        bst_assert_close(a[i].inside, b[i].inside, 1e-4);
        bst_assert_close(a[i].cov_xx, b[i].cov_xx, 1e-2 * b[i].cov_xx);
        assert_true(a[i].whole == b[i].whole);
    }
}

static void same_stars(void **state) {
    (void)state;
    static bst_star_path p, other;
    static bst_path_filter_peak all[MOST], bounded[MOST];
    const bst_rng_key key = bst_rng_make_key(5, 0, "test", "path filter");
    const double psf_px[] = {1.0, 1.0, 0.8, 1.6};
    bst_ctx ctx = {0};
    bst_path_filter *f = NULL;
    int stars = 0, blocks = 0, hidden = 0;
    for (int i = 0; i < WIDE * HIGH; i++) {
        ones[i] = 1.0f;
    }
    for (uint64_t field = 0; field < FIELDS; field++) {
        const double psf = psf_px[field % 4];
        bst_path_filter *eager;
        make_path(&p, key, field);
        draw(&p, key, field, psf);
        bst_assert_ok(&ctx, bst_path_filter_create_weighted(&ctx, &p, &picture, ones, psf,
                                                            LEAST_INSIDE, &eager));
        bst_assert_ok(&ctx, bst_path_filter_renew(&ctx, &p, &picture, NULL, psf, LEAST_INSIDE, &f));
        assert_true(bst_path_filter_is_of(f, &p));
        blocks += count_hidden(f, eager, &hidden);
        const int count = list(eager, field % 3 == 0, all);
        assert_same(bounded, list(f, field % 3 == 0, bounded), all, count);
        bst_assert_close(all[0].snr / all[0].amplitude, sqrt(all[0].inside * own_response(&p, psf)),
                         1e-3 * all[0].snr);
        bst_path_filter_restart(f, &picture);
        assert_same(bounded, list(f, field % 3 == 0, bounded), all, count);
        other = p;
        other.light[3] += 1e-6;
        assert_true(!bst_path_filter_is_of(f, &other));
        bst_path_filter_free(eager);
        stars += count;
    }
    assert_true(stars > 4 * FIELDS && blocks > 4 * FIELDS);
    assert_int_equal(hidden, 0);
    bst_path_filter_free(f);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(same_stars)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
