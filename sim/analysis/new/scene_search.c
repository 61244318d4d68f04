#include "sim/analysis/new/scene_search.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sim/analysis/check/boresight_sky.h"
#include "sim/analysis/new/reference_sensor.h"
#include "sim/analysis/new/scenario_template.h"
#include "sim/analysis/new/sensor_design.h"
#include "sim/cli/plugins.h"
#include "sim/world/world.h"
#include "sim/world/world_config.h"

/* The search looks at one instant every LOOK_S for two days. Element sets may be AGE_S old at its
 * end: `boresight check` warns of sets older than two weeks. */
#define SEARCH_S (2.0 * BST_DAY_S)
#define LOOK_S 20.0
#define AGE_S (13.9 * BST_DAY_S)
#define DURATION_S 120.0
#define LEAST_FRAMES 60.0
/* Least angles between boresight and bodies: stray light of bright bodies is not simulated. */
#define SUN_CLEAR_DEG 30.0
#define EARTH_CLEAR_DEG 0.4
#define EARTH_WISHED_DEG 5.0
/* Least angle between a body and the corner of the field. */
#define MARGIN_DEG 0.15
/* Least height above the Earth at which the target is seen past the limb. Airglow ends there: the
 * highest bright layer, O I 557.7 nm, is at 97 km (Khomich, Semenov and Shefov, Airglow as an
 * Indicator of Upper Atmospheric Structure and Dynamics, 2008). Air has 5e-7 of its density on the
 * ground (U.S. Standard Atmosphere 1976: 5.6e-7 and 1.2 kg/m3), and so has the light that it
 * scatters. The sky there is computed by the model of the frames. */
#define LIMB_CLEAR_M 100e3
/* The same for the corner of the field. By that model the glow above the day side has V 10.5 per
 * square arcsecond there (V 2.4 on the ground, 8 km of scale height): 8e4 e- in half a second, a
 * pixel of 3 arcsec and an aperture of 0.15 m, within the full well. With 80 km the stars built
 * into the program are too few for pair 40906, 46561 of tests/e2e/test_new.py. */
#define CORNER_CLEAR_M 60e3
/* Least number of catalogue stars in the field at any time of the run. In frames of smeared stars
 * image processing identifies about half of them; runs with 8 to 12 lost the attitude. */
#define LEAST_STARS 14
/* Least SNR of such a star, as a point; its light is smeared over several pixels. */
#define STAR_SNR 20.0
#define FAINTEST_STARS_V_MAG 12.5
#define SIDE_PX 1024
#define SMALL_SIDE_PX 512
#define MOON_CLEAR_DEG 3.0
/* Nearer targets are discs, not points, to a telescope. */
#define LEAST_RANGE_M 20e3
/* Half of the rate that the mount of leo_leo_pass.json follows. */
#define MOST_RATE_ARCSEC_PER_S 3600.0
enum { LOOKS = (int)(SEARCH_S / LOOK_S) + 1, MOST_JUDGED = 12 };

typedef enum reason {
    IN_VIEW,
    BEHIND_EARTH,
    NEAR_EARTH,
    NEAR_SUN,
    NEAR_MOON,
    IN_SHADOW,
    TOO_NEAR,
    TOO_FAST,
    TOO_FAINT,
    REASONS
} reason;

static const char *const reason_words[REASONS] = {
    "in view",
    "behind the Earth",
    "less than 0.4 degrees from the Earth's limb or seen through less than 100 km above it",
    "less than 30 degrees from the Sun",
    "less than 3 degrees from the Moon",
    "in the Earth's shadow",
    "nearer than 20 km",
    "faster than 1 degree a second",
    "too faint",
};

typedef struct look {
    reason why;
    double v_mag, range_m, rate_arcsec_per_s, limb_rad;
    double corner_clear_rad; /* at which a line of sight is CORNER_CLEAR_M above the ground */
    double sky_mag_arcsec2;
    bst_vec3 direction;
} look;

