#include "sim/study_kinds/study_labels.h"

#include <inttypes.h>
#include <math.h>

#include "sim/core/compare.h"

#define DEG (180.0 / BST_PI)

/* Writes a JSON number; null if not finite. */
static void put_number(FILE *stream, const char *key, double value) {
    if (isfinite(value)) {
        fprintf(stream, ",\"%s\":%.12g", key, value);
    } else {
        fprintf(stream, ",\"%s\":null", key);
    }
}

void bst_study_labels_text(FILE *stream, const char *key, const char *text) {
    fprintf(stream, ",\"%s\":\"", key);
    for (; *text; text++) {
        if (*text == '"' || *text == '\\') {
            putc('\\', stream);
        }
        if ((unsigned char)*text >= 0x20) {
            putc(*text, stream);
        }
    }
    putc('"', stream);
}

/* Writes extent, start, middle and end along one axis. */
static void put_axis(FILE *stream, char axis, const double v[3], double box) {
    fprintf(stream,
            ",\"%c_min\":%.12g,\"%c_max\":%.12g,\"%c_center\":%.12g,\"%c_start\":%.12g,\"%c_mid\":"
            "%.12g,\"%c_end\":%.12g",
            axis, bst_least_of_3(v), axis, bst_greatest_of_3(v), axis,
            0.5 * (bst_least_of_3(v) + bst_greatest_of_3(v)), axis, v[0], axis, v[1], axis, v[2]);
    put_number(stream, axis == 'y' ? "bbox_height" : "bbox_width",
               box > 0.0 ? box : bst_greatest_of_3(v) - bst_least_of_3(v));
}

static bool put_object(bst_study_labels *l, const bst_frame_message *f, double exposure_s,
                       const bst_truth_item *item, int number, bool first) {
    bool star = !bst_source_is_object(item->kind), ghost = bst_source_is_ghost(item->kind);
    double binning = f->binning > 1 ? f->binning : 1;
    double width = f->frame->width, height = f->frame->height;
    const double xs[3] = {item->x_start_px, item->x_mid_px, item->x_end_px};
    const double ys[3] = {item->y_start_px, item->y_mid_px, item->y_end_px};
    double x[3], y[3];
    /* boxes enclose the light, which the optics shift from the chief ray */
    double beside_x = item->x_centroid_px - item->x_chief_px,
           beside_y = item->y_centroid_px - item->y_chief_px;
    for (int k = 0; k < 3; k++) {
        x[k] = (xs[k] + beside_x - f->window.x0 + 0.5) / binning / width;
        y[k] = (ys[k] + beside_y - f->window.y0 + 0.5) / binning / height;
        if (!isfinite(x[k]) || !isfinite(y[k])) {
            return false;
        }
    }
    if (!(item->electrons > 0.0) || (star && !(item->v_mag <= l->star_limit_v_mag)) ||
        bst_greatest_of_3(x) < 0.0 || bst_least_of_3(x) > 1.0 || bst_greatest_of_3(y) < 0.0 ||
        bst_least_of_3(y) > 1.0) {
        return false;
    }
    FILE *s = l->stream;
    fprintf(s, "%s\n{\"class_name\":\"%s\",\"class_id\":%d", first ? "" : ",",
            ghost  ? "Ghost"
            : star ? "Star"
                   : "Satellite",
            ghost  ? 3
            : star ? 2
                   : 1);
    put_axis(s, 'y', y, l->box_px / height);
    put_axis(s, 'x', x, l->box_px / width);
    put_number(s, "x_centroid", (item->x_centroid_px - f->window.x0 + 0.5) / binning / width);
    put_number(s, "y_centroid", (item->y_centroid_px - f->window.y0 + 0.5) / binning / height);
    put_number(s, "x_chief", (item->x_chief_px - f->window.x0 + 0.5) / binning / width);
    put_number(s, "y_chief", (item->y_chief_px - f->window.y0 + 0.5) / binning / height);
    bst_study_labels_text(s, "source", "boresight");
    put_number(s, "magnitude", item->v_mag);
    put_number(s, "pe_per_sec", exposure_s > 0.0 ? item->electrons / exposure_s : NAN);
    fprintf(s, ",\"seg_id\":%d", number);
    bst_study_labels_text(s, "object_name",
                          star ? "" : bst_world_object(l->world, (int)item->id)->name);
    fprintf(s, ",\"object_id\":\"%" PRId64 "\"",
            star || item->norad == 0 ? (int64_t)item->id : (int64_t)item->norad);
    put_number(s, "snr_aperture", item->snr);
    put_number(s, "ra", item->ra_rad * DEG);
    put_number(s, "dec", item->dec_rad * DEG);
    putc('}', s);
    l->stars += star && !ghost;
    if (!star && !ghost) {
        l->satellites++;
        l->snr_sum += item->snr;
        l->longest_px = fmax(l->longest_px, hypot(xs[2] - xs[0], ys[2] - ys[0]));
    }
    return true;
}

void bst_study_labels_frame(bst_study_labels *l, const bst_frame_message *frame,
                            const char *start_utc, double exposure_s, const bst_truth *truth) {
    fprintf(l->stream, "%s\n{\"sequence_id\":%" PRId64 ",\"plane\":%" PRId64, l->frames ? "," : "",
            frame->exposure_id, l->frames);
    bst_study_labels_text(l->stream, "start_utc", start_utc);
    put_number(l->stream, "exposure_s", exposure_s);
    put_number(l->stream, "background_e", truth->background_e);
    fprintf(l->stream, ",\"objects\":[");
    bool first = true;
    for (int i = 0; i < truth->count; i++) {
        first = !put_object(l, frame, exposure_s, &truth->items[i], l->mask ? i + 1 : -1, first) &&
                first;
    }
    fprintf(l->stream, "]}");
    l->frames++;
}
