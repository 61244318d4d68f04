#include "sim/export/frame_marks.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cjson/cJSON.h>

#include "sim/eval/loop_figures.h"

/* Rows of a table, ordered by their first column. */
typedef struct cursor {
    bst_io_rows *rows; /* NULL: no such table, or all rows read */
    bool held;         /* the current row has not been used yet */
} cursor;

enum { FRAMES, EXPOSURES, OBJECTS, DETECTIONS, TRACKS, MODES, ATTITUDES, CURSORS };
/* PATH: places along a streak that are kept. */
enum { PATH = 128, LEAST_PATH = 8 };

/* Streaks longer than this are drawn as lines, px of the sensor. */
static const double LEAST_STREAK_PX = 16.0;
/* Streaks whose length agrees with that of the stars' path to this share are drawn along it. */
static const double AGREE_SHARE = 0.25;

/* The first column is the key of the cursor; ?1: the sensor. Rows are in the order of exposures. */
static const char *const queries[CURSORS] = {
    [FRAMES] =
        "SELECT exposure_id, x0_px, y0_px, binning, utc(start_s + exposure_s / 2),"
        " exposure_s, (start_tick + end_tick) / 2, start_tick, end_tick FROM frames"
        " WHERE sensor = ?1",
    [EXPOSURES] =
        "SELECT exposure_id, boresight_x_px, boresight_y_px, pixel_scale_arcsec FROM exposures"
        " WHERE sensor = ?1",
    [OBJECTS] =
        "SELECT exposure_id, id, norad, x_centroid_px, y_centroid_px FROM truth"
        " WHERE sensor = ?1 AND kind = 'object' AND in_field = 1",
    [DETECTIONS] =
        "SELECT exposure_id, label, x_px, y_px, length_px, star_id, flux_e, angle_deg"
        " FROM detections WHERE sensor = ?1",
    [TRACKS] =
        "SELECT exposure_id, track_id, status, target_of_interest, x_px, y_px, snr"
        " FROM tracks WHERE sensor = ?1 AND misses_in_row = 0",
    [MODES] = "SELECT tick, mode FROM control WHERE sensor = ?1",
    [ATTITUDES] =
        "SELECT tick, q_cam_from_gcrf_x, q_cam_from_gcrf_y, q_cam_from_gcrf_z,"
        " q_cam_from_gcrf_w FROM los_truth WHERE sensor = ?1",
};

struct bst_frame_marks {
    const cJSON *objects; /* of the scenario; NULL when there is none */
    char target[80];
    cursor cursors[CURSORS], planes;
    bst_io_overlay_mark *marks;
    int count, room;
    bool has_target; /* its true position on the frame */
    double target_x_px, target_y_px;
    char mode[32], caption[200];
    double x0, y0, binning; /* of the frame */
    /* of the frame's exposure: attitudes, and the places of a star's image, px of the frame */
    bst_quat attitudes[PATH];
    double path_px[PATH][2], path_length_px;
    int path_count;
};

bst_status bst_frame_marks_create(bst_ctx *ctx, const bst_run_reader *run, int64_t sensor,
                                  const char *target, bst_frame_marks **out) {
    bst_frame_marks *m = calloc(1, sizeof *m);
    *out = m;
    if (!m) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the marks");
    }
    snprintf(m->target, sizeof m->target, "%s", target);
    const cJSON *world = cJSON_GetObjectItemCaseSensitive(bst_run_reader_scenario(run), "world");
    m->objects = cJSON_GetObjectItemCaseSensitive(world, "objects");
    bst_ctx unheard = {0};
    for (int i = 0; i < CURSORS; i++) {
        if (bst_io_rows_open(&unheard, run, queries[i], sensor, 0, &m->cursors[i].rows) != BST_OK) {
            m->cursors[i].rows = NULL; /* not recorded */
        }
    }
    if (bst_io_rows_open(&unheard, run,
                         "SELECT fits_index, exposure_id FROM frames WHERE sensor = ?1"
                         " AND fits_index IS NOT NULL",
                         sensor, 0, &m->planes.rows) != BST_OK) {
        m->planes.rows = NULL;
    }
    return BST_OK;
}

