#include "sim/io/tdm_writer.h"

#include <math.h>

#include "boresight/vec.h"
#include "sim/io/text_writer_internal.h"

bst_status bst_tdm_write_head(bst_ctx *ctx, FILE *stream, const char *creation_utc,
                              const char *originator, const char *comment) {
    bst_io_kvn_write(stream, "CCSDS_TDM_VERS", "2.0");
    bst_io_kvn_comment(stream, comment);
    bst_io_kvn_write(stream, "CREATION_DATE", creation_utc);
    bst_io_kvn_write(stream, "ORIGINATOR", originator);
    return bst_text_stream_ok(ctx, stream);
}

/* Checks participants, angles and time order of a TDM segment. */
static bst_status check(bst_ctx *ctx, const bst_tdm_segment *s) {
    if (!s->observer || !*s->observer || !s->object || !*s->object) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "a TDM segment needs the names of two participants");
    }
    if (s->count < 1) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "%.200s: a TDM segment needs an observation",
                        s->object);
    }
    for (int64_t i = 0; i < s->count; i++) {
        const bst_tdm_observation *o = &s->observations[i];
        if (!isfinite(o->ra_rad) || !(fabs(o->dec_rad) <= 0.5 * BST_PI)) {
            return bst_fail(ctx, BST_ERR_ARGUMENT, "%.200s: angles %g and %g rad are no direction",
                            s->object, o->ra_rad, o->dec_rad);
        }
        if (i > 0) {
            BST_TRY(bst_text_rising(ctx, s->object, i, o[-1].time, o->time));
        }
    }
    return BST_OK;
}

static void write_metadata(FILE *stream, const bst_tdm_segment *s) {
    char start[BST_TIME_TEXT_BYTES], stop[BST_TIME_TEXT_BYTES], number[32];
    bst_text_utc(s->observations[0].time, start);
    bst_text_utc(s->observations[s->count - 1].time, stop);
    fputs("\nMETA_START\n", stream);
    bst_io_kvn_comment(stream, s->comment);
    bst_io_kvn_comment(stream,
                       s->aberration_removed
                           ? "Stellar aberration of the observer (Earth's and orbital velocity) "
                             "removed from each observation."
                           : "Stellar aberration of the observer is contained in the angles.");
    bst_io_kvn_comment(stream, s->light_time_removed
                                   ? "Light time removed: object and observer at one instant."
                                   : "Light time contained: observer at reception, object at "
                                     "emission.");
    bst_io_kvn_write(stream, "TIME_SYSTEM", "UTC");
    bst_io_kvn_write(stream, "START_TIME", start);
    bst_io_kvn_write(stream, "STOP_TIME", stop);
    bst_io_kvn_write(stream, "PARTICIPANT_1", s->observer);
    bst_io_kvn_write(stream, "PARTICIPANT_2", s->object);
    bst_io_kvn_write(stream, "MODE", "SEQUENTIAL");
    bst_io_kvn_write(stream, "PATH", "2,1");
    if (s->observer_ephemeris) {
        bst_io_kvn_write(stream, "EPHEMERIS_NAME_1", s->observer_ephemeris);
    }
    bst_io_kvn_write(stream, "TIMETAG_REF", "RECEIVE");
    if (s->integration_s > 0.0) {
        snprintf(number, sizeof number, "%.9g", s->integration_s);
        bst_io_kvn_write(stream, "INTEGRATION_INTERVAL", number);
        bst_io_kvn_write(stream, "INTEGRATION_REF", "MIDDLE");
    }
    bst_io_kvn_write(stream, "ANGLE_TYPE", "RADEC");
    bst_io_kvn_write(stream, "REFERENCE_FRAME", "ICRF");
    bool sizes = false;
    if (s->aberration_removed && isfinite(s->aberration_yearly_deg)) {
        snprintf(number, sizeof number, "%.9f", s->aberration_yearly_deg);
        bst_io_kvn_write(stream, "CORRECTION_ABERRATION_YEARLY", number);
        sizes = true;
    }
    if (s->aberration_removed && isfinite(s->aberration_orbital_deg)) {
        snprintf(number, sizeof number, "%.9f", s->aberration_orbital_deg);
        bst_io_kvn_write(stream, "CORRECTION_ABERRATION_DIURNAL", number);
        sizes = true;
    }
    if (sizes) {
        bst_io_kvn_write(stream, "CORRECTIONS_APPLIED", "YES");
    }
    fputs("META_STOP\n\n", stream);
}

/* Angle in degrees, within [0, 360) also after rounding in print. */
static double turn_deg(double rad) {
    double degrees = fmod(rad / BST_DEG_RAD, 360.0);
    degrees += degrees < 0.0 ? 360.0 : 0.0;
    return degrees < 360.0 - 0.5e-9 ? degrees : 0.0;
}

bst_status bst_tdm_write_segment(bst_ctx *ctx, FILE *stream, const bst_tdm_segment *s) {
    BST_TRY(check(ctx, s));
    write_metadata(stream, s);
    fputs("DATA_START\n", stream);
    for (int64_t i = 0; i < s->count; i++) {
        const bst_tdm_observation *o = &s->observations[i];
        char text[BST_TIME_TEXT_BYTES];
        bst_text_utc(o->time, text);
        fprintf(stream, "ANGLE_1 = %s %.9f\n", text, turn_deg(o->ra_rad));
        fprintf(stream, "ANGLE_2 = %s %.9f\n", text, o->dec_rad / BST_DEG_RAD);
        if (isfinite(o->mag)) {
            fprintf(stream, "MAG = %s %.4f\n", text, o->mag);
        }
        BST_TRY(bst_text_stream_ok(ctx, stream));
    }
    fputs("DATA_STOP\n", stream);
    return bst_text_stream_ok(ctx, stream);
}
