#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "scenegen/detector/detector.h"
#include "sim/analysis/pd/pd.h"
#include "sim/cli/load.h"
#include "sim/engine/shared_model.h"
#include "sim/eval/location_bound.h"
#include "sim/io/psf_fits.h"
#include "sim/onboard/knowledge.h"
#include "sim/optics/psf.h"
#include "sim/world/scene/skylight.h"
#include "sim/world/world_config.h"

/* number of angles at which a streak's sum of squares is tabulated, over 90 degrees */
enum { ANGLES = 46 };

static const bst_sensor_config *sensor_config(const bst_scenario *scenario, int observer,
                                              int sensor) {
    const bst_observer_config *observers = scenario->observers.items;
    const bst_sensor_config *sensors = observers[observer].sensors.items;
    return &sensors[sensor];
}

/* Finds the named sensor, or the first one with image processing. */
static bst_status find_sensor(bst_ctx *ctx, bst_pd_scene *s) {
    const bst_observer_config *observers = s->scenario->observers.items;
    for (int m = 0; m < s->scenario->module_count; m++) {
        const bst_scenario_module_config *module = &s->scenario->modules[m];
        if (strcmp(module->desc->role, "imgproc") != 0) {
            continue;
        }
        snprintf(s->name, sizeof s->name, "%s/%s", observers[module->observer].name,
                 sensor_config(s->scenario, module->observer, module->sensor)->name);
        if (!s->options.sensor || strcmp(s->options.sensor, s->name) == 0) {
            s->imgproc = module;
            s->observer = module->observer;
            s->sensor = module->sensor;
            return BST_OK;
        }
    }
    BST_TRY(bst_load_check_sensor(ctx, s->scenario, s->options.sensor));
    return s->options.sensor
               ? bst_fail(ctx, BST_ERR_NOT_FOUND, "--sensor %s: has no module \"imgproc\"",
                          s->options.sensor)
               : bst_fail(ctx, BST_ERR_CONFIG,
                          "no sensor of the scenario has a module \"imgproc\": there is no "
                          "detector to measure");
}

static bst_status read_psf(bst_ctx *ctx, bst_pd_scene *s) {
    const bst_optics_config *optics = &bst_world_camera(s->world, s->observer, s->sensor)->optics;
    if (optics->psf != BST_PSF_FILE) {
        return BST_OK;
    }
    bst_psf_samples samples;
    BST_TRY(bst_psf_fits_samples(ctx, optics->psf_file, optics->psf_oversampling, &samples));
    bst_status status = bst_world_set_psf(ctx, s->world, s->observer, s->sensor, &samples);
    free((float *)samples.samples);
    return status;
}

/* Noise of a pixel without source. */
static double noise_at(const bst_pd_scene *s, double x_px, double y_px) {
    double sky_e = s->sky ? bst_pd_sky_e(s->sky, x_px, y_px) : s->sky_e;
    return bst_camera_noise_e(&s->camera, sky_e, s->exposure_s);
}

/* Evaluates the scenario's sky for its level at the boresight. */
static bst_status open_sky(bst_ctx *ctx, bst_pd_scene *s) {
    BST_TRY(bst_pd_sky_open(ctx, s, &s->sky));
    const double time_s[2] = {0.0, s->exposure_s};
    bst_quat q = bst_pd_sky_attitude(s->sky, 0.0);
    const bst_quat both[2] = {q, q};
    bst_los_track track = {2, time_s, both};
    const bst_scene_source *stars;
    int count;
    BST_TRY(bst_pd_sky_look(ctx, s->sky, &track, &stars, &count));
    s->sky_e =
        bst_pd_sky_e(s->sky, bst_camera_centre_x(&s->camera), bst_camera_centre_y(&s->camera));
    return BST_OK;
}

