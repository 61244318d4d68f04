#include "imgproc/measure/same_streak.h"

#include <assert.h>
#include <math.h>

/* True if two streaks are fits of the same light: one line, of which they share more
 * than half of the shorter one. */
static bool is_same_streak(const bst_locate_frame *f, const bst_imgproc_shape *a,
                           const bst_imgproc_shape *b) {
    double length = fmax(hypot(a->dx_px, a->dy_px), 1e-6);
    double c = a->dx_px / length, s = a->dy_px / length;
    double ex = b->x_px - a->x_px, ey = b->y_px - a->y_px;
    double across = fabs(c * ey - s * ex), end = 0.5 * fabs(c * b->dy_px - s * b->dx_px);
    double along = fabs(c * ex + s * ey);
    /* two lines within the FWHM are one to the fit */
    double apart = BST_FWHM_PER_SIGMA * f->sigma_px;
    /* they share (length + other) / 2 - along, more than half of the shorter one */
    double longer = fmax(length, hypot(b->dx_px, b->dy_px));
    return along < 0.5 * longer && across < apart && end < apart;
}

bool bst_same_streak_found(const bst_imgproc_locator *l, const bst_locate_frame *f, int i,
                           const bst_imgproc_shape *streak) {
    for (int k = 0; k < l->count; k++) {
        const bst_imgproc_found *o = &l->found[k];
        if (k != i && o->streak && !o->dropped && is_same_streak(f, &o->source.shape, streak)) {
            return true;
        }
    }
    return false;
}

void bst_locate_join_streaks(bst_imgproc_locator *l, const bst_locate_frame *f) {
    assert(l && f);
    for (int i = 1; i < l->count; i++) {
        bst_imgproc_found *fainter = &l->found[i];
        for (int k = 0; fainter->own_streak && !fainter->dropped && k < i; k++) {
            const bst_imgproc_found *o = &l->found[k];
            fainter->dropped = o->own_streak && !o->dropped &&
                               is_same_streak(f, &o->source.shape, &fainter->source.shape);
        }
    }
}
