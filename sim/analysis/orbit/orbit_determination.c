#include "sim/analysis/orbit/orbit_determination.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cjson/cJSON.h>

#include "sim/astro/bodies.h"
#include "sim/astro/sgp4_fit.h"
#include "sim/astro/sky_clock.h"
#include "sim/core/json_number.h"
#include "sim/io/draft_file.h"
#include "sim/io/oem_writer.h"
#include "sim/io/omm_writer.h"
#include "sim/io/tdm_writer.h"
#include "sim/run/track_files.h"
#include "tracker/orbit/orbit_initial.h"
#include "tracker/orbit/orbit_photocentre.h"

/* ------------------------------------------------------------------ the orbit */

typedef struct orbit {
    const bst_orbit_determination *request;
    bst_time epoch;
    int norad;
    const bst_run_track *track;
    bst_od_observation *items;
    double *chi2;
    const bst_astro_eop *eop; /* of the scenario, or own_eop */
    bst_astro_eop *own_eop;
    bst_sky_clock *clock;
    bst_gravity *gravity;
    bst_force_model forces;
    bst_od_sgp4 sgp4;
    bst_world_motion_law motion; /* law in the scenario */
    const char *model;           /* description of the force model */
    bst_od_options options;
    bst_od_solution solution;
    bst_od_report report;
    bst_od_path *path;
    bst_elements mean;
    double mean_rms_m; /* NAN: no mean elements */
    char object[96];
} orbit;

static bst_time time_at(const orbit *o, double seconds) {
    return bst_time_add(o->epoch, seconds);
}

static bst_status open_forces(bst_ctx *ctx, orbit *o) {
    static const char *const words[] = {
        "forces of the scenario", "gravity to degree 20, Sun and Moon", "J2", "two bodies", "SGP4"};
    const bst_world_motion_law *m = &o->motion;
    int kind = o->request->forces;
    if (kind == BST_ORBIT_FORCES_SCENARIO && !m->forces) {
        kind = m->sgp4 ? BST_ORBIT_FORCES_SGP4 : BST_ORBIT_FORCES_FULL;
    }
    o->model = words[kind];
    o->options.motion.epoch = o->epoch;
    if (!o->eop) {
        BST_TRY(bst_astro_eop_builtin(ctx, &o->own_eop));
        o->eop = o->own_eop;
    }
    bst_astro_eop_warn(
        ctx, o->eop,
        time_at(o, o->track->items[o->track->count - 1].od.observer.time_s + o->request->predict_s),
        "");
    BST_TRY(bst_sky_clock_create(ctx, o->eop, &o->clock));
    if (kind == BST_ORBIT_FORCES_SGP4) {
        o->sgp4 = (bst_od_sgp4){.clock = o->clock, .bstar = m->bstar};
        o->options.motion.sgp4 = &o->sgp4;
        return BST_OK;
    }
    if (kind == BST_ORBIT_FORCES_SCENARIO) {
        o->options.motion.forces = m->forces;
        return BST_OK;
    }
    if (kind == BST_ORBIT_FORCES_TWO_BODY) {
        return BST_OK;
    }
    BST_TRY(bst_gravity_builtin(ctx, kind == BST_ORBIT_FORCES_J2 ? 2 : 20,
                                kind == BST_ORBIT_FORCES_J2 ? 0 : 20, &o->gravity));
    o->forces = (bst_force_model){.gravity = o->gravity,
                                  .eop = o->eop,
                                  .sun = kind == BST_ORBIT_FORCES_FULL,
                                  .moon = kind == BST_ORBIT_FORCES_FULL};
    o->options.motion.forces = &o->forces;
    return BST_OK;
}

static bst_status solve(bst_ctx *ctx, orbit *o) {
    size_t n = (size_t)o->track->count;
    o->items = malloc(n * sizeof *o->items);
    o->chi2 = malloc(n * sizeof *o->chi2);
    if (!o->items || !o->chi2) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a track's observations");
    }
    if (n > INT32_MAX / 4) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "%zu observations are too many", n);
    }
    for (size_t i = 0; i < n; i++) {
        o->items[i] = o->track->items[i].od;
    }
    o->options.reject_chi2 = o->request->reject_chi2;
    o->options.scale_variance = true;
    BST_TRY(
        bst_od_determine(ctx, o->items, (int)n, &o->options, o->chi2, &o->solution, &o->report));
    return bst_od_path_create(ctx, &o->options.motion, &o->solution.state, &o->path);
}

