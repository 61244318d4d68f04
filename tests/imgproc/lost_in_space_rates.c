/* Rates of identification without an attitude over random fields, as a table.
 *
 * Usage: test_imgproc_lost_in_space_rates CATALOGUE FIELDS SCALE_ERROR MISSING FALSE [STREAK [ONLY]] */
#include <time.h>

#include "tests/imgproc/random_sky.h"
#include "tests/test_support.h"

static double cpu_s(void) {
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}
static int by_value(const void *a, const void *b) {
    double d = *(const double *)a - *(const double *)b;
    return (d > 0.0) - (d < 0.0);
}

static bst_random_sky sky;

int main(int argc, char **argv) {
    const char *name = argc > 1 ? argv[1] : "default";
    int fields = argc > 2 ? atoi(argv[2]) : 100;
    double scale_error = argc > 3 ? atof(argv[3]) : 0.0, missing = argc > 4 ? atof(argv[4]) : 0.0;
    int false_detections = argc > 5 ? atoi(argv[5]) : 0;
    double streak = argc > 6 ? atof(argv[6]) : 0.0, only = argc > 7 ? atof(argv[7]) : 0.0;
    int kind = argc > 8 ? atoi(argv[8]) : 0;
    double shift = argc > 9 ? atof(argv[9]) : 0.0;
    static const double sides[] = {0.5, 1.0, 3.0, 10.0, 20.0, 30.0};
    static const double limits[] = {11.5, 11.0, 9.5, 7.0, 6.0, 5.5};
    bst_ctx ctx = {0};
    bst_stars *stars, *onboard;
    bst_assert_ok(&ctx, bst_stars_open(&ctx, name, &stars));
    bst_star_errors_config errors = {.missing_fraction = missing, .seed = 7};
    bst_assert_ok(&ctx, bst_stars_with_errors(&ctx, stars, &errors, &onboard));
    printf("field_deg v_limit usable tried solved wrong median_ms worst_ms candidates | build_s "
           "MB patterns stars\n");
    for (int f = 0; f < 6; f++) {
        if (only > 0.0 && sides[f] != only) {
            continue;
        }
        bst_star_patterns *patterns;
        double begin = cpu_s();
        bst_star_patterns_options po = {sides[f] * BST_DEG_RAD, limits[f] + shift, 2024.6};
        bst_assert_ok(&ctx, bst_star_patterns_create(&ctx, onboard, &po, &patterns));
        double build_s = cpu_s() - begin;
        bst_star_patterns_info info;
        bst_star_patterns_get_info(patterns, &info);
        double *ms = calloc((size_t)fields, sizeof *ms), usable = 0.0;
        double candidates = 0.0;
        int tried = 0, solved = 0, wrong = 0;
        for (int i = 0; i < fields; i++) {
            bst_rng_key key = bst_rng_make_key(3, 0, "test", "scale");
            bst_random_sky_options so = {
                .field_deg = sides[f],
                .v_limit = limits[f] + shift,
                .streak_px = streak,
                .scale_error = scale_error * (2.0 * bst_rng_uniform(key, (uint64_t)i, 0) - 1.0),
                .lost_share = argc > 10 ? atof(argv[10]) : 0.0,
                .false_detections = false_detections,
                .mirrored = kind == 1,
                .scrambled = kind == 2};
            bst_random_sky_draw(&so, stars, onboard, 11, (uint64_t)i, &sky);
            usable += sky.usable;
            if (sky.usable < 6) {
                continue;
            }
            bst_lost_in_space *lost;
            bst_assert_ok(&ctx, bst_lost_in_space_create(&ctx, &sky.camera, onboard, patterns,
                                                         2024.6, BST_RANDOM_SKY_ROOM, &lost));
            bst_lost_in_space_options options = BST_LOST_IN_SPACE_USUAL;
            bst_lost_in_space_frame frame = {sky.items, sky.count, {0, 0, 1024, 1024},
                                             limits[f] + shift, &sky.light};
            bst_lost_in_space_result r;
            begin = cpu_s();
            bst_assert_ok(&ctx, bst_lost_in_space_solve(&ctx, lost, &options, &frame, &r));
            ms[tried++] = 1e3 * (cpu_s() - begin);
            candidates += r.candidates;
            bst_vec3 e = bst_quat_to_rotvec(
                bst_quat_mul(r.q_cam_from_gcrf, bst_quat_conj(sky.q_cam_from_gcrf)));
            double off_px = hypot(e.x, e.y) / bst_camera_scale_rad(&sky.camera);
            if (r.solved && off_px < 5.0) {
                solved++;
            } else if (r.solved) {
                wrong++;
            } else if (argc > 11) {
                bst_lost_in_space_result again;
                options.false_rate = 1e-2;
                options.max_stars = 60;
                bst_assert_ok(&ctx, bst_lost_in_space_solve(&ctx, lost, &options, &frame, &again));
                e = bst_quat_to_rotvec(
                    bst_quat_mul(again.q_cam_from_gcrf, bst_quat_conj(sky.q_cam_from_gcrf)));
                printf("# field %d: %d detections, %d usable, %d quads, %d candidates; with 1e-2: "
                       "%d off %g px, predicted %d matched %d chance e^%.1f\n",
                       i, sky.count, sky.usable, r.quads, r.candidates, again.solved,
                       hypot(e.x, e.y) / bst_camera_scale_rad(&sky.camera), again.predicted,
                       again.matched, again.log_chance);
            }
            bst_lost_in_space_free(lost);
        }
        qsort(ms, (size_t)tried, sizeof *ms, by_value);
        printf("%5.1f %5.1f %6.1f %5d %.4f %3d %7.2f %7.1f %.1f | %.2f %.1f %lld %d\n", sides[f],
               limits[f] + shift, usable / fields, tried, tried ? (double)solved / tried : 0.0,
               wrong, tried ? ms[tried / 2] : 0.0, tried ? ms[tried - 1] : 0.0,
               candidates / (tried ? tried : 1), build_s, (double)info.bytes / 1e6,
               (long long)info.patterns, info.stars);
        fflush(stdout);
        free(ms);
        bst_star_patterns_free(patterns);
    }
    bst_stars_close(onboard);
    bst_stars_close(stars);
    return 0;
}
