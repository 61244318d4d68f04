#include "tests/imgproc/synthetic.h"

#include <stdlib.h>

#include "tests/test_support.h"

void synthetic_init(synthetic *s, int width, int height) {
    *s = (synthetic){.width = width, .height = height, .sky_e = 4.0, .read_e = 8.0};
    s->camera = (bst_camera){.width_px = width,
                             .height_px = height,
                             .pixel_scale_arcsec = 3.0,
                             .aperture_m = 0.15,
                             .throughput = 0.8,
                             .quantum_efficiency = 0.7,
                             .photon_flux_v0_per_s_m2 = 1e10,
                             .psf_fwhm_px = 2.0,
                             .read_noise_e = 8.0,
                             .full_well_e = 1e5,
                             .gain_e_per_dn = 2.0,
                             .offset_dn = 100.0,
                             .bits = 16};
    s->config = (bst_imgproc_config){.capacity = 2048,
                                     .mesh_px = 64,
                                     .false_alarms_per_frame = 1.0,
                                     .streak_min_px = 1.5,
                                     .streak_max_px = 64.0,
                                     .search_radius_px = 60.0,
                                     .match_tolerance_px = 3.0};
    size_t pixels = (size_t)width * (size_t)height;
    s->mean_e = calloc(pixels, sizeof *s->mean_e);
    s->pixels = calloc(pixels, sizeof *s->pixels);
    assert_non_null(s->mean_e);
    assert_non_null(s->pixels);
    synthetic_clear(s);
}

void synthetic_free(synthetic *s) {
    free(s->mean_e);
    free(s->pixels);
}

void synthetic_clear(synthetic *s) {
    for (int i = 0; i < s->width * s->height; i++) {
        s->mean_e[i] = s->sky_e;
    }
}

/* Shares of pixels first to first + count - 1 in a Gaussian's light along an axis, times `part`. */
static void add_shares(int first, int count, double centre, double sigma, double part,
                       double *out) {
    double root = sigma * sqrt(2.0), before = erf((first - 0.5 - centre) / root);
    for (int i = 0; i < count; i++) {
        double after = erf((first + i + 0.5 - centre) / root);
        out[i] = 0.5 * part * (after - before);
        before = after;
    }
}

enum { BOX_LIMIT = 160 };

/* The source's image on a box about it: [ny][nx] from (x0, y0). */
typedef struct box {
    int x0, y0, nx, ny;
    double p[BOX_LIMIT * BOX_LIMIT];
} box;

static void draw(const synthetic *s, double x, double y, double dx, double dy, box *b) {
    double sigma = bst_camera_psf_sigma_px(&s->camera), reach = 6.0 * sigma + 1.0;
    b->x0 = (int)floor(x - 0.5 * fabs(dx) - reach);
    b->y0 = (int)floor(y - 0.5 * fabs(dy) - reach);
    b->nx = (int)ceil(x + 0.5 * fabs(dx) + reach) - b->x0 + 1;
    b->ny = (int)ceil(y + 0.5 * fabs(dy) + reach) - b->y0 + 1;
    assert_true(b->nx <= BOX_LIMIT && b->ny <= BOX_LIMIT);
    memset(b->p, 0, sizeof b->p);
    /* Gauss-Legendre of four points (Abramowitz and Stegun, table 25.4) on pieces of at most a
     * sigma: the eighth derivative of a Gaussian leaves 6e-8 of its peak */
    static const double place[4] = {-0.43056815579702629, -0.16999052179242813, 0.16999052179242813,
                                    0.43056815579702629};
    static const double weight[4] = {0.17392742256872693, 0.32607257743127307, 0.32607257743127307,
                                     0.17392742256872693};
    int pieces = (int)fmax(ceil(hypot(dx, dy) / sigma), 1.0);
    int points = dx == 0.0 && dy == 0.0 ? 1 : 4 * pieces;
    double px[BOX_LIMIT], py[BOX_LIMIT];
    for (int k = 0; k < points; k++) {
        double t = points == 1 ? 0.0 : (k / 4 + 0.5 + place[k % 4]) / pieces - 0.5;
        double part = points == 1 ? 1.0 : weight[k % 4] / pieces;
        add_shares(b->x0, b->nx, x + t * dx, sigma, part, px);
        add_shares(b->y0, b->ny, y + t * dy, sigma, 1.0, py);
        for (int j = 0; j < b->ny; j++) {
            for (int i = 0; i < b->nx; i++) {
                b->p[j * b->nx + i] += px[i] * py[j];
            }
        }
    }
}

