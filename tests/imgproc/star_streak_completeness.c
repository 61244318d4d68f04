/* Completeness and false alarms of star streaks along a known path, as a table.
 *
 * Usage: test_imgproc_star_streak_completeness [NAME=VALUE ...], with the names of `arguments`
 * below. Each frame has stars of random places and a power law of fluxes on one curved, unevenly
 * lit path, Poisson and read noise. The SNR of a star is the bound of the matched filter: the root
 * of the sum of its squared image over the variance of the background, inside the frame. */
#include <stdlib.h>
#include <time.h>

#include "boresight/rng.h"
#include "imgproc/streak/star_path.h"
#include "tests/imgproc/synthetic.h"
#include "tests/test_support.h"

enum { NODES = 41, MOST_STARS = 600, BINS = 9, CAPACITY = 2048 };
static const double EDGES[BINS + 1] = {0, 4, 5, 6, 7, 8, 10, 15, 30, 1e9};
/* Wings of the PSF: share `wings` of the light in a Gaussian this many times as wide. */
static const double WING = 2.5;

typedef struct arguments {
    double frames, first, side, stars, length, bend, angle;
    double faintest;    /* SNR of a whole streak; the cumulative number falls as 1 / SNR */
    double brightest;   /* SNR */
    double wings;       /* share of the PSF that the processing does not know */
    double path_error;  /* amplitude of a ripple of the given path across, px */
    double alarms;      /* false_alarms_per_frame */
    double least, most; /* check: least share of stars above SNR 8, most false alarms a frame */
} arguments;

/* A star and what was found of it. */
typedef struct star {
    double x, y, snr, flux_e;
} star;

typedef struct totals {
    int stars[BINS], found[BINS], false_alarms, detections, frames;
    double expected[BINS], share[BINS], light[BINS];
    double place_chi2, threshold, cpu_s;
    int bright;
} totals;

static void read_arguments(int argc, char **argv, arguments *a) {
    *a = (arguments){.frames = 20,
                     .side = 300,
                     .stars = 40,
                     .length = 150,
                     .bend = 0.1,
                     .angle = 0.4,
                     .faintest = 3,
                     .brightest = 1000,
                     .alarms = 1,
                     .most = 1e9};
    for (int i = 1; i < argc; i++) {
        struct {
            const char *name;
            double *value;
        } all[] = {
            {"frames=", &a->frames}, {"first=", &a->first},       {"side=", &a->side},
            {"stars=", &a->stars},   {"length=", &a->length},     {"bend=", &a->bend},
            {"angle=", &a->angle},   {"faintest=", &a->faintest}, {"brightest=", &a->brightest},
            {"wings=", &a->wings},   {"path=", &a->path_error},   {"alarms=", &a->alarms},
            {"least=", &a->least},   {"most=", &a->most}};
        bool taken = false;
        for (size_t k = 0; k < sizeof all / sizeof *all; k++) {
            size_t n = strlen(all[k].name);
            if (strncmp(argv[i], all[k].name, n) == 0) {
                *all[k].value = atof(argv[i] + n);
                taken = true;
            }
        }
        if (!taken) {
            fail_msg("%s: no argument of this program", argv[i]);
        }
    }
    assert_true(a->stars <= MOST_STARS && a->frames >= 1 && a->length >= 10);
}

