/* Close and crossing objects against their truth: GOSPA, OSPA(2), ghosts, purity, identities.
 *
 *     test_close_objects                               the short form, as a test
 *     test_close_objects run ASSOCIATION SCENE SEEDS [FIRST]   means of a scene over SEEDS seeds
 *                                                      from FIRST (0) on
 *     test_close_objects write SCENE SEED              truth and detections, for another tracker
 *     test_close_objects score SCENE SEED              tracks on standard input: FRAME ID X Y
 *
 * compare_stone_soup.py gives Stone Soup's figures on the same detections. */
#include <time.h>

#include "sim/eval/track_metrics.h"
#include "tests/tracker/close_scenes.h"

/* Tracks within 3 px of an object are the object's: below the least distance of a resolved pair. */
#define CUTOFF_PX 3.0
/* The first frames, in which no tracker has its tracks yet, are not scored. */
#define FIRST_SCORED 5
#define MAX_AT_ONCE 64

static const char *const associations[] = {"gnn", "nearest", "pda", "mixture", "pmb"};

/* Tracks of a frame, in px. */
typedef struct shown {
    int64_t id[MAX_AT_ONCE];
    double x[MAX_AT_ONCE], y[MAX_AT_ONCE];
    int count;
} shown;

static void score_frame(bst_track_metrics *metrics, const close_scene *scene, int frame,
                        const shown *tracks) {
    bst_ctx ctx = {0};
    bst_vec3 truth[CLOSE_OBJECTS], directions[MAX_AT_ONCE];
    int64_t objects[CLOSE_OBJECTS];
    for (int i = 0; i < scene->kind->objects; i++) {
        double x, y;
        close_place(&scene->objects[i], frame, &x, &y);
        truth[i] = close_direction(x, y);
        objects[i] = i;
    }
    for (int t = 0; t < tracks->count; t++) {
        directions[t] = close_direction(tracks->x[t], tracks->y[t]);
    }
    if (frame >= FIRST_SCORED) {
        const bst_track_frame shot = {frame,      objects,    truth,        scene->kind->objects,
                                      tracks->id, directions, tracks->count};
        bst_assert_ok(&ctx, bst_track_metrics_frame(&ctx, metrics, &shot));
    }
}

/* The confirmed tracks of the tracker. */
static void show(const bst_mtt *mtt, shown *out) {
    int n;
    const bst_mtt_track *tracks = bst_mtt_tracks(mtt, &n);
    out->count = 0;
    for (int t = 0; t < n && out->count < MAX_AT_ONCE; t++) {
        if (tracks[t].status != BST_TRACK_TENTATIVE && !tracks[t].star && !tracks[t].asleep) {
            int i = out->count++;
            out->id[i] = tracks[t].id;
            close_pixel(tracks[t].state.direction, &out->x[i], &out->y[i]);
        }
    }
}