void synthetic_add(synthetic *s, double x, double y, double flux_e, double dx, double dy) {
    static const box empty = {0};
    box b = empty;
    draw(s, x, y, dx, dy, &b);
    for (int j = 0; j < b.ny; j++) {
        for (int i = 0; i < b.nx; i++) {
            int u = b.x0 + i, v = b.y0 + j;
            if (u >= 0 && v >= 0 && u < s->width && v < s->height) {
                s->mean_e[v * s->width + u] += flux_e * b.p[j * b.nx + i];
            }
        }
    }
}

/* Inversion below 50; above, a rounded normal (skew 1 / sqrt(mean) < 0.15, far below what these
 * tests resolve). `normal` is the deviate to use then; none: probability of no event. */
static double poisson(double mean, double none, double normal) {
    if (mean <= 0.0) {
        return 0.0;
    }
    if (mean > 50.0) {
        return fmax(0.0, floor(mean + sqrt(mean) * normal + 0.5));
    }
    double uniform = 0.5 * erfc(-normal / sqrt(2.0)), p = none, sum = p;
    int k = 0;
    while (uniform > sum && k < 400) {
        k++;
        p *= mean / k;
        sum += p;
    }
    return k;
}

enum { SKY_COUNTS = 24 };

/* The normal deviates from which on poisson() of a mean has one event more: most pixels are sky,
 * and comparing them spares erfc. With more than SKY_COUNTS - 1 events, poisson() counts. */
static void make_limits(double mean, double limit[SKY_COUNTS]) {
    double p = exp(-mean), sum = p;
    for (int k = 0; k < SKY_COUNTS; k++) {
        double low = -9.0, high = 9.0;
        for (int i = 0; i < 60; i++) {
            double middle = 0.5 * (low + high);
            *(0.5 * erfc(-middle / sqrt(2.0)) > sum ? &high : &low) = middle;
        }
        limit[k] = high;
        p *= mean / (k + 1);
        sum += p;
    }
}

/* Electrons after a multiplication register, over its gain: 1 + sqrt(1 - 1 / gain) (e - 1) of each,
 * e exponential (Basden, Haniff & Mackay 2003, MNRAS 345, 985); the sum of more than a few by the
 * cube root (Wilson & Hilferty 1931, PNAS 17, 684). */
static double multiplied(double electrons, double gain, bst_rng_key key, uint64_t frame,
                         uint64_t pixel) {
    enum { FEW = 8 };
    const uint64_t first = (uint64_t)1 << 40 | pixel * FEW;
    double sum = 0.0;
    if (electrons > FEW) {
        double z = bst_rng_normal(key, frame, first), third = 1.0 / (9.0 * electrons);
        sum = electrons * pow(1.0 - third + z * sqrt(third), 3.0);
    } else {
        for (int i = 0; i < (int)electrons; i++) {
            sum -= log(bst_rng_uniform(key, frame, first + (uint64_t)i));
        }
    }
    return electrons + sqrt(1.0 - 1.0 / gain) * (sum - electrons);
}

void synthetic_expose(synthetic *s, bst_rng_key key, uint64_t frame) {
    double top = ldexp(1.0, (int)s->camera.bits) - 1.0, limit[SKY_COUNTS];
    bool counts = s->sky_e > 0.0 && s->sky_e <= 50.0;
    if (counts) {
        make_limits(s->sky_e, limit);
    }
    for (int i = 0; i < s->width * s->height; i++) {
        double z[2];
        bst_rng_normal2(key, frame, (uint64_t)i, z);
        double e, mean = s->mean_e[i];
        if (counts && mean == s->sky_e && z[1] < limit[SKY_COUNTS - 1]) {
            int k = 0;
            while (z[1] >= limit[k]) {
                k++;
            }
            e = k;
        } else {
            e = poisson(mean, exp(-mean), z[1]);
        }
        if (s->camera.detector.em_gain > 1.0) {
            e = multiplied(e, s->camera.detector.em_gain, key, frame, (uint64_t)i);
        }
        e = fmin(e, s->camera.full_well_e) + s->read_e * z[0];
        double dn = floor(s->camera.offset_dn + e / s->camera.gain_e_per_dn + 0.5);
        s->pixels[i] = (uint16_t)fmin(fmax(dn, 0.0), top);
    }
}

double synthetic_norm(const synthetic *s, double x, double y, double dx, double dy) {
    static const box empty = {0};
    box b = empty;
    draw(s, x, y, dx, dy, &b);
    double sum = 0.0;
    for (int i = 0; i < b.nx * b.ny; i++) {
        sum += b.p[i] * b.p[i];
    }
    return sqrt(sum);
}

