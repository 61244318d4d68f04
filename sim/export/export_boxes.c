/* Exports frames as PNG with bounding boxes of true sources, for training object detectors: COCO
 * annotations.json (cocodataset.org, "Data format", object detection), and YOLO text files
 * (docs.ultralytics.com, "Object Detection Datasets"). */
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <cjson/cJSON.h>

#include "boresight/version.h"
#include "sim/cli/progress.h"
#include "sim/core/folder.h"
#include "sim/core/json_number.h"
#include "sim/core/text.h"
#include "sim/export/export.h"
#include "sim/export/mask_labels.h"
#include "sim/export/shape_labels.h"
#include "sim/io/draft_file.h"
#include "sim/io/fits_reader.h"
#include "sim/io/frame_picture.h"
#include "sim/io/grey_png.h"

typedef enum class_kind { SATELLITE, STAR, CLASSES } class_kind;

static const char *const class_names[CLASSES] = {"satellite", "star"};

/* minimum width and height of a box after clipping to the image */
#define LEAST_PX 1.0
typedef struct job {
    const bst_export *e;
    const bst_run_sensor *sensor;
    bst_fits_reader *fits;
    bst_io_rows *truth; /* truth rows of the sensor, by exposure; at the next unprocessed row */
    bool truth_more;
    bst_shape_labels shapes;
    char set[256];
    bst_mask_labels masks, parts; /* of sources, and of parts of satellites */
    cJSON *images, *annotations;  /* COCO */
    int64_t written, boxes;
    int sensors, masked; /* number of exported sensors, and of those with masks */
} job;

/* The exported frame that contains a box, and its PNG. */
typedef struct frame_row {
    int64_t id, fits_index;
    double x0_px, y0_px, binning;
    int width, height; /* of the image */
    char utc[48], name[300];
} frame_row;

/* In pixels from the upper left corner of the image; the centre of the first pixel is 0.5. */
typedef struct box {
    class_kind class;
    double x, y, width, height; /* clipped to the image */
    double x_centroid, y_centroid;
    bool shaped; /* `shape` is known */
    bst_shape_label shape;
} box;

static const char frames_sql[] =
    "SELECT exposure_id, fits_index, x0_px, y0_px, binning, start_utc FROM frames"
    " WHERE sensor = ?1 AND fits_index IS NOT NULL ORDER BY exposure_id";

static const char truth_sql[] =
    "SELECT t.exposure_id, t.kind, t.x_start_px, t.x_mid_px, t.x_end_px, t.y_start_px, t.y_mid_px,"
    " t.y_end_px, t.v_mag, t.electrons, t.snr, t.x_chief_px, t.y_chief_px, t.x_centroid_px,"
    " t.y_centroid_px, o.name, t.norad, t.item, t.id FROM truth t"
    " LEFT JOIN objects o ON t.kind = 'object' AND o.id = t.id"
    " WHERE t.sensor = ?1 AND t.kind IN ('star', 'object') ORDER BY t.exposure_id, t.rowid";

/* Extent of a streak along one axis with `margin`, clipped to 0 ... size. False: less than LEAST_PX
 * remains. */
static bool clip(const double v[3], double margin, double size, double *from, double *length) {
    double low = fmin(v[0], fmin(v[1], v[2])) - margin,
           high = fmax(v[0], fmax(v[1], v[2])) + margin;
    low = fmax(low, 0.0);
    high = fmin(high, size);
    *from = low;
    *length = high - low;
    return *length >= LEAST_PX;
}

/* Bounding box of the current truth row; false: outside the image. */
static bool box_of(const job *j, const frame_row *f, box *out) {
    const bst_io_rows *r = j->truth;
    double x[3], y[3], margin = fmax(0.5 * j->e->box_px, 0.5 * LEAST_PX);
    /* boxes enclose the light, which the optics shift from the chief ray */
    double beside_x = bst_io_rows_real(r, 13) - bst_io_rows_real(r, 11);
    double beside_y = bst_io_rows_real(r, 14) - bst_io_rows_real(r, 12);
    bool finite = true;
    for (int k = 0; k < 3; k++) {
        x[k] = (bst_io_rows_real(r, 2 + k) + beside_x - f->x0_px + 0.5) / f->binning;
        y[k] = (bst_io_rows_real(r, 5 + k) + beside_y - f->y0_px + 0.5) / f->binning;
        finite = finite && isfinite(x[k]) && isfinite(y[k]);
    }
    out->class = strcmp(bst_io_rows_text(r, 1), "star") == 0 ? STAR : SATELLITE;
    out->x_centroid = (bst_io_rows_real(r, 13) - f->x0_px + 0.5) / f->binning;
    out->y_centroid = (bst_io_rows_real(r, 14) - f->y0_px + 0.5) / f->binning;
    bool bright = bst_io_rows_real(r, 9) > 0.0 &&
                  (out->class != STAR || bst_io_rows_real(r, 8) <= j->e->star_limit);
    return finite && bright && clip(x, margin, f->width, &out->x, &out->width) &&
           clip(y, margin, f->height, &out->y, &out->height);
}

