#include "sim/analysis/check/check_preview.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <cjson/cJSON.h>

#include "boresight/vec.h"
#include "sim/astro/time.h"
#include "sim/core/json_member.h"
#include "sim/core/json_number.h"
#include "sim/world/world.h"
#include "sim/world/world_config.h"

/* Steps by which the limit is lowered until few enough stars are left, mag. */
static const double LIMIT_STEP_MAG = 0.25;
/* Most steps: 50 mag down from any camera's limit there is no star. */
enum { LIMIT_STEPS = 200 };

/* Stars of a field: the brightest, their number, the limit down to which they are listed, and the
 * number of all down to the limit that was asked for. */
typedef struct field_stars {
    bst_star *stars; /* [BST_CHECK_PREVIEW_STARS] */
    int count, total;
    double v_limit;
} field_stars;

/* Stars around a direction, not more than BST_CHECK_PREVIEW_STARS: the limit is lowered for that.
 * Of a catalogue with more stars than that at any limit, the first ones. */
static bst_status query_stars(bst_ctx *ctx, const bst_world *world, bst_vec3 centre,
                              double radius_rad, field_stars *out) {
    const double year = bst_time_julian_year(bst_world_time(world, 0.0));
    for (int step = 0;; step++) {
        BST_TRY(bst_stars_query(ctx, bst_world_stars(world), centre, radius_rad, out->v_limit, year,
                                out->stars, BST_CHECK_PREVIEW_STARS, &out->count));
        if (step == 0) {
            out->total = out->count;
        }
        if (out->count <= BST_CHECK_PREVIEW_STARS || step == LIMIT_STEPS) {
            out->count =
                out->count < BST_CHECK_PREVIEW_STARS ? out->count : BST_CHECK_PREVIEW_STARS;
            return BST_OK;
        }
        out->v_limit -= LIMIT_STEP_MAG;
    }
}

/* Adds the field at the epoch. */
static bst_status add_sky(bst_ctx *ctx, const bst_world *world, bst_vec3 centre, cJSON *sensor) {
    const cJSON *field = bst_json_member(sensor, "field_deg");
    const double half[2] = {0.5 * cJSON_GetArrayItem(field, 0)->valuedouble * BST_DEG_RAD,
                            0.5 * cJSON_GetArrayItem(field, 1)->valuedouble * BST_DEG_RAD};
    const double radius_rad = fmin(hypot(half[0], half[1]), 0.25 * BST_PI);
    const double v_limit = bst_json_member_number(sensor, "v_mag_at_snr_5");
    double ra, dec;
    bst_star *stars = calloc(BST_CHECK_PREVIEW_STARS, sizeof *stars);
    if (!stars) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the stars of a field");
    }
    field_stars found = {.stars = stars, .v_limit = isfinite(v_limit) ? v_limit : 0.0};
    bst_status status = query_stars(ctx, world, centre, radius_rad, &found);
    if (status == BST_OK) {
        cJSON *sky = cJSON_AddObjectToObject(sensor, "sky");
        bst_vec3_to_radec(centre, &ra, &dec);
        bst_json_add_number(sky, "ra_deg", ra / BST_DEG_RAD);
        bst_json_add_number(sky, "dec_deg", dec / BST_DEG_RAD);
        bst_json_add_number(sky, "v_limit", found.v_limit);
        cJSON_AddNumberToObject(sky, "total", found.total);
        cJSON *list = cJSON_AddArrayToObject(sky, "stars");
        const bst_vec3 east = {-sin(ra), cos(ra), 0.0};
        const bst_vec3 north = {-sin(dec) * cos(ra), -sin(dec) * sin(ra), cos(dec)};
        for (int i = 0; i < found.count; i++) {
            const double depth = bst_vec3_dot(stars[i].icrs, centre) * BST_DEG_RAD;
            const double place[3] = {bst_vec3_dot(stars[i].icrs, east) / depth,
                                     bst_vec3_dot(stars[i].icrs, north) / depth,
                                     (double)stars[i].v_mag};
            cJSON_AddItemToArray(list, cJSON_CreateDoubleArray(place, 3));
        }
    }
    free(stars);
    return status;
}

/* Adds the target over the day. */
static void add_day(bst_world_view *view, int observer, int object, cJSON *sensor) {
    cJSON *day = cJSON_AddObjectToObject(sensor, "day");
    cJSON_AddNumberToObject(day, "step_s", BST_DAY_S / BST_CHECK_PREVIEW_STEPS);
    cJSON *v_mag = cJSON_AddArrayToObject(day, "v_mag");
    cJSON *sunlit = cJSON_AddArrayToObject(day, "sunlit_fraction");
    cJSON *occulted = cJSON_AddArrayToObject(day, "occulted");
    for (int i = 0; i <= BST_CHECK_PREVIEW_STEPS; i++) {
        bst_ctx ignored = {0}; /* a body may have no orbit so long after the run */
        bst_world_sight sight;
        if (bst_world_view_sight(&ignored, view, observer, object,
                                 BST_DAY_S * i / BST_CHECK_PREVIEW_STEPS, &sight) != BST_OK) {
            return;
        }
        cJSON_AddItemToArray(
            v_mag, isfinite(sight.v_mag) ? cJSON_CreateNumber(sight.v_mag) : cJSON_CreateNull());
        cJSON_AddItemToArray(sunlit, cJSON_CreateNumber(sight.sunlit_fraction));
        cJSON_AddItemToArray(occulted, cJSON_CreateBool(sight.occulted));
    }
}

bst_status bst_check_preview(bst_ctx *ctx, const bst_scenario *scenario,
                             const bst_simulation *simulation, cJSON *figures) {
    const bst_world *world = bst_simulation_world(simulation);
    const bst_observer_config *observers = scenario->observers.items;
    bst_world_view *view;
    cJSON *node = cJSON_GetObjectItemCaseSensitive(figures, "sensors")->child;
    bst_status status = BST_OK;
    BST_TRY(bst_world_view_create(ctx, world, &view));
    for (int observer = 0; observer < bst_world_observer_count(world); observer++) {
        const bst_sensor_config *sensors = observers[observer].sensors.items;
        for (int i = 0; i < bst_world_sensor_count(world, observer) && node && status == BST_OK;
             i++, node = node->next) {
            const char *name = sensors[i].cue.object;
            const int object = *name ? bst_world_find_object(world, name) : -1;
            bst_world_sight sight;
            if (object < 0) {
                continue;
            }
            status = bst_world_view_sight(ctx, view, observer, object, 0.0, &sight);
            status = status == BST_OK ? add_sky(ctx, world, sight.geometric, node) : status;
            if (status == BST_OK) {
                add_day(view, observer, object, node);
            }
        }
    }
    bst_world_view_free(view);
    return status;
}