double synthetic_noise(const synthetic *s) {
    double gain = s->camera.gain_e_per_dn, em_gain = s->camera.detector.em_gain;
    double excess = em_gain > 1.0 ? 2.0 - 1.0 / em_gain : 1.0;
    return sqrt(excess * s->sky_e + s->read_e * s->read_e + gain * gain / 12.0);
}

void synthetic_bound(const synthetic *s, double x, double y, double flux_e, double dx, double dy,
                     double cov[3]) {
    static const box empty = {0};
    const double h = 1e-3;
    box b = empty, left = empty, right = empty, up = empty, down = empty;
    draw(s, x, y, dx, dy, &b);
    draw(s, x - h, y, dx, dy, &left);
    draw(s, x + h, y, dx, dy, &right);
    draw(s, x, y - h, dx, dy, &up);
    draw(s, x, y + h, dx, dy, &down);
    /* the boxes may differ by a pixel: look up by frame pixel */
    const box *all[4] = {&left, &right, &up, &down};
    double f[3][3] = {{0}}, noise = synthetic_noise(s);
    for (int j = 1; j + 1 < b.ny; j++) {
        for (int i = 1; i + 1 < b.nx; i++) {
            double p[4];
            for (int k = 0; k < 4; k++) {
                int u = b.x0 + i - all[k]->x0, v = b.y0 + j - all[k]->y0;
                bool in = u >= 0 && v >= 0 && u < all[k]->nx && v < all[k]->ny;
                p[k] = in ? all[k]->p[v * all[k]->nx + u] : 0.0;
            }
            double share_here = b.p[j * b.nx + i];
            double g[3] = {flux_e * (p[1] - p[0]) / (2 * h), flux_e * (p[3] - p[2]) / (2 * h),
                           share_here};
            double w = 1.0 / (noise * noise + flux_e * share_here);
            for (int m = 0; m < 3; m++) {
                for (int n = 0; n < 3; n++) {
                    f[m][n] += w * g[m] * g[n];
                }
            }
        }
    }
    /* flux eliminated */
    double a = f[0][0] - f[0][2] * f[0][2] / f[2][2];
    double c = f[1][1] - f[1][2] * f[1][2] / f[2][2];
    double o = f[0][1] - f[0][2] * f[1][2] / f[2][2];
    double det = a * c - o * o;
    cov[0] = c / det;
    cov[1] = -o / det;
    cov[2] = a / det;
}

bst_camera_motion synthetic_motion(const synthetic *s, double dx, double dy) {
    /* a turn r moves the boresight direction by r x z = (r_y, -r_x) */
    double scale = bst_camera_scale_rad(&s->camera);
    return (bst_camera_motion){.q_cam_from_gcrf = BST_QUAT_IDENTITY,
                               .turn_cam_rad = {-dy * scale, dx * scale, 0.0}};
}

bst_imgproc_frame synthetic_frame(const synthetic *s) {
    return (bst_imgproc_frame){.pixels = s->pixels,
                               .window = {0, 0, s->width, s->height},
                               .binning = 1,
                               .bits = (int)s->camera.bits,
                               .exposure_s = 0.5};
}

bst_imgproc *synthetic_processor(bst_ctx *ctx, const synthetic *s) {
    bst_imgproc *ip = NULL;
    bst_assert_ok(ctx, bst_imgproc_create(ctx, &s->camera, 1e8, &s->config, NULL, &ip));
    return ip;
}

bst_detections *synthetic_detections(int n) {
    bst_detections *d = calloc(1, sizeof *d + (size_t)n * sizeof d->items[0]);
    assert_non_null(d);
    return d;
}

int synthetic_nearest(const bst_detections *d, double x, double y, double radius) {
    int best = -1;
    for (int i = 0; i < d->count; i++) {
        double r = hypot(d->items[i].x_px - x, d->items[i].y_px - y);
        if (r < radius) {
            radius = r;
            best = i;
        }
    }
    return best;
}

int synthetic_sound(const bst_detections *d) {
    int sound = isfinite(d->background_e) && isfinite(d->noise_e) && isfinite(d->threshold_snr);
    for (int i = 0; i < d->count; i++) {
        const bst_detection *t = &d->items[i];
        const double numbers[] = {t->x_px,      t->y_px,     t->cov_xx,       t->cov_xy,
                                  t->cov_yy,    t->flux_e,   t->flux_sigma_e, t->snr,
                                  t->length_px, t->width_px, t->angle_rad,    t->v_mag};
        for (size_t k = 0; k < sizeof numbers / sizeof *numbers; k++) {
            sound = sound && isfinite(numbers[k]);
        }
        sound = sound && t->cov_xx > 0.0 && t->cov_yy > 0.0 &&
                t->cov_xx * t->cov_yy > t->cov_xy * t->cov_xy && t->flux_e > 0.0;
    }
    return sound;
}
