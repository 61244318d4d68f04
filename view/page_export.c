#include "view/page_export.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sim/cli/progress.h"
#include "sim/cli/stop_signals.h"
#include "sim/core/json_member.h"
#include "sim/core/sha256.h"
#include "sim/io/draft_file.h"
#include "sim/run/run_sensors.h"
#include "view/page_bundle.h"
#include "view/page_paths.h"
#include "view/routes.h"
#include "view/space.h"
#include "view/why.h"

/* Columns of a plot: it can be zoomed to so many extents of its lines. */
enum { COLUMNS = 2000 };
/* Time between two skies of the page's view of space, s (page/space.js). */
enum { SPACE_STEP_S = 60 };
/* Share of the limit that the skies may take before they are compressed. */
static const double SPACE_SHARE = 0.2;
/* Exposures whose reasons are asked for in one call: its queries have a limit of work. */
enum { WHY_CHUNK = 500 };
/* What the page shows of a frame. */
enum { FRAME, WHY, PIXELS, PARTS };

typedef struct kept_frame {
    int64_t row; /* of the run's list of frames */
    bst_view_bytes part[PARTS];
} kept_frame;

typedef struct kept_sensor {
    kept_frame *frames;
    size_t count, bytes; /* bytes: of their elements */
    int64_t every;       /* of the frames that were asked for, every N-th is kept */
    int64_t asked;       /* frames that were asked for */
    int64_t done;        /* of them, looked at so far */
    int binning;         /* pixels along a side of a bin */
    double *list;        /* as api/frames */
    size_t listed;
} kept_sensor;

typedef struct page_export {
    const bst_view_page_request *request;
    bst_view_subject *subject;
    FILE *out;
    int sensors;
    kept_sensor sensor[BST_EXPORT_SENSORS];
} page_export;

static void free_frame(kept_frame *frame) {
    for (int k = 0; k < PARTS; k++) {
        free(frame->part[k].data);
    }
}

static size_t size_of_frame(const kept_frame *frame) {
    size_t bytes = 0;
    for (int k = 0; k < PARTS; k++) {
        bytes += bst_view_bundle_size(&frame->part[k]);
    }
    return bytes;
}

/* Asks a route. The caller frees what is in x. */
static bst_status ask(bst_ctx *ctx, const page_export *e, const char *path, bst_view_exchange *x) {
    x->subject = e->subject;
    return bst_view_route_find(path)->get(ctx, x);
}

static bst_status pack_json(bst_ctx *ctx, const cJSON *json, bst_view_bytes *packed) {
    char *text = cJSON_PrintUnformatted(json);
    if (!text) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a page");
    }
    bst_view_bytes plain = {.data = text, .bytes = strlen(text)};
    bst_status status = bst_view_bundle_pack(ctx, &plain, packed);
    free(text);
    return status;
}

/* Asks a route and compresses its answer. */
static bst_status record(bst_ctx *ctx, const page_export *e, const char *path, bst_view_exchange *x,
                         bst_view_bytes *packed) {
    *packed = (bst_view_bytes){.data = NULL};
    bst_status status = ask(ctx, e, path, x);
    if (status == BST_OK && x->json) {
        status = pack_json(ctx, x->json, packed);
    } else if (status == BST_OK) {
        status = bst_view_bundle_pack(ctx, &x->bytes, packed);
    }
    cJSON_Delete(x->json);
    free(x->bytes.data);
    return status;
}

/* Writes what a route answers. */
static bst_status add(bst_ctx *ctx, const page_export *e, const char *path, const char *key,
                      bst_view_exchange x) {
    bst_view_bytes packed;
    BST_TRY(record(ctx, e, path, &x, &packed));
    bst_view_bundle_add(e->out, key, &packed);
    free(packed.data);
    return BST_OK;
}

/* ------------------------------------------------------------------ frames */

