#include "imgproc/wing_labels.h"

/* Adds the catalogue stars whose wings matter, on the frame and beside it. */
static bst_status add_catalogue_stars(bst_ctx *ctx, const bst_wing_labels_input *in,
                                      bst_predicted_stars *sky, bst_psf_wings *wings,
                                      double bright_e) {
    int expected = 0;
    const bst_predicted_stars_query query = {
        in->known->q_cam_from_gcrf, &in->known->light, in->known->window, BST_WINGS_REACH_PX,
        bst_camera_v_mag(in->camera, bright_e / in->exposure_s)};
    BST_TRY(bst_predicted_stars_expect(ctx, sky, &query, &expected));
    for (int i = 0; i < expected; i++) {
        const bst_imgproc_expected_star *star = &sky->expected[i];
        bst_psf_wings_add(wings, star->x_px, star->y_px,
                          in->exposure_s * bst_camera_electrons_per_s(in->camera, star->v_mag));
    }
    return BST_OK;
}

bst_status bst_wing_labels_make(bst_ctx *ctx, const bst_wing_labels_input *in,
                                bst_predicted_stars *sky, bst_psf_wings *wings,
                                bst_detections *out) {
    double dx = 0.0, dy = 0.0;
    double bright_e = bst_psf_wings_bright_e(wings, out->noise_e / in->binning, out->threshold_snr);
    if (in->motion) {
        bst_camera_motion_streak(in->motion, in->camera, bst_camera_centre_x(in->camera),
                                 bst_camera_centre_y(in->camera), &dx, &dy);
    }
    bst_psf_wings_begin(wings, dx, dy);
    if (in->known->oriented) {
        BST_TRY(add_catalogue_stars(ctx, in, sky, wings, bright_e));
    }
    for (int i = 0; i < out->count; i++) {
        const bst_detection *d = &out->items[i];
        if ((d->flags & BST_DETECTION_SATURATED) && d->flux_e > bright_e &&
            !bst_psf_wings_holds(wings, d->x_px, d->y_px, 5.0)) {
            bst_psf_wings_add(wings, d->x_px, d->y_px, d->flux_e);
        }
    }
    bst_psf_wings_label(wings, in->ground, in->user, in->binning, out);
    return BST_OK;
}
