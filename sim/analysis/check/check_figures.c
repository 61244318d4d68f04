#include "sim/analysis/check/check_figures.h"

#include <math.h>

#include <cjson/cJSON.h>

#include "sim/core/json_member.h"
#include "sim/core/json_number.h"
#include "sim/eval/location_bound.h"
#include "sim/optics/psf.h"
#include "sim/run/run_space.h"
#include "sim/world/world.h"
#include "sim/world/world_config.h"

/* Times of the run at which targets are described. */
enum { TARGET_TIMES = 3 };

/* Light and noise of a sensor's pixel, as read (binned), in an exposure. */
typedef struct exposure_noise {
    double exposure_s, sky_e, dark_e, noise_e;
    double fwhm_px;   /* of the PSF, in pixels of the sensor */
    double snr_per_e; /* of a point source, by its electrons */
} exposure_noise;

/* Mean over positions in the pixel of sum s^2, s: the pixels' fractions of a point's light. */
static bst_status mean_sharpness(bst_ctx *ctx, double sigma_px, double *mean) {
    enum { SIDE = 4 }; /* a Gaussian of a quarter of a pixel is read in pixels of 4 x 4 */
    *mean = 0.0;
    for (int p = 0; p < SIDE * SIDE; p++) {
        const bst_eval_bound_source source = {.x_px = (p % SIDE + 0.5) / SIDE,
                                              .y_px = (p / SIDE + 0.5) / SIDE,
                                              .sigma_px = sigma_px,
                                              .flux_e = 1.0};
        double powers[2];
        BST_TRY(bst_eval_gaussian_powers(ctx, &source, powers));
        *mean += powers[0] / (SIDE * SIDE);
    }
    return BST_OK;
}

/* Pixels are summed before they are read: their light and its noise add up, the read noise is that
 * of one pixel. */
static bst_status find_noise(bst_ctx *ctx, const bst_camera *c, const bst_exposure_config *e,
                             exposure_noise *out) {
    const double side = e->binning > 1 ? (double)e->binning : 1.0, pixels = side * side;
    const double read_e = bst_camera_read_noise_e(c);
    const double sky_e = bst_camera_background_e_per_s(c) * e->exposure_s;
    const double one_e = bst_camera_noise_e(c, sky_e, e->exposure_s);
    bst_psf *psf;
    double sharpness;
    out->exposure_s = e->exposure_s;
    out->sky_e = pixels * sky_e;
    out->dark_e = pixels * bst_camera_dark_e(c, e->exposure_s);
    out->noise_e = sqrt(pixels * (one_e * one_e - read_e * read_e) + read_e * read_e);
    BST_TRY(bst_psf_create(ctx, c, &psf));
    out->fwhm_px = bst_psf_equivalent_fwhm_px(psf, bst_camera_centre_x(c), bst_camera_centre_y(c));
    bst_psf_free(psf);
    BST_TRY(mean_sharpness(ctx, out->fwhm_px / BST_FWHM_PER_SIGMA / side, &sharpness));
    out->snr_per_e = sqrt(sharpness) / out->noise_e;
    return BST_OK;
}

/* A sensor of the scenario. */
typedef struct subject {
    const bst_scenario *scenario;
    bst_world_view *view;
    const bst_sensor_config *sensor;
    const bst_camera *camera;
    int observer, object; /* object: of the cue; -1: none */
    exposure_noise noise;
} subject;

/* Describes the target at a time. */
static bst_status add_state(bst_ctx *ctx, const subject *s, double time_s, cJSON *list) {
    bst_world_sight now, then;
    BST_TRY(bst_world_view_sight(ctx, s->view, s->observer, s->object, time_s, &now));
    BST_TRY(bst_world_view_sight(ctx, s->view, s->observer, s->object, time_s + 1.0, &then));
    double light_e = isfinite(now.v_mag)
                         ? bst_camera_electrons_per_s(s->camera, now.v_mag) * s->noise.exposure_s
                         : 0.0;
    cJSON *node = cJSON_CreateObject();
    cJSON_AddItemToArray(list, node);
    bst_json_add_number(node, "time_s", time_s);
    bst_json_add_number(node, "v_mag", now.v_mag);
    bst_json_add_number(node, "range_m", now.range_m);
    bst_json_add_number(node, "rate_arcsec_per_s",
                        bst_vec3_angle(now.geometric, then.geometric) / BST_ARCSEC_RAD);
    cJSON_AddBoolToObject(node, "occulted", now.occulted);
    bst_json_add_number(node, "sunlit_fraction", now.sunlit_fraction);
    bst_json_add_number(node, "snr", now.occulted ? 0.0 : light_e * s->noise.snr_per_e);
    return BST_OK;
}

