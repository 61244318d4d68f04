/* The module against a real world and the embedded stars, stepped by hand: this file stands in for
 * the engine's side of the step interface. */
#include <stdlib.h>

#include "scenegen/module.h"
#include "sim/device/device.h"
#include "sim/world/world.h"
#include "sim/world/world_config.h"
#include "tests/test_support.h"

enum { RATE = 1000, CAPACITY = 4096, SAMPLES = 600, SIDE = 512 };

struct bst_step {
    bst_ctx *ctx;
    bst_exposure *exposure; /* NULL once read */
    bst_los_history *history;
    bst_frame_message frame;
    bst_truth *truth;
    bool frame_written, truth_written;
    int saturated, overflow, capacity;
};

void bst_env_set_capacity(const bst_module_env *env, int port, int items) {
    struct bst_step *step = env->engine_private;
    assert_int_equal(port, 3);
    step->capacity = items;
    step->truth = calloc(1, sizeof *step->truth + (size_t)items * sizeof *step->truth->items);
}
bst_ctx *bst_step_ctx(struct bst_step *step) {
    return step->ctx;
}
bst_sample bst_step_next(struct bst_step *step, int port) {
    assert_int_equal(port, 0);
    bst_sample sample = {.payload = step->exposure};
    step->exposure = NULL;
    return sample;
}
bst_sample bst_step_latest(struct bst_step *step, int port) {
    assert_int_equal(port, 1);
    return (bst_sample){.payload = step->history};
}
void *bst_step_write(struct bst_step *step, int port, int *capacity) {
    if (port == 2) {
        step->frame_written = true;
        return &step->frame;
    }
    step->truth_written = true;
    *capacity = step->capacity;
    return step->truth;
}
void bst_step_count(struct bst_step *step, const char *what) {
    step->saturated += strcmp(what, "saturated") == 0;
    step->overflow += strcmp(what, "truth_overflow") == 0;
}

/* A world with one observer in an orbit like NEOSSat's and the default detector. */
static bst_world *make_world(bst_ctx *ctx) {
    bst_observer_config observer = {.name = "obs"};
    bst_sensor_config sensor = {0};
    bst_world_config world = {0};
    bst_json *json;
    const char text[] =
        "{\"name\": \"cam\", \"camera\": {\"width_px\": 512, \"height_px\": 512, "
        "\"pixel_scale_arcsec\": 12, \"aperture_m\": 0.15, \"full_well_e\": 1e6}}";
    bst_assert_ok(ctx, bst_json_parse(ctx, "test", text, sizeof text - 1, &json));
    bst_assert_ok(
        ctx, bst_config_read(ctx, json, bst_json_root(json), "", bst_sensor_config_table, &sensor));
    bst_json_free(json);
    bst_assert_ok(ctx, bst_config_defaults(ctx, bst_world_config_table, &world));
    snprintf(world.star_catalogue, sizeof world.star_catalogue, "embedded");
    snprintf(observer.orbit.elements_file, sizeof observer.orbit.elements_file, "observer.tle");
    observer.orbit.norad = 39089;
    observer.sensors = (bst_config_list){&sensor, 1};
    bst_config_list observers = {&observer, 1};
    bst_time epoch;
    bst_assert_ok(ctx, bst_time_from_utc(ctx, "2022-06-16T22:10:00Z", &epoch));
    bst_world *out;
    bst_assert_ok(
        ctx, bst_world_create(ctx, "test", &world, &observers, "tests/scenegen/data", epoch, &out));
    bst_config_free(bst_world_config_table, &world);
    bst_config_free(bst_sensor_config_table, &sensor);
    return out;
}

static bst_los_history *make_history(void) {
    bst_los_history *h = calloc(1, sizeof *h + SAMPLES * sizeof *h->items);
    double ra = 56.75 * BST_DEG_RAD, dec = 24.12 * BST_DEG_RAD; /* the Pleiades */
    bst_vec3 boresight = {cos(dec) * cos(ra), cos(dec) * sin(ra), sin(dec)};
    bst_quat q0 = bst_quat_look(boresight, (bst_vec3){0, 0, 1});
    h->capacity = SAMPLES;
    h->written = SAMPLES;
    for (int k = 0; k < SAMPLES; k++) {
        /* 10 px in half a second */
        bst_vec3 turn = {0.0, 20.0 * 12.0 * BST_ARCSEC_RAD * k / RATE, 0.0};
        h->items[k] = (bst_los_sample){k, bst_quat_mul(bst_quat_from_rotvec(turn), q0)};
    }
    return h;
}