/* Fits mean elements to one revolution around the epoch of the solution, or to the arc if it is
 * longer. */
static bst_status fit_mean(bst_ctx *ctx, orbit *o) {
    enum { PLACES = 73 };
    bst_sgp4_place places[PLACES];
    bst_sky_rotation sky;
    const bst_od_state *s = &o->solution.state;
    double a = bst_astro_kepler_elements_of(BST_EARTH_MU_M3PS2, s->position_m, s->velocity_mps)
                   .semi_major_axis_m;
    double half = BST_PI * sqrt(a * a * a / BST_EARTH_MU_M3PS2);
    half = fmax(half, fmax(o->items[o->track->count - 1].observer.time_s - s->time_s,
                           s->time_s - o->items[0].observer.time_s));
    /* the epoch is written to the microsecond */
    double epoch_s = round(s->time_s * 1e6) * 1e-6;
    bst_vec3 r = {0}, v = {0};
    bst_status status = BST_OK;
    for (int pass = 0; pass < 2 && status == BST_OK;
         pass++) { /* from the epoch backwards and forwards */
        for (int i = 0; i <= PLACES / 2 && status == BST_OK; i++) {
            int index = pass ? PLACES / 2 + i : PLACES / 2 - i;
            double offset = half * (index - PLACES / 2) / (PLACES / 2);
            bst_od_state there;
            status = bst_od_path_state(ctx, o->path, epoch_s + offset, &there);
            status = status == BST_OK
                         ? bst_sky_clock_at(ctx, o->clock, time_at(o, epoch_s + offset), &sky)
                         : status;
            if (status == BST_OK) {
                const bst_mat3 *m = &sky.frames.gcrf_from_teme;
                places[index] = (bst_sgp4_place){offset / 60.0,
                                                 bst_mat3_transpose_mul_vec(m, there.position_m)};
                if (i == 0) {
                    r = places[index].position_teme_m;
                    v = bst_mat3_transpose_mul_vec(m, there.velocity_mps);
                }
            }
        }
    }
    BST_TRY(status);
    o->mean.bstar = o->options.motion.sgp4 ? o->sgp4.bstar : 0.0;
    bst_time_utc(time_at(o, epoch_s), &o->mean.epoch_utc_jd1, &o->mean.epoch_utc_jd2);
    snprintf(o->mean.name, sizeof o->mean.name, "%.31s", o->object);
    BST_TRY(bst_sgp4_fit(ctx, places, PLACES, r, v, &o->mean, &o->mean_rms_m));
    return BST_OK;
}

/* ------------------------------------------------------------------ files */

/* Rows of the OEM at constant steps from the first observation. */
typedef struct rows {
    const orbit *o;
    double from_s, step_s, to_s;
    int64_t count;
} rows;

static bst_status row_of(void *user, bst_ctx *ctx, int64_t row, bst_time *time, bst_vec3 *r,
                         bst_vec3 *v) {
    const rows *w = user;
    bst_od_state s;
    double t = row == w->count - 1 ? w->to_s : w->from_s + w->step_s * (double)row;
    *time = time_at(w->o, t);
    BST_TRY(bst_od_path_state(ctx, w->o->path, t, &s));
    *r = s.position_m;
    *v = s.velocity_mps;
    return BST_OK;
}

