/* Rates of identification from the pixels of rendered streak fields, as a table.
 *
 * Usage: test_imgproc_streak_fields [NAME=VALUE ...], with the names of `arguments` below. Each
 * field is drawn pixel by pixel: the camera turns during the exposure, each star moves along its
 * own gnomonic path, the image has white noise, hot pixels and a slope of its columns. */
#include <time.h>

#include "boresight/rng.h"
#include "imgproc/identify/plate_solve.h"
#include "tests/test_support.h"

static const double YEAR = 2024.6, PSF_SIGMA_PX = 0.9, NOISE = 10.0;
/* Places per pixel of a star's path. */
static const double STEPS_PER_PX = 4.0;
enum { HOT_PIXELS = 20, BLUR = 5, LARGEST = 1024 };

typedef struct arguments {
    const char *catalogue, *kind; /* sky or mirrored */
    double fields, first, side, field, v_limit, length, bend, scale, missing, least, snr;
    double known;     /* 1: the solver is given the true path */
    double oracle;    /* 1: what is not solved is solved again with parts of the truth */
    const char *list; /* file with the numbers of fields; NULL: all from `first` on */
} arguments;

typedef struct scene {
    bst_camera camera; /* what the solver believes */
    bst_camera truth;  /* with its error of scale */
    bst_light light;
    bst_quat q_cam_from_gcrf; /* at the middle of the exposure */
    bst_vec3 turn[3];         /* rotation vector: turn[0] u + turn[1] u (1 - u), u from 0 to 1 */
    float *pixels, *scratch;
    int usable; /* stars of SNR 8 and more that the onboard catalogue has */
    int side;
    double scale;
} scene;

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
    *a = (arguments){.catalogue = "default",
                     .kind = "sky",
                     .fields = 40,
                     .side = 512,
                     .field = 3,
                     .v_limit = 9.5,
                     .length = 60,
                     .scale = 0.05,
                     .missing = 0.4,
                     .snr = 6};
    for (int i = 1; i < argc; i++) {
        struct {
            const char *name;
            double *value;
        } all[] = {{"fields=", &a->fields}, {"first=", &a->first},   {"side=", &a->side},
                   {"field=", &a->field},   {"limit=", &a->v_limit}, {"length=", &a->length},
                   {"bend=", &a->bend},     {"scale=", &a->scale},   {"missing=", &a->missing},
                   {"least=", &a->least},   {"snr=", &a->snr},       {"known=", &a->known},
                   {"oracle=", &a->oracle}};
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
        } else if (strncmp(argv[i], "kind=", 5) == 0) {
            a->kind = argv[i] + 5;
        } else if (strncmp(argv[i], "list=", 5) == 0) {
            a->list = argv[i] + 5;
        } else if (!taken) {
            fail_msg("%s: no argument of this program", argv[i]);
        }
    }
    assert_true(a->side >= 64 && a->side <= LARGEST && a->fields >= 1);
}

/* Random rotation (Shoemake 1992, Graphics Gems III). */
static bst_quat random_attitude(bst_rng_key key, uint64_t index) {
    double u = bst_rng_uniform(key, index, 0), a = 2.0 * BST_PI * bst_rng_uniform(key, index, 1);
    double b = 2.0 * BST_PI * bst_rng_uniform(key, index, 2);
    return (bst_quat){sqrt(1.0 - u) * sin(a), sqrt(1.0 - u) * cos(a), sqrt(u) * sin(b),
                      sqrt(u) * cos(b)};
}

/* Attitude at a share of the exposure. */
static bst_quat attitude_at(const scene *s, double u) {
    bst_vec3 v = bst_vec3_add(bst_vec3_scale(s->turn[0], u - 0.5),
                              bst_vec3_scale(s->turn[1], u * (1.0 - u) - 0.25));
    return bst_quat_mul(bst_quat_from_rotvec(v), s->q_cam_from_gcrf);
}

static double length_of(const scene *s, const bst_quat *q, int steps, bst_vec3 star) {
    double x[2], y[2];
    if (!bst_camera_project(&s->truth, bst_quat_rotate(q[0], star), &x[0], &y[0]) ||
        !bst_camera_project(&s->truth, bst_quat_rotate(q[steps - 1], star), &x[1], &y[1])) {
        return 0.0;
    }
    return hypot(x[1] - x[0], y[1] - y[0]);
}

