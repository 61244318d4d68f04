#include "sim/world/scene/row_exposure.h"

#include <assert.h>

#include "sim/world/scene/los_track.h"

double bst_row_start_s(const bst_row_times *rows, const bst_los_track *track, double y_px) {
    double spare = track->time_s[track->count - 1] - rows->exposure_s;
    double middle = rows->window.y0 + 0.5 * (rows->window.height - 1);
    return 0.5 * spare + (y_px - middle) * rows->row_time_s;
}

/* Sensor row of a source's image at a time, clamped to the window. */
static bool row_of(const bst_camera *camera, const bst_row_times *rows, const bst_los_track *track,
                   const bst_scene_source *source, double time_s, double *y) {
    double x, u = time_s / track->time_s[track->count - 1];
    bst_vec3 v = bst_quat_rotate(bst_los_track_attitude(track, time_s),
                                 bst_scene_source_direction(source, u));
    if (!bst_camera_project(camera, bst_scene_source_seen(camera, source, v), &x, y)) {
        return false;
    }
    *y = fmin(fmax(*y, rows->window.y0), rows->window.y0 + rows->window.height - 1.0);
    return true;
}

void bst_row_source_times(const bst_camera *camera, const bst_row_times *rows,
                          const bst_los_track *track, const bst_scene_source *source, double u[2]) {
    enum { MOST_STEPS = 60 };
    double duration = track->time_s[track->count - 1], spare = duration - rows->exposure_s;
    for (int end = 0; end < 2; end++) {
        double later = end ? rows->exposure_s : 0.0, t = 0.5 * spare + later, y;
        for (int n = 0; n < MOST_STEPS; n++) {
            if (!row_of(camera, rows, track, source, t, &y)) {
                t = 0.5 * spare + later;
                break;
            }
            double next = fmin(fmax(bst_row_start_s(rows, track, y), 0.0), spare) + later;
            bool done = fabs(next - t) < 1e-12;
            t = next;
            if (done) {
                break;
            }
        }
        u[end] = t / duration;
    }
    u[1] = fmax(u[0], u[1]);
}

/* Restricts the light curve of a source to a part of the exposure. */
static void rate_during(const bst_scene_source *source, double u0, double u1,
                        bst_scene_source_part *part, bst_scene_source *out) {
    const bst_scene_source_rate *r = source->rate;
    double before = bst_scene_source_light(source, u0),
           share = bst_scene_source_light(source, u1) - before;
    out->electrons_per_s *= share / (u1 - u0);
    out->rate = &part->rate;
    if (!(share > 0.0)) {
        out->rate = NULL;
        return;
    }
    double knots[BST_RATE_KNOTS];
    int count = 0;
    knots[count++] = u0;
    for (int k = 0; k < r->count && count < BST_RATE_KNOTS - 1; k++) {
        if (r->u[k] > u0 && r->u[k] < u1) {
            knots[count++] = r->u[k];
        }
    }
    assert(count < BST_RATE_KNOTS && u0 <= u1);
    knots[count++] = u1;
    part->rate.count = count;
    part->rate.error = r->error / share;
    for (int k = 0; k < count; k++) {
        part->rate.u[k] = (knots[k] - u0) / (u1 - u0);
        part->rate.rate[k] = bst_scene_source_rate_at(source, knots[k]) * (u1 - u0) / share;
        part->rate.light[k] = (bst_scene_source_light(source, knots[k]) - before) / share;
    }
    part->rate.u[count - 1] = part->rate.light[count - 1] = 1.0;
}

void bst_scene_source_during(const bst_scene_source *source, double u0, double u1,
                             bst_scene_source_part *part, bst_scene_source *out) {
    *out = *source;
    double span = u1 - u0, body = source->body_u[1] - source->body_u[0];
    out->body_u[0] = source->body_u[0] + u0 * body;
    out->body_u[1] = source->body_u[0] + u1 * body;
    if (source->path) {
        for (int k = 0; k < BST_PATH_NODES; k++) {
            part->path.place[k] =
                bst_scene_source_place(source->path, u0 + span * k / (BST_PATH_NODES - 1.0));
        }
        for (int k = 0; k < 3; k++) {
            part->path.shift[k] = bst_scene_source_shift(source->path, u0 + 0.5 * span * k);
        }
        out->apparent_mid = bst_vec3_unit(bst_scene_source_direction(source, u0 + 0.5 * span));
        out->path = &part->path;
    }
    if (source->rate) {
        rate_during(source, u0, u1, part, out);
    }
}
