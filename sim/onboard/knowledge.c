#include "sim/onboard/knowledge.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sim/core/memo.h"
#include "sim/onboard/knowledge_internal.h"
#include "sim/optics/psf.h"

/* Fifth difference, rad, up to which directions are interpolated; the error is 200 times
 * smaller. */
static const double SMOOTH_RAD = 1e-11;

/* Sets the onboard camera's PSF to a Gaussian: of the given width, else with the noise-equivalent
 * area of the true PSF at the field centre. *psf: the true PSF if it is known on board and not
 * Gaussian. */
static void know_psf(bst_camera *c, double given_fwhm_px, const bst_psf **psf) {
    double sigma_px;
    bool plain = (!c->psf && c->optics.psf == BST_PSF_GAUSSIAN) ||
                 (c->psf && bst_psf_gaussian(c->psf, &sigma_px));
    if (plain && !(given_fwhm_px > 0.0) && !(c->optics.diffusion_px > 0.0)) {
        return;
    }
    if (given_fwhm_px > 0.0) {
        c->psf_fwhm_px = given_fwhm_px;
    } else if (c->psf) {
        *psf = plain ? NULL : c->psf;
        c->psf_fwhm_px = bst_psf_equivalent_fwhm_px(c->psf, 0.5 * (double)(c->width_px - 1),
                                                    0.5 * (double)(c->height_px - 1));
    }
    c->psf = NULL;
    c->optics = (bst_optics_config){.vignetting = c->optics.vignetting};
}

/* Applies the calibration errors to the camera model known on board. */
static bst_status alter_camera(bst_ctx *ctx, const bst_camera_errors_config *errors,
                               bst_knowledge *k) {
    bst_camera *c = &k->camera;
    c->pixel_scale_arcsec *= 1.0 + 1e-6 * errors->scale_error_ppm;
    c->rotation_deg += errors->rotation_error_deg;
    c->distortion = errors->override_distortion ? errors->distortion : c->distortion;
    c->throughput *= 1.0 + errors->throughput_error;
    know_psf(c, errors->psf_fwhm_px, &k->psf);
    bst_status status = bst_camera_prepare(ctx, c);
    return status == BST_OK
               ? status
               : bst_fail_prefix(ctx, status, "/observers/%d/sensors/%d/knowledge/camera",
                                 k->observer, k->sensor);
}

bst_status bst_knowledge_create(bst_ctx *ctx, const bst_world *world, int observer, int sensor,
                                bst_knowledge **out) {
    assert(world && out && observer >= 0 && observer < bst_world_observer_count(world));
    assert(sensor >= 0 && sensor < bst_world_sensor_count(world, observer));
    *out = NULL;
    bst_knowledge *k = calloc(1, sizeof *k);
    if (!k) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for onboard knowledge");
    }
    const bst_sensor_config *config = &world->observers[observer].sensors[sensor].config;
    k->world = world;
    k->observer = observer;
    k->sensor = sensor;
    k->camera = config->camera;
    k->julian_year = bst_time_julian_year(world->epoch);
    if (*config->knowledge.star_catalogue) {
        bst_status status = bst_stars_open(ctx, config->knowledge.star_catalogue, &k->own_stars);
        if (status != BST_OK) {
            bst_knowledge_free(k);
            return bst_fail_prefix(ctx, status, "/observers/%d/sensors/%d/knowledge/star_catalogue",
                                   observer, sensor);
        }
    }
    bst_status status = bst_memo_create(ctx, &k->memo);
    if (status == BST_OK) {
        status = alter_camera(ctx, &config->knowledge.camera, k);
    }
    const bst_star_errors_config *errors = &config->knowledge.stars;
    if (status == BST_OK &&
        (errors->missing_fraction > 0.0 || errors->position_error_fraction > 0.0)) {
        status = bst_stars_with_errors(ctx, k->own_stars ? k->own_stars : world->stars, errors,
                                       &k->altered);
    }
    if (status != BST_OK) {
        bst_knowledge_free(k);
        return status;
    }
    *out = k;
    return BST_OK;
}