/* Adds a star of unit total to the image; returns the share that the frame holds. */
static double add_star(scene *s, const bst_quat *q, int steps, bst_vec3 star, double flux) {
    int inside = 0;
    for (int k = 0; k < steps; k++) {
        double x, y;
        if (!bst_camera_project(&s->truth, bst_quat_rotate(q[k], star), &x, &y) || x < 0.0 ||
            y < 0.0 || x >= s->side - 1 || y >= s->side - 1) {
            continue;
        }
        int i = (int)x, j = (int)y;
        double f = x - i, g = y - j, value = flux / steps;
        float *at = &s->pixels[j * s->side + i];
        at[0] += (float)(value * (1.0 - f) * (1.0 - g));
        at[1] += (float)(value * f * (1.0 - g));
        at[s->side] += (float)(value * (1.0 - f) * g);
        at[s->side + 1] += (float)(value * f * g);
        inside++;
    }
    return (double)inside / steps;
}

/* Convolves along one axis with a Gaussian and transposes. */
static void blur_and_transpose(const float *from, float *to, int side) {
    double kernel[2 * BLUR + 1], sum = 0.0;
    for (int k = -BLUR; k <= BLUR; k++) {
        sum += kernel[k + BLUR] = exp(-0.5 * k * k / (PSF_SIGMA_PX * PSF_SIGMA_PX));
    }
    for (int y = 0; y < side; y++) {
        for (int x = 0; x < side; x++) {
            double v = 0.0;
            for (int k = -BLUR; k <= BLUR; k++) {
                if (x + k >= 0 && x + k < side) {
                    v += kernel[k + BLUR] / sum * (double)from[y * side + x + k];
                }
            }
            to[x * side + y] = (float)v;
        }
    }
}

static void add_noise(scene *s, bst_rng_key key, uint64_t index, bool mirrored) {
    const int n = s->side;
    for (int y = 0; y < n; y++) {
        for (int x = 0; x < n; x++) {
            uint64_t k = (uint64_t)(y * n + x);
            s->scratch[y * n + (mirrored ? n - 1 - x : x)] =
                s->pixels[k] + (float)(200.0 + 0.3 * x + NOISE * bst_rng_normal(key, index, k));
        }
    }
    memcpy(s->pixels, s->scratch, (size_t)n * (size_t)n * sizeof *s->pixels);
    for (uint64_t i = 0; i < HOT_PIXELS; i++) {
        int at = (int)(bst_rng_uniform(key, index, 2000000 + 2 * i) * n * n);
        s->pixels[at] +=
            (float)(NOISE * pow(10.0, 1.0 + 2.0 * bst_rng_uniform(key, index, 2000001 + 2 * i)));
    }
}

/* Draws the stars of the sky; counts those of the onboard catalogue that reach SNR 8.
 *
 * The SNR is that of the matched filter over the part of the streak inside the frame: flux times
 * the root of the sum of the squared profile, over the noise. */
