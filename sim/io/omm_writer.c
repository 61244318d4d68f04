#include "sim/io/omm_writer.h"

#include <math.h>

#include "boresight/vec.h"
#include "sim/io/text_writer_internal.h"

static void write_text(FILE *stream, const char *key, const char *text) {
    fprintf(stream, "    \"%s\": \"", key);
    for (; *text; text++) {
        unsigned char c = (unsigned char)*text;
        if (c == '"' || c == '\\') {
            fputc('\\', stream);
        }
        fputc(c >= 0x20 && c < 0x7f ? c : '_', stream);
    }
    fputs("\",\n", stream);
}

static double turn_deg(double rad) {
    double degrees = fmod(rad / BST_DEG_RAD, 360.0);
    degrees += degrees < 0.0 ? 360.0 : 0.0;
    return degrees < 360.0 - 0.5e-8 ? degrees : 0.0;
}

bst_status bst_omm_write(bst_ctx *ctx, FILE *stream, const bst_elements *e,
                         const char *creation_utc, const char *originator, const char *comment) {
    bst_time epoch;
    char text[BST_TIME_TEXT_BYTES];
    BST_TRY(bst_time_from_utc_jd(ctx, e->epoch_utc_jd1, e->epoch_utc_jd2, &epoch));
    if (!isfinite(e->mean_motion_radpmin + e->eccentricity + e->inclination_rad + e->raan_rad +
                  e->arg_perigee_rad + e->mean_anomaly_rad + e->bstar)) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "mean elements that are not finite");
    }
    fputs("[\n  {\n", stream);
    write_text(stream, "CCSDS_OMM_VERS", "3.0");
    if (comment) {
        write_text(stream, "COMMENT", comment);
    }
    write_text(stream, "CREATION_DATE", creation_utc);
    write_text(stream, "ORIGINATOR", originator);
    write_text(stream, "OBJECT_NAME", e->name[0] ? e->name : "UNKNOWN");
    write_text(stream, "OBJECT_ID", e->designator[0] ? e->designator : "UNKNOWN");
    write_text(stream, "CENTER_NAME", "EARTH");
    write_text(stream, "REF_FRAME", "TEME");
    write_text(stream, "TIME_SYSTEM", "UTC");
    write_text(stream, "MEAN_ELEMENT_THEORY", "SGP4");
    bst_time_to_utc(epoch, 6, text, sizeof text);
    text[26] = '\0'; /* removes the Z */
    write_text(stream, "EPOCH", text);
    fprintf(stream,
            "    \"MEAN_MOTION\": %.12f,\n"
            "    \"ECCENTRICITY\": %.10f,\n"
            "    \"INCLINATION\": %.8f,\n"
            "    \"RA_OF_ASC_NODE\": %.8f,\n"
            "    \"ARG_OF_PERICENTER\": %.8f,\n"
            "    \"MEAN_ANOMALY\": %.8f,\n"
            "    \"EPHEMERIS_TYPE\": 0,\n"
            "    \"CLASSIFICATION_TYPE\": \"U\",\n"
            "    \"NORAD_CAT_ID\": %d,\n"
            "    \"ELEMENT_SET_NO\": %d,\n"
            "    \"REV_AT_EPOCH\": %d,\n"
            "    \"BSTAR\": %.9g,\n"
            "    \"MEAN_MOTION_DOT\": %.9g,\n"
            "    \"MEAN_MOTION_DDOT\": %.9g\n"
            "  }\n]\n",
            e->mean_motion_radpmin * 1440.0 / (2.0 * BST_PI), e->eccentricity,
            e->inclination_rad / BST_DEG_RAD, turn_deg(e->raan_rad), turn_deg(e->arg_perigee_rad),
            turn_deg(e->mean_anomaly_rad), e->norad, e->element_set, e->revolution, e->bstar,
            e->ndot_rev_day2, e->nddot_rev_day3);
    return bst_text_stream_ok(ctx, stream);
}
