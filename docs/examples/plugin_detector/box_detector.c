/* A detector of one's own as a plug-in: sums of 3 x 3 pixels above a threshold, their centroids.
 * `boresight pd` measures it against theory, and a loop runs with it, where a scenario names its
 * type:
 *
 *   cc -shared -fPIC box_detector.c $(pkg-config --cflags --libs boresight) -lm -o box_detector.so
 *   boresight --plugin ./box_detector.so pd scenarios/detection.json --snr 4:16:1 --trials 500 \
 *     --set /observers/0/sensors/0/modules/imgproc='{"type": "box", "threshold_sigma": 5}'
 */
#include <math.h>
#include <stdlib.h>

#include "sim/core/module.h"
#include "sim/world/camera.h"
#include "sim/world/knowledge.h"

enum { PORT_FRAME, PORT_DETECTIONS, CAPACITY = 4096, SAMPLE = 4096 };

/* What the scenario may set: `boresight schema` and `check` know it from this table. */
typedef struct box_config {
    double threshold_sigma;
} box_config;

static const bst_config_desc config_table[] = {
    BST_REAL(box_config, threshold_sigma, "", 1, 100, "5", "Sums above so many of their sigmas."),
    BST_CONFIG_END,
};

static const bst_port ports[] = {
    {BST_CHANNEL_FRAME, BST_PORT_IN, BST_PORT_TRIGGER, 0.0, 0},
    {BST_CHANNEL_DETECTIONS, BST_PORT_OUT, 0, 0.0, CAPACITY},
};

typedef struct box {
    double threshold_sigma, gain_e_per_dn, flux_e_per_s_v0, tick_rate_hz;
    double sample[SAMPLE];
} box;

static bst_status create(const bst_module_env *env, const void *config, void **self) {
    const box_config *c = config;
    const bst_camera *camera = bst_knowledge_camera(env->knowledge);
    box *b = calloc(1, sizeof *b);
    *self = b;
    if (!b) {
        return bst_fail(env->ctx, BST_ERR_MEMORY, "no memory for the box detector");
    }
    b->threshold_sigma = c->threshold_sigma;
    b->gain_e_per_dn = camera->gain_e_per_dn;
    b->flux_e_per_s_v0 = bst_camera_electrons_per_s(camera, 0.0);
    b->tick_rate_hz = (double)env->tick_rate_hz;
    return BST_OK;
}

static void destroy(void *self) {
    free(self);
}

static int ascending(const void *a, const void *b) {
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* Median and standard deviation of the frame, the latter from the lower half, which has no stars.
 */
static void background(box *b, const uint16_t *pixels, int count, double *level, double *sigma) {
    int step = count / SAMPLE > 0 ? count / SAMPLE : 1, n = 0;
    for (int i = 0; i < count && n < SAMPLE; i += step) {
        b->sample[n++] = pixels[i];
    }
    qsort(b->sample, (size_t)n, sizeof b->sample[0], ascending);
    *level = b->sample[n / 2];
    *sigma = fmax(*level - b->sample[(int)(0.158655 * n)], 0.3);
}

static double sum_at(const uint16_t *p, int width, double level) {
    double sum = -9.0 * level;
    for (int j = -1; j <= 1; j++) {
        for (int i = -1; i <= 1; i++) {
            sum += p[j * width + i];
        }
    }
    return sum;
}

static bool is_top(const uint16_t *p, int width, double level, double sum) {
    for (int j = -1; j <= 1; j++) {
        for (int i = -1; i <= 1; i++) {
            double other = i || j ? sum_at(p + j * width + i, width, level) : sum;
            if (other > sum || (other == sum && (j < 0 || (j == 0 && i < 0)))) {
                return false;
            }
        }
    }
    return true;
}

static bst_detection measure(const box *b, const bst_frame_message *m, const uint16_t *p, int x,
                             int y, double level, double sigma, double sum) {
    int width = m->window.width;
    double mx = 0.0, my = 0.0, noise = 3.0 * sigma;
    for (int j = -1; j <= 1; j++) {
        for (int i = -1; i <= 1; i++) {
            mx += i * (p[j * width + i] - level) / sum;
            my += j * (p[j * width + i] - level) / sum;
        }
    }
    double exposure_s = (double)(m->end_tick - m->start_tick) / b->tick_rate_hz;
    bst_detection d = {.x_px = m->window.x0 + x + mx,
                       .y_px = m->window.y0 + y + my,
                       .flux_e = sum * b->gain_e_per_dn,
                       .flux_sigma_e = noise * b->gain_e_per_dn,
                       .snr = sum / noise,
                       .length_px = 2.0,
                       .width_px = 2.0,
                       .label = BST_LABEL_UNKNOWN};
    /* six pixels a unit away from the middle, each with the noise of one */
    d.cov_xx = d.cov_yy = 6.0 * sigma * sigma / (sum * sum);
    d.v_mag = -2.5 * log10(d.flux_e / (exposure_s * b->flux_e_per_s_v0));
    d.v_mag_sigma = 1.0857 * d.flux_sigma_e / d.flux_e;
    return d;
}

static bst_status step(void *self, struct bst_step *step_) {
    box *b = self;
    bst_sample sample;
    while ((sample = bst_step_next(step_, PORT_FRAME)).payload) {
        const bst_frame_message *m = sample.payload;
        int width = m->window.width, height = m->window.height;
        if (m->binning != 1) {
            return bst_fail(bst_step_ctx(step_), BST_ERR_CONFIG,
                            "the box detector takes frames that are not binned");
        }
        const uint16_t *pixels;
        BST_TRY(bst_frame_map(m->frame, bst_step_ctx(step_), &pixels));
        bst_detections *out = bst_step_write(step_, PORT_DETECTIONS, NULL);
        out->exposure_id = m->exposure_id;
        out->start_tick = m->start_tick;
        out->end_tick = m->end_tick;
        double level, sigma;
        background(b, pixels, width * height, &level, &sigma);
        out->background_e = 0.0;
        out->noise_e = sigma * b->gain_e_per_dn;
        out->threshold_snr = b->threshold_sigma;
        out->count = out->lost = 0;
        for (int y = 2; y < height - 2; y++) {
            for (int x = 2; x < width - 2; x++) {
                const uint16_t *p = pixels + (size_t)y * (size_t)width + (size_t)x;
                double sum = sum_at(p, width, level);
                if (sum > b->threshold_sigma * 3.0 * sigma && is_top(p, width, level, sum)) {
                    if (out->count == CAPACITY) {
                        out->lost++;
                        continue;
                    }
                    out->items[out->count++] = measure(b, m, p, x, y, level, sigma, sum);
                }
            }
        }
        bst_frame_unmap(m->frame);
    }
    return BST_OK;
}

static const bst_module_desc box_module = {
    .abi = BST_MODULE_ABI,
    .role = "imgproc",
    .type = "box",
    .doc = "Sums of 3 x 3 pixels over a threshold.",
    .config = config_table,
    .config_bytes = sizeof(box_config),
    .ports = ports,
    .port_count = sizeof ports / sizeof *ports,
    .create = create,
    .step = step,
    .destroy = destroy,
};

/* What the program looks for. */
extern const bst_module_desc *const bst_plugin_modules[];
const bst_module_desc *const bst_plugin_modules[] = {&box_module, NULL};