typedef struct search {
    const bst_new_request *request;
    bst_new_judge judge;
    void *user; /* of the judge */
    bst_time start;
    int count;
    look *looks;
    double *cost;          /* of a run that begins at a look; INFINITY: none can */
    double *starless_cost; /* the same of slow targets among too few stars */
    bst_world *world;
    bst_world_view *view;
    bst_boresight_sky *sky;
    int judged;                /* runs shown to the judge */
    int near_earth, few_stars; /* runs with the Earth in the field; without an attitude */
    double best_v_mag;         /* of what was too faint only */
} search;

/* ------------------------------------------------------------------ what is seen */

/* Angle from the limb at which a line of sight passes so high above the Earth, a sphere. */
static double limb_clear_rad(bst_vec3 eye_m, double height_m) {
    double r = bst_vec3_norm(eye_m);
    double to_limb_m = sqrt(fmax(r * r - BST_EARTH_RADIUS_M * BST_EARTH_RADIUS_M, 0.0));
    return atan2(height_m, to_limb_m);
}

/* Brightness of the sky in a direction, V per square arcsecond. */
static bst_status sky_at(bst_ctx *ctx, const search *s, double seconds, look *out) {
    const bst_camera *c = bst_world_camera(s->world, 0, 0);
    const double exposure_s = 1.0; /* the sky's light is proportional to it */
    double pixel_arcsec = bst_camera_scale_rad(c) / BST_ARCSEC_RAD, e;
    BST_TRY(bst_boresight_sky_at(ctx, s->sky, seconds, out->direction, exposure_s, &e));
    out->sky_mag_arcsec2 =
        -2.5 *
        log10(e / (exposure_s * pixel_arcsec * pixel_arcsec * bst_camera_electrons_per_s(c, 0.0)));
    return BST_OK;
}

static bst_status look_at(bst_ctx *ctx, const search *s, double seconds, look *out) {
    bst_world_sight now, then;
    bst_world_state eye;
    bst_bodies bodies;
    BST_TRY(bst_world_view_sight(ctx, s->view, 0, 0, seconds, &now));
    BST_TRY(bst_world_view_sight(ctx, s->view, 0, 0, seconds + 1.0, &then));
    BST_TRY(bst_world_view_observer_state(ctx, s->view, 0, seconds, &eye));
    BST_TRY(bst_world_view_bodies(ctx, s->view, seconds, &bodies));
    *out =
        (look){.v_mag = now.v_mag,
               .range_m = now.range_m,
               .direction = now.geometric,
               .corner_clear_rad = limb_clear_rad(eye.position_m, CORNER_CLEAR_M),
               .sky_mag_arcsec2 = BST_NEW_SKY_MAG_ARCSEC2,
               .rate_arcsec_per_s = bst_vec3_angle(now.geometric, then.geometric) / BST_ARCSEC_RAD};
    out->limb_rad = bst_astro_earth_limb_angle(eye.position_m, bodies.pole, now.geometric);
    double sun = bst_vec3_angle(now.geometric, bst_vec3_sub(bodies.sun_m, eye.position_m));
    double moon = bst_vec3_angle(now.geometric, bst_vec3_sub(bodies.moon_m, eye.position_m));
    double clear =
        fmax(EARTH_CLEAR_DEG * BST_DEG_RAD, limb_clear_rad(eye.position_m, LIMB_CLEAR_M));
    out->why = now.occulted                                      ? BEHIND_EARTH
               : out->limb_rad < clear                           ? NEAR_EARTH
               : sun < SUN_CLEAR_DEG * BST_DEG_RAD               ? NEAR_SUN
               : moon < MOON_CLEAR_DEG * BST_DEG_RAD             ? NEAR_MOON
               : now.sunlit_fraction < 1.0                       ? IN_SHADOW
               : now.range_m < LEAST_RANGE_M                     ? TOO_NEAR
               : out->rate_arcsec_per_s > MOST_RATE_ARCSEC_PER_S ? TOO_FAST
                                                                 : IN_VIEW;
    bool bright = out->why == IN_VIEW && out->limb_rad < EARTH_WISHED_DEG * BST_DEG_RAD;
    return bright ? sky_at(ctx, s, seconds, out) : BST_OK;
}

