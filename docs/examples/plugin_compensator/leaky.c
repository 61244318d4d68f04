/* A compensator of one's own on the image error of the pointing loop: proportional, with an
 * integrator that forgets.
 *
 *   cc -shared -fPIC leaky.c $(pkg-config --cflags --libs boresight) -o leaky.so
 *
 * and in a scenario, beside it:
 *
 *   "control": {"type": "standard", "compensator": {"plugin": "leaky.so", "gain_per_s": 0.4}}
 */
#include <boresight/stages.h>

/* 1. What a scenario may set. */
typedef struct config {
    double gain_per_s, integral_per_s2, memory_s;
} config;
static const bst_config_desc table[] = {
    BST_REAL(config, gain_per_s, "1/s", 0, 100, "0.4", "Rate of the correction per error."),
    BST_REAL(config, integral_per_s2, "1/s^2", 0, 100, "0.04", "The same of the error's integral."),
    BST_REAL(config, memory_s, "s", 0.1, 1e6, "1000", "Time in which the integral is forgotten."),
    BST_CONFIG_END};

/* 2. Its state, of one axis: plain data, which is copied. */
typedef struct state {
    double dt_s, kp, ki, keep, integral;
} state;

static bst_status init(bst_ctx *ctx, const void *config_, double dt_s, void *self) {
    const config *c = config_;
    state *s = self;
    if (c->gain_per_s * dt_s > 2.0) {
        return bst_fail(
            ctx, BST_ERR_CONFIG,
            "gain_per_s: %g/s cannot be stable at a frame every %g s; give less than %g",
            c->gain_per_s, dt_s, 2.0 / dt_s);
    }
    *s = (state){dt_s, c->gain_per_s, c->integral_per_s2, 1.0 / (1.0 + dt_s / c->memory_s), 0.0};
    return BST_OK;
}

/* 3. What it does with each error: rad in, rad/s out. */
static double step(void *self, double error) {
    state *s = self;
    s->integral = s->keep * s->integral + s->dt_s * error;
    return s->kp * error + s->ki * s->integral;
}

/* After a transfer the next output shall be `output` for this error. */
static void set(void *self, double error, double output) {
    state *s = self;
    s->integral = s->ki > 0.0 ? (output - s->kp * error) / s->ki : 0.0;
}

/* As it is linear, `boresight loop` can tell margins: its response at omega rad per sample. */
static double complex response(const void *self, double omega) {
    const state *s = self;
    return s->kp + s->ki * s->dt_s / (1.0 - s->keep * cexp(-I * omega));
}

/* A saved simulation contains what the steps change. */
static bst_status archive_state(void *self, bst_archive *archive) {
    state *s = self;
    BST_ARCHIVE(archive, s->integral);
    return BST_OK;
}

/* 4. What the program looks for. */
static const bst_compensator_stage functions = {sizeof(state), init,     step,
                                                set,           response, archive_state};
static const bst_stage_desc stage = {
    BST_STAGE_ABI, BST_STAGE_COMPENSATOR,
    "leaky",       "Proportional, with an integrator that forgets.",
    table,         sizeof(config),
    &functions};
extern const bst_stage_desc *const bst_plugin_stages[];
const bst_stage_desc *const bst_plugin_stages[] = {&stage, NULL};