static double cpu_s(void) {
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

/* The motion of a frame about its mean place: a parabola that slows down by 30 %. */
static void make_nodes(const arguments *a, bst_star_path_node nodes[NODES], double ripple_px) {
    double mean[2] = {0.0, 0.0}, c = cos(a->angle), s = sin(a->angle);
    for (int k = 0; k < NODES; k++) {
        double t = (double)k / (NODES - 1), u = 2.0 * (1.15 * t - 0.15 * t * t) - 1.0;
        double along = 0.5 * a->length * u;
        double across = a->bend * a->length * u * u + ripple_px * sin(7.0 * u);
        nodes[k] = (bst_star_path_node){t, c * along - s * across, s * along + c * across};
        double w = (k == 0 || k == NODES - 1 ? 0.5 : 1.0) / (NODES - 1);
        mean[0] += w * nodes[k].x_px;
        mean[1] += w * nodes[k].y_px;
    }
    for (int k = 0; k < NODES; k++) {
        nodes[k].x_px -= mean[0];
        nodes[k].y_px -= mean[1];
    }
}

/* Draws the light of a star along the motion. */
static void draw_path(synthetic *s, const bst_star_path_node nodes[NODES], double x, double y,
                      double flux_e) {
    const double reach = 40.0;
    for (int k = 1; k < NODES; k++) {
        double dx = nodes[k].x_px - nodes[k - 1].x_px, dy = nodes[k].y_px - nodes[k - 1].y_px;
        double cx = x + nodes[k - 1].x_px + 0.5 * dx, cy = y + nodes[k - 1].y_px + 0.5 * dy;
        if (cx > -reach && cy > -reach && cx < s->width + reach && cy < s->height + reach) {
            synthetic_add(s, cx, cy, flux_e / (NODES - 1), dx, dy);
        }
    }
}

static void draw_star(const arguments *a, synthetic *s, const bst_star_path_node nodes[NODES],
                      double x, double y, double flux_e) {
    draw_path(s, nodes, x, y, flux_e * (1.0 - a->wings));
    if (a->wings > 0.0) {
        double fwhm = s->camera.psf_fwhm_px;
        s->camera.psf_fwhm_px = WING * fwhm;
        draw_path(s, nodes, x, y, flux_e * a->wings);
        s->camera.psf_fwhm_px = fwhm;
    }
}

/* SNR of a star of unit flux: the bound of the matched filter. */
static double unit_snr(const arguments *a, synthetic *scratch,
                       const bst_star_path_node nodes[NODES], double x, double y) {
    double sum = 0.0, noise = synthetic_noise(scratch);
    synthetic_clear(scratch);
    draw_star(a, scratch, nodes, x, y, 1.0);
    for (int i = 0; i < scratch->width * scratch->height; i++) {
        sum += pow(scratch->mean_e[i] - scratch->sky_e, 2.0);
    }
    return sqrt(sum) / noise;
}

/* True if a detection is at a place, within its errors. */
static bool is_at(const bst_detection *d, double x, double y, double *distance2) {
    double dx = d->x_px - x, dy = d->y_px - y;
    double det = d->cov_xx * d->cov_yy - d->cov_xy * d->cov_xy;
    *distance2 = (d->cov_yy * dx * dx - 2.0 * d->cov_xy * dx * dy + d->cov_xx * dy * dy) / det;
    return *distance2 < 25.0 || hypot(dx, dy) < 1.5;
}

static int bin_of(double snr) {
    int b = 0;
    while (snr >= EDGES[b + 1]) {
        b++;
    }
    return b;
}

/* Assigns the brightest stars first, each to the nearest detection that is free. */
static void assign(const bst_detections *d, star *stars, int count, totals *t) {
    static bool taken[CAPACITY];
    memset(taken, 0, sizeof taken);
    for (int i = 0; i < count; i++) {
        double best = HUGE_VAL, d2;
        int at = -1;
        for (int k = 0; k < d->count; k++) {
            if ((d->items[k].flags & BST_DETECTION_STREAK) && !taken[k] &&
                is_at(&d->items[k], stars[i].x, stars[i].y, &d2) && d2 < best) {
                best = d2;
                at = k;
            }
        }
        int b = bin_of(stars[i].snr);
        double excess = stars[i].snr - d->threshold_snr;
        t->stars[b]++;
        t->expected[b] += 0.5 * erfc(-excess / sqrt(2.0));
        if (at >= 0) {
            taken[at] = true;
            t->share[b] += d->items[at].snr / stars[i].snr;
            t->light[b] += d->items[at].flux_e / stars[i].flux_e;
            t->found[b]++;
            if (stars[i].snr > 8.0) {
                t->place_chi2 += best;
                t->bright++;
            }
        }
    }
    for (int k = 0; k < d->count; k++) {
        bool streak = (d->items[k].flags & BST_DETECTION_STREAK) != 0;
        t->detections += streak;
        t->false_alarms += streak && !taken[k];
        if (streak && !taken[k] && getenv("VERBOSE")) {
            fprintf(stderr, "false: frame %d, %.1f, %.1f, SNR %.1f\n", t->frames, d->items[k].x_px,
                    d->items[k].y_px, d->items[k].snr);
        }
    }
}

static int brighter_first(const void *a, const void *b) {
    double d = ((const star *)b)->snr - ((const star *)a)->snr;
    return (d > 0.0) - (d < 0.0);
}

static void one_frame(const arguments *a, int frame, totals *t) {
    bst_ctx ctx = {0};
    bst_rng_key key = bst_rng_make_key((uint64_t)frame, 0, "test", "star_streaks");
    bst_star_path_node nodes[NODES], given[NODES];
    static star stars[MOST_STARS];
    synthetic s, scratch;
    synthetic_init(&s, (int)a->side, (int)a->side);
    synthetic_init(&scratch, (int)a->side, (int)a->side);
    s.config.false_alarms_per_frame = a->alarms;
    make_nodes(a, nodes, 0.0);
    make_nodes(a, given, a->path_error);
    double whole = unit_snr(a, &scratch, nodes, 0.5 * a->side, 0.5 * a->side);
    int count = (int)a->stars;
    for (int i = 0; i < count; i++) {
        double room = a->side + a->length, u = bst_rng_uniform(key, (uint64_t)i, 2);
        stars[i].x = room * bst_rng_uniform(key, (uint64_t)i, 0) - 0.5 * a->length;
        stars[i].y = room * bst_rng_uniform(key, (uint64_t)i, 1) - 0.5 * a->length;
        double snr = fmin(a->faintest / fmax(u, 1e-6), a->brightest);
        double unit = unit_snr(a, &scratch, nodes, stars[i].x, stars[i].y);
        stars[i].snr = snr * unit / whole;
        stars[i].flux_e = snr / whole;
        draw_star(a, &s, nodes, stars[i].x, stars[i].y, snr / whole);
    }
    qsort(stars, (size_t)count, sizeof *stars, brighter_first);
    while (count > 0 && !(stars[count - 1].snr > 1.0)) { /* outside the frame */
        count--;
    }
    synthetic_expose(&s, key, 1000);
    bst_imgproc *ip = synthetic_processor(&ctx, &s);
    bst_detections *d = synthetic_detections(CAPACITY);
    bst_imgproc_frame f = synthetic_frame(&s);
    bst_camera_motion motion = synthetic_motion(&s, nodes[NODES - 1].x_px - nodes[0].x_px,
                                                nodes[NODES - 1].y_px - nodes[0].y_px);
    bool followed;
    bst_assert_ok(&ctx, bst_imgproc_detect(&ctx, ip, &f, &motion, d, CAPACITY));
    double start = cpu_s();
    bst_assert_ok(&ctx, bst_imgproc_follow_streaks(&ctx, ip, given, NODES, d, CAPACITY, &followed));
    t->cpu_s += cpu_s() - start;
    assert_true(followed && synthetic_sound(d));
    t->threshold += d->threshold_snr;
    assign(d, stars, count, t);
    t->frames++;
    bst_imgproc_free(ip);
    free(d);
    synthetic_free(&s);
    synthetic_free(&scratch);
}

int main(int argc, char **argv) {
    arguments a;
    totals t = {.frames = 0};
    read_arguments(argc, argv, &a);
    for (int i = 0; i < (int)a.frames; i++) {
        one_frame(&a, (int)a.first + i, &t);
    }
    printf("%d frames, threshold SNR %.2f, %.1f streaks and %.3f false alarms a frame, %.3f s\n",
           t.frames, t.threshold / t.frames, (double)t.detections / t.frames,
           (double)t.false_alarms / t.frames, t.cpu_s / t.frames);
    printf("squared error over the variance of a place, mean of %d: %.2f (2 is right)\n", t.bright,
           t.place_chi2 / (t.bright > 0 ? t.bright : 1));
    int bright = 0, found = 0;
    for (int b = 0; b < BINS; b++) {
        if (t.stars[b] > 0) {
            printf(
                "SNR %4.0f to %-4.0f %5d stars, found %.3f, bound %.3f, their SNR %.3f and light "
                "%.3f of "
                "the true\n",
                EDGES[b], fmin(EDGES[b + 1], 9999.0), t.stars[b], (double)t.found[b] / t.stars[b],
                t.expected[b] / t.stars[b], t.share[b] / fmax(t.found[b], 1),
                t.light[b] / fmax(t.found[b], 1));
        }
        bright += EDGES[b] >= 8.0 ? t.stars[b] : 0;
        found += EDGES[b] >= 8.0 ? t.found[b] : 0;
    }
    bool good = found >= a.least * bright && t.false_alarms <= a.most * t.frames;
    return good ? 0 : 1;
}