/* Sets up camera, PSF and noise. */
static bst_status set_camera(bst_ctx *ctx, bst_pd_scene *s) {
    const bst_sensor_config *config = sensor_config(s->scenario, s->observer, s->sensor);
    if (config->exposure.binning > 1) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "%s reads out with a binning of %lld: pd measures single pixels; set "
                        "exposure.binning to 1",
                        s->name, (long long)config->exposure.binning);
    }
    s->camera = *bst_world_camera(s->world, s->observer, s->sensor);
    if (s->options.jitter_px > 0.0) {
        bst_camera widened;
        BST_TRY(bst_psf_camera_blurred(ctx, &s->camera, s->options.jitter_px, &widened));
        s->camera = widened;
        s->psf = (struct bst_psf *)widened.psf;
    }
    const bst_camera *c = &s->camera;
    s->exposure_s = config->exposure.exposure_s;
    if (!(s->exposure_s > 0.0)) {
        return bst_fail(ctx, BST_ERR_CONFIG, "%s exposes for %g s: there is no light to measure",
                        s->name, s->exposure_s);
    }
    if (!s->options.stars && s->options.background_e < 0.0 && bst_skylight_varies(c)) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "the sky of %s differs from pixel to pixel (camera.background): give one "
                        "level for all with --background, or keep the sky with --stars",
                        s->name);
    }
    s->sky_e = s->options.background_e >= 0.0 ? s->options.background_e
                                              : bst_camera_background_e_per_s(c) * s->exposure_s;
    s->dark_e = bst_camera_dark_e(c, s->exposure_s);
    if (s->options.stars) {
        BST_TRY(open_sky(ctx, s));
    }
    double centre_x = bst_camera_centre_x(c), centre_y = bst_camera_centre_y(c);
    s->noise_e = noise_at(s, centre_x, centre_y);
    bst_psf *psf;
    BST_TRY(bst_psf_create(ctx, c, &psf));
    s->fwhm_px = bst_psf_equivalent_fwhm_px(psf, centre_x, centre_y);
    if (bst_psf_gaussian(psf, &s->sigma_px)) {
        bst_psf_free(psf);
        return BST_OK;
    }
    s->sigma_px = s->fwhm_px / BST_FWHM_PER_SIGMA;
    s->seen = psf;
    /* distortion by camera rotation lengthens some targets */
    return bst_pd_image_create(ctx, psf, 1.1 * s->options.streak_px, &s->image);
}

/* Mean over positions in the pixel; they differ little for a streak. */
static bst_status make_sharpness(bst_ctx *ctx, bst_pd_scene *s) {
    s->sharpness = calloc(ANGLES, sizeof *s->sharpness);
    if (!s->sharpness) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the streak's shape");
    }
    for (int a = 0; a < ANGLES; a++) {
        double angle = 0.5 * BST_PI * a / (ANGLES - 1);
        for (int p = 0; p < 4; p++) {
            bst_eval_bound_source source = {.x_px = 0.125 + 0.5 * (p % 2),
                                            .y_px = 0.125 + 0.5 * (p / 2),
                                            .dx_px = s->options.streak_px * cos(angle),
                                            .dy_px = s->options.streak_px * sin(angle),
                                            .sigma_px = s->sigma_px,
                                            .flux_e = 1.0};
            double powers[2];
            BST_TRY(bst_eval_gaussian_powers(ctx, &source, powers));
            s->sharpness[a] += 0.25 * powers[0];
        }
    }
    return BST_OK;
}

/* sum of squared pixel fractions of a 1-D Gaussian at x */
static double axis_sharpness(double x, double sigma) {
    double scale = 1.0 / (sigma * sqrt(2.0)), sum = 0.0;
    int first = (int)floor(x - 6.0 * sigma), last = (int)ceil(x + 6.0 * sigma);
    double before = erf((first - 0.5 - x) * scale);
    for (int i = first; i <= last; i++) {
        double after = erf((i + 0.5 - x) * scale);
        sum += 0.25 * (after - before) * (after - before);
        before = after;
    }
    return sum;
}

