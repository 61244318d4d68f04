/* Interface of the detector to frame stacking. */
#include <assert.h>
#include <math.h>

#include "imgproc/detect/detect_internal.h"
#include "sim/optics/photometry.h"

bst_stack_frame bst_imgproc_stack_frame(const bst_imgproc *ip, double time_s,
                                        bst_quat q_cam_from_gcrf) {
    assert(ip->left.signal);
    bst_stack_frame frame = ip->left;
    frame.time_s = time_s;
    frame.q_cam_from_gcrf = q_cam_from_gcrf;
    return frame;
}

void bst_imgproc_append_stack(const bst_imgproc *ip, const bst_stack_found *found, int count,
                              double reach_px, bst_detections *out, int capacity) {
    assert(ip && out && count >= 0 && (found || count == 0));
    assert(out->count >= 0 && out->count <= capacity && reach_px >= 0.0);
    int before = out->count;
    for (int i = 0; i < count; i++) {
        const bst_stack_found *f = &found[i];
        double reach = fmax(reach_px, 3.0 * sqrt(fmax(f->cov_xx, f->cov_yy)));
        bool known = false;
        for (int k = 0; k < before && !known; k++) {
            known = hypot(out->items[k].x_px - f->x_px, out->items[k].y_px - f->y_px) < reach;
        }
        if (known) {
            continue;
        }
        if (out->count == capacity) {
            out->lost++;
            continue;
        }
        bst_detection *d = &out->items[out->count++];
        double width = BST_FWHM_PER_SIGMA * ip->left.sigma_px * ip->left.binning;
        /* the stack is filtered with the Gaussian nearest to the PSF */
        double like = ip->known ? ip->known->like_flux : 1.0;
        *d = (bst_detection){.x_px = f->x_px,
                             .y_px = f->y_px,
                             .cov_xx = f->cov_xx,
                             .cov_xy = f->cov_xy,
                             .cov_yy = f->cov_yy,
                             .flux_e = f->flux_e / like,
                             .flux_sigma_e = f->flux_sigma_e / like,
                             .snr = f->snr,
                             .length_px = width,
                             .width_px = width,
                             .flags = BST_DETECTION_STACK,
                             .label = f->at_rest ? BST_LABEL_STAR : BST_LABEL_OBJECT,
                             .label_probability = 0.9,
                             .rate_x_pxps = f->rate_x_pxps,
                             .rate_y_pxps = f->rate_y_pxps,
                             .rate_sigma_pxps = f->rate_sigma_pxps};
        double rate = d->flux_e / fmax(ip->exposure_s, 1e-9);
        d->v_mag = -2.5 * log10(rate / ip->electrons_per_s_v0);
        d->v_mag_sigma = bst_photometry_noise_mag(d);
    }
}