static void draw_stars(const arguments *a, scene *s, const bst_stars *stars,
                       const bst_stars *onboard) {
    bst_ctx ctx = {0};
    int steps = 1 + (int)(STEPS_PER_PX * a->length), count;
    bst_quat *q = calloc((size_t)steps, sizeof *q);
    assert_non_null(q);
    for (int k = 0; k < steps; k++) {
        q[k] = attitude_at(s, steps > 1 ? (double)k / (steps - 1) : 0.5);
    }
    bst_vec3 axis = bst_quat_rotate(bst_quat_conj(s->q_cam_from_gcrf), (bst_vec3){0, 0, 1});
    double radius = 1.1 * bst_camera_half_diagonal_rad(&s->truth) +
                    0.6 * a->length * bst_camera_scale_rad(&s->truth) + 2e-4;
    for (int pass = 0; pass < 2; pass++) {
        const bst_stars *from = pass ? onboard : stars;
        double faintest = a->v_limit + (pass ? 0.0 : 1.5);
        bst_assert_ok(&ctx,
                      bst_stars_query(&ctx, from, axis, radius, faintest, YEAR, NULL, 0, &count));
        bst_star *found = calloc((size_t)count + 1, sizeof *found);
        assert_non_null(found);
        bst_assert_ok(
            &ctx, bst_stars_query(&ctx, from, axis, radius, faintest, YEAR, found, count, &count));
        for (int i = 0; i < count; i++) {
            bst_vec3 v = bst_light_apparent_star(&s->light, found[i].icrs);
            double snr = 8.0 * pow(10.0, 0.4 * (a->v_limit - (double)found[i].v_mag));
            /* sum of the squares of a Gaussian of unit flux, drawn out to a length; light between
             * pixels is shared, which widens it by 1/6 px^2 on average */
            double spread = 2.0 * sqrt((PSF_SIGMA_PX * PSF_SIGMA_PX + 1.0 / 6.0) * BST_PI),
                   squares = 1.0 / (spread * hypot(spread, length_of(s, q, steps, v)));
            double share = add_star(s, q, steps, v, pass ? 0.0 : snr * NOISE / sqrt(squares));
            s->usable += pass && snr * sqrt(share) >= 8.0;
        }
        free(found);
    }
    free(q);
}

static void draw(const arguments *a, const bst_stars *stars, const bst_stars *onboard, uint64_t i,
                 scene *s) {
    bst_ctx ctx = {0};
    const bst_rng_key key = bst_rng_make_key(31, 0, "test", "streak fields");
    const size_t pixels = (size_t)s->side * (size_t)s->side;
    s->usable = 0;
    s->scale = 1.0 + a->scale * (2.0 * bst_rng_uniform(key, i, 3) - 1.0);
    double tangent = tan(0.5 * a->field * BST_DEG_RAD) / (0.5 * s->side);
    s->camera = (bst_camera){
        .width_px = s->side, .height_px = s->side, .pixel_scale_arcsec = tangent / BST_ARCSEC_RAD};
    bst_assert_ok(&ctx, bst_camera_prepare(&ctx, &s->camera));
    s->truth = s->camera;
    s->truth.pixel_scale_arcsec *= s->scale;
    s->light = (bst_light){{21000.0, -18000.0, 9000.0}, {1e11, 1.1e11, 0.2e11}};
    s->q_cam_from_gcrf = random_attitude(key, i);
    double angle = 2.0 * BST_PI * bst_rng_uniform(key, i, 4), c = cos(angle), n = sin(angle);
    double turn = a->length * bst_camera_scale_rad(&s->truth);
    s->turn[0] = (bst_vec3){turn * c, turn * n, 0.0};
    s->turn[1] = (bst_vec3){-4.0 * a->bend * turn * n, 4.0 * a->bend * turn * c, 0.0};
    memset(s->pixels, 0, pixels * sizeof *s->pixels);
    draw_stars(a, s, stars, onboard);
    blur_and_transpose(s->pixels, s->scratch, s->side);
    blur_and_transpose(s->scratch, s->pixels, s->side);
    add_noise(s, key, i, strcmp(a->kind, "mirrored") == 0);
}

/* Distance of the solved boresight from the true one at the middle of the exposure, px. */
static double off_px(const scene *s, const bst_plate_solve_result *r) {
    bst_vec3 e = bst_quat_to_rotvec(
        bst_quat_mul(r->attitude.q_cam_from_gcrf, bst_quat_conj(s->q_cam_from_gcrf)));
    return hypot(e.x, e.y) / bst_camera_scale_rad(&s->truth);
}