/* Leaves out every second frame. */
static void thin(kept_sensor *s) {
    size_t kept = 0;
    s->bytes = 0;
    for (size_t k = 0; k < s->count; k++) {
        if (k % 2 == 0) {
            s->bytes += size_of_frame(&s->frames[k]);
            s->frames[kept++] = s->frames[k];
        } else {
            free_frame(&s->frames[k]);
        }
    }
    s->count = kept;
    s->every *= 2;
}

/* Records the reason of a frame alone: spans of frames are written once. */
static bst_status record_reason(bst_ctx *ctx, const page_export *e, int number, int64_t row,
                                bst_view_bytes *packed) {
    bst_view_exchange x = {.subject = e->subject, .sensor = number, .frame = row};
    bst_status status = bst_view_why(ctx, &x, row, row);
    if (status == BST_OK) {
        cJSON_DeleteItemFromObjectCaseSensitive(x.json, "spans");
        status = pack_json(ctx, x.json, packed);
    }
    cJSON_Delete(x.json);
    return status;
}

static bst_status take_frame(bst_ctx *ctx, const page_export *e, int number, int64_t row,
                             kept_frame *frame) {
    const kept_sensor *s = &e->sensor[number];
    bst_view_exchange x = {.sensor = number, .frame = row}, of_pixels = x;
    *frame = (kept_frame){.row = row};
    bst_status status = record(ctx, e, "api/frame", &x, &frame->part[FRAME]);
    if (status == BST_OK) {
        status = record_reason(ctx, e, number, row, &frame->part[WHY]);
    }
    if (status == BST_OK && s->list[row * BST_VIEW_FRAME_NUMBERS + 3] >= 0) {
        of_pixels.part.binning = s->binning;
        status = record(ctx, e, "api/pixels", &of_pixels, &frame->part[PIXELS]);
    }
    if (status != BST_OK) {
        free_frame(frame);
    }
    return status;
}

static bool is_asked(const bst_view_page_request *r, int64_t exposure) {
    return exposure >= r->first && exposure <= r->last && (exposure - r->first) % r->every == 0;
}

static bst_status take_frames(bst_ctx *ctx, page_export *e, int number, size_t limit,
                              bst_progress *progress) {
    kept_sensor *s = &e->sensor[number];
    for (size_t row = 0; row < s->listed; row++) {
        if (!is_asked(e->request, (int64_t)s->list[row * BST_VIEW_FRAME_NUMBERS])) {
            continue;
        }
        bst_progress_update(progress, s->done);
        if (s->done++ % s->every != 0) {
            continue;
        }
        if (bst_stop_requested()) {
            return bst_fail(ctx, BST_ERR_INTERRUPTED, "interrupted");
        }
        BST_TRY(take_frame(ctx, e, number, (int64_t)row, &s->frames[s->count]));
        s->bytes += size_of_frame(&s->frames[s->count++]);
        while (s->bytes > limit && s->count > 1) {
            thin(s);
        }
        if (s->bytes > limit) {
            return bst_fail(
                ctx, BST_ERR_RANGE,
                "%s: a frame takes %.1f MB of the page (allowed with this --page-limit: "
                "%.1f MB): raise --page-limit or lower --size",
                e->request->file, (double)s->bytes * 1e-6, (double)limit * 1e-6);
        }
    }
    return BST_OK;
}

/* Reads the list of frames and chooses the binning. */
static bst_status open_sensor(bst_ctx *ctx, page_export *e, int number, const cJSON *described) {
    kept_sensor *s = &e->sensor[number];
    bst_view_exchange x = {.sensor = number};
    const double longest = fmax(bst_json_member(described, "width_px")->valuedouble,
                                bst_json_member(described, "height_px")->valuedouble);
    const double most =
        e->request->longest_side > 0 ? (double)e->request->longest_side : BST_VIEW_PAGE_SIDE_PX;
    s->binning = (int)fmin(BST_VIEW_BINNING_MOST, fmax(1.0, ceil(longest / most)));
    BST_TRY(ask(ctx, e, "api/frames", &x));
    s->list = x.bytes.data;
    s->listed = x.bytes.bytes / (BST_VIEW_FRAME_NUMBERS * sizeof(double));
    s->every = 1;
    for (size_t row = 0; row < s->listed; row++) {
        s->asked += is_asked(e->request, (int64_t)s->list[row * BST_VIEW_FRAME_NUMBERS]);
    }
    s->frames = calloc(s->listed + 1, sizeof *s->frames);
    return s->frames ? BST_OK : bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a page");
}

