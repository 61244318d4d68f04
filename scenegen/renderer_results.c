/* What a renderer knows after a frame: state, saturation, statistics. */
#include <assert.h>
#include <math.h>

#include "scenegen/renderer_internal.h"

bool bst_renderer_is_predictable(const bst_renderer *r) {
    const bst_renderer_options *o = &r->options;
    return o->temporal_oversample <= 0 && o->spatial_oversample <= 0 &&
           !(r->fourier && o->fft_taps == 4);
}

bst_status bst_renderer_archive(bst_renderer *r, bst_archive *archive) {
    assert(r && archive);
    r->set = bst_upload_ring_archive(r->stage, archive);
    BST_TRY(bst_readout_archive(r->readout, archive));
    return bst_saturation_count_archive(&r->saturation, r->stage, archive);
}

void bst_renderer_inherit(bst_renderer *r, bst_renderer *before) {
    assert(r && before);
    bst_readout_inherit(r->readout, before->readout);
}

bst_status bst_renderer_saturated(bst_ctx *ctx, bst_renderer *r, long long *pixels) {
    for (int i = 1; i <= BST_STAGE_SETS; i++) { /* the latest last */
        BST_TRY(bst_saturation_count_frame(ctx, &r->saturation, r->stage,
                                           (r->set + i) % BST_STAGE_SETS));
    }
    *pixels = r->saturation.pixels;
    return BST_OK;
}

bst_status bst_renderer_flags(bst_ctx *ctx, bst_renderer *r, size_t pixels, uint8_t *out) {
    return bst_detector_flags(ctx, r->detector, pixels, out);
}

long long bst_renderer_saturated_frames(const bst_renderer *r) {
    return r->saturation.frames;
}

void bst_renderer_get_stats(bst_renderer *r, bst_render_stats *out) {
    *out = r->stats;
    if (!r->summed) {
        out->predicted_sigma = bst_scene_plan_error_sigma(&r->plan, r->smear, r->budget);
    }
    out->predicted_sigma = bst_renderer_is_predictable(r) ? out->predicted_sigma : NAN;
    out->tolerance_missed = out->predicted_sigma > r->options.tolerance_sigma;
}

double bst_renderer_peak_e(const bst_renderer *r, int index) {
    assert(r && index >= 0);
    return r->rolled ? r->rolled_peak_e[index] : r->plan.peak_e[index];
}

int bst_renderer_margin_px(const bst_renderer *r) {
    return r->fourier ? bst_fourier_render_margin_px(r->fourier) : r->taps / 2 + 1;
}
