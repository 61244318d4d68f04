/* The module "obsgen" between its messages: what it hands to the generator and the identification
 * of stars, and what it publishes, in a binned window off the corner of a sensor that is no square.
 * Linked with wraps of the engine's messages, the world and the generator. */
#include "boresight/camera_motion.h"
#include "obsgen/lost_attitude.h"
#include "obsgen/obsgen.h"
#include "obsgen/pending_exposure.h"
#include "sim/onboard/knowledge.h"
#include "sim/optics/psf.h"
#include "sim/world/scene/field.h"
#include "sim/world/scene/truth_list.h"
#include "tests/test_support.h"

enum { RATE = 1000, NODES = 9, STARS = 12, ITEMS = STARS + 1, START = 5000, END = 5800 };
#define SCALE (6.0 * BST_PI / 648000.0)

static struct {
    bst_ctx ctx;
    bst_camera camera;
    bst_exposure exposure;
    bool exposed, processed, telemetry_stale, predicted;
    bst_predictions predictions;
    bst_pointing_telemetry *pointing;
    double time_s[NODES];
    bst_quat q[NODES];
    bst_truth *truth;
    bst_detections *detections;
    bst_generator_frame frame;
    bst_obsgen_generated items[ITEMS];
    double threshold;
    bst_identify_options options;
    bool identified;
    char counted[64];
    const struct bst_psf *psf; /* on board */
    bst_response response;
    bst_crlb_table image_bound, onboard_bound;
} m;

static const bst_quat q0 = {0.3 / 0.93273790530888, -0.5 / 0.93273790530888, 0.2 / 0.93273790530888,
                            0.7 / 0.93273790530888};
/* Turn of the camera, rad/s: about its x, y and z. */
static const bst_vec3 turn = {-6e-4, 9e-4, 2e-3};

static bst_quat attitude(double seconds) {
    return bst_quat_mul(bst_quat_from_rotvec(bst_vec3_scale(turn, seconds)), q0);
}

#define WRAP(type, name, arguments) \
    type __wrap_##name arguments;   \
    type __wrap_##name arguments

WRAP(const bst_camera *, bst_world_camera, (const bst_world *world, int observer, int sensor)) {
    (void)world;
    (void)observer;
    (void)sensor;
    return &m.camera;
}

WRAP(const bst_stars *, bst_world_stars, (const bst_world *world)) {
    (void)world;
    return NULL;
}

WRAP(const bst_camera *, bst_knowledge_camera, (const bst_knowledge *knowledge)) {
    (void)knowledge;
    return &m.camera;
}

WRAP(const struct bst_psf *, bst_knowledge_psf, (const bst_knowledge *knowledge)) {
    (void)knowledge;
    return m.psf;
}

WRAP(const bst_stars *, bst_knowledge_stars, (const bst_knowledge *knowledge)) {
    (void)knowledge;
    return NULL;
}

WRAP(double, bst_knowledge_julian_year, (const bst_knowledge *knowledge)) {
    (void)knowledge;
    return 2024.5;
}

WRAP(void, bst_env_set_capacity, (const bst_module_env *env, int port, int items)) {
    (void)env;
    (void)port;
    (void)items;
}

WRAP(bst_status, bst_field_create,
     (bst_ctx * ctx, const bst_world *world, int observer, int sensor, bst_field **out)) {
    (void)ctx;
    (void)world;
    (void)observer;
    (void)sensor;
    *out = NULL;
    return BST_OK;
}

WRAP(void, bst_field_set_camera, (bst_field * field, const bst_camera *camera)) {
    (void)field;
    (void)camera;
}

WRAP(void, bst_field_set_background_places_only, (bst_field * field)) {
    assert_null(field);
}

WRAP(bst_status, bst_field_track,
     (bst_ctx * ctx, bst_field *field, const bst_los_history *history, int64_t start_tick,
      int64_t end_tick, int64_t tick_rate_hz, bst_los_track *out)) {
    (void)ctx;
    (void)field;
    (void)history;
    assert_int_equal(tick_rate_hz, RATE);
    for (int i = 0; i < NODES; i++) { /* even, in seconds after the start */
        m.time_s[i] = (double)(end_tick - start_tick) / RATE * i / (NODES - 1);
        m.q[i] = attitude((double)start_tick / RATE + m.time_s[i]);
    }
    *out = (bst_los_track){NODES, m.time_s, m.q};
    return BST_OK;
}

