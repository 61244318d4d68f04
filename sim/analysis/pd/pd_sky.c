#include "sim/analysis/pd/pd_sky.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sim/analysis/pd/pd.h"

enum { CELL_PX = 32 };

/* default if the scenegen module of the sensor has no limit */
static const double USUAL_V_LIMIT = 16.0;
/* light outside the frame that reaches into it */
static const double MARGIN_PX = 32.0;

struct bst_pd_sky {
    bst_field *field;
    bst_field_options options;
    const bst_camera *camera;
    bst_quat attitude;
    int64_t tick_rate_hz, exposure_ticks;
    bst_truth header;
    bst_eval_match_target *unsorted;
    int room;
};

/* Reads "star_limit_v_mag" of the sensor's rendering module. */
static double v_limit_of(const bst_pd_scene *s) {
    for (int m = 0; m < s->scenario->module_count; m++) {
        const bst_scenario_module_config *module = &s->scenario->modules[m];
        if (module->observer != s->observer || module->sensor != s->sensor ||
            strcmp(module->desc->role, "scenegen") != 0) {
            continue;
        }
        double value;
        if (bst_scenario_module_number(module, "star_limit_v_mag", &value)) {
            return value;
        }
    }
    return USUAL_V_LIMIT;
}

bst_status bst_pd_sky_open(bst_ctx *ctx, const bst_pd_scene *s, bst_pd_sky **out) {
    bst_pd_sky *sky = calloc(1, sizeof *sky);
    *out = NULL;
    if (!sky) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the sky");
    }
    sky->camera = &s->camera;
    sky->tick_rate_hz = s->scenario->tick_rate_hz;
    sky->exposure_ticks = (int64_t)llround(s->exposure_s * (double)sky->tick_rate_hz);
    sky->options = (bst_field_options){.v_limit = v_limit_of(s), .margin_px = MARGIN_PX};
    sky->attitude = bst_world_body_attitude(s->world, s->observer, s->sensor);
    bst_status status = bst_field_create(ctx, s->world, s->observer, s->sensor, &sky->field);
    if (status != BST_OK) {
        bst_pd_sky_close(sky);
        return status;
    }
    bst_field_set_camera(sky->field, &s->camera);
    *out = sky;
    return BST_OK;
}

void bst_pd_sky_close(bst_pd_sky *sky) {
    if (sky) {
        bst_field_free(sky->field);
        free(sky->unsorted);
        free(sky);
    }
}

bst_quat bst_pd_sky_attitude(const bst_pd_sky *sky, double roll_rad) {
    return bst_quat_mul(bst_quat_from_rotvec((bst_vec3){0.0, 0.0, roll_rad}), sky->attitude);
}

bst_status bst_pd_sky_look(bst_ctx *ctx, bst_pd_sky *sky, const bst_los_track *track,
                           const bst_scene_source **stars, int *count) {
    bst_window window = {0, 0, (int)sky->camera->width_px, (int)sky->camera->height_px};
    return bst_field_query(ctx, sky->field, track, 0, sky->exposure_ticks, sky->tick_rate_hz,
                           window, &sky->options, &sky->header, stars, count);
}

double bst_pd_sky_e(const bst_pd_sky *sky, double x_px, double y_px) {
    return bst_field_background_e(sky->field, &sky->header, x_px, y_px);
}

const struct bst_skylight_map *bst_pd_sky_map(const bst_pd_sky *sky) {
    return bst_field_background(sky->field);
}

static bst_status make_room(bst_ctx *ctx, bst_pd_sky *sky, int count, bst_pd_stars *out) {
    if (!out->first) {
        out->cell_px = CELL_PX;
        out->columns = (int)(sky->camera->width_px / CELL_PX) + 3;
        out->rows = (int)(sky->camera->height_px / CELL_PX) + 3;
        out->first = calloc((size_t)out->columns * (size_t)out->rows + 1, sizeof *out->first);
    }
    if (count > sky->room) {
        free(sky->unsorted);
        sky->unsorted = malloc((size_t)count * sizeof *sky->unsorted);
        sky->room = sky->unsorted ? count : 0;
    }
    if (count > out->room) {
        free(out->places);
        out->places = malloc((size_t)count * sizeof *out->places);
        out->room = out->places ? count : 0;
    }
    return out->first && sky->room >= count && out->room >= count
               ? BST_OK
               : bst_fail(ctx, BST_ERR_MEMORY, "no memory for the places of %d stars", count);
}