double bst_pd_sharpness(const bst_pd_scene *s, const bst_eval_match_target *place) {
    if (s->image) {
        double powers[2];
        bst_pd_image_powers(s->image, place, powers);
        return powers[0];
    }
    if (s->sharpness) {
        double angle = atan2(fabs(place->dy_px), fabs(place->dx_px));
        double at = angle / (0.5 * BST_PI) * (ANGLES - 1);
        int i = (int)fmin(at, ANGLES - 2.0);
        return s->sharpness[i] + (at - i) * (s->sharpness[i + 1] - s->sharpness[i]);
    }
    return axis_sharpness(place->x_px, s->sigma_px) * axis_sharpness(place->y_px, s->sigma_px);
}

/* A pixel position at the centre of the sensor. */
static bst_eval_match_target middle_of(const bst_pd_scene *s, double x, double y) {
    return (bst_eval_match_target){.x_px = floor(bst_camera_centre_x(&s->camera)) + x,
                                   .y_px = floor(bst_camera_centre_y(&s->camera)) + y};
}

/* Computes the noise that the target's own light adds to a matched filter. */
static bst_status set_own_light(bst_ctx *ctx, bst_pd_scene *s) {
    for (int p = 0; p < 4; p++) {
        bst_eval_bound_source source = {.x_px = 0.125 + 0.5 * (p % 2),
                                        .y_px = 0.125 + 0.5 * (p / 2),
                                        .dx_px = 0.8 * s->options.streak_px,
                                        .dy_px = 0.6 * s->options.streak_px,
                                        .sigma_px = s->sigma_px,
                                        .flux_e = 1.0};
        double powers[2];
        if (s->image) {
            bst_eval_match_target place = middle_of(s, source.x_px, source.y_px);
            place.dx_px = source.dx_px;
            place.dy_px = source.dy_px;
            bst_pd_image_powers(s->image, &place, powers);
        } else {
            BST_TRY(bst_eval_gaussian_powers(ctx, &source, powers));
        }
        s->own_light += 0.25 * powers[1] / pow(powers[0], 1.5) / s->noise_e;
    }
    return BST_OK;
}

static bst_status make_grid(bst_ctx *ctx, bst_pd_scene *s) {
    const bst_pd_options *o = &s->options;
    s->min_separation_px = o->min_separation_px;
    if (o->pairs) { /* no source of a neighbour within the reach of a pair */
        double widest =
            o->widest_pair_px > 0.0 ? o->widest_pair_px : BST_PD_WIDEST_PAIR_FWHM * s->fwhm_px;
        double reach = BST_PD_PAIR_REACH_FWHM * s->fwhm_px + widest;
        s->min_separation_px = fmax(s->min_separation_px, reach) + widest;
    }
    s->min_separation_px += o->streak_px;
    s->min_separation_px += o->stack > 0 ? o->rates_px * (double)(o->stack - 1) : 0.0;
    s->cell_px = o->cell_px > 0.0 ? o->cell_px : s->min_separation_px + (o->pairs ? 4.0 : 40.0);
    if (s->cell_px < s->min_separation_px + 2.0) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "--cell %g: at least %g px, the distance that is kept between targets and "
                        "two pixels to place them in",
                        o->cell_px, s->min_separation_px + 2.0);
    }
    s->columns = (int)((double)s->camera.width_px / s->cell_px);
    s->rows = (int)((double)s->camera.height_px / s->cell_px);
    if (s->columns < 1 || s->rows < 1) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "%s has %lld x %lld pixels: no room for one target in a cell of %g px",
                        s->name, (long long)s->camera.width_px, (long long)s->camera.height_px,
                        s->cell_px);
    }
    size_t room = (size_t)bst_pd_scene_room(s), sources = o->pairs ? 2 * room : room;
    for (int i = 0; i < 2; i++) {
        bst_pd_frame *f = &s->frames[i];
        f->places = calloc(room, sizeof *f->places);
        f->targets = calloc(room, sizeof *f->targets);
        f->sources = calloc(sources, sizeof *f->sources);
        f->source_room = (int)sources;
        f->paths = calloc(sources, sizeof *f->paths);
        if (!f->places || !f->targets || !f->sources || !f->paths) {
            return bst_fail(ctx, BST_ERR_MEMORY, "no memory for %zu targets a frame", room);
        }
    }
    return BST_OK;
}