/* Writes the frames of a sensor, and their list. */
static bst_status write_frames(bst_ctx *ctx, const page_export *e, int number) {
    const kept_sensor *s = &e->sensor[number];
    static const char *const names[] = {"frame", "why", "pixels"};
    char key[80];
    bst_view_bytes packed, list = {.bytes = s->count * BST_VIEW_FRAME_NUMBERS * sizeof(double)};
    double *row = list.data = malloc(list.bytes + 1);
    if (!row) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a page");
    }
    for (size_t i = 0; i < s->count; i++, row += BST_VIEW_FRAME_NUMBERS) {
        const kept_frame *frame = &s->frames[i];
        memcpy(row, &s->list[frame->row * BST_VIEW_FRAME_NUMBERS],
               BST_VIEW_FRAME_NUMBERS * sizeof(double));
        for (int k = 0; k < PARTS; k++) {
            if (frame->part[k].data) {
                snprintf(key, sizeof key, "%s?frame=%zu&sensor=%d", names[k], i, number);
                bst_view_bundle_add(e->out, key, &frame->part[k]);
            }
        }
    }
    bst_status status = bst_view_bundle_pack(ctx, &list, &packed);
    free(list.data);
    BST_TRY(status);
    snprintf(key, sizeof key, "frames?sensor=%d", number);
    bst_view_bundle_add(e->out, key, &packed);
    free(packed.data);
    return BST_OK;
}

/* ------------------------------------------------------------------ the rest of the run */

static double last_time(const kept_sensor *s) {
    return s->listed > 0 ? s->list[(s->listed - 1) * BST_VIEW_FRAME_NUMBERS + 1] : 1.0;
}

/* Moves the spans of a chunk of exposures behind those before it; the first one may continue the
 * last. */
static void join_spans(cJSON *spans, cJSON *chunk) {
    cJSON *next;
    while ((next = cJSON_DetachItemFromArray(chunk, 0))) {
        cJSON *last = cJSON_GetArrayItem(spans, cJSON_GetArraySize(spans) - 1);
        if (last && strcmp(bst_json_member_text(last, "kind", ""),
                           bst_json_member_text(next, "kind", "")) == 0) {
            cJSON_SetNumberValue(cJSON_GetObjectItemCaseSensitive(last, "last"),
                                 bst_json_member(next, "last")->valuedouble);
            cJSON_Delete(next);
        } else {
            cJSON_AddItemToArray(spans, next);
        }
    }
}

/* Collects the spans of frames with the same reason, of all exposures of a sensor. */
static bst_status collect_spans(bst_ctx *ctx, const page_export *e, int number, cJSON *spans) {
    const int64_t listed = (int64_t)e->sensor[number].listed;
    for (int64_t row = 0; row < listed; row += WHY_CHUNK) {
        bst_view_exchange x = {.subject = e->subject, .sensor = number, .frame = row};
        bst_status status = bst_stop_requested() ? bst_fail(ctx, BST_ERR_INTERRUPTED, "interrupted")
                                                 : bst_view_why(ctx, &x, row, row + WHY_CHUNK - 1);
        if (status == BST_OK) {
            join_spans(spans, cJSON_GetObjectItemCaseSensitive(x.json, "spans"));
        }
        cJSON_Delete(x.json);
        BST_TRY(status);
    }
    return BST_OK;
}

/* Writes them: {"around": N, "spans": [...]}; the page shows those of N exposures before and after
 * its frame. */