WRAP(bst_status, bst_field_query,
     (bst_ctx * ctx, bst_field *field, const bst_los_track *track, int64_t start_tick,
      int64_t end_tick, int64_t tick_rate_hz, bst_window window, const bst_field_options *options,
      bst_truth *truth, const bst_scene_source **sources, int *count)) {
    (void)ctx;
    (void)field;
    (void)track;
    (void)start_tick;
    (void)end_tick;
    (void)tick_rate_hz;
    assert_int_equal(window.x0, m.exposure.window.x0);
    bst_assert_close(options->v_limit, 13.5, 0.0);
    bst_assert_close(options->margin_px, 8.0, 0.0); /* by the module: more than 6 sigma */
    /* off the onboard attitude of the exposure's middle */
    bst_quat off = bst_quat_from_rotvec((bst_vec3){-4e-4, 3e-4, 5e-3});
    truth->q_cam_from_gcrf_mean = bst_quat_mul(off, attitude(5.4));
    truth->q_cam_from_gcrf_mid = truth->q_cam_from_gcrf_mean;
    truth->pixel_scale_arcsec = 6.0;
    truth->boresight_x_px = truth->boresight_y_px = 1.0;
    truth->lost = truth->count = truth->shape_count = 0;
    bst_assert_close(options->ghost_sigma, 0.05, 0.0); /* as in scenegen by default */
    assert_int_equal(options->binning, m.exposure.binning);
    static bst_scene_source seen[ITEMS];
    seen[ITEMS - 2].ghost = &m.camera.ghost_images->items[1];
    *sources = seen;
    *count = ITEMS;
    return BST_OK;
}

WRAP(bst_status, bst_truth_list_fill,
     (bst_ctx * ctx, bst_truth_list *list, const bst_truth_request *request, bst_truth *truth,
      int capacity, int *source_of)) {
    (void)ctx;
    (void)source_of;
    list->source_of = list->source_of ? list->source_of : calloc(ITEMS, sizeof(int));
    assert_non_null(list->source_of);
    assert_int_equal(request->count, ITEMS);
    assert_int_equal(request->binning, m.exposure.binning);
    /* the brightest pixel of a Gaussian at its middle; the source before the last is a ghost, whose
     * blur widens it */
    const bst_truth_item still = {.electrons = 1000.0};
    const double own = 2.0 / 2.3548200450309493, widths[2] = {own, hypot(own, 1.5)};
    for (int k = 0; k < 2; k++) {
        double share = erf(0.5 / (widths[k] * sqrt(2.0)));
        bst_assert_close(request->peak_e(request->user, ITEMS - 1 - k, &still),
                         1000.0 * share * share, 1e-3);
    }
    assert_true(capacity >= ITEMS);
    truth->count = ITEMS;
    for (int i = 0; i < ITEMS; i++) {
        list->source_of[i] = ITEMS - 1 - i; /* in another order */
        truth->items[i] = (bst_truth_item){.kind = BST_SOURCE_STAR,
                                           .id = (uint32_t)i + 1,
                                           .electrons = 5000.0 + 400.0 * i,
                                           .v_mag = 9.0};
    }
    return BST_OK;
}

WRAP(bst_status, bst_generator_run,
     (bst_ctx * ctx, bst_generator *g, const bst_generator_frame *frame,
      bst_generator_result *out)) {
    (void)ctx;
    (void)g;
    m.frame = *frame;
    if (frame->response) {
        m.response = *frame->response;
        m.image_bound = *frame->image_bound;
        m.onboard_bound = *frame->onboard_bound;
    }
    for (int i = 0; i < ITEMS; i++) { /* the source before the last is the second item */
        assert_int_equal(frame->ghost[i], i == 1 ? 1 : -1);
    }
    for (int i = 0; i < ITEMS; i++) { /* four fifths of the light; the last is of no star */
        double flux = 0.8 * (5000.0 + 400.0 * i);
        m.items[i] =
            (bst_obsgen_generated){.item = i,
                                   .detection = {.x_px = 60.0 + 10.0 * i,
                                                 .y_px = 100.0,
                                                 .cov_xx = 0.01,
                                                 .cov_yy = 0.01,
                                                 .flux_e = flux,
                                                 .flux_sigma_e = 0.01 * flux,
                                                 .snr = 100.0,
                                                 .v_mag = bst_camera_v_mag(&m.camera, flux / 0.8)}};
    }
    *out = (bst_generator_result){.items = m.items,
                                  .count = ITEMS,
                                  .lost = 3,
                                  .background_e = 40.0,
                                  .noise_e = 9.0,
                                  .threshold_snr = 5.5,
                                  .streak_px = 4.0};
    return BST_OK;
}

