#include "sim/analysis/check/scenario_rules.h"

#include <math.h>
#include <string.h>

#include "control/control.h"
#include "sim/analysis/check/check_bodies.h"
#include "sim/analysis/check/check_burns.h"
#include "sim/analysis/check/check_reach.h"
#include "sim/analysis/check/no_effect.h"
#include "sim/analysis/loop/loop_model.h"
#include "sim/engine/scenario/loop_timing.h"
#include "sim/world/world_config.h"

/* Errors of element sets grow by 1 to 3 km per day in low orbits, less in high ones (Vallado et al.
 * 2006, AIAA 2006-6753, section VII). */
#define OLD_ELEMENTS_DAYS 14.0
/* fraction of a catalogue's element sets */
#define MANY_OLD 0.1
/* field half angle at which a gnomonic pixel covers half the solid angle of the central one, cos^3
 * = 1/2; and the limit of planar projections */
#define WIDE_HALF_FIELD_DEG 37.5
#define WIDEST_HALF_FIELD_DEG 80.0

/* A sensor of the scenario, to which rules are applied. */
typedef struct subject {
    bst_ctx *ctx;
    const bst_scenario *scenario;
    const bst_world *world;
    const bst_sensor_config *sensor;
    int observer, number;
    char place[600]; /* file and JSON pointer */
} subject;

static const bst_scenario_module_config *module_of(const subject *s, const char *role) {
    return bst_scenario_module(s->scenario, s->observer, s->number, role);
}

/* ---- rules about the whole scenario ---- */

static bst_status no_duration(bst_ctx *ctx, const bst_scenario *scenario, const bst_world *world) {
    (void)world;
    if (scenario->duration_ticks == 0) {
        bst_log(ctx, BST_LOG_WARNING,
                "%s: /duration_s: the run lasts 0 s: no exposure ends in it and nothing is seen; "
                "give a duration_s of at least one period of the exposures",
                scenario->file);
    }
    return BST_OK;
}

/* Old element sets: number and largest age. */
typedef struct ages {
    int old, sets;
    double most_days;
    const char *oldest;
} ages;

/* Notes the age of an object's orbital elements over the run. */
static void note_age(ages *a, const bst_world *world, int body, const char *name,
                     double duration_s) {
    double offset_s;
    if (!bst_world_element_age(world, body, &offset_s)) {
        return;
    }
    double days = fmax(fabs(offset_s), fabs(offset_s + duration_s)) / BST_DAY_S;
    a->sets++;
    a->old += days > OLD_ELEMENTS_DAYS;
    if (days > a->most_days) {
        a->most_days = days;
        a->oldest = name;
    }
}

static void warn_of_age(bst_ctx *ctx, const char *file, const char *what, const ages *a) {
    bst_log(ctx, BST_LOG_WARNING,
            "%s: /epoch_utc: %d of %d element sets of %s are more than %.0f days away from the run "
            "(%s: %.0f days); SGP4 errs by kilometres a day then: as truth they are orbits like "
            "any other, as places of real objects they are not; take element sets of that time",
            file, a->old, a->sets, what, OLD_ELEMENTS_DAYS, a->oldest, a->most_days);
}

/* Listed observers and objects are reported individually; a few old sets in a catalogue are
 * normal. */
static bst_status old_elements(bst_ctx *ctx, const bst_scenario *scenario, const bst_world *world) {
    int objects = bst_world_object_count(world), listed_count = scenario->world.objects.count;
    ages listed = {0}, catalogued = {0};
    for (int o = 0; o < bst_world_observer_count(world); o++) {
        note_age(&listed, world, objects + o, bst_world_observer_name(world, o),
                 scenario->duration_s);
    }
    for (int o = 0; o < objects; o++) {
        note_age(o < listed_count ? &listed : &catalogued, world, o,
                 bst_world_object(world, o)->name, scenario->duration_s);
    }
    if (listed.old > 0) {
        warn_of_age(ctx, scenario->file, "observers and listed objects", &listed);
    }
    if (catalogued.old > MANY_OLD * catalogued.sets) {
        warn_of_age(ctx, scenario->file, "the catalogues", &catalogued);
    }
    return BST_OK;
}

/* Warns if the run lies beyond the measured Earth orientation parameters. */
static bst_status predicted_earth(bst_ctx *ctx, const bst_scenario *scenario,
                                  const bst_world *world) {
    bst_world_warn_earth_orientation(ctx, scenario->file, world, scenario->duration_s);
    return BST_OK;
}

