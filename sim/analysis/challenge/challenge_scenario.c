/* The random scenario of a challenge. */
#include <cjson/cJSON.h>
#include <math.h>
#include <stdio.h>

#include "boresight/rng.h"
#include "boresight/vec.h"
#include "sim/analysis/challenge/challenge.h"
#include "sim/cli/print_json.h"

enum { MOST_OBJECTS = 6 };

static const double PI = 3.14159265358979323846;
/* The observer: at rest, as far as a geostationary satellite, with the Earth behind the camera. */
static const double OBSERVER_M = 42164e3;
/* Between the exposures of a sequence, and the whole cycle of one, s. */
static const double PAUSE_S = 1.0;

/* Random values of a challenge. */
typedef struct drawing {
    const bst_challenge_request *request;
    bst_rng_key key;
    uint64_t next;
    double exposure_s, scale_rad;
} drawing;

/* Motion of a sequence. */
typedef struct sequence {
    bst_quat start;      /* attitude at its first exposure */
    bst_vec3 rate_radps; /* of the camera, in its own axes */
    double x_px[MOST_OBJECTS], y_px[MOST_OBJECTS], range_m[MOST_OBJECTS]; /* from the middle */
    double vx_pxps[MOST_OBJECTS], vy_pxps[MOST_OBJECTS];
    int objects;
} sequence;

/* Uniform deviate between two limits. */
static double uniform(drawing *d, double low, double high) {
    return low + (high - low) * bst_rng_uniform(d->key, 0, d->next++);
}

/* Deviate whose logarithm is uniform. */
static double log_uniform(drawing *d, double low, double high) {
    return exp(uniform(d, log(low), log(high)));
}

static cJSON *camera_json(drawing *d) {
    const bst_challenge_request *q = d->request;
    double scale_arcsec = uniform(d, 2.0, 6.0);
    cJSON *camera = cJSON_CreateObject(), *detector = cJSON_CreateObject();
    d->scale_rad = scale_arcsec * BST_ARCSEC_RAD;
    const struct {
        const char *key;
        double value;
    } keys[] = {{"width_px", (double)q->size_px},
                {"height_px", (double)q->size_px},
                {"pixel_scale_arcsec", scale_arcsec},
                {"aperture_m", uniform(d, 0.1, 0.25)},
                {"psf_fwhm_px", uniform(d, 1.6, 3.0)},
                {"background_mag_arcsec2", uniform(d, 20.5, 22.0)},
                {"dark_current_e_per_s", uniform(d, 0.2, 5.0)},
                {"read_noise_e", uniform(d, 4.0, 15.0)},
                {"gain_e_per_dn", uniform(d, 1.0, 3.0)},
                {"offset_dn", uniform(d, 300.0, 1200.0)},
                {"bits", 16}},
      effects[] = {{"dsnu_rms", uniform(d, 0.05, 0.4)},
                   {"hot_fraction", uniform(d, 2e-4, 2e-3)},
                   {"hot_median_e_per_s", uniform(d, 100.0, 800.0)},
                   {"prnu_rms", uniform(d, 0.004, 0.02)},
                   {"column_offset_rms_e", uniform(d, 0.5, 3.0)}};
    for (size_t i = 0; i < sizeof keys / sizeof *keys; i++) {
        cJSON_AddNumberToObject(camera, keys[i].key, keys[i].value);
    }
    for (size_t i = 0; i < sizeof effects / sizeof *effects; i++) {
        cJSON_AddNumberToObject(detector, effects[i].key, effects[i].value);
    }
    cJSON *hits = cJSON_AddObjectToObject(detector, "cosmic_rays");
    cJSON_AddNumberToObject(hits, "rate_per_cm2_s", uniform(d, 0.2, 5.0));
    cJSON_AddItemToObject(camera, "detector", detector);
    return camera;
}