static void set_points(bst_pd_scene *s) {
    const bst_pd_options *o = &s->options;
    bst_eval_match_target quarter = {0.25, 0.25, 0.6 * o->streak_px, 0.8 * o->streak_px};
    if (s->image) {
        bst_eval_match_target middle = middle_of(s, quarter.x_px, quarter.y_px);
        quarter.x_px = middle.x_px;
        quarter.y_px = middle.y_px;
    }
    double norm = sqrt(bst_pd_sharpness(s, &quarter));
    s->points = (int)floor((o->high - o->low) / o->step + 1e-9) + 1;
    for (int i = 0; i < s->points; i++) {
        double at = o->low + i * o->step;
        if (o->by_magnitude) {
            s->v_mag[i] = at;
            s->flux_e[i] = bst_camera_electrons_per_s(&s->camera, at) * s->exposure_s;
            s->snr[i] = s->flux_e[i] * norm / s->noise_e;
        } else {
            s->snr[i] = at;
            s->flux_e[i] = at * s->noise_e / norm;
            s->v_mag[i] = bst_camera_v_mag(&s->camera, s->flux_e[i] / s->exposure_s);
        }
    }
}

static bst_status open_scene(bst_ctx *ctx, bst_pd_scene *s) {
    const bst_scenario *scenario = s->scenario;
    BST_TRY(find_sensor(ctx, s));
    BST_TRY(bst_world_create(ctx, scenario->file, &scenario->world, &scenario->observers,
                             scenario->base_dir, scenario->epoch, &s->world));
    BST_TRY(read_psf(ctx, s));
    BST_TRY(
        bst_shared_model_read_stray_map(ctx, scenario->base_dir, s->world, s->observer, s->sensor));
    BST_TRY(bst_knowledge_create(ctx, s->world, s->observer, s->sensor, &s->knowledge));
    if (s->options.jitter_px < 0.0) {
        s->options.jitter_px = s->imgproc->desc == &bst_imgproc_module
                                   ? ((const bst_imgproc_config *)s->imgproc->config)->jitter_px
                                   : 0.0;
    }
    BST_TRY(set_camera(ctx, s));
    BST_TRY(make_grid(ctx, s));
    if (s->options.streak_px > 0.0) {
        BST_TRY(make_sharpness(ctx, s));
    }
    BST_TRY(set_own_light(ctx, s));
    set_points(s);
    s->device = s->options.opened;
    if (!s->device) {
        BST_TRY(bst_device_open(ctx, s->options.device ? s->options.device : "", s->options.threads,
                                &s->device));
    }
    bst_renderer_options fidelity = bst_renderer_default_options();
    fidelity.pattern = bst_detector_pattern_key(&s->camera, s->name);
    return bst_renderer_create(ctx, s->device, &s->camera, &fidelity, &s->renderer);
}

bst_status bst_pd_scene_open(bst_ctx *ctx, const bst_scenario *scenario,
                             const bst_pd_options *options, bst_pd_scene *out) {
    *out = (bst_pd_scene){.options = *options, .scenario = scenario};
    bst_status status = open_scene(ctx, out);
    if (status != BST_OK) {
        bst_pd_scene_close(out);
    }
    return status;
}

void bst_pd_scene_close(bst_pd_scene *s) {
    bst_renderer_free(s->renderer);
    if (s->device != s->options.opened) {
        bst_device_close(s->device);
    }
    bst_psf_free(s->psf);
    bst_pd_image_free(s->image);
    bst_psf_free(s->seen);
    bst_pd_sky_close(s->sky);
    bst_knowledge_free(s->knowledge);
    bst_world_free(s->world);
    free(s->sharpness);
    for (int i = 0; i < 2; i++) {
        free(s->frames[i].places);
        free(s->frames[i].targets);
        free(s->frames[i].sources);
        free(s->frames[i].paths);
        bst_pd_stars_free(&s->frames[i].stars);
    }
    *s = (bst_pd_scene){.points = 0};
}

int bst_pd_scene_room(const bst_pd_scene *s) {
    return s->columns * s->rows;
}