void bst_knowledge_free(bst_knowledge *k) {
    if (k) {
        bst_stars_close(k->altered);
        bst_stars_close(k->own_stars);
        bst_memo_free(k->memo);
        free(k);
    }
}

const char *bst_knowledge_psf_file(const bst_knowledge *k, double *oversampling) {
    const bst_camera_errors_config *camera =
        &k->world->observers[k->observer].sensors[k->sensor].config.knowledge.camera;
    *oversampling = camera->psf_oversampling;
    return camera->psf_file;
}

const bst_psf *bst_knowledge_psf(const bst_knowledge *k) {
    return k->psf;
}

struct bst_memo *bst_knowledge_memo(const bst_knowledge *k) {
    return k->memo;
}
const bst_camera *bst_knowledge_camera(const bst_knowledge *k) {
    return &k->camera;
}
const bst_stars *bst_knowledge_stars(const bst_knowledge *k) {
    return k->altered ? k->altered : k->own_stars ? k->own_stars : k->world->stars;
}
double bst_knowledge_julian_year(const bst_knowledge *k) {
    return k->julian_year;
}
bst_quat bst_knowledge_body_attitude(const bst_knowledge *k) {
    return k->world->observers[k->observer].sensors[k->sensor].body_attitude;
}

bst_status bst_knowledge_view_create(bst_ctx *ctx, const bst_knowledge *knowledge,
                                     bst_knowledge_view **out) {
    *out = NULL;
    bst_knowledge_view *view = calloc(1, sizeof *view);
    if (!view) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a view of onboard knowledge");
    }
    view->knowledge = knowledge;
    view->cue_error = bst_quat_from_rotvec(
        knowledge->world->observers[knowledge->observer].sensors[knowledge->sensor].cue_rotation);
    bst_status status = bst_sky_clock_create_on(ctx, knowledge->world->sky_grid, &view->clock);
    if (status != BST_OK) {
        free(view);
        return status;
    }
    *out = view;
    return BST_OK;
}

void bst_knowledge_view_free(bst_knowledge_view *view) {
    if (view) {
        bst_sky_clock_free(view->clock);
        free(view);
    }
}

static const world_sensor *sensor_of(const bst_knowledge *k) {
    return &k->world->observers[k->observer].sensors[k->sensor];
}

bst_status bst_onboard_nav_eye(bst_ctx *ctx, bst_knowledge_view *view, double seconds, double *t,
                               bst_world_state *eye) {
    const bst_knowledge *k = view->knowledge;
    *t = bst_world_nav_seconds(k->world, k->observer, k->sensor, seconds) - view->clock_offset_s;
    BST_TRY(bst_world_orbit_state(ctx, &k->world->observers[k->observer].orbit, view->clock,
                                  k->world->epoch, *t, true, eye));
    bst_world_nav_estimate(k->world, k->observer, k->sensor, *t, eye);
    return BST_OK;
}

void bst_onboard_forget_cue(bst_knowledge_view *view) {
    view->any_checked = false;
    memset(view->knots, 0, sizeof view->knots);
}

bool bst_knowledge_view_set_clock(bst_knowledge_view *view, double offset_s, double sigma_s) {
    assert(isfinite(offset_s) && sigma_s >= 0.0);
    const double taken_s = sigma_s > 0.0 ? offset_s : 0.0;
    if (!(fabs(taken_s - view->clock_offset_s) > sigma_s / 3.0)) {
        return false;
    }
    view->clock_offset_s = taken_s;
    bst_onboard_forget_cue(view);
    return true;
}

double bst_knowledge_view_clock_s(const bst_knowledge_view *view) {
    return view->clock_offset_s;
}

/* Direction of the target on its nominal orbit, by onboard navigation. */
static bst_status nominal_direction(bst_ctx *ctx, bst_knowledge_view *view, double seconds,
                                    bst_vec3 *out) {
    const bst_knowledge *k = view->knowledge;
    double t;
    bst_world_state eye;
    BST_TRY(bst_onboard_nav_eye(ctx, view, seconds, &t, &eye));
    if (view->tasked) {
        BST_TRY(bst_world_object_nominal_line(ctx, k->world, view->task.object, view->clock, t,
                                              &eye, out));
        *out = bst_vec3_unit(*out);
        return BST_OK;
    }
    const bst_world_cue_at at = {k->observer, k->sensor, view->clock, t, &eye};
    return bst_world_cue_nominal_direction(ctx, k->world, &at, out);
}

