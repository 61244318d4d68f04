#include "scenegen/smear/rolling_shutter.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>

#include "sim/world/scene/los_track.h"
#include "sim/world/scene/row_exposure.h"
#include "sim/world/scene/skylight.h"

/* Number of times at which a moving source is sampled. */
enum { INSTANTS = 65 };

/* Rows of the window that a source lights; first > last: none. */
typedef struct source_rows {
    double first, last;
} source_rows;

struct bst_rolling {
    bst_camera camera;
    double tolerance, sigma_px, share, reach_px, steepest;
    const bst_render_request *request;
    bst_row_times times;
    bst_los_track_store store; /* track of the band */
    bst_los_track track;
    source_rows *rows;            /* [count] of the request */
    bst_scene_source *sources;    /* of the band */
    bst_scene_source_part *parts; /* of the band's moving sources */
    int *number;                  /* index in the request of the band's sources */
    int source_capacity, part_capacity;
    double *slope; /* per row: error of the worst source in sigma per second of row delay */
    int row_capacity, next;
    double moved_px, speed_pxps, margin_px, error_sigma;
};

bst_status bst_rolling_create(bst_ctx *ctx, const bst_camera *camera, double tolerance_sigma,
                              double peak_sigma_px, bool gaussian, bst_rolling **out) {
    assert(camera && out && tolerance_sigma > 0.0 && peak_sigma_px > 0.0);
    bst_rolling *r = calloc(1, sizeof *r);
    *out = r;
    if (!r) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for a rolling shutter");
    }
    r->camera = *camera;
    r->tolerance = tolerance_sigma;
    r->sigma_px = peak_sigma_px;
    /* distance beyond which wings are negligible; largest slope times peak_sigma_px over the peak
     */
    r->reach_px = gaussian ? 5.0 * peak_sigma_px + 2.0 : 20.0;
    r->steepest = gaussian ? exp(-0.5) : 1.0;
    double side = erf(0.5 / (sqrt(2.0) * peak_sigma_px));
    r->share = side * side;
    return BST_OK;
}

void bst_rolling_free(bst_rolling *r) {
    if (r) {
        bst_los_track_store_free(&r->store);
        free(r->rows);
        free(r->sources);
        free(r->parts);
        free(r->number);
        free(r->slope);
        free(r);
    }
}

static double duration_of(const bst_render_request *q) {
    return q->track->time_s[q->track->count - 1];
}

/* Largest image motion within a row's exposure, and largest rate. */
static void measure_motion(bst_rolling *r) {
    const bst_los_track *track = r->request->track;
    double spare = duration_of(r->request) - r->times.exposure_s, exposure = r->times.exposure_s;
    r->moved_px = r->speed_pxps = 0.0;
    for (int k = 0; k < track->count; k++) {
        /* the path is longest if its start or end is at a bend of the track */
        for (int end = 0; end < 2; end++) {
            double start = fmin(fmax(track->time_s[k] - (end ? exposure : 0.0), 0.0), spare);
            r->moved_px = fmax(r->moved_px, bst_los_track_moved_px(
                                                &r->camera, bst_los_track_attitude(track, start),
                                                bst_los_track_attitude(track, start + exposure)));
        }
        double step = k > 0 ? track->time_s[k] - track->time_s[k - 1] : 0.0;
        if (step > 0.0) {
            double way = bst_los_track_moved_px(&r->camera, track->q_cam_from_gcrf[k - 1],
                                                track->q_cam_from_gcrf[k]);
            r->speed_pxps = fmax(r->speed_pxps, way / step);
        }
    }
}