WRAP(double, bst_generator_v_limit, (const bst_generator *g, double snr)) {
    (void)g;
    bst_assert_close(snr, 0.7 * 5.5, 1e-12);
    return 11.25;
}

WRAP(bst_status, bst_obsgen_lost_identify,
     (bst_obsgen_lost * lost, struct bst_step *step, const bst_identify_options *options,
      const bst_generator_frame *frame, const bst_obsgen_generated *generated,
      bst_detections *detections)) {
    (void)lost;
    (void)step;
    (void)frame;
    (void)generated;
    m.options = *options;
    m.identified = true;
    for (int i = 0; i < STARS; i++) {
        detections->items[i].star_id = (uint32_t)i + 1;
        detections->items[i].label = BST_LABEL_STAR;
        detections->items[i].label_probability = 1.0;
    }
    detections->stars_identified = STARS;
    return BST_OK;
}

WRAP(bst_ctx *, bst_step_ctx, (struct bst_step * step)) {
    (void)step;
    return &m.ctx;
}

WRAP(void, bst_step_count, (struct bst_step * step, const char *what)) {
    (void)step;
    snprintf(m.counted, sizeof m.counted, "%s", what);
}

static const char *channel_of(int port) {
    return bst_obsgen_module.ports[port].channel;
}

WRAP(bst_sample, bst_step_next, (struct bst_step * step, int port)) {
    (void)step;
    bool *read = port == 0 ? &m.exposed : &m.processed;
    bst_sample s = {.payload = *read ? NULL : &m.exposure};
    *read = true;
    return s;
}

WRAP(bst_sample, bst_step_latest, (struct bst_step * step, int port)) {
    static const bst_los_history history = {.jitter_rad2 = 0.0};
    static const bst_nav_telemetry nav = {.position_gcrf_m = {7e6, 0, 0},
                                          .velocity_gcrf_mps = {0, 7500, 0},
                                          .velocity_bary_mps = {0, 7500, 0}};
    (void)step;
    const char *name = channel_of(port);
    if (strcmp(name, BST_CHANNEL_PREDICTIONS) == 0) {
        return (bst_sample){.payload = m.predicted ? &m.predictions : NULL};
    }
    if (strcmp(name, BST_CHANNEL_POINTING_TELEMETRY) == 0) {
        return (bst_sample){.payload = m.pointing, .stale = m.telemetry_stale};
    }
    if (strcmp(name, BST_CHANNEL_NAV_TELEMETRY) == 0) {
        return (bst_sample){.payload = &nav};
    }
    return (bst_sample){.payload = &history}; /* of the line of sight */
}

WRAP(void *, bst_step_write, (struct bst_step * step, int port, int *capacity)) {
    (void)step;
    *capacity = 100;
    return strcmp(channel_of(port), BST_CHANNEL_TRUTH) == 0 ? (void *)m.truth
                                                            : (void *)m.detections;
}

static void set_key(void *config, const char *key, double real, int64_t whole) {
    for (const bst_config_desc *d = bst_obsgen_module.config; d->key; d++) {
        if (strcmp(d->key, key) == 0) {
            memcpy((char *)config + d->offset, d->type == BST_CONFIG_REAL ? (void *)&real : &whole,
                   8);
            return;
        }
    }
    fail_msg("there is no key %s", key);
}

typedef struct filters {
    bst_response response;
    bst_crlb_table image_bound, onboard_bound;
} filters;

/* Runs exposures of these binnings through a module of their own, and keeps what the generator got.
 */
