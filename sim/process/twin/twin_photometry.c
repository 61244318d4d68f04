/* Zero point and colour term of the frame. */
#include <math.h>
#include <stdlib.h>

#include "sim/core/compare.h"
#include "sim/process/twin/twin_internal.h"

/* Stars that count: signal-to-noise ratio, and share of the light on the frame. */
static const double LEAST_SNR = 10.0, LEAST_INSIDE = 0.15;
/* Stars further off than this are left out, standard deviations by the median deviation. */
static const double CLIP = 3.0, LEAST_SPREAD = 0.2;
/* Colour term that is expected beforehand: standard deviation. */
static const double COLOUR_SIGMA = 1.0;
/* Scatter of stars without errors of the catalogue; standard error of the catalogue's V at V = 12,
 * which grows with 1 over the light, and that of B-V over it (Tycho-2: about 0.1 mag in V at 11.5;
 * Hog et al. 2000, A&A 355, L27, section 4); spread of the colours of stars. */
static const double STAR_SIGMA = 0.1, V_SIGMA_12 = 0.15, COLOUR_ERRORS = 1.8, COLOUR_SPREAD = 0.5;
static const double SOLAR_B_MINUS_V = 0.65, MAD_TO_SIGMA = 1.4826;

/* A star of the catalogue that was measured. */
typedef struct measured {
    double difference; /* V plus 2.5 log10 of the electrons per second */
    double colour;     /* most probable B-V, less the Sun's */
    double v_mag;
    double weight; /* 1 over the squared standard error */
    bool out;
} measured;

/* Standard error of the catalogue's V. */
static double v_sigma(double v_mag) {
    return V_SIGMA_12 * pow(10.0, 0.4 * (v_mag - 12.0));
}

/* Most probable B-V of a star less the Sun's, given the error of the catalogue: faint stars are
 * like others. */
static double probable_colour(const bst_twin_star *s) {
    double sigma = COLOUR_ERRORS * v_sigma(s->v_mag), spread = COLOUR_SPREAD;
    return isfinite(s->b_minus_v) ? (s->b_minus_v - SOLAR_B_MINUS_V) * spread * spread /
                                        (spread * spread + sigma * sigma)
                                  : 0.0;
}

/* Weight of a star's magnitude. */
static double weight_of(const bst_twin_star *s) {
    double v = v_sigma(s->v_mag),
           colour = COLOUR_ERRORS * v * COLOUR_SPREAD / hypot(COLOUR_ERRORS * v, COLOUR_SPREAD);
    /* a colour term of 0.5 is usual of silicon without a filter */
    return 1.0 / (STAR_SIGMA * STAR_SIGMA + v * v + 0.25 * colour * colour);
}

static int collect(const bst_twin *t, measured *out) {
    int n = 0;
    for (int i = 0; i < t->model.count; i++) {
        const bst_twin_star *s = &t->model.stars[i];
        if (s->found || !(s->flux_e > LEAST_SNR * s->sigma_e) || s->inside < LEAST_INSIDE) {
            continue;
        }
        double rate = s->flux_e / fmax(t->frame->values.exposure_s, 1e-9);
        out[n++] = (measured){s->v_mag + 2.5 * log10(rate), probable_colour(s), s->v_mag,
                              weight_of(s), false};
    }
    return n;
}

/* Zero point and colour term of those that are in. */
static void fit_line(const measured *m, int n, bst_twin_photometry *p) {
    double w = 0.0, x = 0.0, y = 0.0, xx = 1.0 / (COLOUR_SIGMA * COLOUR_SIGMA), xy = 0.0;
    p->stars = 0;
    for (int i = 0; i < n; i++) {
        if (!m[i].out) {
            p->stars++;
            w += m[i].weight;
            x += m[i].weight * m[i].colour;
            y += m[i].weight * m[i].difference;
        }
    }
    x /= fmax(w, 1e-9);
    y /= fmax(w, 1e-9);
    for (int i = 0; i < n; i++) {
        if (!m[i].out) {
            xx += m[i].weight * (m[i].colour - x) * (m[i].colour - x);
            xy += m[i].weight * (m[i].colour - x) * (m[i].difference - y);
        }
    }
    p->colour_mag = xy / xx;
    p->zero_point_mag = w > 0.0 ? y - p->colour_mag * x : NAN;
}

static double off(const measured *m, const bst_twin_photometry *p) {
    return m->difference - p->zero_point_mag - p->colour_mag * m->colour;
}

/* Leaves out what is far off; twice, with the line fitted anew. */
static void clip(measured *m, int n, double *work, bst_twin_photometry *p) {
    for (int i = 0; i < n; i++) {
        work[i] = m[i].difference;
    }
    qsort(work, (size_t)n, sizeof *work, bst_compare_doubles);
    p->zero_point_mag = n > 0 ? work[n / 2] : NAN;
    p->colour_mag = 0.0;
    for (int round = 0; round < 4; round++) {
        for (int i = 0; i < n; i++) {
            work[i] = fabs(off(&m[i], p)) * sqrt(m[i].weight);
        }
        qsort(work, (size_t)n, sizeof *work, bst_compare_doubles);
        double limit = n > 0 ? CLIP * fmax(MAD_TO_SIGMA * work[n / 2], LEAST_SPREAD) : 0.0;
        for (int i = 0; i < n; i++) {
            m[i].out = fabs(off(&m[i], p)) * sqrt(m[i].weight) > limit;
        }
        fit_line(m, n, p);
    }
}

/* Standard deviation of those that are in and brighter than a magnitude. */
static double scatter(const measured *m, int n, double v_limit, const bst_twin_photometry *p,
                      int *used) {
    double sum = 0.0, sum2 = 0.0;
    *used = 0;
    for (int i = 0; i < n; i++) {
        if (!m[i].out && m[i].v_mag < v_limit) {
            sum += off(&m[i], p);
            sum2 += off(&m[i], p) * off(&m[i], p);
            ++*used;
        }
    }
    return *used > 2 ? sqrt(fmax(sum2 - sum * sum / *used, 0.0) / (*used - 1)) : NAN;
}

bst_status bst_twin_measure_photometry(bst_ctx *ctx, bst_twin *t) {
    bst_twin_photometry *p = &t->photometry;
    size_t room = (size_t)t->model.count + 1;
    measured *m = malloc(room * sizeof *m);
    double *work = malloc(room * sizeof *work);
    int used;
    if (!m || !work) {
        free(m);
        free(work);
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for %zu stars", room);
    }
    int n = collect(t, m);
    clip(m, n, work, p);
    p->scatter_mag = scatter(m, n, INFINITY, p, &used);
    p->bright_mag = scatter(m, n, BST_TWIN_BRIGHT_V, p, &p->bright);
    for (int i = 0; i < t->model.count && isfinite(p->zero_point_mag); i++) {
        bst_twin_star *s = &t->model.stars[i];
        double mag = s->v_mag - p->zero_point_mag - p->colour_mag * probable_colour(s);
        s->expected_e = s->found ? NAN : t->frame->values.exposure_s * pow(10.0, -0.4 * mag);
    }
    free(m);
    free(work);
    return BST_OK;
}