/* Adds the target of the cue, or null. */
static bst_status add_target(bst_ctx *ctx, const subject *s, cJSON *node) {
    if (s->object < 0) {
        cJSON_AddNullToObject(node, "target");
        return BST_OK;
    }
    cJSON *target = cJSON_AddObjectToObject(node, "target");
    cJSON_AddStringToObject(target, "object", s->sensor->cue.object);
    cJSON *states = cJSON_AddArrayToObject(target, "states");
    for (int i = 0; i < TARGET_TIMES; i++) {
        BST_TRY(add_state(ctx, s, s->scenario->duration_s * i / (TARGET_TIMES - 1), states));
    }
    return BST_OK;
}

static bst_status add_sensor(bst_ctx *ctx, subject *s, cJSON *list) {
    const bst_observer_config *observers = s->scenario->observers.items;
    const exposure_noise *noise = &s->noise;
    BST_TRY(find_noise(ctx, s->camera, &s->sensor->exposure, &s->noise));
    cJSON *node = cJSON_CreateObject();
    cJSON_AddItemToArray(list, node);
    cJSON_AddStringToObject(node, "observer", observers[s->observer].name);
    cJSON_AddStringToObject(node, "sensor", s->sensor->name);
    const double scale_deg = bst_camera_scale_rad(s->camera) / BST_DEG_RAD;
    const double field_deg[2] = {scale_deg * (double)s->camera->width_px,
                                 scale_deg * (double)s->camera->height_px};
    cJSON_AddItemToObject(node, "field_deg", cJSON_CreateDoubleArray(field_deg, 2));
    bst_json_add_number(node, "pixel_scale_arcsec", 3600.0 * scale_deg);
    bst_json_add_number(node, "frames", bst_run_sensor_frames(s->scenario, s->sensor));
    bst_json_add_number(node, "frame_bytes", bst_run_sensor_bytes(s->scenario, s->sensor));
    bst_json_add_number(node, "sky_e", noise->sky_e);
    bst_json_add_number(node, "dark_e", noise->dark_e);
    bst_json_add_number(node, "noise_e", noise->noise_e);
    bst_json_add_number(node, "psf_fwhm_px", noise->fwhm_px);
    double limit_e_per_s = BST_CHECK_LIMIT_SNR / noise->snr_per_e / noise->exposure_s;
    bst_json_add_number(node, "v_mag_at_snr_5", bst_camera_v_mag(s->camera, limit_e_per_s));
    return add_target(ctx, s, node);
}

/* Adds all sensors of an observer. */
static bst_status add_sensors(bst_ctx *ctx, subject *s, const bst_world *world, cJSON *list) {
    const bst_observer_config *observers = s->scenario->observers.items;
    const bst_sensor_config *sensors = observers[s->observer].sensors.items;
    for (int i = 0; i < bst_world_sensor_count(world, s->observer); i++) {
        const char *object = sensors[i].cue.object;
        s->sensor = &sensors[i];
        s->camera = bst_world_camera(world, s->observer, i);
        s->object = *object ? bst_world_find_object(world, object) : -1;
        BST_TRY(add_sensor(ctx, s, list));
    }
    return BST_OK;
}

bst_status bst_check_figures(bst_ctx *ctx, const bst_scenario *scenario,
                             const bst_simulation *simulation, cJSON **out) {
    const bst_world *world = bst_simulation_world(simulation);
    subject s = {.scenario = scenario};
    double bytes = 0.0;
    *out = NULL;
    BST_TRY(bst_world_view_create(ctx, world, &s.view));
    cJSON *figures = cJSON_CreateObject();
    bst_json_add_number(figures, "duration_s", scenario->duration_s);
    cJSON_AddNumberToObject(figures, "objects", bst_world_object_count(world));
    cJSON *list = cJSON_AddArrayToObject(figures, "sensors");
    bst_status status = BST_OK;
    for (s.observer = 0; s.observer < bst_world_observer_count(world) && status == BST_OK;
         s.observer++) {
        status = add_sensors(ctx, &s, world, list);
    }
    for (const cJSON *node = list->child; node; node = node->next) {
        bytes += bst_json_member_number(node, "frame_bytes");
    }
    bst_json_add_number(figures, "frame_bytes", bytes);
    bst_world_view_free(s.view);
    if (status != BST_OK) {
        cJSON_Delete(figures);
        return status;
    }
    *out = figures;
    return BST_OK;
}
