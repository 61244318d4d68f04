#include "imgproc/detect/plugin_detector.h"

#include <math.h>
#include <stdlib.h>

struct bst_plugin_detector {
    const bst_stage_use *use;
    const bst_detector_stage *stage;
    void *self;
    const bst_camera *camera;
    /* of the latest frame */
    double exposure_s, level_e, noise_e, streak_px;
    int binning;
};

static const char *const kinds[] = {BST_STAGE_DETECTOR, NULL};

const bst_config_desc bst_plugin_detector_table[] = {
    BST_STAGE_ALONE(kinds,
                    "A shared library with a detector, relative to the folder of the file that "
                    "says so; the other keys are then that one's. Left out: imgproc's own."),
    BST_CONFIG_END};

/* Prefixes an error of the plug-in with its name. */
static bst_status with_plugin_name(bst_ctx *ctx, const bst_plugin_detector *p, bst_status status) {
    return status == BST_OK ? BST_OK : bst_fail_prefix(ctx, status, "plug-in %s", p->use->plugin);
}

bst_status bst_plugin_detector_create(bst_ctx *ctx, const bst_stage_use *use,
                                      const bst_camera *camera, const bst_imgproc_maps *maps,
                                      int capacity, bst_plugin_detector **out) {
    const bst_detector_stage *stage = use->desc->functions;
    bst_plugin_detector *p = calloc(1, sizeof *p);
    *out = p;
    if (!p) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for a plug-in");
    }
    *p = (bst_plugin_detector){.use = use, .stage = stage, .camera = camera};
    if (!stage->create || !stage->detect || !stage->destroy) {
        return with_plugin_name(
            ctx, p,
            bst_fail(ctx, BST_ERR_CONFIG,
                     "its detector \"%s\" lacks one of create, detect and destroy",
                     use->desc->type));
    }
    const bst_detector_env env = {.camera = camera,
                                  .electrons_per_s_v0 = bst_camera_electrons_per_s(camera, 0.0),
                                  .capacity = capacity,
                                  .dark_e_per_s = maps->dark_e_per_s,
                                  .flat = maps->flat,
                                  .bad = maps->bad};
    return with_plugin_name(ctx, p, stage->create(ctx, use->config, &env, &p->self));
}

void bst_plugin_detector_free(bst_plugin_detector *p) {
    if (p && p->self) {
        p->stage->destroy(p->self);
    }
    free(p);
}

bst_status bst_plugin_detector_archive(bst_plugin_detector *p, bst_archive *archive) {
    return bst_stage_archive(archive, p->use->plugin, p->stage->archive, p->self);
}

/* qsort order of detections by position. */
static int by_position(const void *a, const void *b) {
    const bst_detection *p = a, *q = b;
    int y = (p->y_px > q->y_px) - (p->y_px < q->y_px);
    return y ? y : (p->x_px > q->x_px) - (p->x_px < q->x_px);
}

/* True if a detection's position, size and noise are finite and it lies in the window. */
static bool is_valid(const bst_detection *d, const bst_window *w) {
    return d->x_px >= w->x0 - 0.5 && d->x_px <= w->x0 + w->width - 0.5 && d->y_px >= w->y0 - 0.5 &&
           d->y_px <= w->y0 + w->height - 0.5 && d->cov_xx > 0.0 && d->cov_yy > 0.0 &&
           d->cov_xx * d->cov_yy > d->cov_xy * d->cov_xy &&
           isfinite(d->cov_xx + d->cov_yy + d->flux_e + d->flux_sigma_e + d->snr + d->length_px +
                    d->width_px + d->angle_rad) &&
           (d->label == BST_LABEL_UNKNOWN || d->label == BST_LABEL_ARTEFACT);
}