/* Coordinates of a frame's image. */
static bst_shape_label_view view_of(const frame_row *f) {
    return (bst_shape_label_view){f->x0_px, f->y0_px, f->binning, f->binning};
}

/* Finds the shape of a box. An object that is larger than the box of a point gets the box around
 * its parts. False: no part is on the image. */
static bst_status find_shape(bst_ctx *ctx, job *j, const frame_row *f, box *b, bool *shown) {
    *shown = true;
    BST_TRY(bst_shape_labels_find(ctx, &j->shapes, f->id, bst_io_rows_int(j->truth, 17), &b->shape,
                                  &b->shaped));
    if (!b->shaped || !(b->shape.size_px > f->binning * j->e->box_px)) {
        return BST_OK;
    }
    const double x[] = {b->shape.x0_px, b->shape.x1_px}, y[] = {b->shape.y0_px, b->shape.y1_px};
    double ends[2][3];
    for (int k = 0; k < 3; k++) {
        ends[0][k] = (x[k / 2] - f->x0_px + 0.5) / f->binning;
        ends[1][k] = (y[k / 2] - f->y0_px + 0.5) / f->binning;
    }
    *shown = clip(ends[0], 0.5 * LEAST_PX, f->width, &b->x, &b->width) &&
             clip(ends[1], 0.5 * LEAST_PX, f->height, &b->y, &b->height);
    return BST_OK;
}

/* ------------------------------------------------------------------ masks */

/* Opens the recorded masks of the sensor. */
static bst_status open_masks(bst_ctx *ctx, job *j) {
    if (!j->e->coco) {
        return BST_OK;
    }
    BST_TRY(bst_mask_labels_open(ctx, j->e->run, j->sensor->file, "segmentation", &j->masks));
    j->masked += j->masks.fits != NULL;
    return bst_mask_labels_open(ctx, j->e->run, j->sensor->file, "parts", &j->parts);
}

/* Reads the masks of a frame. */
static bst_status read_masks(bst_ctx *ctx, job *j, const frame_row *f, int64_t index) {
    const bst_mask_frame frame = {index, f->id, f->width, f->height};
    bst_status status = bst_mask_labels_read(ctx, &j->masks, &frame);
    status = status == BST_OK ? bst_mask_labels_read(ctx, &j->parts, &frame) : status;
    return status == BST_OK ? BST_OK
                            : bst_fail_prefix(ctx, status, "%s", bst_run_reader_folder(j->e->run));
}

/* Adds "segmentation" and "area" of the current truth row from its mask pixels; without mask: no
 * polygons and the area of the box. */
static bst_status add_segmentation(bst_ctx *ctx, const job *j, const box *b, cJSON *node) {
    int64_t item = bst_io_rows_int(j->truth, 17);
    if (bst_mask_labels_pixels(&j->masks, item) > 0) {
        return bst_mask_labels_add(ctx, &j->masks, item, node);
    }
    bst_json_add_number(node, "area", b->width * b->height);
    cJSON_AddItemToObject(node, "segmentation", cJSON_CreateArray());
    return BST_OK;
}

/* ------------------------------------------------------------------ boxes */

