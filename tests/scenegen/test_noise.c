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

enum { SPREAD = 64, NO_WELL = TOP };

/* Probability that a charge reads d - SPREAD above itself, at gain 1. */
static void read_law(double read, double *shift) {
    for (int d = -SPREAD; d <= SPREAD; d++) {
        double a = (d - 0.5) / read / sqrt(2.0), b = (d + 0.5) / read / sqrt(2.0);
        shift[d + SPREAD] = 0.5 * (erfc(-b) - erfc(-a));
    }
}

/* Adds the law of digital numbers at gain 1: sum over electrons, at most `well`, of Poisson times
 * normal. */
static void add_exact_law(double mean, int well, const double *shift, double *law) {
    double reach = 9.0 * sqrt(mean) + 60.0;
    int first = (int)fmax(0.0, mean - reach), last = (int)(mean + reach);
    for (int n = first; n <= last; n++) {
        double p = mean > 0.0 ? exp(n * log(mean) - mean - lgamma(n + 1.0)) : n == 0 ? 1.0 : 0.0;
        if (p > 1e-16) {
            for (int d = -SPREAD; d <= SPREAD; d++) {
                int dn = (n < well ? n : well) + d + OFFSET;
                if (dn >= 0 && dn < TOP) {
                    law[dn] += p * shift[d + SPREAD];
                }
            }
        }
    }
}

/* Chi-square and Kolmogorov-Smirnov of the seen numbers against `law`, which adds up to `total`; n
 * draws. */
static void check_law(const char *what, double read, const double *law, double total,
                      const long long *seen, double n) {
    double chi2 = 0.0, worst = 0.0, cdf = 0.0, ecdf = 0.0, want = 0.0, got = 0.0;
    double last_want = 0.0, last_got = 0.0;
    int bins = 0;
    for (int d = 0; d < TOP; d++) {
        double share = law[d] / total;
        cdf += share;
        ecdf += (double)seen[d] / n;
        worst = fmax(worst, fabs(cdf - ecdf));
        want += share * n;
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
        fail_msg("%s, read noise %g: chi-square %g of %g degrees (z %.2f), KS %.2f", what, read,
                 chi2, k, z, worst * sqrt(n));
    }
}

static void check_case(bst_ctx *ctx, bst_renderer *r, double mean, double read, int well,
                       int frames, bst_rng_key key) {
    static double law[TOP];
    static long long seen[TOP];
    memset(seen, 0, sizeof seen);
    memset(law, 0, sizeof law);
    double time_s[2] = {0.0, 0.5};
    bst_quat q[2] = {BST_QUAT_IDENTITY, BST_QUAT_IDENTITY};
    bst_los_track track = {2, time_s, q};
    for (int f = 0; f < frames; f++) {
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
    double shift[2 * SPREAD + 1];
    read_law(read, shift);
    add_exact_law(mean, well, shift, law);
    char what[64];
    snprintf(what, sizeof what, "mean %g", mean);
    check_law(what, read, law, 1.0, seen, (double)SIDE * SIDE * frames);
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
            check_case(&ctx, r, means[j], reads[i], NO_WELL, frames_per_case,
                       bst_rng_make_key(11, i, "noise", j % 2 ? "odd" : "even"));
        }
        bst_renderer_free(r);
    }
    bst_device_close(device);
}

/* Charge is cut at the full well before the read noise comes, so that numbers near it are neither
 * Poisson nor normal: means from five standard deviations below the well to three above it. */
static void full_wells_cut_charge_before_it_is_read(void **state) {
    (void)state;
    enum { WELL = 10000 };
    static const double above[] = {-5.0, -2.5, -1.0, 0.0, 3.0}; /* in sqrt(WELL) */
    bst_ctx ctx = {0};
    bst_device *device;
    bst_assert_ok(&ctx, bst_device_open(&ctx, "", 0, &device));
    for (int i = 1; i < 3; i++) {
        bst_camera camera = scene_camera(SIDE, SIDE);
        camera.read_noise_e = reads[i];
        camera.full_well_e = WELL;
        camera.offset_dn = OFFSET;
        bst_renderer *r;
        bst_assert_ok(&ctx, bst_renderer_create(&ctx, device, &camera, NULL, &r));
        for (size_t j = 0; j < sizeof above / sizeof *above; j++) {
            check_case(&ctx, r, WELL + above[j] * sqrt(WELL), reads[i], WELL, 1,
                       bst_rng_make_key(12, (uint64_t)i, "noise", j % 2 ? "odd" : "even"));
        }
        bst_renderer_free(r);
    }
    bst_device_close(device);
}