/* Direction of a focal-plane position at attitude q. */
static bst_vec3 direction(const bst_camera *c, bst_quat q, double x, double y) {
    return bst_quat_rotate(bst_quat_conj(q), bst_camera_unproject(c, x, y));
}

/* Image position of a direction at the start (0) or end (1) of the exposure. */
static bool seen(const bst_camera *c, const bst_pd_frame *f, int end, bst_vec3 v, double *x,
                 double *y) {
    return bst_camera_project(c, bst_quat_rotate(f->q[end], v), x, y);
}

/* Sets source i of the frame without its light. Returns its place and path. */
static bst_eval_match_target set_source(bst_pd_scene *s, bst_pd_frame *f, int i, double x, double y,
                                        double angle) {
    const bst_camera *c = &s->camera;
    double length = s->options.streak_px, dx = length * cos(angle), dy = length * sin(angle);
    bst_scene_source *source = &f->sources[i];
    *source = (bst_scene_source){.kind = BST_SOURCE_STAR,
                                 .id = (uint32_t)i + 1,
                                 .apparent_mid = direction(c, f->motion.q_cam_from_gcrf, x, y)};
    if (length > 0.0 && s->options.known_rate) {
        double x0, y0, x1, y1;
        if (seen(c, f, 0, source->apparent_mid, &x0, &y0) &&
            seen(c, f, 1, source->apparent_mid, &x1, &y1)) {
            dx = x1 - x0;
            dy = y1 - y0;
        }
    } else if (length > 0.0 || s->options.star_streak_px > 0.0) {
        source->kind = BST_SOURCE_OBJECT;
        f->paths[i] = bst_scene_source_path_through(
            direction(c, f->q[0], x - 0.5 * dx, y - 0.5 * dy), source->apparent_mid,
            direction(c, f->q[1], x + 0.5 * dx, y + 0.5 * dy));
        source->path = &f->paths[i];
    }
    return (bst_eval_match_target){x, y, dx, dy};
}

static void add_target(bst_pd_scene *s, bst_pd_frame *f, double x, double y, int point,
                       double angle) {
    int i = f->count++;
    f->places[i] = set_source(s, f, i, x, y, angle);
    double flux = s->flux_e[point], noise_e = noise_at(s, x, y);
    if (!s->options.by_magnitude) { /* SNR at its own position */
        flux = s->snr[point] * noise_e / sqrt(bst_pd_sharpness(s, &f->places[i]));
    }
    double light = bst_camera_illumination(&s->camera, x, y);
    f->sources[i].electrons_per_s = flux / s->exposure_s / (s->options.by_magnitude ? 1.0 : light);
    f->targets[i] = (bst_pd_target){point, s->options.by_magnitude ? flux * light : flux, noise_e};
}

/* Rotation of the camera that moves the image centre along (dx, dy). */
static bst_vec3 turn_for(const bst_camera *c, double dx, double dy) {
    double x = bst_camera_centre_x(c), y = bst_camera_centre_y(c);
    return bst_vec3_cross(bst_camera_unproject(c, x - 0.5 * dx, y - 0.5 * dy),
                          bst_camera_unproject(c, x + 0.5 * dx, y + 0.5 * dy));
}

/* Sets the camera attitude during the exposure. */
static void set_motion(bst_pd_scene *s, bst_pd_frame *f, double heading, double roll) {
    const bst_pd_options *o = &s->options;
    f->motion = (bst_camera_motion){.q_cam_from_gcrf = s->sky ? bst_pd_sky_attitude(s->sky, roll)
                                                              : BST_QUAT_IDENTITY};
    double length = o->known_rate ? o->streak_px : o->star_streak_px;
    if (length > 0.0) {
        f->motion.turn_cam_rad = turn_for(&s->camera, length * cos(heading), length * sin(heading));
    }
    f->time_s[0] = 0.0;
    f->time_s[1] = s->exposure_s;
    for (int end = 0; end < 2; end++) {
        bst_quat turn = bst_quat_from_rotvec(bst_vec3_scale(f->motion.turn_cam_rad, end - 0.5));
        f->q[end] = bst_quat_mul(turn, f->motion.q_cam_from_gcrf);
    }
    f->track = (bst_los_track){2, f->time_s, f->q};
}

