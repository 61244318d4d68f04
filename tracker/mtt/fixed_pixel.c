/* Tests whether a track consists of detections of defective pixels that image processing has not
 * learned yet. While the camera turns steadily, a fixed pixel moves along the sky as uniformly as
 * an object. */
#include "tracker/mtt/multitarget_internal.h"

/* Shares of a defect's detections; their sum is 1. SCATTER: within the centroid error. DISPLACED:
 * displaced by a hot neighbour pixel or a passing star, within DISPLACED_FWHM, the distance at
 * which images do not separate two sources; 3 and 14 % at FWHM 1.5 and 2 px with a star per 1300
 * px^2 (tests/imgproc/calibrate_charge.c). BEFORE: of the track's previous defect, design choice.
 * Half or twice a share changes the logarithm of the odds by up to 0.7 per detection of its kind; a
 * defect's other detections add about five each. */
static const double SCATTER_SHARE = 0.85, DISPLACED_SHARE = 0.1, BEFORE_SHARE = 0.05;
static const double DISPLACED_FWHM = 1.5;
/* Additional scatter of a defect's centroid, share of the FWHM: charge does not have the fitted PSF
 * shape, and faint stars pull it. RMS with noise, at FWHM 1.5 and 2 px: 0.1 alone, 0.17 and 0.33
 * with a star per 1300 px^2 (tests/imgproc/calibrate_charge.c). */
static const double SCATTER_FWHM = 0.25;

/* Variance of a detection's pixel position about a defect, px^2 per axis. */
static double defect_scatter(const bst_mtt *m, const bst_mtt_detection *d, double fwhm_px) {
    double scatter = SCATTER_FWHM * fwhm_px, pixel = m->params.pixel_rad;
    return 0.5 * (d->sky.cov_11 + d->sky.cov_22) / (pixel * pixel) + scatter * scatter;
}

/* FWHM of a detection across its path, at least 1 px. */
static double fwhm_of(const bst_mtt_detection *d) {
    return fmax(d->width_px, 1.0);
}

/* Squared distance of a detection from a defect, px^2. */
static double square_distance(const bst_mtt_detection *d, const bst_mtt_defect *from) {
    double dx = d->x_px - from->x_px, dy = d->y_px - from->y_px;
    return dx * dx + dy * dy;
}

/* Probability density of a detection about a defect, px^-2; r: variance of the detection, px^2. */
static double density_about(const bst_mtt_detection *d, const bst_mtt_defect *defect, double r) {
    double s = defect->variance_px2 + r;
    return exp(-0.5 * square_distance(d, defect) / s) / (2.0 * BST_PI * s);
}

/* Kalman update of a defect's position with a detection of variance r. */
static void update_defect_position(bst_mtt_defect *defect, const bst_mtt_detection *d, double r) {
    double gain = defect->variance_px2 / (defect->variance_px2 + r);
    defect->x_px += gain * (d->x_px - defect->x_px);
    defect->y_px += gain * (d->y_px - defect->y_px);
    defect->variance_px2 *= 1.0 - gain;
}

void bst_mtt_start_fixed(const bst_mtt *m, const bst_mtt_detection *first, bst_mtt_track *track) {
    if (m->params.pixel_rad > 0.0) {
        double variance = defect_scatter(m, first, fwhm_of(first));
        bst_mtt_defect defect = {first->x_px, first->y_px, variance};
        track->fixed = (bst_mtt_fixed){.now = defect, .before = defect};
    }
}

void bst_mtt_note_fixed(const bst_mtt *m, const bst_mtt_detection *d, double log_density,
                        bst_mtt_track *track) {
    double pixel = m->params.pixel_rad;
    if (!(pixel > 0.0)) {
        return;
    }
    bst_mtt_fixed *f = &track->fixed;
    double fwhm = fwhm_of(d), r = defect_scatter(m, d, fwhm), reach = DISPLACED_FWHM * fwhm;
    bool near = square_distance(d, &f->now) < reach * reach,
         back = !near && square_distance(d, &f->before) < reach * reach;
    double density = m->clutter_density * pixel * pixel +
                     SCATTER_SHARE * density_about(d, &f->now, r) +
                     BEFORE_SHARE * density_about(d, &f->before, r) +
                     (near ? DISPLACED_SHARE / (BST_PI * reach * reach) : 0.0);
    /* equal resolution for both: a motion model more precise than a defect's scatter must gain
     * nothing by it */
    double most = log(SCATTER_SHARE / (2.0 * BST_PI * r));
    f->log_odds += fmin(log_density + 2.0 * log(pixel), most) - log(density);
    if (!near) {
        bst_mtt_defect now = back ? f->before : (bst_mtt_defect){d->x_px, d->y_px, r};
        f->before = f->now;
        f->now = now;
    }
    if (near || back) {
        update_defect_position(&f->now, d, r);
    }
}

bool bst_mtt_may_be_fixed(const bst_mtt *m, const bst_mtt_track *track) {
    return m->params.pixel_rad > 0.0 && m->bad_pixels > 0 &&
           track->fixed.log_odds < log((double)m->bad_pixels);
}