void bst_frame_marks_free(bst_frame_marks *m) {
    if (m) {
        for (int i = 0; i < CURSORS; i++) {
            bst_io_rows_close(m->cursors[i].rows);
        }
        bst_io_rows_close(m->planes.rows);
        free(m->marks);
        free(m);
    }
}

/* Advances to the next row whose key is `low` to `high`; *found false: none (yet). */
static bst_status advance(bst_ctx *ctx, cursor *c, int64_t low, int64_t high, bool *found) {
    *found = false;
    while (c->rows) {
        if (!c->held) {
            bool more;
            BST_TRY(bst_io_rows_next(ctx, c->rows, &more));
            if (!more) {
                bst_io_rows_close(c->rows);
                c->rows = NULL;
                break;
            }
        }
        int64_t key = bst_io_rows_int(c->rows, 0);
        c->held = key > high;
        if (c->held || key >= low) {
            *found = !c->held;
            break;
        }
    }
    return BST_OK;
}

bst_status bst_frame_marks_exposure(bst_ctx *ctx, bst_frame_marks *m, int64_t fits_index,
                                    int64_t *exposure_id) {
    bool found;
    BST_TRY(advance(ctx, &m->planes, fits_index, fits_index, &found));
    *exposure_id = found ? bst_io_rows_int(m->planes.rows, 1) : -1;
    return BST_OK;
}

/* Adds a mark at a sensor position. */
static bst_status add(bst_ctx *ctx, bst_frame_marks *m, bst_io_overlay_kind kind, double importance,
                      double x_px, double y_px) {
    if (m->count == m->room) {
        int room = 2 * m->room + 256;
        bst_io_overlay_mark *more = realloc(m->marks, (size_t)room * sizeof *more);
        if (!more) {
            return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the marks");
        }
        m->marks = more;
        m->room = room;
    }
    double middle =
        0.5 *
        (m->binning -
         1.0); /* centre of a binned pixel, relative to the centre of its first sensor pixel */
    m->marks[m->count++] = (bst_io_overlay_mark){.kind = kind,
                                                 .x_px = (x_px - m->x0 - middle) / m->binning,
                                                 .y_px = (y_px - m->y0 - middle) / m->binning,
                                                 .importance = importance};
    return BST_OK;
}

static bst_status add_object(bst_ctx *ctx, bst_frame_marks *m, const bst_io_rows *rows) {
    const cJSON *object =
        m->objects ? cJSON_GetArrayItem(m->objects, (int)bst_io_rows_int(rows, 1)) : NULL;
    const cJSON *name = cJSON_GetObjectItemCaseSensitive(object, "name");
    char text[48];
    if (cJSON_IsString(name)) {
        snprintf(text, sizeof text, "%s", name->valuestring);
    } else {
        snprintf(text, sizeof text, "NORAD %" PRId64, bst_io_rows_int(rows, 2));
    }
    bool target = m->target[0] && strcmp(text, m->target) == 0;
    BST_TRY(add(ctx, m, target ? BST_OVERLAY_TARGET : BST_OVERLAY_OBJECT,
                target ? BST_OVERLAY_FIRST : BST_OVERLAY_OF_OBJECT, bst_io_rows_real(rows, 3),
                bst_io_rows_real(rows, 4)));
    bst_io_overlay_mark *mark = &m->marks[m->count - 1];
    memcpy(mark->label, text, sizeof mark->label);
    if (target) {
        m->has_target = true;
        m->target_x_px = mark->x_px;
        m->target_y_px = mark->y_px;
    }
    return BST_OK;
}

