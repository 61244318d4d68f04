#include "control/loop/model_error.h"

#include <math.h>

/* Frames until the Kalman gains are steady; before, they are higher. */
enum { SETTLING_FRAMES = 30 };

static int64_t ticks_of(const bst_model_error *error, double seconds) {
    return (int64_t)llround(seconds * error->tick_rate_hz);
}

void bst_model_error_init(bst_model_error *error, const bst_model_error_env *env) {
    error->active = env->gain != 1.0 || env->late_s != 0.0;
    if (!error->active) {
        return;
    }
    *error = (bst_model_error){.active = true,
                               .gain = env->gain,
                               .late_s = env->late_s,
                               .exposure_s = env->exposure_s,
                               .tick_rate_hz = env->tick_rate_hz,
                               .jump_rad = env->jump_rad};
    bst_aim_history_init(&error->aims, env->tick_rate_hz, 1.0);
    double reach_s = env->latency_s + 2.0 * env->exposure_s + env->late_s;
    error->spacing_ticks = ticks_of(error, reach_s / (BST_MODEL_ERROR_SAMPLES / 2));
}

void bst_model_error_archive(bst_model_error *error, bst_archive *archive) {
    if (!error->active) {
        return;
    }
    bst_aim_history_archive(&error->aims, archive);
    bst_archive_bool(archive, &error->slewing);
    BST_ARCHIVE(archive, error->slew_tick);
    error->telemetry = bst_archive_integer(archive, error->telemetry, 0, INT64_MAX);
    error->kept = bst_archive_integer(archive, error->kept, 0, INT64_MAX / 2);
    size_t stored =
        error->kept < BST_MODEL_ERROR_SAMPLES ? (size_t)error->kept : BST_MODEL_ERROR_SAMPLES;
    bst_archive_bytes(archive, error->items, stored * sizeof *error->items);
    BST_ARCHIVE(archive, error->frames);
    bst_archive_bool(archive, &error->begun);
    BST_ARCHIVE(archive, error->origin);
    BST_ARCHIVE(archive, error->estimate);
}

bst_quat bst_model_error_correction(const bst_model_error *error,
                                    const bst_pointing_error *observer, int64_t tick,
                                    double tick_rate_hz) {
    bst_quat q = bst_pointing_error_at(observer, tick, tick_rate_hz);
    if (!error->active || !error->begun) {
        return q;
    }
    bst_vec3 since = bst_vec3_sub(bst_quat_to_rotvec(bst_quat_unit(q)), error->estimate);
    return bst_quat_from_rotvec(bst_vec3_axpy(error->estimate, error->gain, since));
}

void bst_model_error_commanded(bst_model_error *error, const bst_pointing_error *observer,
                               int64_t effect_tick, int64_t half_ticks,
                               const bst_vec3 corrected[3]) {
    if (!error->active) {
        return;
    }
    const double hz = error->tick_rate_hz;
    const int64_t at[3] = {effect_tick, effect_tick + half_ticks, effect_tick - half_ticks};
    bst_quat taken[3];
    for (int i = 0; i < 3; i++) {
        taken[i] = bst_model_error_correction(error, observer, at[i], hz);
    }
    bst_vec3 direction, rate, expected;
    bst_pointing_error_uncorrect(taken, corrected, (double)half_ticks / hz, &direction, &rate);
    bool jumped = !bst_aim_history_predict(&error->aims, effect_tick, &expected) ||
                  bst_vec3_angle(expected, direction) > error->jump_rad;
    if (jumped) {
        error->slewing = true;
        error->slew_tick = effect_tick;
    }
    bst_aim_history_add(&error->aims, effect_tick, direction, rate, jumped);
}