/* How far from the limb the boresight is to be. */
static double free_of_earth(const bst_new_scene *s) {
    return s->side_px * s->pixel_arcsec * BST_ARCSEC_RAD * sqrt(0.5) +
           fmax(MARGIN_DEG * BST_DEG_RAD, s->corner_clear_rad);
}

/* The widest field, of those that have the stars for an attitude, without the Earth in it. */
static bool fit_field(search *s, bst_vec3 direction, bst_new_scene *out) {
    const bst_new_request *q = s->request;
    const double rate = out->rate_arcsec_per_s;
    double half = 0.5 * SIDE_PX * BST_NEW_FEW_STARS_ARCSEC * BST_ARCSEC_RAD;
    double complete = bst_stars_complete_to(bst_world_stars(s->world), direction, half);
    const double pixel[] = {bst_new_pixel_arcsec(q, rate, complete),
                            bst_new_pixel_arcsec(q, rate, complete),
                            bst_new_pixel_arcsec(q, rate, BST_NEW_ENOUGH_STARS_V_MAG)};
    const int side[] = {SIDE_PX, SMALL_SIDE_PX, SMALL_SIDE_PX};
    for (size_t k = 0; k < sizeof side / sizeof *side; k++) {
        out->pixel_arcsec = pixel[k];
        out->side_px = side[k];
        if (out->limb_rad < free_of_earth(out)) {
            continue;
        }
        if (pixel[k] >= pixel[0] || rate <= BST_NEW_STARLESS_RATE_ARCSEC_PER_S) {
            return true;
        }
        s->few_stars++;
        return false;
    }
    s->near_earth++;
    return false;
}

/* Whether the field has the stars for an attitude at all times of the run that begins at look i. */
static bst_status count_stars(bst_ctx *ctx, const search *s, int i, const bst_new_scene *scene,
                              bool *enough) {
    /* of the same area as the square field */
    double radius = scene->side_px * scene->pixel_arcsec * BST_ARCSEC_RAD / sqrt(BST_PI);
    double jd1, jd2;
    bst_time_utc(scene->epoch, &jd1, &jd2);
    double year = 2000.0 + (jd1 - 2451545.0 + jd2) / 365.25;
    int last = i + (int)ceil(scene->duration_s / LOOK_S);
    double faintest = FAINTEST_STARS_V_MAG;
    while (bst_new_snr(s->request->aperture_m, scene->pixel_arcsec, scene->sky_mag_arcsec2,
                       faintest, scene->exposure_s) < STAR_SNR &&
           faintest > 0.0) {
        faintest -= 0.25;
    }
    *enough = true;
    for (int k = i; k <= last && *enough; k++) {
        int count = 0;
        BST_TRY(bst_stars_query(ctx, bst_world_stars(s->world), s->looks[k].direction, radius,
                                faintest, year, NULL, 0, &count));
        *enough = count >= LEAST_STARS;
    }
    return BST_OK;
}

/* Sets period and exposure for the pixel scale of a run; false: the target is too faint. */
static bool time_exposures(const bst_new_request *q, bst_new_scene *out) {
    out->period_s = bst_new_period_s(q, out->rate_arcsec_per_s, out->pixel_arcsec);
    out->exposure_s = bst_new_exposure_s(q, out, out->brightest_v_mag);
    return out->exposure_s > 0.0;
}