static bst_status no_effect(bst_ctx *ctx, const bst_scenario *scenario, const bst_world *world) {
    (void)world;
    bst_no_effect_warn(ctx, scenario);
    return BST_OK;
}

static void warn_late(bst_ctx *ctx, const bst_scenario *scenario, const char *list, int index,
                      const bst_config_list *burns) {
    const bst_burn_config *burn = burns->items;
    for (int b = 0; b < burns->count; b++) {
        if (burn[b].time_s >= scenario->duration_s) {
            bst_log(
                ctx, BST_LOG_WARNING,
                "%s: %s/%d/burns/%d/time_s: the burn at %g s is after the run's end at %g s and "
                "changes nothing",
                scenario->file, list, index, b, burn[b].time_s, scenario->duration_s);
        }
    }
}

static bst_status late_burns(bst_ctx *ctx, const bst_scenario *scenario, const bst_world *world) {
    (void)world;
    const bst_object_config *objects = scenario->world.objects.items;
    const bst_observer_config *observers = scenario->observers.items;
    for (int i = 0; i < scenario->world.objects.count; i++) {
        warn_late(ctx, scenario, "/world/objects", i, &objects[i].burns);
    }
    for (int i = 0; i < scenario->observers.count; i++) {
        warn_late(ctx, scenario, "/observers", i, &observers[i].burns);
    }
    return BST_OK;
}

/* ---- rules about a sensor ---- */

/* True if control acts on tracks alone. */
static bool follows_tracks(const subject *s) {
    const bst_scenario_module_config *control = module_of(s, "control");
    if (!control || control->desc->config != bst_control_config_table) {
        return false;
    }
    const bst_control_config *config = control->config;
    return config->strategy == BST_CONTROL_TRACK;
}

static bst_status no_modules(const subject *s) {
    static const char *const roles[] = {"scenegen", "obsgen"};
    bool any = false, sees = false, moves = module_of(s, "gimbal") != NULL;
    for (int m = 0; m < s->scenario->module_count; m++) {
        const bst_scenario_module_config *module = &s->scenario->modules[m];
        any |= module->observer == s->observer && module->sensor == s->number;
    }
    for (size_t r = 0; r < sizeof roles / sizeof *roles; r++) {
        sees |= module_of(s, roles[r]) != NULL;
    }
    if (!any) {
        bst_log(s->ctx, BST_LOG_WARNING,
                "%s/modules: there are none, so that nothing is seen or recorded of this sensor; "
                "frames need a gimbal and a scenegen (or an obsgen)",
                s->place);
    } else if (!moves) {
        bst_log(s->ctx, BST_LOG_WARNING,
                "%s/modules/gimbal: there is none, so that nothing points the camera; a gimbal of "
                "type ideal keeps it where control wants it",
                s->place);
    } else if (!sees && module_of(s, "tracker")) {
        bst_log(s->ctx, BST_LOG_WARNING,
                "%s/modules: there is a tracker but neither scenegen nor obsgen: it gets no "
                "detections",
                s->place);
    } else if (follows_tracks(s) && !module_of(s, "tracker")) {
        bst_log(s->ctx, BST_LOG_WARNING,
                "%s/modules/tracker: there is none, so that control of strategy track finds no "
                "target and searches until the end; add one, or take the strategy rate or stare",
                s->place);
    }
    return BST_OK;
}

static bst_status long_exposure(const subject *s) {
    const bst_exposure_config *e = &s->sensor->exposure;
    if (e->exposure_s > e->period_s) {
        bst_log(s->ctx, BST_LOG_WARNING,
                "%s/exposure: an exposure_s of %g s is longer than the period_s of %g s: exposures "
                "follow one another without a pause, one every %g s; make period_s that long",
                s->place, e->exposure_s, e->period_s, e->exposure_s);
    }
    return BST_OK;
}

static bst_status no_frames(const subject *s) {
    const bst_exposure_config *e = &s->sensor->exposure;
    bst_loop_timing timing;
    bst_loop_timing_of(s->scenario, s->observer, s->number, &timing);
    double end_s = e->first_s + timing.exposure_s;
    if (s->scenario->duration_ticks > 0 && end_s > s->scenario->duration_s) {
        bst_log(s->ctx, BST_LOG_WARNING,
                "%s/exposure/first_s: the first exposure, from %g s, ends at %g s, after the run's "
                "end at %g s: nothing is seen; begin earlier or make duration_s longer",
                s->place, e->first_s, end_s, s->scenario->duration_s);
    }
    if (e->dropped_fraction == 1.0) {
        bst_log(s->ctx, BST_LOG_WARNING,
                "%s/exposure/dropped_fraction: 1 loses every frame, so that nothing is seen; give "
                "less than 1",
                s->place);
    }
    return BST_OK;
}

