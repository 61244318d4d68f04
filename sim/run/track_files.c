#include "sim/run/track_files.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include <cjson/cJSON.h>

#include "sim/core/json_number.h"
#include "sim/io/csv.h"
#include "sim/io/tdm_writer.h"

void bst_track_object(const bst_run_track *track, char *name, size_t bytes) {
    if (track->target && track->sensor->target[0]) {
        snprintf(name, bytes, "%s", track->sensor->target);
    } else {
        snprintf(name, bytes, "TRACK-%" PRId64, track->id);
    }
}

static bst_status stream_ok(bst_ctx *ctx, FILE *stream) {
    return ferror(stream) ? bst_fail(ctx, BST_ERR_IO, "writing failed; is the disk full?") : BST_OK;
}

/* Standard deviations of right ascension (arc on the sky) and declination, and their
 * correlation. */
static void sigmas(const bst_od_observation *o, double *east, double *north, double *correlation) {
    *east = sqrt(o->cov_11);
    *north = sqrt(o->cov_22);
    *correlation = o->cov_12 / (*east * *north);
}

bst_status bst_track_write_tdm(bst_ctx *ctx, FILE *stream, const bst_run_track *track,
                               const char *ephemeris, const char *what) {
    char object[96], comment[500];
    bst_track_object(track, object, sizeof object);
    bst_tdm_observation *items = malloc((size_t)track->count * sizeof *items);
    if (!items) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a track's observations");
    }
    double variance = 0.0;
    for (int64_t i = 0; i < track->count; i++) {
        const bst_run_observation *o = &track->items[i];
        items[i] = (bst_tdm_observation){.time = o->time, .mag = o->v_mag};
        bst_vec3_to_radec(o->od.direction, &items[i].ra_rad, &items[i].dec_rad);
        variance += 0.5 * (o->od.cov_11 + o->od.cov_22) / (double)track->count;
    }
    snprintf(comment, sizeof comment,
             "sensor %s, track %" PRId64 "%s\n%s\nstandard deviation per axis %.4f arcsec (rms)",
             track->sensor->name, track->id,
             track->target ? ", which the tracker took for its target" : "", what,
             sqrt(variance) / BST_ARCSEC_RAD);
    bst_tdm_segment segment = {
        .observer = track->sensor->observer,
        .object = object,
        .observer_ephemeris = ephemeris,
        .comment = comment,
        .integration_s = isfinite(track->exposure_s) ? track->exposure_s : 0.0,
        .aberration_removed = true,
        .light_time_removed = false,
        .aberration_yearly_deg = NAN,
        .aberration_orbital_deg = NAN,
        .observations = items,
        .count = track->count};
    bst_status status = bst_tdm_write_segment(ctx, stream, &segment);
    free(items);
    return status;
}

