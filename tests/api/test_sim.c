/* A simulation in the hands of a C program: stepping, looking, commanding, saving, branching. */
#include <pthread.h>

#include "boresight/boresight.h"
#include "tests/api/message_hash.h"
#include "tests/test_support.h"

static const char *const main_scenario = "scenarios/neossat_geo_track.json";

static bst_model *load(bst_ctx *ctx, const char *path, const char *const *more, int count) {
    const char *assignments[8] = {"/record/frames=none",
                                  "/observers/0/sensors/0/camera/width_px=128",
                                  "/observers/0/sensors/0/camera/height_px=96"};
    for (int i = 0; i < count; i++) {
        assignments[3 + i] = more[i];
    }
    bst_model *model = NULL;
    const bst_model_options options = {
        .assignments = assignments, .assignment_count = 3 + count, .threads = 1};
    bst_ctx_init(ctx, NULL, NULL, BST_LOG_ERROR);
    bst_assert_ok(ctx, bst_model_load(ctx, path, &options, &model));
    return model;
}

static bst_sim *create(bst_ctx *ctx, const bst_model *model) {
    bst_sim *sim = NULL;
    bst_assert_ok(ctx, bst_sim_create(ctx, model, NULL, &sim));
    return sim;
}

typedef struct heard {
    uint64_t hash;
    int64_t count;
} heard;

static bst_status hear(void *user, const char *scope, const char *channel, const void *payload,
                       int64_t tick) {
    heard *h = user;
    h->hash = hash_message(h->hash, scope, channel, payload, tick);
    h->count++;
    return BST_OK;
}

static uint64_t hash_until(bst_ctx *ctx, bst_sim *sim, double until_s) {
    heard h = {1, 0};
    bst_sim_observe(sim, &(bst_sim_observer){.user = &h, .message = hear});
    bst_assert_ok(ctx, bst_sim_run_until(ctx, sim, until_s));
    bst_sim_observe(sim, NULL);
    return h.hash;
}

/* ---- stepping and looking ---- */

static void steps_to_messages(void **state) {
    (void)state;
    bst_ctx ctx;
    bst_model *model = load(&ctx, main_scenario, NULL, 0);
    assert_string_equal(bst_model_sensor(model, 0), "neossat/telescope");
    assert_null(bst_model_sensor(model, 1));
    assert_null(bst_model_camera(model, 0)); /* not prepared */
    bst_sim *sim = create(&ctx, model);
    assert_int_equal(bst_model_camera(model, 0)->width_px, 128);

    bst_sim_message message;
    bst_assert_ok(&ctx, bst_sim_view(&ctx, sim, NULL, "detections", &message));
    assert_true(message.payload == NULL && message.sequence == -1);
    bool arrived = false;
    for (int k = 0; k < 3; k++) {
        bst_sim_frame frame, again;
        bst_assert_ok(&ctx, bst_sim_step(&ctx, sim, NULL, "frame", 10.0, &arrived));
        assert_true(arrived);
        /* exposures of 0.5 s begin every second */
        assert_int_equal(bst_sim_tick(sim), 3000 + 6000 * k);
        bst_assert_ok(&ctx, bst_sim_view_frame(&ctx, sim, "neossat/telescope", &frame));
        assert_int_equal(frame.message->exposure_id, k);
        assert_int_equal(frame.width, 128);
        assert_int_equal(frame.height, 96);
        assert_in_range(frame.pixels[0], 300, 4000); /* the offset is 500 DN */
        bst_assert_ok(&ctx, bst_sim_view_frame(&ctx, sim, NULL, &again));
        assert_ptr_equal(again.pixels, frame.pixels);
        /* no module has read the frame yet */
        bst_assert_ok(&ctx, bst_sim_view(&ctx, sim, NULL, "detections", &message));
        assert_int_equal(message.sequence, k - 1);
    }
    bst_assert_ok(&ctx, bst_sim_step(&ctx, sim, NULL, "detections", 10.0, &arrived));
    bst_assert_ok(&ctx, bst_sim_view(&ctx, sim, NULL, "detections", &message));
    assert_true(arrived && message.sequence == 2);
    assert_int_equal(message.items, ((const bst_detections *)message.payload)->count);
    /* the end comes first */
    bst_assert_ok(&ctx, bst_sim_step(&ctx, sim, NULL, "frame", 2.9, &arrived));
    assert_true(!arrived && bst_sim_time_s(sim) == 2.9);
    /* tick by tick: the plant steps at 1 kHz, six ticks apart */
    bst_assert_ok(&ctx, bst_sim_step(&ctx, sim, NULL, NULL, 10.0, &arrived));
    int64_t tick = bst_sim_tick(sim);
    bst_assert_ok(&ctx, bst_sim_step(&ctx, sim, NULL, NULL, 10.0, &arrived));
    assert_true(arrived && bst_sim_tick(sim) > tick && bst_sim_tick(sim) <= tick + 6);
    assert_int_equal(bst_sim_step(&ctx, sim, NULL, "planes", 10.0, NULL), BST_OK);
    assert_int_equal(bst_sim_step(&ctx, sim, "x/y", "frame", 10.0, NULL), BST_ERR_NOT_FOUND);
    assert_int_equal(bst_sim_step(&ctx, sim, NULL, "frames", 10.0, NULL), BST_ERR_NOT_FOUND);
    assert_int_equal(bst_sim_run_until(&ctx, sim, (double)NAN), BST_ERR_ARGUMENT);
    bst_sim_free(sim);
    bst_model_free(model);
}

