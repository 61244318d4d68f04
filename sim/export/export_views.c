/* Exports fields of view to CZML: a frustum from each observer along the corners of its sensor, at
 * the recorded true attitudes. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sim/export/export.h"
#include "sim/io/czml_writer.h"
#include "sim/world/frame_updates.h"

enum { CORNERS = 4, MOST_ROWS = 4096 };

/* length of the frustum if no object was in the field */
#define LENGTH_M 1e6

/* Camera attitude at mid-exposure. */
typedef struct pose {
    double seconds, pixel_scale_arcsec;
    bst_quat q_cam_from_gcrf;
} pose;

typedef struct frustum {
    bst_world_view *view;
    const bst_world *world;
    const bst_camera *camera;
    int observer, corner; /* corner < 0: the observer itself */
    double length_m;
    pose *poses;
    int64_t count;
} frustum;

/* Position of a corner (or of the observer) at a pose. */
static bst_status row_of(void *user, bst_ctx *ctx, int64_t row, bst_time *time,
                         bst_vec3 *position_m, bst_vec3 *velocity_mps) {
    const frustum *f = user;
    const pose *p = &f->poses[row];
    bst_world_state eye;
    BST_TRY(bst_world_view_observer_state(ctx, f->view, f->observer, p->seconds, &eye));
    *time = bst_world_time(f->world, p->seconds);
    *position_m = eye.position_m;
    *velocity_mps = eye.velocity_mps;
    if (f->corner < 0) {
        return BST_OK;
    }
    bst_camera camera;
    BST_TRY(bst_world_camera_at_scale(ctx, f->camera, p->pixel_scale_arcsec, &camera));
    bool right = f->corner == 1 || f->corner == 2, top = f->corner >= 2;
    bst_vec3 ray = bst_camera_unproject(&camera, right ? (double)camera.width_px - 0.5 : -0.5,
                                        top ? (double)camera.height_px - 0.5 : -0.5);
    ray = bst_quat_rotate(bst_quat_conj(p->q_cam_from_gcrf), ray);
    *position_m = bst_vec3_axpy(*position_m, f->length_m, ray);
    return BST_OK;
}

/* Reads the camera attitudes of a sensor, thinned if there are many. */
static bst_status read_poses(bst_ctx *ctx, const bst_export *e, int64_t sensor, frustum *f) {
    bst_io_rows *rows;
    bool more;
    int64_t total =
        bst_run_reader_int(e->run, "SELECT count(*) FROM exposures WHERE sensor = ?1", sensor, 0);
    int64_t every = 1 + total / MOST_ROWS;
    f->count = 0;
    f->poses = malloc(((size_t)(total / every) + 2) * sizeof *f->poses);
    if (!f->poses) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for fields of view");
    }
    BST_TRY(bst_io_rows_open(ctx, e->run,
                             "SELECT mid_s, pixel_scale_arcsec, q_cam_from_gcrf_mid_x,"
                             " q_cam_from_gcrf_mid_y, q_cam_from_gcrf_mid_z, q_cam_from_gcrf_mid_w"
                             " FROM exposures WHERE sensor = ?1 ORDER BY exposure_id",
                             sensor, 0, &rows));
    bst_status status;
    for (int64_t n = 0; (status = bst_io_rows_next(ctx, rows, &more)) == BST_OK && more; n++) {
        pose p = {bst_io_rows_real(rows, 0),
                  bst_io_rows_real(rows, 1),
                  {bst_io_rows_real(rows, 2), bst_io_rows_real(rows, 3), bst_io_rows_real(rows, 4),
                   bst_io_rows_real(rows, 5)}};
        bool later = f->count == 0 || p.seconds > f->poses[f->count - 1].seconds;
        if (n % every == 0 && later && f->count < total / every + 2) {
            f->poses[f->count++] = p;
        }
    }
    bst_io_rows_close(rows);
    return status;
}

static double length_of(bst_ctx *ctx, const bst_export *e, int64_t sensor) {
    bst_io_rows *rows;
    bool more = false;
    double length = NAN;
    if (bst_io_rows_open(ctx, e->run,
                         "SELECT avg(range_m) FROM truth WHERE sensor = ?1 AND kind = 'object'"
                         " AND in_field = 1",
                         sensor, 0, &rows) == BST_OK) {
        if (bst_io_rows_next(ctx, rows, &more) == BST_OK && more) {
            length = bst_io_rows_real(rows, 0);
        }
        bst_io_rows_close(rows);
    }
    return length > 0.0 ? length : LENGTH_M;
}

static bst_status write_frustum(bst_ctx *ctx, FILE *stream, const char *name, frustum *f) {
    static const unsigned char colour[4] = {120, 255, 255, 120};
    /* observer, corner, next corner, observer, ... */
    static const int way[] = {0, 1, 2, 0, 2, 3, 0, 3, 4, 0, 4, 1};
    char ids[CORNERS + 1][200];
    const char *line[sizeof way / sizeof *way];
    for (int k = 0; k <= CORNERS; k++) {
        f->corner = k - 1;
        snprintf(ids[k], sizeof ids[k], k ? "view/%.160s/%d" : "view/%.160s/eye", name, k);
        bst_czml_object point = {.id = ids[k],
                                 .name = name,
                                 .point_px = -1.0,
                                 .linear = true,
                                 .series = {.rows = f->count, .state = row_of, .user = f}};
        BST_TRY(bst_czml_write_object(ctx, stream, &point));
    }
    for (size_t k = 0; k < sizeof way / sizeof *way; k++) {
        line[k] = ids[way[k]];
    }
    char id[200];
    snprintf(id, sizeof id, "view/%.180s", name);
    const bst_czml_line view = {.id = id,
                                .name = name,
                                .ids = line,
                                .count = (int)(sizeof way / sizeof *way),
                                .rgba = colour,
                                .start = bst_world_time(f->world, f->poses[0].seconds),
                                .stop = bst_world_time(f->world, f->poses[f->count - 1].seconds)};
    return bst_czml_write_line(ctx, stream, &view);
}

bst_status bst_export_views(bst_ctx *ctx, const bst_export *e, const bst_scenario *scenario,
                            const bst_world *world, bst_world_view *view, FILE *stream) {
    /* a run without recorded truth has no attitudes */
    if (!bst_run_reader_has_tables(e->run) ||
        bst_run_reader_int(e->run, "SELECT count(*) FROM exposures", 0, 0) < 1) {
        return BST_OK;
    }
    const bst_observer_config *observers = scenario->observers.items;
    int64_t number = 0;
    for (int i = 0; i < scenario->observers.count; i++) {
        const bst_sensor_config *sensors = observers[i].sensors.items;
        for (int k = 0; k < observers[i].sensors.count; k++, number++) {
            frustum f = {.view = view,
                         .world = world,
                         .camera = bst_world_camera(world, i, k),
                         .observer = i,
                         .length_m = length_of(ctx, e, number)};
            char name[160];
            snprintf(name, sizeof name, "%s/%s", observers[i].name, sensors[k].name);
            bst_status status = read_poses(ctx, e, number, &f);
            if (status == BST_OK && f.count > 0) {
                status = write_frustum(ctx, stream, name, &f);
            }
            free(f.poses);
            BST_TRY(status);
        }
    }
    return BST_OK;
}