static void run_binned(const int *binnings, int count, filters *got) {
    void *config = calloc(1, bst_obsgen_module.config_bytes), *self;
    const bst_module_env env = {.ctx = &m.ctx,
                                .instance = "a/b/obsgen",
                                .tick_rate_hz = RATE,
                                .seed = 3,
                                .world = (const struct bst_world *)&m,
                                .knowledge = (const struct bst_knowledge *)&m};
    set_key(config, "star_limit_v_mag", 13.5, 0);
    set_key(config, "margin_px", 8.0, 0);
    set_key(config, "capacity", 0.0, 100);
    set_key(config, "truth_capacity", 0.0, 100);
    set_key(config, "mesh_px", 0.0, 64);
    set_key(config, "false_alarms_per_frame", 1e-6, 0);
    set_key(config, "streak_min_px", 1.5, 0);
    set_key(config, "streak_max_px", 64.0, 0);
    set_key(config, "search_radius_px", 55.0, 0);
    set_key(config, "match_tolerance_px", 2.5, 0);
    bst_assert_ok(&m.ctx, bst_obsgen_module.create(&env, config, &self));
    for (int i = 0; i < count; i++) {
        m.exposure.binning = binnings[i];
        m.exposure.id++;
        m.exposed = m.processed = false;
        memset(&m.response, 0, sizeof m.response);
        bst_assert_ok(&m.ctx, bst_obsgen_module.step(self, NULL));
        if (got) {
            got[i] = (filters){m.response, m.image_bound, m.onboard_bound};
        }
    }
    m.frame.truth = NULL; /* the module's */
    bst_obsgen_module.destroy(self);
    free(config);
}

/* Runs one exposure through a module of its own. */
static void run(void) {
    const int binning = m.exposure.binning;
    run_binned(&binning, 1, NULL);
}

static void begin(void) {
    free(m.truth);
    free(m.detections);
    free(m.pointing);
    memset(&m, 0, sizeof m);
    m.camera = (bst_camera){.width_px = 700,
                            .height_px = 400,
                            .pixel_scale_arcsec = 6.0,
                            .aperture_m = 0.15,
                            .throughput = 0.7,
                            .quantum_efficiency = 0.7,
                            .photon_flux_v0_per_s_m2 = 3.6e10,
                            .psf_fwhm_px = 2.0,
                            .read_noise_e = 8.0,
                            .full_well_e = 1e5,
                            .gain_e_per_dn = 1.6,
                            .bits = 16};
    static bst_ghosts *two;
    two = two ? two : calloc(1, sizeof *two + 2 * sizeof two->items[0]);
    assert_non_null(two);
    two->count = 2;
    two->items[1].sigma_px = 1.5;
    m.camera.ghost_images = two;
    m.exposure = (bst_exposure){
        .id = 3, .start_tick = START, .end_tick = END, .window = {40, 20, 300, 200}, .binning = 2};
    m.truth = calloc(1, sizeof *m.truth + 100 * sizeof m.truth->items[0]);
    m.detections = calloc(1, sizeof *m.detections + 100 * sizeof m.detections->items[0]);
    m.pointing = calloc(1, sizeof *m.pointing + 30 * sizeof m.pointing->items[0]);
    m.pointing->capacity = 30;
    for (int i = 0; i < 30; i++) {
        int64_t tick = START - 500 + 60 * i;
        m.pointing->items[m.pointing->written++] =
            (bst_pointing_sample){.tick = tick, .q_cam_from_gcrf = attitude((double)tick / RATE)};
    }
}

static void expect_attitude(bst_quat a, bst_quat b, double tolerance_rad) {
    bst_vec3 e = bst_quat_to_rotvec(bst_quat_mul(a, bst_quat_conj(b)));
    bst_assert_close(e.x, 0.0, tolerance_rad);
    bst_assert_close(e.y, 0.0, tolerance_rad);
    bst_assert_close(e.z, 0.0, tolerance_rad);
}

static void onboard_attitude_has_the_trackers_correction(void **state) {
    (void)state;
    begin();
    m.predicted = true;
    m.predictions = (bst_predictions){.tick = 4100,
                                      .attitude_valid = true,
                                      .attitude_error_cam_rad = {1e-4, -2e-4, 3e-3},
                                      .attitude_error_rate_cam_radps = {4e-5, 5e-5, -7e-4}};
    run();
    /* 1.3 s after the prediction */
    bst_vec3 e = {1e-4 + 1.3 * 4e-5, -2e-4 + 1.3 * 5e-5, 3e-3 - 1.3 * 7e-4};
    bst_quat middle = attitude(5.4);
    expect_attitude(m.detections->q_telemetry_from_gcrf, middle, 1e-8);
    bst_quat corrected = bst_quat_mul(bst_quat_from_rotvec(e), middle);
    expect_attitude(m.detections->q_cam_from_gcrf, corrected, 1e-8);
    assert_true(m.options.locked);
    /* stars are off by the whole difference; a roll about the boresight does not shift them */
    bst_vec3 off = bst_quat_to_rotvec(bst_quat_mul(
        corrected,
        bst_quat_conj(bst_quat_mul(bst_quat_from_rotvec((bst_vec3){-4e-4, 3e-4, 5e-3}), middle))));
    bst_assert_close(m.options.shift_px, hypot(off.x, off.y) / SCALE, 1e-3);
    assert_true(m.options.shift_px > 10.0);

    /* without a valid correction telemetry's attitude alone */
    begin();
    m.predicted = true;
    m.predictions.attitude_error_cam_rad = (bst_vec3){1e-2, 0.0, 0.0};
    run();
    expect_attitude(m.detections->q_cam_from_gcrf, middle, 1e-8);
    assert_false(m.options.locked);
    bst_assert_close(m.options.shift_px, hypot(4e-4, 3e-4) / SCALE, 0.05);
}

