#include "scenegen/detector/vignetting.h"

bst_kernel_vignetting_params bst_vignetting_params(const bst_camera *camera) {
    const bst_optics_vignetting *v = &camera->optics.vignetting;
    if (v->model == BST_VIGNETTING_NONE && !(v->limit_px > 0.0)) {
        return (bst_kernel_vignetting_params){.law = BST_SHADE_NONE};
    }
    bst_kernel_vignetting_params p = {
        .law = BST_SHADE_POLYNOMIAL,
        .centre_x = (float)bst_camera_centre_x(camera),
        .centre_y = (float)bst_camera_centre_y(camera),
        .limit2 = v->limit_px > 0.0 ? (float)(v->limit_px * v->limit_px) : 1e30f};
    if (v->model == BST_VIGNETTING_COS4) {
        double scale = bst_camera_scale_rad(camera);
        p.law = BST_SHADE_COS4;
        p.v1 = (float)(scale * scale);
    } else if (v->model == BST_VIGNETTING_POLYNOMIAL) {
        double width = (double)camera->width_px, height = (double)camera->height_px;
        double s = 4.0 / (width * width + height * height);
        const double *c = v->coefficients;
        p.v1 = (float)(c[0] * s);
        p.v2 = (float)(c[1] * s * s);
        p.v3 = (float)(c[2] * s * s * s);
    }
    return p;
}
