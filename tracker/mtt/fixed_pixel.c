/* Is a track an object, or a place of the sensor: defective pixels that image processing has not
 * learned so far? While the camera turns steadily, a pixel moves along the sky as evenly as an
 * object does. */
#include "tracker/mtt/multitarget_internal.h"

/* Share of a defect's detections that scatter by their errors alone. The others, displaced by
 * noise of a neighbour that is hot too or by a star that passes, lie within DISPLACED_FWHM; so
 * many are of the defect that the track was on before. */
static const double SCATTER_SHARE = 0.85, DISPLACED_SHARE = 0.1, BEFORE_SHARE = 0.05;
static const double DISPLACED_FWHM = 1.5;
/* Scatter of a defect's centroid besides its stated error, share of an image's FWHM: charge has
 * not the shape that is fitted. */
static const double SCATTER_FWHM = 0.25;

static double variance_of(const bst_mtt *m, const bst_mtt_detection *d, double fwhm_px) {
    double scatter = SCATTER_FWHM * fwhm_px, pixel = m->params.pixel_rad;
    return 0.5 * (d->sky.cov_11 + d->sky.cov_22) / (pixel * pixel) + scatter * scatter;
}

static double fwhm_of(const bst_mtt_detection *d) {
    return fmax(d->width_px, 1.0);
}

static double square_distance(const bst_mtt_detection *d, const bst_mtt_defect *from) {
    double dx = d->x_px - from->x_px, dy = d->y_px - from->y_px;
    return dx * dx + dy * dy;
}

/* Density of a detection of variance r about a defect, px^-2. */
static double density_about(const bst_mtt_detection *d, const bst_mtt_defect *defect, double r) {
    double s = defect->variance_px2 + r;
    return exp(-0.5 * square_distance(d, defect) / s) / (2.0 * BST_PI * s);
}

static void draw_to(bst_mtt_defect *defect, const bst_mtt_detection *d, double r) {
    double gain = defect->variance_px2 / (defect->variance_px2 + r);
    defect->x_px += gain * (d->x_px - defect->x_px);
    defect->y_px += gain * (d->y_px - defect->y_px);
    defect->variance_px2 *= 1.0 - gain;
}

void bst_mtt_start_fixed(const bst_mtt *m, const bst_mtt_detection *first, bst_mtt_track *track) {
    if (m->params.pixel_rad > 0.0) {
        double variance = variance_of(m, first, fwhm_of(first));
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
    double fwhm = fwhm_of(d), r = variance_of(m, d, fwhm), reach = DISPLACED_FWHM * fwhm;
    bool near = square_distance(d, &f->now) < reach * reach,
         back = !near && square_distance(d, &f->before) < reach * reach;
    double density = m->clutter_density * pixel * pixel +
                     SCATTER_SHARE * density_about(d, &f->now, r) +
                     BEFORE_SHARE * density_about(d, &f->before, r) +
                     (near ? DISPLACED_SHARE / (BST_PI * reach * reach) : 0.0);
    /* both at the same resolution: a motion that foresees a place better than a defect scatters
     * gains nothing by that */
    double most = log(SCATTER_SHARE / (2.0 * BST_PI * r));
    f->log_odds += fmin(log_density + 2.0 * log(pixel), most) - log(density);
    if (!near) {
        bst_mtt_defect now = back ? f->before : (bst_mtt_defect){d->x_px, d->y_px, r};
        f->before = f->now;
        f->now = now;
    }
    if (near || back) {
        draw_to(&f->now, d, r);
    }
}

bool bst_mtt_may_be_fixed(const bst_mtt *m, const bst_mtt_track *track) {
    return m->params.pixel_rad > 0.0 && m->bad_pixels > 0 &&
           track->fixed.log_odds < log((double)m->bad_pixels);
}