static double processor_s(void) {
    struct timespec now;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

static bst_track_metrics *open_metrics(const close_kind *kind) {
    bst_ctx ctx = {0};
    bst_track_metrics *metrics;
    bst_assert_ok(
        &ctx, bst_track_metrics_create(&ctx, kind->objects, CUTOFF_PX * CLOSE_PIXEL_RAD, &metrics));
    return metrics;
}

/* Tracks one scene; adds the tracker's processor time. */
static bst_track_figures track_scene(bst_mtt_association association, const close_kind *kind,
                                     uint64_t seed, double *spent_s) {
    static close_scene scene;
    static shown tracks;
    bst_ctx ctx = {0};
    bst_mtt *mtt;
    const bst_mtt_params params = close_parameters(association);
    bst_assert_ok(&ctx, bst_mtt_create(&ctx, &params, &mtt));
    bst_track_metrics *metrics = open_metrics(kind);
    close_open(&scene, kind, seed);
    for (int k = 0; k < CLOSE_FRAMES; k++) {
        bst_mtt_detection list[CLOSE_DETECTIONS];
        close_expose(&scene, k);
        close_detections(&scene, list);
        bst_mtt_frame frame = {.tick = k * 1000,
                               .seconds = k,
                               .detections = list,
                               .count = scene.count,
                               .threshold_snr = CLOSE_THRESHOLD};
        double before = processor_s();
        bst_mtt_step(mtt, &frame);
        *spent_s += processor_s() - before;
        show(mtt, &tracks);
        score_frame(metrics, &scene, k, &tracks);
    }
    bst_track_figures figures;
    bst_track_metrics_figures(metrics, &figures);
    bst_track_metrics_free(metrics);
    bst_mtt_free(mtt);
    return figures;
}

static void print_figures(const char *name, const bst_track_figures *f) {
    printf(
        "%s gospa_px %.4f ospa2_px %.4f ghosts %d purity %.4f switches %d coverage %.4f "
        "false_tracks %d confirm_s %.2f\n",
        name, f->gospa_mean / CLOSE_PIXEL_RAD, f->ospa2_mean / CLOSE_PIXEL_RAD, f->ghosts,
        f->purity, f->breaks, f->coverage, f->false_tracks, f->time_to_confirm_s);
}

/* Means and sums over seeds. */
static bst_track_figures over_seeds(bst_mtt_association association, const close_kind *kind,
                                    int first, int seeds, bool print, double *us_per_frame) {
    bst_track_figures all = {0};
    double spent_s = 0.0;
    for (int seed = first; seed < first + seeds; seed++) {
        bst_track_figures f = track_scene(association, kind, (uint64_t)seed, &spent_s);
        if (print) {
            char name[64];
            snprintf(name, sizeof name, "%s %d", kind->name, seed);
            print_figures(name, &f);
        }
        all.gospa_mean += f.gospa_mean / seeds;
        all.ospa2_mean += f.ospa2_mean / seeds;
        all.purity += f.purity / seeds;
        all.coverage += f.coverage / seeds;
        all.time_to_confirm_s += f.time_to_confirm_s / seeds;
        all.ghosts += f.ghosts;
        all.breaks += f.breaks;
        all.false_tracks += f.false_tracks;
    }
    *us_per_frame = 1e6 * spent_s / seeds / CLOSE_FRAMES;
    return all;
}

static const close_kind *find_kind(const char *name) {
    for (int i = 0; i < CLOSE_KINDS; i++) {
        if (strcmp(close_kinds[i].name, name) == 0) {
            return &close_kinds[i];
        }
    }
    return NULL;
}

static int run_scenes(const char *association, const char *scene, int first, int seeds) {
    for (int a = 0; a < (int)(sizeof associations / sizeof *associations); a++) {
        for (int i = 0; i < CLOSE_KINDS && strcmp(associations[a], association) == 0; i++) {
            bool all = strcmp(scene, "all") == 0;
            if (all || strcmp(close_kinds[i].name, scene) == 0) {
                double us;
                bst_track_figures f =
                    over_seeds((bst_mtt_association)a, &close_kinds[i], first, seeds, !all, &us);
                print_figures(close_kinds[i].name, &f);
                printf("%s us_per_frame %.0f\n", close_kinds[i].name, us);
            }
        }
    }
    return 0;
}

static int write_scene(const close_kind *kind, uint64_t seed) {
    static close_scene scene;
    close_open(&scene, kind, seed);
    for (int k = 0; k < CLOSE_FRAMES; k++) {
        close_expose(&scene, k);
        for (int i = 0; i < scene.count; i++) {
            const close_detection *d = &scene.list[i];
            printf("%d %.6f %.6f %.6f %.4f %.3f\n", k, d->x, d->y, d->sigma, d->v_mag, d->snr);
        }
    }
    return 0;
}

static int score_tracks(const close_kind *kind, uint64_t seed) {
    static close_scene scene;
    static shown frames[CLOSE_FRAMES];
    int frame, room = MAX_AT_ONCE;
    long long id;
    double x, y;
    while (scanf("%d %lld %lf %lf", &frame, &id, &x, &y) == 4) {
        if (frame >= 0 && frame < CLOSE_FRAMES && frames[frame].count < room) {
            int i = frames[frame].count++;
            frames[frame].id[i] = id;
            frames[frame].x[i] = x;
            frames[frame].y[i] = y;
        }
    }
    bst_track_metrics *metrics = open_metrics(kind);
    close_open(&scene, kind, seed);
    for (int k = 0; k < CLOSE_FRAMES; k++) {
        score_frame(metrics, &scene, k, &frames[k]);
    }
    bst_track_figures figures;
    bst_track_metrics_figures(metrics, &figures);
    print_figures(kind->name, &figures);
    bst_track_metrics_free(metrics);
    return 0;
}

/* Three seeds of each scene: with existence probabilities there are no ghosts, and the mean GOSPA
 * stays below a limit and below that of the association `mixture`, which has none. */
static void short_form(void **state) {
    (void)state;
    /* px: the mean of 16 seeds in docs/results/close_objects.md and half as much again;
     * formation12: seed 1 begins with an unresolved pair, which costs 0.3 px of the mean of three
     * seeds */
    static const double most_px[] = {0.16, 0.6, 0.32, 0.65, 0.27, 0.47};
    for (int i = 0; i < (int)(sizeof most_px / sizeof *most_px); i++) {
        double us;
        bst_track_figures before = over_seeds(BST_MTT_MIXTURE, &close_kinds[i], 0, 3, false, &us);
        bst_track_figures f = over_seeds(BST_MTT_PMB, &close_kinds[i], 0, 3, false, &us);
        print_figures(close_kinds[i].name, &f);
        assert_int_equal(f.ghosts, 0);
        assert_true(f.purity > 0.999);
        assert_true(f.gospa_mean < most_px[i] * CLOSE_PIXEL_RAD);
        assert_true(f.gospa_mean < 1.05 * before.gospa_mean);
    }
}

/* A pair that half of the frames show as one detection: no track takes the centre of light for an
 * object. Without the doubt about detections of tentative tracks there are 3 ghosts and 0.63 px. */
static void half_resolved(void **state) {
    (void)state;
    double us;
    const close_kind *kind = find_kind("half_resolved");
    bst_track_figures f = over_seeds(BST_MTT_PMB, kind, 0, 16, false, &us);
    print_figures(kind->name, &f);
    assert_int_equal(f.ghosts, 0);
    /* half as much again as the mean in docs/results/close_objects.md */
    assert_true(f.gospa_mean < 0.44 * CLOSE_PIXEL_RAD);
    assert_true(f.coverage > 0.94);
}

int main(int argc, char **argv) {
    const close_kind *kind = argc == 4 ? find_kind(argv[2]) : NULL;
    if ((argc == 5 || argc == 6) && strcmp(argv[1], "run") == 0) {
        return run_scenes(argv[2], argv[3], argc == 6 ? atoi(argv[5]) : 0, atoi(argv[4]));
    }
    if (kind && strcmp(argv[1], "write") == 0) {
        return write_scene(kind, (uint64_t)atoi(argv[3]));
    }
    if (kind && strcmp(argv[1], "score") == 0) {
        return score_tracks(kind, (uint64_t)atoi(argv[3]));
    }
    const struct CMUnitTest tests[] = {cmocka_unit_test(short_form),
                                       cmocka_unit_test(half_resolved)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