/* Rotation error of the cue; none for a task's target. */
static bst_quat error_of(const bst_knowledge_view *view) {
    return view->tasked ? (bst_quat){0.0, 0.0, 0.0, 1.0} : view->cue_error;
}

/* Nominal cue direction at a full second, cached. */
static const bst_onboard_cue_knot *knot_at(bst_knowledge_view *view, int64_t second) {
    bst_onboard_cue_knot *knot =
        &view->knots[((second % BST_CUE_KNOTS) + BST_CUE_KNOTS) % BST_CUE_KNOTS];
    if (!knot->made || knot->second != second) {
        bst_ctx quiet = {
            0}; /* after the end of an orbit there is no direction, which is no error here */
        knot->made = true;
        knot->second = second;
        knot->known = nominal_direction(&quiet, view, (double)second, &knot->direction) == BST_OK;
    }
    return knot;
}

/* Checks whether the direction between two consecutive seconds follows a quintic. */
static bool is_smooth(bst_knowledge_view *view, int64_t second) {
    if (!view->any_checked || view->checked != second) {
        bool known = true;
        for (int i = 0; i < BST_QUINTIC_POINTS; i++) {
            const bst_onboard_cue_knot *knot = knot_at(view, second - BST_QUINTIC_BEFORE + i);
            known = known && knot->known;
            view->cued[i] = bst_quat_rotate(error_of(view), knot->direction);
        }
        view->any_checked = true;
        view->checked = second;
        view->smooth = known && bst_quintic_make(view->cued) <= SMOOTH_RAD;
    }
    return view->smooth;
}

/* Direction of the cue: interpolated from six seconds if accurate, else direct; a function of time
 * only. */
static bst_status direction_at(bst_ctx *ctx, bst_knowledge_view *view, double seconds,
                               bst_vec3 *out) {
    double whole = floor(seconds);
    if (fabs(seconds) < 1e12 && is_smooth(view, (int64_t)whole)) {
        *out = bst_quintic_at(view->cued, seconds - whole);
        return BST_OK;
    }
    BST_TRY(nominal_direction(ctx, view, seconds, out));
    *out = bst_quat_rotate(error_of(view), *out);
    return BST_OK;
}

bst_status bst_knowledge_cue_at(bst_ctx *ctx, bst_knowledge_view *view, double seconds,
                                bst_onboard_cue *out) {
    assert(view && out && isfinite(seconds));
    const bst_knowledge *k = view->knowledge;
    /* central difference: the third derivative of a LEO-to-GEO direction leaves < 1e-11 rad/s */
    const double h = 0.5;
    bst_vec3 d[3];
    for (int i = 0; i < 3; i++) {
        BST_TRY(direction_at(ctx, view, seconds + (i - 1) * h, &d[i]));
    }
    const world_sensor *sensor = sensor_of(k);
    const bst_cue_config *cue = &sensor->config.cue;
    out->valid = true;
    out->direction_gcrf = d[1];
    out->rate_gcrf_radps = bst_vec3_scale(bst_vec3_sub(d[2], d[0]), 0.5 / h);
    bst_region region;
    bst_knowledge_view_region(view, &region);
    out->sigma_rad = region.kind == BST_REGION_NONE
                         ? cue->sigma_deg * BST_DEG_RAD
                         : fmax(region.half_length_rad, region.half_width_rad);
    out->rate_sigma_radps = cue->rate_sigma_arcsec_per_s * BST_ARCSEC_RAD;
    out->v_mag = cue->v_mag;
    out->v_mag_sigma = cue->v_mag_sigma;
    if (view->tasked) {
        const bst_task *task = &view->task;
        out->sigma_rad = task->sigma_rad > 0.0 ? task->sigma_rad : cue->sigma_deg * BST_DEG_RAD;
        out->rate_sigma_radps =
            task->rate_sigma_radps > 0.0 ? task->rate_sigma_radps : out->rate_sigma_radps;
        if (task->v_mag_sigma > 0.0) {
            out->v_mag = task->v_mag;
            out->v_mag_sigma = task->v_mag_sigma;
        }
    }
    return BST_OK;
}

