#define _XOPEN_SOURCE 700 /* mkdtemp */
#include "view/editor_drop.h"

#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>
#include <unistd.h>

#include "boresight/vec.h"
#include "sim/astro/elements.h"
#include "sim/astro/tle.h"
#include "sim/core/draft.h"
#include "sim/core/file.h"
#include "sim/io/keyword_map.h"
#include "sim/satellite/model.h"
#include "view/request_guard.h"

/* Longest name of a file. */
enum { NAME_BYTES = 64 };

/* Values of JSON that are read: 80 bytes of memory each. */
enum { JSON_VALUES = 2000000 };

/* One file at a time: reading one takes memory. */
static pthread_mutex_t reading = PTHREAD_MUTEX_INITIALIZER;

static bool begins(const char *data, size_t bytes, const char *with) {
    const size_t n = strlen(with);
    return bytes >= n && memcmp(data, with, n) == 0;
}

/* True for a file name with this extension, in letters of any case. */
static bool has_extension(const char *name, const char *extension) {
    const char *dot = strrchr(name, '.');
    return dot && strcasecmp(dot, extension) == 0;
}

/* ------------------------------------------------------------------ element sets */

/* Adds a set as the lines of a TLE. A number that these cannot hold is 0 there, and the name of a
 * set without one. */
static bst_status add_set(bst_ctx *ctx, const bst_elements *set, cJSON *list) {
    char line1[BST_TLE_CHARS + 1], line2[BST_TLE_CHARS + 1], number[16];
    bst_elements lines = *set;
    const bool fits = set->norad <= BST_TLE_NORAD_MOST;
    lines.norad = fits ? set->norad : 0;
    snprintf(number, sizeof number, "%d", set->norad);
    BST_TRY(bst_tle_format(ctx, &lines, line1, line2));
    cJSON *node = cJSON_CreateObject();
    cJSON_AddItemToArray(list, node);
    cJSON_AddStringToObject(node, "name", fits || *set->name ? set->name : number);
    cJSON_AddNumberToObject(node, "norad", set->norad);
    cJSON_AddStringToObject(node, "line1", line1);
    cJSON_AddStringToObject(node, "line2", line2);
    return BST_OK;
}

static bst_status read_elements(bst_ctx *ctx, const char *name, const char *data, size_t bytes,
                                cJSON *out) {
    bst_elements *sets = NULL;
    int count = 0, listed = 0, left_out = 0;
    bst_ctx misfit = {0};
    BST_TRY(bst_elements_read_buffer(ctx, name, data, bytes, NULL, &sets, &count));
    cJSON_AddStringToObject(out, "kind", "elements");
    cJSON_AddNumberToObject(out, "total", count);
    cJSON *list = cJSON_AddArrayToObject(out, "satellites");
    for (int i = 0; i < count && listed < BST_VIEW_DROP_SETS; i++) {
        const bool added = add_set(&misfit, &sets[i], list) == BST_OK;
        listed += added;
        left_out += !added;
    }
    free(sets);
    cJSON_AddNumberToObject(out, "left_out", left_out);
    return listed > 0 ? BST_OK : bst_fail(ctx, BST_ERR_ARGUMENT, "%s: %s", name, misfit.message);
}

/* ------------------------------------------------------------------ files for readers of files */

/* A file with the name of the dropped one, in a folder of its own. */
typedef struct scratch_file {
    char folder[1024];
    char path[1024 + NAME_BYTES + 2];
} scratch_file;

static void scratch_remove(scratch_file *file) {
    unlink(file->path);
    rmdir(file->folder);
}

static bool write_file(int fd, const char *data, size_t bytes) {
    const bool good = fd >= 0 && bst_file_write_all(fd, data, bytes);
    return (fd < 0 || close(fd) == 0) && good;
}

