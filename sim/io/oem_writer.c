#include "sim/io/oem_writer.h"

#include "sim/io/text_writer_internal.h"

enum { LAGRANGE_DEGREE = 9 };

bst_status bst_oem_write_head(bst_ctx *ctx, FILE *stream, const char *creation_utc,
                              const char *originator, const char *comment) {
    bst_io_kvn_write(stream, "CCSDS_OEM_VERS", "2.0");
    bst_io_kvn_comment(stream, comment);
    bst_io_kvn_write(stream, "CREATION_DATE", creation_utc);
    bst_io_kvn_write(stream, "ORIGINATOR", originator);
    return bst_text_stream_ok(ctx, stream);
}

static bst_status write_metadata(bst_ctx *ctx, FILE *stream, const bst_oem_segment *s,
                                 bst_time *first) {
    bst_time last;
    bst_vec3 r, v;
    char start[BST_TIME_TEXT_BYTES], stop[BST_TIME_TEXT_BYTES], degree[16];
    BST_TRY(s->series.state(s->series.user, ctx, s->series.rows - 1, &last, &r, &v));
    BST_TRY(s->series.state(s->series.user, ctx, 0, first, &r, &v));
    bst_text_utc(*first, start);
    bst_text_utc(last, stop);
    int64_t most = s->series.rows - 1;
    int lagrange = most < LAGRANGE_DEGREE ? (int)most : LAGRANGE_DEGREE;
    snprintf(degree, sizeof degree, "%d", s->hermite_degree > 0 ? s->hermite_degree : lagrange);
    fputs("\nMETA_START\n", stream);
    bst_io_kvn_write(stream, "OBJECT_NAME", s->object_name);
    bst_io_kvn_write(stream, "OBJECT_ID", s->object_id);
    bst_io_kvn_write(stream, "CENTER_NAME", "EARTH");
    bst_io_kvn_write(stream, "REF_FRAME", s->ref_frame);
    bst_io_kvn_write(stream, "TIME_SYSTEM", "UTC");
    bst_io_kvn_write(stream, "START_TIME", start);
    bst_io_kvn_write(stream, "STOP_TIME", stop);
    if (s->series.rows > 1) { /* a single state is not interpolated */
        bst_io_kvn_write(stream, "INTERPOLATION", s->hermite_degree > 0 ? "HERMITE" : "LAGRANGE");
        bst_io_kvn_write(stream, "INTERPOLATION_DEGREE", degree);
    }
    fputs("META_STOP\n\n", stream);
    bst_io_kvn_comment(stream, s->comment);
    return bst_text_stream_ok(ctx, stream);
}

static void write_covariance(FILE *stream, const bst_oem_segment *s) {
    char text[BST_TIME_TEXT_BYTES];
    bst_text_utc(s->covariance->epoch, text);
    fputs("\nCOVARIANCE_START\n", stream);
    bst_io_kvn_write(stream, "EPOCH", text);
    bst_io_kvn_write(stream, "COV_REF_FRAME", s->ref_frame);
    for (int i = 0; i < 6; i++) {
        for (int k = 0; k <= i; k++) {
            fprintf(stream, "%s%.12e", k ? " " : "", s->covariance->matrix[i][k] * 1e-6);
        }
        fputc('\n', stream);
    }
    fputs("COVARIANCE_STOP\n", stream);
}

bst_status bst_oem_write_segment(bst_ctx *ctx, FILE *stream, const bst_oem_segment *s) {
    if (!s->object_name || !*s->object_name || !s->object_id || !*s->object_id || !s->ref_frame) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "an OEM segment needs OBJECT_NAME and OBJECT_ID");
    }
    if (s->series.rows < 1) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "%.200s: an OEM segment needs at least one state",
                        s->object_name);
    }
    bst_time before;
    BST_TRY(write_metadata(ctx, stream, s, &before));
    for (int64_t row = 0; row < s->series.rows; row++) {
        bst_time t;
        bst_vec3 r, v;
        char text[BST_TIME_TEXT_BYTES];
        BST_TRY(s->series.state(s->series.user, ctx, row, &t, &r, &v));
        if (row > 0) {
            BST_TRY(bst_text_rising(ctx, s->object_name, row, before, t));
        }
        before = t;
        bst_text_utc(t, text);
        fprintf(stream, "%s %.9f %.9f %.9f %.12f %.12f %.12f\n", text, r.x * 1e-3, r.y * 1e-3,
                r.z * 1e-3, v.x * 1e-3, v.y * 1e-3, v.z * 1e-3);
        BST_TRY(bst_text_stream_ok(ctx, stream));
    }
    if (s->covariance) {
        write_covariance(stream, s);
    }
    return bst_text_stream_ok(ctx, stream);
}