static int cell_of(const bst_pd_stars *s, double x_px, double y_px) {
    double column = floor(x_px / s->cell_px) + 1.0, row = floor(y_px / s->cell_px) + 1.0;
    column = fmin(fmax(column, 0.0), s->columns - 1.0);
    row = fmin(fmax(row, 0.0), s->rows - 1.0);
    return (int)row * s->columns + (int)column;
}

bst_status bst_pd_sky_stars(bst_ctx *ctx, bst_pd_sky *sky, const bst_los_track *track,
                            const bst_scene_source *stars, int count, bst_pd_stars *out) {
    bst_window window = {0, 0, (int)sky->camera->width_px, (int)sky->camera->height_px};
    BST_TRY(make_room(ctx, sky, count, out));
    int cells = out->columns * out->rows;
    out->count = 0;
    memset(out->first, 0, ((size_t)cells + 1) * sizeof *out->first);
    for (int i = 0; i < count; i++) {
        bst_truth_item item;
        bst_field_truth_item(sky->field, track, &stars[i], window, 1, &sky->header, &item);
        if (!(item.snr >= BST_PD_STAR_SNR) || !isfinite(item.x_centroid_px)) {
            continue;
        }
        bst_eval_match_target *place = &sky->unsorted[out->count++];
        *place = (bst_eval_match_target){item.x_centroid_px, item.y_centroid_px,
                                         item.x_end_px - item.x_start_px,
                                         item.y_end_px - item.y_start_px};
        out->first[cell_of(out, place->x_px, place->y_px) + 1]++;
    }
    for (int c = 0; c < cells; c++) {
        out->first[c + 1] += out->first[c];
    }
    /* filled from the back of each cell, so that first[] ends at its start */
    for (int i = 0; i < out->count; i++) {
        int cell = cell_of(out, sky->unsorted[i].x_px, sky->unsorted[i].y_px);
        out->places[--out->first[cell + 1]] = sky->unsorted[i];
    }
    for (int c = 0; c < cells; c++) {
        out->first[c] = out->first[c + 1];
    }
    out->first[cells] = out->count;
    return BST_OK;
}

void bst_pd_stars_free(bst_pd_stars *stars) {
    free(stars->places);
    free(stars->first);
    *stars = (bst_pd_stars){.count = 0};
}

/* Checks whether a star is on a detection, including its reported length: neighbouring stars can
 * form a streak. */
static bool holds(const bst_detection *d, double reach_px, const bst_eval_match_target *star) {
    if (!(d->flags & BST_DETECTION_STREAK)) {
        return false;
    }
    bst_eval_match_target line = {d->x_px, d->y_px, d->length_px * cos(d->angle_rad),
                                  d->length_px * sin(d->angle_rad)};
    bst_detection at = {.x_px = star->x_px, .y_px = star->y_px};
    return bst_eval_match_belongs(&line, reach_px, &at);
}

bool bst_pd_is_star(const bst_pd_stars *s, double reach_px, const bst_detection *d) {
    if (s->count == 0) {
        return false;
    }
    /* all stars have equal streaks, except for distortion */
    double half = 0.0;
    for (int i = 0; i < s->count; i += 1 + s->count / 16) {
        half = fmax(half, 0.55 * hypot(s->places[i].dx_px, s->places[i].dy_px));
    }
    if (d->flags & BST_DETECTION_EDGE) {
        reach_px *=
            2.0; /* the star may be outside the frame; its position is the centroid of its light */
    }
    half = d->flags & BST_DETECTION_STREAK ? fmax(half, fmin(0.5 * d->length_px, 256.0)) : half;
    int around = (int)ceil((reach_px + half) / s->cell_px);
    for (int j = -around; j <= around; j++) {
        for (int i = -around; i <= around; i++) {
            double x = d->x_px + i * s->cell_px, y = d->y_px + j * s->cell_px;
            int cell = cell_of(s, x, y);
            for (int k = s->first[cell]; k < s->first[cell + 1]; k++) {
                if (bst_eval_match_belongs(&s->places[k], reach_px, d) ||
                    holds(d, reach_px, &s->places[k])) {
                    return true;
                }
            }
        }
    }
    return false;
}