void bst_model_error_telemetry(bst_model_error *error, const bst_pointing_telemetry *telemetry) {
    if (!error->active) {
        return;
    }
    int64_t oldest = telemetry->written - telemetry->capacity;
    error->telemetry = error->telemetry > oldest ? error->telemetry : oldest;
    for (; error->telemetry < telemetry->written; error->telemetry++) {
        const bst_pointing_sample *p = &telemetry->items[error->telemetry % telemetry->capacity];
        const bst_model_error_sample *last =
            &error->items[(error->kept - 1 + BST_MODEL_ERROR_SAMPLES) % BST_MODEL_ERROR_SAMPLES];
        bst_vec3 aim;
        if ((error->kept > 0 && p->tick - last->tick < error->spacing_ticks) ||
            !bst_aim_history_at(&error->aims, p->tick, &aim)) {
            continue;
        }
        if (telemetry->settled && p->tick > error->slew_tick) {
            error->slewing = false;
        }
        bst_vec3 z = bst_quat_rotate(bst_quat_conj(p->q_cam_from_gcrf), (bst_vec3){0, 0, 1});
        bst_vec3 across = bst_vec3_cross(aim, z);
        double sine = bst_vec3_norm(across), angle = bst_vec3_angle(aim, z);
        error->items[error->kept++ % BST_MODEL_ERROR_SAMPLES] = (bst_model_error_sample){
            .tick = p->tick,
            .turned = sine > 0.0 ? bst_vec3_scale(across, angle / sine) : across,
            .known = !error->slewing};
    }
}

/* Integral over [from, to] of the line through samples a and b. */
static bst_vec3 part(const bst_model_error_sample *a, const bst_model_error_sample *b, double from,
                     double to) {
    double width = (double)(b->tick - a->tick), middle = 0.5 * (from + to);
    double u = (middle - (double)a->tick) / width;
    bst_vec3 there = bst_vec3_axpy(bst_vec3_scale(a->turned, 1.0 - u), u, b->turned);
    return bst_vec3_scale(there, to - from);
}

/* Mean of `turned` over an exposure. Returns false if telemetry does not cover it, or during a
 * slew. */
static bool mean_turn(const bst_model_error *error, double middle_tick, bst_vec3 *out) {
    double half = fmax(0.5 * error->exposure_s * error->tick_rate_hz, 0.5);
    double from = middle_tick - half, to = middle_tick + half, covered = 0.0;
    int64_t oldest = error->kept - BST_MODEL_ERROR_SAMPLES;
    *out = (bst_vec3){0.0, 0.0, 0.0};
    for (int64_t i = error->kept - 1; i > (oldest > 0 ? oldest : 0); i--) {
        const bst_model_error_sample *a = &error->items[(i - 1) % BST_MODEL_ERROR_SAMPLES];
        const bst_model_error_sample *b = &error->items[i % BST_MODEL_ERROR_SAMPLES];
        double low = fmax(from, (double)a->tick), high = fmin(to, (double)b->tick);
        if (high <= low) {
            continue;
        }
        if (!a->known || !b->known) {
            return false;
        }
        *out = bst_vec3_add(*out, part(a, b, low, high));
        covered += high - low;
    }
    *out = bst_vec3_scale(*out, 1.0 / (2.0 * half));
    return covered > 2.0 * half * (1.0 - 1e-9);
}

bst_attitude_fix bst_model_error_apply(bst_model_error *error, const bst_pointing_error *observer,
                                       const bst_attitude_fix *fix) {
    bst_attitude_fix shown = *fix;
    if (!error->active || !fix->valid) {
        return shown;
    }
    bst_vec3 reported, real;
    double middle = (double)fix->tick;
    if (!mean_turn(error, middle, &reported) ||
        !mean_turn(error, middle - error->late_s * error->tick_rate_hz, &real)) {
        return shown;
    }
    if (++error->frames < SETTLING_FRAMES) {
        return shown;
    }
    if (!error->begun) {
        bst_quat q = bst_pointing_error_at(observer, fix->tick, error->tick_rate_hz);
        error->begun = true;
        error->origin = real;
        error->estimate = bst_quat_to_rotvec(bst_quat_unit(q));
    }
    bst_vec3 more = bst_vec3_axpy(bst_vec3_sub(real, error->origin), -1.0 / error->gain,
                                  bst_vec3_sub(reported, error->origin));
    shown.error_cam_rad =
        bst_vec3_sub(fix->error_cam_rad, bst_quat_rotate(fix->q_cam_from_gcrf, more));
    return shown;
}