/* Means that differ from pixel to pixel, by the light of a crowd of stars: grouped by mean, the
 * numbers follow the mixture of the pixels' laws. Read noises on both sides of each change of
 * method. */
static void draws_follow_the_law_where_light_varies(void **state) {
    (void)state;
    enum { N = 128, GROUPS = 6, STARS = 3000 };
    static const double edges[GROUPS + 1] = {0.0, 1.0, 5.0, 20.0, 30.0, 60.0, 1e9};
    static const double read_noises[] = {0.5, 0.75, 1.0, 2.0, 3.0, 5.0};
    static double laws[GROUPS][TOP];
    static long long seen[GROUPS][TOP];
    static float image[N * N];
    bst_ctx ctx = {0};
    bst_device *device;
    bst_assert_ok(&ctx, bst_device_open(&ctx, "", 0, &device));
    double time_s[2] = {0.0, 1.0};
    bst_quat q[2] = {BST_QUAT_IDENTITY, BST_QUAT_IDENTITY};
    bst_los_track track = {2, time_s, q};
    for (size_t c = 0; c < sizeof read_noises / sizeof *read_noises; c++) {
        bst_camera camera = scene_camera(N, N);
        camera.read_noise_e = read_noises[c];
        camera.full_well_e = 1e6;
        camera.offset_dn = OFFSET;
        bst_renderer *r;
        bst_assert_ok(&ctx, bst_renderer_create(&ctx, device, &camera, NULL, &r));
        bst_scene_source *stars = scene_stars(&camera, STARS, 2e4, 7.0, 5);
        bst_render_request request = {.window = {0, 0, N, N},
                                      .track = &track,
                                      .sources = stars,
                                      .count = STARS,
                                      .background_e = 0.2,
                                      .key = {{31, (unsigned)c}}};
        bst_assert_ok(&ctx, bst_renderer_render_noise_free(&ctx, r, &request, image));
        memset(laws, 0, sizeof laws);
        memset(seen, 0, sizeof seen);
        double shift[2 * SPREAD + 1], pixels_of[GROUPS] = {0.0};
        unsigned char group[N * N];
        read_law(read_noises[c], shift);
        for (int i = 0; i < N * N; i++) {
            int g = 0;
            while (image[i] >= edges[g + 1]) {
                g++;
            }
            group[i] = (unsigned char)g;
            pixels_of[g] += 1.0;
            add_exact_law(image[i], NO_WELL, shift, laws[g]);
        }
        int frames = 8 * frames_per_case;
        for (int f = 0; f < frames; f++) {
            bst_frame *frame;
            const uint16_t *pixels;
            request.exposure_id = f;
            bst_assert_ok(&ctx, bst_renderer_render(&ctx, r, &request, &frame));
            bst_assert_ok(&ctx, bst_frame_map(frame, &ctx, &pixels));
            for (int i = 0; i < N * N; i++) {
                seen[group[i]][pixels[i]]++;
            }
            bst_frame_unmap(frame);
            bst_frame_release(frame);
        }
        for (int g = 0; g < GROUPS; g++) {
            char what[64];
            snprintf(what, sizeof what, "means %g to %g", edges[g], edges[g + 1]);
            assert_true(pixels_of[g] > 100.0);
            check_law(what, read_noises[c], laws[g], pixels_of[g], seen[g], pixels_of[g] * frames);
        }
        bst_renderer_free(r);
        free(stars);
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
        cmocka_unit_test(full_wells_cut_charge_before_it_is_read),
        cmocka_unit_test(draws_follow_the_law_where_light_varies),
        cmocka_unit_test(pixels_and_frames_are_independent),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