/* Adds the COCO annotation of one true source. */
static bst_status add_coco_box(bst_ctx *ctx, job *j, const frame_row *f, const box *b) {
    cJSON *node = cJSON_CreateObject();
    cJSON_AddNumberToObject(node, "id", (double)(j->boxes + 1));
    cJSON_AddNumberToObject(node, "image_id", (double)(j->written + 1));
    cJSON_AddNumberToObject(node, "category_id", b->class + 1);
    cJSON_AddItemToObject(node, "bbox",
                          cJSON_CreateDoubleArray((double[]){b->x, b->y, b->width, b->height}, 4));
    cJSON_AddNumberToObject(node, "iscrowd", 0);
    bst_status status = add_segmentation(ctx, j, b, node);
    bst_json_add_number(node, "x_centroid", b->x_centroid);
    bst_json_add_number(node, "y_centroid", b->y_centroid);
    bst_json_add_number(node, "v_mag", bst_io_rows_real(j->truth, 8));
    bst_json_add_number(node, "snr", bst_io_rows_real(j->truth, 10));
    cJSON_AddStringToObject(node, "object_name", bst_io_rows_text(j->truth, 15));
    cJSON_AddNumberToObject(node, "norad", (double)bst_io_rows_int(j->truth, 16));
    if (b->shaped) {
        const bst_shape_label_view view = view_of(f);
        bst_shape_label_add(&b->shape, &view, node);
        status = status == BST_OK
                     ? bst_mask_labels_add_parts(ctx, &j->parts, bst_io_rows_int(j->truth, 18),
                                                 false, cJSON_GetObjectItem(node, "shape"))
                     : status;
    }
    cJSON_AddItemToArray(j->annotations, node);
    return status;
}

/* Adds the COCO image entry of a frame. */
static void add_coco_image(job *j, const frame_row *f) {
    char file[320];
    cJSON *node = cJSON_CreateObject();
    snprintf(file, sizeof file, "%s.png", f->name);
    cJSON_AddNumberToObject(node, "id", (double)(j->written + 1));
    cJSON_AddStringToObject(node, "file_name", file);
    cJSON_AddNumberToObject(node, "width", f->width);
    cJSON_AddNumberToObject(node, "height", f->height);
    cJSON_AddStringToObject(node, "date_captured", f->utc);
    cJSON_AddNumberToObject(node, "exposure_id", (double)f->id);
    cJSON_AddItemToArray(j->images, node);
}

/* Writes the boxes of a frame from the truth rows of its exposure; skips earlier rows. `yolo` NULL:
 * none. */
static bst_status write_boxes(bst_ctx *ctx, job *j, const frame_row *f, FILE *yolo) {
    for (; j->truth_more && bst_io_rows_int(j->truth, 0) <= f->id;) {
        box b = {.shaped = false};
        bool shown = bst_io_rows_int(j->truth, 0) == f->id && box_of(j, f, &b);
        if (shown && b.class == SATELLITE) {
            BST_TRY(find_shape(ctx, j, f, &b, &shown));
        }
        if (shown) {
            if (yolo) {
                fprintf(yolo, "%d %.9f %.9f %.9f %.9f\n", b.class, (b.x + 0.5 * b.width) / f->width,
                        (b.y + 0.5 * b.height) / f->height, b.width / f->width,
                        b.height / f->height);
            }
            if (j->annotations) {
                BST_TRY(add_coco_box(ctx, j, f, &b));
            }
            j->boxes++;
        }
        BST_TRY(bst_io_rows_next(ctx, j->truth, &j->truth_more));
    }
    return BST_OK;
}

/* Writes the picture of a frame below `folder`: DN, or 8-bit grey levels. */
static bst_status write_image(bst_ctx *ctx, const job *j, const char *folder, const frame_row *f,
                              const bst_fits_read_frame *image) {
    char path[4600];
    snprintf(path, sizeof path, "%.4000s/images/%s.png", folder, f->name);
    if (j->e->image_bits == 16) {
        return bst_grey_png_write16(ctx, path, image->pixels, f->width, f->height);
    }
    bst_picture *picture;
    size_t count = (size_t)f->width * (size_t)f->height;
    uint8_t *bgr = malloc(3 * count);
    if (!bgr) {
        return bst_fail(ctx, BST_ERR_MEMORY, "%s: out of memory", path);
    }
    bst_io_stretch stretch = bst_io_stretch_of(image->pixels, f->width, f->height);
    const bst_io_counts counts = {image->pixels, f->width, f->height};
    bst_status status =
        bst_frame_picture(ctx, &counts, stretch, NULL, f->width, f->height, &picture);
    if (status == BST_OK) {
        status = bst_picture_copy(ctx, picture, bgr);
        bst_picture_free(picture);
    }
    for (size_t i = 0; status == BST_OK && i < count; i++) {
        bgr[i] = bgr[3 * i];
    }
    status = status == BST_OK ? bst_grey_png_write8(ctx, path, bgr, f->width, f->height) : status;
    free(bgr);
    return status;
}

