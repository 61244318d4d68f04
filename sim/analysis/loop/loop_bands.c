/* Disturbances of a mount axis as frequency bands: platform jitter and attitude knowledge
 * errors. */
#include "gimbal/spacecraft/spacecraft_response.h"
#include "sim/analysis/loop/loop_model.h"

void bst_loop_add_band(bst_loop_axis *axis, double low_hz, double high_hz, double variance_px2) {
    if (variance_px2 > 0.0 && high_hz >= low_hz && axis->band_count < BST_LOOP_BANDS) {
        axis->bands[axis->band_count++] = (bst_tracking_band){low_hz, high_hz, variance_px2};
    }
}

/* Splits a jitter table at its points and at quarter octaves, up to the plant's sampling limit. */
static void table_bands(const bst_jitter_density *table, double scale, double top_hz,
                        bst_loop_axis *axis) {
    for (int i = 0; i + 1 < table->count; i++) {
        double from = table->points[i].frequency_hz;
        double to = fmin(table->points[i + 1].frequency_hz, top_hz);
        int parts = from > 0.0 && to > from ? (int)fmin(ceil(4.0 * log2(to / from)), 40.0) : 8;
        for (int k = 0; k < parts && to > from; k++) {
            double a = from + (to - from) * k / parts, b = from + (to - from) * (k + 1) / parts;
            bst_loop_add_band(axis, a, b, scale * bst_jitter_density_integral(table, a, b));
        }
    }
}

bst_status bst_loop_platform_bands(bst_ctx *ctx, const bst_platform_config *platform,
                                   double pixel_rad, double dt_s, int camera_axis,
                                   bst_loop_axis *axis) {
    bst_jitter_spectrum spectrum;
    BST_TRY(bst_platform_jitter_spectrum(ctx, platform, pixel_rad, &spectrum));
    double per_px2 = 1.0 / (pixel_rad * pixel_rad), top_hz = BST_JITTER_RESOLVED / dt_s;
    bst_jitter_spec flat = bst_jitter_resolved(&spectrum.flat, dt_s);
    bst_loop_add_band(axis, 0.0, flat.low_cutoff_hz,
                      0.5 * per_px2 * flat.low_rms_rad * flat.low_rms_rad);
    bst_loop_add_band(axis, flat.high_min_hz, flat.high_max_hz,
                      0.5 * per_px2 * flat.high_rms_rad * flat.high_rms_rad);
    double scale = per_px2 * (camera_axis == 1 ? spectrum.y_scale : 1.0);
    table_bands(&spectrum.low, scale, top_hz, axis);
    table_bands(&spectrum.high, scale, top_hz, axis);
    for (int i = 0; i < spectrum.line_count; i++) {
        const bst_jitter_line *line = &spectrum.line[i];
        if (line->axis == camera_axis && line->frequency_hz <= top_hz) {
            bst_loop_add_band(axis, line->frequency_hz, line->frequency_hz,
                              0.5 * per_px2 * line->amplitude_rad * line->amplitude_rad);
        }
    }
    bst_jitter_spectrum_free(&spectrum);
    return BST_OK;
}

/* Adds bands of the attitude knowledge error: the mount uses the estimated attitude, so that its
 * error moves the line of sight like jitter. From one per day to ten times per second. */
void bst_loop_body_bands(const bst_spacecraft_config *config, int body_axis, double pixel_rad,
                         bst_loop_axis *axis) {
    if (config->type != BST_CRAFT_RIGID_BODY) {
        return;
    }
    enum { BANDS = 60 };
    const double lowest_hz = 1e-5, ratio = pow(1e6, 1.0 / BANDS);
    double low = 0.0, high = lowest_hz;
    for (int i = 0; i <= BANDS; i++) {
        double middle = i == 0 ? 0.5 * high : sqrt(low * high);
        double density = bst_spacecraft_noise_at(config, body_axis, middle).knowledge;
        bst_loop_add_band(axis, low, high, density * (high - low) / (pixel_rad * pixel_rad));
        low = high;
        high *= ratio;
    }
}
