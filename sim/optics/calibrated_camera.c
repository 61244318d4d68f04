#include "sim/optics/calibrated_camera.h"

#include <assert.h>

bst_status bst_camera_apply_calibration(bst_ctx *ctx, const bst_camera *onboard,
                                        const bst_camera_calibration *calibration,
                                        bst_camera *out) {
    assert(onboard && calibration && out);
    bst_camera camera = *onboard;
    if (calibration->frames > 0) {
        camera.pixel_scale_arcsec *= calibration->scale;
        camera.rotation_deg += calibration->rotation_rad / BST_DEG_RAD;
        camera.distortion.k1 += calibration->k1;
        camera.distortion.p1 += calibration->p1;
        camera.distortion.p2 += calibration->p2;
        BST_TRY(bst_camera_prepare(ctx, &camera));
    }
    *out = camera;
    return BST_OK;
}
