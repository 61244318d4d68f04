#include "obsgen/lost_attitude.h"

#include <assert.h>

/* What a frame needs to be solved: docs/results/lost_in_space.md, 99 to 100 % of such frames are.
 */
static const double LEAST_SNR = 8.0;
enum { LEAST_STARS = 6 };

bst_obsgen_lost bst_obsgen_lost_begin(bool unknown_at_start, int64_t lost_after_frames) {
    return (bst_obsgen_lost){.unknown_at_start = unknown_at_start,
                             .lost_after_frames = lost_after_frames,
                             .lost = unknown_at_start,
                             .error = BST_QUAT_IDENTITY};
}

bool bst_obsgen_lost_enabled(const bst_obsgen_lost *lost) {
    return lost->unknown_at_start || lost->lost_after_frames > 0;
}

void bst_obsgen_lost_archive(bst_obsgen_lost *lost, bst_archive *archive) {
    if (!bst_obsgen_lost_enabled(lost)) {
        return;
    }
    bst_archive_bool(archive, &lost->lost);
    bst_archive_bool(archive, &lost->known);
    BST_ARCHIVE(archive, lost->error);
    BST_ARCHIVE(archive, lost->frames_without_stars);
}

/* Identifies stars without an attitude; labels nothing if there are too few. */
static bst_status solve(bst_ctx *ctx, const bst_identify_options *given,
                        const bst_generator_frame *frame, const bst_obsgen_generated *generated,
                        bst_detections *out) {
    bst_identify_options options = *given;
    options.locked = true;
    options.shift_px = 0.0;
    BST_TRY(bst_obsgen_identify(ctx, &options, frame, generated, out->items, out->count,
                                &out->stars_identified));
    int bright = 0;
    for (int i = 0; i < out->count; i++) {
        bright += out->items[i].label == BST_LABEL_STAR && out->items[i].snr >= LEAST_SNR;
    }
    if (bright >= LEAST_STARS) {
        out->q_cam_from_gcrf = frame->truth->q_cam_from_gcrf_mean;
        return BST_OK;
    }
    for (int i = 0; i < out->count; i++) {
        if (out->items[i].label == BST_LABEL_STAR) {
            out->items[i].label = BST_LABEL_UNKNOWN;
            out->items[i].star_id = 0;
        }
    }
    out->stars_identified = 0;
    return BST_OK;
}

/* Counts a frame without stars; after enough of them the attitude is unknown. */
static void count_frame(bst_obsgen_lost *lost, struct bst_step *step) {
    lost->frames_without_stars++;
    if (!lost->lost && lost->lost_after_frames > 0 &&
        lost->frames_without_stars >= lost->lost_after_frames) {
        lost->lost = true;
        bst_step_event(step, "attitude_unknown", "no star identified in %lld frames",
                       (long long)lost->frames_without_stars);
    }
}

bst_status bst_obsgen_lost_identify(bst_obsgen_lost *lost, struct bst_step *step,
                                    const bst_identify_options *options,
                                    const bst_generator_frame *frame,
                                    const bst_obsgen_generated *generated, bst_detections *out) {
    assert(lost && step && options && frame && out);
    bst_ctx *ctx = bst_step_ctx(step);
    bool solved = false, blind = lost->lost && !lost->known && lost->unknown_at_start;
    if (!blind) {
        BST_TRY(bst_obsgen_identify(ctx, options, frame, generated, out->items, out->count,
                                    &out->stars_identified));
    }
    if (!bst_obsgen_lost_enabled(lost)) {
        return BST_OK;
    }
    if (lost->lost && out->stars_identified == 0) {
        BST_TRY(solve(ctx, options, frame, generated, out));
        solved = out->stars_identified > 0;
    }
    if (out->stars_identified == 0) {
        count_frame(lost, step);
        return BST_OK;
    }
    lost->error =
        bst_quat_mul(bst_quat_conj(out->q_telemetry_from_gcrf), frame->truth->q_cam_from_gcrf_mean);
    lost->known = true;
    lost->lost = false;
    lost->frames_without_stars = 0;
    if (solved) {
        bst_step_event(step, "attitude_found", "telemetry off by %.4f deg, %d stars",
                       bst_vec3_norm(bst_quat_to_rotvec(lost->error)) / BST_DEG_RAD,
                       out->stars_identified);
    }
    return BST_OK;
}
