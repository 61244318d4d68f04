#include "gimbal/jitter/jitter_spectrum.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "boresight/vec.h"
#include "gimbal/jitter/jitter_more.h"

/* Loads one band's table, inline or from a file, scaled; owned by *out. */
static bst_status load_table(bst_ctx *ctx, const char *key, const bst_config_list *list,
                             const char *file, double scale, bst_jitter_density *out) {
    *out = (bst_jitter_density){NULL, 0};
    bst_jitter_density_point *points = NULL;
    int count = list->count;
    if (*file && list->count > 0) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "platform/jitter_psd/%s: both a table and %s_file are given; leave one out",
                        key, key);
    }
    if (*file) {
        BST_TRY(bst_jitter_density_load(ctx, file, &points, &count));
    } else if (count > 0) {
        points = malloc((size_t)count * sizeof *points);
        if (!points) {
            return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a table of jitter");
        }
        memcpy(points, list->items, (size_t)count * sizeof *points);
    } else {
        return BST_OK;
    }
    char what[600];
    snprintf(what, sizeof what, "%s%s", *file ? "" : "platform/jitter_psd/", *file ? file : key);
    bst_jitter_density density = {points, count};
    bst_status status = bst_jitter_density_check(ctx, what, &density);
    if (status != BST_OK) {
        free(points);
        return status;
    }
    for (int i = 0; i < count; i++) {
        points[i].psd *= scale;
    }
    *out = density;
    return BST_OK;
}

bst_status bst_jitter_spectrum_create(bst_ctx *ctx, const bst_jitter_spec *flat,
                                      const bst_jitter_psd_config *config, double pixel_rad,
                                      bst_jitter_spectrum *out) {
    double unit = config->unit == 0 ? pixel_rad : BST_ARCSEC_RAD;
    memset(out, 0, sizeof *out);
    out->flat = *flat;
    out->y_scale = config->y_scale;
    BST_TRY(load_table(ctx, "low", &config->low, config->low_file, unit * unit, &out->low));
    bst_status status =
        load_table(ctx, "high", &config->high, config->high_file, unit * unit, &out->high);
    if (status != BST_OK) {
        bst_jitter_spectrum_free(out);
        return status;
    }
    const bst_jitter_line_config *lines = config->lines.items;
    for (int i = 0; i < config->lines.count; i++) {
        const bst_jitter_line_config *l = &lines[i];
        double turns = l->phase_deg / 360.0;
        for (int axis = 0; axis < 2; axis++) {
            if (l->axis == axis || l->axis == 2) {
                out->line[out->line_count++] = (bst_jitter_line){
                    .axis = axis,
                    .frequency_hz = l->frequency_hz,
                    .amplitude_rad = l->amplitude * unit,
                    .phase_cycles = l->random_phase ? -1.0 : turns - floor(turns)};
            }
        }
    }
    return BST_OK;
}

void bst_jitter_spectrum_free(bst_jitter_spectrum *s) {
    free((void *)(uintptr_t)s->low.points);
    free((void *)(uintptr_t)s->high.points);
    s->low = s->high = (bst_jitter_density){NULL, 0};
}

bool bst_jitter_spectrum_is_more(const bst_jitter_spectrum *s) {
    return s->low.count > 0 || s->high.count > 0 || s->line_count > 0;
}

/* Variance of a flat band of given radial RMS between low and high, one axis. */
static double flat_integral(double rms, double min_hz, double max_hz, double low, double high) {
    double width = fmin(high, max_hz) - fmax(low, min_hz);
    return max_hz > min_hz && width > 0.0 ? 0.5 * rms * rms * width / (max_hz - min_hz) : 0.0;
}

double bst_jitter_spectrum_at(const bst_jitter_spectrum *s, int axis, double f) {
    const bst_jitter_spec *flat = &s->flat;
    double sum = (axis == 1 ? s->y_scale : 1.0) *
                 (bst_jitter_density_at(&s->low, f) + bst_jitter_density_at(&s->high, f));
    if (f <= flat->low_cutoff_hz && flat->low_cutoff_hz > 0.0) {
        sum += 0.5 * flat->low_rms_rad * flat->low_rms_rad / flat->low_cutoff_hz;
    }
    double width = flat->high_max_hz - flat->high_min_hz;
    if (f >= flat->high_min_hz && f <= flat->high_max_hz && width > 0.0) {
        sum += 0.5 * flat->high_rms_rad * flat->high_rms_rad / width;
    }
    return sum;
}

double bst_jitter_spectrum_variance(const bst_jitter_spectrum *s, int axis, double low_hz,
                                    double high_hz) {
    const bst_jitter_spec *flat = &s->flat;
    double sum =
        flat_integral(flat->low_rms_rad, 0.0, flat->low_cutoff_hz, low_hz, high_hz) +
        flat_integral(flat->high_rms_rad, flat->high_min_hz, flat->high_max_hz, low_hz, high_hz);
    sum +=
        (axis == 1 ? s->y_scale : 1.0) * (bst_jitter_density_integral(&s->low, low_hz, high_hz) +
                                          bst_jitter_density_integral(&s->high, low_hz, high_hz));
    for (int i = 0; i < s->line_count; i++) {
        const bst_jitter_line *l = &s->line[i];
        if (l->axis == axis && l->frequency_hz >= low_hz && l->frequency_hz <= high_hz) {
            sum += 0.5 * l->amplitude_rad * l->amplitude_rad;
        }
    }
    return sum;
}

