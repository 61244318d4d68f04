/* A detector of one's own: sums of 3 x 3 pixels above a threshold, and their centroids.
 *
 *   cc -shared -fPIC box_detector.c $(pkg-config --cflags --libs boresight) -lm -o box_detector.so
 *
 * and in a scenario, beside it:
 *
 *   "imgproc": {"type": "standard", "detector": {"plugin": "box_detector.so"}}
 */
#include <math.h>
#include <stdlib.h>

#include <boresight/stages.h>

/* 1. What a scenario may set: errors and `boresight schema` know it from this table. */
typedef struct config {
    double threshold_sigma;
} config;
static const bst_config_desc table[] = {
    BST_REAL(config, threshold_sigma, "", 1, 100, "5", "Sums above so many of their sigmas."),
    BST_CONFIG_END};

/* 2. What it remembers. */
enum { SAMPLE = 4096 };
typedef struct box {
    double threshold, gain_e_per_dn, sample[SAMPLE];
    int capacity;
} box;

static bst_status create(bst_ctx *ctx, const void *c, const bst_detector_env *env, void **self) {
    box *b = *self = calloc(1, sizeof *b);
    if (!b) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the box detector");
    }
    b->threshold = ((const config *)c)->threshold_sigma;
    b->gain_e_per_dn = env->camera->gain_e_per_dn;
    b->capacity = env->capacity;
    return BST_OK;
}

static int ascending(const void *a, const void *b) {
    return (*(const double *)a > *(const double *)b) - (*(const double *)a < *(const double *)b);
}

static double sum_at(const uint16_t *p, int w, double level) {
    return p[-w - 1] + p[-w] + p[-w + 1] + p[-1] + p[0] + p[1] + p[w - 1] + p[w] + p[w + 1] -
           9.0 * level;
}

/* 3. What it does with a frame. */
static bst_status detect(void *self, bst_ctx *ctx, const bst_detector_frame *f,
                         bst_detections *out) {
    box *b = self;
    (void)ctx; /* for bst_fail */
    int width = f->window.width / f->binning, height = f->window.height / f->binning;
    for (int i = 0; i < SAMPLE; i++) {
        b->sample[i] = f->pixels[(size_t)i * (size_t)(width * height - 1) / (SAMPLE - 1)];
    }
    qsort(b->sample, SAMPLE, sizeof *b->sample, ascending);
    double level = b->sample[SAMPLE / 2]; /* sigma: from the lower half, which has no stars */
    double sigma = fmax(level - b->sample[(int)(0.158655 * SAMPLE)], 0.3), gain = b->gain_e_per_dn;
    out->noise_e = sigma * gain;
    out->threshold_snr = b->threshold;
    for (int y = 2; y < height - 2; y++) {
        for (int x = 2; x < width - 2; x++) {
            const uint16_t *p = f->pixels + (size_t)y * (size_t)width + (size_t)x;
            double sum = sum_at(p, width, level), mx = 0.0, my = 0.0, s = f->binning;
            bool top = sum > 3.0 * b->threshold * sigma; /* and no neighbour's is greater */
            for (int k = 0; k < 9 && top; k++) {
                int i = k % 3 - 1, j = k / 3 - 1;
                double other = sum_at(p + j * width + i, width, level);
                top = k == 4 || other < sum || (other == sum && k > 4);
                mx += i * (p[j * width + i] - level) / sum;
                my += j * (p[j * width + i] - level) / sum;
            }
            if (top && out->count == b->capacity) {
                out->lost++;
            } else if (top) {
                bst_detection *d = &out->items[out->count++];
                *d = (bst_detection){.length_px = 2.0 * s, .width_px = 2.0 * s};
                d->x_px = f->window.x0 + s * (x + mx + 0.5) - 0.5;
                d->y_px = f->window.y0 + s * (y + my + 0.5) - 0.5;
                d->cov_xx = d->cov_yy = 6.0 * pow(s * sigma / sum, 2.0); /* six pixels a unit off */
                d->flux_e = sum * gain;
                d->flux_sigma_e = 3.0 * sigma * gain;
                d->snr = d->flux_e / d->flux_sigma_e;
            }
        }
    }
    return BST_OK;
}

/* What a saved simulation contains of it: nothing, as no frame depends on earlier ones. */
static bst_status archive(void *self, bst_archive *saved) {
    return (void)self, (void)saved, BST_OK;
}

/* 4. What the program looks for. */
static const bst_detector_stage functions = {create, detect, free, archive};
static const bst_stage_desc stage = {
    BST_STAGE_ABI, BST_STAGE_DETECTOR, "box",     "Sums of 3 x 3 pixels over a threshold.",
    table,         sizeof(config),     &functions};
extern const bst_stage_desc *const bst_plugin_stages[];
const bst_stage_desc *const bst_plugin_stages[] = {&stage, NULL};