static bst_status scratch_make(bst_ctx *ctx, const char *name, const char *data, size_t bytes,
                               scratch_file *out) {
    const char *base = getenv("TMPDIR");
    const int length = snprintf(out->folder, sizeof out->folder, "%s/boresight-drop-XXXXXX",
                                base && *base ? base : "/tmp");
    if (length < 0 || (size_t)length >= sizeof out->folder) {
        return bst_fail(ctx, BST_ERR_IO, "TMPDIR: the path is too long");
    }
    if (!mkdtemp(out->folder)) {
        return bst_fail(ctx, BST_ERR_IO, "%s: %s", out->folder, strerror(errno));
    }
    snprintf(out->path, sizeof out->path, "%s/%s", out->folder, name);
    if (!write_file(open(out->path, O_WRONLY | O_CREAT | O_EXCL, 0600), data, bytes)) {
        const int why = errno;
        scratch_remove(out);
        return bst_fail(ctx, BST_ERR_IO, "%s: %s", out->path, strerror(why));
    }
    return BST_OK;
}

/* Names the dropped file first in a message, not the one that was read. */
static bst_status name_file(bst_ctx *ctx, bst_status status, const scratch_file *file) {
    const size_t folder = strlen(file->folder) + 1;
    const char *name = file->path + folder, *first;
    for (char *at; status != BST_OK && (at = strstr(ctx->message, file->folder));) {
        memmove(at, at + folder, strlen(at + folder) + 1);
    }
    if (status != BST_OK && (first = strstr(ctx->message, name))) {
        memmove(ctx->message, first, strlen(first) + 1);
    }
    return status;
}

/* ------------------------------------------------------------------ shapes */

/* Writes the file to the working folder; the same bytes may be there. */
static bst_status keep_file(bst_ctx *ctx, const char *name, const char *data, size_t bytes) {
    char *there = NULL, draft[256];
    size_t there_bytes = 0;
    bst_ctx missing = {0};
    struct stat found;
    int fd;
    if (lstat(name, &found) == 0) {
        const bool same = bst_file_read(&missing, name, BST_VIEW_FILE_BYTES, "a file", &there,
                                        &there_bytes) == BST_OK &&
                          there_bytes == bytes && memcmp(there, data, bytes) == 0;
        free(there);
        return same ? BST_OK
                    : bst_fail(ctx, BST_ERR_ARGUMENT,
                               "%s: another file of this name is in the folder; rename one of them",
                               name);
    }
    BST_TRY(bst_draft_make(ctx, name, draft, sizeof draft, &fd));
    /* link() replaces no file that has appeared meanwhile */
    const bool good = write_file(fd, data, bytes) && link(draft, name) == 0;
    const int why = errno;
    unlink(draft);
    if (good) {
        return BST_OK;
    }
    return bst_fail(ctx, BST_ERR_IO, "%s: cannot be written: %s", name, strerror(why));
}

static bst_status read_shape(bst_ctx *ctx, const char *name, const char *data, size_t bytes,
                             cJSON *out) {
    scratch_file file;
    bst_satellite *satellite = NULL;
    if (!has_extension(name, ".glb") && !has_extension(name, ".gltf")) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "%s: is a glTF file, whose name must end with .glb or .gltf", name);
    }
    BST_TRY(scratch_make(ctx, name, data, bytes, &file));
    bst_status status = name_file(ctx, bst_satellite_load(ctx, file.path, &satellite), &file);
    scratch_remove(&file);
    status = status == BST_OK ? keep_file(ctx, name, data, bytes) : status;
    if (status == BST_OK) {
        cJSON_AddStringToObject(out, "kind", "shape");
        cJSON_AddStringToObject(out, "file", name);
        cJSON_AddNumberToObject(out, "parts", satellite->part_count);
        cJSON_AddNumberToObject(out, "facets", satellite->facet_count);
        cJSON_AddNumberToObject(out, "radius_m", satellite->radius_m);
    }
    bst_satellite_free(satellite);
    return status;
}

/* ------------------------------------------------------------------ frames */

/* Adds something that the file says, which has no check mark if its meaning is unsure. Returns the
 * list of its changes. */
static cJSON *add_offer(cJSON *offers, const char *from, const char *text, bool unsure) {
    cJSON *offer = cJSON_CreateObject();
    cJSON_AddStringToObject(offer, "text", text);
    cJSON_AddStringToObject(offer, "from", from);
    cJSON_AddBoolToObject(offer, "unsure", unsure);
    cJSON_AddItemToArray(offers, offer);
    return cJSON_AddArrayToObject(offer, "changes");
}