static bst_status write_oem(bst_ctx *ctx, const orbit *o, FILE *stream) {
    char created[32], comment[400];
    const bst_od_solution *s = &o->solution;
    rows w = {.o = o,
              .from_s = o->items[0].observer.time_s,
              .to_s = o->items[o->track->count - 1].observer.time_s + o->request->predict_s};
    w.step_s = o->request->step_s > 0.0 ? o->request->step_s
                                        : fmin(60.0, fmax(1.0, (w.to_s - w.from_s) / 20.0));
    w.count = (int64_t)ceil((w.to_s - w.from_s) / w.step_s - 1e-9) + 1;
    bst_run_creation_date(created);
    snprintf(comment, sizeof comment,
             "from %d directions of %s/%s over %.6g s, angles only\nrms of residuals %.4f arcsec, "
             "chi2/dof %.4f, covariance multiplied by %.4f",
             s->used, o->track->sensor->observer, o->track->sensor->name,
             o->items[o->track->count - 1].observer.time_s - w.from_s, s->rms_rad / BST_ARCSEC_RAD,
             s->dof > 0 ? s->chi2 / s->dof : 0.0, s->variance_factor);
    bst_oem_covariance covariance = {.epoch = time_at(o, s->state.time_s)};
    memcpy(covariance.matrix, s->covariance, sizeof covariance.matrix);
    const bst_oem_segment segment = {.object_name = o->object,
                                     .object_id = o->object,
                                     .ref_frame = "GCRF",
                                     .comment = comment,
                                     .hermite_degree = w.count >= 4 ? 7 : 3,
                                     .covariance = &covariance,
                                     .series = {w.count, row_of, &w}};
    BST_TRY(bst_oem_write_head(ctx, stream, created, "BORESIGHT", NULL));
    return bst_oem_write_segment(ctx, stream, &segment);
}

static bst_status write_omm(bst_ctx *ctx, const orbit *o, FILE *stream) {
    char created[32], comment[200];
    bst_run_creation_date(created);
    snprintf(comment, sizeof comment,
             "from %d directions, angles only; SGP4 follows the orbit to %.0f m rms",
             o->solution.used, o->mean_rms_m);
    return bst_omm_write(ctx, stream, &o->mean, created, "BORESIGHT", comment);
}

static bst_status write_tdm(bst_ctx *ctx, const orbit *o, FILE *stream) {
    char created[32];
    bst_run_creation_date(created);
    BST_TRY(bst_tdm_write_head(ctx, stream, created, "BORESIGHT", "angles of a simulated run"));
    return bst_track_write_tdm(ctx, stream, o->track, NULL,
                               "measured directions, independent from frame to frame");
}

static bst_status write_json(bst_ctx *ctx, const orbit *o, FILE *stream) {
    fputc('[', stream);
    BST_TRY(bst_track_write_json(ctx, stream, o->track, o->norad, true));
    fputs("\n]\n", stream);
    return BST_OK;
}

static void add_vector(cJSON *node, const char *key, bst_vec3 v) {
    const double numbers[3] = {v.x, v.y, v.z};
    cJSON_AddItemToObject(node, key, cJSON_CreateDoubleArray(numbers, 3));
}

