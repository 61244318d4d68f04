/* The tracking loop of a mount axis: closes it and predicts the residual pointing error. */
#include "sim/analysis/loop/loop_model.h"

/* Predicts the pointing error of an axis: jitter, centroid noise and lag. */
static void predict(bst_loop_axis *axis, double drift_pxps, const bst_loop_options *options,
                    double period_s) {
    bst_loop_prediction *p = &axis->prediction;
    double open = 0.0, above = 0.0, nyquist = 0.5 / period_s;
    for (int i = 0; i < axis->band_count; i++) {
        const bst_tracking_band *b = &axis->bands[i];
        double width = b->high_hz - b->low_hz;
        double share = width > 0.0 ? (b->high_hz - nyquist) / width : b->low_hz > nyquist;
        open += b->variance;
        above += b->variance * fmin(fmax(share, 0.0), 1.0);
    }
    double left = bst_tracking_variance(axis->tracking, axis->bands, axis->band_count);
    double noise =
        bst_tracking_noise_gain(axis->tracking) * options->fix_sigma_px * options->fix_sigma_px;
    double lag = bst_tracking_lag(axis->tracking) * fabs(drift_pxps);
    *p = (bst_loop_prediction){.rms_px = sqrt(left + noise + lag * lag),
                               .jitter_px = sqrt(left),
                               .open_px = sqrt(open),
                               .above_px = sqrt(above),
                               .noise_px = sqrt(noise),
                               .lag_px = lag};
    if (!axis->margins.stable) {
        p->rms_px = p->jitter_px = p->noise_px = p->lag_px = INFINITY;
    }
}

bst_status bst_loop_close_tracking(bst_ctx *ctx, const bst_loop_tracked *tracked,
                                   bst_loop_model *model, bst_loop_axis *axis) {
    const bst_control_config *control = tracked->control;
    const bst_platform_config *platform = tracked->platform;
    BST_TRY(bst_loop_platform_bands(ctx, platform, model->pixel_rad, model->timing.gimbal_period_s,
                                    tracked->camera_axis, axis));
    bst_loop_body_bands(&platform->spacecraft, tracked->camera_axis, model->pixel_rad, axis);
    if (!control || !control->compensate_attitude) {
        return BST_OK;
    }
    const bst_loop_timing *t = &model->timing;
    double arrival = 0.5 * t->exposure_s + t->frame_latency_s;
    bst_tracking_timing timing = {.period_s = t->period_s,
                                  .exposure_s = t->exposure_s,
                                  .arrival_s = arrival,
                                  .effect_s = arrival + control->command_latency_s,
                                  .switch_s = arrival + t->command_delay_s};
    BST_TRY(bst_tracking_loop_create(ctx, &timing, tracked->servo,
                                     model->observes ? NULL : &model->gains, &model->alpha_beta,
                                     &axis->tracking));
    axis->tracked = true;
    axis->loop = bst_tracking_as_loop(axis->tracking);
    BST_TRY(bst_loop_analyse(ctx, &axis->loop, &axis->margins));
    predict(axis, tracked->drift_pxps, tracked->options, t->period_s);
    return BST_OK;
}