/* The run that begins at look i; false: something is in the way or it is too faint. */
static bool scene_at(search *s, int i, bst_new_scene *out) {
    const bst_new_request *q = s->request;
    double period = q->period_s > 0.0 ? q->period_s : 1.0;
    double duration = q->duration_s > 0.0 ? q->duration_s : fmax(DURATION_S, LEAST_FRAMES * period);
    int last = i + (int)ceil(duration / LOOK_S);
    double brightest = INFINITY;
    *out = (bst_new_scene){.duration_s = duration,
                           .v_mag = s->looks[i].v_mag,
                           .faintest_v_mag = -INFINITY,
                           .range_m = INFINITY,
                           .sky_mag_arcsec2 = INFINITY,
                           .limb_rad = INFINITY};
    for (int k = i; k <= last; k++) {
        if (k >= s->count || s->looks[k].why != IN_VIEW) {
            return false;
        }
        brightest = fmin(brightest, s->looks[k].v_mag);
        out->faintest_v_mag = fmax(out->faintest_v_mag, s->looks[k].v_mag);
        out->limb_rad = fmin(out->limb_rad, s->looks[k].limb_rad);
        out->corner_clear_rad = fmax(out->corner_clear_rad, s->looks[k].corner_clear_rad);
        out->sky_mag_arcsec2 = fmin(out->sky_mag_arcsec2, s->looks[k].sky_mag_arcsec2);
        out->range_m = fmin(out->range_m, s->looks[k].range_m);
        out->rate_arcsec_per_s = fmax(out->rate_arcsec_per_s, s->looks[k].rate_arcsec_per_s);
    }
    out->epoch = bst_time_add(s->start, LOOK_S * i);
    if (!fit_field(s, s->looks[(i + last) / 2].direction, out)) {
        return false;
    }
    out->brightest_v_mag = brightest;
    if (!time_exposures(q, out)) {
        s->best_v_mag = fmin(s->best_v_mag, out->faintest_v_mag);
        return false;
    }
    return true;
}

/* Takes wider pixels, as far as the request leaves them free and the Earth stays out of the field,
 * until the field has the stars for an attitude. */
static bst_status widen_field(bst_ctx *ctx, const search *s, int i, bst_new_scene *scene,
                              bool *enough) {
    const double pixel[] = {5.0, BST_NEW_FEW_STARS_ARCSEC, BST_NEW_FEW_STARS_FAST_ARCSEC};
    const bst_new_request *q = s->request;
    BST_TRY(count_stars(ctx, s, i, scene, enough));
    if (q->focal_m > 0.0 || q->pixel_arcsec > 0.0) {
        return BST_OK;
    }
    for (size_t k = 0; k < sizeof pixel / sizeof *pixel && !*enough; k++) {
        bst_new_scene wide = *scene;
        wide.pixel_arcsec = pixel[k];
        wide.side_px = SIDE_PX;
        if (pixel[k] > scene->pixel_arcsec && wide.limb_rad >= free_of_earth(&wide) &&
            time_exposures(q, &wide)) {
            BST_TRY(count_stars(ctx, s, i, &wide, enough));
            *scene = *enough ? wide : *scene;
        }
    }
    return BST_OK;
}

/* Of two times the one with the slower and brighter target is better. */
static double cost_of(const bst_new_scene *scene) {
    double near = scene->limb_rad < EARTH_WISHED_DEG * BST_DEG_RAD ? 2.0 : 0.0;
    return near + log(scene->rate_arcsec_per_s + 10.0) + 0.3 * scene->faintest_v_mag;
}

/* ------------------------------------------------------------------ the search */

static bst_status open_world(bst_ctx *ctx, search *s) {
    const bst_new_scene first = {.side_px = SIDE_PX,
                                 .epoch = s->start,
                                 .duration_s = 1.0,
                                 .period_s = 1.0,
                                 .exposure_s = 0.5,
                                 .pixel_arcsec = 3.0};
    char *text = NULL;
    size_t bytes = 0;
    FILE *stream = open_memstream(&text, &bytes);
    if (!stream) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the scenario");
    }
    bst_new_scenario_write(stream, s->request, &first);
    fclose(stream);
    bst_json *json = NULL;
    bst_scenario scenario;
    bst_status status = bst_json_parse(ctx, s->request->name, text, bytes, &json);
    free(text);
    if (status != BST_OK) {
        return status;
    }
    status = bst_plugins_scenario_read(ctx, json, &scenario);
    if (status == BST_OK) {
        status = bst_world_create(ctx, scenario.file, &scenario.world, &scenario.observers,
                                  scenario.base_dir, scenario.epoch, &s->world);
    }
    bst_scenario_free(&scenario);
    bst_json_free(json);
    if (status != BST_OK) {
        return status;
    }
    BST_TRY(bst_world_view_create(ctx, s->world, &s->view));
    return bst_boresight_sky_create(ctx, s->world, s->view, 0, 0, &s->sky);
}