static bst_status write_report(bst_ctx *ctx, const orbit *o, FILE *stream) {
    const bst_od_solution *s = &o->solution;
    bst_astro_kepler_elements k = bst_astro_kepler_elements_of(
        bst_od_gm(&o->options.motion), s->state.position_m, s->state.velocity_mps);
    char utc[40];
    cJSON *node = cJSON_CreateObject();
    cJSON_AddStringToObject(node, "object", o->object);
    cJSON_AddStringToObject(node, "observer", o->track->sensor->observer);
    cJSON_AddStringToObject(node, "sensor", o->track->sensor->name);
    cJSON_AddNumberToObject(node, "track", (double)o->track->id);
    cJSON_AddStringToObject(node, "first_orbit", bst_od_method_name(o->report.method));
    cJSON_AddNumberToObject(node, "used", s->used);
    cJSON_AddNumberToObject(node, "rejected", s->rejected);
    cJSON_AddNumberToObject(node, "without_attitude", (double)o->track->skipped);
    bst_json_add_number(
        node, "arc_s", o->items[o->track->count - 1].observer.time_s - o->items[0].observer.time_s);
    bst_json_add_number(node, "rms_arcsec", s->rms_rad / BST_ARCSEC_RAD);
    cJSON_AddStringToObject(node, "motion", o->model);
    bst_json_add_number(node, "chi2", s->chi2 / s->variance_factor);
    bst_json_add_number(node, "chi2_stated", s->chi2);
    cJSON_AddNumberToObject(node, "dof", s->dof);
    bst_json_add_number(node, "covariance_factor", s->variance_factor);
    bst_json_add_number(node, "radius_m", 2.0 * o->options.photocentre_m);
    bst_time_to_utc(time_at(o, s->state.time_s), 9, utc, sizeof utc);
    cJSON_AddStringToObject(node, "epoch_utc", utc);
    bst_json_add_number(node, "epoch_s", s->state.time_s);
    add_vector(node, "position_gcrf_m", s->state.position_m);
    add_vector(node, "velocity_gcrf_mps", s->state.velocity_mps);
    cJSON *matrix = cJSON_AddArrayToObject(node, "covariance_gcrf");
    for (int i = 0; i < 6; i++) {
        cJSON_AddItemToArray(matrix, cJSON_CreateDoubleArray(s->covariance[i], 6));
    }
    bst_json_add_number(node, "bend", s->bend);
    bst_json_add_number(node, "range_m", s->range_m);
    bst_json_add_number(node, "range_sigma_m", s->range_sigma_m);
    cJSON *elements = cJSON_AddObjectToObject(node, "osculating");
    bst_json_add_number(elements, "semi_major_axis_m", k.semi_major_axis_m);
    bst_json_add_number(elements, "eccentricity", k.eccentricity);
    bst_json_add_number(elements, "inclination_deg", k.inclination_rad / BST_DEG_RAD);
    bst_json_add_number(elements, "raan_deg", k.raan_rad / BST_DEG_RAD);
    bst_json_add_number(elements, "arg_perigee_deg", k.arg_perigee_rad / BST_DEG_RAD);
    bst_json_add_number(elements, "mean_anomaly_deg", k.mean_anomaly_rad / BST_DEG_RAD);
    if (isfinite(o->mean_rms_m)) {
        bst_json_add_number(node, "mean_elements_rms_m", o->mean_rms_m);
    }
    cJSON *residuals = cJSON_AddArrayToObject(node, "observations");
    for (int64_t i = 0; i < o->track->count; i++) {
        cJSON *item = cJSON_CreateObject();
        bst_time_to_utc(o->track->items[i].time, 6, utc, sizeof utc);
        cJSON_AddStringToObject(item, "utc", utc);
        bst_json_add_number(item, "chi2", o->chi2[i] / s->variance_factor);
        cJSON_AddItemToArray(residuals, item);
    }
    char *text = cJSON_Print(node);
    cJSON_Delete(node);
    if (!text) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a report");
    }
    fprintf(stream, "%s\n", text);
    cJSON_free(text);
    return BST_OK;
}

static bst_status write_file(bst_ctx *ctx, const orbit *o, const char *path,
                             bst_status (*write)(bst_ctx *, const orbit *, FILE *)) {
    bst_draft draft;
    if (!path) {
        return BST_OK;
    }
    BST_TRY(bst_draft_open(ctx, path, &draft));
    return bst_draft_close(ctx, &draft, write(ctx, o, draft.stream));
}

/* ------------------------------------------------------------------ the command */

/* maximum variance factor that a covariance error can explain */
static const double MOST_FACTOR = 4.0;

static void print_orbit(const orbit *o) {
    const bst_od_solution *s = &o->solution;
    const bst_vec3 r = s->state.position_m, v = s->state.velocity_mps;
    bst_astro_kepler_elements k = bst_astro_kepler_elements_of(bst_od_gm(&o->options.motion), r, v);
    char utc[40];
    const double(*c)[6] = s->covariance;
    double p = c[0][0] + c[1][1] + c[2][2], w = c[3][3] + c[4][4] + c[5][5];
    bst_time_to_utc(time_at(o, s->state.time_s), 3, utc, sizeof utc);
    printf("%s/%s, track %" PRId64 " (%s)\n", o->track->sensor->observer, o->track->sensor->name,
           o->track->id, o->object);
    printf("  observations    %12d used, %d left out, %" PRId64 " without attitude from stars\n",
           s->used, s->rejected, o->track->skipped);
    printf("  arc             %12.1f s\n",
           o->items[o->track->count - 1].observer.time_s - o->items[0].observer.time_s);
    printf("  first orbit     %12s\n", bst_od_method_name(o->report.method));
    printf("  residuals       %12.3f arcsec rms, chi2/dof %.3f\n", s->rms_rad / BST_ARCSEC_RAD,
           s->dof > 0 ? s->chi2 / s->dof : 0.0);
    printf("  covariance      %12.3f times what the measurements state, by their residuals\n",
           s->variance_factor);
    printf("  radius          %12.3f m, by which the centre of light may be off that of mass\n",
           2.0 * o->options.photocentre_m);
    printf("  motion          %12s\n", o->model);
    printf("  epoch        %s\n", utc);
    printf("  position, GCRF  %.6f %.6f %.6f km, +- %.3f km\n", r.x * 1e-3, r.y * 1e-3, r.z * 1e-3,
           sqrt(p) * 1e-3);
    printf("  velocity, GCRF  %.9f %.9f %.9f km/s, +- %.6f km/s\n", v.x * 1e-3, v.y * 1e-3,
           v.z * 1e-3, sqrt(w) * 1e-3);
    printf("  range           %12.3f km, +- %.3f km\n", s->range_m * 1e-3, s->range_sigma_m * 1e-3);
    printf("  a, e, i         %.3f km, %.6f, %.4f deg\n", k.semi_major_axis_m * 1e-3,
           k.eccentricity, k.inclination_rad / BST_DEG_RAD);
    if (s->variance_factor > MOST_FACTOR) {
        printf(
            "  note: residuals are far above the measurements' errors: a manoeuvre, other forces "
            "or another object's observations; the covariance does not hold\n");
    }
    if (s->bend > 0.5) {
        printf("  note: the arc is short for its errors, which may be larger than stated\n");
    }
    if (o->report.other_chi2 < o->report.first_chi2 + 25.0) {
        printf("  note: another orbit explains the first part of the arc nearly as well\n");
    }
}