static bst_status add_detection(bst_ctx *ctx, bst_frame_marks *m, const bst_io_rows *rows) {
    bool star = strcmp(bst_io_rows_text(rows, 1), "star") == 0;
    double flux_e = bst_io_rows_real(rows, 6);
    BST_TRY(add(ctx, m,
                !star                           ? BST_OVERLAY_DETECTION
                : bst_io_rows_int(rows, 5) != 0 ? BST_OVERLAY_STAR
                                                : BST_OVERLAY_REST,
                isfinite(flux_e) ? flux_e : 0.0, bst_io_rows_real(rows, 2),
                bst_io_rows_real(rows, 3)));
    bst_io_overlay_mark *mark = &m->marks[m->count - 1];
    double length = bst_io_rows_real(rows, 4) / m->binning;
    mark->radius_px = 0.5 * length + 2.0;
    if (length * m->binning > LEAST_STREAK_PX) {
        double angle = bst_io_rows_real(rows, 7) * BST_DEG_RAD;
        mark->half_x_px = 0.5 * length * cos(angle);
        mark->half_y_px = 0.5 * length * sin(angle);
        mark->on_path = m->path_count >= LEAST_PATH &&
                        fabs(length - m->path_length_px) < AGREE_SHARE * m->path_length_px;
    }
    if (m->has_target && hypot(mark->x_px - m->target_x_px, mark->y_px - m->target_y_px) <=
                             BST_RIGHT_TARGET_PX / m->binning) {
        mark->importance = BST_OVERLAY_OF_TARGET;
    }
    return BST_OK;
}

static bst_status add_track(bst_ctx *ctx, bst_frame_marks *m, const bst_io_rows *rows) {
    BST_TRY(add(ctx, m, BST_OVERLAY_TRACK,
                bst_io_rows_int(rows, 3) ? BST_OVERLAY_FIRST : BST_OVERLAY_OF_OBJECT,
                bst_io_rows_real(rows, 4), bst_io_rows_real(rows, 5)));
    bst_io_overlay_mark *mark = &m->marks[m->count - 1];
    snprintf(mark->label, sizeof mark->label, "%s%" PRId64 " SNR %.1f",
             bst_io_rows_int(rows, 3) ? "target: track " : "track ", bst_io_rows_int(rows, 1),
             bst_io_rows_real(rows, 6));
    return BST_OK;
}

static int by_importance(const void *a, const void *b) {
    const bst_io_overlay_mark *p = a, *q = b;
    return (p->importance < q->importance) - (p->importance > q->importance);
}

/* Makes the path of a star's image from the attitudes of the exposure, in px of the frame relative
 * to its mean place. */
static void make_path(bst_frame_marks *m, double pixel_scale_arcsec) {
    double mean[2] = {0.0, 0.0}, scale = pixel_scale_arcsec * BST_ARCSEC_RAD * m->binning;
    for (int k = 0; k < m->path_count; k++) {
        bst_quat turn = bst_quat_mul(m->attitudes[k], bst_quat_conj(m->attitudes[0]));
        bst_vec3 v = bst_quat_rotate(turn, (bst_vec3){0, 0, 1});
        m->path_px[k][0] = v.x / v.z / scale;
        m->path_px[k][1] = v.y / v.z / scale;
        mean[0] += m->path_px[k][0] / m->path_count;
        mean[1] += m->path_px[k][1] / m->path_count;
    }
    m->path_length_px = 0.0;
    for (int k = 0; k < m->path_count; k++) {
        m->path_px[k][0] -= mean[0];
        m->path_px[k][1] -= mean[1];
        m->path_length_px += k == 0 ? 0.0
                                    : hypot(m->path_px[k][0] - m->path_px[k - 1][0],
                                            m->path_px[k][1] - m->path_px[k - 1][1]);
    }
}

