#include "control/loop/observer_design.h"

#include <math.h>

#include "control/control.h"

/* Required margins: those of bst_loop_verdict plus a reserve for mount dynamics and plant step,
 * which the design does not model. */
#define GAIN_MARGIN_DB 6.2
#define PHASE_MARGIN_DEG 31.0
#define SENSITIVITY_PEAK 1.95

/* Decades down to which a density is searched, and bisections of the last decade. */
enum { DECADES = 40, HALVINGS = 7 };

/* Checks the loop's margins at a density. */
static bst_status is_robust(bst_ctx *ctx, const bst_observer_request *r, double density,
                            bool *out) {
    const bst_control_servo_response servo = {.delay_s = r->servo_lag_s};
    bst_tracking_observer observer = {.motion_gain = 1.0};
    bst_tracking_observer_gains(density, r->sigma, r->timing.period_s, &observer.alpha,
                                &observer.beta);
    bst_tracking_loop *tracking;
    BST_TRY(bst_tracking_loop_create(ctx, &r->timing, &servo, NULL, &observer, &tracking));
    bst_loop loop = bst_tracking_as_loop(tracking);
    loop.open_later = NULL; /* the delay margin is not needed here */
    bst_loop_margins m;
    bst_status status = bst_loop_analyse(ctx, &loop, &m);
    bst_tracking_loop_free(tracking);
    *out = status == BST_OK && m.stable && m.gain_margin_db >= GAIN_MARGIN_DB &&
           m.gain_reduction_db >= GAIN_MARGIN_DB && m.phase_margin_deg >= PHASE_MARGIN_DEG &&
           m.sensitivity_peak <= SENSITIVITY_PEAK;
    return status;
}

/* Searches the largest density with sufficient margins. */
static bst_status search(bst_ctx *ctx, const bst_observer_request *request, double *density) {
    double high = request->density, low = high;
    bool robust;
    BST_TRY(is_robust(ctx, request, high, &robust));
    for (int i = 0; i < DECADES && !robust; i++) {
        high = low;
        low *= 0.1;
        BST_TRY(is_robust(ctx, request, low, &robust));
    }
    if (!robust) {
        return bst_fail(ctx, BST_ERR_NUMERIC,
                        "no gains of the observer have a gain margin of 6 dB and a phase margin of "
                        "30 deg with a latency of %g s and a frame every %g s",
                        request->timing.effect_s, request->timing.period_s);
    }
    for (int i = 0; i < HALVINGS && high > low; i++) {
        double middle = sqrt(low * high);
        BST_TRY(is_robust(ctx, request, middle, &robust));
        if (robust) {
            low = middle;
        } else {
            high = middle;
        }
    }
    *density = low;
    return BST_OK;
}

bst_status bst_observer_design(bst_ctx *ctx, const bst_observer_request *request, bst_memo *memo,
                               double *density) {
    const bst_memo_call call = {.function = "bst_observer_design",
                                .arguments = request,
                                .argument_bytes = sizeof *request,
                                .result = density,
                                .result_bytes = sizeof *density};
    if (!bst_memo_find(memo, &call)) {
        BST_TRY(search(ctx, request, density));
        bst_memo_keep(memo, &call);
    }
    return BST_OK;
}

bst_status bst_control_observer_density(bst_ctx *ctx, const bst_control_config *config,
                                        const bst_image_loop_env *timing, double pixel_rad,
                                        bst_memo *memo, double *density) {
    if (config->compensator.gain_scale == 0.0) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "gain_scale: 0 leaves an observer no motion that the frames show; give "
                        "more than 0");
    }
    bst_pointing_error e;
    double floor_rad = config->fix_sigma_floor_px * pixel_rad;
    bst_pointing_error_init(&e, config->disturbance_px_rms * pixel_rad,
                            config->disturbance_cutoff_hz, floor_rad, 1.0, 1.0);
    *density = e.density;
    if (!config->robust_observer || !(timing->frame_period_s > 0.0)) {
        return BST_OK;
    }
    double arrival = 0.5 * timing->frame_exposure_s + timing->frame_latency_s;
    double effect = arrival + timing->command_latency_s;
    const bst_observer_request request = {.timing = {.period_s = timing->frame_period_s,
                                                     .exposure_s = timing->frame_exposure_s,
                                                     .arrival_s = arrival,
                                                     .effect_s = effect,
                                                     .switch_s = effect},
                                          .servo_lag_s = timing->servo_lag_s,
                                          .density = e.density,
                                          .sigma = floor_rad};
    return bst_observer_design(ctx, &request, memo, density);
}
