/* Rates of identification without an attitude over random fields, as a table.
 *
 * Usage: test_imgproc_lost_in_space_rates [NAME=VALUE ...], with the names of `arguments` below. */
#include <time.h>

#include "tests/imgproc/random_sky.h"
#include "tests/test_support.h"

typedef struct arguments {
    const char *catalogue;
    double fields, scale, missing, faults, streak, field, lost, false_rate, least, stars;
    const char *lists; /* file to write the detections to; NULL: none */
    const char *kind;  /* sky, mirrored, scrambled or planted */
} arguments;

static const double YEAR = 2024.6;
/* Sides of fields and the magnitudes of SNR 8. */
static const double sides_deg[] = {0.5, 1.0, 3.0, 10.0, 20.0, 30.0};
static const double limits_v[] = {11.5, 11.0, 9.5, 7.0, 6.0, 5.5};

static bst_random_sky sky;

static double cpu_s(void) {
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}
static int by_value(const void *a, const void *b) {
    double d = *(const double *)a - *(const double *)b;
    return (d > 0.0) - (d < 0.0);
}

static void read_arguments(int argc, char **argv, arguments *a) {
    *a = (arguments){
        .catalogue = "default", .fields = 100, .false_rate = 1e-6, .stars = 40, .kind = "sky"};
    for (int i = 1; i < argc; i++) {
        struct {
            const char *name;
            double *value;
        } all[] = {{"fields=", &a->fields}, {"scale=", &a->scale},     {"missing=", &a->missing},
                   {"false=", &a->faults},  {"streak=", &a->streak},   {"field=", &a->field},
                   {"lost=", &a->lost},     {"rate=", &a->false_rate}, {"least=", &a->least},
                   {"stars=", &a->stars}};
        bool taken = false;
        for (size_t k = 0; k < sizeof all / sizeof *all; k++) {
            size_t n = strlen(all[k].name);
            if (strncmp(argv[i], all[k].name, n) == 0) {
                *all[k].value = atof(argv[i] + n);
                taken = true;
            }
        }
        if (strncmp(argv[i], "catalogue=", 10) == 0) {
            a->catalogue = argv[i] + 10;
        } else if (strncmp(argv[i], "lists=", 6) == 0) {
            a->lists = argv[i] + 6;
        } else if (strncmp(argv[i], "kind=", 5) == 0) {
            a->kind = argv[i] + 5;
        } else if (!taken) {
            fail_msg("%s: no argument of this program", argv[i]);
        }
    }
}

/* Appends a field's detections to a file, for other solvers: a line with the field's number, its
 * side, the attitude q_cam_from_gcrf (x, y, z, w) and the number of detections, then x, y and flux
 * of each. */
static void write_list(const arguments *a, int f, int field) {
    FILE *file = fopen(a->lists, "a");
    assert_non_null(file);
    const bst_quat q = sky.q_cam_from_gcrf;
    fprintf(file, "%d %.3f %.9f %.9f %.9f %.9f %d\n", field, sides_deg[f], q.x, q.y, q.z, q.w,
            sky.count);
    for (int i = 0; i < sky.count; i++) {
        fprintf(file, "%.4f %.4f %.1f\n", sky.items[i].x_px, sky.items[i].y_px,
                sky.items[i].flux_e);
    }
    fclose(file);
}

/* Counts of one size of field. */
typedef struct counts {
    int tried, solved, wrong, agreed; /* agreed: fields with a pattern that agrees with a quad */
    double candidates;
    double *ms;
    double *evidence; /* minus the least logarithm of a chance in each field */
} counts;

static void try_field(const arguments *a, int f, uint64_t i, const bst_stars *stars,
                      const bst_stars *onboard, const bst_star_patterns *patterns, counts *n) {
    bst_ctx ctx = {0};
    const bool planted = strcmp(a->kind, "planted") == 0;
    double u = bst_rng_uniform(bst_rng_make_key(3, 0, "test", "scale"), i, 0);
    const bst_random_sky_options so = {.field_deg = sides_deg[f],
                                       .v_limit = limits_v[f],
                                       .streak_px = a->streak,
                                       .scale_error = a->scale * (2.0 * u - 1.0),
                                       .lost_share = a->lost,
                                       .false_detections = (int)a->faults,
                                       .mirrored = strcmp(a->kind, "mirrored") == 0,
                                       .scrambled = strcmp(a->kind, "scrambled") == 0 || planted,
                                       .planted = planted};
    bst_random_sky_draw(&so, stars, onboard, 11, i, &sky);
    if (sky.usable < 6) {
        return;
    }
    if (a->lists) {
        write_list(a, f, (int)i);
    }
    bst_lost_in_space *lost;
    bst_assert_ok(&ctx, bst_lost_in_space_create(&ctx, &sky.camera, onboard, patterns, YEAR,
                                                 BST_RANDOM_SKY_ROOM, &lost));
    bst_lost_in_space_options options = BST_LOST_IN_SPACE_USUAL;
    options.false_rate = a->false_rate;
    options.max_stars = (int)a->stars;
    const bst_lost_in_space_frame frame = {
        sky.items, sky.count, {0, 0, 1024, 1024}, limits_v[f], &sky.light, NULL, NULL};
    bst_lost_in_space_result r;
    double begin = cpu_s();
    bst_assert_ok(&ctx, bst_lost_in_space_solve(&ctx, lost, &options, &frame, &r));
    n->agreed += r.candidates > 0;
    n->evidence[n->tried] = -r.least_log_chance;
    n->ms[n->tried++] = 1e3 * (cpu_s() - begin);
    n->candidates += r.candidates;
    bst_vec3 e =
        bst_quat_to_rotvec(bst_quat_mul(r.q_cam_from_gcrf, bst_quat_conj(sky.q_cam_from_gcrf)));
    bool right = hypot(e.x, e.y) < 5.0 * bst_camera_scale_rad(&sky.camera) && !so.scrambled;
    if (r.solved && !right) {
        printf(
            "# field %d: wrong by %.1f px, roll %.3g rad, scale %.5f, true %.5f, %d of %d stars, "
            "e^%.1f\n",
            (int)i, hypot(e.x, e.y) / bst_camera_scale_rad(&sky.camera), e.z, r.scale,
            1.0 + so.scale_error, r.matched, r.predicted, r.log_chance);
    }
    if (!r.solved && strcmp(a->kind, "sky") == 0) {
        printf("# field %d: not solved, %d usable stars, %d detections, %d quads, %d candidates\n",
               (int)i, sky.usable, sky.count, r.quads, r.candidates);
    }
    n->solved += r.solved && right;
    n->wrong += r.solved && !right;
    bst_lost_in_space_free(lost);
}

