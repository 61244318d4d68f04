#include "scenegen/part_mask.h"

#include <assert.h>
#include <math.h>
#include <string.h>

#include "sim/world/scene/body_limb.h"
#include "sim/world/scene/los_track.h"

/* Cells: largest side, px, and the number across a small body. */
#define CELL_PX 0.5
enum { ACROSS = 64 };

/* A frame and the attitude of the camera. */
typedef struct frame {
    const bst_camera *camera;
    bst_quat q_cam_from_gcrf;
    double scale_rad;
    bst_window window;
    int binning, width, height;
    int32_t *mask;
} frame;

/* A box of the frame's pixels; x1 and y1 exclusive. */
typedef struct box {
    int x0, y0, x1, y1;
} box;

void bst_part_mask_free(bst_part_mask *work) {
    bst_satellite_pose_free(work->pose);
    bst_resolved_free(work->image);
    *work = (bst_part_mask){0};
}

/* Makes the work memory that of a model. */
static bst_status use_model(bst_ctx *ctx, bst_part_mask *work, const bst_satellite *satellite) {
    if (work->pose && work->image && work->pose->satellite == satellite) {
        return BST_OK;
    }
    bst_part_mask_free(work);
    BST_TRY(bst_satellite_pose_create(ctx, satellite, &work->pose));
    return bst_resolved_create(ctx, satellite, &work->image);
}

/* Position of a frame's pixel in a camera without distortion, px from the boresight. False: no
 * light from the front falls there. */
static bool ideal_place(const frame *f, int x, int y, double *ideal_x, double *ideal_y) {
    double px = f->window.x0 + (x + 0.5) * f->binning - 0.5;
    double py = f->window.y0 + (y + 0.5) * f->binning - 0.5;
    bst_vec3 v = bst_camera_unproject(f->camera, px, py);
    if (!(v.z > 0.0)) {
        return false;
    }
    *ideal_x = v.x / (v.z * f->scale_rad);
    *ideal_y = v.y / (v.z * f->scale_rad);
    return true;
}

static int limited(double value, int limit) {
    return value > 0.0 ? (value < limit ? (int)value : limit) : 0;
}

/* Pixels of the frame that a posed body may cover. */
static box box_of(const frame *f, const bst_satellite_pose *pose, const bst_resolved_view *view) {
    double x0 = INFINITY, y0 = INFINITY, x1 = -INFINITY, y1 = -INFINITY;
    for (int i = 0; i < pose->satellite->vertex_count; i++) {
        double x, y;
        bst_vec3 v = bst_vec3_add(view->origin_m,
                                  bst_quat_rotate(view->q_image_from_body, pose->vertices[i]));
        if (!bst_camera_project(f->camera, v, &x, &y)) {
            return (box){0, 0, f->width, f->height};
        }
        x0 = fmin(x0, x);
        y0 = fmin(y0, y);
        x1 = fmax(x1, x);
        y1 = fmax(y1, y);
    }
    double margin = 2.0 + 0.05 * fmax(x1 - x0, y1 - y0); /* curved parts, and distortion */
    return (box){.x0 = limited((x0 - margin - f->window.x0) / f->binning, f->width),
                 .y0 = limited((y0 - margin - f->window.y0) / f->binning, f->height),
                 .x1 = limited(ceil((x1 + margin - f->window.x0) / f->binning) + 1.0, f->width),
                 .y1 = limited(ceil((y1 + margin - f->window.y0) / f->binning) + 1.0, f->height)};
}

/* Limits a box of ideal positions to what the pixels of a frame's box see. False: nothing is left.
 */
static bool limit_to(const frame *f, const box *b, double low[2], double high[2]) {
    double from[2] = {INFINITY, INFINITY}, to[2] = {-INFINITY, -INFINITY}, at[2];
    for (int y = b->y0; y < b->y1; y++) {
        bool all = y == b->y0 || y == b->y1 - 1; /* the border contains the inside */
        for (int x = b->x0; x < b->x1; x += all || x == b->x1 - 1 ? 1 : b->x1 - 1 - x) {
            if (!ideal_place(f, x, y, &at[0], &at[1])) {
                continue;
            }
            for (int i = 0; i < 2; i++) {
                from[i] = fmin(from[i], at[i]);
                to[i] = fmax(to[i], at[i]);
            }
        }
    }
    for (int i = 0; i < 2; i++) {
        low[i] = fmax(low[i], from[i] - 1.0);
        high[i] = fmin(high[i], to[i] + 1.0);
    }
    return low[0] < high[0] && low[1] < high[1];
}