/* Stepping from message to message changes nothing. */
static void stepping_changes_nothing(void **state) {
    (void)state;
    bst_ctx ctx;
    bst_model *model = load(&ctx, main_scenario, NULL, 0);
    bst_sim *whole = create(&ctx, model), *stepped = create(&ctx, model);
    uint64_t expected = hash_until(&ctx, whole, 4.2);
    heard h = {1, 0};
    bst_sim_observe(stepped, &(bst_sim_observer){.user = &h, .message = hear});
    static const char *const channels[] = {"frame",    "tracks",     NULL,
                                           "exposure", "detections", "los_command"};
    bool arrived = true;
    for (int k = 0; arrived; k++) {
        bst_sim_frame frame;
        bst_assert_ok(&ctx, bst_sim_step(&ctx, stepped, NULL, channels[k % 6], 4.2, &arrived));
        bst_assert_ok(&ctx, bst_sim_view_frame(&ctx, stepped, NULL, &frame));
    }
    assert_true(h.hash == expected && h.count > 4000);
    bst_sim_free(whole);
    bst_sim_free(stepped);
    bst_model_free(model);
}

/* ---- many sims ---- */

typedef struct job {
    const bst_model *model;
    uint64_t run, hash;
    char message[200];
} job;

static void *run_job(void *user) {
    job *j = user;
    bst_ctx ctx;
    bst_sim *sim = NULL;
    heard h = {1, 0};
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
    const bst_sim_options options = {.other_run = true, .run = j->run};
    if (bst_sim_create(&ctx, j->model, &options, &sim) == BST_OK) {
        bst_sim_observe(sim, &(bst_sim_observer){.user = &h, .message = hear});
        if (bst_sim_run_until(&ctx, sim, 3.0) == BST_OK) {
            j->hash = h.hash;
        }
    }
    snprintf(j->message, sizeof j->message, "%.199s", ctx.message);
    bst_sim_free(sim);
    return NULL;
}

/* Sims of one model in several threads give what they give alone; runs differ. */
static void sims_share_a_model(void **state) {
    (void)state;
    enum { JOBS = 4 };
    bst_ctx ctx;
    bst_model *model = load(&ctx, main_scenario, NULL, 0);
    job alone[2] = {{.model = model, .run = 0}, {.model = model, .run = 1}}, jobs[JOBS];
    pthread_t threads[JOBS];
    run_job(&alone[0]);
    run_job(&alone[1]);
    assert_true(alone[0].hash && alone[1].hash && alone[0].hash != alone[1].hash);
    for (int i = 0; i < JOBS; i++) {
        jobs[i] = (job){.model = model, .run = (uint64_t)i % 2};
        assert_int_equal(pthread_create(&threads[i], NULL, run_job, &jobs[i]), 0);
    }
    for (int i = 0; i < JOBS; i++) {
        pthread_join(threads[i], NULL);
        assert_true(jobs[i].hash == alone[i % 2].hash);
    }
    bst_model_free(model);
}

