/* Levels of detail: nodes of the stars' path, and the table that the kernels read. */
#include <assert.h>
#include <math.h>
#include <string.h>

#include "scenegen/kernels/deposit_shared.h"
#include "scenegen/smear/motion.h"
#include "scenegen/smear/smear_internal.h"
#include "scenegen/stamp/profile_law.h"

bst_status bst_smear_path_nodes(bst_ctx *ctx, bst_smear *s, const bst_smear_path_point *path,
                                int count, double part, bool turns, double tolerance) {
    double parts = ceil(part * s->options.temporal_oversample - 1e-9);
    if (parts > 0.0) {
        return bst_motion_midpoints(ctx, path, count, (int)parts, &s->nodes);
    }
    if (s->rests_path != path || s->rests_count != count) {
        s->rests = bst_motion_rests(path, count, BST_STREAK_SIGMAS * s->sigma_px);
        s->rests_path = path;
        s->rests_count = count;
    }
    s->nodes.rests |= s->rests;
    double further = s->options.smoothed_variance_px2 - s->sigma_px * s->sigma_px;
    if (!(s->options.node_sigma_px > 0.0)) { /* another PSF contains the pixel */
        further = 1.0 / 12.0;
    }
    bst_smear_node_aim aim = {.psf_sigma_px = s->sigma_px,
                              .tolerance = tolerance,
                              .widest = s->widest,
                              .wide_field = turns ? s->wide_field : 1.0,
                              .curvature = turns ? s->curvature : 0.0,
                              .binned_variance = (s->binning * s->binning - 1.0) / 12.0,
                              .further_variance = fmax(further, 0.0)};
    memcpy(aim.pixel_part, s->pixel_part, sizeof aim.pixel_part);
    if (s->sensitivity) {
        /* the tangent plane stretches the image from the boresight, and turns its motion with it */
        double more = s->wide_field - 1.0, distorted = bst_camera_distorted(&s->camera) ? 2.0 : 0.0;
        aim.direction_part = s->sensitivity->part;
        aim.smooth_part = s->sensitivity->smooth;
        aim.row_ripple = s->sensitivity->row;
        aim.most_per_px = s->sensitivity->most_per_px;
        aim.light_part = s->sensitivity->light;
        aim.turns = turns;
        aim.unlike_rad = (turns ? asin(more / (2.0 + more)) : 0.0) + distorted;
    }
    return bst_smear_nodes_from_path(ctx, path, count, &aim, &s->nodes);
}

/* Sets the image error of the nodes' profiles, relative to the peak. Returns their largest
 * widening, PSF variances. */
static double set_profile_error(const bst_smear *s, const bst_smear_node_list *list,
                                bst_smear_level *out) {
    double psf = s->sigma_px * s->stretch, widest = 0.0, table = 0.0;
    for (int n = 0; n < list->count; n++) {
        double w = list->items[n].variance / (psf * psf), wide = 1.0 + w;
        widest = fmax(widest, w);
        table = fmax(table, 0.75 * w / (wide * wide));
    }
    if (s->options.node_sigma_px > 0.0) {
        /* by table widths, and by kernel phases: linear interpolation widens by up to a quarter of
         * a step squared, half of that per axis */
        table /= BST_WIDTHS * BST_WIDTHS;
        double step = 1.0 / (BST_SPREAD_PHASES * s->options.grid_per_px * s->sigma_px);
        double finer = s->options.grid_per_px / s->grid_per_px;
        out->profile_error = table + 0.25 * step * step;
        out->predicted_profile = table + 0.25 * step * step * finer * finer;
        return widest;
    }
    out->profile_error = widest > s->options.law_widest ? fmax(s->edge_error, s->point_error)
                         : widest > 0.0                 ? fmax(2.0 * BST_LAW_ERROR, s->point_error)
                                                        : s->point_error;
    out->predicted_profile = out->profile_error;
    return widest;
}

/* Widening of a node in PSF variances, before distortion stretches it. */
static double widening(const bst_smear *s, const bst_smear_node *node) {
    double psf = s->sigma_px * s->stretch;
    return node->variance / (psf * psf);
}