/* Draws where a sequence looks, how the camera moves, and where its objects are. */
static sequence draw_sequence(drawing *d) {
    sequence s = {0};
    /* the Earth is in the direction -x from the observer: look into the other half of the sky */
    double ra = uniform(d, -0.35 * PI, 0.35 * PI), sin_dec = uniform(d, -0.8, 0.8);
    bst_vec3 ahead = bst_vec3_from_radec(ra, asin(sin_dec));
    bst_vec3 side = bst_vec3_unit(bst_vec3_cross((bst_vec3){0, 0, 1}, ahead));
    bst_vec3 up = bst_vec3_cross(ahead, side);
    const bst_mat3 axes = {
        {{side.x, side.y, side.z}, {up.x, up.y, up.z}, {ahead.x, ahead.y, ahead.z}}};
    s.start = bst_quat_mul(bst_quat_from_rotvec((bst_vec3){0, 0, uniform(d, -PI, PI)}),
                           bst_quat_from_mat3(&axes));
    /* stars are points in a third of the sequences, else streaks of up to 25 px */
    double streak = uniform(d, 0.0, 1.0) < 1.0 / 3.0 ? 0.0 : uniform(d, 5.0, 25.0);
    double angle = uniform(d, -PI, PI), rate = streak * d->scale_rad / d->exposure_s;
    s.rate_radps = (bst_vec3){rate * cos(angle), rate * sin(angle), 0.0};
    s.objects = (int)uniform(d, 0.0, MOST_OBJECTS + 0.999);
    double half = 0.45 * (double)d->request->size_px;
    for (int k = 0; k < MOST_OBJECTS; k++) {
        s.x_px[k] = uniform(d, -half, half);
        s.y_px[k] = uniform(d, -half, half);
        double speed = log_uniform(d, 0.02, 3.0) / d->exposure_s, way = uniform(d, -PI, PI);
        s.vx_pxps[k] = speed * cos(way);
        s.vy_pxps[k] = speed * sin(way);
        s.range_m[k] = log_uniform(d, 2e6, 4e7);
    }
    return s;
}

/* Attitude of a sequence after a time. */
static bst_quat attitude_at(const sequence *s, double t_s) {
    return bst_quat_mul(bst_quat_from_rotvec(bst_vec3_scale(s->rate_radps, -t_s)), s->start);
}

/* Place of an object of a sequence after a time; those that it does not have are behind. */
static bst_vec3 object_at(const drawing *d, const sequence *s, int k, double t_s) {
    double sign = k < s->objects ? 1.0 : -1.0;
    bst_vec3 way =
        bst_vec3_unit((bst_vec3){(s->x_px[k] + s->vx_pxps[k] * t_s) * d->scale_rad,
                                 (s->y_px[k] + s->vy_pxps[k] * t_s) * d->scale_rad, sign});
    bst_vec3 direction = bst_quat_rotate(bst_quat_conj(attitude_at(s, t_s)), way);
    return bst_vec3_add((bst_vec3){OBSERVER_M, 0, 0}, bst_vec3_scale(direction, s->range_m[k]));
}

static void add_vector(cJSON *node, const char *key, bst_vec3 v) {
    const double values[] = {v.x, v.y, v.z};
    cJSON_AddItemToObject(node, key, cJSON_CreateDoubleArray(values, 3));
}

/* Adds the states of an object at both ends of an exposure. */
static void add_states(cJSON *list, const char *name, bst_vec3 start, bst_vec3 end,
                       double exposure_s) {
    cJSON *node = cJSON_CreateObject();
    bst_vec3 velocity = bst_vec3_scale(bst_vec3_sub(end, start), 1.0 / exposure_s);
    cJSON_AddItemToArray(list, node);
    cJSON_AddStringToObject(node, "object", name);
    add_vector(node, "start_position_m", start);
    add_vector(node, "start_velocity_mps", velocity);
    add_vector(node, "end_position_m", end);
    add_vector(node, "end_velocity_mps", velocity);
}

/* Adds a frame of a sequence. */
static void add_frame(const drawing *d, const sequence *s, int index, int64_t number,
                      cJSON *frames) {
    double from = index * (d->exposure_s + PAUSE_S), to = from + d->exposure_s;
    bst_quat a = attitude_at(s, from), b = attitude_at(s, to);
    const double start[] = {a.x, a.y, a.z, a.w}, end[] = {b.x, b.y, b.z, b.w};
    cJSON *frame = cJSON_CreateObject();
    cJSON_AddItemToArray(frames, frame);
    cJSON_AddNumberToObject(frame, "frame", (double)number);
    cJSON_AddItemToObject(frame, "q_cam_from_gcrf_start", cJSON_CreateDoubleArray(start, 4));
    cJSON_AddItemToObject(frame, "q_cam_from_gcrf_end", cJSON_CreateDoubleArray(end, 4));
    cJSON *objects = cJSON_AddArrayToObject(frame, "objects");
    const bst_vec3 eye = {OBSERVER_M, 0, 0};
    add_states(objects, "eye", eye, eye, d->exposure_s);
    for (int k = 0; k < MOST_OBJECTS; k++) {
        char name[16];
        snprintf(name, sizeof name, "object%d", k);
        add_states(objects, name, object_at(d, s, k, from), object_at(d, s, k, to), d->exposure_s);
    }
}

/* Orbit by the states in updates.json. */
static cJSON *orbit_json(const char *name) {
    cJSON *orbit = cJSON_CreateObject();
    cJSON_AddStringToObject(orbit, "source", "injected");
    cJSON_AddStringToObject(orbit, "states_file", "updates.json");
    cJSON_AddStringToObject(orbit, "states_object", name);
    return orbit;
}