/* A hundred sims of one model, without images, step in turn. */
static void a_hundred_sims(void **state) {
    (void)state;
    static const char *const generator[] = {"/observers/0/sensors/0/observation_source=generator"};
    bst_ctx ctx;
    bst_model *model = load(&ctx, main_scenario, generator, 1);
    bst_sim *sims[100];
    for (int i = 0; i < 100; i++) {
        const bst_sim_options options = {.other_run = true, .run = (uint64_t)i};
        bst_assert_ok(&ctx, bst_sim_create(&ctx, model, &options, &sims[i]));
    }
    for (int step = 1; step <= 2; step++) {
        for (int i = 0; i < 100; i++) {
            bst_assert_ok(&ctx, bst_sim_run_until(&ctx, sims[i], step));
        }
    }
    for (int i = 0; i < 100; i++) {
        bst_sim_message message;
        bst_assert_ok(&ctx, bst_sim_view(&ctx, sims[i], NULL, "detections", &message));
        assert_int_equal(message.sequence, 1);
        assert_int_equal(bst_sim_run(sims[i]), i);
        bst_sim_free(sims[i]);
    }
    bst_model_free(model);
}

/* ---- commands ---- */

static void commands_to_external_modules(void **state) {
    (void)state;
    static const char *const external[] = {
        "/observers/0/sensors/0/modules/imgproc={\"type\": \"external\"}"};
    bst_ctx ctx;
    bst_model *model = load(&ctx, main_scenario, external, 1);
    bst_sim *sim = create(&ctx, model);
    bst_detections *given = test_calloc(1, sizeof *given + 2 * sizeof *given->items);
    for (int k = 0; k < 4; k++) {
        bool arrived;
        bst_sim_frame frame;
        bst_assert_ok(&ctx, bst_sim_step(&ctx, sim, NULL, "frame", 10.0, &arrived));
        bst_assert_ok(&ctx, bst_sim_view_frame(&ctx, sim, NULL, &frame));
        given->exposure_id = frame.message->exposure_id;
        given->start_tick = frame.message->start_tick;
        given->end_tick = frame.message->end_tick;
        given->threshold_snr = 5.0;
        given->noise_e = 8.0;
        given->count = 2;
        for (int i = 0; i < 2; i++) {
            given->items[i] = (bst_detection){.x_px = 20.0 + 30.0 * i,
                                              .y_px = 40.0 + k,
                                              .cov_xx = 0.01,
                                              .cov_yy = 0.01,
                                              .flux_e = 1000.0,
                                              .flux_sigma_e = 50.0,
                                              .snr = 20.0,
                                              .length_px = 2.0,
                                              .width_px = 2.0};
        }
        bst_assert_ok(&ctx, bst_sim_command(&ctx, sim, NULL, "detections", given));
        bst_sim_message message;
        bst_assert_ok(&ctx, bst_sim_step(&ctx, sim, NULL, "detections", 10.0, &arrived));
        bst_assert_ok(&ctx, bst_sim_view(&ctx, sim, NULL, "detections", &message));
        const bst_detections *published = message.payload;
        assert_int_equal(published->count, 2);
        assert_int_equal(published->exposure_id, k);
        assert_true(published->items[1].x_px == 50.0 && published->items[1].y_px == 40.0 + k);
    }
    /* what a peer may not send */
    given->items[1].snr = (double)NAN;
    assert_int_equal(bst_sim_command(&ctx, sim, NULL, "detections", given), BST_ERR_ARGUMENT);
    assert_non_null(strstr(ctx.message, "snr"));
    assert_int_equal(bst_sim_command(&ctx, sim, NULL, "tracks", given), BST_ERR_NOT_FOUND);
    assert_int_equal(bst_sim_command(&ctx, sim, "x/y", "detections", given), BST_ERR_NOT_FOUND);
    assert_int_equal(bst_sim_command(&ctx, sim, NULL, "nonsense", given), BST_ERR_NOT_FOUND);
    test_free(given);
    bst_sim_free(sim);
    bst_model_free(model);
}

static void states_of_objects(void **state) {
    (void)state;
    static const char *const steered[] = {"/world/objects/0/external_states=true"};
    bst_ctx ctx;
    bst_model *model = load(&ctx, main_scenario, steered, 1);
    bst_sim *sim = create(&ctx, model), *other = create(&ctx, model);
    const bst_vec3 position = {4.2e7, 1e5, 2e5}, velocity = {0.0, 3074.0, 0.0};
    bst_assert_ok(&ctx, bst_sim_command_state(&ctx, sim, "INMARSAT GX5", 1.0, position, velocity));
    /* each sim has its own: the same time once more is an error in the first only */
    assert_int_equal(bst_sim_command_state(&ctx, sim, "INMARSAT GX5", 1.0, position, velocity),
                     BST_ERR_ARGUMENT);
    bst_assert_ok(&ctx,
                  bst_sim_command_state(&ctx, other, "INMARSAT GX5", 1.0, position, velocity));
    assert_int_equal(bst_sim_command_state(&ctx, sim, "NONE", 1.0, position, velocity),
                     BST_ERR_NOT_FOUND);
    for (int k = 0; k < 7; k++) { /* each of the numbers must be finite */
        double v[7] = {2.0 + k, 4.2e7, 1e5, 2e5, 0.0, 3074.0, 0.0};
        v[k] = k % 2 ? (double)INFINITY : (double)NAN;
        assert_int_equal(
            bst_sim_command_state(&ctx, sim, "INMARSAT GX5", v[0], (bst_vec3){v[1], v[2], v[3]},
                                  (bst_vec3){v[4], v[5], v[6]}),
            BST_ERR_ARGUMENT);
        assert_non_null(strstr(ctx.message, "is not finite"));
    }
    bst_sim_free(sim);
    bst_sim_free(other);
    bst_model_free(model);
}

