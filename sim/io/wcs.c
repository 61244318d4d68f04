#include "sim/io/wcs.h"

#include <assert.h>
#include <math.h>

#include "sim/core/invariant.h"
#include "sim/io/tangent.h"

#define GRID 9
#define DEG (180.0 / BST_PI)

/* A grid point: offset from the boresight (px) and catalogue direction. */
typedef struct sample {
    double dx, dy;
    bst_vec3 icrs;
} sample;

/* Fits (xi, eta) = offset + cd * (dx, dy). The grid is symmetric about the boresight: the normal
 * equations are diagonal. */
static bool fit_plane(const bst_io_sky_plane *t, const sample *samples, double offset[2],
                      double cd[2][2]) {
    double sum[2] = {0, 0}, sx[2] = {0, 0}, sy[2] = {0, 0}, sxx = 0, syy = 0;
    for (int i = 0; i < GRID * GRID; i++) {
        double p[2];
        if (!bst_io_sky_to_plane(t, samples[i].icrs, &p[0], &p[1])) {
            return false;
        }
        sxx += samples[i].dx * samples[i].dx;
        syy += samples[i].dy * samples[i].dy;
        for (int k = 0; k < 2; k++) {
            sum[k] += p[k];
            sx[k] += p[k] * samples[i].dx;
            sy[k] += p[k] * samples[i].dy;
        }
    }
    for (int k = 0; k < 2; k++) {
        offset[k] = sum[k] / (GRID * GRID);
        cd[k][0] = sx[k] / sxx;
        cd[k][1] = sy[k] / syy;
    }
    return true;
}

static bst_status too_wide(bst_ctx *ctx) {
    return bst_fail(ctx, BST_ERR_NUMERIC,
                    "no tangent-plane coordinate system fits a field this wide; reduce the "
                    "pixel scale or the number of pixels");
}

/* Fits the WCS with SIP distortion to a camera with lens distortion. */
static bst_status fit_distorted(bst_ctx *ctx, const bst_camera *camera, bst_quat q_cam_from_gcrf,
                                const bst_light *light, bst_wcs *out) {
    double crval[2], cd[2][2];
    *out =
        (bst_wcs){.crpix = {bst_camera_centre_x(camera) + 1.0, bst_camera_centre_y(camera) + 1.0}};
    if (!bst_sip_fit(camera, q_cam_from_gcrf, light, crval, cd, &out->sip, &out->residual_px)) {
        return too_wide(ctx);
    }
    for (int i = 0; i < 2; i++) {
        out->crval_deg[i] = crval[i] * DEG;
        for (int j = 0; j < 2; j++) {
            out->cd_deg[i][j] = cd[i][j] * DEG;
        }
    }
    return BST_OK;
}

bst_status bst_wcs_fit(bst_ctx *ctx, const bst_camera *camera, bst_quat q_cam_from_gcrf,
                       const bst_light *light, bst_wcs *out) {
    assert(camera && light && out && bst_is_unit_quat(q_cam_from_gcrf, BST_LINK_UNIT_TOLERANCE));
    if (bst_camera_distorted(camera)) {
        return fit_distorted(ctx, camera, q_cam_from_gcrf, light, out);
    }
    bst_quat q_gcrf_from_cam = bst_quat_conj(q_cam_from_gcrf);
    double cx = bst_camera_centre_x(camera), cy = bst_camera_centre_y(camera);
    /* a sensor one pixel wide still needs a grid of non-zero width */
    double half_x = fmax(fmax(cx, (double)(camera->width_px - 1) - cx), 1.0);
    double half_y = fmax(fmax(cy, (double)(camera->height_px - 1) - cy), 1.0);
    sample samples[GRID * GRID];
    for (int i = 0; i < GRID * GRID; i++) {
        sample *s = &samples[i];
        s->dx = half_x * (2.0 * (i % GRID) / (GRID - 1) - 1.0);
        s->dy = half_y * (2.0 * (i / GRID) / (GRID - 1) - 1.0);
        bst_vec3 cam = bst_camera_unproject(camera, cx + s->dx, cy + s->dy);
        s->icrs = bst_light_catalogue_star(light, bst_quat_rotate(q_gcrf_from_cam, cam));
    }
    double ra, dec, offset[2], cd[2][2];
    bst_vec3_to_radec(samples[GRID * GRID / 2].icrs, &ra, &dec);
    bool good = true;
    /* shifting the tangent point by the mean offset converges at once: two iterations and a
     * check */
    for (int round = 0; round < 3 && good; round++) {
        bst_io_sky_plane t = bst_io_sky_plane_at(ra, dec);
        good = fit_plane(&t, samples, offset, cd);
        if (good && round < 2) {
            bst_vec3_to_radec(bst_io_sky_from_plane(&t, offset[0], offset[1]), &ra, &dec);
        }
    }
    double det = good ? cd[0][0] * cd[1][1] - cd[0][1] * cd[1][0] : 0.0;
    if (!good || !(fabs(det) > 0.0)) {
        return too_wide(ctx);
    }
    bst_io_sky_plane t = bst_io_sky_plane_at(ra, dec);
    double worst = 0.0;
    for (int i = 0; i < GRID * GRID; i++) {
        double xi, eta;
        if (!bst_io_sky_to_plane(&t, samples[i].icrs, &xi, &eta)) {
            return bst_fail(ctx, BST_ERR_NUMERIC, "the field is too wide for one tangent plane");
        }
        double ex = (cd[1][1] * xi - cd[0][1] * eta) / det - samples[i].dx;
        double ey = (cd[0][0] * eta - cd[1][0] * xi) / det - samples[i].dy;
        worst = fmax(worst, hypot(ex, ey));
    }
    *out = (bst_wcs){.crpix = {cx + 1.0, cy + 1.0},
                     .crval_deg = {ra * DEG, dec * DEG},
                     .cd_deg = {{cd[0][0] * DEG, cd[0][1] * DEG}, {cd[1][0] * DEG, cd[1][1] * DEG}},
                     .residual_px = worst};
    return BST_OK;
}

