/* Digital numbers of dark frames against the exact law: Poisson, plus normal, quantised. Argument
 * "slow": a hundred million draws per case instead of ten. */
#include "tests/scenegen/scene_support.h"
#include "tests/test_support.h"

enum { SIDE = 1000, OFFSET = 100, TOP = 65536 };
static int frames_per_case = 10;
static const double means[] = {0.0, 0.1, 1.0, 10.0, 100.0, 1e4, 6e4};
static const double reads[] = {0.3, 1.0, 5.0};
/* p = 1e-4: normal deviate, and Kolmogorov's limit sqrt(-ln(p / 2) / 2) */
static const double normal_limit = 3.719, kolmogorov_limit = 2.225;

/* Probability of each digital number at gain 1: sum over electrons of Poisson times normal. */
static void exact_law(double mean, double read, double *law) {
    memset(law, 0, TOP * sizeof *law);
    double reach = 9.0 * sqrt(mean) + 60.0;
    int first = (int)fmax(0.0, mean - reach), last = (int)(mean + reach);
    int spread = (int)(8.0 * read) + 2;
    for (int n = first; n <= last; n++) {
        double p = mean > 0.0 ? exp(n * log(mean) - mean - lgamma(n + 1.0)) : n == 0 ? 1.0 : 0.0;
        for (int d = n - spread; d <= n + spread; d++) {
            double a = (d - 0.5 - n) / read, b = (d + 0.5 - n) / read;
            int dn = d + OFFSET;
            if (dn >= 0 && dn < TOP) {
                law[dn] += p * 0.5 * (erfc(-b / sqrt(2.0)) - erfc(-a / sqrt(2.0)));
            }
        }
    }
}

static void check_case(bst_ctx *ctx, bst_renderer *r, double mean, double read, bst_rng_key key) {
    static double law[TOP];
    static long long seen[TOP];
    memset(seen, 0, sizeof seen);
    double time_s[2] = {0.0, 0.5};
    bst_quat q[2] = {BST_QUAT_IDENTITY, BST_QUAT_IDENTITY};
    bst_los_track track = {2, time_s, q};
    for (int f = 0; f < frames_per_case; f++) {
        bst_render_request request = {.window = {0, 0, SIDE, SIDE},
                                      .track = &track,
                                      .background_e = mean,
                                      .key = key,
                                      .exposure_id = f};
        bst_frame *frame;
        const uint16_t *pixels;
        bst_assert_ok(ctx, bst_renderer_render(ctx, r, &request, &frame));
        bst_assert_ok(ctx, bst_frame_map(frame, ctx, &pixels));
        for (int i = 0; i < SIDE * SIDE; i++) {
            seen[pixels[i]]++;
        }
        bst_frame_unmap(frame);
        bst_frame_release(frame);
    }
    exact_law(mean, read, law);
    double n = (double)SIDE * SIDE * frames_per_case;
    double chi2 = 0.0, worst = 0.0, cdf = 0.0, ecdf = 0.0, want = 0.0, got = 0.0;
    double last_want = 0.0, last_got = 0.0;
    int bins = 0;
    for (int d = 0; d < TOP; d++) {
        cdf += law[d];
        ecdf += (double)seen[d] / n;
        worst = fmax(worst, fabs(cdf - ecdf));
        want += law[d] * n;
        got += (double)seen[d];
        if (want >= 10.0) { /* bins of at least ten expected draws; the rest joins the last */
            chi2 += (got - want) * (got - want) / want;
            last_want = want;
            last_got = got;
            bins++;
            want = got = 0.0;
        }
    }
    bst_assert_close(cdf, 1.0, 1e-9); /* the law is complete */
    chi2 -= (last_got - last_want) * (last_got - last_want) / last_want;
    last_want += want;
    last_got += got;
    chi2 += (last_got - last_want) * (last_got - last_want) / last_want;
    double k = bins - 1.0;
    /* Wilson and Hilferty 1931: the cube root of chi-square / k is nearly normal */
    double z = k > 0.0 ? (cbrt(chi2 / k) - (1.0 - 2.0 / (9.0 * k))) / sqrt(2.0 / (9.0 * k)) : 0.0;
    if (!(z < normal_limit) || !(worst * sqrt(n) < kolmogorov_limit)) {
        fail_msg("mean %g read noise %g: chi-square %g of %g degrees (z %.2f), KS %.2f", mean, read,
                 chi2, k, z, worst * sqrt(n));
    }
}