/* Path of the stars by the truth, about the middle of the exposure. */
static void true_path(const scene *s, double tangent_per_px, bst_star_path *path) {
    enum { NODES = 33 };
    bst_star_path_node nodes[NODES];
    *path = (bst_star_path){.centre = {0.5 * (s->side - 1), 0.5 * (s->side - 1)},
                            .tangent_per_px = tangent_per_px};
    bst_vec3 v = bst_quat_rotate(bst_quat_conj(s->q_cam_from_gcrf), (bst_vec3){0, 0, 1});
    for (int k = 0; k < NODES; k++) {
        nodes[k].time = k / (NODES - 1.0);
        assert_true(bst_camera_project(&s->truth, bst_quat_rotate(attitude_at(s, nodes[k].time), v),
                                       &nodes[k].x_px, &nodes[k].y_px));
    }
    assert_true(bst_star_path_of_motion(path, nodes, NODES));
    /* from the mean place to that at the middle of the exposure */
    double dx = path->centre[0] - nodes[0].x_px + path->ends[0][0];
    double dy = path->centre[1] - nodes[0].y_px + path->ends[0][1];
    for (int k = 0; k < path->count; k++) {
        path->place[k][0] -= dx;
        path->place[k][1] -= dy;
    }
    for (int e = 0; e < 2; e++) {
        path->ends[e][0] -= dx;
        path->ends[e][1] -= dy;
    }
}

/* Solves a frame by its true path: what is not solved here fails for other reasons.
 *
 * Given:     together  stars are fitted together
 *            attitude  the true attitude and scale are verified, and nothing is searched */
static void solve_known(const scene *s, bst_lost_in_space *lost, const bst_plate_solve_options *o,
                        bool together, bool attitude, bst_plate_solve_result *out) {
    bst_ctx ctx = {0};
    const bst_common_streak_options streak = {.max_sources = BST_PLATE_SOLVE_STARS,
                                              .least_snr = o->least_snr,
                                              .tangent_per_px = o->tangent_per_px,
                                              .known_path = true};
    bst_streak_finder *finder;
    bst_common_streak found;
    *out = (bst_plate_solve_result){.points = false};
    true_path(s, o->tangent_per_px, &out->path);
    bst_assert_ok(&ctx,
                  bst_streak_finder_create(&ctx, s->pixels, s->side, s->side, &streak, &finder));
    bst_assert_ok(&ctx, together ? bst_streak_finder_follow(&ctx, finder, &out->path, o->least_snr,
                                                            0.25, &found)
                                 : bst_streak_finder_search(&ctx, finder, &out->path, &found));
    bst_lost_in_space_options options = BST_LOST_IN_SPACE_USUAL;
    options.scale_tolerance = o->scale_tolerance;
    options.max_candidates = attitude ? 1 : options.max_candidates;
    const bst_lost_in_space_result truth = {.q_cam_from_gcrf = s->q_cam_from_gcrf,
                                            .scale = s->scale};
    const bst_lost_in_space_frame frame = {
        found.items, found.count, {0, 0, s->side, s->side}, o->v_limit,
        o->light,    &out->path,  attitude ? &truth : NULL};
    bst_assert_ok(&ctx, bst_lost_in_space_solve(&ctx, lost, &options, &frame, &out->attitude));
    out->stars = found.count;
    out->ends[0] = found.ends[0];
    out->ends[1] = found.ends[1];
    bst_streak_finder_free(finder);
}

/* What a solver that knows the path, and one that knows the attitude, make of a frame. */
static void ask_oracle(const scene *s, bst_lost_in_space *lost, const bst_plate_solve_options *o) {
    for (int i = 0; i < 4; i++) {
        bst_plate_solve_result r;
        const bool together = i % 2 == 0, attitude = i >= 2;
        solve_known(s, lost, o, together, attitude, &r);
        printf(
            "#   true path%s, stars %s: %s, off %.1f px, %d of %d of %d detections, least "
            "e^%.1f, %d candidates\n",
            attitude ? " and attitude" : "", together ? "together" : "one by one",
            r.attitude.solved ? "solved" : "not solved", off_px(s, &r), r.attitude.matched,
            r.attitude.predicted, r.stars, r.attitude.least_log_chance, r.attitude.candidates);
    }
}

/* Number of the next field. False: there is none. */
static bool next_field(const arguments *a, FILE *list, int *done, uint64_t *number) {
    int listed;
    if (list) {
        bool read = fscanf(list, "%d", &listed) == 1;
        *number = read ? (uint64_t)listed : 0;
        return read && (*done)++ < a->fields;
    }
    *number = (uint64_t)a->first + (uint64_t)*done;
    return (*done)++ < a->fields;
}

