#include "sim/analysis/shape/light_curve.h"

#include <cjson/cJSON.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sim/analysis/shape/light_curve_rows.h"
#include "sim/astro/elements.h"
#include "sim/astro/geodesy.h"
#include "sim/io/draft_file.h"
#include "sim/io/plot.h"
#include "sim/world/world.h"

enum { ROWS_MAX = 10000000 };

/* Appends an orbit of an element set. */
static void put_orbit(cJSON *to, const bst_light_curve_request *r, int64_t norad) {
    cJSON *orbit = cJSON_AddObjectToObject(to, "orbit");
    cJSON_AddStringToObject(orbit, "elements_file", r->elements);
    cJSON_AddNumberToObject(orbit, "norad", (double)norad);
}

/* Checks that the file has an element set of the number that an option gives. */
static bst_status check_norad(bst_ctx *ctx, const bst_light_curve_request *r, const char *option,
                              int64_t norad) {
    bst_elements *sets = NULL;
    int count = 0;
    bst_elements_options only = {.norad = (int)norad};
    bst_status status = bst_elements_load(ctx, r->elements, &only, &sets, &count);
    free(sets);
    return status == BST_OK ? BST_OK
                            : bst_fail_prefix(ctx, status, "%s %lld", option, (long long)norad);
}

/* Attitude of a satellite without a scenario: the name of a law, or JSON as in scenarios. Returns
 * *phases, which the caller frees. BST_ERR_MEMORY. */
static bst_status read_attitude(bst_ctx *ctx, const char *text, cJSON **phases) {
    if (*text != '[' && *text != '{') {
        cJSON *phase = cJSON_CreateObject();
        *phases = cJSON_CreateArray();
        cJSON_AddStringToObject(phase, "law", text);
        cJSON_AddItemToArray(*phases, phase);
        return BST_OK;
    }
    bst_json *json = NULL;
    BST_TRY(bst_json_parse(ctx, "--attitude", text, strlen(text), &json));
    cJSON *given = cJSON_Duplicate(bst_json_root(json), true);
    bst_json_free(json);
    if (!given) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for an attitude");
    }
    *phases = given;
    if (cJSON_IsObject(given)) { /* one phase */
        *phases = cJSON_CreateArray();
        cJSON_AddItemToArray(*phases, given);
    }
    return BST_OK;
}

/* JSON of a world with one satellite, whose attitude becomes part of it; NULL: out of memory. */
static char *world_text(const bst_light_curve_request *r, cJSON *attitude) {
    cJSON *root = cJSON_CreateObject(), *world = cJSON_AddObjectToObject(root, "world");
    cJSON *object = cJSON_CreateObject();
    cJSON_AddStringToObject(world, "star_catalogue", "embedded");
    cJSON *objects = cJSON_AddArrayToObject(world, "objects");
    cJSON_AddItemToArray(objects, object);
    cJSON_AddStringToObject(object, "name", "satellite");
    put_orbit(object, r, r->norad);
    cJSON *brightness = cJSON_AddObjectToObject(object, "brightness");
    cJSON_AddStringToObject(brightness, "model", "shape");
    cJSON_AddBoolToObject(brightness, "earthshine", r->earthshine);
    cJSON_AddStringToObject(cJSON_AddObjectToObject(object, "shape"), "file", r->satellite);
    cJSON_AddItemToObject(object, "attitude", attitude);
    cJSON_AddArrayToObject(root, "observers");
    if (r->observer_norad > 0) {
        cJSON *observer = cJSON_CreateObject();
        cJSON_AddStringToObject(observer, "name", "observer");
        put_orbit(observer, r, r->observer_norad);
        cJSON_AddItemToArray(objects, observer);
    }
    char *text = cJSON_PrintUnformatted(root);
    cJSON_Delete(root);
    return text;
}

/* The parts of a scenario that make a world. */
typedef struct scene {
    bst_world_config world;
    bst_config_list observers;
} scene;

static const bst_config_desc scene_table[] = {
    BST_OBJECT(scene, world, bst_world_config_table, "{}", "The world."),
    BST_LIST(scene, observers, bst_observer_config, bst_observer_config_table, 0, 1, "[]",
             "Observers."),
    BST_CONFIG_END};