/* Attitudes of an object with a shape, by command; each sim has its own, also when it is saved. */
static void attitudes_of_objects(void **state) {
    (void)state;
    static const char *const shaped[] = {
        "/world/objects/0/external_states=true", "/world/objects/0/brightness/model=\"shape\"",
        "/world/objects/0/shape={\"materials\": [{\"name\": \"w\", \"diffuse\": 0.5}], "
        "\"parts\": [{\"name\": \"p\", \"kind\": \"plate\", \"material\": \"w\"}]}"};
    bst_ctx ctx;
    bst_model *model = load(&ctx, main_scenario, shaped, 3);
    bst_sim *sim = create(&ctx, model), *other = create(&ctx, model);
    const bst_quat q = {0.0, 0.6, 0.0, 0.8}, wrong = {0.0, 0.6, 0.0, 0.9};
    const bst_vec3 rate = {0.0, 0.1, 0.0};
    bst_assert_ok(&ctx, bst_sim_command_attitude(&ctx, sim, "INMARSAT GX5", 1.0, q, rate));
    assert_int_equal(bst_sim_command_attitude(&ctx, sim, "INMARSAT GX5", 1.0, q, rate),
                     BST_ERR_ARGUMENT);
    bst_assert_ok(&ctx, bst_sim_command_attitude(&ctx, other, "INMARSAT GX5", 0.5, q, rate));
    assert_int_equal(bst_sim_command_attitude(&ctx, sim, "INMARSAT GX5", 2.0, wrong, rate),
                     BST_ERR_ARGUMENT);
    for (int k = 0; k < 8; k++) {
        double v[8] = {2.0 + k, 0.0, 0.6, 0.0, 0.8, 0.0, 0.1, 0.0};
        v[k] = k % 2 ? -(double)INFINITY : (double)NAN;
        assert_int_equal(bst_sim_command_attitude(&ctx, sim, "INMARSAT GX5", v[0],
                                                  (bst_quat){v[1], v[2], v[3], v[4]},
                                                  (bst_vec3){v[5], v[6], v[7]}),
                         BST_ERR_ARGUMENT);
        assert_non_null(strstr(ctx.message, "is not finite"));
    }
    assert_int_equal(bst_sim_command_attitude(&ctx, sim, "NONE", 2.0, q, rate), BST_ERR_NOT_FOUND);
    bst_assert_ok(&ctx, bst_sim_command_attitude(&ctx, sim, "INMARSAT GX5", 9.0, q, rate));
    void *saved;
    size_t bytes;
    bst_assert_ok(&ctx, bst_sim_save(&ctx, sim, &saved, &bytes));
    bst_assert_ok(&ctx, bst_sim_restore(&ctx, other, saved, bytes, BST_STATE_ALL));
    /* the commands came along: a time before the last one is an error there too */
    assert_int_equal(bst_sim_command_attitude(&ctx, other, "INMARSAT GX5", 8.0, q, rate),
                     BST_ERR_ARGUMENT);
    bst_state_free(saved);
    bst_sim_free(sim);
    bst_sim_free(other);
    bst_model_free(model);
}

/* ---- saved states ---- */