/* World and observer; `camera` is taken over. */
static cJSON *scenario_json(drawing *d, cJSON *camera) {
    const bst_challenge_request *q = d->request;
    char text[48];
    cJSON *root = cJSON_CreateObject();
    cJSON_AddNumberToObject(root, "boresight", 1);
    cJSON_AddStringToObject(root, "name", "challenge");
    /* drawn one after another: compilers differ in the order of a call's arguments */
    int hour = (int)uniform(d, 0, 23.99), day = 1 + (int)uniform(d, 0, 27.99);
    int month = 1 + (int)uniform(d, 0, 11.99);
    snprintf(text, sizeof text, "2022-%02d-%02dT%02d:00:00Z", month, day, hour);
    cJSON_AddStringToObject(root, "epoch_utc", text);
    cJSON_AddNumberToObject(
        root, "duration_s",
        (double)(q->sequences * BST_CHALLENGE_FRAMES) * (d->exposure_s + PAUSE_S));
    snprintf(text, sizeof text, "0x%llx", (unsigned long long)q->seed);
    cJSON_AddStringToObject(root, "seed", text);
    cJSON *world = cJSON_AddObjectToObject(root, "world");
    cJSON_AddStringToObject(world, "star_catalogue", q->catalogue);
    cJSON_AddStringToObject(world, "faint_stars", "statistical");
    cJSON *objects = cJSON_AddArrayToObject(world, "objects");
    for (int k = 0; k < MOST_OBJECTS; k++) {
        cJSON *object = cJSON_CreateObject();
        snprintf(text, sizeof text, "object%d", k);
        cJSON_AddItemToArray(objects, object);
        cJSON_AddStringToObject(object, "name", text);
        cJSON_AddItemToObject(object, "orbit", orbit_json(text));
        cJSON_AddNumberToObject(object, "area_m2", log_uniform(d, 1.0, 30.0));
        cJSON_AddNumberToObject(object, "albedo", 0.2);
    }
    cJSON *observer = cJSON_CreateObject(), *sensor = cJSON_CreateObject();
    cJSON_AddItemToArray(cJSON_AddArrayToObject(root, "observers"), observer);
    cJSON_AddStringToObject(observer, "name", "observer");
    cJSON_AddItemToObject(observer, "orbit", orbit_json("eye"));
    cJSON_AddItemToArray(cJSON_AddArrayToObject(observer, "sensors"), sensor);
    cJSON_AddStringToObject(sensor, "name", "camera");
    cJSON_AddStringToObject(sensor, "frame_updates_file", "updates.json");
    cJSON_AddItemToObject(sensor, "camera", camera);
    cJSON *exposure = cJSON_AddObjectToObject(sensor, "exposure");
    cJSON_AddNumberToObject(exposure, "exposure_s", d->exposure_s);
    cJSON_AddNumberToObject(exposure, "period_s", d->exposure_s + PAUSE_S);
    cJSON *modules = cJSON_AddObjectToObject(sensor, "modules");
    cJSON *gimbal = cJSON_AddObjectToObject(modules, "gimbal");
    cJSON_AddStringToObject(gimbal, "type", "scripted");
    /* the longest exposure is longer than the usual history */
    cJSON_AddNumberToObject(cJSON_AddObjectToObject(gimbal, "platform"), "history_s",
                            ceil(d->exposure_s) + 4.0);
    cJSON_AddStringToObject(cJSON_AddObjectToObject(modules, "scenegen"), "type", "opencl");
    cJSON_AddStringToObject(cJSON_AddObjectToObject(root, "record"), "frames", "extensions");
    return root;
}

bst_status bst_challenge_write_scenario(bst_ctx *ctx, const bst_challenge_request *q,
                                        const char *folder) {
    char path[4200];
    drawing d = {.request = q, .key = bst_rng_make_key(q->seed, 0, "challenge", "scenario")};
    d.exposure_s = 0.5 * floor(uniform(&d, 2.0, 10.999)); /* 1 to 5 s: whole ticks */
    cJSON *camera = camera_json(&d);
    snprintf(path, sizeof path, "%s/scenario.json", folder);
    BST_TRY(bst_cli_write_json(ctx, path, scenario_json(&d, camera)));
    cJSON *updates = cJSON_CreateObject();
    cJSON_AddNumberToObject(updates, "boresight_frame_updates", 1);
    cJSON *frames = cJSON_AddArrayToObject(updates, "frames");
    for (int64_t i = 0; i < q->sequences; i++) {
        sequence s = draw_sequence(&d);
        for (int k = 0; k < BST_CHALLENGE_FRAMES; k++) {
            add_frame(&d, &s, k, i * BST_CHALLENGE_FRAMES + k, frames);
        }
    }
    snprintf(path, sizeof path, "%s/updates.json", folder);
    return bst_cli_write_json(ctx, path, updates);
}