static bst_status wide_field(const subject *s) {
    const bst_camera *c = &s->sensor->camera;
    double half = atan(0.5 * hypot((double)c->width_px, (double)c->height_px) *
                       tan(c->pixel_scale_arcsec * BST_ARCSEC_RAD)) /
                  BST_DEG_RAD;
    if (half > WIDEST_HALF_FIELD_DEG) {
        return bst_fail(s->ctx, BST_ERR_CONFIG,
                        "%s/camera: the field's diagonal is %.0f degrees; the projection is "
                        "gnomonic (onto a plane) and allows less than %.0f; reduce "
                        "pixel_scale_arcsec or the number of pixels",
                        s->place, 2.0 * half, 2.0 * WIDEST_HALF_FIELD_DEG);
    }
    if (half > WIDE_HALF_FIELD_DEG) {
        bst_log(s->ctx, BST_LOG_WARNING,
                "%s/camera: the field's diagonal is %.0f degrees; the projection is gnomonic (onto "
                "a plane), so that a pixel in the corner covers %.2f of the sky that one in the "
                "middle does: no wide-angle lens does that",
                s->place, 2.0 * half, pow(cos(half * BST_DEG_RAD), 3.0));
    }
    return BST_OK;
}

static void warn_short(const subject *s, const char *role, const char *key, double value_s,
                       double least_s, const char *effect) {
    if (value_s > 0.0 && value_s < least_s) {
        bst_log(s->ctx, BST_LOG_WARNING,
                "%s/modules/%s/%s: %g s is shorter than frames allow (%g s here): %s; make it "
                "longer or the period_s of the exposures shorter",
                s->place, role, key, value_s, least_s, effect);
    }
}

static bst_status short_times(const subject *s) {
    bst_loop_timing timing;
    bst_loop_timing_of(s->scenario, s->observer, s->number, &timing);
    const bst_scenario_module_config *tracker = module_of(s, "tracker"),
                                     *control = module_of(s, "control");
    double period = timing.period_s, value, frames;
    if (bst_scenario_module_number(tracker, "initiation_gap_s", &value)) {
        warn_short(s, "tracker", "initiation_gap_s", value, period, "no track can begin");
    }
    if (bst_scenario_module_number(tracker, "max_coast_s", &value)) {
        warn_short(s, "tracker", "max_coast_s", value, period,
                   "every track ends before its next frame");
    }
    if (bst_scenario_module_number(control, "dwell_timeout_s", &value) &&
        bst_scenario_module_number(control, "dwell_frames", &frames)) {
        warn_short(s, "control", "dwell_timeout_s", value, (frames + 1.0) * period,
                   "a search leaves each place before its dwell_frames are exposed");
    }
    if (bst_scenario_module_number(control, "acquire_timeout_s", &value)) {
        double hits = 2.0;
        (void)bst_scenario_module_number(tracker, "confirm_hits", &hits);
        warn_short(s, "control", "acquire_timeout_s", value, hits * period,
                   "a candidate is given up before it can be confirmed");
    }
    return BST_OK;
}

/* Numbers differ by more than the rounding of a resolved scenario that is read again. */
#define REPLACED_SHARE 1e-9

static void warn_replaced(const subject *s, const char *key, double given, double used,
                          const char *by) {
    if (fabs(given - used) > REPLACED_SHARE * fabs(used)) { /* false for NAN: not given */
        bst_log(s->ctx, BST_LOG_WARNING,
                "%s/camera/%s: %.6g is not used: %s/camera/%s gives %.6g; leave out one of them",
                s->place, key, given, strstr(s->place, "/observers"), by, used);
    }
}

/* Keys of which one replaces the other. */
static bst_status replaced_figures(const subject *s) {
    const bst_camera *c = bst_world_camera(s->world, s->observer, s->number);
    if (c->ensquared_energy > 0.0) {
        warn_replaced(s, "psf_fwhm_px", s->sensor->given_psf_fwhm_px, c->psf_fwhm_px,
                      "ensquared_energy");
    }
    if (c->zero_point_mag > 0.0) {
        warn_replaced(s, "throughput", s->sensor->given_throughput, c->throughput,
                      "zero_point_mag");
        warn_replaced(s, "photon_flux_v0_per_s_m2", s->sensor->given_flux_v0,
                      c->photon_flux_v0_per_s_m2, "zero_point_mag");
    }
    return BST_OK;
}