/* Table entry of a camera rotation: v_node = M v_reference as a map of the undistorted tangent
 * plane, px, focal-plane axes, x' - x = ((m00 - m22) x + m01 y + m02 / a - x d) / (d + m22), d = a
 * (m20 x + m21 y). */
static void attitude_to_table(const bst_smear *s, const bst_smear_node *node, float *t) {
    double a = bst_camera_scale_rad(&s->camera), tilt = a / (s->stretch * s->wide_field);
    bst_quat q = bst_quat_from_rotvec(
        (bst_vec3){node->p[0] * tilt, node->p[1] * tilt, node->p[2] / s->half_diagonal_px});
    bst_mat3 m = bst_quat_to_mat3(q);
    double rows[BST_TABLE_ROWS] = {
        m.m[0][0] - m.m[2][2], m.m[0][1],     m.m[0][2] / a, m.m[1][0], m.m[1][1] - m.m[2][2],
        m.m[1][2] / a,         m.m[2][0] * a, m.m[2][1] * a, m.m[2][2], node->weight,
        widening(s, node)};
    for (int i = 0; i < BST_TABLE_ROWS; i++) {
        t[i * BST_BLOCK] = (float)rows[i];
    }
}

/* Table entry of a source's own path: a shift of the image. */
static void shift_to_table(const bst_smear *s, const bst_smear_node *node, float *t) {
    double x = node->p[0] / s->stretch, y = node->p[1] / s->stretch;
    double rows[BST_TABLE_ROWS] = {0, 0, x, 0, 0, y, 0, 0, 1.0, node->weight, widening(s, node)};
    for (int i = 0; i < BST_TABLE_ROWS; i++) {
        t[i * BST_BLOCK] = (float)rows[i];
    }
}

typedef void (*to_table)(const bst_smear *, const bst_smear_node *, float *);

static int blocks_of(const bst_smear_node_list *list) {
    return (list->count + BST_BLOCK - 1) / BST_BLOCK;
}

/* Sets of which patterns in the image the nodes' errors are. */
static void set_patterns(const bst_smear_node_list *list, bst_smear_level *out) {
    double most = 0.0;
    for (int k = BST_NODE_SCALES - 1; k >= 0; k--) {
        double whole = out->predicted[k];
        most = fmax(most, whole > 0.0 ? fmin(list->higher[k] / whole, 1.0) : 1.0);
        out->higher_part[k] = most;
        for (int p = 0; p < BST_PATTERNS; p++) {
            out->missed_part[k][p] = whole > 0.0 ? fmin(list->missed[k][p] / whole, 1.0) : 0.0;
        }
    }
    out->directions = list->directions;
}

/* Fills whole blocks of a table with nodes, and their errors. column: fills one of
 * BST_TABLE_ROWS. */
static void describe_nodes(const bst_smear *s, const bst_smear_node_list *list, to_table column,
                           float *table, bst_smear_level *out) {
    *out = (bst_smear_level){.blocks = blocks_of(list), .rests = list->rests};
    double widest = set_profile_error(s, list, out);
    double part[BST_NODE_PARTS];
    bst_smear_nodes_parts(list->items, list->count, s->sigma_px, s->options.node_sigma_px > 0.0,
                          part);
    out->widening_px2 = part[BST_PART_WIDENING] * widest * s->sigma_px * s->sigma_px;
    out->alike = out->profile_error == out->predicted_profile;
    for (int k = 0; k < BST_NODE_SCALES; k++) {
        out->error[k] = part[BST_PART_BOUND] * list->error[k];
        out->predicted[k] = part[BST_PART_PREDICTED] * list->predicted[k];
        out->alike = out->alike && out->predicted[k] == out->error[k];
    }
    if (s->sensitivity) {
        set_patterns(list, out);
    }
    for (int n = 0; n < out->blocks * BST_BLOCK; n++) {
        float *block = table + (size_t)(n / BST_BLOCK) * BST_TABLE_FLOATS;
        /* the last block is padded with zero-weight copies of the last node */
        column(s, &list->items[n < list->count ? n : list->count - 1], block + n % BST_BLOCK);
        if (n >= list->count) {
            block[9 * BST_BLOCK + n % BST_BLOCK] = 0.0f;
        }
    }
}

