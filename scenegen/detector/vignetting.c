#include "scenegen/detector/vignetting.h"

#include <stdio.h>

int bst_vignetting_options(const bst_camera *camera, char *text, size_t bytes) {
    const bst_optics_vignetting *v = &camera->optics.vignetting;
    if (v->model == BST_VIGNETTING_NONE && !(v->limit_px > 0.0)) {
        return snprintf(text, bytes, "%s", "");
    }
    char share[96];
    if (v->model == BST_VIGNETTING_COS4) {
        double scale = bst_camera_scale_rad(camera);
        snprintf(share, sizeof share, "-DCOS4=%.9ef", scale * scale);
    } else {
        double width = (double)camera->width_px, height = (double)camera->height_px;
        double s = 4.0 / (width * width + height * height);
        const double *c = v->coefficients;
        double on = v->model == BST_VIGNETTING_POLYNOMIAL ? 1.0 : 0.0;
        snprintf(share, sizeof share, "-DV1=%.9ef -DV2=%.9ef -DV3=%.9ef", on * c[0] * s,
                 on * c[1] * s * s, on * c[2] * s * s * s);
    }
    double limit2 = v->limit_px > 0.0 ? v->limit_px * v->limit_px : 1e30;
    return snprintf(text, bytes,
                    " -DVIGNETTING -DCENTRE_X=%.9ef -DCENTRE_Y=%.9ef -DLIMIT2=%.9ef %s",
                    bst_camera_centre_x(camera), bst_camera_centre_y(camera), limit2, share);
}