/* Prints the tail of the evidence over wrong skies, and its continuation to the evidence that is
 * accepted: the excess over a high threshold is exponential (Pickands 1975, Annals of Statistics 3,
 * 119, with a shape of 0), and its mean is known to one part in the root of its number. */
static void print_tail(const arguments *a, counts *n) {
    const double wanted = -log(a->false_rate);
    qsort(n->evidence, (size_t)n->tried, sizeof *n->evidence, by_value);
    int over = 0;
    for (int i = 0; i < n->tried; i++) {
        over += n->evidence[i] > 0.0;
    }
    over = over / 10 > 20 ? over / 10 : over / 2;
    printf("# %d fields have a quad that agrees\n", n->agreed);
    if (over < 2) {
        printf("# no tail\n");
        return;
    }
    double least = n->evidence[n->tried - over - 1], excess = 0.0;
    for (int i = n->tried - over; i < n->tried; i++) {
        excess += (n->evidence[i] - least) / over;
    }
    double rate = (double)over / n->tried * exp(-(wanted - least) / excess);
    double upper =
        (double)over / n->tried * exp(-(wanted - least) / (excess * (1.0 + 2.0 / sqrt(over))));
    printf("# evidence: median %.2f, largest %.2f; above %.2f %d of %d with mean excess %.2f\n",
           n->evidence[n->tried / 2], n->evidence[n->tried - 1], least, over, n->tried, excess);
    printf("# continued to %.1f: %.1e of the fields, below %.1e (2 sigma)\n", wanted, rate, upper);
}

static void run_size(const arguments *a, int f, const bst_stars *stars, const bst_stars *onboard) {
    bst_ctx ctx = {0};
    bst_star_patterns *patterns;
    bst_star_patterns_info info;
    const bst_star_patterns_options options = {sides_deg[f] * BST_DEG_RAD, limits_v[f], YEAR};
    double begin = cpu_s();
    bst_assert_ok(&ctx, bst_star_patterns_create(&ctx, onboard, &options, &patterns));
    double build_s = cpu_s() - begin;
    bst_star_patterns_get_info(patterns, &info);
    counts n = {.ms = calloc((size_t)a->fields + 1, sizeof *n.ms),
                .evidence = calloc((size_t)a->fields + 1, sizeof *n.evidence)};
    assert_true(n.ms && n.evidence);
    for (uint64_t i = 0; i < (uint64_t)a->fields; i++) {
        try_field(a, f, i, stars, onboard, patterns, &n);
    }
    qsort(n.ms, (size_t)n.tried, sizeof *n.ms, by_value);
    double share = n.tried > 0 ? (double)n.solved / n.tried : 0.0;
    printf("%5.1f %5.1f %6d %.4f %4d %8.2f %8.1f %6.1f %7.2f %6.1f %9lld %8d\n", sides_deg[f],
           limits_v[f], n.tried, share, n.wrong, n.tried ? n.ms[n.tried / 2] : 0.0,
           n.tried ? n.ms[n.tried - 1] : 0.0, n.candidates / fmax(n.tried, 1), build_s,
           (double)info.bytes / 1e6, (long long)info.patterns, info.stars);
    fflush(stdout);
    if (strcmp(a->kind, "sky") == 0 && sides_deg[f] >= 1.0) {
        assert_true(share >= a->least);
    }
    assert_true(n.wrong <=
                10.0 * a->false_rate * fmax(n.tried, 1) + 4.0 * sqrt(a->false_rate * n.tried));
    if (strcmp(a->kind, "sky") != 0) {
        print_tail(a, &n);
    }
    free(n.ms);
    free(n.evidence);
    bst_star_patterns_free(patterns);
}

int main(int argc, char **argv) {
    arguments a;
    read_arguments(argc, argv, &a);
    bst_ctx ctx = {0};
    bst_stars *stars, *onboard;
    bst_assert_ok(&ctx, bst_stars_open(&ctx, a.catalogue, &stars));
    const bst_star_errors_config errors = {.missing_fraction = a.missing, .seed = 7};
    bst_assert_ok(&ctx, bst_stars_with_errors(&ctx, stars, &errors, &onboard));
    printf(
        "field_deg v_limit tried solved wrong median_ms worst_ms candidates build_s MB patterns "
        "stars\n");
    for (int f = 0; f < 6; f++) {
        if (!(a.field > 0.0) || sides_deg[f] == a.field) {
            run_size(&a, f, stars, onboard);
        }
    }
    bst_stars_close(onboard);
    bst_stars_close(stars);
    return 0;
}