/* Writes one frame: PNG, mask polygons, COCO annotations and YOLO labels. */
static bst_status write_frame(bst_ctx *ctx, job *j, frame_row *f) {
    bst_fits_read_frame image;
    bool cube = bst_fits_reader_info(j->fits)->cube;
    BST_TRY(bst_fits_reader_frame(ctx, j->fits, f->fits_index - !cube, &image));
    f->width = image.width;
    f->height = image.height;
    snprintf(f->name, sizeof f->name, "%s.%04" PRId64, j->set, f->id);
    if (j->e->coco) {
        BST_TRY(write_image(ctx, j, j->e->coco, f, &image));
        BST_TRY(read_masks(ctx, j, f, f->fits_index - !cube));
    }
    if (!j->e->yolo) {
        BST_TRY(write_boxes(ctx, j, f, NULL));
    } else {
        char path[4600];
        bst_draft draft;
        BST_TRY(write_image(ctx, j, j->e->yolo, f, &image));
        snprintf(path, sizeof path, "%.4000s/labels/%s.txt", j->e->yolo, f->name);
        BST_TRY(bst_draft_open(ctx, path, &draft));
        bst_status status = write_boxes(ctx, j, f, draft.stream);
        BST_TRY(bst_draft_close(ctx, &draft, status));
    }
    if (j->images) {
        add_coco_image(j, f);
    }
    j->written++;
    return BST_OK;
}

/* Writes the selected frames of a sensor with their boxes. */
static bst_status write_frames(bst_ctx *ctx, job *j) {
    bst_io_rows *rows;
    bool more;
    bst_progress progress;
    bst_status status;
    BST_TRY(bst_io_rows_open(ctx, j->e->run, frames_sql, j->sensor->index, 0, &rows));
    bst_progress_start(
        &progress, j->set, "frames",
        bst_run_reader_int(j->e->run, "SELECT count(*) FROM frames WHERE sensor = ?1",
                           j->sensor->index, 0));
    for (int64_t n = 0; (status = bst_io_rows_next(ctx, rows, &more)) == BST_OK && more; n++) {
        frame_row f = {.id = bst_io_rows_int(rows, 0),
                       .fits_index = bst_io_rows_int(rows, 1),
                       .x0_px = bst_io_rows_real(rows, 2),
                       .y0_px = bst_io_rows_real(rows, 3),
                       .binning = fmax(1.0, bst_io_rows_real(rows, 4))};
        snprintf(f.utc, sizeof f.utc, "%s", bst_io_rows_text(rows, 5));
        if (f.id < j->e->first || f.id > j->e->last || (f.id - j->e->first) % j->e->every != 0) {
            continue;
        }
        status = bst_export_check(ctx);
        status = status == BST_OK ? write_frame(ctx, j, &f) : status;
        if (status != BST_OK) {
            break;
        }
        bst_progress_update(&progress, n + 1);
    }
    bst_progress_end(&progress);
    bst_io_rows_close(rows);
    return status;
}

/* Exports images and boxes of one sensor. */
static bst_status export_sensor(bst_ctx *ctx, job *j, bool several) {
    char path[4096];
    bst_export_set_name(j->e->run, several ? j->sensor : NULL, j->set);
    BST_TRY(bst_run_reader_file(ctx, j->e->run, j->sensor->file, path, sizeof path));
    BST_TRY(bst_io_rows_open(ctx, j->e->run, truth_sql, j->sensor->index, 0, &j->truth));
    bst_status status = bst_io_rows_next(ctx, j->truth, &j->truth_more);
    j->fits = NULL;
    j->sensors++;
    if (status == BST_OK) {
        status = bst_fits_reader_open(ctx, path, &j->fits);
    }
    status = status == BST_OK ? bst_shape_labels_open(ctx, j->e, (int)j->sensor->index, &j->shapes)
                              : status;
    status = status == BST_OK ? open_masks(ctx, j) : status;
    status = status == BST_OK ? write_frames(ctx, j) : status;
    bst_fits_reader_close(j->fits);
    bst_mask_labels_close(&j->masks);
    bst_mask_labels_close(&j->parts);
    bst_shape_labels_close(&j->shapes);
    bst_io_rows_close(j->truth);
    return status;
}

