#include "imgproc/identify/predicted_stars.h"
#include "sim/core/pages.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>

static const double BRIGHTEST_V = -2.0;

bst_status bst_predicted_stars_create(bst_ctx *ctx, const bst_camera *camera,
                                      const bst_stars *stars, double julian_year, int capacity,
                                      bst_predicted_stars *out) {
    assert(camera && stars && out && capacity > 0);
    *out = (bst_predicted_stars){
        .camera = camera, .stars = stars, .julian_year = julian_year, .capacity = capacity};
    out->found = bst_pages_zero((size_t)capacity, sizeof *out->found);
    out->expected = bst_pages_zero((size_t)capacity, sizeof *out->expected);
    if (!out->found || !out->expected) {
        bst_predicted_stars_free(out);
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for %d catalogue stars", capacity);
    }
    return BST_OK;
}

void bst_predicted_stars_free(bst_predicted_stars *sky) {
    bst_pages_free(sky->found);
    bst_pages_free(sky->expected);
    sky->found = NULL;
    sky->expected = NULL;
}

/* Effective V magnitude in the camera's band: V of a Sun-like star of the same signal. */
static double effective_v_mag(const bst_camera *camera, const bst_star *star) {
    double v_mag = (double)star->v_mag;
    if (!camera->spectrum) {
        return v_mag;
    }
    return bst_camera_v_mag(
        camera, bst_camera_star_electrons_per_s(camera, v_mag, (double)star->b_minus_v));
}

bst_status bst_predicted_stars_expect(bst_ctx *ctx, bst_predicted_stars *sky,
                                      const bst_predicted_stars_query *query, int *count) {
    assert(sky && query && count);
    const bst_quat q_cam_from_gcrf = sky->q_cam_from_gcrf = query->q_cam_from_gcrf;
    const bst_light *light = query->light;
    const bst_window window = query->window;
    const double margin_px = query->margin_px;
    *count = 0;
    double x0 = window.x0 - margin_px, x1 = window.x0 + window.width - 1 + margin_px;
    double y0 = window.y0 - margin_px, y1 = window.y0 + window.height - 1 + margin_px;
    bst_vec3 centre = bst_camera_unproject(sky->camera, 0.5 * (x0 + x1), 0.5 * (y0 + y1));
    bst_vec3 corners[4] = {
        bst_camera_unproject(sky->camera, x0, y0), bst_camera_unproject(sky->camera, x1, y0),
        bst_camera_unproject(sky->camera, x0, y1), bst_camera_unproject(sky->camera, x1, y1)};
    double radius = 0.0;
    for (int i = 0; i < 4; i++) {
        radius = fmax(radius, bst_vec3_angle(centre, corners[i]));
    }
    if (sky->camera->geometry.general) {
        radius = bst_camera_reach_rad(sky->camera, centre, x0, y0, x1, y1, 0.0);
    }
    bst_vec3 direction = bst_quat_rotate(bst_quat_conj(q_cam_from_gcrf), centre);
    direction = bst_light_catalogue_star(light, direction);
    int total = 0;
    bst_star_query cone = {
        direction, radius + BST_ARCSEC_RAD, query->v_limit, {sky->julian_year, light->sun_m}};
    for (; cone.v_limit > BRIGHTEST_V; cone.v_limit -= 0.5) {
        BST_TRY(bst_stars_query_seen(ctx, sky->stars, &cone, sky->found, sky->capacity, &total));
        if (total <= sky->capacity) {
            break;
        }
    }
    total = total < sky->capacity ? total : sky->capacity;
    for (int i = 0; i < total; i++) {
        const bst_star *star = &sky->found[i];
        bst_vec3 apparent = bst_light_apparent_star(light, star->icrs);
        double x, y;
        if (bst_camera_project(sky->camera, bst_quat_rotate(q_cam_from_gcrf, apparent), &x, &y) &&
            x >= x0 && x <= x1 && y >= y0 && y <= y1) {
            sky->expected[(*count)++] =
                (bst_imgproc_expected_star){x, y, effective_v_mag(sky->camera, star), star->id};
        }
    }
    return BST_OK;
}