static void clones_go_the_same_way(void **state) {
    (void)state;
    bst_ctx ctx;
    bst_model *model = load(&ctx, main_scenario, NULL, 0);
    bst_sim *sim = create(&ctx, model), *copy;
    bool arrived;
    bst_assert_ok(&ctx, bst_sim_run_until(&ctx, sim, 2.0));
    bst_assert_ok(&ctx, bst_sim_step(&ctx, sim, NULL, "frame", 10.0, &arrived)); /* in flight */
    bst_assert_ok(&ctx, bst_sim_clone(&ctx, sim, &copy));
    assert_int_equal(bst_sim_tick(copy), bst_sim_tick(sim));
    bst_sim_frame a, b;
    bst_assert_ok(&ctx, bst_sim_view_frame(&ctx, sim, NULL, &a));
    bst_assert_ok(&ctx, bst_sim_view_frame(&ctx, copy, NULL, &b));
    assert_memory_equal(a.pixels, b.pixels, sizeof *a.pixels * 128 * 96);
    uint64_t expected = hash_until(&ctx, sim, 6.0);
    assert_true(hash_until(&ctx, copy, 6.0) == expected);
    bst_sim_free(copy);
    bst_sim_free(sim);
    bst_model_free(model);
}

/* Clones of each of many frames, kept while the simulation goes on and after its end: they hold the
 * pixels, and the simulation does not run out of frames. */
static void clones_keep_their_frames(void **state) {
    (void)state;
    enum { CLONES = 20, PIXELS = 128 * 96 };
    static uint16_t pixels[CLONES][PIXELS];
    bst_ctx ctx;
    bst_model *model = load(&ctx, main_scenario, NULL, 0);
    bst_sim *sim = create(&ctx, model), *other = create(&ctx, model), *clones[CLONES], *second;
    bst_sim_frame frame;
    bool arrived;
    const uint64_t expected = hash_until(&ctx, other, 25.0);
    heard h = {1, 0};
    bst_sim_observe(sim, &(bst_sim_observer){.user = &h, .message = hear});
    for (int k = 0; k < CLONES; k++) {
        bst_assert_ok(&ctx, bst_sim_step(&ctx, sim, NULL, "frame", 25.0, &arrived));
        assert_true(arrived);
        bst_assert_ok(&ctx, bst_sim_view_frame(&ctx, sim, NULL, &frame));
        memcpy(pixels[k], frame.pixels, sizeof pixels[k]);
        bst_assert_ok(&ctx, bst_sim_clone(&ctx, sim, &clones[k]));
    }
    bst_assert_ok(&ctx, bst_sim_run_until(&ctx, sim, 25.0));
    assert_true(h.hash == expected); /* as without clones */
    bst_sim_free(sim);
    for (int k = 0; k < CLONES; k++) {
        bst_assert_ok(&ctx, bst_sim_view_frame(&ctx, clones[k], NULL, &frame));
        assert_int_equal(frame.message->exposure_id, k);
        assert_memory_equal(frame.pixels, pixels[k], sizeof pixels[k]);
        /* a clone of the clone holds the same frame */
        bst_assert_ok(&ctx, bst_sim_clone(&ctx, clones[k], &second));
        bst_sim_free(clones[k]);
        bst_assert_ok(&ctx, bst_sim_view_frame(&ctx, second, NULL, &frame));
        assert_memory_equal(frame.pixels, pixels[k], sizeof pixels[k]);
        bst_sim_free(second);
    }
    bst_sim_free(other);
    bst_model_free(model);
}

/* Going back in time, and another run number: what is kept and what changes. */
static void restores_components(void **state) {
    (void)state;
    bst_ctx ctx;
    bst_model *model = load(&ctx, main_scenario, NULL, 0);
    bst_sim *sim = create(&ctx, model), *other;
    const bst_sim_options second = {.other_run = true, .run = 7};
    void *bytes;
    size_t size;
    bst_assert_ok(&ctx, bst_sim_run_until(&ctx, sim, 2.5));
    bst_assert_ok(&ctx, bst_sim_save(&ctx, sim, &bytes, &size));
    uint64_t expected = hash_until(&ctx, sim, 5.0);
    bst_assert_ok(&ctx, bst_sim_restore(&ctx, sim, bytes, size, BST_STATE_ALL));
    assert_true(bst_sim_time_s(sim) == 2.5);
    assert_true(hash_until(&ctx, sim, 5.0) == expected);
    /* into a sim of another run: it becomes that run, or keeps its noise */
    bst_assert_ok(&ctx, bst_sim_create(&ctx, model, &second, &other));
    bst_assert_ok(&ctx, bst_sim_restore(&ctx, other, bytes, size, BST_STATE_ALL));
    assert_int_equal(bst_sim_run(other), 0);
    assert_true(hash_until(&ctx, other, 5.0) == expected);
    bst_sim_free(other);
    bst_assert_ok(&ctx, bst_sim_create(&ctx, model, &second, &other));
    const unsigned keeps_noise = BST_STATE_ALL & ~(unsigned)BST_STATE_RANDOM;
    bst_assert_ok(&ctx, bst_sim_restore(&ctx, other, bytes, size, keeps_noise));
    assert_int_equal(bst_sim_run(other), 7);
    assert_true(hash_until(&ctx, other, 5.0) != expected);
    /* parts at one tick only */
    assert_int_equal(bst_sim_restore(&ctx, other, bytes, size, BST_STATE_ONBOARD), BST_ERR_STATE);
    assert_int_equal(bst_sim_restore(&ctx, other, bytes, size, 0), BST_ERR_ARGUMENT);
    assert_int_equal(bst_sim_restore(&ctx, other, bytes, size, 16), BST_ERR_ARGUMENT);
    bst_sim_free(other);
    bst_assert_ok(&ctx, bst_sim_create(&ctx, model, &second, &other));
    bst_assert_ok(&ctx, bst_sim_run_until(&ctx, other, 2.5));
    bst_assert_ok(&ctx, bst_sim_restore(&ctx, other, bytes, size, BST_STATE_ONBOARD));
    assert_true(hash_until(&ctx, other, 5.0) != expected);
    bst_sim_free(other);
    bst_state_free(bytes);
    bst_sim_free(sim);
    bst_model_free(model);
}