/* Writes a text file of the training set. */
static bst_status write_text(bst_ctx *ctx, const char *folder, const char *name, const char *text) {
    char path[4200];
    bst_draft draft;
    snprintf(path, sizeof path, "%.4000s/%s", folder, name);
    BST_TRY(bst_draft_open(ctx, path, &draft));
    fputs(text, draft.stream);
    return bst_draft_close(ctx, &draft, BST_OK);
}

/* Writes annotations.json. */
static bst_status write_coco(bst_ctx *ctx, const job *j, cJSON *root) {
    cJSON *info = cJSON_AddObjectToObject(root, "info");
    cJSON_AddStringToObject(info, "description", "frames of a Boresight run with true sources");
    cJSON_AddStringToObject(info, "version", bst_version());
    cJSON *categories = cJSON_AddArrayToObject(root, "categories");
    for (int k = 0; k < CLASSES; k++) {
        cJSON *node = cJSON_CreateObject();
        cJSON_AddNumberToObject(node, "id", k + 1);
        cJSON_AddStringToObject(node, "name", class_names[k]);
        cJSON_AddStringToObject(node, "supercategory", "source");
        cJSON_AddItemToArray(categories, node);
    }
    char *text = cJSON_PrintUnformatted(root);
    bst_status status = text ? write_text(ctx, j->e->coco, "annotations.json", text)
                             : bst_fail(ctx, BST_ERR_MEMORY, "out of memory for annotations");
    cJSON_free(text);
    return status;
}

/* Creates the folders of a set; that of labels only for YOLO. */
static bst_status make_folders(bst_ctx *ctx, const char *folder, bool labels) {
    char path[4200];
    snprintf(path, sizeof path, "%.4000s/images", folder);
    BST_TRY(bst_folder_make(ctx, path));
    snprintf(path, sizeof path, "%.4000s/labels", folder);
    return labels ? bst_folder_make(ctx, path) : BST_OK;
}

/* Exports images and boxes of every selected sensor. */
static bst_status export_all(bst_ctx *ctx, job *j) {
    bst_run_sensor sensors[BST_EXPORT_SENSORS];
    int count, kept = 0;
    bool several = bst_run_reader_int(j->e->run, "SELECT count(*) FROM sensors", 0, 1) > 1;
    BST_TRY(bst_run_sensors(ctx, j->e->run, j->e->sensor, sensors, &count));
    BST_TRY(bst_export_need_truth(ctx, j->e->run));
    for (int i = 0; i < count; i++) {
        if (sensors[i].file[0]) {
            kept++;
            j->sensor = &sensors[i];
            BST_TRY(export_sensor(ctx, j, several));
        }
    }
    return kept > 0 ? BST_OK
                    : bst_fail(ctx, BST_ERR_NOT_FOUND, "%s: its frames were not kept",
                               bst_run_reader_folder(j->e->run));
}

bst_status bst_export_boxes(bst_ctx *ctx, const bst_export *e) {
    job j = {.e = e};
    if (e->coco) {
        BST_TRY(make_folders(ctx, e->coco, false));
    }
    cJSON *root = cJSON_CreateObject();
    if (e->coco) {
        j.images = cJSON_AddArrayToObject(root, "images");
        j.annotations = cJSON_AddArrayToObject(root, "annotations");
    }
    bst_status status = e->yolo ? make_folders(ctx, e->yolo, true) : BST_OK;
    status = status == BST_OK ? export_all(ctx, &j) : status;
    if (status == BST_OK && e->coco) {
        status = write_coco(ctx, &j, root);
    }
    if (status == BST_OK && e->yolo) {
        status = write_text(ctx, e->yolo, "data.yaml",
                            "train: images\nval: images\nnames:\n  0: satellite\n  1: star\n");
    }
    cJSON_Delete(root);
    const char *const folders[] = {e->coco, e->yolo};
    for (int k = 0; status == BST_OK && k < 2; k++) {
        if (folders[k]) {
            char frames[BST_COUNT_TEXT], boxes[BST_COUNT_TEXT];
            printf("%s: %s with %s\n", folders[k],
                   bst_text_of_count(frames, j.written, "frame", "frames"),
                   bst_text_of_count(boxes, j.boxes, "box", "boxes"));
            if (k == 0 && j.masked < j.sensors) {
                printf(
                    "  \"segmentation\" is empty: the run has no masks; record them with "
                    "--set '/record/planes=[\"segmentation\"]'\n");
            }
        }
    }
    return status;
}