/* ---- the list ---- */

typedef struct rule {
    const char *name, *looks_for;
    bst_status (*of_scenario)(bst_ctx *, const bst_scenario *, const bst_world *);
    bst_status (*of_sensor)(const subject *);
    bst_status (*of_simulation)(bst_ctx *, const bst_scenario *, const bst_simulation *);
} rule;

/* Warns of small stability margins of the control loops. */
static bst_status loops(bst_ctx *ctx, const bst_scenario *scenario, const bst_simulation *sim) {
    (void)sim;
    bst_loop_warn(ctx, scenario);
    return BST_OK;
}

static const rule rules[] = {
    {"duration", "a run of 0 s", no_duration, NULL, NULL},
    {"element_age", "element sets more than 14 days away from the run", old_elements, NULL, NULL},
    {"earth_orientation",
     "dates beyond the table of the Earth's orientation, predicted with an uncertainty",
     predicted_earth, NULL, NULL},
    {"burns", "burns after the end of the run", late_burns, NULL, NULL},
    {"modules",
     "a sensor without modules, without a gimbal, with a tracker and no detections, or with "
     "control that follows tracks and no tracker",
     NULL, no_modules, NULL},
    {"exposure_period", "an exposure longer than the period of the exposures", NULL, long_exposure,
     NULL},
    {"lost_frames", "a sensor all of whose frames are lost, or whose first one ends after the run",
     NULL, no_frames, NULL},
    {"wide_field", "a field too wide for the gnomonic projection (an error from 160 degrees on)",
     NULL, wide_field, NULL},
    {"replaced", "psf_fwhm_px beside ensquared_energy, throughput or flux beside zero_point_mag",
     NULL, replaced_figures, NULL},
    {"no_effect",
     "keys that have no effect because of another: distortion on board without "
     "override_distortion, "
     "rate_hz of a module that steps on its inputs",
     no_effect, NULL, NULL},
    {"short_times", "times of tracker and control that are over before the frames they wait for",
     NULL, short_times, NULL},
    {"loops", "loops that are unstable or have thin margins", NULL, NULL, loops},
    {"burn_rates", "burns that turn a target's line of sight faster than its tracker follows", NULL,
     NULL, bst_check_burns},
    {"reach",
     "times at which the cue is out of reach: Earth, keep-out cones, travel, limits, "
     "keyhole; slews, steps of a search and scans that the mount's limits do not allow",
     NULL, NULL, bst_check_reach},
    {"bodies",
     "times at which the Earth, the Moon or the Sun lies in the field, or the sky at the boresight "
     "exceeds the full well",
     NULL, NULL, bst_check_bodies},
};

static bst_status apply_to_sensors(bst_ctx *ctx, const rule *r, const bst_scenario *scenario,
                                   const bst_world *world) {
    const bst_observer_config *observers = scenario->observers.items;
    for (int o = 0; o < scenario->observers.count; o++) {
        const bst_sensor_config *sensors = observers[o].sensors.items;
        for (int i = 0; i < observers[o].sensors.count; i++) {
            subject s = {ctx, scenario, world, &sensors[i], o, i, ""};
            snprintf(s.place, sizeof s.place, "%s: /observers/%d/sensors/%d", scenario->file, o, i);
            BST_TRY(r->of_sensor(&s));
        }
    }
    return BST_OK;
}

bst_status bst_check_rules_apply(bst_ctx *ctx, const bst_scenario *scenario,
                                 const bst_simulation *simulation) {
    const bst_world *world = bst_simulation_world(simulation);
    for (size_t i = 0; i < sizeof rules / sizeof *rules; i++) {
        const rule *r = &rules[i];
        if (r->of_scenario) {
            BST_TRY(r->of_scenario(ctx, scenario, world));
        }
        if (r->of_sensor) {
            BST_TRY(apply_to_sensors(ctx, r, scenario, world));
        }
        if (r->of_simulation) {
            BST_TRY(r->of_simulation(ctx, scenario, simulation));
        }
    }
    return BST_OK;
}

void bst_check_rules_print(FILE *out) {
    for (size_t i = 0; i < sizeof rules / sizeof *rules; i++) {
        fprintf(out, "%-18s %s\n", rules[i].name, rules[i].looks_for);
    }
}