/* Makes the world of a satellite without a scenario. */
static bst_status make_own_world(bst_ctx *ctx, bst_light_curve *c) {
    const bst_light_curve_request *r = c->request;
    bst_json *json = NULL;
    scene s;
    if (!r->elements || r->norad <= 0 || !r->start) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "--satellite needs an orbit and a time; give --elements, --norad and "
                        "--start");
    }
    BST_TRY(bst_time_from_utc(ctx, r->start, &c->epoch));
    BST_TRY(check_norad(ctx, r, "--norad", r->norad));
    if (r->observer_norad > 0) {
        BST_TRY(check_norad(ctx, r, "--observer-norad", r->observer_norad));
    }
    cJSON *attitude = NULL;
    BST_TRY(read_attitude(ctx, r->attitude, &attitude));
    char *text = world_text(r, attitude);
    if (!text) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for a world");
    }
    bst_status status = bst_json_parse(ctx, "lightcurve", text, strlen(text), &json);
    cJSON_free(text);
    if (status == BST_OK) {
        status = bst_config_read(ctx, json, bst_json_root(json), "", scene_table, &s);
        if (status == BST_OK) {
            status = bst_world_create(ctx, "lightcurve", &s.world, &s.observers, "", c->epoch,
                                      &c->world);
            bst_config_free(scene_table, &s);
        }
    }
    bst_json_free(json);
    c->observer = -1;
    c->observing_object = r->observer_norad > 0 ? 1 : -1;
    return status;
}

/* Index of an observer of a scenario by name; -1: none. */
static int find_observer(const bst_scenario *s, const char *name) {
    const bst_observer_config *list = s->observers.items;
    for (int i = 0; i < s->observers.count; i++) {
        if (!name || strcmp(list[i].name, name) == 0) {
            return i;
        }
    }
    return -1;
}

static bst_status use_scenario(bst_ctx *ctx, const bst_scenario *s, bst_light_curve *c) {
    const bst_light_curve_request *r = c->request;
    c->epoch = s->epoch;
    BST_TRY(
        bst_world_create(ctx, s->file, &s->world, &s->observers, s->base_dir, s->epoch, &c->world));
    c->object = r->object                              ? bst_world_find_object(c->world, r->object)
                : bst_world_object_count(c->world) > 0 ? 0
                                                       : -1;
    c->observer = find_observer(s, r->observer);
    c->observing_object = -1;
    if (c->object < 0) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "--object %s: the scenario has no such object",
                        r->object ? r->object : "");
    }
    if (c->observer < 0) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "--observer %s: the scenario has no such observer",
                        r->observer ? r->observer : "");
    }
    if (r->start) {
        bst_time start;
        BST_TRY(bst_time_from_utc(ctx, r->start, &start));
        c->start_s = bst_time_diff(start, s->epoch);
    }
    return BST_OK;
}

/* Reads --site. */
static bst_status place_site(bst_ctx *ctx, bst_light_curve *c) {
    double deg[2], height_m, itrf_m[3];
    int used = 0;
    const char *text = c->request->site;
    if (!text) {
        return c->observer >= 0 || c->observing_object >= 0
                   ? BST_OK
                   : bst_fail(ctx, BST_ERR_ARGUMENT,
                              "there is no observer; give --site or --observer-norad");
    }
    if (sscanf(text, "%lf ,%lf ,%lf %n", &deg[0], &deg[1], &height_m, &used) != 3 || text[used] ||
        !(fabs(deg[0]) <= 90.0 && fabs(deg[1]) <= 360.0 && fabs(height_m) <= 1e5)) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "--site %.60s (allowed: LATITUDE,LONGITUDE,HEIGHT in degrees and metres, "
                        "as 32.44,-110.79,2790)",
                        text);
    }
    double lat = deg[0] * BST_DEG_RAD, lon = deg[1] * BST_DEG_RAD;
    BST_TRY(bst_astro_geodetic_to_itrf(ctx, lat, lon, height_m, itrf_m));
    c->site_itrf_m = bst_vec3_from_array(itrf_m);
    c->up = (bst_vec3){cos(lat) * cos(lon), cos(lat) * sin(lon), sin(lat)};
    c->east = (bst_vec3){-sin(lon), cos(lon), 0.0};
    c->north = bst_vec3_cross(c->up, c->east);
    c->observer = c->observing_object = -1;
    return BST_OK;
}

/* A number, or an empty field. */
static void put(FILE *f, const char *format, double value) {
    fputc(',', f);
    if (isfinite(value)) {
        fprintf(f, format, value);
    }
}