/* Integral of the squared image of a straight streak, see docs/explanation/equations/image.md. */
static double peak_term(double sigma, double length) {
    double a = 0.5 * length / sigma;
    return (erf(a) / length -
            2.0 * sigma * (1.0 - exp(-a * a)) / (sqrt(BST_PI) * length * length)) /
           (2.0 * sqrt(BST_PI) * sigma);
}

/* Centroid of the light about (x, y), background taken off. */
static void centroid(const uint16_t *p, double x, double y, double background, double *cx,
                     double *cy, double *sum) {
    double sx = 0, sy = 0, s = 0;
    for (int j = (int)y - 8; j <= (int)y + 8; j++) {
        for (int i = (int)x - 14; i <= (int)x + 14; i++) {
            double v = p[j * SIDE + i] - background;
            s += v;
            sx += v * i;
            sy += v * j;
        }
    }
    *cx = sx / s;
    *cy = sy / s;
    *sum = s;
}

static void frames_show_what_truth_says(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_device *device;
    bst_assert_ok(&ctx, bst_device_open(&ctx, "", 0, &device));
    bst_world *world = make_world(&ctx);
    struct bst_step step = {.ctx = &ctx, .history = make_history()};
    bst_module_env env = {.ctx = &ctx,
                          .instance = "obs/cam/scenegen",
                          .tick_rate_hz = RATE,
                          .seed = 1,
                          .world = world,
                          .device = device,
                          .engine_private = &step};
    const bst_module_desc *d = &bst_scenegen_module;
    void *config = calloc(1, d->config_bytes), *self;
    bst_assert_ok(&ctx, bst_config_defaults(&ctx, d->config, config));
    bst_assert_ok(&ctx, d->create(&env, config, &self));
    assert_int_equal(step.capacity, CAPACITY);
    bst_exposure exposure = {
        .id = 7, .start_tick = 50, .end_tick = 550, .window = {0, 0, SIDE, SIDE}, .binning = 1};
    step.exposure = &exposure;
    bst_assert_ok(&ctx, d->step(self, &step));
    assert_true(step.truth_written && step.frame_written);
    assert_true(step.truth->count > 20); /* V < 9 alone has some thirty in 1.7 degrees there */
    assert_int_equal(step.truth->exposure_id, 7);
    assert_int_equal(step.frame.exposure_id, 7);
    const uint16_t *pixels;
    bst_assert_ok(&ctx, bst_frame_map(step.frame.frame, &ctx, &pixels));
    const bst_camera *camera = bst_world_camera(world, 0, 0);
    double background =
        camera->offset_dn + (step.truth->background_e + step.truth->dark_e) / camera->gain_e_per_dn;
    int checked = 0;
    for (int i = 0; i < step.truth->count; i++) {
        const bst_truth_item *a = &step.truth->items[i];
        bool alone = (a->flags & BST_TRUTH_SATURATED) == 0 && a->snr > 300.0 &&
                     a->x_chief_px > 40 && a->x_chief_px < SIDE - 40 && a->y_chief_px > 40 &&
                     a->y_chief_px < SIDE - 40;
        for (int j = 0; j < step.truth->count && alone; j++) {
            const bst_truth_item *b = &step.truth->items[j];
            alone =
                i == j || hypot(a->x_chief_px - b->x_chief_px, a->y_chief_px - b->y_chief_px) > 35;
        }
        if (!alone) {
            continue;
        }
        double x, y, sum;
        centroid(pixels, a->x_chief_px, a->y_chief_px, background, &x, &y, &sum);
        /* noise of 493 pixels over the flux, times the box's spread of 8 px: < 0.03 at SNR 300 */
        bst_assert_close(x, a->x_chief_px, 0.15);
        bst_assert_close(y, a->y_chief_px, 0.15);
        double noise = sqrt(493.0 * (64.0 + step.truth->background_e) + a->electrons);
        bst_assert_close(sum * camera->gain_e_per_dn, a->electrons, 5.0 * noise); /* 5 sigma */
        bst_assert_close(fabs(a->x_end_px - a->x_start_px), 10.0, 0.1); /* the slew, 1 % of tan */
        checked++;
    }
    assert_true(checked >= 5);
    bst_frame_unmap(step.frame.frame);
    bst_frame_release(step.frame.frame);

    /* a dropped exposure: the same truth, no frame */
    int count = step.truth->count;
    bst_truth_item *items = malloc((size_t)count * sizeof *items);
    memcpy(items, step.truth->items, (size_t)count * sizeof *items);
    step.frame_written = step.truth_written = false;
    exposure.dropped = true;
    step.exposure = &exposure;
    bst_assert_ok(&ctx, d->step(self, &step));
    assert_true(step.truth_written && !step.frame_written && step.truth->dropped);
    assert_int_equal(step.truth->count, count);
    assert_memory_equal(step.truth->items, items, (size_t)count * sizeof *items);

    /* jitter too fast for the samples: the same places and light, less SNR, as of a wider streak */
    step.history->jitter_rad2 = pow(1.5 * 12.0 * BST_ARCSEC_RAD, 2);
    step.exposure = &exposure;
    bst_assert_ok(&ctx, d->step(self, &step));
    assert_int_equal(step.truth->count, count);
    double psf = bst_camera_psf_sigma_px(camera);
    double sharp = peak_term(sqrt(psf * psf + 1.0 / 12.0), 10.0);
    double blurred = peak_term(sqrt(psf * psf + 1.5 * 1.5 + 1.0 / 12.0), 10.0);
    for (int i = 0; i < count; i++) {
        assert_true(step.truth->items[i].electrons == items[i].electrons);
        assert_true(step.truth->items[i].x_chief_px == items[i].x_chief_px);
        if (items[i].snr > 0.0) { /* the streak is 10 px within 1 %, its bend some 1e-3 px */
            bst_assert_close(step.truth->items[i].snr / items[i].snr, sqrt(blurred / sharp), 2e-3);
        }
    }
    step.history->jitter_rad2 = 0.0;

    /* with less room, the brightest are kept, in the same order, and the rest is counted */
    enum { ROOM = 25 };
    assert_true(count > 2 * ROOM);
    step.capacity = ROOM;
    step.overflow = 0;
    step.exposure = &exposure;
    bst_assert_ok(&ctx, d->step(self, &step));
    assert_int_equal(step.truth->count, ROOM);
    assert_int_equal(step.truth->lost, count - ROOM);
    assert_int_equal(step.overflow, 1);
    int kept = 0;
    double faintest_kept = 0.0, brightest_lost = INFINITY;
    for (int i = 0; i < count; i++) {
        if (kept < ROOM && memcmp(&step.truth->items[kept], &items[i], sizeof *items) == 0) {
            faintest_kept = fmax(faintest_kept, items[i].v_mag);
            kept++;
        } else {
            brightest_lost = fmin(brightest_lost, items[i].v_mag);
        }
    }
    assert_int_equal(kept, ROOM);
    assert_true(faintest_kept <= brightest_lost);
    step.capacity = CAPACITY;
    free(items);

    /* binned frames are smaller; an exposure that the ring does not hold is refused */
    exposure.binning = 2;
    exposure.dropped = false;
    step.exposure = &exposure;
    bst_assert_ok(&ctx, d->step(self, &step));
    assert_int_equal(step.frame.binning, 2);
    assert_int_equal(step.frame.frame->width, exposure.window.width / 2);
    assert_int_equal(step.frame.frame->height, exposure.window.height / 2);
    bst_frame_release(step.frame.frame);
    exposure.binning = 1;
    exposure.end_tick = 5000;
    step.exposure = &exposure;
    assert_int_equal(d->step(self, &step), BST_ERR_STATE);
    d->destroy(self);
    bst_world_free(world);
    bst_device_close(device);
    free(config);
    free(step.history);
    free(step.truth);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(frames_show_what_truth_says),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