/* Room for `blocks` more blocks of the frame's table. */
static bst_status extend_table(bst_ctx *ctx, bst_smear *s, int blocks, float **table) {
    BST_TRY(bst_smear_reserve(ctx, (void **)&s->table, &s->table_capacity, s->table_blocks + blocks,
                              BST_TABLE_FLOATS * sizeof(float)));
    *table = s->table + (size_t)s->table_blocks * BST_TABLE_FLOATS;
    return BST_OK;
}

bst_status bst_smear_append_nodes(bst_ctx *ctx, bst_smear *s, bool shift, bst_smear_level *out) {
    float *table;
    BST_TRY(extend_table(ctx, s, blocks_of(&s->nodes), &table));
    describe_nodes(s, &s->nodes, shift ? shift_to_table : attitude_to_table, table, out);
    out->first_block = s->table_blocks;
    s->table_blocks += out->blocks;
    return BST_OK;
}

bst_status bst_smear_append_ahead(bst_ctx *ctx, bst_smear *s, const bst_smear_ahead_level *ahead,
                                  bst_smear_level *out) {
    float *table;
    int blocks = ahead->level.blocks;
    BST_TRY(extend_table(ctx, s, blocks, &table));
    memcpy(table, ahead->table, (size_t)blocks * BST_TABLE_FLOATS * sizeof *table);
    *out = ahead->level;
    out->first_block = s->table_blocks;
    s->table_blocks += blocks;
    return BST_OK;
}

bst_status bst_smear_make_level(bst_ctx *ctx, bst_smear *s, int n) {
    if (s->levels[n].blocks > 0) {
        return BST_OK;
    }
    if (s->fixed) {
        return BST_ERR_STATE; /* seen by bst_smear_sources alone */
    }
    if (s->ahead[n].ready) {
        return bst_smear_append_ahead(ctx, s, &s->ahead[n], &s->levels[n]);
    }
    bst_smear_nodes_clear(&s->nodes);
    BST_TRY(bst_smear_path_nodes(ctx, s, s->path, s->path_count, 1.0, !s->single, s->tolerance[n]));
    return bst_smear_append_nodes(ctx, s, s->single, &s->levels[n]);
}

bst_status bst_smear_describe_ahead(bst_ctx *ctx, const bst_smear *s, bool shift,
                                    bst_smear_ahead_level *out) {
    BST_TRY(bst_smear_reserve(ctx, (void **)&out->table, &out->capacity, blocks_of(&s->nodes),
                              BST_TABLE_FLOATS * sizeof(float)));
    describe_nodes(s, &s->nodes, shift ? shift_to_table : attitude_to_table, out->table,
                   &out->level);
    out->ready = true;
    return BST_OK;
}

bst_status bst_smear_make_ahead(bst_ctx *ctx, const bst_smear *s, int n,
                                bst_smear_ahead_level *out) {
    bst_smear own = *s; /* the nodes are the only work space */
    own.nodes = out->nodes;
    bst_smear_nodes_clear(&own.nodes);
    bst_status status =
        bst_smear_path_nodes(ctx, &own, s->path, s->path_count, 1.0, !s->single, s->tolerance[n]);
    if (status == BST_OK) {
        status = bst_smear_describe_ahead(ctx, &own, s->single, out);
    }
    out->nodes = own.nodes;
    return status;
}

double bst_smear_allowed(const bst_smear *s, double peak_e) {
    return s->aim * s->options.tolerance_sigma * sqrt(FLANK * peak_e + s->dark_variance_e2) /
           fmax(peak_e, 1e-9);
}

int bst_smear_first_level(const bst_smear *s, double scale, double allowed) {
    int n = 0;
    if (s->options.temporal_oversample > 0) {
        return n;
    }
    /* mostly three nodes per group: sixth-order errors, for motions up to the path's */
    double power = scale * scale * scale, part = power * power;
    part = part < 1.0 ? part : 1.0;
    while (n + 1 < BST_SMEAR_LEVELS && part * s->tolerance[n] + s->point_error > allowed) {
        n++;
    }
    return n;
}

int bst_smear_choose_level(const bst_smear *s, double scale) {
    return bst_smear_first_level(s, scale, NODE_SHARE * bst_smear_allowed(s, s->last_read_e));
}