static void generator_gets_the_exposure(void **state) {
    (void)state;
    begin();
    run();
    const bst_generator_frame *f = &m.frame;
    assert_int_equal(f->window.x0, 40);
    assert_int_equal(f->window.y0, 20);
    assert_int_equal(f->binning, 2);
    bst_assert_close(f->exposure_s, 0.8, 1e-15);
    bst_assert_close(f->sigma_px, 2.0 / (2.0 * sqrt(2.0 * log(2.0))), 1e-9);
    assert_null(f->response); /* both are Gaussian */
    assert_int_equal(f->path_count, NODES);
    /* a star at the window's middle, as telemetry turns */
    double x[3], y[3];
    bst_vec3 star = bst_quat_rotate(bst_quat_conj(attitude(5.4)),
                                    bst_camera_unproject(&m.camera, 40 + 149.5, 20 + 99.5));
    for (int k = 0; k < 3; k++) {
        assert_true(bst_camera_project(&m.camera, bst_quat_rotate(attitude(5.0 + 0.4 * k), star),
                                       &x[k], &y[k]));
    }
    bst_assert_close(f->streak_dx_px, x[2] - x[0], 0.02);
    bst_assert_close(f->streak_dy_px, y[2] - y[0], 0.02);
    assert_true(fabs(f->streak_dx_px) > 20.0 && fabs(f->streak_dy_px) > 15.0);
    assert_int_equal(m.options.locked, false);
    bst_assert_close(m.options.julian_year, 2024.5, 0.0);
    bst_assert_close(m.options.search_radius_px, 55.0, 0.0);
    bst_assert_close(m.options.match_tolerance_px, 2.5, 0.0);
    bst_assert_close(m.options.v_limit, 11.25, 0.0);
}

/* True path at even steps less its mean by trapezia. */
static double path_x[NODES], path_y[NODES];

bst_status __real_bst_obsgen_pending_set_path(bst_ctx *ctx, bst_obsgen_pending *pending,
                                              const bst_camera *camera, const bst_los_track *track,
                                              double lead_s, bst_window window);
static bst_obsgen_pending *kept;

WRAP(bst_status, bst_obsgen_pending_set_path,
     (bst_ctx * ctx, bst_obsgen_pending *pending, const bst_camera *camera,
      const bst_los_track *track, double lead_s, bst_window window)) {
    kept = pending;
    return __real_bst_obsgen_pending_set_path(ctx, pending, camera, track, lead_s, window);
}

void __real_bst_obsgen_pending_free(bst_obsgen_pending *pending);

WRAP(void, bst_obsgen_pending_free, (bst_obsgen_pending * pending)) {
    if (pending == kept && pending->path_count == NODES) {
        memcpy(path_x, pending->path_x_px, sizeof path_x);
        memcpy(path_y, pending->path_y_px, sizeof path_y);
    }
    __real_bst_obsgen_pending_free(pending);
}

static void path_is_that_of_a_star_at_the_windows_middle(void **state) {
    (void)state;
    for (int pass = 0; pass < 2; pass++) {
        begin();
        /* a rolling shutter looks before and after the exposure */
        m.camera.detector.row_time_s = pass ? 1e-3 : 0.0;
        run();
        double x[NODES], y[NODES], mean[2] = {0.0, 0.0};
        bst_vec3 star = bst_quat_rotate(bst_quat_conj(attitude(5.4)),
                                        bst_camera_unproject(&m.camera, 40 + 149.5, 20 + 99.5));
        for (int k = 0; k < NODES; k++) {
            double t = 5.0 + 0.8 * k / (NODES - 1);
            assert_true(
                bst_camera_project(&m.camera, bst_quat_rotate(attitude(t), star), &x[k], &y[k]));
            double weight = (k == 0 || k == NODES - 1 ? 0.5 : 1.0) / (NODES - 1);
            mean[0] += weight * x[k];
            mean[1] += weight * y[k];
        }
        for (int k = 0; k < NODES; k++) {
            bst_assert_close(path_x[k], x[k] - mean[0], 1e-4);
            bst_assert_close(path_y[k], y[k] - mean[1], 1e-4);
        }
    }
}