static void write_row(FILE *f, const bst_light_curve *c, const bst_light_curve_row *r) {
    char utc[48];
    bst_time_to_utc(bst_time_add(c->epoch, c->start_s + r->seconds), 3, utc, sizeof utc);
    fprintf(f, "%s,%.3f", utc, r->seconds);
    put(f, "%.5f", r->v_mag);
    put(f, "%.5f", r->sight.phase_rad / BST_DEG_RAD);
    put(f, "%.4f", r->sight.range_m * 1e-3);
    put(f, "%.6f", r->sight.sunlit_fraction);
    put(f, "%.6f", r->sight.glow.earth_share);
    put(f, "%.5f", r->elevation_rad / BST_DEG_RAD);
    put(f, "%.5f", r->azimuth_rad / BST_DEG_RAD);
    fputs("\n", f);
}

/* Plots magnitude and phase angle; the shadow is where the curve ends. */
static bst_status plot_rows(bst_ctx *ctx, const char *path, const bst_light_curve_row *rows,
                            int count) {
    bst_plot plot;
    int lit = 0;
    for (int i = 0; i < count; i++) {
        lit += isfinite(rows[i].v_mag);
    }
    if (lit == 0) {
        bst_log(ctx, BST_LOG_WARNING, "%s: not drawn: the object is never seen in light", path);
        return BST_OK;
    }
    BST_TRY(bst_plot_begin(ctx, &plot, path, 1000, 500));
    fprintf(plot.script, "$data << EOD\n");
    for (int i = 0; i < count; i++) {
        if (isfinite(rows[i].v_mag)) {
            fprintf(plot.script, "%.9g %.6g %.6g\n", rows[i].seconds, rows[i].v_mag,
                    rows[i].sight.phase_rad / BST_DEG_RAD);
        } else {
            fputs("\n", plot.script); /* a gap */
        }
    }
    fputs(
        "EOD\nset xlabel 'time, s'\nset ylabel 'V, mag'\nset yrange [] reverse\n"
        "set y2label 'phase angle, deg'\nset y2tics\nset ytics nomirror\nset grid\n"
        "plot $data using 1:2 axes x1y1 with lines linewidth 1.5 title 'V', "
        "$data using 1:3 axes x1y2 with lines dashtype 2 title 'phase angle'\n",
        plot.script);
    return bst_plot_end(ctx, &plot, NULL);
}

static bst_status write_table(bst_ctx *ctx, const bst_light_curve *c,
                              const bst_light_curve_row *rows, int count) {
    static const char head[] =
        "time_utc,seconds,v_mag,phase_deg,range_km,sunlit_fraction,earth_share,elevation_deg,"
        "azimuth_deg\n";
    bst_draft draft;
    const char *path = c->request->output;
    if (path) {
        BST_TRY(bst_draft_open(ctx, path, &draft));
    }
    FILE *f = path ? draft.stream : stdout;
    fputs(head, f);
    for (int i = 0; i < count; i++) {
        write_row(f, c, &rows[i]);
    }
    return path ? bst_draft_close(ctx, &draft, BST_OK) : BST_OK;
}

bst_status bst_light_curve_make(bst_ctx *ctx, const bst_light_curve_request *request,
                                const bst_scenario *scenario) {
    bst_light_curve c = {.request = request};
    double rows_wanted = floor(request->duration_s / request->step_s + 1e-9) + 1.0;
    if (!(rows_wanted <= ROWS_MAX)) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "--step %g: %.3g rows (allowed: at most %d)",
                        request->step_s, rows_wanted, ROWS_MAX);
    }
    int count = (int)rows_wanted;
    bst_light_curve_row *rows = NULL;
    bst_status status = scenario ? use_scenario(ctx, scenario, &c) : make_own_world(ctx, &c);
    status = status == BST_OK ? place_site(ctx, &c) : status;
    if (status == BST_OK) {
        rows = malloc((size_t)count * sizeof *rows);
        status = rows ? bst_light_curve_rows(ctx, &c, 0, count, rows)
                      : bst_fail(ctx, BST_ERR_MEMORY, "no memory for %d rows", count);
    }
    status = status == BST_OK ? write_table(ctx, &c, rows, count) : status;
    if (status == BST_OK && request->plot) {
        status = plot_rows(ctx, request->plot, rows, count);
    }
    free(rows);
    bst_world_free(c.world);
    return status;
}