static bst_status determine(bst_ctx *ctx, const bst_orbit_determination *q, orbit *o) {
    bst_track_object(o->track, o->object, sizeof o->object);
    o->mean_rms_m = NAN;
    BST_TRY(open_forces(ctx, o));
    bst_status status = solve(ctx, o);
    if (status != BST_OK) {
        return bst_fail_prefix(ctx, status, "track %" PRId64 " of %s/%s", o->track->id,
                               o->track->sensor->observer, o->track->sensor->name);
    }
    print_orbit(o);
    if (q->omm) {
        BST_TRY(fit_mean(ctx, o));
        printf("  mean elements   %12.3f km rms from the orbit\n", o->mean_rms_m * 1e-3);
    }
    BST_TRY(write_file(ctx, o, q->oem, write_oem));
    BST_TRY(write_file(ctx, o, q->omm, write_omm));
    BST_TRY(write_file(ctx, o, q->tdm, write_tdm));
    BST_TRY(write_file(ctx, o, q->json, write_json));
    return write_file(ctx, o, q->report, write_report);
}

const char *bst_orbit_tdm_option(const bst_orbit_determination *q) {
    const bst_tdm_request *a = &q->choice.angles;
    return a->observer                                     ? "observer"
           : a->observer_name                              ? "observer-name"
           : a->object                                     ? "object"
           : q->sigma_arcsec > 0.0                         ? "sigma"
           : q->aberration != BST_ORBIT_ABERRATION_DEFAULT ? "aberration"
                                                           : NULL;
}

const char *bst_orbit_run_option(const bst_orbit_determination *q) {
    return q->choice.track > 0 ? "track" : q->choice.sensor ? "sensor" : NULL;
}

bst_status bst_orbit_determine(bst_ctx *ctx, const bst_orbit_determination *q, const char *path) {
    bst_orbit_request wanted = q->choice;
    wanted.angles.sigma_rad = (q->sigma_arcsec > 0.0 ? q->sigma_arcsec : 1.0) * BST_ARCSEC_RAD;
    wanted.angles.aberrated = q->aberration == BST_ORBIT_ABERRATION_CONTAINED;
    bst_orbit_choice c = {.items = NULL};
    orbit o = {.request = q, .track = &c.track};
    bst_status status = bst_orbit_choose(ctx, &wanted, path, &c);
    o.epoch = c.epoch;
    o.norad = c.norad;
    o.motion = c.motion;
    o.options.photocentre_m =
        q->radius_m < 0.0 ? bst_od_photocentre_of_area(c.area_m2) : 0.5 * q->radius_m;
    o.eop = c.scene.world ? bst_world_earth_orientation(c.scene.world) : NULL;
    status = status == BST_OK ? determine(ctx, q, &o) : status;
    bst_od_path_free(o.path);
    bst_gravity_free(o.gravity);
    bst_sky_clock_free(o.clock);
    bst_astro_eop_free(o.own_eop);
    free(o.items);
    free(o.chi2);
    bst_orbit_choice_free(&c);
    return status;
}