int main(int argc, char **argv) {
    arguments a;
    bst_ctx ctx = {0};
    read_arguments(argc, argv, &a);
    bst_stars *stars, *onboard;
    bst_assert_ok(&ctx, bst_stars_open(&ctx, a.catalogue, &stars));
    const bst_star_errors_config errors = {.missing_fraction = a.missing, .seed = 7};
    bst_assert_ok(&ctx, bst_stars_with_errors(&ctx, stars, &errors, &onboard));
    bst_star_patterns *patterns;
    const bst_star_patterns_options options = {a.field * BST_DEG_RAD, a.v_limit, YEAR};
    bst_assert_ok(&ctx, bst_star_patterns_create(&ctx, onboard, &options, &patterns));
    scene s = {.side = (int)a.side};
    size_t pixels = (size_t)s.side * (size_t)s.side;
    s.pixels = calloc(pixels, sizeof *s.pixels);
    s.scratch = calloc(pixels, sizeof *s.scratch);
    double *ms = calloc((size_t)a.fields, sizeof *ms);
    assert_true(s.pixels && s.scratch && ms);
    int tried = 0, solved = 0, wrong = 0;
    FILE *list = a.list ? fopen(a.list, "r") : NULL;
    assert_true(!a.list || list);
    int done = 0;
    uint64_t i;
    while (next_field(&a, list, &done, &i)) {
        draw(&a, stars, onboard, i, &s);
        if (s.usable < 6) {
            continue;
        }
        bst_lost_in_space *lost;
        bst_assert_ok(&ctx, bst_lost_in_space_create(&ctx, &s.camera, onboard, patterns, YEAR,
                                                     BST_PLATE_SOLVE_STARS, &lost));
        const bst_plate_solve_options o = {0.05, a.v_limit, a.snr, bst_camera_scale_rad(&s.camera),
                                           &s.light};
        bst_plate_solve_result r;
        double begin = cpu_s();
        if (a.known > 0.0) {
            solve_known(&s, lost, &o, true, false, &r);
        } else {
            bst_assert_ok(&ctx, bst_plate_solve(&ctx, lost, &o, s.pixels, s.side, s.side, &r));
        }
        ms[tried++] = 1e3 * (cpu_s() - begin);
        double off = off_px(&s, &r);
        bool right = r.attitude.solved && off < 5.0;
        solved += right;
        wrong += r.attitude.solved && !right;
        if (!right) {
            const bst_common_streak_point *e = r.ends;
            printf(
                "# field %d: %s, %d usable stars, %d found, streak %.1f px, off %.1f px, scale "
                "%.5f, true %.5f, chance e^%.1f (least e^%.1f), %d quads, %d patterns, %d "
                "candidates, margin "
                "%.1f, %.0f ms\n",
                (int)i, r.attitude.solved ? "wrong" : "not solved", s.usable, r.stars,
                hypot(e[1].x_px - e[0].x_px, e[1].y_px - e[0].y_px), off, r.attitude.scale, s.scale,
                r.attitude.log_chance, r.attitude.least_log_chance, r.attitude.quads,
                r.attitude.patterns, r.attitude.candidates, r.ends_margin, ms[tried - 1]);
        }
        if (!right && a.oracle > 0.0) {
            ask_oracle(&s, lost, &o);
        }
        bst_lost_in_space_free(lost);
    }
    if (list) {
        fclose(list);
    }
    qsort(ms, (size_t)tried, sizeof *ms, by_value);
    double share = tried > 0 ? (double)solved / tried : 0.0;
    printf("field_deg length_px bend tried solved share wrong median_ms worst_ms\n");
    printf("%9.1f %9.0f %4.2f %5d %6d %.4f %5d %9.0f %8.0f\n", a.field, a.length, a.bend, tried,
           solved, share, wrong, tried ? ms[tried / 2] : 0.0, tried ? ms[tried - 1] : 0.0);
    assert_true(tried > 0 && share >= a.least);
    assert_true(wrong == 0);
    free(s.pixels);
    free(s.scratch);
    free(ms);
    bst_star_patterns_free(patterns);
    bst_stars_close(onboard);
    bst_stars_close(stars);
    return 0;
}