static void draws_follow_the_exact_law(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_device *device;
    bst_assert_ok(&ctx, bst_device_open(&ctx, "", 0, &device));
    for (size_t i = 0; i < sizeof reads / sizeof *reads; i++) {
        bst_camera camera = scene_camera(SIDE, SIDE);
        camera.read_noise_e = reads[i];
        camera.full_well_e = 1e6;
        camera.offset_dn = OFFSET;
        bst_renderer *r;
        bst_assert_ok(&ctx, bst_renderer_create(&ctx, device, &camera, NULL, &r));
        for (size_t j = 0; j < sizeof means / sizeof *means; j++) {
            check_case(&ctx, r, means[j], reads[i],
                       bst_rng_make_key(11, i, "noise", j % 2 ? "odd" : "even"));
        }
        bst_renderer_free(r);
    }
    bst_device_close(device);
}

/* Neighbouring pixels and successive frames are uncorrelated. */
static void pixels_and_frames_are_independent(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_device *device;
    bst_assert_ok(&ctx, bst_device_open(&ctx, "", 0, &device));
    bst_camera camera = scene_camera(SIDE, SIDE);
    bst_renderer *r;
    bst_assert_ok(&ctx, bst_renderer_create(&ctx, device, &camera, NULL, &r));
    double time_s[2] = {0.0, 0.5};
    bst_quat q[2] = {BST_QUAT_IDENTITY, BST_QUAT_IDENTITY};
    bst_los_track track = {2, time_s, q};
    bst_frame *frames[2];
    const uint16_t *p[2];
    for (int f = 0; f < 2; f++) {
        bst_render_request request = {.window = {0, 0, SIDE, SIDE},
                                      .track = &track,
                                      .background_e = 20.0,
                                      .key = {{5, 6}},
                                      .exposure_id = f};
        bst_assert_ok(&ctx, bst_renderer_render(&ctx, r, &request, &frames[f]));
        bst_assert_ok(&ctx, bst_frame_map(frames[f], &ctx, &p[f]));
    }
    double n = (double)SIDE * (SIDE - 1), var = 20.0 + 64.0 + 1.0 / 12.0;
    double right = 0.0, down = 0.0, next = 0.0;
    for (int i = 0; i < SIDE * (SIDE - 1); i++) {
        double a = p[0][i] - 120.0;
        right += a * (p[0][i + 1] - 120.0);
        down += a * (p[0][i + SIDE] - 120.0);
        next += a * (p[1][i] - 120.0);
    }
    /* correlation of n independent pairs: standard deviation 1 / sqrt(n); four of them */
    bst_assert_close(right / n / var, 0.0, 4.0 / sqrt(n));
    bst_assert_close(down / n / var, 0.0, 4.0 / sqrt(n));
    bst_assert_close(next / n / var, 0.0, 4.0 / sqrt(n));
    for (int f = 0; f < 2; f++) {
        bst_frame_unmap(frames[f]);
        bst_frame_release(frames[f]);
    }
    bst_renderer_free(r);
    bst_device_close(device);
}

int main(int argc, char **argv) {
    if (argc > 1 && strcmp(argv[1], "slow") == 0) {
        frames_per_case = 100;
    }
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(draws_follow_the_exact_law),
        cmocka_unit_test(pixels_and_frames_are_independent),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
