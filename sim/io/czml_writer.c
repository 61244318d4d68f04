#include "sim/io/czml_writer.h"

#include <math.h>
#include <string.h>

#include "sim/io/text_writer_internal.h"

enum { LAGRANGE_DEGREE = 5 };

/* Length of the UTF-8 character at c; 0: invalid (RFC 3629). */
static size_t utf8_length(const unsigned char *c) {
    size_t length = c[0] < 0x80                   ? 1
                    : c[0] >= 0xC2 && c[0] < 0xE0 ? 2
                    : c[0] >= 0xE0 && c[0] < 0xF0 ? 3
                    : c[0] >= 0xF0 && c[0] < 0xF5 ? 4
                                                  : 0;
    for (size_t k = 1; k < length; k++) {
        if ((c[k] & 0xC0) != 0x80) {
            return 0;
        }
    }
    bool overlong_or_surrogate = (c[0] == 0xE0 && c[1] < 0xA0) || (c[0] == 0xED && c[1] > 0x9F) ||
                                 (c[0] == 0xF0 && c[1] < 0x90) || (c[0] == 0xF4 && c[1] > 0x8F);
    return length > 1 && overlong_or_surrogate ? 0 : length;
}

/* Writes a JSON string with quotes. */
static void write_string(FILE *stream, const char *text) {
    fputc('"', stream);
    const unsigned char *c = (const unsigned char *)text;
    while (*c) {
        size_t length = utf8_length(c);
        if (length == 0) {
            fputc('?', stream);
            length = 1;
        } else if (*c == '"' || *c == '\\') {
            fprintf(stream, "\\%c", *c);
        } else if (*c < 0x20) {
            fprintf(stream, "\\u%04X", *c);
        } else {
            fwrite(c, 1, length, stream);
        }
        c += length;
    }
    fputc('"', stream);
}

static void write_interval(FILE *stream, bst_time start, bst_time stop) {
    char a[BST_TIME_TEXT_BYTES], b[BST_TIME_TEXT_BYTES];
    bst_text_utc(start, a);
    bst_text_utc(stop, b);
    fprintf(stream, "\"%sZ/%sZ\"", a, b);
}

bst_status bst_czml_write_head(bst_ctx *ctx, FILE *stream, const char *name, bst_time start,
                               bst_time stop, double multiplier) {
    char now[BST_TIME_TEXT_BYTES];
    bst_text_utc(start, now);
    fputs("[{\"id\":\"document\",\"name\":", stream);
    write_string(stream, name);
    fputs(",\"version\":\"1.0\",\n\"clock\":{\"interval\":", stream);
    write_interval(stream, start, stop);
    fprintf(stream,
            ",\"currentTime\":\"%sZ\",\"multiplier\":%.9g,\"range\":\"LOOP_STOP\","
            "\"step\":\"SYSTEM_CLOCK_MULTIPLIER\"}}",
            now, isfinite(multiplier) ? multiplier : 1.0);
    return bst_text_stream_ok(ctx, stream);
}

static void write_color(FILE *stream, const bst_czml_object *o) {
    const unsigned char *c = o->rgba;
    bool white = !c[0] && !c[1] && !c[2] && !c[3];
    fprintf(stream, "{\"rgba\":[%d,%d,%d,%d]}", white ? 255 : c[0], white ? 255 : c[1],
            white ? 255 : c[2], white ? 255 : c[3]);
}

static void write_looks(FILE *stream, const bst_czml_object *o, double span_s) {
    if (o->point_px >= 0.0) {
        fprintf(stream, ",\n\"point\":{\"pixelSize\":%.9g,\"color\":",
                o->point_px > 0.0 ? o->point_px : 6.0);
        write_color(stream, o);
        fputs("}", stream);
    }
    if (o->label) {
        fputs(",\n\"label\":{\"text\":", stream);
        write_string(stream, o->name ? o->name : o->id);
        fputs(
            ",\"font\":\"11pt sans-serif\",\"horizontalOrigin\":\"LEFT\","
            "\"pixelOffset\":{\"cartesian2\":[8,0]},\"fillColor\":",
            stream);
        write_color(stream, o);
        fputs("}", stream);
    }
    if (o->path_s > 0.0) {
        fprintf(stream,
                ",\n\"path\":{\"leadTime\":0,\"trailTime\":%.9g,\"width\":1,\"resolution\":60,"
                "\"material\":{\"solidColor\":{\"color\":",
                fmin(o->path_s, span_s));
        write_color(stream, o);
        fputs("}}}", stream);
    }
}