/* Draws one body over the mask. */
static bst_status draw(bst_ctx *ctx, bst_part_mask *work, const frame *f,
                       const bst_scene_source *source) {
    bst_source_body_state state;
    bst_source_body_at(source, 0.5, &state, NULL);
    BST_TRY(use_model(ctx, work, source->body->satellite));
    bst_source_body_set_pose(source, &state, work->pose);
    bst_resolved_hidden hidden;
    const bst_body_limb_view limb = {f->q_cam_from_gcrf, f->scale_rad};
    const bst_resolved_view view = {
        .hidden = bst_body_limb_hidden(source, 0.5, &limb, &hidden) ? &hidden : NULL,
        .q_image_from_body =
            bst_quat_mul(f->q_cam_from_gcrf, bst_quat_conj(state.q_body_from_gcrf)),
        .origin_m =
            bst_vec3_scale(bst_quat_rotate(f->q_cam_from_gcrf, state.apparent), state.range_m),
        .scale_rad = f->scale_rad};
    double low[2], high[2];
    if (!bst_resolved_box(work->pose, &view, low, high)) {
        return BST_OK;
    }
    box b = box_of(f, work->pose, &view);
    double cell_px = fmin(fmax(high[0] - low[0], high[1] - low[1]) / ACROSS, CELL_PX);
    if (!limit_to(f, &b, low, high)) {
        return BST_OK;
    }
    BST_TRY(bst_resolved_begin(ctx, work->image, low, high, cell_px));
    BST_TRY(bst_resolved_add(ctx, work->image, work->pose, &view, NULL, 1.0, NULL));
    const bst_resolved_image *image = bst_resolved_image_of(work->image);
    for (int y = b.y0; y < b.y1; y++) {
        for (int x = b.x0; x < b.x1; x++) {
            double at[2];
            if (!ideal_place(f, x, y, &at[0], &at[1])) {
                continue;
            }
            double column = floor(at[0] / cell_px) - image->x0;
            double row = floor(at[1] / cell_px) - image->y0;
            if (!(column >= 0.0 && column < image->width && row >= 0.0 && row < image->height)) {
                continue;
            }
            int i = (int)row * image->width + (int)column;
            if (image->cells[i].cover >= 0.5f && image->part[i] >= 0) {
                f->mask[(size_t)y * (size_t)f->width + (size_t)x] =
                    source->body->first_part + image->part[i];
            }
        }
    }
    return BST_OK;
}

/* The farthest source with a body after the source `before` in this order; -1: none. */
static int next_nearer(const bst_render_request *q, int before) {
    int next = -1;
    for (int i = 0; i < q->count; i++) {
        const bst_scene_source *s = &q->sources[i];
        bool after = before < 0 || s->range_m < q->sources[before].range_m ||
                     (!(s->range_m > q->sources[before].range_m) && i > before);
        if (s->body && after && (next < 0 || s->range_m > q->sources[next].range_m)) {
            next = i;
        }
    }
    return next;
}

bst_status bst_part_mask_draw(bst_ctx *ctx, bst_part_mask *work, const bst_camera *camera,
                              const bst_render_request *q, int32_t *mask) {
    assert(work && camera && q && mask);
    const bst_los_track *track = q->track;
    int binning = q->binning > 1 ? q->binning : 1;
    const frame f = {
        .camera = camera,
        .q_cam_from_gcrf = bst_los_track_attitude(track, 0.5 * track->time_s[track->count - 1]),
        .scale_rad = bst_camera_scale_rad(camera),
        .window = q->window,
        .binning = binning,
        .width = q->window.width / binning,
        .height = q->window.height / binning,
        .mask = mask};
    memset(mask, 0, (size_t)f.width * (size_t)f.height * sizeof *mask);
    for (int i = next_nearer(q, -1); i >= 0; i = next_nearer(q, i)) {
        BST_TRY(draw(ctx, work, &f, &q->sources[i]));
    }
    return BST_OK;
}