int bst_pd_scene_stacked(const bst_pd_scene *s) {
    return s->options.stack > 0 ? (int)s->options.stack : 1;
}

/* Place of a target in cell i, by two uniform numbers. */
static void place_in_cell(const bst_pd_scene *s, int i, const double u[2], double *x, double *y) {
    double origin_x = 0.5 * ((double)s->camera.width_px - s->columns * s->cell_px) - 0.5;
    double origin_y = 0.5 * ((double)s->camera.height_px - s->rows * s->cell_px) - 0.5;
    double span = s->cell_px - s->min_separation_px;
    *x = origin_x + (i % s->columns) * s->cell_px + 0.5 * s->min_separation_px + u[0] * span;
    *y = origin_y + (i / s->columns) * s->cell_px + 0.5 * s->min_separation_px + u[1] * span;
}

/* Places equally many targets of each SNR, alternating over the frame; frames after the last trial
 * serve for chance matches. */
static void place_targets(bst_pd_scene *s, int64_t number, double heading, bst_rng_key key,
                          bst_pd_frame *f) {
    int room = bst_pd_scene_room(s), stacked = bst_pd_scene_stacked(s);
    double from_middle = (double)(number % stacked) - 0.5 * (stacked - 1);
    number /= stacked;
    int64_t first = number * room, last = s->points * s->options.trials;
    int64_t shift = room % s->points == 0 ? number : 0;
    f->count = 0;
    for (int i = 0; i < room && (first + i < last || first >= last); i++) {
        uint64_t draw = 3 * (uint64_t)i;
        double u[3];
        for (uint64_t k = 0; k < 3; k++) {
            u[k] = bst_rng_uniform(key, (uint64_t)number, draw + k);
        }
        double moved[2] = {0.0, 0.0};
        for (uint64_t k = 0; k < 2 && stacked > 1; k++) {
            double rate =
                bst_rng_uniform(key, (uint64_t)number, 3 * (uint64_t)room + 2 * (uint64_t)i + k);
            moved[k] = s->options.rates_px * (2.0 * rate - 1.0) * from_middle;
        }
        double x, y;
        place_in_cell(s, i, u, &x, &y);
        add_target(s, f, x + moved[0], y + moved[1], (int)((first + i + shift) % s->points),
                   s->options.known_rate ? heading : 2.0 * BST_PI * u[2]);
    }
}

/* Adds stars to the targets; copied, because a request has a single list. */
static bst_status add_stars(bst_ctx *ctx, bst_pd_scene *s, const bst_scene_source *stars, int count,
                            int targets, bst_pd_frame *f) {
    int wanted = f->count + count;
    if (wanted > f->source_room) {
        bst_scene_source *more = realloc(f->sources, (size_t)wanted * sizeof *more);
        if (!more) {
            return bst_fail(ctx, BST_ERR_MEMORY, "no memory for %d sources", wanted);
        }
        f->sources = more;
        f->source_room = wanted;
    }
    memcpy(f->sources + targets, stars, (size_t)count * sizeof *stars);
    return bst_pd_sky_stars(ctx, s->sky, &f->track, stars, count, &f->stars);
}