/* The first of the two days, within two weeks of both element sets. */
static bst_status choose_days(bst_ctx *ctx, search *s) {
    const bst_elements *a = &s->request->observer.elements, *b = &s->request->target.elements;
    bst_time one, two;
    BST_TRY(bst_time_from_utc_jd(ctx, a->epoch_utc_jd1, a->epoch_utc_jd2, &one));
    BST_TRY(bst_time_from_utc_jd(ctx, b->epoch_utc_jd1, b->epoch_utc_jd2, &two));
    double apart = bst_time_diff(two, one);
    bst_time earlier = apart > 0.0 ? one : two;
    double until = AGE_S; /* after the earlier epoch */
    double from = fmax(fmin(fabs(apart), until - SEARCH_S), fabs(apart) - AGE_S);
    s->start = bst_time_add(earlier, from);
    if (s->request->start) {
        BST_TRY(bst_time_from_utc(ctx, s->request->start, &s->start));
        until = bst_time_diff(s->start, earlier) + SEARCH_S;
        from = until - SEARCH_S;
    }
    if (until - from < LOOK_S) {
        return bst_fail(ctx, BST_ERR_RANGE,
                        "the element sets of %s and %s are %.0f days apart: none of them is good "
                        "for longer than 14 days; take sets of nearer dates, or give --start",
                        s->request->observer.name, s->request->target.name,
                        fabs(apart) / BST_DAY_S);
    }
    /* a scenario's epoch in whole seconds */
    char text[48];
    bst_time_to_utc(s->start, 0, text, sizeof text);
    BST_TRY(bst_time_from_utc(ctx, text, &s->start));
    s->count = (int)(fmin(SEARCH_S, until - from) / LOOK_S);
    return BST_OK;
}

static bst_status nothing(bst_ctx *ctx, const search *s, const char *judged) {
    int count[REASONS] = {0};
    char list[512] = "";
    size_t used = 0;
    for (int i = 0; i < s->count; i++) {
        count[s->looks[i].why]++;
    }
    for (int r = BEHIND_EARTH; r < REASONS; r++) {
        if (count[r] > 0 && used < sizeof list) {
            used +=
                (size_t)snprintf(list + used, sizeof list - used, "%s%s %.1f %%", used ? ", " : "",
                                 reason_words[r], 100.0 * count[r] / s->count);
        }
    }
    char utc[48];
    bst_time_to_utc(s->start, 0, utc, sizeof utc);
    if (*judged) {
        return bst_fail(ctx, BST_ERR_NOT_FOUND,
                        "%s sees %s in the %.3g days from %s, but at none of the best times would "
                        "the loop hold: %s; choose another --start, --duration or target",
                        s->request->observer.name, s->request->target.name,
                        s->count * LOOK_S / BST_DAY_S, utc, judged);
    }
    if (isfinite(s->best_v_mag)) {
        double needed = s->request->aperture_m;
        double period = s->request->period_s > 0.0 ? s->request->period_s : 1.0;
        while (
            needed < 20.0 &&
            bst_new_snr(needed, bst_new_pixel_arcsec(s->request, 0.0, BST_NEW_ENOUGH_STARS_V_MAG),
                        BST_NEW_SKY_MAG_ARCSEC2, s->best_v_mag, 0.5 * period) < BST_NEW_LEAST_SNR) {
            needed *= 1.05;
        }
        return bst_fail(
            ctx, BST_ERR_NOT_FOUND,
            "%s is too faint for an aperture of %.3g m: V %.1f at best in the %.3g days "
            "from %s; an --aperture of %.2g would do",
            s->request->target.name, s->request->aperture_m, s->best_v_mag,
            s->count * LOOK_S / BST_DAY_S, utc, needed);
    }
    if (s->few_stars > 0) {
        return bst_fail(ctx, BST_ERR_NOT_FOUND,
                        "%s is seen from %s only so near to the Earth's limb that the field holds "
                        "too few of the stars built into the program for an attitude; get the full "
                        "star catalogue: boresight stars fetch",
                        s->request->target.name, s->request->observer.name);
    }
    if (s->near_earth > 0) {
        return bst_fail(
            ctx, BST_ERR_NOT_FOUND,
            "in the %.3g days from %s %s sees %s only with the Earth in the field; choose "
            "a smaller --pixel-scale, a shorter --duration or another target",
            s->count * LOOK_S / BST_DAY_S, utc, s->request->observer.name, s->request->target.name);
    }
    return bst_fail(ctx, BST_ERR_NOT_FOUND,
                    "in the %.3g days from %s %s never sees %s for a whole run: it is %s of the "
                    "time; choose a shorter --duration, another --start or another target",
                    s->count * LOOK_S / BST_DAY_S, utc, s->request->observer.name,
                    s->request->target.name, *list ? list : "in view too short a part");
}