/* Unresolved variance of a table about x: share (1 - cos(2 pi f dt)) / 3 up to the highest resolved
 * frequency, all beyond; integrated in narrow strips. */
static double unresolved_variance(const bst_jitter_density *density, double dt_s) {
    enum { STRIPS = 4096 };
    double top = fmin(BST_JITTER_RESOLVED / dt_s, bst_jitter_density_top_hz(density)), sum = 0.0;
    for (int i = 0; i < STRIPS; i++) {
        double low = top * i / STRIPS, high = top * (i + 1) / STRIPS;
        double share = (1.0 - cos(BST_PI * (low + high) * dt_s)) / 3.0;
        sum += share * bst_jitter_density_integral(density, low, high);
    }
    return sum + bst_jitter_density_integral(density, top, INFINITY);
}

double bst_jitter_spectrum_unresolved_rad2(const bst_jitter_spectrum *s, double dt_s) {
    double sum = (1.0 + s->y_scale) *
                 (unresolved_variance(&s->low, dt_s) + unresolved_variance(&s->high, dt_s));
    for (int i = 0; i < s->line_count; i++) {
        double f = s->line[i].frequency_hz, a = s->line[i].amplitude_rad;
        double share =
            f > BST_JITTER_RESOLVED / dt_s ? 1.0 : (1.0 - cos(2.0 * BST_PI * f * dt_s)) / 3.0;
        sum += share * 0.5 * a * a;
    }
    return 0.5 * sum;
}

bst_status bst_jitter_add(bst_ctx *ctx, bst_jitter *jitter, const bst_jitter_spectrum *spectrum,
                          bst_rng_key key) {
    if (!bst_jitter_spectrum_is_more(spectrum)) {
        return BST_OK;
    }
    bst_jitter_more *more = calloc(1, sizeof *more);
    if (!more) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for jitter");
    }
    double dt_s = jitter->dt_s, top = BST_JITTER_RESOLVED / dt_s;
    const bst_jitter_density *tables[2] = {&spectrum->low, &spectrum->high};
    for (int t = 0; t < 2; t++) {
        more->has_noise[t] = tables[t]->count > 0;
        /* independent streams from one key: the same counters under another key */
        bst_rng_key own = {{key.k[0] ^ (0x9E3779B9u * (uint32_t)(t + 1)), key.k[1]}};
        bst_jitter_noise_init(&more->noise[t], tables[t], top, dt_s, own);
    }
    more->y_factor = sqrt(spectrum->y_scale);
    more->index = -1;
    for (int i = 0; i < spectrum->line_count; i++) {
        bst_jitter_line l = spectrum->line[i];
        if (l.frequency_hz > top) {
            continue;
        }
        if (l.phase_cycles < 0.0) {
            l.phase_cycles = bst_rng_uniform(key, (uint64_t)i, 0);
        }
        more->turn_re[more->lines] = cos(2.0 * BST_PI * l.frequency_hz * dt_s);
        more->turn_im[more->lines] = sin(2.0 * BST_PI * l.frequency_hz * dt_s);
        more->line[more->lines++] = l;
    }
    jitter->more = more;
    return BST_OK;
}

void bst_jitter_free(bst_jitter *jitter) {
    free(jitter->more);
    jitter->more = NULL;
}

/* Rotation steps between evaluations of the exact phase. */
#define RESYNC_STEPS 256

static void lines_at(bst_jitter_more *m, int64_t n, double dt_s, double out[2]) {
    int64_t block = n - n % RESYNC_STEPS;
    if (m->index < block || m->index > n) {
        double t = (double)block * dt_s;
        for (int i = 0; i < m->lines; i++) {
            double cycles = m->line[i].frequency_hz * t;
            double phase = 2.0 * BST_PI * (cycles - floor(cycles) + m->line[i].phase_cycles);
            m->re[i] = m->line[i].amplitude_rad * cos(phase);
            m->im[i] = m->line[i].amplitude_rad * sin(phase);
        }
        m->index = block;
    }
    for (; m->index < n; m->index++) {
        for (int i = 0; i < m->lines; i++) {
            double re = m->re[i] * m->turn_re[i] - m->im[i] * m->turn_im[i];
            m->im[i] = m->re[i] * m->turn_im[i] + m->im[i] * m->turn_re[i];
            m->re[i] = re;
        }
    }
    for (int i = 0; i < m->lines; i++) {
        out[m->line[i].axis] += m->im[i];
    }
}

void bst_jitter_more_at(bst_jitter_more *m, int64_t n, double dt_s, double out[2]) {
    for (int t = 0; t < 2; t++) {
        if (m->has_noise[t]) {
            double v[2];
            bst_jitter_noise_at(&m->noise[t], n, v);
            out[0] += v[0];
            out[1] += m->y_factor * v[1];
        }
    }
    if (m->lines > 0) {
        lines_at(m, n, dt_s, out);
    }
}
