#include <cjson/cJSON.h>
#include <stdio.h>

#include "sim/analysis/loop/loop_model.h"
#include "sim/core/json_number.h"

static void put(const char *label, double value, const char *unit) {
    if (isinf(value)) {
        printf("    %-24s %10s\n", label, value > 0.0 ? "none" : "unstable");
    } else {
        printf("    %-24s %10.4g %s\n", label, value, unit);
    }
}

static void print_margins(const bst_loop_margins *m) {
    put("gain margin", m->gain_margin_db, "dB");
    if (isfinite(m->gain_reduction_db)) {
        put("gain reduction margin", m->gain_reduction_db, "dB");
    }
    put("phase margin", m->phase_margin_deg, "deg");
    put("delay margin", m->delay_margin_s, "s");
    put("sensitivity peak", m->sensitivity_peak, "");
    put("crossover", m->crossover_hz, "Hz");
    put("bandwidth (-3 dB)", m->bandwidth_hz, "Hz");
    if (!m->stable) {
        printf("    %-24s %10d poles outside the unit circle\n", "UNSTABLE", m->unstable_closed);
    }
}

static void print_prediction(const bst_loop_prediction *p) {
    put("predicted pointing RMS", p->rms_px, "px");
    printf(
        "      jitter %.4g left of %.4g px, of which %.4g above half the frame rate; frames' "
        "errors %.4g; lag %.4g\n",
        p->jitter_px, p->open_px, p->above_px, p->noise_px, p->lag_px);
}

void bst_loop_print(const bst_loop_model *model) {
    const bst_loop_timing *t = &model->timing;
    printf("%s/%s: gimbal %s\n", model->observer_name, model->sensor_name, model->gimbal_type);
    if (model->compensator) {
        printf(
            "  frames every %g s exposed %g s, with control %g s after the exposure; commands "
            "%g s on their way\n",
            t->period_s, t->exposure_s, t->frame_latency_s, t->command_delay_s);
    }
    for (int a = 0; a < model->axes; a++) {
        const bst_loop_axis *axis = &model->axis[a];
        if (axis->tracked && model->observes) {
            printf(
                "  %s axis, tracking loop: observer (alpha %.3g, beta %.3g%s), broken where the "
                "mount's motion shows in the frames\n",
                axis->name, model->alpha_beta.alpha, model->alpha_beta.beta,
                model->lowered ? ", lowered for the latency" : "");
        } else if (axis->tracked) {
            printf("  %s axis, tracking loop: %s\n", axis->name, model->compensator);
        }
        if (axis->tracked) {
            print_margins(&axis->margins);
            print_prediction(&axis->prediction);
        }
        if (axis->servo.there) {
            printf("  %s axis, servo%s\n", axis->name,
                   axis->servo.continuous ? " (continuous)" : "");
            print_margins(&axis->servo.margins);
        }
    }
    for (int b = 0; b < model->bodies; b++) {
        printf("  body %s axis, attitude loop\n", model->body[b].name);
        print_margins(&model->body[b].margins);
    }
}

static void add_margins(cJSON *node, const bst_loop_margins *m) {
    cJSON_AddBoolToObject(node, "stable", m->stable);
    bst_json_add_number(node, "gain_margin_db", m->gain_margin_db);
    bst_json_add_number(node, "gain_reduction_margin_db", m->gain_reduction_db);
    bst_json_add_number(node, "phase_margin_deg", m->phase_margin_deg);
    bst_json_add_number(node, "delay_margin_s", m->delay_margin_s);
    bst_json_add_number(node, "sensitivity_peak", m->sensitivity_peak);
    bst_json_add_number(node, "sensitivity_peak_hz", m->sensitivity_peak_hz);
    bst_json_add_number(node, "crossover_hz", m->crossover_hz);
    bst_json_add_number(node, "phase_crossover_hz", m->phase_crossover_hz);
    bst_json_add_number(node, "bandwidth_hz", m->bandwidth_hz);
}

cJSON *bst_loop_json(const bst_loop_model *model) {
    cJSON *root = cJSON_CreateObject();
    if (!root) {
        return NULL;
    }
    cJSON_AddStringToObject(root, "observer", model->observer_name);
    cJSON_AddStringToObject(root, "sensor", model->sensor_name);
    cJSON_AddStringToObject(root, "gimbal", model->gimbal_type);
    cJSON_AddStringToObject(root, "compensator", model->compensator ? model->compensator : "none");
    bst_json_add_number(root, "frame_period_s", model->timing.period_s);
    bst_json_add_number(root, "exposure_s", model->timing.exposure_s);
    bst_json_add_number(root, "frame_latency_s", model->timing.frame_latency_s);
    bst_json_add_number(root, "command_delay_s", model->timing.command_delay_s);
    cJSON *axes = cJSON_AddArrayToObject(root, "axes");
    double sum = 0.0;
    for (int a = 0; a < model->axes; a++) {
        const bst_loop_axis *axis = &model->axis[a];
        cJSON *node = cJSON_CreateObject();
        cJSON_AddItemToArray(axes, node);
        cJSON_AddStringToObject(node, "axis", axis->name);
        if (axis->tracked) {
            const bst_loop_prediction *p = &axis->prediction;
            add_margins(node, &axis->margins);
            bst_json_add_number(node, "predicted_rms_px", p->rms_px);
            bst_json_add_number(node, "jitter_left_rms_px", p->jitter_px);
            bst_json_add_number(node, "jitter_open_rms_px", p->open_px);
            bst_json_add_number(node, "jitter_above_half_frame_rate_rms_px", p->above_px);
            bst_json_add_number(node, "frame_noise_rms_px", p->noise_px);
            bst_json_add_number(node, "drift_lag_px", p->lag_px);
            sum += p->rms_px * p->rms_px;
        }
        if (axis->servo.there) {
            add_margins(cJSON_AddObjectToObject(node, "servo"), &axis->servo.margins);
        }
    }
    if (model->bodies > 0) {
        cJSON *bodies = cJSON_AddArrayToObject(root, "body");
        for (int b = 0; b < model->bodies; b++) {
            cJSON *node = cJSON_CreateObject();
            cJSON_AddItemToArray(bodies, node);
            cJSON_AddStringToObject(node, "axis", model->body[b].name);
            add_margins(node, &model->body[b].margins);
        }
    }
    if (model->compensator) {
        bst_json_add_number(root, "predicted_rms_radial_px", sqrt(sum));
    }
    return root;
}
