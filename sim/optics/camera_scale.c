/* Computes pixel scale, focal length and pixel pitch of a camera from those given. */
#include "boresight/camera.h"

/* tolerance of redundant values: data sheets have three digits or more */
static const double AGREES = 1e-3;

/* True if two values of a camera parameter agree. */
static bool agree(double a, double b) {
    return fabs(a - b) <= AGREES * fmax(fabs(a), fabs(b));
}

/* Fails: two settings of the camera give different values. */
static bst_status contradict(bst_ctx *ctx, const char *first, double a, const char *second,
                             double b, const char *unit) {
    return bst_fail(
        ctx, BST_ERR_CONFIG,
        "%s gives %.9g %s, but %s gives %.9g %s; give one of them, or values that agree "
        "to a thousandth",
        first, a, unit, second, b, unit);
}

/* Checks a focal ratio or pitch that two blocks give. */
static bst_status same_as(bst_ctx *ctx, const char *key, double given, const char *other_key,
                          double other, const char *unit) {
    return isnan(given) || !(other > 0.0) || agree(given, other)
               ? BST_OK
               : contradict(ctx, key, given, other_key, other, unit);
}

/* Focal length, given or from the focal ratio; NAN: neither is given. */
static bst_status focal_length(bst_ctx *ctx, bst_camera *c) {
    if (isnan(c->f_number)) {
        return BST_OK;
    }
    double by_ratio = c->f_number * c->aperture_m;
    if (isnan(c->focal_length_m)) {
        c->focal_length_m = by_ratio;
    }
    return agree(c->focal_length_m, by_ratio)
               ? BST_OK
               : contradict(ctx, "focal_length_m", c->focal_length_m, "f_number times aperture_m",
                            by_ratio, "m");
}

bst_status bst_camera_resolve_scale(bst_ctx *ctx, bst_camera *c) {
    BST_TRY(focal_length(ctx, c));
    double pitch_m = 1e-6 * c->pixel_pitch_um;
    double by_focal_arcsec = pitch_m / c->focal_length_m / BST_ARCSEC_RAD;
    if (isnan(c->pixel_scale_arcsec) && isnan(by_focal_arcsec)) {
        return bst_fail(
            ctx, BST_ERR_CONFIG,
            "the pixel scale is missing: give pixel_scale_arcsec, or pixel_pitch_um and "
            "focal_length_m, or pixel_pitch_um and f_number");
    }
    if (isnan(c->pixel_scale_arcsec)) {
        c->pixel_scale_arcsec = by_focal_arcsec;
        if (!(by_focal_arcsec >= 1e-3 && by_focal_arcsec <= 600.0)) {
            return bst_fail(
                ctx, BST_ERR_CONFIG,
                "pixel_pitch_um over the focal length gives a pixel scale of %.6g arcsec "
                "(allowed: 0.001 to 600)",
                by_focal_arcsec);
        }
    } else if (!isnan(by_focal_arcsec) && !agree(c->pixel_scale_arcsec, by_focal_arcsec)) {
        return contradict(ctx, "pixel_scale_arcsec", c->pixel_scale_arcsec,
                          "pixel_pitch_um over the focal length", by_focal_arcsec, "arcsec");
    }
    double scale_rad = c->pixel_scale_arcsec * BST_ARCSEC_RAD;
    if (isnan(c->focal_length_m)) {
        c->focal_length_m = pitch_m / scale_rad;
    }
    if (isnan(c->pixel_pitch_um)) {
        c->pixel_pitch_um = 1e6 * scale_rad * c->focal_length_m;
    }
    if (isnan(c->f_number)) {
        c->f_number = c->focal_length_m / c->aperture_m;
    }
    BST_TRY(same_as(ctx, "f_number", c->f_number, "optics/f_number", c->optics.f_number, ""));
    BST_TRY(same_as(ctx, "pixel_pitch_um", c->pixel_pitch_um, "optics/pixel_pitch_um",
                    c->optics.pixel_pitch_um, "um"));
    return same_as(ctx, "pixel_pitch_um", c->pixel_pitch_um, "background/pixel_pitch_um",
                   c->background.pixel_pitch_um, "um");
}