static void add_change(cJSON *changes, const char *key, cJSON *value) {
    cJSON *change = cJSON_CreateObject();
    cJSON_AddStringToObject(change, "key", key);
    cJSON_AddItemToObject(change, "value", value);
    cJSON_AddItemToArray(changes, change);
}

/* A number of the header, under the first of some names ("" ends them). False: none has it. */
static bool number_of(bst_frame_source *source, const char *const *names, double *value,
                      const char **from) {
    char text[BST_FITS_SOURCE_TEXT], *end;
    for (; **names; names++) {
        if (bst_frame_source_text(source, *names, text)) {
            *value = strtod(text, &end);
            if (end != text && *end == '\0' && isfinite(*value)) {
                *from = *names;
                return true;
            }
        }
    }
    return false;
}

/* Offers a number of the header for a key of the sensor, if the key may have it. */
static void offer_number(bst_frame_source *source, const char *const *names, const char *key,
                         const char *what, const double range[2], cJSON *offers) {
    double value;
    const char *from;
    char text[120];
    if (number_of(source, names, &value, &from) && value >= range[0] && value <= range[1]) {
        snprintf(text, sizeof text, what, value);
        /* GAIN is a setting without a unit in many headers */
        const bool unsure = strcmp(from, "GAIN") == 0;
        add_change(add_offer(offers, from, text, unsure), key, cJSON_CreateNumber(value));
    }
}

/* Offers the direction of the middle of the frame, and the pixel scale, by the WCS. */
static void offer_pointing(bst_frame_source *source, const bst_frame_place *frame, cJSON *offers) {
    bst_quat q;
    double scale, ra, dec;
    char text[120];
    if (!bst_keyword_wcs(source, frame, false, &q, &scale) &&
        !bst_keyword_wcs(source, frame, true, &q, &scale)) { /* the middle is the same */
        return;
    }
    bst_vec3_to_radec(bst_quat_rotate(bst_quat_conj(q), (bst_vec3){0, 0, 1}), &ra, &dec);
    const double direction[2] = {(ra < 0.0 ? ra + 2.0 * BST_PI : ra) / BST_DEG_RAD,
                                 dec / BST_DEG_RAD};
    snprintf(text, sizeof text, "Cue to the middle of the frame: RA %.5f, Dec %.5f deg",
             direction[0], direction[1]);
    cJSON *changes = add_offer(offers, "WCS", text, false);
    add_change(changes, "cue/direction_radec_deg", cJSON_CreateDoubleArray(direction, 2));
    add_change(changes, "cue/object", cJSON_CreateString(""));
    if (scale >= 0.001 && scale <= 600.0) {
        snprintf(text, sizeof text, "Pixel scale %.5g arcsec", scale);
        add_change(add_offer(offers, "WCS", text, false), "camera/pixel_scale_arcsec",
                   cJSON_CreateNumber(scale));
    }
}

/* Offers the time of the frame as the scenario's epoch. */
static void offer_epoch(bst_frame_source *source, cJSON *offers) {
    char date[BST_FITS_SOURCE_TEXT + 1], text[200];
    bst_ctx ignored = {0};
    bst_time time;
    if (!bst_frame_source_text(source, "DATE-OBS", date)) {
        return;
    }
    const size_t length = strlen(date);
    if (length > 0 && date[length - 1] != 'Z') {
        snprintf(date + length, 2, "Z");
    }
    if (bst_time_from_utc(&ignored, date, &time) == BST_OK) {
        snprintf(text, sizeof text, "The scenario begins at the time of the frame: %s", date);
        add_change(add_offer(offers, "DATE-OBS", text, false), "/epoch_utc",
                   cJSON_CreateString(date));
    }
}