static bst_status write_spans(bst_ctx *ctx, const page_export *e, int number) {
    char key[40];
    bst_view_bytes packed = {.data = NULL};
    cJSON *out = cJSON_CreateObject();
    cJSON_AddNumberToObject(out, "around", BST_VIEW_WHY_AROUND);
    bst_status status = collect_spans(ctx, e, number, cJSON_AddArrayToObject(out, "spans"));
    status = status == BST_OK ? pack_json(ctx, out, &packed) : status;
    cJSON_Delete(out);
    if (status == BST_OK) {
        snprintf(key, sizeof key, "spans?sensor=%d", number);
        bst_view_bundle_add(e->out, key, &packed);
        free(packed.data);
    }
    return status;
}

static bst_status write_sensor(bst_ctx *ctx, const page_export *e, int number,
                               const cJSON *described) {
    char key[120];
    BST_TRY(write_spans(ctx, e, number));
    snprintf(key, sizeof key, "modes?sensor=%d", number);
    BST_TRY(add(ctx, e, "api/modes", key, (bst_view_exchange){.sensor = number}));
    const cJSON *panel;
    cJSON_ArrayForEach(panel, bst_json_member(described, "panels")) {
        /* one column more than shown at the end, so that the last sample is inside */
        bst_view_exchange x = {.sensor = number,
                               .to_s = last_time(&e->sensor[number]) * (1.0 + 1e-9) + 1.0,
                               .columns = COLUMNS};
        const char *name = cJSON_GetStringValue(bst_json_member(panel, "name"));
        snprintf(x.panel, sizeof x.panel, "%s", name ? name : "");
        snprintf(key, sizeof key, "plot?panel=%s&sensor=%d", x.panel, number);
        BST_TRY(add(ctx, e, "api/plot", key, x));
    }
    return BST_OK;
}

/* Writes the skies, if the run has a scenario and they are not too many; *written: they are. */
static bst_status write_space(bst_ctx *ctx, const page_export *e, bool *written) {
    bst_ctx none = {0};
    bst_view_exchange x = {.sensor = 0};
    char key[80];
    *written = false;
    if (ask(&none, e, "api/space/scene", &x) != BST_OK) {
        cJSON_Delete(x.json);
        return BST_OK; /* a folder without scenario.json has no view of space */
    }
    const double bodies = cJSON_GetArraySize(bst_json_member(x.json, "observers")) +
                          cJSON_GetArraySize(bst_json_member(x.json, "objects"));
    const double steps = floor(bst_json_member(x.json, "span_s")->valuedouble / SPACE_STEP_S) + 2.0;
    cJSON_Delete(x.json);
    if ((BST_VIEW_SPACE_HEAD + BST_VIEW_SPACE_BODY * bodies) * sizeof(double) * steps >
        SPACE_SHARE * e->request->limit_bytes) {
        return BST_OK;
    }
    for (int64_t k = 0; k < (int64_t)steps; k++) {
        snprintf(key, sizeof key, "space/states?from=%lld", (long long)(k * SPACE_STEP_S));
        bst_view_exchange sky = {.from_s = (double)(k * SPACE_STEP_S)};
        BST_TRY(add(ctx, e, "api/space/states", key, sky));
    }
    for (int i = 0; i < e->sensors; i++) {
        snprintf(key, sizeof key, "space/poses?sensor=%d", i);
        BST_TRY(add(ctx, e, "api/space/poses", key, (bst_view_exchange){.sensor = i}));
    }
    BST_TRY(add(ctx, e, "api/space/coast", "space/coast", (bst_view_exchange){.sensor = 0}));
    *written = true;
    return add(ctx, e, "api/space/scene", "space/scene", (bst_view_exchange){.sensor = 0});
}

/* Adds what the page must know about what it holds: {"space": true, "sensors": [{"rows": [...],
 * "total": N, "every": N, "binning": N}]}. rows: of the run's list of frames. */