/* Reads the attitudes of an exposure; of too many every second one is kept. */
static bst_status get_attitudes(bst_ctx *ctx, bst_frame_marks *m, int64_t start, int64_t end) {
    cursor *c = &m->cursors[ATTITUDES];
    int64_t every = 1, seen = 0;
    m->path_count = 0;
    for (bool found;; seen++) {
        BST_TRY(advance(ctx, c, start, end, &found));
        if (!found) {
            return BST_OK;
        }
        if (seen % every != 0) {
            continue;
        }
        if (m->path_count == PATH) {
            for (int k = 0; k < PATH / 2; k++) {
                m->attitudes[k] = m->attitudes[2 * k];
            }
            m->path_count = PATH / 2;
            every *= 2;
        }
        m->attitudes[m->path_count++] =
            (bst_quat){bst_io_rows_real(c->rows, 1), bst_io_rows_real(c->rows, 2),
                       bst_io_rows_real(c->rows, 3), bst_io_rows_real(c->rows, 4)};
    }
}

static bst_status get_frame(bst_ctx *ctx, bst_frame_marks *m, int64_t id) {
    cursor *c = &m->cursors[FRAMES];
    bool found;
    m->x0 = m->y0 = 0.0;
    m->binning = 1.0;
    m->path_count = 0;
    snprintf(m->caption, sizeof m->caption, "frame %" PRId64, id);
    BST_TRY(advance(ctx, c, id, id, &found));
    if (!found) {
        return BST_OK;
    }
    m->x0 = (double)bst_io_rows_int(c->rows, 1);
    m->y0 = (double)bst_io_rows_int(c->rows, 2);
    m->binning = fmax(1.0, (double)bst_io_rows_int(c->rows, 3));
    char utc[32];
    snprintf(utc, sizeof utc, "%.23sZ", bst_io_rows_text(c->rows, 4)); /* to the millisecond */
    double exposure_s = bst_io_rows_real(c->rows, 5);
    int64_t tick = bst_io_rows_int(c->rows, 6);
    BST_TRY(get_attitudes(ctx, m, bst_io_rows_int(c->rows, 7), bst_io_rows_int(c->rows, 8)));
    for (cursor *modes = &m->cursors[MODES];;) {
        BST_TRY(advance(ctx, modes, INT64_MIN, tick, &found));
        if (!found) {
            break;
        }
        snprintf(m->mode, sizeof m->mode, "%s", bst_io_rows_text(modes->rows, 1));
    }
    snprintf(m->caption, sizeof m->caption, "frame %" PRId64 "   %s   %.3f s%s%s", id, utc,
             exposure_s, m->mode[0] ? "   mode: " : "", m->mode);
    return BST_OK;
}

bst_status bst_frame_marks_get(bst_ctx *ctx, bst_frame_marks *m, int64_t id, bst_io_overlay *out) {
    bool found;
    m->count = 0;
    m->has_target = false;
    BST_TRY(get_frame(ctx, m, id));
    for (int i = EXPOSURES; i <= TRACKS; i++) {
        for (;;) {
            BST_TRY(advance(ctx, &m->cursors[i], id, id, &found));
            if (!found) {
                break;
            }
            const bst_io_rows *rows = m->cursors[i].rows;
            if (i == EXPOSURES) {
                make_path(m, bst_io_rows_real(rows, 3));
                BST_TRY(add(ctx, m, BST_OVERLAY_BORESIGHT, BST_OVERLAY_FIRST,
                            bst_io_rows_real(rows, 1), bst_io_rows_real(rows, 2)));
            } else {
                BST_TRY((i == OBJECTS      ? add_object
                         : i == DETECTIONS ? add_detection
                                           : add_track)(ctx, m, rows));
            }
        }
    }
    if (m->count > 0) {
        qsort(m->marks, (size_t)m->count, sizeof *m->marks, by_importance);
    }
    *out = (bst_io_overlay){.marks = m->marks,
                            .count = m->count,
                            .caption = m->caption,
                            .path_px = (const double(*)[2])m->path_px,
                            .path_count = m->path_count};
    return BST_OK;
}