/* Rows that a source lights during the track, and its largest motion during one row exposure. */
static source_rows rows_of(const bst_rolling *r, const bst_scene_source *source, double reach_px,
                           double *moved_px) {
    const bst_los_track *track = r->request->track;
    double duration = duration_of(r->request), x, y;
    const source_rows all = {-INFINITY, INFINITY};
    *moved_px = r->moved_px;
    if (!source->path) {
        bst_quat q = bst_los_track_attitude(track, 0.5 * duration);
        bst_vec3 v = bst_quat_rotate(q, source->apparent_mid);
        v = bst_scene_source_seen(&r->camera, source, v);
        double larger = source->ghost ? bst_ghost_magnification(source->ghost) : 1.0;
        reach_px *= larger;
        *moved_px *= larger;
        bool front = bst_camera_project(&r->camera, v, &x, &y);
        return front && reach_px < 1e5 ? (source_rows){y - reach_px, y + reach_px} : all;
    }
    source_rows rows = {INFINITY, -INFINITY};
    double before = 0.0, step = 0.0;
    for (int k = 0; k < INSTANTS; k++) {
        double u = k / (INSTANTS - 1.0), to_x, to_y;
        bst_quat q = bst_los_track_attitude(track, u * duration);
        bst_vec3 v = bst_quat_rotate(q, bst_scene_source_direction(source, u));
        if (!bst_camera_project(&r->camera, bst_scene_source_seen(&r->camera, source, v), &x, &y)) {
            *moved_px = INFINITY;
            return all;
        }
        rows.first = fmin(rows.first, y);
        rows.last = fmax(rows.last, y);
        step = k > 0 ? fmax(step, fabs(y - before)) : 0.0;
        before = y;
        double later = u + r->times.exposure_s / duration;
        q = bst_los_track_attitude(track, fmin(later, 1.0) * duration);
        bst_vec3 to = bst_quat_rotate(q, bst_scene_source_direction(source, fmin(later, 1.0)));
        to = bst_scene_source_seen(&r->camera, source, to);
        if (bst_camera_project(&r->camera, to, &to_x, &to_y)) {
            *moved_px =
                k == 0 ? hypot(to_x - x, to_y - y) : fmax(*moved_px, hypot(to_x - x, to_y - y));
        }
    }
    /* between samples: by another step */
    return (source_rows){rows.first - step, rows.last + step};
}

/* Error rate of a source's image with row delay d: it gains the light of the last d of the exposure
 * and loses that of the first d. This is at most rate d times the PSF at two positions `moved`
 * apart, bounded by the PSF's peak. The source's own noise counts there: with a the share of the
 * streak, exp(-z^2) / Q(z) <= 2.55 at z from the streak's end. */
static double error_per_s(const bst_rolling *r, const bst_scene_source *source, double moved_px,
                          double dark_variance) {
    double rate = source->electrons_per_s * r->share;
    if (source->rate) {
        double most = 0.0;
        for (int k = 0; k < source->rate->count; k++) {
            most = fmax(most, source->rate->rate[k]);
        }
        return rate * most / sqrt(dark_variance);
    }
    if (source->shape) {
        return rate / sqrt(dark_variance);
    }
    double apart = fmin(1.0, r->steepest * moved_px / r->sigma_px);
    double speed = r->speed_pxps + (source->path ? moved_px / r->times.exposure_s : 0.0);
    double stay = speed > 0.0 ? sqrt(2.0 * BST_PI) * r->sigma_px / speed : INFINITY;
    double own = rate * fmin(r->times.exposure_s, stay);
    return rate * apart * fmin(1.0 / sqrt(dark_variance), own > 0.0 ? 1.6 / sqrt(own) : INFINITY);
}

static bst_status reserve(bst_ctx *ctx, bst_rolling *r, int sources, int parts, int rows) {
    bool enough = true;
    if (sources > r->source_capacity) {
        free(r->rows);
        free(r->sources);
        free(r->number);
        r->rows = malloc((size_t)sources * sizeof *r->rows);
        r->sources = malloc((size_t)sources * sizeof *r->sources);
        r->number = malloc((size_t)sources * sizeof *r->number);
        enough = r->rows && r->sources && r->number;
        r->source_capacity = enough ? sources : 0;
    }
    if (parts > r->part_capacity) {
        free(r->parts);
        r->parts = malloc((size_t)parts * sizeof *r->parts);
        enough = enough && r->parts;
        r->part_capacity = r->parts ? parts : 0;
    }
    if (rows > r->row_capacity) {
        free(r->slope);
        r->slope = malloc((size_t)rows * sizeof *r->slope);
        enough = enough && r->slope;
        r->row_capacity = r->slope ? rows : 0;
    }
    return enough ? BST_OK
                  : bst_fail(ctx, BST_ERR_MEMORY, "no memory for a rolling shutter's %d sources",
                             sources);
}