/* Checks the detections that the plug-in returned. */
static bst_status check(bst_ctx *ctx, const bst_plugin_detector *p, const bst_imgproc_frame *frame,
                        bst_detections *out, int capacity) {
    if (out->count < 0 || out->count > capacity || out->lost < 0) {
        return bst_fail(ctx, BST_ERR_STATE,
                        "plug-in %s gave %d detections and %d lost (allowed: at most %d)",
                        p->use->plugin, out->count, out->lost, capacity);
    }
    if (!(out->noise_e > 0.0 && isfinite(out->noise_e) && isfinite(out->background_e) &&
          out->threshold_snr > 0.0 && isfinite(out->threshold_snr))) {
        return bst_fail(ctx, BST_ERR_STATE,
                        "plug-in %s gave a background of %g e-, noise of %g e- and a threshold of "
                        "%g (allowed: finite numbers, noise and threshold above 0)",
                        p->use->plugin, out->background_e, out->noise_e, out->threshold_snr);
    }
    for (int i = 0; i < out->count; i++) {
        bst_detection *d = &out->items[i];
        if (!is_valid(d, &frame->window)) {
            return bst_fail(ctx, BST_ERR_STATE,
                            "plug-in %s gave a detection at (%g, %g) px, covariance %g, %g, %g "
                            "px^2, %g e-, SNR %g, label %d (allowed: a place on the window, a "
                            "positive definite covariance, finite numbers, label UNKNOWN or "
                            "ARTEFACT)",
                            p->use->plugin, d->x_px, d->y_px, d->cov_xx, d->cov_xy, d->cov_yy,
                            d->flux_e, d->snr, d->label);
        }
        d->v_mag = bst_camera_v_mag(p->camera, fmax(d->flux_e, 1e-9) / frame->exposure_s);
        d->v_mag_sigma = bst_photometry_noise_mag(d);
        d->star_id = 0;
        d->label_probability = 0.0;
        d->rate_x_pxps = d->rate_y_pxps = d->rate_sigma_pxps = 0.0;
    }
    return BST_OK;
}

bst_status bst_plugin_detector_detect(bst_ctx *ctx, bst_plugin_detector *p,
                                      const bst_imgproc_frame *frame, int64_t exposure_id,
                                      const bst_camera_motion *motion, bst_detections *out,
                                      int capacity) {
    double dx = 0.0, dy = 0.0;
    const bst_detector_frame given = {.exposure_id = exposure_id,
                                      .pixels = frame->pixels,
                                      .window = frame->window,
                                      .binning = frame->binning,
                                      .bits = frame->bits,
                                      .exposure_s = frame->exposure_s,
                                      .motion = motion};
    out->count = out->lost = 0;
    out->background_e = out->noise_e = out->threshold_snr = 0.0;
    BST_TRY(with_plugin_name(ctx, p, p->stage->detect(p->self, ctx, &given, out)));
    BST_TRY(check(ctx, p, frame, out, capacity));
    out->shared_xx = out->shared_xy = out->shared_yy = 0.0; /* depends on how it locates */
    out->stars_identified = 0;
    qsort(out->items, (size_t)out->count, sizeof out->items[0], by_position);
    if (motion) {
        bst_camera_motion_streak(motion, p->camera, bst_camera_centre_x(p->camera),
                                 bst_camera_centre_y(p->camera), &dx, &dy);
    }
    p->exposure_s = frame->exposure_s;
    p->level_e = out->background_e;
    p->noise_e = out->noise_e;
    p->binning = frame->binning;
    p->streak_px = hypot(dx, dy);
    return BST_OK;
}

double bst_plugin_detector_v_limit(const bst_plugin_detector *p, double snr) {
    /* the SNR of a Gaussian source is that of its light in 4 pi sigma^2 pixels of noise; with a
     * streak of length L, in 2 sqrt(pi) sigma (2 sqrt(pi) sigma + L) */
    double sigma = p->camera->psf_fwhm_px / 2.3548, wide = 2.0 * sqrt(BST_PI) * sigma;
    double pixels = wide * (wide + p->streak_px) / (p->binning * p->binning);
    return bst_camera_v_mag(p->camera, snr * p->noise_e * sqrt(fmax(pixels, 1.0)) / p->exposure_s);
}

double bst_plugin_detector_streak_px(const bst_plugin_detector *p) {
    return p->streak_px;
}

void bst_plugin_detector_ground(const void *plugin, double x_px, double y_px,
                                bst_psf_wings_ground *out) {
    const bst_plugin_detector *p = plugin;
    (void)x_px;
    (void)y_px;
    out->level_e = p->level_e;
    out->noise_e = p->noise_e;
}
