#include "obsgen/identify.h"

#include <assert.h>
#include <math.h>

#include "sim/optics/photometry.h"

/* Parameters of image processing's star identification: voters of each kind, vote cell, chance
 * probability, search radius for a known pointing error. */
enum { VOTERS = 150 };
static const double CELL_PX = 2.0, CHANCE = 0.01, LOCKED_RADIUS_PX = 10.0;
/* Share of star-detection pairs consistent in magnitude by chance. */
static const double CONSISTENT_SHARE = 0.4;
/* Streams of random draws, beyond those of the generator. */
static const uint64_t IDENTIFY = (uint64_t)1 << 42;

/* True if the magnitudes of a detection and a star are consistent. */
static bool consistent(const bst_detection *d, double v_mag) {
    double limit = 1.0 + 3.0 * fmin(bst_photometry_noise_mag(d), 1.0), excess = d->v_mag - v_mag;
    bool cut = (d->flags & (BST_DETECTION_SATURATED | BST_DETECTION_EDGE)) != 0;
    return excess > -limit && excess < (cut ? limit + 2.5 : limit);
}

/* Probability that a Poisson variable is k or more. */
static double poisson_tail(double mean, int k) {
    double term = exp(-mean), below = 0.0;
    for (int i = 0; i < k; i++) {
        below += term;
        term *= mean / (i + 1);
    }
    double sum = 0.0;
    for (int i = k; i < k + 100; i++) {
        sum += term;
        term *= mean / (i + 1);
    }
    return k <= 0 ? 1.0 : fmin(fmax(sum, 0.0), 1.0 - (below > 1.0 ? 1.0 : 0.0));
}

/* Distance between a star's positions in the onboard and true catalogue, px; INFINITY if it is not
 * in the onboard one. */
static bst_status catalogue_offset_px(bst_ctx *ctx, const bst_identify_options *o,
                                      const bst_truth *truth, const bst_truth_item *item,
                                      double *off) {
    *off = INFINITY;
    if (item->kind != BST_SOURCE_STAR || (item->id & UINT32_C(0x80000000)) ||
        item->v_mag > o->v_limit) {
        return BST_OK;
    }
    *off = 0.0;
    if (o->catalogue == o->world_catalogue) {
        return BST_OK;
    }
    bst_star star;
    const bst_star_epoch epoch = {o->julian_year, truth->sun_m};
    bst_status status = bst_stars_find_seen(ctx, o->catalogue, item->id, &epoch, &star);
    if (status == BST_ERR_NOT_FOUND) {
        *off = INFINITY;
        return BST_OK;
    }
    BST_TRY(status);
    bst_vec3 true_place = bst_vec3_from_radec(item->ra_rad, item->dec_rad);
    *off = bst_vec3_angle(true_place, star.icrs) / (truth->pixel_scale_arcsec * BST_ARCSEC_RAD);
    return BST_OK;
}

/* True if enough stars match within the radius for a significant identification. */
static bool is_significant(const bst_identify_options *o, const bst_generator_frame *f,
                           double radius_px, int agreeing, int count) {
    if (o->shift_px > radius_px) {
        return false;
    }
    int votes = agreeing < VOTERS ? agreeing : VOTERS, seen = count < VOTERS ? count : VOTERS;
    double search = 2.0 * radius_px;
    double wide = f->window.width + search, high = f->window.height + search;
    double inner = (double)f->window.width * f->window.height;
    double stars = fmin(votes * wide * high / inner, VOTERS);
    double mean = CONSISTENT_SHARE * stars * seen * 4.0 * CELL_PX * CELL_PX / (wide * high);
    double trials = fmax(search * search / (4.0 * CELL_PX * CELL_PX), 1.0);
    return votes > 0 && trials * poisson_tail(mean, votes) < CHANCE;
}

/* False identification: another source on an undetected star of its brightness. */
static bst_status misidentify(bst_ctx *ctx, const bst_identify_options *o,
                              const bst_generator_frame *f, const bst_obsgen_generated *generated,
                              int count, bst_detection *d) {
    /* 4 sigma with the least floor, 0.25 px, of images (imgproc/identify/starid.c) */
    double tolerance = fmin(o->match_tolerance_px, 4.0 * sqrt(d->cov_xx + d->cov_yy + 0.0625)),
           nearest = tolerance;
    const bst_truth *t = f->truth;
    for (int i = 0; i < t->count; i++) {
        const bst_truth_item *item = &t->items[i];
        double distance = hypot(item->x_centroid_px - d->x_px, item->y_centroid_px - d->y_px), off;
        if (!(distance < nearest) || !consistent(d, item->v_mag)) {
            continue;
        }
        bool seen = false;
        for (int k = 0; k < count && !seen; k++) {
            seen = generated[k].item == i;
        }
        BST_TRY(catalogue_offset_px(ctx, o, t, item, &off));
        if (!seen && distance + off < nearest) {
            nearest = distance;
            d->star_id = item->id;
            d->label = BST_LABEL_STAR;
        }
    }
    return BST_OK;
}

bst_status bst_obsgen_identify(bst_ctx *ctx, const bst_identify_options *o,
                               const bst_generator_frame *f, const bst_obsgen_generated *generated,
                               bst_detection *items, int count, int *identified) {
    assert(o && f && identified && count >= 0 && ((generated && items) || count == 0));
    const bst_truth *t = f->truth;
    int found = 0;
    *identified = 0;
    for (int i = 0; i < count; i++) {
        bst_detection *d = &items[i];
        double off = INFINITY;
        if (generated[i].item >= 0) {
            BST_TRY(catalogue_offset_px(ctx, o, t, &t->items[generated[i].item], &off));
        }
        double tolerance = fmin(o->match_tolerance_px, 4.0 * sqrt(d->cov_xx + d->cov_yy + 0.0625));
        if (off < tolerance && d->label == BST_LABEL_UNKNOWN &&
            consistent(d, t->items[generated[i].item].v_mag)) {
            d->star_id = t->items[generated[i].item].id;
            d->label = BST_LABEL_STAR;
            found++;
        }
    }
    bool known = (o->locked && is_significant(o, f, LOCKED_RADIUS_PX, found, count)) ||
                 is_significant(o, f, o->search_radius_px, found, count);
    for (int i = 0; i < count; i++) {
        bst_detection *d = &items[i];
        if (d->label == BST_LABEL_STAR) {
            uint64_t draw = IDENTIFY + d->star_id;
            bool kept =
                known && bst_rng_uniform(o->key, (uint64_t)t->exposure_id, draw) < o->probability;
            d->label = kept ? BST_LABEL_STAR : BST_LABEL_UNKNOWN;
            d->star_id = kept ? d->star_id : 0;
        } else if (known && d->label == BST_LABEL_UNKNOWN && generated[i].item < 0) {
            BST_TRY(misidentify(ctx, o, f, generated, count, d));
        }
        *identified += d->label == BST_LABEL_STAR;
    }
    return BST_OK;
}