bst_status bst_rolling_begin(bst_ctx *ctx, bst_rolling *r, const bst_render_request *q,
                             double margin_px) {
    assert(r && q && q->track && q->count >= 0 && margin_px >= 0.0);
    int height = q->window.height, moving = 0;
    for (int i = 0; i < q->count; i++) {
        moving += q->sources[i].path || q->sources[i].rate;
    }
    BST_TRY(reserve(ctx, r, q->count, moving, height));
    r->request = q;
    r->times = (bst_row_times){q->row_time_s, q->exposure_s, q->window};
    r->margin_px = margin_px;
    r->next = 0;
    double needed = q->exposure_s + fabs(q->row_time_s) * (height - 1), has = duration_of(q);
    if (!(has >= needed * (1.0 - 1e-12) - 1e-9)) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "the line of sight is given for %.9g s, but %d rows with row_time_s %.9g "
                        "are exposed within %.9g s",
                        has, height, q->row_time_s, needed);
    }
    measure_motion(r);
    const bst_los_track *track = q->track;
    bst_quat middle = bst_los_track_attitude(track, 0.5 * has);
    double reach = 0.0;
    for (int k = 0; k < track->count; k++) {
        reach = fmax(reach, bst_los_track_moved_px(&r->camera, middle, track->q_cam_from_gcrf[k]));
    }
    for (int y = 0; y < height; y++) {
        r->slope[y] = 0.0;
    }
    double read = r->camera.read_noise_e;
    double dark = q->background_e + (q->background ? q->background->least_e : 0.0) + read * read;
    for (int i = 0; i < q->count; i++) {
        const bst_scene_source *s = &q->sources[i];
        double moved,
            disc_px = s->shape ? s->shape->radius / bst_camera_scale_rad(&r->camera) : 0.0;
        disc_px = s->ghost ? bst_ghost_reach_px(s->ghost) : disc_px;
        r->rows[i] = rows_of(r, s, reach, &moved);
        r->rows[i].first -= disc_px + q->window.y0;
        r->rows[i].last += disc_px - q->window.y0;
        if (s->occulted || !(s->electrons_per_s > 0.0)) {
            continue;
        }
        double slope = error_per_s(r, s, moved, dark);
        double first = fmax(r->rows[i].first - r->reach_px, 0.0);
        double last = fmin(r->rows[i].last + r->reach_px, height - 1.0);
        for (int y = (int)ceil(first); y <= last; y++) {
            r->slope[y] = fmax(r->slope[y], slope);
        }
    }
    return BST_OK;
}

bst_status bst_rolling_next(bst_ctx *ctx, bst_rolling *r, bst_render_request *band, bool *more) {
    assert(r && band && more);
    const bst_render_request *q = r->request;
    int first = r->next, height = q->window.height;
    *more = first < height;
    if (!*more) {
        return BST_OK;
    }
    double row_s = fabs(q->row_time_s), slope = r->slope[first];
    int end = first + 1;
    for (; end < height; end++) { /* rows at a band's ends are half a band from its middle */
        double with = fmax(slope, r->slope[end]);
        if (with * 0.5 * (end - first) * row_s > r->tolerance) {
            break;
        }
        slope = with;
    }
    r->next = end;
    r->error_sigma = slope * 0.5 * (end - 1 - first) * row_s;
    *band = *q;
    band->row_time_s = band->exposure_s = 0.0;
    band->window.y0 = q->window.y0 + first;
    band->window.height = end - first;
    double spare = duration_of(q) - q->exposure_s;
    double start = bst_row_start_s(&r->times, q->track, q->window.y0 + 0.5 * (first + end - 1));
    start = fmin(fmax(start, 0.0), spare);
    BST_TRY(bst_los_track_part(ctx, &r->store, q->track, start, start + q->exposure_s, &r->track));
    int n = 0, used = 0;
    double u0 = duration_of(q) > 0.0 ? start / duration_of(q) : 0.0;
    double u1 = duration_of(q) > 0.0 ? (start + q->exposure_s) / duration_of(q) : 1.0;
    for (int i = 0; i < q->count; i++) {
        const bst_scene_source *s = &q->sources[i];
        if (r->rows[i].first > end - 1 + r->margin_px || r->rows[i].last < first - r->margin_px) {
            continue;
        }
        r->number[n] = i;
        if ((s->path || s->rate) && u1 > u0) {
            bst_scene_source_during(s, u0, fmin(u1, 1.0), &r->parts[used++], &r->sources[n]);
        } else {
            r->sources[n] = *s;
        }
        n++;
    }
    band->track = &r->track;
    band->sources = r->sources;
    band->count = n;
    return BST_OK;
}

int bst_rolling_source(const bst_rolling *r, int index) {
    return r->number[index];
}

double bst_rolling_error_sigma(const bst_rolling *r) {
    return r->error_sigma;
}