static void offer_all(bst_frame_source *source, const bst_frame_place *frame, cJSON *offers) {
    static const char *const exposure[] = {"EXPTIME", "EXPOSURE", ""},
                             *const gain[] = {"EGAIN", "GAIN", ""},
                             *const noise[] = {"RDNOISE", "READNOIS", ""};
    char text[80];
    snprintf(text, sizeof text, "Sensor of %d x %d px", frame->width, frame->height);
    if (frame->width <= 16384 && frame->height <= 16384) {
        cJSON *size = add_offer(offers, "NAXIS1, NAXIS2", text, false);
        add_change(size, "camera/width_px", cJSON_CreateNumber(frame->width));
        add_change(size, "camera/height_px", cJSON_CreateNumber(frame->height));
    }
    offer_pointing(source, frame, offers);
    offer_number(source, exposure, "exposure/exposure_s", "Exposure time %.6g s",
                 (const double[]){1e-9, 3600.0}, offers);
    offer_number(source, gain, "camera/gain_e_per_dn", "Gain %.6g e-/DN",
                 (const double[]){1e-6, 1e6}, offers);
    offer_number(source, noise, "camera/read_noise_e", "Read noise %.6g e-",
                 (const double[]){0.0, 1e4}, offers);
    offer_epoch(source, offers);
}

static bst_status read_frame(bst_ctx *ctx, const char *name, const char *data, size_t bytes,
                             cJSON *out) {
    scratch_file file;
    bst_frame_source *source = NULL;
    bst_frame_place frame;
    BST_TRY(scratch_make(ctx, name, data, bytes, &file));
    bst_status status = bst_frame_source_open(ctx, file.path, NULL, &source);
    status = status == BST_OK ? bst_frame_source_select(ctx, source, 0, &frame) : status;
    if (status == BST_OK) {
        cJSON_AddStringToObject(out, "kind", "frame");
        offer_all(source, &frame, cJSON_AddArrayToObject(out, "offers"));
    }
    bst_frame_source_close(source);
    scratch_remove(&file);
    return name_file(ctx, status, &file);
}

/* ------------------------------------------------------------------ any file */

/* True for text that JSON can be, with more values than are read: each but the first one comes
 * after one of these characters. */
static bool has_many_values(const char *data, size_t bytes) {
    size_t start = 0, values = 0;
    while (start < bytes && strchr(" \t\r\n", data[start]) && data[start]) {
        start++;
    }
    if (start == bytes || (data[start] != '{' && data[start] != '[')) {
        return false;
    }
    for (size_t i = start; i < bytes; i++) {
        values += data[i] == ',' || data[i] == '[' || data[i] == '{';
    }
    return values > JSON_VALUES;
}

/* True for JSON with a key "asset" at its root, as glTF has. */
static bool is_gltf(const char *data, size_t bytes) {
    cJSON *root = cJSON_ParseWithLength(data, bytes);
    const bool found = cJSON_IsObject(cJSON_GetObjectItemCaseSensitive(root, "asset"));
    cJSON_Delete(root);
    return found;
}

static bst_status look(bst_ctx *ctx, const char *name, const char *data, size_t bytes, cJSON *out) {
    if (begins(data, bytes, "SIMPLE  =")) {
        return read_frame(ctx, name, data, bytes, out);
    }
    if (has_many_values(data, bytes)) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "%s: has more values than are read (allowed: %d)",
                        name, JSON_VALUES);
    }
    if (begins(data, bytes, "glTF") || has_extension(name, ".glb") ||
        has_extension(name, ".gltf") || is_gltf(data, bytes)) {
        return read_shape(ctx, name, data, bytes, out);
    }
    if (bytes == 0 || memchr(data, 0, bytes)) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "%s: %s (allowed: element sets as TLE or OMM in JSON or CSV, a shape as "
                        "glTF or GLB, a frame as FITS)",
                        name, bytes == 0 ? "is empty" : "is of no known kind");
    }
    return read_elements(ctx, name, data, bytes, out);
}

bst_status bst_view_editor_drop(bst_ctx *ctx, const char *name, const char *data, size_t bytes,
                                cJSON **out) {
    if (!*name || strlen(name) >= NAME_BYTES || strchr(name, '/') || name[0] == '.' ||
        name[0] == '-') {
        return bst_fail(
            ctx, BST_ERR_ARGUMENT,
            "\"%.100s\" is no name for a file (allowed: below %d characters, no folder, "
            "not \".\" or \"-\" at its beginning)",
            name, NAME_BYTES);
    }
    *out = cJSON_CreateObject();
    pthread_mutex_lock(&reading);
    bst_status status = look(ctx, name, data, bytes, *out);
    pthread_mutex_unlock(&reading);
    return status == BST_OK || status == BST_ERR_IO || status == BST_ERR_MEMORY ? status
                                                                                : BST_ERR_ARGUMENT;
}
