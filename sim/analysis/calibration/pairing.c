#include "sim/analysis/calibration/pairing.h"

#include <math.h>
#include <stdlib.h>

void bst_pairing_free(bst_pairing *p) {
    free(p->detection_of);
    free(p->item_of);
    free(p->order);
    *p = (bst_pairing){0};
}

static bst_status reserve(bst_ctx *ctx, bst_pairing *p, int items, int detections) {
    if (items > p->items || detections > p->detections) {
        bst_pairing_free(p);
        p->items = 2 * items + 16;
        p->detections = 2 * detections + 16;
        p->detection_of = malloc((size_t)p->items * sizeof(int));
        p->order = malloc((size_t)p->items * sizeof(int));
        p->item_of = malloc((size_t)p->detections * sizeof(int));
        if (!p->detection_of || !p->order || !p->item_of) {
            bst_pairing_free(p);
            return bst_fail(ctx, BST_ERR_MEMORY, "no memory to pair %d sources", items);
        }
    }
    return BST_OK;
}

/* Distance of a detection from a source relative to the allowed distance; above 1: no match.
 *
 * Given:     share  of the streak's half length that is allowed besides fwhm_px */
static double off(const bst_truth_item *t, const bst_detection *d, double fwhm_px, double share) {
    double dx = d->x_px - t->x_centroid_px, dy = d->y_px - t->y_centroid_px;
    double lx = t->x_end_px - t->x_start_px, ly = t->y_end_px - t->y_start_px;
    double length = hypot(lx, ly), c = length > 0.0 ? lx / length : 1.0,
           s = length > 0.0 ? ly / length : 0.0;
    double along = (dx * c + dy * s) / (fwhm_px + 0.5 * share * length), across = dy * c - dx * s;
    return hypot(along, across / fwhm_px);
}

/* Gives the sources without a detection, the brightest first, the nearest free one. */
static void take(bst_pairing *p, const bst_truth *truth, const bst_detections *detections,
                 int count, double fwhm_px, double share) {
    for (int k = 0; k < count; k++) {
        int item = p->order[k];
        const bst_truth_item *t = &truth->items[item];
        double nearest = 1.0,
               length = hypot(t->x_end_px - t->x_start_px, t->y_end_px - t->y_start_px);
        double reach = fwhm_px + 0.5 * share * length;
        int best = p->detection_of[item];
        for (int i = 0; i < detections->count && p->detection_of[item] < 0; i++) {
            const bst_detection *d = &detections->items[i];
            if (p->item_of[i] >= 0 || fabs(d->x_px - t->x_centroid_px) > reach ||
                fabs(d->y_px - t->y_centroid_px) > reach) {
                continue;
            }
            double distance = off(t, d, fwhm_px, share);
            if (distance < nearest) {
                nearest = distance;
                best = i;
            }
        }
        if (best >= 0) {
            p->detection_of[item] = best;
            p->item_of[best] = item;
        }
    }
}

bst_status bst_pairing_make(bst_ctx *ctx, bst_pairing *p, const bst_truth *truth,
                            const bst_detections *detections, double fwhm_px) {
    BST_TRY(reserve(ctx, p, truth->count, detections->count));
    int n = 0;
    for (int i = 0; i < truth->count; i++) {
        const bst_truth_item *t = &truth->items[i];
        p->detection_of[i] = -1;
        bool shows = (t->flags & BST_TRUTH_IN_FIELD) && !(t->flags & BST_TRUTH_OCCULTED) &&
                     t->snr > 0.0 && isfinite(t->x_start_px) && isfinite(t->x_end_px);
        if (!shows) {
            continue;
        }
        int at = n++; /* insertion by brightness: the catalogue is almost sorted */
        while (at > 0 && truth->items[p->order[at - 1]].snr < t->snr) {
            p->order[at] = p->order[at - 1];
            at--;
        }
        p->order[at] = i;
    }
    for (int i = 0; i < detections->count; i++) {
        p->item_of[i] = -1;
    }
    /* A streak takes what is at its middle first: another one's detection, half a length away, may
     * be that of a fainter source. */
    take(p, truth, detections, n, fwhm_px, 0.0);
    take(p, truth, detections, n, fwhm_px, 1.0);
    return BST_OK;
}
