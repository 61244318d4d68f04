/* A stage of the renderer of one's own: rows that share an error, as read-out electronics picks it
 * up from a supply.
 *
 *   cc -shared -fPIC banding.c $(pkg-config --cflags --libs boresight) -lm -o banding.so
 *
 * and in a scenario, beside it:
 *
 *   "scenegen": {"type": "opencl", "frame_stage": {"plugin": "banding.so", "amplitude_dn": 3}}
 */
#include <math.h>
#include <stdlib.h>

#include <boresight/rng.h>
#include <boresight/stages.h>

/* 1. What a scenario may set. */
typedef struct config {
    double amplitude_dn, period_rows;
} config;
static const bst_config_desc table[] = {
    BST_REAL(config, amplitude_dn, "DN", 0, 1000, "2", "Amplitude of the wave."),
    BST_REAL(config, period_rows, "px", 2, 10000, "37.3", "Its period."), BST_CONFIG_END};

/* 2. What it remembers. */
typedef struct banding {
    config c;
    bst_rng_key key;
} banding;

static bst_status create(bst_ctx *ctx, const void *c, const bst_frame_stage_env *env, void **self) {
    banding *b = *self = calloc(1, sizeof *b);
    if (!b) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for banding");
    }
    b->c = *(const config *)c;
    /* random numbers by what they are for, so that a run can be repeated */
    b->key = bst_rng_make_key(env->seed, env->run, env->instance, "banding");
    return BST_OK;
}

/* 3. What it does with a frame: each has a phase of its own. */
static bst_status apply(void *self, bst_ctx *ctx, const bst_frame_stage_frame *f,
                        uint16_t *pixels) {
    const banding *b = self;
    (void)ctx;
    double top = (double)((1 << f->bits) - 1);
    double phase = 6.283185307 * bst_rng_uniform(b->key, (uint64_t)f->exposure_id, 0);
    for (int y = 0; y < f->height; y++) {
        double wave = b->c.amplitude_dn * sin(6.283185307 * y / b->c.period_rows + phase);
        for (int x = 0; x < f->width; x++) {
            uint16_t *p = &pixels[(size_t)y * (size_t)f->width + (size_t)x];
            *p = (uint16_t)fmin(fmax(floor(*p + wave + 0.5), 0.0), top);
        }
    }
    return BST_OK;
}

/* What a saved simulation contains of it: nothing, as no frame depends on earlier ones. */
static bst_status archive(void *self, bst_archive *saved) {
    return (void)self, (void)saved, BST_OK;
}

/* 4. What the program looks for. */
static const bst_frame_stage functions = {create, apply, free, archive};
static const bst_stage_desc stage = {
    BST_STAGE_ABI, BST_STAGE_FRAME, "banding", "Rows that share an error.",
    table,         sizeof(config),  &functions};
extern const bst_stage_desc *const bst_plugin_stages[];
const bst_stage_desc *const bst_plugin_stages[] = {&stage, NULL};