static void wrong_states_are_refused(void **state) {
    (void)state;
    static const char *const longer[] = {"/duration_s=77"};
    static const char *const brighter[] = {"/world/objects/0/area_m2=5"};
    bst_ctx ctx;
    bst_model *model = load(&ctx, main_scenario, NULL, 0);
    bst_sim *sim = create(&ctx, model);
    void *bytes;
    size_t size;
    bst_assert_ok(&ctx, bst_sim_run_until(&ctx, sim, 1.1));
    bst_assert_ok(&ctx, bst_sim_save(&ctx, sim, &bytes, &size));
    unsigned char *damaged = test_malloc(size);
    for (size_t k = 0; k < 200; k++) { /* every byte of the head and some of the rest */
        memcpy(damaged, bytes, size);
        damaged[k < 150 ? k : k * (size / 200)] ^= 0x41;
        bst_status status = bst_sim_restore(&ctx, sim, damaged, size, BST_STATE_ALL);
        assert_true(status == BST_ERR_FORMAT || status == BST_ERR_STATE ||
                    (status == BST_OK && k < 150));
    }
    assert_int_equal(bst_sim_restore(&ctx, sim, bytes, size - 1, BST_STATE_ALL), BST_ERR_FORMAT);
    assert_int_equal(bst_sim_restore(&ctx, sim, bytes, 10, BST_STATE_ALL), BST_ERR_FORMAT);
    assert_int_equal(bst_sim_restore(&ctx, sim, NULL, 0, BST_STATE_ALL), BST_ERR_FORMAT);
    bst_assert_ok(&ctx, bst_sim_restore(&ctx, sim, bytes, size, BST_STATE_ALL));
    /* a longer run of the same scenario is one, another object is not */
    bst_ctx ctx2;
    bst_model *model2 = load(&ctx2, main_scenario, longer, 1);
    bst_sim *sim2 = create(&ctx2, model2);
    bst_assert_ok(&ctx2, bst_sim_restore(&ctx2, sim2, bytes, size, BST_STATE_ALL));
    bst_sim_free(sim2);
    bst_model_free(model2);
    model2 = load(&ctx2, main_scenario, brighter, 1);
    sim2 = create(&ctx2, model2);
    assert_int_equal(bst_sim_restore(&ctx2, sim2, bytes, size, BST_STATE_ALL), BST_ERR_STATE);
    assert_non_null(strstr(ctx2.message, "another scenario"));
    bst_sim_free(sim2);
    bst_model_free(model2);
    test_free(damaged);
    bst_state_free(bytes);
    bst_sim_free(sim);
    bst_model_free(model);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(steps_to_messages),
        cmocka_unit_test(stepping_changes_nothing),
        cmocka_unit_test(sims_share_a_model),
        cmocka_unit_test(a_hundred_sims),
        cmocka_unit_test(commands_to_external_modules),
        cmocka_unit_test(states_of_objects),
        cmocka_unit_test(attitudes_of_objects),
        cmocka_unit_test(clones_go_the_same_way),
        cmocka_unit_test(clones_keep_their_frames),
        cmocka_unit_test(restores_components),
        cmocka_unit_test(wrong_states_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