static void what_is_published(void **state) {
    (void)state;
    begin();
    run();
    const bst_detections *d = m.detections;
    assert_int_equal(d->exposure_id, 4);
    assert_int_equal(d->start_tick, START);
    assert_int_equal(d->end_tick, END);
    assert_int_equal(d->count, ITEMS);
    assert_int_equal(d->lost, 3);
    bst_assert_close(d->background_e, 40.0, 0.0);
    bst_assert_close(d->noise_e, 9.0, 0.0);
    bst_assert_close(d->threshold_snr, 5.5, 0.0);
    assert_int_equal(d->stars_identified, STARS);
    assert_string_equal(m.counted, "detections_overflow");
    /* a fifth of the light is missing in all: the zero point of the stars' true light gives it
     * back, also to what is no star */
    for (int i = 0; i < ITEMS; i++) {
        double v = bst_camera_v_mag(&m.camera, (5000.0 + 400.0 * i) / 0.8);
        bst_assert_close(d->items[i].v_mag, v, 1e-6);
    }
    assert_int_equal(m.truth->exposure_id, 4);
    assert_int_equal(m.truth->count, ITEMS);
}

/* An exposure gets the filters of its own binning, whatever was binned before. */
static void filters_are_of_the_binning(void **state) {
    (void)state;
    begin();
    bst_psf *psf;
    bst_camera onboard = m.camera;
    onboard.ghost_images = NULL;
    onboard.optics.psf = BST_PSF_DIFFRACTION;
    onboard.optics.q = 2.0;
    onboard.optics.band_nm[0] = 600.0;
    onboard.optics.band_nm[1] = 601.0;
    onboard.optics.wavelengths = 1;
    bst_assert_ok(&m.ctx, bst_psf_create(&m.ctx, &onboard, &psf));
    m.psf = psf;
    static filters alone[2], mixed[3];
    static const int order[3] = {1, 2, 1};
    run_binned(order, 1, &alone[0]);
    run_binned(order + 1, 1, &alone[1]);
    run_binned(order, 3, mixed);
    assert_true(alone[0].image_bound.along[0][0] != alone[1].image_bound.along[0][0] &&
                alone[0].onboard_bound.along[0][0] != alone[1].onboard_bound.along[0][0]);
    for (int i = 0; i < 3; i++) {
        const filters *wanted = &alone[order[i] - 1];
        assert_memory_equal(mixed[i].image_bound.along, wanted->image_bound.along,
                            sizeof wanted->image_bound.along);
        assert_memory_equal(mixed[i].onboard_bound.along, wanted->onboard_bound.along,
                            sizeof wanted->onboard_bound.along);
        assert_true(mixed[i].response.both.across_px == wanted->response.both.across_px);
        assert_true(mixed[i].response.filter.along_px == wanted->response.filter.along_px);
    }
    m.psf = NULL;
    bst_psf_free(psf);
}

static void without_telemetry_no_star_is_identified(void **state) {
    (void)state;
    begin();
    m.telemetry_stale = true;
    run();
    assert_false(m.identified);
    assert_int_equal(m.detections->stars_identified, 0);
    bst_assert_close(m.frame.streak_dx_px, 0.0, 0.0);
    expect_attitude(m.detections->q_cam_from_gcrf, BST_QUAT_IDENTITY, 0.0);
    begin();
    m.exposure.dropped = true;
    m.detections->exposure_id = -7;
    run();
    assert_int_equal(m.detections->exposure_id, -7); /* nothing is published */
    assert_true(m.truth->dropped);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(onboard_attitude_has_the_trackers_correction),
        cmocka_unit_test(generator_gets_the_exposure),
        cmocka_unit_test(path_is_that_of_a_star_at_the_windows_middle),
        cmocka_unit_test(what_is_published),
        cmocka_unit_test(filters_are_of_the_binning),
        cmocka_unit_test(without_telemetry_no_star_is_identified),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