bst_status bst_czml_write_object(bst_ctx *ctx, FILE *stream, const bst_czml_object *o) {
    if (!o->id || !*o->id || strcmp(o->id, "document") == 0) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "\"%.200s\" cannot be the id of a CZML packet: give a unique one that is "
                        "not \"document\"",
                        o->id ? o->id : "");
    }
    if (o->series.rows < 1) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "%.200s: a CZML packet needs at least one state",
                        o->id);
    }
    bst_time first, last, before;
    bst_vec3 r, v;
    char epoch[BST_TIME_TEXT_BYTES];
    BST_TRY(o->series.state(o->series.user, ctx, o->series.rows - 1, &last, &r, &v));
    BST_TRY(o->series.state(o->series.user, ctx, 0, &first, &r, &v));
    before = first;
    bst_text_utc(first, epoch);
    fputs(",\n{\"id\":", stream);
    write_string(stream, o->id);
    fputs(",\"name\":", stream);
    write_string(stream, o->name ? o->name : o->id);
    if (o->description) {
        fputs(",\"description\":", stream);
        write_string(stream, o->description);
    }
    fputs(",\n\"availability\":", stream);
    write_interval(stream, first, last);
    write_looks(stream, o, bst_time_diff(last, first));
    fprintf(stream,
            ",\n\"position\":{\"interpolationAlgorithm\":\"%s\",\"interpolationDegree\":%d,"
            "\"referenceFrame\":\"INERTIAL\",\"epoch\":\"%sZ\",\"cartesian\":[",
            o->linear ? "LINEAR" : "LAGRANGE", o->linear ? 1 : LAGRANGE_DEGREE, epoch);
    for (int64_t row = 0; row < o->series.rows; row++) {
        bst_time t;
        BST_TRY(o->series.state(o->series.user, ctx, row, &t, &r, &v));
        if (row > 0) {
            BST_TRY(bst_text_rising(ctx, o->id, row, before, t));
        }
        before = t;
        fprintf(stream, "%s\n%.9f,%.4f,%.4f,%.4f", row ? "," : "", bst_time_diff(t, first), r.x,
                r.y, r.z);
        BST_TRY(bst_text_stream_ok(ctx, stream));
    }
    fputs("]}}", stream);
    return bst_text_stream_ok(ctx, stream);
}

bst_status bst_czml_write_line(bst_ctx *ctx, FILE *stream, const bst_czml_line *line) {
    fputs(",\n{\"id\":", stream);
    write_string(stream, line->id);
    fputs(",\"name\":", stream);
    write_string(stream, line->name);
    fputs(",\n\"availability\":", stream);
    write_interval(stream, line->start, line->stop);
    fprintf(stream,
            ",\n\"polyline\":{\"arcType\":\"NONE\",\"width\":1,\"material\":{\"solidColor\":{"
            "\"color\":{\"rgba\":[%d,%d,%d,%d]}}},\n\"positions\":{\"references\":[",
            line->rgba[0], line->rgba[1], line->rgba[2], line->rgba[3]);
    for (int i = 0; i < line->count; i++) {
        char reference[300];
        snprintf(reference, sizeof reference, "%.280s#position", line->ids[i]);
        fputs(i ? "," : "", stream);
        write_string(stream, reference);
    }
    fputs("]}}}", stream);
    return bst_text_stream_ok(ctx, stream);
}

bst_status bst_czml_write_tail(bst_ctx *ctx, FILE *stream) {
    fputs("]\n", stream);
    return bst_text_stream_ok(ctx, stream);
}