bst_status bst_knowledge_cue_direction_at(bst_ctx *ctx, bst_knowledge_view *view, double seconds,
                                          bool *valid, bst_vec3 *direction) {
    assert(view && valid && direction && isfinite(seconds));
    *valid = true;
    return direction_at(ctx, view, seconds, direction);
}

void bst_knowledge_region(const bst_knowledge *k, bst_region *out) {
    const bst_region_config *region = &sensor_of(k)->config.cue.region;
    *out = (bst_region){.kind = region->kind,
                        .half_length_rad = bst_world_region_half_length_rad(region),
                        .half_width_rad = region->half_width_deg * BST_DEG_RAD};
}

void bst_knowledge_view_region(const bst_knowledge_view *view, bst_region *out) {
    *out = (bst_region){.kind = BST_REGION_NONE};
    if (!view->tasked) {
        bst_knowledge_region(view->knowledge, out);
    }
}

bst_status bst_knowledge_region_direction_at(bst_ctx *ctx, bst_knowledge_view *view, double seconds,
                                             double along_rad, double across_rad,
                                             bst_vec3 *direction) {
    const bst_knowledge *k = view->knowledge;
    double t;
    bst_world_state eye;
    bst_vec3 nominal;
    BST_TRY(bst_onboard_nav_eye(ctx, view, seconds, &t, &eye));
    const bst_world_cue_at at = {k->observer, k->sensor, view->clock, t, &eye};
    BST_TRY(bst_world_region_place(ctx, k->world, &at, along_rad, across_rad, &nominal));
    *direction = bst_quat_rotate(view->cue_error, nominal);
    return BST_OK;
}

bst_status bst_knowledge_belt_eye_at(bst_ctx *ctx, bst_knowledge_view *view, double seconds,
                                     bool *known, bst_belt_eye *eye) {
    const bst_knowledge *k = view->knowledge;
    *known = !view->tasked && sensor_of(k)->config.cue.region.kind != BST_REGION_NONE;
    if (!*known) {
        return BST_OK;
    }
    double t;
    bst_world_state state;
    bst_sky_rotation sky;
    BST_TRY(bst_onboard_nav_eye(ctx, view, seconds, &t, &state));
    BST_TRY(bst_sky_clock_at(ctx, view->clock, bst_time_add(k->world->epoch, t), &sky));
    *eye = (bst_belt_eye){.position_m = state.position_m,
                          .velocity_mps = state.velocity_mps,
                          .earth_radps = bst_astro_earth_rate_gcrf(&sky.frames)};
    return BST_OK;
}

int bst_knowledge_cue_object(const bst_knowledge_view *view) {
    const world_sensor *sensor = sensor_of(view->knowledge);
    if (view->tasked) {
        return view->task.object;
    }
    return sensor->config.cue.region.kind == BST_REGION_NONE ? sensor->cue_object : -1;
}

bst_status bst_knowledge_cue_range_at(bst_ctx *ctx, bst_knowledge_view *view, double seconds,
                                      bool *known, double *range_m, double *range_rate_mps) {
    const bst_knowledge *k = view->knowledge;
    const double h = 0.5;
    double range[3];
    *range_m = *range_rate_mps = 0.0;
    int object = bst_knowledge_cue_object(view);
    *known = object >= 0;
    for (int i = 0; *known && i < 3; i++) {
        double t;
        bst_world_state eye;
        bst_vec3 line;
        BST_TRY(bst_onboard_nav_eye(ctx, view, seconds + (i - 1) * h, &t, &eye));
        BST_TRY(bst_world_object_nominal_line(ctx, k->world, object, view->clock, t, &eye, &line));
        range[i] = bst_vec3_norm(line);
    }
    if (*known) {
        *range_m = range[1];
        *range_rate_mps = 0.5 * (range[2] - range[0]) / h;
    }
    return BST_OK;
}
