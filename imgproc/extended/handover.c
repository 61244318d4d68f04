#include "imgproc/extended/handover.h"

#include <assert.h>

/* True if a place of the sensor lies in the silhouette's bounding box, widened by `margin_px`. */
static bool holds(const bst_extended_view *v, const bst_silhouette *s, double x_px, double y_px,
                  double margin_px) {
    double x = (x_px - v->origin_x_px) / v->binning, y = (y_px - v->origin_y_px) / v->binning;
    double margin = margin_px / v->binning;
    return x >= s->x0_px - margin && x <= s->x1_px + margin && y >= s->y0_px - margin &&
           y <= s->y1_px + margin;
}

void bst_handover_select(bst_handover *handover, const bst_silhouettes *silhouettes,
                         const bst_extended_view *view, bst_silhouettes *out,
                         bst_silhouettes *points, bst_detections *detections) {
    assert(handover && silhouettes && view && out && points && detections);
    out->count = points->count = 0;
    for (int i = 0; i < silhouettes->count; i++) {
        const bst_silhouette *s = &silhouettes->items[i];
        if (!s->masked && !(handover->extended && s->may_extend)) {
            points->items[points->count++] = *s;
            continue;
        }
        out->items[out->count++] = *s;
        for (int k = 0; k < detections->count; k++) {
            bst_detection *d = &detections->items[k];
            if (holds(view, s, d->x_px, d->y_px, view->camera->psf_fwhm_px)) {
                d->label = BST_LABEL_ARTEFACT;
                d->label_probability = 0.9;
            }
        }
    }
    handover->extended = out->count > 0;
}