bst_status bst_pd_scene_set(bst_ctx *ctx, bst_pd_scene *s, int64_t number, bool targets,
                            bst_pd_frame *f) {
    uint64_t seed = s->scenario->seed, run = (uint64_t)s->scenario->run;
    uint64_t n = (uint64_t)(number / bst_pd_scene_stacked(s)); /* one attitude per stack */
    bst_rng_key camera = bst_rng_make_key(seed, run, s->name, "pd camera");
    bst_rng_key key = bst_rng_make_key(seed, run, s->name, "pd targets");
    double heading = 2.0 * BST_PI * bst_rng_uniform(camera, n, 0);
    double roll = 2.0 * BST_PI * bst_rng_uniform(camera, n, 1);
    const bst_scene_source *stars = NULL;
    int count = 0;
    set_motion(s, f, heading, roll);
    if (s->sky) {
        BST_TRY(bst_pd_sky_look(ctx, s->sky, &f->track, &stars, &count));
    }
    place_targets(s, number, heading, key, f);
    int drawn = targets ? f->count : 0;
    if (s->sky) {
        BST_TRY(add_stars(ctx, s, stars, count, drawn, f));
    }
    const struct bst_skylight_map *map = s->sky ? bst_pd_sky_map(s->sky) : NULL;
    double dark_e = s->dark_e - bst_camera_readout_e(&s->camera); /* the detector adds that */
    double sky_e = map ? 0.0 : s->sky ? bst_pd_sky_e(s->sky, 0.0, 0.0) : s->sky_e;
    f->request = (bst_render_request){
        .window = {0, 0, (int)s->camera.width_px, (int)s->camera.height_px},
        .track = &f->track,
        .sources = f->sources,
        .count = drawn + count,
        .background_e = sky_e + dark_e,
        .background = map,
        .dark_e = dark_e,
        .key =
            bst_rng_make_key(seed, run, s->name, targets ? "pd noise" : "pd noise without targets"),
        .exposure_id = number};
    return BST_OK;
}

/* Sets the sources of one pair, or one source. Returns their number. */
static int set_pair(bst_pd_scene *s, bst_pd_frame *f, int i, int first,
                    const bst_pd_pair_target *pair, double heading, double direction_rad) {
    double x = f->places[i].x_px, y = f->places[i].y_px, faint = 1.0 / (1.0 + pair->ratio);
    double noise_e = noise_at(s, x, y);
    f->places[i] = set_source(s, f, first, x, y, heading);
    double flux = pair->snr * noise_e / sqrt(bst_pd_sharpness(s, &f->places[i]));
    f->targets[i] = (bst_pd_target){0, flux, noise_e};
    int count = pair->separation_px > 0.0 ? 2 : 1;
    for (int k = 0; k < count; k++) {
        double share = count == 1 ? 1.0 : k == 0 ? 1.0 - faint : faint;
        double apart = pair->separation_px * (count == 1 ? 0.0 : k == 0 ? -faint : 1.0 - faint);
        double at_x = x + apart * cos(direction_rad), at_y = y + apart * sin(direction_rad);
        set_source(s, f, first + k, at_x, at_y, heading);
        f->sources[first + k].electrons_per_s =
            share * flux / s->exposure_s / bst_camera_illumination(&s->camera, at_x, at_y);
    }
    return count;
}

void bst_pd_scene_set_pairs(bst_pd_scene *s, int64_t number, const bst_pd_pair_target *targets,
                            bst_pd_frame *f) {
    uint64_t seed = s->scenario->seed, run = (uint64_t)s->scenario->run, n = (uint64_t)number;
    bst_rng_key key = bst_rng_make_key(seed, run, s->name, "pd pairs");
    double heading = 2.0 * BST_PI * bst_rng_uniform(key, n, 0);
    set_motion(s, f, heading, 0.0);
    f->count = bst_pd_scene_room(s);
    int sources = 0;
    for (int i = 0; i < f->count; i++) {
        uint64_t draw = 1 + 3 * (uint64_t)i;
        const double u[2] = {bst_rng_uniform(key, n, draw), bst_rng_uniform(key, n, draw + 1)};
        place_in_cell(s, i, u, &f->places[i].x_px, &f->places[i].y_px);
        sources += set_pair(s, f, i, sources, &targets[i], heading,
                            2.0 * BST_PI * bst_rng_uniform(key, n, draw + 2));
    }
    double dark_e = s->dark_e - bst_camera_readout_e(&s->camera);
    f->request =
        (bst_render_request){.window = {0, 0, (int)s->camera.width_px, (int)s->camera.height_px},
                             .track = &f->track,
                             .sources = f->sources,
                             .count = sources,
                             .background_e = s->sky_e + dark_e,
                             .dark_e = dark_e,
                             .key = bst_rng_make_key(seed, run, s->name, "pd noise of pairs"),
                             .exposure_id = number};
}