static void add_about(const page_export *e, bool space, cJSON *session) {
    cJSON *about = cJSON_AddObjectToObject(session, "exported");
    cJSON_AddBoolToObject(about, "space", space);
    cJSON *sensors = cJSON_AddArrayToObject(about, "sensors");
    for (int i = 0; i < e->sensors; i++) {
        const kept_sensor *s = &e->sensor[i];
        cJSON *node = cJSON_CreateObject();
        cJSON *rows = cJSON_AddArrayToObject(node, "rows");
        for (size_t k = 0; k < s->count; k++) {
            cJSON_AddItemToArray(rows, cJSON_CreateNumber((double)s->frames[k].row));
        }
        cJSON_AddNumberToObject(node, "total", (double)s->listed);
        cJSON_AddNumberToObject(node, "every", (double)(s->every * e->request->every));
        cJSON_AddNumberToObject(node, "binning", s->binning);
        cJSON_AddItemToArray(sensors, node);
    }
}

static bst_status write_session(bst_ctx *ctx, const page_export *e, bool space, cJSON *session) {
    bst_view_bytes packed;
    add_about(e, space, session);
    BST_TRY(pack_json(ctx, session, &packed));
    bst_view_bundle_add(e->out, "session", &packed);
    free(packed.data);
    return BST_OK;
}

/* Refuses a range without a frame, if the run has some. */
static bst_status check_range(bst_ctx *ctx, const page_export *e) {
    const bst_view_page_request *r = e->request;
    double first = INFINITY, last = -INFINITY;
    int64_t asked = 0;
    for (int i = 0; i < e->sensors; i++) {
        const kept_sensor *s = &e->sensor[i];
        asked += s->asked;
        if (s->listed > 0) {
            first = fmin(first, s->list[0]);
            last = fmax(last, s->list[(s->listed - 1) * BST_VIEW_FRAME_NUMBERS]);
        }
    }
    if (asked > 0 || !(last >= first)) {
        return BST_OK;
    }
    char end[40] = "the end";
    if (r->last <= INT64_C(9000000000000000)) { /* else it is the default */
        snprintf(end, sizeof end, "--last %lld", (long long)r->last);
    }
    return bst_fail(
        ctx, BST_ERR_RANGE,
        "%s: there is no frame from --first %lld to %s with --every %lld: exposures have "
        "the numbers %.0f to %.0f",
        r->run, (long long)r->first, end, (long long)r->every, first, last);
}

/* Writes the frames of all sensors into what is left of the limit. */
static bst_status write_all_frames(bst_ctx *ctx, page_export *e) {
    const double limit = e->request->limit_bytes, used = (double)ftell(e->out);
    if (used >= limit) {
        return bst_fail(ctx, BST_ERR_RANGE,
                        "%s: page, plots and events take %.1f MB without a frame (allowed by "
                        "--page-limit: %.1f MB): raise --page-limit",
                        e->request->file, used * 1e-6, limit * 1e-6);
    }
    for (int i = 0; i < e->sensors; i++) {
        /* the rest of the share: their list, rows and the end */
        const double share = 0.95 * (limit - (double)ftell(e->out)) / (e->sensors - i);
        bst_progress progress;
        bst_progress_start(&progress, e->request->file, "frames", e->sensor[i].asked);
        progress.off = !progress.terminal;
        bst_status status = take_frames(ctx, e, i, share > 1.0 ? (size_t)share : 1, &progress);
        bst_progress_end(&progress);
        BST_TRY(status);
        BST_TRY(write_frames(ctx, e, i));
    }
    return BST_OK;
}

/* The same for the same run: a file that is written again has the same bytes. */
static bst_status make_nonce(bst_ctx *ctx, const cJSON *session, char nonce[BST_SHA256_TEXT]) {
    char *text = cJSON_PrintUnformatted(session);
    if (!text) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a page");
    }
    bst_sha256_text(text, strlen(text), nonce);
    free(text);
    return BST_OK;
}