bst_status bst_track_write_json(bst_ctx *ctx, FILE *stream, const bst_run_track *track, int norad,
                                bool first) {
    char object[96], sensor[170], utc[40], id[40];
    bst_track_object(track, object, sizeof object);
    snprintf(sensor, sizeof sensor, "%s/%s", track->sensor->observer, track->sensor->name);
    snprintf(id, sizeof id, "%" PRId64, track->id);
    for (int64_t i = 0; i < track->count; i++) {
        const bst_run_observation *o = &track->items[i];
        const bst_od_observer *eye = &o->od.observer;
        double ra, dec, east, north, correlation;
        bst_vec3_to_radec(o->od.direction, &ra, &dec);
        sigmas(&o->od, &east, &north, &correlation);
        bst_time_to_utc(o->time, 6, utc, sizeof utc);
        bool known = track->target && track->sensor->target[0];
        cJSON *node = cJSON_CreateObject();
        cJSON_AddStringToObject(node, "classificationMarking", "U");
        cJSON_AddStringToObject(node, "dataMode", "SIMULATED");
        cJSON_AddStringToObject(node, "source", "BORESIGHT");
        cJSON_AddStringToObject(node, "createdBy", "boresight");
        cJSON_AddStringToObject(node, "type", "OPTICAL");
        cJSON_AddStringToObject(node, "obTime", utc);
        cJSON_AddStringToObject(node, "idSensor", sensor);
        cJSON_AddStringToObject(node, "trackId", id);
        cJSON_AddStringToObject(node, "origObjectId", object);
        cJSON_AddBoolToObject(node, "uct", !known);
        if (known) {
            cJSON_AddStringToObject(node, "idOnOrbit", object);
        }
        if (known && norad > 0) {
            cJSON_AddNumberToObject(node, "satNo", norad);
        }
        cJSON_AddNumberToObject(node, "ra", ra / BST_DEG_RAD);
        cJSON_AddNumberToObject(node, "declination", dec / BST_DEG_RAD);
        bst_json_add_number(node, "raUnc", east / BST_DEG_RAD);
        bst_json_add_number(node, "declinationUnc", north / BST_DEG_RAD);
        bst_json_add_number(node, "mag", o->v_mag);
        bst_json_add_number(node, "snrEst", o->snr);
        bst_json_add_number(node, "expDuration", track->exposure_s);
        cJSON_AddStringToObject(node, "senReferenceFrame", "GCRF");
        cJSON_AddNumberToObject(node, "senx", eye->position_m.x * 1e-3);
        cJSON_AddNumberToObject(node, "seny", eye->position_m.y * 1e-3);
        cJSON_AddNumberToObject(node, "senz", eye->position_m.z * 1e-3);
        cJSON_AddNumberToObject(node, "senvelx", eye->velocity_mps.x * 1e-3);
        cJSON_AddNumberToObject(node, "senvely", eye->velocity_mps.y * 1e-3);
        cJSON_AddNumberToObject(node, "senvelz", eye->velocity_mps.z * 1e-3);
        cJSON_AddStringToObject(node, "descriptor",
                                "ICRS; stellar aberration removed, light time contained");
        char *text = cJSON_PrintUnformatted(node);
        cJSON_Delete(node);
        if (!text) {
            return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for an observation");
        }
        fprintf(stream, "%s%s", first && i == 0 ? "\n" : ",\n", text);
        cJSON_free(text);
        BST_TRY(stream_ok(ctx, stream));
    }
    return BST_OK;
}

void bst_track_csv_head(FILE *stream) {
    fputs(
        "utc,track,object,sensor,ra_deg,dec_deg,ra_sigma_arcsec,dec_sigma_arcsec,correlation,"
        "v_mag,snr,observer_gcrf_x_m,observer_gcrf_y_m,observer_gcrf_z_m,observer_gcrf_x_mps,"
        "observer_gcrf_y_mps,observer_gcrf_z_mps\r\n",
        stream);
}

static void write_number(FILE *stream, double value) {
    if (isfinite(value)) {
        fprintf(stream, ",%.17g", value);
    } else {
        fputc(',', stream);
    }
}

bst_status bst_track_write_csv(bst_ctx *ctx, FILE *stream, const bst_run_track *track) {
    char object[96], sensor[170], id[200], utc[40];
    bst_track_object(track, object, sizeof object);
    snprintf(sensor, sizeof sensor, "%s/%s", track->sensor->observer, track->sensor->name);
    /* a track's number is unique within its sensor */
    snprintf(id, sizeof id, "%s/%" PRId64, sensor, track->id);
    for (int64_t i = 0; i < track->count; i++) {
        const bst_run_observation *o = &track->items[i];
        const bst_vec3 r = o->od.observer.position_m, v = o->od.observer.velocity_mps;
        double ra, dec, east, north, correlation;
        bst_vec3_to_radec(o->od.direction, &ra, &dec);
        sigmas(&o->od, &east, &north, &correlation);
        bst_time_to_utc(o->time, 6, utc, sizeof utc);
        fprintf(stream, "%s,", utc);
        bst_csv_put_text(stream, id);
        fputc(',', stream);
        bst_csv_put_text(stream, object);
        fputc(',', stream);
        bst_csv_put_text(stream, sensor);
        const double numbers[] = {ra / BST_DEG_RAD,
                                  dec / BST_DEG_RAD,
                                  east / BST_ARCSEC_RAD,
                                  north / BST_ARCSEC_RAD,
                                  correlation,
                                  o->v_mag,
                                  o->snr,
                                  r.x,
                                  r.y,
                                  r.z,
                                  v.x,
                                  v.y,
                                  v.z};
        for (size_t k = 0; k < sizeof numbers / sizeof *numbers; k++) {
            write_number(stream, numbers[k]);
        }
        fputs("\r\n", stream);
        BST_TRY(stream_ok(ctx, stream));
    }
    return BST_OK;
}