double bst_wcs_distortion_misfit_px(const bst_camera *camera) {
    /* observer at rest; the Sun behind the camera (which looks along z) does not deflect light */
    const bst_light at_rest = {.sun_m = {0.0, 0.0, -BST_AU_M}};
    const bst_quat q = {0.0, 0.0, 0.0, 1.0};
    double crval[2], cd[2][2], misfit;
    bst_sip sip;
    if (!bst_camera_distorted(camera)) {
        return 0.0;
    }
    return bst_sip_fit(camera, q, &at_rest, crval, cd, &sip, &misfit) ? misfit : INFINITY;
}

bst_wcs bst_wcs_window(const bst_wcs *wcs, bst_window window, int binning) {
    assert(wcs && binning >= 1);
    bst_wcs w = *wcs;
    double b = binning > 1 ? binning : 1;
    /* FITS pixel p of the full sensor covers (p - 0.5, p + 0.5) */
    w.crpix[0] = (wcs->crpix[0] - 0.5 - window.x0) / b + 0.5;
    w.crpix[1] = (wcs->crpix[1] - 0.5 - window.y0) / b + 0.5;
    w.residual_px /= b;
    bst_sip_bin(&w.sip, b);
    for (int i = 0; i < 2; i++) {
        for (int j = 0; j < 2; j++) {
            w.cd_deg[i][j] *= b;
        }
    }
    return w;
}

bool bst_wcs_sky_to_px(const bst_wcs *wcs, double ra_rad, double dec_rad, double *x_px,
                       double *y_px) {
    bst_io_sky_plane t = bst_io_sky_plane_at(wcs->crval_deg[0] / DEG, wcs->crval_deg[1] / DEG);
    double xi, eta;
    if (!bst_io_sky_to_plane(&t, bst_vec3_from_radec(ra_rad, dec_rad), &xi, &eta)) {
        return false;
    }
    const double(*m)[2] = wcs->cd_deg;
    double det = (m[0][0] * m[1][1] - m[0][1] * m[1][0]) / DEG;
    double u = (m[1][1] * xi - m[0][1] * eta) / det, v = (m[0][0] * eta - m[1][0] * xi) / det;
    bst_sip_distort(&wcs->sip, u, v, &u, &v);
    *x_px = u + wcs->crpix[0] - 1.0;
    *y_px = v + wcs->crpix[1] - 1.0;
    return true;
}

void bst_wcs_px_to_sky(const bst_wcs *wcs, double x_px, double y_px, double *ra_rad,
                       double *dec_rad) {
    bst_io_sky_plane t = bst_io_sky_plane_at(wcs->crval_deg[0] / DEG, wcs->crval_deg[1] / DEG);
    double dx, dy;
    bst_sip_undistort(&wcs->sip, x_px + 1.0 - wcs->crpix[0], y_px + 1.0 - wcs->crpix[1], &dx, &dy);
    const double(*m)[2] = wcs->cd_deg;
    bst_vec3_to_radec(bst_io_sky_from_plane(&t, (m[0][0] * dx + m[0][1] * dy) / DEG,
                                            (m[1][0] * dx + m[1][1] * dy) / DEG),
                      ra_rad, dec_rad);
}