/* Writes the whole page. */
static bst_status write_page(bst_ctx *ctx, page_export *e, cJSON *session) {
    const cJSON *described;
    char nonce[BST_SHA256_TEXT];
    bool space;
    cJSON *run = cJSON_GetObjectItemCaseSensitive(session, "run");
    bst_view_cut_path(cJSON_GetObjectItemCaseSensitive(run, "problems"), e->request->run);
    bst_view_cut_path(cJSON_GetObjectItemCaseSensitive(run, "manifest"), e->request->run);
    const cJSON *sensors = bst_json_member(run, "sensors");
    BST_TRY(make_nonce(ctx, session, nonce));
    BST_TRY(bst_view_bundle_begin(ctx, e->out, nonce));
    cJSON_ArrayForEach(described, sensors) {
        BST_TRY(open_sensor(ctx, e, e->sensors++, described));
    }
    BST_TRY(check_range(ctx, e));
    int number = 0;
    cJSON_ArrayForEach(described, sensors) {
        BST_TRY(write_sensor(ctx, e, number++, described));
    }
    BST_TRY(add(ctx, e, "api/events", "events", (bst_view_exchange){.sensor = 0}));
    BST_TRY(write_space(ctx, e, &space));
    BST_TRY(write_all_frames(ctx, e));
    BST_TRY(write_session(ctx, e, space, session));
    bst_view_bundle_end(e->out, nonce);
    const double bytes = (double)ftell(e->out);
    return bytes <= e->request->limit_bytes
               ? BST_OK
               : bst_fail(ctx, BST_ERR_RANGE,
                          "%s: the page takes %.1f MB (allowed by --page-limit: %.1f MB): raise "
                          "--page-limit or lower --size",
                          e->request->file, bytes * 1e-6, e->request->limit_bytes * 1e-6);
}

/* Says what the file holds. */
static void announce(const page_export *e, double bytes) {
    printf("%s: %.1f MB\n", e->request->file, bytes * 1e-6);
    for (int i = 0; i < e->sensors; i++) {
        const kept_sensor *s = &e->sensor[i];
        printf("  sensor %d: %zu of %zu frames", i, s->count, s->listed);
        if (s->every > 1) {
            printf(" (every %lld%s of the frames asked for, for the limit of %.1f MB)",
                   (long long)s->every, s->every % 10 == 2 && s->every % 100 != 12 ? "nd" : "th",
                   e->request->limit_bytes * 1e-6);
        }
        printf(s->binning > 1 ? ", %d x %d pixels binned into one\n" : "\n", s->binning,
               s->binning);
    }
}

static bst_status export_to(bst_ctx *ctx, page_export *e) {
    int64_t number;
    bst_draft draft;
    bst_view_exchange x = {.sensor = 0};
    BST_TRY(bst_view_subject_open(ctx, e->subject, e->request->run, &number));
    bst_status status = ask(ctx, e, "api/session", &x);
    status = status == BST_OK ? bst_draft_open(ctx, e->request->file, &draft) : status;
    if (status == BST_OK) {
        e->out = draft.stream;
        status = write_page(ctx, e, x.json);
        const double bytes = (double)ftell(e->out);
        status = bst_draft_close(ctx, &draft, status);
        if (status == BST_OK) {
            announce(e, bytes);
        }
    }
    cJSON_Delete(x.json);
    return status;
}

bst_status bst_view_page_export(bst_ctx *ctx, const bst_view_page_request *request) {
    page_export *e = calloc(1, sizeof *e);
    if (!e) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a page");
    }
    e->request = request;
    bst_status status = bst_view_subject_create(ctx, &e->subject);
    status = status == BST_OK ? export_to(ctx, e) : status;
    for (int i = 0; i < e->sensors; i++) {
        for (size_t k = 0; k < e->sensor[i].count; k++) {
            free_frame(&e->sensor[i].frames[k]);
        }
        free(e->sensor[i].frames);
        free(e->sensor[i].list);
    }
    bst_view_subject_free(e->subject);
    free(e);
    return status;
}
