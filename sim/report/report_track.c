#include "sim/report/report_track.h"

#include <math.h>
#include <string.h>

/* A row of the table tracks. */
typedef struct track {
    bool there, firm; /* firm: confirmed or coasting */
    double time_s, snr;
    bst_vec3 direction, east, north;
    double rate_east_radps, rate_north_radps;
    double cov[3]; /* direction covariance, rad^2: east-east, east-north, north-north */
    bool fresh;    /* updated by a detection of this frame */
} track;

typedef struct cursor {
    bst_io_rows *rows; /* NULL: all rows read, or no such table */
    bool held;
} cursor;

/* Advances to the next row of exposure `id`. */
static bst_status advance(bst_ctx *ctx, cursor *c, int64_t id, bool *found) {
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
        c->held = key > id;
        if (key >= id) {
            *found = !c->held;
            break;
        }
    }
    return BST_OK;
}

static track read_track(const bst_io_rows *rows) {
    double ra = bst_io_rows_real(rows, 3) * BST_DEG_RAD,
           dec = bst_io_rows_real(rows, 4) * BST_DEG_RAD;
    const char *status = bst_io_rows_text(rows, 2);
    return (track){
        .there = true,
        .firm = strcmp(status, "confirmed") == 0 || strcmp(status, "coasting") == 0,
        .time_s = bst_io_rows_real(rows, 1),
        .snr = bst_io_rows_real(rows, 10),
        .fresh = bst_io_rows_int(rows, 11) == 1,
        .direction = bst_vec3_from_radec(ra, dec),
        .east = {-sin(ra), cos(ra), 0.0},
        .north = {-sin(dec) * cos(ra), -sin(dec) * sin(ra), cos(dec)},
        .rate_east_radps = bst_io_rows_real(rows, 5) * BST_ARCSEC_RAD,
        .rate_north_radps = bst_io_rows_real(rows, 6) * BST_ARCSEC_RAD,
        .cov = {bst_io_rows_real(rows, 7), bst_io_rows_real(rows, 8), bst_io_rows_real(rows, 9)}};
}

/* Compares the track, propagated to mid-exposure, with the truth. */
static void judge(const bst_report_sensor *s, bst_report_frame *f, const track *t, bool own) {
    if (!t->there || !f->known) {
        return;
    }
    double dt = f->mid_s - t->time_s;
    bst_vec3 rate = bst_vec3_add(bst_vec3_scale(t->east, t->rate_east_radps),
                                 bst_vec3_scale(t->north, t->rate_north_radps));
    bst_vec3 d = bst_vec3_unit(bst_vec3_axpy(t->direction, dt, rate));
    bst_vec3 truth =
        bst_vec3_from_radec(f->target_ra_deg * BST_DEG_RAD, f->target_dec_deg * BST_DEG_RAD);
    f->in_track = t->firm && bst_eval_track_is_on_target(t->direction, rate, dt, truth,
                                                         s->pixel_scale_arcsec * BST_ARCSEC_RAD);
    if (!own) {
        return;
    }
    bst_vec3 error = bst_vec3_sub(d, truth);
    double e = bst_vec3_dot(error, t->east), n = bst_vec3_dot(error, t->north);
    f->track_east_arcsec = e / BST_ARCSEC_RAD;
    f->track_north_arcsec = n / BST_ARCSEC_RAD;
    double trace = t->cov[0] + t->cov[2], det = t->cov[0] * t->cov[2] - t->cov[1] * t->cov[1];
    if (trace > 0.0 && det > 0.0) {
        f->track_sigma_arcsec = sqrt(trace) / BST_ARCSEC_RAD;
        f->nees = (e * e * t->cov[2] - 2.0 * e * n * t->cov[1] + n * n * t->cov[0]) / det;
    }
}

static bst_status walk(bst_ctx *ctx, cursor *frames, cursor *tracks, bst_report_sensor *s) {
    track latest = {0};
    for (size_t i = 0; i < s->count; i++) {
        bst_report_frame *f = &s->frames[i];
        bool answered, found;
        BST_TRY(advance(ctx, frames, f->exposure_id, &answered));
        if (answered) {
            s->has_tracks = true;
            f->attitude = bst_io_rows_int(frames->rows, 1) == 1;
            f->tracked_s = bst_io_rows_real(frames->rows, 2);
            latest.there = false;
        }
        for (;;) {
            BST_TRY(advance(ctx, tracks, f->exposure_id, &found));
            if (!found) {
                break;
            }
            latest = read_track(tracks->rows);
        }
        if (answered && latest.there && latest.fresh) {
            f->updated = true;
            f->track_snr = latest.snr;
        }
        judge(s, f, &latest, answered);
    }
    return BST_OK;
}

bst_status bst_report_read_tracks(bst_ctx *ctx, const bst_run_reader *run, bst_report_sensor *s) {
    bst_ctx unheard = {0};
    cursor frames = {0}, tracks = {0};
    if (bst_io_rows_open(&unheard, run,
                         "SELECT exposure_id, attitude_valid, CAST(written_tick AS REAL) /"
                         " (SELECT tick_rate_hz FROM run) FROM track_frames WHERE sensor = ?1",
                         s->sensor.index, 0, &frames.rows) != BST_OK ||
        bst_io_rows_open(
            &unheard, run,
            "SELECT exposure_id, time_s, status, ra_deg, dec_deg, rate_east_arcsec_per_s,"
            " rate_north_arcsec_per_s, cov_d1_d1_rad2, cov_d1_d2_rad2, cov_d2_d2_rad2,"
            " snr, last_update_tick = tick FROM tracks WHERE sensor = ?1 AND "
            "target_of_interest = 1",
            s->sensor.index, 0, &tracks.rows) != BST_OK) {
        bst_io_rows_close(frames.rows);
        return BST_OK; /* not recorded */
    }
    bst_status status = walk(ctx, &frames, &tracks, s);
    bst_io_rows_close(frames.rows);
    bst_io_rows_close(tracks.rows);
    if (status == BST_ERR_FORMAT) {
        s->damaged = true;
        return BST_OK;
    }
    return status;
}