/* Excludes a time and those next to it, at which the same is wrong. */
static void exclude(search *s, int best, double duration_s) {
    int apart = (int)ceil(fmax(duration_s, 300.0) / LOOK_S);
    for (int i = best - apart; i <= best + apart; i++) {
        if (i >= 0 && i < s->count) {
            s->cost[i] = s->starless_cost[i] = INFINITY;
        }
    }
}

/* The best run that the judge accepts, of those with the stars for an attitude or, with
 * `few_stars`, of the others whose target is slow. */
static bst_status choose_best(bst_ctx *ctx, search *s, bool few_stars, bst_new_scene *out,
                              bool *found, char why[256]) {
    const double *cost = few_stars ? s->starless_cost : s->cost;
    *found = false;
    while (s->judged < MOST_JUDGED && !*found) {
        int best = 0;
        bool enough = true;
        for (int i = 1; i < s->count; i++) {
            best = cost[i] < cost[best] ? i : best;
        }
        if (isinf(cost[best]) || !scene_at(s, best, out)) {
            return BST_OK;
        }
        out->few_stars = few_stars;
        if (!few_stars) {
            BST_TRY(widen_field(ctx, s, best, out, &enough));
        }
        if (!enough) {
            bool slow = out->rate_arcsec_per_s <= BST_NEW_STARLESS_RATE_ARCSEC_PER_S;
            s->starless_cost[best] = slow ? s->cost[best] : (double)INFINITY;
            s->cost[best] = INFINITY;
            s->few_stars++;
            continue;
        }
        s->judged++;
        BST_TRY(s->judge(s->user, ctx, out, found, why));
        if (!*found) {
            exclude(s, best, out->duration_s);
        }
    }
    return BST_OK;
}

static bst_status choose(bst_ctx *ctx, search *s, bst_new_scene *out) {
    char why[256] = "";
    bool found = false;
    for (int i = 0; i < s->count; i++) {
        s->cost[i] = scene_at(s, i, out) ? cost_of(out) : (double)INFINITY;
        s->starless_cost[i] = INFINITY;
    }
    for (int few_stars = 0; few_stars < 2 && !found; few_stars++) {
        BST_TRY(choose_best(ctx, s, few_stars, out, &found, why));
    }
    return found ? BST_OK : nothing(ctx, s, why);
}

static bst_status find(bst_ctx *ctx, search *s, bst_new_scene *out) {
    s->looks = calloc(LOOKS, sizeof *s->looks);
    s->cost = calloc(LOOKS, sizeof *s->cost);
    s->starless_cost = calloc(LOOKS, sizeof *s->starless_cost);
    if (!s->looks || !s->cost || !s->starless_cost) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the search");
    }
    BST_TRY(choose_days(ctx, s));
    BST_TRY(open_world(ctx, s));
    for (int i = 0; i < s->count; i++) {
        BST_TRY(look_at(ctx, s, LOOK_S * i, &s->looks[i]));
    }
    return choose(ctx, s, out);
}

bst_status bst_new_scene_find(bst_ctx *ctx, const bst_new_request *request, bst_new_judge judge,
                              void *user, bst_new_scene *out) {
    search s = {.request = request, .judge = judge, .user = user, .best_v_mag = INFINITY};
    bst_status status = find(ctx, &s, out);
    bst_boresight_sky_free(s.sky);
    bst_world_view_free(s.view);
    bst_world_free(s.world);
    free(s.looks);
    free(s.cost);
    free(s.starless_cost);
    return status;
}
